# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Memory of the jobs that read whole recordings, for each reading with its pose."""

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.core import blocks
from imu_sim_ros.core.memory import join
from imu_sim_ros.navigation import dead_reckoning
from imu_sim_ros.recordings.findings import catalogue

POSE = 8 * 14
"""Stamp, position, attitude, velocity and angular rate of a pose [bytes]."""
READING = 8 * 7
"""Stamp, angular rate and specific force of a reading [bytes]."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """Return a recording with its truth, and the number of its readings."""
    flight = ims.simulate(imu="bmi088", trajectory="lecture", duration=900, rate=200)
    path = tmp_path_factory.mktemp("memory") / "flight.mcap"
    return flight.save(path), len(flight.readings)


def peak_of(job: Callable[[], object]) -> int:
    """Return the largest memory that a job takes [bytes]."""
    tracemalloc.start()
    job()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def test_columns_are_joined_and_removed():
    parts = [np.arange(3.0 * k).reshape(k, 3) for k in (2, 0, 5)]
    expected = np.concatenate(parts)
    np.testing.assert_array_equal(join(parts), expected)
    assert parts == []
    assert join([np.arange(3)]).dtype == np.int64


def test_dead_reckon_holds_readings_truth_and_states_alone(recording, monkeypatch):
    """Of a state, position, velocity and attitude; errors against the truth are no arrays.

    Arrays of a block, and the chunks of the bag, take up to 4 MiB. Errors at every time took 72
    bytes more for each reading.
    """
    monkeypatch.setattr(blocks, "ROWS", 8192)
    monkeypatch.setattr(dead_reckoning, "_BLOCK", 2048)
    monkeypatch.setattr(catalogue, "_JUDGED", 1000)
    path, number = recording
    ims.dead_reckon(ims.simulate(duration=10, rate=200)).to_dict()  # imports and caches
    peak = peak_of(lambda: ims.dead_reckon(path).to_dict())
    assert peak < number * (READING + POSE + 8 * 10) + 2**22


def test_inspect_holds_one_record_at_a_time(recording, monkeypatch):
    """The poses, time and angles of the turns by readings and by poses, and four numbers more.

    These are the rows, stamps and losses of the clock, while there are no turns by the poses yet.
    A block has 8,192 rows of at most 64 numbers, 4 MiB. Both records at once, with arrays of whole
    recordings, took 395 bytes for each reading, 71 MB.
    """
    monkeypatch.setattr(blocks, "ROWS", 8192)
    monkeypatch.setattr(catalogue, "_JUDGED", 1000)
    path, number = recording
    ims.inspect(ims.simulate(duration=10, rate=200))  # imports and caches
    peak = peak_of(lambda: ims.inspect(path))
    assert peak < number * (POSE + 8 * (4 + 4 + 4)) + 2**22
