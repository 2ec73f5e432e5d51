# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensors on a body: one folder for each, and what all of them share.

They are listed here, each with the declaration in its folder, which says whether each IMU has it.
Engine, node, ``generate``, datasets, reports and Python go through the list and name none of them.

Another package declares a :class:`~imu_sim_ros.sensors.declaration.Sensor` and either hands it to
:func:`register_sensor`, or names it as an entry point of the group ``imu_sim_ros.sensors``. Entry
points are looked up only for a name that is not known otherwise, and for ``--help``.
"""

import re
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Final

from imu_sim_ros.core import arguments
from imu_sim_ros.core.errors import ConfigurationError, Problems
from imu_sim_ros.core.names import short_repr, suggestion
from imu_sim_ros.core.spelling import argument

if TYPE_CHECKING:
    from collections.abc import Mapping
    from importlib.metadata import EntryPoint

    from imu_sim_ros.inputs.tables import Table
    from imu_sim_ros.sensors.declaration import Sensor, Switch
    from imu_sim_ros.sensors.parameters import MountedParameters

SENSORS: Final = (
    "magnetometer",
    "orientation",
    "barometer",
    "gnss",
    "wheels",
    "lidar",
)
"""The folder of each. A sensor that another one needs comes before it."""
CAMERAS: Final = (
    "names of the cameras on the body, each the namespace of its topics and the prefix of its "
    "own parameters (cam0.camera.rate, ...); none: no camera"
)
"""Description of the parameter ``cameras``."""
ENTRY_POINTS: Final = "imu_sim_ros.sensors"
_NAME: Final = re.compile(r"[a-z][a-z0-9_]*")
_REGISTERED: Final[dict[str, "Sensor[MountedParameters]"]] = {}


@cache
def sensor_declarations() -> "dict[str, Sensor[MountedParameters]]":
    """Return the declarations of all sensors in the list, by name, imported when first used."""
    return {name: import_module(f"{__name__}.{name}.declaration").SENSOR for name in SENSORS}


@cache
def sensors_of_imus() -> "tuple[Sensor[MountedParameters], ...]":
    """Return the sensors that belong to each IMU."""
    return tuple(sensor for sensor in sensor_declarations().values() if sensor.with_imu)


@cache
def switchable_sensors() -> "dict[str, Sensor[MountedParameters]]":
    """Return the sensors that the parameter ``sensors`` switches on, by name."""
    return {name: sensor for name, sensor in sensor_declarations().items() if not sensor.with_imu}


def switches() -> "dict[str, Switch]":
    """Return the options of ``generate`` that ask for files of these sensors, by sensor."""
    asked = ((name, sensor.companions) for name, sensor in switchable_sensors().items())
    return {name: files.switch for name, files in asked if files and files.switch}


def reading_tables() -> "dict[str, Table]":
    """Return the tables of readings other than an IMU's, by name.

    They are those of all sensors of this package and of those that were registered.
    """
    tables = (sensor.table for sensor in (*sensor_declarations().values(), *registered_sensors()))
    return {table.name: table for table in tables if table is not None}


def register_sensor(sensor: object) -> None:
    """Register a sensor of your own under its name, for ``simulate(sensors=[NAME])``.

    A second sensor with the same name replaces the first.

    :param sensor: a :class:`~imu_sim_ros.sensors.declaration.Sensor`; see *Simulate a sensor of
        your own* in the manual.
    :raises ConfigurationError: for anything else, or a name that cannot be used, with a line for
        each problem.

    >>> import imu_sim_ros as ims
    >>> ims.register_sensor("sonar")
    Traceback (most recent call last):
    ...
    imu_sim_ros.core.errors.ArgumentTypeError: sensor = 'sonar': must be a Sensor
    """
    from imu_sim_ros.sensors.declaration import Sensor

    if not isinstance(sensor, Sensor):
        arguments.refuse("sensor", sensor, "a Sensor", wrong_type=True)
    _REGISTERED[_check(sensor, "sensor").name] = sensor


def registered_sensors() -> "tuple[Sensor[MountedParameters], ...]":
    """Return the sensors of other packages that were registered or loaded."""
    return tuple(_REGISTERED.values())


def find_sensor(name: str) -> "Sensor[MountedParameters]":
    """Return a sensor by name: one that is registered, one of ours, or an entry point's.

    :raises ConfigurationError: for a name that does not exist, or cannot be loaded.
    """
    if name in _REGISTERED:
        return _REGISTERED[name]
    if name in switchable_sensors():
        return switchable_sensors()[name]
    offered = _entry_points()
    if name not in offered:
        names = [*switchable_sensors(), *_REGISTERED, *sorted(offered)]
        hint = suggestion(name, names, f"must be one of {', '.join(names) or 'none'}")
        if any(name in (companion.name, companion.quantity) for companion in sensors_of_imus()):
            hint = f"each IMU has it: publish.* and {argument('topics')} choose it"
        raise ConfigurationError(f"sensors: {name!r}: {hint}")
    _REGISTERED[name] = _load(name, offered[name])
    return _REGISTERED[name]


def kind_of(name: str, parameters: "Mapping[str, object]") -> str:
    """Return the kind of a sensor: ``NAME.type``, or its name."""
    return str(parameters.get(f"{name}.type") or name)


def all_sensors() -> "tuple[list[Sensor[MountedParameters]], list[str]]":
    """Return all sensors that `sensors` can name, and a line for each that cannot be loaded.

    This looks up all entry points.
    """
    sensors: list[Sensor[MountedParameters]] = []
    problems = Problems()
    for name in dict.fromkeys([*switchable_sensors(), *_REGISTERED, *sorted(_entry_points())]):
        with problems.collect():
            sensors.append(find_sensor(name))
    return sensors, problems


def is_sensor(name: str) -> bool:
    """Return whether there is a sensor of this name; entry points are looked up."""
    return name in switchable_sensors() or name in _REGISTERED or name in _entry_points()


def _entry_points() -> "dict[str, EntryPoint]":
    """Return the sensors that other packages offer by entry points."""
    from importlib.metadata import entry_points  # a search of all packages; seldom needed

    return {point.name: point for point in entry_points(group=ENTRY_POINTS)}


def _load(name: str, point: "EntryPoint") -> "Sensor[MountedParameters]":
    """Return the sensor of an entry point: a declaration, or a module that has one as SENSOR."""
    try:
        target = point.load()
    except Exception as error:  # code of other people: whatever it raises
        raise ConfigurationError(
            f"sensors: {name!r}: {point.value} cannot be loaded: {error}"
        ) from error
    sensor = _check(getattr(target, "SENSOR", target), f"sensors: {point.value}")
    if sensor.name != name:
        raise ConfigurationError(
            f"sensors: {name!r}: {point.value} is the sensor {sensor.name!r}; the entry point must "
            "have its name"
        )
    return sensor


def _check(sensor: object, what: str) -> "Sensor[MountedParameters]":
    """Return a declaration of another package, checked.

    :raises ConfigurationError: with a line for each problem.
    """
    from imu_sim_ros.sensors.declaration import Sensor
    from imu_sim_ros.sensors.parameters import SensorParameters

    if not isinstance(sensor, Sensor):
        raise ConfigurationError(f"{what}: {short_repr(sensor)} is not a Sensor")
    problems = []
    of_imus = [companion.name for companion in sensors_of_imus()]
    if not _NAME.fullmatch(sensor.name) or sensor.name in of_imus:
        problems.append(
            f"{what}: name = {sensor.name!r}: must be lower-case letters, digits and underscores, "
            "and not that of a sensor of IMUs"
        )
    if sensor.with_imu:
        problems.append(f"{what}: with_imu = True: must be False; `sensors` names it")
    if sensor.quantity != sensor.name:
        problems.append(f"{what}: quantity = {sensor.quantity!r}: must be the name, {sensor.name}")
    if not (isinstance(sensor.section, type) and issubclass(sensor.section, SensorParameters)):
        problems.append(f"{what}: section = {sensor.section!r}: must derive from SensorParameters")
    if not sensor.topics:
        problems.append(f"{what}: topics = (): must be one at least, of the readings")
    if problems:
        raise ConfigurationError(problems)
    return sensor
