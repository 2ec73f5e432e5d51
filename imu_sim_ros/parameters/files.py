# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameter files: finding, reading and layering them.

Sensors, trajectories, cameras, scenes, ... that come with the package are such files, too. The
format is that of ROS 2: node names (or the wildcards ``/**`` and ``/*``) above ``ros__parameters``,
nested or dotted names below.
"""

import os
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeGuard, TypeVar

from imu_sim_ros.core.errors import ConfigurationError, InputError, Problems
from imu_sim_ros.core.names import printable_text, unknown_name_line
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.yaml_output import as_yaml
from imu_sim_ros.inputs.rows import is_present, read_text
from imu_sim_ros.parameters.kinds import Value
from imu_sim_ros.parameters.sections import build, flatten
from imu_sim_ros.parameters.yaml_text import YamlMapping, parse_yaml

_T = TypeVar("_T")

Layering = Callable[[Mapping[str, object], Problems], Mapping[str, object]]
"""Returns given values merged over the values of the files that they name.

Problems receives a line for each that cannot be read.
"""

_PATHS: Final = (
    *("preset", "barometer_preset", "calibration"),
    *("type", "file", "mesh", "ephemeris"),
)
"""Last words of parameters whose values may be paths."""
_PARAMETERS = "ros__parameters"
_KINDS: Final = {
    "imus": "IMU",
    "trajectories": "trajectory",
    "cameras": "camera",
    "scenes": "scene",
    "campaigns": "campaign",
    "estimators": "estimator",
    "barometers": "barometer",
}
"""Subject of the files in each folder of config/; other folders bear their sensor's name."""


@cache
def config_folder() -> Path:
    """Return the folder of the package's own parameter files.

    It is ``share/imu_sim_ros/config`` next to the installed package, or ``config`` of a checkout.
    """
    for parent in Path(__file__).resolve().parents:
        for folder in (parent / "share" / "imu_sim_ros" / "config", parent / "config"):
            if (folder / "imus").is_dir():
                return folder
    raise ConfigurationError("the package's config folder is missing: reinstall imu_sim_ros")


def names(kind: str) -> list[str]:
    """Return the names of the files of one kind: ``imus``, ``trajectories``, ``cameras``, ..."""
    folder = config_folder() / kind
    files = os.listdir(folder) if folder.is_dir() else []
    return sorted(name.removesuffix(".yaml") for name in files if name.endswith(".yaml"))


def is_included(kind: str, name: object) -> bool:
    """Return whether a name is that of a file in config/.

    :param kind: a folder in config/.
    """
    return _find_included(kind, str(name)) is not None


def _find_included(kind: str, name: str) -> str | None:
    """Return the path of the file of a name in config/; None: there is none."""
    path = f"{config_folder()}/{kind}/{name}.yaml"
    return path if "/" not in name and os.path.isfile(path) else None


def find(kind: str, name_or_file: str) -> Path:
    """Return the parameter file of a name in config/, or the given file.

    :param kind: a folder in config/, for instance ``imus`` or ``trajectories``.
    :raises ConfigurationError: if there is neither, with the nearest name or all names.
    """
    included = _find_included(kind, name_or_file)
    if included is not None:
        return Path(included)
    try:
        if name_or_file and is_present(name_or_file):
            return Path(name_or_file)
    except InputError as error:
        raise ConfigurationError(error.problems) from None
    presets = names(kind)
    raise ConfigurationError(
        unknown_name_line(
            _KINDS.get(kind, kind),
            name_or_file,
            presets,
            f"neither a file nor one of {', '.join(presets)}",
        )
    )


def split_sensor_name(path: str | Path) -> tuple[Path, str]:
    """Return file and name of ``FILE#imu1``; the name is empty if the path has none."""
    file, mark, name = str(path).rpartition("#")
    if not mark or _exists(path):
        return Path(path), ""
    return Path(file), name


def _exists(path: str | Path) -> bool:
    """Return whether a path exists; texts that are no paths do not."""
    try:
        return Path(path).exists()
    except (OSError, ValueError):  # too long, or with a null character
        return False


def load(path: str | Path, node: str = "simulator") -> dict[str, object]:
    """Return the parameters that a ROS 2 parameter file gives to a node, by dotted name.

    :param node: the node's name without namespace.
    :raises ConfigurationError: for a file that cannot be read or has another form.
    """
    return parameters_of(read_tree(Path(path)), Path(path), node)


def has_sections(tree: object) -> bool:
    """Return whether a tree has ``ros__parameters`` anywhere."""
    if not isinstance(tree, Mapping):
        return False
    return _PARAMETERS in tree or any(map(has_sections, tree.values()))


def is_of_chain(content: object) -> TypeGuard[Mapping[str, object]]:
    """Return True for a camera in a chain (kalibr_common/ConfigReader.py)."""
    return isinstance(content, Mapping) and {"camera_model", "intrinsics"} <= set(content)


def parameters_of(tree: YamlMapping, path: Path, node: str) -> dict[str, object]:
    """Return the parameters of a node in the content of a ROS 2 parameter file, by dotted name.

    Wildcards are applied first, as ROS does. Any namespace will do, but the same one for all.

    :param path: path of the file, for the messages.
    :raises ConfigurationError: for anything else, and for nodes of that name in two namespaces.
    """
    sections = {
        name: content
        for name, content in _sections(tree, path, node)
        if name.rpartition("/")[2] in (node, "*", "**")
    }
    nodes = [name for name in sections if "*" not in name]
    if len({name.strip("/") for name in nodes}) > 1:
        raise ConfigurationError(
            f"{path}: has parameters for several nodes, {', '.join(nodes)}: leave one of them"
        )
    result: dict[str, object] = {}
    for name, content in sorted(sections.items(), key=lambda item: "*" not in item[0]):
        content = {} if content is None else content
        values = dotted_values(content, f"{path}: {name}: {_PARAMETERS}")
        result.update({key: resolve_path(key, value, path) for key, value in values.items()})
    cameras = [str(name) for name, content in tree.items() if is_of_chain(content)]
    if not sections and cameras:
        raise ConfigurationError(
            f"{path}: a camera chain of kalibr or OpenVINS ({', '.join(cameras)}): give it as "
            f"{argument('camera')} or camera.preset, {path.name}#{cameras[0]}"
        )
    if not sections:
        raise ConfigurationError(f"{path}: no section for the node {node} (/{node} or /**)")
    return result


def _sections(
    tree: YamlMapping, path: Path, node: str, namespace: str = ""
) -> Iterator[tuple[str, object]]:
    """Yield the full name and the parameters of each node of a ROS 2 parameter file.

    Namespaces are parts of names, or names around them (rcl_yaml_param_parser).
    """
    for key, content in tree.items():
        name = f"{namespace}/{str(key).lstrip('/')}" if namespace else str(key)
        if isinstance(content, Mapping) and set(content) == {_PARAMETERS}:
            yield name, content[_PARAMETERS]
        elif isinstance(content, Mapping) and _PARAMETERS not in content and has_sections(content):
            yield from _sections(content, path, node, name)
        elif namespace or has_sections(tree) or name.rpartition("/")[2] in (node, "*", "**"):
            raise ConfigurationError(f"{path}: {name} must hold {_PARAMETERS} and nothing else")


def resolve_path(name: str, value: object, path: Path) -> object:
    """Return a value of a parameter file, with the path of a file next to it made absolute.

    Any other relative path is that from the working directory; other values stay as they are.

    :param name: name of the parameter, or its last word.
    :param path: path of the parameter file.
    """
    parameter = name.rpartition(".")[2]
    if parameter not in _PATHS or not isinstance(value, str) or not value or "\0" in value:
        return value
    file = value.partition("#")[0]  # model.sdf#sensor
    if (
        parameter not in ("file", "mesh") and not Path(file).suffix
    ):  # mpu6000, also next to a folder
        return value
    sibling = path.parent / file
    try:
        return str(path.parent / value) if sibling.exists() else value
    except OSError:  # too long for a path
        return value


def read_tree(
    path: Path, expected: str = "a ROS 2 parameter file (no /**: ros__parameters:)"
) -> YamlMapping:
    """Return the content of a YAML file with names and values.

    :param expected: description of the expected file, for the message.
    :raises ConfigurationError: for a file that cannot be read or has another form.
    """
    try:
        tree = parse_yaml(read_text(path))
    except InputError as error:
        raise ConfigurationError(error.problems) from None
    except ValueError as error:
        raise ConfigurationError(f"{path}: not a YAML file: {error}") from None
    if tree is None:
        raise ConfigurationError(f"{path}: is empty, not {expected}")
    if not isinstance(tree, dict):
        raise ConfigurationError(f"{path}: not {expected}")
    return tree


def dotted_values(tree: object, where: str, prefix: str = "") -> dict[str, object]:
    """Return nested names and values by dotted name; arrays become lists.

    :raises ConfigurationError: for anything but names and values.
    """
    if not isinstance(tree, Mapping):
        raise ConfigurationError(f"{where}: must hold names and values")
    result: dict[str, object] = {}
    for name, value in _leaves(tree, prefix):
        if name in result:
            raise ConfigurationError(f"{where}: {name} is given twice, dotted and nested")
        result[name] = value.tolist() if hasattr(value, "tolist") else value
    return result


def _leaves(tree: YamlMapping, prefix: str) -> Iterator[tuple[str, object]]:
    """Yield the dotted name and the value of all that is not a section."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def build_from_layers(
    cls: type[_T],
    layering: Layering,
    *layers: Mapping[str, object],
    problems: Problems | None = None,
) -> _T:
    """Return the section from given values over those of the files that they name.

    :param layers: layers of given values, later ones above earlier ones.
    :param problems: problems found before, told with those found here.
    :raises ConfigurationError: with one line per problem; a file that cannot be
        found hides no other problem.
    """
    problems = Problems() if problems is None else problems
    values_by_name: dict[str, object] = {}
    for values in layers:
        values_by_name.update(values)
    with problems.collect():
        layered = layering(values_by_name, problems)
        checked = {key: layered[key] for key in layered if not key.startswith(problems.unjudged)}
        built = build(cls, checked, complete=not problems)
    problems.tell()
    return built


def dump(instance: object, path: Path, comment: str = "") -> None:
    """Write a section as a parameter file that gives an equal section when it is loaded."""
    write(flatten(instance), path, comment=comment)


def write(values: Mapping[str, Value], path: Path, node: str = "/**", comment: str = "") -> None:
    """Write values by dotted name as a ROS 2 parameter file, nested."""
    path.write_text(printable_text(text(values, node, comment)), encoding="utf-8")


def text(values: Mapping[str, Value], node: str = "/**", comment: str = "") -> str:
    """Return values by dotted name as the text of a ROS 2 parameter file, nested."""
    tree: dict[str, Any] = {}
    for name, value in values.items():
        *parents, leaf = name.split(".")
        branch = tree
        for parent in parents:
            branch = branch.setdefault(parent, {})
        branch[leaf] = list(value) if isinstance(value, tuple) else value
    header = "".join(f"# {line}\n" for line in comment.splitlines())
    return header + as_yaml({node: {_PARAMETERS: tree}}, flow_style=None)
