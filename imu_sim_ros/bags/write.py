"""Opening a bag for writing: one interface for every container."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.layouts import Bytes
from imu_sim_ros.errors import InputError


class Writer:
    """Messages as bytes into a bag."""

    def __init__(self, path: Path, storage: str) -> None:
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2
        from rosbags.typesys import Stores, get_typestore

        self.encoding = "ros1" if storage == "rosbag1" else "cdr"
        self._writer: Any
        if storage == "rosbag1":
            self._store = get_typestore(Stores.ROS1_NOETIC)
            self._writer = Writer1(path)
        else:
            self._store = get_typestore(Stores.ROS2_JAZZY)
            plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
            self._writer = Writer2(path, version=9, storage_plugin=plugin)
        self._writer.open()

    def add_topic(self, name: str, type_name: str, qos: object = None) -> Any:
        """Return a handle of a new topic."""
        return self._writer.add_connection(name, type_name, typestore=self._store)

    def write(self, topic: Any, t_ns: NDArray[np.int64], payloads: Bytes) -> None:
        """Write messages (n, size) with record times (n,)."""
        for time, payload in zip(t_ns.tolist(), payloads, strict=True):
            self._writer.write(topic, time, payload.tobytes())

    def write_raw(self, topic: Any, t_ns: int, payload: bytes) -> None:
        """Write one message."""
        self._writer.write(topic, t_ns, payload)

    def flush(self) -> None:
        """Make everything so far survive a kill."""

    def close(self) -> None:
        """Finish the bag."""
        self._writer.close()

    def __enter__(self) -> "Writer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_writer(path: str | Path, storage: str | None = None, compression: str = "") -> Writer:
    """Open a bag that does not exist yet.

    :param storage: mcap, sqlite3 or rosbag1; by default rosbag1 for a name that ends in .bag.
    """
    path = Path(path)
    if path.exists():
        raise InputError(f"{path}: exists already; nothing is overwritten")
    return Writer(path, storage or ("rosbag1" if path.suffix == ".bag" else "mcap"))
