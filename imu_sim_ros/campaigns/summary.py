# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A campaign's results in tables: per cell and estimator, against requirements, over parameters."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.campaigns.cells import word
from imu_sim_ros.campaigns.gate import Requirement
from imu_sim_ros.campaigns.metrics import SUCCESS
from imu_sim_ros.campaigns.results import Row, numbers
from imu_sim_ros.campaigns.statistics import (
    ConfidenceInterval,
    Sensitivity,
    means,
    quantile,
    sensitivity,
    statistic,
    success,
)
from imu_sim_ros.navigation.evaluation import LARGEST_SIGMA
from imu_sim_ros.types import Array


class Group(NamedTuple):
    """The runs of one estimator in one cell."""

    cell: str
    estimator: str
    rows: list[Row]
    grid: tuple[str, ...]

    @property
    def words(self) -> dict[str, str]:
        """What filters of requirements compare with."""
        values = {name: word(self.rows[0].get(name)) for name in self.grid}
        return {**values, "estimator": self.estimator}

    @property
    def align(self) -> str | None:
        """How the trajectories are aligned; None: unknown, or there is none."""
        found = self.rows[0].get("align")
        return None if found is None else str(found)

    @property
    def done(self) -> int:
        """Runs that succeeded."""
        return sum(row["status"] == "done" for row in self.rows)

    def success(self) -> ConfidenceInterval:
        """Return the share of runs that succeeded."""
        return success(self.done, len(self.rows))

    def values(self, metric: str) -> Array:
        """Return a metric (n,) of the runs that have it and are done; coverage also of others."""
        return np.array(numbers(self.rows, metric))

    def coverage(self) -> float | None:
        """Return the median coverage of all runs; None: there are no trajectories."""
        return quantile(self.values("coverage"), 0.5).value

    def not_valid(self, metric: str) -> bool:
        """Whether no run has a NEES since the attitude is known too badly for a covariance."""
        if not metric.startswith("nees_") or len(self.values(metric)):
            return False
        return bool(np.any(self.values("attitude_sigma_rad") > LARGEST_SIGMA))

    def value(self, requirement: Requirement) -> float | None:
        """Return the number that a requirement is about; None: there is none."""
        if requirement.metric == SUCCESS:
            return self.success().value
        return statistic(self.values(requirement.metric), requirement.statistic).value


def groups(rows: Iterable[Row], grid: Sequence[str]) -> list[Group]:
    """Return the runs by cell and estimator, in the order in which they come."""
    found: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        found[str(row["cell"]), str(row["estimator"])].append(row)
    return [Group(*key, members, tuple(grid)) for key, members in found.items()]


class Checked(NamedTuple):
    """A requirement, and what one group has."""

    requirement: str
    cell: str
    estimator: str
    value: float | None
    met: bool


def checked(found: Sequence[Group], require: Sequence[Requirement]) -> list[Checked]:
    """Return every requirement with each group that it concerns."""
    result = []
    for one in require:
        for group in found:
            if one.concerns(group.words):
                value = group.value(one)
                key = (group.cell, group.estimator)
                result.append(Checked(one.text, *key, value, one.holds(value)))
    return result


_SHOWN: Final = 10
"""Lines of a requirement; one more counts the others."""


def unmet_lines(require: Sequence[Requirement], results: Sequence[Checked]) -> list[str]:
    """Return a line for each requirement that is not met, and group."""
    lines: list[str] = []
    for text, one in {one.text: one for one in require}.items():
        name = f"{one.metric}.{one.statistic}" if one.statistic else one.metric
        of_text = []
        for result in results:
            if result.requirement == text and not result.met:
                value = "does not exist" if result.value is None else f"is {result.value:.4g}"
                where = f"{result.cell}; {result.estimator}"
                of_text.append(f"require {text}: {name} {value} ({where})")
        lines += of_text[:_SHOWN]
        if len(of_text) > _SHOWN:
            more = len(of_text) - _SHOWN
            lines.append(f"require {text}: not met {more} more times; report.html lists all")
    return lines


def summary_rows(found: Sequence[Group], metrics: Sequence[str]) -> list[dict[str, object]]:
    """Return one row of ``summary.csv`` for each group."""
    samples = [(group, metric, group.values(metric)) for group in found for metric in metrics]
    known = [(id(group), metric, values) for group, metric, values in samples if len(values)]
    of_group: dict[int, dict[str, tuple[ConfidenceInterval, Array]]] = defaultdict(dict)
    averages = means([values for *_, values in known])
    for (group, metric, values), average in zip(known, averages, strict=True):
        of_group[group][metric] = average, values
    return [_summary_row(group, of_group[id(group)]) for group in found]


def _summary_row(
    group: Group, metrics: dict[str, tuple[ConfidenceInterval, Array]]
) -> dict[str, object]:
    row: dict[str, object] = {
        "cell": group.cell,
        "estimator": group.estimator,
        **{name: group.rows[0].get(name) for name in group.grid},
        "runs": len(group.rows),
        "done": group.done,
    }
    _put(row, "success", group.success())
    for metric, (average, values) in metrics.items():
        _put(row, f"{metric}.mean", average)
        for name, p in (("median", 0.5), ("p5", 0.05), ("p95", 0.95)):
            _put(row, f"{metric}.{name}", quantile(values, p))
    return row


def _put(row: dict[str, object], name: str, interval: ConfidenceInterval) -> None:
    row[name], row[f"{name}.low"], row[f"{name}.high"] = interval


class Slope(NamedTuple):
    """How a metric grows with a parameter of the grid."""

    parameter: str
    estimator: str
    metric: str
    sensitivity: Sensitivity


def slopes(rows: Sequence[Row], grid: Sequence[str], metric: str) -> list[Slope]:
    """Return the sensitivities to every parameter of the grid that is a positive number."""
    result = []
    for estimator in dict.fromkeys(str(row["estimator"]) for row in rows):
        usable = [row for row in rows if row["estimator"] == estimator and numbers([row], metric)]
        for name in grid:
            values = [row.get(name) for row in usable]
            if not all(_positive(value) for value in values) or len(set(values)) < 2:
                continue
            found = sensitivity(
                np.array(values, dtype=float),
                np.array([row[metric] for row in usable], dtype=float),
                np.array([row["seed"] for row in usable], dtype=np.int64),
            )
            if found is not None:
                result.append(Slope(name, estimator, metric, found))
    return result


def _positive(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value > 0
