# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The IMU's noise in the settings of estimators."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros.core.errors import ConfigurationError, Remark
from imu_sim_ros.datasets.configurations import imu_values
from imu_sim_ros.datasets.consumers import basalt, orb_slam3
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.simulation.parameters import SimulationParameters, load_simulation

KEYS = (
    *("gyroscope_noise_density", "gyroscope_random_walk"),
    *("accelerometer_noise_density", "accelerometer_random_walk"),
)
LIO_SAM = "imuAccNoise: 3.99e-3\nimuGyrNoise: 1.56e-3\nimuAccBiasN: 6.43e-5\nimuGyrBiasN: 3.5e-5\n"


def simulation(file: Path, text: str) -> tuple[SimulationParameters, str]:
    """Return the simulation with the IMU of a text, and the remarks of its reading."""
    file.write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", Remark)
        result = load_simulation({"imu.preset": str(file), "trajectory.type": "static"})
    return result, "\n".join(str(line.message) for line in caught)


@pytest.mark.parametrize(
    "text",
    [
        f"lio_sam:\n  imuTopic: imu_raw\n  {LIO_SAM.strip().replace(chr(10), chr(10) + '  ')}\n",
        f"/**:\n  ros__parameters:\n    {LIO_SAM.strip().replace(chr(10), chr(10) + '    ')}\n",
        LIO_SAM,
    ],
)
def test_lio_sam_has_densities(text: str, tmp_path: Path) -> None:
    parameters, remarks = simulation(tmp_path / "params.yaml", text)
    values = imu_values(parameters, "/imu")
    for key, density in zip(KEYS, (1.56e-3, 3.5e-5, 3.99e-3, 6.43e-5), strict=True):
        assert values.axes(key).tolist() == [density] * 3
    assert ("not used: lio_sam.imuTopic" in remarks) == ("imuTopic" in text)


@pytest.mark.parametrize("stack", ["orb_slam3", "basalt"])
def test_what_is_written_for_an_estimator_is_the_same_imu(stack: str, tmp_path: Path) -> None:
    truth = load_simulation({"imu.preset": "mpu6000", "trajectory.type": "static", "rate": 250.0})
    written = imu_values(truth, "/imu")
    files = {"orb_slam3": orb_slam3.files, "basalt": basalt.files}[stack](Subject(written, None))
    parameters, remarks = simulation(tmp_path / next(iter(files)), next(iter(files.values())))
    assert parameters.rate == 250.0
    values = imu_values(parameters, "/imu")
    for key in KEYS:
        np.testing.assert_allclose(values.axes(key), written.filter_axes(key), rtol=1e-9)
    if stack == "basalt":
        for triad in ("gyroscope", "accelerometer"):
            # Basalt keeps the lower triangle of the accelerometer's inverse response.
            keep = np.tril if triad == "accelerometer" else np.asarray
            inverse, response = np.linalg.inv(written.response(triad)), values.response(triad)
            np.testing.assert_allclose(np.linalg.inv(response), keep(inverse), atol=1e-12)
            np.testing.assert_allclose(
                np.linalg.solve(response, values.axes(f"{triad}_bias")),
                inverse @ written.axes(f"{triad}_bias"),
            )
        assert "not used: value0.T_imu_cam" in remarks


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            "acc_n: 0.1\ngyr_n: 0.01\n",
            r"acc_n = 0.1: .*acc_n/sqrt\(rate\); set imu.acc",
        ),
        (
            "mapping:\n  gyr_cov: 0.1\n",
            r"mapping.gyr_cov = 0.1: .* sqrt\(gyr_cov/rate\); set imu",
        ),
        (
            "Gyr:\n  avg-axis:\n    gyr_w: 1e-5\n",
            r"Gyr.avg-axis.gyr_w .*set imu.gyroscope_r",
        ),
        ("IMU.NoiseGyr: 1e-4\nIMU.NoiseAcc: 1e-3\n", "did you mean IMU.NoiseGyro?"),
        ("imuAccNoise: much\n", "accelerometer_noise_density = 'much'"),
        ("value0:\n  accel_noise_std: [1, 1, 1]\n  calib_gyro_bias: [0]\n", "not a correction"),
    ],
)
def test_values_that_are_no_densities_are_refused(text: str, line: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=line):
        simulation(tmp_path / "settings.yaml", text)
