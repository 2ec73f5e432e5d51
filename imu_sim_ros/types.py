# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays by the names that the whole package has for them."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers; the shape and the unit stand where it is used."""
Times = NDArray[np.int64]
"""(n,) [ns]."""
