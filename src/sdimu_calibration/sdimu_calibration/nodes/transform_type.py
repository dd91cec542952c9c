"""The type tf2_msgs/msg/TFMessage where its package is not installed: enough of it to send and receive raw bytes.

RViz and every other tool take transforms only under this type. The package is in every ROS installation, but among the
wheels from which this environment is made it is not. DDS needs of a type its name, its hash, its bound on the size
and, for the type object, its members. All of that is taken from visualization_msgs/MarkerArray, the same kind of
message (one sequence of messages), with names and members exchanged. Nothing here can turn a message object into bytes
or back, so publish the bytes of `transforms.TransformMessage` and subscribe raw.
"""

from __future__ import annotations

import ctypes
import sys
from ctypes import CDLL, CFUNCTYPE, POINTER, Structure, c_char_p, c_size_t, c_uint8, c_uint32, c_void_p, pointer
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

PACKAGE, NAME = "tf2_msgs", "TFMessage"
TYPE_NAME = f"{PACKAGE}/msg/{NAME}"
HASH = bytes.fromhex("e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087")
"""REP 2016 hash (RIHS01) of the type; a test computes it from the definition."""

_FIND = CFUNCTYPE(c_void_p, c_void_p, c_char_p)
_GET = CFUNCTYPE(c_void_p, c_void_p)


class _Support(Structure):
    """rosidl_message_type_support_t."""

    _fields_: ClassVar = [
        ("identifier", c_char_p),
        ("data", c_void_p),
        ("find", _FIND),
        ("hash", _GET),
        ("description", c_void_p),
        ("sources", c_void_p),
    ]


class _Callbacks(Structure):
    """message_type_support_callbacks_t: names first, then functions."""

    _fields_: ClassVar = [("namespace", c_char_p), ("name", c_char_p), ("functions", c_void_p * 5)]


class _Member(Structure):
    """rosidl_typesupport_introspection_c__MessageMember."""

    _fields_: ClassVar = [
        ("name", c_char_p),
        ("type_id", c_uint8),
        ("string_upper_bound", c_size_t),
        ("members", c_void_p),
        ("is_key", c_uint8),
        ("is_array", c_uint8),
        ("array_size", c_size_t),
        ("is_upper_bound", c_uint8),
        ("offset", c_uint32),
        ("default_value", c_void_p),
        ("functions", c_void_p * 6),
    ]


class _Members(Structure):
    """rosidl_typesupport_introspection_c__MessageMembers."""

    _fields_: ClassVar = [
        ("namespace", c_char_p),
        ("name", c_char_p),
        ("count", c_uint32),
        ("size", c_size_t),
        ("has_key", c_uint8),
        ("members", POINTER(_Member)),
        ("functions", c_void_p * 2),
    ]


class _Hash(Structure):
    """rosidl_type_hash_t."""

    _fields_: ClassVar = [("version", c_uint8), ("value", c_uint8 * 32)]


@cache
def transform_class() -> type:
    """Return the message class of TFMessage: the installed one, else one for raw bytes.

    Raises ImportError when there is neither the package nor the libraries to stand in for it.
    """
    try:
        from tf2_msgs.msg import TFMessage  # noqa: PLC0415 (may be missing)
    except ImportError:
        return _stand_in()
    return TFMessage  # type: ignore[no-any-return]


def _stand_in() -> type:
    try:
        support = _type_support()
    except (OSError, AttributeError) as error:
        raise ImportError(f"no {TYPE_NAME}, and nothing to stand in for it: {error}") from error
    capsule = _capsule(ctypes.addressof(support))

    class _Meta(type):
        # What rclpy asks of a message class; only the type support is ever used for raw bytes.
        _TYPE_SUPPORT = _CREATE_ROS_MESSAGE = _CONVERT_FROM_PY = _CONVERT_TO_PY = _DESTROY_ROS_MESSAGE = capsule
        _keep = support

    return _Meta(NAME, (), {"__module__": f"{PACKAGE}.msg", "__doc__": "Stand-in for raw bytes."})


@cache
def _type_support() -> _Support:
    """Type support that answers for both the wire and the introspection of the type."""
    wire: _Support = _copied("visualization_msgs", "fastrtps_c", "MarkerArray")
    callbacks = _Callbacks.from_buffer_copy(_Callbacks.from_address(wire.data))
    callbacks.namespace, callbacks.name = _names(callbacks.namespace)
    wire.data = ctypes.addressof(callbacks)

    seen = _copied("visualization_msgs", "introspection_c", "MarkerArray")
    members = _Members.from_buffer_copy(_Members.from_address(seen.data))
    members.namespace, members.name = _names(members.namespace)
    member = _Member.from_buffer_copy(members.members.contents)
    member.name = b"transforms"
    member.members = _handle("geometry_msgs", "introspection_c", "TransformStamped")
    members.members = pointer(member)
    seen.data = ctypes.addressof(members)

    by_identifier = {part.identifier: part for part in (wire, seen)}

    def find(_handle: int, identifier: bytes) -> int | None:
        part = by_identifier.get(identifier)
        return ctypes.addressof(part) if part is not None else None

    type_hash = _Hash(1, (c_uint8 * 32)(*HASH))
    of_type = _GET(lambda _handle: ctypes.addressof(type_hash))
    for part in (wire, seen):
        part.hash, part.find = of_type, _FIND(find)
    wire.keep = (callbacks, members, member, seen, type_hash, by_identifier)
    return wire


def _names(namespace: bytes) -> tuple[bytes, bytes]:
    return namespace.replace(b"visualization_msgs", PACKAGE.encode()), NAME.encode()


def _copied(package: str, kind: str, name: str) -> Any:
    return _Support.from_buffer_copy(_Support.from_address(_handle(package, kind, name)))


def _handle(package: str, kind: str, name: str) -> int:
    """Address of the type support of an installed message."""
    library = CDLL(str(_library(f"lib{package}__rosidl_typesupport_{kind}.so")))
    get = getattr(library, f"rosidl_typesupport_{kind}__get_message_type_support_handle__{package}__msg__{name}")
    get.restype, get.argtypes = c_void_p, []
    return int(get())


def _library(name: str) -> Path:
    path = Path(sys.prefix) / "lib" / name
    return path if path.is_file() else Path(name)


def _capsule(address: int) -> Any:
    new = ctypes.pythonapi.PyCapsule_New
    new.restype, new.argtypes = ctypes.py_object, [c_void_p, c_char_p, c_void_p]
    return new(address, None, None)
