# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Message types as they are installed here: their classes, definitions and leading stamps."""

import importlib
import importlib.util
import json
import os
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from imu_sim_ros.bags.messages import STAMP_OFFSET, TransformsEncoder
from imu_sim_ros.errors import InputError
from imu_sim_ros.nodes.topics import transform_type

_BUILTIN = frozenset(
    [
        "bool",
        "byte",
        "char",
        "float32",
        "float64",
        "int8",
        "uint8",
        "int16",
        "uint16",
        "int32",
        "uint32",
        "int64",
        "uint64",
        "string",
        "wstring",
    ]
)
_FIELD = re.compile(r"^\s*([A-Za-z][\w/]*)\s*(?:<=\d+)?\s*(?:\[[^\]]*\])?\s+[A-Za-z]\w*")
_SEPARATOR = "=" * 80
_KNOWN_HERE = {"tf2_msgs/TFMessage": transform_type.DEFINITION}


def message_class(type_name: str) -> Any:
    """Return the Python class of a type such as ``sensor_msgs/msg/Imu``.

    :raises InputError: where its package is not installed.
    :raises MissingDependencyError: where tf2_msgs is not installed and cannot be replaced.
    """
    if type_name == transform_type.TYPE:
        return transform_type.transform_message_class()
    package, _, name = type_name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise InputError(f"{type_name}: the package {package} is not installed here") from None


def stamp_offset(message: Any) -> int | None:
    """Return where in the CDR bytes of a message class its stamp begins; None without a stamp.

    A stamp is the first field of ``std_msgs/Header``; a time at the beginning of a message
    (rosgraph_msgs/Clock) serves as well. Of several transforms the first one counts.
    """
    fields = message.get_fields_and_field_types()
    first = next(iter(fields.values()), "")
    if first == "sequence<geometry_msgs/TransformStamped>":
        return TransformsEncoder.stamp_offset()
    return STAMP_OFFSET if first in ("std_msgs/Header", "builtin_interfaces/Time") else None


@cache
def definition(type_name: str) -> str:
    """Return the full definition: the .msg text, then those of all types within it.

    The form is that of MCAP's ``ros2msg`` and of ROS 1: each further type follows a line of
    80 ``=`` and ``MSG: package/Name``. Empty where the .msg files are not installed.
    """
    package, _, name = type_name.split("/")
    texts: dict[str, str] = {}
    wanted = [f"{package}/{name}"]
    while wanted:
        key = wanted.pop(0)
        if key in texts:
            continue
        path = _find(key.split("/")[0], f"{key.split('/')[1]}.msg")
        if path is None and key not in _KNOWN_HERE:
            return ""
        texts[key] = _KNOWN_HERE[key] if path is None else path.read_text(encoding="utf-8")
        wanted += _nested(texts[key], key.split("/")[0])
    (_, first), *others = texts.items()
    return first + "".join(f"\n{_SEPARATOR}\nMSG: {key}\n{text}" for key, text in others)


@cache
def type_hash(type_name: str) -> str:
    """Return the hash (RIHS01) of a type's definition; empty where it is not installed."""
    package, _, name = type_name.split("/")
    path = _find(package, f"{name}.json")
    if path is None:
        return transform_type.HASH if type_name == transform_type.TYPE else ""
    hashes = json.loads(path.read_text(encoding="utf-8")).get("type_hashes", [])
    return next((h["hash_string"] for h in hashes if h["type_name"] == type_name), "")


def _nested(text: str, package: str) -> Iterator[str]:
    for line in text.splitlines():
        match = _FIELD.match(line.split("#")[0])
        if match is None or match[1] in _BUILTIN:
            continue
        parts = match[1].split("/")
        if parts == ["Header"]:
            yield "std_msgs/Header"
        else:
            yield f"{package if len(parts) == 1 else parts[0]}/{parts[-1]}"


def _find(package: str, name: str) -> Path | None:
    """Return a file of a package's messages: from ament's index, or beside the Python package."""
    folders = [
        Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if prefix
    ]
    folders.append(Path(sys.prefix))
    module = importlib.util.find_spec(package)
    if module is not None and module.origin is not None:
        folders += Path(module.origin).parents
    paths = (folder / "share" / package / "msg" / name for folder in folders)
    return next((path for path in paths if path.is_file()), None)
