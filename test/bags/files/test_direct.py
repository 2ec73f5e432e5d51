# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writing past the page cache: the same bytes, whatever refuses it, and only where it is faster."""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros.bags import open_bag, open_writer, read_imu
from imu_sim_ros.bags.files import OutputFile, Pace, direct
from imu_sim_ros.bags.messages import IMU, ImuEncoder

AT_ONCE = {"first_s": 0.0, "piece": 1}
"""A trial after the first write, whatever it takes."""


class Always(Pace):
    """Direct from the beginning."""

    def __init__(self):
        super().__init__()
        self.direct = True

    def add(self, size, seconds):
        """Go on."""


class InTurn(Pace):
    """One write this way, the next that way."""

    def add(self, size, seconds):
        """Change."""
        self.direct = not self.direct


def _parts():
    """Return records of all sizes: within a block, across blocks, whole blocks, more."""
    rng = np.random.default_rng(5)
    sizes = [1, 4095, 4096, 1, 0, 8192, 100_000, 3, (2 << 20) - 5, 2 << 20, (5 << 20) + 77, 13]
    return [rng.integers(0, 256, size, dtype=np.uint8).tobytes() for size in sizes]


@pytest.fixture
def disk(tmp_path):
    """Return a folder whose file system writes directly."""
    with (tmp_path / "probe").open("w+b", buffering=0) as file:
        try:
            direct.DirectAppender(file.fileno()).append(0, [b"x"])
        except OSError:
            pytest.skip(f"{tmp_path}: its file system has no direct writing")
    return tmp_path


@pytest.mark.parametrize("pace", [Always, InTurn, lambda: Pace(**AT_ONCE), None])
def test_the_file_has_the_same_bytes_whatever_the_way(disk, pace):
    file = OutputFile(disk / "x", pace=pace and pace())
    content = b""
    for part in _parts():
        file.write(part[:2000], memoryview(part)[2000:])
        content += part
        assert file.current.read_bytes()[: file.position] == content
        assert file.current.stat().st_size - file.position < direct.BLOCK_BYTES
    file.rewrite(3, b"again")
    content = content[:3] + b"again" + content[8:]
    file.write(b"end")
    file.finish()
    assert (disk / "x").read_bytes() == content + b"end"


def test_a_file_goes_on_where_it_was_cut(disk):
    file = OutputFile(disk / "x", pace=Always())
    parts = _parts()
    file.write(*parts)
    file.cut(len(parts[0]) + len(parts[1]) + 100)  # in the middle of a block
    file.write(b"b" * 50)
    file.cut(file.position - 50)  # to the very place of a block in memory, which is another now
    file.write(b"c" * 60)
    file.abandon()
    expected = (parts[0] + parts[1] + parts[2])[: len(parts[0]) + len(parts[1]) + 100] + b"c" * 60
    assert file.current.read_bytes() == expected


def test_what_others_read_has_no_rest_of_a_block(disk):
    file = OutputFile(disk / "x", pace=Always())
    file.write(b"a" * 5000)
    file.stay_cached()
    assert file.current.read_bytes() == b"a" * 5000
    file.write(b"b" * 5000)
    assert file.current.read_bytes() == b"a" * 5000 + b"b" * 5000
    file.finish()


def test_a_file_system_that_refuses_gets_the_same_file():
    """A tmpfs has, up to Linux 6.5, no O_DIRECT; where it has, both ways are tried all the same."""
    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        file = OutputFile(Path(folder) / "x", pace=Always())
        for part in _parts():
            file.write(part)
        file.finish()
        assert (Path(folder) / "x").read_bytes() == b"".join(_parts())


def test_where_the_system_refuses_nothing_is_lost_nor_tried_again(disk, monkeypatch):
    """A disk with larger blocks than ours gives EINVAL; so does this one with smaller ones."""
    tried = []

    class Refused(direct.DirectAppender):
        def append(self, position, parts):
            tried.append(position)
            super().append(position, parts)

    monkeypatch.setattr("imu_sim_ros.bags.files.atomic_file.DirectAppender", Refused)
    file = OutputFile(disk / "x", pace=Always())
    parts = _parts()
    file.write(*parts[:3])
    monkeypatch.setattr(direct, "BLOCK_BYTES", 100)
    for part in parts[3:]:
        file.write(part)
    file.finish()
    assert len(tried) == 2
    assert (disk / "x").read_bytes() == b"".join(parts)


FULL = """
import resource, sys
from pathlib import Path
from imu_sim_ros.bags.files import OutputFile, Pace
from imu_sim_ros.errors import MachineError
resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))
pace = Pace()
pace.direct = True
file = OutputFile(Path(sys.argv[1]), pace=pace)
try:
    for k in range(100):
        file.write(bytes([k]) * 30_000, b"-" * 77)
except MachineError as error:
    print(k, error)
file.write(b"the end")
file.finish()
"""


def test_where_the_disk_is_full_whole_records_are_kept(disk):
    path = disk / "x"
    command = [sys.executable, "-c", FULL, str(path)]
    said = subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout
    assert said == f"33 {path}: File too large\n"
    whole = b"".join(bytes([k]) * 30_000 + b"-" * 77 for k in range(33))
    assert path.read_bytes() == whole + b"the end"


@pytest.mark.parametrize("name", ["x.mcap", "x.bag"])
def test_bags_are_the_same_and_what_a_killed_process_leaves_is_recovered(disk, name, monkeypatch):
    t_ns = 10**9 + 5_000_000 * np.arange(9_000)
    gyro, accel = np.random.default_rng(3).standard_normal((2, len(t_ns), 3))
    contents = []
    for pace in (Always, InTurn, Pace):
        monkeypatch.setattr("imu_sim_ros.bags.chunks.Pace", pace)
        path = disk / pace.__name__ / name
        with open_writer(path) as writer:
            topic = writer.add_topic("/imu", IMU)
            messages = ImuEncoder("imu_link", writer.encoding).pattern(t_ns, gyro, accel)
            for part in (slice(0, 4000), slice(4000, 9000)):
                writer.write(topic, t_ns[part], messages[part])
                writer._wait()
            # As after SIGKILL: no index, and a block that is filled with zeros.
            (disk / f"killed_{name}").write_bytes(writer.file.current.read_bytes())
        contents.append(path.read_bytes())
        with open_bag(disk / f"killed_{name}", recover=True) as bag:
            assert sum(topic.count for topic in bag.topics) == len(t_ns)
        assert np.array_equal(read_imu(path).gyro, gyro)
    assert contents[0] == contents[1] == contents[2]


# ------------------------------------------------------------------------------------ the choice
MIB = 1 << 20


def _ways(costs, seconds, **arguments):
    """Return the way of each MiB that is written until some time has passed.

    :param costs: a function of the time that gives the seconds of a MiB, cached and direct.
    """
    pace, passed, ways = Pace(**arguments), 0.0, []
    while passed < seconds:
        ways.append((pace.direct, passed))
        took = costs(passed)[pace.direct]
        pace.add(MIB, took)
        passed += took
    return ways


def _share(ways, since=0.0):
    chosen = [way for way, at in ways if at >= since]
    return sum(chosen) / len(chosen)


def test_a_small_file_stays_in_the_cache():
    # 25 ms of writing, of whatever size.
    assert not any(way for way, _ in _ways(lambda _: (0.0003, 0.0001), 0.025))


def test_a_disk_that_is_faster_than_the_cache_is_written_directly():
    ways = _ways(lambda _: (0.0025, 0.0006), 2.0)
    first = next(at for way, at in ways if way)
    assert first < 0.03 + 4 * 0.0025 + 1e-9  # the piece that is being written is finished
    assert _share(ways, first) > 0.97


def test_a_direct_second_counts_half():
    assert _share(_ways(lambda _: (0.0006, 0.0011), 2.0)) > 0.9
    assert _share(_ways(lambda _: (0.0006, 0.0013), 2.0)) < 0.1


@pytest.mark.parametrize("direct_s", [0.002, 0.05, 0.5])
def test_a_slow_disk_costs_at_most_a_twentieth(direct_s):
    """An SSD of 500 MB/s, a card of 20 and a stick of 2; the cache takes 2.5 GB/s.

    The first trial costs what four MiB do; then trials have 1/32 of the time, so that the whole is
    at most 1 / (1 - 1/32) of the time in the cache and a few trials.
    """
    ways = _ways(lambda _: (0.0004, direct_s), 100 * direct_s + 3.0)
    time_of = sum(direct_s for way, _ in ways if way)
    written = len(ways) * 0.0004
    allowed = 4 * direct_s + (written + time_of) / 32 + 4 * direct_s
    assert time_of <= allowed


def test_a_cache_that_becomes_slow_is_left_and_one_that_becomes_fast_is_found():
    def costs(now):
        return (0.0002 if now < 1.0 or now > 3.0 else 0.003), 0.0006

    ways = _ways(costs, 8.0)
    assert _share([w for w in ways if w[1] < 1.0]) < 0.1
    assert _share([w for w in ways if 1.1 < w[1] < 3.0]) > 0.9
    assert _share([w for w in ways if w[1] > 6.0]) < 0.1


def test_the_simulators_bags_are_written_in_the_chosen_way(disk, monkeypatch):
    """The whole way of a bag: with trials from the first write on, threads and both ways."""
    paces = []

    class Seen(Pace):
        def __init__(self):
            super().__init__(first_s=0.0, piece=1)
            self.ways = set()
            paces.append(self)

        def add(self, size, seconds):
            self.ways.add(self.direct)
            super().add(size, seconds)

    monkeypatch.setattr("imu_sim_ros.bags.chunks.Pace", Seen)
    from imu_sim_ros.commands.generate import main

    arguments = ["--trajectory", "static", "--duration", "3min", "--quiet", "-o"]
    assert main([*arguments, str(disk / "x.mcap")]) == 0
    assert paces[0].ways == {False, True}
    monkeypatch.undo()
    (disk / "y").mkdir()
    assert main([*arguments, str(disk / "y" / "x.mcap")]) == 0
    assert (disk / "x.mcap").read_bytes() == (disk / "y" / "x.mcap").read_bytes()
