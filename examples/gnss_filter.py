# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

r"""IMU and GNSS in gtsam on a simulated drive: errors, and whether they are as large as it says.

    python examples/gnss_filter.py                    # 30 drives with an outage, a picture
    python examples/gnss_filter.py DATASET --configuration simulation.yaml -o estimate.txt

CombinedImuFactor from fix to fix, GPSFactorArm for the antenna on its lever arm, a prior on the
velocity, iSAM2. The first form simulates; the second reads the EuRoC folder of a campaign
(config/estimators/gnss_filter.yaml). The first pose and velocity are given. Needs gtsam.
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import gtsam
import gtsam_noise
import numpy as np
from gtsam.symbol_shorthand import B, V, X

import imu_sim_ros as ims
from imu_sim_ros.core import rotation
from imu_sim_ros.core.geodesy import east_north_up, ecef_of_geodetic
from imu_sim_ros.parameters import files
from imu_sim_ros.simulation.parameters import load_simulation

START = {"pose": np.array([1e-3, 1e-3, 5e-3, 1e-2, 1e-2, 1e-2]), "velocity": 1e-2}
SILENCE = 1.0  # s without a fix after which a key frame is made all the same
RELINEARISE = 1e-3  # change of a state for which its factors are linearised anew
OUTAGE = (20.0, 30.0)  # start and length, s
DRIVE = {
    "imu": "bmi088",
    # Of the sensor, what gtsam models: white noise, biases that walk, and their unknown starts.
    "imu.gyroscope_turn_on_scale_sigma": 0.0,
    "imu.accelerometer_turn_on_scale_sigma": 0.0,
    "imu.gyroscope_misalignment_sigma": 0.0,
    "imu.accelerometer_misalignment_sigma": 0.0,
    "imu.gyroscope_g_sensitivity_sigma": 0.0,
    "rate": 100.0,
    "duration": 70.0,
    "trajectory": "town",
    "trajectory.rest_before": 5.0,
    "sensors": ["gnss"],
    "gnss.rate": 1.0,
    "gnss.white_share": 1.0,
    "gnss.lever_arm": [0.5, 0.0, 1.2],
    "gnss.outages": list(OUTAGE),
}


@dataclass
class Fixes:
    """Fixes of a GNSS receiver at n times, in the world frame."""

    t_ns: np.ndarray
    position: np.ndarray
    """(n, 3) east, north, up [m]."""
    variance: np.ndarray
    """(n, 3) stated variance of the position [m^2]."""
    velocity: np.ndarray
    """(n, 3) east, north, up [m/s]."""
    velocity_variance: np.ndarray
    """(n, 3) stated [m^2/s^2]."""


@dataclass
class Result:
    """Estimates at the n key frames of one drive."""

    t_ns: np.ndarray
    pose: list
    velocity: np.ndarray
    covariance: np.ndarray
    """(n, 6, 6) of rotation and place, both in the body."""

    def position_nees(self, truth: np.ndarray) -> np.ndarray:
        """Return the NEES (n,) of positions against true ones (n, 3); 3 degrees of freedom."""
        error = self.errors(truth)
        sigma = self.position_covariance()
        return np.einsum("ni,ni->n", error, np.linalg.solve(sigma, error[..., None])[..., 0])

    def errors(self, truth: np.ndarray) -> np.ndarray:
        """Return position errors (n, 3) [m]."""
        return np.array([pose.translation() for pose in self.pose]) - truth

    def position_covariance(self) -> np.ndarray:
        """Return the covariances (n, 3, 3) of the positions in the world."""
        r = np.array([pose.rotation().matrix() for pose in self.pose])
        return r @ self.covariance[:, 3:, 3:] @ r.transpose(0, 2, 1)

    def write(self, path: Path) -> None:
        """Write TUM's form with OpenVINS' columns of covariance: rotation, position."""
        row, column = np.triu_indices(3)
        sigma = np.concatenate(
            [self.covariance[:, row, column], self.position_covariance()[:, row, column]], axis=1
        )
        with path.open("w", encoding="utf-8") as file:
            for t, pose, triangles in zip(self.t_ns.tolist(), self.pose, sigma, strict=True):
                q = pose.rotation().toQuaternion()
                numbers = [*pose.translation(), q.x(), q.y(), q.z(), q.w(), *triangles]
                cells = (f"{value:.12g}" for value in numbers)
                print(f"{t // 10**9}.{t % 10**9:09d}", *cells, file=file)


def estimate(parameters, t_ns, gyro, accel, fixes, pose, velocity) -> Result:
    """Return the filter's estimate at every fix, and each second without one.

    :param parameters: of the simulation: noise, gravity, lever arms.
    :param t_ns: (n,) of the readings.
    :param pose: at the first reading, known as well as START says.
    """
    noise = gtsam_noise.imu_noise(parameters)
    preintegrated = gtsam.PreintegratedCombinedMeasurements(noise)
    settings = gtsam.ISAM2Params()
    settings.relinearizeSkip = 1
    settings.setFactorization("QR")  # Cholesky stops with an indeterminate system
    settings.setRelinearizeThreshold(RELINEARISE)
    isam, sigmas = gtsam.ISAM2(settings), gtsam.noiseModel.Diagonal.Sigmas
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    bias = gtsam.imuBias.ConstantBias()
    graph.addPriorPose3(X(0), pose, sigmas(START["pose"]))
    graph.addPriorVector(V(0), velocity, sigmas(np.full(3, START["velocity"])))
    graph.addPriorConstantBias(B(0), bias, sigmas(gtsam_noise.bias_sigma(parameters)))
    for key, value in ((X(0), pose), (V(0), velocity), (B(0), bias)):
        values.insert(key, value)
    isam.update(graph, values)
    arm = np.asarray(parameters.gnss.lever_arm)
    state, row = gtsam.NavState(pose, velocity), 0
    estimates = [(int(t_ns[0]), pose, velocity, isam.marginalCovariance(X(0)))]
    for k, (t_key, fix) in enumerate(moments(t_ns, fixes), start=1):
        end = int(np.searchsorted(t_ns, t_key))
        mean = 0.5 * (
            np.hstack([accel, gyro])[row:end] + np.hstack([accel, gyro])[row + 1 : end + 1]
        )
        for reading, dt in zip(mean, np.diff(t_ns[row : end + 1]) * 1e-9, strict=True):
            preintegrated.integrateMeasurement(reading[:3], reading[3:], float(dt))
        row = end
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        graph.push_back(
            gtsam.CombinedImuFactor(X(k - 1), V(k - 1), X(k), V(k), B(k - 1), B(k), preintegrated)
        )
        predicted = preintegrated.predict(state, bias)
        if fix is not None:
            place = sigmas(np.sqrt(fixes.variance[fix]))
            graph.push_back(gtsam.GPSFactorArm(X(k), fixes.position[fix], arm, place))
            swing = predicted.pose().rotation().matrix() @ np.cross(
                gyro[end] - bias.gyroscope(), arm
            )
            speed = sigmas(np.sqrt(fixes.velocity_variance[fix]))
            graph.addPriorVector(V(k), fixes.velocity[fix] - swing, speed)
        values.insert(X(k), predicted.pose())
        values.insert(V(k), predicted.velocity())
        values.insert(B(k), bias)
        isam.update(graph, values)
        pose, velocity = isam.calculateEstimatePose3(X(k)), isam.calculateEstimateVector(V(k))
        bias = isam.calculateEstimateConstantBias(B(k))
        state = gtsam.NavState(pose, velocity)
        preintegrated.resetIntegrationAndSetBias(bias)
        estimates.append((t_key, pose, velocity, isam.marginalCovariance(X(k))))
    times, poses, velocities, covariances = zip(*estimates, strict=True)
    return Result(np.array(times), list(poses), np.array(velocities), np.array(covariances))


def moments(t_ns, fixes):
    """Yield the times of key frames [ns], each with the number of its fix, or None."""
    t_key, step = int(t_ns[0]), round(SILENCE * 1e9)
    for number, t in enumerate([*fixes.t_ns.tolist(), int(t_ns[-1])]):
        while t - t_key > 1.5 * step:
            t_key += step
            yield int(t_ns[np.searchsorted(t_ns, t_key)]), None
        if t_key < t <= t_ns[-1]:
            t_key = t
            yield t, number if number < len(fixes.t_ns) else None


def simulated(seed: int, **parameters) -> tuple[Result, np.ndarray]:
    """Return the estimate of a simulated drive, and the true positions of its key frames."""
    flight = ims.simulate(seed=seed, **{**DRIVE, **parameters})
    gnss, truth = flight.gnss, flight.truth
    fixes = Fixes(gnss.t_ns, gnss.position, gnss.variance, gnss.velocity, gnss.velocity_variance)
    # The initial pose and velocity are known to within START: draw their errors.
    draw = np.random.default_rng(seed).standard_normal(9)
    true_pose = gtsam.Pose3(gtsam.Rot3(rotation.to_matrix(truth.q_wb[0])), truth.position[0])
    initial_pose = true_pose.retract(START["pose"] * draw[:6])
    velocity = truth.velocity[0] + START["velocity"] * draw[6:]
    arguments = flight.t_ns, flight.gyro, flight.accel, fixes, initial_pose, velocity
    result = estimate(flight.parameters, *arguments)
    return result, truth.position[np.searchsorted(truth.t_ns, result.t_ns)]


def of_folder(folder: Path, configuration: Path) -> Result:
    """Return the estimate on a campaign's EuRoC folder."""
    parameters = load_simulation(files.load(configuration))
    imu = np.loadtxt(folder / "mav0/imu0/data.csv", delimiter=",", skiprows=1)
    gps = np.loadtxt(folder / "mav0/gps0/data.csv", delimiter=",", skiprows=1, ndmin=2)
    truth_file = folder / "mav0/state_groundtruth_estimate0/data.csv"
    start = np.loadtxt(truth_file, delimiter=",", skiprows=1, max_rows=1)
    (imu_t, gps_t) = (
        np.loadtxt(folder / name, delimiter=",", skiprows=1, usecols=0, dtype=np.int64, ndmin=1)
        for name in ("mav0/imu0/data.csv", "mav0/gps0/data.csv")
    )
    origin = (
        np.array([x])
        for x in (parameters.latitude_deg, parameters.longitude_deg, parameters.height)
    )
    latitude, longitude, height = origin
    axes = east_north_up(latitude, longitude)[0]
    place = ecef_of_geodetic(*gps[:, 1:4].T) - ecef_of_geodetic(latitude, longitude, height)
    speed = np.full(
        (len(gps), 3), parameters.gnss.covariance_factor * parameters.gnss.velocity_sigma**2
    )
    fixes = Fixes(gps_t, place @ axes.T, gps[:, 4:7], gps[:, 7:10], speed)
    pose = gtsam.Pose3(gtsam.Rot3(rotation.to_matrix(start[4:8])), start[1:4])
    return estimate(parameters, imu_t, imu[:, 1:4], imu[:, 4:7], fixes, pose, start[8:11])


def main() -> None:
    """Simulate and draw, or estimate a dataset's path."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "dataset", type=Path, nargs="?", default=Path(), help="or the output's folder"
    )
    parser.add_argument("--configuration", type=Path, help="simulation.yaml of the dataset")
    parser.add_argument("-o", "--output", type=Path, help="the estimated path, for evaluate")
    parser.add_argument("--seeds", type=int, default=30, help="drives to simulate (30)")
    arguments = parser.parse_args()
    if arguments.configuration is not None:
        of_folder(arguments.dataset, arguments.configuration).write(arguments.output)
        return
    draw(arguments.dataset, arguments.seeds)


def draw(folder: Path, seeds: int) -> None:
    """Print and draw errors and NEES of drives, with honest and with too small covariances."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from scipy.stats import chi2

    figure, (errors, nees) = plt.subplots(1, 2, figsize=(11.0, 4.0), layout="constrained")
    low, high = chi2.ppf([0.025, 0.975], 3 * seeds) / seeds
    for factor, colour, name in ((1.0, "black", "honest"), (0.25, "tab:red", "a quarter of it")):
        runs = [simulated(seed, **{"gnss.covariance_factor": factor}) for seed in range(seeds)]
        t = (runs[0][0].t_ns - runs[0][0].t_ns[0]) * 1e-9
        run_nees = np.array([result.position_nees(truth) for result, truth in runs])
        rms = np.sqrt(
            np.mean([(result.errors(truth) ** 2).sum(axis=1) for result, truth in runs], axis=0)
        )
        sigma = np.sqrt(
            np.mean([np.trace(r.position_covariance(), axis1=1, axis2=2) for r, _ in runs], axis=0)
        )
        if factor == 1.0:
            errors.plot(t, rms, color=colour, label=f"RMS of {seeds} drives")
            errors.plot(t, sigma, "--", color="tab:blue", label="as gtsam says")
        nees.plot(t, run_nees.mean(axis=0), color=colour, label=f"stated covariance: {name}")
        end = int(np.searchsorted(t, sum(OUTAGE) - 1.5))  # the last second without a fix
        print(
            f"{name}: {rms[end]:.2f} m at the end of the outage, {sigma[end]:.2f} m stated; "
            f"NEES {run_nees[:, end].mean():.2f}, at the end {run_nees[:, -1].mean():.2f} of 3, "
            f"band {low:.2f} to {high:.2f}"
        )
    errors.set(
        xlabel="time [s]", ylabel="position error [m]", yscale="log", title="an outage of 30 s"
    )
    nees.axhspan(low, high, color="tab:green", alpha=0.2, label="95 % of chi-square")
    nees.set(xlabel="time [s]", ylabel="mean NEES, 3 dof", title="consistency")
    nees.set_ylim(0.0, 1.3 * nees.get_ylim()[1])  # room for the legend
    for axes in (errors, nees):
        axes.axvspan(OUTAGE[0], sum(OUTAGE), color="grey", alpha=0.15)
        axes.legend(fontsize=8)
        axes.grid(alpha=0.3)
    figure.savefig(folder / "gnss_filter.png", dpi=100)


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    main()
