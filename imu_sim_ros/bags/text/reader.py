# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""IMU readings and states of text: EuRoC folders, and CSV in the forms of EuRoC and kalibr."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.errors import InputError
from imu_sim_ros.rotation import normalise, rotate_inverse

Array = NDArray[np.float64]
Times = NDArray[np.int64]

_BLOCK_ROWS: Final = 65536
_IMU_COLUMNS: Final = 6
_STATE_COLUMNS: Final = 16
_STATE_FOLDER: Final = "state_groundtruth_estimate0"
_SUFFIXES: Final = (".csv", ".txt", ".tum")


class Odometry(NamedTuple):
    """n states with the fields of odometry messages."""

    t_ns: Times
    position: Array
    q_wb: Array
    velocity_b: Array
    angular_velocity_b: Array
    """(n, 3) zero: EuRoC's states have none."""
    pose_covariance: Array
    twist_covariance: Array


class States(NamedTuple):
    """n states of a EuRoC folder."""

    odometry: Odometry
    gyro_bias: Array
    """(n, 3) rad/s."""
    accel_bias: Array
    """(n, 3) m/s^2."""


def is_text(path: Path) -> bool:
    """Tell whether a path is a EuRoC folder, a folder of kalibr's CSV files, or a text file."""
    if path.is_dir():
        return bool(_imu_files(path)) or _state_path(path) is not None
    return path.suffix.lower() in _SUFFIXES and path.is_file()


def imu_blocks(path: Path, name: str | None = None) -> Iterator[tuple[Times, Array, Array]]:
    """Yield stamps (n,), angular rates (n, 3) and specific forces (n, 3) in blocks.

    :param name: of the sensor, where a folder has several: imu0, imu1.
    """
    for t_ns, numbers in _blocks(_imu_file(path, name), _IMU_COLUMNS):
        yield t_ns, numbers[:, :3], numbers[:, 3:]


def state_file(path: Path) -> Path:
    """Return the file of the states in a EuRoC folder.

    :raises InputError: where there is none.
    """
    found = _state_path(path) if path.is_dir() else path
    if found is None:
        raise InputError(f"{path}: has no {_STATE_FOLDER}/data.csv")
    return found


def state_blocks(path: Path, topic: str | None = None) -> Iterator[States]:
    """Yield the states of a EuRoC folder, or of its file, in blocks."""
    if topic is not None:
        raise InputError(f"{path}: text has no topic {topic}")
    for t_ns, numbers in _blocks(state_file(path), _STATE_COLUMNS):
        q_wb = normalise(numbers[:, 3:7])
        square = np.zeros((len(t_ns), 6, 6))
        odometry = Odometry(
            t_ns,
            numbers[:, :3],
            q_wb,
            rotate_inverse(q_wb, numbers[:, 7:10]),
            np.zeros((len(t_ns), 3)),
            square,
            square,
        )
        yield States(odometry, numbers[:, 10:13], numbers[:, 13:16])


def has_states(path: Path) -> bool:
    """Tell whether a folder has states beside its readings."""
    return path.is_dir() and _state_path(path) is not None


def _imu_file(path: Path, name: str | None) -> Path:
    if not path.is_dir():
        return path
    found = _imu_files(path)
    if name is not None:
        if name not in found:
            raise InputError(f"{path}: has no sensor {name}; it has {', '.join(found) or 'none'}")
        return found[name]
    if len(found) != 1:
        words = f"several, name one of {', '.join(found)}" if found else "no imu0"
        raise InputError(f"{path}: IMU data: {words}")
    return next(iter(found.values()))


def _imu_files(folder: Path) -> dict[str, Path]:
    """Return the files of IMUs by name: imu0/data.csv (EuRoC) or imu0.csv (kalibr)."""
    found: dict[str, Path] = {}
    for place in (folder, folder / "mav0"):
        for file in sorted([*place.glob("imu*/data.csv"), *place.glob("imu*.csv")]):
            found.setdefault(file.stem if file.parent == place else file.parent.name, file)
    return found


def _state_path(folder: Path) -> Path | None:
    for place in (folder, folder / "mav0"):
        file = place / _STATE_FOLDER / "data.csv"
        if file.is_file():
            return file
    return None


def _blocks(path: Path, columns: int) -> Iterator[tuple[Times, Array]]:
    """Yield stamps (n,) and numbers (n, columns) of a CSV file.

    :raises InputError: for a file of another form, with the line where that is known.
    """
    row = np.dtype([("t_ns", "<i8"), ("numbers", "<f8", (columns,))])
    line = rows = 0
    try:
        with path.open(encoding="utf-8") as file:
            start = file.tell()
            first = file.readline()
            if first[:1].isdigit():
                file.seek(start)
            else:
                line = 1
            while True:
                block = _load(file, row)
                if not len(block):
                    break
                yield block["t_ns"], block["numbers"]
                line += len(block)
                rows += len(block)
    except (ValueError, OverflowError, DeprecationWarning) as error:
        reason = " ".join(str(error).split()).split(";")[0]
        raise InputError(
            f"{path}: after line {line}: {reason}; expected nanoseconds and {columns} numbers"
        ) from None
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    if not rows:
        raise InputError(f"{path}: holds no rows")


def _load(file: Any, row: np.dtype[np.void]) -> NDArray[np.void]:
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # numpy warns of the end of the file
        warnings.simplefilter("error", DeprecationWarning)  # numpy 1 takes 1.5 for the integer 1
        return np.loadtxt(file, row, delimiter=",", ndmin=1, max_rows=_BLOCK_ROWS)
