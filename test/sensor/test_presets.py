# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every preset loads and runs, and each of its numbers is computed from a source in its comment."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.parameters.yaml_text import parse_yaml
from imu_sim_ros.sensors import catalogue
from imu_sim_ros.sensors.errors.triad import variance_discrete
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

PRESETS = files.names("imus")
UNITS = {"deg": math.pi / 180.0, "g": 9.80665, "hour": 3600.0, "sqrt": math.sqrt}
ENTRY = re.compile(r"^ {6}# (\[\d\]) (.+) = ([^=]+)\n {6}(\w+): (.+)$", re.MULTILINE)


def test_the_presets_that_are_promised_exist() -> None:
    assert set(PRESETS) >= {
        "perfect",
        "lecture",
        "adis16448",
        "mpu6000",
        "mpu9250",
        "icm42688p",
        "bmi088",
        "bmi270",
        "vn100",
        "tactical",
        "navigation",
        "bmi055",
        "bno055",
        "lsm6dso",
        "icm20948",
        "icm40609",
        "mti3",
        "mti100",
        "adis16465",
        "adis16470",
        "adis16505",
        "hg4930",
        "phone",
    }


@pytest.mark.parametrize(
    ("kind", "preset"),
    [("imus", name) for name in PRESETS if name != "perfect"]
    + [("barometers", name) for name in files.names("barometers")],
)
def test_every_number_has_a_source_and_follows_from_it(kind: str, preset: str) -> None:
    path = files.find(kind, preset)
    text = path.read_text(encoding="utf-8")
    header = text.partition("/**:")[0]
    entries = ENTRY.findall(text)
    assert {f"imu.{name}" for *_, name, _ in entries} == set(files.load(path))
    for source, _, expression, _, value in entries:
        assert f"# {source} " in header
        computed = eval(expression, {"__builtins__": {}}, dict(UNITS))
        # Five digits are written.
        assert np.allclose(parse_yaml(value), computed, rtol=5e-5, atol=0.0)


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_every_preset_runs(preset: str, rate: float) -> None:
    parameters = load_simulation({"imu.preset": preset, "trajectory.type": "lecture", "rate": rate})
    assert parameters.warnings() == []
    block = Body(parameters).next(1000)["imu"]
    assert np.isfinite(block.gyro).all()
    assert np.isfinite(block.accel).all()
    gyro = variance_discrete(parameters.imu, "gyroscope", rate)
    accel = variance_discrete(parameters.imu, "accelerometer", rate)
    if preset == "perfect":
        assert gyro == accel == (0.0, 0.0, 0.0)
    else:
        assert min(gyro) > 0.0
        assert min(accel) > 0.0


def noise_entries(preset: str) -> dict[str, tuple[str, str]]:
    """Return the source's statement of each noise density, and the expression, by parameter."""
    entries = ENTRY.findall(files.find("imus", preset).read_text(encoding="utf-8"))
    return {
        name: (statement, expression)
        for _, statement, expression, name, _ in entries
        if name.endswith("noise_density")
    }


@pytest.mark.parametrize("preset", [n for n in PRESETS if n not in ("perfect", "lecture")])
def test_every_noise_density_names_its_convention(preset: str) -> None:
    """One-sided D is divided by sqrt(2); random walks and kalibr's densities are two-sided.

    So is that of readings whose RMS is given: it is ``RMS / sqrt(rate)``.
    """
    for statement, expression in noise_entries(preset).values():
        one_sided = statement.startswith("D ")
        assert one_sided == ("sqrt(2)" in expression), statement
        two_sided = "random walk|noise_density|root PSD|RMS noise .* in readings at .* Hz"
        assert one_sided or re.search(two_sided, statement), statement


@pytest.mark.parametrize("preset", [n for n in PRESETS if n not in ("perfect", "lecture")])
def test_every_tolerance_becomes_a_deviation_by_the_rule_its_file_states(preset: str) -> None:
    """A tolerance, or a limit, is three standard deviations; or the source's values are one."""
    text = files.find("imus", preset).read_text(encoding="utf-8")
    three = "taken as three standard deviations, x / 3" in text
    constant = "The source's values are one standard deviation each." in text
    for _, statement, expression, name, _ in ENTRY.findall(text):
        if name.endswith("_sigma"):
            assert three != constant
            limit = re.search(r"\bat most\b|^\S+ to \S+ LSB", statement) is not None
            spread = three and not statement.startswith("RMS")
            assert (spread or limit) == (re.search(r"/ 3\b|/ 135\b", expression) is not None), name


def test_a_board_states_its_sheets_orientation_and_a_filter_takes_its_place() -> None:
    sheet = load_simulation({"imu.preset": "mti3"}).imu.orientation
    assert np.degrees(sheet.drift_sigma) == pytest.approx([1.0, 1.0, 2.0], rel=1e-5)
    chosen = {"imu.preset": "mti3", "imu.orientation_source": "filter"}
    assert load_simulation(chosen).imu.orientation.drift_sigma == (0.0, 0.0, 0.0)
    with pytest.raises(ConfigurationError, match="must be 0 if"):
        load_simulation({**chosen, "imu.orientation_drift_sigma": 0.1})


IN_BANDWIDTH = [
    ("mpu6000", "gyroscope", math.radians(0.005), math.radians(0.05), 100.0),
    ("mpu9250", "gyroscope", math.radians(0.01), math.radians(0.1), 92.0),
    ("bmi088", "gyroscope", math.radians(0.014), math.radians(0.1), 47.0),
    ("bmi270", "gyroscope", math.radians(0.007), math.radians(0.0614), 77.0),
    ("bmi270", "accelerometer", 160e-6 * 9.80665, 1.51e-3 * 9.80665, 89.0),
    ("icm42688p", "gyroscope", math.radians(0.0028), math.radians(0.028), 100.0),
]
"""Preset, triad, the sheet's D, its RMS (rounded there) and the bandwidth [Hz]."""


@pytest.mark.parametrize(("preset", "triad", "density", "rms", "bandwidth"), IN_BANDWIDTH)
def test_noise_in_a_bandwidth_is_the_data_sheets(
    preset: str, triad: str, density: float, rms: float, bandwidth: float
) -> None:
    """The simulated noise below the bandwidth has the RMS D sqrt(bandwidth).

    300 s at 1 kHz on three axes: 2 * 300 * 47 * 3 coefficients, a standard error of 0.24 % at
    most.
    """
    rate, seconds = 1000.0, 300
    without = {"bias_instability": 0.0, "resolution": 0.0, "turn_on_bias_sigma": 0.0}
    values: dict[str, object] = {f"imu.{triad}_{name}": v for name, v in without.items()}
    parameters = load_simulation(
        {"imu.preset": preset, "trajectory.type": "static", "rate": rate}, values
    )
    block = Body(parameters).next(int(seconds * rate))["imu"]
    readings = block.gyro if triad == "gyroscope" else block.accel
    spectrum = np.fft.rfft(readings - readings.mean(axis=0), axis=0)
    spectrum[np.fft.rfftfreq(len(readings), 1.0 / rate) > bandwidth] = 0.0
    deviation = float(np.fft.irfft(spectrum, len(readings), axis=0).std())
    assert deviation == pytest.approx(density * math.sqrt(bandwidth), rel=0.01)
    assert deviation == pytest.approx(rms, rel=0.05)


def test_a_low_pass_acts_if_half_the_rate_is_above_it() -> None:
    """The readings are those without it, else; only what a user chose is warned of."""

    def readings(rate: float, **overrides: object) -> np.ndarray:
        layer = {"imu.preset": "mti3", "trajectory.type": "static", "rate": rate, **overrides}
        return Body(load_simulation(layer)).next(50)["imu"].gyro

    for rate in (200.0, 510.0):
        assert np.array_equal(readings(rate), readings(rate, **{"imu.gyroscope_bandwidth": 0.0}))
    assert not np.array_equal(readings(511.0), readings(511.0, **{"imu.gyroscope_bandwidth": 0.0}))
    assert load_simulation({"imu.preset": "mti3"}).warnings() == []
    [line] = load_simulation({"imu.gyroscope_bandwidth": 100.0}).warnings()
    assert line.startswith("imu.gyroscope_bandwidth = 100: without effect")
    oversampled = {"imu.preset": "mti3", "imu.sampling": "oversampled"}
    assert load_simulation(oversampled).warnings() == []
    with pytest.raises(ConfigurationError, match="must be below half the internal rate, 200 Hz"):
        load_simulation({**oversampled, "rate": 50.0})


MODULES = {"mti3": ((0.007, 255.0), (120.0, 324.0)), "mti100": ((0.01, 415.0), (60.0, 375.0))}
"""One-sided D [deg/s/sqrt(Hz)], [ug/sqrt(Hz)] and low-pass [Hz] of gyroscope and accelerometer."""


@pytest.mark.parametrize("preset", MODULES)
def test_a_module_has_the_rms_of_its_low_pass_without_further_parameters(preset: str) -> None:
    """D sqrt(1.11 bandwidth): Butterworth's noise bandwidth of order 2, pi / 4 / sin(pi / 4).

    The bilinear transform at 4 kHz keeps it to 1 %; 1e5 samples of some 600 Hz: 0.4 % on x.
    """
    densities = white(preset, 4000.0, 25.0)
    for triad, unit, (density, bandwidth) in zip(
        TRIADS, (UNITS["deg"], 1e-6 * UNITS["g"]), MODULES[preset], strict=True
    ):
        expected = unit * density * math.sqrt(1.1107 * bandwidth)
        assert densities[triad][0] == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("preset", [n for n in PRESETS if n not in ("perfect", "lecture")])
def test_a_16_bit_sensor_has_16_bit_codes(preset: str) -> None:
    imu = load_simulation({"imu.preset": preset}).imu
    for triad in TRIADS:
        step, limit = (imu.triad(triad).resolution[0], imu.triad(triad).range[0])
        if step and limit:
            assert math.floor(limit / step * (1.0 + 1e-6)) <= 2**15 - 1


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_has_grade_price_class_and_source(preset: str) -> None:
    text = catalogue.descriptions("imus")[preset]
    grades = "Perfect|Classroom|Consumer|Industrial|Tactical|Navigation"
    assert re.fullmatch(rf"({grades}), (no price|.+ EUR|.+ EUR \(module\)): [A-Z].+", text)
    file = files.find("imus", preset).read_text(encoding="utf-8")
    sources = re.findall(r"^# \[\d\] .+(?:\n#     .+)*", file, re.MULTILINE)
    assert sources or preset == "perfect"
    assert all(source.endswith(".") for source in sources)  # whole ones


def test_grades_are_in_order() -> None:
    """White noise of the gyroscope: consumer, industrial, tactical, navigation."""
    order = ["mpu9250", "mpu6000", "tactical", "icm42688p", "hg4930", "navigation"]
    noise = [load_simulation({"imu.preset": name}).imu.gyroscope.noise_density[0] for name in order]
    assert noise == sorted(noise, reverse=True)


def test_a_kalibr_file_is_a_preset(tmp_path: Path) -> None:
    path = tmp_path / "imu.yaml"
    path.write_text(
        "accelerometer_noise_density: 0.01\naccelerometer_random_walk: 2e-4\n"
        "gyroscope_noise_density: 1e-3\ngyroscope_random_walk: 1.0e-05\n"
        "rostopic: /imu0\nupdate_rate: 250.0\n"
    )
    parameters = load_simulation({"imu.preset": str(path)})
    assert parameters.rate == 250.0
    assert parameters.imu.gyroscope.noise_density == (1e-3, 1e-3, 1e-3)
    assert flatten(parameters)["imu.accelerometer_random_walk"] == (2e-4, 2e-4, 2e-4)


RMS = re.compile(r"; ([\d.]+) (deg/s|mdeg/s|mg) rms in (\d+) Hz$")
SIZES = {"deg/s": UNITS["deg"], "mdeg/s": 1e-3 * UNITS["deg"], "mg": 1e-3 * UNITS["g"]}
STATED = [
    (preset, name.split("_")[0], float(stated[1]) * SIZES[stated[2]], float(stated[3]))
    for preset in PRESETS
    for _, statement, _, name, _ in ENTRY.findall(
        (files.config_folder() / "imus" / f"{preset}.yaml").read_text()
    )
    if (stated := RMS.search(statement))
]
"""Preset, triad, RMS and bandwidth [Hz]."""


def white(
    preset: str, rate: float, seconds: float = 60.0, **sensor: object
) -> dict[str, np.ndarray]:
    """Return the RMS (3,) of readings at rest in half a second, before they are rounded."""
    parameters = {"imu.preset": preset, "rate": rate, "trajectory.type": "static"}
    parameters |= {f"imu.{triad}_resolution": 0.0 for triad in TRIADS}
    run = Body(load_simulation({**parameters, **sensor})).next(round(seconds * rate))["imu"]
    size = round(0.5 * rate)
    rows = round(seconds * rate) // size * size
    return {
        triad: values[:rows].reshape(-1, size, 3).std(axis=1, ddof=1).mean(axis=0)
        for triad, values in zip(TRIADS, (run.gyro, run.accel), strict=True)
    }


def test_sheets_state_rms_noise() -> None:
    assert {preset for preset, *_ in STATED} >= {"mpu6000", "mpu9250", "bmi088", "bmi270"}


@pytest.mark.parametrize(("preset", "triad", "rms", "bandwidth"), STATED)
def test_readings_at_twice_the_bandwidth_have_the_rms_of_the_sheet(
    preset: str, triad: str, rms: float, bandwidth: float
) -> None:
    """5,600 readings or more: an RMS is known to 1 %; sheets round theirs by up to 4 %."""
    densities = white(preset, 2.0 * bandwidth)[triad]
    np.testing.assert_allclose(densities, rms, rtol=0.06)


def test_a_chip_behind_its_low_pass_has_the_rms_of_its_noise_bandwidth() -> None:
    """A Butterworth filter of order 2 passes the noise of 1.11 times its cut-off: 100 Hz."""
    chip = {
        "imu.sampling": "oversampled",
        "imu.internal_rate": 1000.0,
        "imu.gyroscope_bandwidth": 90.0,
        "imu.accelerometer_bandwidth": 90.0,
    }
    densities = white("mpu6000", 200.0, **chip)
    # The bilinear transform at 1 kHz narrows the pass band by some per cent.
    np.testing.assert_allclose(densities["gyroscope"], 0.05 * UNITS["deg"], rtol=0.05)
    np.testing.assert_allclose(densities["accelerometer"], 4e-3 * UNITS["g"], rtol=0.05)
