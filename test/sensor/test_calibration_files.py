# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""IMU files of kalibr, OpenVINS, EuRoC, Kimera-VIO and maplab: all keys are used or named.

Intrinsics are compared with the tool's own model, written down again, applied to true readings.
"""

import numpy as np
import pytest
import yaml

import imu_sim_ros as ims
from imu_sim_ros.commands import dead_reckon, generate
from imu_sim_ros.core.errors import ConfigurationError, Remark
from imu_sim_ros.core.rotation import exp, to_matrix
from imu_sim_ros.sensors.imu import presets
from imu_sim_ros.simulation.parameters import load_simulation

NOISE = {
    "accelerometer_noise_density": 0.002,
    "accelerometer_random_walk": 0.003,
    "gyroscope_noise_density": 2e-4,
    "gyroscope_random_walk": 2e-5,
}
SILENT = dict.fromkeys(NOISE, 0.0)
RATE = {"update_rate": 200.0}
IDENTITY = np.eye(4).tolist()
EYE = np.eye(3).tolist()
M = [[1.01, 0.0, 0.0], [0.002, 0.99, 0.0], [0.001, 0.003, 1.005]]
M_GYRO = [[0.98, 0.0, 0.0], [-0.004, 1.02, 0.0], [0.006, -0.001, 1.01]]
A = [[1e-3, 2e-4, 0.0], [-3e-4, 5e-4, 1e-4], [0.0, 2e-4, -8e-4]]
TURN = to_matrix(exp(np.array([0.02, -0.01, 0.03]))).tolist()
FULL = [[1.01, 0.02, -0.01], [0.03, 0.98, 0.015], [-0.02, 0.01, 1.02]]


def write(folder, content, name="imu.yaml", head=""):
    path = folder / name
    path.write_text(head + yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return path


def remarks(path, **arguments):
    with pytest.warns(Remark) as caught:
        values = presets.load(path, **arguments)
    return values, " ".join(str(warning.message) for warning in caught)


def flight(path, **arguments):
    return ims.simulate(imu=path, trajectory="figure_eight", duration=2, seed=3, **arguments)


@pytest.mark.parametrize("nested", [True, False])
def test_kalibr_intrinsics_give_the_readings_of_its_model(tmp_path, nested):
    """IccScaledMisalignedImu: w = M C w_i + A C a_i, a = M a_i; the truth is recovered."""
    content = {
        **SILENT,
        **RATE,
        "model": "scale-misalignment",
        "accelerometers": {"M": M},
        "gyroscopes": {"M": M_GYRO, "A": A, "C_gyro_i": TURN},
        "T_i_b": IDENTITY,
        "time_offset": 0.0,
    }
    path = write(tmp_path, {"imu0": content} if nested else content)
    run, true = flight(path), flight("perfect", rate=200)
    m, m_gyro, a, c = map(np.array, (M, M_GYRO, A, TURN))
    force = np.linalg.solve(m, run.accel.T)
    rate = np.linalg.solve(m_gyro @ c, run.gyro.T - a @ c @ force)
    np.testing.assert_allclose(force.T, true.accel, atol=1e-12)
    np.testing.assert_allclose(rate.T, true.gyro, atol=1e-12)
    assert np.abs(run.gyro - true.gyro).max() > 1e-3


def test_kalibr_size_effect_is_the_acceleration_of_each_place(tmp_path):
    """IccScaledMisalignedSizeEffectImu: axis k reads as an IMU at r_k does."""
    places = {"rx_i": [0.0, 0.0, 0.0], "ry_i": [0.03, -0.01, 0.0], "rz_i": [0.0, 0.02, 0.05]}
    path = write(tmp_path, {**SILENT, **RATE, "accelerometers": {"M": EYE, **places}})
    run = flight(path)
    for axis, place in enumerate(places.values()):
        element = flight({"preset": "perfect", "lever_arm": place}, rate=200)
        np.testing.assert_allclose(run.accel[:, axis], element.accel[:, axis], atol=1e-9)


@pytest.mark.parametrize(("model", "part"), [("kalibr", np.tril), ("rpng", np.triu)])
def test_openvins_intrinsics_give_the_readings_of_its_simulator(tmp_path, model, part):
    """Simulator.cpp: the inverse of a triangle D of the inverse of T, then R; T_g a is added."""
    content = {
        **SILENT,
        **RATE,
        "model": model,
        "Tw": FULL,
        "R_IMUtoGYRO": TURN,
        "Ta": M,
        "R_IMUtoACC": np.transpose(TURN).tolist(),
        "Tg": A,
    }
    path = write(tmp_path, {"imu0": content}, head="%YAML:1.0 # file of OpenCV\n\n")
    with pytest.warns(Remark, match="triangle of the inverse of Tw"):
        run, true = flight(path), flight("perfect", rate=200)
    d_gyro, d_accel = part(np.linalg.inv(FULL)), part(np.linalg.inv(M))
    force = (d_accel @ run.accel.T).T @ np.array(TURN).T
    np.testing.assert_allclose(force, true.accel, atol=1e-11)
    rate = np.array(TURN).T @ d_gyro @ (run.gyro.T - np.array(A) @ force.T)
    np.testing.assert_allclose(rate.T, true.gyro, atol=1e-11)


def test_the_own_chain_of_openvins_is_the_sensor_that_it_was_written_from(tmp_path):
    """The chain has the realised scale and g-sensitivity, all densities, and the rate."""
    changes = ["--set", "imu.gyroscope_scale_misalignment=[1.01,0.02,0,0.01,0.99,0.003,0,0,1]"]
    changes += ["--set", "imu.gyroscope_g_sensitivity=[1e-4,0,0,0,2e-4,0,0,0,0]", "--rate", "250"]
    arguments = ["--imu", "adis16448", "--duration", "1s", "--quiet", "--with-configs", *changes]
    assert generate.main(["-o", str(tmp_path / "run"), *arguments]) == 0
    chain = tmp_path / "run_configs" / "kalibr_imu_chain.yaml"
    with pytest.warns(Remark, match="rostopic"):
        again = load_simulation({"imu.preset": str(chain)})
    truth = load_simulation(presets.load(tmp_path / "run_truth.yaml"))
    assert again.rate == 250.0
    for triad in ("gyroscope", "accelerometer"):
        chain_triad, true_triad = again.imu.triad(triad), truth.imu.triad(triad)
        for name in ("noise_density", "random_walk"):
            np.testing.assert_allclose(
                getattr(chain_triad, name), getattr(true_triad, name), rtol=1e-11
            )
        np.testing.assert_allclose(chain_triad.response(), true_triad.response(), atol=1e-11)
    np.testing.assert_allclose(again.imu.gyroscope.g_sensitivity, [1e-4, 0, 0, 0, 2e-4, 0, 0, 0, 0])


def test_the_second_imu_of_a_result_of_kalibr_has_its_mount_and_its_clock(tmp_path):
    """T_i_b maps the body to the IMU; the reading of stamp t is that of t + time_offset."""
    t_ib = np.eye(4)
    t_ib[:3, :3], t_ib[:3, 3] = TURN, [0.1, -0.2, 0.05]
    imus = {
        "imu0": {**NOISE, **RATE},
        "imu1": {**SILENT, **RATE, "T_i_b": t_ib.tolist(), "time_offset": 0.004},
    }
    path = write(tmp_path, imus)
    with pytest.raises(ConfigurationError, match=f"several IMUs, name one of imu0, imu1: {path}#"):
        presets.load(path)
    with pytest.raises(ConfigurationError, match="has no IMU 'imu2'; it has imu0, imu1"):
        presets.load(f"{path}#imu2")
    run = flight(f"{path}#imu1")
    mount = np.eye(4)
    mount[:3, :3] = np.reshape(run.parameters.imu.mounting, (3, 3))
    mount[:3, 3] = run.parameters.imu.lever_arm
    np.testing.assert_allclose(mount @ t_ib, np.eye(4), atol=1e-12)
    body = flight("perfect", rate=200)
    np.testing.assert_allclose(run.gyro, body.gyro @ np.array(TURN).T, atol=1e-12)
    assert np.all(run.t_ns + 4_000_000 == body.t_ns)


FORMS = {
    "EuRoC": (
        "",
        {
            "sensor_type": "imu",
            "comment": "VI-Sensor IMU",
            "T_BS": {"cols": 4, "rows": 4, "data": np.ravel(IDENTITY).tolist()},
            "rate_hz": 200,
            **NOISE,
        },
        {"comment"},
    ),
    "Kimera-VIO": (
        "%YAML:1.0\n",
        {
            "imu_preintegration_type": 1,
            "T_BS": {"cols": 4, "rows": 4, "data": np.ravel(IDENTITY).tolist()},
            "rate_hz": 200,
            **NOISE,
            "imu_integration_sigma": 1e-8,
            "imu_time_shift": 0.0,
            "imu_bias_init_sigma": 1e-3,
            "do_imu_rate_time_alignment": 1,
            "time_alignment_window_size_s": 10.0,
            "time_alignment_variance_threshold_scaling": 30.0,
            "n_gravity": [0.0, 0.0, -9.81],
        },
        {
            *("imu_preintegration_type", "imu_integration_sigma", "imu_bias_init_sigma"),
            *("imu_time_shift", "do_imu_rate_time_alignment", "time_alignment_window_size_s"),
            "time_alignment_variance_threshold_scaling",
        },
    ),
    "maplab": (
        "",
        {
            "id": "c63aecb41bfdfd6b",
            "hardware_id": "/imu0",
            "sensor_type": "IMU",
            "sigmas": {
                "gyro_noise_density": NOISE["gyroscope_noise_density"],
                "gyro_bias_random_walk_noise_density": NOISE["gyroscope_random_walk"],
                "acc_noise_density": NOISE["accelerometer_noise_density"],
                "acc_bias_random_walk_noise_density": NOISE["accelerometer_random_walk"],
            },
            "saturation_accel_max_mps2": 150.0,
            "saturation_gyro_max_radps": 7.5,
            "gravity_magnitude_mps2": 9.81,
        },
        {"id", "hardware_id"},
    ),
    "OpenVINS": (
        "%YAML:1.0\n---\n",
        {
            "imu0": {
                "T_i_b": IDENTITY,
                **NOISE,
                "rostopic": "/imu0",
                "time_offset": 0.0,
                **RATE,
                "model": "kalibr",
                **dict.fromkeys(("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC"), EYE),
                "Tg": np.zeros((3, 3)).tolist(),
            }
        },
        {"rostopic"},
    ),
    "kalibr": ("", {**NOISE, "rostopic": "/imu0", **RATE}, {"rostopic"}),
}


@pytest.mark.parametrize("tool", FORMS)
def test_every_key_of_a_tool_is_used_or_named(tmp_path, tool):
    """And each of them with a typing error is refused with the nearest name."""
    head, content, unused = FORMS[tool]
    values, line = remarks(write(tmp_path, content, head=head))
    keys = content.get("imu0", content)
    assert {key for key in keys if f"{key} = " in line} == unused
    assert not {f"imu.{name}" for name in NOISE} - set(values)
    for name, density in NOISE.items():
        assert values[f"imu.{name}"] == density
    assert "not given" not in line
    if "rate_hz" in keys or "update_rate" in keys:
        assert values["rate"] == 200.0
    if tool == "maplab":
        assert values["imu.gyroscope_range"] == 7.5
        assert values["imu.accelerometer_range"] == 150.0
        assert values["gravity"] == 9.81
    if tool == "Kimera-VIO":
        assert values["gravity"] == [0.0, 0.0, -9.81]
    for key in keys:
        typo = key[:-2] + key[-1]
        wrong = {typo if name == key else name: value for name, value in keys.items()}
        path = write(tmp_path, {"imu0": wrong} if "imu0" in content else wrong, "typo.yaml", head)
        if len(key) > 3:
            with pytest.raises(ConfigurationError, match=rf"{typo}: unknown key; did you mean"):
                presets.load(path)


@pytest.mark.parametrize("name", NOISE)
def test_a_missing_noise_is_named(tmp_path, name):
    keys = {key: value for key, value in {**NOISE, **RATE}.items() if key != name}
    values, line = remarks(write(tmp_path, keys))
    assert f"imu.yaml: {name}: not given, so 0" in line
    assert f"imu.{name}" not in values


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"T_i_b": [[1, 0], [0, 1]]}, "T_i_b = .*: must be 4 x 4 finite numbers"),
        ({"T_BS": np.diag([1.0, 1.0, -1.0, 1.0]).tolist()}, "T_BS: must be a rigid motion"),
        ({"T_BS": np.diag([2.0, 1.0, 1.0, 1.0]).tolist()}, "T_BS: must be a rigid motion"),
        ({"model": "kalbr"}, "model = 'kalbr': .*did you mean kalibr"),
        ({"gyroscopes": {"C_gyr_i": EYE}}, "gyroscopes.C_gyr_i: unknown .*did you mean C_gyro_i"),
        ({"gyroscopes": 3}, "gyroscopes = 3: must hold M, A, C_gyro_i"),
        ({"accelerometers": {"M": EYE}, "Tw": EYE}, "are kalibr's, Tw OpenVINS': keep one"),
        ({"Ta": np.zeros((3, 3)).tolist()}, "Ta: must be invertible"),
        ({"time_offset": "late"}, "time_offset = 'late': must be a finite number"),
        ({"sensor_type": "camera"}, "sensor_type = 'camera': must be imu"),
        ({"update_rate": None}, "update_rate: a value is missing"),
        ({"rate_hz": 200}, "rate_hz: rate is given twice"),
        (
            {"accelerometer_random_walk": "much"},
            "accelerometer_random_walk = 'much': must be",
        ),
        ({"gyroscope_noise_density": -1.0}, "gyroscope_noise_density = -1.0: must be a finite"),
        ({"imu": {"gyroscope_bias": [0, 1]}}, r"imu.gyroscope_bias = \[0, 1\]: must be a finite"),
        ({"update_rate": "fast"}, "update_rate = 'fast': must be a finite number above 0"),
    ],
)
def test_what_cannot_be_used_is_a_line_with_the_file(tmp_path, change, line):
    path = write(tmp_path, {**NOISE, **RATE, **change})
    with pytest.raises(ConfigurationError, match=line) as caught:
        presets.load(path)
    assert all(text.startswith(str(path)) for text in caught.value.problems)


def test_numbers_in_quotes_are_numbers(tmp_path):
    """Files of other tools, flat ones and ROS 2 parameter files of an IMU give the same."""
    quoted = {
        **{key: str(value) for key, value in NOISE.items()},
        "gyroscope_bias": ["0.1", "0", 0],
    }
    bare = {**NOISE, "gyroscope_bias": [0.1, 0, 0]}
    expected = presets.sensor_layer(str(write(tmp_path, {**bare, **RATE})))
    rate = {key: str(value) for key, value in RATE.items()}
    assert presets.sensor_layer(str(write(tmp_path, {**quoted, **rate}))) == expected
    ros = {"rate": "200", "imu": quoted}
    path = write(tmp_path, {"/**": {"ros__parameters": ros}}, "ros.yaml")
    assert presets.sensor_layer(str(path)) == expected


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        (
            "gyroscope_noise_density: 'much'\n      gyroscope_bias: [1]\n      gyroscope_biass: 0",
            [
                "{path}: imu.gyroscope_noise_density = 'much': must be a finite number",
                "{path}: imu.gyroscope_bias = [1]: must be a finite number",
                "imu.gyroscope_biass: unknown parameter",
            ],
        ),
        ("gyroscope_noise_density: -1", ["{path}: imu.gyroscope_noise_density = -1: must be"]),
    ],
)
def test_bad_values_of_a_ros_file_of_an_imu_name_the_file(tmp_path, text, lines):
    path = tmp_path / "imu.yaml"
    path.write_text(f"/**:\n  ros__parameters:\n    imu:\n      {text}\n")
    successor = tmp_path / "successor.yaml"
    successor.write_text(f"/**:\n  ros__parameters:\n    imu.preset: {path}\n")
    for name in (path, successor):
        with pytest.raises(ConfigurationError) as caught:
            ims.simulate(imu=str(name), duration=0.1)
        for line, problem in zip(lines, caught.value.problems, strict=True):
            assert problem.startswith(line.format(path=path))


def test_names_beside_those_of_imus_are_named_unless_they_are_keys(tmp_path):
    """Anchors and cameras have no effect; a noise beside its IMU would be lost."""
    path = tmp_path / "anchored.yaml"
    lines = "".join(f"  {name}: {value}\n" for name, value in {**NOISE, **RATE}.items())
    path.write_text(f"common: &common\n{lines}imu0:\n  <<: *common\n  gyroscope_range: 4.0\n")
    with pytest.warns(Remark, match=r"not used: common \(not of an IMU\)"):
        values = presets.load(path)
    assert values["imu.gyroscope_noise_density"] == NOISE["gyroscope_noise_density"]
    misplaced = write(tmp_path, {"imu0": NOISE, "update_rate": 200.0, "gyroscope_noise_densty": 1})
    with pytest.raises(ConfigurationError) as caught:
        presets.load(misplaced)
    lines = caught.value.problems
    assert [line.split(": ")[1] for line in lines] == ["update_rate", "gyroscope_noise_densty"]
    assert all("must stand below the IMU's name, imu0" in line for line in lines)


def test_imus_in_maplabs_list_of_sensors(tmp_path):
    sigmas = {
        "gyro_noise_density": 3e-4,
        "gyro_bias_random_walk_noise_density": 1e-5,
        "acc_noise_density": 1e-2,
        "acc_bias_random_walk_noise_density": 1e-3,
    }
    imus = [{"sensor_type": "IMU", "sigmas": {**sigmas, "gyro_noise_density": n}} for n in (1, 2)]
    tree = {"sensors": [imus[0], {"sensor_type": "NCAMERA"}, imus[1]]}
    with pytest.raises(ConfigurationError, match=r"name one of imu0, imu1: .*#imu0"):
        presets.load(write(tmp_path, tree))
    with pytest.warns(Remark, match=r"not used: sensors\[1\], 'NCAMERA' \(not of an IMU\)"):
        values = presets.load(f"{write(tmp_path, tree)}#imu1")
    assert values["imu.gyroscope_noise_density"] == 2


def test_a_flat_file_may_have_parameters_of_this_package(tmp_path):
    keys = {**NOISE, **RATE, "gyroscope_range": 4.0, "gyroscope_bias": [0.01, 0.0, 0.0]}
    path = write(tmp_path, {**keys, "imu.accelerometer_range": 80.0, "trajectory.type": "static"})
    loaded = load_simulation({"imu.preset": "perfect"}, presets.load(path))
    assert loaded.imu.gyroscope.range == (4.0, 4.0, 4.0)
    assert loaded.imu.gyroscope.bias == (0.01, 0.0, 0.0)
    assert loaded.imu.accelerometer.range == (80.0, 80.0, 80.0)
    assert loaded.trajectory.type == "static"
    nested = write(tmp_path, {"rate": 50.0, "imu": {"gyroscope_bias": [0.1, 0.0, 0.0]}})
    assert presets.load(nested) == {"rate": 50.0, "imu.gyroscope_bias": [0.1, 0.0, 0.0]}
    # An unknown parameter is refused where all are known.
    with pytest.raises(ConfigurationError, match=r"imu.gyro_bia: unknown.*imu.gyroscope_bias"):
        load_simulation(presets.load(write(tmp_path, {"rate": 50.0, "imu": {"gyro_bia": 1.0}})))


def test_namespaces_of_ros_2_are_parts_of_names_or_names_around_them(tmp_path):
    node = {"ros__parameters": {"rate": 50.0}}
    for tree in (
        {"left": {"simulator": node}},
        {"/left": {"front": {"simulator": node}}},
        {"/left/front": {"simulator": node}},
        {"/**": {"simulator": node}},
        {"left": {"/**": node, "other": {"ros__parameters": {"x": 1}}}},
    ):
        assert presets.load(write(tmp_path, tree)) == {"rate": 50.0}
    both = {"left": {"simulator": node}, "right": {"simulator": node}}
    with pytest.raises(ConfigurationError, match="left/simulator, right/simulator: leave one"):
        presets.load(write(tmp_path, both))
    layers = {"/**": node, "rate": 3.0}
    with pytest.raises(ConfigurationError, match="rate must hold ros__parameters and nothing else"):
        presets.load(write(tmp_path, layers))


def test_a_program_says_once_what_it_does_not_use(tmp_path, capsys):
    path = write(tmp_path, {**NOISE, **RATE, "rostopic": "/imu0", "gyroscope_bandwidth": 40.0})
    for number, option in enumerate(("--imu", "--params-file")):
        output = str(tmp_path / f"{number}.csv")
        arguments = ["-o", output, option, str(path), "--duration", "1s", "--quiet"]
        assert generate.main(arguments) == 0
        assert capsys.readouterr().err.count("not used: rostopic = '/imu0'") == 1


def test_the_sensor_yaml_of_an_own_euroc_folder_is_its_sensor(tmp_path):
    changes = ["--set", "imu.lever_arm=[0.1,0,0.2]", "--set", "imu.mounting=[0,-1,0,1,0,0,0,0,1]"]
    arguments = ["--format", "euroc", "--duration", "1s", "--quiet", "--imu", "adis16448", *changes]
    assert generate.main(["-o", str(tmp_path / "mav0"), *arguments]) == 0
    values, line = remarks(tmp_path / "mav0" / "imu0" / "sensor.yaml")
    assert "comment = " in line
    assert values["rate"] == 200.0
    assert values["imu.lever_arm"] == pytest.approx([0.1, 0.0, 0.2])
    assert values["imu.mounting"] == pytest.approx([0, -1, 0, 1, 0, 0, 0, 0, 1])
    assert values["imu.gyroscope_noise_density"] == pytest.approx(1.6968e-4)


def test_dead_reckoning_takes_the_noise_of_a_kalibr_file(tmp_path, capsys):
    """Readings have a rate of their own: update_rate has no effect on them."""
    assert generate.main(["-o", str(tmp_path / "run"), "--duration", "2s", "--quiet"]) == 0
    path = write(tmp_path, {**NOISE, **RATE})
    for option in ("--params-file", "--set"):
        value = str(path) if option == "--params-file" else f"imu.preset={path}"
        assert dead_reckon.main([str(tmp_path / "run"), option, value, "--quiet"]) == 0
    wrong = write(tmp_path, {**NOISE, "updat_rate": 200.0}, "wrong.yaml")
    assert dead_reckon.main([str(tmp_path / "run"), "--params-file", str(wrong)]) == 2
    assert "updat_rate: unknown key; did you mean update_rate?" in capsys.readouterr().err
