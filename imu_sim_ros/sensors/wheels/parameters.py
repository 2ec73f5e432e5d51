# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the wheels of the body: ``wheels.*``."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from imu_sim_ros.core.conventions import ABSOLUTE_ZERO
from imu_sim_ros.core.timebase import LOWEST_RATE
from imu_sim_ros.parameters.kinds import choice, integer, number, numbers, text, texts
from imu_sim_ros.sensors.parameters import SensorParameters

_SIDES: Final = ("left", "right")
_FOUR: Final = tuple(f"{end}_{side}_wheel_joint" for end in ("front", "rear") for side in _SIDES)
JOINTS: Final = {
    "differential": tuple(f"{side}_wheel_joint" for side in _SIDES),
    "ackermann": (*_FOUR[2:], "front_steering_joint"),
    "omnidirectional": _FOUR,
}
"""Joints of each model; all but that of the steering are wheels with encoders."""
WHEELS: Final = {"differential": 2, "ackermann": 2, "omnidirectional": 4}
_TO_DRAW: Final = "empty: drawn with"


@dataclass(frozen=True)
class WheelsParameters(SensorParameters):
    """Wheels of one vehicle; the lever arm is that of the point whose motion they measure."""

    rate: float = number(
        50.0, "readings per second", unit="Hz", minimum=LOWEST_RATE, maximum=1000.0
    )
    frame: str = text(
        "",
        "child frame of wheel/odom, at the middle of the axle, or of all four wheels; "
        "empty: body_frame, or NAME_link if it has another mount",
    )
    odom_frame: str = text("odom", "frame of the pose in wheel/odom; it begins at 0")
    preset: str = text("none", "file in config/wheels, or a path, to start from")
    model: str = choice(
        "differential",
        tuple(JOINTS),
        "differential: two wheels, or two sides; ackermann: two rear wheels and a steering "
        "angle; omnidirectional: four mecanum wheels",
    )
    joint_names: tuple[str, ...] = texts((), "names in joint_states; empty: default names")
    radius: float = number(
        0.1, "radius of the wheels that the odometry uses", unit="m", minimum=1e-3, maximum=100.0
    )
    track: float = number(
        0.5,
        "distance between left and right wheels that the odometry uses",
        unit="m",
        minimum=1e-3,
        maximum=100.0,
    )
    wheelbase: float = number(
        0.5,
        "distance between front and rear wheels that the odometry uses (not differential)",
        unit="m",
        minimum=1e-3,
        maximum=100.0,
    )
    true_radii: tuple[float, ...] = numbers(
        (), f"true radius of each wheel; {_TO_DRAW} radius_sigma_percent", unit="m", minimum=1e-3
    )
    true_base: tuple[float, ...] = numbers(
        (),
        f"true track and true wheelbase; {_TO_DRAW} base_sigma_percent",
        unit="m",
        minimum=1e-3,
    )
    radius_sigma_percent: float = number(
        0.0,
        "standard deviation of each wheel's radius around the nominal one; the stated "
        "covariance includes it",
        unit="%",
        minimum=0.0,
        maximum=20.0,
    )
    base_sigma_percent: float = number(
        0.0,
        "standard deviation of a common factor of track and wheelbase; the stated covariance "
        "includes it",
        unit="%",
        minimum=0.0,
        maximum=20.0,
    )
    radius_temperature_coefficient: float = number(
        0.0,
        "relative growth of the true radii with temperature; odometry and stated covariance do "
        "not include it",
        unit="1/K",
        minimum=-0.01,
        maximum=0.01,
    )
    reference_temperature: float = number(
        25.0, "temperature at which the true radii apply", unit="degC", minimum=ABSOLUTE_ZERO
    )
    temperature_time_constant: float = number(
        0.0,
        "wheels follow the ambient temperature, `temperature.*`, with this time constant",
        unit="s",
        minimum=0.0,
    )
    ticks: int = integer(
        4096,
        "counts of an encoder in a turn of its wheel; 0: angles are not rounded",
        minimum=0,
        maximum=1_000_000_000,
    )
    encoder_noise: float = number(
        0.0005,
        "standard deviation of an angle, white, before rounding",
        unit="rad",
        minimum=0.0,
        maximum=math.pi,
    )
    slip_noise: float = number(
        0.002,
        "random slip of each wheel: standard deviation of the distance after 1 m; it grows with "
        "the root of the distance",
        unit="sqrt(m)",
        minimum=0.0,
        maximum=10.0,
    )
    turn_slip: float = number(
        0.0,
        "wheels turn the vehicle by 1 / (1 + this) of what they would without slip; the stated "
        "covariance does not include it",
        unit="1",
        minimum=0.0,
        maximum=100.0,
    )
    patch_rate: float = number(
        0.0,
        "mean rate of slippery patches; the stated covariance does not include them",
        unit="1/s",
        minimum=0.0,
        maximum=100.0,
    )
    patch_duration: float = number(
        0.5,
        "mean time on a patch (exponentially distributed)",
        unit="s",
        minimum=0.0,
        above_minimum=True,
        maximum=1e6,
    )
    patch_slip: float = number(
        0.0,
        "largest slip on a patch: each wheel turns faster by a share drawn uniformly from 0 to "
        "this",
        unit="1",
        minimum=0.0,
        maximum=100.0,
    )
    patch_boxes: tuple[float, ...] = numbers(
        (),
        "slippery boxes in the world: least x, y, z, largest x, y, z, and slip, of each; a wheel "
        "that touches the ground inside turns faster by this share; the stated covariance does "
        "not include it",
        unit="m, 1",
        group=7,
    )
    side_slip_sigma: float = number(
        0.05,
        "stated standard deviation of the sideways speed, which is 0 (not omnidirectional)",
        unit="m/s",
        minimum=0.0,
        above_minimum=True,
    )
    steering_limit: float = number(
        0.6,
        "largest steering angle (ackermann)",
        unit="rad",
        minimum=0.0,
        above_minimum=True,
        maximum=1.5,
    )
    steering_noise: float = number(
        0.002,
        "standard deviation of the steering angle, white (ackermann)",
        unit="rad",
        minimum=0.0,
        maximum=1.0,
    )
    steering_offset: tuple[float, ...] = numbers(
        (),
        f"error of the steering angle (ackermann), one number; {_TO_DRAW} steering_offset_sigma",
        unit="rad",
    )
    steering_offset_sigma: float = number(
        0.0,
        "standard deviation of that error; the stated covariance includes it",
        unit="rad",
        minimum=0.0,
        maximum=1.0,
    )

    @property
    def joints(self) -> tuple[str, ...]:
        """Names in joint_states."""
        return self.joint_names or JOINTS[self.model]

    @property
    def wheels(self) -> int:
        """Number of wheels with encoders."""
        return WHEELS[self.model]

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each contradiction between parameters."""
        yield from super().problems(prefix)
        lists: tuple[tuple[str, Sequence[object], int], ...] = (
            ("joint_names", self.joint_names, len(JOINTS[self.model])),
            ("true_radii", self.true_radii, self.wheels),
            ("true_base", self.true_base, 2),
            ("steering_offset", self.steering_offset, 1),
        )
        for name, entries, count in lists:
            if entries and len(entries) != count:
                yield f"{prefix}{name} = {list(entries)}: must be empty or {count} ({self.model})"
        for k in range(0, len(self.patch_boxes), 7):
            box = self.patch_boxes[k : k + 7]
            if any(low >= high for low, high in zip(box[:3], box[3:6], strict=True)):
                yield f"{prefix}patch_boxes: {list(box)}: least must be below largest"
            if not 0.0 <= box[6] <= 100.0:
                yield f"{prefix}patch_boxes: slip {box[6]:g}: must be between 0 and 100"
        if bool(self.patch_rate) != bool(self.patch_slip):
            yield (
                f"{prefix}patch_rate = {self.patch_rate:g} and {prefix}patch_slip = "
                f"{self.patch_slip:g}: must both be 0 or both be above 0"
            )
