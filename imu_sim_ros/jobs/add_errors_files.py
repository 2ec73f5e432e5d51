# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ideal readings of a bag or dataset with a sensor's errors, in any form."""

from __future__ import annotations

import shutil
import tempfile
import time
import warnings
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Final

from imu_sim_ros.bags import convert as streams
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import ODOMETRY
from imu_sim_ros.bags.outputs import Outputs, Target
from imu_sim_ros.bags.read import Bag, TopicInfo, open_bag
from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.bags.writer import BagOptions, topics_summary
from imu_sim_ros.core import arguments
from imu_sim_ros.core.conventions import IMU_TOPIC, TWIST_FRAMES
from imu_sim_ros.core.errors import ConfigurationError, InputError, Problems, name_source
from imu_sim_ros.core.names import unknown_name_line
from imu_sim_ros.core.records import Readings, replace_fields
from imu_sim_ros.core.types import JsonObject
from imu_sim_ros.formats.choice import Choice
from imu_sim_ros.formats.door import has_topics, reading_blocks
from imu_sim_ros.formats.handling import Handling
from imu_sim_ros.jobs import convert
from imu_sim_ros.jobs.add_errors import (
    ROWS_AT_ONCE,
    load_with_rate,
    parameter_layers,
    rounded_rate,
    tell_strays,
)
from imu_sim_ros.jobs.add_errors_bag import (
    USUAL,
    BagErrors,
    names_in,
    source_topic,
    topic_rate,
    twist_warnings,
)
from imu_sim_ros.jobs.selection import (
    AccelTopic,
    AccelUnit,
    Frame,
    GyroTopic,
    GyroUnit,
    check_choice,
    input_lines,
)
from imu_sim_ros.jobs.writing import (
    Compression,
    DiscardPartial,
    Force,
    Form,
    Format,
    Journal,
    Output,
    ParameterFiles,
    Parameters,
    Rename,
    SkipBadRows,
    SplitDuration,
    SplitSize,
    Storage,
    counts_text,
    form_of_output,
    outputs,
    parameter_files,
    time_and_speed,
)
from imu_sim_ros.recordings.clock import repeated_value_rows
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.simulation.error_model import GivenImu
from imu_sim_ros.simulation.error_parameters import layer_error_model, orientation_problems
from imu_sim_ros.simulation.given_sensor import Counts
from imu_sim_ros.simulation.topics import OF_THE_ERROR_MODEL, delivered_readings, resolve_topic
from imu_sim_ros.terminal.progress import progress
from imu_sim_ros.terminal.signatures import Heading, Text

FORMATS = ("euroc", "csv")
"""Datasets that have readings."""
_SENSOR: Final = Heading("sensor")
_TOPICS: Final = Heading("topics")
_ADDED: Final = Text(
    f"topics to add (default: {','.join(USUAL)}); all: {', '.join(OF_THE_ERROR_MODEL)}"
)


@dataclass(frozen=True)
class ErrorsAdded:
    """Result of :func:`add_errors_to_file`."""

    output: Path
    messages: dict[str, int]
    """Messages or rows by topic."""
    counts: Counts
    """Counts of irregular readings: missing, pauses, restarts, ..."""
    wall_s: float
    warnings: tuple[str, ...] = ()
    """Likely mistakes in the input, one line each."""
    notes: tuple[str, ...] = ()
    """Choices and conversions of reading, a line each."""

    def to_dict(self) -> JsonObject:
        """Return the content of ``--json``."""
        return {
            "output": str(self.output),
            "messages": self.messages,
            **vars(self.counts),
            "wall_s": self.wall_s,
            "notes": list(self.notes),
        }

    def lines(self) -> Iterator[str]:
        """Yield the lines of the report that ``add_errors`` prints."""
        yield from input_lines(self.notes)
        tally = vars(self.counts)
        kinds = ("missing", "pauses", "restarts", "repeated", "backward")
        notes = "".join(f", {tally[kind]:,} {kind}" for kind in kinds if tally[kind])
        speed = time_and_speed(tally["readings"], self.wall_s, "readings")
        yield f"{self.output}: {counts_text(self.messages)}{notes}; {speed}"

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {name}" for name, count in self.messages.items())
        return f"<ErrorsAdded {self.output.name}: {counts or 'no messages'}>"


def add_errors_to_file(
    source: Annotated[str | Path, "INPUT"],
    output: Output,
    *,
    imu: Annotated[str | Path | Mapping[str, object] | None, "NAME|FILE", _SENSOR] = None,
    rate: Annotated[float | None, "HZ", _SENSOR] = None,
    seed: Annotated[int | None, "N", _SENSOR] = None,
    params_file: ParameterFiles = None,
    input: Mapping[str, object] | None = None,
    input_topic: Annotated[str | None, "NAME", _TOPICS] = None,
    twist_frame: Annotated[str | None, TWIST_FRAMES, _TOPICS] = None,
    topics: Annotated[str | Sequence[str], "NAME,...", _ADDED, _TOPICS] = (),
    without: Annotated[str | Sequence[str], "NAME,...", _TOPICS] = (),
    format: Annotated[Format, FORMATS] = None,
    storage: Storage = None,
    compression: Compression = None,
    split_duration: SplitDuration = 0.0,
    split_size: SplitSize = 0,
    rename: Rename = None,
    frame: Frame = None,
    gyro_topic: GyroTopic = None,
    accel_topic: AccelTopic = None,
    gyro_unit: GyroUnit = None,
    accel_unit: AccelUnit = None,
    skip_bad_rows: SkipBadRows = False,
    force: Force = False,
    discard_partial: DiscardPartial = False,
    **parameters: Parameters,
) -> ErrorsAdded:
    """Add a sensor's errors to the ideal readings of a file, as the program ``add_errors`` does.

    Every other message of a bag stays as it is, byte for byte; ideal readings in other units, of
    several frames or of two topics are copied as they are chosen.

    :param source: ROS 1 bag, .mcap, rosbag2 folder, EuRoC folder or CSV file
    :param imu: sensor: a preset (see generate --list-imus), a parameter file, or a Gazebo model
        (model.sdf)
    :param rate: sampling rate (default: that of the input)
    :param seed: seed of all random streams
    :param input_topic: topic of the ideal readings, or of odometry (default: the only
        sensor_msgs/Imu topic)
    :param twist_frame: axes of the velocities of odometry (default: body)
    :param topics: topics to add; by default ``imu/data_raw`` and the true biases
    :param without: topics of the input to leave out
    :param frame: frame of the ideal readings, if a topic carries several IMUs
    :param gyro_topic: topic of the ideal gyroscope, if the accelerometer has another one
    :param accel_topic: topic of the accelerometer, interpolated to the gyroscope's times
    :param gyro_unit: unit of the gyroscope in the input: rad/s, deg/s; the output has rad/s
    :param accel_unit: unit of the accelerometer in the input: m/s^2, g, mg; the output has m/s^2
    :param skip_bad_rows: leave out readings that are not finite or not possible

    The other arguments that concern the output are those of :func:`generate`, all others those
    of :func:`add_errors`.

    :returns: what was written: path, messages of each topic, what happened to the readings.
    :raises ConfigurationError: with a line for each problem with an argument or a parameter.
    :raises InputError: for a source that cannot be read, and an output that cannot be written.

    >>> import imu_sim_ros as ims
    >>> ideal = ims.generate(folder / "ideal.mcap", imu="perfect", duration=2, imu_only=True)
    >>> ims.add_errors_to_file(ideal.output, folder / "n.bag", imu="bmi088", topics="imu/data_raw")
    <ErrorsAdded n.bag: 400 /imu/data_raw, 400 /ground_truth/imu>
    """
    source_path = arguments.path("source", source)
    options = BagOptions(storage, compression, split_duration, split_size)
    path, form = form_of_output(FORMATS, output, format, options, topics, rename)
    dataset = form.dataset
    if dataset not in (None, *FORMATS):
        raise InputError(f"{path}: {dataset} has no readings")
    topic = None if input_topic is None else arguments.text("input_topic", input_topic, "a topic")
    selection = frame, gyro_topic, accel_topic, gyro_unit, accel_unit
    choice = check_choice(topic, *selection, of_a_file=True, topic_name="input_topic")
    problems, layers = Problems(), dict[str, object]()
    with problems.collect():
        layers |= parameter_layers(imu, seed, params_file, input, parameters, rate)
        if twist_frame is not None:
            layers["input.twist_frame"] = arguments.choice("twist_frame", twist_frame, TWIST_FRAMES)
    if not problems:  # a preset that cannot be read hides nothing that is wrong with the source
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            layer_error_model(layers, problems)
    if problems:
        _add_source_problems(source_path, choice, problems)
    problems.tell()
    input_files = [source_path, *parameter_files(params_file), *layers.values()]
    staging = outputs(force, discard_partial, input_files)
    journal = Journal(source_path, arguments.boolean("skip_bad_rows", skip_bad_rows))
    left_out = {
        resolve_topic(name.strip()) for name in arguments.string_list("without", without) if name
    }
    started = time.perf_counter()
    added = _topics_to_add(form)
    target = staging.add(path, keep_partial=True)
    ideal = _Ideal(source_path, choice, journal)
    is_text = not has_topics(source_path)
    task = _Task(ideal, is_text, topic, layers, added, left_out, form, target)
    with staging.stage(), tempfile.TemporaryDirectory(dir=target.path.parent) as temporary:
        tally, messages, notes = _write_with_errors(task, Path(temporary))
    wall_s = time.perf_counter() - started
    return ErrorsAdded(path, messages, tally, wall_s, tuple(journal.lines), tuple(notes))


def _topics_to_add(form: Form) -> list[str]:
    """Return the relative names of the topics that the error model writes.

    :raises InputError: with a line for each name that is no topic of the error model.
    """
    names = [name.strip().lstrip("/") for name in form.topics if name.strip()]
    unknown = [name for name in names if name not in OF_THE_ERROR_MODEL]
    if unknown:
        raise InputError([unknown_name_line("topic", name, OF_THE_ERROR_MODEL) for name in unknown])
    return list(USUAL) if form.dataset else list(dict.fromkeys(names)) or list(USUAL)


@dataclass(frozen=True)
class _Task:
    """Input, error model and output of one call of :func:`add_errors_to_file`."""

    ideal: _Ideal
    is_text: bool
    """True for a source that is a table or a folder, not a bag or log."""
    topic: str | None
    """Topic of the ideal readings in the source; None: the only one."""
    layers: dict[str, object]
    """Parameters of the error model by dotted name; the rate may still be that of the input."""
    added: Sequence[str]
    """Relative names of the topics that the error model writes."""
    left_out: Collection[str]
    """Absolute names of the topics of the source that are not copied."""
    form: Form
    target: Target


def _write_with_errors(task: _Task, folder: Path) -> tuple[Counts, dict[str, int], list[str]]:
    """Write the output of a task, by way of bags where the source or the output is none.

    :param folder: empty folder for the files in between.
    :returns: what happened to the readings, the messages by topic, and notes of reading.
    """
    source, form, target, is_text = task.ideal, task.form, task.target, task.is_text
    if is_text:
        load_with_rate(task.layers, source.rate)  # refused before work begins
    if is_text and form.dataset:
        return _dataset_to_dataset(source, target, folder, form.dataset, task.layers)
    ideal_bag, topic, notes = source.path, task.topic, list[str]()
    if is_text or not source.choice.is_plain:
        ideal_bag = folder / "between.mcap"
        notes = source.convert(ideal_bag, Form())
        topic = streams.READINGS if source.choice.merges else None if is_text else topic
    noisy_bag = folder / "noisy.mcap" if form.dataset else target.path
    tally, messages = _write_noisy_bag(task, ideal_bag, topic, noisy_bag)
    if form.dataset:
        output, staging = Form(form.dataset), Outputs([noisy_bag])
        convert.write(noisy_bag, target.path, output, staging, source.journal, shown=False)
    return tally, messages, notes


def _write_noisy_bag(
    task: _Task, ideal_bag: Path, topic: str | None, noisy_bag: Path
) -> tuple[Counts, dict[str, int]]:
    """Copy a bag, and add the topics of the error model.

    :param ideal_bag: the source, or a bag with its content.
    :param topic: topic of the ideal readings in this bag; None: the only one.
    :returns: what happened to the readings, and the messages by topic.
    """
    source_path, journal, form = task.ideal.path, task.ideal.journal, task.form
    is_source = ideal_bag == source_path
    with open_bag(ideal_bag) as bag:
        bag.path = source_path  # for messages
        readings = source_topic(bag, topic)
        parameters = load_with_rate(task.layers, lambda: topic_rate(bag, readings))
        if "imu/data" in task.added and (problems := list(orientation_problems(parameters.imu))):
            raise InputError(problems)
        if readings.type == ODOMETRY:
            if not task.ideal.choice.is_plain:
                raise InputError(
                    f"{source_path}: frame, topics and units are those of readings; "
                    f"{readings.name} is odometry"
                )
            for line in twist_warnings(bag, readings, parameters.input.twist_frame):
                journal.warn(line)
        left_out = set(task.left_out)
        if task.is_text:  # a dataset's biases are those of the readings before
            present = {resolve_topic(info.name) for info in bag.topics}
            left_out |= {resolve_topic(name) for name in task.added} & present - {readings.name}
        copied = _topics_to_copy(bag, left_out)
        if form.dataset:
            copied = [info for info in copied if info.type != readings.type]
        topic_names, renamed = names_in(bag, readings, copied, task.added, dict(form.renamed))
        errors = BagErrors(bag, readings, parameters, topic_names, journal.warn)
        message_count = sum(info.count for info in {*copied, readings})
        with (
            open_writer(noisy_bag, form.bag) as writer,
            progress(f"writing {task.target.final}", lambda: message_count) as advance,
        ):
            if not form.dataset:
                task.target.summary = lambda: topics_summary(writer.topics)
            # The conversion to a bag in between has reported bad messages already.
            warned = (journal.passed_on if is_source else None) or _ignore_count
            errors.write(writer, copied, renamed, advance, journal.skipped, warned)
        return errors.model.counts, {info.name: info.count for info in writer.topics}


def _add_source_problems(path: Path, choice: Choice, problems: Problems) -> None:
    """Add the problem of a source that cannot be read to those of the arguments."""
    with problems.collect(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if has_topics(path):
            with open_bag(path):
                pass
        else:
            next(reading_blocks(path, choice), None)


def _topics_to_copy(bag: Bag, left_out: Collection[str]) -> list[TopicInfo]:
    """Return the topics of a bag without those that are left out, by their absolute names.

    :raises InputError: with a line for each topic to leave out that the bag does not have.
    """
    present = {resolve_topic(info.name) for info in bag.topics}
    absent = sorted(set(left_out) - present)
    if absent:
        raise InputError([unknown_name_line("topic", name, sorted(present)) for name in absent])
    return [info for info in bag.topics if resolve_topic(info.name) not in left_out]


@dataclass(frozen=True)
class _Ideal:
    """Ideal readings of a file."""

    path: Path
    choice: Choice
    journal: Journal

    def convert(self, path: Path, form: Form) -> list[str]:
        """Write the file's content with the chosen readings; return the notes about them."""
        outputs, journal = Outputs([self.path]), self.journal
        arguments = (self.path, path, form, outputs, journal)
        return list(convert.write(*arguments, shown=False, choice=self.choice).notes)

    def blocks(self) -> Iterator[Readings]:
        """Yield the readings in blocks; bad rows are counted elsewhere."""
        skipped = self.journal.skipped and _ignore_count
        return reading_blocks(self.path, self.choice, Handling(skipped))

    def rate(self) -> float:
        """Return the readings per second [Hz]."""
        for readings in self.blocks():
            with name_source(self.path, ConfigurationError):
                return rounded_rate(
                    readings.t_ns, repeated_value_rows(readings.gyro, readings.accel)
                )
        raise InputError(f"{self.path}: contains no readings")


def _dataset_to_dataset(
    source: _Ideal,
    target: Target,
    folder: Path,
    form: str,
    layers: Mapping[str, object],
) -> tuple[Counts, dict[str, int], list[str]]:
    """Convert a dataset with all that it has, and replace the readings.

    :param folder: empty folder for the files in between.
    :returns: what happened to the readings, the rows by topic, and notes of reading.
    """
    staged = target.path
    notes = source.convert(staged, Form(form))
    model: GivenImu | None = None
    noisy = folder / ("noisy.csv" if staged.is_file() else "noisy")
    with Dataset(noisy, form) as dataset:
        for readings in source.blocks():
            readings.triads()  # both are needed
            readings = replace_fields(readings, q_wb=None)
            strays = tell_strays(
                readings.t_ns, model is None, str(source.path), source.journal.warn
            )
            if strays.any():
                readings = readings.rows(~strays)
            if model is None:
                unchanged = repeated_value_rows(readings.gyro, readings.accel)
                rate = partial(rounded_rate, readings.t_ns, unchanged)
                model = GivenImu(load_with_rate(layers, rate), remark=source.journal.warn)
            for begin in range(0, len(readings), ROWS_AT_ONCE):
                for samples in model.read(readings.rows(slice(begin, begin + ROWS_AT_ONCE))):
                    dataset.write_imu(*delivered_readings(samples[IMU]))
    if model is None:
        raise InputError(f"{source.path}: contains no readings")
    model.finish()
    if staged.is_file():
        shutil.move(noisy, staged)
    else:
        shutil.move(noisy / "imu0" / "data.csv", staged / "imu0" / "data.csv")
    count = dataset.imu.rows if dataset.imu else 0
    return model.counts, {resolve_topic(IMU_TOPIC): count}, notes


def _ignore_count(_: object) -> None:
    """Ignore a count that another part reports."""
