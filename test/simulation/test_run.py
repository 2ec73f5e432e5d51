# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulation as a whole: its ends, changes while it runs, faults, stamps, memory."""

import subprocess
import sys
import tracemalloc
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from simulation_runs import EVERY_TERM, RANDOM_TERMS, perfect, simulation

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation


def test_blocks_end_with_the_duration() -> None:
    run = simulation(duration=20.0)
    assert run.total == 4000
    assert [len(window["imu"].t_ns) for window in run.windows(1500)] == [1500, 1500, 1000]
    assert len(run.next(10)["imu"].t_ns) == 0
    assert simulation().total is None
    assert simulation(duration=1.0, rate=0.5).total == 1


def test_the_first_stamp_is_the_start_time() -> None:
    assert simulation().next(2)["imu"].true_t_ns.tolist() == [1_000_000_000, 1_005_000_000]
    assert simulation(start_time=0.0).t0_ns == 0
    assert simulation(start_time=1.5).t0_ns == 1_500_000_000
    parameters = load_simulation({"trajectory.type": "static"})
    assert Body(parameters, t0_ns=7).next(1)["imu"].t_ns.tolist() == [7]


def test_duration_beyond_the_trajectory_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "poses.txt"
    rows = [f"{k} {k * k * 0.1} 0 0 0 0 0 1" for k in range(12)]
    path.write_text("\n".join(rows))
    values = {"trajectory.type": "poses", "trajectory.file": str(path)}
    longest = Body(load_simulation(values)).trajectory.duration
    with pytest.raises(ConfigurationError, match=r"duration = 100.*trajectory's length"):
        Body(load_simulation({**values, "duration": 100.0}))
    assert Body(load_simulation({**values, "duration": longest})).total is not None


def test_update_changes_the_strength_and_nothing_else() -> None:
    values = {**RANDOM_TERMS["white"], **RANDOM_TERMS["walk"], "imu.accelerometer_noise_density": 1}
    changed, plain = perfect(values), perfect(values)
    earlier = changed.next(500)["imu"]
    plain.next(500)
    changed_values = {
        **values,
        "imu.gyroscope_noise_density": 0.02,
        "imu.gyroscope_bias": [1.0, 0.0, 0.0],
    }
    changed.update(
        load_simulation({"imu.preset": "perfect", "trajectory.type": "static", **changed_values})
    )
    later, unchanged = changed.next(500)["imu"], plain.next(500)["imu"]
    assert np.array_equal(later.accel, unchanged.accel)
    bias = later.gyro_bias - unchanged.gyro_bias
    assert np.allclose(bias, [1.0, 0.0, 0.0], atol=1e-14)
    noise = (later.gyro - later.gyro_bias) / (unchanged.gyro - unchanged.gyro_bias)
    assert np.allclose(noise, 2.0, rtol=1e-9, atol=1e-9)
    step = 0.01 * np.sqrt(0.005)
    assert np.abs(later.gyro_bias[0, 1] - earlier.gyro_bias[-1, 1]) < 6 * step


@pytest.mark.parametrize(
    "name",
    ["gyroscope_random_walk", "gyroscope_gauss_markov_sigma", "gyroscope_bias_instability"],
)
def test_a_slow_bias_of_twice_the_strength_has_the_same_stream(name: str) -> None:
    """Steps are twice as large from the change on."""
    values = {"imu.gyroscope_correlation_time": 5.0, f"imu.{name}": 0.01}
    run, plain = perfect(values), perfect(values)
    run.next(100)
    plain.next(100)
    run.update(
        load_simulation(
            {"imu.preset": "perfect", "trajectory.type": "static", **values, f"imu.{name}": 0.02}
        )
    )
    steps = [np.diff(run_or_plain.next(100)["imu"].gyro, axis=0) for run_or_plain in (run, plain)]
    ratio = steps[0] / steps[1]
    assert np.allclose(ratio, 2.0, rtol=1e-6)


def test_ramp_does_not_jump_when_it_changes() -> None:
    values = {"imu.gyroscope_rate_ramp": 1.0}
    run = perfect(values)
    run.next(200)
    run.update(
        load_simulation(
            {"imu.preset": "perfect", "trajectory.type": "static", "imu.gyroscope_rate_ramp": -2.0}
        )
    )
    later = run.next(101)["imu"].gyro[:, 0]
    assert later[0] == pytest.approx(1.0)
    assert later[100] == pytest.approx(0.0, abs=1e-12)


def test_update_refuses_what_is_fixed_and_changes_nothing() -> None:
    run = simulation()
    parameters = run.parameters
    changed_values = load_simulation(
        {"trajectory.type": "static", "rate": 100.0, "seed": 3, "imu.gyroscope_bias": 1.0}
    )
    with pytest.raises(ConfigurationError) as error:
        run.update(changed_values)
    assert len(error.value.problems) == 2
    assert "rate: cannot be changed" in error.value.problems[0]
    assert run.parameters is parameters
    assert np.abs(run.next(10)["imu"].gyro_bias).max() < 0.1


def test_faults_take_effect_for_their_time_and_are_in_the_truth() -> None:
    run = perfect({})
    run.next(100)
    run.inject(Fault("bias_jump", 0.5, (0.1, 0.2, 0.3), "gyroscope"))
    run.inject(Fault("stuck", 0.25, triad="accelerometer"), delay=1.0)
    run.inject(Fault("dropout", 0.1, 1.0), delay=0.05)
    run.inject(Fault("latency", 0.1, 0.02), delay=0.05)
    pieces = [run.next(70)["imu"] for _ in range(6)]
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
    assert not run.next(10)["imu"].gyro.any()


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
    run = Body(load_simulation(values))
    assert run.total == 30 * 86400 * 1000
    run._now = Fraction(30 * 86400 - 1)
    block = run.next(5000)["imu"]
    assert len(block.t_ns) == 1000
    last_second = (start + 30 * 86400) * 10**9 - 10**6
    assert int(block.true_t_ns[-1]) == last_second
    since = last_second - start * 10**9
    assert int(block.t_ns[-1]) == last_second + round(since * 20e-6)
    assert (np.diff(block.true_t_ns) == 10**6).all()
    assert (np.diff(block.t_ns) > 0).all()
    # The motion at that time, computed with the period taken out: K = pi / 10 has a period of 20 s.
    phase = Body(load_simulation({**values, "duration": 20.0}))
    phase._now = Fraction(19)
    again = phase.next(1000)["imu"]
    assert np.allclose(block.motion.position[:, :2], again.motion.position[:, :2], atol=1e-7)


@pytest.mark.parametrize("rate", [1.0, 29.97, 333.3, 1000.0, 20000.0])
def test_stamps_increase_at_any_rate(rate: float) -> None:
    run = perfect(
        {"rate": rate, "imu.jitter": 0.25 / rate, "imu.clock_skew_ppm": -10000.0, "start_time": 4e9}
    )
    stamps = run.next(20_000)["imu"].t_ns
    assert (np.diff(stamps) > 0).all()


def test_scipy_is_imported_for_a_low_pass_only() -> None:
    """Half a second of a node's start; every preset does without."""
    source = (
        "import sys\n"
        "from imu_sim_ros.parameters.files import names\n"
        "from imu_sim_ros.simulation.parameters import load_simulation\n"
        "from imu_sim_ros.simulation.engine import Body\n"
        "for imu in names('imus'):\n"
        "    Body(load_simulation({'imu.preset': imu})).next(10)\n"
        "assert not {'scipy', 'matplotlib', 'rosbags', 'rclpy'} & set(sys.modules)\n"
        "Body(load_simulation({'imu.gyroscope_bandwidth': 20.0})).next(10)\n"
        "assert 'scipy.signal' in sys.modules\n"
    )
    root = str(Path(__file__).parents[2])
    done = subprocess.run(
        [sys.executable, "-c", source], capture_output=True, text=True, check=False, cwd=root
    )
    assert done.returncode == 0, done.stderr


def test_memory_does_not_grow_with_the_run() -> None:
    """Fifty blocks of some 400 kB each, 20 MB if they were kept, raise the peak by less than 1 MB.

    When the garbage collector runs decides what of one block is still there next to the next one.
    """
    run = perfect({**EVERY_TERM, "trajectory.type": "lecture"})
    run.next(2000)
    tracemalloc.start()
    try:
        peaks = []
        for blocks in (10, 60):
            tracemalloc.reset_peak()
            for _ in range(blocks):
                run.next(1000)
            peaks.append(tracemalloc.get_traced_memory()[1])
    finally:
        tracemalloc.stop()
    assert peaks[1] - peaks[0] < 1_000_000
