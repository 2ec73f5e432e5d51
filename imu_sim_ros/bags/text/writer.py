# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Datasets as text: EuRoC/ASL folders, CSV in kalibr's form, TUM trajectories.

Times are exact nanoseconds; numbers have as many digits as a float64 needs.
"""

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.outputs import OutputFile, make_folder
from imu_sim_ros.bags.text import decimals
from imu_sim_ros.bags.text.decimals import decimal
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.core.records import States
from imu_sim_ros.core.rotation import pose_matrix
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.terminal.progress import current_watcher

POSES_OF_TABLES: Final = "groundtruth.tum"
"""The true poses in a folder of kalibr's tables, as ``--format csv`` writes it."""

FORMATS: Final = ("euroc", "csv", "tum")
_ROWS: Final = 4096
"""Number of rows that are formatted at once."""

EUROC_IMU_HEADER: Final = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
)
EUROC_STATE_HEADER: Final = (
    "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
    "q_RS_z [], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], "
    "b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], "
    "b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]"
)
STATE_FOLDER: Final = "state_groundtruth_estimate"
"""EuRoC's name, followed by the number of the IMU."""
KALIBR_HEADER: Final = "timestamp,omega_x,omega_y,omega_z,alpha_x,alpha_y,alpha_z"
TUM_HEADER: Final = "# timestamp tx ty tz qx qy qz qw"


WITH_TABLES: Final = ("euroc", "csv")
"""Forms that have tables other than the readings of an IMU."""


class _Counted(NamedTuple):
    """State of a file after its complete rows."""

    position: int
    rows: int
    last_ns: int


class TextFile:
    """One file of rows, written in blocks."""

    def __init__(self, path: Path, header: str) -> None:
        self.file = OutputFile(path)
        self.file.write(header.encode() + b"\n")
        self._counted = _Counted(self.file.position, 0, -1)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self._counted.rows

    @property
    def last_ns(self) -> int:
        """The last time of all rows."""
        return self._counted.last_ns

    def cut(self) -> None:
        """Drop rows that were written but not counted before a signal."""
        self.file.cut(self._counted.position)

    def write(self, t_ns: Times, values: Array, separator: str = ",") -> None:
        """Append n rows: a time, and the columns of values (n, m)."""
        for start in range(0, len(t_ns), _ROWS):
            part = slice(start, start + _ROWS)
            stamps = decimals.rows if separator == "," else decimals.seconds
            self.file.write(decimals.lines([stamps(t_ns[part]), values[part]], separator))
            last_ns = max(self.last_ns, int(t_ns[part].max()))
            # In one step: a signal finds all of it or nothing.
            self._counted = _Counted(self.file.position, self.rows + len(t_ns[part]), last_ns)


DATASET_SUFFIXES: Final = {".csv": "csv", ".tum": "tum", ".txt": "tum"}
"""Forms by the names of files."""
TEXT_SUFFIXES: Final = (*DATASET_SUFFIXES, ".tsv", ".dat")
"""Endings of the names of text files that are read."""


class Dataset:
    """A dataset of text that is being written; use as a context manager."""

    def __init__(
        self,
        path: Path,
        form: str,
        states: bool = True,
        imus: int = 1,
        tables: Sequence[tuple[Table, int]] = (),
    ) -> None:
        """Make the files.

        ``euroc``: a folder with imu0 and state_groundtruth_estimate0, and so on for each IMU.
        ``csv``: a folder with imu0.csv, imu1.csv, ... and groundtruth.tum, or one file of readings
        if the name ends in .csv. ``tum``: one file of poses.

        :param states: write the truth.
        :param imus: number of IMUs.
        :param tables: further tables, mag0 and so on, each with the IMU's number.
        :raises InputError: for a place that cannot be used, and several IMUs in one file.
        """
        if form not in FORMATS:
            raise InputError(f"format {form!r}: {suggestion(form, FORMATS)}")
        self.path, self.form = path, form
        self.imus: list[TextFile] = []
        self.truths: list[TextFile] = []
        """EuRoC's files of the truth: one for each IMU, with its biases."""
        self.tables: dict[tuple[str, int], TextFile] = {}
        if form == "tum":
            self.truths = [TextFile(path, TUM_HEADER)]
        elif form == "csv" and path.suffix.lower() == ".csv":
            if imus > 1:
                raise InputError(
                    f"{path}: one table has room for one IMU, not {imus}; name a folder, "
                    f"with {argument('format', 'csv')}"
                )
            self.imus = [TextFile(path, KALIBR_HEADER)]
        else:
            make_folder(path)
            if form == "csv":
                self.imus = [TextFile(path / f"imu{k}.csv", KALIBR_HEADER) for k in range(imus)]
                if states:
                    self.truths = [TextFile(path / POSES_OF_TABLES, TUM_HEADER)]
            else:
                for k in range(imus):
                    folder = path / f"imu{k}"
                    folder.mkdir()
                    self.imus.append(TextFile(folder / "data.csv", EUROC_IMU_HEADER))
                    if states:
                        folder = path / f"{STATE_FOLDER}{k}"
                        folder.mkdir()
                        self.truths.append(TextFile(folder / "data.csv", EUROC_STATE_HEADER))
        for table, k in tables:
            if form not in WITH_TABLES or not path.is_dir():
                raise InputError(f"{path}: has room for readings of an IMU only; name a folder")
            file = path / f"{table.name}{k}.csv"
            if form == "euroc":
                file = path / f"{table.name}{k}" / "data.csv"
                file.parent.mkdir()
            self.tables[table.name, k] = TextFile(file, table.headers[form])

    @property
    def imu(self) -> TextFile | None:
        """The readings of the first IMU, if the form has some."""
        return next(iter(self.imus), None)

    @property
    def truth(self) -> TextFile | None:
        """The truth, if it is written."""
        return next(iter(self.truths), None)

    @property
    def rows(self) -> int:
        """Rows of all files so far."""
        return sum(file.rows for file in self._open)

    @property
    def last_ns(self) -> int:
        """The last time of all rows; -1 without any."""
        return max((file.last_ns for file in self._open), default=-1)

    @property
    def _open(self) -> list[TextFile]:
        """All files that are written."""
        return [*self.imus, *self.truths, *self.tables.values()]

    def write_imu(self, t_ns: Times, gyro: Array, accel: Array, index: int = 0) -> None:
        """Write readings: times (n,), angular rates (n, 3), specific forces (n, 3).

        :param index: index of the IMU.
        """
        if self.imus:
            self.imus[index].write(t_ns, np.concatenate([gyro, accel], axis=1))

    def write_table(self, name: str, index: int, t_ns: Times, values: Array) -> None:
        """Write rows of a table other than the readings of an IMU: times (n,) and values (n, m)."""
        self.tables[name, index].write(t_ns, values)

    def write_states(self, states: States, biases: Array | None = None, index: int = 0) -> None:
        """Write true states.

        :param biases: (n, 6) biases of gyroscope [rad/s] and accelerometer [m/s^2]; None: zeros.
        :param index: number of the IMU that has the biases.
        """
        if not self.truths:
            return
        if self.form == "euroc":
            if biases is None:
                biases = np.zeros((len(states), 6))
            columns = (states.position, states.q_wb, states.velocities(), biases)
            self.truths[index].write(states.t_ns, np.concatenate(columns, axis=1))
        else:
            q_xyzw = states.q_wb[:, [1, 2, 3, 0]]
            self.truths[index].write(
                states.t_ns, np.concatenate([states.position, q_xyzw], axis=1), " "
            )

    def __enter__(self) -> "Dataset":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with current_watcher().undisturbed():
            self._close(kind)

    def _close(self, kind: type[BaseException] | None) -> None:
        """Finish all files; after an error they keep partial names, after a signal whole rows.

        :param kind: type of the exception that ended the block; None: it ended as it should.
        """
        tables = self._open
        for table in tables:
            if kind is not None:
                table.cut()
            if kind is None or (self.rows and not issubclass(kind, Exception)):
                table.file.finish()
            else:
                table.file.abandon(empty=not any(written.rows for written in tables))
        if kind is not None and not any(table.rows for table in tables) and self.path.is_dir():
            shutil.rmtree(self.path)


def write_euroc_descriptions(
    folder: Path,
    rate: float,
    noise: dict[str, float],
    r_bi: Array,
    p_bi: Array,
    comment: str,
    states: bool = True,
    index: int = 0,
) -> None:
    """Write sensor.yaml of an IMU and its states, and body.yaml.

    :param index: index of the IMU.
    :param noise: the four densities by kalibr's names; nothing if they are not known.
    :param r_bi: (3, 3) orientation of the IMU on the body.
    :param p_bi: (3,) position of the IMU on the body [m].
    """
    (folder / "body.yaml").write_text(f"# body\ncomment: {comment}\n", encoding="utf-8")
    densities = "".join(f"{name}: {decimal(value)}\n" for name, value in noise.items())
    (folder / f"imu{index}" / "sensor.yaml").write_text(
        f"# IMU\nsensor_type: imu\ncomment: {comment}\n\n"
        f"# T_BS maps points of the sensor into the body.\n{_pose(r_bi, p_bi)}\n"
        f"rate_hz: {rate:g}\n\n"
        "# Continuous time: rad/s/sqrt(Hz), rad/s^2/sqrt(Hz), m/s^2/sqrt(Hz), m/s^3/sqrt(Hz).\n"
        f"{densities}",
        encoding="utf-8",
    )
    if states:
        (folder / f"{STATE_FOLDER}{index}" / "sensor.yaml").write_text(
            f"# Truth of the body, without error\nsensor_type: visual-inertial\n"
            f"comment: {comment}\n\n{_pose(np.eye(3), np.zeros(3))}",
            encoding="utf-8",
        )


def write_euroc_table(
    folder: Path, table: Table, index: int, rate: float, r_bi: Array, p_bi: Array, comment: str
) -> None:
    """Write sensor.yaml of a table other than the readings of an IMU; arguments as above."""
    (folder / f"{table.name}{index}" / "sensor.yaml").write_text(
        f"# {table.title}\nsensor_type: {table.name}\ncomment: {comment}\n\n"
        f"# T_BS maps points of the sensor into the body.\n{_pose(r_bi, p_bi)}\n"
        f"rate_hz: {rate:g}\n",
        encoding="utf-8",
    )


def _pose(r: Array, p: Array) -> str:
    """Return a rigid motion as OpenCV's matrix ``T_BS`` in YAML."""
    matrix = pose_matrix(r, p)
    rows = ",\n         ".join(", ".join(decimal(value) for value in row) for row in matrix)
    return f"T_BS:\n  cols: 4\n  rows: 4\n  data: [{rows}]\n"
