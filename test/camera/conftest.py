# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fixtures of the camera tests."""

import pytest
from rigs import make_rig


@pytest.fixture(name="make_rig")
def make_rig_fixture():
    return make_rig
