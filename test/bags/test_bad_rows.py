# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of readings with bad rows: every class in one report, and going on without them."""

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.bags.read import imu_blocks, open_bag, read_imu, read_odometry
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
                  "'1_0' is not a number",
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


def _stamps(kind):
    """Return 2,000 stamps at 200 Hz, some of which are not in order."""
    t_ns = 10**18 + 5_000_000 * np.arange(2000)
    if kind == "reset":
        t_ns[1000:] -= 4 * 10**9
    elif kind == "stray":
        t_ns[[900, 1500]] = 0, 4 * 10**17
    elif kind == "stray ahead":
        t_ns[900] = 2 * 10**18
    elif kind == "late":
        t_ns[[900, 901]] = t_ns[[901, 900]]
    elif kind == "stray at the start":
        t_ns[0] = 0
    return t_ns


@pytest.mark.parametrize("kind", ["reset", "stray", "stray ahead", "late", "stray at the start"])
def test_a_table_whose_stamps_go_back_gives_what_a_bag_with_them_gives(tmp_path, kind):
    t_ns = _stamps(kind)
    values = np.random.default_rng(1).normal(0.0, 0.01, (len(t_ns), 6))
    values[:, 5] += 9.81
    table, bag = tmp_path / "imu.csv", tmp_path / "imu.mcap"
    rows = np.column_stack([t_ns.astype(object), values.astype(object)])
    table.write_text("".join(",".join(map(repr, row)) + "\n" for row in rows.tolist()))
    ims.convert(table, bag)
    for path in (table, bag):
        readings = read_imu(path)
        np.testing.assert_array_equal(readings.t_ns, t_ns)
        np.testing.assert_array_equal(readings.accel, values[:, 3:])
    kinds = [{finding.kind for finding in ims.inspect(path).findings} for path in (table, bag)]
    assert kinds[0] == kinds[1]
    assert kinds[0] & {"clock_reset", "stamps_stray", "stamps_late"}
    with open_bag(bag) as recorded:
        record_ns = np.concatenate([b.t_ns for group in recorded.groups() for b in group])
    steps = np.diff(record_ns)
    # Late and stray ones share the record time of a neighbour; a reset is one usual step.
    assert steps.min() >= 0
    assert steps.max() <= 15_000_000


def test_errors_are_not_added_to_stray_stamps_of_tables_and_arrays(tmp_path):
    t_ns = _stamps("stray")
    table = tmp_path / "imu.csv"
    table.write_text("".join(f"{t},0,0,0,0,0,9.81\n" for t in t_ns.tolist()))
    result = ims.add_errors_to_file(table, tmp_path / "noisy.csv", imu="bmi088")
    assert result.counts.restarts == result.counts.pauses == 0
    assert sum("stamps_stray" in line for line in result.warnings) == 1
    readings = read_imu(tmp_path / "noisy.csv").t_ns
    np.testing.assert_array_equal(readings, np.delete(t_ns, [900, 1500]))
    values = np.tile([0.0, 0.0, 9.81], (len(t_ns), 1))
    with pytest.warns(match="2 stamps are far from their neighbours"):
        flight = ims.add_errors(t_ns, 0.0 * values, values, imu="bmi088")
    assert len(flight.t_ns) == len(t_ns) - 2
