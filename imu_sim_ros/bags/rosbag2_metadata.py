# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The metadata.yaml of a rosbag2 folder, version 9, as ROS 2 Jazzy writes and reads it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from imu_sim_ros.bags.messages.schemas import qos_profiles
from imu_sim_ros.bags.writer import EMPTY, BagTopic, Writer

FILE_NAME: Final = "metadata.yaml"
VERSION: Final = 9


def document(storage: str, topics: Sequence[BagTopic], files: Sequence[Writer]) -> dict[str, Any]:
    """Return the content of metadata.yaml below its root.

    :param storage: mcap or sqlite3.
    :param topics: of the bag.
    :param files: the writers of its files, each with the messages of its own.
    """
    parts = []
    for file in files:
        filled = [topic for topic in file.topics if topic.count]
        start = min((topic.first_ns for topic in filled), default=EMPTY[1])
        end = max((topic.last_ns for topic in filled), default=start)
        parts.append((file.path.name, start, end, file.count))
    start = min((start for _, start, _, count in parts if count), default=EMPTY[1])
    end = max((end for _, _, end, count in parts if count), default=start)
    return {
        "version": VERSION,
        "storage_identifier": storage,
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(count for *_, count in parts),
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
        "relative_file_paths": [name for name, *_ in parts],
        "files": [
            {
                "path": name,
                "starting_time": {"nanoseconds_since_epoch": start},
                "duration": {"nanoseconds": end - start},
                "message_count": count,
            }
            for name, start, end, count in parts
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
