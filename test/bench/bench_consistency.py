# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every preset: consistency, with the means found, and rest; the tests marked slow."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def main() -> int:
    """Run the slow tests of the presets; return their status."""
    rooms = ["test/navigation", "test/calibration"]
    command = [sys.executable, "-m", "pytest", "-q", "-s", "-m", "slow", *rooms]
    return subprocess.run(command, cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
