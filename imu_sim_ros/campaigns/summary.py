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

    def checked(self, requirement: Requirement, asked: int) -> "Checked":
        """Return a requirement with what this group has.

        :param asked: runs of the group that the plan asks for.
        """
        asked = max(asked, len(self.rows))
        if requirement.metric == SUCCESS:
            share, missing = self.done / asked, 0
            value: float | None = share
        else:
            rows = self.rows
            if requirement.of_done:
                rows = [row for row in rows if row["status"] == "done"]
                asked = len(rows)
            values = numbers(rows, requirement.metric)
            missing = asked - len(values)
            value = statistic(np.array(values), requirement.statistic).value
        return Checked(
            requirement.text,
            self.cell,
            self.estimator,
            value,
            asked,
            missing,
            requirement.holds(value) and not missing,
        )


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
    """Statistic of the runs that have a value; None: no run has."""
    runs: int
    """Runs of the group that the requirement is about."""
    missing: int
    """Runs among them without a value, which leave a requirement unmet."""
    met: bool

    @property
    def comment(self) -> str:
        """The value in words: ``is 0.3``, ``does not exist``."""
        if self.value is None:
            return "does not exist"
        if not self.missing:
            return f"is {self.value:.4g}"
        with_value = self.runs - self.missing
        none = "1 run has" if self.missing == 1 else f"{self.missing} runs have"
        return f"is {self.value:.4g} over {with_value} of {self.runs} runs; {none} no value"


def checked(found: Sequence[Group], require: Sequence[Requirement], asked: int) -> list[Checked]:
    """Return every requirement with each group that it concerns.

    :param asked: runs of each group that the plan asks for.
    """
    return [
        group.checked(requirement, asked)
        for requirement in require
        for group in found
        if requirement.concerns(group.words)
    ]


_SHOWN: Final = 10
"""Lines of a requirement; one more counts the others."""


def unmet_lines(require: Sequence[Requirement], results: Sequence[Checked]) -> list[str]:
    """Return a line for each requirement that is not met, and group."""
    lines: list[str] = []
    for text, requirement in {requirement.text: requirement for requirement in require}.items():
        of_text = [
            f"require {text}: {requirement.quantity} {result.comment} "
            f"({result.cell}; {result.estimator})"
            for result in results
            if result.requirement == text and not result.met
        ]
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
