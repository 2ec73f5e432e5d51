# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The gate of readings, poses and their stamps."""

import numpy as np
import pytest

from imu_sim_ros.core import gate
from imu_sim_ros.core.errors import InputError

BAD_NUMBERS = (np.nan, np.inf, -np.inf, 1e160, -1e308)
BAD_STAMPS = (2**63 - 1, -(2**63), 2**31 * 10**9, -(2**31) * 10**9 - 1)
BAD_QUATERNIONS = ((0, 0, 0, 0), (2, 0, 0, 0), (1e300, 0, 0, 0), (np.nan, 0, 0, 1), (0.94, 0, 0, 0))


def readings(n=5):
    rng = np.random.default_rng(1)
    return np.arange(n) * 5_000_000, rng.normal(size=(n, 3)), rng.normal(size=(n, 3))


def poses(n=5):
    q_wb = np.random.default_rng(2).normal(size=(n, 4))
    q_wb /= np.linalg.norm(q_wb, axis=1, keepdims=True)
    return np.arange(n) * 5_000_000, np.arange(3.0 * n).reshape(n, 3), q_wb


SPOILT = [
    *((readings, column, value) for column in (1, 2) for value in BAD_NUMBERS),
    *((poses, 1, value) for value in BAD_NUMBERS),
    *((poses, 2, value) for value in BAD_QUATERNIONS),
    *((make, 0, value) for make in (readings, poses) for value in BAD_STAMPS),
]


@pytest.mark.parametrize(("make", "column", "value"), SPOILT)
def test_a_bad_row_is_refused_and_the_others_pass(make, column, value):
    columns = make()
    columns[column][3] = columns[column][3] * 0 + np.asarray(value).astype(columns[column].dtype)

    verdict = getattr(gate, make.__name__)(*columns)

    assert verdict.good.tolist() == [True, True, True, False, True]
    assert verdict.bad.tolist() == [3]
    assert any(
        reason in verdict.why(3)
        for reason in ("a value that is not finite", "at most", "of length", "outside the years")
    )


@pytest.mark.parametrize(("make", "column", "value"), SPOILT)
def test_one_row_in_plain_floats_has_the_same_verdict(make, column, value):
    columns = make()
    columns[column][3] = columns[column][3] * 0 + np.asarray(value).astype(columns[column].dtype)
    is_good = gate.is_reading if make is readings else gate.is_pose

    verdicts = [is_good(*(column[k].tolist() for column in columns)) for k in range(5)]

    assert verdicts == [True, True, True, False, True]


def test_the_limits_themselves_pass():
    t_ns = np.array([gate.FIRST_STAMP, gate.LAST_STAMP])
    rate, force = np.full((2, 3), gate.RATE.largest), np.full((2, 3), -gate.FORCE.largest)
    positions, quaternions = (
        np.full((2, 3), gate.POSITION.largest),
        np.array([[0, 0.951, 0, 0], [0, 0, 0, 1.049]]),
    )

    assert gate.readings(t_ns, rate, force).good.all()
    assert gate.poses(t_ns, positions, quaternions).good.all()
    assert not gate.readings(t_ns, np.nextafter(rate, np.inf), force).good.any()


def test_arrays_without_rows_pass():
    assert len(gate.readings(*readings(0)).good) == 0
    gate.poses(*poses(0)).complain("nothing")


def test_the_report_names_source_row_stamp_value_and_the_count_of_the_rest():
    t_ns, gyro, accel = readings(40)
    gyro[7, 1] = np.nan
    accel[9:31, 2] = 1e300

    with pytest.raises(InputError) as caught:
        gate.readings(t_ns, gyro, accel).complain("flight.bag: /imu")

    gyro_line, accel_line, *_, count_line = caught.value.problems
    assert gyro_line == (
        "flight.bag: /imu: number 7: stamp 0.035000000 s: a value that is not finite: "
        f"angular velocity [{gyro[7, 0]:.6g}, nan, {gyro[7, 2]:.6g}]"
    )
    assert accel_line.startswith(
        "flight.bag: /imu: number 9: stamp 0.045000000 s: linear acceleration"
    )
    assert accel_line.endswith("1e+300]: at most 1e+07 m/s^2 is possible")
    assert count_line == "flight.bag: /imu: and 13 more such numbers"


def test_a_negative_stamp_is_said_as_it_is():
    assert gate.stamp_text(-1_500_000_000) == "stamp -1.500000000 s"


def test_a_row_that_passes_has_no_reason():
    with pytest.raises(ValueError, match="row 1 may pass"):
        gate.readings(*readings()).why(1)
