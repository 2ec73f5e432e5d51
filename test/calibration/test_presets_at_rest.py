# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sensor at rest is at rest: no preset is called moving or dead, whatever its turn-on values."""

import pytest

from imu_sim_ros.calibration.noise.analysis import analyse
from imu_sim_ros.core.records import Readings
from imu_sim_ros.parameters import files
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

PRESETS = [name for name in files.names("imus") if name != "perfect"]
OFTEN_REFUSED = ["mpu6000", "adis16448", "navigation"]
"""Presets whose turn-on bias, random walk or absent noise is often taken for no rest."""


def analysed(preset: str, seed: int) -> list[str]:
    """Analyse five minutes at 100 Hz; raises if the record is refused."""
    parameters = load_simulation(
        {
            "imu.preset": preset,
            "trajectory.type": "static",
            "rate": 100.0,
            "duration": 300.0,
            "seed": seed,
        }
    )
    samples = (window["imu"] for window in Body(parameters).windows())
    blocks = (Readings(block.t_ns, block.gyro, block.accel) for block in samples)
    return list(analyse([blocks]).warnings)


def assert_at_rest(preset: str, seed: int) -> None:
    warnings = analysed(preset, seed)
    assert not any("not at rest" in warning or "always" in warning for warning in warnings)


@pytest.mark.parametrize("preset", OFTEN_REFUSED)
def test_a_preset_at_rest_is_accepted(preset: str) -> None:
    for seed in range(2):
        assert_at_rest(preset, seed)


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_at_rest_is_accepted(preset: str) -> None:
    for seed in range(20):
        assert_at_rest(preset, seed)
