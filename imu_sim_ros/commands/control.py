# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``control``: pause, step, reset and watch a running simulator, and inject faults into it."""

import argparse
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from imu_sim_ros import program, signals, startup
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.simulation.playback import InjectParameters

if TYPE_CHECKING:
    from imu_sim_ros.nodes.control import Control, InjectedFault, Status

EXAMPLES: Final = """
  control pause
  control resume
  control step 10
  control reset --node /left/simulator
  control inject bias_jump --value '[0.1, 0, 0]' --duration 2s
  control inject dropout --value 1 --delay 5s --node /left/simulator
  control watch
  control watch --json --duration 10s
"""
_PATIENCE: Final = 5.0


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(prog="control", description=__doc__, examples=EXAMPLES)
    shared = argparse.ArgumentParser(add_help=False)
    shared.add_argument(
        "--node",
        metavar="NAME",
        default="/simulator",
        help="simulator node with its namespace (default: /simulator)",
    )
    shared.add_argument(
        "--timeout",
        metavar="TIME",
        type=program.duration,
        default=_PATIENCE,
        help="time to wait for the node (default: 5s)",
    )
    actions = result.add_subparsers(dest="action", required=True, metavar="ACTION")
    for name, words in (
        ("pause", "stop the simulated time"),
        ("resume", "continue; also starts a simulator that waits with autostart false"),
        ("reset", "go back to the first sample"),
    ):
        _add(actions, shared, name, words)
    step = _add(actions, shared, "step", "publish samples while paused")
    step.add_argument(
        "samples",
        nargs="?",
        type=int,
        metavar="N",
        help="number of samples (default: step_samples)",
    )
    _add_inject(actions, shared)
    watch = _add(actions, shared, "watch", "show rates, lateness and faults, one line per second")
    watch.add_argument("--json", action="store_true", help="print one JSON object per line")
    watch.add_argument(
        "--duration", metavar="TIME", type=program.duration, help="stop after this time"
    )
    return result


def _add(actions: Any, shared: Any, name: str, words: str) -> Any:
    examples = program.examples_of(EXAMPLES, f"control {name} ")
    options = {"parents": [shared], "help": words, "description": words, "examples": examples}
    return actions.add_parser(name, **options)


def _add_inject(actions: Any, shared: Any) -> None:
    known = parameters(InjectParameters)
    inject = _add(actions, shared, "inject", "start a fault with the next block")
    kinds = [kind for kind in known["kind"].choices if kind != "none"]
    inject.add_argument("kind", choices=kinds, help="kind of fault")
    inject.add_argument(
        "--value", type=_value, metavar="NUMBER|LIST", help=_escaped(known["value"].text)
    )
    for name in ("duration", "delay"):
        inject.add_argument(
            f"--{name}", type=program.duration, metavar="TIME", help=known[name].text
        )
    inject.add_argument("--triad", choices=known["triad"].choices, help=known["triad"].text)
    inject.add_argument("--imu", metavar="NAME", help=known["imu"].text)


def _escaped(text: str) -> str:
    return text.replace("%", "%%")


def _value(words: str) -> list[float]:
    """Return three numbers; a single one applies to all axes."""
    try:
        value = files.parse_yaml(words)
        numbers = value if isinstance(value, list) else [value] * 3
        if len(numbers) == 3 and not any(isinstance(entry, bool | str) for entry in numbers):
            return [float(entry) for entry in numbers]
    except (ValueError, TypeError, OverflowError):
        pass
    raise argparse.ArgumentTypeError(f"{words!r} must be a number or a list such as [0.1, 0, 0]")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, control, argv)


def control(arguments: argparse.Namespace) -> None:
    """Carry out the action."""
    samples = getattr(arguments, "samples", None)
    if samples is not None and not 1 <= samples <= 1_000_000:
        raise ConfigurationError(f"step {samples}: must be 1 to 1000000 samples")
    try:
        from imu_sim_ros.nodes.control import Control
    except ImportError as error:
        raise ConfigurationError(startup.needs_ros(error)) from None
    with Control(arguments.node, arguments.timeout) as simulator:
        if arguments.action == "watch":
            _watch(simulator, arguments)
        else:
            print(_act(simulator, arguments))


def _act(simulator: "Control", arguments: argparse.Namespace) -> str:
    """Do one thing; returns what to print."""
    if arguments.action in ("pause", "resume"):
        return simulator.pause(arguments.action == "pause")
    if arguments.action == "reset":
        return simulator.reset()
    if arguments.action == "step":
        return simulator.step(arguments.samples)
    given = {
        f"inject.{name}": getattr(arguments, name)
        for name in ("value", "duration", "delay", "triad", "imu")
        if getattr(arguments, name) is not None
    }
    # The kind comes last: it is what begins the fault.
    simulator.set({**given, "inject.kind": arguments.kind})
    return f"injected {arguments.kind}"


def _watch(simulator: "Control", arguments: argparse.Namespace) -> None:
    seconds = 0
    try:
        for heard in simulator.watch():
            if arguments.json:
                program.print_json(heard._asdict())
            else:
                print(_line(heard))
            sys.stdout.flush()
            seconds += hasattr(heard, "words")
            if arguments.duration is not None and seconds >= arguments.duration:
                return
    except KeyboardInterrupt:
        raise signals.Interrupted("the simulator continues") from None


def _line(heard: "Status | InjectedFault") -> str:
    """Return a status or a fault in a line."""
    values = heard.values
    if not hasattr(heard, "words"):
        triad = " ".join(filter(None, (values["imu"], values["triad"])))
        return (
            f"fault: {values['kind']} {triad} {values['value']} for "
            f"{values['duration [s]']} s from stamp {heard.t_ns * 1e-9:.9f} s"
        ).replace("  ", " ")
    rates = "  ".join(
        f"{name.removesuffix(' rate [Hz]')} {value} Hz"
        for name, value in values.items()
        if name.endswith(" rate [Hz]")
    )
    late = "/".join(values.get(f"lateness {name} [us]", "-") for name in ("p50", "p99", "max"))
    lost = f"{values['caught up samples']} caught up, {values['skipped samples']} skipped"
    return f"{values['state']:<8} {rates}  late p50/p99/max {late} us  {lost}"
