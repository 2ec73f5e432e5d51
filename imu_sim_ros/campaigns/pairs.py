# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The values of a metric of two groups on each seed, over the time that both estimates cover."""

import json
import math
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.campaigns.metrics import ESTIMATED, SUCCESS, grows_with_time
from imu_sim_ros.campaigns.results import COMMON_TIME, Row, numbers
from imu_sim_ros.campaigns.summary import Group

ALIKE: Final = 0.005
"""Difference of the shares of the truth's time up to which two estimates cover the same time."""

Values = dict[int, float | None]
"""A metric by seed: infinite if the run failed, None if it has no value."""


class CommonTime(NamedTuple):
    """Shares of the truth's time that A, B and both cover; medians over the seeds."""

    a: float
    """Share that A covers, 0 to 1."""
    b: float
    """Share that B covers, 0 to 1."""
    both: float | None
    """Share that both cover; None: unknown, A and B are compared over different time."""

    def text(self, a: str, b: str) -> str:
        """Return the shares as text, with the names of A and B."""
        shares = f"{a} {_percent(self.a)}, {b} {_percent(self.b)}"
        if self.both is None:
            return f"not over the same time ({shares})"
        return f"over the {_percent(self.both)} of the time that both cover ({shares})"


class PairedValues(NamedTuple):
    """The values of A and B that are compared."""

    a: Values
    b: Values
    time: CommonTime | None
    """Time that A and B cover; None: the same, or the metric does not grow with time."""


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


def values_of(group: Group, metric: str) -> Values:
    """Return the metric of a group by seed, each over the time that its run covers."""
    if metric == SUCCESS:
        return {int(row["seed"]): float(row["status"] == "done") for row in group.rows}
    values: Values = {}
    for row in group.rows:
        number = numbers([row], metric)
        failed = row["status"] != "done"
        values[int(row["seed"])] = number[0] if number else math.inf if failed else None
    return values


def pair_values(a: Group, b: Group, metric: str) -> PairedValues:
    """Return the values of a metric of two groups that are compared.

    Two estimators in one cell have their values over the time that both cover, if their runs were
    made together. Of other pairs only the shares of time are known: they are comparable if the
    shares are alike.
    """
    values_a, values_b = values_of(a, metric), values_of(b, metric)
    if not grows_with_time(metric):
        return PairedValues(values_a, values_b, None)
    rows = {int(row["seed"]): row for row in b.rows if row["status"] == "done"}
    pairs = [
        (row, rows[int(row["seed"])])
        for row in a.rows
        if row["status"] == "done" and int(row["seed"]) in rows
    ]
    shares: list[tuple[float, float]] = []
    both: list[float] = []
    differences: list[float] = []
    for row, partner in pairs:
        share, partner_share = _share(row), _share(partner)
        if share is None or partner_share is None:
            continue
        shares.append((share, partner_share))
        entry, reverse = (
            _common_metrics(row, b.estimator) if a.cell == b.cell else None,
            _common_metrics(partner, a.estimator) if a.cell == b.cell else None,
        )
        if entry is None or reverse is None:
            both.append(min(share, partner_share))
            differences.append(abs(share - partner_share))
            continue
        seed = int(row["seed"])
        values_a[seed], values_b[seed] = entry.get(metric), reverse.get(metric)
        both.append(entry.get("share") or 0.0)
        differences.append(0.0)
    if not shares:
        return PairedValues(values_a, values_b, None)
    share_a, share_b = np.median(np.array(shares), axis=0).tolist()
    common, unknown = float(np.median(both)), float(np.median(differences)) > ALIKE
    if not unknown and max(share_a, share_b) - common <= ALIKE:
        return PairedValues(values_a, values_b, None)
    return PairedValues(
        values_a, values_b, CommonTime(share_a, share_b, None if unknown else common)
    )


def _share(row: Row) -> float | None:
    """Return the share of the truth's time that a run covers; None: unknown."""
    share = row.get(ESTIMATED, row.get("coverage"))
    return float(share) if isinstance(share, int | float) else None


def _common_metrics(row: Row, estimator: str) -> dict[str, float | None] | None:
    """Return the metrics over the time common with another estimator; None: there are none."""
    text = row.get(COMMON_TIME)
    if not isinstance(text, str):
        return None
    try:
        entry = json.loads(text).get(estimator)
    except (ValueError, AttributeError):
        return None
    return entry if isinstance(entry, dict) else None
