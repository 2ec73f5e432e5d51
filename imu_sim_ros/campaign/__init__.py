# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many runs of an estimator over sensors, motions, faults and seeds, and their statistics.

:mod:`~imu_sim_ros.campaign.plan` reads the plan, :mod:`~imu_sim_ros.campaign.cells` makes the
grid's cells, :mod:`~imu_sim_ros.campaign.runs` makes one run,
:mod:`~imu_sim_ros.campaign.engine` spreads the runs over processes or a Dask cluster, and
:mod:`~imu_sim_ros.campaign.statistics` and :mod:`~imu_sim_ros.campaign.gate` tell what is
significant. A run depends on the plan alone: the same numbers in any order, on any engine.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.campaign import campaign as campaign
    from imu_sim_ros.campaign import engine as engine
    from imu_sim_ros.campaign.campaign import Outcome as Outcome
    from imu_sim_ros.campaign.cells import Cell as Cell
    from imu_sim_ros.campaign.cells import cell_count as cell_count
    from imu_sim_ros.campaign.engine import Engine as Engine
    from imu_sim_ros.campaign.engine import Task as Task
    from imu_sim_ros.campaign.junit import write_junit as write_junit
    from imu_sim_ros.campaign.metrics import SUCCESS as SUCCESS
    from imu_sim_ros.campaign.metrics import Tolerance as Tolerance
    from imu_sim_ros.campaign.metrics import better as better
    from imu_sim_ros.campaign.metrics import parse_tolerance as parse_tolerance
    from imu_sim_ros.campaign.plan import Plan as Plan
    from imu_sim_ros.campaign.plan import check_plan as check_plan
    from imu_sim_ros.campaign.plan import find_plan as find_plan
    from imu_sim_ros.campaign.plan import load_plan as load_plan
    from imu_sim_ros.campaign.results import LOG as LOG
    from imu_sim_ros.campaign.results import TABLE as TABLE
    from imu_sim_ros.campaign.results import Row as Row
    from imu_sim_ros.campaign.results import Store as Store
    from imu_sim_ros.campaign.results import read_results as read_results
    from imu_sim_ros.campaign.results import replaced as replaced
    from imu_sim_ros.campaign.results import write_tables as write_tables
    from imu_sim_ros.campaign.runs import CellRuns as CellRuns
    from imu_sim_ros.campaign.statistics import Interval as Interval
    from imu_sim_ros.campaign.statistics import power as power
    from imu_sim_ros.campaign.statistics import quantile as quantile
    from imu_sim_ros.campaign.statistics import seeds_needed as seeds_needed
    from imu_sim_ros.campaign.statistics import statistic as statistic
    from imu_sim_ros.campaign.summary import Group as Group
    from imu_sim_ros.campaign.summary import groups as groups
    from imu_sim_ros.campaign.summary import slopes as slopes
    from imu_sim_ros.campaign.summary import unmet as unmet
    from imu_sim_ros.campaign.summary import unmet_lines as unmet_lines
    from imu_sim_ros.campaign.summary import unused as unused
    from imu_sim_ros.campaign.verdict import DIFFERENCE as DIFFERENCE
    from imu_sim_ros.campaign.verdict import EQUAL as EQUAL
    from imu_sim_ros.campaign.verdict import RATIO as RATIO
    from imu_sim_ros.campaign.verdict import Contest as Contest
    from imu_sim_ros.campaign.verdict import Effect as Effect
    from imu_sim_ros.campaign.verdict import Judgement as Judgement
    from imu_sim_ros.campaign.verdict import counts as counts
    from imu_sim_ros.campaign.verdict import judge as judge
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "": ["campaign", "engine"],
            "campaign": ["Outcome"],
            "cells": ["Cell", "cell_count"],
            "engine": ["Engine", "Task"],
            "junit": ["write_junit"],
            "metrics": ["SUCCESS", "better", "Tolerance", "parse_tolerance"],
            "plan": ["Plan", "check_plan", "find_plan", "load_plan"],
            "results": ["LOG", "TABLE", "Row", "Store", "read_results", "replaced", "write_tables"],
            "runs": ["CellRuns"],
            "statistics": ["Interval", "power", "quantile", "seeds_needed", "statistic"],
            "summary": [
                "Group",
                "groups",
                "slopes",
                "unmet",
                "unmet_lines",
                "unused",
            ],
            "verdict": [
                "DIFFERENCE",
                "EQUAL",
                "RATIO",
                "Effect",
                "Contest",
                "Judgement",
                "counts",
                "judge",
            ],
        },
    )
