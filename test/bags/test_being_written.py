# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag that is being written is called so, by readers and by a second writer."""

import numpy as np
import pytest

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.bags.writer import BagOptions
from imu_sim_ros.commands import convert_bag, dead_reckon
from imu_sim_ros.core.errors import InputError

COUNT = 400
T_NS = 10**9 + 5_000_000 * np.arange(COUNT)
FORMS = [("a.mcap", None), ("a.bag", None), ("a", "mcap"), ("a", "sqlite3")]


def write_readings(writer):
    encoder = ImuEncoder("imu_link", writer.encoding)
    topic = writer.add_topic("/imu/data_raw", IMU)
    writer.write(topic, T_NS, encoder.encode(T_NS, np.zeros((COUNT, 3)), np.ones((COUNT, 3))))
    writer.flush()


@pytest.mark.parametrize(("name", "storage"), FORMS)
def test_a_bag_that_is_being_written(tmp_path, capsys, name, storage):
    path, whole = tmp_path / name, tmp_path / "whole.mcap"
    with open_writer(whole) as writer:
        write_readings(writer)
    with open_writer(path, BagOptions(storage)) as writer:
        write_readings(writer)
        with pytest.raises(InputError, match=f"{name}.*another program is writing it"):
            open_bag(path)
        with pytest.raises(InputError, match=f"{name}.*another program is writing this output"):
            open_writer(path, BagOptions(storage))
        assert dead_reckon.main([str(path), "--quiet"]) == 2
        assert "unfinished" not in capsys.readouterr().err
        for force in ([], ["--force"]):
            assert convert_bag.main([str(whole), "-o", str(path), *force]) == 2
            (line,) = capsys.readouterr().err.splitlines()
            assert "another program is writing this output" in line
        with open_bag(path, recover=True) as bag:
            assert [topic.count for topic in bag.topics] == [COUNT]
            assert "it is being written: these are the messages so far" in bag.found
    with open_bag(path) as bag:
        assert [topic.count for topic in bag.topics] == [COUNT]
        assert not bag.found


@pytest.mark.parametrize(("name", "storage"), FORMS)
def test_what_a_killed_writer_leaves_is_unfinished(tmp_path, name, storage):
    path = tmp_path / name
    with open_writer(path, BagOptions(storage)) as writer:
        write_readings(writer)
        copies = [(file, file.read_bytes()) for file in writer.files]
        copied = tmp_path / "copy"
        copied.mkdir()
        for file, data in copies:
            (copied / file.name).write_bytes(data)
    expected = "no metadata.yaml" if storage else "is an unfinished one"
    with pytest.raises(InputError, match=expected):
        open_bag(copied if storage else copied / name)
    if not storage:
        with pytest.raises(InputError, match="an unfinished output is in the way"):
            open_writer(copied / name)
