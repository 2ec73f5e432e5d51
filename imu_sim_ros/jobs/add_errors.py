# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ideal readings of another simulator in, those of a chosen sensor out."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, overload

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros.core import arguments, gate
from imu_sim_ros.core.arguments import refuse, suggest_keywords
from imu_sim_ros.core.conventions import (
    ACCELEROMETER_BIAS_TOPIC,
    ERROR_TOPICS,
    GYROSCOPE_BIAS_TOPIC,
    IDEAL_IMU_TOPIC,
    IMU_TOPIC,
    TRIADS,
)
from imu_sim_ros.core.errors import ConfigurationError, InputError, Problems, warn
from imu_sim_ros.core.records import LiveReading, Readings
from imu_sim_ros.core.types import Array, Integers, Keywords, Mask, Times
from imu_sim_ros.jobs.flight import Flight, Source
from imu_sim_ros.jobs.readings import ReadingsT, delivered_samples
from imu_sim_ros.jobs.simulate import imu_parameters, keyword_parameters, sensor_name
from imu_sim_ros.jobs.writing import parameter_files
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import build, flatten
from imu_sim_ros.recordings.clock import Clock, estimate_clock, repeated_value_rows
from imu_sim_ros.recordings.findings.catalogue import equality_findings
from imu_sim_ros.recordings.order import RESET_READINGS, order_stamps
from imu_sim_ros.sensors.barometer.declaration import PressureReadings
from imu_sim_ros.sensors.barometer.model import Atmosphere
from imu_sim_ros.sensors.faults import KINDS, Fault
from imu_sim_ros.sensors.imu import sdf
from imu_sim_ros.sensors.imu.batch import (
    RESTARTS,
    BatchField,
    BatchPressure,
    BatchSamples,
    ImuBatch,
)
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.sensors.imu.model import NOWHERE, unknown_motion
from imu_sim_ros.sensors.imu.parameters import MOUNT
from imu_sim_ros.sensors.imu.presets import load_all
from imu_sim_ros.sensors.imu.units import Spread
from imu_sim_ros.sensors.magnetometer.declaration import MagneticReadings
from imu_sim_ros.sensors.parameters import LONGEST
from imu_sim_ros.sensors.samples import Samples, join_samples
from imu_sim_ros.simulation.error_input import BatchStartCheck, Conventions, IdealValues
from imu_sim_ros.simulation.error_model import GivenImu
from imu_sim_ros.simulation.error_parameters import (
    NODE,
    ErrorModelParameters,
    load_error_model,
)
from imu_sim_ros.simulation.given_sensor import OTHERS, Counts, GivenOther

TOPICS: Final = (IMU_TOPIC, IDEAL_IMU_TOPIC, GYROSCOPE_BIAS_TOPIC, ACCELEROMETER_BIAS_TOPIC)
"""Topics of a bag of readings with errors."""
ROWS_AT_ONCE: Final = 8192
"""Number of readings whose errors are computed at once."""
MOST_ENVIRONMENTS: Final = 1_000_000
"""Largest number of sensors of a batch."""
_LARGEST_SEED: Final = 2**62
"""Largest seed of a batch: its units count up from it, and further with each reset."""
_UNIT_STAMPS: Final = 1 << 16
"""Stamps by which their unit is judged."""
_FEWEST_ORDERED: Final = 32
"""Readings of a block from which on stray stamps are told from a pause."""
_TOLD: Final = 3
"""Environments that a warning names, and warnings of held readings."""


def add_errors(
    t_ns: ArrayLike,
    gyro: ArrayLike,
    accel: ArrayLike,
    *,
    orientation: ArrayLike | None = None,
    magnetic_field: tuple[ArrayLike, ArrayLike] | None = None,
    pressure: tuple[ArrayLike, ArrayLike] | None = None,
    imu: str | Path | Mapping[str, object] | None = None,
    rate: float | None = None,
    seed: int | None = None,
    params_file: str | Path | None = None,
    input: Mapping[str, object] | None = None,
    **parameters: object,
) -> Flight:
    """Add a sensor's errors to ideal readings, such as those of another simulator.

    The truth of the result holds the ideal readings and every true error; those parts of the motion
    that are not given are NaN. Problems with stamps, and readings that contradict the declaration,
    cause warnings.

    :param t_ns: (n,) stamps [ns].
    :param gyro: (n, 3) ideal angular rates [rad/s].
    :param accel: (n, 3) ideal specific forces [m/s^2].
    :param orientation: (n, 4) q_wb, unit quaternions (w, x, y, z); needed if gravity is missing.
    :param magnetic_field: stamps (k,) [ns] and ideal fields (k, 3) [T] in the axes of the readings,
        of which the magnetometer of the IMU makes ``flight.magnetic_field``.
    :param pressure: stamps (k,) [ns] and ideal pressures (k,) [Pa] at the IMU, for its barometer.
    :param imu: as in :func:`simulate`, or a Gazebo model such as ``model.sdf``.
    :param rate: samples per second [Hz]; by default that of the stamps.
    :param seed: seed of all random streams.
    :param params_file: a ROS 2 parameter file below all other arguments.
    :param input: declaration of the readings: ``{"gravity": "missing", "axes": "frd"}``.
    :param parameters: any other parameter by its ROS name.
    :returns: a :class:`Flight` with the readings of the sensor and their truth.
    :raises ConfigurationError: with a line for each problem.
    :raises InputError: for readings that are not finite or not possible.

    >>> import imu_sim_ros as ims
    >>> ideal = ims.simulate(imu="perfect", trajectory="figure_eight", duration=10).truth
    >>> flight = ims.add_errors(ideal.t_ns, ideal.gyro, ideal.accel, imu="bmi088", seed=1)
    >>> flight
    <Flight bmi088 on given readings: 2000 at 200 Hz, 9.995 s, seed 1>
    >>> same = ims.simulate(imu="bmi088", trajectory="figure_eight", duration=10, seed=1)
    >>> bool((flight.accel == same.accel).all())
    True
    """
    ideal_readings = _check_readings(t_ns, gyro, accel, orientation, "add_errors")
    if not len(ideal_readings.t_ns):
        raise InputError("add_errors: no readings")
    strays = tell_strays(ideal_readings.t_ns, True, "add_errors", warn)
    if strays.any():
        ideal_readings = ideal_readings.rows(~strays)
    layers = parameter_layers(imu, seed, params_file, input, parameters, rate)
    unchanged = repeated_value_rows(ideal_readings.gyro, ideal_readings.accel)
    built = load_with_rate(layers, lambda: rounded_rate(ideal_readings.t_ns, unchanged))
    model = GivenImu(built, OTHERS, warn)
    windows: list[dict[str, Samples]] = []
    for begin in range(0, len(ideal_readings.t_ns), ROWS_AT_ONCE):
        windows += model.read(ideal_readings.rows(slice(begin, begin + ROWS_AT_ONCE)))
    model.finish()
    topics: tuple[str, ...] = TOPICS
    for quantity, pair in (("magnetic_field", magnetic_field), ("pressure", pressure)):
        if pair is not None:
            topics += _add_other(model.other(quantity), pair, windows)
    name = f"{sensor_name(imu, built.imu.preset)} on given readings"
    return Flight(Source(built, NOWHERE, int(ideal_readings.t_ns[0])), windows, name, topics)


def _add_other(
    sensor: GivenOther, pair: object, windows: Sequence[dict[str, Samples]]
) -> tuple[str, ...]:
    """Add the samples of a magnetometer or barometer to the windows of its IMU.

    :param sensor: the magnetometer or barometer.
    :param pair: stamps [ns] and ideal values.
    :param windows: samples of each window of the IMU by sensor, to which the samples are added.
    :returns: names of the topics of the sensor.
    :raises ConfigurationError: for a pair of another form.
    :raises InputError: for a pair without readings.
    """
    quantity = sensor.declared.quantity
    if not isinstance(pair, tuple | list) or len(pair) != 2:
        refuse(quantity, pair, "a pair of stamps and values", wrong_type=True)
    ideal_values = _check_ideal_values(quantity, *pair)
    if not len(ideal_values.t_ns):
        raise InputError(f"{quantity}: no readings")
    block = join_samples(sensor.read(ideal_values))
    begin = 0
    for k, window in enumerate(windows):
        end = len(block.true_t_ns)
        if k + 1 < len(windows):
            last_ns = window[IMU].true_t_ns[-1]
            end = max(int(np.searchsorted(block.true_t_ns, last_ns, side="right")), begin)
        window[quantity], begin = block.at(begin, end), end
    return tuple(topic.name for topic in sensor.declared.topics if topic.flags is not None)


class ErrorModel:
    """A sensor's errors on ideal readings that come one by one, or many at a time.

    For use inside a simulator's step. With blocks of any size, the samples are those of
    :func:`add_errors`, whose other arguments and errors apply. With ``count=4096`` it is an
    :class:`ErrorModelBatch`.

    :param rate: samples per second [Hz].

    >>> import imu_sim_ros as ims
    >>> model = ims.ErrorModel(imu="bmi088", rate=1000, seed=1)
    >>> block = model.read(0, [0.0, 0.0, 0.0], [0.0, 0.0, 9.81])
    >>> block.gyro.shape, block.gyro_bias.shape
    ((1, 3), (1, 3))
    """

    _model: GivenImu

    @overload
    def __new__(
        cls,
        *,
        rate: float,
        count: None = ...,
        imu: str | Path | Mapping[str, object] | None = ...,
        seed: int | None = ...,
        params_file: str | Path | None = ...,
        input: Mapping[str, object] | None = ...,
        **parameters: object,
    ) -> ErrorModel: ...

    @overload
    def __new__(  # type: ignore[misc]  # another class, on purpose
        cls,
        *,
        rate: float,
        count: int,
        imu: str | Path | Mapping[str, object] | Sequence[object] | None = ...,
        seed: int | None = ...,
        params_file: str | Path | None = ...,
        input: Mapping[str, object] | None = ...,
        spread: Mapping[str, object] | None = ...,
        **parameters: object,
    ) -> ErrorModelBatch: ...

    def __new__(  # type: ignore[misc]  # with __init__, type checkers would know one class alone
        cls,
        *,
        rate: float,
        count: int | None = None,
        imu: str | Path | Mapping[str, object] | Sequence[object] | None = None,
        seed: int | None = None,
        params_file: str | Path | None = None,
        input: Mapping[str, object] | None = None,
        spread: Mapping[str, object] | None = None,
        **parameters: object,
    ) -> ErrorModel | ErrorModelBatch:
        """Set up the sensor, or a batch of ``count``."""
        if count is not None:
            return ErrorModelBatch(
                rate=rate,
                count=count,
                imu=imu,
                seed=seed,
                params_file=params_file,
                input=input,
                spread=spread,
                **parameters,
            )
        if spread is not None:
            parameters["spread"] = spread  # refused: a single sensor has no such parameter
        self = super().__new__(cls)
        layers = parameter_layers(imu, seed, params_file, input, parameters, rate)
        self._model = GivenImu(load_error_model(layers), OTHERS, warn)
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle the state, without the arguments of the sensor."""
        return object.__new__, (type(self),), vars(self)

    @property
    def parameters(self) -> ErrorModelParameters:
        """All parameters, a frozen dataclass."""
        return self._model.parameters

    @property
    def counts(self) -> Counts:
        """Counts of irregular readings so far: missing, repeated, restarts, ..."""
        return self._model.counts

    def read(
        self,
        t_ns: int | ArrayLike,
        gyro: ArrayLike,
        accel: ArrayLike,
        orientation: ArrayLike | None = None,
    ) -> Samples:
        """Return the samples of ideal readings: one for each, unless ``input.rate`` is higher.

        :param t_ns: stamp, or (n,) stamps [ns].
        :param gyro: (3,) or (n, 3) ideal angular rates [rad/s].
        :param accel: (3,) or (n, 3) ideal specific forces [m/s^2].
        :param orientation: (4,) or (n, 4) q_wb (w, x, y, z); needed if gravity is missing.
        :returns: stamps, readings, temperature and every true error of the samples.
        :raises InputError: for readings that are not finite or not possible; all are discarded.
        """
        if type(t_ns) is int and orientation is None:
            rate, force = arguments.float_triple(gyro), arguments.float_triple(accel)
            if rate and force and gate.is_reading(t_ns, rate, force):
                samples = self._model.read_few([LiveReading(t_ns, rate, force)])
                if samples is not None:
                    return samples
        ideal_readings = _check_readings(t_ns, gyro, accel, orientation, "read")
        blocks = [window[IMU] for window in self._model.read(ideal_readings)]
        return join_samples(blocks) if blocks else _no_samples(self._model.position)

    def read_magnetic_field(self, t_ns: int | ArrayLike, field: ArrayLike) -> MagneticReadings:
        """Return the readings of the IMU's magnetometer, one for each ideal field.

        Its rate is ``imu.magnetometer_rate``; its samples need not be those of the IMU.

        :param t_ns: stamp, or (n,) stamps [ns].
        :param field: (3,) or (n, 3) ideal magnetic fields in the axes of the readings [T].
        :returns: stamps, readings, ideal fields and biases of the samples that are delivered.
        :raises InputError: for fields that are not finite or not possible; all are discarded.

        >>> import imu_sim_ros as ims
        >>> model = ims.ErrorModel(imu="mpu9250", rate=1000, seed=1)
        >>> model.read_magnetic_field(0, [0.0, 2e-5, -4e-5]).field.shape
        (1, 3)
        """
        ideal_values = _check_ideal_values("magnetic_field", t_ns, field)
        return _deliver(self._model.other("magnetic_field"), ideal_values, MagneticReadings)

    def read_pressure(
        self,
        t_ns: int | ArrayLike,
        pressure: ArrayLike | None = None,
        *,
        altitude: ArrayLike | None = None,
    ) -> PressureReadings:
        """Return the readings of the IMU's barometer, one for each ideal pressure.

        Its rate is ``imu.barometer_rate``; its samples need not be those of the IMU.

        :param t_ns: stamp, or (n,) stamps [ns].
        :param pressure: pressure of the still air at the IMU [Pa], a number or (n,).
        :param altitude: in its place, heights above sea level [m], whose pressure is that of
            ``atmosphere.*``.
        :returns: stamps, readings, ideal pressures and biases of the samples that are delivered.
        :raises InputError: for values that are not finite or not possible; all are discarded.

        >>> import imu_sim_ros as ims
        >>> model = ims.ErrorModel(rate=1000, seed=1)
        >>> round(float(model.read_pressure(0, altitude=100.0).ideal_pressure[0]))
        100129
        """
        values = _pressures(self.parameters, pressure, altitude)
        ideal_values = _check_ideal_values("pressure", t_ns, values)
        return _deliver(self._model.other("pressure"), ideal_values, PressureReadings)

    def update(self, **parameters: object) -> None:
        """Change live parameters by their ROS names, ``imu={"gyroscope_bias": [0.1, 0, 0]}``.

        They take effect with the next multiple of 64 samples.

        :raises ConfigurationError: for parameters that cannot change and for bad values; nothing
            changes then.
        """
        changed = {**flatten(self.parameters), **files.dotted_values(parameters, "parameters")}
        self._model.update(build(type(self.parameters), changed))

    def inject(
        self,
        kind: str,
        *,
        triad: str = "",
        value: float | tuple[float, float, float] = 0.0,
        duration: float = float("inf"),
        delay: float = 0.0,
    ) -> int:
        """Start a fault; return the index of the first affected sample.

        :param kind: ``bias_jump``, ``saturation``, ``stuck``, ``dropout`` or ``latency``.
        :param triad: ``gyroscope`` or ``accelerometer``, for the first three kinds; a fault of any
            kind may hit ``magnetometer`` or ``barometer``.
        :param value: strength, in the unit of the affected quantity.
        :param duration: length of the fault [s].
        :param delay: time from the next sample to the fault [s].
        :raises ConfigurationError: with a line for each problem.
        """
        arguments.choice("kind", kind, KINDS)
        if not isinstance(triad, str) or triad:
            arguments.choice(
                "triad", triad, (*TRIADS, *(sensor.name for sensor in OTHERS.values()))
            )
        if not (isinstance(duration, float) and duration == math.inf):
            arguments.number("duration", duration, "seconds, or math.inf", 0.0, exclusive=True)
        arguments.number("delay", delay, "seconds", 0.0, LONGEST)
        if isinstance(value, int | float):
            fault = Fault(kind, float(duration), float(value), triad)
        else:
            x, y, z = arguments.array("value", value, (3,)).tolist()
            fault = Fault(kind, float(duration), (x, y, z), triad)
        return self._model.inject(fault, float(delay))

    def reset(self) -> None:
        """Restart with the next reading, in the initial state."""
        self._model.reset()

    def __repr__(self) -> str:
        p = self.parameters
        return f"<ErrorModel {Path(p.imu.preset).stem} at {p.rate:g} Hz, seed {p.seed}>"


class ErrorModelBatch:
    """Error models of many sensors, for thousands of environments: ``ErrorModel(count=...)``.

    Each call of :meth:`read` is the next sample of all of them. Environment k is, bit for bit, the
    one ``ErrorModel`` with the seed ``seed + k``.

    :param count: number of environments, 1 to 1,000,000.
    :param rate: samples per second [Hz].
    :param imu: as in :class:`ErrorModel`, or a list: environment k has entry k modulo its length.
    :param spread: parameters that differ from unit to unit, drawn from its seed, by name:
        ``{"gyroscope_noise_density": ("uniform", 1e-4, 3e-4)}`` between two values,
        ``{"accelerometer_bias": ("gaussian", 0.05)}`` about the preset's; one number or one for
        each axis. Values stay within the parameter's limits.

    >>> import numpy as np
    >>> import imu_sim_ros as ims
    >>> model = ims.ErrorModel(imu="bmi088", rate=200, seed=1, count=8)
    >>> samples = model.read(0, np.zeros((8, 3)), np.tile([0.0, 0.0, 9.81], (8, 1)))
    >>> samples.gyro.shape, samples.gyro_bias.shape
    ((8, 3), (8, 3))
    >>> sixth = ims.ErrorModel(imu="bmi088", rate=200, seed=1 + 5)
    >>> block = sixth.read(0, [0.0, 0.0, 0.0], [0.0, 0.0, 9.81])
    >>> bool((block.gyro[0] == samples.gyro[5]).all())
    True
    """

    def __init__(
        self,
        *,
        count: int,
        rate: float,
        imu: str | Path | Mapping[str, object] | Sequence[object] | None = None,
        seed: int | None = None,
        params_file: str | Path | None = None,
        input: Mapping[str, object] | None = None,
        spread: Mapping[str, object] | None = None,
        **parameters: object,
    ) -> None:
        """Set up the sensors.

        :raises ConfigurationError: with a line for each problem.
        """
        allowed = f"a whole number from 1 to {MOST_ENVIRONMENTS}"
        self.count = arguments.integer("count", count, allowed, 1, MOST_ENVIRONMENTS)
        imus = list(imu) if isinstance(imu, list | tuple) else [imu]
        if not imus:
            refuse("imu", imu, "at least one sensor")
        built = [
            load_error_model(parameter_layers(sensor, seed, params_file, input, parameters, rate))
            for sensor in imus
        ]
        self._built = built
        self.parameters: ErrorModelParameters = built[0]
        declared = self.parameters.input
        if declared.place == "body" or declared.rate:
            refuse(
                "input",
                input,
                "without place and rate in a batch: readings where the IMU is mounted",
            )
        if self.parameters.seed > _LARGEST_SEED:
            refuse("seed", seed, f"at most {_LARGEST_SEED} in a batch: each unit has its own")
        self._conventions = Conventions(self.parameters)
        if not isinstance(spread, Mapping | None):
            refuse("spread", spread, "a dictionary of parameters by name", wrong_type=True)
        drawn = {name: _spread(name, value) for name, value in (spread or {}).items()}
        self._batch = ImuBatch([model.imu for model in built], self.parameters, self.count, drawn)
        self._last: dict[str, Array] = {}
        """The last ideal values, by quantity."""
        self._told = 0
        self._check = BatchStartCheck(built, self.count)
        for line in dict.fromkeys(line for entry in built for line in entry.warnings()):
            warn(line)

    @property
    def seeds(self) -> Integers:
        """The seed of each environment's present run (count,)."""
        return self._batch.units.seeds.copy()

    def unit(self, k: int) -> Keywords:
        """Return the arguments of the one ``ErrorModel`` that reads the same, all but ``rate``.

        ``imu`` has the preset and whatever differs from it, ``seed`` is the unit's, and further
        arguments are those in which the batch differs from the defaults. A unit that has begun
        again as ``same_unit`` has none.

        :param k: environment.
        """
        arguments.integer("k", k, f"an environment from 0 to {self.count - 1}", 0, self.count - 1)
        units = self._batch.units
        if units.seeds[k] != units.unit_seeds[k]:
            refuse("k", k, "an environment that did not begin again as the same unit")
        sensor = self._built[k % len(self._built)]
        preset = {"imu.preset": sensor.imu.preset, "rate": sensor.rate}
        usual = flatten(load_error_model(preset))
        changed = {
            name: value
            for name, value in flatten(sensor).items()
            if value != usual[name] and name not in ("rate", "seed")
        }
        model_arguments: Keywords = {
            "imu": {"preset": sensor.imu.preset},
            "seed": int(units.seeds[k]),
        }
        for name, value in changed.items():
            section, dot, rest = name.partition(".")
            entry = list(value) if isinstance(value, tuple) else value
            if dot:
                model_arguments.setdefault(section, {})[rest] = entry
            else:
                model_arguments[name] = entry
        model_arguments["imu"].update(units.unit(k))
        return model_arguments

    def read(
        self,
        t_ns: int,
        gyro: ArrayLike,
        accel: ArrayLike,
        orientation: ArrayLike | None = None,
    ) -> BatchSamples:
        """Return the next sample of each environment.

        An environment whose reading is not finite or not possible keeps its last one; ``held``
        says which, and a warning names the first.

        :param t_ns: time of the sample [ns], passed on; each call is a sample, ``1 / rate`` later.
        :param gyro: (count, 3) ideal angular rates [rad/s].
        :param accel: (count, 3) ideal specific forces [m/s^2].
        :param orientation: (count, 4) q_wb (w, x, y, z); needed if gravity is missing.
        :raises ConfigurationError: for arrays of another shape.
        """
        t_ns, shape, single = _time(t_ns), (self.count, 3), np.zeros(self.count, np.int64)
        rates = arguments.array("gyro", gyro, shape, finite=False)
        forces = arguments.array("accel", accel, shape, finite=False)
        q_wb = None
        if orientation is not None:
            q_wb = arguments.array("orientation", orientation, (self.count, 4), finite=False)
        rates, forces = np.array(rates, order="F"), np.array(forces, order="F")
        invalid = _impossible(rates, gate.RATE) | _impossible(forces, gate.FORCE)
        if q_wb is not None:
            invalid |= ~(np.abs(np.linalg.norm(q_wb, axis=1) - 1.0) < gate.UNIT_TOLERANCE)
        if not self._check.done:
            self._remark(self._check.look(t_ns, rates, forces, invalid))
        readings = Readings.unchecked(t_ns=single, gyro=rates, accel=forces, q_wb=q_wb)
        rates, forces = self._conventions.apply(readings).triads()
        self._hold(invalid, gyro=rates, accel=forces)
        return self._batch.read(t_ns, rates, forces, invalid)

    def read_magnetic_field(self, t_ns: int, field: ArrayLike) -> BatchField:
        """Return the next sample of the magnetometer of each environment.

        Each call is a sample, ``1 / imu.magnetometer_rate`` later. What is not finite or not
        possible is held, as by :meth:`read`.

        :param t_ns: time of the sample [ns], passed on.
        :param field: (count, 3) ideal magnetic fields in the axes of the readings [T].
        :raises ConfigurationError: for an array of another shape, and rates that differ.
        """
        t_ns = _time(t_ns)
        fields = arguments.array("field", field, (self.count, 3), finite=False)
        fields = np.array(fields, order="F")
        invalid = _impossible(fields, gate.FIELD)
        fields = self._conventions.rotate(fields)
        self._hold(invalid, field=fields)
        return self._batch.magnetometers.read(t_ns, fields, invalid)

    def read_pressure(
        self,
        t_ns: int,
        pressure: ArrayLike | None = None,
        *,
        altitude: ArrayLike | None = None,
    ) -> BatchPressure:
        """Return the next sample of the barometer of each environment.

        Each call is a sample, ``1 / imu.barometer_rate`` later. What is not finite or not possible
        is held, as by :meth:`read`.

        :param t_ns: time of the sample [ns], passed on.
        :param pressure: (count,) pressures of the still air at the IMUs [Pa].
        :param altitude: in its place, (count,) heights above sea level [m].
        :raises ConfigurationError: for an array of another shape, and rates that differ.
        """
        t_ns = _time(t_ns)
        name, quantity = _single_argument(pressure=pressure, altitude=altitude)
        values = arguments.array(name, quantity, (self.count,), finite=False).copy()
        invalid = _impossible(
            values[:, None], gate.POSITION if name == "altitude" else gate.PRESSURE
        )
        if name == "altitude":
            values[invalid] = 0.0
            values = Atmosphere(self.parameters.atmosphere).pressure(values)
        self._hold(invalid, pressure=values)
        return self._batch.barometers.read(t_ns, values, invalid)

    def _hold(self, invalid: Mask, **values: Array) -> None:
        """Replace invalid values, in place, by the last ones of their environments; warn of them.

        :param invalid: (count,) True for the environments whose values are not possible.
        :param values: (count, ...) values of all environments, by quantity; 0 before the first.
        """
        if invalid.any():
            for name, reading in values.items():
                reading[invalid] = self._last[name][invalid] if name in self._last else 0.0
            self._tell(np.flatnonzero(invalid))
        self._last |= values

    @staticmethod
    def _remark(lines: Sequence[str]) -> None:
        """Issue each line as a warning."""
        for line in lines:
            warn(line)

    def _tell(self, units: Integers) -> None:
        """Warn about units, a few times at most."""
        self._told += 1
        if self._told <= _TOLD:
            names = ", ".join(map(str, units[:_TOLD].tolist()))
            remainder = f" and {len(units) - _TOLD} more" if len(units) > _TOLD else ""
            ending = "; further ones are only marked in held" if self._told == _TOLD else ""
            warn(
                f"environment {names}{remainder}: a reading that is not finite or not possible; "
                f"it keeps the one before{ending}"
            )

    def reset(self, mask: ArrayLike | None = None, restart: str = "next_seed") -> None:
        """Restart environments with their next sample.

        :param mask: (count,) True for the environments that restart; None: all do.
        :param restart: ``next_seed``: a new unit, its seed ``count`` higher; ``same_unit``: its
            calibration stays, turn-on errors and noise are those of the next seed; ``same_seed``:
            the same run again.
        :raises ConfigurationError: for another mask or restart.
        """
        arguments.choice("restart", restart, RESTARTS)
        try:
            chosen = np.ones(self.count, np.bool_) if mask is None else np.asarray(mask)
        except ValueError:  # lists of several lengths
            refuse("mask", mask, f"{self.count} Booleans", wrong_type=True)
        if chosen.dtype != np.bool_ or chosen.shape != (self.count,):
            refuse("mask", mask, f"{self.count} Booleans")
        if chosen.all():
            self._remark(self._check.finish())
        self._batch.begin(np.flatnonzero(chosen), restart)

    def __repr__(self) -> str:
        p = self.parameters
        name = Path(p.imu.preset).stem
        return f"<ErrorModelBatch {self.count} {name} at {p.rate:g} Hz, seeds from {p.seed}>"


def _time(t_ns: object) -> int:
    """Return the time of a sample [ns].

    :raises ConfigurationError: for anything but a whole number.
    """
    limit = np.iinfo(np.int64).max
    return arguments.integer("t_ns", t_ns, "whole nanoseconds, one number for all", -limit, limit)


def _impossible(values: Array, quantity: gate.Quantity) -> Mask:
    """Return which rows (count, 3) are not finite, or larger than anything possible."""
    if -quantity.largest <= values.min() and values.max() <= quantity.largest:
        return np.zeros(len(values), np.bool_)
    return ~np.asarray((np.abs(values) <= quantity.largest).all(axis=1))


def _spread(name: str, value: object) -> Spread:
    """Return how the units of a batch differ in a parameter.

    :raises ConfigurationError: for anything but ("uniform", low, high) or ("gaussian", sigma).
    """
    allowed = "('uniform', low, high) or ('gaussian', sigma), numbers or three of them"
    ways = {"uniform": 2, "gaussian": 1}
    if not isinstance(value, list | tuple) or not value or ways.get(value[0]) != len(value) - 1:
        refuse(f"spread {name}", value, allowed)
    try:
        sizes = [np.broadcast_to(np.asarray(size, np.float64), (3,)) for size in value[1:]]
    except (TypeError, ValueError):
        refuse(f"spread {name}", value, allowed, wrong_type=True)
    low, high = sizes[0], sizes[-1]
    if (
        not np.isfinite(sizes).all()
        or (low > high).any()
        or (len(sizes) == 1 and (low < 0.0).any())
    ):
        refuse(f"spread {name}", value, allowed)
    return Spread(value[0], low, high)


@suggest_keywords
def from_sdf(file: str | Path, sensor: str | None = None) -> dict[str, object]:
    """Return the parameters of an IMU from a model file of Gazebo.

    Three forms are read: SDF's ``<noise>``, the IMU plugin of Gazebo classic, and the plugin of
    RotorS and PX4. What a model does not write has the plugin's own default. Pass the result as
    ``imu=`` to :func:`add_errors`, :func:`simulate` or :class:`ErrorModel`.

    :param file: ``model.sdf``, a world, or a URDF with Gazebo's elements.
    :param sensor: name of the sensor or plugin, if the file has several.
    :returns: parameters by name, as accepted by ``imu=``: ``preset`` says which sensor was taken,
        ``rate`` and ``imu_frame`` are those of the model, if it has them.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a file in another form, without an IMU, or with several of which none
        is named.

    >>> import imu_sim_ros as ims
    >>> noise = "<noise type='gaussian'><stddev>0.01</stddev></noise>"
    >>> rates = "".join(f"<{axis}>{noise}</{axis}>" for axis in "xyz")
    >>> imu = f"<imu><angular_velocity>{rates}</angular_velocity></imu>"
    >>> sensor = f"<sensor name='imu' type='imu'><update_rate>100</update_rate>{imu}</sensor>"
    >>> file = folder / "model.sdf"
    >>> _ = file.write_text(f"<sdf><model name='m'><link name='l'>{sensor}</link></model></sdf>")
    >>> ims.from_sdf(file)["gyroscope_noise_density"]
    [0.001, 0.001, 0.001]
    """
    path = arguments.path("file", file)
    name = None if sensor is None else arguments.text("sensor", sensor, "the name of a sensor")
    parameters = sdf.read_model(path, name).parameters
    imu_fields = {k.removeprefix("imu."): v for k, v in parameters.items() if k.startswith("imu.")}
    excluded = ("preset", *(name.removeprefix("imu.") for name in MOUNT))
    if not any(
        np.asarray(value).any() for name, value in imu_fields.items() if name not in excluded
    ):
        warn(f"{imu_fields['preset']}: has no noise at all")
    return {**imu_fields, **{k: v for k, v in parameters.items() if not k.startswith("imu.")}}


def _no_samples(position: int) -> Samples:
    """Return empty samples, for a block without readings."""
    times, vectors = np.empty(0, np.int64), np.empty((0, 3))
    values: dict[str, object] = dict.fromkeys(
        ("gyro", "accel", "ideal_gyro", "ideal_accel", *ERROR_TOPICS.values()), vectors
    )
    values |= {"temperature": np.empty(0), "motion": unknown_motion(0)}
    return Samples(times, times, times, times, values, position)


def _check_readings(
    t_ns: object, gyro: ArrayLike, accel: ArrayLike, orientation: ArrayLike | None, name: str
) -> Readings:
    """Return the user's readings as checked arrays.

    :raises InputError: for what is not a reading.
    """
    times = arguments.stamps("t_ns", [t_ns] if isinstance(t_ns, int | np.integer) else t_ns)
    rates, forces = arguments.vectors("gyro", gyro, 3), arguments.vectors("accel", accel, 3)
    q_wb = None if orientation is None else arguments.vectors("orientation", orientation, 4)
    count = len(times)
    if not len(rates) == len(forces) == count or (q_wb is not None and len(q_wb) != count):
        raise ConfigurationError(
            f"{name}: {count} stamps, {len(rates)} rates, {len(forces)} specific forces"
            + ("" if q_wb is None else f", {len(q_wb)} orientations")
            + ": must be equally many"
        )
    # A simulator passes one reading at a time: plain floats are quicker than arrays of one row.
    if count != 1 or not gate.is_reading(int(times[0]), rates[0].tolist(), forces[0].tolist()):
        gate.readings(times, rates, forces).complain(name)
    if q_wb is not None:
        gate.Verdict(times, [(gate.ORIENTATION, q_wb)]).complain(name)
    # Copies: a simulator may fill in the same arrays for its next step.
    rates, forces = np.array(rates, order="F"), np.array(forces, order="F")
    return Readings.unchecked(t_ns=times, gyro=rates, accel=forces, q_wb=q_wb)


def _check_ideal_values(name: str, t_ns: object, values: ArrayLike) -> IdealValues:
    """Return the user's ideal values of another sensor as checked arrays.

    :param name: name of the quantity, for messages.
    :raises InputError: for what is not a reading.
    """
    times = arguments.stamps("t_ns", [t_ns] if isinstance(t_ns, int | np.integer) else t_ns)
    if name == "magnetic_field":
        readings = arguments.vectors("field", values, 3)
    else:
        readings = arguments.array(name, _several(values), (None,), finite=False)
    if len(readings) != len(times):
        raise ConfigurationError(
            f"{name}: {len(times)} stamps, {len(readings)} values: must be equally many"
        )
    table = OTHERS[name].table
    assert table is not None
    gate.Verdict(times, [(table.quantity, readings)]).complain(name)
    return IdealValues.unchecked(t_ns=times, values=np.array(readings))


def _several(values: ArrayLike) -> ArrayLike:
    """Return a single number as a list of one."""
    return np.reshape(values, 1) if isinstance(values, int | float | np.number) else values


def _pressures(
    parameters: ErrorModelParameters, pressure: ArrayLike | None, altitude: ArrayLike | None
) -> ArrayLike:
    """Return pressures [Pa] of the user's pressures or heights.

    :raises ConfigurationError: for both, or neither.
    """
    name, values = _single_argument(pressure=pressure, altitude=altitude)
    if name == "pressure":
        return values
    heights = arguments.array("altitude", _several(values), (None,))
    return Atmosphere(parameters.atmosphere).pressure(heights)


def _single_argument(**values: ArrayLike | None) -> tuple[str, ArrayLike]:
    """Return the one of two arguments that is given.

    :raises ConfigurationError: if both are, or neither.
    """
    pairs = [(name, value) for name, value in values.items() if value is not None]
    if len(pairs) != 1:
        raise ConfigurationError(f"read_pressure: needs either {' or '.join(values)}")
    return pairs[0]


def _deliver(sensor: GivenOther, ideal_values: IdealValues, readings: type[ReadingsT]) -> ReadingsT:
    """Return the samples of ideal values that are delivered, as a flight has them."""
    quantity = sensor.declared.quantity
    windows = [{quantity: block} for block in sensor.read(ideal_values)]
    if windows:
        return delivered_samples(windows, quantity, readings)
    none = ideal_values.rows(slice(0))
    values: Keywords = {field.name: none.values for field in dataclasses.fields(readings)}
    return readings(**{**values, "t_ns": none.t_ns, "true_t_ns": none.t_ns})


def parameter_layers(
    imu: object,
    seed: int | None,
    params_file: str | Path | Sequence[str | Path] | None,
    input: Mapping[str, object] | None,
    parameters: Mapping[str, object],
    rate: float | None,
) -> dict[str, object]:
    """Return the parameters that arguments of :func:`add_errors` give, by dotted name.

    :raises ConfigurationError: with a line for each argument that is not what it must be.
    """
    problems = Problems()
    file_parameters: dict[str, object] = {}
    sensor_parameters: dict[str, object] = {}
    with problems.collect(hanging=""):
        file_parameters = load_all(parameter_files(params_file), NODE)
    with problems.collect():
        sensor_parameters = imu_parameters(imu)
    sensor_parameters.pop("rate", None)  # readings have one of their own
    keywords, overrides = keyword_parameters(parameters)
    layers = {**file_parameters, **sensor_parameters, **keywords}
    if input is not None:
        if not isinstance(input, Mapping):
            refuse("input", input, "parameters by name", wrong_type=True)
        layers |= files.dotted_values(input, "input", "input.")
    if seed is not None:
        layers["seed"] = seed
    if rate is not None:
        layers["rate"] = rate
    layers |= overrides
    if problems:
        load_error_model(layers, problems=problems)
    return layers


def load_with_rate(layers: Mapping[str, object], rate: Callable[[], float]) -> ErrorModelParameters:
    """Return an error model with the rate of the readings, unless layers give one.

    :param rate: returns the rate of the readings [Hz].
    :raises ConfigurationError: with a line for each problem.
    """
    has_rate = "rate" in layers or layers.get("input.rate")
    return load_error_model(layers if has_rate else {**layers, "rate": rate()})


def tell_strays(t_ns: Times, is_first: bool, source: str, remark: Callable[[str], object]) -> Mask:
    """Return (n,) True for the stray stamps of a block of readings, with a warning.

    At the edges of a block such stamps may belong to another stretch of time, but for the start of
    the recording.

    :param t_ns: (n,) stamps in the order of arrival [ns].
    :param is_first: True for the first block of a recording.
    :raises ConfigurationError: for stamps that are equal or no nanoseconds.
    """
    stray = np.zeros(len(t_ns), np.bool_)
    if len(t_ns) < _FEWEST_ORDERED:
        return stray
    rows = order_stamps(t_ns).strays
    if is_first:
        beginning = np.delete(t_ns, rows)[:_UNIT_STAMPS]
        if (np.diff(beginning) > 0).any():
            check_unit(estimate_clock(beginning))
        else:
            check_equality(t_ns)
    begin = 0 if is_first else RESET_READINGS
    rows = rows[(rows >= begin) & (rows < len(t_ns) - RESET_READINGS)]
    stray[rows] = True
    if len(rows):
        remark(
            f"{source}: {len(rows)} stamps are far from their neighbours, the first is "
            f"{int(t_ns[rows[0]])} ns: those readings get no errors [stamps_stray]"
        )
    return stray


def check_unit(clock: Clock) -> None:
    """Refuse the clock of stamps that are no nanoseconds.

    :raises ConfigurationError: for these.
    """
    unit = clock.trait("unit")
    if unit is not None:
        raise ConfigurationError(f"stamps are not in nanoseconds: {unit.text} [stamps_unit]")


def check_equality(t_ns: Times) -> None:
    """Refuse stamps (n,) [ns] that are all equal.

    :raises ConfigurationError: for these.
    """
    problems = [finding.sentence() for finding in equality_findings(t_ns)]
    if problems:
        raise ConfigurationError(problems)


def rounded_rate(t_ns: Times, unchanged: Mask | None) -> float:
    """Return the rate of the readings with these stamps, rounded to six digits [Hz].

    It is the rate of the clock behind them: losses, rounding, batches and messages that came twice
    do not change it.

    :param t_ns: (n,) stamps [ns].
    :param unchanged: (n,) True where a reading has the values of the one before it; None: unknown.
    :raises ConfigurationError: for fewer than two stamps that follow each other, and stamps in
        another unit.
    """
    if len(t_ns) < 2 or not (np.diff(t_ns) > 0).any():
        check_equality(t_ns)
        raise ConfigurationError("rate: two readings, or the rate, must be given")
    clock = estimate_clock(t_ns, unchanged)
    check_unit(clock)
    rate = float(f"{clock.rate:.6g}")
    nearest = float(round(rate))
    return nearest if nearest and abs(rate - nearest) < 2e-5 * nearest else rate
