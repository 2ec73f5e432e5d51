"""Parameters of the trajectories, one section for each ``trajectory.type``."""

from dataclasses import dataclass

from imu_sim_ros.config.parameter import ZERO_VECTOR, Vector, text, vector
from imu_sim_ros.errors import ConfigurationError


@dataclass(frozen=True)
class TrajectoryParameters:
    """What every trajectory has."""

    type: str = text("static", "kind of trajectory, or the name of a file in config/trajectories")


@dataclass(frozen=True)
class StaticParameters(TrajectoryParameters):
    """A body at rest."""

    position: Vector = vector(ZERO_VECTOR, "position in the world", unit="m")


TYPES: dict[str, type[TrajectoryParameters]] = {"static": StaticParameters}


def find_trajectory(name: str) -> type[TrajectoryParameters]:
    """Return the section of a trajectory type.

    :raises ConfigurationError: for a type that does not exist.
    """
    if name in TYPES:
        return TYPES[name]
    raise ConfigurationError(f"trajectory.type = {name!r}: must be one of {', '.join(TYPES)}")
