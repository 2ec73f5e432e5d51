# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

r"""ORB_SLAM3, mono- or stereo-inertial, on the images and readings of an EuRoC folder.

    generate -o flight/mav0 --format euroc --imu adis16448 --trajectory figure_eight \
        --duration 30s --camera euroc_cam0 --camera euroc_cam1 \
        --with-configs
    python examples/orb_slam3_vio.py flight flight/mav0_configs estimate.tum
    evaluate estimate.tum flight/mav0/state_groundtruth_estimate0/data.csv --align se3

Frames are fed no faster than a camera would. Mapping runs parallel to tracking, in threads of
its own, so that two runs differ in their last digits. The path is that of the IMU from the map's
beginning, metric, in a frame of its own: align it with all six degrees of freedom. Needs pyorbslam3
(pip install pyorbslam3 opencv-python-headless), which loads ORB_SLAM3's vocabulary when it is
first used, or takes the file that PYORBSLAM3_VOCAB names. The header of a vocabulary of your own
must say 6 levels: ORB_SLAM3 groups words four levels above the last, however many there are.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
import pyorbslam3


def read_frames(folder: Path, camera: str) -> list[tuple[int, Path]]:
    """Return the stamps [ns] and images of a camera."""
    rows = (folder / camera / "data.csv").read_text(encoding="utf-8").splitlines()
    cells = (row.split(",") for row in rows if not row.startswith("#"))
    return [(int(t), folder / camera / "data" / name.strip()) for t, name in cells]


def grey(path: Path) -> np.ndarray:
    """Return an image (h, w), uint8."""
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise SystemExit(f"{path}: cannot be read as an image")
    return image


def follow(slam: pyorbslam3.Slam, folder: Path, stereo: bool) -> int:
    """Track all frames; return how many had a pose."""
    readings = np.loadtxt(folder / "imu0" / "data.csv", delimiter=",")
    readings[:, 0] *= 1e-9
    left_frames = read_frames(folder, "cam0")
    right_frames = read_frames(folder, "cam1") if stereo else left_frames
    begin, used, tracked = time.monotonic(), 0, 0
    for (t_ns, image), (_, right_image) in zip(left_frames, right_frames, strict=True):
        t = t_ns * 1e-9
        time.sleep(max(0.0, begin + (t_ns - left_frames[0][0]) * 1e-9 - time.monotonic()))
        until = int(np.searchsorted(readings[:, 0], t, side="right"))
        imu, used = readings[used:until, :7], until
        if stereo:
            tracking = slam.track_stereo(grey(image), grey(right_image), t, imu=imu)
        else:
            tracking = slam.track_monocular(grey(image), t, imu=imu)
        tracked += bool(tracking.ok)
    return tracked


def write_tum(slam: pyorbslam3.Slam, path: Path) -> int:
    """Write the path of the IMU in TUM form; return its length in poses."""
    with tempfile.TemporaryDirectory() as folder:
        euroc_file = Path(folder) / "path.txt"
        slam.save_trajectory_euroc(str(euroc_file))  # rows of t [ns], position, quaternion x y z w
        rows = [row.split() for row in euroc_file.read_text(encoding="utf-8").splitlines()]
    lines = [" ".join([f"{float(row[0]) * 1e-9:.9f}", *row[1:]]) for row in rows if len(row) == 8]
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
    return len(lines)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", type=Path, help="folder with mav0")
    parser.add_argument("configuration", type=Path, help="folder with orb_slam3_*_inertial.yaml")
    parser.add_argument("output", type=Path, help="file for the path, TUM")
    parser.add_argument("--mono", action="store_true", help="the first camera only")
    arguments = parser.parse_args()
    settings = arguments.configuration / "orb_slam3_stereo_inertial.yaml"
    stereo = settings.exists() and not arguments.mono
    if not stereo:
        settings = arguments.configuration / "orb_slam3_mono_inertial.yaml"
    sensor = pyorbslam3.Sensor.IMU_STEREO if stereo else pyorbslam3.Sensor.IMU_MONOCULAR
    slam = pyorbslam3.Slam(pyorbslam3.vocabulary_path(), settings, sensor)
    tracked = follow(slam, arguments.dataset / "mav0", stereo)
    initialised = slam.imu_initialized()
    slam.shutdown()
    if not (tracked and initialised):
        raise SystemExit("ORB_SLAM3 was not initialised: it needs motion in all directions")
    print(f"{tracked} frames tracked, {write_tum(slam, arguments.output)} poses", file=sys.stderr)


if __name__ == "__main__":
    main()
