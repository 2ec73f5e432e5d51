# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Invariants of every trajectory of config/trajectories, and of every wrapper around one."""

import subprocess
import sys

import numpy as np
import pytest

from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import build as build_section
from imu_sim_ros.trajectory.parameters import TYPES

from .conftest import build

NAMES = files.names("trajectories")


@pytest.fixture(scope="module", params=NAMES)
def trajectory(request):
    """Return each, made once: a trajectory does not change."""
    return build(type=request.param)


def some_times(trajectory, count=2000, margin=0.01):
    rng = np.random.default_rng(1)  # the same places whatever other trajectories there are
    return np.sort(rng.uniform(margin, min(trajectory.duration, 100.0) - margin, count))


def relative(name):
    """Return the file's parameters by their names within the section ``trajectory``."""
    values = files.load(files.find("trajectories", name))
    return {key.removeprefix("trajectory."): value for key, value in values.items()}


def test_the_files_of_the_issue_are_there():
    required = """
        static lecture circle figure_eight line spin coning sculling excitation rotating_disc
        free_fall waypoints square six_position turntable temperature_soak temperature_ramp
    """
    assert set(required.split()) <= set(NAMES)


@pytest.mark.parametrize("name", sorted(TYPES.keys() & set(NAMES)))
def test_a_file_named_like_a_kind_holds_its_defaults(name):
    """Else a user of the kind would find values that nobody gave below his own."""
    assert build_section(TYPES[name], relative(name)) == TYPES[name]()


def test_derivatives_are_exact(trajectory, assert_exact_derivatives):
    assert_exact_derivatives(trajectory, some_times(trajectory))


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_exact_with_every_wrapper(name, assert_exact_derivatives):
    wrapped = build(
        type=name,
        length=2.0 if name == "waypoints" else 15.0,
        repeat=3,
        repeat_mode="there_and_back",
        time_scale=1.3,
        rest_before=1.0,
        rest_after=1.5,
        rest_transition=1.0,
        vibration__frequency=[7.0],
        vibration__acceleration=[1.0, 2.0, 3.0],
        vibration__noise_rms=0.5,
        vibration__noise_low=2.0,
        vibration__noise_high=9.0,
    )
    assert_exact_derivatives(wrapped, some_times(wrapped))


def test_samples_do_not_depend_on_their_block(trajectory):
    assert_samples_do_not_depend_on_their_block(trajectory)


def test_samples_of_a_wrapped_trajectory_do_not_depend_on_their_block():
    assert_samples_do_not_depend_on_their_block(
        build(type="lecture", rest_before=1.0, vibration__noise_rms=1.0)
    )


def assert_samples_do_not_depend_on_their_block(trajectory):
    t = np.arange(1000) * 0.005
    together = trajectory.sample(t)
    for size in (1, 7, 64):
        for start in range(0, 200, size):
            alone = trajectory.sample(t[start : start + size])
            for field, expected in zip(alone, together, strict=True):
                np.testing.assert_array_equal(field, expected[start : start + size])


def test_no_times_give_no_rows(trajectory):
    motion = trajectory.sample(np.zeros(0))
    assert [len(field) for field in motion] == [0] * 6


@pytest.mark.parametrize("name", NAMES)
def test_numbers_in_lists_are_all_floats(name):
    # rcl refuses a list such as [1.0, 2].
    for value in files.load(files.find("trajectories", name)).values():
        if isinstance(value, list):
            assert all(isinstance(entry, float) for entry in value)


def test_starting_needs_no_scipy():
    """One process samples five trajectories and imports neither SciPy nor Matplotlib."""
    code = (
        "import sys, numpy as np\n"
        "from imu_sim_ros.simulation.parameters import load_simulation\n"
        "from imu_sim_ros.trajectory.build import build_trajectory\n"
        "for name in ('static', 'lecture', 'excitation', 'six_position', 'turntable'):\n"
        "    p = load_simulation({'trajectory.type': name})\n"
        "    build_trajectory(p.trajectory).sample(np.arange(3.0))\n"
        "sys.exit(any(m.split('.')[0] in ('scipy', 'matplotlib') for m in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
