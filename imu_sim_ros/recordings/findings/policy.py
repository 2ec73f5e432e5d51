# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The declaration of each job: which findings it refuses, corrects or tells."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, Literal

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.recordings.findings.finding import Finding
from imu_sim_ros.recordings.findings.readings import UNITS

Action = Literal["refuses", "corrects", "tells", ""]
ABSENT: Final = ("gyroscope_absent", "accelerometer_absent")
"""Kinds of readings without one of the triads."""
BROKEN_CLOCK: Final = ("stamps_unit", "clock_reset", "clock_change")
"""Kinds of stamps that are not nanoseconds of one clock."""
UNEVEN_CLOCK: Final = (
    *("stamps_stray", "stamps_bunched", "stamps_shared", "stamps_late"),
    *("messages_repeated", "stamps_rounded"),
)
"""Kinds of stamps whose true times the clock tells."""
ORDER: Final = ("clock_reset", "clock_change", "stamps_stray", "stamps_late")
"""Kinds of stamps that are late, stray, or those of several times."""
UNMEASURED: Final = ("axis_stuck", "axis_saturated", "stamps_jitter", "samples_lost")
"""Kinds of readings that lack some of the motion, or the times of it."""
TWIST: Final = ("twist_world", "twist_body", "twist_unfilled")
"""Kinds of a twist that contradicts the poses beside it."""
AXES: Final = ("quaternion_order", "z_down", "axes_camera")
"""Kinds of poses in other axes."""
POSES: Final = (*AXES, "poses_held", "poses_sparse")
"""Kinds of poses that are not those of a body, or not all of them."""
DISTURBED_POSES: Final = ("poses_jump", "poses_outlying", "poses_arrival")
"""Kinds of poses that no body moves through."""
ROLES: Final = ("truth_as_estimate", "estimate_as_truth")
"""Kinds of trajectories in the wrong place."""


@dataclass(frozen=True)
class FindingPolicy:
    """The declaration of a job; findings of other kinds do not matter to its results."""

    refuses: tuple[str, ...] = ()
    """Kinds after which the job has no result: each is a line, the exit status 2."""
    corrects: tuple[str, ...] = ()
    """Kinds whose effect the job removes; each is told."""
    tells: tuple[str, ...] = ()
    """Kinds that make the result wrong or worse; each is told."""

    def action(self, kind: str) -> Action:
        """Return the job's action for a kind of finding; empty: none."""
        if kind in self.refuses:
            return "refuses"
        if kind in self.corrects:
            return "corrects"
        return "tells" if kind in self.tells else ""

    def judge(self, findings: Iterable[Finding], tell: Callable[[str], object]) -> None:
        """Refuse or tell findings, as declared.

        :param tell: receives a line for each finding that is corrected or told.
        :raises InputError: with a line for each finding that is refused.
        """
        relevant = [finding for finding in findings if self.action(finding.kind)]
        refused = [f for f in relevant if f.kind in self.refuses]
        if refused:
            raise InputError([finding.sentence() for finding in refused])
        for finding in relevant:
            tell(finding.sentence())


DEAD_RECKON: Final = FindingPolicy(
    refuses=(*ABSENT, "stamps_equal", *BROKEN_CLOCK, "poses_contradictory"),
    corrects=UNEVEN_CLOCK,
    tells=(
        *(*UNITS, "triad_zeros", "gravity_absent", "gravity_size", "axes_down"),
        *(*UNMEASURED, *POSES, *TWIST),
    ),
)
PREINTEGRATE: Final = FindingPolicy(
    refuses=(*ABSENT, "stamps_equal", *BROKEN_CLOCK),
    corrects=UNEVEN_CLOCK,
    tells=(*UNITS, "triad_zeros", *UNMEASURED),
)
TWIN: Final = FindingPolicy(
    refuses=(*ABSENT, "stamps_equal", *BROKEN_CLOCK, *UNITS, "poses_contradictory"),
    corrects=UNEVEN_CLOCK,
    tells=("triad_zeros", *UNMEASURED, *POSES),
)
ALLAN: Final = FindingPolicy(
    refuses=(*ABSENT, "stamps_equal", "stamps_unit", "motion_at_rest"),
    corrects=("clock_reset", *UNEVEN_CLOCK),
    tells=(*UNITS, "gravity_size", "axis_stuck"),
)
CALIBRATE: Final = FindingPolicy(refuses=ABSENT, tells=(*UNITS, "triad_zeros", "axis_stuck"))
CALIBRATE_TEMPERATURE: Final = FindingPolicy(
    refuses=(*CALIBRATE.refuses, "temperature_unit"),
    tells=(*CALIBRATE.tells, "temperature_fahrenheit"),
)
CONVERT: Final = FindingPolicy(refuses=ABSENT, tells=(*UNITS, *ORDER))
COPY: Final = FindingPolicy(tells=(*ABSENT, *UNITS, *ORDER))
INTEGRATOR: Final = FindingPolicy(
    refuses=(*ABSENT, "stamps_equal", "stamps_unit"),
    corrects=("stamps_stray", "stamps_bunched", "stamps_shared"),
    tells=UNITS,
)
ERROR_MODEL: Final = FindingPolicy(
    refuses=(*ABSENT, "stamps_equal", "stamps_unit"),
    corrects=("stamps_stray", "stamps_shared"),
    tells=(*UNITS, *TWIST, "stamps_bunched"),
)
READ_STATES: Final = FindingPolicy(
    refuses=("clock_reset", "clock_change", "poses_contradictory"),
    corrects=("stamps_stray", "stamps_late", "messages_repeated"),
)
EVALUATE: Final = FindingPolicy(
    refuses=(*READ_STATES.refuses, *ROLES),
    corrects=READ_STATES.corrects,
    tells=(*POSES, "estimate_equals_truth"),
)
RECORDER: Final = FindingPolicy(
    tells=(*UNITS, *BROKEN_CLOCK, *UNEVEN_CLOCK, "stamps_jitter"),
)
CAMPAIGN: Final = FindingPolicy(
    refuses=READ_STATES.refuses,
    corrects=READ_STATES.corrects,
    tells=("quaternion_order", "poses_held", "z_down", "axes_camera", "estimate_equals_truth"),
)
RECORDED_MOTION: Final = FindingPolicy(
    refuses=READ_STATES.refuses,
    corrects=READ_STATES.corrects,
    tells=(*POSES, *DISTURBED_POSES),
)
JOBS: Final = {
    "add_errors, error_model": ERROR_MODEL,
    "allan": ALLAN,
    "calibrate": CALIBRATE,
    "calibrate temperature": CALIBRATE_TEMPERATURE,
    "campaign": CAMPAIGN,
    "convert_bag": CONVERT,
    "convert_bag, bag to bag": COPY,
    "dead_reckon": DEAD_RECKON,
    "evaluate": EVALUATE,
    "generate, simulator": RECORDED_MOTION,
    "integrator": INTEGRATOR,
    "preintegrate": PREINTEGRATE,
    "read_states": READ_STATES,
    "recorder": RECORDER,
    "twin": TWIN,
}
"""Declarations by the names of programs, nodes and functions; `inspect` and `report` tell all."""
