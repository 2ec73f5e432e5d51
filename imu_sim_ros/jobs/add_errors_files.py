# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ideal readings of a bag or dataset with a sensor's errors, in any form."""

from __future__ import annotations

import dataclasses
import functools
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from imu_sim_ros import arguments
from imu_sim_ros.bags.outputs import Outputs
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.bags.reader import Bag
from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.bags.write import check_writer, dataset_form, open_writer
from imu_sim_ros.bags.writer import Writer, described
from imu_sim_ros.conventions import IMU_TOPIC
from imu_sim_ros.errors import InputError
from imu_sim_ros.jobs import convert
from imu_sim_ros.jobs.add_errors import ROWS_AT_ONCE, layers_of, rate_of, with_rate
from imu_sim_ros.jobs.add_errors_bag import USUAL, BagErrors, names_in, rate_in, source_of
from imu_sim_ros.jobs.convert import ConversionWatcher, ConvertOptions
from imu_sim_ros.jobs.output import Form, checked_form, checked_place, is_file
from imu_sim_ros.names import unknown
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.simulation.error_input import GivenReadings
from imu_sim_ros.simulation.error_model import ErrorModel
from imu_sim_ros.simulation.error_parameters import orientation_problems
from imu_sim_ros.simulation.given_sensor import Counts
from imu_sim_ros.simulation.topics import OF_THE_ERROR_MODEL, delivered

FORMATS = ("euroc", "csv")
"""Datasets that have readings."""


@dataclass(frozen=True)
class ErrorOptions:
    """Which readings get errors, and what else of the input stays."""

    input_topic: str | None = None
    """The ideal readings, or odometry; None: the only sensor_msgs/Imu."""
    without: Sequence[str] = ()
    """Topics of the input that are left out."""


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

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {name}" for name, count in self.messages.items())
        return f"<ErrorsAdded {self.output.name}: {counts or 'no messages'}>"


def add_errors_to_file(
    source: str | Path,
    output: str | Path,
    *,
    imu: str | Path | Mapping[str, Any] | None = None,
    rate: float | None = None,
    seed: int | None = None,
    params_file: str | Path | None = None,
    input: Mapping[str, Any] | None = None,
    input_topic: str | None = None,
    topics: str | Sequence[str] = (),
    without: str | Sequence[str] = (),
    format: str | None = None,
    storage: str | None = None,
    compression: str | None = None,
    split_duration: float = 0.0,
    split_size: int = 0,
    rename: Mapping[str, str] | None = None,
    skip_bad_rows: bool = False,
    force: bool = False,
    **parameters: Any,
) -> ErrorsAdded:
    """Add a sensor's errors to the ideal readings of a file, as the program ``add_errors`` does.

    Every other message of a bag stays as it is, byte for byte.

    :param source: ROS 1 bag, ``.mcap``, rosbag2 folder, EuRoC folder or CSV file.
    :param input_topic: topic of the ideal readings, or of odometry; by default the only
        sensor_msgs/Imu.
    :param topics: topics to add; by default ``imu/data_raw`` and the true biases.
    :param without: topics of the source to leave out.
    :param format: a dataset in place of a bag: ``euroc``, ``csv``.
    :param skip_bad_rows: leave out readings that are not finite or not possible.

    The other arguments that concern the output (``output``, ``storage``, ``compression``,
    ``split_duration``, ``split_size``, ``rename``, ``force``) are those of :func:`generate`, all
    others those of :func:`add_errors`.

    :returns: what was written: path, messages of each topic, what happened to the readings.
    :raises ConfigurationError: with a line for each problem with an argument or a parameter.
    :raises InputError: for a source that cannot be read, and an output that cannot be written.

    >>> import imu_sim_ros as ims
    >>> ideal = ims.generate(folder / "ideal.mcap", imu="perfect", duration=2, imu_only=True)
    >>> ims.add_errors_to_file(ideal.output, folder / "n.bag", imu="bmi088", topics="imu/data_raw")
    <ErrorsAdded n.bag: 400 /imu/data_raw, 400 /ground_truth/imu>
    """
    path, place = arguments.path("source", source), checked_place(output, force)
    bag = (storage, compression, split_duration, split_size)
    form = checked_form(FORMATS, format, *bag, topics, rename)
    topic = None if input_topic is None else arguments.text("input_topic", input_topic, "a topic")
    options = ErrorOptions(topic, arguments.words("without", without))
    skip = arguments.switch("skip_bad_rows", skip_bad_rows)
    layers = layers_of(imu, seed, params_file, input, parameters, rate)
    watcher, lines = convert.collecting(path, skip)
    read = [path, *(word for word in layers.values() if is_file(word))]
    found = write(path, place, form, options, layers, Outputs(read, force), watcher)
    return dataclasses.replace(found, warnings=tuple(lines))


def write(
    source: Path,
    path: Path,
    form: Form,
    options: ErrorOptions,
    layers: Mapping[str, object],
    written: Outputs,
    watcher: ConversionWatcher,
) -> ErrorsAdded:
    """Write the readings of a source with errors.

    :param layers: parameters of the error model by name.
    :param written: receives the output.
    :raises ConfigurationError: with a line for each problem with a parameter.
    :raises InputError: for a source that cannot be read, and an output that cannot be written.
    """
    started = time.perf_counter()
    if not path.name:  # the files next to it are named after it
        raise InputError(f"{str(path)!r}: is not a file name")
    dataset = dataset_form(path, form.dataset, form.of_bags_only())
    if dataset is None:
        check_writer(path, form.storage, form.compression)
    elif dataset not in FORMATS:
        raise InputError(f"{path}: {dataset} has no readings")
    job = _Job(source, path, form, options, layers, dataset, written, watcher)
    written.add(path, kept=True)
    with written, tempfile.TemporaryDirectory(dir=written.where(path).parent) as folder:
        counts, messages = job.run(Path(folder))
    return ErrorsAdded(path, messages, counts, time.perf_counter() - started)


class _Job:
    """One output that is written."""

    def __init__(
        self,
        source: Path,
        path: Path,
        form: Form,
        options: ErrorOptions,
        layers: Mapping[str, object],
        dataset: str | None,
        written: Outputs,
        watcher: ConversionWatcher,
    ) -> None:
        """Take what is asked for.

        :param dataset: its form; a dataset has room for one IMU. None: a bag.
        :raises InputError: with a line for each topic that is none of the sensor's.
        """
        self.source, self.path, self.form, self.options = source, path, form, options
        self.layers, self.dataset = layers, dataset
        self.written, self.watcher = written, watcher
        names = [name.strip().lstrip("/") for name in form.topics if name.strip()]
        problems = [
            unknown("topic", name, OF_THE_ERROR_MODEL)
            for name in names
            if name not in OF_THE_ERROR_MODEL
        ]
        if problems:
            raise InputError(problems)
        self.added = USUAL if dataset else list(dict.fromkeys(names)) or USUAL

    def _text_rate(self) -> float:
        """Return the readings per second of a dataset [Hz]."""
        for t_ns, _, _ in text_reader.imu_blocks(self.source, None, self._uncounted):
            return rate_of(t_ns)
        raise InputError(f"{self.source}: contains no readings")

    @property
    def _uncounted(self) -> Callable[[int], None] | None:
        """What receives skipped rows that are counted elsewhere; None: they are errors."""
        return self.watcher.skipped and (lambda _: None)

    def run(self, folder: Path) -> tuple[Counts, dict[str, int]]:
        """Write the output; return what happened, and the messages by topic.

        :param folder: an empty one for what lies in between.
        """
        staged = self.written.where(self.path)
        if text_reader.is_text(self.source):
            with_rate(self.layers, self._text_rate)  # what is wrong with them, before work begins
            if self.dataset is not None:
                return self._text(staged, folder, self.dataset)
            between = folder / "between.mcap"
            self._convert(self.source, between)
            return self._bag(between, staged)
        if self.dataset is None:
            return self._bag(self.source, staged)
        noisy = folder / "noisy.mcap"
        found = self._bag(self.source, noisy)
        self._convert(noisy, staged)
        return found

    def _convert(self, source: Path, target: Path) -> None:
        """Convert text or bag into the other."""
        watcher = dataclasses.replace(self.watcher, progress=ConversionWatcher.progress)
        form = Form(None if target.suffix == ".mcap" else self.dataset)
        convert.write(source, target, form, ConvertOptions(), Outputs([source]), watcher)

    def _bag(self, path: Path, place: Path) -> tuple[Counts, dict[str, int]]:
        with open_bag(path) as bag:
            source = source_of(bag, self.options.input_topic if path == self.source else None)
            parameters = with_rate(self.layers, lambda: rate_in(bag, source))
            if "imu/data" in self.added and (found := list(orientation_problems(parameters.imu))):
                raise InputError(found)
            left_out = self._left_out(bag, source.name)
            copied = [t for t in bag.topics if "/" + t.name.lstrip("/") not in left_out]
            if self.dataset:
                copied = [topic for topic in copied if topic.type != source.type]
            given = dict(self.form.renamed)
            names, renamed = names_in(bag, source, copied, self.added, given)
            errors = BagErrors(bag, source, parameters, names, self.watcher.warn)
            total = sum(topic.count for topic in {*copied, source})
            skipped, warned = self.watcher.skipped, self.watcher.warned or _say_nothing
            with self._writer(place) as writer, self.watcher.progress(total) as advance:
                errors.write(writer, copied, renamed, advance, skipped, warned)
            return errors.model.counts, {topic.name: topic.count for topic in writer.topics}

    def _left_out(self, bag: Bag, source: str) -> set[str]:
        """Return the names of topics that are not copied."""
        left_out = {"/" + name.strip().lstrip("/") for name in self.options.without if name}
        have = {"/" + topic.name.lstrip("/") for topic in bag.topics}
        if bag.path != self.source:  # a dataset's biases are those of the readings before
            left_out |= {"/" + name for name in self.added} & have - {source}
        if left_out - have:
            raise InputError(
                [unknown("topic", name, sorted(have)) for name in sorted(left_out - have)]
            )
        return left_out

    def _writer(self, place: Path) -> Writer:
        if self.dataset:
            return open_writer(place)
        form = self.form
        splits = (form.split_duration, form.split_size)
        writer = open_writer(place, form.storage, form.compression, *splits)
        self.written.describe(self.path, lambda: described(writer.topics))
        return writer

    def _text(self, staged: Path, folder: Path, form: str) -> tuple[Counts, dict[str, int]]:
        """Convert a dataset with all that it has, and replace the readings."""
        self._convert(self.source, staged)
        model: ErrorModel | None = None
        place = folder / ("noisy.csv" if staged.is_file() else "noisy")
        with Dataset(place, form) as dataset:
            for t_ns, gyro, accel in text_reader.imu_blocks(self.source, None, self._uncounted):
                if model is None:
                    parameters = with_rate(self.layers, functools.partial(rate_of, t_ns))
                    model = ErrorModel(parameters, remark=self.watcher.warn)
                for begin in range(0, len(t_ns), ROWS_AT_ONCE):
                    rows = slice(begin, begin + ROWS_AT_ONCE)
                    for samples in model.read(GivenReadings(t_ns[rows], gyro[rows], accel[rows])):
                        dataset.write_imu(*delivered(samples[IMU]))
        if model is None:
            raise InputError(f"{self.source}: contains no readings")
        if staged.is_file():
            shutil.move(place, staged)
        else:
            shutil.move(place / "imu0" / "data.csv", staged / "imu0" / "data.csv")
        return model.counts, {"/" + IMU_TOPIC: dataset.imu.rows if dataset.imu else 0}


def _say_nothing(_: object) -> None:
    """Say nothing: what is left out of the errors is said once."""
