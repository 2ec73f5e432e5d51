# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The integrator without its topics: starts, restarts, irregular readings, covariance."""

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.campaigns.common_time import pose_spans
from imu_sim_ros.core import gate, rotation
from imu_sim_ros.core.records import LiveReading, LiveState, Readings
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.parameters import load_integrator
from imu_sim_ros.navigation.state import NavigationState
from imu_sim_ros.nodes.integrator.odometer import LiveIntegrator
from imu_sim_ros.recordings.live_clock import LiveClock

STEP_NS = 5_000_000
LEVEL = (0.0, 0.0, 9.81)
STILL = (0.0, 0.0, 0.0)


class Harness:
    """An odometer, what it complained of, and what a new publisher would look like."""

    def __init__(self, **values: object) -> None:
        self.complaints: list[str] = []
        self.new_source = False
        parameters = load_integrator(values)
        self.odometer = LiveIntegrator(parameters, self.complaints.append, lambda: self.new_source)

    def feed(self, readings: list[LiveReading]) -> list[LiveState]:
        return [row for reading in readings for row in self.odometer.add_reading(reading)]


def readings(count: int, first_index: int = 0, gyro=STILL, accel=LEVEL) -> list[LiveReading]:
    return [LiveReading(10**9 + (first_index + k) * STEP_NS, gyro, accel) for k in range(count)]


def truth(k: float, x: float = 7.0, velocity=STILL) -> LiveState:
    return LiveState(
        10**9 + round(k * STEP_NS), (x, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), velocity, STILL
    )


def turning(count: int) -> list[LiveReading]:
    generator = np.random.default_rng(3)
    gyro, accel = generator.normal(0, 0.5, (2, count, 3))
    accel[:, 2] += 9.81
    return [
        LiveReading(10**9 + k * STEP_NS, tuple(gyro[k].tolist()), tuple(accel[k].tolist()))
        for k in range(count)
    ]


@pytest.mark.parametrize("size", [2, 4, 25])
@pytest.mark.parametrize("start", ["parameters", "level"])
def test_batches_that_share_a_stamp_are_integrated_as_if_each_had_its_own(size, start):
    stream = turning(400)
    if start == "level":
        stream = [*readings(200), *(r._replace(t_ns=r.t_ns + 200 * STEP_NS) for r in stream)]
        # Readings at rest that differ, as those of a sensor.
        stream = [r._replace(accel=(1e-6 * (k % 7), 0.0, r.accel[2])) for k, r in enumerate(stream)]
    batches = [
        r._replace(t_ns=stream[k // size * size].t_ns) for k, r in enumerate(stream[: 16 * 25])
    ]
    exact = Harness(initial_state=start, level_time=0.5)
    rows = exact.feed(stream[: len(batches)])
    harness = Harness(initial_state=start, level_time=0.5)
    spread_rows = harness.feed(batches)
    begin = rows.index(next(r for r in rows if r.t_ns == spread_rows[0].t_ns))
    assert [row.t_ns for row in spread_rows] == [
        row.t_ns for row in rows[begin : begin + len(spread_rows)]
    ]
    assert len(spread_rows) >= len(rows) - size
    if start == "parameters":
        np.testing.assert_allclose(
            spread_rows[-1].position, rows[len(spread_rows) - 1].position, atol=1e-12
        )
    assert [line for line in harness.complaints if "share a stamp" in line]
    assert len(harness.complaints) == 1


def test_a_driver_without_stamps_is_told():
    harness = Harness(initial_state="parameters")
    stream = [reading._replace(t_ns=0) for reading in turning(3000)]
    assert len(harness.feed(stream)) == 1  # the start
    assert "readings have the stamp 0.000000000 s" in harness.complaints[-1]
    assert len(harness.complaints) == 2


def test_levelling_tells_why_it_begins_again_and_repeated_readings_do_not():
    harness = Harness(initial_state="level", level_time=0.5)
    stream = readings(90)
    assert harness.feed([r for reading in stream for r in (reading, reading)]) == []
    assert harness.complaints == []
    later = [reading._replace(t_ns=reading.t_ns + 10 * 10**9) for reading in readings(150)]
    assert len(harness.feed(later)) == 50
    (line,) = harness.complaints
    assert line.startswith("level: a step of 9.555000 s between two stamps")


@pytest.mark.parametrize("attitude", ["quaternion", "so3", "euler_angles"])
@pytest.mark.parametrize("method", ["euler", "midpoint", "rk4"])
def test_every_method_gives_what_dead_reckoning_of_the_record_gives(method, attitude):
    stream = turning(400)
    harness = Harness(method=method, attitude_update=attitude, initial_state="parameters")
    rows = harness.feed(stream)
    states = dead_reckon(
        np.array([r.t_ns for r in stream]),
        np.array([r.gyro for r in stream]),
        np.array([r.accel for r in stream]),
        NavigationState((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
        method,
        attitude,
    )
    assert [row.t_ns for row in rows] == states.t_ns.tolist()
    np.testing.assert_allclose([row.position for row in rows], states.position, atol=1e-12)
    np.testing.assert_allclose([row.q_wb for row in rows], states.q_wb, atol=1e-12)
    velocity_b = rotation.rotate_inverse(states.q_wb, states.velocity)
    np.testing.assert_allclose([row.velocity_b for row in rows], velocity_b, atol=1e-12)


@pytest.mark.parametrize("rate", [1.0, 5.0, 10.0])
@pytest.mark.parametrize("state", ["parameters", "level"])
def test_slow_readings_are_integrated_as_offline(rate, state):
    """The default gap suits the rate: none of these steps is one, but a pause of 3 s is."""
    rows = np.r_[np.arange(40), np.arange(40, 60) + round(3.0 * rate)]
    stream = [LiveReading(10**9 + round(k * 1e9 / rate), STILL, LEVEL) for k in rows.tolist()]
    values = {"initial_state": state, "initial_velocity": [1.0, 0.0, 0.0], "level_time": 2.0}
    harness = Harness(**values)
    states = harness.feed(stream[:40])
    counts = harness.odometer.totals
    assert (counts.steps.gaps, harness.complaints) == (0, [])
    columns = zip(*(reading[:3] for reading in stream[:40]), strict=True)
    record = Readings(*map(np.array, columns))
    offline = ims.dead_reckon(
        record, initial=state, **{k: v for k, v in values.items() if "state" not in k}
    )
    assert [row.t_ns for row in states] == offline.t_ns.tolist()
    np.testing.assert_allclose([row.position for row in states], offline.position, atol=1e-12)
    harness.feed(stream[40:])
    assert counts.steps.gaps == 1
    strict = Harness(**values | {"initial_state": "parameters", "max_gap": 0.05})
    strict.feed(stream)
    assert strict.odometer.totals.steps.gaps == len(stream) - 1


@pytest.mark.parametrize("rate", [3.0, 10.0, 30.0, 300.0, 700.0])
def test_a_step_of_exactly_the_gap_is_none_everywhere(rate):
    """Also where step and gap are no whole nanoseconds."""
    max_gap = 1.0 / rate
    t_ns = 10**9 + np.round(np.arange(40) * 1e9 / rate).astype(np.int64)
    harness = Harness(max_gap=max_gap, initial_velocity=[1.0, 0.0, 0.0])
    rows = harness.feed([LiveReading(t, STILL, LEVEL) for t in t_ns.tolist()])
    assert (harness.odometer.totals.steps.gaps, harness.complaints) == (0, [])
    record = Readings(t_ns, np.tile(STILL, (40, 1)), np.tile(LEVEL, (40, 1)))
    offline = ims.dead_reckon(
        record, initial="parameters", initial_velocity=[1.0, 0.0, 0.0], max_gap=max_gap
    )
    np.testing.assert_allclose(rows[-1].position, offline.position[-1], atol=1e-12)
    clock = LiveClock(max_gap)
    clock.add(t_ns)
    clock.finish()
    assert clock.gaps == 0
    assert len(pose_spans(t_ns, max_gap)) == 1


def test_a_reading_of_long_ago_is_not_integrated_from():
    """A stale first reading of a fast stream: the steps behind it tell that there is a gap."""
    harness = Harness(initial_velocity=[1.0, 0.0, 0.0])
    rows = harness.feed(readings(1) + readings(10, first_index=1000))
    assert len(rows) == 11
    assert harness.odometer.totals.steps.gaps == 1
    assert rows[-1].position[0] == pytest.approx(9 * 0.005, abs=1e-12)


def test_a_gap_is_reported_and_integration_goes_on_behind_it():
    harness = Harness(initial_velocity=[1.0, 0.0, 0.0])
    rows = harness.feed(readings(10) + readings(10, first_index=100))
    assert len(rows) == 20
    # 18 steps of 5 ms at 1 m/s; the 0.455 s of the gap are not travelled.
    assert rows[-1].position[0] == pytest.approx(18 * 0.005, abs=1e-12)
    assert harness.odometer.totals.steps.gaps == 1
    assert harness.complaints == ["a gap of 0.455000 s, not integrated across (1)"]


def test_repeated_and_backward_readings_are_counted_and_passed():
    stream = readings(10)
    odd = [
        *stream[:5],
        stream[4],
        stream[5],
        stream[3],
        *stream[6:],
    ]
    harness = Harness()
    rows = harness.feed(odd)
    steps = harness.odometer.totals.steps
    assert (steps.repeated, steps.backward) == (1, 1)
    assert len(rows) == 11  # all but the repeated one
    assert all(np.isfinite(row.position).all() for row in rows)
    assert len(harness.complaints) == 2


def test_start_at_the_truth_takes_the_reading_of_its_stamp_and_loses_none():
    harness = Harness(initial_state="truth")
    assert harness.feed(readings(20)) == []
    rows = list(harness.odometer.add_truth(truth(4)))
    assert [row.t_ns for row in rows] == [r.t_ns for r in readings(20)][4:]
    assert rows[0].position == (7.0, 0.0, 0.0)
    assert len(harness.feed(readings(5, first_index=20))) == 5


def test_start_at_the_truth_that_came_before_the_readings():
    harness = Harness(initial_state="truth")
    for k in range(10):
        assert list(harness.odometer.add_truth(truth(k, x=float(k)))) == []
    rows = harness.feed(readings(3, first_index=6))
    assert [row.position[0] for row in rows] == pytest.approx([6.0, 6.0, 6.0])


def test_start_at_a_truth_with_stamps_of_its_own_carries_it_on():
    harness = Harness(initial_state="truth")
    harness.feed(readings(1, first_index=1))
    # The truth is 0.4 intervals older than the reading and moves at 10 m/s.
    assert list(harness.odometer.add_truth(truth(0.6, velocity=(10.0, 0.0, 0.0)))) == []
    rows = list(harness.odometer.add_truth(truth(1.6, velocity=(10.0, 0.0, 0.0))))
    assert rows[0].position[0] == pytest.approx(7.0 + 10.0 * 0.4 * 0.005, abs=1e-12)


def test_start_from_rest_finds_attitude_and_gyroscope_bias():
    roll, pitch = 0.2, -0.3
    q_wb = rotation.from_euler([roll, pitch, 1.0])
    accel = tuple(rotation.rotate_inverse(q_wb, [0.0, 0.0, 9.81]).tolist())
    bias = (0.01, -0.02, 0.03)
    harness = Harness(initial_state="level", level_time=0.5, initial_orientation=[0.0, 0.0, 1.0])
    rows = harness.feed(readings(300, gyro=bias, accel=accel))
    assert len(rows) == 200  # 0.5 s are 100 intervals; the last reading of them is the first row
    np.testing.assert_allclose(rows[0].q_wb, q_wb, atol=1e-12)
    # With the bias known, a body at rest stays where it is.
    np.testing.assert_allclose(rows[-1].q_wb, q_wb, atol=1e-12)
    np.testing.assert_allclose(rows[-1].position, 0.0, atol=1e-10)


def test_no_start_from_readings_that_are_not_at_rest():
    harness = Harness(initial_state="level", level_time=0.1)
    assert harness.feed(readings(30, accel=(0.0, 5.0, 9.81))) == []
    assert "not at rest" in harness.complaints[0]
    assert harness.feed(readings(30, first_index=30))


def test_a_clock_set_back_starts_anew():
    harness = Harness(initial_velocity=[1.0, 0.0, 0.0])
    harness.feed(readings(1000, first_index=1000))
    rows = harness.feed(readings(3))
    assert harness.odometer.totals.starts == 2
    assert rows[0].position == (0.0, 0.0, 0.0)


def test_a_new_publisher_behind_a_gap_starts_anew_and_the_old_one_does_not():
    harness = Harness(initial_velocity=[1.0, 0.0, 0.0])
    harness.feed(readings(10))
    harness.feed(readings(10, first_index=100))
    assert harness.odometer.totals.starts == 1
    harness.new_source = True
    rows = harness.feed(readings(10, first_index=300))
    assert harness.odometer.totals.starts == 2
    assert rows[0].position == (0.0, 0.0, 0.0)


def test_new_biases_hold_from_the_next_reading_on():
    harness = Harness(method="euler")
    harness.feed(readings(3, gyro=(0.1, 0.0, 0.0)))
    values = {"gyroscope_bias": [0.1, 0.0, 0.0], "method": "euler"}
    harness.odometer.correct_with(load_integrator(values))
    (row,) = harness.feed(readings(1, first_index=3, gyro=(0.1, 0.0, 0.0)))
    assert row.angular_velocity_b == (0.0, 0.0, 0.0)


def test_the_covariance_of_a_body_at_rest_follows_the_closed_form():
    """White noise of density N gives var(v) = N^2 t and var(p) = N^2 t^3 / 3.

    A walk K of the bias gives var(v) = K^2 t^3 / 3. Without gyroscope noise nothing else
    contributes.
    """
    density, walk = 0.02, 0.003
    harness = Harness(
        **{
            "imu.preset": "perfect",
            "imu.accelerometer_noise_density": density,
            "imu.accelerometer_random_walk": walk,
        }
    )
    rows = harness.feed(readings(2001))
    t = 10.0
    position = rows[-1].covariance
    expected = density**2 * t**3 / 3 + walk**2 * t**5 / 20
    # The sums of 2000 steps differ from the integrals by parts of 1/2000.
    np.testing.assert_allclose(np.diag(position)[:3], expected, rtol=3e-3)
    velocity = density**2 * t + walk**2 * t**3 / 3
    np.testing.assert_allclose(np.diag(rows[-1].twist_covariance)[:3], velocity, rtol=3e-3)
    np.testing.assert_array_equal(position, position.T)


def test_without_covariance_none_is_given():
    harness = Harness(covariance=False)
    assert harness.feed(readings(3))[-1].covariance is None


@pytest.mark.parametrize(
    "motion_settings",
    [
        {"initial_velocity": [1e8, 0.0, 0.0]},
        {"initial_position": [1e10, 0.0, 0.0], "initial_velocity": [1.0, 0.0, 0.0]},
    ],
    ids=["velocity", "position"],
)
def test_no_state_leaves_that_has_grown_beyond_any_possible_one(motion_settings):
    """The start has the largest possible size; the first step makes it larger."""
    harness = Harness(initial_state="parameters", **motion_settings)
    assert len(harness.feed(readings(200, accel=(gate.FORCE.largest, 0.0, 9.81)))) <= 100
    assert any("integration restarts" in complaint for complaint in harness.complaints)


def test_readings_at_the_limits_of_the_gate_are_integrated_to_finite_numbers():
    harness = Harness(initial_state="parameters", covariance=True)
    stream = readings(4000, gyro=(gate.RATE.largest,) * 3, accel=(gate.FORCE.largest,) * 3)
    rows = harness.feed(stream)
    assert len(rows) > 100
    for row in rows:
        numbers = [row.position, row.velocity_b, row.q_wb, row.angular_velocity_b]
        assert np.isfinite(np.concatenate(numbers)).all()
        assert np.isfinite(row.covariance).all()
        assert np.isfinite(row.twist_covariance).all()
