# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coverage of the 95 % intervals of Allan's terms where all five compete.

``python test/bench/bench_coverage.py`` runs a sample, with ``--results FILE`` the whole study.

Records of one axis with quantisation, white noise, 1/f noise, a random walk and a ramp, or all but
one of them, go through what ``allan`` does with a spectrum: the choice of the band, then the fit.
Results are appended to FILE seed by seed, so that a study can be interrupted and continued;
``--table`` prints what there is. One draw of the five terms serves all twelve sums of them: the
cosine transform is linear, so that the terms' own products give the spectrum of every sum.
"""

import argparse
import itertools
import json
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.calibration.noise.estimate import KEYS, Estimate, estimate, usable_band
from imu_sim_ros.calibration.noise.spectrum import Spectrum, SpectrumAccumulator
from imu_sim_ros.sensors.errors.processes import FlickerNoise
from imu_sim_ros.terminal.text_tables import print_table

Array = NDArray[np.float64]

HOUR: Final = 3600.0
COMPETING: Final[dict[str, tuple[float, ...]]] = {
    "gyroscope": (1e-5, 1e-3, 5e-4, 2e-5, 1e-6),
    "accelerometer": (1e-4, 1e-2, 2e-3, 1e-4, 1e-5),
}
"""Q, N, B, K and R of a sensor in which all of them can be seen, or nearly."""
CUTOFF: Final = 42.0
"""[Hz] of the low-pass of an accelerometer at 200 Hz."""
_BLOCK: Final = 1 << 18


class Setting(NamedTuple):
    """One kind of record."""

    hours: float
    rate: float
    generator: str
    """``exact``: 1/f noise by FFT; ``simulator``: by the simulator's filter."""
    low_pass: bool = False

    @property
    def name(self) -> str:
        """Return the setting's key in the results."""
        form = ", low-pass" if self.low_pass else ""
        return f"{self.hours:g} h at {self.rate:g} Hz, {self.generator} 1/f{form}"


SEEDS: Final = 100
SETTINGS: Final = (
    Setting(4, 50, "simulator"),
    Setting(4, 50, "exact"),
    Setting(1, 50, "simulator"),
    Setting(1, 50, "exact"),
    Setting(2, 100, "simulator"),
    Setting(2, 100, "exact"),
    Setting(2, 200, "simulator", low_pass=True),
    Setting(1, 200, "simulator"),
    Setting(4, 200, "simulator"),
    Setting(1, 1000, "simulator"),
    Setting(1, 1000, "exact"),
    Setting(4, 1000, "simulator"),
)


def exact_flicker(n: int, rng: np.random.Generator, rate: float) -> Array:
    """Return n samples of 1/f noise of density 1 / (2 pi f), a quarter of a periodic record."""
    from scipy.fft import irfft, next_fast_len

    m = next_fast_len(4 * n, real=True)
    f = np.fft.rfftfreq(m, 1.0 / rate)
    amplitude = np.zeros(len(f))
    amplitude[1:] = np.sqrt(rate * m / (4.0 * np.pi * f[1:]))
    noise = rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))
    return np.asarray(irfft(amplitude * noise, m)[:n])


def unit_terms(setting: Setting, rng: np.random.Generator) -> Iterator[Array]:
    """Yield blocks (5, n) of readings of Q, N, B, K and R with coefficients of 1."""
    from scipy.signal import butter, sosfilt, sosfilt_zi

    rate, dt = setting.rate, 1.0 / setting.rate
    total = round(setting.hours * HOUR * rate)
    exact = exact_flicker(total, rng, rate) if setting.generator == "exact" else None
    flicker = FlickerNoise(int(rng.integers(2**62)), "flicker", dt)
    sections = butter(2, CUTOFF, fs=rate, output="sos") if setting.low_pass else None
    state, walk, angle = None, 0.0, rng.uniform(-0.5, 0.5)
    for start in range(0, total, _BLOCK):
        n = min(_BLOCK, total - start)
        angles = rng.uniform(-0.5, 0.5, n)
        y = np.empty((5, n))
        y[0] = np.sqrt(12.0) * rate * np.diff(angles, prepend=angle)
        y[1] = np.sqrt(rate) * rng.standard_normal(n)
        y[2] = exact[start : start + n] if exact is not None else flicker.next_block(n)[:, 0]
        y[3] = walk + np.sqrt(dt) * np.cumsum(rng.standard_normal(n))
        y[4] = dt * np.arange(start, start + n)
        walk, angle = y[3, -1], angles[-1]
        if sections is not None:  # what the sensor rounds is filtered already
            if state is None:
                state = sosfilt_zi(sections)[:, None] * y[1:, :1]
            y[1:], state = sosfilt(sections, y[1:], zi=state)
        yield y


def sums(setting: Setting) -> dict[str, Array]:
    """Return by name the coefficients of the sums of terms that are looked at."""
    result = {}
    for triad, terms in COMPETING.items():
        if setting.low_pass and triad == "gyroscope":
            continue
        for k in range(-1, len(terms)):
            present = np.array(terms)
            if k >= 0:
                present[k] = 0.0
            result[f"{triad}, no {'QNBKR'[k]}" if k >= 0 else f"{triad}, all"] = present
    return result


class ProductAccumulator(SpectrumAccumulator):
    """Averages the products of every two columns instead of the squares of each."""

    @staticmethod
    def _sums_of_squares(coefficients: Array, starts: NDArray[np.int64]) -> Array:
        x = coefficients
        return np.stack([np.add.reduceat(x[i] * x[j], starts) for i, j in PAIRS])


PAIRS: Final = tuple(itertools.combinations_with_replacement(range(len(KEYS)), 2))


def spectrum_of_sums(spectrum: Spectrum, coefficients: Array) -> Spectrum:
    """Return the spectrum of sums (k, 5) of terms from that of a :class:`ProductAccumulator`."""
    i, j = np.array(PAIRS).T
    weights = coefficients[:, i] * coefficients[:, j] * np.where(i == j, 1.0, 2.0)
    return spectrum._replace(
        power=spectrum.power @ weights.T, amplitude=spectrum.amplitude @ coefficients.T
    )


def held(setting: Setting, seed: int) -> Iterator[dict[str, object]]:
    """Yield for each sum of terms how many of three axes' intervals hold the truth, and values."""
    begin = time.process_time()
    coefficient_sums = sums(setting)
    coefficients = np.stack(list(coefficient_sums.values()))
    estimates_by_sum: dict[str, list[list[Estimate]]] = {name: [] for name in coefficient_sums}
    for axis in range(3):
        rng = np.random.default_rng([seed, axis, setting.generator == "exact"])
        accumulator = ProductAccumulator(setting.rate, len(KEYS))
        for block in unit_terms(setting, rng):
            accumulator.add(block.T)
        accumulator.end_piece()
        spectrum = spectrum_of_sums(accumulator.result(), coefficients)
        for k, name in enumerate(coefficient_sums):
            estimates = estimate(spectrum.rows(usable_band(spectrum, k).used), k).estimates
            estimates_by_sum[name].append([estimates[key] for key in KEYS])
    seconds = round((time.process_time() - begin) / len(coefficient_sums), 4)
    for name, truth in coefficient_sums.items():
        covers = [
            [e.covers(t) for e, t in zip(axis, truth, strict=True)]
            for axis in estimates_by_sum[name]
        ]
        yield {
            "setting": setting.name,
            "sum": name,
            "seed": seed,
            "held": np.sum(covers, axis=0).tolist(),
            "estimates": estimates_by_sum[name],
            "cpu_s": seconds,
        }


def run(results: Path) -> None:
    """Run all settings, ten seeds at a time, and append the missing results.

    The last one, which costs as much as three others, comes when they are done.
    """
    done = {(row["setting"], row["seed"]) for row in rows(results)}
    for settings in (SETTINGS[:-1], SETTINGS[-1:]):
        for first_seed, setting, k in itertools.product(range(0, SEEDS, 10), settings, range(10)):
            if (setting.name, first_seed + k) not in done:
                append(results, setting, first_seed + k)


def append(results: Path, setting: Setting, seed: int) -> None:
    """Run one seed of one setting and append what it gives."""
    lines = "".join(json.dumps(row) + "\n" for row in held(setting, seed))
    with results.open("a", encoding="utf-8") as file:
        file.write(lines)


def sample(seeds: int) -> None:
    """Run some seeds of the two shortest settings, and print the table."""
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder) / "coverage.jsonl"
        for setting, seed in itertools.product(SETTINGS[2:4], range(seeds)):
            append(results, setting, seed)
        table(results)


def rows(results: Path) -> list[dict[str, object]]:
    """Return what there is."""
    if not results.exists():
        return []
    return [json.loads(line) for line in results.read_text(encoding="utf-8").splitlines()]


def table(results: Path) -> None:
    """Print the share of intervals that hold the truth, and what chance makes of 95 %."""
    counts: dict[tuple[str, str], NDArray[np.int64]] = {}
    axes: Counter[tuple[str, str]] = Counter()
    for row in rows(results):
        key = (str(row["setting"]), str(row["sum"]))
        counts[key] = counts.get(key, np.zeros(len(KEYS), dtype=np.int64)) + np.array(row["held"])
        axes[key] += 3
    order = {setting.name: k for k, setting in enumerate(SETTINGS)}
    for setting in sorted({key[0] for key in counts}, key=lambda name: order.get(name, 99)):
        keys = [key for key in counts if key[0] == setting]
        lines = [
            [name, f"{axes[key]}", *(f"{100 * c / axes[key]:.0f} %" for c in counts[key])]
            for key, name in ((key, key[1]) for key in keys)
        ]
        total = sum(axes[key] for key in keys)
        means = np.sum([counts[key] for key in keys], axis=0) / total
        lines.append(["all of them", f"{total}", *(f"{100 * mean:.1f} %" for mean in means)])
        print_table([setting, "axes", *"QNBKR"], lines, "95 % intervals that hold the truth")
        n = axes[keys[0]]
        share = lowest_by_chance(n, len(keys) * len(KEYS))
        lowest = min(float(np.min(counts[key])) / axes[key] for key in keys)
        print(f"Lowest {100 * lowest:.1f} %; the lowest by chance is above {100 * share:.1f} %")


def lowest_by_chance(axes: int, numbers: int) -> float:
    """Return the share that the lowest of some shares of 95 % lies above in 95 of 100 studies.

    Bonferroni's bound: it also holds for numbers that depend on each other, as these do.
    """
    from scipy.stats import binom

    return float(binom.ppf(0.05 / numbers, axes, 0.95)) / axes


def main(argv: Sequence[str] | None = None) -> None:
    """Run what is missing, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--results",
        type=Path,
        metavar="FILE",
        help="run the whole study, many hours, and keep its results in FILE, from which it goes on "
        "when it is started again; without it a sample of the study is run",
    )
    parser.add_argument("--seeds", type=int, default=5, help="of the sample (5)")
    parser.add_argument("--table", action="store_true", help="print what FILE has, run nothing")
    arguments = parser.parse_args(argv)
    if arguments.results is None:
        sample(arguments.seeds)
        return
    if not arguments.table:
        run(arguments.results)
    table(arguments.results)


if __name__ == "__main__":
    main()
