# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion between bags and datasets, block by block."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags import sensor_tables
from imu_sim_ros.bags.messages import schemas
from imu_sim_ros.bags.messages.blocks import MessageBlock, Payloads, TopicInfo, as_list
from imu_sim_ros.bags.messages.decode import MessageGate, transcode
from imu_sim_ros.bags.messages.edit import ImuEdit
from imu_sim_ros.bags.messages.encode import (
    IMU,
    ODOMETRY,
    PATH,
    POSE_STAMPED,
    POSE_WITH_COVARIANCE,
    TEMPERATURE,
    TRANSFORM_STAMPED,
    VECTOR3_STAMPED,
    ImuEncoder,
    OdometryEncoder,
    PoseStampedEncoder,
    TemperatureEncoder,
    Vector3StampedEncoder,
)
from imu_sim_ros.bags.messages.stamps import path_stamps, transform_stamps
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE
from imu_sim_ros.bags.read import odometry_blocks, open_bag, vector_blocks
from imu_sim_ros.bags.reader import Bag, Recover, errors_naming, suggest_topic
from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.bags.threads import prefetch
from imu_sim_ros.bags.writer import BagTopic, Block, Writer
from imu_sim_ros.core.bad_rows import Skipped, Warned
from imu_sim_ros.core.conventions import (
    ACCELEROMETER_BIAS_TOPIC,
    BODY_FRAME,
    GYROSCOPE_BIAS_TOPIC,
    IMU_FRAME,
    IMU_TOPIC,
    TEMPERATURE_TOPIC,
    TRUTH_POSE_TOPIC,
    TRUTH_TOPIC,
    WORLD_FRAME,
)
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings, States
from imu_sim_ros.core.rotation import rotate_inverse
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.inputs.poses import read_poses
from imu_sim_ros.inputs.tables import Table, Tables
from imu_sim_ros.recordings.record_times import RecordTimes

More = Callable[[MessageBlock], Sequence[Block]]
Observe = Callable[[str, Times, Times | None], object]
"""Receives the name of a source, stamps (n,) [ns], and the record times that order them; None:
they are in order."""
READINGS: Final = "/" + IMU_TOPIC
TEMPERATURES: Final = "/" + TEMPERATURE_TOPIC
POSES: Final = "/" + TRUTH_POSE_TOPIC
TRUTH: Final = "/" + TRUTH_TOPIC
GYRO_BIAS: Final = "/" + GYROSCOPE_BIAS_TOPIC
ACCEL_BIAS: Final = "/" + ACCELEROMETER_BIAS_TOPIC
_ORDERED: Final = (IMU, ODOMETRY, POSE_STAMPED, POSE_WITH_COVARIANCE, TRANSFORM_STAMPED)
"""Types of messages with readings or poses that have a stamp."""
_NO_RATES: Final = np.diag([0.0, 0.0, 0.0, -1.0, -1.0, -1.0])
"""Covariance of a twist whose angular half is absent."""


def ignore_stamps(source: str, t_ns: Times, record_ns: Times | None) -> None:
    """Do nothing with stamps."""


def select_topics(bag: Bag, names: Collection[str]) -> list[TopicInfo]:
    """Return the named topics of a bag, all if none is named.

    :raises InputError: with a line for every topic that the bag lacks.
    """
    topics_or_none = [bag.find(name) for name in names]
    lacking = [
        f"/{name.lstrip('/')}"
        for name, topic in zip(names, topics_or_none, strict=True)
        if topic is None
    ]
    if lacking:
        raise InputError(
            [
                f"{bag.path}: has no topic {name}; {suggest_topic(name, bag.topics)}"
                for name in lacking
            ]
        )
    topics = [topic for topic in topics_or_none if topic is not None]
    return topics if names else list(bag.topics)


def bag_to_bag(
    bag: Bag,
    writer: Writer,
    topics: Sequence[TopicInfo],
    renamed: Mapping[str, str],
    advance: Callable[[int], object],
    skipped: Skipped | None = None,
    warned: Warned | None = None,
    additional: More | None = None,
    ungated: str = "",
    edit: ImuEdit | None = None,
    observe: Observe = ignore_stamps,
) -> list[str]:
    """Copy topics of any type; bytes are unchanged if the encoding is.

    :param renamed: new names by old ones.
    :param advance: receives the number of messages copied.
    :param skipped, warned: as for :func:`imu_sim_ros.bags.read.imu_blocks`.
    :param additional: makes further messages for each block of messages, in a thread of its own.
    :param ungated: a topic whose messages are checked elsewhere.
    :param edit: units and frame of Imu messages; None: they are copied as they are.
    :param observe: receives the stamps of readings and poses.
    :returns: a line for each topic and type whose fields differ in the other generation of ROS.
    """
    translator = _translator(bag, writer, topics)
    handles, lines = _add_topics(bag, writer, topics, renamed, translator)
    gates = {
        info: MessageGate(
            bag.path,
            info.name,
            open_to_all=warned is not None,
            observe=(
                partial(observe, f"{bag.path}: {info.name}") if info.type in _ORDERED else None
            ),
        )
        for info in topics
    }
    order = _OrderInMessages(bag.path, bag.encoding, observe)
    groups = bag.groups({info.name for info in topics})
    for group, additional_blocks in _append_messages(groups, additional):
        # Groups may have messages of topics that are not copied.
        message_blocks = [block for block in group if block.topic in handles]
        for block in message_blocks:
            order.add(block)
        if edit is not None:
            message_blocks = [edit.apply(block, bag.encoding) for block in message_blocks]
        passing_blocks = [
            block
            if block.topic.name == ungated
            else gates[block.topic].passing_messages(block, bag.encoding)
            for block in message_blocks
            if len(block.t_ns)
        ]
        blocks = [
            Block(handles[block.topic], block.t_ns, translator.payloads(block))
            for block in passing_blocks
            if len(block.t_ns)
        ]
        writer.write_blocks([*blocks, *additional_blocks])
        advance(sum(len(block.t_ns) for block in blocks))
    for gate in gates.values():
        gate.settle(skipped, warned)
    order.finish()
    return lines


def _translator(bag: Bag, writer: Writer, topics: Sequence[TopicInfo]) -> "_Translator":
    """Return the translator of messages from the encoding of a bag to that of a writer.

    :raises InputError: with a line for each topic whose messages cannot be translated.
    """
    if bag.encoding == writer.encoding:
        return _Translator(writer.encoding)
    without_schema = [info for info in topics if not info.type and info.count]
    if without_schema:
        raise InputError(
            [
                f"{bag.path}: {info.name} has no schema, and cannot be translated; name the other "
                "topics"
                for info in without_schema
            ]
        )
    with errors_naming(bag.path):
        return _VersionTranslator(bag.encoding, writer.encoding, topics)


def _add_topics(
    bag: Bag,
    writer: Writer,
    topics: Sequence[TopicInfo],
    renamed: Mapping[str, str],
    translator: "_Translator",
) -> tuple[dict[TopicInfo, BagTopic], list[str]]:
    """Add the topics of a bag to a writer, in their order.

    :param renamed: new names by old ones.
    :returns: handle of each topic, and a line for each topic and type whose fields differ.
    """
    handles: dict[TopicInfo, BagTopic] = {}
    lines: list[str] = []
    for info in topics:
        name = renamed.get(info.name, info.name)
        schema = translator.schema(info)
        handles[info] = writer.add_topic(
            name, info.type, info.qos, schema, keeps_seq=bag.encoding == "ros1"
        )
        if info.count:
            lines += [f"{name}: {line}" for line in translator.differences(info)]
    return handles, lines


class _OrderInMessages:
    """Stamps within messages: of the transforms between two frames, and of a topic's last path."""

    def __init__(self, path: Path, encoding: str, observe: Observe) -> None:
        self._path, self._encoding, self._observe = path, encoding, observe
        self._paths: dict[str, tuple[int, bytes]] = {}
        """Record time [ns] and bytes of the last path, by topic."""

    def add(self, block: MessageBlock) -> None:
        """Add the next messages of a topic; those that are not of their type are left out."""
        name = block.topic.name
        if not len(block.t_ns) or self._observe is ignore_stamps:
            return
        if block.topic.type == PATH:
            record_ns = int(block.t_ns[-1])
            if name not in self._paths or self._paths[name][0] <= record_ns:
                self._paths[name] = record_ns, bytes(as_list(block.payloads)[-1])
        elif block.topic.type == TF_MESSAGE:
            for parent, child, rows, t_ns in transform_stamps(block.payloads, self._encoding):
                source = f"{self._path}: {name}:{parent}.{child}"
                self._observe(source, t_ns, block.t_ns[rows])

    def finish(self) -> None:
        """Observe the last paths."""
        for name, (_, payload) in self._paths.items():
            with suppress(ValueError):
                t_ns = path_stamps(payload, self._encoding)
                if len(t_ns):
                    self._observe(f"{self._path}: {name}", t_ns, None)


def _append_messages(
    groups: Iterator[list[MessageBlock]], additional: More | None
) -> Iterator[tuple[list[MessageBlock], list[Block]]]:
    """Yield groups, each with its further messages."""
    if additional is None:
        return ((group, []) for group in groups)
    return prefetch(
        (group, [extra_block for block in group for extra_block in additional(block)])
        for group in groups
    )


class _Translator:
    """Messages and definitions unchanged."""

    def __init__(self, encoding: str) -> None:
        self._encoding = encoding

    def schema(self, info: TopicInfo) -> schemas.Schema:
        """Return the definition for the new bag."""
        standard_fields = schemas.typestore_of_format(self._encoding).fielddefs
        if not info.schema.text and info.type in standard_fields:
            return schemas.schema(info.type, self._encoding)
        return info.schema

    def differences(self, info: TopicInfo) -> list[str]:
        """Return a line for each type within a topic's whose fields differ in the new bag."""
        return []

    def payloads(self, block: MessageBlock) -> Payloads:
        """Return the messages for the new bag."""
        return block.payloads


class _VersionTranslator(_Translator):
    """Messages and definitions translated between ROS 1 and ROS 2."""

    def __init__(self, source: str, target: str, topics: Sequence[TopicInfo]) -> None:
        super().__init__(target)
        self._source = source
        self._types = schemas.typestore([(info.type, info.schema) for info in topics], source)
        self._translation = schemas.Translation(self._types, target)
        self._convert = cache(self._translation.converter)

    def schema(self, info: TopicInfo) -> schemas.Schema:
        """Return the definition in the other ROS version's form."""
        return schemas.schema(info.type, self._encoding, self._translation.target_types)

    def differences(self, info: TopicInfo) -> list[str]:
        """Return a line for each type within a topic's whose fields differ."""
        return self._translation.differences(info.type)

    def payloads(self, block: MessageBlock) -> Payloads:
        """Return the messages in the other encoding."""
        payloads = transcode(block, self._source, self._encoding)
        if payloads is not None:  # a type with a fixed layout, translated as a block
            return payloads
        with errors_naming(Path(block.topic.name)):
            convert = self._convert(block.topic.type)
            return [bytes(convert(message)) for message in as_list(block.payloads)]


ReadImu = Callable[[str | None, bool], Iterator[Readings]]
"""Yields the readings of an IMU of a folder, by its name, None: the only one; True: its bad rows
are counted."""


def text_to_bag(
    path: Path,
    read_imu: ReadImu,
    writer: Writer,
    renamed: Mapping[str, str],
    advance: Callable[[int], object],
    skipped: Skipped | None = None,
    frames: Sequence[Iterator[list[Block]]] = (),
    tables: Tables = MappingProxyType({}),
    observe: Observe = ignore_stamps,
) -> None:
    """Copy a EuRoC folder or a CSV file: readings, and the other tables of a folder.

    The other tables are those of sensors; truth and biases if there are states.

    Several IMUs have a namespace each, as in ``generate``: ``/imu1/imu/data_raw``. The poses of a
    motion capture system, as TUM VI has them, are a topic of poses. Record times are the stamps;
    where the stamps of readings go back, they are those of :class:`RecordTimes`.

    :param read_imu: yields the readings of the IMUs.
    :param skipped: as for :func:`imu_sim_ros.bags.read.imu_blocks`.
    :param frames: more streams in time order, of cameras; the blocks of one item have the same
        times.
    :param tables: tables of other sensors that are looked for.
    :param observe: receives the stamps of readings, states and poses.
    """
    names = text_reader.imu_names(path)
    streams = [
        _reading_messages(read_imu(name, True), writer, renamed, name, observe)
        for name in (names if len(names) > 1 else [None])
    ]
    streams += sensor_tables.streams_of_tables(
        path, read_imu, writer, renamed, names, skipped, tables
    )
    if text_reader.has_states(path):
        streams.append(_state_messages(path, writer, renamed, skipped, observe))
    elif (poses := text_reader.pose_file(path)) is not None:
        streams.append(_pose_messages(poses, writer, renamed, skipped, observe))
    for blocks in _interleave([*streams, *frames]):
        writer.write_blocks(blocks)
        advance(sum(len(block.t_ns) for block in blocks))


def holds_poses(path: Path) -> bool:
    """Return whether a text file is one of poses: by its name, unless it has readings."""
    return path.suffix.lower() in (".tum", ".txt") and not text_reader.has_states(path)


def poses_to_bag(
    poses: States,
    writer: Writer,
    renamed: Mapping[str, str],
    advance: Callable[[int], object],
) -> None:
    """Write poses as a topic of poses."""
    encoder = PoseStampedEncoder(WORLD_FRAME, writer.encoding)
    topic = writer.add_topic(renamed.get(POSES, POSES), POSE_STAMPED)
    payloads = encoder.encode(poses.t_ns, poses.position, poses.q_wb)
    writer.write(topic, poses.t_ns, payloads)
    advance(len(poses.t_ns))


def _reading_messages(
    blocks: Iterator[Readings],
    writer: Writer,
    renamed: Mapping[str, str],
    imu: str | None,
    observe: Observe,
) -> Iterator[list[Block]]:
    """Yield readings and, if the table has them, temperatures of the sensor."""
    space, frame = ("", IMU_FRAME) if imu is None else (f"/{imu}", f"{imu}_link")
    encoder, record_times = ImuEncoder(frame, writer.encoding), RecordTimes()
    temperature_encoder = TemperatureEncoder(frame, writer.encoding)
    readings_name, temperature_name = space + READINGS, space + TEMPERATURES
    topic = writer.add_topic(renamed.get(readings_name, readings_name), IMU)
    temperature_topic = None
    for readings in blocks:
        observe(
            readings.source if imu is None else f"{readings.source}: {imu}", readings.t_ns, None
        )
        payloads = encoder.encode(readings.t_ns, *readings.triads())
        times_ns = record_times.of(readings.t_ns)
        messages = [Block(topic, times_ns, payloads)]
        if readings.temperature is not None:
            if temperature_topic is None:
                temperature_topic = writer.add_topic(
                    renamed.get(temperature_name, temperature_name), TEMPERATURE
                )
            has_temperature = np.isfinite(readings.temperature)
            payloads = temperature_encoder.encode(
                readings.t_ns[has_temperature], readings.temperature[has_temperature]
            )
            messages.append(Block(temperature_topic, times_ns[has_temperature], payloads))
        yield messages


def _state_messages(
    path: Path,
    writer: Writer,
    renamed: Mapping[str, str],
    skipped: Skipped | None,
    observe: Observe,
) -> Iterator[list[Block]]:
    """Yield the true states of a folder or file as Odometry, and the biases as vectors."""
    odometry = OdometryEncoder(WORLD_FRAME, BODY_FRAME, writer.encoding)
    vectors = Vector3StampedEncoder(IMU_FRAME, writer.encoding)
    truth, gyro, accel = (
        writer.add_topic(renamed.get(name, name), type_name)
        for name, type_name in (
            (TRUTH, ODOMETRY),
            (GYRO_BIAS, VECTOR3_STAMPED),
            (ACCEL_BIAS, VECTOR3_STAMPED),
        )
    )
    for states, biases in text_reader.state_blocks(path, skipped=skipped):
        t_ns, position, q_wb = states.t_ns, states.position, states.q_wb
        observe(f"{path}: {TRUTH}", t_ns, None)
        velocity_b = rotate_inverse(q_wb, states.velocities())
        rates, covariance = states.angular_velocity, None
        if rates is None:  # EuRoC's states have none
            rates, covariance = np.zeros_like(velocity_b), _NO_RATES
        truth_row = odometry.encode(
            t_ns, position, q_wb, velocity_b, rates, twist_covariance=covariance
        )
        yield [
            Block(truth, t_ns, truth_row),
            Block(gyro, t_ns, vectors.encode(t_ns, biases[:, :3])),
            Block(accel, t_ns, vectors.encode(t_ns, biases[:, 3:])),
        ]


def _pose_messages(
    path: Path,
    writer: Writer,
    renamed: Mapping[str, str],
    skipped: Skipped | None,
    observe: Observe,
) -> Iterator[list[Block]]:
    """Yield the poses of a text file as messages of PoseStamped."""
    poses = read_poses(path, skip_bad_rows=skipped is not None)
    if skipped is not None and poses.skipped:
        skipped(poses.skipped)
    observe(str(path), poses.t_ns, None)
    encoder = PoseStampedEncoder(WORLD_FRAME, writer.encoding)
    topic = writer.add_topic(renamed.get(POSES, POSES), POSE_STAMPED)
    payloads = encoder.encode(poses.t_ns, poses.position, poses.q_wb)
    yield [Block(topic, poses.t_ns, payloads)]


def _interleave(streams: Sequence[Iterator[list[Block]]]) -> Iterator[list[Block]]:
    """Merge streams of blocks in time order.

    The first block of an item has all of its times, the others some or all of these.
    """
    waiting: list[list[Block] | None] = [next(stream, None) for stream in streams]
    while any(waiting):
        end_ns = min(int(blocks[0].t_ns[-1]) for blocks in waiting if blocks)
        ready: list[Block] = []
        for k, blocks in enumerate(waiting):
            if not blocks:
                continue
            cuts = [int(np.searchsorted(b.t_ns, end_ns, side="right")) for b in blocks]
            parts = list(zip(blocks, cuts, strict=True))
            ready += [Block(b.topic, b.t_ns[:cut], b.payloads[:cut]) for b, cut in parts]
            rest = [Block(b.topic, b.t_ns[cut:], b.payloads[cut:]) for b, cut in parts]
            waiting[k] = rest if len(rest[0].t_ns) else next(streams[k], None)
        yield ready


def to_dataset(
    path: Path,
    imu: Iterator[Readings],
    dataset: Dataset,
    truth: str | None,
    advance: Callable[[int], object],
    recover: Recover = False,
    skipped: Skipped | None = None,
    tables: Sequence[tuple[Table, str]] = (),
    warned: Warned | None = None,
    observe: Observe = ignore_stamps,
) -> None:
    """Copy readings, other tables and truth of a bag or a dataset into text.

    :param path: bag or dataset that is read.
    :param imu: blocks of the readings.
    :param dataset: text that is written.
    :param truth: topic of Odometry; None: the only topic of that type.
    :param advance: receives the number of rows after each block.
    :param tables: other tables, each with its topic in the bag or its name in the dataset.
    :param skipped, warned: as for :func:`imu_sim_ros.bags.read.imu_blocks`.
    :param observe: receives the stamps of readings and truth.
    """
    if dataset.imu is not None:
        for readings in imu:
            observe(readings.source, readings.t_ns, None)
            dataset.write_imu(readings.t_ns, *readings.triads())
            advance(len(readings.t_ns))
    for table, name in tables:
        for measured in sensor_tables.blocks(path, table, name, recover, skipped, warned):
            dataset.write_table(table.name, 0, measured.t_ns, measured.values)
            advance(len(measured.t_ns))
    if dataset.truth is not None:
        for states, biases in _states(path, truth, recover, skipped, warned):
            observe(f"{path}: {truth or TRUTH}", states.t_ns, None)
            dataset.write_states(states, biases)
            advance(len(states.t_ns))


def _states(
    path: Path,
    topic: str | None,
    recover: Recover,
    skipped: Skipped | None,
    warned: Warned | None,
) -> Iterator[tuple[States, Array]]:
    """Yield true states and biases (n, 6) of a bag or a dataset, in blocks.

    Biases are those of the gyroscope [rad/s] and the accelerometer [m/s^2].
    """
    if text_reader.is_text(path):
        yield from text_reader.state_blocks(path, skipped=skipped)
        return
    bias_readers = [BiasTopicReader(path, name, topic, recover) for name in (GYRO_BIAS, ACCEL_BIAS)]
    for states in odometry_blocks(path, topic, recover, skipped, warned):
        biases = [reader.at(states.t_ns) for reader in bias_readers]
        yield states, np.concatenate(biases, axis=1)


class BiasTopicReader:
    """A topic of vectors that is read in step with another one; zero if the bag has none."""

    def __init__(self, path: Path, name: str, truth_topic: str | None, recover: Recover) -> None:
        with open_bag(path, recover) as bag:
            counts = {topic.name: topic.count for topic in bag.topics if topic.name == name}
            truth = bag.topic(ODOMETRY, truth_topic).count
        has_biases = counts.get(name, -1) == truth
        self._blocks = vector_blocks(path, name, recover, gated=False) if has_biases else None
        self._t_ns, self._vectors = np.empty(0, dtype=np.int64), np.empty((0, 3))

    def at(self, t_ns: Times) -> Array:
        """Return the vectors (n, 3) of the next times; there may be others between them.

        :raises InputError: if the topic has different times.
        """
        if self._blocks is None:
            return np.zeros((len(t_ns), 3))
        while not np.isin(t_ns[-1:], self._t_ns).all():
            block = next(self._blocks, None)
            if block is None:
                break
            block_t_ns, vectors = block
            self._t_ns = np.concatenate([self._t_ns, block_t_ns])
            self._vectors = np.concatenate([self._vectors, vectors])
        rows = _rows_of(t_ns, self._t_ns)
        vectors = self._vectors[rows]
        self._t_ns, self._vectors = self._t_ns[rows[-1] + 1 :], self._vectors[rows[-1] + 1 :]
        return vectors


def _rows_of(t_ns: Times, among: Times) -> NDArray[np.intp]:
    """Return the rows (n,) of times among other ones, in the same order.

    :raises InputError: if one of the times is not among them.
    """
    if len(among) >= len(t_ns) and np.array_equal(among[: len(t_ns)], t_ns):
        return np.arange(len(t_ns))
    rows = np.flatnonzero(np.isin(among, t_ns))
    if not np.array_equal(among[rows], t_ns):
        raise InputError("the biases have different stamps from the truth")
    return rows
