# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Feature tracks: which landmarks a camera sees, where, and with which errors.

A frame depends on nothing but the seed and its number: visibility from the exact pose, the choice
of features from priorities drawn once, noise from streams of its own. So tracks are the same bit
for bit in blocks of any size, live and in a file.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.random_streams import generator
from imu_sim_ros.core.types import Array, Mask, shapes
from imu_sim_ros.places.bodies import MovingBody
from imu_sim_ros.sensors.camera.scene import Scene
from imu_sim_ros.sensors.camera.view import CameraPoses, Frames, View, transform_to_camera
from imu_sim_ros.trajectory.motion import Trajectory

Rows = NDArray[np.int64]

_PAIRS: Final = 1 << 17
"""Landmarks examined at once, over all frames: about as many as fit into a processor's cache."""
_SHUTTER_STEPS: Final = 10
"""Iterations, always all of them: a result must not depend on the rest of the block."""
_SLACK: Final = 0.1
"""Rolling shutter: how far outside the image a landmark may seem at first, in heights."""


class Tracks(NamedTuple):
    """n features of f frames of one camera, frame by frame, by landmark within a frame."""

    frames: Frames
    frame: Rows
    """(n,) row of each feature's frame in ``frames``."""
    id: Rows
    """(n,) id of the track."""
    landmark: Rows
    """(n,) row of the feature's landmark in the scene."""
    uv: Array
    """(n, 2) measured pixel."""
    uv_true: Array
    """(n, 2) exact pixel."""
    depth: Array
    """(n,) z of the landmark in the camera's frame [m]."""
    wrong: Mask
    """(n,) True for outliers, and for features with the pixel of another one."""
    body: Rows
    """(n,) number of the moving body that the landmark is on, from 1; 0: it does not move."""

    def __repr__(self) -> str:
        return shapes(self)


class TrackedLines(NamedTuple):
    """n lines in f frames of one camera; a line is seen if both of its ends are."""

    frame: Rows
    """(n,) row of the frame."""
    id: Rows
    """(n,) row in the scene's lines."""
    ends: Array
    """(n, 2, 2) measured pixels of both ends."""
    ends_true: Array
    """(n, 2, 2) exact pixels."""


class _Observed(NamedTuple):
    """Observations of n visible landmarks."""

    frame: Rows
    """(n,) row of the frame."""
    landmark: Rows
    """(n,) number of the landmark."""
    uv: Array
    """(n, 2) exact pixels."""
    depth: Array
    """(n,) distance along the optical axis [m]."""


class Tracker:
    """The tracks of one camera in one scene."""

    def __init__(self, view: View, scene: Scene, trajectory: Trajectory) -> None:
        """Initialise the tracks of a camera; priorities and ages are drawn from its seed."""
        self.view, self.scene, self.trajectory = view, scene, trajectory
        crowd = scene.crowd
        self._bodies = crowd.bodies if crowd else ()
        counts = [len(points) for points, _ in crowd.landmarks] if crowd else []
        self._first = len(scene.landmarks) + np.cumsum([0, *counts])
        """Number of the first landmark of each body."""
        self.landmarks = int(self._first[-1])
        """Number of all landmarks: those at rest, then those of each body."""
        stream = generator(view.seed, f"{view.name}.priority")
        self._priority = stream.permutation(self.landmarks)
        life = view.parameters.track_lifetime
        ages = generator(view.seed, f"{view.name}.lifetime")
        self._age = ages.integers(0, max(life, 1), self.landmarks)

    def tracks(self, first: int, count: int) -> Tracks:
        """Return the features of frames ``first .. first + count - 1``; lost ones have none."""
        frames = self.view.frames(first, count)
        observations = self._select_features(self._visible(frames))
        uv, wrong = self._measure(frames, observations)
        return Tracks(
            frames=frames,
            frame=observations.frame,
            id=self._ids(frames.number[observations.frame], observations.landmark),
            landmark=observations.landmark,
            uv=uv,
            uv_true=observations.uv,
            depth=observations.depth,
            wrong=wrong,
            body=np.searchsorted(self._first, observations.landmark, side="right"),
        )

    def positions(self, landmark: Rows, t_ns: int) -> Array:
        """Return where landmarks (n,) are in the world at a time [ns]: (n, 3)."""
        at_rest = landmark < len(self.scene.landmarks)
        result = self.scene.landmarks[np.where(at_rest, landmark, 0)]
        body = np.searchsorted(self._first, landmark, side="right")
        for number, moving_body in enumerate(self._bodies, start=1):
            rows = np.flatnonzero(body == number)
            assert self.scene.crowd is not None
            points, _ = self.scene.crowd.landmarks[number - 1]
            t = np.full(len(rows), self.view.seconds(np.array([t_ns]))[0])
            result[rows] = moving_body.to_world(t, points[landmark[rows] - self._first[number - 1]])
        return result

    def counts(self, first: int, count: int) -> Rows:
        """Return how many landmarks (count,) each of some frames sees, before any cap.

        -1 for lost frames.
        """
        frames = self.view.frames(first, count)
        return np.where(frames.delivered, self.visible_counts(frames), -1)

    def visible_counts(self, frames: Frames) -> Rows:
        """Return how many landmarks (n,) each of n frames sees, before any cap; 0 for lost ones."""
        return np.bincount(self._visible(frames).frame, minlength=len(frames.number))

    def lines(self, first: int, count: int) -> TrackedLines:
        """Return the lines of frames ``first .. first + count - 1``."""
        frames = self.view.frames(first, count)
        ends = self.scene.lines.reshape(-1, 3)
        observations = self._look(frames, ends, np.zeros_like(ends))
        pixels = np.full((count, len(ends), 2), np.nan)
        pixels[observations.frame, observations.landmark] = observations.uv
        both = pixels.reshape(count, len(self.scene.lines), 2, 2)
        frame, line = np.nonzero(np.isfinite(both).all(axis=(2, 3)))
        true = both[frame, line]
        measured = true.copy()
        sigma = self.view.parameters.pixel_noise
        for k in np.unique(frame) if sigma > 0.0 else ():
            rows = slice(*np.searchsorted(frame, [k, k + 1]))
            noise = self.view.stream("line_noise", int(frames.number[k]))
            measured[rows] += sigma * noise.standard_normal(true[rows].shape)
        return TrackedLines(frame, line, measured, true)

    def _ids(self, index: Rows, landmark: Rows) -> Rows:
        """Return the tracks' ids: the landmark's, plus the number of landmarks for each life."""
        life = self.view.parameters.track_lifetime
        if not life:
            return landmark
        result: Rows = landmark + len(self._age) * ((index + self._age[landmark]) // life)
        return result

    def _visible(self, frames: Frames) -> _Observed:
        """Return the landmarks that frames show, those on moving bodies too."""
        observations = self._look(frames, self.scene.landmarks, self.scene.normals)
        if self.scene.crowd is None:
            return observations
        parts = [observations]
        moving_parts = zip(self._first, self._bodies, self.scene.crowd.landmarks, strict=False)
        for first_landmark, body, (points, normals) in moving_parts:
            of_body = self._look(frames, points, normals, body)
            parts.append(of_body._replace(landmark=of_body.landmark + first_landmark))
        all_observations = _Observed(
            *(np.concatenate(column) for column in zip(*parts, strict=True))
        )
        return _select(
            all_observations, np.lexsort((all_observations.landmark, all_observations.frame))
        )

    def _look(
        self, frames: Frames, points: Array, normals: Array, body: MovingBody | None = None
    ) -> _Observed:
        """Return which points are seen in which frames, in as many steps as memory requires.

        :param points: (n, 3) landmarks [m], with ``normals`` (n, 3) of their surfaces.
        :param body: body in whose axes they are; None: in the world.
        """
        delivered = np.flatnonzero(frames.delivered)
        step = max(1, _PAIRS // max(1, len(points)))
        parts = [
            self._look_at_once(frames, delivered[k : k + step], points, normals, body)
            for k in range(0, len(delivered), step)
        ]
        if not parts:
            empty = np.zeros(0, dtype=np.int64)
            return _Observed(empty, empty, np.zeros((0, 2)), np.zeros(0))
        return _Observed(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def _poses(self, t: Array, body: MovingBody | None) -> CameraPoses:
        """Return where the camera is at times t (n,) [s], in the world or in a body's axes."""
        poses = self.view.poses(self.trajectory, t)
        return poses if body is None else CameraPoses(*body.sees(t, *poses))

    def _look_at_once(
        self, frames: Frames, rows: Rows, points: Array, normals: Array, body: MovingBody | None
    ) -> _Observed:
        """Return the landmarks that some frames show, without those that something hides.

        :param rows: rows of the frames.
        :param points: (n, 3) landmarks in the axes of the body, or in the world [m].
        :param normals: (n, 3) normals of their surfaces; zero: seen from all sides.
        :param body: body in whose axes they are; None: in the world.
        """
        p, model = self.view.parameters, self.view.model
        t = self.view.seconds(frames.true_t_ns[rows])
        poses = self._poses(t, body)
        slack = _SLACK * model.height if p.row_time > 0.0 else 0.0
        frame, point, local = self._in_front(poses, points)
        uv, valid = model.project(local)
        visible = valid & model.inside(uv, p.border - slack)
        frame, point, uv, depth = frame[visible], point[visible], uv[visible], local[visible, 2]
        eye, t = CameraPoses(poses.position[frame], poses.q_wc[frame]), t[frame]
        if slack:
            eye, t, uv, depth, visible = self._through_rolling_shutter(t, points[point], uv, body)
            eye, t = CameraPoses(eye.position[visible], eye.q_wc[visible]), t[visible]
            frame, point, uv, depth = frame[visible], point[visible], uv[visible], depth[visible]
        shown = self._is_visible(t, eye.position, points[point], normals[point], body)
        return _Observed(rows[frame[shown]], point[shown], uv[shown], depth[shown])

    def _in_front(self, poses: CameraPoses, points: Array) -> tuple[Rows, Rows, Array]:
        """Return frames and rows of all points within the depths, and the points in the camera."""
        p = self.view.parameters
        count = len(points)
        local = transform_to_camera(
            CameraPoses(poses.position[:, None], poses.q_wc[:, None]), points[None]
        ).reshape(-1, 3)
        in_range = np.flatnonzero((local[:, 2] > p.min_depth) & (local[:, 2] < p.max_depth))
        return in_range // count, in_range % count, local[in_range]

    def _through_rolling_shutter(
        self, t: Array, points: Array, uv: Array, body: MovingBody | None
    ) -> tuple[CameraPoses, Array, Array, Array, Mask]:
        """Return poses, times, pixels and depths when each pixel's row is exposed.

        The row decides the time, and the time the row: ``t = t_frame + row_time (v - (h - 1) / 2)``
        is iterated, which converges as fast as rows move slower in the image than the shutter.

        :param t: (n,) times of the frames [s].
        :param points: (n, 3) points in the body's axes, or in the world [m].
        :param uv: (n, 2) pixels at the frames' times.
        """
        p, model = self.view.parameters, self.view.model
        for _ in range(_SHUTTER_STEPS):
            shift = p.row_time * (uv[:, 1] - 0.5 * (model.height - 1))
            poses = self._poses(t + shift, body)
            local = transform_to_camera(poses, points)
            uv, valid = model.project(local)
        depth = local[:, 2]
        visible = valid & model.inside(uv, p.border) & (depth > p.min_depth) & (depth < p.max_depth)
        return poses, t + shift, uv, depth, visible

    def _is_visible(
        self, t: Array, eye: Array, points: Array, normals: Array, body: MovingBody | None
    ) -> Mask:
        """Return True for points (n, 3) that face the eye (n, 3) and are not hidden at t (n,)."""
        facing = (normals * (eye - points)).sum(axis=1)
        shown: Mask = (facing > 0.0) | ~normals.any(axis=1)
        rows = np.flatnonzero(shown)
        t, eye, points = t[rows], eye[rows], points[rows]
        if body is not None:
            eye, points = body.to_world(t, eye), body.to_world(t, points)
        behind = self.scene.is_hidden(eye, points)
        if self.scene.crowd is not None:
            behind |= self.scene.crowd.is_hidden(t, eye, points)
        shown[rows[behind]] = False
        return shown

    def _select_features(self, observations: _Observed) -> _Observed:
        """Return at most ``max_features`` of each frame: of each cell those of highest priority."""
        p = self.view.parameters
        if not p.max_features or not len(observations.frame):
            return observations
        row = ((observations.uv[:, 1] + 0.5) * p.grid_rows / p.height).astype(np.int64)
        column = ((observations.uv[:, 0] + 0.5) * p.grid_columns / p.width).astype(np.int64)
        cells = p.grid_rows * p.grid_columns
        cell = row.clip(0, p.grid_rows - 1) * p.grid_columns + column.clip(0, p.grid_columns - 1)
        priority = self._priority[observations.landmark]
        rank = _rank(observations.frame * cells + cell, priority)
        # The best of every cell come before the second best of any.
        order = rank * len(self._priority) + priority
        keep = _rank(observations.frame, order) < p.max_features
        return _select(observations, keep)

    def _measure(self, frames: Frames, observations: _Observed) -> tuple[Array, Mask]:
        """Return the pixels with noise, outliers and mismatches, and which are wrong."""
        p = self.view.parameters
        uv, wrong = observations.uv.copy(), np.zeros(len(observations.uv), dtype=bool)
        if not (p.pixel_noise or p.outlier_probability or p.mismatch_probability):
            return uv, wrong
        edges = np.searchsorted(observations.frame, np.arange(len(frames.number) + 1))
        for k, index in enumerate(frames.number.tolist()):
            part = slice(edges[k], edges[k + 1])
            if p.pixel_noise > 0.0:
                noise = self.view.stream("pixel_noise", index)
                uv[part] += p.pixel_noise * noise.standard_normal(uv[part].shape)
            if p.outlier_probability > 0.0:
                stream = self.view.stream("outlier", index)
                hit = stream.random(len(uv[part])) < p.outlier_probability
                anywhere = stream.random(uv[part].shape) * (p.width, p.height) - 0.5
                uv[part][hit], wrong[part][hit] = anywhere[hit], True
            if p.mismatch_probability > 0.0:
                stream = self.view.stream("mismatch", index)
                mixed = np.flatnonzero(stream.random(len(uv[part])) < p.mismatch_probability)
                if len(mixed) > 1:  # a single one has nothing to be mistaken for
                    uv[part][mixed], wrong[part][mixed] = uv[part][np.roll(mixed, 1)], True
        return uv, wrong


def _select(observations: _Observed, rows: Mask | Rows) -> _Observed:
    """Return some of the observations."""
    return _Observed(
        observations.frame[rows],
        observations.landmark[rows],
        observations.uv[rows],
        observations.depth[rows],
    )


def _rank(group: Rows, order: Rows) -> Rows:
    """Return each item's place (n,) within its group (n,) when sorted by ``order`` (n,)."""
    sequence = np.lexsort((order, group))
    sorted_group = group[sequence]
    starts = np.searchsorted(sorted_group, sorted_group)
    result = np.empty(len(group), dtype=np.int64)
    result[sequence] = np.arange(len(group)) - starts
    return result
