# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The verdict of a campaign: who is best, by how much, and how sure that is.

:func:`judge` computes it once, in one structure (:class:`Judgement`); terminal, ``--json``, JUnit,
exit status and page show it. Groups (an estimator in a cell) are compared on the same seeds. The
share of runs that are done is compared first, by McNemar's exact test. Then the metric: a failed
run is worse than any number, both failed says nothing, and the effect is the median ratio A / B in
the sense of Hodges and Lehmann, or the difference A - B if a value is not positive, a tolerance
is absolute, or values near a number are best (distances from that number are compared).
"""

import itertools
import math
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.campaigns import statistics
from imu_sim_ros.campaigns.effects import (
    BASELINE,
    BETTER,
    DIFFERENCE,
    EQUAL,
    RATIO,
    SHARE,
    SIGNIFICANT,
    UNDECIDED,
    WORSE,
    Effect,
)
from imu_sim_ros.campaigns.metrics import (
    HIGHER,
    SUCCESS,
    Better,
    Tolerance,
    better,
    depends_on_alignment,
)
from imu_sim_ros.campaigns.pairs import CommonTime, Values, paired_values, values_of
from imu_sim_ros.campaigns.plan import Plan
from imu_sim_ros.campaigns.results import FINDINGS, SEPARATOR, Row
from imu_sim_ros.campaigns.statistics import (
    NO_SHIFT,
    ConfidenceInterval,
    holm,
    quantile,
    share_difference,
    shift,
    wins,
)
from imu_sim_ros.campaigns.summary import Checked, Group, checked, groups, unmet_lines
from imu_sim_ros.types import Array, Mask

WITHOUT_ERRORS: Final = "perfect"
"""The preset with which nothing but the integration is wrong."""
_NUMBER: Final = re.compile(r"(?<![\w.])\d+(\.\d+)?(e[-+]?\d+)?\b")
_ALL_PAIRS: Final = 30
"""Members of a contest up to which all pairs are compared; above, the best with each other one."""
_MAX_SEEDS: Final = 20
"""Seeds that a failure names."""


class Criterion(NamedTuple):
    """How runs are compared."""

    metric: str
    better: Better
    """``lower``, ``higher``, or the number near which values are best."""
    tolerance: Tolerance
    margin: Tolerance | None = None
    """Of non-inferiority to the baseline; None: not asked."""


class Standing(NamedTuple):
    """The runs of one estimator in one cell."""

    cell: str
    estimator: str
    values: dict[str, str]
    """The grid's values in words, and the estimator."""
    runs: int
    done: int
    success: ConfidenceInterval
    """Share of runs done (Wilson)."""
    median: ConfidenceInterval
    """Median of the metric over the runs that have it, with the exact 95 % interval."""
    with_failures: float | None
    """Median of all runs, failed ones being worse than any number; None: half of them failed."""
    align: str | None
    """How the trajectories are aligned; None: unknown, or there is none."""
    coverage: float | None
    """Median share of the truth's time that is estimated, of all runs; None: no trajectories."""


@dataclass(frozen=True)
class Contest:
    """Groups that differ in one thing only, the best one first."""

    factor: str
    """``estimator``, or a name of the grid."""
    where: dict[str, str]
    """Common values, by name: values of the grid and the estimator, if others exist."""
    ranking: list[str]
    """Values of the factor, by the median with failures, then by the share of runs done."""
    unranked: list[str]
    """``perfect``, the sensor without errors, if two others compete: last of ``ranking``."""
    best: str | None
    """The first, if it is better than the second beyond the tolerance; None: it is not decided."""
    lead: Effect
    """The first compared with the second."""
    effects: list[Effect]
    """All pairs, or the first with each other one if there are more than 30 members."""

    @property
    def where_in_words(self) -> str:
        """``where`` as a line of a table has it."""
        return ", ".join(f"{name}={value}" for name, value in self.where.items()) or "all"

    def outcome(self, tolerance: str) -> str:
        """Return who is best in words: ``midpoint beats euler``.

        :param tolerance: in words.
        """
        first, second = self.lead.a, self.lead.b
        if self.best is None and self.lead.verdict == EQUAL:
            return f"{first} and {second} are equal within {tolerance}"
        if self.best is None:
            return f"undecided between {first} and {second}"
        if len(self.ranking) == 2:
            return f"{first} beats {second}"
        return f"{first} is the best {self.factor}"

    def told(self, metric: str) -> str:
        """Return by how much the first differs from the second, and how sure that is."""
        return ("" if self.best is not None else f"{self.lead.a}: ") + self.lead.told(metric)

    def line(self, metric: str, tolerance: str) -> str:
        """Return the result in a line."""
        where = f"{self.where_in_words}: " if self.where else ""
        return f"{where}{self.outcome(tolerance)}; {self.told(metric)}"


def headline(contests: Sequence[Contest], metric: str, tolerance: str) -> tuple[str, str]:
    """Return the result of contests of one factor in two parts: who is best, and by how much."""
    if len(contests) == 1:
        return contests[0].outcome(tolerance), contests[0].told(metric)
    won: dict[str, list[Effect]] = defaultdict(list)
    for one in contests:
        if one.best is not None:
            won[one.best].append(one.lead)
    ranked = sorted(won.items(), key=lambda item: -len(item[1]))
    factor, count = contests[0].factor, len(contests)
    open_ones = [one.lead.verdict for one in contests if one.best is None]
    parts = [f"{name} in {len(leads)}" for name, leads in ranked[1:]]
    parts += [
        f"{word} in {open_ones.count(verdict)}"
        for word, verdict in ((f"equal within {tolerance}", EQUAL), (UNDECIDED, UNDECIDED))
        if verdict in open_ones
    ]
    if not ranked:
        return f"No {factor} is the best in any of {count} comparisons", "; ".join(parts)
    name, leads = ranked[0]
    words = f"{name} is the best {factor} in {len(leads)} of {count} comparisons"
    return words, "; ".join([*_range(leads, metric), *parts])


def _range(leads: Sequence[Effect], metric: str) -> Iterator[str]:
    """Yield by how much the first leads in several comparisons, and how sure that is at least."""
    kind = leads[0].kind
    neutral = 1.0 if kind == RATIO else 0.0
    sizes = [abs(one.effect.value - neutral) for one in leads if one.effect.value is not None]
    if not sizes or len({one.kind for one in leads}) > 1:
        return
    value = next(one.effect.value for one in leads if one.effect.value is not None)
    word = "smaller" if value < neutral else "larger"
    ends = [100.0 * size if kind != DIFFERENCE else size for size in (min(sizes), max(sizes))]
    low, high = (f"{end:.3g}{' %' if kind != DIFFERENCE else ''}" for end in ends)
    span = low if low == high else f"{low} to {high}"
    subject = "the share of runs done" if kind == SHARE else metric
    p = [one.p for one in leads if one.p is not None]
    sure = f", p at most {max(p):.2g}" if p else ""
    yield f"{subject} {word} by {span} than with the next{sure}"


class Failure(NamedTuple):
    """Runs of one group that failed for one reason."""

    cell: str
    estimator: str
    reason: str
    """Without ``failed: ``; numbers that differ are ``...``."""
    runs: int
    seeds: list[int]
    """The first 20."""


class EstimateFinding(NamedTuple):
    """A mistake that the estimates of runs of one group show next to the truth."""

    cell: str
    estimator: str
    finding: str
    """Numbers that differ are ``...``."""
    runs: int
    seeds: list[int]
    """The first 20."""


@dataclass(frozen=True)
class Judgement:
    """The verdict of a campaign for one metric."""

    metric: str
    better: Better
    tolerance: str
    """In words: ``2 %``."""
    non_inferiority: str | None
    """The margin in words; None: not asked."""
    runs: int
    done: int
    factor: str
    """The main factor: ``estimator`` if there are several, else ``imu`` or the first
    name of the grid with several values; empty if nothing varies."""
    standings: list[Standing]
    """One for each cell and estimator, in the plan's order."""
    contests: list[Contest]
    """Comparisons of every factor; those of ``factor`` come first and are the headline."""
    failures: list[Failure]
    """The most frequent first."""
    findings: list[EstimateFinding]
    """The most frequent first."""
    requirements: list[Checked]
    baseline: list[Effect] | None
    """Each group compared with the same one of the earlier campaign; None: without one."""
    unmet: list[str]
    """A line for each requirement that is not met, and group."""
    unmatched: list[str]
    """A line for each requirement that concerns no group, and for a baseline without common runs:
    a typo would go unnoticed."""
    worse: list[str]
    """A line for each group that is worse than in the baseline, or not proven not to be."""
    unproven: list[str]
    """A line for each group of which the proof is asked, and the baseline has no run."""

    @property
    def problems(self) -> list[str]:
        """A line for all that fails the gate, which then ends with status 3."""
        return [*self.unmet, *self.not_of_requirements]

    @property
    def not_of_requirements(self) -> list[str]:
        """Those of ``problems`` that are not about the value of a requirement."""
        return [*self.unmatched, *self.worse, *self.unproven]

    @property
    def headline(self) -> list[Contest]:
        """The contests of the factor that the campaign is about."""
        return [one for one in self.contests if one.factor == self.factor]

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values for JSON; intervals are ``{value, low, high}``."""
        found = {name: _plain(value) for name, value in asdict(self).items()}
        for name in ("unmet", "unmatched", "worse", "unproven"):
            del found[name]
        return {**found, "problems": self.problems}


def _plain(value: Any) -> Any:
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    return [_plain(entry) for entry in value] if isinstance(value, list | tuple) else value


def judge(
    plan: Plan,
    rows: Sequence[Row],
    metric: str,
    baseline: Sequence[Row] | None = None,
    tolerance: Tolerance | None = None,
    non_inferiority: Tolerance | None = None,
) -> Judgement:
    """Return the verdict on the runs of a plan.

    :param rows: of the campaign, in the plan's order.
    :param metric: a metric of the plan, or ``success``.
    :param baseline: rows of an earlier campaign.
    :param tolerance: instead of the plan's.
    :param non_inferiority: margin by which each group is to be proven not to be worse than in the
        baseline; None: a group that is not proven to be worse passes.
    """
    found = groups(rows, plan.grid_names)
    own = better(metric, plan.own)
    rule = Criterion(metric, own, tolerance or plan.tolerance, non_inferiority)
    against = None if baseline is None else _baseline(found, baseline, rule)
    contests, factor = _contests(found, rule), _factor(found)
    contests.sort(key=lambda contest: contest.factor != factor)
    requirements = checked(found, plan.require, len(plan.seeds))
    unmatched = [
        f"require {one.text}: no run of these cells is there"
        for one in plan.require
        if not any(one.concerns(group.words) for group in found)
    ]
    if against is not None and not against:
        unmatched.append("the baseline has no run in common with this plan")
    worse = []
    for effect in against or ():
        if effect.verdict == WORSE:
            worse.append(f"worse than the baseline: {effect.line(metric)}")
        elif effect.non_inferior is False:
            words = f"not proven to be less than {rule.margin} worse than the baseline"
            worse.append(f"{words}: {effect.line(metric)}")
    unproven = []
    if against and rule.margin is not None:
        compared = {effect.a for effect in against}
        alone = [name for name in map(_full_name, found) if name not in compared]
        unproven = [f"not proven, the baseline has no such run: {name}" for name in alone]
    return Judgement(
        metric=metric,
        better=rule.better,
        tolerance=str(rule.tolerance),
        non_inferiority=None if rule.margin is None else str(rule.margin),
        runs=len(rows),
        done=sum(group.done for group in found),
        factor=factor,
        standings=[_standing(group, rule) for group in found],
        contests=contests,
        failures=failures(found),
        findings=estimate_findings(found),
        requirements=requirements,
        baseline=against,
        unmet=unmet_lines(plan.require, requirements),
        unmatched=unmatched,
        worse=worse,
        unproven=unproven,
    )


def _full_name(group: Group) -> str:
    return f"{group.cell}; {group.estimator}"


def counts(rows: Sequence[Row]) -> dict[str, int]:
    """Return how often each status occurs, the most frequent first.

    Statuses that differ only in numbers are counted as one, with ``...`` for those that differ.
    """
    return {status: len(alike) for status, alike in _alike(rows).items()}


def _alike(rows: Sequence[Row]) -> dict[str, list[Row]]:
    return _by_text([(str(row["status"]), row) for row in rows])


def _by_text(texts: Sequence[tuple[str, Row]]) -> dict[str, list[Row]]:
    """Return rows by their texts, the most frequent first; those that differ in numbers are one."""
    groups: dict[str, list[tuple[str, Row]]] = defaultdict(list)
    for text, row in texts:
        groups[_NUMBER.sub("...", text)].append((text, row))
    named = {
        _common([text for text, _ in alike]): [row for _, row in alike] for alike in groups.values()
    }
    return dict(sorted(named.items(), key=lambda item: -len(item[1])))


def _common(texts: Sequence[str]) -> str:
    """Return texts that differ in numbers as one, with ``...`` for those that differ."""
    columns = zip(*([one[0] for one in _NUMBER.finditer(text)] for text in texts), strict=True)
    same = iter([column[0] if len(set(column)) == 1 else "..." for column in columns])
    return _NUMBER.sub(lambda found: next(same), texts[0])


def failures(found: Sequence[Group]) -> list[Failure]:
    """Return why runs failed, the most frequent reason first."""
    result = [
        Failure(
            group.cell,
            group.estimator,
            status.removeprefix("failed: "),
            len(alike),
            [int(row["seed"]) for row in alike[:_MAX_SEEDS]],
        )
        for group in found
        for status, alike in _alike(group.rows).items()
        if status != "done"
    ]
    return sorted(result, key=lambda failure: -failure.runs)


def estimate_findings(found: Sequence[Group]) -> list[EstimateFinding]:
    """Return the mistakes that estimates show, the most frequent first."""
    result = [
        EstimateFinding(
            group.cell,
            group.estimator,
            finding,
            len(alike),
            [int(row["seed"]) for row in alike[:_MAX_SEEDS]],
        )
        for group in found
        for finding, alike in _by_text(
            [
                (finding, row)
                for row in group.rows
                if row.get(FINDINGS)
                for finding in str(row[FINDINGS]).split(SEPARATOR)
            ]
        ).items()
    ]
    return sorted(result, key=lambda finding: -finding.runs)


def _standing(group: Group, rule: Criterion) -> Standing:
    values = values_of(group, rule.metric)
    done = [value for value in values.values() if value is not None and math.isfinite(value)]
    return Standing(
        group.cell,
        group.estimator,
        group.words,
        len(group.rows),
        group.done,
        group.success(),
        quantile(np.array(done), 0.5),
        _with_failures(values, rule),
        group.align,
        group.coverage(),
    )


def _with_failures(values: Mapping[int, float | None], rule: Criterion) -> float | None:
    """Return the median of all runs with a result, failed ones being the worst."""
    known = np.array([value for value in values.values() if value is not None])
    if not len(known):
        return None
    order = np.argsort(_losses(known, rule.better), kind="stable")
    middle = known[order][[(len(known) - 1) // 2, len(known) // 2]]
    return float(middle.mean()) if np.isfinite(middle).all() else None


def _losses(values: Array, better: Better) -> Array:
    """Return values whose order is from the best to the worst; infinite ones are the worst."""
    if better == HIGHER:
        return np.where(np.isinf(values), np.inf, -values)
    return values if isinstance(better, str) else np.abs(values - better)


def _effect(
    a: Group, b: Group, names: tuple[str, str], rule: Criterion, comparisons: int
) -> Effect | None:
    """Compare two groups, p values not yet corrected; None if they share no seed.

    :param comparisons: that are read together.
    """
    ours, theirs, time = paired_values(a, b, rule.metric)
    seeds = [seed for seed in ours if seed in theirs]
    if not seeds:
        return None
    done = (_was_done(a, seeds), _was_done(b, seeds))
    share, share_p = share_difference(done[0], done[1])
    pairs = _pairs(ours, theirs, seeds)
    losses = _losses(pairs, rule.better)
    won, lost, _ = wins(losses[:, 0], losses[:, 1])
    counted = Effect(
        a=names[0],
        b=names[1],
        kind=SHARE,
        effect=NO_SHIFT.centre,
        simultaneous=NO_SHIFT.centre,
        seeds=len(pairs),
        won=won,
        lost=lost,
        scatter=None,
        p=NO_SHIFT.p,
        p_beyond=NO_SHIFT.p_beyond,
        success=share,
        success_p=share_p,
        verdict=_direction(NO_SHIFT.sign),
        note=_why_not_compared(a, b, rule, time),
        non_inferior=None if rule.margin is None else False,
        time=time,
    )
    if rule.metric == SUCCESS:
        together = share_difference(done[0], done[1], comparisons)[0]
        return _of_success(counted, together, rule)
    return counted if counted.note else _of_metric(counted, pairs, losses, rule, comparisons)


def _direction(sign: float) -> str:
    """Return what A is if the difference is certain.

    :param sign: of the difference of the losses; above 0: A is worse.
    """
    return WORSE if sign > 0 else BETTER


def _was_done(group: Group, seeds: Sequence[int]) -> Mask:
    """Return on which seeds (n,) a run is done."""
    done = {int(row["seed"]) for row in group.rows if row["status"] == "done"}
    return np.array([seed in done for seed in seeds])


def _pairs(
    ours: Mapping[int, float | None], theirs: Mapping[int, float | None], seeds: Sequence[int]
) -> Array:
    """Return the values (n, 2) of both on each seed on which both have one, and not both failed."""
    both = [(ours[seed], theirs[seed]) for seed in seeds]
    known = [pair for pair in both if None not in pair]
    pairs = np.array(known, dtype=float).reshape(-1, 2)
    return pairs[~np.isinf(pairs).all(axis=1)]


def _why_not_compared(a: Group, b: Group, rule: Criterion, time: CommonTime | None) -> str:
    """Return why two groups are not compared; empty: they are."""
    if depends_on_alignment(rule.metric) and a.align and b.align and a.align != b.align:
        return f"aligned differently ({a.align} and {b.align}), so that they are not compared"
    if time is not None and time.both == 0.0:
        return "no time in common, so that they are not compared"
    return ""


def _of_success(effect: Effect, together: ConfidenceInterval, rule: Criterion) -> Effect:
    """Return the effect if the shares of runs done are what is compared.

    :param together: the interval of the share's difference for all comparisons at once.
    """
    share, proven = effect.success, None
    if rule.margin is not None:
        proven = share.low is not None and share.low > -rule.margin.value
    return replace(
        effect,
        effect=share,
        simultaneous=together,
        p=effect.success_p,
        verdict=_direction(-(share.value or 0.0)),
        non_inferior=proven,
    )


def _of_metric(
    effect: Effect, pairs: Array, losses: Array, rule: Criterion, comparisons: int
) -> Effect:
    """Return the effect on a metric.

    :param pairs: values (n, 2) of A and B on each seed, and ``losses`` (n, 2), larger being worse.
    """
    kind, values, margin = _scaled(pairs, losses, rule, rule.tolerance)
    moved = shift(values[:, 0] - values[:, 1], margin, comparisons)
    higher = rule.better == HIGHER
    size, together = (_unscaled(i, kind, higher) for i in (moved.centre, moved.simultaneous))
    proven = None
    if rule.margin is not None:
        _, values, margin = _scaled(pairs, losses, rule, rule.margin)
        proven = statistics.non_inferior(values[:, 0] - values[:, 1], margin)
    return replace(
        effect,
        kind=kind,
        effect=size,
        simultaneous=together,
        scatter=_scatter(pairs, rule),
        p=moved.p,
        p_beyond=moved.p_beyond,
        verdict=_direction(moved.sign),
        non_inferior=proven,
    )


def _scaled(
    pairs: Array, losses: Array, rule: Criterion, allowed: Tolerance
) -> tuple[str, Array, float]:
    """Return the kind of an effect, what is subtracted (n, 2), larger being worse, and a margin.

    :param allowed: tolerance or margin; with a share, the logarithms of positive values are taken.
    """
    finite = np.isfinite(pairs)
    if allowed.relative and _are_ratios(pairs, rule):
        values = np.log(pairs) if rule.better != HIGHER else -np.log(pairs)
        return RATIO, np.where(finite, values, np.inf), math.log1p(allowed.value)
    margin = allowed.value
    if allowed.relative:
        known = np.abs(losses[:, 1][finite[:, 1]])
        margin = allowed.value * float(np.median(known)) if len(known) else 0.0
    return DIFFERENCE, losses, margin


def _are_ratios(pairs: Array, rule: Criterion) -> bool:
    return bool((pairs[np.isfinite(pairs)] > 0.0).all()) and isinstance(rule.better, str)


def _unscaled(interval: ConfidenceInterval, kind: str, higher: bool) -> ConfidenceInterval:
    """Return a shift of losses as a ratio or difference of the metric's values."""
    value, low, high = interval
    if higher:
        value, high, low = (None if end is None else -end for end in interval)
    if kind == RATIO:
        value, low, high = (None if end is None else math.exp(end) for end in (value, low, high))
    return ConfidenceInterval(value, low, high)


def _scatter(pairs: Array, rule: Criterion) -> float | None:
    """Return the standard deviation of the logarithm of the ratio."""
    both = np.isfinite(pairs).all(axis=1)
    if not _are_ratios(pairs, rule) or both.sum() < 2:
        return None
    return float(np.std(np.log(pairs[both, 0] / pairs[both, 1]), ddof=1))


def _decided(effects: Sequence[Effect], rule: Criterion) -> list[Effect]:
    """Correct the p values of all effects that are read together, and draw the verdicts."""
    count = len(effects)
    p = holm([effect.p for effect in effects])
    # A share that cannot differ significantly has no p and costs the others nothing.
    beyond = holm([e.p_beyond for e in effects] + [e.success_p for e in effects])
    result = []
    for k, effect in enumerate(effects):
        of_metric, of_share = beyond[k], beyond[count + k]
        fewer = (effect.success.value or 0.0) < 0.0
        if of_share is not None and of_share < SIGNIFICANT:
            verdict = WORSE if fewer else BETTER
        elif of_metric is not None and of_metric < SIGNIFICANT:
            verdict = effect.verdict
        else:
            verdict = EQUAL if _is_within(effect, rule.tolerance) else UNDECIDED
        effect = replace(effect, p=p[k], p_beyond=of_metric, success_p=of_share, verdict=verdict)
        if of_share is None or of_share >= SIGNIFICANT:
            effect = _without_advantage(effect)
        result.append(effect)
    return result


def _without_advantage(effect: Effect) -> Effect:
    """Return an effect on a metric in which who covers less time is not better, nor equal.

    It is so if both are compared over different time. Who covers less and is worse is worse.
    """
    time = effect.time
    if time is None or time.both is not None:
        return effect
    if (effect.verdict == WORSE) == (time.a < time.b) and effect.verdict in (BETTER, WORSE):
        return effect
    proven = False if effect.non_inferior and time.a < time.b else effect.non_inferior
    note = f"{time.words(effect.a, effect.b)}, so that the errors are not compared"
    return replace(effect, verdict=UNDECIDED, note=note, non_inferior=proven)


def _is_within(effect: Effect, tolerance: Tolerance) -> bool:
    """Return whether the interval of an effect lies within the tolerance."""
    _, low, high = effect.effect
    if low is None or high is None or effect.kind == SHARE or effect.note:
        return False
    if effect.kind == RATIO:
        return 1.0 / (1.0 + tolerance.value) <= low and high <= 1.0 + tolerance.value
    return not tolerance.relative and -tolerance.value <= low and high <= tolerance.value


def _baseline(found: Sequence[Group], rows: Sequence[Row], rule: Criterion) -> list[Effect]:
    earlier = {(group.cell, group.estimator): group for group in groups(rows, ())}
    effects: list[Effect] = []
    for group in found:
        old = earlier.get((group.cell, group.estimator))
        names = _full_name(group), BASELINE
        effect = None if old is None else _effect(group, old, names, rule, len(found))
        if effect is not None:
            effects.append(effect)
    return _decided(effects, rule)


def varying_names(found: Sequence[Group]) -> list[str]:
    """Return the names of the grid, and ``estimator``, that have several values."""
    names = list(found[0].words) if found else []
    return [name for name in names if len({group.words[name] for group in found}) > 1]


def _factor(found: Sequence[Group]) -> str:
    """Return the main factor of a campaign."""
    several = varying_names(found)
    for name in ("estimator", "imu"):
        if name in several:
            return name
    return several[0] if several else ""


def _contests(found: Sequence[Group], rule: Criterion) -> list[Contest]:
    """Return the contests of every factor, decided together."""
    ranks = {id(group): _rank(group, rule) for group in found}
    contested = [
        (factor, _ranked(sorted(members, key=lambda group: ranks[id(group)]), rule))
        for factor, members in _members(found)
    ]
    count = sum(_pair_count(len(ranked)) for _, ranked in contested)
    varying = varying_names(found)
    found_ones = [_contest(factor, ranked, varying, rule, count) for factor, ranked in contested]
    contests = [one for one in found_ones if one is not None]
    decided = iter(_decided([effect for one in contests for effect in one.effects], rule))
    result = []
    for one in contests:
        effects = [next(decided) for _ in one.effects]
        best = one.ranking[0] if effects[0].verdict == BETTER else None
        result.append(replace(one, best=best, lead=effects[0], effects=effects))
    return result


def _pair_count(members: int) -> int:
    """Return how many pairs of a contest are compared."""
    return math.comb(members, 2) if members <= _ALL_PAIRS else members - 1


def _contest(
    factor: str, ranked: Sequence[Group], varying: Sequence[str], rule: Criterion, count: int
) -> Contest | None:
    """Return a contest of groups, the best first; None if the first two share no seed.

    Its p values are not yet corrected for all others, and nothing is decided.

    :param varying: the names that have several values in the campaign.
    :param count: comparisons that are read together.
    """
    ideal = _without_contest(factor, ranked)
    ranked = [one for one in ranked if one not in ideal] + ideal
    firsts = ranked if len(ranked) <= _ALL_PAIRS else ranked[:1]
    compared = [
        _effect(a, b, (a.words[factor], b.words[factor]), rule, count)
        for k, a in enumerate(firsts)
        for b in ranked[k + 1 :]
    ]
    if compared[0] is None:
        return None
    where = {name: ranked[0].words[name] for name in varying if name != factor}
    effects = [one for one in compared if one is not None]
    names, unranked = ([one.words[factor] for one in some] for some in (ranked, ideal))
    return Contest(factor, where, names, unranked, None, effects[0], effects)


def _without_contest(factor: str, members: Sequence[Group]) -> list[Group]:
    """Return the sensor without errors, which wins without a contest, if there are two others."""
    if factor != "imu" or len(members) <= 2:
        return []
    return [one for one in members if one.words[factor] == WITHOUT_ERRORS]


def _rank(group: Group, rule: Criterion) -> tuple[float, float]:
    """Return the key that orders groups from the best to the worst."""
    return _typical_loss(values_of(group, rule.metric), rule), -group.done / len(group.rows)


def _ranked(ranked: list[Group], rule: Criterion) -> list[Group]:
    """Return groups in an order that leaving out time does not change.

    If two of them are compared over common time, it is by how many others each is worse than.

    :param ranked: by the median of the time that each covers.
    """
    if len(ranked) > _ALL_PAIRS:
        return ranked
    worse_than = [0] * len(ranked)
    shorter = False
    for k, j in itertools.combinations(range(len(ranked)), 2):
        ours, theirs, time = paired_values(ranked[k], ranked[j], rule.metric)
        shorter |= time is not None and time.both is not None
        a, b = _typical_loss(ours, rule), _typical_loss(theirs, rule)
        worse_than[k] += a > b
        worse_than[j] += b > a
    if not shorter:
        return ranked
    return [ranked[k] for k in sorted(range(len(ranked)), key=lambda k: worse_than[k])]


def _typical_loss(values: Values, rule: Criterion) -> float:
    """Return the loss of the median of all runs; infinite if half of them failed."""
    typical = _with_failures(values, rule)
    return math.inf if typical is None else float(_losses(np.array([typical]), rule.better)[0])


def _members(found: Sequence[Group]) -> Iterator[tuple[str, list[Group]]]:
    """Yield groups that differ in the estimator alone, or in one value of the grid alone."""
    index: dict[tuple[str, tuple[tuple[str, str], ...]], list[Group]] = defaultdict(list)
    for group in found:
        words = group.words
        for name in words:
            key = tuple((other, word) for other, word in words.items() if other != name)
            index[name, key].append(group)
    for (name, _), members in index.items():
        if len(members) > 1:
            yield name, members
