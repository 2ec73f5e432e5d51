# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ideal readings of a bag or dataset with a sensor's errors, in any form."""

from __future__ import annotations

import functools
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

from imu_sim_ros import arguments
from imu_sim_ros.bags.outputs import Outputs
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.bags.reader import Bag
from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.bags.writer import OfBag, Writer, described, open_writer
from imu_sim_ros.conventions import IMU_TOPIC
from imu_sim_ros.errors import InputError
from imu_sim_ros.jobs import convert
from imu_sim_ros.jobs.add_errors import ROWS_AT_ONCE, layers_of, rate_of, with_rate
from imu_sim_ros.jobs.add_errors_bag import USUAL, BagErrors, names_in, rate_in, source_of
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
    checked_form,
    counts,
    outputs,
    parameter_files,
    time_and_speed,
)
from imu_sim_ros.names import unknown
from imu_sim_ros.progress import progress
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.signatures import Heading, Text
from imu_sim_ros.simulation.error_input import GivenReadings
from imu_sim_ros.simulation.error_model import GivenImu
from imu_sim_ros.simulation.error_parameters import orientation_problems
from imu_sim_ros.simulation.given_sensor import Counts
from imu_sim_ros.simulation.topics import OF_THE_ERROR_MODEL, delivered, resolved

FORMATS = ("euroc", "csv")
"""Datasets that have readings."""
_SENSOR: Final = Heading("sensor")
_TOPICS: Final = Heading("topics")
_ADDED: Final = Text(
    f"topics to add (default: {','.join(USUAL)}); all: {', '.join(OF_THE_ERROR_MODEL)}"
)


@dataclass(frozen=True)
class ErrorsAdded:
    """What :func:`add_errors_to_file` wrote."""

    output: Path
    messages: dict[str, int]
    """Messages or rows by topic."""
    counts: Counts
    """Counts of irregular readings: missing, pauses, restarts, ..."""
    wall_s: float
    warnings: tuple[str, ...] = ()
    """What looks like a mistake in the input, a line each."""

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        return {
            "output": str(self.output),
            "messages": self.messages,
            **vars(self.counts),
            "wall_s": self.wall_s,
        }

    def lines(self) -> Iterator[str]:
        """Yield what ``add_errors`` prints."""
        found = vars(self.counts)
        kinds = ("missing", "pauses", "restarts", "repeated", "backward")
        notes = "".join(f", {found[kind]:,} {kind}" for kind in kinds if found[kind])
        speed = time_and_speed(found["readings"], self.wall_s, "readings")
        yield f"{self.output}: {counts(self.messages)}{notes}; {speed}"

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {name}" for name, count in self.messages.items())
        return f"<ErrorsAdded {self.output.name}: {counts or 'no messages'}>"


def add_errors_to_file(
    source: Annotated[str | Path, "INPUT"],
    output: Output,
    *,
    imu: Annotated[str | Path | Mapping[str, Any] | None, "NAME|FILE", _SENSOR] = None,
    rate: Annotated[float | None, "HZ", _SENSOR] = None,
    seed: Annotated[int | None, "N", _SENSOR] = None,
    params_file: ParameterFiles = None,
    input: Mapping[str, Any] | None = None,
    input_topic: Annotated[str | None, "NAME", _TOPICS] = None,
    topics: Annotated[str | Sequence[str], "NAME,...", _ADDED, _TOPICS] = (),
    without: Annotated[str | Sequence[str], "NAME,...", _TOPICS] = (),
    format: Annotated[Format, FORMATS] = None,
    storage: Storage = None,
    compression: Compression = None,
    split_duration: SplitDuration = 0.0,
    split_size: SplitSize = 0,
    rename: Rename = None,
    skip_bad_rows: SkipBadRows = False,
    force: Force = False,
    discard_partial: DiscardPartial = False,
    **parameters: Parameters,
) -> ErrorsAdded:
    """Add a sensor's errors to the ideal readings of a file, as the program ``add_errors`` does.

    Every other message of a bag stays as it is, byte for byte.

    :param source: ROS 1 bag, .mcap, rosbag2 folder, EuRoC folder or CSV file
    :param imu: sensor: a preset (see generate --list-imus), a parameter file, or a Gazebo model
        (model.sdf)
    :param rate: sampling rate (default: that of the input)
    :param seed: seed of all random streams
    :param input_topic: topic of the ideal readings, or of odometry (default: the only
        sensor_msgs/Imu topic)
    :param topics: topics to add; by default ``imu/data_raw`` and the true biases
    :param without: topics of the input to leave out
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
    path = arguments.path("source", source)
    bag = OfBag(storage, compression, split_duration, split_size)
    target, form = checked_form(FORMATS, output, format, bag, topics, rename)
    if form.dataset not in (None, *FORMATS):
        raise InputError(f"{target}: {form.dataset} has no readings")
    topic = None if input_topic is None else arguments.text("input_topic", input_topic, "a topic")
    layers = layers_of(imu, seed, params_file, input, parameters, rate)
    read = [path, *parameter_files(params_file), *layers.values()]
    written = outputs(force, discard_partial, read)
    journal = Journal(path, arguments.switch("skip_bad_rows", skip_bad_rows))
    left_out = arguments.words("without", without)
    started = time.perf_counter()
    names = [name.strip().lstrip("/") for name in form.topics if name.strip()]
    unfit = [name for name in names if name not in OF_THE_ERROR_MODEL]
    if unfit:
        raise InputError([unknown("topic", name, OF_THE_ERROR_MODEL) for name in unfit])
    added = USUAL if form.dataset else list(dict.fromkeys(names)) or USUAL
    job = _Job(path, target, form, topic, added, left_out, layers, written, journal)
    written.add(target, kept=True)
    with written.staged(), tempfile.TemporaryDirectory(dir=written.where(target).parent) as folder:
        found, messages = job.run(Path(folder))
    wall_s = time.perf_counter() - started
    return ErrorsAdded(target, messages, found, wall_s, tuple(journal.lines))


@dataclass(frozen=True)
class _Job:
    """One output that is written."""

    source: Path
    path: Path
    """Of the output."""
    form: Form
    """A dataset has room for one IMU."""
    input_topic: str | None
    """The ideal readings, or odometry; None: the only sensor_msgs/Imu."""
    added: Sequence[str]
    """Topics of the sensor, next to those of the input."""
    without: Sequence[str]
    """Topics of the input that are left out."""
    layers: Mapping[str, object]
    written: Outputs
    journal: Journal

    def _text_rate(self) -> float:
        """Return the readings per second of a dataset [Hz]."""
        for t_ns, _, _ in text_reader.imu_blocks(self.source, None, self._uncounted):
            return rate_of(t_ns)
        raise InputError(f"{self.source}: contains no readings")

    @property
    def _uncounted(self) -> Callable[[int], None] | None:
        """What receives skipped rows that are counted elsewhere; None: they are errors."""
        return self.journal.skipped and (lambda _: None)

    def run(self, folder: Path) -> tuple[Counts, dict[str, int]]:
        """Write the output; return what happened, and the messages by topic.

        :param folder: an empty one for what lies in between.
        """
        staged = self.written.where(self.path)
        if text_reader.is_text(self.source):
            with_rate(self.layers, self._text_rate)  # what is wrong with them, before work begins
            if self.form.dataset is not None:
                return self._text(staged, folder, self.form.dataset)
            between = folder / "between.mcap"
            self._convert(self.source, between)
            return self._bag(between, staged)
        if self.form.dataset is None:
            return self._bag(self.source, staged)
        noisy = folder / "noisy.mcap"
        found = self._bag(self.source, noisy)
        self._convert(noisy, staged)
        return found

    def _convert(self, source: Path, target: Path) -> None:
        """Convert text or bag into the other."""
        form = Form(None if target.suffix == ".mcap" else self.form.dataset)
        convert.write(source, target, form, Outputs([source]), self.journal, shown=False)

    def _bag(self, path: Path, target: Path) -> tuple[Counts, dict[str, int]]:
        with open_bag(path) as bag:
            source = source_of(bag, self.input_topic if path == self.source else None)
            parameters = with_rate(self.layers, lambda: rate_in(bag, source))
            if "imu/data" in self.added and (found := list(orientation_problems(parameters.imu))):
                raise InputError(found)
            left_out = self._left_out(bag, source.name)
            copied = [t for t in bag.topics if resolved(t.name) not in left_out]
            if self.form.dataset:
                copied = [topic for topic in copied if topic.type != source.type]
            given = dict(self.form.renamed)
            names, renamed = names_in(bag, source, copied, self.added, given)
            errors = BagErrors(bag, source, parameters, names, self.journal.warn)
            total = sum(topic.count for topic in {*copied, source})
            skipped, warned = self.journal.skipped, self.journal.passed_on or _say_nothing
            text = f"writing {self.path}"
            with self._writer(target) as writer, progress(text, lambda: total) as advance:
                errors.write(writer, copied, renamed, advance, skipped, warned)
            return errors.model.counts, {topic.name: topic.count for topic in writer.topics}

    def _left_out(self, bag: Bag, source: str) -> set[str]:
        """Return the names of topics that are not copied."""
        left_out = {resolved(name.strip()) for name in self.without if name}
        have = {resolved(topic.name) for topic in bag.topics}
        if bag.path != self.source:  # a dataset's biases are those of the readings before
            left_out |= {resolved(name) for name in self.added} & have - {source}
        if left_out - have:
            raise InputError(
                [unknown("topic", name, sorted(have)) for name in sorted(left_out - have)]
            )
        return left_out

    def _writer(self, target: Path) -> Writer:
        if self.form.dataset:
            return open_writer(target)
        writer = open_writer(target, *self.form.bag)
        self.written.describe(self.path, lambda: described(writer.topics))
        return writer

    def _text(self, staged: Path, folder: Path, form: str) -> tuple[Counts, dict[str, int]]:
        """Convert a dataset with all that it has, and replace the readings."""
        self._convert(self.source, staged)
        model: GivenImu | None = None
        target = folder / ("noisy.csv" if staged.is_file() else "noisy")
        with Dataset(target, form) as dataset:
            for t_ns, gyro, accel in text_reader.imu_blocks(self.source, None, self._uncounted):
                if model is None:
                    parameters = with_rate(self.layers, functools.partial(rate_of, t_ns))
                    model = GivenImu(parameters, remark=self.journal.warn)
                for begin in range(0, len(t_ns), ROWS_AT_ONCE):
                    rows = slice(begin, begin + ROWS_AT_ONCE)
                    for samples in model.read(GivenReadings(t_ns[rows], gyro[rows], accel[rows])):
                        dataset.write_imu(*delivered(samples[IMU]))
        if model is None:
            raise InputError(f"{self.source}: contains no readings")
        if staged.is_file():
            shutil.move(target, staged)
        else:
            shutil.move(target / "imu0" / "data.csv", staged / "imu0" / "data.csv")
        return model.counts, {resolved(IMU_TOPIC): dataset.imu.rows if dataset.imu else 0}


def _say_nothing(_: object) -> None:
    """Say nothing: what is left out of the errors is said once."""
