# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

r"""Visual-inertial odometry with gtsam on images: a corner tracker in front of gtsam_vio.py.

    generate -o hall/mav0 --format euroc --imu adis16448 --trajectory tour --duration 20s \
        --set trajectory.rest_before=2 --camera euroc_cam0 \
        --scene machine_hall --with-configs
    python examples/gtsam_image_vio.py hall --configuration hall/mav0_configs/simulation.yaml

FAST corners, spread over the image, are followed by OpenCV's pyramidal Lucas-Kanade, forth and
back; those that do not return, or contradict the epipolar geometry of two frames, are dropped.

With a rest before the flight (trajectory.rest_before, trajectory.lead_in.rest) its pose is given,
and the biases are taken from it. Without one, ``gtsam_start.py`` finds velocity, gravity, scale and
biases from the first seconds in which the camera moves; only position and heading at their
beginning are given. The estimate then begins 2 s after the camera has begun to move. The
summary tells how many corners were followed from frame to frame, and for how many frames those that
were followed at all: that is what light and textures of a place change. Needs gtsam and
opencv-python-headless.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import cv2
import gtsam
import gtsam_start
import gtsam_vio
import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.simulation.parameters import SimulationParameters

FEATURES = 150
CELLS = (5, 6)  # rows, columns, in which corners are spread
APART = 15  # px, least distance of two corners
CONTRAST = 5  # of a FAST corner, grey values
EPIPOLAR = 1.0  # px
RETURN = 0.3  # px, a corner followed forth and back is at most this far from its place
SMOOTHED = 1.0  # px, standard deviation: images are smoothed before corners are sought
LEAST_NOISE = 0.2  # px
LEAST_SLOPE = 1e-3  # least eigenvalue of a corner's matrix of slopes, as OpenCV scales it
IN_PROBLEM = 60  # corners, those followed longest
NOISE = 0.5  # px, of a corner's place at first
WANDERING = 1.5  # factor on the noise, for the errors of a corner change slowly
OUTLIER = 3.0  # standard deviations
STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 30, 0.01)


def _flow(
    image: np.ndarray, next_image: np.ndarray, uv: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Follow pixels (n, 2) into another image; return them and which (n,) were found."""
    next_uv, status, _ = cv2.calcOpticalFlowPyrLK(
        image, next_image, uv, None, winSize=(21, 21), maxLevel=3, criteria=STOP,
        minEigThreshold=LEAST_SLOPE,
    )  # fmt: skip
    return next_uv, status[:, 0] > 0


class CornerTracker:
    """Corners with ids, followed from image to image."""

    def __init__(self, model: CameraModel, focal_length: float) -> None:
        self._model, self._threshold = model, EPIPOLAR / focal_length
        self._fast = cv2.FastFeatureDetector_create(CONTRAST)
        self._before: np.ndarray | None = None
        self.uv, self.ids = np.zeros((0, 2), np.float32), np.zeros(0, np.int64)
        self.ages = np.zeros(0, np.int64)
        self._next = 0
        self.counts: list[int] = []
        """Corners followed into each image but the first."""
        self.lifetimes: list[int] = []
        """Images in which each lost corner was seen."""

    def look(self, image: np.ndarray) -> None:
        """Follow the corners into the next image (h, w), and find new ones."""
        image = cv2.GaussianBlur(image, (0, 0), SMOOTHED)
        if self._before is not None:
            self._follow(image)
            self.counts.append(len(self.ids))
        if len(self.ids) < FEATURES:
            self._find(image)
        self._before = image

    def _follow(self, image: np.ndarray) -> None:
        if not len(self.uv):
            return
        uv, tracked = _flow(self._before, image, self.uv)
        back, returned = _flow(image, self._before, uv)
        size = np.array(image.shape[::-1]) - 1
        good = tracked & returned & ((uv > 0) & (uv < size)).all(axis=1)
        good &= np.linalg.norm(back - self.uv, axis=1) < RETURN
        if good.sum() >= 8:
            planes = []
            for pixels in (self.uv[good], uv[good]):
                ray = self._model.unproject(pixels.astype(np.float64)).direction
                planes.append(ray[:, :2] / ray[:, 2:])
            _, inliers = cv2.findFundamentalMat(*planes, cv2.FM_RANSAC, self._threshold, 0.99)
            if inliers is not None:
                good[np.flatnonzero(good)[inliers[:, 0] == 0]] = False
        self.lifetimes += self.ages[~good].tolist()
        self.uv, self.ids, self.ages = uv[good], self.ids[good], self.ages[good] + 1

    def _find(self, image: np.ndarray) -> None:
        """Add corners where there are few."""
        free = np.full(image.shape, 255, np.uint8)
        for u, v in self.uv.astype(int).tolist():
            cv2.circle(free, (u, v), APART, 0, -1)
        height, width = (n // k for n, k in zip(image.shape, CELLS, strict=True))
        corners_per_cell = 1 + (FEATURES - len(self.ids)) // (CELLS[0] * CELLS[1])
        corner_pixels = []
        for row, column in np.ndindex(*CELLS):
            y, x = row * height, column * width
            cell = image[y : y + height, x : x + width]
            corners = self._fast.detect(cell, free[y : y + height, x : x + width])
            added = 0
            for corner in sorted(corners, key=lambda candidate: -candidate.response):
                u, v = int(corner.pt[0]) + x, int(corner.pt[1]) + y
                if added < corners_per_cell and free[v, u]:
                    cv2.circle(free, (u, v), APART, 0, -1)
                    corner_pixels.append((corner.pt[0] + x, corner.pt[1] + y))
                    added += 1
        if corner_pixels:
            uv = np.array(corner_pixels, np.float32).reshape(-1, 1, 2)
            uv = cv2.cornerSubPix(image, uv, (5, 5), (-1, -1), STOP)[:, 0]
            self.uv = np.concatenate([self.uv, uv])
            self.ids = np.concatenate([self.ids, self._next + np.arange(len(uv))])
            self.ages = np.concatenate([self.ages, np.ones(len(uv), np.int64)])
            self._next += len(uv)

    def drop(self, refused: set[int]) -> None:
        """Forget corners."""
        remaining = np.array([identity not in refused for identity in self.ids.tolist()], bool)
        self.lifetimes += self.ages[~remaining].tolist()
        self.uv, self.ids, self.ages = self.uv[remaining], self.ids[remaining], self.ages[remaining]

    def oldest(self) -> tuple[np.ndarray, np.ndarray]:
        """Return ids (n,) and pixels (n, 2) of those that were followed longest."""
        rows = np.argsort(-self.ages, kind="stable")[:IN_PROBLEM]
        rows = rows[self.ages[rows] > 1]
        return self.ids[rows], self.uv[rows].astype(np.float64)


class ImageEstimator(gtsam_vio.Estimator):
    """The estimator of gtsam_vio.py with what corners in images need: noise, and no outliers.

    How far corners are from where their landmarks project gives the noise of the next key frame.
    Those that are too far contradict the rest, and are left out for good.
    """

    def __init__(self, parameters: SimulationParameters, camera: CameraParameters) -> None:
        self._parameters_of_camera = camera
        self.refused: set[int] = set()
        """Ids of corners that were outliers."""
        self.noise = NOISE
        """Standard deviation of a corner's place [px]."""
        super().__init__(parameters, self._with_noise())

    def _with_noise(self) -> CameraParameters:
        # With outliers the factors are robust.
        noise = WANDERING * self.noise
        return replace(self._parameters_of_camera, pixel_noise=noise, outlier_probability=0.01)

    def look(self, ids: np.ndarray, uv: np.ndarray, cameras: np.ndarray | None = None) -> None:
        """Close a key frame with its corners: ids (n,), pixels (n, 2)."""
        accepted = np.array([identity not in self.refused for identity in ids.tolist()], bool)
        ids, uv = ids[accepted], uv[accepted]
        predicted_pose = self.state.pose()
        if self._preintegration.deltaTij() > 0.0:
            predicted_pose = self._preintegration.predict(self.state, self.bias).pose()
        # Against the prediction only in relation to each other: its own error moves all of them.
        misses = self._misses(predicted_pose, ids, uv)
        if len(misses) >= 5:
            middle = np.median(list(misses.values()), axis=0)
            self._refuse({k: miss - middle for k, miss in misses.items()}, 2.0 * OUTLIER)
        accepted = np.array([identity not in self.refused for identity in ids.tolist()], bool)
        ids, uv = ids[accepted], uv[accepted]
        super().look(ids, uv)
        misses = self._misses(self.state.pose(), ids, uv)
        if len(misses) >= 10:
            # Half of the deviations are below 0.674 sigma.
            spread = float(np.median(np.abs(list(misses.values())))) / 0.674
            self.noise = max(LEAST_NOISE, 0.8 * self.noise + 0.2 * spread)
            self._cameras = [gtsam_vio.CameraFactors(self._with_noise())]
        self._refuse(misses, OUTLIER)

    @property
    def camera(self) -> gtsam_vio.CameraFactors:
        """The camera in gtsam's terms."""
        return self._cameras[0]

    def _misses(self, pose: gtsam.Pose3, ids: np.ndarray, uv: np.ndarray) -> dict[int, np.ndarray]:
        """Return how far (2,) known landmarks are from their pixels."""
        camera, misses = self._cameras[0], {}
        eye = pose.compose(camera.body_camera)
        for identity, pixel in zip(ids.tolist(), uv, strict=True):
            if identity in self._known:
                local = eye.transformTo(self.place(identity))
                if local[2] > 0.1:
                    place = camera.calibration.uncalibrate(local[:2] / local[2])
                    misses[identity] = place - pixel
                else:
                    self.refused.add(identity)
        return misses

    def _refuse(self, misses: dict[int, np.ndarray], sigmas: float) -> None:
        limit = sigmas * WANDERING * self.noise
        self.refused |= {k for k, miss in misses.items() if np.linalg.norm(miss) > limit}


def run(folder: Path, configuration: Path, rate: float = 4.0) -> tuple[gtsam_vio.Result, dict]:
    """Return the result on the first camera of an EuRoC folder, and a summary.

    :param rate: of key frames [Hz].
    """
    parameters, [camera, *_] = gtsam_vio.configuration(configuration)
    estimator = ImageEstimator(parameters, camera)
    tables = [folder / "mav0" / name / "data.csv" for name in ("imu0", "cam0")]
    imu_t, image_t = (
        np.loadtxt(table, np.int64, delimiter=",", skiprows=1, usecols=0) for table in tables
    )
    imu = np.loadtxt(tables[0], delimiter=",", skiprows=1)
    truth_file = folder / "mav0" / "state_groundtruth_estimate0" / "data.csv"
    true_t = np.loadtxt(truth_file, np.int64, delimiter=",", skiprows=1, usecols=0)
    truth = np.loadtxt(truth_file, delimiter=",", skiprows=1)
    motion = parameters.trajectory
    begin = imu_t[0] + round((motion.lead_in.rest or motion.rest_before) * 1e9)
    image_t = image_t[(image_t >= begin) & (image_t <= min(imu_t[-1], true_t[-1]))]
    tracker = CornerTracker(CameraModel(camera), camera.intrinsics[0])
    stride, columns_of_keys, keys = max(1, round(camera.rate / rate)), [], []
    at_rest, previous_row, true_poses = bool(begin > imu_t[0]), None, []
    window = None if at_rest else gtsam_start.Window(parameters, estimator.camera)
    for k, frame_ns in enumerate(image_t.tolist()):
        name = folder / "mav0" / "cam0" / "data" / f"{frame_ns:019d}.png"
        tracker.look(cv2.imread(str(name), cv2.IMREAD_GRAYSCALE))
        if k % stride:
            continue
        row = int(np.searchsorted(imu_t, frame_ns))
        truth_row = int(np.searchsorted(true_t, frame_ns))
        true_pose = gtsam.Pose3(
            gtsam.Rot3(rotation.to_matrix(truth[truth_row, 4:8])), truth[truth_row, 1:4]
        )
        readings = _between(imu, imu_t, row if previous_row is None else previous_row, row)
        previous_row = row
        if window is not None:
            window.add(readings, *tracker.oldest())
            true_poses = [*true_poses, true_pose][-len(window.frames) :]
            started = window.start(true_poses[0])
            if started is None:
                continue
            estimator.begin(started)
            window = None
        else:
            if not keys and at_rest:
                estimator.rest(true_pose, imu[imu_t < begin, 1:])
                estimator.start(true_pose, truth[truth_row, 8:11])
            for values in readings:
                estimator.integrate(values[:3], values[3:6], float(values[6]))
            estimator.look(*tracker.oldest())
        tracker.drop(estimator.refused)
        keys.append(frame_ns)
        columns_of_keys.append(gtsam_vio.compared(estimator, true_pose))
    if not keys:
        raise SystemExit(
            f"no start: in {len(image_t)} images the camera never moved for "
            f"{gtsam_start.LEAST:g} s so that velocity and gravity can be told; a rest before the "
            "flight gives them (trajectory.lead_in.rest=2)"
        )
    result = gtsam_vio.Result(
        np.array(keys), *(np.array(column) for column in zip(*columns_of_keys, strict=True))
    )
    lifetimes = [age for age in tracker.lifetimes + tracker.ages.tolist() if age > 1]
    summary = {
        **result.summary(),
        "start_s": float((keys[0] - image_t[0]) * 1e-9),
        "path_m": float(np.linalg.norm(np.diff(truth[:, 1:4], axis=0), axis=1).sum()),
        "corners_mean": float(np.mean(tracker.counts)),
        "corners_least": int(np.min(tracker.counts)),
        "corner_noise_px": estimator.noise,
        "lifetime_mean_frames": float(np.mean(lifetimes)),
        "lifetime_median_frames": float(np.median(lifetimes)),
    }
    return result, summary


def _between(imu: np.ndarray, imu_t: np.ndarray, start_row: int, end_row: int) -> np.ndarray:
    """Return the means of neighbouring readings (n, 7): force, rate, time between them [s]."""
    readings = imu[start_row : end_row + 1, 1:]
    mean = 0.5 * (readings[1:] + readings[:-1])
    return np.column_stack(
        [mean[:, 3:], mean[:, :3], np.diff(imu_t[start_row : end_row + 1]) * 1e-9]
    )


def main() -> None:
    """Run on a folder and print the result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder with mav0")
    parser.add_argument("--configuration", type=Path, required=True, help="its simulation.yaml")
    parser.add_argument("-o", "--output", type=Path, help="the estimated path, for evaluate")
    parser.add_argument("--metrics", type=Path, help="the summary as JSON, for campaign")
    arguments = parser.parse_args()
    result, summary = run(arguments.folder, arguments.configuration)
    if arguments.metrics is not None:
        arguments.metrics.write_text(json.dumps(summary), encoding="utf-8")
    if arguments.output is not None:
        result.write(arguments.output)
    print(json.dumps(summary, indent=2))


if __name__ == "__main__":
    main()
