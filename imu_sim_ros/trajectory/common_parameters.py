# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters that every kind of trajectory has: repetition, rests, vibration, lead-in."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.parameters.kinds import (
    ZERO_VECTOR,
    Vector,
    choice,
    integer,
    number,
    numbers,
    text,
    vector,
)
from imu_sim_ros.parameters.sections import section

if TYPE_CHECKING:
    from imu_sim_ros.poses import PoseSequence
    from imu_sim_ros.trajectory.motion import Trajectory

PoseReader: TypeAlias = "Callable[..., PoseSequence]"
"""Reads the poses of a file; called with the path, and the topic if one is given."""
GIVEN: Final = "given"
"""The type of a motion that Python gives as an object or a function; no file can name it."""
TYPE_TEXT = "kind of trajectory, a name in config/trajectories, or a file as --trajectory takes it"


@dataclass(frozen=True)
class VibrationParameters:
    """Vibration of the body along and about its own axes, on top of any motion or rest."""

    frequency: tuple[float, ...] = numbers(
        (), "frequency of each sinusoid", unit="Hz", minimum=0.0, above_minimum=True
    )
    acceleration: tuple[float, ...] = numbers(
        (), "amplitude of each sinusoid along x, y, z; none: all 0", unit="m/s^2", group=3
    )
    phase: tuple[float, ...] = numbers(
        (), "phase of each sinusoid at t = 0; none: all 0", unit="rad"
    )
    angular_rate: tuple[float, ...] = numbers(
        (),
        "amplitude of each sinusoid's rotation about x, y, z; none: all 0",
        unit="rad/s",
        group=3,
    )
    angular_phase: tuple[float, ...] = numbers(
        (), "phase of each sinusoid's rotation at t = 0; none: same as phase", unit="rad"
    )
    noise_rms: Vector = vector(
        ZERO_VECTOR, "band-limited noise: RMS of its acceleration", unit="m/s^2", minimum=0.0
    )
    angular_noise_rms: Vector = vector(
        ZERO_VECTOR, "rotation in the same band: RMS of its rate", unit="rad/s", minimum=0.0
    )
    noise_low: float = number(
        20.0, "lower end of the noise's band", unit="Hz", minimum=0.0, above_minimum=True
    )
    noise_high: float = number(
        80.0, "upper end of the noise's band", unit="Hz", minimum=0.0, above_minimum=True
    )
    noise_lines: int = integer(
        32, "sinusoids per axis that make up the noise", minimum=8, maximum=4096
    )
    seed: int = integer(0, "seed of the noise", minimum=0, maximum=2**63 - 1)

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield what does not fit together."""
        count = len(self.frequency)
        left_out = {"acceleration": bool(self.angular_rate), "angular_rate": True}
        for name, may_be_empty in left_out.items():
            given = getattr(self, name)
            if len(given) != 3 * count and (given or not may_be_empty):
                yield (
                    f"{prefix}{name} = {list(given)}: must have three entries for "
                    f"each of the {count} in {prefix}frequency"
                )
        for name in ("phase", "angular_phase"):
            given = getattr(self, name)
            if given and len(given) != count:
                yield (
                    f"{prefix}{name} = {list(given)}: must be empty or have as many entries as "
                    f"{prefix}frequency, {count}"
                )
        if self.noise_high <= self.noise_low:
            yield (
                f"{prefix}noise_high = {self.noise_high:g}: must be above {prefix}noise_low, "
                f"{self.noise_low:g} Hz"
            )


@dataclass(frozen=True)
class LeadInParameters:
    """Rest and a jerk before any motion: what visual-inertial estimators initialise from."""

    rest: float = number(
        0.0, "rest before the jerk; 0: neither rest nor jerk", unit="s", minimum=0.0
    )
    jerk: Vector = vector(
        (0.1, 0.1, 0.2), "displacement of the jerk in the world, there and back", unit="m"
    )
    jerk_time: float = number(1.0, "length of the jerk", unit="s", minimum=0.05, maximum=100.0)

    @property
    def duration(self) -> float:
        """Time until the jerk is over [s]; 0: there is none."""
        return self.rest + self.jerk_time if self.rest > 0.0 else 0.0


@dataclass(frozen=True)
class TrajectoryParameters:
    """What every trajectory has; applied in the order length, repeat, time scale and rests."""

    type: str = text("static", TYPE_TEXT)
    length: float = number(0.0, "use this much of the motion; 0: all of it", unit="s", minimum=0.0)
    repeat: int = integer(1, "number of times the motion is run; 0: endless", minimum=0)
    repeat_mode: str = choice(
        "loop",
        ("loop", "there_and_back"),
        "loop: from the start again, for closed motions; there_and_back: to the end, back, ...",
    )
    time_scale: float = number(
        1.0,
        "2: twice as fast, with four times the accelerations",
        minimum=0.0,
        above_minimum=True,
        maximum=1000.0,
    )
    rest_before: float = number(0.0, "rest before the motion", unit="s", minimum=0.0)
    rest_after: float = number(0.0, "rest after the motion", unit="s", minimum=0.0)
    rest_transition: float = number(
        2.0,
        "time in which the motion starts from rest, comes to rest, or reverses",
        unit="s",
        minimum=0.0,
        above_minimum=True,
    )
    lead_in: LeadInParameters = section(LeadInParameters)
    vibration: VibrationParameters = section(VibrationParameters)

    def motion(self, pose_reader: "PoseReader") -> "Trajectory":
        """Return the bare motion; here that of a user's own parameters, which sample themselves.

        A type imports what it needs when it is asked, some SciPy.

        :param pose_reader: reads a file of poses.
        :raises ConfigurationError: for parameters that do not describe a motion.
        """
        if self.type == GIVEN:
            raise ConfigurationError(
                "trajectory.type = 'given': an object or a function from Python; give it as "
                "trajectory="
            )
        if not (hasattr(self, "sample") and hasattr(self, "duration")):
            raise ConfigurationError(
                f"trajectory.type = {self.type!r}: {type(self).__name__} lacks "
                "duration or sample(t)"
            )
        return _Own(self)


class _Own:
    """The motion of a user's own parameters, which may leave out the highest frequency."""

    def __init__(self, parameters: Any) -> None:
        self.sample = parameters.sample
        self.duration: float = parameters.duration
        self.highest_frequency: float = getattr(parameters, "highest_frequency", 0.0)
