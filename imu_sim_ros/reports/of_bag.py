# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recorded bag as the sections of a page."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros import rotation
from imu_sim_ros.bags.messages.blocks import TopicInfo
from imu_sim_ros.bags.messages.encode import IMU
from imu_sim_ros.bags.read import imu_blocks, open_bag
from imu_sim_ros.bags.text.reader import imu_names, is_text
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs.rows import Skipped
from imu_sim_ros.navigation.comparison import compare
from imu_sim_ros.navigation.evaluation import (
    anees_band,
    gauge_at,
    invertible,
    nees,
)
from imu_sim_ros.records import States, with_fields
from imu_sim_ros.reports.page import Item, Section, table
from imu_sim_ros.reports.streams import StreamPlots, analyse, bias_series, extremes, topic_items
from imu_sim_ros.types import Array

_TRIADS: Final = (("Angular rate", "rad/s"), ("Specific force", "m/s^2"))
_AXES: Final = "xyz"
_TURN_DEG: Final = 300.0
_SIGMAS: Final = 3.0
_LEAST_NEES: Final = 1e-3
"""Below which a picture does not follow it: of a body at rest it may be any small number."""
_MOVED: Final = (
    "in a frame of its own, not that of the truth; moved, and turned about z, so that its first "
    "pose is that of the truth, and compared from there on"
)
NOT_MEASURED: Final = 1e5
"""Variance above which a number is none: odometry of wheels states 1e6 of its height."""


def bag_sections(
    path: Path,
    truth: States | None,
    estimates: Sequence[States],
    skipped: Skipped | None = None,
) -> list[Section]:
    """Return the sections of a bag, a EuRoC folder or a file of readings.

    :param truth: None: nothing is compared.
    :param skipped: receives the number of bad readings skipped; None: they are errors.
    :raises InputError: for what cannot be read.
    """
    topics = _topics(path)
    items = topic_items(path, topics) if topics else []
    biases = [
        plot(title, "time [s]", f"[{unit}]" if unit else "", series, link=f"{path} bias")
        for title, unit, series in bias_series(path, topics)
    ]
    for name, count in _imus(path, topics, skipped):
        stream = analyse(imu_blocks(path, name or None, skipped=skipped), count)
        if stream is not None:
            items += _stream_items(name or path.name, stream, f"{path} {name}")
    if biases:
        items.append({"kind": "plots", "items": biases})
    sections = [Section(f"{path.name}: readings", items)] if items else []
    if truth is not None or estimates:
        sections.append(motion(path, truth, estimates))
    return sections


def _topics(path: Path) -> list[TopicInfo]:
    if is_text(path):
        return []
    with open_bag(path) as bag:
        return bag.topics


def _imus(
    path: Path, topics: Sequence[TopicInfo], skipped: Skipped | None
) -> list[tuple[str, int]]:
    """Return the name of every IMU, empty of a file's only one, and how many readings it has.

    :raises InputError: for a text file that contains no readings, or bad ones.
    """
    if not is_text(path):
        return [(topic.name, topic.count) for topic in topics if topic.type == IMU]
    names = imu_names(path) if path.is_dir() else [""]
    uncounted = None if skipped is None else bool  # they are counted when they are analysed
    blocks = ((name, imu_blocks(path, name or None, skipped=uncounted)) for name in names)
    return [(name, sum(len(block.t_ns) for block in found)) for name, found in blocks]


def _stream_items(name: str, stream: StreamPlots, link: str) -> list[Item]:
    rate = 1.0 / stream.interval_s
    words = (
        f"{name}: {stream.samples:,} readings in {stream.duration_s:.6g} s, {rate:.6g} Hz, "
        f"{stream.gap_count} gaps"
    )
    items: list[Item] = [_readings(stream, triad, link) for triad in range(2)]
    items += [_spectrum(stream, triad) for triad in range(2)]
    items += [_allan(stream, triad) for triad in range(2)]
    items.append(_intervals(stream, link))
    result: list[Item] = [{"kind": "heading", "text": words}, {"kind": "plots", "items": items}]
    if stream.gaps:
        rows = [[gap.at_s, gap.interval_s, gap.interval_s * rate] for gap in stream.gaps]
        header = ["at [s]", "interval [s]", "in usual intervals"]
        result.append(table(f"gaps of {name}", header, rows, search=False))
    return result


def plot(title: str, x: str, y: str, series: list[Item], log: str = "", **more: object) -> Item:
    """Return a plot.

    :param x: the label of its axis; likewise ``y``.
    :param log: the axes that are logarithmic, of "xy".
    """
    return {
        "kind": "plot",
        "title": title,
        "x": {"label": x, "log": "x" in log},
        "y": {"label": y, "log": "y" in log},
        "series": series,
        **more,
    }


def _readings(stream: StreamPlots, triad: int, link: str) -> Item:
    title, unit = _TRIADS[triad]
    series: list[Item] = []
    for k, axis in enumerate(_AXES):
        low, high = stream.low[:, 3 * triad + k], stream.high[:, 3 * triad + k]
        line = {"name": axis, "colour": k, "x": stream.t_s, "y": 0.5 * (low + high), "thin": True}
        series.append({**line, "low": low, "high": high})
    caption = "Lowest and highest reading of each part of the record, and their middle."
    return plot(title, "time [s]", f"[{unit}]", series, link=link, caption=caption)


def _spectrum(stream: StreamPlots, triad: int) -> Item:
    title, unit = _TRIADS[triad]
    series = [
        {"name": axis, "colour": k, "x": stream.frequency, "y": stream.density[:, 3 * triad + k]}
        for k, axis in enumerate(_AXES)
    ]
    caption = "Welch's estimate, two-sided: white noise appears at its density."
    label = f"[{unit}/sqrt(Hz)]"
    return plot(f"{title}: spectrum", "frequency [Hz]", label, series, "xy", caption=caption)


def _allan(stream: StreamPlots, triad: int) -> Item:
    title, unit = _TRIADS[triad]
    found, series = stream.deviation, []
    for k, axis in enumerate(_AXES):
        column = 3 * triad + k
        line: Item = {"name": axis, "colour": k, "x": found.tau, "y": found.deviation[:, column]}
        series.append({**line, "low": found.low[:, column], "high": found.high[:, column]})
    caption = "Overlapping, with its 95 % band; valid for noise only if the IMU is at rest."
    label = f"[{unit}]"
    return plot(
        f"{title}: Allan deviation", "cluster time [s]", label, series, "xy", caption=caption
    )


def _intervals(stream: StreamPlots, link: str) -> Item:
    line = {"name": "", "colour": 0, "x": stream.t_s, "y": 1e3 * stream.longest}
    series = [{**line, "low": 1e3 * stream.shortest, "high": 1e3 * stream.longest}]
    caption = "Shortest and longest interval of each part of the record."
    return plot(
        "Gaps: intervals between stamps", "time [s]", "[ms]", series, link=link, caption=caption
    )


def motion(
    path: Path, truth: States | None, estimates: Sequence[States], title: str = "motion"
) -> Section:
    """Return the section of a truth and estimates of it.

    An estimate in another frame, such as that of odometry, begins at the truth.
    """
    placed = [one if truth is None else _placed(one, truth) for one in estimates]
    moved = [one.source for one, given in zip(placed, estimates, strict=True) if one is not given]
    estimates = placed
    tracks = [one for one in (truth, *estimates) if one is not None]
    series = []
    # An estimate has one colour in all plots, the truth that of words.
    colours = [*([None] if truth is not None else []), *range(len(estimates))]
    for colour, one in zip(colours, tracks, strict=True):
        x, y, z = one.position[extremes(one.position)].T
        series.append({"name": one.source, "colour": colour, "x": x, "y": y, "z": z})
    items: list[Item] = [{"kind": "path", "title": "Path", "series": series}]
    if truth is not None and moved:
        items.insert(0, {"kind": "text", "text": f"{', '.join(moved)}: {_MOVED}"})
    first_ns = min(int(one.t_ns[0]) for one in tracks)
    items.append(
        {"kind": "plots", "items": _orientation(tracks, colours, first_ns, f"{path} {title}")}
    )
    if truth is not None:
        for number, estimate in enumerate(estimates):
            items += _errors(estimate, truth, f"{path} {title} {number}", number)
    return Section(f"{path.name}: {title}", items)


def _placed(estimate: States, truth: States) -> States:
    """Return an estimate in the truth's frame: as it is, or moved to the truth at its first pose.

    Moved and turned about z; without the poses that the truth does not cover.
    """
    if not (estimate.frame_id and truth.frame_id) or estimate.frame_id == truth.frame_id:
        return estimate
    try:
        errors = compare(estimate, truth)
    except InputError:  # said where they are compared
        return estimate
    poses = errors.unaligned
    gauge = gauge_at(poses, errors.truth)
    covariance = poses.covariance
    if covariance is not None:
        turn = np.kron(np.eye(2), gauge.r)
        covariance = turn @ covariance @ turn.T
    return with_fields(gauge.apply(poses), covariance=covariance, frame_id=truth.frame_id)


def _orientation(
    tracks: Sequence[States], colours: Sequence[int | None], first_ns: int, link: str
) -> list[Item]:
    """Return roll, pitch and yaw of every trajectory over the time since the first pose."""
    drawn: list[list[Item]] = [[], [], []]
    for colour, one in zip(colours, tracks, strict=True):
        angles = np.rad2deg(rotation.to_euler(one.q_wb))
        t_s = (one.t_ns - first_ns) * 1e-9
        for k in range(3):
            rows = extremes(angles[:, k])
            values = angles[rows, k]
            # A turn through 180 deg is a step of the angle, not a motion: the line is interrupted.
            values[1:][np.abs(np.diff(values)) > _TURN_DEG] = np.nan
            line = {"name": one.source, "colour": colour, "x": t_s[rows], "y": values, "thin": True}
            drawn[k].append(line)
    names = ("roll", "pitch", "yaw")
    link = f"{link} orientation"
    return [
        plot(f"Orientation: {name}", "time [s]", "[deg]", series, link=link, legend=True)
        for name, series in zip(names, drawn, strict=True)
    ]


def _errors(estimate: States, truth: States, link: str, colour: int) -> list[Item]:
    """Return the error of an estimate over time, its band of 3 sigma, and its NEES.

    Numbers are of all poses; a picture has the extremes of each of its columns.
    """
    try:
        errors = compare(estimate, truth)
    except InputError as error:
        return [{"kind": "text", "text": f"{estimate.source}: {error}"}]
    t_s = (errors.t_ns - errors.t_ns[0]) * 1e-9
    covariance = errors.unaligned.covariance
    if covariance is not None and not np.any(covariance):
        covariance = None
    plots = []
    for first, title, unit in ((0, "position", "m"), (3, "attitude", "rad")):
        values = errors.position if first == 0 else errors.attitude
        for k, axis in enumerate(_AXES):
            variance = None if covariance is None else covariance[:, first + k, first + k]
            if variance is not None and variance.min() >= NOT_MEASURED:
                continue
            series = error_series(t_s, values[:, k], variance, colour)
            name = f"{estimate.source}: {title} error {axis}"
            plots.append(plot(name, "time [s]", f"[{unit}]", series, link=link))
    size = np.linalg.norm(errors.position, axis=1)
    worst = int(np.argmax(size))
    words = (
        f"{estimate.source}: {float(np.sqrt(np.mean(size**2))):.4g} m root mean square over "
        f"{len(size):,} poses, {size[-1]:.4g} m at the end, at most {size[worst]:.4g} m "
        f"(at {t_s[worst]:.6g} s); estimate minus truth; "
        f"{errors.coverage.words()} of the truth's time"
        f"{without_truth(errors.without_truth, 'poses')}"
    )
    if covariance is None:
        words += "; it has no covariance, hence no NEES"
    else:
        summary, drawn = _nees(
            estimate.source, t_s, covariance, [errors.position, errors.attitude], link
        )
        words += summary
        plots.append(drawn)
    return [{"kind": "text", "text": words}, {"kind": "plots", "items": plots}]


def without_truth(count: int, what: str) -> str:
    """Return in words how many poses or readings no number is about, for the end of a phrase."""
    return f"; {count:,} {what} without a truth are left out" if count else ""


def error_series(t_s: Array, values: Array, variance: Array | None, colour: int) -> list[Item]:
    """Return the lines of errors (n,) and of the band of three stated deviations, in one colour."""
    rows = extremes(values)
    series: list[Item] = [{"name": "error", "colour": colour, "x": t_s[rows], "y": values[rows]}]
    if variance is not None:
        known = np.where(variance[rows] < NOT_MEASURED, variance[rows], np.nan)
        sigma = _SIGMAS * np.sqrt(np.maximum(known, 0.0))
        band = {"name": "3 sigma", "colour": colour, "x": t_s[rows], "low": -sigma, "high": sigma}
        series.insert(0, band)
    return series


def _nees(
    name: str, t_s: Array, covariance: Array, errors: Sequence[Array], link: str
) -> tuple[str, Item]:
    """Return the mean NEES in words, and its plot."""
    band = anees_band(3, 1)
    ends = [float(t_s[0]), float(t_s[-1])]
    inside = {"name": "95 % band", "colour": 5, "x": ends, "low": [band.low] * 2}
    series: list[Item] = [{**inside, "high": [band.high] * 2}]
    summary = ""
    for k, title in enumerate(("position", "attitude")):
        part = covariance[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        own = np.flatnonzero((part[:, range(3), range(3)] < NOT_MEASURED).any(axis=0))
        part = part[:, own[:, None], own]
        usable = invertible(part) if len(own) else np.zeros(len(part), np.bool_)
        usable &= (np.diagonal(part, axis1=1, axis2=2) < NOT_MEASURED).all(axis=1)
        if usable.any():
            values, at_s = nees(errors[k][usable][:, own], part[usable]), t_s[usable]
            rows = extremes(values)
            drawn = np.maximum(values[rows], _LEAST_NEES)
            series.append({"name": title, "colour": k, "x": at_s[rows], "y": drawn})
            summary += (
                f"; mean NEES of the {title} {float(np.mean(values)):.4g} ({len(own)} expected)"
            )
            if not usable.all():
                summary += f" over the {int(usable.sum()):,} poses that state one"
    return summary, plot(f"{name}: NEES", "time [s]", "NEES, 3 expected", series, "y", link=link)
