# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The earlier campaign that results are compared with: it must be one of the same scenarios."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from imu_sim_ros.campaigns.plan import Plan, load_plan
from imu_sim_ros.campaigns.results import PLAN, SCENARIO, Row
from imu_sim_ros.core.errors import ImuSimError
from imu_sim_ros.core.names import short_repr
from imu_sim_ros.core.spelling import argument, argument_prefix

_MAX_DIFFERENCES: Final = 5
"""Largest number of differing values of a scenario in a message."""
Key = tuple[str, str]
"""Cell and estimator."""


class Identity(NamedTuple):
    """The digests of the runs of one estimator in one cell."""

    scenario: str
    """Digest of what is estimated and how it is compared; empty: the table has no such column."""
    digest: str
    """Digest of everything but the seed, the estimator and the version, too."""


def identities_of_plan(plan: Plan, baseline: Sequence[Row]) -> dict[Key, Identity]:
    """Return the digests of a plan's runs, for the cells that a baseline has."""
    cells = {str(row["cell"]) for row in baseline}
    identities = {}
    for cell in plan.cells():
        if cell.name in cells:
            parameters = plan.simulation(cell)
            for name in plan.estimators:
                digests = plan.scenario(parameters, name), plan.digest(parameters, name)
                identities[cell.name, name] = Identity(*digests)
    return identities


def identities_of_rows(rows: Sequence[Row]) -> dict[Key, Identity]:
    """Return the digests of runs that were made."""
    identities: dict[Key, Identity] = {}
    for row in rows:
        scenario, digest = (str(row.get(name) or "") for name in (SCENARIO, "digest"))
        key = (str(row["cell"]), str(row["estimator"]))
        if scenario or digest:  # a run whose cell could not be simulated has none
            identities.setdefault(key, Identity(scenario, digest))
    return identities


def differences(
    plan: Plan, identities: Mapping[Key, Identity], path: Path, baseline: Sequence[Row]
) -> str:
    """Return the difference between the scenarios of a baseline and of a plan; empty: none.

    :param identities: digests of the plan's runs.
    :param path: folder or table of the baseline; the plan next to it tells what differs.
    :param baseline: the rows of the baseline.
    """
    earlier = identities_of_rows(baseline)
    for key, identity in identities.items():
        previous = earlier.get(key)
        if previous is None:
            continue
        if identity.scenario and previous.scenario:
            equal = identity.scenario == previous.scenario
        else:
            equal = identity.digest == previous.digest
        if not equal:
            folder = path if path.is_dir() else path.parent
            return f"{'; '.join(key)}: {_difference(plan, folder / PLAN, key)}"
    return ""


def _difference(plan: Plan, path: Path, key: Key) -> str:
    """Return the values in which one group of an earlier plan differs, as text.

    :param path: the earlier plan, which may not be there.
    """
    try:
        earlier = load_plan(path)
        values, earlier_values = _scenario(plan, key), _scenario(earlier, key)
    except ImuSimError:
        return f"its digests differ, and no {PLAN} next to it says by what"
    lines = [
        f"{name} = {short_repr(earlier_values.get(name))} there and {short_repr(values.get(name))} "
        "here"
        for name in dict.fromkeys([*values, *earlier_values])
        if values.get(name) != earlier_values.get(name)
    ]
    suffix = f" and {len(lines) - _MAX_DIFFERENCES} more" if len(lines) > _MAX_DIFFERENCES else ""
    if not lines:
        return f"its digests differ, and the {PLAN} next to it does not: a file may have changed"
    return f"{', '.join(lines[:_MAX_DIFFERENCES])}{suffix}"


def _scenario(plan: Plan, key: Key) -> dict[str, object]:
    """Return by name all that the scenario of a group consists of."""
    cell_name, estimator = key
    cell = next((cell for cell in plan.cells() if cell.name == cell_name), None)
    if cell is None or estimator not in plan.estimators:
        raise ImuSimError(f"{'; '.join(key)}: not in the plan")
    return plan.scenario_values(plan.simulation(cell), estimator)


def plan_mismatch(path: Path, difference: str) -> str:
    """Return the problem of a baseline of another plan."""
    return (
        f"{argument_prefix('baseline', str(path))}: is of another plan: {difference}; "
        f"{argument('baseline_anyway', True)} compares with it all the same"
    )
