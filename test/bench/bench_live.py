"""Live publishing: rate, loss, lateness and CPU of the simulator, beside an rclpy timer.

Every row is two processes: the publisher, and a subscriber that takes the bytes of both topics,
reliable, without decoding. CPU is that of the whole publishing process, of one core. The lateness
is that of the publishing call behind its deadline, said by the publisher itself. ``--duration`` is
the time of each row.
"""

import argparse
import itertools
import os
import re
import signal
import statistics
import struct
import subprocess
import sys
import time
from pathlib import Path

from imu_sim_ros.commands.common import print_table

HERE = Path(__file__).resolve()
RATES = (200, 400, 1000, 2000, 8000)
_WARM_UP = 3.0
_TICKS = os.sysconf("SC_CLK_TCK")


def subscribe(seconds: float) -> None:
    """Count what arrives; print per topic the messages, and those that the stamps miss."""
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import Imu

    rclpy.init()
    node = rclpy.create_node("listener")
    stamps: dict[str, list[bytes]] = {"imu/data_raw": [], "ground_truth/odom": []}
    for topic, kind in (("imu/data_raw", Imu), ("ground_truth/odom", Odometry)):
        keep = stamps[topic].append
        node.create_subscription(
            kind, topic, lambda data, keep=keep: keep(data[4:12]), QoSProfile(depth=8000), raw=True
        )
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    end = time.monotonic() + seconds
    try:
        while time.monotonic() < end:
            executor.spin_once(timeout_sec=0.2)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass
    for topic, taken in stamps.items():
        times = [s * 10**9 + ns for s, ns in (struct.unpack("<iI", data) for data in taken)]
        steps = [b - a for a, b in itertools.pairwise(times)]
        usual = statistics.median_low(steps) if steps else 1
        lost = sum(round(step / usual) - 1 for step in steps)
        print(f"listener: {topic} {len(times)} lost {lost}", flush=True)
    rclpy.try_shutdown()


def timer(rate: float, duration: float) -> None:
    """Publish message objects from an rclpy timer: what a simple node does."""
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import Imu

    rclpy.init()
    node = rclpy.create_node("timer")
    imu = node.create_publisher(Imu, "imu/data_raw", QoSProfile(depth=4000))
    odometry = node.create_publisher(Odometry, "ground_truth/odom", QoSProfile(depth=4000))
    count = 0

    def tick() -> None:
        nonlocal count
        stamp = node.get_clock().now().to_msg()
        reading, truth = Imu(), Odometry()
        reading.header.stamp = truth.header.stamp = stamp
        reading.header.frame_id, truth.header.frame_id = "imu_link", "world"
        reading.angular_velocity.z, reading.linear_acceleration.z = 0.1, 9.81
        truth.pose.pose.position.x, truth.twist.twist.linear.x = 1.0, 2.0
        imu.publish(reading)
        odometry.publish(truth)
        count += 1

    node.create_timer(1.0 / rate, tick)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    end = time.monotonic() + duration
    while time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    print(f"simulator: counted imu/data_raw {count}", flush=True)
    rclpy.try_shutdown()


def cpu_seconds(pid: int) -> float:
    """Return the processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def measure(rate: int, duration: float, preset: str, plain: bool) -> list[str]:
    """Run one row."""
    listener = subprocess.Popen(
        [sys.executable, str(HERE), "--listen", str(duration + 30.0)],
        stdout=subprocess.PIPE,
        text=True,
    )
    time.sleep(1.5)
    if plain:
        command = [sys.executable, str(HERE), "--timer", str(rate), "--duration", str(duration)]
    else:
        command = [
            *(sys.executable, "-m", "imu_sim_ros.nodes.simulator", "--imu", preset),
            *("--rate", str(rate), "--duration", str(duration), "--wait-for-subscribers", "1"),
        ]
    publisher = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    time.sleep(_WARM_UP)
    before, start = cpu_seconds(publisher.pid), time.monotonic()
    time.sleep(max(duration - _WARM_UP - 2.0, 1.0))
    cpu = (cpu_seconds(publisher.pid) - before) / (time.monotonic() - start)
    said = publisher.communicate()[0]
    time.sleep(1.0)
    listener.send_signal(signal.SIGINT)
    heard = listener.communicate()[0]
    published = int(re.search(r"counted imu/data_raw (\d+)", said)[1])
    lateness = re.search(r"p50 (\d+) us, p99 (\d+) us, max (\d+) us", said)
    received = [int(n) for n in re.findall(r"listener: \S+ (\d+) lost", heard)]
    return [
        "rclpy timer, objects" if plain else f"simulator, {preset}",
        str(rate),
        str(published),
        f"{published / duration:.2f}",
        " ".join(str(published - n) for n in received),
        f"{100.0 * cpu:.1f}",
        *(lateness.groups() if lateness else ("", "", "")),
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--duration", type=float, default=20.0, help="seconds of each row")
    parser.add_argument("--rates", type=int, nargs="*", default=RATES)
    parser.add_argument("--imu", default="lecture", help="preset")
    parser.add_argument("--listen", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--timer", type=float, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.listen:
        subscribe(arguments.listen)
        return
    if arguments.timer:
        timer(arguments.timer, arguments.duration)
        return
    os.environ.setdefault("ROS_DOMAIN_ID", "97")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ["PYTHONPATH"] = str(HERE.parents[2])
    rows = []
    for rate in arguments.rates:
        rows.append(measure(rate, arguments.duration, arguments.imu, plain=False))
        if rate == 1000:
            rows.append(measure(rate, arguments.duration, arguments.imu, plain=True))
    print_table(
        [
            "publisher",
            "asked [Hz]",
            "published",
            "mean [Hz]",
            "not received",
            "CPU [%]",
            "late p50 [us]",
            "p99 [us]",
            "max [us]",
        ],
        rows,
        f"Imu + Odometry, reliable, {arguments.duration:g} s each",
    )


if __name__ == "__main__":
    main()
