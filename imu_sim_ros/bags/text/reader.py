# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""IMU readings and states of text: EuRoC folders, and CSV in the forms of EuRoC and kalibr."""

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from imu_sim_ros.bags.logs.catalogue import is_log
from imu_sim_ros.bags.text import vio_data_simulation
from imu_sim_ros.bags.text.writer import POSES_OF_TABLES, TEXT_SUFFIXES
from imu_sim_ros.core import gate
from imu_sim_ros.core.bad_rows import STAMPS, Skipped
from imu_sim_ros.core.errors import InputError, Remark
from imu_sim_ros.core.records import Readings, States
from imu_sim_ros.core.rotation import normalise
from imu_sim_ros.core.types import Array, Mask, Times
from imu_sim_ros.inputs import header
from imu_sim_ros.inputs.layout import TableForm, TableLayout, layout_of
from imu_sim_ros.inputs.row_reader import NumberRows, RowReader
from imu_sim_ros.inputs.rows import Row, is_present, names_in, row_blocks
from imu_sim_ros.inputs.tables import Table, Tables
from imu_sim_ros.recordings.order import RESET_READINGS, RESTART_NS

_WHAT: Final = "a table of numbers"
_EARLIEST: Final = -(2**63) + 1
"""Stamp before all others [ns]."""
_READING: Final = {header.GYRO: gate.RATE, header.ACCEL: gate.FORCE}
_WITH_READING: Final = {header.TEMPERATURE: gate.SENSOR_TEMPERATURE}
_STATE: Final = {
    header.POSITION: gate.POSITION,
    header.ORIENTATION: gate.ORIENTATION,
    header.VELOCITY: gate.VELOCITY,
    header.GYRO_BIAS: gate.RATE,
    header.ACCEL_BIAS: gate.FORCE,
}
_VALUES: Final = "values"
"""Columns of a table of another sensor, whose own header is that of this package."""
_STATE_FOLDER: Final = "state_groundtruth_estimate0"
_POSE_FOLDER: Final = "mocap0"
_POSE_FILES: Final = (
    POSES_OF_TABLES,
    *("groundtruth.txt", "gt_imu.csv", "registered_poses.csv", "ground_truth/registered_poses.csv"),
)
"""Tables of poses next to those of readings: of this package, UZH-FPV, TUM VI, Newer College."""
_TEXT_TABLES: Final = ("imu.txt", "imu_data.txt")
"""Tables of readings that do not end in .csv: of UZH-FPV, TUM VI."""


def is_text(path: Path) -> bool:
    """Return whether a path is a text file, or a folder of EuRoC, kalibr or vio_data_simulation."""
    if path.is_dir():
        tables = _tables(path, "imu") or _table(path, _STATE_FOLDER) is not None
        tables = tables or any((path / name).is_file() for name in _POSE_FILES[1:])
        return bool(tables) or vio_data_simulation.is_source(path)
    return path.suffix.lower() in TEXT_SUFFIXES and path.is_file() and not is_log(path)


def imu_blocks(
    path: Path, name: str | None = None, skipped: Skipped | None = None
) -> Iterator[Readings]:
    """Yield the readings of a table, or of the IMU of a folder, in blocks.

    Stamps may go back, as on a topic of a bag: late and stray ones and resets are findings.

    :param name: name of the sensor, if a folder has several: imu0, imu1.
    :param skipped: receives the number of bad rows skipped; None: they are errors.
    :raises InputError: with the first lines of every class of bad rows, at the end of the file.
    """
    if vio_data_simulation.is_source(path):
        yield vio_data_simulation.read_readings(path, skipped)
        return
    table = _Table(imu_file(path, name), _READING, ordered=False, additional=_WITH_READING)
    for t_ns, values in table.read(skipped):
        yield Readings.unchecked(
            t_ns=t_ns,
            gyro=values.get(header.GYRO),
            accel=values.get(header.ACCEL),
            temperature=values.get(header.TEMPERATURE),
            source=str(path),
            notes=table.notes,
        )


def units_of_header(path: Path, name: str | None = None) -> dict[str, str]:
    """Return the units of the readings that the header of a table states, by quantity.

    :param name: as for :func:`imu_blocks`.
    """
    file = imu_file(path, name)
    table = _Table(file, _READING)
    for rows in row_blocks(file, _WHAT, table.comments):
        if rows:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", Remark)  # told when the readings are read
                return dict(table.layout_of(rows).units)
    return {}


def table_blocks(
    path: Path, name: str, table: Table, skipped: Skipped | None = None
) -> Iterator[tuple[Times, Array]]:
    """Yield stamps (n,) and values (n, m) of a table other than the readings of an IMU, in blocks.

    :param name: name with the number of the IMU, as :func:`table_names` gives it: mag0.
    :param skipped: as for :func:`imu_blocks`.
    :raises InputError: for a folder that has no such table, and bad rows.
    """
    tables_by_name = _tables_in(path, {table.name: table})
    if name not in tables_by_name:
        raise InputError(f"{path}: has no table {name}")
    form = {_VALUES: tuple(range(1, table.columns + 1))}
    for t_ns, values in _Table(tables_by_name[name][1], {_VALUES: table.quantity}, form).read(
        skipped
    ):
        yield t_ns, values[_VALUES]


def table_names(path: Path, tables: Tables) -> dict[str, str]:
    """Return the kind of each table of a sensor in a folder by its name; empty for a file.

    The second magnetometer's table is ``mag1``, its kind ``mag``.

    :param tables: kinds of tables that are looked for.
    """
    return {name: kind for name, (kind, _) in _tables_in(path, tables).items()}


def state_file(path: Path) -> Path:
    """Return the file of the states in a EuRoC folder.

    :raises InputError: if there is none.
    """
    if vio_data_simulation.is_source(path):
        return vio_data_simulation.truth_file(path)
    table = _table(path, _STATE_FOLDER) if path.is_dir() else path
    if table is None:
        raise InputError(f"{path}: has no {_STATE_FOLDER}/data.csv")
    return table


def state_blocks(
    path: Path, topic: str | None = None, skipped: Skipped | None = None
) -> Iterator[tuple[States, Array]]:
    """Yield the states of a EuRoC folder, or of its file, and the biases (n, 6), in blocks.

    :param skipped: as for :func:`imu_blocks`.
    """
    if topic is not None:
        raise InputError(f"{path}: text has no topic {topic}")
    if vio_data_simulation.is_source(path):
        states = vio_data_simulation.read_states(state_file(path), skipped)
        yield states, np.zeros((len(states), 6))
        return
    for t_ns, values in _Table(state_file(path), _STATE, ordered=False).read(skipped):
        zero = np.zeros((len(t_ns), 3))
        biases = [values.get(name, zero) for name in (header.GYRO_BIAS, header.ACCEL_BIAS)]
        states = States.unchecked(
            t_ns=t_ns,
            position=values[header.POSITION],
            q_wb=normalise(values[header.ORIENTATION]),
            velocity=values.get(header.VELOCITY),
            source=str(path),
        )
        yield states, np.concatenate(biases, axis=1)


def has_states(path: Path) -> bool:
    """Return whether a folder, or a file of readings, has states in addition to its readings."""
    if path.is_dir() and _table(path, _STATE_FOLDER) is not None:
        return True
    return vio_data_simulation.has_states(path)


def pose_file(path: Path) -> Path | None:
    """Return a folder's file of poses; None if it has none.

    Those that a motion capture system saw (TUM VI), or the true ones next to tables of readings.
    """
    if not path.is_dir():
        return None
    files = (path / name for name in _POSE_FILES)
    return _table(path, _POSE_FOLDER) or next(filter(is_present, files), None)


def imu_names(path: Path) -> list[str]:
    """Return the names of the IMUs of a folder: imu0, imu1; none of a file."""
    return sorted(_tables(path, "imu")) if path.is_dir() else []


def imu_file(path: Path, name: str | None) -> Path:
    """Return the file of the readings of a folder's IMU, imu0 or the only one.

    :raises InputError: if there is none of the name, or several.
    """
    if vio_data_simulation.is_source(path) and name is None:
        return vio_data_simulation.readings_file(path)
    if not path.is_dir():
        return path
    tables_by_name = _tables(path, "imu")
    if name is not None:
        if name not in tables_by_name:
            raise InputError(
                f"{path}: has no sensor {name}; it has {', '.join(tables_by_name) or 'none'}"
            )
        return tables_by_name[name]
    if len(tables_by_name) != 1:
        problem = (
            f"several, name one of {', '.join(tables_by_name)}" if tables_by_name else "no imu0"
        )
        raise InputError(f"{path}: IMU data: {problem}")
    return next(iter(tables_by_name.values()))


def _tables_in(path: Path, kinds: Tables) -> dict[str, tuple[str, Path]]:
    """Return kind and file of tables other than the readings of IMUs, by name: a kind, a number."""
    return {
        name: (kind, file)
        for kind in (kinds if path.is_dir() else ())
        for name, file in _tables(path, kind).items()
        if name.removeprefix(kind).isdigit()
    }


def _tables(folder: Path, kind: str) -> dict[str, Path]:
    """Return tables of a kind by name: imu0/data.csv (EuRoC) or imu0.csv (kalibr)."""
    tables_by_name: dict[str, Path] = {}
    for parent in parents(folder):
        files = [(name, parent / name / "data.csv") for name in sensor_folders(parent, kind)]
        plain = (
            parent / name
            for name in names_in(parent)
            if name.endswith(".csv") or name in _TEXT_TABLES
        )
        files += [(file.stem, file) for file in plain if file.name.startswith(kind)]
        for name, file in files:
            if name not in tables_by_name and is_present(file):
                tables_by_name[name] = file
    return tables_by_name


def sensor_folders(parent: Path, kind: str) -> list[str]:
    """Return the names of sensors' folders of a kind: cam0, cam1.

    What is called like a sensor is one, also if it is no folder, which is an error later.
    """
    names = [name for name in names_in(parent) if name.startswith(kind)]
    return [n for n in names if n.removeprefix(kind).isdigit() or (parent / n).is_dir()]


def _table(folder: Path, name: str) -> Path | None:
    """Return the table of a sensor's folder, if there is one."""
    for parent in parents(folder):
        file = parent / name / "data.csv"
        if is_present(file):
            return file
    return None


def parents(folder: Path) -> tuple[Path, Path]:
    """Return the folders in which the sensors of a dataset may be: its own, or mav0 in it."""
    return folder, folder / "mav0"


_Quantities = Mapping[str, gate.Quantity]
"""Quantities of a table by name."""


class _Table(RowReader):
    """A text table of measurements."""

    def __init__(
        self,
        path: Path,
        quantities: _Quantities,
        form: Mapping[str, tuple[int, ...]] | None = None,
        ordered: bool = True,
        additional: _Quantities = MappingProxyType({}),
    ) -> None:
        """Initialise without rows.

        :param form: columns of a table whose header is not looked at; None: the header decides, and
            without one the order of the quantities.
        :param ordered: True: a row whose stamp is before that of an earlier row is a bad row.
        :param additional: quantities that a header may have besides ``quantities``.
        """
        self._quantities, self._form, self._ordered = quantities, form, ordered
        self._columns = {**quantities, **additional}
        super().__init__(path, _WHAT, self._columns)
        self._last_ns = _EARLIEST
        self._is_reset = False
        """True behind a reset of the clock, which is told once."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Line about the units that are converted because the header states them."""
        return () if self.layout is None else self.layout.notes

    def read(self, skipped: Skipped | None) -> Iterator[tuple[Times, dict[str, Array]]]:
        """Yield stamps (n,) and the quantities (n, m) that the table has, in blocks.

        :param skipped: receives the number of bad rows skipped; None: they are errors.
        :raises InputError: for a file of another form, and at its end with the first lines of every
            class of bad rows.
        """
        count = 0
        for block in self.blocks():
            pieces = [piece for piece in map(self._good_rows, block) if len(piece.t_ns)]
            if not pieces:
                continue
            _, times, columns = zip(*pieces, strict=True)
            t_ns: Times = np.concatenate(times)
            count += len(t_ns)
            yield (
                t_ns,
                {name: np.concatenate([values[name] for values in columns]) for name in columns[0]},
            )
        if skipped is None:
            self.bad.complain()
        elif self.bad.rows:
            skipped(self.bad.rows)
        if not count:
            raise InputError(
                f"{self.path}: contains no {'usable rows' if self.bad.rows else 'rows'}"
            )

    def layout_of(self, rows: list[Row]) -> TableLayout:
        """Return the layout of the table, and remove its header from its first rows."""
        columns, column = dict(self._form or {}), 1
        for name in () if columns else self._quantities:
            columns[name] = tuple(range(column, column + len(header.AXES_OF[name])))
            column += len(columns[name])
        numbers = sum(map(len, columns.values()))
        form = TableForm(columns, (numbers + 1,), 0, f"expected nanoseconds and {numbers} numbers")
        needed = [] if self._form else list(self._quantities)
        return layout_of(self.path, self.comments, rows, {",": form}, needed)

    def _good_rows(self, rows: NumberRows) -> NumberRows:
        """Return the rows that pass; note the problems of the others."""
        lines, t_ns, values = rows
        good = self._good(lines, t_ns, values)
        if good.all():
            return rows
        passed = {name: column[good] for name, column in values.items()}
        return NumberRows(lines[good], t_ns[good], passed)

    def _good(self, lines: Times, t_ns: Times, values: Mapping[str, Array]) -> Mask:
        """Return True for rows that the gate passes, and in order if the table must be in order."""
        verdict = gate.Verdict(t_ns, [(self._columns[name], v) for name, v in values.items()])
        verdict.note(self.bad, lines)
        good = verdict.good
        if self._ordered:
            good = good & ~self._earlier(lines, t_ns, good)
        self.bad.good += int(np.count_nonzero(good))
        return good

    def _earlier(self, lines: Times, t_ns: Times, good: Mask) -> Mask:
        """Return True for good rows whose stamps are before one of an earlier row; note them.

        Measurements that the transport duplicated occur twice: equal stamps are valid.
        """
        latest = np.maximum.accumulate(np.where(good, t_ns, _EARLIEST))
        latest = np.maximum(latest, self._last_ns)
        back: Mask = good & (t_ns < latest)
        for k in np.flatnonzero(back):
            step = (int(latest[k]) - int(t_ns[k])) * 1e-9
            run = slice(k, k + RESET_READINGS)
            is_reset = (
                step * 1e9 > RESTART_NS and back[run].all() and (np.diff(t_ns[run]) > 0).all()
            )
            if not self._is_reset:
                self.bad.note(
                    STAMPS,
                    int(lines[k]),
                    f"the clock goes back by {step:.9g} s and on from there; cut the table there, "
                    "and treat the parts as recordings of their own"
                    if is_reset
                    else f"the stamp is {step:.9g} s before that of an earlier line",
                )
            self._is_reset = self._is_reset or bool(is_reset)
        self._last_ns = int(latest[-1])
        self.bad.rows += int(np.count_nonzero(back))
        return back
