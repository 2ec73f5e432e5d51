# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One run of each command that needs no ROS, the next one on what the last one wrote."""

import importlib
import json
import subprocess
import sys

import yaml
from openings import count_openings

from imu_sim_ros import __version__
from imu_sim_ros.commands.start import PROGRAMS

TUMBLE = "--trajectory excitation --imu adis16448 --rate 50 --duration 20s --seed 2 --quiet"
RUNS = [
    f"generate {TUMBLE} -o flight.mcap --with-configs",
    f"generate {TUMBLE} -o flight.bag",
    f"generate {TUMBLE} -o flight_db3 --storage sqlite3",
    "generate --imu lecture --trajectory static --rate 50 --duration 10min --quiet -o rest.mcap",
    "generate --imu lecture --trajectory six_position --rate 20 --quiet -o six.mcap",
    "generate --camera euroc_cam0 --scene house --duration 1s --format tracks --quiet -o tracks",
    "convert_bag flight.bag -o euroc --format euroc --json",
    "convert_bag flight_db3 -o flight.tum --json",
    "convert_bag flight.mcap -o flight.csv --json",
    "add_errors euroc -o noisy.mcap --imu bmi088 --json",
    "dead_reckon flight.mcap -o track.tum --plot track.png --json",
    "evaluate track.tum flight.tum --align se3 --plot errors.png --json",
    "allan rest.mcap --force -o allan --json",
    "calibrate six_position six.mcap -o six --json",
    "twin flight.mcap --truth flight.mcap --truth-topic /ground_truth/odom -o twin --json",
    "campaign plan.yaml -o campaign --workers 1 --json",
    "inspect flight.mcap euroc flight.csv --json -o inspect.html",
    "convert_bag rest.mcap -o rest.csv --json",
    "allan rest.csv --force -o allan_of_table --json",
    "dead_reckon euroc -o track_of_folder.tum --json",
    "report campaign flight.mcap -o page.html --quiet",
]
PLAN = {
    "parameters": {"rate": 50.0, "duration": 2.0, "imu": "adis16448"},
    "seeds": 2,
    "estimators": {"euler": {"type": "dead_reckon", "method": "euler"}},
}


def test_each_runs_once(tmp_path, monkeypatch, capsys):
    """Each program works, and opens each file that it reads once."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(PLAN))
    assert {line.split()[0] for line in RUNS} == set(PROGRAMS) - {"control", "view"}
    for line in RUNS:
        program, *argv = line.split()
        with count_openings(tmp_path) as counts:
            status = importlib.import_module(f"imu_sim_ros.commands.{program}").main(argv)
        captured = capsys.readouterr()
        often = {path for path, count in counts.items() if count > 1}
        assert not often, (line, often)
        assert status == 0, (line, captured.err)
        if "--json" in argv:
            assert json.loads(captured.out), line
    for name in ("track.png", "errors.png", "twin/twin.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    for name in (
        "euroc/imu0/data.csv",
        "allan/imu.yaml",
        "campaign/results.csv",
        "page.html",
        "inspect.html",
    ):
        assert (tmp_path / name).stat().st_size > 0, name


AS_MODULES = """
import runpy, sys
for name in sys.argv[1:]:
    sys.argv = [name, "--version"]
    try:
        runpy.run_module(name, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        assert not end.code, name
    else:
        raise AssertionError(f"{name} did nothing")
    # What another program has loaded would be run a second time, of which Python warns.
    for loaded in [key for key in sys.modules if key.startswith("imu_sim_ros.commands")]:
        del sys.modules[loaded]
"""


def test_python_runs_each_program_as_a_module():
    """Run all programs as ``python -m`` does, in one process."""
    modules = [f"imu_sim_ros.commands.{program}" for program in PROGRAMS]
    argv = [sys.executable, "-c", AS_MODULES, *modules]
    output = subprocess.run(argv, capture_output=True, text=True, check=True, timeout=120).stdout
    assert [line.split()[-1] for line in output.splitlines()] == [__version__] * len(modules)


def test_python_runs_the_package_as_a_module():
    argv = [sys.executable, "-m", "imu_sim_ros", "--version"]
    output = subprocess.run(argv, capture_output=True, text=True, check=True, timeout=120).stdout
    assert output.split()[-1] == __version__
