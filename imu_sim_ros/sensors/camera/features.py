# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracked features in the frames of all cameras, in the messages of VINS-Mono and VINS-Fusion."""

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.conventions import FEATURES_TOPIC
from imu_sim_ros.core.types import Array, Integers, Mask
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.rig_parameters import RigParameters
from imu_sim_ros.sensors.camera.scene_parameters import body_names
from imu_sim_ros.sensors.camera.tracker import Tracker, Tracks
from imu_sim_ros.sensors.camera.truths import DATASETS, AtFrames
from imu_sim_ros.sensors.declaration import Mounted, Payloads, Rendering, Sensor, Topic
from imu_sim_ros.sensors.deferred import Deferred
from imu_sim_ros.sensors.samples import Rows, Samples
from imu_sim_ros.sensors.world import Window, World

CHANNELS: Final = {
    "mono": ("id", "u", "v", "velocity_x", "velocity_y"),
    "fusion": ("id", "camera_id", "u", "v", "velocity_x", "velocity_y", "gx", "gy", "gz"),
}
BODY_CHANNEL: Final = "body"
"""The last one in scenes in which something moves: the id of the body; 0: at rest."""
_EXACT_IDS: Final = 1 << 24
"""Number of integers from 0 on that float32 holds exactly."""


class FeatureMessage(NamedTuple):
    """The features of one frame."""

    number: int
    """Number of the first camera's frame."""
    values: Array
    """(n, 3 + m) points (x, y, 1), normalised coordinates, and their m channels (CHANNELS)."""


class _Observed(NamedTuple):
    """The features of one frame of one camera, by id."""

    t_ns: int
    """Stamp of the frame [ns]."""
    id: Integers
    """(n,) ids of the tracks, ascending."""
    uv: Array
    """(n, 2) measured pixels."""
    normalised: Array
    """(n, 2) normalised coordinates."""
    landmark: Integers
    """(n,) numbers of the landmarks."""
    body: Integers
    """(n,) numbers of the moving bodies that they are on, from 1; 0: at rest."""

    def at(self, rows: Mask) -> "_Observed":
        """Return some of the features."""
        return self._replace(
            id=self.id[rows],
            uv=self.uv[rows],
            normalised=self.normalised[rows],
            landmark=self.landmark[rows],
            body=self.body[rows],
        )


class _CameraFeatures(NamedTuple):
    """Features of one camera in a message."""

    camera: int
    """Number of the camera."""
    observed: _Observed
    speed: Array
    """(n, 2) change of their normalised coordinates since the previous frame [1/s]."""


class _Ids:
    """The ids of tracks: a new one for each run of messages that a landmark is in."""

    def __init__(self, landmarks: int) -> None:
        self._count = np.zeros(landmarks, dtype=np.int64)
        """(landmarks,) number of tracks that each landmark has had."""
        self._last = np.empty(0, dtype=np.int64)
        """The features of the last message."""

    def next(self, features: list[_Observed]) -> list[Integers]:
        """Return the ids (n,) of each camera's features in the next message.

        The k-th track of landmark j, from 0, has the id ``j + k landmarks``.
        """
        feature, rows = np.unique(
            np.concatenate([observations.id for observations in features]), return_index=True
        )
        landmark = np.concatenate([observations.landmark for observations in features])[rows]
        # A landmark whose track ended (track_lifetime) is a new feature.
        begun = ~np.isin(feature, self._last, assume_unique=True)
        self._count[landmark[begun]] += 1
        self._last = feature
        size = len(self._count)
        return [s.landmark + size * (self._count[s.landmark] - 1) for s in features]


def together(cameras: Mapping[str, CameraParameters]) -> list[str]:
    """Return the first camera and those with frames at the same times: of its rate and phase."""
    times = {name: (camera.rate, camera.phase) for name, camera in cameras.items()}
    reference = next(iter(times.values()))
    return [name for name, timing in times.items() if timing == reference]


class FeatureStream:
    """The messages of all frames, in order; one stream has one reader.

    The first camera's frames make messages, with what the other cameras see at the same times.
    """

    def __init__(self, trackers: list[Tracker], layout: str) -> None:
        """Set up the stream.

        :param trackers: feature trackers of the cameras :func:`together`.
        :param layout: a key of CHANNELS.
        """
        self._trackers = trackers
        self._layout, self._moving = layout, trackers[0].scene.crowd is not None
        self._before: list[_Observed | None] = [None] * len(self._trackers)
        self._ids = _Ids(self._trackers[0].landmarks)
        self.position = 0

    def next(self, count: int) -> list[FeatureMessage]:
        """Return the messages of the next ``count`` frames."""
        camera_tracks = [tracker.tracks(self.position, count) for tracker in self._trackers]
        self.position += count
        return list(self._messages(camera_tracks))

    def _messages(self, camera_tracks: list[Tracks]) -> Iterator[FeatureMessage]:
        """Yield a message for each frame of the first camera, with the tracks of all."""
        frames = camera_tracks[0].frames
        normalised = [
            _normalise(t, tracks) for t, tracks in zip(self._trackers, camera_tracks, strict=True)
        ]
        for k in np.flatnonzero(frames.delivered).tolist():
            # Speeds need two frames: the first frame has no message.
            withheld = self._before[0] is None
            sending: list[_CameraFeatures] = []
            sent = None  # ids of the first camera's features in the message
            for camera, (tracks, coordinates) in enumerate(
                zip(camera_tracks, normalised, strict=True)
            ):
                if not tracks.frames.delivered[k]:
                    continue
                current = _frame(tracks, coordinates, k)
                speed, again = _speed(current, self._before[camera])
                if camera and self._layout == "fusion" and sent is not None:
                    # VINS-Fusion asserts that what its right camera sees the left one does.
                    again &= np.isin(current.id, sent)
                sent = current.id[again] if camera == 0 else sent
                sending.append(_CameraFeatures(camera, current.at(again), speed[again]))
                self._before[camera] = current
            if not withheld:
                ids_by_camera = self._ids.next([features.observed for features in sending])
                true_t_ns = int(frames.true_t_ns[k])
                rows = [
                    self._rows(features, ids, true_t_ns)
                    for features, ids in zip(sending, ids_by_camera, strict=True)
                ]
                yield FeatureMessage(int(frames.number[k]), np.concatenate(rows))

    def _rows(self, features: _CameraFeatures, ids: Integers, true_t_ns: int) -> Array:
        """Return the points and channels (n, 3 + m) of features, as VINS reads them.

        A point is (x, y, 1) in normalised coordinates. The channels are those of CHANNELS:
        VINS-Mono finds the camera as the remainder of the id by the number of cameras; VINS-Fusion
        has a channel for it, and three for the true position in the world.
        """
        camera, observations, speed = features
        points = np.column_stack([observations.normalised, np.ones(len(ids))])
        body = [observations.body] * self._moving
        if self._layout == "mono":
            cameras = len(self._trackers)
            identity = (ids % (_EXACT_IDS // cameras)) * cameras + camera
            return np.column_stack([points, identity, observations.uv, speed, *body])
        truth = self._trackers[camera].positions(observations.landmark, true_t_ns)
        which = np.full(len(ids), float(camera))
        return np.column_stack(
            [points, ids % _EXACT_IDS, which, observations.uv, speed, truth, *body]
        )


def _normalise(tracker: Tracker, tracks: Tracks) -> Array:
    """Return x / z and y / z (n, 2) of the measured pixels; NaN if there is no such place."""
    rays = tracker.view.model.unproject(tracks.uv)
    in_front = rays.valid & (rays.direction[:, 2] > 0.0)
    z = np.where(in_front, rays.direction[:, 2], np.nan)
    return rays.direction[:, :2] / z[:, None]


def _frame(tracks: Tracks, normalised: Array, k: int) -> _Observed:
    """Return the features of frame k that have normalised coordinates, by id."""
    part = slice(*np.searchsorted(tracks.frame, [k, k + 1]))
    rows = np.flatnonzero(np.isfinite(normalised[part, 0])) + part.start
    rows = rows[np.argsort(tracks.id[rows], kind="stable")]
    t_ns = int(tracks.frames.t_ns[k])
    columns = (tracks.id, tracks.uv, normalised, tracks.landmark, tracks.body)
    return _Observed(t_ns, *(column[rows] for column in columns))


def _speed(current: _Observed, previous: _Observed | None) -> tuple[Array, Mask]:
    """Return the normalised velocities (n, 2) [1/s], and which features were there before."""
    if previous is None or not len(previous.id):
        return np.zeros_like(current.normalised), np.zeros(len(current.id), dtype=bool)
    rows = np.searchsorted(previous.id, current.id).clip(0, len(previous.id) - 1)
    again = previous.id[rows] == current.id
    speed = (current.normalised - previous.normalised[rows]) / (
        (current.t_ns - previous.t_ns) * 1e-9
    )
    return speed, again


class Features(AtFrames):
    """The tracked features, at the frames of the first camera."""

    def __init__(
        self, mounted: Mounted[RigParameters], t0_ns: int, cameras: Mapping[str, object]
    ) -> None:
        super().__init__(mounted, t0_ns, cameras)
        self._stream: FeatureStream | None = None

    def read(self, window: Window, world: World) -> Samples:
        """Return the features in the frames of a window; those of any frame follow from all before.

        The first frame has no message, as from a tracker, which sends what it has seen twice.
        """
        frames, *_ = [camera.frames(window, world) for camera in self.cameras]
        first_frame = 0
        while len(frames.number) and not self.cameras[0].view.frames(first_frame, 1).delivered[0]:
            first_frame += 1
        sent = frames.delivered & (frames.number > first_frame)
        times = frames.true_t_ns[sent], frames.t_ns[sent], frames.release_t_ns[sent]
        rows = partial(self._rows, frames.number)
        return Samples(*times, np.arange(int(sent.sum())), Deferred(rows=rows))

    def _rows(self, numbers: Integers) -> list[Array]:
        """Return points and channels (n, 3 + m) of the messages of consecutive frames."""
        if not len(numbers):
            return []
        first_number, count = int(numbers[0]), len(numbers)
        if self._stream is None or self._stream.position > first_number:
            trackers = [camera.tracker for camera in self.cameras]
            self._stream = FeatureStream(trackers, self.mounted.parameters.features.layout)
        self._stream.next(first_number - self._stream.position)
        return [message.values for message in self._stream.next(count)]


def _clouds(mounted: Mounted[RigParameters], encoding: str) -> Payloads:
    """Return the encoder of tracked features as PointCloud."""
    from imu_sim_ros.bags.messages.encode_cameras import PointCloudEncoder

    rig = mounted.parameters
    channels = (*CHANNELS[rig.features.layout], *[BODY_CHANNEL] * bool(body_names(rig.scene)))
    encoder = PointCloudEncoder(mounted.environment.world_frame, channels, encoding)

    def payloads(readings: Samples, rows: Rows, _: object) -> list[bytes]:
        chosen = np.arange(len(readings.t_ns))[rows].tolist()
        values = [(int(readings.t_ns[k]), readings.rows[k]) for k in chosen]
        return [encoder.encode(t_ns, points[:, :3], points[:, 3:]) for t_ns, points in values]

    return payloads


FEATURES: Final[Sensor[RigParameters]] = Sensor(
    name="features",
    quantity=FEATURES_TOPIC,
    section=RigParameters,
    model=Features,
    topics=(Topic(FEATURES_TOPIC, "sensor_msgs/msg/PointCloud", (), _clouds),),
    readings=None,
    needs=lambda rig: tuple(together(rig.camera_parameters())),
    faulty_parts=(),
    text="features that are tracked in the frames of the cameras",
    rendering=Rendering(DATASETS),
)
