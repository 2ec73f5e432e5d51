# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Memory of the jobs that read whole recordings, for each reading with its pose."""

import tracemalloc

import imu_sim_ros as ims
from imu_sim_ros.core import blocks
from imu_sim_ros.recordings.findings import catalogue

POSE = 8 * 14
"""Stamp, position, attitude, velocity and angular rate of a pose [bytes]."""


def test_inspect_holds_one_record_at_a_time(tmp_path, monkeypatch):
    """The poses, time and angles of the turns by readings and by poses, and four numbers more.

    These are the rows, stamps and losses of the clock, while there are no turns by the poses yet.
    A block has 8,192 rows of at most 64 numbers, 4 MiB. Both records at once, with arrays of whole
    recordings, took 395 bytes for each reading, 71 MB.
    """
    monkeypatch.setattr(blocks, "ROWS", 8192)
    monkeypatch.setattr(catalogue, "_JUDGED", 1000)
    flight = ims.simulate(imu="bmi088", trajectory="lecture", duration=900, rate=200)
    path, number = flight.save(tmp_path / "flight.mcap"), len(flight.readings)
    del flight
    ims.inspect(ims.simulate(duration=10, rate=200))  # imports and caches
    tracemalloc.start()
    ims.inspect(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < number * (POSE + 8 * (4 + 4 + 4)) + 2**22
