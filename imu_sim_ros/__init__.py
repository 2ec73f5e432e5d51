# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulation of IMUs and other sensors of a body, and recovery of parameters from readings.

>>> import imu_sim_ros as ims
>>> flight = ims.simulate(imu="tactical", trajectory="figure_eight", duration=60, rate=200, seed=1)
>>> track = ims.dead_reckon(flight, method="midpoint")
>>> ims.evaluate(track, flight.truth)
<Evaluation of 12000 poses, coverage 100 %, 145.9 m: position 11.71 m rms, attitude ...>

The names in ``__all__`` are public: they change only with a note in the changelog. Each is imported
when it is first used. Everything else in ``imu_sim_ros.`` is internal and may change at any time.

Conventions
===========

Frames
    ``w``  world, east-north-up (ENU); gravity is ``g_w = (0, 0, -9.81)`` unless configured.
    ``b``  body, forward-left-up (FLU).
    ``i``  IMU, if it is offset from the body or rotated.

Rotations
    ``R_wb`` maps body to world: ``v_w = R_wb @ v_b``; neighbouring letters cancel.
    ``q_wb`` is the same rotation as a unit Hamilton quaternion ``(w, x, y, z)``, last axis.
    The order ``(x, y, z, w)`` of ROS exists only where messages are encoded or decoded.
    Euler angles are roll, pitch, yaw with ``R_wb = Rz(yaw) Ry(pitch) Rx(roll)``.
    ``omega_b`` is the body's angular rate relative to the world, resolved in the body.

Readings
    An accelerometer reads the specific force ``f_b = R_wb.T @ (a_w - g_w)``: +9.81 on z when level
    and at rest. A gyroscope reads ``omega_b``.

Units
    SI and radians everywhere; degrees only under names that end in ``_deg``.

Noise
    Continuous-time densities with the names and units of kalibr: ``gyroscope_noise_density``
    rad/s/sqrt(Hz), ``gyroscope_random_walk`` rad/s^2/sqrt(Hz), ``accelerometer_noise_density``
    m/s^2/sqrt(Hz), ``accelerometer_random_walk`` m/s^3/sqrt(Hz). A per-sample value ends in
    ``_discrete``: white noise ``sigma / sqrt(dt)``, one step of a walk ``sigma * sqrt(dt)``.

Time
    Stamps are int64 nanoseconds, ``t_ns``. Sample k is at ``t0_ns + round(k * 1e9 / rate)``, always
    computed from k. A float time is only ever a difference from a start, in seconds.

Shapes
    Time first: ``(n,)``, ``(n, 3)``, ``(n, 4)``, ``(n, 3, 3)``.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from imu_sim_ros import camera as camera
    from imu_sim_ros.core.errors import ArgumentTypeError as ArgumentTypeError
    from imu_sim_ros.core.errors import ConfigurationError as ConfigurationError
    from imu_sim_ros.core.errors import ImuSimError as ImuSimError
    from imu_sim_ros.core.errors import InputError as InputError
    from imu_sim_ros.core.errors import MissingDependencyError as MissingDependencyError
    from imu_sim_ros.core.records import Odometry as Odometry
    from imu_sim_ros.core.records import PoseSequence as PoseSequence
    from imu_sim_ros.core.records import Readings as Readings
    from imu_sim_ros.core.records import States as States
    from imu_sim_ros.jobs.add_errors import ErrorModel as ErrorModel
    from imu_sim_ros.jobs.add_errors import ErrorModelBatch as ErrorModelBatch
    from imu_sim_ros.jobs.add_errors import add_errors as add_errors
    from imu_sim_ros.jobs.add_errors import from_sdf as from_sdf
    from imu_sim_ros.jobs.add_errors_files import ErrorsAdded as ErrorsAdded
    from imu_sim_ros.jobs.add_errors_files import add_errors_to_file as add_errors_to_file
    from imu_sim_ros.jobs.allan import Estimated as Estimated
    from imu_sim_ros.jobs.allan import Noise as Noise
    from imu_sim_ros.jobs.allan import TriadNoise as TriadNoise
    from imu_sim_ros.jobs.allan import allan as allan
    from imu_sim_ros.jobs.attitude import AttitudeEvaluation as AttitudeEvaluation
    from imu_sim_ros.jobs.calibrate import Calibrated as Calibrated
    from imu_sim_ros.jobs.calibrate import Calibration as Calibration
    from imu_sim_ros.jobs.calibrate import TriadCalibration as TriadCalibration
    from imu_sim_ros.jobs.calibrate import calibrate_magnetometer as calibrate_magnetometer
    from imu_sim_ros.jobs.calibrate import calibrate_six_position as calibrate_six_position
    from imu_sim_ros.jobs.calibrate import calibrate_temperature as calibrate_temperature
    from imu_sim_ros.jobs.calibrate import calibrate_turntable as calibrate_turntable
    from imu_sim_ros.jobs.campaign import Campaign as Campaign
    from imu_sim_ros.jobs.campaign import campaign as campaign
    from imu_sim_ros.jobs.convert import Converted as Converted
    from imu_sim_ros.jobs.convert import convert as convert
    from imu_sim_ros.jobs.dead_reckon import Track as Track
    from imu_sim_ros.jobs.dead_reckon import dead_reckon as dead_reckon
    from imu_sim_ros.jobs.evaluate import Evaluation as Evaluation
    from imu_sim_ros.jobs.evaluate import evaluate as evaluate
    from imu_sim_ros.jobs.flight import Flight as Flight
    from imu_sim_ros.jobs.flight import Truth as Truth
    from imu_sim_ros.jobs.generate import Generated as Generated
    from imu_sim_ros.jobs.generate import generate as generate
    from imu_sim_ros.jobs.inspect import Inspection as Inspection
    from imu_sim_ros.jobs.inspect import inspect as inspect
    from imu_sim_ros.jobs.measured import ReadingsEvaluation as ReadingsEvaluation
    from imu_sim_ros.jobs.preintegrate import preintegrate as preintegrate
    from imu_sim_ros.jobs.presets import presets as presets
    from imu_sim_ros.jobs.readings import read_imu as read_imu
    from imu_sim_ros.jobs.readings import read_odometry as read_odometry
    from imu_sim_ros.jobs.readings import read_readings as read_readings
    from imu_sim_ros.jobs.readings import read_states as read_states
    from imu_sim_ros.jobs.recorded import read_images as read_images
    from imu_sim_ros.jobs.recorded import read_points as read_points
    from imu_sim_ros.jobs.report import Report as Report
    from imu_sim_ros.jobs.report import report as report
    from imu_sim_ros.jobs.simulate import blocks as blocks
    from imu_sim_ros.jobs.simulate import simulate as simulate
    from imu_sim_ros.jobs.twin import Twin as Twin
    from imu_sim_ros.jobs.twin import twin as twin
    from imu_sim_ros.jobs.twin_check import Check as Check
    from imu_sim_ros.navigation.preintegration import Preintegration as Preintegration
    from imu_sim_ros.navigation.state import NavigationState as NavigationState
    from imu_sim_ros.recordings.findings.finding import Finding as Finding
    from imu_sim_ros.sensors import register_sensor as register_sensor
    from imu_sim_ros.sensors.barometer.declaration import PressureReadings as PressureReadings
    from imu_sim_ros.sensors.barometer.declaration import read_pressure as read_pressure
    from imu_sim_ros.sensors.magnetometer.declaration import MagneticReadings as MagneticReadings
    from imu_sim_ros.sensors.magnetometer.declaration import read_magnetometer as read_magnetometer
    from imu_sim_ros.sensors.orientation.declaration import Orientations as Orientations
    from imu_sim_ros.sensors.orientation.declaration import read_orientation as read_orientation
    from imu_sim_ros.sensors.recorded import RecordedSamples as RecordedSamples
    from imu_sim_ros.trajectory.motion import Motion as Motion
_HOMES = {
    "camera": ["camera"],
    "core.errors": [
        *("ArgumentTypeError", "ConfigurationError", "ImuSimError", "InputError"),
        "MissingDependencyError",
    ],
    "jobs.add_errors": ["ErrorModel", "ErrorModelBatch", "add_errors", "from_sdf"],
    "jobs.add_errors_files": ["ErrorsAdded", "add_errors_to_file"],
    "jobs.allan": ["Estimated", "Noise", "TriadNoise", "allan"],
    "jobs.attitude": ["AttitudeEvaluation"],
    "jobs.calibrate": [
        *("Calibrated", "Calibration", "TriadCalibration", "calibrate_magnetometer"),
        *("calibrate_six_position", "calibrate_temperature", "calibrate_turntable"),
    ],
    "jobs.campaign": ["Campaign", "campaign"],
    "jobs.convert": ["Converted", "convert"],
    "jobs.flight": ["Flight", "Truth"],
    "jobs.generate": ["Generated", "generate"],
    "jobs.dead_reckon": ["Track", "dead_reckon"],
    "jobs.evaluate": ["Evaluation", "evaluate"],
    "jobs.inspect": ["Inspection", "inspect"],
    "jobs.measured": ["ReadingsEvaluation"],
    "jobs.preintegrate": ["preintegrate"],
    "jobs.presets": ["presets"],
    "jobs.readings": ["read_imu", "read_odometry", "read_readings", "read_states"],
    "jobs.recorded": ["read_images", "read_points"],
    "jobs.report": ["Report", "report"],
    "jobs.simulate": ["blocks", "simulate"],
    "jobs.twin": ["Twin", "twin"],
    "jobs.twin_check": ["Check"],
    "navigation.preintegration": ["Preintegration"],
    "navigation.state": ["NavigationState"],
    "recordings.findings.finding": ["Finding"],
    "core.records": ["Odometry", "PoseSequence", "Readings", "States"],
    "sensors.barometer.declaration": ["PressureReadings", "read_pressure"],
    "sensors.magnetometer.declaration": ["MagneticReadings", "read_magnetometer"],
    "sensors.orientation.declaration": ["Orientations", "read_orientation"],
    "sensors.recorded": ["RecordedSamples"],
    "sensors": ["register_sensor"],
    "trajectory.motion": ["Motion"],
}
__version__ = "2.0.0"
__all__ = sorted(name for names in _HOMES.values() for name in names)


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used (PEP 562)."""
    for module, names in _HOMES.items():
        if name in names:
            found = import_module(f"{__name__}.{module}")
            # All of them: rooms that have just been loaded bear the names of two functions.
            globals().update({one: getattr(found, one, found) for one in names})
            return globals()[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return the public names, also those that have not been imported yet."""
    return [*__all__, "__version__"]
