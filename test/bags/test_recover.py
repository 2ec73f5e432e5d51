# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Interrupted bags: every complete message comes back."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from programs import program, until

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.read import imu_blocks, open_bag
from imu_sim_ros.bags.writer import BagOptions
from imu_sim_ros.core.errors import InputError

CUTS = (0.3, 0.52, 0.77, 0.999)
SINGLE = ("none.mcap", "lz4.mcap", "zstd.mcap", "none.bag", "lz4.bag", "bz2.bag")


def _recovered(path: Path) -> tuple[np.ndarray, np.ndarray]:
    blocks = list(imu_blocks(path, "/imu/data_raw", recover=True))
    return (
        np.concatenate([block.t_ns for block in blocks]),
        np.concatenate([block.gyro for block in blocks]),
    )


@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize("name", SINGLE)
def test_a_torn_file_keeps_what_comes_before_the_tear(bags, name, cut, tmp_path, content):
    data = bags[name].read_bytes()
    path = tmp_path / name
    path.write_bytes(data[: int(len(data) * cut)])
    with pytest.raises(InputError, match="recover=True"):
        open_bag(path)
    t_ns, gyro = _recovered(path)
    count = len(t_ns)
    np.testing.assert_array_equal(t_ns, content.t_ns[:count])
    np.testing.assert_array_equal(gyro, content.gyro[:count])
    # Without compression at most one message and the index are lost; a compressed chunk loses at
    # most the block that is torn: 1 MiB of 4 x 4500 messages in about 6 MiB are 16 %; bz2's blocks
    # of 900 kB are nearly whole chunks.
    allowed = 0.02 if name.startswith("none") else 0.20
    assert count >= (cut - allowed) * len(content.t_ns)


def _zeros(data: bytearray) -> None:
    middle = len(data) // 2
    data[middle : middle + 4096] = bytes(4096)


def _lost_bytes(data: bytearray) -> None:
    place = int(0.15 * len(data))
    del data[place : place + 100]


def _new_bytes(data: bytearray) -> None:
    place = int(0.3 * len(data))
    data[place:place] = np.random.default_rng(2).bytes(50)


@pytest.mark.parametrize("damage", [_zeros, _lost_bytes, _new_bytes])
@pytest.mark.parametrize("name", ["none.mcap", "zstd.mcap", "none.bag", "lz4.bag", "x.db3"])
def test_what_follows_damage_in_the_middle_is_recovered(bags, name, damage, tmp_path, content):
    source = next(bags["folder_sqlite3"].glob("*.db3")) if name == "x.db3" else bags[name]
    data = bytearray(source.read_bytes())
    damage(data)
    path = tmp_path / name
    path.write_bytes(data)
    t_ns, gyro = _recovered(path)
    # The first chunk of 1 MiB or more has 834 readings, with the other topics 1,267 bytes each.
    # Without compression the messages next to the damage are lost: 4096 bytes hold 11 readings.
    assert len(t_ns) >= len(content.t_ns) - (835 if name[:3] in ("zst", "lz4") else 13)
    indices = np.searchsorted(content.t_ns, t_ns)
    np.testing.assert_array_equal(content.t_ns[indices], t_ns)
    np.testing.assert_array_equal(content.gyro[indices], gyro)


def test_a_checksum_leaves_a_chunk_out_and_the_range_is_named(bags, tmp_path, content):
    data = bytearray(bags["none.mcap"].read_bytes())
    place = data.index(content.gyro[2250].tobytes())
    data[place] ^= 1  # all records still follow each other
    path = tmp_path / "none.mcap"
    path.write_bytes(data)
    with open_bag(path, recover=True) as bag:
        (line,) = bag.damage
        assert line.endswith("chunk: the checksum is wrong; keep_damaged=True keeps its messages")
    t_ns, _ = _recovered(path)
    assert len(content.t_ns) - 1350 < len(t_ns) < len(content.t_ns)
    assert content.t_ns[2250] not in t_ns


def test_a_folder_without_metadata(bags, tmp_path, content):
    for name in ("folder_mcap", "folder_sqlite3"):
        folder = tmp_path / name
        folder.mkdir()
        for file in bags[name].iterdir():
            if file.suffix != ".yaml":
                (folder / file.name).write_bytes(file.read_bytes())
        with pytest.raises(InputError, match=r"no metadata\.yaml.*convert\(\.\.\., recover=True\)"):
            open_bag(folder)
        np.testing.assert_array_equal(_recovered(folder)[0], content.t_ns)


def test_a_torn_database_is_recovered_as_far_as_it_goes_and_left_as_it_was(bags, tmp_path, content):
    data = next(bags["folder_sqlite3"].glob("*.db3")).read_bytes()
    path = tmp_path / "torn.db3"
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match="recover=True"):
        open_bag(path)
    t_ns, gyro = _recovered(path)
    assert len(t_ns) > 0.4 * len(content.t_ns)
    np.testing.assert_array_equal(gyro, content.gyro[: len(t_ns)])
    assert path.read_bytes() == data[: len(data) // 2]


WRITE_FOREVER = """
import sys
import numpy as np
from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.writer import BagOptions
writer = open_writer(sys.argv[1], BagOptions(sys.argv[2]))
encoder = ImuEncoder("imu_link", writer.encoding)
topic = writer.add_topic("/imu/data_raw", IMU)
k = 0
while True:
    t_ns = np.array([10**9 + k * 5_000_000])
    row = encoder.encode(t_ns, np.full((1, 3), float(k)), np.ones((1, 3)))
    writer.write(topic, t_ns, [row.tobytes()])
    k += 1
    if k % 1000 == 0:
        writer.flush()
        print(k, flush=True)
"""


@pytest.mark.parametrize(
    ("name", "storage"), [("x.mcap", "mcap"), ("x", "mcap"), ("y", "sqlite3"), ("x.bag", "ros1")]
)
def test_kill_9_costs_at_most_what_was_not_flushed(tmp_path, name, storage):
    path = tmp_path / name
    process = subprocess.Popen(
        [sys.executable, "-c", WRITE_FOREVER, str(path), storage], stdout=subprocess.PIPE, text=True
    )
    flushed = 0
    for _ in range(5):
        flushed = int(process.stdout.readline())
    time.sleep(0.05)
    process.kill()
    rest = process.stdout.read().split()
    process.wait()
    flushed = int(rest[-1]) if rest else flushed
    t_ns, gyro = _recovered(path)
    assert len(t_ns) >= flushed
    np.testing.assert_array_equal(gyro[:, 0], np.arange(len(t_ns)))


def test_what_a_killed_command_left_is_found(tmp_path):
    arguments = ["--duration", "40h", "--trajectory", "static", "-o", str(tmp_path / "x.mcap")]
    process = subprocess.Popen([*program("generate"), *arguments])
    growing = tmp_path / "x.mcap.active" / "x.mcap.active"
    until(lambda: growing.exists() and growing.stat().st_size > 2 * 10**6)
    process.kill()
    process.wait()
    with pytest.raises(InputError, match=r"is an unfinished one, convert\(\.\.\., recover=True\)"):
        open_bag(tmp_path / "x.mcap")
    t_ns, _ = _recovered(tmp_path / "x.mcap")
    assert len(t_ns) > 1000
    assert np.all(np.diff(t_ns) == 5_000_000)


def test_messages_before_a_durable_flush_can_be_recovered(tmp_path, content):
    for name, storage in (("x.mcap", "mcap"), ("y", "sqlite3"), ("x.bag", "ros1")):
        with open_writer(tmp_path / name, BagOptions(storage)) as writer:
            topic = writer.add_topic("/imu/data_raw", IMU)
            row = ImuEncoder("i", writer.encoding).encode(
                content.t_ns[:1], content.gyro[:1], content.accel[:1]
            )
            writer.write(topic, content.t_ns[:1], [row[0].tobytes()])
            writer.flush(durable=True)
            assert len(_recovered(tmp_path / name)[0]) == 1
