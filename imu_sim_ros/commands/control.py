# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``control``: pause, step, reset and watch a running simulator, change it, and inject faults."""

import argparse
import shutil
import sys
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Final, TextIO

from imu_sim_ros.commands import program
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.parameters.yaml_text import parse_yaml
from imu_sim_ros.simulation.playback import InjectParameters
from imu_sim_ros.terminal import signals, startup

if TYPE_CHECKING:
    from imu_sim_ros.nodes.control import Control

EXAMPLES: Final = """
  control pause
  control resume
  control step 10
  control reset --node /left/simulator
  control set imu.gyroscope_bias '[0.1, 0, 0]' imu.dropout_probability 0.01
  control inject bias_jump --value '[0.1, 0, 0]' --duration 2s
  control inject dropout --value 1 --delay 5s --node /left/simulator
  control watch
  control watch --json --duration 10s
"""


def _value(text: str) -> list[float]:
    """Return three numbers; a single one applies to all axes."""
    try:
        value = parse_yaml(text)
        entries = value if isinstance(value, list) else [value] * 3
        numbers = [
            float(entry)
            for entry in entries
            if isinstance(entry, int | float) and not isinstance(entry, bool)
        ]
        if len(numbers) == len(entries) == 3:
            return numbers
    except (ValueError, OverflowError):
        pass
    raise argparse.ArgumentTypeError(f"{text!r} must be a number or a list such as [0.1, 0, 0]")


_LARGEST_INTEGER: Final = 2**63 - 1
"""Largest integer parameter of ROS."""
_SHARED: Final = {
    "--node NAME": {
        "default": "/simulator",
        "help": "simulator node with its namespace (default: /simulator)",
    },
    "--timeout TIME": {
        "default": 5.0,
        "help": "time to wait for the node (default: 5s)",
    },
}
_INJECT: Final = parameters(InjectParameters)
_ACTIONS: Final[dict[str, tuple[str, dict[str, object]]]] = {
    "pause": ("stop the simulated time", {}),
    "resume": ("continue; also starts a simulator that waits with autostart false", {}),
    "reset": ("go back to the first sample", {}),
    "step": (
        "publish samples while paused",
        {"samples N": {"nargs": "?", "help": "number of samples (default: step_samples)"}},
    ),
    "set": (
        "change live parameters of this or another node (--node), one by one",
        {
            "changes": {
                "nargs": "+",
                "metavar": "NAME VALUE",
                "help": "name and new value of a parameter; a number stands for all three axes",
            }
        },
    ),
    "inject": (
        "start a fault with the next block",
        {
            "kind": {
                "choices": [kind for kind in _INJECT["kind"].choices if kind != "none"],
                "help": "kind of fault",
            },
            "--value NUMBER|LIST": {
                "type": _value,
                "help": _INJECT["value"].text.replace("%", "%%"),
            },
            "--duration TIME": _INJECT["duration"].text,
            "--delay TIME": _INJECT["delay"].text,
            "--triad NAME": _INJECT["triad"].text,
            "--imu NAME": _INJECT["imu"].text,
        },
    ),
    "watch": (
        "show rates, lateness and faults each second, in place on a terminal",
        {"--json": "print one JSON object per line", "--duration TIME": "stop after this time"},
    ),
}


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser("control", description=__doc__, examples=EXAMPLES)
    actions = result.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, (text, options) in _ACTIONS.items():
        arguments = {**_SHARED, **options}
        program.add_subcommand(actions, f"control {name}", text, EXAMPLES, arguments)
    return result


def control(arguments: argparse.Namespace) -> None:
    """Carry out the action."""
    samples = vars(arguments).get("samples")
    if samples is not None and not 1 <= samples <= 1_000_000:
        raise ConfigurationError(f"step {samples}: must be 1 to 1000000 samples")
    changes = _changes(arguments.changes) if arguments.action == "set" else {}
    try:
        from imu_sim_ros.nodes.control import Control
    except ImportError as error:
        raise ConfigurationError(startup.needs_ros(error)) from None
    with Control(arguments.node, arguments.timeout) as simulator:
        if arguments.action == "watch":
            _watch(simulator, arguments)
        elif arguments.action == "set":
            _set(simulator, changes)
        else:
            print(_act(simulator, arguments))


def _changes(arguments: list[str]) -> dict[str, bool | int | float | str]:
    """Return new values by name, in the types that a node of ROS takes.

    :raises ConfigurationError: for a name without a value, and text that is no YAML.
    """
    names, values = arguments[::2], arguments[1::2]
    problems = [f"{names[-1]}: has no value"] if len(names) > len(values) else []
    changes: dict[str, bool | int | float | str] = {}
    for name, text in zip(names, values, strict=False):
        try:
            value = parse_yaml(text)
        except ValueError as error:
            problems.append(f"{name}: {error}")
            continue
        if isinstance(value, bool | float) or (
            isinstance(value, int) and abs(value) <= _LARGEST_INTEGER
        ):
            changes[name] = value
        else:
            changes[name] = text  # a node reads a list from its text
    if problems:
        raise ConfigurationError(problems)
    return changes


def _set(simulator: "Control", changes: dict[str, bool | int | float | str]) -> None:
    """Set parameters and print those that are set.

    :raises InputError: with a line for each that is refused.
    """
    refused = simulator.set_each(changes)
    for name, value in changes.items():
        if name not in refused:
            print(f"{name} = {str(value).lower() if isinstance(value, bool) else value}")
    if refused:
        raise InputError(refused.values())


def _act(simulator: "Control", arguments: argparse.Namespace) -> str:
    """Call a service of the simulator; returns its answer as text."""
    if arguments.action in ("pause", "resume"):
        return simulator.pause(arguments.action == "pause")
    if arguments.action == "reset":
        return simulator.reset()
    if arguments.action == "step":
        return simulator.step(arguments.samples)
    fields = program.arguments_given(arguments, "value", "duration", "delay", "triad", "imu")
    # The kind comes last: it is what begins the fault.
    fields["kind"] = arguments.kind
    simulator.set({f"inject.{name}": value for name, value in fields.items()})
    return f"injected {arguments.kind}"


class StatusView:
    """A status of several lines at the foot of a terminal, redrawn in place."""

    def __init__(self, terminal: TextIO) -> None:
        self._terminal = terminal
        self._lines: Sequence[str] = ()

    def show(self, lines: Sequence[str]) -> None:
        """Replace the status."""
        self._erase()
        columns = shutil.get_terminal_size().columns
        self._lines = [line[: columns - 1] for line in lines]
        self._draw()

    def log(self, line: str) -> None:
        """Print a line above the status, which stays."""
        self._erase()
        self._terminal.write(f"{line}\n")
        self._draw()

    def _erase(self) -> None:
        """Erase the lines drawn before."""
        if self._lines:  # up to its first line, and clear from there (ECMA-48, CPL and ED)
            self._terminal.write(f"\x1b[{len(self._lines)}F\x1b[J")

    def _draw(self) -> None:
        """Draw the current lines."""
        self._terminal.writelines(f"{line}\n" for line in self._lines)


def _watch(simulator: "Control", arguments: argparse.Namespace) -> None:
    """Print the state of the simulator, again and again until interrupted."""
    from imu_sim_ros.nodes.control import Status

    seconds = 0
    view = StatusView(sys.stdout) if sys.stdout.isatty() and not arguments.json else None
    try:
        for report in simulator.watch():
            if arguments.json:
                program.print_json(report._asdict())
            elif view is None:
                print(report.line())
            elif isinstance(report, Status):
                view.show(report.lines())
            else:
                view.log(report.line())
            sys.stdout.flush()
            seconds += isinstance(report, Status)
            if arguments.duration is not None and seconds >= arguments.duration:
                return
    except KeyboardInterrupt:
        raise signals.Interrupted("the simulator continues") from None


main = partial(program.main, parser, control)

if __name__ == "__main__":
    sys.exit(main())
