# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many runs of an estimator over a grid of sensors, motions, faults and seeds, and what they say.

:mod:`~imu_sim_ros.campaign.plan` reads what is asked for, :mod:`~imu_sim_ros.campaign.cells` makes
the grid's cells, :mod:`~imu_sim_ros.campaign.runs` makes one run, the engines spread the runs over
processes (:mod:`~imu_sim_ros.campaign.engine`) or a Dask cluster, and
:mod:`~imu_sim_ros.campaign.statistics` and :mod:`~imu_sim_ros.campaign.gate` say what is
significant. A run is decided by the plan alone: the same numbers in any order, on any engine.
"""
