# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A campaign's folder as the sections of a page."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from imu_sim_ros.campaign import (
    LOG,
    TABLE,
    Group,
    Plan,
    Row,
    counts,
    groups,
    judge,
    load_plan,
    quantile,
    read_results,
    slopes,
    unmet,
)
from imu_sim_ros.config import flatten
from imu_sim_ros.errors import InputError
from imu_sim_ros.names import unknown
from imu_sim_ros.navigation.comparison import LARGEST_SIGMA, anees_band
from imu_sim_ros.report.page import Item, Section, column, table

PLAN: Final = "plan.yaml"
_SENSORS: Final = {
    "gyroscope_noise_density": "rad/s/sqrt(Hz)",
    "accelerometer_noise_density": "m/s^2/sqrt(Hz)",
    "gyroscope_turn_on_bias_sigma": "rad/s",
    "accelerometer_turn_on_bias_sigma": "m/s^2",
    "gyroscope_random_walk": "rad/s^2/sqrt(Hz)",
    "gyroscope_bias_instability": "rad/s",
}
"""Sensor parameters over which errors are drawn: those that affect dead reckoning most."""
_MOST_PAIRS: Final = 2000
_UNITS: Final = {"_m": "m", "_rad": "rad", "_m_s": "m/s", "_percent": "%", "_s": "s", "_mb": "MB"}


def is_campaign(path: Path) -> bool:
    """Return whether a folder holds a campaign."""
    return path.is_dir() and ((path / LOG).exists() or (path / TABLE).exists())


def campaign_sections(folder: Path, metric: str = "") -> tuple[str, list[Section]]:
    """Return the title and the sections that a campaign's folder gives.

    :param metric: shown first; none: the absolute position error, or else the first metric.
    :raises InputError: for a folder that holds no plan or no runs, or an unknown metric.
    """
    plan = load_plan(folder / PLAN)
    rows = read_results(folder)
    if not rows:
        raise InputError(f"{folder}: holds no run yet")
    present = [name for name in plan.metrics if any(row.get(name) is not None for row in rows)]
    if metric and metric not in present:
        none = None if present else "no run is done"
        raise InputError(unknown("--metric", metric, present, none))
    found = groups(rows, plan.grid_names)
    chosen = metric or ("ate_rmse_m" if "ate_rmse_m" in present or not present else present[0])
    sections = [_results(plan, rows, found, present, chosen)] if present else []
    sections += [_cells(plan, found, present), _outcomes(plan, rows, found, chosen)]
    return plan.options.name, [*sections, _parameters(plan, found), _repeat(folder, rows)]


def label(metric: str) -> str:
    """Return a metric's name with its unit: ``ate_rmse [m]``."""
    for ending in sorted(_UNITS, key=len, reverse=True):
        if metric.endswith(ending):
            return f"{metric.removesuffix(ending).replace('_', ' ')} [{_UNITS[ending]}]"
    return metric.replace("_", " ")


def _results(
    plan: Plan, rows: Sequence[Row], found: Sequence[Group], metrics: Sequence[str], chosen: str
) -> Section:
    names = ["seed", "estimator", "status", *plan.grid_names, *metrics, "cell"]
    item: Item = {
        "kind": "campaign",
        "metric": chosen,
        "metrics": [{"name": name, "label": label(name)} for name in metrics],
        "grid": list(plan.grid_names),
        "columns": [column(name, (row.get(name) for row in rows)) for name in names],
        "groups": [_group(group, metrics) for group in found],
        "estimators": len(plan.estimators),
        "curves": [name for name in plan.grid_names if _is_curve(name, found)],
        "slopes": [
            {
                "metric": name,
                "parameter": slope.parameter,
                "estimator": slope.estimator,
                **slope.sensitivity.slope._asdict(),
                "slope": slope.sensitivity.slope.value,
            }
            for name in metrics
            for slope in slopes(rows, plan.grid_names, name)
        ],
        "sensors": _sensors(plan, found),
        "consistency": _consistency(found),
    }
    done = sum(group.done for group in found)
    told = f"{len(rows):,} runs, {done:,} done, in {len(found)} cells and estimators."
    return Section("Results", [{"kind": "text", "text": told}, item])


def _group(group: Group, metrics: Sequence[str]) -> Item:
    values = {name: group.rows[0].get(name) for name in group.grid}
    summary = {}
    for name in metrics:
        numbers = group.values(name)
        if len(numbers):
            summary[name] = list(quantile(numbers, 0.5))
    return {"estimator": group.estimator, "values": values, "metrics": summary}


def _is_curve(name: str, found: Sequence[Group]) -> bool:
    """Return whether a parameter of the grid is a number that has three values or more."""
    values = {group.rows[0].get(name) for group in found}
    return len(values) > 2 and all(
        isinstance(value, int | float) and not isinstance(value, bool) for value in values
    )


def _sensors(plan: Plan, found: Sequence[Group]) -> list[Item]:
    """Return the parameters of each group's sensor, where the grid has several sensors."""
    if "imu" not in plan.grid_names:
        return []
    by_cell = {}
    for cell in plan.cells():
        imu: dict[str, Any] = dict(flatten(plan.simulation(cell)))
        by_cell[cell.name] = {name: float(np.mean(imu[f"imu.{name}"])) for name in _SENSORS}
    result = []
    for name, unit in _SENSORS.items():
        values = [by_cell[group.cell][name] if group.cell in by_cell else None for group in found]
        if sum(value is not None and value > 0.0 for value in values) > 1:
            words = f"{name.replace('_', ' ')} [{unit}]"
            result.append({"name": name, "label": words, "values": values})
    return result


def _consistency(found: Sequence[Group]) -> Item | None:
    """Return the mean NEES of each group with its chi-square band (3 degrees of freedom)."""
    series = []
    for k, metric in enumerate(("nees_position", "nees_attitude", "nees_velocity")):
        means, used = [], 0
        for group in found:
            values = group.values(metric)
            means.append(float(values.mean()) if len(values) else None)
            used = max(used, len(values))
        if used:
            at = list(range(1, len(found) + 1))
            series.append(
                {"name": metric.removeprefix("nees_"), "mode": "points", "colour": k}
                | {"x": at, "y": means, "size": 3}
            )
    if not series:
        return None
    band = anees_band(3, max(len(group.values("nees_position")) for group in found) or 1)
    ends = [0.5, len(found) + 0.5]
    inside = {"name": "95 % band", "colour": 5, "x": ends, "low": [band.low] * 2}
    return {
        "kind": "plot",
        "title": "Consistency: mean NEES of the final state",
        "x": {"label": "cell, in the order of the table below", "log": False},
        "y": {"label": "NEES, 3 expected", "log": True},
        "series": [{**inside, "high": [band.high] * 2}, *series],
        "caption": "A mean within the band is consistent: 95 % of the cells of a consistent "
        "estimator lie in it.",
    }


def _cells(plan: Plan, found: Sequence[Group], metrics: Sequence[str]) -> Section:
    """Return the summary: a row for each cell and estimator."""
    shown = [name for name in metrics if not name.startswith("rpe_")]
    header = ["no.", *plan.grid_names, "estimator", "done", "runs"]
    for name in shown:
        header += [f"{name} median", "low", "high", "p95"]
    rows: list[list[Any]] = []
    for number, group in enumerate(found, 1):
        words = group.words
        row: list[Any] = [number, *(words[name] for name in plan.grid_names), group.estimator]
        row += [group.done, len(group.rows)]
        for name in shown:
            values = group.values(name)
            if group.not_valid(name):
                row += ["not valid", None, None, None]
            else:
                row += [*quantile(values, 0.5), quantile(values, 0.95).value]
        rows.append(row)
    text = (
        "Medians with their exact 95 % intervals; summary.csv has more. A NEES is not valid where "
    )
    text += f"the attitude is known to no better than {LARGEST_SIGMA:g} rad."
    items: list[Item] = [{"kind": "text", "text": text, "faint": True}]
    return Section("Cells", [*items, table("cells", header, rows, search=True)])


def _outcomes(plan: Plan, rows: Sequence[Row], found: Sequence[Group], metric: str) -> Section:
    """Return the failures, the requirements, and the significant differences."""
    items: list[Item] = []
    if plan.require:
        missed = unmet(found, plan.require)
        rows_of = [[one.requirement.text, one.value, *one.group[:2]] for one in missed]
        text = f"{len(plan.require)} requirements, " + ("not all met:" if missed else "all met.")
        items.append({"kind": "text", "text": text})
        if missed:
            header = ["requirement", "value", "cell", "estimator"]
            items.append(table("requirements not met", header, rows_of, search=True))
    failures = [[count, status] for status, count in counts(rows).items() if status != "done"]
    if failures:
        items.append(table("failed runs", ["runs", "status"], failures, search=False))
    effects = [
        (contest, effect)
        for contest in judge(plan, rows, metric).contests
        for effect in contest.effects
        if effect.significant
    ]
    effects.sort(key=lambda one: one[1].p or 0.0)
    if effects:
        differences = [
            [", ".join(contest.where.values()), e.a, e.b, e.size(), e.seeds, e.p]
            for contest, e in effects[:_MOST_PAIRS]
        ]
        name = f"significant differences of {metric} ({len(effects)})"
        header = ["of", "A", "B", "A than B", "seeds", "p"]
        items.append(table(name, header, differences, search=True))
        text = "On the same seeds: Wilcoxon's signed-rank test, corrected by Holm."
        items.append({"kind": "text", "text": text, "faint": True})
    if not items:
        items.append({"kind": "text", "text": "Every run is done; no difference is significant."})
    return Section("Failures, requirements, differences", items, "Differences")


def _parameters(plan: Plan, found: Sequence[Group]) -> Section:
    """Return every parameter with its value, or its values where the cells differ."""
    values: dict[str, dict[str, None]] = {}
    for cell in plan.cells():
        for name, value in flatten(plan.simulation(cell)).items():
            values.setdefault(name, {})[_word(value)] = None
    values.pop("seed", None)
    rows = [
        [name, next(iter(words)) if len(words) == 1 else " | ".join(list(words)[:12])]
        for name, words in values.items()
    ]
    estimators = [
        [f"estimators.{name}.{key}", _word(value)]
        for name, estimator in plan.estimators.items()
        for key, value in flatten(estimator).items()
    ]
    return Section(
        "Parameters", [table("parameters", ["name", "value"], rows + estimators, search=True)]
    )


def _word(value: object) -> str:
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_word, value)) + "]"
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _repeat(folder: Path, rows: Sequence[Row]) -> Section:
    """Return how to reproduce the numbers: the plan, the command, the version."""
    versions = sorted({str(row.get("version")) for row in rows})
    try:
        text = (folder / PLAN).read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"{folder / PLAN}: {error.strerror}") from None
    command = "campaign plan.yaml -o results"
    note = (
        f"Generated by imu_sim_ros {', '.join(versions)}. Save the plan below as plan.yaml; the "
        "same version gives the same numbers, bit for bit, on any number of workers."
    )
    items: list[Item] = [
        {"kind": "text", "text": note},
        {"kind": "code", "text": command},
        {"kind": "code", "text": text},
    ]
    environment = folder / "versions.json"
    if environment.is_file():
        items.append(
            {"kind": "code", "text": environment.read_text(encoding="utf-8", errors="replace")}
        )
    return Section("How to repeat it", items, "Repeat")
