# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers as text read back as the same numbers."""

import sys

import numpy as np
import pytest

from imu_sim_ros.bags.text import decimals


def _lines(x) -> list[str]:
    return decimals.lines([np.asarray(x)[:, None]]).decode().splitlines()


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
    identical = x.view(np.int64) == back.view(np.int64)
    assert np.all(identical | (np.isnan(x) & np.isnan(back)))


def test_the_bytes_are_the_same_without_orjson(monkeypatch):
    """Numbers of all magnitudes are written alike; the two notations differ only below 1e-4."""
    pytest.importorskip("orjson")
    random = np.random.default_rng(3)
    powers = 10.0 ** np.concatenate([np.arange(-320, 308), np.repeat(np.arange(-9, 18), 30)])
    x = np.concatenate([powers, random.standard_normal(len(powers)) * powers, [-0.0, 5e-324]])
    t_ns = np.arange(len(x)) + 1_403_715_273_262_142_976
    text = decimals.lines([t_ns, x, np.stack([x, -x], axis=-1)])
    monkeypatch.setitem(sys.modules, "orjson", None)  # importing it raises an ImportError
    assert decimals.lines([t_ns, x, np.stack([x, -x], axis=-1)]) == text
    numbers = np.array([line.split(",")[1:] for line in text.decode().splitlines()], dtype=float)
    assert np.array_equal(numbers, np.stack([x, x, -x], axis=-1))


def test_plain_numbers_look_plain():
    x = [0.0, 9.81, -0.1, 0.001, 100.0, 12345.678, 1e5, 1.5e22]
    assert _lines(x) == [
        "0.0",
        "9.81",
        "-0.1",
        "0.001",
        "100.0",
        "12345.678",
        "100000.0",
        "1.5e+22",
    ]


def test_integers_are_exact():
    values = np.array([0, 7, 10, 1_403_715_273_262_142_976, 2**63 - 1])
    assert decimals.lines([values]).decode().split() == [str(value) for value in values.tolist()]


@pytest.mark.parametrize("count", [0, 1, 5000])
def test_digits_are_the_shortest_that_tell_a_number_from_its_neighbours(count):
    """The count of digits is that of Python's repr, which finds them by another algorithm."""
    x = np.random.default_rng(2).standard_normal(count) * 10.0
    assert _lines(x) == [repr(value) for value in x.tolist()]


def test_seconds_are_exact():
    t_ns = np.array([0, 5_000_000, 1_000_000_000, 1_403_715_273_262_142_976])
    assert decimals.seconds(t_ns) == [
        b"0.000000000",
        b"0.005000000",
        b"1.000000000",
        b"1403715273.262142976",
    ]


def test_columns_of_one_table():
    t_ns, names = np.array([1, 2]), np.array([b"cam0", b"cam1"])
    values = np.array([[0.5, -1.0], [np.nan, 2.0]])
    assert decimals.lines([t_ns, names, values]) == b"1,cam0,0.5,-1.0\n2,cam1,nan,2.0\n"
    assert decimals.lines([t_ns, values], " ") == b"1 0.5 -1.0\n2 nan 2.0\n"
