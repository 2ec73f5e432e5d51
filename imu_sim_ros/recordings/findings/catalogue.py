# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The list of all checks, and the findings of a recording, worst first."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.records import Readings, States, TimeSeries, replace_fields
from imu_sim_ros.core.spelling import spell_arguments
from imu_sim_ros.core.types import Mask, Times
from imu_sim_ros.recordings.cameras import CameraRecord, CloudRecord
from imu_sim_ros.recordings.clock import Clock, estimate_clock
from imu_sim_ros.recordings.findings.cameras import CAMERAS, CLOUDS
from imu_sim_ros.recordings.findings.clipping import CLIPPING, ClippingCounts
from imu_sim_ros.recordings.findings.disturbances import DISTURBANCES, DisturbedPoses
from imu_sim_ros.recordings.findings.finding import (
    SEVERITIES,
    Evidence,
    FaultCheck,
    Finding,
    RecordT,
)
from imu_sim_ros.recordings.findings.measures import ReadingMeasures
from imu_sim_ros.recordings.findings.policy import ORDER
from imu_sim_ros.recordings.findings.readings import (
    ABSENCE_CHECKS,
    READINGS,
    UNIT_CHECKS,
    stamps_equal,
)
from imu_sim_ros.recordings.findings.roles import (
    FRAMES,
    PAIRS,
    REST,
    USES,
    RestRecord,
    TopicFrames,
    TrajectoryUse,
    TruthPairs,
)
from imu_sim_ros.recordings.findings.stamps import STAMPS
from imu_sim_ros.recordings.findings.states import STATES, TWIST, StateMeasures, poses_contradictory
from imu_sim_ros.recordings.findings.temperatures import TEMPERATURES, TemperatureRecord
from imu_sim_ros.recordings.order import StampOrder, order_stamps
from imu_sim_ros.recordings.repair import Disturbances, repair_poses

GROUPS: Final[dict[str, tuple[FaultCheck[Any], ...]]] = {
    "Readings": READINGS,
    "Stamps": STAMPS,
    "Poses": (*STATES, *DISTURBANCES),
    "Cameras": CAMERAS,
    "Clouds": CLOUDS,
    "Counts of devices": CLIPPING,
    "Temperatures": TEMPERATURES,
    "Topics and arguments": (*FRAMES, *USES, *PAIRS, *REST),
}
"""All checks, by the part of a recording that they look at."""
_JUDGED: Final = 200_000
"""Poses whose motion is examined."""
KINDS: Final = {check.kind: check for checks in GROUPS.values() for check in checks}
"""All checks by the kind of their findings."""
_ORDER: Final = tuple(KINDS[kind] for kind in ORDER)
"""Checks of the order of stamps."""
_SAME: Final = 1.0 - 1e-15
"""Product of two unit quaternions from which on they are the same attitude."""


def reading_findings(readings: Readings, measures: ReadingMeasures | None = None) -> list[Finding]:
    """Return the findings about readings and their stamps, worst first.

    :param measures: what was measured of these readings; None: it is measured.
    """
    if not len(readings):
        return []
    measures = measures or ReadingMeasures(readings)
    findings = list(_findings(READINGS, measures, readings))
    if measures.clock is not None:
        findings += _findings(STAMPS, measures.clock, readings)
    if readings.temperature is not None:
        findings += temperature_findings(TemperatureRecord(readings.source, readings.temperature))
    return sort_by_severity(findings)


def temperature_findings(record: TemperatureRecord) -> list[Finding]:
    """Return the findings about the temperatures of a sensor."""
    return list(_findings(TEMPERATURES, record, record.source))


def stamp_findings(clock: Clock, source: str) -> list[Finding]:
    """Return the findings about the clock behind stamps, worst first."""
    return sort_by_severity(_findings(STAMPS, clock, source))


def equality_findings(t_ns: Times) -> list[Finding]:
    """Return the finding about stamps (n,) [ns] that are all equal."""
    readings = Readings.unchecked(t_ns=t_ns, gyro=None, accel=None, source="")
    return list(_findings((stamps_equal,), ReadingMeasures(readings), readings))


def unit_findings(readings: Readings, measures: ReadingMeasures | None = None) -> list[Finding]:
    """Return the findings about the units of readings, and about swapped triads.

    :param measures: what was measured of these readings; None: it is measured.
    """
    return list(_findings(UNIT_CHECKS, measures or ReadingMeasures(readings), readings))


def copy_findings(readings: Readings, measures: ReadingMeasures | None = None) -> list[Finding]:
    """Return the findings about absent triads, units, and swapped triads.

    :param measures: what was measured of these readings; None: it is measured.
    """
    checks = (*ABSENCE_CHECKS, *UNIT_CHECKS)
    return list(_findings(checks, measures or ReadingMeasures(readings), readings))


def twist_findings(states: States, measures: StateMeasures | None = None) -> list[Finding]:
    """Return the findings about a twist that contradicts the poses beside it."""
    return list(_findings(TWIST, measures or StateMeasures(states), states))


def pose_findings(states: States) -> list[Finding]:
    """Return the findings about poses and their twist, without jumps, which estimates may have.

    The first 200,000 poses are examined.

    :param states: poses in the order of time.
    """
    if not len(states):
        return []
    head = states.rows(slice(_JUDGED))
    return sort_by_severity(_findings(STATES, StateMeasures(head), head))


def state_findings(states: States) -> list[Finding]:
    """Return the findings about poses, their order and their twist, worst first.

    Jumps are looked for in the first 200,000 poses.

    :param states: poses in the order of arrival.
    """
    order = order_poses(states)
    poses = order.poses
    findings = [*order.findings, *pose_findings(poses)]
    if len(poses) and np.all(np.diff(poses.t_ns) > 0):
        head = poses.rows(slice(_JUDGED))
        disturbances = repair_poses(head).disturbances
        findings += disturbance_findings(head, disturbances)
    return sort_by_severity(findings)


class PoseOrder(NamedTuple):
    """Poses in the order of time, and the findings about the order of their source."""

    poses: States
    """Without stray and repeated ones; time begins anew where the clock was reset."""
    findings: list[Finding]


def order_poses(states: States) -> PoseOrder:
    """Return poses in the order of time, and the findings about their order.

    :param states: poses in the order of arrival.
    """
    t_ns = states.t_ns
    order = order_stamps(t_ns)
    increase = bool(np.all(np.diff(t_ns) > 0))
    if increase and not len(order.strays) and not len(order.changes):
        return PoseOrder(states, [])
    findings = _order_findings(states, order)
    rows = np.concatenate(order.pieces)
    repeated = _repeats_previous(states.rows(rows))
    number = int(np.count_nonzero(repeated))
    if number:
        evidence = Evidence(f"{number:,} poses came twice", int(rows[repeated].min()), number)
        check = replace(KINDS["messages_repeated"], find=lambda _: iter([evidence]))
        findings += _findings((check,), states, states)
    return PoseOrder(replace_fields(states.rows(rows[~repeated]), repeated=number), findings)


def order_findings(t_ns: Times, source: str) -> list[Finding]:
    """Return the findings about stamps (n,) that are late, stray, or those of several times.

    Stamps without a rate, such as two that go back, have none.

    :param t_ns: stamps in the order of arrival [ns].
    """
    readings = Readings.unchecked(t_ns=t_ns, gyro=None, accel=None, source=source)
    with suppress(InputError):
        return _order_findings(readings, order_stamps(t_ns))
    return []


def _order_findings(series: TimeSeries, order: StampOrder) -> list[Finding]:
    """Return the findings about the order of rows as they arrive."""
    if not any(map(len, order[1:])):
        return []
    return list(_findings(_ORDER, estimate_clock(series.t_ns), series))


def contradictions(states: States) -> list[Finding]:
    """Return the finding about different poses of one time.

    :param states: poses in the order of time.
    """
    return list(_findings((poses_contradictory,), StateMeasures(states), states))


def _repeats_previous(poses: States) -> Mask:
    """Return (n,) True for poses that repeat the one before, stamp included."""
    equal = np.all(np.diff(poses.position, axis=0) == 0.0, axis=1)
    equal &= np.abs(np.sum(poses.q_wb[1:] * poses.q_wb[:-1], axis=1)) > _SAME
    return np.append(False, equal & (np.diff(poses.t_ns) == 0))


def disturbance_findings(states: States, disturbances: Disturbances) -> list[Finding]:
    """Return the findings about poses that no body moves through."""
    return list(_findings(DISTURBANCES, DisturbedPoses(states, disturbances), states))


def camera_findings(camera: CameraRecord) -> list[Finding]:
    """Return the findings about the description of a camera, worst first."""
    return sort_by_severity(_findings(CAMERAS, camera, camera.source))


def cloud_findings(cloud: CloudRecord) -> list[Finding]:
    """Return the findings about clouds, worst first."""
    return sort_by_severity(_findings(CLOUDS, cloud, cloud.source))


def clipping_findings(counts: ClippingCounts) -> list[Finding]:
    """Return the findings about the clipped readings that a device counts."""
    return list(_findings(CLIPPING, counts, counts.source))


def frame_findings(topic: TopicFrames) -> list[Finding]:
    """Return the finding about several frames on a topic."""
    return list(_findings(FRAMES, topic, topic.source))


def use_findings(use: TrajectoryUse) -> list[Finding]:
    """Return the finding about a trajectory in the wrong place."""
    return list(_findings(USES, use, use.source))


def pair_findings(pairs: TruthPairs) -> list[Finding]:
    """Return the finding about an estimate that is its truth."""
    return list(_findings(PAIRS, pairs, pairs.source))


def rest_findings(record: RestRecord) -> list[Finding]:
    """Return the findings about motion in a record that has to be one at rest."""
    return list(_findings(REST, record, ""))


def sort_by_severity(findings: Iterable[Finding]) -> list[Finding]:
    """Return findings with the worst first."""
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))


def _findings(
    checks: Iterable[FaultCheck[RecordT]], record: RecordT, source: TimeSeries | str
) -> Iterator[Finding]:
    """Yield the findings of checks.

    :param source: rows whose times and lines are stated, or the name of a source without them.
    """
    series = None if isinstance(source, str) else source
    name = source if isinstance(source, str) else source.source
    for check in checks:
        for evidence in check.find(record):
            row = evidence.row
            t = line = None
            if series is not None and row is not None and row < len(series):
                t = float(series.t_ns[row] - series.t_ns[0]) * 1e-9
                line = None if series.lines is None else int(series.lines[row])
            yield Finding(
                check.kind,
                check.severity,
                name,
                evidence.text,
                check.effect,
                spell_arguments(check.remedy),
                row,
                evidence.number,
                t,
                line,
            )
