# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Requirements on a campaign's results: a small grammar of its own, never evaluated as code.

::

    requirement = value "<" | "<=" | ">" | ">=" number [ "@" filter { "," filter } ]
    value       = "success" | metric "." statistic [ "of done" ]
    filter      = name "=" value          a grid's value, or estimator=NAME

``ate_rmse_m.p95 < 0.10``, ``success >= 0.98 @ imu=bmi088, estimator=midpoint``. A statistic is one
of all runs that were asked for, and does not exist if a run has no value; with ``of done``
(``ate_rmse_m.p95 of done < 0.10``), it is one of the runs that are done.
"""

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

from imu_sim_ros.campaigns.cells import Axis, value_text
from imu_sim_ros.campaigns.metrics import SUCCESS, is_share
from imu_sim_ros.core.errors import ConfigurationError, Problems
from imu_sim_ros.core.names import suggestion

STATISTICS: Final = ("median", "mean", "p5", "p25", "p75", "p90", "p95", "p99", "min", "max")

_OPERATORS: Final[dict[str, Callable[[float, float], bool]]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_FORM = re.compile(
    rf"\s*(?P<value>\w[\w.]*)(?P<done>\s+of\s+done)?\s*(?P<operator><=|>=|<|>)"
    rf"\s*(?P<limit>{_NUMBER})(?P<done_after>\s+of\s+done)?\s*(?:@(?P<filters>.+))?"
)


class Requirement(NamedTuple):
    """One line of ``require``."""

    text: str
    metric: str
    """``success``, or the name of a metric."""
    statistic: str
    operator: str
    limit: float
    filters: tuple[tuple[str, str], ...]
    done_only: bool = False
    """True if the statistic is taken over the runs that are done alone."""

    @property
    def quantity(self) -> str:
        """The quantity with a limit: ``success``, or metric and statistic."""
        return f"{self.metric}.{self.statistic}" if self.statistic else self.metric

    def concerns(self, labels: Mapping[str, str]) -> bool:
        """Return whether this applies to a group, by the group's labels."""
        return all(labels.get(name) == value for name, value in self.filters)

    def holds(self, value: float | None) -> bool:
        """Return whether a value is within the limit; None is not."""
        return value is not None and _OPERATORS[self.operator](value, self.limit)


def parse(
    lines: object, metrics: Sequence[str], axes: Sequence[Axis], estimators: Sequence[str]
) -> list[Requirement]:
    """Return the requirements of a plan.

    :param metrics: the names of all metrics.
    :param axes: the grid, of whose values a filter may name one.
    :param estimators: the names of the estimators, of which a filter may name one.
    :raises ConfigurationError: with a line for each problem.
    """
    if lines is None:
        return []
    if not isinstance(lines, list):
        raise ConfigurationError(
            f"require = {lines!r}: must be a list such as [ate_rmse_m.p95 < 0.1]"
        )
    filtered = [*axes, Axis(("estimator",), tuple((name,) for name in estimators))]
    requirements: list[Requirement] = []
    problems = Problems()
    for line in lines:
        with problems.collect():
            requirements.append(_requirement(str(line), metrics, filtered))
    problems.tell()
    return requirements


def _requirement(line: str, metrics: Sequence[str], axes: Sequence[Axis]) -> Requirement:
    """Return the requirement that a line of ``require`` states.

    :raises ConfigurationError: for a line of another form.
    """
    match = _FORM.fullmatch(line)
    if match is None:
        raise ConfigurationError(
            f"require: {line[:80]!r}: must be METRIC.STATISTIC or success, one of < <= > >=, and a "
            "number; then optionally @ NAME=VALUE, ..."
        )
    metric, _, statistic = match["value"].partition(".")
    done_only = bool(match["done"] or match["done_after"])
    limit = float(match["limit"])
    problems = []
    if metric != SUCCESS and metric not in metrics:
        problems.append(f"require: {metric}: {suggestion(metric, [SUCCESS, *metrics])}")
    if metric == SUCCESS and statistic:
        problems.append(f"require: {match['value']}: success has no statistics")
    if metric == SUCCESS and done_only:
        problems.append("require: success of done: success is the share of all runs that are done")
    if metric != SUCCESS and statistic not in STATISTICS:
        hint = suggestion(statistic, STATISTICS)
        problems.append(f"require: {match['value']}: the statistic {statistic!r}: {hint}")
    if is_share(metric) and not 0.0 <= limit <= 1.0:
        problems.append(
            f"require: {line.strip()!r}: {metric} is a share, whose limit must be at least 0 "
            "and at most 1"
        )
    filters, complaints = _filters(match["filters"], axes)
    problems += complaints
    if problems:
        raise ConfigurationError(problems)
    return Requirement(
        text=line.strip(),
        metric=metric,
        statistic=statistic,
        operator=match["operator"],
        limit=limit,
        filters=filters,
        done_only=done_only,
    )


def _filters(
    text: str | None, axes: Sequence[Axis]
) -> tuple[tuple[tuple[str, str], ...], list[str]]:
    """Return the filters of a requirement, and a line for each that no cell can match.

    :param axes: axes of the grid, and the estimators as one more.
    """
    filters, problems = [], []
    names = sorted(name for axis in axes for name in axis.names)
    for part in text.split(",") if text else []:
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or name not in names:
            problems.append(
                f"require: {part.strip()!r}: must be NAME=VALUE with one of {', '.join(names)}"
            )
            continue
        filters.append((name, value))
    for axis in (axis for axis in axes if axis.rows):  # else its own line says what is wrong
        chosen = [(name, value) for name, value in filters if name in axis.names]
        rows = [dict(zip(axis.names, map(value_text, row), strict=True)) for row in axis.rows]
        for name, value in chosen:
            values = list(dict.fromkeys(row[name] for row in rows))
            if value not in values:
                problems.append(f"require: {name}={value}: {suggestion(value, values)}")
                rows = []
        if rows and not any(all(row[name] == value for name, value in chosen) for row in rows):
            together = ", ".join(f"{name}={value}" for name, value in chosen)
            problems.append(f"require: {together}: no cell has these values together")
    return tuple(filters), problems
