# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Problems and warnings of the parameters of a sensor, all together."""

import math
import re

import pytest

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.parameters.kinds import IDENTITY_MATRIX
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.simulation.parameters import SimulationParameters, load_simulation


def problems(**values: object) -> tuple[str, ...]:
    parameters = {name.replace("__", "."): value for name, value in values.items()}
    with pytest.raises(ConfigurationError) as error:
        load_simulation({"trajectory.type": "static", **parameters})
    return error.value.problems


ONE_LINE = {
    "negative density": ({"imu__gyroscope_noise_density": -0.01}, "at least 0"),
    "NaN": ({"imu__accelerometer_bias": [0.0, math.nan, 0.0]}, "finite number"),
    "infinite": ({"imu__lever_arm": math.inf}, "finite number"),
    "two entries": ({"imu__gyroscope_bias": [1.0, 2.0]}, "list of three"),
    "scaled mounting": ({"imu__mounting": [2.0, 0, 0, 0, 1, 0, 0, 0, 1]}, "rotation matrix; R"),
    "mirror": ({"imu__mounting": [1.0, 0, 0, 0, 1, 0, 0, 0, -1]}, "is a reflection"),
    "no correlation time": (
        {"imu__gyroscope_gauss_markov_sigma": 0.1},
        "gyroscope_correlation_time = .* above 0 s",
    ),
    "one axis without correlation time": (
        {
            "imu__accelerometer_gauss_markov_density": 0.1,
            "imu__accelerometer_correlation_time": [1.0, 0.0, 1.0],
        },
        "accelerometer_correlation_time",
    ),
    "two forms of one process": (
        {
            "imu__gyroscope_gauss_markov_sigma": 0.1,
            "imu__gyroscope_gauss_markov_density": 0.1,
            "imu__gyroscope_correlation_time": 10.0,
        },
        "the two are one process",
    ),
    "two forms of scale": (
        {
            "imu__gyroscope_scale_misalignment": [1.1, *IDENTITY_MATRIX[1:]],
            "imu__gyroscope_scale_error_percent": 1.0,
        },
        "must be the identity",
    ),
    "three cross-axis terms": (
        {"imu__gyroscope_misalignment_percent": []},
        "must be six numbers",
    ),
    "cut-off too low": ({"imu__gyroscope_bandwidth": 1e-9}, "must be 0 or at least 0.0001 Hz"),
    "an axis is lost": (
        {"imu__gyroscope_scale_misalignment": [0.0] * 9},
        "gyroscope_scale_misalignment = .*: must be invertible",
    ),
    "an axis is lost, in percent": (
        {"imu__accelerometer_scale_error_percent": [0.0, -100.0, 0.0]},
        "accelerometer_scale_error_percent = .* an axis is lost",
    ),
    "order": ({"imu__bandwidth_order": 0}, "at least 1"),
    "jitter": ({"imu__jitter": 0.002}, "quarter of the interval, 0.00125 s"),
    "burst without duration": ({"imu__dropout_burst_rate": 1.0}, "dropout_burst_duration = 0.0"),
    "probability": ({"imu__dropout_probability": 1.1}, "at most 1"),
    "two gravities": ({"gravity": [0.0, 0.0, -9.8], "gravity_model": "wgs84"}, "omitted"),
    "sampling": ({"imu__sampling": "sometimes"}, "one of instantaneous, averaged"),
    "temperature times": ({"temperature__profile": [0.0, 1.0, 0.0, 2.0]}, "times must increase"),
    "temperature pairs": ({"temperature__profile": [0.0, 1.0, 0.0]}, "2 for each entry"),
    "before the start": ({"temperature__profile": [-1.0, 1.0]}, "at least 0"),
    "polynomial": ({"imu__gyroscope_temperature_bias": [1.0, 2.0]}, "3 for each entry"),
    "below absolute zero": ({"temperature__value": -300.0}, "at least -273.15"),
}


@pytest.mark.parametrize("case", ONE_LINE)
def test_a_bad_value_is_one_line_that_names_its_parameter(case: str) -> None:
    values, text = ONE_LINE[case]
    (line,) = problems(**values)
    name = next(iter(values)).replace("__", ".")
    assert name.split(".")[0] in line
    assert re.search(text, line), line


def test_all_rules_are_reported_together() -> None:
    lines = problems(
        imu__mounting=[2.0, 0, 0, 0, 1, 0, 0, 0, 1],
        imu__gyroscope_gauss_markov_sigma=0.1,
        imu__accelerometer_bandwidth=1e-9,
        temperature__profile=[5.0, 1.0, 4.0, 2.0],
    )
    assert len(lines) == 4


def test_a_range_below_gravity_is_a_warning() -> None:
    parameters_ = load_simulation({"trajectory.type": "static", "imu.accelerometer_range": 9.0})
    (line,) = parameters_.warnings()
    assert "accelerometer_range = 9" in line
    assert "9.81" in line
    assert load_simulation({"imu.accelerometer_range": 19.6}).warnings() == []


_WITHOUT_ERROR = (
    "imu.vibration.reference_motion",
    "imu.vibration.motion_floor",
    "imu.vibration.motion_ceiling",
    "imu.vibration.motion_time",
    "imu.reference_temperature",
    "imu.bandwidth_order",
    "imu.hysteresis_temperature",
    "imu.magnetometer_rate",
    "imu.barometer_rate",
    "imu.orientation_drift_time",
    "imu.orientation_acceleration_time",
    "imu.orientation_time_constant",
    "imu.orientation_calibrated",
)
"""Parameters that make no error whatever their value."""


def test_zero_is_off_and_the_default() -> None:
    """Every default of the sensor is the value that makes no error."""
    defaults = parameters(SimulationParameters, {})
    for name, parameter in defaults.items():
        if not name.startswith("imu.") or parameter.kind in ("text", "choice"):
            continue
        if name in _WITHOUT_ERROR:
            continue
        identity = name.endswith(("scale_misalignment", "mounting", "soft_iron"))
        expected = IDENTITY_MATRIX if identity else 0.0
        assert parameter.default == expected or not any(
            parameter.default if isinstance(parameter.default, tuple) else [parameter.default]
        ), name


def test_live_parameters_keep_their_state() -> None:
    """Parameters of a running filter, a drawn number or the run's grid are not live."""
    live = {name for name, p in parameters(SimulationParameters, {}).items() if p.live}
    for name in ("correlation_time", "bandwidth", "turn_on_bias_sigma", "turn_on_scale_sigma"):
        assert f"imu.gyroscope_{name}" not in live
    for name in ("rate", "seed", "gravity", "imu.sampling", "imu.lever_arm", "imu.stamp_offset"):
        assert name not in live
    for name in ("noise_density", "random_walk", "bias", "range", "bias_instability"):
        assert f"imu.accelerometer_{name}" in live
