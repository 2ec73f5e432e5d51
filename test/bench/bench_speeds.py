# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Processor time of what users wait for, in this tree and in a revision, in alternating runs.

    .venv/bin/python test/bench/bench_speeds.py [--base REVISION] [--seconds 300] [NAME ...]

Each case is a process of its own, which prints the processor time of itself and its children for a
unit of work, start-up excluded unless the work is a program. Ratios are those of runs next to each
other; median, least and largest of the rounds.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
SHARED = Path(__file__).parent
_MOST_ROUNDS = 5
_SLOWER = 1.2
"""Ratio from which on a case is named as slower."""


class Work(NamedTuple):
    """A piece of work that was prepared."""

    run: Callable[[], object]
    units: float
    repeat: int
    """Runs, of which the least counts; the first of several is not measured."""


class Case(NamedTuple):
    """A benchmark of one tree."""

    unit: str
    prepare: Callable[[Path], Work]


def _spent() -> float:
    """Return the processor time of this process and its children so far [s]."""
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(use.ru_utime + use.ru_stime for use in usage)


def _program(name: str, *arguments: str) -> None:
    """Run a program of this tree."""
    code = f"import sys; from imu_sim_ros.commands.{name} import main; sys.exit(main(sys.argv[1:]))"
    subprocess.run([sys.executable, "-c", code, *arguments, "--quiet"], check=True)


def _simulate(imu: str) -> Callable[[Path], Work]:
    def prepare(_: Path) -> Work:
        import imu_sim_ros as ims

        seeds: Iterator[int] = iter(range(10**6))

        def run() -> None:
            ims.simulate(imu=imu, trajectory="lecture", duration=20, rate=200, seed=next(seeds))

        return Work(run, 1e-3, 25)

    return prepare


def _reading(imu: str) -> Callable[[Path], Work]:
    def prepare(_: Path) -> Work:
        import imu_sim_ros as ims

        model = ims.ErrorModel(imu=imu, rate=1000, seed=1)
        stamps = iter(range(0, 10**15, 10**6))

        def run() -> None:
            for _ in range(1000):
                model.read(next(stamps), [0.01, 0.02, 0.03], [0.1, 0.2, 9.8])

        return Work(run, 1000e-6, 12)

    return prepare


def _steps(_: Path) -> Work:
    from rclpy.serialization import serialize_message
    from sensor_msgs.msg import Imu

    from imu_sim_ros.navigation.parameters import load_integrator
    from imu_sim_ros.nodes.integrator import odometer
    from imu_sim_ros.nodes.messages import imu_reading

    message, payloads = Imu(), []
    message.linear_acceleration.z = 9.81
    for k in range(24_000):
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(10**9 + 10**6 * k, 10**9)
        message.angular_velocity.x = 0.001 * (k % 7)
        payloads.append(serialize_message(message))
    parameters = load_integrator({"initial_state": "parameters"})
    integrator = odometer.LiveIntegrator(parameters, lambda _: None, lambda: False)
    rows = iter(payloads)

    def run() -> None:
        for _ in range(2000):
            integrator.add_reading(imu_reading(next(rows)))

    return Work(run, 2000e-6, 10)


def _add_errors(_: Path) -> Work:
    import numpy as np

    import imu_sim_ros as ims

    n = 500_000
    t_ns = np.arange(n) * 1_000_000
    gyro, accel = np.zeros((n, 3)), np.tile([0.1, 0.2, 9.81], (n, 1))
    return Work(lambda: ims.add_errors(t_ns, gyro, accel, imu="bmi088"), n * 1e-9, 3)


def _batch(_: Path) -> Work:
    import numpy as np

    import imu_sim_ros as ims

    count, steps = 4096, 256
    batch = ims.ErrorModel(imu="bmi088", rate=200, count=count, seed=1)
    gyro, accel = np.zeros((count, 3)), np.tile([0.1, 0.2, 9.81], (count, 1))
    stamps = iter(range(0, 10**15, 5_000_000))

    def run() -> None:
        for _ in range(steps):
            batch.read(next(stamps), gyro, accel)

    return Work(run, count * steps * 1e-6, 3)


def _dead_reckon(_: Path) -> Work:
    import imu_sim_ros as ims

    flight = ims.simulate(imu="mpu6000", trajectory="lecture", duration=600, rate=200, seed=1)
    return Work(lambda: ims.dead_reckon(flight), 120_000e-9, 4)


def _generate(name: str, *options: str) -> Callable[[Path], Work]:
    def prepare(folder: Path) -> Work:
        arguments = ["-o", str(folder / name), "--force", "--imu", "lecture", "--trajectory"]
        arguments += ["static", "--rate", "200", "--duration", "30min", *options]
        return Work(lambda: _program("generate", *arguments), 1.0, 1)

    return prepare


def _allan(folder: Path) -> Work:
    bag = SHARED / "still.mcap"
    if "BENCH_FOLDER" in os.environ:
        bag = Path(os.environ["BENCH_FOLDER"]) / "still.mcap"
    if not bag.exists():
        arguments = ["-o", str(bag), "--imu", "mpu6000", "--trajectory", "static", "--rate", "200"]
        _program("generate", *arguments, "--duration", "2h", "--topics", "imu/data_raw")
    output = ("-o", str(folder / "allan"), "--force")
    return Work(lambda: _program("allan", str(bag), *output), 1.0, 1)


def _rosbags_loop(folder: Path) -> Work:
    import numpy as np
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, count = get_typestore(Stores.ROS2_HUMBLE), 10_000
    kinds = store.types
    header, stamp = kinds["std_msgs/msg/Header"], kinds["builtin_interfaces/msg/Time"]
    vector, quaternion = (kinds[f"geometry_msgs/msg/{name}"] for name in ("Vector3", "Quaternion"))
    name, covariance = "sensor_msgs/msg/Imu", np.zeros(9)
    absent = np.array([-1.0] + [0.0] * 8)
    gyro, accel = np.random.default_rng(1).standard_normal((2, count, 3)).tolist()
    folders = (folder / f"loop_{k}" for k in range(10**6))

    def run() -> None:
        with Writer(next(folders), version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection("/imu", name, typestore=store)
            for k in range(count):
                t_ns = 10**9 + 5_000_000 * k
                message = kinds[name](
                    header(stamp(*divmod(t_ns, 10**9)), "imu_link"),
                    quaternion(0.0, 0.0, 0.0, 1.0),
                    absent,
                    vector(*gyro[k]),
                    covariance,
                    vector(*accel[k]),
                    covariance,
                )
                writer.write(connection, t_ns, store.serialize_cdr(message, name))

    return Work(run, 1.0, 3)


def _campaign(folder: Path) -> Work:
    plan = folder / "plan.yaml"
    plan.write_text(
        "parameters: {rate: 200, duration: 20, imu: mpu6000, trajectory: lecture}\nseeds: 400\n"
    )
    count = iter(range(10**6))

    def run() -> None:
        output = str(folder / f"out_{next(count)}")
        _program("campaign", str(plan), "-o", output, "--workers", "2")

    return Work(run, 400e-3, 1)


CASES = {
    "simulate mpu6000": Case("ms, 20 s at 200 Hz", _simulate("mpu6000")),
    "simulate tactical": Case("ms, 20 s at 200 Hz", _simulate("tactical")),
    "simulate icm42688p": Case("ms, 20 s at 200 Hz", _simulate("icm42688p")),
    "ErrorModel.read lecture": Case("us a reading", _reading("lecture")),
    "ErrorModel.read mpu6000": Case("us a reading", _reading("mpu6000")),
    "integrator": Case("us a reading", _steps),
    "ErrorModel of 4096": Case("us a unit and step", _batch),
    "add_errors bmi088": Case("ns a reading", _add_errors),
    "dead_reckon": Case("ns a reading", _dead_reckon),
    "generate mcap": Case("s, 30 min at 200 Hz", _generate("x.mcap")),
    "generate lz4": Case("s, 30 min at 200 Hz", _generate("y.mcap", "--compression", "lz4")),
    "generate ROS 1": Case("s, 30 min at 200 Hz", _generate("x.bag")),
    "generate CSV": Case("s, 30 min at 200 Hz", _generate("x.csv")),
    "campaign": Case("ms a run of 20 s", _campaign),
    "rosbags loop": Case("s for 10,000 messages", _rosbags_loop),
    "allan": Case("s, 2 h at 200 Hz, picture", _allan),
}


def measure(name: str, folder: Path) -> float:
    """Return the processor time of a unit of a case in this process, in the case's unit."""
    work = CASES[name].prepare(folder)
    if work.repeat > 1:
        work.run()
    times = []
    for _ in range(work.repeat):
        begin = _spent()
        work.run()
        times.append(_spent() - begin)
    return min(times) / work.units


def run_in(tree: Path, name: str, shared: Path) -> float | None:
    """Return the result of a case in a tree; None if the tree cannot run it."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "BENCH_FOLDER": str(shared)}
    environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory(dir=shared) as folder:
        command = [sys.executable, str(Path(__file__)), "--case", name, folder]
        done = subprocess.run(
            command, env=environment, cwd=folder, capture_output=True, text=True, check=False
        )
    if done.returncode:
        print(f"{name}: {done.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
        return None
    return float(json.loads(done.stdout.splitlines()[-1]))


def extracted(revision: str, folder: Path) -> Path:
    """Return a folder with the files of a revision."""
    tree = folder / "base"
    tree.mkdir()
    archive = subprocess.run(
        ["git", "archive", revision], cwd=ROOT, check=True, capture_output=True
    )
    subprocess.run(["tar", "-x", "-C", str(tree)], input=archive.stdout, check=True)
    return tree


def spread(values: list[float]) -> str:
    """Return the median of values, their least and their largest; a dash for none."""
    if not values:
        return "-"
    low, high = min(values), max(values)
    return f"{statistics.median(values):.3g} ({low:.3g} to {high:.3g})"


def compare(names: list[str], base: str | None, seconds: float) -> None:
    """Print the table of cases, and which are slower than the base.

    :param seconds: after which no further round begins.
    """
    from imu_sim_ros.terminal.text_tables import print_table

    rounds: list[dict[str, list[float | None]]] = []
    begin = time.monotonic()
    with tempfile.TemporaryDirectory(dir=os.environ.get("BENCH_FOLDER")) as place:
        folder = Path(place)
        trees = [ROOT] if base is None else [ROOT, extracted(base, folder)]
        while not rounds or (
            len(rounds) < _MOST_ROUNDS
            and (time.monotonic() - begin) * (len(rounds) + 1) / len(rounds) < seconds
        ):
            rounds.append({name: [run_in(tree, name, folder) for tree in trees] for name in names})
    rows, slower = [], []
    for name in names:
        columns = [
            [value for times in rounds if (value := times[name][k]) is not None]
            for k in range(len(trees))
        ]
        row = [name, CASES[name].unit, *map(spread, columns)]
        if base is not None:
            pairs = zip(*columns, strict=False)
            ratios = [tree_time / base_time for tree_time, base_time in pairs]
            row.append(spread(ratios))
            if ratios and statistics.median(ratios) > _SLOWER:
                slower.append(f"{name}: {statistics.median(ratios):.2f} times {base}")
        rows.append(row)
    header = ["work", "unit", "processor time"] + ([base, "ratio"] if base else [])
    print_table(header, rows, f"median (least to largest) of {len(rounds)} alternating rounds")
    if "allan" in names and "rosbags loop" in names:
        ratios = [
            allan / loop
            for times in rounds
            if (allan := times["allan"][0]) and (loop := times["rosbags loop"][0])
        ]
        print(f"allan over rosbags' loop for 10,000 messages: {spread(ratios)}")
    print(f"{time.monotonic() - begin:.0f} s in all, load {os.getloadavg()[0]:.1f}")
    if slower:
        print("\n".join(["slower, to be named in the changelog:", *slower]))


def main() -> int:
    """Measure the named cases, or all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"out of {', '.join(CASES)}")
    parser.add_argument("--base", metavar="REVISION", help="compare with it")
    parser.add_argument("--seconds", type=float, default=300.0, help="no round begins later")
    parser.add_argument("--case", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.case:
        name, folder = arguments.case
        print(json.dumps(measure(name, Path(folder))))
        return 0
    compare(arguments.names or list(CASES), arguments.base, arguments.seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
