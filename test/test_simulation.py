# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The engine as a whole: bit-identity, independence of the terms, live updates, ends, bad input."""

import hashlib
import itertools
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros.config import files
from imu_sim_ros.config.simulation import load_simulation
from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.sensor.block import ImuBlock
from imu_sim_ros.sensor.faults import Fault
from imu_sim_ros.simulation import Simulation

TRIAD_TERMS = {
    "noise_density": 0.01,
    "random_walk": 1e-3,
    "gauss_markov_sigma": 0.01,
    "correlation_time": 10.0,
    "bias_instability": 1e-3,
    "rate_ramp": 1e-5,
    "bias": [0.01, -0.02, 0.03],
    "turn_on_bias_sigma": 0.01,
    "turn_on_scale_sigma": 0.01,
    "scale_error_percent": [1.0, -1.0, 0.5],
    "misalignment_percent": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
    "quadratic": 1e-3,
    "temperature_bias": [1e-3, 2e-3, 3e-3, 1e-5, 2e-5, 3e-5],
    "temperature_scale": [1e-4, 2e-4, 3e-4],
    "bandwidth": [60.0, 40.0, 20.0],
    "range": 30.0,
    "resolution": 1e-3,
}
EVERY_TERM: dict[str, object] = {
    **{
        f"imu.{triad}_{name}": value
        for triad in ("gyroscope", "accelerometer")
        for name, value in TRIAD_TERMS.items()
    },
    "imu.gyroscope_g_sensitivity": [1e-4, 0, 0, 0, 2e-4, 0, 0, 1e-5, 3e-4],
    "imu.lever_arm": [0.1, 0.2, -0.3],
    "imu.mounting": [0, -1, 0, 1, 0, 0, 0, 0, 1],
    "imu.stamp_offset": 0.01,
    "imu.clock_skew_ppm": 50.0,
    "imu.clock_drift_ppm_per_hour": 5.0,
    "imu.jitter": 5e-4,
    "imu.latency": 2e-3,
    "imu.latency_jitter": 4e-3,
    "imu.dropout_probability": 0.02,
    "imu.dropout_burst_rate": 0.5,
    "imu.dropout_burst_duration": 0.1,
    "imu.duplicate_probability": 0.05,
    "temperature.profile": [0.0, 20.0, 5.0, 40.0, 15.0, 30.0],
    "temperature.time_constant": 3.0,
    "earth_rotation": True,
    "gravity_model": "wgs84",
    "latitude_deg": 48.0,
}
SAMPLES = 3000


def simulation(**values: object) -> Simulation:
    return Simulation(load_simulation({"trajectory.type": "static", **values}))


def perfect(values: dict[str, object]) -> Simulation:
    return Simulation(
        load_simulation({"imu.preset": "perfect", "trajectory.type": "static", **values})
    )


def arrays(block: ImuBlock) -> list[np.ndarray]:
    """All fields in order, but ``delivered`` as indices of samples."""
    flat = [*block[1:-1], *block.motion]
    flat[3] = block.delivered + block.first
    return flat


def joined(run: Simulation, size: int, count: int = SAMPLES) -> list[np.ndarray]:
    blocks = [arrays(block) for block in run.blocks(size, count)]
    return [np.concatenate(parts) for parts in zip(*blocks, strict=True)]


def fingerprint(run: Simulation, size: int) -> str:
    digest = hashlib.sha256()
    for values in joined(run, size):
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


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
    own = {"imu.sampling": sampling, **SAMPLINGS[sampling]}
    values = {**EVERY_TERM, "trajectory.type": "lecture", **own}
    reference = joined(perfect(values), SAMPLES)
    for size in (1, 3, 17, 64, 1000, 1024, 2999):
        count = {1: 300, 3: 600}.get(size, SAMPLES)  # from 64 on through the chunks of noise
        pieces = joined(perfect(values), size, count)
        for k, (piece, whole) in enumerate(zip(pieces, reference, strict=True)):
            expected = whole[whole < count] if k == 3 else whole[:count]
            assert piece.tobytes() == np.ascontiguousarray(expected).tobytes(), (size, k)


@pytest.mark.parametrize("name", [n for n in files.names("trajectories") if n != "poses"])
def test_no_trajectory_depends_on_the_block_size(name: str) -> None:
    values = {"imu.preset": "perfect", "trajectory.type": name, "rate": 190.0}
    whole = joined(Simulation(load_simulation(values)), SAMPLES)
    pieces = joined(Simulation(load_simulation(values)), 37)
    for k, (a, b) in enumerate(zip(whole, pieces, strict=True)):
        assert np.array_equal(a, b), k


def test_irregular_pieces_are_the_whole() -> None:
    run = perfect(EVERY_TERM)
    sizes = [1, 2, 0, 500, 1023, 3, 471, 1000]
    pieces = [arrays(run.next_block(size)) for size in sizes]
    whole = joined(perfect(EVERY_TERM), SAMPLES)
    for part, expected in zip(zip(*pieces, strict=True), whole, strict=True):
        assert np.array_equal(np.concatenate(part), expected)
    assert run.position == sum(sizes) == SAMPLES


def test_another_process_makes_the_same_bits() -> None:
    source = (
        "import sys, importlib.util as u\n"
        f"spec = u.spec_from_file_location('t', {str(Path(__file__))!r})\n"
        "t = u.module_from_spec(spec); spec.loader.exec_module(t)\n"
        "print(t.fingerprint(t.perfect({**t.EVERY_TERM, 'trajectory.type': 'lecture'}), 333))\n"
    )
    root = str(Path(__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-c", source], capture_output=True, text=True, check=True, cwd=root
    )
    values = {**EVERY_TERM, "trajectory.type": "lecture"}
    assert done.stdout.strip() == fingerprint(perfect(values), 4096)


def test_reset_gives_the_same_samples_again() -> None:
    run = perfect(EVERY_TERM)
    first = joined(run, 700)
    run.reset()
    assert run.position == 0
    for a, b in zip(first, joined(run, 311), strict=True):
        assert np.array_equal(a, b)


RANDOM_TERMS = {
    "white": {"imu.gyroscope_noise_density": 0.01},
    "walk": {"imu.gyroscope_random_walk": 0.01},
    "markov": {"imu.gyroscope_gauss_markov_sigma": 0.01, "imu.gyroscope_correlation_time": 5.0},
    "flicker": {"imu.gyroscope_bias_instability": 0.01},
    "turn-on": {"imu.gyroscope_turn_on_bias_sigma": 0.01},
}


@pytest.mark.parametrize(("first", "second"), [*itertools.combinations(RANDOM_TERMS, 2)])
def test_switching_one_term_on_changes_no_other(first: str, second: str) -> None:
    """At rest the ideal rate is 0, so two terms read their exact sum; addition commutes."""
    one = perfect(RANDOM_TERMS[first]).next_block(SAMPLES).gyro
    two = perfect(RANDOM_TERMS[second]).next_block(SAMPLES).gyro
    both = perfect({**RANDOM_TERMS[first], **RANDOM_TERMS[second]}).next_block(SAMPLES).gyro
    assert one.any()
    assert two.any()
    assert np.array_equal(both, one + two)


def test_other_triad_and_timing_change_no_noise() -> None:
    alone = perfect(RANDOM_TERMS["white"]).next_block(SAMPLES)
    others = {
        name: value
        for name, value in EVERY_TERM.items()
        if not name.startswith("imu.gyroscope") and "mounting" not in name and "earth" not in name
    }
    together = perfect({**others, **RANDOM_TERMS["white"]}).next_block(SAMPLES)
    assert np.array_equal(alone.gyro, together.gyro)
    assert len(together.delivered) != SAMPLES


def test_one_axis_does_not_change_another() -> None:
    all_axes = perfect(RANDOM_TERMS["walk"]).next_block(SAMPLES).gyro
    only_z = perfect({"imu.gyroscope_random_walk": [0.0, 0.0, 0.01]}).next_block(SAMPLES).gyro
    assert np.array_equal(only_z[:, 2], all_axes[:, 2])
    assert not only_z[:, :2].any()


@pytest.mark.parametrize("term", ["white", "walk", "markov", "flicker"])
def test_seeds_axes_and_triads_are_uncorrelated(term: str) -> None:
    """Of independent white sequences of n numbers r is N(0, 1/n); 5 / sqrt(n) fails 1 in 10^6.

    Walk, Gauss-Markov and 1/f are compared by their increments, which are (nearly) white.
    """
    n = 40_000
    accel = {
        name.replace("gyroscope", "accelerometer"): v for name, v in RANDOM_TERMS[term].items()
    }
    values = {**RANDOM_TERMS[term], **accel}
    series = []
    for seed in (0, 1, 2**40):
        block = perfect({**values, "seed": seed}).next_block(n)
        for reading in (block.gyro, block.accel - block.ideal_accel):
            series += list(reading.T if term == "white" else np.diff(reading, axis=0).T)
    correlation = np.corrcoef(series) - np.eye(len(series))
    assert np.abs(correlation).max() < 5.0 / np.sqrt(n)


def test_total_and_blocks() -> None:
    run = simulation(duration=20.0)
    assert run.total == 4000
    assert [len(block.t_ns) for block in run.blocks(1500)] == [1500, 1500, 1000]
    assert len(run.next_block(10).t_ns) == 0
    assert simulation().total is None
    assert [len(block.t_ns) for block in simulation().blocks(7, count=20)] == [7, 7, 6]
    assert simulation(duration=1.0, rate=0.5).total == 1


def test_start_time() -> None:
    assert simulation().next_block(2).true_t_ns.tolist() == [1_000_000_000, 1_005_000_000]
    assert simulation(start_time=0.0).t0_ns == 0
    assert simulation(start_time=1.5).t0_ns == 1_500_000_000
    parameters = load_simulation({"trajectory.type": "static"})
    assert Simulation(parameters, t0_ns=7).next_block(1).t_ns.tolist() == [7]


def test_duration_beyond_the_trajectory_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "poses.txt"
    rows = [f"{k} {k * k * 0.1} 0 0 0 0 0 1" for k in range(12)]
    path.write_text("\n".join(rows))
    values = {"trajectory.type": "poses", "trajectory.file": str(path)}
    longest = Simulation(load_simulation(values)).trajectory.duration
    with pytest.raises(ConfigurationError, match=r"duration = 100.*trajectory's length"):
        Simulation(load_simulation({**values, "duration": 100.0}))
    assert Simulation(load_simulation({**values, "duration": longest})).total is not None


def test_update_changes_the_strength_and_nothing_else() -> None:
    values = {**RANDOM_TERMS["white"], **RANDOM_TERMS["walk"], "imu.accelerometer_noise_density": 1}
    changed, plain = perfect(values), perfect(values)
    before = changed.next_block(500)
    plain.next_block(500)
    new = {**values, "imu.gyroscope_noise_density": 0.02, "imu.gyroscope_bias": [1.0, 0.0, 0.0]}
    changed.update(load_simulation({"imu.preset": "perfect", "trajectory.type": "static", **new}))
    after, unchanged = changed.next_block(500), plain.next_block(500)
    assert np.array_equal(after.accel, unchanged.accel)
    bias = after.gyro_bias - unchanged.gyro_bias
    assert np.allclose(bias, [1.0, 0.0, 0.0], atol=1e-14)
    noise = (after.gyro - after.gyro_bias) / (unchanged.gyro - unchanged.gyro_bias)
    assert np.allclose(noise, 2.0, rtol=1e-9, atol=1e-9)
    step = 0.01 * np.sqrt(0.005)
    assert np.abs(after.gyro_bias[0, 1] - before.gyro_bias[-1, 1]) < 6 * step


@pytest.mark.parametrize(
    "name",
    ["gyroscope_random_walk", "gyroscope_gauss_markov_sigma", "gyroscope_bias_instability"],
)
def test_a_slow_bias_of_twice_the_strength_has_the_same_stream(name: str) -> None:
    """Its steps are twice as large from the change on."""
    values = {"imu.gyroscope_correlation_time": 5.0, f"imu.{name}": 0.01}
    run, plain = perfect(values), perfect(values)
    run.next_block(100)
    plain.next_block(100)
    run.update(
        load_simulation(
            {"imu.preset": "perfect", "trajectory.type": "static", **values, f"imu.{name}": 0.02}
        )
    )
    ratio = np.diff(run.next_block(100).gyro, axis=0) / np.diff(plain.next_block(100).gyro, axis=0)
    assert np.allclose(ratio, 2.0, rtol=1e-6)


def test_ramp_does_not_jump_when_it_changes() -> None:
    values = {"imu.gyroscope_rate_ramp": 1.0}
    run = perfect(values)
    run.next_block(200)
    run.update(
        load_simulation(
            {"imu.preset": "perfect", "trajectory.type": "static", "imu.gyroscope_rate_ramp": -2.0}
        )
    )
    after = run.next_block(101).gyro[:, 0]
    assert after[0] == pytest.approx(1.0)
    assert after[100] == pytest.approx(0.0, abs=1e-12)


def test_update_refuses_what_is_fixed_and_changes_nothing() -> None:
    run = simulation()
    old = run.parameters
    new = load_simulation(
        {"trajectory.type": "static", "rate": 100.0, "seed": 3, "imu.gyroscope_bias": 1.0}
    )
    with pytest.raises(ConfigurationError) as error:
        run.update(new)
    assert len(error.value.problems) == 2
    assert "rate: cannot be changed" in error.value.problems[0]
    assert run.parameters is old
    assert np.abs(run.next_block(10).gyro_bias).max() < 0.1


def test_faults_take_effect_for_their_time_and_are_in_the_truth() -> None:
    run = perfect({})
    run.next_block(100)
    run.inject(Fault("bias_jump", 0.5, (0.1, 0.2, 0.3), "gyroscope"))
    run.inject(Fault("stuck", 0.25, triad="accelerometer"), delay=1.0)
    run.inject(Fault("dropout", 0.1, 1.0), delay=0.05)
    run.inject(Fault("latency", 0.1, 0.02), delay=0.05)
    pieces = [run.next_block(70) for _ in range(6)]
    gyro_bias = np.concatenate([block.gyro_bias for block in pieces])
    assert np.array_equal(gyro_bias[:100], np.tile([0.1, 0.2, 0.3], (100, 1)))
    assert not gyro_bias[100:].any()
    assert np.array_equal(np.concatenate([block.gyro for block in pieces]), gyro_bias)
    arrived = np.concatenate([block.delivered + block.first for block in pieces]) - 100
    assert np.array_equal(np.setdiff1d(np.arange(420), arrived), np.arange(10, 30))
    latency = np.concatenate([block.release_t_ns - block.true_t_ns for block in pieces])
    assert latency[10:30].tolist() == [20_000_000] * 20
    # A message that waits holds up those after it: order is kept.
    assert latency[30:34].tolist() == [15_000_000, 10_000_000, 5_000_000, 0]


def test_reset_forgets_faults() -> None:
    run = perfect({})
    run.inject(Fault("bias_jump", 1.0, 1.0, "gyroscope"))
    run.reset()
    assert not run.next_block(10).gyro.any()


def test_a_run_of_thirty_days_ends_exactly() -> None:
    """Times are computed from the index: jump to the last second instead of waiting for it."""
    start = 4_000_000_000
    values = {
        "imu.preset": "perfect",
        "trajectory.type": "lecture",
        "rate": 1000.0,
        "duration": 30 * 86400.0,
        "start_time": float(start),
        "imu.clock_skew_ppm": 20.0,
    }
    run = Simulation(load_simulation(values))
    assert run.total == 30 * 86400 * 1000
    run.position = run.total - 1000
    block = run.next_block(5000)
    assert len(block.t_ns) == 1000
    last = (start + 30 * 86400) * 10**9 - 10**6
    assert int(block.true_t_ns[-1]) == last
    since = last - start * 10**9
    assert int(block.t_ns[-1]) == last + round(since * 20e-6)
    assert (np.diff(block.true_t_ns) == 10**6).all()
    assert (np.diff(block.t_ns) > 0).all()
    # The motion at that time, computed with the period taken out: K = pi / 10 has a period of 20 s.
    phase = Simulation(load_simulation({**values, "duration": 20.0}))
    phase.position = 19_000
    again = phase.next_block(1000)
    assert np.allclose(block.motion.position[:, :2], again.motion.position[:, :2], atol=1e-7)


@pytest.mark.parametrize("rate", [1.0, 29.97, 333.3, 1000.0, 20000.0])
def test_stamps_increase_at_any_rate(rate: float) -> None:
    run = perfect(
        {"rate": rate, "imu.jitter": 0.25 / rate, "imu.clock_skew_ppm": -10000.0, "start_time": 4e9}
    )
    stamps = run.next_block(20_000).t_ns
    assert (np.diff(stamps) > 0).all()


def test_scipy_is_imported_for_a_low_pass_only() -> None:
    """Half a second of a node's start; every preset does without."""
    source = (
        "import sys\n"
        "from imu_sim_ros.config.files import names\n"
        "from imu_sim_ros.config.simulation import load_simulation\n"
        "from imu_sim_ros.simulation import Simulation\n"
        "for imu in names('imus'):\n"
        "    Simulation(load_simulation({'imu.preset': imu})).next_block(10)\n"
        "assert not {'scipy', 'matplotlib', 'rosbags', 'rclpy'} & set(sys.modules)\n"
        "Simulation(load_simulation({'imu.gyroscope_bandwidth': 20.0})).next_block(10)\n"
        "assert 'scipy.signal' in sys.modules\n"
    )
    root = str(Path(__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-c", source], capture_output=True, text=True, check=False, cwd=root
    )
    assert done.returncode == 0, done.stderr


def test_memory_does_not_grow_with_the_run() -> None:
    """Fifty blocks of some 400 kB each, 20 MB if they were kept, raise the peak by less than 1 MB.

    When the garbage collector runs decides what of one block is still there beside the next.
    """
    run = perfect({**EVERY_TERM, "trajectory.type": "lecture"})
    run.next_block(2000)
    tracemalloc.start()
    try:
        peaks = []
        for blocks in (10, 60):
            tracemalloc.reset_peak()
            for _ in run.blocks(1000, 1000 * blocks):
                pass
            peaks.append(tracemalloc.get_traced_memory()[1])
    finally:
        tracemalloc.stop()
    assert peaks[1] - peaks[0] < 1_000_000
