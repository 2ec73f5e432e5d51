# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every parameter once: frozen dataclasses with unit, range and text, and the files that set them.

``files`` finds, reads, layers and writes ROS 2 parameter files; the other modules hold the
parameters of one thing each. Imports conventions and errors.
"""

from imu_sim_ros.config import files
from imu_sim_ros.config.campaign import (
    PLACES,
    CampaignParameters,
    CommandEstimator,
    DeadReckonEstimator,
    find_estimator,
)
from imu_sim_ros.config.files import Layering, build_layered
from imu_sim_ros.config.imu import LARGEST_LATENCY, ImuParameters
from imu_sim_ros.config.integrator import (
    ATTITUDE_UPDATES,
    INITIAL_STATES,
    METHODS,
    IntegratorNoiseParameters,
    IntegratorParameters,
    layer_integrator,
)
from imu_sim_ros.config.parameter import (
    EMPTY_LIST,
    IDENTITY_MATRIX,
    ZERO_MATRIX,
    ZERO_VECTOR,
    Matrix,
    Parameter,
    Value,
    Vector,
    build,
    flatten,
    parameters,
    parse,
    shown,
    unknown,
)
from imu_sim_ros.config.recorder import RecorderParameters
from imu_sim_ros.config.simulation import SimulationParameters, load_simulation
from imu_sim_ros.config.simulator import (
    BODY,
    InjectParameters,
    PublishParameters,
    SimulatorParameters,
    has_cameras,
    layer_simulator,
    load_simulator,
    of_the_node,
    simulations,
    simulator_section,
)
from imu_sim_ros.config.temperature import TemperatureParameters
from imu_sim_ros.config.trajectory import (
    TYPES,
    FreeFallParameters,
    HarmonicParameters,
    LeadInParameters,
    PolarParameters,
    PosesParameters,
    SeriesParameters,
    SixPositionParameters,
    StaticParameters,
    TrajectoryParameters,
    TurntableParameters,
    VibrationParameters,
    WaypointsParameters,
)
from imu_sim_ros.config.triads import NO_CROSS_AXIS, TriadParameters

__all__ = [
    "ATTITUDE_UPDATES",
    "BODY",
    "EMPTY_LIST",
    "IDENTITY_MATRIX",
    "INITIAL_STATES",
    "LARGEST_LATENCY",
    "METHODS",
    "NO_CROSS_AXIS",
    "PLACES",
    "TYPES",
    "ZERO_MATRIX",
    "ZERO_VECTOR",
    "CampaignParameters",
    "CommandEstimator",
    "DeadReckonEstimator",
    "FreeFallParameters",
    "HarmonicParameters",
    "ImuParameters",
    "InjectParameters",
    "IntegratorNoiseParameters",
    "IntegratorParameters",
    "Layering",
    "LeadInParameters",
    "Matrix",
    "Parameter",
    "PolarParameters",
    "PosesParameters",
    "PublishParameters",
    "RecorderParameters",
    "SeriesParameters",
    "SimulationParameters",
    "SimulatorParameters",
    "SixPositionParameters",
    "StaticParameters",
    "TemperatureParameters",
    "TrajectoryParameters",
    "TriadParameters",
    "TurntableParameters",
    "Value",
    "Vector",
    "VibrationParameters",
    "WaypointsParameters",
    "build",
    "build_layered",
    "files",
    "find_estimator",
    "flatten",
    "has_cameras",
    "layer_integrator",
    "layer_simulator",
    "load_simulation",
    "load_simulator",
    "of_the_node",
    "parameters",
    "parse",
    "shown",
    "simulations",
    "simulator_section",
    "unknown",
]
