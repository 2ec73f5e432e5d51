# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statistics of every random process against theory, at several rates.

Thresholds are five standard deviations of the estimate unless said otherwise (one false alarm in
10^6; the seeds are fixed anyway), and all are far below what a factor sqrt(2) would do: it changes
a variance by 100 % or 50 %.
"""

import copy
import zlib

import numpy as np
import pytest
from scipy.integrate import trapezoid

from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.random_streams import axis_generators, generator
from imu_sim_ros.parameters.sections import build
from imu_sim_ros.sensors.errors.processes import (
    FLICKER_CHUNK,
    MARKOV_CHUNK,
    FlickerFilter,
    FlickerNoise,
    GaussMarkovBank,
)
from imu_sim_ros.sensors.errors.terms import (
    BiasInstability,
    ErrorTerm,
    GaussMarkov,
    RandomWalk,
    RateRamp,
    Surroundings,
    WhiteNoise,
    turn_on,
)
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.sensors.imu.triads import TriadParameters

RATES = [50.0, 200.0, 1000.0]
N = 1_000_000
SEED = 7


def gyroscope(**values: object) -> TriadParameters:
    parameters = {f"gyroscope_{name}": value for name, value in values.items()}
    return build(ImuParameters, parameters).gyroscope


def draw(
    kind: type[ErrorTerm],
    parameters: TriadParameters,
    rate: float,
    triad: str = "gyroscope",
    count: int = N,
) -> np.ndarray:
    """Return (3, count) samples of an error, made in blocks."""
    term = kind(triad, ImuParameters(), SEED, rate, parameters)
    lengths = [min(50_000, count - start) for start in range(0, count, 50_000)]
    return np.concatenate([term.next(Surroundings(np.zeros(n))) for n in lengths]).T


def allan_variance(values: np.ndarray, samples: int) -> float:
    """Return the mean over axes of the non-overlapping Allan variance over ``samples`` samples."""
    clusters = values.shape[1] // samples
    means = values[:, : clusters * samples].reshape(3, clusters, samples).mean(axis=2)
    return float(0.5 * np.mean(np.diff(means, axis=1) ** 2))


@pytest.mark.parametrize("triad", TRIADS)
@pytest.mark.parametrize("rate", RATES)
def test_white_noise_has_the_density_of_the_parameters_at_any_rate(rate: float, triad: str) -> None:
    """Variance sigma^2 / dt (lecture eq. 16); relative deviation of its estimate sqrt(2 / n)."""
    density = np.array([0.01, 0.02, 0.03])
    parameters = gyroscope(noise_density=density.tolist())
    noise = draw(WhiteNoise, parameters, rate, triad)
    assert np.abs(noise.var(axis=1) / (density**2 * rate) - 1.0).max() < 5.0 * np.sqrt(2.0 / N)
    assert np.abs(noise.mean(axis=1) / (density * np.sqrt(rate / N))).max() < 5.0
    unit = noise / noise.std(axis=1, keepdims=True)
    for lag in (1, 2, 32, 1024):
        correlation = np.mean(unit[:, lag:] * unit[:, :-lag], axis=1)
        assert np.abs(correlation).max() < 5.0 / np.sqrt(N)
    # Allan variance N^2 / tau; over m pairs of clusters, which overlap by one, its relative
    # deviation is sqrt(3 / m).
    seconds = 0.5
    samples = round(seconds * rate)
    pairs = 3 * (N // samples)
    expected = np.mean(density**2) / seconds
    assert allan_variance(noise, samples) == pytest.approx(expected, rel=6.0 * np.sqrt(3 / pairs))


@pytest.mark.parametrize("triad", TRIADS)
@pytest.mark.parametrize("rate", RATES)
def test_increments_of_the_walk_are_white_with_the_parameters_variance(
    rate: float, triad: str
) -> None:
    """Increments are white with variance sigma_b^2 dt (lecture eq. 20 and 21)."""
    density = np.array([0.01, 0.02, 0.03])
    parameters = gyroscope(random_walk=density.tolist())
    walk = draw(RandomWalk, parameters, rate, triad)
    assert not walk[:, 0].any()
    steps = np.diff(walk, axis=1)
    assert np.abs(steps.var(axis=1) * rate / density**2 - 1.0).max() < 5.0 * np.sqrt(2.0 / N)
    # Over m steps the variance is m times as large: none is lost at a block's edge. N / m
    # independent increments.
    m = 1000
    increments = np.diff(walk[:, ::m], axis=1)
    ratio = np.mean(increments**2, axis=1) * rate / (m * density**2)
    assert np.abs(ratio - 1.0).max() < 5.0 * np.sqrt(2.0 * m / N)
    # Allan variance K^2 tau / 3.
    seconds = 2.0
    samples = round(seconds * rate)
    pairs = 3 * (N // samples)
    expected = np.mean(density**2) * seconds / 3.0
    assert allan_variance(walk, samples) == pytest.approx(expected, rel=6.0 * np.sqrt(3 / pairs))


@pytest.mark.parametrize("form", ["sigma", "density"])
@pytest.mark.parametrize("rate", RATES)
def test_gauss_markov_noise_has_its_variance_and_correlation_time(rate: float, form: str) -> None:
    """Variance sigma^2 and autocorrelation exp(-lag / tau) in seconds, whatever the rate.

    With T seconds the relative variance of the estimated variance is 2 tau / T (the integral of
    twice the squared autocorrelation), for three axes a third of it.
    """
    tau, sigma = 0.2, 0.05
    strength = sigma if form == "sigma" else sigma * np.sqrt(2.0 / tau)
    parameters = gyroscope(**{f"gauss_markov_{form}": strength, "correlation_time": tau})
    dt = 1.0 / rate
    values = draw(GaussMarkov, parameters, rate)
    deviation = np.sqrt(2.0 * tau / (3.0 * N * dt))
    assert np.mean(values**2) / sigma**2 == pytest.approx(1.0, abs=5.0 * deviation)
    for lag in (0.1, 0.2, 0.4):
        k = round(lag * rate)
        covariance = np.mean(values[:, k:] * values[:, :-k])
        assert covariance / sigma**2 == pytest.approx(np.exp(-lag / tau), abs=5.0 * deviation)
    # What is left after the recurrence is white, of the exact step's variance, also where rows
    # (32 samples) and chunks of the scan meet.
    phi = np.exp(-dt / tau)
    steps = (values[:, 1:] - phi * values[:, :-1]) / (sigma * np.sqrt(1.0 - phi**2))
    assert steps.var() == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / (3 * N)))
    assert np.abs(np.mean(steps[:, 1:] * steps[:, :-1])) < 5.0 / np.sqrt(3 * N)
    for interval in (32, MARKOV_CHUNK):
        edges = steps[:, interval - 1 :: interval]
        assert edges.var() == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / edges.size))


def test_gauss_markov_of_rotors_is_the_driving_density() -> None:
    """RotorS: sigma_bd^2 = sigma_b^2 tau / 2 (1 - exp(-2 dt / tau)) for every step."""
    tau, density, dt = 3.0, 0.02, 0.01
    parameters = gyroscope(gauss_markov_density=density, correlation_time=tau)
    values = draw(GaussMarkov, parameters, 1.0 / dt, "accelerometer")
    steps = values[:, 1:] - np.exp(-dt / tau) * values[:, :-1]
    expected = density**2 * tau / 2.0 * (1.0 - np.exp(-2.0 * dt / tau))
    assert steps.var() / expected == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / (3 * N)))


@pytest.mark.parametrize("seconds", [1e-3, 1.0, 1e4])
def test_gauss_markov_starts_in_its_stationary_distribution(seconds: float) -> None:
    """First sample, and sample 100, of 900 runs have variance 1."""
    starts = []
    for seed in range(300):
        starts.append(GaussMarkovBank(seed, "test", seconds, 0.01).next_block(101).T)
    values = np.array(starts)[:, :, [0, 100]]
    assert np.abs(values.var(axis=(0, 1)) - 1.0).max() < 5.0 * np.sqrt(2.0 / 900)


def test_gauss_markov_agrees_with_the_plain_recurrence() -> None:
    """The scan's values, fed back as steps into one loop of plain floats, come out again."""
    tau, dt = 0.05, 0.01
    bank = GaussMarkovBank(1, "test", tau, dt)
    values = bank.next_block(3000).T
    phi = np.exp(-dt / tau)
    steps = (values[:, 1:] - phi * values[:, :-1]).tolist()
    for axis in range(3):
        x = float(values[axis, 0])
        for k, step in enumerate(steps[axis]):
            x = phi * x + step
            assert x == pytest.approx(values[axis, k + 1], abs=1e-12)


@pytest.mark.parametrize("rate", [10.0, 50.0, 100.0, 200.0, 1000.0, 8000.0])
def test_flicker_density_is_what_the_documentation_says(rate: float) -> None:
    """Deviation from B^2 / (2 pi f): 3.2 % from 1e-4 Hz to Nyquist, 6 % from 3.5e-5 Hz."""
    design = FlickerFilter.design(1.0 / rate)
    for lowest, limit in ((1e-4, 0.032), (3.5e-5, 0.06)):
        angle = 2.0 * np.pi * np.geomspace(lowest, rate / 2.0, 2000) / rate
        assert np.abs(design.density(angle) * angle - 1.0).max() < limit
    angle = 2.0 * np.pi * np.geomspace(1e-3, rate / 100.0, 500) / rate
    assert design.density(angle) * angle == pytest.approx(1.0, abs=0.004)


def test_flicker_allan_deviation_is_what_the_documentation_says() -> None:
    """Allan variance as the integral of the density: 2 int 2 S sin^4(pi f tau) / (pi f tau)^2."""
    dt = 0.01
    design = FlickerFilter.design(dt)
    # Discrete: means of m samples; the response is sin(pi f m dt) / (m sin(pi f dt)).
    f = np.geomspace(1e-7, 0.5 / dt, 2_000_000)
    density = design.density(2.0 * np.pi * f[::1000] * dt)
    density = dt * np.exp(np.interp(np.log(f), np.log(f[::1000]), np.log(density)))
    for m in (100, 3000, 100_000):
        response = np.sin(np.pi * f * m * dt) / (m * np.sin(np.pi * f * dt))
        whole = 4.0 * density * response**2 * np.sin(np.pi * f * m * dt) ** 2
        variance = trapezoid(whole * f, np.log(f))
        assert np.sqrt(variance / (2.0 * np.log(2.0) / np.pi)) == pytest.approx(1.0, abs=0.01)


def test_flicker_is_stationary_from_the_start() -> None:
    """First sample and sample 300 of 900 runs have the variance that the filter implies."""
    design = FlickerFilter.design(0.01)
    covariance = 1.0 / (1.0 - np.outer(design.poles, design.poles))
    variance = design.gains @ covariance @ design.gains
    variance += design.direct**2 + 2.0 * design.direct * design.gains.sum()
    runs = [FlickerNoise(s, "test", 0.01).next_block(301).T for s in range(300)]
    values = np.array(runs)[:, :, [0, 300]]
    assert np.abs(values.var(axis=(0, 1)) / variance - 1.0).max() < 5.0 * np.sqrt(2.0 / 900)


def test_flicker_agrees_with_the_plain_recursions() -> None:
    """The scan against one loop over the filter's recursions, past rows and chunks."""
    design = FlickerFilter.design(0.01)
    n = FLICKER_CHUNK + 100
    values = FlickerNoise(1, "test", 0.01).next_block(n)[:, 0]
    stream = axis_generators(1, "test")[0]
    covariance = 1.0 / (1.0 - np.outer(design.poles, design.poles))
    state = np.linalg.cholesky(covariance) @ stream.standard_normal(len(design.poles))
    for value, noise in zip(values, stream.standard_normal(2 * FLICKER_CHUNK), strict=False):
        state = design.poles * state + noise
        assert value == pytest.approx(design.gains @ state + design.direct * noise, abs=1e-9)


@pytest.mark.parametrize("rate", RATES)
def test_bias_instability_has_its_density_and_allan_deviation(rate: float) -> None:
    """Density B^2 / (2 pi f) and Allan deviation B sqrt(2 ln 2 / pi), at any rate.

    Density: periodogram with a Hann window, normalised bin by bin, mean over 0.02 to 0.3 Hz. The
    window correlates neighbours, so about two thirds of the bins count; each has a deviation of 1.
    Allan: pairs of clusters of 2 s; for 1/f noise neighbouring means are correlated less than those
    of white noise, so sqrt(3 / pairs) is an upper bound. Half a per cent of ripple comes on top.
    """
    b = 0.02
    parameters = gyroscope(bias_instability=b)
    values = draw(BiasInstability, parameters, rate)
    window = np.hanning(N)
    power = np.abs(np.fft.rfft(window * values, axis=1)) ** 2 / (rate * np.sum(window**2))
    f = np.fft.rfftfreq(N, 1.0 / rate)
    band = (f > 0.02) & (f < 0.3)
    ratio = np.mean(power[:, band] * (2.0 * np.pi * f[band]) / b**2)
    bins = 3 * np.count_nonzero(band) * 2.0 / 3.0
    assert ratio == pytest.approx(1.0, abs=0.005 + 5.0 / np.sqrt(bins))
    samples = round(2.0 * rate)
    pairs = 3 * (N // samples)
    flat = np.sqrt(allan_variance(values, samples) / (2.0 * np.log(2.0) / np.pi * b**2))
    assert flat == pytest.approx(1.0, abs=0.005 + 5.0 * 0.5 * np.sqrt(3.0 / pairs))


def test_a_ramp_grows_linearly_and_has_its_allan_deviation() -> None:
    ramp = draw(RateRamp, gyroscope(rate_ramp=[1e-6, 0.0, -2e-6]), 100.0, count=100_001)
    assert ramp[:, -1] == pytest.approx([1e-3, 0.0, -2e-3], rel=1e-12)
    # Allan deviation R tau / sqrt(2).
    assert np.sqrt(allan_variance(ramp[[0, 0, 0]], 1000)) == pytest.approx(
        1e-6 * 10.0 / np.sqrt(2.0), rel=1e-9
    )


def test_turn_on_bias_and_scale_over_many_runs() -> None:
    """1000 runs of three axes: deviation of the variance sqrt(2 / 3000) of it."""
    parameters = gyroscope(turn_on_bias_sigma=0.2, turn_on_scale_sigma=0.01)
    sigmas = {"bias": parameters.turn_on_bias_sigma, "scale": parameters.turn_on_scale_sigma}
    biases, scales = (
        np.array([turn_on(seed, f"accelerometer.turn_on_{name}", sigma) for seed in range(1000)])
        for name, sigma in sigmas.items()
    )
    limit = 5.0 * np.sqrt(2.0 / 3000)
    assert biases.var() / 0.2**2 == pytest.approx(1.0, abs=limit)
    assert scales.var() / 0.01**2 == pytest.approx(1.0, abs=limit)
    assert abs(np.corrcoef(biases.ravel(), scales.ravel())[0, 1]) < 5.0 / np.sqrt(3000)


def test_every_source_has_a_stream_of_its_own() -> None:
    names = [
        *(
            f"{triad}.{term}.{axis}"
            for triad in TRIADS
            for term in (
                "white_noise",
                "random_walk",
                "gauss_markov",
                "bias_instability",
                "turn_on_bias",
                "turn_on_scale",
            )
            for axis in "xyz"
        ),
        "clock.jitter",
        *(f"transport.{name}" for name in ("latency", "dropout", "burst", "duplicate")),
        "transport.burst_length",
        *(f"fault.{k}" for k in range(100)),
    ]
    draws = {name: generator(0, name).integers(2**63) for name in names}
    assert len(set(draws.values())) == len(names)


@pytest.mark.parametrize("seed", [0, 7, 2**32 - 1, 2**32 + 5, 2**63 - 1])
def test_streams_are_those_of_numpys_seed_sequence(seed):
    source = "gyroscope.white_noise"
    streams = dict(zip("xyz", axis_generators(seed, source), strict=True))
    for axis, stream in streams.items():
        name = f"{source}.{axis}"
        sequence = np.random.SeedSequence(entropy=seed, spawn_key=(zlib.crc32(name.encode()),))
        expected = np.random.Generator(np.random.SFC64(sequence)).standard_normal(5)
        np.testing.assert_array_equal(generator(seed, name).standard_normal(5), expected)
        np.testing.assert_array_equal(copy.deepcopy(stream).standard_normal(5), expected)
        np.testing.assert_array_equal(stream.standard_normal(5), expected)
