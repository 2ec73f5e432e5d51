# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Declaration of the wheels: topics, table, readings."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from imu_sim_ros.core.gate import OTHER
from imu_sim_ros.core.types import Array
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.sensors.declaration import (
    Mounted,
    Payloads,
    Sensor,
    SensorReadings,
    Topic,
    import_on_call,
    topic,
)
from imu_sim_ros.sensors.samples import Rows, Samples
from imu_sim_ros.sensors.wheels.parameters import WheelsParameters
from imu_sim_ros.sensors.wheels.uncertainty import UNKNOWN

if TYPE_CHECKING:
    from imu_sim_ros.bags.messages.blocks import RowTemplate

ODOMETRY: Final = "nav_msgs/msg/Odometry"
JOINT_STATE: Final = "sensor_msgs/msg/JointState"
VECTOR: Final = ("geometry_msgs/msg/Vector3Stamped", "Vector3StampedEncoder")
TOPIC: Final = "wheel/odom"
_MODEL: Final = "imu_sim_ros.sensors.wheels.model"
_NAMES: Final = "x,y,yaw,speed_x,speed_y,yaw_rate,variance_x,variance_y,variance_yaw_rate"
_UNITS: Final = (
    "x [m],y [m],yaw [rad],speed_x [m s^-1],speed_y [m s^-1],yaw_rate [rad s^-1],"
    "variance_x [m^2 s^-2],variance_y [m^2 s^-2],variance_yaw_rate [rad^2 s^-2]"
)


@dataclass(frozen=True, repr=False)
class WheelsReadings(SensorReadings):
    """n delivered readings of the wheels, with the truth of each.

    Twists are (forward speed, sideways speed, yaw rate) [m/s, m/s, rad/s], means over the interval
    before the reading, as counts give them; ``true_twist`` is that at the stamp.
    """

    pose: Array
    """(n, 3) x, y [m] and yaw [rad]: the sum of the readings from 0."""
    twist: Array
    """(n, 3) measured twist."""
    covariance: Array
    """(n, 3, 3) stated covariance of the twist."""
    pose_covariance: Array
    """(n, 3, 3) stated covariance of the pose [m, m, rad]."""
    angle: Array
    """(n, m) measured angles of the joints [rad]."""
    speed: Array
    """(n, m) measured speeds of the joints [rad/s]."""
    ideal_twist: Array
    """(n, 3) twist of the vehicle without errors."""
    true_twist: Array
    """(n, 6) twist of the vehicle at the stamp in the child frame: linear, angular."""
    true_pose: Array
    """(n, 7) position and q (w, x, y, z), relative to the first reading."""
    ideal_angle: Array
    """(n, m) true angles of the joints [rad]."""
    ideal_speed: Array
    """(n, m) true means over the interval [rad/s]."""
    slip: Array
    """(n, 3) twist for which the wheels turn, minus the vehicle's."""
    slip_ratio: Array
    """(n, wheels) relative speed of a rim against the ground on a patch, 0.1 for 10 percent."""
    temperature: Array
    """(n,) temperature of the wheels [degC]."""
    true_radius: Array
    """(n, wheels) true radius at this temperature [m]."""


def _joints(name: str, position: str, velocity: str, truth: bool = False) -> Topic:
    """Return the topic of the wheels' angles and rates, JointState."""

    def make(_: Mounted[WheelsParameters], encoding: str) -> Payloads:
        from imu_sim_ros.bags.messages.transforms import JointStateEncoder

        def payloads(samples: Samples, rows: Rows, parameters: WheelsParameters) -> "RowTemplate":
            t_ns = (samples.true_t_ns if truth else samples.t_ns)[rows]
            encoder = JointStateEncoder(parameters.joints, "", encoding)
            return encoder.pattern(
                t_ns, samples.values[position][rows], samples.values[velocity][rows]
            )

        return payloads

    return Topic(name=name, type=JOINT_STATE, flags=(), payloads=make, truth=truth)


def _odometry(name: str, truth: bool = False) -> Topic:
    """Return the topic of the wheels' odometry."""

    def make(mounted: Mounted[WheelsParameters], encoding: str) -> Payloads:
        from imu_sim_ros.bags.messages.encode import OdometryEncoder

        def payloads(samples: Samples, rows: Rows, parameters: WheelsParameters) -> "RowTemplate":
            encoder = OdometryEncoder(parameters.odom_frame, mounted.frame, encoding)
            if truth:
                pose, twist = samples.true_pose[rows], samples.true_twist[rows]
                ideal = pose[:, :3], pose[:, 3:], twist[:, :3], twist[:, 3:]
                return encoder.pattern(samples.true_t_ns[rows], *ideal)
            position, q, velocity, rate = _measured_motion(samples, rows)
            covariances = (
                _planar(samples.pose_covariance[rows]),
                _planar(samples.covariance[rows]),
            )
            return encoder.pattern(samples.t_ns[rows], position, q, velocity, rate, *covariances)

        return payloads

    return Topic(name=name, type=ODOMETRY, flags=(), payloads=make, truth=truth)


def _measured_motion(samples: Samples, rows: Rows) -> tuple[Array, ...]:
    """Return position, attitude, velocity, angular velocity."""
    pose, twist = samples.pose[rows], samples.twist[rows]
    count = len(pose)
    none = np.zeros(count)
    half = 0.5 * pose[:, 2]
    return (
        np.column_stack([pose[:, :2], none]),
        np.column_stack([np.cos(half), none, none, np.sin(half)]),
        np.column_stack([twist[:, :2], none]),
        np.column_stack([none, none, twist[:, 2]]),
    )


def _planar(measured: Array) -> Array:
    """Return covariances (n, 6, 6) of x, y and yaw (n, 3, 3), and of unmeasured components."""
    covariance = np.zeros((len(measured), 6, 6))
    planar = np.array([0, 1, 5])
    covariance[:, planar[:, None], planar] = measured
    covariance[:, [2, 3, 4], [2, 3, 4]] = UNKNOWN
    return covariance


SENSOR: Final[Sensor[WheelsParameters]] = Sensor(
    name="wheels",
    quantity="wheels",
    section=WheelsParameters,
    model=import_on_call(_MODEL, "Odometer"),
    topics=(
        _odometry(TOPIC),
        _joints("joint_states", "angle", "speed"),
        _odometry("ground_truth/wheel_odom", truth=True),
        _joints("ground_truth/joint_states", "ideal_angle", "ideal_speed", truth=True),
        topic(
            *("ground_truth/wheel_slip", *VECTOR),
            lambda samples, rows, _: (samples.slip[rows],),
            truth=True,
        ),
    ),
    table=Table(
        name="wheels",
        title="wheel odometry",
        quantity=OTHER,
        headers={"euroc": f"#timestamp [ns],{_UNITS}", "csv": f"timestamp,{_NAMES}"},
        type=ODOMETRY,
        topic=TOPIC,
    ),
    values=lambda samples: np.column_stack(
        [samples.pose, samples.twist, np.diagonal(samples.covariance, axis1=1, axis2=2)]
    ),
    readings=WheelsReadings,
    realised=import_on_call(_MODEL, "realise_wheels"),
    text="encoders with slip and errors of radii and base, and odometry from them",
    warnings=import_on_call(_MODEL, "unmeasured_motion_warnings"),
    presets="wheels",
)
