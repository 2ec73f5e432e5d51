# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An estimated attitude, without positions, against the truth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypedDict

import numpy as np

from imu_sim_ros.core.arguments import array, refuse, stamps
from imu_sim_ros.core.records import States
from imu_sim_ros.core.rotation import multiply, normalise
from imu_sim_ros.core.types import Array, JsonObject, Times
from imu_sim_ros.navigation.association import common_rows, poses_at
from imu_sim_ros.navigation.coverage import Coverage, coverage, coverage_line
from imu_sim_ros.navigation.evaluation import (
    anees_band,
    attitude_errors,
    invertible,
    nees,
    statistics,
    tilt_and_heading_errors,
)
from imu_sim_ros.terminal.text_tables import TextTable

_NAMES = ("q_wb", "q_wi", "values")
"""Attributes with the quaternions of paths, simulated and recorded orientations."""


@dataclass(frozen=True, repr=False)
class AttitudeEvaluation:
    """The errors of an estimated attitude, at the m times that it shares with the truth."""

    t_ns: Times
    """(m,) [ns]."""
    attitude: Array
    """(m, 3) rotation vectors about the world's axes [rad]."""
    tilt: Array
    """(m,) angles between the estimated and the true vertical [rad]."""
    heading: Array
    """(m,) errors of the heading [rad]."""
    coverage: Coverage
    """Share of the truth's time with estimates."""
    without_truth: int = 0
    """Attitudes that are left out: the truth has none at their times."""
    nees: SampleNees | None = None
    """NEES of the samples that state a covariance: ``mean``, ``inside_band``, and what is
    expected."""
    no_nees: str | None = None
    """Why there is no NEES."""
    topic: str = ""
    """Topic of the recorded orientation; empty if it was not recorded."""

    def __repr__(self) -> str:
        return (
            f"<AttitudeEvaluation of {len(self.t_ns)} attitudes, {self.coverage.words()}: "
            f"tilt {self.rms_tilt:.4g} rad rms, heading {self.rms_heading:.4g} rad rms>"
        )

    @property
    def rms_attitude(self) -> float:
        """Root mean square of the attitude errors [rad]."""
        return float(np.sqrt(np.mean(np.sum(np.square(self.attitude), axis=1))))

    @property
    def rms_tilt(self) -> float:
        """Root mean square of the tilt errors [rad]."""
        return float(np.sqrt(np.mean(np.square(self.tilt))))

    @property
    def rms_heading(self) -> float:
        """Root mean square of the heading errors [rad]."""
        return float(np.sqrt(np.mean(np.square(self.heading))))

    def to_dict(self) -> JsonObject:
        """Return all errors in plain types, as ``evaluate --json`` prints them."""
        return {
            **({"topic": self.topic} if self.topic else {}),
            "kind": "orientation",
            **pair_counts(self.t_ns, self.without_truth, self.coverage),
            "attitude_error_rad": statistics(np.linalg.norm(self.attitude, axis=1))._asdict(),
            "tilt_error_rad": statistics(self.tilt)._asdict(),
            "heading_error_rad": statistics(np.abs(self.heading))._asdict(),
            "mean_heading_error_rad": float(np.mean(self.heading)),
            "rms_attitude_vector_rad": np.sqrt(np.mean(self.attitude**2, axis=0)).tolist(),
            "nees": self.nees,
            "no_nees": self.no_nees,
        }

    def lines(self) -> Iterator[str | TextTable]:
        """Yield the text of the evaluation, as ``evaluate`` prints it."""
        topic = self.topic or "attitude"
        yield from heading_lines(topic, self.t_ns, self.without_truth, self.coverage)
        sizes = np.linalg.norm(self.attitude, axis=1), self.tilt, np.abs(self.heading)
        yield statistics_table(
            (f"{name} [deg]", statistics(np.degrees(size))._asdict())
            for name, size in zip(("attitude", "tilt", "heading"), sizes, strict=True)
        )
        yield f"mean heading error: {np.degrees(np.mean(self.heading)):.3g} deg"
        yield nees_line(self.nees, self.no_nees)


def pair_counts(t_ns: Times, without_truth: int, covered: Coverage) -> dict[str, object]:
    """Return the number of samples that are compared and left out, and the time they span."""
    return {
        "samples": len(t_ns),
        "samples_without_truth": without_truth,
        "duration_s": float(t_ns[-1] - t_ns[0]) * 1e-9,
        **covered.to_dict(),
    }


def heading_lines(topic: str, t_ns: Times, without_truth: int, covered: Coverage) -> Iterator[str]:
    """Yield the lines about the compared attitudes, and about those without a truth."""
    yield f"{topic}: {len(t_ns)} samples, {float(t_ns[-1] - t_ns[0]) * 1e-9:.6g} s"
    yield coverage_line(covered.to_dict())
    if without_truth:
        yield f"{without_truth} samples skipped: no truth at their times"


def nees_line(nees: SampleNees | None, why_none: str | None) -> str:
    """Return a NEES, as :func:`nees_of_errors` gives it, as text."""
    if nees is None:
        return f"no NEES: {why_none}"
    low, high = nees["band_95"]
    return (
        f"NEES of the {nees['samples']} samples that state a covariance: {nees['mean']:.3g}, "
        f"{nees['expected']} expected; "
        f"{100.0 * nees['inside_band']:.0f} % between {low:.3g} and {high:.3g}, 95 % expected"
    )


def statistics_table(rows: Iterable[tuple[str, Mapping[str, float]]], title: str = "") -> TextTable:
    """Return statistics of errors by name as a table."""
    names = ("rmse", "mean", "median", "std", "min", "max")
    cells = [[name, *(f"{values[key]:.3g}" for key in names)] for name, values in rows]
    return TextTable(["error", *names], cells, title)


class SampleNees(TypedDict):
    """The NEES of the samples that state a covariance."""

    samples: int
    expected: int
    mean: float
    band_95: list[float]
    inside_band: float


def nees_of_errors(errors: Array, covariance: Array) -> tuple[SampleNees | None, str | None]:
    """Return the NEES of errors (n, k) by their covariances (n, k, k), or why there is none."""
    stated = invertible(covariance)
    if not stated.any():
        return None, "the messages state no covariance"
    freedom = errors.shape[1]
    values = nees(errors[stated], covariance[stated])
    band = anees_band(freedom, 1)
    summary: SampleNees = {
        "samples": int(np.count_nonzero(stated)),
        "expected": freedom,
        "mean": float(values.mean()),
        "band_95": list(band),
        "inside_band": float(np.mean((values >= band.low) & (values <= band.high))),
    }
    return summary, None


def is_attitude_estimate(estimate: object) -> bool:
    """Return whether an object has attitudes in time and no positions."""
    if not hasattr(estimate, "t_ns") or hasattr(estimate, "position"):
        return False
    return any(hasattr(estimate, name) for name in _NAMES)


def evaluate_attitude(estimate: Any, truth: States, max_gap: float) -> AttitudeEvaluation:
    """Compare attitudes with the truth; arguments as for ``evaluate``.

    :raises ConfigurationError: for arrays of another shape.
    :raises InputError: if both do not overlap in time.
    """
    name = next(name for name in _NAMES if hasattr(estimate, name))
    t_ns = stamps("estimate.t_ns", estimate.t_ns)
    if (t_ns[1:] <= t_ns[:-1]).any():
        refuse("estimate.t_ns", estimate.t_ns, "strictly increasing")
    stated = getattr(estimate, name)
    q_wb = array(f"estimate.{name}", stated, (len(t_ns), 4))
    if (np.linalg.norm(q_wb, axis=1) < 0.5).any():
        refuse(f"estimate.{name}", stated, "unit quaternions (w, x, y, z)")
    return compare_attitudes(t_ns, q_wb, truth, max_gap)


def compare_attitudes(
    t_ns: Times,
    q_wb: Array,
    truth: States,
    max_gap: float,
    q_bi: Array | None = None,
    covariance: Array | None = None,
) -> AttitudeEvaluation:
    """Compare attitudes (n, 4) at times (n,) with the truth of a body.

    :param max_gap: the truth is not interpolated across longer gaps [s].
    :param q_bi: (4,) attitude of the sensor on the body; None: that of the body.
    :param covariance: (n, 3, 3) of each attitude's errors about the world's axes [rad^2].
    :raises InputError: if both do not overlap in time.
    """
    rows = common_rows(t_ns, truth.t_ns, max_gap)
    q, true = normalise(q_wb[rows]), poses_at(truth, t_ns[rows]).q_wb
    if q_bi is not None:
        true = multiply(true, q_bi[None])
    errors = attitude_errors(q, true)
    consistency = (None, None) if covariance is None else nees_of_errors(errors, covariance[rows])
    angles = tilt_and_heading_errors(q, true)
    covered = coverage(t_ns, truth.t_ns, max_gap)
    return AttitudeEvaluation(
        t_ns[rows], errors, *angles, covered, len(t_ns) - len(rows), *consistency
    )
