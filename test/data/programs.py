# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Programs of the package in processes of their own: start and end in tests."""

import sys
import time
from collections.abc import Callable
from typing import Any

PATIENCE = 300.0
"""[s] A loaded machine may take long; nothing that works takes as long as this."""


def program(name: str) -> list[str]:
    """Return the command that starts a program or node as ``imu_sim NAME`` does."""
    return [sys.executable, "-m", "imu_sim_ros.commands.start", name]


def until(condition: Callable[[], Any], what: str = "what was to come") -> Any:
    """Wait until a condition is true, and return its value."""
    deadline = time.monotonic() + PATIENCE
    while not (result := condition()):
        assert time.monotonic() < deadline, f"waited {PATIENCE:g} s for {what}"
        time.sleep(0.02)
    return result
