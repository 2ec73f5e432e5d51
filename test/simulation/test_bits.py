# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bits do not depend on blocks, processes or resets, and no term depends on another."""

import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from simulation_runs import (
    EVERY_TERM,
    RANDOM_TERMS,
    SAMPLES,
    arrays,
    fingerprint,
    joined,
    perfect,
)

from imu_sim_ros.parameters import files
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

SAMPLINGS: dict[str, dict[str, object]] = {
    "instantaneous": {},
    "averaged": {
        "imu.gyroscope_increment_resolution": 1e-5,
        "imu.accelerometer_increment_resolution": 1e-4,
        "trajectory.vibration.noise_rms": 1.0,
        "trajectory.vibration.angular_noise_rms": 0.1,
    },
    "oversampled": {"imu.internal_rate": 1400.0},
}


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_samples_do_not_depend_on_the_block_size(sampling: str) -> None:
    settings = {"imu.sampling": sampling, **SAMPLINGS[sampling]}
    values = {**EVERY_TERM, "trajectory.type": "lecture", **settings}
    reference = joined(perfect(values), SAMPLES)
    for size in (1, 3, 17, 64, 1000, 1024, 2999):
        # From 17 on through a chunk of the noise, from 64 on through all of them.
        count = {1: 50, 3: 150, 17: 1100}.get(size, SAMPLES)
        pieces = joined(perfect(values), size, count)
        for k, (piece, whole) in enumerate(zip(pieces, reference, strict=True)):
            expected = whole[whole < count] if k == 3 else whole[:count]
            assert piece.tobytes() == np.ascontiguousarray(expected).tobytes(), (size, k)


@pytest.mark.parametrize("name", [n for n in files.names("trajectories") if n != "poses"])
def test_no_trajectory_depends_on_the_block_size(name: str) -> None:
    values = {"imu.preset": "perfect", "trajectory.type": name, "rate": 190.0}
    whole = joined(Body(load_simulation(values)), SAMPLES)
    pieces = joined(Body(load_simulation(values)), 137)
    for k, (a, b) in enumerate(zip(whole, pieces, strict=True)):
        assert np.array_equal(a, b), k


@pytest.mark.parametrize("rate", [200.0, 190.0])  # at 190 Hz intervals differ by 1 ns
@pytest.mark.parametrize("board", [{}, {"imu.lever_arm": [0.1, 0.2, -0.3]}], ids=["", "board"])
def test_no_mean_depends_on_the_block_size(rate: float, board: dict[str, object]) -> None:
    values = {"imu.preset": "perfect", "rate": rate, "imu.sampling": "averaged", **board}
    whole = joined(Body(load_simulation(values)), 9000, 9000)
    for size, count in ((1, 50), (37, 400), (5000, 9000)):
        pieces = joined(Body(load_simulation(values)), size, count)
        for k, (a, b) in enumerate(zip(whole, pieces, strict=True)):
            assert np.array_equal(a[:count], b), (size, k)


def test_irregular_pieces_are_the_whole() -> None:
    run = perfect(EVERY_TERM)
    sizes = [1, 2, 0, 500, 1023, 3, 471, 1000]
    pieces = [arrays(run.next(size)["imu"]) for size in sizes]
    whole = joined(perfect(EVERY_TERM), SAMPLES)
    for part, expected in zip(zip(*pieces, strict=True), whole, strict=True):
        assert np.array_equal(np.concatenate(part), expected)
    assert run.taken(run.rate) == sum(sizes) == SAMPLES


def test_another_process_makes_the_same_bits() -> None:
    source = (
        f"import sys; sys.path.append({str(Path(__file__).parent)!r})\n"
        "import simulation_runs as t\n"
        "print(t.fingerprint(t.perfect({**t.EVERY_TERM, 'trajectory.type': 'lecture'}), 333))\n"
    )
    root = str(Path(__file__).parents[2])
    done = subprocess.run(
        [sys.executable, "-c", source], capture_output=True, text=True, check=True, cwd=root
    )
    values = {**EVERY_TERM, "trajectory.type": "lecture"}
    assert done.stdout.strip() == fingerprint(perfect(values), 4096)


def test_reset_gives_the_same_samples_again() -> None:
    run = perfect(EVERY_TERM)
    first_block = joined(run, 700)
    run.reset()
    assert run.taken(run.rate) == 0
    for a, b in zip(first_block, joined(run, 311), strict=True):
        assert np.array_equal(a, b)


@pytest.mark.parametrize(("term", "other_term"), [*itertools.combinations(RANDOM_TERMS, 2)])
def test_switching_one_term_on_changes_no_other(term: str, other_term: str) -> None:
    """The ideal rate at rest is 0, so two terms read their exact sum; addition commutes."""
    rates = perfect(RANDOM_TERMS[term]).next(SAMPLES)["imu"].gyro
    other_rates = perfect(RANDOM_TERMS[other_term]).next(SAMPLES)["imu"].gyro
    both = perfect({**RANDOM_TERMS[term], **RANDOM_TERMS[other_term]}).next(SAMPLES)["imu"].gyro
    assert rates.any()
    assert other_rates.any()
    assert np.array_equal(both, rates + other_rates)


def test_other_triad_and_timing_change_no_noise() -> None:
    alone = perfect(RANDOM_TERMS["white"]).next(SAMPLES)["imu"]
    neighbours = {
        name: value
        for name, value in EVERY_TERM.items()
        if not name.startswith("imu.gyroscope") and "mounting" not in name and "earth" not in name
    }
    together = perfect({**neighbours, **RANDOM_TERMS["white"]}).next(SAMPLES)["imu"]
    assert np.array_equal(alone.gyro, together.gyro)
    assert len(together.delivered) != SAMPLES


def test_one_axis_does_not_change_another() -> None:
    all_axes = perfect(RANDOM_TERMS["walk"]).next(SAMPLES)["imu"].gyro
    only_z = perfect({"imu.gyroscope_random_walk": [0.0, 0.0, 0.01]}).next(SAMPLES)["imu"].gyro
    assert np.array_equal(only_z[:, 2], all_axes[:, 2])
    assert not only_z[:, :2].any()


@pytest.mark.parametrize("term", ["white", "walk", "markov", "flicker"])
def test_seeds_axes_and_triads_are_uncorrelated(term: str) -> None:
    """r of white sequences of n numbers is N(0, 1/n); 5 / sqrt(n) fails 1 in 10^6.

    Walk, Gauss-Markov and 1/f are compared by their increments, which are (nearly) white.
    """
    n = 40_000
    accel = {
        name.replace("gyroscope", "accelerometer"): v for name, v in RANDOM_TERMS[term].items()
    }
    values = {**RANDOM_TERMS[term], **accel}
    series = []
    for seed in (0, 1, 2**40):
        block = perfect({**values, "seed": seed}).next(n)["imu"]
        for reading in (block.gyro, block.accel - block.ideal_accel):
            series += list(reading.T if term == "white" else np.diff(reading, axis=0).T)
    correlation = np.corrcoef(series) - np.eye(len(series))
    assert np.abs(correlation).max() < 5.0 / np.sqrt(n)
