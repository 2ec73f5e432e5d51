# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The runs of one cell: simulate with a seed, estimate, compare with the truth."""

from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, Final

import imu_sim_ros
from imu_sim_ros.campaigns.cells import Cell, word
from imu_sim_ros.campaigns.comparison import check
from imu_sim_ros.campaigns.metrics import COVERED, Metrics
from imu_sim_ros.campaigns.parameters import CommandEstimator, DeadReckonEstimator
from imu_sim_ros.campaigns.plan import Plan
from imu_sim_ros.campaigns.reckoning import DeadReckoning
from imu_sim_ros.campaigns.simulated import SimulatedCell
from imu_sim_ros.errors import ImuSimError
from imu_sim_ros.sensors.samples import Samples

DONE: Final = "done"
_OF_FAILED: Final = (*COVERED, "wall_s", "peak_memory_mb")
"""Metrics that a failed run has, too."""


class CellRuns:
    """The runs of a cell; data shared by all its seeds are computed once."""

    def __init__(self, plan: Plan, cell: Cell) -> None:
        """Set up trajectory and sensor.

        :raises ImuSimError: for a cell that cannot be simulated.
        """
        self.plan, self.cell = plan, cell
        self.simulated = SimulatedCell(plan, cell)
        self._dead_reckoning = DeadReckoning(self.simulated)
        parameters = self.simulated.parameters
        self.digests = {name: plan.digest(parameters, name) for name in plan.estimators}

    def rows(
        self, seeds: Sequence[int], estimators: Sequence[str], folder: Path
    ) -> Iterator[dict[str, Any]]:
        """Yield one row of results for each seed and estimator."""
        for seed in seeds:
            # A calibration takes its record in blocks: one of hours would not fit.
            block = cache(partial(self.simulated.block, seed))
            for name in estimators:
                metrics: Metrics = {}
                try:
                    self._estimate(name, seed, block, folder, metrics)
                except Exception as error:  # an estimator may write anything
                    known: Metrics = {key: metrics.get(key) for key in _OF_FAILED}
                    yield self._row(seed, name, f"failed: {_reason(error)}", known)
                else:
                    yield self._row(seed, name, DONE, metrics)

    def _estimate(
        self, name: str, seed: int, block: Callable[[], Samples], folder: Path, metrics: Metrics
    ) -> None:
        """Fill in the metrics of one run; of one that fails, those that it has, too."""
        estimator = self.plan.estimators[name]
        if isinstance(estimator, DeadReckonEstimator):
            metrics.update(self._dead_reckoning.metrics(name, estimator, block()))
            check(metrics, self.plan.options.diverged_above, estimator)
        elif isinstance(estimator, CommandEstimator):
            from imu_sim_ros.campaigns.command_estimator import run_command

            run_command(self.simulated, estimator, name, seed, block(), folder, metrics)
        else:
            from imu_sim_ros.campaigns.calibrations import run_calibration

            metrics.update(run_calibration(self.simulated, estimator, seed))
            check(metrics)

    def _row(self, seed: int, name: str, status: str, metrics: Metrics) -> dict[str, Any]:
        return {
            "cell": self.cell.name,
            "seed": seed,
            "estimator": name,
            "status": " ".join(status.split())[:300],
            **{key: _plain(value) for key, value in self.cell.values.items()},
            **{key: metrics.get(key) for key in self.plan.metrics},
            "align": self.plan.alignment(name),
            "digest": self.digests[name],
            "version": imu_sim_ros.__version__,
        }


def _reason(error: Exception) -> str:
    if isinstance(error, ImuSimError):
        return error.problems[0]
    return f"unexpected: {type(error).__name__}: {error}"


def _plain(value: object) -> object:
    """Return a grid's value as results hold it: a number, a boolean or a string."""
    return value if isinstance(value, int | float | str) else word(value)
