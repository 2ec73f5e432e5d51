# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""No input, however hostile, gives a traceback, a hang or a changed file."""

import importlib.util
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

specification = importlib.util.spec_from_file_location(
    "hostile", Path(__file__).with_name("hostile.py")
)
hostile = importlib.util.module_from_spec(specification)
sys.modules["hostile"] = hostile
specification.loader.exec_module(hostile)

EXAMPLES = 80
"""Always the same ones; ten or twenty seconds."""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    made = hostile.Inputs(tmp_path_factory.mktemp("inputs"))
    yield made
    made.close()


@settings(
    max_examples=EXAMPLES,
    derandomize=True,
    deadline=None,
    database=None,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)
@given(number=st.integers(0, 10**6))
def test_hostile_inputs(inputs, number):
    outcome = hostile.run(number, inputs)
    # Memory counts for the whole process, in which other tests have run: make fuzz judges it.
    assert not set(outcome.faults) - {"memory"}, outcome
    assert "unexpected:" not in outcome.error, outcome
