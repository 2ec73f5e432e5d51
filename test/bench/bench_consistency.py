# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Consistency of every preset: the tests marked slow, with the means that they find."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def main() -> int:
    """Run the slow tests of the navigation room; return their status."""
    command = [sys.executable, "-m", "pytest", "-q", "-s", "-m", "slow", "test/navigation"]
    return subprocess.run(command, cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
