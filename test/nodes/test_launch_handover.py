# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes accept the arguments of a real launch, captured in test/data/launch."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scripts import load_script

from imu_sim_ros.bags.recorder_parameters import RecorderParameters
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.navigation.parameters import IntegratorParameters
from imu_sim_ros.nodes import launching
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import flatten, parameters
from imu_sim_ros.parameters.yaml_text import parse_yaml
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.playback import SimulatorParameters, load_simulator

pytestmark = pytest.mark.ros

REPOSITORY = Path(__file__).parents[2]
CAPTURED = {
    path.stem: json.loads(path.read_text())
    for path in sorted((REPOSITORY / "test/data/launch").glob("*.json"))
}
SECTIONS = {
    "simulator": SimulatorParameters,
    "integrator": IntegratorParameters,
    "recorder": RecorderParameters,
}
LISTS = ("vector", "gravity", "matrix", "numbers", "texts")


def of_node(run: str, node: str, place: int = 0) -> dict[str, Any]:
    return [entry for entry in CAPTURED[run]["nodes"] if entry["node"] == node][place]


def arguments_of(entry: dict[str, Any], tmp_path: Path) -> list[str]:
    """Return a node's arguments with the file that launch_ros wrote put in place."""
    path = tmp_path / "launch_params"
    path.write_text(entry["parameters"])
    return [
        word.replace("{config}", str(REPOSITORY / "config")).replace("{parameters}", str(path))
        for word in entry["arguments"]
    ]


def launch_file(name: str) -> Any:
    """Import a launch file; it needs ``launch`` only to make its description."""
    return load_script(REPOSITORY / "launch" / name, "launch_file")


@pytest.mark.parametrize("node", list(SECTIONS))
def test_every_list_is_read_from_a_file_as_launch_ros_writes_it(tmp_path, node):
    """launch_ros' own line: yaml.dump(parameters, file, default_flow_style=False)."""
    lists = {
        name: parameter
        for name, parameter in parameters(SECTIONS[node]).items()
        if parameter.kind in LISTS
    }
    assert lists
    values = {
        name: (
            *(
                parameter.default
                or (("a", "b") if parameter.kind == "texts" else (1.0,) * parameter.group)
            ),
        )
        for name, parameter in lists.items()
    }
    path = tmp_path / "launch_params"
    with path.open("w") as file:
        tree = {f"/robot/{node}": {"ros__parameters": values}}
        yaml.dump(tree, file, default_flow_style=False)
    assert path.read_text().count("!!python/tuple") == len(lists)
    loaded = files.load(path, node)
    assert loaded.keys() == lists.keys()
    for name, parameter in lists.items():
        assert isinstance(loaded[name], list), name
        assert parameter.parse(name, loaded[name]) == parameter.parse(name, values[name]), name


@pytest.mark.parametrize("tag", ["!!python/name:os.system", "!!python/object/new:tuple [[1]]"])
def test_no_other_tag_of_python_is_read(tag):
    with pytest.raises(ValueError, match="could not determine a constructor"):
        parse_yaml(f"a: {tag}")
    with pytest.raises(ValueError, match="expected a sequence node"):
        parse_yaml("a: !!python/tuple {b: 1}")


@pytest.mark.parametrize("run", [run for run in CAPTURED if run != "user"])
def test_what_was_captured_is_what_the_launch_files_make_today(run):
    _, _, name, *typed_words = CAPTURED[run]["command"]
    launch_arguments = dict(word.split(":=", 1) for word in typed_words)
    launch_arguments = {
        a.name: launch_arguments.get(a.name, a.default) for a in launch_file(name).ARGUMENTS
    }
    for entry in CAPTURED[run]["nodes"]:
        node_arguments = entry["arguments"]
        place = node_arguments.index("--ros-args")
        assert node_arguments[:place] == launching.command_line(
            SECTIONS[entry["node"]], launch_arguments
        )
        assert " ".join(launching.ros_words(launch_arguments)) in " ".join(node_arguments[place:])


def test_the_lists_of_a_users_launch_file_reach_the_readings(
    start, listener, tmp_path, monkeypatch
):
    from sensor_msgs.msg import Imu

    entry = of_node("user", "simulator", 1)
    for name, value in entry["environment"].items():
        monkeypatch.setenv(name, value)
    listener.listen("/robot/imu0", Imu)
    listener.spin(0.3)
    node = start("simulator", *arguments_of(entry, tmp_path), wait_for_subscribers=1)
    assert listener.wait_for_end(node) == 0, node.output
    parameter_values = files.load(tmp_path / "launch_params")
    simulated = load_simulator(parameter_values)
    assert simulated.imu.gyroscope.bias == (0.01, 0.0, -0.02)
    block = Body(simulated).next(50)["imu"]
    live = [
        [m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z]
        for m in listener.messages("/robot/imu0")
    ]
    np.testing.assert_array_equal(live, block.gyro)


def test_names_of_imus_in_a_users_launch_file(start, tmp_path):
    node = start("simulator", *arguments_of(of_node("user", "simulator", 0), tmp_path))
    assert node.status() == 0, node.output
    assert "published 100 messages on left/imu/data_raw" in node.output
    assert "published 100 messages on right/imu/data_raw" in node.output


def test_a_wrong_argument_names_itself(refused, tmp_path):
    arguments = arguments_of(of_node("simulate_wrong", "simulator"), tmp_path)
    valid_arguments = [word for word in arguments if word not in ("--params-file", "/no/such.yaml")]
    missing, wrong = refused("simulator", [arguments, valid_arguments])
    assert missing == ["simulator: /no/such.yaml: No such file or directory"]
    assert [line.split(": must")[0] for line in wrong] == [
        "simulator: rate = 'abc'",
        "simulator: seed = -1",
    ]


def test_two_imus_are_dead_reckoned_each_and_none_of_their_readings_is_lost(start, tmp_path):
    integrators = [
        start("integrator", *arguments_of(of_node("dead_reckoning_two", "integrator", k), tmp_path))
        for k in (0, 1)
    ]
    simulator = of_node("dead_reckoning_two", "simulator")
    node = start("simulator", *arguments_of(simulator, tmp_path))
    assert node.status() == 0, node.output
    for integrator in integrators:
        assert integrator.end() == 0, integrator.output
        assert "published 100 messages on dead_reckoned/odom" in integrator.output


def test_the_arguments_of_a_launch_stand_above_its_files(start, listener, tmp_path):
    from rcl_interfaces.srv import GetParameters

    user_file = tmp_path / "own.yaml"
    user_file.write_text(
        "/**/simulator: {ros__parameters: {rate: 50.0, seed: 9, duration: 60.0}}\n"
    )
    arguments = arguments_of(of_node("simulate_all", "simulator"), tmp_path)
    arguments = [str(user_file) if word == "PARAMS" else word for word in arguments]
    place = arguments.index("--seed")
    del arguments[place : place + 2]
    place = arguments.index("--duration")
    del arguments[place : place + 2]
    start("simulator", *arguments)
    names = ["rate", "seed", "imus", "world_frame", "use_sim_time", "imu.preset"]
    values = listener.call("/robot/simulator/get_parameters", GetParameters, names=names).values
    assert values[0].double_value == 400.0
    assert values[1].integer_value == 9
    assert values[2].string_array_value == ["left", "right"]
    assert values[3].string_value == "map"
    assert values[4].bool_value is False
    assert values[5].string_value == "adis16448"


def test_the_recorder_of_a_launch_records_its_topics(start, tmp_path):
    arguments = arguments_of(of_node("record", "recorder"), tmp_path)
    bag = tmp_path / "bag"
    arguments = [str(bag) if word == "BAG" else word for word in arguments]
    recorder = start("recorder", *arguments)
    simulator = start("simulator", duration=1.0, wait_for_subscribers=1)
    assert simulator.status() == 0, simulator.output
    assert recorder.status() == 0, recorder.output
    assert (bag / "metadata.yaml").is_file()


def test_values_of_a_launch_file(tmp_path):
    assert launching.names("[left, right]") == launching.names(" left  right ") == ["left", "right"]
    assert launching.names("") == launching.names("[]") == []
    assert launching.flag({"rviz": "True"}, "rviz")
    with pytest.raises(ConfigurationError, match="rviz = 'perhaps': must be true or false"):
        launching.flag({"rviz": "perhaps"}, "rviz")


def test_the_section_of_several_imus_may_come_as_a_string():
    imu_settings = {"imus": "[left, right]", "left.imu.gyroscope_bias": "[0.1, 0, 0]"}
    built = load_simulator(imu_settings)
    assert flatten(built)["left.imu.gyroscope_bias"] == (0.1, 0.0, 0.0)
