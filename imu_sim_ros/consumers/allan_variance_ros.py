# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""allan_variance_ros: its ``config.yaml`` (src/AllanVarianceComputor.cpp)."""

import math

from imu_sim_ros.bags.text import decimal
from imu_sim_ros.consumers.values import ImuValues, comment

_LONGEST = 2**31 - 1  # the length is an int there; a record that ends before it is read to its end


def config(values: ImuValues) -> str:
    """Return the configuration that reads the whole record, every sample of it.

    ``imu_rate`` is a double, ``measure_rate`` and ``sequence_time`` are integers there; it takes
    one sample out of ``int(imu_rate / measure_rate)``.
    """
    head = comment(
        [
            "allan_variance_ros config.yaml, whole. It cannot express noise, which the program "
            "finds. Its gyroscope random walk comes out about twice too high (a line through all "
            "averaging times), its accelerometer random walk about 15 %; it wants 3 h and more."
        ]
    )
    length = math.ceil(values.duration) if values.duration else _LONGEST
    return (
        f'{head}imu_topic: "{values.topic}"\nimu_rate: {decimal(values.rate)}\n'
        f"measure_rate: {max(1, math.floor(values.rate))}\nsequence_time: {length}\n"
    )
