# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nanoseconds of a second and more in a stamp are refused: in bags of each form, and live."""

import numpy as np
import pytest

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.blocks import as_list
from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY, ImuEncoder, OdometryEncoder
from imu_sim_ros.bags.read import read_imu, read_odometry
from imu_sim_ros.bags.writer import BagOptions
from imu_sim_ros.commands import convert_bag, dead_reckon
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.gate import stamp_ns
from imu_sim_ros.formats.door import read_states
from imu_sim_ros.nodes import messages as live
from imu_sim_ros.nodes.recorder.recording import _stamp_ns

COUNT, BAD = 400, 7
T_NS = 10**9 + 5_000_000 * np.arange(COUNT)
REASON = "nanosec = 1500000000 in the stamp: must be less than 1000000000"
PLACES = {"cdr": 8, "ros1": 8}
"""Offsets of the nanoseconds: behind the head of CDR and the seconds, or seq and the seconds."""


def overflowing(payload, encoding):
    place = PLACES[encoding]
    return payload[:place] + (1_500_000_000).to_bytes(4, "little") + payload[place + 4 :]


def rows(encoding):
    """Return readings and states of a body at rest, as bytes."""
    still, level = np.zeros((COUNT, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (COUNT, 1))
    readings = ImuEncoder("imu_link", encoding).encode(T_NS, still, np.add(still, (0.0, 0.0, 9.81)))
    odometry = OdometryEncoder("world", "base_link", encoding)
    return as_list(readings), as_list(odometry.encode(T_NS, still, level, still, still))


@pytest.mark.parametrize(
    ("name", "storage"), [("a.mcap", None), ("a.bag", None), ("a", "sqlite3"), ("b", "mcap")]
)
def test_a_bag_with_such_a_stamp_is_refused_or_its_message_is_left_out(
    tmp_path, capsys, name, storage
):
    path = tmp_path / name
    with open_writer(path, BagOptions(storage)) as writer:
        topics = (("/imu/data_raw", IMU), ("/ground_truth/odom", ODOMETRY))
        for (topic, kind), payloads in zip(topics, rows(writer.encoding), strict=True):
            payloads[BAD] = overflowing(payloads[BAD], writer.encoding)
            writer.write(writer.add_topic(topic, kind), T_NS, payloads)
    for read_function in (read_imu, read_odometry, read_states):
        with pytest.raises(InputError, match=f"message {BAD}: .*{REASON}"):
            read_function(path)
    for read_function in (read_imu, read_odometry):
        skipped = []
        assert len(read_function(path, skipped=skipped.append).t_ns) == COUNT - 1
        assert skipped == [1]
    assert dead_reckon.main([str(path), "--quiet"]) == 2
    assert REASON in capsys.readouterr().err
    convert_arguments = ["-o", str(tmp_path / "out.mcap"), "--skip-bad-rows"]
    assert convert_bag.main([str(path), *convert_arguments]) == 0
    assert len(read_imu(tmp_path / "out.mcap").t_ns) == COUNT - 1


def test_a_live_message_with_such_a_stamp_is_refused():
    readings, states = (overflowing(payloads[BAD], "cdr") for payloads in rows("cdr"))
    for decode, payload in (
        (live.imu_reading, readings),
        (live.ReadingDecoder(oriented=True).reading, readings),
        (live.truth, states),
    ):
        with pytest.raises(InputError, match=REASON):
            decode(payload)
    # The recorder keeps the message, and takes the time of its reception.
    assert _stamp_ns(readings, 4) is None
    assert _stamp_ns(rows("cdr")[0][BAD], 4) == T_NS[BAD]


def test_the_largest_nanoseconds_pass():
    assert stamp_ns(2, 999_999_999) == 2_999_999_999
    with pytest.raises(InputError, match="nanosec = 1000000000"):
        stamp_ns(2, 1_000_000_000)
