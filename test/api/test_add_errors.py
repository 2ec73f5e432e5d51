# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors on given readings from Python: one sample or many, saved, refused; models of Gazebo."""

import copy
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulation_runs import EVERY_TERM
from stamps import batches, exact, rounded

import imu_sim_ros as ims


@pytest.fixture(scope="module")
def flight() -> ims.Flight:
    return ims.simulate(imu="mpu6000", trajectory="figure_eight", duration=5, seed=3)


def test_one_sample_or_many_are_those_of_the_simulation(flight: ims.Flight) -> None:
    truth = flight.truth
    added = ims.add_errors(truth.t_ns, truth.gyro, truth.accel, imu="mpu6000", seed=3)
    model = ims.ErrorModel(imu="mpu6000", rate=200, seed=3)
    singles = [
        model.read(int(t), g, a)
        for t, g, a in zip(truth.t_ns, truth.gyro.tolist(), truth.accel, strict=True)
    ]
    for name in ("gyro", "accel"):
        simulated = getattr(flight, name)
        assert np.array_equal(getattr(added, name), simulated)
        assert np.array_equal(np.concatenate([getattr(b, name) for b in singles]), simulated)
    assert np.array_equal(added.truth.gyro_bias, truth.gyro_bias)
    assert np.array_equal(added.truth.accel, truth.accel)
    assert np.isnan(added.truth.position).all()
    assert np.isnan(added.trajectory.sample(np.zeros(2)).q_wb).all()
    assert added.parameters.rate == 200.0
    assert repr(model) == "<ErrorModel mpu6000 at 200 Hz, seed 3>"


@pytest.mark.parametrize("count", [None, 2])
def test_a_copy_of_a_model_goes_on_like_it(count: int | None) -> None:
    """The copy draws the same numbers beyond the prefetched noise, from a stream of its own."""
    terms = EVERY_TERM if count is None else {"imu.gyroscope_random_walk": 1e-4}
    model: Any = ims.ErrorModel(imu="mpu9250", rate=200, seed=3, count=count, parameters=terms)
    zero = np.zeros((count or 1, 3))

    def next_arrays(error_model: Any, begin: int) -> list[np.ndarray]:
        arrays = []
        for t_ns in range(begin, begin + 1_000_000_000, 5_000_000):
            block = error_model.read(t_ns, zero, zero + 1.0)
            field = error_model.read_magnetic_field(t_ns, zero + 2e-5)
            arrays += [block.gyro, block.accel, block.accel_bias, block.t_ns, field.field]
            arrays += [error_model.read_pressure(t_ns, zero[:, 0] + 1e5).pressure]
            arrays += [block.delivered] if count is None else []
        return arrays

    next_arrays(model, 0)
    copied_model = copy.deepcopy(model)
    assert type(copied_model) is (ims.ErrorModel if count is None else ims.ErrorModelBatch)
    for begin in (1_000_000_000, 2_000_000_000):
        pairs = zip(next_arrays(model, begin), next_arrays(copied_model, begin), strict=True)
        assert all(np.array_equal(original, copied) for original, copied in pairs)


def test_a_bag_and_back(flight: ims.Flight, tmp_path: Path) -> None:
    truth = flight.truth
    added = ims.add_errors(truth.t_ns, truth.gyro, truth.accel, imu="mpu6000", seed=3)
    path = added.save(tmp_path / "noisy.mcap")
    assert np.array_equal(ims.read_imu(path, "imu/data_raw").accel, flight.accel)
    ideal = ims.read_imu(path, "ground_truth/imu")
    again = ims.add_errors(ideal.t_ns, ideal.gyro, ideal.accel, imu="mpu6000", seed=3)
    assert np.array_equal(again.accel, flight.accel)
    with pytest.raises(ims.InputError, match="a value that is not finite: position"):
        ims.evaluate(ims.dead_reckon(flight), added.truth)


def test_the_rate_is_that_of_the_stamps() -> None:
    zero = np.zeros((500, 3))
    level = np.tile([0.0, 0.0, 9.81], (500, 1))
    for rate in (100.0, 190.0, 333.3, 8000.0):
        t_ns = np.array([round(k * 1e9 / rate) for k in range(501)])
        t_ns = np.delete(t_ns, 77)
        assert ims.add_errors(t_ns, zero, level).parameters.rate == rate
    with pytest.raises(ims.ConfigurationError, match="two readings, or the rate"):
        ims.add_errors([1], zero[:1], zero[:1])
    assert len(ims.add_errors([1], zero[:1], zero[:1], rate=100)) == 1


@pytest.mark.parametrize("apart_ns", [0, 50_000])
@pytest.mark.parametrize("live", [False, True])
def test_readings_in_batches_lack_none(apart_ns: int, live: bool) -> None:
    """Eight readings share a stamp, or come 50 us apart every 20 ms."""
    t_ns = batches(exact(4000, 400), 8, apart_ns)
    rates = 1e-9 * np.arange(4000)[:, None] * [1.0, 1.0, 1.0]  # no two of them are equal
    forces = np.tile([0.0, 0.0, 9.81], (4000, 1))
    if live:
        model = ims.ErrorModel(imu="bmi088", seed=1, rate=400, input={"check": False})
        for k in range(4000):
            model.read(int(t_ns[k]), rates[k], forces[k])
        counts = model.counts
        assert (counts.samples, counts.missing, counts.repeated) == (4000, 0, 0)
        return
    flight = ims.add_errors(t_ns, rates, forces, imu="bmi088", seed=1, input={"check": False})
    assert flight.parameters.rate == 400
    assert len(flight.t_ns) == 4000
    density = (flight.gyro - rates).std(axis=0) / 20.0
    # The deviation of 4000 numbers is known to 1.1 %; drifts add to it.
    np.testing.assert_allclose(density, 1.74e-4, rtol=0.06)


def test_the_rate_of_whole_milliseconds_is_that_of_the_clock() -> None:
    t_ns = rounded(exact(20000, 400.1))
    rates, forces = np.zeros((20000, 3)), np.tile([0.0, 0.0, 9.81], (20000, 1))
    flight = ims.add_errors(t_ns, rates, forces, imu="bmi088", input={"check": False})
    assert flight.parameters.rate == pytest.approx(400.1, rel=1e-4)
    assert len(flight.t_ns) == 20000
    with pytest.raises(ims.ConfigurationError, match="not in nanoseconds.*in us"):
        ims.add_errors(exact(20000, 200) // 1000, rates, forces, imu="bmi088")


def test_changes_faults_and_reset() -> None:
    t_ns = np.arange(400) * 5_000_000
    gyro, accel = np.zeros((400, 3)), np.tile([0.0, 0.0, 9.81], (400, 1))
    model = ims.ErrorModel(imu="perfect", rate=200)
    assert model.inject("bias_jump", triad="gyroscope", value=0.5, delay=0.5, duration=0.1) == 100
    first_block = model.read(t_ns, gyro, accel)
    assert np.flatnonzero(first_block.gyro[:, 0]).tolist() == list(range(100, 120))
    model.update(imu={"accelerometer_bias": [0.1, 0.0, 0.0]})
    later = model.read(t_ns + t_ns[-1] + 5_000_000, gyro, accel)
    assert np.flatnonzero(later.accel[:, 0])[0] == 448 - 400  # the next multiple of 64
    model.reset()
    assert np.array_equal(model.read(t_ns, gyro, accel).gyro[:, 0], gyro[:, 0])
    assert model.counts.samples == 1200
    with pytest.raises(ims.ConfigurationError, match="cannot be changed while"):
        model.update(imu={"gyroscope_bandwidth": 10.0})
    with pytest.raises(ims.ConfigurationError, match="kind = 'jump'"):
        model.inject("jump")


def test_a_faster_input_gives_no_sample_at_most_calls() -> None:
    model = ims.ErrorModel(imu="perfect", rate=100, input={"rate": 1000}, imu_frame="x")
    counts = [len(model.read(k * 1_000_000, [0, 0, 0], [0, 0, 9.81]).t_ns) for k in range(31)]
    assert [k for k, count in enumerate(counts) if count] == [0, 10, 20, 30]


def test_gravity_missing_in_readings_at_rest_is_a_warning() -> None:
    t_ns = np.arange(600) * 5_000_000
    zero = np.zeros((600, 3))
    with pytest.warns(UserWarning, match=r"input\.gravity = included: at rest .* is missing"):
        ims.add_errors(t_ns, zero, zero)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        level = np.tile([1.0, 0.0, 0.0, 0.0], (600, 1))
        ims.add_errors(t_ns, zero, zero, orientation=level, input={"gravity": "missing"})


def test_the_first_irregular_stamps_of_each_kind_are_warned_of() -> None:
    model = ims.ErrorModel(imu="perfect", rate=100, input={"check": False})
    still, level = [0.0, 0.0, 0.0], [0.0, 0.0, 9.81]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for k in range(1, 1001):
            model.read(k * 10_000_000, still, level)
            model.read(k * 10_000_000, still, level)
            model.read(k * 10_000_000 - 1, still, level)
    counts = model.counts
    assert (counts.samples, counts.repeated, counts.backward) == (1000, 1000, 1000)
    warning_lines = [str(warning.message) for warning in caught]
    assert len(warning_lines) == 6
    assert [line.endswith("left out; further ones are only counted") for line in warning_lines] == [
        *(False, False, False, False, True, True)
    ]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (([0.5], [[0, 0, 0]], [[0, 0, 0]]), "t_ns = .*whole nanoseconds"),
        (([1, 2], [[0, 0, 0]], [[0, 0, 0]]), "2 stamps, 1 rates, 1 specific forces"),
        (([1], [[0, 0]], [[0, 0, 0]]), "gyro = .*shape"),
        (([1], ["a"], [[0, 0, 0]]), "gyro = .*shape"),
        (([1], [[0, math.nan, 0]], [[0, 0, 0]]), "not finite: angular velocity"),
        (([1], [[0, 0, 0]], [[0, 0, 1e30]]), "at most .* is possible"),
        (([-(2**62)], [[0, 0, 0]], [[0, 0, 1]]), "is outside the years"),
    ],
)
def test_bad_readings_are_a_line_and_change_nothing(arguments: tuple, line: str) -> None:
    model = ims.ErrorModel(imu="lecture", rate=100, seed=1)
    with pytest.raises(ims.ImuSimError, match=line):
        model.read(*arguments)
    fresh = ims.ErrorModel(imu="lecture", rate=100, seed=1)
    expected = fresh.read(5, [0, 0, 0], [0, 0, 9.81])
    assert np.array_equal(model.read(5, [0, 0, 0], [0, 0, 9.81]).gyro, expected.gyro)


# ------------------------------------------------------------------------ models of Gazebo
SDF = """<?xml version="1.0"?>
<sdf version="1.9"><model name="m"><link name="l">
  <sensor name="front" type="imu"><update_rate>250</update_rate><imu>
    <angular_velocity>{axes}</angular_velocity>
    <linear_acceleration><z><noise type="gaussian_quantized">
      <mean>0.2</mean><stddev>0.03</stddev><precision>0.01</precision></noise></z>
    </linear_acceleration></imu></sensor>
</link></model></sdf>"""
AXIS = """<{a}><noise type="gaussian">
<mean>0</mean><stddev>0.009</stddev><bias_mean>3e-4</bias_mean>
<bias_stddev>4e-4</bias_stddev><dynamic_bias_stddev>2e-5</dynamic_bias_stddev>
<dynamic_bias_correlation_time>400</dynamic_bias_correlation_time></noise></{a}>"""


def write(folder: Path, text: str, name: str = "model.sdf") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_noise_of_an_sdf_sensor_becomes_parameters_of_the_imu(tmp_path: Path) -> None:
    path = write(tmp_path, SDF.format(axes="".join(AXIS.format(a=a) for a in "xyz")))
    noise_parameters = ims.from_sdf(path)
    assert noise_parameters["gyroscope_noise_density"] == pytest.approx(
        [0.009 / math.sqrt(250.0)] * 3
    )
    assert noise_parameters["gyroscope_turn_on_bias_sigma"] == pytest.approx([5e-4] * 3)
    assert noise_parameters["gyroscope_gauss_markov_density"] == [2e-5] * 3
    assert noise_parameters["gyroscope_correlation_time"] == [400.0] * 3
    assert noise_parameters["accelerometer_noise_density"] == pytest.approx(
        [0, 0, 0.03 / math.sqrt(250.0)]
    )
    assert noise_parameters["accelerometer_bias"] == [0.0, 0.0, 0.2]
    assert noise_parameters["accelerometer_resolution"] == [0.0, 0.0, 0.01]
    by_file = ims.simulate(imu=path, trajectory="static", duration=1, seed=2)
    by_name = ims.simulate(imu=f"{path}#front", trajectory="static", duration=1, seed=2)
    assert (noise_parameters["rate"], noise_parameters["preset"]) == (250.0, f"{path}#front")
    by_value = ims.simulate(imu=noise_parameters, trajectory="static", duration=1, seed=2)
    assert by_value.parameters.rate == 250.0
    assert by_file.parameters.imu.preset == f"{path}#front"
    zero = np.zeros((200, 3))
    added = ims.add_errors(
        np.arange(200) * 10**7, zero, zero, imu=noise_parameters, input={"check": False}
    )
    assert added.parameters.rate == 100.0  # that of the stamps
    assert np.array_equal(by_file.gyro, by_value.gyro)
    assert np.array_equal(by_file.gyro, by_name.gyro)
    # A sample's deviation is that of the file: 250 samples of 3 axes, within 4 deviations.
    spread = (by_file.gyro - by_file.gyro.mean(axis=0)).std()
    assert abs(spread / 0.009 - 1.0) < 4.0 / math.sqrt(2 * 750)


def test_gazebo_classic_and_rotors(tmp_path: Path) -> None:
    classic = write(
        tmp_path,
        "<robot><gazebo><plugin name='p' filename='libgazebo_ros_imu.so'><updateRateHZ>100"
        "</updateRateHZ><gaussianNoise>0.01</gaussianNoise><frameName>imu0</frameName></plugin>"
        "</gazebo></robot>",
        "robot.urdf",
    )
    noise_parameters = ims.from_sdf(classic)
    assert (
        noise_parameters["gyroscope_noise_density"]
        == noise_parameters["accelerometer_noise_density"]
    )
    assert noise_parameters["gyroscope_noise_density"] == pytest.approx(1e-3)
    assert ims.simulate(imu=classic, duration=0.1).parameters.imu_frame == "imu0"
    rotors = write(
        tmp_path,
        "<sdf><plugin name='r' filename='librotors_gazebo_imu_plugin.so'>"
        "<gyroscopeRandomWalk>3e-5</gyroscopeRandomWalk></plugin></sdf>",
    )
    noise_parameters = ims.from_sdf(rotors)
    assert noise_parameters["gyroscope_gauss_markov_density"] == 3e-5
    assert noise_parameters["accelerometer_correlation_time"] == 300.0  # the plugin's own value
    assert noise_parameters["accelerometer_turn_on_bias_sigma"] == pytest.approx(0.196)


PX4 = (
    "<model><link name='gimbal'><sensor name='camera_imu' type='imu'/></link>"
    "<plugin name='gazebo_imu_plugin' filename='libgazebo_imu_plugin.so'>"
    "<linkName>/techpod/imu_link</linkName></plugin>"
    "<plugin name='p3d' filename='libgazebo_ros_p3d.so'><gaussianNoise>1</gaussianNoise></plugin>"
    "<plugin name='s' filename='libignition-gazebo-imu-system.so'/></model>"
)


def test_a_plugin_is_known_by_its_library_and_has_its_own_defaults(tmp_path: Path) -> None:
    """PX4's models write neither densities nor a rate; typhoon_h480's gimbal has an IMU, too."""
    path = write(tmp_path, PX4)
    with pytest.raises(ims.InputError, match="several IMUs, name one of camera_imu, gazebo_imu"):
        ims.from_sdf(path)
    noise_parameters = ims.from_sdf(path, "gazebo_imu_plugin")
    density = 2.0 * 35.0 / 3600.0 / 180.0 * math.pi  # gazebo_imu_plugin.h
    assert noise_parameters["gyroscope_noise_density"] == pytest.approx(density)
    assert noise_parameters["imu_frame"] == "techpod/imu_link"
    silent = "<sdf><plugin name='p' filename='libgazebo_ros_imu.so'/></sdf>"
    with pytest.warns(UserWarning, match="has no noise"):  # the default of <gaussianNoise> is 0
        ims.from_sdf(write(tmp_path, silent))
    nested = (
        "<sensor name='imu' type='imu'><update_rate>100</update_rate><plugin name='p' "
        "filename='libgazebo_ros_imu_sensor.so'><gaussianNoise>0.01</gaussianNoise></plugin></sensor>"
    )
    noise_parameters = ims.from_sdf(write(tmp_path, nested))
    assert noise_parameters["accelerometer_noise_density"] == pytest.approx([1e-3] * 3)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("<sdf></sdf>", "describes no IMU"),
        ("{% if a %}<sdf></sdf>", "is a Jinja template, not XML: render it first"),
        ("<p><plugin name='h' filename='libhector_gazebo_ros_imu.so'/></p>", "hector_.*not known"),
        (
            SDF.format(axes="").replace("0.03", "{{ a }}"),
            "must be a number; the file is a template",
        ),
        ("<sdf>", "not XML"),
        ("nothing", "not XML"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><sdf>&b;</sdf>', "has a document type"),
        ('<!DOCTYPE a SYSTEM "file:///etc/passwd"><sdf/>', "has a document type"),
        ("<a>" * 300 + "</a>" * 300, "nested deeper"),
        (SDF.format(axes="").replace("<update_rate>250</update_rate>", ""), "has no <update_rate>"),
        (SDF.format(axes="").replace("0.03", "many"), "<stddev> 'many': must be a number"),
        (SDF.format(axes="").replace("0.03", "-0.03"), "must be at least 0"),
        (SDF.format(axes="").replace("gaussian_quantized", "pink"), "'pink' is not known"),
        ("<s><sensor type='imu' name='a'/><sensor type='imu' name='b'/></s>", "name one of a, b"),
    ],
)
def test_bad_models_are_a_line(tmp_path: Path, text: str, line: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(ims.InputError, match=line):
        ims.from_sdf(path)
    with pytest.raises(ims.ConfigurationError, match=line):
        ims.simulate(imu=path, duration=1)


def test_several_imus_of_a_model(tmp_path: Path) -> None:
    path = write(tmp_path, "<s><sensor type='imu' name='a'/><sensor type='imu' name='b'/></s>")
    with pytest.warns(UserWarning, match="#b: has no noise at all"):
        assert ims.from_sdf(path, "b") == {"preset": f"{path}#b"}
    both = write(tmp_path, "<s><sensor type='imu' name='a'/><sensor type='imu' name='a'/></s>")
    with pytest.raises(ims.InputError, match="has several IMUs named a"):
        ims.from_sdf(both, "a")
    path = write(tmp_path, "<s><sensor type='imu' name='a'/><sensor type='imu' name='b'/></s>")
    with pytest.raises(ims.InputError, match="has no IMU 'c'; it has a, b"):
        ims.from_sdf(path, "c")
