# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A twin flown on a part of the recording that it has not seen, against the real readings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.twin import comparison, intensity, model
from imu_sim_ros.calibration.twin import comparison as truth
from imu_sim_ros.calibration.twin.analysis import Analysis
from imu_sim_ros.calibration.twin.fit import Fit, Recording
from imu_sim_ros.calibration.twin.model import Errors
from imu_sim_ros.calibration.twin.pose_noise import noise_over, scatter
from imu_sim_ros.core import rotation, timebase
from imu_sim_ros.core.types import Array, JsonObject
from imu_sim_ros.jobs.twin_recording import TwinRecording, rows_in_motion
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.mount import mount_at
from imu_sim_ros.navigation.state import NavigationState
from imu_sim_ros.parameters.kinds import Value
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.sensors.pose.declaration import NAME as POSE
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.terminal.json_text import plain_types
from imu_sim_ros.trajectory.motion import Motion

WINDOWS: Final = (1.0, 2.0, 5.0)
"""Times over which positions are dead-reckoned [s]."""
_EVERY: Final = 0.5
"""Time between two starts of dead reckoning [s]."""
SEEDS: Final = 5
"""Number of simulated twins."""
_TRUTH_FROM: Final = 1.0
"""Frequency from which on a residual follows the truth's noise [Hz]."""
_TRUTH_TO: Final = 0.75
"""Times the cut-off; there the spline through the poses still lets 85 % of their noise through. On
EuRoC's MH_01, from half the cut-off to there, the accelerometer's residual in windows of half a
second follows that noise with a correlation of 0.8."""


class Flown(NamedTuple):
    """Readings on a known motion, real or simulated."""

    t: Array
    """(n,) true times [s]."""
    readings: Array
    """(n, 6) gyroscope [rad/s] and accelerometer [m/s^2]."""
    residuals: Array
    """(n, 6) readings minus what the twin's constant errors explain."""


@dataclass(frozen=True, repr=False)
class Check:
    """Comparison of the twin with the real sensor, on a part of the flight not used in the fit.

    Lists of five are the bands 0.2-1, 1-5, 5-20, 20-50 and 50-100 Hz; six are gyroscope x, y, z and
    accelerometer x, y, z.
    """

    seconds: float
    """Length of the part [s]."""
    real: Array
    """(5, 6) densities of the real residual."""
    simulated: Array
    """(5, 6) densities of the twin's residual, mean square over the seeds."""
    decibels: Array
    """(5, 6) twin over real; NaN above half the rate."""
    real_drift: Array
    """(3,) median position error of the real IMU after 1, 2 and 5 s [m]."""
    simulated_drift: Array
    """(3,) median position error of the twin after 1, 2 and 5 s [m]."""
    truth_noise: Array
    """(6,) RMS noise of the truth on this part, over that where the twin was fitted."""
    told_apart: float
    """Share of windows of half a second that a classifier assigns right; 0.5: it cannot."""
    real_told_apart: float
    """Share that a classifier assigns right of the real residuals of the fitted part and of this
    part: how much a flight differs from itself."""
    flown: tuple[Flown, Flown]
    """The real readings, and those of the first twin."""
    windows: comparison.Windows
    """Inputs of the classifier."""

    def __repr__(self) -> str:
        worst = float(np.nanmax(np.abs(self.decibels)))
        drift = 100.0 * float(np.nanmax(np.abs(self.simulated_drift / self.real_drift - 1.0)))
        return (
            f"<Check over {self.seconds:.3g} s: densities within {worst:.2g} dB, drift within "
            f"{drift:.2g} %, told apart {100.0 * self.told_apart:.0f} %, real from real "
            f"{100.0 * self.real_told_apart:.0f} %>"
        )

    def to_dict(self) -> JsonObject:
        """Return the numbers by name; None if there is none."""
        return plain_types(
            {
                "seconds": self.seconds,
                "bands_hz": [list(band) for band in comparison.BANDS],
                "real_density": self.real,
                "simulated_density": self.simulated,
                "decibels": self.decibels,
                "windows_s": list(WINDOWS),
                "real_drift_m": self.real_drift,
                "simulated_drift_m": self.simulated_drift,
                "truth_noise_ratio": self.truth_noise,
                "told_apart": self.told_apart,
                "real_told_apart": self.real_told_apart,
            }
        )


def check(
    source: TwinRecording,
    part: Recording,
    analysis: Analysis,
    parameters: dict[str, Value],
    seeds: int = SEEDS,
) -> Check:
    """Compare a twin with a part of the recording.

    The truth's clock and smoothing are found again on this part, and the twins are held against a
    truth with noise of its poses, as much as these show here: the sensor causes none of these.
    Everything else stays as it is.

    :param seeds: seeds of the twins that are flown.
    """
    fit = analysis.fit
    real = _place_on_truth(source, part, fit)
    parts = _parts(source, real.t, part)
    rate = part.rate
    twins = [_simulate_twin(source, real.t, fit.errors, parameters, seed) for seed in range(seeds)]
    noise = _truth_noise(source, fit, analysis.parts, twins[0].t)
    twins = [_add_truth_noise(twin, noise, rate, source.cutoff) for twin in twins]
    ends = [(real.t[p.start], real.t[p.stop - 1]) for p in parts]
    flown = [slice(*np.searchsorted(twins[0].t, end).tolist()) for end in ends]
    levels = comparison.levels(real.residuals, parts, rate)
    twin_levels = [comparison.levels(twin.residuals, flown, rate) for twin in twins]
    simulated = np.sqrt(np.mean(np.square(twin_levels), axis=0))
    windows = comparison.Windows(
        comparison.features(fit.residuals, analysis.parts, rate),
        comparison.features(real.residuals, parts, rate),
        tuple(comparison.features(twin.residuals, flown, rate) for twin in twins),
    )
    drifts = [_drift(source, twin, fit.errors, np.zeros(3)) for twin in twins]
    return Check(
        float(real.t[-1] - real.t[0]),
        levels,
        simulated,
        comparison.decibels(simulated, levels),
        _median(_drift(source, real, fit.errors, fit.errors.world)),
        np.array([_median([np.concatenate(d) for d in zip(*drifts, strict=True)])])[0],
        np.sqrt(np.mean(noise**2, axis=0)),
        *windows.classification_rates(),
        (real, twins[0]),
        windows,
    )


def _median(errors: list[Array]) -> Array:
    """Return the median (n,) of several arrays; NaN of empty ones."""
    return np.array([np.median(e) if len(e) else np.nan for e in errors])


def _place_on_truth(source: TwinRecording, part: Recording, fit: Fit) -> Flown:
    """Return readings on the truth, whose clock and smoothing are found again on this part."""
    again = truth.align_truth(part, source.truth, fit)
    t = model.true_times(again.errors, part.stamps, again.reference, again.wander)
    return Flown(t, part.readings, again.residuals)


def _truth_noise(source: TwinRecording, fit: Fit, parts: tuple[slice, ...], t: Array) -> Array:
    """Return the truth's noise (n, 6) at times (n,) [s], relative to that in the twin's fit.

    :param parts: rows of the recording whose residual is simulated.
    """
    poses = source.poses
    times, noise = scatter(poses)
    noise = np.concatenate([noise[:, k : k + 3] @ fit.errors.r_ib.T for k in (0, 3)], axis=1)
    stamps = source.recording.stamps[parts[0].start : parts[-1].stop]
    return noise_over(times, noise, (float(stamps[0]), float(stamps[-1])), t)


def _add_truth_noise(flown: Flown, size: Array, rate: float, cutoff: float) -> Flown:
    """Return a twin's readings whose residual from 1 Hz to nearly the cut-off follows the truth's.

    There, above its slow errors and below vibration, a residual is mostly the truth's noise.

    :param size: (n, 6) ratio of that noise to the noise that the twin simulates.
    """
    whole = [slice(0, len(flown.t))]
    noise = intensity.filter_band(flown.residuals, whole, rate, _TRUTH_FROM, _TRUTH_TO * cutoff)
    extra = (size - 1.0) * noise
    return Flown(flown.t, flown.readings + extra, flown.residuals + extra)


def _parts(source: TwinRecording, t: Array, part: Recording) -> list[slice]:
    """Return the rows in motion, piece by piece."""
    rows = rows_in_motion(source.motion(t)) & intensity.vibration_mask(
        part.readings, part.pieces, part.rate
    )
    result = []
    for piece in part.pieces:
        moving_rows = np.flatnonzero(rows[piece])
        if len(moving_rows):
            result.append(
                slice(piece.start + int(moving_rows[0]), piece.start + int(moving_rows[-1]) + 1)
            )
    return result or list(part.pieces)


def simulation(source: TwinRecording, parameters: dict[str, Value], seed: int) -> Body:
    """Return the twin's simulation on the truth's own motion."""
    layers: dict[str, object] = {
        **parameters,
        "seed": seed,
        "trajectory.type": "poses",
        "trajectory.file": source.name,
        "gravity": [0.0, 0.0, -source.gravity],
    }
    built = load_simulation(layers)
    return Body(built, t0_ns=source.t0_ns, trajectory=source.trajectory, sensors=(POSE,))


def _simulate_twin(
    source: TwinRecording, t: Array, errors: Errors, parameters: dict[str, Value], seed: int
) -> Flown:
    """Return the twin's readings over the times of the real ones, against a noisy truth."""
    engine = simulation(source, parameters, seed)
    blocks = [window[IMU] for window in engine.windows()]
    true = np.concatenate([b.true_t_ns for b in blocks])
    times = timebase.seconds_since(true, engine.t0_ns)
    overlap = (times >= t[0]) & (times <= t[-1])
    readings = np.concatenate([np.hstack([block.gyro, block.accel]) for block in blocks])[overlap]
    times = times[overlap]
    motion_at = source.truth.noisy[seed % len(source.noisy)] if source.noisy else source.body_motion
    residuals = readings - model.readings(errors, motion_at(times))
    return Flown(times, readings, residuals)


def _drift(source: TwinRecording, flown: Flown, errors: Errors, world: Array) -> list[Array]:
    """Return the position errors [m] after each length of window, from the true state."""
    motion = _imu_motion(source, flown.t, errors, world)
    t_ns = np.round(flown.t * 1e9).astype(np.int64)
    x = flown.readings - errors.bias
    result = []
    for length in WINDOWS:
        distances = []
        for start in np.arange(flown.t[0], flown.t[-1] - length, _EVERY):
            begin, end = np.searchsorted(flown.t, [start, start + length])
            rows = slice(begin, end + 1)
            if flown.t[end] - flown.t[begin] > length + 0.1:
                continue
            state = NavigationState(
                motion.position[begin], motion.velocity[begin], motion.q_wb[begin]
            )
            track = dead_reckon(
                t_ns[rows], x[rows, :3], x[rows, 3:], state, gravity=(0.0, 0.0, -source.gravity)
            )
            distances.append(float(np.linalg.norm(track.position[-1] - motion.position[end])))
        result.append(np.array(distances))
    return result


def _imu_motion(source: TwinRecording, t: Array, errors: Errors, world: Array) -> Motion:
    """Return the motion of the IMU itself, at its lever arm and in its mounting.

    :param world: (3,) turn of the attitudes' world to that of positions and gravity [rad].
    """
    motion = source.motion(t)
    motion = motion._replace(q_wb=rotation.multiply(rotation.exp(world), motion.q_wb))
    mount = mount_at(errors.lever_arm, errors.r_ib.T)
    body = NavigationState._make((motion.position, motion.velocity, motion.q_wb))
    imu = mount.imu_state(body, motion.angular_velocity)
    return motion._replace(position=imu.position, velocity=imu.velocity, q_wb=imu.q_wb)


def real_and_twin_residuals(
    source: TwinRecording, fit: Fit, parameters: dict[str, Value], seed: int
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return times and residuals of the part that was fitted, and those of a twin on it."""
    rows = len(fit.residuals)
    stamps = source.recording.stamps[:rows]
    t = model.true_times(fit.errors, stamps, fit.reference, fit.wander)
    twin = _simulate_twin(source, t, fit.errors, parameters, seed)
    return (t, fit.residuals), (twin.t, twin.residuals)
