"""Parameters of a simulation: what the simulator node and the command generate have in common."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from imu_sim_ros.config.files import layer
from imu_sim_ros.config.imu import ImuParameters
from imu_sim_ros.config.parameter import (
    Vector,
    build,
    integer,
    number,
    section,
    text,
    variant,
    vector,
)
from imu_sim_ros.config.trajectory import TrajectoryParameters, find_trajectory

DEFAULT_IMU = "lecture"
DEFAULT_TRAJECTORY = "lecture"


@dataclass(frozen=True)
class SimulationParameters:
    """Everything that decides the samples."""

    rate: float = number(
        200.0, "samples per second", unit="Hz", minimum=0.0, above_minimum=True, maximum=20000.0
    )
    seed: int = integer(0, "seed of all random streams", minimum=0, maximum=2**63 - 1)
    duration: float = number(
        0.0, "length of the run; 0: endless, or the trajectory's own length", unit="s", minimum=0.0
    )
    start_time: float = number(
        -1.0,
        "stamp of the first sample; -1: the wall clock in a node, 1 s in a file",
        unit="s",
        minimum=-1.0,
        maximum=4294967295.0,
    )
    world_frame: str = text("world", "frame of the truth's pose")
    body_frame: str = text("base_link", "frame of the body, child of the world frame")
    imu_frame: str = text("imu_link", "frame of the readings")
    gravity: Vector = vector((0.0, 0.0, -9.81), "gravity in the world frame", unit="m/s^2")
    trajectory: TrajectoryParameters = variant("type", "static", find_trajectory)
    imu: ImuParameters = section(ImuParameters)


def load_simulation(*layers: Mapping[str, object], node: str = "simulator") -> SimulationParameters:
    """Return the simulation that layers of parameters describe, later ones above earlier ones.

    :raises ConfigurationError: with a line for everything that is wrong.
    """
    return build(SimulationParameters, layer_simulation(layers, node))


def layer_simulation(layers: Iterable[Mapping[str, object]], node: str) -> dict[str, object]:
    """Return the layers as one, above the IMU preset and the trajectory file that they name."""
    return layer(layers, DEFAULT_IMU, DEFAULT_TRAJECTORY, node)
