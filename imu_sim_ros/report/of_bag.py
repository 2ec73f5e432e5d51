# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recorded bag as the sections of a page."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags import imu_blocks, open_bag
from imu_sim_ros.bags.messages import IMU
from imu_sim_ros.bags.text import imu_names, is_text
from imu_sim_ros.errors import InputError
from imu_sim_ros.inputs import Skipped
from imu_sim_ros.navigation.comparison import (
    absolute_errors,
    anees_band,
    common_rows,
    interpolate_poses,
    nees,
)
from imu_sim_ros.poses import PoseSequence
from imu_sim_ros.report.page import Item, Section, table
from imu_sim_ros.report.streams import Stream, analyse

Array = NDArray[np.float64]

_TRIADS: Final = (("Angular rate", "rad/s"), ("Specific force", "m/s^2"))
_AXES: Final = "xyz"
_MOST_POINTS: Final = 2000
_SIGMAS: Final = 3.0


class Estimate(NamedTuple):
    """A trajectory of a bag: the truth, or an estimate of it."""

    name: str
    poses: PoseSequence
    pose_covariance: Array | None = None
    """(n, 6, 6) position, rotation about the world's axes."""


def bag_sections(
    path: Path,
    truth: Estimate | None,
    estimates: Sequence[Estimate],
    skipped: Skipped | None = None,
) -> list[Section]:
    """Return the sections of a bag, a EuRoC folder or a file of readings.

    :param truth: None: nothing is compared.
    :param skipped: receives the number of bad readings skipped; None: they are errors.
    :raises InputError: for what cannot be read.
    """
    topics = _topics(path)
    items: list[Item] = []
    if topics:
        items.append(table("topics", ["topic", "type", "messages"], topics, search=False))
    for name, count in _imus(path, topics, skipped):
        stream = analyse(imu_blocks(path, name or None, skipped=skipped), count)
        if stream is not None:
            items += _stream_items(name or path.name, stream, f"{path} {name}")
    sections = [Section(f"{path.name}: readings", items)] if items else []
    if truth is not None or estimates:
        sections.append(_paths(path, truth, estimates))
    return sections


def _topics(path: Path) -> list[tuple[str, str, int]]:
    if is_text(path):
        return []
    with open_bag(path) as bag:
        return [(info.name, info.type, info.count) for info in bag.topics]


def _imus(
    path: Path, topics: Sequence[tuple[str, str, int]], skipped: Skipped | None
) -> list[tuple[str, int]]:
    """Return the name of every IMU, empty of a file's only one, and how many readings it has.

    :raises InputError: for a text file that holds no readings, or bad ones.
    """
    if not is_text(path):
        return [(name, count) for name, kind, count in topics if kind == IMU]
    names = imu_names(path) if path.is_dir() else [""]
    uncounted = None if skipped is None else bool  # they are counted when they are analysed
    blocks = ((name, imu_blocks(path, name or None, skipped=uncounted)) for name in names)
    return [(name, sum(len(block.t_ns) for block in found)) for name, found in blocks]


def _stream_items(name: str, stream: Stream, link: str) -> list[Item]:
    rate = 1.0 / stream.interval_s
    words = (
        f"{name}: {stream.samples:,} readings in {stream.duration_s:.6g} s, {rate:.6g} Hz, "
        f"{stream.gap_count} gaps"
    )
    items: list[Item] = [_readings(stream, triad, link) for triad in range(2)]
    items += [_spectrum(stream, triad) for triad in range(2)]
    items += [_allan(stream, triad) for triad in range(2)]
    items.append(_intervals(stream, link))
    result: list[Item] = [{"kind": "text", "text": words}, {"kind": "plots", "items": items}]
    if stream.gaps:
        rows = [[gap.at_s, gap.interval_s, gap.interval_s * rate] for gap in stream.gaps]
        header = ["at [s]", "interval [s]", "in usual intervals"]
        result.append(table(f"gaps of {name}", header, rows, search=False))
    return result


def _plot(title: str, x: str, y: str, series: list[Item], log: str = "", **more: object) -> Item:
    return {
        "kind": "plot",
        "title": title,
        "x": {"label": x, "log": "x" in log},
        "y": {"label": y, "log": "y" in log},
        "series": series,
        **more,
    }


def _readings(stream: Stream, triad: int, link: str) -> Item:
    title, unit = _TRIADS[triad]
    series: list[Item] = []
    for k, axis in enumerate(_AXES):
        low, high = stream.low[:, 3 * triad + k], stream.high[:, 3 * triad + k]
        line = {"name": axis, "colour": k, "x": stream.t_s, "y": 0.5 * (low + high), "thin": True}
        series.append({**line, "low": low, "high": high})
    caption = "Lowest and highest reading of each part of the record, and their middle."
    return _plot(title, "time [s]", f"[{unit}]", series, link=link, caption=caption)


def _spectrum(stream: Stream, triad: int) -> Item:
    title, unit = _TRIADS[triad]
    series = [
        {"name": axis, "colour": k, "x": stream.frequency, "y": stream.density[:, 3 * triad + k]}
        for k, axis in enumerate(_AXES)
    ]
    caption = "Welch's estimate, two-sided: white noise of a density lies at this density."
    label = f"[{unit}/sqrt(Hz)]"
    return _plot(f"{title}: spectrum", "frequency [Hz]", label, series, "xy", caption=caption)


def _allan(stream: Stream, triad: int) -> Item:
    title, unit = _TRIADS[triad]
    found, series = stream.deviation, []
    for k, axis in enumerate(_AXES):
        column = 3 * triad + k
        line: Item = {"name": axis, "colour": k, "x": found.tau, "y": found.deviation[:, column]}
        series.append({**line, "low": found.low[:, column], "high": found.high[:, column]})
    caption = "Overlapping, with its 95 % band; a statement about noise only where the IMU rests."
    label = f"[{unit}]"
    return _plot(
        f"{title}: Allan deviation", "cluster time [s]", label, series, "xy", caption=caption
    )


def _intervals(stream: Stream, link: str) -> Item:
    line = {"name": "", "colour": 0, "x": stream.t_s, "y": 1e3 * stream.longest}
    series = [{**line, "low": 1e3 * stream.shortest, "high": 1e3 * stream.longest}]
    caption = "Shortest and longest interval of each part of the record."
    return _plot(
        "Gaps: intervals between stamps", "time [s]", "[ms]", series, link=link, caption=caption
    )


def _paths(path: Path, truth: Estimate | None, estimates: Sequence[Estimate]) -> Section:
    tracks = [one for one in (truth, *estimates) if one is not None]
    series = []
    for k, one in enumerate(tracks):
        rows = _some(len(one.poses.t_ns))
        x, y, z = one.poses.position[rows].T
        series.append({"name": one.name, "colour": k, "x": x, "y": y, "z": z})
    items: list[Item] = [{"kind": "path", "title": "Path", "series": series}]
    if truth is not None:
        for number, estimate in enumerate(estimates):
            items += _errors(estimate, truth, f"{path} {number}")
    return Section(f"{path.name}: motion", items)


def _errors(estimate: Estimate, truth: Estimate, link: str) -> list[Item]:
    """Return the error of an estimate over time, its band of 3 sigma, and its NEES."""
    try:
        rows = common_rows(estimate.poses.t_ns, truth.poses.t_ns)
    except InputError as error:
        return [{"kind": "text", "text": f"{estimate.name}: {error}"}]
    rows = rows[_some(len(rows))]
    at_ns = estimate.poses.t_ns[rows]
    poses = PoseSequence(at_ns, estimate.poses.position[rows], estimate.poses.q_wb[rows])
    errors = absolute_errors(poses, interpolate_poses(truth.poses, at_ns))
    t_s = (at_ns - at_ns[0]) * 1e-9
    covariance = None if estimate.pose_covariance is None else estimate.pose_covariance[rows]
    known = covariance is not None and bool(np.any(covariance))
    plots = []
    for first, title, unit in ((0, "position", "m"), (3, "attitude", "rad")):
        values = errors.position if first == 0 else errors.attitude
        for k, axis in enumerate(_AXES):
            series: list[Item] = [{"name": "error", "colour": 1, "x": t_s, "y": values[:, k]}]
            if covariance is not None and known:
                variance = np.maximum(covariance[:, first + k, first + k], 0.0)
                sigma = _SIGMAS * np.sqrt(variance)
                band = {"name": "3 sigma", "colour": 0, "x": t_s, "low": -sigma, "high": sigma}
                series.insert(0, band)
            name = f"{estimate.name}: {title} error {axis}"
            plots.append(_plot(name, "time [s]", f"[{unit}]", series, link=link))
    if covariance is not None and known:
        plots.append(
            _nees(estimate.name, t_s, covariance, [errors.position, errors.attitude], link)
        )
    rms = float(np.sqrt(np.mean(np.sum(errors.position**2, axis=1))))
    words = (
        f"{estimate.name}: {rms:.4g} m root mean square, "
        f"{float(np.linalg.norm(errors.position[-1])):.4g} m at the end; truth minus estimate"
        + ("" if known else "; it has no covariance, hence no NEES")
    )
    return [{"kind": "text", "text": words}, {"kind": "plots", "items": plots}]


def _nees(name: str, t_s: Array, covariance: Array, errors: Sequence[Array], link: str) -> Item:
    band = anees_band(3, 1)
    ends = [float(t_s[0]), float(t_s[-1])]
    inside = {"name": "95 % band", "colour": 5, "x": ends, "low": [band.low] * 2}
    series: list[Item] = [{**inside, "high": [band.high] * 2}]
    for k, title in enumerate(("position", "attitude")):
        part = covariance[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        usable = np.linalg.matrix_rank(part, hermitian=True) == 3
        if usable.any():
            values = nees(errors[k][usable], part[usable])
            series.append({"name": title, "colour": k, "x": t_s[usable], "y": values})
    return _plot(f"{name}: NEES", "time [s]", "NEES, 3 expected", series, "y", link=link)


def _some(count: int) -> NDArray[np.intp]:
    """Return evenly spaced rows with the first and the last, as many as a plot can show."""
    return np.unique(np.linspace(0, count - 1, min(count, _MOST_POINTS)).round().astype(np.intp))
