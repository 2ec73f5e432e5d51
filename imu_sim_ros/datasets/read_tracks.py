# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A folder of tracks, read back."""

from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.camera import read_points
from imu_sim_ros.config import files
from imu_sim_ros.config.cameras import CameraParameters, load_rig
from imu_sim_ros.errors import ImuSimError, InputError, system_error
from imu_sim_ros.inputs import open_regular

Array = NDArray[np.float64]

_COLUMNS: Final[dict[str, tuple[str, int]]] = {
    "true_t_ns": ("i", 1),
    "camera": ("i", 1),
    "landmark": ("i", 1),
    "uv": ("f", 2),
    "wrong": ("b", 1),
}
"""Kind and dimensions of each array of tracks.npz that is read."""


class TrackFolder(NamedTuple):
    """What ``generate --format tracks`` wrote: n features, in order of time."""

    cameras: dict[str, CameraParameters]
    landmarks: Array
    """(m, 3) p_w [m]."""
    true_t_ns: NDArray[np.int64]
    """(n,) the middle of the exposure [ns]."""
    camera: NDArray[np.int64]
    """(n,) place of the camera among ``cameras``."""
    landmark: NDArray[np.int64]
    """(n,) row of what is seen."""
    uv: Array
    """(n, 2) measured pixel."""
    wrong: NDArray[np.bool_]
    """(n,) an outlier, or the pixel of another feature."""


def read_track_folder(folder: Path) -> TrackFolder:
    """Return cameras, landmarks and features of a folder.

    :raises InputError: for a folder that ``generate --format tracks`` did not write.
    :raises ConfigurationError: for a cameras.yaml that describes none.
    """
    path = folder / "tracks.npz"
    cameras = load_rig(files.load(folder / "cameras.yaml")).each()
    landmarks = read_points(folder / "landmarks.csv")
    columns = _arrays(path)
    for name, most in (("camera", len(cameras)), ("landmark", len(landmarks))):
        values = columns[name]
        if len(values) and not (values.min() >= 0 and values.max() < most):
            raise InputError(f"{path}: {name}: must be 0 to {most - 1}")
    return TrackFolder(cameras, landmarks, **columns)


def _arrays(path: Path) -> dict[str, Any]:
    try:
        with open_regular(path) as file, np.load(file, allow_pickle=False) as archive:
            found = {name: archive[name] for name in _COLUMNS}
    except ImuSimError:
        raise
    except OSError as error:
        raise system_error(path, error) from None
    except Exception as error:  # zipfile and NumPy have many words for a broken file
        raise InputError(f"{path}: is not the tracks.npz of generate ({error})") from None
    count = len(found["uv"]) if found["uv"].ndim else 0
    for name, (kind, dimensions) in _COLUMNS.items():
        shape = (count, 2) if dimensions == 2 else (count,)
        if found[name].dtype.kind != kind or found[name].shape != shape:
            raise InputError(f"{path}: {name}: {found[name].dtype} {found[name].shape}")
    if not np.isfinite(found["uv"]).all():
        raise InputError(f"{path}: uv: must be finite")
    return found
