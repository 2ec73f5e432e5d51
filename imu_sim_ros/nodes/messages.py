# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Message classes by name, and the fields of Imu and Odometry messages from their bytes."""

import importlib
import importlib.util
import json
import os
import re
import sys
from collections.abc import Iterator
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import numpy as np

from imu_sim_ros.bags.messages.decode import MessageDecoder
from imu_sim_ros.bags.messages.encode import FLUID_PRESSURE, IMU, MAGNETIC_FIELD, ODOMETRY
from imu_sim_ros.bags.messages.layouts import FIRST, STAMP_OFFSET
from imu_sim_ros.bags.messages.transforms import TransformsEncoder
from imu_sim_ros.core import gate, rotation
from imu_sim_ros.core.components import Quaternion
from imu_sim_ros.core.conventions import ACCEL_UNITS, GYRO_UNITS, TRIADS
from imu_sim_ros.core.errors import InputError, MissingDependencyError
from imu_sim_ros.core.records import LiveReading, LiveState, LiveValue
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.timebase import NANOSECONDS_PER_SECOND
from imu_sim_ros.formats.choice import Choice
from imu_sim_ros.sensors.parameters import LiveReadingParameters

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


def message_class(type_name: str) -> Any:
    """Return the Python class of a type such as ``sensor_msgs/msg/Imu``.

    :raises MissingDependencyError: if its package is not installed.
    """
    package, _, name = type_name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise MissingDependencyError(
            f"{type_name}: the package {package} is not installed here ({installation(package)})"
        ) from None


def installation(package: str) -> str:
    """Return how a ROS package can be installed in this environment."""
    distribution = os.environ.get("ROS_DISTRO", "jazzy")
    name = f"ros-{distribution}-{package.replace('_', '-')}"
    try:
        metadata.distribution(f"ros-{distribution}-rclpy")
    except metadata.PackageNotFoundError:
        return f"apt install {name}"
    return f"ROS 2 from wheels lacks it; ROS 2 from apt has it as {name}"


def stamp_offset(message: Any) -> int | None:
    """Return where in the CDR bytes of a message class its stamp begins; None without a stamp.

    A stamp is the first field of ``std_msgs/Header``; a time at the beginning of a message
    (rosgraph_msgs/Clock) serves as well. Of several transforms the first one counts.
    """
    fields = message.get_fields_and_field_types()
    kind = next(iter(fields.values()), "")
    if kind == "sequence<geometry_msgs/TransformStamped>":
        return TransformsEncoder.stamp_offset()
    return STAMP_OFFSET if kind in ("std_msgs/Header", "builtin_interfaces/Time") else None


@cache
def definition(type_name: str) -> str:
    """Return the full definition: the .msg text, then those of all types within it.

    The form is that of MCAP's ``ros2msg`` and of ROS 1: each further type follows a line of
    80 ``=`` and ``MSG: package/Name``. Empty if the .msg files are not installed.
    """
    package, _, name = type_name.split("/")
    texts: dict[str, str] = {}
    queue = [f"{package}/{name}"]
    while queue:
        key = queue.pop(0)
        if key in texts:
            continue
        path = _find(key.split("/")[0], f"{key.split('/')[1]}.msg")
        if path is None:
            return ""
        texts[key] = path.read_text(encoding="utf-8")
        queue += _nested_types(texts[key], key.split("/")[0])
    (_, text_of_type), *dependencies = texts.items()
    return text_of_type + "".join(
        f"\n{_SEPARATOR}\nMSG: {key}\n{text}" for key, text in dependencies
    )


@cache
def type_hash(type_name: str) -> str:
    """Return the hash (RIHS01) of a type's definition; empty if it is not installed."""
    package, _, name = type_name.split("/")
    path = _find(package, f"{name}.json")
    if path is None:
        return ""
    hashes = json.loads(path.read_text(encoding="utf-8")).get("type_hashes", [])
    return next((h["hash_string"] for h in hashes if h["type_name"] == type_name), "")


def _nested_types(text: str, package: str) -> Iterator[str]:
    """Yield the types of fields in a definition that are messages themselves."""
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
    """Return a file of a package's messages: from ament's index, or next to the Python package."""
    folders = [
        Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if prefix
    ]
    folders.append(Path(sys.prefix))
    module = importlib.util.find_spec(package)
    if module is not None and module.origin is not None:
        folders += Path(module.origin).parents
    paths = (folder / "share" / package / "msg" / name for folder in folders)
    return next((path for path in paths if path.is_file()), None)


_READINGS: Final = ("angular_velocity", "linear_acceleration")
_STATES: Final = ("position", "orientation", "linear", "angular")
_ROUNDING: Final = 1e-12
"""Rounding error of the squared length of a quaternion that was written as a unit one."""
_LENGTH: Final = 1e-3
"""Tolerance of the squared length of a quaternion, beyond which it counts as none."""
_FRAME: Final = 12
"""Place of the frame's length: behind the encapsulation and the stamp."""
_FOREIGN: Final = 100
"""Messages of another frame in a row after which their publisher is taken for the IMU's."""
_IMU: Final = (
    *("orientation", f"orientation_covariance{FIRST}", *_READINGS),
    *(f"{name}_covariance{FIRST}" for name in _READINGS),
)
_odometry = MessageDecoder(ODOMETRY, _STATES)
_values = {
    MAGNETIC_FIELD: (MessageDecoder(MAGNETIC_FIELD, ("magnetic_field",)), gate.FIELD),
    FLUID_PRESSURE: (MessageDecoder(FLUID_PRESSURE, ("fluid_pressure",)), gate.PRESSURE),
}


class ReadingDecoder:
    """Decoder of the readings of one IMU in SI units from sensor_msgs/Imu messages."""

    def __init__(
        self,
        parameters: LiveReadingParameters | None = None,
        oriented: bool = False,
    ) -> None:
        """Initialise without messages.

        :param parameters: frame and units of the messages; None: any frame, SI units.
        :param oriented: decode the orientation, too; one of another length than 1 is none.
        """
        self._checks_frame, self._oriented = parameters is not None, oriented
        parameters = LiveReadingParameters() if parameters is None else parameters
        self._parameters, self._frame = parameters, parameters.frame or None
        self._factors = GYRO_UNITS[parameters.gyro_unit], ACCEL_UNITS[parameters.accel_unit]
        self._decoder, self._foreign = MessageDecoder(IMU, _IMU), 0

    def notes(self) -> tuple[str, ...]:
        """Return a line for the frame and for each unit that is converted."""
        parameters = self._parameters
        choice = Choice(
            frame=parameters.frame or None,
            gyro_unit=parameters.gyro_unit,
            accel_unit=parameters.accel_unit,
        )
        return choice.notes()

    def reading(self, payload: bytes) -> LiveReading | None:
        """Return the reading in a message; None for one of a frame that is not chosen.

        :raises InputError: for bytes that are not such a message in little-endian CDR, for a
            reading that the gate refuses, for a triad that the message lacks (its covariance is
            -1), and for a second frame where none is chosen.
        """
        numbers = self._decoder.numbers(payload)
        second, nanosecond, x, y, z, w, stated, gx, gy, gz, no_gyro, ax, ay, az, no_accel = numbers
        if self._checks_frame:
            frame = self._decoder.texts[0]
            if (frame != self._frame or self._foreign) and not self._is_of_frame(frame):
                return None
        if no_gyro == -1.0 or no_accel == -1.0:
            raise _triad_absent(_stamp(second, nanosecond), no_gyro == -1.0, no_accel == -1.0)
        k_gyro, k_accel = self._factors
        if k_gyro != 1.0:
            gx, gy, gz = k_gyro * gx, k_gyro * gy, k_gyro * gz
        if k_accel != 1.0:
            ax, ay, az = k_accel * ax, k_accel * ay, k_accel * az
        t_ns, gyro, accel = second * NANOSECONDS_PER_SECOND + nanosecond, (gx, gy, gz), (ax, ay, az)
        overflows = nanosecond >= NANOSECONDS_PER_SECOND
        if second < 0 or overflows or not gate.is_reading(t_ns, gyro, accel):
            raise _refusal(_stamp(second, nanosecond), (gate.RATE, gyro), (gate.FORCE, accel))
        reading = LiveReading(t_ns, gyro, accel)
        if (
            not self._oriented
            or stated < 0.0
            or not abs(w * w + x * x + y * y + z * z - 1.0) < _LENGTH
        ):
            return reading
        return reading._replace(q_wb=_unit((w, x, y, z)))

    def _is_of_frame(self, frame: str) -> bool:
        """Return whether a message is one of the IMU.

        A publisher that starts again with another frame is followed after _FOREIGN messages.

        :raises InputError: for a second frame where none is chosen.
        """
        if self._frame is None or self._foreign >= _FOREIGN:
            self._frame = frame
        if frame == self._frame:
            self._foreign = 0
            return True
        if self._parameters.frame:
            return False
        self._foreign += 1
        raise InputError(
            f"readings of two frames, {self._frame!r} and {frame!r}: "
            f"{argument('frame', self._frame)} chooses one of them"
        )


def _triad_absent(t_ns: int, no_gyro: bool, no_accel: bool) -> InputError:
    """Return the error of a message without the readings of a triad."""
    names = [name for name, absent in zip(TRIADS, (no_gyro, no_accel), strict=True) if absent]
    kinds = ", ".join(f"{name}_absent" for name in names)
    return InputError(
        f"{gate.stamp_text(t_ns)}: contains no readings of the {' and the '.join(names)} "
        f"(covariance -1): publish both triads in one message, as drivers do on request [{kinds}]"
    )


def imu_reading(payload: bytes) -> LiveReading:
    """Return the reading in a sensor_msgs/Imu of any frame in SI units.

    :raises InputError: as for :meth:`ReadingDecoder.reading`.
    """
    reading = _decoder.reading(payload)
    assert reading is not None  # no frame is chosen
    return reading


_decoder = ReadingDecoder()


def value(type_name: str, payload: bytes) -> LiveValue:
    """Return the measurement in a sensor_msgs/MagneticField or sensor_msgs/FluidPressure.

    :raises InputError: as for :func:`imu_reading`.
    """
    decoder, quantity = _values[type_name]
    second, nanosecond, *numbers = decoder.numbers(payload)
    t_ns = _stamp(second, nanosecond)
    if not gate.Verdict(np.array([t_ns]), [(quantity, np.array([numbers]))]).good.all():
        raise _refusal(t_ns, (quantity, tuple(numbers)))
    return LiveValue(t_ns, tuple(numbers))


def frame_id(payload: bytes) -> str:
    """Return the frame of a message that begins with a header; empty for other bytes."""
    length = int.from_bytes(payload[_FRAME : _FRAME + 4], "little")
    text = payload[_FRAME + 4 : _FRAME + 4 + length]
    if not 0 < length == len(text):
        return ""
    return text[:-1].decode(errors="replace")


def truth(payload: bytes) -> LiveState:
    """Return the state in a nav_msgs/Odometry.

    :raises InputError: for bytes that are not such a message in little-endian CDR, and for a
        state that the gate refuses.
    """
    second, nanosecond, *values = _odometry.numbers(payload)
    t_ns = _stamp(second, nanosecond)
    px, py, pz, x, y, z, w, vx, vy, vz, rx, ry, rz = values
    position, q_wb, velocity, rate = (px, py, pz), (w, x, y, z), (vx, vy, vz), (rx, ry, rz)
    sound = gate.is_pose(t_ns, position, q_wb)
    if not (sound and gate.is_within(velocity, gate.VELOCITY) and gate.is_within(rate, gate.RATE)):
        pose = (gate.POSITION, position), (gate.ORIENTATION, q_wb)
        raise _refusal(t_ns, *pose, (gate.VELOCITY, velocity), (gate.RATE, rate))
    off = abs(w * w + x * x + y * y + z * z - 1.0) > _ROUNDING
    unit = _unit(q_wb) if off else q_wb
    return LiveState(t_ns, position, unit, velocity, rate, frames=_odometry.texts)


def _unit(q: Quaternion[float]) -> Quaternion[float]:
    """Return a quaternion with length 1."""
    w, x, y, z = rotation.normalise(q).tolist()
    return (w, x, y, z)


def _stamp(second: int, nanosecond: int) -> int:
    """Return a stamp [ns].

    :raises InputError: if it is negative or has too many nanoseconds.
    """
    if second < 0:
        raise InputError(f"negative timestamp: {second} s")
    return gate.stamp_ns(second, nanosecond)


def _refusal(t_ns: int, *columns: tuple[gate.Quantity, tuple[float, ...]]) -> InputError:
    """Return the error of values that the gate refuses."""
    rows = [(quantity, np.array([values])) for quantity, values in columns]
    reason = gate.Verdict(np.array([t_ns]), rows).why(0)
    return InputError(f"{gate.stamp_text(t_ns)}: {reason}")
