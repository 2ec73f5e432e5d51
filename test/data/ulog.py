# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ULog files by the description of the format: topics of arrays, and flights as PX4 logs them.

docs.px4.io, "ULog File Format". pyulog reads them back; it can only write what it has read.
"""

import struct

import numpy as np

from imu_sim_ros.core import rotation

MAGIC = b"ULog\x01\x12\x35\x01"
C_TYPES = {
    "u8": "uint64_t", "u4": "uint32_t", "i4": "int32_t", "u1": "uint8_t", "i2": "int16_t",
    "f4": "float", "f8": "double", "b1": "bool",
}  # fmt: skip
US = 1000


def message(kind, body):
    """Return a message of the file: size, type (one letter) and content."""
    return struct.pack("<HB", len(body), ord(kind)) + body


def write(path, topics):
    """Write topics.

    :param topics: ``{"sensor_accel/0": {"timestamp": (u8), ...}}`` arrays (n,) or (n, m) by field.
    """
    parts = [MAGIC, struct.pack("<Q", 0), message("B", bytes(40))]
    names = dict.fromkeys(name.partition("/")[0] for name in topics)
    for name in names:
        fields = next(v for key, v in topics.items() if key.partition("/")[0] == name)
        parts.append(message("F", f"{name}:{';'.join(map(declared, fields.items()))};".encode()))
    rows = []
    for number, (key, fields) in enumerate(topics.items()):
        name, _, instance = key.partition("/")
        parts.append(message("A", struct.pack("<BH", int(instance or 0), number) + name.encode()))
        kinds = [(f, v.dtype.newbyteorder("<"), v.shape[1:]) for f, v in fields.items()]
        table = np.zeros(len(fields["timestamp"]), kinds)
        for field, values in fields.items():
            table[field] = values
        head = struct.pack("<HBH", 2 + table.itemsize, ord("D"), number)
        rows += [
            (int(t), head + row.tobytes())
            for t, row in zip(fields["timestamp"].tolist(), table, strict=True)
        ]
    rows.sort(key=lambda row: row[0])
    path.write_bytes(b"".join([*parts, *(row for _, row in rows)]))
    return path


def declared(field):
    """Return the declaration of a field, such as ``float[3] q``, of its name and array."""
    name, values = field
    size = f"[{values.shape[1]}]" if values.ndim > 1 else ""
    return f"{C_TYPES[values.dtype.str[1:]]}{size} {name}"


def stamps(t_ns):
    """Return the field of stamps [us] of times [ns]."""
    return {"timestamp": (np.asarray(t_ns) // US).astype("u8")}


def frd(vector):
    """Return vectors (n, 3) in forward-left-up in the axes forward-right-down."""
    return (np.asarray(vector) * [1, -1, -1]).astype("f4")


def ned(vector):
    """Return vectors (n, 3) in east-north-up in the axes north-east-down."""
    return (np.asarray(vector)[:, [1, 0, 2]] * [1, 1, -1]).astype("f4")


def q_ned_frd(q_wb):
    """Return the quaternion by matrices, independent of the package's way."""
    exchange = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    return rotation.from_matrix(exchange @ rotation.to_matrix(q_wb) @ np.diag([1, -1, -1.0]))


def combined(t_ns, gyro, accel):
    """Return the fields of ``sensor_combined``, means over 5 ms, of readings in SI units."""
    return {
        **stamps(t_ns),
        "gyro_rad": frd(gyro),
        "gyro_integral_dt": np.full(len(t_ns), 5000, "u4"),
        "accelerometer_timestamp_relative": np.zeros(len(t_ns), "i4"),
        "accelerometer_m_s2": frd(accel),
        "accelerometer_integral_dt": np.full(len(t_ns), 5000, "u4"),
    }


def local_position(t_ns, position, velocity):
    """Return the fields of ``vehicle_local_position`` of states in the world, all valid."""
    p, v, true = ned(position), ned(velocity), np.ones(len(t_ns), bool)
    flags = dict.fromkeys(("xy_valid", "z_valid", "v_xy_valid", "v_z_valid"), true)
    axes = {name: p[:, k] for k, name in enumerate("xyz")}
    return {**stamps(t_ns), **flags, **axes, **{f"v{n}": v[:, k] for k, n in enumerate("xyz")}}


def attitude(t_ns, q_wb):
    """Return the fields of ``vehicle_attitude``."""
    return {**stamps(t_ns), "q": q_ned_frd(q_wb).astype("f4")}


def flight_topics(flight, suffix="_groundtruth"):
    """Return what a simulator with PX4 logs of a flight: readings and truth."""
    t, truth = flight.readings.t_ns, flight.truth
    return {
        "sensor_combined": combined(t, flight.readings.gyro, flight.readings.accel),
        f"vehicle_local_position{suffix}": local_position(
            truth.t_ns, truth.position, truth.velocity
        ),
        f"vehicle_attitude{suffix}": attitude(truth.t_ns, truth.q_wb),
        f"vehicle_angular_velocity{suffix}": {
            **stamps(truth.t_ns), "xyz": frd(truth.angular_velocity)
        },
    }  # fmt: skip
