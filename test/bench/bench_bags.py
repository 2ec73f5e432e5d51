# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags: generate into every form, against rosbags' own loop and the raw speed of the disk; reading.

MESSAGES sets the number of messages of the main rows (default 2,880,000: 4 h at 200 Hz); LONG=1
adds 24 h at 400 Hz. Every row is a process of its own; the peak memory is that of the process.
"""

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.messages.schemas import typestore_of_format
from imu_sim_ros.bags.read import imu_blocks
from imu_sim_ros.terminal.text_tables import print_table

MESSAGES = int(os.environ.get("MESSAGES", "2880000"))
SLOW = max(MESSAGES // 10, 1)
"""Messages of the slow rows: rosbags' loop, bzip2, sqlite3's peers."""
RATE = 200.0
STATIC = ["--trajectory", "static", "--imu", "lecture", "--rate", str(RATE), "--quiet"]

# Name, output, arguments, share of MESSAGES.
GENERATE = {
    "mcap none": ("x.mcap", ["--imu-only"], 1),
    "mcap lz4": ("x.mcap", ["--imu-only", "--compression", "lz4"], 1),
    "mcap zstd": ("x.mcap", ["--imu-only", "--compression", "zstd"], 1),
    "ROS 1 none": ("x.bag", ["--imu-only"], 1),
    "ROS 1 lz4": ("x.bag", ["--imu-only", "--compression", "lz4"], 1),
    "ROS 1 bz2": ("x.bag", ["--imu-only", "--compression", "bz2"], 10),
    "sqlite3": ("x", ["--imu-only", "--storage", "sqlite3"], 1),
    "mcap none, pairs": ("x.mcap", [], 2),
    "mcap lz4, pairs": ("x.mcap", ["--compression", "lz4"], 2),
    "EuRoC, IMU": ("x", ["--imu-only", "--format", "euroc"], 4),
    "CSV, IMU": ("x.csv", [], 4),
    "EuRoC, pairs": ("x", ["--format", "euroc"], 8),
}


PROGRAM = str(Path(sys.executable).with_name("generate"))


def generated(name: str, folder: Path) -> list[str]:
    """Return the command line that generates one form."""
    output, arguments, share = GENERATE[name]
    duration = f"{MESSAGES // share / RATE}s"
    return [PROGRAM, "-o", str(folder / output), *STATIC, *arguments, "--duration", duration]


def day(_: str, folder: Path) -> list[str]:
    """Return the command line that generates 24 h at 400 Hz."""
    arguments = ["--imu-only", "--trajectory", "static", "--rate", "400", "--duration", "24h"]
    return [PROGRAM, "-o", str(folder / "x.mcap"), *arguments, "--compression", "lz4", "--quiet"]


def messages(count: int, encoding: str) -> np.ndarray:
    """Return messages of the lecture's noise."""
    rng = np.random.default_rng(1)
    t_ns = 10**9 + 5_000_000 * np.arange(count)
    gyro, accel = rng.standard_normal((2, count, 3)) * 0.2
    return ImuEncoder("imu_link", encoding, 0.045, 0.072).encode(t_ns, gyro, accel)


def rosbags_loop(kind: str, folder: Path) -> None:
    """Serialise and write messages one by one, as rosbags' documentation shows."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2

    encoding = "ros1" if kind == "ROS 1" else "cdr"
    store = typestore_of_format(encoding)
    types = store.types
    count = SLOW
    rng = np.random.default_rng(1)
    gyro, accel = (rng.standard_normal((2, count, 3)) * 0.2).tolist()
    header, stamp = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    vector, quaternion = (types[f"geometry_msgs/msg/{name}"] for name in ("Vector3", "Quaternion"))
    imu = types[IMU]
    covariance = np.zeros(9)
    absent = np.array([-1.0] + [0.0] * 8)
    serialize = getattr(store, f"serialize_{encoding}")
    writer: Writer1 | Writer2
    if kind == "ROS 1":
        writer = Writer1(folder / "x.bag")
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(folder / "x", version=9, storage_plugin=plugin)
    with writer:
        connection = writer.add_connection("/imu", IMU, typestore=store)
        for k in range(count):
            t_ns = 10**9 + 5_000_000 * k
            ros_stamp = stamp(*divmod(t_ns, 10**9))
            head = (
                header(k, ros_stamp, "imu_link")
                if encoding == "ros1"
                else header(ros_stamp, "imu_link")
            )
            message = imu(
                head,
                quaternion(0.0, 0.0, 0.0, 1.0),
                absent,
                vector(*gyro[k]),
                covariance,
                vector(*accel[k]),
                covariance,
            )
            writer.write(connection, t_ns, serialize(message, IMU))


def raw_write(name: str, folder: Path) -> None:
    """Write the bytes of the same messages, and nothing else."""
    block = messages(8192, "cdr").tobytes()
    with (folder / name).open("wb", buffering=0) as file:
        for _ in range(MESSAGES // 8192):
            file.write(block)


def read_back(name: str, folder: Path) -> None:
    """Read an Imu topic into arrays."""
    output = GENERATE[name][0]
    count = sum(len(block.t_ns) for block in imu_blocks(folder / output))
    assert count == MESSAGES


PROGRAMS = {"generate": generated, "day": day}
TASKS = {"rosbags": rosbags_loop, "raw": raw_write, "read": read_back}


def child(task: str, name: str, folder: str) -> None:
    """Run one task in this process and print its seconds."""
    started = time.perf_counter()
    TASKS[task](name, Path(folder))
    print(time.perf_counter() - started)


class Measured(NamedTuple):
    """Some runs of one task."""

    rates: list[float]
    """Messages per second, the lowest first."""
    cpu_us: float
    """Processor time of all cores for a message, the least of all runs [us]."""
    peak_mib: float

    @property
    def median(self) -> float:
        """Return the median of the rates."""
        return statistics.median(self.rates)

    def cells(self) -> list[str]:
        """Return the lowest, the median and the highest rate [k/s], and the processor time."""
        rates = (self.rates[0], self.median, self.rates[-1])
        return [*(f"{rate / 1e3:,.0f}" for rate in rates), f"{self.cpu_us:.2f}"]


def measure(task: str, name: str, folder: Path) -> tuple[float, float, float]:
    """Return wall seconds, processor seconds and the peak memory [MiB].

    Generating counts as a whole process, the start of the interpreter included; for the shorter
    runs of the others (peers, raw writing, reading) that start is left out, in their favour.
    """
    started = time.perf_counter()
    command = [sys.executable, __file__, "--child", task, name, str(folder)]
    if task in PROGRAMS:
        command = PROGRAMS[task](name, folder)
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        output = process.stdout.read()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    wall = time.perf_counter() - started
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    seconds = wall if task in PROGRAMS else float(output)
    return seconds, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def speed(task: str, name: str, count: int, folder: Path, repeat: int = 3) -> Measured:
    """Return the rates, the processor time and the highest peak memory of some runs."""
    runs = []
    for _ in range(repeat):
        if task != "read":
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
        runs.append(measure(task, name, folder))
    walls, cpus, peaks = zip(*runs, strict=True)
    rates = sorted(count / wall for wall in walls)
    return Measured(rates, min(cpus) / count * 1e6, max(peaks))


READ = ("mcap none", "mcap lz4", "mcap zstd", "ROS 1 none", "ROS 1 lz4", "sqlite3")


def tables(folder: Path) -> tuple[list[list[str]], list[list[str]]]:
    """Return the rows of writing and those of reading."""
    raw = speed("raw", "raw", MESSAGES, folder)
    kinds = ("mcap", "ROS 1", "sqlite3")
    peers = {kind: speed("rosbags", kind, SLOW, folder) for kind in kinds}
    rows, reading = [], []
    for name, (_, _, share) in GENERATE.items():
        count = MESSAGES // share
        timing = speed("generate", name, count, folder)
        peer = peers.get(name.rsplit(" ", 1)[0], peers.get(name))
        ratios = [
            f"{timing.median / peer.median:.1f}" if peer else "",
            f"{timing.median / raw.median:.2f}" if share == 1 else "",
        ]
        rows.append([name, f"{count:,}", *timing.cells(), *ratios, f"{timing.peak_mib:.0f}"])
        if name in READ:
            timing = speed("read", name, count, folder)
            reading.append([name, f"{count:,}", *timing.cells(), f"{timing.peak_mib:.0f}"])
    rows += [
        [f"rosbags' loop, {kind}", f"{SLOW:,}", *peer.cells(), "1.0", "", ""]
        for kind, peer in peers.items()
    ]
    rows.append(["raw write", f"{MESSAGES:,}", *raw.cells(), "", "1.00", ""])
    if os.environ.get("LONG"):
        count = 24 * 3600 * 400
        timing = speed("day", "day", count, folder, 1)
        leading_cells = ["24 h at 400 Hz, mcap lz4", f"{count:,}", *timing.cells()]
        rows.append([*leading_cells, "", "", f"{timing.peak_mib:.0f}"])
    return rows, reading


def main() -> None:
    """Print the tables."""
    with tempfile.TemporaryDirectory(dir=os.environ.get("BENCH_FOLDER")) as top:
        rows, reading = tables(Path(top) / "out")
    of_runs = ["messages", "lowest k/s", "median", "highest", "CPU us"]
    header = ["generate, whole process", *of_runs, "x rosbags", "x raw", "peak MiB"]
    print_table(header, rows, "Writing, three runs each (pairs: k pairs/s)")
    print_table(["into arrays", *of_runs, "peak MiB"], reading, "Reading")


if __name__ == "__main__":
    if "--child" in sys.argv:
        child(*sys.argv[2:])
    else:
        main()
