# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An error of a library's interface, or of this package, is none of the file: never damage."""

from pathlib import Path

import numpy as np
import pytest

import imu_sim_ros.bags.reader
from imu_sim_ros.bags.reader import errors_naming, gather_messages
from imu_sim_ros.core.errors import InputError, MissingDependencyError


def without_name():
    return np.no_such_function


def without_argument():
    return int("1", no_such_argument=2)


def with_too_few():
    return Path.joinpath()


def of_another_class():
    return Path.no_such_method


@pytest.mark.parametrize("call", [without_name, without_argument, with_too_few, of_another_class])
def test_a_library_of_another_version_is_named(call):
    message = r"a\.mcap: not read, because a library"
    with pytest.raises(MissingDependencyError, match=message), errors_naming(Path("a.mcap")):
        call()


def with_a_wrong_name():
    return gather_messages(np.empty(0), no_such_argument=1)


def with_a_wrong_type():
    return gather_messages(3, None, None)


def of_a_class_of_the_package():
    return imu_sim_ros.bags.reader.Bag.no_such_method


def of_a_module_of_the_package():
    return imu_sim_ros.bags.reader.no_such_function


@pytest.mark.parametrize(
    "call",
    [
        with_a_wrong_name,
        with_a_wrong_type,
        of_a_class_of_the_package,
        of_a_module_of_the_package,
    ],
)
def test_a_defect_of_this_package_is_passed_on(call):
    with pytest.raises((TypeError, AttributeError)), errors_naming(Path("a.mcap")):
        call()


@pytest.mark.parametrize(
    "error", [ValueError("x"), TypeError("x"), AttributeError("x"), KeyError()]
)
def test_other_errors_are_those_of_the_bytes(error):
    with pytest.raises(InputError, match=r"a\.mcap: damaged"), errors_naming(Path("a.mcap")):
        raise error
