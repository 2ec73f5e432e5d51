# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A campaign's results in tables: per cell, compared in pairs, and over parameters."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.campaign.cells import word
from imu_sim_ros.campaign.gate import SUCCESS, Requirement
from imu_sim_ros.campaign.results import Row, numbers
from imu_sim_ros.campaign.statistics import (
    Comparison,
    Interval,
    Sensitivity,
    compare,
    holm,
    mean,
    quantile,
    sensitivity,
    statistic,
    success,
)
from imu_sim_ros.navigation.comparison import LARGEST_SIGMA

SIGNIFICANT: Final = 0.05
_KEYS: Final = ("cell", "estimator")


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
    def done(self) -> int:
        """Runs that succeeded."""
        return sum(row["status"] == "done" for row in self.rows)

    def success(self) -> Interval:
        """Return the share of runs that succeeded."""
        return success(self.done, len(self.rows))

    def values(self, metric: str) -> Any:
        """Return a metric (n,) of the runs that have it."""
        return np.array(numbers(self.rows, metric))

    def not_valid(self, metric: str) -> bool:
        """Whether no run has a NEES since the attitude is known too badly for a covariance."""
        if not metric.startswith("nees_") or len(self.values(metric)):
            return False
        return bool(np.any(self.values("attitude_sigma_rad") > LARGEST_SIGMA))


def groups(rows: Iterable[Row], grid: Sequence[str]) -> list[Group]:
    """Return the runs by cell and estimator, in the order in which they come."""
    found: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        found[str(row["cell"]), str(row["estimator"])].append(row)
    return [Group(*key, members, tuple(grid)) for key, members in found.items()]


class Unmet(NamedTuple):
    """A requirement that a group does not meet."""

    requirement: Requirement
    group: Group
    value: float | None

    def line(self) -> str:
        """Return it in a line."""
        found = "does not exist" if self.value is None else f"is {self.value:.4g}"
        name = self.requirement.metric
        if self.requirement.statistic:
            name += f".{self.requirement.statistic}"
        return (
            f"require {self.requirement.text}: {name} {found} "
            f"({self.group.cell}; {self.group.estimator})"
        )


def unmet(found: Sequence[Group], require: Sequence[Requirement]) -> list[Unmet]:
    """Return every requirement that is not met, for each group that it concerns."""
    result = []
    for requirement in require:
        for group in found:
            if requirement.concerns(group.words):
                value = _value(group, requirement)
                if not requirement.holds(value):
                    result.append(Unmet(requirement, group, value))
    return result


def unmet_lines(failed: Sequence[Unmet], shown: int = 10) -> list[str]:
    """Return a line for each requirement that is not met, and group.

    :param shown: how many lines of a requirement; one more counts the others.
    """
    lines: list[str] = []
    for text in dict.fromkeys(one.requirement.text for one in failed):
        of_text = [one.line() for one in failed if one.requirement.text == text]
        lines += of_text[:shown]
        if len(of_text) > shown:
            more = len(of_text) - shown
            lines.append(f"require {text}: not met {more} more times; report.html lists all")
    return lines


def unused(found: Sequence[Group], require: Sequence[Requirement]) -> list[Requirement]:
    """Return the requirements that apply to no group: a typo in a filter would go unnoticed."""
    return [one for one in require if not any(one.concerns(group.words) for group in found)]


def _value(group: Group, requirement: Requirement) -> float | None:
    if requirement.metric == SUCCESS:
        return group.success().value
    return statistic(group.values(requirement.metric), requirement.statistic).value


SUMMARY_STATISTICS: Final = ("median", "mean", "p5", "p95")


def summary_rows(found: Sequence[Group], metrics: Sequence[str]) -> list[dict[str, Any]]:
    """Return one row of ``summary.csv`` for each group."""
    return [_summary_row(group, metrics) for group in found]


def _summary_row(group: Group, metrics: Sequence[str]) -> dict[str, Any]:
    row: dict[str, Any] = {
        "cell": group.cell,
        "estimator": group.estimator,
        **{name: group.rows[0].get(name) for name in group.grid},
        "runs": len(group.rows),
        "done": group.done,
    }
    _put(row, "success", group.success())
    for metric in metrics:
        values = group.values(metric)
        if not len(values):
            continue
        _put(row, f"{metric}.mean", mean(values))
        for name, p in (("median", 0.5), ("p5", 0.05), ("p95", 0.95)):
            _put(row, f"{metric}.{name}", quantile(values, p))
    return row


def _put(row: dict[str, Any], name: str, interval: Interval) -> None:
    row[name], row[f"{name}.low"], row[f"{name}.high"] = interval


class Pair(NamedTuple):
    """Two groups, or one group before and after, compared on the same seeds."""

    a: str
    b: str
    comparison: Comparison
    p: float | None
    """Corrected for the number of comparisons."""

    @property
    def significant(self) -> bool:
        """Whether the difference is more than chance."""
        return self.p is not None and self.p < SIGNIFICANT


def compared(found: Sequence[Group], metric: str) -> list[Pair]:
    """Compare estimators within each cell, and the values of each axis of the grid.

    Only groups that differ in one thing are compared: the estimator, or one value of the grid.
    """
    names, results = [], []
    for a, b in _neighbours(found):
        comparison = paired(a.rows, b.rows, metric)
        if comparison is not None:
            names.append((_label(a), _label(b)))
            results.append(comparison)
    return _corrected(names, results)


def against_baseline(found: Sequence[Group], before: Sequence[Group], metric: str) -> list[Pair]:
    """Compare each group with the same one of an earlier campaign."""
    earlier = {(group.cell, group.estimator): group for group in before}
    names, results = [], []
    for group in found:
        old = earlier.get((group.cell, group.estimator))
        comparison = paired(group.rows, old.rows, metric) if old is not None else None
        if comparison is not None:
            names.append((_label(group), "baseline"))
            results.append(comparison)
    return _corrected(names, results)


def paired(a: Sequence[Row], b: Sequence[Row], metric: str) -> Comparison | None:
    """Compare a metric on the seeds that both have; None where there are none."""
    ours, theirs = _by_seed(a, metric), _by_seed(b, metric)
    seeds = sorted(set(ours) & set(theirs))
    if not seeds:
        return None
    return compare(
        np.array([ours[seed] for seed in seeds]), np.array([theirs[seed] for seed in seeds])
    )


def _by_seed(rows: Sequence[Row], metric: str) -> dict[int, float]:
    return {int(row["seed"]): numbers([row], metric)[0] for row in rows if numbers([row], metric)}


def _corrected(names: Sequence[tuple[str, str]], results: Sequence[Comparison]) -> list[Pair]:
    p_values = holm([result.p for result in results])
    return [
        Pair(a, b, result, p) for (a, b), result, p in zip(names, results, p_values, strict=True)
    ]


def _label(group: Group) -> str:
    return f"{group.cell}; {group.estimator}"


def _neighbours(found: Sequence[Group]) -> Iterable[tuple[Group, Group]]:
    """Yield pairs that differ in the estimator alone, or in one value of the grid alone."""
    index: dict[tuple[tuple[str, str], ...], list[Group]] = defaultdict(list)
    for group in found:
        words = sorted(group.words.items())
        for k in range(len(words)):
            key = (*words[:k], (words[k][0], "*"), *words[k + 1 :])
            index[key].append(group)
    for members in index.values():
        for k, a in enumerate(members):
            for b in members[k + 1 :]:
                yield a, b


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
