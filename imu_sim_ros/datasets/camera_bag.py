# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags with images, tracks and landmarks of cameras in addition to the readings."""

from collections import deque
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.bags.writer import BagTopic, Block
from imu_sim_ros.conventions import (
    BODIES_TOPIC,
    COMPRESSED_TOPIC,
    DEPTH_TOPIC,
    FEATURES_TOPIC,
    FLOW_TOPIC,
    IMAGE_TOPIC,
    LANDMARKS_TOPIC,
    MASK_TOPIC,
)
from imu_sim_ros.datasets.bodies import BodyMessages
from imu_sim_ros.datasets.features import (
    LATCHED,
    CameraMessages,
    FeatureStream,
    camera_topics,
    imagers,
    landmarks,
)
from imu_sim_ros.datasets.topics import BagTarget, Read, resolved
from imu_sim_ros.datasets.tracks import CameraProgress
from imu_sim_ros.sensors.camera.images.renderer import opencv
from imu_sim_ros.sensors.camera.rig import Rig
from imu_sim_ros.sensors.pose.declaration import NAME as POSE

_SPAN: Final = 0.5
"""Simulated seconds in a block: two of them are in memory, with their images."""


class _Waiting:
    """A window of readings, and its frames in progress."""

    def __init__(self, read: Read) -> None:
        self.read = read
        self.frames: list[tuple[str, int, Future[dict[str, bytes]]]] = []
        """Camera, stamp [ns], messages by topic."""
        self.features: list[tuple[int, bytes]] = []
        self.bodies: list[tuple[str, int, bytes]] = []
        """Topic, time [ns], message."""


class CameraBag:
    """Blocks of samples and the frames taken meanwhile, into a bag; use as a context manager.

    Threads make the images of a block while the one before it is written.
    """

    def __init__(self, bag: BagTarget, rig: Rig, names: Mapping[str, str], jobs: int) -> None:
        """Make the cameras' topics.

        :param names: for each topic of the cameras that is written its name in the bag.
        :param jobs: threads.
        """
        self.bag, self._rig = bag, rig
        self.block_size = max(1, round(_SPAN * bag.fastest))
        types = camera_topics(rig.parameters)
        self._topics: dict[str, BagTopic] = {
            key: bag.writer.add_topic(
                resolved(name), types[key], [LATCHED] if key == LANDMARKS_TOPIC else None
            )
            for key, name in names.items()
        }
        encoding = bag.writer.encoding
        self._cameras = [CameraProgress(rig, name) for name in self._with_frames()]
        seen = [c.name for c in self._cameras if self._wants_images(c.name)]
        makers = imagers(rig, seen)
        if makers:
            opencv().setNumThreads(1)  # the threads are ours
        self._messages = {
            c.name: CameraMessages(
                c.view, rig.parameters.frame(c.name), makers.get(c.name), encoding
            )
            for c in self._cameras
        }
        self._features = self._blind = None
        if FEATURES_TOPIC in self._topics:
            layout = rig.parameters.features.layout
            self._features = FeatureStream(rig, layout, bag.world_frame, encoding)
            self._blind = CameraProgress(rig, next(iter(rig.views)))
        self._bodies = BodyMessages(rig, bag.world_frame, encoding)
        self._with_bodies = CameraProgress(rig, self._bodies.view.name)
        self._pool = ThreadPoolExecutor(max(1, jobs), thread_name_prefix="images")
        self._waiting: deque[_Waiting] = deque()
        self._begun = False

    def _with_frames(self) -> list[str]:
        """Return the cameras of which any topic is written."""
        return [n for n in self._rig.views if any(t.startswith(f"{n}/") for t in self._topics)]

    def _wants_images(self, name: str) -> bool:
        topics = (IMAGE_TOPIC, COMPRESSED_TOPIC, DEPTH_TOPIC, MASK_TOPIC, FLOW_TOPIC)
        return any(f"{name}/{topic}" in self._topics for topic in topics)

    @property
    def counts(self) -> dict[str, int]:
        """Messages by topic."""
        return self.bag.counts | {t.name: t.count for t in self._topics.values()}

    @property
    def files(self) -> list[Path]:
        """The files of the bag."""
        return self.bag.files

    def described(self) -> str:
        """Return how much was written."""
        return self.bag.described()

    def write(self, read: Read) -> None:
        """Request the frames taken until a window's end, and write the window before it."""
        waiting, poses = _Waiting(read), read[POSE].true_t_ns
        if len(poses):
            self._order(waiting, int(poses[-1]) + 1)
        self._waiting.append(waiting)
        if len(self._waiting) > 1:
            self._put(self._waiting.popleft())

    def _order(self, waiting: _Waiting, end: int) -> None:
        """Request the frames taken before a time [ns]."""
        for camera in self._cameras:
            make = self._messages[camera.name].messages
            while count := camera.until(end):
                frames = camera.view.frames(camera.position, count)
                for k in np.flatnonzero(frames.delivered).tolist():
                    t_ns = int(frames.t_ns[k])
                    made = self._pool.submit(make, int(frames.number[k]), t_ns)
                    waiting.frames.append((camera.name, t_ns, made))
                camera.position += count
        self._track(waiting, end)
        self._look_at_bodies(waiting, end)

    def _track(self, waiting: _Waiting, end: int) -> None:
        """Request the features of the frames before a time."""
        if self._features is None or self._blind is None:
            return
        while count := self._blind.until(end):
            waiting.features += [(m.t_ns, m.payload) for m in self._features.next(count)]
            self._blind.position += count

    def _look_at_bodies(self, waiting: _Waiting, end: int) -> None:
        """Add where bodies are at the frames before a time."""
        progress = self._with_bodies
        while any(topic.startswith(BODIES_TOPIC) for topic in self._topics) and (
            count := progress.until(end)
        ):
            frames = progress.view.frames(progress.position, count)
            for k in np.flatnonzero(frames.delivered).tolist():
                t_ns = int(frames.true_t_ns[k])
                made = self._bodies.messages(int(frames.number[k]))
                waiting.bodies += [(t, t_ns, each) for t, each in made.items() if t in self._topics]
            progress.position += count

    def _put(self, waiting: _Waiting) -> None:
        """Write a block with its frames."""
        blocks = [*self._latched(waiting.read), *self.bag.messages(waiting.read)]
        if waiting.features:
            times = np.array([t_ns for t_ns, _ in waiting.features])
            clouds = [payload for _, payload in waiting.features]
            blocks.append(Block(self._topics[FEATURES_TOPIC], times, clouds))
        found: dict[BagTopic, tuple[list[int], list[bytes]]] = {}
        made = [
            (f"{camera}/{below}", t_ns, payload)
            for camera, t_ns, messages in waiting.frames
            for below, payload in messages.result().items()
        ]
        for name, t_ns, payload in (*made, *waiting.bodies):
            topic = self._topics.get(name)
            if topic is not None:
                stamps, payloads = found.setdefault(topic, ([], []))
                stamps.append(t_ns)
                payloads.append(payload)
        blocks += [Block(t, np.array(stamps), rows) for t, (stamps, rows) in found.items()]
        self.bag.writer.write_blocks(blocks)

    def _latched(self, read: Read) -> list[Block]:
        """Return the landmarks, once."""
        if self._begun or LANDMARKS_TOPIC not in self._topics or not len(read[POSE].true_t_ns):
            return []
        self._begun = True
        t_ns = int(read[POSE].true_t_ns[0])
        encoding = self.bag.writer.encoding
        cloud = landmarks(self._rig.scene, self.bag.world_frame, t_ns, encoding)
        return [Block(self._topics[LANDMARKS_TOPIC], np.array([t_ns]), [cloud])]

    def __enter__(self) -> "CameraBag":
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        try:
            while self._waiting and error is None:
                self._put(self._waiting.popleft())
        finally:
            self._pool.shutdown(cancel_futures=True)
