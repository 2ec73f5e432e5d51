# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readings of a nine-axis board besides its IMU, in every form that generate writes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dotted_names import nested
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import imu_sim_ros as ims
from imu_sim_ros.commands import generate
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

PARAMETERS: dict[str, Any] = {
    "imu.preset": "mpu9250",
    "trajectory.type": "figure_eight",
    "duration": 2.0,
    "seed": 4,
    "imu.latency_jitter": 1e-3,
    "imu.dropout_probability": 0.05,
    "imu.magnetometer_rate": 70.0,
    "imu.magnetometer_time_offset": 0.003,
    "imu.magnetometer_noise_density": 1e-8,
    "imu.magnetometer_hard_iron": [1e-5, 0.0, -2e-5],
    "imu.barometer_preset": "bmp388",
    "imu.barometer_rate": 25.0,
    "imu.orientation_rate": 50.0,
    "imu.orientation_noise": [0.01, 0.01, 0.03],
}
SENSORS = ("magnetic_field", "pressure", "orientation")
READINGS = "imu/data_raw,imu/mag,imu/pressure,imu/data"
BIASES = "ground_truth/magnetometer_bias,ground_truth/barometer_bias"
TOPICS = f"{READINGS},ground_truth/mag,ground_truth/pressure,{BIASES}"


def arguments(**overrides: Any) -> list[str]:
    chosen = {**PARAMETERS, **overrides}
    return [word for name, value in chosen.items() for word in ("--set", f"{name}={value}")]


def run(path: Path, *options: str, **overrides: Any) -> int:
    return generate.main(["-o", str(path), "--quiet", *options, *arguments(**overrides)])


@pytest.fixture(scope="module")
def block() -> dict[str, Any]:
    return Body(load_simulation(PARAMETERS), sensors=SENSORS).next(10**6)


def stamp(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


@pytest.mark.parametrize(
    ("name", "options"),
    [("x.bag", ()), ("x.mcap", ()), ("folder", ("--storage", "sqlite3"))],
)
def test_bags_hold_the_samples_of_the_simulation(
    tmp_path: Path, block: dict[str, Any], name: str, options: tuple[str, ...]
) -> None:
    assert run(tmp_path / name, "--topics", TOPICS, *options) == 0
    messages: dict[str, list[Any]] = {}
    store = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([tmp_path / name], default_typestore=store) as reader:
        for connection, time_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            assert stamp(message) == time_ns
            messages.setdefault(connection.topic, []).append(message)
    field = block["magnetic_field"]
    assert field is not None
    assert len(field.delivered) < len(field.t_ns) == 140
    fields = messages["/imu/mag"]
    rows = field.delivered
    assert [stamp(m) for m in fields] == field.t_ns[rows].tolist()
    values = [[getattr(m.magnetic_field, axis) for axis in "xyz"] for m in fields]
    assert np.array_equal(values, field.field[rows])
    variance = 1e-16 * 70.0 + block_resolution() ** 2 / 12.0
    assert np.allclose(fields[0].magnetic_field_covariance, np.diag(variance).ravel())
    assert fields[0].header.frame_id == "imu_link"
    ideal = [[getattr(m.magnetic_field, a) for a in "xyz"] for m in messages["/ground_truth/mag"]]
    assert np.array_equal(ideal, field.ideal_field)
    stated = block["orientation"]
    assert stated is not None
    fields, rows = messages["/imu/data"], stated.delivered
    assert [stamp(m) for m in fields] == stated.t_ns[rows].tolist()
    q = [[getattr(m.orientation, part) for part in "wxyz"] for m in fields]
    assert np.array_equal(q, stated.q_wi[rows])
    gyro = [[getattr(m.angular_velocity, axis) for axis in "xyz"] for m in fields]
    assert np.array_equal(gyro, stated.gyro[rows])
    assert np.allclose(fields[0].orientation_covariance, np.diag([1e-4, 1e-4, 9e-4]).ravel())
    (raw, *_) = messages["/imu/data_raw"]
    assert raw.orientation_covariance[0] == -1.0
    air = block["pressure"]
    assert air is not None
    fields, rows = messages["/imu/pressure"], air.delivered
    assert [stamp(m) for m in fields] == air.t_ns[rows].tolist()
    assert [m.fluid_pressure for m in fields] == air.pressure[rows].tolist()
    assert fields[0].variance == pytest.approx(0.12728**2 * 25.0 + 0.33**2 / 12.0)
    still = messages["/ground_truth/pressure"]
    assert [m.fluid_pressure for m in still] == air.ideal_pressure.tolist()
    bias = [
        [getattr(m.vector, a) for a in "xyz"] for m in messages["/ground_truth/magnetometer_bias"]
    ]
    assert np.array_equal(bias, field.bias)
    assert [
        stamp(m) for m in messages["/ground_truth/magnetometer_bias"]
    ] == field.true_t_ns.tolist()
    bias = [m.fluid_pressure for m in messages["/ground_truth/barometer_bias"]]
    assert np.array_equal(bias, air.bias)


def test_recorded_truth_explains_the_readings(tmp_path: Path) -> None:
    """Reading minus ideal minus bias is white noise of the stated density, and nothing else.

    Of n numbers the mean of squares has a standard deviation of ``sqrt(2 / n)`` of its value: with
    4200 and 1200 numbers, 9 % and 17 % are four times that. A factor of sqrt(2) is 41 % of it.
    """
    slow = {"bias_instability": 2e-7, "random_walk": 1e-7, "turn_on_bias_sigma": 1e-5}
    settings: dict[str, Any] = {f"imu.magnetometer_{name}": value for name, value in slow.items()}
    settings |= {"imu.magnetometer_hard_iron_sigma": 2e-5, "imu.barometer_preset": "''"}
    settings |= {"imu.magnetometer_resolution": 0.0, "imu.barometer_noise_density": 0.1}
    settings |= {"imu.barometer_gust_rate": 0.5, "imu.barometer_gust_sigma": 8.0}
    settings |= {"imu.barometer_turn_on_bias_sigma": 50.0, "imu.barometer_random_walk": 0.2}
    settings |= {
        "imu.barometer_rate": 60.0,
        "imu.dropout_probability": 0.0,
        "duration": 20.0,
        "rate": 100.0,
    }
    assert run(tmp_path / "x.mcap", "--topics", TOPICS, **settings) == 0
    messages: dict[str, list[Any]] = {}
    with AnyReader([tmp_path / "x.mcap"]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            messages.setdefault(connection.topic, []).append(message)

    def of(topic: str, name: str) -> Any:
        values = [getattr(message, name) for message in messages[topic]]
        if name == "fluid_pressure":
            return np.array(values)
        return np.array([[v.x, v.y, v.z] for v in values])

    field = of("/imu/mag", "magnetic_field") - of("/ground_truth/mag", "magnetic_field")
    bias = of("/ground_truth/magnetometer_bias", "vector")
    assert np.mean(bias**2) > (1e-5) ** 2
    assert np.mean((field - bias) ** 2) == pytest.approx(1e-16 * 70.0, rel=0.09)
    air = of("/imu/pressure", "fluid_pressure") - of("/ground_truth/pressure", "fluid_pressure")
    bias = of("/ground_truth/barometer_bias", "fluid_pressure")
    assert np.ptp(bias) > 8.0
    assert np.mean((air - bias) ** 2) == pytest.approx(0.01 * 60.0, rel=0.17)


def block_resolution() -> np.ndarray:
    return np.array(load_simulation(PARAMETERS).imu.magnetometer.resolution)


def test_folders_have_a_table_of_each(tmp_path: Path, block: dict[str, Any]) -> None:
    field = block["magnetic_field"]
    assert field is not None
    rows = field.delivered
    expected = np.column_stack([field.t_ns[rows], field.field[rows]])
    for form, table in (("euroc", "mag0/data.csv"), ("csv", "mag0.csv")):
        assert run(tmp_path / form, "--format", form, "--topics", READINGS) == 0
        written = np.loadtxt(tmp_path / form / table, delimiter=",", skiprows=1)
        assert np.array_equal(written, expected)
        table = table.replace("mag", "pressure")
        written = np.loadtxt(tmp_path / form / table, delimiter=",", skiprows=1)
        air = block["pressure"]
        assert air is not None
        rows_of_air = air.delivered
        stated = block["orientation"]
        assert stated is not None
        table_of_q = table.replace("pressure", "orientation")
        q = np.loadtxt(tmp_path / form / table_of_q, delimiter=",", skiprows=1)
        assert np.array_equal(q[:, 1:], stated.q_wi[stated.delivered])
        assert np.array_equal(written.T, [air.t_ns[rows_of_air], air.pressure[rows_of_air]])
    text = (tmp_path / "euroc/mag0/sensor.yaml").read_text(encoding="utf-8")
    assert "rate_hz: 70" in text


def test_boards_of_their_own_have_a_table_each(tmp_path: Path) -> None:
    settings = {"imus": "[left, right]", "right.imu.magnetometer_rate": 35.0}
    options = ("--format", "euroc", "--topics", "imu/data_raw,imu/mag")
    assert run(tmp_path / "two", *options, **settings) == 0
    left_imu, right_imu = (
        np.loadtxt(tmp_path / f"two/mag{k}/data.csv", delimiter=",", skiprows=1) for k in (0, 1)
    )
    assert 0.8 * 140 < len(left_imu) < 140
    assert 0.8 * 70 < len(right_imu) < 70


def test_the_front_door_has_the_same(tmp_path: Path, block: dict[str, Any]) -> None:
    flight = ims.simulate(sensors=SENSORS, **nested(PARAMETERS))
    field = block["magnetic_field"]
    assert field is not None
    assert np.array_equal(flight.magnetic_field.field, field.field[field.delivered])
    assert np.array_equal(flight.magnetic_field.ideal_field, field.ideal_field[field.delivered])
    air = block["pressure"]
    assert air is not None
    assert np.array_equal(flight.pressure.pressure, air.pressure[air.delivered])
    flight.save(tmp_path / "x.mcap", topics=TOPICS.split(","))
    assert run(tmp_path / "y.mcap", "--topics", TOPICS) == 0
    both = []
    for name in ("x.mcap", "y.mcap"):
        with AnyReader([tmp_path / name]) as reader:
            both.append([(c.topic, t, raw) for c, t, raw in reader.messages()])
    assert both[0] == both[1]
    flight.save(tmp_path / "z", format="euroc", topics=["imu/data_raw", "imu/mag"])
    assert (tmp_path / "z/mag0/data.csv").is_file()


def test_what_was_not_simulated_is_refused(tmp_path: Path) -> None:
    flight = ims.simulate(duration=0.1)
    with pytest.raises(ims.ConfigurationError, match=r"sensors=\['magnetic_field'\]"):
        _ = flight.magnetic_field
    with pytest.raises(ims.ConfigurationError, match="magnetic_field: was not simulated"):
        flight.save(tmp_path / "x.bag", topics=["imu/mag"])
    assert not list(tmp_path.iterdir())
    with pytest.raises(ims.ConfigurationError, match="sensors: 'compass': must be one of"):
        ims.simulate(duration=0.1, sensors=["compass"])


def test_a_file_of_the_node_chooses_the_sensors(tmp_path: Path) -> None:
    file = tmp_path / "nine.yaml"
    file.write_text("/**: {ros__parameters: {publish: {magnetic_field: true}}}\n")
    assert len(ims.simulate(params_file=file, duration=1).magnetic_field) == 100
    with pytest.raises(ims.ConfigurationError):
        _ = ims.simulate(params_file=file, duration=1, sensors=()).magnetic_field


@pytest.mark.parametrize(
    ("name", "options", "problem"),
    [
        ("x.csv", (), "has room for readings of an IMU only; name a folder"),
        ("x.tum", (), "topic imu/mag: does not exist in tum"),
        (
            "x.bag",
            ("--topics", "imu/compass"),
            "unknown topic 'imu/compass'; did you mean imu/mag?",
        ),
    ],
)
def test_what_does_not_fit_is_one_line(
    tmp_path: Path, capsys: Any, name: str, options: tuple[str, ...], problem: str
) -> None:
    assert run(tmp_path / name, "--topics", "imu/data_raw,imu/mag", *options) == 2
    assert problem in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
