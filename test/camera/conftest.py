# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the tests of cameras share as a fixture."""

import pytest
from rigs import make_rig


@pytest.fixture(name="make_rig")
def make_rig_fixture():
    return make_rig
