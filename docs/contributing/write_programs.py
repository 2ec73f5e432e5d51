# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The programs as Markdown: what each does, its arguments, examples.

``python docs/contributing/write_programs.py > docs/reference/programs.md``
"""

import argparse
import importlib
from collections.abc import Iterator

from imu_sim_ros.commands.start import NODES, PROGRAMS

_INTRODUCTION = """\
# Programs

This page lists the arguments of every command; `make reference` writes it. Run a program with
`imu_sim PROGRAM` or, in a ROS 2 workspace, with `ros2 run imu_sim_ros PROGRAM`; `make build` also
installs each under its own name in `.venv/bin`. `imu_sim PROGRAM --help` prints the texts below.
Every program also has `--version` and `--debug` (tracebacks).

Outputs are complete when they appear under their name, and are never overwritten without `--force`.
`--json` prints one object on standard output and nothing else there.

| exit status | meaning |
|---|---|
| 0 | done |
| 1 | any other failure |
| 2 | bad arguments, configuration or input, with one line for each problem on standard error |
| 3 | a campaign's gate is not met, or `inspect` has a finding of `--fail-on` |
"""
_NODES = """\
Every parameter is an argument (`--rate 400`, `--imu.gyroscope_bias '[0.01, 0, 0]'`); all of them
are in [parameters](parameters.md), topics and services in [nodes](nodes.md).
"""
_EVERYWHERE = ("-h", "--debug", "--version")


def reference() -> str:
    """Return the whole page."""
    return "\n".join(_lines())


def _lines() -> Iterator[str]:
    yield _INTRODUCTION
    for name in PROGRAMS:
        parser = importlib.import_module(f"imu_sim_ros.commands.{name}").parser()
        yield f"## {name}\n"
        yield from _program(parser)
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                for kind, inner in action.choices.items():
                    yield f"### {name} {kind}\n"
                    yield from _program(inner)
    yield "## Nodes\n"
    yield _NODES
    yield from (f"- `{name}`: {text}" for name, text in NODES.items())
    yield ""


def _program(parser: argparse.ArgumentParser) -> Iterator[str]:
    text = " ".join((parser.description or "").split())
    yield f"{_plain(text)}\n"
    rows = [row for action in parser._actions if (row := _row(action))]
    if rows:
        yield "| argument | meaning |"
        yield "|---|---|"
        yield from rows
        yield ""
    examples = (parser.epilog or "").removeprefix("examples:").strip("\n")
    if examples:
        yield "```sh"
        yield from (line.strip() for line in examples.splitlines())
        yield "```\n"


def _row(action: argparse.Action) -> str:
    """Return an argument's row; empty for what every program has, and for subcommands."""
    if isinstance(action, argparse._SubParsersAction) or action.help == argparse.SUPPRESS:
        return ""
    if action.option_strings and action.option_strings[0] in _EVERYWHERE:
        return ""
    value = ""
    if action.nargs != 0:
        choices = "{" + ",".join(map(str, action.choices)) + "}" if action.choices else ""
        shown = action.metavar or choices or action.dest.upper()
        value = shown if isinstance(shown, str) else " ".join(shown)
    if not action.option_strings:
        name = f"`{value}`"
    else:
        name = ", ".join(f"`{option}`" for option in action.option_strings)
        name += f" `{value}`" if value else ""
    description = (action.help or "") % {**vars(action), "prog": ""}
    return f"| {name.replace('|', chr(92) + '|')} | {_plain(description)} |"


def _plain(text: str) -> str:
    """Return words that Markdown leaves as they are."""
    return text.replace("|", "\\|").replace("<", "\\<").replace("*", "\\*").replace("``", "`")


if __name__ == "__main__":
    print(reference(), end="")
