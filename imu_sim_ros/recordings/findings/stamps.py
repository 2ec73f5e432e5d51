# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings about the stamps of a recording: the traits of its clock."""

from collections.abc import Iterator
from typing import Final

from imu_sim_ros.recordings.clock import Clock
from imu_sim_ros.recordings.findings.finding import Evidence, FaultCheck, Severity

_JITTER: Final = 0.05
"""Deviation of stamps, in intervals, from which on it is told."""


def _trait_check(
    kind: str, trait: str, severity: Severity, texts: tuple[str, str, str]
) -> FaultCheck[Clock]:
    """Return the check for a trait of the clock.

    :param texts: meaning, effect and remedy.
    """

    def find(clock: Clock) -> Iterator[Evidence]:
        shown = clock.trait(trait)
        if shown is None or (trait == "jitter" and clock.jitter_ns < _JITTER * clock.interval_ns):
            return
        everywhere = shown.number == len(clock.rows)
        place = (None, None) if everywhere else (shown.row, shown.number)
        yield Evidence(shown.text, *place)

    meaning, effect, remedy = texts
    return FaultCheck(kind, severity, meaning, effect, remedy, find)


STAMPS: Final = (
    _trait_check(
        *("stamps_unit", "unit", "error"),
        (
            "stamps in another unit than nanoseconds",
            "the rate and all that rests on it is wrong",
            "convert the stamps to nanoseconds",
        ),
    ),
    _trait_check(
        *("clock_reset", "reset", "error"),
        (
            "a clock that goes back",
            "sorting would mix two times",
            "cut the recording there, and treat the parts as recordings of their own",
        ),
    ),
    _trait_check(
        *("clock_change", "clock_change", "error"),
        (
            "a clock that changes, for instance from time since boot to UTC",
            "two times look like one with a pause of years",
            "cut the recording there, and leave out the shorter part",
        ),
    ),
    _trait_check(
        *("stamps_stray", "stray", "warning"),
        (
            "single stamps far from those of their neighbours",
            "without them a short gap is left",
            "nothing: programs that compute leave them out",
        ),
    ),
    _trait_check(
        *("stamps_bunched", "bunches", "warning"),
        (
            "readings that are stamped when they arrive, several at a time",
            "the times of single readings are uncertain; they are spread evenly",
            "take the sensor's own stamps, if it has them",
        ),
    ),
    _trait_check(
        *("stamps_shared", "batches", "warning"),
        (
            "several readings with the same stamp",
            "the times of single readings are not recorded; they are spread evenly",
            "let the driver stamp each reading of a FIFO",
        ),
    ),
    _trait_check(
        *("stamps_jitter", "jitter", "warning"),
        (
            "stamps that scatter about equal intervals by more than a twentieth of them",
            "motion is integrated over wrong intervals",
            "take the sensor's own stamps, if it has them",
        ),
    ),
    _trait_check(
        *("samples_lost", "loss", "warning"),
        (
            "samples that are missing between others",
            "motion in the gaps is not measured",
            "find where they are lost: a queue, a full disk, a slow bus",
        ),
    ),
    _trait_check(
        *("clock_pause", "pause", "warning"),
        (
            "a stretch without readings, longer than a loss",
            "nothing is integrated over it; noise is analysed in pieces",
            "cut the recording there, if the parts do not belong together",
        ),
    ),
    _trait_check(
        *("stamps_late", "late", "warning"),
        (
            "samples that come after later ones",
            "a live consumer drops them",
            "nothing: programs that compute from files put them in their places",
        ),
    ),
    _trait_check(
        *("messages_repeated", "duplicate", "warning"),
        (
            "messages that come twice",
            "a consumer that does not drop them sees intervals of zero",
            "nothing: programs that compute drop them",
        ),
    ),
    _trait_check(
        *("stamps_rounded", "rounded", "note"),
        (
            "stamps that are rounded to a unit such as whole milliseconds",
            "single intervals are wrong; the rate is not",
            "nothing: programs take times from the line through the stamps",
        ),
    ),
)
"""Checks of the clock of a recording."""
