# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Programs whose arguments, streams or surroundings nobody should give them."""

import importlib
import os
import subprocess
import sys

import programs
import pytest

from imu_sim_ros.commands import (
    allan,
    calibrate,
    convert_bag,
    dead_reckon,
    evaluate,
    generate,
    program,
    report,
)
from imu_sim_ros.commands.common import outputs
from imu_sim_ros.commands.start import PROGRAMS
from imu_sim_ros.core.errors import InputError

GENERATE = [*programs.program("generate"), "--duration", "1s", "--json"]


def _shell(command, folder, **options):
    return subprocess.run(
        ["/bin/bash", "-o", "pipefail", "-c", command],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        **options,
    )


def test_standard_output_that_is_full_closed_or_read_no_further(tmp_path):
    command = " ".join(GENERATE)
    full = _shell(f"{command} -o full.mcap > /dev/full", tmp_path)
    assert full.returncode == 1
    assert full.stderr == "generate: No space left on device\n"
    closed = _shell(f"{command} -o closed.mcap >&- && {command} -o both.mcap >&- 2>&-", tmp_path)
    assert (closed.returncode, closed.stderr) == (0, "")
    cut = _shell(f"{command} --help | head -1", tmp_path)
    assert "Traceback" not in cut.stderr
    assert "Exception ignored" not in cut.stderr
    bags = sorted(name for name in os.listdir(tmp_path) if name.endswith(".mcap"))
    assert bags == ["both.mcap", "closed.mcap", "full.mcap"]


def test_a_working_folder_that_was_deleted(tmp_path):
    command = f"mkdir gone; cd gone; rmdir ../gone; {' '.join(GENERATE)} -o x.mcap"
    environment = {**os.environ, "PYTHONPATH": os.getcwd()}
    result = _shell(command, tmp_path, env=environment)
    assert result.returncode in (1, 2)
    assert "Traceback" not in result.stderr
    assert len(result.stderr.splitlines()) <= 2


@pytest.mark.parametrize(
    "arguments",
    [
        ["--x=--"],
        ["--rate", "9" * 400],
        ["--duration", "9" * 400],
        ["--split-size", "9" * 400],
        ["--split-duration", "9" * 400],
        ["--seed", "9" * 5000],
        ["--imu", "A" * 5000],
        ["--trajectory", "A" * 5000],
        ["--set", "A" * 5000],
        ["--topic", "=" * 5000],
    ],
)
def test_arguments_without_measure_are_short_lines(tmp_path, monkeypatch, capsys, arguments):
    monkeypatch.chdir(tmp_path)
    try:
        status = generate.main(["-o", "x.mcap", "--duration", "1s", *arguments])
    except SystemExit as ended:
        status = ended.code
    error = capsys.readouterr().err
    assert status in (0, 2), error
    assert "Traceback" not in error
    assert "unexpected" not in error
    assert all(len(line) < 1200 for line in error.splitlines())


@pytest.mark.parametrize(
    ("command", "arguments", "parts"),
    [
        (
            generate,
            ["--seed", "nan", "--format", "foo", "--rate", "abc"],
            ["--seed: ", "unknown --format 'foo'", "--rate: ", "required: -o/--output"],
        ),
        (generate, ["--bogus", "--rat", "5"], ["'--bogus'", "'--rat'; did you mean --rate?"]),
        (evaluate, ["a", "b", "c", "d"], ["unexpected arguments 'c', 'd'"]),
        (evaluate, ["a", "b", "c"], ["unexpected argument 'c'"]),
        (calibrate, ["--rates", "5", "turntable", "x"], ["'--rates' belongs after turntable or "]),
        (calibrate, ["turnt", "--rates", "5"], ["unknown run 'turnt'"]),
    ],
)
def test_every_problem_of_a_command_line_is_a_line(capsys, command, arguments, parts):
    with pytest.raises(SystemExit) as ended:
        command.main(arguments)
    assert ended.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(parts)
    for line, part in zip(lines, parts, strict=True):
        assert part in line
        assert line.endswith(" (--help lists the arguments)")


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (
            "--imu mpu600 --trajectory cirle --rate 0 --duration nan --gnss x --wheels y --lidar z",
            [
                *("unknown trajectory 'cirle'", "--duration: 'nan' is not", "unknown gnss 'x'"),
                *("unknown wheels 'y'", "unknown lidar 'z'", "unknown IMU 'mpu600'"),
                "--rate 0.0: must be",
            ],
        ),
        (
            "--camera x --camera y --scene z --set scene.size=9 --set trajectory.radius=1 --seed 3",
            [
                *("unknown scene 'z'", "unknown camera 'x'", "unknown camera 'y'"),
                "trajectory.radius: unknown parameter",
            ],
        ),
        (
            "--set imus=[a,b] --set a.imu.preset=x --set imu.barometer_preset=y",
            ["unknown barometer 'y'", "unknown IMU 'x'"],
        ),
        (
            # The preset may have the threshold that this needs.
            "--imu mpu600 --set imu.gyroscope_shock_bias_sigma=0.001",
            ["unknown IMU 'mpu600'"],
        ),
        (
            # What a file describes that cannot be read is not known, nor what is wrong next to it.
            "--params-file gone.yaml --trajectory cirle --set x=1 --set trajectory.radius=1",
            ["gone.yaml: No such file", "unknown trajectory 'cirle'"],
        ),
    ],
)
def test_every_name_that_does_not_exist_is_a_line(tmp_path, capsys, arguments, parts):
    assert generate.main(["-o", str(tmp_path / "x.mcap"), *arguments.split()]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(parts), lines
    for line, part in zip(lines, parts, strict=True):
        assert part in line
    assert not list(tmp_path.iterdir())


GONE = ": No such file"


@pytest.mark.parametrize(
    ("command_line", "parts"),
    [
        ("evaluate a b --tracks c", ["a" + GONE, "b" + GONE, "c/cameras.yaml" + GONE]),
        ("evaluate empty.txt no.bag", ["empty.txt: contains no poses", "no.bag: not a bag"]),
        ("evaluate a b --estimate-topic imu/data", ["a" + GONE, "b" + GONE]),
        (
            "evaluate flight.mcap b --estimate-topic imu/mag",
            ["flight.mcap: has no topic imu/mag", "b" + GONE],
        ),
        ("twin a --truth b", ["a" + GONE, "b" + GONE]),
        ("allan a flight.mcap no.bag", ["a" + GONE, "no.bag: not a bag"]),
        (
            "calibrate turntable a --accelerometer b --truth c",
            ["a" + GONE, "b" + GONE, "unknown IMU 'c'"],
        ),
        ("dead_reckon a --correction b", ["a" + GONE, "b" + GONE]),
        (
            "add_errors a -o x.mcap --params-file b --imu c",
            ["b" + GONE, "unknown IMU 'c'", "a" + GONE],
        ),
        (
            "report no.bag a flight.mcap empty.txt --baseline b",
            [*(f"{name}: no such file or folder" for name in "ab"), "no.bag: ", "empty.txt: "],
        ),
    ],
)
def test_every_input_that_cannot_be_read_is_a_line(
    tmp_path, monkeypatch, capsys, command_line, parts
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty.txt").touch()
    (tmp_path / "no.bag").write_text("words")
    assert generate.main(["-o", "flight.mcap", "--rate", "50", "--duration", "1s", "--quiet"]) == 0
    program, *argv = command_line.split()
    assert importlib.import_module(f"imu_sim_ros.commands.{program}").main(argv) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(parts), lines
    for part in parts:
        assert any(part in line for line in lines), lines


def test_an_unforeseen_error_is_one_line_and_a_traceback_on_request(capsys):
    def fail():
        raise KeyError("what")

    assert program.run("program", fail) == 1
    line = "program: unexpected: KeyError: 'what'; run with --debug for the traceback\n"
    assert capsys.readouterr().err == line
    assert program.run("program", fail, debug=True) == 1
    assert "Traceback" in capsys.readouterr().err


def test_every_output_is_checked_before_any_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{k}.0 {k} {k % 3} 0 0 0 0 1\n" for k in range(20))
    (tmp_path / "truth.txt").write_text(rows)
    (tmp_path / "there.png").write_text("mine")
    for options, message in (
        (["-o", "a.txt", "--plot", "there.png"], "there.png: already exists"),
        (["-o", "a.png", "--plot", "a.png"], "two outputs would have this name"),
        (["-o", "a.txt", "--plot", "/dev/null"], "must end in .png or .svg or .pdf"),
        (["-o", "truth.txt", "--force"], "is the input truth.txt"),
    ):
        assert evaluate.main(["truth.txt", "truth.txt", *options]) == 2
        assert message in capsys.readouterr().err
    assert sorted(os.listdir(tmp_path)) == ["there.png", "truth.txt"]
    assert (tmp_path / "truth.txt").read_text() == rows
    assert evaluate.main(["truth.txt", "truth.txt", "-o", "new/folder/a.txt", "--quiet"]) == 0
    assert (tmp_path / "new" / "folder" / "a.txt").is_file()


def test_a_folder_named_like_a_word_of_the_command_is_no_input(tmp_path, monkeypatch, capsys):
    """``calibrate magnetometer`` writes the folder ``magnetometer``, ``--format euroc`` may too."""
    monkeypatch.chdir(tmp_path)
    dataset = ["-o", "euroc/mav0", "--format", "euroc", "--duration", "1s", "--quiet"]
    assert generate.main(dataset) == 0
    assert generate.main(dataset) == 2
    assert "never overwritten" not in capsys.readouterr().err
    assert generate.main([*dataset, "--force"]) == 0
    (tmp_path / "magnetometer").mkdir()
    parsed = calibrate.parser().parse_args(["magnetometer", "euroc/mav0"])
    (tmp_path / "magnetometer" / "imu.yaml").write_text("of an earlier run")
    written = outputs(parsed)
    written.add_files("magnetometer", ["imu.yaml"])
    with pytest.raises(InputError, match="already exists"), written.stage():
        pass


def test_options_stand_between_several_inputs(tmp_path):
    parsed = report.parser().parse_every(["a", "-o", "x.html", "b", "--quiet", "c"])
    assert [str(path) for path in parsed.inputs] == ["a", "b", "c"]
    assert parsed.words == {"accel_unit", "gyro_unit"}
    parsed = allan.parser().parse_every(["a", "--json", "b"])
    assert [str(path) for path in parsed.source] == ["a", "b"]


def test_bad_rows_are_skipped_on_request_and_counted(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    rows = [f"{k}.0 {k} 0 0 0 0 0 1" for k in range(20)]
    rows[7] = "7.0 7 0 0"
    (tmp_path / "poses.tum").write_text("\n".join(rows))
    assert convert_bag.main(["poses.tum", "-o", "x.mcap"]) == 2
    assert "line 8: 4 columns" in capsys.readouterr().err
    assert convert_bag.main(["poses.tum", "-o", "x.mcap", "--skip-bad-rows"]) == 0
    assert "convert_bag: poses.tum: 1 bad rows skipped" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["", ".", "..", "/"])
@pytest.mark.parametrize("options", [[], ["--with-configs"]])
def test_an_output_without_a_name_is_one_line(tmp_path, monkeypatch, capsys, name, options):
    monkeypatch.chdir(tmp_path)
    assert generate.main(["-o", name, "--duration", "1s", *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("is not a file name")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "command_line",
    [["generate", "--help"], ["imu_sim", "--help"], ["imu_sim", "--version"]],
    ids=str,
)
def test_a_help_that_cannot_be_printed_is_one_line(command_line):
    program = (
        f"import sys; from imu_sim_ros.commands import start; sys.exit(start.{command_line[0]}())"
    )
    with open("/dev/full", "w") as full:
        result = subprocess.run(
            [sys.executable, "-c", program, *command_line[1:]],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert result.returncode == 1
    assert result.stderr == f"{command_line[0]}: No space left on device\n"


def test_a_parameter_set_to_nothing_is_an_empty_string(tmp_path, capsys):
    output = str(tmp_path / "a.bag")
    assert generate.main(["-o", output, "--duration", "1s", "--set", "rate="]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("generate: rate = '': must be a finite number above 0")
    assert not (tmp_path / "a.bag").exists()


@pytest.mark.parametrize("value", ["-1s", "-.5s", "-2h"])
def test_a_negative_time_is_a_value_and_not_an_option(tmp_path, capsys, value):
    assert generate.main(["-o", str(tmp_path / "x.mcap"), "--duration", value]) == 2
    assert f"'{value}' is not a duration such as 20s" in capsys.readouterr().err


def test_values_of_a_file_that_outlive_a_named_sensor_are_said(tmp_path, capsys):
    path = tmp_path / "own.yaml"
    path.write_text(
        "/**:\n  ros__parameters:\n    imu: {preset: lecture, accelerometer_range: 10.0}\n"
    )
    output = ["-o", str(tmp_path / "x.mcap"), "--duration", "0.1s", "--force"]
    common_part = [*output, "--params-file", str(path)]
    assert generate.main([*common_part, "--imu", "mpu6000"]) == 0
    error = capsys.readouterr().err
    assert "note: --imu mpu6000 is the base of the parameter file" in error
    assert "precedence: imu.accelerometer_range\n" in error
    assert generate.main(common_part) == 0
    assert "note" not in capsys.readouterr().err


_WITHOUT_NAME = ["/", ".", "..", ""]
_COMMANDS = {
    name: importlib.import_module(f"imu_sim_ros.commands.{name}")
    for name in PROGRAMS
    if name != "control"
}
_READING = [
    ("add_errors", ["PATH", "-o", "made.mcap"]),
    ("allan", ["PATH", "-o", "made"]),
    ("calibrate", ["six_position", "PATH", "-o", "made"]),
    ("campaign", ["PATH", "-o", "made"]),
    ("convert_bag", ["PATH", "-o", "made.mcap"]),
    ("dead_reckon", ["PATH"]),
    ("dead_reckon", ["flight.mcap", "--correction", "PATH"]),
    ("evaluate", ["PATH", "flight.mcap"]),
    ("evaluate", ["track.tum", "PATH"]),
    ("generate", ["--params-file", "PATH", "-o", "made.mcap"]),
    ("inspect", ["PATH"]),
    ("report", ["PATH"]),
    ("twin", ["PATH", "--truth", "flight.mcap", "-o", "made"]),
    ("twin", ["flight.mcap", "--truth", "PATH", "-o", "made"]),
    ("view", ["PATH", "--save", "made.rrd"]),
    ("view", ["flight.mcap", "PATH", "--save", "made.rrd"]),
]
_WRITING = [
    ("add_errors", ["flight.mcap", "--without", "imu/data_raw"]),
    ("allan", ["flight.mcap", "--skip-checks"]),
    ("calibrate", ["six_position", "flight.mcap"]),
    ("campaign", ["allan_coverage"]),
    ("convert_bag", ["flight.mcap"]),
    ("dead_reckon", ["flight.mcap"]),
    ("evaluate", ["flight.mcap", "flight.mcap"]),
    ("generate", ["--duration", "1s", "--force"]),
    ("generate", ["--duration", "1s", "--with-configs"]),
    ("inspect", ["flight.mcap"]),
    ("report", ["flight.mcap"]),
    ("twin", ["flight.mcap", "--truth", "flight.mcap"]),
]


@pytest.fixture
def flight(tmp_path, monkeypatch):
    """Return a working folder, below others, with a bag in it."""
    folder = tmp_path / "above" / "here"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    arguments = ["-o", "flight.mcap", "--duration", "2s", "--rate", "100", "--quiet"]
    assert _COMMANDS["generate"].main(arguments) == 0
    rows = (f"{0.1 * k:.1f} {k} 0 0 0 0 0 1\n" for k in range(20))
    (folder / "track.tum").write_text("".join(rows))
    return folder


def _refusal(capsys, program, arguments):
    capsys.readouterr()
    status = _COMMANDS[program].main(arguments)
    error_text = capsys.readouterr().err
    assert status == 2, (program, arguments, error_text)
    assert len(error_text.splitlines()) == 1, (program, arguments, error_text)
    assert "unexpected" not in error_text


def test_every_command_that_reads_or_writes_is_asked():
    asked = {program for program, _ in _READING + _WRITING}
    assert asked == set(PROGRAMS) - {"control"}


@pytest.mark.parametrize("path", _WITHOUT_NAME)
def test_paths_without_a_name_are_refused_in_a_line(flight, capsys, path):
    files_present = sorted(flight.parent.parent.rglob("*"))
    for name, arguments in _READING:
        _refusal(capsys, name, [path if word == "PATH" else word for word in arguments])
    for name, arguments in _WRITING:
        _refusal(capsys, name, [*arguments, "-o", path])
    assert sorted(flight.parent.parent.rglob("*")) == files_present


def test_the_working_folder_is_a_bag_like_any_other(flight, monkeypatch, capsys):
    """Side files bear the name of the folder, too: the truth has the Earth's rotation."""
    simulated = ["--duration", "2s", "--rate", "100", "--set", "earth_rotation=true", "--quiet"]
    assert generate.main(["-o", "bag", *simulated]) == 0
    capsys.readouterr()
    assert dead_reckon.main(["bag", "--json"]) == 0
    printed = capsys.readouterr().out
    monkeypatch.chdir(flight / "bag")
    assert dead_reckon.main([".", "--json"]) == 0
    assert capsys.readouterr().out == printed
    assert report.main([".", "--quiet"]) == 0
    assert (flight / "bag.html").is_file()


def test_names_that_are_no_unicode_are_written_wherever_names_stand(tmp_path, capsys):
    name = os.fsdecode(b"st\xe9")
    bag, title = str(tmp_path / f"{name}.mcap"), f"--title={name}"
    assert generate.main(["-o", bag, "--duration", "1s", "--quiet"]) == 0
    folder = str(tmp_path / f"{name}_folder")
    assert generate.main(["-o", folder, "--duration", "1s", "--with-configs", "--quiet"]) == 0
    page, plot = tmp_path / "page.html", tmp_path / "track.png"
    assert report.main([bag, "-o", str(page), title, "--quiet"]) == 0
    assert "st\\udce9" in page.read_text(encoding="utf-8")
    assert dead_reckon.main([bag, "--plot", str(plot), "--quiet"]) == 0
    assert plot.is_file()
    assert "unexpected" not in capsys.readouterr().err
