# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the simulator node: those of a simulation, and how it is played."""

import dataclasses
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from imu_sim_ros.core import timebase
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import Problems
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.parameters.files import build_from_layers
from imu_sim_ros.parameters.kinds import (
    Vector,
    choice,
    flag,
    integer,
    number,
    text,
    vector,
)
from imu_sim_ros.parameters.sections import common_sections, is_of_ros, section
from imu_sim_ros.sensors import find_sensor, sensors_of_imus
from imu_sim_ros.sensors.declaration import Sensor
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.sensors.parameters import LARGEST_LATENCY, LONGEST, MountedParameters
from imu_sim_ros.simulation.parameters import SimulationParameters, imus, layer_files

PARTS: Final = (
    *TRIADS,
    *(sensor.name for sensor in sensors_of_imus() if sensor.faults),
)
"""Targets of the faults of an IMU and of the sensors with it."""
FAULTS = ("none", "bias_jump", "saturation", "stuck", "dropout", "latency")


def _biases() -> str:
    """Return the names of the topics of the biases of all sensors of IMUs as text: ``a and b``."""
    names = [
        t.name for sensor in sensors_of_imus() for t in sensor.topics if "biases" in (t.flags or ())
    ]
    return " and ".join(names)


def switches(sensors: Iterable[Sensor[MountedParameters]]) -> dict[str, type]:
    """Return the classes of the switches ``publish.*`` of sensors, by the sensor's name."""
    return {sensor.name: sensor.switches for sensor in sensors if sensor.switches is not None}


@dataclass(frozen=True)
class ImuPublishParameters:
    """Switches of the topics published in addition to an IMU's readings."""

    ground_truth_imu: bool = flag(False, "publish ground_truth/imu, the readings without errors")
    biases: bool = flag(
        False,
        f"publish ground_truth/gyroscope_bias and ground_truth/accelerometer_bias, and "
        f"{_biases()} if those sensors are published",
    )
    errors: bool = flag(
        False,
        "publish the other true errors of the readings: ground_truth/gyroscope_scale, _noise, "
        "_response_error, _low_pass and _vibration, and those of the accelerometer",
    )
    temperature: bool = flag(False, "publish imu/temperature")


@dataclass(frozen=True)
class PublishParameters(ImuPublishParameters):
    """Switches of the topics published in addition to ``imu/data_raw``."""

    ground_truth: bool = flag(True, "publish ground_truth/odom")
    ground_truth_fix: bool = flag(
        False, "publish ground_truth/fix, latitude, longitude and height of the body"
    )
    increments: bool = flag(
        False, "publish imu/delta_angle and imu/delta_velocity; imu.sampling must be averaged"
    )
    ground_truth_increments: bool = flag(
        False,
        "publish ground_truth/delta_angle and ground_truth/delta_velocity; imu.sampling must be "
        "averaged",
    )
    clock_rate: float = number(
        0.0, "rate of /clock, the simulated time; 0: none", unit="Hz", minimum=0.0, maximum=1000.0
    )
    tf_rate: float = number(
        0.0,
        "rate of the transform from world_frame to body_frame on /tf; 0: none",
        unit="Hz",
        minimum=0.0,
        maximum=1000.0,
    )
    tf_static: bool = flag(
        True, "publish the IMUs' lever arms and mountings in body_frame on /tf_static"
    )
    sensors: Mapping[str, object] = common_sections(lambda: switches(sensors_of_imus()), joint=None)


@dataclass(frozen=True)
class InjectParameters:
    """A fault that begins when ``kind`` is set; each setting of it injects another one."""

    kind: str = choice(
        "none",
        FAULTS,
        "fault that starts with the next block: set the other inject.* before it or with it",
        live=True,
    )
    duration: float = number(
        1.0,
        "length of the fault",
        unit="s",
        minimum=0.0,
        above_minimum=True,
        maximum=LONGEST,
        live=True,
    )
    delay: float = number(
        0.0,
        "time from the next block to the start of the fault",
        unit="s",
        minimum=0.0,
        maximum=LONGEST,
        live=True,
    )
    triad: str = text(
        "gyroscope",
        f"triad that a bias_jump, saturation or stuck affects, {' or '.join(TRIADS)}; "
        f"{', '.join(PARTS[len(TRIADS) :])} or a name in `sensors`: any fault affects that sensor "
        "alone",
        live=True,
    )
    value: Vector = vector(
        0.0,
        "bias_jump: change of the bias [rad/s, m/s^2, T or Pa]; saturation: limit in the "
        "same unit, 0: this axis has none; dropout: probability (1: all are lost); latency: [s], "
        f"at most {LARGEST_LATENCY:g}",
        live=True,
    )
    imu: str = text("", "affected IMU, a name in `imus`; empty: all", live=True)

    def unknown_part(self, prefix: str, names: Collection[str]) -> Iterator[str]:
        """Yield a line if `triad` is none of the known names."""
        if self.triad not in names:
            yield f"{prefix}inject.triad = {self.triad!r}: {suggestion(self.triad, names)}"

    def fault(self) -> Fault:
        """Return the fault that the parameters describe.

        :raises ConfigurationError: for an invalid fault.
        """
        of_triad = self.kind in ("bias_jump", "saturation", "stuck")
        has_target = of_triad or self.triad not in TRIADS
        value = self.value if of_triad else self.value[0]
        return Fault(self.kind, self.duration, value, self.triad if has_target else "")


@dataclass(frozen=True)
class SimulatorParameters(SimulationParameters):
    """Parameters of the simulator node: those of the samples, and those of their publication."""

    real_time_factor: float = number(
        1.0,
        "simulated seconds per second; 0: as fast as the subscribers acknowledge",
        minimum=0.0,
        maximum=1000.0,
        live=True,
    )
    catch_up: bool = flag(
        True, "after a stall publish every sample late; false: skip to now", live=True
    )
    autostart: bool = flag(True, "start at once; false: wait for ~/pause with data: false")
    wait_for_subscribers: int = integer(
        0, "start when imu/data_raw has this many subscribers", minimum=0
    )
    wait_for_truth_subscribers: int = integer(
        0, "start when ground_truth/odom has this many subscribers", minimum=0
    )
    block_duration: float = number(
        0.2,
        "length of the blocks computed ahead; changes at run time take effect after it",
        unit="s",
        minimum=0.001,
        maximum=10.0,
    )
    step_samples: int = integer(
        1, "samples that ~/step publishes", minimum=1, maximum=1_000_000, live=True
    )
    publish: PublishParameters = section(PublishParameters)
    inject: InjectParameters = section(InjectParameters)

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield problems that involve several parameters, one line each."""
        yield from super().problems(prefix)
        for name, rate in (
            ("clock_rate", self.publish.clock_rate),
            ("tf_rate", self.publish.tf_rate),
        ):
            if 0.0 < rate < timebase.LOWEST_RATE:
                yield (
                    f"{prefix}publish.{name} = {rate:g}: "
                    f"must be 0 or at least {timebase.LOWEST_RATE:g} Hz"
                )
        if self.wait_for_truth_subscribers and not self.publish.ground_truth:
            yield (
                f"{prefix}wait_for_truth_subscribers = {self.wait_for_truth_subscribers}: "
                f"must be 0 if {prefix}publish.ground_truth is false"
            )
        needs_means = self.publish.increments or self.publish.ground_truth_increments
        for name, simulation in imus(self).items() if needs_means else ():
            if simulation.imu.sampling != "averaged":
                prefix_of_imu = f"{name}." if name else prefix
                yield (
                    f"{prefix_of_imu}imu.sampling = {simulation.imu.sampling!r}: must be averaged "
                    f"if {prefix}publish.increments or publish.ground_truth_increments is true"
                )
        if self.inject.imu and self.inject.imu not in self.imus:
            yield (
                f"{prefix}inject.imu = {self.inject.imu!r}: must be empty or one of imus, "
                f"{list(self.imus)}"
            )
        sensors = [
            name
            for name, section in self.each_sensor.items()
            if find_sensor(section.type or name).faults
        ]
        yield from self.inject.unknown_part(prefix, (*PARTS, *sensors))


def load_simulator(
    *layers: Mapping[str, object], problems: Problems | None = None
) -> SimulatorParameters:
    """Return the simulator's parameters; later layers override earlier ones.

    :param problems: problems of earlier checks, which are raised with those of this one.
    :raises ConfigurationError: with a line for each problem.
    """
    return build_from_layers(SimulatorParameters, layer_files, *layers, problems=problems)


def live_parameter_names(names: Mapping[str, object]) -> list[str]:
    """Return the names of parameters that concern the live node alone, not its samples.

    Parameters that ROS gives to every node are among them.
    """
    node_names, samples = (
        {field.name for field in dataclasses.fields(cls)}
        for cls in (SimulatorParameters, SimulationParameters)
    )
    node = node_names - samples
    return [name for name in names if name.partition(".")[0] in node or is_of_ros(name)]
