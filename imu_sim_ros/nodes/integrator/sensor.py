# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which sensor the readings come from: integration waits until it is known, or for a time."""

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from rclpy.clock import Clock, ClockType
from std_msgs.msg import String

from imu_sim_ros.errors import ImuSimError
from imu_sim_ros.nodes import publishing as sensor_description
from imu_sim_ros.nodes.parameters import ConfiguredNode
from imu_sim_ros.nodes.raw_subscription import Taken

_PATIENCE: Final = 0.5
"""[s] Time after the first reading by which a published description arrives."""
_LONGER_PATIENCE: Final = 5.0
"""[s] The same if its publisher has been discovered."""
_LOOK_PERIOD: Final = 0.05
_KEPT: Final = 20000
"""Number of messages that may wait: 2.5 s at 8 kHz."""


class SensorDescription:
    """Holds messages back until the description of the sensor has arrived.

    If the noise is given, or no covariance is requested, nothing waits.

    :param adopt: takes the description's parameters, by dotted name.
    :param release: receives a topic and messages of it that have waited; ``lock`` is held.
    :param lock: is held while messages are processed.
    """

    def __init__(
        self,
        node: ConfiguredNode,
        adopt: Callable[[Mapping[str, object]], None],
        release: Callable[[str, list[Taken]], None],
        lock: threading.Lock,
    ) -> None:
        self._node, self._adopt, self._release, self._lock = node, adopt, release, lock
        self._held: list[tuple[str, list[Taken]]] = []
        self._first = 0.0
        own = any(name.startswith("imu.") for name in node.given)
        self.settled = own or not node.parameters.covariance
        """Whether nothing waits any more."""
        self.described = False
        """Whether the source of the readings has described its sensor."""
        if self.settled:
            return
        self.topic = sensor_description.topic(node)
        node.create_subscription(String, self.topic, self._hear, sensor_description.QOS)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(_LOOK_PERIOD, self._look, clock=steady)

    def hold(self, topic: str, taken: list[Taken]) -> bool:
        """Keep messages of a topic back; False if they need not wait. The lock is held."""
        if self.settled:
            return False
        self._first = self._first or time.monotonic()
        self._held.append((topic, taken))
        return True

    def settle(self) -> None:
        """Stop waiting."""
        if self.settled:
            return
        self._timer.cancel()
        with self._lock:
            self.settled = True
            held, self._held = self._held, []
            for topic, taken in held:
                self._release(topic, taken)

    def _hear(self, message: Any) -> None:
        try:
            self._adopt(sensor_description.decode(message.data))
        except ImuSimError as error:
            problems = "; ".join(error.problems)
            self._node.get_logger().warning(f"{self.topic} cannot be used: {problems}")
            return
        self.described = True
        self.settle()

    def _look(self) -> None:
        """Give up if no description arrives."""
        if not self._held:
            return
        waiting = sum(len(taken) for _, taken in self._held)
        known = self._node.count_publishers(self.topic)
        patience = _LONGER_PATIENCE if known else _PATIENCE
        if time.monotonic() - self._first > patience or waiting > _KEPT:
            self.warn()
            self.settle()

    def warn(self) -> None:
        """Warn that the noise is a guess."""
        self._node.get_logger().warning(
            f"no sensor description on {self.topic}: the covariance uses the noise of "
            f"imu.preset {self._node.parameters.imu.preset}; --imu NAME|FILE chooses another"
        )
