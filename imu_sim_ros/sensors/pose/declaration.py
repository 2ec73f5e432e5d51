# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The true pose: the body's motion as samples without errors, and its topics."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from imu_sim_ros.core.conventions import (
    TF_TOPIC,
    TRUTH_FIX_TOPIC,
    TRUTH_POSE_TOPIC,
    TRUTH_TOPIC,
)
from imu_sim_ros.core.records import States, column
from imu_sim_ros.core.rotation import rotate_inverse
from imu_sim_ros.core.types import Times
from imu_sim_ros.sensors.declaration import (
    Mounted,
    Payloads,
    Sensor,
    Topic,
)
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.gravity import geodetic
from imu_sim_ros.sensors.model import FixedModel
from imu_sim_ros.sensors.samples import Samples
from imu_sim_ros.sensors.timing import SampleTimes
from imu_sim_ros.sensors.world import Window, World

if TYPE_CHECKING:
    from imu_sim_ros.bags.messages.blocks import RowTemplate

NAME: Final = "pose"
_TRANSFORMS: Final = "tf2_msgs/msg/TFMessage"


class Pose(FixedModel):
    """The body's motion at the rate of the simulation."""

    def __init__(self, mounted: Mounted[EnvironmentParameters], t0_ns: int, _: object) -> None:
        self._times = SampleTimes(mounted.environment.rate, t0_ns)

    def read(self, window: Window, world: World) -> Samples:
        """Return the samples in a window."""
        _, true_t_ns, t = self._times.within(window)
        rows = np.arange(len(true_t_ns))
        return Samples(
            true_t_ns=true_t_ns,
            t_ns=true_t_ns,
            release_t_ns=true_t_ns,
            delivered=rows,
            values=world.motion(t)._asdict(),
        )


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class Poses(States):
    """The body's true states at n times."""

    true_t_ns: Times = field(metadata=column((), None))
    """(n,) true times, equal to the stamps [ns]."""


def _odometry(mounted: Mounted[EnvironmentParameters], encoding: str) -> Payloads:
    """Return the encoder of the true pose as Odometry."""
    from imu_sim_ros.bags.messages.encode import OdometryEncoder

    world = mounted.environment
    messages = OdometryEncoder(world.world_frame, world.body_frame, encoding)

    def payloads(samples: Samples, _: object, __: object) -> "RowTemplate":
        velocity_b = rotate_inverse(samples.q_wb, samples.velocity)
        state = (samples.position, samples.q_wb, velocity_b, samples.angular_velocity)
        return messages.pattern(samples.true_t_ns, *state)

    return payloads


def _fix(mounted: Mounted[EnvironmentParameters], encoding: str) -> Payloads:
    """Return the encoder of the true position as NavSatFix."""
    from imu_sim_ros.bags.messages.encode import NavSatFixEncoder

    world = mounted.environment
    messages = NavSatFixEncoder(world.body_frame, encoding)
    return lambda samples, *_: messages.pattern(
        samples.true_t_ns, *geodetic(world, samples.position)
    )


def _pose(mounted: Mounted[EnvironmentParameters], encoding: str) -> Payloads:
    """Return the encoder of the true pose as PoseStamped."""
    from imu_sim_ros.bags.messages.encode import PoseStampedEncoder

    messages = PoseStampedEncoder(mounted.environment.world_frame, encoding)
    return lambda samples, *_: messages.pattern(samples.true_t_ns, samples.position, samples.q_wb)


def _transforms(mounted: Mounted[EnvironmentParameters], encoding: str) -> Payloads:
    """Return the encoder of the true pose as a transform."""
    from imu_sim_ros.bags.messages.blocks import as_row_template
    from imu_sim_ros.bags.messages.transforms import TransformsEncoder

    world = mounted.environment
    frames = TransformsEncoder([(world.world_frame, world.body_frame)], encoding)
    return lambda samples, *_: as_row_template(
        frames.encode(samples.true_t_ns, samples.position[:, None], samples.q_wb[:, None])
    )


SENSOR: Final[Sensor[EnvironmentParameters]] = Sensor(
    name=NAME,
    quantity=NAME,
    section=EnvironmentParameters,
    model=Pose,
    topics=(
        Topic(TRUTH_TOPIC, "nav_msgs/msg/Odometry", ("ground_truth",), _odometry, truth=True),
        Topic(
            TRUTH_FIX_TOPIC, "sensor_msgs/msg/NavSatFix", ("ground_truth_fix",), _fix, truth=True
        ),
        Topic(TF_TOPIC.strip("/"), _TRANSFORMS, None, _transforms, truth=True),
        Topic(TRUTH_POSE_TOPIC, "geometry_msgs/msg/PoseStamped", None, _pose, truth=True),
    ),
    readings=Poses,
    faulty_parts=(),
    text="true pose and motion of the body",
)
