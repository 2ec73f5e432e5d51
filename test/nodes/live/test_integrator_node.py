# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The integrator as a real process: what it publishes is the dead reckoning of what it read."""

import math
import signal
import time

import numpy as np
import pytest
from ros_messages import stamps_ns

from imu_sim_ros.bags.messages.encode import ImuEncoder, OdometryEncoder
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.nodes import messages as decode

pytestmark = pytest.mark.ros

ACCEL = [0.2, 0.0, 9.81]
ODOMETRY = "dead_reckoned/odom"


@pytest.fixture
def odometry(listener):
    """Return the listener, which hears the odometry."""
    from nav_msgs.msg import Odometry

    listener.listen(ODOMETRY, Odometry)
    return listener


def hear_diagnostics(listener):
    from diagnostic_msgs.msg import DiagnosticArray

    listener.listen("/diagnostics", DiagnosticArray)


def wait_for_value(listener, key: str, value: str) -> dict[str, str]:
    """Wait for a value in the diagnostics; return all values that came with it."""

    def values() -> dict[str, str]:
        diagnostics = listener.messages("/diagnostics")[-1:]
        return {
            entry.key: entry.value for message in diagnostics for entry in message.status[0].values
        }

    listener.wait_until(lambda: values().get(key) == value, f"{key} {value}")
    return values()


def xyz(vectors) -> np.ndarray:
    return np.array([[v.x, v.y, v.z] for v in vectors])


def positions(messages) -> np.ndarray:
    return xyz([m.pose.pose.position for m in messages])


def attitudes(messages) -> np.ndarray:
    orientations = [m.pose.pose.orientation for m in messages]
    return np.array([[q.w, q.x, q.y, q.z] for q in orientations])


def velocities(messages) -> np.ndarray:
    return xyz([m.twist.twist.linear for m in messages])


def distance(k: int, rate: float = 200.0) -> float:
    """Return how far ACCEL moves a body in k intervals: midpoint integrates it without error."""
    return 0.5 * ACCEL[0] * (k / rate) ** 2


def test_every_reading_gives_an_odometry(node, feed, odometry):
    integrator = node("integrator", "--imu", "perfect")
    odometry.wait_for_publishers()
    feed(count=400, topics=["imu"], accel=ACCEL).finish()
    odometry.wait_for(ODOMETRY, 400)
    assert integrator.end() == 0
    rows = odometry.messages(ODOMETRY)
    assert stamps_ns(rows) == [10**9 + 5_000_000 * k for k in range(400)]
    assert {(m.header.frame_id, m.child_frame_id) for m in rows} == {("world", "base_link")}
    x = positions(rows)[:, 0]
    np.testing.assert_allclose(x, [distance(k) for k in range(400)], atol=1e-12)
    assert velocities(rows)[-1, 0] == pytest.approx(ACCEL[0] * 399 / 200.0, abs=1e-12)


def test_a_driver_that_offers_best_effort_is_heard_while_the_clock_is_silent(
    node, feed, odometry, capfd
):
    hear_diagnostics(odometry)
    integrator = node("integrator", "--ros-args", "-p", "use_sim_time:=true")
    odometry.wait_for_publishers()
    feed(count=100, topics=["imu"], best_effort=True).finish()
    odometry.wait_for(ODOMETRY, 100)
    wait_for_value(odometry, "readings", "100")
    assert integrator.end() == 0
    assert len(odometry.raw[ODOMETRY]) == 100
    assert "imu/data_raw is offered as best effort" in integrator.output
    assert "incompatible" not in capfd.readouterr().err + integrator.output


def test_best_effort_is_requested_if_the_simulator_offers_it(node):
    """The simulator waits for the subscriber, and the subscriber for the simulator."""
    integrator = node("integrator")
    simulator = node(
        *("simulator", "--duration", "1", "--wait_for_subscribers", "1", "--ros-args", "-p"),
        "qos_overrides./imu/data_raw.publisher.reliability:=best_effort",
    )
    assert simulator.status() == 0
    assert "incompatible" not in simulator.output
    assert integrator.end() == 0
    assert "received 200 messages on imu/data_raw" in integrator.output
    assert "imu/data_raw is offered as best effort" in integrator.output


def test_gaps_and_duplicates_are_warned_of_and_counted_in_the_diagnostics(node, feed, odometry):
    hear_diagnostics(odometry)
    integrator = node("integrator")
    odometry.wait_for_publishers()
    feed(count=250, topics=["imu"], skip=list(range(100, 130)), repeat=[50]).finish()
    values = wait_for_value(odometry, "readings", "221")
    assert (values["gaps"], values["repeated"], values["backward"]) == ("1", "1", "0")
    assert integrator.end() == 0
    assert "reading with the same stamp as the previous one (1)" in integrator.output
    assert len(odometry.raw[ODOMETRY]) == 220


def test_a_truth_that_ends_is_told_next_to_the_errors(node, feed, odometry):
    """The diagnostics used to go on with the last error, as if it were that of now."""
    hear_diagnostics(odometry)
    integrator = node("integrator", "--initial_state", "truth", "--error", "true")
    odometry.wait_for_publishers()
    feed(count=900, truths=200, accel=ACCEL).finish()
    wait_for_value(odometry, "estimates with a truth", "200 of 900")
    assert integrator.end() == 0
    status_messages = [message.status[0].message for message in odometry.messages("/diagnostics")]
    assert "no truth arrives: errors are not those of now" in status_messages


def test_broken_messages_are_refused_counted_and_said_and_the_rest_is_integrated(
    node, feed, odometry
):
    from geometry_msgs.msg import Vector3Stamped

    hear_diagnostics(odometry)
    errors = ("dead_reckoned/position_error", "dead_reckoned/attitude_error")
    for topic in errors:
        odometry.listen(topic, Vector3Stamped)
    integrator = node("integrator", "--initial_state", "truth", "--error", "true")
    odometry.wait_for_publishers()
    truths = [[0, "q_wb", 0.0], [1, "q_wb", math.nan], [2, "position", math.nan]]
    truths += [[3, "position", 1e300], [200, "q_wb", 1e200]]
    readings = [[100, "stamp", [2147483647, 4294967295]], [110, "stamp", [-5, 0]]]
    readings += [[120, "gyro", 1e160], [130, "accel", 1e308], [140, "gyro", math.nan]]
    spoil = [*truths, *readings]
    feed(count=300, accel=ACCEL, spoil=spoil).finish()
    wait_for_value(odometry, "refused messages", str(len(spoil)))
    # It starts at the first sound truth; from there on all but the broken readings give a row.
    odometry.wait_for(ODOMETRY, 300 - 4 - len(readings))
    assert integrator.end() == 0
    assert "Traceback" not in integrator.output
    odometry.settle()
    rows = odometry.messages(ODOMETRY)
    assert len(rows) == 300 - 4 - len(readings)
    for series in (positions(rows), attitudes(rows), velocities(rows)):
        assert np.isfinite(series).all()
    for topic in errors:
        assert np.isfinite(xyz([m.vector for m in odometry.messages(topic)])).all()
    assert "refused: stamp 1.000000000 s: a quaternion of length 0 instead of 1" in (
        integrator.output
    )


def test_reset_begins_again_at_the_initial_state(node, feed, odometry):
    from std_srvs.srv import Trigger

    integrator = node("integrator", "--initial_position", "[3.0, 0.0, 0.0]")
    odometry.wait_for_publishers()
    assert odometry.call("integrator/reset", Trigger).success  # from now on it is quick
    source = feed(count=800, topics=["imu"], accel=ACCEL)
    odometry.wait_for(ODOMETRY, 200)
    assert odometry.call("integrator/reset", Trigger).success
    odometry.wait_for(ODOMETRY, len(odometry.raw[ODOMETRY]) + 200)
    source.close()
    assert integrator.end() == 0
    x = positions(odometry.messages(ODOMETRY))[:, 0]
    (again,) = np.flatnonzero(np.diff(x) < 0)
    assert x[0] == x[again + 1] == 3.0
    np.testing.assert_allclose(
        x[again + 1 :], [3.0 + distance(k) for k in range(len(x) - again - 1)], atol=1e-12
    )


def test_a_driver_that_is_killed_and_started_again_is_integrated_anew(
    without_shared_memory, node, feed, feed_apart, odometry
):
    integrator = node("integrator")
    odometry.wait_for_publishers()
    killed_feed = feed_apart(count=2000, topics=["imu"], accel=ACCEL)
    odometry.wait_for(ODOMETRY, 200)
    killed_feed.kill()
    odometry.settle()
    count_before = len(odometry.raw[ODOMETRY])
    # Its clock goes on, as a wall clock does.
    feed(count=100, first_ns=60 * 10**9, topics=["imu"], accel=ACCEL).finish()
    odometry.wait_for(ODOMETRY, count_before + 100)
    assert integrator.end() == 0
    assert "the source restarted" in integrator.output
    x = positions(odometry.messages(ODOMETRY)[-100:])[:, 0]
    np.testing.assert_allclose(x, [distance(k) for k in range(100)], atol=1e-12)


def test_a_signal_ends_it_with_status_0_while_readings_arrive(node, feed):
    """SIGTERM; the other tests end it with SIGINT."""
    integrator = node("integrator")
    feed(count=20000, rate=1000.0, topics=["imu"]).wait_until_it_begins()
    time.sleep(0.5)
    assert integrator.end(signal.SIGTERM) == 0
    assert "Traceback" not in integrator.output
    assert "received 0 messages on imu/data_raw" not in integrator.output


def test_with_the_simulator_the_error_is_that_of_the_method(node, odometry):
    """Without noise, at 1 kHz on the lecture's trajectory, midpoint is 3 micrometres off after 1 s.

    Every reading of the truth's stamps is there.
    """
    from geometry_msgs.msg import Vector3Stamped
    from nav_msgs.msg import Path

    names = ("position_error", "attitude_error", "roll_pitch_yaw")
    topics = [f"dead_reckoned/{name}" for name in names]
    for topic in topics:
        odometry.listen(topic, Vector3Stamped)
    odometry.listen("dead_reckoned/path", Path)
    options = "--initial_state truth --error true --roll_pitch_yaw true --path_rate 10"
    integrator = node("integrator", *options.split())
    odometry.wait_for_publishers()
    simulator = node(
        "simulator",
        *["--trajectory", "lecture", "--imu", "perfect", "--rate", "1000", "--duration", "1"],
        *["--wait_for_subscribers", "1", "--wait_for_truth_subscribers", "1"],
    )
    assert simulator.status() == 0, simulator.output
    for topic in (ODOMETRY, *topics):
        odometry.wait_for(topic, 1000)
    assert integrator.end() == 0
    assert "incompatible" not in simulator.output
    assert "received 1000 messages on imu/data_raw" in integrator.output
    assert "imu/data_raw is offered as best effort" not in integrator.output
    odometry.settle()
    assert [len(odometry.raw[topic]) for topic in (ODOMETRY, *topics)] == [1000] * 4
    position, attitude, angles = (
        xyz([m.vector for m in odometry.messages(topic)]) for topic in topics
    )
    assert 0 < np.abs(position).max() < 1e-5
    assert 0 < np.abs(attitude).max() < 1e-7
    q_wb = attitudes(odometry.messages(ODOMETRY))
    np.testing.assert_allclose(angles, np.degrees(rotation.to_euler(q_wb)), atol=1e-9)
    # A pose for every 0.1 s of 1 s.
    assert 8 <= len(odometry.messages("dead_reckoned/path")[-1].poses) <= 10


@pytest.mark.parametrize("frame", ["", "i", "im", "imu", "imu_link", "a_longer_name"])
def test_readings_are_found_in_messages_with_any_frame(frame):
    generator = np.random.default_rng(4)
    gyro, accel = generator.normal(size=(2, 1, 3))
    t_ns = np.array([1_234_567_890_123_456_789])
    (payload,) = ImuEncoder(frame, "cdr", 1e-4, 1e-2).encode(t_ns, gyro, accel)
    reading = decode.imu_reading(payload.tobytes())
    assert reading == (t_ns[0], tuple(gyro[0]), tuple(accel[0]), None)
    position, velocity, rate = generator.normal(size=(3, 1, 3))
    q_wb = rotation.normalise(generator.normal(size=(1, 4)))
    for child in ("", "b", "base_link"):
        encoder = OdometryEncoder(frame, child)
        (payload,) = encoder.encode(t_ns, position, q_wb, velocity, rate, np.eye(6), np.eye(6))
        state = decode.truth(payload.tobytes())
        numbers = (position[0], q_wb[0], velocity[0], rate[0])
        assert state[:5] == (t_ns[0], *map(tuple, numbers))
        assert state.frames == (frame, child)


@pytest.mark.parametrize(
    "payload", [b"", b"\x00\x01\x00\x00" + bytes(40), b"\x00\x00" + bytes(400)]
)
def test_bytes_that_are_no_reading_are_refused(payload):
    with pytest.raises(InputError):
        decode.imu_reading(payload)
