# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays by the names that the whole package has for them; each use states shape and unit."""

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
"""(n,) [ns]."""
Mask = NDArray[np.bool_]
"""Which elements are meant."""
Bytes = NDArray[np.uint8]
"""Bytes of messages and of images."""
