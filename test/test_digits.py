# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers with two digits of their uncertainty, by GUM 7.2.6 and the Particle Data Group."""

import pytest

from imu_sim_ros.core.digits import deviation_texts, interval_texts, plus_minus, upper_bound


@pytest.mark.parametrize(
    ("numbers", "texts"),
    [
        ((1.70523e-4, 1.6994e-4, 1.7091e-4), ("0.00017052", "0.00016994", "0.00017091")),
        ((1.908e-5, 1.39e-5, 2.208e-5), ("1.91e-05", "1.39e-05", "2.21e-05")),
        ((0.003002, 0.002826, 0.003121), ("0.00300", "0.00283", "0.00312")),
        ((5.472e-5, 0.0, 9.894e-5), ("5.5e-05", "0", "9.9e-05")),
        ((6.3e-5, 0.0, 9.99e-5), ("0.000063", "0", "0.000100")),  # no 10.0e-05
        ((12345.678, 12000.0, 12700.0), ("12350", "12000", "12700")),
        ((1.0, 0.9996, 1.1), ("1.0000", "0.9996", "1.1000")),  # an end near the value differs
        ((1.0, 1.0, 1.2), ("1.00", "1.00", "1.20")),
        ((1.23456e7, 1.2e7, 1.27e7), ("1.235e+07", "1.200e+07", "1.270e+07")),
        ((2.5, 2.5, 2.5), ("2.5", "2.5", "2.5")),
    ],
)
def test_an_interval_has_two_digits_of_its_half_width(numbers, texts):
    assert interval_texts(*numbers) == texts


def test_an_uncertainty_has_two_digits_and_its_value_the_same_place():
    assert plus_minus(-0.119122, 0.0018) == "-0.1191 \N{PLUS-MINUS SIGN} 0.0018"
    assert plus_minus(1.908e-5, 4.1e-6) == "(1.91 \N{PLUS-MINUS SIGN} 0.41)e-05"
    assert plus_minus(0.0, 0.01) == "0.000 \N{PLUS-MINUS SIGN} 0.010"
    assert plus_minus(3.3, 0.0996) == "3.30 \N{PLUS-MINUS SIGN} 0.10"  # 0.0996 rounds to 0.10
    assert plus_minus(0.25, 0.0) == "0.25"
    assert deviation_texts(2.1e-6, 6.00019e-5, 0.0) == ["0.21e-05", "6.00e-05", "0"]
    assert deviation_texts(0.0009, -0.119122) == ["0.00090", "-0.11912"]
    assert deviation_texts(0.0, 25.0) == ["", "25"]


def test_a_bound_is_rounded_up():
    bounds = {6.71e-5: "6.8e-05", 0.0012: "0.0012", 251.0: "260", 1.0: "1.0", 0.0: "0"}
    assert {high: upper_bound(high) for high in bounds} == {
        high: f"< {text}" for high, text in bounds.items()
    }
