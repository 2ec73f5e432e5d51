# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``add_errors``: another simulator's ideal readings in, those of a chosen sensor out."""

import argparse
import shutil
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from imu_sim_ros import program
from imu_sim_ros.bags.outputs import Outputs
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.bags.write import open_writer
from imu_sim_ros.bags.writer import described
from imu_sim_ros.commands import bag_output
from imu_sim_ros.commands.inputs import add_skip_bad_rows, refused_messages, skipped_rows
from imu_sim_ros.conventions import IMU_TOPIC
from imu_sim_ros.errors import InputError
from imu_sim_ros.jobs.add_errors import ROWS_AT_ONCE, rate_of
from imu_sim_ros.jobs.add_errors_bag import OFFERED, USUAL, BagErrors, names_in, rate_in, source_of
from imu_sim_ros.jobs.convert import ConversionWatcher, ConvertOptions, write
from imu_sim_ros.jobs.output import Form
from imu_sim_ros.names import unknown
from imu_sim_ros.parameters import files
from imu_sim_ros.simulation.error_input import Given
from imu_sim_ros.simulation.error_model import Counts, ErrorModel
from imu_sim_ros.simulation.error_parameters import (
    NODE,
    ErrorModelParameters,
    load_error_model,
    orientation_problems,
)
from imu_sim_ros.simulation.topics import delivered

EXAMPLES: Final = """
  add_errors ideal.mcap -o noisy.mcap --imu bmi088 --seed 3
  add_errors gazebo.bag -o noisy.bag --imu model.sdf --input-topic /imu
  add_errors airsim.mcap -o noisy.mcap --imu mpu6000 --set input.axes=frd
  add_errors MH_99 -o MH_99_noisy --format euroc --imu adis16448
"""


def parser() -> program.Parser:
    """Return the command's arguments."""
    result = program.Parser(prog="add_errors", description=__doc__, examples=EXAMPLES)
    result.add_argument(
        "input", type=Path, help="ROS 1 bag, .mcap, rosbag2 folder, EuRoC folder or CSV file"
    )
    bag_output.add_arguments(result, ("euroc", "csv"))
    group = result.add_argument_group("sensor")
    group.add_argument(
        "--imu",
        metavar="NAME|FILE",
        help=f"the sensor: {', '.join(files.names('imus'))}, or a file; model.sdf, too",
    )
    group.add_argument(
        "--rate", metavar="HZ", type=float, help="readings per second (those of the input)"
    )
    group.add_argument("--seed", metavar="N", type=int, help="seed of all random streams")
    group = result.add_argument_group("topics")
    group.add_argument(
        "--input-topic",
        metavar="NAME",
        help="the ideal readings (the only sensor_msgs/Imu), or odometry",
    )
    group.add_argument(
        "--topics",
        metavar="NAME,...",
        default="",
        help=f"what is added ({','.join(USUAL)}), of {', '.join(OFFERED)}",
    )
    group.add_argument(
        "--without", metavar="NAME,...", default="", help="topics of the input that are left out"
    )
    add_skip_bad_rows(result)
    program.add_parameter_arguments(result)
    program.add_output_arguments(result)
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return program.main(parser, add_errors, argv)


def add_errors(arguments: argparse.Namespace) -> None:
    """Write what the arguments ask for."""
    started = time.perf_counter()
    form = bag_output.form(arguments)
    if form == "tum":
        raise InputError(f"{arguments.output}: tum has no readings")
    wanted = _wanted(arguments)
    layers = _layers(arguments)
    load_error_model({"rate": 200.0, **layers} if "rate" not in layers else layers)
    written = bag_output.bag_outputs(arguments, layers.values())
    staged = written.where(arguments.output)
    from_text = text_reader.is_text(arguments.input)
    with written, tempfile.TemporaryDirectory(dir=staged.parent) as folder:
        between = Path(folder) / "between.mcap"
        if from_text and form is not None:
            counts, messages = _text_to_text(arguments, form, staged, layers)
        else:
            source = arguments.input
            if from_text:
                _convert(arguments, source, between)
                source = between
            place = Path(folder) / "noisy.mcap" if form is not None else staged
            run = _Run(arguments, layers, wanted, place, dataset=form is not None)
            counts, messages = run.bag(source, written)
            if form is not None:
                _convert(arguments, place, staged, form)
    result = {
        "output": str(arguments.output),
        "messages": messages,
        **vars(counts),
        "wall_s": time.perf_counter() - started,
    }
    _report(result, arguments)


def _wanted(arguments: argparse.Namespace) -> list[str]:
    """Return the topics that are added.

    :raises InputError: with a line for each name that is none of them.
    """
    names = [name.strip().lstrip("/") for name in arguments.topics.split(",") if name.strip()]
    problems = [unknown("topic", name, OFFERED) for name in names if name not in OFFERED]
    if problems:
        raise InputError(problems)
    return list(dict.fromkeys(names)) or list(USUAL)


def _layers(arguments: argparse.Namespace) -> dict[str, object]:
    """Return the parameters that files and arguments give."""
    *of_files, own = program.parameter_layers(arguments, NODE)
    result: dict[str, object] = {}
    for layer in of_files:
        result |= layer
    if arguments.imu is not None:
        result["imu.preset"] = arguments.imu
    for name in ("rate", "seed"):
        if getattr(arguments, name) is not None:
            result[name] = getattr(arguments, name)
    return {**result, **own}


def _convert(
    arguments: argparse.Namespace, source: Path, target: Path, dataset: str | None = None
) -> None:
    """Convert text or bag into the other, as ``convert_bag`` does."""
    skipped, warned = refused_messages(arguments, "add_errors", source)
    watcher = ConversionWatcher(_remark, skipped=skipped, warned=warned)
    write(source, target, Form(dataset), ConvertOptions(), Outputs([source]), watcher)


def _remark(line: str) -> None:
    print(f"add_errors: warning: {line}", file=sys.stderr)


class _Run:
    """One bag with errors."""

    def __init__(
        self,
        arguments: argparse.Namespace,
        layers: Mapping[str, object],
        wanted: Sequence[str],
        place: Path,
        dataset: bool,
    ) -> None:
        """Take what is asked for.

        :param dataset: the bag only becomes a dataset, which has room for one IMU.
        """
        self._arguments, self._layers, self._place = arguments, layers, place
        self._wanted = USUAL if dataset else wanted
        self._dataset = dataset

    def bag(self, path: Path, written: Outputs) -> tuple[Counts, dict[str, int]]:
        """Write the bag; return what happened, and the messages by topic."""
        arguments = self._arguments
        with open_bag(path) as bag:
            source = source_of(bag, arguments.input_topic if path == arguments.input else None)
            layers = dict(self._layers)
            if "rate" not in layers and not layers.get("input.rate"):
                layers["rate"] = rate_in(bag, source)
            parameters: ErrorModelParameters = load_error_model(layers)
            if "imu/data" in self._wanted:
                problems = list(orientation_problems(parameters.imu))
                if problems:
                    raise InputError(problems)
            left_out = {"/" + n.strip().lstrip("/") for n in arguments.without.split(",") if n}
            have = {"/" + topic.name.lstrip("/") for topic in bag.topics}
            if path != arguments.input:  # a dataset's biases are those of the readings before
                left_out |= {"/" + name for name in self._wanted} & have - {source.name}
            if left_out - have:
                raise InputError(
                    [unknown("topic", name, sorted(have)) for name in sorted(left_out - have)]
                )
            copied = [t for t in bag.topics if "/" + t.name.lstrip("/") not in left_out]
            if self._dataset:
                copied = [topic for topic in copied if topic.type != source.type]
            names, renamed = names_in(bag, source, copied, self._wanted, dict(arguments.topic))
            errors = BagErrors(bag, source, parameters, names, _remark)
            total = sum(topic.count for topic in {*copied, source})
            skipped, warned = refused_messages(arguments, "add_errors", arguments.input)
            quiet = arguments.quiet or arguments.json
            with (
                self._writer() as writer,
                program.progress(f"writing {arguments.output}", total, quiet) as advance,
            ):
                if not self._dataset:
                    written.describe(arguments.output, lambda: described(writer.topics))
                errors.write(writer, copied, renamed, advance, skipped, warned or _say_nothing)
            return errors.model.counts, {topic.name: topic.count for topic in writer.topics}

    def _writer(self) -> Any:
        arguments = self._arguments
        if self._dataset:
            return open_writer(self._place)
        return open_writer(
            self._place,
            arguments.storage,
            arguments.compression,
            arguments.split_duration,
            arguments.split_size,
        )


def _say_nothing(_: object) -> None:
    """Say nothing: what is left out of the errors is said once."""


def _text_to_text(
    arguments: argparse.Namespace, form: str, staged: Path, layers: Mapping[str, object]
) -> tuple[Counts, dict[str, int]]:
    """Convert a dataset with all that it has, and replace the readings."""
    _convert(arguments, arguments.input, staged, form)
    skipped = skipped_rows(arguments, "add_errors", arguments.input)
    blocks = text_reader.imu_blocks(arguments.input, None, skipped and (lambda _: None))
    model: ErrorModel | None = None
    parameters: dict[str, object] = dict(layers)
    with tempfile.TemporaryDirectory(dir=staged.parent) as folder:
        place = Path(folder) / ("noisy.csv" if staged.is_file() else "noisy")
        with Dataset(place, form) as dataset:
            for t_ns, gyro, accel in blocks:
                if model is None:
                    if "rate" not in parameters and not parameters.get("input.rate"):
                        parameters["rate"] = rate_of(t_ns)
                    model = ErrorModel(load_error_model(parameters), remark=_remark)
                for begin in range(0, len(t_ns), ROWS_AT_ONCE):
                    rows = slice(begin, begin + ROWS_AT_ONCE)
                    for samples in model.read(Given(t_ns[rows], gyro[rows].T, accel[rows].T)):
                        dataset.write_imu(*delivered(samples))
        if model is None:
            raise InputError(f"{arguments.input}: contains no readings")
        if staged.is_file():
            shutil.move(place, staged)
        else:
            shutil.move(place / "imu0" / "data.csv", staged / "imu0" / "data.csv")
    return model.counts, {"/" + IMU_TOPIC: dataset.imu.rows if dataset.imu else 0}


def _report(result: dict[str, Any], arguments: argparse.Namespace) -> None:
    if arguments.json:
        program.print_json(result)
        return
    if arguments.quiet:
        return
    counts = ", ".join(f"{count:,} {name}" for name, count in result["messages"].items())
    notes = "".join(
        f", {result[name]:,} {name}"
        for name in ("missing", "pauses", "restarts", "repeated", "backward")
        if result[name]
    )
    speed = result["readings"] / result["wall_s"]
    shown = f"{speed / 1e3:,.0f} k" if speed >= 1e4 else f"{speed:,.0f}"
    print(f"{result['output']}: {counts}{notes}; {result['wall_s']:.2f} s ({shown} readings/s)")


if __name__ == "__main__":
    sys.exit(main())
