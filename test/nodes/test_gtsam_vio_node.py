# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A real estimator on the running simulator: the estimate of the same flight's files."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from programs import PATIENCE

from imu_sim_ros.commands import generate

pytestmark = pytest.mark.ros

EXAMPLES = Path(__file__).parents[2] / "examples"
FLIGHT = {
    "imu.preset": "adis16448",
    "cameras": "[cam0]",
    "cam0.camera.preset": "euroc_cam0",
    "camera.body_axes": "flu",
    "camera.max_features": 40,
    "camera.images": "none",
    "duration": 3.0,
    "start_time": 1.0,
    "seed": 2,
}


def as_vins_sends_them(folder: Path) -> None:
    """Make tracks of files those of VINS' messages.

    A feature is withheld in its first frame, and one that comes back is a new one. Files have all
    observations, under the landmark's number.
    """
    tracks = dict(np.load(folder / "tracks.npz"))
    frame = np.unique(tracks["t_ns"], return_inverse=True)[1]
    order = np.lexsort((frame, tracks["id"]))
    identity, frame = tracks["id"][order], frame[order]
    is_new_feature = np.diff(identity, prepend=-1) != 0
    begins = is_new_feature | (np.diff(frame, prepend=-2) != 1)
    sent = np.sort(order[~begins])
    tracks["id"][order] = np.cumsum(begins)
    np.savez(folder / "tracks.npz", **{name: column[sent] for name, column in tracks.items()})


def test_the_live_estimate_is_the_one_from_files(start, domains, tmp_path):
    pytest.importorskip("gtsam")
    settings = [word for key, value in FLIGHT.items() for word in ("--set", f"{key}={value}")]
    folder, path = tmp_path / "tracks", tmp_path / "tracks_configs" / "simulation.yaml"
    generate_arguments = [
        "-o",
        str(folder),
        "--format",
        "tracks",
        "--trajectory",
        "figure_eight",
        "--quiet",
    ]
    assert generate.main([*generate_arguments, *settings, "--with-configs"]) == 0
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(domains[0]),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_PYTHON_CHECK_FIELDS": "1",
    }
    node = subprocess.Popen(
        [sys.executable, str(EXAMPLES / "gtsam_vio_node.py"), str(path)],
        stdout=subprocess.PIPE,
        env=environment,
    )
    simulator = start(
        "simulator",
        *("--trajectory", "figure_eight"),
        **{key.replace(".", "__"): value for key, value in FLIGHT.items()},
        wait_for_subscribers=1,
        wait_for_truth_subscribers=1,
    )
    try:
        live = json.loads(node.communicate(timeout=PATIENCE)[0])
    finally:
        node.kill()
    assert simulator.status() == 0
    # Live the first frame is withheld: frames 5, 10, ... are key frames.
    as_vins_sends_them(folder)
    code = (
        "import sys, json; from pathlib import Path; import gtsam_vio as g\n"
        "p, cameras = g.configuration(Path(sys.argv[2]))\n"
        "print(json.dumps(g.run(Path(sys.argv[1]), p, *cameras, first_frame=4).summary()))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(folder), str(path)],
        cwd=EXAMPLES,
        capture_output=True,
        text=True,
        check=True,
    )
    offline = json.loads(done.stdout)
    print(live, offline)
    # The same numbers but for float32 pixels, and a first velocity from differences of the path.
    assert live["keyframes"] == offline["keyframes"] == 11
    assert live == pytest.approx(offline, rel=0.01)
    assert live["position_rmse_m"] < 0.1
