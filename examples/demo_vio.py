# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""``make demo-vio``: a stereo dataset of a room, gtsam's path through it, and how good it is.

    python examples/demo_vio.py demo_vio_output

``generate`` writes EuRoC's folder with images and a folder of tracks, the same flight and seed;
``gtsam_vio.py`` estimates the motion from readings and tracks of both cameras; ``evaluate``
compares with the truth. The pictures: ``path.png``, and ``tracks.png``, frames with their features.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np

BIN = Path(sys.executable).parent
FLIGHT = [
    *("--imu", "adis16448", "--trajectory", "figure_eight", "--duration", "15s", "--seed", "3"),
    *("--camera", "euroc_cam0", "--camera", "euroc_cam1", "--scene", "room"),
    *("--set", "camera.max_features=60"),
    *("--set", "camera.exposure_time=0.004", "--set", "camera.blur_samples=2"),
    *("--set", "camera.vignetting=0.2"),
]
SHOWN = 12
"""Frames of the contact sheet."""
TAIL = 5
"""Frames back to which a feature's trace goes."""
WHITE = (255, 255, 255)


def run(*command: str | Path) -> None:
    """Print a command, and run it."""
    print("demo-vio:", *(Path(command[0]).name, *command[1:]), flush=True)
    process = subprocess.run([str(word) for word in command], check=False)
    if process.returncode:
        sys.exit(f"demo-vio: {Path(command[0]).name} ended with status {process.returncode}")


def contact_sheet(tracks: Path, images: Path, output: Path) -> None:
    """Draw the features of some frames of the first camera, with where each was before."""
    columns = np.load(tracks / "tracks.npz")
    of_camera = columns["camera"] == 0
    t_ns, ids, uv = (columns[name][of_camera] for name in ("t_ns", "id", "uv"))
    frames = np.unique(t_ns)
    sheet_frames = frames[np.linspace(TAIL, len(frames) - 1, SHOWN).astype(int)]
    pictures = []
    for frame_ns in sheet_frames.tolist():
        picture = cv2.imread(str(images / f"{frame_ns:019d}.png"), cv2.IMREAD_COLOR)
        frame_index = int(np.searchsorted(frames, frame_ns))
        traces = [
            dict(zip(ids[t_ns == t].tolist(), uv[t_ns == t], strict=True))
            for t in frames[frame_index - TAIL : frame_index + 1]
        ]
        for identity, pixel in traces[-1].items():
            trace = [pixels[identity] for pixels in traces if identity in pixels]
            line = np.rint(trace).astype(np.int32).reshape(-1, 1, 2)
            cv2.polylines(picture, [line], False, (0, 160, 255), 2, cv2.LINE_AA)
            center = tuple(np.rint(pixel).astype(int).tolist())
            cv2.circle(picture, center, 5, (60, 220, 60), 2, cv2.LINE_AA)
        small = cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        framed = cv2.copyMakeBorder(small, 24, 3, 3, 3, cv2.BORDER_CONSTANT, value=WHITE)
        pictures.append(labelled(framed, f"{(frame_ns - frames[0]) * 1e-9:.2f} s"))
    rows = [np.hstack(pictures[k : k + 4]) for k in range(0, SHOWN, 4)]
    title = np.full((30, rows[0].shape[1], 3), 255, np.uint8)
    text = f"cam0: features (green) and where each was in the last {TAIL} frames (orange)"
    cv2.imwrite(str(output), np.vstack([labelled(title, text), *rows]))


def labelled(picture: np.ndarray, text: str) -> np.ndarray:
    """Write a line at the top of a picture, where it is white."""
    font = cv2.FONT_HERSHEY_SIMPLEX
    return cv2.putText(picture, text, (6, 18), font, 0.55, (0, 0, 0), 1, cv2.LINE_AA)


def main() -> None:
    """Make the dataset, run the estimator, compare, draw."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "demo_vio_output")
    if folder.exists() and not (folder / "estimate.txt").exists() and any(folder.iterdir()):
        sys.exit(f"demo-vio: {folder}: contains something else; choose another folder")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    mav0, tracks, estimate = folder / "mav0", folder / "tracks", folder / "estimate.txt"
    estimate.touch()  # from here on the folder is known as ours
    run(BIN / "generate", "-o", mav0, "--format", "euroc", *FLIGHT)
    run(BIN / "generate", "-o", tracks, "--format", "tracks", *FLIGHT, "--with-configs")
    script = Path(__file__).with_name("gtsam_vio.py")
    run(sys.executable, script, tracks, "--cameras", "2", "-o", estimate)
    truth = tracks / "groundtruth.tum"
    run(
        BIN / "evaluate",
        estimate,
        truth,
        "--rpe",
        "1s",
        "--rpe",
        "5m",
        "--plot",
        folder / "path.png",
    )
    contact_sheet(tracks, mav0 / "cam0" / "data", folder / "tracks.png")
    print(f"demo-vio: pictures: {folder / 'path.png'}, {folder / 'tracks.png'}")


if __name__ == "__main__":
    main()
