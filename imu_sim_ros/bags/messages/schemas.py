# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Message definitions: text, digest and quality of service that a bag carries for its topics."""

import re
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias

import numpy as np

from imu_sim_ros.bags.messages.definitions import ROS1_NAME_OF_GPS_MSGS, digests, texts
from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.yaml_output import as_yaml
from imu_sim_ros.parameters.yaml_text import parse_yaml

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Message: TypeAlias = Any
"""Message as rosbags decodes it, of a class generated from its definition, or a part of one."""


class Schema(NamedTuple):
    """The definition of a message type in one encoding."""

    text: str
    """The definition with all that it contains; empty if it is unknown."""
    digest: str
    """MD5 sum of ROS 1, or hash of ROS 2 (RIHS01)."""
    language: str = "ros2msg"
    """ros2msg or ros2idl."""


@cache
def typestore_of_format(encoding: str) -> "Typestore":
    """Return the message types of ROS 2 Jazzy (cdr) or ROS 1 Noetic (ros1)."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY if encoding == "cdr" else Stores.ROS1_NOETIC)


def ros1_name(type_name: str) -> str:
    """Return the ROS 1 form of a type's name: sensor_msgs/Imu of sensor_msgs/msg/Imu.

    The package gps_msgs of ROS 2 is gps_common in ROS 1.
    """
    package, name = type_name.replace("/msg/", "/").rsplit("/", 1)
    return f"{ROS1_NAME_OF_GPS_MSGS if package == 'gps_msgs' else package}/{name}"


def ros2_name(type_name: str) -> str:
    """Return the ROS 2 form of a type's name: sensor_msgs/msg/Imu of sensor_msgs/Imu."""
    package, *_, name = type_name.split("/")
    return f"{package}/msg/{name}"


def schema(type_name: str, encoding: str, types: "Typestore | None" = None) -> Schema:
    """Return the definition of a type.

    :param type_name: type in the form of ROS 2.
    :param types: where the type is looked up; by default the types that come with ROS.
    :raises InputError: for a type that is not known.
    """
    short = type_name.replace("/msg/", "/")
    name = short if encoding == "cdr" else ros1_name(type_name)
    if types is None and short in digests("ros2"):  # this package writes it
        if encoding == "cdr":
            return Schema(full_definition(name, texts("ros2")), digests("ros2")[name])
        return Schema(full_definition(name, texts("ros1"), "\n"), digests("ros1")[name])
    standard = typestore_of_format(encoding)
    if type_name not in standard.fielddefs and encoding == "ros1":
        # Noetic's types are known without tf2_msgs, whose fields are those of ROS 2.
        standard = Translation(typestore_of_format("cdr"), encoding).target_types
    types = types or standard
    if type_name not in types.fielddefs:
        raise InputError(f"{type_name}: the definition of this message type is not known")
    if encoding == "cdr":
        text, _ = types.generate_msgdef(type_name, ros_version=2)
        return Schema(text, types.hash_rihs01(type_name))
    text, md5 = types.generate_msgdef(type_name, ros_version=1)
    if name in digests("ros1") and standard.fielddefs.get(type_name) == types.fielddefs[type_name]:
        # With its comments, for the bag's type of that name is no other one.
        text = full_definition(name, texts("ros1"), "\n")
    return Schema(text, md5)


def full_definition(name: str, texts: Mapping[str, str], end: str = "") -> str:
    """Return the definition of a type with those that it contains, in the order of its fields.

    :param name: name for instance sensor_msgs/Imu.
    :param texts: definitions by name.
    :param end: behind each of them.
    """
    order: list[str] = []
    waiting = [name]
    while waiting:
        type_name = waiting.pop()
        if type_name in order:
            continue
        order.append(type_name)
        package = type_name.partition("/")[0]
        kinds = [
            line.split()[0].partition("[")[0]
            for line in texts[type_name].splitlines()
            if line.strip()
        ]
        # ROS 1 leaves out the package of neighbours, and of Header.
        names = [(kind, f"{package}/{kind}", f"std_msgs/{kind}") for kind in kinds]
        waiting += reversed([n for type_names in names for n in type_names if n in texts])
    parts = [texts[name], *(f"MSG: {dependency}\n{texts[dependency]}" for dependency in order[1:])]
    return f"{end}{'=' * 80}\n".join(parts) + end


def definitions(type_name: str, encoding: str) -> dict[str, str]:
    """Return the definitions of a type, first, and of those that it contains, by name.

    :param type_name: type in the form of ROS 2.
    """
    whole = schema(type_name, encoding).text
    main_text, *dependencies = re.split(r"^=+\nMSG: ", whole, flags=re.MULTILINE)
    return {
        "": main_text,
        **{part: text for part, _, text in (o.partition("\n") for o in dependencies)},
    }


def decoder(
    schemas: Iterable[tuple[str, Schema]], encoding: str
) -> Callable[[bytes, str], Message]:
    """Return the function that decodes a message, given its bytes and the name of its type.

    :param schemas: names of types in the form of ROS 2, with their definitions.
    :param encoding: ``cdr`` or ``ros1``.
    """
    types = typestore(schemas, encoding)
    return types.deserialize_cdr if encoding == "cdr" else types.deserialize_ros1


def typestore(schemas: Iterable[tuple[str, Schema]], encoding: str) -> "Typestore":
    """Return the types that a bag defines, and ROS's own for those without a definition.

    :param schemas: names of types in the form of ROS 2, with their definitions.
    """
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    fields = {}
    for name, (text, _, language) in schemas:
        if not text:
            known_fields = typestore_of_format(encoding)
            fields.update(
                {key: known_fields.fielddefs[key] for key in _closure(name, known_fields)}
            )
        elif language == "ros2idl":
            for part in _idl_parts(text):
                fields.update(get_types_from_idl(part))
        else:
            fields.update(get_types_from_msg(text, name))
    store = get_typestore(Stores.EMPTY)
    store.register(fields)
    return store


_HEADER: Final = "std_msgs/msg/Header"
_NAMES: Final = {"cdr": "ROS 2", "ros1": "ROS 1"}


class Translation:
    """A bag's types as the other generation of ROS has them, and their messages.

    A type that comes with the other generation has its definition there, any other one keeps its
    own. In most of them only the header differs in its bytes: ROS 1 counts messages in it. Where
    the fields themselves differ (sensor_msgs/Range, visualization_msgs/Marker), messages are
    translated field by field.
    """

    def __init__(self, types: "Typestore", encoding: str) -> None:
        """Translate the types.

        :param encoding: encoding of the result.
        """
        from rosbags.typesys import Stores, get_typestore

        standard = typestore_of_format(encoding)
        fields = dict(types.fielddefs)
        for name in types.fielddefs:
            if standard.fielddefs.get(name, fields[name]) != fields[name]:
                fields.update({part: standard.fielddefs[part] for part in _closure(name, standard)})
        self.target_types = get_typestore(Stores.EMPTY)
        """The types in the other generation."""
        self.target_types.register(fields)
        self._types, self._encoding = types, encoding

    def converter(self, name: str) -> "Callable[[bytes], bytes | memoryview]":
        """Return the function that converts messages of a type to the other generation."""
        source_types, target_types = self._types, self.target_types
        if self._encoding == "ros1":
            if self._has_same_fields(name):
                return lambda data: source_types.cdr_to_ros1(data, name)
            return lambda data: target_types.serialize_ros1(
                self._translate(source_types.deserialize_cdr(data, name), name), name
            )
        if self._has_same_fields(name):
            return lambda data: target_types.ros1_to_cdr(data, name)
        return lambda data: target_types.serialize_cdr(
            self._translate(source_types.deserialize_ros1(data, name), name), name
        )

    def differences(self, name: str) -> list[str]:
        """Return a line for each type within a type whose fields differ."""
        if self._has_same_fields(name):
            return []
        source_fields, target_fields = (
            {n.lower() for n, _ in store.fielddefs[name][1]} for store in self._stores
        )
        lost, added = sorted(source_fields - target_fields), sorted(target_fields - source_fields)
        changes = []
        if lost:
            changes.append(f"{', '.join(lost)} left out")
        if added:
            changes.append(f"{', '.join(added)} 0 or empty")
        generation = _NAMES[self._encoding]
        lines = []
        if changes:
            lines.append(f"{ros1_name(name)} of {generation} is another one: {'; '.join(changes)}")
        parts = {
            part for _, kind in self.target_types.fielddefs[name][1] if (part := _nested_type(kind))
        }
        shared_types = sorted(parts & self._types.fielddefs.keys() - {name})
        for part in shared_types:
            lines += self.differences(part)
        return lines

    @property
    def _stores(self) -> "tuple[Typestore, Typestore]":
        """The types of the bag, and those of the other generation."""
        return self._types, self.target_types

    def _has_same_fields(self, name: str) -> bool:
        """Return whether both types have fields of the same kinds, apart from those of a header."""
        if name == _HEADER:
            return True
        source_kinds, target_kinds = (
            [kind for _, kind in store.fielddefs[name][1]] for store in self._stores
        )
        return source_kinds == target_kinds and all(
            map(self._has_same_fields, filter(None, map(_nested_type, target_kinds)))
        )

    def _translate(self, message: object, name: str) -> Any:
        """Return a message of the other generation with the fields that both have."""
        source_fields = self._types.fielddefs.get(name, ((), ()))[1]
        values = {
            # What is a word of Python has an underscore behind it.
            field.lower(): getattr(message, field, getattr(message, f"{field}_", None))
            for field, _ in source_fields
        }
        fields = self.target_types.fielddefs[name][1]
        return self.target_types.types[name](
            *(self._value(kind, values.get(field.lower())) for field, kind in fields)
        )

    def _value(self, kind: Any, value: Any) -> Any:
        """Return the value of a field; without one, 0 or empty."""
        from rosbags.interfaces import Nodetype

        node, inner = kind
        if node == Nodetype.NAME:
            return self._translate(value if value is not None else SimpleNamespace(), inner)
        if node == Nodetype.BASE:
            return value if value is not None else _default_of(inner)
        part, length = inner
        length = length if node == Nodetype.ARRAY else 0
        if part[0] == Nodetype.NAME:
            elements = value if value is not None else [SimpleNamespace()] * length
            return [self._translate(element, part[1]) for element in elements]
        if value is not None:
            return value
        zero = _default_of(part[1])
        return [zero] * length if isinstance(zero, str) else np.zeros(length, part[1][0])


def _nested_type(kind: Any) -> "str | None":
    """Return the type within a field; None for a plain one."""
    from rosbags.interfaces import Nodetype

    node, inner = kind
    if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        node, inner = inner[0]
    return inner if node == Nodetype.NAME else None


def _default_of(base: Any) -> "str | int":
    """Return the default of a plain field: an empty text, or 0."""
    return "" if base[0] == "string" else 0


def _idl_parts(text: str) -> list[str]:
    """Return the IDL definitions in a text: a type, and those that it contains."""
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


class BrokenMessageError(InputError):
    """Bytes that are not a message of their type."""


class RecordedType(NamedTuple):
    """Storage of messages that arrive as CDR in a bag."""

    schema: Schema
    convert: Callable[[bytes], bytes]
    """Converts a message's CDR to the bag's encoding; BrokenMessageError for malformed bytes."""


def message_type(type_name: str, text: str, digest: str, encoding: str) -> RecordedType:
    """Return definition and conversion of a type, whether or not it comes with ROS.

    :param type_name: type in the form of ROS 2.
    :param text: the installed definition with all that it contains; empty if it is not known.
    :param digest: hash of ROS 2 (RIHS01) of it; empty if it is not known.
    :param encoding: cdr or ros1, as in the bag.
    :raises InputError: for a type whose definition is wanted but unknown.
    """
    source_schema = Schema(text, digest) if text else _standard_schema(type_name)
    if encoding == "cdr":
        return RecordedType(source_schema, _pass_through)
    if not source_schema.text:
        raise InputError(f"{type_name}: a ROS 1 bag needs its definition, which is not installed")
    from rosbags.serde import SerdeError

    types = typestore([(type_name, source_schema)], "cdr")
    translation = Translation(types, "ros1")
    target_schema = schema(type_name, "ros1", translation.target_types)
    convert = translation.converter(type_name)

    def to_ros1(payload: bytes) -> bytes:
        try:
            return bytes(convert(payload))
        except (SerdeError, struct.error, IndexError, ValueError) as error:
            raise BrokenMessageError(f"not a {type_name}: {error}") from None

    return RecordedType(target_schema, to_ros1)


def _standard_schema(type_name: str) -> Schema:
    """Return the definition of a type that comes with ROS; an empty one for any other."""
    try:
        return schema(type_name, "cdr")
    except InputError:
        return Schema("", "")


def _pass_through(payload: bytes) -> bytes:
    """Return a message as it is: it has the bag's encoding already."""
    return payload


# rmw's infinite duration: the largest number of nanoseconds that an int64 holds.
_INFINITE: Final = {"sec": 9223372036, "nsec": 854775807}
# Older versions write rmw's numbers instead of names.
_NUMBERED: Final[dict[str, dict[object, str]]] = {
    "reliability": {1: "reliable", 2: "best_effort"},
    "durability": {1: "transient_local", 2: "volatile"},
    "history": {1: "keep_last", 2: "keep_all"},
}


class Qos(NamedTuple):
    """One profile, in the terms of rosbag2's metadata."""

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "keep_last"
    depth: int = 10


LATCHED: Final = Qos(durability="transient_local", depth=1)


def qos_profiles(profiles: Sequence[Qos]) -> list[dict[str, object]]:
    """Return quality-of-service profiles as rosbag2's metadata lists them."""
    return [
        {
            "history": qos.history,
            "depth": qos.depth,
            "reliability": qos.reliability,
            "durability": qos.durability,
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }
        for qos in profiles
    ]


def qos_text(profiles: Sequence[Qos]) -> str:
    """Return profiles as the text that storage files hold."""
    return as_yaml(qos_profiles(profiles)).strip() if profiles else ""


def parse_qos(profiles: object) -> tuple[Qos, ...]:
    """Return profiles of a bag, given as a list or as the text of one, of any version."""
    try:
        entries = parse_yaml(profiles) if isinstance(profiles, str) else profiles
    except ValueError:
        entries = None
    if not isinstance(entries, list):
        return (Qos(),)
    return tuple(
        Qos(**{name: _policy(name, entry) for name in _NUMBERED}, depth=_depth(entry))
        for entry in entries
        if isinstance(entry, dict)
    )


def _depth(entry: dict[str, object]) -> int:
    """Return the depth of a profile; 10 for a missing or invalid one."""
    value = entry.get("depth")
    return value if isinstance(value, int) and 0 <= value < 2**31 else 10


def _policy(name: str, entry: dict[str, object]) -> str:
    """Return the name of a policy, which a profile states as name or number, or the default."""
    value = entry.get(name)
    default = str(Qos._field_defaults[name])
    numbered = _NUMBERED[name].get(value, default) if isinstance(value, int) else default
    policy = value if isinstance(value, str) else numbered
    return default if policy in ("unknown", "system_default") else policy
