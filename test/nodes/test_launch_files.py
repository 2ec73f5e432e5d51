# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Launch files and views: what they name exists."""

import importlib.util
import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from scripts import load_script

from imu_sim_ros.bags.recorder_parameters import RecorderParameters
from imu_sim_ros.core.conventions import (
    ATTITUDE_ERROR_TOPIC,
    AXIS_COLOURS,
    DEAD_RECKONED_TOPIC,
    IMU_TOPIC,
    PATH_TOPIC,
    POSITION_ERROR_TOPIC,
    ROLL_PITCH_YAW_TOPIC,
    SERIES_COLOURS,
    TRUTH_TOPIC,
)
from imu_sim_ros.navigation.parameters import IntegratorParameters, load_integrator
from imu_sim_ros.nodes import launching
from imu_sim_ros.nodes.arguments import SECTION_FILES
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import build, parameters
from imu_sim_ros.simulation.error_parameters import ErrorNodeParameters
from imu_sim_ros.simulation.playback import SimulatorParameters

pytestmark = pytest.mark.ros

REPOSITORY = Path(__file__).parents[2]
LAUNCH_FILES = sorted((REPOSITORY / "launch").glob("*.launch.py"))
NODES = {
    "simulate": (SimulatorParameters,),
    "dead_reckoning": (SimulatorParameters, IntegratorParameters),
    "record": (RecorderParameters,),
    "gazebo_imu": (ErrorNodeParameters,),
}
NOT_PARAMETERS = {"namespace", "params_file", "use_sim_time", "rviz", "topic"}


def name_of(path: Path) -> str:
    return path.name.removesuffix(".launch.py")


def arguments_of(path: Path) -> list[launching.Argument]:
    """Return a launch file's arguments; only its description needs ``launch``."""
    return load_script(path, "launch_file").ARGUMENTS


def test_there_are_these_launch_files():
    assert {name_of(path) for path in LAUNCH_FILES} == set(NODES)


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=name_of)
def test_arguments_are_parameters_of_the_nodes_with_their_texts(path):
    parameter_table = {}
    for section in NODES[name_of(path)]:
        parameter_table = {**parameters(section), **parameter_table}
    arguments = arguments_of(path)
    assert len({argument.name for argument in arguments}) == len(arguments)
    assert {"namespace", "params_file", "use_sim_time"} <= {a.name for a in arguments}
    for argument in arguments:
        if argument.name not in NOT_PARAMETERS:
            # The node's own default holds where nothing is given.
            assert argument.default == ""
            assert (
                parameter_table[SECTION_FILES.get(argument.name, argument.name)].text
                in argument.text
            )


@pytest.mark.skipif(
    importlib.util.find_spec("launch") is None or importlib.util.find_spec("launch").origin is None,
    reason="the launch package comes with a ROS 2 installation, not from PyPI",
)
@pytest.mark.parametrize("path", LAUNCH_FILES, ids=name_of)
def test_launch_reads_the_description(path):
    from launch.launch_description_sources import PythonLaunchDescriptionSource

    from launch import LaunchContext

    source = PythonLaunchDescriptionSource(str(path))
    description = source.get_launch_description(LaunchContext())
    described_names = {argument.name for argument in description.get_launch_arguments()}
    assert {argument.name for argument in arguments_of(path)} == described_names


def published_topics() -> dict[str, set[str]]:
    """Return the topics of the standard set with the fields that plots may name."""
    vector = {f"vector.{axis}" for axis in "xyz"}
    odometry = {f"pose.pose.position.{axis}" for axis in "xyz"}
    readings = {
        f"{field}.{axis}" for field in ("angular_velocity", "linear_acceleration") for axis in "xyz"
    }
    return {
        f"/{IMU_TOPIC}": readings,
        f"/{TRUTH_TOPIC}": odometry,
        f"/{DEAD_RECKONED_TOPIC}": odometry,
        f"/{PATH_TOPIC}": set(),
        f"/{ROLL_PITCH_YAW_TOPIC}": vector,
        f"/{POSITION_ERROR_TOPIC}": vector,
        f"/{ATTITUDE_ERROR_TOPIC}": vector,
    }


def test_rviz_shows_topics_that_exist_with_displays_of_their_types():
    tree = yaml.safe_load((REPOSITORY / "config/dead_reckoning.rviz").read_text())
    manager = tree["Visualization Manager"]
    shown = {
        display["Topic"]["Value"]: display["Class"].split("/")[-1]
        for display in manager["Displays"]
        if "Topic" in display
    }
    # Relative: RViz resolves them in the namespace that the launch file starts it in.
    assert shown == {
        "ground_truth/odom": "Odometry",
        "dead_reckoned/odom": "Odometry",
        "dead_reckoned/path": "Path",
    }
    assert {f"/{topic}" for topic in shown} <= set(published_topics())
    world = load_integrator({}).world_frame
    assert manager["Global Options"]["Fixed Frame"] == world


# Read from packages/suite-base/src/panels of lichtblick-suite/lichtblick 66adecb99 (2026-08-07);
# a panel's title has a key of its own in either program, which passes over the other's.
TITLES = {"foxglovePanelTitle", "lichtblickPanelTitle"}
KEYS_OF_PANELS = {
    "Plot": {
        *TITLES,
        *("paths", "minXValue", "maxXValue", "minYValue", "maxYValue", "showLegend"),
        *("legendDisplay", "showPlotValuesInLegend", "showXAxisLabels", "showYAxisLabels"),
        *("isSynced", "xAxisVal", "xAxisPath", "xAxisLabel", "yAxisLabel", "followingViewWidth"),
        "sidebarDimension",
    },
    "3D": {
        *TITLES,
        *("cameraState", "followTf", "followMode", "scene", "publish", "transforms", "topics"),
        *("layers", "imageMode"),
    },
}
KEYS_OF_PATHS = {"value", "enabled", "color", "label", "timestampMethod", "showLine", "lineSize"}


def test_foxglove_has_only_keys_that_its_panels_know():
    layout = json.loads((REPOSITORY / "config/foxglove_layout.json").read_text())
    for name, panel in layout["configById"].items():
        kind = name.partition("!")[0]
        assert set(panel) <= KEYS_OF_PANELS[kind], name
        for path in panel.get("paths", []):
            assert set(path) <= KEYS_OF_PATHS
        if kind == "Plot":
            assert panel["foxglovePanelTitle"] == panel["lichtblickPanelTitle"] != ""


def test_foxglove_plots_fields_that_exist_and_lays_out_every_panel():
    layout = json.loads((REPOSITORY / "config/foxglove_layout.json").read_text())
    topics = published_topics()
    for panel in layout["configById"].values():
        for path in panel.get("paths", []):
            topic, _, field = path["value"].partition(".")
            assert field in topics[topic], path["value"]
        assert set(panel.get("topics", {})) <= set(topics)

    def leaves(place):
        if isinstance(place, str):
            return [place]
        assert place["direction"] in ("row", "column")
        return [*leaves(place["first"]), *leaves(place["second"])]

    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])


def test_layouts_have_the_colours_of_pages_and_pictures():
    """Axes red, green and blue; an estimate beside the truth lighter; its path as in pages."""
    foxglove = json.loads((REPOSITORY / "config/foxglove_layout.json").read_text())["configById"]
    root = ElementTree.parse(REPOSITORY / "config/plotjuggler_layout.xml").getroot()
    colours = {curve.get("name"): curve.get("color") for curve in root.iter("curve")}
    for panel in foxglove.values():
        colours |= {path["value"]: path["color"] for path in panel.get("paths", [])}
    assert len(colours) > 30
    for name, colour in colours.items():
        axis = AXIS_COLOURS[name[-1]].lower()
        channels = [int(axis[k : k + 2], 16) for k in (1, 3, 5)]
        lighter = "#" + "".join(f"{round(0.5 * (255 + channel)):02x}" for channel in channels)
        assert colour == (lighter if name.startswith("/dead_reckoned/odom") else axis), name
    path = foxglove["3D!scene"]["topics"]["/dead_reckoned/path"]["gradient"]
    assert path == [f"{SERIES_COLOURS[0].lower()}ff"] * 2
    tree = yaml.safe_load((REPOSITORY / "config/dead_reckoning.rviz").read_text())
    displays = {display["Name"]: display for display in tree["Visualization Manager"]["Displays"]}
    channels = [int(text) for text in displays["Dead-reckoned path"]["Color"].split(";")]
    assert bytes(channels).hex() == SERIES_COLOURS[0][1:].lower()


def test_plotjuggler_names_its_plugins_as_they_name_themselves():
    """The IDs are what name() returns, and the settings what the loader reads.

    facontidavide/PlotJuggler ddcbd05b and PlotJuggler/plotjuggler-ros-plugins 66e9101, whose
    parser_configuration.cpp reads true and false.
    """
    root = ElementTree.parse(REPOSITORY / "config/plotjuggler_layout.xml").getroot()
    plugins = {plugin.get("ID"): plugin for plugin in root.iter("plugin")}
    assert set(plugins) == {"DataLoad MCAP", "ROS2 Topic Subscriber"}
    settings = {entry.tag: entry.get("value") for entry in plugins["ROS2 Topic Subscriber"]}
    assert settings == {
        "use_header_stamp": "true",
        "discard_large_arrays": "false",
        "max_array_size": "100",
    }


def test_plotjuggler_plots_fields_that_exist():
    root = ElementTree.parse(REPOSITORY / "config/plotjuggler_layout.xml").getroot()
    topics = published_topics()
    names = [curve.get("name") for curve in root.iter("curve")]
    assert len(names) == len(set(names)) == 21
    for name in names:
        topic = next(t for t in topics if name.startswith(t + "/"))
        assert name.removeprefix(topic + "/").replace("/", ".") in topics[topic]
    for splitter in root.iter("DockSplitter"):
        assert int(splitter.get("count")) == len(splitter) == len(splitter.get("sizes").split(";"))


def test_the_parameter_files_of_the_nodes_are_valid():
    integrator = files.load(REPOSITORY / "config/integrator.yaml", "integrator")
    assert load_integrator(integrator).initial_state == "truth"
    recorder = files.load(REPOSITORY / "config/recorder.yaml", "recorder")
    assert build(RecorderParameters, recorder).topics[0] == "imu/data_raw"
