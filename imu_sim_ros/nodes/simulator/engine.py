# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The two threads of the simulator: one computes blocks in advance, one publishes them on time."""

import queue
import threading
import time
from collections.abc import Callable
from typing import Final, NamedTuple

from imu_sim_ros.nodes.lifetime import Fail, SupervisedThread
from imu_sim_ros.nodes.simulator.pacing import Pacer, SampleAction
from imu_sim_ros.nodes.simulator.publish_queue import Group, PublishQueue

_LEAD_NS: Final = 10_000_000
"""The first sample is due this long after time zero is chosen: its block has to be computed."""
_STARTS: Final = 4
"""Time zero is chosen at most this many times."""

_BLOCKS_AHEAD: Final = 1
"""Number of blocks that are computed ahead."""
_UNPACED_FACTOR: Final = 10.0
"""Real-time factor that is assumed for samples as fast as possible."""
_UNACKNOWLEDGED: Final = 500
"""Samples that are published without waiting for the subscribers, if nothing else paces them."""
_LONGEST_END: Final = 0.2
"""Longest wait of the shutdown for a block that is being computed [s]."""


class _Block(NamedTuple):
    """Messages of a window of time, ready to be published."""

    run: int
    t0_ns: int
    start_ns: int
    groups: list[Group]
    is_last: bool


class Engine:
    """Plays a queue of messages; all methods may be called from any thread."""

    def __init__(
        self,
        publish_queue: PublishQueue,
        pacer: Pacer,
        block_duration: float,
        *,
        ready: Callable[[], bool],
        zero: Callable[[int], int],
        acknowledged: Callable[[], bool],
        on_end: Callable[[], None],
        fail: Fail,
    ) -> None:
        """Set up the threads; :meth:`start` lets them run.

        :param ready: whether the first sample may be published.
        :param zero: returns the time of the first sample [ns], which is due after that many [ns].
        :param acknowledged: waits briefly; returns whether all subscribers have everything.
        :param on_end: called at the end of the run.
        :param fail: receives what went wrong in one of the threads.
        """
        self.pacer = pacer
        self.started = False
        self._queue = publish_queue
        self._block_duration = block_duration
        self._ready, self._zero = ready, zero
        self._acknowledged, self._on_end, self._fail = acknowledged, on_end, fail
        self._run = self._unacknowledged = 0
        self._stopped = False
        self._lock = threading.Lock()
        self._changes: list[Callable[[], None]] = []
        self._blocks: queue.SimpleQueue[_Block | None] = queue.SimpleQueue()
        self._room = threading.Semaphore(_BLOCKS_AHEAD)
        self._threads = [
            SupervisedThread("compute", self._compute, self._take_failure),
            SupervisedThread("publish", self._publish, self._take_failure),
        ]

    def start(self) -> None:
        """Start the threads."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End the threads and discard unpublished samples."""
        self._stopped = True
        self.pacer.interrupt()
        self._room.release()
        self._blocks.put(None)
        for thread in self._threads:
            thread.join(_LONGEST_END)

    def change(self, change: Callable[[], None]) -> None:
        """Call a function that changes the publisher, before the next block is computed."""
        with self._lock:
            self._changes.append(change)

    def reset(self) -> None:
        """Restart with the first sample."""
        with self._lock:
            self._run += 1
            self.pacer.interrupt()

    def _take_failure(self, error: BaseException) -> None:
        """End the node with an error, unless it has ended."""
        if not self._stopped:  # after the end the publishers are gone, and nobody needs them
            self._fail(error)

    # The computing thread.

    def _compute(self) -> None:
        """Compute blocks ahead of the publisher; runs in a thread."""
        while not self._ready():
            if self._stopped:
                return
            time.sleep(0.01)
        run, t0_ns, start_ns = -1, 0, 0
        while True:
            self._room.acquire()
            if self._stopped:
                return
            if run != self._run:
                run = self._run
                t0_ns, start_ns, groups = self._begin()
            else:
                self._apply_changes()
                groups = self._queue.next_groups(self._block_length())
            self._blocks.put(_Block(run, t0_ns, start_ns, groups, self._queue.finished))
            while self._queue.finished and run == self._run and not self._stopped:
                time.sleep(0.01)

    def _begin(self) -> tuple[int, int, list[Group]]:
        """Return time zero, when it is on the steady clock, and the first block.

        On a loaded machine, or at many times real time, the block may take longer than the lead.
        Samples that fell due meanwhile would go out all at once, and a subscriber with a short
        queue (rosbag2's holds 10) would lose the first. So time zero is chosen again, with a
        sufficient lead; but not after changes such as faults, which take effect only once.
        """
        lead_ns = _LEAD_NS
        for _ in range(_STARTS):
            start_ns = time.monotonic_ns() + lead_ns
            t0_ns = self._zero(lead_ns)
            self._queue.restart(t0_ns)
            self.started = True
            changed = self._apply_changes()
            groups = self._queue.next_groups(self._block_length())
            late_ns = time.monotonic_ns() - start_ns
            if changed or late_ns < 0 or self.pacer.speed == 0:
                break
            lead_ns = 2 * (lead_ns + late_ns)
        return t0_ns, start_ns, groups

    def _apply_changes(self) -> bool:
        """Make the requested changes; return whether there were any."""
        with self._lock:
            changes, self._changes = self._changes, []
        for change in changes:
            change()
        return bool(changes)

    def _block_length(self) -> float:
        """Return seconds of simulated time that take about ``block_duration`` to play."""
        speed = self.pacer.speed
        return self._block_duration * (max(speed, 1.0) if speed else _UNPACED_FACTOR)

    # The publishing thread.

    def _publish(self) -> None:
        """Publish each block when it is due; runs in a thread."""
        anchored = -1
        while (block := self._blocks.get()) is not None:
            self._room.release()
            with self._lock:  # a reset that arrives now must not be undone
                if block.run != self._run:
                    continue
                if block.run != anchored:
                    anchored = block.run
                    self.pacer.interrupt(False)
                    self.pacer.anchor(block.t0_ns, block.start_ns)
            complete = self._play(block)
            if complete and block.is_last:
                self.pacer.end_stall()
            if complete and block.is_last and self._wait_for_acknowledgement(5.0):
                self._on_end()
                return

    def _play(self, block: _Block) -> bool:
        """Publish a block; False if the run was interrupted."""
        wait, go, unpaced = self.pacer.wait, SampleAction.GO, self.pacer.speed == 0
        for time_ns, messages in block.groups:
            verdict = wait(time_ns)
            if verdict is go:
                for send, payload in messages:
                    send(payload)
            elif verdict is SampleAction.INTERRUPTED:
                return False
            if unpaced:
                self._unacknowledged += 1
                if self._unacknowledged >= _UNACKNOWLEDGED:
                    self._unacknowledged = 0
                    self._wait_for_acknowledgement(60.0)
        return True

    def _wait_for_acknowledgement(self, longest: float) -> bool:
        """Wait, for a limited time, until the subscribers have everything; False on a reset."""
        run, end = self._run, time.monotonic() + longest
        while not self._acknowledged() and time.monotonic() < end:
            if self._stopped or run != self._run:
                return False
        return run == self._run and not self._stopped
