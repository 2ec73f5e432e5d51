# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings and odometry as arrays, from a file or from simulated sensors."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol, TypeVar

import numpy as np

from imu_sim_ros.core import arguments, gate
from imu_sim_ros.core.arguments import (
    BAG_OR_FILE,
    array,
    name_of,
    refuse,
    string_list,
    suggest_keywords,
)
from imu_sim_ros.core.bad_rows import tell_skipped
from imu_sim_ros.core.conventions import STANDARD_GRAVITY
from imu_sim_ros.core.errors import ConfigurationError, InputError, warn
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.core.records import Readings, States, TimeSeries, replace_fields
from imu_sim_ros.core.rotation import from_euler
from imu_sim_ros.core.types import Array, Times
from imu_sim_ros.jobs.selection import check_choice
from imu_sim_ros.recordings.findings.catalogue import reading_findings
from imu_sim_ros.recordings.findings.measures import ReadingMeasures
from imu_sim_ros.recordings.findings.policy import FindingPolicy
from imu_sim_ros.recordings.findings.pose_order import sort_poses
from imu_sim_ros.sensors import (
    find_sensor,
    kind_of,
    registered_sensors,
    sensors_of_imus,
    switchable_sensors,
)
from imu_sim_ros.sensors.samples import Samples

ReadingsT = TypeVar("ReadingsT", bound="SensorReadings | TimeSeries")

if TYPE_CHECKING:
    from imu_sim_ros.sensors.declaration import SensorReadings


class HasPoses(Protocol):
    """Anything with poses in time: a :class:`Track`, a :class:`Truth`, :class:`States`."""

    @property
    def t_ns(self) -> Times:
        """(n,) [ns]."""

    @property
    def position(self) -> Array:
        """(n, 3) p_wb [m]."""

    @property
    def q_wb(self) -> Array:
        """(n, 4) unit quaternions (w, x, y, z)."""


def judge_readings(
    readings: Readings, policy: FindingPolicy, gravity: float = STANDARD_GRAVITY
) -> Readings:
    """Return readings after the job's policy: faults are refused, corrected or reported.

    Corrected readings have the order and the times of the clock behind their stamps.

    :param gravity: size of gravity at the place of the recording [m/s^2].
    :raises InputError: with a line for each finding that the job refuses.
    """
    measures = ReadingMeasures(readings, gravity=gravity)
    findings = reading_findings(readings, measures)
    policy.judge(findings, warn)
    clock = measures.clock
    if clock is None and len(readings) > 1 and policy.corrects:
        raise InputError(f"{readings.source}: {measures.no_clock}")
    if clock is None or not any(finding.kind in policy.corrects for finding in findings):
        return readings
    return replace_fields(readings.rows(clock.rows), t_ns=clock.times_ns())


@suggest_keywords
def read_imu(
    path: str | Path, topic: str | None = None, *, skip_bad_rows: bool = False
) -> Readings:
    """Return the IMU readings of a bag of any format, a EuRoC folder or a CSV file.

    :param path: the file or folder.
    :param topic: topic of type sensor_msgs/Imu; needed if a bag has several.
    :param skip_bad_rows: leave out bad rows and messages, and warn of their number.
    :returns: the :class:`Readings` in the order of the file.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a file that cannot be read, or has no readings.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(trajectory="circle", duration=2, rate=100)
    >>> _ = flight.save(folder / "circle.mcap")
    >>> ims.read_imu(folder / "circle.mcap")
    <Readings circle.mcap: 200 at 100 Hz, 1.99 s>
    """
    return read_readings(path, topic, skip_bad_rows=skip_bad_rows)


@suggest_keywords
def read_readings(
    path: str | Path,
    topic: str | None = None,
    *,
    frame: str | None = None,
    gyro_topic: str | None = None,
    accel_topic: str | None = None,
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    skip_bad_rows: bool = False,
) -> Readings:
    """Return the readings of an IMU from a bag of any format, a table with any header, or a folder.

    :param path: the file or folder.
    :param topic: topic of type sensor_msgs/Imu; needed if a bag has several.
    :param frame: frame of the readings, if a topic carries several IMUs.
    :param gyro_topic: topic of the gyroscope, if the accelerometer has another one.
    :param accel_topic: topic of the accelerometer, interpolated to the gyroscope's times.
    :param gyro_unit: unit of the gyroscope in the file: rad/s, deg/s.
    :param accel_unit: unit of the accelerometer in the file: m/s^2, g, mg.
    :param skip_bad_rows: leave out bad rows and messages, and warn of their number.
    :returns: the :class:`Readings` in SI units, in the order of the file. A triad that the file
        lacks, or marks as absent (a covariance of -1), is None.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a file that cannot be read, or has no readings.

    >>> import imu_sim_ros as ims
    >>> _ = ims.simulate(trajectory="circle", duration=2, rate=100).save(folder / "flown.mcap")
    >>> ims.read_readings(folder / "flown.mcap", frame="imu_link")
    <Readings flown.mcap: 200 at 100 Hz, 1.99 s>
    """
    from imu_sim_ros.formats import door  # readers of bags, which flights do not need

    path = arguments.path("path", path, BAG_OR_FILE)
    skipped = tell_skipped(path) if arguments.boolean("skip_bad_rows", skip_bad_rows) else None
    units = gyro_unit, accel_unit
    choice = check_choice(topic, frame, gyro_topic, accel_topic, *units, of_a_file=True)
    return replace_fields(door.read_readings(path, choice, skipped), source=name_of(path))


@suggest_keywords
def read_states(path: str | Path, topic: str | None = None) -> States:
    """Return poses, with velocities and covariances where the file has them.

    :param path: a bag, a table of poses with any header, TUM's text, or a EuRoC folder.
    :param topic: topic of a bag: Odometry, PoseStamped, PoseWithCovarianceStamped,
        TransformStamped, Path, or ``/tf:PARENT.CHILD``; needed if a bag has several.
    :returns: the :class:`States`; velocities are in the world frame, and None if the file has none.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a file that cannot be read, or has no poses.

    >>> import imu_sim_ros as ims
    >>> _ = ims.simulate(trajectory="circle", duration=2, rate=100).save(folder / "states.bag")
    >>> ims.read_states(folder / "states.bag")
    <States states.bag: 200 at 100 Hz, 1.99 s>
    """
    from imu_sim_ros.formats import door  # readers of bags, which flights do not need

    path = arguments.path("path", path, BAG_OR_FILE)
    states = door.read_states(path, arguments.topic("topic", topic), covariance=True)
    return replace_fields(states, source=name_of(path))


@suggest_keywords
def read_odometry(path: str | Path, topic: str | None = None) -> States:
    """Return poses of a file, as :func:`read_states` does.

    :param path: as for :func:`read_states`.
    :param topic: as for :func:`read_states`.
    :returns: the :class:`States`.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a file that cannot be read, or has no poses.

    >>> import imu_sim_ros as ims
    >>> _ = ims.simulate(trajectory="circle", duration=2, rate=100).save(folder / "odometry.bag")
    >>> ims.read_odometry(folder / "odometry.bag", "ground_truth/odom")
    <States odometry.bag: 200 at 100 Hz, 1.99 s>
    """
    return read_states(path, topic)


def check_poses(name: str, poses: HasPoses) -> States:
    """Return poses in the order of time; other objects than States are checked.

    :param name: name of the argument.
    :raises ConfigurationError: for arrays of another type or shape.
    :raises InputError: for no poses; for those that :class:`States` or :func:`sort_poses` refuse.
    """
    return sort_poses(poses_in_any_order(name, poses))


def poses_in_any_order(name: str, poses: HasPoses) -> States:
    """Return poses as they are given; arguments and errors as for :func:`check_poses`."""
    if not all(hasattr(poses, attribute) for attribute in ("t_ns", "position", "q_wb")):
        refuse(name, poses, "a Track, an Odometry or another object with poses", True)
    if isinstance(poses, States):
        states = poses
    else:
        states = States(poses.t_ns, poses.position, poses.q_wb, source=name)
    if not len(states):
        raise InputError(f"{name}: contains no poses")
    gate.poses(states.t_ns, states.position, states.q_wb).complain(name)  # computed ones too
    return states


_ROUNDED: Final = 1e-3
"""Largest change of a quaternion's length by rounding to three decimals or more."""


def poses_of_rows(trajectory: Array) -> States:
    """Return poses that are rows of an array.

    :param trajectory: (n, 8) time [s], position [m], quaternion (w, x, y, z); or (n, 7) time [s],
        position [m], roll, pitch, yaw [rad].
    :raises ConfigurationError: for another shape.
    :raises InputError: for quaternions that are not rounded ones of length 1, and impossible poses.
    """
    if trajectory.ndim != 2 or trajectory.shape[1] not in (7, 8):
        columns = "time [s], x, y, z [m], then the quaternion w, x, y, z or roll, pitch, yaw [rad]"
        refuse(
            "trajectory",
            trajectory,
            f"an array (n, 8) or (n, 7): {columns}; not {trajectory.shape}",
        )
    rows = array("trajectory", trajectory, (None, trajectory.shape[1]))
    t_ns = np.round(rows[:, 0] * 1e9)
    if (np.abs(t_ns) > gate.LAST_STAMP).any():
        refuse("trajectory", trajectory, "an array with times in seconds in its first column")
    if trajectory.shape[1] == 7:
        q_wb = from_euler(rows[:, 4:])
    else:
        q_wb = rows[:, 4:]
        lengths = np.linalg.norm(q_wb, axis=1)
        for row in np.flatnonzero(np.abs(lengths - 1.0) > _ROUNDED)[:1]:
            raise InputError(
                f"trajectory: row {row}: a quaternion of length {lengths[row]:.4g}: must be 1, "
                f"or rounded within {_ROUNDED:g}"
            )
    return sort_poses(States(t_ns.astype(np.int64), rows[:, 1:4], q_wb, source="trajectory"))


def check_sensors(names: Collection[str], parameters: Mapping[str, object]) -> frozenset[str]:
    """Return the names of sensors: quantities of IMUs, and sensors with names of their own.

    :param parameters: all other parameters by dotted name; ``NAME.type`` is a kind of sensor.
    :raises ConfigurationError: with a line for each that does not exist.
    """
    chosen = string_list("sensors", names)
    quantities = [sensor.quantity for sensor in sensors_of_imus()]
    unknown: list[str] = []
    for name in dict.fromkeys(chosen):
        if name not in quantities:
            try:
                find_sensor(kind_of(name, parameters))
            except ConfigurationError as error:
                known_names = [
                    *quantities,
                    *switchable_sensors(),
                    *(sensor.name for sensor in registered_sensors()),
                ]
                # The sensor of another package that cannot be loaded has its own reason.
                is_broken = "loaded" in str(error)
                line = f"sensors: {name!r}: {suggestion(name, known_names)}"
                unknown += error.problems if is_broken else [line]
    if unknown:
        raise ConfigurationError(unknown)
    return frozenset(chosen)


def check_simulated(windows: Sequence[Mapping[str, Samples]], name: str) -> None:
    """Refuse a sensor on the body that has no samples.

    :raises ConfigurationError: with what to give.
    """
    if any(name not in window for window in windows):
        raise ConfigurationError(
            f"{name}: was not simulated; simulate(..., sensors=[{name!r}]) does"
        )


def delivered_samples(
    windows: Sequence[Mapping[str, Samples]],
    name: str,
    readings: type[ReadingsT],
) -> ReadingsT:
    """Return the delivered samples of a sensor from all windows.

    :param name: name of the sensor on the body.
    :param readings: class of the sensor's arrays in a flight, or its record.
    :raises ConfigurationError: if it was not simulated.
    """
    check_simulated(windows, name)
    parts = [window[name] for window in windows]
    names = [field.name for field in fields(readings)]
    if issubclass(readings, TimeSeries):
        names = [name for name in names if name in ("t_ns", "true_t_ns", *parts[0].values)]
    columns = {
        name: np.concatenate([getattr(part, name)[part.delivered] for part in parts])
        for name in names
    }
    if issubclass(readings, TimeSeries):
        return readings.unchecked(source=name, **columns)
    return readings(**columns)
