# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags that lie: one line, no long wait, no memory without bound; and parts of split bags."""

import sqlite3
import struct
import zlib

import numpy as np
import pytest

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.read import open_bag, read_imu
from imu_sim_ros.bags.reader import decompress, gather_messages
from imu_sim_ros.bags.writer import BagOptions
from imu_sim_ros.commands import convert_bag, dead_reckon, generate
from imu_sim_ros.core.errors import InputError

MAGICS = {"x.mcap": b"\x89MCAP0\r\n", "x.bag": b"#ROSBAG V2.0\n", "x.db3": b"SQLite format 3\0"}


@pytest.fixture(autouse=True)
def _working_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", list(MAGICS))
def test_a_file_of_only_the_magic(tmp_path, name, capsys):
    (tmp_path / name).write_bytes(MAGICS[name])
    assert convert_bag.main([name, "-o", "o.mcap"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert convert_bag.main([name, "-o", "o.mcap", "--recover"]) == 2
    error = capsys.readouterr().err
    assert "Traceback" not in error
    if name != "x.db3":
        assert "nothing recoverable" in error
    assert not (tmp_path / "o.mcap").exists()


def test_chunks_larger_than_the_limit_are_not_unpacked():
    import zstandard

    bomb = zstandard.ZstdCompressor().compress(bytes(200 << 20))
    assert len(bomb) < 1 << 20
    for size in (200 << 20, 10**18):
        with pytest.raises(ValueError, match="exceed the limit"):
            decompress(bomb, "zstd", size)
    # It says less than it holds: unpacking ends a step behind what it says.
    with pytest.raises(ValueError, match="not have the expected size"):
        decompress(bomb, "zstd", 1000)


def _mcap(*records: tuple[int, bytes]) -> bytes:
    body = b"".join(struct.pack("<BQ", opcode, len(data)) + data for opcode, data in records)
    return MAGICS["x.mcap"] + body


def _text(content: bytes) -> bytes:
    return struct.pack("<I", len(content)) + content


@pytest.mark.parametrize(
    "records",
    [
        [(3, b"\x01\0" + _text(b"\xff\xfe") * 4)],  # a schema that is no UTF-8
        [(4, b"\x01\0\0\0" + _text(b"\xff") + _text(b"cdr") + _text(b""))],  # nor this channel
        [(6, struct.pack("<QQQI", 0, 0, 2**63, 0) + _text(b"zstd") + struct.pack("<Q", 2**63))],
        [(6, struct.pack("<QQQI", 0, 0, 4, zlib.crc32(b"abcd")) + _text(b"x" * 9) + b"abcd")],
        [(3, b"\x01")],
    ],
)
def test_records_that_are_not_what_they_say(tmp_path, records, capsys):
    (tmp_path / "x.mcap").write_bytes(_mcap(*records))
    for options in ([], ["--recover"]):
        assert convert_bag.main(["x.mcap", "-o", "o.bag", *options]) == 2
        error = capsys.readouterr().err
        assert "Traceback" not in error
        assert ("nothing recoverable" in error) == bool(options)


@pytest.mark.parametrize(
    ("statement", "reason"),
    [
        ("DROP TABLE messages", "not a database of rosbag2"),
        ("DROP TABLE topics", "not a database of rosbag2"),
        (
            "DROP TABLE messages; CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION "
            "ALL SELECT id + 1 FROM n) SELECT id, 1 topic_id, id timestamp, x'00' data FROM n",
            "messages is not a plain table",
        ),
        ("UPDATE messages SET timestamp = 'noon'", "time is not a number"),
        ("UPDATE messages SET data = 'words'", "data are not bytes"),
        ("UPDATE topics SET name = x'ff'", "are not strings"),
    ],
)
def test_databases_that_are_none_of_rosbag2(tmp_path, statement, reason, capsys):
    with open_writer("bag", BagOptions("sqlite3")) as writer:
        topic = writer.add_topic("/imu", IMU)
        t_ns = np.arange(1, 50) * 10**7
        rows = ImuEncoder("i", "cdr").encode(t_ns, np.ones((49, 3)), np.ones((49, 3)))
        writer.write(topic, t_ns, rows)
    file = tmp_path / "bag" / "bag_0.db3"
    database = sqlite3.connect(file)
    database.executescript(statement)
    database.close()
    assert convert_bag.main(["bag/bag_0.db3", "-o", "o.mcap"]) == 2
    error = capsys.readouterr().err
    assert reason in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("starts", "sizes", "reason"),
    [
        ([-8, 0], [4, 4], "past the end"),
        ([0, 8], [4, -4], "past the end"),
        ([2**62, 0], [2**62, 4], "past the end"),
        ([0] * 100, [90] * 100, "overlap"),
    ],
)
def test_an_index_cannot_lead_out_of_its_chunk(starts, sizes, reason):
    data = np.zeros(100, np.uint8)
    with pytest.raises(ValueError, match=reason):
        gather_messages(data, np.array(starts, dtype=np.int64), np.array(sizes, dtype=np.int64))


def test_a_whole_bag_without_messages_is_read(tmp_path):
    for name in ("x.mcap", "x.bag"):
        with open_writer(name) as writer:
            writer.add_topic("/imu", IMU)
        assert len(read_imu(name).t_ns) == 0


def test_devices_are_no_bags():
    with pytest.raises(InputError, match="is a device or a pipe"):
        open_bag("/dev/zero")


def _write(name: str, t_s: np.ndarray, **options: object) -> list[int]:
    """Write readings at times [s]; return how many each part holds."""
    t_ns = np.round(t_s * 1e9).astype(np.int64)
    with open_writer(name, BagOptions(**options)) as writer:
        topic = writer.add_topic("/imu", IMU)
        ones = np.ones((len(t_ns), 3))
        writer.write(topic, t_ns, ImuEncoder("i", writer.encoding).encode(t_ns, ones, ones))
        files = list(writer.files)
    return [len(read_imu(str(file).removesuffix(".active")).t_ns) for file in files]


@pytest.mark.parametrize("name", ["x.mcap", "x.bag"])
def test_parts_count_from_their_first_message_and_none_is_empty(name):
    t_s = np.concatenate([np.arange(10) * 0.1, 1000.05 + np.arange(15) * 0.1])
    assert _write(name, t_s, split_duration=1.0) == [10, 10, 5]


@pytest.mark.parametrize("name", ["x.mcap", "x.bag"])
def test_parts_smaller_than_a_block(name):
    counts = _write(name, np.arange(1000) * 0.005, split_size=100_000)
    # A message has some 330 bytes: about 300 in each part, and no part without any.
    assert sum(counts) == 1000
    assert len(counts) >= 3
    assert min(counts) > 0
    assert max(counts) < 400


def test_a_split_that_never_ends_is_refused_before_it_begins(tmp_path, capsys):
    arguments = ["-o", "x", "--duration", "4h", "--split-duration", "0.0000001s"]
    assert generate.main(arguments) == 2
    assert "split-duration" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_bag_that_is_read_is_not_written_over(tmp_path, capsys):
    assert generate.main(["-o", "x.mcap", "--duration", "2s", "--quiet"]) == 0
    content = (tmp_path / "x.mcap").read_bytes()
    for options in ([], ["--force"]):
        assert dead_reckon.main(["x.mcap", "-o", "./x.mcap", *options]) == 2
        assert "is the input x.mcap" in capsys.readouterr().err
        assert convert_bag.main(["x.mcap", "-o", "x.mcap", *options]) == 2
    assert (tmp_path / "x.mcap").read_bytes() == content
