# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers as text read back as the same numbers."""

import numpy as np
import pytest

from imu_sim_ros.bags.text import decimals


def _lines(x) -> list[str]:
    return decimals.table(decimals.floats(np.asarray(x)[:, None])).decode().splitlines()


@pytest.mark.parametrize(
    "make",
    [
        lambda rng: rng.standard_normal(20000),
        lambda rng: 10.0 ** rng.uniform(-300, 300, 20000),
        lambda rng: rng.integers(0, 2**63, 20000).astype(np.uint64).view(np.float64),
        lambda rng: -np.round(rng.standard_normal(20000) * 30, 3),
        lambda _: np.nextafter(10.0 ** np.arange(-300, 300), 0.0),
        lambda _: np.nextafter(10.0 ** np.arange(-300, 300), np.inf),
        lambda _: np.array([0.0, -0.0, 5e-324, np.inf, -np.inf, np.nan, 1.7976931348623157e308]),
    ],
)
def test_floats_read_back_bit_for_bit(make):
    x = make(np.random.default_rng(1))
    back = np.array([float(line) for line in _lines(x)])
    same = x.view(np.int64) == back.view(np.int64)
    assert np.all(same | (np.isnan(x) & np.isnan(back)))


def test_plain_numbers_look_plain():
    x = [0.0, 9.81, -0.1, 0.001, 100.0, 12345.678, 1e-5, 1e5, 1.5e22]
    assert _lines(x) == [
        "0.0",
        "9.81",
        "-0.1",
        "0.001",
        "100.0",
        "12345.678",
        "1.0e-5",
        "1.0e5",
        "1.5e22",
    ]


def test_integers_are_exact():
    values = np.array([0, 7, 10, 1_403_715_273_262_142_976, 2**63 - 1])
    assert decimals.table([decimals.integers(values)]).decode().split() == [
        str(value) for value in values.tolist()
    ]


def test_padded():
    rows = decimals.padded(np.array([0, 5_000_000, 999_999_999]), 9)
    assert [row.tobytes() for row in rows] == [b"000000000", b"005000000", b"999999999"]
