# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses of one body over time, and their forms as text: TUM (``t x y z qx qy qz qw``) and EuRoC."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.core import gate, rotation
from imu_sim_ros.core.bad_rows import NUMBERS
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import States, concatenate, replace_fields
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs import header
from imu_sim_ros.inputs.layout import TableForm, TableLayout, layout_of
from imu_sim_ros.inputs.row_reader import NumberRows, RowReader
from imu_sim_ros.inputs.rows import Row, number_of, shorten_word


def _alternatives(counts: tuple[int, ...]) -> str:
    """Return counts as text: 8, 9 or 44."""
    *initial, final = map(str, counts)
    return f"{', '.join(initial)} or {final}"


_POSE_COLUMNS: Final = 8
"""Number of columns of a stamp and a pose."""
_TRIANGLES: Final = 12
"""Columns of covariance: the upper triangles of that of rotation and that of position."""
_EUROC_PLAIN: Final = (_POSE_COLUMNS, 11, 17)  # pose; and velocity; and both biases
_EUROC_COLUMNS: Final = (*_EUROC_PLAIN, *(count + _TRIANGLES for count in _EUROC_PLAIN))
_TUM_COLUMNS: Final = (_POSE_COLUMNS, 14, _POSE_COLUMNS + _TRIANGLES)  # pose; OpenVINS: and more
_UPPER: Final = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
"""Columns of an upper triangle as the elements of its symmetric matrix."""
_POSE: Final = (header.POSITION, header.ORIENTATION)
_COLUMNS: Final = (*_POSE, header.VELOCITY)
"""Columns that are read; a velocity only if the header names it."""
_FORMS: Final = {
    ",": TableForm(
        {header.POSITION: (1, 2, 3), header.ORIENTATION: (4, 5, 6, 7)},
        _EUROC_COLUMNS,
        0,
        f"the EuRoC form has {_alternatives(_EUROC_COLUMNS)}",
    ),
    " ": TableForm(
        {header.POSITION: (1, 2, 3), header.ORIENTATION: (7, 4, 5, 6)},
        _TUM_COLUMNS,
        9,
        f"the TUM form has {_alternatives(_TUM_COLUMNS)}",
    ),
}
_WITH_COVARIANCE: Final = frozenset(count + _TRIANGLES for count in _EUROC_PLAIN)
_COVARIANCE_NAME: Final = "covariance"
_WHAT: Final = "a text file of poses"


def read_poses(
    path: str | Path,
    topic: str | None = None,
    skip_bad_rows: bool = False,
    covariance: bool = False,
) -> States:
    """Return the poses of a text file; commas mean EuRoC's form, spaces TUM's.

    A header decides the columns, with a velocity in the world if it names one. Without a header,
    TUM: seconds, position, quaternion x y z w, then perhaps the 6 or 12 columns of covariances that
    OpenVINS writes. EuRoC: nanoseconds, position, quaternion w x y z, then perhaps velocity and
    biases. Either may end in the 12 columns of covariance that OpenVINS writes (``ov_eval``): the
    upper triangles, row by row, of the covariance of the rotation about the body's axes [rad^2] and
    of the position [m^2]. Lines that start with # are comments.
    Stamps may go back, as on a topic of a bag.

    :param topic: must be None; for readers that know bags as well.
    :param skip_bad_rows: skip bad rows and count them.
    :param covariance: read the covariances too, if every row has them.
    :raises InputError: with the lines of all that is wrong, whatever it is.
    """
    path = Path(path)
    if topic is not None:
        raise InputError(f"{path}: a text file of poses has no topic {topic}")
    return _Reading(path, skip_bad_rows, covariance).poses()


class _Reading(RowReader):
    """A text file of poses."""

    def __init__(self, path: Path, skip: bool, covariance: bool) -> None:
        super().__init__(path, _WHAT, _COLUMNS)
        self._skip, self._covariance = skip, covariance

    def poses(self) -> States:
        """Return all poses, or raise with a line for every problem."""
        pieces = [self._good(rows) for block in self.blocks() for rows in block]
        if not self._skip:
            self.bad.complain()
        if self.layout is None:
            raise InputError(f"{self.path}: contains no poses")
        blocks = [poses for poses in pieces if len(poses)]
        count = sum(map(len, blocks))
        if count < 2:
            what = "one pose" if count else "no usable pose"
            raise InputError(f"{self.path}: contains {what}; a trajectory needs two or more")
        return replace_fields(
            concatenate(blocks),
            source=str(self.path),
            skipped=self.bad.rows,
        )

    def layout_of(self, rows: list[Row]) -> TableLayout:
        """Return the layout of the file, and remove its header from its first rows."""
        layout = layout_of(self.path, self.comments, rows, _FORMS, _POSE)
        for name in _POSE:
            if name not in layout.columns:
                raise InputError(
                    f"{self.path}: the header has no {name}; known are {header.KNOWN[name]}"
                )
        return layout

    def parse(self, layout: TableLayout, rows: list[Row]) -> NumberRows:
        """Return poses as numbers, with their covariances (n, 6, 6) if all of them have some.

        :raises ValueError, OverflowError: if one of them cannot be converted.
        """
        poses = super().parse(layout, rows)
        covariance = self._covariances(layout, rows)
        return (
            poses
            if covariance is None
            else poses._replace(values={**poses.values, _COVARIANCE_NAME: covariance})
        )

    def note(self, layout: TableLayout, line: int, text: bytes) -> None:
        """Note why a row is no pose."""
        super().note(layout, line, text)
        cells = layout.row_format.cells(text)
        if self._covariance and len(cells) in _WITH_COVARIANCE:
            for cell in cells[-_TRIANGLES:]:
                field = cell.strip().decode("utf-8", "replace")
                if not _is_finite(field):
                    reason = f"{shorten_word(field)} is not a finite number of a covariance"
                    self.bad.note(NUMBERS, line, reason)

    def _good(self, rows: NumberRows) -> States:
        """Return the poses that are possible."""
        poses = States.unchecked(
            t_ns=rows.t_ns,
            position=rows.values[header.POSITION],
            q_wb=rows.values[header.ORIENTATION],
            velocity=rows.values.get(header.VELOCITY),
            covariance=rows.values.get(_COVARIANCE_NAME),
            lines=rows.lines,
        )
        good = self._valid(poses)
        self.bad.good += len(good)
        return good

    def _covariances(self, layout: TableLayout, rows: list[Row]) -> Array | None:
        """Return the covariances (n, 6, 6) of position and of rotation about the body's axes.

        None if not all of these rows have them.

        :raises ValueError: if one of their columns is not a number.
        """
        if not self._covariance:
            return None
        cells = [layout.row_format.cells(text) for _, text in rows]
        columns = {len(row) for row in cells}
        if len(columns) > 1 or not columns <= _WITH_COVARIANCE:
            return None
        texts = [[cell.decode("latin-1") for cell in row[-_TRIANGLES:]] for row in cells]
        triangles: Array = np.array(texts).astype(np.float64)
        if not np.isfinite(triangles).all():
            raise ValueError("covariance")
        covariance = np.zeros((len(rows), 6, 6))
        covariance[:, :3, :3] = triangles[:, 6:][:, _UPPER]
        covariance[:, 3:, 3:] = triangles[:, :6][:, _UPPER]
        return covariance

    def _valid(self, poses: States) -> States:
        """Return the poses that the gate passes, their quaternions made exact."""
        verdict = gate.poses(poses.t_ns, poses.position, poses.q_wb, poses.velocity)
        verdict.note(self.bad, poses.lines)
        valid = poses.rows(verdict.good)
        q_wb, covariance = rotation.normalise(valid.q_wb), valid.covariance
        if covariance is not None:
            covariance = _about_world(covariance, q_wb)
        return replace_fields(valid, q_wb=q_wb, covariance=covariance)


def _is_finite(field: str) -> bool:
    """Return True for a cell with a finite number."""
    try:
        return bool(np.isfinite(number_of(field)))
    except ValueError:
        return False


def _about_world(covariance: Array, q_wb: Array) -> Array:
    """Return covariances (n, 6, 6) with the rotation about the world's, not the body's axes.

    :param q_wb: (n, 4) attitudes.
    """
    r_wb = rotation.to_matrix(q_wb)
    turned = covariance.copy()
    turned[:, 3:, 3:] = r_wb @ covariance[:, 3:, 3:] @ np.swapaxes(r_wb, 1, 2)
    return turned


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
            columns = " ".join(f"{value:.12g}" for value in row)
            file.write(f"{sign}{second}.{nanosecond:09d} {columns}\n")
