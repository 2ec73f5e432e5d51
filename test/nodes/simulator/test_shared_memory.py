# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Remains of a killed process in shared memory do not make later nodes hang."""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from imu_sim_ros.nodes.fast_dds import FOLDER, remove_torn_segments

LONG_AGO = time.time() - 60


def segment(folder: Path, name: str, content: bytes, changed: float = LONG_AGO) -> Path:
    path = folder / name
    path.write_bytes(content)
    os.utime(path, (changed, changed))
    return path


def test_only_what_was_never_finished_is_removed(tmp_path):
    empty = segment(tmp_path, "fastrtps_port7411", b"")
    begun = segment(tmp_path, "fastrtps_port7413", b"\1\0\0\0" + bytes(60))
    ready = segment(tmp_path, "fastrtps_port7415", b"\2\0\0\0" + bytes(60))
    lock = segment(tmp_path, "fastrtps_port7415_el", b"")
    foreign_segment = segment(tmp_path, "somebody_else", b"")
    being_made = segment(tmp_path, "fastrtps_port7417", b"", time.time())
    assert remove_torn_segments(tmp_path) == []
    assert not empty.exists()
    assert not begun.exists()
    assert all(path.exists() for path in (ready, lock, foreign_segment, being_made))


@pytest.fixture
def torn(domains: tuple[int, int]) -> Iterator[list[Path]]:
    """Write the torn segments that a kill in the first microseconds leaves, for 20 participants."""
    # DDS-RTPS 2.2, 9.6.1.1: port base 7400, domain gain 250, participant gain 2, offset 11.
    ports = [7400 + 250 * domains[1] + 11 + 2 * participant for participant in range(20)]
    paths = [FOLDER / f"fastrtps_port{port}" for port in ports]
    yield [segment(FOLDER, path.name, b"") for path in paths if not path.exists()]
    for path in paths:
        path.unlink(missing_ok=True)


@pytest.mark.ros
def test_a_node_starts_where_another_was_killed_while_it_started(
    start: Callable[..., Any], domains: tuple[int, int], torn: list[Path]
) -> None:
    node = start("simulator", duration=0.2, rate=100.0, domain=domains[1])
    assert node.status() == 0, node.output
    assert torn
