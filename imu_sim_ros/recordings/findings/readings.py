# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings about the readings of an IMU: units, gravity, axes, triads, and single axes."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from imu_sim_ros.core.conventions import AXES, STANDARD_GRAVITY, TRIADS
from imu_sim_ros.core.types import Array, Integers
from imu_sim_ros.recordings.findings.finding import Evidence, check
from imu_sim_ros.recordings.findings.measures import (
    COHERENT,
    ROUNDING,
    SHORTEST,
    SLOW,
    ReadingMeasures,
    is_gravity_in_g,
)

_LOWEST_MG: Final = 800.0
_HIGHEST_MG: Final = 1250.0
"""Limits of gravity in mg."""
_COUNTS: Final = 30.0
"""Gravity above which the readings are no m/s^2: accelerations that remain over ten seconds would
have to change the velocity by 200 m/s."""
_ABSENT: Final = 0.5
"""Share of gravity below which it is absent: over ten seconds the velocity would have to change by
49 m/s."""
_SIZE: Final = 0.25
"""Share by which gravity at rest may be off: three standard deviations of the zero offset of the
cheapest sensors (bno055, bmi055: 80 mg)."""
_SCALE: Final = 0.05
"""Share by which the size of gravity may be off in several attitudes, which tell it apart from a
bias: 3.7 standard deviations of the largest scale error (phone: 1.3 %)."""
_UPWARDS: Final = 0.9
"""Share of gravity on an axis from which on it is upwards or downwards throughout."""
_SATURATED: Final = 1e-4
"""Share of the readings of an axis at the same extreme value."""
_PILE: Final = 4
"""Readings at the end of a range over those at the value next to it: in noise there are fewer."""
_COARSE: Final = 4.0
"""Step of an axis, in standard deviations of the noise of the others, from which on it hides it."""
_CODES: Final = 8
"""Different values from which on an axis is resolved."""
_ENOUGH: Final = 1000
"""Readings from which on single axes are judged."""


@check(
    "error",
    "nothing can be integrated or analysed for it",
    "name the topic of the gyroscope ({gyro_topic}), or take another one",
)
def gyroscope_absent(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find readings without a gyroscope."""
    yield from _absent(measures, 0)


@check(
    "error",
    "nothing can be integrated or analysed for it",
    "name the topic of the accelerometer ({accel_topic}), or take another one",
)
def accelerometer_absent(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find readings without an accelerometer."""
    yield from _absent(measures, 1)


def _absent(measures: ReadingMeasures, triad: int) -> Iterator[Evidence]:
    """Find a triad without readings."""
    readings = measures.readings
    if (readings.accel if triad else readings.gyro) is None:
        yield Evidence(f"contains no readings of the {TRIADS[triad]}")


@check(
    "error",
    "there is no rate, so nothing can be integrated or analysed",
    "record stamps; the program that wrote the file left them out",
)
def stamps_equal(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find readings that all have the same stamp."""
    t_ns = measures.readings.t_ns
    if len(t_ns) > 1 and t_ns[0] == t_ns[-1] and np.all(t_ns == t_ns[0]):
        yield Evidence(f"all {len(t_ns):,} stamps are {t_ns[0]} ns")


@check(
    "error",
    "motion of this triad is missing in all results",
    "name the topic of the triad ({gyro_topic}, {accel_topic}), or take another one",
)
def triad_zeros(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find a gyroscope or an accelerometer whose readings are all zeros."""
    triads = (measures.readings.gyro, measures.readings.accel)
    for name, values, partner in zip(TRIADS, triads, triads[::-1], strict=True):
        # An ideal sensor at rest reads zeros, too, but its partner has no noise.
        if values is None or partner is None or values.any():
            continue
        if any(measures.noisy(column) for column in partner.T):
            yield Evidence(f"all readings of the {name} are 0")


@check(
    "error",
    "angular rates are integrated as forces, and the other way round",
    "exchange the columns or topics of the triads",
)
def triads_swapped(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find a gyroscope and an accelerometer that are swapped."""
    gravity = measures.swapped
    if gravity is not None:
        yield Evidence(
            f"the gyroscope reads {gravity.size:.4g} in a direction that stays, the accelerometer "
            f"{measures.mean_force:.3g} on average"
        )


def _level(measures: ReadingMeasures) -> tuple[float, str, bool]:
    """Return the size of gravity in the readings, where it is taken from, and if it is certain."""
    if measures.rest_force is not None:
        return measures.rest_force, "at rest the accelerometer reads", True
    counts = measures.rate_unit.name == "counts"
    if measures.values is None or measures.duration < SHORTEST or counts:
        return 0.0, "", False
    gravity = measures.slow_gravity
    text = "in motion the specific force is on average, in axes that do not turn,"
    return gravity.size, text, gravity.coherence > COHERENT


@check(
    "error",
    "motion and noise are 9.8 times too small",
    "{accel_unit g} converts it; or multiply by 9.80665",
)
def accelerometer_g(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find an accelerometer in g, at rest or in motion."""
    size, text, certain = _level(measures)
    if certain and is_gravity_in_g(size):
        yield Evidence(f"{text} {size:.4g} instead of 9.81: it is in g")


@check(
    "error",
    "motion and noise are 102 times too large",
    "{accel_unit mg} converts it; or multiply by 0.00980665",
)
def accelerometer_mg(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find an accelerometer in mg, at rest or in motion."""
    size, text, certain = _level(measures)
    if certain and _LOWEST_MG <= size <= _HIGHEST_MG:
        yield Evidence(f"{text} {size:.4g} instead of 9.81: it is in mg")


@check(
    "error",
    "motion and noise have a wrong size",
    "multiply by 9.80665 / (counts of 1 g), which the data sheet has",
)
def accelerometer_counts(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find an accelerometer in counts, at rest or in motion."""
    size, text, certain = _level(measures)
    if certain and size > _COUNTS and not _LOWEST_MG <= size <= _HIGHEST_MG:
        yield Evidence(f"{text} {size:.5g} instead of 9.81: it is in counts")


@check(
    "error",
    "a consumer that takes gravity away finds a fall of 9.8 m/s^2",
    "parameter input.gravity=missing adds it (add_errors, error_model); else record the specific "
    "force",
)
def gravity_absent(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find an accelerometer whose readings do not have gravity."""
    if measures.values is None or measures.swapped is not None:
        return
    if any(accelerometer_absent.find(measures)) or any(triad_zeros.find(measures)):
        return
    limit = _ABSENT * STANDARD_GRAVITY
    size, text, certain = _level(measures)
    if certain and (size >= limit or is_gravity_in_g(size)):
        return
    falls = f"; a free fall of {measures.duration:.3g} s would read the same"
    if measures.duration > SLOW and measures.mean_force < limit:
        yield Evidence(f"the specific force is {measures.mean_force:.3g} m/s^2 on average{falls}")
    elif certain and measures.mean_force >= 0.01 and size < limit and measures.duration > SLOW:
        yield Evidence(f"{text} {size:.3g} m/s^2{falls}")


@check(
    "warning",
    "the accelerometer's bias or scale takes up the difference",
    "set gravity to that of the place, check the unit, and calibrate the sensor",
)
def gravity_size(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find an accelerometer at rest whose readings do not have the size of gravity."""
    gravity, sphere = measures.local_gravity, measures.rest_sphere
    if sphere is None:  # one attitude: a bias cannot be told from a scale
        size, tolerance = measures.rest_force, _SIZE
    else:
        size, tolerance = sphere.radius, _SCALE
    if size is None or not _ABSENT * gravity <= size <= _COUNTS:
        return  # gravity is absent, or the unit is another one: findings of their own
    if abs(size - gravity) > tolerance * gravity:
        reading = f"the accelerometer reads {size:.4g} m/s^2 instead of {gravity:.3g}"
        if sphere is None:
            yield Evidence(f"at rest {reading}")
        else:
            bias = f"around a bias of {sphere.bias:.2g}"
            yield Evidence(f"in all attitudes at rest {reading}, {bias}")


def _upwards(measures: ReadingMeasures) -> Array | None:
    """Return the direction (3,) that is upwards in the readings' axes throughout; None: none is."""
    if measures.values is None or measures.duration < SHORTEST:
        return None
    size, _, certain = _level(measures)
    absent = size < _ABSENT * STANDARD_GRAVITY and not is_gravity_in_g(size)
    if not certain or absent or not measures.mean_force:
        return None
    direction: Array = measures.values[1].mean(axis=0) / measures.mean_force
    return direction if np.abs(direction).max() > _UPWARDS else None


@check(
    "warning",
    "a consumer that expects forward-left-up sees a body upside down",
    "parameter input.axes=frd (add_errors, error_model) or the mounting, if the axes are "
    "forward-right-down; change the sign of the accelerometer, if it measures gravity downwards",
)
def axes_down(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find axes that are forward-right-down, or gravity of the wrong sign."""
    upwards = _upwards(measures)
    if upwards is not None and upwards[2] < -_UPWARDS:
        yield Evidence(f"upwards is {_vector(upwards)} of the readings throughout")


@check(
    "warning",
    "a consumer that expects forward-left-up sees a body on its side",
    "state the rotation of the sensor as its mounting (for a camera's axes: x right, y down)",
)
def axes_sideways(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find axes of which x or y is upwards, as those of a camera."""
    upwards = _upwards(measures)
    if upwards is not None and np.abs(upwards[:2]).max() > _UPWARDS:
        yield Evidence(f"upwards is {_vector(upwards)} of the readings throughout")


def _vector(values: Array) -> str:
    """Return a vector as text."""
    return "[" + ", ".join(f"{value:.2f}" for value in values) + "]"


@check(
    "error",
    "attitude turns 57 times too fast",
    "{gyro_unit deg/s} converts it; or multiply by pi / 180",
)
def gyroscope_degrees(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find a gyroscope in deg/s, at rest by its noise, in motion by the turn of gravity."""
    if measures.rate_unit.name == "deg/s":
        yield Evidence(measures.rate_unit.text)


@check(
    "error",
    "attitude turns by a wrong angle",
    "multiply by the data sheet's sensitivity, and by pi / 180 if that is in deg/s",
)
def gyroscope_counts(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find a gyroscope in counts."""
    if measures.rate_unit.name == "counts":
        yield Evidence(measures.rate_unit.text)


@check(
    "error",
    "the axis measures nothing",
    "repair the sensor or its driver; nothing can be computed from this axis",
)
def axis_stuck(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find an axis whose readings stop changing while the others have noise."""
    for triad, values in _triads(measures):
        if len(values) < _ENOUGH:
            continue
        constant = [_unchanged_tail(column) for column in values.T]
        for axis, length in enumerate(constant):
            partners = [values[-length:, k] for k in range(3) if k != axis]
            stays = length >= _ENOUGH and all(
                measures.noisy(column) and len(np.unique(column[:_ENOUGH])) > _CODES
                for column in partners
            )
            if stays:
                row = len(values) - length
                name = f"{triad} {AXES[axis]}"
                yield Evidence(f"{name} stays at {values[-1, axis]:.5g}", row, length)


def _unchanged_tail(column: Array) -> int:
    """Return how many readings at the end of an axis (n,) are equal."""
    changes = np.flatnonzero(column[1:] != column[:-1])
    return len(column) - (int(changes[-1]) + 1 if len(changes) else 0)


def _triads(measures: ReadingMeasures) -> Iterator[tuple[str, Array]]:
    """Yield name and values (n, 3) of the triads with readings."""
    for name, values in zip(TRIADS, (measures.readings.gyro, measures.readings.accel), strict=True):
        if values is not None:
            yield name, values


@check(
    "warning",
    "motion beyond the range is not measured",
    "choose a larger range of the sensor",
)
def axis_saturated(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find an axis whose readings pile up at the end of its range."""
    for triad, values in _triads(measures):
        if len(values) < _ENOUGH:
            continue
        for axis, column in enumerate(values.T):
            codes, counts = _codes(column)
            if len(codes) <= _CODES or not measures.noisy(column):
                continue
            # Steps that noise does not cross pile readings up wherever a motion stays.
            if _white(column) < 0.5 * float(np.diff(codes).min()):
                continue
            for end, neighbour in ((0, 1), (-1, -2)):
                often = counts[end] > max(10, _SATURATED * len(column))
                pile = counts[end] > _PILE * counts[neighbour]
                if often and pile:
                    row = int(np.flatnonzero(np.isclose(column, codes[end], rtol=ROUNDING))[0])
                    name = f"{triad} {AXES[axis]}"
                    number = int(counts[end])
                    yield Evidence(f"{name} reads {codes[end]:.5g} {number:,} times", row, number)


def _codes(column: Array) -> tuple[Array, Integers]:
    """Return the different values (k,) of an axis (n,), but for rounding, and their numbers."""
    codes, counts = np.unique(column, return_counts=True)
    steps = np.diff(codes) > ROUNDING * np.abs(codes).max()
    starts = np.flatnonzero(np.append(True, steps))
    return codes[starts], np.add.reduceat(counts, starts)


@check(
    "note",
    "noise that is smaller than a step is not in the readings",
    "choose a smaller range of the sensor, or more digits of the file",
)
def steps_coarse(measures: ReadingMeasures) -> Iterator[Evidence]:
    """Find an axis whose digital steps are larger than its signal."""
    for triad, values in _triads(measures):
        if len(values) < _ENOUGH:
            continue
        codes = [_codes(column)[0] for column in values.T]
        # Axes of one triad have the same noise: those that resolve it tell its size.
        noise = [
            _white(column)
            for column, levels in zip(values.T, codes, strict=True)
            if len(levels) > 2
        ]
        limit = _COARSE * float(np.median(noise)) if noise else 0.0
        for axis, (column, levels) in enumerate(zip(values.T, codes, strict=True)):
            if len(levels) == 2 and measures.noisy(column) and levels[1] - levels[0] > limit:
                step = float(levels[1] - levels[0])
                yield Evidence(f"{triad} {AXES[axis]} has two values, {step:.3g} apart")


def _white(column: Array) -> float:
    """Return the standard deviation of white noise in an axis (n,), by fourth differences."""
    return float(np.sqrt(np.mean(np.square(np.diff(column, 4))) / 70.0))


READINGS: Final = (
    gyroscope_absent,
    accelerometer_absent,
    stamps_equal,
    triad_zeros,
    triads_swapped,
    accelerometer_g,
    accelerometer_mg,
    accelerometer_counts,
    gyroscope_degrees,
    gyroscope_counts,
    gravity_absent,
    gravity_size,
    axes_down,
    axes_sideways,
    axis_stuck,
    axis_saturated,
    steps_coarse,
)
"""Checks of the readings of an IMU."""
ABSENCE_CHECKS: Final = (gyroscope_absent, accelerometer_absent)
"""Checks of readings without one of the triads."""
UNIT_CHECKS: Final = (
    *(triads_swapped, accelerometer_g, accelerometer_mg, accelerometer_counts),
    *(gyroscope_degrees, gyroscope_counts),
)
"""Checks of faults after which every number of the readings is wrong."""
UNITS: Final = tuple(fault.kind for fault in UNIT_CHECKS)
"""Kinds of these findings."""
