# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The realised unit, over every field of the declarations: readings and truth file."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros.datasets.truth_files import new_truth_files
from imu_sim_ros.parameters.sections import flatten, parameters
from imu_sim_ros.sensors.errors.realised import realise_imu
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

FIELDS = parameters(ImuParameters)
DRAWN = {
    f"imu.{sensor}_turn_on_scale_sigma": 0.05
    for sensor in ("gyroscope", "accelerometer", "magnetometer")
} | {f"imu.{sensor}_turn_on_bias_sigma": 0.01 for sensor in ("gyroscope", "barometer")}
BASE = {
    "imu.preset": "perfect",
    "trajectory.type": "lecture",
    "temperature.value": 45.0,
    "imu.age_days": 100.0,
    "seed": 5,
    "duration": 2.0,
    **DRAWN,
}
REALISED = ("gyroscope_", "accelerometer_", "magnetometer_", "barometer_")
"""The sensors that have constants to be drawn; their fields."""
NEEDED = {
    "magnetometer_current_coupling": {"imu.magnetometer_current_profile": [0.0, 1.0, 1.0, 2.0]},
    "dropout_burst_rate": {"imu.dropout_burst_duration": 0.1},
    "stress_step_sigma": {"imu.stress_step_rate": 1.0},
    "shock_bias_sigma": {"imu.shock_threshold": 1.0},
    "gauss_markov": {"correlation_time": 10.0},
    "increment_resolution": {"imu.sampling": "averaged"},
    "barometer_gust_": {"imu.barometer_gust_sigma": 10.0, "imu.barometer_gust_rate": 10.0},
    "barometer_minimum": {"imu.barometer_maximum": 2e5},
    "internal_rate": {
        "imu.sampling": "oversampled",
        "imu.gyroscope_bandwidth": 50.0,
        "imu.accelerometer_bandwidth": 50.0,
    },
    "vibration.": {
        "imu.vibration.line_frequency": [30.0],
        "imu.vibration.line_amplitude": [0.1] * 6,
        "imu.vibration.band_low": [20.0],
        "imu.vibration.band_high": [30.0],
        "imu.vibration.band_density": [0.1] * 6,
    },
}
VALUES = {
    "preset": "tactical",
    "sampling": "averaged",
    "internal_rate": 800.0,
    "mounting": [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    "barometer_preset": "bmp280",
    "barometer_maximum": 9.0e4,
    "barometer_gust_sigma": 20.0,
    "barometer_bias": 100.0,
    "jitter": 1e-4,
    "magnetometer_time_offset": 1e-3,
    "barometer_time_offset": 1e-3,
    "orientation_source": "filter",
    "vibration.line_frequency": [31.0],
    "vibration.band_low": [21.0],
    "vibration.band_high": [31.0],
    "bandwidth_order": 3,
    "misalignment_percent": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
    "magnetometer_current_profile": [0.0, 1.0],
    "correlation_time": 20.0,
}


def changed(name):
    """Return a value that differs from the default, with what it needs to be allowed."""
    parameter = FIELDS[name]
    by_kind = {
        "matrix": [1.01, 0.02, 0, 0.01, 1.02, 0, 0, 0.03, 1.0],
        "vector": [0.01, 0.02, 0.03],
        "number": 1.0 if parameter.default != 1.0 else 0.5,
        "numbers": [0.2] * max(parameter.group, 1),
        "flag": parameter.default is not True,
    }
    short = name.partition("_")[2]
    value = VALUES.get(name, VALUES.get(short, by_kind.get(parameter.kind)))
    if parameter.kind == "vector" and value == 20.0:
        value = [20.0] * 3
    if parameter.kind == "number" and parameter.maximum < 1.0:
        value = 0.5 * parameter.maximum
    needed = {}
    for key, needed_values in NEEDED.items():
        if key in name:
            triad = name.split("_")[0]
            needed |= {k if "." in k else f"imu.{triad}_{k}": v for k, v in needed_values.items()}
    return {**BASE, **needed}, {**BASE, **needed, f"imu.{name}": value}


def truth_of(values):
    """Return the truth file without its comment."""
    (text,) = new_truth_files(Path("nowhere/a.mcap"), load_simulation(values)).values()
    return text.partition("/**:")[2]


@pytest.mark.parametrize("name", FIELDS)
def test_a_change_of_a_field_is_in_the_truth(name):
    original, changed_value = changed(name)
    assert truth_of(original) != truth_of(changed_value)


@pytest.mark.parametrize("name", [name for name in FIELDS if name.startswith(REALISED)])
def test_the_realised_unit_reads_the_same_whatever_the_field(name):
    """Same seed, so that the noise is the same: what differs is what the realised unit forgot.

    The turn-on scales are 5 %: a term of 1e-6 of the reading that is missing shows.
    """
    loaded = load_simulation(changed(name)[1])
    sensors = ("magnetic_field", "pressure")
    unit = dataclasses.replace(loaded, imu=realise_imu(loaded.imu, loaded.seed))
    drawn_samples, two = (Body(p, sensors=sensors).next(100) for p in (loaded, unit))
    for attribute in ("gyro", "accel"):
        mine, theirs = (getattr(samples["imu"], attribute) for samples in (drawn_samples, two))
        np.testing.assert_allclose(theirs, mine, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(
        two["magnetic_field"].field,
        drawn_samples["magnetic_field"].field,
        rtol=0.0,
        atol=1e-9 * np.abs(drawn_samples["magnetic_field"].field).max(),
    )
    np.testing.assert_allclose(
        two["pressure"].pressure, drawn_samples["pressure"].pressure, rtol=1e-12
    )


def test_nothing_is_left_to_draw():
    """Every spread of a constant is zero in the realised unit, the orientation's excepted.

    Its constant error has no parameter: the orientation's covariance states the spread.
    """
    drawn = {
        f"imu.{name}": 1e-3
        for name in FIELDS
        if name.endswith("_sigma") and (name[:-6] in FIELDS or "turn_on" in name)
    }
    unit = realise_imu(
        (drawn_parameters := load_simulation({**BASE, **drawn})).imu, drawn_parameters.seed
    )
    values = {name: value for name, value in flatten(unit).items() if f"imu.{name}" in drawn}
    remaining = [name for name, value in values.items() if np.any(value)]
    assert remaining == ["orientation_turn_on_sigma"]
    assert len(values) > 15
