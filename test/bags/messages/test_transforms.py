# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""TFMessage as bytes: what rosbags makes of them, and the same bytes as it writes."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from imu_sim_ros.bags.messages.transforms import TransformsEncoder
from imu_sim_ros.core.errors import InputError

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPE = TransformsEncoder.type_name


@pytest.mark.parametrize(
    "frames",
    [[], [("world", "base_link")], [("b", "imu"), ("b", "cam0_link"), ("body", "c")]],
    ids=len,
)
def test_transforms_are_read_and_written_alike_by_rosbags(frames):
    rng = np.random.default_rng(3)
    n, m = 4, len(frames)
    t_ns = np.arange(n) * 1_234_567_891
    translation, q = rng.normal(size=(n, m, 3)), rng.normal(size=(n, m, 4))
    rows = TransformsEncoder(frames).encode(t_ns, translation, q)
    for k in range(n):
        message = STORE.deserialize_cdr(rows[k].tobytes(), TYPE)
        assert len(message.transforms) == m
        for j, transform in enumerate(message.transforms):
            stamp = transform.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == t_ns[k]
            assert (transform.header.frame_id, transform.child_frame_id) == frames[j]
            p, r = transform.transform.translation, transform.transform.rotation
            assert (p.x, p.y, p.z) == tuple(translation[k, j])
            assert (r.w, r.x, r.y, r.z) == tuple(q[k, j])
        assert bytes(STORE.serialize_cdr(message, TYPE)) == rows[k].tobytes()


def test_a_stamp_that_no_message_holds_is_refused():
    with pytest.raises(InputError, match="a message holds 0 to 2147483647 s"):
        TransformsEncoder([("a", "b")]).encode([-1], np.zeros((1, 1, 3)), np.zeros((1, 1, 4)))
