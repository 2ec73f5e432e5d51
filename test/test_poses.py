# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pose files: the two forms, exact stamps, and every way in which a file can be wrong."""

import os
import tracemalloc

import numpy as np
import pytest
from recordings import EUROC, KAIST, TUM, missing

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError, InputWarning
from imu_sim_ros.core.records import States
from imu_sim_ros.inputs.poses import read_poses, write_tum
from imu_sim_ros.recordings.findings.pose_order import sort_poses

GOOD = ["1.0 0 0 0 0 0 0 1", "1.1 1 2 3 0 0 0 1", "1.2 2 3 4 0 0 0 1", "1.3 3 4 5 0 0 0 1"]


@pytest.fixture
def read_lines(tmp_path):
    def write_and_read(*lines):
        path = tmp_path / "poses.txt"
        path.write_text("\n".join(lines) + "\n")
        return read_poses(path)

    return write_and_read


def wrong(read_lines, *lines):
    with pytest.raises(InputError) as caught:
        read_lines(*lines)
    return [problem.split("poses.txt: ", 1)[1] for problem in caught.value.problems]


def test_tum_files_are_read_to_the_nanosecond(read_lines):
    half = np.sqrt(0.5)
    poses = read_lines(
        "# timestamp tx ty tz qx qy qz qw",
        "",
        f"1305031098.6659 1 2 3 0 0 {half} {half}",
        f"  1305031098.675800001\t4 5 6 {half} 0 0 {half}  ",
    )
    assert poses.t_ns.tolist() == [1305031098_665900000, 1305031098_675800001]
    np.testing.assert_array_equal(poses.position, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_allclose(poses.q_wb, [[half, 0, 0, half], [half, half, 0, 0]], atol=1e-15)


def test_euroc_files_are_read_to_the_nanosecond(read_lines):
    poses = read_lines(
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], ...",
        "1403715524907143168,0.5,1.9,0.9,0.6,0.8,0,0," + ",".join(["0"] * 9),
        "1403715524912143104,0.6,1.8,0.8,0.8,0,0.6,0," + ",".join(["0"] * 9),
    )
    assert poses.t_ns.tolist() == [1403715524907143168, 1403715524912143104]
    np.testing.assert_allclose(poses.q_wb, [[0.6, 0.8, 0, 0], [0.8, 0, 0.6, 0]], atol=1e-15)


@pytest.mark.parametrize("columns", [8, 11, 17])
def test_euroc_with_and_without_velocity_and_biases(read_lines, columns):
    rows = [",".join([str(k), "0", "0", "0", "1", *["0"] * (columns - 5)]) for k in (1, 2)]
    assert read_lines(*rows).t_ns.tolist() == [1, 2]


def test_stamps_with_exponents_as_other_tools_write_them(read_lines):
    poses = read_lines("1.403636580863555431e+09 0 0 0 0 0 0 1", "1.5e9 0 0 0 0 0 0 1")
    assert poses.t_ns.tolist() == [1403636580863555431, 1500000000_000000000]


def test_quaternions_are_normalised(read_lines):
    poses = read_lines("1 0 0 0 0 0 0 1.001", "2 0 0 0 0 0.6001 0 0.8")
    np.testing.assert_allclose(np.linalg.norm(poses.q_wb, axis=-1), 1.0, rtol=0, atol=1e-15)


def test_written_and_read_again(tmp_path):
    random = np.random.default_rng(8)
    q = rotation.normalise(random.standard_normal((50, 4)))
    t_ns = 1_600_000_000_123_456_789 + np.cumsum(random.integers(1, 10**9, 50))
    poses = States(t_ns, random.standard_normal((50, 3)), q)
    write_tum(tmp_path / "out.txt", poses)
    again = read_poses(tmp_path / "out.txt")
    np.testing.assert_array_equal(again.t_ns, t_ns)
    np.testing.assert_allclose(again.position, poses.position, rtol=1e-11)
    np.testing.assert_allclose(again.q_wb, q, rtol=0, atol=1e-11)


def test_a_pose_that_stands_twice_is_taken_once(read_lines):
    rows = read_lines(*GOOD[:2], GOOD[1], GOOD[1].replace("0 0 0 1", "0 0 0 -1"), *GOOD[2:])
    with pytest.warns(InputWarning, match="2 poses came twice"):
        poses = sort_poses(rows)
    assert poses.t_ns.tolist() == [1_000_000_000, 1_100_000_000, 1_200_000_000, 1_300_000_000]
    assert poses.repeated == 2


def test_different_poses_of_one_time_are_refused(read_lines):
    for bad in ("1.0 1 2 3 0 0 0 1", "1.0 0 0 0 0 0 1 0"):
        with pytest.raises(InputError, match=r"from line 2 .*1 poses have the stamp of the one be"):
            sort_poses(read_lines(GOOD[0], bad, *GOOD[2:]))


@pytest.mark.parametrize("lines", [[], ["# only", "# comments"], ["", "   "]])
def test_a_file_without_poses_is_refused(read_lines, lines):
    assert wrong(read_lines, *lines) == ["contains no poses"]


def test_a_single_pose_is_refused(read_lines):
    assert wrong(read_lines, GOOD[0]) == ["contains one pose; a trajectory needs two or more"]


def test_every_problem_of_a_kind_is_named_with_its_line(read_lines):
    lines = ["# head", GOOD[0], "1.1 1 2 3 0 0 0", GOOD[2], "1.3 1 2 3 0 0 0 1 9"]
    assert wrong(read_lines, *lines) == [
        "line 3: 7 columns; the TUM form has 8, 14 or 20",
        "line 5: 9 columns; the TUM form has 8, 14 or 20",
    ]


@pytest.mark.parametrize(
    ("bad", "problem"),
    [
        ("1.1 nan 2 3 0 0 0 1", "line 2: a value that is not finite: position [nan, 2, 3]"),
        (
            "1.1 1 2 3 0 0 inf 1",
            "line 2: a value that is not finite: orientation [1, 0, 0, inf]",
        ),
        (
            "1.1 1e300 2 3 0 0 0 1",
            "line 2: position [1e+300, 2, 3]: at most 1e+10 m is possible",
        ),
        (
            "9e9 1 2 3 0 0 0 1",
            "line 2: the stamp 9000000000000000000 ns is outside the years 1901 to 2038",
        ),
        ("nan 1 2 3 0 0 0 1", "line 2: 'nan' is not a stamp in seconds"),
        ("inf 1 2 3 0 0 0 1", "line 2: 'inf' is not a stamp in seconds"),
        ("1e300 1 2 3 0 0 0 1", "line 2: '1e300' is not a stamp in seconds"),
        ("1e999999999 1 2 3 0 0 0 1", "line 2: '1e999999999' is not a stamp in seconds"),
        ("9999999999.0 1 2 3 0 0 0 1", "line 2: '9999999999.0' is not a stamp in seconds"),
        ("1.1 1 2 3 0 0 0 0", "line 2: a quaternion of length 0 instead of 1"),
        ("1.1 1 2 3 0 0 0 0.5", "line 2: a quaternion of length 0.5 instead of 1"),
        ("1.1 one 2 3 0 0 0 1", "line 2: 'one' is not a number"),
        ("today 1 2 3 0 0 0 1", "line 2: 'today' is not a stamp in seconds"),
    ],
)
def test_a_bad_line_is_named(read_lines, bad, problem):
    assert wrong(read_lines, GOOD[0], bad, *GOOD[2:]) == [problem]


def test_bad_lines_of_the_euroc_form(read_lines):
    good = "1,0,0,0,1,0,0,0"
    assert wrong(read_lines, good, "2,0,0,0,1,0,0") == [
        "line 2: 7 columns; the EuRoC form has 8, 11, 17, 20, 23 or 29"
    ]
    assert wrong(read_lines, good, "2.5,0,0,0,1,0,0,0") == [
        "line 2: '2.5' is not a stamp in whole nanoseconds"
    ]
    assert wrong(read_lines, good, "2,,0,0,1,0,0,0") == ["line 2: '' is not a number"]
    assert wrong(read_lines, good, f"{2**63},0,0,0,1,0,0,0") == [
        f"line 2: '{2**63}' is not a stamp in whole nanoseconds"
    ]


def test_a_flood_of_problems_is_cut(read_lines):
    problems = wrong(read_lines, *GOOD, *["1 2 3"] * 30)
    assert len(problems) == 11
    assert problems[-1] == "and 20 more such lines"


def test_all_classes_of_bad_rows_stand_in_one_report(read_lines):
    rows = [
        *GOOD,
        "2.0 1 2 3 0 0 0",
        "2.1 1 2 x 0 0 0 1",
        "2.2 1 2 nan 0 0 0 1",
        "2.3 1 2 3 0 0 0 2",
        "2.4 1 2 3 0 0 0 1",
        "later 1 2 3 0 0 0 1",
    ]
    assert wrong(read_lines, *rows) == [
        "line 5: 7 columns; the TUM form has 8, 14 or 20",
        "line 6: 'x' is not a number",
        "line 7: a value that is not finite: position [1, 2, nan]",
        "line 8: a quaternion of length 2 instead of 1",
        "line 10: 'later' is not a stamp in seconds",
    ]


def test_bad_rows_are_skipped_and_counted(tmp_path):
    path = tmp_path / "poses.txt"
    bad = ["1.15 1 2", "1.1 1 2 3 1 0 0 0", "1.16 1 2 3 0 0 0 nan", "1.17 - 2 3 0 0 0 1"]
    path.write_text("\n".join([*GOOD[:2], *bad, *GOOD[2:], GOOD[3], "junk"]) + "\n")
    with pytest.warns(InputWarning, match="1 poses came twice"):
        poses = sort_poses(read_poses(path, skip_bad_rows=True), skip_bad_rows=True)
    assert poses.t_ns.tolist() == [1_000_000_000, 1_100_000_000, 1_200_000_000, 1_300_000_000]
    assert (poses.skipped, poses.repeated) == (5, 1)
    path.write_text("junk\nrubbish\n")
    with pytest.raises(InputError, match="contains no usable pose"):
        read_poses(path, skip_bad_rows=True)


@pytest.mark.parametrize("covariances", [6, 12])
def test_truth_files_of_openvins_have_covariances_behind_the_pose(read_lines, covariances):
    poses = read_lines("# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12 ...",
                 *(f"{row} {' '.join(['0.01'] * covariances)}" for row in GOOD))  # fmt: skip
    np.testing.assert_array_equal(poses.position[1], [1, 2, 3])
    assert len(poses.t_ns) == 4


def test_a_file_of_many_blocks_is_as_if_read_at_once(tmp_path, monkeypatch):
    rows = [f"{k // 10}.{k % 10} {k} 0 0 0 0 0 1" for k in range(5000)]
    rows[1234] = "123.4 1 2 3"
    rows[4321] = "432.1 0 0 0 0 0 0"
    path = tmp_path / "poses.txt"
    path.write_text("\n".join(rows))  # no end of the last line
    monkeypatch.setattr("imu_sim_ros.inputs.rows._CHUNK_BYTES", 777)
    poses = read_poses(path, skip_bad_rows=True)
    assert poses.skipped == 2
    assert len(poses.t_ns) == 4998
    np.testing.assert_array_equal(np.unique(np.diff(poses.t_ns)), [10**8, 2 * 10**8])
    with pytest.raises(InputError) as caught:
        read_poses(path)
    assert [problem.split(": ")[1] for problem in caught.value.problems] == [
        "line 1235",
        "line 4322",
    ]


def test_ten_million_lines_fit_into_two_gigabytes(tmp_path):
    """A hundredth of the lines with a hundredth of the room, besides what the libraries take.

    The poses themselves are 64 bytes a line, and stand in memory once more while they are joined.
    """
    lines = 100_000
    path = tmp_path / "poses.txt"
    path.write_text("".join(f"{k // 200}.{k % 200 * 5:03d}000000 {k}.25 -1.5 2.5 0 0 0 1\n"
                            for k in range(lines)))  # fmt: skip
    read_poses(path)
    tracemalloc.start()
    poses = read_poses(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(poses.t_ns) == lines
    # Two copies of the poses; and one block of 4 MiB of text, as bytes, lines, strings and numbers
    # (some 150 bytes a line of 40), which does not grow with the file.
    assert peak < lines * 2 * 64 + 15 * (4 << 20)


def test_lines_without_end_devices_and_pipes_are_refused(tmp_path):
    (tmp_path / "long.txt").write_bytes(b"1 " * 10**6)
    with pytest.raises(InputError, match="not a text file"):
        read_poses(tmp_path / "long.txt")
    os.mkfifo(tmp_path / "pipe.txt")
    for path in ("/dev/zero", tmp_path / "pipe.txt"):
        with pytest.raises(InputError, match="is a device or a pipe"):
            read_poses(path)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match=r"missing\.txt: No such file"):
        read_poses(tmp_path / "missing.txt")
    with pytest.raises(InputError, match=r"Is a directory"):
        read_poses(tmp_path)
    (tmp_path / "binary.bag").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match=r"binary\.bag: not a text file of poses"):
        read_poses(tmp_path / "binary.bag")


def test_a_text_file_has_no_topics(tmp_path):
    with pytest.raises(InputError, match=r"has no topic odom"):
        read_poses(tmp_path / "a.txt", "odom")


@pytest.mark.parametrize(
    ("path", "count", "seconds"),
    [(EUROC, 16702, 83.505), (KAIST, 9882, 211.44057), (TUM, 3000, 30.0896)],
    ids=["euroc", "kaist", "tum"],
)
def test_recorded_datasets_are_read_with_all_their_poses(path, count, seconds):
    if not path.is_file():
        pytest.skip(missing(path))
    poses = read_poses(path)
    assert len(poses.t_ns) == count
    assert (poses.t_ns[-1] - poses.t_ns[0]) * 1e-9 == pytest.approx(seconds, abs=1e-6)
    assert np.all(np.diff(poses.t_ns) > 0)


def test_stamps_before_zero_are_written_as_they_are(tmp_path):
    """-0.99 s is no -1 s and 10 ms."""
    t_ns = np.array([-1_500_000_000, -990_000_000, -1, 0, 20_000_000], dtype=np.int64)
    still = States(t_ns, np.zeros((5, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (5, 1)))
    write_tum(tmp_path / "early.txt", still)
    stamps = [line.split()[0] for line in (tmp_path / "early.txt").read_text().splitlines()[1:]]
    assert stamps == ["-1.500000000", "-0.990000000", "-0.000000001", "0.000000000", "0.020000000"]
