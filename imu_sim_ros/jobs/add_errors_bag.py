# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag of ideal readings with those of a sensor next to them; every other message stays."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from imu_sim_ros.bags import convert
from imu_sim_ros.bags.messages.blocks import MessageBlock, TopicInfo
from imu_sim_ros.bags.messages.decode import (
    Decoded,
    concatenate_blocks,
    decode_block,
    quaternions_wxyz,
)
from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY
from imu_sim_ros.bags.messages.layouts import FIRST
from imu_sim_ros.bags.read import TriadPresence, mixed_frames_error, odometry_blocks
from imu_sim_ros.bags.reader import Bag, errors_naming
from imu_sim_ros.bags.threads import prefetch
from imu_sim_ros.bags.writer import Block, Writer
from imu_sim_ros.core import gate
from imu_sim_ros.core.bad_rows import BadRows, Skipped, Warned
from imu_sim_ros.core.conventions import (
    ACCELEROMETER_BIAS_TOPIC,
    GYROSCOPE_BIAS_TOPIC,
    IDEAL_IMU_TOPIC,
    IMU_TOPIC,
    TRIADS,
    TWIST_FRAMES,
)
from imu_sim_ros.core.errors import ConfigurationError, InputError, name_source
from imu_sim_ros.core.records import Readings, absent_triad_line, concatenate, replace_fields
from imu_sim_ros.core.rotation import rotate_inverse
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.types import Array
from imu_sim_ros.jobs.add_errors import rounded_rate, tell_strays
from imu_sim_ros.recordings.clock import repeated_value_rows
from imu_sim_ros.recordings.findings.catalogue import twist_findings
from imu_sim_ros.simulation.error_input import Differentiator
from imu_sim_ros.simulation.error_model import GivenImu
from imu_sim_ros.simulation.error_parameters import ErrorModelParameters
from imu_sim_ros.simulation.sensors import mount_sensors
from imu_sim_ros.simulation.topics import resolve_topic, sensor_topics

USUAL: Final = (IMU_TOPIC, GYROSCOPE_BIAS_TOPIC, ACCELEROMETER_BIAS_TOPIC)
_READING: Final = ("angular_velocity", "linear_acceleration")
_COVARIANCES: Final = tuple(f"{name}_covariance{FIRST}" for name in _READING)
_ORIENTED: Final = (*_READING, "orientation", "orientation_covariance")
_STATE: Final = ("orientation", "linear", "angular")
_FIRST: Final = 2000
"""Stamps from which a rate is taken."""
_COMPARED: Final = 20_000
"""Messages of odometry whose twist is compared with their poses."""


def source_topic(bag: Bag, name: str | None) -> TopicInfo:
    """Return the topic of ideal readings, or of odometry if it is named.

    :raises InputError: if there is none, or several.
    """
    matches = [t for t in bag.topics if name and t.name.lstrip("/") == name.lstrip("/")]
    if matches and matches[0].type == ODOMETRY:
        return matches[0]
    return bag.topic(IMU, name)


def _first_messages(bag: Bag, source: TopicInfo) -> Decoded | None:
    """Return the first messages of a topic, two vectors of each; None: it has none."""
    fields = _READING if source.type == IMU else _STATE[1:]
    decoded: list[Decoded] = []
    for group in bag.groups({source.name}):
        decoded += [_decode(bag, block, fields) for block in group if len(block.t_ns)]
        if sum(len(messages.t_ns) for messages in decoded) > _FIRST:
            break
    return concatenate_blocks(decoded) if decoded else None


def topic_rate(bag: Bag, source: TopicInfo) -> float:
    """Return the readings per second of a topic [Hz].

    :raises InputError: if there are fewer than two.
    :raises ConfigurationError: for stamps that are equal or no nanoseconds.
    """
    messages = _first_messages(bag, source)
    if messages is None or len(messages.t_ns) < 2:
        raise InputError(
            f"{bag.path}: {source.name}: fewer than two readings; {argument('rate')} is needed"
        )
    with name_source(f"{bag.path}: {source.name}", ConfigurationError):
        unchanged = repeated_value_rows(*messages.numbers.values())
        return rounded_rate(
            messages.t_ns[:_FIRST], None if unchanged is None else unchanged[:_FIRST]
        )


def twist_warnings(bag: Bag, source: TopicInfo, twist_frame: str) -> Iterator[str]:
    """Yield a line if the twist of odometry contradicts the poses in the same messages.

    :param source: a topic of odometry; its first messages, up to 20,000, are compared.
    :param twist_frame: axes of the twist, body or world.
    :raises InputError: for a twist whose covariance marks it as absent.
    """
    blocks, count = [], 0
    for states in odometry_blocks(bag.path, source.name, warned=bool):
        blocks.append(states)
        count += len(states)
        if count >= _COMPARED:
            break
    if blocks:
        compared = replace_fields(concatenate(blocks), source=f"{bag.path}, {source.name}")
        halves = compared.velocities(), compared.body_rates()
        if twist_frame == TWIST_FRAMES[1]:  # the blocks are those of a twist in the body's axes
            turned = (rotate_inverse(compared.q_wb, half) for half in halves)
            compared = replace_fields(
                compared, **dict(zip(("velocity", "angular_velocity"), turned, strict=True))
            )
        for finding in twist_findings(compared):
            yield finding.sentence()


def names_in(
    bag: Bag,
    source: TopicInfo,
    copied: Sequence[TopicInfo],
    added: Sequence[str],
    renamed: Mapping[str, str],
) -> tuple[dict[str, str], dict[str, str]]:
    """Return the new topics, each with its name, and new names of those that are copied.

    Ideal readings that have the name of the new ones become ``ground_truth/imu``.

    :param renamed: new names by old ones, as the user gives them, without slashes in front.
    :raises InputError: with a line for each name that there would be twice.
    """
    output_names = {key: resolve_topic(renamed.get(key, key)) for key in added}
    renames = {
        topic.name: resolve_topic(renamed[topic.name.lstrip("/")])
        for topic in copied
        if topic.name.lstrip("/") in renamed and topic.name.lstrip("/") not in added
    }
    if source in copied and source.name in output_names.values():
        renames[source.name] = resolve_topic(IDEAL_IMU_TOPIC)
    copied_names = [renames.get(topic.name, topic.name) for topic in copied]
    problems = [
        f"{bag.path}: has a topic {name}; {argument('rename', {key: 'NEW'})} gives the new one "
        f"another name, {argument('without', name)} leaves the old one out"
        for key, name in output_names.items()
        if name in copied_names
    ]
    all_names = [*copied_names, *output_names.values()]
    twice = {name for name in all_names if all_names.count(name) > 1} - set(output_names.values())
    problems += [f"{bag.path}: two topics would be {name}" for name in sorted(twice)]
    if problems:
        raise InputError(problems)
    return output_names, renames


class BagErrors:
    """Errors on the readings of one topic, as the blocks of messages come by."""

    def __init__(
        self,
        bag: Bag,
        source: TopicInfo,
        parameters: ErrorModelParameters,
        names: Mapping[str, str],
        remark: Callable[[str], object],
    ) -> None:
        """Set up the sensor.

        :param names: names of :data:`OF_THE_ERROR_MODEL`, each with its name in the new bag.
        :param remark: receives what looks like a mistake, a line each.
        """
        self._bag, self._source, self._parameters, self._names = bag, source, parameters, names
        self._offered, self._remark = sensor_topics(mount_sensors(parameters)), remark
        sensors = {self._offered[name].name for name in names}
        self.model = GivenImu(parameters, sensors, remark)
        self._odometry = Differentiator(parameters) if source.type == ODOMETRY else None
        imu_fields = _ORIENTED if self.model.uses_orientation else _READING
        self._fields = imu_fields if self._odometry is None else _STATE
        self._bad = BadRows(f"{bag.path}: {source.name}", "message")
        self._presence = TriadPresence(bag.path, source.name, skipped=None)
        self._seen = 0
        self._frame: str | None = None
        """Frame of the readings; None before the first."""

    def write(
        self,
        writer: Writer,
        copied: Sequence[TopicInfo],
        renamed: Mapping[str, str],
        advance: Callable[[int], object],
        skipped: Skipped | None,
        warned: Warned | None,
    ) -> None:
        """Copy topics, with the sensor's next to them.

        :param skipped: receives how many readings were left out; None: they are errors.
        :param warned: receives what is wrong with messages that are copied.
        :raises InputError: for readings that no sensor gives.
        """
        self._outputs = []
        for key, name in self._names.items():
            output = self._offered[key]
            topic = writer.add_topic(name, output.topic.type)
            self._outputs.append((topic, output.name, output.encoder(writer.encoding)))
        topics = [*copied, *([] if self._source in copied else [self._source])]
        if self._source in copied:
            append_blocks, name = self._sensor_messages, self._source.name
            lines = convert.bag_to_bag(
                self._bag, writer, topics, renamed, advance, None, warned, append_blocks, name
            )
        else:
            lines = self._write_without_source(writer, copied, renamed, advance, warned)
        self.model.finish()
        for line in lines:
            self._remark(line)
        if skipped is not None and self._bad.rows:
            skipped(self._bad.rows)
        elif self._bad.rows:
            self._bad.complain()

    def _write_without_source(
        self,
        writer: Writer,
        copied: Sequence[TopicInfo],
        renamed: Mapping[str, str],
        advance: Callable[[int], object],
        warned: Warned | None,
    ) -> list[str]:
        """Write the sensor's topics, then copy the others; bags are ordered when they are read.

        :param copied: topics to copy; ``renamed``: new names by old ones.
        :param advance: receives the number of messages of the source that are done.
        :param warned: receives the number of bad messages, which are copied.
        :returns: a line for each topic and type whose fields differ in the output.
        """
        groups = self._bag.groups({self._source.name})
        batches = (
            (self._sensor_messages(block), len(block.t_ns)) for group in groups for block in group
        )
        for blocks, count in prefetch(batches):
            writer.write_blocks(blocks)
            advance(count)
        if not copied:
            return []
        return convert.bag_to_bag(self._bag, writer, copied, renamed, advance, None, warned)

    def _sensor_messages(self, block: MessageBlock) -> list[Block]:
        """Return the sensor's messages for some of the ideal ones."""
        if block.topic is not self._source or not len(block.t_ns):
            return []
        decoded = _decode(self._bag, block, self._fields)
        if self._odometry is None:
            self._check_triads(block)
            self._frame = decoded.frame_ids[0] if self._frame is None else self._frame
            if decoded.frame_ids != (self._frame,):
                raise mixed_frames_error(self._bag.path, self._source.name)
        blocks = []
        # What was recorded late is so by as much next to it; nothing is before 1970.
        late_ns = int(np.median(block.t_ns - decoded.t_ns))
        for readings in self._pass_gate(decoded):
            for window in self.model.read(readings):
                for topic, sensor, encode in self._outputs:
                    messages = encode(window[sensor], self._parameters)
                    if len(messages.record_t_ns):
                        recorded = np.maximum(messages.record_t_ns + late_ns, 0)
                        blocks.append(Block(topic, recorded, messages.made()))
        return blocks

    def _check_triads(self, block: MessageBlock) -> None:
        """Refuse messages that mark a triad as absent.

        :raises InputError: with what helps.
        """
        columns = _decode(self._bag, block, _COVARIANCES).numbers
        self._presence.unlike(*columns.values())
        absent = [
            triad
            for triad, numbers in zip(TRIADS, columns.values(), strict=True)
            if np.all(numbers == -1.0)
        ]
        if absent:
            name = f"{self._bag.path}: {self._source.name}"
            raise InputError(absent_triad_line(name, triad) for triad in absent)

    def _pass_gate(self, decoded: Decoded) -> Iterator[Readings]:
        """Yield the readings of messages that the gate lets pass."""
        numbers = decoded.numbers
        if self._odometry is None:
            columns = [
                (gate.RATE, numbers["angular_velocity"]),
                (gate.FORCE, numbers["linear_acceleration"]),
            ]
        else:
            columns = [
                (gate.ORIENTATION, numbers["orientation"]),
                (gate.VELOCITY, numbers["linear"]),
                (gate.RATE, numbers["angular"]),
            ]
        verdict = gate.Verdict(decoded.t_ns, columns)
        start, self._seen = self._seen, self._seen + len(decoded.t_ns)
        if not verdict.good.all():
            verdict.note(self._bad, np.arange(start, self._seen), stamps=True)
            decoded = decoded.at(verdict.good)
            numbers = decoded.numbers
        if self._odometry is None:
            source = f"{self._bag.path}: {self._source.name}"
            strays = tell_strays(decoded.t_ns, start == 0, source, self._remark)
            if strays.any():
                decoded = decoded.at(~strays)
                numbers = decoded.numbers
        if not len(decoded.t_ns):
            return
        t_ns = decoded.t_ns
        if self._odometry is not None:
            q_wb = quaternions_wxyz(numbers["orientation"])
            readings = self._odometry.apply(t_ns, q_wb, numbers["linear"], numbers["angular"])
            if len(readings.t_ns):
                yield readings
            return
        yield Readings.unchecked(
            t_ns=t_ns,
            gyro=np.asfortranarray(numbers["angular_velocity"]),
            accel=np.asfortranarray(numbers["linear_acceleration"]),
            q_wb=_orientation(numbers) if self._fields is _ORIENTED else None,
        )


def _orientation(numbers: Mapping[str, Array]) -> Array | None:
    """Return q_wb (n, 4) of messages; None if one of them states none."""
    stated = np.linalg.norm(numbers["orientation"], axis=1)
    valid = (numbers["orientation_covariance"][:, 0] >= 0.0) & (np.abs(stated - 1.0) < 1e-3)
    return quaternions_wxyz(numbers["orientation"]) / stated[:, None] if valid.all() else None


def _decode(bag: Bag, block: MessageBlock, fields: Sequence[str]) -> Decoded:
    """Return fields of a block's messages; damaged ones are an error that names the bag."""
    with errors_naming(bag.path):
        return decode_block(block, bag.encoding, fields)
