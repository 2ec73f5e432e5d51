# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Containers as other programs write them: compressed as a whole, ROS 1 in MCAP, no schema."""

import bz2
import gzip
import json
import lzma

import lz4.frame
import numpy as np
import pytest
import yaml
import zstandard
from mcap.writer import Writer
from rosbags.highlevel import AnyReader

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.blocks import as_list
from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.messages.schemas import schema
from imu_sim_ros.bags.read import open_bag, read_imu
from imu_sim_ros.bags.writer import BagOptions
from imu_sim_ros.commands import convert_bag
from imu_sim_ros.core.errors import InputError

COUNT = 500
T_NS = 10**9 + 2_500_000 * np.arange(COUNT)
GYRO, ACCEL = np.random.default_rng(5).standard_normal((2, COUNT, 3))
COMPRESSIONS = {
    "zstd": zstandard.compress,
    "lz4": lz4.frame.compress,
    "gz": gzip.compress,
    "bz2": bz2.compress,
    "xz": lzma.compress,
}
DEFINITIONS = {"cdr": (IMU, "ros2msg"), "ros1": ("sensor_msgs/Imu", "ros1msg")}


def bag(path, storage=None):
    with open_writer(path, BagOptions(storage)) as writer:
        encoder = ImuEncoder("imu_link", writer.encoding)
        writer.write(writer.add_topic("/imu", IMU), T_NS, encoder.encode(T_NS, GYRO, ACCEL))
    return path


def mcap(path, *topics, metadata=None):
    """Write topics, each of name, encoding, schema (name, language, text; or None), and count."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("", "test")
        for name, encoding, definition, count in topics:
            number = 0
            if definition is not None:
                type_name, language, text = definition
                number = writer.register_schema(type_name, language, text.encode())
            channel = writer.register_channel(name, encoding, number, metadata or {})
            encoder = ImuEncoder("imu_link", "ros1" if encoding == "ros1" else "cdr")
            rows = as_list(encoder.encode(T_NS, GYRO, ACCEL))
            for t_ns, payload in zip(T_NS[:count].tolist(), rows, strict=False):
                writer.add_message(channel, t_ns, payload, t_ns)
        writer.finish()
    return path


def imu_schema(encoding):
    name, language = DEFINITIONS[encoding]
    return name, language, schema(IMU, encoding).text


def check_readings(path, topic=None):
    readings = read_imu(path, topic)
    np.testing.assert_array_equal(readings.t_ns, T_NS)
    np.testing.assert_array_equal(readings.gyro, GYRO)
    np.testing.assert_array_equal(readings.accel, ACCEL)


@pytest.mark.parametrize("ending", COMPRESSIONS)
@pytest.mark.parametrize("name", ["a.mcap", "a.bag", "a.db3"])
def test_a_file_that_is_compressed_as_a_whole(tmp_path, name, ending):
    if name == "a.db3":
        (source,) = bag(tmp_path / "a", "sqlite3").glob("*.db3")
    else:
        source = bag(tmp_path / name)
    path = tmp_path / f"{name}.{ending}"
    data = COMPRESSIONS[ending](source.read_bytes())
    path.write_bytes(data)
    check_readings(path)
    renamed = tmp_path / f"b{source.suffix}"  # the content decides, not the name
    renamed.write_bytes(data)
    check_readings(renamed)
    files_before = sorted(tmp_path.iterdir())
    with open_bag(path) as opened:
        assert opened.path == path
    assert sorted(tmp_path.iterdir()) == files_before


@pytest.mark.parametrize("ending", COMPRESSIONS)
def test_a_compressed_file_that_ends_early(tmp_path, ending):
    t_ns = 10**9 + 2_500_000 * np.arange(24 * COUNT)  # two of bz2's blocks of 900 kB
    with open_writer(tmp_path / "a.mcap") as writer:
        encoder = ImuEncoder("imu_link", writer.encoding)
        topic = writer.add_topic("/imu", IMU)
        for rows in np.array_split(np.arange(len(t_ns)), 24):
            gyro, accel = np.random.default_rng(rows[0]).standard_normal((2, len(rows), 3))
            writer.write(topic, t_ns[rows], encoder.encode(t_ns[rows], gyro, accel))
            writer.flush()
    whole = (tmp_path / "a.mcap").read_bytes()
    path = tmp_path / f"a.mcap.{ending}"
    data = COMPRESSIONS[ending](whole)
    path.write_bytes(data[: int(0.7 * len(data))])
    with pytest.raises(InputError, match=rf"a\.mcap\.{ending}: .*convert\(\.\.\., recover=True\)"):
        open_bag(path)
    with open_bag(path, recover=True) as opened:
        assert opened.path == path
        assert opened.found
        # 0.7 of the bytes, in whole blocks: one of two of bz2.
        assert 0.3 * len(t_ns) < opened.topics[0].count < len(t_ns)


def rosbag2_compressed(folder, mode):
    """Make a folder one that ``ros2 bag record --compression-mode`` wrote; return its file."""
    file = next(file for file in folder.iterdir() if file.suffix != ".yaml")
    metadata = folder / "metadata.yaml"
    content = yaml.safe_load(metadata.read_text())
    information = content["rosbag2_bagfile_information"]
    information.update(compression_format="zstd", compression_mode=mode)
    if mode == "FILE":
        name = f"{file.name}.zstd"
        information["relative_file_paths"] = [name]
        information["files"][0]["path"] = name
        (folder / name).write_bytes(zstandard.compress(file.read_bytes()))
        file.unlink()
        file = folder / name
    metadata.write_text(yaml.safe_dump(content))
    return file


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_folder_of_rosbag2_with_compressed_files(tmp_path, capsys, storage):
    folder = bag(tmp_path / "flight", storage)
    file = rosbag2_compressed(folder, "FILE")
    check_readings(folder)
    # Decompressed by hand: metadata.yaml names what no longer exists.
    plain = file.with_suffix("")
    plain.write_bytes(zstandard.decompress(file.read_bytes(), 10**7))
    check_readings(folder)
    file.unlink()
    check_readings(folder)
    arguments = [str(folder), "-o", str(tmp_path / "out.mcap"), "--recover", "--json"]
    assert convert_bag.main(arguments) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["recovered"], result["left_out"]) == (False, [])
    # Compressed by hand: metadata.yaml of a bag that was not.
    second_folder = bag(tmp_path / "other", storage)
    (file,) = (file for file in second_folder.iterdir() if file.suffix != ".yaml")
    file.with_name(file.name + ".zst").write_bytes(zstandard.compress(file.read_bytes()))
    file.unlink()
    check_readings(second_folder)
    (second_folder / "metadata.yaml").unlink()
    with open_bag(second_folder, recover=True) as opened:
        assert opened.topics[0].count == COUNT


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_folder_of_rosbag2_with_compressed_messages(tmp_path, storage):
    folder = tmp_path / "flight"
    with open_writer(folder, BagOptions(storage)) as writer:
        rows = as_list(ImuEncoder("imu_link", writer.encoding).encode(T_NS, GYRO, ACCEL))
        packed = [zstandard.compress(row) for row in rows]
        writer.write(writer.add_topic("/imu", IMU), T_NS, packed)
    rosbag2_compressed(folder, "MESSAGE")
    check_readings(folder)
    assert convert_bag.main([str(folder), "-o", str(tmp_path / "out.bag"), "--quiet"]) == 0
    check_readings(tmp_path / "out.bag")


@pytest.mark.parametrize("text", [schema(IMU, "cdr").text, ""])
@pytest.mark.parametrize("language", ["ros2msg", ""])
def test_a_schema_without_text_is_that_of_ros(tmp_path, text, language):
    path = mcap(tmp_path / "a.mcap", ("/imu", "cdr", (IMU, language, text), COUNT))
    check_readings(path)
    assert convert_bag.main([str(path), "-o", str(tmp_path / "b.bag"), "--quiet"]) == 0
    check_readings(tmp_path / "b.bag")


def test_a_topic_without_schema_is_named(tmp_path, capsys):
    topics = ("/imu", "cdr", imu_schema("cdr"), COUNT), ("/other", "cdr", None, COUNT)
    path = mcap(tmp_path / "a.mcap", *topics)
    check_readings(path)
    assert convert_bag.main([str(path), "-o", str(tmp_path / "b.bag")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "/other has no schema, and cannot be translated" in line
    options = ["-o", str(tmp_path / "b.bag"), "--topics", "/imu", "--quiet"]
    assert convert_bag.main([str(path), *options]) == 0
    with pytest.raises(InputError, match=r"it has /other \(no schema\)"):
        read_imu(mcap(tmp_path / "c.mcap", ("/other", "cdr", None, COUNT)))


@pytest.mark.parametrize("metadata", [{}, {"md5sum": schema(IMU, "ros1").digest, "latching": "1"}])
def test_messages_of_ros_1_in_mcap(tmp_path, metadata):
    topic = ("/imu", "ros1", imu_schema("ros1"), COUNT)
    path = mcap(tmp_path / "a.mcap", topic, metadata=metadata)
    check_readings(path)
    for name in ("b.bag", "c.mcap", "d"):
        output = tmp_path / name
        assert convert_bag.main([str(path), "-o", str(output), "--quiet"]) == 0
        check_readings(output)
        with AnyReader([output]) as reader:
            (connection,) = reader.connections
            assert (connection.msgtype, connection.msgcount) == (IMU, COUNT)
            if name == "b.bag":
                assert connection.digest == schema(IMU, "ros1").digest
                assert connection.ext.latching == int(bool(metadata))


def test_topics_of_other_encodings_are_left_out_and_named(tmp_path, capsys):
    notes = ("/notes", "json", ("notes", "jsonschema", "{}"), 3)
    path = mcap(tmp_path / "a.mcap", ("/imu", "cdr", imu_schema("cdr"), COUNT), notes)
    check_readings(path)
    arguments = [str(path), "-o", str(tmp_path / "b.mcap"), "--json"]
    assert convert_bag.main(arguments) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["not_converted"] == ["/notes"]
    assert "/notes holds json, not ROS 2 messages, and is left out" in printed.err
    with pytest.raises(InputError, match="/notes holds json"):
        open_bag(mcap(tmp_path / "c.mcap", notes))
    empty = (*notes[:3], 0)
    with open_bag(mcap(tmp_path / "d.mcap", ("/i", "cdr", None, 1), empty)) as opened:
        assert not opened.unreadable


@pytest.mark.parametrize("count", [0, COUNT])
def test_a_topic_without_messages_is_no_choice(tmp_path, count):
    topics = [(name, "cdr", imu_schema("cdr"), n) for name, n in (("/a", COUNT), ("/b", count))]
    path = mcap(tmp_path / "a.mcap", *topics)
    if count:
        with pytest.raises(InputError, match="several topics"):
            read_imu(path)
    else:
        check_readings(path)
