# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks as VINS-Mono's and VINS-Fusion's own trackers send them: sensor_msgs/PointCloud.

Points are normalised and undistorted, (x, y, 1). Channels by their order, the names are not used:

``mono``
    id * cameras + camera, u, v [px], vx, vy [1/s] (feature_tracker_node.cpp);
``fusion``
    id, camera, u, v, vx, vy, and the landmark gx, gy, gz [m] in the world (rosNodeTest.cpp reads
    indices 6 to 8 wherever there are more than five).

As their trackers do, the first frame is withheld, and a feature is sent from the second frame in a
row that sees it on. An id is that of one uninterrupted track: the estimators count the frames of a
feature from its first one and would take those after a gap for others (feature_manager.cpp). A
landmark that comes back gets its number plus a multiple of the number of landmarks. Channels are
float32: ids are taken modulo 2^24, up to which they are exact.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages import PointCloudEncoder
from imu_sim_ros.camera import Rig, Tracker, Tracks

Array = NDArray[np.float64]

CHANNELS: Final = {
    "mono": ("id", "u", "v", "velocity_x", "velocity_y"),
    "fusion": ("id", "camera_id", "u", "v", "velocity_x", "velocity_y", "gx", "gy", "gz"),
}
_EXACT_IDS: Final = 1 << 24


class FeatureMessage(NamedTuple):
    """The features of one frame."""

    number: int
    """Of the frame of the first camera."""
    t_ns: int
    release_t_ns: int
    payload: bytes


class _Seen(NamedTuple):
    """The features of one frame of one camera, by id."""

    t_ns: int
    id: NDArray[np.int64]
    uv: Array
    place: Array
    """(n, 2) normalised."""
    landmark: NDArray[np.int64]

    def at(self, rows: NDArray[np.bool_]) -> "_Seen":
        """Return some of the features."""
        return _Seen(self.t_ns, self.id[rows], self.uv[rows], self.place[rows], self.landmark[rows])


class _Ids:
    """The ids of tracks: a new one for each run of messages that a landmark is in."""

    def __init__(self, landmarks: int) -> None:
        self._count = np.zeros(landmarks, dtype=np.int64)
        """How many tracks each landmark has had."""
        self._last = np.empty(0, dtype=np.int64)
        """The features of the last message."""

    def next(self, features: list[_Seen]) -> list[NDArray[np.int64]]:
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
        self._landmarks = rig.scene.landmarks
        self._layout = layout
        self._encoder = PointCloudEncoder(world_frame, CHANNELS[layout], encoding)
        self._before: list[_Seen | None] = [None] * len(self._trackers)
        self._ids = _Ids(len(self._landmarks))
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
            sending: list[tuple[int, _Seen, Array]] = []
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
                rows = [self._rows(*part, i) for part, i in zip(sending, ids, strict=True)]
                values = np.concatenate(rows)
                payload = self._encoder.encode(int(frames.t_ns[k]), values[:, :3], values[:, 3:])
                yield FeatureMessage(
                    int(frames.number[k]), int(frames.t_ns[k]), int(frames.release_t_ns[k]), payload
                )

    def _rows(self, camera: int, seen: _Seen, speed: Array, ids: NDArray[np.int64]) -> Array:
        """Return points and channels (n, 3 + m)."""
        points = np.column_stack([seen.place, np.ones(len(ids))])
        if self._layout == "mono":
            cameras = len(self._trackers)
            identity = (ids % (_EXACT_IDS // cameras)) * cameras + camera
            return np.column_stack([points, identity, seen.uv, speed])
        truth = self._landmarks[seen.landmark]
        which = np.full(len(ids), float(camera))
        return np.column_stack([points, ids % _EXACT_IDS, which, seen.uv, speed, truth])


def _normalised(tracker: Tracker, tracks: Tracks) -> Array:
    """Return x / z and y / z (n, 2) of the measured pixels; NaN where there is no such place."""
    rays = tracker.view.model.unproject(tracks.uv)
    ahead = rays.valid & (rays.direction[:, 2] > 0.0)
    z = np.where(ahead, rays.direction[:, 2], np.nan)
    result: Array = rays.direction[:, :2] / z[:, None]
    return result


def _frame(tracks: Tracks, place: Array, k: int) -> _Seen:
    """Return the features of frame k that have a normalised place, by id."""
    part = slice(*np.searchsorted(tracks.frame, [k, k + 1]))
    rows = np.flatnonzero(np.isfinite(place[part, 0])) + part.start
    rows = rows[np.argsort(tracks.id[rows], kind="stable")]
    t_ns = int(tracks.frames.t_ns[k])
    return _Seen(t_ns, tracks.id[rows], tracks.uv[rows], place[rows], tracks.landmark[rows])


def _speed(now: _Seen, before: _Seen | None) -> tuple[Array, NDArray[np.bool_]]:
    """Return the normalised velocities (n, 2) [1/s], and which features were there before."""
    if before is None or not len(before.id):
        return np.zeros_like(now.place), np.zeros(len(now.id), dtype=bool)
    at = np.searchsorted(before.id, now.id).clip(0, len(before.id) - 1)
    again = before.id[at] == now.id
    speed = (now.place - before.place[at]) / ((now.t_ns - before.t_ns) * 1e-9)
    return speed, again
