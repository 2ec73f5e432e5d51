# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The grid of a campaign: axes of parameters, and one cell for each combination of their values.

An axis is a list of values, ``{range: [first, last, count]}``,
``{log_range: [first, last, count]}``, ``{zip: {name: values, ...}}`` for parameters that change
together, or ``all`` for every file of the package: ``imu: all``.
"""

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.errors import ConfigurationError, Problems
from imu_sim_ros.core.names import short_repr
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors import switchable_sensors
from imu_sim_ros.simulation.parameters import join_layers, name_sensors
from imu_sim_ros.trajectory.parameters import trajectory_layer

Layer = dict[str, object]
SHORT: Final = ("imu", "trajectory", "camera", "scene", *switchable_sensors())
"""Names of command-line arguments that stand for parameters."""
_ALL: Final = {
    "imu": "imus",
    "camera": "cameras",
    "scene": "scenes",
    **{name: name for name in switchable_sensors()},
}
"""The folders in config/ whose files ``all`` stands for."""
_LARGEST_AXIS: Final = 100_000
"""Largest number of values of an axis."""


class Axis(NamedTuple):
    """Parameters that change together: n values of each."""

    names: tuple[str, ...]
    rows: tuple[tuple[object, ...], ...]
    """n tuples of one value per name."""


class Cell(NamedTuple):
    """One combination of values."""

    number: int
    values: dict[str, object]
    """Values by name of the grid, as they appear in the results."""

    @property
    def name(self) -> str:
        """Name of the cell: ``imu=bmi088, trajectory=circle``."""
        return (
            ", ".join(f"{name}={value_text(value)}" for name, value in self.values.items()) or "all"
        )

    def layer(self) -> Layer:
        """Return the parameters that the values represent."""
        return expand_names(self.values)


def expand_names(values: Mapping[str, object]) -> Layer:
    """Return parameters with :data:`SHORT` names replaced by their full names."""
    layer: Layer = {}
    for name, value in values.items():
        if name == "imu":
            layer["imu.preset"] = value
        elif name == "trajectory":
            layer.update(trajectory_layer(str(value)))
        elif name == "scene":
            from imu_sim_ros.sensors.camera.rig_parameters import scene_layer

            layer.update(scene_layer(str(value)))
        elif name in ("camera", *switchable_sensors()):
            presets = value if isinstance(value, list) else [value]
            layer = join_layers(layer, name_sensors(name, presets))
        else:
            layer[name] = value
    return layer


def value_text(value: object) -> str:
    """Return a value as text for tables, files and names of cells."""
    if isinstance(value, float):
        return f"{value:.9g}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(value_text(entry) for entry in value) + "]"
    return str(value)


def read_axes(grid: object) -> list[Axis]:
    """Return the axes that the ``grid`` of a plan describes.

    :raises ConfigurationError: with a line for each problem.
    """
    if grid is None:
        return []
    if not isinstance(grid, Mapping):
        raise ConfigurationError(f"grid = {short_repr(grid)}: must hold names and lists of values")
    axes: list[Axis] = []
    problems = Problems()
    for name, content in grid.items():
        with problems.collect():
            axes.append(_axis(str(name), content))
    names = [name for axis in axes for name in axis.names]
    problems += [f"grid.{name}: given twice" for name in set(names) if names.count(name) > 1]
    problems.tell()
    return axes


def cell_count(axes: list[Axis]) -> int:
    """Return how many cells the axes make."""
    return math.prod(len(axis.rows) for axis in axes)


def cells(axes: list[Axis]) -> Iterator[Cell]:
    """Yield every combination; the last axis changes fastest."""
    for number, rows in enumerate(itertools.product(*(axis.rows for axis in axes))):
        values: dict[str, object] = {}
        for axis, row in zip(axes, rows, strict=True):
            values.update(zip(axis.names, row, strict=True))
        yield Cell(number, values)


def _axis(name: str, content: object) -> Axis:
    """Return one axis of the grid: a parameter with its values, or several that vary together."""
    where = f"grid.{name}"
    if isinstance(content, Mapping) and set(content) == {"zip"}:
        columns = content["zip"]
        if not isinstance(columns, Mapping) or not columns:
            raise ConfigurationError(f"{where}.zip: must hold names and lists of equal length")
        lists = {str(key): _values(f"{where}.zip.{key}", v) for key, v in columns.items()}
        lengths = {len(values) for values in lists.values()}
        if len(lengths) != 1:
            counts = ", ".join(f"{key} {len(values)}" for key, values in lists.items())
            raise ConfigurationError(f"{where}.zip: lists must be equally long: {counts}")
        rows = tuple(zip(*lists.values(), strict=True))
        _refuse_repeated(f"{where}.zip", rows)
        return Axis(tuple(lists), rows)
    if content == "all" and name in _ALL:
        content = files.names(_ALL[name])
    values = _values(where, content)
    _refuse_repeated(where, values)
    return Axis((name,), tuple((value,) for value in values))


def _refuse_repeated(where: str, values: Sequence[object]) -> None:
    """Refuse values that occur twice, which would make equal cells."""
    counts = Counter(value_text(value) for value in values)
    duplicates = sorted(value for value, count in counts.items() if count > 1)
    if duplicates:
        raise ConfigurationError(f"{where}: {', '.join(duplicates)}: given twice")


def _values(where: str, content: object) -> list[object]:
    """Return the values of a parameter: a list, one value, or a range."""
    if isinstance(content, Mapping) and len(content) == 1:
        kind, limits = next(iter(content.items()))
        if kind in ("range", "log_range"):
            return list(_space_evenly(f"{where}.{kind}", kind == "log_range", limits))
    if isinstance(content, list) and content:
        values = [tuple(entry) if isinstance(entry, list) else entry for entry in content]
        if any(isinstance(value, Mapping) or value is None for value in values):
            raise ConfigurationError(f"{where} = {short_repr(content)}: must hold plain values")
        return values
    raise ConfigurationError(
        f"{where} = {short_repr(content)}: must be a list of values, "
        "{range: [first, last, count]}, {log_range: [first, last, count]} "
        "or {zip: {name: values, ...}}"
    )


def _space_evenly(where: str, logarithmic: bool, limits: object) -> list[float]:
    """Return the numbers of a range [first, last, count], evenly or logarithmically spaced."""
    limits_text = "two numbers above 0" if logarithmic else "two finite numbers"
    error = ConfigurationError(
        f"{where} = {short_repr(limits)}: must be [first, last, count]: {limits_text}, "
        f"and a count of 2 to {_LARGEST_AXIS}"
    )
    if not isinstance(limits, list) or len(limits) != 3:
        raise error
    if any(isinstance(entry, bool) or not isinstance(entry, int | float) for entry in limits):
        raise error
    start, stop, count = limits
    if not (math.isfinite(start) and math.isfinite(stop) and math.isfinite(count)):
        raise error
    if count != int(count) or not 2 <= count <= _LARGEST_AXIS or start == stop:
        raise error
    if logarithmic and not (start > 0 and stop > 0):
        raise error
    space = np.geomspace if logarithmic else np.linspace
    # Twelve digits: the grid's values appear in tables and file names.
    return [float(f"{value:.12g}") for value in space(start, stop, int(count))]
