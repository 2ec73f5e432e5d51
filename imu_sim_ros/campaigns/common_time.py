# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors of two estimates of one motion over the time that both cover.

An error grows with time: an estimate that leaves out the end or the start of a motion has smaller
errors than the same estimate of all of it. Of each pair of estimators with different time, a run
therefore has its metrics a second time, over the time that both cover.
"""

from collections.abc import Callable, Mapping

import numpy as np

from imu_sim_ros.campaigns.metrics import Metrics, grows_with_time
from imu_sim_ros.core.errors import ImuSimError
from imu_sim_ros.core.records import States
from imu_sim_ros.core.types import Integers, Mask, Times
from imu_sim_ros.navigation.coverage import TruthTime
from imu_sim_ros.recordings.order import longest_step_ns
from imu_sim_ros.terminal.json_text import json_text

_ROUNDING_NS = 1_000_000
"""Largest distance of a pose from a span to which it belongs: stamps of text are rounded [ns]."""


def pose_spans(t_ns: Times, max_gap: float) -> Integers:
    """Return the spans (m, 2) between poses that have no gap between them [ns].

    :param t_ns: (n,) stamps [ns], increasing, n > 0.
    :param max_gap: longer intervals are gaps [s].
    """
    breaks = np.flatnonzero(np.diff(t_ns) > longest_step_ns(max_gap))
    starts, ends = np.append(0, breaks + 1), np.append(breaks, len(t_ns) - 1)
    return np.column_stack([t_ns[starts], t_ns[ends]])


def common_spans(a: Integers, b: Integers) -> Integers:
    """Return the intersections (m, 2) of spans, in order [ns]."""
    begin = np.maximum(a[:, None, 0], b[None, :, 0])
    end = np.minimum(a[:, None, 1], b[None, :, 1])
    common: Integers = np.column_stack([begin[begin < end], end[begin < end]])
    return common


def span_mask(t_ns: Times, spans: Integers) -> Mask:
    """Return a mask (n,), True for stamps in one of the spans (m, 2)."""
    if not len(spans):
        return np.zeros(len(t_ns), np.bool_)
    index = np.searchsorted(spans[:, 0] - _ROUNDING_NS, t_ns, side="right") - 1
    within: Mask = (index >= 0) & (t_ns <= spans[index, 1] + _ROUNDING_NS)
    return within


def common_time_metrics(
    tracks: Mapping[str, tuple[States, float]],
    truth_ns: Times,
    metrics: Callable[[str, States], Metrics],
) -> dict[str, str]:
    """Return the metrics over common time by estimator, as the column ``common_time`` has them.

    The column is a JSON object: by the name of another estimator the ``share`` of the truth's time
    that both cover, and those metrics that grow with time. It lacks the estimators that cover the
    same time, and is empty if all do.

    :param tracks: estimates of one motion and the gaps that each may have [s], by estimator.
    :param truth_ns: (n,) stamps of the truth [ns].
    :param metrics: returns the metrics of a part of an estimator's track.
    """
    spans = {name: pose_spans(track.t_ns, gap) for name, (track, gap) in tracks.items()}
    columns: dict[str, dict[str, Metrics]] = {name: {} for name in tracks}
    clock = TruthTime(truth_ns, max((gap for _, gap in tracks.values()), default=0.0))
    for name, (track, _) in tracks.items():
        for partner in tracks:
            if partner == name:
                continue
            common = common_spans(spans[name], spans[partner])
            rows = span_mask(track.t_ns, common)
            if rows.all() and span_mask(tracks[partner][0].t_ns, common).all():
                continue
            time = int(np.sum(np.diff(clock.at(common.ravel()).reshape(-1, 2))))
            share = float(time / clock.whole_ns)
            columns[name][partner] = {"share": share, **_part(name, track, rows, metrics)}
    return {name: json_text(column) for name, column in columns.items() if column}


def _part(
    name: str,
    track: States,
    rows: Mask,
    metrics: Callable[[str, States], Metrics],
) -> Metrics:
    """Return the metrics of some rows of a track that grow with time; none of too few rows."""
    if rows.sum() < 2:
        return {}
    try:
        part_metrics = metrics(name, track.rows(rows))
    except ImuSimError:
        return {}
    return {key: value for key, value in part_metrics.items() if grows_with_time(key)}
