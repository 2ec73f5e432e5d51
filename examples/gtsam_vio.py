# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

r"""Visual-inertial odometry with gtsam on simulated readings and tracks, judged against the truth.

    generate -o flight --format tracks --imu adis16448 --trajectory figure_eight --duration 15s \
        --camera euroc_cam0 --set camera.max_features=60 \
        --set trajectory.lead_in.rest=2 --with-configs
    python examples/gtsam_vio.py flight

A problem with known ids: CombinedImuFactor between key frames, a projection factor for each
feature of each camera, and iSAM2 on the last seconds, LAG: what is older is marginalised, so that a
key frame takes as long at the end of a flight as at its beginning. ``-o`` writes the path with its
covariance, which ``evaluate`` reads.
``gtsam_vio_node.py`` is the same on live topics. The first pose and velocity are given; the biases
are known to within the turn-on values of the IMU preset, or from a rest before the start
(``trajectory.lead_in.rest`` or ``rest_before``), without which a gyroscope's bias of degrees per
second makes iSAM2 fail. ``gtsam_noise.py`` has the sensor's noise in gtsam's terms. Needs gtsam
(pip install gtsam).
"""

import argparse
import json
from dataclasses import dataclass, field
from pathlib import Path

import gtsam
import gtsam_noise
import gtsam_start
import numpy as np
from gtsam.symbol_shorthand import B, L, V, X

from imu_sim_ros.core import rotation
from imu_sim_ros.inputs.poses import read_poses
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.simulation.parameters import SimulationParameters, load_simulation

PRIOR_POSE = np.array([1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3])  # rad, m
PRIOR_VELOCITY = 1e-3  # m/s
LEAST_SIGHTS = 3
LEAST_PARALLAX = np.radians(2.0)
VAGUE = 3.0  # standard deviation of a landmark's prior, relative to its distance
LARGEST_MISS = 10.0  # px, of a triangulated point in the frames that saw it
LOST = 100.0  # m, standard deviation of a position
LAG = 6.0  # s, key frames and landmarks that were last seen earlier are marginalised


@dataclass
class Landmark:
    """A landmark that is not in the problem yet: its observations."""

    sights: list[tuple[int, int, np.ndarray]] = field(default_factory=list)
    """Key frame, camera, pixel."""


class Estimator:
    """Readings and features in, key frame by key frame; pose, velocity and covariance out."""

    def __init__(self, parameters: SimulationParameters, *cameras: CameraParameters) -> None:
        """Set up the noise as the simulation has it.

        :param parameters: densities, turn-on biases and gravity are taken from it.
        :param cameras: models, extrinsics and pixel noise are taken from them.
        """
        self._preintegration = gtsam.PreintegratedCombinedMeasurements(
            gtsam_noise.imu_noise(parameters)
        )
        self._cameras = [CameraFactors(camera) for camera in cameras]
        settings = gtsam.ISAM2Params()
        settings.setFactorization("QR")  # Cholesky stops with an indeterminate system
        settings.relinearizeSkip = 1
        self.smoother = gtsam.IncrementalFixedLagSmoother(LAG, settings)
        self._parameters = parameters
        self._bias_sigma = gtsam_noise.bias_sigma(parameters)
        self._waiting: dict[int, Landmark] = {}
        self._known: dict[int, int] = {}
        """Number in the problem of each landmark; one that comes back after the lag has another."""
        self._seen: dict[int, float] = {}
        """Time of the latest observation of each landmark in the problem, by its id [s]."""
        self._landmarks = 0
        self._poses: list[gtsam.Pose3] = []
        self._times: list[float] = []
        """Times of the key frames from the first one on [s]."""
        self.state = gtsam.NavState()
        self.bias = gtsam.imuBias.ConstantBias()
        self.key = -1

    def rest(self, pose: gtsam.Pose3, readings: np.ndarray) -> None:
        """Take the biases from a rest in a known pose.

        :param readings: (n, 6) gyroscope, accelerometer.
        """
        parameters, tilt = self._parameters, PRIOR_POSE[0]
        r_wb = pose.rotation().matrix()
        mean, self._bias_sigma = gtsam_noise.biases_of_rest(parameters, r_wb, readings, tilt)
        self.bias = gtsam.imuBias.ConstantBias(*mean)
        self._preintegration.resetIntegrationAndSetBias(self.bias)

    def start(self, pose: gtsam.Pose3, velocity: np.ndarray) -> None:
        """Begin at a known pose and velocity, at the time of the first key frame."""
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        sigmas = gtsam.noiseModel.Diagonal.Sigmas
        graph.addPriorPose3(X(0), pose, sigmas(PRIOR_POSE))
        graph.addPriorVector(V(0), velocity, sigmas(np.full(3, PRIOR_VELOCITY)))
        graph.addPriorConstantBias(B(0), self.bias, sigmas(self._bias_sigma))
        values.insert(X(0), pose)
        values.insert(V(0), velocity)
        values.insert(B(0), self.bias)
        self.smoother.update(graph, values, {key(0): 0.0 for key in (X, V, B)})
        self.key, self.state = 0, gtsam.NavState(pose, velocity)
        self._poses.append(pose)
        self._times.append(0.0)

    def begin(self, initial: gtsam_start.InitialEstimate) -> None:
        """Begin with what a window of key frames has shown, at the time of its last one."""
        graph, values, times = gtsam.NonlinearFactorGraph(initial.graph), gtsam.Values(), {}
        initial_values = initial.values
        for k, time in enumerate(initial.times):
            self._poses.append(initial_values.atPose3(X(k)))
            values.insert(X(k), self._poses[-1])
            values.insert(V(k), initial_values.atVector(V(k)))
            values.insert(B(k), initial_values.atConstantBias(B(k)))
            times |= {key(k): time for key in (X, V, B)}
        self._times, self.key = list(initial.times), len(initial.times) - 1
        for identity, sights in initial.sights.items():
            point = initial_values.atPoint3(L(identity))
            self._insert(graph, values, times, identity, point, [(k, 0, uv) for k, uv in sights])
        self.smoother.update(graph, values, times)
        self._update_state()

    def integrate(self, accel: np.ndarray, gyro: np.ndarray, dt: float) -> None:
        """Take the mean of two neighbouring readings over the time between them [s]."""
        self._preintegration.integrateMeasurement(accel, gyro, dt)

    def look(self, ids: np.ndarray, uv: np.ndarray, cameras: np.ndarray | None = None) -> None:
        """Close a key frame with its features: ids (n,), pixels (n, 2), numbers of cameras (n,)."""
        camera_numbers = np.zeros(len(ids), dtype=int) if cameras is None else cameras
        graph, values, times = gtsam.NonlinearFactorGraph(), gtsam.Values(), {}
        if self._preintegration.deltaTij() > 0.0:
            self._advance(graph, values, times)
        time = self._times[-1]
        for identity, pixel, camera in zip(ids.tolist(), uv, camera_numbers.tolist(), strict=True):
            if identity in self._known:
                number = self._known[identity]
                graph.push_back(self._cameras[camera].factor(pixel, self.key, number))
                times[L(number)] = self._seen[identity] = time
            else:
                sights = self._waiting.setdefault(identity, Landmark()).sights
                sights.append((self.key, camera, pixel))
        self.smoother.update(graph, values, times)
        self._forget(time - LAG)
        self._update_state()
        self._admit(set(ids.tolist()))

    def _forget(self, end: float) -> None:
        """Forget what is marginalised: landmarks that were last seen by then, and sights."""
        for identity in [k for k, time_seen in self._seen.items() if time_seen <= end]:
            del self._known[identity], self._seen[identity]
        for identity, landmark in list(self._waiting.items()):
            landmark.sights = [sight for sight in landmark.sights if self._times[sight[0]] > end]
            if not landmark.sights:
                del self._waiting[identity]

    def place(self, identity: int) -> np.ndarray:
        """Return the place (3,) of a known landmark."""
        return self.smoother.calculateEstimatePoint3(L(self._known[identity]))

    def covariance(self) -> np.ndarray:
        """Return the covariance (6, 6) of the latest pose: rotation, then place, in the body."""
        return self.smoother.marginalCovariance(X(self.key))

    def _advance(
        self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, times: dict[int, float]
    ) -> None:
        k, pre = self.key, self._preintegration
        keys = (X(k), V(k), X(k + 1), V(k + 1), B(k), B(k + 1))
        graph.push_back(gtsam.CombinedImuFactor(*keys, pre))
        predicted = pre.predict(self.state, self.bias)
        values.insert(X(k + 1), predicted.pose())
        values.insert(V(k + 1), predicted.velocity())
        values.insert(B(k + 1), self.bias)
        self.key = k + 1
        self._poses.append(predicted.pose())
        self._times.append(self._times[-1] + pre.deltaTij())
        times |= {key(k + 1): self._times[-1] for key in (X, V, B)}

    def _update_state(self) -> None:
        k = self.key
        pose = self.smoother.calculateEstimatePose3(X(k))
        self._poses[k] = pose
        self.state = gtsam.NavState(pose, self.smoother.calculateEstimateVector(V(k)))
        self.bias = self.smoother.calculateEstimateConstantBias(B(k))
        self._preintegration.resetIntegrationAndSetBias(self.bias)

    def _admit(self, visible: set[int]) -> None:
        """Add landmarks to the problem that are seen now and can be triangulated."""
        graph, values, times = gtsam.NonlinearFactorGraph(), gtsam.Values(), {}
        for identity in sorted(visible & set(self._waiting)):
            sights = self._waiting[identity].sights
            point = self._triangulated(sights)
            if point is None:
                continue
            self._insert(graph, values, times, identity, point, sights)
            del self._waiting[identity]
        if values.size():
            self.smoother.update(graph, values, times)
            self._update_state()

    def _insert(
        self,
        graph: gtsam.NonlinearFactorGraph,
        values: gtsam.Values,
        times: dict[int, float],
        identity: int,
        point: np.ndarray,
        sights: list[tuple[int, int, np.ndarray]],
    ) -> None:
        """Put a landmark into the problem, with all that is seen of it."""
        number, self._landmarks = self._landmarks, self._landmarks + 1
        values.insert(L(number), point)
        # A factor says nothing while an iterate has its landmark behind the camera.
        distance = np.linalg.norm(point - self._poses[sights[-1][0]].translation())
        vague = gtsam.noiseModel.Isotropic.Sigma(3, VAGUE * float(distance))
        graph.addPriorPoint3(L(number), point, vague)
        for key, camera, pixel in sights:
            graph.push_back(self._cameras[camera].factor(pixel, key, number))
        self._known[identity] = number
        times[L(number)] = self._seen[identity] = self._times[sights[-1][0]]

    def _triangulated(self, sights: list[tuple[int, int, np.ndarray]]) -> np.ndarray | None:
        """Return a landmark's place (3,), or None while it is not well determined."""
        if len(sights) < LEAST_SIGHTS:
            return None
        poses = [self._poses[key].compose(self._cameras[c].body_camera) for key, c, _ in sights]
        rays = []
        for pose, (_, camera, pixel) in zip(poses, sights, strict=True):
            m = self._cameras[camera].calibration.calibrate(pixel)
            direction = pose.rotation().matrix() @ np.array([m[0], m[1], 1.0])
            rays.append(direction / np.linalg.norm(direction))
        rays = np.array(rays)
        if np.arccos(np.clip((rays @ rays.T).min(), -1.0, 1.0)) < LEAST_PARALLAX:
            return None
        # The place nearest to all rays: sum (I - d d^T) (x - c) = 0.
        across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
        centers = np.array([pose.translation() for pose in poses])
        point = np.linalg.solve(across.sum(axis=0), np.einsum("nij,nj->i", across, centers))
        for pose, (_, camera, pixel) in zip(poses, sights, strict=True):
            local = pose.transformTo(point)
            if local[2] < 0.2:
                return None
            miss = self._cameras[camera].calibration.uncalibrate(local[:2] / local[2]) - pixel
            if np.linalg.norm(miss) > LARGEST_MISS:
                return None
        return point


class CameraFactors:
    """A camera's model in gtsam's terms."""

    def __init__(self, camera: CameraParameters) -> None:
        self.calibration, self._make = _calibration(camera)
        r_bc, p_bc = camera.pose()
        self.body_camera = gtsam.Pose3(gtsam.Rot3(r_bc), p_bc)
        huber = gtsam.noiseModel.mEstimator.Huber.Create(3.0)
        pixel = gtsam.noiseModel.Isotropic.Sigma(2, max(camera.pixel_noise, 1e-2))
        # Without outliers the plain model: a robust one would hide wrong noise from the NEES.
        wrong = camera.outlier_probability + camera.mismatch_probability
        self._pixel = gtsam.noiseModel.Robust.Create(huber, pixel) if wrong else pixel

    def factor(self, pixel: np.ndarray, key: int, number: int) -> gtsam.NonlinearFactor:
        """Return the factor of one observation."""
        return self._make(pixel, self._pixel, X(key), L(number), self.calibration, self.body_camera)


def _calibration(camera: CameraParameters):
    """Return gtsam's calibration and projection factor of a pinhole camera."""
    fx, fy, cx, cy = camera.intrinsics
    if camera.model != "pinhole":
        raise SystemExit(f"gtsam_vio: camera.model {camera.model}: gtsam supports only pinhole")
    k = (*camera.distortion, 0.0, 0.0, 0.0, 0.0)[:4]
    match camera.distortion_model:
        case "radtan":
            return gtsam.Cal3DS2(fx, fy, 0.0, cx, cy, *k), gtsam.GenericProjectionFactorCal3DS2
        case "equidistant":
            fisheye = gtsam.Cal3Fisheye(fx, fy, 0.0, cx, cy, *k)
            return fisheye, gtsam.GenericProjectionFactorCal3Fisheye
    return gtsam.Cal3_S2(fx, fy, 0.0, cx, cy), gtsam.GenericProjectionFactorCal3_S2


@dataclass
class Result:
    """The estimate at each key frame, and the truth."""

    t_ns: np.ndarray
    position: np.ndarray
    q_wb: np.ndarray
    position_error: np.ndarray
    """(n, 3) m."""
    rotation_error: np.ndarray
    """(n, 3) rad, in the body."""
    nees_position: np.ndarray
    """(n,) of 3 degrees of freedom."""
    nees_orientation: np.ndarray
    """(n,) of 3 degrees of freedom."""
    covariance: np.ndarray
    """(n, 6, 6) of the rotation in the body and the position in the world."""

    def write(self, path: Path) -> None:
        """Write TUM's form with OpenVINS' columns of covariance."""
        row, column = np.triu_indices(3)
        triangles = [self.covariance[:, offset + row, offset + column] for offset in (0, 3)]
        columns = [self.position, self.q_wb[:, [1, 2, 3, 0]], *triangles]
        with path.open("w", encoding="utf-8") as file:
            for t, row in zip(self.t_ns.tolist(), np.hstack(columns).tolist(), strict=True):
                # A float holds no nanoseconds of today's date: seconds and fraction apart.
                stamp = f"{t // 10**9}.{t % 10**9:09d}"
                print(stamp, *(f"{value:.12g}" for value in row), file=file)

    def summary(self) -> dict[str, float]:
        """Return a summary of the run; the first key frame is given and left out."""
        return {
            "keyframes": len(self.t_ns),
            "position_rmse_m": float(np.sqrt((self.position_error[1:] ** 2).sum(axis=1).mean())),
            "orientation_rmse_rad": float(
                np.sqrt((self.rotation_error[1:] ** 2).sum(axis=1).mean())
            ),
            "nees_position_per_dof": float(self.nees_position[1:].mean() / 3.0),
            "nees_orientation_per_dof": float(self.nees_orientation[1:].mean() / 3.0),
        }


def run(
    folder: Path,
    parameters: SimulationParameters,
    *cameras: CameraParameters,
    rate: float = 4.0,
    first_frame: int = 0,
) -> Result:
    """Return the :class:`Result` on a folder that ``generate --format tracks`` wrote.

    :param cameras: the first ones of the folder.
    :param rate: of key frames [Hz].
    :param first_frame: frame to begin with.
    """
    imu = np.loadtxt(folder / "imu0.csv", delimiter=",", skiprows=1)
    imu_t = np.loadtxt(folder / "imu0.csv", delimiter=",", skiprows=1, usecols=0, dtype=np.int64)
    truth = read_poses(folder / "groundtruth.tum")
    tracks = np.load(folder / "tracks.npz")
    of_cameras = tracks["camera"] < len(cameras)
    t_ns, ids, uv, camera_numbers = (
        tracks[name][of_cameras] for name in ("t_ns", "id", "uv", "camera")
    )
    stride = max(1, round(cameras[0].rate / rate))
    motion = parameters.trajectory
    begin = imu_t[0] + round((motion.lead_in.rest or motion.rest_before) * 1e9)
    frames = np.unique(t_ns)
    frames = frames[(frames >= begin) & (frames <= imu_t[-1])][first_frame::stride]
    estimator = Estimator(parameters, *cameras)
    rows, columns_of_keys = [], []
    for k, frame_ns in enumerate(frames.tolist()):
        row = int(np.searchsorted(truth.t_ns, frame_ns))
        true_pose = gtsam.Pose3(
            gtsam.Rot3(rotation.to_matrix(truth.q_wb[row])), truth.position[row]
        )
        if k == 0:
            if begin > imu_t[0]:
                estimator.rest(true_pose, imu[imu_t < begin, 1:])
            step = (truth.position[row + 1] - truth.position[row]) * parameters.rate
            # Half a step further is the mean velocity's time: back by half an acceleration.
            ahead = (truth.position[row + 2] - truth.position[row + 1]) * parameters.rate
            estimator.start(true_pose, 1.5 * step - 0.5 * ahead)
        else:
            span = slice(rows[-1], row + 1)
            mean = 0.5 * (imu[span][1:, 1:] + imu[span][:-1, 1:])
            for values, dt in zip(mean, np.diff(imu_t[span]) * 1e-9, strict=True):
                estimator.integrate(values[3:], values[:3], float(dt))
        in_frame = t_ns == frame_ns
        estimator.look(ids[in_frame], uv[in_frame], camera_numbers[in_frame])
        rows.append(row)
        columns_of_keys.append(compared(estimator, true_pose))
    return Result(frames, *(np.array(column) for column in zip(*columns_of_keys, strict=True)))


def stop_if_lost(covariance: np.ndarray, key: int) -> None:
    """Leave if the position of a key frame is anywhere: without landmarks an estimate runs away.

    :param covariance: (6, 6) of rotation and position.
    """
    deviation = float(np.sqrt(np.trace(covariance[3:, 3:])))
    if not deviation < LOST:
        raise SystemExit(
            f"lost: at key frame {key} the position has a standard deviation of {deviation:.3g} m; "
            "nothing that it sees has a known place"
        )


def compared(estimator: Estimator, true: gtsam.Pose3) -> tuple:
    """Return the columns of :class:`Result` for the latest key frame."""
    pose = estimator.state.pose()
    error = pose.localCoordinates(true)
    covariance = estimator.covariance()
    stop_if_lost(covariance, estimator.key)
    nees = [
        float(e @ np.linalg.solve(covariance[part, part], e))
        for part in (slice(3, 6), slice(0, 3))
        for e in [error[part]]
    ]
    q = pose.rotation().toQuaternion()
    q_wb = np.array([q.w(), q.x(), q.y(), q.z()])
    position = pose.translation()
    # gtsam's covariance of the position is resolved in the body.
    r = np.eye(6)
    r[3:, 3:] = pose.rotation().matrix()
    in_world = r @ covariance @ r.T
    return position, q_wb, position - true.translation(), error[:3], *nees, in_world


def main() -> None:
    """Run on a folder and print the result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="written by generate --format tracks")
    parser.add_argument("--configuration", type=Path, help="simulation.yaml of --with-configs")
    parser.add_argument("-o", "--output", type=Path, help="the estimated path, for evaluate")
    parser.add_argument("--cameras", type=int, default=1, help="cameras to use (1)")
    arguments = parser.parse_args()
    folder = arguments.folder
    path = arguments.configuration or folder.with_name(folder.name + "_configs") / "simulation.yaml"
    parameters, cameras = configuration(path)
    result = run(folder, parameters, *cameras[: arguments.cameras])
    if arguments.output is not None:
        result.write(arguments.output)
    print(json.dumps(result.summary(), indent=2))


def configuration(path: Path) -> tuple[SimulationParameters, list[CameraParameters]]:
    """Return the simulation and the cameras of a file of ``--with-configs``."""
    simulation = load_simulation(files.load(path))
    return simulation, list(simulation.rig.camera_parameters().values())


if __name__ == "__main__":
    main()
