# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Deterministic errors of an IMU from calibration runs."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.bags import read as bags
from imu_sim_ros.bags.sensor_tables import read_measured
from imu_sim_ros.calibration.deterministic import correction
from imu_sim_ros.calibration.deterministic.correction import Calibrated as Calibrated
from imu_sim_ros.calibration.deterministic.ellipsoid import calibrate_magnetometer as ellipsoid
from imu_sim_ros.calibration.deterministic.positions import AUTO, FIXTURES, NORM
from imu_sim_ros.calibration.deterministic.positions import calibrate_six_position as six_position
from imu_sim_ros.calibration.deterministic.steady import Steady, find_steady
from imu_sim_ros.calibration.deterministic.temperature import (
    Temperature,
    temperatures_at,
)
from imu_sim_ros.calibration.deterministic.temperature import (
    calibrate_temperature as over_temperature,
)
from imu_sim_ros.calibration.deterministic.turntable import calibrate_turntable as turntable
from imu_sim_ros.calibration.deterministic.turntable import (
    match_table_rates,
    specific_force,
    true_rates,
)
from imu_sim_ros.calibration.noise.truth import load_truth
from imu_sim_ros.core import arguments, gate
from imu_sim_ros.core.arguments import BAG_OR_FILE, name_of, number, suggest_keywords
from imu_sim_ros.core.bad_rows import Skipped
from imu_sim_ros.core.conventions import ABSOLUTE_ZERO, GRAVITY, STANDARD_GRAVITY
from imu_sim_ros.core.errors import InputError, Problems, name_source
from imu_sim_ros.core.records import Readings, replace_fields
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.core.types import Array, JsonObject, Times
from imu_sim_ros.formats import door
from imu_sim_ros.jobs.calibration_text import calibration_lines
from imu_sim_ros.jobs.flight import Flight, readings_of
from imu_sim_ros.jobs.selection import (
    NOTHING,
    AccelTopic,
    AccelUnit,
    Frame,
    GyroTopic,
    GyroUnit,
    Selection,
    check_choice,
    input_lines,
)
from imu_sim_ros.jobs.writing import SkipBadRows, save_output
from imu_sim_ros.navigation.parameters import IntegratorParameters
from imu_sim_ros.navigation.state import NO_CORRECTION, Correction, correction_of
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import build
from imu_sim_ros.recordings.findings.catalogue import reading_findings, temperature_findings
from imu_sim_ros.recordings.findings.policy import CALIBRATE, CALIBRATE_TEMPERATURE
from imu_sim_ros.recordings.findings.temperatures import TemperatureRecord
from imu_sim_ros.sensors.magnetometer.declaration import SENSOR, TABLE
from imu_sim_ros.terminal.text_tables import TextTable

if TYPE_CHECKING:
    from imu_sim_ros.plots.style import Figure

_STRONGEST: Final = math.nextafter(1.0, 0.0)
"""Upper limit of field strengths, below 1 T, which no magnetometer measures [T]."""
_COMMON_SCALE: Final = 0.05
"""Departure from 1 of a triad's mean scale that no sensor has: data sheets state up to 4 %."""
_UNITS: Final = {
    "gyroscope": (("deg/s", math.degrees(1.0)), ("mrad/s", 1e3)),
    "accelerometer": (("g", 1.0 / STANDARD_GRAVITY), ("mg", 1e3 / STANDARD_GRAVITY)),
}
"""Units that readings may have by mistake, with their number in the right unit."""
_WRONG_FORCE: Final = "counts, or gravity is wrong"
"""Causes of a wrong scale of an accelerometer that is in no known unit."""
_WRONG_RATE: Final = "rates are wrong, or counts"
"""Causes of a wrong scale of a gyroscope that is in no known unit."""
_MAGNETOMETER: Final = SENSOR.name
Source = Flight | Readings | str | Path


class TriadCalibration(dict[str, Calibrated]):
    """The calibrated parameters of one triad by name; each is also an attribute."""

    def __getattr__(self, name: str) -> Calibrated:
        try:
            return self[name]
        except KeyError:
            names = ", ".join(self)
            raise AttributeError(
                f"{name}: this run does not determine it; it determines {names}"
            ) from None


@dataclass(frozen=True, repr=False)
class Calibration:
    """The result of a calibration run."""

    kind: str
    """``six_position``, ``turntable``, ``temperature`` or ``magnetometer``."""
    parameters: correction.Parameters
    """Every parameter that the run determines, by its name below ``imu.``."""
    facts: Mapping[str, object]
    """Statistics of the run: stretches, rates, temperatures, residuals."""
    picture: Callable[[], Figure]
    name: str
    """The file, for titles and comments."""
    warnings: tuple[str, ...] = ()
    """Rows that were skipped, and what is doubtful."""
    notes: tuple[str, ...] = ()
    """Choices and conversions of reading, a line each."""

    @property
    def gyroscope(self) -> TriadCalibration:
        """Constants of the gyroscope that the run determines."""
        return self._triad("gyroscope")

    @property
    def accelerometer(self) -> TriadCalibration:
        """Constants of the accelerometer that the run determines."""
        return self._triad("accelerometer")

    @property
    def magnetometer(self) -> TriadCalibration:
        """Constants of the magnetometer that the run determines."""
        return self._triad(_MAGNETOMETER)

    def _triad(self, triad: str) -> TriadCalibration:
        """Return the parameters of one triad, without its name in theirs."""
        return TriadCalibration(
            (name.removeprefix(f"{triad}_"), calibrated)
            for name, calibrated in self.parameters.items()
            if name.startswith(triad)
        )

    def __repr__(self) -> str:
        return f"<Calibration of {', '.join(self.parameters)}>"

    def plot(self) -> Figure:
        """Return a matplotlib figure of the errors before and after the calibration."""
        return self.picture()

    def true_values(self, imu: str | Path) -> dict[str, Array]:
        """Return the true value of each parameter, flat, for the sensor that was simulated.

        :param imu: a name in config/imus or a parameter file.
        :raises ConfigurationError: for a sensor that does not exist or does not fit.
        """
        truth = load_truth(str(arguments.path("imu", imu, "a name or the path of a file")))
        result = correction.true_parameters(truth, self.parameters)
        if self.facts.get("fixture") == NORM:
            correction.turn_to_upper_triangular(result)
        return result

    def to_dict(self, imu: str | Path | None = None) -> JsonObject:
        """Return parameters and facts in plain types, as ``--json`` prints them.

        :param imu: as for :meth:`true_values`; adds the truth of each parameter.
        """
        parameters = {
            name: {"value": calibrated.value.tolist(), "sigma": calibrated.sigma.tolist()}
            for name, calibrated in self.parameters.items()
        }
        for name, truth in ({} if imu is None else self.true_values(imu)).items():
            parameters[name]["truth"] = truth.tolist()
        return {"parameters": parameters, **self.facts, "notes": list(self.notes)}

    def lines(self, true: Mapping[str, Array] | None = None) -> Iterator[str | TextTable]:
        """Yield the text of the calibration, as ``calibrate`` prints it.

        :param true: the true values, from :meth:`true_values`.
        """
        yield from input_lines(self.notes)
        yield from calibration_lines(self.parameters, self.facts, true or {})

    def save(self, path: str | Path, *, for_simulator: bool = False, force: bool = False) -> Path:
        """Write a file; returns its path.

        :param path: ``.png``: the picture of :meth:`plot`; anything else: a parameter file.
        :param for_simulator: the errors for ``simulator`` and ``generate``; else the correction for
            ``integrator`` and ``dead_reckon``, or matrix and bias of a magnetometer.
        :param force: replace what exists.
        :raises InputError: for a path that cannot be used or exists.
        """
        arguments.boolean("for_simulator", for_simulator)
        with save_output(path, force) as staged:
            if staged.suffix == ".png":
                from imu_sim_ros.plots import style

                style.save(self.plot(), staged)
            else:
                self._write(staged, for_simulator)
        return Path(path)

    def _write(self, path: Path, for_simulator: bool) -> None:
        """Write the parameters for the simulator, or the correction for the integrator."""
        comment = f"Calibrated from {self.name} ({self.kind})."
        if for_simulator:
            comment = f"{comment} For simulator and generate."
            correction.write_simulator(self.parameters, path, comment)
            return
        use = "For integrator and dead_reckon: x = S^-1 (reading - b)."
        if self.kind == _MAGNETOMETER:
            use = "field = matrix (reading - bias), bias in T."
        correction.write_correction(self.parameters, path, f"{comment} {use}")


class _Run:
    """The recording of a calibration run: a flight, readings, or a file."""

    def __init__(
        self,
        readings: Source | ArrayLike,
        topic: str | None,
        skip_bad_rows: bool,
        selection: Selection = NOTHING,
    ) -> None:
        """Check the arguments that every calibration has."""
        self._given: object = readings
        self.path = None
        if isinstance(readings, str | PathLike):
            self.path = arguments.path("readings", readings, BAG_OR_FILE)
        self._choice = check_choice(topic, *selection, of_a_file=self.path is not None)
        self._skip = arguments.boolean("skip_bad_rows", skip_bad_rows)
        self._warnings: list[str] = []
        self._notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the file, or of the readings."""
        if self.path is not None:
            return name_of(self.path)
        return self._given.source if isinstance(self._given, Readings) else "flight"

    @contextmanager
    def name_recording(self) -> Iterator[None]:
        """Prefix problems of a file's content with its name and with its skipped rows."""
        try:
            with contextlib.nullcontext() if self.path is None else name_source(self.path):
                yield
        except InputError as error:
            raise type(error)([*self._warnings, *error.problems]) from None

    def imu(self) -> Readings:
        """Return the readings."""
        if self.path is None:
            readings = readings_of("readings", self._given)
        else:
            skipped = self._skip_counter(f"{self.path}")
            readings = door.read_readings(self.path, self._choice, skipped)
            readings = replace_fields(readings, source=self.name)
        self._notes = readings.notes
        if not isinstance(self._given, Flight):
            CALIBRATE.judge(reading_findings(readings), self._warnings.append)
        return readings

    def field(self) -> Array:
        """Return the readings of the magnetometer (n, 3) [T]."""
        if isinstance(self._given, Flight):
            return self._given.magnetic_field.field
        if self.path is not None:
            skipped = self._skip_counter(f"{self.path}")
            return read_measured(self.path, TABLE, self._choice.topic, skipped)[1]
        values = arguments.array("readings", self._given, (None, 3))
        gate.Verdict(None, [(gate.FIELD, values)]).complain("readings")
        return values

    def temperature(self, imu: Readings, values: ArrayLike | None, topic: str | None) -> Table:
        """Return times and temperatures of the sensor [degC].

        Without a topic they are those of the readings themselves, if they have any.
        """
        topic = arguments.topic("temperature_topic", topic, of_a_file=self.path is not None)
        t_ns = imu.t_ns
        if values is not None:
            degrees = arguments.array("temperature", values, (len(imu),))
            gate.Verdict(t_ns, [(gate.TEMPERATURE, degrees)]).complain("temperature")
        elif topic is None and imu.temperature is not None and np.isfinite(imu.temperature).any():
            has_temperature = np.isfinite(imu.temperature)
            t_ns, degrees = imu.t_ns[has_temperature], imu.temperature[has_temperature]
            if len(degrees) < len(imu):
                self._warnings.append(
                    f"{len(degrees):,} of {len(imu):,} readings have a temperature: it is "
                    "interpolated between them"
                )
        elif self.path is None:
            raise InputError(
                f"{argument_prefix('temperature')}: give that of the sensor at each reading [degC]"
            )
        elif not door.has_topics(self.path):
            if topic is not None:
                raise InputError(f"{self.path}: text has no topic {topic}")
            raise InputError(
                f"{self.path}: has no temperatures; a column such as temperature [degC], or a bag "
                "that has them, is needed"
            )
        else:
            t_ns, degrees = bags.read_temperature(
                self.path, topic, self._skip_counter(f"{self.path}")
            )
        if len(degrees):
            findings = temperature_findings(TemperatureRecord("", degrees))
            CALIBRATE_TEMPERATURE.judge(findings, self._warnings.append)
        return t_ns, degrees

    def steady(
        self,
        imu: Readings,
        rates: ArrayLike | None,
        topic: str | None,
        temperature: Table | None = None,
    ) -> tuple[Steady, Array]:
        """Return the steady pieces and their true rates (m, 3), as given or from the truth.

        :param temperature: that of the sensor; then the body may also rest all the time. None: it
            turns and the rates must be known.
        """
        rotating = temperature is None
        topic = arguments.topic("truth_topic", topic, of_a_file=self.path is not None)
        set_to = None if rates is None else np.abs(arguments.array("rates", rates, (None,)))
        if set_to is not None and not (set_to.size and set_to.all()):
            arguments.refuse("rates", rates, "one rate or more, none of them zero [rad/s]")
        steady = find_steady(imu.t_ns, *imu.triads(), rotating=rotating)
        temperatures = None if temperature is None else temperatures_at(steady, *temperature)
        if set_to is None:
            truth = self._true_rates(topic)
            if truth is not None:
                return true_rates(steady, *truth)
            if rotating:
                raise InputError(
                    f"{argument_prefix('rates')}: the rates the table was set to are not known; "
                    "give them in rad/s"
                )
        rotations = match_table_rates(
            steady, np.empty(0) if set_to is None else set_to, temperatures
        )
        if len(rotations.missing):
            self._warnings.append(
                f"rates: nothing turns at {_list_values(rotations.missing)} rad/s"
            )
        if len(rotations.unknown):
            self._warnings.append(
                f"{len(rotations.unknown)} pieces that turn at "
                f"{_list_values(rotations.unknown)} rad/s "
                "are left out: rates does not name them"
            )
        return rotations.steady, rotations.rate

    def warn_of_scale(self, triad: str, scales: Array, causes: str) -> None:
        """Warn if all scales of a triad are wrong by more than any sensor's.

        :param scales: (n,) scale errors of the triad's axes, or of its norm in n stretches.
        :param causes: what may be wrong instead, with the options that help.
        """
        scale = float(np.exp(np.mean(np.log(np.maximum(np.abs(scales), 1e-300)))))
        if abs(scale - 1.0) <= _COMMON_SCALE:
            return
        unit = next((u for u, factor in _UNITS[triad] if abs(scale / factor - 1.0) < 0.05), None)
        guess = causes if unit is None else f"the readings are in {unit}"
        self._warnings.append(
            f"{triad}: its three scales are {scale:.4g} on average, a sensor's are within "
            f"{100 * _COMMON_SCALE:g} % of 1: {guess}"
        )

    def _true_rates(self, topic: str | None) -> Table | None:
        """Return times and true angular rates (n, 3); None without a truth."""
        if isinstance(self._given, Flight):
            return self._given.truth.t_ns, self._given.truth.body_rates()
        if self.path is None:
            return None
        try:
            truth_path = door.truth_file(self.path) or self.path
            truth = door.read_states(truth_path, topic, self._skip)
        except InputError:
            if topic is not None:
                raise
            return None
        if truth.skipped:
            self._warnings.append(f"the truth of {self.path}: {truth.skipped} bad rows skipped")
        rates = truth.angular_velocity
        return None if rates is None else (truth.t_ns, rates)

    def _skip_counter(self, name: str) -> Skipped | None:
        """Return the counter of skipped rows; None: they are errors."""
        if not self._skip:
            return None
        return lambda count: self._warnings.append(f"{name}: {count} bad rows skipped")

    def calibration(
        self,
        kind: str,
        parameters: correction.Parameters,
        facts: Mapping[str, object],
        picture: Callable[[], Figure],
    ) -> Calibration:
        """Return the calibration of this recording, with its warnings and notes.

        The arguments are the fields of :class:`Calibration` of these names.
        """
        name = self.name if self.path is None else str(self.path)
        return Calibration(
            kind, parameters, facts, picture, name, tuple(self._warnings), self._notes
        )


Table = tuple[Times, Array]
"""Times (n,) [ns] and values (n, ...)."""


@suggest_keywords
def calibrate_six_position(
    readings: Annotated[Source, "BAG"],
    *,
    topic: Annotated[str | None, "TOPIC"] = None,
    gravity: Annotated[float, "GRAVITY"] = -GRAVITY[2],
    simple: Annotated[bool, "--simple"] = False,
    fixture: Annotated[str, FIXTURES] = AUTO,
    frame: Frame = None,
    gyro_topic: GyroTopic = None,
    accel_topic: AccelTopic = None,
    gyro_unit: GyroUnit = None,
    accel_unit: AccelUnit = None,
    skip_bad_rows: SkipBadRows = False,
) -> Calibration:
    """Return the accelerometer's bias, scale and misalignment, and the gyroscope's bias.

    The readings are those of a body that rests on each of its six faces: a flight,
    :class:`Readings` or a file. ``simple`` is the lecture's eq. 6.

    :param readings: bag, EuRoC folder or CSV file
    :param topic: topic of the readings, if the bag has several
    :param gravity: magnitude of local gravity [m/s^2]
    :param simple: bias and scale only, without misalignment
    :param fixture: exact: each axis points exactly up and down; norm: ten or more rests in any
        positions, fits the norm of gravity with an upper triangular S; auto: chooses by a test of
        the residuals
    :param frame: frame of the readings, if a topic carries several IMUs
    :param gyro_topic: topic of the gyroscope, if the accelerometer has another one
    :param accel_topic: topic of the accelerometer, interpolated to the gyroscope's times
    :param gyro_unit: unit of the gyroscope in the file: rad/s, deg/s
    :param accel_unit: unit of the accelerometer in the file: m/s^2, g, mg
    :param skip_bad_rows: skip and count bad rows of text and bad messages of bags
    :returns: a :class:`Calibration` with standard errors.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a missing face, and a file that cannot be read.

    >>> import imu_sim_ros as ims
    >>> imu = {"preset": "perfect", "accelerometer_bias": [0.1, -0.2, 0.3]}
    >>> calibration = ims.calibrate_six_position(ims.simulate(imu=imu, trajectory="six_position"))
    >>> calibration.accelerometer.bias.value.round(6).tolist()
    [0.1, -0.2, 0.3]
    """
    run = _Run(
        readings, topic, skip_bad_rows, (frame, gyro_topic, accel_topic, gyro_unit, accel_unit)
    )
    gravity = _gravity(gravity)
    arguments.boolean("simple", simple)
    arguments.choice("fixture", fixture, FIXTURES)
    imu = run.imu()
    with run.name_recording():
        steady = find_steady(imu.t_ns, *imu.triads())
        fit = six_position(steady, gravity, simple=simple, fixture=fixture)
        run.warn_of_scale("accelerometer", np.diag(fit.scale_misalignment), _WRONG_FORCE)
    facts = {
        "positions": fit.positions.stretches,
        "seconds_at_rest": float(fit.positions.duration.sum()),
        "rms_residual": _rms(fit.residuals),
        "fixture": fit.fixture,
        "fixture_reason": fit.reason,
    }

    def picture() -> Figure:
        from imu_sim_ros.plots import calibration as pictures

        return pictures.six_position(fit, gravity, run.name)

    return run.calibration("six_position", correction.six_position_parameters(fit), facts, picture)


@suggest_keywords
def calibrate_turntable(
    readings: Annotated[Source, "BAG"],
    *,
    topic: Annotated[str | None, "TOPIC"] = None,
    rates: ArrayLike | None = None,
    truth_topic: Annotated[str | None, "TOPIC"] = None,
    gravity: Annotated[float, "GRAVITY"] = -GRAVITY[2],
    accelerometer: Annotated[Calibration | str | Path | None, "FILE"] = None,
    frame: Frame = None,
    gyro_topic: GyroTopic = None,
    accel_topic: AccelTopic = None,
    gyro_unit: GyroUnit = None,
    accel_unit: AccelUnit = None,
    skip_bad_rows: SkipBadRows = False,
) -> Calibration:
    """Return the gyroscope's bias, scale and misalignment, and its g-sensitivity if observable.

    The readings are those of a body that turns about each axis both ways, and rests: a flight,
    :class:`Readings` or a file. ``accelerometer`` may also be the :class:`Calibration` itself.

    :param readings: bag, EuRoC folder or CSV file
    :param topic: topic of the readings, if the bag has several
    :param rates: magnitudes that the table was set to [rad/s]; by default those of the truth in a
        flight or in a bag with Odometry.
    :param truth_topic: Odometry topic to take the rates from if none are given
    :param gravity: magnitude of local gravity [m/s^2]
    :param accelerometer: correction.yaml of a six-position run, for a tilted table: take the
        specific force from the accelerometer
    :param frame: frame of the readings, if a topic carries several IMUs
    :param gyro_topic: topic of the gyroscope, if the accelerometer has another one
    :param accel_topic: topic of the accelerometer, interpolated to the gyroscope's times
    :param gyro_unit: unit of the gyroscope in the file: rad/s, deg/s
    :param accel_unit: unit of the accelerometer in the file: m/s^2, g, mg
    :param skip_bad_rows: skip and count bad rows of text and bad messages of bags
    :returns: a :class:`Calibration` with standard errors.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for unknown rates, and an axis that is not turned both ways.

    >>> import imu_sim_ros as ims
    >>> imu = {"preset": "perfect", "gyroscope_bias": [0.01, 0.0, -0.02]}
    >>> calibration = ims.calibrate_turntable(ims.simulate(imu=imu, trajectory="turntable"))
    >>> (calibration.gyroscope.bias.value.round(6) + 0.0).tolist()
    [0.01, 0.0, -0.02]
    """
    run = _Run(
        readings, topic, skip_bad_rows, (frame, gyro_topic, accel_topic, gyro_unit, accel_unit)
    )
    gravity = _gravity(gravity)
    problems = Problems()
    with problems.collect():
        imu = run.imu()
    with problems.collect():
        accel_correction = NO_CORRECTION if accelerometer is None else _correction(accelerometer)
    problems.tell()
    imu = replace_fields(imu, accel=accel_correction.apply(*imu.triads())[1])
    with run.name_recording():
        steady, rate = run.steady(imu, rates, truth_topic)
        fit = turntable(steady, rate, gravity)
        run.warn_of_scale("gyroscope", np.diag(fit.scale_misalignment), _WRONG_RATE)
    facts: dict[str, object] = {
        "stretches": steady.stretches,
        "rates": sorted({round(float(r), 6) for r in np.abs(rate).max(axis=1)}),
        "rms_residual": _rms(fit.residuals),
    }
    if fit.g_sensitivity is None:
        facts["note"] = (
            "g-sensitivity: not separable from the bias; each axis must point up and down"
        )

    def picture() -> Figure:
        from imu_sim_ros.plots import calibration as pictures

        return pictures.turntable(fit, run.name)

    return run.calibration("turntable", correction.turntable_parameters(fit), facts, picture)


@suggest_keywords
def calibrate_temperature(
    readings: Annotated[Source, "BAG"],
    *,
    topic: Annotated[str | None, "TOPIC"] = None,
    temperature: ArrayLike | None = None,
    temperature_topic: Annotated[str | None, "TOPIC"] = None,
    rates: ArrayLike | None = None,
    truth_topic: Annotated[str | None, "TOPIC"] = None,
    reference: Annotated[float, "DEGC"] = 25.0,
    gravity: Annotated[float, "GRAVITY"] = -GRAVITY[2],
    frame: Frame = None,
    gyro_topic: GyroTopic = None,
    accel_topic: AccelTopic = None,
    gyro_unit: GyroUnit = None,
    accel_unit: AccelUnit = None,
    skip_bad_rows: SkipBadRows = False,
) -> Calibration:
    """Return bias and scale over temperature of both triads.

    The readings are those of a body at rest, or on a rate table, at several temperatures: a flight,
    :class:`Readings` or a file.

    :param readings: bag, EuRoC folder or CSV file
    :param topic: topic of the readings, if the bag has several
    :param temperature: (n,) temperatures of the sensor at the readings [degC]; by default those of
        the flight, of the readings, of the table's column, or of the bag's sensor_msgs/Temperature
        topic.
    :param temperature_topic: sensor_msgs/Temperature topic, if the bag has several
    :param rates: magnitudes that the table was set to [rad/s]; by default those of the truth;
        without a truth, the body is taken to be at rest.
    :param truth_topic: Odometry topic to take the rates from if none are given
    :param reference: reference temperature T0 of the polynomials [degC]
    :param gravity: magnitude of local gravity [m/s^2]
    :param frame: frame of the readings, if a topic carries several IMUs
    :param gyro_topic: topic of the gyroscope, if the accelerometer has another one
    :param accel_topic: topic of the accelerometer, interpolated to the gyroscope's times
    :param gyro_unit: unit of the gyroscope in the file: rad/s, deg/s
    :param accel_unit: unit of the accelerometer in the file: m/s^2, g, mg
    :param skip_bad_rows: skip and count bad rows of text and bad messages of bags
    :returns: a :class:`Calibration` with standard errors.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for temperatures that are unknown or too close together.

    >>> import imu_sim_ros as ims
    >>> imu = {"preset": "perfect", "gyroscope_temperature_bias": [1e-4, 0.0, 0.0]}
    >>> flight = ims.simulate(imu=imu, trajectory="temperature_soak", rate=20)
    >>> calibration = ims.calibrate_temperature(flight)
    >>> [f"{value:.6f}" for value in calibration.gyroscope.temperature_bias.value + 0.0]
    ['0.000100', '0.000000', '0.000000']
    """
    run = _Run(
        readings, topic, skip_bad_rows, (frame, gyro_topic, accel_topic, gyro_unit, accel_unit)
    )
    gravity = _gravity(gravity)
    allowed = f"a temperature from {ABSOLUTE_ZERO:g} to 1000 degC"
    number("reference", reference, allowed, ABSOLUTE_ZERO, 1000.0)
    imu = run.imu()
    with run.name_recording():
        measured = run.temperature(imu, temperature, temperature_topic)
        steady, rate = run.steady(imu, rates, truth_topic, measured)
        temperatures = temperatures_at(steady, *measured)
        force = specific_force(steady, gravity)
        fit = over_temperature(steady, temperatures, rate, force, reference)
        norms = np.linalg.norm(steady.accel, axis=1) / gravity
        run.warn_of_scale("accelerometer", norms, _WRONG_FORCE)
        gyroscope = fit.triads["gyroscope"]
        if gyroscope.inputs.shape[1]:
            scales = np.array([axis.gain[k] for k, axis in enumerate(gyroscope.axes)])
            run.warn_of_scale("gyroscope", scales, _WRONG_RATE)
    facts = {
        "stretches": steady.stretches,
        "temperature_degC": [float(temperatures.min()), float(temperatures.max())],
        **_orders(fit),
    }

    def picture() -> Figure:
        from imu_sim_ros.plots import calibration as pictures

        return pictures.temperature(fit, run.name)

    return run.calibration("temperature", correction.temperature_parameters(fit), facts, picture)


@suggest_keywords
def calibrate_magnetometer(
    readings: Annotated[Flight | ArrayLike | str | Path, "BAG", Path],
    *,
    topic: Annotated[str | None, "TOPIC"] = None,
    strength: Annotated[float | None, "--field T"] = None,
    skip_bad_rows: SkipBadRows = False,
) -> Calibration:
    """Return hard and soft iron of a magnetometer that was turned in all directions.

    The readings may also be a flight with ``sensors=["magnetic_field"]`` or an array (n, 3) [T].

    :param readings: bag, EuRoC folder or CSV file
    :param topic: topic of the readings, if the bag has several
    :param strength: strength of the Earth's field [T]; without it, the soft iron is scaled to
        determinant 1
    :param skip_bad_rows: skip and count bad rows of text and bad messages of bags
    :returns: a :class:`Calibration` with standard errors.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for readings that do not determine an ellipsoid.

    >>> import imu_sim_ros as ims
    >>> imu = {"preset": "perfect", "magnetometer_hard_iron": [1e-5, 0.0, -2e-5]}
    >>> sensors = ["magnetic_field"]
    >>> flight = ims.simulate(imu=imu, trajectory="tumble", duration=60, sensors=sensors)
    >>> calibration = ims.calibrate_magnetometer(flight).magnetometer
    >>> ((calibration.hard_iron.value * 1e6).round(6) + 0.0).tolist()
    [10.0, 0.0, -20.0]
    """
    if strength is not None:
        number("strength", strength, "above 0 and below 1 T", 0.0, _STRONGEST, exclusive=True)
    run = _Run(readings, topic, skip_bad_rows)
    values = run.field()
    with run.name_recording():
        fit = ellipsoid(values, strength)
    facts = {
        "readings": len(values),
        "field_T": fit.field,
        "field_given": strength is not None,
        "noise_T": fit.noise,
        "rms_residual_T": float(np.sqrt(np.mean(fit.residuals**2))),
    }

    def picture() -> Figure:
        from imu_sim_ros.plots import calibration as pictures

        return pictures.ellipsoid(fit, values, f"{run.name}: magnetometer")

    return run.calibration(_MAGNETOMETER, correction.magnetometer_parameters(fit), facts, picture)


def _orders(fit: Temperature) -> dict[str, list[int]]:
    """Return the order of each polynomial, by triad and kind, for its three axes."""
    orders = {}
    for name, triad in fit.triads.items():
        orders[f"{name}_bias_order"] = [len(axis.bias) - 1 for axis in triad.axes]
        orders[f"{name}_scale_order"] = [len(axis.scale) for axis in triad.axes]
    return orders


def _gravity(value: float) -> float:
    return number("gravity", value, "a magnitude from 1 to 30 m/s^2", 1.0, 30.0)


def _correction(source: Calibration | str | Path) -> Correction:
    """Return the correction of readings by a calibration, or by the file of its parameters."""
    values: Mapping[str, object]
    if isinstance(source, Calibration):
        values = correction.integrator_parameters(source.parameters)
    else:
        values = files.load(
            arguments.path("accelerometer", source, "a Calibration or the path of its correction"),
            "integrator",
        )
    return correction_of(build(IntegratorParameters, values))


def _list_values(values: Array) -> str:
    """Return the different values in words, rounded to two digits, the first few of many."""
    different = sorted({float(f"{value:.2g}") for value in values})
    return ", ".join(f"{value:g}" for value in different[:5]) + (", ..." if different[5:] else "")


def _rms(values: Array) -> list[float]:
    return [float(x) for x in np.sqrt(np.mean(values**2, axis=0))]


class Run(NamedTuple):
    """A kind of calibration run."""

    job: Callable[..., Calibration]
    text: str
    """Summary of the run for ``--help``."""
    examples: tuple[str, ...]
    """Lines of a shell."""


RUNS: Final = {
    "six_position": Run(
        calibrate_six_position,
        "calibrate the accelerometer from rests with each axis up and down",
        (
            "calibrate six_position positions.bag -o calibration",
            "calibrate six_position positions.mcap --truth positions_truth.yaml --json",
        ),
    ),
    "turntable": Run(
        calibrate_turntable,
        "calibrate the gyroscope from known rates about each axis in both directions",
        (
            "calibrate turntable table.mcap --rates-deg 30,60,120",
            "calibrate turntable table.mcap --truth table_truth.yaml --no-files",
        ),
    ),
    "temperature": Run(
        calibrate_temperature,
        "calibrate both triads over temperature, from a soak or a ramp",
        (
            "calibrate temperature soak.mcap --reference 25 --truth mpu6000",
            "calibrate temperature ramp.bag --temperature-topic /imu/temperature -o thermal",
        ),
    ),
    _MAGNETOMETER: Run(
        calibrate_magnetometer,
        "find hard and soft iron of a magnetometer from rotations in all directions",
        ("calibrate magnetometer tumble.bag --field 4.92e-5 --truth tumble_truth.yaml",),
    ),
}
"""Calibration runs by the name that the command takes."""
