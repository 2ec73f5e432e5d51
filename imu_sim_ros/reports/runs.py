# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Details of a run of a campaign: its path, its log, and the command that repeats it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.campaigns.command_estimator import ESTIMATES, OUTPUT
from imu_sim_ros.campaigns.parameters import CommandEstimator, DeadReckonEstimator
from imu_sim_ros.campaigns.plan import Plan
from imu_sim_ros.campaigns.reckoning import dead_reckoned_states
from imu_sim_ros.campaigns.results import PLAN, Row, run_folder_path
from imu_sim_ros.campaigns.simulated import SimulatedCell
from imu_sim_ros.campaigns.summary import Group
from imu_sim_ros.core.errors import ImuSimError
from imu_sim_ros.core.types import Array
from imu_sim_ros.formats.door import read_trajectory
from imu_sim_ros.inputs.rows import read_text
from imu_sim_ros.navigation.comparison import compare
from imu_sim_ros.navigation.state import state_of_row
from imu_sim_ros.reports.page import Item
from imu_sim_ros.reports.streams import track

_MAX_LOGS: Final = 100
"""Largest number of logs on a page."""
_MAX_PATHS: Final = 24
"""Largest number of paths that are drawn."""
_LONGEST: Final = 100_000
"""Samples up to which a run is repeated for its path."""
_LOG_BYTES: Final = 1500
"""Bytes of the end of a log that are shown."""
_POINTS: Final = 60
"""Columns of a path, each with its extremes."""


def run_details(
    plan: Plan, rows: Sequence[Row], groups: Sequence[Group], folder: Path, metric: str
) -> Item:
    """Return details of runs by row.

    Logs and folders of those that were kept, the failed ones first; paths of those in the middle
    and of the worst of each group.
    """
    numbers = {cell.name: cell.number for cell in plan.cells()}
    result: dict[str, Item] = {}
    order = sorted(range(len(rows)), key=lambda k: rows[k]["status"] == "done")
    for k in order:
        run_folder = _run_folder(rows[k], numbers, folder)
        if run_folder.is_dir():
            result[str(k)] = {"folder": str(run_folder.relative_to(folder))}
            if len(result) == _MAX_LOGS:
                break
            if (log := _tail(run_folder / OUTPUT)) != "":
                result[str(k)]["log"] = log
    indices = {id(row): k for k, row in enumerate(rows)}
    shown = [indices[id(row)] for row in _typical(groups, metric)[:_MAX_PATHS]]
    for k, path in _paths(plan, rows, shown, folder).items():
        result.setdefault(str(k), {})["path"] = path
    return result


def common_plan(folder: Path) -> Item:
    """Return a campaign's plan without gate, grid and seeds: the part common to all runs."""
    import yaml

    try:
        content = yaml.safe_load(read_text(folder / PLAN))
    except (ImuSimError, yaml.YAMLError):
        return {}
    left_out = ("require", "grid", "seeds")
    return {str(key): value for key, value in content.items() if key not in left_out}


def _run_folder(row: Row, numbers: dict[str, int], folder: Path) -> Path:
    """Return the folder of a run's files."""
    number = numbers.get(str(row["cell"]), -1)
    return run_folder_path(folder, number, row["seed"], str(row["estimator"]))


def _tail(path: Path) -> str:
    """Return the end of a log."""
    try:
        with path.open("rb") as file:
            file.seek(max(0, path.stat().st_size - _LOG_BYTES))
            return file.read().decode("utf-8", errors="replace").strip()
    except OSError:
        return ""


def _typical(groups: Sequence[Group], metric: str) -> list[Row]:
    """Return the run in the middle of each group, then the one with the largest value."""
    ordered = [
        sorted((row for row in group.rows if row.get(metric) is not None), key=lambda r: r[metric])
        for group in groups
    ]
    full = [rows for rows in ordered if rows]
    return [rows[(len(rows) - 1) // 2] for rows in full] + [rows[-1] for rows in full]


def _paths(
    plan: Plan, rows: Sequence[Row], shown: Sequence[int], folder: Path
) -> dict[int, list[Item]]:
    """Return the true and estimated paths of some runs by row."""
    cells = {cell.name: cell for cell in plan.cells()}
    simulated: dict[str, SimulatedCell] = {}
    result = {}
    for k in shown:
        row = rows[k]
        name, estimator = str(row["cell"]), str(row["estimator"])
        if name not in cells or estimator not in plan.estimators:
            continue
        try:
            if name not in simulated:
                simulated[name] = SimulatedCell(plan, cells[name])
            seed = int(row["seed"])
            run_folder = run_folder_path(folder, cells[name].number, seed, estimator)
            tracks = _tracks(simulated[name], estimator, seed, run_folder)
        except ImuSimError:
            continue  # the page shows what it can
        if tracks is not None:
            colours = None, list(plan.estimators).index(estimator)
            result[k] = [
                track(title, colour, positions, _POINTS)
                for colour, (title, positions) in zip(colours, tracks, strict=True)
            ]
    return result


def _tracks(
    cell: SimulatedCell, name: str, seed: int, folder: Path
) -> list[tuple[str, Array]] | None:
    """Return the true path of a run and the estimated one, aligned as in the comparison."""
    estimator = cell.plan.estimators[name]
    files = [folder / file for file in ESTIMATES.values() if (folder / file).exists()]
    if cell.total is None or cell.total > _LONGEST:
        return None
    block = cell.block(seed)
    truth = cell.truth(block)
    if isinstance(estimator, DeadReckonEstimator):
        readings = cell.readings(block)
        if not np.array_equal(readings.t_ns, truth.t_ns):
            return None
        estimate = dead_reckoned_states(cell, estimator, block, readings, state_of_row(truth, 0))
    elif isinstance(estimator, CommandEstimator) and files:
        estimate = read_trajectory(files[0], estimator.estimate_topic or None)
    else:
        return None
    errors = compare(estimate, truth, str(cell.plan.alignment(name)))
    return [("truth", truth.position), (name, errors.estimate.position)]
