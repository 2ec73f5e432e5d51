# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The cameras of the running simulator, each in a process of its own.

Such a process (``camera_process``) renders frames ahead and publishes one on request. All that the
publishing thread of the IMU does for a frame is to write 16 bytes to a pipe when the frame is due,
so pauses, steps, resets and the real-time factor apply to frames as to samples, and neither
rendering nor sending a large message ever delays a sample.
"""

import json
import os
import struct
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import IO, Any, Final

import numpy as np

from imu_sim_ros import timebase
from imu_sim_ros.conventions import MARKERS_TOPIC
from imu_sim_ros.datasets.features import camera_topics
from imu_sim_ros.errors import ConfigurationError, MachineError
from imu_sim_ros.json_text import as_json
from imu_sim_ros.nodes import fast_dds
from imu_sim_ros.nodes.lifetime import Fail, SupervisedThread
from imu_sim_ros.nodes.simulator.publish_queue import Piece
from imu_sim_ros.nodes.simulator.transforms import Mount
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.rig_parameters import RigParameters
from imu_sim_ros.sensors.camera.view import View
from imu_sim_ros.simulation.playback import SimulatorParameters

TOKEN: Final = struct.Struct("<qq")
"""Number of a frame, and time zero [ns]."""
MARKERS: Final = "visualization_msgs/msg/MarkerArray"
_OVERRIDES: Final = "qos_overrides"
_LONGEST_FRAME: Final = 10.0
_LONGEST_CONNECTION: Final = 5.0
"""[s] A subscriber that is not connected by then has another quality of service."""
_LONGEST_END: Final = 5.0
"""[s] A process that is still sending by then is killed."""


class RemoteCounter:
    """A topic that a camera's process publishes; counts like a publisher."""

    def __init__(self, topic: str, camera: "CameraProcess", subscribers: Callable[[], int]) -> None:
        self.topic, self._camera = topic, camera
        self.get_subscription_count = subscribers
        self.publisher = self

    @property
    def connected(self) -> bool:
        """Whether the camera's process is connected to all subscribers that the node sees."""
        return self._camera.connected.get(self.topic, 0) >= self.get_subscription_count()

    @property
    def count(self) -> int:
        """Messages so far."""
        return self._camera.counts.get(self.topic, 0)

    def wait_for_all_acked(self, timeout: Any) -> bool:
        """Wait until all frames that were due are published."""
        return self._camera.wait_until_idle(timeout.nanoseconds * 1e-9)


class CameraProcess:
    """One camera's process, seen from the node."""

    def __init__(
        self,
        name: str,
        start: dict[str, Any],
        fail: Fail,
        warn: Callable[[str], None],
        note: Callable[[str], None],
    ) -> None:
        """Start the process.

        :param start: its configuration, as JSON can hold it.
        :param fail: receives what ended the process.
        :param warn: receives a warning for the log.
        :param note: receives a line that is none.
        """
        self.name, self._fail, self._warn, self._note = name, fail, warn, note
        self.counts: dict[str, int] = {}
        self.connected: dict[str, int] = {}
        """Subscribers that each of its publishers is connected to, until the run begins."""
        self.ready = False
        self._sent = self._done = 0
        self._closing = self._overflow = False
        self._changed = threading.Condition()
        environment = {**fast_dds.without_own_profile(os.environ), "OMP_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "imu_sim_ros.nodes.simulator.camera_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**environment, "OPENBLAS_NUM_THREADS": "1"},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._input: IO[bytes] = self._process.stdin
        self._output: IO[bytes] = self._process.stdout
        self._input.write(as_json(start).encode() + b"\n")
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

        :param timeout: [s] without any frame; longer than one takes on a busy machine.
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
            said = json.loads(line)
            with self._changed:
                self.counts.update(said.get("counts", {}))
                self.connected.update(said.get("connected", {}))
                self._done = said.get("done", self._done)
                self.ready |= "ready" in said
                self._changed.notify_all()
            for warning in said.get("warnings", ()):
                self._warn(f"{self.name}: {warning}")
            for note in said.get("notes", ()):
                self._note(f"{self.name}: {note}")
            if "problems" in said:
                ended = True
                kind = ConfigurationError if said["status"] == 2 else MachineError
                self._fail(kind(said["problems"]))
        if not (self._closing or ended):
            status = self._process.wait()
            self._fail(MachineError(f"{self.name}: the camera's process ended, status {status}"))


class CameraStream:
    """The frames of one camera as tokens, each due when the camera's driver lets it go."""

    def __init__(self, view: View, send: Callable[[bytes], None]) -> None:
        """Connect a camera with its publisher.

        :param view: with the start at 0 ns.
        """
        self._view, self._send = view, send
        self._position = self._t0_ns = 0

    def restart(self, t0_ns: int) -> None:
        """Go back to the first frame."""
        self._position, self._t0_ns = 0, t0_ns

    def advance(self, end: float) -> Iterator[Piece]:
        """Yield the frames taken before ``end`` that are not lost."""
        p = self._view.parameters
        until = timebase.sample_count(max(end - p.phase, 0.0), p.rate)
        if self._view.total is not None:
            until = min(until, self._view.total)
        if until <= self._position:
            return
        frames = self._view.frames(self._position, until - self._position)
        self._position = until
        rows = np.flatnonzero(frames.delivered)
        tokens = [TOKEN.pack(k, self._t0_ns) for k in frames.number[rows].tolist()]
        yield Piece(frames.release_t_ns[rows] + self._t0_ns, self._send, tokens)


class Cameras:
    """All cameras of the node."""

    def __init__(
        self, node: Any, parameters: SimulatorParameters, duration: float, fail: Fail
    ) -> None:
        """Start a process for each camera.

        :param duration: of the run [s], perhaps infinite.
        """
        rig: RigParameters = parameters.rig
        log = node.get_logger()
        self.topics: list[str] = []
        """Full names of all topics that the processes publish."""
        self.counters: list[RemoteCounter] = []
        self.streams: list[CameraStream] = []
        self._processes: list[CameraProcess] = []
        self._requested_at = 0.0
        self.mounts = [_mount(rig.frame(n), c) for n, c in rig.each().items()]
        for name, camera in rig.each().items():
            topics = _topics_of(name, rig)
            names = {topic: node.resolve_topic_name(topic) for topic in topics}
            start = {
                "camera": name,
                "parameters": flatten(parameters),
                "topics": names,
                "node": f"{node.get_name()}_{name}",
                "namespace": node.get_namespace(),
                "overrides": {
                    f"{_OVERRIDES}.{key}": parameter.value
                    for key, parameter in node.get_parameters_by_prefix(_OVERRIDES).items()
                },
            }
            process = CameraProcess(name, start, fail, log.warning, log.info)
            self._processes.append(process)
            self.topics += names.values()
            self.counters += [
                RemoteCounter(topic, process, partial(node.count_subscribers, full))
                for topic, full in names.items()
            ]
            view = View(name, camera, parameters.seed, 0, duration)
            self.streams.append(CameraStream(view, process.send))

    @property
    def ready(self) -> bool:
        """Whether all cameras have their first frames."""
        return all(process.ready for process in self._processes)

    def connected(self, now: float) -> bool:
        """Whether the processes are connected to all subscribers, or have tried long enough.

        :param now: [s], of a clock that never jumps.
        """
        self._requested_at = self._requested_at or now
        late = now - self._requested_at > _LONGEST_CONNECTION
        return late or all(counter.connected for counter in self.counters)

    def close(self) -> None:
        """End the processes."""
        for process in self._processes:
            process.close()


def _topics_of(name: str, rig: RigParameters) -> list[str]:
    """Return the topics of a camera's process; the first one also has the common topics."""
    own = [topic for topic in camera_topics(rig) if topic.startswith(f"{name}/")]
    if name != rig.cameras[0]:
        return own
    seen = tuple(f"{other}/" for other in rig.cameras)
    return [*own, *(t for t in camera_topics(rig) if not t.startswith(seen)), MARKERS_TOPIC]


def _mount(frame: str, camera: CameraParameters) -> Mount:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = camera.pose()
    return Mount(frame, pose)
