# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A real estimator on what we simulate: gtsam's errors are as large as gtsam itself says."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scripts import load_script

from imu_sim_ros.commands import generate
from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.inputs.poses import read_poses
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import build, flatten
from imu_sim_ros.sensors.imu.parameters import ImuParameters
from imu_sim_ros.simulation.parameters import load_simulation

EXAMPLE = Path(__file__).parents[2] / "examples/gtsam_vio.py"
SEEDS = range(1, 6)


@pytest.fixture(scope="module", name="example")
def load_example():
    pytest.importorskip("gtsam")
    return load_script(EXAMPLE)


def flight(folder, seed, *options, imu="adis16448", duration="8s"):
    arguments = (
        f"-o {folder} --format tracks --imu {imu} --trajectory figure_eight --duration {duration} "
        f"--camera euroc_cam0 --scene room --set camera.body_axes=flu --set camera.max_features=60 "
        f"--set scene.seed={seed} --seed {seed} --with-configs --quiet"
    )
    assert generate.main([*arguments.split(), *options]) == 0
    simulation = load_simulation(files.load(Path(f"{folder}_configs") / "simulation.yaml"))
    return simulation, simulation.rig.camera("cam0")


@pytest.fixture(scope="module", name="results")
def run_all(example, tmp_path_factory):
    folder = tmp_path_factory.mktemp("flights")
    return [
        example.run(folder / f"{seed}", *flight(folder / f"{seed}", seed)).summary()
        for seed in SEEDS
    ]


def test_every_run_stays_within_a_decimetre(results):
    assert max(result["position_rmse_m"] for result in results) < 0.1
    assert min(result["keyframes"] for result in results) == 32


@pytest.mark.parametrize("quantity", ["nees_position_per_dof", "nees_orientation_per_dof"])
def test_the_errors_are_as_large_as_the_covariance_says(results, quantity):
    """The mean of a consistent estimator is 1.

    Errors of neighbouring key frames are nearly the same, so a run counts for a few independent
    values of 3 degrees of freedom only; over five runs the mean of at least 15 degrees lies within
    1 +- 2.7 sqrt(2 / 15) = 0.01 to 1.99 in 99 of 100 cases. An IMU noise wrong by a factor of 10
    gives 5 and more (below).
    """
    mean = np.mean([result[quantity] for result in results])
    assert 0.5 < mean < 2.0


def test_what_is_older_than_the_lag_is_marginalised(example, tmp_path, monkeypatch):
    """So a key frame takes as long at the end as at the beginning; the estimate stays consistent.

    Two seconds at 4 Hz: 8 key frames, and the ends of both.
    """
    monkeypatch.setattr(example, "LAG", 2.0)
    gtsam = pytest.importorskip("gtsam")
    look, sizes, landmarks = example.Estimator.look, [], []

    def watched(self, *features):
        look(self, *features)
        values = self.smoother.getLinearizationPoint()
        sizes.append(sum(gtsam.Symbol(key).chr() == ord("x") for key in values.keys()))  # noqa: SIM118
        landmarks.append((values.size() - 3 * sizes[-1], len(self._known), self._landmarks))

    monkeypatch.setattr(example.Estimator, "look", watched)
    summary = example.run(tmp_path / "flight", *flight(tmp_path / "flight", 3)).summary()
    assert max(sizes) <= 10
    assert max(landmark_count for landmark_count, _, _ in landmarks) < 0.7 * landmarks[-1][2]
    assert all(
        initialised_count <= landmark_count for landmark_count, initialised_count, _ in landmarks
    )
    assert summary["position_rmse_m"] < 0.15
    assert summary["nees_position_per_dof"] < 3.8


def test_noise_configured_ten_times_too_small_shows_in_the_nees(example, tmp_path):
    parameters, camera = flight(tmp_path / "flight", 1, duration="10s")
    values = flatten(parameters.imu)
    kinds = ("_noise_density", "_random_walk")
    densities = [n for n in values if n.endswith(kinds) and n.startswith(TRIADS)]
    assert len(densities) == 4
    tenth = values | {name: tuple(0.1 * np.array(values[name])) for name in densities}
    wrong = dataclasses.replace(parameters, imu=build(ImuParameters, tenth))
    summary = example.run(tmp_path / "flight", wrong, camera).summary()
    print(summary)
    assert summary["nees_orientation_per_dof"] > 3.0


def test_the_path_keeps_the_nanoseconds_of_todays_stamps(example, tmp_path):
    t_ns = np.array([1_795_289_639_353_877_837, 1_795_289_639_603_877_838])
    q_wb = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    rows, numbers = np.arange(6.0).reshape(2, 3), np.zeros(2)
    covariance = np.tile(np.eye(6), (2, 1, 1))
    result = example.Result(t_ns, rows, q_wb, rows, rows, numbers, numbers, covariance)
    result.write(tmp_path / "path.txt")
    poses = read_poses(tmp_path / "path.txt", covariance=True)
    assert poses.t_ns.tolist() == t_ns.tolist()
    np.testing.assert_array_equal(poses.position, rows)
    np.testing.assert_array_equal(poses.covariance, covariance)


def test_errors_that_gtsam_does_not_know_are_in_its_covariance(example, tmp_path):
    """Scale and misalignment of 1 %, a gyroscope's bias of 10 deg/s.

    Without the walks that stand for the first the NEES is 30 to 150 per degree of freedom; without
    the rest that shows the second iSAM2 ends with an error. The walks are conservative: no lower
    limit.
    """
    rest = ("--set", "trajectory.rest_before=1.0")
    configuration = flight(tmp_path / "flight", 2, *rest, imu="mpu6000", duration="6s")
    summary = example.run(tmp_path / "flight", *configuration).summary()
    print(summary)
    assert summary["keyframes"] == 20
    assert summary["nees_position_per_dof"] < 3.0
    assert summary["nees_orientation_per_dof"] < 3.0


def test_an_estimate_that_has_run_away_is_one_line(example):
    """On MH_05 without a rest before it the covariance became singular at key frame 301."""
    covariance = np.diag([1e-4] * 3 + [0.04] * 3)
    example.stop_if_lost(covariance, 80)
    for lost in (np.diag([1e-4] * 3 + [1e4] * 3), np.full((6, 6), np.nan)):
        with pytest.raises(SystemExit, match="^lost: at key frame 80 the position has a standard"):
            example.stop_if_lost(lost, 80)
