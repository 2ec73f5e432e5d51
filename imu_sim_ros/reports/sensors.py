# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings of the sensors of a bag against their truth, errors against stated deviations.

A topic is compared with the topic of its truth, which has the same type and a name that begins
with ``ground_truth/``; an orientation with that of the body. All numbers of a message are drawn.
Every error is measured minus true.
"""

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.messages import schemas
from imu_sim_ros.bags.messages.blocks import TopicInfo, as_list
from imu_sim_ros.bags.messages.encode import IMU, NAV_SAT_FIX, ODOMETRY
from imu_sim_ros.bags.messages.encode_cameras import POINT_CLOUD2
from imu_sim_ros.bags.messages.layouts import TYPES, fields
from imu_sim_ros.bags.messages.schemas import Message
from imu_sim_ros.bags.read import decode_blocks, open_bag
from imu_sim_ros.bags.reader import errors_naming
from imu_sim_ros.bags.sensor_tables import read_table
from imu_sim_ros.core import rotation
from imu_sim_ros.core.conventions import AXES
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.gate import stamp_ns
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Array, Keywords, Times, field_values
from imu_sim_ros.formats.door import read_states
from imu_sim_ros.navigation.association import common_rows, poses_at
from imu_sim_ros.navigation.evaluation import attitude_errors
from imu_sim_ros.reports.estimates import NOT_MEASURED, error_series, uncovered_count_text
from imu_sim_ros.reports.page import Item, Section, plot
from imu_sim_ros.reports.streams import extreme_rows
from imu_sim_ros.sensors import reading_tables

TRUTH: Final = "ground_truth/"
_MAX_COLUMNS: Final = 6
"""Largest number of columns of a quantity that are drawn."""
_SIGMAS: Final = (1.0, 2.0, 3.0)
"""Stated deviations within which the share of errors is written."""
_GAUSSIAN: Final = (0.683, 0.954, 0.997)
"""Shares of Gaussian errors within them."""
_UNITS: Final = {
    "linear": "m/s",
    "angular": "rad/s",
    "magnetic_field": "T",
    "fluid_pressure": "Pa",
    "temperature": "degC",
    "position": "rad",
    "velocity": "rad/s",
}
"""Units of message fields; position and velocity are those of joints."""
_STATED: Final = {
    "linear": ("twist_covariance", 0),
    "angular": ("twist_covariance", 3),
    "fluid_pressure": ("variance", 0),
    "temperature": ("variance", 0),
}
"""Field with the variance of another field, and its row there; by default ``NAME_covariance``."""
_JOINTS: Final = "sensor_msgs/msg/JointState"
_AXIS_OF: Final = {
    **{axis: axis for axis in AXES},
    **dict(zip(("east", "north", "up"), AXES, strict=True)),
    **dict(zip(("roll", "pitch", "yaw"), AXES, strict=True)),
}
"""Axis along or about which a column lies; it gives the column its colour."""


class MeasuredQuantity(NamedTuple):
    """n values of one quantity, measured or true."""

    name: str
    unit: str
    columns: tuple[str, ...]
    """Names of the k columns."""
    t_ns: Times
    values: Array
    """(n, k) values."""
    variance: Array
    """(n, k) stated variances; 0: unknown."""


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
            measured = _quantities(path, info)
            for quantity, truth in zip(measured, _quantities(path, info, true_name), strict=False):
                items += comparison(quantity, truth, info.name, str(path))
        if items:
            title = f"{info.name}{' (twist)' if info.type == ODOMETRY else ''}"
            sections.append(Section(f"{path.name}: {title}", items, title))
    return sections


def truth_of(info: TopicInfo, topics: Sequence[TopicInfo]) -> str | None:
    """Return the topic of the truth in the same namespace.

    Of gps/fix it is ground_truth/gps_fix, of imu/mag ground_truth/mag, of sonar/beam
    ground_truth/sonar.
    """
    *prefix, group, name = ["", *info.name.strip("/").split("/")][-3:]
    truths = [f"{group}_{name}" if group else name]
    if info.type != ODOMETRY:  # ground_truth/odom is that of the body, not of a filter/odom
        truths += [name, group]
    namespace = "/".join(filter(None, prefix))
    candidates = [f"{namespace}/{TRUTH}{truth}".strip("/") for truth in truths if truth]
    present = {topic.name.strip("/"): topic.name for topic in topics if topic.type == info.type}
    return next((present[name] for name in candidates if name in present), None)


def _quantities(
    path: Path, info: TopicInfo, topic: str | None = None
) -> Iterator[MeasuredQuantity]:
    """Yield the numbers of a topic's messages by field, without those of poses.

    :param topic: another topic of the same type; None: the topic itself.
    """
    excluded = ("position", "orientation", "pose_covariance") if info.type == ODOMETRY else ()
    t_ns, numbers = _numbers(path, info.type, topic or info.name, excluded)
    joints = _joint_names(path, info) if info.type == _JOINTS else ()
    units = {table.topic: table.quantity.unit for table in reading_tables().values()}
    unit = next((unit for name, unit in units.items() if info.name.strip("/").endswith(name)), "")
    for name, values in numbers.items():
        if name.endswith("variance"):  # covariance, too
            continue
        values = values.reshape(len(t_ns), -1)[:, :_MAX_COLUMNS]
        field, row = _STATED.get(name, (f"{name}_covariance", 0))
        variance = _diagonal(numbers.get(field), row, values.shape)
        measured = np.atleast_1d((variance < NOT_MEASURED).all(axis=0))
        label, count = name.replace("_", " "), values.shape[1]
        columns = AXES if count == 3 else tuple(map(str, range(count)))
        if len(joints) >= count:
            columns = joints[:count]
        elif count == 1:
            label, columns = "", (label,)
        columns = tuple(itertools.compress(columns, measured))
        unit_of_field = _UNITS.get(name, unit)
        yield MeasuredQuantity(
            label, unit_of_field, columns, t_ns, values[:, measured], variance[:, measured]
        )


def _joint_names(path: Path, info: TopicInfo) -> tuple[str, ...]:
    """Return the names of the joints in the first message of a topic."""
    with open_bag(path) as bag:
        decode = schemas.decoder([(info.type, info.schema)], bag.encoding)
        for group in bag.groups({info.name}):
            for block in group:
                for payload in as_list(block.payloads[:1]):
                    with errors_naming(path, f" ({info.name})"):
                        message = decode(payload, info.type)
                    return tuple(map(str, message.name))
    return ()


def _diagonal(stated: Array | None, row: int, shape: tuple[int, int]) -> Array:
    """Return the variances of a field from the covariances (n, m * m) that a message states."""
    if stated is None:
        return np.zeros(shape)
    covariances = stated.reshape(len(stated), -1)
    size = round(covariances.shape[1] ** 0.5)
    return np.maximum(covariances[:, :: size + 1][:, row : row + shape[1]], 0.0)


def _numbers(
    path: Path, type_name: str, topic: str, excluded: tuple[str, ...]
) -> tuple[Times, dict[str, Array]]:
    """Return the stamps (n,) [ns] of a topic, and its numbers (n, ...) by the names of fields.

    :param excluded: fields that are not needed.
    """
    if type_name in TYPES:
        return _numbers_of_blocks(path, type_name, topic, excluded)
    return _numbers_of_messages(path, type_name, topic)


def _numbers_of_blocks(
    path: Path, type_name: str, topic: str, excluded: tuple[str, ...]
) -> tuple[Times, dict[str, Array]]:
    """Return stamps and numbers, as :func:`_numbers`, of a type that is decoded in blocks."""
    names = tuple(
        name for name, kind, _ in fields(type_name) if kind == "f8" and name not in excluded
    )
    blocks = list(decode_blocks(path, type_name, topic, names))
    columns = {name: np.concatenate([block.numbers[name] for block in blocks]) for name in names}
    return np.concatenate([block.t_ns for block in blocks]), columns


def _numbers_of_messages(path: Path, type_name: str, topic: str) -> tuple[Times, dict[str, Array]]:
    """Return stamps and numbers, as :func:`_numbers`, of any type, message by message.

    Types that are not decoded in blocks are those of slow sensors. A message without a stamp has
    its record time. Fields that not all messages have in the same shape are left out.
    """
    stamps: list[int] = []
    rows: dict[str, list[float | Array]] = {}
    with open_bag(path) as bag:
        info = bag.topic(type_name, topic)
        decode = schemas.decoder([(info.type, info.schema)], bag.encoding)
        for group in bag.groups({info.name}):
            for block in group:
                for payload, record_ns in zip(as_list(block.payloads), block.t_ns, strict=True):
                    with errors_naming(path, f" ({info.name})"):
                        message = decode(payload, info.type)
                        stamp = message.header.stamp if hasattr(message, "header") else None
                        t_ns = stamp and stamp_ns(stamp.sec, stamp.nanosec)
                    stamps.append(int(record_ns) if t_ns is None else t_ns)
                    for name, value in _fields(message):
                        rows.setdefault(name, []).append(value)
    arrays = {
        name: np.array(values, dtype=np.float64)
        for name, values in rows.items()
        if len(values) == len(stamps) and len({np.shape(value) for value in values}) == 1
    }
    return np.array(stamps, dtype=np.int64), {
        name: array for name, array in arrays.items() if array.size
    }


def _values(message: Message) -> Keywords:
    """Return the values of a message's fields; those of a number or a text are none."""
    return field_values(message) if hasattr(message, "__dataclass_fields__") else {}


def _fields(message: Message, prefix: str = "") -> Iterator[tuple[str, float | Array]]:
    """Yield the names and values of all real numbers in a message."""
    for name, value in _values(message).items():
        if isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype.kind == "f"):
            yield prefix + name, value
        elif name != "header":
            yield from _fields(value, f"{prefix}{name}.")


def _orientation(path: Path, info: TopicInfo, topics: Sequence[TopicInfo]) -> list[Item]:
    """Return the plots of an orientation, whose truth is that of the body."""
    table = reading_tables()["orientation"]
    namespace = info.name.strip("/").rpartition("imu/")[0]
    candidates = [f"{namespace}{TRUTH}odom", f"{TRUTH}odom"]
    truths = [
        topic.name
        for topic in topics
        if topic.type == ODOMETRY and topic.name.strip("/") in candidates
    ]
    readings = read_table(path, table, info.name)
    if not len(readings.t_ns) or not truths:
        return []
    truth = read_states(path, truths[0])
    origin = np.zeros((len(readings.t_ns), 3))
    rows = common_rows(readings.t_ns, truth.t_ns)
    measured = States(readings.t_ns, origin, readings.values).rows(rows)
    t_ns = measured.t_ns
    true = poses_at(truth, t_ns)
    variance = np.diagonal(readings.covariance[rows], axis1=1, axis2=2)
    error = attitude_errors(measured.q_wb, true.q_wb)
    names = ("roll", "pitch", "yaw")
    angles = [np.rad2deg(rotation.to_euler(q_wb)) for q_wb in (measured.q_wb, true.q_wb)]
    turns = [
        MeasuredQuantity("angles", "deg", names, t_ns, angle, np.zeros_like(angle))
        for angle in angles
    ]
    name = f"{info.name}: orientation"
    text = f"{_summary(name, error, variance, AXES, 'rad')}; the truth is that of the body"
    text += uncovered_count_text(len(readings.t_ns) - len(rows), "readings")
    plots = [_readings(turns[0], turns[1], name, str(path))]
    plots += _error_plots(t_ns, error, variance, AXES, name, "rad", str(path))
    return [{"kind": "text", "text": text}, {"kind": "plots", "items": plots}]


def comparison(
    measured: MeasuredQuantity, truth: MeasuredQuantity | None, topic: str, link: str
) -> list[Item]:
    """Return readings with their truth, and their errors in the band of three stated deviations.

    :param truth: truth of the readings; None: only the stated deviations are drawn.
    """
    name = topic if measured.name in ("", "vector") else f"{topic}: {measured.name}"
    t_s = (measured.t_ns - measured.t_ns[0]) * 1e-9
    link = f"{link} {topic}"
    if truth is None:
        sigma = np.sqrt(measured.variance)
        rows = extreme_rows(sigma)
        series = [
            {
                "name": column,
                "colour": column_colour(column, k),
                "x": t_s[rows],
                "y": sigma[rows, k],
            }
            for k, column in enumerate(measured.columns)
        ]
        title, label = f"{name}: stated deviation", f"sigma [{measured.unit}]"
        item = plot(title, "time [s]", label, series, link=link, legend=True)
        return [{"kind": "plots", "items": [item]}]
    try:
        rows = common_rows(measured.t_ns, truth.t_ns)
    except InputError as problem:
        return [{"kind": "text", "text": f"{name}: {problem}"}]
    t_ns = measured.t_ns[rows]
    true = np.column_stack(
        [
            np.interp(t_ns, truth.t_ns, truth.values[:, truth.columns.index(column)])
            for column in measured.columns
            if column in truth.columns
        ]
    )
    error, variance = measured.values[rows] - true, measured.variance[rows]
    plots = [_readings(measured, truth, name, link)]
    plots += _error_plots(t_ns, error, variance, measured.columns, name, measured.unit, link)
    text = _summary(name, error, variance, measured.columns, measured.unit)
    text += uncovered_count_text(len(measured.t_ns) - len(rows), "readings")
    return [{"kind": "text", "text": text}, {"kind": "plots", "items": plots}]


def column_colour(column: str, number: int) -> str | int:
    """Return the colour of a column: that of its axis, or one by its number."""
    return _AXIS_OF.get(column, number)


def _readings(measured: MeasuredQuantity, truth: MeasuredQuantity, name: str, link: str) -> Item:
    """Return the plot of readings with their truth, a thin line of the colour of text."""
    series: list[Item] = []
    for k, column in enumerate(measured.columns):
        for quantity in (measured, truth):
            t_s = (quantity.t_ns - measured.t_ns[0]) * 1e-9
            values = quantity.values[:, quantity.columns.index(column)]
            rows = extreme_rows(values)
            series.append({"name": column, "x": t_s[rows], "y": values[rows]})
            series[-1]["colour"] = column_colour(column, k)
            if quantity is truth:
                series[-1] |= {"name": "truth", "colour": None, "thin": True, "unlisted": k > 0}
    series.sort(key=lambda line: bool(line.get("thin")))  # the truth lies over the readings
    title = f"{name}: readings and truth"
    label = f"[{measured.unit}]" if measured.unit else ""
    return plot(title, "time [s]", label, series, link=link, legend=True)


def _error_plots(
    t_ns: Times,
    error: Array,
    variance: Array,
    columns: Sequence[str],
    name: str,
    unit: str,
    link: str,
) -> list[Item]:
    """Return a plot for each column: measured minus true, with its stated deviation."""
    t_s = (t_ns - t_ns[0]) * 1e-9
    label = "measured - true" + (f" [{unit}]" if unit else "")
    plots = []
    for k, column in enumerate(columns):
        stated = variance[:, k] if np.any(variance[:, k]) else None
        series = error_series(t_s, error[:, k], stated, column_colour(column, k))
        title = f"{name}: error {column}"
        plots.append(plot(title, "time [s]", label, series, link=link, legend=len(series) > 1))
    return plots


def _summary(name: str, error: Array, variance: Array, columns: Sequence[str], unit: str) -> str:
    """Return the size of errors, and their shares within the stated deviations."""
    sizes = ", ".join(
        f"{size:.3g} {column}"
        for size, column in zip(np.sqrt(np.mean(error**2, axis=0)), columns, strict=True)
    )
    text = f"{name}: RMS error (measured - true) [{unit}]: {sizes}"
    stated = (variance > 0.0).all(axis=1)
    if not stated.any():
        return f"{text}; no covariance is stated"
    ratio = np.abs(error[stated]) / np.sqrt(variance[stated])
    shares = ", ".join(
        f"{float(np.mean(ratio <= sigmas)):.1%} within {sigmas:g} sigma ({gaussian:.1%})"
        for sigmas, gaussian in zip(_SIGMAS, _GAUSSIAN, strict=True)
    )
    return f"{text}; within the stated deviations, of a Gaussian in brackets: {shares}"
