# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A trajectory, or attitudes alone, against a truth."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple, Protocol, TypedDict, overload

import numpy as np

from imu_sim_ros.core.arguments import (
    BAG_OR_FILE,
    array,
    boolean,
    choice,
    name_of,
    number,
    refuse,
    suggest_keywords,
    text,
)
from imu_sim_ros.core.arguments import path as checked_path
from imu_sim_ros.core.arguments import topic as checked_topic
from imu_sim_ros.core.conventions import TRUTH_TOPIC
from imu_sim_ros.core.digits import interval_texts
from imu_sim_ros.core.errors import InputError, Problems, warn
from imu_sim_ros.core.records import States, replace_fields
from imu_sim_ros.core.types import Array, Integers, JsonObject, Mask, Times, field_values
from imu_sim_ros.formats.door import has_topics, read_trajectory
from imu_sim_ros.inputs.poses import write_tum
from imu_sim_ros.inputs.tables import Table
from imu_sim_ros.jobs.attitude import (
    AttitudeEvaluation,
    evaluate_attitude,
    is_attitude_estimate,
    statistics_table,
)
from imu_sim_ros.jobs.measured import ReadingsEvaluation, evaluate_measured, sensor_of
from imu_sim_ros.jobs.readings import HasPoses, poses_in_any_order
from imu_sim_ros.jobs.tracks import has_truth, odometry_topics
from imu_sim_ros.jobs.tracks import truth_topic as truth_topic_of
from imu_sim_ros.jobs.writing import SkipBadRows, save_output
from imu_sim_ros.navigation.association import (
    ALIGNMENTS,
    poses_at,
)
from imu_sim_ros.navigation.comparison import Comparison, compare
from imu_sim_ros.navigation.coverage import coverage_line
from imu_sim_ros.navigation.evaluation import (
    DELTA_UNITS,
    PoseNees,
    statistics,
)
from imu_sim_ros.navigation.time_offset import time_offset as time_offset_of
from imu_sim_ros.recordings.findings.catalogue import pair_findings, pose_findings, use_findings
from imu_sim_ros.recordings.findings.policy import EVALUATE
from imu_sim_ros.recordings.findings.pose_order import sort_poses
from imu_sim_ros.recordings.findings.roles import TrajectoryUse, TruthPairs
from imu_sim_ros.sensors.camera.model import reprojection_errors
from imu_sim_ros.terminal.text_tables import TextTable, html_of

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from imu_sim_ros.datasets.tracks import TrackFolder
    from imu_sim_ros.plots.style import Figure


_FRACTIONS: Final = (0.1, 0.2, 0.3, 0.4, 0.5)
"""Default distances of the RPE, as fractions of the path's length."""
_LONGEST_GAP_NS: Final = 20_000_000
"""Poses further apart are not interpolated."""
_SAME_NS: Final = 1_000
"""A pose this near to a frame is of its time."""


class TimeOffset(NamedTuple):
    """A time offset that was found and removed."""

    value_s: float
    """Time added to the estimate's stamps."""
    low_s: float
    """Lower end of its 95 % interval."""
    high_s: float
    """Upper end of its 95 % interval."""
    ate_rmse_m_before: float
    """The ATE without it."""


class Reprojection(TypedDict):
    """Reprojection errors of a camera's features, from the estimated and the true poses."""

    camera: str
    features: int
    """Features with poses at their times, out of ``of``."""
    of: int
    behind: int
    """Features whose landmarks would not be seen."""
    rms_px: float | None
    """Deviation in u and in v [pixels]; None without features."""
    median_px: float | None
    """Median of the distances [pixels]."""
    behind_of_truth: int
    rms_px_of_truth: float | None
    median_px_of_truth: float | None


@dataclass(frozen=True, repr=False, eq=False)
class Evaluation(Comparison):
    """The errors of an estimate, estimate minus truth, at the m times that both cover."""

    time_offset: TimeOffset | None = None
    """Offset added to the estimate's stamps, on request."""
    reprojection: list[Reprojection] | None = None
    """Reprojection errors of each camera, on request."""
    rpe: tuple[tuple[float, str], ...] = ()
    """Lengths of the pairs of the RPE in :meth:`to_dict`; empty: 1 s and tenths of the path."""

    @property
    def nees(self) -> PoseNees | None:
        """NEES of ``position``, ``attitude`` and ``velocity``; None without a covariance.

        Each has ``mean``, ``final``, ``inside_band`` and ``poses``; see `no_nees`.
        """
        return self.consistency[0]

    @property
    def no_nees(self) -> str | None:
        """Reason why there is no NEES, or none of the position or of the attitude."""
        return self.consistency[1]

    def __repr__(self) -> str:
        without = f" ({self.without_truth} without a truth)" if self.without_truth else ""
        return (
            f"<Evaluation of {len(self.t_ns)} poses{without}, {self.coverage.words()}, "
            f"{self.distance:.4g} m: "
            f"position {self.rms_position:.4g} m rms, attitude {self.rms_attitude:.4g} rad rms>"
        )

    def _repr_html_(self) -> str:
        """Return the text of the result as HTML, for notebooks."""
        return html_of(self.lines())

    def to_dict(self, deltas: Sequence[tuple[float, str]] = ()) -> JsonObject:
        """Return all errors in plain types, as ``--json`` prints them.

        :param deltas: lengths for :meth:`relative`; by default :attr:`rpe`.
        :raises InputError: for a trajectory that is shorter than a delta.
        """
        deltas = _deltas("deltas", deltas) or self.rpe
        lengths = np.linalg.norm(self.position, axis=1)
        drift = float(lengths[-1]) / self.distance if self.distance > 0.0 else None
        speed = None if self.velocity is None else np.linalg.norm(self.velocity, axis=1)
        return {
            "poses": len(self.t_ns),
            "poses_without_truth": self.without_truth,
            "duration_s": float(self.t_ns[-1] - self.t_ns[0]) * 1e-9,
            **self.coverage.to_dict(),
            "distance_m": self.distance,
            "alignment": {
                "kind": self.kind,
                "scale": self.alignment.scale,
                "rotation": self.alignment.r.tolist(),
                "translation_m": self.alignment.t.tolist(),
            },
            "ate_m": statistics(lengths)._asdict(),
            "attitude_error_rad": statistics(np.linalg.norm(self.attitude, axis=1))._asdict(),
            "rms_attitude_vector_rad": np.sqrt(np.mean(self.attitude**2, axis=0)).tolist(),
            "final_attitude_vector_rad": self.attitude[-1].tolist(),
            "final_position_error_m": float(lengths[-1]),
            "final_drift_percent": None if drift is None else 100.0 * drift,
            "rpe": [self._relative_dict(*delta) for delta in deltas or self._usual_deltas()],
            "time_offset": None if self.time_offset is None else self.time_offset._asdict(),
            "velocity_error_m_s": None if speed is None else statistics(speed)._asdict(),
            "nees": self.nees,
            "no_nees": self.no_nees,
            "reprojection": self.reprojection,
        }

    def _usual_deltas(self) -> list[tuple[float, str]]:
        """Return the usual lengths of relative errors: a second, fractions of the distance."""
        second = [(1.0, "s")] if self.t_ns[-1] - self.t_ns[0] >= 1e9 else []
        parts = _FRACTIONS if self.distance > 0.0 else ()
        return [*second, *((fraction * self.distance, "m") for fraction in parts)]

    def _relative_dict(self, delta: float, unit: str) -> dict[str, object]:
        """Return the relative errors over one length, for JSON."""
        errors = self.relative(delta, unit)
        moved = errors.length > 0.0
        percent = errors.translation[moved] / errors.length[moved] if moved.any() else None
        compared = len(errors.length) > 0
        return {
            "delta": delta,
            "unit": unit,
            "pairs": len(errors.length),
            "pairs_left_out": errors.left_out,
            "translation_m": statistics(errors.translation)._asdict() if compared else None,
            "rotation_rad": statistics(errors.rotation)._asdict() if compared else None,
            "translation_percent": None if percent is None else 100.0 * float(np.mean(percent)),
        }

    def lines(self) -> Iterator[str | TextTable]:
        """Yield the text of the evaluation, as ``evaluate`` prints it."""
        return _lines(self.to_dict())

    def save(self, path: str | Path, *, force: bool = False) -> Path:
        """Write the aligned estimate in TUM format; returns the path.

        :param force: replace what exists.
        :raises InputError: for a path that cannot be used or exists.
        """
        with save_output(path, force) as staged:
            write_tum(staged, self.estimate)
        return Path(path)

    def plot(self, title: str = "Estimate against the truth") -> Figure:
        """Return a matplotlib figure: both paths, and the errors per axis over time."""
        from imu_sim_ros.plots import navigation as pictures

        text("title", title, "a title")
        t = (self.t_ns - self.t_ns[0]) * 1e-9
        title += f"{_ALIGNED[self.kind]}; path {self.distance:.4g} m, ATE {self.rms_position:.4g} m"
        positions = (self.estimate.position, self.truth.position, self.position)
        return pictures.evaluation(t, *positions, self.attitude, title)


_ALIGNED: Final = {
    "none": "",
    "yaw": ", aligned in yaw and position",
    "se3": ", aligned by a rigid motion",
    "sim3": ", aligned by a rigid motion and scale",
}
"""Alignments in the titles of pictures."""


def parse_delta(text: str) -> tuple[float, str]:
    """Return the length and the unit, s, m or frames, of ``1s``, ``10m``, ``5frames``.

    :raises ValueError: for anything else.
    """
    match = re.fullmatch(r"(\d+\.?\d*|\.\d+)\s*(s|min|m|km|frames?)", text.strip())
    if match is None or float(match[1]) == 0.0:
        raise ValueError(f"{text[:40]!r} is not a delta such as 1s, 10m or 5frames")
    scale, unit = _UNITS[match[2]]
    return float(match[1]) * scale, unit


_UNITS: Final = {
    "s": (1.0, "s"),
    "min": (60.0, "s"),
    "m": (1.0, "m"),
    "km": (1000.0, "m"),
    **dict.fromkeys(("frame", "frames"), (1.0, "frames")),
}


def _deltas(name: str, deltas: object) -> tuple[tuple[float, str], ...]:
    """Return the lengths over which relative errors are taken, with their units.

    :raises ConfigurationError: for anything but texts and pairs.
    """
    allowed = "pairs of a number and s, m or frames, or words such as 10m"
    if not isinstance(deltas, list | tuple):
        refuse(name, deltas, allowed, wrong_type=True)
    pairs = []
    for entry in deltas:
        if isinstance(entry, str):
            try:
                entry = parse_delta(entry)
            except ValueError:
                refuse(name, entry, allowed)
        if not isinstance(entry, list | tuple) or len(entry) != 2:
            refuse(name, deltas, allowed, wrong_type=True)
        length, unit = entry
        pairs.append((number(name, length, "above 0", 0.0, exclusive=True), unit))
        choice(name, unit, DELTA_UNITS)
    return tuple(pairs)


class HasAttitude(Protocol):
    """Anything with attitudes in time: orientations, or an object with ``q_wb``."""

    @property
    def t_ns(self) -> Times:
        """(n,) [ns]."""


class _Options(TypedDict, total=False):
    """Keyword arguments of :func:`evaluate` for every kind of estimate."""

    align: str
    max_gap: float
    truth_topic: str | None
    time_offset: bool
    tracks: str | Path | None
    rpe: Sequence[str | tuple[float, str]]
    skip_bad_rows: bool


@overload
def evaluate(  # the topic decides what it is
    estimate: str | Path,
    truth: HasPoses | str | Path,
    *,
    estimate_topic: str,
    imu: str | Path | None = ...,
    **options: Unpack[_Options],
) -> Any: ...


@overload
def evaluate(  # type: ignore[overload-overlap]  # what has positions is compared as a path
    estimate: HasPoses | str | Path,
    truth: HasPoses | str | Path,
    *,
    estimate_topic: str | None = ...,
    **options: Unpack[_Options],
) -> Evaluation: ...


@overload
def evaluate(
    estimate: HasAttitude,
    truth: HasPoses | str | Path,
    *,
    estimate_topic: str | None = ...,
    **options: Unpack[_Options],
) -> AttitudeEvaluation: ...


@suggest_keywords
def evaluate(
    estimate: Annotated[Any, "ESTIMATE", Path],
    truth: Annotated[HasPoses | str | Path, "TRUTH"],
    *,
    estimate_topic: Annotated[str | None, "TOPIC"] = None,
    truth_topic: Annotated[str | None, "TOPIC"] = None,
    align: Annotated[str, ALIGNMENTS] = "none",
    rpe: Annotated[Sequence[str | tuple[float, str]], "DELTA", parse_delta] = (),
    time_offset: Annotated[bool, "--time-offset"] = False,
    max_gap: Annotated[float, "TIME"] = 0.0,
    tracks: Annotated[str | Path | None, "DIR"] = None,
    imu: Annotated[str | Path | None, "NAME|FILE"] = None,
    skip_bad_rows: SkipBadRows = False,
) -> Evaluation | AttitudeEvaluation | ReadingsEvaluation:
    """Compare a trajectory, or attitudes alone, with the truth at the stamps of the estimate.

    Both may also be objects with ``t_ns``, ``position`` and ``q_wb``: a track, odometry, arrays. A
    ``covariance`` (n, 6, 6) of position and attitude in the world's axes gives the NEES. Without
    positions (``q_wb``, ``q_wi`` or ``values`` (n, 4), in the frame of the truth's body) attitudes
    are compared.

    :param estimate: TUM or EuRoC text, or a bag
    :param truth: TUM or EuRoC text, or a bag; may be the same bag
    :param estimate_topic: topic of the estimate, if the bag has several; or that of an orientation
        (``imu/data``), a magnetic field or a pressure
    :param truth_topic: topic of the truth, if the bag has several; by default
        ``ground_truth/odom``
    :param align: align the estimate with the truth first. yaw: heading and position, 4 degrees of
        freedom; se3: a rigid motion; sim3: a rigid motion and scale
    :param rpe: relative error over 1s, 10m or 5frames; repeatable. By default 1s, and tenths of the
        path's length up to half of it
    :param time_offset: find the time offset of the estimate from the motion (up to 1 s) and remove
        it before comparing
    :param max_gap: do not interpolate the truth across longer gaps, nor count them as covered by
        the estimate [s]; 0: 2.5 times the usual interval of each, from 0.5 to 2 s
    :param tracks: folder of generate --format tracks: report the reprojection error, in pixels, of
        its landmarks as seen from the estimate; poses further apart than 20 ms are not interpolated
    :param imu: for an orientation: the sensor, whose imu.mounting applies; by default aligned with
        the body
    :param skip_bad_rows: skip and count bad rows of text and bad messages of bags
    :returns: an :class:`Evaluation`, for attitudes alone an :class:`AttitudeEvaluation`, for the
        readings of other sensors a :class:`ReadingsEvaluation`.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: if they do not overlap in time, or a path cannot be read.

    >>> import imu_sim_ros as ims
    >>> flight = ims.simulate(imu="navigation", trajectory="circle", duration=30, seed=1)
    >>> ims.evaluate(ims.dead_reckon(flight), flight.truth)
    <Evaluation of 6000 poses, coverage 100 %, 74.99 m: position 0.1208 m rms, ...>
    >>> board = ims.simulate(imu="mti3", duration=10, sensors=["orientation"], seed=1)
    >>> ims.evaluate(board.orientation, board.truth)
    <AttitudeEvaluation of 2000 attitudes, coverage 100 %: tilt 0.02025 rad rms, heading ...>
    """
    number("max_gap", max_gap, "a number of seconds, 0 or above", 0.0)
    choice("align", align, ALIGNMENTS)
    boolean("time_offset", time_offset)
    track_folder = (
        None if tracks is None else checked_path("tracks", tracks, "the path of a folder")
    )
    rpe_deltas = _deltas("rpe", rpe)
    skip = boolean("skip_bad_rows", skip_bad_rows)
    trajectory_arguments = {
        "align": None if align == "none" else align,
        "tracks": tracks,
        "time_offset": time_offset or None,
        "rpe": [f"{length:g}{unit}" for length, unit in rpe_deltas] or None,
    }
    table = _measurement_table(estimate, estimate_topic, truth)
    if table is not None:
        _refuse_all(trajectory_arguments, f"omitted: {estimate_topic} is no trajectory")
        measurement, recording = (estimate, str(estimate_topic)), (truth, truth_topic)
        return _compare_measurements(table, measurement, recording, max_gap, imu, skip)
    _refuse_all({"imu": imu}, "omitted: it is about recorded orientations")
    if is_attitude_estimate(estimate):
        _refuse_all(trajectory_arguments, "omitted: attitudes alone have no positions")
        true_track = _track("truth", truth, truth_topic, skip)
        return evaluate_attitude(estimate, true_track, max_gap)
    problems = Problems()
    with problems.collect():
        _check_exchanged(estimate, truth, estimate_topic)
        _check_two(estimate, truth, estimate_topic, truth_topic)
    with problems.collect():
        track = _track("estimate", estimate, estimate_topic, skip)
    with problems.collect():
        true_track = _track("truth", truth, truth_topic, skip)
    with problems.collect():
        image_tracks = None if track_folder is None else _read_tracks(track_folder)
    problems.tell()
    trajectory_errors = evaluation(track, true_track, align, max_gap, time_offset)
    _judge_pairs(estimate, true_track, trajectory_errors)
    if image_tracks is not None:
        reprojection = _reprojection(
            image_tracks, str(track_folder), trajectory_errors.estimate, true_track
        )
        trajectory_errors = replace(trajectory_errors, reprojection=reprojection)
    return replace(trajectory_errors, rpe=rpe_deltas)


def _measurement_table(estimate: object, topic: str | None, truth: object) -> Table | None:
    """Return the sensor's table of an estimate's topic; None: the estimate is a trajectory.

    :raises InputError: for an estimate that cannot be read, with the problem of the truth's path.
    """
    problems = Problems()
    table = None
    with problems.collect():
        table = _table(estimate, topic)
    if problems and isinstance(truth, str | Path):
        with problems.collect():
            has_truth(checked_path("truth", truth, BAG_OR_FILE))
    problems.tell()
    return table


def _judge_pairs(estimate: object, true_track: States, errors: Evaluation) -> None:
    """Refuse an estimate that equals its truth, whose errors would be zero.

    Estimates that this package has computed need no such check.

    :param estimate: argument of :func:`evaluate`.
    :raises InputError: if both are the same.
    """
    if getattr(estimate, "role", "") == "estimate":
        return
    name = name_of(Path(estimate)) if isinstance(estimate, str | Path) else repr(estimate)
    pairs = TruthPairs.of(f"estimate: {name}", errors.unaligned, true_track, errors.truth)
    EVALUATE.judge(pair_findings(pairs), warn)


def _check_exchanged(estimate: object, truth: object, estimate_topic: str | None) -> None:
    """Refuse a truth as the estimate, and an estimate as the truth: the errors' signs would change.

    :raises InputError: if they are exchanged.
    """
    uses: list[TrajectoryUse] = []
    role = truth.role if isinstance(truth, States) else ""
    if isinstance(estimate, States) and role != "truth":
        uses.append(TrajectoryUse(f"estimate: {estimate!r}", estimate.role, "estimate"))
    if isinstance(truth, States):
        uses.append(TrajectoryUse(f"truth: {truth!r}", role, "truth"))
    for use in uses:
        EVALUATE.judge(use_findings(use), warn)
    if not isinstance(estimate, str | Path):
        return
    topic = estimate_topic
    if topic is None and os.path.exists(estimate) and has_topics(Path(estimate)):
        topics = odometry_topics(Path(estimate))
        topic = topics[0] if len(topics) == 1 else None
    if topic is not None and topic.strip("/").endswith(TRUTH_TOPIC):
        use = TrajectoryUse(f"{estimate}: {topic}", "truth", "estimate")
        EVALUATE.judge(use_findings(use), warn)


def _check_two(
    estimate: object, truth: object, estimate_topic: str | None, topic: str | None
) -> None:
    """Refuse a topic of a bag that would be compared with itself, with errors of 0.

    :raises InputError: if it is.
    """
    if not (isinstance(estimate, str | Path) and isinstance(truth, str | Path)):
        return
    if not (os.path.exists(estimate) and os.path.exists(truth)):
        return
    path = Path(estimate)
    if not has_topics(path) or not path.samefile(truth):
        return
    only = next(iter(odometry_topics(path)), None)  # with several, an estimate has to be named
    both = {
        (name or only or "").strip("/") for name in (estimate_topic, truth_topic_of(path, topic))
    }
    if len(both) == 1:
        raise InputError(
            f"{path}: estimate and truth are both /{both.pop()}, whose errors would be 0; name "
            "another topic of one of them"
        )


def _table(estimate: object, topic: str | None) -> Table | None:
    """Return the table of a path's topic; None: the estimate is a trajectory."""
    if not isinstance(estimate, str | Path) or topic is None:
        return None
    file = checked_path("estimate", estimate, BAG_OR_FILE)
    return sensor_of(file, checked_topic("estimate_topic", topic, True))


def _compare_measurements(
    table: Table,
    estimate: tuple[str | Path, str],
    truth: tuple[object, str | None],
    max_gap: float,
    imu: str | Path | None,
    skip_bad_rows: bool,
) -> AttitudeEvaluation | ReadingsEvaluation:
    """Compare a sensor's measurements with the truth of a recording."""
    if not table.of_readings:
        _refuse_all({"imu": imu}, "omitted: it is about orientations")
    recording = checked_path("truth", truth[0], "the path of a recording")
    topic = checked_topic("truth_topic", truth[1])
    measurement = (Path(estimate[0]), estimate[1])
    return evaluate_measured(table, measurement, (recording, topic), max_gap, imu, skip_bad_rows)


def _refuse_all(options: Mapping[str, object], allowed: str) -> None:
    """Refuse each argument that is given; the error says what is allowed."""
    for name, value in options.items():
        if value is not None:
            refuse(name, value, allowed)


def evaluation(
    estimate: States, truth: States, align: str, max_gap: float, find_offset: bool = False
) -> Evaluation:
    """Return the errors of a trajectory; arguments as for :func:`evaluate`.

    :raises InputError: if they do not overlap in time.
    """
    offset = _time_offset(estimate, truth, align, max_gap) if find_offset else None
    if offset is not None:
        estimate = replace_fields(estimate, t_ns=estimate.t_ns + round(offset.value_s * 1e9))
    errors = compare(estimate, truth, align, max_gap)
    return Evaluation(**field_values(errors), time_offset=offset)


def _time_offset(estimate: States, truth: States, align: str, max_gap: float) -> TimeOffset:
    """Return the time offset of an estimate, with the error that remains without it."""
    offset = time_offset_of(estimate, truth, max_gap, scaled=align == "sim3")
    return TimeOffset(*offset, compare(estimate, truth, align, max_gap).rms_position)


def _track(
    name: str, trajectory: HasPoses | str | Path, topic: str | None, skip_bad_rows: bool
) -> States:
    """Return the trajectory of an argument: itself, or the content of a path."""
    topic = checked_topic(f"{name}_topic", topic, isinstance(trajectory, str | Path))
    if isinstance(trajectory, str | Path):
        file = checked_path(name, trajectory, BAG_OR_FILE)
        chosen = truth_topic_of(file, topic) if name == "truth" else topic
        states = read_trajectory(file, chosen, name == "estimate", skip_bad_rows)
        findings = pose_findings(states)
        if name == "estimate":  # compared at its stamps, however few
            findings = [finding for finding in findings if finding.kind != "poses_sparse"]
        EVALUATE.judge(findings, warn)
        return states
    poses = poses_in_any_order(name, trajectory)
    speed, stated = getattr(trajectory, "velocity", None), getattr(trajectory, "covariance", None)
    if speed is not None:
        speed = array(f"{name}.velocity", speed, (len(poses.t_ns), 3))
    if stated is not None and name == "estimate":
        stated = array("estimate.covariance", stated, (len(poses.t_ns), 6, 6))
    return sort_poses(replace_fields(poses, velocity=speed, covariance=stated))


def _lines(result: JsonObject) -> Iterator[str | TextTable]:
    """Yield the text of an evaluation: its dictionary in lines and tables."""
    yield (
        f"{result['poses']} poses, {result['duration_s']:.6g} s, {result['distance_m']:.6g} m, "
        f"alignment: {result['alignment']['kind']}"
    )
    yield coverage_line(result)
    if result["poses_without_truth"]:
        yield f"{result['poses_without_truth']} poses skipped: no truth at their times"
    if result["alignment"]["kind"] == "sim3":
        yield f"scale of the estimate: {result['alignment']['scale']:.6g}"
    if result["time_offset"] is not None:
        offset = result["time_offset"]
        ends = (offset["value_s"], offset["low_s"], offset["high_s"])
        value, low, high = interval_texts(*(1e3 * end for end in ends))
        yield (
            f"time offset: {value} ms ({low} to {high}, 95 %) added to the estimate's stamps; "
            f"ATE {offset['ate_rmse_m_before']:.4g} m without, "
            f"{result['ate_m']['rmse']:.4g} m with it"
        )
    rows = [("ATE position [m]", result["ate_m"]), ("attitude [rad]", result["attitude_error_rad"])]
    if result["velocity_error_m_s"] is not None:
        rows.append(("velocity [m/s]", result["velocity_error_m_s"]))
    for entry in result["rpe"]:
        if entry["pairs"]:
            over = f"RPE {entry['delta']:.3g} {entry['unit']}"
            rows.append((f"{over} [m]", entry["translation_m"]))
            rows.append((f"{over} [rad]", entry["rotation_rad"]))
    yield statistics_table(rows, "Errors, estimate minus truth")
    for entry in result["rpe"]:
        if entry["pairs_left_out"]:
            yield _left_out_line(entry)
    if result["final_drift_percent"] is not None:
        yield (
            f"final drift: {result['final_position_error_m']:.4g} m, "
            f"{result['final_drift_percent']:.4g} % of the distance"
        )
    if result["nees"] is not None:
        yield _nees_table(result["nees"])
    if result["no_nees"] is not None:
        yield f"no NEES: {result['no_nees']}"
    if result["reprojection"] is not None:
        yield from _reprojection_lines(result["reprojection"])


def _left_out_line(entry: JsonObject) -> str:
    """Return how many pairs of the RPE are too long to compare."""
    total = entry["pairs"] + entry["pairs_left_out"]
    return (
        f"RPE {entry['delta']:.3g} {entry['unit']}: {entry['pairs_left_out']} of {total} pairs "
        "left out: they are more than half longer, because common poses are further apart"
    )


def _nees_table(result: PoseNees) -> TextTable:
    """Return the table of the NEES of position, attitude and velocity."""
    low, high = result["band_95"]
    entries = {name: result[name] for name in ("position", "attitude", "velocity")}
    parts = {name: part for name, part in entries.items() if part is not None}
    rows = [
        [
            name,
            f"{part['mean']:.3g}",
            f"{part['final']:.3g}",
            f"{100.0 * part['inside_band']:.0f} %",
            f"{part['poses']} of {part['of']}",
        ]
        for name, part in parts.items()
    ]
    title = f"NEES, 3 expected, 95 % in {low:.3g} to {high:.3g}"
    if result["gauge"] == "first pose":
        title += "; yaw and position fixed at first pose"
    elif result["gauge"] is not None:
        times = (f"{p['fixed_s']:.4g} s ({n})" for n, p in parts.items() if p.get("fixed_s"))
        title += f"; yaw and position fixed after {', '.join(times)}; poses from there on"
    return TextTable(["of", "mean", "final", "inside", "poses"], rows, title)


def _read_tracks(folder: Path) -> TrackFolder:
    """Return the tracks of a folder."""
    from imu_sim_ros.datasets.tracks import read_track_folder  # most evaluations have no camera

    return read_track_folder(folder)


def _reprojection(
    tracks: TrackFolder, name: str, estimate: States, truth: States
) -> list[Reprojection]:
    """Return the reprojection errors of each camera, for the estimate and for the truth.

    :param name: name of the folder.
    :param estimate: aligned with the world of the landmarks.
    :raises InputError: if no feature has a pose of the estimate.
    """
    result = []
    for k, (camera_name, camera) in enumerate(tracks.cameras.items()):
        rows = np.flatnonzero((tracks.camera == k) & ~tracks.wrong)
        row = tracks.uv[rows, 1] - 0.5 * (camera.height - 1)
        t_ns = tracks.true_t_ns[rows] + np.rint(camera.row_time * row * 1e9).astype(np.int64)
        has_poses = _has_poses(estimate.t_ns, t_ns) & _has_poses(truth.t_ns, t_ns)
        total, rows, t_ns = len(rows), rows[has_poses], t_ns[has_poses]
        points, uv = tracks.landmarks[tracks.landmark[rows]], tracks.uv[rows]
        distances = []
        for poses in (estimate, truth):
            interpolated = poses_at(poses, t_ns)
            errors = reprojection_errors(
                camera, interpolated.position, interpolated.q_wb, points, uv
            )
            distances.append(np.linalg.norm(errors[np.isfinite(errors[:, 0])], axis=1))
        lengths, true_lengths = distances
        entry: Reprojection = {
            "camera": camera_name,
            "features": len(rows),
            "of": total,
            "behind": len(rows) - len(lengths),
            "rms_px": _rms_per_axis(lengths),
            "median_px": _median(lengths),
            "behind_of_truth": len(rows) - len(true_lengths),
            "rms_px_of_truth": _rms_per_axis(true_lengths),
            "median_px_of_truth": _median(true_lengths),
        }
        result.append(entry)
    if not any(entry["features"] for entry in result):
        raise InputError(
            f"{name}: no frame has poses of estimate and truth at its time, or within 20 ms "
            "before and after it"
        )
    return result


def _rms_per_axis(lengths: Array) -> float | None:
    """Return the deviation in u and in v: the root of half the mean square of the distances."""
    return float(np.sqrt(np.mean(lengths**2) / 2.0)) if len(lengths) else None


def _median(lengths: Array) -> float | None:
    """Return the median; None without lengths."""
    return float(np.median(lengths)) if len(lengths) else None


def _has_poses(poses_ns: Integers, at_ns: Integers) -> Mask:
    """Return at which times there is a pose, or are two that are near enough to interpolate."""
    index = np.searchsorted(poses_ns, at_ns)
    preceding = poses_ns[np.clip(index - 1, 0, len(poses_ns) - 1)]
    following = poses_ns[np.clip(index, 0, len(poses_ns) - 1)]
    close = np.minimum(np.abs(at_ns - preceding), np.abs(at_ns - following)) <= _SAME_NS
    between = (
        (preceding <= at_ns) & (at_ns <= following) & (following - preceding <= _LONGEST_GAP_NS)
    )
    return np.asarray((close | between) & (at_ns >= poses_ns[0]) & (at_ns <= poses_ns[-1]))


def _reprojection_lines(result: list[Reprojection]) -> list[str]:
    """Return the result, one line for each camera."""
    return [
        f"reprojection, {entry['camera']}: {_shown(entry['rms_px'])} px in u and in v over "
        f"{_features(entry['features'], entry['of'])}; from the true poses "
        f"{_shown(entry['rms_px_of_truth'])} px"
        + (f"; {entry['behind']} landmarks would not be seen" if entry["behind"] else "")
        for entry in result
    ]


def _features(count: int, total: int) -> str:
    """Return how many features have a pose at their time."""
    text = f"{count:,} features"
    return text if count == total else f"{text} of {total:,}, the others without poses"


def _shown(value: float | None) -> str:
    return "no" if value is None else f"{value:.3g}"
