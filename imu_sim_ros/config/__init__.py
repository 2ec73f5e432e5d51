# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every parameter once: frozen dataclasses with unit, range and text, and the files that set them.

``files`` finds, reads, layers and writes ROS 2 parameter files; the other modules hold the
parameters of one thing each, and are imported when they are first used. Imports conventions, lazy,
inputs and errors.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.config import files as files
    from imu_sim_ros.config.campaign import CALIBRATIONS as CALIBRATIONS
    from imu_sim_ros.config.campaign import PLACES as PLACES
    from imu_sim_ros.config.campaign import CalibrationEstimator as CalibrationEstimator
    from imu_sim_ros.config.campaign import CampaignParameters as CampaignParameters
    from imu_sim_ros.config.campaign import CommandEstimator as CommandEstimator
    from imu_sim_ros.config.campaign import DeadReckonEstimator as DeadReckonEstimator
    from imu_sim_ros.config.campaign import find_estimator as find_estimator
    from imu_sim_ros.config.environment import EnvironmentParameters as EnvironmentParameters
    from imu_sim_ros.config.files import Layering as Layering
    from imu_sim_ros.config.files import build_layered as build_layered
    from imu_sim_ros.config.imu import LARGEST_LATENCY as LARGEST_LATENCY
    from imu_sim_ros.config.imu import ImuParameters as ImuParameters
    from imu_sim_ros.config.imu import rotation_problems as rotation_problems
    from imu_sim_ros.config.integrator import ATTITUDE_UPDATES as ATTITUDE_UPDATES
    from imu_sim_ros.config.integrator import INITIAL_STATES as INITIAL_STATES
    from imu_sim_ros.config.integrator import METHODS as METHODS
    from imu_sim_ros.config.integrator import IntegratorNoiseParameters as IntegratorNoiseParameters
    from imu_sim_ros.config.integrator import IntegratorParameters as IntegratorParameters
    from imu_sim_ros.config.integrator import layer_integrator as layer_integrator
    from imu_sim_ros.config.integrator import outside_covariance as outside_covariance
    from imu_sim_ros.config.parameter import EMPTY_LIST as EMPTY_LIST
    from imu_sim_ros.config.parameter import IDENTITY_MATRIX as IDENTITY_MATRIX
    from imu_sim_ros.config.parameter import OF_EVERY_NODE as OF_EVERY_NODE
    from imu_sim_ros.config.parameter import ZERO_MATRIX as ZERO_MATRIX
    from imu_sim_ros.config.parameter import ZERO_VECTOR as ZERO_VECTOR
    from imu_sim_ros.config.parameter import Matrix as Matrix
    from imu_sim_ros.config.parameter import Parameter as Parameter
    from imu_sim_ros.config.parameter import Value as Value
    from imu_sim_ros.config.parameter import Vector as Vector
    from imu_sim_ros.config.parameter import bad_values as bad_values
    from imu_sim_ros.config.parameter import build as build
    from imu_sim_ros.config.parameter import flatten as flatten
    from imu_sim_ros.config.parameter import parameters as parameters
    from imu_sim_ros.config.parameter import parse as parse
    from imu_sim_ros.config.parameter import unknown as unknown
    from imu_sim_ros.config.recorder import RecorderParameters as RecorderParameters
    from imu_sim_ros.config.simulation import DEFAULT_TRAJECTORY as DEFAULT_TRAJECTORY
    from imu_sim_ros.config.simulation import LARGEST_JITTER as LARGEST_JITTER
    from imu_sim_ros.config.simulation import SimulationParameters as SimulationParameters
    from imu_sim_ros.config.simulation import load_simulation as load_simulation
    from imu_sim_ros.config.simulator import BODY as BODY
    from imu_sim_ros.config.simulator import InjectParameters as InjectParameters
    from imu_sim_ros.config.simulator import PublishParameters as PublishParameters
    from imu_sim_ros.config.simulator import SimulatorParameters as SimulatorParameters
    from imu_sim_ros.config.simulator import has_cameras as has_cameras
    from imu_sim_ros.config.simulator import layer_simulator as layer_simulator
    from imu_sim_ros.config.simulator import load_simulator as load_simulator
    from imu_sim_ros.config.simulator import of_the_node as of_the_node
    from imu_sim_ros.config.simulator import simulations as simulations
    from imu_sim_ros.config.simulator import simulator_section as simulator_section
    from imu_sim_ros.config.temperature import TemperatureParameters as TemperatureParameters
    from imu_sim_ros.config.trajectory import TYPES as TYPES
    from imu_sim_ros.config.trajectory import FreeFallParameters as FreeFallParameters
    from imu_sim_ros.config.trajectory import HarmonicParameters as HarmonicParameters
    from imu_sim_ros.config.trajectory import LeadInParameters as LeadInParameters
    from imu_sim_ros.config.trajectory import PolarParameters as PolarParameters
    from imu_sim_ros.config.trajectory import PosesParameters as PosesParameters
    from imu_sim_ros.config.trajectory import SeriesParameters as SeriesParameters
    from imu_sim_ros.config.trajectory import SixPositionParameters as SixPositionParameters
    from imu_sim_ros.config.trajectory import StaticParameters as StaticParameters
    from imu_sim_ros.config.trajectory import TrajectoryParameters as TrajectoryParameters
    from imu_sim_ros.config.trajectory import TurntableParameters as TurntableParameters
    from imu_sim_ros.config.trajectory import VibrationParameters as VibrationParameters
    from imu_sim_ros.config.trajectory import WaypointsParameters as WaypointsParameters
    from imu_sim_ros.config.triads import NO_CROSS_AXIS as NO_CROSS_AXIS
    from imu_sim_ros.config.triads import TriadParameters as TriadParameters
    from imu_sim_ros.config.vehicle import BoardVibrationParameters as BoardVibrationParameters
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "": [
                "files",
            ],
            "campaign": [
                "CalibrationEstimator",
                "CampaignParameters",
                "CommandEstimator",
                "DeadReckonEstimator",
                "CALIBRATIONS",
                "PLACES",
                "find_estimator",
            ],
            "environment": ["EnvironmentParameters"],
            "files": [
                "Layering",
                "build_layered",
            ],
            "imu": [
                "ImuParameters",
                "LARGEST_LATENCY",
                "rotation_problems",
            ],
            "integrator": [
                "ATTITUDE_UPDATES",
                "INITIAL_STATES",
                "IntegratorNoiseParameters",
                "IntegratorParameters",
                "METHODS",
                "layer_integrator",
                "outside_covariance",
            ],
            "parameter": [
                "EMPTY_LIST",
                "IDENTITY_MATRIX",
                "Matrix",
                "Parameter",
                "Value",
                "Vector",
                "OF_EVERY_NODE",
                "ZERO_MATRIX",
                "ZERO_VECTOR",
                "bad_values",
                "build",
                "flatten",
                "parameters",
                "parse",
                "unknown",
            ],
            "recorder": [
                "RecorderParameters",
            ],
            "simulation": [
                "DEFAULT_TRAJECTORY",
                "LARGEST_JITTER",
                "SimulationParameters",
                "load_simulation",
            ],
            "simulator": [
                "BODY",
                "InjectParameters",
                "PublishParameters",
                "SimulatorParameters",
                "has_cameras",
                "layer_simulator",
                "load_simulator",
                "of_the_node",
                "simulations",
                "simulator_section",
            ],
            "temperature": [
                "TemperatureParameters",
            ],
            "trajectory": [
                "FreeFallParameters",
                "HarmonicParameters",
                "LeadInParameters",
                "PolarParameters",
                "PosesParameters",
                "SeriesParameters",
                "SixPositionParameters",
                "StaticParameters",
                "TYPES",
                "TrajectoryParameters",
                "TurntableParameters",
                "VibrationParameters",
                "WaypointsParameters",
            ],
            "triads": [
                "NO_CROSS_AXIS",
                "TriadParameters",
            ],
            "vehicle": [
                "BoardVibrationParameters",
            ],
        },
    )
