# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of a campaign's results: by cell and estimator, by requirement, over parameters."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.campaigns.cells import value_text
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
from imu_sim_ros.core.types import Array
from imu_sim_ros.navigation.evaluation import LARGEST_SIGMA


class Group(NamedTuple):
    """The runs of one estimator in one cell."""

    cell: str
    estimator: str
    rows: list[Row]
    grid: tuple[str, ...]

    @property
    def labels(self) -> dict[str, str]:
        """Labels with which the filters of requirements compare: grid values and estimator."""
        values = {name: value_text(self.rows[0].get(name)) for name in self.grid}
        return {**values, "estimator": self.estimator}

    @property
    def align(self) -> str | None:
        """Alignment of the trajectories; None: unknown, or there are none."""
        align = self.rows[0].get("align")
        return None if align is None else str(align)

    @property
    def done(self) -> int:
        """Number of runs that succeeded."""
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

    def is_invalid(self, metric: str) -> bool:
        """Return True if the attitude of all runs is too uncertain for this NEES."""
        if not metric.startswith("nees_") or len(self.values(metric)):
            return False
        return bool(np.any(self.values("attitude_sigma_rad") > LARGEST_SIGMA))

    def check(self, requirement: Requirement, requested: int) -> "RequirementCheck":
        """Return whether this group meets a requirement.

        :param requested: number of the group's runs that the plan asks for.
        """
        requested = max(requested, len(self.rows))
        if requirement.metric == SUCCESS:
            share, missing = self.done / requested, 0
            value: float | None = share
        else:
            rows = self.rows
            if requirement.done_only:
                rows = [row for row in rows if row["status"] == "done"]
                requested = len(rows)
            values = numbers(rows, requirement.metric)
            missing = requested - len(values)
            value = statistic(np.array(values), requirement.statistic).value
        return RequirementCheck(
            requirement=requirement.text,
            cell=self.cell,
            estimator=self.estimator,
            value=value,
            runs=requested,
            missing=missing,
            met=requirement.holds(value) and not missing,
        )


def group_runs(rows: Iterable[Row], grid: Sequence[str]) -> list[Group]:
    """Return the runs by cell and estimator, in the order in which they come."""
    members_of: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        members_of[str(row["cell"]), str(row["estimator"])].append(row)
    return [Group(*key, members, tuple(grid)) for key, members in members_of.items()]


class RequirementCheck(NamedTuple):
    """Result of a requirement for one group."""

    requirement: str
    cell: str
    estimator: str
    value: float | None
    """Statistic of the runs that have a value; None: no run has one."""
    runs: int
    """Number of runs of the group that the requirement concerns."""
    missing: int
    """Number of runs among them without a value; a requirement with such runs is not met."""
    met: bool

    @property
    def comment(self) -> str:
        """The value as text: ``is 0.3``, ``does not exist``."""
        if self.value is None:
            return "does not exist"
        if not self.missing:
            return f"is {self.value:.4g}"
        with_value = self.runs - self.missing
        none = "1 run has" if self.missing == 1 else f"{self.missing} runs have"
        return f"is {self.value:.4g} over {with_value} of {self.runs} runs; {none} no value"


def check_requirements(
    groups: Sequence[Group], require: Sequence[Requirement], requested: int
) -> list[RequirementCheck]:
    """Return the result of every requirement for each group that it concerns.

    :param requested: runs of each group that the plan asks for.
    """
    return [
        group.check(requirement, requested)
        for requirement in require
        for group in groups
        if requirement.concerns(group.labels)
    ]


_MAX_LINES: Final = 10
"""Largest number of lines of a requirement, before a line with the number of further ones."""


def unmet_lines(require: Sequence[Requirement], checks: Sequence[RequirementCheck]) -> list[str]:
    """Return a line for each requirement that is not met, and group."""
    lines: list[str] = []
    for text, requirement in {requirement.text: requirement for requirement in require}.items():
        problems = [
            f"require {text}: {requirement.quantity} {check.comment} "
            f"({check.cell}; {check.estimator})"
            for check in checks
            if check.requirement == text and not check.met
        ]
        lines += problems[:_MAX_LINES]
        if len(problems) > _MAX_LINES:
            hidden = len(problems) - _MAX_LINES
            lines.append(f"require {text}: not met {hidden} more times; report.html lists all")
    return lines


def summary_rows(groups: Sequence[Group], metrics: Sequence[str]) -> list[dict[str, object]]:
    """Return one row of ``summary.csv`` for each group."""
    samples = [(group, metric, group.values(metric)) for group in groups for metric in metrics]
    available = [(id(group), metric, values) for group, metric, values in samples if len(values)]
    by_group: dict[int, dict[str, tuple[ConfidenceInterval, Array]]] = defaultdict(dict)
    averages = means([values for *_, values in available])
    for (group, metric, values), average in zip(available, averages, strict=True):
        by_group[group][metric] = average, values
    return [_summary_row(group, by_group[id(group)]) for group in groups]


def _summary_row(
    group: Group, metrics: dict[str, tuple[ConfidenceInterval, Array]]
) -> dict[str, object]:
    """Return the row of the summary for one group of runs."""
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
    """Add an estimate and the ends of its interval to a row."""
    row[name], row[f"{name}.low"], row[f"{name}.high"] = interval


class Slope(NamedTuple):
    """Sensitivity of a metric to a parameter of the grid."""

    parameter: str
    estimator: str
    metric: str
    sensitivity: Sensitivity


def slopes(rows: Sequence[Row], grid: Sequence[str], metric: str) -> list[Slope]:
    """Return the sensitivities to every parameter of the grid that is a positive number."""
    estimates = []
    for estimator in dict.fromkeys(str(row["estimator"]) for row in rows):
        usable = [row for row in rows if row["estimator"] == estimator and numbers([row], metric)]
        for name in grid:
            values = [row.get(name) for row in usable]
            if not all(_positive(value) for value in values) or len(set(values)) < 2:
                continue
            slope = sensitivity(
                np.array(values, dtype=float),
                np.array([row[metric] for row in usable], dtype=float),
                np.array([row["seed"] for row in usable], dtype=np.int64),
            )
            if slope is not None:
                estimates.append(Slope(name, estimator, metric, slope))
    return estimates


def _positive(value: object) -> bool:
    """Return True for a number above 0."""
    return isinstance(value, int | float) and not isinstance(value, bool) and value > 0
