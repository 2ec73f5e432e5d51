# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The wheels against closed forms, statistics and rosbags.

What holds for every sensor is in test_every_sensor.py.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

import imu_sim_ros as ims
from imu_sim_ros.commands import generate
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.wheels.model import realise_wheels
from imu_sim_ros.sensors.wheels.parameters import WheelsParameters
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

PERFECT: dict[str, Any] = {
    "encoder_noise": 0.0,
    "slip_noise": 0.0,
    "ticks": 0,
    "steering_noise": 0.0,
}
CIRCLE: dict[str, Any] = {
    "imu": "perfect",
    "trajectory": "circle",
    "rate": 100,
    "sensors": ["wheels"],
}
RADIUS, TRACK, BASE = 0.1, 0.5, 0.4
SPREAD: dict[str, Any] = {"radius_sigma_percent": 1.0, "base_sigma_percent": 2.0}
V, W = 2.5, 0.5
"""Speed and yaw rate of the trajectory circle: 5 m, 0.5 rad/s."""


def read_wheels(**wheels: Any) -> Any:
    """Return readings on a circle; names with an underscore in front are not the wheels'."""
    run = {"duration": wheels.pop("_duration", 20), "seed": wheels.pop("_seed", 5)}
    parameters = {"radius": RADIUS, "track": TRACK, "wheelbase": BASE, **wheels}
    return ims.simulate(**{**CIRCLE, **run}, wheels=parameters).wheels


def draw_seeds(count: int, **overrides: Any) -> list[Any]:
    """Return the blocks of many seeds on a circle of 4 s."""
    settings = {"sensors": ["wheels"], "imu.preset": "perfect", "trajectory.type": "circle"}
    values = {
        **settings,
        "rate": 50.0,
        "duration": 4.0,
        **{f"wheels.{k}": v for k, v in overrides.items()},
    }
    run = Body(load_simulation(values), sensors={"wheels"})
    blocks = (run.with_seed(seed).next(10**6) for seed in range(count))
    return [block["wheels"] for block in blocks]


@pytest.mark.parametrize(
    ("model", "speeds"),
    [
        ("differential", [V - W * TRACK / 2, V + W * TRACK / 2]),
        ("ackermann", [V - W * TRACK / 2, V + W * TRACK / 2, None]),
        ("omnidirectional", [V + s * W * (TRACK + BASE) / 2 for s in (-1, 1, -1, 1)]),
    ],
)
def test_a_circle_turns_wheels_as_the_closed_form_says(model: str, speeds: list[Any]) -> None:
    """v -+ w b / 2 over r; 1e-9 is the rounding of differences of angles over 0.02 s."""
    wheels = read_wheels(**PERFECT, model=model)
    for k, speed in enumerate(speeds):
        if speed is None:
            np.testing.assert_allclose(wheels.angle[:, k], np.arctan(BASE * W / V), atol=1e-12)
        else:
            np.testing.assert_allclose(wheels.speed[:, k], speed / RADIUS, rtol=0, atol=1e-9)
    np.testing.assert_allclose(wheels.twist, [[V, 0.0, W]] * len(wheels), rtol=0, atol=1e-9)
    np.testing.assert_allclose(wheels.pose[:, :2], wheels.true_pose[:, :2], rtol=0, atol=1e-8)
    np.testing.assert_allclose(wheels.pose[:, 2], W * 0.02 * np.arange(len(wheels)), atol=1e-9)
    np.testing.assert_allclose(wheels.slip, 0.0, atol=1e-12)


def test_mecanum_wheels_go_sideways() -> None:
    """Along y with the body's x ahead: front left and rear right turn back, the others forward."""
    flight = ims.simulate(
        imu="perfect", duration=4, rate=100, sensors=["wheels"],
        trajectory={"type": "harmonic", "y": {"polynomial": [0.0, 0.3]}},
        wheels={**PERFECT, "model": "omnidirectional", "radius": RADIUS},
    )  # fmt: skip
    np.testing.assert_allclose(flight.wheels.speed, [[-3.0, 3.0, 3.0, -3.0]] * 200, atol=1e-9)
    np.testing.assert_allclose(flight.wheels.twist[:, 1], 0.3, atol=1e-10)


def test_means_are_those_of_the_motion() -> None:
    """Harmonic speed against its integral: h^4 a w^5 / 720 = 4e-8 with h = 0.02 s."""
    motion = {"type": "harmonic", "x": {"amplitude": [1.0], "angular_frequency": [3.0]}}
    settings = {**CIRCLE, "trajectory": motion, "duration": 4}
    wheels = ims.simulate(**settings, wheels=PERFECT).wheels
    t = 0.02 * np.arange(len(wheels))
    np.testing.assert_allclose(wheels.twist[1:, 0], np.diff(np.sin(3.0 * t)) / 0.02, atol=1e-7)
    np.testing.assert_allclose(wheels.pose[:, 0], np.sin(3.0 * t), rtol=0, atol=1e-7)


def test_angles_are_whole_counts() -> None:
    wheels = read_wheels(encoder_noise=0.0, slip_noise=0.0, ticks=360)
    counts = wheels.angle / np.radians(1.0)
    np.testing.assert_allclose(counts, np.rint(counts), rtol=0, atol=1e-9)
    assert np.abs(wheels.angle - wheels.ideal_angle).max() <= np.radians(0.5) + 1e-12
    # Rounding of 1000 angles that step by 27 and 30 degrees is uniform: a tick / sqrt(12) ...
    wheels = read_wheels(encoder_noise=0.0, slip_noise=0.0, ticks=1000, radius=0.0987)
    error = (wheels.angle - wheels.ideal_angle) / (2 * np.pi / 1000)
    assert error.std() == pytest.approx(1 / np.sqrt(12), rel=0.05)  # 5 x 1 / sqrt(5 x 2000)


def test_true_radii_and_base_come_back_by_regression() -> None:
    """Radii from a straight line at 2 m/s, the base from turning on the spot at 1 rad/s.

    The angle at 0 is 0. A slope through 0 of n angles evenly up to T, each with noise s, has the
    deviation s sqrt(3 / n) / T; five of these, as a share of the slope. What is left of the base
    is from radii and angles: twice that.
    """
    noise, unit = 5e-4, realise_wheels(WheelsParameters(**SPREAD), 5, "wheels")
    line = {"type": "harmonic", "x": {"polynomial": [0.0, 2.0]}}
    spin = {"type": "harmonic", "yaw": {"polynomial": [0.0, 1.0]}}
    slopes, doubt = [], []
    for motion in (line, spin):
        parameters = {**PERFECT, **SPREAD, "encoder_noise": noise}
        settings = {**CIRCLE, "trajectory": motion, "duration": 20, "seed": 5}
        wheels = ims.simulate(**settings, wheels=parameters).wheels
        t = 0.02 * np.arange(len(wheels))
        slopes.append((t @ wheels.angle) / (t @ t))
        doubt.append(5 * noise * np.sqrt(3 / len(t)) / t[-1] / np.abs(slopes[-1]).min())
    radii = 2.0 / slopes[0]
    np.testing.assert_allclose(radii, unit.true_radii, rtol=doubt[0])
    bases = 2.0 * radii * slopes[1] * [-1.0, 1.0]
    np.testing.assert_allclose(bases, unit.true_base[0], rtol=2 * max(doubt))
    # The spreads are far larger than what is in doubt, and those of other seeds are others.
    assert doubt[1] < 1e-4 < abs(unit.true_radii[0] / unit.true_radii[1] - 1.0)
    assert unit.true_base != realise_wheels(WheelsParameters(**SPREAD), 6, "wheels").true_base


def test_given_radii_and_base_are_taken() -> None:
    wheels = read_wheels(**PERFECT, true_radii=[0.101, 0.099], true_base=[0.52, 0.4])
    rims = np.array([V - W * 0.26, V + W * 0.26])
    expected = rims / [0.101, 0.099]
    np.testing.assert_allclose(wheels.speed, [expected] * len(wheels), atol=1e-9)
    left_speed, right_speed = RADIUS * expected
    np.testing.assert_allclose(wheels.twist[:, 0], (left_speed + right_speed) / 2, atol=1e-9)
    np.testing.assert_allclose(wheels.twist[:, 2], (right_speed - left_speed) / TRACK, atol=1e-9)


def test_slip_in_turns_and_on_patches() -> None:
    turned = read_wheels(**PERFECT, turn_slip=0.25)
    np.testing.assert_allclose(turned.twist[:, 2], 1.25 * W, atol=1e-9)
    np.testing.assert_allclose(turned.slip[:, 2], 0.25 * W, atol=1e-9)
    wheels = read_wheels(
        **PERFECT, patch_rate=0.1, patch_duration=2.0, patch_slip=0.4, _duration=2000
    )
    # Patches of 2 s, 10 s apart: a share of 2 / 12, known by 170 of them to 8 %; five of these.
    slips = wheels.slip_ratio[:, 0] > 0.0
    assert slips.mean() == pytest.approx(1.0 / 6.0, rel=0.4)
    assert 0.3 < wheels.slip_ratio.max() <= 0.4
    off = np.abs(wheels.twist - wheels.ideal_twist).max(axis=1) > 1e-6
    assert np.array_equal(off, slips)
    rims = np.array([V - W * TRACK / 2, V + W * TRACK / 2])
    np.testing.assert_allclose(wheels.speed * RADIUS, rims * (1 + wheels.slip_ratio), atol=1e-6)


@pytest.mark.parametrize("model", ["differential", "ackermann", "omnidirectional"])
def test_the_stated_covariance_is_that_of_the_errors(model: str) -> None:
    """NEES of one reading of each of 100 seeds, with all errors that it knows.

    Their sum is chi-square with 100 d degrees of freedom; the band leaves out 1e-4 on each side.
    The covariance is that at the twist as read, which changes it by some percent of itself.
    """
    blocks = draw_seeds(
        100, model=model, radius_sigma_percent=1.0, base_sigma_percent=2.0, ticks=2000,
        steering_offset_sigma=0.003, slip_noise=0.005,
    )  # fmt: skip
    components = [0, 1, 2] if model == "omnidirectional" else [0, 2]
    error = np.array([(b.twist - b.ideal_twist)[100, components] for b in blocks])
    covariance = np.array([b.covariance[100][np.ix_(components, components)] for b in blocks])
    nees = np.einsum("ki,kij,kj->k", error, np.linalg.inv(covariance), error)
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], 100 * len(components))
    assert low < nees.sum() < high


@pytest.mark.parametrize("model", ["differential", "ackermann", "omnidirectional"])
def test_the_covariance_of_wheels_at_rest_can_be_inverted(model: str) -> None:
    """The smallest part, yaw rates of a car at rest v tan(angle) / L, is 1e-5 rad/s at least."""
    settings = {**CIRCLE, "trajectory": "static", "duration": 5}
    wheels = ims.simulate(**settings, wheels={"model": model}).wheels
    assert np.linalg.eigvalsh(wheels.covariance).min() > 1e-10


def test_a_smaller_spread_than_stated_shows() -> None:
    """With radii that are true, NEES falls below the band: the test above can fail."""
    blocks = draw_seeds(100, radius_sigma_percent=1.0, true_radii=[0.1, 0.1])
    error = np.array([(b.twist - b.ideal_twist)[100, [0, 2]] for b in blocks])
    covariance = np.array([b.covariance[100][np.ix_([0, 2], [0, 2])] for b in blocks])
    nees = np.einsum("ki,kij,kj->k", error, np.linalg.inv(covariance), error)
    assert nees.sum() < chi2.ppf(1e-4, 200)


def test_noisy_wheels_do_not_depend_on_blocks() -> None:
    settings = {
        "sensors": ["wheels"],
        "imu.preset": "perfect",
        "trajectory.type": "figure_eight",
        "duration": 5.0,
        "wheels.preset": "f1tenth",
        "wheels.patch_rate": 2.0,
        "wheels.patch_slip": 0.3,
        "wheels.patch_boxes": [0.0, 0.0, -9.0, 9.0, 9.0, 9.0, 0.1],
        "wheels.radius_temperature_coefficient": 1e-4,
        "temperature.power": 1.0,
    }
    whole = Body(load_simulation(settings), sensors={"wheels"}).next(10**6)
    parts = list(Body(load_simulation(settings), sensors={"wheels"}).windows(1))
    for name in (
        "pose",
        "twist",
        "covariance",
        "pose_covariance",
        "angle",
        "speed",
        "slip",
        "true_pose",
    ):
        joined = np.concatenate([getattr(part["wheels"], name) for part in parts])
        assert np.array_equal(joined, getattr(whole["wheels"], name)), name


@pytest.mark.parametrize("name", ["a.mcap", "a.bag", "a"])
def test_rosbags_reads_what_was_simulated(tmp_path: Path, name: str) -> None:
    pytest.importorskip("rosbags")
    from rosbags.highlevel import AnyReader

    flight = ims.simulate(**CIRCLE, duration=2, seed=3, wheels={"preset": "f1tenth"})
    wheels = flight.wheels
    path = flight.save(tmp_path / name)
    messages: dict[str, list[Any]] = {}
    with AnyReader([path]) as reader:
        for connection, _, content in reader.messages():
            message = reader.deserialize(content, connection.msgtype)
            messages.setdefault(connection.topic, []).append(message)
    odometry, joints = messages["/wheel/odom"], messages["/joint_states"]
    assert len(odometry) == len(joints) == len(wheels) == 100
    assert (odometry[0].header.frame_id, odometry[0].child_frame_id) == ("odom", "base_link")
    for k in (0, 1, 57, 99):
        twist = odometry[k].twist.twist
        assert [twist.linear.x, twist.linear.y, twist.angular.z] == wheels.twist[k].tolist()
        stated = np.reshape(odometry[k].twist.covariance, (6, 6))
        assert np.array_equal(stated[np.ix_([0, 1, 5], [0, 1, 5])], wheels.covariance[k])
        assert stated[2, 2] == stated[3, 3] == 1e6
        stated = np.reshape(odometry[k].pose.covariance, (6, 6))
        assert np.array_equal(stated[np.ix_([0, 1, 5], [0, 1, 5])], wheels.pose_covariance[k])
        assert stated[2, 2] == stated[3, 3] == stated[4, 4] == 1e6
        place = odometry[k].pose.pose.position
        assert [place.x, place.y] == wheels.pose[k, :2].tolist()
        assert np.array_equal(joints[k].position, wheels.angle[k])
        assert np.array_equal(joints[k].velocity, wheels.speed[k])
        assert len(joints[k].effort) == 0
    assert joints[0].name[2] == "front_steering_joint"
    truth = messages["/ground_truth/wheel_odom"][57]
    assert truth.pose.pose.position.x == wheels.true_pose[57, 0]
    assert truth.twist.twist.angular.z == wheels.true_twist[57, 5]
    assert (
        len(messages["/ground_truth/joint_states"])
        == len(messages["/ground_truth/wheel_slip"])
        == 100
    )


@pytest.mark.parametrize("name", files.names("wheels"))
def test_presets_have_sources_and_run(name: str, tmp_path: Path) -> None:
    assert "# [1] " in files.find("wheels", name).read_text(encoding="utf-8")
    argv = ["-o", str(tmp_path / "a"), "--format", "csv", "--duration", "2s", "--wheels", name]
    assert generate.main([*argv, "--trajectory", "circle", "--quiet"]) == 0
    header, *rows = (tmp_path / "a/wheels0.csv").read_text().splitlines()
    assert header.startswith("timestamp,x,y,yaw,speed_x")
    wheels = ims.simulate(**CIRCLE, duration=2, wheels={"preset": name}).wheels
    assert len(rows) == len(wheels)
    # A Husky's odometry knows its slip: all yaw rates are right but for the spreads, 5 % at most.
    assert wheels.twist[:, 2].mean() == pytest.approx(W, rel=0.25)
    truth = files.load(tmp_path / "a_truth_wheels.yaml")
    assert len(truth["wheels.true_radii"]) in (2, 4)
    assert len(truth["wheels.true_base"]) == 2


def test_the_truth_file_simulates_the_same_wheels(tmp_path: Path) -> None:
    argv = ["--duration", "2s", "--trajectory", "circle", "--imu", "perfect", "--quiet"]
    argv += ["--format", "csv", "--seed", "8"]
    wheel_options = ["--wheels", "turtlebot3_burger"]
    assert generate.main(["-o", str(tmp_path / "a"), *wheel_options, *argv]) == 0
    truth = ["--params-file", str(tmp_path / "a_truth_wheels.yaml")]
    assert generate.main(["-o", str(tmp_path / "b"), *truth, *argv]) == 0
    table, other_table = ((tmp_path / f"{n}/wheels0.csv").read_text() for n in "ab")
    assert table == other_table


def warnings(**settings: Any) -> list[str]:
    values = {"sensors": ["wheels"], "imu.preset": "perfect", "duration": 10.0, **settings}
    body = Body(load_simulation(values), sensors=values["sensors"])
    return [w for w in body.warnings() if w.startswith("wheels")]


def test_motion_that_wheels_cannot_do_is_told_in_a_line() -> None:
    still = {"trajectory.type": "harmonic", "trajectory.x.polynomial": [0.0, 1.0]}
    side = {**still, "trajectory.y.polynomial": [0.0, 0.25]}
    assert warnings(**{"trajectory.type": "circle"}) == []
    assert warnings(**still) == []
    (line,) = warnings(**side)
    assert "sideways at up to 0.25 m/s, which differential wheels" in line
    assert warnings(**side, **{"wheels.model": "omnidirectional"}) == []
    (line,) = warnings(**side, **{"trajectory.z.polynomial": [0.0, 0.1]})
    assert "sideways at up to 0.25 m/s and up or down at up to 0.1 m/s" in line
    spin = {"trajectory.type": "harmonic", "trajectory.yaw.polynomial": [0.0, 0.5]}
    assert warnings(**spin) == []
    (line,) = warnings(**spin, **{"wheels.model": "ackermann"})
    assert "turning by 0.5 rad/s more than the steering can" in line


@pytest.mark.parametrize(
    ("parameters", "line"),
    [
        ({"preset": "huskey"}, "unknown wheels 'huskey'"),
        ({"true_radii": [0.1, 0.1, 0.1]}, "true_radii"),
        ({"joint_names": ["a"]}, "joint_names .* must be empty or 2"),
        ({"patch_rate": 1.0}, "must both be 0 or both be above 0"),
        ({"patch_boxes": [0, 0, 0, 1, 1, 0, 0.1]}, "least must be below largest"),
        ({"patch_boxes": [0, 0, 0, 1, 1, 1, -0.1]}, "slip -0.1: must be between 0 and 100"),
    ],
)
def test_bad_parameters_are_refused_by_name(parameters: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigurationError, match=line):
        read_wheels(**parameters)


def test_warm_wheels_are_larger() -> None:
    """On 30 degC instead of 20, with 1e-3 per kelvin: one percent fewer turns, and less way."""
    settings = {
        **CIRCLE,
        "duration": 4,
        "temperature": {"profile": [0.0, 20.0, 2.0, 20.0, 2.02, 30.0]},
        "wheels": {
            **PERFECT,
            "radius_temperature_coefficient": 1e-3,
            "reference_temperature": 20.0,
            "true_radii": [0.1, 0.2],
        },
    }
    wheels = ims.simulate(**settings).wheels
    cold = wheels.true_t_ns - wheels.true_t_ns[0] <= 2_000_000_000
    assert (cold.sum(), len(cold)) == (101, 200)
    np.testing.assert_allclose(wheels.temperature, np.where(cold, 20.0, 30.0), atol=1e-6)
    grown = np.where(cold, 1.0, 1.01)[:, None]
    np.testing.assert_allclose(wheels.true_radius, grown * [0.1, 0.2], rtol=1e-9)
    rims = np.array([V - W * TRACK / 2, V + W * TRACK / 2])
    np.testing.assert_allclose(wheels.speed, rims / (grown * [0.1, 0.2]), rtol=1e-8)
    np.testing.assert_allclose(wheels.slip, 0.0, atol=1e-12)


def test_wheels_follow_the_temperature_slowly() -> None:
    """After a step and one time constant, 1 - 1/e of it are left behind."""
    settings = {
        **CIRCLE,
        "duration": 10,
        "temperature": {"profile": [0.0, 20.0, 1.0, 30.0], "interpolation": "steps", "power": 5.0},
    }
    wheels = ims.simulate(**settings, wheels={"temperature_time_constant": 4.0}).wheels
    t = (wheels.true_t_ns - wheels.true_t_ns[0]) * 1e-9
    expected = np.where(t < 1.0, 20.0, 30.0 - 10.0 * np.exp(-(t - 1.0) / 4.0))
    np.testing.assert_allclose(wheels.temperature, expected, atol=1e-6)


def test_only_the_wheel_in_the_box_slips() -> None:
    """Along x at 1 m/s with wheels 0.25 m to both sides; ice where y > 0, from 1 to 2 m."""
    motion = {"type": "harmonic", "x": {"polynomial": [0.0, 1.0]}}
    parameters = {**PERFECT, "radius": RADIUS, "track": TRACK}
    box = [1.0, 0.0, -1.0, 2.0, 9.0, 1.0, 0.2]
    settings = {**CIRCLE, "trajectory": motion, "duration": 3}
    wheels = ims.simulate(**settings, wheels={**parameters, "patch_boxes": box}).wheels
    x = 0.02 * np.arange(len(wheels))
    on_ice = (x > 0.999) & (x < 2.001)
    assert on_ice.sum() == 51
    slip = np.where(on_ice, 0.2, 0.0)
    np.testing.assert_array_equal(wheels.slip_ratio, np.column_stack([slip, 0.0 * slip]))
    np.testing.assert_allclose(wheels.speed[:, 0], (1.0 + slip) / RADIUS, atol=1e-9)
    np.testing.assert_allclose(wheels.slip[:, 0], slip / 2.0, atol=1e-9)
    np.testing.assert_allclose(wheels.slip[:, 2], -slip / TRACK, atol=1e-9)
    # Two boxes that overlap are as slippery as the worse of both, and all four wheels take part.
    parameters = {**parameters, "model": "omnidirectional", "wheelbase": BASE}
    wide = [-9.0, -9.0, -1.0, 9.0, 9.0, 1.0, 0.1]
    wheels = ims.simulate(**settings, wheels={**parameters, "patch_boxes": [*box, *wide]}).wheels
    wheel_x = x[:, None] + BASE / 2 * np.array([1.0, 1.0, -1.0, -1.0])
    crossing = (wheel_x > 0.999) & (wheel_x < 2.001) & np.array([True, False, True, False])
    np.testing.assert_array_equal(wheels.slip_ratio, np.where(crossing, 0.2, 0.1))
