# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The metadata.yaml of a rosbag2 folder, version 9, as ROS 2 Jazzy writes and reads it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from imu_sim_ros.bags.messages.schemas import qos_profiles
from imu_sim_ros.bags.writer import BagTopic

FILE_NAME: Final = "metadata.yaml"
VERSION: Final = 9
_NO_START: Final = 2**63 - 1


class Part(NamedTuple):
    """One file of a bag."""

    name: str
    start_ns: int
    duration_ns: int
    messages: int


def part(path: Path, topics: Sequence[BagTopic]) -> Part:
    """Return the metadata of one file."""
    filled = [topic for topic in topics if topic.count]
    start = min((topic.first_ns for topic in filled), default=_NO_START)
    end = max((topic.last_ns for topic in filled), default=start)
    return Part(path.name, start, end - start, sum(topic.count for topic in filled))


def document(storage: str, topics: Sequence[BagTopic], parts: Sequence[Part]) -> dict[str, Any]:
    """Return the content of metadata.yaml below its root.

    :param storage: mcap or sqlite3.
    """
    filled = [entry for entry in parts if entry.messages]
    start = min((entry.start_ns for entry in filled), default=_NO_START)
    end = max((entry.start_ns + entry.duration_ns for entry in filled), default=start)
    return {
        "version": VERSION,
        "storage_identifier": storage,
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(entry.messages for entry in filled),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": qos_profiles(topic.qos),
                    "type_description_hash": topic.schema.digest,
                },
                "message_count": topic.count,
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [entry.name for entry in parts],
        "files": [
            {
                "path": entry.name,
                "starting_time": {"nanoseconds_since_epoch": entry.start_ns},
                "duration": {"nanoseconds": entry.duration_ns},
                "message_count": entry.messages,
            }
            for entry in parts
        ],
        "custom_data": None,
        "ros_distro": "jazzy",
    }


def write(folder: Path, content: dict[str, Any]) -> None:
    """Write metadata.yaml atomically."""
    import yaml

    text = yaml.safe_dump({"rosbag2_bagfile_information": content}, sort_keys=False)
    temporary = folder / (FILE_NAME + ".tmp")
    temporary.write_text(text, encoding="utf-8")
    temporary.rename(folder / FILE_NAME)
