# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``generate``: parameters in, a bag or a dataset out, as fast as the machine can."""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from imu_sim_ros import program
from imu_sim_ros.bags.outputs import Outputs
from imu_sim_ros.bags.text import writer as text_writer
from imu_sim_ros.bags.threads import ahead
from imu_sim_ros.bags.write import open_writer
from imu_sim_ros.commands import bag_output, camera_output
from imu_sim_ros.commands.inputs import PoseReader, add_skip_bad_rows
from imu_sim_ros.commands.side_files import configs, new_truths
from imu_sim_ros.conventions import IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.datasets.topics import (
    BagTarget,
    DatasetTarget,
    body_of,
    chosen_topics,
    imus_of,
    in_tables,
    offered,
    sensors,
    usual_topics,
)
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.sensors import catalogue
from imu_sim_ros.simulation.engine import SimulatedBody
from imu_sim_ros.simulation.parameters import SimulationParameters, carried
from imu_sim_ros.simulation.playback import simulations
from imu_sim_ros.simulation.topics import TYPES

EXAMPLES: Final = """
  generate -o a.bag --imu-only --trajectory static --duration 4h --topic imu/data_raw=/imu
  generate -o flight.mcap --compression lz4 --trajectory groundtruth.csv
  generate -o flight --storage sqlite3 --imu mpu6000 --duration 10min --with-configs
  generate -o MH_99/mav0 --format euroc --duration 2min
  generate -o tracks --format tracks --camera euroc_cam0 --trajectory groundtruth.csv
"""
BLOCK_SIZE: Final = 16384


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = _Parser(
        prog="generate",
        description=__doc__,
        examples=EXAMPLES,
    )
    program.add_simulation_arguments(result)
    result.sensors = result.add_argument_group("sensors of the body (--set sensors=[NAME,...])")
    camera_output.add_arguments(result)
    add_skip_bad_rows(result)
    group = result.add_argument_group("output")
    bag_output.add_arguments(group, camera_output.FORMATS)
    group.add_argument(
        "--topics",
        metavar="NAME,...",
        default="",
        help=f"topics to write (default: {IMU_TOPIC},{TRUTH_TOPIC}); all: {', '.join(TYPES)}",
    )
    group.add_argument("--imu-only", action="store_true", help="leave out the ground truth")
    group.add_argument(
        "--with-configs",
        action="store_true",
        help="write configurations of IMU and cameras for kalibr, VINS, OpenVINS, ORB_SLAM3, "
        "Basalt, imu_utils and allan_variance_ros, and all parameters, to OUTPUT_configs",
    )
    program.add_output_arguments(result)
    lists = result.add_argument_group("lists (print and exit)")
    for option, (folder, words) in _LISTS.items():
        lists.add_argument(option, action=_List, nargs=0, const=folder, help=words)
    return result


_LISTS: Final = {
    "--list-imus": ("imus", "included sensors: grade, price class, maker and type"),
    "--list-trajectories": ("trajectories", "included motions"),
    "--list-cameras": ("cameras", "included cameras"),
    "--list-scenes": ("scenes", "included scenes"),
    "--list-sensors": ("sensors", "sensors of the body, those of other packages too"),
}


class _Parser(program.Parser):
    """Its help names the sensors of other packages, for which it looks only then."""

    sensors: Any

    def format_help(self) -> str:
        """Return the help text."""
        self.sensors.description = "; ".join(catalogue.carried_lines()) or "none is installed"
        return super().format_help()


class _List(argparse.Action):
    """Prints what a folder of config/ holds, or the sensors, and exits, as --help does."""

    def __call__(self, parser: argparse.ArgumentParser, *_arguments: object) -> None:
        """Print the list."""
        folder = str(self.const)
        tables = {"imus": catalogue.table, "sensors": catalogue.carried_table}
        print(tables[folder]() if folder in tables else catalogue.listing(folder))
        parser.exit()


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, generate, argv)


def generate(arguments: argparse.Namespace) -> None:
    """Write what the arguments ask for."""
    started = time.perf_counter()
    asked = camera_output.parameters(arguments)
    simulated, further = simulations(asked.simulator), asked.simulator.sensors
    names = chosen_topics(
        [name for name in arguments.topics.split(",") if name],
        arguments.imu_only,
        dict(arguments.topic),
        imus_of(simulated),
        [
            *camera_output.topics(arguments, asked.rig),
            *usual_topics(
                further, bag_output.form(arguments), arguments.output, arguments.imu_only
            ),
        ],
        further,
    )
    fastest = max(parameters.rate for parameters in simulated.values())
    bag_output.check_split(arguments.split_duration, 1.0 / fastest, asked.simulator.duration or 0.0)
    written = bag_output.bag_outputs(arguments, asked.values().values())
    if arguments.with_configs:
        written.add(configs(arguments.output))
    truths: dict[Path, str] = {}
    if _has_readings(arguments) and not arguments.output.parent.is_file():  # one line is enough
        truths = new_truths(arguments.output, simulated)
        for path in truths:
            written.add(path)
    with written:
        result = _generated(arguments, asked, names, written)
        for path, text in truths.items():
            written.where(path).write_text(text, encoding="utf-8")
    result["wall_s"] = time.perf_counter() - started
    _report(result, arguments)


def _generated(
    arguments: argparse.Namespace,
    asked: camera_output.Asked,
    names: dict[str, str],
    written: Outputs,
) -> dict[str, Any]:
    """Write the output and its configurations; returns the result but the time that it took."""
    simulated = simulations(asked.simulator)
    body = SimulatedBody(
        simulated,
        pose_reader=PoseReader(arguments, "generate"),
        sensors=sensors(names, imus_of(simulated), asked.simulator.sensors),
    )
    if body.total is None:
        raise ConfigurationError(
            "duration = 0: this trajectory has no end; give a duration, for instance --duration 20s"
        )
    for warning in body.warnings():
        print(f"generate: warning: {warning}", file=sys.stderr)
    imus = {name: body.simulations[name] for name in imus_of(simulated)}
    of_body = body.simulations[body_of(list(imus))]
    if not (arguments.quiet or arguments.json):
        print("".join(f"{note}\n" for note in of_body.notes()), end="")
    output = written.where(arguments.output)
    cameras = camera_output.rig(asked.rig, of_body)
    with _target(arguments, output, simulated, names, cameras) as target:
        written.describe(arguments.output, target.described)
        _write(body, target, arguments)
    if bag_output.form(arguments) == "tum_vi":
        from imu_sim_ros.commands.configurations import write_tum_vi_calibration

        write_tum_vi_calibration(output / "dso", simulated[""], asked.rig)
    if arguments.with_configs:
        from imu_sim_ros.commands.configurations import bagcreater_topics, write_configs

        folder = written.where(configs(arguments.output))
        topics = bagcreater_topics(imus) if arguments.format == "csv" else names
        for warning in write_configs(folder, imus, topics, asked.rig):
            print(f"generate: warning: {warning}", file=sys.stderr)
        camera_output.write_parameters(folder, arguments.output.name, asked)
    return {
        "output": str(arguments.output),
        "messages": target.counts,
        "samples": sum(simulation.position for simulation in imus.values()),
        "wall_s": 0.0,
        "bytes": sum(file.stat().st_size for file in target.files if file.is_file()),
    }


@contextmanager
def _bag(
    arguments: argparse.Namespace,
    output: Path,
    parameters: dict[str, SimulationParameters],
    names: dict[str, str],
    cameras: Any,
) -> Iterator[Any]:
    """Open a bag; it is complete when the block ends without an error."""
    imus = imus_of(parameters)
    known = offered(imus, tuple(carried(parameters[body_of(imus)])))
    with open_writer(
        output,
        arguments.storage,
        arguments.compression,
        arguments.split_duration,
        arguments.split_size,
    ) as writer:
        own = {name: new for name, new in names.items() if name in known}
        bag = BagTarget(writer, parameters, own)
        if cameras is None:
            yield bag
            return
        seen = {name: new for name, new in names.items() if name not in known}
        with camera_output.in_bag(bag, cameras, seen, arguments) as target:
            yield target


@contextmanager
def _target(
    arguments: argparse.Namespace,
    output: Path,
    parameters: dict[str, SimulationParameters],
    names: dict[str, str],
    cameras: Any,
) -> Iterator[Any]:
    """Open the output; it is complete when the block ends without an error."""
    form, imus = bag_output.form(arguments), imus_of(parameters)
    camera_output.check_form(form, output, cameras, len(imus))
    if form is None:
        with _bag(arguments, output, parameters, names, cameras) as bag:
            yield bag
        return
    body = parameters[body_of(imus)]
    further = tuple(carried(body))
    tables = in_tables(names, form, imus, further)
    if form in camera_output.CAMERA_FORMATS:
        with camera_output.opened(form, output, cameras, names, parameters, arguments) as seen:
            yield seen
        return
    states = TRUTH_TOPIC in names
    with text_writer.Dataset(output, form, states, len(imus), tables) as dataset:
        target = DatasetTarget(dataset, imus, further)
        if cameras is None:
            yield target
        else:
            comment = f"simulated by imu_sim_ros, seed {body.seed}"
            with camera_output.images(form, output, cameras, arguments, comment) as seen:
                target = camera_output.CameraTarget(dataset, seen, imus, further)
                yield target
        if form == "euroc":
            from imu_sim_ros.commands.configurations import describe

            for k, name in enumerate(imus):
                own = [table for table, imu in tables if imu == k]
                describe(output, k, parameters[name], states, own, body)
    target.files = dataset.files


def _write(
    body: SimulatedBody, target: BagTarget | DatasetTarget, arguments: argparse.Namespace
) -> None:
    """Write all samples."""
    quiet = arguments.quiet or arguments.json
    with program.progress(f"writing {arguments.output}", body.total or 0, quiet) as advance:
        # The samples are made in a thread of their own while the messages are written.
        size = min(BLOCK_SIZE, getattr(target, "block_size", BLOCK_SIZE))
        windows = ahead(body.windows(size))
        try:
            for blocks in windows:
                target.write(blocks)
                advance(sum(len(block.t_ns) for block in blocks.values()))
        finally:
            windows.close()  # type: ignore[attr-defined]


def _has_readings(arguments: argparse.Namespace) -> bool:
    return bag_output.form(arguments) not in ("tum", "vio_data_simulation")


def _report(result: dict[str, Any], arguments: argparse.Namespace) -> None:
    if arguments.json:
        program.print_json(result)
    elif not arguments.quiet:
        counts = ", ".join(f"{count:,} {name}" for name, count in result["messages"].items())
        speed = sum(result["messages"].values()) / result["wall_s"]
        shown = f"{speed / 1e3:,.0f} k" if speed >= 1e4 else f"{speed:,.0f}"
        print(
            f"{result['output']}: {counts}; {result['bytes'] / 1e6:,.1f} MB in "
            f"{result['wall_s']:.2f} s ({shown} messages/s)"
        )


if __name__ == "__main__":
    sys.exit(main())
