# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays by the names that the whole package has for them; each use states shape and unit."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

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


def shapes(rows: Any, more: Mapping[str, object] = {}) -> str:
    """Return a line with the names and shapes of a named tuple's arrays, for its ``repr``.

    :param more: further ones, by name.
    """
    named = [
        f"{name} {value.shape}" if isinstance(value, np.ndarray) else f"{name} {value!r}"
        for name, value in {**rows._asdict(), **more}.items()
        if isinstance(value, np.ndarray | int | float) and np.size(value)
    ]
    return f"<{type(rows).__name__}: {', '.join(named) or 'empty'}>"
