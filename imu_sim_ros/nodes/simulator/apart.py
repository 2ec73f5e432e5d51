# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sensors of the running simulator that take long for a sample, each in a process of its own.

Such a process (``apart_process``) makes the messages of samples ahead, such as images of frames,
and publishes them on request. All that the publishing thread of the IMU does for a frame is to
write 16 bytes to a pipe when the frame is due, so pauses, steps, resets and the real-time factor
apply to frames as to samples, and neither rendering nor sending a large message ever delays a
sample.
"""

import json
import os
import struct
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import IO, Final, TypedDict

import numpy as np
from rclpy.duration import Duration

from imu_sim_ros.core.conventions import LANDMARKS_TOPIC, MARKERS_TOPIC
from imu_sim_ros.core.errors import ConfigurationError, MachineError
from imu_sim_ros.nodes import fast_dds
from imu_sim_ros.nodes.lifetime import Fail, SupervisedThread
from imu_sim_ros.nodes.parameters import ConfiguredNode
from imu_sim_ros.nodes.simulator.publish_queue import Send
from imu_sim_ros.parameters.kinds import Value
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.simulation.playback import SimulatorParameters
from imu_sim_ros.simulation.sensors import mount_sensors
from imu_sim_ros.simulation.topics import Encode, Messages, delivered_rows, sensor_topics
from imu_sim_ros.terminal.json_text import json_text
from imu_sim_ros.terminal.signals import block_signals

TOKEN: Final = struct.Struct("<qq")
"""Number of a sample, and its true time [ns]."""
MARKERS: Final = "visualization_msgs/msg/MarkerArray"
_OVERRIDES: Final = "qos_overrides"
_PROGRAM: Final = """
import sys
from imu_sim_ros.terminal import startup
sys.exit(startup.load("imu_sim_ros.nodes.simulator.apart_process").main())
"""
_LONGEST_FRAME: Final = 10.0
"""Longest time that an image may take [s]."""
_LONGEST_CONNECTION: Final = 5.0
"""Time after which a subscriber that is not connected has another quality of service [s]."""
_LONGEST_END: Final = 5.0
"""Time after which a process that is still sending is killed [s]."""


class ProcessStart(TypedDict):
    """Arguments from the node to a process, in JSON."""

    sensor: str
    """Name of the sensor at whose samples it publishes."""
    members: list[str]
    """Names of all sensors whose samples it reads."""
    parameters: dict[str, Value]
    """Parameters of the simulator, by dotted name."""
    topics: dict[str, str]
    """Topics that it publishes, with their full names."""
    node: str
    namespace: str
    overrides: dict[str, object]
    """Parameters of the quality of service."""


class RemoteCounter:
    """A topic that a sensor's process publishes; counts like a publisher."""

    def __init__(
        self, topic: str, process: "SensorProcess", subscribers: Callable[[], int]
    ) -> None:
        self.topic, self._process = topic, process
        self.get_subscription_count = subscribers
        self.publisher = self

    @property
    def is_connected(self) -> bool:
        """True if the process is connected to all subscribers that the node sees."""
        return self._process.connected.get(self.topic, 0) >= self.get_subscription_count()

    @property
    def count(self) -> int:
        """Messages so far."""
        return self._process.counts.get(self.topic, 0)

    def wait_for_all_acked(self, timeout: Duration) -> bool:
        """Wait until all frames that were due are published."""
        return self._process.wait_until_idle(timeout.nanoseconds * 1e-9)


class SensorProcess:
    """One sensor's process, seen from the node."""

    def __init__(
        self,
        name: str,
        start: ProcessStart,
        fail: Fail,
        warn: Callable[[str], None],
        note: Callable[[str], None],
    ) -> None:
        """Start the process.

        :param start: its configuration, as JSON can hold it.
        :param fail: receives what ended the process.
        :param warn: receives a warning for the log.
        :param note: receives a line for the log that is no warning.
        """
        self.name, self._fail, self._warn, self._note = name, fail, warn, note
        self.counts: dict[str, int] = {}
        self.connected: dict[str, int] = {}
        """Subscribers that each of its publishers is connected to, until the run begins."""
        self.ready = False
        self._sent = self._done = 0
        self._closing = self._overflow = False
        self._changed = threading.Condition()
        environment = {**fast_dds.environment_of_child(os.environ), "OMP_NUM_THREADS": "1"}
        # Blocked in the process from its first moment on: what a terminal tells all processes is
        # the node's, which closes the pipe when it ends.
        with block_signals():
            self._process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env={**environment, "OPENBLAS_NUM_THREADS": "1"},
            )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._input: IO[bytes] = self._process.stdin
        self._output: IO[bytes] = self._process.stdout
        self._input.write(json_text(start).encode() + b"\n")
        self._input.flush()
        os.set_blocking(self._input.fileno(), False)  # the thread of the IMU never waits for it
        self._watcher = SupervisedThread(f"watch_{name}", self._watch, fail)
        self._watcher.start()

    def send(self, token: bytes) -> None:
        """Request that a frame is published."""
        try:
            os.write(self._input.fileno(), token)
            self._sent += 1
        except BlockingIOError:  # some 4000 frames behind
            if not self._overflow:
                self._overflow = True
                self._warn(f"{self.name}: frames cannot be rendered in time; some are lost")
        except (BrokenPipeError, ValueError):
            pass  # the watcher reports why

    def wait_until_idle(self, timeout: float) -> bool:
        """Wait until every frame that was due is published, as long as there is progress.

        :param timeout: longest time without any frame [s].
        """
        with self._changed:
            moved = True
            while moved and self._done < self._sent and not self._closing:
                moved = self._changed.wait(timeout + _LONGEST_FRAME)
            return self._done >= self._sent

    def close(self) -> None:
        """End the process; frames that are due are still sent."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._input.close()
        try:
            self._process.wait(_LONGEST_END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._watcher.join(_LONGEST_END)
        self._output.close()

    def _watch(self) -> None:
        """Read the process's reports, a line of JSON each."""
        ended = False
        for line in self._output:
            report = json.loads(line)
            with self._changed:
                self.counts.update(report.get("counts", {}))
                self.connected.update(report.get("connected", {}))
                self._done = report.get("done", self._done)
                self.ready |= "ready" in report
                self._changed.notify_all()
            for warning in report.get("warnings", ()):
                self._warn(warning)
            for note in report.get("notes", ()):
                self._note(note)
            if "problems" in report:
                ended = True
                kind = ConfigurationError if report["status"] == 2 else MachineError
                self._fail(kind(report["problems"]))
        if not (self._closing or ended):
            status = self._process.wait()
            self._fail(MachineError(f"{self.name}: the sensor's process ended, status {status}"))


def token_messages(samples: Samples, _: object) -> Messages:
    """Return a token for each sample that is delivered, due when its driver lets it go.

    It requests what a process publishes of the sample.
    """
    rows = delivered_rows(samples)
    numbers = samples.first + np.arange(len(samples.t_ns))[rows]
    tokens = zip(numbers.tolist(), samples.true_t_ns[rows].tolist(), strict=True)
    packed = [TOKEN.pack(*token) for token in tokens]
    return Messages(samples.t_ns[rows], samples.release_t_ns[rows], packed)


def sensor_process_groups(
    sensors: Mapping[str, Mounted[MountedParameters]],
) -> dict[str, list[str]]:
    """Return which sensors have processes of their own, and those that share each.

    One that cannot read without another one is in the process of that.
    """
    groups: dict[str, list[str]] = {}
    for name, sensor in sensors.items():
        if sensor.sensor.apart:
            needed = [
                sensor.space + quantity for quantity in sensor.sensor.needs(sensor.parameters)
            ]
            groups.setdefault(next(iter(needed), name), []).append(name)
    return groups


class SensorsApart:
    """All sensors of the node that have processes of their own."""

    def __init__(
        self, node: ConfiguredNode[SimulatorParameters], parameters: SimulatorParameters, fail: Fail
    ) -> None:
        """Start the processes."""
        sensors = mount_sensors(parameters)
        offers, groups = sensor_topics(sensors), sensor_process_groups(sensors)
        log = node.get_logger()
        overrides = [f"{_OVERRIDES}.{key}" for key in node.get_parameters_by_prefix(_OVERRIDES)]
        self.topics: list[str] = []
        """Full names of all topics that the processes publish."""
        self.counters: list[RemoteCounter] = []
        self.outputs: list[tuple[str, Encode, Send]] = []
        """The sensor at whose samples each process publishes, and what requests it."""
        self._processes: list[SensorProcess] = []
        self._requested_at = 0.0
        for name, members in groups.items():
            topics = [topic for topic, offer in offers.items() if offer.name in members]
            if LANDMARKS_TOPIC in topics:
                topics.append(MARKERS_TOPIC)
            names = {topic: node.resolve_topic_name(topic) for topic in topics}
            start: ProcessStart = {
                "sensor": name,
                "members": members,
                "parameters": flatten(parameters),
                "topics": names,
                "node": f"{node.get_name()}_{name}",
                "namespace": node.get_namespace(),
                "overrides": {name: node.get_parameter(name).value for name in overrides},
            }
            process = SensorProcess(name, start, fail, log.warning, log.info)
            self._processes.append(process)
            self.topics += names.values()
            self.counters += [
                RemoteCounter(topic, process, partial(node.count_subscribers, full))
                for topic, full in names.items()
            ]
            self.outputs.append((name, token_messages, process.send))

    @property
    def ready(self) -> bool:
        """True if all processes have their first samples."""
        return all(process.ready for process in self._processes)

    def is_connected(self, time_s: float) -> bool:
        """Return whether the processes are connected to all subscribers, or have tried long enough.

        :param time_s: time on a clock that never jumps [s].
        """
        self._requested_at = self._requested_at or time_s
        late = time_s - self._requested_at > _LONGEST_CONNECTION
        return late or all(counter.is_connected for counter in self.counters)

    def close(self) -> None:
        """End the processes."""
        for process in self._processes:
            process.close()
