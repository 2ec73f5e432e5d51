# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An error of a library's interface is none of the file: it is never called damaged."""

from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros.bags.reader import errors_naming
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
    words = r"a\.mcap: not read, because a library"
    with pytest.raises(MissingDependencyError, match=words), errors_naming(Path("a.mcap")):
        call()


@pytest.mark.parametrize(
    "error", [ValueError("x"), TypeError("x"), AttributeError("x"), KeyError()]
)
def test_other_errors_are_those_of_the_bytes(error):
    with pytest.raises(InputError, match=r"a\.mcap: damaged"), errors_naming(Path("a.mcap")):
        raise error
