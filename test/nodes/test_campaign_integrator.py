# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The integrator node as an estimator of a campaign: live, as fast as it can, and nothing lost."""

import json
import subprocess

import pytest
from programs import program

from imu_sim_ros.campaigns.results import read_results

pytestmark = pytest.mark.ros

PLAN = {
    "parameters": {"rate": 100.0, "duration": 2.0, "imu": "adis16448"},
    "seeds": [3],
    "keep": "failed",
    "estimators": {
        "integrator": {"template": "integrator"},
        "midpoint": {"type": "dead_reckon"},
    },
}


def test_the_live_integrator_has_the_errors_of_dead_reckoning(tmp_path):
    """Equal to the twelve digits of a TUM file; in a process of its own, whose children it ends."""
    path, folder = tmp_path / "plan.yaml", tmp_path / "out"
    path.write_text(json.dumps(PLAN))
    command = [*program("campaign"), path, "-o", folder]
    subprocess.run([*command, "--quiet", "--no-report", "--workers", "1"], check=True)
    live, offline = read_results(folder)
    assert live["status"] == "done", live["status"]
    for name in ("ate_rmse_m", "ate_rmse_rad", "final_position_error_m"):
        assert live[name] == pytest.approx(offline[name], rel=1e-8), name
