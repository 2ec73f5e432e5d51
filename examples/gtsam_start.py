# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The start of visual-inertial odometry in motion: nothing known but the sensors' parameters.

For ``gtsam_image_vio.py``. A window of key frames of a moving camera gives, one after the other,

1. the gyroscope's bias, with which the rotations between key frames agree with the corners: the
   normals of all epipolar planes of two frames lie in a plane, so the smallest eigenvalue of the
   sum of their squares is least (Kneip and Lynen, Direct optimization of frame-to-frame rotation,
   ICCV 2013);
2. velocity, gravity and the places of corners, and so the scale, from linear equations with a
   gravity of known magnitude (Dong-Si and Mourikis, Estimator initialization in vision-aided
   inertial navigation with unknown camera-IMU calibration, IROS 2012);
3. all of it, and the accelerometer's bias, by gtsam's Levenberg-Marquardt on the factors that the
   estimator goes on with.

Position and heading of the first key frame, which nothing shows, are given. Needs gtsam.
"""

from dataclasses import dataclass
from typing import NamedTuple

import gtsam
import gtsam_noise
import numpy as np
from gtsam.symbol_shorthand import B, L, V, X
from scipy.optimize import brentq, minimize

from imu_sim_ros.simulation.parameters import SimulationParameters

LEAST = 2.0  # s, of a window
LONGEST = 4.0  # s
STILL = 1.0  # px, corners that move less from key frame to key frame are at rest
PAIRS = (1, 2, 4)  # key frames between two whose rotation is compared
LEAST_CORNERS = 15
LEAST_PARALLAX = np.radians(1.0)
LARGEST_SPEED_ERROR = 0.15  # m/s, standard deviation of the velocity after a start
LARGEST_MISS = 3.0  # px
TILT = 0.3  # rad, vague
KNOWN = 1e-3  # rad, m


class Frame(NamedTuple):
    """A key frame."""

    readings: np.ndarray
    """(n, 7) since the one before: specific force, angular rate, time [s]."""
    ids: np.ndarray
    """(n,) of its corners."""
    uv: np.ndarray
    """(n, 2) px."""
    rays: np.ndarray
    """(n, 2) the same, normalised."""


@dataclass
class InitialEstimate:
    """Initial estimate of the key frames of a window and of the corners seen in them."""

    values: gtsam.Values
    """X, V and B of each key frame, from 0 on, and L of each corner, by its id."""
    graph: gtsam.NonlinearFactorGraph
    """All but the factors of corners."""
    times: list[float]
    """Times of the key frames from the first one on [s]."""
    sights: dict[int, list[tuple[int, np.ndarray]]]
    """Key frame and pixel of each corner, by its id."""


class Window:
    """The latest key frames of a camera that moves."""

    def __init__(self, parameters: SimulationParameters, camera) -> None:
        """Take the sensors' parameters.

        :param camera: a ``CameraFactors`` of ``gtsam_vio.py``.
        """
        self._noise = gtsam_noise.imu_noise(parameters)
        self._gravity = float(np.linalg.norm(parameters.gravity))
        self._bias_sigma = gtsam_noise.bias_sigma(parameters)
        self._camera = camera
        self.frames: list[Frame] = []
        self.span = 0.0
        """Time between the oldest and the latest key frame [s]."""

    def add(self, readings: np.ndarray, ids: np.ndarray, uv: np.ndarray) -> None:
        """Take the next key frame; leave out those at rest, and those that are too long ago.

        :param readings: as those of :class:`Frame`; of the first one they do not matter.
        """
        rays = np.array([self._camera.calibration.calibrate(pixel) for pixel in uv]).reshape(-1, 2)
        frame = Frame(readings, ids, uv, rays)
        if self.frames:
            previous_rows, rows = _common(self.frames[-1], frame)
            pixel_motion = np.linalg.norm(
                frame.uv[rows] - self.frames[-1].uv[previous_rows], axis=1
            )
            if len(pixel_motion) < LEAST_CORNERS or np.median(pixel_motion) < STILL:
                self.frames.clear()
        self.frames.append(frame)
        while self._span() > LONGEST:
            del self.frames[0]
        self.span = self._span()

    def _span(self) -> float:
        return float(sum(frame.readings[:, 6].sum() for frame in self.frames[1:]))

    def start(self, true: gtsam.Pose3) -> InitialEstimate | None:
        """Return what the window says; None if it is too short or says too little.

        :param true: pose of the first key frame, of which position and heading are taken.
        """
        if self.span < LEAST:
            return None
        gyro_bias = self._gyroscope_bias()
        bias = gtsam.imuBias.ConstantBias(np.zeros(3), gyro_bias)
        parts = [self._preintegrated([frame], bias) for frame in self.frames[1:]]
        wholes = [self._preintegrated(self.frames[1:k], bias) for k in range(1, self._count + 1)]
        solution = self._linear(wholes)
        if solution is None:
            return None
        velocity, gravity, points = solution
        level = _heading_of(true, _upright(gravity))
        initial_state = gtsam.NavState(
            gtsam.Pose3(level, true.translation()), level.rotate(velocity)
        )
        return self._refined(initial_state, bias, parts, wholes, points)

    @property
    def _count(self) -> int:
        return len(self.frames)

    def _preintegrated(self, frames: list[Frame], bias) -> gtsam.PreintegratedCombinedMeasurements:
        result = gtsam.PreintegratedCombinedMeasurements(self._noise, bias)
        for frame in frames:
            for row in frame.readings:
                result.integrateMeasurement(row[:3], row[3:6], float(row[6]))
        return result

    def _gyroscope_bias(self) -> np.ndarray:
        """Return the bias (3,) with which rotations agree with corners [rad/s]."""
        r_bc = self._camera.body_camera.rotation().matrix()
        pairs = []
        for step in PAIRS:
            for k in range(self._count - step):
                start_frame, end_frame = self.frames[k], self.frames[k + step]
                start_rows, end_rows = _common(start_frame, end_frame)
                if len(start_rows) >= LEAST_CORNERS:
                    rays_in_body = [
                        _unit(_upgraded(frame.rays[rows])) @ r_bc.T
                        for frame, rows in ((start_frame, start_rows), (end_frame, end_rows))
                    ]
                    pairs.append((k, k + step, *rays_in_body))

        def disagreement(bias: np.ndarray) -> float:
            scaled_bias = gtsam.imuBias.ConstantBias(np.zeros(3), 1e-2 * bias)
            turns = [
                self._preintegrated([f], scaled_bias).deltaRij().matrix() for f in self.frames[1:]
            ]
            total = 0.0
            for start, end, start_rays, end_rays in pairs:
                turn = np.eye(3)
                for k in range(start, end):
                    turn = turn @ turns[k]
                normals = np.cross(start_rays, end_rays @ turn.T)
                total += np.linalg.eigvalsh(normals.T @ normals)[0] / len(start_rays)
            return 1e6 * total

        if not pairs:
            return np.zeros(3)
        settings = {"initial_simplex": np.vstack([np.zeros(3), np.eye(3)]), "xatol": 0.01}
        return 1e-2 * minimize(disagreement, np.zeros(3), method="Nelder-Mead", options=settings).x

    def _sights(self) -> dict[int, list[tuple[int, int]]]:
        """Return key frame and row of corners that are seen in at least three, by id."""
        sights: dict[int, list[tuple[int, int]]] = {}
        for k, frame in enumerate(self.frames):
            for row, identity in enumerate(frame.ids.tolist()):
                sights.setdefault(identity, []).append((k, row))
        return {identity: views for identity, views in sights.items() if len(views) >= 3}

    def _linear(self, wholes: list) -> tuple[np.ndarray, np.ndarray, dict[int, np.ndarray]] | None:
        """Return velocity, gravity, and places of corners in the axes of the first body.

        A corner f is on the ray (x, y, 1) of key frame k:
        ``[1 0 -x; 0 1 -y] R_cb (R_k^T (f - v t - g t^2 / 2 - p_k) - p_bc) = 0``, with R_k and p_k
        preintegrated.
        """
        body_camera = self._camera.body_camera
        r_cb, p_bc = body_camera.rotation().matrix().T, body_camera.translation()
        weights: dict[tuple[int, int], float] = {}
        sights = self._sights()
        solution = None
        for _ in range(4):
            # Each corner is eliminated by what is orthogonal to its own columns.
            reduced_a, reduced_b, equations = [], [], {}
            for identity, views in sights.items():
                rows, of_point, value = [], [], []
                for k, row in views:
                    whole = wholes[k]
                    t, turn = whole.deltaTij(), whole.deltaRij().matrix().T
                    x, y = self.frames[k].rays[row]
                    line = np.array([[1.0, 0.0, -x], [0.0, 1.0, -y]]) * weights.get((k, row), 1.0)
                    along = line @ r_cb @ turn
                    of_point.append(along)
                    rows.append(np.hstack([-t * along, -0.5 * t * t * along]))
                    value.append(along @ whole.deltaPij() + line @ r_cb @ p_bc)
                a, f, b = np.vstack(rows), np.vstack(of_point), np.concatenate(value)
                q, _ = np.linalg.qr(f, mode="complete")
                reduced_a.append(q[:, 3:].T @ a)
                reduced_b.append(q[:, 3:].T @ b)
                equations[identity] = a, f, b
            if len(equations) < LEAST_CORNERS:
                return None
            solution = _with_gravity(np.vstack(reduced_a), np.concatenate(reduced_b), self._gravity)
            points = {
                k: np.linalg.lstsq(f, b - a @ solution, rcond=None)[0]
                for k, (a, f, b) in equations.items()
            }
            # Pixels, instead of metres: each equation by its depth; far misses count less.
            for identity, views in list(sights.items()):
                for k, row in views:
                    local = self._local(points[identity], solution, wholes[k], r_cb, p_bc)
                    depth = max(float(local[2]), 0.1)
                    miss = np.linalg.norm(local[:2] / depth - self.frames[k].rays[row])
                    weights[k, row] = 1.0 / depth / np.sqrt(1.0 + (miss / 0.01) ** 2)
        return solution[:3], solution[3:], points

    @staticmethod
    def _local(point, solution, whole, r_cb, p_bc) -> np.ndarray:
        t = whole.deltaTij()
        place = solution[:3] * t + 0.5 * t * t * solution[3:] + whole.deltaPij()
        return r_cb @ (whole.deltaRij().matrix().T @ (point - place) - p_bc)

    def _refined(
        self, initial_state, bias, parts: list, wholes: list, points: dict
    ) -> InitialEstimate | None:
        """Return all of the window by gtsam; None if it does not determine the velocity."""
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        r_wb = initial_state.pose().rotation().matrix()
        turn = r_wb.T @ np.diag(np.square([TILT, TILT, KNOWN])) @ r_wb
        covariance = np.zeros((6, 6))
        covariance[:3, :3], covariance[3:, 3:] = turn, KNOWN**2 * np.eye(3)
        graph.addPriorPose3(
            X(0), initial_state.pose(), gtsam.noiseModel.Gaussian.Covariance(covariance)
        )
        sigmas = gtsam.noiseModel.Diagonal.Sigmas(self._bias_sigma)
        graph.addPriorConstantBias(B(0), gtsam.imuBias.ConstantBias(), sigmas)
        for k, part in enumerate(parts):
            graph.push_back(gtsam.CombinedImuFactor(X(k), V(k), X(k + 1), V(k + 1), B(k), B(k + 1),
                                                    part))  # fmt: skip
        states = [
            whole.predict(initial_state, bias) if k else initial_state
            for k, whole in enumerate(wholes)
        ]
        for k, state in enumerate(states):
            values.insert(X(k), state.pose())
            values.insert(V(k), state.velocity())
            values.insert(B(k), bias)
        sights = {}
        for identity, views in self._sights().items():
            place = initial_state.pose().transformFrom(points[identity])
            eyes = [states[k].pose().compose(self._camera.body_camera) for k, _ in views]
            rays = _unit(np.array([place - eye.translation() for eye in eyes]))
            deep = all(eye.transformTo(place)[2] > 0.2 for eye in eyes)
            if deep and np.arccos(np.clip((rays @ rays.T).min(), -1, 1)) > LEAST_PARALLAX:
                sights[identity] = [(k, self.frames[k].uv[row]) for k, row in views]
                values.insert(L(identity), place)
        for limit in (10.0 * LARGEST_MISS, LARGEST_MISS, LARGEST_MISS):
            if len(sights) < LEAST_CORNERS:
                return None
            whole = gtsam.NonlinearFactorGraph(graph)
            for identity, pixels in sights.items():
                for k, uv in pixels:
                    whole.push_back(self._camera.factor(uv, k, identity))
            try:
                values = gtsam.LevenbergMarquardtOptimizer(whole, values).optimize()
            except RuntimeError:
                return None
            for identity in [k for k in sights if self._miss(values, k, sights[k]) > limit]:
                del sights[identity]
                values.erase(L(identity))
        if len(sights) < LEAST_CORNERS:
            return None
        whole = gtsam.NonlinearFactorGraph(graph)
        for identity, pixels in sights.items():
            for k, uv in pixels:
                whole.push_back(self._camera.factor(uv, k, identity))
        velocity_key = V(self._count - 1)
        try:
            spread = gtsam.Marginals(whole, values).marginalCovariance(velocity_key)
        except RuntimeError:
            return None
        if np.sqrt(np.linalg.eigvalsh(spread)[-1]) > LARGEST_SPEED_ERROR:
            return None
        return InitialEstimate(values, graph, [whole.deltaTij() for whole in wholes], sights)

    def _miss(self, values: gtsam.Values, identity: int, pixels: list) -> float:
        """Return the largest distance of a corner's landmark from its pixels [px]."""
        largest = 0.0
        for k, uv in pixels:
            eye = values.atPose3(X(k)).compose(self._camera.body_camera)
            local = eye.transformTo(values.atPoint3(L(identity)))
            if local[2] < 0.2:
                return np.inf
            projected = self._camera.calibration.uncalibrate(local[:2] / local[2])
            largest = max(largest, float(np.linalg.norm(projected - uv)))
        return largest


def _common(frame: Frame, other_frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of the corners that two frames share."""
    _, rows, other_rows = np.intersect1d(frame.ids, other_frame.ids, return_indices=True)
    return rows, other_rows


def _upgraded(rays: np.ndarray) -> np.ndarray:
    return np.column_stack([rays, np.ones(len(rays))])


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _with_gravity(a: np.ndarray, b: np.ndarray, magnitude: float) -> np.ndarray:
    """Return v and g (6,) of the least squares ``a (v, g) = b`` with a gravity of known magnitude.

    With v eliminated it is the least of ``g' Q g - 2 q' g`` on a sphere: ``(Q + m I) g = q``, with
    the m above the negative of Q's smallest eigenvalue that gives the magnitude.
    """
    q, r = np.linalg.qr(a[:, :3])
    rest = a[:, 3:] - q @ (q.T @ a[:, 3:])
    matrix, vector = rest.T @ rest, rest.T @ b
    values, axes = np.linalg.eigh(matrix)
    along = axes.T @ vector

    def excess(m: float) -> float:
        return float(np.linalg.norm(along / (values + m)) - magnitude)

    low = -values[0] + 1e-12 * values[2]
    high = max(1.0, np.linalg.norm(vector) / magnitude)
    gravity = axes @ (along / (values + (brentq(excess, low, high) if excess(low) > 0 else low)))
    gravity *= magnitude / np.linalg.norm(gravity)
    velocity = np.linalg.solve(r, q.T @ (b - a[:, 3:] @ gravity))
    return np.concatenate([velocity, gravity])


def _upright(gravity: np.ndarray) -> np.ndarray:
    """Return a rotation (3, 3) that turns gravity to -z."""
    z = -gravity / np.linalg.norm(gravity)
    x = np.eye(3)[np.argmin(np.abs(z))]
    y = np.cross(z, x)
    y /= np.linalg.norm(y)
    return np.stack([np.cross(y, z), y, z])


def _heading_of(true: gtsam.Pose3, level: np.ndarray) -> gtsam.Rot3:
    """Return a rotation turned about the upright axis so that it is nearest to a true one."""
    m = true.rotation().matrix() @ level.T
    return gtsam.Rot3.Rz(float(np.arctan2(m[1, 0] - m[0, 1], m[0, 0] + m[1, 1]))).compose(
        gtsam.Rot3(level)
    )
