# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings and odometry as arrays, from a file or from simulated sensors."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import arguments
from imu_sim_ros.arguments import BAG_OR_FILE, array, name_of, refuse, stamps, words
from imu_sim_ros.errors import ConfigurationError, InputError, MissingDependencyError
from imu_sim_ros.inputs import gate
from imu_sim_ros.inputs.rows import tell_skipped
from imu_sim_ros.names import suggestion
from imu_sim_ros.poses import PoseSequence
from imu_sim_ros.rotation import from_euler, rotate
from imu_sim_ros.sensors import find_sensor, kind_of, named_sensors, registered, sensors_of_imus
from imu_sim_ros.timebase import span
from imu_sim_ros.types import Array, Times

if TYPE_CHECKING:
    from imu_sim_ros.bags.read import OdometryMessages
    from imu_sim_ros.plots.style import Figure
    from imu_sim_ros.sensors.declaration import SensorReadings


class HasPoses(Protocol):
    """Anything with poses in time: a :class:`Track`, a :class:`Truth`, an :class:`Odometry`."""

    @property
    def t_ns(self) -> Times:
        """(n,) [ns]."""

    @property
    def position(self) -> Array:
        """(n, 3) p_wb [m]."""

    @property
    def q_wb(self) -> Array:
        """(n, 4) unit quaternions (w, x, y, z)."""


@dataclass(frozen=True, repr=False)
class Readings:
    """n readings of an IMU, in the order in which they were delivered."""

    t_ns: Times
    """(n,) stamps [ns]."""
    gyro: Array
    """(n, 3) angular rates [rad/s], in the IMU's frame."""
    accel: Array
    """(n, 3) specific forces [m/s^2], in the IMU's frame: +9.81 on z when level and at rest."""
    name: str = "readings"

    def __post_init__(self) -> None:
        """Check the arrays; lists become arrays.

        :raises ConfigurationError: for another type or shape.
        :raises InputError: for a reading that no sensor gives.
        """
        check_arrays(self, ("gyro", "accel"))
        gate.readings(self.t_ns, self.gyro, self.accel).complain(self.name)

    def __len__(self) -> int:
        return len(self.t_ns)

    def __repr__(self) -> str:
        return f"<Readings {self.name}: {span(self.t_ns)}>"

    def to_frame(self) -> Any:
        """Return a pandas DataFrame: index t_ns, columns gyro_x ... accel_z.

        :raises MissingDependencyError: without pandas.
        """
        return frame(self.t_ns, {"gyro": self.gyro, "accel": self.accel})

    def plot(self) -> Figure:
        """Return a matplotlib figure of the readings over time."""
        from imu_sim_ros.plots import readings as pictures

        return pictures.readings(self.t_ns, self.gyro, self.accel, self.name)


@dataclass(frozen=True, repr=False)
class Odometry:
    """n poses with velocities, in the world frame."""

    t_ns: Times
    """(n,) stamps [ns]."""
    position: Array
    """(n, 3) p_wb [m]."""
    q_wb: Array
    """(n, 4) unit quaternions (w, x, y, z)."""
    velocity: Array
    """(n, 3) of the body in the world [m/s]."""
    angular_velocity: Array
    """(n, 3) of the body, in the body frame [rad/s]."""
    name: str = "odometry"

    def __post_init__(self) -> None:
        """Check the arrays; lists become arrays.

        :raises ConfigurationError: for another type or shape.
        :raises InputError: for a pose or a velocity that is not possible.
        """
        names = ("position", "q_wb", "velocity", "angular_velocity")
        check_arrays(self, names)
        quantities = (gate.POSITION, gate.ORIENTATION, gate.VELOCITY, gate.RATE)
        columns = [
            (what, getattr(self, each)) for what, each in zip(quantities, names, strict=True)
        ]
        gate.Verdict(self.t_ns, columns).complain(self.name)

    @classmethod
    def of_messages(cls, found: OdometryMessages, name: str) -> Odometry:
        """Return the odometry of messages, whose velocities are in the body."""
        velocity = rotate(found.q_wb, found.velocity_b)
        poses = (found.t_ns, found.position, found.q_wb)
        return cls(*poses, velocity, found.angular_velocity_b, name)

    def __len__(self) -> int:
        return len(self.t_ns)

    def __repr__(self) -> str:
        return f"<Odometry {self.name}: {span(self.t_ns)}>"

    def to_frame(self) -> Any:
        """Return a pandas DataFrame: index t_ns, columns position_x, q_w, velocity_x, ...

        :raises MissingDependencyError: without pandas.
        """
        return frame(
            self.t_ns,
            {
                "position": self.position,
                "q": self.q_wb,
                "velocity": self.velocity,
                "angular_velocity": self.angular_velocity,
            },
        )


def read_imu(
    path: str | Path, topic: str | None = None, *, skip_bad_rows: bool = False
) -> Readings:
    """Return the IMU readings of a bag of any form, a EuRoC folder or a CSV file.

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
    from imu_sim_ros.bags.read import read_imu as read

    path = arguments.path("path", path, BAG_OR_FILE)
    skipped = tell_skipped(path) if arguments.switch("skip_bad_rows", skip_bad_rows) else None
    messages = read(path, arguments.topic("topic", topic), skipped)
    return Readings(messages.t_ns, messages.gyro, messages.accel, name_of(path))


def read_odometry(path: str | Path, topic: str | None = None) -> Odometry:
    """Return the odometry of a bag, with velocities in the world frame.

    :param path: the file or folder.
    :param topic: topic of type nav_msgs/Odometry, for instance ``ground_truth/odom``; needed if a
        bag has several.
    :returns: the :class:`Odometry`.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for a file that cannot be read, or has no odometry.

    >>> import imu_sim_ros as ims
    >>> _ = ims.simulate(trajectory="circle", duration=2, rate=100).save(folder / "odometry.bag")
    >>> ims.read_odometry(folder / "odometry.bag", "ground_truth/odom")
    <Odometry odometry.bag: 200 at 100 Hz, 1.99 s>
    """
    from imu_sim_ros.bags.read import read_odometry as read

    path = arguments.path("path", path, BAG_OR_FILE)
    topic = arguments.topic("topic", topic)
    found = read(path, topic if topic is None else "/" + topic.lstrip("/"))
    return Odometry.of_messages(found, name_of(path))


def check_arrays(rows: Any, names: Sequence[str]) -> None:
    """Check the arrays of a frozen dataclass: a name, ``t_ns`` (n,), and others (n, 3) or (n, 4).

    The gate finds values that are not finite, and names their places.

    :raises ConfigurationError: for another type or shape.
    """
    arguments.text("name", rows.name, "a name")
    found: dict[str, NDArray[Any]] = {"t_ns": stamps("t_ns", rows.t_ns)}
    for name in names:
        columns = 4 if name == "q_wb" else 3
        found[name] = array(name, getattr(rows, name), (len(found["t_ns"]), columns), False)
    for name, values in found.items():
        object.__setattr__(rows, name, values)  # frozen


def checked_poses(name: str, given: HasPoses) -> PoseSequence:
    """Return given poses; those of a PoseSequence were checked when it was made.

    :param name: of the argument.
    :raises ConfigurationError: for arrays of another type or shape.
    :raises InputError: as :class:`PoseSequence` does, and if there are none.
    """
    if not all(hasattr(given, each) for each in ("t_ns", "position", "q_wb")):
        refuse(name, given, "a Track, an Odometry or another object with poses", True)
    if not isinstance(given, PoseSequence):
        given = PoseSequence(given.t_ns, given.position, given.q_wb, name=name)
    if not len(given.t_ns):
        raise InputError(f"{name}: contains no poses")
    return given


_ROUNDED: Final = 1e-3
"""By which rounding to three decimals or more changes the length of a quaternion."""


def poses_of_rows(given: Array) -> PoseSequence:
    """Return poses that are rows of an array.

    :param given: (n, 8) time [s], position [m], quaternion (w, x, y, z); or (n, 7) time [s],
        position [m], roll, pitch, yaw [rad].
    :raises ConfigurationError: for another shape.
    :raises InputError: for quaternions that are not rounded ones of length 1, and impossible poses.
    """
    if given.ndim != 2 or given.shape[1] not in (7, 8):
        columns = "time [s], x, y, z [m], then the quaternion w, x, y, z or roll, pitch, yaw [rad]"
        refuse("trajectory", given, f"an array (n, 8) or (n, 7): {columns}; not {given.shape}")
    rows = array("trajectory", given, (None, given.shape[1]))
    t_ns = np.round(rows[:, 0] * 1e9)
    if (np.abs(t_ns) > gate.LAST_STAMP).any():
        refuse("trajectory", given, "an array with times in seconds in its first column")
    if given.shape[1] == 7:
        q_wb = from_euler(rows[:, 4:])
    else:
        q_wb = rows[:, 4:]
        lengths = np.linalg.norm(q_wb, axis=1)
        for row in np.flatnonzero(np.abs(lengths - 1.0) > _ROUNDED)[:1]:
            raise InputError(
                f"trajectory: row {row}: a quaternion of length {lengths[row]:.4g}: must be 1, "
                f"or rounded within {_ROUNDED:g}"
            )
    return PoseSequence(t_ns.astype(np.int64), rows[:, 1:4], q_wb, name="trajectory")


def frame(t_ns: Times, columns: Mapping[str, Array]) -> Any:
    """Return arrays (n, 3) and (n, 4) as a pandas DataFrame with a column for each component."""
    try:
        import pandas
    except ImportError:
        raise MissingDependencyError(
            "to_frame() needs pandas: apt install python3-pandas, or pip install pandas"
        ) from None
    data = {
        f"{name}_{component}": values[:, k]
        for name, values in columns.items()
        for k, component in enumerate("wxyz" if values.shape[1] == 4 else "xyz")
    }
    return pandas.DataFrame(data, index=pandas.Index(t_ns, name="t_ns"))


def checked_sensors(names: Collection[str], given: Mapping[str, object]) -> frozenset[str]:
    """Return the names of sensors: what those of IMUs measure, and those with names of their own.

    :param given: all other parameters by dotted name; ``NAME.type`` is a kind of sensor.
    :raises ConfigurationError: with a line for each that does not exist.
    """
    chosen = words("sensors", names)
    known = [sensor.quantity for sensor in sensors_of_imus()]
    unknown: list[str] = []
    for name in dict.fromkeys(chosen):
        if name not in known:
            try:
                find_sensor(kind_of(name, given))
            except ConfigurationError as error:
                everything = [*known, *named_sensors(), *(sensor.name for sensor in registered())]
                missing = f"sensors: {name!r}: {suggestion(name, everything)}"
                unknown += error.problems if "loaded" in str(error) else [missing]
    if unknown:
        raise ConfigurationError(unknown)
    return frozenset(chosen)


def check_simulated(windows: Sequence[Mapping[str, Any]], name: str) -> None:
    """Refuse a sensor on the body that has no samples.

    :raises ConfigurationError: with what to give.
    """
    if any(name not in read for read in windows):
        raise ConfigurationError(
            f"{name}: was not simulated; simulate(..., sensors=[{name!r}]) does"
        )


def delivered_of(
    windows: Sequence[Mapping[str, Any]], name: str, readings: type[SensorReadings] | None
) -> Any:
    """Return the delivered samples of a sensor from all windows.

    :param name: of the sensor on the body.
    :param readings: its dataclass of arrays, which a flight has of it.
    :raises ConfigurationError: if it was not simulated.
    """
    check_simulated(windows, name)
    parts = [read[name] for read in windows]
    assert readings is not None
    return readings(
        **{
            field.name: np.concatenate([getattr(p, field.name)[p.delivered] for p in parts])
            for field in fields(readings)
        }
    )
