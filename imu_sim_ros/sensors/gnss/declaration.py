# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The GNSS receiver as the rest of the package sees it: topics, table, readings."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from imu_sim_ros.inputs.gate import OTHER
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.sensors.declaration import (
    Companions,
    Sensor,
    SensorReadings,
    Serial,
    Switch,
    on_demand,
    topic,
)
from imu_sim_ros.sensors.gnss.parameters import GnssParameters
from imu_sim_ros.sensors.gnss.satellites import calendar_ns
from imu_sim_ros.sensors.samples import Rows, Samples
from imu_sim_ros.types import Array, Integers, Times

FIX: Final = ("sensor_msgs/msg/NavSatFix", "NavSatFixEncoder")
TWIST: Final = ("geometry_msgs/msg/TwistWithCovarianceStamped", "TwistWithCovarianceEncoder")
VECTOR: Final = ("geometry_msgs/msg/Vector3Stamped", "Vector3StampedEncoder")
GPS_FIX: Final = ("gps_msgs/msg/GPSFix", "GpsFixEncoder")
TOPIC: Final = "gps/fix"
_NAMES: Final = (
    "latitude,longitude,altitude,variance_e,variance_n,variance_u,velocity_e,velocity_n,velocity_u,"
    "status"
)
_UNITS: Final = (
    "latitude [deg],longitude [deg],altitude [m],variance_e [m^2],variance_n [m^2],"
    "variance_u [m^2],velocity_e [m s^-1],velocity_n [m s^-1],velocity_u [m s^-1],status []"
)


_sentences: Final = on_demand("imu_sim_ros.sensors.gnss.nmea", "sentences")
_rinex: Final = on_demand("imu_sim_ros.sensors.gnss.rinex_files", "RinexFiles")


@dataclass(frozen=True, repr=False)
class GnssReadings(SensorReadings):
    """The n fixes of a receiver that are delivered, and the truth of each.

    Without a fix the position is the last known one, NaN before the first; variances and velocity
    are NaN.
    """

    geodetic: Array
    """(n, 3) latitude [deg], longitude [deg], height above the ellipsoid [m] as read."""
    position: Array
    """(n, 3) the same in the world [m]."""
    variance: Array
    """(n, 3) stated, of the error east, north, up [m^2]."""
    velocity: Array
    """(n, 3) of the antenna, east, north, up, as read [m/s]."""
    velocity_variance: Array
    """(n, 3) stated [m^2/s^2]."""
    status: Integers
    """(n,) as NavSatStatus has it: -1 no fix, 0 fix, 1 with corrections, 2 RTK."""
    mode: Integers
    """(n,) 0 single, 1 dgps, 2 float, 3 fixed, -1 no fix."""
    satellites: Integers
    """(n,) in use."""
    used: Integers
    """(n,) bit ``prn - 1`` is set for each of them; 0 if `gnss.sky` is constant."""
    hdop: Array
    """(n,) dilution of precision, horizontal; 99.99 without a fix."""
    vdop: Array
    """(n,) vertical."""
    pdop: Array
    """(n,) of both."""
    dilution: Array
    """(n, 4) of east, north, up and clock; the clock's is 0 if it is not known."""
    tag_ns: Times
    """(n,) GPS time that the receiver's clock shows at the raw measurements, since 6 January 1980
    [ns]; these, here and below, are there with `gnss.raw.rinex`, for PRN 1 to 32."""
    pseudorange: Array
    """(n, 32, f) on each frequency; NaN: not in view [m]."""
    carrier_phase: Array
    """(n, 32, f) [cycles]."""
    doppler: Array
    """(n, 32, f) [Hz]."""
    lock: Integers
    """(n, 32) how often a satellite was found so far, each time with other ambiguities; 0: not in
    view."""
    elevation: Array
    """(n, 32) [rad]."""
    ideal_range: Array
    """(n, 32) true distance [m]."""
    satellite_clock: Array
    """(n, 32) satellite's clock minus GPS time [s]."""
    receiver_clock: Array
    """(n,) [s]."""
    ionosphere: Array
    """(n, 32) delay on L1 [m]."""
    troposphere: Array
    """(n, 32) delay [m]."""
    ideal_geodetic: Array
    """(n, 3) of the antenna, without error."""
    ideal_position: Array
    """(n, 3) [m]."""
    ideal_velocity: Array
    """(n, 3) [m/s]."""
    error: Array
    """(n, 3) of the position that a fix has: as read minus true, east, north, up; it continues
    without a fix [m]."""

    def nmea(self) -> str:
        """Return sentences GGA, GSA, RMC and VTG of every fix, as receivers write them."""
        return "".join(_sentences(self, slice(None)))

    def save_nmea(self, path: str | Path) -> Path:
        """Write a file of NMEA sentences; returns its path."""
        path = Path(path)
        path.write_bytes(self.nmea().encode("ascii"))
        return path


def _fix(read: Samples, rows: Rows, _: object) -> tuple[Array, ...]:
    geodetic, status = read.geodetic[rows], read.status[rows]
    variance = np.where(status[:, None] < 0, 0.0, read.variance[rows])  # 0: unknown, in ROS
    return (*geodetic.T, status, variance)


_EXTENDED_STATUS: Final = np.array([0, 18, 20, 19, -1])
"""Status of gps_msgs/GPSStatus for each mode, and for no fix."""
# 95 % of a Gaussian error lie within this many standard deviations, in one, two and three
# dimensions: roots of the quantiles of chi square.
_WITHIN: Final = (1.960, 2.448, 2.796)


def _extended(read: Samples, rows: Rows, _: object) -> tuple[Any, ...]:
    """Return what gps_msgs/GPSFix holds; errors are those that contain 95 %, NaN without a fix."""
    latitude, longitude, altitude, status, stated = _fix(read, rows, _)
    variance = read.variance[rows]
    east, north, up = read.velocity[rows].T
    axes = read.dilution[rows]
    known = (status >= 0) & (axes[:, 3] > 0.0)
    numbers = {
        "latitude": latitude,
        "longitude": longitude,
        "altitude": altitude,
        "track": np.degrees(np.arctan2(east, north)) % 360.0,
        "speed": np.hypot(east, north),
        "climb": up,
        "time": calendar_ns(read.t_ns[rows]) * 1e-9,
        "gdop": np.where(known, np.linalg.norm(axes, axis=1), 0.0),
        "tdop": np.where(known, axes[:, 3], 0.0),
        **{name: getattr(read, name)[rows] for name in ("pdop", "hdop", "vdop")},
        "err": _WITHIN[2] * np.sqrt(variance.mean(axis=1)),
        "err_horz": _WITHIN[1] * np.sqrt(variance[:, :2].mean(axis=1)),
        "err_vert": _WITHIN[0] * np.sqrt(variance[:, 2]),
        "err_speed": _WITHIN[0] * np.sqrt(read.velocity_variance[rows, 0]),
        "err_climb": _WITHIN[0] * np.sqrt(read.velocity_variance[rows, 2]),
    }
    return _EXTENDED_STATUS[read.mode[rows]], read.satellites[rows], numbers, stated


SENSOR = Sensor(
    name="gnss",
    quantity="gnss",
    section=GnssParameters,
    model=on_demand("imu_sim_ros.sensors.gnss.model", "Receiver"),
    topics=(
        topic(TOPIC, *FIX, _fix),
        topic(
            *("gps/velocity", *TWIST),
            lambda read, rows, _: (read.velocity[rows], read.velocity_variance[rows]),
            in_world=True,
            sent=lambda read: read.mode >= 0,
        ),
        topic("gps/extended_fix", *GPS_FIX, _extended, foreign=True),
        topic(
            *("ground_truth/gps_fix", *FIX),
            lambda read, rows, _: tuple(read.ideal_geodetic[rows].T),
            truth=True,
        ),
        topic(
            *("ground_truth/gps_velocity", *TWIST),
            lambda read, rows, _: (read.ideal_velocity[rows], np.zeros(3)),
            truth=True,
            in_world=True,
        ),
        topic(
            *("ground_truth/gps_error", *VECTOR),
            lambda read, rows, _: (read.error[rows],),
            truth=True,
            in_world=True,
        ),
    ),
    table=Table(
        name="gps",
        title="GNSS receiver",
        quantity=OTHER,
        headers={"euroc": f"#timestamp [ns],{_UNITS}", "csv": f"timestamp,{_NAMES}"},
        type=FIX[0],
        topic=TOPIC,
    ),
    values=lambda read: np.column_stack([read.geodetic, read.variance, read.velocity, read.status]),
    readings=GnssReadings,
    text="GNSS receiver with fixes and velocities of an antenna, with outages and modes",
    serial=Serial(lambda own: str(own.nmea), _sentences),
    companions=Companions(
        lambda own: (".obs", ".nav") if own.raw.rinex else (),
        _rinex,
        Switch(
            "rinex",
            "raw.rinex",
            "write raw GNSS measurements as RINEX next to the output: NAME.obs, NAME.nav",
        ),
    ),
    presets="gnss",
    warnings=on_demand("imu_sim_ros.sensors.gnss.model", "nowhere"),
)
