# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The process of one sensor: makes messages ahead and publishes each on the simulator's request.

It reads one line of JSON, then tokens, from standard input, and ends when that is closed; it
reports in lines of JSON on standard output. It runs below the priority of the node that started it,
and the thread that makes them below that: as a batch job, which gives way to any other thread.
"""

import json
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, NamedTuple

import rclpy
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions

from imu_sim_ros.bags.messages.blocks import as_list
from imu_sim_ros.bags.messages.encode_cameras import shift_stamp
from imu_sim_ros.core.conventions import MARKERS_TOPIC
from imu_sim_ros.core.errors import explain
from imu_sim_ros.formats.door import read_states
from imu_sim_ros.nodes import fast_dds
from imu_sim_ros.nodes.publishing import Counter, create
from imu_sim_ros.nodes.simulator.apart import MARKERS, TOKEN, ProcessStart
from imu_sim_ros.nodes.simulator.markers import markers
from imu_sim_ros.parameters.sections import build
from imu_sim_ros.sensors.parameters import RatedParameters
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.timing import SampleTimes
from imu_sim_ros.sensors.world import Window, World
from imu_sim_ros.simulation.cameras import scene_around
from imu_sim_ros.simulation.playback import SimulatorParameters
from imu_sim_ros.simulation.sensors import models, mount_sensors, sensor_warnings
from imu_sim_ros.simulation.topics import sensor_topics
from imu_sim_ros.terminal.json_text import json_text
from imu_sim_ros.terminal.progress import Watcher, watch_thread
from imu_sim_ros.trajectory.build import build_trajectory

ORIGIN_NS: Final = 10**12
"""Time zero of samples that are made ahead: no stamp is negative, whatever the time offset."""
AHEAD: Final = 8
"""Samples that wait to be published: 3 MB of frames of 752 x 480."""
_NICE: Final = 5
"""Niceness of the process over that of the node."""
_RENDERING_NICE: Final = 5
"""Added to that of the process."""
_POLL: Final = 0.05
"""Time between two looks at the subscribers [s]."""
_BEHIND: Final = 20
"""Number of samples due and not yet made from which this is reported."""
_ACKNOWLEDGEMENT: Final = Duration(nanoseconds=2_000_000_000)
_LATCHED: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Made(NamedTuple):
    """Messages of one sample."""

    true_t_ns: int
    """True time of the sample, counted from ORIGIN_NS as time zero [ns]."""
    messages: list[tuple[str, bytes]]
    """Topic and message."""


class SampleQueue:
    """The messages of a sensor's samples, made ahead in one thread and taken by another."""

    def __init__(self, make: Callable[[int], Made | None], exists: Callable[[int], bool]) -> None:
        """Initialise without messages.

        :param make: returns the messages of a sample, stamped as if time zero were ORIGIN_NS; None
            for one that will never be requested.
        :param exists: whether a sample lies before the end of the run.
        """
        self._make, self._exists = make, exists
        self._made: dict[int, Made] = {}
        """Messages that wait to be taken, by the number of their sample."""
        self._next = 0
        """Number of the next sample to make."""
        self._wanted = 0
        """Smallest number that may still be taken."""
        self._run = 0
        """Count of resets and jumps: messages under way during one are discarded."""
        self._changed = threading.Condition()
        """Guards the above, and wakes both threads after a change."""

    def work(self) -> None:
        """Make messages endlessly."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: len(self._made) < AHEAD and self._exists(self._next))
                number, run_number = self._next, self._run
            messages = self._make(number)
            with self._changed:
                if run_number == self._run:  # else there was a reset meanwhile
                    self._next = number + 1
                    if messages is not None and number >= self._wanted:
                        self._made[number] = messages
                    self._changed.notify_all()

    def wait_for_first(self) -> None:
        """Wait until half of those made ahead, or all, are ready, or the first 100 are lost."""
        with self._changed:
            self._changed.wait_for(
                lambda: (
                    len(self._made) >= AHEAD // 2
                    or self._next > 100
                    or not self._exists(self._next)
                )
            )

    def take(self, number: int) -> Made:
        """Return the messages of a sample, and discard it and all before it."""
        with self._changed:
            if number < self._wanted or number > self._next + AHEAD:  # a reset, or a jump
                self._made.clear()
                self._next = number
                self._run += 1
            self._wanted = number
            self._made = {
                k: kept_messages for k, kept_messages in self._made.items() if k >= number
            }
            self._changed.notify_all()
            self._changed.wait_for(lambda: number in self._made)
            messages = self._made.pop(number)
            self._wanted = number + 1
            self._changed.notify_all()
        return messages


class SensorNode:
    """Node that publishes the sensor of one process."""

    def __init__(self, start: ProcessStart) -> None:
        """Make node, publishers, world and sensors."""
        parameters = build(SimulatorParameters, start["parameters"])
        self.name = start["sensor"]
        overrides = [Parameter(name, value=value) for name, value in start["overrides"].items()]
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node(
            start["node"],
            namespace=start["namespace"],
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=overrides,
        )
        self._sensors = mount_sensors(parameters)
        topics = sensor_topics(self._sensors)
        self._offered = {topic: topics[topic] for topic in start["topics"] if topic in topics}
        self.counters = dict(self._publishers(start["topics"]))
        self._encoders = {
            topic: topic_of_sensor.encoder() for topic, topic_of_sensor in self._offered.items()
        }
        trajectory = build_trajectory(parameters.trajectory, read_states)
        self._duration = parameters.duration or trajectory.duration
        self._world = World(trajectory, parameters, ORIGIN_NS, scene_around)
        self._models = models(self._sensors, {self.name, *start["members"]}, ORIGIN_NS)
        self._members = start["members"]
        self.samples = SampleQueue(self._make, lambda k: self._times.time(k) < self._duration)

    def _publishers(self, names: dict[str, str]) -> Iterator[tuple[str, Counter]]:
        """Yield a publisher for each topic of this process."""
        own = self._sensors[self.name].parameters
        assert isinstance(own, RatedParameters)
        depth = max(20, round(4 * own.rate))
        for topic, full in names.items():
            topic_of_sensor = self._offered.get(topic)
            kind = topic_of_sensor.topic.type if topic_of_sensor else MARKERS
            latched = topic_of_sensor is None or topic_of_sensor.topic.latched
            qos = _LATCHED if latched else QoSProfile(depth=depth)
            yield topic, Counter(topic, create(self.node, kind, full, qos))

    def publish_latched(self) -> None:
        """Publish the latched messages, before the first sample."""
        start = Window(Fraction(0), self._times.time(1))
        for topic, topic_of_sensor in self._offered.items():
            if topic_of_sensor.topic.latched:
                for payload in self._messages(topic, start, {}):
                    self.counters[topic].send(shift_stamp(payload, -ORIGIN_NS))
        if MARKERS_TOPIC in self.counters:
            shown = markers(self._sensors, self._world)
            self.counters[MARKERS_TOPIC].send(serialize_message(shown))

    def warnings(self) -> list[str]:
        """Return the warnings of its sensors."""
        members = [self._sensors[name] for name in self._members]
        return [
            w for member in members for w in sensor_warnings(member, self._world, self._duration)
        ]

    def notes(self) -> list[str]:
        """Return the scene's note, unless an earlier sensor sees the scene and returns it."""
        first_viewer = next(
            name for name, mounted_sensor in self._sensors.items() if mounted_sensor.sensor.sees
        )
        note = self._world.scene.note if first_viewer == self.name else ""
        return [note] if note else []

    def publish(self, number: int, true_t_ns: int) -> None:
        """Publish the messages of a sample."""
        sample = self.samples.take(number)
        for topic, payload in sample.messages:
            moved = shift_stamp(payload, true_t_ns - sample.true_t_ns)
            self.counters[topic].send(moved)

    @property
    def _times(self) -> SampleTimes:
        """Return the sample times of the sensor."""
        model: Any = self._models[self.name]
        times: SampleTimes = model.times
        return times

    def _make(self, number: int) -> Made | None:
        """Return the samples of a window as messages; None: the sensor has none in it."""
        window = Window(self._times.time(number), self._times.time(number + 1))
        samples = {self.name: self._models[self.name].read(window, self._world)}
        if not len(samples[self.name].delivered):
            return None
        messages = [
            (topic, payload)
            for topic, topic_of_sensor in self._offered.items()
            if not topic_of_sensor.topic.latched
            for payload in self._messages(topic, window, samples)
        ]
        return Made(int(samples[self.name].true_t_ns[0]), messages)

    def _messages(self, topic: str, window: Window, samples: dict[str, Samples]) -> list[bytes]:
        """Return the messages of a topic in a window.

        :param samples: the samples of it so far; those of further sensors are added.
        """
        name = self._offered[topic].name
        if name not in samples:
            samples[name] = self._models[name].read(window, self._world)
        messages = self._encoders[topic](samples[name], self._sensors[name].valid)
        return as_list(messages.made())


class Reports:
    """The process's reports to the node."""

    def __init__(self, descriptor: int) -> None:
        self._file = os.fdopen(descriptor, "wb", buffering=0)
        self._lock = threading.Lock()

    def say(self, **report: object) -> None:
        """Write a report as a line of JSON."""
        with self._lock:
            self._file.write(json_text(report).encode() + b"\n")


def main() -> int:
    """Run the process until its standard input ends."""
    os.nice(_NICE)
    reports = Reports(os.dup(1))
    os.dup2(2, 1)  # other output must not get between the reports
    try:
        line = sys.stdin.buffer.readline()
        if not line:
            return 0
        with tempfile.TemporaryDirectory() as folder:
            fast_dds.set_profile(Path(folder))
            node = SensorNode(json.loads(line))
        _run(node, reports)
    except BrokenPipeError:
        return 0  # the node has gone
    except Exception as error:
        lines, status = explain(error)
        reports.say(problems=lines, status=status)
        return status
    return 0


def _report_connected(node: SensorNode, reports: Reports, begun: threading.Event) -> None:
    """Report until the run begins how many subscribers each publisher is connected to."""
    reported: dict[str, int] = {}
    while not begun.wait(_POLL):
        connections = {t: c.publisher.get_subscription_count() for t, c in node.counters.items()}
        if connections != reported:
            reports.say(connected=connections)
            reported = connections


def _read_tokens() -> Iterator[list[tuple[int, int]]]:
    """Yield the tokens that have arrived on standard input, until its end.

    A token is the number and the true time [ns] of a frame that is due.
    """
    torn_token = b""
    while data := os.read(0, TOKEN.size * 4096):
        data = torn_token + data
        end = len(data) - len(data) % TOKEN.size
        torn_token = data[end:]
        yield list(TOKEN.iter_unpack(data[:end]))


def _run(node: SensorNode, reports: Reports) -> None:
    """Publish the frames whose tokens the node sends; a thread renders them ahead."""

    def work() -> None:
        os.nice(_RENDERING_NICE)  # of this thread alone on Linux; readings go first
        watch_thread(Watcher(note=lambda line: reports.say(notes=[line])))
        try:
            node.samples.work()
        except BaseException as error:
            lines, status = explain(error)
            reports.say(problems=lines, status=status)
            os._exit(status)  # the thread that takes frames waits for ever

    threading.Thread(target=work, name="render", daemon=True).start()
    node.publish_latched()
    node.samples.wait_for_first()
    reports.say(ready=True, warnings=node.warnings(), notes=node.notes())
    begun = threading.Event()
    threading.Thread(
        target=_report_connected, args=(node, reports, begun), name="connected", daemon=True
    ).start()
    done, is_behind = 0, False
    for tokens in _read_tokens():
        begun.set()
        if len(tokens) > _BEHIND and not is_behind:
            is_behind = True
            line = f"{node.name}: {len(tokens)} frames are due but not yet rendered"
            reports.say(warnings=[line])
        for number, true_t_ns in tokens:
            node.publish(number, true_t_ns)
            done += 1
            reports.say(done=done, counts={t: c.count for t, c in node.counters.items()})
    for counter in node.counters.values():
        counter.publisher.wait_for_all_acked(_ACKNOWLEDGEMENT)
    reports.say(done=done, counts={t: c.count for t, c in node.counters.items()})
    node.node.destroy_node()
    rclpy.try_shutdown()
