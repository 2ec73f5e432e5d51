# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Properties of every sensor but the IMU: those in the list, and the one of the example."""

import dataclasses
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dotted_names import nested
from scripts import load_script

import imu_sim_ros as ims
from imu_sim_ros import sensors
from imu_sim_ros.bags import sensor_tables
from imu_sim_ros.jobs.flight import Flight
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.sensors import (
    SENSORS,
    find_sensor,
    reading_tables,
    sensor_declarations,
    sensors_of_imus,
)
from imu_sim_ros.sensors.declaration import Sensor
from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

ROOT = Path(__file__).parents[2]
NAMES = (*SENSORS, "sonar")
BOARD = {"imu.preset": "perfect", "trajectory.type": "figure_eight", "duration": 3.0, "seed": 3}


@pytest.fixture(params=NAMES)
def sensor(request: Any, monkeypatch: Any) -> Sensor:
    """Return each declaration in turn; the example's is registered for the test."""
    monkeypatch.setattr(sensors, "_REGISTERED", {})
    if request.param in SENSORS:
        return sensor_declarations()[request.param]
    if request.param == "sonar":
        example = load_script(ROOT / "examples/own_sensor.py", "sonar_example")
        ims.register_sensor(example.SENSOR)
    return find_sensor(request.param)


def prefix(sensor: Sensor) -> str:
    return f"imu.{sensor.name}_" if sensor.with_imu else f"{sensor.name}."


def noisy_parameters(sensor: Sensor, **overrides: object) -> dict[str, Any]:
    """Return parameters in which the sensor is there, and noisy."""
    declared = parameters(sensor.section)
    noisy = {
        name: 1e-3
        for name in declared
        if name.startswith("noise") and declared[name].kind != "choice"
    }
    sensor_names = {} if sensor.with_imu else {"sensors": [sensor.name]}
    values = {f"{prefix(sensor)}{name}": value for name, value in {**noisy, **overrides}.items()}
    return {**BOARD, **sensor_names, **values}


def simulation(sensor: Sensor, settings: dict[str, Any]) -> Body:
    return Body(load_simulation(settings), sensors={sensor.quantity})


def arrays(sensor: Sensor, blocks: Any) -> dict[str, Any]:
    """Return all that was read, and its truth, joined."""
    names = [*(field.name for field in fields(sensor.readings)), "release_t_ns"]  # type: ignore[arg-type]
    windows = [block[sensor.quantity] for block in blocks]
    return {name: np.concatenate([getattr(samples, name) for samples in windows]) for name in names}


def whole_run(sensor: Sensor, settings: dict[str, Any]) -> dict[str, Any]:
    return arrays(sensor, [simulation(sensor, settings).next(10**6)])


def same_arrays(a: dict[str, Any], b: dict[str, Any]) -> bool:
    return all(np.array_equal(a[name], b[name], equal_nan=True) for name in a)


def test_blocks_may_have_any_size(sensor: Sensor) -> None:
    samples = whole_run(sensor, noisy_parameters(sensor))
    assert same_arrays(
        samples, arrays(sensor, simulation(sensor, noisy_parameters(sensor)).windows(37))
    )
    assert same_arrays(
        samples, arrays(sensor, simulation(sensor, noisy_parameters(sensor)).windows(1))
    )


def test_seeds_differ_and_repeat(sensor: Sensor) -> None:
    samples, other_samples = (
        whole_run(sensor, noisy_parameters(sensor)),
        whole_run(sensor, {**noisy_parameters(sensor), "seed": 4}),
    )
    assert not same_arrays(samples, other_samples)
    assert same_arrays(samples, whole_run(sensor, noisy_parameters(sensor)))


def test_no_sample_of_the_imu_depends_on_it(sensor: Sensor) -> None:
    with_it = simulation(sensor, noisy_parameters(sensor)).next(10**6)["imu"]
    alone = Body(load_simulation(BOARD)).next(10**6)["imu"]
    assert all(np.array_equal(getattr(alone, n), getattr(with_it, n)) for n in ("gyro", "accel"))


def test_truth_is_complete_and_python_returns_it(sensor: Sensor) -> None:
    """Each array has a row for every sample; what is lost is in the truth, not in the readings."""
    lossy = {"dropout_probability": 0.5}
    if sensor.with_imu:
        values = {
            **noisy_parameters(sensor),
            **{f"imu.{name}": value for name, value in lossy.items()},
        }
    else:
        values = noisy_parameters(sensor, **lossy)
    run = simulation(sensor, values)
    block = run.next(10**6)
    samples = block[sensor.quantity]
    assert 0 < len(samples.delivered) < len(samples.true_t_ns)
    for field in fields(sensor.readings):  # type: ignore[arg-type]
        array = getattr(samples, field.name)
        assert len(array) == len(samples.true_t_ns), field.name
        assert np.issubdtype(array.dtype, np.number), field.name
    flight = Flight(run, [block], "all")
    recorded = getattr(flight, sensor.quantity)
    assert len(recorded) == len(samples.delivered)
    assert sensor.quantity in dir(flight)


@pytest.mark.parametrize("name", ["all.mcap", "all.bag"])
def test_messages_there_and_back(sensor: Sensor, tmp_path: Path, name: str) -> None:
    flight = ims.simulate(**{**nested(noisy_parameters(sensor)), "sensors": [sensor.quantity]})
    topics = ["imu/data_raw", *(topic.name for topic in sensor.topics)]
    path = flight.save(tmp_path / name, topics=topics)
    if sensor.table is None or not sensor.table.is_converted:  # its messages are no rows of one
        assert path.stat().st_size > 0
        return
    back = sensor_tables.read_table(path, sensor.table, f"/{sensor.table.topic}")
    samples = getattr(flight, sensor.quantity)
    assert np.array_equal(back.t_ns, samples.t_ns)
    assert np.array_equal(back.values, sensor.values(samples))


@pytest.mark.parametrize("form", ["euroc", "csv"])
def test_text_there_and_back(sensor: Sensor, tmp_path: Path, form: str) -> None:
    flight = ims.simulate(**{**nested(noisy_parameters(sensor)), "sensors": [sensor.quantity]})
    topics = ["imu/data_raw", sensor.topics[0].name]
    if sensor.table is None:
        with pytest.raises(ims.InputError, match=f"does not exist in {form}"):
            flight.save(tmp_path / "text", format=form, topics=topics)
        return
    folder = flight.save(tmp_path / "text", format=form, topics=topics)
    assert sensor.table.name in reading_tables()
    back = sensor_tables.read_table(folder, sensor.table)
    samples = getattr(flight, sensor.quantity)
    assert np.array_equal(back.t_ns, samples.t_ns)
    assert np.array_equal(back.values, sensor.values(samples))


def test_a_dropout_loses_messages_of_its_sensor_alone(sensor: Sensor) -> None:
    if not sensor.faults:
        with pytest.raises(ims.ConfigurationError, match="fault triad"):
            simulation(sensor, noisy_parameters(sensor)).inject(
                Fault("bias_jump", 1.0, 1.0, sensor.name)
            )
        return
    plain = whole_run(sensor, noisy_parameters(sensor))
    run = simulation(sensor, noisy_parameters(sensor))
    run.inject(Fault("dropout", 1.0, 1.0, sensor.name))
    block = run.next(10**6)
    samples = block[sensor.quantity]
    lost = np.setdiff1d(np.arange(len(samples.t_ns)), samples.delivered)
    since = (samples.true_t_ns[lost] - run.t0_ns) * 1e-9
    assert len(lost) == np.count_nonzero(samples.true_t_ns < run.t0_ns + 10**9) > 0
    assert since.max() < 1.0
    assert same_arrays(plain, arrays(sensor, [block]))
    assert len(block["imu"].delivered) == len(block["imu"].t_ns)


def test_live_parameters_change_from_the_next_block_on(sensor: Sensor) -> None:
    live = [name for name, declaration in parameters(sensor.section).items() if declaration.live]
    name = next((name for name in live if name.startswith("noise")), None)
    if name is None:  # no noise of it is live
        return
    plain = whole_run(sensor, noisy_parameters(sensor))
    run = simulation(sensor, noisy_parameters(sensor))
    earlier = run.next(300)
    run.update(load_simulation(noisy_parameters(sensor), {f"{prefix(sensor)}{name}": 0.0}))
    both = arrays(sensor, [earlier, run.next(10**6)])
    count = len(earlier[sensor.quantity].t_ns)
    differs = [n for n in plain if not np.array_equal(plain[n], both[n])]
    assert differs
    assert all(np.array_equal(plain[n][:count], both[n][:count]) for n in plain)


def test_declared_once_for_all(sensor: Sensor) -> None:
    """Topics and tables have names of their own, and headers as many columns as numbers."""
    neighbours = [candidate for candidate in sensors_of_imus() if candidate.name != sensor.name]
    assert not {t.name for t in sensor.topics} & {
        t.name for candidate in neighbours for t in candidate.topics
    }
    if sensor.table is not None:
        assert sensor.topics[0].name == sensor.table.topic
        assert {h.count(",") for h in sensor.table.headers.values()} == {sensor.table.columns}
        assert set(sensor.table.headers) == {"euroc", "csv"}
    flags = {flag for topic in sensor.topics for flag in topic.flags} - {"biases"}
    switches = fields(sensor.switches) if sensor.switches else ()
    assert flags == {candidate.name for candidate in switches}


def test_it_is_in_the_manual(sensor: Sensor) -> None:
    """The reference has a sensor's parameters, a page its topics."""
    pages = [page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md")]
    assert all(any(topic.name in page for page in pages) for topic in sensor.topics)
    if sensor.name in SENSORS:
        reference = (ROOT / "docs/reference/parameters.md").read_text(encoding="utf-8")
        for name in parameters(sensor.section):
            assert f"`{prefix(sensor)}{name}`" in reference, name


def test_sections_are_frozen(sensor: Sensor) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(sensor.section(), next(iter(parameters(sensor.section))), 0)
