# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A trajectory of another package, found through its entry point: the example of the README."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.simulation.parameters import load_simulation

EXAMPLE = Path(__file__).with_name("pendulum.py")


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Put a package with the given entry point on the path, as an installation would."""

    def install(entry_point):
        shutil.copy(EXAMPLE, tmp_path)
        info = tmp_path / "pendulum-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: pendulum\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[imu_sim_ros.trajectories]\n{entry_point}\n")
        monkeypatch.syspath_prepend(tmp_path)

    return install


def test_the_example_is_short():
    source = EXAMPLE.read_text().split("@dataclass")[1]
    assert len(source.splitlines()) <= 22


def test_it_is_found_with_its_parameters(installed, build, assert_exact_derivatives):
    installed("pendulum = pendulum:Pendulum")
    trajectory = build(type="pendulum", rod=2.0)
    assert trajectory.duration == math.inf
    assert_exact_derivatives(trajectory, np.linspace(1.0, 9.0, 200))
    lowest = trajectory.sample(np.array([0.0]))
    np.testing.assert_allclose(lowest.position, [[0.0, 0.0, -2.0]], rtol=0, atol=1e-15)


def test_it_can_be_wrapped_like_any_other(installed, build, assert_exact_derivatives):
    installed("pendulum = pendulum:Pendulum")
    trajectory = build(
        type="pendulum", length=5.0, rest_before=1.0, rest_after=1.0, vibration__noise_rms=0.1
    )
    assert trajectory.duration == 9.0
    assert_exact_derivatives(trajectory, np.linspace(0.1, 8.9, 500))


def test_its_parameters_are_checked(installed):
    installed("pendulum = pendulum:Pendulum")
    with pytest.raises(ConfigurationError) as caught:
        load_simulation(
            {"trajectory.type": "pendulum", "trajectory.rod": 0.0, "trajectory.colour": "red"}
        )
    assert len(caught.value.problems) == 2


def test_an_unknown_type_lists_what_there_is(installed):
    installed("pendulum = pendulum:Pendulum")
    with pytest.raises(ConfigurationError, match=r"'pendulun': did you mean pendulum\?"):
        load_simulation({"trajectory.type": "pendulun"})


@pytest.mark.parametrize(
    ("entry_point", "line"),
    [
        ("pendulum = pendulum_missing:Pendulum", "cannot be loaded: No module named"),
        ("pendulum = pendulum:Missing", "cannot be loaded"),
        ("pendulum = pendulum:math", "is not a class derived from TrajectoryParameters"),
    ],
)
def test_entry_points_that_lead_nowhere(installed, entry_point, line):
    installed(entry_point)
    with pytest.raises(ConfigurationError, match=line):
        load_simulation({"trajectory.type": "pendulum"})


def test_a_class_that_cannot_sample_is_refused(installed, build):
    installed("pendulum = imu_sim_ros.trajectory.parameters:TrajectoryParameters")
    with pytest.raises(ConfigurationError, match=r"lacks duration or sample"):
        build(type="pendulum")
