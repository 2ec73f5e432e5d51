# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables that grow block by block, as CSV and as .npz, in little memory."""

import math
import shutil
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

import numpy as np

from imu_sim_ros.bags.outputs import OutputFile
from imu_sim_ros.bags.text import decimals
from imu_sim_ros.core.errors import system_error
from imu_sim_ros.core.types import AnyArray
from imu_sim_ros.terminal.progress import current_watcher

Column = AnyArray

_ROWS = 4096
"""Number of rows that are formatted at once."""
_Shape: TypeAlias = "tuple[np.dtype[np.generic], tuple[int, ...], int]"
"""Type and shape of a row of an array, and the number of rows."""


class CsvTable:
    """A CSV file whose columns are integers, floats or short strings."""

    def __init__(self, path: Path, header: str) -> None:
        """Open a new file.

        :param header: first line of the file.
        """
        self.file = OutputFile(path)
        self.file.write(header.encode() + b"\n")
        self._counted = (self.file.position, 0)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self._counted[1]

    def write(self, *columns: Column) -> None:
        """Append n rows of columns (n,) or (n, m)."""
        count = len(columns[0])
        for start in range(0, count, _ROWS):
            self.file.write(decimals.lines([c[start : start + _ROWS] for c in columns]))
        # One assignment: a signal handler sees both or neither.
        self._counted = (self.file.position, self.rows + count)

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that drops the rows written after this call."""
        counted = self._counted

        def drop_rows() -> None:
            self._counted = counted

        return drop_rows

    def close(self, error: BaseException | None) -> None:
        """Give the file its final name, or leave it partial, with the counted rows."""
        self.file.cut(self._counted[0])
        if _keeps_rows(error):
            self.file.finish()
        else:
            self.file.abandon(empty=not self.rows)


def _keeps_rows(error: BaseException | None) -> bool:
    """Return whether the rows so far are to be kept: after success, or an interruption."""
    return error is None or not isinstance(error, Exception)


class NpzTable:
    """An .npz of growing arrays, each in a file of its own until the end."""

    def __init__(self, path: Path) -> None:
        self._path = path
        import tempfile  # few outputs need it

        self._folder = Path(tempfile.mkdtemp(prefix=".columns-", dir=path.parent))
        self._shapes: dict[str, _Shape] = {}

    def write(self, columns: Mapping[str, Column]) -> None:
        """Append rows; the same names each time."""
        for name, values in columns.items():
            _, _, count = self._shapes.get(name, (values.dtype, values.shape[1:], 0))
            try:
                with (self._folder / name).open("ab") as file:
                    np.ascontiguousarray(values).tofile(file)
            except OSError as error:
                raise system_error(self._path, error) from None
            self._shapes[name] = (values.dtype, values.shape[1:], count + len(values))

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that drops the rows written after this call."""
        shapes = dict(self._shapes)

        def drop_rows() -> None:
            self._shapes = shapes

        return drop_rows

    def close(self, error: BaseException | None) -> None:
        """Join the arrays, or leave nothing."""
        try:
            if _keeps_rows(error):
                self._join()
        except OSError as problem:
            self._path.unlink(missing_ok=True)
            raise system_error(self._path, problem) from None
        finally:
            shutil.rmtree(self._folder, ignore_errors=True)

    def _join(self) -> None:
        """Write the columns that were collected in temporary files into the archive."""
        with zipfile.ZipFile(self._path, "x", allowZip64=True) as archive:
            for name, (dtype, shape, count) in self._shapes.items():
                # A fixed date: the same arrays are the same bytes.
                entry = zipfile.ZipInfo(f"{name}.npy")
                with archive.open(entry, "w", force_zip64=True) as member:
                    header = {
                        "descr": np.lib.format.dtype_to_descr(dtype),
                        "fortran_order": False,
                        "shape": (count, *shape),
                    }
                    np.lib.format.write_array_header_1_0(member, header)
                    with (self._folder / name).open("r+b") as file:
                        file.truncate(count * math.prod(shape) * dtype.itemsize)
                        shutil.copyfileobj(file, member, 1 << 20)


class Tables:
    """Several tables that are closed together; use as a context manager."""

    def __init__(self) -> None:
        self.open: list[CsvTable | NpzTable] = []
        self._checkpoints: list[Callable[[], None]] | None = None

    def csv(self, path: Path, header: str) -> CsvTable:
        """Open a CSV file."""
        table = CsvTable(path, header)
        self.open.append(table)
        return table

    def npz(self, path: Path) -> NpzTable:
        """Open an .npz file."""
        table = NpzTable(path)
        self.open.append(table)
        return table

    def mark_complete(self) -> None:
        """State that all tables hold the same rows; an interruption later leaves them as now."""
        self._checkpoints = [table.checkpoint() for table in self.open]

    def __enter__(self) -> "Tables":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is not None and self._checkpoints is not None:
            for drop_rows in self._checkpoints:
                drop_rows()
        with current_watcher().undisturbed():
            for table in self.open:
                table.close(error)
