# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

import itertools

import numpy as np
import pytest

from examples.integrals import integrate
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, InputError
from imu_sim_ros.navigation import angles, dead_reckoning
from imu_sim_ros.navigation.dead_reckoning import dead_reckon
from imu_sim_ros.navigation.parameters import ATTITUDE_UPDATES, METHODS
from imu_sim_ros.navigation.state import Correction, NavigationState
from imu_sim_ros.navigation.stepper import Stepper

from .conftest import AT_REST

WAYS = [
    (method, attitude)
    for method, attitude in itertools.product(METHODS, ATTITUDE_UPDATES)
    if attitude != "euler_angles" or method in angles.METHODS
]
ORDERS = {"euler": 1.0, "midpoint": 2.0, "rk4": 2.0}
"""Orders of convergence; any other method has order 1 at least."""
CORRECTION = Correction(
    gyroscope_bias=(0.01, -0.02, 0.03),
    accelerometer_bias=(0.1, 0.2, -0.3),
    gyroscope_scale_misalignment=(1.01, 0.002, 0.001, -0.003, 0.99, 0.002, 0.0, 0.001, 1.02),
    accelerometer_scale_misalignment=(0.98, 0.01, 0.0, 0.002, 1.01, -0.003, 0.001, 0.0, 1.03),
    gyroscope_g_sensitivity=(1e-3, 0.0, 2e-4, 0.0, -1e-3, 0.0, 1e-4, 0.0, 5e-4),
)


def final_errors(record, method, attitude):
    states = dead_reckon(record.t_ns, record.gyro, record.accel, record.initial, method, attitude)
    position = np.linalg.norm(states.position[-1] - record.truth.position[-1])
    turn = rotation.multiply(rotation.conjugate(states.q_wb[-1]), record.truth.q_wb[-1])
    return position, np.linalg.norm(rotation.log(turn))


@pytest.mark.parametrize(("method", "expected"), [("euler", 0.906), ("midpoint", 1.29e-3)])
def test_error_on_the_lecture_trajectory(record, method, expected):
    position, _ = final_errors(record("lecture", 200.0, 20.0), method, "so3")
    assert position == pytest.approx(expected, rel=5e-3)


# A perfect IMU's readings are known at the steps' ends alone. What lies between is a curve, which
# rk4's straight line misses by O(h^2): its order on true motions is 2, on linear readings 4.
@pytest.mark.parametrize("motion", ["lecture", "coning", "excitation"])
@pytest.mark.parametrize(("method", "attitude"), WAYS)
def test_order_of_convergence(record, motion, method, attitude):
    rates = np.array([100.0, 200.0, 400.0, 800.0, 1600.0])
    # 4 s less a sample: the errors of a whole period cancel, which would feign a higher order.
    errors = [
        final_errors(record(motion, rate, 3.7 if motion != "lecture" else 5.3), method, attitude)
        for rate in rates
    ]
    slopes = -np.polyfit(np.log(rates), np.log(np.array(errors)), 1)[0]
    order = ORDERS.get(method, max(1.0, np.rint(slopes).min()))
    assert slopes == pytest.approx([order, order], abs=0.12)


def linear_readings(rate):
    """Return stamps, rates and forces that are linear in time, over 2 s."""
    t_ns = np.round(np.arange(round(2 * rate) + 1) * 1e9 / rate).astype(np.int64)
    t = (t_ns * 1e-9)[:, None]
    gyro = np.array([0.5, -0.8, 0.3]) + t * np.array([0.9, 0.4, -1.1])
    accel = np.array([1.0, -2.0, 9.0]) + t * np.array([-3.0, 2.0, 1.5])
    return t_ns, gyro, accel


@pytest.mark.parametrize("attitude", ATTITUDE_UPDATES)
def test_rk4_is_of_order_4_where_readings_are_linear(attitude):
    start = NavigationState(np.zeros(3), np.array([1.0, 2.0, 3.0]), np.array([1.0, 0, 0, 0]))
    exact = dead_reckon(*linear_readings(2000.0), start, "rk4", "so3")
    errors = []
    rates = np.array([15.0, 30.0, 60.0, 120.0, 240.0])
    for rate in rates:
        states = dead_reckon(*linear_readings(rate), start, "rk4", attitude)
        errors.append(np.linalg.norm(states.position[-1] - exact.position[-1]))
    slope = -np.polyfit(np.log(rates), np.log(errors), 1)[0]
    assert slope == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize("earth_rate", [(0.0, 0.0, 0.0), (0.01, -0.02, 0.03)])
@pytest.mark.parametrize("correction", [Correction(), CORRECTION])
@pytest.mark.parametrize(("method", "attitude"), WAYS)
def test_stepper_equals_arrays(record, method, attitude, correction, earth_rate):
    motion = record("lecture", 200.0, 0.5)
    states = dead_reckon(
        motion.t_ns,
        motion.gyro,
        motion.accel,
        motion.initial,
        method,
        attitude,
        correction=correction,
        earth_rate=earth_rate,
    )
    stepper = Stepper(
        motion.initial, method, attitude, correction=correction, earth_rate=earth_rate
    )
    rows = zip(motion.t_ns.tolist(), motion.gyro.tolist(), motion.accel.tolist(), strict=True)
    for k, (t_ns, rate, force) in enumerate(rows):
        assert stepper.add(t_ns, tuple(rate), tuple(force)) == (k > 0)
    scale = np.abs(states.position).max()
    np.testing.assert_allclose(
        stepper.state.position, states.position[-1], atol=1e-12 * scale, rtol=0
    )
    scale = np.abs(states.velocity).max()
    np.testing.assert_allclose(
        stepper.state.velocity, states.velocity[-1], atol=1e-12 * scale, rtol=0
    )
    np.testing.assert_allclose(stepper.state.q_wb, states.q_wb[-1], atol=1e-12, rtol=0)


def test_blocks_do_not_show(record, monkeypatch):
    motion = record("excitation", 100.0, 10.0)
    arguments = (motion.t_ns, motion.gyro, motion.accel, motion.initial)
    whole = dead_reckon(*arguments)
    monkeypatch.setattr(dead_reckoning, "_BLOCK", 37)
    parts = dead_reckon(*arguments)
    np.testing.assert_allclose(parts.position, whole.position, atol=1e-12, rtol=0)
    np.testing.assert_allclose(parts.q_wb, whole.q_wb, atol=1e-13, rtol=0)


@pytest.mark.parametrize(("method", "attitude"), WAYS)
def test_rest_stays_at_rest(method, attitude):
    t_ns = np.arange(200) * 10_000_000
    accel = np.tile([0.0, 0.0, 9.81], (200, 1))
    states = dead_reckon(t_ns, np.zeros((200, 3)), accel, AT_REST, method, attitude)
    np.testing.assert_allclose(states.position, 0.0, atol=1e-13)
    np.testing.assert_allclose(states.q_wb, np.tile([1.0, 0, 0, 0], (200, 1)), atol=1e-15)


@pytest.mark.parametrize(("method", "attitude"), WAYS)
def test_irregular_stamps(record, method, attitude):
    """A constant acceleration without turn is integrated exactly whatever the steps."""
    steps = np.random.default_rng(5).integers(1_000_000, 20_000_000, 300)
    t_ns = np.concatenate([[7], 7 + np.cumsum(steps)])
    accel = np.tile([1.0, 2.0, 9.81 + 3.0], (301, 1))
    states = dead_reckon(t_ns, np.zeros((301, 3)), accel, AT_REST, method, attitude)
    t = (t_ns[-1] - 7) * 1e-9
    np.testing.assert_allclose(states.velocity[-1], [t, 2 * t, 3 * t], rtol=1e-12)
    expected = 0.5 * t * t * np.array([1, 2, 3])
    np.testing.assert_allclose(states.position[-1], expected, rtol=1e-12)


def integrals(motions, name, rate, duration):
    """Return integrals of the exact readings over each interval (Gauss-Legendre, 6 points)."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    n = round(rate * duration)
    h = 1.0 / rate
    t = (np.arange(n)[:, None] + 0.5 + 0.5 * nodes) * h
    _, _, acceleration, q_wb, body_rates = motions[name](t.ravel())
    force = rotation.rotate_inverse(q_wb, acceleration - np.array([0.0, 0.0, -9.81]))
    weigh = 0.5 * h * weights[:, None]
    return (body_rates.reshape(n, 6, 3) * weigh).sum(1), (force.reshape(n, 6, 3) * weigh).sum(1)


def integral_errors(record, motions, name, rate, duration):
    motion = record(name, rate, duration)
    angle, velocity = integrals(motions, name, rate, duration)
    start = motion.truth.position[0], motion.truth.velocity[0], motion.truth.q_wb[0]
    end, speed, q_wb = integrate(1.0 / rate, angle, velocity, *start)
    turn = rotation.multiply(rotation.conjugate(q_wb), motion.truth.q_wb[-1])
    return (
        np.linalg.norm(speed - motion.truth.velocity[-1]),
        np.linalg.norm(end - motion.truth.position[-1]),
        np.linalg.norm(rotation.log(turn)),
    )


@pytest.mark.parametrize("name", ["coning", "excitation"])
def test_coning_and_sculling_are_corrected(record, motions, name):
    """The corrected integrals converge with third order or better, and beat rate readings."""
    rates = np.array([50.0, 100.0, 200.0, 400.0])
    errors = np.array([integral_errors(record, motions, name, rate, 3.7) for rate in rates])
    slopes = -np.polyfit(np.log(rates), np.log(errors), 1)[0]
    assert (slopes > [2.8, 2.8, 2.8]).all()
    position, attitude = final_errors(record(name, 200.0, 3.7), "rk4", "so3")
    assert errors[2, 1] < 0.1 * position
    assert errors[2, 2] < 0.1 * attitude


@pytest.mark.parametrize(("method", "order"), [("euler", 1.0), ("midpoint", 2.0), ("rk4", 2.0)])
def test_the_rate_and_coriolis_acceleration_of_the_earth_are_corrected_to_the_methods_order(
    motions, method, order
):
    """Readings of a sensor that also feels the world's turn and Coriolis' acceleration."""
    earth = np.array([0.05, -0.03, 0.08])
    errors = []
    rates = np.array([100.0, 200.0, 400.0])
    for rate in rates:
        t_ns = np.round(np.arange(round(3.7 * rate) + 1) * 1e9 / rate).astype(np.int64)
        position, velocity, acceleration, q_wb, body_rates = motions["excitation"](t_ns * 1e-9)
        felt = acceleration + 2.0 * np.cross(earth, velocity) - np.array([0.0, 0.0, -9.81])
        states = dead_reckon(
            t_ns,
            body_rates + rotation.rotate_inverse(q_wb, earth),
            rotation.rotate_inverse(q_wb, felt),
            NavigationState(position[0], velocity[0], q_wb[0]),
            method,
            earth_rate=earth,
        )
        errors.append(np.linalg.norm(states.position[-1] - position[-1]))
    slope = -np.polyfit(np.log(rates), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.1)
    assert errors[-1] < (0.2 if method == "euler" else 5e-4)


def test_gimbal_lock_is_an_error():
    t_ns = np.arange(400) * 5_000_000
    gyro = np.tile([0.0, 1.0, 0.0], (400, 1))
    accel = np.tile([0.0, 0.0, 9.81], (400, 1))
    with pytest.raises(InputError, match="gimbal lock at 90 degrees, 1.56 s after"):
        dead_reckon(t_ns, gyro, accel, AT_REST, "midpoint", "euler_angles")
    assert dead_reckon(t_ns, gyro, accel, AT_REST).q_wb[-1] == pytest.approx(
        rotation.from_euler([0.0, 1.995, 0.0])
    )


def good(n=5):
    return np.arange(n) * 10_000_000, np.zeros((n, 3)), np.tile([0.0, 0.0, 9.81], (n, 1))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda t, w, f: (t[[0, 2, 1, 3, 4]], w, f), r"1 stamps are earlier .* number 2 \(1"),
        (
            lambda t, w, f: (t[[0, 1, 1, 3, 4]], w, f),
            "1 stamps are repeated, the first is number 2",
        ),
        (lambda t, w, f: (t[:1], w[:1], f[:1]), "1 reading: integration needs at least two"),
        (lambda t, w, f: (t[:0], w[:0], f[:0]), "0 readings: integration needs at least two"),
        (
            lambda t, w, f: (t, np.where(np.eye(5, 3) > 0, np.nan, w), f),
            "number 0: .*not finite: angular vel.*\n.*number 1: .*\n.*number 2: ",
        ),
        (
            lambda t, w, f: (t, w, f + np.array([np.inf, 0, 0])),
            "number 4: .*not finite: linear acceleration .inf",
        ),
        (
            lambda t, w, f: (t * 20, w, f),
            "4 gaps are longer than max_gap = 0.1 s, the first is 0.2",
        ),
        (lambda t, w, f: (t, w[:4], f), r"gyro has \(4, 3\)"),
    ],
)
def test_bad_stamps_shapes_and_values_are_refused_by_number(spoil, message):
    with pytest.raises(InputError, match=message):
        dead_reckon(*spoil(*good()), AT_REST, max_gap=0.1)


def test_everything_wrong_is_said_at_once():
    t_ns, gyro, accel = good()
    gyro[3] = np.nan
    with pytest.raises(InputError) as caught:
        dead_reckon(t_ns[[0, 2, 2, 1, 4]], gyro, accel, AT_REST)
    assert len(caught.value.problems) == 3


def test_unknown_methods_are_refused_together():
    with pytest.raises(ConfigurationError, match="method = 'heun': must be one of euler") as caught:
        dead_reckon(*good(), AT_REST, "heun", "dcm")
    assert len(caught.value.problems) == 2
