# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""When to look for messages: every so often, or in step with those that arrive regularly.

Waking up costs as much processor time as a reading. Looks every 2 ms find now two, now three
messages of 1 kHz, and the oldest has waited for up to 2 ms; looks just after every third message
let none wait longer and are a quarter fewer. At 200 Hz a look just after each message has it at
once, and none is in vain.
"""

from typing import Final

_MARGIN_NS: Final = 150_000
"""A look comes this much after the message is due: the usual lateness of a publisher."""
_TOLERANCE: Final = 0.25
"""How far the mean interval of a look may be off, as a share of it."""
_TRUSTED: Final = 5
"""Number of looks with regular intervals from which on more are expected; a look with others
takes as many away."""
_MOST_TRUSTED: Final = 20
_SMOOTHING: Final = 0.125
_NEARLY: Final = 0.1
"""A period counts as a multiple of the interval where this share of one is missing."""
_LONGEST_NS: Final = 10_000_000
"""No look is farther away than this: another topic may have something."""


class Pace:
    """Decides how long to wait before the next look.

    :param period: between looks where arrivals are irregular; where they are regular, how long a
        message may wait for others [s].
    """

    def __init__(self, period: float) -> None:
        self._period_ns = period * 1e9
        self._last_ns = 0
        self._interval = 0.0
        """Between arrivals, smoothed [ns]."""
        self._trust = 0

    def wait(self, count: int, last_ns: int, now_ns: int) -> float:
        """Return how long to wait before the next look [s].

        :param count: how many messages the latest look found.
        :param last_ns: when the last of them arrived; does not matter where there is none.
        :param now_ns: the time on the same clock.
        """
        passed = now_ns - last_ns
        if not count or not (self._is_regular(last_ns, count) and 0 <= passed < _LONGEST_NS):
            return self._period_ns * 1e-9
        messages = 1 + int(self._period_ns / self._interval + _NEARLY)
        delay = messages * self._interval + _MARGIN_NS - passed
        return max(0.0, min(delay, _LONGEST_NS)) * 1e-9

    def _is_regular(self, last_ns: int, count: int) -> bool:
        """Take the latest arrivals; return whether more are to be expected like them."""
        interval = (last_ns - self._last_ns) / count
        self._last_ns = last_ns
        off = interval - self._interval
        if abs(off) <= _TOLERANCE * self._interval:
            self._trust = min(self._trust + 1, _MOST_TRUSTED)
            self._interval += _SMOOTHING * off
            return self._trust >= _TRUSTED
        self._trust = max(self._trust - _TRUSTED, 0)
        if not self._trust:
            self._interval = max(interval, 0.0)
        return False
