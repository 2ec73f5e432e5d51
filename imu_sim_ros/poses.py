# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses of one body over time, and their forms as text: TUM (``t x y z qx qy qz qw``) and EuRoC."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import rotation
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs import gate
from imu_sim_ros.inputs.rows import (
    COLUMNS,
    NUMBERS,
    STAMPS,
    BadRows,
    Row,
    number_of,
    row_blocks,
    shortened,
)
from imu_sim_ros.records import States
from imu_sim_ros.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.types import Array, Bytes, Integers, Mask

STAMP_BYTES: Final = 48
"""A stamp of text is shorter."""
_LAST_SECOND: Final = 9_223_372_035  # what int64 nanoseconds hold
_SECOND_DIGITS: Final = 10
_FRACTION_DIGITS: Final = 9
_WHOLE_DIGITS: Final = 18  # of nanoseconds; one more may not fit
_ZERO, _POINT = ord("0"), ord(".")


def nanoseconds(stamps: NDArray[np.bytes_], whole: bool) -> Integers:
    """Return stamps (n,) of text in nanoseconds.

    :param stamps: (n,) of ``S48``.
    :param whole: they are whole nanoseconds; else seconds.
    :raises ValueError, OverflowError: for a stamp that is not a number, or does not fit.
    """
    letters = np.ascontiguousarray(stamps).view(np.uint8).reshape(len(stamps), -1)
    letters = letters[:, : int(np.char.str_len(stamps).max(initial=1))]
    digit = (letters >= _ZERO) & (letters <= _ZERO + 9)
    point = letters == _POINT
    fraction = digit & (np.cumsum(point, axis=1) > 0)
    digits, decimals = digit.sum(axis=1), fraction.sum(axis=1)
    # Plain: digits, at most one point among them, and nothing else.
    plain = (digit | point | (letters == 0)).all(axis=1) & (point.sum(axis=1) <= 1)
    if whole:
        plain &= (digits > 0) & (digits <= _WHOLE_DIGITS) & ~point.any(axis=1)
    else:
        plain &= (digits > decimals) & (digits - decimals <= _SECOND_DIGITS)
        plain &= decimals <= _FRACTION_DIGITS
    result = _joined_digits(letters, digit)
    if not whole:
        seconds = result // 10**decimals
        if np.any(plain & (seconds > _LAST_SECOND)):
            raise OverflowError(f"a stamp above {_LAST_SECOND} s")
        result *= 10 ** (_FRACTION_DIGITS - np.minimum(decimals, _FRACTION_DIGITS))
    for k in np.flatnonzero(~plain):
        result[k] = nanosecond(stamps[k].decode("latin-1"), whole)
    return result


def nanosecond(stamp: str, whole: bool) -> int:
    """Return one stamp in nanoseconds; it may have an exponent, or many digits.

    :raises ValueError, OverflowError: for a stamp that is not a number, or does not fit.
    """
    if len(stamp) >= STAMP_BYTES or "_" in stamp or not stamp.isascii():
        raise ValueError(stamp)  # Python's own 1_000 and digits of other scripts are none here
    if whole:
        result = int(stamp)
    else:
        try:
            seconds = Decimal(stamp)
        except InvalidOperation:
            raise ValueError(stamp) from None
        if seconds.adjusted() >= _SECOND_DIGITS:  # 1e999999999 would fill the memory
            raise OverflowError(stamp)
        result = round(seconds * NANOSECONDS_PER_SECOND)
    if abs(result) > _LAST_SECOND * NANOSECONDS_PER_SECOND:
        raise OverflowError(stamp)
    return result


def _joined_digits(letters: Bytes, digit: Mask) -> Integers:
    """Return the digits of each row (n, letters) as one number (n,); too many wrap around."""
    result = np.zeros(len(letters), dtype=np.int64)
    for column in range(letters.shape[1]):
        here = digit[:, column]
        value = letters[:, column].astype(np.int64) - _ZERO
        result = np.where(here, result * 10 + value, result)
    return result


_POSE_COLUMNS: Final = 8
_TRIANGLES: Final = 12
"""Columns of covariance: the upper triangles of that of rotation and that of position."""
_EUROC_PLAIN: Final = (_POSE_COLUMNS, 11, 17)  # pose; and velocity; and both biases
_EUROC_COLUMNS: Final = (*_EUROC_PLAIN, *(count + _TRIANGLES for count in _EUROC_PLAIN))
_TUM_COLUMNS: Final = (_POSE_COLUMNS, 14, _POSE_COLUMNS + _TRIANGLES)  # pose; OpenVINS: and more
_WITH_COVARIANCE: Final = frozenset(count + _TRIANGLES for count in _EUROC_PLAIN)
_MAX_LISTED: Final = 8
"""So few lines are looked at one by one."""
_SAME: Final = 1.0 - 1e-15
_WHAT: Final = "a text file of poses"


def read_poses(
    path: str | Path,
    topic: str | None = None,
    skip_bad_rows: bool = False,
    covariance: bool = False,
) -> States:
    """Return the poses of a text file; commas mean EuRoC's form, spaces TUM's.

    TUM: seconds, position, quaternion x y z w, then perhaps the 6 or 12 columns of covariances that
    OpenVINS writes. EuRoC: nanoseconds, position, quaternion w x y z, then perhaps velocity and
    biases. Either may end in the 12 columns of covariance that OpenVINS writes (``ov_eval``): the
    upper triangles, row by row, of the covariance of the rotation about the body's axes [rad^2] and
    of the position [m^2]. Lines that start with # are comments. A pose that occurs twice is taken
    once.

    :param topic: must be None; for readers that know bags as well.
    :param skip_bad_rows: skip bad rows and count them.
    :param covariance: read the covariances too, if every row has them.
    :raises InputError: with the lines of all that is wrong, whatever it is.
    """
    path = Path(path)
    if topic is not None:
        raise InputError(f"{path}: a text file of poses has no topic {topic}")
    return _Reading(path, skip_bad_rows, covariance).poses()


class _PoseRows(NamedTuple):
    """Poses of some rows, with the numbers of their lines."""

    number: Integers
    t_ns: Integers
    position: Array
    q_wb: Array
    triangles: Array
    """(n, 12) columns of covariance, NaN if a row has none; (n, 0) if not requested."""

    def at(self, rows: Mask | NDArray[np.intp]) -> _PoseRows:
        """Return some of the poses."""
        columns: Iterator[Any] = (column[rows] for column in self)
        return _PoseRows(*columns)

    def before(self, other: _PoseRows) -> _PoseRows:
        """Return these poses with others behind them."""
        columns: Iterator[Any] = (np.concatenate(pair) for pair in zip(self, other, strict=True))
        return _PoseRows(*columns)


class _Reading:
    """One file that is being read, and what is wrong with it so far."""

    def __init__(self, path: Path, skip: bool, covariance: bool) -> None:
        self._path, self._skip, self._covariance = path, skip, covariance
        self._euroc: bool | None = None
        self._bad = BadRows(path)
        self._dropped = 0
        self._last: _PoseRows | None = None

    def poses(self) -> States:
        """Return all poses, or raise with a line for every problem."""
        blocks = [block for rows in row_blocks(self._path, _WHAT) for block in self._block(rows)]
        if not self._skip:
            self._bad.complain()
        count = sum(len(block.t_ns) for block in blocks)
        if self._euroc is None:
            raise InputError(f"{self._path}: contains no poses")
        if count < 2:
            what = "one pose" if count else "no usable pose"
            raise InputError(f"{self._path}: contains {what}; a trajectory needs two or more")
        t_ns = np.empty(count, dtype=np.int64)
        position, q_wb = np.empty((count, 3)), np.empty((count, 4))
        lines = np.empty(count, dtype=np.int64)
        triangles = np.empty((count, _TRIANGLES if self._covariance else 0))
        stop = count
        while blocks:  # from the end, so that each block's memory is free once it is copied
            block = blocks.pop()
            start = stop - len(block.t_ns)
            t_ns[start:stop], position[start:stop], q_wb[start:stop] = block[1:4]
            lines[start:stop], triangles[start:stop] = block.number, block.triangles
            stop = start
        covariance = _covariance(triangles, q_wb) if self._covariance else None
        return States(
            t_ns,
            position,
            q_wb,
            source=str(self._path),
            covariance=covariance,
            lines=lines,
            skipped=self._bad.rows,
            repeated=self._dropped,
        )

    def _block(self, rows: list[Row]) -> Iterator[_PoseRows]:
        """Yield the good poses of some rows."""
        if rows and self._euroc is None:
            self._euroc = b"," in rows[0][1]
        for poses in self._converted(rows):
            good = self._in_order(self._valid(poses))
            self._bad.good += len(good.t_ns)
            if len(good.t_ns):
                yield good

    def _converted(self, rows: list[Row]) -> Iterator[_PoseRows]:
        """Yield poses of rows that are numbers; note those that are not."""
        waiting = [rows] if rows else []
        while waiting:
            part = waiting.pop()
            try:
                yield self._parsed(part)
            except (ValueError, OverflowError):
                if len(part) > _MAX_LISTED:
                    half = len(part) // 2
                    waiting += [part[half:], part[:half]]
                    continue
                good = [row for row in part if self._is_sound(*row)]
                self._bad.give_up()
                if good:
                    yield self._parsed(good)

    def _parsed(self, rows: list[Row]) -> _PoseRows:
        """Return the poses of rows, all converted at once.

        :raises ValueError, OverflowError: if one of them cannot be converted.
        """
        separator = b"," if self._euroc else None
        allowed = _EUROC_COLUMNS if self._euroc else _TUM_COLUMNS
        columns = {len(text.split(separator)) for _, text in rows}
        if not columns <= set(allowed):
            raise ValueError("columns")
        table = np.loadtxt(
            [text.decode("latin-1") for _, text in rows],
            dtype=[("stamp", f"S{STAMP_BYTES}"), ("values", np.float64, (7,))],
            delimiter="," if self._euroc else None,
            usecols=range(_POSE_COLUMNS),
            comments=None,
            ndmin=1,
        )
        stamps = np.char.strip(table["stamp"]).astype(f"S{STAMP_BYTES}")
        order = [3, 4, 5, 6] if self._euroc else [6, 3, 4, 5]
        number = np.array([number for number, _ in rows], dtype=np.int64)
        t_ns = nanoseconds(stamps, bool(self._euroc))
        position, q_wb = table["values"][:, :3].copy(), table["values"][:, order]
        return _PoseRows(number, t_ns, position, q_wb, self._triangles(rows, columns))

    def _triangles(self, rows: list[Row], columns: set[int]) -> Array:
        """Return the columns of covariance, NaN if not all of these rows have them."""
        if not self._covariance:
            return np.empty((len(rows), 0))
        if len(columns) > 1 or not columns <= _WITH_COVARIANCE:
            return np.full((len(rows), _TRIANGLES), np.nan)
        separator = "," if self._euroc else None
        (count,) = columns
        values: Array = np.loadtxt(
            [text.decode("latin-1") for _, text in rows],
            delimiter=separator,
            usecols=range(count - _TRIANGLES, count),
            comments=None,
            ndmin=2,
        )
        if not np.isfinite(values).all():
            raise ValueError("covariance")
        return values

    def _is_sound(self, number: int, text: bytes) -> bool:
        """Return whether one row is all numbers; note what is wrong with it."""
        before = self._bad.count
        fields = [
            field.strip().decode("utf-8", "replace")
            for field in text.split(b"," if self._euroc else None)
        ]
        allowed = _EUROC_COLUMNS if self._euroc else _TUM_COLUMNS
        if len(fields) not in allowed:
            form, expected = "EuRoC" if self._euroc else "TUM", _alternatives(allowed)
            words = f"{len(fields)} columns; the {form} form has {expected}"
            self._bad.note(COLUMNS, number, words)
        else:
            self._note_fields(number, fields)
        sound = self._bad.count == before
        self._bad.rows += not sound
        return sound

    def _note_fields(self, number: int, fields: list[str]) -> None:
        try:
            nanosecond(fields[0], bool(self._euroc))
        except (ValueError, OverflowError):
            unit = "whole nanoseconds" if self._euroc else "seconds"
            self._bad.note(NUMBERS, number, f"{shortened(fields[0])} is not a stamp in {unit}")
        for field in fields[1:_POSE_COLUMNS]:
            try:
                number_of(field)
            except ValueError:
                self._bad.note(NUMBERS, number, f"{shortened(field)} is not a number")
        if self._covariance and len(fields) in _WITH_COVARIANCE:
            for field in fields[-_TRIANGLES:]:
                if not _is_finite(field):
                    words = f"{shortened(field)} is not a finite number of a covariance"
                    self._bad.note(NUMBERS, number, words)

    def _valid(self, poses: _PoseRows) -> _PoseRows:
        """Return the poses that the gate passes, their quaternions made exact."""
        verdict = gate.poses(poses.t_ns, poses.position, poses.q_wb)
        verdict.note(self._bad, poses.number)
        kept = poses.at(verdict.good)
        return kept._replace(q_wb=rotation.normalise(kept.q_wb))

    def _in_order(self, poses: _PoseRows) -> _PoseRows:
        """Return the poses whose stamps are after the one before; those that occur twice once."""
        if not len(poses.t_ns):
            return poses
        first = 0
        if self._last is not None:
            poses = self._last.before(poses)
            first = 1
        repeated = _repeated(poses)
        keep = np.concatenate([[True], np.diff(poses.t_ns) > 0])
        if not keep.all():
            keep = self._increasing(poses, repeated)
        self._dropped += int(np.count_nonzero(repeated & ~keep))
        kept = np.flatnonzero(keep)
        self._last = poses.at(kept[-1:])
        return poses.at(kept[kept >= first])

    def _increasing(self, poses: _PoseRows, repeated: Mask) -> Mask:
        """Return which stamps are after all before them; note those that are not, nor repeated."""
        latest = np.maximum.accumulate(poses.t_ns)
        keep = np.concatenate([[True], poses.t_ns[1:] > latest[:-1]])
        for k in np.flatnonzero(~keep & ~repeated):
            # Compared with the last stamp that stands, not with another bad one.
            before = int(np.flatnonzero(keep[:k])[-1])
            step = int(poses.t_ns[k] - poses.t_ns[before])
            line, other = int(poses.number[k]), poses.number[before]
            if step < 0:
                words = f"the stamp is {-step * 1e-9:.9g} s before that of line {other}"
            else:
                words = f"the stamp of line {other} with a different pose"
            self._bad.note(STAMPS, line, words)
            self._bad.rows += 1
        return keep


def _is_finite(field: str) -> bool:
    try:
        return bool(np.isfinite(number_of(field)))
    except ValueError:
        return False


def _covariance(triangles: Array, q_wb: Array) -> Array | None:
    """Return the covariances (n, 6, 6) with rotation about the world's axes; None without them.

    :param triangles: (n, 12) upper triangles: of rotation about the body's axes, of position.
    :param q_wb: (n, 4).
    """
    if np.isnan(triangles).any():
        return None
    upper = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
    r_wb = rotation.to_matrix(q_wb)
    result = np.zeros((len(q_wb), 6, 6))
    result[:, :3, :3] = triangles[:, 6:][:, upper]
    result[:, 3:, 3:] = r_wb @ triangles[:, :6][:, upper] @ np.swapaxes(r_wb, 1, 2)
    return result


def _repeated(poses: _PoseRows) -> Mask:
    """Return which rows say once more what the row before them says."""
    same_pose = (np.diff(poses.position, axis=0) == 0).all(axis=-1) & (
        np.abs(np.sum(poses.q_wb[1:] * poses.q_wb[:-1], axis=-1)) > _SAME
    )
    return np.concatenate([[False], (np.diff(poses.t_ns) == 0) & same_pose])


def _alternatives(counts: tuple[int, ...]) -> str:
    *others, last = map(str, counts)
    return f"{', '.join(others)} or {last}"


def write_tum(path: str | Path, poses: States) -> None:
    """Write poses in TUM format, stamps with nine and values with twelve decimals."""
    with Path(path).open("w", encoding="utf-8") as file:
        file.write("# timestamp tx ty tz qx qy qz qw\n")
        whole, part = np.divmod(np.abs(poses.t_ns), NANOSECONDS_PER_SECOND)
        signs = np.where(poses.t_ns < 0, "-", "")
        values = np.column_stack([poses.position, poses.q_wb[:, [1, 2, 3, 0]]])
        for sign, second, nanosecond, row in zip(
            signs.tolist(), whole.tolist(), part.tolist(), values.tolist(), strict=True
        ):
            words = " ".join(f"{value:.12g}" for value in row)
            file.write(f"{sign}{second}.{nanosecond:09d} {words}\n")
