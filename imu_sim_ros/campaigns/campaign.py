# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A campaign from its plan to its results."""

import csv
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from importlib import metadata
from pathlib import Path
from typing import Final, NamedTuple

import imu_sim_ros
from imu_sim_ros.campaigns.cells import Cell, cell_count
from imu_sim_ros.campaigns.engine import Engine, Task
from imu_sim_ros.campaigns.parameters import (
    CalibrationEstimator,
    CommandEstimator,
    TrajectoryEstimator,
)
from imu_sim_ros.campaigns.plan import Plan
from imu_sim_ros.campaigns.results import (
    COMMON_TIME,
    FINDINGS,
    SCENARIO,
    SUMMARY,
    VERSIONS,
    Key,
    Row,
    Store,
    key_of,
    write_atomically,
    write_tables,
)
from imu_sim_ros.campaigns.summary import group_runs, summary_rows
from imu_sim_ros.terminal.json_text import json_text

_BUILT_IN_BATCH: Final = 50
"""Seeds in a task: large enough that the covariance of a cell is rarely computed again."""
_RECORDS: Final = 5
"""Seeds in a task of calibrations, whose records are long."""

Progress = Callable[[Sequence[Row]], None]
Digests = Callable[[Cell], Mapping[str, str]]


class Outcome(NamedTuple):
    """The runs of a campaign."""

    rows: list[Row]
    """Rows of all runs of the plan so far, ordered by cell, seed and estimator."""
    executed: int
    """Runs executed now; the others existed before."""


def columns(plan: Plan) -> list[str]:
    """Return the columns of the results."""
    identity = ["cell", "seed", "estimator", "status"]
    names = [*identity, *plan.grid_names, *plan.metrics]
    paths = [
        estimator
        for estimator in plan.estimators.values()
        if isinstance(estimator, TrajectoryEstimator)
    ]
    if len(paths) > 1:
        names.append(COMMON_TIME)
    if any(isinstance(estimator, CommandEstimator) for estimator in paths):
        names.append(FINDINGS)
    return [*names, "align", SCENARIO, "digest", "version"]


def batch_size(plan: Plan) -> int:
    """Return how many seeds a task has."""
    if any(isinstance(estimator, CommandEstimator) for estimator in plan.estimators.values()):
        return 1
    if any(isinstance(estimator, CalibrationEstimator) for estimator in plan.estimators.values()):
        return min(_RECORDS, len(plan.seeds))
    return min(_BUILT_IN_BATCH, len(plan.seeds))


def tasks(
    plan: Plan,
    finished: set[Key],
    batch: int,
    digests_of: Digests | None = None,
    first_batch: int | None = None,
) -> Iterator[Task]:
    """Yield the runs that are still to be made.

    :param finished: the runs that need not be made.
    :param batch: seeds in a task.
    :param digests_of: by cell, as :func:`digests_by_cell` returns it.
    :param first_batch: seeds in the first task, from which they double; None: ``batch``.
    """
    digests_of = digests_of or digests_by_cell(plan)
    size = first_batch or batch
    for cell in plan.cells():
        digests = digests_of(cell)
        missing: dict[tuple[str, ...], list[int]] = {}
        for seed in plan.seeds:
            names = tuple(
                name
                for name in plan.estimators
                if (digests[name], seed, name, cell.name) not in finished
            )
            if names:
                missing.setdefault(names, []).append(seed)
        for names, seeds in missing.items():
            start = 0
            while start < len(seeds):
                yield Task(cell, tuple(seeds[start : start + size]), names)
                start, size = start + size, min(2 * size, batch)


def digests_by_cell(plan: Plan) -> Digests:
    """Return a function of a cell that returns the digest of each estimator.

    The parameters of each cell are built once.
    """
    cache: dict[int, dict[str, str]] = {}

    def digests_of(cell: Cell) -> dict[str, str]:
        if cell.number not in cache:
            parameters = plan.simulation(cell)
            cache[cell.number] = {n: plan.digest(parameters, n) for n in plan.estimators}
        return cache[cell.number]

    return digests_of


def run(
    plan: Plan,
    store: Store,
    start: Engine,
    advance: Progress = lambda rows: None,
    retry_failed: bool = False,
    batch: int | None = None,
) -> Outcome:
    """Make all missing runs of a plan, and write the tables.

    Finished runs are kept, whatever ends this: the next call continues after them.

    :param start: the engine.
    :param advance: receives the runs that have come.
    :param retry_failed: repeat runs that failed before.
    :param batch: seeds in a task; None: chosen by the estimators.
    """
    finished = {
        key_of(row)
        for row in store.rows()
        if not (retry_failed and str(row["status"]).startswith("failed"))
    }
    executed, interrupted, digests_of = 0, False, digests_by_cell(plan)
    try:
        # A first batch of one seed soon shows how long the campaign takes.
        size = (batch, digests_of) if batch else (batch_size(plan), digests_of, 1)
        todo = tasks(plan, finished, *size)
        with closing(start(plan, todo, store.folder)) as batches:
            for rows in batches:
                store.append(rows)
                executed += len(rows)
                advance(rows)
    except KeyboardInterrupt:
        interrupted = True
        raise
    finally:
        rows = collect(plan, store, digests_of)
        if rows or not interrupted:  # without a run there is nothing to continue from
            write_tables(store.folder, rows, columns(plan), plan.metrics, not interrupted)
            write_versions(store.folder)
        if interrupted:  # statistics of a part are not needed; earlier ones are out of date
            (store.folder / SUMMARY).unlink(missing_ok=True)
        else:
            write_summary(store.folder, plan, rows)
    return Outcome(rows, executed)


def collect(plan: Plan, store: Store, digests_of: Digests | None = None) -> list[Row]:
    """Return the rows of the plan, each run once, in order; those of other plans are left out.

    :param digests_of: by cell, as :func:`digests_by_cell` returns it.
    """
    digests_of = digests_of or digests_by_cell(plan)
    started = {row["cell"] for row in store.rows()}
    order: dict[Key, int] = {}
    for cell in plan.cells():
        if not started:
            break
        if cell.name not in started:
            continue
        started.remove(cell.name)
        digests = digests_of(cell)
        for position, seed in enumerate(plan.seeds):
            for k, name in enumerate(plan.estimators):
                number = (cell.number * len(plan.seeds) + position) * len(plan.estimators) + k
                order[digests[name], seed, name, cell.name] = number
    latest_rows: dict[Key, Row] = {}
    for row in store.rows():
        key = key_of(row)
        # A run that was repeated after a failure counts with its last result.
        if key in order:
            latest_rows[key] = row
    return [latest_rows[key] for key in sorted(latest_rows, key=lambda key: order[key])]


def write_summary(folder: Path, plan: Plan, rows: Sequence[Row]) -> Path:
    """Write ``summary.csv``: a row for each cell and estimator."""
    table = summary_rows(group_runs(rows, plan.grid_names), plan.metrics)
    names = list(dict.fromkeys(name for row in table for name in row))
    path = folder / SUMMARY
    with write_atomically(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, names, restval="")
        writer.writeheader()
        writer.writerows(table)
    return path


def write_versions(folder: Path) -> Path:
    """Write ``versions.json``, the versions of the software behind the numbers."""
    names = ["imu_sim_ros", "numpy", "scipy", "orjson", "rosbags", "mcap", "pyarrow", "distributed"]
    versions = {"python": platform.python_version(), "machine": platform.platform()}
    for name in names:
        with suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    path = folder / VERSIONS
    text = json_text({**versions, "imu_sim_ros": imu_sim_ros.__version__}, indent=1)
    with write_atomically(path) as part:
        part.write_text(text, encoding="utf-8")
    return path


class Tally:
    """Progress of a campaign, for display."""

    def __init__(self, plan: Plan, finished: int = 0) -> None:
        """Begin to count.

        :param finished: number of runs that exist.
        """
        self._runs, self._all, self._failed = finished, plan.run_count, 0

    def add(self, rows: Sequence[Row]) -> str:
        """Return the counts of runs and failures, and the latest cell."""
        self._runs += len(rows)
        self._failed += sum(row["status"] != "done" for row in rows)
        text = f"{self._runs:,} of {self._all:,} runs"
        if self._failed:
            text += f", {self._failed:,} failed"
        latest = str(rows[-1]["cell"]) if rows else "all"
        return text if latest == "all" else f"{text}; {latest}"


def seconds_of_all_runs(plan: Plan) -> float | None:
    """Return the CPU time that a plan takes [s], from its first run; None for programs.

    Parts that the seeds of a cell share count once for each cell.

    :raises ImuSimError: if the first cell cannot be simulated.
    """
    if any(isinstance(estimator, CommandEstimator) for estimator in plan.estimators.values()):
        return None
    from imu_sim_ros.campaigns.runs import CellRuns

    def run(runs: CellRuns) -> CellRuns:
        list(runs.rows(plan.seeds[:1], list(plan.estimators), Path()))
        return runs

    cell = next(plan.cells())
    run(CellRuns(plan, cell))  # imports modules and fills caches
    began = time.process_time()
    runs = run(CellRuns(plan, cell))
    first_run_s = time.process_time() - began
    run(runs)
    run_s = time.process_time() - began - first_run_s
    return cell_count(plan.axes) * (max(first_run_s - run_s, 0.0) + len(plan.seeds) * run_s)
