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
row that sees it on. Channels are float32: ids are taken modulo 2^24, up to which they are exact.
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
            rows: list[Array] = []
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
                rows.append(self._rows(camera, now, speed)[again])
                self._before[camera] = now
            if not withheld:
                values = np.concatenate(rows)
                payload = self._encoder.encode(int(frames.t_ns[k]), values[:, :3], values[:, 3:])
                yield FeatureMessage(
                    int(frames.number[k]), int(frames.t_ns[k]), int(frames.release_t_ns[k]), payload
                )

    def _rows(self, camera: int, now: _Seen, speed: Array) -> Array:
        """Return points and channels (n, 3 + m)."""
        size = len(now.id)
        points = np.column_stack([now.place, np.ones(size)])
        if self._layout == "mono":
            cameras = len(self._trackers)
            identity = (now.id % (_EXACT_IDS // cameras)) * cameras + camera
            return np.column_stack([points, identity, now.uv, speed])
        truth = self._landmarks[now.landmark]
        which = np.full(size, float(camera))
        return np.column_stack([points, now.id % _EXACT_IDS, which, now.uv, speed, truth])


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
