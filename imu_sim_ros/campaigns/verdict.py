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
from imu_sim_ros.campaigns.gate import Requirement
from imu_sim_ros.campaigns.metrics import (
    HIGHER,
    SUCCESS,
    Better,
    Tolerance,
    better_values,
    depends_on_alignment,
)
from imu_sim_ros.campaigns.pairs import CommonTime, Values, pair_values, values_of
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
from imu_sim_ros.campaigns.summary import (
    Group,
    RequirementCheck,
    check_requirements,
    group_runs,
    unmet_lines,
)
from imu_sim_ros.core.types import Array, JsonObject, Mask
from imu_sim_ros.recordings.findings.roles import estimate_equals_truth

WITHOUT_ERRORS: Final = "perfect"
"""Preset of a sensor without errors."""
_NUMBER: Final = re.compile(r"(?<![\w.])\d+(\.\d+)?(e[-+]?\d+)?\b")
_ALL_PAIRS: Final = 30
"""Members of a contest up to which all pairs are compared; above, the best with each other."""
_COPY: Final = f"[{estimate_equals_truth.kind}]"
"""End of the finding about an estimate that is its truth."""
_MAX_SEEDS: Final = 20
"""Largest number of seeds listed for a failure."""


class Criterion(NamedTuple):
    """Rule by which runs are compared."""

    metric: str
    better: Better
    """``lower``, ``higher``, or the number near which values are best."""
    tolerance: Tolerance
    margin: Tolerance | None = None
    """Margin of non-inferiority to the baseline; None: not asked."""


class Standing(NamedTuple):
    """The runs of one estimator in one cell."""

    cell: str
    estimator: str
    values: dict[str, str]
    """The grid's values as text, and the estimator."""
    runs: int
    done: int
    success: ConfidenceInterval
    """Share of runs done (Wilson)."""
    median: ConfidenceInterval
    """Median of the metric over the runs that have it, with the exact 95 % interval."""
    with_failures: float | None
    """Median of all runs, failed ones being worse than any number; None: half of them failed."""
    align: str | None
    """Alignment of the trajectories; None: unknown, or there are none."""
    coverage: float | None
    """Median share of the truth's time that is estimated, over all runs; None: no trajectories."""


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
    """``perfect``, the sensor without errors, if two others compete; at the end of ``ranking``."""
    best: str | None
    """The first of ``ranking``, if better than the second beyond the tolerance; else None."""
    lead: Effect
    """The first compared with the second."""
    effects: list[Effect]
    """Effects of all pairs; of more than 30 members, those of the first with each other one."""

    @property
    def where_text(self) -> str:
        """The common values as one text, for a line of a table."""
        return ", ".join(f"{name}={value}" for name, value in self.where.items()) or "all"

    def outcome(self, tolerance: str) -> str:
        """Return the winner as text: ``midpoint beats euler``.

        :param tolerance: tolerance as text.
        """
        winner, runner_up = self.lead.a, self.lead.b
        if self.best is None and self.lead.verdict == EQUAL:
            return f"{winner} and {runner_up} are equal within {tolerance}"
        if self.best is None:
            return f"undecided between {winner} and {runner_up}"
        if len(self.ranking) == 2:
            return f"{winner} beats {runner_up}"
        return f"{winner} is the best {self.factor}"

    def describe(self, metric: str) -> str:
        """Return the difference between the first and the second, and its significance."""
        return ("" if self.best is not None else f"{self.lead.a}: ") + self.lead.describe(metric)

    def line(self, metric: str, tolerance: str) -> str:
        """Return the result in a line."""
        where = f"{self.where_text}: " if self.where else ""
        return f"{where}{self.outcome(tolerance)}; {self.describe(metric)}"


def headline(contests: Sequence[Contest], metric: str, tolerance: str) -> tuple[str, str]:
    """Return the result of contests of one factor in two parts: the winner, and the difference."""
    if len(contests) == 1:
        return contests[0].outcome(tolerance), contests[0].describe(metric)
    won: dict[str, list[Effect]] = defaultdict(list)
    for contest in contests:
        if contest.best is not None:
            won[contest.best].append(contest.lead)
    ranked = sorted(won.items(), key=lambda entry: -len(entry[1]))
    factor, count = contests[0].factor, len(contests)
    open_verdicts = [contest.lead.verdict for contest in contests if contest.best is None]
    parts = [f"{name} in {len(leads)}" for name, leads in ranked[1:]]
    parts += [
        f"{label} in {open_verdicts.count(verdict)}"
        for label, verdict in ((f"equal within {tolerance}", EQUAL), (UNDECIDED, UNDECIDED))
        if verdict in open_verdicts
    ]
    if not ranked:
        return f"No {factor} is the best in any of {count} comparisons", "; ".join(parts)
    name, leads = ranked[0]
    title = f"{name} is the best {factor} in {len(leads)} of {count} comparisons"
    return title, "; ".join([*_range(leads, metric), *parts])


def _range(leads: Sequence[Effect], metric: str) -> Iterator[str]:
    """Yield the range of the winner's lead in several comparisons, with its significance."""
    kind = leads[0].kind
    neutral = 1.0 if kind == RATIO else 0.0
    sizes = [abs(lead.effect.value - neutral) for lead in leads if lead.effect.value is not None]
    if not sizes or len({lead.kind for lead in leads}) > 1:
        return
    value = next(lead.effect.value for lead in leads if lead.effect.value is not None)
    direction = "smaller" if value < neutral else "larger"
    ends = [100.0 * size if kind != DIFFERENCE else size for size in (min(sizes), max(sizes))]
    low, high = (f"{end:.3g}{' %' if kind != DIFFERENCE else ''}" for end in ends)
    span = low if low == high else f"{low} to {high}"
    subject = "the share of runs done" if kind == SHARE else metric
    p = [lead.p for lead in leads if lead.p is not None]
    significance = f", p at most {max(p):.2g}" if p else ""
    yield f"{subject} {direction} by {span} than with the next{significance}"


class Failure(NamedTuple):
    """Runs of one group that failed for one reason."""

    cell: str
    estimator: str
    reason: str
    """Reason without ``failed: ``; numbers that differ are ``...``."""
    runs: int
    seeds: list[int]
    """The first 20 seeds."""


class EstimateFinding(NamedTuple):
    """A mistake that the estimates of runs of one group show next to the truth."""

    cell: str
    estimator: str
    finding: str
    """Text of the mistake; numbers that differ are ``...``."""
    runs: int
    seeds: list[int]
    """The first 20 seeds."""


@dataclass(frozen=True)
class Judgement:
    """The verdict of a campaign for one metric."""

    metric: str
    better: Better
    tolerance: str
    """The tolerance as text: ``2 %``."""
    non_inferiority: str | None
    """The margin as text; None: not asked."""
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
    """Failures, the most frequent first."""
    findings: list[EstimateFinding]
    """Mistakes of estimates, the most frequent first."""
    requirements: list[RequirementCheck]
    baseline: list[Effect] | None
    """Each group compared with the same one of the earlier campaign; None: without one."""
    unmet: list[str]
    """A line for each requirement that is not met, and group."""
    unmatched: list[str]
    """A line for each requirement that concerns no group, and for a baseline without common
    runs."""
    worse: list[str]
    """A line for each group that is worse than in the baseline, or not proven not to be."""
    unproven: list[str]
    """A line for each group without a run in the baseline, if non-inferiority is asked."""
    copies: list[str]
    """A line for each group with estimates that are their truth, if there is a gate."""

    @property
    def problems(self) -> list[str]:
        """A line for each failure of the gate, which then ends with status 3."""
        return [*self.unmet, *self.other_problems]

    @property
    def other_problems(self) -> list[str]:
        """Lines of ``problems`` other than those of unmet requirements."""
        return [*self.unmatched, *self.worse, *self.unproven, *self.copies]

    @property
    def headline(self) -> list[Contest]:
        """The contests of the factor that the campaign is about."""
        return [contest for contest in self.contests if contest.factor == self.factor]

    def to_dict(self) -> JsonObject:
        """Return the judgement as plain values for JSON; intervals are ``{value, low, high}``."""
        plain_fields = {name: _plain_value(value) for name, value in asdict(self).items()}
        for name in ("unmet", "unmatched", "worse", "unproven", "copies"):
            del plain_fields[name]
        return {**plain_fields, "problems": self.problems}


def _plain_value(value: object) -> Any:
    """Return a value with named tuples as mappings, for JSON."""
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {key: _plain_value(entry) for key, entry in value.items()}
    return [_plain_value(entry) for entry in value] if isinstance(value, list | tuple) else value


def judge(
    plan: Plan,
    rows: Sequence[Row],
    metric: str,
    baseline: Sequence[Row] | None = None,
    tolerance: Tolerance | None = None,
    non_inferiority: Tolerance | None = None,
) -> Judgement:
    """Return the verdict on the runs of a plan.

    :param rows: rows of the campaign, in the plan's order.
    :param metric: a metric of the plan, or ``success``.
    :param baseline: rows of an earlier campaign.
    :param tolerance: tolerance in place of the plan's; None: that of the plan.
    :param non_inferiority: margin by which each group is to be proven not to be worse than in the
        baseline; None: a group that is not proven to be worse passes.
    """
    groups = group_runs(rows, plan.grid_names)
    preference = better_values(metric, plan.custom_metrics)
    rule = Criterion(metric, preference, tolerance or plan.tolerance, non_inferiority)
    baseline_effects = None if baseline is None else _baseline(groups, baseline, rule)
    contests, factor = _contests(groups, rule), _factor(groups)
    # Contests of the main factor first.
    contests.sort(key=lambda contest: contest.factor != factor)
    requirements = check_requirements(groups, plan.require, len(plan.seeds))
    mistakes = estimate_findings(groups)
    has_gate = bool(plan.require) or baseline is not None
    return Judgement(
        metric=metric,
        better=rule.better,
        tolerance=str(rule.tolerance),
        non_inferiority=None if rule.margin is None else str(rule.margin),
        runs=len(rows),
        done=sum(group.done for group in groups),
        factor=factor,
        standings=[_group_standing(group, rule) for group in groups],
        contests=contests,
        failures=failures(groups),
        findings=mistakes,
        requirements=requirements,
        baseline=baseline_effects,
        unmet=unmet_lines(plan.require, requirements),
        unmatched=_unmatched_lines(plan.require, groups, baseline_effects),
        worse=_worse_lines(baseline_effects or (), rule),
        unproven=_unproven_lines(groups, baseline_effects or (), rule),
        copies=_copy_lines(mistakes) if has_gate else [],
    )


def _unmatched_lines(
    require: Sequence[Requirement], groups: Sequence[Group], baseline: Sequence[Effect] | None
) -> list[str]:
    """Return a line for each requirement that concerns no group, and for an unrelated baseline.

    :param baseline: effects against the baseline; None: there is no baseline.
    """
    lines = [
        f"require {requirement.text}: no run of these cells is there"
        for requirement in require
        if not any(requirement.concerns(group.labels) for group in groups)
    ]
    if baseline is not None and not baseline:
        lines.append("the baseline has no run in common with this plan")
    return lines


def _worse_lines(baseline: Sequence[Effect], rule: Criterion) -> list[str]:
    """Return a line for each group that is worse than in the baseline, or may be by the margin.

    :param baseline: effects against the baseline.
    """
    lines = []
    for effect in baseline:
        if effect.verdict == WORSE:
            lines.append(f"worse than the baseline: {effect.line(rule.metric)}")
        elif effect.non_inferior is False:
            prefix = f"not proven to be less than {rule.margin} worse than the baseline"
            lines.append(f"{prefix}: {effect.line(rule.metric)}")
    return lines


def _unproven_lines(
    groups: Sequence[Group], baseline: Sequence[Effect], rule: Criterion
) -> list[str]:
    """Return a line for each group that the baseline lacks, if non-inferiority is to be proven.

    :param baseline: effects against the baseline; without any a single line says so elsewhere.
    """
    if not baseline or rule.margin is None:
        return []
    compared = {effect.a for effect in baseline}
    missing_names = [name for name in map(_full_name, groups) if name not in compared]
    return [f"not proven, the baseline has no such run: {name}" for name in missing_names]


def _copy_lines(mistakes: Sequence[EstimateFinding]) -> list[str]:
    """Return a line for each group whose estimates copy their truth, which would pass any gate."""
    return [
        f"{mistake.cell}; {mistake.estimator}: {mistake.runs} runs: {mistake.finding}: "
        "their errors say nothing about the estimator"
        for mistake in mistakes
        if mistake.finding.endswith(_COPY)
    ]


def _full_name(group: Group) -> str:
    """Return cell and estimator of a group."""
    return f"{group.cell}; {group.estimator}"


def counts(rows: Sequence[Row]) -> dict[str, int]:
    """Return how often each status occurs, the most frequent first.

    Statuses that differ only in numbers are counted as one, with ``...`` in place of the numbers.
    """
    return {status: len(alike) for status, alike in _group_by_status(rows).items()}


def _group_by_status(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows by status; statuses that differ in numbers alone count as one."""
    return _group_by_text([(str(row["status"]), row) for row in rows])


def _group_by_text(texts: Sequence[tuple[str, Row]]) -> dict[str, list[Row]]:
    """Return rows by their texts, the most frequent first; texts that differ in numbers are one."""
    by_pattern: dict[str, list[tuple[str, Row]]] = defaultdict(list)
    for text, row in texts:
        by_pattern[_NUMBER.sub("...", text)].append((text, row))
    rows_by_text = {
        _common_text([text for text, _ in alike]): [row for _, row in alike]
        for alike in by_pattern.values()
    }
    return dict(sorted(rows_by_text.items(), key=lambda entry: -len(entry[1])))


def _common_text(texts: Sequence[str]) -> str:
    """Return texts that differ in numbers as one, with ``...`` in place of the numbers."""
    columns = zip(*([match[0] for match in _NUMBER.finditer(text)] for text in texts), strict=True)
    replacements = iter([column[0] if len(set(column)) == 1 else "..." for column in columns])
    return _NUMBER.sub(lambda match: next(replacements), texts[0])


def failures(groups: Sequence[Group]) -> list[Failure]:
    """Return the failures, the most frequent reason first."""
    reasons = [
        Failure(
            cell=group.cell,
            estimator=group.estimator,
            reason=status.removeprefix("failed: "),
            runs=len(alike),
            seeds=[int(row["seed"]) for row in alike[:_MAX_SEEDS]],
        )
        for group in groups
        for status, alike in _group_by_status(group.rows).items()
        if status != "done"
    ]
    return sorted(reasons, key=lambda failure: -failure.runs)


def estimate_findings(groups: Sequence[Group]) -> list[EstimateFinding]:
    """Return the mistakes that estimates show, the most frequent first."""
    findings = [
        EstimateFinding(
            cell=group.cell,
            estimator=group.estimator,
            finding=finding,
            runs=len(alike),
            seeds=[int(row["seed"]) for row in alike[:_MAX_SEEDS]],
        )
        for group in groups
        for finding, alike in _group_by_text(
            [
                (finding, row)
                for row in group.rows
                if row.get(FINDINGS)
                for finding in str(row[FINDINGS]).split(SEPARATOR)
            ]
        ).items()
    ]
    return sorted(findings, key=lambda finding: -finding.runs)


def _group_standing(group: Group, rule: Criterion) -> Standing:
    """Return counts, median with its interval, and success rate of a group."""
    values = values_of(group, rule.metric)
    done = [value for value in values.values() if value is not None and math.isfinite(value)]
    return Standing(
        cell=group.cell,
        estimator=group.estimator,
        values=group.labels,
        runs=len(group.rows),
        done=group.done,
        success=group.success(),
        median=quantile(np.array(done), 0.5),
        with_failures=_median_with_failures(values, rule),
        align=group.align,
        coverage=group.coverage(),
    )


def _median_with_failures(values: Mapping[int, float | None], rule: Criterion) -> float | None:
    """Return the median of all runs with a result, failed ones being the worst."""
    available = np.array([value for value in values.values() if value is not None])
    if not len(available):
        return None
    order = np.argsort(_losses(available, rule.better), kind="stable")
    middle = available[order][[(len(available) - 1) // 2, len(available) // 2]]
    return float(middle.mean()) if np.isfinite(middle).all() else None


def _losses(values: Array, better: Better) -> Array:
    """Return values in which smaller is better; infinite ones are the worst."""
    if better == HIGHER:
        return np.where(np.isinf(values), np.inf, -values)
    return values if isinstance(better, str) else np.abs(values - better)


def _effect(
    a: Group, b: Group, names: tuple[str, str], rule: Criterion, comparisons: int
) -> Effect | None:
    """Compare two groups, p values not yet corrected; None if they share no seed.

    The effect starts as one without a difference; the metric, or the share of runs done, fills it.

    :param names: names of the two groups in the result.
    :param comparisons: number of comparisons that are read together.
    """
    values_a, values_b, time = pair_values(a, b, rule.metric)
    seeds = [seed for seed in values_a if seed in values_b]
    if not seeds:
        return None
    done = (_done_mask(a, seeds), _done_mask(b, seeds))
    share, share_p = share_difference(done[0], done[1])
    pairs = _pairs(values_a, values_b, seeds)
    losses = _losses(pairs, rule.better)
    won, lost, _ = wins(losses[:, 0], losses[:, 1])
    effect = Effect(
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
        note=_incomparability(a, b, rule, time),
        non_inferior=None if rule.margin is None else False,
        time=time,
    )
    if rule.metric == SUCCESS:
        simultaneous = share_difference(done[0], done[1], comparisons)[0]
        return _success_effect(effect, simultaneous, rule)
    return effect if effect.note else _metric_effect(effect, pairs, losses, rule, comparisons)


def _direction(sign: float) -> str:
    """Return the verdict on A if the difference is certain.

    :param sign: sign of the difference of the losses; above 0: A is worse.
    """
    return WORSE if sign > 0 else BETTER


def _done_mask(group: Group, seeds: Sequence[int]) -> Mask:
    """Return a mask (n,), True for seeds on which a run is done."""
    done = {int(row["seed"]) for row in group.rows if row["status"] == "done"}
    return np.array([seed in done for seed in seeds])


def _pairs(
    values_a: Mapping[int, float | None], values_b: Mapping[int, float | None], seeds: Sequence[int]
) -> Array:
    """Return the values (n, 2) on each seed on which both have one, and not both failed."""
    both = [(values_a[seed], values_b[seed]) for seed in seeds]
    complete = [pair for pair in both if None not in pair]
    pairs = np.array(complete, dtype=float).reshape(-1, 2)
    return pairs[~np.isinf(pairs).all(axis=1)]


def _incomparability(a: Group, b: Group, rule: Criterion, time: CommonTime | None) -> str:
    """Return the reason for not comparing two groups; empty: none."""
    if depends_on_alignment(rule.metric) and a.align and b.align and a.align != b.align:
        return f"aligned differently ({a.align} and {b.align}), so that they are not compared"
    if time is not None and time.both == 0.0:
        return "no time in common, so that they are not compared"
    return ""


def _success_effect(effect: Effect, simultaneous: ConfidenceInterval, rule: Criterion) -> Effect:
    """Return the effect if the shares of runs done are compared.

    :param simultaneous: interval of the share's difference for all comparisons at once.
    """
    # Difference of the shares, A - B: larger is better, so that its loss is the negative.
    share, proven = effect.success, None
    if rule.margin is not None:
        proven = share.low is not None and share.low > -rule.margin.value
    return replace(
        effect,
        effect=share,
        simultaneous=simultaneous,
        p=effect.success_p,
        verdict=_direction(-(share.value or 0.0)),
        non_inferior=proven,
    )


def _metric_effect(
    effect: Effect, pairs: Array, losses: Array, rule: Criterion, comparisons: int
) -> Effect:
    """Return the effect on a metric.

    :param pairs: values (n, 2) of A and B on each seed.
    :param losses: (n, 2) values in which larger is worse.
    """
    kind, values, margin = _scale_losses(pairs, losses, rule, rule.tolerance)
    moved = shift(values[:, 0] - values[:, 1], margin, comparisons)
    higher = rule.better == HIGHER
    size, together = (_unscale(i, kind, higher) for i in (moved.centre, moved.simultaneous))
    proven = None
    if rule.margin is not None:
        _, values, margin = _scale_losses(pairs, losses, rule, rule.margin)
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


def _scale_losses(
    pairs: Array, losses: Array, rule: Criterion, allowed: Tolerance
) -> tuple[str, Array, float]:
    """Return the kind of an effect, the losses to subtract (n, 2), and a margin.

    :param allowed: tolerance or margin; with a share, the logarithms of positive values are taken.
    """
    finite = np.isfinite(pairs)
    if allowed.relative and _are_ratios(pairs, rule):
        values = np.log(pairs) if rule.better != HIGHER else -np.log(pairs)
        return RATIO, np.where(finite, values, np.inf), math.log1p(allowed.value)
    margin = allowed.value
    if allowed.relative:
        magnitudes = np.abs(losses[:, 1][finite[:, 1]])
        margin = allowed.value * float(np.median(magnitudes)) if len(magnitudes) else 0.0
    return DIFFERENCE, losses, margin


def _are_ratios(pairs: Array, rule: Criterion) -> bool:
    """Return True if pairs are compared by their ratio: all values are above 0."""
    return bool((pairs[np.isfinite(pairs)] > 0.0).all()) and isinstance(rule.better, str)


def _unscale(interval: ConfidenceInterval, kind: str, higher: bool) -> ConfidenceInterval:
    """Return a shift of losses as a ratio or difference of the metric's values.

    Losses are the values, or the logarithms of values that are compared as a ratio; of a metric of
    which higher values are better, the negatives of these.

    :param kind: RATIO, or a difference.
    :param higher: True if higher values of the metric are better.
    """
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


def _decide(effects: Sequence[Effect], rule: Criterion) -> list[Effect]:
    """Correct the p values of all effects that are read together, and set the verdicts."""
    count = len(effects)
    p = holm([effect.p for effect in effects])
    # A share that cannot differ significantly has no p and costs the others nothing.
    beyond = holm([e.p_beyond for e in effects] + [e.success_p for e in effects])
    decided_effects = []
    for k, effect in enumerate(effects):
        metric_p, share_p = beyond[k], beyond[count + k]
        fewer = (effect.success.value or 0.0) < 0.0
        if share_p is not None and share_p < SIGNIFICANT:
            verdict = WORSE if fewer else BETTER
        elif metric_p is not None and metric_p < SIGNIFICANT:
            verdict = effect.verdict
        else:
            verdict = EQUAL if _is_within(effect, rule.tolerance) else UNDECIDED
        effect = replace(effect, p=p[k], p_beyond=metric_p, success_p=share_p, verdict=verdict)
        if share_p is None or share_p >= SIGNIFICANT:
            effect = _ignore_advantage(effect)
        decided_effects.append(effect)
    return decided_effects


def _ignore_advantage(effect: Effect) -> Effect:
    """Return an effect on a metric in which shorter coverage is no advantage.

    Over different time, a group that covers less is neither better nor equal; it can be worse.
    """
    time = effect.time
    if time is None or time.both is not None:
        return effect
    if (effect.verdict == WORSE) == (time.a < time.b) and effect.verdict in (BETTER, WORSE):
        return effect
    proven = False if effect.non_inferior and time.a < time.b else effect.non_inferior
    note = f"{time.text(effect.a, effect.b)}, so that the errors are not compared"
    return replace(effect, verdict=UNDECIDED, note=note, non_inferior=proven)


def _is_within(effect: Effect, tolerance: Tolerance) -> bool:
    """Return whether the interval of an effect lies within the tolerance."""
    _, low, high = effect.effect
    if low is None or high is None or effect.kind == SHARE or effect.note:
        return False
    if effect.kind == RATIO:
        return 1.0 / (1.0 + tolerance.value) <= low and high <= 1.0 + tolerance.value
    return not tolerance.relative and -tolerance.value <= low and high <= tolerance.value


def _baseline(groups: Sequence[Group], rows: Sequence[Row], rule: Criterion) -> list[Effect]:
    """Return the effect of each group against the same group of a baseline."""
    earlier = {(group.cell, group.estimator): group for group in group_runs(rows, ())}
    effects: list[Effect] = []
    for group in groups:
        earlier_group = earlier.get((group.cell, group.estimator))
        names = _full_name(group), BASELINE
        effect = (
            None
            if earlier_group is None
            else _effect(group, earlier_group, names, rule, len(groups))
        )
        if effect is not None:
            effects.append(effect)
    return _decide(effects, rule)


def list_varying_names(groups: Sequence[Group]) -> list[str]:
    """Return the names of the grid, and ``estimator``, that have several values."""
    names = list(groups[0].labels) if groups else []
    return [name for name in names if len({group.labels[name] for group in groups}) > 1]


def _factor(groups: Sequence[Group]) -> str:
    """Return the main factor of a campaign."""
    varying = list_varying_names(groups)
    for name in ("estimator", "imu"):
        if name in varying:
            return name
    return varying[0] if varying else ""


def _contests(groups: Sequence[Group], rule: Criterion) -> list[Contest]:
    """Return the contests of every factor, decided together."""
    ranks = {id(group): _rank(group, rule) for group in groups}
    contested = [
        (factor, _order_groups(sorted(members, key=lambda group: ranks[id(group)]), rule))
        for factor, members in _members(groups)
    ]
    count = sum(_pair_count(len(ranked)) for _, ranked in contested)
    varying = list_varying_names(groups)
    candidates = [_contest(factor, ranked, varying, rule, count) for factor, ranked in contested]
    contests = [contest for contest in candidates if contest is not None]
    decided = iter(_decide([effect for contest in contests for effect in contest.effects], rule))
    decided_contests = []
    for contest in contests:
        effects = [next(decided) for _ in contest.effects]
        best = contest.ranking[0] if effects[0].verdict == BETTER else None
        decided_contests.append(replace(contest, best=best, lead=effects[0], effects=effects))
    return decided_contests


def _pair_count(members: int) -> int:
    """Return how many pairs of a contest are compared."""
    return math.comb(members, 2) if members <= _ALL_PAIRS else members - 1


def _contest(
    factor: str, ranked: Sequence[Group], varying: Sequence[str], rule: Criterion, count: int
) -> Contest | None:
    """Return a contest of groups, the best first; None if the first two share no seed.

    Each group is compared with all behind it, or, of many groups, the best one with all others.
    Its p values are not yet corrected for all others, and nothing is decided.

    :param factor: name whose values are compared; all other names are equal.
    :param ranked: groups, the best first.
    :param varying: the names that have several values in the campaign.
    :param count: number of comparisons that are read together.
    """
    ideal = _uncontested_groups(factor, ranked)
    ranked = [group for group in ranked if group not in ideal] + ideal
    firsts = ranked if len(ranked) <= _ALL_PAIRS else ranked[:1]
    compared = [
        _effect(a, b, (a.labels[factor], b.labels[factor]), rule, count)
        for k, a in enumerate(firsts)
        for b in ranked[k + 1 :]
    ]
    if compared[0] is None:
        return None
    where = {name: ranked[0].labels[name] for name in varying if name != factor}
    effects = [effect for effect in compared if effect is not None]
    names, unranked = ([group.labels[factor] for group in members] for members in (ranked, ideal))
    return Contest(
        factor=factor,
        where=where,
        ranking=names,
        unranked=unranked,
        best=None,
        lead=effects[0],
        effects=effects,
    )


def _uncontested_groups(factor: str, members: Sequence[Group]) -> list[Group]:
    """Return the sensor without errors, which wins without a contest, if there are two others."""
    if factor != "imu" or len(members) <= 2:
        return []
    return [group for group in members if group.labels[factor] == WITHOUT_ERRORS]


def _rank(group: Group, rule: Criterion) -> tuple[float, float]:
    """Return the key that orders groups from the best to the worst."""
    return _typical_loss(values_of(group, rule.metric), rule), -group.done / len(group.rows)


def _order_groups(ranked: list[Group], rule: Criterion) -> list[Group]:
    """Return groups in an order that does not depend on the time that each covers.

    Groups that are compared over common time are ordered by the number of others they are worse
    than.

    :param ranked: groups in the order of their medians over the time that each covers.
    """
    if len(ranked) > _ALL_PAIRS:
        return ranked
    worse_than = [0] * len(ranked)
    shorter = False
    for k, j in itertools.combinations(range(len(ranked)), 2):
        ours, theirs, time = pair_values(ranked[k], ranked[j], rule.metric)
        shorter |= time is not None and time.both is not None
        a, b = _typical_loss(ours, rule), _typical_loss(theirs, rule)
        worse_than[k] += a > b
        worse_than[j] += b > a
    if not shorter:
        return ranked
    return [ranked[k] for k in sorted(range(len(ranked)), key=lambda k: worse_than[k])]


def _typical_loss(values: Values, rule: Criterion) -> float:
    """Return the loss of the median of all runs; infinite if half of them failed."""
    typical = _median_with_failures(values, rule)
    return math.inf if typical is None else float(_losses(np.array([typical]), rule.better)[0])


def _members(groups: Sequence[Group]) -> Iterator[tuple[str, list[Group]]]:
    """Yield groups that differ in the estimator alone, or in one value of the grid alone."""
    index: dict[tuple[str, tuple[tuple[str, str], ...]], list[Group]] = defaultdict(list)
    for group in groups:
        labels = group.labels
        for name in labels:
            key = tuple(
                (label_name, label) for label_name, label in labels.items() if label_name != name
            )
            index[name, key].append(group)
    for (name, _), members in index.items():
        if len(members) > 1:
            yield name, members
