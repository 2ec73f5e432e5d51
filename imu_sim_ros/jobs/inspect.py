# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contents of recordings, and their faults with what to do about each."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain
from os import PathLike
from pathlib import Path
from typing import Annotated, Final, TypeVar

import numpy as np

from imu_sim_ros import __version__
from imu_sim_ros.bags.cameras import camera_records
from imu_sim_ros.bags.clouds import cloud_records
from imu_sim_ros.bags.feature_tracks import feature_tracks
from imu_sim_ros.bags.messages.encode import IMU, PATH, TEMPERATURE
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE
from imu_sim_ros.bags.pose_topics import POSE_TYPES
from imu_sim_ros.bags.read import Bag, MixedFramesError, open_bag, read_temperature
from imu_sim_ros.calibration.noise.truth import load_truth, true_noise
from imu_sim_ros.core import arguments
from imu_sim_ros.core.arguments import BAG_OR_FILE, name_of, suggest_keywords
from imu_sim_ros.core.bad_rows import tell_skipped
from imu_sim_ros.core.blocks import step_lengths
from imu_sim_ros.core.conventions import AXES, TRIADS, TRUTH_TOPIC
from imu_sim_ros.core.digits import plus_minus
from imu_sim_ros.core.errors import ConfigurationError, InputError, Problems
from imu_sim_ros.core.memory import release_memory
from imu_sim_ros.core.names import suggestion
from imu_sim_ros.core.records import Readings, States, concatenate, replace_fields
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.types import Array, JsonObject
from imu_sim_ros.datasets.recorded import folder_cameras
from imu_sim_ros.formats import door
from imu_sim_ros.formats.choice import Choice
from imu_sim_ros.formats.handling import Handling
from imu_sim_ros.jobs.flight import Flight
from imu_sim_ros.jobs.selection import (
    AccelTopic,
    AccelUnit,
    Frame,
    GyroTopic,
    GyroUnit,
    check_choice,
    input_lines,
)
from imu_sim_ros.jobs.tracks import has_truth
from imu_sim_ros.jobs.writing import SkipBadRows, save_output
from imu_sim_ros.parameters import files
from imu_sim_ros.recordings.cameras import CameraRecord, CloudRecord
from imu_sim_ros.recordings.clock import estimate_clock
from imu_sim_ros.recordings.findings.catalogue import (
    KINDS,
    camera_findings,
    clipping_findings,
    cloud_findings,
    frame_findings,
    order_poses,
    reading_findings,
    sort_by_severity,
    state_findings,
    temperature_findings,
)
from imu_sim_ros.recordings.findings.clipping import ClippingCounts
from imu_sim_ros.recordings.findings.finding import SEVERITIES, Finding
from imu_sim_ros.recordings.findings.measures import ReadingMeasures
from imu_sim_ros.recordings.findings.roles import TopicFrames
from imu_sim_ros.recordings.findings.states import StateMeasures
from imu_sim_ros.recordings.findings.temperatures import TemperatureRecord
from imu_sim_ros.recordings.time_offsets import (
    TurnAngles,
    UnknownOffsetError,
    time_offset_of_turns,
    turn_angles_of_poses,
    turn_angles_of_readings,
    turn_angles_of_tracks,
)
from imu_sim_ros.recordings.tracks import FeatureTracks
from imu_sim_ros.reports.findings import findings_section
from imu_sim_ros.reports.page import Section, html, table
from imu_sim_ros.sensors.camera.images.files import image_size
from imu_sim_ros.terminal.text_tables import TextTable, html_of

_NEAREST: Final = 3
"""Number of presets that are named next to a sensor."""
_COLUMNS: Final = 80
"""Width of the text."""
_INDENT: Final = 10
"""Largest indentation of the lines that continue a text."""
_COMPARED: Final = 20
"""Number of recordings whose time offset to the first IMU is looked for."""


@dataclass(frozen=True)
class TopicContents:
    """Messages of a topic of a bag."""

    source: str
    """Name of the file."""
    topic: str
    """Name of the topic."""
    type: str
    """Type of its messages, for instance sensor_msgs/msg/Imu."""
    messages: int
    """Number of messages."""


@dataclass(frozen=True)
class SensorContents:
    """Readings of one IMU."""

    source: str
    """Name of the file and topic."""
    frame_id: str
    """Name of the sensor's frame; empty: unknown."""
    readings: int
    """Number of readings."""
    duration_s: float
    """Time over all readings, without steps of the clock [s]."""
    rate_hz: float | None
    """Samples per second [Hz]; None: the stamps have no rate."""
    rate_sigma_hz: float | None
    """Standard deviation of the rate [Hz]."""
    clock: str
    """Kind of the stamps: exact, rounded, batches, bunches, jitter; empty without a rate."""
    lost: int
    """Number of samples that are missing between others."""
    rest_s: float
    """Time at rest, in the longest piece without a pause [s]."""
    moving_s: float
    """Time in motion, in the longest piece without a pause [s]."""
    rest_force: float | None
    """Median length of the specific force at rest [m/s^2]; None: nothing is at rest."""
    gyroscope_noise_density: tuple[float, ...] | None
    """White noise of each axis [rad/s/sqrt(Hz)]; None: motion hides it."""
    accelerometer_noise_density: tuple[float, ...] | None
    """White noise of each axis [m/s^2/sqrt(Hz)]; None: motion hides it."""
    nearest_presets: tuple[str, ...]
    """Presets whose noise is nearest, the nearest first."""
    notes: tuple[str, ...]
    """Choices and conversions of reading, a line each."""


@dataclass(frozen=True)
class PoseContents:
    """Poses of one body."""

    source: str
    """Name of the file and topic."""
    frame_id: str
    """Name of the world's frame; empty: unknown."""
    child_frame_id: str
    """Name of the body's frame; empty: unknown."""
    poses: int
    """Number of poses."""
    duration_s: float
    """Time from the first to the last pose [s]."""
    rate_hz: float | None
    """Poses per second [Hz]; None: the stamps have no rate."""
    length_m: float
    """Length of the path [m]."""


@dataclass(frozen=True)
class TemperatureContents:
    """Temperatures of a topic, or of the column of a table."""

    source: str
    """Name of the file and topic."""
    temperatures: int
    """Number of temperatures."""
    lowest: float
    """The lowest [degC]."""
    highest: float
    """The highest [degC]."""


@dataclass(frozen=True)
class SensorOffset:
    """Time offset between two recordings of one body, estimated from its rotation."""

    source: str
    """Name of the IMU or trajectory whose stamps are off."""
    reference: str
    """Name of the IMU or trajectory whose stamps are the reference."""
    offset_s: float
    """Time to add to the stamps of the source [s]."""
    low_s: float
    """Lower end of the 95 % interval [s]."""
    high_s: float
    """Upper end of the 95 % interval [s]."""


@dataclass(frozen=True)
class UnknownOffset:
    """Recording whose time offset is not told, and why."""

    source: str
    """Name of the IMU, trajectory or camera."""
    reference: str
    """Name of the recording whose stamps are the reference."""
    reason: str
    """Cause in words."""


@dataclass(frozen=True)
class Inspection:
    """Contents of recordings, and their findings."""

    topics: tuple[TopicContents, ...]
    """Topics of the bags."""
    sensors: tuple[SensorContents, ...]
    """IMUs."""
    trajectories: tuple[PoseContents, ...]
    """Trajectories, true ones and estimates."""
    temperatures: tuple[TemperatureContents, ...]
    """Temperatures of sensors."""
    offsets: tuple[SensorOffset, ...]
    """Time offsets to the first IMU, else to the first trajectory, where the motion tells them."""
    unknown_offsets: tuple[UnknownOffset, ...]
    """Recordings whose time offsets are not told."""
    findings: tuple[Finding, ...]
    """Faults, worst first."""

    def __repr__(self) -> str:
        kinds = ", ".join(dict.fromkeys(finding.kind for finding in self.findings))
        contents = f"{len(self.sensors)} IMUs, {len(self.trajectories)} trajectories"
        return f"<Inspection: {contents}; {kinds or 'no findings'}>"

    def _repr_html_(self) -> str:
        """Return findings and contents as HTML, for notebooks."""
        tables: list[tuple[str, list[str], Sequence[Sequence[object]]]]
        tables = [("Findings", *_findings_table(self.findings)), *self.tables()]
        shown = [
            TextTable(header, [[_cell(cell) for cell in row] for row in rows], title)
            for title, header, rows in tables
            if rows
        ]
        return html_of([*([] if self.findings else ["no findings"]), *shown])

    def select(self, kinds: Sequence[str]) -> list[Finding]:
        """Return the findings of some kinds.

        :param kinds: kinds, and severities, which stand for the worse ones, too.
        :raises ConfigurationError: for a kind that does not exist.
        """
        allowed = [*SEVERITIES, *KINDS]
        for kind in arguments.string_list("kinds", kinds):
            if kind not in allowed:
                raise ConfigurationError(
                    f"{argument('fail_on', kind)}: {suggestion(kind, allowed)}"
                )
        ranks = [SEVERITIES.index(kind) for kind in SEVERITIES if kind in kinds]
        worst = max(ranks, default=-1)
        return [
            finding
            for finding in self.findings
            if finding.kind in kinds or SEVERITIES.index(finding.severity) <= worst
        ]

    def to_dict(self) -> JsonObject:
        """Return the content of ``--json``."""
        return {
            "topics": [vars(topic) for topic in self.topics],
            "sensors": [vars(sensor) for sensor in self.sensors],
            "trajectories": [vars(poses) for poses in self.trajectories],
            "temperatures": [vars(temperatures) for temperatures in self.temperatures],
            "offsets": [vars(offset) for offset in self.offsets],
            "unknown_offsets": [vars(offset) for offset in self.unknown_offsets],
            "findings": [finding.to_dict() for finding in self.findings],
        }

    def lines(self) -> Iterator[str]:
        """Yield the lines that ``inspect`` prints: findings, worst first, then the contents."""
        for sensor in self.sensors:
            yield from input_lines([f"{sensor.source}: {note}" for note in sensor.notes])
        for finding in self.findings:
            yield from _wrap(f"{finding.severity}: ", finding.statement())
            yield from _wrap("  effect  ", finding.effect)
            yield from _wrap("  to do   ", finding.remedy)
        if not self.findings:
            yield "no findings"
        for file in dict.fromkeys(topic.source for topic in self.topics):
            topics = [topic for topic in self.topics if topic.source == file]
            yield from ("", f"topics: {file}")
            yield from _align_columns([[t.topic, t.type, f"{t.messages:,}"] for t in topics])
        for sensor in self.sensors:
            yield from ("", f"IMU: {sensor.source}")
            yield from _align_columns(_sensor_rows(sensor))
        for poses in self.trajectories:
            yield from ("", f"poses: {poses.source}")
            yield from _align_columns(_pose_rows(poses))
        for degrees in self.temperatures:
            yield from ("", f"temperatures: {degrees.source}")
            span = f"{degrees.lowest:.4g} to {degrees.highest:.4g} degC"
            yield from _align_columns([["readings", f"{degrees.temperatures:,}"], ["range", span]])
        if self.offsets or self.unknown_offsets:
            yield from ("", "time offsets, with their 95 % intervals")
            for offset in self.offsets:
                half = 0.5 * (offset.high_s - offset.low_s)
                size = f"{plus_minus(1e3 * offset.offset_s, 1e3 * half)} ms"
                text = f"to add to the stamps of {offset.source}, for those of {offset.reference}"
                yield from _wrap(f"  {size}  ", text)
            for unknown in self.unknown_offsets:
                text = f"{unknown.source}, for {unknown.reference}: {unknown.reason}"
                yield from _wrap("  unknown  ", text)

    def tables(self) -> Iterator[tuple[str, list[str], Sequence[Sequence[object]]]]:
        """Yield title, header and rows of the tables of contents."""
        axes = [f"{triad} {axis}" for triad in TRIADS for axis in AXES]
        yield (
            "Topics",
            ["file", "topic", "type", "messages"],
            [[topic.source, topic.topic, topic.type, topic.messages] for topic in self.topics],
        )
        yield (
            "Readings",
            [
                *("IMU", "readings", "time [s]", "rate [Hz]", "stamps", "lost", "rest [s]"),
                "force at rest [m/s^2]",
            ],
            [
                [
                    *(sensor.source, sensor.readings, sensor.duration_s, sensor.rate_hz),
                    *(sensor.clock, sensor.lost, sensor.rest_s, sensor.rest_force),
                ]
                for sensor in self.sensors
            ],
        )
        yield (
            "White noise [rad/s/sqrt(Hz), m/s^2/sqrt(Hz)], and the presets nearest to it",
            ["noise floor", *axes, "presets"],
            [
                [
                    sensor.source,
                    *(sensor.gyroscope_noise_density or [None] * 3),
                    *(sensor.accelerometer_noise_density or [None] * 3),
                    ", ".join(sensor.nearest_presets),
                ]
                for sensor in self.sensors
                if sensor.gyroscope_noise_density or sensor.accelerometer_noise_density
            ],
        )
        yield (
            "Poses",
            ["trajectory", "frame", "body", "poses", "time [s]", "rate [Hz]", "path [m]"],
            [
                [
                    *(poses.source, poses.frame_id, poses.child_frame_id, poses.poses),
                    *(poses.duration_s, poses.rate_hz, poses.length_m),
                ]
                for poses in self.trajectories
            ],
        )
        yield (
            "Temperatures [degC]",
            ["source", "temperatures", "lowest", "highest"],
            [list(vars(temperatures).values()) for temperatures in self.temperatures],
        )
        yield (
            "Time to add to the stamps [ms], with its 95 % interval",
            ["source", "reference", "offset", "low", "high"],
            [
                [o.source, o.reference, 1e3 * o.offset_s, 1e3 * o.low_s, 1e3 * o.high_s]
                for o in self.offsets
            ],
        )
        yield (
            "Unknown time offsets",
            ["source", "reference", "reason"],
            [list(vars(offset).values()) for offset in self.unknown_offsets],
        )

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write a self-contained HTML page.

        :param force: overwrite an existing page.
        :returns: the path.
        :raises InputError: for a path that cannot be used or exists.
        """
        sections = [findings_section(self.findings)]
        for title, columns, cells in self.tables():
            if cells:
                content = table(title.partition(" ")[0].lower(), columns, cells, search=False)
                sections.append(Section(title, [content], title.partition(" [")[0]))
        with save_output(path, force) as staged:
            text = html("Inspection", [f"Generated by imu_sim_ros {__version__}"], sections)
            staged.write_text(text, encoding="utf-8")
        return Path(path)


def _findings_table(findings: Sequence[Finding]) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of the findings."""
    rows = [[f.severity, f.statement(), f.effect, f.remedy] for f in findings]
    return ["severity", "finding", "effect", "to do"], rows


def _cell(value: object) -> str:
    """Return a value as a cell of the report."""
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    return f"{value:,}" if isinstance(value, int) else str(value)


def _wrap(label: str, text: str) -> list[str]:
    """Return a text in lines of 80 columns, next to its label."""
    indent = " " * min(len(label), _INDENT)
    return textwrap.wrap(
        text,
        _COLUMNS,
        initial_indent=label,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _align_columns(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield rows of text in columns, indented: numbers of a last column to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = [f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)]
        if len(row) > 2:
            cells[-1] = f"{row[-1]:>{widths[-1]}}"
        yield "  " + "  ".join(cells).rstrip()


def _sensor_rows(sensor: SensorContents) -> list[list[str]]:
    """Return the rows of the report about an IMU."""
    rows = [["readings", f"{sensor.readings:,} in {sensor.duration_s:.6g} s"]]
    if sensor.frame_id:
        rows.insert(0, ["frame", sensor.frame_id])
    if sensor.rate_hz is not None:
        clock = f"{sensor.rate_hz:.6g} Hz; stamps: {sensor.clock}; lost: {sensor.lost:,}"
        rows.append(["rate", clock])
    if sensor.rest_s or sensor.moving_s:
        rows.append(["rest, motion", f"{sensor.rest_s:.4g} s, {sensor.moving_s:.4g} s"])
    if sensor.rest_force is not None:
        rows.append(["specific force at rest", f"{sensor.rest_force:.4g} m/s^2"])
    for triad, unit, density in (
        (TRIADS[0], "rad/s/sqrt(Hz)", sensor.gyroscope_noise_density),
        (TRIADS[1], "m/s^2/sqrt(Hz)", sensor.accelerometer_noise_density),
    ):
        if density is not None:
            values = ", ".join(f"{axis:.3g}" for axis in density)
            rows.append([f"{triad} noise", f"{values} {unit}"])
    if sensor.nearest_presets:
        rows.append(["nearest presets", ", ".join(sensor.nearest_presets)])
    return rows


def _pose_rows(poses: PoseContents) -> list[list[str]]:
    """Return the rows of the report about a trajectory."""
    rows = [["poses", f"{poses.poses:,} in {poses.duration_s:.6g} s"]]
    if poses.frame_id or poses.child_frame_id:
        frames = [poses.frame_id or "unknown", poses.child_frame_id or "unknown"]
        rows.insert(0, ["frames", f"{frames[0]}, body {frames[1]}"])
    if poses.rate_hz is not None:
        rows.append(["rate", f"{poses.rate_hz:.6g} Hz"])
    rows.append(["path", f"{poses.length_m:.6g} m"])
    return rows


_POSE_TYPES: Final = tuple(name for name in POSE_TYPES if name != TF_MESSAGE)
"""Types of topics with the poses of one body."""
Record = (
    Readings
    | States
    | ClippingCounts
    | CameraRecord
    | FeatureTracks
    | CloudRecord
    | TopicFrames
    | TemperatureRecord
)
"""Readings, poses, counts of clipping, a camera's description, clouds, frames on a topic, or
temperatures."""
MeasuresT = TypeVar("MeasuresT", ReadingMeasures, StateMeasures, FeatureTracks)
Source = str | PathLike[str] | Readings | States | Flight
"""A file, or a record in memory."""


@suggest_keywords
def inspect(
    inputs: Annotated[Source | Sequence[Source], "FILE", Path],
    *,
    topic: Annotated[str | None, "NAME"] = None,
    frame: Frame = None,
    gyro_topic: GyroTopic = None,
    accel_topic: AccelTopic = None,
    gyro_unit: GyroUnit = None,
    accel_unit: AccelUnit = None,
    skip_bad_rows: SkipBadRows = False,
) -> Inspection:
    """Return the contents of recordings, and their faults.

    Findings come worst first, each with the numbers that show it, its effect on results, and what
    to do about it. What is measured and how is on the page :doc:`/how_to/inspect`.

    :param inputs: bag of any format, EuRoC folder, CSV file of readings or file of poses; in Python
        also a flight, readings or states
    :param topic: only this topic, of type Imu or Odometry
    :param frame: frame of the readings, if a topic carries several IMUs
    :param gyro_topic: topic of the gyroscope, if the accelerometer has another one
    :param accel_topic: topic of the accelerometer, interpolated to the gyroscope's times
    :param gyro_unit: unit of the gyroscope in the file: rad/s, deg/s
    :param accel_unit: unit of the accelerometer in the file: m/s^2, g, mg
    :param skip_bad_rows: skip and count bad rows of text and bad messages of bags
    :returns: an :class:`Inspection`.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: for files that cannot be read, with a line for each.

    >>> import imu_sim_ros as ims
    >>> readings = ims.simulate(imu="bmi088", trajectory="static", duration=20, rate=200).readings
    >>> ims.inspect(readings)
    <Inspection: 1 IMUs, 0 trajectories; no findings>
    >>> in_g = ims.Readings(readings.t_ns, readings.gyro, readings.accel / 9.80665)
    >>> ims.inspect(in_g)
    <Inspection: 1 IMUs, 0 trajectories; accelerometer_g>
    """
    sources = list(inputs) if isinstance(inputs, list | tuple) else [inputs]
    has_file = any(isinstance(source, str | PathLike) for source in sources)
    selection = frame, gyro_topic, accel_topic, gyro_unit, accel_unit
    choice = check_choice(None, *selection, of_a_file=has_file)
    topic = arguments.topic("topic", topic)
    skip = arguments.boolean("skip_bad_rows", skip_bad_rows)
    problems = Problems()
    checked: list[Path | Flight | Readings | States] = []
    for source in sources:
        if isinstance(source, str | PathLike):
            with problems.collect():
                path = arguments.path("inputs", source, BAG_OR_FILE)
                if not path.exists():
                    raise InputError(f"{path}: no such file or folder")
                checked.append(path)
        elif isinstance(source, Flight | Readings | States):
            checked.append(source)
        else:
            allowed = f"a Flight, Readings, States, or {BAG_OR_FILE}"
            arguments.refuse("inputs", source, allowed, wrong_type=True)
    summary = _Summary()
    for recording in checked:
        if isinstance(recording, Path):
            with problems.collect():
                records = _read(recording, topic, choice, skip, summary.topics)
                summary.add(records, is_judged=not problems)
        elif isinstance(recording, Flight):
            summary.add((recording.readings, recording.truth), is_judged=not problems)
        else:
            summary.add((recording,), is_judged=not problems)
    problems.tell()
    return summary.inspection()


class _Summary:
    """Contents and findings of records, which are not kept: each is judged as it is read."""

    def __init__(self) -> None:
        self.topics: list[TopicContents] = []
        self._sensors: list[SensorContents] = []
        self._trajectories: list[PoseContents] = []
        self._temperatures: list[TemperatureContents] = []
        self._findings: list[Finding] = []
        self._turns: list[tuple[str, TurnAngles | UnknownOffsetError]] = []
        self._cameras: list[str] = []
        self._bodies: dict[str, str] = {}

    def add(self, records: Iterable[Record], is_judged: bool) -> None:
        """Add records.

        :param is_judged: False: only read them, since another input has a problem.
        """
        for record in records:
            if is_judged:
                self._judge(record)
            del record  # a long recording leaves the memory before the next one is read

    def _judge(self, record: Record) -> None:
        """Add the contents and the findings of a record."""
        if isinstance(record, CameraRecord):
            self._cameras.append(record.source)
            self._findings += camera_findings(record)
        elif isinstance(record, FeatureTracks):
            angles = _turn_angles(turn_angles_of_tracks, record)
            self._turns.append((record.source, angles))
        elif isinstance(record, ClippingCounts):
            self._findings += clipping_findings(record)
        elif isinstance(record, TopicFrames):
            self._findings += frame_findings(record)
        elif isinstance(record, CloudRecord):
            self._findings += cloud_findings(record)
        elif isinstance(record, TemperatureRecord):
            self._temperatures += _temperatures(record)
            self._findings += temperature_findings(record)
        elif isinstance(record, Readings):
            measures = ReadingMeasures(record)
            if record.temperature is not None:
                degrees = TemperatureRecord(record.source, record.temperature)
                self._temperatures += _temperatures(degrees)
            self._sensors.append(_sensor(measures))
            self._findings += reading_findings(record, measures)
            angles = _turn_angles(turn_angles_of_readings, measures)
            self._turns.insert(len(self._sensors) - 1, (record.source, angles))
        else:
            poses = order_poses(record).poses
            self._trajectories.append(_poses(poses))
            self._findings += state_findings(record)
            if record.source.endswith(f"/{TRUTH_TOPIC}") and record.child_frame_id:
                self._bodies[record.source.removesuffix(TRUTH_TOPIC)] = record.child_frame_id
            angles = _turn_angles(turn_angles_of_poses, StateMeasures(poses))
            self._turns.append((record.source, angles))

    def inspection(self) -> Inspection:
        """Return the contents and findings of all records."""
        offsets = list(_offsets(self._turns, self._cameras, self._bodies))
        return Inspection(
            tuple(self.topics),
            tuple(self._sensors),
            tuple(self._trajectories),
            tuple(self._temperatures),
            tuple(offset for offset in offsets if isinstance(offset, SensorOffset)),
            tuple(offset for offset in offsets if isinstance(offset, UnknownOffset)),
            tuple(sort_by_severity(self._findings)),
        )


def _turn_angles(
    measure: Callable[[MeasuresT], TurnAngles], measures: MeasuresT
) -> TurnAngles | UnknownOffsetError:
    """Return the angles that a body has turned, or why they are not known."""
    release_memory()  # that of the findings
    try:
        return measure(measures)
    except UnknownOffsetError as error:
        return error


def _offsets(
    turns: Sequence[tuple[str, TurnAngles | UnknownOffsetError]],
    cameras: Sequence[str],
    bodies: Mapping[str, str],
) -> Iterator[SensorOffset | UnknownOffset]:
    """Yield the time offsets of recordings to the first whose rotation is known.

    :param turns: rotations of IMUs, then of trajectories.
    :param cameras: names of cameras, whose images tell no rotation.
    :param bodies: frames of bodies by the namespace of their truth; recordings of two bodies, such
        as segments of a person, are not compared.
    """
    places = [k for k, (_, angles) in enumerate(turns) if isinstance(angles, TurnAngles)]
    reference, angles_of_reference = turns[places[0] if places else 0] if turns else ("", None)
    for source, angles in turns[: _COMPARED + 1]:
        is_reference = angles is angles_of_reference
        if is_reference or _body_of(source, bodies) != _body_of(reference, bodies):
            continue
        if isinstance(angles_of_reference, TurnAngles) and isinstance(angles, TurnAngles):
            yield _offset(source, reference, angles_of_reference, angles)
        else:
            reasons = [v for v in (angles_of_reference, angles) if not isinstance(v, TurnAngles)]
            yield UnknownOffset(source, reference, str(reasons[0]))
    for source in cameras if turns else ():
        yield UnknownOffset(
            source,
            reference,
            "images tell no rotation here; tracked features (sensor_msgs/PointCloud, as those of "
            "VINS-Mono) or a topic of the camera's poses do",
        )


def _offset(
    source: str, reference: str, angles_of_reference: TurnAngles, angles: TurnAngles
) -> SensorOffset | UnknownOffset:
    """Return the time offset of a recording, or why the rotations do not tell it."""
    try:
        return SensorOffset(source, reference, *time_offset_of_turns(angles_of_reference, angles))
    except UnknownOffsetError as error:
        return UnknownOffset(source, reference, str(error))


def _body_of(source: str, bodies: Mapping[str, str]) -> str:
    """Return the frame of the body in the namespace of a topic; empty: unknown."""
    namespaces = [namespace for namespace in bodies if source.startswith(namespace)]
    return bodies[max(namespaces, key=len)] if namespaces else ""


def _read(
    path: Path, topic: str | None, choice: Choice, skip: bool, topics: list[TopicContents]
) -> Iterator[Record]:
    """Yield the records of a file; its topics are appended.

    :raises InputError: for what cannot be read, and a file with neither readings nor poses.
    """
    name = name_of(path)
    if not door.has_topics(path):
        yield from _read_text(path, replace(choice, topic=topic), skip)
        return
    with open_bag(path) as bag:
        infos = list(bag.topics)
        topic_info = None if topic is None else bag.find(topic)
        other_records = _other_records(bag, name)
    topics += [TopicContents(name, info.name, info.type, info.count) for info in infos]
    imus = door.imu_choices(path, choice)
    tracks = [info.name for info in infos if info.type in _POSE_TYPES and info.count]
    paths = [info.name for info in infos if info.type == PATH]
    if topic is not None:
        named_topic = None if topic_info is None else topic_info.name
        imus = [imu for imu in imus if imu.topic is not None and imu.topic == named_topic]
        tracks = [track for track in tracks if track == named_topic]
        if not imus and not tracks:
            raise InputError(f"{path}: {topic}: no such topic of {IMU} or of poses")
    problems = Problems()
    yield from _read_imus(path, imus, choice.frame, skip, problems)
    for track in tracks:
        with problems.collect():
            try:
                yield _read_poses(path, track, skip)
            except InputError:
                if topic is None and track in paths:  # a path of fewer than two poses
                    continue
                raise
    if topic is None:
        temperatures = [info.name for info in infos if info.type == TEMPERATURE and info.count]
        yield from _read_temperatures(path, temperatures, skip, problems)
        yield from other_records
    problems.tell()


def _other_records(bag: Bag, name: str) -> list[Record]:
    """Return the records of a bag that are neither readings nor poses nor temperatures.

    :param name: name of the bag, for the sources of the records.
    """
    cameras = list(camera_records(bag, name, image_size))
    clouds = list(cloud_records(bag, name))
    tracks = list(feature_tracks(bag, name))
    clippings = [replace(counts, source=f"{name}, {counts.source}") for counts in bag.clippings]
    return [*clippings, *cameras, *clouds, *tracks]


def _read_imus(
    path: Path, imus: Sequence[Choice], frame: str | None, skip: bool, problems: Problems
) -> Iterator[Record]:
    """Yield the readings of each IMU of a bag; what cannot be read becomes a problem.

    :param imus: topics of each IMU: one, or one for each triad.
    :param frame: frame that at least one of the IMUs must have; None: any.
    """
    empty_count = 0
    for imu in imus:
        with problems.collect():
            label = imu.topic or f"{imu.gyro_topic}, {imu.accel_topic}"
            has_readings = yield from _read_frames(path, imu, f"{name_of(path)}, {label}", skip)
            empty_count += not has_readings
    if frame is not None and empty_count == len(imus):
        with problems.collect():
            raise InputError(f"{path}: contains no readings of the frame {frame}")


def _read_poses(path: Path, topic: str, skip: bool) -> States:
    """Return the poses of a topic in the order of the bag."""
    handling = Handling(tell_skipped(path) if skip else None)
    states = door.format_of(path).states(path, topic, False, handling)
    return replace_fields(states, source=f"{name_of(path)}, {topic}")


def _read_temperatures(
    path: Path, topics: Sequence[str], skip: bool, problems: Problems
) -> Iterator[TemperatureRecord]:
    """Yield the temperatures of each topic; what cannot be read becomes a problem."""
    for topic in topics:
        with problems.collect():
            skipped = tell_skipped(path) if skip else None
            degrees = read_temperature(path, topic, skipped).temperature
            yield TemperatureRecord(f"{name_of(path)}, {topic}", degrees)


def _read_frames(
    path: Path, choice: Choice, source: str, skip: bool
) -> Generator[Record, None, bool]:
    """Yield the readings of a topic; of several frames their numbers, and those of each.

    :returns: True if there are any.
    """
    handling = Handling(tell_skipped(path) if skip else None)
    try:
        blocks = iter(door.reading_blocks(path, choice, handling))
        head = next(blocks, None)
        if head is None:
            return False
        yield replace_fields(concatenate(chain([head], blocks)), source=source)
    except MixedFramesError as error:
        yield error.topic._replace(source=source)
        for frame in error.topic.frames:
            yield from _read_frames(path, replace(choice, frame=frame), f"{source}, {frame}", skip)
    return True


def _read_text(path: Path, choice: Choice, skip: bool) -> Iterator[Record]:
    """Yield the records of a text table or of a dataset's folder."""
    if path.is_dir():
        for camera in folder_cameras(path):
            record = camera.record()
            if record is not None:
                yield record
    topic = choice.topic
    try:
        skipped = tell_skipped(path) if skip else None
        yield replace_fields(door.read_readings(path, choice, skipped), source=name_of(path))
    except InputError as error:
        try:
            states = door.read_states(path, topic, skip, is_trajectory=True, ordered=False)
            if states.skipped:
                tell_skipped(path)(states.skipped)
            yield replace_fields(states, source=name_of(path))
        except InputError:
            raise error from None
        return
    if path.is_dir() and has_truth(path):
        states = door.read_states(path, ordered=False)
        yield replace_fields(states, source=f"{name_of(path)}, states")


def _sensor(measures: ReadingMeasures) -> SensorContents:
    """Return the summary of an IMU's readings."""
    readings, clock = measures.readings, measures.clock
    noise = measures.noise_density
    shown = [_densities(noise, triad) for triad in range(2)]
    return SensorContents(
        source=readings.source,
        frame_id=readings.frame_id,
        readings=len(readings),
        duration_s=0.0 if clock is None else clock.duration,
        rate_hz=None if clock is None else clock.rate,
        rate_sigma_hz=None if clock is None else clock.rate_sigma,
        clock="" if clock is None else clock.kind,
        lost=0 if clock is None else clock.lost,
        rest_s=measures.rest_time,
        moving_s=measures.duration - measures.rest_time if len(measures.rest) else 0.0,
        rest_force=measures.rest_force,
        gyroscope_noise_density=shown[0],
        accelerometer_noise_density=shown[1],
        nearest_presets=_nearest(noise, 0.0 if clock is None else clock.rate),
        notes=readings.notes,
    )


def _densities(noise: tuple[Array, Array] | None, triad: int) -> tuple[float, ...] | None:
    """Return the noise densities (3,) of a triad; None if any is unknown or 0."""
    if noise is None or not noise[triad].all():
        return None
    return tuple(noise[triad].tolist())


def _nearest(noise: tuple[Array, Array] | None, rate: float) -> tuple[str, ...]:
    """Return the presets whose noise is nearest, as ratios of the mean densities."""
    if noise is None or not all(triad.all() for triad in noise):
        return ()
    floor = np.array([np.exp(np.log(triad).mean()) for triad in noise])
    distances = []
    for name in files.names("imus"):
        density = true_noise(load_truth(name), rate)["noise_density"].reshape(2, 3).mean(axis=1)
        if density.all():
            distances.append((float(np.abs(np.log(density / floor)).sum()), name))
    return tuple(name for _, name in sorted(distances)[:_NEAREST])


def _temperatures(record: TemperatureRecord) -> Iterator[TemperatureContents]:
    """Yield the contents of a record with temperatures."""
    number = int(np.count_nonzero(np.isfinite(record.temperature)))
    if number:
        yield TemperatureContents(record.source, number, *record.extremes)


def _poses(states: States) -> PoseContents:
    """Return the summary of a topic or file of poses."""
    clock = None
    with suppress(InputError):  # fewer than two different stamps
        clock = estimate_clock(states.t_ns)
    return PoseContents(
        source=states.source,
        frame_id=states.frame_id,
        child_frame_id=states.child_frame_id,
        poses=len(states),
        duration_s=0.0 if clock is None else clock.duration,
        rate_hz=None if clock is None else clock.rate,
        length_m=float(step_lengths(states.position).sum()),
    )
