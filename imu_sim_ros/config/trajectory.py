"""Parameters of the trajectories, one section for each ``trajectory.type``."""

from collections.abc import Iterator
from dataclasses import dataclass

from imu_sim_ros.config.parameter import ZERO_VECTOR, Vector, numbers, section, text, vector
from imu_sim_ros.errors import ConfigurationError

_TYPE = "kind of trajectory, or the name of a file in config/trajectories"


@dataclass(frozen=True)
class TrajectoryParameters:
    """What every trajectory has."""

    type: str = text("static", _TYPE)


@dataclass(frozen=True)
class StaticParameters(TrajectoryParameters):
    """A body at rest."""

    position: Vector = vector(ZERO_VECTOR, "position in the world", unit="m")
    roll_pitch_yaw: Vector = vector(ZERO_VECTOR, "attitude", unit="rad")


@dataclass(frozen=True)
class SeriesParameters:
    """One coordinate as a function of time: a polynomial and a sum of sinusoids.

    ``sum_k polynomial[k] t^k + sum_j amplitude[j] sin(angular_frequency[j] t + phase[j])``
    """

    polynomial: tuple[float, ...] = numbers(
        (), "coefficients of t^0, t^1, t^2, ...", unit="m or rad per s^k"
    )
    amplitude: tuple[float, ...] = numbers((), "of each sinusoid", unit="m or rad")
    angular_frequency: tuple[float, ...] = numbers(
        (), "of each sinusoid", unit="rad/s", minimum=0.0, above_minimum=True
    )
    phase: tuple[float, ...] = numbers(
        (), "of each sinusoid at t = 0, pi/2 makes a cosine; none: all 0", unit="rad"
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield what is wrong with the lengths of the lists."""
        count = len(self.amplitude)
        if len(self.angular_frequency) != count:
            yield (
                f"{prefix}angular_frequency = {list(self.angular_frequency)}: must have as many "
                f"entries as {prefix}amplitude, {count}"
            )
        if self.phase and len(self.phase) != count:
            yield (
                f"{prefix}phase = {list(self.phase)}: must be empty or have as many entries as "
                f"{prefix}amplitude, {count}"
            )


@dataclass(frozen=True)
class HarmonicParameters(TrajectoryParameters):
    """Position and Euler angles, each a polynomial and a sum of sinusoids."""

    type: str = text("harmonic", _TYPE)
    x: SeriesParameters = section(SeriesParameters)
    y: SeriesParameters = section(SeriesParameters)
    z: SeriesParameters = section(SeriesParameters)
    roll: SeriesParameters = section(SeriesParameters)
    pitch: SeriesParameters = section(SeriesParameters)
    yaw: SeriesParameters = section(SeriesParameters)


TYPES: dict[str, type[TrajectoryParameters]] = {
    "static": StaticParameters,
    "harmonic": HarmonicParameters,
}


def find_trajectory(name: str) -> type[TrajectoryParameters]:
    """Return the section of a trajectory type.

    :raises ConfigurationError: for a type that does not exist.
    """
    if name in TYPES:
        return TYPES[name]
    raise ConfigurationError(f"trajectory.type = {name!r}: must be one of {', '.join(TYPES)}")
