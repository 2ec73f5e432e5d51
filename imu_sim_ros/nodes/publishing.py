# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publishers and their quality of service."""

from collections.abc import Callable, Sequence
from typing import Final

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSPolicyKind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.nodes.messages import message_class

ACKNOWLEDGEMENT: Final = Duration(nanoseconds=300_000_000)
"""Longest wait for subscribers at shutdown; a signal must end the node within a second."""
_POLICIES: Final = (
    QoSPolicyKind.HISTORY,
    QoSPolicyKind.DEPTH,
    QoSPolicyKind.RELIABILITY,
    QoSPolicyKind.DURABILITY,
    QoSPolicyKind.DEADLINE,
    QoSPolicyKind.LIVELINESS,
)
_OVERRIDES: Final = "qos_overrides."
_NUMBERS: Final = {"depth": "", "deadline": " [ns]; 0: none"}
"""Policies whose values are integers, with their units: rclpy truncates other numbers."""


class Counter:
    """A topic's publisher, with the number of messages published."""

    def __init__(self, topic: str, publisher: Publisher) -> None:
        self.topic = topic
        self.publisher = publisher
        self.count = 0
        # Publisher.publish does the same after checking the message's type, which takes a tenth
        # of all processor time at 2 kHz.
        self._publish: Callable[[bytes], None] = publisher.handle.publish_raw

    def send(self, payload: bytes) -> None:
        """Publish a message's bytes."""
        self._publish(payload)
        self.count += 1


def create(node: Node, message_type: type | str, topic: str, qos: QoSProfile) -> Publisher:
    """Return a publisher; ``qos_overrides./TOPIC.publisher.depth`` and so on change its QoS.

    :param message_type: a message class, or its name.
    :raises ConfigurationError: for an override that is not one.
    """
    if isinstance(message_type, str):
        message_type = message_class(message_type)
    try:
        return node.create_publisher(
            message_type,
            topic,
            qos,
            qos_overriding_options=QoSOverridingOptions(policy_kinds=_POLICIES),
        )
    except (RuntimeError, TypeError, ValueError, AttributeError, AssertionError) as error:
        reason = " ".join(str(error).split()) or "a value of the wrong type"
        raise ConfigurationError(
            f"{_OVERRIDES}{node.resolve_topic_name(topic)}: {reason}"
        ) from None


def check_overrides(node: Node, additional: Sequence[str] = ()) -> None:
    """Check the overrides, and find those that concern no publisher of the node.

    A file that ``ros2 param dump`` made of a node with remappings holds overrides under the names
    that the topics had there: those of other topics are ignored, with a note. For a topic of this
    node, a policy that does not exist is refused, and so is an invalid number.

    :param additional: topics that other processes publish for the node.
    :raises ConfigurationError: with a line for each.
    """
    topics = sorted([*(publisher.topic_name for publisher in node.publishers), *additional])
    policies = [policy.name.lower() for policy in _POLICIES]
    foreign: dict[str, None] = {}
    problems = []
    for name in sorted(node.get_parameters_by_prefix("")):
        if not name.startswith(_OVERRIDES):
            continue
        topic, _, policy = name.removeprefix(_OVERRIDES).partition(".publisher.")
        if topic not in topics:
            foreign[topic] = None
        elif policy not in policies:
            problems.append(f"{name}: the policy must be one of {', '.join(policies)}")
        elif policy in _NUMBERS and not _is_whole(value := node.get_parameter(name).value):
            allowed = f"an integer of at least 0{_NUMBERS[policy]}"
            problems.append(f"{name} = {value!r}: must be {allowed}")
    if problems:
        raise ConfigurationError(problems)
    if foreign:
        node.get_logger().warning(
            f"{_OVERRIDES}* of {', '.join(foreign)} ignored: "
            f"the topics published here are {', '.join(topics)}"
        )


def _is_whole(value: object) -> bool:
    """Return True for an integer of at least 0."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0
