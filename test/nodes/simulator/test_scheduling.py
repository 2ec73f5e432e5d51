# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Threads that wake up at once and threads that stand back, as the kernel sees them."""

import os
import threading

import pytest

from imu_sim_ros.nodes.simulator import scheduling

pytestmark = pytest.mark.ros


def in_a_thread(act, *arguments):
    """Return nice value and policy of a thread after a call, which is not the main one."""
    found = []

    def run():
        act(*arguments)
        nice = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
        found.append((nice, os.sched_getscheduler(0)))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    return found[0]


def test_a_rendering_thread_stands_back_alone():
    before = os.getpriority(os.PRIO_PROCESS, 0), os.sched_getscheduler(0)
    if before[1] != os.SCHED_OTHER:
        pytest.skip("THE TEST RUNS WITH A POLICY OF ITS OWN")
    wanted = (min(before[0] + 5, 19), os.SCHED_BATCH)
    assert in_a_thread(scheduling.stand_back, 5) == wanted
    assert (os.getpriority(os.PRIO_PROCESS, 0), os.sched_getscheduler(0)) == before


def test_a_publishing_thread_keeps_its_priority(monkeypatch):
    before = os.getpriority(os.PRIO_PROCESS, 0), os.sched_getscheduler(0)
    assert in_a_thread(scheduling.wake_up_at_once) == before
    monkeypatch.setattr(scheduling.platform, "machine", lambda: "unknown")
    assert in_a_thread(scheduling.wake_up_at_once) == before
