# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conventions of the whole package: gravity, the two triads, frames and topics, each once.

Imports nothing, so that every room may import it. The frames' letters, units and shapes are in the
package's docstring.
"""

from math import pi
from typing import Final, Literal

Vector = tuple[float, float, float]
Triad = Literal["gyroscope", "accelerometer"]

GRAVITY: Final[Vector] = (0.0, 0.0, -9.81)
"""Default g_w in the world frame, the lecture's value [m/s^2]."""
STANDARD_GRAVITY: Final = 9.80665
"""The unit g of data sheets (CGPM 1901) [m/s^2]."""
GYRO_UNITS: Final[dict[str, float]] = {"rad/s": 1.0, "deg/s": pi / 180.0}
"""Value of each unit of a gyroscope's readings [rad/s]."""
ACCEL_UNITS: Final[dict[str, float]] = {
    "m/s^2": 1.0,
    "g": STANDARD_GRAVITY,
    "mg": STANDARD_GRAVITY * 1e-3,
}
"""Value of each unit of an accelerometer's readings [m/s^2]."""

ABSOLUTE_ZERO: Final = -273.15
"""The temperature at 0 K [degC]."""
FAHRENHEIT: Final = (1.0 / 1.8, -32.0 / 1.8)
"""Size of a degree of Fahrenheit [K], and the temperature at 0 degF [degC]."""

SEMI_MAJOR_AXIS: Final = 6378137.0
"""Semi-major axis of the ellipsoid WGS84 [m]; the next two belong to it."""
FLATTENING: Final = 1.0 / 298.257223563
"""Flattening of the ellipsoid of WGS 84."""
ECCENTRICITY_SQUARED: Final = 6.69437999014e-3
"""Square of the first eccentricity of the ellipsoid of WGS 84."""

TRIADS: Final[tuple[Triad, Triad]] = ("gyroscope", "accelerometer")
"""Triads in the order of arrays (6, ...): gyroscope x, y, z, accelerometer x, y, z."""
AXES: Final = ("x", "y", "z")
AXIS_COLOURS: Final = {"x": "#D3202B", "y": "#1B8F38", "z": "#1F5FD6"}
"""Colours of the axes in pictures and pages: red, green and blue, as in RViz."""
SERIES_COLOURS: Final = (
    *("#8E3BB0", "#C47200", "#00878F", "#D1478F", "#7A4A21", "#6B7A00", "#64707B"),
)
"""Colours of estimates, sensors and other lines that are no axes, in their order."""
TRUTH_COLOUR: Final = "#1A1A1A"

WORLD_FRAME: Final = "world"
BODY_FRAME: Final = "base_link"
IMU_FRAME: Final = "imu_link"

IMU_TOPIC: Final = "imu/data_raw"
INPUT_IMU_TOPIC: Final = "imu/ideal"
"""Topic of ideal readings, the input of the error model."""
INPUT_ODOMETRY_TOPIC: Final = "odom/ideal"
IDEAL_SUFFIX: Final = "/ideal"
"""Suffix of the topic with the ideal readings of a magnetometer or barometer."""
DELTA_ANGLE_TOPIC: Final = "imu/delta_angle"
DELTA_VELOCITY_TOPIC: Final = "imu/delta_velocity"
SENSOR_SUFFIX: Final = "/parameters"
"""Suffix of the topic that describes the sensor behind a topic of readings."""
TEMPERATURE_TOPIC: Final = "imu/temperature"
TRUTH_TOPIC: Final = "ground_truth/odom"
TRUTH_FIX_TOPIC: Final = "ground_truth/fix"
TRUTH_POSE_TOPIC: Final = "ground_truth/pose"
IDEAL_IMU_TOPIC: Final = "ground_truth/imu"
IDEAL_DELTA_ANGLE_TOPIC: Final = "ground_truth/delta_angle"
IDEAL_DELTA_VELOCITY_TOPIC: Final = "ground_truth/delta_velocity"
GYROSCOPE_BIAS_TOPIC: Final = "ground_truth/gyroscope_bias"
ACCELEROMETER_BIAS_TOPIC: Final = "ground_truth/accelerometer_bias"
ERRORS: Final = ("bias", "scale", "noise", "response_error", "low_pass", "vibration")
"""The true errors of a triad's readings, in the order of arrays that hold all of them."""
ERROR_TOPICS: Final = {
    f"ground_truth/{triad}_{error}": f"{name}_{error}"
    for triad, name in zip(TRIADS, ("gyro", "accel"), strict=True)
    for error in ERRORS
}
"""The topic of each true error, and its array in Python."""
FEATURES_TOPIC: Final = "feature_tracker/feature"
LANDMARKS_TOPIC: Final = "ground_truth/landmarks"
BODIES_TOPIC: Final = "ground_truth/bodies"
"""Above the name of a body."""
MARKERS_TOPIC: Final = "ground_truth/markers"
IMAGE_TOPIC: Final = "image_raw"
"""Below the camera's name, as the next five."""
COMPRESSED_TOPIC: Final = "image_raw/compressed"
DEPTH_TOPIC: Final = "depth/image_raw"
MASK_TOPIC: Final = "mask/image_raw"
FLOW_TOPIC: Final = "flow/image_raw"
CAMERA_INFO_TOPIC: Final = "camera_info"
FAULTS_TOPIC: Final = "ground_truth/faults"
DEAD_RECKONED_TOPIC: Final = "dead_reckoned/odom"
PATH_TOPIC: Final = "dead_reckoned/path"
ROLL_PITCH_YAW_TOPIC: Final = "dead_reckoned/roll_pitch_yaw"
POSITION_ERROR_TOPIC: Final = "dead_reckoned/position_error"
ATTITUDE_ERROR_TOPIC: Final = "dead_reckoned/attitude_error"
TF_TOPIC: Final = "/tf"
TF_STATIC_TOPIC: Final = "/tf_static"
TWIST_FRAMES: Final = ("body", "world")
"""Axes in which odometry can have its twist; the message defines those of the body."""
