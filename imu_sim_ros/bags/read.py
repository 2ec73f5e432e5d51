# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags, EuRoC folders and CSV files as arrays."""

from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from imu_sim_ros.bags.files import open_bag
from imu_sim_ros.bags.messages import schemas
from imu_sim_ros.bags.messages.blocks import TopicInfo, as_list
from imu_sim_ros.bags.messages.decode import (
    Decoded,
    MessageGate,
    concatenate_blocks,
    decode_block,
    quaternions_wxyz,
)
from imu_sim_ros.bags.messages.encode import (
    IMU,
    ODOMETRY,
    TEMPERATURE,
    VECTOR3_STAMPED,
)
from imu_sim_ros.bags.messages.layouts import FIRST
from imu_sim_ros.bags.messages.schemas import Message
from imu_sim_ros.bags.reader import Bag, Recover, errors_naming
from imu_sim_ros.bags.text import reader as text_reader
from imu_sim_ros.core.bad_rows import Skipped, Warned
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings, States, concatenate
from imu_sim_ros.core.rotation import rotate
from imu_sim_ros.core.types import Array, Mask, Times
from imu_sim_ros.recordings.findings.catalogue import frame_findings
from imu_sim_ros.recordings.findings.roles import TopicFrames

__all__ = [
    "Bag",
    "TemperatureMessages",
    "TopicInfo",
    "decode_messages",
    "imu_blocks",
    "odometry_blocks",
    "open_bag",
    "read_imu",
    "read_odometry",
    "read_temperature",
    "vector_blocks",
]


_LEAST = 1000
"""Messages in a block."""
_IMU_FIELDS = (
    *("angular_velocity", "linear_acceleration"),
    *(f"angular_velocity_covariance{FIRST}", f"linear_acceleration_covariance{FIRST}"),
)
_ODOMETRY_FIELDS = (
    *("position", "orientation", "linear", "angular"),
    *("pose_covariance", "twist_covariance"),
)
_RATE_VARIANCE = 21
"""Place of the first variance of the angular rate in the covariance of a twist."""
_ROUNDING = 1e-12
"""Rounding error of the length of a quaternion that was written as a unit one."""


class TemperatureMessages(NamedTuple):
    """n temperatures."""

    t_ns: Times
    """(n,) stamps of the messages."""
    temperature: Array
    """(n,) degC."""


def decode_messages(bag: Bag, names: Collection[str]) -> Iterator[tuple[TopicInfo, Message]]:
    """Yield the messages of topics in the order of time, decoded one by one.

    For large ones, images for instance; readings have faster ways.

    :raises InputError: for messages that are not of their topic's type.
    """
    topics = [topic for topic in bag.topics if topic.name in names]
    with errors_naming(bag.path):
        decode = schemas.decoder([(topic.type, topic.schema) for topic in topics], bag.encoding)
    for group in bag.groups({topic.name for topic in topics}):
        for block in group:
            for payload in as_list(block.payloads) if block.topic in topics else ():
                with errors_naming(bag.path, f" ({block.topic.name})"):
                    message = decode(payload, block.topic.type)
                yield block.topic, message


def imu_blocks(
    path: str | Path,
    topic: str | None = None,
    recover: Recover = False,
    skipped: Skipped | None = None,
    warned: Warned | None = None,
    frame: str | None = None,
) -> Iterator[Readings]:
    """Yield the messages of an Imu topic in blocks of bounded size, in the order of record times.

    :param path: a bag, a EuRoC folder, or a CSV file in the form of EuRoC or kalibr.
    :param topic: None: the only one.
    :param recover: as for :func:`imu_sim_ros.bags.files.open_bag`.
    :param skipped: receives the number of bad rows or messages skipped; None: they are errors.
    :param warned: receives what is wrong with messages, which are not skipped then; text, which
        always can be mended, has no such way.
    :param frame: frame of the messages to read; None: the only one.
    :raises InputError: for an input that cannot be used; of several topics or frames all are
        listed.
    """
    if text_reader.is_text(Path(path)):
        yield from text_reader.imu_blocks(Path(path), topic, skipped)
        return
    chosen, presence = frame, TriadPresence(path, topic, skipped)
    for block in decode_blocks(path, IMU, topic, _IMU_FIELDS, recover, skipped, warned):
        fields = block
        chosen = fields.texts[0] if chosen is None else chosen
        if fields.frame_ids != (chosen,):
            fields = _select_frame(path, topic, fields, chosen, frame is not None)
        gyro, accel, *covariances = fields.numbers.values()
        unlike = presence.unlike(*covariances)
        if unlike.any():
            fields = fields.at(~unlike)
        if not len(fields.t_ns):
            continue
        gyro, accel, gyro_variance, accel_variance = fields.numbers.values()
        yield Readings.unchecked(
            t_ns=fields.t_ns,
            gyro=None if gyro_variance[0] == -1.0 else gyro,
            accel=None if accel_variance[0] == -1.0 else accel,
            frame_id=chosen,
            source=str(path),
        )


class TriadPresence:
    """Triads that the messages of a topic contain: all the same ones.

    A covariance that begins with -1 means that the triad is absent (sensor_msgs/Imu); its zeros
    are no readings.
    """

    def __init__(self, path: str | Path, topic: str | None, skipped: Skipped | None) -> None:
        """Initialise without messages; arguments as for :func:`imu_blocks`."""
        self._name = str(path) if topic is None else f"{path}: {topic}"
        self._skipped, self._count = skipped, 0
        self._absent = np.zeros(2, np.bool_)
        """(2,) True for a triad that most messages lack."""

    def unlike(self, gyro_covariance: Array, accel_covariance: Array) -> Mask:
        """Return (n,) True for messages without the triads of most messages at the start.

        :param gyro_covariance: (n,) first number of the covariance of each message.
        :param accel_covariance: (n,) the same of the accelerometer.
        :raises InputError: for such messages, unless bad messages are skipped.
        """
        absent = np.stack([gyro_covariance == -1.0, accel_covariance == -1.0], axis=1)
        if not self._count and len(absent):
            patterns, counts = np.unique(absent, axis=0, return_counts=True)
            self._absent = patterns[int(np.argmax(counts))]
        unlike: Mask = (absent != self._absent).any(axis=1)
        count, number = int(unlike.sum()), self._count
        self._count += len(absent)
        if count and self._skipped is None:
            row = int(np.argmax(unlike))
            raise InputError(
                f"{self._name}: message {number + row} has {_contents(absent[row])} (covariance "
                f"-1), most messages have {_contents(self._absent)}: record the triads together, "
                "or on topics of their own"
            )
        if count and self._skipped is not None:
            self._skipped(count)
        return unlike


def _contents(absent: Mask) -> str:
    """Return the names of the triads that a message contains; absent (2,): True if it does not."""
    names = [name for name, lacks in zip(TRIADS, absent.tolist(), strict=True) if not lacks]
    return {2: "both triads", 1: f"the {''.join(names)} alone"}.get(len(names), "no triad")


def _select_frame(
    path: str | Path, topic: str | None, fields: Decoded, frame: str, selected: bool
) -> Decoded:
    """Return the messages of one frame.

    :param selected: True if the user chose the frame; else other frames are refused.
    :raises InputError: for the messages of another frame.
    """
    if not selected:
        raise mixed_frames_error(path, topic)
    index = fields.frame_ids.index(frame) if frame in fields.frame_ids else -1
    return fields.at(fields.frames == index)


class MixedFramesError(InputError):
    """Readings of several frames on one topic, of which none was chosen."""

    topic: TopicFrames = TopicFrames("", {})
    """Frames, and the number of messages of each."""


def mixed_frames_error(path: str | Path, topic: str | None = None) -> MixedFramesError:
    """Return the error of readings of several frames on one topic of a bag."""
    name = str(path) if topic is None else f"{path}, {topic}"
    topic_frames = TopicFrames(name, imu_frames(path, topic))
    error = MixedFramesError([finding.sentence() for finding in frame_findings(topic_frames)])
    error.topic = topic_frames
    return error


def imu_frames(path: str | Path, topic: str | None = None) -> dict[str, int]:
    """Return the number of messages of each frame on an Imu topic of a bag."""
    counts: Counter[str] = Counter()
    for block in decode_blocks(path, IMU, topic, (), skipped=lambda count: None):
        for k, name in enumerate(block.frame_ids):
            counts[name] += int(np.count_nonzero(block.frames == k))
    return dict(counts)


def read_imu(
    path: str | Path, topic: str | None = None, skipped: Skipped | None = None
) -> Readings:
    """Return all messages of an Imu topic; arguments as for :func:`imu_blocks`."""
    empty = Readings(_no_times(), _no_rows(3), _no_rows(3), source=str(path))
    return concatenate(list(imu_blocks(path, topic, skipped=skipped)) or [empty])


def odometry_blocks(
    path: str | Path,
    topic: str | None = None,
    recover: Recover = False,
    skipped: Skipped | None = None,
    warned: Warned | None = None,
) -> Iterator[States]:
    """Yield the messages of an Odometry topic in blocks; arguments as for :func:`imu_blocks`.

    A half of the twist whose covariance begins with -1 is absent.
    """
    if text_reader.is_text(Path(path)):
        for states, _ in text_reader.state_blocks(Path(path), topic, skipped):
            yield states
        return
    for fields in decode_blocks(path, ODOMETRY, topic, _ODOMETRY_FIELDS, recover, skipped, warned):
        position, orientation, linear, angular, pose, twist = fields.numbers.values()
        q_wb = quaternions_wxyz(orientation)
        if warned is None:
            q_wb = _unit(q_wb)
        with np.errstate(over="ignore", invalid="ignore"):  # what is passed on with a warning
            velocity = rotate(q_wb, linear)
        frame_id, child_frame_id = fields.texts
        has_velocity = not (twist[:, 0] == -1.0).all()  # -1 in a variance: absent
        has_rate = not (twist[:, _RATE_VARIANCE] == -1.0).all()
        yield States.unchecked(
            t_ns=fields.t_ns,
            position=position,
            q_wb=q_wb,
            velocity=velocity if has_velocity else None,
            angular_velocity=angular if has_rate else None,
            covariance=pose.reshape(-1, 6, 6),
            twist_covariance=twist.reshape(-1, 6, 6),
            frame_id=frame_id,
            child_frame_id=child_frame_id,
            source=str(path),
        )


def read_odometry(
    path: str | Path, topic: str | None = None, skipped: Skipped | None = None
) -> States:
    """Return all messages of an Odometry topic, or the states of a EuRoC folder."""
    empty = States(_no_times(), _no_rows(3), _no_rows(4), _no_rows(3), _no_rows(3), str(path))
    return concatenate(list(odometry_blocks(path, topic, skipped=skipped)) or [empty])


def vector_blocks(
    path: str | Path, topic: str, recover: Recover = False, gated: bool = True
) -> Iterator[tuple[Times, Array]]:
    """Yield stamps (n,) and vectors (n, 3) of a Vector3Stamped topic in blocks.

    :param gated: False: yield impossible vectors, too.
    """
    warned = None if gated else bool
    names = ("vector",)
    for fields in decode_blocks(path, VECTOR3_STAMPED, topic, names, recover, None, warned):
        yield fields.t_ns, fields.numbers["vector"]


def read_temperature(
    path: str | Path, topic: str | None = None, skipped: Skipped | None = None
) -> TemperatureMessages:
    """Return all messages of a Temperature topic; arguments as for :func:`imu_blocks`."""
    parts = list(decode_blocks(path, TEMPERATURE, topic, ("temperature",), False, skipped))
    return TemperatureMessages(
        np.concatenate([_no_times(), *(part.t_ns for part in parts)]),
        np.concatenate([np.empty(0), *(part.numbers["temperature"] for part in parts)]),
    )


def decode_blocks(
    path: str | Path,
    type_name: str,
    topic: str | None,
    names: tuple[str, ...],
    recover: Recover = False,
    skipped: Skipped | None = None,
    warned: Warned | None = None,
) -> Iterator[Decoded]:
    """Yield some fields of the messages of a topic, in blocks of at least a thousand but the last.

    If a bag has images, a chunk of it holds a few readings, and the first perhaps one: too few to
    tell a rate from.

    :param topic: None: the only one of the type.
    :param names: names of the fields, as for :func:`imu_sim_ros.bags.messages.decode.decode_block`.
    :param skipped, warned: as for :func:`imu_blocks`.
    :raises InputError: in place of the last block, with the first messages that the gate refused.
    """
    with open_bag(path, recover) as bag:
        chosen = bag.topic(type_name, topic)
        gate = MessageGate(path, chosen.name, warned is not None)
        waiting: list[Decoded] = []
        count = 0
        for group in bag.groups({chosen.name}):
            for block in group:
                if block.topic.type != type_name:
                    continue
                fields = decode_block(block, bag.encoding, names)
                good = gate.good(fields)
                passed = fields if good is None else fields.at(good)
                if not len(passed.t_ns):
                    continue
                waiting.append(passed)
                count += len(passed.t_ns)
                if count >= _LEAST:
                    yield concatenate_blocks(waiting)
                    waiting, count = [], 0
    gate.settle(skipped, warned)
    if waiting:
        yield concatenate_blocks(waiting)


def _unit(q: Array) -> Array:
    """Return quaternions (n, 4) that the gate has passed with their lengths made 1."""
    length = np.linalg.norm(q, axis=1, keepdims=True)
    off = np.abs(length - 1.0) > _ROUNDING
    return np.where(off, q / length, q) if off.any() else q


def _no_times() -> Times:
    """Return no times: an empty array."""
    return np.empty(0, dtype=np.int64)


def _no_rows(columns: int) -> Array:
    """Return no rows of so many columns: an empty array."""
    return np.empty((0, columns))
