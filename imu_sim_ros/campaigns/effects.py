# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Comparison of two groups on the same seeds, in numbers and as text."""

from dataclasses import dataclass
from typing import Final

from imu_sim_ros.campaigns.pairs import CommonTime
from imu_sim_ros.campaigns.statistics import ConfidenceInterval
from imu_sim_ros.core.digits import interval_texts

SIGNIFICANT: Final = 0.05
"""Largest p of a significant difference."""
BETTER, WORSE, EQUAL, UNDECIDED = "better", "worse", "equal", "undecided"
RATIO, DIFFERENCE, SHARE = "ratio", "difference", "share"
BASELINE: Final = "the baseline"
"""Name of B in a comparison with an earlier campaign."""


@dataclass(frozen=True)
class Effect:
    """A compared with B on the same seeds."""

    a: str
    """Value of the contest's factor (``adis16470``); in a baseline ``cell; estimator``."""
    b: str
    """Value of the factor in the other group; in a baseline ``the baseline``."""
    kind: str
    """Kind of ``effect``: ``ratio`` A / B, ``difference`` A - B, or ``share``: the difference of
    the shares of runs done."""
    effect: ConfidenceInterval
    """Effect with its 95 % interval, not corrected for the number of comparisons; an end is None if
    failed runs make it infinite or the seeds are too few."""
    simultaneous: ConfidenceInterval
    """Effect with the interval that holds for all comparisons of the campaign at once, with 95
    %."""
    seeds: int
    """Seeds on which at least one of both has a result and the other one, or failed."""
    won: int
    """Seeds among them on which A is better."""
    lost: int
    """Seeds among them on which B is better."""
    scatter: float | None
    """Standard deviation of the logarithm of the ratio on a seed; ``--power`` needs it."""
    p: float | None
    """p-value of no difference at all (Wilcoxon, Holm); None: nothing can be said."""
    p_beyond: float | None
    """p-value of a difference within the tolerance."""
    success: ConfidenceInterval
    """Share of runs done of A less that of B (Bonett and Price)."""
    success_p: float | None
    """p-value of equal shares of runs done (McNemar, Holm)."""
    verdict: str
    """Verdict on A: ``better`` or ``worse`` than B beyond the tolerance, ``equal`` if the interval
    lies within it, or ``undecided``."""
    note: str = ""
    """Reason for no decision, other than too few runs."""
    non_inferior: bool | None = None
    """True if A is proven not to be worse than B by the margin; None: not asked."""
    time: CommonTime | None = None
    """Time over which A and B are compared; None: both cover the same time."""

    @property
    def significant(self) -> bool:
        """True if there is a difference at all, however small."""
        return self.p is not None and self.p < SIGNIFICANT

    def size(self) -> str:
        """Return the effect as text: ``12 % smaller (95 %: 8 % to 15 %)``."""
        if self.effect.value is None:
            return "size unknown, too many runs failed"
        text, ends = _size(self.kind, self.effect)
        if ends is None:
            return f"{text} (no 95 % interval: too few seeds, or too many failed runs)"
        return f"{text} (95 %: {ends})"

    def at_once(self) -> str:
        """Return the interval that holds for all comparisons at once; empty: there is none."""
        if self.simultaneous.value is None:
            return ""
        return _size(self.kind, self.simultaneous)[1] or "too few seeds"

    def line(self, metric: str) -> str:
        """Return the effect in a line that begins with A."""
        return f"{self.a}: {self.describe(metric)}"

    def describe(self, metric: str) -> str:
        """Return the effect without the name of A: ``12 % smaller (...) than with B, ...``."""
        if self.note:
            return f"against {self.b}: {self.note}"
        if self.effect.value is None:
            text = f"{metric} against {self.b}: {self.size()}"
        else:
            name = "" if self.kind == SHARE else f"{metric} "
            text = f"{name}{self.size()} than {'in' if self.b == BASELINE else 'with'} {self.b}"
        p = "" if self.p is None else f", p = {self.p:.2g}"
        if self.simultaneous != self.effect and self.at_once():
            text += f" ({self.at_once()} with all comparisons at once)"
        text += f", better on {self.won} of {self.seeds} seeds{p}"
        if self.success.value:
            direction = "more" if self.success.value > 0.0 else "fewer"
            share = f"{100.0 * abs(self.success.value):.3g} % {direction} runs done"
            p = "" if self.success_p is None else f" (p = {self.success_p:.2g})"
            text += f"; {share}{p}"
        if self.time is not None:
            text += f"; {self.time.text(self.a, self.b)}"
        return text


def _size(kind: str, effect: ConfidenceInterval) -> tuple[str, str | None]:
    """Return an effect and its interval as text."""
    value = effect.value
    assert value is not None
    if kind == SHARE:
        labels = ("% more runs done", "% fewer runs done")
        return _change(
            ConfidenceInterval(*(None if e is None else 100.0 * e for e in effect)), *labels
        )
    if kind == DIFFERENCE:
        return _change(effect, "larger", "smaller")
    factor = value if value >= 1.0 else 1.0 / value
    if factor < 2.0:
        percent = (None if end is None else 100.0 * (end - 1.0) for end in effect)
        return _change(ConfidenceInterval(*percent), "% larger", "% smaller")
    ends = [effect.low, effect.high]
    if value < 1.0:
        ends = [None if end is None else 1.0 / end for end in reversed(ends)]
    label = "larger" if value >= 1.0 else "smaller"
    text, *end_texts = _texts(factor, *ends)
    return f"{text} times {label}", _range_text(*end_texts)


def _change(effect: ConfidenceInterval, increase: str, decrease: str) -> tuple[str, str | None]:
    """Return ``12 % smaller`` and ``8 % to 15 %``; an end of the other sign says so."""
    value, low, high = effect
    assert value is not None
    label, opposite = (increase, decrease) if value >= 0.0 else (decrease, increase)
    if value < 0.0:
        low, high = (None if end is None else -end for end in (high, low))
    unit = " %" if label.startswith("%") else ""
    text, bottom, top = _texts(abs(value), low, high)
    if low is not None and low < 0.0:
        bottom = f"{str(bottom).removeprefix('-')} {opposite}"
        top = None if top is None else f"{top} {label}"
    else:
        bottom, top = (None if end is None else f"{end}{unit}" for end in (bottom, top))
    return f"{text} {label}", _range_text(bottom, top)


def _texts(
    value: float, low: float | None, high: float | None
) -> tuple[str, str | None, str | None]:
    """Return a value and its interval with digits of their width; three where an end is open."""
    if low is not None and high is not None:
        return interval_texts(value, low, high)
    bottom, top = (None if end is None else f"{end:.3g}" for end in (low, high))
    return f"{value:.3g}", bottom, top


def _range_text(low: str | None, high: str | None) -> str | None:
    """Return a range as text; None is an unknown end."""
    if low is None and high is None:
        return None
    if low is None or high is None:
        return f"at least {low}" if high is None else f"at most {high}"
    return f"{low} to {high}"
