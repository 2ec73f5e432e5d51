# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``allan``: estimate the noise parameters of an IMU at rest, with confidence intervals.

The estimates are maximum likelihood on the cosine spectrum of the record, not lines through the
Allan curve; see imu_sim_ros.calibration.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from imu_sim_ros import program
from imu_sim_ros.bags.read import ImuMessages, imu_blocks, open_bag
from imu_sim_ros.calibration.noise import noise_files, truth
from imu_sim_ros.calibration.noise.analysis import MODELS, AllanResult, analyse
from imu_sim_ros.calibration.noise.estimate import Estimate
from imu_sim_ros.calibration.noise.terms import quantity
from imu_sim_ros.commands.inputs import add_skip_bad_rows, skipped_rows
from imu_sim_ros.commands.outputs import add_force, outputs
from imu_sim_ros.conventions import TRIADS
from imu_sim_ros.errors import InputError

_CONFIGURATIONS = ("kalibr_imu.yaml", "imu_utils.yaml", "imu_utils_continuous.yaml", "imu.yaml")
_FILES = ("allan.csv", *_CONFIGURATIONS, "allan.png")
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
    written = outputs(arguments)
    folder = arguments.output or Path("allan")
    staging = None if arguments.no_files else written.add_files(folder, _FILES)
    with written:
        result, comparisons = _analysed(arguments, staging)
    if staging is not None:
        for name in set(_FILES) - _written(result):  # replaced by nothing: of an earlier record
            (folder / name).unlink(missing_ok=True)
    if arguments.json:
        program.print_json(_json(result, comparisons))
    elif not arguments.quiet:
        files = [] if arguments.no_files else [folder / name for name in sorted(_written(result))]
        _print(result, comparisons, files)


def _analysed(
    arguments: argparse.Namespace, folder: Path | None
) -> tuple[AllanResult, Sequence[truth.Comparison]]:
    """Analyse, and write the files into a folder."""
    true_imu = truth.load_truth(arguments.truth) if arguments.truth else None
    count = sum(_count(bag, arguments.topic) for bag in arguments.bags)
    with program.progress("read", count, arguments.quiet or arguments.json) as advance:
        result = analyse(
            _blocks(arguments),
            model=arguments.model,
            force=arguments.skip_checks,
            advance=advance,
        )
    comparisons = [] if true_imu is None else truth.compare(result, true_imu)
    if folder is not None:
        _write(result, folder, arguments)
    return result, comparisons


def _written(result: AllanResult) -> set[str]:
    """Return the files that a result has: configurations need a number for every axis."""
    return set(_FILES) - set(_CONFIGURATIONS if result.reasons else ())


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


def _blocks(arguments: argparse.Namespace) -> Iterator[Iterator[ImuMessages]]:
    for bag in arguments.bags:
        yield imu_blocks(bag, arguments.topic, skipped=skipped_rows(arguments, "allan", bag))


def _write(result: AllanResult, output: Path, arguments: argparse.Namespace) -> None:
    """Write the files of ``_FILES``; no configurations if an axis is not analysed."""
    from imu_sim_ros.plots import allan as picture

    source = ", ".join(str(bag) for bag in arguments.bags)
    noise_files.write_csv(result, output / "allan.csv")
    picture.draw(result, output / "allan.png", ", ".join(bag.name for bag in arguments.bags))
    if result.reasons:
        return
    noise_files.write_kalibr(result, output / "kalibr_imu.yaml", arguments.topic or "/imu0")
    for name, continuous in (("imu_utils.yaml", False), ("imu_utils_continuous.yaml", True)):
        noise_files.write_imu_utils(result, output / name, continuous=continuous)
    noise_files.write_parameters(result, output / "imu.yaml", source)


def _json(result: AllanResult, comparisons: Sequence[truth.Comparison]) -> Mapping[str, Any]:
    timing = result.timing
    values: dict[str, Any] = {
        "rate_hz": timing.rate,
        "duration_s": result.duration,
        **{
            name: {key: _json_term(result, k, key) for key in result.keys}
            for k, name in enumerate(TRIADS)
        },
        "not_analysed": result.reasons,
        "model": result.model,
        "jitter_s": timing.jitter,
        "lost": timing.lost,
        "gaps": timing.gaps,
        "warnings": list(result.warnings),
    }
    if comparisons:
        values["truth"] = [
            {
                "triad": TRIADS[c.axis // 3],
                "axis": "xyz"[c.axis % 3],
                "parameter": c.key,
                "truth": c.truth,
                "covered": c.covered,
            }
            for c in comparisons
        ]
    return values


def _json_term(result: AllanResult, triad: int, key: str) -> Mapping[str, Any]:
    found = [result.estimate(3 * triad + k, key) for k in range(3)]
    known = [result.noise[3 * triad + k] is not None for k in range(3)]
    return {
        "value": [e.value for e in found],
        "low": [e.low if there else None for e, there in zip(found, known, strict=True)],
        "high": [e.high if there else None for e, there in zip(found, known, strict=True)],
    }


def _print(
    result: AllanResult, comparisons: Sequence[truth.Comparison], files: Sequence[Path]
) -> None:
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
    result: AllanResult, triad: int, by_place: Mapping[tuple[int, str], truth.Comparison]
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


def _truth_columns(comparison: truth.Comparison | None) -> list[str]:
    if comparison is None:
        return ["", ""]
    return [f"{comparison.truth:.4g}", "yes" if comparison.covered else "NO"]


if __name__ == "__main__":
    sys.exit(main())
