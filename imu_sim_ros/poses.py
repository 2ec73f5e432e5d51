# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recorded poses as text: the forms of TUM (``t x y z qx qy qz qw``) and of EuRoC."""

from collections.abc import Iterable, Iterator
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.errors import InputError
from imu_sim_ros.timebase import NANOSECONDS_PER_SECOND

Array = NDArray[np.float64]

_POSE_COLUMNS: Final = 8
_EUROC_COLUMNS: Final = (_POSE_COLUMNS, 11, 17)  # pose; and velocity; and both biases
_NORM_TOLERANCE: Final = 0.05  # a quaternion of text is rounded; one of another length is a mix-up
_SHOWN_PROBLEMS: Final = 10
_STAMP_LENGTH: Final = 40
_LAST_SECOND: Final = 9_223_372_035  # what int64 nanoseconds hold
_SECOND_DIGITS: Final = 10


class PoseSequence(NamedTuple):
    """Poses of one body over time."""

    t_ns: NDArray[np.int64]
    """(n,) stamps [ns], strictly increasing."""
    position: Array
    """(n, 3) p_wb [m]."""
    q_wb: Array
    """(n, 4) unit quaternions (w, x, y, z)."""
    dropped: int = 0
    """Poses left out because they stood twice, with the same stamp."""


def read_poses(path: str | Path, topic: str | None = None) -> PoseSequence:
    """Return the poses of a text file; commas mean EuRoC's form, spaces TUM's.

    TUM: seconds, position, quaternion x y z w. EuRoC: nanoseconds, position, quaternion w x y z,
    then perhaps velocity and biases, which are left out. Lines that start with # are comments. A
    pose that stands twice is taken once.

    :param topic: must be None; for readers that know bags as well.
    :raises InputError: with the line of everything that is wrong.
    """
    path = Path(path)
    if topic is not None:
        raise InputError(f"{path}: a text file of poses has no topic {topic}")
    rows = list(_rows(path))
    if not rows:
        raise InputError(f"{path}: holds no poses")
    table = _Table(path, [number for number, _ in rows], [text for _, text in rows])
    return table.poses()


def write_tum(path: str | Path, poses: PoseSequence) -> None:
    """Write poses in TUM's form, stamps with nine and values with twelve decimals."""
    with Path(path).open("w", encoding="utf-8") as file:
        file.write("# timestamp tx ty tz qx qy qz qw\n")
        whole, part = np.divmod(poses.t_ns, NANOSECONDS_PER_SECOND)
        values = np.column_stack([poses.position, poses.q_wb[:, [1, 2, 3, 0]]])
        for second, nanosecond, row in zip(
            whole.tolist(), part.tolist(), values.tolist(), strict=True
        ):
            words = " ".join(f"{value:.12g}" for value in row)
            file.write(f"{second}.{nanosecond:09d} {words}\n")


def _rows(path: Path) -> Iterator[tuple[int, str]]:
    """Yield number and text of every line that is neither empty nor a comment."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file of poses") from None
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if text and not text.startswith("#"):
            yield number, text


class _Table:
    """The rows of one file, with the numbers of their lines for the messages."""

    def __init__(self, path: Path, numbers: list[int], rows: list[str]) -> None:
        self._path = path
        self._numbers = numbers
        self._rows = rows
        self._euroc = "," in rows[0]

    def poses(self) -> PoseSequence:
        """Return the poses, or raise with a line for every problem."""
        t_ns, values = self._parsed()
        order = [3, 4, 5, 6] if self._euroc else [6, 3, 4, 5]
        position, q_wb = values[:, :3], values[:, order]
        norms = np.linalg.norm(q_wb, axis=-1)
        self._check(self._value_problems(values, norms))
        q_wb = q_wb / norms[:, None]
        repeated = _repeated(t_ns, position, q_wb)
        self._check(self._stamp_problems(t_ns, repeated))
        keep = ~repeated
        if np.count_nonzero(keep) < 2:
            raise InputError(f"{self._path}: holds one pose; a trajectory needs two or more")
        return PoseSequence(
            t_ns[keep], position[keep], q_wb[keep], dropped=int(np.count_nonzero(repeated))
        )

    def _parsed(self) -> tuple[NDArray[np.int64], Array]:
        """Return stamps (n,) and values (n, 7), converted at once; looked into if that fails."""
        if self._euroc:
            self._check(self._column_problems())
        columns = range(_POSE_COLUMNS) if self._euroc else None
        try:
            table = np.loadtxt(
                self._rows,
                dtype=[("stamp", f"U{_STAMP_LENGTH}"), ("values", np.float64, (7,))],
                delimiter="," if self._euroc else None,
                usecols=columns,
                comments=None,
                ndmin=1,
            )
            return _nanoseconds(np.char.strip(table["stamp"]), self._euroc), table["values"]
        except (ValueError, OverflowError) as error:
            self._check(self._column_problems())
            self._check(self._number_problems())
            raise InputError(f"{self._path}: {error}") from None

    def _fields(self) -> Iterator[tuple[int, list[str]]]:
        for number, row in zip(self._numbers, self._rows, strict=True):
            yield number, [field.strip() for field in row.split("," if self._euroc else None)]

    def _check(self, problems: Iterable[str]) -> None:
        lines = list(problems)
        if not lines:
            return
        shown = [f"{self._path}: {line}" for line in lines[:_SHOWN_PROBLEMS]]
        if len(lines) > _SHOWN_PROBLEMS:
            shown.append(f"{self._path}: and {len(lines) - _SHOWN_PROBLEMS} more such lines")
        raise InputError(shown)

    def _column_problems(self) -> Iterator[str]:
        allowed = _EUROC_COLUMNS if self._euroc else (_POSE_COLUMNS,)
        form = "EuRoC" if self._euroc else "TUM"
        expected = " or ".join(map(str, allowed))
        for number, fields in self._fields():
            if len(fields) not in allowed:
                yield f"line {number}: {len(fields)} columns; the {form} form has {expected}"

    def _number_problems(self) -> Iterator[str]:
        for number, fields in self._fields():
            try:
                _nanoseconds(np.array(fields[:1]), self._euroc)
            except (ValueError, OverflowError):
                unit = "whole nanoseconds" if self._euroc else "seconds"
                yield f"line {number}: {fields[0]!r} is not a stamp in {unit}"
            for field in fields[1:_POSE_COLUMNS]:
                try:
                    float(field)
                except ValueError:
                    yield f"line {number}: {field!r} is not a number"

    def _value_problems(self, values: Array, norms: Array) -> Iterator[str]:
        finite = np.all(np.isfinite(values), axis=-1)
        bad = ~finite | ~(np.abs(norms - 1.0) <= _NORM_TOLERANCE)
        for k in np.flatnonzero(bad):
            what = "a value that is not finite"
            if finite[k]:
                what = f"a quaternion of length {norms[k]:.3g} instead of 1"
            yield f"line {self._numbers[k]}: {what}"

    def _stamp_problems(
        self, t_ns: NDArray[np.int64], repeated: NDArray[np.bool_]
    ) -> Iterator[str]:
        steps = np.diff(t_ns)
        for k in np.flatnonzero((steps <= 0) & ~repeated[1:]) + 1:
            line, before, step = self._numbers[k], self._numbers[k - 1], steps[k - 1]
            if step < 0:
                yield f"line {line}: the stamp is {-step * 1e-9:.9g} s before that of line {before}"
            else:
                yield f"line {line}: the stamp of line {before} with another pose"


def _repeated(t_ns: NDArray[np.int64], position: Array, q_wb: Array) -> NDArray[np.bool_]:
    """Tell which rows say once more what the row before them says."""
    same_pose = (np.diff(position, axis=0) == 0).all(axis=-1) & (
        np.abs(np.sum(q_wb[1:] * q_wb[:-1], axis=-1)) > 1.0 - 1e-15
    )
    return np.concatenate([[False], (np.diff(t_ns) == 0) & same_pose])


def _nanoseconds(stamps: NDArray[np.str_], euroc: bool) -> NDArray[np.int64]:
    """Return stamps (n,) in nanoseconds, exactly: a float of 1.6e9 s is only good to 240 ns.

    :raises ValueError, OverflowError: for a stamp that is not a number, or too large.
    """
    if euroc:
        return np.array([int(stamp) for stamp in stamps.tolist()], dtype=np.int64)
    whole, _, part = np.moveaxis(np.char.partition(stamps, "."), -1, 0)
    plain = np.char.isdigit(whole) & (np.char.str_len(whole) <= _SECOND_DIGITS)
    plain &= (np.char.isdigit(part) | (part == "")) & (np.char.str_len(part) <= 9)
    result = np.empty(len(stamps), dtype=np.int64)
    if plain.any():
        result[plain] = _plain_nanoseconds(whole[plain], part[plain])
    for k in np.flatnonzero(~plain):
        result[k] = _decimal_nanoseconds(str(stamps[k]))
    return result


def _plain_nanoseconds(whole: NDArray[np.str_], part: NDArray[np.str_]) -> NDArray[np.int64]:
    """Return stamps (n,) of the digits before and after the point."""
    seconds = whole.astype(np.int64)
    if np.any(seconds > _LAST_SECOND):
        raise OverflowError(f"a stamp above {_LAST_SECOND} s")
    result: NDArray[np.int64] = seconds * NANOSECONDS_PER_SECOND
    return result + np.char.ljust(part, 9, "0").astype(np.int64)


def _decimal_nanoseconds(stamp: str) -> int:
    """Return a stamp with an exponent, or with more digits than nanoseconds."""
    try:
        seconds = Decimal(stamp)
    except InvalidOperation:
        raise ValueError(stamp) from None
    if seconds.adjusted() >= _SECOND_DIGITS:  # 1e999999999 would fill the memory
        raise OverflowError(stamp)
    return round(seconds * NANOSECONDS_PER_SECOND)
