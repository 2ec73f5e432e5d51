# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A campaign's judgement as drawn at the top of a page; nothing is computed here."""

import math
from collections.abc import Sequence
from typing import Final

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
from imu_sim_ros.campaigns.pairs import pair_values
from imu_sim_ros.campaigns.plan import Plan
from imu_sim_ros.campaigns.statistics import ConfidenceInterval
from imu_sim_ros.campaigns.summary import Group
from imu_sim_ros.campaigns.verdict import (
    WITHOUT_ERRORS,
    Contest,
    Judgement,
    headline,
    list_varying_names,
)
from imu_sim_ros.reports.page import Item, Section, table

_MAX_SEEDS: Final = 100
"""Largest number of seeds whose differences are drawn."""
_MAX_DRAWN: Final = 12
"""Contests that are drawn with the seeds of each pair."""
_MAX_OTHERS: Final = 30
"""Largest number of further comparisons that are listed."""


def short_label(labels: dict[str, str], varying: Sequence[str]) -> str:
    """Return a group's name by its varying parameters, with the last parts of their names."""
    parts = []
    for name in varying:
        value = labels[name]
        plain = value.replace(".", "").replace("-", "").replace("e", "").replace("+", "").isdigit()
        parts.append(f"{name.rpartition('.')[2]} {value}" if plain else value)
    return ", ".join(parts) or "all"


def search_query(cell: str, estimator: str) -> str:
    """Return the search that finds the runs of a group."""
    quoted = [text.replace('"', "") for text in (cell, estimator)]
    return f'cell="{quoted[0]}" estimator="{quoted[1]}"'


def verdict_section(
    plan: Plan, judgements: Sequence[tuple[str, Judgement]], groups: Sequence[Group], campaign: str
) -> Section:
    """Return the verdict: requirements, failures, findings and comparisons of a campaign.

    :param judgements: judgements by the name of their metric; the first is shown first.
    :param campaign: identifier by which links find the runs.
    """
    main = judgements[0][1]
    item: Item = {
        "kind": "verdict",
        "campaign": campaign,
        **_judgement_item(plan, main, groups),
        "judged": [
            _group_comparison(title, judged, factor, groups)
            for title, judged in judgements
            for factor in dict.fromkeys(
                [judged.factor, *(contest.factor for contest in judged.contests)]
            )
        ],
    }
    text = _summary_text(main, len(groups))
    return Section("Verdict", [item, {"kind": "text", "text": text, "faint": True}])


def _judgement_item(plan: Plan, judgement: Judgement, groups: Sequence[Group]) -> Item:
    """Return requirements, problems, failures and findings for the page.

    Each about a group has the group's label, ``place``, and the search for its runs, ``query``.
    """
    group_by_key = {(group.cell, group.estimator): group for group in groups}
    varying = list_varying_names(groups)

    def link(cell: str, estimator: str, condition: str = "") -> Item:
        """Return label and search of a group; ``condition`` is appended to the search."""
        label = short_label(group_by_key[cell, estimator].labels, varying)
        return {"place": label, "query": search_query(cell, estimator) + condition}

    missed = [outcome for outcome in judgement.requirements if not outcome.met]
    return {
        "requirements": {
            "count": len(plan.require),
            "texts": len({outcome.requirement for outcome in missed}),
            "missed": [
                {
                    "requirement": outcome.requirement,
                    "comment": outcome.comment,
                    **link(outcome.cell, outcome.estimator),
                }
                for outcome in missed
            ],
        },
        "problems": judgement.other_problems,
        "failures": [
            {
                "reason": failure.reason,
                "runs": failure.runs,
                **link(failure.cell, failure.estimator, " status=failed"),
            }
            for failure in judgement.failures
        ],
        "findings": [
            {
                "finding": finding.finding,
                "runs": finding.runs,
                **link(finding.cell, finding.estimator),
            }
            for finding in judgement.findings
        ],
    }


def _summary_text(judgement: Judgement, group_count: int) -> str:
    """Return the number of runs, and the statistics behind the comparisons, as text.

    :param group_count: number of pairs of a cell and an estimator.
    """
    summary = (
        f"{judgement.runs:,} runs, {judgement.done:,} done, in {group_count} cells and estimators."
    )
    if any(contest.unranked for contest in judgement.headline):
        summary += f" {WITHOUT_ERRORS}, the sensor without errors, is compared and not ranked."
    return (
        f"{summary} Compared on the same seeds, over the time that both estimates cover; failed "
        f"runs are worse than any number; differences up to {judgement.tolerance} do not matter; p "
        "values (Wilcoxon, for shares McNemar) are corrected by Holm; intervals of all comparisons "
        "at once by Bonferroni."
    )


def _group_comparison(title: str, judged: Judgement, factor: str, groups: Sequence[Group]) -> Item:
    """Return the comparison of the groups for the page."""
    names = list_varying_names(groups)
    drawn = groups if factor == judged.factor else ()
    fought = [contest for contest in judged.contests if contest.factor == factor]
    contests = [
        _contest(contest, judged, drawn if k < _MAX_DRAWN else (), names)
        for k, contest in enumerate(fought)
    ]
    lead, rest = headline(fought, judged.metric, judged.tolerance) if fought else ("", "")
    alone = ""
    if not contests and judged.standings:
        standing = judged.standings[0]
        alone = f"{judged.metric}: nothing varies; {standing.done} of {standing.runs} runs done"
        if standing.median.value is not None:
            alone += f", median {standing.median.value:.4g}"
    return {
        "metric": judged.metric,
        "label": title,
        "factor": factor,
        "lead": lead or alone,
        "rest": rest,
        "table": _table(fought[0], judged) if len(fought) == 1 else None,
        "contests": contests,
        "names": list(dict.fromkeys(group.labels[factor] for group in groups)) if fought else [],
    }


def _table(contest: Contest, judged: Judgement) -> Item | None:
    """Return the members of a contest in their order, each compared with the first."""
    if len(contest.ranking) < 3:
        return None
    reference = contest.ranking[0]
    effects = {effect.b: effect for effect in contest.effects if effect.a == reference}
    standings = {
        standing.values[contest.factor]: standing
        for standing in judged.standings
        if all(standing.values[name] == word for name, word in contest.where.items())
    }
    rows: list[list[object]] = []
    for rank, name in enumerate(contest.ranking, 1):
        standing, effect = standings[name], effects.get(name)
        row: list[object] = [None if name in contest.unranked else rank, name]
        row += [f"{standing.done} of {standing.runs}", standing.coverage, standing.median.value]
        if effect is None:
            row += [""] * 3 + [None, ""]
        else:
            p = None if effect.p is None else float(f"{effect.p:.2g}")
            row += [_brief(effect, True), *_ends(effect), p, _TURNED[effect.verdict]]
        rows.append(row)
    header = [
        "no.",
        contest.factor,
        "done",
        "coverage",
        f"median {judged.metric}",
        f"than {reference}",
    ]
    header += ["95 %", "95 %, all at once", "p (Holm)", "is"]
    return table("", header, rows, search=False)


_TURNED: Final = {BETTER: WORSE, WORSE: BETTER, EQUAL: EQUAL, UNDECIDED: UNDECIDED}


def _ends(effect: Effect) -> list[str]:
    """Return the intervals of B compared with A."""
    return [
        " to ".join("open" if end is None else _size(effect.kind, end) for end in ends[1:])
        for ends in (
            _invert(effect.kind, estimate) for estimate in (effect.effect, effect.simultaneous)
        )
    ]


def _invert(kind: str, interval: ConfidenceInterval) -> ConfidenceInterval:
    """Return the interval of A compared with B as that of B compared with A."""
    value, high, low = (
        None if end is None else 1.0 / end if kind == RATIO else -end for end in interval
    )
    return ConfidenceInterval(value, low, high)


def _contest(
    contest: Contest, judged: Judgement, groups: Sequence[Group], varying: Sequence[str]
) -> Item:
    """Return one comparison of groups with its effects."""
    where = [name for name in varying if name in contest.where]
    effects = [
        {
            "a": effect.a,
            "b": effect.b,
            "verdict": effect.verdict,
            "line": effect.line(judged.metric),
        }
        | {"short": _brief(effect, False), "turned": _brief(effect, True)}
        for effect in contest.effects
    ]
    return {
        "place": short_label(contest.where, where) if where else "",
        "where": {name: contest.where[name] for name in where},
        "ranking": contest.ranking,
        "unranked": contest.unranked,
        "best": contest.best,
        "equal": contest.lead.verdict == EQUAL,
        "size": _brief(contest.lead, False),
        "line": f"{contest.outcome(judged.tolerance)}: {contest.describe(judged.metric)}",
        "effects": effects,
        "plot": _pair_plot(contest, judged, groups),
    }


def _brief(effect: Effect, turned: bool) -> str:
    """Return the size of an effect for a field of the matrix: ``/254``, ``x1.03``, ``-0.2``."""
    interval = _invert(effect.kind, effect.effect) if turned else effect.effect
    if interval.value is None:
        return "?" if effect.note else "failed"
    return _size(effect.kind, interval.value)


def _size(kind: str, value: float) -> str:
    """Return an effect as text: a ratio, a difference or a share."""
    if kind == RATIO:
        return f"\u00d7{_few(value)}" if value >= 1.0 else f"\u00f7{_few(1.0 / value)}"
    return f"{value:+.3g}" if kind == DIFFERENCE else f"{100.0 * value:+.3g} %"


def _few(value: float) -> str:
    """Return a number in four letters at most, up to a billion: ``1.03``, ``254``, ``13k``."""
    for size, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= 0.9995 * size:
            return f"{value / size:.2g}{letter}" if value < 99.5 * size else f"{value:.0e}"
    return f"{value:.3g}"


def _pair_plot(contest: Contest, judged: Judgement, groups: Sequence[Group]) -> Item | None:
    """Return the plot of the first compared with each other one: the effect and every seed."""
    reference, kind = contest.ranking[0], contest.lead.kind
    shown = [effect for effect in contest.effects if effect.a == reference and effect.kind == kind]
    shown = [effect for effect in shown if effect.effect.value is not None]
    shown = [effect for effect in shown if effect.b not in contest.unranked][:_MAX_OTHERS]
    if not shown:
        return None
    ratio = kind == RATIO
    series: list[Item] = []
    dots: Item = {"at": [], "x": []}
    members = _members(contest, groups)
    # An estimator has its own colour in every plot.
    order = list(dict.fromkeys(group.estimator for group in groups))
    order = order if contest.factor == "estimator" else []
    for k, effect in enumerate(shown):
        if effect.b in members and reference in members:
            for x in _seeds(members[reference], members[effect.b], judged.metric, ratio):
                dots["at"].append(k)
                dots["x"].append(x)
    if dots["at"]:
        none = [None] * len(dots["at"])
        bare = {"name": "one seed", "mode": "rows", "bare": True, "size": 2.5, "colour": None}
        series.append({**bare, **dots, "low": none, "high": none})
    series.append(
        {"name": "effect, 95 %", "mode": "rows", "colour": None, "at": list(range(len(shown)))}
        | {"colours": [order.index(effect.b) if effect.b in order else None for effect in shown]}
        | {"x": [effect.effect.value for effect in shown], "line": 1.0 if ratio else 0.0}
        | {
            "low": [effect.effect.low for effect in shown],
            "high": [effect.effect.high for effect in shown],
        }
    )
    sign = "/" if ratio else "-"
    return {
        "title": f"{judged.metric}: {reference} {sign} each other, on the same seeds",
        "x": {"label": f"{judged.metric}, {reference} {sign} other", "log": ratio},
        "categories": [effect.b for effect in shown],
        "series": series,
        "caption": "The effect with its 95 % interval; small points are single seeds."
        if dots["at"]
        else "The effect with its 95 % interval.",
    }


def _members(contest: Contest, groups: Sequence[Group]) -> dict[str, Group]:
    """Return the groups of a contest by their values of its factor."""
    return {
        group.labels[contest.factor]: group
        for group in groups
        if all(group.labels[name] == word for name, word in contest.where.items())
    }


def _seeds(a: Group, b: Group, metric: str, ratio: bool) -> list[float]:
    """Return A / B, or A - B, of each seed on which both have the metric."""
    if metric == SUCCESS:
        return []
    ours, theirs, _ = pair_values(a, b, metric)
    pairs = [
        (a_value, b_value)
        for seed, a_value in ours.items()
        if a_value is not None
        and (b_value := theirs.get(seed)) is not None
        and math.isfinite(a_value)
        and math.isfinite(b_value)
    ]
    if ratio:
        return [a_value / b_value for a_value, b_value in pairs[:_MAX_SEEDS] if b_value]
    return [a_value - b_value for a_value, b_value in pairs[:_MAX_SEEDS]]


def baseline_table(effects: Sequence[Effect], metric: str, name: str) -> Item:
    """Return the table of each group compared with the same one of an earlier campaign."""
    rows = [
        [
            effect.a,
            effect.verdict,
            effect.note or effect.size(),
            f"{effect.won} of {effect.seeds}",
            effect.p,
        ]
        for effect in effects
    ]
    header = ["cell and estimator", "now", f"{metric}, than before", "better seeds", "p"]
    return table(f"compared with {name}", header, rows, search=True)
