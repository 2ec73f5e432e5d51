# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the recorder node."""

from collections.abc import Iterator
from dataclasses import dataclass

from imu_sim_ros.bags.writer import COMPRESSED, STORAGES
from imu_sim_ros.parameters.kinds import choice, flag, number, text, texts

RECORD_TIMES = ("stamp", "reception")


@dataclass(frozen=True)
class RecorderParameters:
    """Topics, output and limits of a recording."""

    output: str = text(
        "",
        "bag to write, which must not exist: a folder (rosbag2), NAME.mcap or NAME.bag (ROS 1); "
        "if empty, recording_ and the start time",
    )
    topics: tuple[str, ...] = texts((), "names of the topics; if empty, all topics")
    exclude: tuple[str, ...] = texts(
        ("/rosout", "/parameter_events"), "topics to leave out when all topics are recorded"
    )
    storage: str = choice(
        "auto",
        ("auto", *STORAGES),
        "format of the bag; auto: from the extension of output, mcap for a folder",
    )
    compression: str = choice(
        "none", COMPRESSED, "compression of chunks: lz4 or zstd in mcap, lz4 or bz2 in ROS 1"
    )
    record_time: str = choice(
        "stamp",
        RECORD_TIMES,
        "time that the bag stores for a message: the stamp in its header, if it is set, or "
        "always the time of reception",
    )
    duration: float = number(
        0.0,
        "stop after this time, measured by the stamps of each topic; 0: never",
        unit="s",
        minimum=0.0,
    )
    max_size: float = number(
        0.0, "stop when the bag has this size; 0: never", unit="MB", minimum=0.0
    )
    split_size: float = number(
        0.0, "start a new file at this size; 0: never", unit="MB", minimum=0.0
    )
    split_duration: float = number(
        0.0, "start a new file after this time; 0: never", unit="s", minimum=0.0
    )
    max_gap: float = number(
        0.0,
        "stamps further apart than this are a gap; 0: chosen from their rate",
        unit="s",
        minimum=0.0,
    )
    buffer_size: float = number(
        512.0, "memory for messages while the disk stalls", unit="MB", minimum=1.0
    )
    status: bool = flag(True, "show a live line with counts and rates on a terminal")

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield problems that involve several parameters."""
        storage = self.form()
        allowed = {
            "mcap": ("none", "lz4", "zstd"),
            "sqlite3": ("none",),
            "ros1": ("none", "lz4", "bz2"),
        }[storage]
        if self.compression not in allowed:
            yield (
                f"{prefix}compression = {self.compression!r}: must be one of "
                f"{', '.join(allowed)} in storage {storage}"
            )
        if self.output.endswith(".bag") and storage != "ros1":
            yield f"{prefix}storage = {self.storage!r}: {self.output} is the name of a ROS 1 bag"
        if self.output.endswith(".mcap") and storage != "mcap":
            yield f"{prefix}storage = {self.storage!r}: {self.output} is the name of an MCAP file"

    def form(self) -> str:
        """Return mcap, sqlite3 or ros1: the storage, even if the name decides."""
        if self.storage != "auto":
            return self.storage
        return "ros1" if self.output.endswith(".bag") else "mcap"
