# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``generate``: parameters in, a bag or a dataset out, as fast as the machine can."""

import argparse
import dataclasses
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np

from imu_sim_ros.bags import Outputs, ahead, open_writer
from imu_sim_ros.bags.text import writer as text_writer
from imu_sim_ros.commands import bag_output, camera_output, common, shared
from imu_sim_ros.config import SimulationParameters, files, flatten
from imu_sim_ros.consumers import ImuValues, write_all
from imu_sim_ros.conventions import IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.datasets import (
    BagTarget,
    DatasetTarget,
    chosen_topics,
    resolved,
)
from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.sensor import catalogue, realised_imu
from imu_sim_ros.simulation import Simulation
from imu_sim_ros.topics import TYPES

EXAMPLES: Final = """
  generate -o allan.bag --imu-only --trajectory static --duration 4h --topic imu/data_raw=/imu
  generate -o flight.mcap --compression lz4 --trajectory groundtruth.csv
  generate -o flight --storage sqlite3 --imu mpu6000 --duration 10min --with-configs
  generate -o MH_99/mav0 --format euroc --duration 2min
  generate -o tracks --format tracks --camera euroc_cam0 --trajectory groundtruth.csv
"""
BLOCK_SIZE: Final = 16384


def parser() -> argparse.ArgumentParser:
    """Return the command's arguments."""
    result = common.Parser(
        prog="generate",
        description=__doc__,
        examples=EXAMPLES,
    )
    common.add_simulation_arguments(result)
    camera_output.add_arguments(result)
    shared.add_skip_bad_rows(result)
    group = result.add_argument_group("output")
    bag_output.add_arguments(group, camera_output.FORMATS)
    group.add_argument(
        "--topics",
        metavar="NAME,...",
        default="",
        help=f"what is written ({IMU_TOPIC},{TRUTH_TOPIC}); all: {', '.join(TYPES)}",
    )
    group.add_argument("--imu-only", action="store_true", help="no ground truth")
    group.add_argument(
        "--with-configs",
        action="store_true",
        help="write the IMU for kalibr, VINS, OpenVINS, ORB_SLAM3, Basalt, imu_utils and "
        "allan_variance_ros, and all parameters, to OUTPUT_configs",
    )
    common.add_output_arguments(result)
    result.add_argument(
        "--list-imus",
        action=_ListImus,
        nargs=0,
        help="list the sensors that come with it: grade, price class, source; then exit",
    )
    return result


class _ListImus(argparse.Action):
    """Prints the sensors' table and exits, as --help does."""

    def __call__(self, parser: argparse.ArgumentParser, *_arguments: object) -> None:
        """Print the table."""
        print(catalogue.table())
        parser.exit()


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return common.main(parser, generate, argv)


def generate(arguments: argparse.Namespace) -> None:
    """Write what the arguments ask for."""
    started = time.perf_counter()
    parameters, rig = camera_output.parameters(arguments)
    names = chosen_topics(
        [name for name in arguments.topics.split(",") if name],
        arguments.imu_only,
        dict(arguments.topic),
    )
    bag_output.check_split(
        arguments.split_duration, 1.0 / parameters.rate, parameters.duration or 0.0
    )
    everything = {**flatten(parameters), **(flatten(rig) if rig else {})}
    written = bag_output.outputs(arguments, everything.values())
    if arguments.with_configs:
        written.add(_configs(arguments.output))
    if _has_readings(arguments) and not arguments.output.parent.is_file():  # one line is enough
        written.add(_truth(arguments.output))
    with written:
        result = _generated(arguments, (parameters, rig), names, written)
    result["wall_s"] = time.perf_counter() - started
    _report(result, arguments)


def _generated(
    arguments: argparse.Namespace,
    what: camera_output.Parameters,
    names: dict[str, str],
    written: Outputs,
) -> dict[str, Any]:
    """Write all outputs; returns the result but the time that it took."""
    parameters, rig = what
    simulation = Simulation(parameters, pose_reader=shared.PoseReader(arguments, "generate"))
    if simulation.total is None:
        raise ConfigurationError(
            "duration = 0: this trajectory has no end; say how long, for instance --duration 20s"
        )
    for warning in simulation.warnings():
        print(f"generate: warning: {warning}", file=sys.stderr)
    if not (arguments.quiet or arguments.json):
        print("\n".join(simulation.notes()), end="\n" if simulation.notes() else "")
    output = written.where(arguments.output)
    cameras = camera_output.rig(rig, simulation)
    with _target(arguments, output, parameters, names, cameras) as target:
        written.describe(arguments.output, target.described)
        _write(simulation, target, arguments)
    if _has_readings(arguments):
        _write_truth(written.where(_truth(arguments.output)), arguments.output.name, parameters)
    if arguments.with_configs:
        folder = written.where(_configs(arguments.output))
        _write_configs(folder, simulation, names)
        camera_output.write_parameters(folder, arguments.output.name, parameters, rig)
    return {
        "output": str(arguments.output),
        "messages": target.counts,
        "samples": simulation.position,
        "wall_s": 0.0,
        "bytes": sum(file.stat().st_size for file in target.files if file.is_file()),
    }


@contextmanager
def _target(
    arguments: argparse.Namespace,
    output: Path,
    parameters: SimulationParameters,
    names: dict[str, str],
    cameras: Any,
) -> Iterator[Any]:
    """Open the output; it is whole when the block ends without an error."""
    form = bag_output.form(arguments)
    camera_output.check_form(form, output, cameras)
    if form is None:
        with open_writer(
            output,
            arguments.storage,
            arguments.compression,
            arguments.split_duration,
            arguments.split_size,
        ) as writer:
            bag = BagTarget(writer, parameters, names)
            yield bag
        return
    unfit = [
        f"topic {name}: is not for {form}" for name in names if name not in (IMU_TOPIC, TRUTH_TOPIC)
    ]
    if unfit:
        raise InputError(unfit)
    if form in camera_output.CAMERA_FORMATS:
        with camera_output.opened(form, output, cameras, names) as seen:
            yield seen
        return
    with text_writer.Dataset(output, form, TRUTH_TOPIC in names) as dataset:
        target = DatasetTarget(dataset)
        if cameras is None:
            yield target
        else:
            comment = f"simulated by imu_sim_ros, seed {parameters.seed}"
            with camera_output.images(form, output, cameras, arguments, comment) as seen:
                target = camera_output.CameraTarget(dataset, seen)
                yield target
        if form == "euroc":
            _describe(output, parameters, TRUTH_TOPIC in names)
    target.files = dataset.files


def _write(
    simulation: Simulation, target: BagTarget | DatasetTarget, arguments: argparse.Namespace
) -> None:
    """Write all samples."""
    quiet = arguments.quiet or arguments.json
    with common.progress(f"writing {arguments.output}", simulation.total or 0, quiet) as advance:
        # The samples are made in a thread of their own while the messages are written.
        blocks = ahead(
            simulation.blocks(min(BLOCK_SIZE, getattr(target, "block_size", BLOCK_SIZE)))
        )
        try:
            for block in blocks:
                target.write(block)
                advance(len(block.t_ns))
        finally:
            blocks.close()  # type: ignore[attr-defined]


def _describe(output: Path, parameters: SimulationParameters, states: bool) -> None:
    """Write the sensor.yaml files of a EuRoC folder."""
    values = _values(parameters, "/imu0")
    imu = parameters.imu
    text_writer.write_euroc_descriptions(
        output,
        parameters.rate,
        values.densities(),
        np.reshape(imu.mounting, (3, 3)),
        np.asarray(imu.lever_arm),
        f"simulated by imu_sim_ros, preset {imu.preset}, seed {parameters.seed}",
        states,
    )


def _values(parameters: SimulationParameters, topic: str, duration: float = 0.0) -> ImuValues:
    return ImuValues(
        realised_imu(parameters),
        parameters.rate,
        float(np.linalg.norm(parameters.gravity)),
        topic,
        duration,
    )


def _configs(output: Path) -> Path:
    """Return the folder of the configurations that belong to an output."""
    return output.with_name(output.name + "_configs")


def _has_readings(arguments: argparse.Namespace) -> bool:
    return bag_output.form(arguments) not in ("tum", "vio_data_simulation")


def _truth(output: Path) -> Path:
    """Return the file of the realised truth that belongs to an output: NAME_truth.yaml."""
    known = output.suffix.lower() in (".bag", ".mcap", ".csv")
    return output.with_name(f"{output.stem if known else output.name}_truth.yaml")


def _write_truth(path: Path, name: str, parameters: SimulationParameters) -> None:
    """Write the sensor of this run: every constant that its seed drew, in its parameter's place.

    ``calibrate --truth`` and ``allan --truth`` take it, and ``--imu`` for the same unit again.
    """
    imu = dataclasses.replace(realised_imu(parameters), preset="perfect")
    files.write(
        {"rate": parameters.rate, **{f"imu.{k}": v for k, v in flatten(imu).items()}},
        path,
        comment=f"The sensor that made {name}: preset {parameters.imu.preset}, with the turn-on "
        f"biases and scales\nthat seed {parameters.seed} drew in the places of the parameters. "
        "For calibrate --truth and allan --truth;\ngenerate --imu takes it for the same unit.",
    )


def _write_configs(folder: Path, simulation: Simulation, names: dict[str, str]) -> None:
    parameters = simulation.parameters
    topic = resolved(names.get(IMU_TOPIC, IMU_TOPIC))
    duration = simulation.position / parameters.rate
    write_all(folder, _values(parameters, topic, duration))


def _report(result: dict[str, Any], arguments: argparse.Namespace) -> None:
    if arguments.json:
        common.print_json(result)
    elif not arguments.quiet:
        counts = ", ".join(f"{count:,} {name}" for name, count in result["messages"].items())
        speed = sum(result["messages"].values()) / result["wall_s"] / 1e3
        print(
            f"{result['output']}: {counts}; {result['bytes'] / 1e6:,.1f} MB in "
            f"{result['wall_s']:.2f} s ({speed:,.0f} k messages/s)"
        )


if __name__ == "__main__":
    sys.exit(main())
