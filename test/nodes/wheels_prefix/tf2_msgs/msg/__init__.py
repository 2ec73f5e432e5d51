# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""tf2_msgs/TFMessage for the tests on ROS 2's wheels, of which PyPI has none for tf2_msgs.

For a message that is handled as bytes, Fast DDS needs the type's name, members, hash and
description. Those of TFMessage, a list of geometry_msgs/TransformStamped, are assembled from the
installed type support of TransformStamped; the structures are those of Jazzy's
``rosidl_runtime_c``, ``rosidl_typesupport_introspection_c`` and ``..._fastrtps_cpp``. Only bytes
are supported: a message object of this type cannot be published.
"""

import ctypes
from typing import Any, Final

TYPE: Final = "tf2_msgs/msg/TFMessage"
HASH: Final = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
_NAMESPACE: Final = b"tf2_msgs::msg"
_NAME: Final = b"TFMessage"
_FASTRTPS: Final = b"rosidl_typesupport_fastrtps_c"
_INTROSPECTION: Final = b"rosidl_typesupport_introspection_c"
_MESSAGE: Final = 18
"""rosidl_typesupport_introspection_c: ROS_TYPE_MESSAGE."""
_NESTED_UNBOUNDED_SEQUENCE: Final = 145
"""rosidl: FIELD_TYPE_NESTED_TYPE_UNBOUNDED_SEQUENCE."""
_POINTER: Final = ctypes.c_void_p
_TO_HANDLE: Final = ctypes.CFUNCTYPE(_POINTER, _POINTER, ctypes.c_char_p)
_TO_POINTER: Final = ctypes.CFUNCTYPE(_POINTER, _POINTER)


class _TypeSupport(ctypes.Structure):
    """rosidl_message_type_support_t."""

    _fields_ = (
        ("identifier", ctypes.c_char_p),
        ("data", _POINTER),
        ("func", _POINTER),
        ("hash", _POINTER),
        ("description", _POINTER),
        ("sources", _POINTER),
    )


class _Callbacks(ctypes.Structure):
    """message_type_support_callbacks_t: two names, and five pointers that bytes do not need."""

    _fields_ = (
        ("namespace", ctypes.c_char_p),
        ("name", ctypes.c_char_p),
        ("others", _POINTER * 5),
    )


class _Member(ctypes.Structure):
    """rosidl_typesupport_introspection_c__MessageMember; its functions handle message objects."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("type_id", ctypes.c_uint8),
        ("string_upper_bound", ctypes.c_size_t),
        ("members", _POINTER),
        ("is_key", ctypes.c_bool),
        ("is_array", ctypes.c_bool),
        ("array_size", ctypes.c_size_t),
        ("is_upper_bound", ctypes.c_bool),
        ("offset", ctypes.c_uint32),
        ("default_value", _POINTER),
        ("functions", _POINTER * 6),
    )


class _Members(ctypes.Structure):
    """rosidl_typesupport_introspection_c__MessageMembers."""

    _fields_ = (
        ("namespace", ctypes.c_char_p),
        ("name", ctypes.c_char_p),
        ("count", ctypes.c_uint32),
        ("size", ctypes.c_size_t),
        ("has_any_key", ctypes.c_bool),
        ("members", _POINTER),
        ("functions", _POINTER * 2),
    )


class _Hash(ctypes.Structure):
    """rosidl_type_hash_t."""

    _fields_ = (("version", ctypes.c_uint8), ("value", ctypes.c_uint8 * 32))


class _String(ctypes.Structure):
    """rosidl_runtime_c__String."""

    _fields_ = (
        ("data", ctypes.c_char_p),
        ("size", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
    )


class _Sequence(ctypes.Structure):
    """A sequence of any type."""

    _fields_ = (
        ("data", _POINTER),
        ("size", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
    )


class _FieldType(ctypes.Structure):
    """rosidl_runtime_c__type_description__FieldType."""

    _fields_ = (
        ("type_id", ctypes.c_uint8),
        ("capacity", ctypes.c_uint64),
        ("string_capacity", ctypes.c_uint64),
        ("nested_type_name", _String),
    )


class _Field(ctypes.Structure):
    """rosidl_runtime_c__type_description__Field."""

    _fields_ = (("name", _String), ("type", _FieldType), ("default_value", _String))


class _Individual(ctypes.Structure):
    """rosidl_runtime_c__type_description__IndividualTypeDescription."""

    _fields_ = (("type_name", _String), ("fields", _Sequence))


class _Description(ctypes.Structure):
    """rosidl_runtime_c__type_description__TypeDescription."""

    _fields_ = (("type", _Individual), ("referenced", _Sequence))


def _assembled() -> Any:
    """Return a class with a type support made from that of TransformStamped."""
    donor = _donor(_FASTRTPS)
    callbacks = _Callbacks.from_buffer_copy(_Callbacks.from_address(donor.data))
    callbacks.namespace, callbacks.name = _NAMESPACE, _NAME
    member = _Member(
        b"transforms", _MESSAGE, members=ctypes.addressof(_donor(_INTROSPECTION)), is_array=True
    )
    # A message object would be a sequence; none is ever made.
    size = ctypes.sizeof(_Sequence)
    members = _Members(_NAMESPACE, _NAME, 1, size, members=ctypes.addressof(member))
    answers, answer_buffers = _answers(donor)
    supports: dict[bytes, _TypeSupport] = {}

    def find(_: Any, identifier: bytes) -> int | None:
        support = supports.get(identifier)
        return None if support is None else ctypes.addressof(support)

    of_identifier = _TO_HANDLE(find)
    for identifier, data in ((_FASTRTPS, callbacks), (_INTROSPECTION, members)):
        function = ctypes.cast(of_identifier, _POINTER)
        pointer = ctypes.addressof(data)
        supports[identifier] = _TypeSupport(identifier, pointer, function, *answers)
    # The middleware keeps pointers to all of these for the lifetime of the process.
    return _class(
        supports[_FASTRTPS], (supports, of_identifier, callbacks, member, members, answer_buffers)
    )


def _class(support: _TypeSupport, buffers: Any) -> Any:
    """Return a class that rclpy accepts as a generated one."""
    new_capsule = ctypes.pythonapi.PyCapsule_New
    new_capsule.restype, new_capsule.argtypes = (
        ctypes.py_object,
        (_POINTER, ctypes.c_char_p, _POINTER),
    )

    class WithTypeSupport(type):
        _TYPE_SUPPORT = new_capsule(ctypes.addressof(support), None, None)
        # Functions that make and destroy message objects: rclpy checks that they exist.
        _CREATE_ROS_MESSAGE = _CONVERT_FROM_PY = _CONVERT_TO_PY = _DESTROY_ROS_MESSAGE = _no_object
        _KEPT = buffers

    class TFMessage(metaclass=WithTypeSupport):
        """tf2_msgs/TFMessage as bytes."""

        @classmethod
        def get_fields_and_field_types(cls) -> dict[str, str]:
            """Return the names and types of the fields, as generated classes do."""
            return {"transforms": "sequence<geometry_msgs/TransformStamped>"}

    return TFMessage


def _no_object(*_: object) -> None:
    raise TypeError(f"{TYPE} can only be sent and received as bytes if tf2_msgs is not installed")


def _donor(identifier: bytes) -> _TypeSupport:
    """Return a type support of TransformStamped."""
    from geometry_msgs.msg import TransformStamped

    TransformStamped.__class__.__import_type_support__()
    capsule = TransformStamped.__class__._TYPE_SUPPORT
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype, pointer.argtypes = _POINTER, (ctypes.py_object, ctypes.c_char_p)
    generic = _TypeSupport.from_address(pointer(capsule, None))
    handle = _TO_HANDLE(generic.func)(ctypes.addressof(generic), identifier)
    return _TypeSupport.from_address(handle)


def _answers(donor: _TypeSupport) -> tuple[list[Any], Any]:
    """Return the functions for hash, description and sources, with the objects they point to."""
    digest = _Hash(1, (ctypes.c_uint8 * 32)(*bytes.fromhex(HASH.removeprefix("RIHS01_"))))
    described = _TO_POINTER(donor.description)(ctypes.addressof(donor))
    description, description_buffers = _description(_Description.from_address(described))
    sources = _Sequence()  # none, as for any type that was built without its sources
    functions = [_always(structure) for structure in (digest, description, sources)]
    pointers = [ctypes.cast(function, _POINTER) for function in functions]
    return pointers, (functions, digest, description, sources, description_buffers)


def _always(structure: ctypes.Structure) -> Any:
    """Return a C function that returns a pointer to the structure, whatever its argument."""
    address = ctypes.addressof(structure)
    return _TO_POINTER(lambda _: address)


def _description(donor: _Description) -> tuple[_Description, Any]:
    """Return TFMessage's description, with the objects it points to."""
    item: bytes = donor.type.type_name.data
    fields = (_Field * 1)(
        _Field(
            _text(b"transforms"),
            _FieldType(_NESTED_UNBOUNDED_SEQUENCE, 0, 0, _text(item)),
            _text(b""),
        )
    )
    nested = (_Individual * donor.referenced.size).from_address(donor.referenced.data)
    individuals = sorted([*nested, donor.type], key=lambda described: described.type_name.data)
    referenced = (_Individual * len(individuals))(*individuals)
    described_type = _Individual(_text(TYPE.encode()), _Sequence(ctypes.addressof(fields), 1, 1))
    size = len(individuals)
    result = _Description(described_type, _Sequence(ctypes.addressof(referenced), size, size))
    return result, (fields, referenced)


def _text(content: bytes) -> _String:
    return _String(content, len(content), len(content) + 1)


TFMessage = _assembled()
