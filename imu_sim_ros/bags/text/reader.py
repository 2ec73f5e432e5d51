# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""IMU readings and states of text: EuRoC folders, and CSV in the forms of EuRoC and kalibr."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.text.writer import DATASET_SUFFIXES, POSES_OF_TABLES
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs import gate
from imu_sim_ros.inputs.rows import (
    COLUMNS,
    NUMBERS,
    STAMPS,
    BadRows,
    Row,
    Skipped,
    is_present,
    names_in,
    number_of,
    row_blocks,
    shortened,
)
from imu_sim_ros.inputs.tables import Table, Tables
from imu_sim_ros.records import States
from imu_sim_ros.rotation import normalise
from imu_sim_ros.types import Array, Mask, Times

_WHAT: Final = "a table of numbers"
_STAMP: Final = re.compile(r"[+-]?[0-9]{1,19}")
_EARLIEST: Final = -(2**63) + 1
_READING: Final = ((gate.RATE, 3), (gate.FORCE, 3))
_STATE: Final = (
    *((gate.POSITION, 3), (gate.ORIENTATION, 4), (gate.VELOCITY, 3)),
    *((gate.RATE, 3), (gate.FORCE, 3)),  # the biases
)
_STATE_FOLDER: Final = "state_groundtruth_estimate0"
_POSE_FOLDER: Final = "mocap0"


def is_text(path: Path) -> bool:
    """Return whether a path is a EuRoC folder, a folder of kalibr's CSV files, or a text file."""
    if path.is_dir():
        return bool(_tables(path, "imu")) or _table(path, _STATE_FOLDER) is not None
    return path.suffix.lower() in DATASET_SUFFIXES and path.is_file()


def imu_blocks(
    path: Path, name: str | None = None, skipped: Skipped | None = None
) -> Iterator[tuple[Times, Array, Array]]:
    """Yield stamps (n,), angular rates (n, 3) and specific forces (n, 3) in blocks.

    :param name: of the sensor, if a folder has several: imu0, imu1.
    :param skipped: receives the number of bad rows skipped; None: they are errors.
    :raises InputError: with the first lines of every class of bad rows, at the end of the file.
    """
    for t_ns, numbers in _blocks(imu_file(path, name), _READING, skipped):
        yield t_ns, numbers[:, :3], numbers[:, 3:]


def table_blocks(
    path: Path, name: str, table: Table, skipped: Skipped | None = None
) -> Iterator[tuple[Times, Array]]:
    """Yield stamps (n,) and values (n, m) of a table other than the readings of an IMU, in blocks.

    :param name: with the number of the IMU, as :func:`beside_names` gives it: mag0.
    :param skipped: as for :func:`imu_blocks`.
    :raises InputError: for a folder that has no such table, and bad rows.
    """
    found = _tables_in(path, {table.name: table})
    if name not in found:
        raise InputError(f"{path}: has no table {name}")
    yield from _blocks(found[name][1], ((table.quantity, table.columns),), skipped)


def table_names(path: Path, tables: Tables) -> dict[str, str]:
    """Return those of the known tables that a folder has, mag0 and so on, each with its kind.

    None of a file.
    """
    return {name: kind for name, (kind, _) in _tables_in(path, tables).items()}


def state_file(path: Path) -> Path:
    """Return the file of the states in a EuRoC folder.

    :raises InputError: if there is none.
    """
    found = _table(path, _STATE_FOLDER) if path.is_dir() else path
    if found is None:
        raise InputError(f"{path}: has no {_STATE_FOLDER}/data.csv")
    return found


def state_blocks(
    path: Path, topic: str | None = None, skipped: Skipped | None = None
) -> Iterator[tuple[States, Array]]:
    """Yield the states of a EuRoC folder, or of its file, and the biases (n, 6), in blocks.

    :param skipped: as for :func:`imu_blocks`.
    """
    if topic is not None:
        raise InputError(f"{path}: text has no topic {topic}")
    for t_ns, numbers in _blocks(state_file(path), _STATE, skipped):
        q_wb = normalise(numbers[:, 3:7])
        states = States.unchecked(
            t_ns=t_ns,
            position=numbers[:, :3],
            q_wb=q_wb,
            velocity=numbers[:, 7:10],
            source=str(path),
        )
        yield states, numbers[:, 10:]


def has_states(path: Path) -> bool:
    """Return whether a folder has states in addition to its readings."""
    return path.is_dir() and _table(path, _STATE_FOLDER) is not None


def pose_file(path: Path) -> Path | None:
    """Return a folder's file of poses; None if it has none.

    Those that a motion capture system saw (TUM VI), or the true ones next to kalibr's tables.
    """
    if not path.is_dir():
        return None
    table, own = _table(path, _POSE_FOLDER), path / POSES_OF_TABLES
    return own if table is None and is_present(own) else table


def imu_names(path: Path) -> list[str]:
    """Return the names of the IMUs of a folder: imu0, imu1; none of a file."""
    return sorted(_tables(path, "imu")) if path.is_dir() else []


def imu_file(path: Path, name: str | None) -> Path:
    """Return the file of the readings of a folder's IMU, imu0 or the only one.

    :raises InputError: if there is none of the name, or several.
    """
    if not path.is_dir():
        return path
    found = _tables(path, "imu")
    if name is not None:
        if name not in found:
            raise InputError(f"{path}: has no sensor {name}; it has {', '.join(found) or 'none'}")
        return found[name]
    if len(found) != 1:
        words = f"several, name one of {', '.join(found)}" if found else "no imu0"
        raise InputError(f"{path}: IMU data: {words}")
    return next(iter(found.values()))


def _tables_in(path: Path, known: Tables) -> dict[str, tuple[str, Path]]:
    """Return kind and file of tables other than the readings of IMUs, by name: a kind, a number."""
    return {
        name: (kind, file)
        for kind in (known if path.is_dir() else ())
        for name, file in _tables(path, kind).items()
        if name.removeprefix(kind).isdigit()
    }


def _tables(folder: Path, kind: str) -> dict[str, Path]:
    """Return tables of a kind by name: imu0/data.csv (EuRoC) or imu0.csv (kalibr)."""
    found: dict[str, Path] = {}
    for parent in parents(folder):
        files = [(name, parent / name / "data.csv") for name in sensor_folders(parent, kind)]
        plain = (parent / name for name in names_in(parent) if name.endswith(".csv"))
        files += [(file.stem, file) for file in plain if file.name.startswith(kind)]
        for name, file in files:
            if name not in found and is_present(file):
                found[name] = file
    return found


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


_Columns = Sequence[tuple[gate.Quantity, int]]


def _blocks(
    path: Path, columns: _Columns, skipped: Skipped | None
) -> Iterator[tuple[Times, Array]]:
    """Yield stamps (n,) and numbers (n, m) of a CSV file.

    :param columns: contents of the file, with their numbers of columns.
    :param skipped: receives the number of bad rows skipped; None: they are errors.
    :raises InputError: for a file of another form, and at its end with the first lines of every
        class of bad rows.
    """
    table = _Table(path, columns)
    count = 0
    for rows in row_blocks(path, _WHAT):
        for t_ns, numbers in table.blocks(rows):
            count += len(t_ns)
            yield t_ns, numbers
    if skipped is None:
        table.bad.complain()
    elif table.bad.rows:
        skipped(table.bad.rows)
    if not count:
        raise InputError(f"{path}: contains no {'usable ' * bool(table.bad.rows)}rows")


class _Table:
    """A CSV file of stamps and numbers that is being read, and its bad rows so far."""

    def __init__(self, path: Path, columns: _Columns) -> None:
        self.bad = BadRows(path)
        self._quantities = [quantity for quantity, _ in columns]
        self._cuts = np.cumsum([count for _, count in columns])
        self._columns = int(self._cuts[-1])
        self._row = np.dtype([("t_ns", "<i8"), ("numbers", "<f8", (self._columns,))])
        self._begun = False
        self._last_ns = _EARLIEST

    def blocks(self, rows: list[Row]) -> Iterator[tuple[Times, Array]]:
        """Yield the good rows of some lines; record the problems of the others."""
        if rows and not self._begun:
            self._begun = True
            if not rows[0][1][:1].isdigit():  # kalibr's header
                rows = rows[1:]
        found = list(self._parts(rows))
        if found:
            yield (
                np.concatenate([part["t_ns"] for part in found]),
                np.concatenate([part["numbers"] for part in found]),
            )

    def _parts(self, rows: list[Row]) -> Iterator[NDArray[np.void]]:
        """Yield the good rows, in pieces: what cannot be converted at once is halved."""
        waiting = [rows] if rows else []
        while waiting:
            part = waiting.pop()
            try:
                found = self._loaded(part)
            except (ValueError, OverflowError, DeprecationWarning):
                if len(part) > 1:
                    half = len(part) // 2
                    waiting += [part[half:], part[:half]]
                else:
                    self._note(*part[0])
                    self.bad.give_up()
                continue
            good = self._good(np.array([number for number, _ in part]), found)
            if good.any():
                yield found[good]

    def _loaded(self, rows: list[Row]) -> NDArray[np.void]:
        import warnings

        with warnings.catch_warnings():
            warnings.simplefilter(
                "error", DeprecationWarning
            )  # numpy 1 takes 1.5 for the integer 1
            return np.loadtxt(
                [text.decode("latin-1") for _, text in rows],
                self._row,
                delimiter=",",
                ndmin=1,
                comments=None,
            )

    def _note(self, line: int, text: bytes) -> None:
        """Record why a row cannot be converted to numbers."""
        self.bad.rows += 1
        before = self.bad.count
        fields = [field.strip().decode("utf-8", "replace") for field in text.split(b",")]
        if len(fields) != self._columns + 1:
            expected = f"expected nanoseconds and {self._columns} numbers"
            self.bad.note(COLUMNS, line, f"{len(fields)} columns; {expected}")
            return
        if not _STAMP.fullmatch(fields[0]) or abs(int(fields[0])) > -_EARLIEST:
            self.bad.note(NUMBERS, line, f"{shortened(fields[0])} is not a stamp in nanoseconds")
        for field in fields[1:]:
            try:
                number_of(field)
            except ValueError:
                self.bad.note(NUMBERS, line, f"{shortened(field)} is not a number")
        if self.bad.count == before:
            self.bad.note(NUMBERS, line, "cannot be read as numbers")

    def _good(self, lines: Times, found: NDArray[np.void]) -> Mask:
        """Return which rows the gate passes that are not before an earlier one; note the others.

        Readings that the transport duplicated occur twice: equal stamps are valid.
        """
        parts = np.split(found["numbers"], self._cuts[:-1], axis=1)
        verdict = gate.Verdict(found["t_ns"], list(zip(self._quantities, parts, strict=True)))
        verdict.note(self.bad, lines)
        t_ns = np.where(verdict.good, found["t_ns"], _EARLIEST)
        latest = np.maximum(np.maximum.accumulate(t_ns), self._last_ns)
        back = verdict.good & (t_ns < latest)
        for k in np.flatnonzero(back):
            step = (int(latest[k]) - int(t_ns[k])) * 1e-9
            words = f"the stamp is {step:.9g} s before that of an earlier line"
            self.bad.note(STAMPS, int(lines[k]), words)
        self._last_ns = int(latest[-1])
        good: Mask = verdict.good & ~back
        self.bad.good += int(np.count_nonzero(good))
        self.bad.rows += int(np.count_nonzero(back))
        return good
