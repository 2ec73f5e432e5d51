# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the commands' executables begin: signals are looked after before anything is imported."""

import importlib

from imu_sim_ros.commands import signals


def _run(name: str) -> int:
    signals.end_at_once(name)
    try:
        status: int = importlib.import_module(f"imu_sim_ros.commands.{name}").main()
    finally:
        signals.ignore()
    return status


def generate() -> int:
    """Run the command; returns its exit status."""
    return _run("generate")


def dead_reckon() -> int:
    """Run the command; returns its exit status."""
    return _run("dead_reckon")


def allan() -> int:
    """Run the command; returns its exit status."""
    return _run("allan")


def calibrate() -> int:
    """Run the command; returns its exit status."""
    return _run("calibrate")


def convert_bag() -> int:
    """Run the command; returns its exit status."""
    return _run("convert_bag")


def evaluate() -> int:
    """Run the command; returns its exit status."""
    return _run("evaluate")


def campaign() -> int:
    """Run the command; returns its exit status."""
    return _run("campaign")


def control() -> int:
    """Run the command; returns its exit status."""
    return _run("control")
