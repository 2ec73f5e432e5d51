# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A program's parser and run: arguments, exit status, error messages, tables and JSON."""

import argparse
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NoReturn, Protocol

from imu_sim_ros import __version__
from imu_sim_ros.commands.completion import complete
from imu_sim_ros.core import timebase
from imu_sim_ros.core.errors import InputWarning, Remark, explain
from imu_sim_ros.core.names import unknown_name_line
from imu_sim_ros.core.spelling import use_spelling
from imu_sim_ros.core.types import Keywords
from imu_sim_ros.inputs.sharing import open_files_once
from imu_sim_ros.terminal import signals
from imu_sim_ros.terminal.json_text import json_text
from imu_sim_ros.terminal.progress import Watcher, terminal_bar, watch
from imu_sim_ros.terminal.signatures import reader
from imu_sim_ros.terminal.startup import open_standard_streams
from imu_sim_ros.terminal.text_tables import TextTable, print_lines

_KINDS: Final[dict[str, Callable[[str], object]]] = {
    **dict.fromkeys(("FILE", "DIR", "PATH", "BAG"), Path),
    "TIME": reader(timebase.parse_duration),
    "N": int,
    "HZ": float,
}
"""Types of the values of options by their metavariable; others are text."""

JSON_AND_QUIET: Final = {
    "--json": "print the result as a JSON object",
    "--quiet": "print errors only",
}


def add_options(parser: argparse._ActionsContainer, options: Mapping[str, object]) -> None:
    """Add arguments to a parser or to one of its groups.

    :param options: by names and metavariable, ``-o --output FILE``, which a switch does not have:
        the help, or all keywords of ``add_argument`` that do not follow from the metavariable, and
        ``group``, the heading in the help under which it stands.
    """
    groups = {group.title: group for group in parser._action_groups}
    for option, description in options.items():
        parts = option.split()
        names = [word for word in parts if word.startswith("-")] or parts[:1]
        keywords: Keywords = {}
        if len(names) < len(parts):
            keywords = {"metavar": parts[-1], "type": _KINDS.get(parts[-1], str)}
        elif isinstance(description, str):
            keywords = {"action": "store_true"}
        keywords |= description if isinstance(description, Mapping) else {"help": description}
        title = keywords.pop("group", None)
        if title is not None and title not in groups:
            groups[title] = parser.add_argument_group(title)
        groups.get(title, parser).add_argument(*names, **keywords)


def arguments_given(arguments: argparse.Namespace, *names: str) -> dict[str, object]:
    """Return the arguments of these names that are given."""
    values = vars(arguments)
    return {name: values[name] for name in names if values[name] is not None}


def print_json(result: Mapping[str, object] | Sequence[object]) -> None:
    """Print a result as one JSON object; numbers that are not finite are null."""
    print(json_text(result))


def print_result(
    arguments: argparse.Namespace,
    result: Mapping[str, object] | Sequence[object],
    lines: Iterable[str | TextTable],
) -> None:
    """Print a result as JSON (``--json``), not at all (``--quiet``), or as text."""
    if arguments.json:
        print_json(result)
    elif not arguments.quiet:
        print_lines(lines)


class Result(Protocol):
    """Result of a job: a JSON object and lines of text."""

    def to_dict(self) -> Mapping[str, object]:
        """Return the result in plain types."""

    def lines(self) -> Iterable[str | TextTable]:
        """Yield the result as lines of text."""


def show(arguments: argparse.Namespace, result: Result, **leading: object) -> None:
    """Print a result as JSON (``--json``), not at all (``--quiet``), or as text.

    :param leading: entries that come first in the JSON object.
    """
    if arguments.json:
        print_json({**leading, **result.to_dict()})
    elif not arguments.quiet:
        print_lines(result.lines())


_LONGEST_LINE: Final = 1000
"""Longest line of a message [characters]."""


class Formatter(argparse.HelpFormatter):
    """Wraps the description to the terminal and leaves the examples as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        """Keep the line breaks of the examples."""
        if text.startswith("examples:"):
            return "".join(indent + line for line in text.splitlines(keepends=True))
        return super()._fill_text(text, width, indent)


_ON_THEIR_OWN: Final = ("imu_sim", "make", "python", "demo")
"""First words of command lines that are not programs of ``imu_sim``."""


def _command_line(line: str) -> str:
    """Return a command line as it is typed after an installation with pip: ``imu_sim generate``."""
    text = line.strip()
    return text if text.partition(" ")[0] in _ON_THEIR_OWN else f"imu_sim {text}"


class Parser(argparse.ArgumentParser):
    """An argument parser with a line for each problem, and with ``--debug``, ``--version``.

    Options are written in full: an abbreviation of one may be that of another tomorrow. What it
    parses has ``words``: the names of the arguments that are one of a few words, and so
    never the name of a file.
    """

    problems: list[str]
    """Line for each invalid value of the command line that is being parsed."""

    def __init__(
        self,
        prog: str | None = None,
        *,
        examples: str = "",
        arguments: Mapping[str, object] | None = None,
        **options: Any,
    ) -> None:
        """Set up the parser.

        :param examples: command lines, one a line; the help ends with them.
        :param arguments: arguments that :func:`add_options` adds.
        """
        if examples:
            lines = "".join(f"\n  {_command_line(line)}" for line in examples.strip().splitlines())
            options |= {"epilog": "examples:" + lines, "formatter_class": Formatter}
        if options.get("description"):
            options["description"] = options["description"].replace("``", "")
        super().__init__(prog, allow_abbrev=False, **options)
        # `-1s` and `-5%` are values, not options: each is refused with its own line.
        self._negative_number_matcher = re.compile(r"-\.?\d")
        self.add_argument(
            "--debug",
            action="store_true",
            default=argparse.SUPPRESS,  # a subcommand's default must not hide what stands before it
            help="show the traceback of an error",
        )
        self.add_argument(
            "--version",
            action="version",
            version=f"imu_sim_ros {__version__}",
            help="print the package's version and exit",
        )
        add_options(self, arguments or {})

    def format_help(self) -> str:
        """Return the help, whose usage is that of ``imu_sim PROGRAM``."""
        return self._replace_program_name(super().format_help)

    def format_usage(self) -> str:
        """Return the usage, that of ``imu_sim PROGRAM``."""
        return self._replace_program_name(super().format_usage)

    def _replace_program_name(self, formatted: Callable[[], str]) -> str:
        """Return help or usage with the name under which the program was called."""
        short, self.prog = self.prog, _command_line(self.prog)
        try:
            return formatted()
        finally:
            self.prog = short

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print; argparse would ignore a help text that standard output cannot take."""
        if message and file is sys.stdout:
            file.write(message)
            file.flush()
        else:
            super()._print_message(message, file)

    def parse_known_args(  # type: ignore[override]  # the overloads say the same
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse, subcommands included, and note which options have choices.

        An unknown option is reported before an argument that is missing because of it.
        """
        self.problems = []
        self._refuse(self._unknown_options(sys.argv[1:] if args is None else args))
        parsed, rest = super().parse_known_args(args, namespace)
        self._end_if_wrong()
        return self._note_choices(parsed), rest

    def parse_args(  # type: ignore[override]  # the overloads say the same
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> argparse.Namespace:
        """Parse; unknown arguments are an error."""
        parsed, rest = self.parse_known_args(args, namespace)
        self._refuse(rest)
        return parsed

    def parse_every(self, argv: Sequence[str] | None) -> argparse.Namespace:
        """Parse a command line on which options may also stand between several inputs."""
        if not any(action.nargs == "+" for action in self._get_positional_actions()):
            return self.parse_args(argv)
        namespace, rest = self.parse_known_intermixed_args(argv)
        self._refuse(rest)
        return self._note_choices(namespace)

    def _note_choices(self, namespace: argparse.Namespace) -> argparse.Namespace:
        """Note the options with choices, whose values are no names of files."""
        choices = {action.dest for action in self._actions if action.choices is not None}
        namespace.words = vars(namespace).get("words", frozenset()) | choices
        return namespace

    def _unknown_options(self, arguments: Sequence[str]) -> Iterator[str]:
        """Yield the options that this parser does not have; a subcommand looks at its own."""
        has_commands = any(self._commands())
        for word in arguments:
            name = word.partition("=")[0]
            if word == "--" or (has_commands and not word.startswith("-")):
                return
            if (
                name.startswith("--")
                and " " not in name
                and name not in self._option_string_actions
            ):
                yield word

    def _refuse(self, arguments: Iterable[str]) -> None:
        """End if words are left over that are no arguments."""
        unexpected = []
        for word in arguments:
            option = word.partition("=")[0]
            if not word.startswith("-"):
                unexpected.append(repr(word))
            elif owners := [
                name for name, command in self._commands() if option in command._options()
            ]:
                self.problems.append(f"option {option!r} belongs after {' or '.join(owners)}")
            else:
                self.problems.append(unknown_name_line("option", option, self._options(), ""))
        if unexpected:
            plural = "s" if len(unexpected) > 1 else ""
            self.problems.append(f"unexpected argument{plural} {', '.join(unexpected)}")
        self._end_if_wrong()

    def _commands(self) -> Iterator[tuple[str, "Parser"]]:
        """Yield the subcommands and their parsers."""
        for action in self._actions:
            if action.nargs == argparse.PARSER and isinstance(action.choices, dict):
                yield from action.choices.items()

    def _options(self) -> Iterator[str]:
        """Yield the options of this parser and of its subcommands."""
        yield from self._option_string_actions
        for _, parser in self._commands():
            yield from parser._options()

    def _check_value(self, action: argparse.Action, value: object) -> None:
        """Refuse a value that is none of the choices, and suggest the nearest."""
        if action.choices is not None and value not in action.choices:
            name = (action.option_strings or [str(action.metavar or action.dest).lower()])[-1]
            raise argparse.ArgumentError(None, unknown_name_line(name, value, action.choices))

    def _get_values(self, action: argparse.Action, arg_strings: list[str]) -> Any:
        """Return the value of ``--name=--``, too; argparse would pass an empty list on.

        A value that cannot be read is a problem among others; argparse would end with the first.
        """
        try:
            if arg_strings == ["--"] and action.option_strings and action.nargs is None:
                value = self._get_value(action, "--")
                self._check_value(action, value)
                return value
            return super()._get_values(action, arg_strings)
        except argparse.ArgumentError as error:
            if action.nargs == argparse.PARSER:
                raise
            self.problems.append(str(error))
            return None

    def error(self, message: str) -> NoReturn:
        """Print a line for each problem and end with status 2."""
        lines = [*self.problems, message]
        hint = "(--help lists the arguments)"
        self.exit(2, "".join(f"{self.prog}: {_printable(line)} {hint}\n" for line in lines))

    def _end_if_wrong(self) -> None:
        """End the program if arguments were refused."""
        if self.problems:
            self.error(self.problems.pop())


def add_subcommand(
    actions: "argparse._SubParsersAction[Parser]",
    command: str,
    text: str,
    examples: str,
    arguments: Mapping[str, object],
) -> Parser:
    """Add the parser of a subcommand such as ``calibrate turntable``; returns it.

    :param examples: lines, of which those of the subcommand are taken.
    """
    command_examples = [
        line for line in examples.splitlines() if f"{line.strip()} ".startswith(f"{command} ")
    ]
    options: Keywords = {"examples": "\n".join(command_examples), "arguments": arguments}
    return actions.add_parser(command.split()[-1], help=text, description=text, **options)


def main(
    parser: Callable[[], Parser],
    command: Callable[[argparse.Namespace], None],
    argv: Sequence[str] | None = None,
) -> int:
    """Run a program: read its arguments, do its work, report what went wrong.

    :param command: function that does the work, and raises what goes wrong.
    :param argv: the command line without the program's name; None: that of the process.
    :returns: exit status: 0; 2 after a line for each problem of the input; 1 for anything else.
    :raises SystemExit: for arguments that cannot be read, with status 2, and after ``--help``.
    """
    open_standard_streams()
    program_parser = parser()
    complete(program_parser)
    try:
        arguments = program_parser.parse_every(argv)
    except BrokenPipeError:
        _give_up_output()
        return 1
    except Exception as error:  # an argument of an unforeseen kind
        return _report_error(program_parser.prog, error, debug=False)
    switches = vars(arguments)
    debug = switches.get("debug", False)
    quiet = any(switches.get(name, False) for name in ("quiet", "json"))
    written: list[Path] = []
    with watch(_watcher(program_parser.prog, quiet, written.append)):
        return run(program_parser.prog, lambda: command(arguments), debug, written)


def _watcher(name: str, quiet: bool, complete: Callable[[Path], None]) -> Watcher:
    """Return the receivers that print a job's lines and progress."""

    def said(kind: str) -> Callable[[str], None]:
        return lambda line: print(f"{name}: {kind}{line}", file=sys.stderr)

    lines = Watcher(
        warn=said("warning: "),
        remark=said(""),
        undisturbed=signals.delay_signals,
        interrupted=signals.is_interrupted,
        complete=complete,
    )
    return lines if quiet else replace(lines, bar=terminal_bar, note=said("note: "))


@contextmanager
def _remarks(program: str) -> Iterator[None]:
    """Print remarks and warnings of jobs as lines of a program."""
    with warnings.catch_warnings():
        for category in (InputWarning, Remark):
            warnings.simplefilter("always", category)
        usual, printed = warnings.showwarning, set[str]()

        def show(
            message: Warning | str, category: type[Warning], *rest: Any, **options: Any
        ) -> None:
            if issubclass(category, InputWarning | Remark):
                kind = "warning: " if issubclass(category, InputWarning) else ""
                # What a file says is remarked on each time when it is read.
                if str(message) not in printed:
                    print(f"{program}: {kind}{message}", file=sys.stderr)
                printed.add(str(message))
            else:
                usual(message, category, *rest, **options)

        warnings.showwarning = show
        yield


def run(
    program: str, command: Callable[[], None], debug: bool = False, written: Sequence[Path] = ()
) -> int:
    """Run a command; return its exit status after printing a line for each problem.

    :param debug: print tracebacks as well.
    :param written: the outputs that are complete so far.
    """
    try:
        files, spelling = open_files_once(), use_spelling("program")
        with signals.raise_signals(), _remarks(program), files, spelling:
            command()
            sys.stdout.flush()
    except BrokenPipeError:  # `| head` closed standard output
        _give_up_output()
        return 1
    except KeyboardInterrupt as error:
        return _report_interruption(program, error, written)
    except Exception as error:
        # Initialising an extension module turns an interruption into an ImportError (pybind11).
        if isinstance(error.__cause__, KeyboardInterrupt):
            return _report_interruption(program, error.__cause__, written)
        return _report_error(program, error, debug)
    return 0


def _report_interruption(program: str, error: KeyboardInterrupt, written: Sequence[Path]) -> int:
    """Print the fate of the outputs; return the exit status."""
    whole = f"{', '.join(map(str, written))} {'is' if len(written) == 1 else 'are'} complete"
    for line in error.args or [whole if written else "nothing was written"]:
        print(f"{program}: interrupted; {line}", file=sys.stderr)
    return signals.status()


def _report_error(program: str, error: Exception, debug: bool) -> int:
    """Print the lines of an error; return the exit status."""
    if debug:
        import traceback

        traceback.print_exception(error)
    lines, status = explain(error)
    for line in lines:
        print(f"{program}: {_printable(line)}", file=sys.stderr)
    try:
        sys.stdout.flush()
    except OSError:
        _give_up_output()
    return status


def _printable(line: str) -> str:
    """Return a line without line ends and control characters, which a hostile name may contain."""
    printable = "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in line)
    if len(printable) <= _LONGEST_LINE:
        return printable
    return f"{printable[: _LONGEST_LINE // 2]} ... {printable[-_LONGEST_LINE // 2 :]}"


def _give_up_output() -> None:
    """Drop text that standard output cannot take: the interpreter's end would write it again."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
