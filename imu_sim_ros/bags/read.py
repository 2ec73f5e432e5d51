"""Bags, EuRoC folders and CSV files as arrays."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.errors import InputError

Array = NDArray[np.float64]
Times = NDArray[np.int64]


class TopicInfo(NamedTuple):
    """A topic of a bag."""

    name: str
    type: str
    count: int


class ImuMessages(NamedTuple):
    """n readings of an IMU."""

    t_ns: Times
    """(n,) stamps of the messages."""
    gyro: Array
    """(n, 3) rad/s."""
    accel: Array
    """(n, 3) m/s^2."""
    record_t_ns: Times
    """(n,) when the messages were recorded."""
    frame_id: str


class OdometryMessages(NamedTuple):
    """n odometry messages."""

    t_ns: Times
    """(n,) stamps of the messages."""
    position: Array
    """(n, 3) p_wb [m]."""
    q_wb: Array
    """(n, 4)."""
    velocity_b: Array
    """(n, 3) in the child frame [m/s]."""
    angular_velocity_b: Array
    """(n, 3) in the child frame [rad/s]."""
    pose_covariance: Array
    """(n, 6, 6)."""
    twist_covariance: Array
    """(n, 6, 6)."""
    frame_id: str
    child_frame_id: str


class Bag:
    """An open bag."""

    def __init__(self, path: Path) -> None:
        from rosbags.highlevel import AnyReader

        if not path.exists():
            raise InputError(f"{path}: does not exist")
        self.path = path
        self._reader = AnyReader([path])
        self._reader.open()
        self.topics = [TopicInfo(c.topic, c.msgtype, c.msgcount) for c in self._reader.connections]

    def __enter__(self) -> "Bag":
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.close()

    def messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """Yield record time and message."""
        connections = [c for c in self._reader.connections if c.topic == topic]
        for connection, t_ns, raw in self._reader.messages(connections):
            yield t_ns, self._reader.deserialize(raw, connection.msgtype)


def open_bag(path: str | Path) -> Bag:
    """Open a bag of any kind."""
    return Bag(Path(path))


def _choose(bag: Bag, type_name: str, topic: str | None) -> str:
    found = [info.name for info in bag.topics if info.type == type_name]
    if topic is not None:
        if topic not in found:
            raise InputError(f"{bag.path}: no {type_name} topic {topic}; it has {found}")
        return topic
    if len(found) != 1:
        raise InputError(f"{bag.path}: topics of {type_name}: {', '.join(found) or 'none'}")
    return found[0]


def _stamp(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _vector(v: Any) -> tuple[float, float, float]:
    return v.x, v.y, v.z


def read_imu(path: str | Path, topic: str | None = None) -> ImuMessages:
    """Return all messages of an Imu topic."""
    with open_bag(path) as bag:
        rows = list(bag.messages(_choose(bag, "sensor_msgs/msg/Imu", topic)))
    return ImuMessages(
        np.array([_stamp(m) for _, m in rows], dtype=np.int64),
        np.array([_vector(m.angular_velocity) for _, m in rows]).reshape(-1, 3),
        np.array([_vector(m.linear_acceleration) for _, m in rows]).reshape(-1, 3),
        np.array([t for t, _ in rows], dtype=np.int64),
        rows[0][1].header.frame_id if rows else "",
    )


def imu_blocks(path: str | Path, topic: str | None = None) -> Iterator[ImuMessages]:
    """Yield the messages of an Imu topic in blocks."""
    yield read_imu(path, topic)


def read_odometry(path: str | Path, topic: str | None = None) -> OdometryMessages:
    """Return all messages of an Odometry topic."""
    with open_bag(path) as bag:
        rows = [m for _, m in bag.messages(_choose(bag, "nav_msgs/msg/Odometry", topic))]
    orientations = [m.pose.pose.orientation for m in rows]
    return OdometryMessages(
        np.array([_stamp(m) for m in rows], dtype=np.int64),
        np.array([_vector(m.pose.pose.position) for m in rows]).reshape(-1, 3),
        np.array([(q.w, q.x, q.y, q.z) for q in orientations]).reshape(-1, 4),
        np.array([_vector(m.twist.twist.linear) for m in rows]).reshape(-1, 3),
        np.array([_vector(m.twist.twist.angular) for m in rows]).reshape(-1, 3),
        np.array([m.pose.covariance for m in rows]).reshape(-1, 6, 6),
        np.array([m.twist.covariance for m in rows]).reshape(-1, 6, 6),
        rows[0].header.frame_id if rows else "",
        rows[0].child_frame_id if rows else "",
    )
