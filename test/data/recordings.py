# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recorded poses and readings: the file in the repository, and those that it may not contain."""

from pathlib import Path

HERE = Path(__file__).parent / "recorded"
TUM = HERE / "tum_freiburg1_xyz_groundtruth.txt"
"""30 s of a hand-held camera at 100 Hz, with gaps; recorded/README.md has origin and licence."""


def elsewhere(name: str) -> Path:
    """Return the path of a recording that a user has put here, or next to the repository."""
    shared_file = HERE.parents[2].parent / "shared/data" / name
    return shared_file if shared_file.is_file() and not (HERE / name).is_file() else HERE / name


EUROC = elsewhere("euroc_V1_02_medium_groundtruth.csv")
EUROC_IMU = elsewhere("euroc_V1_02_medium_imu_40s.csv")
KAIST = elsewhere("kaist_vio_infinite_fast.txt")


def missing(path: Path) -> str:
    """Return the reason of a skip; conftest.py knows its beginning."""
    return f"no recorded poses in {path.name}: see test/data/recorded/README.md"
