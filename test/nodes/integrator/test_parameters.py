# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of integrator and recorder: layers, and what is refused."""

import pytest

from imu_sim_ros.bags.recorder_parameters import RecorderParameters
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.navigation.parameters import (
    IntegratorParameters,
    load_integrator,
    outside_covariance,
)
from imu_sim_ros.parameters.sections import build
from imu_sim_ros.parameters.sections import parameters as described


def integrator(**values: object) -> IntegratorParameters:
    return load_integrator(values)


def test_the_noise_is_that_of_the_preset_below_what_is_given():
    parameters = integrator(**{"imu.accelerometer_random_walk": 0.5})
    assert parameters.imu.gyroscope.noise_density == (0.015,) * 3
    assert parameters.imu.accelerometer.random_walk == (0.5,) * 3


def test_errors_that_contradict_each_other_are_refused():
    with pytest.raises(ConfigurationError, match="imu.gyroscope_correlation_time"):
        integrator(**{"imu.gyroscope_gauss_markov_sigma": 1e-3})


def test_noise_is_taken_at_the_start():
    parameter_table = described(IntegratorParameters)
    assert not any(
        parameter.live for name, parameter in parameter_table.items() if name.startswith("imu.")
    )


def test_a_calibration_corrects_and_given_values_stand_above_it(tmp_path):
    file = tmp_path / "calibration.yaml"
    file.write_text(
        "/**:\n  ros__parameters:\n    imu:\n      gyroscope_bias: [0.1, 0.2, 0.3]\n"
        "      accelerometer_bias: [1.0, 2.0, 3.0]\n      gyroscope_random_walk: 1.0e-3\n"
        "      accelerometer_scale_misalignment: [1.01, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n"
    )
    parameters = integrator(calibration=str(file), accelerometer_bias=[0.0, 0.0, 0.5])
    assert parameters.gyroscope_bias == (0.1, 0.2, 0.3)
    assert parameters.accelerometer_bias == (0.0, 0.0, 0.5)
    assert parameters.accelerometer_scale_misalignment[0] == 1.01
    assert parameters.imu.gyroscope.random_walk == (1e-3,) * 3


@pytest.mark.parametrize(
    ("values", "names"),
    [
        ({"imu.preset": "tactical"}, []),
        ({"imu.preset": "bno055"}, ["imu.gyroscope_temperature_bias_sigma"]),
        (
            {"imu.gyroscope_bias": 0.1, "imu.accelerometer_bias": [0, 0, 0.5]},
            ["imu.gyroscope_bias", "imu.accelerometer_bias"],
        ),
        (
            {"imu.gyroscope_bias": 0.1, "imu.accelerometer_bias": 0.5, "initial_state": "level"},
            ["imu.accelerometer_bias"],
        ),
        ({"imu.accelerometer_bias": 0.5, "accelerometer_bias": 0.49}, []),
        ({"imu.accelerometer_bias": [0, 0, 0], "imu.gyroscope_range": 4.0}, []),
        ({"imu.gyroscope_noise_density": 0.1, "imu.gyroscope_misalignment_sigma": 0.01}, []),
    ],
)
def test_what_the_covariance_leaves_out_is_named(values, names):
    assert outside_covariance(integrator(**values), values) == names


def test_what_a_described_sensor_has_beyond_the_covariance_is_named():
    sensor = {"imu.gyroscope_temperature_bias": [1e-3], "imu.accelerometer_bias": [[1], {}]}
    assert outside_covariance(integrator(), {}, sensor) == [
        "imu.gyroscope_temperature_bias",
        "imu.accelerometer_bias",
    ]


def test_what_a_file_says_of_the_simulated_imu_does_not_disturb():
    assert integrator(**{"imu.gyroscope_bias": 1.0}).gyroscope_bias == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"method": "verlet"}, "method = 'verlet': must be one of euler, midpoint, rk4"),
        ({"max_gap": -0.1}, "max_gap = -0.1: must be a finite number at least 0 [s]"),
        ({"gravity": -9.81}, "gravity = -9.81: must be a magnitude of at least 0, downwards, or a"),
        ({"gravity": [0, 0, -981.0]}, "must be at most 30 m/s^2 in magnitude"),
        ({"gyroscope_scale_misalignment": [0.0] * 9}, "must be invertible"),
        ({"imu.gyroscope_noise": 1.0}, "imu.gyroscope_noise: unknown parameter"),
        ({"imu.preset": "nosuch"}, "unknown IMU 'nosuch'; neither a file nor one of"),
        ({"calibration": "/nosuch.yaml"}, "/nosuch.yaml: No such file"),
    ],
)
def test_bad_parameters_of_the_integrator_are_named(values, line):
    with pytest.raises(ConfigurationError) as error:
        integrator(**values)
    assert line in str(error.value)
    assert len(error.value.problems) == 1


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"storage": "hdf5"}, "storage = 'hdf5': must be one of auto, mcap, sqlite3, ros1"),
        ({"output": "a.bag", "compression": "zstd"}, "must be one of none, lz4, bz2"),
        ({"output": "a.bag", "storage": "mcap"}, "a.bag is the name of a ROS 1 bag"),
        ({"output": "a.mcap", "storage": "sqlite3"}, "a.mcap is the name of an MCAP file"),
        ({"duration": -1.0}, "duration = -1.0: must be a finite number at least 0 [s]"),
    ],
)
def test_bad_parameters_of_the_recorder_are_named(values, line):
    with pytest.raises(ConfigurationError) as error:
        build(RecorderParameters, values)
    assert line in str(error.value)
    assert len(error.value.problems) == 1


def test_the_form_of_the_bag_follows_from_its_name():
    assert build(RecorderParameters, {"output": "a.bag"}).form() == "ros1"
    assert build(RecorderParameters, {"output": "folder"}).form() == "mcap"
