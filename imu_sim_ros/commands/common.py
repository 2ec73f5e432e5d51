# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the commands share: arguments, durations, exit status, tables, JSON and progress."""

import argparse
import json
import os
import shutil
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, NoReturn

from imu_sim_ros import timebase
from imu_sim_ros.commands import signals
from imu_sim_ros.config import files
from imu_sim_ros.errors import ConfigurationError, explain

_LONGEST_LINE: Final = 1000


class Formatter(argparse.HelpFormatter):
    """Wraps the description to the terminal and leaves the examples as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if text.startswith("examples:"):
            return "".join(indent + line for line in text.splitlines(keepends=True))
        return super()._fill_text(text, width, indent)


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaint is one line, and that knows ``--debug``."""

    def __init__(self, prog: str | None = None, *, examples: str = "", **options: Any) -> None:
        """Set up the parser.

        :param examples: command lines, one a line; the help ends with them.
        """
        if examples:
            lines = "".join(f"\n  {line.strip()}" for line in examples.strip().splitlines())
            options |= {"epilog": "examples:" + lines, "formatter_class": Formatter}
        if options.get("description"):
            options["description"] = options["description"].replace("``", "")
        super().__init__(prog, **options)
        self.add_argument(
            "--debug",
            action="store_true",
            default=argparse.SUPPRESS,  # a subcommand's default must not hide what stands before it
            help="show the traceback of an error",
        )

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line and end with status 2."""
        self.exit(2, f"{self.prog}: {_shortened(message)} (--help lists the arguments)\n")


def examples_of(examples: str, command: str) -> str:
    """Return the example lines of one subcommand, such as ``calibrate turntable``."""
    return "\n".join(
        line for line in examples.splitlines() if f"{line.strip()} ".startswith(command)
    )


def main(
    parser: Callable[[], argparse.ArgumentParser],
    command: Callable[[argparse.Namespace], None],
    argv: Sequence[str] | None = None,
) -> int:
    """Run a program: read its arguments, do what it does, tell what went wrong.

    :param command: does the work; raises what goes wrong.
    :param argv: the command line without the program's name; None: that of the process.
    :returns: exit status: 0; 2 after a line for each problem of the input; 1 for anything else.
    :raises SystemExit: for arguments that cannot be read, with status 2, and after ``--help``.
    """
    open_standard_streams()
    made = parser()
    _complete(made)
    try:
        arguments = made.parse_args(argv)
    except Exception as error:  # an argument that nobody has thought of
        return _told(made.prog, error, debug=False)
    return run(made.prog, lambda: command(arguments), getattr(arguments, "debug", False))


def _complete(parser: argparse.ArgumentParser) -> None:
    """Answer the shell's question after a press of tab, where argcomplete is installed."""
    if "_ARGCOMPLETE" in os.environ:
        with suppress(ImportError):
            import argcomplete

            argcomplete.autocomplete(parser)


def run(program: str, command: Callable[[], None], debug: bool = False) -> int:
    """Run a command; return its exit status after printing a line for each problem.

    :param debug: print tracebacks as well.
    """
    try:
        with signals.raised():
            command()
        sys.stdout.flush()
    except BrokenPipeError:  # `| head` closed standard output: nobody reads on
        _give_up_output()
        return 1
    except KeyboardInterrupt as error:
        for line in error.args or ["nothing was written"]:
            print(f"{program}: interrupted; {line}", file=sys.stderr)
        return signals.status()
    except Exception as error:
        return _told(program, error, debug)
    return 0


def _told(program: str, error: Exception, debug: bool) -> int:
    """Print what an error means; return the exit status."""
    if debug:
        traceback.print_exception(error)
    lines, status = explain(error)
    for line in lines:
        print(f"{program}: {_shortened(line)}", file=sys.stderr)
    try:
        sys.stdout.flush()
    except OSError:
        _give_up_output()
    return status


def _shortened(line: str) -> str:
    """Return a line without what a hostile name may put into it: line ends, control characters."""
    words = "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in line)
    if len(words) <= _LONGEST_LINE:
        return words
    return f"{words[: _LONGEST_LINE // 2]} ... {words[-_LONGEST_LINE // 2 :]}"


def open_standard_streams() -> None:
    """Let closed standard streams lead nowhere, lest the next file that is opened become one."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest free number is this one
        if getattr(sys, name) is None:
            mode = "r+" if number else "r"
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115


def _give_up_output() -> None:
    """Forget what standard output cannot take; the interpreter's end would try again."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def duration(words: str) -> float:
    """Return the seconds of ``20s``, ``10min``, ``4h``, ``2d`` or a plain number."""
    try:
        return timebase.parse_duration(words)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def assignment(words: str) -> tuple[str, object]:
    """Return name and value of ``key=value``; the value is read as YAML."""
    name, equals, value = words.partition("=")
    if not equals or not name.strip():
        raise argparse.ArgumentTypeError(f"{words!r} is not of the form key=value")
    try:
        return name.strip(), files.parse_yaml(value)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{name}: {error}") from None


def add_parameter_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that set parameters: files and single values."""
    group = parser.add_argument_group("parameters (later ones win)")
    group.add_argument(
        "--params-file",
        metavar="FILE",
        action="append",
        default=[],
        help="ROS 2 parameter file, or a kalibr imu.yaml; repeatable",
    )
    group.add_argument(
        "--set",
        metavar="KEY=VALUE",
        type=assignment,
        action="append",
        default=[],
        help="one parameter, for instance imu.gyroscope_bias=[0.01,0,0]; repeatable",
    )


def add_simulation_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that choose what is simulated."""
    add_parameter_arguments(parser)
    group = parser.add_argument_group("simulation")
    group.add_argument(
        "--imu",
        metavar="NAME|FILE",
        help=f"the sensor: {', '.join(files.names('imus'))}, or a file",
    )
    group.add_argument(
        "--trajectory",
        metavar="NAME|FILE",
        help=f"the motion: {', '.join(files.names('trajectories'))}, a parameter file, "
        "or recorded poses in TUM or EuRoC form",
    )
    group.add_argument(
        "--robust",
        action="store_true",
        help="mend recorded poses: leave out those that lie off, join jumps, even out stamps of "
        "arrival (trajectory.robust)",
    )
    group.add_argument("--rate", metavar="HZ", type=float, help="samples per second")
    group.add_argument("--duration", metavar="TIME", type=duration, help="20s, 10min, 4h")
    group.add_argument("--seed", metavar="N", type=int, help="seed of all random streams")


def add_output_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--json`` and ``--quiet``."""
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def parameter_layers(arguments: argparse.Namespace, node: str) -> list[Mapping[str, object]]:
    """Return what files and ``--set`` give to a node, in order; all bad files are reported."""
    layers: list[Mapping[str, object]] = []
    problems: list[str] = []
    for path in arguments.params_file:
        try:
            layers.append(files.load(path, node))
        except ConfigurationError as error:
            problems += error.problems
    if problems:
        raise ConfigurationError(problems)
    return [*layers, dict(arguments.set)]


def simulation_layers(arguments: argparse.Namespace) -> list[Mapping[str, object]]:
    """Return the layers of a simulation: short arguments lie below the files and ``--set``."""
    short: dict[str, object] = {}
    if arguments.imu is not None:
        short["imu.preset"] = arguments.imu
    if arguments.trajectory is not None:
        short.update(files.trajectory_layer(arguments.trajectory))
    if arguments.robust:
        short["trajectory.robust"] = True
    for name in ("rate", "duration", "seed"):
        if getattr(arguments, name) is not None:
            short[name] = getattr(arguments, name)
    layers = parameter_layers(arguments, "simulator")
    return [*layers[:-1], short, layers[-1]]


def print_json(result: Mapping[str, Any] | Sequence[Any]) -> None:
    """Print a result as one JSON object; not-a-number does not exist in JSON and is refused."""
    print(json.dumps(result, allow_nan=False, default=_plain))


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} has no JSON form")


def print_table(header: Sequence[str], rows: Sequence[Sequence[str]], title: str = "") -> None:
    """Print an aligned table: the first column to the left, the others to the right.

    On a terminal too narrow for it the columns move together; where that is not enough, each row
    becomes a block with a line for each column: no number is ever cut.
    """
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    needed = sum(widths) + 3 * len(widths)
    if sys.stdout.isatty() and needed > (terminal := shutil.get_terminal_size().columns):
        close = sum(widths) + 2 * (len(widths) - 1) <= terminal
        print("\n".join((_close if close else stacked)(header, rows, title)))
        return
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, title=title or None, title_justify="left")
    for k, name in enumerate(header):
        table.add_column(name, justify="right" if k else "left", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    # A pipe has no width: every row stays on one line. Units stand in brackets, which are markup to
    # rich.
    width = None if sys.stdout.isatty() else max(160, needed + 4)
    Console(width=width, highlight=False, markup=False).print(table)


def _close(header: Sequence[str], rows: Sequence[Sequence[str]], title: str) -> list[str]:
    """Return a table as lines, two spaces between its columns."""
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    lines = [title] if title else []
    for row in (header, ["\N{BOX DRAWINGS LIGHT HORIZONTAL}" * width for width in widths], *rows):
        first, *others = row
        cells = [f"{cell:>{width}}" for cell, width in zip(others, widths[1:], strict=True)]
        lines.append("  ".join([f"{first:{widths[0]}}", *cells]))
    return lines


def stacked(header: Sequence[str], rows: Sequence[Sequence[str]], title: str = "") -> list[str]:
    """Return a table as lines: a block for each row, a line for each further column."""
    width = max((len(name) for name in header[1:]), default=0)
    lines = [title] if title else []
    for row in rows:
        lines.append(f"{header[0]}: {row[0]}" if header[0] else row[0])
        pairs = zip(header[1:], row[1:], strict=True)
        lines += [f"  {name:{width}}  {value}" for name, value in pairs]
    return lines


@contextmanager
def progress(text: str, total: int, quiet: bool = False) -> Iterator[Callable[[int], None]]:
    """Show a bar with speed and time left on a terminal; yields ``advance(count)``.

    Nothing is shown, and nothing imported, where standard error is not a terminal.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda count: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[speed]}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=total, speed="")

        def advance(count: int) -> None:
            speed = bar.tasks[0].speed
            bar.update(task, advance=count, speed=f"{speed / 1e3:,.0f} k/s" if speed else "")

        yield advance
