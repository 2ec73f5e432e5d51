# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The folder of a campaign: rows as they arrive, safe against crashes; tables at the end.

``runs.jsonl`` gets a line for each finished run, flushed to the disk; a truncated last line is
skipped. From it ``results.csv`` (and ``results.parquet`` if pyarrow is installed) is made,
ordered by cell, seed and estimator.
"""

import contextlib
import csv
import fcntl
import io
import itertools
import json
import math
import os
import re
import shutil
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Final, TextIO

import numpy as np

from imu_sim_ros.campaigns.metrics import COVERED
from imu_sim_ros.core.errors import InputError, system_error
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.types import JsonObject
from imu_sim_ros.inputs.rows import is_present, open_shared
from imu_sim_ros.terminal.json_text import json_text

if TYPE_CHECKING:
    from pyarrow import Array

Row = JsonObject
Key = tuple[str, int, str, str]
"""Digest of the parameters, seed, estimator and cell."""

LOG: Final = "runs.jsonl"
TABLE: Final = "results.csv"
PARQUET: Final = "results.parquet"
SUMMARY: Final = "summary.csv"
VERSIONS: Final = "versions.json"
PLAN: Final = "plan.yaml"
_REPORT: Final = "report.html"
_RUNS: Final = "runs"
_LOCK: Final = ".lock"
_RESULTS: Final = (LOG, TABLE, PARQUET, SUMMARY, VERSIONS, _REPORT, _RUNS)
COMMON_TIME: Final = "common_time"
"""Column of the metrics over the time common with each other estimator, a JSON object."""
FINDINGS: Final = "findings"
"""Column of the mistakes that an estimate shows."""
SEPARATOR: Final = "; "
"""Separator of the findings of a run."""
SCENARIO: Final = "scenario"
"""Column of the digest of all that decides what a run has to estimate, and how it is compared."""
_IDENTITY: Final = ("cell", "estimator", "status", "digest", "version")
"""Columns that are strings, whatever they look like; with the seed they identify a run."""
_TEXTS: Final = (*_IDENTITY, COMMON_TIME, FINDINGS, SCENARIO)
_CAMPAIGN_FILES: Final = frozenset((*_RESULTS, PLAN, _LOCK))
_PART: Final = re.compile(r"plan\.\d+\.yaml|\.[a-z.]+\.part")
"""Earlier plans, and the incomplete tables of a killed program."""


def run_folder_path(folder: Path, cell: int, seed: int, estimator: str) -> Path:
    """Return the folder of a run's files in the folder of its campaign.

    :param cell: number of the cell.
    """
    return folder / _RUNS / f"{cell:06d}" / str(seed) / estimator


def key_of(row: Row) -> Key:
    """Return the key that identifies a run."""
    return str(row["digest"]), int(row["seed"]), str(row["estimator"]), str(row["cell"])


class Store:
    """The results of a campaign that is running; use as a context manager.

    Rows are written as the runs end and survive whatever ends the program; ``--resume`` continues
    from them. A staging folder that is renamed at the end, as for other outputs, would lose them.
    The guarantees are the same: an existing folder is refused unless it is empty, resumed or
    forced; files that no campaign wrote are never touched, even with force; tables are complete or
    absent; and a campaign that could not begin leaves nothing.
    """

    def __init__(self, folder: Path, resume: bool, force: bool = False) -> None:
        """Open a folder for one campaign.

        :param resume: continue with the existing results.
        :param force: start over, discarding the existing results.
        :raises InputError: for a folder that another campaign uses, that holds results while
            neither is asked for, or that holds anything else.
        """
        self.folder = folder
        self._file: TextIO | None = None
        self._created: list[Path] = []
        try:
            _refuse(folder, resume, force)
            for parent in reversed([p for p in (folder, *folder.parents) if not p.exists()]):
                parent.mkdir()
                self._created.append(parent)
            is_present(folder / _LOCK)  # a pipe would be waited for
            self._lock = (folder / _LOCK).open("a")
        except OSError as error:
            self._remove_created()
            raise system_error(folder, error) from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise InputError(f"{folder}: another campaign is running in this folder") from None
        if force and not resume:
            for name in _RESULTS:
                _remove(folder / name)

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()
        if self._created and not any((self.folder / name).exists() for name in (*_RESULTS, PLAN)):
            (self.folder / _LOCK).unlink(missing_ok=True)
            self._remove_created()
        self._lock.close()

    def _remove_created(self) -> None:
        """Remove the folders that were created, if they are empty."""
        with contextlib.suppress(OSError):
            while self._created:
                self._created.pop().rmdir()

    def keep_plan(self, path: Path) -> None:
        """Copy the plan next to its results; it may already be there.

        A different plan there gets a free name, plan.1.yaml and so on: it may be the user's.
        """
        copy = self.folder / PLAN
        with open_shared(path) as file:
            plan = file.read()
        if is_present(copy):
            if copy.samefile(path) or copy.read_bytes() == plan:
                return
            names = (copy.with_name(f"plan.{k}.yaml") for k in itertools.count(1))
            copy.rename(next(name for name in names if not os.path.lexists(name)))
        with write_atomically(copy) as part:
            part.write_bytes(plan)

    def rows(self) -> Iterator[Row]:
        """Yield the rows that are there; a truncated line is skipped."""
        yield from read_log(self.folder / LOG)

    def append(self, rows: Sequence[Row]) -> None:
        """Append rows; they are on the disk when this returns."""
        if self._file is None:
            self._file = self._open()
        self._file.write("".join(json_text(row) + "\n" for row in rows))
        self._file.flush()
        os.fsync(self._file.fileno())

    def _open(self) -> TextIO:
        """Open the log of runs to append to; a torn last line is ended."""
        path = self.folder / LOG
        torn = _is_torn(path)
        file = path.open("a", encoding="utf-8")
        if torn:
            file.write("\n")
        return file


def _refuse(folder: Path, resume: bool, force: bool) -> None:
    """Refuse a folder in which this campaign must not write."""
    if not os.path.lexists(folder):
        return
    if not folder.is_dir():
        raise InputError(f"{folder}: exists and is not a folder")
    begun = (resume or not force) and _has_runs(folder)
    if resume and begun:
        return  # further files, notes or pages, are not touched
    complaint = _foreign(folder) or ("" if force else _results_there(folder, begun, resume))
    if complaint:
        raise InputError(f"{folder}: contains {complaint}")


def _has_runs(folder: Path) -> bool:
    """Return whether a campaign has made a run in a folder."""
    log = folder / LOG
    return is_present(log) and log.stat().st_size > 0


def _foreign(folder: Path) -> str:
    """Return a complaint about a file that no campaign wrote; empty: there is none."""
    for name in sorted(os.listdir(folder)):
        if name not in _CAMPAIGN_FILES and not _PART.fullmatch(name):
            return f"{name}, which is not from a campaign; name another folder"
    return ""


def _results_there(folder: Path, begun: bool, resume: bool) -> str:
    """Return a complaint about results that are not to be replaced; empty: there are none.

    :param begun: True if the log has runs, from which one may resume.
    """
    resuming, forcing = argument("resume", True), argument("force", True)
    existing = [name for name in _RESULTS if name != LOG and os.path.lexists(folder / name)]
    interrupted = existing == [_RUNS]  # within the first runs of programs
    if resume and interrupted:
        return ""
    if begun or interrupted:
        return f"results; continue with {resuming}, start over with {forcing}, or name another one"
    if existing:
        return (
            f"{existing[0]} without the {LOG} it was generated from; start over with {forcing}, "
            "or name another one"
        )
    return ""


def _remove(path: Path) -> None:
    """Remove a file or a folder, if it is there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


@contextlib.contextmanager
def write_atomically(path: Path) -> Iterator[Path]:
    """Yield the path for writing a file that is renamed when complete, or removed on an error."""
    part = path.with_name(f".{path.name}.part")
    try:
        yield part
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _is_torn(path: Path) -> bool:
    """Return whether a file ends within a line."""
    if not is_present(path) or not path.stat().st_size:
        return False
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) != b"\n"


def read_log(path: Path) -> Iterator[Row]:
    """Yield the rows of a log; equal names and strings share memory."""
    if not is_present(path):
        return
    interned: dict[str, str] = {}
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            try:
                row = json.loads(line)
            except (ValueError, RecursionError):
                continue
            if not _is_row(row):
                continue
            yield {
                interned.setdefault(name, name): interned.setdefault(value, value)
                if isinstance(value, str)
                else value
                for name, value in row.items()
            }


def _is_row(row: object) -> bool:
    """Return whether a line of a log is a run's: plain values, finite numbers, and its identity."""
    return (
        isinstance(row, dict)
        and all(isinstance(row.get(name), str) for name in _IDENTITY)
        and type(row.get("seed")) is int
        and all(
            value is None or isinstance(value, str | int) or _is_finite(value)
            for value in row.values()
        )
    )


def _is_finite(value: object) -> bool:
    """Return True for a finite float."""
    return isinstance(value, float) and math.isfinite(value)


def write_tables(
    folder: Path,
    rows: Sequence[Row],
    columns: Sequence[str],
    metrics: Collection[str] = (),
    parquet: bool = True,
) -> list[Path]:
    """Write ``results.csv``, and ``results.parquet`` if pyarrow is installed.

    :param metrics: the columns that hold numbers, even if no row has one.
    :param parquet: False: without ``results.parquet``, an earlier one is removed. Loading pyarrow
        takes long for a program that was asked to end.
    """
    table = folder / TABLE
    with write_atomically(table) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        for row in rows:
            writer.writerow([_cell(row.get(name)) for name in columns])
    paths = [table]
    if not parquet:
        (folder / PARQUET).unlink(missing_ok=True)
    elif _write_parquet(folder / PARQUET, rows, columns, metrics):
        paths.append(folder / PARQUET)
    return paths


def _cell(value: object) -> object:
    """Return a value as a cell of the CSV file; floats with all digits."""
    if value is None:
        return ""
    return repr(value) if isinstance(value, float) else value


def _write_parquet(
    path: Path, rows: Sequence[Row], columns: Sequence[str], metrics: Collection[str]
) -> bool:
    """Write the rows as Parquet; return False without pyarrow."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        return False
    arrays = [_arrow(name, rows, metrics) for name in columns]
    with write_atomically(path) as part:
        pyarrow.parquet.write_table(pyarrow.Table.from_arrays(arrays, list(columns)), part)
    return True


def _arrow(name: str, rows: Sequence[Row], metrics: Collection[str]) -> "Array":
    """Return a column, whose type depends on the plan alone.

    Metrics are numbers even if no run has one; a grid's axis may mix kinds of values, which are
    strings then. The column is made of its buffers, because ``pyarrow.array`` loads pandas.
    """
    import pyarrow

    values = [row.get(name) for row in rows]
    kinds = {type(value) for value in values if value is not None}
    numbers = [0 if value is None else value for value in values]
    if name in metrics or (kinds <= {int, float} and float in kinds):
        kind, column = pyarrow.float64(), np.array(numbers, np.float64).tobytes()
    elif kinds == {int}:
        kind, column = pyarrow.int64(), np.array(numbers, np.int64).tobytes()
    elif kinds == {bool}:
        kind, column = pyarrow.bool_(), _bits(numbers)
    else:
        texts = pyarrow.lib.StringBuilder()
        texts.append_values([None if value is None else str(value) for value in values])
        return texts.finish()
    present = _bits([value is not None for value in values])
    buffers = [pyarrow.py_buffer(part) for part in (present, column)]
    return pyarrow.Array.from_buffers(kind, len(values), buffers)


def _bits(flags: Sequence[object]) -> bytes:
    """Return flags (n,) as the bits of bytes, the form of Arrow."""
    return np.packbits(np.array(flags, np.bool_), bitorder="little").tobytes()


def read_results(path: Path) -> list[Row]:
    """Return the rows of a ``results.csv``, a ``results.parquet`` or a campaign's folder.

    :raises InputError: for a file that cannot be read or has no such rows.
    """
    if path.is_dir():
        path = path / TABLE
    try:
        with open_shared(path) as file:
            rows = _read_parquet(path, file) if path.suffix == ".parquet" else _read_csv(file)
    except (OSError, ValueError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    for name in ("cell", "seed", "estimator", "status"):
        if rows and name not in rows[0]:
            raise InputError(f"{path}: has no column {name}: not the results of a campaign")
    for number, row in enumerate(rows, 1):
        if type(row["seed"]) is not int:
            raise InputError(f"{path}: run {number}: seed = {row['seed']!r}: must be an integer")
    return rows


def _read_parquet(path: Path, file: BinaryIO) -> list[Row]:
    """Return the rows of a Parquet file, which bears a name in messages."""
    try:
        import pyarrow.parquet
    except ImportError:
        raise InputError(
            f"{path}: needs pyarrow: pip install pyarrow; or name the results.csv next to it"
        ) from None
    return pyarrow.parquet.read_table(io.BytesIO(file.read())).to_pylist()


def _read_csv(file: BinaryIO) -> list[Row]:
    """Return the rows of a CSV file, with numbers in place of their texts."""
    lines = io.TextIOWrapper(file, encoding="utf-8", newline="")
    return [
        {name: _value(name, text) for name, text in row.items() if name}
        for row in csv.DictReader(lines)
    ]


def _value(name: str, text: str | None) -> object:
    """Return the value of a cell: None if empty, text, or a number."""
    if text is None or text == "":
        return None
    if name in _TEXTS:
        return text
    try:
        number = float(text)
    except ValueError:
        return text
    if not math.isfinite(number):
        return text
    return int(text) if text.lstrip("-").isdigit() else number


def numbers(rows: Iterable[Row], metric: str) -> list[float]:
    """Return the values of a metric in the rows that have it and are done.

    Metrics of coverage are those of failed runs, too.
    """
    return [
        float(row[metric])
        for row in rows
        if (row["status"] == "done" or metric in COVERED)
        and isinstance(row.get(metric), int | float)
    ]
