# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records of readings: repetitions."""

import numpy as np

from imu_sim_ros.calibration.record import Record
from imu_sim_ros.core.records import Readings


def test_a_block_of_nothing_but_repetitions():
    stamps_ns = [10**9 + k * 10**7 for k in range(20)]
    stamps = [stamps_ns, [stamps_ns[-1]] * 5, [stamps_ns[-1] + 10**7]]
    blocks = [Readings(np.array(t_ns), *np.ones((2, len(t_ns), 3))) for t_ns in stamps]
    record = Record()
    pieces = [piece for piece in record.at_rest([blocks]) if piece is not None]
    assert record.samples == len(np.concatenate(pieces)) == 21
    assert record.timing().duplicates == 5
