# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""FusionCore: ``fusioncore.yaml`` for IMU, GNSS and wheels.

Keys are those that fusioncore_ros/src/fusion_node.cpp declares.
"""

import math
from typing import Final

import numpy as np

from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.geodesy import ecef_of_geodetic
from imu_sim_ros.datasets.consumers.aiding import SPEED, Aiding
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.datasets.consumers.values import comment, yaml_float
from imu_sim_ros.simulation.topics import resolve_topic

_GRAVITY: Final = 9.80665
"""Gravity of imu_measurement_function, fusioncore_core/include/fusioncore/sensors/imu.hpp
[m/s^2]."""
_FARTHEST: Final = 10.0
"""Distance from the reference beyond which fixes are dropped, gnss_callback [km]."""
_MODELS: Final = {
    "differential": "DifferentialDrive",
    "ackermann": "Ackermann",
    "omnidirectional": "ConstantVelocityAcceleration",
}
_ANY_SIDE_SPEED: Final = 10.0
"""Default of nhc_vy_sigma for mecanum wheels [m/s]."""


def files(subject: Subject) -> dict[str, str]:
    """Return the configuration for GNSS or wheels."""
    body = subject.aiding
    return {} if body is None else {"fusioncore.yaml": config(body)}


def config(body: Aiding) -> str:
    """Return ``fusioncore.yaml``, the parameters of its node."""
    lines = [*_imu_lines(body), *_wheel_lines(body), *_gnss_lines(body)]
    text = "".join(f"    {line}\n" for line in lines)
    return f"{comment(_remarks(body))}fusioncore:\n  ros__parameters:\n{text}"


def _remarks(body: Aiding) -> list[str]:
    """Return the comment at the head of the file."""
    remarks = [
        "FusionCore, fusioncore_ros: what differs from its defaults. Written against its sources; "
        "it has not been run with them here.",
        "imu.gyro_noise and imu.accel_noise are standard deviations of one sample. Its walks of "
        "biases, ukf.q_gyro_bias and ukf.q_accel_bias, are left at their defaults. It takes the "
        "attitude of the IMU in the body from tf.",
    ]
    if abs(body.values.gravity - _GRAVITY) > 1e-6:
        remarks.append(
            f"Its gravity is {_GRAVITY} m/s^2, that of this simulation "
            f"{yaml_float(body.values.gravity)}: the difference goes into the estimated bias. "
            f"--set gravity=[0.0,0.0,-{_GRAVITY}] avoids it."
        )
    if body.gnss is not None:
        remarks += [
            "The reference is the origin of the simulated world, Earth-fixed: its output is in the "
            "world's coordinates, east along x, north along y, if the world is flat. It drops "
            f"fixes farther than {_FARTHEST:g} km from there, and takes no standard deviation "
            "below 2 cm horizontally and 5 cm vertically.",
            "It takes velocities from nav_msgs/Odometry, which gps/velocity is not: that topic is "
            "left out.",
        ]
    if body.wheels is not None:
        remarks.append(
            "Of wheel/odom it takes the variances of the message; encoder.vel_noise and "
            f"encoder.yaw_noise, stated at {SPEED:g} m/s, are those of messages without."
        )
    return remarks


def _imu_lines(body: Aiding) -> list[str]:
    """Return the parameters of fusion_node about frames and the IMU, one a line."""
    values, parameters = body.values, body.parameters
    per_sample = math.sqrt(values.rate)
    gyro, accel = (
        yaml_float(per_sample * values.rms_density(f"{triad}_noise_density")) for triad in TRIADS
    )
    odom = body.wheels.odom_frame if body.wheels is not None else "odom"
    return [
        f"base_frame: {parameters.body_frame}",
        f"odom_frame: {odom}",
        "publish_rate: 100.0",
        f"imu.topic: {values.topic}",
        f"imu.frame_id: {parameters.imu_frame}",
        f"imu.gyro_noise: {gyro}",
        f"imu.accel_noise: {accel}",
        "imu.has_magnetometer: false",
        # The key has the reverse meaning: true adds gravity to readings without it.
        "imu.remove_gravitational_acceleration: false",
        *_vector("imu.lever_arm", tuple(values.imu.lever_arm)),
    ]


def _wheel_lines(body: Aiding) -> list[str]:
    """Return the parameters of fusion_node about the wheels, one a line; none without wheels."""
    p = body.wheels
    if p is None:
        return []
    forward, turning = body.twist_sigma
    sideways = _ANY_SIDE_SPEED if p.model == "omnidirectional" else p.side_slip_sigma
    return [
        f"motion_model: {_MODELS[p.model]}",
        f"motion_model_params.wheelbase: {yaml_float(p.wheelbase)}",
        f"encoder.topic: {resolve_topic('wheel/odom')}",
        f"encoder.vel_noise: {yaml_float(forward)}",
        f"encoder.yaw_noise: {yaml_float(turning)}",
        f"encoder.nhc_vy_sigma: {yaml_float(sideways)}",
        f"encoder.nhc_auto_detect: {str(p.model == 'omnidirectional').lower()}",
    ]


def _gnss_lines(body: Aiding) -> list[str]:
    """Return the parameters of fusion_node about GNSS, one a line; none without a receiver."""
    p, world = body.gnss, body.parameters
    if p is None:
        return []
    horizontal, vertical = body.position_sigma
    origin = ecef_of_geodetic(
        *(np.array([x]) for x in (world.latitude_deg, world.longitude_deg, world.height))
    )[0]
    return [
        f"gnss.fix_topic: {resolve_topic('gps/fix')}",
        "gnss.use_gps_fix: false",
        "gnss.min_fix_type: 1",
        f"gnss.base_noise_xy: {yaml_float(horizontal)}",
        f"gnss.base_noise_z: {yaml_float(vertical)}",
        *_vector("gnss.lever_arm", p.lever_arm),
        "input.gnss_crs: EPSG:4326",
        "output.crs: EPSG:4978",
        "output.convert_to_enu_at_reference: true",
        "reference.use_first_fix: false",
        *(
            f"reference.{axis}: {yaml_float(float(x))}"
            for axis, x in zip("xyz", origin, strict=True)
        ),
    ]


def _vector(name: str, vector: tuple[float, ...]) -> list[str]:
    """Return a vector as three keys, one per axis."""
    return [f"{name}_{axis}: {yaml_float(x)}" for axis, x in zip("xyz", vector, strict=True)]
