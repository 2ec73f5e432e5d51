# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimates of one flight as sections of a page: table, paths and errors, then each by its axes.

Every error is estimate minus truth. An estimate has one colour in all plots; axes have theirs.
"""

from collections.abc import Iterable, Sequence
from functools import reduce
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.campaigns.common_time import common_spans, pose_spans, span_mask
from imu_sim_ros.core import rotation
from imu_sim_ros.core.conventions import AXES
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import States, replace_fields
from imu_sim_ros.core.types import Array, Mask, Times
from imu_sim_ros.navigation.comparison import Comparison, compare
from imu_sim_ros.navigation.evaluation import anees_band, gauge_at, invertible, nees, statistics
from imu_sim_ros.recordings.order import POSES_GAP
from imu_sim_ros.reports.page import Item, Section, plot, table
from imu_sim_ros.reports.streams import curve, extreme_rows, track

NOT_MEASURED: Final = 1e5
"""Variance from which a number is not measured: odometry of wheels states 1e6 of its height."""
SIGMAS: Final = 3.0
"""Half the width of the bands of stated deviations, in deviations."""
_TURN_DEG: Final = 300.0
"""Step of a yaw that is a wrap by 360 degrees [deg]."""
_LEAST_NEES: Final = 1e-3
"""Smallest NEES of a picture: that of a body at rest may be any small number."""
_RPE_S: Final = 1.0
"""Time between the poses of a relative error in the table [s]."""
_HEIGHTS: Final = ("y", "low", "high")
_PARTS: Final = (("position", "m"), ("attitude", "rad"))
_DIGITS: Final = 4
"""Digits of errors in the table."""
_MOVED: Final = (
    "in a frame of its own, not that of the truth; moved, and turned about z, so that its first "
    "pose is that of the truth, and compared from there on"
)


class TruthWithEstimates(NamedTuple):
    """One truth with its estimates."""

    title: str
    """Subject of its sections: motion, or the topic of odometry with a truth of its own."""
    truth: States | None
    """True states; None: nothing is compared."""
    estimates: Sequence[States]


class ComparedEstimate(NamedTuple):
    """An estimate in the frame of its truth, compared with it."""

    states: States
    colour: int
    """Number of its colour in all plots."""
    comparison: Comparison | None
    """Comparison with the truth; None: impossible, for the reason in ``problem``."""
    problem: str = ""
    moved: bool = False
    """True if it was moved and turned into the frame of the truth."""

    @property
    def name(self) -> str:
        """Name of the topic or file."""
        return self.states.source


def estimate_sections(path: Path, flights: Sequence[TruthWithEstimates]) -> list[Section]:
    """Return the sections of truths and estimates: first the comparison, then each one."""
    groups: list[tuple[TruthWithEstimates, list[ComparedEstimate]]] = []
    sections: list[Section] = []
    number = 0
    for flight in flights:
        estimates = []
        for states in flight.estimates:
            estimates.append(_compare(states, flight.truth, number))
            number += 1
        groups.append((flight, estimates))
    pairs = [(flight, estimate) for flight, estimates in groups for estimate in estimates]
    compared = [
        k for k, (flight, _) in enumerate(groups) if flight.truth is not None and flight.estimates
    ]
    shown = compared[0] if compared else None
    if shown is not None:
        sections.append(_overview(path, groups, shown))
    for k, (flight, estimates) in enumerate(groups):
        sections.append(_motion(path, flight, estimates, with_path=k != shown))
    for flight, estimate in pairs:
        if estimate.comparison is not None:
            start_ns = _start(flight)
            sections.append(_errors(path, estimate, estimate.comparison, start_ns))
    return sections


def _start(flight: TruthWithEstimates) -> int:
    """Return the time that plots call zero [ns]: the first stamp of the truth."""
    tracks = [flight.truth] if flight.truth is not None else flight.estimates
    return min(int(states.t_ns[0]) for states in tracks)


def _seconds(t_ns: Times, start_ns: int) -> Array:
    """Return stamps (n,) as seconds since a start."""
    return np.asarray((t_ns - start_ns) * 1e-9, np.float64)


def _compare(states: States, truth: States | None, colour: int) -> ComparedEstimate:
    """Compare an estimate with its truth, in the frame of the truth.

    One in another frame, such as that of odometry, is moved to the truth at its first pose, and
    turned about z.
    """
    if truth is None:
        return ComparedEstimate(states, colour, None)
    try:
        comparison = compare(states, truth)
        if not (states.frame_id and truth.frame_id) or states.frame_id == truth.frame_id:
            return ComparedEstimate(states, colour, comparison)
        poses = comparison.unaligned
        gauge = gauge_at(poses, comparison.truth)
        covariance = poses.covariance
        if covariance is not None:
            turn = np.kron(np.eye(2), gauge.r)
            covariance = turn @ covariance @ turn.T
        placed = replace_fields(gauge.apply(poses), covariance=covariance, frame_id=truth.frame_id)
        return ComparedEstimate(placed, colour, compare(placed, truth), moved=True)
    except InputError as error:
        return ComparedEstimate(states, colour, None, str(error))


# The overview.


def _overview(
    path: Path, groups: Sequence[tuple[TruthWithEstimates, Sequence[ComparedEstimate]]], shown: int
) -> Section:
    """Return the table of all estimates, with paths and errors on common axes.

    :param shown: number of the flight whose paths are drawn.
    """
    estimates = [estimate for _, group in groups for estimate in group]
    compared = [estimate for estimate in estimates if estimate.comparison is not None]
    common = _common_rows(compared)
    items: list[Item] = [_best(compared, common)] if len(compared) > 1 else []
    items.append(_table(path, estimates, common))
    notes = (
        "Errors are estimate minus truth, root mean square; the drift is the last position error "
        "over the length of the path; a NEES of 3 is expected, less if not all axes are measured"
    )
    if common is not None:
        notes += "; the ATE over common time [m] is that of the poses that all estimates cover"
    items.append({"kind": "text", "text": f"{notes}.", "faint": True})
    items += [
        {"kind": "text", "text": f"{estimate.name}: {estimate.problem}"}
        for estimate in estimates
        if estimate.problem
    ]
    moved = ", ".join(estimate.name for estimate in estimates if estimate.moved)
    if moved:
        items.append({"kind": "text", "text": f"{moved}: {_MOVED}"})
    items.append(_path(*groups[shown]))
    if compared:
        items.append({"kind": "plots", "items": _overlays(groups, f"{path} errors")})
    return Section(f"{path.name}: estimates", items, "estimates")


def _common_rows(compared: Sequence[ComparedEstimate]) -> list[Mask] | None:
    """Return the compared poses of each estimate that lie in the time common to all.

    None: all estimates cover the same time.
    """
    spans = [pose_spans(comparison.t_ns, POSES_GAP) for comparison in _comparisons(compared)]
    if len(spans) < 2:
        return None
    common = reduce(common_spans, spans)
    rows = [span_mask(comparison.t_ns, common) for comparison in _comparisons(compared)]
    return None if all(mask.all() for mask in rows) else rows


def _comparisons(estimates: Iterable[ComparedEstimate]) -> list[Comparison]:
    """Return the comparisons of the estimates that could be compared."""
    return [estimate.comparison for estimate in estimates if estimate.comparison is not None]


def _common_ate(
    compared: Sequence[ComparedEstimate], common: Sequence[Mask] | None
) -> list[float | None]:
    """Return the ATE of each estimate [m], over the common time if the times differ."""
    if common is None:
        return [comparison.rms_position for comparison in _comparisons(compared)]
    return [
        statistics(np.linalg.norm(comparison.position[rows], axis=1)).rmse if rows.any() else None
        for comparison, rows in zip(_comparisons(compared), common, strict=True)
    ]


def _best(compared: Sequence[ComparedEstimate], common: Sequence[Mask] | None) -> Item:
    """Return which estimate has the smallest ATE, and the next one."""
    sizes = [
        (ate, estimate.name)
        for estimate, ate in zip(compared, _common_ate(compared, common), strict=True)
        if ate is not None
    ]
    if len(sizes) < 2:
        return {"kind": "text", "text": "The estimates have no time in common."}
    (ate, name), (next_ate, next_name), *_ = sorted(sizes)
    over = " over the time that all cover" if common is not None else ""
    text = f"Smallest ATE{over}: {name}, {ate:.3g} m; next {next_name}, {next_ate:.3g} m."
    return {"kind": "text", "text": text}


def _table(
    path: Path, estimates: Sequence[ComparedEstimate], common: Sequence[Mask] | None
) -> Item:
    """Return the table of the errors of all estimates."""
    compared = [estimate for estimate in estimates if estimate.comparison is not None]
    common_ate = dict(
        zip((estimate.name for estimate in compared), _common_ate(compared, common), strict=True)
    )
    header = ["estimate", "ATE [m]"]
    header += ["ATE, common time"] if common is not None else []
    header += [f"RPE {_RPE_S:g} s [m]", "drift [%]", "attitude [rad]", "coverage [%]"]
    header += ["NEES position", "NEES attitude"]
    rows: list[list[object]] = []
    for estimate in estimates:
        comparison = estimate.comparison
        if comparison is None:
            rows.append([estimate.name, *[None] * (len(header) - 1)])
            continue
        row: list[object] = [estimate.name, comparison.rms_position]
        row += [common_ate[estimate.name]] if common is not None else []
        drift = None
        if comparison.distance > 0.0:
            drift = 100.0 * comparison.final_position / comparison.distance
        row += [_relative_error(comparison), drift, comparison.rms_attitude]
        row += [100.0 * comparison.coverage.share]
        for part in range(len(_PARTS)):
            consistency = _nees(comparison, part)
            row.append(None if consistency is None else float(np.mean(consistency.values)))
        rows.append(row)
    item = table("all estimates", header, rows, search=False)
    item["digits"] = _DIGITS
    item["links"] = {estimate.name: _title(path, estimate.name) for estimate in compared}
    return item


def _relative_error(comparison: Comparison) -> float | None:
    """Return the root mean square of the relative position error over 1 s [m]."""
    try:
        errors = comparison.relative(_RPE_S)
    except InputError:  # a shorter flight
        return None
    return statistics(errors.translation).rmse if len(errors.translation) else None


def _path(flight: TruthWithEstimates, estimates: Sequence[ComparedEstimate]) -> Item:
    """Return the paths of a truth and its estimates."""
    series = (
        [] if flight.truth is None else [track(flight.truth.source, None, flight.truth.position)]
    )
    series += [
        track(estimate.states.source, estimate.colour, estimate.states.position)
        for estimate in estimates
    ]
    return {"kind": "path", "title": "Path", "series": series}


def _overlays(
    groups: Sequence[tuple[TruthWithEstimates, Sequence[ComparedEstimate]]], link: str
) -> list[Item]:
    """Return lengths of errors and the NEES over time, all estimates on the same axes."""
    lengths: list[list[Item]] = [[], []]
    consistency: list[list[Item]] = [[], []]
    for flight, estimates in groups:
        for estimate in estimates:
            comparison = estimate.comparison
            if comparison is None:
                continue
            t_s = _seconds(comparison.t_ns, _start(flight))
            for part, errors in enumerate((comparison.position, comparison.attitude)):
                size = np.linalg.norm(errors, axis=1)
                lengths[part].append(curve(estimate.name, estimate.colour, t_s, size))
                nees_of_part = _nees(comparison, part)
                if nees_of_part is not None:
                    usable = nees_of_part.usable
                    drawn = np.maximum(nees_of_part.values, _LEAST_NEES)
                    consistency[part].append(
                        curve(estimate.name, estimate.colour, t_s[usable], drawn)
                    )
    plots = []
    for (name, unit), series in zip(_PARTS, lengths, strict=True):
        title = f"Length of the {name} error"
        plots.append(plot(title, "time [s]", f"[{unit}]", series, legend=True, link=link))
    for (name, _), series in zip(_PARTS, consistency, strict=True):
        if series:
            ends = [min(line["x"][0] for line in series), max(line["x"][-1] for line in series)]
            title = f"NEES of the {name}"
            series = [_nees_band(ends), *series]
            label = "NEES, 3 expected"
            plots.append(plot(title, "time [s]", label, series, "y", legend=True, link=link))
    return plots


def _nees_band(ends: Sequence[float]) -> Item:
    """Return the band of the NEES of a consistent estimate."""
    band = anees_band(3, 1)
    inner = {"name": "95 % of a consistent estimate", "colour": None, "x": list(ends)}
    return {**inner, "low": [band.low] * 2, "high": [band.high] * 2}


class _Nees(NamedTuple):
    """NEES of position or attitude."""

    values: Array
    """(k,) values of the usable poses."""
    usable: Mask
    """(m,) poses with an invertible covariance."""
    freedom: int
    """Number of measured axes: the expected value."""


def _covariance(comparison: Comparison) -> Array | None:
    """Return the stated covariances (m, 6, 6); None without any."""
    covariance = comparison.unaligned.covariance
    return covariance if covariance is not None and np.any(covariance) else None


def _nees(comparison: Comparison, part: int) -> _Nees | None:
    """Return the NEES of the position (0) or the attitude (1) over the axes that are measured."""
    covariance = _covariance(comparison)
    if covariance is None:
        return None
    errors = (comparison.position, comparison.attitude)[part]
    stated = covariance[:, 3 * part : 3 * part + 3, 3 * part : 3 * part + 3]
    axes = np.flatnonzero((stated[:, range(3), range(3)] < NOT_MEASURED).any(axis=0))
    if not len(axes):
        return None
    stated = stated[:, axes[:, None], axes]
    usable = invertible(stated)
    usable &= (np.diagonal(stated, axis1=1, axis2=2) < NOT_MEASURED).all(axis=1)
    if not usable.any():
        return None
    return _Nees(nees(errors[usable][:, axes], stated[usable]), usable, len(axes))


# Motion and errors in detail.


def _motion(
    path: Path, flight: TruthWithEstimates, estimates: Sequence[ComparedEstimate], with_path: bool
) -> Section:
    """Return roll, pitch and yaw of a truth and its estimates, with their paths if asked."""
    tracks = [] if flight.truth is None else [(flight.truth, None)]
    items: list[Item] = [_path(flight, estimates)] if with_path else []
    states = [*tracks, *((estimate.states, estimate.colour) for estimate in estimates)]
    link = f"{path} {flight.title} orientation"
    plots = _orientation(states, _start(flight), link)
    items.append({"kind": "plots", "items": plots})
    return Section(f"{path.name}: {flight.title}", items, flight.title)


def _orientation(
    tracks: Sequence[tuple[States, int | None]], start_ns: int, link: str
) -> list[Item]:
    """Return plots of roll, pitch and yaw over the time since ``start_ns``."""
    series: list[list[Item]] = [[], [], []]
    for states, colour in tracks:
        angles = np.rad2deg(rotation.to_euler(states.q_wb))
        t_s = (states.t_ns - start_ns) * 1e-9
        for k in range(3):
            rows = extreme_rows(angles[:, k])
            values = angles[rows, k]
            # A turn through 180 deg is a step of the angle, not a motion: the line is interrupted.
            values[1:][np.abs(np.diff(values)) > _TURN_DEG] = np.nan
            line = {"name": states.source, "colour": colour, "x": t_s[rows], "y": values}
            series[k].append(line | {"thin": True})
    return [
        plot(f"Orientation: {name}", "time [s]", "[deg]", lines, link=link, legend=True)
        for name, lines in zip(("roll", "pitch", "yaw"), series, strict=True)
    ]


def _title(path: Path, name: str) -> str:
    """Return the title of a plot of an estimate's errors."""
    return f"{path.name}: errors of {name}"


def _errors(
    path: Path, estimate: ComparedEstimate, comparison: Comparison, start_ns: int
) -> Section:
    """Return the errors of an estimate by axis, each in its band of three stated deviations.

    Numbers are of all poses; a picture has the extremes of each of its columns.
    """
    t_s = _seconds(comparison.t_ns, start_ns)
    covariance = _covariance(comparison)
    plots = []
    for part, (title, unit) in enumerate(_PARTS):
        errors = (comparison.position, comparison.attitude)[part]
        drawn = []
        for k, axis in enumerate(AXES):
            row = 3 * part + k
            variance = None if covariance is None else covariance[:, row, row]
            if variance is not None and variance.min() >= NOT_MEASURED:
                continue
            drawn.append((axis, error_series(t_s, errors[:, k], variance, axis)))
        scale = _common_range(series for _, series in drawn)
        for axis, series in drawn:
            name = f"{estimate.name}: {title} error {axis}"
            label = f"estimate - truth [{unit}]"
            item = plot(name, "time [s]", label, series, link=f"{path} errors", legend=True)
            item["y"]["range"] = scale
            plots.append(item)
    text = _summary(estimate.name, comparison, t_s)
    items: list[Item] = [{"kind": "text", "text": text}, {"kind": "plots", "items": plots}]
    return Section(_title(path, estimate.name), items, f"errors of {estimate.name}")


def _common_range(plots: Iterable[Sequence[Item]]) -> list[float] | None:
    """Return the range of values that several plots have in common, with a margin."""
    values = [line[key] for lines in plots for line in lines for key in _HEIGHTS if key in line]
    if not values:
        return None
    joined = np.concatenate(values)
    low, high = float(np.nanmin(joined)), float(np.nanmax(joined))
    margin = 0.04 * (high - low) or 0.5 * abs(high) or 1.0
    return [low - margin, high + margin]


def error_series(
    t_s: Array, errors: Array, variance: Array | None, colour: int | str
) -> list[Item]:
    """Return the line of errors (n,) and the band of three stated deviations, in one colour."""
    rows = extreme_rows(errors)
    line: Item = {"name": "error", "colour": colour, "x": t_s[rows], "y": errors[rows]}
    if variance is None:
        return [line]
    stated = np.where(variance[rows] < NOT_MEASURED, variance[rows], np.nan)
    sigma = SIGMAS * np.sqrt(np.maximum(stated, 0.0))
    band = {"name": "3 sigma, as stated", "colour": colour, "x": t_s[rows]}
    return [{**band, "low": -sigma, "high": sigma}, line]


def _summary(name: str, comparison: Comparison, t_s: Array) -> str:
    """Return the size of an estimate's errors, its coverage and its mean NEES."""
    size = np.linalg.norm(comparison.position, axis=1)
    worst = int(np.argmax(size))
    text = (
        f"{name}: {comparison.rms_position:.4g} m root mean square over {len(size):,} poses, "
        f"{size[-1]:.4g} m at the end, at most {size[worst]:.4g} m (at {t_s[worst]:.6g} s); "
        f"estimate minus truth; {comparison.coverage.words()} of the truth's time"
        f"{uncovered_count_text(comparison.without_truth, 'poses')}"
    )
    if _covariance(comparison) is None:
        return f"{text}; it has no covariance, hence no NEES"
    for part, (title, _) in enumerate(_PARTS):
        consistency = _nees(comparison, part)
        if consistency is None:
            continue
        mean, usable = float(np.mean(consistency.values)), consistency.usable
        text += f"; mean NEES of the {title} {mean:.4g} ({consistency.freedom} expected)"
        if not usable.all():
            text += f" over the {int(usable.sum()):,} poses that state one"
    return text


def uncovered_count_text(count: int, kind: str) -> str:
    """Return the number of poses or readings that have no truth, for the end of a sentence."""
    return f"; {count:,} {kind} without a truth are left out" if count else ""
