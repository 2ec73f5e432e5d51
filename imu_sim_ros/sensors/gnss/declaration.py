# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Declaration of the GNSS receiver: topics, table, readings."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.core.gate import OTHER
from imu_sim_ros.core.gps_time import calendar_ns
from imu_sim_ros.core.types import Array, Integers, Times
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.sensors.declaration import (
    Companions,
    NativeOutputs,
    Sensor,
    SensorReadings,
    Serial,
    Switch,
    import_on_call,
    topic,
)
from imu_sim_ros.sensors.gnss.parameters import GnssParameters
from imu_sim_ros.sensors.samples import Rows, Samples

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


_sentences: Final = import_on_call("imu_sim_ros.sensors.gnss.nmea", "sentences")
_rinex: Final = import_on_call("imu_sim_ros.sensors.gnss.rinex_files", "RinexFiles")


@dataclass(frozen=True, repr=False)
class GnssReadings(SensorReadings):
    """n delivered fixes of a receiver, with the truth of each.

    Without a fix the position is the last known one, NaN before the first; variances and velocity
    are NaN.
    """

    geodetic: Array
    """(n, 3) measured latitude [deg], longitude [deg], height above the ellipsoid [m]."""
    position: Array
    """(n, 3) true position in the world [m]."""
    variance: Array
    """(n, 3) stated variance of the error east, north, up [m^2]."""
    velocity: Array
    """(n, 3) measured velocity of the antenna, east, north, up [m/s]."""
    velocity_variance: Array
    """(n, 3) stated variance of the velocity [m^2/s^2]."""
    status: Integers
    """(n,) status of NavSatStatus: -1 no fix, 0 fix, 1 with corrections, 2 RTK."""
    mode: Integers
    """(n,) mode: 0 single, 1 dgps, 2 float, 3 fixed, -1 no fix."""
    satellites: Integers
    """(n,) number of satellites in use."""
    used: Integers
    """(n,) bits ``prn - 1`` of the satellites in use; 0 if `gnss.sky` is constant."""
    hdop: Array
    """(n,) horizontal dilution of precision; 99.99 without a fix."""
    vdop: Array
    """(n,) vertical dilution of precision."""
    pdop: Array
    """(n,) dilution of precision of the position."""
    dilution: Array
    """(n, 4) dilution east, north, up and of the clock; the clock's is 0 if it is unknown."""
    tag_ns: Times
    """(n,) GPS time of the receiver's clock at the raw measurements, since 6 January 1980 [ns];
    this and the arrays below exist with `gnss.raw.rinex`, for PRN 1 to 32."""
    pseudorange: Array
    """(n, 32, f) pseudorange on each frequency; NaN: not in view [m]."""
    carrier_phase: Array
    """(n, 32, f) carrier phase [cycles]."""
    doppler: Array
    """(n, 32, f) Doppler shift [Hz]."""
    lock: Integers
    """(n, 32) number of acquisitions of a satellite so far, each with new ambiguities; 0: not in
    view."""
    elevation: Array
    """(n, 32) elevation [rad]."""
    ideal_range: Array
    """(n, 32) true distance [m]."""
    satellite_clock: Array
    """(n, 32) clock of the satellite minus GPS time [s]."""
    receiver_clock: Array
    """(n,) clock of the receiver minus GPS time [s]."""
    ionosphere: Array
    """(n, 32) ionospheric delay on L1 [m]."""
    troposphere: Array
    """(n, 32) tropospheric delay [m]."""
    ideal_geodetic: Array
    """(n, 3) position of the antenna without error."""
    ideal_position: Array
    """(n, 3) true position in the world [m]."""
    ideal_velocity: Array
    """(n, 3) true velocity [m/s]."""
    error: Array
    """(n, 3) error of the position of a fix (measured - true), east, north, up; it continues
    without a fix [m]."""

    def nmea(self) -> str:
        """Return sentences GGA, GSA, RMC and VTG of every fix, as receivers write them."""
        return "".join(_sentences(self, slice(None)))

    def save_nmea(self, path: str | Path) -> Path:
        """Write a file of NMEA sentences; returns its path."""
        path = Path(path)
        path.write_bytes(self.nmea().encode("ascii"))
        return path


def _fix(samples: Samples, rows: Rows, _: object) -> tuple[Array, ...]:
    """Return the columns of NavSatFix for some rows."""
    geodetic, status = samples.geodetic[rows], samples.status[rows]
    variance = np.where(status[:, None] < 0, 0.0, samples.variance[rows])  # 0: unknown, in ROS
    return (*geodetic.T, status, variance)


_EXTENDED_STATUS: Final = np.array([0, 18, 20, 19, -1])
"""Status of gps_msgs/GPSStatus for each mode, and for no fix."""
# 95 % of a Gaussian error are within this many standard deviations, in one, two and three
# dimensions: roots of the quantiles of chi square.
_WITHIN: Final = (1.960, 2.448, 2.796)


def _gps_fix_fields(samples: Samples, rows: Rows, _: object) -> tuple[object, ...]:
    """Return the fields of gps_msgs/GPSFix; errors contain 95 %, and are NaN without a fix."""
    latitude, longitude, altitude, status, stated = _fix(samples, rows, _)
    variance = samples.variance[rows]
    east, north, up = samples.velocity[rows].T
    axes = samples.dilution[rows]
    has_dilution = (status >= 0) & (axes[:, 3] > 0.0)
    numbers = {
        "latitude": latitude,
        "longitude": longitude,
        "altitude": altitude,
        "track": np.degrees(np.arctan2(east, north)) % 360.0,
        "speed": np.hypot(east, north),
        "climb": up,
        "time": calendar_ns(samples.t_ns[rows]) * 1e-9,
        "gdop": np.where(has_dilution, np.linalg.norm(axes, axis=1), 0.0),
        "tdop": np.where(has_dilution, axes[:, 3], 0.0),
        **{name: samples.values[name][rows] for name in ("pdop", "hdop", "vdop")},
        "err": _WITHIN[2] * np.sqrt(variance.mean(axis=1)),
        "err_horz": _WITHIN[1] * np.sqrt(variance[:, :2].mean(axis=1)),
        "err_vert": _WITHIN[0] * np.sqrt(variance[:, 2]),
        "err_speed": _WITHIN[0] * np.sqrt(samples.velocity_variance[rows, 0]),
        "err_climb": _WITHIN[0] * np.sqrt(samples.velocity_variance[rows, 2]),
    }
    return _EXTENDED_STATUS[samples.mode[rows]], samples.satellites[rows], numbers, stated


SENSOR: Final[Sensor[GnssParameters]] = Sensor(
    name="gnss",
    quantity="gnss",
    section=GnssParameters,
    model=import_on_call("imu_sim_ros.sensors.gnss.model", "Receiver"),
    topics=(
        topic(TOPIC, *FIX, _fix),
        topic(
            *("gps/velocity", *TWIST),
            lambda samples, rows, _: (samples.velocity[rows], samples.velocity_variance[rows]),
            in_world=True,
            sent=lambda samples: samples.mode >= 0,
        ),
        topic("gps/extended_fix", *GPS_FIX, _gps_fix_fields, foreign=True),
        topic(
            *("ground_truth/gps_fix", *FIX),
            lambda samples, rows, _: tuple(samples.ideal_geodetic[rows].T),
            truth=True,
        ),
        topic(
            *("ground_truth/gps_velocity", *TWIST),
            lambda samples, rows, _: (samples.ideal_velocity[rows], np.zeros(3)),
            truth=True,
            in_world=True,
        ),
        topic(
            *("ground_truth/gps_error", *VECTOR),
            lambda samples, rows, _: (samples.error[rows],),
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
    values=lambda samples: np.column_stack(
        [samples.geodetic, samples.variance, samples.velocity, samples.status]
    ),
    readings=GnssReadings,
    text="GNSS receiver with fixes and velocities of an antenna, with outages and modes",
    outputs=NativeOutputs(
        Companions(
            lambda parameters: (".obs", ".nav") if parameters.raw.rinex else (),
            _rinex,
            Switch(
                "rinex",
                "raw.rinex",
                "write raw GNSS measurements as RINEX next to the output: NAME.obs, NAME.nav",
            ),
        ),
        Serial(lambda parameters: str(parameters.nmea), _sentences),
    ),
    presets="gnss",
    warnings=import_on_call("imu_sim_ros.sensors.gnss.model", "location_warnings"),
)
