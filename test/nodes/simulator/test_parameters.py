# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters that the simulator refuses: one line for each error, status 2, no traceback."""

from pathlib import Path
from typing import Any

import pytest

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.nodes import help
from imu_sim_ros.nodes.arguments import ros_arguments
from imu_sim_ros.nodes.launching import command_line
from imu_sim_ros.parameters.sections import flatten, parameters
from imu_sim_ros.simulation.playback import SimulatorParameters, load_simulator
from imu_sim_ros.trajectory.parameters import PosesParameters

pytestmark = pytest.mark.ros


REFUSED: list[tuple[list[str], list[str]]] = [
    (
        ["-p", "rate:=.nan", "-p", "seed:=x"],
        ["rate = nan: must be a finite number above 0 and at most 20000 [Hz]", "seed = 'x': "],
    ),
    (["-p", "rat:=100"], ["rat: unknown parameter; did you mean rate?"]),
    (["-p", "rate"], ["-p rate: must be name:=value"]),
    (["--params-file", "/no/such.yaml"], ["/no/such.yaml: No such file or directory"]),
    (
        ["-p", "imu.preset:=none", "-p", "rate:=0", "-p", "imu.latency:=-1"],
        ["unknown IMU 'none'; did you mean phone?", "rate = 0: must", "imu.latency = -1: must"],
    ),
    (["-p", "trajectory.type:=warp"], ["trajectory.type = 'warp': must be one of"]),
    (["--nonsense"], ["--ros-args: ['--nonsense']"]),
    (["-p", "publish.tf_rate:=1e-9"], ["publish.tf_rate = 1e-09: must be 0 or at least 1e-06"]),
    (["-p", "imus:=[a, a]"], ["imus = ['a', 'a']: names must differ"]),
    (["-p", "imus:=[a]", "-p", "a.duration:=1"], ["a.duration: unknown parameter"]),
    (["-p", "use_sim_time:=true", "-p", "real_time_factor:=2"], ["real_time_factor = 2: must"]),
    (
        ["-p", "qos_overrides./imu/data_raw.publisher.dept:=3"],
        ["qos_overrides./imu/data_raw.publisher.dept: the policy must be one of history, "],
    ),
    (
        ["-p", "qos_overrides./imu/data_raw.publisher.depth:=many"],
        ["qos_overrides./imu/data_raw: "],
    ),
    (
        [
            *("-p", "qos_overrides./imu/data_raw.publisher.deadline:=1.5"),
            *("-p", "qos_overrides./ground_truth/odom.publisher.deadline:=-1"),
        ],
        [
            "qos_overrides./ground_truth/odom.publisher.deadline = -1: must be an integer",
            "qos_overrides./imu/data_raw.publisher.deadline = 1.5: must be an integer of",
        ],
    ),
]
BAD_FILES = [
    ("", "not a ROS 2 parameter file"),
    ("a: [", "not a YAML file"),
    ("/**:\n  ros__parameters:\n    rte: 3\n", "rte: unknown parameter"),
    ("/**:\n  ros__parameters:\n    rate:\n", "rate: a value is missing"),
    ("/**:\n  ros__parameters:\n    gravity: [1, a, 2.0]\n", "a list of values of one type"),
]


def test_bad_arguments_and_files(refused: Any, tmp_path: Path) -> None:
    paths = [tmp_path / f"{k}.yaml" for k in range(len(BAD_FILES))]
    for path, (text, _) in zip(paths, BAD_FILES, strict=True):
        path.write_text(text)
    calls = [arguments for arguments, _ in REFUSED]
    calls += [["--params-file", str(path)] for path in paths]
    outputs = refused("simulator", [["--ros-args", *arguments] for arguments in calls])
    for error_lines, (_, lines) in zip(outputs[: len(REFUSED)], REFUSED, strict=True):
        assert len(error_lines) == len(lines), error_lines
        for line, expected in zip(error_lines, lines, strict=True):
            assert line.startswith(f"simulator: {expected}")
    for error_lines, (_, expected) in zip(outputs[len(REFUSED) :], BAD_FILES, strict=True):
        (line,) = error_lines
        assert expected in line


def test_the_program_ends_with_a_line_for_each_problem(start: Any) -> None:
    arguments, lines = REFUSED[0]
    node = start("simulator", "--ros-args", *arguments, program=True)
    assert node.status() == 2, node.output
    for line, expected in zip(node.output.splitlines(), lines, strict=True):
        assert line.startswith(f"simulator: {expected}")


def test_files_of_every_form_are_read(start: Any, tmp_path: Path) -> None:
    """Mixed lists, exponents without a point and kalibr's form are more than rcl can read."""
    mixed = tmp_path / "mixed.yaml"
    mixed.write_text(
        "/**:\n  ros__parameters:\n    duration: 1\n    imu.gyroscope_bias: [0.1, 0, 5e-4]\n"
    )
    kalibr = tmp_path / "imu.yaml"
    kalibr.write_text("gyroscope_noise_density: 1e-3\nupdate_rate: 50\nrostopic: /imu0\n")
    files = ["--params-file", str(mixed), "--params-file", str(kalibr)]
    node = start("simulator", "--ros-args", *files, real_time_factor=10.0)
    assert node.status() == 0, node.output
    assert "published 50 messages on imu/data_raw" in node.output


def test_the_short_trajectory_is_a_file_of_poses_too(start: Any, tmp_path: Path) -> None:
    """The node's argument, which launch files pass on, and a parameter file accept it."""
    poses = tmp_path / "poses.tum"
    rows = [f"{0.05 * k:.2f} {0.1 * k:.1f} 0 0 0 0 0 1" for k in range(40)]
    poses.write_text("\n".join(rows) + "\n")
    node = start("simulator", "--trajectory", str(poses), "--duration", "0.2")
    assert node.status() == 0, node.output
    assert f"trajectory {poses}" in node.output
    short_arguments = command_line(
        SimulatorParameters, {"trajectory": str(poses), "duration": "0.2"}
    )
    assert short_arguments == ["--trajectory", str(poses), "--duration", "0.2"]
    trajectory_parameters = load_simulator({"trajectory.type": str(poses)}).trajectory
    assert isinstance(trajectory_parameters, PosesParameters)
    assert trajectory_parameters.file == str(poses)


def test_plain_arguments_become_those_of_ros(tmp_path: Path) -> None:
    arguments = ["--rate=400", "--imu", "perfect", "--publish.clock-rate", "5", "--ros-args", "-r"]
    result = ros_arguments([*arguments, "a:=b"], SimulatorParameters, tmp_path)
    assert result == [
        "--ros-args",
        *("-r", "a:=b"),
        *("-p", "rate:=400", "-p", 'imu.preset:="perfect"', "-p", "publish.clock_rate:=5"),
    ]
    lists = ["--imu.gyroscope_bias", "[0.01, 0, 5e-4]", "--imus=[]"]
    assert ros_arguments(lists, SimulatorParameters, tmp_path) == [
        "--ros-args",
        *("-p", "imu.gyroscope_bias:=[0.01, 0.0, 0.0005]", "-p", 'imus:="[]"'),
    ]
    with pytest.raises(
        ConfigurationError, match=r"gravity = \[1, 'a'\]: must be a list of values of one type"
    ):
        ros_arguments(["--gravity", "[1, a]"], SimulatorParameters, tmp_path)
    with pytest.raises(ConfigurationError) as raised:
        ros_arguments(["word", "-p", "rate:=1", "--rate"], SimulatorParameters, tmp_path)
    assert raised.value.problems == (
        "word: not an argument (--help-all lists them)",
        "-p rate:=1: must come after --ros-args",
        "--rate: a value is missing",
    )


def test_help_names_every_parameter() -> None:
    help_text = "".join(help.parser("simulator").format_help().split())
    for name, parameter in parameters(SimulatorParameters).items():
        assert f"--{name}VALUE" in help_text
        assert "".join(parameter.unit.split()) in help_text
        assert "".join(parameter.text.split()) in help_text


def test_own_parameters_of_several_imus() -> None:
    settings = {
        "imus": ["left", "right"],
        "seed": 5,
        "rate": 300,
        "right.rate": 100,
        "right.imu.preset": "perfect",
    }
    imu_parameters = load_simulator(settings).each_imu
    left_imu, right_imu = imu_parameters["left"], imu_parameters["right"]
    assert (left_imu.rate, left_imu.seed, left_imu.imu_frame) == (300, 5, "left_imu_link")
    assert (right_imu.rate, right_imu.seed) == (100, 6)
    assert left_imu.imu.gyroscope.noise_density == (0.015,) * 3
    assert right_imu.imu.gyroscope.noise_density == (0.0,) * 3
    with pytest.raises(ConfigurationError, match=r"left\.imu\.jitter = 0\.1"):
        load_simulator({**settings, "left.imu.jitter": 0.1})


def test_parameters_are_described_and_keep_their_types_whatever_is_set(
    start: Any, listener: Any
) -> None:
    """`ros2 param set` sends a list of floats and integers, or an empty one, as a string."""
    from rcl_interfaces.msg import ParameterType
    from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters

    start("simulator")
    names = listener.call("simulator/list_parameters", ListParameters).result.names
    assert set(parameters(SimulatorParameters, flatten(load_simulator({})))) <= set(names)
    rate, density = listener.call(
        "simulator/describe_parameters",
        DescribeParameters,
        names=["rate", "imu.gyroscope_noise_density"],
    ).descriptors
    assert (rate.read_only, density.read_only) == (True, False)
    assert rate.description == "samples per second [Hz]"
    assert "above 0 and at most 20000 [Hz]" in rate.additional_constraints

    def types() -> dict[str, int]:
        parameter_table = parameters(SimulatorParameters, flatten(load_simulator({})))
        described = listener.call(
            "simulator/describe_parameters", DescribeParameters, names=list(parameter_table)
        ).descriptors
        values = listener.call(
            "simulator/get_parameters", GetParameters, names=list(parameter_table)
        ).values
        assert [d.type for d in described] == [v.type for v in values]
        return {d.name: d.type for d in described}

    types_before = types()
    assert types_before["imus"] == ParameterType.PARAMETER_STRING_ARRAY  # empty
    assert types_before["trajectory.vibration.frequency"] == ParameterType.PARAMETER_DOUBLE_ARRAY
    bias = "imu__gyroscope_bias"
    for value, expected in (
        ("[0.1, 0, 0]", [0.1, 0.0, 0.0]),
        ([1, 2, 3], [1.0, 2.0, 3.0]),
        (0.5, [0.5] * 3),
        (2, [2.0] * 3),
    ):
        assert listener.set("simulator", **{bias: value}).successful
        names = ["imu.gyroscope_bias"]
        (stored,) = listener.call("simulator/get_parameters", GetParameters, names=names).values
        assert list(stored.double_array_value) == expected
        assert types() == types_before
    assert listener.set("simulator", imu__latency=1).successful
    for name, value in (
        (bias, "[a, 0, 0]"),
        (bias, "[0.1, 0"),
        (bias, "!!python/object/apply:os.system [ls]"),
        (bias, [0.1, 0.2]),
        ("inject__kind", 3.0),
        ("catch_up", "yes"),
        ("step_samples", 1.5),
    ):
        result = listener.set("simulator", **{name: value})
        assert not result.successful
        assert result.reason.startswith(f"{name.replace('__', '.')} = ")
        assert ": must be " in result.reason
    assert types() == types_before


def test_a_dump_of_a_node_with_remappings_starts_again(start: Any) -> None:
    """Taken by the real `ros2 param dump` of a node with imu/data_raw:=/imu0 in /robot."""
    dump = Path(__file__).parents[2] / "data/launch/param_dump.yaml"
    assert "/imu0:" in dump.read_text()
    node = start(
        "simulator",
        *("--duration", "0.5", "--ros-args", "--params-file", str(dump), "-r", "__ns:=/robot"),
    )
    assert node.status() == 0, node.output
    # A busy machine also warns of samples that are late.
    (note,) = [line for line in node.output.splitlines() if "WARN" in line and "qos_" in line]
    assert "qos_overrides.* of /imu0 ignored: the topics published here are" in note
    assert "published 100 messages on imu/data_raw" in node.output


def test_a_value_of_a_type_that_ros_does_not_have_is_refused(start: Any, listener: Any) -> None:
    """The node survives the exception that rclpy raises in the callback of the service.

    All nodes have these services from one class.
    """
    from rcl_interfaces.msg import Parameter, ParameterValue
    from rcl_interfaces.srv import SetParameters, SetParametersAtomically

    node = start("integrator")
    bad = Parameter(name="strange", value=ParameterValue(type=99))
    good = Parameter(name="use_sim_time", value=ParameterValue(type=1, bool_value=False))
    responses = listener.call(
        "integrator/set_parameters", SetParameters, parameters=[bad, good]
    ).results
    assert [response.successful for response in responses] == [False, True]
    assert responses[0].reason == "strange: a value of the unknown type 99"
    service = "integrator/set_parameters_atomically"
    result = listener.call(service, SetParametersAtomically, parameters=[good, bad]).result
    assert not result.successful
    assert listener.call(service, SetParametersAtomically, parameters=[good]).result.successful
    assert node.process.poll() is None


def test_paths_in_a_parameter_file_are_relative_to_it(tmp_path: Path) -> None:
    """The node resolves paths itself, as generate does: rcl does not name the file of a value."""
    (tmp_path / "m.obj").touch()
    file = tmp_path / "given.yaml"
    file.write_text("/**:\n  ros__parameters:\n    scene: {type: mesh, mesh: m.obj}\n")
    node_arguments = ["--ros-args", "--params-file", str(file)]
    *_, rewritten = ros_arguments(node_arguments, SimulatorParameters, tmp_path)
    assert f"mesh: {tmp_path / 'm.obj'}" in Path(rewritten).read_text()
