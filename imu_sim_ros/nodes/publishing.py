# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publishers, their quality of service and pace, and the description of a sensor."""

import json
from collections.abc import Callable, Sequence
from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from imu_sim_ros.conventions import IMU_TOPIC, SENSOR_SUFFIX
from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.json_text import as_json
from imu_sim_ros.nodes.messages import message_class
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.simulation.parameters import SampledParameters

_MARGIN_NS: Final = 150_000
"""A look comes this much after the message is due: the usual lateness of a publisher."""
_TOLERANCE: Final = 0.25
"""How far the mean interval of a look may be off, as a share of it."""
_TRUSTED: Final = 5
"""Number of looks with regular intervals from which on more are expected; a look with others
takes as many away."""
_MAX_TRUSTED: Final = 20
_SMOOTHING: Final = 0.125
_NEARLY: Final = 0.1
"""A period counts as a multiple of the interval if at most this share of one is missing."""
_LONGEST_NS: Final = 10_000_000
"""No look is farther away than this: another topic may have something."""


class PollTimer:
    """Decides how long to wait before the next look.

    :param period: between looks if arrivals are irregular; if they are regular, how long a
        message may wait for others [s].
    """

    def __init__(self, period: float) -> None:
        self._period_ns = period * 1e9
        self._last_ns = 0
        self._interval = 0.0
        """Between arrivals, smoothed [ns]."""
        self._trust = 0

    def wait(self, count: int, last_ns: int, now_ns: int) -> float:
        """Return how long to wait before the next look [s].

        :param count: how many messages the latest look found.
        :param last_ns: when the last of them arrived; does not matter if there is none.
        :param now_ns: the time on the same clock.
        """
        passed = now_ns - last_ns
        if not count or not (self._is_regular(last_ns, count) and 0 <= passed < _LONGEST_NS):
            return self._period_ns * 1e-9
        messages = 1 + int(self._period_ns / self._interval + _NEARLY)
        delay = messages * self._interval + _MARGIN_NS - passed
        return max(0.0, min(delay, _LONGEST_NS)) * 1e-9

    def _is_regular(self, last_ns: int, count: int) -> bool:
        """Take the latest arrivals; return whether more are to be expected like them."""
        interval = (last_ns - self._last_ns) / count
        self._last_ns = last_ns
        off = interval - self._interval
        if abs(off) <= _TOLERANCE * self._interval:
            self._trust = min(self._trust + 1, _MAX_TRUSTED)
            self._interval += _SMOOTHING * off
            return self._trust >= _TRUSTED
        self._trust = max(self._trust - _TRUSTED, 0)
        if not self._trust:
            self._interval = max(interval, 0.0)
        return False


QOS: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TYPE: Final = "std_msgs/msg/String"
_PARAMETERS: Final = "ros__parameters"


def topic(node: Node, prefix: str = "") -> str:
    """Return the full name of the topic next to a node's readings, wherever these are remapped to.

    :param prefix: namespace of an IMU of several, with its slash.
    """
    return node.resolve_topic_name(prefix + IMU_TOPIC) + SENSOR_SUFFIX


def encode(parameters: SampledParameters) -> str:
    """Return the text that describes the sensor of a simulation."""
    imu = flatten(parameters.imu)
    return as_json({"/**": {_PARAMETERS: {"rate": parameters.rate, "imu": imu}}})


def decode(text: str) -> dict[str, object]:
    """Return the sensor's parameters by dotted name, ``imu.gyroscope_noise_density`` and so on.

    :raises InputError: for a string of another form; the values are not checked.
    """
    try:
        tree: Any = json.loads(text)
        imu = tree["/**"][_PARAMETERS]["imu"]
        return {f"imu.{name}": value for name, value in imu.items()}
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        raise InputError("a sensor description that is not a parameter file in JSON") from None


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

    def __init__(self, topic: str, publisher: Any) -> None:
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


def create(node: Node, message_type: Any, topic: str, qos: QoSProfile) -> Any:
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


def check_overrides(node: Node, others: Sequence[str] = ()) -> None:
    """Check the overrides, and find those that concern no publisher of the node.

    A file that ``ros2 param dump`` made of a node with remappings holds overrides under the names
    that the topics had there: those of other topics are ignored, with a note. For a topic of this
    node, a policy that does not exist is refused, and so is an invalid number.

    :param others: topics that are published for the node elsewhere.
    :raises ConfigurationError: with a line for each.
    """
    topics = sorted([*(publisher.topic_name for publisher in node.publishers), *others])
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
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0
