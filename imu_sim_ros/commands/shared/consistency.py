# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The NEES of a trajectory that states covariances, as a table."""

from typing import Any

from imu_sim_ros.commands import common


def show(result: dict[str, Any]) -> None:
    """Print the table of the NEES."""
    low, high = result["band_95"]
    rows = [
        [name]
        + [f"{result[name][key]:.3g}" for key in ("mean", "final")]
        + [f"{100.0 * result[name]['inside_band']:.0f} %"]
        for name in ("position", "attitude", "velocity")
        if result[name] is not None
    ]
    title = f"NEES, 3 expected; 95 % of the time between {low:.3g} and {high:.3g}"
    if result["gauge"] is not None:
        title += "; yaw and position fixed at the first pose"
    common.print_table(["of", "mean", "final", "inside"], rows, title)
