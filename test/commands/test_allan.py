# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command allan on bags, end to end."""

import io
import json
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.commands import allan, generate
from imu_sim_ros.core.records import Readings
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import build
from imu_sim_ros.parameters.yaml_text import parse_yaml
from imu_sim_ros.sensors.imu import presets
from imu_sim_ros.simulation.parameters import SimulationParameters, load_simulation
from imu_sim_ros.terminal.progress import Watcher, watch

RATE, SECONDS = 100, 300
# 30,000 readings know the deviation of white noise to 1 / sqrt(60,000) = 0.41 %: bounds of 2 and
# 2.1 % are five of these, of 3 % six of the 0.5 % of the shortest Allan deviation.


def make(path: Path, *arguments: str) -> Path:
    fixed = ["--imu", "lecture", "--trajectory", "static", "--rate", str(RATE), "--quiet"]
    fixed += ["--duration", f"{SECONDS}s", "--imu-only", "-o", str(path)]
    assert generate.main([*fixed, *arguments]) == 0
    return path


@pytest.fixture(scope="module")
def bag(tmp_path_factory) -> Path:
    return make(tmp_path_factory.mktemp("allan") / "rest.mcap", "--seed", "5")


@pytest.fixture(scope="module")
def watched(bag) -> tuple[list, dict]:
    """Return the stages of an analysis as whoever watches it is told them, and its numbers."""
    stages = []

    @contextmanager
    def bar(text, total):
        stages.append((text, total))
        yield lambda count: stages.append(count)

    with watch(Watcher(bar)):
        return stages, ims.allan(bag).to_dict()


@pytest.fixture(scope="module")
def noise(watched) -> dict:
    """Return what ``--json`` prints of the bag."""
    return watched[1]


@pytest.fixture(scope="module")
def written_analysis(bag, tmp_path_factory) -> tuple[Path, str]:
    """Return the folder of the bag's analysis, and what the program printed of it."""
    folder, printed = tmp_path_factory.mktemp("allan") / "out", io.StringIO()
    arguments = [str(bag), "-o", str(folder), "--topic", "/imu/data_raw", "--truth", "lecture"]
    with redirect_stdout(printed):
        assert allan.main(arguments) == 0
    return folder, printed.getvalue()


def test_progress_is_that_of_the_messages_for_whoever_shows_it(watched):
    heading, *counts = watched[0]
    assert heading == ("read", sum(counts))
    assert len(counts) > 1


def analysed(capsys, *arguments: str) -> dict:
    assert allan.main([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def refusal(capsys, *arguments: str) -> str:
    assert allan.main(list(arguments)) == 2
    return capsys.readouterr().err


def test_json_has_the_promised_form(bag, noise, capsys):
    result = analysed(capsys, str(bag), "--no-files")
    assert result == noise
    assert result["rate_hz"] == pytest.approx(RATE)
    assert result["duration_s"] == pytest.approx(SECONDS)
    for triad, density in (("gyroscope", 0.015), ("accelerometer", 0.019)):
        for key in ("noise_density", "random_walk", "bias_instability"):
            values = result[triad][key]
            assert {len(values[part]) for part in ("value", "low", "high")} == {3}
            for value, low, high in zip(
                *(values[k] for k in ("value", "low", "high")), strict=True
            ):
                assert (low == 0.0) if value is None else (low < value < high)
        # 30,000 samples: the relative standard error is 0.41 %, five of them are 2.1 %.
        assert result[triad]["noise_density"]["value"] == pytest.approx([density] * 3, rel=0.021)


@pytest.mark.parametrize("name", ["rest.bag", "rest", "euroc"])
def test_other_formats_give_the_same(noise, tmp_path, capsys, name):
    extra = ["--format", "euroc"] if name == "euroc" else []
    second_bag = make(tmp_path / name, "--seed", "5", *extra)
    second = analysed(capsys, str(second_bag), "--no-files")
    for triad in ("gyroscope", "accelerometer"):
        assert noise[triad]["noise_density"]["value"] == pytest.approx(
            second[triad]["noise_density"]["value"], rel=1e-6
        )


def test_the_files_hold_picture_table_and_parameters_of_the_noise(written_analysis):
    folder, printed = written_analysis
    assert "rad/s/sqrt(Hz)" in printed
    assert "deg/sqrt(h)" in printed
    assert (folder / "allan.png").read_bytes()[:4] == b"\x89PNG"
    table = np.genfromtxt(folder / "allan.csv", delimiter=",", names=True)
    assert table["gyroscope_x_low"][0] < table["gyroscope_x"][0] < table["gyroscope_x_high"][0]
    assert table["gyroscope_x"][0] == pytest.approx(0.015 * np.sqrt(RATE), rel=0.03)

    kalibr = presets.load(folder / "kalibr_imu.yaml")
    assert kalibr["rate"] == RATE
    assert kalibr["imu.gyroscope_noise_density"] == pytest.approx(0.015, rel=0.02)
    noise = [value for name, value in kalibr.items() if name != "imu.preset"]
    assert all(float(str(value)) > 0.0 for value in noise)
    assert "rostopic: /imu/data_raw" in (folder / "kalibr_imu.yaml").read_text()

    imu = load_simulation(files.load(folder / "imu.yaml")).imu
    assert imu.accelerometer.noise_density == pytest.approx([0.019] * 3, rel=0.021)


def test_imu_utils_in_both_meanings(written_analysis):
    folder, _ = written_analysis
    discrete, continuous = (
        parse_yaml((folder / name).read_text().split("---\n")[1])
        for name in ("imu_utils.yaml", "imu_utils_continuous.yaml")
    )
    ratio = discrete["Gyr"]["x-axis"]["gyr_n"] / continuous["Gyr"]["x-axis"]["gyr_n"]
    assert ratio == pytest.approx(np.sqrt(RATE))
    assert continuous["Acc"]["avg-axis"]["acc_n"] == pytest.approx(0.019, rel=0.02)
    assert set(discrete["Acc"]) == {"unit", "avg-axis", "x-axis", "y-axis", "z-axis"}


def test_imu_utils_has_the_text_of_the_real_tool_and_says_what_is_a_bound(written_analysis, noise):
    """The bag is too short for the random walks: they are known from above only."""
    folder, _ = written_analysis
    text = (folder / "imu_utils.yaml").read_text()
    assert '   unit: " rad/s"\n' in text
    assert '   unit: " m/s^2"\n' in text
    assert "upper bound" not in text
    lines = iter((folder / "imu_utils_continuous.yaml").read_text().splitlines())
    for triad in ("gyroscope", "accelerometer"):
        walk = [value is None for value in noise[triad]["random_walk"]["value"]]
        assert any(walk)
        has_bound = ["upper bound" in line for line in lines_of(lines, "_w", 4)]
        assert has_bound == [any(walk), *walk]


def lines_of(lines, key, count):
    chosen = (line for line in lines if line.startswith(" ") and f"{key}: " in line)
    return [next(chosen) for _ in range(count)]


def test_a_twin_of_the_sensor_can_be_simulated(written_analysis, tmp_path):
    folder, _ = written_analysis
    twin = str(folder / "imu.yaml")
    assert generate.main(["--imu", twin, "--trajectory", "static", "--duration", "1s", "--quiet",
                          "-o", str(tmp_path / "twin.mcap")]) == 0  # fmt: skip
    values = files.load(twin)
    assert build(SimulationParameters, values).rate == RATE


def test_intervals_contain_the_true_noise_and_not_that_of_another_sensor(
    bag, written_analysis, capsys
):
    result = analysed(capsys, str(bag), "--no-files", "--truth", "lecture")
    noise = [c for c in result["truth"] if c["parameter"] == "noise_density"]
    assert [c["truth"] for c in noise] == [0.015] * 3 + [0.019] * 3
    # Six intervals of 95 %: fewer than four hold once in 500 times.
    assert sum(c["covered"] for c in noise) >= 4
    wrong = analysed(capsys, str(bag), "--no-files", "--truth", "adis16448")
    assert not any(c["covered"] for c in wrong["truth"] if c["parameter"] == "noise_density")
    _, printed = written_analysis
    assert "intervals contain the truth" in printed
    tables = [line for line in printed.splitlines() if not line.startswith("note: ")]
    assert max(len(line.rstrip()) for line in tables) <= 90


def test_the_gauss_markov_model_adds_correlation_times(bag, capsys):
    result = analysed(capsys, str(bag), "--no-files", "--model", "gauss_markov")
    assert result["model"] == "gauss_markov"
    assert len(result["gyroscope"]["correlation_time"]["value"]) == 3
    assert result["gyroscope"]["noise_density"]["value"] == pytest.approx([0.015] * 3, rel=0.021)


def test_two_bags_of_one_sensor(bag, tmp_path, capsys):
    second_bag = make(tmp_path / "second.mcap", "--seed", "6")
    assert analysed(capsys, str(bag), str(second_bag), "--no-files")["duration_s"] == 2 * SECONDS


def test_resolution_of_the_readings_counts_as_noise(tmp_path, capsys):
    coarse = "imu.gyroscope_resolution=0.3"  # twice the noise of a sample: LSB^2 / 12 doubles N^2
    path = make(tmp_path / "coarse.mcap", "--set", coarse)
    truth = tmp_path / "truth.yaml"
    truth.write_text(
        "/**:\n  ros__parameters:\n    imu: {gyroscope_noise_density: 0.015, "
        "accelerometer_noise_density: 0.019, gyroscope_resolution: 0.3}\n"
    )
    result = analysed(capsys, str(path), "--no-files", "--truth", str(truth))
    expected = np.sqrt(0.015**2 + 0.3**2 / 12 / RATE)
    assert result["truth"][0]["truth"] == pytest.approx(expected)
    assert result["gyroscope"]["noise_density"]["value"] == pytest.approx([expected] * 3, rel=0.03)


def test_quantisation_of_increments_is_recovered(tmp_path, capsys):
    """Rounded sums of the increments are IEEE Std 952's Q = step / sqrt(12): six axes, 15 min.

    Q has a relative standard error of 2.4 % in such a record (its own intervals say so), the mean
    of three one of 1.4 %; N 0.3 %. Of six 95 % intervals fewer than four hold once in 450 times.
    """
    sensor = {
        "gyroscope_noise_density": 1e-3,
        "gyroscope_bias": 0.0123,
        "gyroscope_increment_resolution": 1e-4,
        "accelerometer_noise_density": 1e-2,
        "accelerometer_increment_resolution": 1e-3,
    }
    yaml_text = "\n".join(f"      {name}: {value}" for name, value in sensor.items())
    truth = tmp_path / "counter.yaml"
    truth.write_text(f"/**:\n  ros__parameters:\n    imu:\n      sampling: averaged\n{yaml_text}\n")
    path = tmp_path / "counter.mcap"
    generate.main(["--imu", str(truth), "--trajectory", "static", "--duration", "15min", "--rate",
                   "100", "--quiet", "--imu-only", "-o", str(path)])  # fmt: skip
    result = analysed(capsys, str(path), "--no-files", "--truth", str(truth))
    q = [c for c in result["truth"] if c["parameter"] == "quantisation"]
    step = 1e-4 / np.sqrt(12.0)
    assert [c["truth"] for c in q] == pytest.approx([step] * 3 + [10.0 * step] * 3)
    assert sum(c["covered"] for c in q) >= 4
    for triad, size in (("gyroscope", 1.0), ("accelerometer", 10.0)):
        estimates = result[triad]
        assert np.mean(estimates["quantisation"]["value"]) == pytest.approx(size * step, rel=0.06)
        assert np.mean(estimates["noise_density"]["value"]) == pytest.approx(size * 1e-3, rel=0.01)


def test_bad_input_is_one_clear_line(bag, tmp_path, capsys):
    moving = tmp_path / "moving.mcap"
    generate.main(["--imu", "lecture", "--trajectory", "lecture", "--duration", "100s", "--rate",
                   "100", "--quiet", "--imu-only", "-o", str(moving)])  # fmt: skip
    reason = refusal(capsys, str(moving), "--no-files")
    assert "not at rest" in reason
    assert "[motion_at_rest]" in reason
    short = tmp_path / "short.mcap"
    generate.main(["--imu", "lecture", "--trajectory", "static", "--duration", "10s", "--rate",
                   "100", "--quiet", "--imu-only", "-o", str(short)])  # fmt: skip
    message = refusal(capsys, str(short), "--no-files")
    assert message.startswith("allan: 10.0 s at rest")
    assert message.count("\n") == 1
    assert "/nothing" in refusal(capsys, str(bag), "--topic", "/nothing", "--no-files")
    assert "missing.mcap" in refusal(capsys, str(tmp_path / "missing.mcap"), "--no-files")
    assert "nobody" in refusal(capsys, str(bag), "--truth", "nobody", "--no-files")


def test_perfect_readings_have_nothing_to_analyse(tmp_path, capsys):
    path = tmp_path / "perfect.mcap"
    generate.main(["--imu", "perfect", "--trajectory", "static", "--duration", "100s", "--rate",
                   "100", "--quiet", "--imu-only", "-o", str(path)])  # fmt: skip
    assert refusal(capsys, str(path), "--no-files").count("always") == 6


def test_an_axis_that_is_not_analysed_is_null_and_makes_no_configuration(tmp_path, capsys):
    path = make(tmp_path / "dead.mcap", "--set", "imu.gyroscope_resolution=100.0",
                "--set", "imu.accelerometer_resolution=1.0")  # fmt: skip
    folder = tmp_path / "out"
    arguments = [str(path), "-o", str(folder), "--skip-checks"]
    result = analysed(capsys, *arguments)
    assert list(result["not_analysed"]) == [f"gyroscope {axis}" for axis in "xyz"]
    assert all("always 0" in reason for reason in result["not_analysed"].values())
    for estimate in result["gyroscope"].values():
        assert estimate == {"value": [None] * 3, "low": [None] * 3, "high": [None] * 3}
    assert all(high > 0.0 for high in result["accelerometer"]["noise_density"]["high"])
    assert sorted(file.name for file in folder.iterdir()) == ["allan.csv", "allan.png"]
    (folder / "imu.yaml").write_text("of an earlier record")
    assert allan.main([*arguments, "--force"]) == 0
    printed = capsys.readouterr().out
    assert "not analysed" in printed
    assert "no configuration files: gyroscope x" in printed
    assert not (folder / "imu.yaml").exists()


def test_noise_that_the_resolution_hides_is_written_as_its_bound(tmp_path):
    """0.15 rad/s per sample in steps of 0.5, around a code's edge: a bound stands in the file."""
    path = make(tmp_path / "coarse.mcap", "--set", "imu.gyroscope_resolution=0.5",
                "--set", "imu.gyroscope_bias=[0.25,0.25,0.25]")  # fmt: skip
    assert allan.main([str(path), "-o", str(tmp_path / "out"), "--quiet"]) == 0
    text = (tmp_path / "out" / "imu.yaml").read_text()
    assert "White noise of gyroscope x, gyroscope y, gyroscope z: an upper bound" in text
    imu = load_simulation(files.load(tmp_path / "out" / "imu.yaml")).imu
    assert min(imu.gyroscope.noise_density) > 0.015


@pytest.mark.parametrize("form", ["g.csv", "g.mcap"])
def test_readings_in_g_are_told_with_the_option_that_converts_them(tmp_path, form):
    """The noise of an accelerometer in g is a tenth of what it should be, without a word before."""
    flight = ims.simulate(imu="adis16448", trajectory="static", duration="2min", rate=100, seed=1)
    file = tmp_path / form
    gyro = np.tile(flight.gyro[0], (len(flight), 1))  # constant axes are not analysed
    in_g = Readings(flight.t_ns, gyro, flight.accel / 9.80665)
    if form.endswith("csv"):
        table = np.column_stack([in_g.gyro, in_g.accel])
        rows = [
            f"{t}," + ",".join(map(repr, row))
            for t, row in zip(in_g.t_ns, table.tolist(), strict=True)
        ]
        file.write_text("\n".join(rows) + "\n")
    else:
        with open_writer(file) as writer:
            payloads = ImuEncoder("imu").encode(in_g.t_ns, *in_g.triads())
            writer.write(writer.add_topic("/imu", IMU), in_g.t_ns, payloads)
    noise = ims.allan(file, force=True)
    assert any("accel_unit" in line or "--accel-unit g" in line for line in noise.warnings)
    converted = ims.allan(file, accel_unit="g", force=True)
    assert not any("accel-unit" in line for line in converted.warnings)
    ratio = converted.accelerometer.noise_density.value / noise.accelerometer.noise_density.value
    assert ratio == pytest.approx([9.80665] * 3, rel=1e-6)
