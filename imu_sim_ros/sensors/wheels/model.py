# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Wheels on the ground: rotation, counts of the encoders, and odometry.

A twist is (forward speed, sideways speed, yaw rate). The kinematics are those of R. Siegwart and
I. Nourbakhsh, "Introduction to Autonomous Mobile Robots", chapter 3; the odometry uses the nominal
radii and distances, the wheels have the true ones.
"""

import dataclasses
import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.random_streams import generator
from imu_sim_ros.core.types import Array
from imu_sim_ros.sensors.declaration import Mounted
from imu_sim_ros.sensors.errors.processes import Events
from imu_sim_ros.sensors.model import SensorModel
from imu_sim_ros.sensors.wheels.parameters import WheelsParameters
from imu_sim_ros.sensors.wheels.uncertainty import StatedCovariance, rows_times
from imu_sim_ros.sensors.world import TemperatureProfile, World
from imu_sim_ros.trajectory.motion import Motion

_LONGEST_LOOK: Final = 600.0
"""Longest part of a motion that warnings examine, in steps of 0.1 s [s]."""
_UNSEEN: Final = 0.01
"""Share of the largest speed above which a speed that no wheel measures has a warning."""
_LIFTED: Final = 0.05
"""Share of the largest speed above which a vertical speed, which springs cause, has a warning: the
way along the ground is then longer by half its square."""


def rim_speeds(model: str, track: float, wheelbase: float) -> Array:
    """Return J (m, 3), which maps a twist to the speeds of the wheels' rims without slip."""
    if model == "omnidirectional":
        arm = 0.5 * (track + wheelbase)
        sides = np.array([[-1.0, -arm], [1.0, arm], [1.0, -arm], [-1.0, arm]])
        return np.column_stack([np.ones(4), sides])
    return np.array([[1.0, 0.0, -0.5 * track], [1.0, 0.0, 0.5 * track]])


def wheel_positions(model: str, track: float, wheelbase: float) -> Array:
    """Return the contact points of the wheels (m, 3), from the point of the twist [m]."""
    ends = (0.5, -0.5) if model == "omnidirectional" else (0.0,)
    return np.array([[end * wheelbase, side * track, 0.0] for end in ends for side in (0.5, -0.5)])


def realise_wheels(p: WheelsParameters, seed: int, name: str) -> WheelsParameters:
    """Return the wheels of a seed, with its true radii, distances and offset.

    :param name: name of the wheels among the sensors.
    """

    def drawn(source: str, percent: float, count: int) -> Array:
        return 1.0 + 0.01 * percent * generator(seed, f"{name}.{source}").standard_normal(count)

    radii = p.radius * drawn("radius", p.radius_sigma_percent, p.wheels)
    base = np.array([p.track, p.wheelbase]) * drawn("base", p.base_sigma_percent, 1)
    offset = generator(seed, f"{name}.steering_offset").standard_normal()
    return dataclasses.replace(
        p,
        true_radii=p.true_radii or tuple(radii.tolist()),
        true_base=p.true_base or tuple(base.tolist()),
        steering_offset=p.steering_offset or (float(offset * p.steering_offset_sigma),),
    )


def point_twist(motion: Motion, lever_arm: Array, q_bs: Array) -> tuple[Array, Array]:
    """Return the velocity (n, 3) of a point of the body in a frame on it, and its derivative.

    :param lever_arm: (3,) position of the point [m], and q_bs (4,) the frame's orientation, in the
        body.
    """
    omega = motion.angular_velocity
    velocity = rotation.rotate_inverse(motion.q_wb, motion.velocity)
    rate = rotation.rotate_inverse(motion.q_wb, motion.acceleration) - np.cross(omega, velocity)
    return (
        rotation.rotate_inverse(q_bs[None], velocity + np.cross(omega, lever_arm)),
        rotation.rotate_inverse(
            q_bs[None], rate + np.cross(motion.angular_acceleration, lever_arm)
        ),
    )


class _Turns(NamedTuple):
    """Angles and speeds of m wheels, and perhaps of a steering, at n samples."""

    angle: Array
    """(n, m), or (n,) of a steering [rad]."""
    speed: Array
    """(n, m), or (n,) of a steering; means over the intervals before the samples [rad/s]."""

    def append(self, steering: "_Turns") -> "_Turns":
        """Return the wheels' values, and the steering's as the last column."""
        return _Turns(
            np.column_stack([self.angle, steering.angle]),
            np.column_stack([self.speed, steering.speed]),
        )


class Odometer(SensorModel[WheelsParameters]):
    """Encoders of all wheels, and the odometry that a robot computes from them."""

    parameters: WheelsParameters

    def __init__(self, mounted: Mounted[WheelsParameters], t0_ns: int, _: object) -> None:
        """Set up all errors at their start; the angles and the pose are 0 at the first reading."""
        super().__init__(mounted, t0_ns)
        name, environment, p = mounted.name, mounted.environment, self.parameters
        seed = environment.seed
        self._dt = 1.0 / p.rate
        self._unit = realise_wheels(p, seed, name)
        self._rims = rim_speeds(p.model, self._unit.true_base[0], self._unit.true_base[1])
        nominal_rims = rim_speeds(p.model, p.track, p.wheelbase)
        self._to_twist, self._to_true_twist = (
            np.asarray(np.linalg.pinv(rims), np.float64) for rims in (nominal_rims, self._rims)
        )
        self._stated = StatedCovariance(p, nominal_rims, self._to_twist)
        wheels = range(p.wheels)
        self._noise = [generator(seed, f"{name}.encoder.{k}") for k in wheels]
        self._slips = [generator(seed, f"{name}.slip.{k}") for k in wheels]
        self._patch_streams = [generator(seed, f"{name}.patch_slip.{k}") for k in wheels]
        self._steering = generator(seed, f"{name}.steering")
        self._patches = Events(seed, f"{name}.patch", p.patch_rate, p.patch_duration, self._dt)
        ambient = dataclasses.replace(
            environment.temperature, power=0.0, time_constant=p.temperature_time_constant
        )
        self._temperature = TemperatureProfile(ambient)
        self._last_twist: tuple[Array, Array] | None = None
        self._angle, self._last_counts = np.zeros(p.wheels), np.zeros(p.wheels)
        self._steered = np.zeros(2)
        self._start: tuple[Array, Array] | None = None
        self._pose = np.zeros(3)
        self._is_at_start = True

    def measure(self, t: Array, world: World) -> Mapping[str, Array]:
        """Return measured twists, means over the interval before each reading, and all truth."""
        p, motion = self.parameters, world.motion(t)
        velocity, rate = point_twist(motion, self.lever_arm_b, self.q_bs)
        omega, alpha = (
            rotation.rotate_inverse(self.q_bs[None], vector)
            for vector in (motion.angular_velocity, motion.angular_acceleration)
        )
        twist = np.column_stack([velocity[:, :2], omega[:, 2]])
        mean = self._mean(twist, np.column_stack([rate[:, :2], alpha[:, 2]]))
        # By slip in turns the wheels turn more than the vehicle.
        wheel_twist = mean * np.array([1.0, 1.0, 1.0 + p.turn_slip])
        rims, ratio = self._slip(rows_times(self._rims, wheel_twist), motion)
        temperature = self._temperature.at(t)
        warmer = temperature[:, None] - p.reference_temperature
        radius = np.array(self._unit.true_radii) * (1.0 + p.radius_temperature_coefficient * warmer)
        true, measured = self._turn(rims / radius)
        measured_twist = rows_times(self._to_twist, p.radius * measured.speed)
        with_slip = rows_times(self._to_true_twist, rims)
        if p.model == "ackermann":  # the steering determines the turn, not the wheels
            true_steering, steering = self._steer(wheel_twist)
            measured_twist[:, 2] = measured_twist[:, 0] * np.tan(steering.angle) / p.wheelbase
            slope = np.tan(true_steering.angle)
            with_slip[:, 2] = with_slip[:, 0] * slope / self._unit.true_base[1]
            true, measured = true.append(true_steering), measured.append(steering)
        return {
            "twist": measured_twist,
            "ideal_twist": mean,
            "true_twist": np.column_stack([velocity, omega]),
            "true_pose": self._relative(motion),
            "angle": measured.angle,
            "speed": measured.speed,
            "ideal_angle": true.angle,
            "ideal_speed": true.speed,
            "slip": with_slip - mean,
            "slip_ratio": ratio,
            "temperature": temperature,
            "true_radius": radius,
        }

    def complete(self, values: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return the pose that the readings add up to, and their covariance."""
        twist, angle = values["twist"], values["angle"]
        pose = self._integrate(twist)
        return {
            **values,
            "pose": pose,
            "covariance": self._stated.twist_covariance(twist, angle),
            "pose_covariance": self._stated.pose_covariance(pose, twist, angle),
        }

    def _mean(self, twist: Array, rate: Array) -> Array:
        """Return means over the intervals before n samples, by cubic Hermite polynomials."""
        if not len(twist):
            return twist
        first_twist, slope = self._last_twist or (twist[0], rate[0])
        previous = np.concatenate([first_twist[None], twist[:-1]])
        slopes = np.concatenate([slope[None], rate[:-1]])
        self._last_twist = twist[-1].copy(), rate[-1].copy()
        return 0.5 * (previous + twist) + self._dt / 12.0 * (slopes - rate)

    def _slip(self, rims: Array, motion: Motion) -> tuple[Array, Array]:
        """Return the speeds of the rims (n, m) [m/s] with slip, and their excess ratios (n, m).

        :param rims: (n, m) speeds of the rims of m wheels that roll on the ground.
        """
        ratio = self._patch_ratios(len(rims))
        if self.parameters.patch_boxes:
            ratio += self._box_ratios(motion)
        rims = rims * (1.0 + ratio)
        numbers = np.column_stack([stream.standard_normal(len(rims)) for stream in self._slips])
        noise = self.parameters.slip_noise * np.sqrt(np.abs(rims) / self._dt) * numbers
        return rims + noise, ratio

    def _patch_ratios(self, count: int) -> Array:
        """Return the excess ratios of the wheels on patches (count, m)."""
        ratio = np.zeros((count, len(self._patch_streams)))
        for rows, slip in self._patches.values(count, self._patch):
            ratio[rows] = slip
        return ratio

    def _patch(self) -> Array:
        """Return the excess ratio of each wheel (m,) on a patch that begins."""
        return self.parameters.patch_slip * np.array(
            [stream.random() for stream in self._patch_streams]
        )

    def _box_ratios(self, motion: Motion) -> Array:
        """Return the excess ratios of the wheels in boxes at their contact points (count, m)."""
        p = self.parameters
        touching = wheel_positions(p.model, *self._unit.true_base)
        wheels = self.lever_arm_b + rotation.rotate(self.q_bs[None], touching)
        ratio = np.zeros((len(motion.position), len(wheels)))
        for k, wheel in enumerate(wheels):
            contact = motion.position + rotation.rotate(motion.q_wb, wheel[None])
            for box in np.reshape(p.patch_boxes, (-1, 7)):
                in_box = ((contact >= box[:3]) & (contact <= box[3:6])).all(axis=1)
                ratio[:, k] = np.maximum(ratio[:, k], box[6] * in_box)
        return ratio

    def _turn(self, speed: Array) -> tuple[_Turns, _Turns]:
        """Return true angles and speeds (n, m) of m wheels, then both as measured.

        :param speed: (n, m) mean speeds over the intervals [rad/s].
        """
        noise = self.parameters.encoder_noise
        if not len(speed):
            return _Turns(speed, speed), _Turns(speed, speed)
        if self._is_at_start:
            start = np.array([stream.standard_normal() for stream in self._noise])
            self._angle = -speed[0] * self._dt
            self._last_counts = self._round_to_counts(self._angle + noise * start)
        turned = np.cumsum(np.concatenate([self._angle[None], speed * self._dt]), axis=0)
        drawn = np.column_stack([stream.standard_normal(len(speed)) for stream in self._noise])
        measured = np.concatenate(
            [self._last_counts[None], self._round_to_counts(turned[1:] + noise * drawn)]
        )
        self._angle, self._last_counts = turned[-1], measured[-1]
        measured_speed = np.diff(measured, axis=0) / self._dt
        return _Turns(turned[1:], speed), _Turns(measured[1:], measured_speed)

    def _round_to_counts(self, angle: Array) -> Array:
        """Return angles rounded to whole counts."""
        ticks = self.parameters.ticks
        return np.rint(angle * (ticks / math.tau)) * (math.tau / ticks) if ticks else angle

    def _steer(self, twist: Array) -> tuple[_Turns, _Turns]:
        """Return the steering's true angle and rate (n,) for a twist (n, 3), then as measured."""
        p, wheelbase = self.parameters, self._unit.true_base[1]
        moves = twist[:, 0] != 0.0
        ratio = np.divide(twist[:, 2], twist[:, 0], out=np.zeros(len(twist)), where=moves)
        true = np.clip(np.arctan(wheelbase * ratio), -p.steering_limit, p.steering_limit)
        noise = p.steering_noise * self._steering.standard_normal(len(twist))
        both = np.column_stack([true, true + self._unit.steering_offset[0] + noise])
        if not len(both):
            return _Turns(true, true), _Turns(true, true)
        previous = both[0] if self._is_at_start else self._steered
        rates = np.diff(np.concatenate([previous[None], both]), axis=0) / self._dt
        self._steered = both[-1]
        return _Turns(both[:, 0], rates[:, 0]), _Turns(both[:, 1], rates[:, 1])

    def _relative(self, motion: Motion) -> Array:
        """Return true poses (n, 7), x, y, z and q (w, x, y, z), relative to the first reading."""
        position, q_ws = self.position(motion), self.attitude(motion)
        if not len(position):
            return np.zeros((0, 7))
        if self._start is None:
            self._start = position[0].copy(), q_ws[0].copy()
        origin, first_q_ws = self._start
        moved = rotation.rotate_inverse(first_q_ws[None], position - origin)
        turned = rotation.multiply(rotation.conjugate(first_q_ws)[None], q_ws)
        return np.column_stack([moved, turned])

    def _integrate(self, twist: Array) -> Array:
        """Return poses (n, 3), x, y and yaw: each twist is an arc of one interval."""
        if not len(twist):
            return np.zeros((0, 3))
        way = twist * self._dt
        if self._is_at_start:
            way[0] = 0.0
            self._is_at_start = False
        yaw = np.cumsum(np.concatenate([self._pose[2:], way[:, 2]]))
        middle, chord = yaw[:-1] + 0.5 * way[:, 2], np.sinc(way[:, 2] / math.tau)
        forward, sideways = chord * way[:, 0], chord * way[:, 1]
        cosine, sine = np.cos(middle), np.sin(middle)
        steps = np.column_stack(
            [cosine * forward - sine * sideways, sine * forward + cosine * sideways]
        )
        positions = np.cumsum(np.concatenate([self._pose[None, :2], steps]), axis=0)
        poses = np.column_stack([positions, yaw])[1:]
        self._pose = poses[-1]
        return poses


def unmeasured_motion_warnings(
    mounted: Mounted[WheelsParameters], world: World, duration: float
) -> list[str]:
    """Return a line with the unmeasured motion, if it is not that of such a vehicle."""
    p = mounted.parameters
    trajectory = world.trajectory
    q_bs = rotation.from_matrix(np.reshape(p.mounting, (3, 3)))
    longest = min(duration, trajectory.duration, _LONGEST_LOOK)
    t = np.linspace(0.0, longest, 1 + math.ceil(10.0 * longest))[:-1]
    motion = trajectory.sample(t)
    velocity, _ = point_twist(motion, np.array(p.lever_arm), q_bs)
    forward, side, up = np.abs(velocity).max(axis=0, initial=0.0)
    limit = max(_UNSEEN * max(forward, side, up), 1e-3)
    rest = []
    if side > limit and p.model != "omnidirectional":
        rest.append(f"sideways at up to {side:.3g} m/s")
    if up > max(_LIFTED * max(forward, side, up), 1e-3):
        rest.append(f"up or down at up to {up:.3g} m/s")
    if p.model == "ackermann":
        speed, turn = np.abs(velocity[:, 0]), np.abs(motion.angular_velocity[:, 2])
        excess = turn - speed * math.tan(p.steering_limit) / p.wheelbase
        if excess.max(initial=0.0) > 1e-3:
            rest.append(f"turning by {excess.max():.3g} rad/s more than the steering can")
    if not rest:
        return []
    return [
        f"{mounted.name}: the body moves {' and '.join(rest)}, which {p.model} wheels neither do "
        "nor measure: wheel/odom is without it"
    ]
