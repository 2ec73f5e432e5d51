# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gravity means the same wherever it is given: a number is its magnitude, downwards."""

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands import add_errors, dead_reckon, generate
from imu_sim_ros.navigation.parameters import IntegratorParameters
from imu_sim_ros.parameters.sections import build, parameters
from imu_sim_ros.simulation.error_parameters import load_error_model
from imu_sim_ros.simulation.parameters import load_simulation

UPWARDS = r"gravity = \[0, 0, 9.81\]: does not point downwards"
REST = {"imu": "perfect", "trajectory": "static", "duration": 1.0}


def loaded(values):
    """Return the parameters of each door that takes gravity."""
    return (
        load_simulation(values),
        load_error_model({"rate": 200.0, **values}),
        build(IntegratorParameters, values),
    )


@pytest.mark.parametrize("value", [9.7, 10, "[0, 0, -9.7]", [0.0, 0.0, -9.7], np.float32(9.75)])
def test_a_number_is_the_magnitude_downwards_at_every_door(value):
    magnitude = 9.7 if isinstance(value, str | list) else float(value)
    assert {configuration.gravity for configuration in loaded({"gravity": value})} == {
        (0.0, 0.0, -magnitude)
    }


def test_every_parameter_called_gravity_is_of_the_same_kind():
    simulation = load_simulation({"trajectory.type": "free_fall", "trajectory.gravity": 1.62})
    assert simulation.trajectory.gravity == (0.0, 0.0, -1.62)
    kinds = {parameters(type(configuration))["gravity"].kind for configuration in loaded({})}
    assert kinds == {"gravity"}


@pytest.mark.parametrize("value", [-9.81, [9.81], [0, 9.81], "9.81", True, None, float("nan")])
def test_what_is_no_gravity_is_refused_at_every_door(value):
    for load in (
        load_simulation,
        lambda values: load_error_model({"rate": 200.0, **values}),
        lambda values: build(IntegratorParameters, values),
    ):
        with pytest.raises(ims.ConfigurationError, match="gravity = .*a magnitude"):
            load({"gravity": value})


def test_an_upward_vector_is_a_warning_at_every_door(tmp_path, capsys):
    upward_vector = {"gravity": [0, 0, 9.81]}
    with pytest.warns(UserWarning, match=UPWARDS):
        flight = ims.simulate(**REST, **upward_vector)
    with pytest.warns(UserWarning, match=UPWARDS):
        next(ims.blocks(**REST, **upward_vector))
    with pytest.warns(UserWarning, match=UPWARDS):
        ims.dead_reckon(flight)
    with pytest.warns(UserWarning, match=UPWARDS):
        ims.add_errors(flight.t_ns, flight.gyro, flight.accel, imu="perfect", **upward_vector)
    with pytest.warns(UserWarning, match=UPWARDS):
        ims.ErrorModel(rate=200.0, **upward_vector)
    summary = ims.generate(tmp_path / "up.mcap", **REST, **upward_vector)
    assert any("does not point downwards" in line for line in summary.warnings)
    upwards, bag = ["--set", "gravity=[0,0,9.81]"], str(tmp_path / "up.mcap")
    for main, arguments in (
        (generate.main, ["--duration", "1s", "-o", str(tmp_path / "a.mcap"), *upwards]),
        (dead_reckon.main, [bag]),
        (add_errors.main, [bag, "-o", str(tmp_path / "b.mcap"), *upwards]),
    ):
        assert main(arguments) == 0
        assert "does not point downwards" in capsys.readouterr().err


def test_gravity_as_usual_is_no_warning(recwarn):
    flight = ims.simulate(**REST, gravity=9.81)
    assert np.array_equal(flight.accel, ims.simulate(**REST).accel)
    ims.dead_reckon(flight, gravity=9.81)
    assert not recwarn.list
