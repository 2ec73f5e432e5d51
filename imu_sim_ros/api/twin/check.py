# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A twin flown on a part of the recording that it has not seen, against the real readings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation, timebase
from imu_sim_ros.api.twin.recording import Recorded, moving
from imu_sim_ros.calibration.twin import Errors, Fit, Recording, clock, comparison, model
from imu_sim_ros.config import Value, load_simulation
from imu_sim_ros.navigation import NavigationState, dead_reckon
from imu_sim_ros.simulation import Simulation
from imu_sim_ros.trajectory import Motion

Array = NDArray[np.float64]

WINDOWS: Final = (1.0, 2.0, 5.0)
"""[s] over which positions are dead-reckoned."""
_EVERY: Final = 0.5
"""[s] between two starts."""
SEEDS: Final = 5
"""Twins that are flown."""
_ALIGNMENTS: Final = 2


class Flown(NamedTuple):
    """Readings on a known motion, real or simulated."""

    t: Array
    """(n,) true times [s]."""
    readings: Array
    """(n, 6)"""
    residuals: Array
    """(n, 6) readings minus what the twin's constant errors explain."""


@dataclass(frozen=True, repr=False)
class Check:
    """How far the twin is from the real sensor, on a part of the flight that it was not fitted to.

    Lists of five are the bands 0.2-1, 1-5, 5-20, 20-50 and 50-100 Hz; six are gyroscope x, y, z and
    accelerometer x, y, z.
    """

    seconds: float
    """Length of the part [s]."""
    real: Array
    """(5, 6) densities of the real residual."""
    simulated: Array
    """(5, 6) densities of the twin's, mean square over the seeds."""
    decibels: Array
    """(5, 6) twin over real; NaN above half the rate."""
    real_drift: Array
    """(3,) median position error of the real IMU after 1, 2 and 5 s [m]."""
    simulated_drift: Array
    """(3,) the twin's."""
    told_apart: float
    """Share of windows of half a second that a classifier assigns right; 0.5: it cannot."""
    flown: tuple[Flown, Flown]
    """The real readings, and those of the first twin."""

    def __repr__(self) -> str:
        worst = float(np.nanmax(np.abs(self.decibels)))
        drift = 100.0 * float(np.nanmax(np.abs(self.simulated_drift / self.real_drift - 1.0)))
        return (
            f"<Check over {self.seconds:.3g} s: densities within {worst:.2g} dB, drift within "
            f"{drift:.2g} %, told apart {100.0 * self.told_apart:.0f} %>"
        )

    def as_json(self) -> dict[str, Any]:
        """Return the numbers by name; null where there is none."""
        return {
            "seconds": self.seconds,
            "bands_hz": [list(band) for band in comparison.BANDS],
            "real_density": _plain(self.real),
            "simulated_density": _plain(self.simulated),
            "decibels": _plain(self.decibels),
            "windows_s": list(WINDOWS),
            "real_drift_m": _plain(self.real_drift),
            "simulated_drift_m": _plain(self.simulated_drift),
            "told_apart": self.told_apart,
        }


def _plain(values: Array) -> Any:
    return np.where(np.isfinite(values), values.astype(object), None).tolist()  # type: ignore[call-overload]


def check(source: Recorded, part: Recording, fit: Fit, parameters: dict[str, Value]) -> Check:
    """Compare a twin with a part of the recording.

    The truth's clock is laid on this part again: where it wanders, that is not the sensor's doing.
    Nothing else is fitted.
    """
    real = _real(source, part, fit)
    parts = _parts(source, real.t, part)
    rate = part.rate
    twins = [_simulated(source, real.t, fit.errors, parameters, seed) for seed in range(SEEDS)]
    flown = [slice(0, len(twins[0].t))]
    levels = comparison.levels(real.residuals, parts, rate)
    others = [comparison.levels(twin.residuals, flown, rate) for twin in twins]
    simulated = np.sqrt(np.mean(np.square(others), axis=0))
    seen = comparison.features(real.residuals, parts, rate)
    shares = [
        comparison.told_apart(seen, comparison.features(twin.residuals, flown, rate), seed)
        for seed, twin in enumerate(twins)
    ]
    drifts = [_drift(source, twin, fit.errors) for twin in twins]
    return Check(
        float(real.t[-1] - real.t[0]),
        levels,
        simulated,
        comparison.decibels(simulated, levels),
        _median(_drift(source, real, fit.errors)),
        np.array([_median([np.concatenate(d) for d in zip(*drifts, strict=True)])])[0],
        float(np.mean(shares)),
        (real, twins[0]),
    )


def _median(errors: list[Array]) -> Array:
    return np.array([np.median(e) if len(e) else np.nan for e in errors])


def _real(source: Recorded, part: Recording, fit: Fit) -> Flown:
    course = np.zeros(len(part.stamps))
    for _ in range(_ALIGNMENTS):
        t = model.true_times(fit.errors, part.stamps, fit.reference, course)
        residuals = part.readings - model.readings(fit.errors, source.body_motion(t))
        slope = model.slope_at(fit.errors, source.body_motion, t)
        course = course + clock.wander(part.stamps, residuals, slope, part.rate, steady=False)
    t = model.true_times(fit.errors, part.stamps, fit.reference, course)
    residuals = part.readings - model.readings(fit.errors, source.body_motion(t))
    return Flown(t, part.readings, residuals)


def _parts(source: Recorded, t: Array, part: Recording) -> list[slice]:
    """Return the rows in motion, piece by piece."""
    rows = moving(source.motion(t))
    result = []
    for piece in part.pieces:
        there = np.flatnonzero(rows[piece])
        if len(there):
            result.append(slice(piece.start + int(there[0]), piece.start + int(there[-1]) + 1))
    return result or list(part.pieces)


def simulation(source: Recorded, parameters: dict[str, Value], seed: int) -> Simulation:
    """Return the twin's simulation on the truth's own motion."""
    own: dict[str, object] = {
        **parameters,
        "seed": seed,
        "start_time": 1.0,
        "trajectory.type": "poses",
        "trajectory.file": source.name,
        "gravity": [0.0, 0.0, -source.gravity],
    }
    return Simulation(load_simulation(own), trajectory=source.trajectory)


def _simulated(
    source: Recorded, t: Array, errors: Errors, parameters: dict[str, Value], seed: int
) -> Flown:
    """Return the twin's readings over the times of the real ones."""
    engine = simulation(source, parameters, seed)
    blocks = list(engine.blocks())
    true = np.concatenate([b.true_t_ns for b in blocks])
    times = timebase.seconds_since(true, engine.t0_ns)
    inside = (times >= t[0]) & (times <= t[-1])
    readings = np.concatenate(
        [np.concatenate([getattr(b, name) for b in blocks]) for name in ("gyro", "accel")], axis=1
    )[inside]
    times = times[inside]
    residuals = readings - model.readings(errors, source.body_motion(times))
    return Flown(times, readings, residuals)


def _drift(source: Recorded, flown: Flown, errors: Errors) -> list[Array]:
    """Return the position errors [m] after each length of window, from the true state."""
    motion = _imu_motion(source, flown.t, errors)
    t_ns = np.round(flown.t * 1e9).astype(np.int64)
    x = flown.readings - errors.bias
    result = []
    for length in WINDOWS:
        found = []
        for start in np.arange(flown.t[0], flown.t[-1] - length, _EVERY):
            first, last = np.searchsorted(flown.t, [start, start + length])
            rows = slice(first, last + 1)
            if flown.t[last] - flown.t[first] > length + 0.1:
                continue
            state = NavigationState(
                motion.position[first], motion.velocity[first], motion.q_wb[first]
            )
            track = dead_reckon(
                t_ns[rows], x[rows, :3], x[rows, 3:], state, gravity=(0.0, 0.0, -source.gravity)
            )
            found.append(float(np.linalg.norm(track.position[-1] - motion.position[last])))
        result.append(np.array(found))
    return result


def _imu_motion(source: Recorded, t: Array, errors: Errors) -> Motion:
    """Return the motion of the IMU itself, at its lever arm and in its mounting."""
    motion = source.motion(t)
    arm = errors.lever_arm
    sweep = np.cross(motion.angular_velocity, arm)
    q_bi = rotation.from_matrix(errors.r_ib.T)
    return motion._replace(
        position=motion.position + rotation.rotate(motion.q_wb, arm),
        velocity=motion.velocity + rotation.rotate(motion.q_wb, sweep),
        q_wb=rotation.multiply(motion.q_wb, q_bi),
    )


def flown_again(
    source: Recorded, fit: Fit, parameters: dict[str, Value], seed: int
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return times and residuals of the part that was fitted, and those of a twin on it."""
    rows = len(fit.residuals)
    stamps = source.recording.stamps[:rows]
    t = model.true_times(fit.errors, stamps, fit.reference, fit.wander)
    twin = _simulated(source, t, fit.errors, parameters, seed)
    return (t, fit.residuals), (twin.t, twin.residuals)
