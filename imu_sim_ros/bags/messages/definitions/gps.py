# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""gps_msgs/GPSFix of ROS 2, which ROS 1 calls gps_common/GPSFix: fields and constants.

They are those of gps_umd 2.0.5 for Jazzy and 0.3.4 for Noetic, which has no constants for RTK.
"""

from typing import Final

ROS1_PACKAGE: Final = "gps_common"
NUMBERS: Final = (
    *("latitude", "longitude", "altitude", "track", "speed", "climb", "pitch", "roll", "dip"),
    *("time", "gdop", "pdop", "hdop", "vdop", "tdop", "err", "err_horz", "err_vert", "err_track"),
    *("err_speed", "err_climb", "err_time", "err_pitch", "err_roll", "err_dip"),
)
"""Fields that are one number each, in order."""
_FIX: Final = (
    "uint8 COVARIANCE_TYPE_UNKNOWN=0\n"
    "uint8 COVARIANCE_TYPE_APPROXIMATED=1\n"
    "uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2\n"
    "uint8 COVARIANCE_TYPE_KNOWN=3\n"
    "std_msgs/Header header\n"
    "gps_msgs/GPSStatus status\n"
    f"{''.join(f'float64 {name}' + chr(10) for name in NUMBERS)}"
    "float64[9] position_covariance\n"
    "uint8 position_covariance_type\n"
)
_STATUS: Final = (
    "int16 STATUS_NO_FIX=-1\n"
    "int16 STATUS_FIX=0\n"
    "int16 STATUS_SBAS_FIX=1\n"
    "int16 STATUS_GBAS_FIX=2\n"
    "int16 STATUS_DGPS_FIX=18\n"
    "int16 STATUS_RTK_FIX=19\n"
    "int16 STATUS_RTK_FLOAT=20\n"
    "int16 STATUS_WAAS_FIX=33\n"
    "uint16 SOURCE_NONE=0\n"
    "uint16 SOURCE_GPS=1\n"
    "uint16 SOURCE_POINTS=2\n"
    "uint16 SOURCE_DOPPLER=4\n"
    "uint16 SOURCE_ALTIMETER=8\n"
    "uint16 SOURCE_MAGNETIC=16\n"
    "uint16 SOURCE_GYRO=32\n"
    "uint16 SOURCE_ACCEL=64\n"
    "std_msgs/Header header\n"
    "uint16 satellites_used\n"
    "int32[] satellite_used_prn\n"
    "uint16 satellites_visible\n"
    "int32[] satellite_visible_prn\n"
    "int32[] satellite_visible_z\n"
    "int32[] satellite_visible_azimuth\n"
    "int32[] satellite_visible_snr\n"
    "int16 status\n"
    "uint16 motion_source\n"
    "uint16 orientation_source\n"
    "uint16 position_source\n"
)

ROS2: Final = {"gps_msgs/GPSFix": _FIX, "gps_msgs/GPSStatus": _STATUS}
"""Definition of each type by name, without the types that it contains."""
RIHS01: Final = {
    "gps_msgs/GPSFix": "RIHS01_f4e11a63872a198f70300a3990f50b096ed822f2db2bb626f6cdcee5f0f92942"
}
ROS1: Final = {
    "gps_common/GPSFix": _FIX.replace("gps_msgs", ROS1_PACKAGE),
    "gps_common/GPSStatus": "".join(
        line for line in _STATUS.splitlines(keepends=True) if "RTK" not in line
    ),
}
MD5_SUMS: Final = {"gps_common/GPSFix": "3db3d0a7bc53054c67c528af84710b70"}
