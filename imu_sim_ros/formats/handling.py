# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Treatment of what cannot be used in a file."""

from typing import NamedTuple

from imu_sim_ros.bags.reader import Recover
from imu_sim_ros.core.bad_rows import Skipped, Warned


class Handling(NamedTuple):
    """Treatment of bad rows, bad messages and damage in a file."""

    skipped: Skipped | None = None
    """Receives the number of bad rows or messages that are left out; None: they are errors."""
    warned: Warned | None = None
    """Receives what is wrong with messages, which are passed on as they are."""
    recover: Recover = False
    """True: a damaged bag is read as far as possible."""
