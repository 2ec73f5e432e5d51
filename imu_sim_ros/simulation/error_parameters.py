# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the error model: the declaration of its input, and the sensor."""

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from imu_sim_ros.core.conventions import TWIST_FRAMES
from imu_sim_ros.core.errors import Problems
from imu_sim_ros.core.timebase import exact_rate
from imu_sim_ros.core.types import field_values
from imu_sim_ros.parameters.files import build_from_layers
from imu_sim_ros.parameters.kinds import (
    IDENTITY_MATRIX,
    Matrix,
    Parameter,
    choice,
    flag,
    integer,
    matrix,
    number,
)
from imu_sim_ros.parameters.sections import common_sections, flatten, parameters, section
from imu_sim_ros.sensors import sensors_of_imus
from imu_sim_ros.sensors.declaration import takes_ideal_values
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.presets import layer_imu
from imu_sim_ros.sensors.parameters import LONGEST, LiveReadingParameters, rotation_problems
from imu_sim_ros.simulation.parameters import SampledParameters
from imu_sim_ros.simulation.playback import (
    PARTS,
    ImuPublishParameters,
    InjectParameters,
    SimulatorParameters,
    switches,
)

NODE: Final = "error_model"


@dataclass(frozen=True)
class InputParameters:
    """Declaration of the input from another simulator."""

    rate: float = number(
        0.0,
        "rate of the input; 0: `rate`, each reading becomes one sample with its stamp; above "
        "`rate`: the sensor samples the input with its own clock, according to imu.sampling",
        unit="Hz",
        minimum=0.0,
        maximum=1e6,
    )
    gravity: str = choice(
        "included",
        ("included", "missing"),
        "included: specific force, +9.81 upwards at rest; missing: kinematic acceleration in the "
        "sensor's axes, to which gravity is added with the orientation that comes with it",
    )
    axes: str = choice(
        "flu",
        ("flu", "frd", "optical"),
        "axes of the input: forward left up, forward right down (orientation in north east down), "
        "or right down forward",
    )
    frame_rotation: Matrix = matrix(
        IDENTITY_MATRIX, "rotation of the input, in flu, into the IMU's frame: v_imu = R v_input"
    )
    place: str = choice(
        "imu",
        ("imu", "body"),
        "imu: readings at the position and in the axes of the IMU; body: those of the body, to "
        "which imu.lever_arm, imu.mounting and imu.accelerometer_positions are applied, with the "
        "derivative of the rate as angular acceleration",
    )
    longest_gap: float = number(
        10.0,
        "gaps up to this are missing samples, during which biases go on; longer ones are pauses, "
        "during which the sensor is off",
        unit="s",
        minimum=0.0,
        maximum=LONGEST,
    )
    restart: str = choice(
        "same_seed",
        ("same_seed", "next_seed"),
        "seed with which the errors begin again after stamps have jumped back, and after a reset",
    )
    check: bool = flag(
        True,
        "check the first 2 s and report rate, gravity, units or axes that contradict the "
        "declaration, and noise that would be added twice",
    )
    twist_frame: str = choice(
        TWIST_FRAMES[0],
        TWIST_FRAMES,
        "axes of the twist of odometry: body (child_frame_id), as the message defines it, or "
        "world (header.frame_id), as some simulators send it",
    )
    odometry_span: int = integer(
        1,
        "odometry messages on each side over which the velocity is differenced to get the "
        "acceleration; readings are late by that many messages",
        minimum=1,
        maximum=100,
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line if ``frame_rotation`` is no rotation matrix."""
        yield from rotation_problems(self.frame_rotation, f"{prefix}frame_rotation")


@dataclass(frozen=True)
class ErrorModelParameters(SampledParameters):
    """Everything that decides which errors ideal readings get."""

    imu: ImuParameters = section(ImuParameters)
    input: InputParameters = section(InputParameters)

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each parameter that needs the motion between the readings."""
        yield from super().problems(prefix)
        input_rate, sampling = self.input.rate, self.imu.sampling
        if input_rate and input_rate < self.rate:
            yield (
                f"{prefix}input.rate = {input_rate:g}: must be 0 or at least the rate, "
                f"{self.rate:g} Hz"
            )
        elif sampling == "averaged" and input_rate <= self.rate:
            yield (
                f"{prefix}imu.sampling = 'averaged': needs input.rate above the rate, "
                f"{self.rate:g} Hz: nothing is known of the motion between readings that come "
                "one by one"
            )
        elif sampling == "oversampled":
            internal_rate = exact_rate(self.rate) * self.imu.internal_ratio(self.rate)
            if not input_rate or exact_rate(input_rate) != internal_rate:
                yield (
                    f"{prefix}input.rate = {input_rate:g}: must be {float(internal_rate):g} Hz, "
                    f"the rate inside the sensor, if {prefix}imu.sampling is oversampled"
                )
        if self.input.place == "imu" and any(self.imu.accelerometer_positions):
            yield (
                f"{prefix}imu.accelerometer_positions: must be 0 unless {prefix}input.place is "
                "body: readings where the IMU is mounted are those of a single point"
            )
        exponents = (*self.imu.vibration.gyroscope_exponents,)
        if any(exponents) or any(self.imu.vibration.accelerometer_exponents):
            yield (
                f"{prefix}imu.vibration: exponents must be 0 in an error model: the speed that the "
                "vibration follows is not known"
            )

    @staticmethod
    def ignored_parameters() -> dict[str, Parameter]:
        """Return the simulator's parameters that an error model ignores, by name."""
        return dict(_OF_THE_SIMULATOR)


@dataclass(frozen=True)
class ErrorPublishParameters(ImuPublishParameters):
    """Switches of the topics published in addition to ``imu/data_raw``.

    Those of the sensors whose ideal values can be given, and of what is stated with the readings.
    """

    sensors: Mapping[str, object] = common_sections(
        lambda: switches(
            sensor
            for sensor in sensors_of_imus()
            if takes_ideal_values(sensor) or (sensor.table is not None and sensor.table.of_readings)
        ),
        joint=None,
    )


@dataclass(frozen=True)
class ErrorNodeParameters(LiveReadingParameters, ErrorModelParameters):
    """Everything that the node error_model takes."""

    odometry: bool = flag(False, "subscribe to odom/ideal (nav_msgs/Odometry) instead of imu/ideal")
    publish: ErrorPublishParameters = section(ErrorPublishParameters)
    inject: InjectParameters = section(InjectParameters)

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each topic or fault that this error model cannot have."""
        yield from super().problems(prefix)
        if flatten(self.publish)["orientation"]:
            yield from orientation_problems(self.imu, prefix)
        if self.odometry:
            values = field_values(self)
            for field in dataclasses.fields(LiveReadingParameters):
                if values[field.name] != field.default:
                    yield (f"{prefix}{field.name}: has no effect on odometry; it is for imu/ideal")
        yield from self.inject.unknown_part(prefix, PARTS)
        if self.inject.imu:
            yield f"{prefix}inject.imu = {self.inject.imu!r}: must be empty, there is one IMU"


_OF_THE_SIMULATOR: Final = {
    name: parameter
    for name, parameter in parameters(SimulatorParameters).items()
    if name.partition(".")[0]
    not in {field.name for field in dataclasses.fields(ErrorModelParameters)} - {"publish"}
}


def layer_error_model(parameters: Mapping[str, object], problems: Problems) -> dict[str, object]:
    """Return parameters above the preset that they name, without those of motion.

    :param problems: receives a line for a preset that cannot be read.
    """
    layers = layer_imu(parameters, NODE, problems)
    return {name: value for name, value in layers.items() if not name.startswith("trajectory.")}


def load_error_model(
    parameters: Mapping[str, object],
    cls: type[ErrorModelParameters] = ErrorModelParameters,
    problems: Problems | None = None,
) -> Any:
    """Return the error model that parameters describe.

    :param problems: problems of earlier checks, which are raised with those of this one.
    :raises ConfigurationError: with a line for each problem.
    """
    return build_from_layers(cls, layer_error_model, parameters, problems=problems)


def orientation_problems(imu: ImuParameters, prefix: str = "") -> Iterator[str]:
    """Yield a line for an orientation filter, which lacks a field if only readings come in."""
    if imu.orientation.source == "filter":
        yield (
            f"{prefix}imu.orientation_source = 'filter': must be model in an error model; there "
            "is no magnetic field for a filter"
        )


def has_mount(imu: ImuParameters) -> bool:
    """Return whether an IMU sits anywhere but in the body's origin and axes."""
    mounted = imu.mounting != IDENTITY_MATRIX
    return bool(mounted or any(imu.lever_arm) or any(imu.accelerometer_positions))


def sensor_rotation(parameters: InputParameters) -> np.ndarray | None:
    """Return the rotation (3, 3) of the input's vectors into the IMU's axes; None: identity."""
    turned = np.reshape(parameters.frame_rotation, (3, 3)) @ AXES_TO_FLU[parameters.axes]
    return None if np.array_equal(turned, np.eye(3)) else turned


AXES_TO_FLU: Final = {
    "flu": np.eye(3),
    "frd": np.diag([1.0, -1.0, -1.0]),
    "optical": np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
}
"""``v_flu = M v_input``."""
