# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parameter reference says what the parameters say."""

import runpy
from pathlib import Path

import pytest

from imu_sim_ros.bags.recorder_parameters import RecorderParameters
from imu_sim_ros.commands.parameter_reference import reference
from imu_sim_ros.navigation.parameters import IntegratorParameters
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.sensors import switchable_sensors
from imu_sim_ros.sensors.camera.parameters import CameraParameters
from imu_sim_ros.sensors.camera.rig_parameters import RigParameters
from imu_sim_ros.sensors.camera.scene_parameters import TYPES as SCENES
from imu_sim_ros.simulation.error_parameters import ErrorNodeParameters
from imu_sim_ros.simulation.playback import SimulatorParameters
from imu_sim_ros.trajectory.parameters import TYPES

FOLDER = Path(__file__).parents[2] / "docs/reference"
CONTRIBUTING = FOLDER.parent / "contributing"


@pytest.mark.parametrize("name", ["parameters", "presets", "programs"])
def test_the_page_is_current(name):
    page = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    script = CONTRIBUTING / f"write_{name}.py"
    written = reference if name == "parameters" else runpy.run_path(str(script))["reference"]
    assert page == written(), "write it again: make reference"


def test_every_parameter_has_a_row_with_its_unit():
    rows = {line.split("`")[1]: line for line in reference().splitlines() if line[:3] == "| `"}
    declared = {**parameters(IntegratorParameters), **parameters(RecorderParameters)}
    for kind in TYPES:
        declared.update(parameters(SimulatorParameters, {"trajectory.type": kind}))
    declared.update(
        {
            name: parameter
            for name, parameter in parameters(ErrorNodeParameters).items()
            if name.startswith(("input.", "odometry", "publish."))
        }
    )
    rig = parameters(RigParameters)
    declared.update({name: rig[name] for name in ("cameras", "features.layout")})
    sections = {"camera": [CameraParameters], "scene": list(SCENES.values())}
    for prefix, classes in sections.items():
        for section_class in classes:
            declared.update(
                {f"{prefix}.{name}": p for name, p in parameters(section_class).items()}
            )
    for name, sensor in switchable_sensors().items():
        sensor_parameters = parameters(sensor.section)
        declared.update({f"{name}.{key}": p for key, p in sensor_parameters.items()})
    assert set(rows) == set(declared)
    # Names that several sections share have rows of their own; the last one is looked at.
    assert "| m/s^2 |" in rows["gravity"]
    assert all(parameter.text for parameter in declared.values())
