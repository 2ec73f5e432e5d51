# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated flight: readings, and their truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from imu_sim_ros.core import arguments
from imu_sim_ros.core.arguments import BAG_OR_FILE, name_of
from imu_sim_ros.core.bad_rows import tell_skipped
from imu_sim_ros.core.conventions import ERROR_TOPICS
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings, States, data_frame, replace_fields
from imu_sim_ros.core.timebase import describe_span, seconds_since
from imu_sim_ros.core.types import Array, Integers, field_values
from imu_sim_ros.jobs.readings import check_simulated, delivered_samples
from imu_sim_ros.jobs.selection import NOTHING, Selection, check_choice
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.sensors.imu.declaration import NAME as IMU
from imu_sim_ros.sensors.parameters import MountedParameters
from imu_sim_ros.sensors.samples import Samples, join_samples
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import SampledParameters
from imu_sim_ros.simulation.sensors import mount_sensors
from imu_sim_ros.terminal.text_tables import TextTable, html_of
from imu_sim_ros.trajectory.motion import Trajectory

if TYPE_CHECKING:
    from imu_sim_ros.plots.style import Figure
    from imu_sim_ros.sensors.declaration import Mounted


@dataclass(frozen=True, repr=False, kw_only=True)
class Truth(States):
    """The true motion and the true errors at the n times at which the sensor took its samples.

    For given ideal readings, the unknown parts of the motion are NaN. A reading is the digital
    output (rounding and saturation) of the sum ``gyro + gyro_response_error + gyro_bias +
    gyro_noise + gyro_low_pass + gyro_vibration``, and likewise for the accelerometer.
    """

    role = "truth"

    acceleration: Array
    """(n, 3) acceleration of the body in the world, without gravity [m/s^2]."""
    gyro: Array
    """(n, 3) readings of a perfect gyroscope where it is mounted [rad/s]."""
    accel: Array
    """(n, 3) readings of a perfect accelerometer where it is mounted [m/s^2]."""
    gyro_bias: Array
    """(n, 3) sum of all biases of the gyroscope [rad/s]."""
    accel_bias: Array
    """(n, 3) sum of all biases of the accelerometer [m/s^2]."""
    gyro_scale: Array
    """(n, 3) scale factor of the gyroscope from turn-on, temperature and age; 1 without error."""
    accel_scale: Array
    """(n, 3) scale factor of the accelerometer, likewise."""
    gyro_noise: Array
    """(n, 3) white noise of the gyroscope, before its low-pass [rad/s]."""
    accel_noise: Array
    """(n, 3) white noise of the accelerometer, before its low-pass [m/s^2]."""
    gyro_response_error: Array
    """(n, 3) what scale factors, misalignment, non-linearity and g-sensitivity of the gyroscope add
    to the ideal reading [rad/s]."""
    accel_response_error: Array
    """(n, 3) what scale factors, misalignment and non-linearity of the accelerometer add [m/s^2].
    """
    gyro_low_pass: Array
    """(n, 3) what the low-pass of the gyroscope adds: its output minus its input [rad/s]."""
    accel_low_pass: Array
    """(n, 3) what the low-pass of the accelerometer adds [m/s^2]."""
    gyro_vibration: Array
    """(n, 3) vibration of the vehicle in the gyroscope, ``imu.vibration`` [rad/s]."""
    accel_vibration: Array
    """(n, 3) vibration of the vehicle in the accelerometer [m/s^2]."""

    def __repr__(self) -> str:
        return f"<Truth: {describe_span(self.t_ns)}>"

    def _frame_columns(self) -> dict[str, Array]:
        """Return motion, ideal readings and every true error by name."""
        return super()._frame_columns() | {
            name: values
            for name, values in field_values(self).items()
            if name not in States.__dataclass_fields__
        }


def readings_of(
    name: str,
    source: object,
    topic: str | None = None,
    topic_name: str = "topic",
    skip_bad_rows: bool = False,
    selection: Selection = NOTHING,
) -> Readings:
    """Check given readings and return them.

    :param name: name of the argument.
    :param topic: topic of a bag.
    :param topic_name: name of the argument that is the topic.
    :param skip_bad_rows: leave out bad rows of a file, and warn of their number.
    :param selection: frame, topics and units of the readings in a file.
    :raises ConfigurationError: for anything else.
    :raises InputError: for what cannot be read, no readings, and what no sensor reads.
    """
    if not isinstance(source, Flight | Readings):
        if isinstance(source, str | PathLike):
            from imu_sim_ros.formats import door  # readers of bags, which flights do not need

            path = arguments.path(name, source, BAG_OR_FILE)
            choice = check_choice(topic, *selection, of_a_file=True, topic_name=topic_name)
            skipped = tell_skipped(path) if skip_bad_rows else None
            return replace_fields(door.read_readings(path, choice, skipped), source=name_of(path))
        arguments.refuse(name, source, f"a Flight, Readings, or {BAG_OR_FILE}", wrong_type=True)
    check_choice(topic, *selection, of_a_file=False, topic_name=topic_name)
    readings = source.readings if isinstance(source, Flight) else source
    if not len(readings):
        raise InputError(f"{name}: contains no readings")
    return readings


class Source(NamedTuple):
    """Parameters and motion from which a flight was simulated."""

    parameters: SampledParameters
    trajectory: Trajectory
    t0_ns: int
    """Time of the first sample [ns]."""


class Flight:
    """Result of :func:`imu_sim_ros.simulate`: the delivered readings and the truth.

    Readings that the transport loses are missing, and those it duplicates occur twice, as in a bag.
    """

    def __init__(
        self,
        source: Body | Source,
        windows: Sequence[Mapping[str, Samples]],
        name: str,
        topics: tuple[str, ...] = (),
    ) -> None:
        """Hold the samples of a run.

        :param windows: the samples of each sensor by name, window by window.
        :param topics: topics that :meth:`save` writes by default; empty: the readings and the pose.
        """
        self.parameters: SampledParameters = source.parameters
        """All parameters of the simulation, a frozen dataclass."""
        self.trajectory: Trajectory = source.trajectory
        """The exact motion, at any time: ``trajectory.sample(t)`` at times t (n,) [s] from
        ``t0_ns`` on; NaN for given ideal readings, whose motion is unknown."""
        self.t0_ns: int = source.t0_ns
        """True time of sample 0 [ns]."""
        self.name = name
        """Sensor and motion in words."""
        self._windows, self._topics = windows, topics
        self._blocks = [window[IMU] for window in windows]

    def _join(self, name: str) -> Array:
        """Return an array of all blocks, of delivered samples."""
        return np.concatenate([block.values[name][block.delivered] for block in self._blocks])

    @cached_property
    def t_ns(self) -> Integers:
        """(n,) stamps of the readings [ns], with the errors of the sensor's clock."""
        return np.concatenate([block.t_ns[block.delivered] for block in self._blocks])

    @property
    def t(self) -> Array:
        """(n,) times after the first stamp [s]."""
        return seconds_since(self.t_ns, int(self.t_ns[0]) if len(self.t_ns) else 0)

    @cached_property
    def gyro(self) -> Array:
        """(n, 3) angular rates as read [rad/s], in the IMU's frame."""
        return self._join("gyro")

    @cached_property
    def accel(self) -> Array:
        """(n, 3) specific forces as read [m/s^2], in the IMU's frame."""
        return self._join("accel")

    @cached_property
    def temperature(self) -> Array:
        """(n,) temperature of the sensor [degC]."""
        return self._join("temperature")

    def __getattr__(self, name: str) -> Any:
        """Return the readings of another sensor, at its own rate and stamps.

        ``magnetic_field`` is a :class:`MagneticReadings`, ``orientation`` are
        :class:`Orientations`, ``pressure`` is a :class:`PressureReadings`; a sensor of one's own
        has its own name.

        :raises ConfigurationError: for one that was not simulated.
        """
        if not name.startswith("_"):
            mount = self._sensors.get(name)
            if mount is not None and mount.sensor.readings is not None:
                readings = delivered_samples(self._windows, name, mount.sensor.readings)
                self.__dict__[name] = readings
                return readings
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        """Return all names, those of the other sensors too."""
        return sorted({*super().__dir__(), *self._sensors})

    @property
    def _sensors(self) -> dict[str, Mounted[MountedParameters]]:
        """Sensors whose readings a flight keeps; images and clouds take too much room."""
        sensors = mount_sensors(self.parameters)
        return {name: mount for name, mount in sensors.items() if mount.sensor.readings is not None}

    @cached_property
    def truth(self) -> Truth:
        """The truth at all samples, lost ones too."""

        samples = join_samples(self._blocks)
        motion = samples.motion
        return Truth.unchecked(
            t_ns=samples.true_t_ns,
            position=motion.position,
            q_wb=motion.q_wb,
            velocity=motion.velocity,
            angular_velocity=motion.angular_velocity,
            source=self.name,
            acceleration=motion.acceleration,
            gyro=samples.ideal_gyro,
            accel=samples.ideal_accel,
            **{name: samples.values[name] for name in ERROR_TOPICS.values()},
        )

    @property
    def readings(self) -> Readings:
        """The readings alone."""
        return Readings(self.t_ns, self.gyro, self.accel, self.name, temperature=self.temperature)

    def __len__(self) -> int:
        return len(self.t_ns)

    def __repr__(self) -> str:
        return f"<Flight {self.name}: {describe_span(self.t_ns)}, seed {self.parameters.seed}>"

    def _repr_html_(self) -> str:
        """Return the flight as a table, for notebooks."""
        rows = [
            ["readings", describe_span(self.t_ns)],
            ["seed", str(self.parameters.seed)],
            *(
                [name, describe_span(getattr(self, name).t_ns)]
                for name in self._sensors
                if name != IMU and name in self._windows[0]
            ),
        ]
        return html_of([TextTable(["flight", self.name], rows)])

    def to_frame(self) -> Any:
        """Return the readings as a pandas DataFrame: index t_ns, columns gyro_x ... accel_z.

        :raises MissingDependencyError: without pandas.
        """
        return data_frame(self.t_ns, {"gyro": self.gyro, "accel": self.accel})

    def plot(self) -> Figure:
        """Return a matplotlib figure of the readings over time."""
        from imu_sim_ros.plots import readings as pictures

        return pictures.readings(self.t_ns, self.gyro, self.accel, self.name)

    def save(
        self,
        path: str | Path,
        *,
        format: str | None = None,
        topics: Sequence[str] = (),
        imu_only: bool = False,
        rename: Mapping[str, str] | None = None,
        force: bool = False,
    ) -> Path:
        """Write a bag or a dataset, the same as ``generate`` writes; returns its path.

        :param path: ``NAME.bag`` is a ROS 1 bag, ``NAME.mcap`` one MCAP file, ``NAME.csv`` a table,
            anything else a rosbag2 folder. Parent folders are created.
        :param format: ``euroc`` or ``csv`` for a dataset.
        :param topics: by default the readings and ``ground_truth/odom``, and the topics of the
            sensors of the body.
        :param imu_only: leave out the truth.
        :param rename: new names for topics, ``{"imu/data_raw": "/imu0"}``.
        :param force: replace what exists, but never the file of the trajectory.
        :raises InputError: for a path that cannot be used or exists, and for an unknown topic.

        >>> import imu_sim_ros as ims
        >>> flight = ims.simulate(trajectory="figure_eight", duration=1)
        >>> flight.save(folder / "flight.bag", rename={"imu/data_raw": "/imu0"}).name
        'flight.bag'
        """
        from imu_sim_ros.datasets.forms import open_output, topics_to_write
        from imu_sim_ros.jobs.writing import new_topic_names, save_output
        from imu_sim_ros.simulation.topics import sensor_topics

        topic_names = arguments.string_list("topics", topics) or self._topics
        arguments.boolean("imu_only", imu_only)
        if format is not None:
            arguments.choice("format", format, ("csv", "euroc"))
        renamed, sensors = new_topic_names(rename), self._sensors
        with save_output(path, force, flatten(self.parameters).values()) as staged:
            form = format or ("csv" if staged.suffix == ".csv" else None)
            names = topics_to_write(sensors, form, staged, topic_names, renamed, imu_only)
            offers = sensor_topics(sensors)
            for sensor in {offers[name].name for name in names}:
                check_simulated(self._windows, sensor)
            with open_output(form, staged, names, sensors) as target:
                for window in self._windows:
                    target.write(window)
        return Path(path)
