# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""robot_localization: ekf_node and navsat_transform_node for the GNSS and the wheels of a body.

Keys are those that src/ros_filter.cpp and src/navsat_transform.cpp declare.
"""

from typing import Final

from imu_sim_ros.datasets.consumers.aiding import Aiding
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.datasets.consumers.values import comment, yaml_float
from imu_sim_ros.simulation.parameters import SimulationParameters
from imu_sim_ros.simulation.topics import resolve_topic

_ROWS: Final = (
    "x, y, z",
    "roll, pitch, yaw",
    "vx, vy, vz",
    "about x, y, z",
    "ax, ay, az",
)
"""States of the filter, three a row: position, angles, velocity, rates, acceleration."""
_FREQUENCY: Final = 50.0
"""Rate of the filter's output [Hz]."""


def files(subject: Subject) -> dict[str, str]:
    """Return ``ekf.yaml`` with wheels or GNSS and ``navsat.yaml`` with GNSS."""
    body = subject.aiding
    if body is None:
        return {}
    texts = {"ekf.yaml": _ekf(body)}
    if body.gnss is not None:
        texts["navsat.yaml"] = _navsat(body.parameters)
    return texts


def _ekf(body: Aiding) -> str:
    """Return the configuration of the filters of robot_localization."""
    remarks = [
        "robot_localization, ekf_node: odom to body from IMU and wheels, and with GNSS another "
        "filter, map to odom, with the output of navsat.yaml. Written against its sources; it "
        "has not been run with them here.",
        "No filter of it estimates biases: those of this IMU go into the estimate. Readings of "
        "imu/data_raw have no orientation; roll, pitch and yaw come from imu/data, if it is "
        "published, with the second row of imu0_config true.",
    ]
    if body.gnss is not None:
        remarks.append(
            "gps/velocity is not used: the filter takes a twist for that of a point fixed to the "
            "body, in a frame that turns with it; this one is east, north, up in the world's frame."
        )
    text = comment(remarks) + _filter("ekf_filter_node_odom", "odom", body, fixes=False)
    if body.gnss is not None:
        text += _filter("ekf_filter_node_map", "map", body, fixes=True)
    return text


def _filter(name: str, world: str, body: Aiding, *, fixes: bool) -> str:
    """Return the section of a filter.

    :param name: name of the node.
    :param world: frame of the world that the filter estimates in.
    :param fixes: take the positions of GNSS, too.
    """
    values, wheels = body.values, body.wheels
    odom = wheels.odom_frame if wheels is not None else "odom"
    lines = [
        f"frequency: {yaml_float(_FREQUENCY)}",
        "two_d_mode: false",
        "publish_tf: true",
        "map_frame: map",
        f"odom_frame: {odom}",
        f"base_link_frame: {body.parameters.body_frame}",
        f"world_frame: {'map' if world == 'map' else odom}",
        f"gravitational_acceleration: {yaml_float(values.gravity)}",
        f"imu0: {values.topic}",
        _config("imu0", (3, 4)),
        "imu0_differential: false",
        "imu0_relative: false",
        "imu0_queue_size: 100",
        "imu0_remove_gravitational_acceleration: true",
    ]
    count = 0
    if wheels is not None:
        # vx, vy and the yaw rate: the covariance of the others is 1e6.
        lines += _odometry(count, resolve_topic("wheel/odom"), "FFF FFF TTF FFT FFF")
        count += 1
    if fixes:
        lines += _odometry(count, "odometry/gps", "TTT FFF FFF FFF FFF")
    text = "".join(f"    {line}\n" for line in lines)
    return f"{name}:\n  ros__parameters:\n{text}"


def _odometry(number: int, topic: str, used: str) -> list[str]:
    """Return the keys of an odometry input.

    :param used: T or F for each of the 15 states.
    """
    name = f"odom{number}"
    return [
        f"{name}: {topic}",
        _booleans(name, [letter == "T" for letter in used.replace(" ", "")]),
        f"{name}_differential: false",
        f"{name}_relative: false",
        f"{name}_queue_size: 20",
    ]


def _config(name: str, rows: tuple[int, ...]) -> str:
    """Return the key ``NAME_config`` of an input that measures some rows of ``_ROWS``."""
    return _booleans(name, [k // 3 in rows for k in range(15)])


def _booleans(name: str, used: list[bool]) -> str:
    """Return the key ``NAME_config``: a flag for each of the 15 states, three a line."""
    indent = " " * (len(name) + len("    _config: ["))
    rows = [", ".join(str(flag).lower() for flag in used[k : k + 3]) for k in range(0, 15, 3)]
    lines = [f"{row}{',' if k < 4 else ']'}  # {_ROWS[k]}" for k, row in enumerate(rows)]
    return f"{name}_config: [" + f"\n{indent}".join(lines)


def _navsat(parameters: SimulationParameters) -> str:
    """Return the configuration of navsat_transform_node."""
    head = comment(
        [
            "robot_localization, navsat_transform_node: gps/fix to odometry/gps. The datum is the "
            "origin of the simulated world, east along x: with it odometry/gps is in the world's "
            "coordinates, which a flat world has without any error of a projection "
            "(use_local_cartesian). No IMU is subscribed then. Written against its sources; it has "
            "not been run with them here.",
            "Without a datum: wait_for_datum false and an orientation on the topic imu; it is "
            "relative to true north and 0 facing east, hence no declination and no offset.",
            "The frame_id of the receiver must be known to tf, or be empty: then the antenna is at "
            "the origin of the body.",
        ]
    )
    latitude, longitude = yaml_float(parameters.latitude_deg), yaml_float(parameters.longitude_deg)
    return (
        f"{head}navsat_transform:\n  ros__parameters:\n"
        f"    frequency: {yaml_float(_FREQUENCY)}\n"
        "    delay: 0.0\n"
        "    magnetic_declination_radians: 0.0\n"
        "    yaw_offset: 0.0\n"
        "    zero_altitude: false\n"
        "    publish_filtered_gps: true\n"
        "    broadcast_cartesian_transform: false\n"
        "    use_local_cartesian: true\n"
        "    use_odometry_yaw: false\n"
        "    wait_for_datum: true\n"
        f"    datum: [{latitude}, {longitude}, 0.0]  # latitude, longitude [deg], yaw [rad]\n"
    )
