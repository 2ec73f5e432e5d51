# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of readings with bad rows: every class in one report, and going on without them."""

import numpy as np
import pytest

from imu_sim_ros.bags.read import imu_blocks, read_imu, read_odometry
from imu_sim_ros.commands import allan, calibrate, convert_bag, dead_reckon, generate
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.inputs.poses import read_poses

ROWS = 14_000
"""70 s at 200 Hz: allan wants a minute."""
BAD = {
    11: "1,2",
    21: "noon,1,2,3,4,5,6",
    31: "1155000000,1,2,x,4,5,6",
    41: "1195000000,1,2,nan,4,5,6",
    51: "1000000,1,2,3,4,5,6",
    61: "1295000000,1_0,2,3,4,5,6",
    71: "1.5e9,1,2,3,4,5,6",
    81: "99999999999999999999,1,2,3,4,5,6",
    91: "1445000000,1,2,3,4,5,inf",
    101: "1495000000,1,2,3,4,5,\u0663",
}
"""Number of the line, and what stands there."""


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Return a table of readings with bad rows, and its sound readings."""
    path = tmp_path_factory.mktemp("rows") / "imu.csv"
    argv = ["-o", str(path), "--duration", "70s", "--trajectory", "static", "--quiet"]
    assert generate.main(argv) == 0
    sound = read_imu(path)
    lines = path.read_text().splitlines()
    for line, row in BAD.items():
        lines[line - 1] = row
    path.write_text("\n".join(lines) + "\n")
    rows = np.ones(len(sound.t_ns), dtype=bool)
    rows[[line - 2 for line in BAD]] = False
    return path, sound, rows


def test_all_classes_of_bad_rows_are_told_together(table):
    path, _, _ = table
    with pytest.raises(InputError) as failed:
        list(imu_blocks(path))
    problems = failed.value.problems
    assert [line.split(": ")[1] for line in problems] == [f"line {number}" for number in BAD]
    for reason in ("2 columns; the header names 7", "'noon' is not a stamp",
                  "'x' is not a number", "a value that is not finite",
                  "before that of an earlier line", "'1_0' is not a number",
                  "'99999999999999999999' is not a stamp"):  # fmt: skip
        assert any(reason in line for line in problems), reason


def test_bad_rows_are_passed_over_and_counted(table):
    path, sound, rows = table
    counts = []
    readings = read_imu(path, skipped=counts.append)
    assert counts == [len(BAD)]
    np.testing.assert_array_equal(readings.t_ns, sound.t_ns[rows])
    np.testing.assert_array_equal(readings.accel, sound.accel[rows])


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        (allan, ["--no-files", "--quiet"]),
        (convert_bag, ["-o", "out.mcap", "--quiet"]),
        (convert_bag, ["-o", "out_euroc", "--format", "euroc", "--quiet"]),
        (dead_reckon, ["--initial-state", "level", "--quiet"]),
    ],
)
def test_every_command_reports_them_and_goes_on_where_asked(
    table, tmp_path, monkeypatch, capsys, command, arguments
):
    monkeypatch.chdir(tmp_path)
    path = str(table[0])
    assert command.main([path, *arguments]) == 2
    assert len(capsys.readouterr().err.splitlines()) == len(BAD)
    assert list(tmp_path.iterdir()) == []
    assert command.main([path, *arguments, "--skip-bad-rows"]) == 0
    assert f"{len(BAD)} bad rows skipped" in capsys.readouterr().err


def test_calibrate_takes_the_argument(table, capsys):
    argv = ["six_position", str(table[0]), "--no-files", "--skip-bad-rows"]
    assert calibrate.main(argv) == 2
    assert capsys.readouterr().err.splitlines()[0].endswith(f"{len(BAD)} bad rows skipped")


def test_equal_stamps_of_doubled_readings_are_sound(tmp_path):
    path = tmp_path / "doubled.csv"
    rows = ["timestamp,gx,gy,gz,ax,ay,az", "5,1,2,3,4,5,6", "5,1,2,3,4,5,6", "6,1,2,3,4,5,6"]
    path.write_text("\n".join(rows))
    assert read_imu(path).t_ns.tolist() == [5, 5, 6]


def test_states_of_euroc_are_told_alike(tmp_path):
    folder = tmp_path / "euroc"
    options = ["--duration", "1s", "--format", "euroc", "--quiet"]
    assert generate.main(["-o", str(folder), *options]) == 0
    path = folder / "state_groundtruth_estimate0" / "data.csv"
    lines = path.read_text().splitlines()
    lines[7], lines[9] = "1,2,3", lines[9].replace(",", ",nan,", 1).rpartition(",")[0]
    path.write_text("\n".join(lines))
    with pytest.raises(InputError) as failed:
        read_odometry(folder)
    assert len(failed.value.problems) == 2
    counts = []
    assert len(read_odometry(folder, skipped=counts.append).t_ns) == 198
    assert counts == [2]


@pytest.mark.parametrize("row", ["x,1,2,3,4,5,6", "1", "hello world foo bar a b c d"])
@pytest.mark.parametrize("kind", ["readings", "poses"])
def test_a_file_of_something_else_is_given_up_early(tmp_path, row, kind):
    """All wrong rows cost no more than the first ten thousand; each of them took 20 us."""
    path = tmp_path / "other.csv"
    path.write_text((row + "\n") * 50_000)
    with pytest.raises(InputError, match=r"most of the first 100\d\d rows are wrong"):
        _READERS[kind](path)


_READERS = {
    "readings": lambda path: read_imu(path, skipped=lambda _: None),
    "poses": lambda path: read_poses(path, skip_bad_rows=True),
}


def test_a_clock_that_was_reset_is_told_once(tmp_path):
    """A line for each of the rows behind it would hide the place where the table has to be cut."""
    path = tmp_path / "reset.csv"
    stamps = [*range(10_000_000_000, 20_000_000_000, 10_000_000), *range(0, 10**9, 10_000_000)]
    path.write_text("".join(f"{t_ns},0,0,0,0,0,9.81\n" for t_ns in stamps))
    with pytest.raises(InputError) as refused:
        read_imu(path)
    (line,) = refused.value.problems
    assert "line 1001: the clock goes back by 19.99 s and on from there; cut the table" in line
