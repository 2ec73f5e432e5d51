# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the IMU: the triads' errors, mounting, timing, the vehicle's vibration, presets."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any, Final

import numpy as np

from imu_sim_ros.core import timebase
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.types import Complex
from imu_sim_ros.parameters.kinds import (
    IDENTITY_MATRIX,
    ZERO_MATRIX,
    Matrix,
    Vector,
    choice,
    integer,
    matrix,
    number,
    numbers,
    text,
    vector,
)
from imu_sim_ros.parameters.sections import common_sections, section
from imu_sim_ros.sensors import sensors_of_imus
from imu_sim_ros.sensors.imu.triads import TriadsParameters
from imu_sim_ros.sensors.parameters import (
    LONGEST,
    MountedParameters,
    RatedParameters,
    TimingParameters,
    rotation_problems,
)

DEFAULT_IMU: Final = "lecture"
AXES_READ = 6
"""Gyroscope x, y, z, accelerometer x, y, z."""
PAIRS = 15
"""Number of pairs of six axes: gx gy, gx gz, gx ax, ..., ay az."""
ROUNDING = 0.01
"""Tolerance of the least eigenvalue of a rounded coherence matrix, which may be negative."""


@dataclass(frozen=True)
class BoardVibrationParameters:
    """Vibration of the vehicle in the readings: lines and bands, coherent between the six axes.

    Six numbers are gyroscope x, y, z and accelerometer x, y, z.
    """

    line_frequency: tuple[float, ...] = numbers(
        (),
        "frequency of each sinusoid; those at or above half the rate are left out",
        unit="Hz",
        minimum=0.0,
        above_minimum=True,
    )
    line_amplitude: tuple[float, ...] = numbers(
        (),
        "six amplitudes of each sinusoid, gyroscope x y z and accelerometer x y z",
        unit="rad/s, m/s^2",
        group=AXES_READ,
        minimum=0.0,
    )
    line_phase: tuple[float, ...] = numbers(
        (),
        "six phases of each sinusoid; one more, common to the six, is drawn from the seed; "
        "none: all 0",
        unit="rad",
        group=AXES_READ,
    )
    band_low: tuple[float, ...] = numbers(
        (), "lower end of each band of noise", unit="Hz", minimum=0.0
    )
    band_high: tuple[float, ...] = numbers(
        (),
        "upper end of each band; the part above half the rate is left out",
        unit="Hz",
        minimum=0.0,
        above_minimum=True,
    )
    band_density: tuple[float, ...] = numbers(
        (),
        "six two-sided densities of each band, gyroscope x y z and accelerometer x y z",
        unit="rad/s/sqrt(Hz), m/s^2/sqrt(Hz)",
        group=AXES_READ,
        minimum=0.0,
    )
    band_coherence: tuple[float, ...] = numbers(
        (),
        "complex coherence of the 15 pairs of axes in each band, gx gy, gx gz, gx ax, ..., ay az: "
        "real and imaginary part in turn; none: the axes are independent",
        unit="1",
        group=2 * PAIRS,
        minimum=-1.0,
        maximum=1.0,
    )
    range_edges: tuple[float, ...] = numbers(
        (),
        "frequencies that separate ranges, in each of which the intensity depends on the motion "
        "in its own way; none: one range",
        unit="Hz",
        minimum=0.0,
        above_minimum=True,
    )
    gyroscope_exponents: tuple[float, ...] = numbers(
        (),
        "three exponents for each range: the powers of the body's rate, acceleration and speed "
        "that the gyroscope's vibration follows; none: all 0",
        unit="1",
        group=3,
        minimum=-4.0,
        maximum=4.0,
    )
    accelerometer_exponents: tuple[float, ...] = numbers(
        (), "the same for the accelerometer", unit="1", group=3, minimum=-4.0, maximum=4.0
    )
    reference_motion: Vector = vector(
        1.0,
        "rate, acceleration and speed (RMS) at which the vibration has the given size",
        unit="rad/s, m/s^2, m/s",
        minimum=0.0,
        above_minimum=True,
    )
    motion_floor: float = number(
        0.2,
        "share of the reference that is added to rate, acceleration and speed, as squares: the "
        "vibration that remains without motion",
        unit="1",
        minimum=0.01,
        maximum=10.0,
    )
    motion_ceiling: Vector = vector(
        0.0,
        "multiple of the reference above which rate, acceleration and speed no longer increase "
        "the vibration; 0: no limit",
        unit="1",
        minimum=0.0,
    )
    motion_time: float = number(
        1.0,
        "time constant of the averages of squared rate, acceleration and speed",
        unit="s",
        minimum=0.0,
        above_minimum=True,
        maximum=1000.0,
    )

    @property
    def is_present(self) -> bool:
        """True if there is any vibration."""
        return any(self.line_amplitude) or any(self.band_density)

    @property
    def ranges(self) -> int:
        """Number of ranges."""
        return len(self.range_edges) + 1

    def coherence(self) -> Complex:
        """Return the Hermitian matrices (bands, 6, 6) of coherence between the axes."""
        result = np.zeros((len(self.band_low), AXES_READ, AXES_READ), dtype=np.complex128)
        result[:, range(AXES_READ), range(AXES_READ)] = 1.0
        if self.band_coherence:
            parts = np.reshape(self.band_coherence, (len(result), PAIRS, 2))
            i, j = np.triu_indices(AXES_READ, 1)
            result[:, i, j] = parts[..., 0] + 1j * parts[..., 1]
            result[:, j, i] = parts[..., 0] - 1j * parts[..., 1]
        return result

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each list that does not match, and for each impossible band."""
        lines, bands = len(self.line_frequency), len(self.band_low)
        for name, entries, count, rule in (
            ("line_amplitude", self.line_amplitude, AXES_READ * lines, "six for each line"),
            ("band_high", self.band_high, bands, "one for each band"),
            ("band_density", self.band_density, AXES_READ * bands, "six for each band"),
        ):
            if len(entries) != count:
                yield f"{prefix}{name}: {len(entries)} entries; must be {count}, {rule}"
        exponents, ranges = "three for each range", 3 * self.ranges
        for name, entries, count, rule in (
            ("line_phase", self.line_phase, AXES_READ * lines, "six for each line"),
            ("band_coherence", self.band_coherence, 2 * PAIRS * bands, "30 for each band"),
            ("gyroscope_exponents", self.gyroscope_exponents, ranges, exponents),
            ("accelerometer_exponents", self.accelerometer_exponents, ranges, exponents),
        ):
            if len(entries) not in (0, count):
                yield f"{prefix}{name}: {len(entries)} entries; must be 0 or {count}, {rule}"
        if len(self.band_coherence) == 2 * PAIRS * len(self.band_low) > 0:
            smallest = np.linalg.eigvalsh(self.coherence())[:, 0]
            for k in np.flatnonzero(smallest < -ROUNDING):
                yield (
                    f"{prefix}band_coherence: band {k + 1}, from {self.band_low[k]:g} Hz: its "
                    "matrix must be positive semidefinite; the least eigenvalue is "
                    f"{smallest[k]:.2g}"
                )
        for low, high in zip(self.band_low, self.band_high, strict=False):
            if high <= low:
                yield f"{prefix}band_high = {high:g}: must be above band_low, {low:g} Hz"
        for (low, high), following in zip(
            zip(self.band_low, self.band_high, strict=False), self.band_low[1:], strict=False
        ):
            if low < high and following < high:
                yield (
                    f"{prefix}band_low = {following:g}: must be at least {high:g} Hz, where the "
                    "band before ends"
                )
        if any(upper <= lower for lower, upper in pairwise(self.range_edges)):
            yield f"{prefix}range_edges = {list(self.range_edges)}: must increase"


_USUAL_RATIO = 8
"""Readings inside a sensor for each sample."""

_CAUSES = {"stress_step_sigma": "stress_step_rate", "shock_bias_sigma": "shock_threshold"}
"""Errors of a triad, and the parameter of the board that makes them happen."""


@dataclass(frozen=True)
class BoardParameters:
    """Parameters common to the triads of a board: its age, its shocks, where its elements sit."""

    accelerometer_positions: Matrix = matrix(
        ZERO_MATRIX,
        "positions in the IMU's frame of the x, the y and the z accelerometer, one after the "
        "other (size effect)",
        unit="m",
    )
    age_days: float = number(
        0.0,
        "days from the IMU's calibration to the start of the run, for ageing_bias and ageing_scale",
        unit="day",
        minimum=0.0,
        maximum=100000.0,
    )
    hysteresis_temperature: float = number(
        5.0,
        "change of temperature over which the hysteresis goes 63 % of the way to its other branch",
        unit="K",
        minimum=0.0,
        above_minimum=True,
    )
    stress_step_rate: float = number(
        0.0,
        "mean rate at which stress in the board is relieved; each time all biases jump by "
        "stress_step_sigma",
        unit="1/s",
        minimum=0.0,
        maximum=10.0,
    )
    shock_threshold: float = number(
        0.0,
        "specific force above which a shock leaves a bias of shock_bias_sigma; 0: no shocks",
        unit="m/s^2",
        minimum=0.0,
    )
    shock_recovery_time: float = number(
        0.0,
        "time constant with which the bias left by a shock decays; 0: it stays",
        unit="s",
        minimum=0.0,
        maximum=LONGEST,
    )


MOUNT: Final = ("imu.lever_arm", "imu.mounting")
"""The parameters of the IMU's mount in the body, by dotted name."""


@dataclass(frozen=True)
class ImuParameters(MountedParameters, TimingParameters, BoardParameters, TriadsParameters):
    """One IMU, with a section for each sensor that belongs to it."""

    preset: str = text("lecture", "file in config/imus, or a path, to start from")
    sampling: str = choice(
        "instantaneous",
        ("instantaneous", "averaged", "oversampled"),
        "instantaneous: the value at the sample's time; averaged: the mean since the previous "
        "sample; oversampled: every m-th reading inside the sensor, after its low-pass (with "
        "aliasing and rectification)",
    )
    internal_rate: float = number(
        0.0,
        "readings per second inside a sensor whose sampling is oversampled, an integer multiple of "
        "`rate`; errors, noise and low-pass act at this rate; 0: 8 times `rate`",
        unit="Hz",
        minimum=0.0,
        maximum=1e6,
    )
    lever_arm: Vector = vector(0.0, "position of the IMU in the body frame, p_bi", unit="m")
    mounting: Matrix = matrix(IDENTITY_MATRIX, "rotation R_bi of the IMU in the body")
    reference_temperature: float = number(
        25.0, "temperature T0 of the temperature polynomials", unit="degC", live=True
    )
    bandwidth_order: int = integer(
        2, "order of the low-pass filters (Butterworth)", minimum=1, maximum=8
    )
    vibration: BoardVibrationParameters = section(BoardVibrationParameters)
    sensors: Mapping[str, RatedParameters] = common_sections(
        lambda: {sensor.name: sensor.section for sensor in sensors_of_imus()}, joint="_"
    )
    """``imu.magnetometer`` is ``imu.sensors["magnetometer"]``."""

    def __getattr__(self, name: str) -> Any:
        """Return the section of another sensor."""
        sensors: Mapping[str, object] = self.__dict__.get("sensors", {})
        if name in sensors:
            return sensors[name]
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def internal_ratio(self, rate: float) -> Fraction:
        """Return how many readings inside the sensor make one sample.

        :param rate: samples per second [Hz].
        """
        if self.sampling != "oversampled":
            return Fraction(1)
        if self.internal_rate == 0.0:
            return Fraction(_USUAL_RATIO)
        return timebase.exact_rate(self.internal_rate) / timebase.exact_rate(rate)

    def low_pass(self, triad: str, rate: float) -> Vector:
        """Return the cut-offs of a triad's low-pass that have an effect [Hz]; 0: none.

        Readings have no frequencies from half their rate on, so a cut-off there changes nothing.

        :param rate: samples per second [Hz].
        """
        nyquist = 0.5 * rate * float(self.internal_ratio(rate))
        x, y, z = (f if f < nyquist else 0.0 for f in self.triad(triad).bandwidth)
        return (x, y, z)

    def delay(self, triad: str, rate: float) -> Vector:
        """Return by how much the readings of a triad lag behind slow motions, per axis [s].

        A low-pass of order n and cut-off f has, at low frequencies, the group delay
        ``1 / (2 pi f sin(pi / (2 n)))``, that of a Butterworth filter; after the bilinear transform
        at r readings per second, ``2 pi f`` is ``2 r tan(pi f / r)``. The mean over an interval
        lags by half of it.

        :param rate: samples per second [Hz].
        """
        internal = rate * float(self.internal_ratio(rate))
        order = math.sin(math.pi / (2.0 * self.bandwidth_order))
        mean = 0.5 / rate if self.sampling == "averaged" else 0.0
        x, y, z = (
            mean + (0.5 / (internal * math.tan(math.pi * f / internal) * order) if f else 0.0)
            for f in self.low_pass(triad, rate)
        )
        return (x, y, z)

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each contradiction between parameters."""
        yield from rotation_problems(self.mounting, f"{prefix}mounting")
        for triad in TRIADS:
            bandwidth = self.triad(triad).bandwidth
            if self.sampling == "oversampled" and min(bandwidth) == 0.0:
                yield (
                    f"{prefix}{triad}_bandwidth = {bandwidth}: must be above 0 Hz on every axis "
                    f"where {prefix}sampling is oversampled; it is the filter before decimation"
                )
            step = self.triad(triad).increment_resolution
            if any(step) and self.sampling != "averaged":
                yield (
                    f"{prefix}{triad}_increment_resolution = {step}: must be 0 if "
                    f"{prefix}sampling is not averaged; only averaged readings are increments"
                )
        for name, cause in _CAUSES.items():
            for triad in TRIADS:
                if any(getattr(self.triad(triad), name)) and not getattr(self, cause):
                    yield (
                        f"{prefix}{cause} = 0: must be above 0 where {prefix}{triad}_{name} is "
                        f"given; without it there is none"
                    )
        yield from super().problems(prefix)
