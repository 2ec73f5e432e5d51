# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Requirements on a campaign's results: a small grammar of its own, never evaluated as code.

::

    requirement = value "<" | "<=" | ">" | ">=" number [ "@" filter { "," filter } ]
    value       = "success" | metric "." statistic
    filter      = name "=" value          a grid's value, or estimator=NAME

``ate_rmse_m.p95 < 0.10``, ``success >= 0.98 @ imu=bmi088, estimator=midpoint``.
"""

import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from imu_sim_ros.campaigns.metrics import SUCCESS
from imu_sim_ros.errors import ConfigurationError, Problems
from imu_sim_ros.names import suggestion

STATISTICS: Final = ("median", "mean", "p5", "p25", "p75", "p90", "p95", "p99", "min", "max")

_OPERATORS: Final[dict[str, Callable[[float, float], bool]]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_FORM = re.compile(
    rf"\s*(?P<value>\w[\w.]*)\s*(?P<operator><=|>=|<|>)\s*(?P<limit>{_NUMBER})\s*"
    r"(?:@(?P<filters>.+))?"
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

    def concerns(self, words: Mapping[str, str]) -> bool:
        """Return whether this applies to a group, given by its names and values in words."""
        return all(words.get(name) == value for name, value in self.filters)

    def holds(self, value: float | None) -> bool:
        """Return whether a value is within the limit; a missing one is not."""
        return value is not None and _OPERATORS[self.operator](value, self.limit)


def parse(lines: object, metrics: Sequence[str], names: Iterable[str]) -> list[Requirement]:
    """Return the requirements of a plan.

    :param metrics: the names of all metrics.
    :param names: what filters may name: the grid's names, and ``estimator``.
    :raises ConfigurationError: with a line for each problem.
    """
    if lines is None:
        return []
    if not isinstance(lines, list):
        raise ConfigurationError(
            f"require = {lines!r}: must be a list such as [ate_rmse_m.p95 < 0.1]"
        )
    known = set(names)
    found: list[Requirement] = []
    problems = Problems()
    for line in lines:
        with problems.gathered():
            found.append(_requirement(str(line), metrics, known))
    problems.tell()
    return found


def _requirement(line: str, metrics: Sequence[str], names: set[str]) -> Requirement:
    match = _FORM.fullmatch(line)
    if match is None:
        raise ConfigurationError(
            f"require: {line[:80]!r}: must be METRIC.STATISTIC or success, one of < <= > >=, and a "
            "number; then optionally @ NAME=VALUE, ..."
        )
    metric, _, statistic = match["value"].partition(".")
    problems = []
    if metric != SUCCESS and metric not in metrics:
        problems.append(f"require: {metric}: {suggestion(metric, [SUCCESS, *metrics])}")
    if metric == SUCCESS and statistic:
        problems.append(f"require: {match['value']}: success has no statistics")
    if metric != SUCCESS and statistic not in STATISTICS:
        hint = suggestion(statistic, STATISTICS)
        problems.append(f"require: {match['value']}: the statistic {statistic!r}: {hint}")
    filters = []
    for part in (match["filters"] or "").split(",") if match["filters"] else []:
        name, equals, value = (word.strip() for word in part.partition("="))
        if not equals or name not in names:
            problems.append(
                f"require: {part.strip()!r}: must be NAME=VALUE with one of "
                f"{', '.join(sorted(names))}"
            )
        filters.append((name, value))
    if problems:
        raise ConfigurationError(problems)
    return Requirement(
        line.strip(), metric, statistic, match["operator"], float(match["limit"]), tuple(filters)
    )
