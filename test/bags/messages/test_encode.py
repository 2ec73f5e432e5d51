# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bytes of messages against rosbags' serialisation, for random content."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from imu_sim_ros.bags.messages import encode, layouts
from imu_sim_ros.bags.messages.decode import MessageDecoder
from imu_sim_ros.bags.messages.layouts import STAMP_OFFSET
from imu_sim_ros.bags.messages.transforms import PathEncoder, TransformsEncoder
from imu_sim_ros.core.errors import InputError

STORES = {"cdr": get_typestore(Stores.ROS2_JAZZY), "ros1": get_typestore(Stores.ROS1_NOETIC)}
N = 5
MANY = 20
"""Messages that are not made as whole rows."""
FRAMES = ("imu_link", "a", "", "imu/ä", "x" * 13)


def _messages(name, encoding, frame, rng, count):
    t_ns = rng.integers(0, 2**31 - 1, count) * 10**9 + rng.integers(0, 10**9, count)
    a, b, c, d = rng.standard_normal((4, count, 3))
    q = rng.standard_normal((count, 4))
    covariances = rng.standard_normal((2, count, 6, 6))
    if name == encode.IMU:
        matrix = rng.standard_normal((3, 3))
        rows = encode.ImuEncoder(frame, encoding, matrix, (1.0, 2.0, 3.0)).encode(t_ns, a, b)
        return (
            t_ns,
            rows,
            lambda m, k: (
                (m.angular_velocity, a[k]),
                (m.linear_acceleration, b[k]),
                (m.angular_velocity_covariance, matrix.ravel()),
                (m.linear_acceleration_covariance, np.diag([1.0, 2.0, 3.0]).ravel()),
                (m.orientation_covariance, [-1.0] + [0.0] * 8),
                (m.orientation, (0.0, 0.0, 0.0, 1.0)),
            ),
        )
    if name == encode.ODOMETRY:
        encoder = encode.OdometryEncoder(frame, "child", encoding)
        rows = encoder.encode(t_ns, a, q, c, d, *covariances)
        return (
            t_ns,
            rows,
            lambda m, k: (
                (m.pose.pose.position, a[k]),
                (m.pose.pose.orientation, q[k][[1, 2, 3, 0]]),
                (m.twist.twist.linear, c[k]),
                (m.twist.twist.angular, d[k]),
                (m.pose.covariance, covariances[0][k].ravel()),
                (m.twist.covariance, covariances[1][k].ravel()),
            ),
        )
    return _small_messages(name, encoding, frame, t_ns, a, b, q)


def _small_messages(name, encoding, frame, t_ns, a, b, q):
    if name == encode.POSE_STAMPED:
        rows = encode.PoseStampedEncoder(frame, encoding).encode(t_ns, a, q)
        return (
            t_ns,
            rows,
            lambda m, k: (
                (m.pose.position, a[k]),
                (m.pose.orientation, q[k][[1, 2, 3, 0]]),
            ),
        )
    if name == encode.VECTOR3_STAMPED:
        rows = encode.Vector3StampedEncoder(frame, encoding).encode(t_ns, a)
        return t_ns, rows, lambda m, k: ((m.vector, a[k]),)
    if name == encode.MAGNETIC_FIELD:
        rows = encode.MagneticFieldEncoder(frame, encoding).encode(t_ns, a, (1.0, 2.0, 3.0))
        variances = np.diag([1.0, 2.0, 3.0]).ravel()
        return (
            t_ns,
            rows,
            lambda m, k: (
                (m.magnetic_field, a[k]),
                (m.magnetic_field_covariance, variances),
            ),
        )
    if name == encode.FLUID_PRESSURE:
        rows = encode.FluidPressureEncoder(frame, encoding).encode(t_ns, b[:, 0], 0.5)
        return t_ns, rows, lambda m, k: (([m.fluid_pressure, m.variance], [b[k, 0], 0.5]),)
    if name == encode.NAV_SAT_FIX:
        rows = encode.NavSatFixEncoder(frame, encoding).encode(t_ns, *b[:, :3].T)
        return (
            t_ns,
            rows,
            lambda m, k: (
                ([m.latitude, m.longitude, m.altitude], b[k, :3]),
                (m.position_covariance, np.zeros(9)),
                ([m.status.status, m.status.service, m.position_covariance_type], [0, 1, 3]),
            ),
        )
    rows = encode.TemperatureEncoder(frame, encoding).encode(t_ns, a[:, 0], 0.25)
    return t_ns, rows, lambda m, k: (([m.temperature, m.variance], [a[k, 0], 0.25]),)


def _numbers(value):
    if hasattr(value, "x"):
        return [value.x, value.y, value.z] + ([value.w] if hasattr(value, "w") else [])
    return value


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize(
    "name",
    [
        encode.IMU,
        encode.ODOMETRY,
        encode.POSE_STAMPED,
        encode.VECTOR3_STAMPED,
        encode.MAGNETIC_FIELD,
        encode.FLUID_PRESSURE,
        encode.NAV_SAT_FIX,
        encode.TEMPERATURE,
    ],
)
@pytest.mark.parametrize("count", [1, N, MANY])
def test_bytes_equal_those_of_rosbags(count, name, frame, encoding):
    rng = np.random.default_rng(3)
    t_ns, rows, fields = _messages(name, encoding, frame, rng, count)
    assert len(rows) == count
    store = STORES[encoding]
    for k, row in enumerate(rows):
        message = getattr(store, f"deserialize_{encoding}")(row.tobytes(), name)
        assert bytes(getattr(store, f"serialize_{encoding}")(message, name)) == row.tobytes()
        assert message.header.frame_id == frame
        stamp = message.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == t_ns[k]
        for decoded, expected in fields(message, k):
            np.testing.assert_array_equal(_numbers(decoded), expected)


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_clock_messages_have_the_times_that_were_encoded(encoding):
    t_ns = np.array([0, 1, 2_000_000_001])
    rows = encode.ClockEncoder(encoding).encode(t_ns)
    for row, expected in zip(rows, t_ns.tolist(), strict=True):
        message = getattr(STORES[encoding], f"deserialize_{encoding}")(row.tobytes(), encode.CLOCK)
        assert message.clock.sec * 10**9 + message.clock.nanosec == expected


def test_no_samples_are_no_messages():
    rows = encode.ImuEncoder("imu_link").encode(
        np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty((0, 3))
    )
    assert rows.shape == (0, 324)


@pytest.mark.parametrize("count", [1, MANY])
@pytest.mark.parametrize("t_ns", [-1, 2**31 * 10**9])
def test_stamps_that_a_message_cannot_hold(t_ns, count):
    with pytest.raises(InputError, match="a message holds 0 to 2147483647 s"):
        encode.ClockEncoder().encode(np.array([*range(count - 1), t_ns]))


@pytest.mark.parametrize("name", [encode.IMU, encode.ODOMETRY])
def test_single_messages_of_any_frames_are_unpacked_as_by_rosbags(name):
    """One decoder, frames that change from message to message, among them one of no UTF-8."""
    names = {
        encode.IMU: ["angular_velocity", "linear_acceleration"],
        encode.ODOMETRY: ["position", "linear"],
    }[name]
    decoder = MessageDecoder(name, names)
    payloads = []
    for frame in (*FRAMES, FRAMES[0]):
        _, rows, _ = _messages(name, "cdr", frame, np.random.default_rng(len(frame)), N)
        payloads += [row.tobytes() for row in rows]
    payloads.append(payloads[0].replace(b"imu_link", b"imu\xff\xfeink"))
    for payload in payloads:
        message = STORES["cdr"].deserialize_cdr(payload.replace(b"\xff\xfe", b"_l"), name)
        if name == encode.IMU:
            vectors = [message.angular_velocity, message.linear_acceleration]
        else:
            vectors = [message.pose.pose.position, message.twist.twist.linear]
        stamp = message.header.stamp
        expected = (stamp.sec, stamp.nanosec, *_numbers(vectors[0]), *_numbers(vectors[1]))
        assert decoder.numbers(payload) == expected
    for broken in (b"", payloads[0][:40], b"\x00\x00" + payloads[0][2:], payloads[0][:14]):
        with pytest.raises(InputError, match=f"not a {name}"):
            decoder.numbers(broken)


def test_stamps_lie_where_rosbags_puts_them():
    t_ns = np.array([123 * 10**9 + 45])
    stamp = b"\x7b\x00\x00\x00\x2d\x00\x00\x00"
    clock = encode.ClockEncoder().encode(t_ns)[0].tobytes()
    imu = encode.ImuEncoder("i").encode(t_ns, np.zeros((1, 3)), np.zeros((1, 3)))[0].tobytes()
    assert clock.index(stamp) == imu.index(stamp) == STAMP_OFFSET
    transforms = TransformsEncoder([("a", "b"), ("b", "c")])
    (row,) = transforms.encode(t_ns, np.zeros((1, 2, 3)), np.ones((1, 2, 4)))
    assert row.tobytes().index(stamp) == TransformsEncoder.stamp_offset()


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
@pytest.mark.parametrize("frames", [("world", "base_link"), ("w", "é")])
def test_one_odometry_message_has_the_bytes_of_a_block_of_one(encoding, frames):
    rng = np.random.default_rng(7)
    encoder = encode.OdometryEncoder(*frames, encoding)
    fields = [rng.standard_normal(n) for n in (3, 4, 3, 3)]
    fields[0][:2] = -0.0, np.nan
    covariances = list(rng.standard_normal((2, 6, 6)))
    for t_ns in (0, 1_234_567_890_123_456_789):
        for arrays in (fields, fields + covariances):
            row = [values[None] for values in arrays]
            expected = encoder.encode(np.array([t_ns]), *row)[0].tobytes()
            plain = [tuple(values.tolist()) for values in fields] + arrays[4:]
            assert encoder.message(t_ns, *plain) == expected


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
@pytest.mark.parametrize("frame", FRAMES)
def test_one_imu_message_has_the_bytes_of_a_block_of_one(encoding, frame):
    rng = np.random.default_rng(7)
    encoder = encode.ImuEncoder(frame, encoding, rng.standard_normal((3, 3)), (1.0, 2.0, 3.0))
    gyro, accel = rng.standard_normal((2, 3))
    gyro[:2] = -0.0, np.nan
    for t_ns in (0, 1_234_567_890_123_456_789):
        expected = encoder.encode(np.array([t_ns]), gyro[None], accel[None])[0].tobytes()
        assert encoder.message(t_ns, tuple(gyro.tolist()), tuple(accel.tolist())) == expected


@pytest.mark.parametrize("t_ns", [-1, 2**31 * 10**9])
def test_one_imu_message_refuses_a_stamp_as_a_block_does(t_ns):
    with pytest.raises(InputError, match="a message holds 0 to"):
        encode.ImuEncoder("imu_link").message(t_ns, (0.0, 0.0, 0.0), (0.0, 0.0, 9.81))


@pytest.mark.parametrize("t_ns", [-1, 2**31 * 10**9])
def test_one_odometry_message_refuses_a_stamp_as_a_block_does(t_ns):
    encoder = encode.OdometryEncoder("world", "base_link")
    zero = (0.0, 0.0, 0.0)
    with pytest.raises(InputError, match="a message holds 0 to"):
        encoder.message(t_ns, zero, (1.0, *zero), zero, zero)


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("encoding", STORES)
def test_one_other_byte_where_all_are_alike_is_noticed(frame, encoding):
    """And none elsewhere: numbers and padding differ from message to message."""
    rng = np.random.default_rng(3)
    _, rows, _ = _messages(encode.ODOMETRY, encoding, frame, rng, N)
    texts = layouts.texts_of(encode.ODOMETRY, encoding, rows[0].tobytes())
    form = layouts.layout(encode.ODOMETRY, encoding, texts)
    alike = {k for start, stop in form.fixed for k in range(start, stop)}
    assert form.matches(rows)
    for k in range(len(form.template)):
        changed_rows = rows.copy()
        changed_rows[-1, k] ^= 1
        assert form.matches(changed_rows) == (k not in alike), k


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_path_is_what_rosbags_reads(frame, count):
    rng = np.random.default_rng(5)
    encoder, positions, q = PathEncoder(frame), *(rng.standard_normal((count, n)) for n in (3, 4))
    t_ns = [(k + 7) * 10**9 + k for k in range(count)]
    poses = [encoder.pose(*row) for row in zip(t_ns, positions, q, strict=True)]
    store = STORES["cdr"]
    payload = encoder.message(poses)
    message = store.deserialize_cdr(payload, PathEncoder.type_name)
    assert bytes(store.serialize_cdr(message, PathEncoder.type_name)) == payload
    assert message.header.frame_id == frame
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == t_ns[-1]
    assert len(message.poses) == count
    for k, pose in enumerate(message.poses):
        stamp = pose.header.stamp
        assert (pose.header.frame_id, stamp.sec * 10**9 + stamp.nanosec) == (frame, t_ns[k])
        place, turn = pose.pose.position, pose.pose.orientation
        assert (place.x, place.y, place.z) == tuple(positions[k])
        assert (turn.w, turn.x, turn.y, turn.z) == tuple(q[k])
