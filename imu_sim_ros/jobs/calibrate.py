# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Deterministic errors of an IMU from calibration runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros import arguments
from imu_sim_ros.arguments import number
from imu_sim_ros.calibration.deterministic import correction
from imu_sim_ros.calibration.deterministic.ellipsoid import calibrate_magnetometer as ellipsoid
from imu_sim_ros.calibration.deterministic.positions import calibrate_six_position as six_position
from imu_sim_ros.calibration.deterministic.steady import find_steady
from imu_sim_ros.calibration.deterministic.temperature import (
    calibrate_temperature as over_temperature,
)
from imu_sim_ros.calibration.deterministic.temperature import temperatures_at
from imu_sim_ros.calibration.deterministic.turntable import calibrate_turntable as turntable
from imu_sim_ros.calibration.deterministic.turntable import known_rates, specific_force, true_rates
from imu_sim_ros.conventions import GRAVITY, TRIADS
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs import gate
from imu_sim_ros.jobs.flight import Flight, readings_of
from imu_sim_ros.jobs.output import saved
from imu_sim_ros.jobs.readings import BAG_OR_FILE, Readings
from imu_sim_ros.types import Array

_STRONGEST: Final = math.nextafter(1.0, 0.0)
"""[T]"""


@dataclass(frozen=True, repr=False)
class Calibrated:
    """A parameter with its standard errors, flat as in a parameter file."""

    value: Array
    sigma: Array

    def __repr__(self) -> str:
        pairs = zip(self.value, self.sigma, strict=True)
        return "<" + ", ".join(f"{value:.4g} +- {sigma:.2g}" for value, sigma in pairs) + ">"


class TriadCalibration(dict[str, Calibrated]):
    """The calibrated parameters of one triad by name; each is an attribute as well."""

    def __getattr__(self, name: str) -> Calibrated:
        try:
            return self[name]
        except KeyError:
            known = ", ".join(self)
            raise AttributeError(
                f"{name}: this run does not determine it; it determines {known}"
            ) from None


@dataclass(frozen=True, repr=False)
class Calibration:
    """The result of a calibration run."""

    gyroscope: TriadCalibration
    accelerometer: TriadCalibration
    parameters: correction.Parameters
    magnetometer: TriadCalibration = field(default_factory=TriadCalibration)

    def __repr__(self) -> str:
        return f"<Calibration of {', '.join(self.parameters)}>"

    def save(self, path: str | Path, *, for_simulator: bool = False, force: bool = False) -> Path:
        """Write a parameter file; returns its path.

        :param for_simulator: the errors for ``simulator`` and ``generate``; else the correction for
            ``integrator`` and ``dead_reckon``, or matrix and bias of a magnetometer.
        :param force: replace what exists.
        :raises InputError: for a path that cannot be used or exists.
        """
        arguments.switch("for_simulator", for_simulator)
        write = correction.write_simulator if for_simulator else correction.write_correction
        with saved(path, force) as place:
            write(self.parameters, place, "calibrated by imu_sim_ros")
        return Path(path)


def calibrate_six_position(
    readings: Flight | Readings | str | Path, *, gravity: float = -GRAVITY[2], simple: bool = False
) -> Calibration:
    """Return the accelerometer's bias, scale and misalignment, and the gyroscope's bias.

    :param readings: of a body that rests on each of its six faces.
    :param gravity: its magnitude where the run was made [m/s^2].
    :param simple: the lecture's eq. 6: bias and scale per axis only.
    :returns: a :class:`Calibration` with standard errors.
    :raises InputError: where a face is missing.

    >>> import imu_sim_ros as ims
    >>> imu = {"preset": "perfect", "accelerometer_bias": [0.1, -0.2, 0.3]}
    >>> found = ims.calibrate_six_position(ims.simulate(imu=imu, trajectory="six_position"))
    >>> found.accelerometer.bias.value.round(6).tolist()
    [0.1, -0.2, 0.3]
    """
    imu = readings_of("readings", readings)
    gravity = _gravity(gravity)
    arguments.switch("simple", simple)
    steady = find_steady(imu.t_ns, imu.gyro, imu.accel)
    found = six_position(steady, gravity, simple=simple)
    return _calibration(correction.six_position_parameters(found))


def calibrate_turntable(
    readings: Flight | Readings | str | Path,
    *,
    rates: Sequence[float] | None = None,
    gravity: float = -GRAVITY[2],
) -> Calibration:
    """Return the gyroscope's bias, scale and misalignment, and its g-sensitivity if observable.

    :param readings: of a body that is turned about each axis both ways, and rests.
    :param rates: magnitudes that the table was set to [rad/s]; those of a flight are known.
    :param gravity: its magnitude [m/s^2].
    :returns: a :class:`Calibration` with standard errors.
    :raises InputError: where the rates are not known, or an axis is not turned both ways.

    >>> import imu_sim_ros as ims
    >>> imu = {"preset": "perfect", "gyroscope_bias": [0.01, 0.0, -0.02]}
    >>> found = ims.calibrate_turntable(ims.simulate(imu=imu, trajectory="turntable"))
    >>> (found.gyroscope.bias.value.round(6) + 0.0).tolist()
    [0.01, 0.0, -0.02]
    """
    imu = readings_of("readings", readings)
    gravity = _gravity(gravity)
    set_to = None if rates is None else np.abs(arguments.array("rates", rates, (None,)))
    if set_to is not None and not set_to.size:
        arguments.refuse("rates", rates, "one rate or more [rad/s]")
    steady = find_steady(imu.t_ns, imu.gyro, imu.accel, rotating=True)
    if set_to is not None:
        steady, rate = known_rates(steady, set_to)
    elif isinstance(readings, Flight):
        truth = readings.truth
        steady, rate = true_rates(steady, truth.t_ns, truth.angular_velocity)
    else:
        raise InputError("rates: the rates the table was set to are not known; give them in rad/s")
    return _calibration(correction.turntable_parameters(turntable(steady, rate, gravity)))


def calibrate_temperature(
    readings: Flight | Readings | str | Path,
    *,
    temperature: ArrayLike | None = None,
    reference: float = 25.0,
    gravity: float = -GRAVITY[2],
) -> Calibration:
    """Return bias and scale over temperature of both triads.

    :param readings: of a body at rest at several temperatures.
    :param temperature: (n,) of the sensor at the readings [degC]; that of a flight is known.
    :param reference: T0 of the polynomials [degC].
    :param gravity: its magnitude [m/s^2].
    :returns: a :class:`Calibration` with standard errors.
    :raises InputError: for temperatures that are unknown or hardly differ.
    """
    imu = readings_of("readings", readings)
    gravity = _gravity(gravity)
    number("reference", reference, "a temperature from -273.15 to 1000 degC", -273.15, 1000.0)
    if temperature is None:
        if not isinstance(readings, Flight):
            raise InputError("temperature: give that of the sensor at each reading [degC]")
        temperature = readings.temperature
    at_readings = arguments.array("temperature", temperature, (len(imu),))
    gate.Verdict(imu.t_ns, [(gate.TEMPERATURE, at_readings)]).complain("temperature")
    steady, rate = known_rates(
        find_steady(imu.t_ns, imu.gyro, imu.accel, rotating=False), np.array([np.inf])
    )
    at = temperatures_at(steady, imu.t_ns, at_readings)
    force = specific_force(steady, gravity)
    found = over_temperature(steady, at, rate, force, reference)
    return _calibration(correction.temperature_parameters(found))


def calibrate_magnetometer(
    readings: Flight | ArrayLike | str | Path, *, strength: float | None = None
) -> Calibration:
    """Return hard and soft iron of a magnetometer that was turned all around.

    :param readings: of a flight with ``sensors=["magnetic_field"]``, of a bag, or (n, 3) [T].
    :param strength: of the true field [T]; None: not known, the soft iron then has the
        determinant 1.
    :returns: a :class:`Calibration` with standard errors.
    :raises InputError: where the readings do not determine an ellipsoid.

    >>> import imu_sim_ros as ims
    >>> imu = {"preset": "perfect", "magnetometer_hard_iron": [1e-5, 0.0, -2e-5]}
    >>> sensors = ["magnetic_field"]
    >>> flight = ims.simulate(imu=imu, trajectory="tumble", duration=60, sensors=sensors)
    >>> found = ims.calibrate_magnetometer(flight).magnetometer
    >>> ((found.hard_iron.value * 1e6).round(6) + 0.0).tolist()
    [10.0, 0.0, -20.0]
    """
    if strength is not None:
        number("strength", strength, "above 0 and below 1 T", 0.0, _STRONGEST, above=True)
    if isinstance(readings, Flight):
        values = readings.magnetic_field.field
    elif isinstance(readings, str | PathLike):
        from imu_sim_ros.bags.sensor_tables import read_measured
        from imu_sim_ros.sensors.magnetometer.declaration import SENSOR

        _, values = read_measured(arguments.path("readings", readings, BAG_OR_FILE), SENSOR.table)
    else:
        values = arguments.array("readings", readings, (None, 3))
        gate.Verdict(None, [(gate.FIELD, values)]).complain("readings")
    return _calibration(correction.magnetometer_parameters(ellipsoid(values, strength)))


def _gravity(value: float) -> float:
    return number("gravity", value, "a magnitude from 1 to 30 m/s^2", 1.0, 30.0)


def _calibration(values: correction.Parameters) -> Calibration:
    gyroscope, accelerometer, magnetometer = (
        TriadCalibration(
            (name.removeprefix(f"{triad}_"), Calibrated(*value))
            for name, value in values.items()
            if name.startswith(triad)
        )
        for triad in (*TRIADS, "magnetometer")
    )
    return Calibration(gyroscope, accelerometer, values, magnetometer)
