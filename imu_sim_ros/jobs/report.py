# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Campaigns or recorded bags as one HTML page that needs nothing else."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from imu_sim_ros import __version__
from imu_sim_ros.bags.outputs import resolve_name
from imu_sim_ros.core import arguments
from imu_sim_ros.core.arguments import suggest_keywords
from imu_sim_ros.core.bad_rows import tell_skipped
from imu_sim_ros.core.errors import InputError, Problems
from imu_sim_ros.core.records import States, replace_fields
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.core.types import JsonObject
from imu_sim_ros.formats.choice import AS_RECORDED, Choice
from imu_sim_ros.formats.door import has_topics, read_states, read_trajectory, reading_blocks
from imu_sim_ros.jobs.selection import (
    AccelTopic,
    AccelUnit,
    Frame,
    GyroTopic,
    GyroUnit,
    check_choice,
    input_lines,
)
from imu_sim_ros.jobs.tracks import has_truth, odometry_topics, truth_topic
from imu_sim_ros.jobs.writing import SkipBadRows, save_output
from imu_sim_ros.recordings.findings.pose_order import sort_poses
from imu_sim_ros.reports.findings import findings_section
from imu_sim_ros.reports.page import Section, html

if TYPE_CHECKING:
    from imu_sim_ros.campaigns.metrics import Tolerance

_POSES: Final = (".txt", ".tum", ".csv")


@dataclass(frozen=True)
class Sources:
    """The sources of a page."""

    inputs: Sequence[Path]
    """Folders of campaigns, bags, EuRoC folders; files of poses after a bag are estimates of it."""
    metric: str
    baselines: Sequence[Path]
    """Earlier campaigns, the oldest first."""
    truth_topic: str | None
    skip_bad_rows: bool
    baseline_anyway: bool = False
    """True if baselines of another plan are compared with, too."""
    choice: Choice = AS_RECORDED
    """Frame, topics and units of readings."""
    notes: list[str] = field(default_factory=list)
    """Choices and conversions of reading so far."""

    def command(self, title: str) -> str:
        """Return the command line that makes the page."""
        options = [
            ("--metric", self.metric),
            ("--truth-topic", self.truth_topic),
            ("--title", title),
            ("--frame", self.choice.frame),
            ("--gyro-topic", self.choice.gyro_topic),
            ("--accel-topic", self.choice.accel_topic),
            ("--gyro-unit", self.choice.gyro_unit),
            ("--accel-unit", self.choice.accel_unit),
            *(("--baseline", str(path)) for path in self.baselines),
        ]
        flags = [word for option in options if option[1] for word in option]
        flags += ["--baseline-anyway"] * self.baseline_anyway
        return shlex.join(["imu_sim", "report", *map(str, self.inputs), *map(str, flags)])


@dataclass(frozen=True)
class Report:
    """Result of :func:`report`."""

    output: Path
    title: str
    bytes: int
    notes: tuple[str, ...] = ()
    """Choices and conversions of reading, a line each."""

    def to_dict(self) -> JsonObject:
        """Return the content of ``--json``."""
        return {
            "output": str(self.output),
            "bytes": self.bytes,
            "title": self.title,
            "notes": list(self.notes),
        }

    def lines(self) -> list[str]:
        """Return the text of the result."""
        size = f"{self.output}: {self.bytes / 1e6:.2f} MB; open it in a browser"
        return [*input_lines(self.notes), size]


@suggest_keywords
def report(
    inputs: Annotated[str | PathLike[str] | Sequence[str | PathLike[str]], "INPUT", Path],
    output: str | PathLike[str] | None = None,
    *,
    title: Annotated[str, "TITLE"] = "",
    metric: Annotated[str, "NAME"] = "",
    baselines: Annotated[Sequence[str | PathLike[str]], "--baseline PATH", Path] = (),
    baseline_anyway: Annotated[bool, "--baseline-anyway"] = False,
    truth_topic: Annotated[str | None, "TOPIC"] = None,
    frame: Frame = None,
    gyro_topic: GyroTopic = None,
    accel_topic: AccelTopic = None,
    gyro_unit: GyroUnit = None,
    accel_unit: AccelUnit = None,
    skip_bad_rows: SkipBadRows = False,
    force: bool = False,
) -> Report:
    """Write an HTML page about campaigns or recorded bags.

    :param inputs: campaign folder, bag, EuRoC folder or table; a file of poses (TUM, EuRoC) after
        a bag is an estimate of its motion
    :param output: the page, an HTML file; by default that of :func:`default_output`
    :param title: title of the page; by default that of the inputs
    :param metric: metric of a campaign to show first
    :param baselines: folder, results.csv or results.parquet of an earlier campaign; repeatable,
        oldest first, to show a trend
    :param baseline_anyway: compare with baselines of another plan, which are refused otherwise
    :param truth_topic: topic of the truth, if a bag has several
    :param frame: frame of the readings, if a topic carries several IMUs
    :param gyro_topic: topic of the gyroscope, if the accelerometer has another one
    :param accel_topic: topic of the accelerometer, interpolated to the gyroscope's times
    :param gyro_unit: unit of the gyroscope in the file: rad/s, deg/s
    :param accel_unit: unit of the accelerometer in the file: m/s^2, g, mg
    :param skip_bad_rows: skip and count bad rows of text and bad messages of bags
    :param force: overwrite an existing page
    :returns: path, title and size of the page.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for inputs that cannot be read and an output that cannot be written, with a
        line for each.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="tactical", trajectory="figure_eight", duration=2, seed=1)
    >>> _ = flight.save(folder / "flight.mcap")
    >>> ims.report(folder / "flight.mcap", folder / "flight.html").title
    'flight.mcap'
    """
    sources = Sources(
        _paths("inputs", inputs),
        arguments.text("metric", metric, "the name of a metric", empty=True),
        _paths("baselines", baselines),
        arguments.topic("truth_topic", truth_topic),
        arguments.boolean("skip_bad_rows", skip_bad_rows),
        arguments.boolean("baseline_anyway", baseline_anyway),
        check_choice(None, frame, gyro_topic, accel_topic, gyro_unit, accel_unit, of_a_file=True),
    )
    heading = arguments.text("title", title, "words", empty=True)
    if output is None:
        target = default_output(sources.inputs)
    else:
        target = arguments.path("output", output, "the path of a page")
    with save_output(target, force, sources.inputs) as staged:
        name, text = _page(sources, heading)
        staged.write_text(text, encoding="utf-8")
    return Report(target, name, len(text.encode()), tuple(sources.notes))


def default_output(inputs: Sequence[Path]) -> Path:
    """Return ``report.html`` in the first campaign's folder, or ``NAME.html`` for a bag.

    :raises InputError: for a bag without a name.
    """
    from imu_sim_ros.reports.campaign import is_campaign

    path = resolve_name(inputs[0])
    if is_campaign(path):
        return path / "report.html"
    if not path.name:
        raise InputError(f"{path}: has no name for the page; give one by -o FILE")
    return path.with_name(f"{path.stem}.html")


def _paths(name: str, paths: object) -> list[Path]:
    """Return one path or several.

    :raises ConfigurationError: for anything else.
    """
    if isinstance(paths, str | PathLike):
        paths = [paths]
    if not isinstance(paths, list | tuple):
        arguments.refuse(name, paths, "a path, or a list of paths", wrong_type=True)
    return [arguments.path(name, path) for path in paths]


def _page(sources: Sources, title: str) -> tuple[str, str]:
    """Return the title and the text of a page.

    :param title: empty: those of the inputs.
    """
    titles, sections = _sections(sources)
    footer = f"Generated by imu_sim_ros {__version__}: {sources.command(title)}"
    title = title or "; ".join(titles)
    return title, html(title, [footer], sections)


def write_campaign_page(
    folder: Path,
    metric: str,
    baselines: Sequence[Path],
    limits: tuple[Tolerance | None, Tolerance | None],
    command: str,
    baseline_anyway: bool = False,
) -> None:
    """Write report.html into a campaign's folder; arguments as for ``campaign_sections``."""
    from imu_sim_ros.campaigns.results import write_atomically
    from imu_sim_ros.reports.campaign import campaign_sections

    title, sections = campaign_sections(folder, metric, baselines, *limits, baseline_anyway)
    with write_atomically(folder / "report.html") as part:
        part.write_text(html(title, [f"Generated by {command}"], sections), encoding="utf-8")


def _sections(sources: Sources) -> tuple[list[str], list[Section]]:
    """Return the titles of the inputs and all sections."""
    from imu_sim_ros.reports.campaign import campaign_sections, is_campaign

    titles: list[str] = []
    sections: list[Section] = []
    problems = Problems()
    for path in (*sources.inputs, *sources.baselines):
        with problems.collect():
            if not path.exists():
                raise InputError(f"{path}: no such file or folder")
    inputs, baselines = (
        [path for path in paths if path.exists()] for paths in (sources.inputs, sources.baselines)
    )
    while inputs:
        path = inputs.pop(0)
        if is_campaign(path):
            with problems.collect():
                anyway = sources.baseline_anyway
                title, campaign_parts = campaign_sections(
                    path, sources.metric, baselines, baseline_anyway=anyway
                )
                titles.append(title)
                if len(sources.inputs) > 1:
                    campaign_parts = [
                        s._replace(title=f"{path.name}: {s.title}") for s in campaign_parts
                    ]
                sections += campaign_parts
        else:
            estimates = []
            while inputs and _is_poses(inputs[0]):
                estimates.append(inputs.pop(0))
            with problems.collect():
                titles.append(path.name)
                bag_sections = _bag(sources, path, estimates)
                if len(sources.inputs) > 1 + len(estimates):  # links need the name of the bag
                    bag_sections = [section._replace(short="") for section in bag_sections]
                sections += bag_sections
    problems.tell()
    return titles, sections


def _is_poses(path: Path) -> bool:
    """Return True for a file with an ending that files of poses have."""
    return path.is_file() and path.suffix.lower() in _POSES


def _poses_alone(sources: Sources, path: Path) -> States | None:
    """Return the poses of a text file without readings, as they came; None: it is no such file."""
    if path.is_dir() or has_topics(path):
        return None
    try:
        next(reading_blocks(path, sources.choice), None)
    except InputError:
        with suppress(InputError):
            states = read_states(
                path, None, sources.skip_bad_rows, is_trajectory=True, ordered=False
            )
            return replace_fields(states, source=path.name)
    return None


def _read_named(path: Path, topic: str | None, name: str, skip_bad_rows: bool) -> States:
    """Return the poses of a file, or of a topic of a bag, under a name for the page."""
    return replace_fields(read_trajectory(path, topic, True, skip_bad_rows), source=name)


def _bag(sources: Sources, path: Path, files: Sequence[Path]) -> list[Section]:
    """Return the sections of a bag: its streams, its truth and its estimates.

    :param files: files of estimates.
    :raises InputError: with a line for each that cannot be read.
    """
    from imu_sim_ros.reports.bag import reading_sections
    from imu_sim_ros.reports.clouds import cloud_sections
    from imu_sim_ros.reports.estimates import TruthWithEstimates, estimate_sections
    from imu_sim_ros.reports.gnss import gnss_sections
    from imu_sim_ros.reports.sensors import sensor_sections

    skips = sources.skip_bad_rows
    truth: States | None = None
    estimates: list[States] = []
    flights: list[TruthWithEstimates] = []
    sensors: list[Section] = []
    problems = Problems()
    poses = _poses_alone(sources, path)
    with problems.collect():
        truth_name = truth_topic(path, sources.truth_topic)
        if poses is not None:
            if poses.skipped:
                tell_skipped(path)(poses.skipped)
            estimates.append(sort_poses(poses, skips))
        elif not has_topics(path):
            truth = _read_named(path, None, "truth", skips) if has_truth(path) else None
        else:
            topics = odometry_topics(path)
            truths = _separate_truths(topics)
            for topic in topics:
                if truth_name is not None and topic.strip("/") == truth_name.strip("/"):
                    truth = _read_named(path, topic, f"truth ({topic})", skips)
                elif topic in truths:  # an estimate with a truth of its own
                    topic_truth = _read_named(
                        path, truths[topic], f"truth ({truths[topic]})", skips
                    )
                    estimate = _read_named(path, topic, topic, skips)
                    flights.append(TruthWithEstimates(topic, topic_truth, [estimate]))
                elif topic not in truths.values():
                    estimates.append(_read_named(path, topic, topic, skips))
            if sources.truth_topic and truth is None:
                raise InputError(
                    f"{path}: {argument_prefix('truth_topic', sources.truth_topic)}: no such "
                    "Odometry"
                )
            sensors = gnss_sections(path) + sensor_sections(path) + cloud_sections(path)
    for file in files:
        with problems.collect():
            estimates.append(_read_named(file, None, file.name, skips))
    skipped = tell_skipped(path) if skips else None
    readings: list[Section] = []
    with problems.collect():
        if poses is None:
            readings = reading_sections(path, sources.choice, sources.notes, skipped)
    problems.tell()
    if truth is not None or estimates:
        flights.insert(0, TruthWithEstimates("motion", truth, estimates))
    comparisons = estimate_sections(path, flights)
    return [*comparisons, _findings(sources, path, files), *readings, *sensors]


def _findings(sources: Sources, path: Path, files: Sequence[Path]) -> Section:
    """Return the findings of a recording and of the estimates beside it, worst first."""
    from imu_sim_ros.jobs.inspect import inspect

    choice = sources.choice
    inspection = inspect(
        [path, *files],
        frame=choice.frame,
        gyro_topic=choice.gyro_topic,
        accel_topic=choice.accel_topic,
        gyro_unit=choice.gyro_unit,
        accel_unit=choice.accel_unit,
        skip_bad_rows=sources.skip_bad_rows,
    )
    return findings_section(inspection.findings, f"{path.name}: findings")


def _separate_truths(topics: Sequence[str]) -> dict[str, str]:
    """Return the truths of odometry that has one of its own: ground_truth/wheel_odom of wheel/odom.

    Both are in the frame of that odometry, which begins at 0, not in the world's.
    """
    names = {topic.strip("/"): topic for topic in topics}
    pairs = {topic: f"ground_truth/{name.replace('/', '_')}" for name, topic in names.items()}
    return {
        topic: names[truth] for topic, truth in pairs.items() if truth in names and "/" in topic[1:]
    }
