# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Message definitions: the text and the digest that a bag carries for each of its topics."""

from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from imu_sim_ros.bags.messages.definitions import MD5_SUMS, RIHS01, full_text, joined_text
from imu_sim_ros.errors import InputError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


class Schema(NamedTuple):
    """The definition of a message type in one encoding."""

    text: str
    """The definition with all that it contains; empty where it is unknown."""
    digest: str
    """MD5 sum of ROS 1, or hash of ROS 2 (RIHS01)."""
    language: str = "ros2msg"
    """ros2msg or ros2idl."""


@cache
def known_types(encoding: str) -> "Typestore":
    """Return the message types of ROS 2 Jazzy (cdr) or ROS 1 Noetic (ros1)."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY if encoding == "cdr" else Stores.ROS1_NOETIC)


def ros1_name(type_name: str) -> str:
    """Return the ROS 1 form of a type's name: sensor_msgs/Imu of sensor_msgs/msg/Imu."""
    return type_name.replace("/msg/", "/")


def ros2_name(type_name: str) -> str:
    """Return the ROS 2 form of a type's name: sensor_msgs/msg/Imu of sensor_msgs/Imu."""
    package, *_, name = type_name.split("/")
    return f"{package}/msg/{name}"


def schema(type_name: str, encoding: str, types: "Typestore | None" = None) -> Schema:
    """Return the definition of a type.

    :param type_name: in the form of ROS 2.
    :param types: where the type is looked up; by default the types that come with ROS.
    :raises InputError: for a type that is not known.
    """
    if types is None and (found := _written(ros1_name(type_name), encoding)) is not None:
        return found
    types = types or known_types(encoding)
    if type_name not in types.fielddefs and encoding == "ros1":
        # Noetic's types are known without tf2_msgs, whose fields are those of ROS 2.
        types = translated(known_types("cdr"), encoding)
    if type_name not in types.fielddefs:
        raise InputError(f"{type_name}: the definition of this message type is not known")
    if encoding == "cdr":
        text, _ = types.generate_msgdef(type_name, ros_version=2)
        return Schema(text, types.hash_rihs01(type_name))
    text, md5 = types.generate_msgdef(type_name, ros_version=1)
    own = known_types("ros1").fielddefs.get(type_name)
    full = full_text(ros1_name(type_name))
    # The text with its comments, unless the bag's type of that name is another one.
    return Schema(full if full and own == types.fielddefs[type_name] else text, md5)


def _written(name: str, encoding: str) -> Schema | None:
    """Return the definition of a type that this package writes; None for any other one."""
    if name not in RIHS01:
        return None
    if encoding == "cdr":
        return Schema(joined_text(name), RIHS01[name])
    text = full_text(name)
    return Schema(text, MD5_SUMS[name]) if text else None


def typestore(schemas: Iterable[tuple[str, Schema]], encoding: str) -> "Typestore":
    """Return the types that a bag defines, and for those without definition what ROS knows.

    :param schemas: names of types in the form of ROS 2, with their definitions.
    """
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    found = {}
    for name, (text, _, language) in schemas:
        if not text:
            known = known_types(encoding)
            found.update({key: known.fielddefs[key] for key in _closure(name, known)})
        elif language == "ros2idl":
            for part in _idl_parts(text):
                found.update(get_types_from_idl(part))
        else:
            found.update(get_types_from_msg(text, name))
    store = get_typestore(Stores.EMPTY)
    store.register(found)
    return store


def translated(types: "Typestore", encoding: str) -> "Typestore":
    """Return a bag's types as the other generation of ROS has them.

    Only the header differs in its bytes: ROS 1 counts messages in it.

    :param encoding: of the result.
    """
    from rosbags.typesys import Stores, get_typestore

    header = "std_msgs/msg/Header"
    fields = dict(types.fielddefs)
    if header in fields:
        fields[header] = known_types(encoding).fielddefs[header]
    store = get_typestore(Stores.EMPTY)
    store.register(fields)
    return store


def _idl_parts(text: str) -> list[str]:
    separator = "=" * 80 + "\n"
    if not text.startswith(separator):
        return [text]
    return [part.split("\n", 1)[1] for part in text.split(separator)[1:]]


def _closure(name: str, types: "Typestore") -> set[str]:
    """Return a known type and all types within it; nothing for an unknown one."""
    if name not in types.fielddefs:
        return set()
    text, _ = types.generate_msgdef(name, ros_version=2)
    nested = [line[5:] for line in text.splitlines() if line.startswith("MSG: ")]
    return {name, *(ros2_name(entry) for entry in nested)}
