# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A campaign's judgement as drawn at the top of a page; nothing is computed here."""

import math
from collections.abc import Sequence
from typing import Any, Final

from imu_sim_ros.campaigns.effects import (
    BETTER,
    DIFFERENCE,
    EQUAL,
    RATIO,
    UNDECIDED,
    WORSE,
    Effect,
)
from imu_sim_ros.campaigns.metrics import SUCCESS
from imu_sim_ros.campaigns.pairs import paired_values
from imu_sim_ros.campaigns.plan import Plan
from imu_sim_ros.campaigns.statistics import ConfidenceInterval
from imu_sim_ros.campaigns.summary import Group
from imu_sim_ros.campaigns.verdict import (
    WITHOUT_ERRORS,
    Contest,
    Judgement,
    headline,
    varying_names,
)
from imu_sim_ros.reports.page import Item, Section, table

_MAX_SEEDS: Final = 100
_MAX_DRAWN: Final = 12
"""Contests that are drawn with the seeds of each pair."""
_MAX_OTHERS: Final = 30


def short(words: dict[str, str], varying: Sequence[str]) -> str:
    """Return a group's name: what varies; numbers with the last part of their parameter's name."""
    parts = []
    for name in varying:
        value = words[name]
        plain = value.replace(".", "").replace("-", "").replace("e", "").replace("+", "").isdigit()
        parts.append(f"{name.rpartition('.')[2]} {value}" if plain else value)
    return ", ".join(parts) or "all"


def query(cell: str, estimator: str) -> str:
    """Return the search that finds the runs of a group."""
    quoted = [text.replace('"', "") for text in (cell, estimator)]
    return f'cell="{quoted[0]}" estimator="{quoted[1]}"'


def verdict_section(
    plan: Plan, judgements: Sequence[tuple[str, Judgement]], found: Sequence[Group], campaign: str
) -> Section:
    """Return the verdict.

    :param judgements: with the metrics' names in words; the first is shown first.
    :param campaign: by which links find the runs.
    """
    first = judgements[0][1]
    places = {(group.cell, group.estimator): group for group in found}
    varying = varying_names(found)

    def place(cell: str, estimator: str) -> str:
        return short(places[cell, estimator].labels, varying)

    missed = [one for one in first.requirements if not one.met]
    reported = {one.requirement for one in missed}
    requirements: Item = {
        "count": len(plan.require),
        "texts": len(reported),
        "missed": [
            {"requirement": one.requirement, "comment": one.comment}
            | {"place": place(one.cell, one.estimator), "query": query(one.cell, one.estimator)}
            for one in missed
        ],
    }
    failures = [
        {"reason": one.reason, "runs": one.runs, "place": place(one.cell, one.estimator)}
        | {"query": f"{query(one.cell, one.estimator)} status=failed"}
        for one in first.failures
    ]
    findings = [
        {"finding": one.finding, "runs": one.runs, "place": place(one.cell, one.estimator)}
        | {"query": query(one.cell, one.estimator)}
        for one in first.findings
    ]
    item: Item = {
        "kind": "verdict",
        "campaign": campaign,
        "requirements": requirements,
        "problems": first.other_problems,
        "failures": failures,
        "findings": findings,
        "judged": [
            _judged(words, judged, factor, found)
            for words, judged in judgements
            for factor in dict.fromkeys([judged.factor, *(one.factor for one in judged.contests)])
        ],
    }
    summary = f"{first.runs:,} runs, {first.done:,} done, in {len(found)} cells and estimators."
    if any(one.unranked for one in first.headline):
        summary += f" {WITHOUT_ERRORS}, the sensor without errors, is compared and not ranked."
    text = (
        f"{summary} Compared on the same seeds, over the time that both estimates cover; failed "
        f"runs are worse than any number; differences up to {first.tolerance} do not matter; p "
        "values (Wilcoxon, for shares McNemar) are corrected by Holm; intervals of all comparisons "
        "at once by Bonferroni."
    )
    return Section("Verdict", [item, {"kind": "text", "text": text, "faint": True}])


def _judged(words: str, judged: Judgement, factor: str, found: Sequence[Group]) -> Item:
    names = varying_names(found)
    drawn = found if factor == judged.factor else ()
    fought = [one for one in judged.contests if one.factor == factor]
    contests = [
        _contest(contest, judged, drawn if k < _MAX_DRAWN else (), names)
        for k, contest in enumerate(fought)
    ]
    lead, rest = headline(fought, judged.metric, judged.tolerance) if fought else ("", "")
    alone = ""
    if not contests and judged.standings:
        one = judged.standings[0]
        alone = f"{judged.metric}: nothing varies; {one.done} of {one.runs} runs done"
        if one.median.value is not None:
            alone += f", median {one.median.value:.4g}"
    return {
        "metric": judged.metric,
        "label": words,
        "factor": factor,
        "lead": lead or alone,
        "rest": rest,
        "table": _table(fought[0], judged) if len(fought) == 1 else None,
        "contests": contests,
        "names": list(dict.fromkeys(group.labels[factor] for group in found)) if fought else [],
    }


def _table(contest: Contest, judged: Judgement) -> Item | None:
    """Return the members of a contest in their order, each compared with the first."""
    if len(contest.ranking) < 3:
        return None
    first = contest.ranking[0]
    effects = {one.b: one for one in contest.effects if one.a == first}
    standings = {
        one.values[contest.factor]: one
        for one in judged.standings
        if all(one.values[name] == word for name, word in contest.where.items())
    }
    rows: list[list[Any]] = []
    for rank, name in enumerate(contest.ranking, 1):
        standing, effect = standings[name], effects.get(name)
        row: list[Any] = [None if name in contest.unranked else rank, name]
        row += [f"{standing.done} of {standing.runs}", standing.coverage, standing.median.value]
        if effect is None:
            row += [""] * 3 + [None, ""]
        else:
            p = None if effect.p is None else float(f"{effect.p:.2g}")
            row += [_brief(effect, True), *_ends(effect), p, _TURNED[effect.verdict]]
        rows.append(row)
    header = ["no.", contest.factor, "done", "coverage", f"median {judged.metric}", f"than {first}"]
    header += ["95 %", "95 %, all at once", "p (Holm)", "is"]
    return table("", header, rows, search=False)


_TURNED: Final = {BETTER: WORSE, WORSE: BETTER, EQUAL: EQUAL, UNDECIDED: UNDECIDED}


def _ends(effect: Effect) -> list[str]:
    """Return the intervals of B compared with A."""
    return [
        " to ".join("open" if end is None else _size(effect.kind, end) for end in ends[1:])
        for ends in (_turned(effect.kind, one) for one in (effect.effect, effect.simultaneous))
    ]


def _turned(kind: str, interval: ConfidenceInterval) -> ConfidenceInterval:
    """Return the interval of A compared with B as that of B compared with A."""
    value, high, low = (
        None if end is None else 1.0 / end if kind == RATIO else -end for end in interval
    )
    return ConfidenceInterval(value, low, high)


def _contest(
    contest: Contest, judged: Judgement, found: Sequence[Group], varying: Sequence[str]
) -> Item:
    where = [name for name in varying if name in contest.where]
    effects = [
        {"a": one.a, "b": one.b, "verdict": one.verdict, "line": one.line(judged.metric)}
        | {"short": _brief(one, False), "turned": _brief(one, True)}
        for one in contest.effects
    ]
    return {
        "place": short(contest.where, where) if where else "",
        "where": {name: contest.where[name] for name in where},
        "ranking": contest.ranking,
        "unranked": contest.unranked,
        "best": contest.best,
        "equal": contest.lead.verdict == EQUAL,
        "size": _brief(contest.lead, False),
        "line": f"{contest.outcome(judged.tolerance)}: {contest.describe(judged.metric)}",
        "effects": effects,
        "plot": _paired(contest, judged, found),
    }


def _brief(effect: Effect, turned: bool) -> str:
    """Return the size of an effect for a field of the matrix: ``/254``, ``x1.03``, ``-0.2``."""
    interval = _turned(effect.kind, effect.effect) if turned else effect.effect
    if interval.value is None:
        return "?" if effect.note else "failed"
    return _size(effect.kind, interval.value)


def _size(kind: str, value: float) -> str:
    if kind == RATIO:
        return f"\u00d7{_few(value)}" if value >= 1.0 else f"\u00f7{_few(1.0 / value)}"
    return f"{value:+.3g}" if kind == DIFFERENCE else f"{100.0 * value:+.3g} %"


def _few(value: float) -> str:
    """Return a number in four letters at most, up to a billion: ``1.03``, ``254``, ``13k``."""
    for size, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= 0.9995 * size:
            return f"{value / size:.2g}{letter}" if value < 99.5 * size else f"{value:.0e}"
    return f"{value:.3g}"


def _paired(contest: Contest, judged: Judgement, found: Sequence[Group]) -> Item | None:
    """Return the plot of the first compared with each other one: the effect and every seed."""
    first, kind = contest.ranking[0], contest.lead.kind
    shown = [one for one in contest.effects if one.a == first and one.kind == kind]
    shown = [one for one in shown if one.effect.value is not None]
    shown = [one for one in shown if one.b not in contest.unranked][:_MAX_OTHERS]
    if not shown:
        return None
    ratio = kind == RATIO
    series: list[Item] = []
    dots: Item = {"at": [], "x": []}
    members = _members(contest, found)
    # An estimator has its own colour in every plot.
    order = list(dict.fromkeys(group.estimator for group in found))
    order = order if contest.factor == "estimator" else []
    for k, one in enumerate(shown):
        if one.b in members and first in members:
            for x in _seeds(members[first], members[one.b], judged.metric, ratio):
                dots["at"].append(k)
                dots["x"].append(x)
    if dots["at"]:
        none = [None] * len(dots["at"])
        bare = {"name": "one seed", "mode": "rows", "bare": True, "size": 2.5, "colour": None}
        series.append({**bare, **dots, "low": none, "high": none})
    series.append(
        {"name": "effect, 95 %", "mode": "rows", "colour": None, "at": list(range(len(shown)))}
        | {"colours": [order.index(one.b) if one.b in order else None for one in shown]}
        | {"x": [one.effect.value for one in shown], "line": 1.0 if ratio else 0.0}
        | {"low": [one.effect.low for one in shown], "high": [one.effect.high for one in shown]}
    )
    sign = "/" if ratio else "-"
    return {
        "title": f"{judged.metric}: {first} {sign} each other, on the same seeds",
        "x": {"label": f"{judged.metric}, {first} {sign} other", "log": ratio},
        "categories": [one.b for one in shown],
        "series": series,
        "caption": "The effect with its 95 % interval; small points are single seeds."
        if dots["at"]
        else "The effect with its 95 % interval.",
    }


def _members(contest: Contest, found: Sequence[Group]) -> dict[str, Group]:
    """Return the groups of a contest by their values of its factor."""
    return {
        group.labels[contest.factor]: group
        for group in found
        if all(group.labels[name] == word for name, word in contest.where.items())
    }


def _seeds(a: Group, b: Group, metric: str, ratio: bool) -> list[float]:
    """Return A / B, or A - B, of each seed on which both have the metric."""
    if metric == SUCCESS:
        return []
    ours, theirs, _ = paired_values(a, b, metric)
    known = [
        (value, other)
        for seed, value in ours.items()
        if value is not None
        and (other := theirs.get(seed)) is not None
        and math.isfinite(value)
        and math.isfinite(other)
    ]
    if ratio:
        return [one / other for one, other in known[:_MAX_SEEDS] if other]
    return [one - other for one, other in known[:_MAX_SEEDS]]


def against_baseline(effects: Sequence[Effect], metric: str, name: str) -> Item:
    """Return the table of each group compared with the same one of an earlier campaign."""
    rows = [
        [one.a, one.verdict, one.note or one.size(), f"{one.won} of {one.seeds}", one.p]
        for one in effects
    ]
    header = ["cell and estimator", "now", f"{metric}, than before", "better seeds", "p"]
    return table(f"compared with {name}", header, rows, search=True)
