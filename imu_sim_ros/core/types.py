# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays by the names that the whole package has for them; each use states shape and unit."""

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Array = NDArray[np.float64]
"""Numbers."""
Single = NDArray[np.float32]
"""Numbers of pixels and rays, which need no more digits."""
Complex = NDArray[np.complex128]
"""Spectra."""
Integers = NDArray[np.int64]
"""Counts, indices and labels."""
Times = NDArray[np.int64]
"""(n,) times or stamps [ns]."""
Mask = NDArray[np.bool_]
"""True for selected elements."""
Bytes = NDArray[np.uint8]
"""Bytes of messages and of images."""
AnyArray: TypeAlias = NDArray[Any]
"""Array whose element type depends on its source: pixels of any depth, columns of a table."""
Keywords: TypeAlias = dict[str, Any]
"""Arguments of one call by name; type checkers cannot tell their types apart behind ``**``."""
JsonObject: TypeAlias = dict[str, Any]
"""A JSON object of results: numbers, texts, lists and objects by name, as ``json`` has them."""


def field_values(instance: "DataclassInstance") -> Keywords:
    """Return the values of a dataclass's fields by name, those of its sections as they are."""
    return {field.name: getattr(instance, field.name) for field in fields(instance)}


def shapes(rows: Any, additional: Mapping[str, object] = {}) -> str:
    """Return a line with the names and shapes of a named tuple's arrays, for its ``repr``.

    :param additional: further arrays and numbers, by name.
    """
    descriptions = [
        f"{name} {value.shape}" if isinstance(value, np.ndarray) else f"{name} {value!r}"
        for name, value in {**rows._asdict(), **additional}.items()
        if isinstance(value, np.ndarray | int | float) and np.size(value)
    ]
    return f"<{type(rows).__name__}: {', '.join(descriptions) or 'empty'}>"
