# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Entry points of the commands: signals are handled before anything is imported."""

import importlib
import os
import sys
from functools import partial
from typing import Final

from imu_sim_ros.terminal import signals, startup

PROGRAMS: Final = {
    "generate": "simulate into a bag or dataset",
    "convert_bag": "convert or repair bags and datasets",
    "add_errors": "add a sensor's errors to ideal readings of a bag",
    "dead_reckon": "integrate readings into a trajectory; report its error",
    "inspect": "say what a recording holds, and what is wrong with it",
    "evaluate": "compare an estimate with the truth: ATE, RPE, NEES",
    "allan": "find noise parameters in a recording at rest",
    "calibrate": "find bias, scale, misalignment and temperature terms",
    "twin": "fit a sensor to a recording with known poses",
    "campaign": "run estimators many times; statistics and a gate",
    "report": "write a campaign or bags as one HTML page",
    "view": "show a flight in rerun (pip install rerun-sdk)",
    "control": "pause, step, change, inject faults into or watch a simulator (ROS 2)",
}
NODES: Final = {
    "simulator": "publish simulated sensors (ROS 2)",
    "integrator": "dead-reckon a topic (ROS 2)",
    "recorder": "record topics into a bag (ROS 2)",
    "error_model": "add a sensor's errors to another simulator's topic (ROS 2)",
}


def _run(name: str) -> int:
    """Run a program and end the process with its status."""
    signals.end_at_once(name)
    try:
        status: int = startup.load(f"imu_sim_ros.commands.{name}").main()
    finally:
        signals.ignore_signals()
    signals.end_process()
    return status


generate = partial(_run, "generate")
add_errors = partial(_run, "add_errors")
dead_reckon = partial(_run, "dead_reckon")
allan = partial(_run, "allan")
calibrate = partial(_run, "calibrate")
twin = partial(_run, "twin")
convert_bag = partial(_run, "convert_bag")
evaluate = partial(_run, "evaluate")
inspect = partial(_run, "inspect")
campaign = partial(_run, "campaign")
report = partial(_run, "report")
view = partial(_run, "view")
control = partial(_run, "control")


def _complete_program() -> str | None:
    """Return the program whose arguments are to be completed, or complete the programs' names."""
    import argparse  # not needed before signals are handled

    from imu_sim_ros.commands import completion

    name = completion.subcommand()
    if name is None:
        parser = argparse.ArgumentParser(prog="imu_sim")
        parser.add_argument("program", choices=[*PROGRAMS, *NODES])
        completion.complete(parser)
    return name


def _print_programs() -> None:
    """Print the programs and nodes, each with its purpose."""
    print("usage: imu_sim PROGRAM ...\n\nprograms (imu_sim PROGRAM --help describes each):\n")
    for program, text in (PROGRAMS | NODES).items():
        print(f"  {program:12} {text}")
    print("\nexamples:\n  imu_sim generate -o flight.mcap --imu mpu6000 --duration 1min")
    print("  imu_sim dead_reckon flight.mcap --all\n  imu_sim allan rest.mcap -o allan")


def _print_version() -> None:
    from imu_sim_ros import __version__

    print(f"imu_sim_ros {__version__}")


def imu_sim() -> int:
    """Run the program that the first argument names; returns its exit status."""
    name, *rest = sys.argv[1:] or ["--help"]
    if "_ARGCOMPLETE" in os.environ:  # the shell asks what could follow
        name, rest = _complete_program() or name, []
    if name in ("-h", "--help", "--version"):
        from imu_sim_ros.commands import program

        startup.open_standard_streams()
        return program.run("imu_sim", _print_version if name == "--version" else _print_programs)
    sys.argv[:] = [name, *rest]
    if name in PROGRAMS:
        return _run(name)
    if name in NODES:
        return getattr(importlib.import_module("imu_sim_ros.nodes.start"), name)()
    from imu_sim_ros.core.names import unknown_name_line

    print(f"imu_sim: {unknown_name_line('program', name, PROGRAMS | NODES)}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(imu_sim())
