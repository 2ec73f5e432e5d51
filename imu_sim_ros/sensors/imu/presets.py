# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that describe an IMU: presets, parameter files, files of other tools, Gazebo's models."""

from collections.abc import Iterable, Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Final

from imu_sim_ros.core.errors import ConfigurationError, InputError, Problems, Remark, warn
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.files import find, is_included
from imu_sim_ros.parameters.sections import bad_value_lines
from imu_sim_ros.sensors.imu import calibration_files, estimator_settings, sdf
from imu_sim_ros.sensors.imu.parameters import DEFAULT_IMU
from imu_sim_ros.sensors.orientation.parameters import MODEL_ERRORS

_BAROMETER: Final = "imu.barometer_preset"
_OF_MODELS: Final = (".sdf", ".world", ".urdf", ".xacro", ".xml", ".jinja")
"""Ends of the names of Gazebo's models; ``FILE#SENSOR`` is one, too."""


def load(path: str | Path, node: str = "simulator") -> dict[str, object]:
    """Return the parameters that a file gives to a node, by dotted name.

    Keys of other tools' files without an effect, and missing noise, are remarks.

    :param path: path of a ROS 2 parameter file, an IMU's file of another tool, or a flat file;
        ``FILE#imu1`` is one of several IMUs.
    :param node: the node's name without namespace.
    :raises ConfigurationError: for a file that cannot be read or has another form.
    """
    file, imu = files.split_sensor_name(path)
    tree = files.read_tree(file)
    if not imu and (files.has_sections(tree) or not calibration_files.is_readable(tree)):
        parameters = files.parameters_of(tree, file, node)
        if not estimator_settings.is_readable(parameters):
            return parameters
        tree = parameters
    values = calibration_files.parameters_of(tree, file, imu, lambda line: warn(line, Remark))
    return {name: files.resolve_path(name, value, file) for name, value in values.items()}


def load_all(paths: Iterable[str | Path], node: str) -> dict[str, object]:
    """Return the parameters that files give to a node, later files above earlier ones.

    :raises ConfigurationError: with a line for each problem of every file.
    """
    result: dict[str, object] = {}
    problems = Problems()
    for path in paths:
        with problems.collect():
            result.update(load(path, node))
    problems.tell()
    return result


def sensor_layer(
    name_or_file: str,
    node: str = "simulator",
    rate: object = None,
    problems: Problems | None = None,
) -> dict[str, object]:
    """Return the parameters of ``imu.preset``, above those of presets that its file names.

    For a model of Gazebo it contains ``imu.preset`` with the name of the sensor that was taken.

    :param name_or_file: a name in config/imus, a parameter file, an IMU's file of another tool,
        or a model of Gazebo, ``model.sdf`` or ``model.sdf#SENSOR``.
    :param rate: samples per second [Hz], for a model that states none; None: not known.
    :param problems: receives a line for each bad value, which is left out; None: it is raised.
    :raises ConfigurationError: for a preset that cannot be read, or that leads back to itself.
    """
    if Path(name_or_file.partition("#")[0]).suffix.lower() in _OF_MODELS:
        try:
            return dict(sdf.read_model(name_or_file, rate=rate).parameters)
        except InputError as error:
            raise ConfigurationError(error.problems) from None
    result: dict[str, object] = {}
    passed: list[Path] = []
    bad = Problems()
    while True:
        file, imu = files.split_sensor_name(name_or_file)
        path = find("imus", str(file))
        if passed and path.resolve() in [ancestor.resolve() for ancestor in passed]:
            raise ConfigurationError(f"{path}: imu.preset = {name_or_file} leads back to this file")
        passed.append(path)
        values = load(f"{path}#{imu}" if imu else path, node)
        base = values.pop("imu.preset", None)
        if not is_included("imus", file):
            declared = calibration_files.checked_parameters()
            for name in declared.keys() & values.keys():
                values[name] = declared[name].unquote(values[name])
            for name, line in bad_value_lines(declared, values).items():
                bad.append(f"{path}: {line}")
                del values[name]
        result = {**values, **result}
        if base is None:
            with nullcontext() if problems is None else problems.collect():
                bad.tell()
            return result
        name_or_file = str(base)


def layer_imu(parameters: Mapping[str, object], node: str, problems: Problems) -> dict[str, object]:
    """Return parameters above the preset of their IMU and of its barometer.

    What an included preset says, and the choices of a user leave no place for, is left out; a
    file of one's own is taken at its word.

    :param parameters: parameters of all kinds, as a preset may have, by dotted name.
    :param problems: receives a line for a preset that cannot be read.
    """
    overrides = {"imu.preset": DEFAULT_IMU, **parameters}
    preset, file = dict[str, object](), dict[str, object]()
    with problems.collect():
        preset = sensor_layer(str(overrides["imu.preset"]), node, parameters.get("rate"), problems)
    overrides["imu.preset"] = preset.pop("imu.preset", overrides["imu.preset"])
    barometer = {**preset, **parameters}.get(_BAROMETER)
    with problems.collect():
        file = files.load(find("barometers", str(barometer)), node) if barometer else {}
    # A barometer that the IMU's preset names may be changed there; another one is what it is.
    layer = {**preset, **file} if _BAROMETER in parameters else {**file, **preset}
    result = {**layer, **overrides}
    # A filter has none of the errors of a modelled orientation.
    if result.get("imu.orientation_source") == "filter" and is_included(
        "imus", result["imu.preset"]
    ):
        for name in MODEL_ERRORS:
            if f"imu.orientation_{name}" not in parameters:
                result.pop(f"imu.orientation_{name}", None)
    return result
