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
from imu_sim_ros.navigation.evaluation import tilt_and_heading

RATE, DURATION = 200.0, 10.0
FOUR_SIGMA = 4.0 / math.sqrt(2.0 * RATE * DURATION)
"""Of a root mean square over that many numbers, relative: one sigma is ``1 / sqrt(2 n)``."""
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


def make(path: Path, topics: str, **more: Any) -> None:
    chosen = {**PARAMETERS, **more}
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
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_an_orientation_is_as_wrong_as_it_says(recording: Path, capsys: Any) -> None:
    """White errors of known sigmas: n independent samples, each with a NEES of three."""
    found = result(capsys, recording, recording, "--estimate-topic", "imu/data")
    n = found["samples"]
    assert (found["kind"], n, found["samples_without_truth"]) == ("orientation", 2000, 0)
    tilt, heading = found["tilt_error_rad"], found["heading_error_rad"]
    assert tilt["rmse"] == pytest.approx(math.sqrt(2.0) * TILT, rel=FOUR_SIGMA)
    assert heading["rmse"] == pytest.approx(HEADING, rel=FOUR_SIGMA)
    assert abs(found["mean_heading_error_rad"]) < 4.0 * HEADING / math.sqrt(n)
    assert found["nees"]["mean"] == pytest.approx(3.0, abs=4.0 * math.sqrt(6.0 / n))
    assert found["nees"]["inside_band"] == pytest.approx(0.95, abs=4.0 * 0.218 / math.sqrt(n))


@pytest.mark.parametrize("topic", ["imu/data", "imu/mag", "imu/pressure"])
def test_python_finds_the_same(recording: Path, capsys: Any, topic: str) -> None:
    found = result(capsys, recording, recording, "--estimate-topic", topic)
    same = ims.evaluate(recording, recording, estimate_topic=topic).to_dict()
    assert json.loads(json.dumps(same)) == {
        key: value for key, value in found.items() if key not in ("estimate", "truth")
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
    found = result(capsys, recording, recording, "--estimate-topic", topic)
    noise = sigma * math.sqrt(RATE)
    left = found["error_without_bias"]
    assert left["std"] == pytest.approx([noise] * axes, rel=FOUR_SIGMA)
    assert np.max(np.abs(left["mean"])) < 4.0 * noise / math.sqrt(found["samples"])
    n = found["samples"]
    assert found["nees"]["mean"] == pytest.approx(axes, abs=4.0 * math.sqrt(2.0 * axes / n))
    if axes == 3:
        assert found["error"]["mean"] == pytest.approx([2e-5, 0.0, -1e-5], abs=1e-8)
    assert main([str(recording), str(recording), "--estimate-topic", topic]) == 0
    assert "and minus the true bias" in capsys.readouterr().out


def test_a_mounted_sensor_and_a_folder(tmp_path: Path, capsys: Any) -> None:
    """The orientation is that of the sensor; a folder holds it without a covariance."""
    bag = tmp_path / "turned.mcap"
    topics = "imu/data_raw,imu/data,imu/mag,ground_truth/odom"
    make(bag, topics, **{"imu.orientation_noise": 0.0, "imu.mounting": QUARTER})
    truth = tmp_path / "turned_truth.yaml"
    found = result(capsys, bag, bag, "--estimate-topic", "imu/data", "--imu", truth)
    assert found["attitude_error_rad"]["max"] < 1e-7
    found = result(capsys, bag, bag, "--estimate-topic", "imu/data")
    assert found["attitude_error_rad"]["min"] == pytest.approx(math.pi / 2.0)
    assert convert_bag.main([str(bag), "-o", str(tmp_path / "e"), "--format", "euroc"]) == 0
    folder = tmp_path / "e"
    capsys.readouterr()
    found = result(capsys, folder, bag, "--estimate-topic", "orientation0", "--imu", truth)
    assert found["attitude_error_rad"]["max"] < 1e-7
    assert found["no_nees"] == "the messages state no covariance"
    # The readings of a sensor whose truth was not recorded.
    assert main([str(bag), str(bag), "--estimate-topic", "imu/mag"]) == 2
    assert "has no topic /ground_truth/mag of sensor_msgs/msg/MagneticField" in (
        capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("options", "words"),
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
    recording: Path, capsys: Any, options: tuple[str, ...], words: str
) -> None:
    assert main([str(recording), str(recording), "--estimate-topic", *options]) == 2
    error = capsys.readouterr().err
    assert words in error
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
        found = tilt_and_heading(sign * estimate, truth)
        np.testing.assert_allclose(found[0], tilt, atol=1e-7)
        np.testing.assert_allclose(found[1], heading, atol=1e-7)
