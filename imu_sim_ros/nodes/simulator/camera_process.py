# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The process of one camera: renders frames ahead and publishes each on the simulator's request.

It reads one line of JSON, then tokens, from standard input, and ends when that is closed; it
reports in lines of JSON on standard output. It runs below the priority of the node that started it,
and its rendering thread below that: a batch job that whoever wakes up may interrupt.
"""

import json
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import rclpy
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message

from imu_sim_ros.bags.messages.encode_cameras import StampedMessages
from imu_sim_ros.bags.read import read_poses
from imu_sim_ros.conventions import FEATURES_TOPIC, LANDMARKS_TOPIC, MARKERS_TOPIC
from imu_sim_ros.datasets.bodies import BodyMessages
from imu_sim_ros.datasets.features import (
    CameraMessages,
    FeatureStream,
    camera_topics,
    imagers,
    landmarks,
)
from imu_sim_ros.errors import explain
from imu_sim_ros.json_text import as_json
from imu_sim_ros.nodes import fast_dds
from imu_sim_ros.nodes.publishing import Counter, create
from imu_sim_ros.nodes.simulator.cameras import MARKERS, TOKEN
from imu_sim_ros.nodes.simulator.markers import markers
from imu_sim_ros.parameters.sections import build
from imu_sim_ros.sensors.camera.rig import Rig
from imu_sim_ros.simulation.playback import SimulatorParameters
from imu_sim_ros.simulation.sensors import arms_of_seeing, mounted
from imu_sim_ros.trajectory.build import build_trajectory

ORIGIN_NS: Final = 10**12
"""Time zero of frames that are made ahead: no stamp is negative, whatever the time offset."""
AHEAD: Final = 8
"""Frames that wait to be published: 3 MB of 752 x 480."""
_NICE: Final = 5
_RENDERING_NICE: Final = 5
"""TableRows that of the process."""
_POLL: Final = 0.05
"""[s] between two looks at the subscribers."""
_BEHIND: Final = 20
"""Number of frames due and not yet rendered from which this is reported."""
_ACKNOWLEDGEMENT: Final = Duration(nanoseconds=2_000_000_000)
_LATCHED: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class FrameQueue:
    """The messages of a camera's frames, made ahead in one thread and taken by another."""

    def __init__(self, make: Callable[[int], dict[str, bytes]], lost: Callable[[int], bool]):
        """Set up.

        :param make: returns the messages of a frame, stamped as if time zero were ORIGIN_NS.
        :param lost: returns which frames will never be requested.
        """
        self._make, self._lost = make, lost
        self._made: dict[int, dict[str, bytes]] = {}
        self._next = self._wanted = 0
        self._run = 0
        self._changed = threading.Condition()

    def work(self) -> None:
        """Render frames endlessly."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: len(self._made) < AHEAD)
                number, run_number = self._next, self._run
            made = None if self._lost(number) else self._make(number)
            with self._changed:
                if run_number == self._run:  # else others are wanted
                    self._next = number + 1
                    if made is not None and number >= self._wanted:
                        self._made[number] = made
                    self._changed.notify_all()

    def wait_for_first(self) -> None:
        """Wait until half of the frames made ahead are ready, or the first 100 frames are lost."""
        with self._changed:
            self._changed.wait_for(lambda: len(self._made) >= AHEAD // 2 or self._next > 100)

    def take(self, number: int) -> dict[str, bytes]:
        """Return the messages of a frame, and discard it and all before it."""
        with self._changed:
            if number < self._wanted or number > self._next + AHEAD:  # a reset, or a jump
                self._made.clear()
                self._next = number
                self._run += 1
            self._wanted = number
            self._made = {k: made for k, made in self._made.items() if k >= number}
            self._changed.notify_all()
            self._changed.wait_for(lambda: number in self._made)
            found = self._made.pop(number)
            self._wanted = number + 1
            self._changed.notify_all()
        return found


class CameraNode:
    """What one process publishes."""

    def __init__(self, start: dict[str, Any]) -> None:
        """Make node, publishers, scene and frames.

        :param start: what :class:`~imu_sim_ros.nodes.simulator.cameras.Cameras` sends.
        """
        values = start["parameters"]
        parameters: Any = build(SimulatorParameters, values)
        self.name = start["camera"]
        overrides = [Parameter(name, value=value) for name, value in start["overrides"].items()]
        rclpy.init(args=[])
        self.node = rclpy.create_node(
            start["node"],
            namespace=start["namespace"],
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=overrides,
        )
        self.parameters = parameters
        self._names: dict[str, str] = start["topics"]
        self.counters = dict(self._publishers())
        trajectory = build_trajectory(parameters.trajectory, read_poses)
        duration = parameters.duration or trajectory.duration
        others = arms_of_seeing(mounted(parameters))
        self._rig = Rig(parameters.rig, trajectory, ORIGIN_NS, duration, parameters.seed, others)
        self._view = self._rig.views[self.name]
        maker = imagers(self._rig, [self.name]).get(self.name)
        frame = parameters.rig.frame(self.name)
        self._camera = CameraMessages(self._view, frame, maker, "cdr")
        self._bodies = BodyMessages(self._rig, parameters.world_frame)
        self._features: FeatureStream | None = None
        self.frames = FrameQueue(self._make, self._lost)

    def _publishers(self) -> Iterator[tuple[str, Counter]]:
        """Yield a publisher for each topic of this process."""
        types = {**camera_topics(self.parameters.rig), MARKERS_TOPIC: MARKERS}
        depth = max(20, round(4 * self.parameters.rig.camera(self.name).rate))
        for topic, full in self._names.items():
            qos = _LATCHED if topic in (LANDMARKS_TOPIC, MARKERS_TOPIC) else QoSProfile(depth=depth)
            yield topic, Counter(topic, create(self.node, types[topic], full, qos))

    def publish_scene(self) -> None:
        """Publish the static messages, latched, if they are this process's task."""
        world, scene = self.parameters.world_frame, self._rig.scene
        if LANDMARKS_TOPIC in self.counters:
            self.counters[LANDMARKS_TOPIC].send(landmarks(scene, world, 0))
            self.counters[MARKERS_TOPIC].send(serialize_message(markers(self._rig, world)))

    def warnings(self) -> list[str]:
        """Return warnings about the view of the camera."""
        return self._rig.warnings(self.name)

    def notes(self) -> list[str]:
        """Return what was made of the camera's axes, and by the first one of the scene."""
        note = self._rig.scene.note if self.name == next(iter(self._rig.views)) else ""
        return [*self._rig.notes(self.name), *([note] if note else [])]

    def publish(self, number: int, t0_ns: int) -> None:
        """Publish a frame."""
        for topic, payload in self.frames.take(number).items():
            self.counters[topic].send(StampedMessages.moved(payload, t0_ns - ORIGIN_NS))

    def _lost(self, number: int) -> bool:
        total = self._view.total
        if total is not None and number >= total:
            return True
        return not self._view.frames(number, 1).delivered[0]

    def _make(self, number: int) -> dict[str, bytes]:
        t_ns = int(self._view.frames(number, 1).t_ns[0])
        made = {f"{self.name}/{k}": v for k, v in self._camera.messages(number, t_ns).items()}
        if FEATURES_TOPIC in self._names:
            made.update(self._tracked(number))
        bodies = self._bodies.messages(number).items()
        made.update({topic: payload for topic, payload in bodies if topic in self._names})
        return made

    def _tracked(self, number: int) -> dict[str, bytes]:
        """Return the features of a frame; they depend on the frames before it."""
        if self._features is None or self._features.position > number:
            layout, world = self.parameters.rig.features.layout, self.parameters.world_frame
            self._features = FeatureStream(self._rig, layout, world)
        messages = self._features.next(number + 1 - self._features.position)
        payload = next((m.payload for m in messages if m.number == number), None)
        return {} if payload is None else {FEATURES_TOPIC: payload}


class Reports:
    """The process's reports to the node."""

    def __init__(self, descriptor: int) -> None:
        self._file = os.fdopen(descriptor, "wb", buffering=0)
        self._lock = threading.Lock()

    def say(self, **said: Any) -> None:
        """Write a line."""
        with self._lock:
            self._file.write(as_json(said).encode() + b"\n")


def main() -> int:
    """Run the process until its standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the node closes the pipe when it ends
    os.nice(_NICE)
    reports = Reports(os.dup(1))
    os.dup2(2, 1)  # other output must not get between the reports
    try:
        line = sys.stdin.buffer.readline()
        if not line:
            return 0
        with tempfile.TemporaryDirectory() as folder:
            fast_dds.set_profile(Path(folder))
            node = CameraNode(json.loads(line))
        _run(node, reports)
    except BrokenPipeError:
        return 0  # the node has gone
    except Exception as error:
        lines, status = explain(error)
        reports.say(problems=lines, status=status)
        return status
    return 0


def _report_connected(node: CameraNode, reports: Reports, begun: threading.Event) -> None:
    """Report until the run begins how many subscribers each publisher is connected to."""
    said: dict[str, int] = {}
    while not begun.wait(_POLL):
        now = {t: c.publisher.get_subscription_count() for t, c in node.counters.items()}
        if now != said:
            reports.say(connected=now)
            said = now


def _run(node: CameraNode, reports: Reports) -> None:
    def work() -> None:
        os.nice(_RENDERING_NICE)  # of this thread alone on Linux; readings go first
        try:
            node.frames.work()
        except BaseException as error:
            lines, status = explain(error)
            reports.say(problems=lines, status=status)
            os._exit(status)  # the thread that takes frames waits for ever

    threading.Thread(target=work, name="render", daemon=True).start()
    node.publish_scene()
    node.frames.wait_for_first()
    reports.say(ready=True, warnings=node.warnings(), notes=node.notes())
    begun = threading.Event()
    threading.Thread(
        target=_report_connected, args=(node, reports, begun), name="connected", daemon=True
    ).start()
    done, behind = 0, False
    waiting = b""
    while data := os.read(0, TOKEN.size * 4096):
        begun.set()
        waiting += data
        whole = len(waiting) - len(waiting) % TOKEN.size
        tokens, waiting = list(TOKEN.iter_unpack(waiting[:whole])), waiting[whole:]
        if len(tokens) > _BEHIND and not behind:
            behind = True
            reports.say(warnings=[f"{len(tokens)} frames are due but not yet rendered"])
        for number, t0_ns in tokens:
            node.publish(number, t0_ns)
            done += 1
            reports.say(done=done, counts={t: c.count for t, c in node.counters.items()})
    for counter in node.counters.values():
        counter.publisher.wait_for_all_acked(_ACKNOWLEDGEMENT)
    reports.say(done=done, counts={t: c.count for t, c in node.counters.items()})
    node.node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    sys.exit(main())
