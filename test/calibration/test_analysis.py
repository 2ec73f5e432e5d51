# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Noise parameters from messages: the checks, their warnings, and the data that remain."""

import tracemalloc
from collections.abc import Sequence

import numpy as np
import pytest

from imu_sim_ros.calibration.noise.analysis import AllanResult, analyse
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.recordings.clock import estimate_clock


def says(result: AllanResult, text: str) -> bool:
    return any(text in warning for warning in result.warnings)


def noise(result: AllanResult) -> list[float]:
    return [result.estimate(k, "noise_density").value or np.nan for k in range(6)]


def assert_true_noise(result: AllanResult, axes: Sequence[int] = range(6)) -> None:
    """Assert the true white noise to 2.1 %: five standard errors 1/sqrt(2n) of n = 30,000."""
    assert [k for k, axis_noise in enumerate(result.noise) if axis_noise] == list(axes)
    for axis in axes:
        assert noise(result)[axis] == pytest.approx(1e-3 if axis < 3 else 0.01, rel=0.021)


TWO = (0, 5)
"""Axes with noise of ``two_axes``."""


def test_a_clean_record_gives_noise_and_timing_without_unusual_warnings(rest):
    result = analyse([rest.blocks()])
    assert_true_noise(result)
    assert result.timing.rate == pytest.approx(100.0, rel=1e-9)
    assert result.duration == pytest.approx(300.0)
    assert result.timing.gaps == result.timing.lost == 0
    assert result.mean == pytest.approx([0.01, 0, -0.01, 0, 0, 9.81], abs=0.05)
    # A walk that five minutes hardly show may be a warm-up as well, which is told.
    usual = ("needs hours", "a warm-up of")
    assert [w for w in result.warnings if not any(text in w for text in usual)] == []


def test_single_losses_are_filled_and_told(two_axes):
    keep = np.random.default_rng(2).random(len(two_axes.t_ns)) > 0.005
    keep[0] = True
    result = analyse([two_axes.blocks(keep=keep)])
    assert_true_noise(result, TWO)
    lost = int(np.count_nonzero(~keep[: np.flatnonzero(keep)[-1]]))
    assert result.timing.lost == lost
    assert says(result, f"{lost} samples lost")
    assert result.timing.gaps == 0


@pytest.fixture(scope="module")
def quarter_hour():
    """Return a record that nobody changes, and its analysis."""
    from .conftest import Rest

    rest = Rest(seconds=900.0, rate=50.0)
    return rest, analyse([rest.blocks()])


@pytest.mark.parametrize("burst", [1, 40])
def test_a_tenth_lost_costs_no_bias(quarter_hour, burst):
    """Six intervals each of N and K: fewer than four hold once in 500 times.

    Filled with the neighbours, mirrored, N was 6 % too high and no interval held it.
    """
    rest, whole = quarter_hour
    n = len(rest.t_ns)
    starts = np.flatnonzero(np.random.default_rng(4).random(n - burst) < 0.1 / burst)
    keep = np.ones(n, dtype=bool)
    keep[np.unique(starts[:, None] + np.arange(burst))] = False
    keep[[0, -1]] = True
    lossy = analyse([rest.blocks(keep=keep)])
    edges = np.flatnonzero(np.diff(keep))
    losses = np.diff(edges)[keep[edges[:-1]]]  # a second and more is a gap
    assert lossy.timing.lost == losses[losses <= 50].sum()
    assert lossy.timing.gaps == np.count_nonzero(losses > 50)
    assert lossy.timing.rate == pytest.approx(whole.timing.rate, rel=1e-9)
    truths = {"noise_density": [1e-3] * 3 + [0.01] * 3, "random_walk": [0.0] * 3 + [5e-4] * 3}
    for key, truth in truths.items():
        assert sum(lossy.estimate(k, key).covers(t) for k, t in enumerate(truth)) >= 4
    # A tenth of the 45,000 samples is new: N differs by sqrt(0.1 * 2 / 45,000) / 2, five times.
    assert noise(lossy) == pytest.approx(noise(whole), rel=5 * 0.00105)
    # The Allan deviation of the filled record at one sample is that of white noise as well.
    assert lossy.deviation.deviation[0] == pytest.approx(whole.deviation.deviation[0], rel=0.006)


def test_neither_results_nor_draws_for_lost_samples_depend_on_the_blocks(two_axes):
    keep = np.random.default_rng(6).random(len(two_axes.t_ns)) > 0.05
    keep[0] = True
    small_blocks, large_blocks = (analyse([two_axes.blocks(size, keep)]) for size in (1000, 30000))
    for axis in TWO:
        assert noise(small_blocks)[axis] == pytest.approx(noise(large_blocks)[axis], rel=1e-9)
    assert small_blocks.deviation.deviation == pytest.approx(
        large_blocks.deviation.deviation, rel=1e-9
    )


def test_rate_is_the_count_over_the_time():
    """1 ms of jitter at 137 Hz and 5 % lost: the mean of the short intervals was 0.27 % high.

    The ends of the record jitter: sqrt(2) ms in 600 s, 2.4e-6, five times. One loss that two late
    stamps hide costs 1.2e-5.
    """
    from .conftest import Rest

    rest = Rest(seconds=600.0, rate=137.0).hold_axes(1, 2, 3, 4)
    rng = np.random.default_rng(10)
    rest.t_ns = rest.t_ns + rng.normal(0.0, 1e6, len(rest.t_ns)).astype(np.int64)
    for share in (0.0, 0.05):
        keep = rng.random(len(rest.t_ns)) >= share
        keep[[0, -1]] = True
        result = analyse([rest.blocks(keep=keep)])
        assert result.timing.rate == pytest.approx(137.0, rel=4e-5)
        assert abs(result.timing.lost - np.count_nonzero(~keep)) <= 2
        # N of 82,200 samples: relative standard error 1/sqrt(2n), five times.
        assert [noise(result)[k] for k in TWO] == pytest.approx([1e-3, 0.01], rel=0.0125)


def test_slow_lines_are_taken_out_and_told():
    """1e-3 rad/s with a period of 900 s made K three times too large, without a word."""
    from .conftest import Rest

    rest = Rest(seconds=7200.0, rate=25.0)
    t = (rest.t_ns - rest.t_ns[0]) * 1e-9
    clean = analyse([rest.blocks()])
    assert not says(clean, "sinusoid")
    rest.gyro[:, 0] += 1e-3 * np.sin(2.0 * np.pi * t / 900.0 + 0.7)
    rest.gyro[:, 1] += 2e-4 * np.sin(2.0 * np.pi * t / 45.0)
    rest.accel[:, 2] += 0.05 * np.cos(2.0 * np.pi * t / 700.0)
    result = analyse([rest.blocks()])
    for text in (r"gyroscope x: a sinusoid of 0.00", "gyroscope y: a", "accelerometer z: a"):
        assert says(result, text)
    assert sum("sinusoid" in warning for warning in result.warnings) == 3
    assert result.estimate(0, "random_walk").high < 5e-6
    assert result.estimate(1, "random_walk").high < 5e-6
    assert result.estimate(5, "random_walk").covers(5e-4)


def test_walks_and_flicker_have_no_lines():
    """A false line in one of 10^4 records: none among 60 axes."""
    from imu_sim_ros.calibration.noise.slow_signals import find_signals
    from imu_sim_ros.sensors.errors.processes import FlickerNoise

    rng = np.random.default_rng(11)
    for scale in (0.0, 0.01, 1.0):
        y = np.cumsum(rng.standard_normal((10, 4000)), axis=1) * scale
        flicker = [FlickerNoise(k, "test", 0.01).next_block(4000) for k in range(4)]
        slow = np.concatenate(flicker, axis=1)[:, :10].T
        for noisy in (y + rng.standard_normal(y.shape), y + slow):
            assert [axis.certain for axis in find_signals(noisy, 0.1)] == [[]] * 10


def test_the_search_for_signals_has_one_axis_in_memory():
    """13 arrays as long as an axis, of which 8 do not grow with it; three axes with copies were 39.

    What the transforms need inside is not traced.
    """
    from imu_sim_ros.calibration.noise.slow_signals import find_signals

    n, rng = 160_000, np.random.default_rng(5)
    columns = (rng.standard_normal(n) + 10.0 * (np.arange(n) > n // 3) for _ in range(3))
    list(find_signals(np.zeros((1, 400)), 0.02))  # imports
    tracemalloc.start()
    shifts = sum(len(axis.certain) for axis in find_signals(columns, 0.02))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert shifts == 3
    assert peak < 14 * 8 * n


@pytest.mark.parametrize(("walk", "size"), [(0.0, 1.0), (1.5e-5, 3.0), (0.0, 100.0)])
def test_a_slow_sine_is_no_random_walk(walk, size):
    """4.8 periods in an hour, of B to 100 B: of 12 intervals of 95 %, 10 or more hold in 98 %.

    Taken out by itself, ahead of the noise, a line of B was a walk in a fifth of the records, and
    one of 3 B spoilt the interval of a true walk in half of them.
    """
    from imu_sim_ros.sensors.errors.processes import FlickerNoise

    from .conftest import Rest

    b, covered, highs = 3e-4, 0, []
    for seed in range(2):
        rest = Rest(seconds=3600.0, rate=9.0)
        n = len(rest.t_ns)
        pair = [FlickerNoise(seed, f"test{k}", 1.0 / 9.0).next_block(n) for k in range(2)]
        rng = np.random.default_rng(seed)
        steps = walk / 3.0 * rng.standard_normal((n, 6))
        phase = 2.0 * np.pi * (4.8 * np.arange(n)[:, None] / n + rng.random(6))
        y = 3e-3 * rng.standard_normal((n, 6)) + b * np.concatenate(pair, axis=1)
        y += np.cumsum(steps, axis=0) + size * b * np.sin(phase)
        rest.gyro, rest.accel = y[:, :3], y[:, 3:] + [0.0, 0.0, 9.81]
        result = analyse([rest.blocks()], force=True)
        walks = [result.estimate(k, "random_walk") for k in range(6)]
        covered += sum(estimate.covers(walk) for estimate in walks)
        highs += [estimate.high for estimate in walks]
        assert size < 10.0 or sum("was taken out" in warning for warning in result.warnings) == 6
    assert covered >= 10
    assert np.median(highs) < 5e-5


def test_a_gap_is_not_bridged(rest):
    """Between the pieces the accelerometer jumps; a bridge would make a walk of it."""
    keep = np.ones(len(rest.t_ns), dtype=bool)
    keep[14000:16000] = False
    rest.accel[16000:] += 3.0
    result = analyse([rest.blocks(keep=keep)])
    assert_true_noise(result)
    assert result.timing.gaps == 1
    assert result.timing.longest_gap == pytest.approx(20.01, abs=0.02)
    assert says(result, "1 gaps")
    assert result.estimate(3, "random_walk").high < 5e-3


def test_several_bags_are_combined(two_axes):
    half = len(two_axes.t_ns) // 2
    first_half = np.arange(len(two_axes.t_ns)) < half
    result = analyse(
        [two_axes.blocks(keep=~first_half), two_axes.blocks(keep=first_half)]
    )  # in any order
    assert_true_noise(result, TWO)
    assert result.duration == pytest.approx(300.0)


def test_jitter_is_measured_and_makes_no_gaps(two_axes):
    jitter = np.random.default_rng(3).normal(0.0, 1.2e6, len(two_axes.t_ns))
    two_axes.t_ns = two_axes.t_ns + jitter.astype(np.int64)
    result = analyse([two_axes.blocks()])
    assert_true_noise(result, TWO)
    # Of 30,000 stamps: relative standard error 1/sqrt(2n) or a little more, five times.
    assert result.timing.jitter == pytest.approx(1.2e-3, rel=0.025)
    assert result.timing.gaps == result.timing.lost == 0
    assert says(result, "jitter")


def test_messages_that_came_twice_are_dropped(two_axes):
    for values in (two_axes.t_ns, two_axes.gyro, two_axes.accel):
        values[100] = values[99]
    result = analyse([two_axes.blocks()])
    assert (result.timing.duplicates, result.timing.lost) == (1, 1)
    assert_true_noise(result, TWO)


def test_another_reading_with_the_same_stamp_is_kept(two_axes):
    two_axes.t_ns[100] = two_axes.t_ns[99]
    result = analyse([two_axes.blocks()])
    assert (result.timing.duplicates, result.timing.lost) == (0, 0)
    assert_true_noise(result, TWO)


def test_stray_stamps_and_resets_are_told(two_axes):
    two_axes.t_ns[500] = 0
    result = analyse([two_axes.blocks()])
    assert says(result, "1 stamps are far from their neighbours")
    assert_true_noise(result, TWO)
    two_axes.t_ns[15000:] -= 10**12
    result = analyse([two_axes.blocks()])
    assert says(result, "1 times the clock went back")
    assert_true_noise(result, TWO)


@pytest.mark.parametrize("unit", [10**3, 10**6])
def test_stamps_that_are_not_nanoseconds_are_refused(rest, unit):
    rest.t_ns //= unit
    with pytest.raises(InputError, match="not nanoseconds.*100 Hz in"):
        analyse([rest.blocks()])


@pytest.mark.parametrize("rate", [400.1, 1500.0])
def test_whole_milliseconds_have_the_noise_of_their_readings(rate):
    from .conftest import Rest

    rest = Rest(seconds=90.0, rate=rate).hold_axes(1, 2, 3, 4)
    rest.t_ns = rest.t_ns // 1_000_000 * 1_000_000
    result = analyse([rest.blocks()])
    assert result.timing.rate == pytest.approx(rate, rel=1e-3)
    assert result.timing.lost == result.timing.duplicates == 0
    # Of 36,000 readings or more the deviation is known to 0.4 %.
    assert result.estimate(0, "noise_density").value == pytest.approx(1e-3, rel=0.015)


def test_readings_in_batches_are_spread(two_axes):
    two_axes.t_ns = np.repeat(two_axes.t_ns[::8], 8)[: len(two_axes.t_ns)]
    result = analyse([two_axes.blocks()])
    assert_true_noise(result, TWO)
    assert says(result, "readings share a stamp, 8 of them")


def test_a_bump_is_cut_out_and_named(rest):
    rest.gyro[15000:15050] += 1.0
    result = analyse([rest.blocks()])
    assert_true_noise(result)
    assert says(result, "disturbance cut out at 150 s: gyroscope x")
    assert 290.0 < result.duration < 299.0


def test_a_shift_of_level_splits_the_record(two_axes):
    two_axes.accel[15037:, 2] += 2.0
    result = analyse([two_axes.blocks()])
    assert_true_noise(result, TWO)
    assert says(result, "accelerometer z")
    assert result.estimate(5, "random_walk").high < 5e-3


def test_saturation_is_told(rest):
    rest.gyro = np.clip(rest.gyro, -0.5, 0.034)
    assert says(analyse([rest.blocks()]), "gyroscope z") is False
    result = analyse([rest.blocks()], force=True)
    assert says(result, "are 0.034: saturated")


@pytest.mark.parametrize(("order", "cutoff"), [(1, 60.0), (2, 42.0), (2, 25.0), (4, 80.0)])
def test_a_low_pass_filter_does_not_spoil_the_density(order, cutoff):
    """A sensor's own filter, a sixth of Nyquist to nearly all of it: the density is that below it.

    Six intervals of 95 %: fewer than four hold once in 500 times.
    """
    from scipy.signal import butter, lfilter

    from .conftest import Rest

    rest = Rest(seconds=600.0, rate=200.0)
    b, a = butter(order, cutoff, fs=200.0)
    rest.gyro, rest.accel = (lfilter(b, a, y, axis=0)[2000:] for y in (rest.gyro, rest.accel))
    rest.t_ns = rest.t_ns[2000:]
    result = analyse([rest.blocks()])
    assert says(result, "low-pass")
    truth = [1e-3] * 3 + [0.01] * 3
    covered = [result.estimate(k, "noise_density").covers(n) for k, n in enumerate(truth)]
    assert sum(covered) >= 4
    for value, n in zip(noise(result), truth, strict=True):
        assert value == pytest.approx(n, rel=0.02)


def test_a_vibration_line_is_left_out(rest):
    t = (rest.t_ns - rest.t_ns[0]) * 1e-9
    rest.accel[:, 1] += 0.1 * np.sin(2.0 * np.pi * 23.4 * t)
    result = analyse([rest.blocks()])
    assert says(result, "accelerometer y: vibration at 23.")
    assert_true_noise(result)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r.accel.__setitem__((slice(None), 0), -0.0), r"accelerometer x: always 0"),
        (lambda r: r.gyro.__iadd__(0.2 * np.sin(r.t_ns * 1e-9)[:, None]), r"not at rest: the gyro"),
        (
            lambda r: r.accel.__iadd__(np.sin(0.5e-9 * r.t_ns)[:, None] * [1, 0, 0]),
            r"not at rest: the accelerometer x",
        ),
        (lambda r: r.gyro[::1000].__iadd__(2.0), r"disturbances"),
    ],
)
def test_what_makes_an_analysis_meaningless(rest, change, message):
    change(rest)
    with pytest.raises(InputError, match=message):
        analyse([rest.blocks()])


def test_a_constant_rate_is_a_warning(rest):
    """A consumer gyroscope's turn-on bias may be as large as that of a turning table."""
    rest.gyro += [0.0, 0.0, 1.0]
    result = analyse([rest.blocks()])
    assert says(result, "gyroscope z: its mean is 0.99 rad/s")
    assert_true_noise(result)


def test_a_strong_random_walk_is_no_motion():
    """K = 3e-3 m/s^3/sqrt(Hz), EuRoC's ADIS16448: 0.05 m/s^2 within four minutes."""
    from .conftest import Rest

    rest = Rest(seconds=1200.0)
    steps = np.random.default_rng(8).standard_normal(rest.accel.shape)
    rest.accel += 3e-3 / np.sqrt(rest.rate) * np.cumsum(steps, axis=0)
    result = analyse([rest.blocks()])
    for axis in (3, 4, 5):
        assert result.estimate(axis, "random_walk").covers(np.hypot(3e-3, 5e-4))


def test_motion_in_one_stretch_of_a_walk_is_motion():
    """Four minutes in a hand among forty on a table."""
    from .conftest import Rest

    rest = Rest(seconds=2400.0, rate=25.0)
    rng = np.random.default_rng(9)
    rest.accel += (
        3e-3 / np.sqrt(rest.rate) * np.cumsum(rng.standard_normal(rest.accel.shape), axis=0)
    )
    stretch = slice(15_000, 22_500)
    sway = np.cumsum(rng.standard_normal((7_500, 3)), axis=0) / np.sqrt(7_500)
    rest.accel[stretch] += 5.0 * sway
    with pytest.raises(InputError, match="not at rest: the accelerometer"):
        analyse([rest.blocks()])


def coarse(rest, sigma, means, step=0.1):
    """Replace the readings by white noise of sigma around means (3,), rounded to steps."""
    rng = np.random.default_rng(5)
    for readings in (rest.gyro, rest.accel):
        noise = sigma * rng.standard_normal(readings.shape)
        readings[:] = step * np.round((means + noise) / step)


def test_what_a_coarse_resolution_hides_is_bounded(rest):
    """Noise of a tenth of a step: N is anywhere below what the rounding hides, never a value."""
    coarse(rest, 0.01, [0.05, 0.03, 0.048])
    rest.gyro[:10], rest.accel[:10] = 0.1, 0.1  # no axis is constant
    result = analyse([rest.blocks()])
    for axis in range(6):
        for key in ("noise_density", "bias_instability", "random_walk", "rate_ramp"):
            estimate = result.estimate(axis, key)
            assert estimate.value is None
            assert estimate.low == 0.0
        assert result.estimate(axis, "noise_density").covers(0.01 / np.sqrt(100.0))
    assert says(result, "the resolution of 0.1 hides the noise")
    assert not says(result, "saturated")


@pytest.mark.parametrize("steps", [0.5, 0.6, 1.0])
def test_fine_enough_a_resolution_adds_its_variance(rest, steps):
    """sigma^2 + s^2 / 12 wherever the mean lies, within the interval; which knows of the doubt."""
    coarse(rest, steps * 0.1, [0.0, 0.025, 0.05])
    result = analyse([rest.blocks()])
    truth = np.sqrt(((steps * 0.1) ** 2 + 0.1**2 / 12.0) / 100.0)
    # Six intervals of 95 %, two of each mean: fewer than five hold once in 30 times.
    assert sum(result.estimate(k, "noise_density").covers(truth) for k in range(6)) >= 5
    assert not says(result, "saturated")


def test_ten_seconds_are_too_short(rest):
    keep = np.arange(len(rest.t_ns)) < 1000
    with pytest.raises(InputError, match=r"10\.0 s at rest .* at least 60 s"):
        analyse([rest.blocks(keep=keep)], force=True)


def test_no_messages_at_all():
    with pytest.raises(InputError, match="no Imu messages"):
        analyse([iter(())])


def test_all_problems_are_told_together(rest):
    rest.gyro[:, 0] = 0.0
    keep = np.arange(len(rest.t_ns)) < 1000
    with pytest.raises(InputError) as error:
        analyse([rest.blocks(keep=keep)])
    dead, short = error.value.problems
    assert "gyroscope x: always 0" in dead
    assert "10.0 s at rest" in short


def test_force_leaves_a_dead_axis_out(rest):
    rest.gyro[:, 0] = 0.0
    result = analyse([rest.blocks()], force=True)
    assert result.noise[0] is None
    assert result.estimate(0, "noise_density").value is None
    assert result.estimate(0, "noise_density").high == np.inf
    assert result.reasons == {
        "gyroscope x": "always 0: a dead axis, or noise far below the resolution"
    }
    assert noise(result)[1:] == pytest.approx([1e-3] * 2 + [0.01] * 3, rel=0.021)


def test_a_constant_reading_forbids_only_where_no_axis_changes(rest):
    rest.accel[:, 2] = 9.81
    result = analyse([rest.blocks()])
    assert says(result, "accelerometer z: always 9.81")
    assert list(result.reasons) == ["accelerometer z"]
    assert result.noise[5] is None
    rest.gyro[:], rest.accel[:] = 0.01, 9.81
    with pytest.raises(InputError) as error:
        analyse([rest.blocks()])
    assert sum("no noise at all" in problem for problem in error.value.problems) == 6


def test_rate_of_stamps_in_bursts_is_their_mean():
    t_ns = np.repeat(np.arange(0, 100) * 20_000_000, 4) + np.tile([0, 100, 200, 300], 100) * 1000
    assert estimate_clock(t_ns).interval_ns == pytest.approx(5_000_000, rel=0.02)
    with pytest.raises(InputError, match="no rate"):
        estimate_clock(np.array([5, 5], dtype=np.int64))


@pytest.mark.parametrize("seed", [16, 33, 41, 97, 125])
def test_lines_that_only_together_take_the_place_of_a_walk_are_not_taken_out(seed):
    """An hour at 1 Hz of white noise of 1 and a walk of 0.03 a step, in five of 150 seeds."""
    from imu_sim_ros.calibration.noise.slow_signals import find_signals

    rng = np.random.default_rng(seed)
    white = rng.standard_normal((1, 3600))
    walk = np.cumsum(0.03 * rng.standard_normal((1, 3600)), axis=1)
    (signals,) = find_signals(white + walk, 0.05)
    assert signals.certain == []
    assert signals.doubtful


def test_fewer_than_0_6_periods_are_a_ramp():
    """A parabola is no sinusoid of 0.3 periods of the record."""
    from imu_sim_ros.calibration.noise.slow_signals import Line, find_signals

    n, rng = 3600, np.random.default_rng(0)
    x = np.linspace(-1.0, 1.0, n)
    axes = find_signals(rng.standard_normal((3, n)) + 0.4 * x**2 + 0.3 * x, 0.05)
    signals = [signal for axis in axes for signal in axis.certain + axis.doubtful]
    lines = [signal for signal in signals if isinstance(signal, Line)]
    assert lines
    assert min(line.frequency * n for line in lines) >= 0.6 - 1e-9


@pytest.mark.parametrize("n", [400, 720, 1000])
def test_a_ramp_without_noise_is_no_division_by_what_is_left_of_it(n):
    """An ideal sensor that warms up; weights of 1e300 overflowed, and NumPy told the user so."""
    from imu_sim_ros.calibration.noise.slow_signals import Line, find_signals

    with np.errstate(all="raise", under="ignore"):
        (signals,) = find_signals(np.arange(float(n))[None], 0.05)
    sizes = [s.amplitude if isinstance(s, Line) else s.size for s in signals.certain]
    assert all(abs(size) < 1e-12 for size in sizes)  # what rounding leaves
