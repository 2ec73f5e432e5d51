# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A program's parser, its run with the exit status, and its error messages."""

import argparse
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any, Final, NoReturn

from imu_sim_ros import __version__
from imu_sim_ros.commands.common import signals
from imu_sim_ros.commands.common.completion import complete
from imu_sim_ros.commands.common.streams import open_standard_streams
from imu_sim_ros.errors import explain
from imu_sim_ros.names import unknown

_LONGEST_LINE: Final = 1000


class Formatter(argparse.HelpFormatter):
    """Wraps the description to the terminal and leaves the examples as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if text.startswith("examples:"):
            return "".join(indent + line for line in text.splitlines(keepends=True))
        return super()._fill_text(text, width, indent)


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaint is one line, and that knows ``--debug``, ``--version``.

    Options are written in full: an abbreviation of one may be that of another tomorrow. What it
    parses has ``words``: the names of the arguments that are one of a few words, and so
    never the name of a file.
    """

    def __init__(self, prog: str | None = None, *, examples: str = "", **options: Any) -> None:
        """Set up the parser.

        :param examples: command lines, one a line; the help ends with them.
        """
        if examples:
            lines = "".join(f"\n  {line.strip()}" for line in examples.strip().splitlines())
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
        """Parse, subcommands included, and note which arguments are one of a few words.

        An unknown option is said before what is missing because of it.
        """
        self._refuse(self._unknown_options(sys.argv[1:] if args is None else args))
        found, rest = super().parse_known_args(args, namespace)
        return self._with_words(found), rest

    def parse_args(  # type: ignore[override]  # the overloads say the same
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> argparse.Namespace:
        """Parse; whatever is left over is an error."""
        found, rest = self.parse_known_args(args, namespace)
        self._refuse(rest)
        return found

    def parse_every(self, argv: Sequence[str] | None) -> argparse.Namespace:
        """Parse a command line on which options may also stand between several inputs."""
        if not any(action.nargs == "+" for action in self._get_positional_actions()):
            return self.parse_args(argv)
        found, rest = self.parse_known_intermixed_args(argv)
        self._refuse(rest)
        return self._with_words(found)

    def _with_words(self, found: argparse.Namespace) -> argparse.Namespace:
        words = {action.dest for action in self._actions if action.choices is not None}
        found.words = getattr(found, "words", frozenset()) | words
        return found

    def _unknown_options(self, words: Sequence[str]) -> Iterator[str]:
        """Yield the options that this parser does not have; a subcommand looks at its own."""
        choices = [action.choices for action in self._actions if action.nargs == argparse.PARSER]
        for word in words:
            name = word.partition("=")[0]
            if word == "--" or any(word in each for each in choices if each is not None):
                return
            if (
                name.startswith("--")
                and " " not in name
                and name not in self._option_string_actions
            ):
                yield word

    def _refuse(self, words: Iterable[str]) -> None:
        """End if a word is left over that is no argument."""
        for word in words:
            if not word.startswith("-"):
                self.error(f"unexpected argument {word!r}")
            self.error(unknown("option", word.partition("=")[0], self._options(), ""))

    def _options(self) -> Iterator[str]:
        """Yield the options of this parser and of its subcommands."""
        yield from self._option_string_actions
        for action in self._actions:
            if action.nargs == argparse.PARSER and isinstance(action.choices, dict):
                for parser in action.choices.values():
                    yield from parser._options()

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            name = (action.option_strings or [str(action.metavar or action.dest).lower()])[-1]
            raise argparse.ArgumentError(None, unknown(name, value, action.choices))

    def _get_values(self, action: argparse.Action, arg_strings: list[str]) -> Any:
        """Return the value of ``--name=--``, too; argparse would pass an empty list on."""
        if arg_strings == ["--"] and action.option_strings and action.nargs is None:
            value = self._get_value(action, "--")
            self._check_value(action, value)
            return value
        return super()._get_values(action, arg_strings)

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line and end with status 2."""
        self.exit(2, f"{self.prog}: {_shortened(message)} (--help lists the arguments)\n")


def examples_of(examples: str, command: str) -> str:
    """Return the example lines of one subcommand, such as ``calibrate turntable``."""
    return "\n".join(
        line for line in examples.splitlines() if f"{line.strip()} ".startswith(command)
    )


def main(
    parser: Callable[[], Parser],
    command: Callable[[argparse.Namespace], None],
    argv: Sequence[str] | None = None,
) -> int:
    """Run a program: read its arguments, do its work, report what went wrong.

    :param command: does the work; raises what goes wrong.
    :param argv: the command line without the program's name; None: that of the process.
    :returns: exit status: 0; 2 after a line for each problem of the input; 1 for anything else.
    :raises SystemExit: for arguments that cannot be read, with status 2, and after ``--help``.
    """
    open_standard_streams()
    made = parser()
    complete(made)
    try:
        arguments = made.parse_every(argv)
    except BrokenPipeError:
        _give_up_output()
        return 1
    except Exception as error:  # an argument of an unforeseen kind
        return _told(made.prog, error, debug=False)
    return run(made.prog, lambda: command(arguments), getattr(arguments, "debug", False))


def run(program: str, command: Callable[[], None], debug: bool = False) -> int:
    """Run a command; return its exit status after printing a line for each problem.

    :param debug: print tracebacks as well.
    """
    try:
        with signals.raised():
            command()
        sys.stdout.flush()
    except BrokenPipeError:  # `| head` closed standard output
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
        import traceback

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


def _give_up_output() -> None:
    """Forget what standard output cannot take; the interpreter's end would try again."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
