# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The integrator node, live, as an estimator of a campaign.

    python examples/live_integrator.py simulation.yaml estimate.txt

Simulator, integrator and recorder run as processes of their own in a ROS domain of their own, as
fast as they can take each other's messages (real_time_factor 0). The trajectory is written in TUM's
form; a message that was lost is an error. Needs ROS 2. config/estimators/integrator.yaml uses it.
"""

import argparse
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from imu_sim_ros.bags.read import read_imu, read_odometry
from imu_sim_ros.core.conventions import DEAD_RECKONED_TOPIC, IMU_TOPIC, TRUTH_TOPIC
from imu_sim_ros.core.records import States
from imu_sim_ros.inputs.poses import write_tum
from imu_sim_ros.parameters import files

PATIENCE = 60.0
"""[s] for a node to end after it was asked to."""


def own_domain() -> tuple[int, socket.socket]:
    """Return a ROS domain that no other run on this machine uses; the bound port is the lock."""
    for domain in range(1, 100):
        lock = socket.socket()
        with suppress(OSError):
            lock.bind(("127.0.0.1", 26000 + domain))
            return domain, lock
        lock.close()
    raise SystemExit("every ROS domain is in use")


def start(name: str, domain: int, *arguments: str) -> subprocess.Popen:
    """Start a node."""
    environment = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    command = [sys.executable, "-m", f"imu_sim_ros.nodes.{name}.node", "--ros-args", *arguments]
    return subprocess.Popen(command, env={**os.environ, **environment})


def fly(configuration: Path, bag: Path) -> None:
    """Run the three nodes until the simulator is done."""
    domain, lock = own_domain()
    topics = f"[{IMU_TOPIC}, {TRUTH_TOPIC}, {DEAD_RECKONED_TOPIC}]"
    nodes = [
        start("recorder", domain, "-p", f"output:={bag}", "-p", f"topics:={topics}"),
        start("integrator", domain, "-p", "initial_state:=truth"),
        start(
            "simulator",
            domain,
            *("--params-file", str(configuration), "-p", "real_time_factor:=0.0"),
            *("-p", "wait_for_subscribers:=2", "-p", "wait_for_truth_subscribers:=2"),
        ),
    ]
    recorder, integrator, simulator = nodes
    try:
        if simulator.wait() != 0:
            raise SystemExit(f"the simulator ended with status {simulator.returncode}")
        time.sleep(1.0)  # the last readings are on their way to the integrator and back
        for node in (integrator, recorder):
            node.send_signal(signal.SIGINT)
            node.wait(PATIENCE)
    finally:
        for node in nodes:
            node.kill()
        lock.close()


def main() -> None:
    """Run, and write the trajectory with the stamps of the campaign's truth."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("configuration", type=Path, help="simulation.yaml")
    parser.add_argument("estimate", type=Path, help="file of the trajectory")
    arguments = parser.parse_args()
    bag = arguments.estimate.with_name("live")
    fly(arguments.configuration, bag)
    readings, truth = read_imu(bag), read_odometry(bag, TRUTH_TOPIC)
    states = read_odometry(bag, DEAD_RECKONED_TOPIC)
    if not len(readings.t_ns) == len(truth.t_ns) <= len(states.t_ns) + 1:
        counts = [len(part.t_ns) for part in (readings, truth, states)]
        raise SystemExit("messages were lost: {} readings, {} truths, {} states".format(*counts))
    # A start_time of -1 is the wall clock in a node, and 1 s in a file.
    start_time = float(files.load(arguments.configuration).get("start_time", 0.0))
    begin = round((start_time if start_time >= 0.0 else 1.0) * 1e9)
    # A bag is in the order of arrival, which several topics at full speed do not keep.
    order = states.t_ns.argsort()
    t_ns = states.t_ns[order] - truth.t_ns.min() + begin
    write_tum(arguments.estimate, States(t_ns, states.position[order], states.q_wb[order]))


if __name__ == "__main__":
    main()
