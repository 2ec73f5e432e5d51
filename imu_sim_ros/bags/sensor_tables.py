# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of the sensors next to an IMU, read from bags and folders, and written to bags.

Which sensors there are, the callers hand in: a :class:`~imu_sim_ros.inputs.tables.Table` for each.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.blocks import TopicInfo
from imu_sim_ros.bags.messages.decode import quaternions_wxyz
from imu_sim_ros.bags.messages.encode import ImuEncoder
from imu_sim_ros.bags.read import decode_blocks, open_bag, vector_blocks
from imu_sim_ros.bags.reader import Recover
from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.bags.writer import BagTopic, Block, Writer
from imu_sim_ros.core.bad_rows import Skipped, Warned
from imu_sim_ros.core.conventions import IMU_FRAME, IMU_TOPIC
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.inputs.tables import Encode, Table, Tables
from imu_sim_ros.recordings.order import order_stamps


class TableRows(NamedTuple):
    """n measurements of one kind."""

    t_ns: Times
    """(n,) stamps of the messages."""
    values: Array
    """(n, m) the numbers of a row of the table; an orientation is q_wi."""
    covariance: Array
    """(n, k, k) covariances of a sample's error, an orientation's about the world's axes; 0:
    unknown."""


_TRUTH: Final = "ground_truth/"


def blocks(
    path: Path,
    table: Table,
    topic: str | None,
    recover: Recover = False,
    skipped: Skipped | None = None,
    warned: Warned | None = None,
) -> Iterator[TableRows]:
    """Yield measurements in blocks of bounded size; messages without an orientation are left out.

    :param topic: topic of a bag, None: the only one; of a folder: a table's name and number, mag0.
    :param recover: as for :func:`imu_sim_ros.bags.read.open_bag`.
    :param skipped, warned: as for :func:`imu_sim_ros.bags.read.imu_blocks`.
    :raises InputError: for an input that cannot be used.
    """
    size = 3 if table.columns > 1 else 1
    if text_reader.is_text(path):
        name = topic or f"{table.name}0"
        for t_ns, values in text_reader.table_blocks(path, name, table, skipped):
            yield TableRows(t_ns, values, np.zeros((len(t_ns), size, size)))
        return
    decoded_stream = decode_blocks(path, table.type, topic, table.fields, recover, skipped, warned)
    for decoded in decoded_stream:
        values, *covariances = decoded.numbers.values()
        values = values.reshape(-1, table.columns)
        t_ns = decoded.t_ns
        covariance = covariances[0] if covariances else np.zeros((len(t_ns), size, size))
        covariance = covariance.reshape(-1, size, size)
        if table.of_readings:
            values = quaternions_wxyz(values)
            has_orientation = covariance[:, 0, 0] >= 0.0  # -1: there is no orientation (REP-145)
            t_ns, values, covariance = (
                t_ns[has_orientation],
                values[has_orientation],
                covariance[has_orientation],
            )
        yield TableRows(t_ns, values, covariance)


def stamps(folder: Path, name: str, table: Table | None) -> Iterator[Times]:
    """Yield the stamps of a table of a folder in blocks: of mag0 and so on.

    :param table: kind of the table; None: readings of an IMU, imu0.
    """
    if table is None:
        return (readings.t_ns for readings in text_reader.imu_blocks(folder, name))
    return (block[0] for block in text_reader.table_blocks(folder, name, table))


def read_table(
    path: str | Path, table: Table, topic: str | None = None, skipped: Skipped | None = None
) -> TableRows:
    """Return all measurements; arguments as for :func:`blocks`."""
    parts = list(blocks(Path(path), table, topic, skipped=skipped))
    if not parts:
        none = TableRows(np.empty(0, np.int64), np.empty((0, table.columns)), np.empty((0, 3, 3)))
        parts = [none]
    return TableRows(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def read_measured(
    path: str | Path, table: Table, topic: str | None = None, skipped: Skipped | None = None
) -> tuple[Times, Array]:
    """Return stamps (n,) and values (n, m) of a topic of readings, or of a folder's table.

    If a bag has the truth as well, the readings are meant.
    """
    if topic is None and not text_reader.is_text(Path(path)):
        with open_bag(path) as bag:
            names = [info.name for info in bag.topics if info.type == table.type]
        measured = [name for name in names if _TRUTH not in name]
        topic = measured[0] if len(measured) == 1 else None
    return read_table(path, table, topic, skipped)[:2]


def table_of(path: Path, topic: str, tables: Tables) -> Table | None:
    """Return the kind of a topic of a bag, or of a table of a folder; None: another, or none."""
    if text_reader.is_text(path):
        kind = text_reader.table_names(path, tables).get(topic)
        return None if kind is None else tables[kind]
    with open_bag(path) as bag:
        info = bag.find(topic)
    converted = (table for table in tables.values() if table.is_converted)
    return next((table for table in converted if info and table.type == info.type), None)


class Truths(NamedTuple):
    """Topics of the truth of a sensor."""

    ideal: str
    bias: str


def truths_of(table: Table, topic: str) -> Truths:
    """Return the topics of the truth next to one of readings, in the same namespace.

    :raises InputError: for a sensor that has none.
    """
    if table.truths is None:
        raise InputError(f"{topic}: there is no topic of its truth")
    topic_name = "/" + topic.lstrip("/")
    space = topic_name.removesuffix(table.topic) if topic_name.endswith("/" + table.topic) else "/"
    ideal, bias = table.truths
    return Truths(space + ideal, space + bias)


def read_bias(path: str | Path, table: Table, topic: str) -> tuple[Times, Array]:
    """Return stamps (n,) and biases (n, m) of a sensor's topic of the truth."""
    if table.bias_type == table.type:
        return read_table(path, table, topic)[:2]
    parts = list(vector_blocks(path, topic))
    return (
        np.concatenate([np.empty(0, np.int64), *(part[0] for part in parts)]),
        np.concatenate([np.empty((0, 3)), *(part[1] for part in parts)]),
    )


def tables_of(topics: Iterable[TopicInfo], readings: str, tables: Tables) -> dict[str, TopicInfo]:
    """Return the topics that become tables other than the readings of an IMU, by kind.

    :param topics: the topics that are to be converted.
    :param readings: name of the IMU's topic: its own sensors have the same namespace. Another
        one is taken if it is the only one.
    """
    topics_by_table: dict[str, TopicInfo] = {}
    space = readings.removesuffix(IMU_TOPIC)
    for again in tables.values():
        space = space.removesuffix(again.topic) if again.of_readings else space
    for kind, table in tables.items():
        fitting = [
            topic for topic in topics if topic.type == table.type and _TRUTH not in topic.name
        ]
        if not table.is_converted:
            continue
        namesake = [topic for topic in fitting if topic.name == space + table.topic]
        if table.of_readings:
            fitting = []  # other readings may have none
        chosen = namesake or (fitting if len(fitting) == 1 else [])
        if chosen:
            topics_by_table[kind] = chosen[0]
    return topics_by_table


def streams_of_tables(
    path: Path,
    read_imu: Callable[[str | None, bool], Iterator[Readings]],
    writer: Writer,
    renamed: Mapping[str, str],
    imus: Sequence[str],
    skipped: Skipped | None,
    tables: Tables,
) -> list[Iterator[list[Block]]]:
    """Return the messages of all tables other than the readings of IMUs in a folder, in blocks.

    :param read_imu: yields the readings of an IMU, given its name and whether bad rows are counted.
    :param renamed: new names of topics by old ones.
    :param imus: names of the IMUs, imu0 and so on: of several, each has a namespace.
    """
    streams: list[Iterator[list[Block]]] = []
    names = text_reader.table_names(path, tables)
    for name, kind in names.items():
        table, imu = tables[kind], f"imu{name.removeprefix(kind)}"
        if not table.is_converted:
            continue
        alone = len(imus) == 1 and (imu in imus or list(names.values()).count(kind) == 1)
        if table.of_readings and imu not in imus:
            if not alone:
                raise InputError(f"{path}: {name}: there is no {imu} that it belongs to")
            imu = imus[0]
        space, frame = ("/", IMU_FRAME) if alone else (f"/{imu}/", f"{imu}_link")
        full = space + table.topic
        topic = writer.add_topic(renamed.get(full, full), table.type)
        if table.encoder is None:
            encoder = ImuEncoder(frame, writer.encoding)
            streams.append(
                _orientations(path, name, table, read_imu(imu, False), topic, encoder, skipped)
            )
        else:
            encode = table.encoder(frame, writer.encoding)
            streams.append(_measurements(path, name, table, topic, encode, skipped))
    return streams


def _measurements(
    path: Path, name: str, table: Table, topic: BagTopic, encode: Encode, skipped: Skipped | None
) -> Iterator[list[Block]]:
    """Yield the rows of a folder's table as messages."""
    for t_ns, values, _ in blocks(path, table, name, skipped=skipped):
        yield [Block(topic, t_ns, encode(t_ns, values))]


def _orientations(
    path: Path,
    name: str,
    table: Table,
    readings: Iterator[Readings],
    topic: BagTopic,
    encoder: ImuEncoder,
    skipped: Skipped | None,
) -> Iterator[list[Block]]:
    """Yield the readings again, with the orientations of equal stamps.

    :raises InputError: for a stamp that no reading has, unless bad rows are skipped.
    """
    t_ns, gyro, accel = np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3))
    for stamps, q_wi, _ in blocks(path, table, name, skipped=skipped):
        while not len(t_ns) or t_ns[-1] < stamps[-1]:
            following = next(readings, None)
            if following is None:
                break
            rows_in_order = np.concatenate(order_stamps(following.t_ns).pieces)
            following = following.rows(rows_in_order)
            remaining = slice(int(np.searchsorted(t_ns, stamps[0])), None)
            parts = zip((t_ns, gyro, accel), (following.t_ns, *following.triads()), strict=True)
            t_ns, gyro, accel = (
                np.concatenate([previous[remaining], added]) for previous, added in parts
            )
        rows = np.minimum(np.searchsorted(t_ns, stamps), len(t_ns) - 1)
        is_found = t_ns[rows] == stamps
        missing = stamps[~is_found]
        if len(missing):
            if skipped is None:
                raise InputError(
                    f"{path}: {name}: {len(missing)} stamps that no reading has, the "
                    f"first {missing[0]} ns"
                )
            skipped(len(missing))
        stamps, rows, q_wi = stamps[is_found], rows[is_found], q_wi[is_found]
        if len(stamps):
            readings_again = encoder.encode(stamps, gyro[rows], accel[rows], q_wi)
            yield [Block(topic, stamps, readings_again)]
