# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statistics against SciPy, against closed forms, and by their coverage."""

import itertools
import json
import re

import numpy as np
import pytest
import scipy.stats

from imu_sim_ros.campaigns.effects import DIFFERENCE, RATIO, SHARE, Effect
from imu_sim_ros.campaigns.gate import parse
from imu_sim_ros.campaigns.metrics import parse_tolerance
from imu_sim_ros.campaigns.plan import read_plan
from imu_sim_ros.campaigns.statistics import (
    ConfidenceInterval,
    holm,
    mean,
    means,
    non_inferior,
    power,
    quantile,
    seeds_for_power,
    sensitivity,
    share_difference,
    shift,
    signed_rank_limit,
    statistic,
    success,
)
from imu_sim_ros.campaigns.summary import check_requirements, group_runs, unmet_lines
from imu_sim_ros.campaigns.verdict import Contest, headline, judge


def test_an_unmet_requirement_of_many_cells_does_not_bury_the_results():
    rows = [
        {"cell": f"rate={k}", "estimator": "a", "seed": 0, "status": "done", "ate_rmse_m": 2.0}
        for k in range(72)
    ]
    require = parse(["ate_rmse_m.median < 1", "success < 1"], ["ate_rmse_m"], [], [])
    lines = unmet_lines(require, check_requirements(group_runs(rows, ()), require, 1))
    assert len(lines) == 2 * 11
    assert lines[0] == "require ate_rmse_m.median < 1: ate_rmse_m.median is 2 (rate=0; a)"
    assert lines[10].startswith("require ate_rmse_m.median < 1: not met 62 more times")
    assert lines[21].startswith("require success < 1: not met 62 more times")


@pytest.mark.parametrize("statistic", ["mean", "median", "min", "p95", "max"])
@pytest.mark.parametrize(("without", "value"), [("failed: lost", None), ("done", None)])
def test_a_run_without_a_value_leaves_every_requirement_unmet(statistic, without, value):
    """Failed or done without the metric; ``of done`` asks for the runs that are done alone."""
    rows = [
        {"cell": "all", "estimator": "a", "seed": seed, "status": "done", "ate_rmse_m": 2.0}
        for seed in range(5)
    ]
    rows[3] = {**rows[3], "status": without, "ate_rmse_m": value}
    texts = [f"ate_rmse_m.{statistic} < 5", f"ate_rmse_m.{statistic} of done < 5"]
    require = parse(texts, ["ate_rmse_m"], [], ["a"])
    over_all_runs, over_done_runs = check_requirements(group_runs(rows, ()), require, 5)
    assert (over_all_runs.met, over_all_runs.value) == (False, 2.0)
    assert (over_all_runs.missing, over_all_runs.runs) == (1, 5)
    assert over_all_runs.comment == "is 2 over 4 of 5 runs; 1 run has no value"
    assert over_done_runs.met == (without != "done")
    (line,) = unmet_lines(require[:1], [over_all_runs])
    assert line == f"require {texts[0]}: ate_rmse_m.{statistic} {over_all_runs.comment} (all; a)"


def test_runs_that_were_asked_for_and_not_made_count_too():
    rows = [{"cell": "all", "estimator": "a", "seed": 0, "status": "done", "coverage": 1.0}]
    require = parse(["coverage.min > 0.5", "success >= 0.9"], ["coverage"], [], ["a"])
    share, success_rate = check_requirements(group_runs(rows, ()), require, 3)
    assert (share.met, share.missing) == (False, 2)
    assert (success_rate.met, success_rate.value) == (False, pytest.approx(1 / 3))


def test_success_is_wilsons_interval():
    """Wilson's interval of 45 of 50, worked out from its closed form."""
    z, n, p = 1.959963984540054, 50, 0.9
    centre = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    assert success(45, 50) == pytest.approx((0.9, centre - half, centre + half), rel=1e-12)
    assert success(0, 0).value is None
    assert success(50, 50).high == pytest.approx(1.0)
    for runs in (1, 7, 40):
        for done in range(runs + 1):
            ends = scipy.stats.binomtest(done, runs).proportion_ci(0.95, method="wilson")
            assert success(done, runs)[1:] == pytest.approx((ends.low, ends.high), abs=1e-15)


@pytest.mark.parametrize("n", [6, 40, 1000])
def test_the_mean_has_the_interval_of_scipys_bootstrap(n):
    """The same resamples are drawn: both ends are equal but for rounding."""
    values = np.random.default_rng(3).lognormal(0.0, 0.6, n)
    theirs = scipy.stats.bootstrap(
        (values,),
        np.mean,
        n_resamples=4999,
        batch=max(1_000_000 // n, 1),
        method="BCa",
        random_state=20_240_611,
    ).confidence_interval
    assert mean(values) == pytest.approx((values.mean(), theirs.low, theirs.high), rel=1e-13)


@pytest.mark.parametrize(("value", "step"), [(1.0, 2.3e-16), (0.0, 1e-200), (1.0, 1e200)])
def test_values_of_any_size_have_a_finite_interval(value, step):
    """One value differs by the rounding of the others, or is nearly all of their sum."""
    estimate = mean(np.array([value] * 5 + [value + step]))
    assert estimate.low <= estimate.value <= estimate.high < np.inf


def test_many_means_have_the_intervals_of_each_alone():
    """Samples of any size, constant and short ones too; sums in another order differ by 1e-13."""
    rng = np.random.default_rng(4)
    samples = [rng.lognormal(0.0, 0.6, n) for n in (40, 40, 12, 1, 0, 5, 1200, 12, 40)]
    samples.insert(3, np.full(12, 2.5))
    for ours, values in zip(means(samples), samples, strict=True):
        for end, alone in zip(ours, mean(values), strict=True):
            assert end == (None if alone is None else pytest.approx(alone, rel=1e-12))


@pytest.mark.parametrize("p", [0.5, 0.05, 0.95])
@pytest.mark.parametrize("n", [10, 37, 200])
def test_quantiles_have_the_exact_interval_of_the_order_statistics(n, p):
    """The limits are the ranks r, s with P(B < r) and P(B >= s) at most 2.5 %, by definition."""
    values = np.arange(1.0, n + 1.0)
    estimate = quantile(values, p)
    binomial = scipy.stats.binom(n, p)
    lows = [r for r in range(1, n + 1) if binomial.cdf(r - 1) <= 0.025]
    highs = [s for s in range(1, n + 1) if binomial.sf(s - 1) <= 0.025]
    assert estimate.value == np.quantile(values, p)
    assert estimate.low == (max(lows) if lows else None)
    assert estimate.high == (min(highs) if highs else None)


@pytest.mark.parametrize(
    ("name", "truth"),
    [("mean", np.exp(0.125)), ("median", 1.0), ("p90", np.exp(0.5 * 1.2815515655446004))],
)
def test_intervals_hold_the_truth_in_95_percent_of_campaigns(name, truth):
    """250 campaigns of 50 errors that are lognormal: 90 to 99 %.

    The share of 250 scatters by sqrt(0.95 * 0.05 / 250) = 1.4 %. Intervals that are too short by a
    factor of sqrt(2) hold the truth in 83 %.
    """
    rng = np.random.default_rng(11)
    inside_count = 0
    for _ in range(250):
        estimate = statistic(rng.lognormal(0.0, 0.5, 50), name)
        low = -np.inf if estimate.low is None else estimate.low
        high = np.inf if estimate.high is None else estimate.high
        inside_count += low <= truth <= high
    assert 0.90 <= inside_count / 250 <= 0.99


def paired_campaign(rng, factor):
    """Return errors of two estimators on 50 seeds: a shared part, and 15 % of their own."""
    common = rng.lognormal(0.0, 0.5, 50)
    separate = rng.lognormal(0.0, 0.15, (2, 50))
    return common * separate[0] * factor, common * separate[1]


def p_of(pair):
    return shift(np.log(pair[0] / pair[1])).p


def test_a_planted_difference_is_found_and_none_is_not_invented():
    """A difference of 10 % against a spread of 21 % of the ratio, 50 pairs: t = 3.2.

    Wilcoxon's test has 84 % power there (1000 campaigns), so that 84 +- 3.7 of 100 are found.

    Without one, at most 5 % of 200 are significant by chance: 10 +- 3.1; 19 is three of these.
    """
    rng = np.random.default_rng(5)
    found_count = sum(p_of(paired_campaign(rng, 1.1)) < 0.05 for _ in range(100))
    invented = sum(p_of(paired_campaign(rng, 1.0)) < 0.05 for _ in range(200))
    assert found_count >= 73
    assert invented <= 19


def rows_of(name, values, estimator="a", **columns):
    """Return the rows of a sensor; a value of None is a failed run."""
    return [
        {"cell": f"imu={name}", "imu": name, "estimator": estimator, "seed": seed}
        | {"status": "failed: lost" if value is None else "done", "ate_rmse_m": value, **columns}
        for seed, value in enumerate(values)
    ]


PLAN = {"grid": {"imu": ["s0", "s1", "s2", "s3"]}, "seeds": 50}


def judged(rows, baseline=None, metric="ate_rmse_m", **plan):
    return judge(read_plan({**PLAN, **plan}), rows, metric, baseline)


def significant(*errors):
    """Return how many differences a campaign over as many sensors reports."""
    rows = [row for k, values in enumerate(errors) for row in rows_of(f"s{k}", values)]
    (contest,) = judged(rows).contests
    return sum(effect.significant for effect in contest.effects)


def test_a_campaign_of_equal_sensors_reports_a_difference_at_most_in_5_percent():
    """Four sensors, six comparisons, the chance of any: Holm keeps it below 5 %.

    120 campaigns: 6 +- 2.4 if it were 5 %; uncorrected, a fifth of them would report some.
    """
    rng = np.random.default_rng(17)
    false, uncorrected = 0, 0
    for _ in range(120):
        common = rng.lognormal(0.0, 0.5, 50)
        errors = [common * rng.lognormal(0.0, 0.15, 50) for _ in range(4)]
        false += significant(*errors) > 0
        uncorrected += any(p_of(pair) < 0.05 for pair in itertools.combinations(errors, 2))
    assert false <= 6
    assert uncorrected >= 15


def test_a_campaign_finds_the_sensor_that_is_10_percent_worse():
    """50 paired seeds with 5 % of scatter of their own: all three comparisons with it, no other."""
    rng = np.random.default_rng(23)
    common = rng.lognormal(0.0, 0.5, 50)
    errors = [common * rng.lognormal(0.0, 0.05, 50) for _ in range(3)]
    assert significant(*errors) == 0
    assert significant(*errors, 1.1 * common * rng.lognormal(0.0, 0.05, 50)) == 3


@pytest.mark.parametrize("n", [6, 12, 50, 51, 400])
def test_shifts_are_wilcoxons_and_hodges_and_lehmanns(n):
    """SciPy's test, also of a shifted hypothesis; the averages written out."""
    d = np.random.default_rng(8).normal(0.3, 1.0, n)
    pair_shift = shift(d, 0.1)
    assert pair_shift.p == pytest.approx(scipy.stats.wilcoxon(d).pvalue, rel=1e-9)
    p_above = scipy.stats.wilcoxon(d - 0.1, alternative="greater").pvalue
    p_below = scipy.stats.wilcoxon(d + 0.1, alternative="less").pvalue
    assert pair_shift.p_beyond == pytest.approx(min(2.0 * min(p_above, p_below), 1.0), rel=1e-9)
    averages = [(d[i] + d[j]) / 2 for i in range(n) for j in range(i, n)]
    assert pair_shift.centre.value == pytest.approx(np.median(averages), rel=1e-12)
    # What the test refuses lies outside of the interval, what it does not refuse within.
    for end, inward in ((pair_shift.centre.low, 1e-9), (pair_shift.centre.high, -1e-9)):
        assert scipy.stats.wilcoxon(d - end - inward).pvalue > 0.05
        assert scipy.stats.wilcoxon(d - end + inward).pvalue <= 0.05


def test_ties_have_their_exact_distribution():
    """All 256 signs of eight ranks with ties, counted."""
    d = np.array([1.0, 1.0, -1.0, 2.0, 2.0, 3.0, -4.0, 1.0])
    ranks = scipy.stats.rankdata(abs(d))
    sums = np.array([ranks @ signs for signs in itertools.product([0, 1], repeat=8)])
    at_least = np.mean(sums >= ranks[d > 0].sum())
    assert shift(d).p == pytest.approx(2.0 * at_least)
    assert shift(np.zeros(8)).p == 1.0
    assert shift(d[:3]).p is None


def test_many_pairs_have_the_interval_of_all_their_averages():
    """A million averages drawn from 2000 pairs give the interval within a tenth of its width.

    A place in the order of m draws scatters by 0.5 / sqrt(m) = 0.0005 of them; the interval spans
    2 * 1.96 / sqrt(3 n) = 0.05 of them.
    """
    d = np.random.default_rng(9).normal(0.1, 1.0, 2000)
    first_index, second_index = np.triu_indices(2000)
    averages = np.sort((d[first_index] + d[second_index]) / 2)
    rank = signed_rank_limit(2000, 0.025)
    low, high = averages[rank], averages[-1 - rank]
    centre = shift(d).centre
    assert centre == pytest.approx((np.median(averages), low, high), abs=0.1 * (high - low))


def test_shares_are_compared_exactly():
    """McNemar's test is the binomial one of the pairs that differ; Bonett and Price's by hand."""
    a, b = np.zeros(60, bool), np.ones(60, bool)
    a[:10] = True
    difference, p = share_difference(a, b)
    assert p == pytest.approx(2.0 * 0.5**50)
    gain, loss = 1 / 62, 51 / 62
    half = 1.959963984540054 * np.sqrt((gain + loss - (gain - loss) ** 2) / 62)
    assert difference == pytest.approx((-50 / 60, gain - loss - half, gain - loss + half))
    few = np.arange(60) < 5
    assert share_difference(~few, b)[1] is None  # 5 pairs: at best p = 0.0625
    assert share_difference(b, b)[0].value == 0.0
    for wins in (0, 3, 10, 11, 20):
        a = np.arange(20) < wins
        assert share_difference(a, ~a)[1] == pytest.approx(scipy.stats.binomtest(wins, 20).pvalue)


def test_a_failed_run_is_worse_than_any_number():
    """60 of 60 done, and then 10 of 60 with the same errors where it still works."""
    rng = np.random.default_rng(4)
    errors = list(rng.lognormal(0.0, 0.5, 60))
    rows_now = rows_of("s0", [*errors[:10], *([None] * 50)])
    judgement = judged(rows_now, rows_of("s0", errors), seeds=60)
    (effect,) = judgement.baseline
    assert (effect.verdict, effect.won, effect.lost) == ("worse", 0, 50)
    assert effect.success.value == pytest.approx(-50 / 60)
    assert effect.success_p < 1e-12
    assert effect.effect.value is None
    (problem,) = judgement.problems
    assert problem.startswith("worse than the baseline: imu=s0; a: ")
    assert "83.3 % fewer runs done" in problem
    # Few failures, with smaller errors in all other runs: better by ranks, not by leaving out.
    better = rows_of("s0", [None, None, None, *(0.8 * np.array(errors[3:]))])
    (effect,) = judged(better, rows_of("s0", errors), seeds=60).baseline
    assert (effect.won, effect.lost, effect.verdict) == (57, 3, "better")
    assert effect.effect.value == pytest.approx(0.8)
    assert judged(rows_now, rows_of("s0", errors), metric="success").baseline[0].verdict == "worse"


def test_one_failure_in_three_seeds_has_no_size():
    """The middle of six averages lies between a number and a half of something infinite."""
    for values in ([None, 0.9, 0.8], [None, 1.1, 1.2], [None, None, 0.9, 0.8, 1.1]):
        rows_before = rows_of("s0", [1.0] * len(values))
        (effect,) = judged(rows_of("s0", values), rows_before, seeds=len(values)).baseline
        assert (effect.effect.value, effect.verdict) == (None, "undecided")


def test_failures_on_both_sides_say_nothing():
    rng = np.random.default_rng(4)
    errors = [None] * 30 + list(rng.lognormal(0.0, 0.5, 30))
    judgement = judged(rows_of("s0", errors), rows_of("s0", errors), seeds=60)
    (effect,) = judgement.baseline
    assert (effect.seeds, effect.won, effect.lost, effect.verdict) == (30, 0, 0, "equal")
    assert judgement.problems == []


def test_a_difference_within_the_tolerance_is_none():
    """0.001 % worse on each of 50 seeds is significant, and no reason to stop anybody."""
    rng = np.random.default_rng(6)
    errors_before = rng.lognormal(0.0, 0.5, 50)
    (effect,) = judged(
        rows_of("s0", 1.00001 * errors_before), rows_of("s0", errors_before)
    ).baseline
    assert effect.p < 1e-8
    assert effect.verdict == "equal"
    rows_now = rows_of("s0", 1.03 * errors_before)
    assert judged(rows_now, rows_of("s0", errors_before)).baseline[0].verdict == "worse"
    assert (
        judged(rows_now, rows_of("s0", errors_before), tolerance="5 %").baseline[0].verdict
        == "equal"
    )
    # 0.1 m in the metric's unit: 3 % of errors around 1 m are less.
    assert (
        judged(rows_now, rows_of("s0", errors_before), tolerance=0.2).baseline[0].kind
        == "difference"
    )
    assert (
        judged(rows_now, rows_of("s0", errors_before), tolerance=0.2).baseline[0].verdict == "equal"
    )
    assert (
        judged(rows_now, rows_of("s0", errors_before), tolerance=0.001).baseline[0].verdict
        == "worse"
    )


def test_equal_builds_fail_the_gate_in_5_percent_of_campaigns_at_most():
    """Four sensors, tolerance 0, failures in a tenth of all runs, in 90 campaigns.

    Of two-sided tests at 5 % one half is an alarm: 2.5 % of 90 are 2.3 +- 1.5; 6 is 2.5 of these
    above.
    """
    rng = np.random.default_rng(29)

    def build(common):
        rows = []
        for k in range(4):
            errors = common * rng.lognormal(0.0, 0.2, 30)
            failed = rng.random(30) < 0.1
            rows += rows_of(
                f"s{k}", [None if f else e for e, f in zip(errors, failed, strict=True)]
            )
        return rows

    alarms = 0
    for _ in range(90):
        common = rng.lognormal(0.0, 0.5, 30)
        alarms += bool(judged(build(common), build(common), seeds=30, tolerance=0).problems)
    assert alarms <= 6


@pytest.mark.parametrize(
    ("metric", "value_ratio", "verdict"),
    [
        ("real_time_factor", 1.2, "better"),
        ("real_time_factor", 0.8, "worse"),
        ("wall_s", 0.8, "better"),
        ("inliers", 1.2, "better"),
        ("lag", 1.2, "worse"),
    ],
)
def test_metrics_know_their_better_direction(metric, value_ratio, verdict):
    values = np.random.default_rng(7).lognormal(0.0, 0.5, 50)
    rows_before, rows_after = (rows_of("s0", [1.0] * 50) for _ in range(2))
    for k, value in enumerate(values):
        rows_before[k][metric], rows_after[k][metric] = value, value_ratio * value
    metric_directions = {"metrics": {"inliers": "higher", "lag": "lower"}}
    (effect,) = judged(rows_after, rows_before, metric, **metric_directions).baseline
    assert effect.verdict == verdict
    assert effect.effect.value == pytest.approx(value_ratio)


def test_metrics_with_a_right_value_are_judged_by_their_distance_from_it():
    """NEES of chi-square with 3 degrees of freedom, and ten times as large."""
    nees = np.random.default_rng(7).chisquare(3, 50)
    rows_before, rows_after = (rows_of("s0", [1.0] * 50) for _ in range(2))
    for k, value in enumerate(nees):
        rows_before[k]["nees_position"], rows_after[k]["nees_position"] = value, 10.0 * value
    (effect,) = judged(rows_after, rows_before, "nees_position").baseline
    assert (effect.verdict, effect.kind) == ("worse", "difference")


def test_differently_aligned_estimators_are_not_compared():
    errors = np.random.default_rng(7).lognormal(0.0, 0.5, 50)
    rows = rows_of("s0", errors, "a", align="yaw", wall_s=1.0)
    rows += rows_of("s0", 2.0 * errors, "b", align="none", wall_s=2.0)
    estimators = {"a": {"command": "true"}, "b": {"command": "true"}}
    (contest,) = judged(rows, estimators=estimators).contests
    assert contest.best is None
    assert (contest.lead.p, contest.lead.effect.value) == (None, None)
    assert "aligned differently (yaw and none)" in contest.line("ate_rmse_m", "2 %")
    # What no alignment changes is compared.
    assert judged(rows, metric="wall_s", estimators=estimators).contests[0].best == "a"


def test_the_best_is_named_with_effect_seeds_and_p():
    rng = np.random.default_rng(12)
    common = rng.lognormal(0.0, 0.5, 30)
    rows = rows_of("good", common) + rows_of("bad", 250.0 * common * rng.lognormal(0, 0.1, 30))
    judgement = judged(rows, grid={"imu": ["good", "bad"]}, seeds=30)
    (contest,) = judgement.headline
    assert (judgement.factor, contest.best, contest.ranking) == ("imu", "good", ["good", "bad"])
    assert contest.lead.won == 30
    assert 1 / contest.lead.effect.value == pytest.approx(250.0, rel=0.1)
    interval = r"2\d\d\.\d to 2\d\d\.\d"
    headline_pattern = (
        rf"^good beats bad; ate_rmse_m 2\d\d\.\d times smaller \(95 %: {interval}\) than with"
    )
    headline_pattern += r" bad, better on 30 of 30 seeds, p = [\d.e-]+$"
    assert re.search(headline_pattern, contest.line("ate_rmse_m", "2 %"))
    json.dumps(judgement.to_dict(), allow_nan=False)


def test_the_sensor_without_errors_is_compared_and_not_ranked():
    """The perfect sensor is ranked only if there is just one other sensor."""
    common = np.random.default_rng(13).lognormal(0.0, 0.5, 30)
    rows = rows_of("good", common) + rows_of("bad", 2.0 * common)
    rows += rows_of("perfect", 1e-3 * common)
    (contest,) = judged(rows, grid={"imu": ["perfect", "good", "bad"]}, seeds=30).headline
    assert (contest.best, contest.ranking) == ("good", ["good", "bad", "perfect"])
    assert contest.unranked == ["perfect"]
    assert {(effect.a, effect.b): effect.verdict for effect in contest.effects}[
        "good", "perfect"
    ] == "worse"
    two = [row for row in rows if "bad" not in row["cell"]]
    (contest,) = judged(two, grid={"imu": ["perfect", "good"]}, seeds=30).headline
    assert (contest.best, contest.unranked) == ("perfect", [])


def test_power_is_that_of_scipys_test_on_simulated_campaigns():
    """30 seeds, 20 % of scatter of the ratio, 10 % worse, against a margin of 2 %: 48 %.

    Both shares are of 4000 campaigns: 0.8 % each, so that three deviations of the difference are
    3.4 %. Seeds that are enough for 80 % are so for SciPy's test.
    """
    rng = np.random.default_rng(31)

    def found(seeds):
        d = np.log(1.1) - np.log(1.02) + 0.2 * rng.standard_normal((4000, seeds))
        p = scipy.stats.wilcoxon(d, axis=1, alternative="greater").pvalue
        return np.mean(p < 0.025)

    assert power(30, 0.1, 0.2, 0.02, 1) == pytest.approx(found(30), abs=0.034)
    assert power(30, 0.1, 0.2, 0.02, 1) == pytest.approx(0.48, abs=0.034)
    seeds = seeds_for_power(0.8, 0.1, 0.2, 0.02, 1)
    assert found(seeds) == pytest.approx(0.8, abs=0.034)
    assert seeds_for_power(0.8, 0.1, 0.2, 0.02, 10) > 1.3 * seeds
    assert power(5, 1.0, 0.01, 0.0, 1) == 0.0  # five pairs are never significant


def test_non_inferiority_is_scipys_one_sided_test_and_has_the_stated_power():
    """Equal builds, scatter 10 %, margin 5 %, 40 seeds; 4000 campaigns as for the power.

    The proof is SciPy's test of ratios below 1.05, one-sided at 2.5 %; a build that is exactly 5 %
    worse is passed in 2.5 % of campaigns: 25 +- 5 of 1000; 40 is three of these.
    """
    rng = np.random.default_rng(37)
    margin = np.log(1.05)
    for _ in range(50):
        d = 0.1 * rng.standard_normal(12)
        p = scipy.stats.wilcoxon(d - margin, alternative="less").pvalue
        assert non_inferior(d, margin) == (p < 0.025)
    equal = 0.1 * rng.standard_normal((1000, 40))
    assert sum(non_inferior(d + margin, margin) for d in equal) <= 40
    # 1000 and 4000 campaigns: three deviations of the difference are 4.5 %.
    non_inferior_share = np.mean([non_inferior(d, margin) for d in equal])
    assert power(40, 0.05, 0.1, 0.0, 1) == pytest.approx(non_inferior_share, abs=0.045)
    assert not non_inferior(np.full(5, -1.0), margin)  # five pairs prove nothing
    assert not non_inferior(np.array([np.inf] * 3 + [0.0] * 5), margin)


def test_a_gate_of_non_inferiority_wants_a_proof():
    """The same build passes; one whose scatter leaves 10 % open does not, though not worse."""
    rng = np.random.default_rng(41)
    errors = rng.lognormal(0.0, 0.5, 50)
    plan = read_plan({**PLAN, "grid": {"imu": ["s0"]}})

    def gate(errors_now, margin="5 %"):
        allowed = parse_tolerance(margin)
        rows = [rows_of("s0", values) for values in (errors_now, errors)]
        return judge(plan, *rows[:1], "ate_rmse_m", rows[1], non_inferiority=allowed)

    assert gate(errors).problems == []
    noisy = gate(errors * np.exp(np.linspace(-1.0, 1.0, 50)))
    (effect,) = noisy.baseline
    assert (effect.verdict, effect.non_inferior) == ("undecided", False)
    (line,) = noisy.problems
    assert line.startswith("not proven to be less than 5 % worse than the baseline: imu=s0; a: ")
    assert gate(errors * np.exp(np.linspace(-1.0, 1.0, 50)), "50 %").problems == []
    assert gate([None] * 20 + list(errors[20:])).baseline[0].non_inferior is False
    other_judgement = judge(plan, rows_of("s1", errors) + rows_of("s0", errors), "ate_rmse_m",
                  rows_of("s0", errors), non_inferiority=parse_tolerance("5 %"))  # fmt: skip
    assert other_judgement.problems == ["not proven, the baseline has no such run: imu=s1; a"]


def test_intervals_of_all_comparisons_hold_at_once_in_95_percent_of_campaigns():
    """Four sensors, six ratios: all within their intervals, or not, in 300 campaigns of 30 seeds.

    At most 5 % outside: 15 +- 3.8; 27 is three more. Single intervals: a fifth, 60, have one out.
    """
    rng = np.random.default_rng(43)
    outside_count, single_count = 0, 0
    for _ in range(300):
        logs = 0.2 * rng.standard_normal((4, 30))
        pairs = [a - b for a, b in itertools.combinations(logs, 2)]
        shifts = [shift(d, comparisons=6) for d in pairs]
        outside_count += any(
            not pair_shift.simultaneous.low <= 0.0 <= pair_shift.simultaneous.high
            for pair_shift in shifts
        )
        single_count += any(
            not pair_shift.centre.low <= 0.0 <= pair_shift.centre.high for pair_shift in shifts
        )
    assert outside_count <= 27
    assert single_count >= 35


def test_the_headline_tells_equal_from_undecided():
    def contest(name, verdict, size=0.5):
        interval = ConfidenceInterval(size, 0.9 * size, 1.1 * size)
        effect = Effect("a", "b", "ratio", interval, interval, 9, 9, 0, 0.1, 0.01, 0.01,
                        ConfidenceInterval(0.0, 0.0, 0.0), None, verdict)  # fmt: skip
        best = "a" if verdict == "better" else None
        return Contest("imu", {"cell": name}, ["a", "b"], [], best, effect, [effect])

    contests = [contest("w", "better", 0.25), contest("x", "better"), contest("y", "equal")]
    contests.append(contest("z", "undecided"))
    assert headline(contests, "ate", "2 %") == (
        "a is the best imu in 2 of 4 comparisons",
        "ate smaller by 50 % to 75 % than with the next, p at most 0.01; "
        "equal within 2 % in 1; undecided in 1",
    )
    assert headline(contests[2:], "ate", "2 %") == (
        "No imu is the best in any of 2 comparisons",
        "equal within 2 % in 1; undecided in 1",
    )
    assert (
        contests[2]
        .line("ate", "2 %")
        .startswith("cell=y: a and b are equal within 2 %; a: ate 2.00 ")
    )


def test_holm_by_hand():
    """Four p values: 0.01 * 4, 0.02 * 3, 0.03 * 2, 0.04 * 1, each at least the one before."""
    assert holm([0.02, 0.01, 0.03, 0.04]) == pytest.approx([0.06, 0.04, 0.06, 0.06])
    assert holm([0.5, None, 0.9]) == [1.0, None, 1.0]
    assert holm([]) == []


def test_sensitivity_finds_the_exponent():
    """error = parameter^0.5 with 20 % of scatter, 9 values, 30 seeds: the interval holds 0.5."""
    rng = np.random.default_rng(2)
    x = np.tile(np.geomspace(1e-4, 1e-2, 9), 30)
    seed = np.repeat(np.arange(30), 9)
    common = np.repeat(rng.lognormal(0, 0.5, 30), 9)
    fit = sensitivity(x, np.sqrt(x) * common * rng.lognormal(0, 0.2, x.size), seed)
    assert fit.slope.low < 0.5 < fit.slope.high
    assert fit.slope.high - fit.slope.low < 0.1
    assert sensitivity(np.ones(4), np.ones(4), np.arange(4)) is None
    x, y = x.reshape(30, 9), (np.sqrt(x) * common).reshape(30, 9)
    y *= rng.lognormal(0, 0.2, y.shape)
    slopes = np.array([np.polyfit(np.log(x[k]), np.log(y[k]), 1)[0] for k in range(30)])
    ends = scipy.stats.t.interval(0.95, 29, slopes.mean(), slopes.std(ddof=1) / np.sqrt(30))
    slope = sensitivity(x.ravel(), y.ravel(), seed).slope
    assert slope == pytest.approx((slopes.mean(), *ends), rel=1e-10)


@pytest.mark.parametrize(
    ("kind", "effect", "size_text"),
    [
        (RATIO, (0.88, 0.85, 0.92), "12.0 % smaller (95 %: 8.0 % to 15.0 %)"),
        (RATIO, (0.997, 0.99, 1.004), "0.30 % smaller (95 %: 0.40 % larger to 1.00 % smaller)"),
        (RATIO, (0.25, 0.2, 0.5), "4.0 times smaller (95 %: 2.0 to 5.0)"),
        (RATIO, (3.0, 2.0, None), "3 times larger (95 %: at least 2)"),
        (DIFFERENCE, (-0.2, -0.5, 0.1), "0.20 smaller (95 %: 0.10 larger to 0.50 smaller)"),
        (SHARE, (-0.5, -0.6, -0.3), "50 % fewer runs done (95 %: 30 % to 60 %)"),
        (
            RATIO,
            (1.1, None, None),
            "10 % larger (no 95 % interval: too few seeds, or too many failed runs)",
        ),
        (
            RATIO,
            (None, None, None),
            "size unknown, too many runs failed",
        ),
    ],
)
def test_the_size_of_an_effect_in_words(kind, effect, size_text):
    numbers = {"seeds": 9, "won": 1, "lost": 2, "scatter": None, "p": None, "p_beyond": None}
    share = ConfidenceInterval(0.0, 0.0, 0.0)
    sized_effect = Effect(
        "a",
        "b",
        kind,
        ConfidenceInterval(*effect),
        ConfidenceInterval(*effect),
        **numbers,
        success=share,
        success_p=None,
        verdict="undecided",
    )
    assert sized_effect.size() == size_text
