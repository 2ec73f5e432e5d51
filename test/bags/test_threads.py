# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Chunks made in threads: in order, whole, and the same bytes as without threads."""

import threading

import numpy as np
import pytest

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.blocks import interleave
from imu_sim_ros.bags.messages.encode import IMU, ImuEncoder
from imu_sim_ros.bags.read import read_imu
from imu_sim_ros.bags.threads import Pipeline, thread_pool
from imu_sim_ros.bags.writer import BagOptions
from imu_sim_ros.terminal.progress import Watcher, watch

COUNT = 12_000  # four chunks


@pytest.mark.parametrize("workers", [1, 3])
def test_results_are_used_in_the_order_of_the_items(workers):
    used = []
    second_ready = threading.Event()

    def make(k):
        if workers > 1 and k == 0:  # the first result is ready after the second
            second_ready.wait()
        second_ready.set() if k == 1 else None
        return k

    pipeline = Pipeline(make, lambda item, product: used.append((item, product)), workers)
    for k in range(50):
        pipeline.give(k)
    pipeline.wait()
    assert used == [(k, k) for k in range(50)]
    pipeline.close()
    assert pipeline.error is None


@pytest.mark.parametrize("failing", ["make", "use"])
def test_nothing_is_used_after_an_error_which_is_raised_at_the_next_item(failing):
    used = []

    def make(k):
        if failing == "make" and k == 3:
            raise OSError("made")
        return k

    def use(_, k):
        if failing == "use" and k == 3:
            raise OSError("used")
        used.append(k)

    def give_all():
        for k in range(50):
            pipeline.give(k)

    pipeline = Pipeline(make, use, 2)
    with pytest.raises(OSError, match="made|used"):
        give_all()
    with pytest.raises(OSError, match="made|used"):
        pipeline.wait()
    pipeline.close()
    assert used == [0, 1, 2]


def _messages(encoding):
    gyro, accel = np.random.default_rng(3).standard_normal((2, COUNT, 3))
    t_ns = 10**9 + 5_000_000 * np.arange(COUNT)
    return t_ns, gyro, ImuEncoder("imu_link", encoding).pattern(t_ns, gyro, accel)


@pytest.mark.parametrize(
    ("name", "compression"), [("x.mcap", "none"), ("x.mcap", "zstd"), ("x.bag", "bz2")]
)
def test_what_is_interrupted_keeps_all_chunks_that_were_handed_over(tmp_path, name, compression):
    path = tmp_path / name
    writer = open_writer(path, BagOptions(compression=compression))
    topic = writer.add_topic("/imu", IMU)
    t_ns, gyro, messages = _messages(writer.encoding)

    def write_and_stop():
        with writer:
            writer.write(topic, t_ns, messages)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_and_stop()
    assert topic.count == COUNT
    readings = read_imu(path)
    assert np.array_equal(readings.t_ns, t_ns)
    assert np.array_equal(readings.gyro, gyro)


def test_a_topic_that_comes_late_stands_behind_the_chunks_before_it(tmp_path):
    path = tmp_path / "x.mcap"
    with open_writer(path, BagOptions(compression="lz4")) as writer:
        t_ns, gyro, messages = _messages(writer.encoding)
        writer.write(writer.add_topic("/a", IMU), t_ns, messages)
        writer.write(writer.add_topic("/b", IMU), t_ns, messages)
    assert np.array_equal(read_imu(path, topic="/b").gyro, gyro)
    assert len(read_imu(path, topic="/a").t_ns) == COUNT


@pytest.mark.parametrize("name", ["x.mcap", "x.bag"])
def test_patterns_arrays_and_lists_make_the_same_file(tmp_path, name):
    contents = []
    for form in ("pattern", "array", "threads"):
        path = tmp_path / form / name
        with open_writer(path) as writer:
            topic = writer.add_topic("/imu", IMU)
            t_ns, _, messages = _messages(writer.encoding)
            batch = interleave([messages]) if form == "array" else messages
            if form == "threads":
                writer.write(topic, t_ns, batch)
            else:  # chunk by chunk, each written where it is flushed
                for start in range(0, COUNT, COUNT // 4):
                    part = slice(start, start + COUNT // 4)
                    writer.write(topic, t_ns[part], batch[part])
                    writer.flush()
        contents.append(path.read_bytes())
    assert contents[0] == contents[1] == contents[2]


def test_an_interrupted_job_does_not_wait_for_its_threads():
    """A compiler cannot be interrupted: the first Ctrl-C waited for it."""
    release, jobs = threading.Event(), []

    def interrupted_work():
        with thread_pool(1) as pool:
            jobs.extend(pool.submit(release.wait, 60) for _ in range(2))
            raise KeyboardInterrupt

    with watch(Watcher(interrupted=lambda: True)), pytest.raises(KeyboardInterrupt):
        interrupted_work()
    assert not jobs[0].done()
    assert jobs[1].cancelled()
    release.set()
