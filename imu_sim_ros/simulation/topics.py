# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The topics of a simulation: samples of each sensor as messages.

One home for what the simulator node publishes and the command ``generate`` writes, so that both are
the same bytes.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages.blocks import RowTemplate, as_row_template
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE, TransformsEncoder
from imu_sim_ros.core.conventions import (
    ERROR_TOPICS,
    IDEAL_IMU_TOPIC,
    IMU_TOPIC,
    TEMPERATURE_TOPIC,
    TF_STATIC_TOPIC,
)
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.declaration import Mounted, Payloads, Topic
from imu_sim_ros.sensors.deferred import Results
from imu_sim_ros.sensors.orientation.declaration import TOPIC as ORIENTATION_TOPIC
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.pose.declaration import NAME as POSE
from imu_sim_ros.sensors.samples import Rows, Samples, all_rows
from imu_sim_ros.simulation.playback import ImuPublishParameters
from imu_sim_ros.simulation.sensors import mounts

OF_THE_ERROR_MODEL: Final = (
    *(IMU_TOPIC, ORIENTATION_TOPIC, TEMPERATURE_TOPIC, IDEAL_IMU_TOPIC),
    *ERROR_TOPICS,
)
"""Topics that an error model has for the readings of somebody else."""
MOUNTS: Final = TF_STATIC_TOPIC.strip("/")
WindowSamples = Mapping[str, Samples]
"""Samples of the sensors of one body in a window of time, by name."""


class Messages(NamedTuple):
    """The m messages of one topic, or of a serial line, in a window of time."""

    record_t_ns: Times
    """(m,) record times in a bag: the end of each sample, by the clock of its stamps [ns]."""
    due_t_ns: Times
    """(m,) when the driver would release them [ns]."""
    payloads: RowTemplate | list[bytes] | Results[bytes]
    """The messages, or what threads make of them."""

    def made(self) -> RowTemplate | list[bytes]:
        """Return the messages; this waits for the threads."""
        return list(self.payloads) if isinstance(self.payloads, Results) else self.payloads


Encode = Callable[[Samples, Any], Messages]
"""Turns samples into messages; the second argument are the parameters valid for the samples, as
:class:`~imu_sim_ros.sensors.declaration.Mounted` has them."""


class Offered(NamedTuple):
    """A topic that a sensor of a body has."""

    name: str
    """Name of the sensor."""
    mounted: Mounted[MountedParameters]
    topic: Topic

    def encoder(self, encoding: str = "cdr") -> Encode:
        """Return the encoder of the messages.

        Readings have the stamps of the sensor's clock, and only delivered ones become messages;
        everything else has the true times.

        :param encoding: ``cdr`` or ``ros1``.
        :raises ConfigurationError: for increments of a sensor whose readings are not means.
        """
        topic, payloads = self.topic, self.topic.payloads(self.mounted, encoding)

        def encode(samples: Samples, valid: Any) -> Messages:
            if topic.truth:
                messages = payloads(samples, slice(None), valid)
                times = samples.true_t_ns[: len(messages)]
                return Messages(times + samples.span_ns, times + samples.span_ns, messages)
            rows = delivered_rows(samples)
            if topic.sent is not None:
                rows = samples.delivered[topic.sent(samples)[samples.delivered]]
            record_t_ns = samples.t_ns[rows] + samples.span_ns
            return Messages(record_t_ns, samples.release_t_ns[rows], payloads(samples, rows, valid))

        return encode


def sensor_topics(sensors: Mapping[str, Mounted[MountedParameters]]) -> dict[str, Offered]:
    """Return all topics of the sensors of a body, as the node names them.

    Several IMUs have a namespace each.
    """
    topics = {
        f"{mounted.space}{topic.name}": Offered(name, mounted, topic)
        for name, mounted in sensors.items()
        for topic in mounted.sensor.topics
        if topic.exists(mounted)
    }

    def make(_: Mounted[MountedParameters], encoding: str) -> Payloads:
        return _mounts(sensors, encoding)

    topic = Topic(MOUNTS, TF_MESSAGE, None, make, truth=True, latched=True)
    return {**topics, MOUNTS: Offered(POSE, sensors[POSE], topic)}


def _mounts(sensors: Mapping[str, Mounted[MountedParameters]], encoding: str) -> Payloads:
    """Return the encoder of the transforms from bodies to their sensors.

    They are one message, with the first sample's time.
    """
    poses_by_frame = mounts(sensors)
    frames = TransformsEncoder([*poses_by_frame], encoding)
    poses = np.reshape([*poses_by_frame.values()], (-1, 4, 4))
    written = not poses_by_frame

    def payloads(samples: Samples, _: Rows, __: Any) -> RowTemplate:
        """Return the message with the first block that has a sample, and none afterwards."""
        nonlocal written
        t_ns = samples.true_t_ns[: 0 if written else 1]
        written = written or len(t_ns) > 0
        return as_row_template(frames.encode_fixed(t_ns, poses))

    return payloads


def published_topics(
    sensors: Mapping[str, Mounted[MountedParameters]], publish: ImuPublishParameters
) -> dict[str, Offered]:
    """Return the topics that a node publishes, as :func:`sensor_topics` has them.

    :param publish: its section ``publish``; a switch that it does not have is off.
    """
    switches = flatten(publish)
    return {
        name: offer
        for name, offer in sensor_topics(sensors).items()
        if offer.topic.flags is not None and all(switches.get(flag) for flag in offer.topic.flags)
    }


def resolve_topic(name: str) -> str:
    """Return a topic's name with its slash, as bags have it."""
    return "/" + name.lstrip("/")


def delivered_rows(samples: Samples) -> Rows:
    """Return the rows of samples that are delivered; all of them need no copy."""
    rows, count = samples.delivered, len(samples.t_ns)
    if rows is all_rows(count):
        return slice(None)
    if len(rows) == count and not np.count_nonzero(rows != np.arange(count)):
        return slice(None)
    return rows


def delivered_readings(samples: Samples) -> tuple[Times, Array, Array]:
    """Return stamps, angular rates and specific forces of the readings that are delivered."""
    rows = delivered_rows(samples)
    return samples.t_ns[rows], samples.gyro[rows], samples.accel[rows]
