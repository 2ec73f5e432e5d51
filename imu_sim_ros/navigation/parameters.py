# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the integrator node."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final

from imu_sim_ros.core.conventions import BODY_FRAME, TRIADS, WORLD_FRAME
from imu_sim_ros.core.errors import Problems
from imu_sim_ros.navigation import increments
from imu_sim_ros.parameters import kinds
from imu_sim_ros.parameters.files import build_from_layers, load
from imu_sim_ros.parameters.kinds import (
    IDENTITY_MATRIX,
    ZERO_MATRIX,
    ZERO_VECTOR,
    Matrix,
    Parameter,
    Vector,
    choice,
    copy_parameter,
    flag,
    matrix,
    number,
    text,
    vector,
)
from imu_sim_ros.parameters.sections import flatten, parameters, section
from imu_sim_ros.sensors.imu.parameters import DEFAULT_IMU, MOUNT, ImuParameters
from imu_sim_ros.sensors.imu.presets import sensor_layer
from imu_sim_ros.sensors.imu.triads import (
    TriadParameters,
    TriadsParameters,
    invertible_problems,
    triad,
)
from imu_sim_ros.sensors.parameters import (
    LiveReadingParameters,
    OwnRateParameters,
    rotation_problems,
)

METHODS = tuple(increments.METHODS)
ATTITUDE_UPDATES = ("quaternion", "so3", "euler_angles")
INITIAL_STATES = ("parameters", "truth", "level")

_EARTH_GRAVITY_MAXIMUM = 30.0
"""Largest gravity [m/s^2], above that of any planet with IMUs; a larger value is a typing
mistake."""


_OUTSIDE_COVARIANCE: Final = tuple(
    name for name, parameter in parameters(TriadParameters).items() if not parameter.covariance
)


@dataclass(frozen=True)
class IntegratorImuParameters(TriadsParameters):
    """The errors of an IMU that the covariance of the odometry takes, and its mount.

    Each is as in the simulator.
    """

    gyroscope: TriadParameters = triad("gyroscope", _OUTSIDE_COVARIANCE, fixed=True)
    accelerometer: TriadParameters = triad("accelerometer", _OUTSIDE_COVARIANCE, fixed=True)
    preset: str = text(
        DEFAULT_IMU,
        "file in config/imus, or a path, with the noise parameters; without any imu.*, the node "
        "uses those that the simulator publishes",
    )
    lever_arm: Vector = copy_parameter(parameters(ImuParameters)["lever_arm"])
    mounting: Matrix = copy_parameter(parameters(ImuParameters)["mounting"])

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield problems that involve several parameters."""
        yield from rotation_problems(self.mounting, f"{prefix}mounting")


@dataclass(frozen=True)
class IntegratorParameters(LiveReadingParameters):
    """Parameters of the integration of readings to a pose."""

    method: str = choice("midpoint", METHODS, "integration of position and velocity")
    attitude_update: str = choice(
        "so3",
        ATTITUDE_UPDATES,
        "integration of the attitude: quaternion (lecture eq. 34), so3 (eq. 35) or "
        "euler_angles (eq. 36)",
    )
    max_gap: float = number(
        0.0,
        "longest step to integrate; a longer one is counted as a gap and left out. 0: 2.5 times "
        "the usual interval of the readings, from 0.1 to 2 s",
        unit="s",
        minimum=0.0,
    )
    gravity: Vector = kinds.gravity("gravity in the world frame")
    earth_rate: Vector = vector(
        ZERO_VECTOR, "angular rate of the world in the world frame, if it rotates", unit="rad/s"
    )
    calibration: str = text(
        "", "parameter file with biases, scale and misalignment, as written by calibrate; or none"
    )
    gyroscope_bias: Vector = vector(
        ZERO_VECTOR, "subtracted from the gyroscope's readings", unit="rad/s", live=True
    )
    accelerometer_bias: Vector = vector(
        ZERO_VECTOR, "subtracted from the accelerometer's readings", unit="m/s^2", live=True
    )
    gyroscope_scale_misalignment: Matrix = matrix(
        IDENTITY_MATRIX, "S of reading = S x + b, lecture eq. 7, for the gyroscope"
    )
    accelerometer_scale_misalignment: Matrix = matrix(
        IDENTITY_MATRIX, "S of reading = S x + b, lecture eq. 7, for the accelerometer"
    )
    gyroscope_g_sensitivity: Matrix = matrix(
        ZERO_MATRIX, "gyroscope reading per specific force", unit="rad/s/(m/s^2)"
    )
    initial_state: str = choice(
        "parameters",
        INITIAL_STATES,
        "start of the integration: at initial_*, at the first ground_truth/odom, or level: "
        "roll, pitch and gyroscope bias from readings at rest",
    )
    initial_position: Vector = vector(ZERO_VECTOR, "position in the world at the start", unit="m")
    initial_velocity: Vector = vector(ZERO_VECTOR, "velocity in the world at the start", unit="m/s")
    initial_orientation: Vector = vector(
        ZERO_VECTOR, "roll, pitch, yaw at the start; level takes the yaw only", unit="rad"
    )
    level_time: float = number(
        2.0, "length of the rest period averaged by level", unit="s", minimum=0.01, maximum=3600.0
    )
    world_frame: str = text(WORLD_FRAME, "frame of the pose")
    body_frame: str = text(BODY_FRAME, "frame of the body, in which the twist is given")
    covariance: bool = flag(True, "propagate the covariance of pose and twist from imu.*")
    imu: IntegratorImuParameters = section(IntegratorImuParameters)
    path_rate: float = number(
        0.0, "rate of dead_reckoned/path; 0: none", unit="Hz", minimum=0.0, maximum=50.0
    )
    path_length: float = number(
        600.0, "time span covered by dead_reckoned/path", unit="s", minimum=1.0
    )
    diagnostics: bool = flag(True, "publish /diagnostics once per second")
    roll_pitch_yaw: bool = flag(
        False, "publish dead_reckoned/roll_pitch_yaw, in degrees, for plots"
    )
    error: bool = flag(
        False,
        "compare with ground_truth/odom: dead_reckoned/position_error, attitude_error and "
        "/diagnostics",
    )

    @staticmethod
    def ignored_parameters() -> dict[str, Parameter]:
        """Return the parameters of a file for the same IMU that have no use here.

        Readings have a rate of their own.
        """
        of_the_imu = parameters(ImuParameters)
        return {
            **{f"imu.{name}": parameter for name, parameter in of_the_imu.items()},
            "rate": parameters(OwnRateParameters)["rate"],
        }

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield problems that involve several parameters."""
        if math.hypot(*self.gravity) > _EARTH_GRAVITY_MAXIMUM:
            yield (
                f"{prefix}gravity = {list(self.gravity)}: must be at most "
                f"{_EARTH_GRAVITY_MAXIMUM:g} m/s^2 in magnitude"
            )
        both = (self.gyroscope_scale_misalignment, self.accelerometer_scale_misalignment)
        for name, values in zip(TRIADS, both, strict=True):
            yield from invertible_problems(values, f"{prefix}{name}_scale_misalignment")

    def warnings(self) -> list[str]:
        """Return a line for each allowed value that looks like a mistake."""
        return list(kinds.gravity_warnings(self.gravity))


def load_integrator(
    values: Mapping[str, object], sensor: Mapping[str, object] | None = None
) -> IntegratorParameters:
    """Return the integrator that parameters by dotted name describe.

    :param sensor: parameters of the sensor, instead of a preset.
    :raises ConfigurationError: with a line for each problem.
    """
    return build_from_layers(IntegratorParameters, partial(layer_integrator, sensor=sensor), values)


def layer_integrator(
    values: Mapping[str, object],
    problems: Problems,
    sensor: Mapping[str, object] | None = None,
) -> dict[str, object]:
    """Return parameters above those of the IMU preset and of the calibration that they name.

    :param values: parameters by dotted name.
    :param problems: receives a line for a preset or a calibration that cannot be read.
    :param sensor: parameters of the sensor, instead of a preset.
    """
    known_parameters = parameters(IntegratorParameters)
    layered: dict[str, object] = {}
    with problems.collect():
        preset = values.get("imu.preset", DEFAULT_IMU)
        for name, value in (sensor_layer(str(preset)) if sensor is None else sensor).items():
            if name in known_parameters:
                layered[name] = value
    if values.get("calibration"):
        with problems.collect():
            for name, value in load(str(values["calibration"])).items():
                short = name.removeprefix("imu.")
                layered.update({key: value for key in (name, short) if key in known_parameters})
    return {**layered, **values}


def has_own_noise(values: Mapping[str, object]) -> bool:
    """Return whether given parameters state the IMU's errors."""
    return any(name.startswith("imu.") and name not in MOUNT for name in values)


def sensor_description_layer(
    values: Mapping[str, object], description: Mapping[str, object]
) -> Mapping[str, object]:
    """Return the parameters that a sensor's description adds: all, or its mount alone.

    :param values: parameters by dotted name.
    :param description: parameters of the sensor by dotted name.
    :raises ConfigurationError: for a preset that cannot be read.
    """
    if not has_own_noise(values):
        return description
    mount = {name: description[name] for name in MOUNT if name in description}
    return {**sensor_layer(str(values.get("imu.preset", DEFAULT_IMU))), **mount}


def outside_covariance(
    integrator: IntegratorParameters,
    values: Mapping[str, object],
    sensor: Mapping[str, object] | None = None,
) -> list[str]:
    """Return the names of the sensor's errors that the covariance does not include.

    What integration corrects for is none of them; nor are range and bandwidth, which do not matter
    to readings within them.

    :param values: parameters by dotted name.
    :param sensor: parameters of the sensor, instead of the preset.
    :raises ConfigurationError: for a preset that cannot be read.
    """
    sensor_values = {
        **(sensor_layer(integrator.imu.preset) if sensor is None else sensor),
        **values,
    }
    integrator_parameters, integrator_values = parameters(IntegratorParameters), flatten(integrator)
    corrected = {"gyroscope_bias"} if integrator.initial_state == "level" else set()
    for name in integrator_parameters:
        if (
            name.startswith(TRIADS)
            and integrator_values[name] != integrator_parameters[name].default
        ):
            corrected.add(name)
    return [
        f"imu.{name}"
        for name, parameter in parameters(ImuParameters).items()
        if name.startswith(TRIADS)
        and f"imu.{name}" not in integrator_parameters
        and name not in corrected
        and not name.endswith(("_range", "_bandwidth"))
        and _differs(sensor_values.get(f"imu.{name}", parameter.default), parameter.default)
    ]


def _differs(value: object, other_value: object) -> bool:
    """Return whether two values differ; a single number applies to all elements."""
    left_values, right_values = (
        v if isinstance(v, list | tuple) else [v] for v in (value, other_value)
    )
    count = max(len(left_values), len(right_values))
    left_values, right_values = (
        list(v) * (count if len(v) == 1 else 1) for v in (left_values, right_values)
    )
    return left_values != right_values
