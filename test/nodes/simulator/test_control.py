# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator while it runs: services, parameters, faults, stalls, signals."""

import signal
import time
from typing import Any

import numpy as np
import pytest
from programs import PATIENCE
from ros_messages import stamps_ns

from imu_sim_ros.sensors.faults import Fault
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation

pytestmark = pytest.mark.ros

IMU = "imu/data_raw"
READY = {"wait_for_subscribers": 1}


def gyro(messages: list[Any]) -> np.ndarray:
    vectors = [m.angular_velocity for m in messages]
    return np.array([[v.x, v.y, v.z] for v in vectors])


@pytest.fixture
def imu(listener: Any) -> Any:
    from sensor_msgs.msg import Imu

    listener.listen(IMU, Imu)
    return listener


@pytest.mark.parametrize(
    ("settings", "number"),
    [
        ({}, signal.SIGINT),
        ({"autostart": False}, signal.SIGTERM),
        ({"wait_for_subscribers": 9}, signal.SIGINT),
    ],
)
def test_signals_end_it_with_status_0(
    start: Any, imu: Any, number: int, settings: dict[str, Any]
) -> None:
    # The node sleeps for a second between samples.
    node = start("simulator", program=True, rate=1, **settings)
    imu.wait_for(IMU, 0 if settings else 1)
    if settings:
        from rcl_interfaces.srv import ListParameters

        imu.call("simulator/list_parameters", ListParameters)
    node.send(number)
    assert node.status() == 0, node.output
    assert "Traceback" not in node.output


@pytest.mark.parametrize(
    ("as_module", "number"),
    [(False, signal.SIGINT), (True, signal.SIGTERM)],
    ids=["program", "python -m"],
)
def test_a_signal_while_the_process_ends_changes_nothing(
    start: Any, number: int, as_module: bool
) -> None:
    """Launch sends SIGINT to every node when the first has ended, also to one that ends itself."""
    node = start("simulator", program=not as_module, as_module=as_module, duration=0.1)
    end = time.monotonic() + PATIENCE
    while node.process.poll() is None and time.monotonic() < end:
        if "messages on ground_truth/odom" in node.output:  # the last thing that it prints
            node.send(number)
        time.sleep(0.001)
    assert node.process.returncode == 0, node.output


def test_pause_step_and_reset(start: Any, imu: Any) -> None:
    from std_srvs.srv import SetBool, Trigger

    start("simulator", rate=100, seed=1, start_time=5.0, autostart=False, step_samples=3, **READY)
    response = imu.call("simulator/step", Trigger)
    assert (response.success, response.message) == (True, "3 samples")
    imu.wait_for(IMU, 3)
    assert imu.call("simulator/pause", SetBool, data=False).success
    refused = imu.call("simulator/step", Trigger)
    assert not refused.success
    assert "not paused" in refused.message
    imu.wait_for(IMU, 30)
    imu.call("simulator/pause", SetBool, data=True)
    imu.spin(0.3)
    paused_count = len(imu.raw[IMU])
    imu.spin(0.5)
    assert len(imu.raw[IMU]) == paused_count
    imu.call("simulator/step", Trigger)
    imu.wait_for(IMU, paused_count + 3)
    imu.call("simulator/pause", SetBool, data=False)
    imu.wait_for(IMU, paused_count + 30)
    assert imu.call("simulator/reset", Trigger).success
    imu.wait_for(IMU, len(imu.raw[IMU]) + 50)
    messages = imu.messages(IMU)
    t_ns = np.array(stamps_ns(messages))
    (restart,) = np.flatnonzero(np.diff(t_ns) < 0) + 1
    block = Body(load_simulation({"rate": 100, "seed": 1, "start_time": 5})).next(1000)["imu"]
    for part in (slice(0, restart), slice(restart, None)):
        assert t_ns[part].tolist() == block.t_ns[: len(t_ns[part])].tolist()
        np.testing.assert_array_equal(gyro(messages[part]), block.gyro[: len(t_ns[part])])


def test_a_step_that_waits_keeps_nobody_waiting_and_says_why(start: Any, imu: Any) -> None:
    from rcl_interfaces.srv import ListParameters
    from std_srvs.srv import Trigger

    node = start("simulator", autostart=False, wait_for_subscribers=2)
    imu.call("simulator/list_parameters", ListParameters)
    client = imu.node.create_client(Trigger, "simulator/step")
    imu.wait_until(client.service_is_ready, "the service")
    imu.spin(0.3)
    step = client.call_async(Trigger.Request())
    imu.spin(0.2)  # the step waits for samples that do not come
    imu.call("simulator/list_parameters", ListParameters)
    refused = imu.call("simulator/step", Trigger)
    assert (refused.success, refused.message) == (False, "a step is in progress")
    assert not step.done()
    imu.wait_until(step.done, "the end of the step")
    status_text = "0 of 1 samples in 5 s: still waiting to start"
    assert (step.result().success, step.result().message) == (False, status_text)
    client.call_async(Trigger.Request())
    imu.spin(0.5)
    node.send(signal.SIGTERM)
    assert node.status() == 0, node.output
    assert "Traceback" not in node.output
    assert "never awaited" not in node.output


def test_noise_changes_between_two_blocks_and_all_or_nothing(start: Any, imu: Any) -> None:
    node = start("simulator", rate=400, seed=2, start_time=1.0, duration=3.0, **READY)
    imu.wait_for(IMU, 10)
    density = {"imu__gyroscope_noise_density": 0.5}
    late, lost = {"inject__kind": "latency"}, {"inject__kind": "dropout"}
    for values, reason in (
        ({"rate": 100.0}, "rate is read-only"),
        ({"imu__latency": -1.0}, "imu.latency = -1.0: must be a finite number at least 0"),
        ({"imu__latency": 1e9}, "must be a finite number at least 0 and at most 10 [s]"),
        ({"imu__jitter": 1.0}, "imu.jitter = 1: must be at most a quarter of the interval"),
        ({"imu__gyroscope_noise_dnsity": 1.0}, "did you mean imu.gyroscope_noise_density?"),
        ({"inject__kind": "gremlins"}, "must be one of none, bias_jump"),
        ({**late, "inject__value": [1e29, 0.0, 0.0]}, "must be a latency of at most 10 s"),
        (
            {**late, "inject__value": [1e308, 0.0, 0.0]},
            "must be 0 or of a size from 1e-30 to 1e+30",
        ),
        ({**lost, "inject__delay": 1e308}, "inject.delay = 1e+308: must be"),
        ({**lost, "inject__duration": 1e308}, "inject.duration = 1e+308: must be"),
    ):
        result = imu.set("simulator", **density, **values)
        assert not result.successful
        assert reason in result.reason
    assert imu.set("simulator", **density, imu__gyroscope_bias=[1, 2, 3]).successful
    assert imu.wait_for_end(node) == 0, node.output
    messages = imu.messages(IMU)
    variance = np.array([m.angular_velocity_covariance[0] for m in messages])
    (change,) = np.flatnonzero(np.diff(variance)) + 1

    chosen = {"rate": 400, "seed": 2, "start_time": 1, "duration": 3}
    simulation = Body(load_simulation(chosen))
    gyro_before = simulation.next(change)["imu"].gyro
    live_changes = {"imu.gyroscope_noise_density": 0.5, "imu.gyroscope_bias": [1.0, 2, 3]}
    simulation.update(load_simulation(chosen, live_changes))
    expected = np.concatenate([gyro_before, simulation.next(1200)["imu"].gyro])
    np.testing.assert_array_equal(gyro(messages), expected)


def test_many_changes_under_load_lose_nothing(start: Any, imu: Any) -> None:
    node = start("simulator", rate=1000, start_time=1.0, **READY)
    imu.wait_for(IMU, 1)
    for k in range(30):
        accepted = k % 3 != 0
        density = 0.01 + 1e-3 * k if accepted else float("nan")
        result = imu.set("simulator", imu__gyroscope_noise_density=density)
        assert result.successful == accepted
    imu.wait_for(IMU, len(imu.raw[IMU]) + 500)
    node.send(signal.SIGINT)
    assert imu.wait_for_end(node) == 0, node.output
    received = np.array(stamps_ns(imu.messages(IMU)))
    assert received[0] == 10**9
    assert set(np.diff(received)) == {1_000_000}


def test_bias_jump_is_in_the_truth(start: Any, imu: Any) -> None:
    from diagnostic_msgs.msg import DiagnosticArray
    from geometry_msgs.msg import Vector3Stamped

    imu.listen("ground_truth/faults", DiagnosticArray)
    imu.listen("ground_truth/gyroscope_bias", Vector3Stamped)
    chosen = {"rate": 200, "imu.preset": "perfect", "start_time": 1.0, "duration": 3.0}
    settings = {key.replace(".", "__"): value for key, value in chosen.items()}
    node = start("simulator", publish__biases=True, **settings, **READY)
    imu.wait_for(IMU, 10)
    fault = {"inject__value": [0.1, 0.0, 0.2], "inject__duration": 0.5, "inject__delay": 0.1}
    assert imu.set("simulator", inject__kind="bias_jump", **fault).successful
    assert imu.wait_for_end(node) == 0, node.output
    (fault_message,) = imu.messages("ground_truth/faults")
    jump_index = round((stamps_ns([fault_message])[0] - 10**9) / 5_000_000)
    simulation = Body(load_simulation(chosen))
    simulation.inject(Fault("bias_jump", 0.5, (0.1, 0, 0.2), "gyroscope"), jump_index / 200.0)
    block = simulation.next(600)["imu"]
    np.testing.assert_array_equal(gyro(imu.messages(IMU)), block.gyro)
    vectors = [m.vector for m in imu.messages("ground_truth/gyroscope_bias")]
    np.testing.assert_array_equal([[v.x, v.y, v.z] for v in vectors], block.gyro_bias)
    jumped = np.flatnonzero(block.gyro_bias[:, 0] == 0.1)
    assert (jumped[0], len(jumped)) == (jump_index, 100)
    values = {entry.key: entry.value for entry in fault_message.status[0].values}
    assert values == {
        "kind": "bias_jump",
        "imu": "",
        "triad": "gyroscope",
        "duration [s]": "0.5",
        "value": "0.1 0 0.2",
    }


def test_losses_saturation_and_a_stuck_output(start: Any, imu: Any) -> None:
    node = start(
        "simulator", rate=200, imu__preset="lecture", start_time=1.0, duration=4.0, **READY
    )
    imu.wait_for(IMU, 10)
    length = {"inject__duration": 0.25}
    for delay, kind, value in ((0.0, "dropout", 1), (0.5, "saturation", 0.001), (1.0, "stuck", 0)):
        assert imu.set(
            "simulator",
            inject__kind=kind,
            inject__delay=delay,
            inject__value=float(value),
            **length,
        ).successful
    assert not imu.set("simulator", inject__kind="dropout", inject__value=1.5).successful
    assert imu.wait_for_end(node) == 0, node.output
    messages = imu.messages(IMU)
    assert len(messages) == 800 - 50
    assert np.diff(stamps_ns(messages)).max() == 51 * 5_000_000
    readings = gyro(messages)
    saturated = (np.abs(readings) <= 0.001).all(axis=1)
    assert saturated.sum() == 50
    repeated = (np.diff(readings, axis=0) == 0).all(axis=1)
    assert repeated[~saturated[1:]].sum() == 50


def test_latency_delays_messages_and_not_stamps(start: Any, imu: Any) -> None:
    node = start("simulator", rate=100, imu__latency=0.3, duration=1.0, **READY)
    imu.wait_for(IMU, 1)
    first_stamp_ns = stamps_ns(imu.messages(IMU))[0]
    assert time.time_ns() - first_stamp_ns >= 300_000_000
    assert imu.wait_for_end(node) == 0
    assert len(imu.raw[IMU]) == 100


def test_a_stall_is_caught_up(start: Any, imu: Any) -> None:
    node = start("simulator", rate=200, duration=4.0, start_time=1.0, **READY)
    imu.wait_for(IMU, 100)
    node.send(signal.SIGSTOP)
    imu.spin(2.0)
    node.send(signal.SIGCONT)
    assert imu.wait_for_end(node) == 0, node.output
    assert np.diff(stamps_ns(imu.messages(IMU))).tolist() == [5_000_000] * 799
    assert "published late, none lost" in node.output


def test_a_stall_is_skipped_when_told(start: Any, imu: Any) -> None:
    node = start("simulator", rate=200, duration=4.0, start_time=1.0, catch_up=False, **READY)
    imu.wait_for(IMU, 100)
    node.send(signal.SIGSTOP)
    imu.spin(1.0)
    node.send(signal.SIGCONT)
    assert imu.wait_for_end(node) == 0, node.output
    t_ns = np.array(stamps_ns(imu.messages(IMU)))
    skip_lines = [line for line in node.output.splitlines() if "samples skipped" in line]
    skipped = sum(int(line.split()[-3]) for line in skip_lines)
    assert len(t_ns) + skipped == 800
    assert skipped >= 150
    assert np.all(np.diff(t_ns) > 0)
    assert f"published {len(t_ns)} messages on {IMU}" in node.output


def test_killed_and_started_again(start: Any, imu: Any) -> None:
    killed_node = start("simulator", rate=200, seed=1)
    imu.wait_for(IMU, 50)
    killed_node.process.kill()
    assert killed_node.status() == -signal.SIGKILL
    imu.spin(0.3)
    count_before = len(imu.raw[IMU])
    second = start("simulator", rate=200, seed=1)
    imu.wait_for(IMU, count_before + 50)
    assert second.end() == 0
    t_ns = np.array(stamps_ns(imu.messages(IMU)))
    assert np.all(np.diff(t_ns) > 0)  # the wall clock went on in between


def test_faster_than_real_time_with_a_clock(start: Any, imu: Any) -> None:
    from rosgraph_msgs.msg import Clock

    imu.listen("/clock", Clock)
    clock_settings = {"real_time_factor": 5.0, "publish__clock_rate": 50, "start_time": 0.0}
    begin = time.monotonic()
    node = start("simulator", rate=100, duration=5.0, **clock_settings, **READY)
    imu.wait_for(IMU, 500)
    assert time.monotonic() - begin >= 5.0 / 5.0
    assert imu.wait_for_end(node) == 0
    clock = [m.clock.sec * 10**9 + m.clock.nanosec for m in imu.messages("/clock")]
    assert clock == list(range(0, 5 * 10**9, 20_000_000))
    assert stamps_ns(imu.messages(IMU)) == list(range(0, 5 * 10**9, 10_000_000))


def test_as_fast_as_subscribers_acknowledge(start: Any, listener: Any) -> None:
    """More than the 5,000 messages that Fast DDS keeps at most."""
    from rclpy.qos import HistoryPolicy
    from sensor_msgs.msg import Imu

    listener.listen(IMU, Imu, history=HistoryPolicy.KEEP_ALL)
    node = start("simulator", rate=200, duration=30.0, real_time_factor=0.0, **READY)
    assert listener.wait_for_end(node) == 0, node.output
    assert np.diff(stamps_ns(listener.messages(IMU))).tolist() == [5_000_000] * 5_999


def test_follows_the_clock_of_another(start: Any, imu: Any) -> None:
    clock_settings = {"real_time_factor": 3.0, "publish__clock_rate": 250, "start_time": 50.0}
    start("simulator", "--ros-args", "-r", "__ns:=/master", rate=100, **clock_settings)
    follower = start("simulator", rate=200, duration=3.0, use_sim_time=True, **READY)
    assert imu.wait_for_end(follower) == 0, follower.output
    t_ns = np.array(stamps_ns(imu.messages(IMU)))
    assert np.diff(t_ns).tolist() == [5_000_000] * 599
    assert t_ns[0] >= 50 * 10**9


def test_diagnostics_state_rate_subscribers_and_lateness(start: Any, imu: Any) -> None:
    from diagnostic_msgs.msg import DiagnosticArray

    imu.listen("/diagnostics", DiagnosticArray)
    node = start("simulator", rate=200)
    imu.wait_for("/diagnostics", 3)
    assert node.end() == 0
    status = imu.messages("/diagnostics")[2].status[0]
    values = {entry.key: entry.value for entry in status.values}
    assert values["state"] == "running"
    assert values[f"{IMU} subscribers"] == "1"
    # What was published over real time: less on a busy machine, up to eight times as much after.
    assert 0.0 < float(values[f"{IMU} rate [Hz]"]) <= 1600.0
    assert {"lateness p50 [us]", "lateness p99 [us]", "lateness max [us]"} <= set(values)
    assert {"caught up samples", "skipped samples"} <= set(values)


def test_quality_of_service_can_be_overridden(start: Any, listener: Any) -> None:
    from rclpy.qos import ReliabilityPolicy
    from sensor_msgs.msg import Imu

    listener.listen(IMU, Imu, reliability=ReliabilityPolicy.BEST_EFFORT)
    topic = "qos_overrides./imu/data_raw.publisher"
    arguments = ["--ros-args", "-p", f"{topic}.reliability:=best_effort", "-p", f"{topic}.depth:=7"]
    start("simulator", *arguments)
    listener.wait_for(IMU, 5)
    (imu,) = listener.node.get_publishers_info_by_topic(f"/{IMU}")
    (truth,) = listener.node.get_publishers_info_by_topic("/ground_truth/odom")
    assert imu.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert truth.qos_profile.reliability == ReliabilityPolicy.RELIABLE


def test_a_slow_subscriber_does_not_slow_the_others(
    start: Any, imu: Any, listener_on: Any, domains: tuple[int, int]
) -> None:
    from sensor_msgs.msg import Imu

    slow = listener_on(domains[0])
    slow.listen(IMU, Imu, depth=5)  # and never spins
    node = start("simulator", rate=1000, duration=1.0, start_time=1.0, wait_for_subscribers=2)
    assert imu.wait_for_end(node) == 0, node.output
    assert np.diff(stamps_ns(imu.messages(IMU))).tolist() == [1_000_000] * 999
