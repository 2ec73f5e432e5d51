# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The earlier campaign that results are compared with: it must be one of the same scenarios."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from imu_sim_ros.campaigns.plan import Plan, load_plan
from imu_sim_ros.campaigns.results import PLAN, SCENARIO, Row
from imu_sim_ros.errors import ImuSimError
from imu_sim_ros.names import shown

_SHOWN: Final = 5
"""Differences of a scenario that are named."""
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
    """Return what the scenarios of a baseline have different from a plan's; empty: nothing.

    :param identities: digests of the plan's runs.
    :param path: folder or table of the baseline; the plan next to it tells what differs.
    :param baseline: the rows of the baseline.
    """
    earlier = identities_of_rows(baseline)
    for key, identity in identities.items():
        other = earlier.get(key)
        if other is None:
            continue
        if identity.scenario and other.scenario:
            alike = identity.scenario == other.scenario
        else:
            alike = identity.digest == other.digest
        if not alike:
            folder = path if path.is_dir() else path.parent
            return f"{'; '.join(key)}: {_difference(plan, folder / PLAN, key)}"
    return ""


def _difference(plan: Plan, path: Path, key: Key) -> str:
    """Return in words what one group of an earlier plan has different.

    :param path: the earlier plan, which may not be there.
    """
    try:
        earlier = load_plan(path)
        here, there = _scenario(plan, key), _scenario(earlier, key)
    except ImuSimError:
        return f"its digests differ, and no {PLAN} next to it says by what"
    lines = [
        f"{name} = {shown(there.get(name))} there and {shown(here.get(name))} here"
        for name in dict.fromkeys([*here, *there])
        if here.get(name) != there.get(name)
    ]
    more = f" and {len(lines) - _SHOWN} more" if len(lines) > _SHOWN else ""
    if not lines:
        return f"its digests differ, and the {PLAN} next to it does not: a file may have changed"
    return f"{', '.join(lines[:_SHOWN])}{more}"


def _scenario(plan: Plan, key: Key) -> dict[str, object]:
    """Return by name all that the scenario of a group consists of."""
    cell_name, estimator = key
    cell = next((cell for cell in plan.cells() if cell.name == cell_name), None)
    if cell is None or estimator not in plan.estimators:
        raise ImuSimError(f"{'; '.join(key)}: not in the plan")
    return plan.scenario_values(plan.simulation(cell), estimator)


def other_plan(path: Path, difference: str) -> str:
    """Return the problem of a baseline of another plan."""
    return (
        f"--baseline {path}: is of another plan: {difference}; --baseline-anyway compares with it "
        "all the same"
    )
