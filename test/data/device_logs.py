# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of a flight as phones, datasets and IMUs of other makers write them.

Each writer follows the description that the module of the format names, and takes a Flight.
"""

import zipfile
from functools import reduce

import numpy as np
import ulog

from imu_sim_ros.core import rotation

EPOCH = 1_700_000_000_000_000_000
"""UTC of the flight's time 0 [ns]."""
DOWN_AXES = [1.0, -1.0, -1.0]
"""Signs of forward-left-up in forward-right-down."""
G = 9.80665
LATITUDE, LONGITUDE, HEIGHT = 49.0095, 8.4312, 112.8
"""Origin of the flight's world [deg], [m]."""


def rows(*columns):
    """Return lines of comma-separated columns."""
    return [",".join(cells) for cells in zip(*columns, strict=True)]


def numbers(values, form="{!r}"):
    """Return numbers as texts; ``form`` is a format of one float, by default all digits."""
    return [form.format(float(value)) for value in values]


def stamps(t_ns, epoch=EPOCH, unit=1):
    """Return stamps as texts: times [ns] after an epoch [ns], in units of ``unit`` ns."""
    return [str((int(t) + epoch) // unit) for t in t_ns]


def table(folder, name, head, lines):
    """Write a file of a folder: a header and lines; folders above it are created."""
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")


def zipped(folder, prefix=""):
    """Return a zip archive of the files of a folder."""
    path = folder.with_suffix(".zip")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                archive.write(file, prefix + str(file.relative_to(folder)))
    return path


def up_in_body(truth):
    """Return the specific force (n, 3) of a body at rest with these attitudes [m/s^2]."""
    return rotation.rotate_inverse(truth.q_wb, np.array([0.0, 0.0, G]))


def geodetic(position):
    """Return latitudes, longitudes [deg] and heights [m] of places near the origin.

    The inverse of the tangent plane, by three Newton steps on the radii of curvature.
    """
    from imu_sim_ros.core.geodesy import radii_of_curvature, tangent_plane

    origin = np.array([LATITUDE, LONGITUDE, HEIGHT])
    place = np.tile(origin, (len(position), 1))
    for _ in range(4):
        rest = position - tangent_plane(place, origin)
        meridian, vertical = radii_of_curvature(np.radians(place[:, 0]))
        place[:, 0] += np.degrees(rest[:, 1] / meridian)
        place[:, 1] += np.degrees(rest[:, 0] / vertical / np.cos(np.radians(place[:, 0])))
        place[:, 2] += rest[:, 2]
    return place


def sensor_logger(folder, flight, system="android", standard=False, skew_ns=0):
    """Write a folder of Sensor Logger.

    :param system: android or ios; None: without Metadata.csv.
    :param skew_ns: delay of the stamps of the accelerometer.
    """
    readings, truth = flight.readings, flight.truth
    sign = -1.0 if system == "ios" and not standard else 1.0
    t_gyro, t_accel = readings.t_ns, readings.t_ns + skew_ns

    def vector(name, t_ns, values):
        x, y, z = values.T
        elapsed = numbers((t_ns - t_ns[0]) * 1e-9)
        lines = rows(stamps(t_ns), elapsed, numbers(z), numbers(y), numbers(x))
        table(folder, f"{name}.csv", "time,seconds_elapsed,z,y,x", lines)

    gravity = up_in_body(truth)
    vector("Gyroscope", t_gyro, readings.gyro)
    vector("GyroscopeUncalibrated", t_gyro, readings.gyro + 0.01)
    vector("Accelerometer", t_accel, sign * (readings.accel - gravity))
    vector("Gravity", t_accel, sign * gravity)
    unit = G if sign < 0.0 else 1.0
    vector("AccelerometerUncalibrated", t_gyro, sign * (readings.accel + 0.1) / unit)
    if system == "android":
        vector("TotalAcceleration", t_accel, readings.accel)
    vector("Magnetometer", t_gyro[::5], np.tile([20.0, -5.0, -45.0], (len(t_gyro[::5]), 1)))
    q = truth.q_wb
    if sign < 0.0:  # x to the north
        quarter = np.array([np.sqrt(0.5), 0.0, 0.0, -np.sqrt(0.5)])
        q = rotation.multiply(quarter, q)
    zero = ["0"] * len(q)
    table(
        folder,
        "Orientation.csv",
        "time,seconds_elapsed,qz,qy,qx,qw,roll,pitch,yaw",
        rows(stamps(t_gyro), zero, *(numbers(q[:, k]) for k in (3, 2, 1, 0)), zero, zero, zero),
    )
    slow = t_gyro[::20]
    few = len(slow)
    table(
        folder,
        "Barometer.csv",
        "time,seconds_elapsed,relativeAltitude,pressure",
        rows(stamps(slow), ["0"] * few, ["0.1"] * few, ["1013.25"] * few),
    )
    table(folder, "Location.csv",
          "time,seconds_elapsed,mslAltitudeAccuracy,bearingAccuracy,speedAccuracy,verticalAccuracy,"
          "horizontalAccuracy,speed,altitudeAboveMeanSeaLevel,bearing,altitude,longitude,latitude",
          rows(stamps(slow), ["0"] * few, [""] * few, ["45"] * few, ["1.5"] * few, ["3.5"] * few,
               ["5"] * few, ["1"] * few, [""] * few, ["0"] * few, [str(HEIGHT)] * few,
               [str(LONGITUDE)] * few, [str(LATITUDE)] * few))  # fmt: skip
    table(folder, "Annotation.csv", "time,seconds_elapsed,text", [f'{EPOCH},0,"a, b"'])
    if system is not None:
        table(
            folder,
            "Metadata.csv",
            "version,device name,recording epoch time,recording time,recording timezone,platform,"
            "appVersion,device id,sensors,sampleRateMs,standardisation,platform version",
            [
                f"3,Phone,1700000000000,2023-11-14_22-13-20,Europe/Berlin,{system},1.64,id,"
                f"Accelerometer|Gyroscope,10|10,{str(standard).lower()},36"
            ],
        )
    return folder


def phyphox(folder, flight, separator=",", decimal=".", linear=False, names=None, pause_s=3.0):
    """Write a folder of phyphox whose second half follows a pause.

    :param linear: write acceleration and gravity, not their sum.
    :param names: name of the acceleration, in another language.
    :returns: the folder, and the UTC of each reading [ns].
    """
    readings, truth = flight.readings, flight.truth
    t = (readings.t_ns - readings.t_ns[0]) * 1e-9
    middle = round(t[len(t) // 2] - 0.2 * t[1], 3)  # the system's times have milliseconds

    def write(name, head, t_s, values):
        cells = [numbers(column, "{:.12E}") for column in (t_s, *values.T)]
        lines = [separator.join(row).replace(".", decimal) for row in zip(*cells, strict=True)]
        table(folder, f"{name}.csv", separator.join(f'"{n}"' for n in head), lines)

    def vector(name, quantity, unit, t_s, values):
        axes = [f"{quantity} {axis} ({unit})".strip() for axis in "xyz"]
        write(name, ["Time (s)", *axes], t_s, values)

    vector("Gyroscope", "", "rad/s", t, readings.gyro)
    gravity = up_in_body(truth)
    if linear:
        name = names or "Linear Acceleration"
        vector("Linear Accelerometer", name, "m/s^2", t, readings.accel - gravity)
        vector("Gravity", "Gravity", "m/s^2", t, gravity)
    else:
        vector("Raw Data", names or "Acceleration", "m/s^2", t, readings.accel)
    field = np.tile([20.0, -5.0, -45.0], (len(t[::5]), 1))
    vector("Magnetometer", "Magnetic Field", "µT", t[::5], field)
    write("Pressure", ["Time (s)", "Pressure (hPa)"], t[::20], np.full((len(t[::20]), 1), 1013.25))
    place = np.tile([LATITUDE, LONGITUDE, HEIGHT, 5.0, 3.5], (len(t[::20]), 1))
    write(
        "Location",
        [
            "Time (s)",
            "Latitude (°)",
            "Longitude (°)",
            "Altitude WGS84 (m)",
            "Horizontal Accuracy (m)",
            "Vertical Accuracy (m)",
        ],
        t[::20],
        place,
    )
    start = EPOCH // 10**9
    events = [
        ("START", 0.0, start),
        ("PAUSE", middle, start + middle),
        ("START", middle, start + middle + pause_s),
        ("PAUSE", t[-1], start + t[-1] + pause_s),
    ]
    lines = [separator.join([f'"{event}"', f"{experiment_time:.9E}".replace(".", decimal),
                             f"{system:.3f}".replace(".", decimal), '"2023-11-14 UTC"'])
             for event, experiment_time, system in events]  # fmt: skip
    head = separator.join(f'"{n}"' for n in ("event", "experiment time", "system time", "text"))
    table(folder, "meta/time.csv", head, lines)
    table(folder, "meta/device.csv", separator.join(('"property"', '"value"')), [])
    t_ns = EPOCH + np.rint(t * 1e9).astype(np.int64)
    return folder, t_ns + np.where(t >= middle, round(pause_s * 1e9), 0)


def kitti(folder, flight):
    """Write a drive of KITTI's raw data."""
    readings, truth = flight.readings, flight.truth
    times = [str(np.datetime64(int(t) + EPOCH, "ns")).replace("T", " ") for t in readings.t_ns]
    table(folder, "oxts/timestamps.txt", times[0], times[1:])
    angles = rotation.to_euler(truth.q_wb)
    place, ve = geodetic(truth.position), truth.velocity
    zero = np.zeros((len(place), 1))
    body = rotation.rotate_inverse(truth.q_wb, ve)
    values = np.hstack([
        place, angles, ve[:, [1, 0]], body[:, :2], ve[:, 2:], readings.accel, readings.accel,
        readings.gyro, readings.gyro, zero + 0.05, zero + 0.02, zero + 4, zero + 9,
        zero, zero, zero,
    ])  # fmt: skip
    data = folder / "oxts/data"
    data.mkdir()
    for k, row in enumerate(values.tolist()):
        (data / f"{k:010d}.txt").write_text(" ".join(map(repr, row)) + "\n")
    return folder


def nclt(folder, flight):
    """Write the tables of NCLT, the first pose without a value as there."""
    readings, truth = flight.readings, flight.truth
    t = stamps(readings.t_ns, unit=1000)
    field = np.tile([0.2, 0.05, 0.45], (len(t), 1))
    values = np.hstack([field, readings.accel * DOWN_AXES, readings.gyro * DOWN_AXES])
    pose_row, *rest = rows(t, *map(numbers, values.T))
    table(folder, "sensor_data/ms25.csv", pose_row, rest)
    pose = np.hstack([ulog.ned(truth.position), rotation.to_euler(ulog.q_ned_frd(truth.q_wb))])
    lines = rows(t, *map(numbers, pose.T))
    table(
        folder,
        "ground_truth/groundtruth_2012-01-08.csv",
        f"{int(t[0]) - 10000},NaN,NaN,NaN,NaN,NaN,NaN",
        lines,
    )
    place = np.radians([LATITUDE, LONGITUDE]).tolist()
    line = f"3,9,{place[0]!r},{place[1]!r},{HEIGHT},NaN,NaN"
    table(folder, "sensor_data/gps.csv", f"{t[0]},{line}", [f"{t[k]},{line}" for k in (10, 20)])
    return folder


def xsens(
    path, flight, separator="\t", matrix=False, increments=False, head="", ticks=10_000, times=True
):
    """Write an export of MT Manager.

    :param matrix: write the orientation as a matrix.
    :param increments: write increments of velocity and orientation, not accelerations and rates.
    :param ticks: units of SampleTimeFine in a second.
    :param times: fill SampleTimeFine; else it is empty, as of an MTw.
    """
    readings, truth = flight.readings, flight.truth
    n = len(readings)
    period = (readings.t_ns[1] - readings.t_ns[0]) * 1e-9
    unit = 10**9 // ticks
    fine = (readings.t_ns // unit - readings.t_ns[n // 2] // unit) % 2**32  # begins again
    columns = {"PacketCounter": [str((65500 + k) % 65536) for k in range(n)],
               "SampleTimeFine": [str(t) if times else "" for t in fine]}  # fmt: skip
    if increments:
        turn = rotation.exp(readings.gyro * period)
        columns |= {f"OriInc_q{k}": numbers(turn[:, k]) for k in range(4)}
        columns |= {
            f"VelInc_{a}": numbers(readings.accel[:, k] * period) for k, a in enumerate("XYZ")
        }
    else:
        columns |= {f"Acc_{a}": numbers(readings.accel[:, k]) for k, a in enumerate("XYZ")}
        columns |= {f"Gyr_{a}": numbers(readings.gyro[:, k]) for k, a in enumerate("XYZ")}
    columns |= {f"Mag_{a}": numbers(np.full(n, 0.5)) for a in "XYZ"}
    if matrix:
        r = rotation.to_matrix(truth.q_wb)
        columns |= {
            f"Mat[{i + 1}][{j + 1}]": numbers(r[:, i, j]) for j in range(3) for i in range(3)
        }
    else:
        columns |= {f"Quat_q{k}": numbers(truth.q_wb[:, k]) for k in range(4)}
    columns["Temperature"] = numbers(np.full(n, 31.5))
    lines = [separator.join(cells) for cells in zip(*columns.values(), strict=True)]
    text = [head or f"// Start Time: Unknown\n// Update Rate: {1 / period:.1f}Hz\n"
            "// Firmware Version: 4.6.0", separator.join(columns), *lines]  # fmt: skip
    path.write_text("\n".join(text) + "\n")
    return path


def vectornav_line(body, bits=8):
    """Return a message with its checksum."""
    letters = body.encode()
    if bits == 8:
        return f"${body}*{reduce(lambda a, b: a ^ b, letters):02X}"
    crc = 0
    for letter in letters:
        crc ^= letter << 8
        for _ in range(8):
            crc = ((crc << 1) ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return f"${body}*{crc:04X}"


def vectornav(path, flight, name="VNYMR", time="host", bits=8):
    """Write a log of messages of one name.

    :param time: host: seconds in front of the line; counter: SyncIn time; rate: register 7; None.
    """
    readings, truth = flight.readings, flight.truth
    gyro, accel = readings.gyro * DOWN_AXES, readings.accel * DOWN_AXES
    q_ned = ulog.q_ned_frd(truth.q_wb)
    angles = np.degrees(rotation.to_euler(q_ned))[:, ::-1]
    field = np.tile([0.2, 0.05, 0.45], (len(gyro), 1))
    column = np.ones((len(gyro), 1))
    position, velocity = geodetic(truth.position), ulog.ned(truth.velocity)
    period = (readings.t_ns[1] - readings.t_ns[0]) * 1e-9
    week = 2288 * column
    seconds = 180_000.0 + readings.t_ns[:, None] * 1e-9
    parts = {
        "VNYMR": (angles, field, accel, gyro),
        "VNQMR": (q_ned[:, [1, 2, 3, 0]], field, accel, gyro),
        "VNMAR": (field, accel, gyro), "VNIMU": (field, accel, gyro, 20.7 * column, 101.3 * column),
        "VNDTV": (period * column, np.degrees(gyro * period), accel * period),
        "VNISL": (angles, position, velocity, accel, gyro),
        "VNINS": (seconds, week, 2 * column, angles, position, velocity, column, column, column),
        "VNGPS": (seconds, week, 3 * column, 9 * column, position, velocity, column, column, column,
                  column, column),
    }[name]  # fmt: skip
    lines = []
    if time == "rate":
        lines.append(vectornav_line(f"VNRRG,07,{round(1 / period)}"))
    for t, row in zip(readings.t_ns.tolist(), np.hstack(parts).tolist(), strict=True):
        cells = [f"{value:+.12f}" for value in row]
        if name in ("VNINS", "VNGPS"):
            cells[1] = f"{row[1]:.0f}"
            cells[2] = "0002" if name == "VNINS" else "3"
        suffix = f",S00B3,T{t // 1000:010d}" if time == "counter" else ""
        line = vectornav_line(f"{name},{','.join(cells)}{suffix}", bits)
        host = f"{(t + EPOCH) // 10**9}.{(t + EPOCH) % 10**9:09d}, " if time == "host" else ""
        lines.append(host + line)
    path.write_text("\r\n".join(lines) + "\r\n")
    return path
