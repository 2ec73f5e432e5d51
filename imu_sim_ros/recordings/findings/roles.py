# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Findings about topics and arguments: several frames, exchanged trajectories, motion at rest."""

from collections.abc import Iterator, Mapping
from typing import Final, Literal, NamedTuple

from imu_sim_ros.recordings.findings.finding import Evidence, check


class TopicFrames(NamedTuple):
    """The frames of the readings on one topic."""

    source: str
    """Name of the file and topic."""
    frames: Mapping[str, int]
    """Number of messages of each frame."""


class TrajectoryUse(NamedTuple):
    """A trajectory in its place in a comparison."""

    source: str
    """Name of the trajectory."""
    role: Literal["", "truth", "estimate"]
    """Truth of a simulation or estimate of it; empty: unknown."""
    place: Literal["truth", "estimate"]
    """Argument that it was given as."""


class RestRecord(NamedTuple):
    """A record of an IMU that is analysed as one at rest."""

    motions: tuple[str, ...]
    """Motions in it, each with its size and time."""


@check(
    "error",
    "readings of several IMUs look like those of one that jumps",
    "{frame} chooses one",
)
def frames_mixed(topic: TopicFrames) -> Iterator[Evidence]:
    """Find readings of several frames on one topic."""
    if len(topic.frames) > 1:
        frames = ", ".join(f"{name} ({count:,})" for name, count in topic.frames.items())
        yield Evidence(f"has readings of several frames: {frames}")


_ORDER: Final = "the estimate comes first, the truth second"


@check("error", "errors have the wrong sign, and the estimate's gaps count", _ORDER)
def truth_as_estimate(use: TrajectoryUse) -> Iterator[Evidence]:
    """Find the truth of a simulation in the place of an estimate."""
    if use.place == "estimate" and use.role == "truth":
        yield Evidence("is the truth of a simulation")


@check("error", "errors have the wrong sign, and the estimate's gaps count", _ORDER)
def estimate_as_truth(use: TrajectoryUse) -> Iterator[Evidence]:
    """Find an estimate in the place of the truth."""
    if use.place == "truth" and use.role == "estimate":
        yield Evidence("is an estimate")


@check("error", "noise and drift cannot be told from motion", "record the IMU at rest")
def motion_at_rest(record: RestRecord) -> Iterator[Evidence]:
    """Find motion in a record that has to be one at rest."""
    for motion in record.motions:
        yield Evidence(f"not at rest: {motion}")


REST: Final = (motion_at_rest,)
"""Checks of a record that has to be one at rest."""
FRAMES: Final = (frames_mixed,)
"""Checks of the frames on a topic."""
USES: Final = (truth_as_estimate, estimate_as_truth)
"""Checks of the place of a trajectory."""
