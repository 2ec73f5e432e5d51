# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recovery says what it found, what it left out and why, of every container."""

import json
import os
import shutil
import sqlite3

import pytest

from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.commands import convert_bag, generate
from imu_sim_ros.core.errors import InputError, MachineError


def generate_bag(path, *options):
    assert generate.main(["-o", str(path), "--duration", "2s", "--quiet", *options]) == 0
    return path


def recovered(capsys, path, output):
    """Return the lines and the JSON result of a recovery."""
    arguments = [str(path), "-o", str(output), "--recover", "--json"]
    assert convert_bag.main(arguments) == 0
    printed = capsys.readouterr()
    result = json.loads(printed.out)
    prefix = f"convert_bag: {path}: "
    lines = [line.removeprefix(prefix) for line in printed.err.splitlines()]
    expected = [f"found: {line}" for line in result["found"]]
    expected += [f"left out: {line}" for line in result["left_out"]]
    count = len(result["left_out"])
    summary = "1 range is" if count == 1 else f"{count} ranges are" if count else "nothing is"
    amounts = [f"{result['lost_bytes']} bytes"] if result["lost_bytes"] else []
    if result["lost_messages"]:
        amounts.append(f"at least {result['lost_messages']} messages")
    expected.append(f"{summary} left out{': ' if amounts else ''}{', '.join(amounts)}")
    assert lines == expected
    assert result["lost_ranges"] == count
    return result


@pytest.mark.parametrize("name", ["a.mcap", "a.bag", "a"])
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_of_a_whole_bag_nothing_is_left_out(tmp_path, capsys, name, storage):
    options = ["--storage", storage] if name == "a" else []
    result = recovered(capsys, generate_bag(tmp_path / name, *options), tmp_path / "out.mcap")
    assert (result["recovered"], result["found"], result["left_out"]) == (False, [], [])
    assert result["messages"]["/imu/data_raw"] == 400


@pytest.mark.parametrize("name", ["a.mcap", "a.bag"])
def test_two_files_one_after_the_other(tmp_path, capsys, name):
    path = generate_bag(tmp_path / name)
    data = path.read_bytes()
    path.write_bytes(data + data)
    if name == "a.mcap":  # its end is whole, and that of another file
        with pytest.raises(InputError, match="recover=True"):
            open_bag(path)
    result = recovered(capsys, path, tmp_path / "out.mcap")
    assert result["recovered"]
    assert result["messages"]["/imu/data_raw"] == 400
    (line,) = result["left_out"]
    assert line.startswith(f"{len(data)} bytes from byte {len(data)} on")


@pytest.mark.parametrize("name", ["a.mcap", "a.bag"])
def test_a_splice_that_gives_a_channel_another_topic(tmp_path, capsys, name):
    original = generate_bag(tmp_path / name, "--imu-only").read_bytes()
    second_path = tmp_path / f"other_{name}"
    second = generate_bag(second_path, "--imu-only", "--topic", "imu/data_raw=/other").read_bytes()
    path = tmp_path / f"spliced_{name}"
    if name == "a.mcap":
        cut, start = _mcap_end_of_data(original), 8
    else:
        cut, start = _ros1_end_of_chunks(original), 13
    path.write_bytes(original[:cut] + second[start:])
    result = recovered(capsys, path, tmp_path / "out.mcap")
    assert result["messages"] == {"/imu/data_raw": 400}
    assert result["recovered"]
    assert any("/other from here on, and /imu/data_raw before" in x for x in result["left_out"])


def _mcap_end_of_data(data):
    position = 8
    while data[position] != 0x0F:
        position += 9 + int.from_bytes(data[position + 1 : position + 9], "little")
    return position


def _ros1_end_of_chunks(data):
    header = data.index(b"index_pos=") + len(b"index_pos=")
    return int.from_bytes(data[header : header + 8], "little")


@pytest.mark.parametrize("name", ["a.mcap", "a.bag"])
def test_a_file_that_ends_early(tmp_path, capsys, name):
    path = generate_bag(tmp_path / name)
    path.write_bytes(path.read_bytes()[:150_000])
    result = recovered(capsys, path, tmp_path / "out.mcap")
    (finding,), (left_out,) = result["found"], result["left_out"]
    assert "the recording was interrupted" in finding
    assert left_out.endswith("no whole record")
    size = 150_000 // sum(result["messages"].values())  # of two messages and their headers
    assert int(left_out.split()[0]) < 2 * size


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_split_bag_whose_middle_file_is_missing(tmp_path, capsys, storage):
    bag = generate_bag(tmp_path / "bag", "--split-duration", "0.5s", "--storage", storage)
    part = next(bag.glob("bag_1.*"))
    part.rename(bag / part.name.replace("_1", "_9"))
    next(bag.glob("bag_2.*")).write_bytes(b"nonsense")
    result = recovered(capsys, bag, tmp_path / "out.mcap")
    assert result["messages"]["/imu/data_raw"] == 300
    assert result["found"] == [f"bag_9{part.suffix}: metadata.yaml does not list it"]
    assert result["left_out"][0] == f"{part.name}: metadata.yaml lists it, and it is not there"
    assert result["left_out"][1].startswith(f"bag_2{part.suffix}: ")
    (bag / "metadata.yaml").unlink()
    result = recovered(capsys, bag, tmp_path / "again.mcap")
    assert "no metadata.yaml" in result["found"][0]


def test_a_torn_database_in_every_form(tmp_path, capsys):
    (part,) = generate_bag(tmp_path / "bag", "--storage", "sqlite3").glob("*.db3")
    path = tmp_path / "torn.db3"
    path.write_bytes(part.read_bytes()[:100_000])
    counts = set()
    for name in ("out.mcap", "folder", "out.tum"):
        form = ["--format", "euroc"] if name == "folder" else []
        arguments = [str(path), "-o", str(tmp_path / name), "--recover", "--json", *form]
        assert convert_bag.main(arguments) == 0
        result = json.loads(capsys.readouterr().out)
        assert result["left_out"][0].startswith("the messages after number ")
        counts.add(result["messages"]["/ground_truth/odom"])
    assert len(counts) == 1


def test_a_database_is_recovered_without_a_byte_beside_it(tmp_path, monkeypatch, capsys):
    (part,) = generate_bag(tmp_path / "bag", "--storage", "sqlite3").glob("*.db3")
    folder = tmp_path / "full"
    folder.mkdir()
    path = shutil.copy(part, folder / "a.db3")
    database = sqlite3.connect(path, isolation_level=None)
    database.execute("PRAGMA cache_size = 1")
    database.execute("BEGIN")
    database.execute("DELETE FROM messages")
    journal = folder / "a.db3-journal"
    killed = tmp_path / "killed"
    shutil.copytree(folder, killed)
    database.rollback()
    database.close()
    assert (killed / journal.name).stat().st_size
    files_before = {file.name: file.read_bytes() for file in killed.iterdir()}
    asked = []
    room = tmp_path / "room"
    room.mkdir()
    monkeypatch.setenv("TMPDIR", str(room))
    monkeypatch.setattr("tempfile.tempdir", None)
    with open_bag(killed / "a.db3", recover=True) as bag:
        asked += list(room.iterdir())
        assert {file.name: file.read_bytes() for file in killed.iterdir()} == files_before
        assert "rolled back" in bag.found[0]
    assert len(asked) == 1
    assert not list(room.iterdir())
    result = recovered(capsys, killed / "a.db3", tmp_path / "out.mcap")
    assert result["messages"]["/imu/data_raw"] == 400

    def full(*_):
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr("shutil.copyfile", full)
    with pytest.raises(MachineError, match="TMPDIR names a folder with more room"):
        open_bag(killed / "a.db3", recover=True)
