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
from typing import TYPE_CHECKING, Annotated, Final

import numpy as np

from imu_sim_ros.bags import convert as streams
from imu_sim_ros.bags import sensor_tables
from imu_sim_ros.bags.cameras import cameras_of_topics
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.blocks import TopicInfo
from imu_sim_ros.bags.messages.edit import ImuEdit
from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY, ImuEncoder
from imu_sim_ros.bags.messages.encode_cameras import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE
from imu_sim_ros.bags.outputs import Outputs, Target
from imu_sim_ros.bags.pose_topics import pose_topic
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.bags.reader import Bag, Recover
from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.bags.text import writer as text_writer
from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.bags.writer import BagOptions, Writer, describe_amount, topics_summary
from imu_sim_ros.core import arguments
from imu_sim_ros.core.arguments import suggest_keywords
from imu_sim_ros.core.bad_rows import Skipped
from imu_sim_ros.core.conventions import IMU_TOPIC
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.core.records import Readings, States, replace_fields
from imu_sim_ros.core.spelling import argument, argument_prefix
from imu_sim_ros.core.types import JsonObject, Times
from imu_sim_ros.formats.choice import AS_RECORDED, Choice
from imu_sim_ros.formats.door import has_topics, imu_choices, read_states, reading_blocks
from imu_sim_ros.formats.handling import Handling
from imu_sim_ros.inputs.tables import Table
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
    Rename,
    SkipBadRows,
    SplitDuration,
    SplitSize,
    Storage,
    counts_text,
    form_of_output,
    outputs,
)
from imu_sim_ros.recordings.clock import estimate_clock
from imu_sim_ros.recordings.findings.catalogue import (
    copy_findings,
    order_findings,
    unit_findings,
)
from imu_sim_ros.recordings.findings.finding import Finding
from imu_sim_ros.recordings.findings.policy import CONVERT, COPY, FindingPolicy
from imu_sim_ros.recordings.findings.readings import UNITS
from imu_sim_ros.recordings.findings.survey import ReadingSurvey
from imu_sim_ros.sensors import reading_tables
from imu_sim_ros.simulation.topics import resolve_topic
from imu_sim_ros.terminal.progress import Advance, progress

if TYPE_CHECKING:
    from imu_sim_ros.datasets.recorded_bag import RecordedImages
    from imu_sim_ros.datasets.recorded_folder import FolderImages

_JUDGED: Final = 262_144
"""Readings at the start of a recording in which its units are looked for while it is at rest."""
IMAGES: Final = ("raw", "compressed", "both", "none")
_PIECE: Final = 1 << 18
"""Number of stamps of a source whose order is judged at a time."""
_OVERLAP: Final = 16
"""Number of stamps that are judged with the next piece, too: runs of strays are shorter."""
_SHOWN_DAMAGE: Final = 10
"""Largest number of damaged parts that are listed."""
Counts = tuple[dict[str, int], int]
"""Messages or rows by topic, and the last stamp [ns]; -1 without any."""


@dataclass(frozen=True)
class Converted:
    """Result of :func:`convert`."""

    output: Path
    messages: dict[str, int]
    """Messages by topic, rows by table, images by camera."""
    recovered: bool
    """True if the input was damaged or incomplete."""
    last_stamp_ns: int | None
    found: tuple[str, ...] | None = None
    """Lines about the result of a recovery; None if nothing was recovered."""
    left_out: tuple[str, ...] | None = None
    lost_bytes: int = 0
    """Size of the ranges that a recovery leaves out [bytes]."""
    lost_messages: int = 0
    """Number of messages left out, as far as indexes and numbers tell it."""
    not_converted: tuple[str, ...] = ()
    """Topics and tables of the input for which the output has no place."""
    warnings: tuple[str, ...] = ()
    """Lines about invalid messages that are passed on or skipped."""
    notes: tuple[str, ...] = ()
    """Choices and conversions of reading, a line each."""

    def to_dict(self) -> JsonObject:
        """Return the content of ``--json``."""
        result = {
            "output": str(self.output),
            "messages": self.messages,
            "recovered": self.recovered,
            "last_stamp_ns": self.last_stamp_ns,
            "not_converted": list(self.not_converted),
            "notes": list(self.notes),
        }
        if self.found is None or self.left_out is None:
            return result
        lost = {"found": list(self.found), "left_out": list(self.left_out)}
        return {
            **result,
            **lost,
            "lost_ranges": len(self.left_out),
            "lost_bytes": self.lost_bytes,
            "lost_messages": self.lost_messages,
        }

    def lines(self) -> Iterator[str]:
        """Yield the lines of the report that ``convert_bag`` prints."""
        yield from input_lines(self.notes)
        last_ns = self.last_stamp_ns
        until = f", up to stamp {last_ns / 1e9:.9f} s" if last_ns is not None else ""
        word = "recovered" if self.recovered else "written"
        yield f"{self.output}: {word}: {counts_text(self.messages) or 'no messages'}{until}"
        if self.not_converted:
            yield f"{self.output}: has no place for {', '.join(self.not_converted)}"

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {name}" for name, count in self.messages.items())
        return f"<Converted {self.output.name}: {counts or 'no messages'}>"


@suggest_keywords
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
    keep_damaged: Annotated[bool, "--keep-damaged"] = False,
    frame: Frame = None,
    gyro_topic: GyroTopic = None,
    accel_topic: AccelTopic = None,
    gyro_unit: GyroUnit = None,
    accel_unit: AccelUnit = None,
    skip_bad_rows: SkipBadRows = False,
    force: Force = False,
    discard_partial: DiscardPartial = False,
) -> Converted:
    """Write a bag or dataset in another form, as the program ``convert_bag`` does.

    :param source: ROS 1 bag, .mcap, rosbag2 folder, EuRoC folder, CSV or TUM file
    :param topics: topics to convert (default: all)
    :param images: messages for a folder's images (default: raw); select a bag's images with
        ``topics``
    :param recover: recover all complete messages of an interrupted or damaged bag
    :param keep_damaged: with ``recover``: keep the messages of chunks whose checksum is wrong and
        whose records are in sequence; any of them may have wrong values
    :param frame: frame of the readings to convert, if a topic carries several IMUs
    :param gyro_topic: topic of the gyroscope; the output has the merged readings, imu/data_raw
    :param accel_topic: topic of the accelerometer, interpolated to the gyroscope's times
    :param gyro_unit: unit of the gyroscope in the input: rad/s, deg/s; the output has rad/s
    :param accel_unit: unit of the accelerometer in the input: m/s^2, g, mg; the output has m/s^2
    :param skip_bad_rows: leave out readings and poses that are not finite or not possible

    The other arguments are those of :func:`generate`.

    :returns: paths and numbers of messages of the output.
    :raises ConfigurationError: with a line for each invalid argument.
    :raises InputError: for a source that cannot be read, and an output that cannot be written.

    >>> import imu_sim_ros as ims
    >>> recording = ims.generate(folder / "torn.mcap", duration=2, seed=1)
    >>> ims.convert(recording.output, folder / "whole.bag", compression="lz4")
    <Converted whole.bag: 400 /imu/data_raw, 400 /ground_truth/odom>
    """
    path = arguments.path("source", source)
    bag = BagOptions(storage, compression, split_duration, split_size)
    target, form = form_of_output(text_writer.FORMATS, output, format, bag, topics, rename)
    written = outputs(force, discard_partial, [path])
    if images is not None:
        arguments.choice("images", images, IMAGES)
    arguments.boolean("recover", recover)
    if arguments.boolean("keep_damaged", keep_damaged) and not recover:
        raise ConfigurationError(
            f"{argument_prefix('keep_damaged')}: applies to a recovery; "
            f"give {argument('recover', True)}, too"
        )
    journal = Journal(path, arguments.boolean("skip_bad_rows", skip_bad_rows))
    recovery: Recover = "keep_damaged" if keep_damaged else recover
    selection = frame, gyro_topic, accel_topic, gyro_unit, accel_unit
    choice = check_choice(None, *selection, of_a_file=True)
    is_copy = form.dataset is None and not choice.merges and has_topics(path)
    policy = COPY if is_copy else CONVERT
    if form.dataset != "tum":
        _tell_units(path, choice, form.topics, policy, journal)
    stamps = CopiedStamps(bool(recovery))
    converted = write(
        path,
        target,
        form,
        written,
        journal,
        images=images,
        recover=recovery,
        choice=choice,
        stamps=stamps,
    )
    policy.judge(stamps.findings(), journal.remark)
    return dataclasses.replace(converted, warnings=tuple(journal.lines))


class CopiedStamps:
    """Stamps of readings and poses that a conversion copies in the order of their source.

    They are judged in pieces, so that long recordings do not need more memory. Only those of a
    recovery are kept to the end: its files follow each other by their names, and the messages are
    put in the order of their record times first.
    """

    def __init__(self, recovery: bool = False) -> None:
        """Initialise without stamps.

        :param recovery: the messages are those of a recovery.
        """
        self._recovery = recovery
        self._sources: dict[str, _SourceStamps] = {}

    def add(self, source: str, t_ns: Times, record_ns: Times | None = None) -> None:
        """Add the next stamps (n,) of a source [ns].

        :param record_ns: record times [ns]; None: there are none, the stamps are in order.
        """
        stamps = self._sources.setdefault(source, _SourceStamps(source))
        stamps.add(t_ns, record_ns if self._recovery else None)
        if stamps.count >= _PIECE and not self._recovery:
            stamps.judge()

    def findings(self) -> list[Finding]:
        """Return the findings about the order of the stamps of each source."""
        for stamps in self._sources.values():
            stamps.judge()
        return [finding for stamps in self._sources.values() for finding in stamps.findings]


class _SourceStamps:
    """Stamps of one source that are not judged yet, and the findings about those before."""

    def __init__(self, source: str) -> None:
        self.count = 0
        """Number of stamps that are not judged yet."""
        self.findings: list[Finding] = []
        self._source = source
        self._blocks: list[Times] = []
        self._record_blocks: list[Times] = []
        self._start_ns: int | None = None
        self._judged = 0
        """Number of rows in front of the blocks."""

    def add(self, t_ns: Times, record_ns: Times | None) -> None:
        """Add the next stamps (n,), and their record times if these order them [ns]."""
        # A view would keep the messages of its block in memory.
        self._blocks.append(t_ns.copy())
        self.count += len(t_ns)
        if record_ns is not None:
            self._record_blocks.append(record_ns.copy())

    def judge(self) -> None:
        """Judge the order of the stamps; the last ones are judged with the next ones again."""
        if not self.count:
            return
        t_ns = np.concatenate(self._blocks)
        if self._record_blocks:
            t_ns = t_ns[np.argsort(np.concatenate(self._record_blocks), kind="stable")]
        if self._start_ns is None:
            self._start_ns = int(t_ns[0])
        earlier_s = (int(t_ns[0]) - self._start_ns) * 1e-9
        for finding in order_findings(t_ns, self._source):
            row = None if finding.row is None else finding.row + self._judged
            t = None if finding.t is None else finding.t + earlier_s
            self.findings.append(dataclasses.replace(finding, row=row, t=t))
        rest = t_ns[-_OVERLAP:].copy()
        self._judged += len(t_ns) - len(rest)
        self._blocks, self._record_blocks, self.count = [rest], [], 0


def _tell_units(
    source: Path, choice: Choice, topics: Collection[str], policy: FindingPolicy, journal: Journal
) -> None:
    """Note readings in other units, and absent triads that are copied.

    Errors of reading are reported at the conversion.

    :param topics: topics that are converted; none: all.
    """
    chosen, choices = {resolve_topic(name) for name in topics}, [choice]
    with contextlib.suppress(InputError):
        choices = choices if choice.merges else imu_choices(source, choice)
    converted = [
        entry
        for entry in choices
        if not chosen or entry.topic is None or resolve_topic(entry.topic) in chosen
    ]
    for entry in converted:
        name = f"{source}: {entry.topic}" if len(converted) > 1 else str(source)
        policy.judge(_unit_findings(source, entry, name, policy), journal.remark)


def _unit_findings(
    source: Path, choice: Choice, name: str, policy: FindingPolicy
) -> Iterator[Finding]:
    """Yield the findings about the units of an IMU, and about absent triads that are copied."""
    survey = ReadingSurvey(copy_findings if policy is COPY else unit_findings)
    with contextlib.suppress(InputError):
        for block in reading_blocks(source, choice):
            findings = survey.add(replace_fields(block, source=name))
            yield from findings
            is_known = survey.moved or any(finding.kind in UNITS for finding in findings)
            if is_known or survey.readings >= _JUDGED:
                break
        yield from survey.finish()


def write(
    source: Path,
    path: Path,
    form: Form,
    written: Outputs,
    journal: Journal,
    *,
    images: str | None = None,
    recover: Recover = False,
    shown: bool = True,
    choice: Choice = AS_RECORDED,
    stamps: CopiedStamps | None = None,
) -> Converted:
    """Convert a source into an output; arguments as for :func:`convert`.

    :param written: receives the output.
    :param choice: frame, topics and units of the readings.
    :param shown: whether progress is shown.
    :param stamps: receives the stamps of readings and poses.
    :raises InputError: for a source that cannot be read, and an output that cannot be written.
    """
    is_text, dataset = not has_topics(source), form.dataset
    if images and not is_text and source.exists():
        raise InputError(
            f"images {images}: applies to folders only; select a bag's images with topics"
        )
    if dataset and images not in (None, "none"):
        raise InputError(f"images {images}: does not apply to {dataset}; only none does")
    target = written.add(path, keep_partial=True)
    poses_only = dataset == "tum" or (is_text and streams.holds_poses(source))
    if poses_only and not choice.is_plain:
        raise InputError(f"{source}: frame, topics and units are those of readings, not of poses")
    comment = f"converted from {source.name} by imu_sim_ros"
    output = _Output(target, form, shown, comment, choice, stamps or CopiedStamps())
    with written.stage():
        if not is_text:
            return _convert_bag(source, output, journal, recover)
        if form.topics:
            raise InputError(f"{source}: text has no topics to choose from")
        if dataset == "tum":
            return output.converted(
                *_to_tum(_poses(source, output, journal), output, streams.TRUTH)
            )
        if dataset:
            return _text_to_dataset(source, output, journal, images)
        return _text_to_bag(source, output, journal, images)


@dataclass(frozen=True)
class _Output:
    """Output of a conversion and its settings."""

    target: Target
    form: Form
    shown: bool
    """True if progress is displayed."""
    comment: str
    """Comment at the head of the descriptions."""
    choice: Choice
    """Frame, topics and units of the readings."""
    stamps: CopiedStamps
    """Stamps of readings and poses so far."""
    notes: list[str] = dataclasses.field(default_factory=list)
    """Choices and conversions of reading so far."""

    def readings(self, source: Path, topic: str | None, handling: Handling) -> Iterator[Readings]:
        """Yield the chosen readings of the source; their notes go to the journal.

        :raises InputError: if there are none of the chosen frame.
        """
        choice = dataclasses.replace(self.choice, topic=topic)
        count = 0
        for readings in reading_blocks(source, choice, handling):
            self.notes.extend(note for note in readings.notes if note not in self.notes)
            count += len(readings)
            yield readings
        if not count and choice.frame is not None:
            raise InputError(f"{source}: contains no readings of the frame {choice.frame}")

    @property
    def renamed(self) -> dict[str, str]:
        """New names of topics by old ones."""
        return {
            resolve_topic(name): resolve_topic(new_name)
            for name, new_name in self.form.renamed.items()
        }

    def progress(self, total: int) -> AbstractContextManager[Advance]:
        """Return the context that shows progress.

        :param total: total number of messages and rows; 0: not known.
        """
        if not self.shown:
            return contextlib.nullcontext(lambda count: None)
        return progress(f"writing {self.target.final}", lambda: total)

    def bag(self) -> Writer:
        """Open the bag that is written."""
        writer = open_writer(self.target.path, self.form.bag)
        self.target.summary = lambda: topics_summary(writer.topics)
        return writer

    def dataset(self, states: bool, tables: Collection[str]) -> Dataset:
        """Open a dataset of readings.

        :param states: whether the dataset has the truth, too.
        :param tables: the dataset's other tables, by kind.
        """
        tables_by_kind = reading_tables()
        dataset = Dataset(
            self.target.path,
            str(self.form.dataset),
            states,
            tables=[(tables_by_kind[kind], 0) for kind in tables],
        )
        self.target.summary = lambda: describe_amount(dataset.rows, dataset.last_ns, "rows")
        return dataset

    def converted(
        self, messages: dict[str, int], last_ns: int, not_converted: Sequence[str] = ()
    ) -> Converted:
        """Return what was written to the target, with the notes so far.

        :param messages: messages by topic, rows by table, images by camera.
        :param last_ns: the last stamp [ns]; -1: there is none.
        :param not_converted: topics of the source that the target's format cannot hold.
        """
        last_stamp_ns = last_ns if last_ns >= 0 else None
        return Converted(
            self.target.final,
            messages,
            False,
            last_stamp_ns,
            not_converted=tuple(not_converted),
            notes=tuple(self.notes),
        )


def _convert_bag(source: Path, output: _Output, journal: Journal, recover: Recover) -> Converted:
    """Convert a bag into another bag, a dataset, or poses in TUM format."""
    form = output.form
    whole = not recover or _is_whole(source)
    with open_bag(source, recover) as bag:
        for name, reason in bag.unreadable.items():
            journal.remark(f"{source}: {name} {reason}, and is left out")
        topics = streams.select_topics(bag, form.topics)
        if form.dataset is None:
            counts, last_ns = _bag_to_bag(bag, topics, output, journal, recover)
        elif form.dataset == "tum":
            topic_name = topics[0].name if form.topics and len(topics) == 1 else None
            poses = _poses(bag.path, output, journal, topic_name, recover)
            counts, last_ns = _to_tum(poses, output, pose_topic(bag, topic_name)[0])
        else:
            counts, last_ns = _bag_to_dataset(bag, topics, output, journal, recover)
    lost = _topics_without_table(topics, counts, output) if form.dataset else []
    lost += bag.unreadable
    result = output.converted(counts, last_ns, lost)
    if not recover:
        return result
    lines = _recovery(bag)
    if not sum(counts.values()):
        raise InputError([*lines, f"{source}: nothing recoverable"])
    for line in lines:
        journal.remark(line)
    return dataclasses.replace(
        result,
        recovered=not whole or bool(bag.damage or bag.found),
        found=tuple(bag.found),
        left_out=tuple(bag.damage),
        lost_bytes=bag.lost_bytes,
        lost_messages=bag.lost_messages,
    )


def _is_whole(path: Path) -> bool:
    """Return whether a bag can be read without recovering it."""
    try:
        with open_bag(path):
            return True
    except InputError:
        return False


def _recovery(bag: Bag) -> list[str]:
    """Return lines about the recovered and the lost parts."""
    lines = [f"{bag.path}: found: {line}" for line in bag.found]
    lines += [f"{bag.path}: left out: {line}" for line in bag.damage[:_SHOWN_DAMAGE]]
    count = len(bag.damage)
    if count > _SHOWN_DAMAGE:
        lines.append(f"{bag.path}: left out: and {count - _SHOWN_DAMAGE} more places")
    ranges = "nothing is" if not count else "1 range is" if count == 1 else f"{count} ranges are"
    amounts = [f"{bag.lost_bytes} bytes"] if bag.lost_bytes else []
    amounts += [f"at least {bag.lost_messages} messages"] if bag.lost_messages else []
    return [*lines, f"{bag.path}: {ranges} left out{': ' if amounts else ''}{', '.join(amounts)}"]


def _topics_without_table(
    topics: Sequence[TopicInfo], counts: Mapping[str, int], output: _Output
) -> list[str]:
    """Return the topics with messages for which a dataset has no place."""
    converted = set(counts)
    if streams.TRUTH in converted and output.form.dataset == "euroc":
        converted |= {streams.GYRO_BIAS, streams.ACCEL_BIAS}  # columns of the states
    # What describes cameras is in a folder's files.
    camera_types = {CAMERA_INFO, TF_MESSAGE} if output.target.path.is_dir() else set()
    return [
        t.name for t in topics if t.count and t.name not in converted and t.type not in camera_types
    ]


def _bag_to_bag(
    bag: Bag, topics: Sequence[TopicInfo], output: _Output, journal: Journal, recover: Recover
) -> Counts:
    """Copy messages; those of Imu topics in SI units and of one frame, if that is chosen.

    :raises InputError: for topics or a frame that the bag lacks.
    """
    choice, edit = output.choice, None
    if choice.merges:
        topics = _drop_merged(bag, topics, output)
    elif not choice.is_plain:
        topic = None if choice.topic is None else choice.topic.lstrip("/")
        edit = ImuEdit(topic, choice.frame, choice.factors)
        output.notes.extend(choice.notes())
        if not any(map(edit.concerns, topics)):
            name = "" if topic is None else f" {choice.topic}"
            raise InputError(f"{bag.path}: has no topic{name} of {IMU} to convert")
    total = sum(topic.count for topic in topics)
    refused = journal.skipped, journal.passed_on
    with output.bag() as writer, output.progress(total) as advance:
        if choice.merges:
            _write_merged(bag.path, output, writer, Handling(*refused, recover))
        lines = streams.bag_to_bag(
            bag,
            writer,
            topics,
            output.renamed,
            advance,
            *refused,
            edit=edit,
            observe=output.stamps.add,
        )
    counts, last_ns = _tally(writer)
    if (
        edit is not None
        and choice.frame is not None
        and not any(
            counts[output.renamed.get(topic.name, topic.name)]
            for topic in topics
            if edit.concerns(topic)
        )
    ):
        raise InputError(f"{bag.path}: contains no readings of the frame {choice.frame}")
    for line in lines:
        journal.remark(line)
    return counts, last_ns


def _drop_merged(bag: Bag, topics: Sequence[TopicInfo], output: _Output) -> list[TopicInfo]:
    """Return topics without those of single triads, which the merged readings replace.

    :raises InputError: if another topic has the name of the merged readings.
    """
    triads = (output.choice.gyro_topic, output.choice.accel_topic)
    merged = {resolve_topic(name) for name in triads if name}
    other_topics = [topic for topic in topics if resolve_topic(topic.name) not in merged]
    merged_name = output.renamed.get(streams.READINGS, streams.READINGS)
    if merged_name in (output.renamed.get(topic.name, topic.name) for topic in other_topics):
        raise InputError(
            f"{bag.path}: has a topic {merged_name}; "
            f"{argument('rename', {IMU_TOPIC: 'NEW'})} gives the merged readings another name"
        )
    return other_topics


def _write_merged(source: Path, output: _Output, writer: Writer, handling: Handling) -> None:
    """Write gyroscope and accelerometer of two topics as one topic."""
    topic = writer.add_topic(output.renamed.get(streams.READINGS, streams.READINGS), IMU)
    for readings in output.readings(source, None, handling):
        output.stamps.add(readings.source, readings.t_ns)
        encoder = ImuEncoder(readings.frame_id, writer.encoding)
        payloads = encoder.encode(readings.t_ns, *readings.triads())
        writer.write(topic, readings.t_ns, payloads)


def _named_topic(
    type_name: str, topics: Sequence[TopicInfo], selection: Collection[str]
) -> str | None:
    """Return the only named topic of a type; None: no topics are named, or several of the type.

    :param topics: topics that are converted.
    :param selection: names of the topics that the user asks for; empty: all are converted.
    :raises InputError: if topics are named, but none of the type.
    """
    if not selection:
        return None
    fitting = [topic.name for topic in topics if topic.type == type_name]
    if not fitting:
        raise InputError(f"topics {','.join(selection)}: none of them is of {type_name}")
    return fitting[0] if len(fitting) == 1 else None


def _truth_of_dataset(
    bag: Bag, topics: Sequence[TopicInfo], selection: Collection[str], journal: Journal
) -> str | None:
    """Return the topic of the truth: the named one, ``ground_truth/odom``, or the only Odometry.

    The last may be an estimate: a remark names it. None: no topic is odometry.

    :param topics, selection: as for :func:`_named_topic`.
    """
    truths = [topic.name for topic in topics if topic.type == ODOMETRY]
    if not truths:
        return None
    usual = [name for name in truths if name.endswith(streams.TRUTH)]
    chosen = _named_topic(ODOMETRY, topics, selection) or (usual[0] if len(usual) == 1 else None)
    truth = bag.topic(ODOMETRY, chosen).name
    if chosen is None:
        journal.remark(f"{bag.path}: {truth} becomes the truth of the dataset")
    return truth


def _bag_to_dataset(
    bag: Bag, topics: Sequence[TopicInfo], output: _Output, journal: Journal, recover: Recover
) -> Counts:
    """Write readings, tables, the truth if there is one, and the images of a folder.

    :param topics: topics of the bag that are converted: those that are named, or all.
    :returns: rows by topic, and the last stamp [ns].
    """
    choice, selection = output.choice, output.form.topics
    if choice.merges:
        readings, topic, count = streams.READINGS, None, 0
    else:
        info = bag.topic(IMU, _named_topic(IMU, topics, selection))
        readings, topic, count = info.name, info.name, info.count
    truth = _truth_of_dataset(bag, topics, selection, journal)
    truths = [topic for topic in topics if topic.type == ODOMETRY]
    one_table = output.target.path.suffix.lower() == ".csv"
    tables = {} if one_table else sensor_tables.tables_of(topics, readings, reading_tables())
    names = {kind: topic.name for kind, topic in tables.items()}
    total = count + sum(topic.count for topic in [*truths, *tables.values()])
    with output.dataset(bool(truths), names) as dataset:
        images = _images(bag, topics, output)
        total += sum(topic.count for topic in images.topics) if images else 0
        with output.progress(total) as advance:
            handling = Handling(journal.skipped, journal.passed_on, recover)
            streams.to_dataset(
                bag.path,
                output.readings(bag.path, topic, handling),
                dataset,
                truth,
                advance,
                recover,
                journal.skipped,
                _tables_of_kinds(names),
                journal.passed_on,
                output.stamps.add,
            )
            if images:
                images.write(advance, output.comment, journal.remark)
    if output.form.dataset == "euroc":
        _describe(output, bool(truths), names)
    counts = _rows(dataset, readings, truth, names)
    if images is None:
        return counts, dataset.last_ns
    return {**counts, **images.counts}, max(dataset.last_ns, images.last_ns)


def _images(bag: Bag, topics: Sequence[TopicInfo], output: _Output) -> RecordedImages | None:
    """Return the images of the topics, if there are some and the dataset is a folder."""
    kinds = {topic.type for topic in topics}
    if not kinds & {IMAGE, COMPRESSED_IMAGE} or not output.target.path.is_dir():
        return None
    from imu_sim_ros.datasets.recorded_bag import RecordedImages  # which needs OpenCV

    return RecordedImages(
        bag, cameras_of_topics(topics), output.target.path, str(output.form.dataset)
    )


def _poses(
    source: Path,
    output: _Output,
    journal: Journal,
    topic: str | None = None,
    recover: Recover = False,
) -> States:
    """Return the poses of a bag, a text file or a folder."""
    file = None if has_topics(source) else text_reader.pose_file(source)
    skipped, warned = journal.skipped, journal.passed_on
    poses = read_states(file or source, topic, skipped is not None, warned=warned, recover=recover)
    if skipped is not None and poses.skipped:
        skipped(poses.skipped)
    output.stamps.add(poses.source, poses.t_ns)
    return poses


def _to_tum(poses: States, output: _Output, name: str) -> Counts:
    """Write poses.

    :param name: name of the topic that they were.
    """
    with Dataset(output.target.path, "tum") as dataset:
        dataset.write_states(poses)
    return {name: len(poses.t_ns)}, int(max(poses.t_ns, default=-1))


def _text_to_bag(source: Path, output: _Output, journal: Journal, images: str | None) -> Converted:
    """Write poses, or readings, tables and images, as messages."""
    renamed, skipped, tables_by_kind = output.renamed, journal.skipped, reading_tables()
    if streams.holds_poses(source):
        with output.bag() as writer, output.progress(0) as advance:
            streams.poses_to_bag(_poses(source, output, journal), writer, renamed, advance)
        return output.converted(*_tally(writer))
    with (
        _folder_images(source, images, skipped) as image_folder,
        output.bag() as writer,
        output.progress(0) as advance,
    ):
        frames = image_folder.streams(writer, renamed, images or "raw") if image_folder else []

        def read(name: str | None, counted: bool) -> Iterator[Readings]:
            count_skipped = skipped if counted or skipped is None else bool
            return output.readings(source, name, Handling(count_skipped))

        streams.text_to_bag(
            source,
            read,
            writer,
            renamed,
            advance,
            skipped,
            frames,
            tables_by_kind,
            output.stamps.add,
        )
        kinds = text_reader.table_names(source, tables_by_kind)
        lost = [name for name, kind in kinds.items() if not tables_by_kind[kind].is_converted]
    return output.converted(*_tally(writer), lost)


def _text_to_dataset(
    source: Path, output: _Output, journal: Journal, images: str | None
) -> Converted:
    """Write readings, states, tables and a folder's images in another form."""
    skipped, tables_by_kind = journal.skipped, reading_tables()
    states = text_reader.has_states(source)
    poses = None if states else text_reader.pose_file(source)
    # Tables have states, with velocities.
    lost = [] if poses is None else [str(poses.relative_to(source))]
    one_table = output.target.path.suffix.lower() == ".csv"
    tables = {} if one_table else text_reader.table_names(source, tables_by_kind)
    names = {kind: name for name, kind in tables.items()}
    with (
        _folder_images(source, images, skipped) as folder,
        output.dataset(states, names) as dataset,
        output.progress(0) as advance,
    ):
        imu = output.readings(source, None, Handling(skipped))
        streams.to_dataset(
            source,
            imu,
            dataset,
            None,
            advance,
            skipped=skipped,
            tables=_tables_of_kinds(names),
            observe=output.stamps.add,
        )
        image_counts = {}
        if folder and output.target.path.is_dir():
            form = str(output.form.dataset)
            image_counts = folder.copy(output.target.path, form, output.comment, advance)
    if output.form.dataset == "euroc":
        _describe(output, states, names)
    called = {kind: resolve_topic(tables_by_kind[kind].topic) for kind in names}
    counts = _rows(dataset, streams.READINGS, streams.TRUTH, called)
    return output.converted({**counts, **image_counts}, dataset.last_ns, lost)


def _folder_images(
    source: Path, images: str | None, skipped: Skipped | None
) -> AbstractContextManager[FolderImages | None]:
    """Return the images of a folder; None if it has none, or they are not wanted."""
    folders = text_reader.parents(source) if source.is_dir() else ()
    cameras = [name for folder in folders for name in text_reader.sensor_folders(folder, "cam")]
    if images == "none" or not cameras:
        return contextlib.nullcontext()
    from imu_sim_ros.datasets.recorded_folder import FolderImages  # with the cameras' modules

    return FolderImages(source, skipped)


def _describe(output: _Output, states: bool, tables: Collection[str]) -> None:
    """Write sensor.yaml files; values that the input does not have are left out."""

    def rate(name: str, table: Table | None = None) -> float:
        with contextlib.suppress(InputError, StopIteration):  # no usable row, or one
            t_ns = next(sensor_tables.stamps(output.target.path, name, table))
            return round(estimate_clock(t_ns).rate, 3)
        return 0.0

    folder, comment = output.target.path, output.comment
    pose = np.eye(3), np.zeros(3)
    text_writer.write_euroc_descriptions(folder, rate("imu0"), {}, *pose, comment, states)
    for kind in tables:
        table = reading_tables()[kind]
        text_writer.write_euroc_table(
            folder, table, 0, rate(f"{table.name}0", table), *pose, comment
        )


def _tally(writer: Writer) -> Counts:
    """Return the number of messages by topic, and the last stamp [ns]; -1: there are none."""
    counts = {topic.name: topic.count for topic in writer.topics}
    return counts, max((topic.last_ns for topic in writer.topics), default=-1)


def _rows(
    dataset: Dataset, readings: str, truth: str | None, tables: Mapping[str, str]
) -> dict[str, int]:
    """Return the number of rows by topic of a dataset."""
    counts = {name: dataset.tables[kind, 0].rows for kind, name in tables.items()}
    if dataset.imu is not None:
        counts[readings] = dataset.imu.rows
    if dataset.truth is not None and truth:
        counts[truth] = dataset.truth.rows
    return counts


def _tables_of_kinds(names: Mapping[str, str]) -> list[tuple[Table, str]]:
    """Return tables instead of their kinds."""
    tables_by_kind = reading_tables()
    return [(tables_by_kind[kind], name) for kind, name in names.items()]
