# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The time shift between camera and IMU in the stacks' files is the one that correlation finds."""

import json

import numpy as np
import pytest
import yaml
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from imu_sim_ros.datasets.configurations import imu_values, rig_values
from imu_sim_ros.datasets.consumers.folder import write_all
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

RIG = {
    "imu.preset": "perfect",
    "trajectory.type": "excitation",
    "duration": 8.0,
    "rate": 200.0,
    "cameras": ["cam0", "cam1"],
    "camera.preset": "euroc_cam0",
    "cam1.camera.time_offset": 0.007,
    "camera.body_axes": "flu",
}
CASES = {
    "stamps": {"imu.stamp_offset": 0.005},
    "low-pass": {"imu.gyroscope_bandwidth": 40.0, "imu.accelerometer_bandwidth": 40.0},
    "third order": {"imu.gyroscope_bandwidth": 30.0, "imu.bandwidth_order": 3},
    "averaged": {"imu.sampling": "averaged"},
    "oversampled": {
        "imu.sampling": "oversampled",
        "imu.gyroscope_bandwidth": 50.0,
        "imu.accelerometer_bandwidth": 50.0,
    },
    "all": {
        "imu.stamp_offset": -0.003,
        "imu.gyroscope_bandwidth": 40.0,
        "camera.time_offset": 0.002,
        "imu.sampling": "averaged",
    },
}


def shifts_by_correlation(parameters):
    """Return s [s] of each camera: the gyroscope's readings at t_cam + s are its rates."""
    body = Body(parameters, sensors={"cam0", "cam1"})
    windows = list(body.windows(400))
    stamps = np.concatenate([window["imu"].t_ns for window in windows])
    rates = np.concatenate([window["imu"].gyro for window in windows])
    start = stamps[0]
    gyro = CubicSpline((stamps - start) * 1e-9, rates)
    return [
        shift_of_camera([window[name] for window in windows], body, start, gyro)
        for name in ("cam0", "cam1")
    ]


def shift_of_camera(blocks, body, start, gyro):
    """Return s [s] for the frames of a camera; the gyroscope's times begin at start [ns]."""
    frames = [block.t_ns for block in blocks]
    exposures = [block.true_t_ns for block in blocks]
    true_t = (np.concatenate(exposures) - body.t0_ns) * 1e-9
    t_cam = (np.concatenate(frames) - start) * 1e-9
    inner = (true_t > 0.5) & (true_t < 7.5)
    motion = body.trajectory.sample(true_t[inner])
    expected = motion.angular_velocity

    def misfit(s):
        return np.square(gyro(t_cam[inner] + s) - expected).sum()

    return minimize_scalar(misfit, bounds=(-0.03, 0.03), method="bounded").x


def shifts(folder):
    """Return the time shift [s] of each file, of cam1 with "2", and the texts."""
    texts = {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}

    def parsed(name):
        text = texts[name].removeprefix("%YAML:1.0\n").replace("!!opencv-matrix", "")
        return yaml.safe_load(text)

    basalt = json.loads(texts["basalt_calibration.json"])["value0"]["cam_time_offset_ns"]
    return {
        "kalibr": parsed("camchain.yaml")["cam0"]["timeshift_cam_imu"],
        "kalibr 2": parsed("camchain.yaml")["cam1"]["timeshift_cam_imu"],
        "OpenVINS": parsed("kalibr_imucam_chain.yaml")["cam0"]["timeshift_cam_imu"],
        "OpenVINS 2": parsed("kalibr_imucam_chain.yaml")["cam1"]["timeshift_cam_imu"],
        "VINS-Mono": parsed("vins_mono.yaml")["td"],
        "VINS-Fusion": parsed("vins_fusion.yaml")["td"],
        "Basalt": basalt * 1e-9,
    }, texts


@pytest.mark.parametrize("case", CASES)
def test_every_stack_has_the_shift_that_correlation_finds(tmp_path, case):
    """Motions of up to 2 Hz: the delay of a low-pass at 30 Hz is constant to 0.3 % there."""
    parameters = load_simulation({**RIG, **CASES[case]})
    true_shift, second_shift = shifts_by_correlation(parameters)
    values = imu_values(parameters, "/imu0")
    write_all(tmp_path / "configs", values, rig_values(values, parameters, {}), parameters)
    stated, texts = shifts(tmp_path / "configs")
    for stack, shift in stated.items():
        truth = second_shift if stack.endswith("2") else true_shift
        assert shift == pytest.approx(truth, abs=1e-4), stack
    assert abs(true_shift) > 1e-3
    # Where there is no place for it, the file says so.
    orb = " ".join(texts["orb_slam3_mono_inertial.yaml"].replace("\n#", " ").split())
    assert "time_offset = " in orb
    for name in ("camchain.yaml", "kalibr_imucam_chain.yaml", "vins_mono.yaml", "imu.yaml"):
        lines = texts[name].replace("\n#  ", " ").splitlines()
        remarks = [line for line in lines if "not expressible" in line]
        assert not any("stamp_offset" in line or "time_offset" in line for line in remarks), name
    differs = case in ("third order", "all")
    lag = "The readings of the accelerometer lag by"
    assert (lag in " ".join(texts["camchain.yaml"].replace("\n#", " ").split())) == differs


def test_an_axis_that_lags_more_is_named():
    rig = {**RIG, "imu.gyroscope_bandwidth": [40.0, 40.0, 20.0]}
    parameters = load_simulation(rig)
    (line,) = [
        line
        for line in imu_values(parameters, "/imu0").delay_remarks()
        if line.startswith("The readings of the gyroscope")
    ]
    # sqrt(2) / (2 pi f), warped by the bilinear transform at 200 Hz.
    slow = np.sqrt(2.0) / (400.0 * np.tan(np.pi * 20.0 / 200.0))
    assert f"{slow:.6g} s (x, y, z)" in line
