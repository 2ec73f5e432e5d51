# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameter files: ROS 2's form, kalibr's form, layering, and everything that can be wrong."""

import os
import random
import string
from pathlib import Path

import pytest
import yaml

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.yaml_output import as_yaml
from imu_sim_ros.navigation.parameters import load_integrator
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.parameters import trajectory_layer


def write_text(tmp_path, text, name="parameters.yaml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_wildcards_lie_below_the_nodes_own_section(tmp_path):
    path = write_text(
        tmp_path,
        "/left/simulator:\n  ros__parameters:\n    rate: 100.0\n"
        "/**:\n  ros__parameters:\n    rate: 50.0\n    imu: {gyroscope_bias: [1.0, 2.0, 3.0]}\n"
        "integrator:\n  ros__parameters: {method: euler}\n",
    )
    assert files.load(path) == {"rate": 100.0, "imu.gyroscope_bias": [1.0, 2.0, 3.0]}
    assert files.load(path, "integrator")["method"] == "euler"


def test_numbers_are_read_as_ros_reads_them(tmp_path):
    """YAML 1.1 would make a text of 5e-4 and 1E5."""
    path = write_text(
        tmp_path, "/**:\n  ros__parameters: {a: 5e-4, b: 1E5, c: -2e+3, d: .5e1, e: e5}"
    )
    assert files.load(path) == {"a": 5e-4, "b": 1e5, "c": -2e3, "d": 5.0, "e": "e5"}


def test_a_kalibr_file_gives_noise_and_rate(tmp_path):
    path = write_text(
        tmp_path,
        "accelerometer_noise_density: 1.86e-03\naccelerometer_random_walk: 4.33e-04\n"
        "gyroscope_noise_density: 1.87e-04\ngyroscope_random_walk: 2.66e-05\n"
        "rostopic: /imu0\nupdate_rate: 100.0\n",
        "imu.yaml",
    )
    simulation = load_simulation({"imu.preset": str(path), "trajectory.type": "static"})
    assert simulation.rate == 100.0
    assert simulation.imu.gyroscope.noise_density == (1.87e-4,) * 3


def test_presets_lie_below_what_is_set(tmp_path):
    simulation = load_simulation(
        {"imu.preset": "lecture", "trajectory.type": "static"},
        {"imu.gyroscope_noise_density": [0.1, 0.2, 0.3]},
    )
    assert simulation.imu.gyroscope.noise_density == (0.1, 0.2, 0.3)
    assert simulation.imu.accelerometer.noise_density == (0.019,) * 3


@pytest.mark.parametrize("preset", files.names("imus"))
def test_every_preset_loads(preset):
    load_simulation({"imu.preset": preset, "trajectory.type": "static"})


@pytest.mark.parametrize("trajectory", files.names("trajectories"))
def test_every_trajectory_loads_and_round_trips(trajectory, tmp_path):
    simulation = load_simulation({"trajectory.type": trajectory})
    files.dump(simulation, tmp_path / "all.yaml", comment="Every value\nof a simulation.")
    assert flatten(load_simulation(files.load(tmp_path / "all.yaml"))) == flatten(simulation)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "is empty, not a ROS 2 parameter file"),
        ("# nothing\n---\n", "is empty, not a ROS 2 parameter file"),
        ("imu0:\n\trate: 1\n", "line 2 is indented with a tab: YAML needs spaces"),
        ("a: 1\n---\na: 2\n", "another document begins in line 2"),
        ("- 1\n- 2\n", "not a ROS 2 parameter file"),
        ("/**: {ros__parameters: [1, 2]}", "must hold names and values"),
        ("/**:\n  parameters: {}\n", "must hold ros__parameters"),
        ("other:\n  ros__parameters: {}\n", "no section for the node simulator"),
        (
            "cam0:\n  camera_model: pinhole\n  intrinsics: [458.6, 457.3, 367.2, 248.4]\n"
            "cam1:\n  camera_model: pinhole\n  intrinsics: [457.6, 456.1, 380.0, 255.2]\n",
            r"camera chain of kalibr or OpenVINS \(cam0, cam1\): give it as camera=... or camera",
        ),
        ("/**: [unclosed\n", "not a YAML file"),
        ("a: &a [*a]\n", "contains itself"),
        ("/**:\n  ros__parameters:\n    x: !!python/object/apply:os.system [ls]\n", "not a YAML"),
        ("\x00", "not a YAML file"),
    ],
)
def test_a_bad_file_is_one_line_that_names_it(tmp_path, text, reason):
    path = write_text(tmp_path, text)
    with pytest.raises(ConfigurationError, match=reason) as error:
        files.load(path)
    (line,) = error.value.problems
    assert line.startswith(str(path))
    assert "\n" not in line


def test_unreadable_places_are_named(tmp_path):
    with pytest.raises(ConfigurationError, match="No such file"):
        files.load(tmp_path / "missing.yaml")
    with pytest.raises(ConfigurationError, match="directory"):
        files.load(tmp_path)
    (tmp_path / "latin1.yaml").write_bytes(b"/**: {ros__parameters: {a: \xff}}")
    with pytest.raises(ConfigurationError, match="not a text file in UTF-8"):
        files.load(tmp_path / "latin1.yaml")


def test_an_unknown_preset_lists_all():
    with pytest.raises(
        ConfigurationError, match="unknown IMU 'nonsense'; neither a file .*lecture"
    ):
        load_simulation({"imu.preset": "nonsense"})
    with pytest.raises(ConfigurationError, match="unknown trajectory 'nonsense'; .*static"):
        trajectory_layer("nonsense")


def test_an_unknown_preset_hides_no_other_problem():
    with pytest.raises(ConfigurationError) as error:
        load_simulation({"imu.preset": "nonsense"}, {"rate": -1.0, "sed": 1})
    assert [line.split(" ")[0] for line in error.value.problems] == ["unknown", "sed:", "rate"]


def chain(tmp_path):
    """Return a sensor's file whose preset is a file whose preset is a name."""
    inner_path = write_text(
        tmp_path,
        "/**:\n  ros__parameters:\n    imu: {preset: mpu6000, gyroscope_bias: [0.1, 0.2, 0.3]}\n",
        "first.yaml",
    )
    return write_text(
        tmp_path,
        f"/**:\n  ros__parameters:\n    imu: {{preset: {inner_path}, accelerometer_bias: 0.5}}\n",
        "second.yaml",
    )


def test_a_sensor_file_lies_above_the_preset_that_it_names(tmp_path):
    """``--imu FILE`` takes the preset within FILE as ``--params-file FILE`` does."""
    path = chain(tmp_path)
    short = load_simulation({"imu.preset": str(path)}).imu
    layered = load_simulation(files.load(path)).imu
    assert short.gyroscope.noise_density == (6.1707e-5,) * 3
    assert short.gyroscope.bias == (0.1, 0.2, 0.3)
    assert short.accelerometer.bias == (0.5,) * 3
    assert flatten(short) | {"preset": ""} == flatten(layered) | {"preset": ""}


def test_the_integrator_takes_the_noise_of_a_chain_of_presets(tmp_path):
    parameters = load_integrator({"imu.preset": str(chain(tmp_path))})
    assert parameters.imu.gyroscope.noise_density == (6.1707e-5,) * 3


def test_presets_in_a_circle_are_said(tmp_path):
    path = tmp_path / "a.yaml"
    write_text(tmp_path, f"/**:\n  ros__parameters:\n    imu: {{preset: {path}}}\n", "a.yaml")
    with pytest.raises(ConfigurationError, match="leads back to this file"):
        load_simulation({"imu.preset": str(path)})


def test_a_file_of_all_parameters_is_a_sensors_file_too(tmp_path):
    """The motion of a preset counts where no other is named, and is left out where one is."""
    whole = load_simulation({"trajectory.type": "coning", "imu.preset": "bmi088"})
    files.dump(whole, tmp_path / "whole.yaml")
    path = str(tmp_path / "whole.yaml")
    again = load_simulation({"imu.preset": path})
    assert flatten(again) | {"imu.preset": "bmi088"} == flatten(whole)
    still = load_simulation({"imu.preset": path, "trajectory.type": "static"})
    assert still.trajectory.type == "static"
    assert still.imu.gyroscope.noise_density == whole.imu.gyroscope.noise_density


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("/**:\n  ros__parameters: {rate: 1.0, rate: 2.0}\n", "'rate' is given twice"),
        ("/**:\n  ros__parameters: {rate: 1.0}\n/**:\n  ros__parameters: {}\n", "is given twice"),
        (
            "/**:\n  ros__parameters:\n    imu.preset: lecture\n    imu: {preset: perfect}\n",
            "imu.preset is given twice, dotted and nested",
        ),
        ("/**:\n  ros__parameters: []\n", "must hold names and values"),
        ("/**:\n  ros__parameters: 0\n", "must hold names and values"),
        ("[" * 5000, "nested over 32 deep|maximum nesting depth"),
        ("{a: " * 5000, "nested over 32 deep|maximum nesting depth"),
        ("/**: &a\n  ros__parameters: *a\n", "recursive|contains itself"),
        ("a: &a [1]\nb: [" + "*a, " * 200 + "]", "over 100 aliases"),
        ("a: " + "9" * 5000, "a number of 5000 letters"),
        ("a: !!timestamp 1", "not a YAML file"),
        ("a: !!bool x", "not a YAML file"),
        ("a: 2020-99-99", "month must be in"),
        ("a: !!python/object/apply:os.system [ls]", "could not determine a constructor"),
    ],
)
def test_what_hides_or_explodes_is_refused(tmp_path, text, reason):
    with pytest.raises(ConfigurationError, match=reason) as caught:
        files.load(write_text(tmp_path, text))
    assert len(caught.value.problems) == 1
    assert len(str(caught.value)) < 500


def test_lists_that_grow_by_repetition_are_refused_before_they_do(tmp_path):
    """Nine lists of nine of the list before: 9^9 values from 300 bytes."""
    rows = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    rows += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 10)]
    with pytest.raises(ConfigurationError, match="over 200,000 values"):
        files.load(write_text(tmp_path, "\n".join(rows)))


def test_numbers_that_begin_with_a_point(tmp_path):
    path = write_text(tmp_path, "/**:\n  ros__parameters: {a: [.4,-.2], b: -.5, c: +.25, d: .}\n")
    assert files.load(path) == {"a": [0.4, -0.2], "b": -0.5, "c": 0.25, "d": "."}


def test_devices_pipes_and_floods_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    for path in ("/dev/zero", tmp_path / "pipe.yaml"):
        with pytest.raises(ConfigurationError, match="is a device or a pipe, not a file"):
            files.load(path)
    flood = write_text(tmp_path, "# " + "x" * (17 << 20))
    with pytest.raises(ConfigurationError, match="larger than 16 MiB"):
        files.load(flood)
    latin = tmp_path / "latin.yaml"
    latin.write_bytes(b"a: \xe9")
    with pytest.raises(ConfigurationError, match="not a text file in UTF-8"):
        files.load(latin)


def test_the_text_does_not_depend_on_libyaml(monkeypatch):
    generator = random.Random(1)
    strings = [
        "yes",
        "~",
        "1e5",
        "-",
        "%x",
        "a: b",
        "a #b",
        "it's",
        '"q"',
        "",
        " x ",
        "a\tb",
        "\u00e4",
    ]
    strings += ["word " * 40, "x" * 200, "C:\\temp", "# no comment", "[a]", "1:30", "a\nb", "\x85"]
    letters = string.printable[:95] + "\u00e4\u20ac"
    strings += ["".join(generator.choices(letters, k=120)) for _ in range(9)]
    numbers = [0.0, -0.0, 1e22, 5e-324, 0.1, -17, 2**70, True, 1.0e16, 123456.789]
    many = {
        f"{'abc'[k % 3]}.n{k}": generator.choice(
            [
                generator.choice(strings),
                generator.choice(numbers),
                tuple(generator.choices(numbers, k=9)),
                tuple(generator.choices(strings, k=3)),
            ]
        )
        for k in range(60)
    }
    for values in ({name: value} for name, value in many.items()):
        fast, fast_blocks = files.text(values), as_yaml(values)
        with monkeypatch.context() as changed:
            changed.setattr(yaml, "__with_libyaml__", False)
            assert files.text(values) == fast
            assert as_yaml(values) == fast_blocks


def test_a_relative_path_in_a_file_is_that_of_a_file_next_to_it(tmp_path, monkeypatch):
    """Wherever the program runs, and whichever program reads it."""
    (tmp_path / "given" / "deep").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    for name in ("m.obj", "deep/route.gpx", "i.yaml", "model.sdf", "mpu6000"):
        (tmp_path / "given" / name).touch()
    path = Path("given/file.yaml")
    path.write_text(
        "/**:\n  ros__parameters:\n    scene: {mesh: m.obj}\n    trajectory.type: deep/route.gpx\n"
        "    gnss.ephemeris: away.nav\n    imu.preset: model.sdf#imu\n"
        "    left.imu.preset: mpu6000\n"
        "    calibration: i.yaml\n    world_frame: m.obj\n    trajectory.file: /given/m.obj\n"
    )
    assert files.load(path) == {
        "scene.mesh": "given/m.obj",
        "trajectory.type": "given/deep/route.gpx",
        "gnss.ephemeris": "away.nav",
        "imu.preset": "given/model.sdf#imu",
        "left.imu.preset": "mpu6000",
        "calibration": "given/i.yaml",
        "world_frame": "m.obj",
        "trajectory.file": "/given/m.obj",
    }
