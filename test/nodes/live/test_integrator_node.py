# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The integrator as a real process: what it publishes is the dead reckoning of what it read."""

import json
import math
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from imu_sim_ros import rotation
from imu_sim_ros.bags.messages.encode import ImuEncoder, OdometryEncoder
from imu_sim_ros.errors import InputError
from imu_sim_ros.nodes import messages as decode

pytestmark = pytest.mark.ros

ACCEL = [0.2, 0.0, 9.81]
CATCH = Path(__file__).with_name("catch.py")
WITHOUT_SHARED_MEMORY = {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}


@pytest.fixture
def catch(start):
    """Return a function that starts the listener of catch.py on topics with their types."""
    return lambda *topics: start(str(CATCH), *topics)


def caught(listener) -> dict[str, list]:
    """End a listener and return what it received, by topic."""
    assert listener.end(signal.SIGTERM) == 0, listener.output
    result: dict[str, list] = {}
    for line in listener.output.splitlines():
        if line.startswith("{"):
            entry = json.loads(line)
            result.setdefault(entry.pop("topic"), []).append(entry)
    return result


def distance(k: int, rate: float = 200.0) -> float:
    """Return how far ACCEL moves a body in k intervals: midpoint integrates it without error."""
    return 0.5 * ACCEL[0] * (k / rate) ** 2


def test_every_reading_gives_an_odometry(node, feed, catch):
    listener = catch("dead_reckoned/odom")
    integrator = node("integrator", "--imu", "perfect")
    listener.wait_for("publisher of dead_reckoned/odom")
    assert feed(count=400, topics=["imu"], accel=ACCEL).status() == 0
    assert integrator.end() == 0
    rows = caught(listener)["dead_reckoned/odom"]
    assert [row["t_ns"] for row in rows] == [10**9 + 5_000_000 * k for k in range(400)]
    assert [row["frames"] for row in rows] == [["world", "base_link"]] * 400
    x = [row["position"][0] for row in rows]
    np.testing.assert_allclose(x, [distance(k) for k in range(400)], atol=1e-12)
    assert rows[-1]["velocity"][0] == pytest.approx(ACCEL[0] * 399 / 200.0, abs=1e-12)


def test_a_driver_that_offers_best_effort_is_heard(node, feed, catch):
    listener = catch("dead_reckoned/odom")
    integrator = node("integrator")
    listener.wait_for("publisher of dead_reckoned/odom")
    driver = feed(count=100, topics=["imu"], best_effort=True)
    assert driver.status() == 0
    assert integrator.end() == 0
    assert len(caught(listener)["dead_reckoned/odom"]) == 100
    assert "imu/data_raw is offered as best effort" in integrator.output
    assert "incompatible" not in driver.output + integrator.output


def test_what_is_requested_is_what_the_simulator_offers(node):
    """The simulator waits for the subscriber, and the subscriber for the simulator."""
    for reliability in ("reliable", "best_effort"):
        integrator = node("integrator")
        simulator = node(
            *("simulator", "--duration", "1", "--wait_for_subscribers", "1", "--ros-args", "-p"),
            f"qos_overrides./imu/data_raw.publisher.reliability:={reliability}",
        )
        assert simulator.status() == 0
        assert "incompatible" not in simulator.output
        assert integrator.end() == 0
        assert "received 200 messages on imu/data_raw" in integrator.output
        likewise = "imu/data_raw is offered as best effort" in integrator.output
        assert likewise == (reliability == "best_effort")


def test_gaps_and_duplicates_are_warned_of_and_counted_in_the_diagnostics(node, feed, catch):
    listener = catch("dead_reckoned/odom", "/diagnostics")
    integrator = node("integrator")
    listener.wait_for("publisher of /diagnostics")
    feed(count=400, topics=["imu"], skip=list(range(100, 130)), repeat=[50], hold=1.5).status()
    assert integrator.end() == 0
    assert "reading with the same stamp as the previous one (1)" in integrator.output
    found = caught(listener)
    assert len(found["dead_reckoned/odom"]) == 370
    values = found["/diagnostics"][-1]["values"]
    assert values["readings"] == "371"
    assert (values["gaps"], values["repeated"], values["backward"]) == ("1", "1", "0")


def test_a_truth_that_ends_is_told_next_to_the_errors(node, feed, catch):
    """The diagnostics used to go on with the last error, as if it were that of now."""
    listener = catch("dead_reckoned/odom", "/diagnostics")
    integrator = node("integrator", "--initial_state", "truth", "--error", "true")
    listener.wait_for("publisher of /diagnostics")
    assert feed(count=900, truths=200, accel=ACCEL, hold=1.5).status() == 0
    assert integrator.end() == 0
    found = caught(listener)["/diagnostics"]
    assert found[-1]["values"]["estimates with a truth"] == "200 of 900"
    said = [entry["message"] for entry in found]
    assert "no truth arrives: errors are not those of now" in said


def test_broken_messages_are_refused_counted_and_said_and_the_rest_is_integrated(node, feed, catch):
    topics = ("dead_reckoned/odom", "dead_reckoned/position_error", "dead_reckoned/attitude_error")
    listener = catch(*topics, "/diagnostics")
    integrator = node("integrator", "--initial_state", "truth", "--error", "true")
    listener.wait_for("publisher of /diagnostics")
    truths = [[0, "q_wb", 0.0], [1, "q_wb", math.nan], [2, "position", math.nan]]
    truths += [[3, "position", 1e300], [200, "q_wb", 1e200]]
    readings = [[100, "stamp", [2147483647, 4294967295]], [110, "stamp", [-5, 0]]]
    readings += [[120, "gyro", 1e160], [130, "accel", 1e308], [140, "gyro", math.nan]]
    spoil = [*truths, *readings]
    assert feed(count=600, accel=ACCEL, spoil=spoil, hold=2.5).status() == 0
    assert integrator.end() == 0
    assert "Traceback" not in integrator.output
    found = caught(listener)
    rows = found["dead_reckoned/odom"]
    # It starts at the first sound truth; from there on all but the broken readings give a row.
    assert len(rows) == 600 - 4 - len(readings)
    numbers = [[*row["position"], *row["q_wb"], *row["velocity"]] for row in rows]
    assert np.isfinite(numbers).all()
    assert all(np.isfinite(row["vector"]).all() for topic in topics[1:] for row in found[topic])
    assert found["/diagnostics"][-1]["values"]["refused messages"] == str(len(spoil))
    assert "refused: stamp 1.000000000 s: a quaternion of length 0 instead of 1" in (
        integrator.output
    )


def test_reset_begins_again_at_the_initial_state(node, feed, catch, listener):
    from std_srvs.srv import Trigger

    caller, listener = listener, catch("dead_reckoned/odom")
    integrator = node("integrator", "--initial_position", "[3.0, 0.0, 0.0]")
    assert caller.call("integrator/reset", Trigger).success  # from now on it is quick
    source = feed(count=800, topics=["imu"], accel=ACCEL)
    source.wait_for("begin")
    time.sleep(1.0)
    assert caller.call("integrator/reset", Trigger).success
    source.status()
    assert integrator.end() == 0
    x = np.array([row["position"][0] for row in caught(listener)["dead_reckoned/odom"]])
    (again,) = np.flatnonzero(np.diff(x) < 0)
    assert x[0] == x[again + 1] == 3.0
    np.testing.assert_allclose(
        x[again + 1 :], [3.0 + distance(k) for k in range(len(x) - again - 1)], atol=1e-12
    )


def test_a_driver_that_is_killed_and_started_again_is_integrated_anew(node, feed, catch):
    listener = catch("dead_reckoned/odom")
    integrator = node("integrator", **WITHOUT_SHARED_MEMORY)
    options = {"topics": ["imu"], "accel": ACCEL, "environment": WITHOUT_SHARED_MEMORY}
    first = feed(count=2000, **options)
    first.wait_for("begin")
    time.sleep(1.0)
    first.kill()
    # Its clock goes on, as a wall clock does.
    assert feed(count=100, first_ns=60 * 10**9, **options).status() == 0
    assert integrator.end() == 0
    assert "the source restarted" in integrator.output
    rows = caught(listener)["dead_reckoned/odom"][-100:]
    x = [row["position"][0] for row in rows]
    np.testing.assert_allclose(x, [distance(k) for k in range(100)], atol=1e-12)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_with_status_0_while_readings_arrive(node, feed, number):
    integrator = node("integrator")
    feed(count=20000, rate=1000.0, topics=["imu"]).wait_for("begin")
    time.sleep(0.5)
    assert integrator.end(number) == 0
    assert "Traceback" not in integrator.output
    assert "received 0 messages on imu/data_raw" not in integrator.output


def test_with_the_simulator_the_error_is_that_of_the_method(node, catch):
    """Without noise, at 1 kHz on the lecture's trajectory, midpoint is a millimetre off after 3 s.

    Every reading of the truth's stamps is there.
    """
    topics = ("dead_reckoned/odom", "dead_reckoned/position_error", "dead_reckoned/attitude_error")
    listener = catch(*topics, "dead_reckoned/roll_pitch_yaw", "dead_reckoned/path")
    options = "--initial_state truth --error true --roll_pitch_yaw true --path_rate 10"
    integrator = node("integrator", *options.split())
    listener.wait_for("publisher of dead_reckoned/path")
    simulator = node(
        "simulator",
        *["--trajectory", "lecture", "--imu", "perfect", "--rate", "1000", "--duration", "3"],
        *["--wait_for_subscribers", "1", "--wait_for_truth_subscribers", "1"],
    )
    assert simulator.status() == 0, simulator.output
    for topic in topics:
        listener.wait_for(f'"topic": "{topic}"', 3000)
    assert integrator.end() == 0
    found = caught(listener)
    assert {topic: len(found[topic]) for topic in topics} == dict.fromkeys(topics, 3000)
    position = np.array([row["vector"] for row in found["dead_reckoned/position_error"]])
    attitude = np.array([row["vector"] for row in found["dead_reckoned/attitude_error"]])
    assert 0 < np.abs(position).max() < 1e-3
    assert 0 < np.abs(attitude).max() < 1e-4
    angles = np.array([row["vector"] for row in found["dead_reckoned/roll_pitch_yaw"]])
    q_wb = np.array([row["q_wb"] for row in found["dead_reckoned/odom"]])
    np.testing.assert_allclose(angles, np.degrees(rotation.to_euler(q_wb)), atol=1e-9)
    # A pose for every 0.1 s of 3 s.
    assert 28 <= found["dead_reckoned/path"][-1]["poses"] <= 30


@pytest.mark.parametrize("frame", ["", "i", "im", "imu", "imu_link", "a_longer_name"])
def test_readings_are_found_in_messages_with_any_frame(frame):
    generator = np.random.default_rng(4)
    gyro, accel = generator.normal(size=(2, 1, 3))
    t_ns = np.array([1_234_567_890_123_456_789])
    (payload,) = ImuEncoder(frame, "cdr", 1e-4, 1e-2).encode(t_ns, gyro, accel)
    found = decode.imu_reading(payload.tobytes())
    assert found == (t_ns[0], tuple(gyro[0]), tuple(accel[0]))
    position, velocity, rate = generator.normal(size=(3, 1, 3))
    q_wb = rotation.normalise(generator.normal(size=(1, 4)))
    for child in ("", "b", "base_link"):
        encoder = OdometryEncoder(frame, child)
        (payload,) = encoder.encode(t_ns, position, q_wb, velocity, rate, np.eye(6), np.eye(6))
        found = decode.truth(payload.tobytes())
        numbers = (position[0], q_wb[0], velocity[0], rate[0])
        assert found == (t_ns[0], *map(tuple, numbers), (frame, child))


@pytest.mark.parametrize(
    "payload", [b"", b"\x00\x01\x00\x00" + bytes(40), b"\x00\x00" + bytes(400)]
)
def test_bytes_that_are_no_reading_are_refused(payload):
    with pytest.raises(InputError):
        decode.imu_reading(payload)
