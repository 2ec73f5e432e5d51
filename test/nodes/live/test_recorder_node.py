# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The recorder as a real process: what is published is in the bag, whatever ends it."""

import os
import re
import resource
import shutil
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from imu_sim_ros.commands import convert_bag

pytestmark = pytest.mark.ros

PERIOD_NS = 5_000_000
IMU, TRUTH = "/imu/data_raw", "/ground_truth/odom"
FORMS = {"mcap": "bag", "sqlite3": "bag", "ros1": "bag.bag", "file": "bag.mcap"}
# A killed process leaves its shared memory behind; sockets vanish with it.
WITHOUT_SHARED_MEMORY = {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}


def stored(path: Path) -> dict[str, list[int]]:
    """Return the record times of every topic, checked against the stamps in the messages."""
    times: dict[str, list[int]] = {}
    for topic, t_ns, raw, encoding in messages(path):
        times.setdefault(topic, []).append(t_ns)
        if topic != "/plain":
            second, nanosecond = struct.unpack_from("<iI", raw, 4)  # behind CDR header or seq
            assert t_ns == second * 10**9 + nanosecond, encoding
    return times


def messages(path: Path) -> Iterator[tuple[str, int, bytes, str]]:
    """Yield the messages of a bag as readers of other people see them."""
    if path.suffix == ".mcap":
        with path.open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages():
                yield channel.topic, message.log_time, message.data, channel.message_encoding
    else:
        with AnyReader([path]) as reader:
            for connection, t_ns, raw in reader.messages():
                reader.deserialize(raw, connection.msgtype)
                yield connection.topic, t_ns, raw, "cdr"


def stamps(count: int, first_ns: int = 10**9) -> list[int]:
    return [first_ns + k * PERIOD_NS for k in range(count)]


def record(node, tmp_path, form, *arguments, **extra):
    """Start a recorder of one form; returns it and the bag's path."""
    bag = tmp_path / FORMS[form]
    storage = ["--storage", form] if form == "sqlite3" else []
    return node("recorder", "-o", str(bag), *storage, *arguments, **extra), bag


@pytest.mark.parametrize(
    ("form", "compression"),
    [
        ("mcap", "none"),
        ("file", "zstd"),
        ("sqlite3", "none"),
        ("ros1", "none"),
        ("ros1", "bz2"),
    ],
)
def test_everything_published_is_in_the_bag_under_its_own_stamp(
    node, feed, tmp_path, form, compression
):
    recorder, bag = record(node, tmp_path, form, "--compression", compression)
    assert feed(count=200).status() == 0
    assert recorder.end() == 0, recorder.output
    assert stored(bag) == {IMU: stamps(200), TRUTH: stamps(200)}
    assert [line.split() for line in recorder.output.splitlines() if "data_raw  " in line] == [
        [IMU, "200", "200.00", "0", "0", "0", "0"]
    ]


def test_gaps_and_duplicates_are_reported_at_the_end(node, feed, tmp_path):
    recorder, bag = record(node, tmp_path, "mcap", "imu/data_raw")
    feed(count=300, topics=["imu"], skip=[100, 150, 151], repeat=[20]).status()
    assert recorder.end(signal.SIGTERM) == 0
    assert len(stored(bag)[IMU]) == 298
    row = next(line.split() for line in recorder.output.splitlines() if "data_raw  " in line)
    assert row[1] == "298"
    assert row[3:] == ["2", "3", "1", "0"]


@pytest.mark.parametrize("offer", [{"best_effort": True}, {"latched": True}])
def test_qos_is_taken_from_the_publisher(node, feed, tmp_path, offer):
    recorder, bag = record(node, tmp_path, "mcap", "imu/data_raw")
    feed(count=50, rate=200.0, topics=["imu"], **offer).status()
    assert recorder.end() == 0
    assert len(stored(bag)[IMU]) == 50
    metadata = (bag / "metadata.yaml").read_text()
    reliability = "best_effort" if "best_effort" in offer else "reliable"
    assert f"reliability: {reliability}" in metadata
    assert f"durability: {'transient_local' if 'latched' in offer else 'volatile'}" in metadata


def test_latched_messages_from_before_the_recorder_are_recorded(node, feed, tmp_path):
    source = feed(count=20, topics=["imu"], latched=True, wait=0, hold=20.0)
    source.wait_for("end")
    recorder, bag = record(node, tmp_path, "mcap")
    recorder.wait_for("recording /imu/data_raw")
    last = struct.pack("<iI", *divmod(stamps(20)[-1], 10**9))
    recorder.wait_until(
        lambda: any(last in path.read_bytes() for path in tmp_path.rglob("*.mcap*"))
    )
    assert recorder.end() == 0
    assert stored(bag)[IMU] == stamps(20)


def test_it_waits_for_publishers_with_a_message_and_takes_topics_that_appear_later(
    node, feed, tmp_path
):
    recorder, bag = record(node, tmp_path, "mcap")
    recorder.wait_for("waiting for a publisher of any topic")
    feed(count=20, topics=["imu"]).status()
    feed(count=20, topics=["truth"]).status()
    assert recorder.end() == 0
    assert stored(bag) == {IMU: stamps(20), TRUTH: stamps(20)}


def test_messages_without_stamp_get_the_time_of_their_reception(node, feed, tmp_path):
    before = time.time_ns()
    recorder, bag = record(node, tmp_path, "ros1")
    feed(count=20, topics=["plain"]).status()
    assert recorder.end() == 0
    times = stored(bag)["/plain"]
    assert len(times) == 20
    assert before < times[0] <= times[-1] < time.time_ns()


def test_messages_whose_stamp_was_never_set_get_the_time_of_their_reception(node, feed, tmp_path):
    before = time.time_ns()
    recorder, bag = record(node, tmp_path, "mcap")
    feed(count=20, topics=["imu"], unstamped=True).status()
    assert recorder.end() == 0
    times = [t_ns for _, t_ns, _, _ in messages(bag)]
    assert len(times) == 20
    assert before < times[0] <= times[-1] < time.time_ns()
    row = next(line.split() for line in recorder.output.splitlines() if "data_raw  " in line)
    assert row[3:] == ["-"] * 4  # times of reception tell nothing of the source


@pytest.mark.parametrize("form", ["mcap", "ros1"])
def test_the_time_of_reception_is_recorded_on_request(node, feed, tmp_path, form):
    before = time.time_ns()
    recorder, bag = record(node, tmp_path, form, "--record-time", "reception")
    feed(count=100, topics=["imu"], skip=[50]).status()
    assert recorder.end() == 0
    found = list(messages(bag))
    times = [t_ns for _, t_ns, _, _ in found]
    assert before < times[0] <= times[-1] < time.time_ns()
    assert times == sorted(times)
    in_them = [struct.unpack_from("<iI", raw, 4) for _, _, raw, _ in found]
    assert [s * 10**9 + ns for s, ns in in_them] == [t for t in stamps(100) if t != stamps(51)[-1]]
    row = next(line.split() for line in recorder.output.splitlines() if "data_raw  " in line)
    assert row[3:] == ["1", "1", "0", "0"]  # gaps are those of the stamps all the same


def test_it_ends_by_itself_after_the_duration(node, feed, tmp_path):
    recorder, bag = record(node, tmp_path, "mcap", "--duration", "1s")
    feed(count=600)
    assert recorder.status() == 0
    # Ends in a machine's good time, but not before one second of 200 Hz.
    assert 195 <= len(stored(bag)[IMU]) < 600


def test_it_ends_by_itself_at_the_size(node, feed, tmp_path):
    recorder, bag = record(node, tmp_path, "sqlite3", "--max-size", "0.1")
    feed(count=2000)
    assert recorder.status() == 0
    assert sum(file.stat().st_size for file in bag.iterdir()) >= 0.1e6
    assert 90 <= len(stored(bag)[IMU]) < 2000


@pytest.mark.parametrize("form", ["mcap", "sqlite3"])
def test_a_split_bag_is_one_bag_of_several_files(node, feed, tmp_path, form):
    recorder, bag = record(node, tmp_path, form, "--split-duration", "0.5")
    feed(count=220).status()
    assert recorder.end() == 0
    files = [f"bag_{k}.{'mcap' if form == 'mcap' else 'db3'}" for k in range(3)]
    assert sorted(file.name for file in bag.iterdir()) == [*files, "metadata.yaml"]
    assert stored(bag) == {IMU: stamps(220), TRUTH: stamps(220)}


@pytest.mark.parametrize("form", ["mcap", "ros1"])
def test_an_existing_output_is_never_touched(node, tmp_path, form):
    (tmp_path / FORMS[form]).write_text("precious")
    recorder, bag = record(node, tmp_path, form)
    assert recorder.status() == 2
    assert recorder.output == f"recorder: {bag}: already exists; nothing is overwritten\n"
    assert bag.read_text() == "precious"


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--duration", "soon"], "--duration: 'soon' is not a duration such as 20s"),
        (["-o", "/proc/nosuch/bag"], "/proc/nosuch"),
    ],
)
def test_bad_arguments_end_it_with_one_line(node, arguments, line):
    recorder = node("recorder", *arguments)
    assert recorder.status() == 2
    assert recorder.output.startswith(f"recorder: {line}")
    assert recorder.output.count("\n") == 1


@pytest.mark.parametrize("form", ["mcap", "sqlite3", "ros1", "file"])
def test_kill_costs_at_most_the_last_second(node, feed, tmp_path, form):
    recorder, bag = record(node, tmp_path, form, **WITHOUT_SHARED_MEMORY)
    source = feed(count=2000, hold=0.0, environment=WITHOUT_SHARED_MEMORY)
    source.wait_for("begin")
    time.sleep(2.5)
    recorder.send(signal.SIGKILL)
    recorder.status()
    recovered = tmp_path / ("recovered.bag" if form == "ros1" else "recovered")
    unfinished = bag if bag.exists() else bag.with_name(bag.name + ".active")
    words = [str(unfinished), "--recover", "-o", str(recovered), "--quiet"]
    assert convert_bag.main(words) == 0
    for topic, times in stored(recovered).items():
        assert times == stamps(len(times)), topic
        # 2.5 s had been published by then, and the last second of it may be lost.
        assert len(times) >= (2.5 - 1.0) * 200, topic


@pytest.mark.parametrize("form", ["mcap", "sqlite3", "ros1"])
def test_a_full_disk_is_reported_and_what_was_written_is_kept(node, feed, tmp_path, form):
    limit = 400_000

    def small_disk() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    recorder, _ = record(node, tmp_path, form, preparation=small_disk, **WITHOUT_SHARED_MEMORY)
    feed(count=3000, environment=WITHOUT_SHARED_MEMORY)
    assert recorder.status() == 1
    assert "recorder: " in recorder.output
    assert "keeps the messages written before" in recorder.output
    assert "Traceback" not in recorder.output
    files = [file for file in tmp_path.rglob("bag*") if file.is_file()]
    assert sum(file.stat().st_size for file in files) > 0.5 * limit


@pytest.mark.parametrize("form", ["mcap", "sqlite3", "file"])
def test_a_vanished_bag_is_noticed(node, feed, tmp_path, form):
    recorder, bag = record(node, tmp_path, form)
    feed(count=2000).wait_for("begin")
    time.sleep(1.0)
    if bag.is_dir():
        shutil.rmtree(bag)
    else:
        bag.with_name(bag.name + ".active").unlink()
    assert recorder.status() == 1
    assert form == "sqlite3" or "another program has deleted it" in recorder.output
    assert "was removed and is lost" in recorder.output
    assert "keeps the messages written" not in recorder.output


def test_a_driver_that_is_killed_and_started_again_is_recorded_on(node, feed, tmp_path):
    recorder, bag = record(node, tmp_path, "mcap", **WITHOUT_SHARED_MEMORY)
    first = feed(count=2000, environment=WITHOUT_SHARED_MEMORY)
    first.wait_for("begin")
    time.sleep(1.0)
    first.kill()
    second_ns = 100 * 10**9
    assert feed(count=100, first_ns=second_ns, environment=WITHOUT_SHARED_MEMORY).status() == 0
    assert recorder.end() == 0
    times = stored(bag)[IMU]
    assert times[-100:] == stamps(100, second_ns)
    assert times[:-100] == stamps(len(times) - 100)
    row = next(line.split() for line in recorder.output.splitlines() if "data_raw  " in line)
    assert row[3] == "1"  # one gap, between the two


def test_a_terminal_shows_a_live_line(feed, tmp_path, domains):
    terminal, stderr = os.openpty()
    command = [
        sys.executable,
        "-m",
        "imu_sim_ros.nodes.recorder.node",
        "-o",
        "bag",
        "--duration",
        "2s",
    ]
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(domains[0]),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "PYTHONPATH": str(Path(__file__).parents[3]),
    }
    recorder = subprocess.Popen(
        command, stderr=stderr, stdout=subprocess.DEVNULL, cwd=tmp_path, env=environment
    )
    os.close(stderr)
    feed(count=800)
    limit = threading.Timer(120.0, recorder.kill)
    limit.start()
    shown = b""
    with open(terminal, "rb", buffering=0) as screen, suppress(OSError):  # the end of a terminal
        while part := screen.read(4096):
            shown += part
    assert recorder.wait(30) == 0
    limit.cancel()
    lines = re.findall(
        r"([\d.]+) s  2 topics  (\d+) messages  \d+/s  [\d.]+ MB  0 gaps", str(shown)
    )
    assert len(lines) >= 3
    counts = [int(messages) for _, messages in lines]
    assert counts == sorted(counts)
    assert counts[-1] > 300
