# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the vehicle's vibration as one board reads it; ``twin`` finds them."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.config.parameter import Vector, number, numbers, vector

AXES_READ = 6
"""Gyroscope x, y, z, accelerometer x, y, z."""
PAIRS = 15
"""Of six axes: gx gy, gx gz, gx ax, ..., ay az."""
ROUNDING = 0.01
"""By how much rounded coherence may miss the nearest possible one (the least eigenvalue)."""


@dataclass(frozen=True)
class BoardVibrationParameters:
    """Vibration of the vehicle in the readings: lines and bands, coherent between the six axes.

    Six numbers are gyroscope x, y, z and accelerometer x, y, z.
    """

    line_frequency: tuple[float, ...] = numbers(
        (),
        "frequency of each sinusoid; those from half the rate on are left out",
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
        "upper end of each band; what lies above half the rate is left out",
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
        "frequencies that separate ranges; in each the intensity follows the motion in its own "
        "way; none: one range",
        unit="Hz",
        minimum=0.0,
        above_minimum=True,
    )
    gyroscope_exponents: tuple[float, ...] = numbers(
        (),
        "three exponents for each range, of the body's rate, acceleration and speed: the "
        "gyroscope's vibration follows them to these powers; none: all 0",
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
    motion_time: float = number(
        1.0,
        "time constant of the averages of squared rate, acceleration and speed",
        unit="s",
        minimum=0.0,
        above_minimum=True,
        maximum=1000.0,
    )

    @property
    def there(self) -> bool:
        """Whether there is any vibration."""
        return any(self.line_amplitude) or any(self.band_density)

    @property
    def ranges(self) -> int:
        """Number of ranges."""
        return len(self.range_edges) + 1

    def coherence(self) -> NDArray[np.complex128]:
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
        for name, count, each in (
            ("line_amplitude", AXES_READ * lines, "six for each line"),
            ("band_high", bands, "one for each band"),
            ("band_density", AXES_READ * bands, "six for each band"),
        ):
            if len(getattr(self, name)) != count:
                yield f"{prefix}{name}: {len(getattr(self, name))} entries; must be {count}, {each}"
        for name, count, each in (
            ("line_phase", AXES_READ * lines, "six for each line"),
            ("band_coherence", 2 * PAIRS * bands, "30 for each band"),
            ("gyroscope_exponents", 3 * self.ranges, "three for each range"),
            ("accelerometer_exponents", 3 * self.ranges, "three for each range"),
        ):
            if len(getattr(self, name)) not in (0, count):
                yield (
                    f"{prefix}{name}: {len(getattr(self, name))} entries; must be 0 or {count}, "
                    f"{each}"
                )
        yield from self._band_problems(prefix)
        if any(after <= before for before, after in pairwise(self.range_edges)):
            yield f"{prefix}range_edges = {list(self.range_edges)}: must increase"

    def _band_problems(self, prefix: str) -> Iterator[str]:
        """Say which bands have no width, overlap, or have an impossible coherence."""
        if len(self.band_coherence) == 2 * PAIRS * len(self.band_low) > 0:
            least = np.linalg.eigvalsh(self.coherence())[:, 0]
            for k in np.flatnonzero(least < -ROUNDING):
                yield (
                    f"{prefix}band_coherence: band {k + 1}, from {self.band_low[k]:g} Hz: its "
                    f"matrix must be positive semidefinite; the least eigenvalue is {least[k]:.2g}"
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
