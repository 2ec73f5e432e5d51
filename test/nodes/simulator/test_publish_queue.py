# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Due times of queued messages while the latency of a running stream is raised and lowered."""

import math
from typing import Any

import numpy as np
import pytest

from imu_sim_ros.core.conventions import IMU_TOPIC
from imu_sim_ros.nodes.simulator.publish_queue import BodyStream, PublishQueue
from imu_sim_ros.simulation import topics
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.sensors import mount_sensors

pytestmark = pytest.mark.ros

RATE = 200.0


def stamps(groups: list[Any]) -> list[int]:
    """Return the stamps [ns] in the messages of groups, in order."""
    payloads = [payload for _, messages in groups for _, payload in messages]
    return [int(second) * 10**9 + int(ns) for second, ns in map(_stamp, payloads)]


def _stamp(payload: bytes) -> Any:
    return np.frombuffer(payload, dtype="<u4", count=2, offset=4)


def queue_of(**imu: float) -> tuple[PublishQueue, Body]:
    imu_settings = {f"imu.{name}": value for name, value in imu.items()}
    parameters = load_simulation({"rate": RATE, "imu.preset": "perfect", **imu_settings})
    encode = topics.sensor_topics(mount_sensors(parameters))[IMU_TOPIC].encoder()
    body = Body(parameters)
    queue = PublishQueue([BodyStream(body, [("imu", encode, len)])], math.inf)
    queue.restart(0)
    return queue, body


@pytest.mark.parametrize(
    "latency", [{"latency": 10.0}, {"latency": 5.0, "latency_jitter": 1.0}], ids=["same", "random"]
)
def test_a_lowered_latency_lets_go_of_everything_at_once(latency: dict[str, float]) -> None:
    queue, body = queue_of(**latency)
    assert queue.next_groups(1.0) == []
    lower = load_simulation(
        {"rate": RATE, "imu.preset": "perfect"}, {"imu.latency": 0.001, "imu.latency_jitter": 0.0}
    )
    body.update(lower)
    groups = queue.next_groups(1.0)
    assert stamps(groups) == [5_000_000 * k for k in range(400)]
    due = [time_ns for time_ns, _ in groups]
    # What was under way arrives with the first message that has the new latency.
    assert due[0] == 1_001_000_000
    assert len(groups[0][1]) == 201


def test_a_raised_latency_keeps_the_order_and_loses_nothing() -> None:
    queue, body = queue_of(latency=0.5)
    groups = queue.next_groups(1.0)
    raised = load_simulation({"rate": RATE, "imu.preset": "perfect", "imu.latency": 2.0})
    body.update(raised)
    for _ in range(3):
        groups += queue.next_groups(1.0)
    assert stamps(groups) == [5_000_000 * k for k in range(len(stamps(groups)))]
    assert stamps(groups)[-1] == 1_995_000_000
