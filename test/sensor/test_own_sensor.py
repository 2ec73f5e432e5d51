# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sonar of examples/own_sensor.py in Python, bags, text, help and truth files.

The live node is in test/nodes/simulator/test_own_sensor.py.
"""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import own_package
import pytest

import imu_sim_ros as ims
from imu_sim_ros import sensors
from imu_sim_ros.commands import generate
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.nodes import help as node_help
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.playback import load_simulator
from imu_sim_ros.simulation.sensors import mount_sensors

OWN = {
    "sonar.rate": 12.5,
    "sonar.time_offset": 0.013,
    "sonar.noise": 0.05,
    "sonar.bias_sigma": 0.3,
    "sonar.lever_arm": [0.2, 0.0, -0.1],
}
GIVEN: dict[str, Any] = {
    "sensors": ["sonar"],
    "imu.preset": "mpu6000",
    "trajectory.type": "figure_eight",
    "duration": 4.0,
    "seed": 7,
    **OWN,
}
OPTIONS = [
    *("--imu", "mpu6000", "--trajectory", "figure_eight", "--duration", "4s", "--seed", "7"),
    *("--set", "sensors=[sonar]", "--quiet"),
    *(word for name, value in OWN.items() for word in ("--set", f"{name}={value}")),
]
NESTED: dict[str, Any] = {
    "imu": "mpu6000",
    "trajectory": "figure_eight",
    "duration": 4.0,
    "seed": 7,
    "sonar": {name.removeprefix("sonar."): value for name, value in OWN.items()},
}


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: Any) -> Callable[..., Path]:
    """Install the example; what it registers is forgotten after the test."""
    monkeypatch.setattr(sensors, "_REGISTERED", {})
    monkeypatch.delitem(sys.modules, "own_sensor", raising=False)

    def install(*entry_point: str) -> Path:
        folder = tmp_path / "installed"
        folder.mkdir()
        monkeypatch.syspath_prepend(folder)
        return own_package.install(folder, *entry_point)

    return install


def flight() -> Any:
    return ims.simulate(**NESTED, sensors=["sonar"])


def test_the_example_is_short_and_runs() -> None:
    example = own_package.EXAMPLE
    assert len(example.read_text().splitlines()) <= 80
    done = subprocess.run([sys.executable, example], capture_output=True, text=True, check=True)
    assert done.stdout == "<SonarReadings: 100 at 10 Hz, 9.9 s>\n"


def test_python_reads_it_at_its_own_rate_with_its_truth(installed: Any) -> None:
    installed()
    flight_samples = flight()
    sonar = flight_samples.sonar
    assert len(sonar) == 50
    t = (sonar.true_t_ns - flight_samples.t0_ns) * 1e-9
    np.testing.assert_allclose(t, 0.013 + np.arange(50) / 12.5, rtol=0, atol=1e-9)
    motion = flight_samples.trajectory.sample(t)
    place = motion.position + rotation.rotate(motion.q_wb, np.array([[0.2, 0.0, -0.1]]))
    beam = sonar.ideal[:, None] * rotation.rotate(motion.q_wb, np.array([[0.0, 0.0, -1.0]]))
    np.testing.assert_allclose((place + beam)[:, 2], -10.0, rtol=0, atol=1e-9)
    assert np.ptp(sonar.bias) == 0.0 != sonar.bias[0]
    noise = sonar.range - sonar.ideal - sonar.bias
    # 50 samples of sigma 0.05: the deviation is known to 1 / sqrt(100) = 10 %; five of these.
    assert noise.std() == pytest.approx(0.05, rel=0.5)
    assert "sonar" in dir(flight_samples)


def test_a_model_that_defines_sent_chooses_which_samples_become_messages(installed: Any) -> None:
    installed()
    import own_sensor

    class Shy(own_sensor.Sonar):  # type: ignore[name-defined, misc]
        """A sonar that sends the readings with positive noise alone."""

        def sent(self, values: Any) -> Any:
            return values["range"] > values["ideal"] + values["bias"]

    ims.register_sensor(replace(own_sensor.SENSOR, model=Shy))
    body = Body(load_simulation(GIVEN), sensors={"sonar"})
    samples = body.next(10**6)["sonar"]
    rows = np.flatnonzero(samples.range > samples.ideal + samples.bias)
    assert 0 < len(rows) < len(samples.range)
    assert np.array_equal(samples.delivered, rows)


def test_samples_do_not_depend_on_blocks_and_leave_others_as_they_are(installed: Any) -> None:
    installed()
    parameters = load_simulation(GIVEN)
    whole = Body(parameters, sensors={"sonar"}).next(10**6)
    parts = list(Body(parameters, sensors={"sonar"}).windows(37))
    for name in ("t_ns", "range", "ideal", "bias", "release_t_ns"):
        joined = np.concatenate([getattr(part["sonar"], name) for part in parts])
        assert np.array_equal(joined, getattr(whole["sonar"], name)), name
    without = {k: v for k, v in GIVEN.items() if not k.startswith(("sonar", "sensors"))}
    alone = Body(load_simulation(without)).next(10**6)["imu"]
    assert np.array_equal(alone.gyro, whole["imu"].gyro)
    other_seed = Body(replace(parameters, seed=8), sensors={"sonar"}).next(10**6)
    assert not np.array_equal(other_seed["sonar"].range, whole["sonar"].range)


@pytest.mark.parametrize("name", ["flight.mcap", "flight.bag", "folder"])
def test_bags_hold_the_samples_and_the_truth_that_python_returns(
    installed: Any, tmp_path: Path, name: str
) -> None:
    """Rosbags reads the samples that Python returns, and generate and save write the same."""
    from rosbags.highlevel import AnyReader

    installed()
    assert generate.main(["-o", str(tmp_path / name), *OPTIONS]) == 0
    (tmp_path / "saved").mkdir()
    saved = flight().save(tmp_path / "saved" / name)
    sonar = flight().sonar
    for path in (tmp_path / name, saved):
        with AnyReader([path]) as reader:
            messages: dict[str, Any] = {}
            for connection, t_ns, content in reader.messages():
                message = reader.deserialize(content, connection.msgtype)
                messages.setdefault(connection.topic, []).append((t_ns, message))
        beams = messages["/sonar/beam"]
        assert [t_ns for t_ns, _ in beams] == sonar.t_ns.tolist()
        assert [-m.vector.z for _, m in beams] == sonar.range.tolist()
        assert {m.header.frame_id for _, m in beams} == {"sonar_link"}
        assert [-m.vector.z for _, m in messages["/ground_truth/sonar"]] == sonar.ideal.tolist()


@pytest.mark.parametrize(("form", "file"), [("csv", "sonar0.csv"), ("euroc", "sonar0/data.csv")])
def test_text_has_a_table_that_is_read_back(
    installed: Any, tmp_path: Path, form: str, file: str
) -> None:
    installed()
    folder = tmp_path / "text"
    assert generate.main(["-o", str(folder), "--format", form, *OPTIONS]) == 0
    header, *rows = (folder / file).read_text().splitlines()
    assert header == {"csv": "timestamp,range", "euroc": "#timestamp [ns],range [m]"}[form]
    sonar = flight().sonar
    assert [float(row.split(",")[1]) for row in rows] == sonar.range.tolist()
    assert [int(row.split(",")[0]) for row in rows] == sonar.t_ns.tolist()
    saved = flight().save(tmp_path / "saved", format=form)
    assert (saved / file).read_text() == (folder / file).read_text()


def test_one_table_of_readings_has_no_room_for_it(installed: Any, tmp_path: Path) -> None:
    installed()
    assert generate.main(["-o", str(tmp_path / "imu.csv"), *OPTIONS]) == 0
    assert generate.main(["-o", str(tmp_path / "poses.tum"), *OPTIONS]) == 0


def test_help_and_lists_name_it(installed: Any, capsys: Any) -> None:
    installed()
    for option in ("--help", "--list-sensors"):
        with pytest.raises(SystemExit):
            generate.main([option])
        output = " ".join(capsys.readouterr().out.split())
        assert "sonar" in output
        assert "the distance to level ground" in output
    assert "sonar.noise (0.02 [m])" in output
    assert "--sonar.noise VALUE" in node_help.parser("simulator").format_help()


def test_its_truth_is_a_file_that_simulates_it_again(installed: Any, tmp_path: Path) -> None:
    installed()
    assert generate.main(["-o", str(tmp_path / "a.mcap"), *OPTIONS]) == 0
    truth = tmp_path / "a_truth_sonar.yaml"
    again = load_simulation({k: v for k, v in GIVEN.items() if k not in OWN}, files.load(truth))
    assert again == load_simulation(GIVEN)


def test_faults_and_live_changes(installed: Any) -> None:
    installed()
    parameters = load_simulation(GIVEN)
    plain = Body(parameters, sensors={"sonar"}).next(10**6)["sonar"]
    run = Body(parameters, sensors={"sonar"})
    block = run.next(400)["sonar"]
    run.inject(Fault("bias_jump", 1.0, 2.0, "sonar"))
    jumped = run.next(400)["sonar"]
    count = len(block.range)
    rows = slice(count, count + len(jumped.range))
    added = jumped.range - plain.range[rows]
    np.testing.assert_allclose(added[jumped.bias != plain.bias[0]], 2.0, rtol=0, atol=1e-12)
    # 1 s at 12.5 Hz; the fault begins with the first sample after the IMU's 400th.
    assert np.count_nonzero(added) == 13
    run.reset()
    quiet = load_simulation(GIVEN, {"sonar.noise": 0.0})
    run.next(400)
    run.update(quiet)
    still = run.next(400)["sonar"]
    assert np.array_equal(still.range, still.ideal + still.bias)
    with pytest.raises(ConfigurationError, match="sonar.ground: cannot be changed"):
        run.update(load_simulation(GIVEN, {"sonar.ground": -5.0}))


def test_several_imus_have_it_once(installed: Any, tmp_path: Path) -> None:
    installed()
    several = {**GIVEN, "imus": ["left", "right"]}
    of_imus = [name for name in mount_sensors(load_simulator(several)) if "/" in name]
    assert "sonar" in mount_sensors(load_simulator(several))
    assert not any("sonar" in name for name in of_imus)
    body = Body(load_simulator(several), sensors=("sonar",))
    assert list(body.inject(Fault("dropout", 1.0, 1.0, "sonar"))) == ["left"]
    samples = body.next(10**6)
    assert 0 < len(samples["sonar"].delivered) < len(samples["sonar"].t_ns)
    assert all(
        len(samples[f"{n}/imu"].delivered) == len(samples[f"{n}/imu"].t_ns) for n in several["imus"]
    )
    path = tmp_path / "both"
    options = [*OPTIONS, "--set", "imus=[left,right]", "--format", "csv"]
    assert generate.main(["-o", str(path), *options]) == 0
    assert (path / "sonar0.csv").read_text().count("\n") == 51
    assert not (path / "sonar1.csv").exists()


def test_registration_needs_no_entry_point(installed: Any) -> None:
    folder = installed("other = own_sensor:Missing")
    import own_sensor  # type: ignore[import-not-found]

    assert Path(own_sensor.__file__).parent == folder
    ims.register_sensor(own_sensor.SENSOR)
    assert len(flight().sonar) == 50


@pytest.mark.parametrize(
    ("entry_point", "line"),
    [
        ("sonar = own_sensor_missing:SENSOR", "own_sensor_missing:SENSOR cannot be loaded: No"),
        ("sonar = own_sensor:Missing", "own_sensor:Missing cannot be loaded"),
        ("sonar = own_sensor:HEADERS", "is not a Sensor"),
        ("radar = own_sensor:SENSOR", "'sonar': must be one of"),
    ],
)
def test_entry_points_that_lead_nowhere(installed: Any, entry_point: str, line: str) -> None:
    installed(entry_point)
    with pytest.raises(ConfigurationError) as caught:
        load_simulation(GIVEN)
    assert any(line in problem for problem in caught.value.problems), caught.value.problems


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ({"sensors": ["sonra"]}, r"sensors: 'sonra': did you mean sonar\?"),
        ({"sensors": ["magnetometer"]}, "each IMU has it"),
        ({"sensors": ["sonar", "sonar"]}, "names must differ"),
        ({**GIVEN, "sonar.noise": -1.0}, "sonar.noise = -1.0: must be a finite number at least 0"),
        ({**GIVEN, "sonar.colour": 1}, "sonar.colour: unknown parameter"),
        ({**GIVEN, "sonar.jitter": 1.0}, "sonar.jitter = 1: must be at most a quarter"),
    ],
)
def test_bad_entry_points_are_refused_with_a_line(
    installed: Any, settings: dict[str, Any], line: str
) -> None:
    installed()
    with pytest.raises(ConfigurationError, match=line):
        load_simulation(settings)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"name": "Sonar!", "quantity": "Sonar!"}, "must be lower-case letters"),
        ({"quantity": "range"}, "must be the name, sonar"),
        ({"section": dict}, "must derive from SensorParameters"),
        ({"with_imu": True}, "with_imu = True: must be False"),
        ({"topics": ()}, "must be one at least"),
    ],
)
def test_declarations_are_checked(installed: Any, changes: dict[str, Any], line: str) -> None:
    installed()
    import own_sensor

    with pytest.raises(ConfigurationError, match=line):
        ims.register_sensor(replace(own_sensor.SENSOR, **changes))
