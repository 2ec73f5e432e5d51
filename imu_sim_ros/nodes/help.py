# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The help of a node: every parameter, wrapped to the terminal, and examples at the end."""

import argparse
from collections.abc import Mapping
from typing import Final

from imu_sim_ros.config import Parameter, parameters

EXAMPLES: Final = {
    "simulator": (
        "simulator --imu mpu6000 --trajectory figure_eight --rate 400",
        "simulator --trajectory flight.csv --ros-args -r imu/data_raw:=/imu0",
        "simulator --ros-args --params-file run.yaml -p seed:=7",
    ),
    "integrator": (
        "integrator --initial_state truth --error true",
        "integrator --method rk4 --path-rate 5 --ros-args -r imu/data_raw:=/imu0",
    ),
    "recorder": (
        "recorder",
        "recorder -o flight imu/data_raw /ground_truth/odom",
        "recorder -o flight.bag --duration 20s",
    ),
}


class Formatter(argparse.HelpFormatter):
    """Wraps paragraphs one by one, and leaves the examples as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if text.startswith("examples:"):
            return text
        paragraphs = text.strip().split("\n\n")
        return "\n\n".join(super(Formatter, self)._fill_text(p, width, indent) for p in paragraphs)


def help_text(program: str, text: str, section: type, values: Mapping[str, object]) -> str:
    """Return the help of a node: every parameter with its default, unit, range and text."""
    return parser(program, text, section, values).format_help()


def parser(
    program: str, text: str, section: type, values: Mapping[str, object]
) -> argparse.ArgumentParser:
    """Return a parser that knows the parameters, for the help and for tab completion."""
    examples = "".join(f"\n  {line}" for line in EXAMPLES[program])
    result = argparse.ArgumentParser(
        prog=program,
        usage=f"{program} [--PARAMETER VALUE ...] [--ros-args ...]",
        description=text,
        epilog=f"examples:{examples}",
        formatter_class=Formatter,
    )
    result.add_argument("--debug", action="store_true", help="show the traceback of an error")
    group = result.add_argument_group("parameters (* changes while the node runs)")
    for name, parameter in parameters(section, values).items():
        mark = " *" if parameter.live else ""
        words = f"{parameter.text}{mark} ({parameter.allowed()}; default {_plainly(parameter)})"
        group.add_argument(f"--{name}", metavar="VALUE", help=words.replace("%", "%%"))
    return result


def _plainly(parameter: Parameter) -> str:
    default = parameter.default
    if isinstance(default, tuple):
        return "[" + ", ".join(str(entry) for entry in default) + "]"
    return repr(default) if isinstance(default, str) else str(default).lower()
