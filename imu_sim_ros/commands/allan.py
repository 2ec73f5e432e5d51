# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``allan``: estimate the noise parameters of an IMU at rest, with confidence intervals.

The estimates are maximum likelihood on the cosine spectrum of the record, not lines through the
Allan curve; see imu_sim_ros.calibration.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros import program
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.calibration.noise.analysis import MODELS, AllanResult
from imu_sim_ros.calibration.noise.estimate import Estimate
from imu_sim_ros.calibration.noise.terms import quantity
from imu_sim_ros.calibration.noise.truth import Comparison, load_truth
from imu_sim_ros.commands.inputs import add_skip_bad_rows, skipped_rows
from imu_sim_ros.commands.outputs import add_force, outputs
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.errors import InputError
from imu_sim_ros.jobs.allan import FILES, Noise, of_files, write_files

_OPTIONAL = ("quantisation", "rate_ramp")
EXAMPLES: Final = """
allan rest.mcap -o allan
allan first.bag second.bag --topic /imu0 --model gauss_markov
allan rest.mcap --truth adis16448 --no-files --json
"""


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(prog="allan", description=__doc__, examples=EXAMPLES)
    result.add_argument(
        "bags",
        metavar="BAG",
        nargs="+",
        type=Path,
        help="bag, EuRoC folder or CSV file of one IMU at rest; several bags are combined",
    )
    result.add_argument("--topic", help="sensor_msgs/Imu topic, if a bag has several")
    result.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="folder for the files (default: allan)"
    )
    result.add_argument(
        "--model",
        choices=MODELS,
        default="standard",
        help="standard: Q, N, B, K and R as far as the data resolve them; gauss_markov: white "
        "noise and a first-order Gauss-Markov process",
    )
    result.add_argument(
        "--truth",
        metavar="NAME|FILE",
        help="compare with the parameters that generated the bag: a name in config/imus or a file",
    )
    result.add_argument(
        "--skip-checks", action="store_true", help="continue when a check of the data fails"
    )
    add_skip_bad_rows(result)
    add_force(result)
    result.add_argument("--no-files", action="store_true", help="write no files, print only")
    program.add_output_arguments(result)
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, allan, argv)


def allan(arguments: argparse.Namespace) -> None:
    """Analyse, write the files and print."""
    if arguments.truth:
        load_truth(arguments.truth)  # before the work begins
    written = outputs(arguments)
    folder = arguments.output or Path("allan")
    staging = None if arguments.no_files else written.add_files(folder, FILES)
    with written:
        found = _analysed(arguments)
        comparisons = found.compare(arguments.truth) if arguments.truth else []
        if staging is not None:
            write_files(found, staging, arguments.topic or "/imu0")
    if staging is not None:
        for name in set(FILES) - set(found.files):  # replaced by nothing: of an earlier record
            (folder / name).unlink(missing_ok=True)
    if arguments.json:
        compared = {"truth": [one.to_dict() for one in comparisons]} if comparisons else {}
        program.print_json({**found.to_dict(), **compared})
    elif not arguments.quiet:
        files = [] if arguments.no_files else [folder / name for name in found.files]
        _print(found.result, comparisons, files)


def _analysed(arguments: argparse.Namespace) -> Noise:
    count = sum(_count(bag, arguments.topic) for bag in arguments.bags)
    with program.progress("read", count, arguments.quiet or arguments.json) as advance:
        return of_files(
            arguments.bags,
            arguments.model,
            arguments.skip_checks,
            arguments.topic,
            lambda path: skipped_rows(arguments, "allan", path),
            advance,
        )


def _count(path: Path, topic: str | None) -> int:
    """Return how many messages will be read, for the progress bar; 0 for text files."""
    if not sys.stderr.isatty():
        return 0
    try:
        with open_bag(path) as bag:
            return sum(
                info.count
                for info in bag.topics
                if info.type == "sensor_msgs/msg/Imu" and topic in (None, info.name)
            )
    except InputError:  # not a bag: a dataset, or the reader will say what is wrong
        return 0


def _print(result: AllanResult, comparisons: Sequence[Comparison], files: Sequence[Path]) -> None:
    timing = result.timing
    print(f"{result.record}, stamp jitter {timing.jitter * 1e3:.3g} ms, {timing.lost} samples lost")
    for warning in result.warnings:
        print(f"note: {warning}")
    by_place = {(c.axis, c.key): c for c in comparisons}
    for triad in range(len(TRIADS)):
        _print_triad(result, triad, by_place)
    if comparisons:
        covered = sum(c.covered for c in comparisons)
        print(f"{covered} of {len(comparisons)} intervals contain the truth")
    for path in files:
        print(path)
    if files and result.reasons:
        print(f"no configuration files: {', '.join(result.reasons)} not analysed")


def _print_triad(
    result: AllanResult, triad: int, by_place: Mapping[tuple[int, str], Comparison]
) -> None:
    """Print the terms of one sensor, each axis with its interval, then in data sheets' units."""
    header = ["", "axis", "value", "95 % interval", *(["truth", "covered"] if by_place else [])]
    rows, names, field_rows = [], [], []
    for key in result.keys:
        axes = range(3 * triad, 3 * triad + 3)
        found = [result.estimate(axis, key) for axis in axes]
        known = any((axis, key) in by_place for axis in axes)
        if key in _OPTIONAL and all(each.value is None for each in found) and not known:
            continue
        q = quantity(TRIADS[triad], key)
        names.append(f"{q.symbol} {q.text}")
        for axis, each in zip(axes, found, strict=True):
            row = [f"{q.symbol} [{q.unit}]", "xyz"[axis % 3], *_value_and_interval(each)]
            if by_place:
                row += _truth_columns(by_place.get((axis, key)))
            rows.append(row)
        values = [_value_and_interval(each, q.field_factor)[0] for each in found]
        field_rows.append([f"{q.symbol} [{q.field_unit}]", *values])
    program.print_table(header, rows, f"{TRIADS[triad].capitalize()}: {', '.join(names)}")
    program.print_table(["in data sheets' units", "x", "y", "z"], field_rows)


def _value_and_interval(found: Estimate, factor: float = 1.0) -> list[str]:
    if np.isinf(found.high):
        return ["not analysed", ""]
    if found.value is None:
        return [f"< {found.high * factor:.3g}", ""]
    interval = f"{found.low * factor:.4g} .. {found.high * factor:.4g}"
    return [f"{found.value * factor:.4g}", interval]


def _truth_columns(comparison: Comparison | None) -> list[str]:
    if comparison is None:
        return ["", ""]
    return [f"{comparison.truth:.4g}", "yes" if comparison.covered else "NO"]


if __name__ == "__main__":
    sys.exit(main())
