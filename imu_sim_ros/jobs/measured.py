# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The recorded orientation, magnetic field or pressure against its truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from imu_sim_ros.bags import sensor_tables
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.bags.sensor_tables import TableRows, read_table
from imu_sim_ros.core import rotation
from imu_sim_ros.core.bad_rows import tell_skipped
from imu_sim_ros.core.errors import InputError, Problems
from imu_sim_ros.core.types import Array, JsonObject, Times
from imu_sim_ros.formats.door import has_topics, read_trajectory
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.jobs.attitude import (
    AttitudeEvaluation,
    SampleNees,
    compare_attitudes,
    heading_lines,
    nees_line,
    nees_of_errors,
    pair_counts,
)
from imu_sim_ros.jobs.tracks import assume_truth_topic
from imu_sim_ros.navigation.association import common_rows, interpolate_vectors
from imu_sim_ros.navigation.coverage import Coverage, coverage
from imu_sim_ros.sensors import reading_tables
from imu_sim_ros.terminal.text_tables import TextTable


@dataclass(frozen=True, repr=False)
class ReadingsEvaluation:
    """The errors of another sensor's readings, at the m times shared with the truth."""

    kind: str
    """The sensor's table: ``mag``, ``pressure``."""
    unit: str
    """Unit of the errors."""
    t_ns: Times
    """(m,) [ns]."""
    error: Array
    """(m, k) reading minus ideal reading."""
    error_without_bias: Array | None
    """(m, k) reading minus ideal reading and true bias; None: the recording has no true bias."""
    without_truth: int
    """Readings that are left out: the truth has none at their times."""
    coverage: Coverage
    """Share of the truth's time with readings."""
    nees: SampleNees | None
    """NEES of the samples that state a covariance: ``mean``, ``inside_band``, and what is
    expected."""
    no_nees: str | None
    """Why there is no NEES."""
    topic: str = ""
    """Topic of the readings."""

    def __repr__(self) -> str:
        rms = np.array2string(np.sqrt(np.mean(self.error**2, axis=0)), precision=3)
        return (
            f"<ReadingsEvaluation of {len(self.t_ns)} {self.kind}, {self.coverage.words()}: "
            f"{rms} {self.unit} rms>"
        )

    def to_dict(self) -> JsonObject:
        """Return all errors in plain types, as ``evaluate --json`` prints them."""
        free = self.error_without_bias
        return {
            "topic": self.topic,
            "kind": self.kind,
            **pair_counts(self.t_ns, self.without_truth, self.coverage),
            "unit": self.unit,
            "error": _moments(self.error),
            "error_without_bias": None if free is None else _moments(free),
            "nees": self.nees,
            "no_nees": self.no_nees,
        }

    def lines(self) -> Iterator[str | TextTable]:
        """Yield the text of the evaluation, as ``evaluate`` prints it."""
        yield from heading_lines(self.topic, self.t_ns, self.without_truth, self.coverage)
        yield from _moments_tables(self)
        yield nees_line(self.nees, self.no_nees)


def sensor_of(path: Path, topic: str | None) -> Table | None:
    """Return the table of a sensor that a topic of a bag, or a table of a folder, belongs to.

    None: a trajectory.
    """
    return None if topic is None else sensor_tables.table_of(path, topic, reading_tables())


def evaluate_measured(
    table: Table,
    estimate: tuple[Path, str],
    truth: tuple[Path, str | None],
    max_gap: float,
    imu: str | Path | None = None,
    skip_bad_rows: bool = False,
) -> AttitudeEvaluation | ReadingsEvaluation:
    """Compare a sensor's measurements with their truth.

    :param table: from :func:`sensor_of`.
    :param estimate: a recording and its topic.
    :param truth: likewise; None: the topic next to that of the readings.
    :param max_gap: the truth is not interpolated across longer gaps [s].
    :param imu: name or file of the IMU with the orientation, for its mounting; None: aligned.
    :param skip_bad_rows: leave out bad rows, and tell how many; else they are errors.
    :raises InputError: for what cannot be read or has no truth.
    """
    topic, problems = estimate[1], Problems()
    with problems.collect():
        measured = _read_measurements(table, *estimate, skip_bad_rows)
    if table.of_readings:
        with problems.collect():
            chosen = assume_truth_topic(*truth)
            poses = read_trajectory(truth[0], chosen, skip_bad_rows=skip_bad_rows)
        with problems.collect():
            mounting = _mounting(imu)
        problems.tell()
        attitudes = (measured.t_ns, measured.values, poses, max_gap)
        turned = compare_attitudes(*attitudes, mounting, measured.covariance)
        return replace(turned, topic=topic)
    truths = sensor_tables.truths_of(table, topic)
    with problems.collect():
        ideal = _ideal(table, truth[0], truth[1] or truths.ideal, skip_bad_rows)
    problems.tell()
    evaluation = _readings(table, measured, ideal, truths, truth[0], max_gap)
    return replace(evaluation, topic=topic)


def _read_measurements(table: Table, path: Path, topic: str, skip_bad_rows: bool) -> TableRows:
    """Return the measurements of a sensor.

    :raises InputError: for fewer than two values.
    """
    rows = read_table(path, table, topic, tell_skipped(path) if skip_bad_rows else None)
    where = f"{path}, {topic}"
    if table.of_readings and not len(rows.t_ns):
        raise InputError(f"{where}: no message has an orientation: orientation_covariance[0] is -1")
    if len(rows.t_ns) < 2:
        raise InputError(f"{where}: {len(rows.t_ns)} values; two or more are needed")
    return rows


def _ideal(table: Table, path: Path, topic: str, skip_bad_rows: bool) -> TableRows:
    """Return the ideal readings of a recording.

    :raises InputError: if it has none.
    """
    if not has_topics(path):
        raise InputError(f"{path}: has no {topic}; a bag that has it is needed")
    return read_table(path, table, topic, tell_skipped(path) if skip_bad_rows else None)


def _mounting(imu: str | Path | None) -> Array:
    """Return q_bi of the sensor that is named."""
    from imu_sim_ros.simulation.parameters import load_simulation  # few comparisons need a sensor

    layer = {} if imu is None else {"imu.preset": str(imu)}
    mounting = load_simulation(layer).imu.mounting
    return rotation.from_matrix(np.reshape(mounting, (3, 3)))


def _readings(
    table: Table,
    measured: TableRows,
    ideal: TableRows,
    truths: sensor_tables.Truths,
    path: Path,
    max_gap: float,
) -> ReadingsEvaluation:
    """Compare measured readings with the ideal readings of the same recording.

    The true bias, if it was recorded, is also subtracted from the errors, and what remains is
    compared with the covariance in the messages.

    :param truths: topics of the true values.
    :param path: path of the recording.
    :param max_gap: longest gap of the ideal readings that is interpolated [s].
    """
    rows = common_rows(measured.t_ns, ideal.t_ns, max_gap)
    t_ns = measured.t_ns[rows]
    errors = measured.values[rows] - interpolate_vectors(ideal.t_ns, ideal.values, t_ns)
    with open_bag(path) as bag:
        has_bias_topic = any(
            info.name.lstrip("/") == truths.bias.lstrip("/") for info in bag.topics
        )
    errors_without_bias = consistency = None
    why: str | None = f"the covariance is that of white noise, and there is no {truths.bias}"
    if has_bias_topic:
        bias_t_ns, bias = sensor_tables.read_bias(path, table, truths.bias)
        errors_without_bias = errors - interpolate_vectors(bias_t_ns, bias, t_ns)
        consistency, why = nees_of_errors(errors_without_bias, measured.covariance[rows])
    left_out = len(measured.t_ns) - len(rows)
    covered = coverage(measured.t_ns, ideal.t_ns, max_gap)
    what, nees = (table.name, table.quantity.unit), (consistency, why)
    return ReadingsEvaluation(*what, t_ns, errors, errors_without_bias, left_out, covered, *nees)


def _moments(errors: Array) -> dict[str, list[float]]:
    """Return mean, standard deviation, RMS and largest magnitude of errors per axis."""
    moments = {
        "mean": errors.mean(axis=0),
        "std": errors.std(axis=0),
        "rms": np.sqrt(np.mean(errors**2, axis=0)),
        "max": np.abs(errors).max(axis=0),
    }
    return {name: values.tolist() for name, values in moments.items()}


def _moments_tables(evaluation: ReadingsEvaluation) -> Iterator[TextTable]:
    """Yield tables of the errors of the readings."""
    parts = (
        ("reading minus truth", evaluation.error),
        ("and minus the true bias", evaluation.error_without_bias),
    )
    for title, errors in parts:
        if errors is not None:
            moments = _moments(errors)
            columns = np.array(list(moments.values())).T
            axes = "xyz" if len(columns) > 1 else ("",)
            rows = [
                [f"{axis} [{evaluation.unit}]".strip(), *(f"{value:.3g}" for value in row)]
                for axis, row in zip(axes, columns, strict=True)
            ]
            yield TextTable(["axis", *moments], rows, title)
