# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ideal readings of another simulator in, those of a chosen sensor out."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from imu_sim_ros import arguments, timebase
from imu_sim_ros.arguments import refuse
from imu_sim_ros.conventions import (
    ACCELEROMETER_BIAS_TOPIC,
    ERROR_TOPICS,
    GYROSCOPE_BIAS_TOPIC,
    IDEAL_IMU_TOPIC,
    IMU_TOPIC,
    TRIADS,
)
from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.inputs import gate
from imu_sim_ros.jobs.flight import Flight, Source
from imu_sim_ros.jobs.simulate import flat_parameters, imu_parameters
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import build, flatten
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.sensors.faults import KINDS, Fault
from imu_sim_ros.sensors.imu import sdf
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.sensors.imu.model import NOWHERE, unknown_motion
from imu_sim_ros.sensors.parameters import LONGEST
from imu_sim_ros.simulation import error_model
from imu_sim_ros.simulation.error_input import GivenReadings
from imu_sim_ros.simulation.error_parameters import (
    NODE,
    ErrorModelParameters,
    load_error_model,
)
from imu_sim_ros.types import Array, Integers

TOPICS: Final = (IMU_TOPIC, IDEAL_IMU_TOPIC, GYROSCOPE_BIAS_TOPIC, ACCELEROMETER_BIAS_TOPIC)
"""What a flight of given readings is saved as."""
ROWS_AT_ONCE: Final = 8192


def add_errors(
    t_ns: ArrayLike,
    gyro: ArrayLike,
    accel: ArrayLike,
    *,
    orientation: ArrayLike | None = None,
    imu: str | Path | Mapping[str, Any] | None = None,
    rate: float | None = None,
    seed: int | None = None,
    params_file: str | Path | None = None,
    input: Mapping[str, Any] | None = None,
    **parameters: Any,
) -> Flight:
    """Add a sensor's errors to ideal readings, such as those of another simulator.

    The truth of the result holds the ideal readings and every true error; those parts of the motion
    that are not given are NaN. Problems with stamps, and readings that contradict the declaration,
    cause warnings.

    :param t_ns: (n,) stamps [ns].
    :param gyro: (n, 3) ideal angular rates [rad/s].
    :param accel: (n, 3) ideal specific forces [m/s^2].
    :param orientation: (n, 4) q_wb, unit quaternions (w, x, y, z); needed if gravity is missing.
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
    given = _given(t_ns, gyro, accel, orientation, "add_errors")
    if not len(given.t_ns):
        raise InputError("add_errors: no readings")
    layers = layers_of(imu, seed, params_file, input, parameters, rate)
    built = with_rate(layers, lambda: rate_of(given.t_ns))
    model = error_model.ErrorModel(built, remark=_warn)
    windows: list[dict[str, Any]] = []
    for begin in range(0, len(given.t_ns), ROWS_AT_ONCE):
        windows += model.read(given.at(slice(begin, begin + ROWS_AT_ONCE)))
    name = f"{_sensor_name(imu, built)} on given readings"
    return Flight(Source(built, NOWHERE, int(given.t_ns[0])), windows, name, TOPICS)


class ErrorModel:
    """A sensor's errors on ideal readings that come one by one, or many at a time.

    For use inside a simulator's step. With blocks of any size, the samples are those of
    :func:`add_errors`, whose other arguments and errors apply.

    :param rate: samples per second [Hz].

    >>> import imu_sim_ros as ims
    >>> model = ims.ErrorModel(imu="bmi088", rate=1000, seed=1)
    >>> block = model.read(0, [0.0, 0.0, 0.0], [0.0, 0.0, 9.81])
    >>> block.gyro.shape, block.gyro_bias.shape
    ((1, 3), (1, 3))
    """

    def __init__(
        self,
        *,
        rate: float,
        imu: str | Path | Mapping[str, Any] | None = None,
        seed: int | None = None,
        params_file: str | Path | None = None,
        input: Mapping[str, Any] | None = None,
        **parameters: Any,
    ) -> None:
        """Set up the sensor."""
        layers = layers_of(imu, seed, params_file, input, parameters, rate)
        self._model = error_model.ErrorModel(load_error_model(layers), remark=_warn)

    @property
    def parameters(self) -> ErrorModelParameters:
        """All parameters, a frozen dataclass."""
        return self._model.parameters

    @property
    def counts(self) -> error_model.Counts:
        """Counts of irregular readings so far: missing, repeated, restarts, ..."""
        return self._model.counts

    def read(
        self,
        t_ns: int | ArrayLike,
        gyro: ArrayLike,
        accel: ArrayLike,
        orientation: ArrayLike | None = None,
    ) -> ImuBlock:
        """Return the samples of ideal readings: one for each, unless ``input.rate`` is higher.

        :param t_ns: stamp, or (n,) stamps [ns].
        :param gyro: (3,) or (n, 3) ideal angular rates [rad/s].
        :param accel: (3,) or (n, 3) ideal specific forces [m/s^2].
        :param orientation: (4,) or (n, 4) q_wb (w, x, y, z); needed if gravity is missing.
        :returns: stamps, readings, temperature and every true error of the samples.
        :raises InputError: for readings that are not finite or not possible; all are discarded.
        """
        given = _given(t_ns, gyro, accel, orientation, "read")
        blocks = [read[IMU] for read in self._model.read(given)]
        if len(blocks) == 1:
            return blocks[0]
        return error_model.joined(blocks) if blocks else _nothing(self._model.position)

    def update(self, **parameters: Any) -> None:
        """Change live parameters by their ROS names, ``imu={"gyroscope_bias": [0.1, 0, 0]}``.

        They take effect with the next multiple of 64 samples.

        :raises ConfigurationError: for parameters that cannot change and for bad values; nothing
            changes then.
        """
        changed = {**flatten(self.parameters), **flat_parameters("parameters", parameters)}
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
        """Start a fault; returns the index of the first affected sample.

        :param kind: ``bias_jump``, ``saturation``, ``stuck``, ``dropout`` or ``latency``.
        :param triad: ``gyroscope`` or ``accelerometer``, for the first three kinds.
        :param value: strength, in the unit of the affected quantity.
        :param duration: length of the fault [s].
        :param delay: time from the next sample to the fault [s].
        :raises ConfigurationError: with a line for each problem.
        """
        arguments.one_of("kind", kind, KINDS)
        if not isinstance(triad, str) or triad:
            arguments.one_of("triad", triad, TRIADS)
        if not (isinstance(duration, float) and duration == math.inf):
            arguments.number("duration", duration, "seconds, or math.inf", 0.0, above=True)
        arguments.number("delay", delay, "seconds", 0.0, LONGEST)
        if isinstance(value, int | float):
            fault = Fault(kind, float(duration), float(value), triad)
        else:
            x, y, z = arguments.array("value", value, (3,)).tolist()
            fault = Fault(kind, float(duration), (x, y, z), triad)
        return self._model.inject(fault, float(delay))

    def reset(self) -> None:
        """Start again with the next reading, in the initial state."""
        self._model.reset()

    def __repr__(self) -> str:
        p = self.parameters
        return f"<ErrorModel {Path(p.imu.preset).stem} at {p.rate:g} Hz, seed {p.seed}>"


def from_sdf(file: str | Path, sensor: str | None = None) -> dict[str, Any]:
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
    found = sdf.read(path, name).parameters
    own = {k.removeprefix("imu."): v for k, v in found.items() if k.startswith("imu.")}
    if not any(np.asarray(value).any() for name, value in own.items() if name != "preset"):
        warnings.warn(f"{own['preset']}: has no noise at all", stacklevel=2)
    return {**own, **{k: v for k, v in found.items() if not k.startswith("imu.")}}


def _nothing(position: int) -> ImuBlock:
    times, vectors = np.empty(0, np.int64), np.empty((0, 3))
    columns: dict[str, Any] = dict.fromkeys(
        ("gyro", "accel", "ideal_gyro", "ideal_accel", *ERROR_TOPICS.values()), vectors
    )
    return ImuBlock(
        first=position,
        true_t_ns=times,
        t_ns=times,
        release_t_ns=times,
        delivered=times,
        temperature=np.empty(0),
        motion=unknown_motion(0),
        **columns,
    )


def _warn(line: str) -> None:
    warnings.warn(line, stacklevel=6)


def _given(t_ns: Any, gyro: Any, accel: Any, orientation: Any, name: str) -> GivenReadings:
    """Return what somebody gives as arrays, checked.

    :raises InputError: for what is not a reading.
    """
    times = arguments.stamps("t_ns", [t_ns] if isinstance(t_ns, int | np.integer) else t_ns)
    rates, forces = _rows("gyro", gyro, 3), _rows("accel", accel, 3)
    q_wb = None if orientation is None else _rows("orientation", orientation, 4)
    count = len(times)
    if not len(rates) == len(forces) == count or (q_wb is not None and len(q_wb) != count):
        raise ConfigurationError(
            f"{name}: {count} stamps, {len(rates)} rates, {len(forces)} specific forces"
            + ("" if q_wb is None else f", {len(q_wb)} orientations")
            + ": must be equally many"
        )
    if count == 1:
        sound = gate.is_reading(int(times[0]), rates[0].tolist(), forces[0].tolist())
    else:
        sound = False
    if not sound:
        gate.readings(times, rates, forces).complain(name)
    if q_wb is not None:
        gate.Verdict(times, [(gate.ORIENTATION, q_wb)]).complain(name)
    # Copies: a simulator may fill in the same arrays for its next step.
    return GivenReadings(times, np.array(rates, order="F"), np.array(forces, order="F"), q_wb)


def _rows(name: str, value: Any, columns: int) -> Array:
    """Return vectors (n, columns); one is a row."""
    try:
        one = np.ndim(value) == 1
    except (TypeError, ValueError):
        one = False
    shape = (columns,) if one else (None, columns)
    return arguments.array(name, value, shape, finite=False).reshape(-1, columns)


def layers_of(
    imu: Any,
    seed: int | None,
    params_file: str | Path | None,
    input: Mapping[str, Any] | None,
    parameters: Mapping[str, Any],
    rate: float | None,
) -> dict[str, object]:
    """Return the parameters that arguments of :func:`add_errors` give, by dotted name.

    :raises ConfigurationError: with a line for each argument that is not what it must be.
    """
    given: dict[str, object] = {}
    if params_file is not None:
        given |= files.load(arguments.path("params_file", params_file), NODE)
    of_sensor = imu_parameters(imu)
    of_sensor.pop("rate", None)  # readings have one of their own
    given |= {**of_sensor, **flat_parameters("parameters", parameters)}
    if input is not None:
        if not isinstance(input, Mapping):
            refuse("input", input, "parameters by name", wrong_type=True)
        own = flat_parameters("input", input)
        given |= {f"input.{name}": value for name, value in own.items()}
    if seed is not None:
        given["seed"] = seed
    if rate is not None:
        given["rate"] = rate
    return given


def with_rate(layers: Mapping[str, object], rate: Callable[[], float]) -> ErrorModelParameters:
    """Return an error model with the rate of the readings, unless layers give one.

    :param rate: returns the rate of the readings [Hz].
    :raises ConfigurationError: with a line for each problem.
    """
    given = "rate" in layers or layers.get("input.rate")
    return load_error_model(layers if given else {**layers, "rate": rate()})


def rate_of(t_ns: Integers) -> float:
    """Return the readings per second of stamps, rounded to six digits [Hz].

    Gaps are not counted: an interval much longer than most counts as several.

    :raises ConfigurationError: for fewer than two stamps that follow each other.
    """
    steps = np.diff(t_ns)
    steps = steps[steps > 0]
    if not len(steps):
        raise ConfigurationError("rate: two readings, or the rate, must be given")
    whole = np.maximum(np.rint(steps / float(np.median(steps))), 1.0)
    found = float(f"{whole.sum() / steps.sum() * timebase.NANOSECONDS_PER_SECOND:.6g}")
    nearest = float(round(found))
    return nearest if nearest and abs(found - nearest) < 2e-5 * nearest else found


def _sensor_name(imu: object, built: ErrorModelParameters) -> str:
    changed = isinstance(imu, Mapping) and set(imu) - {"preset"}
    return f"{'modified ' if changed else ''}{Path(built.imu.preset).stem}"
