# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``ims.generate`` and ``ims.convert``: the files of the programs, from Python."""

import filecmp
from pathlib import Path

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands import convert_bag, generate


@pytest.mark.parametrize(
    ("name", "arguments", "option_key"),
    [
        ("a.mcap", {"compression": "lz4", "rename": {"imu/data_raw": "/imu0"}}, "lz4"),
        ("a.bag", {"imu_only": True}, "imu_only"),
        ("folder", {"format": "euroc"}, "euroc"),
    ],
)
def test_files_are_those_of_the_program(name, arguments, option_key, tmp_path, capsys):
    options = {
        "lz4": ["--compression", "lz4", "--topic", "imu/data_raw=/imu0"],
        "imu_only": ["--imu-only"],
        "euroc": ["--format", "euroc"],
    }[option_key]
    (tmp_path / "python").mkdir()
    generated = ims.generate(
        tmp_path / "python" / name,
        imu="mpu6000",
        duration=1,
        seed=3,
        with_configs=True,
        **arguments,
    )
    command = ["--imu", "mpu6000", "--duration", "1s", "--seed", "3", "--with-configs", "--quiet"]
    assert generate.main(["-o", str(tmp_path / "command" / name), *command, *options]) == 0
    files = sorted(p.relative_to(tmp_path / "python") for p in (tmp_path / "python").rglob("*"))
    assert files == sorted(
        p.relative_to(tmp_path / "command") for p in (tmp_path / "command").rglob("*")
    )
    for path in files:
        python_file, program_file = tmp_path / "python" / path, tmp_path / "command" / path
        assert python_file.is_dir() or filecmp.cmp(python_file, program_file, shallow=False), path
    assert generated.output == tmp_path / "python" / name
    assert generated.samples == 200
    assert set(generated.to_dict()) == {"output", "messages", "samples", "wall_s", "bytes"}


def test_cameras_and_motions_of_any_kind(tmp_path):
    tracks = ims.generate(
        tmp_path / "tracks", format="tracks", cameras="euroc_cam0", scene="room", duration=1
    )
    assert tracks.messages["tracks"] > 0

    def swing(t):
        return np.column_stack([np.sin(t), 0 * t, 0 * t]), np.tile([1.0, 0, 0, 0], (len(t), 1))

    generated = ims.generate(tmp_path / "swing.mcap", trajectory=swing, duration=2, imu="perfect")
    readings = ims.read_imu(generated.output)
    flight = ims.simulate(trajectory=swing, duration=2, imu="perfect")
    assert np.array_equal(readings.accel, flight.accel)
    rows = np.column_stack([np.arange(0, 5, 0.01), np.zeros((500, 6))])
    still = ims.generate(tmp_path / "still.bag", trajectory=rows, imu="perfect")
    assert still.samples == len(ims.simulate(trajectory=rows, imu="perfect").gyro)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"format": "eurok"}, "vio_data_simulation; did you mean euroc?"),
        ({"storage": "mcap", "format": "csv"}, "storage: does not apply to csv"),
        ({"jobs": 0, "cameras": "euroc_cam0"}, "jobs = 0: must be from 1 to 1024"),
        ({"split_duration": -1.0}, "split_duration = -1.0: must be seconds"),
        ({"split_duration": float("nan")}, "split_duration = nan: must be seconds"),
        ({"topics": ["imu/magg"]}, "did you mean imu/mag?"),
        ({"rename": 3}, "rename = 3: must be"),
        ({"format": "tracks"}, "needs a camera"),
        ({"trajectory": "static", "duration": None}, "this trajectory has no end"),
        ({"cameras": "euroc_cam7"}, "euroc_cam7"),
        ({"imu": "mpu600"}, "did you mean mpu6000?"),
    ],
)
def test_bad_arguments_are_refused_and_leave_nothing(arguments, message, tmp_path):
    with pytest.raises(ims.ImuSimError) as caught:
        ims.generate(tmp_path / "x", **{"duration": 1, **arguments})
    assert message in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_nothing_is_overwritten_unless_forced(tmp_path):
    first_result = ims.generate(tmp_path / "a.mcap", duration=1, seed=1)
    with pytest.raises(ims.InputError, match="already exists"):
        ims.generate(tmp_path / "a.mcap", duration=1)
    assert (
        ims.generate(tmp_path / "a.mcap", duration=1, seed=1, force=True).bytes
        == first_result.bytes
    )


@pytest.mark.parametrize(
    ("name", "arguments", "program_options"),
    [
        ("b.bag", {"compression": "bz2", "topics": "imu/data_raw"}, "--compression bz2"),
        ("b", {"format": "euroc"}, "--format euroc"),
        ("b.tum", {}, ""),
    ],
)
def test_conversions_are_those_of_the_program(name, arguments, program_options, tmp_path):
    generated = ims.generate(tmp_path / "a.mcap", duration=1, seed=1)
    converted = ims.convert(generated.output, tmp_path / "python" / name, **arguments)
    options = [
        *program_options.split(),
        *(["--topics", arguments["topics"]] if "topics" in arguments else []),
    ]
    place = tmp_path / "command" / name
    assert convert_bag.main([str(generated.output), "-o", str(place), "--quiet", *options]) == 0
    files = [path for path in place.rglob("*") if path.is_file()] or [place]
    for path in files:
        assert filecmp.cmp(
            path, tmp_path / "python" / path.relative_to(tmp_path / "command"), False
        )
    assert not converted.recovered
    assert converted.last_stamp_ns == 1_995_000_000


def test_a_torn_bag_is_recovered_and_says_what_was_found(tmp_path):
    whole = ims.generate(tmp_path / "a.mcap", duration=20, seed=1).output
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    with pytest.raises(ims.InputError, match="recover"):
        ims.convert(torn, tmp_path / "b.mcap")
    recovered = ims.convert(torn, tmp_path / "b.mcap", recover=True)
    assert recovered.recovered
    assert 0 < recovered.messages["/imu/data_raw"] < 4000
    assert recovered.found
    assert recovered.to_dict()["left_out"] == list(recovered.left_out)


def test_impossible_readings_are_named_or_left_out(tmp_path):
    rows = tmp_path / "a.csv"
    ims.generate(rows, duration=1, imu_only=True)
    lines = rows.read_text().splitlines()
    lines[5] = lines[5].replace(",", ",nan,", 1).rsplit(",", 1)[0]
    rows.write_text("\n".join(lines) + "\n")
    with pytest.raises(ims.InputError, match="line 6"):
        ims.convert(rows, tmp_path / "b.mcap")
    converted = ims.convert(rows, tmp_path / "b.mcap", skip_bad_rows=True)
    assert converted.messages == {"/imu/data_raw": 199}
    assert converted.warnings == (f"{rows}: 1 bad rows skipped",)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"source": 3}, "source = 3: must be the path of a file"),
        ({"source": "none.mcap"}, "none.mcap"),
        ({"format": "tracks"}, "format = 'tracks': must be one of"),
        ({"images": "raw"}, "images raw: applies to folders"),
        ({"topics": ["imu/nothing"]}, "has no topic /imu/nothing"),
    ],
)
def test_bad_conversions_are_refused_and_leave_nothing(arguments, message, tmp_path):
    source = ims.generate(tmp_path / "a.mcap", duration=1).output
    paths_before = sorted(tmp_path.iterdir())
    with pytest.raises(ims.ImuSimError) as caught:
        ims.convert(**{"source": source, "output": tmp_path / "b", **arguments})
    assert message in str(caught.value)
    assert sorted(tmp_path.iterdir()) == paths_before


def test_dead_reckoning_of_a_file_knows_the_world_it_was_simulated_in(tmp_path):
    """Without the Earth's rotation it was 6.5 m off after a minute."""
    world = {"gravity": [0.0, 0.0, -9.7], "earth_rotation": True, "latitude_deg": 48.0}
    options = {"imu": "perfect", "trajectory": "figure_eight", "duration": 20}
    generated = ims.generate(tmp_path / "earth.mcap", **options, **world)
    track = ims.dead_reckon(generated.output)
    assert ims.evaluate(track, ims.read_odometry(generated.output)).rms_position < 0.01
    flight = ims.dead_reckon(ims.simulate(**options, **world))
    np.testing.assert_allclose(track.position, flight.position, atol=1e-9)
    curved = ims.simulate(**options, curved_earth=True, gravity_model="wgs84", latitude_deg=48.0)
    with pytest.warns(UserWarning, match="curved Earth"):
        ims.dead_reckon(curved)


def test_files_parameters_and_sensors_are_those_of_the_program(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.yaml").write_text("/**:\n  ros__parameters: {rate: 50.0, sensors: [wheels]}\n")
    Path("b.yaml").write_text("/**:\n  ros__parameters: {rate: 100.0, imu.jitter: 1.0e-5}\n")
    generate_line = (
        "-o program/a.mcap --params-file a.yaml --params-file b.yaml --gnss phone --duration 1s"
    )
    assert generate.main([*generate_line.split(), "--set", "rate=200", "--quiet"]) == 0
    generated = ims.generate(
        "python/a.mcap",
        params_file=["a.yaml", "b.yaml"],
        gnss="phone",
        duration=1,
        parameters={"rate": 200.0},
    )
    assert generated.samples == 200
    assert {"/wheel/odom", "/gps/fix"} < set(generated.messages)
    assert filecmp.cmp("program/a.mcap", "python/a.mcap", shallow=False)
    (line,) = generated.lines()
    assert line.startswith("python/a.mcap: 200 /imu/data_raw, 200 /ground_truth/odom, ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"params_file": 3}, "params_file = 3: must be paths of files"),
        ({"parameters": 3}, "parameters = 3: must be parameters by name"),
        ({"gnss": [3]}, "gnss = 3: must be a name, the path of a file, or several"),
        ({"robust": 1}, "robust = 1: must be True or False"),
        ({"discard_partial": None}, "discard_partial = None: must be True or False"),
        ({"parameters": {"rate": -1.0}}, "rate = -1.0: must be"),
    ],
)
def test_arguments_of_the_program_are_checked_in_python(arguments, message, tmp_path):
    with pytest.raises(ims.ConfigurationError) as caught:
        ims.generate(tmp_path / "x", **{"duration": 1, **arguments})
    assert message in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_parameter_file_is_never_replaced(tmp_path):
    file = tmp_path / "p.yaml"
    file.write_text("/**:\n  ros__parameters: {rate: 50.0}\n")
    source = ims.generate(tmp_path / "a.mcap", duration=1).output
    with pytest.raises(ims.InputError, match="an input is never overwritten"):
        ims.generate(file, params_file=file, duration=1, force=True)
    with pytest.raises(ims.InputError, match="an input is never overwritten"):
        ims.add_errors_to_file(source, file, params_file=file, force=True)
    assert "50.0" in file.read_text()


def test_a_folder_that_is_called_like_a_frame_is_no_input(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("world").mkdir()
    for force in (False, True):
        ims.generate("world/a.mcap", duration=1, world_frame="world", force=force)
