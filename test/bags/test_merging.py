# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records of several rates in the order of time."""

import numpy as np
import pytest
from mcap.reader import make_reader

from imu_sim_ros.bags.mcap_writer import McapWriter
from imu_sim_ros.bags.writer import Block

RNG = np.random.default_rng(3)


def times(rate, offset_ns, jitter_ns, seconds=40):
    t_ns = np.rint(np.arange(seconds * rate) * 1e9 / rate).astype(np.int64) + offset_ns
    return np.sort(t_ns + RNG.integers(0, jitter_ns + 1, len(t_ns)))


# (rate, latency [ns], jitter [ns], size) of each topic.
CASES = {
    "wheels": [(200, 0, 0, 350), (200, 0, 0, 700), (50, 0, 0, 40), (50, 0, 0, 7)],
    "three rates": [(200, 0, 0, 350), (10, 0, 0, 90), (50, 0, 0, 40)],
    "no multiple": [(200, 0, 0, 350), (15, 0, 0, 90)],
    "late": [(200, 3_000_000, 0, 350), (200, 0, 0, 700), (10, 150_000_000, 0, 90)],
    "slow": [(200, 0, 0, 350), (1, 0, 0, 90)],
    "jitter": [(200, 0, 0, 350), (50, 0, 9_000_000, 90)],
    "one message": [(200, 0, 0, 350), (0.025, 0, 0, 90)],
}


@pytest.mark.parametrize("name", CASES)
def test_messages_are_in_the_order_of_time_and_whole(name, tmp_path):
    """Each of two emissions is sorted by time, then by topic; the index and the file agree."""
    rows, expected = CASES[name], []
    with McapWriter(tmp_path / "a.mcap") as writer:
        topics = [writer.add_topic(f"/t{k}", "sensor_msgs/msg/Imu") for k in range(len(rows))]
        whole = [times(*row[:3]) for row in rows]
        for late in (False, True):
            blocks = []
            for topic, t_ns, (*_, size) in zip(topics, whole, rows, strict=True):
                stamps = t_ns[(t_ns >= 17_313_000_000) == late]
                blocks.append(
                    Block(topic, stamps, RNG.integers(0, 256, (len(stamps), size), np.uint8))
                )
            flat = [(int(t), b.topic.name, bytes(row)) for b in blocks
                    for t, row in zip(b.t_ns, b.payloads, strict=True)]  # fmt: skip
            expected += sorted(flat, key=lambda entry: entry[0])
            writer.write_blocks(blocks)
            writer.flush()
    with (tmp_path / "a.mcap").open("rb") as file:
        records = list(make_reader(file, validate_crcs=True).iter_messages(log_time_order=False))
    assert [(m.log_time, c.topic, m.data) for _, c, m in records] == expected
    counts = {topic.name: 0 for topic in topics}
    for _, channel, message in records:
        assert message.sequence == counts[channel.topic]
        counts[channel.topic] += 1
    with (tmp_path / "a.mcap").open("rb") as file:  # by the index
        payloads = [m.data for _, _, m in make_reader(file).iter_messages(topics=["/t1"])]
    assert payloads == [data for _, topic, data in expected if topic == "/t1"]
