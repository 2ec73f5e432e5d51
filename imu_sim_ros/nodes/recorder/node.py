# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The recorder node: topics into a bag that survives the recorder's sudden end."""

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType, ROSClock
from rclpy.exceptions import NameValidationException
from rclpy.qos import QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU
from imu_sim_ros.bags.recorder_parameters import RecorderParameters
from imu_sim_ros.bags.writer import BagOptions, Writer
from imu_sim_ros.core import timebase
from imu_sim_ros.core.errors import ConfigurationError, InputError, MissingDependencyError
from imu_sim_ros.nodes import run, signals
from imu_sim_ros.nodes.messages import definition, message_class, stamp_offset, type_hash
from imu_sim_ros.nodes.parameters import ConfiguredNode
from imu_sim_ros.nodes.recorder.recording import (
    BagRecording,
    DurationLimit,
    RecordedTopic,
    Timestamps,
)
from imu_sim_ros.nodes.recorder.stops import TopicStops
from imu_sim_ros.nodes.subscriptions import (
    MessageCounter,
    RawSubscriptions,
    Taken,
    is_weaker,
    matching_qos,
    publisher_qos,
)
from imu_sim_ros.recordings.findings.live import UnitWatch
from imu_sim_ros.recordings.findings.policy import RECORDER
from imu_sim_ros.recordings.live_clock import LiveClock
from imu_sim_ros.terminal.json_text import json_text
from imu_sim_ros.terminal.text_tables import print_table

MEGABYTE = 1_000_000
"""Bytes in a megabyte."""

_READ_PERIOD = 0.01
"""Period of reading the subscriptions [s]."""
_DISCOVERY_PERIOD = 0.1
"""Period of the search for new topics [s]."""
_CHECK_PERIOD = 0.02
"""Period of the check for the end of the recording [s]."""
_STATUS_PERIOD = 0.5
"""Period of the status line [s]."""
_SILENCE = 3.0
"""Time after which requested topics without a message are reported [s]."""
_STOP_PERIOD = 1.0
"""Period of the check for topics that have stopped [s]."""


class Recorder(ConfiguredNode[RecorderParameters]):
    """Finds topics, subscribes to them, and passes messages on to be written."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__("recorder", RecorderParameters, **arguments)
        parameters = self.parameters
        self.output = Path(parameters.output or time.strftime("recording_%Y-%m-%d_%H-%M-%S"))
        problems: list[str] = []
        self._wanted = self._resolve("topics", parameters.topics, problems)
        """Full names of the topics to record; empty: all that are not excluded."""
        self._excluded = set(self._resolve("exclude", parameters.exclude, problems))
        if problems:
            raise ConfigurationError(problems)
        self._qos: dict[str, QoSProfile] = {}
        """Quality of service of the subscriptions, by topic."""
        self._types: dict[str, str] = {}
        """Types by the names of the recorded topics."""
        self._other_types: dict[tuple[str, str], MessageCounter | None] = {}
        """Counters by topic and type that is not recorded; None for a type not installed."""
        self._refused: dict[str, str] = {}
        """Reasons by the names of the topics that cannot be recorded."""
        self._stops = TopicStops()
        self._began_at = 0.0
        """Time at which the limited duration begins [s]; 0: there was no message yet."""
        self._shown = 0
        """Number of messages in the line of status that is displayed."""
        self._live_line = parameters.status and sys.stderr.isatty()
        self.recording = BagRecording(
            self._open_bag,
            lambda error: self.lifetime.fail(error, status=1),
            parameters.buffer_size * MEGABYTE,
        )
        self._limit = DurationLimit(parameters.duration)
        self._timestamps = Timestamps(self, parameters.record_time == "reception")
        self.reader = RawSubscriptions(
            self,
            self._put,
            self.lifetime.fail,
            _READ_PERIOD,
        )
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_DISCOVERY_PERIOD, self._discover, clock=steady)
        self._silence_timer = self.create_timer(_SILENCE, self._report_silence, clock=steady)
        self.create_timer(_STOP_PERIOD, self._report_stops, clock=steady)
        if parameters.duration or parameters.max_size:
            self.create_timer(_CHECK_PERIOD, self._check_end, clock=steady)
        if self._live_line:
            self.create_timer(_STATUS_PERIOD, self._show_status, clock=steady)
        self._discover()

    def close(self) -> None:
        """Write the messages so far, finish the bag, and print its contents."""
        self.reader.close()
        self.recording.close()
        for counter in self._other_types.values():
            if counter is not None:
                counter.close()
        if self._live_line:
            print("\r\x1b[2K", end="", file=sys.stderr)
        self._summarise()

    def _open_bag(self) -> Writer:
        """Open the bag that the parameters describe."""
        parameters = self.parameters
        options = BagOptions(
            storage=parameters.form(),
            compression=parameters.compression,
            split_duration=parameters.split_duration,
            split_size=round(parameters.split_size * MEGABYTE),
        )
        return open_writer(self.output, options)

    def _resolve(self, parameter: str, names: Sequence[str], problems: list[str]) -> list[str]:
        """Return the topics' names with their namespace; add a problem for each invalid one."""
        result = []
        for name in names:
            try:
                result.append(self.resolve_topic_name(name))
            except (RuntimeError, ValueError, NameValidationException):
                problems.append(
                    f"{parameter}: {name!r} is not a topic name, which has letters, digits, "
                    "underscores and slashes"
                )
        return result

    # ------------------------------------------------------------------------------- topics
    def _discover(self) -> None:
        """Subscribe to new requested topics, and again if the QoS of the publishers changes."""
        for name, _ in self.get_topic_names_and_types():
            if self._is_wanted(name):
                publishers = [
                    publisher
                    for publisher in self.get_publishers_info_by_topic(name)
                    if publisher.node_name != self.get_name()
                ]
                if publishers:
                    self._take_topic(name, publishers)

    def _is_wanted(self, name: str) -> bool:
        """Return True for a topic that is recorded: named, or neither hidden nor excluded."""
        if self._wanted:
            return name in self._wanted
        hidden = any(part.startswith("_") for part in name.split("/"))
        return not hidden and name not in self._excluded

    def _take_topic(self, name: str, publishers: Sequence[TopicEndpointInfo]) -> None:
        """Record a topic, of the type that its publishers offer."""
        if name in self._refused:
            return
        if name in self._types:
            publishers = self._publishers_of_recorded_type(name, publishers)
            if not publishers:
                return
        types = list(dict.fromkeys(publisher.topic_type for publisher in publishers))
        qos = matching_qos(publishers)
        current = self._qos.get(name)
        if current is not None and not is_weaker(qos, current):
            return
        try:
            if len(types) > 1:
                raise InputError(f"it has several types: {', '.join(types)}")
            message = message_class(types[0])
        except (InputError, MissingDependencyError) as error:
            self._refused[name] = str(error)
            self.get_logger().error(f"{name} is not recorded: {error}")
            return
        offset = stamp_offset(message)
        if current is None:
            topic = RecordedTopic(
                name,
                types[0],
                publisher_qos(publishers),
                definition(types[0]),
                type_hash(types[0]),
                LiveClock(self.parameters.max_gap),
                units=UnitWatch(name) if types[0] == IMU else None,
            )
            self.recording.add_topic(topic)
            self.get_logger().info(f"recording {name} [{types[0]}]")
        else:
            self.get_logger().warning(f"{name}: a publisher offers a weaker QoS; subscribing again")
        self._qos[name] = qos
        self._types[name] = types[0]
        self._timestamps.add_topic(name, offset)
        self.reader.subscribe(name, message, qos)

    def _publishers_of_recorded_type(
        self, name: str, publishers: Sequence[TopicEndpointInfo]
    ) -> list[TopicEndpointInfo]:
        """Return the publishers of a topic's recorded type; report and count each other type."""
        recorded = self._types[name]
        publishers_by_type: dict[str, list[TopicEndpointInfo]] = {}
        for publisher in publishers:
            publishers_by_type.setdefault(publisher.topic_type, []).append(publisher)
        matching = publishers_by_type.pop(recorded, [])
        for other_type, sources in publishers_by_type.items():
            if (name, other_type) not in self._other_types:
                self._other_types[name, other_type] = self._counter(name, other_type, sources)
                self.get_logger().warning(
                    f"{name} is recorded as {recorded}; messages of a publisher with type "
                    f"{other_type} are left out"
                )
        return matching

    def _counter(
        self, name: str, type_name: str, publishers: Sequence[TopicEndpointInfo]
    ) -> MessageCounter | None:
        """Return a counter of a topic's messages of one type; None if it is not installed."""
        try:
            message = message_class(type_name)
        except (InputError, MissingDependencyError):
            return None
        return MessageCounter(self, name, message, matching_qos(publishers), self.lifetime.fail)

    def _report_silence(self) -> None:
        """Warn once of the requested topics that have no publisher or no message yet."""
        self._silence_timer.cancel()
        if not self._wanted and not self._qos:
            self.get_logger().warning("waiting for a publisher of any topic")
        for name in self._silent_topics():
            source = "message" if name in self._qos else "publisher"
            self.get_logger().warning(f"waiting for a {source} of {name}")

    def _report_stops(self) -> None:
        """Warn of topics that stop while others go on, and say when they go on."""
        begun, ended = self._stops.changes()
        for stop in begun:
            self.get_logger().warning(f"{stop.topic}: no message for {stop.silence:.1f} s")
        for topic in ended:
            self.get_logger().info(f"{topic}: messages arrive again")

    def _silent_topics(self) -> list[str]:
        """Return the requested topics of which no message is recorded, without refused ones."""
        topics = self.recording.topics
        recorded = {name for name in self._wanted if name in topics and topics[name].messages}
        reported = {*recorded, *self._refused, *self.recording.refused}
        return [name for name in dict.fromkeys(self._wanted) if name not in reported]

    def _put(self, topic: str, batch: list[Taken]) -> None:
        """Pass messages of one topic on to be written, in the reader's thread."""
        self._stops.add(topic, len(batch), time.monotonic())
        messages = self._timestamps.messages(topic, batch)
        within = self._limit.take(messages, time.monotonic())
        if within:
            self.recording.put(within)

    # ------------------------------------------------------------------------------- the end
    def _check_end(self) -> None:
        """End the recording when a limit is reached."""
        recording, parameters = self.recording, self.parameters
        if 0 < parameters.max_size * MEGABYTE <= recording.size:
            self.lifetime.finish()
        elif self.reader.first_at:
            self._began_at = self._began_at or self._seconds(self.reader.first_at)
            if self._limit.reached(self._seconds() - self._began_at, time.monotonic()):
                self.lifetime.finish()

    def _seconds(self, steady: float = 0.0) -> float:
        """Return the time on the node's clock: simulated, or the steady one."""
        clock = self.get_clock()
        if isinstance(clock, ROSClock) and clock.ros_time_is_active:
            return clock.now().nanoseconds * 1e-9
        return steady or time.monotonic()

    # ------------------------------------------------------------------------------- words
    def _show_status(self) -> None:
        """Show counts, rate and size of the recording in one line."""
        recording = self.recording
        topics = list(recording.topics.values())
        elapsed = time.monotonic() - (self.reader.first_at or time.monotonic())
        rate = (recording.messages - self._shown) / _STATUS_PERIOD
        self._shown = recording.messages
        gaps = sum(topic.clock.gaps for topic in topics)
        line = (
            f"{elapsed:7.1f} s  {len(topics)} topics  {recording.messages} messages  "
            f"{rate:.0f}/s  {recording.size / MEGABYTE:.1f} MB  {gaps} gaps"
        )
        print("\r\x1b[2K" + line, end="", file=sys.stderr, flush=True)

    def _summarise(self) -> None:
        """Print the recorded topics, and losses according to the stamps."""
        recording = self.recording
        rows = [_row(topic) for topic in recording.topics.values()]
        if rows:
            header = ["topic", "messages", "rate Hz"]
            header += ["gaps", "missing", "duplicates", "out of order"]
            print_table(header, rows, str(self.output))
        else:
            print(f"{self.output}: no message was recorded", flush=True)
        for topic in recording.topics.values():
            if topic.stamped and topic.unset:
                print(
                    f"recorder: {topic.name}: {topic.unset} of {topic.messages} messages have no "
                    "stamp that was set: they are recorded with the message before them",
                    file=sys.stderr,
                )
            RECORDER.judge(topic.findings, lambda line: print(f"recorder: {line}", file=sys.stderr))
        if recording.dropped:
            print(
                f"recorder: {recording.dropped} messages dropped: the disk did not keep up and "
                f"buffer_size was full",
                file=sys.stderr,
            )
        if recording.broken:
            print(
                f"recorder: {recording.broken} malformed messages skipped",
                file=sys.stderr,
            )
        self._report_missing_topics()
        if recording.failed:
            print(f"recorder: {_remaining_files(recording.files)}", file=sys.stderr)

    def _report_missing_topics(self) -> None:
        """Print the topics that were not recorded, or not wholly."""
        for name, reason in {**self._refused, **self.recording.refused}.items():
            print(f"recorder: {name} was not recorded: {reason}", file=sys.stderr)
        for name in self._silent_topics():
            reason = "its publisher sent no message" if name in self._qos else "it had no publisher"
            print(f"recorder: {name} was not recorded: {reason}", file=sys.stderr)
        for stop in self._stops.all():
            print(
                f"recorder: {stop.topic} stopped {stop.silence:.1f} s before the last message",
                file=sys.stderr,
            )
        for (name, other_type), counter in self._other_types.items():
            count = "messages" if counter is None else f"{counter.messages} messages"
            print(
                f"recorder: {name}: {count} of type {other_type} left out: it was recorded as "
                f"{self._types[name]}",
                file=sys.stderr,
            )


def _remaining_files(files: Sequence[Path]) -> str:
    """Return a line about the files that a failed recording leaves.

    :param files: paths of the bag, which may have been removed during the recording.
    """
    if not files:
        return "nothing is kept: it failed before any part of the bag was complete"
    gone = [p for p in files if not p.exists() or (p.is_dir() and not any(p.iterdir()))]
    lines = [f"{path} was removed and is lost" for path in gone]
    if len(gone) < len(files):
        paths = ", ".join(str(path) for path in files if path not in gone)
        lines.append(
            f"{paths} keeps the messages written before; convert_bag --recover makes a complete "
            "bag from it"
        )
    return "; ".join(lines)


def _row(topic: RecordedTopic) -> tuple[str, ...]:
    """Return the row of a topic in the report at the end."""
    clock = topic.clock
    if not topic.stamped:  # times of reception tell nothing about the source
        return topic.name, str(topic.messages), f"{clock.rate:.2f}", "-", "-", "-", "-"
    counts = (clock.gaps, clock.missing, clock.duplicates, clock.out_of_order + topic.unset)
    return topic.name, str(topic.messages), f"{clock.rate:.2f}", *map(str, counts)


def plain_arguments(arguments: Sequence[str]) -> list[str]:
    """Return a recorder's short command line in the long form that every node understands.

    Plain words are topics, ``-o`` is ``--output``, a duration may have a unit; everything from
    ``--ros-args`` on is left unchanged.

    :raises ConfigurationError: for an invalid duration.
    """
    end = arguments.index("--ros-args") if "--ros-args" in arguments else len(arguments)
    result: list[str] = []
    topics: list[str] = []
    rest = iter(arguments[:end])
    for word in rest:
        name, equals, value = word.partition("=")
        name = {"-o": "--output", "-d": "--duration"}.get(name, name)
        if name in ("-h", "--help", "--version"):
            result.append(name)
        elif not name.startswith("-"):
            topics.append(word)
        else:
            value = value if equals else next(rest, "")
            if name in ("--duration", "--split-duration", "--split_duration"):
                value = _seconds(name, value)
            result += [name, value]
    if topics:
        result += ["--topics", json_text(topics)]
    return [*result, *arguments[end:]]


def _seconds(name: str, text: str) -> str:
    """Return the text of a duration in seconds; it may have a unit: 10min."""
    try:
        return repr(timebase.parse_duration(text))
    except ValueError as error:
        raise ConfigurationError(f"{name}: {error}") from None


def main() -> int:
    """Run the node."""
    try:
        arguments = plain_arguments(sys.argv[1:])
    except ConfigurationError as error:
        print(f"recorder: {error}", file=sys.stderr)
        return 2
    return run.main("recorder", Recorder, arguments)


if __name__ == "__main__":
    signals.watch(is_final=True)
    sys.exit(main())
