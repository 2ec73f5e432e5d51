# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Message types as installed on the recording machine, for any container."""

import struct
from collections.abc import Callable
from typing import NamedTuple

from imu_sim_ros.bags.messages.schemas import Schema, schema, translated, typestore
from imu_sim_ros.errors import InputError


class BrokenMessageError(InputError):
    """Bytes that are not a message of their type."""


class RecordedType(NamedTuple):
    """How messages that arrive as CDR are stored in a bag."""

    schema: Schema
    convert: Callable[[bytes], bytes]
    """Converts a message's CDR to the bag's encoding; BrokenMessageError for malformed bytes."""


def recorded_type(type_name: str, text: str, digest: str, encoding: str) -> RecordedType:
    """Return definition and conversion of a type, whether or not it comes with ROS.

    :param type_name: in the form of ROS 2.
    :param text: the installed definition with all that it contains; empty where it is not known.
    :param digest: hash of ROS 2 (RIHS01) of it; empty where it is not known.
    :param encoding: cdr or ros1, what the bag takes.
    :raises InputError: for a type whose definition is wanted but unknown.
    """
    found = Schema(text, digest) if text else _known(type_name)
    if encoding == "cdr":
        return RecordedType(found, _unchanged)
    if not found.text:
        raise InputError(f"{type_name}: a ROS 1 bag needs its definition, which is not installed")
    from rosbags.serde import SerdeError

    types = typestore([(type_name, found)], "cdr")
    own = schema(type_name, "ros1", translated(types, "ros1"))

    def to_ros1(payload: bytes) -> bytes:
        try:
            return bytes(types.cdr_to_ros1(payload, type_name))
        except (SerdeError, struct.error, IndexError, ValueError) as error:
            raise BrokenMessageError(f"not a {type_name}: {error}") from None

    return RecordedType(own, to_ros1)


def _known(type_name: str) -> Schema:
    try:
        return schema(type_name, "cdr")
    except InputError:
        return Schema("", "")


def _unchanged(payload: bytes) -> bytes:
    return payload
