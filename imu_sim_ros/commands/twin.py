# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``twin``: a sensor on its vehicle, from a recording in motion with a true trajectory."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros import program
from imu_sim_ros.bags.messages.encode import NAV_SAT_FIX
from imu_sim_ros.bags.messages.joints import JOINT_STATE
from imu_sim_ros.bags.read import open_bag, read_imu
from imu_sim_ros.bags.text.reader import is_text
from imu_sim_ros.calibration.twin import comparison
from imu_sim_ros.commands.inputs import PoseReader, add_skip_bad_rows, skipped_rows
from imu_sim_ros.commands.outputs import add_force, outputs
from imu_sim_ros.conventions import AXES, GRAVITY, TRIADS
from imu_sim_ros.jobs.readings import Readings
from imu_sim_ros.jobs.twin import Twin, labels
from imu_sim_ros.jobs.twin import twin as find
from imu_sim_ros.jobs.twin_check import Check

_UNITS: Final = {
    "stamp_offset": "s",
    "clock_skew_ppm": "ppm",
    "mounting": "rad",
    "lever_arm": "m",
    "gyroscope_bias": "rad/s",
    "gyroscope_g_sensitivity": "(rad/s)/(m/s^2)",
    "accelerometer_bias": "m/s^2",
    "truth_curvature": "s^2",
    "truth_turn": "rad",
}
_OF_AIDING: Final = (NAV_SAT_FIX, JOINT_STATE)


def print_twin(found: Twin) -> None:
    """Print all that was found."""
    rows = []
    for name, calibrated in found.errors.items():
        for label, value, sigma in zip(
            labels(len(calibrated.value)), calibrated.value, calibrated.sigma, strict=True
        ):
            if sigma != 0.0:
                unit = _UNITS.get(name, "1")
                mark = "no" if f"{name} {label}" in found.undetermined else ""
                numbers = ["not given", ""] if np.isnan(value) else [f"{value:.6g}", f"{sigma:.2g}"]
                rows.append([f"{name} {label}".strip(), *numbers, unit, mark])
    program.print_table(
        ["", "value", "sigma", "unit", "determined"],
        rows,
        "Constant errors; sigma: standard error; mounting: rotation vector of R_ib",
    )
    noise = found.source.noise
    if noise.there:
        angle, distance = 1e3 * noise.deviation
        print(
            f"the poses scatter by {distance:.3g} mm and {angle:.3g} mrad; their motion stands out "
            f"of that up to {found.source.cutoff:.3g} Hz, the cut-off"
        )
    if found.clock_wander > 0.0:
        print(
            f"the truth's clock wanders by {1e3 * found.clock_wander:.2f} ms RMS around offset "
            "and skew; that is taken out and not simulated"
        )
    _print_white(found)
    _print_lines(found)
    _print_intensity(found)
    if found.check is not None:
        _print_check(found.check)


def _print_white(found: Twin) -> None:
    white = found.analysis.white
    rows = []
    for k, (triad, axis) in enumerate((t, a) for t in TRIADS for a in AXES):
        hidden = white.low[k] == 0.0
        value = f"< {white.high[k]:.3g}" if hidden else f"{white.density[k]:.4g}"
        interval = "" if hidden else f"{white.low[k]:.4g} .. {white.high[k]:.4g}"
        rows.append([f"{triad} {axis}", value, interval])
    title = f"White floor; {len(found.analysis.vibration.low)} bands of vibration above it"
    program.print_table(["[unit/sqrt(Hz)]", "value", "95 % interval"], rows, title)


def _print_lines(found: Twin) -> None:
    lines = found.analysis.lines
    rows = [
        [f"{f:.4f}", f"{s:.2g}", *(f"{a:.3g} +- {e:.1g}" for a, e in zip(size, error, strict=True))]
        for f, s, size, error in zip(
            lines.frequency,
            lines.frequency_sigma,
            lines.amplitude,
            lines.amplitude_sigma,
            strict=True,
        )
    ]
    if rows:
        names = [f"{triad}{axis}" for triad in "ga" for axis in AXES]
        program.print_table(
            ["line [Hz]", "sigma", *names], rows, "Lines: amplitudes [rad/s, m/s^2]"
        )


def _print_intensity(found: Twin) -> None:
    exponents, edges = found.analysis.exponents, found.analysis.range_edges
    rows = []
    for k in range(len(edges) - 1):
        for triad, name in enumerate(TRIADS):
            if exponents.value[k, triad].any():
                values = zip(exponents.value[k, triad], exponents.sigma[k, triad], strict=True)
                rows.append(
                    [f"{edges[k]:g}-{edges[k + 1]:g} Hz {name}"]
                    + [f"{v:.2f} +- {s:.2f}" if v else "" for v, s in values]
                )
    if rows:
        title = "Intensity follows the motion: exponents"
        program.print_table(["", "rate", "acceleration", "speed"], rows, title)


def _print_check(check: Check) -> None:
    rows = []
    for band, (low, high) in enumerate(comparison.BANDS):
        values = check.decibels[band]
        rows.append(
            [
                f"{low:g}-{high:g} Hz",
                *("" if np.isnan(v) else f"{round(v, 1) + 0.0:+.1f}" for v in values),
            ]
        )
    names = [f"{triad}{axis}" for triad in "ga" for axis in AXES]
    title = f"Twin over real sensor on the {check.seconds:.1f} s it has not seen [dB]"
    program.print_table(["density", *names], rows, title)
    drift = zip((1, 2, 5), check.real_drift, check.simulated_drift, strict=True)
    for seconds, real, simulated in drift:
        print(
            f"dead-reckoned for {seconds} s: median error {simulated:.3g} m, the real sensor's "
            f"{real:.3g} m ({100.0 * (simulated / real - 1.0):+.0f} %)"
        )
    louder = ", ".join(f"{20.0 * np.log10(r):+.1f}" for r in check.truth_noise)
    print(f"noise of the truth itself on this part over that of the fitted one: {louder} dB")
    twin, real = 100.0 * check.told_apart, 100.0 * check.real_told_apart
    print(
        f"a classifier tells windows of twin and real sensor apart in {twin:.0f} %, of the real "
        f"sensor on both parts in {real:.0f} % (50 %: it cannot)"
    )


EXAMPLES: Final = """
twin flight.bag --truth mocap.tum -o twin
twin imu.csv --truth groundtruth.csv --fit 20s --json
twin flight.mcap --truth flight.mcap --truth-topic /ground_truth/odom --no-files
"""
_FILES: Final = ("twin.yaml", "twin.png")


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(prog="twin", description=__doc__, examples=EXAMPLES)
    result.add_argument(
        "recording", metavar="RECORDING", type=Path, help="bag, EuRoC folder or CSV file"
    )
    result.add_argument(
        "--truth",
        metavar="POSES",
        type=Path,
        required=True,
        help="true poses of the body: TUM or EuRoC text, or a bag",
    )
    result.add_argument("--topic", help="sensor_msgs/Imu topic, if the bag has several")
    result.add_argument(
        "--truth-topic", metavar="TOPIC", help="topic of the poses, if the bag has several"
    )
    _add_numbers(result)
    result.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        default=Path("twin"),
        help="folder for twin.yaml and twin.png (default: twin)",
    )
    result.add_argument("--no-files", action="store_true", help="write no files, print only")
    add_skip_bad_rows(result)
    add_force(result)
    program.add_output_arguments(result)
    return result


def _add_numbers(result: argparse.ArgumentParser) -> None:
    result.add_argument(
        "--fit",
        metavar="TIME",
        type=program.duration,
        help="use this much of the recording, and compare the twin with the rest",
    )
    result.add_argument(
        "--gravity", type=float, default=-GRAVITY[2], help="local gravity [m/s^2] (%(default)s)"
    )
    result.add_argument(
        "--cutoff",
        metavar="HZ",
        type=float,
        default=12.0,
        help="motion of the truth at higher frequencies counts as vibration (%(default)s)",
    )
    result.add_argument(
        "--max-offset",
        metavar="TIME",
        type=program.duration,
        default=0.5,
        help="largest offset between both clocks that is looked for (%(default)s s)",
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, run, argv)


def run(arguments: argparse.Namespace) -> None:
    """Find the twin, write the files and print."""
    written = outputs(arguments)
    staging = None if arguments.no_files else written.add_files(arguments.output, _FILES)
    with written:
        found = _found(arguments)
        if staging is not None:
            from imu_sim_ros.plots import style

            found.write(staging / _FILES[0])
            style.save(found.plot(), staging / _FILES[1])
    aiding = _aiding(arguments.recording)
    if aiding and not arguments.quiet:
        print(
            f"twin: {', '.join(aiding)}: not fitted; the twin is that of the IMU. --gnss and "
            "--wheels of generate add those sensors, with the accuracies that their files state; "
            "report compares topics with their truth",
            file=sys.stderr,
        )
    for warning in found.warnings:
        print(f"twin: warning: {warning}", file=sys.stderr)
    if arguments.json:
        program.print_json(found.as_json())
    elif not arguments.quiet:
        print_twin(found)
        if not arguments.no_files:
            print("\n".join(str(arguments.output / name) for name in _FILES))


def _aiding(recording: Path) -> list[str]:
    """Return the topics of a recording that receivers and wheels have, without their truth."""
    if is_text(recording):
        return []
    with open_bag(recording) as bag:
        topics = [one for one in bag.topics if one.count and "ground_truth/" not in one.name]
    return [t.name for t in topics if t.type in _OF_AIDING or t.name.endswith("wheel/odom")]


def _found(arguments: argparse.Namespace) -> Twin:
    left_out = skipped_rows(arguments, "twin", arguments.recording)
    imu = read_imu(arguments.recording, arguments.topic, left_out)
    poses = PoseReader(arguments, "twin")(arguments.truth, arguments.truth_topic)
    return find(
        Readings(imu.t_ns, imu.gyro, imu.accel, str(arguments.recording)),
        poses,
        fit=arguments.fit,
        gravity=arguments.gravity,
        cutoff=arguments.cutoff,
        max_offset=arguments.max_offset,
    )
