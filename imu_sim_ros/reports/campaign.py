# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A campaign's folder as the sections of a page."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.campaigns.baseline import differences, identities_of_rows, plan_mismatch
from imu_sim_ros.campaigns.metrics import COVERED, SUCCESS, Tolerance, better_values
from imu_sim_ros.campaigns.plan import Plan, load_plan
from imu_sim_ros.campaigns.results import LOG, PLAN, TABLE, Row, read_results
from imu_sim_ros.campaigns.statistics import quantile
from imu_sim_ros.campaigns.summary import Group, group_runs, slopes
from imu_sim_ros.campaigns.verdict import judge, list_varying_names
from imu_sim_ros.core.conventions import SERIES_COLOURS
from imu_sim_ros.core.errors import InputError, Problems
from imu_sim_ros.core.names import unknown_name_line
from imu_sim_ros.core.spelling import argument_prefix
from imu_sim_ros.inputs.rows import is_present, read_text
from imu_sim_ros.navigation.evaluation import LARGEST_SIGMA, anees_band
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.reports.page import Item, Section, column, table
from imu_sim_ros.reports.runs import common_plan, run_details
from imu_sim_ros.reports.verdict import baseline_table, short_label, verdict_section

_SENSORS: Final = {
    "gyroscope_noise_density": "rad/s/sqrt(Hz)",
    "accelerometer_noise_density": "m/s^2/sqrt(Hz)",
    "gyroscope_turn_on_bias_sigma": "rad/s",
    "accelerometer_turn_on_bias_sigma": "m/s^2",
    "gyroscope_random_walk": "rad/s^2/sqrt(Hz)",
    "gyroscope_bias_instability": "rad/s",
}
"""Sensor parameters over which errors are drawn: those that affect dead reckoning most."""
_MAX_TRENDS: Final = 8
"""Largest number of lines in a plot."""
_MAX_ROWS: Final = 80
"""Groups that a plot names."""
_SHAPES: Final = ("circle", "square", "diamond")
_UNITS: Final = {"_m": "m", "_rad": "rad", "_m_s": "m/s", "_percent": "%", "_s": "s", "_mb": "MB"}
_ABBREVIATIONS: Final = {"ate", "rpe", "rmse", "nees", "imu"}


def is_campaign(path: Path) -> bool:
    """Return whether a folder is that of a campaign."""
    return path.is_dir() and (is_present(path / LOG) or is_present(path / TABLE))


def campaign_sections(
    folder: Path,
    metric: str = "",
    baselines: Sequence[Path] = (),
    tolerance: Tolerance | None = None,
    non_inferiority: Tolerance | None = None,
    baseline_anyway: bool = False,
) -> tuple[str, list[Section]]:
    """Return the title and the sections that a campaign's folder gives.

    :param metric: metric shown first; empty: the absolute position error, or the first metric.
    :param baselines: folders or tables of earlier campaigns, the oldest first.
    :param tolerance: difference that does not matter; None: the plan's.
    :param non_inferiority: margin of the comparison with the last baseline; None: not asked.
    :param baseline_anyway: compare with baselines of another plan, too.
    :raises InputError: for a folder without plan or runs, an unknown metric, or a baseline of
        another plan.
    """
    problems, earlier = Problems(), []
    with problems.collect():
        plan = load_plan(folder / PLAN)
    with problems.collect():
        rows = read_results(folder)
        if not rows:
            raise InputError(f"{folder}: contains no run yet")
    for path in baselines:
        with problems.collect():
            earlier.append((_campaign_name(path), read_results(path)))
    problems.tell()
    notes: list[str] = []
    for path, (_, baseline_identities) in zip(baselines, earlier, strict=True):
        if difference := differences(plan, identities_of_rows(rows), path, baseline_identities):
            if baseline_anyway:
                notes.append(f"The baseline {path} is of another plan: {difference}.")
            else:
                problems.append(plan_mismatch(path, difference))
    problems.tell()
    present = [name for name in plan.metrics if any(row.get(name) is not None for row in rows)]
    if metric and metric not in (*present, SUCCESS):
        none = None if present else "no run is done"
        raise InputError(
            unknown_name_line(argument_prefix("metric"), metric, [*present, SUCCESS], none)
        )
    groups = group_runs(rows, plan.grid_names)
    chosen = metric or ("ate_rmse_m" if "ate_rmse_m" in present else [*present, SUCCESS][0])
    latest_rows = earlier[-1][1] if earlier else None
    judged = judge(plan, rows, chosen, latest_rows, tolerance, non_inferiority)
    judgements = [(label(chosen), judged)]
    if chosen != SUCCESS and judged.done < judged.runs:  # else there is nothing to compare
        judgements.append((label(SUCCESS), judge(plan, rows, SUCCESS, None, tolerance)))
    verdict = verdict_section(plan, judgements, groups, str(folder))
    if judged.baseline:
        verdict.items.append(baseline_table(judged.baseline, chosen, earlier[-1][0]))
    verdict.items.extend({"kind": "text", "text": note} for note in notes)
    sections = [verdict, _results(plan, rows, groups, present, chosen, folder)]
    if earlier:
        results_table = sections[-1].items[-1]
        results_table["trend"] = _trend(groups, earlier, chosen)
    sections.append(_cells(plan, groups, present, chosen))
    return plan.options.name, [*sections, _parameters(plan), _repeat(folder, rows)]


def _campaign_name(path: Path) -> str:
    """Return the name of an earlier campaign, that of its folder."""
    return path.name if path.is_dir() else path.resolve().parent.name


def label(metric: str) -> str:
    """Return a metric's name with its unit: ``ATE RMSE [m]`` for ``ate_rmse_m``."""
    if metric == SUCCESS:
        return "success rate"
    name, unit = metric, ""
    for ending in sorted(_UNITS, key=len, reverse=True):
        if metric.endswith(ending):
            name, unit = metric.removesuffix(ending), f" [{_UNITS[ending]}]"
            break
    parts = (part.upper() if part in _ABBREVIATIONS else part for part in name.split("_"))
    return " ".join(parts) + unit


def _results(
    plan: Plan,
    rows: Sequence[Row],
    groups: Sequence[Group],
    metrics: Sequence[str],
    chosen: str,
    folder: Path,
) -> Section:
    """Return the section with the table of all runs."""
    names = ["seed", "estimator", "status", *plan.grid_names, *metrics, "cell"]
    shown = [name for name in ("estimator", *plan.grid_names) if name in list_varying_names(groups)]
    main = [name for name in ("coverage", *metrics[:5]) if name in metrics]
    shown = ["seed", *shown, "status", *dict.fromkeys([chosen, *main])]
    varying = list_varying_names(groups)
    item: Item = {
        "kind": "campaign",
        "campaign": str(folder),
        "metric": chosen,
        "metrics": [
            {"name": name, "label": label(name), "better": better_values(name, plan.custom_metrics)}
            | {"of_failed": name in COVERED}
            for name in (*metrics, SUCCESS)
        ],
        "grid": list(plan.grid_names),
        "shown": shown,
        "columns": [column(name, (row.get(name) for row in rows)) for name in names],
        "groups": [_group(group, metrics, varying) for group in groups],
        "estimators": _estimators(groups),
        "curves": [name for name in plan.grid_names if _is_curve(name, groups)],
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
        "sensors": _sensors(plan, groups),
        "consistency": _consistency(groups),
        "opened": run_details(plan, rows, groups, folder, chosen),
        "plan": common_plan(folder),
        "cells": {cell.name: cell.values for cell in plan.cells()},
    }
    return Section("Results", [item])


def _group(group: Group, metrics: Sequence[str], varying: Sequence[str]) -> Item:
    """Return the summary of a group of runs for the page."""
    values = {name: group.rows[0].get(name) for name in group.grid}
    summary = {SUCCESS: list(group.success())}
    for name in metrics:
        numbers = group.values(name)
        if len(numbers):
            summary[name] = list(quantile(numbers, 0.5))
    labels = {"cell": group.cell, "estimator": group.estimator}
    where = short_label(group.labels, [name for name in varying if name != "estimator"])
    labels |= {"label": short_label(group.labels, varying), "place": where}
    return {**labels, "values": values, "metrics": summary}


def _trend(
    groups: Sequence[Group], earlier: Sequence[tuple[str, Sequence[Row]]], metric: str
) -> Item:
    """Return the metric's medians with their intervals over campaigns, this one the last."""
    campaigns = [
        {(group.cell, group.estimator): group for group in group_runs(rows, ())}
        for _, rows in earlier
    ]
    campaigns.append({(group.cell, group.estimator): group for group in groups})
    varying, series = list_varying_names(groups), []
    colours = line_colours(groups)
    for colour, group in zip(colours, groups[:_MAX_TRENDS], strict=False):
        key = (group.cell, group.estimator)
        points = [
            (
                k,
                campaign[key].success()
                if metric == SUCCESS
                else quantile(campaign[key].values(metric), 0.5),
            )
            for k, campaign in enumerate(campaigns)
            if key in campaign
        ]
        line = {
            "name": short_label(group.labels, varying),
            "colour": colour,
            "x": [k for k, _ in points],
        }
        line["y"] = [interval.value for _, interval in points]
        line["low"] = [interval.low for _, interval in points]
        line["high"] = [interval.high for _, interval in points]
        series.append(line)
    rest = f" The first {_MAX_TRENDS} of {len(groups)} lines." if len(groups) > _MAX_TRENDS else ""
    return {
        "kind": "plot",
        "title": f"Trend: {label(metric)} over campaigns",
        "x": {"label": "campaign", "log": False, "names": [*(name for name, _ in earlier), "this"]},
        "y": {"label": label(metric), "log": False},
        "legend": True,
        "series": series,
        "caption": f"Median (of success the share) with its 95 % interval.{rest}",
    }


def _estimators(groups: Sequence[Group]) -> list[str]:
    """Return the estimators in the plan's order, by which they are coloured; one has no colour."""
    names = list(dict.fromkeys(group.estimator for group in groups))
    return names if len(names) > 1 else []


def _colour(group: Group, estimators: Sequence[str]) -> int | None:
    """Return the number of an estimator's colour."""
    return estimators.index(group.estimator) if estimators else None


def line_colours(groups: Sequence[Group]) -> list[int]:
    """Return the colour of each group's line: that of its estimator, dashed for further groups."""
    estimators, counts = _estimators(groups), dict[str, int]()
    result = []
    for k, group in enumerate(groups):
        number = counts[group.estimator] = counts.get(group.estimator, -1) + 1
        column = _colour(group, estimators)
        result.append(k if column is None else column + len(SERIES_COLOURS) * number)
    return result


def _is_curve(name: str, groups: Sequence[Group]) -> bool:
    """Return whether a parameter of the grid is a number that has three values or more."""
    values = {group.rows[0].get(name) for group in groups}
    return len(values) > 2 and all(
        isinstance(value, int | float) and not isinstance(value, bool) for value in values
    )


def _sensors(plan: Plan, groups: Sequence[Group]) -> list[Item]:
    """Return the parameters of each group's sensor, if the grid has several sensors."""
    if "imu" not in plan.grid_names:
        return []
    values_by_cell = {}
    for cell in plan.cells():
        imu = flatten(plan.simulation(cell))
        values_by_cell[cell.name] = {
            name: float(np.mean(np.asarray(imu[f"imu.{name}"], np.float64))) for name in _SENSORS
        }
    sensor_items = []
    for name, unit in _SENSORS.items():
        values = [
            values_by_cell[group.cell][name] if group.cell in values_by_cell else None
            for group in groups
        ]
        if sum(value is not None and value > 0.0 for value in values) > 1:
            title = f"{name.replace('_', ' ')} [{unit}]"
            sensor_items.append({"name": name, "label": title, "values": values})
    return sensor_items


def _consistency(groups: Sequence[Group]) -> Item | None:
    """Return the mean NEES of each group with its chi-square band (3 degrees of freedom)."""
    shown = [group for group in groups if len(group.values("nees_position"))][:_MAX_ROWS]
    if not shown:
        return None
    estimators = _estimators(groups)
    bands = [anees_band(3, len(group.values("nees_position"))) for group in shown]
    heights = list(range(len(shown)))
    ends = {"low": [band.low for band in bands], "high": [band.high for band in bands]}
    series: list[Item] = [
        {"name": "95 % band", "mode": "rows", "colour": None, "at": heights, **ends}
    ]
    series[0]["line"] = 3.0
    for k, metric in enumerate(("nees_position", "nees_attitude", "nees_velocity")):
        values = [group.values(metric) for group in shown]
        if any(len(sample) for sample in values):
            means = [float(sample.mean()) if len(sample) else None for sample in values]
            point = {"low": means, "high": means, "pointed": True, "shift": 0.2 * (k - 1)}
            name = metric.removeprefix("nees_")
            series.append({"name": name, "mode": "rows", "colour": None, "shape": _SHAPES[k]})
            series[-1] |= {"colours": [_colour(group, estimators) for group in shown]}
            series[-1] |= {"at": heights, "x": means, **point}
    varying = list_varying_names(groups)
    rest = f" The first {_MAX_ROWS}." if len(groups) > _MAX_ROWS else ""
    return {
        "kind": "plot",
        "title": "Consistency: mean NEES of the final state",
        "x": {"label": "NEES, 3 expected", "log": True},
        "categories": [short_label(group.labels, varying) for group in shown],
        "series": series,
        "caption": "95 % of the cells of a consistent estimator lie in the band; left of it the "
        f"covariance is too large, right of it too small.{rest}",
    }


def _cells(plan: Plan, groups: Sequence[Group], metrics: Sequence[str], chosen: str) -> Section:
    """Return the summary: a row for each cell and estimator."""
    shown = [name for name in metrics if not name.startswith("rpe_")]
    varying = list_varying_names(groups)
    header = ["no.", *plan.grid_names, "estimator", "done", "runs"]
    for name in shown:
        header += [f"{name} {part}" for part in ("median", "low", "high", "p95")]
    rows: list[list[object]] = []
    for number, group in enumerate(groups, 1):
        labels = group.labels
        row: list[object] = [number, *(labels[name] for name in plan.grid_names), group.estimator]
        row += [group.done, len(group.rows)]
        for name in shown:
            values = group.values(name)
            if group.is_invalid(name):
                row += ["not valid", None, None, None]
            else:
                row += [*quantile(values, 0.5), quantile(values, 0.95).value]
        rows.append(row)
    text = "Medians with their exact 95 % intervals; summary.csv has more. A NEES is not valid if "
    text += f"the attitude is known to no better than {LARGEST_SIGMA:g} rad."
    items: list[Item] = [{"kind": "text", "text": text, "faint": True}]
    cells = table("cells", header, rows, search=True)
    main = [f"{chosen} {part}" for part in ("median", "low", "high", "p95")]
    main += [name for name in ("coverage median",) if name in header]
    cells["printed"] = len(rows)
    cells["intervals"] = [
        [f"{name} {part}" for part in ("median", "low", "high")] for name in shown
    ]
    cells["shown"] = ["no.", *varying, "done", "runs", *main]
    return Section("Cells", [*items, cells])


def _parameters(plan: Plan) -> Section:
    """Return every parameter with its value, or its values if the cells differ."""
    values: dict[str, dict[str, None]] = {}
    for cell in plan.cells():
        for name, value in flatten(plan.simulation(cell)).items():
            values.setdefault(name, {})[_word(value)] = None
    values.pop("seed", None)
    constants = [[name, *texts] for name, texts in values.items() if len(texts) == 1]
    differing = [
        [name, len(texts), " | ".join(list(texts)[:12])]
        for name, texts in values.items()
        if len(texts) > 1
    ]
    estimators = [
        [f"estimators.{name}.{key}", _word(value)]
        for name, estimator in plan.estimators.items()
        for key, value in flatten(estimator).items()
    ]
    items: list[Item] = []
    if differing:
        name = "parameters that vary"
        items.append(table(name, ["name", "values", "the first 12"], differing, search=True))
    constant = table("constant parameters", ["name", "value"], constants + estimators, search=True)
    title = f"{len(constants)} parameters that do not vary, and those of the estimators"
    items.append({"kind": "folded", "title": title, "items": [constant]})
    return Section("Parameters", items)


def _word(value: object) -> str:
    """Return a value as text."""
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_word, value)) + "]"
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _repeat(folder: Path, rows: Sequence[Row]) -> Section:
    """Return how to reproduce the numbers: the plan, the command, the version."""
    versions = sorted({str(row.get("version")) for row in rows})
    text = read_text(folder / PLAN)
    command = "imu_sim campaign plan.yaml -o results"
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
    if is_present(environment):
        versions_text = environment.read_text(encoding="utf-8", errors="replace")
        inner = [{"kind": "code", "text": versions_text}]
        items.append({"kind": "folded", "title": "versions of everything used", "items": inner})
    return Section("How to repeat it", items, "Repeat")
