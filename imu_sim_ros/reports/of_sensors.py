# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sensors of a bag whatever they measure: readings against the truth, errors against the stated.

A topic is compared with the topic of its truth, which has the same type and a name that begins
with ``ground_truth/``; an orientation with that of the body. All numbers of a message are drawn.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.bags.messages import schemas
from imu_sim_ros.bags.messages.blocks import TopicInfo, as_list
from imu_sim_ros.bags.messages.encode import IMU, NAV_SAT_FIX, ODOMETRY
from imu_sim_ros.bags.messages.encode_cameras import POINT_CLOUD2
from imu_sim_ros.bags.messages.layouts import TYPES, fields
from imu_sim_ros.bags.read import decoded_blocks, open_bag, read_odometry
from imu_sim_ros.bags.reader import errors_naming
from imu_sim_ros.bags.sensor_tables import read_table
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.gate import stamp_ns
from imu_sim_ros.navigation.association import common_rows, poses_at
from imu_sim_ros.navigation.evaluation import attitude_errors
from imu_sim_ros.records import States
from imu_sim_ros.reports.of_bag import NOT_MEASURED, error_series, plot, without_truth
from imu_sim_ros.reports.page import Item, Section
from imu_sim_ros.reports.streams import extremes
from imu_sim_ros.sensors import known_tables
from imu_sim_ros.types import Array, Times

TRUTH: Final = "ground_truth/"
_AXES: Final = "xyz"
_MAX_COLUMNS: Final = 6
"""Columns of a quantity that are drawn."""
_INSIDE: Final = (1.0, 2.0, 3.0)
"""Stated standard deviations, of whose shares a page tells."""
_GAUSSIAN: Final = (0.683, 0.954, 0.997)
_UNITS: Final = {
    "linear": "m/s",
    "angular": "rad/s",
    "magnetic_field": "T",
    "fluid_pressure": "Pa",
    "temperature": "degC",
    "position": "rad",
    "velocity": "rad/s",
}
"""Of fields of messages; those of JointState are joints."""
_STATED: Final = {
    "linear": ("twist_covariance", 0),
    "angular": ("twist_covariance", 3),
    "fluid_pressure": ("variance", 0),
    "temperature": ("variance", 0),
}
"""The field that states the variance of another, and the row of its first number in it; of others
it is named after them."""


class Compared(NamedTuple):
    """n values of one quantity, as read or true."""

    name: str
    unit: str
    columns: tuple[str, ...]
    t_ns: Times
    values: Array
    """(n, k)."""
    variance: Array
    """(n, k) stated; 0: unknown."""


def sensor_sections(path: Path) -> list[Section]:
    """Return a section for each topic of numbers that has a truth, GNSS and poses not counted.

    :raises InputError: for what cannot be read.
    """
    with open_bag(path) as bag:
        topics = [info for info in bag.topics if info.count and info.type != POINT_CLOUD2]
    sections = []
    for info in topics:
        true_name = truth_of(info, topics)
        if TRUTH in info.name or "/gps/" in f"/{info.name}" or info.type == NAV_SAT_FIX:
            continue
        items: list[Item] = []
        if info.type == IMU:
            items = _orientation(path, info, topics)
        elif true_name is not None:
            for read, true in zip(
                _quantities(path, info), _quantities(path, info, true_name), strict=False
            ):
                items += compared(read, true, info.name, str(path))
        if items:
            title = f"{path.name}: {info.name}{' (twist)' if info.type == ODOMETRY else ''}"
            sections.append(Section(title, items))
    return sections


def truth_of(info: TopicInfo, topics: Sequence[TopicInfo]) -> str | None:
    """Return the topic of the truth in the same namespace.

    Of gps/fix it is ground_truth/gps_fix, of imu/mag ground_truth/mag, of sonar/beam
    ground_truth/sonar.
    """
    *space, group, last = ["", *info.name.strip("/").split("/")][-3:]
    names = [f"{group}_{last}" if group else last]
    if info.type != ODOMETRY:  # ground_truth/odom is that of the body, not of a filter/odom
        names += [last, group]
    before = "/".join(filter(None, space))
    wanted = [f"{before}/{TRUTH}{name}".strip("/") for name in names if name]
    known = [one.name for one in topics if one.type == info.type]
    found = [name for want in wanted for name in known if name.strip("/") == want]
    return found[0] if found else None


def _quantities(path: Path, info: TopicInfo, topic: str | None = None) -> Iterator[Compared]:
    """Yield the numbers of a topic's messages by field, without those of poses.

    :param topic: another one of the same type; None: the topic itself.
    """
    skipped = ("position", "orientation", "pose_covariance") if info.type == ODOMETRY else ()
    t_ns, numbers = _numbers(path, info.type, topic or info.name, skipped)
    own = {table.topic: table.quantity.unit for table in known_tables().values()}
    given = next((unit for name, unit in own.items() if info.name.strip("/").endswith(name)), "")
    for name, values in numbers.items():
        if name.endswith("variance"):  # covariance, too
            continue
        values = values.reshape(len(t_ns), -1)[:, :_MAX_COLUMNS]
        field, first = _STATED.get(name, (f"{name}_covariance", 0))
        variance = _diagonal(numbers.get(field), first, values.shape)
        measured = np.atleast_1d((variance < NOT_MEASURED).all(axis=0))
        words, count = name.replace("_", " "), values.shape[1]
        axes = tuple(_AXES) if count == 3 else tuple(map(str, range(count)))
        if count == 1:
            words, axes = "", (words,)
        columns = tuple(axis for axis, known in zip(axes, measured, strict=True) if known)
        unit = _UNITS.get(name, given)
        yield Compared(words, unit, columns, t_ns, values[:, measured], variance[:, measured])


def _diagonal(stated: Array | None, first: int, shape: tuple[int, int]) -> Array:
    """Return the variances of a field from the covariances (n, m * m) that a message states."""
    if stated is None:
        return np.zeros(shape)
    rows = stated.reshape(len(stated), -1)
    size = round(rows.shape[1] ** 0.5)
    return np.maximum(rows[:, :: size + 1][:, first : first + shape[1]], 0.0)


def _numbers(
    path: Path, type_name: str, topic: str, skipped: tuple[str, ...]
) -> tuple[Times, dict[str, Array]]:
    """Return stamps, and all numbers of messages by the names of their fields."""
    if type_name in TYPES:
        names = tuple(
            name for name, kind, _ in fields(type_name) if kind == "f8" and name not in skipped
        )
        found = list(decoded_blocks(path, type_name, topic, names))
        columns = {name: np.concatenate([one.numbers[name] for one in found]) for name in names}
        return np.concatenate([one.t_ns for one in found]), columns
    stamps: list[int] = []
    rows: dict[str, list[Any]] = {}
    # Message by message: types that the package does not write itself are those of slow sensors.
    with open_bag(path) as bag:
        info = bag.topic(type_name, topic)
        types = schemas.typestore([(info.type, info.schema)], bag.encoding)
        decode = types.deserialize_cdr if bag.encoding == "cdr" else types.deserialize_ros1
        for group in bag.groups({info.name}):
            for block in group:
                for payload, recorded in zip(as_list(block.payloads), block.t_ns, strict=True):
                    with errors_naming(path, f" ({info.name})"):
                        message: Any = decode(payload, info.type)
                        stamp = getattr(getattr(message, "header", None), "stamp", None)
                        whole = stamp and stamp_ns(stamp.sec, stamp.nanosec)
                    stamps.append(int(recorded) if whole is None else whole)
                    for name, value in _fields(message):
                        rows.setdefault(name, []).append(value)
    whole_rows = {
        name: np.array(values, dtype=np.float64)
        for name, values in rows.items()
        if len(values) == len(stamps) and len({np.shape(value) for value in values}) == 1
    }
    return np.array(stamps, dtype=np.int64), {k: v for k, v in whole_rows.items() if v.size}


def _fields(message: Any, before: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the names and values of all real numbers in a message."""
    for name in getattr(message, "__dataclass_fields__", ()):
        value = getattr(message, name)
        if isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype.kind == "f"):
            yield before + name, value
        elif name != "header":
            yield from _fields(value, f"{before}{name}.")


def _orientation(path: Path, info: TopicInfo, topics: Sequence[TopicInfo]) -> list[Item]:
    """Return the plots of an orientation, whose truth is that of the body."""
    table = known_tables()["orientation"]
    space = info.name.strip("/").rpartition("imu/")[0]
    truths = [f"{space}{TRUTH}odom", f"{TRUTH}odom"]
    known = [one.name for one in topics if one.type == ODOMETRY and one.name.strip("/") in truths]
    read = read_table(path, table, info.name)
    if not len(read.t_ns) or not known:
        return []
    truth = read_odometry(path, known[0])
    still = np.zeros((len(read.t_ns), 3))
    stated = States(read.t_ns, still, read.values)
    rows = common_rows(stated.t_ns, truth.t_ns)
    stated = stated.rows(rows)
    at_ns = stated.t_ns
    there = poses_at(truth, at_ns)
    variance = np.diagonal(read.covariance[rows], axis1=1, axis2=2)
    error = attitude_errors(stated.q_wb, there.q_wb)
    names = ("roll", "pitch", "yaw")
    angles = [np.rad2deg(rotation.to_euler(one.q_wb)) for one in (stated, there)]
    turns = [Compared("angles", "deg", names, at_ns, one, np.zeros_like(one)) for one in angles]
    name = f"{info.name}: orientation"
    words = f"{_summary(name, error, variance, _AXES, 'rad')}; the truth is that of the body"
    words += without_truth(len(read.t_ns) - len(rows), "readings")
    plots = [_readings(turns[0], turns[1], name, str(path))]
    plots += _error_plots(at_ns, error, variance, tuple(_AXES), name, "rad", str(path))
    return [{"kind": "text", "text": words}, {"kind": "plots", "items": plots}]


def compared(read: Compared, true: Compared | None, topic: str, link: str) -> list[Item]:
    """Return readings with their truth, and their errors in the band of three stated deviations.

    Without a truth, the stated deviations.
    """
    name = topic if read.name in ("", "vector") else f"{topic}: {read.name}"
    t_s = (read.t_ns - read.t_ns[0]) * 1e-9
    link = f"{link} {topic}"
    if true is None:
        sigma = np.sqrt(read.variance)
        rows = extremes(sigma)
        series = [
            {"name": axis, "colour": k, "x": t_s[rows], "y": sigma[rows, k]}
            for k, axis in enumerate(read.columns)
        ]
        title = f"{name}: stated deviation"
        drawn = plot(title, "time [s]", f"[{read.unit}]", series, link=link)
        return [{"kind": "plots", "items": [drawn]}]
    try:
        rows = common_rows(read.t_ns, true.t_ns)
    except InputError as problem:
        return [{"kind": "text", "text": f"{name}: {problem}"}]
    known = [true.columns.index(column) for column in read.columns if column in true.columns]
    there = np.column_stack(
        [np.interp(read.t_ns[rows], true.t_ns, true.values[:, k]) for k in known]
    )
    error, variance = read.values[rows] - there, read.variance[rows]
    plots = [_readings(read, true, name, link)]
    plots += _error_plots(read.t_ns[rows], error, variance, read.columns, name, read.unit, link)
    words = _summary(name, error, variance, read.columns, read.unit)
    words += without_truth(len(read.t_ns) - len(rows), "readings")
    return [
        {"kind": "text", "text": words},
        {"kind": "plots", "items": plots},
    ]


def _readings(read: Compared, true: Compared, name: str, link: str) -> Item:
    """Return the plot of readings over their truth."""
    series: list[Item] = []
    for one, label in ((true, "true "), (read, "")):
        t_s = (one.t_ns - read.t_ns[0]) * 1e-9
        for k, column in enumerate(read.columns):
            values = one.values[:, one.columns.index(column)]
            rows = extremes(values)
            line: Item = {"name": label + column, "x": t_s[rows], "y": values[rows]}
            series.append(line | {"colour": None if label else k, "thin": not label})
            if label:
                series[-1]["unlisted"] = k > 0
                series[-1]["name"] = "truth"
    title = f"{name}: readings and truth"
    return plot(title, "time [s]", f"[{read.unit}]" if read.unit else "", series, link=link)


def _error_plots(
    t_ns: Times,
    error: Array,
    variance: Array,
    columns: Sequence[str],
    name: str,
    unit: str,
    link: str,
) -> list[Item]:
    t_s = (t_ns - t_ns[0]) * 1e-9
    return [
        plot(
            f"{name}: error {column}",
            "time [s]",
            f"[{unit}]" if unit else "",
            error_series(t_s, error[:, k], variance[:, k] if np.any(variance[:, k]) else None, k),
            link=link,
        )
        for k, column in enumerate(columns)
    ]


def _summary(name: str, error: Array, variance: Array, columns: Sequence[str], unit: str) -> str:
    """Return how large errors are, and how many lie within what is stated."""
    sizes = ", ".join(
        f"{size:.3g} {axis}"
        for size, axis in zip(np.sqrt(np.mean(error**2, axis=0)), columns, strict=True)
    )
    words = f"{name}: as read minus true, root mean square [{unit}]: {sizes}"
    stated = (variance > 0.0).all(axis=1)
    if not stated.any():
        return f"{words}; it states no covariance"
    ratio = np.abs(error[stated]) / np.sqrt(variance[stated])
    shares = ", ".join(
        f"{float(np.mean(ratio <= limit)):.1%} within {limit:g} ({usual:.1%})"
        for limit, usual in zip(_INSIDE, _GAUSSIAN, strict=True)
    )
    return f"{words}; stated standard deviations, of a Gaussian in brackets: {shares}"
