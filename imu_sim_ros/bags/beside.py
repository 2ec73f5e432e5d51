# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a board measures beside its IMU, of bags and folders: magnetic field, pressure, orientation.

A kind has a message in bags and a table in folders, by the names of ``bags.text.BESIDE``.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages.blocks import TopicInfo
from imu_sim_ros.bags.messages.decode import inside_order
from imu_sim_ros.bags.messages.encode import (
    FLUID_PRESSURE,
    IMU,
    MAGNETIC_FIELD,
    FluidPressureEncoder,
    ImuEncoder,
    MagneticFieldEncoder,
)
from imu_sim_ros.bags.read import decoded_blocks, open_bag, vector_blocks
from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.bags.writer import Block, Topic, Writer
from imu_sim_ros.conventions import (
    BAROMETER_BIAS_TOPIC,
    IDEAL_MAGNETIC_FIELD_TOPIC,
    IDEAL_PRESSURE_TOPIC,
    IMU_FRAME,
    IMU_TOPIC,
    MAGNETIC_FIELD_TOPIC,
    MAGNETOMETER_BIAS_TOPIC,
    ORIENTATION_TOPIC,
    PRESSURE_TOPIC,
)
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.rows import Skipped, Warned
from imu_sim_ros.types import Array, Times


class Beside(NamedTuple):
    """n measurements of one kind."""

    t_ns: Times
    """(n,) stamps of the messages."""
    values: Array
    """(n, m): field [T], pressure [Pa], orientation q_wi."""
    covariance: Array
    """(n, k, k) of a sample's error, an orientation's about the world's axes; 0: unknown."""


class _Kind(NamedTuple):
    type: str
    topic: str
    fields: tuple[str, str]
    columns: int


_KINDS: Final = {
    "mag": _Kind(
        MAGNETIC_FIELD, MAGNETIC_FIELD_TOPIC, ("magnetic_field", "magnetic_field_covariance"), 3
    ),
    "pressure": _Kind(FLUID_PRESSURE, PRESSURE_TOPIC, ("fluid_pressure", "variance"), 1),
    "orientation": _Kind(IMU, ORIENTATION_TOPIC, ("orientation", "orientation_covariance"), 4),
}
_TRUTHS: Final = {
    "mag": (IDEAL_MAGNETIC_FIELD_TOPIC, MAGNETOMETER_BIAS_TOPIC),
    "pressure": (IDEAL_PRESSURE_TOPIC, BAROMETER_BIAS_TOPIC),
}
_TRUTH: Final = "ground_truth/"


def blocks(
    path: Path,
    kind: str,
    topic: str | None,
    recover: bool = False,
    skipped: Skipped | None = None,
    warned: Warned | None = None,
) -> Iterator[Beside]:
    """Yield measurements in blocks of bounded size; messages without an orientation are left out.

    :param kind: a key of ``bags.text.BESIDE``.
    :param topic: of a bag, None: the only one; of a folder: a table, mag0.
    :param recover: as for :func:`imu_sim_ros.bags.read.open_bag`.
    :param skipped, warned: as for :func:`imu_sim_ros.bags.read.imu_blocks`.
    :raises InputError: for an input that cannot be used.
    """
    of = _KINDS[kind]
    size = 3 if of.columns > 1 else 1
    if text_reader.is_text(path):
        for t_ns, values in text_reader.beside_blocks(path, topic or f"{kind}0", skipped):
            yield Beside(t_ns, values, np.zeros((len(t_ns), size, size)))
        return
    for _, decoded in decoded_blocks(path, of.type, topic, of.fields, recover, skipped, warned):
        values, covariance = decoded.numbers.values()
        values = values.reshape(-1, of.columns)
        covariance = covariance.reshape(-1, size, size)
        t_ns = decoded.t_ns
        if kind == "orientation":
            values = inside_order(values)
            stated = covariance[:, 0, 0] >= 0.0  # -1: there is no orientation (REP-145)
            t_ns, values, covariance = t_ns[stated], values[stated], covariance[stated]
        yield Beside(t_ns, values, covariance)


def topic_of(kind: str) -> str:
    """Return the name of the only topic of a kind."""
    return "/" + _KINDS[kind].topic


def stamps(folder: Path, table: str) -> Iterator[Times]:
    """Yield the stamps of a table of a folder in blocks: of imu0, mag0 and so on."""
    of_imu = table not in text_reader.beside_names(folder)
    read = text_reader.imu_blocks if of_imu else text_reader.beside_blocks
    return (block[0] for block in read(folder, table))


def read_beside(
    path: str | Path, kind: str, topic: str | None = None, skipped: Skipped | None = None
) -> Beside:
    """Return all measurements; arguments as for :func:`blocks`."""
    parts = list(blocks(Path(path), kind, topic, skipped=skipped))
    if not parts:
        columns = _KINDS[kind].columns
        none = Beside(np.empty(0, np.int64), np.empty((0, columns)), np.empty((0, 3, 3)))
        parts = [none]
    return Beside(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def read_magnetic_field(
    path: str | Path, topic: str | None = None, skipped: Skipped | None = None
) -> tuple[Times, Array]:
    """Return stamps (n,) and fields (n, 3) [T] of a MagneticField topic, or of a folder's table.

    Where a bag has the true field as well, the readings are meant.
    """
    if topic is None and not text_reader.is_text(Path(path)):
        with open_bag(path) as bag:
            names = [info.name for info in bag.topics if info.type == MAGNETIC_FIELD]
        measured = [name for name in names if _TRUTH not in name]
        topic = measured[0] if len(measured) == 1 else None
    return read_beside(path, "mag", topic, skipped)[:2]


def kind_of(path: Path, topic: str) -> str | None:
    """Return the kind of a topic of a bag, or of a table of a folder; None: another, or none."""
    if text_reader.is_text(path):
        return text_reader.beside_names(path).get(topic)
    with open_bag(path) as bag:
        types = {info.name.lstrip("/"): info.type for info in bag.topics}
    found = types.get(topic.lstrip("/"))
    return next((kind for kind, of in _KINDS.items() if of.type == found), None)


class Truths(NamedTuple):
    """Topics of the truth of a sensor."""

    ideal: str
    bias: str


def truths_of(kind: str, topic: str) -> Truths:
    """Return the topics of the truth beside one of readings, in the same namespace.

    :param kind: mag or pressure.
    """
    own = "/" + topic.lstrip("/")
    space = own.removesuffix(_KINDS[kind].topic) if own.endswith("/" + _KINDS[kind].topic) else "/"
    ideal, bias = _TRUTHS[kind]
    return Truths(space + ideal, space + bias)


def read_bias(path: str | Path, kind: str, topic: str) -> tuple[Times, Array]:
    """Return stamps (n,) and biases (n, m) of a sensor's topic of the truth."""
    if kind == "pressure":
        return read_beside(path, kind, topic)[:2]
    parts = list(vector_blocks(path, topic))
    return (
        np.concatenate([np.empty(0, np.int64), *(part[0] for part in parts)]),
        np.concatenate([np.empty((0, 3)), *(part[1] for part in parts)]),
    )


def tables_of(topics: Iterable[TopicInfo], readings: str) -> dict[str, TopicInfo]:
    """Return the topics that become tables beside the readings of an IMU, by kind.

    :param topics: those that are to be converted.
    :param readings: name of the IMU's topic: its own magnetometer has the same namespace. Another
        one is taken where it is the only one.
    """
    found: dict[str, TopicInfo] = {}
    space = readings.removesuffix(IMU_TOPIC).removesuffix(ORIENTATION_TOPIC)
    for kind, of in _KINDS.items():
        fitting = [topic for topic in topics if topic.type == of.type and _TRUTH not in topic.name]
        own = [topic for topic in fitting if topic.name == space + of.topic]
        if kind == "orientation":
            fitting = []  # other readings may have none
        chosen = own or (fitting if len(fitting) == 1 else [])
        if chosen:
            found[kind] = chosen[0]
    return found


def streams_of_tables(
    path: Path,
    writer: Writer,
    renamed: Mapping[str, str],
    imus: Sequence[str],
    skipped: Skipped | None,
) -> list[Iterator[list[Block]]]:
    """Return the messages of all tables beside the readings of IMUs in a folder, in blocks.

    :param renamed: new names of topics by old ones.
    :param imus: names of the IMUs, imu0 and so on: of several, each has a namespace.
    """
    made: list[Iterator[list[Block]]] = []
    tables = text_reader.beside_names(path)
    for name, kind in tables.items():
        imu = f"imu{name.removeprefix(kind)}"
        alone = len(imus) == 1 and (imu in imus or list(tables.values()).count(kind) == 1)
        if kind == "orientation" and imu not in imus:
            if not alone:
                raise InputError(f"{path}: {name}: there is no {imu} that it belongs to")
            imu = imus[0]
        space, frame = ("/", IMU_FRAME) if alone else (f"/{imu}/", f"{imu}_link")
        full = space + _KINDS[kind].topic
        topic = writer.add_topic(renamed.get(full, full), _KINDS[kind].type)
        if kind == "orientation":
            messages = _orientations(path, name, imu, ImuEncoder(frame, writer.encoding), skipped)
        else:
            messages = _measurements(path, name, kind, frame, writer.encoding, skipped)
        made.append(_blocks_of(topic, messages))
    return made


def _blocks_of(
    topic: Topic, messages: Iterator[tuple[Times, NDArray[np.uint8]]]
) -> Iterator[list[Block]]:
    for t_ns, payloads in messages:
        yield [Block(topic, t_ns, payloads)]


def _measurements(
    path: Path, name: str, kind: str, frame: str, encoding: str, skipped: Skipped | None
) -> Iterator[tuple[Times, NDArray[np.uint8]]]:
    fields, pressures = MagneticFieldEncoder(frame, encoding), FluidPressureEncoder(frame, encoding)
    for t_ns, values, _ in blocks(path, kind, name, skipped=skipped):
        if kind == "mag":
            yield t_ns, fields.encode(t_ns, values)
        else:
            yield t_ns, pressures.encode(t_ns, values[:, 0])


def _orientations(
    path: Path, name: str, imu: str, encoder: ImuEncoder, skipped: Skipped | None
) -> Iterator[tuple[Times, NDArray[np.uint8]]]:
    """Yield the readings again, with the orientations of equal stamps.

    :raises InputError: for a stamp that no reading has, unless bad rows are skipped.
    """
    # The bad rows of the readings are counted where the readings themselves are read.
    uncounted = None if skipped is None else lambda _: None
    readings = text_reader.imu_blocks(path, imu, uncounted)
    t_ns, gyro, accel = np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3))
    for stamps, q_wi, _ in blocks(path, "orientation", name, skipped=skipped):
        while not len(t_ns) or t_ns[-1] < stamps[-1]:
            more = next(readings, None)
            if more is None:
                break
            kept = slice(int(np.searchsorted(t_ns, stamps[0])), None)
            parts = zip((t_ns, gyro, accel), more, strict=True)
            t_ns, gyro, accel = (np.concatenate([old[kept], new]) for old, new in parts)
        rows = np.minimum(np.searchsorted(t_ns, stamps), len(t_ns) - 1)
        found = t_ns[rows] == stamps
        missing = stamps[~found]
        if len(missing):
            if skipped is None:
                raise InputError(
                    f"{path}: {name}: {len(missing)} stamps that no reading of {imu} has, the "
                    f"first {missing[0]} ns"
                )
            skipped(len(missing))
        stamps, rows, q_wi = stamps[found], rows[found], q_wi[found]
        if len(stamps):
            yield stamps, encoder.encode(stamps, gyro[rows], accel[rows], 0.0, 0.0, q_wi)
