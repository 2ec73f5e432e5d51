# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A motion that comes from Python: an object with ``sample(t)``, or a function of time."""

import math

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.core import rotation
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory import given as module
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.given import user_trajectory
from imu_sim_ros.trajectory.parameters import trajectory_layer


def closed_form(name):
    return build_trajectory(load_simulation(trajectory_layer(name)).trajectory)


def poses_of(trajectory):
    def poses(t):
        motion = trajectory.sample(t)
        return motion.position, motion.q_wb

    return poses


def worst(exact, approximate, t):
    pairs = zip(exact.sample(t)[1:], approximate.sample(t)[1:], strict=True)
    return [float(np.abs(a - b).max()) for a, b in pairs]


# (velocity, acceleration, attitude, rate, angular acceleration): rounding, eps |p| / h and 4 eps
# |p| / h^2 with |p| = 25 m and the phase's own rounding after a minute, one-sided ends included.
@pytest.mark.parametrize("name", ["circle", "lecture", "excitation"])
def test_a_function_has_the_derivatives_of_the_closed_form(name):
    exact = closed_form(name)
    approximate = user_trajectory(poses_of(exact))
    t = np.concatenate([np.linspace(0.0, 60.0, 3001), [1e-4, module.STEP, 3.3 * module.STEP]])
    assert np.less(worst(exact, approximate, t), [1e-9, 2e-7, 1e-15, 1e-9, 2e-7]).all()


def sinusoid(w):
    """Return a motion along x and about z with one angular frequency."""

    def poses(t):
        angle, z = 0.1 * np.sin(w * t), np.zeros_like(t)
        q_wb = rotation.from_euler(np.stack([z, z, angle], axis=-1))
        return np.stack([np.sin(w * t), z, z], axis=-1), q_wb

    return user_trajectory(poses)


def test_the_derivatives_are_of_order_eight():
    """Halving the step is halving the frequency: 2^8, one more for each derivative of e^iwt."""
    errors = []
    for w in (2.0**8, 2.0**7):
        t = 1.0 + 2.0 * np.pi / w * np.arange(64) / 64
        motion = sinusoid(w).sample(t)
        errors.append(
            [
                np.abs(motion.velocity[:, 0] / w - np.cos(w * t)).max(),
                np.abs(motion.acceleration[:, 0] / w**2 + np.sin(w * t)).max(),
                np.abs(motion.angular_velocity[:, 2] / (0.1 * w) - np.cos(w * t)).max(),
                np.abs(motion.angular_acceleration[:, 2] / (0.1 * w**2) + np.sin(w * t)).max(),
            ]
        )
    order = np.log2(np.divide(*errors))
    # The next term, (w h)^2 / 4 of the first at w h = 1/2, lowers the order by at most 0.3.
    assert ((order > 7.6) & (order < 8.1)).all(), order


def test_it_ends_where_it_says():
    """Nothing outside of [0, duration] is asked for."""

    def poses(t):
        assert t.min() >= 0.0
        assert t.max() <= 2.0
        return sinusoid(1.0)._poses(t)

    poses.duration = 2.0
    flight = ims.simulate(imu="perfect", trajectory=poses, rate=100)
    assert len(flight) == 200
    t = np.arange(200) / 100
    np.testing.assert_allclose(flight.truth.velocity[:, 0], np.cos(t), rtol=0, atol=1e-10)
    np.testing.assert_allclose(flight.gyro[:, 2], 0.1 * np.cos(t), rtol=0, atol=1e-10)


class Own:
    """A motion of somebody's own, exact."""

    duration = 3.0

    def sample(self, t):
        return closed_form("lecture").sample(t)


def test_an_object_gives_the_samples_of_the_same_motion_by_name():
    flight = ims.simulate(imu="adis16448", trajectory=Own(), seed=3)
    by_name = ims.simulate(imu="adis16448", trajectory="lecture", seed=3, duration=3)
    np.testing.assert_array_equal(flight.gyro, by_name.gyro)
    np.testing.assert_array_equal(flight.accel, by_name.accel)
    assert repr(flight).startswith("<Flight adis16448 on given: 600 at 200 Hz")
    blocks = ims.blocks(imu="adis16448", trajectory=Own(), seed=3, block_size=7)
    np.testing.assert_array_equal(np.concatenate([b.gyro for b in blocks]), flight.gyro)


def test_rests_and_vibration_apply_to_it():
    settings = {"trajectory.rest_before": 1.0, "trajectory.vibration.noise_rms": 0.5}
    flight = ims.simulate(imu="perfect", trajectory=Own(), **settings)
    by_name = ims.simulate(
        imu="perfect", trajectory={"type": "lecture", "length": 3.0, "rest_before": 1.0}
        | {"vibration": {"noise_rms": 0.5}}
    )  # fmt: skip
    assert flight.trajectory.duration == by_name.trajectory.duration > 4.0
    np.testing.assert_array_equal(flight.accel, by_name.accel)


def changed_sample(t, **changed):
    return Own().sample(t)._replace(**changed)


def raising(t):
    raise KeyError("no such waypoint")


def spinning(t):
    z = np.zeros_like(t)
    return np.stack([z, z, z], axis=-1), rotation.exp(np.stack([z, z, 500.0 * t], axis=-1))


def level(t):
    return np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))


@pytest.mark.parametrize(
    ("poses", "line"),
    [
        (raising, r"trajectory\(t\): raised KeyError: 'no such waypoint' \(line \d+ of .*given.py"),
        (lambda t: None, r"trajectory\(t\) = None: must be position \(n, 3\), orient"),
        (lambda t: (np.zeros(3), level(t)), r"position of the shape \(3,\)"),
        (lambda t: (np.zeros((len(t), 3)), 2.0 * level(t)), "a quaternion of length 2"),
        (lambda t: (np.full((len(t), 3), math.nan), level(t)), "at t = 0 s a value that is"),
        (lambda t: ([["x"] * 3] * len(t), level(t)), r"trajectory\(t\): position = "),
        (spinning, "turns at 500 rad/s; a function may turn at 192"),
    ],
)  # fmt: skip
def test_what_a_function_does_wrong_is_one_line(poses, line):
    with pytest.raises(ims.ConfigurationError, match=line) as raised:
        ims.simulate(trajectory=poses, duration=1)
    assert len(raised.value.problems) == 1


@pytest.mark.parametrize(
    ("sample", "line"),
    [
        (raising, r"trajectory\.sample\(t\): raised KeyError"),
        (
            lambda t: changed_sample(t, velocity=np.zeros((len(t), 2))),
            r"velocity of the shape \(\d+, 2\)",
        ),
        (lambda t: changed_sample(t, acceleration=np.full((len(t), 3), 1e9)), "at most 1e.07 m/s"),
        (lambda t: changed_sample(t, q_wb=0.0 * level(t)), "a quaternion of length 0"),
        (lambda t: tuple(changed_sample(t))[:5], r"must be a Motion: position \(n, 3\), velocity"),
    ],
)
def test_what_an_object_does_wrong_is_one_line(sample, line):
    trajectory = Own()
    trajectory.sample = sample
    with pytest.raises(ims.ConfigurationError, match=line) as raised:
        ims.simulate(trajectory=trajectory, duration=1)
    assert len(raised.value.problems) == 1


@pytest.mark.parametrize("duration", [-1.0, 0, math.nan, "3s", None])
def test_a_duration_that_is_none_is_refused(duration):
    motion = Own()
    motion.duration = duration
    with pytest.raises(ims.ConfigurationError, match=r"trajectory\.duration = "):
        ims.simulate(trajectory=motion)


@pytest.mark.parametrize("candidate", [[1, 2], 5, object(), int, Own])
def test_what_is_no_trajectory_is_a_type_error_that_says_what_is(candidate):
    with pytest.raises(
        TypeError, match=r"trajectory = .*an object with sample\(t\), or a function"
    ):
        ims.simulate(trajectory=candidate)


def test_no_file_can_name_it():
    for candidate in ("given", {"type": "given"}):
        with pytest.raises(ims.ConfigurationError, match=r"'given': an object or a function fr"):
            ims.simulate(trajectory=candidate, duration=1)


def still(t, **changed):
    zero = np.zeros((len(t), 3))
    return ims.Motion(zero, zero, zero, level(t), zero, zero)._replace(**changed)


def along_x(values):
    return np.outer(values, [1.0, 0.0, 0.0])


class Moving:
    """An object whose motion is a function."""

    def __init__(self, sample):
        self.sample = sample


@pytest.mark.parametrize("length", [1.04, 1.0 + 2e-6, 0.99])
def test_a_quaternion_that_is_not_of_length_one_is_refused(length):
    def poses(t):
        return np.zeros((len(t), 3)), length * level(t)

    for candidate in (poses, Moving(lambda t: still(t, q_wb=length * level(t)))):
        with pytest.raises(ims.ConfigurationError, match=r"of length .*: must be 1 within 1e-06"):
            ims.simulate(trajectory=candidate, duration=1)


def test_a_quaternion_of_single_precision_gets_the_length_one():
    flight = ims.simulate(
        imu="perfect", trajectory=Moving(lambda t: still(t, q_wb=(1 + 5e-7) * level(t))), duration=1
    )
    np.testing.assert_array_equal(flight.accel, np.tile([0.0, 0.0, 9.81], (200, 1)))


@pytest.mark.parametrize(
    ("sample", "line"),
    [
        (
            lambda t: still(t, position=along_x(100.0 * t)),
            r"velocity contradicts position: at t = .* s it is \[0 0 0\] m/s, but the position "
            r"changes by \[100 0 0\] m/s",
        ),
        (lambda t: still(t, velocity=along_x(t), position=along_x(t * t / 2)), "acceleration con"),
        (
            lambda t: still(
                t, q_wb=rotation.exp(along_x(t)), angular_velocity=along_x(0.0 * t - 1)
            ),
            "angular velocity contradicts attitude",
        ),
        (
            lambda t: still(
                t, q_wb=rotation.exp(along_x(t * t)), angular_velocity=along_x(2.0 * t)
            ),
            "angular acceleration contradicts angular velocity",
        ),
        (
            lambda t: still(t, position=along_x(1000.0 * (t > 0.5))),
            "the position jumps by 1000 m between t = 0.4",
        ),
        (
            lambda t: still(t, q_wb=rotation.exp(along_x(1.0 * (t > 0.5)))),
            "the attitude jumps by 1 rad",
        ),
    ],
)
def test_a_motion_that_contradicts_itself_is_a_warning(sample, line):
    with pytest.warns(UserWarning, match=line):
        ims.simulate(imu="perfect", trajectory=Moving(sample), duration=1)


def test_poses_that_no_body_moves_through_are_a_warning():
    t = np.arange(0.0, 5.005, 0.01)
    yaw = np.rad2deg(2.0 * np.sin(t))

    def turning(t):
        return np.zeros((len(t), 3)), rotation.exp(np.outer(np.rad2deg(np.sin(t)), [0, 0, 1]))

    def jumping(t):
        return along_x(1000.0 * (t > 2.0)), level(t)

    zero = np.zeros((len(t), 4))
    rows = np.column_stack([t, zero[:, :3], zero[:, :2], yaw])
    jump = np.column_stack([t, 1000.0 * (t > 2.0), zero[:, :2], level(t)])
    for candidate, unit in (
        (turning, "rad/s"),
        (jumping, "m/s^2"),
        (rows, "rad/s"),
        (jump, "m/s^2"),
    ):
        with pytest.warns(UserWarning, match=f"{unit[:3]}.* is more than a body carrying an IMU"):
            ims.simulate(imu="perfect", trajectory=candidate, duration=4)


@pytest.mark.parametrize("name", ["lecture", "figure_eight", "excitation", "free_fall", "static"])
def test_an_exact_motion_does_not_contradict_itself(name, recwarn):
    exact = closed_form(name)
    for candidate in (exact, poses_of(exact)):
        ims.simulate(imu="perfect", trajectory=candidate, duration=5)
    assert not recwarn.list


def test_an_acceleration_may_jump(recwarn):
    def sample(t):
        late = t > 1.0
        return still(
            t,
            position=along_x(np.where(late, 2.0 * t - 0.5 * t * t - 1.0, 0.5 * t * t)),
            velocity=along_x(np.where(late, 2.0 - t, t)),
            acceleration=along_x(np.where(late, -1.0, 1.0)),
        )

    ims.simulate(imu="perfect", trajectory=Moving(sample), duration=2)
    assert not recwarn.list


def test_rows_of_poses_may_be_rounded_but_not_of_another_length():
    t = np.arange(0.0, 2.0, 0.01)
    q_wb = rotation.exp(np.outer(t, [0.3, 0.2, 0.1]))
    rows = np.column_stack([t, np.zeros((200, 3)), q_wb.round(4)])
    exact = ims.simulate(imu="perfect", trajectory=rows, duration=1)
    assert np.abs(np.linalg.norm(exact.accel, axis=1) - 9.81).max() < 0.01
    assert np.abs(np.linalg.norm(exact.truth.q_wb, axis=1) - 1.0).max() < 1e-12
    rows[7, 4:] *= 1.04
    with pytest.raises(ims.InputError, match="row 7: a quaternion of length 1.04: must be 1, or"):
        ims.simulate(trajectory=rows, duration=1)
