# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ideal reading against closed forms."""

import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest

from imu_sim_ros.core import rotation
from imu_sim_ros.core.timebase import exact_rate
from imu_sim_ros.sensors.gravity import EARTH_RATE, SEMI_MAJOR_AXIS, normal_gravity
from imu_sim_ros.sensors.imu.model import Imu
from imu_sim_ros.sensors.world import Window, World
from imu_sim_ros.simulation.parameters import SimulationParameters, load_simulation
from imu_sim_ros.simulation.sensors import mount_sensors
from imu_sim_ros.trajectory.build import build_trajectory
from imu_sim_ros.trajectory.motion import Motion, Trajectory

G = 9.81


class Formula:
    """A trajectory given by a function of time; what is not given is 0."""

    highest_frequency = 0.0

    def __init__(self, formula: Callable[[np.ndarray], dict[str, np.ndarray]]) -> None:
        self._formula = formula

    @property
    def duration(self) -> float:
        return math.inf

    def sample(self, t: np.ndarray) -> Motion:
        values = {name: np.zeros((len(t), 3)) for name in Motion._fields}
        values["q_wb"] = np.tile(rotation.IDENTITY, (len(t), 1))
        return Motion(**{**values, **self._formula(t)})


def parameters(**values: object) -> SimulationParameters:
    return load_simulation({"imu.preset": "perfect", "trajectory.type": "static", **values})


def read_imu(
    trajectory: Trajectory, count: int = 400, **values: object
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, rates and forces of a perfect IMU."""
    settings = parameters(**values)
    window = Window(Fraction(0), Fraction(count) / exact_rate(settings.rate))
    block = Imu(mount_sensors(settings)["imu"], 0).read(window, World(trajectory, settings, 0))
    assert np.array_equal(block.gyro, block.ideal_gyro)
    assert np.array_equal(block.accel, block.ideal_accel)
    return block.true_t_ns * 1e-9, block.gyro, block.accel


def columns(*values: object, like: np.ndarray) -> np.ndarray:
    return np.stack([np.broadcast_to(v, like.shape) for v in values], axis=1).astype(float)


def test_at_rest_and_level() -> None:
    _, gyro, accel = read_imu(Formula(lambda t: {}))
    assert not gyro.any()
    assert np.array_equal(accel, np.tile([0.0, 0.0, G], (400, 1)))


def test_at_rest_upside_down_and_on_edge() -> None:
    for angles, expected in (((np.pi, 0, 0), (0, 0, -G)), ((np.pi / 2, 0, 0), (0, G, 0))):
        trajectory = build_trajectory(
            parameters(**{"trajectory.roll_pitch_yaw": list(angles)}).trajectory
        )
        assert np.allclose(read_imu(trajectory)[2], expected, atol=1e-14)


def test_free_fall_reads_nothing() -> None:
    fall = Formula(lambda t: {"acceleration": columns(0, 0, -G, like=t)})
    _, gyro, accel = read_imu(fall)
    assert not gyro.any()
    assert not accel.any()


def test_circle_reads_the_centripetal_acceleration() -> None:
    radius, speed = 3.0, 1.7  # counter-clockwise, nose along the path: the centre is to the left

    def circle(t: np.ndarray) -> dict[str, np.ndarray]:
        w = speed / radius
        return {
            "acceleration": -radius * w * w * columns(np.cos(w * t), np.sin(w * t), 0, like=t),
            "q_wb": rotation.from_euler(columns(0, 0, w * t + np.pi / 2, like=t)),
            "angular_velocity": columns(0, 0, w, like=t),
        }

    _, gyro, accel = read_imu(Formula(circle))
    assert np.allclose(gyro, [0, 0, speed / radius], atol=1e-15)
    assert np.allclose(accel, [0, speed**2 / radius, G], atol=1e-14)


def test_rotating_disc_has_every_term_of_the_lecture() -> None:
    """A ball at r = c t^2 on a disc that turns with w = k t (lecture eq. 4).

    Resolved in the disc: r'' - w^2 r along the radius (centrifugal) and 2 w r' + w' r across
    (Coriolis and Euler).
    """
    c, k = 0.4, 0.7

    def ball(t: np.ndarray) -> dict[str, np.ndarray]:
        q_wb = rotation.from_euler(columns(0, 0, 0.5 * k * t**2, like=t))
        r, w = c * t**2, k * t
        acceleration_b = columns(2 * c - w**2 * r, 2 * w * 2 * c * t + k * r, 0, like=t)
        # In the world frame, by differentiating (r cos(theta), r sin(theta)) twice.
        theta = 0.5 * k * t**2
        x = (2 * c - w**2 * r) * np.cos(theta) - (4 * c * t * w + k * r) * np.sin(theta)
        y = (2 * c - w**2 * r) * np.sin(theta) + (4 * c * t * w + k * r) * np.cos(theta)
        assert np.allclose(rotation.rotate(q_wb, acceleration_b), columns(x, y, 0, like=t))
        return {
            "acceleration": columns(x, y, 0, like=t),
            "q_wb": q_wb,
            "angular_velocity": columns(0, 0, w, like=t),
            "angular_acceleration": columns(0, 0, k, like=t),
        }

    t, gyro, accel = read_imu(Formula(ball))
    assert np.allclose(gyro, columns(0, 0, k * t, like=t), atol=1e-15)
    centrifugal = (k * t) ** 2 * c * t**2
    coriolis, euler = 2 * (k * t) * (2 * c * t), k * c * t**2
    expected = columns(2 * c - centrifugal, coriolis + euler, G, like=t)
    assert np.allclose(accel, expected, atol=1e-13)


LECTURE = build_trajectory(load_simulation({"trajectory.type": "lecture"}).trajectory)
ARM = np.array([0.3, -0.2, 0.5])


def test_lever_arm_is_a_trajectory_shifted_by_hand() -> None:
    """f = R^T (p_i'' - g), with p_i = p + R r differentiated numerically.

    A central difference of sixth order with h = 4 ms: the error is some 1e-9 of rounding.
    """
    h = 4e-3
    weights = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / 180.0
    t, _, accel = read_imu(LECTURE, 2000, **{"imu.lever_arm": ARM.tolist()})
    t, accel = t[5:], accel[5:]
    acceleration = np.zeros((len(t), 3))
    for k, weight in enumerate(weights):
        motion = LECTURE.sample(t + (k - 3) * h)
        acceleration += weight * (motion.position + rotation.rotate(motion.q_wb, ARM)) / h**2
    expected = rotation.rotate_inverse(LECTURE.sample(t).q_wb, acceleration - [0, 0, -G])
    assert np.abs(accel - expected).max() < 2e-7


def test_lever_arm_of_a_spin_is_the_centripetal_acceleration() -> None:
    spin = Formula(lambda t: {"angular_velocity": columns(0, 0, 10.0, like=t)})
    _, gyro, accel = read_imu(spin, **{"imu.lever_arm": [0.1, 0.0, 0.0]})
    assert np.allclose(accel, [-10.0, 0.0, G], atol=1e-12)
    assert np.allclose(gyro, [0, 0, 10.0])


def test_mounting_turns_both_triads() -> None:
    # The IMU's x looks along the body's y: R_bi maps (1, 0, 0) to (0, 1, 0).
    r_bi = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    _, gyro, accel = read_imu(LECTURE)
    _, gyro_i, accel_i = read_imu(LECTURE, **{"imu.mounting": r_bi.ravel().tolist()})
    assert np.allclose(gyro_i @ r_bi.T, gyro, atol=1e-14)
    assert np.allclose(accel_i @ r_bi.T, accel, atol=1e-13)
    assert not np.allclose(gyro_i, gyro, atol=0.1)


def test_earth_rate_at_rest() -> None:
    latitude = math.radians(52.0)
    _, gyro, accel = read_imu(Formula(lambda t: {}), earth_rotation=True, latitude_deg=52.0)
    expected = EARTH_RATE * np.array([0.0, math.cos(latitude), math.sin(latitude)])
    assert np.allclose(gyro, expected, atol=1e-18)
    assert np.array_equal(accel[0], [0.0, 0.0, G])


def test_coriolis_of_a_car_that_drives_east() -> None:
    """Eastward v: the Earth turns it away to the south and up; the sensor feels the opposite."""
    drive = Formula(lambda t: {"velocity": columns(30.0, 0, 0, like=t)})
    latitude = math.radians(40.0)
    _, _, accel = read_imu(drive, earth_rotation=True, latitude_deg=40.0)
    rate = 2.0 * EARTH_RATE * 30.0
    expected = [0.0, rate * math.sin(latitude), G - rate * math.cos(latitude)]
    assert np.allclose(accel, expected, atol=1e-15)


def test_earth_rate_and_lever_arm_are_those_of_an_inertial_frame() -> None:
    """A disc that turns at the pole: with the Earth's rate the total rate is what counts.

    An arm r at the rate w in the rotating world reads (w + W)^2 r inwards, less the centrifugal
    part W^2 r, which belongs to gravity.
    """
    w = 0.01
    spin = Formula(lambda t: {"angular_velocity": columns(0, 0, w, like=t)})
    values = {"imu.lever_arm": [100.0, 0.0, 0.0], "earth_rotation": True, "latitude_deg": 90.0}
    _, gyro, accel = read_imu(spin, **values)
    inwards = ((w + EARTH_RATE) ** 2 - EARTH_RATE**2) * 100.0
    assert np.allclose(accel[:, 0], -inwards, atol=1e-15)
    assert np.allclose(gyro[:, 2], w + EARTH_RATE, atol=1e-18)


def test_normal_gravity() -> None:
    """Table 3.4 of NIMA TR8350.2: gravity at the equator and at the poles."""
    assert normal_gravity(0.0, 0.0) == pytest.approx(9.7803253359, abs=1e-10)
    assert normal_gravity(math.pi / 2, 0.0) == pytest.approx(9.8321849378, abs=1e-9)
    accel = read_imu(Formula(lambda t: {}), gravity_model="wgs84", latitude_deg=48.0, height=500.0)[
        2
    ]
    assert accel[0, 2] == normal_gravity(math.radians(48.0), 500.0)


def test_normal_gravity_agrees_with_pyins() -> None:
    earth = pytest.importorskip("pyins.earth")
    for latitude in (-70.0, 0.0, 31.0, 48.0):
        for height in (0.0, 500.0, 5000.0):
            # pyins takes 1 - 2 h / a: next to 1 it leaves out flattening and centrifugal ratio,
            # below 0.7 % of the height term, and the second order, below 0.1 % of it at 5 km.
            expected = float(earth.gravity(latitude, height))
            height_term = 2.0 * 9.83 * height / SEMI_MAJOR_AXIS
            assert normal_gravity(math.radians(latitude), height) == pytest.approx(
                expected, abs=1e-8 + 0.008 * height_term
            )


def test_averaged_sampling_sums_to_the_change_of_velocity() -> None:
    """Without rotation the delta velocities are those of the trajectory, free of gravity."""

    def swing(t: np.ndarray) -> dict[str, np.ndarray]:
        return {
            "velocity": columns(np.sin(3 * t), 0, 0, like=t),
            "acceleration": columns(3 * np.cos(3 * t), 0, 0, like=t),
        }

    t, _, accel = read_imu(Formula(swing), 401, **{"imu.sampling": "averaged"})
    velocity = np.cumsum(accel[1:, 0]) * 0.005
    assert np.allclose(velocity, np.sin(3 * t[1:]), atol=1e-11)


def test_averaged_sampling_starts_with_the_value_at_the_start() -> None:
    _, instantaneous, force = read_imu(LECTURE, 1)
    _, averaged, mean_force = read_imu(LECTURE, 1, **{"imu.sampling": "averaged"})
    assert np.allclose(averaged, instantaneous, rtol=1e-15)
    assert np.allclose(mean_force, force, rtol=1e-15)
