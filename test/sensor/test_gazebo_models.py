# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models as Gazebo reads them: which noise acts, at which rate, where the IMU is."""

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands import generate
from imu_sim_ros.core.errors import InputError, Remark
from imu_sim_ros.core.rotation import from_euler, to_matrix
from imu_sim_ros.sensors.imu import sdf


def model(tmp_path, content, rate="<update_rate>200</update_rate>", imu=True):
    content = f"<imu><angular_velocity>{content}</angular_velocity></imu>" if imu else content
    sensor = f'<sensor name="imu" type="imu">{rate}{content}</sensor>'
    path = tmp_path / "model.sdf"
    path.write_text(
        f'<sdf version="1.9"><model name="m"><link name="l">{sensor}</link></model></sdf>'
    )
    return path


def axes(kind, elements="<stddev>0.01</stddev>"):
    return "".join(f"<{a}><noise{kind}>{elements}</noise></{a}>" for a in "xyz")


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (axes(' type="none"'), "<x>, <y>, <z> is type none: no effect, as in Gazebo"),
        (axes(""), "<x>, <y>, <z> is without a type: no effect, as in Gazebo"),
        ('<noise type="gaussian"><stddev>0.01</stddev></noise>', "it reads the noise of <x>, <y>"),
    ],
)
def test_noise_that_gazebo_does_not_apply_is_not_applied_and_named(tmp_path, content, line):
    path = model(tmp_path, content)
    with pytest.warns(Remark, match=line):
        run = ims.simulate(imu=path, trajectory="static", duration=1)
    assert not run.gyro.any()
    assert run.parameters.rate == 200.0


def test_a_noise_of_type_none_without_numbers_is_nothing_to_say(tmp_path, recwarn):
    ims.simulate(imu=model(tmp_path, axes(' type="none"', "")), trajectory="static", duration=1)
    assert not [warning for warning in recwarn if issubclass(warning.category, Remark)]


@pytest.mark.parametrize(
    ("content", "imu", "line"),
    [
        (axes(' type="gaussian"', "<stdev>0.01</stdev>"), True, "<stdev>.*did you mean <stddev>"),
        ("<imu><angular_velocty/></imu>", False, "<angular_velocty>.*<angular_velocity>"),
        ("<update_rat>5</update_rat>", False, "<update_rat>.*did you mean <update_rate>"),
        (
            '<plugin name="p" filename="libgazebo_ros_imu_sensor.so"><gausianNoise>1</gausianNoise>'
            "</plugin>",
            False,
            "<gausianNoise>.*did you mean <gaussianNoise>",
        ),
    ],
)
def test_typing_errors_are_refused_with_the_nearest_name(tmp_path, content, imu, line):
    with pytest.raises(InputError, match=line):
        ims.from_sdf(model(tmp_path, content, imu=imu))


def test_the_type_of_a_noise_is_read_in_either_case(tmp_path):
    """sdformat compares it in lower case (Noise.cc)."""
    capital = sdf.read_model(model(tmp_path, axes(' type="Gaussian"'))).parameters
    assert capital == sdf.read_model(model(tmp_path, axes(' type="gaussian"'))).parameters
    assert "imu.gyroscope_noise_density" in capital
    with pytest.raises(InputError, match=r"'gausian' is not known; .*did you mean gaussian\?"):
        sdf.read_model(model(tmp_path, axes(' type="gausian"')))


@pytest.mark.parametrize("element", ["dynamic_bias_stddev", "dynamic_bias_correlation_time"])
def test_half_a_dynamic_bias_is_named(tmp_path, element):
    content = axes(' type="gaussian"', f"<stddev>0.01</stddev><{element}>0.1</{element}>")
    with pytest.warns(Remark, match=r"imu.gyroscope: the dynamic bias of x, y, z has either"):
        values = sdf.read_model(model(tmp_path, content)).parameters
    assert "imu.gyroscope_gauss_markov_density" not in values


NESTED = """<sdf version="1.9"><world name="w"><model name="car">
  <model name="left"><link name="l"><sensor name="imu" type="imu"><update_rate>100</update_rate>
  </sensor></link></model>
  <model name="right"><link name="l"><sensor name="imu" type="imu"><update_rate>50</update_rate>
  </sensor></link></model>
  <link name="l"><sensor name="other" type="imu"/></link>
</model></world></sdf>"""


def test_sensors_of_one_name_are_told_apart_by_their_models(tmp_path):
    path = tmp_path / "nested.sdf"
    path.write_text(NESTED)
    names = "car::left::imu, car::right::imu, other"
    with pytest.raises(InputError, match=f"name one of {names}: .*#car::left::imu"):
        sdf.read_model(path)
    assert sdf.read_model(f"{path}#car::right::imu").parameters["rate"] == 50.0
    assert sdf.read_model(path, "other").name == "other"
    path.write_text(NESTED.replace('name="right"', 'name="left"'))
    with pytest.raises(InputError, match="several IMUs named car::left::imu; give them other"):
        sdf.read_model(path, "car::left::imu")


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (
            '<sdf><model name="m"><include><uri>model://imu</uri></include></model></sdf>',
            r"<include> is not followed: give the file of 'model://imu'",
        ),
        (
            '<sdf><link name="l"><sensor name="i" type="IMU"/></link></sdf>',
            r"<sensor type='IMU'>: Gazebo knows 'imu' alone",
        ),
        (
            '<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:include filename="imu.xacro"/>'
            "</robot>",
            r"is a xacro file: run xacro, and give the result",
        ),
    ],
)
def test_a_model_without_an_imu_says_what_may_stand_for_it(tmp_path, content, line):
    path = tmp_path / "model.xml"
    path.write_text(content)
    with pytest.raises(InputError, match=line):
        sdf.read_model(path)


@pytest.mark.parametrize("rate", ["", "<update_rate>0</update_rate>"])
def test_a_model_without_a_rate_takes_that_of_the_run(tmp_path, capsys, rate):
    """A deviation of 0.01 is that of a sample, at any rate: the density depends on it."""
    path = model(tmp_path, axes(' type="gaussian"'), rate)
    for hertz in (100, 400):
        run = ims.simulate(imu=path, rate=hertz, trajectory="static", duration=10, seed=4)
        # The deviation of 3 x 1,000 samples or more is within 5 / sqrt(2 n) of the true one.
        assert run.gyro.std() == pytest.approx(0.01, rel=5.0 / np.sqrt(2.0 * run.gyro.size))
        assert run.parameters.rate == hertz
    output = ["-o", str(tmp_path / "x.csv"), "--imu", str(path), "--duration", "1s", "--quiet"]
    assert generate.main(output) == 2
    assert "depends on the rate: give --rate" in capsys.readouterr().err
    assert generate.main([*output, "--rate", "200"]) == 0
    t_ns = np.arange(1000) * 5_000_000
    zero, still = np.zeros((1000, 3)), np.tile([0.0, 0.0, 9.81], (1000, 1))
    added = ims.add_errors(t_ns, zero, still, imu=path, seed=1)
    assert added.gyro.std() == pytest.approx(0.01, rel=5.0 / np.sqrt(6000.0))


def test_a_negative_rate_is_refused(tmp_path):
    path = model(tmp_path, axes(' type="gaussian"'), "<update_rate>-1</update_rate>")
    with pytest.raises(InputError, match="a rate of -1 Hz: must be at least 0"):
        ims.from_sdf(path)


PLUGIN = """<always_on>true</always_on><topic>/jk/imu</topic>
<plugin filename="libgazebo_ros_imu_sensor.so" name="imu_plugin"><topicName>/jk/imu</topicName>
<bodyName>imu_base_link</bodyName><updateRateHZ>{rate}</updateRateHZ>
<gaussianNoise>0.00329</gaussianNoise><xyzOffset>0.1 0.2 -0.3</xyzOffset>
<rpyOffset>0.1 -0.2 0.3</rpyOffset><frameName>imu_base_link</frameName></plugin>
<pose>{pose}</pose>"""


@pytest.mark.parametrize(("rate", "expected"), [(100.0, 100.0), (200.0, 200.0), (400.0, 200.0)])
def test_a_classic_plugin_in_a_sensor_keeps_rate_frame_and_offset(tmp_path, rate, expected):
    """The plugin takes the latest reading of the sensor, so it is no faster than its 200 Hz."""
    path = model(tmp_path, PLUGIN.format(rate=rate, pose="0 0 0 0 0 0"), imu=False)
    run = ims.simulate(imu=path, trajectory="static", duration=20, seed=5)
    assert run.parameters.rate == expected
    assert run.parameters.imu_frame == "imu_base_link"
    assert run.parameters.imu.lever_arm == (0.1, 0.2, -0.3)
    mounting = to_matrix(from_euler([0.1, -0.2, 0.3]))  # Rz Ry Rx
    np.testing.assert_allclose(run.parameters.imu.mounting, np.ravel(mounting), atol=1e-15)
    # Deviation of a published sample, in each axis; 5 deviations of the estimate.
    assert run.gyro.std() == pytest.approx(0.00329, rel=5.0 / np.sqrt(2.0 * run.gyro.size))


def test_noise_of_a_sensor_and_of_its_plugin_add_up_at_the_rate_of_the_plugin(tmp_path):
    noise = f"<imu><angular_velocity>{axes(chr(32) + 'type=' + chr(34) + 'gaussian' + chr(34))}"
    content = f"{noise}</angular_velocity></imu>" + PLUGIN.format(rate=50, pose="0 0 0 0 0 0")
    sensor = ims.from_sdf(model(tmp_path, content, imu=False))
    assert sensor["rate"] == 50.0
    per_sample = np.array(sensor["gyroscope_noise_density"]) * np.sqrt(50.0)
    np.testing.assert_allclose(per_sample, np.hypot(0.01, 0.00329))
    per_sample = np.array(sensor["accelerometer_noise_density"]) * np.sqrt(50.0)
    np.testing.assert_allclose(per_sample, 0.00329)


@pytest.mark.parametrize(
    ("pose", "position", "angles"),
    [
        ("<pose>1 2 3 0.1 0.2 0.3</pose>", [1, 2, 3], [0.1, 0.2, 0.3]),
        ('<pose degrees="true">0 0 1 0 0 90</pose>', [0, 0, 1], [0, 0, np.pi / 2]),
        (
            '<pose rotation_format="quat_xyzw">0 0 1 0 0 0.6 0.8</pose>',
            [0, 0, 1],
            [0, 0, 2 * np.arctan2(0.6, 0.8)],
        ),
    ],
)
def test_the_pose_of_a_sensor_is_its_mount(tmp_path, pose, position, angles):
    noise = "<imu><angular_velocity/></imu>"
    with pytest.warns(UserWarning, match="has no noise"):
        sensor = ims.from_sdf(model(tmp_path, pose + noise, imu=False))
    np.testing.assert_allclose(sensor["lever_arm"], position)
    np.testing.assert_allclose(
        np.reshape(sensor["mounting"], (3, 3)), to_matrix(from_euler(angles)), atol=1e-12
    )
