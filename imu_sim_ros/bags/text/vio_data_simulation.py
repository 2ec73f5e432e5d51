# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The text files of vio_data_simulation: readings and states of a folder, or of a file of it.

Rows are numbers with spaces between them: ``t, q w x y z, p x y z, gyro, acc`` (``imu_pose.txt``,
``imu_pose_noise.txt``, ``cam_pose.txt``), or twice a pose, ``t, q, p, q, p`` (``imu_int_pose.txt``,
``imu_int_pose_noise.txt``: what the readings of the two files integrate to). Times are seconds.
"""

from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.core import gate
from imu_sim_ros.core.bad_rows import COLUMNS, NUMBERS, STAMPS, BadRows, Skipped
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings, States
from imu_sim_ros.core.rotation import normalise, rotate
from imu_sim_ros.core.types import Array, Integers
from imu_sim_ros.inputs.rows import Row, is_present, number_of, row_blocks

READINGS: Final = "imu_pose_noise.txt"
TRUTH: Final = "imu_pose.txt"
_WHAT: Final = "a table of numbers"
_READINGS_COLUMNS: Final = 14
"""Numbers in a row with readings."""
_POSES_COLUMNS: Final = 15
"""Numbers in a row with a pose twice."""
_ORIENTATION: Final = slice(1, 5)
_POSITION: Final = slice(5, 8)
_GYRO: Final = slice(8, 11)
_ACCEL: Final = slice(11, 14)
_TUM_ORIENTATION: Final = slice(4, 8)
_UNIT: Final = 1e-2
"""Largest deviation of a quaternion's length from 1 that tells the form of a file."""
_ROWS_OF_FORM: Final = 4
"""Rows that tell the form of a file."""


def is_source(path: Path) -> bool:
    """Return whether a path is a folder with readings in this form, or a file in it."""
    if path.is_dir():
        return is_present(path / READINGS) and is_present(path / TRUTH)
    return path.suffix.lower() == ".txt" and path.is_file() and _has_form(path)


def readings_file(path: Path) -> Path:
    """Return the file of a folder's readings, or the path of a file."""
    return path / READINGS if path.is_dir() else path


def truth_file(path: Path) -> Path:
    """Return the file of the true states: of a folder, or of the folder of its readings."""
    if path.is_dir():
        return path / TRUTH
    sibling = path.parent / TRUTH
    return sibling if path.name == READINGS and is_present(sibling) else path


def has_states(path: Path) -> bool:
    """Return whether there are true readings and poses: of a folder, or of a file of readings."""
    return is_source(path) and _row_length(truth_file(path)) == _READINGS_COLUMNS


def read_readings(path: Path, skipped: Skipped | None = None) -> Readings:
    """Return the readings of a folder, those with noise, or of a file.

    :param skipped: receives the number of bad rows skipped; None: they are errors.
    :raises InputError: for a file without readings, and for bad rows.
    """
    file = readings_file(path)
    t_ns, numbers, lines = _table(file, skipped)
    if numbers.shape[1] != _READINGS_COLUMNS:
        raise InputError(f"{file}: contains poses only, no readings of an IMU")
    gyro, accel = numbers[:, _GYRO], numbers[:, _ACCEL]
    return Readings(t_ns, gyro, accel, source=str(path), lines=lines)


def read_states(path: Path, skipped: Skipped | None = None) -> States:
    """Return the states of a folder, the true ones, or the poses of a file.

    With readings in the same rows, velocities are those that fit positions and readings, and
    angular rates are the readings.

    :param skipped: as for :func:`read_readings`.
    :raises InputError: for bad rows.
    """
    file = path / TRUTH if path.is_dir() else path
    t_ns, numbers, lines = _table(file, skipped)
    position, q_wb = numbers[:, _POSITION], normalise(numbers[:, _ORIENTATION])
    velocity = rates = None
    # The frames of a camera have zeros for readings.
    if numbers.shape[1] == _READINGS_COLUMNS and numbers[:, _ACCEL].any() and len(numbers) > 2:
        force = rotate(q_wb, numbers[:, _ACCEL])
        velocity = _velocities((t_ns - t_ns[0]) * 1e-9, position, force)
        rates = numbers[:, _GYRO]
    return States(t_ns, position, q_wb, velocity, rates, source=str(path), lines=lines)


def _velocities(t: Array, position: Array, force: Array) -> Array:
    """Return velocities (n, 3) that fit positions and specific forces in the world.

    With ``a = f + g``, f linear between rows, ``p = p_0 + v_0 t + g t^2 / 2 + double integral of
    f``; p_0, v_0 and g are those of least squares.

    :param t: (n,) times after the first row [s].
    :param position: (n, 3) positions [m].
    :param force: (n, 3) specific force in the world [m/s^2].
    """
    h = np.diff(t)[:, None]
    speeds = np.zeros_like(position)
    np.cumsum(0.5 * h * (force[:-1] + force[1:]), axis=0, out=speeds[1:])
    steps = speeds[:-1] * h + h * h * (2.0 * force[:-1] + force[1:]) / 6.0
    moved = np.zeros_like(position)
    np.cumsum(steps, axis=0, out=moved[1:])
    powers = np.stack([np.ones_like(t), t, 0.5 * t * t], axis=1)
    terms, *_ = np.linalg.lstsq(powers, position - moved, rcond=None)
    return np.asarray(terms[1] + np.outer(t, terms[2]) + speeds)


def _head(path: Path) -> Array:
    """Return the first rows (m, k) of a file; (0, 0) if they have no numbers, or not as many."""
    try:
        rows = next(row_blocks(path, _WHAT), [])[:_ROWS_OF_FORM]
    except InputError:  # not text
        rows = []
    try:
        numbers = [[number_of(field) for field in text.decode().split()] for _, text in rows]
    except ValueError:
        numbers = []
    if not numbers or len({len(row) for row in numbers}) > 1:
        return np.empty((0, 0))
    return np.array(numbers)


def _has_form(path: Path) -> bool:
    """Return True for a file whose rows are those of vio_data_simulation."""
    head = _head(path)
    if head.shape[1] not in (_READINGS_COLUMNS, _POSES_COLUMNS):
        return False
    lengths = np.linalg.norm(head[:, _ORIENTATION], axis=1)
    # OpenVINS' rows in TUM's form can have as many columns.
    tum_lengths = np.linalg.norm(head[:, _TUM_ORIENTATION], axis=1)
    is_tum = bool((np.abs(tum_lengths - 1.0) < _UNIT).all())
    return bool((np.abs(lengths - 1.0) < _UNIT).all()) and not is_tum


def _row_length(path: Path) -> int:
    return _head(path).shape[1]


def _table(path: Path, skipped: Skipped | None) -> tuple[Integers, Array, Integers]:
    """Return stamps (n,) [ns], numbers (n, k) and lines (n,) of a file.

    :raises InputError: with the first lines of every class of bad rows.
    """
    bad, count = BadRows(path), _row_length(path)
    if count not in (_READINGS_COLUMNS, _POSES_COLUMNS):
        count = _READINGS_COLUMNS
    lines: list[int] = []
    rows: list[list[float]] = []
    for block in row_blocks(path, _WHAT):
        for line, text in block:
            numbers = _numbers((line, text), count, bad)
            if numbers is not None:
                lines.append(line)
                rows.append(numbers)
    table, numbers_of_lines = np.array(rows).reshape(-1, count), np.array(lines, dtype=np.int64)
    with np.errstate(invalid="ignore"):
        stamps = np.rint(np.clip(table[:, 0] * 1e9, -gate.LAST_STAMP, gate.LAST_STAMP))
    t_ns = np.where(np.isfinite(stamps), stamps, 0.0).astype(np.int64)
    columns = [(gate.ORIENTATION, table[:, _ORIENTATION]), (gate.POSITION, table[:, _POSITION])]
    if count == _READINGS_COLUMNS:
        columns += [(gate.RATE, table[:, _GYRO]), (gate.FORCE, table[:, _ACCEL])]
    verdict = gate.Verdict(t_ns, columns)
    verdict.note(bad, numbers_of_lines)
    good = verdict.good
    latest = np.maximum.accumulate(np.where(good, t_ns, np.iinfo(np.int64).min))
    for row in np.flatnonzero(good & (t_ns < latest)):
        step = (int(latest[row]) - int(t_ns[row])) * 1e-9
        bad.note(STAMPS, lines[row], f"the stamp is {step:.9g} s before that of an earlier line")
        bad.rows += 1
        good[row] = False
    if skipped is None:
        bad.complain()
    elif bad.rows:
        skipped(bad.rows)
    if not good.any():
        raise InputError(f"{path}: contains no {'usable rows' if bad.rows else 'rows'}")
    return t_ns[good], table[good], numbers_of_lines[good]


def _numbers(row: Row, count: int, bad: BadRows) -> list[float] | None:
    """Return the numbers of a row; None, with a note, for a row that has others."""
    line, text = row
    fields = text.decode("utf-8", "replace").split()
    if len(fields) != count:
        bad.note(COLUMNS, line, f"{len(fields)} columns; expected {count}")
    else:
        try:
            return [number_of(field) for field in fields]
        except ValueError:
            bad.note(NUMBERS, line, "not a row of numbers")
    bad.rows += 1
    return None
