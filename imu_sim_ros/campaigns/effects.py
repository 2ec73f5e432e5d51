# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One group compared with another on the same seeds, in numbers and in words."""

from dataclasses import dataclass
from typing import Final

from imu_sim_ros.campaigns.statistics import ConfidenceInterval

SIGNIFICANT: Final = 0.05
BETTER, WORSE, EQUAL, UNDECIDED = "better", "worse", "equal", "undecided"
RATIO, DIFFERENCE, SHARE = "ratio", "difference", "share"


@dataclass(frozen=True)
class Effect:
    """A compared with B on the same seeds."""

    a: str
    """Value of the contest's factor (``adis16470``); in a baseline ``cell; estimator``."""
    b: str
    """Likewise; in a baseline ``the baseline``."""
    kind: str
    """What ``effect`` is: ``ratio`` A / B, ``difference`` A - B, or ``share``: the difference of
    the shares of runs done."""
    effect: ConfidenceInterval
    """With its 95 % interval, not corrected for the number of comparisons; an end is None if
    failed runs make it infinite or the seeds are too few."""
    seeds: int
    """Seeds on which at least one of both has a result and the other one, or failed."""
    won: int
    """Seeds among them on which A is better."""
    lost: int
    scatter: float | None
    """Standard deviation of the logarithm of the ratio on a seed; ``--power`` needs it."""
    p: float | None
    """p-value of no difference at all (Wilcoxon, Holm); None: nothing can be said."""
    p_beyond: float | None
    """p-value of a difference within the tolerance."""
    success: ConfidenceInterval
    """Share of runs done of A less that of B (Bonett and Price)."""
    success_p: float | None
    """McNemar, Holm."""
    verdict: str
    """What A is: ``better`` or ``worse`` than B beyond the tolerance, ``equal`` if the interval
    lies within it, or ``undecided``."""
    note: str = ""
    """Reason for no decision, other than too few runs."""

    @property
    def significant(self) -> bool:
        """Whether there is a difference at all, however small."""
        return self.p is not None and self.p < SIGNIFICANT

    def size(self) -> str:
        """Return the effect in words: ``12 % smaller (95 %: 8 % to 15 %)``."""
        return _size(self.kind, self.effect)

    def line(self, metric: str, subject: bool = True) -> str:
        """Return the effect in a line.

        :param subject: begin with A; False: that has been said.
        """
        if self.note:
            return f"{self.a} and {self.b}: {self.note}"
        words = f"{self.a}: " if subject else ""
        if self.effect.value is None:
            words += f"{metric}, against {self.b}: {self.size()}"
        else:
            name = "" if self.kind == SHARE else f"{metric} "
            words += f"{name}{self.size()} than {self.b}"
        p = "" if self.p is None else f", p = {self.p:.2g}"
        words += f", better on {self.won} of {self.seeds} seeds{p}"
        if self.success.value:
            more = "more" if self.success.value > 0.0 else "fewer"
            share = f"{100.0 * abs(self.success.value):.3g} % {more} runs done"
            p = "" if self.success_p is None else f" (p = {self.success_p:.2g})"
            words += f"; {share}{p}"
        return words


def _size(kind: str, effect: ConfidenceInterval) -> str:
    value = effect.value
    if value is None:
        return "size unknown, too many runs failed"
    if kind == SHARE:
        words = ("% more runs done", "% fewer runs done")
        return _change(
            ConfidenceInterval(*(None if e is None else 100.0 * e for e in effect)), *words
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
    word = "larger" if value >= 1.0 else "smaller"
    return f"{_number(factor)} times {word}{_between(*(_words(end) for end in ends))}"


def _change(effect: ConfidenceInterval, more: str, less: str) -> str:
    """Return ``12 % smaller (95 %: 8 % to 15 %)``; an end of the other sign says so."""
    value, low, high = effect
    assert value is not None
    word, other = (more, less) if value >= 0.0 else (less, more)
    if value < 0.0:
        low, high = (None if end is None else -end for end in (high, low))
    unit = " %" if word.startswith("%") else ""
    words = [_words(low, unit), _words(high, unit)]
    if low is not None and low < 0.0:
        words[0] = f"{-low:.3g} {other}"
        words[1] = None if high is None else f"{high:.3g} {word}"
    digits = 3 if unit else 4
    return f"{abs(value):.{digits}g} {word}{_between(*words)}"


def _words(end: float | None, unit: str = "") -> str | None:
    return None if end is None else f"{_number(end)}{unit}"


def _number(value: float) -> str:
    """Return a number with three digits: ``12,600``, ``1.26e+06``."""
    return f"{float(f'{value:.3g}'):,.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"


def _between(low: str | None, high: str | None) -> str:
    if low is None and high is None:
        return " (no 95 % interval: too few seeds, or too many failed runs)"
    if low is None or high is None:
        return f" (95 %: at least {low})" if high is None else f" (95 %: at most {high})"
    return f" (95 %: {low} to {high})"
