# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Layouts that follow from the text of a definition, against what rosbags serialises."""

from typing import Any

import numpy as np
import pytest

from imu_sim_ros.bags.messages.layouts import ENCODINGS, TYPES, fields, layout, text_bytes
from imu_sim_ros.bags.messages.schemas import definitions, schema, typestore, typestore_of_format

OTHERS = ("sensor_msgs/msg/RelativeHumidity", "sensor_msgs/msg/Range", "geometry_msgs/msg/Wrench")


def message(store: Any, name: str, numbers: Any) -> Any:
    from rosbags.interfaces import Nodetype

    def field_value(kind: Any, content: Any) -> Any:
        if kind == Nodetype.NAME:
            return message(store, content, numbers)
        if kind == Nodetype.BASE:
            return "word" if content[0] == "string" else next(numbers)
        part, length = content
        base = part[1][0]
        code = base.replace("octet", "uint8")
        return np.array([next(numbers) for _ in range(length)], dtype=code)

    fields = {field: field_value(*node) for field, node in store.fielddefs[name][1]}
    return store.types[name](**fields)


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("type_name", [*TYPES, *OTHERS])
def test_fields_are_where_rosbags_puts_them(type_name: str, encoding: str) -> None:
    """Each number of a message is another one; the layout finds them in order, and no more."""
    if type_name.startswith("gps_msgs"):
        store = typestore([(type_name, schema(type_name, encoding))], encoding)
    else:
        store = typestore_of_format(encoding)
    original = message(store, type_name, iter(range(1, 128)))
    serialise = store.serialize_cdr if encoding == "cdr" else store.serialize_ros1
    content = bytes(serialise(original, type_name))
    message_layout = layout(type_name, encoding, text_bytes(type_name, encoding, content))
    assert len(message_layout.template) == len(content)
    values = np.frombuffer(content, message_layout.dtype)[0]
    names = sorted(message_layout.dtype.names or (), key=message_layout.offset)
    decoded = np.concatenate([np.ravel(values[name]) for name in names])
    arrays = {name for name in names if name.startswith("satellite_")}
    expected = [n for n in decoded if n]
    assert expected == list(range(1, len(expected) + 1))
    assert len(decoded) - len(expected) == len(arrays)


def test_a_name_tells_parts_apart() -> None:
    for type_name in TYPES:
        names = [name for name, kind, _ in fields(type_name) if kind != "text"]
        assert len(names) == len(set(names)), type_name
        assert fields(type_name, "ros1") == fields(type_name), type_name


def test_definitions_are_those_of_the_parts() -> None:
    texts = definitions("sensor_msgs/msg/NavSatFix", "cdr")
    inner = ("std_msgs/Header", "builtin_interfaces/Time", "sensor_msgs/NavSatStatus")
    assert list(texts) == ["", *inner]
    assert texts["builtin_interfaces/Time"].split() == ["int32", "sec", "uint32", "nanosec"]
