# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Warnings of a node, each reason told at once and then seldom; refused messages."""

import re
import time
from collections.abc import Sequence
from typing import Final, TypeVar

from rclpy.impl.rcutils_logger import RcutilsLogger

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.recordings.findings.live import StampWatch
from imu_sim_ros.recordings.live_strays import Stamped

_StampedT = TypeVar("_StampedT", bound=Stamped)
_PERIOD: Final = 10.0
"""Time after which the reason of a refusal is told again [s]."""
_NUMBERS: Final = re.compile(r"[-+.\d]+")


class Warnings:
    """Warnings whose texts may come again and again, with other numbers."""

    def __init__(self, logger: RcutilsLogger, period: float) -> None:
        """Initialise without entries.

        :param logger: logger of the node.
        :param period: time after which the same text is told again [s].
        """
        self._logger, self._period = logger, period
        self._due: dict[str, float] = {}
        """Time from which a text without numbers is told again, on the steady clock [s]."""

    def add(self, text: str) -> None:
        """Tell a text, unless it was told a short time ago."""
        reason, time_s = _NUMBERS.sub("", text), time.monotonic()
        if time_s >= self._due.get(reason, 0.0):
            self._due[reason] = time_s + self._period
            self._logger.warning(text)


class Refusals:
    """Counter of refused messages, whose reasons are told."""

    def __init__(self, logger: RcutilsLogger) -> None:
        """Initialise without entries.

        :param logger: logger of the node.
        """
        self.count = 0
        """Number of messages refused so far."""
        self._warnings = Warnings(logger, _PERIOD)

    def add(self, topic: str, error: InputError, count: int = 1) -> None:
        """Count messages of a topic that are refused for the same reason."""
        self.count += count
        self._warnings.add(f"{topic}: refused: {error} ({self.count} refused so far)")

    def keep_timed(
        self, topic: str, stamps: StampWatch, messages: Sequence[_StampedT]
    ) -> Sequence[_StampedT]:
        """Return the messages of a topic whose stamps are a time; others are refused.

        :param stamps: watch of the topic's stamps; not to be called once it is done.
        """
        passed: list[_StampedT] = []
        for message in messages:
            try:
                stamps.add(message.t_ns)
                passed.append(message)
            except InputError as error:
                self.add(topic, error)
        return passed
