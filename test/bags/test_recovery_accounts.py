# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recovery keeps what damage has not reached, and reports where each lost message was."""

import json
import re
import struct

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.blocks import as_list
from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.messages.schemas import schema
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.bags.writer import BagOptions
from imu_sim_ros.commands import convert_bag

CHUNKS, MESSAGES = 70, 40
RANGE = re.compile(r"(\d+) bytes from byte (\d+) on")
INSERTED = 5


def write_bag(path, compression, storage=None):
    """Write chunks of random readings; return their begins in the file, and the stamps."""
    rng = np.random.default_rng(11)
    t_ns = 10**9 + 5_000_000 * np.arange(CHUNKS * MESSAGES)
    with open_writer(path, BagOptions(storage, compression)) as writer:
        encoder = ImuEncoder("imu_link", writer.encoding)
        topic = writer.add_topic("/imu/data_raw", IMU)
        for k in range(CHUNKS):
            rows = slice(k * MESSAGES, (k + 1) * MESSAGES)
            gyro, accel = rng.standard_normal((2, MESSAGES, 3))
            writer.write(topic, t_ns[rows], encoder.encode(t_ns[rows], gyro, accel))
            writer.flush()
    if storage == "sqlite3":
        return np.empty(0), t_ns
    with open_bag(path) as bag:
        return np.array(sorted(chunk.position for chunk in bag._chunks)), t_ns


def recovered(path):
    """Return the stamps of the recovered messages, and the ranges of bytes left out."""
    with open_bag(path, recover=True) as bag:
        stamps = [block.t_ns for group in bag.groups() for block in group]
        ranges = [tuple(map(int, RANGE.match(line).groups())) for line in bag.damage]
        assert bag.lost_bytes == sum(size for size, _ in ranges)
        return np.concatenate(stamps), [(start, start + size) for size, start in ranges]


def _insert(data, offset, rng):
    data[offset:offset] = rng.bytes(int(rng.integers(1, INSERTED + 1)))


def _delete(data, offset, rng):
    del data[offset : offset + int(rng.integers(1, INSERTED + 1))]


def _overwrite(data, offset, rng):
    data[offset : offset + INSERTED] = rng.bytes(INSERTED)


@pytest.mark.parametrize("damage", [_insert, _delete, _overwrite])
@pytest.mark.parametrize("name", ["none.mcap", "lz4.mcap", "zstd.mcap", "none.bag", "lz4.bag"])
def test_each_lost_message_lies_in_a_reported_range(tmp_path, name, damage):
    path = tmp_path / name
    begins, t_ns = write_bag(path, name.partition(".")[0])
    data = path.read_bytes()
    rng = np.random.default_rng(3)
    for offset in rng.integers(begins[2], begins[-2], 8).tolist():
        torn = bytearray(data)
        damage(torn, offset, rng)
        path.write_bytes(torn)
        stamps, ranges = recovered(path)
        lost = np.flatnonzero(~np.isin(t_ns, stamps))
        assert np.isin(stamps, t_ns).all()
        assert len(np.unique(stamps)) == len(stamps)
        # Two chunks at most: where the damage is, and one whose head it moves.
        assert len(lost) <= 2 * MESSAGES
        for chunk in np.unique(lost // MESSAGES).tolist():
            begin, end = begins[chunk] - INSERTED, begins[chunk + 1] + INSERTED
            assert any(start < end and stop > begin for start, stop in ranges), (offset, chunk)


@pytest.mark.parametrize("opcode", [0x80, 0xC5, 0xFF, 0x0B, 0x0D])
def test_bytes_behind_a_damaged_chunk_are_no_record_because_they_might_be(tmp_path, opcode):
    path = tmp_path / "zstd.mcap"
    begins, t_ns = write_bag(path, "zstd")
    data = bytearray(path.read_bytes())
    chunk, following = int(begins[3]), int(begins[4])
    (length,) = struct.unpack_from("<Q", data, chunk + 1)
    # Behind the inserted byte the chunk seems to end one byte early: its last byte and the opcode
    # and size of the index behind it look like the head of a record of 165 kB.
    data[chunk + 9 + length - 1] = opcode
    data[(chunk + following) // 2 : (chunk + following) // 2] = b"\x55"
    path.write_bytes(data)
    stamps, ((start, stop),) = recovered(path)
    assert sorted(set(t_ns) - set(stamps)) == t_ns[3 * MESSAGES : 4 * MESSAGES].tolist()
    assert start == chunk
    assert stop <= following + 1
    with open_bag(path, recover=True) as bag:
        assert bag.lost_messages == MESSAGES


@pytest.mark.parametrize("name", ["lz4.mcap", "lz4.bag"])
def test_messages_whose_definition_is_lost_are_counted(tmp_path, name):
    path = tmp_path / name
    begins, _ = write_bag(path, "lz4")
    data = path.read_bytes()
    # The definition stands in the first chunk and in the index, which is cut off.
    torn = bytearray(data[: begins[-1]])
    torn[begins[0] + 100 : begins[0] + 110] = bytes(10)
    for match in re.finditer(rb"/imu/data_raw", bytes(torn)):
        torn[match.start() - 30 : match.end()] = bytes(30 + match.end() - match.start())
    path.write_bytes(torn)
    with open_bag(path, recover=True) as bag:
        lost = bag.lost_messages
        line = next(line for line in bag.damage if "definition" in line)
    assert lost >= (CHUNKS - 2) * MESSAGES
    assert line.startswith(f"{(CHUNKS - 2) * MESSAGES} messages: the definition of c")


@pytest.mark.parametrize("place", [0.2, 0.7])
def test_an_unchunked_file_is_read_in_pieces_and_loses_one_message(tmp_path, place):
    path = tmp_path / "unchunked.mcap"
    count = 12_000  # 4 MB
    t_ns = 10**9 + 5_000_000 * np.arange(count)
    rows = ImuEncoder("imu_link", "cdr").encode(t_ns, np.ones((count, 3)), np.ones((count, 3)))
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False, compression=CompressionType.NONE)
        writer.start("ros2", "test")
        definition = schema(IMU, "cdr").text.encode()
        channel = writer.register_channel(
            "/imu", "cdr", writer.register_schema(IMU, "ros2msg", definition)
        )
        for t, payload in zip(t_ns.tolist(), as_list(rows), strict=True):
            writer.add_message(channel, t, payload, t)
        writer.finish()
    with open_bag(path) as bag:
        assert len(bag._chunks) > 3
        assert sum(len(block.t_ns) for group in bag.groups() for block in group) == count
    data = bytearray(path.read_bytes())
    data.insert(int(place * len(data)), 0x80)
    path.write_bytes(data)
    stamps, ((start, stop),) = recovered(path)
    assert count - 2 <= len(stamps) < count
    assert stop - start < 3 * (rows.shape[1] + 31)


@pytest.mark.parametrize("compression", ["none", "lz4"])
def test_a_chunk_with_one_damaged_message_is_kept_if_asked(tmp_path, capsys, compression):
    path = tmp_path / "a.mcap"
    begins, t_ns = write_bag(path, "none")
    data = bytearray(path.read_bytes())
    data[(begins[3] + begins[4]) // 2] ^= 1  # of a covariance
    path.write_bytes(data)
    for options, lost in (([], MESSAGES), (["--keep-damaged"], 0)):
        output = tmp_path / f"{lost}.mcap"
        arguments = [str(path), "-o", str(output), "--recover", "--json", *options]
        assert convert_bag.main([*arguments, "--compression", compression]) == 0
        printed = capsys.readouterr()
        result = json.loads(printed.out)
        assert result["messages"] == {"/imu/data_raw": len(t_ns) - lost}
        assert result["lost_messages"] == lost
        if lost:
            assert "--keep-damaged keeps its messages" in printed.err
            assert f"at least {MESSAGES} messages" in printed.err
        else:
            assert f"its {MESSAGES} messages are kept, and any of them may be wrong" in printed.err
    folder = tmp_path / "mav0"
    options = ["--format", "euroc", "--recover", "--keep-damaged", "--quiet"]
    assert convert_bag.main([str(path), "-o", str(folder), *options]) == 0
    assert len((folder / "imu0" / "data.csv").read_text().splitlines()) == len(t_ns) + 1


def test_keep_damaged_without_recover_is_refused(tmp_path, capsys):
    assert convert_bag.main(["a.mcap", "-o", str(tmp_path / "b.mcap"), "--keep-damaged"]) == 2
    assert "give --recover, too" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        *(
            (name, damage)
            for name in ("a.mcap", "a.bag")
            for damage in (_insert, _delete, _overwrite)
        ),
        ("a.db3", _overwrite),  # lost or inserted bytes shift all pages of a database
    ],
)
def test_damaged_first_bytes_cost_no_message(tmp_path, capsys, name, damage):
    if name.endswith(".db3"):
        folder = tmp_path / "folder"
        _, t_ns = write_bag(folder, None, "sqlite3")
        path = next(folder.glob("*.db3")).rename(tmp_path / name)
    else:
        path = tmp_path / name
        _, t_ns = write_bag(path, None)
    data = bytearray(path.read_bytes())
    damage(data, 2, np.random.default_rng(3))
    path.write_bytes(data)
    assert convert_bag.main([str(path), "-o", str(tmp_path / "no.mcap")]) == 2
    assert "--recover" in capsys.readouterr().err
    with open_bag(path, recover=True) as bag:
        assert "its first bytes are damaged" in bag.found
        stamps = np.concatenate([block.t_ns for group in bag.groups() for block in group])
    np.testing.assert_array_equal(stamps, t_ns)
