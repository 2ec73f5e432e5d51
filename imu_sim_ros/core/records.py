# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings of an IMU and states of a body: of a recording as arrays, live one by one as numbers.

Bags, tables, datasets, logs and arrays become one of these records, which are checked once, when
they are made. Columns that a source lacks are None, never zeros.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from dataclasses import KW_ONLY, MISSING, dataclass, field, fields
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core import gate
from imu_sim_ros.core.arguments import array, integer, number, refuse, stamps, string_list, text
from imu_sim_ros.core.components import Quaternion, Vector
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import InputError, MissingDependencyError
from imu_sim_ros.core.memory import join
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.timebase import describe_span, seconds_since
from imu_sim_ros.core.types import AnyArray, Array, Integers, Keywords, Mask, Times

if TYPE_CHECKING:
    from typing_extensions import Self

Rows = slice | Mask | NDArray[np.intp]
"""Selection of rows: a slice, a mask (n,) or indices (m,)."""
SeriesT = TypeVar("SeriesT", bound="TimeSeries")
MOST_ROWS: Final = 2**62
"""Largest count of rows."""


class RecordColumn(NamedTuple):
    """Array of a record with a row for each stamp."""

    shape: tuple[int, ...]
    """Shape of a row."""
    quantity: gate.Quantity | None
    """Quantity that the gate checks; None: any finite numbers."""
    prefix: str | None
    """Prefix of the column's names in a data frame; None: the name of the field."""


def column(
    shape: tuple[int, ...], quantity: gate.Quantity | None, prefix: str | None = None
) -> Mapping[str, RecordColumn]:
    """Return the metadata of a column of a record.

    :param shape: shape of a row: ``(3,)`` for a vector, ``()`` for a number.
    :param quantity: quantity that the gate checks; None: any finite numbers.
    :param prefix: prefix of the column's names in a data frame; None: the name of the field.
    """
    return {"column": RecordColumn(shape, quantity, prefix)}


@dataclass(frozen=True, repr=False, eq=False)
class TimeSeries:
    """n rows over time, as they were recorded; the base of :class:`Readings` and :class:`States`.

    Stamps keep the order of the source, which need not increase.
    """

    t_ns: Times
    """(n,) stamps [ns]."""

    def __post_init__(self) -> None:
        """Check type, shape and range of every column; lists become arrays.

        :raises ConfigurationError: for another type or shape.
        :raises InputError: for a value that no sensor measures and no body reaches, with its row.
        """
        source = text("source", self.source, "a name")
        default = {entry.name: entry.default for entry in fields(self)}["source"]
        prefix = "" if source == default else f"{source}."
        columns: dict[str, AnyArray] = {"t_ns": stamps(f"{prefix}t_ns", self.t_ns)}
        quantities: list[tuple[gate.Quantity, Array]] = []
        field_values = _values(self)
        for name, declaration in self.columns().items():
            values = field_values[name]
            if values is None:
                continue
            quantity = declaration.quantity
            shape = (len(columns["t_ns"]), *declaration.shape)
            if name.endswith("t_ns"):
                columns[name] = stamps(f"{prefix}{name}", values)
                continue
            columns[name] = array(f"{prefix}{name}", values, shape, finite=quantity is None)
            if quantity is not None:
                quantities.append((quantity, columns[name]))
        if self.lines is not None:
            columns["lines"] = stamps(f"{prefix}lines", self.lines)
        for name, value in field_values.items():
            if name.endswith("frame_id"):
                text(f"{prefix}{name}", value, "a name", empty=True)
            elif name in ("skipped", "repeated"):
                integer(f"{prefix}{name}", value, "a count of rows", 0, MOST_ROWS)
            elif name == "notes":
                string_list(f"{prefix}{name}", value)
        self._check(gate.Verdict(columns["t_ns"], quantities), source)
        for name, values in columns.items():
            object.__setattr__(self, name, values)  # frozen

    def _check(self, verdict: gate.Verdict, source: str) -> None:
        """Raise for rows that the gate refuses.

        :raises InputError: with a line for each of the first rows.
        """
        verdict.complain(source)

    if TYPE_CHECKING:

        @property
        def source(self) -> str:
            """Name of the file, topic or sensor."""

        @property
        def lines(self) -> Integers | None:
            """(n,) lines of the text file, from 1; None: the source is no text."""

    @classmethod
    def columns(cls) -> dict[str, RecordColumn]:
        """Return the columns next to the stamps, by name."""
        return {
            entry.name: entry.metadata["column"]
            for entry in fields(cls)
            if "column" in entry.metadata
        }

    @property
    def t(self) -> Array:
        """(n,) times after the first stamp [s]."""
        return seconds_since(self.t_ns, int(self.t_ns[0]) if len(self.t_ns) else 0)

    def __len__(self) -> int:
        return len(self.t_ns)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.source}: {describe_span(self.t_ns)}>"

    def rows(self, selection: Rows) -> Self:
        """Return a record of some rows.

        :param selection: a slice, a mask (n,) or indices (m,).
        :raises ConfigurationError: for anything else, and for rows that there are not.
        """
        values = _values(self)
        try:
            for name in _fields_of(type(self)).arrays:
                if values[name] is not None:
                    values[name] = values[name][selection]
            refused = values["t_ns"].ndim != 1
        except (IndexError, TypeError, ValueError):
            refused = True
        if refused:
            refuse("selection", selection, "a slice, a mask (n,) or indices (m,)")
        return _record(type(self), values)

    @classmethod
    def unchecked(cls, **columns: Any) -> Self:
        """Return a record of arrays that this package computed, which are not checked.

        :param columns: fields by name; the defaults of the class for all others.
        """
        names, _, defaults = _fields_of(cls)
        values = defaults | columns
        if values.keys() != names:
            raise TypeError(f"{cls.__name__} has {', '.join(names)}: {', '.join(columns)}")
        return _record(cls, values)

    def between(self, t0: float, t1: float) -> Self:
        """Return the rows from time ``t0`` on and before ``t1``.

        :param t0: first time after the first stamp [s].
        :param t1: end, a time after the first stamp [s].
        :raises ConfigurationError: for anything but finite numbers.
        """
        number("t0", t0, "a number of seconds")
        number("t1", t1, "a number of seconds")
        return self.rows((self.t >= t0) & (self.t < t1))

    def to_frame(self) -> Any:
        """Return a pandas DataFrame: index t_ns, a column for each component of each column.

        :raises MissingDependencyError: without pandas.
        """
        return data_frame(self.t_ns, self._frame_columns())

    def _frame_columns(self) -> dict[str, Array]:
        """Return the columns of :meth:`to_frame` (n,) or (n, k) by name."""
        values = _values(self)
        return {
            declaration.prefix or name: values[name]
            for name, declaration in self.columns().items()
            if values[name] is not None and len(declaration.shape) < 2
        }


@dataclass(frozen=True, repr=False, eq=False)
class Readings(TimeSeries):
    """n readings of one IMU, in the order in which they were delivered.

    The axes are those of the IMU, forward-left-up when it is mounted level.
    """

    gyro: Array | None = field(metadata=column((3,), gate.RATE))
    """(n, 3) angular rates [rad/s]; None: the source has no gyroscope."""
    accel: Array | None = field(metadata=column((3,), gate.FORCE))
    """(n, 3) specific forces [m/s^2], +9.81 on z when level and at rest; None: no accelerometer."""
    source: str = "readings"
    """Name of the file, topic or sensor."""
    _: KW_ONLY
    temperature: Array | None = field(default=None, metadata=column((), gate.SENSOR_TEMPERATURE))
    """(n,) temperature of the sensor [degC]; NaN: the row has none."""
    q_wb: Array | None = field(default=None, metadata=column((4,), gate.ORIENTATION, "q"))
    """(n, 4) orientation that the IMU itself reports, unit quaternions (w, x, y, z)."""
    frame_id: str = ""
    """Name of the IMU's frame; empty: unknown."""
    lines: Integers | None = None
    """(n,) lines of the text file, from 1; None: the source is no text."""
    skipped: int = 0
    """Number of bad rows of the source that were left out on request."""
    notes: tuple[str, ...] = ()
    """Choices and conversions of reading: topics, frame, units; a line each."""

    def triads(self) -> tuple[Array, Array]:
        """Return the angular rates and the specific forces (n, 3), for work that needs both.

        :raises InputError: if the source lacks one of them.
        """
        if self.gyro is None or self.accel is None:
            raise InputError(
                absent_triad_line(self.source, triad)
                for triad, values in zip(TRIADS, (self.gyro, self.accel), strict=True)
                if values is None
            )
        return self.gyro, self.accel


def absent_triad_line(source: str, triad: str) -> str:
    """Return the line about a source without the readings of a triad that a job needs."""
    names = f"{argument('gyro_topic')} and {argument('accel_topic')}"
    return (
        f"{source}: contains no readings of the {triad}; {names} merge two topics [{triad}_absent]"
    )


@dataclass(frozen=True, repr=False, eq=False)
class States(TimeSeries):
    """n poses of one body over time, with velocities and covariances where the source has them.

    Rounded quaternions get length 1.
    """

    role: ClassVar[Literal["", "truth", "estimate"]] = ""
    """Truth of a simulation or estimate of it; empty: unknown."""

    position: Array = field(metadata=column((3,), gate.POSITION))
    """(n, 3) p_wb [m]."""
    q_wb: Array = field(metadata=column((4,), gate.ORIENTATION, "q"))
    """(n, 4) unit quaternions (w, x, y, z)."""
    velocity: Array | None = field(default=None, metadata=column((3,), gate.VELOCITY))
    """(n, 3) velocity of the body in the world [m/s]."""
    angular_velocity: Array | None = field(default=None, metadata=column((3,), gate.RATE))
    """(n, 3) angular rate of the body, in the body frame [rad/s]."""
    source: str = "states"
    """Name of the file, topic or sensor."""
    _: KW_ONLY
    covariance: Array | None = field(default=None, metadata=column((6, 6), None))
    """(n, 6, 6) covariance of position [m] and of rotation about the world's axes [rad]."""
    twist_covariance: Array | None = field(default=None, metadata=column((6, 6), None))
    """(n, 6, 6) covariance of velocity [m/s] and angular rate [rad/s], in the body frame."""
    frame_id: str = ""
    """Name of the world's frame; empty: unknown."""
    child_frame_id: str = ""
    """Name of the body's frame; empty: unknown."""
    lines: Integers | None = None
    """(n,) lines of the text file, from 1; None: the source is no text."""
    skipped: int = 0
    """Number of bad rows of the source that were left out on request."""
    repeated: int = 0
    """Number of poses that the source states twice with the same stamp, and that are here once."""

    def __post_init__(self) -> None:
        """Check every column; arguments and errors as for :class:`TimeSeries`."""
        for name, values, width in (("position", self.position, 3), ("q_wb", self.q_wb, 4)):
            if values is None:
                refuse(name, None, f"an array (n, {width})", wrong_type=True)
        super().__post_init__()
        object.__setattr__(self, "q_wb", gate.normalise_quaternions(self.q_wb))

    def velocities(self) -> Array:
        """Return the velocities (n, 3) in the world [m/s], for work that needs them.

        :raises InputError: if the source has none.
        """
        if self.velocity is None:
            raise InputError(f"{self.source}: contains no velocities")
        return self.velocity

    def body_rates(self) -> Array:
        """Return the angular rates (n, 3) in the body frame [rad/s], for work that needs them.

        :raises InputError: if the source has none.
        """
        if self.angular_velocity is None:
            raise InputError(f"{self.source}: contains no angular rates")
        return self.angular_velocity

    def in_order(self) -> Self:
        """Return these states if their stamps increase strictly.

        :raises InputError: with the number of stamps that do not, and the first of them.
        """
        problems = gate.disorder(self.source, self.t_ns)
        if problems:
            raise InputError(problems)
        return self


class LiveReading(NamedTuple):
    """One reading of an IMU as it arrives: a row of :class:`Readings` in numbers.

    A live node has it instead of a record, since NumPy is slow for arrays of one row.
    """

    t_ns: int
    """Stamp [ns]."""
    gyro: Vector[float]
    """Angular rate [rad/s]."""
    accel: Vector[float]
    """Specific force [m/s^2]."""
    q_wb: Quaternion[float] | None = None
    """Orientation that the IMU itself reports (w, x, y, z); None: it has none, or it is not used.
    """


class LiveValue(NamedTuple):
    """Measurement of another sensor of an IMU as it arrives, such as a magnetometer's."""

    t_ns: int
    """Stamp [ns]."""
    components: tuple[float, ...]
    """Components of the measurement, one for a scalar, in its SI unit."""


class LiveState(NamedTuple):
    """State of a body at one time, as it arrives or leaves: a row of :class:`States` in numbers.

    Velocity and rate are in the body frame, as in a nav_msgs/Odometry.
    """

    t_ns: int
    """Stamp [ns]."""
    position: Vector[float]
    """p_wb [m]."""
    q_wb: Quaternion[float]
    """Unit quaternion (w, x, y, z)."""
    velocity_b: Vector[float]
    """Velocity of the body relative to the world, in the body frame [m/s]."""
    angular_velocity_b: Vector[float]
    """Angular rate of the body relative to the world, in the body frame [rad/s]."""
    covariance: Array | None = None
    """(6, 6) covariance of position [m] and of rotation about the world's axes [rad]."""
    twist_covariance: Array | None = None
    """(6, 6) covariance of velocity [m/s] and angular rate [rad/s], in the body frame."""
    frames: tuple[str, ...] = ("", "")
    """Names of the world's and of the body's frame; empty: unknown."""


Odometry = States
PoseSequence = States
"""Names of :class:`States` in releases before 2.0."""


class _Fields(NamedTuple):
    """Fields of a class of records."""

    names: Set[str]
    arrays: tuple[str, ...]
    """Fields that have a row for each stamp."""
    defaults: Keywords


_FIELDS: Final[dict[type[TimeSeries], _Fields]] = {}


def _fields_of(cls: type[TimeSeries]) -> _Fields:
    """Return the fields of a record class: names, defaults, arrays; computed once per class."""
    record_fields = _FIELDS.get(cls)
    if record_fields is None:
        entries = fields(cls)
        defaults = {entry.name: entry.default for entry in entries if entry.default is not MISSING}
        arrays = ("t_ns", *cls.columns(), "lines")
        record_fields = _FIELDS[cls] = _Fields({entry.name for entry in entries}, arrays, defaults)
    return record_fields


def _values(record: TimeSeries) -> Keywords:
    """Return the values of a record's fields by name."""
    values, names = record.__dict__, _fields_of(type(record)).names
    if len(values) == len(names):
        return dict(values)
    return {name: values[name] for name in names}  # without cached properties


def _record(cls: type[SeriesT], values: Mapping[str, object]) -> SeriesT:
    """Return a record of values by the names of the fields, which are not checked."""
    record = object.__new__(cls)
    record.__dict__.update(values)  # frozen
    return record


def replace_fields(record: SeriesT, **changes: Any) -> SeriesT:
    """Return a record with other texts, or with columns that this package computed, unchecked.

    :param changes: fields by name.
    """
    return type(record).unchecked(**(_values(record) | changes))


def concatenate(records: Iterable[SeriesT]) -> SeriesT:
    """Return consecutive blocks of one source as one record; columns that one block lacks are None.

    Of an iterator's blocks each column is free as soon as it is joined.

    :param records: one or more blocks; texts are those of the first.
    """
    remaining = iter(records)
    head = next(remaining)
    blocks = [_values(head), *map(_values, remaining)]
    if len(blocks) == 1:
        return head
    values = _values(head)
    for name in _fields_of(type(head)).arrays:
        parts = [block.pop(name) for block in blocks]
        values[name] = None if any(part is None for part in parts) else join(parts)
        del parts
    return _record(type(head), values)


def data_frame(t_ns: Times, columns: Mapping[str, Array]) -> Any:
    """Return arrays (n,), (n, 3) and (n, 4) as a pandas DataFrame with a column per component.

    :param t_ns: (n,) stamps [ns], the index.
    :raises MissingDependencyError: without pandas.
    """
    try:
        import pandas
    except ImportError:
        raise MissingDependencyError(
            "to_frame() needs pandas: apt install python3-pandas, or pip install pandas"
        ) from None
    data: dict[str, Array] = {}
    for name, values in columns.items():
        if values.ndim == 1:
            data[name] = values
        else:
            letters = "wxyz" if values.shape[1] == 4 else "xyz"
            data.update({f"{name}_{letter}": values[:, k] for k, letter in enumerate(letters)})
    return pandas.DataFrame(data, index=pandas.Index(t_ns, name="t_ns"))
