# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The readings of a bag, a folder or a file as a section of a page."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from imu_sim_ros.bags.messages.blocks import TopicInfo
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.core.bad_rows import Skipped
from imu_sim_ros.core.conventions import AXES
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings
from imu_sim_ros.core.types import Array
from imu_sim_ros.formats.choice import Choice
from imu_sim_ros.formats.door import has_topics, imu_choices, reading_blocks
from imu_sim_ros.formats.handling import Handling
from imu_sim_ros.reports.page import Item, Section, plot, table
from imu_sim_ros.reports.streams import StreamPlots, analyse, bias_series, topic_items

_TRIADS: Final = (("Angular rate", "rad/s"), ("Specific force", "m/s^2"))


def reading_sections(
    path: Path, choice: Choice, notes: list[str], skipped: Skipped | None = None
) -> list[Section]:
    """Return the section of the topics and IMU readings of a bag, a folder or a file.

    :param choice: frame, topics and units of the readings.
    :param notes: receives choices and conversions of reading.
    :param skipped: receives the number of bad readings skipped; None: they are errors.
    :returns: nothing for a bag without messages.
    :raises InputError: for what cannot be read.
    """
    topics = _topics(path)
    items = topic_items(path, topics) if topics else []
    biases = [
        plot(title, "time [s]", f"[{unit}]" if unit else "", series, link=f"{path} bias")
        for title, unit, series in bias_series(path, topics)
    ]
    counts = {topic.name.strip("/"): topic.count for topic in topics}
    shown = 0
    for imu in imu_choices(path, choice):
        blocks: Iterable[Readings] = reading_blocks(path, imu, Handling(skipped))
        name = imu.topic or imu.gyro_topic or ""
        count = counts.get(name.strip("/"))
        if count is None:  # of text, which has no index
            blocks = list(blocks)
            count = sum(map(len, blocks))
        remarks: list[str] = []
        stream = analyse(_collect_notes(blocks, remarks), count)
        if stream is not None:
            items += [{"kind": "text", "text": f"{name or path.name}: {note}"} for note in remarks]
            items += _stream_items(name or path.name, stream, f"{path} {name}")
            notes += [note for note in remarks if note not in notes]
            shown += 1
    if choice.frame is not None and not shown:
        raise InputError(f"{path}: contains no readings of the frame {choice.frame}")
    if biases:
        items.append({"kind": "plots", "items": biases})
    return [Section(f"{path.name}: readings", items, "readings")] if items else []


def _topics(path: Path) -> list[TopicInfo]:
    """Return the topics of a bag; none of a dataset."""
    if not has_topics(path):
        return []
    with open_bag(path) as bag:
        return bag.topics


def _collect_notes(blocks: Iterable[Readings], notes: list[str]) -> Iterator[Readings]:
    """Yield blocks of readings unchanged, and append their notes."""
    for block in blocks:
        notes += [note for note in block.notes if note not in notes]
        yield block


def _stream_items(name: str, stream: StreamPlots, link: str) -> list[Item]:
    """Return the plots of an IMU's readings."""
    rate = 1.0 / stream.interval_s
    heading = (
        f"{name}: {stream.samples:,} readings in {stream.duration_s:.6g} s, {rate:.6g} Hz, "
        f"{stream.gap_count} gaps"
    )
    plots: list[Item] = [_readings(stream, triad, link) for triad in range(2)]
    plots += [_spectrum(stream, triad) for triad in range(2)]
    if stream.at_rest:
        plots += [_allan(stream, triad) for triad in range(2)]
    plots.append(_intervals(stream, link))
    items: list[Item] = [{"kind": "heading", "text": heading}, {"kind": "plots", "items": plots}]
    if not stream.at_rest:
        text = (
            f"{name} moves, or is too short to tell: it has no Allan deviation, which shows the "
            "noise of a sensor at rest."
        )
        items.append({"kind": "text", "text": text, "faint": True})
    if stream.gaps:
        rows = [[gap.at_s, gap.interval_s, gap.interval_s * rate] for gap in stream.gaps]
        header = ["at [s]", "interval [s]", "in usual intervals"]
        items.append(table(f"gaps of {name}", header, rows, search=False))
    return items


def _readings(stream: StreamPlots, triad: int, link: str) -> Item:
    """Return the plot of a triad's readings over time."""
    title, unit = _TRIADS[triad]
    series: list[Item] = []
    for k, axis in enumerate(AXES):
        low, high = stream.low[:, 3 * triad + k], stream.high[:, 3 * triad + k]
        middle = 0.5 * (low + high)
        line = {"name": axis, "colour": axis, "x": stream.t_s, "y": middle, "thin": True}
        series.append({**line, "low": low, "high": high})
    caption = "Lowest and highest reading of each part of the record, and their middle."
    return plot(title, "time [s]", f"[{unit}]", series, link=link, caption=caption)


def _spectrum(stream: StreamPlots, triad: int) -> Item:
    """Return the plot of a triad's spectrum."""
    title, unit = _TRIADS[triad]
    series = _lines(stream.frequency, stream.density[:, 3 * triad : 3 * triad + 3])
    caption = "Welch's estimate, two-sided: white noise appears at its density."
    label = f"[{unit}/sqrt(Hz)]"
    return plot(f"{title}: spectrum", "frequency [Hz]", label, series, "xy", caption=caption)


def _lines(x: Array, values: Array) -> list[Item]:
    """Return a line for each axis of values (n, 3)."""
    return [
        {"name": axis, "colour": axis, "x": x, "y": column}
        for axis, column in zip(AXES, values.T, strict=True)
    ]


def _allan(stream: StreamPlots, triad: int) -> Item:
    """Return the plot of a triad's Allan deviation."""
    title, unit = _TRIADS[triad]
    deviation, columns = stream.deviation, slice(3 * triad, 3 * triad + 3)
    series = _lines(deviation.tau, deviation.deviation[:, columns])
    bands = zip(deviation.low[:, columns].T, deviation.high[:, columns].T, strict=True)
    for line, (low, high) in zip(series, bands, strict=True):
        line |= {"low": low, "high": high}
    caption = "Overlapping, with its 95 % band."
    label = f"[{unit}]"
    return plot(
        f"{title}: Allan deviation", "cluster time [s]", label, series, "xy", caption=caption
    )


def _intervals(stream: StreamPlots, link: str) -> Item:
    """Return the plot of the intervals between stamps over time."""
    line = {"name": "", "colour": 0, "x": stream.t_s, "y": 1e3 * stream.longest}
    series = [{**line, "low": 1e3 * stream.shortest, "high": 1e3 * stream.longest}]
    caption = "Shortest and longest interval of each part of the record."
    return plot(
        "Gaps: intervals between stamps", "time [s]", "[ms]", series, link=link, caption=caption
    )
