# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""When all expected subscribers are there, and no more are arriving."""

from collections.abc import Sequence
from typing import Final

_SETTLE: Final = 0.3
"""[s] A subscriber discovered here may not have discovered this publisher yet."""


class Settling:
    """Waits until the numbers of subscribers have been constant for a while.

    A recorder subscribes to its topics one after the other, so some subscriptions come after the
    first has been discovered here: the first samples of the last topic would be lost.
    """

    def __init__(self) -> None:
        self._counts: tuple[int, ...] = ()
        self._since = 0.0

    def settled(self, counts: Sequence[int], now: float) -> bool:
        """Return whether the subscribers of all topics are there to stay.

        :param now: on the steady clock [s].
        """
        if tuple(counts) != self._counts:
            self._counts, self._since = tuple(counts), now
        return now - self._since >= _SETTLE
