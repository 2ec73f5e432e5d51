# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plans: what they describe, and everything that is wrong with them, all together."""

import re
import subprocess

import pytest

from imu_sim_ros.campaigns.cells import Axis, cell_count, cells, read_axes
from imu_sim_ros.campaigns.gate import parse
from imu_sim_ros.campaigns.plan import (
    check_cells,
    check_plan,
    file_digests,
    find_plan,
    load_plan,
    read_plan,
)
from imu_sim_ros.commands.campaign import main as command
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.parameters import files

BASE = {"parameters": {"rate": 100.0, "duration": 2.0}}


def test_axes_make_every_combination_the_last_changing_fastest():
    axes = read_axes(
        {
            "imu": ["adis16448", "bmi088"],
            "imu.gyroscope_noise_density": {"log_range": [1e-4, 1e-2, 3]},
        }
    )
    plan_cells = list(cells(axes))
    assert cell_count(axes) == len(plan_cells) == 6
    assert [cell.values["imu.gyroscope_noise_density"] for cell in plan_cells[:3]] == [
        1e-4,
        1e-3,
        1e-2,
    ]
    assert plan_cells[3].name == "imu=bmi088, imu.gyroscope_noise_density=0.0001"
    assert plan_cells[3].layer() == {"imu.preset": "bmi088", "imu.gyroscope_noise_density": 1e-4}


def test_zipped_axes_change_together():
    axes = read_axes({"noise": {"zip": {"rate": [100, 200], "duration": [1, 2]}}})
    assert [cell.values for cell in cells(axes)] == [
        {"rate": 100, "duration": 1},
        {"rate": 200, "duration": 2},
    ]


def test_one_of_zipped_parameters_may_have_a_value_twice():
    zipped = {"rate": [100, 100, 200], "duration": [1, 2, 2]}
    assert len(read_axes({"noise": {"zip": zipped}})[0].rows) == 3


@pytest.mark.parametrize(
    ("grid", "line"),
    [
        ([1], "grid = .*must hold names"),
        ({"rate": []}, "grid.rate = .*must be a list of values"),
        ({"rate": 5}, "grid.rate = 5: must be a list"),
        ({"rate": [1, 1.0]}, "grid.rate: 1: given twice"),
        ({"z": {"zip": {"rate": [1, 1], "seed": [2, 2]}}}, r"z.zip: \[1, 2\]: given twice"),
        ({"rate": {"log_range": [0, 1, 3]}}, "log_range = .*two numbers above 0"),
        ({"rate": {"range": [1, 2, 1]}}, "and a count of 2 to"),
        ({"rate": {"range": [1, float("nan"), 4]}}, "two finite numbers"),
        ({"z": {"zip": {"rate": [1, 2], "seed": [1]}}}, "equally long: rate 2, seed 1"),
        ({"rate": [1], "z": {"zip": {"rate": [2]}}}, "grid.rate: given twice"),
        ({"rate": [{"a": 1}]}, "must hold plain values"),
    ],
)
def test_bad_grids_say_what_is_wrong(grid, line):
    with pytest.raises(ConfigurationError, match=line):
        read_axes(grid)


def test_all_problems_of_a_plan_come_together(plan_file):
    path = plan_file(seeds=0, retries=-1, keep="some", grid={"rate": 5})
    with pytest.raises(ConfigurationError) as caught:
        load_plan(path)
    text = "\n".join(caught.value.problems)
    for start in ("retries = -1: must be", "keep = 'some': must be", "seeds = 0:", "grid.rate = 5"):
        assert f"{path}: {start}" in text
    bad = {"rate": -1.0, "duration": 2.0}
    with pytest.raises(ConfigurationError) as caught:
        check_cells(load_plan(plan_file(parameters=bad, grid={"imu": ["adis16448", "nosuch"]})))
    text = "\n".join(caught.value.problems)
    assert "rate = -1.0: must be" in text
    assert "grid.imu = nosuch: " in text


@pytest.mark.parametrize(
    ("content", "line"),
    [
        ({"seeds": 0}, "seeds = 0: must be at least 1"),
        (
            {"faults": [{"kind": "stuck", "triad": "magnetometer", "at": 1.0}]},
            "triad = magnetometer: a campaign simulates the IMU alone",
        ),
        ({"seeds": [1, 1]}, "a seed is given twice"),
        ({"seeds": [-1]}, "each at least 0"),
        ({"seeds": True}, "must be a count"),
        ({"grids": {}}, "grids: unknown parameter"),
        ({"parameters": {"seed": 3}}, "seed: is given by seeds"),
        (
            {"parameters": {"rate": 1.0}, "grid": {"rate": [1, 2]}},
            "grid.rate: is also in parameters",
        ),
        ({"faults": [{"kind": "explosion"}]}, r"faults\[0\]: fault kind = 'explosion'"),
        ({"faults": [{"kind": "stuck", "when": 1}]}, r"faults\[0\]: when: unknown"),
        ({"faults": [{"kind": "stuck", "at": "soon"}]}, "at = 'soon': must be a time"),
        ({"estimators": {"../x": {}}}, "a name may contain letters, digits"),
        ({"estimators": {"<script>": {}}}, "a name may contain letters, digits"),
        ({"estimators": {"a": {"method": "simpson"}}}, "estimators.a: method = 'simpson'"),
        ({"estimators": {"a": {"command": ""}}}, "command = '': must name a program"),
        ({"estimators": {"a": {"command": "x {dataset} {home}"}}}, "{home}: must be one of"),
        ({"estimators": {"a": {"command": "x", "timeout": float("inf")}}}, "timeout = inf"),
        ({"estimators": {"a": {"command": "x", "environment": [1]}}}, "must hold names and str"),
        ({"rpe": ["1h"]}, "rpe: '1h'"),
        ({"rpe": ["0m"]}, "must be a time or distance"),
        ({"require": ["ate_rmse_m < 1"]}, "the statistic '': must be one of"),
        ({"require": ["nonsense.p95 < 1"]}, "nonsense: must be one of success, "),
        ({"require": ["__import__('os').system('x') < 1"]}, "must be METRIC.STATISTIC"),
        ({"require": ["success >= 0.9 @ sensor=x"]}, "must be NAME=VALUE with one of"),
    ],
)
def test_bad_plans_say_what_is_wrong(content, line):
    with pytest.raises(ConfigurationError, match=line):
        read_plan({**BASE, **content})


def test_a_bad_value_of_the_grid_is_one_line(plan_file, campaign, tmp_path):
    """However many cells have it, and with its place in the grid."""
    grid = {
        "imu": ["mpu6000", "bmi08", "nothing like any"],
        "trajectory": ["circle", "figure_eigt", "lecture"],
        "imu.gyroscope_noise_density": [1e-3, -1e-3, 2e-3],
        "imu.gyroscope_noise_densty": [0.1, 0.2],
    }
    status, _, lines = campaign(plan_file(grid=grid), "-o", tmp_path / "out")
    assert status == 2
    problems = sorted(line.partition("plan.yaml: ")[2] for line in lines)
    beginnings = [
        "grid.imu = bmi08: unknown IMU 'bmi08'; did you mean bmi088?",
        "grid.imu = nothing like any: unknown IMU 'nothing like any'; neither a file nor one of",
        "grid.imu.gyroscope_noise_density = -0.001: must be a finite number",
        "grid.imu.gyroscope_noise_densty: unknown parameter; did you mean imu.gyroscope_noise_",
        "grid.trajectory = figure_eigt: unknown trajectory 'figure_eigt'; did you mean figure_e",
    ]
    assert len(problems) == len(beginnings)
    for line, beginning in zip(problems, beginnings, strict=True):
        assert line.startswith(beginning)


def test_requirements_are_read_with_filters():
    axes = [Axis(("imu",), (("a b",), ("c",)))]
    (requirement,) = parse(
        ["ate_rmse_m.p95 <= 1e-1 @ imu=a b, estimator=x"], ["ate_rmse_m"], axes, ["x", "y"]
    )
    assert (requirement.metric, requirement.statistic, requirement.limit) == (
        "ate_rmse_m",
        "p95",
        0.1,
    )
    assert requirement.filters == (("imu", "a b"), ("estimator", "x"))
    assert requirement.concerns({"imu": "a b", "estimator": "x"})
    assert not requirement.concerns({"imu": "a b", "estimator": "y"})
    assert requirement.holds(0.1)
    assert not requirement.holds(0.11)
    assert not requirement.holds(None)
    assert not requirement.done_only


@pytest.mark.parametrize(
    "text", ["ate_rmse_m.max of done < 1", "ate_rmse_m.max < 1 of done @ imu=c"]
)
def test_a_requirement_may_ask_for_the_runs_that_are_done(text):
    (requirement,) = parse([text], ["ate_rmse_m"], [Axis(("imu",), (("c",),))], ["x"])
    assert (requirement.done_only, requirement.statistic, requirement.limit) == (True, "max", 1.0)


@pytest.mark.parametrize(
    ("requirement", "line"),
    [
        ("success >= 0.9 @ estimator=nosuch", "require: estimator=nosuch: must be one of mine"),
        ("success >= 0.9 @ imu=bmi08", "require: imu=bmi08: must be one of "),
        ("coverage.min > 0.1 @ rate=300", "require: rate=300: must be one of 100, 200"),
        ("success >= 0.9 @ rate=100, duration=2", "require: rate=100, duration=2: no cell has the"),
        (
            "success >= 98",
            "require: 'success >= 98': success is a share, whose limit must be at le",
        ),
        ("success < -0.1", "require: 'success < -0.1': success is a share"),
        ("coverage.p5 > 1.01", "require: 'coverage.p5 > 1.01': coverage is a share"),
        ("success of done > 0.5", "require: success of done: success is the share of all runs"),
    ],
)
def test_check_finds_requirements_that_no_run_can_meet(plan_file, capsys, requirement, line):
    together = {"zip": {"rate": [100.0, 200.0], "duration": [1.0, 2.0]}}
    path = plan_file(
        parameters={},
        grid={"imu": ["bmi088", "perfect"], "a": together},
        estimators={"mine": {}},
        require=[requirement],
    )
    assert command([str(path), "--check"]) == 2
    assert f"plan.yaml: {line}" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["obj", "gltf"])
def test_the_digest_holds_a_mesh_with_materials_and_textures(tmp_path, kind):
    texts = {
        "a.obj": "mtllib m.mtl\nv 0 0 0\n",
        "m.mtl": "newmtl m\nmap_Kd -s 1 1 1 wall.png\n",
        "a.gltf": '{"images": [{"uri": "wall.png"}, {"uri": "data:,"}], "buffers": []}',
        "wall.png": "one",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    values = {"scene.mesh": str(tmp_path / f"a.{kind}")}
    digests_before = file_digests(values)
    (tmp_path / "unnamed.png").write_text("two")
    assert file_digests(values) == digests_before
    (tmp_path / "wall.png").write_text("two")
    assert file_digests(values) != digests_before


def test_the_digest_tells_what_changes_numbers_from_what_does_not(plan_file):
    def digest(**content):
        plan = load_plan(plan_file(**content))
        cell = next(plan.cells())
        return plan.digest(plan.simulation(cell), "dead_reckon")

    plan_digest = digest()
    assert digest(seeds=7, name="other", require=["success >= 0.5"]) == plan_digest
    assert digest(parameters={"rate": 100.0, "duration": 3.0, "imu": "adis16448"}) != plan_digest
    assert digest(faults=[{"kind": "stuck", "triad": "gyroscope", "at": 1.0}]) != plan_digest
    assert digest(rpe=["1s"]) != plan_digest
    assert digest(estimators={"dead_reckon": {"method": "euler"}}) != plan_digest


@pytest.mark.parametrize("name", files.names("estimators"))
def test_every_template_is_a_command_that_a_shell_can_read(plan_file, name):
    """Templates have all placeholders filled; the programs themselves are not installed here."""
    plan = load_plan(
        plan_file(
            parameters={"camera": "euroc_cam0", "camera.body_axes": "flu"},
            estimators={"one": {"template": name}},
        )
    )
    check_cells(plan)
    command = re.sub(r"{\w+}", "/x", plan.estimators["one"].command)
    assert "{share}" not in command
    subprocess.run(["/bin/sh", "-n", "-c", command], check=True)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("2020-01-01: 1\ncommand: 'true'\n", "estimators.one: 2020-01-01: unknown parameter"),
        ("1.5: 1\ncommand: 'true'\n", "estimators.one: 1.5: unknown parameter"),
        ("command: 2020-01-01\n", "estimators.one: command = "),
        ("[a]: 1\n", "estimators.one: "),
    ],
)
def test_a_template_with_keys_that_are_no_names_is_told_in_a_line(
    plan_file, tmp_path, text, problem
):
    template = tmp_path / "template.yaml"
    template.write_text(text)
    with pytest.raises(ConfigurationError) as caught:
        load_plan(plan_file(estimators={"one": {"template": str(template)}}))
    (line,) = caught.value.problems
    assert problem in line


@pytest.mark.parametrize("name", files.names("campaigns"))
def test_every_plan_of_the_package_is_sound(name):
    path = find_plan(name)
    check_plan(load_plan(path), path)


def test_which_imu_asks_every_preset():
    (imu, motion) = load_plan(find_plan("which_imu")).axes
    assert sorted(value for (value,) in imu.rows) == files.names("imus")
    assert len(motion.rows) == 3


def test_all_stands_for_every_file_of_the_package(plan_file):
    plan = load_plan(plan_file(grid={"imu": "all", "gnss": "all"}))
    axis_values = {axis.names: [value for (value,) in axis.rows] for axis in plan.axes}
    assert axis_values == {("imu",): files.names("imus"), ("gnss",): files.names("gnss")}
    with pytest.raises(ConfigurationError, match=r"grid.rate = 'all': must be a list of values"):
        load_plan(plan_file(grid={"rate": "all"}))


def test_presets_of_sensors_of_the_body_add_up(plan_file):
    plan = load_plan(
        plan_file(parameters={"gnss": "phone"}, grid={"wheels": ["husky_a200", "f1tenth"]})
    )
    for cell, radius in zip(plan.cells(), (0.1651, 0.05), strict=True):
        parameters = plan.simulation(cell)
        assert parameters.sensors == ("gnss", "wheels")
        assert parameters.wheels.radius == pytest.approx(radius, abs=0.02)
        assert parameters.gnss.horizontal_sigma[0] > 1.0


def test_several_sensors_and_cameras_are_named_as_by_generate(plan_file):
    sensor_names = {"gnss": ["phone", "zed_f9p"], "camera": ["euroc_cam0", "euroc_cam1"]}
    plan = load_plan(
        plan_file(parameters={"duration": 1.0, "camera.images": "none", **sensor_names})
    )
    (cell,) = plan.cells()
    parameters = plan.simulation(cell)
    assert parameters.sensors == ("gnss", "gnss1")
    assert parameters.each_sensor["gnss1"].preset == "zed_f9p"
    assert parameters.cameras == ("cam0", "cam1")
