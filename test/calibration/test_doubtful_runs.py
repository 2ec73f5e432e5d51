# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration runs with a drifting bias, in other units, at other rates: kept, told or refused."""

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.core.errors import InputError

QUIET = {
    "preset": "perfect",
    "gyroscope_noise_density": 1e-5,
    "accelerometer_noise_density": 1e-4,
    "accelerometer_temperature_bias": [0.002] * 3,
}


def soak(drift: float, rate: float = 50.0):
    """Return a soak of six positions at each of five temperatures; 30 rests."""
    steps = [
        x for k, degrees in enumerate((-20.0, 0.0, 20.0, 40.0, 60.0)) for x in (210.0 * k, degrees)
    ]
    return ims.simulate(
        imu=QUIET | {"gyroscope_temperature_bias": [drift, -drift, 0.5 * drift]},
        trajectory={"type": "six_position", "repeat": 5},
        duration=1050,
        rate=rate,
        seed=1,
        temperature={"profile": steps, "interpolation": "steps"},
    )


@pytest.mark.parametrize("drift", [0.0005, 0.003, 0.02])
def test_rests_are_kept_whatever_the_gyroscope_drifts(drift):
    """Above 0.0013 rad/s/K all but one temperature was left out, with no word of a rotation."""
    flight = soak(drift)
    readings = ims.Readings(flight.t_ns, flight.gyro, flight.accel)
    calibration = ims.calibrate_temperature(readings, temperature=flight.temperature)
    assert calibration.facts["stretches"] == 30
    assert calibration.facts["temperature_degC"] == [-20.0, 60.0]
    assert calibration.warnings == ()
    value = calibration.gyroscope["temperature_bias"].value[:3]
    assert value == pytest.approx([drift, -drift, 0.5 * drift], rel=1e-2)


def test_rotations_that_no_rate_names_are_told():
    """Without a truth and without rates, turning stretches were left out without a word."""
    imu = QUIET | {"gyroscope_temperature_bias": [0.002] * 3}
    flight = ims.simulate(imu=imu, trajectory="temperature_soak", rate=10, seed=1)
    readings = ims.Readings(flight.t_ns, flight.gyro, flight.accel)
    with_rates = ims.calibrate_temperature(readings, temperature=flight.temperature, rates=[1.0])
    assert with_rates.warnings == ()
    with_truth = ims.calibrate_temperature(flight)
    assert with_rates.facts["stretches"] == with_truth.facts["stretches"]
    resting = ims.calibrate_temperature(readings, temperature=flight.temperature)
    (note,) = resting.warnings
    assert "turn at 1 rad/s are left out: rates does not name them" in note
    wrong = ims.calibrate_temperature(readings, temperature=flight.temperature, rates=[1.0, 2.0])
    assert wrong.warnings == ("rates: nothing turns at 2 rad/s",)


@pytest.mark.parametrize(
    ("scale", "zero", "unit"),
    [(1.0, 273.15, "Kelvin"), (1e3, 0.0, "millidegrees"), (1e3, 273150.0, "millikelvin")],
)
def test_temperatures_in_another_unit_are_refused(scale, zero, unit):
    flight = soak(0.001, rate=10.0)
    readings = ims.Readings(flight.t_ns, flight.gyro, flight.accel)
    converted = np.clip(flight.temperature * scale + zero, -1e5, 1e5)
    with pytest.raises(InputError, match="degC are needed") as error:
        ims.calibrate_temperature(readings, temperature=converted)
    assert unit in str(error.value) or converted.max() == 1e5


def test_temperatures_that_may_be_in_fahrenheit_are_told():
    """-20 to 60 degC are -4 to 140 degF, above the 85 degC of data sheets."""
    flight = soak(0.001, rate=10.0)
    readings = ims.Readings(flight.t_ns, flight.gyro, flight.accel)
    assert ims.calibrate_temperature(readings, temperature=flight.temperature).warnings == ()
    fahrenheit = 1.8 * flight.temperature + 32.0
    (note,) = ims.calibrate_temperature(readings, temperature=fahrenheit).warnings
    assert "if these are in Fahrenheit, convert them" in note
    with pytest.raises(InputError, match="as in Fahrenheit"):
        ims.calibrate_temperature(readings, temperature=fahrenheit + 100.0)


@pytest.mark.parametrize("trajectory", ["six_position", "static"])
def test_a_soak_in_another_unit_is_told(trajectory):
    """Also in one orientation, where the scale would go into the bias."""
    flight = ims.simulate(
        imu=QUIET | {"gyroscope_temperature_bias": [0.05, 0.0, 0.0]},
        trajectory={"type": trajectory, "repeat": 3} if trajectory == "six_position" else "static",
        duration=630,
        rate=25,
        seed=2,
        temperature={"profile": [0.0, 0.0, 210.0, 20.0, 420.0, 40.0], "interpolation": "steps"},
    )
    in_g = ims.Readings(flight.t_ns, flight.gyro, flight.accel / 9.80665)
    lines = ims.calibrate_temperature(in_g, temperature=flight.temperature).warnings
    assert any(line.endswith("the readings are in g") for line in lines)
    assert ims.calibrate_temperature(flight).warnings == ()


@pytest.mark.parametrize(("factor", "scale"), [(1.1, "0.9091"), (0.9, "1.111")])
def test_wrong_rates_of_a_soak_are_told(factor, scale):
    flight = ims.simulate(imu=QUIET, trajectory="temperature_soak", rate=10, seed=1)
    readings = ims.Readings(flight.t_ns, flight.gyro, flight.accel)
    rates = [1.0 * factor]
    calibration = ims.calibrate_temperature(readings, temperature=flight.temperature, rates=rates)
    (note,) = calibration.warnings
    assert note.startswith(f"gyroscope: its three scales are {scale} on average")


def test_the_shortest_rest_is_told_in_seconds_and_readings():
    """A window has 25 readings at any rate; a rest has 100, which take 25 s at 4 Hz."""
    flight = ims.simulate(imu="mpu6000", trajectory="figure_eight", duration=200, rate=4, seed=1)
    with pytest.raises(InputError, match=r"no 25 s .* \(100 readings at 4 Hz\)"):
        ims.calibrate_six_position(flight)
    quick = ims.simulate(imu=QUIET, trajectory="static", duration=120, rate=10, seed=1)
    with pytest.raises(InputError, match="level to 20 degrees, 10 s or longer"):
        ims.calibrate_six_position(quick, fixture="exact")


@pytest.mark.parametrize(
    ("factor", "text"),
    [
        (1.0 / 9.80665, "the readings are in g"),
        (1e3 / 9.80665, "the readings are in mg"),
        (16384.0 / 9.80665, "counts, or gravity is wrong"),
        (0.9, "counts, or gravity is wrong"),
    ],
)
def test_six_positions_in_another_unit_are_told(factor, text):
    flight = ims.simulate(imu=QUIET, trajectory="six_position", rate=50, seed=1)
    readings = ims.Readings(flight.t_ns, flight.gyro, factor * flight.accel)
    *findings, note = ims.calibrate_six_position(readings).warnings
    assert note.startswith("accelerometer: its three scales are")
    assert text in note
    kinds = {"g": "g", "mg": "mg", "counts": "counts"} if factor != 0.9 else {}
    unit = kinds.get(text.rpartition("in ")[2].partition(",")[0])
    assert [f"[accelerometer_{unit}]" in line for line in findings] == [True] * (unit is not None)
    assert ims.calibrate_six_position(flight).warnings == ()


def test_wrong_rates_of_a_turntable_are_told():
    """Within 15 % they were taken as they are, and a scale of 0.91 given."""
    flight = ims.simulate(imu=QUIET, trajectory="turntable", rate=50, seed=1)
    readings = ims.Readings(flight.t_ns, flight.gyro, flight.accel)
    (note,) = ims.calibrate_turntable(readings, rates=[0.55, 1.1, 2.2]).warnings
    assert "0.9091 on average" in note
    assert "rates are wrong" in note
    assert ims.calibrate_turntable(readings, rates=[0.5, 1.0, 2.0]).warnings == ()
    missing = ims.calibrate_turntable(readings, rates=[0.5, 1.0, 2.0, 4.0])
    assert missing.warnings == ("rates: nothing turns at 4 rad/s",)
    partial = ims.calibrate_turntable(readings, rates=[0.5, 1.0])
    assert "turn at 2 rad/s are left out" in partial.warnings[0]
    in_degrees = ims.Readings(flight.t_ns, np.degrees(flight.gyro), flight.accel)
    with pytest.raises(InputError, match="pieces that turn at 29, 57, 110 rad/s are left out"):
        ims.calibrate_turntable(in_degrees, rates=[0.5, 1.0, 2.0])


def test_the_temperatures_of_a_table_are_those_of_the_calibration(tmp_path):
    """Every fifth row has one, in kelvins; without a unit they are refused by name."""
    flight = soak(0.001, rate=10.0)
    kelvins = (flight.temperature + 273.15).tolist()
    cells = [repr(kelvin) if k % 5 == 0 else "" for k, kelvin in enumerate(kelvins)]
    values = np.hstack([flight.gyro, flight.accel]).tolist()
    rows = [
        ",".join([str(t), *map(repr, row), cell])
        for t, row, cell in zip(flight.t_ns.tolist(), values, cells, strict=True)
    ]
    for unit in (" [K]", ""):
        header = f"timestamp [ns],gx,gy,gz,ax,ay,az,temp{unit}"
        (tmp_path / f"soak{unit}.csv").write_text("\n".join([header, *rows]) + "\n")
    readings = ims.Readings(flight.t_ns, flight.gyro, flight.accel)
    expected = ims.calibrate_temperature(readings, temperature=flight.temperature)
    calibration = ims.calibrate_temperature(tmp_path / "soak [K].csv")
    assert any("of 10,500 readings have a temperature" in line for line in calibration.warnings)
    for name, parameter in expected.parameters.items():
        np.testing.assert_allclose(
            calibration.parameters[name].value, parameter.value, rtol=1e-6, atol=1e-12
        )
    with pytest.raises(InputError, match="as in Kelvin.* in the header"):
        ims.calibrate_temperature(tmp_path / "soak.csv")
