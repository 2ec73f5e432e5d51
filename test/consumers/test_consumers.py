# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The stacks' files against the equations of the stacks' own sources, written down here again."""

import dataclasses
import json

import numpy as np
import pytest
import yaml

from imu_sim_ros.datasets.consumers.folder import write_all
from imu_sim_ros.datasets.consumers.values import ImuValues
from imu_sim_ros.parameters.sections import flatten, parameters
from imu_sim_ros.sensors.errors.realised import realise_imu
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

RATE = 200.0
FULL = {
    "imu.gyroscope_scale_misalignment": [1.02, 0.01, -0.02, 0.005, 0.98, 0.01, 0.0, 0.02, 1.01],
    "imu.accelerometer_scale_error_percent": [1.0, -2.0, 0.5],
    "imu.accelerometer_misalignment_percent": [0.3, -0.4, 0.5, 0.6, -0.7, 0.8],
    "imu.gyroscope_g_sensitivity": [1e-3, 0, 2e-3, 0, -1e-3, 0, 3e-4, 0, 1e-3],
    "imu.gyroscope_bias": [0.01, -0.02, 0.03],
    "imu.accelerometer_bias": [0.1, 0.2, -0.3],
    "imu.gyroscope_turn_on_bias_sigma": 0.1,
    "imu.accelerometer_turn_on_bias_sigma": 0.5,
    "imu.gyroscope_turn_on_scale_sigma": 0.03,
    "imu.accelerometer_turn_on_scale_sigma": 0.03,
}
LOWER = {
    **FULL,
    "imu.accelerometer_misalignment_percent": [0, 0, 0.5, 0, -0.7, 0.8],
}


def simulated(**values):
    """Return a noise-free sensor with large errors, and its readings."""
    chosen = {"imu.preset": "perfect", "trajectory.type": "excitation", "seed": 3, "rate": RATE}
    loaded = load_simulation({**chosen, **values})
    return loaded, Body(loaded).next(400)["imu"]


def files(folder, loaded, duration=7200.0):
    values = ImuValues(realise_imu(loaded.imu, loaded.seed), loaded.rate, 9.81, "/imu0", duration)
    write_all(folder, values)
    return {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}


def parsed(text):
    """Parse YAML as OpenCV writes it, without its directive."""
    return yaml.safe_load(text.removeprefix("%YAML:1.0\n").removeprefix("---\n"))


def chain(text):
    imu = parsed(text)["imu0"]
    names = ("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC", "Tg")
    return [np.array(imu[name], dtype=float) for name in names]


def test_a_seed_realised_gives_the_same_readings():
    loaded, block = simulated(
        **FULL,
        **{
            "imu.gyroscope_temperature_scale": [1e-3, 2e-3, 3e-3],
            "imu.accelerometer_quadratic": [1e-3, 0, -1e-3],
            "temperature.value": 45.0,
        },
    )
    again = dataclasses.replace(loaded, imu=realise_imu(loaded.imu, loaded.seed), seed=99)
    realised = Body(again).next(400)["imu"]
    np.testing.assert_allclose(realised.gyro, block.gyro, rtol=0, atol=1e-13)
    np.testing.assert_allclose(realised.accel, block.accel, rtol=0, atol=1e-12)


@pytest.mark.parametrize("errors", [FULL, LOWER], ids=["full", "lower"])
def test_openvins_predicts_the_readings(tmp_path, errors):
    """OpenVINS' Simulator.cpp, with the lower triangle of T that VioManagerOptions.h keeps."""
    loaded, block = simulated(**errors)
    tw, r_gyro, ta, r_acc, tg = chain(files(tmp_path / "c", loaded)["kalibr_imu_chain.yaml"])
    tw, ta = (np.linalg.inv(np.tril(np.linalg.inv(t))) for t in (tw, ta))
    for r in (r_gyro, r_acc):
        np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-11)
        assert np.linalg.det(r) > 0.0
    bias = realise_imu(loaded.imu, loaded.seed)
    gyro = block.ideal_gyro @ (tw @ r_gyro).T + block.ideal_accel @ tg.T + bias.gyroscope.bias
    accel = block.ideal_accel @ (ta @ r_acc).T + bias.accelerometer.bias
    # Twelve digits are written, of numbers up to 40.
    np.testing.assert_allclose(gyro, block.gyro, rtol=0, atol=1e-10)
    np.testing.assert_allclose(accel, block.accel, rtol=0, atol=1e-9)


def test_a_triangular_response_stays_as_it_is_in_openvins(tmp_path):
    loaded, _ = simulated(**{"imu.gyroscope_scale_error_percent": [1.0, 2.0, -3.0]})
    tw, r_gyro, *_ = chain(files(tmp_path / "c", loaded)["kalibr_imu_chain.yaml"])
    np.testing.assert_allclose(tw, np.diag([1.01, 1.02, 0.97]), atol=1e-12)
    np.testing.assert_array_equal(r_gyro, np.eye(3))


def test_basalt_removes_the_errors(tmp_path):
    """calib_bias.hpp: (I + M) reading - b; M by columns, the accelerometer's a lower triangle."""
    without = {k: v for k, v in LOWER.items() if "g_sensitivity" not in k}
    loaded, block = simulated(**without)
    text = files(tmp_path / "c", loaded)["basalt_calibration.json"]
    content = json.loads(text)["value0"]
    assert "not expressible" not in " ".join(content["comment"])
    accel, gyro = content["calib_accel_bias"], content["calib_gyro_bias"]
    assert (len(accel), len(gyro)) == (9, 12)
    m_a = np.zeros((3, 3))
    m_a[:, 0], m_a[1, 1], m_a[2, 1], m_a[2, 2] = accel[3:6], accel[6], accel[7], accel[8]
    m_g = np.column_stack([gyro[3:6], gyro[6:9], gyro[9:12]])
    force = block.accel + block.accel @ m_a.T - accel[:3]
    rate = block.gyro + block.gyro @ m_g.T - gyro[:3]
    np.testing.assert_allclose(force, block.ideal_accel, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rate, block.ideal_gyro, rtol=0, atol=1e-13)


def test_basalt_has_densities_per_axis_and_the_rate(tmp_path):
    loaded, _ = simulated(**{"imu.gyroscope_noise_density": [1e-3, 2e-3, 3e-3]})
    content = json.loads(files(tmp_path / "c", loaded)["basalt_calibration.json"])["value0"]
    assert content["gyro_noise_std"] == [1e-3, 2e-3, 3e-3]
    assert content["accel_bias_std"] == [1e-12] * 3  # its inverse is a weight
    assert content["imu_update_rate"] == RATE
    assert content["T_imu_cam"] == content["intrinsics"] == content["resolution"] == []


def test_basalt_says_what_its_lower_triangle_cannot_hold(tmp_path):
    loaded, _ = simulated(**FULL)
    content = json.loads(files(tmp_path / "c", loaded)["basalt_calibration.json"])["value0"]
    (line,) = [line for line in content["comment"] if "not expressible" in line]
    assert "accelerometer_scale_misalignment" in line
    assert "gyroscope_g_sensitivity" in line
    assert "gyroscope_scale_misalignment" not in line


def test_vins_fusion_reads_its_imu(tmp_path):
    """parameters.cpp reads imu_topic and the noise only where ``imu`` is 1."""
    loaded, _ = simulated(**{"imu.preset": "lecture"})
    texts = files(tmp_path / "c", loaded)
    fusion, mono = parsed(texts["vins_fusion.yaml"]), parsed(texts["vins_mono.yaml"])
    assert fusion.pop("imu") == 1
    assert fusion == mono
    assert mono["gyr_n"] == pytest.approx(0.015 * np.sqrt(RATE))


def test_the_walk_stands_for_the_flicker_noise(tmp_path):
    """The Allan deviation K sqrt(t / 3) is that of walk and flicker at 1 s in all five stacks."""
    k, b = np.array([1e-5, 2e-5, 0.0]), np.array([3e-5, 0.0, 4e-5])
    names = ("imu.gyroscope_random_walk", "imu.gyroscope_bias_instability")
    loaded, _ = simulated(**{name: v.tolist() for name, v in zip(names, (k, b), strict=True)})
    axes = np.sqrt(k**2 + 3.0 * 2.0 * np.log(2.0) / np.pi * b**2)
    np.testing.assert_allclose(axes**2 / 3.0, k**2 / 3.0 + (0.664 * b) ** 2, rtol=1e-3)
    combined = np.sqrt(np.mean(axes**2))
    texts = files(tmp_path / "c", loaded)
    for text in (texts[name] for name in ("imu.yaml", "vins_mono.yaml", "orb_slam3.yaml")):
        assert "T = 1 s" in text
        assert "gyroscope_random_walk: K = 1.29099444874e-05" in text.replace("\n#   ", " ")
    walks = [
        parsed(texts["imu.yaml"])["gyroscope_random_walk"],
        parsed(texts["kalibr_imu_chain.yaml"])["imu0"]["gyroscope_random_walk"],
        parsed(texts["vins_mono.yaml"])["gyr_w"] / np.sqrt(RATE),
        parsed(texts["vins_fusion.yaml"])["gyr_w"] / np.sqrt(RATE),
        parsed(texts["orb_slam3.yaml"])["IMU.GyroWalk"],
    ]
    np.testing.assert_allclose(np.array(walks, dtype=float), combined, rtol=1e-9)
    basalt = json.loads(texts["basalt_calibration.json"])["value0"]
    np.testing.assert_allclose(basalt["gyro_bias_std"], axes, rtol=1e-9)
    assert parsed(texts["imu.yaml"])["accelerometer_random_walk"] == 1e-12


def test_allan_variance_ros_takes_every_sample(tmp_path):
    loaded, _ = simulated(rate=100.5)
    config = yaml.safe_load(files(tmp_path / "c", loaded, 3599.2)["allan_variance_ros.yaml"])
    assert config == {
        "imu_topic": "/imu0",
        "imu_rate": 100.5,
        "measure_rate": 100,
        "sequence_time": 3600,
    }
    assert int(config["imu_rate"] / config["measure_rate"]) == 1
    assert type(config["measure_rate"]) is type(config["sequence_time"]) is int


def test_imu_utils_has_its_own_text_and_the_axes(tmp_path):
    loaded, _ = simulated(**{"imu.accelerometer_noise_density": [1e-3, 2e-3, 3e-3]})
    text = files(tmp_path / "c", loaded)["imu_utils.yaml"]
    assert '   unit: " rad/s"\n' in text
    assert '   unit: " m/s^2"\n' in text
    axes = parsed(text)["Acc"]
    densities = [float(axes[f"{axis}-axis"]["acc_n"]) for axis in ("x", "y", "z", "avg")]
    np.testing.assert_allclose(densities, np.array([1e-3, 2e-3, 3e-3, 2e-3]) * np.sqrt(RATE))


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("imu.yaml", "whole"),
        ("kalibr_imu_chain.yaml", "whole"),
        ("allan_variance_ros.yaml", "whole"),
        ("vins_mono.yaml", "fragment"),
        ("vins_fusion.yaml", "fragment"),
        ("orb_slam3.yaml", "fragment"),
        ("basalt_calibration.json", "fragment"),
    ],
)
def test_each_file_says_whether_it_is_whole(tmp_path, name, word):
    loaded, _ = simulated()
    text = files(tmp_path / "c", loaded)[name]
    assert word in text
    assert {"whole": "fragment", "fragment": "whole"}[word] not in text


# What each format has a place for besides the densities, by the sources of the stacks.
SCALES = {"gyroscope_scale_misalignment", "accelerometer_scale_misalignment"}
EXPRESSED = {
    "imu.yaml": set(),
    "vins_fusion.yaml": set(),
    "orb_slam3.yaml": set(),
    "kalibr_imu_chain.yaml": SCALES | {"gyroscope_g_sensitivity"},
    "basalt_calibration.json": SCALES | {"gyroscope_bias", "accelerometer_bias"},
    "imu_utils.yaml": {"gyroscope_bias_instability", "accelerometer_bias_instability"},
}
QUALIFIERS = {"preset", "reference_temperature", "bandwidth_order", "lever_arm", "mounting"}
IN_EVERY_FORMAT = ("noise_density", "random_walk", "correlation_time")
OTHER_SENSORS = ("magnetometer_", "barometer_", "orientation_")
LINE = {"line_frequency": [30.0], "line_amplitude": [0.1] * 6}
BAND = {"band_low": [20.0], "band_high": [30.0], "band_density": [0.1] * 6}
TERMS = [
    name
    for name in parameters(ImuParameters)
    if name not in QUALIFIERS
    and not name.endswith(IN_EVERY_FORMAT)
    and not name.startswith((*OTHER_SENSORS, "vibration."))
] + ["vibration.line_amplitude", "vibration.band_density"]


def changed(name, parameter):
    """Return a value that switches a term on, with what it needs besides."""
    if name.startswith("vibration."):
        values = LINE if "line" in name else BAND
        return {f"imu.vibration.{key}": value for key, value in values.items()}
    triad = name.split("_")[0]
    needed = {
        "gauss_markov": {f"imu.{triad}_correlation_time": 10.0},
        "increment_resolution": {"imu.sampling": "averaged"},
        "dropout_burst_rate": {"imu.dropout_burst_duration": 0.1},
        "stress_step_sigma": {"imu.stress_step_rate": 0.1},
        "shock_bias_sigma": {"imu.shock_threshold": 50.0},
    }
    value = {
        "matrix": [1.01, 0, 0, 0.01, 1.02, 0, 0, 0, 1.0],
        "vector": [0.01, 0.02, 0.03],
        "number": 1e-3,
        "choice": "averaged",
        "numbers": [0.0, 0, 0.1, 0, 0, 0] if parameter.group == 6 else [0.1, 0.2, 0.3],
    }[parameter.kind]
    if name == "accelerometer_misalignment_sigma":  # Basalt's accelerometer is a lower triangle
        value = [0.0, 0.0, 0.03]
    result = {f"imu.{name}": value}
    for key, additions in needed.items():
        result |= additions if key in name else {}
    return result


@pytest.mark.parametrize("name", TERMS)
def test_every_simulated_term_is_in_the_file_or_named_in_it(tmp_path, name):
    loaded, _ = simulated(**changed(name, parameters(ImuParameters)[name]))
    default = flatten(ImuParameters())
    realised = flatten(realise_imu(loaded.imu, loaded.seed))
    active = {key for key, value in realised.items() if value != default[key]}
    active = {key for key in active if key in TERMS}
    assert active
    texts = files(tmp_path / "c", loaded)
    for file, expressed in EXPRESSED.items():
        mentioned = {word.strip(',#"') for word in texts[file].split()}
        assert {key for key in active if key in mentioned} == active - expressed, file


@pytest.mark.parametrize("rate", [200.0, 2000.0])
def test_a_low_pass_is_named_at_rates_at_which_it_acts(tmp_path, rate):
    loaded, _ = simulated(**{"imu.preset": "mti3", "rate": rate})
    text = files(tmp_path / "c", loaded)["kalibr_imu_chain.yaml"]
    assert ("gyroscope_bandwidth" in text) == (rate > 2.0 * 255.0)


def test_a_sensor_that_mirrors_is_said_and_does_not_fail(tmp_path):
    loaded, _ = simulated(**{"imu.gyroscope_scale_misalignment": [-1.0, 0, 0, 0, 1, 0, 0, 0, 1]})
    texts = files(tmp_path / "mirrored", loaded)
    for name in ("kalibr_imu_chain.yaml", "basalt_calibration.json"):
        assert "gyroscope_scale_misalignment" in texts[name]
