# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Clouds of a bag as sections of a page: scans from above, how many points, and how far."""

import base64
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.bags.clouds import measured_cloud_topics, read_clouds
from imu_sim_ros.bags.messages.blocks import TopicInfo
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.core.errors import ImuSimError, InputError
from imu_sim_ros.core.types import AnyArray, Array, Bytes
from imu_sim_ros.recordings.clock import estimate_clock
from imu_sim_ros.reports.page import Item, Section, plot
from imu_sim_ros.reports.sensors import truth_of
from imu_sim_ros.reports.streams import curve
from imu_sim_ros.sensors.camera.images.files import png

_PICTURES: Final = 3
"""Number of clouds that are shown."""
_PIXELS: Final = 360
"""Width of a picture."""
_WITHIN: Final = 0.9
"""Share of the points that pictures show: the farthest few would make the others a dot."""
_BINS: Final = 120
"""Number of bins of the histogram of ranges."""
_KINDS: Final = ("of several surfaces", "of rain or dust", "of what moves")
_GROUND: Final = 24
"""Grey value of the background."""
_DARKEST: Final = 90
"""Grey values of no point, and of the faintest point."""


def cloud_sections(path: Path) -> list[Section]:
    """Return a section for each topic of clouds in a bag that is no truth; [] without any.

    :raises InputError: for what cannot be read.
    """
    sections = []
    with open_bag(path) as bag:
        topics = [info for info in bag.topics if info.count]
    for name in measured_cloud_topics(path):
        info = next(topic for topic in topics if topic.name == name)
        try:
            items = _items(path, info, topics)
        except ImuSimError as error:  # of other people's bags: what cannot be read is said
            items = [{"kind": "text", "text": f"{name}: {error}"}]
        sections.append(Section(f"{path.name}: {name}", items, name))
    return sections


class _CloudStatistics:
    """Points of the clouds of a topic, and some of its scans."""

    def __init__(self, count: int) -> None:
        """Initialise without clouds.

        :param count: clouds of the topic; some at even distances are kept as scans.
        """
        self._pictured = set(np.linspace(0, count - 1, _PICTURES).round().astype(int).tolist())
        self.stamps: list[int] = []
        """Stamps of the clouds [ns]."""
        self.counts: list[int] = []
        """Points of each cloud that are finite."""
        self.scans: list[tuple[int, Array, AnyArray]] = []
        """Stamp, positions (k, 3) [m] and points (k,) of the scans that are drawn."""
        self.histogram: Array = np.zeros(_BINS)
        """Points by their range."""
        self.edges: Array = np.linspace(0.0, 1.0, _BINS + 1)
        """Ranges between which the points of ``histogram`` are counted [m]."""

    def add(self, t_ns: int, points: AnyArray) -> None:
        """Count the points (k,) of the next cloud."""
        positions = np.stack([points[axis] for axis in "xyz"], axis=1)
        finite = np.isfinite(positions).all(axis=1)
        ranges = np.sqrt((positions[finite].astype(np.float64) ** 2).sum(axis=1))
        if len(self.stamps) in self._pictured:
            self.scans.append((t_ns, positions[finite], points[finite]))
        self.stamps.append(t_ns)
        self.counts.append(len(ranges))
        while len(ranges) and ranges.max() > self.edges[-1]:  # bins of twice the width
            pairs = self.histogram.reshape(-1, 2).sum(axis=1)
            self.histogram = np.append(pairs, np.zeros(_BINS // 2))
            self.edges *= 2.0
        self.histogram += np.histogram(ranges, self.edges)[0]

    def text(self) -> str:
        """Return the number of clouds, their rate and their points as text."""
        text = f"{len(self.stamps):,} scans"
        with suppress(InputError):  # fewer than two different stamps
            clock = estimate_clock(np.array(self.stamps, dtype=np.int64))
            text += f", {clock.rate:.6g} Hz, {clock.lost:,} missing between others"
        counts: Array = np.array(self.counts, dtype=np.float64)
        return (
            f"{text}; {counts.mean():,.0f} points in a scan on average, {counts.min():,.0f} to "
            f"{counts.max():,.0f}"
        )


def _items(path: Path, info: TopicInfo, topics: list[TopicInfo]) -> list[Item]:
    """Return the plots of a topic of clouds, and some of its scans."""
    statistics = _CloudStatistics(info.count)
    for t_ns, points in read_clouds(path, info.name):
        statistics.add(t_ns, points)
    if not statistics.stamps:
        return [{"kind": "text", "text": f"{info.name}: no scans"}]
    first_ns = statistics.stamps[0]
    t_s = (np.array(statistics.stamps) - first_ns) * 1e-9
    text = f"{info.name}: {statistics.text()}"
    counts: Array = np.array(statistics.counts, dtype=np.float64)
    plots = [
        plot(f"{info.name}: points in a scan", "time [s]", "", [curve("", 0, t_s, counts)]),
        _ranges(info.name, statistics.histogram, statistics.edges),
    ]
    true_name = truth_of(info, topics)
    if true_name is not None:
        truth = _truth(path, true_name)
        if truth.error_m is not None:
            text += f"; RMS error of the ranges (measured - true): {truth.error_m:.3g} m"
        plots += _truth_plots(info.name, truth)
    for item in plots:
        if item["x"]["label"] == "time [s]":
            item["link"] = f"{path} {info.name}"
    return [
        {"kind": "text", "text": text},
        *_pictures(info.name, statistics.scans, first_ns),
        {"kind": "plots", "items": plots},
    ]


class _Truth(NamedTuple):
    """Number of points by their true kind, and errors of the ranges, of a topic of clouds."""

    counts: dict[str, tuple[Array, Array]]
    """Times (n,) [s] and numbers of points (n,) of each scan by their kind."""
    errors: tuple[Array, Array]
    """Times (n,) [s] and root mean squares (n,) of the errors of a scan's ranges [m]."""
    error_m: float | None
    """Root mean square of all [m]; None: the truth has no errors of ranges."""


def _truth(path: Path, name: str) -> _Truth:
    """Return the number of points by true kind, and the RMS range error, of each scan."""
    stamps, counts, squares = [], [], []
    for t_ns, points in read_clouds(path, name):
        names = points.dtype.names or ()
        stamps.append(t_ns)
        outcome = points["outcome"] if "outcome" in names else np.zeros(len(points))
        body = points["body"] if "body" in names else np.zeros(len(points))
        counts.append([*((outcome == k).sum() for k in (1, 2)), (body > 0).sum()])
        error = points["range_error"] if "range_error" in names else np.full(len(points), np.nan)
        compared = np.isfinite(error) & (outcome == 0)
        squares.append([(error[compared].astype(np.float64) ** 2).sum(), compared.sum()])
    t_s: Array = (np.array(stamps) - stamps[0]) * 1e-9
    numbers, sums = np.array(counts, np.float64), np.array(squares, np.float64)
    counts_of_kinds = {
        title: (t_s, numbers[:, k]) for k, title in enumerate(_KINDS) if numbers[:, k].any()
    }
    errors = np.sqrt(sums[:, 0] / np.maximum(sums[:, 1], 1.0))
    total = sums.sum(axis=0)
    return _Truth(
        counts_of_kinds, (t_s, errors), float(np.sqrt(total[0] / total[1])) if total[1] else None
    )


def _truth_plots(name: str, truth: _Truth) -> Iterator[Item]:
    """Yield the plots of the errors of ranges, and of the points that are not of one surface.

    :param name: topic of the clouds.
    """
    if truth.error_m is not None:
        title = f"{name}: RMS error of the ranges in each scan"
        errors = plot(title, "time [s]", "[m]", [curve("", 0, *truth.errors)])
        yield errors | {"caption": "Of points of one surface."}
    lines = [curve(kind, k, *series) for k, (kind, series) in enumerate(truth.counts.items())]
    if lines:
        title = f"{name}: points that are not of one surface at rest"
        yield plot(title, "time [s]", "", lines, legend=True)


def _ranges(name: str, histogram: Array, edges: Array) -> Item:
    """Return the histogram of the points' ranges."""
    bins = int(np.max(np.flatnonzero(histogram), initial=0)) + 1
    x, share = np.repeat(edges[: bins + 1], 2)[1:-1], histogram / max(histogram.sum(), 1.0)
    width = edges[1] - edges[0]
    y = np.repeat(share[:bins] / width, 2)
    series = [{"name": "", "colour": 0, "x": x, "y": y}]
    caption = "Share of all points per metre of range."
    return plot(f"{name}: ranges", "range [m]", "[1/m]", series, caption=caption)


def _pictures(name: str, scans: list[tuple[int, Array, AnyArray]], first_ns: int) -> list[Item]:
    """Return scans seen from above, as bright as their intensity."""
    flat = [np.abs(positions[:, :2]).max(axis=1) for _, positions, _ in scans]
    reaches = np.concatenate(flat)
    if not len(reaches):
        return []
    half = float(np.quantile(reaches, _WITHIN)) or 1.0
    frames = []
    for t_ns, positions, points in scans:
        data = base64.b64encode(png(_top_view(positions, points, half))).decode()
        frames.append({"t_s": (t_ns - first_ns) * 1e-9, "png": data})
    text = (
        f"{name}: scans from above, x to the right, y up, {2.0 * half:.3g} m wide with "
        f"{_WITHIN:.0%} of all points; brighter: more intensity"
    )
    return [{"kind": "strip", "title": text, "frames": frames}]


def _top_view(positions: Array, points: AnyArray, half: float) -> Bytes:
    """Return a picture (_PIXELS, _PIXELS) of a scan; of points in one pixel the brightest."""
    grey = np.full(len(positions), 255.0)
    if "intensity" in (points.dtype.names or ()) and len(positions):
        intensity = np.nan_to_num(points["intensity"].astype(np.float64))
        brightest = float(np.quantile(intensity, 0.98))
        if brightest > 0.0:
            share = np.clip(intensity / brightest, 0.0, 1.0)
            grey = _DARKEST + (255.0 - _DARKEST) * share
    column = np.floor((positions[:, 0] / half + 1.0) * 0.5 * _PIXELS).astype(np.intp)
    row = np.floor((1.0 - positions[:, 1] / half) * 0.5 * _PIXELS).astype(np.intp)
    visible = (column >= 0) & (column < _PIXELS) & (row >= 0) & (row < _PIXELS)
    picture = np.full((_PIXELS, _PIXELS), _GROUND, np.float64)
    np.maximum.at(picture, (row[visible], column[visible]), grey[visible])
    return picture.astype(np.uint8)
