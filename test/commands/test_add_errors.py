# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``add_errors``: from every form into every form; what else is there stays as it is."""

import json
from pathlib import Path

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.blocks import as_list
from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.commands import add_errors, convert_bag, generate

COMMON = ["--trajectory", "figure_eight", "--duration", "3s", "--rate", "100", "--quiet"]
SENSOR = ["--imu", "bmi088", "--seed", "3"]
FORMS = {
    "ideal.mcap": ["ideal.mcap"],
    "ideal.bag": ["ideal.bag"],
    "ideal_db3": ["ideal_db3", "--storage", "sqlite3"],
    "ideal.csv": ["ideal.csv"],
    "euroc": ["euroc", "--format", "euroc"],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with ideal readings in every form."""
    place = tmp_path_factory.mktemp("ideal")
    for name, (_, *options) in FORMS.items():
        argv = ["-o", str(place / name), "--imu", "perfect", *options, *COMMON]
        assert generate.main(argv) == 0
    return place


@pytest.fixture(scope="module")
def flight() -> ims.Flight:
    return ims.simulate(imu="bmi088", trajectory="figure_eight", duration=3, rate=100, seed=3)


def messages(path: Path) -> dict[str, list[tuple[int, bytes]]]:
    """Return all messages of a bag by topic, with their record times."""
    by_topic: dict[str, list[tuple[int, bytes]]] = {}
    with open_bag(path) as bag:
        for group in bag.groups():
            for block in group:
                rows = zip(block.t_ns.tolist(), as_list(block.payloads), strict=True)
                by_topic.setdefault(block.topic.name, []).extend(rows)
    return by_topic


@pytest.mark.parametrize(("source", "target"), [("ideal.mcap", "n.bag"), ("ideal.csv", "n.csv")])
def test_python_writes_what_the_program_writes(
    source: str, target: str, folder: Path, tmp_path: Path, capsys
) -> None:
    argv = [str(folder / source), "-o", str(tmp_path / target), *SENSOR, "--rate", "120"]
    bag = target == "n.bag"
    topic_options = ["--topics", "imu/data_raw,imu/temperature", "--without", "ground_truth/odom"]
    renamed = ["--topic", "imu/data_raw=/imu0", "--compression", "lz4"]
    assert (
        add_errors.main(
            [*argv, *(topic_options if bag else []), *(renamed if bag else []), "--json"]
        )
        == 0
    )
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    options = {
        "topics": ["imu/data_raw", "imu/temperature"],
        "without": "ground_truth/odom",
        "rename": {"imu/data_raw": "/imu0"},
        "compression": "lz4",
    }
    place = tmp_path / f"python_{target}"
    errors_added = ims.add_errors_to_file(
        folder / source,
        place,
        imu="bmi088",
        seed=3,
        rate=120,
        **(options if bag else {}),
    )
    assert place.read_bytes() == (tmp_path / target).read_bytes()
    expected = {**errors_added.to_dict(), "output": result["output"], "wall_s": result["wall_s"]}
    assert json.loads(json.dumps(expected)) == result
    assert errors_added.counts.samples == 300
    assert [
        f"add_errors: warning: {line}" for line in errors_added.warnings
    ] == captured.err.splitlines()
    assert errors_added.warnings == ("rate = 120: the readings come 100 times a second",)


def test_noise_that_would_be_added_twice_is_told(folder: Path, tmp_path: Path, capsys) -> None:
    noisy = str(tmp_path / "noisy.mcap")
    assert generate.main(["-o", noisy, "--imu", "mpu6000", *COMMON]) == 0
    capsys.readouterr()
    for source, triads in ((noisy, ["gyroscope", "accelerometer"]), (folder / "ideal.mcap", [])):
        argv = [str(source), "-o", str(tmp_path / "n.mcap"), "--imu", "mpu6000", "--force"]
        assert add_errors.main([*argv, "--json"]) == 0
        captured = capsys.readouterr()
        assert json.loads(captured.out)["samples"] == 300
        assert [line.split(" has white noise")[0] for line in captured.err.splitlines()] == [
            f"add_errors: warning: input: the {triad}" for triad in triads
        ]


@pytest.mark.parametrize("target", ["twice.mcap", "twice.csv", "arrays"])
def test_messages_that_came_twice_do_not_change_the_rate(
    target: str, folder: Path, tmp_path: Path
) -> None:
    """Every 25th message of 100 Hz comes twice: 104 messages a second, and 100 readings."""
    ideal = ims.read_readings(folder / "ideal.mcap")
    rows = np.sort(np.concatenate([np.arange(len(ideal)), np.arange(0, len(ideal), 25)]))
    twice = ideal.rows(rows)
    if target == "arrays":
        flight = ims.add_errors(twice.t_ns, *twice.triads(), imu="bmi088", seed=3)
        assert (flight.parameters.rate, len(flight.t_ns)) == (100.0, len(ideal))
        return
    path, noisy = tmp_path / target, tmp_path / f"noisy_{target}"
    if target.endswith("csv"):
        lines = (folder / "ideal.csv").read_text().splitlines(keepends=True)
        path.write_text("".join([lines[0], *(lines[1 + row] for row in rows)]))
    else:
        with open_writer(path) as writer:
            topic = writer.add_topic("/imu", IMU)
            payloads = ImuEncoder("x").encode(twice.t_ns, *twice.triads())
            writer.write(topic, twice.t_ns, payloads)
    assert add_errors.main([str(path), "-o", str(noisy), *SENSOR]) == 0
    readings = ims.read_readings(noisy, "/imu/data_raw" if target.endswith("mcap") else None)
    expected = ims.add_errors(ideal.t_ns, *ideal.triads(), imu="bmi088", seed=3, rate=100)
    assert np.array_equal(readings.t_ns, expected.t_ns)
    assert np.allclose(readings.gyro, expected.gyro, rtol=0.0, atol=1e-12)


def test_the_first_irregular_stamps_are_reported_and_all_counted(tmp_path: Path, capsys) -> None:
    t_ns = np.repeat(np.arange(200), 2) * 10_000_000
    t_ns[-1] = 5_000_000  # one more that comes late
    level = np.tile([0.0, 0.0, 9.81], (400, 1))
    with open_writer(tmp_path / "twice.mcap") as writer:
        topic = writer.add_topic("/imu", IMU)
        writer.write(topic, np.arange(400), ImuEncoder("x").encode(t_ns, 0.0 * level, level))
    argv = [str(tmp_path / "twice.mcap"), "-o", str(tmp_path / "n.mcap"), "--imu", "perfect"]
    assert add_errors.main([*argv, "--rate", "100", "--set", "input.check=false", "--json"]) == 0
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert (result["readings"], result["samples"]) == (400, 201)  # the last begins anew
    assert (result["repeated"], result["restarts"]) == (199, 1)
    twice = "add_errors: warning: a reading with the stamp of the previous one; left out"
    expected = [twice, twice, f"{twice}; further ones are only counted"]
    assert captured.err.splitlines()[:3] == expected
    assert len(captured.err.splitlines()) == 4
    assert "stamps jump back by 1.985 s" in captured.err.splitlines()[3]


@pytest.mark.parametrize("source", FORMS)
@pytest.mark.parametrize("target", ["n.mcap", "n.bag", "n_db3", "n.csv", "n_euroc"])
def test_every_form_into_every_form(
    source: str, target: str, folder: Path, tmp_path: Path, flight: ims.Flight
) -> None:
    options = {"n_db3": ["--storage", "sqlite3"], "n_euroc": ["--format", "euroc"]}
    argv = [str(folder / source), "-o", str(tmp_path / target), *SENSOR, "--quiet"]
    assert add_errors.main([*argv, *options.get(target, [])]) == 0
    topic = None if target in ("n.csv", "n_euroc") else "imu/data_raw"
    readings = ims.read_imu(tmp_path / target, topic)
    assert np.array_equal(readings.t_ns, flight.t_ns)
    assert np.array_equal(readings.gyro, flight.gyro)
    assert np.array_equal(readings.accel, flight.accel)
    assert [path.name for path in tmp_path.iterdir()] == [target]


def test_the_rest_of_a_bag_stays_byte_for_byte(folder: Path, tmp_path: Path, capsys) -> None:
    source, target = folder / "ideal.mcap", tmp_path / "noisy.mcap"
    assert add_errors.main([str(source), "-o", str(target), *SENSOR, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["readings"], result["samples"], result["missing"]) == (300, 300, 0)
    ideal, noisy = messages(source), messages(target)
    assert noisy["/ground_truth/odom"] == ideal["/ground_truth/odom"]
    assert noisy["/ground_truth/imu"] == ideal["/imu/data_raw"]  # renamed: the name is taken
    repeated = tmp_path / "same.mcap"
    topics = "imu/data_raw,ground_truth/gyroscope_bias,ground_truth/accelerometer_bias"
    argv = ["-o", str(repeated), *SENSOR, "--topics", topics, *COMMON[:-1]]
    assert generate.main(["--quiet", *argv]) == 0
    for name, expected in messages(repeated).items():  # what generate writes
        assert noisy[name] == expected, name


def test_readings_recorded_late_are_so_by_as_much(tmp_path: Path) -> None:
    t_ns = np.arange(200) * 10_000_000
    level = np.tile([0.0, 0.0, 9.81], (200, 1))
    with open_writer(tmp_path / "late.mcap") as writer:
        topic = writer.add_topic("/imu", IMU)
        writer.write(topic, t_ns + 10**18, ImuEncoder("x").encode(t_ns, 0.0 * level, level))
    argv = [str(tmp_path / "late.mcap"), "-o", str(tmp_path / "n.mcap"), "--imu", "perfect"]
    assert add_errors.main([*argv, "--quiet"]) == 0
    by_topic = messages(tmp_path / "n.mcap")
    assert [t for t, _ in by_topic["/imu/data_raw"]] == (t_ns + 10**18).tolist()
    assert by_topic["/imu"][7][0] == t_ns[7] + 10**18


def test_topics_are_chosen_renamed_and_left_out(folder: Path, tmp_path: Path, capsys) -> None:
    source, target = str(folder / "ideal.bag"), tmp_path / "n.mcap"
    argv = [source, "-o", str(target), *SENSOR, "--quiet", "--topic", "imu/data_raw=/imu0"]
    chosen = ["--topics", "imu/data_raw,imu/temperature,ground_truth/imu"]
    assert add_errors.main([*argv, *chosen, "--without", "ground_truth/odom"]) == 0
    assert set(messages(target)) == {
        *("/imu0", "/imu/temperature", "/ground_truth/imu", "/imu/data_raw")
    }
    again = [str(target), "-o", str(tmp_path / "m.mcap"), *SENSOR]
    assert add_errors.main(again) == 2
    assert "has several topics of sensor_msgs/msg/Imu" in capsys.readouterr().err
    assert add_errors.main([*again, "--input-topic", "ground_truth/imu"]) == 2
    assert "has a topic /imu/data_raw; --topic" in capsys.readouterr().err
    without = ["--without", "imu/data_raw", "--input-topic", "ground_truth/imu", "--quiet"]
    assert add_errors.main([*again, *without]) == 0


def test_odometry_becomes_readings(folder: Path, tmp_path: Path) -> None:
    target = tmp_path / "n.mcap"
    argv = [str(folder / "ideal.mcap"), "-o", str(target), "--imu", "perfect", "--quiet"]
    options = ["--input-topic", "ground_truth/odom", "--without", "imu/data_raw"]
    topics = ["--topics", "imu/data_raw,imu/data"]
    assert add_errors.main([*argv, *options, *topics]) == 0
    readings = ims.read_imu(target, "imu/data_raw")
    true = ims.read_imu(folder / "ideal.mcap")
    assert np.array_equal(readings.t_ns, true.t_ns[1:-1])
    # h^2 / 6 of the third derivative of the velocity, some 40 m/s^4
    assert np.abs(readings.accel - true.accel[1:-1]).max() < 1e-4 / 6.0 * 40.0
    assert len(messages(target)["/imu/data"]) == 298


def test_a_model_of_gazebo_and_conventions(folder: Path, tmp_path: Path, capsys) -> None:
    model = tmp_path / "model.sdf"
    model.write_text(
        "<sdf><sensor name='a' type='imu'><update_rate>100</update_rate><imu><angular_velocity>"
        "<x><noise type='gaussian'><stddev>0.1</stddev></noise></x>"
        "</angular_velocity></imu></sensor></sdf>"
    )
    argv = [str(folder / "ideal.csv"), "-o", str(tmp_path / "n.csv"), "--imu", str(model)]
    assert add_errors.main([*argv, "--set", "input.axes=frd"]) == 0
    readings, true = ims.read_imu(tmp_path / "n.csv"), ims.read_imu(folder / "ideal.csv")
    assert np.array_equal(readings.gyro[:, 1:], -true.gyro[:, 1:])
    spread = (readings.gyro - true.gyro)[:, 0].std()
    assert abs(spread / 0.1 - 1.0) < 4.0 / np.sqrt(2 * 300)


def test_a_bad_reading_is_refused_or_skipped_on_request(
    folder: Path, tmp_path: Path, capsys
) -> None:
    source = tmp_path / "bad.mcap"
    t_ns = np.arange(50) * 10_000_000
    accel = np.tile([0.0, 0.0, 9.81], (50, 1))
    accel[7] = np.nan
    with open_writer(source) as writer:
        topic = writer.add_topic("/imu", IMU)
        writer.write(topic, t_ns, ImuEncoder("x").encode(t_ns, np.zeros((50, 3)), accel))
    argv = [str(source), "-o", str(tmp_path / "n.mcap"), "--imu", "perfect", "--quiet"]
    assert add_errors.main(argv) == 2
    assert "bad.mcap: /imu: message 7: stamp 0.07" in capsys.readouterr().err
    assert not (tmp_path / "n.mcap").exists()
    assert add_errors.main([*argv, "--skip-bad-rows"]) == 0
    assert "1 bad rows skipped" in capsys.readouterr().err
    by_topic = messages(tmp_path / "n.mcap")
    assert (len(by_topic["/imu"]), len(by_topic["/imu/data_raw"])) == (50, 49)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["none.mcap"], "none.mcap: No such file"),
        (["IN", "--imu", "bmi08"], "bmi08"),
        (["IN", "--set", "input.axes=ned"], "input.axes"),
        (["IN", "--set", "imu.sampling=averaged"], "needs input.rate above the rate, 100 Hz"),
        (["IN", "--topics", "imu/mag"], "imu/mag"),
        (["IN", "--without", "nothing"], "nothing"),
        (["IN", "--input-topic", "nothing"], "nothing"),
        (["IN", "--set", "input.gravity=missing"], "needs the orientation of every reading"),
        (["IN", "--format", "euroc", "--storage", "mcap"], "--storage: does not apply"),
    ],
)
def test_bad_arguments_are_a_line(
    arguments, line: str, folder: Path, tmp_path: Path, capsys
) -> None:
    argv = [str(folder / "ideal.mcap") if word == "IN" else word for word in arguments]
    assert add_errors.main([*argv, "-o", str(tmp_path / "n.mcap")]) == 2
    captured = capsys.readouterr().err
    assert line in captured
    assert "Traceback" not in captured
    assert list(tmp_path.iterdir()) == []


def test_convert_bag_reads_what_is_written(folder: Path, tmp_path: Path) -> None:
    target = tmp_path / "n.bag"
    assert add_errors.main([str(folder / "euroc"), "-o", str(target), *SENSOR, "--quiet"]) == 0
    assert convert_bag.main([str(target), "-o", str(tmp_path / "n.mcap"), "--quiet"]) == 0
    assert messages(tmp_path / "n.mcap").keys() == messages(target).keys()
