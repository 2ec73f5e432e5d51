# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Injected faults one by one: when they begin and end, what they change, what is refused."""

import math

import numpy as np
import pytest

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation


def run(**values: object) -> Body:
    base = {"imu.preset": "perfect", "trajectory.type": "lecture"}
    return Body(load_simulation({**base, **values}))


def test_stuck_output_repeats_the_last_reading() -> None:
    faulty, plain = run(), run()
    faulty.inject(Fault("stuck", 0.5, triad="gyroscope"), delay=0.25)
    pieces = [faulty.next(30)["imu"] for _ in range(10)]
    gyro = np.concatenate([block.gyro for block in pieces])
    expected = plain.next(300)["imu"]
    assert np.array_equal(gyro[:50], expected.gyro[:50])
    assert np.array_equal(gyro[50:150], np.tile(expected.gyro[49], (100, 1)))
    assert np.array_equal(gyro[150:], expected.gyro[150:])
    ideal = np.concatenate([block.ideal_gyro for block in pieces])
    assert np.array_equal(ideal, expected.ideal_gyro)


def test_stuck_at_the_edge_of_a_block_and_at_the_start() -> None:
    faulty, plain = run(), run()
    expected = plain.next(200)["imu"].accel
    faulty.inject(Fault("stuck", 0.1, triad="accelerometer"))
    assert np.array_equal(faulty.next(10)["imu"].accel, np.tile(expected[0], (10, 1)))
    faulty.next(40)
    faulty.inject(Fault("stuck", 0.1, triad="accelerometer"))
    assert np.array_equal(faulty.next(10)["imu"].accel, np.tile(expected[49], (10, 1)))


def test_saturation_of_one_axis() -> None:
    faulty, plain = run(), run()
    faulty.inject(Fault("saturation", math.inf, (0.0, 0.0, 9.0), "accelerometer"))
    expected = plain.next(400)["imu"].accel
    expected[:, 2] = np.clip(expected[:, 2], -9.0, 9.0)
    assert np.array_equal(faulty.next(400)["imu"].accel, expected)


def test_random_dropouts_leave_other_losses_as_they_were() -> None:
    values = {"imu.dropout_probability": 0.1}
    faulty, plain = run(**values), run(**values)
    faulty.inject(Fault("dropout", 100.0, 0.3), delay=1.0)
    few, all_rows = faulty.next(20_400)["imu"].delivered, plain.next(20_400)["imu"].delivered
    assert np.isin(few, all_rows).all()
    share = len(few[(few >= 200) & (few < 20_200)]) / len(
        all_rows[(all_rows >= 200) & (all_rows < 20_200)]
    )
    assert share == pytest.approx(0.7, abs=5.0 * np.sqrt(0.21 / 18_000))
    healthy = (all_rows < 200) | (all_rows >= 20_200)
    assert np.isin(all_rows[healthy], few).all()


@pytest.mark.parametrize("size", [1, 7, 300])
def test_faults_do_not_depend_on_the_block_size(size: int) -> None:
    def faulty() -> Body:
        simulation = run(**{"imu.dropout_probability": 0.1})
        simulation.inject(Fault("dropout", 0.7, 0.5), delay=0.1)
        simulation.inject(Fault("dropout", 0.4, 0.5), delay=0.3)
        simulation.inject(Fault("stuck", 0.3, triad="gyroscope"), delay=0.123)
        simulation.inject(Fault("bias_jump", 0.31, 0.5, "accelerometer"), delay=0.2)
        simulation.inject(Fault("saturation", 0.2, 9.9, "accelerometer"), delay=0.22)
        simulation.inject(Fault("latency", 0.05, 0.03), delay=0.3)
        return simulation

    whole = faulty().next(300)["imu"]
    body = faulty()
    blocks = [body.next(min(size, 300 - k))["imu"] for k in range(0, 300, size)]
    for name in ("gyro", "accel", "accel_bias", "release_t_ns", "true_t_ns"):
        pieces = np.concatenate([getattr(block, name) for block in blocks])
        assert np.array_equal(pieces, getattr(whole, name)), name
    arrived = np.concatenate([block.delivered + block.first for block in blocks])
    assert np.array_equal(arrived, whole.delivered)


def test_every_problem_is_named() -> None:
    with pytest.raises(ConfigurationError) as error:
        Fault("explosion", -1.0, (1.0, math.nan, 0.0))
    assert len(error.value.problems) == 3
    for arguments, text in (
        (("stuck", 1.0), "fault triad = '': must be gyroscope or accelerometer"),
        (("dropout", 1.0, 1.5), "must be a probability"),
        (("latency", 1.0, -0.1), "must be at least 0"),
        (("latency", math.nan, 0.1), "must be above 0 s"),
    ):
        with pytest.raises(ConfigurationError, match=text):
            Fault(*arguments)
    with pytest.raises(ConfigurationError, match="delay = -1"):
        run().inject(Fault("dropout", 1.0, 1.0), delay=-1.0)


def test_old_faults_are_dropped_and_streams_are_not_reused() -> None:
    """A thousand faults one after another: none is remembered, each loses other messages."""
    faulty = run()
    lost = []
    for _ in range(1000):
        faulty.inject(Fault("dropout", 0.1, 0.5))
        lost.append(20 - len(faulty.next(20)["imu"].delivered))
    assert len(faulty._models["imu"]._timing.faults.windows) == 1
    assert np.mean(lost) == pytest.approx(10.0, abs=5.0 * np.sqrt(5.0 / 1000))
    assert np.var(lost) == pytest.approx(5.0, rel=5.0 * np.sqrt(2.0 / 1000))
