# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""IMU files of other tools: kalibr, OpenVINS, EuRoC, Kimera-VIO and maplab; flat parameter files.

Each key becomes a parameter, or a remark names it. Readings are those of the tools' own models:

- kalibr, ``scale-misalignment`` (IccSensors.py): ``w_m = M_g C_gyro_i w + A C_gyro_i a + b_g`` and
  ``a_m = M_a a + b_a``; with ``size-effect`` each accelerometer is at its own place ``rx_i``,
  ``ry_i``, ``rz_i`` in the IMU.
- OpenVINS (ov_msckf, Simulator.cpp, VioManagerOptions.h): ``w_m = T_w R_IMUtoGYRO w + T_g a + b_g``
  and ``a_m = T_a R_IMUtoACC a + b_a``. It keeps one triangle of the inverses of T_w and T_a: the
  lower one with ``model: kalibr``, the upper one with ``model: rpng``.

Here both are ``w_m = S_g w + G a + b_g`` and ``a_m = S_a a + b_a``.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.conventions import TRIADS
from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.names import nearest, short_repr, suggestion
from imu_sim_ros.core.rotation import inverse_pose, rigid_motion
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters.files import dotted_values
from imu_sim_ros.parameters.kinds import Parameter
from imu_sim_ros.parameters.sections import parameters
from imu_sim_ros.parameters.yaml_text import YamlMapping
from imu_sim_ros.sensors.environment import EnvironmentParameters
from imu_sim_ros.sensors.imu import estimator_settings
from imu_sim_ros.sensors.imu.parameters import ImuParameters

_IMU: Final = "imu."
_REQUIRED: Final = tuple(f"{t}_{key}" for t in TRIADS for key in ("noise_density", "random_walk"))
_PARAMETERS: Final = {
    **{name: f"{_IMU}{name}" for name in _REQUIRED},
    # maplab, sensors/src/imu.cc
    "gyro_noise_density": "imu.gyroscope_noise_density",
    "gyro_bias_random_walk_noise_density": "imu.gyroscope_random_walk",
    "acc_noise_density": "imu.accelerometer_noise_density",
    "acc_bias_random_walk_noise_density": "imu.accelerometer_random_walk",
    "saturation_accel_max_mps2": "imu.accelerometer_range",
    "saturation_gyro_max_radps": "imu.gyroscope_range",
    "saturation_accel_max": "imu.accelerometer_range",
    "saturation_gyro_max": "imu.gyroscope_range",
    "gravity_magnitude_mps2": "gravity",
    "gravity_magnitude": "gravity",
    "n_gravity": "gravity",
    "update_rate": "rate",
    "rate_hz": "rate",
}
"""Parameters by the keys of the tools; the units are the same."""
_SIGMAS: Final = ("sigmas", "imu_sigmas")
_TRIADS: Final = {
    "gyroscopes": ("M", "A", "C_gyro_i"),
    "accelerometers": ("M", "rx_i", "ry_i", "rz_i"),
}
_OPENVINS: Final = ("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC", "Tg")
_MODELS: Final = (
    *("calibrated", "scale-misalignment", "scale-misalignment-size-effect"),
    *("kalibr", "rpng"),
)
_POSES: Final = ("T_i_b", "T_BS", "T_B_S")
_OF_THE_CAMERAS: Final = "a property of the cameras here, camera.time_offset"
_OF_THE_ESTIMATOR: Final = "a setting of the estimator"
_UNUSED: Final = {
    "rostopic": "the topic of the calibrated recording, not of the output",
    "topic": "the topic of the calibrated recording, not of the output",
    **dict.fromkeys(("comment", "id", "hardware_id", "label", "description"), "a description"),
    "base_sensor_id": "the body is the base",
    **dict.fromkeys(("imu_time_shift", "imu_shift"), _OF_THE_CAMERAS),
    **dict.fromkeys(
        (
            *("imu_preintegration_type", "imu_integration_sigma", "imu_bias_init_sigma"),
            *("do_imu_rate_time_alignment", "do_initial_time_alignment"),
            *("time_alignment_window_size_s", "time_alignment_variance_threshold_scaling"),
        ),
        _OF_THE_ESTIMATOR,
    ),
}
"""Keys without an effect on the readings, and why."""
_INTRINSICS: Final = (*_TRIADS, *_OPENVINS, "model")
_KEYS: Final = (
    *(*_PARAMETERS, *_SIGMAS, *_INTRINSICS, *_POSES, *_UNUSED),
    *("time_offset", "sensor_type"),
)
_EXACT: Final = 1e-9
"""Largest difference of a matrix that is rounding, smallest determinant."""

_ALIKE: Final = 0.85
"""Similarity from which on a name beside those of IMUs is a typing error of a key."""

Report = Callable[[str], object]
"""Receives a line."""


class _File(NamedTuple):
    """The keys of one IMU, on their way to parameters."""

    path: str
    values: dict[str, object]
    """Parameters by dotted name."""
    problems: list[str]
    """A line for each key or value that cannot be used."""
    unused: list[str]
    """Keys without an effect, with the reason."""

    def set(self, name: str, value: object, key: str) -> None:
        """Set a parameter; a number may be in quotes.

        :param key: key of the file that gives the value.
        """
        if name in self.values:
            self.problems.append(f"{key}: {name} is given twice")
        if name in checked_parameters():
            declaration = checked_parameters()[name]
            value = declaration.unquote(value)
            try:
                declaration.parse(key, value)
            except ConfigurationError as error:
                self.problems.extend(error.problems)
        self.values[name] = value

    def array(self, key: str, value: object, shape: tuple[int, ...]) -> Array | None:
        """Return the array of a key; None, with a problem, for anything else.

        :param value: rows, a list, or ``data`` with ``rows`` and ``cols`` (EuRoC, OpenCV).
        """
        content = value.get("data") if isinstance(value, Mapping) else value
        try:
            array = np.asarray(content, dtype=np.float64).reshape(shape)
        except (TypeError, ValueError):
            array = np.full(shape, np.nan)
        if np.isfinite(array).all():
            return array
        size = f"{' x '.join(map(str, shape))} finite numbers" if shape else "a finite number"
        self.problems.append(f"{key} = {short_repr(content)}: must be {size}")
        return None

    def unknown(self, key: str, names: Iterable[str]) -> bool:
        """Refuse a key that resembles a known one; return whether it does."""
        suggested = nearest(key, names)
        if suggested is not None:
            self.problems.append(f"{key}: unknown key; did you mean {suggested}?")
        return suggested is not None


@lru_cache(maxsize=1)
def checked_parameters() -> Mapping[str, Parameter]:
    """Return the parameters by dotted name whose values are checked where a file is read."""
    of_environment = parameters(EnvironmentParameters)
    return {
        **parameters(ImuParameters, prefix=_IMU),
        **{name: of_environment[name] for name in ("rate", "gravity")},
    }


def is_readable(tree: YamlMapping) -> bool:
    """Return whether a file without ``ros__parameters`` holds an IMU, or parameters of one."""
    names = (*_KEYS, *parameters(EnvironmentParameters), *parameters(ImuParameters))
    return (
        estimator_settings.is_readable(tree)
        or bool(_listed_imus(tree))
        or any(
            name.removeprefix(_IMU) in names
            or (isinstance(content, Mapping) and (name == "imu" or _names_an_imu(name)))
            for name, content in ((str(key), content) for key, content in tree.items())
        )
    )


def _names_an_imu(name: str) -> bool:
    """Return True for a key such as imu0."""
    return name.startswith("imu") and name.removeprefix("imu").isdecimal()


def _listed_imus(tree: YamlMapping) -> dict[str, YamlMapping]:
    """Return the IMUs in maplab's list of sensors by their names here, imu0, imu1, ..."""
    sensors = tree.get("sensors")
    entries = sensors if isinstance(sensors, list) else []
    imus = [
        entry
        for entry in entries
        if isinstance(entry, Mapping) and str(entry.get("sensor_type")).lower() == "imu"
    ]
    return {f"imu{number}": entry for number, entry in enumerate(imus)}


def _other_sensors(tree: YamlMapping) -> Iterator[str]:
    """Yield the entries in maplab's list of sensors that are no IMUs, each with its type."""
    sensors, imus = tree.get("sensors"), _listed_imus(tree).values()
    for number, entry in enumerate(sensors if isinstance(sensors, list) else []):
        if not any(entry is imu for imu in imus):
            kind = entry.get("sensor_type") if isinstance(entry, Mapping) else entry
            yield f"sensors[{number}], {short_repr(kind)}"


def parameters_of(
    tree: YamlMapping, path: str | Path, imu: str, remark: Report
) -> dict[str, object]:
    """Return the parameters of an IMU's file by dotted name.

    :param tree: content of the file.
    :param path: path of the file, for the messages.
    :param imu: name of one of several IMUs, ``imu1``; empty: the only one.
    :param remark: receives a line about keys that are not used, and one about missing noise.
    :raises ConfigurationError: with a line for each unknown key and each bad value.
    """
    unused: list[str] = []
    if estimator_settings.is_readable(tree):
        tree, unused = estimator_settings.keys_of_imu(tree, path)
    keys = {str(key): value for key, value in _imu_keys(tree, path, imu, unused).items()}
    for key in _SIGMAS:
        section = keys.get(key)
        if isinstance(section, Mapping):
            del keys[key]
            keys |= {str(name): value for name, value in section.items()}
    file = _File(str(path), {}, [], unused)
    for key, value in keys.items():
        _convert(file, key, value)
    _add_intrinsics(file, keys)
    if file.problems:
        raise ConfigurationError([f"{path}: {line}" for line in file.problems])
    if file.unused:
        remark(f"{path}: not used: {'; '.join(file.unused)}")
    missing = [name for name in _REQUIRED if f"{_IMU}{name}" not in file.values]
    if missing and any(key in _KEYS for key in keys):
        remark(f"{path}: {', '.join(missing)}: not given, so 0")
    return file.values


def _imu_keys(tree: YamlMapping, path: str | Path, imu: str, unused: list[str]) -> YamlMapping:
    """Return the keys of one IMU: those below its name, or all of a file without such names.

    :param unused: receives the names beside those of IMUs, such as anchors and cameras.
    :raises ConfigurationError: for several IMUs of which none is named, for one that is not in the
        file, and for keys of an IMU beside their names.
    """
    imus = _listed_imus(tree) or {
        str(name): content
        for name, content in tree.items()
        if _names_an_imu(str(name)) and isinstance(content, Mapping)
    }
    have = ", ".join(imus) or "one without a name"
    if imu and imu not in imus:
        raise ConfigurationError(f"{path}: has no IMU {short_repr(imu)}; it has {have}")
    if not imus:
        return tree
    if len(imus) > 1 and not imu:
        raise ConfigurationError(
            f"{path}: has several IMUs, name one of {have}: {path}#{next(iter(imus))}"
        )
    neighbours = [str(name) for name in tree if str(name) not in (*imus, "sensors")]
    misplaced = [name for name in neighbours if nearest(name, _KEYS, _ALIKE)]
    if misplaced:
        raise ConfigurationError(
            [f"{path}: {name}: must stand below the IMU's name, {have}" for name in misplaced]
        )
    unused += [f"{name} (not of an IMU)" for name in neighbours]
    unused += [f"{name} (not of an IMU)" for name in _other_sensors(tree)]
    return imus[imu or next(iter(imus))]


def _convert(file: _File, key: str, value: object) -> None:
    """Set the parameter of a key, or note why there is none.

    The keys of kalibr's intrinsics are left out: they are converted together.
    """
    name = key.removeprefix(_IMU)
    if value is None:
        file.problems.append(f"{key}: a value is missing")
    elif key in _UNUSED:
        file.unused.append(f"{key} = {short_repr(value)} ({_UNUSED[key]})")
    elif key in _PARAMETERS:
        file.set(_PARAMETERS[key], value, key)
    elif key in _POSES:
        _add_pose(file, key, value)
    elif key == "time_offset":
        # IccSensors.py takes a reading of stamp t for that of t + time_offset.
        offset = file.array(key, value, ())
        if offset is not None and offset:
            file.set(f"{_IMU}stamp_offset", -float(offset), key)
    elif key == "sensor_type":
        if str(value).lower() != "imu":
            file.problems.append(f"sensor_type = {short_repr(value)}: must be imu")
    elif key in _INTRINSICS:
        return
    elif name in parameters(ImuParameters):
        file.set(f"{_IMU}{name}", value, key)
    elif key in parameters(EnvironmentParameters) or "." in key:
        file.set(key, value, key)
    # Any other one may be a parameter of another node, or of the trajectory.
    elif key == "imu" or not file.unknown(key, (*_KEYS, *parameters(ImuParameters))):
        if isinstance(value, Mapping):
            for path, entry in dotted_values(value, f"{file.path}: {key}", f"{key}.").items():
                file.set(path, entry, path)
        else:
            file.set(key, value, key)


def _add_pose(file: _File, key: str, value: object) -> None:
    """Set the mount of the IMU: T_BS maps the IMU to the body, kalibr's T_i_b the body to it."""
    matrix = file.array(key, value, (4, 4))
    if matrix is None:
        return
    rigid = rigid_motion(matrix)  # without the rounding of the file's digits
    if rigid is None:
        file.problems.append(f"{key}: must be a rigid motion: a rotation, and 0 0 0 1 below")
    elif np.abs(rigid - np.eye(4)).max() > _EXACT:
        pose = inverse_pose(rigid) if key == "T_i_b" else rigid
        file.set(f"{_IMU}lever_arm", pose[:3, 3].tolist(), key)
        file.set(f"{_IMU}mounting", np.ravel(pose[:3, :3]).tolist(), key)


def _add_intrinsics(file: _File, keys: Mapping[str, object]) -> None:
    """Set scale, misalignment, g-sensitivity and size effect from kalibr's or OpenVINS' keys.

    :param keys: content of the file; nothing is set if any key has a problem, which is noted.
    """
    model = keys.get("model", "kalibr")
    if model not in _MODELS:
        hint = suggestion(model, _MODELS)
        file.problems.append(f"model = {short_repr(model)}: {hint}")
    kalibr: dict[str, Array] = {}
    for triad, elements in _TRIADS.items():
        section = keys.get(triad, {})
        if not isinstance(section, Mapping):
            file.problems.append(
                f"{triad} = {short_repr(section)}: must hold {', '.join(elements)}"
            )
            continue
        for name, value in section.items():
            key, shape = f"{triad}.{name}", (3,) if str(name).startswith("r") else (3, 3)
            if name not in elements:
                file.problems.append(f"{key}: unknown key; {suggestion(name, elements)}")
            elif (array := file.array(key, value, shape)) is not None:
                kalibr[key] = array
    openvins: dict[str, Array] = {}
    for key in _OPENVINS:
        if key in keys and (array := file.array(key, keys[key], (3, 3))) is not None:
            openvins[key] = array
    if kalibr and openvins:
        file.problems.append(
            f"{', '.join(kalibr)} are kalibr's, {', '.join(openvins)} OpenVINS': keep one of both"
        )
    if file.problems:
        return
    # Here the reading is ``S x + b``, with the ideal reading x in the IMU's axes.
    eye, zero = np.eye(3), np.zeros((3, 3))
    if openvins:
        tw, ta = (
            _triangular(file, key, openvins.get(key, eye), model == "rpng") for key in ("Tw", "Ta")
        )
        gyro = tw @ openvins.get("R_IMUtoGYRO", eye)
        accel = ta @ openvins.get("R_IMUtoACC", eye)
        force = openvins.get("Tg", zero)
    else:
        rotation = kalibr.get("gyroscopes.C_gyro_i", eye)
        gyro = kalibr.get("gyroscopes.M", eye) @ rotation
        force = kalibr.get("gyroscopes.A", zero) @ rotation
        accel = kalibr.get("accelerometers.M", eye)
    positions = [kalibr.get(f"accelerometers.r{axis}_i", np.zeros(3)) for axis in "xyz"]
    for name, array, perfect in (
        ("gyroscope_scale_misalignment", gyro, eye),
        ("gyroscope_g_sensitivity", force, zero),
        ("accelerometer_scale_misalignment", accel, eye),
        ("accelerometer_positions", np.array(positions), zero),
    ):
        if not np.array_equal(array, perfect):
            file.set(f"{_IMU}{name}", np.ravel(array).tolist(), name)


def _triangular(file: _File, key: str, matrix: Array, upper: bool) -> Array:
    """Return OpenVINS' T_w or T_a (3, 3): the inverse of a triangle of the inverse."""
    if abs(np.linalg.det(matrix)) < _EXACT:
        file.problems.append(f"{key}: must be invertible")
        return matrix
    inverse = np.linalg.inv(matrix)
    triangle = np.triu(inverse) if upper else np.tril(inverse)
    if np.abs(inverse - triangle).max() <= _EXACT:
        return matrix
    used, unused = ("upper", "lower") if upper else ("lower", "upper")
    if abs(np.linalg.det(triangle)) < _EXACT:
        file.problems.append(f"{key}: the {used} triangle of its inverse must be invertible")
        return matrix
    file.unused.append(
        f"the {unused} triangle of the inverse of {key} (OpenVINS keeps the {used} one)"
    )
    return np.asarray(np.linalg.inv(triangle))
