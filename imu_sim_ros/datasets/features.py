# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The topics of cameras: frames as messages, one home for bags and the live node."""

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.encode import ODOMETRY
from imu_sim_ros.bags.messages.encode_cameras import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    POINT_CLOUD,
    POINT_CLOUD2,
    CameraInfo,
    CameraInfoEncoder,
    CompressedImageEncoder,
    ImageEncoder,
    PointCloud2Encoder,
    PointCloudEncoder,
)
from imu_sim_ros.bags.messages.schemas import Qos
from imu_sim_ros.conventions import (
    BODIES_TOPIC,
    CAMERA_INFO_TOPIC,
    COMPRESSED_TOPIC,
    DEPTH_TOPIC,
    FEATURES_TOPIC,
    FLOW_TOPIC,
    IMAGE_TOPIC,
    LANDMARKS_TOPIC,
    MASK_TOPIC,
)
from imu_sim_ros.datasets.topics import resolved
from imu_sim_ros.sensors.camera.images.files import png
from imu_sim_ros.sensors.camera.images.imager import Imager
from imu_sim_ros.sensors.camera.images.imager import imagers as imagers_of
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.rig import Rig
from imu_sim_ros.sensors.camera.rig_parameters import RigParameters
from imu_sim_ros.sensors.camera.scene import Scene
from imu_sim_ros.sensors.camera.scene_parameters import body_names
from imu_sim_ros.sensors.camera.tracker import Tracker, Tracks
from imu_sim_ros.sensors.camera.view import View
from imu_sim_ros.types import Array, Integers, Mask

CHANNELS: Final = {
    "mono": ("id", "u", "v", "velocity_x", "velocity_y"),
    "fusion": ("id", "camera_id", "u", "v", "velocity_x", "velocity_y", "gx", "gy", "gz"),
}
BODY_CHANNEL: Final = "body"
"""The last one in scenes in which something moves: the id of the body; 0: at rest."""
_EXACT_IDS: Final = 1 << 24


class FeatureMessage(NamedTuple):
    """The features of one frame."""

    number: int
    """Number of the first camera's frame."""
    t_ns: int
    release_t_ns: int
    payload: bytes


class _Observed(NamedTuple):
    """The features of one frame of one camera, by id."""

    t_ns: int
    id: Integers
    uv: Array
    place: Array
    """(n, 2) normalised."""
    landmark: Integers
    body: Integers

    def at(self, rows: Mask) -> "_Observed":
        """Return some of the features."""
        uv, place = self.uv[rows], self.place[rows]
        return _Observed(self.t_ns, self.id[rows], uv, place, self.landmark[rows], self.body[rows])


class _Ids:
    """The ids of tracks: a new one for each run of messages that a landmark is in."""

    def __init__(self, landmarks: int) -> None:
        self._count = np.zeros(landmarks, dtype=np.int64)
        """How many tracks each landmark has had."""
        self._last = np.empty(0, dtype=np.int64)
        """The features of the last message."""

    def next(self, features: list[_Observed]) -> list[Integers]:
        """Return the ids (n,) of what each camera sends in the next message."""
        feature, at = np.unique(np.concatenate([seen.id for seen in features]), return_index=True)
        landmark = np.concatenate([seen.landmark for seen in features])[at]
        # A new life of a landmark (track_lifetime) is a new feature.
        begun = ~np.isin(feature, self._last, assume_unique=True)
        self._count[landmark[begun]] += 1
        self._last = feature
        size = len(self._count)
        return [s.landmark + size * (self._count[s.landmark] - 1) for s in features]


class FeatureStream:
    """The messages of all frames, in order; one stream has one reader.

    The first camera's frames make messages. Other cameras of the same rate and phase, and so with
    frames at the same times, are in them; cameras with times of their own are not.
    """

    def __init__(self, rig: Rig, layout: str, world_frame: str, encoding: str = "cdr") -> None:
        """Set up the stream.

        :param layout: a key of CHANNELS.
        """
        first, *others = rig.views.values()
        time = (first.parameters.rate, first.parameters.phase)
        together = [v for v in others if (v.parameters.rate, v.parameters.phase) == time]
        self._trackers: list[Tracker] = [rig.tracker(v.name) for v in (first, *together)]
        self._layout, self._moving = layout, rig.scene.crowd is not None
        channels = (*CHANNELS[layout], *[BODY_CHANNEL] * self._moving)
        self._encoder = PointCloudEncoder(world_frame, channels, encoding)
        self._before: list[_Observed | None] = [None] * len(self._trackers)
        self._ids = _Ids(self._trackers[0].landmarks)
        self.position = 0

    def next(self, count: int) -> list[FeatureMessage]:
        """Return the messages of the next ``count`` frames."""
        found = [tracker.tracks(self.position, count) for tracker in self._trackers]
        self.position += count
        return list(self._messages(found))

    def _messages(self, found: list[Tracks]) -> Iterator[FeatureMessage]:
        frames = found[0].frames
        places = [_normalised(t, tracks) for t, tracks in zip(self._trackers, found, strict=True)]
        for k in np.flatnonzero(frames.delivered).tolist():
            withheld = self._before[0] is None
            sending: list[tuple[int, _Observed, Array]] = []
            sent = None
            for camera, (tracks, place) in enumerate(zip(found, places, strict=True)):
                if not tracks.frames.delivered[k]:
                    continue
                now = _frame(tracks, place, k)
                speed, again = _speed(now, self._before[camera])
                if camera and self._layout == "fusion" and sent is not None:
                    # VINS-Fusion asserts that what its right camera sees the left one does.
                    again &= np.isin(now.id, sent)
                sent = now.id[again] if camera == 0 else sent
                sending.append((camera, now.at(again), speed[again]))
                self._before[camera] = now
            if not withheld:
                ids = self._ids.next([seen for _, seen, _ in sending])
                true_t_ns = int(frames.true_t_ns[k])
                rows = [
                    self._rows(*part, i, true_t_ns) for part, i in zip(sending, ids, strict=True)
                ]
                values = np.concatenate(rows)
                payload = self._encoder.encode(int(frames.t_ns[k]), values[:, :3], values[:, 3:])
                yield FeatureMessage(
                    int(frames.number[k]), int(frames.t_ns[k]), int(frames.release_t_ns[k]), payload
                )

    def _rows(
        self, camera: int, seen: _Observed, speed: Array, ids: Integers, true_t_ns: int
    ) -> Array:
        """Return points and channels (n, 3 + m)."""
        points = np.column_stack([seen.place, np.ones(len(ids))])
        body = [seen.body] * self._moving
        if self._layout == "mono":
            cameras = len(self._trackers)
            identity = (ids % (_EXACT_IDS // cameras)) * cameras + camera
            return np.column_stack([points, identity, seen.uv, speed, *body])
        truth = self._trackers[camera].places(seen.landmark, true_t_ns)
        which = np.full(len(ids), float(camera))
        return np.column_stack([points, ids % _EXACT_IDS, which, seen.uv, speed, truth, *body])


def _normalised(tracker: Tracker, tracks: Tracks) -> Array:
    """Return x / z and y / z (n, 2) of the measured pixels; NaN if there is no such place."""
    rays = tracker.view.model.unproject(tracks.uv)
    in_front = rays.valid & (rays.direction[:, 2] > 0.0)
    z = np.where(in_front, rays.direction[:, 2], np.nan)
    return rays.direction[:, :2] / z[:, None]


def _frame(tracks: Tracks, place: Array, k: int) -> _Observed:
    """Return the features of frame k that have a normalised place, by id."""
    part = slice(*np.searchsorted(tracks.frame, [k, k + 1]))
    rows = np.flatnonzero(np.isfinite(place[part, 0])) + part.start
    rows = rows[np.argsort(tracks.id[rows], kind="stable")]
    t_ns = int(tracks.frames.t_ns[k])
    columns = (tracks.id, tracks.uv, place, tracks.landmark, tracks.body)
    return _Observed(t_ns, *(column[rows] for column in columns))


def _speed(now: _Observed, before: _Observed | None) -> tuple[Array, Mask]:
    """Return the normalised velocities (n, 2) [1/s], and which features were there before."""
    if before is None or not len(before.id):
        return np.zeros_like(now.place), np.zeros(len(now.id), dtype=bool)
    at = np.searchsorted(before.id, now.id).clip(0, len(before.id) - 1)
    again = before.id[at] == now.id
    speed = (now.place - before.place[at]) / ((now.t_ns - before.t_ns) * 1e-9)
    return speed, again


LATCHED: Final = Qos(durability="transient_local", depth=1)
_DISTORTIONS: Final = {"none": "plumb_bob", "radtan": "plumb_bob", "equidistant": "equidistant"}
"""The names in image_geometry and kalibr's converters."""


def camera_topics(rig: RigParameters) -> dict[str, str]:
    """Return the type of each topic that a rig has, by name."""
    found: dict[str, str] = {}
    bodies = body_names(rig.scene)
    for name, camera in rig.each().items():
        kinds = _kinds(camera, bool(bodies))
        found.update({f"{name}/{topic}": kind for topic, kind in kinds.items()})
    if rig.features.layout != "none":
        found[FEATURES_TOPIC] = POINT_CLOUD
    found[LANDMARKS_TOPIC] = POINT_CLOUD2
    found.update({f"{BODIES_TOPIC}/{name}": ODOMETRY for name in bodies})
    return found


def image_topic(camera: str, names: Mapping[str, str]) -> str:
    """Return the name of a camera's image topic: the raw one's, unless only the other is there.

    :param names: of the topics that are written, by their own names.
    """
    raw, compressed = (f"{camera}/{topic}" for topic in (IMAGE_TOPIC, COMPRESSED_TOPIC))
    key = compressed if compressed in names and raw not in names else raw
    return resolved(names.get(key, key))


def _kinds(camera: CameraParameters, moving: bool) -> dict[str, str]:
    """Return the type of each topic below a camera's name.

    :param moving: whether something moves in the scene.
    """
    kinds = {}
    if camera.images in ("raw", "both"):
        kinds[IMAGE_TOPIC] = IMAGE
    if camera.images in ("compressed", "both"):
        kinds[COMPRESSED_TOPIC] = COMPRESSED_IMAGE
    if camera.depth:
        kinds[DEPTH_TOPIC] = IMAGE
        if moving:
            kinds[MASK_TOPIC] = IMAGE
    if camera.flow != "none":
        kinds[FLOW_TOPIC] = IMAGE
    kinds[CAMERA_INFO_TOPIC] = CAMERA_INFO
    return kinds


class CameraMessages:
    """Frames of one camera as the messages of its topics; may be used by several threads."""

    def __init__(self, view: View, frame_id: str, imager: Imager | None, encoding: str) -> None:
        """Set up the messages.

        :param imager: None: no images.
        """
        p = view.parameters
        kinds = _kinds(p, imager is not None and imager.moving)
        self._imager = imager
        self._info = CameraInfoEncoder(frame_id, info_of_camera(p), encoding)
        self._raw = self._png = self._depth = self._mask = self._flow = None
        if IMAGE_TOPIC in kinds:
            self._raw = ImageEncoder(frame_id, p.height, p.width, p.encoding, encoding)
        if COMPRESSED_TOPIC in kinds:
            self._png = CompressedImageEncoder(frame_id, p.encoding, encoding)
        if DEPTH_TOPIC in kinds:
            self._depth = ImageEncoder(frame_id, p.height, p.width, "32FC1", encoding)
        if FLOW_TOPIC in kinds:
            self._flow = ImageEncoder(frame_id, p.height, p.width, "32FC2", encoding)
        if MASK_TOPIC in kinds:
            self._mask = ImageEncoder(frame_id, p.height, p.width, "mono8", encoding)

    def messages(self, number: int, t_ns: int) -> dict[str, bytes]:
        """Return the messages of a frame with a stamp, by topic below the camera's name."""
        found = {CAMERA_INFO_TOPIC: self._info.encode(t_ns)}
        if self._imager is None:
            return found
        if self._raw is not None or self._png is not None:
            image = self._imager.image(number)
            if self._raw is not None:
                found[IMAGE_TOPIC] = self._raw.encode(t_ns, image)
            if self._png is not None:
                found[COMPRESSED_TOPIC] = self._png.encode(t_ns, png(image))
        if self._depth is not None:
            depth, mask = self._imager.depth_and_mask(number)
            found[DEPTH_TOPIC] = self._depth.encode(t_ns, depth)
            if self._mask is not None and mask is not None:
                found[MASK_TOPIC] = self._mask.encode(t_ns, mask)
        if self._flow is not None:
            found[FLOW_TOPIC] = self._flow.encode(t_ns, self._imager.flow(number))
        return found


def imagers(rig: Rig, names: list[str]) -> dict[str, Imager]:
    """Return the imagers of the cameras named, for those with images, depth or flow.

    :raises ConfigurationError: for a scene without surfaces.
    :raises MissingDependencyError: if OpenCV is not installed.
    """
    views = {name: rig.views[name] for name in names}
    wanted = {
        name: view
        for name, view in views.items()
        if view.parameters.images != "none"
        or view.parameters.depth
        or view.parameters.flow != "none"
    }
    return imagers_of(wanted, rig.scene, rig.parameters.scene, rig.trajectory)


def info_of_camera(camera: CameraParameters) -> CameraInfo:
    """Return a camera's model in the terms of sensor_msgs/CameraInfo.

    D is xi and the distortion for a unified sphere, xi and alpha for a double one; ROS has no
    names for the two, so they have ours.
    """
    model = CameraModel(camera)
    k = np.array([[model.fx, 0.0, model.cx], [0.0, model.fy, model.cy], [0.0, 0.0, 1.0]])
    p = np.column_stack([k, np.zeros(3)])
    kind, d = _DISTORTIONS[camera.distortion_model], camera.distortion
    if kind == "plumb_bob":
        d = (*d, *[0.0] * (5 - len(d)))
    if camera.model != "pinhole":
        kind = camera.model
        own = (camera.xi,) if camera.model == "unified" else (camera.xi, camera.alpha)
        d = (*own, *camera.distortion)
    return CameraInfo(camera.height, camera.width, kind, d, k, np.eye(3), p)


def landmarks(scene: Scene, world_frame: str, t_ns: int, encoding: str = "cdr") -> bytes:
    """Return all landmarks at rest with their ids as sensor_msgs/PointCloud2."""
    fields = [*((axis, "<f4") for axis in "xyz"), ("id", "<u4")]
    rows = np.zeros(len(scene.landmarks), fields)
    for k, axis in enumerate("xyz"):
        rows[axis] = scene.landmarks[:, k]
    rows["id"] = np.arange(len(rows))
    return PointCloud2Encoder(world_frame, encoding).encode(t_ns, rows)
