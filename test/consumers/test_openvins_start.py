# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start of OpenVINS on a tour: the advice in its file against its own conditions."""

import numpy as np
import pytest

from imu_sim_ros.commands import generate
from imu_sim_ros.datasets.consumers.rig import InitialMotion, bad_starts
from imu_sim_ros.datasets.consumers.values import ImuValues
from imu_sim_ros.sensors.errors.realised import realise_imu
from imu_sim_ros.simulation.parameters import load_simulation

WINDOW = 2.0
"""init_window_time [s]."""
LEAST_FEATURES = 15


def disparity(t, feature, uv, oldest, newest):
    """Return mean disparity [px] and count of features seen twice in a span (FeatureHelper.h)."""
    span = (t > oldest) & (t <= newest)
    feature, uv = feature[span], uv[span]
    begins = np.flatnonzero(np.diff(feature, prepend=-1))
    ends = np.append(begins[1:], len(feature)) - 1
    moved = np.linalg.norm(uv[ends] - uv[begins], axis=1)[ends > begins]
    return (moved.mean(), len(moved)) if len(moved) else (0.0, 0)


def deviation(t, accel, oldest, newest):
    inner = accel[(t > oldest) & (t <= newest)]
    return np.sqrt(inner.var(axis=0, ddof=1).sum())


def start_of_openvins(folder, imu_thresh, max_disparity):
    """Return when the static initialisation succeeds [s]; None: never.

    InertialInitializer.cpp: still in the older half of the window, moved in the newer one;
    StaticInitializer.cpp, with wait_for_jerk: the same of the accelerometer.
    """
    readings = np.loadtxt(folder / "imu0.csv", delimiter=",", skiprows=1)
    tracks = np.genfromtxt(folder / "tracks.csv", delimiter=",", names=True, encoding="utf-8")
    t_imu = (readings[:, 0] - readings[0, 0]) * 1e-9
    t = (tracks["t_ns"] - readings[0, 0]) * 1e-9
    order = np.lexsort((t, tracks["id"]))
    t, feature = t[order], tracks["id"][order]
    uv = np.stack([tracks["u"], tracks["v"]], axis=1)[order]
    for time in np.unique(t[t > WINDOW + 0.1]):
        middle = time - 0.5 * WINDOW
        disparity_old, features_before = disparity(t, feature, uv, time - WINDOW - 0.1, middle)
        disparity_new, features_after = disparity(t, feature, uv, middle, time)
        if min(features_before, features_after) < LEAST_FEATURES:
            continue
        at_rest = deviation(t_imu, readings[:, 4:7], time - WINDOW, middle)
        shaken = deviation(t_imu, readings[:, 4:7], middle, time)
        still = disparity_old <= max_disparity and at_rest <= imu_thresh
        if still and disparity_new > max_disparity and shaken >= imu_thresh:
            return time
    return None


@pytest.mark.parametrize(
    ("place", "beginning", "advice", "generated"),
    [
        ("machine_hall", "lead_in.rest=2", (0.5, 5.0), (0.5, 10.0)),
        ("street", "lead_in.rest=2", (0.5, 3.0), (0.5, 5.0)),
        ("office", "rest_before=2.0", (0.1, 5.0), (0.5, 10.0)),
        ("street", "rest_before=2.0", (0.1, 2.0), (0.1, 5.0)),
    ],
)
def test_the_advice_on_tours_holds(tmp_path, place, beginning, advice, generated):
    """Init thresholds of the accelerometer [m/s^2] and of the disparity [px]; tracks with 1 px."""
    arguments = ["--trajectory", "tour", "--scene", place, "--camera", "euroc_cam0", "--quiet"]
    arguments += ["--format", "tracks", "--imu", "adis16448", "--duration", "6s"]
    arguments += ["--set", f"trajectory.{beginning}"]
    assert generate.main(["-o", str(tmp_path / "tour"), *arguments]) == 0
    assert start_of_openvins(tmp_path / "tour", *generated) is None
    start = start_of_openvins(tmp_path / "tour", *advice)
    assert start is not None
    assert start < 4.5


def biases(preset, seed):
    parameters = load_simulation({"imu.preset": preset, "seed": seed})
    imu = realise_imu(parameters.imu, seed)
    return ImuValues(imu, parameters.rate, 9.81, "/imu0")


def rest_and_jerk(up=(0.0, 0.0, 1.0)):
    t = np.arange(0.0, 5.0, 0.01)
    accel = np.outer(9.81 + np.where((t > 2.0) & (t < 3.0), 3.0 * np.sin(20.0 * t), 0.0), up)
    return InitialMotion(t, accel, np.where(t > 2.02, 0.5, 0.0))


@pytest.mark.parametrize(
    ("bias", "warned"),
    [
        ([0.045, 0.0, 0.0], True),
        ([0.0, -0.03, 0.0], False),
        ([0.025, 0.025, 0.0], False),
        ([0.03, 0.03, 0.0], True),
        ([0.0, 0.0, 0.4], False),  # along gravity, which the static start finds
    ],
)
def test_a_bias_across_gravity_is_compared_with_the_prior(bias, warned):
    """0.02 m/s^2, of which two standard deviations are allowed (StaticInitializer.cpp)."""
    parameters = load_simulation({"imu.preset": "perfect", "imu.accelerometer_bias": bias})
    values = ImuValues(parameters.imu, 200.0, 9.81, "/imu0")
    lines = [bad.line for bad in bad_starts(values, rest_and_jerk())]
    assert [line.startswith("OpenVINS: the accelerometer's bias") for line in lines] == [
        True
    ] * warned


def test_bad_starts_of_adis16448_are_said():
    """A turn-on bias of 20 mg across gravity exceeds 0.04 m/s^2 for 98 % of the seeds."""
    for seed in range(6):
        values = biases("adis16448", seed)
        across = np.linalg.norm(values.axes("accelerometer_bias")[:2])
        lines = [bad.line for bad in bad_starts(values, rest_and_jerk())]
        assert bool(lines) == bool(across > 0.04)
        assert not lines or f"{across:.2g} m/s^2 of it are across gravity" in lines[0]
