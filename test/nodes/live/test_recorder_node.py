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
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from mcap.reader import make_reader
from programs import PATIENCE, program
from rosbags.highlevel import AnyReader

from imu_sim_ros.commands import convert_bag

pytestmark = pytest.mark.ros

PERIOD_NS = 5_000_000
IMU, TRUTH = "/imu/data_raw", "/ground_truth/odom"
FORMS = {"mcap": "bag", "sqlite3": "bag", "ros1": "bag.bag", "file": "bag.mcap"}


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


def rows(recorder) -> dict[str, list[str]]:
    """Return the cells behind each topic of the table that a recorder prints at its end."""
    lines = [line.split() for line in recorder.output.splitlines()]
    return {line[0]: line[1:] for line in lines if len(line) == 7 and line[0].startswith("/")}


def test_everything_published_is_in_every_bag_and_losses_are_reported(node, feed, tmp_path):
    """Under its own stamp or, on request, under the time of its reception."""
    start_ns = time.time_ns()
    started = {}
    for name, form, *arguments in (
        ("zstd", "file", "--compression", "zstd"),
        ("bz2", "ros1", "--compression", "bz2"),
        ("split_mcap", "mcap", "--split-duration", "0.5"),
        ("split_sqlite3", "sqlite3", "--split-duration", "0.5"),
        ("received", "ros1", "--record-time", "reception"),
    ):
        (tmp_path / name).mkdir()
        started[name] = record(node, tmp_path / name, form, *arguments)
    feed(count=220, skip=[60, 150, 151], repeat=[20], wait=len(started)).finish()
    for recorder, _ in started.values():
        recorder.send(signal.SIGINT)
    for recorder, _ in started.values():
        assert recorder.status() == 0, recorder.output
    expected = sorted({*stamps(220)} - {stamps(220)[k] for k in (60, 150, 151)})
    expected.insert(20, expected[20])
    # The clock ticks every 5 ms, whatever is lost: 200 Hz.
    cells = ["218", "200.00", "2", "3", "1", "0"]
    for name, (recorder, bag) in started.items():
        assert rows(recorder).keys() == {IMU, TRUTH}
        if name == "received":
            imu_messages = [m for m in messages(bag) if m[0] == IMU]
            times = [t_ns for _, t_ns, _, _ in imu_messages]
            assert start_ns < times[0] <= times[-1] < time.time_ns()
            assert times == sorted(times)
            in_them = [struct.unpack_from("<iI", raw, 4) for _, _, raw, _ in imu_messages]
            assert [s * 10**9 + ns for s, ns in in_them] == expected
            # Gaps are those of the stamps all the same.
            assert [row[2:] for row in rows(recorder).values()] == [cells[2:]] * 2
        else:
            assert stored(bag) == {IMU: expected, TRUTH: expected}, name
            assert [*rows(recorder).values()] == [cells] * 2
        if name.startswith("split"):
            files = [f"bag_{k}.{'mcap' if 'mcap' in name else 'db3'}" for k in range(3)]
            assert sorted(file.name for file in bag.iterdir()) == [*files, "metadata.yaml"]


def test_latched_messages_from_before_the_recorder_are_recorded(node, feed, tmp_path):
    source = feed(count=20, topics=["imu"], latched=True, wait=0, hold=PATIENCE)
    source.wait_until_all_is_published()
    recorder, bag = record(node, tmp_path, "mcap")
    recorder.wait_for("recording /imu/data_raw")
    last_stamp = struct.pack("<iI", *divmod(stamps(20)[-1], 10**9))
    recorder.wait_until(
        lambda: any(last_stamp in path.read_bytes() for path in tmp_path.rglob("*.mcap*"))
    )
    assert recorder.end() == 0
    assert stored(bag)[IMU] == stamps(20)


def test_it_waits_for_publishers_and_takes_topics_that_appear_later_with_their_qos(
    node, feed, tmp_path
):
    recorder, bag = record(node, tmp_path, "mcap")
    recorder.wait_for("waiting for a publisher of any topic")
    feed(count=50, topics=["imu"], best_effort=True).finish()
    feed(count=20, topics=["truth"], latched=True).finish()
    assert recorder.end() == 0
    assert stored(bag) == {IMU: stamps(50), TRUTH: stamps(20)}
    assert rows(recorder)[IMU] == ["50", "200.00", "0", "0", "0", "0"]
    metadata = (bag / "metadata.yaml").read_text()
    imu, truth = (metadata.partition(f"name: {topic}\n")[2] for topic in (IMU, TRUTH))
    for part, reliability, durability in (
        (imu, "best_effort", "volatile"),
        (truth, "reliable", "transient_local"),
    ):
        assert re.search(r"reliability: (\w+)", part)[1] == reliability
        assert re.search(r"durability: (\w+)", part)[1] == durability


def test_requested_topics_that_never_come_are_reported_once_and_at_the_end(node, feed, tmp_path):
    """A topic without a publisher, and a topic whose publisher sends nothing."""
    feed(topics=["plain"], wait=2)  # sends nothing: it waits for a second subscriber
    recorder, _ = record(node, tmp_path, "mcap", "imu/data_raw", "nosuch", "plain", "nosuch")
    feed(count=20, topics=["imu"]).finish()
    recorder.wait_for("waiting for a publisher of /nosuch\n")
    recorder.wait_for("recording /plain")
    assert recorder.end() == 0
    assert rows(recorder)[IMU][0] == "20"
    # A slow machine may not have seen the silent publisher after 3 s.
    warned = re.findall(
        r"waiting for a (?:message|publisher) of (/plain|/nosuch)\n", recorder.output
    )
    assert warned == ["/nosuch", "/plain"]
    endings = [line for line in recorder.output.splitlines() if line.startswith("recorder: ")]
    assert endings == [
        "recorder: /nosuch was not recorded: it had no publisher",
        "recorder: /plain was not recorded: its publisher sent no message",
    ]


def test_messages_of_another_type_are_left_out_counted_and_reported(node, feed, tmp_path):
    recorder, bag = record(node, tmp_path, "mcap")
    feed(count=20, topics=["imu"]).finish()
    feed(count=30, topics=["number"]).finish()
    feed(count=20, topics=["imu"], first_ns=2 * 10**9).finish()
    assert recorder.end() == 0
    assert stored(bag) == {IMU: stamps(20) + stamps(20, 2 * 10**9)}
    recorded_type, other_type = "sensor_msgs/msg/Imu", "std_msgs/msg/Float64"
    assert (
        recorder.output.count(f"messages of a publisher with type {other_type} are left out") == 1
    )
    assert (
        f"recorder: {IMU}: 30 messages of type {other_type} left out: "
        f"it was recorded as {recorded_type}\n"
    ) in recorder.output


def test_messages_without_a_stamp_get_the_time_of_their_reception(node, feed, tmp_path):
    """Types without a header and headers whose stamp is zero are recorded alike."""
    start_ns = time.time_ns()
    recorder, bag = record(node, tmp_path, "ros1")
    feed(count=20, topics=["plain", "imu"], unstamped=True).finish()
    assert recorder.end() == 0
    times = {"/plain": [], IMU: []}
    for topic, t_ns, _, _ in messages(bag):
        times[topic].append(t_ns)
    for reception_times in times.values():
        assert len(reception_times) == 20
        assert start_ns < reception_times[0] <= reception_times[-1] < time.time_ns()
    assert rows(recorder)[IMU][2:] == ["-"] * 4  # times of reception tell nothing of the source


def test_it_ends_by_itself_at_the_size(node, feed, tmp_path):
    recorder, bag = record(node, tmp_path, "sqlite3", "--max-size", "0.1")
    feed(count=2000)
    assert recorder.status() == 0
    assert sum(file.stat().st_size for file in bag.iterdir()) >= 0.1e6
    assert 90 <= len(stored(bag)[IMU]) < 2000


def test_an_existing_output_and_bad_arguments_are_refused(refused, tmp_path):
    calls = {
        f"recorder: {tmp_path / 'bag'}: already exists; nothing is overwritten": [
            *("-o", str(tmp_path / "bag"))
        ],
        f"recorder: {tmp_path / 'bag.bag'}: already exists; nothing is overwritten": [
            *("-o", str(tmp_path / "bag.bag"))
        ],
        "recorder: --duration: 'soon' is not a duration such as 20s": ["--duration", "soon"],
        "recorder: /proc/nosuch": ["-o", "/proc/nosuch/bag"],
    }
    for name in ("bag", "bag.bag"):
        (tmp_path / name).write_text("precious")
    for beginning, (line,) in zip(calls, refused("recorder", [*calls.values()]), strict=True):
        assert line.startswith(beginning)
    for name in ("bag", "bag.bag"):
        assert (tmp_path / name).read_text() == "precious"


def test_kill_costs_at_most_the_last_second(node, feed, tmp_path, without_shared_memory):
    started = {}
    for form in FORMS:
        (tmp_path / form).mkdir()
        started[form] = record(node, tmp_path / form, form)
    feed(count=2000, wait=len(started)).wait_until_it_begins()
    time.sleep(2.5)
    for recorder, _ in started.values():
        recorder.send(signal.SIGKILL)
        recorder.status()
    for form, (_, bag) in started.items():
        recovered = tmp_path / ("recovered.bag" if form == "ros1" else f"recovered_{form}")
        unfinished = bag if bag.exists() else bag.with_name(bag.name + ".active")
        recover_arguments = [str(unfinished), "--recover", "-o", str(recovered), "--quiet"]
        assert convert_bag.main(recover_arguments) == 0
        topic_times = stored(recovered)
        assert topic_times.keys() == {IMU, TRUTH}
        for topic, times in topic_times.items():
            assert times == stamps(len(times)), topic
            # 2.5 s had been published by then, and the last second of it may be lost.
            assert len(times) >= (2.5 - 1.0) * 200, (form, topic)


@pytest.mark.parametrize("form", ["mcap", "sqlite3", "ros1"])
def test_a_full_disk_is_reported_and_what_was_written_is_kept(
    node, feed, tmp_path, form, without_shared_memory
):
    limit = 400_000

    def small_disk() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    recorder, _ = record(node, tmp_path, form, preparation=small_disk)
    feed(count=3000)
    assert recorder.status() == 1
    assert "recorder: " in recorder.output
    assert "keeps the messages written before" in recorder.output
    assert "Traceback" not in recorder.output
    files = [file for file in tmp_path.rglob("bag*") if file.is_file()]
    assert sum(file.stat().st_size for file in files) > 0.5 * limit


@pytest.mark.parametrize("form", ["mcap", "sqlite3", "file"])
def test_a_vanished_bag_is_noticed(node, feed, tmp_path, form):
    recorder, bag = record(node, tmp_path, form)
    feed(count=2000).wait_until_it_begins()
    time.sleep(1.0)
    if bag.is_dir():
        shutil.rmtree(bag)
    else:
        bag.with_name(bag.name + ".active").unlink()
    assert recorder.status() == 1
    assert form == "sqlite3" or "another program has deleted it" in recorder.output
    assert "was removed and is lost" in recorder.output
    assert "keeps the messages written" not in recorder.output


def test_a_driver_that_is_killed_and_started_again_is_recorded_on(
    node, feed, feed_apart, tmp_path, without_shared_memory
):
    recorder, bag = record(node, tmp_path, "mcap")
    killed_feed = feed_apart(count=2000)
    killed_feed.wait_for("begin")
    time.sleep(1.0)
    killed_feed.kill()
    second_ns = 100 * 10**9
    feed(count=100, first_ns=second_ns).finish()
    assert recorder.end() == 0
    times = stored(bag)[IMU]
    assert times[-100:] == stamps(100, second_ns)
    assert times[:-100] == stamps(len(times) - 100)
    assert rows(recorder)[IMU][2] == "1"  # one gap, between the two


def test_a_terminal_shows_a_live_line_until_the_duration_ends_it(feed, tmp_path, domains):
    terminal, stderr = os.openpty()
    command = [*program("recorder"), "-o", "bag", "--duration", "2s"]
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
    feed(count=1200)
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
    # Ends in a machine's good time, but not before two seconds of 200 Hz.
    assert 395 <= len(stored(tmp_path / "bag")[IMU]) < 1200
