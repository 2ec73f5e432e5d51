# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The runs of one cell: simulate with a seed, estimate, compare with the truth."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Final

import imu_sim_ros
from imu_sim_ros.campaigns.cells import Cell, value_text
from imu_sim_ros.campaigns.common_time import common_time_metrics
from imu_sim_ros.campaigns.comparison import (
    RunOutcome,
    check,
    estimate_metrics,
)
from imu_sim_ros.campaigns.metrics import COVERED, Metrics
from imu_sim_ros.campaigns.parameters import (
    CommandEstimator,
    DeadReckonEstimator,
    TrajectoryEstimator,
)
from imu_sim_ros.campaigns.plan import Plan
from imu_sim_ros.campaigns.reckoning import DeadReckoning
from imu_sim_ros.campaigns.results import COMMON_TIME, FINDINGS, SCENARIO, SEPARATOR, Row
from imu_sim_ros.campaigns.simulated import SimulatedCell
from imu_sim_ros.core.errors import ImuSimError
from imu_sim_ros.core.records import States
from imu_sim_ros.sensors.samples import Samples

DONE: Final = "done"
_FAILED_METRICS: Final = (*COVERED, "wall_s", "peak_memory_mb")
"""Metrics that failed runs have, too."""


class CellRuns:
    """The runs of a cell; data shared by all its seeds are computed once."""

    def __init__(self, plan: Plan, cell: Cell) -> None:
        """Initialise with trajectory and sensor.

        :raises ImuSimError: for a cell that cannot be simulated.
        """
        self.plan, self.cell = plan, cell
        self.simulated = SimulatedCell(plan, cell)
        self._dead_reckoning = DeadReckoning(self.simulated)
        parameters = self.simulated.parameters
        self.digests = {name: plan.digest(parameters, name) for name in plan.estimators}
        self.scenarios = {name: plan.scenario(parameters, name) for name in plan.estimators}

    def rows(self, seeds: Sequence[int], estimators: Sequence[str], folder: Path) -> Iterator[Row]:
        """Yield one row of results for each seed and estimator."""
        for seed in seeds:
            # A calibration takes its record in blocks: one of hours would not fit.
            block = cache(partial(self.simulated.block, seed))
            rows: dict[str, Row] = {}
            tracks: dict[str, States] = {}
            for name in estimators:
                outcome = self._outcome(name)
                try:
                    self._estimate(name, seed, block, folder, outcome)
                except Exception as error:  # an estimator may write anything
                    metrics: Metrics = {key: outcome.metrics.get(key) for key in _FAILED_METRICS}
                    outcome.metrics = metrics
                    rows[name] = self._row(seed, name, f"failed: {_reason(error)}", outcome)
                else:
                    rows[name] = self._row(seed, name, DONE, outcome)
                    if outcome.track is not None:
                        tracks[name] = outcome.track
            if len(tracks) > 1:
                truth = self.simulated.truth(block())
                for name, column in self._common_time(tracks, truth).items():
                    rows[name][COMMON_TIME] = column
            yield from rows.values()

    def _outcome(self, name: str) -> RunOutcome:
        """Return the outcome of a run that has not begun, with zero coverage."""
        if isinstance(self.plan.estimators[name], TrajectoryEstimator):
            return RunOutcome(dict.fromkeys(COVERED, 0.0))
        return RunOutcome()

    def _common_time(self, tracks: Mapping[str, States], truth: States) -> dict[str, str]:
        """Return the metrics over the time that estimators have in common, by estimator."""
        estimators = self.plan.estimators

        def metrics(name: str, track: States) -> Metrics:
            """Return the metrics of a part of an estimator's track."""
            estimator = estimators[name]
            assert isinstance(estimator, TrajectoryEstimator)
            alignment = str(self.plan.alignment(name))
            return estimate_metrics(track, truth, alignment, self.plan.relative, estimator, 0.0)

        gaps = {
            name: (track, estimator.max_gap)
            for name, track in tracks.items()
            if isinstance(estimator := estimators[name], TrajectoryEstimator)
        }
        return common_time_metrics(gaps, truth.t_ns, metrics)

    def _estimate(
        self,
        name: str,
        seed: int,
        block: Callable[[], Samples],
        folder: Path,
        outcome: RunOutcome,
    ) -> None:
        """Fill in the results of one run; a run that fails keeps those computed before."""
        estimator = self.plan.estimators[name]
        if isinstance(estimator, DeadReckonEstimator):
            metrics, outcome.track = self._dead_reckoning.run(name, estimator, block())
            outcome.metrics.update(metrics)
            check(metrics, self.plan.options.diverged_above, estimator)
        elif isinstance(estimator, CommandEstimator):
            from imu_sim_ros.campaigns.command_estimator import run_command

            run_command(self.simulated, estimator, name, seed, block(), folder, outcome)
        else:
            from imu_sim_ros.campaigns.calibrations import run_calibration

            outcome.metrics.update(run_calibration(self.simulated, estimator, seed))
            check(outcome.metrics)

    def _row(self, seed: int, name: str, status: str, outcome: RunOutcome) -> Row:
        """Return the row of the results for one run."""
        return {
            "cell": self.cell.name,
            "seed": seed,
            "estimator": name,
            "status": " ".join(status.split())[:300],
            **{key: _plain_value(value) for key, value in self.cell.values.items()},
            **{key: outcome.metrics.get(key) for key in self.plan.metrics},
            FINDINGS: SEPARATOR.join(outcome.findings) or None,
            "align": self.plan.alignment(name),
            SCENARIO: self.scenarios[name],
            "digest": self.digests[name],
            "version": imu_sim_ros.__version__,
        }


def _reason(error: Exception) -> str:
    """Return the reason of a failure in one line."""
    if isinstance(error, ImuSimError):
        return error.problems[0]
    return f"unexpected: {type(error).__name__}: {error}"


def _plain_value(value: object) -> object:
    """Return a grid's value as results hold it: a number, a boolean or a string."""
    return value if isinstance(value, int | float | str) else value_text(value)
