# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records of readings: repetitions."""

import numpy as np

from imu_sim_ros.calibration.record import Record


def _taken(record, t_ns):
    values = np.ones((len(t_ns), 3))
    return list(record.add(np.array(t_ns, dtype=np.int64), values, values))


def test_a_block_of_nothing_but_repetitions():
    record = Record()
    stamps = [10**9 + k * 10**7 for k in range(20)]
    _taken(record, stamps)
    assert _taken(record, [stamps[-1]] * 5) == []
    assert record.samples == 20
    _taken(record, [stamps[-1] + 10**7])
    assert record.samples == 21
