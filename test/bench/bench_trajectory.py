# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories: samples per second, and the time it takes to read and fit recorded poses."""

import statistics
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.records import States
from imu_sim_ros.inputs.poses import read_poses, write_tum
from imu_sim_ros.parameters import files
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.terminal.text_tables import print_table
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.motion import Trajectory
from imu_sim_ros.trajectory.recorded import find_recorded_motion

BLOCK = 8192
RATE = 200.0
NEEDED = 0.35e6  # pairs of IMU and truth per second that `generate` shall write
DATA = Path(__file__).parents[2].parent / "shared/data"


def median_time(run: Callable[[], object], repetitions: int = 9) -> float:
    """Return the median time of a call [s]; the first one is left out."""
    run()
    times = []
    for _ in range(repetitions):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def build(**values: object) -> Trajectory:
    """Build a trajectory from its parameters."""
    layer = {f"trajectory.{name.replace('__', '.')}": v for name, v in values.items()}
    return build_trajectory(load_simulation(layer).trajectory)


def sampling() -> None:
    """Print the speed of every trajectory, in blocks of the stream's size."""
    runs: dict[str, dict[str, object]] = {
        name: {"type": name} for name in files.names("trajectories")
    }
    runs["lecture, rest before"] = {"type": "lecture", "rest_before": 1.0}
    runs["lecture, vibration noise"] = {"type": "lecture", "vibration__noise_rms": 1.0}
    for path in (*sorted(DATA.glob("*groundtruth*")), *sorted(DATA.glob("kaist*"))):
        runs[f"poses: {path.name}"] = {"type": "poses", "file": str(path)}
    rows = []
    for name, values in runs.items():
        trajectory = build(**values)
        t = np.arange(BLOCK) / RATE % min(trajectory.duration, 1e9)
        speed = BLOCK / median_time(partial(trajectory.sample, t), 25)
        rows.append([name, f"{speed / 1e6:.2f}", f"{speed / NEEDED:.1f}"])
    print_table(
        ["trajectory", "M samples/s", f"of {NEEDED / 1e6} M/s"],
        rows,
        f"sample(t), blocks of {BLOCK}",
    )


def fitting() -> None:
    """Print how long it takes to read pose files and to fit splines through them."""
    with tempfile.TemporaryDirectory() as folder:
        written = half_hour(Path(folder) / "half_hour.txt")
        paths = (*sorted(DATA.glob("*groundtruth*")), *sorted(DATA.glob("kaist*")), written)
        rows = [fit_row(path) for path in paths]
    header = ["file", "poses", "read, k/s", "fit, s", "RMS mm", "RMS deg"]
    print_table(header, rows, "recorded poses")


def half_hour(path: Path) -> Path:
    """Write half an hour of poses at 200 Hz."""
    t = np.arange(360_000) * 0.005
    position = np.column_stack([np.sin(t), np.cos(1.3 * t), 0.5 * np.sin(2 * t)])
    euler = np.column_stack([0.4 * np.sin(1.1 * t), 0.3 * np.cos(0.9 * t), 0.8 * t])
    stamps = np.round(t * 1e9).astype(np.int64)
    write_tum(path, States(stamps, position, rotation.from_euler(euler)))
    return path


def fit_row(path: Path) -> list[str]:
    """Return one row of the table of fits."""
    reading = median_time(lambda: read_poses(path), 3)
    both = median_time(lambda: build(type="poses", file=str(path)), 3)
    motion = find_recorded_motion(build(type="poses", file=str(path)))
    assert motion is not None
    report = motion.report
    return [
        path.name,
        f"{report.poses:,}",
        f"{report.poses / reading / 1e3:.0f}",
        f"{both - reading:.2f}",
        f"{report.rms_position * 1e3:.3f}",
        f"{np.degrees(report.rms_angle):.4f}",
    ]


def main() -> None:
    """Print both tables."""
    sampling()
    fitting()


if __name__ == "__main__":
    main()
