# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""evaluate on orientations, magnetic fields and pressures of a recording."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands import convert_bag, generate
from imu_sim_ros.commands.evaluate import main
from imu_sim_ros.core import rotation
from imu_sim_ros.navigation.evaluation import tilt_and_heading_errors

RATE, DURATION = 200.0, 10.0
FOUR_SIGMA = 4.0 / math.sqrt(2.0 * RATE * DURATION)
"""Relative error of a root mean square over n numbers: one sigma is ``1 / sqrt(2 n)``."""
TILT, HEADING = 0.01, 0.03
FIELD, AIR = 1e-8, 0.1
TOPICS = (
    "imu/data_raw,imu/data,imu/mag,imu/pressure,ground_truth/odom,ground_truth/mag,"
    "ground_truth/pressure,ground_truth/magnetometer_bias,ground_truth/barometer_bias"
)
PARAMETERS = {
    "imu.orientation_noise": [TILT, TILT, HEADING],
    "imu.magnetometer_noise_density": FIELD,
    "imu.magnetometer_rate": RATE,
    "imu.magnetometer_hard_iron": [2e-5, 0.0, -1e-5],
    "imu.barometer_noise_density": AIR,
    "imu.barometer_rate": RATE,
    "imu.barometer_gust_rate": 0.5,
    "imu.barometer_gust_sigma": 8.0,
}
QUARTER = "[0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]"


def make(path: Path, topics: str, **overrides: Any) -> None:
    chosen = {**PARAMETERS, **overrides}
    values = [word for name, value in chosen.items() for word in ("--set", f"{name}={value}")]
    arguments = ["-o", str(path), "--trajectory", "figure_eight", "--duration", f"{DURATION}s"]
    assert generate.main([*arguments, "--topics", topics, "--quiet", *values]) == 0


@pytest.fixture(scope="module")
def recording(tmp_path_factory: Any) -> Path:
    path: Path = tmp_path_factory.mktemp("measured") / "nine.mcap"
    make(path, TOPICS)
    return path


def result(capsys: Any, *arguments: object) -> dict[str, Any]:
    assert main([*map(str, arguments), "--json"]) == 0
    evaluation: dict[str, Any] = json.loads(capsys.readouterr().out)
    return evaluation


def test_an_orientation_is_as_wrong_as_it_says(recording: Path, capsys: Any) -> None:
    """White errors of known sigmas: n independent samples, each with a NEES of three."""
    evaluation = result(capsys, recording, recording, "--estimate-topic", "imu/data")
    n = evaluation["samples"]
    assert (evaluation["kind"], n, evaluation["samples_without_truth"]) == ("orientation", 2000, 0)
    tilt, heading = evaluation["tilt_error_rad"], evaluation["heading_error_rad"]
    assert tilt["rmse"] == pytest.approx(math.sqrt(2.0) * TILT, rel=FOUR_SIGMA)
    assert heading["rmse"] == pytest.approx(HEADING, rel=FOUR_SIGMA)
    assert abs(evaluation["mean_heading_error_rad"]) < 4.0 * HEADING / math.sqrt(n)
    assert evaluation["nees"]["mean"] == pytest.approx(3.0, abs=4.0 * math.sqrt(6.0 / n))
    assert evaluation["nees"]["inside_band"] == pytest.approx(0.95, abs=4.0 * 0.218 / math.sqrt(n))


@pytest.mark.parametrize("topic", ["imu/data", "imu/mag", "imu/pressure"])
def test_python_finds_the_same(recording: Path, capsys: Any, topic: str) -> None:
    evaluation = result(capsys, recording, recording, "--estimate-topic", topic)
    in_python = ims.evaluate(recording, recording, estimate_topic=topic).to_dict()
    assert json.loads(json.dumps(in_python)) == {
        key: value for key, value in evaluation.items() if key not in ("estimate", "truth")
    }


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ({"align": "yaw"}, "align = 'yaw': must be omitted: imu/mag is no trajectory"),
        ({"imu": "mti3"}, "imu = 'mti3': must be omitted: it is about orientations"),
    ],
)
def test_python_refuses_what_has_no_meaning(
    recording: Path, arguments: dict[str, Any], line: str
) -> None:
    with pytest.raises(ims.ConfigurationError) as caught:
        ims.evaluate(recording, recording, estimate_topic="imu/mag", **arguments)
    assert list(caught.value.problems) == [line]


@pytest.mark.parametrize(
    ("topic", "axes", "sigma"), [("/imu/mag", 3, FIELD), ("imu/pressure", 1, AIR)]
)
def test_readings_against_their_truth(
    recording: Path, capsys: Any, topic: str, axes: int, sigma: float
) -> None:
    evaluation = result(capsys, recording, recording, "--estimate-topic", topic)
    noise = sigma * math.sqrt(RATE)
    without_bias = evaluation["error_without_bias"]
    assert without_bias["std"] == pytest.approx([noise] * axes, rel=FOUR_SIGMA)
    assert np.max(np.abs(without_bias["mean"])) < 4.0 * noise / math.sqrt(evaluation["samples"])
    n = evaluation["samples"]
    assert evaluation["nees"]["mean"] == pytest.approx(axes, abs=4.0 * math.sqrt(2.0 * axes / n))
    if axes == 3:
        assert evaluation["error"]["mean"] == pytest.approx([2e-5, 0.0, -1e-5], abs=1e-8)
    assert main([str(recording), str(recording), "--estimate-topic", topic]) == 0
    assert "and minus the true bias" in capsys.readouterr().out


def test_a_mounted_sensor_and_a_folder(tmp_path: Path, capsys: Any) -> None:
    """The orientation is that of the sensor; a folder holds it without a covariance."""
    bag = tmp_path / "turned.mcap"
    topics = "imu/data_raw,imu/data,imu/mag,ground_truth/odom"
    make(bag, topics, **{"imu.orientation_noise": 0.0, "imu.mounting": QUARTER})
    truth = tmp_path / "turned_truth.yaml"
    evaluation = result(capsys, bag, bag, "--estimate-topic", "imu/data", "--imu", truth)
    assert evaluation["attitude_error_rad"]["max"] < 1e-7
    evaluation = result(capsys, bag, bag, "--estimate-topic", "imu/data")
    assert evaluation["attitude_error_rad"]["min"] == pytest.approx(math.pi / 2.0)
    assert convert_bag.main([str(bag), "-o", str(tmp_path / "e"), "--format", "euroc"]) == 0
    folder = tmp_path / "e"
    capsys.readouterr()
    evaluation = result(capsys, folder, bag, "--estimate-topic", "orientation0", "--imu", truth)
    assert evaluation["attitude_error_rad"]["max"] < 1e-7
    assert evaluation["no_nees"] == "the messages state no covariance"
    # The readings of a sensor whose truth was not recorded.
    assert main([str(bag), str(bag), "--estimate-topic", "imu/mag"]) == 2
    assert "has no topic /ground_truth/mag of sensor_msgs/msg/MagneticField" in (
        capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (
            ("imu/data", "--align", "yaw"),
            "--align 'yaw': must be omitted: imu/data is no",
        ),
        (("imu/mag", "--rpe", "5m"), "--rpe ['5m']: must be omitted: imu/mag is no trajectory"),
        (("imu/mag", "--plot", "x.png"), "--plot: imu/mag is no trajectory"),
        (("imu/mag", "--imu", "mpu9250"), "--imu 'mpu9250': must be omitted: it is about orient"),
        (("ground_truth/odom", "--imu", "mpu9250"), "must be omitted: it is about recorded orient"),
        (("imu/data_raw",), "imu/data_raw: no message has an orientation"),
        (("imu/data", "--imu", "nothing"), "unknown IMU 'nothing'; neither a file nor one of"),
        (("imu/compass",), "has no topic imu/compass"),
    ],
)
def test_what_does_not_fit_is_one_line(
    recording: Path, capsys: Any, options: tuple[str, ...], problem: str
) -> None:
    assert main([str(recording), str(recording), "--estimate-topic", *options]) == 2
    error = capsys.readouterr().err
    assert problem in error
    assert len(error.splitlines()) == 1


def test_tilt_and_heading_are_those_of_two_turns() -> None:
    """A turn about the vertical, then one about a horizontal axis, up to half a turn each."""
    random = np.random.default_rng(5)
    n = 200
    heading = random.uniform(-3.1, 3.1, n)
    tilt = random.uniform(0.0, 3.1, n)
    along = random.uniform(0.0, 2.0 * np.pi, n)
    zero = np.zeros(n)
    turn = rotation.exp(np.stack([zero, zero, heading], axis=1))
    swing = rotation.exp(np.stack([tilt * np.cos(along), tilt * np.sin(along), zero], axis=1))
    estimate = rotation.normalise(random.standard_normal((n, 4)))
    truth = rotation.multiply(rotation.conjugate(rotation.multiply(swing, turn)), estimate)
    for sign in (1.0, -1.0):
        errors = tilt_and_heading_errors(sign * estimate, truth)
        np.testing.assert_allclose(errors[0], tilt, atol=1e-7)
        np.testing.assert_allclose(errors[1], heading, atol=1e-7)
