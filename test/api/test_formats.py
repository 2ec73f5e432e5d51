# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every program that reads takes every format: one flight, recorded in each of them."""

import csv
import importlib
import json

import device_logs
import numpy as np
import pytest
import ulog

import imu_sim_ros as ims
from imu_sim_ros.commands.start import PROGRAMS
from imu_sim_ros.formats.door import FORMATS, format_of

pytestmark = pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")
DURATION, RATE = 8.0, 100.0


@pytest.fixture(scope="module")
def flight():
    return ims.simulate(
        imu="bmi088", trajectory="figure_eight", duration=DURATION, rate=RATE, seed=3, start_time=9
    )


def table(path, header, columns, separator=","):
    """Write columns under a header, stamps as whole nanoseconds."""
    rows = np.column_stack(columns[1:]).tolist()
    lines = [separator.join(map(repr, (t, *row))) for t, row in zip(columns[0], rows, strict=True)]
    path.write_text("\n".join([header, *lines]) + "\n")
    return path


def units(folder, flight):
    """Write a table in units that its header states."""
    readings = flight.readings
    header = "t [ns],ax [g],ay [g],az [g],gx [deg/s],gy [deg/s],gz [deg/s]"
    values = (readings.accel / 9.80665, np.degrees(readings.gyro))
    return table(folder / "units.csv", header, (readings.t_ns.tolist(), *values))


def vio_data_simulation(folder, flight):
    """Write the folder of HeYijia/vio_data_simulation: t, q, p, gyro, acc."""
    path, truth = folder / "vio", flight.truth
    path.mkdir()
    t = truth.t_ns * 1e-9
    pose = (t, truth.q_wb, truth.position)
    ideal = (truth.gyro, truth.accel)
    np.savetxt(path / "imu_pose.txt", np.column_stack([*pose, *ideal]), "%.17g")
    noisy = (flight.readings.gyro, flight.readings.accel)
    np.savetxt(path / "imu_pose_noise.txt", np.column_stack([*pose, *noisy]), "%.17g")
    return path


def tum(folder, flight):
    path, truth = folder / "poses.tum", flight.truth
    values = np.column_stack([truth.t_ns * 1e-9, truth.position, truth.q_wb[:, [1, 2, 3, 0]]])
    np.savetxt(path, values, "%.17g")
    return path


def states_table(folder, flight):
    truth = flight.truth
    header = "stamp [ns],qw,qx,qy,qz,x,y,z,vx,vy,vz"
    columns = (truth.t_ns.tolist(), truth.q_wb, truth.position, truth.velocity)
    return table(folder / "states.csv", header, columns)


def px4(folder, flight):
    return ulog.write(folder / "flight.ulg", ulog.flight_topics(flight))


def vectornav(folder, flight):
    return device_logs.vectornav(folder / "vn.txt", flight, time="counter")


def sqlite3(folder, flight):
    source = flight.save(folder / "source.mcap")
    return ims.convert(source, folder / "sqlite3", storage="sqlite3").output


BOTH = {
    "mcap": lambda folder, flight: flight.save(folder / "flight.mcap"),
    "rosbag2 sqlite3": sqlite3,
    "ROS 1": lambda folder, flight: flight.save(folder / "flight.bag"),
    "EuRoC": lambda folder, flight: flight.save(folder / "euroc", format="euroc"),
    "vio_data_simulation": vio_data_simulation,
    "ULog": px4,
}
"""Formats with readings and true states; the first is the reference."""
READINGS = {
    "EuRoC's table": lambda folder, flight: flight.save(folder / "flight.csv"),
    "kalibr's folder": lambda folder, flight: flight.save(folder / "kalibr", format="csv"),
    "table with units": units,
    "VectorNav": vectornav,
}
STATES = {"TUM": tum, "table of states": states_table}


def thermometer(folder, flight):
    """Write a table with the temperature in kelvins."""
    readings = flight.readings
    header = "t [ns],gx,gy,gz,ax,ay,az,T [K]"
    kelvin = readings.temperature + 273.15
    columns = (readings.t_ns.tolist(), readings.gyro, readings.accel, kelvin)
    return table(folder / "thermometer.csv", header, columns)


def with_temperature(name, **options):
    """Return what writes the readings and the temperatures of the flight in a bag."""

    def write(folder, flight):
        source = thermometer(folder, flight)
        return ims.convert(source, folder / f"warm_{name}", **options).output

    return write


WITH_TEMPERATURE = {
    "table with temperature": thermometer,
    **{f"bag {name}": with_temperature(name) for name in ("warm.mcap", "warm.bag")},
    "bag sqlite3": with_temperature("sqlite3", storage="sqlite3"),
}


@pytest.fixture(scope="module")
def files(tmp_path_factory, flight):
    """Return the path of each format of the flight."""
    pytest.importorskip("pyulog")
    folder = tmp_path_factory.mktemp("formats")
    writers = BOTH | READINGS | STATES | WITH_TEMPERATURE
    return {name: write(folder, flight) for name, write in writers.items()}


def test_every_format_of_the_door_has_its_sample(files):
    assert {format_of(path) for path in files.values()} == set(FORMATS)


def test_every_program_is_tried_on_files():
    tried = {program.partition(" ")[0] for program, *_ in CASES.values()}
    assert tried == set(PROGRAMS) - {"control"}  # which reads no file


def run(capsys, name, *arguments):
    """Return status, the JSON of standard output, and standard error of a program."""
    program, *subcommand = name.split()
    main = importlib.import_module(f"imu_sim_ros.commands.{program}").main
    status = main([*subcommand, *map(str, arguments)])
    captured = capsys.readouterr()
    return status, json.loads(captured.out or "{}"), captured.err


def final_state(path):
    states = ims.read_states(path)
    return [len(states), *states.position[-1], *np.abs(states.q_wb[-1])]


def mean_reading(path):
    readings = ims.read_readings(path)
    return [len(readings), *np.mean(np.hstack(readings.triads()), axis=0)]


def saved(folder, name, *options):
    return ("-o", folder / name, "--force", "--json", *options)


READERS = {
    "add_errors": (
        lambda path, folder: (path, *saved(folder, "a.csv", "--imu", "perfect")),
        lambda result, folder: mean_reading(folder / "a.csv"),
    ),
    "allan": (lambda path, folder: (path, "--no-files", "--json"), None),
    "calibrate six_position": (lambda path, folder: (path, "--json"), None),
    "calibrate turntable": (lambda path, folder: (path, "--rates", "1,2", "--json"), None),
    "convert_bag": (
        lambda path, folder: (path, *saved(folder, "c.csv")),
        lambda result, folder: mean_reading(folder / "c.csv"),
    ),
    "inspect": (
        lambda path, folder: (path, "--json"),
        lambda result, folder: [result["sensors"][0][k] for k in ("readings", "duration_s")],
    ),
    "report": (
        lambda path, folder: (path, *saved(folder, "page.html")),
        lambda result, folder: ["800 readings" in (folder / "page.html").read_text()],
    ),
    "twin": (lambda path, folder: (path, "--truth", "TRUTH", "--no-files", "--json"), None),
    "view": (
        lambda path, folder: (path, "--save", folder / "a.rrd", "--force", "--json"),
        lambda result, folder: [result["readings"]],
    ),
}
"""Arguments of a program for a path and a folder, and numbers of its result; None: the flight is
too short or not still enough, and is refused in the same words whatever its format."""


def _errors_of_runs(folder):
    """Return the final position errors of a campaign's runs."""
    rows = list(csv.DictReader((folder / "results.csv").read_text().splitlines()))
    return [float(row["final_position_error_m"]) for row in rows]


def plan_of_recorded_poses(path, folder):
    """Return the arguments of a campaign of one run along recorded poses."""
    plan = folder / "plan.yaml"
    plan.write_text(
        f"parameters: {{trajectory: '{path}', imu: bmi088, rate: 50.0, duration: 5.0}}\n"
        "estimators: {dead_reckoning: {}}\nseeds: 1\n"
    )
    return plan, "-o", folder / "runs", "--force", "--workers", "1", "--no-report", "--json"


READERS_OF_STATES = {
    "campaign": (
        plan_of_recorded_poses,
        lambda result, folder: [result["runs"], *_errors_of_runs(folder / "runs")],
    ),
    "convert_bag": (
        lambda path, folder: (path, *saved(folder, "c.tum", "--format", "tum")),
        lambda result, folder: final_state(folder / "c.tum"),
    ),
    "evaluate": (
        lambda path, folder: ("TRUTH", path, "--json"),
        lambda result, folder: [result["poses"], result["ate_m"]["rmse"]],
    ),
    "generate": (
        lambda path, folder: (
            *("--trajectory", path, "--duration", "5s", "--imu", "perfect", "--rate", "50"),
            *saved(folder, "g.csv", "--format", "csv"),
        ),
        lambda result, folder: mean_reading(folder / "g.csv"),
    ),
    "inspect": (lambda path, folder: (path, "--json"), lambda result, folder: [len(result) > 0]),
    "twin": (lambda path, folder: ("RECORDING", "--truth", path, "--no-files", "--json"), None),
}
WITH_TRUTH = {
    "dead_reckon": (
        lambda path, folder: (path, "--json"),
        lambda result, folder: [result["samples"], result["final_position_error_m"]],
    ),
    "calibrate turntable": (lambda path, folder: (path, "--json"), None),
    "view": (
        lambda path, folder: (path, "--save", folder / "a.rrd", "--force", "--json"),
        lambda result, folder: [result["paths"]],
    ),
}
"""Programs that take the truth from the file of the readings."""
WITHOUT_TRUTH = {
    "dead_reckon": (lambda path, folder: (path, "--initial-state", "level", "--json"), None),
}
ESTIMATES = {
    "evaluate": (
        lambda path, folder: (path, "RECORDED", "--json"),
        lambda result, folder: [result["poses"], result["ate_m"]["rmse"]],
    ),
}
TEMPERATURES = {
    "calibrate temperature": (lambda path, folder: (path, "--rates", "1", "--json"), None),
    "inspect": (
        lambda path, folder: (path, "--json"),
        lambda result, folder: [result["temperatures"][0][k] for k in ("lowest", "highest")],
    ),
}
CASES = {
    f"{program}, {kind}": (program, names, *entry)
    for kind, names, programs in (
        ("readings", BOTH | READINGS, READERS),
        ("states", BOTH | STATES, READERS_OF_STATES),
        ("truth", BOTH, WITH_TRUTH),
        ("no truth", READINGS, WITHOUT_TRUTH),
        ("estimate", STATES, ESTIMATES),
        ("temperatures", WITH_TEMPERATURE, TEMPERATURES),
    )
    for program, entry in programs.items()
}


@pytest.mark.parametrize("case", CASES)
def test_every_program_takes_every_format(files, case, capsys, tmp_path):
    program, names, arguments, numbers = CASES[case]
    if program == "view":
        pytest.importorskip("rerun")
    other_files = {"TRUTH": files["TUM"], "RECORDING": files["EuRoC's table"]}
    other_files["RECORDED"] = files["mcap"]
    expected = None
    for name in names:
        command_arguments = [
            other_files.get(word, word) for word in arguments(files[name], tmp_path)
        ]
        status, result, text = run(capsys, program, *command_arguments)
        if numbers is None:
            assert status == 2, (name, text)
            value = text.replace(str(files[name]), "FILE").replace(files[name].name, "FILE")
            value = value.splitlines()[-1]
            assert expected in (None, value), name
        else:
            assert status == 0, (name, text)
            value = numbers(result, tmp_path)
            # Stamps of ULog are whole microseconds, its numbers have 24 bits.
            assert expected is None or value == pytest.approx(expected, rel=1e-4, abs=1e-4), name
        expected = value if expected is None else expected
