# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Subscriptions that request what their publishers offer."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from imu_sim_ros.nodes.raw_subscription import RawSubscriptions, is_weaker, matching_qos

_MATCHING_PERIOD: Final = 0.02
"""[s] How often publishers of the inputs are looked for until each has one."""
_CHANGE_PERIOD: Final = 0.5
"""[s] The same afterwards."""


class MatchedInputs:
    """Subscribes once a publisher is there, to what all publishers offer.

    A request of more matches no publisher and makes each of them warn; one of less may lose
    readings under load. So nothing is requested before a publisher is there.
    """

    def __init__(
        self,
        node: Node,
        reader: RawSubscriptions,
        inputs: Callable[[], Mapping[str, Any]],
        depth: int,
    ) -> None:
        """Begin to look for publishers.

        :param inputs: returns the topics with their message classes.
        """
        self._node, self._reader, self._inputs, self._depth = node, reader, inputs, depth
        self._qos: dict[str, QoSProfile] = {}
        # On the steady clock: with use_sim_time and a silent /clock, the node's own stops.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(_MATCHING_PERIOD, self._match, clock=steady)

    def _match(self) -> None:
        inputs = self._inputs()
        for topic, message in inputs.items():
            publishers = self._node.get_publishers_info_by_topic(topic)
            if not publishers:
                continue
            offered, requested = matching_qos(publishers, self._depth), self._qos.get(topic)
            offered.durability = DurabilityPolicy.VOLATILE  # readings of the past are of no use
            if requested is None or is_weaker(offered, requested):
                if offered.reliability == ReliabilityPolicy.BEST_EFFORT:
                    logger: Any = self._node.get_logger()
                    logger.info(f"{topic} is offered as best effort; subscribing likewise")
                self._qos[topic] = offered
                self._reader.subscribe(topic, message, offered)
        if len(self._qos) == len(inputs):
            self._timer.timer_period_ns = round(_CHANGE_PERIOD * 1e9)
