# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag or dataset into another form; interrupted bags into whole ones."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np

from imu_sim_ros import arguments
from imu_sim_ros.bags import convert as streams
from imu_sim_ros.bags import sensor_tables
from imu_sim_ros.bags.messages.blocks import TopicInfo
from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY, POSE_STAMPED
from imu_sim_ros.bags.messages.encode_cameras import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE
from imu_sim_ros.bags.outputs import Outputs
from imu_sim_ros.bags.read import open_bag, read_poses
from imu_sim_ros.bags.reader import Bag
from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.bags.text import writer as text_writer
from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.bags.writer import Writer, amount, described, open_writer
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.jobs.writing import (
    Compression,
    DiscardPartial,
    Force,
    Form,
    Format,
    Journal,
    Output,
    Rename,
    SkipBadRows,
    SplitDuration,
    SplitSize,
    Storage,
    checked_form,
    counts,
    outputs,
)
from imu_sim_ros.poses import PoseSequence
from imu_sim_ros.progress import Advance, progress
from imu_sim_ros.sensors import known_tables
from imu_sim_ros.simulation.topics import resolved

if TYPE_CHECKING:
    from imu_sim_ros.datasets.recorded_bag import RecordedImages
    from imu_sim_ros.datasets.recorded_folder import FolderImages

IMAGES: Final = ("raw", "compressed", "both", "none")
_SHOWN_DAMAGE: Final = 10
Counts = tuple[dict[str, int], int]
"""Messages or rows by topic, and the last stamp [ns]; -1 without any."""


@dataclass(frozen=True)
class Converted:
    """What :func:`convert` wrote."""

    output: Path
    messages: dict[str, int]
    """Messages by topic, rows by table, images by camera."""
    recovered: bool
    """Whether the input was not whole."""
    last_stamp_ns: int | None
    found: tuple[str, ...] | None = None
    """Lines about the result of a recovery; None if nothing was recovered."""
    left_out: tuple[str, ...] | None = None
    not_converted: tuple[str, ...] = ()
    """Topics and tables of the input for which the output has no place."""
    warnings: tuple[str, ...] = ()
    """Lines about invalid messages that are passed on or skipped."""

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        result = {
            "output": str(self.output),
            "messages": self.messages,
            "recovered": self.recovered,
            "last_stamp_ns": self.last_stamp_ns,
            "not_converted": list(self.not_converted),
        }
        if self.found is None or self.left_out is None:
            return result
        lost = {"found": list(self.found), "left_out": list(self.left_out)}
        return {**result, **lost, "lost_ranges": len(self.left_out)}

    def lines(self) -> Iterator[str]:
        """Yield what ``convert_bag`` prints."""
        last_ns = self.last_stamp_ns
        until = f", up to stamp {last_ns / 1e9:.9f} s" if last_ns is not None else ""
        word = "recovered" if self.recovered else "written"
        yield f"{self.output}: {word}: {counts(self.messages) or 'no messages'}{until}"
        if self.not_converted:
            yield f"{self.output}: has no place for {', '.join(self.not_converted)}"

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {name}" for name, count in self.messages.items())
        return f"<Converted {self.output.name}: {counts or 'no messages'}>"


def convert(
    source: Annotated[str | Path, "INPUT"],
    output: Output,
    *,
    format: Annotated[Format, text_writer.FORMATS] = None,
    storage: Storage = None,
    compression: Compression = None,
    split_duration: SplitDuration = 0.0,
    split_size: SplitSize = 0,
    topics: Annotated[str | Sequence[str], "NAME,..."] = (),
    rename: Rename = None,
    images: Annotated[str | None, IMAGES] = None,
    recover: Annotated[bool, "--recover"] = False,
    skip_bad_rows: SkipBadRows = False,
    force: Force = False,
    discard_partial: DiscardPartial = False,
) -> Converted:
    """Write a bag or dataset in another form, as the program ``convert_bag`` does.

    :param source: ROS 1 bag, .mcap, rosbag2 folder, EuRoC folder, CSV or TUM file
    :param topics: topics to convert (default: all)
    :param images: messages for a folder's images (default: raw); select a bag's images with
        --topics
    :param recover: recover all complete messages of an interrupted or damaged bag
    :param skip_bad_rows: leave out readings and poses that are not finite or not possible

    The other arguments are those of :func:`generate`.

    :returns: paths and numbers of messages of the output.
    :raises ConfigurationError: with a line for each invalid argument.
    :raises InputError: for a source that cannot be read, and an output that cannot be written.

    >>> import imu_sim_ros as ims
    >>> made = ims.generate(folder / "torn.mcap", duration=2, seed=1)
    >>> ims.convert(made.output, folder / "whole.bag", compression="lz4")
    <Converted whole.bag: 400 /imu/data_raw, 400 /ground_truth/odom>
    """
    path = arguments.path("source", source)
    bag = (storage, compression, split_duration, split_size)
    target, form = checked_form(text_writer.FORMATS, output, format, *bag, topics, rename)
    written = outputs(force, discard_partial, [path])
    if images is not None:
        arguments.one_of("images", images, IMAGES)
    arguments.switch("recover", recover)
    journal = Journal(path, arguments.switch("skip_bad_rows", skip_bad_rows))
    found = write(path, target, form, written, journal, images=images, recover=recover)
    return dataclasses.replace(found, warnings=tuple(journal.lines))


def write(
    source: Path,
    path: Path,
    form: Form,
    written: Outputs,
    journal: Journal,
    *,
    images: str | None = None,
    recover: bool = False,
    shown: bool = True,
) -> Converted:
    """Convert a source into an output; arguments as for :func:`convert`.

    :param written: receives the output.
    :param shown: whether progress is.
    :raises InputError: for a source that cannot be read, and an output that cannot be written.
    """
    written.add(path, kept=True)
    job = _Job(source, path, form, written, journal, images, recover, shown)
    job.check_images()
    with written.staged():
        return job.from_text() if job.is_text else job.from_bag()


class _Job:
    """One conversion."""

    def __init__(
        self,
        source: Path,
        path: Path,
        form: Form,
        written: Outputs,
        journal: Journal,
        images: str | None,
        recover: bool,
        shown: bool,
    ) -> None:
        self.source, self.path, self.form = source, path, form
        self.images, self.recover, self.shown = images, recover, shown
        self.dataset = form.dataset or ""
        """Empty: a bag."""
        self.written, self.journal = written, journal
        self.staged = written.where(path)
        self.is_text = text_reader.is_text(source)
        self.comment = f"converted from {source.name} by imu_sim_ros"
        self.renamed = {resolved(old): resolved(new) for old, new in form.renamed.items()}

    def check_images(self) -> None:
        """Refuse a choice of images that would have no effect."""
        images = self.images
        if images and not self.is_text and self.source.exists():
            raise InputError(
                f"images {images}: applies to folders only; select a bag's images with topics"
            )
        if self.dataset and images not in (None, "none"):
            raise InputError(f"images {images}: does not apply to {self.dataset}; only none does")

    def from_bag(self) -> Converted:
        whole = not self.recover or _is_whole(self.source)
        with open_bag(self.source, self.recover) as bag:
            topics = streams.chosen(bag, self.form.topics)
            if not self.dataset:
                counts, last_ns = self._bag_to_bag(bag, topics)
            elif self.dataset == "tum":
                counts, last_ns = self._bag_to_tum(bag, topics)
            else:
                counts, last_ns = self._bag_to_dataset(bag, topics)
        lost = self._without_table(topics, counts) if self.dataset else []
        found = self._converted(counts, last_ns, lost)
        if not self.recover:
            return found
        if not sum(counts.values()):
            raise InputError([*self._recovery(bag), f"{self.source}: nothing recoverable"])
        for line in self._recovery(bag):
            self.journal.remark(line)
        recovered = not whole or bool(bag.damage or bag.found)
        return dataclasses.replace(
            found, recovered=recovered, found=tuple(bag.found), left_out=tuple(bag.damage)
        )

    def _converted(
        self, messages: dict[str, int], last_ns: int, not_converted: Sequence[str] = ()
    ) -> Converted:
        last = last_ns if last_ns >= 0 else None
        return Converted(self.path, messages, False, last, not_converted=tuple(not_converted))

    def _without_table(self, topics: Sequence[TopicInfo], counts: Mapping[str, int]) -> list[str]:
        """Return the topics with messages for which a dataset has no place."""
        converted = set(counts)
        if streams.TRUTH in converted and self.dataset == "euroc":
            converted |= {streams.GYRO_BIAS, streams.ACCEL_BIAS}  # columns of the states
        seen: set[str] = set()
        if self.staged.is_dir():
            seen = {CAMERA_INFO, TF_MESSAGE}
        return [
            t.name for t in topics if t.count and t.name not in converted and t.type not in seen
        ]

    def _recovery(self, bag: Bag) -> list[str]:
        """Return lines about what a recovery has found and left out."""
        lines = [f"{bag.path}: found: {line}" for line in bag.found]
        for k, line in enumerate(bag.damage):
            if k == _SHOWN_DAMAGE:
                lines.append(f"{bag.path}: left out: and {len(bag.damage) - k} more places")
                break
            lines.append(f"{bag.path}: left out: {line}")
        count = len(bag.damage)
        lost = {0: "nothing is", 1: "1 range is"}.get(count, f"{count} ranges are")
        return [*lines, f"{bag.path}: {lost} left out"]

    def _progress(self, total: int) -> AbstractContextManager[Advance]:
        if not self.shown:
            return contextlib.nullcontext(lambda count: None)
        return progress(f"writing {self.path}", lambda: total)

    def _writer(self) -> Writer:
        writer = open_writer(self.staged, *self.form.bag)
        self.written.describe(self.path, lambda: described(writer.topics))
        return writer

    def _bag_to_bag(self, bag: Bag, topics: Sequence[Any]) -> Counts:
        total = sum(topic.count for topic in topics)
        with (
            self._writer() as writer,
            self._progress(total) as advance,
        ):
            refused = self.journal.skipped, self.journal.passed_on
            lines = streams.bag_to_bag(bag, writer, topics, self.renamed, advance, *refused)
        for line in lines:
            self.journal.remark(line)
        return _tally(writer)

    def _bag_to_dataset(self, bag: Bag, topics: Sequence[Any]) -> Counts:
        readings = bag.topic(IMU, self._only_named(topics, IMU))
        truths = [topic for topic in topics if topic.type == ODOMETRY]
        chosen: dict[str, str | None] = {IMU: readings.name}
        if truths:
            chosen[ODOMETRY] = self._true_states(bag, topics)
        one_table = self.staged.suffix.lower() == ".csv"
        tables = {} if one_table else sensor_tables.tables_of(topics, readings.name, known_tables())
        names = {kind: topic.name for kind, topic in tables.items()}
        total = readings.count + sum(topic.count for topic in [*truths, *tables.values()])
        with self._dataset(bool(truths), names) as dataset:
            images = self._images(bag, topics)
            total += sum(topic.count for topic in images.topics) if images else 0
            with self._progress(total) as advance:
                skipped, warned = self.journal.skipped, self.journal.passed_on
                streams.to_dataset(
                    bag.path,
                    dataset,
                    chosen,
                    advance,
                    self.recover,
                    skipped,
                    _described(names),
                    warned,
                )
                if images:
                    images.write(advance, self.comment)
        if self.dataset == "euroc":
            self._describe(bool(truths), names)
        counts = _rows(dataset, readings.name, chosen.get(ODOMETRY), names)
        if images is None:
            return counts, dataset.last_ns
        return {**counts, **images.counts}, max(dataset.last_ns, images.last_ns)

    def _images(self, bag: Bag, topics: Sequence[TopicInfo]) -> RecordedImages | None:
        """Return the images of the topics, if there are some and the dataset is a folder."""
        kinds = {topic.type for topic in topics}
        if not kinds & {IMAGE, COMPRESSED_IMAGE} or not self.staged.is_dir():
            return None
        from imu_sim_ros.datasets.recorded_bag import (  # they need OpenCV
            RecordedImages,
            recorded_cameras,
        )

        return RecordedImages(bag, recorded_cameras(topics), self.staged, self.dataset)

    def _true_states(self, bag: Bag, topics: Sequence[TopicInfo]) -> str:
        """Return the topic of Odometry that becomes the truth of the dataset."""
        named = self._only_named(topics, ODOMETRY)
        if named is None:
            states = [topic.name for topic in topics if topic.type == ODOMETRY]
            own = [name for name in states if name.endswith(streams.TRUTH)]
            named = own[0] if len(own) == 1 else None
        found = bag.topic(ODOMETRY, named).name
        if named is None:
            self.journal.remark(f"{bag.path}: {found} becomes the truth of the dataset")
        return found

    def _only_named(self, topics: Sequence[Any], type_name: str) -> str | None:
        """Return the topic of a type among ``topics``; None if there is none."""
        fitting = [topic.name for topic in topics if topic.type == type_name]
        if self.form.topics and not fitting:
            raise InputError(f"topics {','.join(self.form.topics)}: none of them is of {type_name}")
        return fitting[0] if self.form.topics and len(fitting) == 1 else None

    def _dataset(
        self,
        states: bool,
        tables: Collection[str],
    ) -> Dataset:
        dataset = Dataset(
            self.staged, self.dataset, states, tables=[(known_tables()[kind], 0) for kind in tables]
        )
        self.written.describe(self.path, lambda: amount(dataset.rows, dataset.last_ns, "rows"))
        return dataset

    def _bag_to_tum(self, bag: Bag, topics: Sequence[Any]) -> Counts:
        named = topics[0].name if self.form.topics and len(topics) == 1 else None
        skipped, warned = self.journal.skipped, self.journal.passed_on
        recover = self.recover
        poses = read_poses(bag.path, named, skipped is not None, warned=warned, recover=recover)
        if skipped is not None and poses.skipped:
            skipped(poses.skipped)
        kinds = {topic.type for topic in bag.topics}
        found = bag.topic(ODOMETRY if ODOMETRY in kinds else POSE_STAMPED, named).name
        return self._write_tum(poses, found)

    def _write_tum(self, poses: PoseSequence, name: str) -> Counts:
        none = np.zeros((len(poses.t_ns), 3))
        with Dataset(self.staged, "tum") as dataset:
            dataset.write_states(text_writer.BodyStates(*poses[:3], none, none, none))
        return {name: len(poses.t_ns)}, int(max(poses.t_ns, default=-1))

    def from_text(self) -> Converted:
        if self.form.topics:
            raise InputError(f"{self.source}: text has no topics to choose from")
        if self.dataset == "tum":
            return self._converted(*self._write_tum(self._poses(), streams.TRUTH))
        if self.dataset:
            return self._text_to_dataset()
        if streams.holds_poses(self.source):
            with self._writer() as writer, self._progress(0) as advance:
                streams.poses_to_bag(self._poses(), writer, self.renamed, advance)
            return self._converted(*_tally(writer))
        with (
            self._folder_images() as images,
            self._writer() as writer,
            self._progress(0) as advance,
        ):
            renamed = self.renamed
            seen = images.streams(writer, renamed, self.images or "raw") if images else []
            known = known_tables()
            skipped = self.journal.skipped
            streams.text_to_bag(self.source, writer, renamed, advance, skipped, seen, known)
            lost = [
                name
                for name, kind in text_reader.table_names(self.source, known).items()
                if not known[kind].is_converted
            ]
        return self._converted(*_tally(writer), lost)

    def _poses(self) -> PoseSequence:
        """Return the poses of a text file, or of a folder."""
        source = text_reader.pose_file(self.source) or self.source
        poses = read_poses(source, None, self.journal.skipped is not None)
        if self.journal.skipped is not None and poses.skipped:
            self.journal.skipped(poses.skipped)
        return poses

    def _text_to_dataset(self) -> Converted:
        states = text_reader.has_states(self.source)
        poses = None if states else text_reader.pose_file(self.source)
        # Tables have states, with velocities.
        lost = [] if poses is None else [str(poses.relative_to(self.source))]
        one_table = self.staged.suffix.lower() == ".csv"
        tables = {} if one_table else text_reader.table_names(self.source, known_tables())
        names = {kind: name for name, kind in tables.items()}
        with (
            self._folder_images() as images,
            self._dataset(states, names) as dataset,
            self._progress(0) as advance,
        ):
            chosen: dict[str, str | None] = {IMU: None, **({ODOMETRY: None} if states else {})}
            streams.to_dataset(
                *(self.source, dataset, chosen, advance, False, self.journal.skipped),
                _described(names),
            )
            seen = {}
            if images and self.staged.is_dir():
                seen = images.copy(self.staged, self.dataset, self.comment, advance)
        if self.dataset == "euroc":
            self._describe(states, names)
        called = {kind: resolved(known_tables()[kind].topic) for kind in names}
        counts = _rows(dataset, streams.READINGS, streams.TRUTH, called)
        return self._converted({**counts, **seen}, dataset.last_ns, lost)

    def _folder_images(self) -> AbstractContextManager[FolderImages | None]:
        """Return the images of a folder; None if it has none, or they are not wanted."""
        folders = text_reader.parents(self.source) if self.source.is_dir() else ()
        cameras = [name for folder in folders for name in text_reader.sensor_folders(folder, "cam")]
        if self.images == "none" or not cameras:
            return contextlib.nullcontext()
        from imu_sim_ros.datasets.recorded_folder import FolderImages  # with the cameras' modules

        return FolderImages(self.source, self.journal.skipped)

    def _describe(self, states: bool, tables: Collection[str]) -> None:
        """Write sensor.yaml files; values that the input does not have are left out."""

        def rate(name: str, table: Table | None = None) -> float:
            first = np.empty(0, np.int64)
            with contextlib.suppress(InputError):  # no usable row
                first = next(sensor_tables.stamps(self.staged, name, table), first)
            period = float(np.median(np.diff(first))) if len(first) > 1 else 0.0
            return round(1e9 / period, 3) if period else 0.0

        pose = (np.eye(3), np.zeros(3))
        comment = self.comment
        text_writer.write_euroc_descriptions(self.staged, rate("imu0"), {}, *pose, comment, states)
        for table, _ in _described(dict.fromkeys(tables, "")):
            own = rate(f"{table.name}0", table)
            text_writer.write_euroc_table(self.staged, table, 0, own, *pose, comment)


def _is_whole(path: Path) -> bool:
    try:
        with open_bag(path):
            return True
    except InputError:
        return False


def _tally(writer: Writer) -> Counts:
    counts = {topic.name: topic.count for topic in writer.topics}
    return counts, max((topic.last_ns for topic in writer.topics), default=-1)


def _rows(
    dataset: Dataset, readings: str, truth: str | None, tables: Mapping[str, str]
) -> dict[str, int]:
    counts = {name: dataset.tables[kind, 0].rows for kind, name in tables.items()}
    if dataset.imu is not None:
        counts[readings] = dataset.imu.rows
    if dataset.truth is not None and truth:
        counts[truth] = dataset.truth.rows
    return counts


def _described(names: Mapping[str, str]) -> list[tuple[Table, str]]:
    """Return tables instead of their kinds."""
    known = known_tables()
    return [(known[kind], name) for kind, name in names.items()]
