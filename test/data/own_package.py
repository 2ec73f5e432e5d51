# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The package of other people in examples/own_sensor.py, as an installation would leave it."""

import shutil
from pathlib import Path

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_sensor.py"


def install(folder: Path, entry_point: str = "sonar = own_sensor:SENSOR") -> Path:
    """Put the example and its entry point into a folder for the module path; returns it."""
    shutil.copy(EXAMPLE, folder)
    info = folder / "own_sensor-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: own_sensor\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[imu_sim_ros.sensors]\n{entry_point}\n")
    return folder
