# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags: generate into every form, beside rosbags' own loop and the raw speed of the disk; reading.

MESSAGES sets the number of messages of the main rows (default 2,880,000: 4 h at 200 Hz); LONG=1
adds 24 h at 400 Hz. Every row is a process of its own; the peak memory is that of the process.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.messages.schemas import known_types
from imu_sim_ros.bags.read import imu_blocks
from imu_sim_ros.commands.common import print_table
from imu_sim_ros.commands.generate import main as generate

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


def run_generate(name: str, folder: Path) -> None:
    """Generate one form; what is timed is the whole process."""
    output, arguments, share = GENERATE[name]
    duration = f"{MESSAGES // share / RATE}s"
    generate(["-o", str(folder / output), *STATIC, *arguments, "--duration", duration])


def messages(count: int, encoding: str) -> np.ndarray:
    """Return messages of the lecture's noise."""
    rng = np.random.default_rng(1)
    t_ns = 10**9 + 5_000_000 * np.arange(count)
    gyro, accel = rng.standard_normal((2, count, 3)) * 0.2
    return ImuEncoder("imu_link", encoding).encode(t_ns, gyro, accel, 0.045, 0.072)


def rosbags_loop(kind: str, folder: Path) -> None:
    """Serialise and write messages one by one, as one does with rosbags."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2

    encoding = "ros1" if kind == "ROS 1" else "cdr"
    store = known_types(encoding)
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
    if kind == "ROS 1":
        writer = Writer1(folder / "x.bag")
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(folder / "x", version=9, storage_plugin=plugin)
    with writer:
        connection = writer.add_connection("/imu", IMU, typestore=store)
        for k in range(count):
            t_ns = 10**9 + 5_000_000 * k
            at = stamp(*divmod(t_ns, 10**9))
            head = header(k, at, "imu_link") if encoding == "ros1" else header(at, "imu_link")
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


def raw_write(_: str, folder: Path) -> None:
    """Write the bytes of the same messages, and nothing else."""
    block = messages(8192, "cdr").tobytes()
    with (folder / "raw").open("wb", buffering=0) as file:
        for _ in range(MESSAGES // 8192):
            file.write(block)


def read_back(name: str, folder: Path) -> None:
    """Read an Imu topic into arrays."""
    output = GENERATE[name][0]
    count = sum(len(block.t_ns) for block in imu_blocks(folder / output))
    assert count == MESSAGES


def day(_: str, folder: Path) -> None:
    """Generate 24 h at 400 Hz."""
    arguments = ["--imu-only", "--trajectory", "static", "--rate", "400", "--duration", "24h"]
    generate(["-o", str(folder / "x.mcap"), *arguments, "--compression", "lz4", "--quiet"])


TASKS = {
    "generate": run_generate,
    "rosbags": rosbags_loop,
    "raw": raw_write,
    "read": read_back,
    "day": day,
}


def child(task: str, name: str, folder: str) -> None:
    """Run one task in this process and print its peak memory."""
    started = time.perf_counter()
    TASKS[task](name, Path(folder))
    seconds = time.perf_counter() - started
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"peak_mib": peak, "seconds": seconds}))


def measure(task: str, name: str, folder: Path) -> tuple[float, float]:
    """Return wall seconds and the peak memory [MiB].

    Generating counts as a whole process, the start of the interpreter included; for the shorter
    runs of the others (peers, raw writing, reading) that start is left out, in their favour.
    """
    started = time.perf_counter()
    command = [sys.executable, __file__, "--child", task, name, str(folder)]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    wall = time.perf_counter() - started
    result = json.loads(output)
    return wall if task in ("generate", "day") else result["seconds"], result["peak_mib"]


def speed(task: str, name: str, count: int, folder: Path, repeat: int = 3) -> tuple[float, float]:
    """Return the median of messages per second, and the highest peak memory [MiB]."""
    import shutil
    import statistics

    seconds, peaks = [], []
    for _ in range(repeat):
        if task != "read":
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
        wall, peak = measure(task, name, folder)
        seconds.append(wall)
        peaks.append(peak)
    return count / statistics.median(seconds), max(peaks)


READ = ("mcap none", "mcap lz4", "mcap zstd", "ROS 1 none", "ROS 1 lz4", "sqlite3")


def tables(folder: Path) -> tuple[list[list[str]], list[list[str]]]:
    """Return the rows of writing and those of reading."""
    raw, _ = speed("raw", "raw", MESSAGES, folder)
    kinds = ("mcap", "ROS 1", "sqlite3")
    peers = {kind: speed("rosbags", kind, SLOW, folder, 1)[0] for kind in kinds}
    rows, reading = [], []
    for name, (_, _, share) in GENERATE.items():
        count = MESSAGES // share
        rate, peak = speed("generate", name, count, folder, 3 if share < 10 else 1)
        peer = peers.get(name.rsplit(" ", 1)[0], peers.get(name))
        ratios = [f"{rate / peer:.1f}" if peer else "", f"{rate / raw:.2f}" if share == 1 else ""]
        rows.append([name, f"{count:,}", f"{rate / 1e3:,.0f}", *ratios, f"{peak:.0f}"])
        if name in READ:
            rate, peak = speed("read", name, count, folder)
            reading.append([name, f"{count:,}", f"{rate / 1e3:,.0f}", f"{peak:.0f}"])
    rows += [
        [f"rosbags' loop, {kind}", f"{SLOW:,}", f"{rate / 1e3:,.0f}", "1.0", "", ""]
        for kind, rate in peers.items()
    ]
    rows.append(["raw write", f"{MESSAGES:,}", f"{raw / 1e3:,.0f}", "", "1.00", ""])
    if os.environ.get("LONG"):
        count = 24 * 3600 * 400
        rate, peak = speed("day", "day", count, folder, 1)
        first = ["24 h at 400 Hz, mcap lz4", f"{count:,}", f"{rate / 1e3:,.0f}"]
        rows.append([*first, "", "", f"{peak:.0f}"])
    return rows, reading


def main() -> None:
    """Print the tables."""
    with tempfile.TemporaryDirectory(dir=os.environ.get("BENCH_FOLDER")) as top:
        rows, reading = tables(Path(top) / "out")
    header = ["generate, whole process", "messages", "k/s", "x rosbags", "x raw", "peak MiB"]
    print_table(header, rows, "Writing (pairs: k pairs/s)")
    print_table(["into arrays", "messages", "k/s", "peak MiB"], reading, "Reading")


if __name__ == "__main__":
    if "--child" in sys.argv:
        child(*sys.argv[2:])
    else:
        main()
