# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the kernel is told about threads: who must wake up at once, and who may wait.

A sample is due while images are being rendered on all processors. Linux lets a running thread
finish its slice of a few milliseconds before one that wakes up, unless the latter asks for shorter
slices (EEVDF, since 6.12) or the former is a batch job. Nothing here needs a privilege; where the
kernel does not know a request, things stay as they are.
"""

import ctypes
import os
import platform
import struct
import threading
from contextlib import suppress
from typing import Final

_SET_ATTRIBUTES: Final = {"x86_64": 314, "aarch64": 274}
"""Number of the system call sched_setattr by machine; glibc has no function for it before 2.41."""
_ATTRIBUTES: Final = struct.Struct("<IIQiIQQQ")
"""struct sched_attr: size, policy, flags, nice, priority, runtime, deadline, period."""
_SHORTEST_SLICE_NS: Final = 100_000
"""The least that the kernel grants."""


def wake_up_at_once() -> None:
    """Ask for the shortest slices for this thread: it wakes up often, and never computes long."""
    number = _SET_ATTRIBUTES.get(platform.machine())
    if number is None or not hasattr(os, "SCHED_OTHER"):
        return
    if os.sched_getscheduler(0) != os.SCHED_OTHER:  # the user has chosen, chrt for instance
        return
    nice = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
    size = _ATTRIBUTES.size
    wanted = _ATTRIBUTES.pack(size, os.SCHED_OTHER, 0, nice, 0, _SHORTEST_SLICE_NS, 0, 0)
    with suppress(OSError, AttributeError):  # no such function: no such request
        ctypes.CDLL(None).syscall(number, 0, wanted, 0)


def stand_back(nice: int) -> None:
    """Let this thread be a batch job of lower priority.

    :param nice: how much lower.
    """
    identity = threading.get_native_id()
    with suppress(OSError, AttributeError):
        own = os.getpriority(os.PRIO_PROCESS, identity)
        os.setpriority(os.PRIO_PROCESS, identity, min(own + nice, 19))
        if os.sched_getscheduler(0) == os.SCHED_OTHER:
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
