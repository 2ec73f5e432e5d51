# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A track states its covariance, and ``evaluate`` its NEES, as the command does."""

import numpy as np
import pytest

import imu_sim_ros as ims

RUNS = 40
FLIGHT = {"imu": "adis16448", "trajectory": "lecture", "duration": 5, "rate": 100}


def test_the_covariance_of_a_track_is_that_of_its_errors():
    """Final position and attitude of 40 flights of 5 s; 3 is right.

    The 99.9 % band of the mean of 40 chi-squares of 3: 1.9 to 4.4; sqrt(2) gives 1.5 or 6.
    """
    final = {"position": [], "attitude": []}
    for seed in range(RUNS):
        flight = ims.simulate(
            imu="adis16448", trajectory="lecture", duration=5, rate=100, seed=seed
        )
        track = ims.dead_reckon(flight, covariance=True)
        assert track.covariance.shape == (len(track), 6, 6)
        evaluation = ims.evaluate(track, flight.truth)
        p = track.covariance[-1]
        error = evaluation.position[-1]
        assert evaluation.nees["position"]["final"] == pytest.approx(
            error @ np.linalg.solve(p[:3, :3], error)
        )
        for name, values in final.items():
            values.append(evaluation.nees[name]["final"])
    for values in final.values():
        assert 1.9 < np.mean(values) < 4.4


def test_the_nees_is_left_out_where_the_alignment_removes_a_part_of_the_error():
    flight = ims.simulate(**FLIGHT, seed=1)
    track = ims.dead_reckon(flight, covariance=True)
    assert ims.evaluate(track, flight.truth, align="yaw").nees["gauge"] == "first pose"
    evaluation = ims.evaluate(track, flight.truth, align="se3")
    assert evaluation.nees is None
    assert evaluation.no_nees.startswith("alignment se3 removes a part")
    assert "no covariance" in ims.evaluate(ims.dead_reckon(flight), flight.truth).no_nees
