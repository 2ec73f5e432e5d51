# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Configuration of imu_utils and of allan_variance_ros (src/AllanVarianceComputor.cpp)."""

import math
from typing import Final

import numpy as np

from imu_sim_ros.bags.text.decimals import decimal
from imu_sim_ros.datasets.consumers.subject import Subject
from imu_sim_ros.datasets.consumers.values import ImuValues, comment, number_notes

_UNITS: Final = {"gyroscope": " rad/s", "accelerometer": " m/s^2"}
"""The string that imu_utils writes as the unit, with its leading blank, for both _n and _w."""
_NAMES: Final = {"gyroscope": ("Gyr", "gyr"), "accelerometer": ("Acc", "acc")}
_AXES: Final = ("avg-axis", "x-axis", "y-axis", "z-axis")


def files(subject: Subject) -> dict[str, str]:
    """Return the result of imu_utils and the configuration of allan_variance_ros."""
    return {
        "imu_utils.yaml": result(subject.imu),
        "allan_variance_ros.yaml": config(subject.imu),
    }


def result(values: ImuValues) -> str:
    """Return the expected result of imu_utils for these readings."""
    head = comment(
        [
            "What imu_utils finds in these data, in the form of its result: _n is the noise of one "
            f"sample at {values.rate:g} Hz, density * sqrt(rate); _w is the lowest point of the "
            "Allan deviation (the bias instability), not a random walk.",
            "A single axis' _w varies by 15 % and more between records of 4 h.",
            *number_notes(
                values,
                ("gyroscope_bias_instability", "accelerometer_bias_instability"),
                per_axis=True,
            ),
        ]
    )
    root = math.sqrt(values.rate)
    lines = [f"%YAML:1.0\n---\n{head}type: IMU\nname: imu_sim_ros\n"]
    for triad, unit in _UNITS.items():
        section, short = _NAMES[triad]
        white = values.axes(f"{triad}_noise_density") * root
        table = np.stack([white, values.lowest_deviation(triad)], axis=1)
        lines.append(f'{section}:\n   unit: "{unit}"\n')
        # The average is that of the axes, as imu_utils takes it.
        for axis, pair in zip(_AXES, [table.mean(axis=0), *table], strict=True):
            lines.append(
                f"   {axis}:\n      {short}_n: {pair[0]:.16e}\n      {short}_w: {pair[1]:.16e}\n"
            )
    return "".join(lines)


_LONGEST = 2**31 - 1  # an int in allan_variance_ros; a shorter record is read to its end


def config(values: ImuValues) -> str:
    """Return a configuration of allan_variance_ros that reads every sample of the record.

    ``imu_rate`` is a double, ``measure_rate`` and ``sequence_time`` are integers in its source; it
    takes one sample out of ``int(imu_rate / measure_rate)``.
    """
    head = comment(
        [
            "allan_variance_ros config.yaml, whole. It cannot express noise, which the program "
            "finds. Its gyroscope random walk comes out about twice too high (a line through all "
            "averaging times), its accelerometer random walk about 15 %; it needs at least 3 h."
        ]
    )
    length = math.ceil(values.duration) if values.duration else _LONGEST
    return (
        f'{head}imu_topic: "{values.topic}"\nimu_rate: {decimal(values.rate)}\n'
        f"measure_rate: {max(1, math.floor(values.rate))}\nsequence_time: {length}\n"
    )
