# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings about the temperatures beside readings: their unit."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.conventions import ABSOLUTE_ZERO, FAHRENHEIT
from imu_sim_ros.core.types import Array
from imu_sim_ros.recordings.findings.finding import Evidence, check

_LOWEST: Final = -90.0
"""Lowest temperature of a sensor, below that of chambers and of the ground [degC]."""
_HOTTEST: Final = 200.0
"""Highest temperature of a sensor, above that which silicon survives for long [degC]."""
_SPECIFIED: Final = 85.0
"""Highest temperature for which most IMUs are specified [degC]."""
_UNITS: Final = (
    ("Kelvin", 1.0, ABSOLUTE_ZERO),
    ("Fahrenheit", *FAHRENHEIT),
    ("millidegrees", 1e-3, 0.0),
    ("millikelvin", 1e-3, ABSOLUTE_ZERO),
)
"""Units that temperatures may have by mistake: name, size [K], and the unit's zero [degC]."""


class TemperatureRecord(NamedTuple):
    """Temperatures of a sensor."""

    source: str
    """Name of the file, topic or sensor."""
    temperature: Array
    """(n,) temperatures [degC], if their unit is right; NaN: none."""

    @property
    def extremes(self) -> tuple[float, float]:
        """The lowest and the highest temperature; NaN if there is none."""
        stated = self.temperature[np.isfinite(self.temperature)]
        return (float(stated.min()), float(stated.max())) if len(stated) else (np.nan, np.nan)

    def fits(self, scale: float, zero: float) -> bool:
        """Return True if a sensor can have these temperatures in a unit."""
        low, high = self.extremes
        return not (low * scale + zero < _LOWEST or high * scale + zero > _HOTTEST)


@check(
    "error",
    "coefficients of the temperature are those of another unit",
    "convert them to degC, or name their unit in the header: temperature [K]",
)
def temperature_unit(record: TemperatureRecord) -> Iterator[Evidence]:
    """Find temperatures that no sensor has in degC: Kelvin, millidegrees, counts."""
    if record.fits(1.0, 0.0):
        return
    unit = next((name for name, scale, zero in _UNITS if record.fits(scale, zero)), None)
    guess = "" if unit is None else f", as in {unit}"
    low, high = record.extremes
    yield Evidence(
        f"temperatures from {low:.6g} to {high:.6g}{guess}: degC are needed, from {_LOWEST:g} to "
        f"{_HOTTEST:g}"
    )


@check(
    "warning",
    "coefficients of the temperature are wrong by 1.8 if they are in Fahrenheit",
    "if these are in Fahrenheit, convert them, or name their unit in the header",
)
def temperature_fahrenheit(record: TemperatureRecord) -> Iterator[Evidence]:
    """Find temperatures above what sensors are specified for, which may be in Fahrenheit."""
    low, high = record.extremes
    size, zero = FAHRENHEIT
    if record.fits(1.0, 0.0) and high > _SPECIFIED:
        yield Evidence(
            f"temperatures from {low:.6g} to {high:.6g} degC: most IMUs are specified up to "
            f"{_SPECIFIED:g} degC; in Fahrenheit they are "
            f"{low * size + zero:.4g} to {high * size + zero:.4g} degC"
        )


TEMPERATURES: Final = (temperature_unit, temperature_fahrenheit)
"""Checks of temperatures."""
