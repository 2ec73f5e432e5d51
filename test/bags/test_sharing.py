# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that the parts of a program share: open once, and they read the same for all of them."""

import errno
import os
import shutil

import device_logs
import numpy as np
import pytest
import ulog
from openings import count_openings

import imu_sim_ros as ims
from imu_sim_ros.bags.files import open_bag
from imu_sim_ros.commands import inspect
from imu_sim_ros.inputs.rows import open_shared, read_text, row_blocks
from imu_sim_ros.inputs.sharing import open_files_once


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    """Return a folder with the same flight of two seconds in each kind of bag."""
    folder = tmp_path_factory.mktemp("bags")
    flight = ims.simulate(imu="lecture", trajectory="figure_eight", rate=500, duration=2.0, seed=1)
    for name in ("a.mcap", "b.bag", "c"):
        flight.save(folder / name)
    ims.convert(folder / "a.mcap", folder / "d", storage="sqlite3")
    return folder


def stamps(bag):
    """Record times of all messages, group by group."""
    return [np.concatenate([block.t_ns for block in group]) for group in bag.groups()]


@pytest.mark.parametrize("name", ["a.mcap", "b.bag", "c", "d"])
def test_readers_do_not_disturb_each_other(bags, name):
    with open_bag(bags / name) as bag:
        expected = np.concatenate(stamps(bag))
    with open_files_once():
        with open_bag(bags / name) as outer:
            groups = outer.groups()
            first_times = [np.concatenate([block.t_ns for block in next(groups)])]
            with open_bag(bags / name) as inner:
                assert inner is outer
                np.testing.assert_array_equal(np.concatenate(stamps(inner)), expected)
            first_times += [np.concatenate([block.t_ns for block in group]) for group in groups]
        np.testing.assert_array_equal(np.concatenate(first_times), expected)
        with open_bag(bags / name) as again:
            assert again is outer
    with open_bag(bags / name) as bag:
        assert bag is not outer


def test_a_file_that_changed_is_opened_anew(bags, tmp_path):
    path = tmp_path / "x.mcap"
    shutil.copy(bags / "a.mcap", path)
    with open_files_once():
        with open_bag(path) as bag:
            topics = {topic.name: topic.count for topic in bag.topics}
        ims.simulate(imu="lecture", rate=100, duration=0.5).save(path, force=True)
        with open_bag(path) as bag:
            assert {topic.name: topic.count for topic in bag.topics} != topics


def test_a_bag_in_use_stays_open_behind_many_others(bags, tmp_path):
    paths = [tmp_path / f"{k}.mcap" for k in range(40)]
    for path in paths:
        shutil.copy(bags / "a.mcap", path)
    with open_files_once(), open_bag(paths[0]) as bag:
        expected = np.concatenate(stamps(bag))
        for path in paths[1:]:
            with open_bag(path):
                pass
        np.testing.assert_array_equal(np.concatenate(stamps(bag)), expected)
        with open_bag(paths[0]) as another:
            assert another is not bag


def test_readers_of_a_text_have_places_of_their_own(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("1,2\n" * 2_000_000)
    with open_files_once():
        blocks = row_blocks(path, "a table")
        lines = [number for number, _ in next(blocks)]
        assert len(read_text(path)) == 8_000_000
        with open_shared(path) as outer, open_shared(path) as inner:
            assert outer.read(4) == inner.read(4) == b"1,2\n"
            inner.close()
            assert outer.read(3) == b"1,2"
        lines += [number for block in blocks for number, _ in block]
    assert lines == list(range(1, 2_000_001))


def test_a_text_in_use_stays_open_behind_many_others(tmp_path):
    paths = [tmp_path / f"{k}.csv" for k in range(40)]
    for path in paths:
        path.write_text(path.stem)
    with open_files_once(), open_shared(paths[0]) as file:
        assert [read_text(path) for path in paths] == [path.stem for path in paths]
        assert file.read() == b"0"
    descriptors = len(os.listdir("/proc/self/fd"))
    with open_files_once():
        for path in paths:
            read_text(path)
    assert len(os.listdir("/proc/self/fd")) == descriptors


def test_a_text_that_changed_is_read_anew(tmp_path):
    path = tmp_path / "plan.yaml"
    with open_files_once():
        for text in ("first", "second text"):
            path.write_text(text)
            assert read_text(path) == text


def seek_outcome(stream, offset):
    """Return the new position of a stream, or the number of the system's error."""
    try:
        return stream.seek(offset)
    except OSError as error:
        return error.errno


def test_a_shared_file_moves_as_any_file(tmp_path):
    """Views have positions of their own, and refuse those that damaged logs name as files do."""
    path = tmp_path / "file"
    path.write_bytes(bytes(range(100)))
    with open_files_once(), open_shared(path) as view, open_shared(path) as other:
        with path.open("rb") as file:
            for offset, whence in ((90, 0), (-5, 1), (-3, 2), (200, 0)):
                assert view.seek(offset, whence) == file.seek(offset, whence)
                assert view.read(2) == file.read(2)
                assert view.tell() == file.tell()
            for offset in (-1, 2**62):  # the largest one depends on the file system
                assert seek_outcome(view, offset) == seek_outcome(file, offset)
            assert seek_outcome(view, -1) == errno.EINVAL
        assert other.read() == path.read_bytes()


def test_logs_are_opened_once(tmp_path, capsys):
    """A log is recognised, checked and read from one opening of each of its files."""
    flight = ims.simulate(imu="lecture", trajectory="figure_eight", rate=100, duration=2.0)
    paths = [tmp_path / name for name in ("vn.csv", "phone", "phone.zip", "drive", "flight.ulg")]
    device_logs.vectornav(paths[0], flight)
    for path, write in ((paths[1], device_logs.sensor_logger), (paths[3], device_logs.kitti)):
        path.mkdir()
        write(path, flight)
    shutil.make_archive(str(paths[1]), "zip", paths[1])
    ulog.write(paths[4], ulog.flight_topics(flight))
    for path in paths:
        if path.suffix == ".ulg":
            pytest.importorskip("pyulog")
        with count_openings(path) as counts:
            assert inspect.main([str(path), "--json"]) == 0, capsys.readouterr().err
        assert set(counts.values()) <= {0, 1}, (path, counts)
        assert counts.total(), path
