# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The first sample waits until no further subscriber comes."""

import pytest

from imu_sim_ros.nodes.simulator.pacing import Settling

pytestmark = pytest.mark.ros


def test_each_further_subscription_begins_the_wait_again():
    settling = Settling()
    assert not settling.has_settled([1, 0, 0], 10.0)
    assert not settling.has_settled([1, 0, 0], 10.2)
    assert not settling.has_settled([1, 1, 0], 10.25)  # a recorder takes its second topic
    # 0.5 s after the first, 0.25 s after the second.
    assert not settling.has_settled([1, 1, 0], 10.5)
    assert not settling.has_settled([1, 1, 1], 10.54)
    assert not settling.has_settled([1, 1, 1], 10.8)
    assert settling.has_settled([1, 1, 1], 10.85)
