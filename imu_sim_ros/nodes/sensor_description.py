# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The description of a sensor next to its readings: published, and waited for."""

import json
import threading
import time
from collections.abc import Callable, Mapping
from typing import Final

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from imu_sim_ros.core.conventions import IMU_TOPIC, SENSOR_SUFFIX
from imu_sim_ros.core.errors import ImuSimError, InputError
from imu_sim_ros.navigation.parameters import IntegratorParameters, has_own_noise
from imu_sim_ros.nodes.parameters import ConfiguredNode
from imu_sim_ros.nodes.publishing import create
from imu_sim_ros.nodes.subscriptions import Taken
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.imu.parameters import MOUNT
from imu_sim_ros.simulation.parameters import SampledParameters
from imu_sim_ros.terminal.json_text import json_text

_QOS: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_PARAMETERS: Final = "ros__parameters"
_PATIENCE: Final = 0.5
"""Time after the first reading by which a published description arrives [s]."""
_LONGER_PATIENCE: Final = 5.0
"""Time after the first reading by which it arrives if its publisher was discovered [s]."""
_LOOK_PERIOD: Final = 0.05
"""Period of the search for the sensor's description [s]."""
_KEPT: Final = 20000
"""Number of messages that may wait: 2.5 s at 8 kHz."""


def topic(node: Node, prefix: str = "") -> str:
    """Return the full name of the topic next to a node's readings, wherever these are remapped to.

    :param prefix: namespace of an IMU of several, with its slash.
    """
    return node.resolve_topic_name(prefix + IMU_TOPIC) + SENSOR_SUFFIX


def create_publisher(node: Node, prefix: str = "") -> Publisher:
    """Return the publisher of a description.

    :param prefix: as for :func:`topic`.
    """
    return create(node, String, topic(node, prefix), _QOS)


def publish(publisher: Publisher, parameters: SampledParameters) -> None:
    """Publish the description of the sensor of a simulation."""
    publisher.publish(String(data=encode(parameters)))


def encode(parameters: SampledParameters) -> str:
    """Return the text that describes the sensor of a simulation."""
    imu = flatten(parameters.imu)
    return json_text({"/**": {_PARAMETERS: {"rate": parameters.rate, "imu": imu}}})


def decode(text: str) -> dict[str, object]:
    """Return the sensor's parameters by dotted name, ``imu.gyroscope_noise_density`` and so on.

    :raises InputError: for a string of another form; the values are not checked.
    """
    try:
        tree = json.loads(text)
        imu = tree["/**"][_PARAMETERS]["imu"]
        return {f"imu.{name}": value for name, value in imu.items()}
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        raise InputError("a sensor description that is not a parameter file in JSON") from None


class SensorDescription:
    """Holds messages back until the description of the sensor has arrived.

    If the mount of the IMU is given, and its noise is given or no covariance is requested, nothing
    waits.

    :param adopt: takes the description's parameters, by dotted name.
    :param release: receives a topic and messages of it that have waited; ``lock`` is held.
    :param lock: is held while messages are processed.
    """

    def __init__(
        self,
        node: ConfiguredNode[IntegratorParameters],
        adopt: Callable[[Mapping[str, object]], None],
        release: Callable[[str, list[Taken]], None],
        lock: threading.Lock,
    ) -> None:
        self._node, self._adopt, self._release, self._lock = node, adopt, release, lock
        self._held: list[tuple[str, list[Taken]]] = []
        self._first = 0.0
        self.noise_known = has_own_noise(node.overrides) or not node.parameters.covariance
        """True if the noise is given, or not needed."""
        self.settled = self.noise_known and all(name in node.overrides for name in MOUNT)
        """True if nothing waits any more."""
        self.described = False
        """True if the source of the readings has described its sensor."""
        if self.settled:
            return
        self.topic = topic(node)
        node.create_subscription(String, self.topic, self._hear, _QOS)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(_LOOK_PERIOD, self._look, clock=steady)

    def hold(self, topic: str, batch: list[Taken]) -> None:
        """Keep messages of a topic back; not to be called once it is settled. The lock is held."""
        self._first = self._first or time.monotonic()
        self._held.append((topic, batch))

    def settle(self) -> None:
        """Stop waiting."""
        if self.settled:
            return
        self._timer.cancel()
        with self._lock:
            self.settled = True
            batches, self._held = self._held, []
            for topic, batch in batches:
                self._release(topic, batch)

    def _hear(self, message: String) -> None:
        """Adopt the description of a sensor that has arrived."""
        try:
            self._adopt(decode(message.data))
        except ImuSimError as error:
            problems = "; ".join(error.problems)
            self._node.get_logger().warning(f"{self.topic} cannot be used: {problems}")
            return
        self.described = True
        self.settle()

    def _look(self) -> None:
        """Integrate with the node's own parameters if no description arrives in time."""
        if not self._held:
            return
        waiting = sum(len(batch) for _, batch in self._held)
        publishers = self._node.count_publishers(self.topic)
        patience = _LONGER_PATIENCE if publishers else _PATIENCE
        if time.monotonic() - self._first > patience or waiting > _KEPT:
            self.warn()
            self.settle()

    def warn(self) -> None:
        """Log the assumptions about the sensor; a guessed noise is a warning."""
        logger, node = self._node.get_logger(), self._node
        unknown = f"no sensor description on {self.topic}: "
        if not self.noise_known:
            logger.warning(
                f"{unknown}the covariance uses the noise of imu.preset "
                f"{node.parameters.imu.preset}; --imu NAME|FILE chooses another"
            )
        if not any(name in node.overrides for name in MOUNT):
            logger.info(
                f"{unknown}the IMU is taken to be in the body's origin, with its axes "
                "(imu.lever_arm, imu.mounting)"
            )
