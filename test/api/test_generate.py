# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``ims.generate``: the files of the program, from Python."""

import filecmp

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands import generate


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("a.mcap", {"compression": "lz4", "rename": {"imu/data_raw": "/imu0"}}, "lz4"),
        ("a.bag", {"imu_only": True}, "imu_only"),
        ("folder", {"format": "euroc"}, "euroc"),
    ],
)
def test_files_are_those_of_the_program(name, arguments, words, tmp_path, capsys):
    options = {
        "lz4": ["--compression", "lz4", "--topic", "imu/data_raw=/imu0"],
        "imu_only": ["--imu-only"],
        "euroc": ["--format", "euroc"],
    }[words]
    (tmp_path / "python").mkdir()
    made = ims.generate(
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
        one, other = tmp_path / "python" / path, tmp_path / "command" / path
        assert one.is_dir() or filecmp.cmp(one, other, shallow=False), path
    assert made.output == tmp_path / "python" / name
    assert made.samples == 200
    assert set(made.to_dict()) == {"output", "messages", "samples", "wall_s", "bytes"}


def test_cameras_and_motions_of_any_kind(tmp_path):
    tracks = ims.generate(
        tmp_path / "tracks", format="tracks", cameras="euroc_cam0", scene="room", duration=1
    )
    assert tracks.messages["tracks"] > 0

    def swing(t):
        return np.column_stack([np.sin(t), 0 * t, 0 * t]), np.tile([1.0, 0, 0, 0], (len(t), 1))

    made = ims.generate(tmp_path / "swing.mcap", trajectory=swing, duration=2, imu="perfect")
    readings = ims.read_imu(made.output)
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
    first = ims.generate(tmp_path / "a.mcap", duration=1, seed=1)
    with pytest.raises(ims.InputError, match="already exists"):
        ims.generate(tmp_path / "a.mcap", duration=1)
    assert ims.generate(tmp_path / "a.mcap", duration=1, seed=1, force=True).bytes == first.bytes
