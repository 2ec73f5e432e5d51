# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Share of the truth's time that an estimate covers, and its first interruption.

Errors are means over the existing poses: an estimator that stops in time has small ones.
"""

from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.types import Array, Integers, JsonObject, Mask, Times
from imu_sim_ros.recordings.order import POSES_GAP, gap_length, longest_step_ns

LEAST: Final = 0.9
"""Coverage below which errors do not speak for the whole motion."""
ALLOWANCE: Final = 5.0
"""Time before the first pose in which an estimate may initialise [s]."""
LARGEST_ALLOWANCE: Final = 0.25
"""Largest share of the truth's time that is allowed for the start."""

_FEWEST_STEPS: Final = 3
"""Steps between poses from which on their usual length can be told."""
_UNSAID: Final = 0.1
"""Longest time without a truth that is not reported: stamps of a truth of 10 Hz end as early
[s]."""


class Coverage(NamedTuple):
    """The time that an estimate and its truth have in common."""

    share: float
    """Share of the truth's time, without the allowance for the start: 0 to 1."""
    estimated_s: float
    """Truth's time between poses of the estimate that have no gap between them [s]."""
    truth_s: float
    """Truth's time, without gaps of the truth [s]."""
    initialisation_s: float
    """Truth's time before the first pose [s]."""
    allowed_s: float
    """The part of it that does not count [s]."""
    time_to_failure_s: float
    """Truth's time until the estimate first breaks off, by a gap or by its end [s]."""
    sparse_s: float = 0.0
    """Usual time between poses of an estimate if it is longer than a gap [s]; 0: it is not."""

    def words(self) -> str:
        """Return the coverage as text: ``coverage 9.75 %``."""
        return f"coverage {100.0 * self.share:.3g} %"

    def to_dict(self) -> dict[str, float]:
        """Return the numbers by the names that results have."""
        return {
            "coverage": self.share,
            "estimated_s": self.estimated_s,
            "truth_s": self.truth_s,
            "initialisation_s": self.initialisation_s,
            "initialisation_allowed_s": self.allowed_s,
            "time_to_failure_s": self.time_to_failure_s,
            "sparse_s": self.sparse_s,
        }


def coverage_line(coverage_values: JsonObject) -> str:
    """Return the numbers of :meth:`Coverage.to_dict`, and their meaning for the errors."""
    text = (
        f"coverage: {100.0 * coverage_values['coverage']:.4g} %, "
        f"{coverage_values['estimated_s']:.6g} of "
        f"{coverage_values['truth_s']:.6g} s of the truth"
    )
    if coverage_values["initialisation_allowed_s"]:
        text += f", {coverage_values['initialisation_allowed_s']:.6g} s allowed for the start"
    if coverage_values["coverage"] >= LEAST:
        return text
    sparse = coverage_values["sparse_s"]
    if sparse:
        return (
            f"{text}; the estimate has a pose each {sparse:.4g} s, and the time between poses "
            "counts if it is at most max_gap: "
            f"{argument('max_gap', float(f'{1.5 * sparse:.2g}'), 's')} counts it"
        )
    return (
        f"{text}; begins after {coverage_values['initialisation_s']:.6g} s and breaks off after "
        f"{coverage_values['time_to_failure_s']:.6g} s: the errors below say nothing about the rest"
    )


def truth_line(values: JsonObject) -> str | None:
    """Return the share of an estimate with a truth, and its meaning for the errors.

    None: all of it, apart from an interval at an end.

    :param values: has ``truth_coverage``, ``compared_s``, ``truth_until_s`` and ``duration_s``.
    """
    if values["truth_coverage"] is None or values["duration_s"] - values["compared_s"] < _UNSAID:
        return None
    return (
        f"the truth covers {100.0 * values['truth_coverage']:.4g} % of the readings' time, "
        f"{values['compared_s']:.6g} of {values['duration_s']:.6g} s, and ends after "
        f"{values['truth_until_s']:.6g} s: final errors are those there, and the errors below say "
        "nothing about the rest"
    )


class TruthTime:
    """The clock of a truth: it stands still where the truth has a gap."""

    def __init__(self, truth_ns: Times, max_gap: float) -> None:
        """Set the clock to zero at the first stamp.

        :param truth_ns: (n,) stamps [ns], increasing, n > 1.
        :param max_gap: longer intervals are gaps [s], as in :func:`coverage`; if all are, the
            truth is slow and none is.
        """
        steps = np.diff(truth_ns)
        covered = steps <= longest_step_ns(gap_length(max_gap, POSES_GAP, truth_ns))
        self._covered: Mask = covered if covered.any() else np.ones(len(steps), np.bool_)
        self._stamps = truth_ns
        self._at_stamps = np.concatenate([[0], np.cumsum(np.where(self._covered, steps, 0))])

    @property
    def whole_ns(self) -> int:
        """The truth's time [ns]."""
        return int(self._at_stamps[-1])

    def at(self, t_ns: Times) -> Integers:
        """Return the truth's time at stamps (m,) [ns]; before and after it, that of its ends."""
        if np.array_equal(t_ns, self._stamps):
            return self._at_stamps
        clipped = np.clip(t_ns, self._stamps[0], self._stamps[-1])
        index = np.searchsorted(self._stamps, clipped, side="right") - 1
        index = np.minimum(index, len(self._covered) - 1)
        part = np.where(self._covered[index], clipped - self._stamps[index], 0)
        covered_ns: Integers = self._at_stamps[index] + part
        return covered_ns


def coverage(
    estimate_ns: Times,
    truth_ns: Times,
    max_gap: float = 0.0,
    allowance: float = ALLOWANCE,
    *,
    failed: Mask | None = None,
) -> Coverage:
    """Return how much of the truth's time an estimate covers.

    With the truth's time T, the time E between poses without a gap, and the allowed part A of the
    time before the first pose, the coverage is E / (T - A), where A is at most ``allowance`` and
    at most a quarter of T.

    :param estimate_ns: (n,) stamps of the estimate [ns], increasing.
    :param truth_ns: (m,) stamps of the truth [ns], increasing, m > 1.
    :param max_gap: longer intervals are gaps, of the estimate and of the truth [s]; 0: those of
        more than 2.5 usual intervals of each, from 0.5 to 2 s.
    :param allowance: time allowed before the first pose [s].
    :param failed: (n,) poses with which the estimate has failed, however long it goes on.
    """
    clock = TruthTime(truth_ns, max_gap)
    at_ns = clock.at(estimate_ns)
    steps = np.diff(estimate_ns)
    longest_ns = longest_step_ns(gap_length(max_gap, POSES_GAP, estimate_ns))
    continues: Mask = steps <= longest_ns
    estimated = int(np.sum(np.diff(at_ns)[continues]))
    first_ns = int(at_ns[0]) if len(at_ns) else clock.whole_ns
    allowed = min(first_ns, round(allowance * 1e9), int(LARGEST_ALLOWANCE * clock.whole_ns))
    breaks: Mask = np.append(~continues, True)
    if failed is not None:
        breaks = breaks | failed
    # A pose before or after the truth stands for none of its time.
    lies_in = (estimate_ns >= truth_ns[0]) & (estimate_ns <= truth_ns[-1])
    failure = int(at_ns[np.argmax(breaks)]) if lies_in.any() else 0
    sparse = 0.0
    if len(steps) >= _FEWEST_STEPS and not continues.all():
        usual = float(np.median(steps))
        sparse = usual if usual > longest_ns else 0.0
    return Coverage(
        share=estimated / (clock.whole_ns - allowed),
        estimated_s=1e-9 * estimated,
        truth_s=1e-9 * clock.whole_ns,
        initialisation_s=1e-9 * first_ns,
        allowed_s=1e-9 * allowed,
        time_to_failure_s=1e-9 * failure,
        sparse_s=1e-9 * sparse,
    )


def time_with_truth(estimate_ns: Times, truth_ns: Times) -> float:
    """Return the time of an estimate for which the truth is known, gaps of the truth left out [s].

    :param estimate_ns: (n,) stamps of the estimate [ns], increasing.
    :param truth_ns: (m,) stamps of the truth [ns], increasing.
    """
    return coverage(truth_ns, estimate_ns, allowance=0.0).estimated_s


def beyond(errors: Array, limit: float) -> Mask | None:
    """Return True for errors (n, 3) longer than a limit; None for a limit of 0: no limit."""
    return np.linalg.norm(errors, axis=1) > limit if limit else None
