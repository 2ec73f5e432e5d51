# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node error_model live: processor time, losses and added delay, next to relays that add none.

One source publishes ideal readings, a bare loop that sleeps. The variants of a table take them at
the same time, and each publishes on a topic of its own, so that whatever else the machine does
slows all of them alike: ratios within a table mean something on a busy machine, the numbers
themselves little. A
listener takes the ideal readings and what the variants made of them; the added delay of a message
is the time between the two arrivals, in the clock of the middleware.

The relays pass the bytes on as they are: ``executor`` as a simple node does (a raw subscription,
its callback publishes), ``thread`` as this package's nodes do (a thread that takes what has
accumulated): the floor of a node in Python.
"""

import argparse
import json
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from process_time import cpu_seconds

from imu_sim_ros.terminal.text_tables import print_table

HERE = Path(__file__).resolve()
_WARM_UP = 5.0
"""[s] After the first messages of all variants; the check at the start is over then."""
_PERIOD = 0.001
"""[s] Between two looks of the relay and the listener."""
_DEPTH = 4000


class Variant(NamedTuple):
    """A node that takes imu/ideal."""

    topic: str
    """Topic that the node publishes."""
    command: list[str]
    """Command line of the node."""


def relays() -> dict[str, Variant]:
    """Return what adds nothing."""
    return {
        f"relay, {way}": Variant(f"relay_{way}", [sys.executable, str(HERE), "--relay", way])
        for way in ("thread", "executor")
    }


def models(imus: list[str], rate: int) -> dict[str, Variant]:
    """Return a node for each preset."""
    variants = {}
    for imu in imus:
        node = [sys.executable, "-m", "imu_sim_ros.nodes.error_model.node", "--imu", imu]
        topic = f"noisy_{imu}"
        names = ["-r", f"imu/data_raw:={topic}", "-r", f"__node:=model_{imu}"]
        ros = ["--ros-args", "--log-level", "warn", *names]
        variants[f"error_model, {imu}"] = Variant(topic, [*node, "--rate", str(rate), *ros])
    return variants


def relay(way: str) -> None:
    """Publish the bytes of the readings as they come."""
    import rclpy
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import Imu

    from imu_sim_ros.nodes.fast_dds import set_profile
    from imu_sim_ros.nodes.publishing import Counter
    from imu_sim_ros.nodes.subscriptions import RawSubscriptions, Taken

    folder = tempfile.TemporaryDirectory()
    set_profile(Path(folder.name))
    rclpy.init()
    node = rclpy.create_node(f"relay_{way}")
    publisher = node.create_publisher(Imu, f"relay_{way}", QoSProfile(depth=_DEPTH))
    send = Counter("", publisher).send
    if way == "thread":

        def pass_on(_topic: str, messages: list[Taken]) -> None:
            for payload, _ in messages:
                send(payload)

        reader = RawSubscriptions(node, pass_on, print, _PERIOD, "imu/ideal")
        reader.subscribe("imu/ideal", Imu, QoSProfile(depth=_DEPTH))
    else:
        node.create_subscription(Imu, "imu/ideal", send, QoSProfile(depth=_DEPTH), raw=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while rclpy.ok():
            executor.spin_once()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    rclpy.try_shutdown()


def listen(topics: list[str], file: Path) -> None:
    """Take all topics until a signal; write the stamps and arrival times of each."""
    import rclpy
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import Imu

    from imu_sim_ros.nodes.fast_dds import set_profile
    from imu_sim_ros.nodes.subscriptions import RawSubscriptions, Taken

    folder = tempfile.TemporaryDirectory()
    set_profile(Path(folder.name))
    rclpy.init()
    node = rclpy.create_node("listener")
    arrived: dict[str, list[tuple[bytes, int]]] = {topic: [] for topic in topics}

    def take(topic: str, messages: list[Taken]) -> None:
        if not arrived[topic]:
            print("receiving", topic, flush=True)
        arrived[topic] += [(data[4:12], info["received_timestamp"]) for data, info in messages]

    reader = RawSubscriptions(node, take, print, _PERIOD)
    for topic in topics:
        reader.subscribe(topic, Imu, QoSProfile(depth=_DEPTH))
    signal.sigwait({signal.SIGINT})
    reader.close()
    columns = {}
    for topic, rows in arrived.items():
        stamps = [struct.unpack("<iI", stamp) for stamp, _ in rows]
        columns[topic] = [
            (s * 10**9 + ns, arrival) for (s, ns), (_, arrival) in zip(stamps, rows, strict=True)
        ]
    file.write_text(json.dumps(columns))
    rclpy.try_shutdown()


def publish(rate: int, subscribers: int, seconds: float) -> None:
    """Publish ideal readings at rest: sleep until the next absolute deadline, publish, again."""
    import rclpy
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import Imu

    from imu_sim_ros.bags.messages.encode import ImuEncoder
    from imu_sim_ros.nodes.fast_dds import set_profile

    folder = tempfile.TemporaryDirectory()
    set_profile(Path(folder.name))
    rclpy.init()
    node = rclpy.create_node("source")
    publisher = node.create_publisher(Imu, "imu/ideal", QoSProfile(depth=_DEPTH))
    while publisher.get_subscription_count() < subscribers:
        time.sleep(0.05)
    time.sleep(0.5)
    level = np.array([[0.0, 0.0, 9.81]])
    row = bytearray(ImuEncoder("imu_link").encode(np.zeros(1, np.int64), level * 0, level)[0])
    start = time.monotonic_ns()
    for k in range(round(rate * seconds)):
        due = round(k * 1e9 / rate)
        delay = start + due - time.monotonic_ns()
        if delay > 0:
            time.sleep(delay * 1e-9)
        row[4:12] = struct.pack("<iI", *divmod(due, 10**9))
        publisher.publish(bytes(row))
    time.sleep(1.0)
    rclpy.try_shutdown()


def measure(variants: Mapping[str, Variant], rate: int, duration: float) -> list[list[str]]:
    """Run all variants at the same time."""
    topics = ["imu/ideal", *(variant.topic for variant in variants.values())]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "arrived.json"
        listener = subprocess.Popen(
            [sys.executable, str(HERE), "--listen", str(file), *topics],
            stdout=subprocess.PIPE,
        )
        assert listener.stdout is not None
        running = [
            subprocess.Popen(variant.command, stdout=subprocess.DEVNULL)
            for variant in variants.values()
        ]
        source = subprocess.Popen(
            [
                *(sys.executable, str(HERE), "--publish", str(rate), str(len(topics))),
                str(_WARM_UP + duration + 1.0),
            ]
        )
        for _ in topics:
            listener.stdout.readline()
        time.sleep(_WARM_UP)
        cpu_start, begin = [cpu_seconds(process.pid) for process in running], time.monotonic()
        time.sleep(duration - 0.5)
        cpu_end, passed = [cpu_seconds(p.pid) for p in running], time.monotonic() - begin
        source.wait()
        for process in [*running, listener]:
            process.send_signal(signal.SIGINT)
            process.wait()
        columns = {topic: np.array(rows) for topic, rows in json.loads(file.read_text()).items()}
    return list(_rows(variants, columns, np.subtract(cpu_end, cpu_start) / passed))


def _rows(
    variants: Mapping[str, Variant], columns: Mapping[str, np.ndarray], used: np.ndarray
) -> Iterator[list[str]]:
    ideal = columns["imu/ideal"]
    start = ideal[0, 0] + round((_WARM_UP + 1.0) * 1e9)
    for (name, variant), cpu in zip(variants.items(), used, strict=True):
        output = columns[variant.topic]
        stamps, k, m = np.intersect1d(ideal[:, 0], output[:, 0], return_indices=True)
        late = (output[m, 1] - ideal[k, 1])[stamps > start] * 1e-3
        p50, p99 = np.percentile(late, [50.0, 99.0])
        yield [
            name,
            f"{100.0 * cpu:.1f}",
            f"{cpu / used[0]:.2f}",
            str(len(ideal)),
            str(len(ideal) - len(stamps)),
            f"{p50:.0f}",
            f"{p99:.0f}",
            f"{late.max():.0f}",
        ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=30.0, help="seconds that are measured")
    parser.add_argument("--rate", type=int, default=1000)
    parser.add_argument("--imu", nargs="*", default=["lecture", "mpu6000"], help="presets")
    parser.add_argument("--relay", choices=("thread", "executor"), help=argparse.SUPPRESS)
    parser.add_argument("--listen", nargs="*", help=argparse.SUPPRESS)
    parser.add_argument("--publish", nargs=3, type=float, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.relay:
        relay(arguments.relay)
        return
    if arguments.listen:
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        listen(arguments.listen[1:], Path(arguments.listen[0]))
        return
    if arguments.publish:
        rate, subscribers, seconds = arguments.publish
        publish(round(rate), round(subscribers), seconds)
        return
    os.environ.setdefault("ROS_DOMAIN_ID", "96")
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["PYTHONPATH"] = str(HERE.parents[3])
    passing = relays()
    nodes = models(arguments.imu, arguments.rate)
    node_variants = {"relay, thread": passing["relay, thread"], **nodes}
    for variants in (node_variants, passing):  # an executor disturbs what runs next to it
        print_table(
            [
                "node",
                "CPU [%]",
                "times",
                "sent",
                "not received",
                "added p50 [us]",
                "p99 [us]",
                "max [us]",
            ],
            measure(variants, arguments.rate, arguments.duration),
            f"{arguments.rate} Hz, reliable, {arguments.duration:g} s after {_WARM_UP:g} s",
        )


if __name__ == "__main__":
    main()
