# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings about messages that arrive one by one: units of readings, the twist of odometry."""

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.core.records import LiveReading, LiveState, States, replace_fields
from imu_sim_ros.core.rotation import (
    exp,
    from_euler,
    multiply,
    normalise,
    rotate,
    rotate_inverse,
)
from imu_sim_ros.recordings.findings.catalogue import state_findings
from imu_sim_ros.recordings.findings.live import TwistWatch, UnitWatch

MOVING = ("circle", "figure_eight", "lecture")
FRAMES = ("body", "world")


def messages(truth, velocity, rate):
    """Return the contents of messages of odometry."""
    columns = (truth.t_ns.tolist(), truth.position, truth.q_wb, velocity, rate)
    return [
        LiveState(t_ns, tuple(p), tuple(q), tuple(v), tuple(w))
        for t_ns, p, q, v, w in zip(*columns, strict=True)
    ]


def in_body(truth):
    return rotate_inverse(truth.q_wb, truth.velocity)


@pytest.fixture(scope="module", params=[(name, rate) for name in MOVING for rate in (30, 250)])
def truth(request):
    name, rate = request.param
    return ims.simulate(trajectory=name, rate=rate, duration=12, imu="perfect").truth


def watched(truth, twist_frame, velocity, rate):
    """Return kinds of the findings, and the time of the last message that was taken [s]."""
    watch = TwistWatch("odom", twist_frame)
    for state in messages(truth, velocity, rate):
        findings = watch.add([state])
        if findings:
            return {f.kind for f in findings}, (state.t_ns - int(truth.t_ns[0])) * 1e-9
    return set(), None


@pytest.mark.parametrize("declared", FRAMES)
@pytest.mark.parametrize("sent", FRAMES)
def test_a_twist_in_other_axes_is_told_within_a_second_of_motion(truth, declared, sent):
    velocity, rates = in_body(truth), truth.angular_velocity
    if sent == "world":
        velocity, rates = truth.velocity, rotate(truth.q_wb, rates)
    kinds, time_s = watched(truth, declared, velocity, rates)
    if declared == sent:
        assert kinds == set()
        return
    assert kinds == {"twist_world" if sent == "world" else "twist_body"}
    # The two axes tell apart once the body has turned, and moves.
    turned = np.linalg.norm(in_body(truth) - truth.velocity, axis=1)
    speed = np.linalg.norm(truth.velocity, axis=1)
    differs = (turned > 0.5 * speed) & (speed > 0.1)
    begins = float(truth.t[np.argmax(differs)])
    assert time_s < begins + 1.1


def test_a_twist_that_is_not_filled_is_told(truth):
    zeros = np.zeros_like(truth.velocity)
    assert watched(truth, "body", zeros, truth.angular_velocity)[0] == {"twist_unfilled"}
    kinds, _ = watched(truth, "body", in_body(truth), zeros)
    assert kinds == {"twist_unfilled"}


def turning(rate, noise):
    """Return a second of a body that turns about an axis across its own, without moving."""
    t = np.arange(0.0, 1.1, 1.0 / rate)
    roll, yaw = np.full_like(t, 0.6), 0.8 * t
    rng = np.random.default_rng(1)
    q_wb = multiply(from_euler(np.stack([roll, 0.0 * t, yaw], axis=1)),
                    exp(noise * rng.standard_normal((len(t), 3))))  # fmt: skip
    t_ns = np.round(t * 1e9).astype(np.int64)
    rates_w = np.tile([0.0, 0.0, 0.8], (len(t), 1))
    position = noise * rng.standard_normal((len(t), 3))
    return States(t_ns, position, q_wb, 0.0 * rates_w, rotate_inverse(q_wb, rates_w))


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("rate", [10, 100, 1000])
def test_angular_rates_in_the_axes_of_the_world_are_told_without_a_motion(rate, noise):
    truth = turning(rate, noise)
    rates_w = rotate(truth.q_wb, truth.angular_velocity)
    assert watched(truth, "body", truth.velocity, rates_w)[0] == {"twist_world"}
    assert watched(truth, "world", truth.velocity, truth.angular_velocity)[0] == {"twist_body"}
    assert watched(truth, "body", truth.velocity, truth.angular_velocity)[0] == set()


@pytest.mark.parametrize("rate", [10, 100, 1000])
def test_noise_of_poses_at_rest_is_no_motion(rate):
    truth = turning(rate, 5e-3)
    still = replace_fields(truth, q_wb=truth.q_wb[:1] + 1e-3 * truth.position[:, [0, 0, 1, 2]])
    still = replace_fields(still, q_wb=normalise(still.q_wb), angular_velocity=0.0 * truth.velocity)
    assert watched(still, "body", still.velocity, still.angular_velocity)[0] == set()
    assert not [f for f in state_findings(still) if f.kind.startswith("twist")]


def test_a_body_at_rest_says_nothing_of_its_twist():
    truth = ims.simulate(trajectory="static", rate=100, duration=5, imu="perfect").truth
    assert watched(truth, "body", truth.velocity, truth.angular_velocity)[0] == set()


@pytest.mark.parametrize("rate", [25, 100, 400])
@pytest.mark.parametrize("trajectory", ["static", "figure_eight"])
@pytest.mark.parametrize(
    ("factors", "kind"),
    [
        ((1.0, 1.0), None),
        ((1.0, 1.0 / 9.80665), "accelerometer_g"),
        ((1.0, 1e3 / 9.80665), "accelerometer_mg"),
        ((180.0 / np.pi, 1.0), "gyroscope_degrees"),
    ],
)
def test_units_are_told_after_the_start(rate, trajectory, factors, kind):
    readings = ims.simulate(imu="mpu6000", trajectory=trajectory, rate=rate, duration=4).readings
    watch, kinds = UnitWatch("imu"), []
    gyro, accel = (readings.gyro * factors[0]).tolist(), (readings.accel * factors[1]).tolist()
    for t_ns, w, f in zip(readings.t_ns.tolist(), gyro, accel, strict=True):
        kinds += [finding.kind for finding in watch.add(LiveReading(t_ns, tuple(w), tuple(f)))]
        if watch.done:
            break
    # Without a finding at rest the watch goes on: a unit may show in motion alone.
    assert watch.done == (kind is not None or trajectory != "static")
    assert kinds == ([] if kind is None else [kind])


def test_a_unit_that_motion_alone_shows_is_told_when_it_moves():
    """A gyroscope without noise in deg/s reads like one in rad/s until the body turns."""
    still, moving = (
        ims.simulate(imu="perfect", trajectory=name, rate=100, duration=20).readings
        for name in ("static", "tumble")
    )
    gyro = np.degrees(np.concatenate([still.gyro, moving.gyro])).tolist()
    accel = np.concatenate([still.accel, moving.accel]).tolist()
    watch, kind_rows = UnitWatch("imu"), []
    for row, (w, f) in enumerate(zip(gyro, accel, strict=True)):
        if not watch.done:
            reading = LiveReading(row * 10_000_000, tuple(w), tuple(f))
            kind_rows += [(finding.kind, row) for finding in watch.add(reading)]
    ((kind, row),) = kind_rows
    assert kind == "gyroscope_degrees"
    assert 2000 < row < 3800
