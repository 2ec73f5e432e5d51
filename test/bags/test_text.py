# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""EuRoC folders, CSV and TUM, written and read; by evo as well."""

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.bags.read import read_imu, read_odometry
from imu_sim_ros.bags.text.writer import Dataset, TextFile, write_euroc_descriptions
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import States
from imu_sim_ros.core.rotation import normalise
from imu_sim_ros.formats.door import read_states

EPOCH = 1_403_715_273_262_142_976


@pytest.fixture
def states(content) -> States:
    rng = np.random.default_rng(5)
    n = 500
    t_ns = EPOCH + 5_000_000 * np.arange(n)
    q_wb = normalise(rng.standard_normal((n, 4)))
    return States(t_ns, *rng.standard_normal((1, n, 3)), q_wb, rng.standard_normal((n, 3)))


GYRO, ACCEL = np.random.default_rng(6).standard_normal((2, 500, 3))


def _write(path, form, states):
    with Dataset(path, form) as dataset:
        dataset.write_imu(states.t_ns, GYRO, ACCEL)
        dataset.write_states(states, np.hstack([GYRO, ACCEL]))
    return dataset


@pytest.mark.parametrize("form", ["euroc", "csv"])
def test_readings_come_back_bit_for_bit(tmp_path, form, states):
    _write(tmp_path / "d", form, states)
    imu = read_imu(tmp_path / "d")
    np.testing.assert_array_equal(imu.t_ns, states.t_ns)
    np.testing.assert_array_equal(imu.gyro, GYRO)
    np.testing.assert_array_equal(imu.accel, ACCEL)


def test_states_come_back(tmp_path, states):
    _write(tmp_path / "d", "euroc", states)
    odometry = read_odometry(tmp_path / "d")
    np.testing.assert_array_equal(odometry.t_ns, states.t_ns)
    np.testing.assert_array_equal(odometry.position, states.position)
    np.testing.assert_allclose(odometry.q_wb, states.q_wb, atol=3e-16)
    np.testing.assert_array_equal(odometry.velocity, states.velocity)
    assert odometry.angular_velocity is None  # EuRoC's states have none


def test_poses_come_back_from_tum(tmp_path, states):
    _write(tmp_path / "d.tum", "tum", states)
    poses = read_states(tmp_path / "d.tum")
    np.testing.assert_array_equal(poses.t_ns, states.t_ns)
    np.testing.assert_array_equal(poses.position, states.position)
    np.testing.assert_allclose(poses.q_wb, states.q_wb, atol=3e-16)


def test_evo_reads_both(tmp_path, states):
    interface = pytest.importorskip("evo.tools.file_interface")
    _write(tmp_path / "d", "euroc", states)
    _write(tmp_path / "d.tum", "tum", states)
    euroc = interface.read_euroc_csv_trajectory(
        str(tmp_path / "d" / "state_groundtruth_estimate0" / "data.csv")
    )
    tum = interface.read_tum_trajectory_file(str(tmp_path / "d.tum"))
    for trajectory in (euroc, tum):
        np.testing.assert_array_equal(trajectory.positions_xyz, states.position)
        np.testing.assert_allclose(trajectory.orientations_quat_wxyz, states.q_wb, atol=1e-12)
        np.testing.assert_allclose(trajectory.timestamps, states.t_ns * 1e-9, rtol=1e-15)


def test_headers_are_those_of_the_consumers(tmp_path, states):
    _write(tmp_path / "e", "euroc", states)
    _write(tmp_path / "k", "csv", states)
    imu = (tmp_path / "e" / "imu0" / "data.csv").read_text().splitlines()
    assert imu[0].startswith("#timestamp [ns],w_RS_S_x [rad s^-1]")
    assert imu[1].split(",")[0] == str(EPOCH)
    truth = (tmp_path / "e" / "state_groundtruth_estimate0" / "data.csv").read_text()
    assert truth.splitlines()[0].split(",")[4] == " q_RS_w []"
    kalibr = (tmp_path / "k" / "imu0.csv").read_text().splitlines()
    assert kalibr[0] == "timestamp,omega_x,omega_y,omega_z,alpha_x,alpha_y,alpha_z"


def test_euroc_descriptions_state_rate_noise_and_mount(tmp_path, states):
    import yaml

    _write(tmp_path / "e", "euroc", states)
    noise = {"gyroscope_noise_density": 1.6968e-4}
    write_euroc_descriptions(
        tmp_path / "e", 200.0, noise, np.eye(3), np.array([0.1, 0.2, 0.3]), "a test"
    )
    sensor = yaml.safe_load((tmp_path / "e" / "imu0" / "sensor.yaml").read_text())
    assert sensor["rate_hz"] == 200
    assert sensor["gyroscope_noise_density"] == 1.6968e-4
    np.testing.assert_array_equal(
        np.reshape(sensor["T_BS"]["data"], (4, 4))[:3, 3], [0.1, 0.2, 0.3]
    )
    assert yaml.safe_load((tmp_path / "e" / "body.yaml").read_text())["comment"] == "a test"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "contains no rows"),
        ("timestamp,omega_x\n", "contains no rows"),
        ("1,2,3\n", "line 1: 3 columns; expected nanoseconds and 6"),
        ("1.5,1,2,3,4,5,6\n", "line 1: .1.5. is not a stamp"),
        ("1,1,2,x,4,5,6\n", "line 1: .x. is not a number"),
    ],
)
def test_files_of_another_form(tmp_path, text, reason):
    path = tmp_path / "imu.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=reason):
        read_imu(path)


def _fail(path, states):
    with Dataset(path, "csv") as dataset:
        dataset.write_imu(states.t_ns, GYRO, ACCEL)
        raise RuntimeError


def test_a_failure_leaves_no_file_that_looks_whole(tmp_path, states):
    with pytest.raises(RuntimeError):
        _fail(tmp_path / "d", states)
    assert {file.suffix for file in (tmp_path / "d").iterdir()} == {".active"}


def test_a_signal_between_writing_and_counting_leaves_what_is_counted(tmp_path):
    """A signal may come right after a block is in the file."""
    path = tmp_path / "x.csv"
    file = TextFile(path, "#time,x")
    file.write(np.arange(5000), np.zeros((5000, 1)))
    append = file.file.write

    def interrupted(*parts):
        append(*parts)
        raise KeyboardInterrupt

    file.file.write = interrupted
    with pytest.raises(KeyboardInterrupt):
        file.write(np.arange(5000, 6000), np.zeros((1000, 1)))
    file.cut()
    file.file.finish()
    assert (file.rows, file.last_ns) == (5000, 4999)
    assert len(path.read_text().splitlines()) == 1 + 5000


def test_equal_stamps_of_more_than_a_chunk_are_converted(tmp_path):
    rows = ["timestamp,gx,gy,gz,ax,ay,az", *["0,0.1,0,0,0,0,9.81"] * 6000]
    (tmp_path / "zero.csv").write_text("\n".join(rows), encoding="utf-8")
    converted = ims.convert(tmp_path / "zero.csv", tmp_path / "zero.mcap")
    assert converted.messages["/imu/data_raw"] == 6000
    assert not ims.read_imu(tmp_path / "zero.mcap").t_ns.any()
