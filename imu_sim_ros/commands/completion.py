# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Completion by tab, if argcomplete is installed and the shell asks."""

import argparse
import os
from contextlib import suppress
from typing import Any, Final

from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import flatten

_ASKED: Final = "_ARGCOMPLETE"
"""Set by the shell's side of argcomplete: which word of the line names the program, from 1."""
_FOLDERS: Final = {
    "imu": "imus",
    "truth": "imus",
    "trajectory": "trajectories",
    "scene": "scenes",
    "plan": "campaigns",
}
"""Arguments that take a name in config/, by their names in the parsers; others, those of sensors,
take a name in the folder that is called as they are, if there is one."""


def is_requested() -> bool:
    """Return whether the shell asks for completions instead of running the program."""
    return _ASKED in os.environ


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer the shell and end the process, if it asks and argcomplete is installed."""
    if is_requested():
        with suppress(ImportError):
            import argcomplete

            completer: Any = _names_and_files  # any callable will do; its type asks for a class
            argcomplete.autocomplete(parser, default_completer=completer)


def subcommand() -> str | None:
    """Return the first whole word after the program's name, and begin the line there.

    For ``imu_sim PROGRAM ...``, which hands the rest of the line to PROGRAM.
    """
    words = os.environ.get("COMP_LINE", "")[: int(os.environ.get("COMP_POINT", "0"))].split(" ")
    words = [word for word in words[:-1] if word]  # the last one is being written
    if len(words) < 2:
        return None
    os.environ[_ASKED] = "2"
    return words[1]


def _names_and_files(
    prefix: str, action: argparse.Action, parser: argparse.ArgumentParser, **_: object
) -> list[str]:
    """Return the completions of a word: names of parameters or presets, and files."""
    from argcomplete.completers import FilesCompleter

    if "--set" in action.option_strings:
        return [f"{name}=" for name in _parameters(parser) if name.startswith(prefix)]
    names = files.names(_FOLDERS.get(action.dest, action.dest))
    return [*(name for name in names if name.startswith(prefix)), *FilesCompleter()(prefix)]


def _parameters(parser: argparse.ArgumentParser) -> list[str]:
    """Return the names of the parameters that ``--set`` takes."""
    from imu_sim_ros.navigation.parameters import IntegratorParameters
    from imu_sim_ros.simulation.parameters import SimulationParameters

    is_integrator = parser.prog == "dead_reckon"
    return list(flatten(IntegratorParameters() if is_integrator else SimulationParameters()))
