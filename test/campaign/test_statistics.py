# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statistics against SciPy, against closed forms, and by their coverage."""

import itertools

import numpy as np
import pytest
import scipy.stats

from imu_sim_ros.campaign import compared, groups, unmet, unmet_lines
from imu_sim_ros.campaign.gate import parse
from imu_sim_ros.campaign.statistics import (
    compare,
    holm,
    mean,
    quantile,
    sensitivity,
    statistic,
    success,
)


def test_an_unmet_requirement_of_many_cells_does_not_bury_the_results():
    rows = [
        {"cell": f"rate={k}", "estimator": "a", "seed": 0, "status": "done", "ate_rmse_m": 2.0}
        for k in range(72)
    ]
    require = parse(["ate_rmse_m.median < 1", "success >= 1.1"], ["ate_rmse_m"], [])
    lines = unmet_lines(unmet(groups(rows, ()), require))
    assert len(lines) == 2 * 11
    assert lines[0] == "require ate_rmse_m.median < 1: ate_rmse_m.median is 2 (rate=0; a)"
    assert lines[10].startswith("require ate_rmse_m.median < 1: not met 62 more times")
    assert lines[21].startswith("require success >= 1.1: not met 62 more times")


def test_success_is_wilsons_interval():
    """Wilson's interval of 45 of 50, worked out from its closed form."""
    z, n, p = 1.959963984540054, 50, 0.9
    centre = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    assert success(45, 50) == pytest.approx((0.9, centre - half, centre + half), rel=1e-12)
    assert success(0, 0).value is None
    assert success(50, 50).high == pytest.approx(1.0)


def test_the_mean_has_the_interval_of_scipys_bootstrap():
    """Both ends within what 9999 resamples let them scatter: some 2 % of the interval."""
    values = np.random.default_rng(3).lognormal(0.0, 0.6, 40)
    theirs = scipy.stats.bootstrap(
        (values,), np.mean, n_resamples=20000, method="BCa", random_state=1
    ).confidence_interval
    ours = mean(values)
    width = theirs.high - theirs.low
    assert ours.value == pytest.approx(values.mean())
    assert ours.low == pytest.approx(theirs.low, abs=0.06 * width)
    assert ours.high == pytest.approx(theirs.high, abs=0.06 * width)


@pytest.mark.parametrize("p", [0.5, 0.05, 0.95])
@pytest.mark.parametrize("n", [10, 37, 200])
def test_quantiles_have_the_exact_interval_of_the_order_statistics(n, p):
    """By the definition: the ends are ranks r, s with P(B < r) and P(B >= s) at most 2.5 %."""
    values = np.arange(1.0, n + 1.0)
    found = quantile(values, p)
    binomial = scipy.stats.binom(n, p)
    lows = [r for r in range(1, n + 1) if binomial.cdf(r - 1) <= 0.025]
    highs = [s for s in range(1, n + 1) if binomial.sf(s - 1) <= 0.025]
    assert found.value == np.quantile(values, p)
    assert found.low == (max(lows) if lows else None)
    assert found.high == (min(highs) if highs else None)


@pytest.mark.parametrize(
    ("name", "truth"),
    [("mean", np.exp(0.125)), ("median", 1.0), ("p90", np.exp(0.5 * 1.2815515655446004))],
)
def test_intervals_hold_the_truth_in_95_percent_of_campaigns(name, truth):
    """500 campaigns of 50 errors that are lognormal: 90 to 99 %.

    The share of 500 scatters by sqrt(0.95 * 0.05 / 500) = 1 %.
    """
    rng = np.random.default_rng(11)
    inside = 0
    for _ in range(500):
        found = statistic(rng.lognormal(0.0, 0.5, 50), name)
        low = -np.inf if found.low is None else found.low
        high = np.inf if found.high is None else found.high
        inside += low <= truth <= high
    assert 0.90 <= inside / 500 <= 0.99


def paired_campaign(rng, factor):
    """Return errors of two estimators on 50 seeds: a shared part, and 15 % of their own."""
    common = rng.lognormal(0.0, 0.5, 50)
    own = rng.lognormal(0.0, 0.15, (2, 50))
    return common * own[0] * factor, common * own[1]


def test_a_planted_difference_is_found_and_none_is_not_invented():
    """A difference of 10 % against a spread of 21 % of the ratio, 50 pairs: t = 3.2.

    Wilcoxon's test has 84 % power there (1000 campaigns), so that 84 +- 3.7 of 100 are found.

    Without one, at most 5 % of 200 are significant by chance: 10 +- 3.1; 19 is three of these.
    """
    rng = np.random.default_rng(5)
    found = sum(compare(*paired_campaign(rng, 1.1)).p < 0.05 for _ in range(100))
    invented = sum(compare(*paired_campaign(rng, 1.0)).p < 0.05 for _ in range(200))
    assert found >= 73
    assert invented <= 19


def rows_of(name, values):
    return [
        {"cell": f"imu={name}", "imu": name, "estimator": "a", "seed": seed, "status": "done"}
        | {"ate_rmse_m": value}
        for seed, value in enumerate(values)
    ]


def significant(*errors):
    """Return how many differences a campaign over as many sensors reports."""
    rows = [row for k, values in enumerate(errors) for row in rows_of(f"s{k}", values)]
    return sum(pair.significant for pair in compared(groups(rows, ["imu"]), "ate_rmse_m"))


def test_a_campaign_of_equal_sensors_reports_a_difference_at_most_in_5_percent():
    """Four sensors, six comparisons, the chance of any: Holm keeps it below 5 %.

    200 campaigns: 10 +- 3.1 if it were 5 %; uncorrected, a fifth of them would report some.
    """
    rng = np.random.default_rng(17)
    false, uncorrected = 0, 0
    for _ in range(200):
        common = rng.lognormal(0.0, 0.5, 50)
        errors = [common * rng.lognormal(0.0, 0.15, 50) for _ in range(4)]
        false += significant(*errors) > 0
        pairs = itertools.combinations(errors, 2)
        uncorrected += any(compare(a, b).p < 0.05 for a, b in pairs)
    assert false <= 10
    assert uncorrected >= 25


def test_a_campaign_finds_the_sensor_that_is_10_percent_worse():
    """50 paired seeds with 5 % of scatter of their own: all three comparisons with it, no other."""
    rng = np.random.default_rng(23)
    common = rng.lognormal(0.0, 0.5, 50)
    errors = [common * rng.lognormal(0.0, 0.05, 50) for _ in range(3)]
    assert significant(*errors) == 0
    assert significant(*errors, 1.1 * common * rng.lognormal(0.0, 0.05, 50)) == 3


def test_comparing_is_wilcoxons_test_on_logarithms():
    rng = np.random.default_rng(8)
    a, b = paired_campaign(rng, 1.05)
    found = compare(a, b)
    assert found.p == scipy.stats.wilcoxon(np.log(a / b)).pvalue
    assert found.ratio == pytest.approx(scipy.stats.gmean(a / b))
    assert compare(a, a).p == 1.0
    assert compare(a[:3], b[:3]).p is None


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
    found = sensitivity(x, np.sqrt(x) * common * rng.lognormal(0, 0.2, x.size), seed)
    assert found.slope.low < 0.5 < found.slope.high
    assert found.slope.high - found.slope.low < 0.1
    assert sensitivity(np.ones(4), np.ones(4), np.arange(4)) is None
