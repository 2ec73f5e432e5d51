# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Camera files of other tools: kalibr, OpenVINS, EuRoC, Kimera-VIO, Basalt, VINS, ORB_SLAM3, ROS.

Each key becomes a parameter ``camera.*``, or a remark names it. The body is the IMU: the mount is
T_ic, which maps points of the camera into the IMU's frame.

- kalibr, camchain.yaml (kalibr_common/ConfigReader.py): ``T_cam_imu`` is T_ci, ``T_cn_cnm1`` maps
  the camera before into this one; OpenVINS, kalibr_imucam_chain.yaml: ``T_imu_cam`` is T_ic. In
  both ``t_imu = t_cam + timeshift_cam_imu``, as ``camera.time_offset``.
- EuRoC, sensor.yaml, and Kimera-VIO, LeftCameraParams.yaml: ``T_BS`` is T_ic.
- maplab, ncamera.yaml: ``T_B_C`` is T_ic, ``T_C_B`` its inverse.
- Basalt, calibration.json: ``T_imu_cam``; ``ucm`` is Mei's sphere with ``xi = alpha/(1 - alpha)``.
- VINS (camodocal): ``extrinsicRotation`` and ``body_T_cam0`` are T_ic, ``t_imu = t_cam + td``;
  KANNALA_BRANDT's k2 to k5 are the equidistant k1 to k4.
- ORB_SLAM3 (Settings.cc): ``IMU.T_b_c1`` is T_ic of the first camera, ``Stereo.T_c1_c2`` maps the
  second one into the first one; ``Tbc`` is that of the older form.
- ROS, camera_info of camera_calibration: a lens without a mount.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, InputError, Remark, warn
from imu_sim_ros.core.names import nearest, short_repr, suggestion
from imu_sim_ros.core.rotation import inverse_pose, rigid_motion
from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters import files
from imu_sim_ros.recordings.cameras import ROS_DISTORTIONS, CameraInfo
from imu_sim_ros.recordings.findings.cameras import distortion_problem

_CAMERA: Final = "camera."
_MODELS: Final = {
    "pinhole": "pinhole",
    "PINHOLE": "pinhole",
    "PinHole": "pinhole",
    "omni": "unified",
    "unified": "unified",
    "unified-projection": "unified",
    "MEI": "unified",
    "ds": "double_sphere",
    "double_sphere": "double_sphere",
    "ucm": "ucm",
    "eucm": "eucm",
    "KANNALA_BRANDT": "kannala_brandt",
    "KannalaBrandt8": "kannala_brandt",
    "kb4": "kannala_brandt",
    "pinhole-radtan8": "radtan8",
    "Rectified": "pinhole",
}
"""Projection models by the names of the tools."""
_NUMBERS: Final = {"pinhole": 4, "unified": 5, "double_sphere": 6, "eucm": 6}
"""Number of intrinsics of each of kalibr's projection models."""
_DISTORTIONS: Final = {
    **dict.fromkeys(("radtan", "radial-tangential", "plumb_bob"), "radtan"),
    **dict.fromkeys(("radtan8", "radial-tangential8", "rational_polynomial"), "radtan8"),
    **dict.fromkeys(("equidistant", "equi", "fisheye"), "equidistant"),
    "none": "none",
}
"""Distortion models by the names of the tools."""
_TOLERANCE: Final = 1e-3
"""Largest difference between two transforms that state the same mount."""
_VIGNETTE_ERROR: Final = 0.01
"""Largest difference of a vignette from a quadratic one that is not named."""
_LARGEST: Final = 1 << 20
"""Largest number of pixels along a side."""
_FORWARD: Final = 0.5
"""Smallest component along x of the view of a camera that looks forward."""

_CHAIN: Final = {
    **dict.fromkeys(("camera_model", "intrinsics", "distortion_model", "distortion_coeffs"), ""),
    **dict.fromkeys(("resolution", "T_cam_imu", "T_imu_cam", "T_cn_cnm1"), ""),
    **dict.fromkeys(("timeshift_cam_imu", "line_delay"), ""),
    "rostopic": "the topic of the calibrated recording, not of the output",
    "cam_overlaps": "landmarks decide which cameras share a view",
}
"""Keys of a camera in a chain; those without an effect have a reason."""
_EUROC: Final = {
    **dict.fromkeys(("camera_model", "intrinsics", "distortion_model"), ""),
    **dict.fromkeys(
        ("distortion_coefficients", "resolution", "rate_hz", "T_BS", "xi", "alpha"), ""
    ),
    **dict.fromkeys(("sensor_type", "comment", "camera_id"), "a description"),
}
_CAMERA_INFO: Final = {
    **dict.fromkeys(("image_width", "image_height", "camera_matrix", "distortion_model"), ""),
    "distortion_coefficients": "",
    "camera_name": "a description",
    "rectification_matrix": "images are not rectified",
    "projection_matrix": "images are not rectified",
}
_NCAMERA: Final = {
    **dict.fromkeys(("image_width", "image_height", "type", "intrinsics", "distortion"), ""),
    **dict.fromkeys(("T_B_C", "T_C_B", "line-delay-nanoseconds"), ""),
    **dict.fromkeys(("label", "id", "topic", "description", "hardware_id"), "a description"),
}
_VINS: Final = {
    **dict.fromkeys(("model_type", "image_width", "image_height", "projection_parameters"), ""),
    **dict.fromkeys(("distortion_parameters", "mirror_parameters", "td", "rolling_shutter"), ""),
    **dict.fromkeys(("extrinsicRotation", "extrinsicTranslation", "rolling_shutter_tr"), ""),
    "body_T_cam": "",
    "camera_name": "a description",
}
_BASALT: Final = {
    **dict.fromkeys(("T_imu_cam", "intrinsics", "resolution", "cam_time_offset_ns"), ""),
    "vignette": "",
    "comment": "a description",
}
_ORB: Final = {
    **dict.fromkeys(("Camera.type", "Camera.width", "Camera.height", "Camera.fps"), ""),
    **dict.fromkeys(("IMU.T_b_c1", "Tbc", "Stereo.T_c1_c2"), ""),
}
_ORB_LENS: Final = re.compile(r"Camera[12]?\.(fx|fy|cx|cy|k[1-6]|p[12])\Z")


class _Camera:
    """The keys of one camera, on their way to parameters."""

    def __init__(self, path: Path, name: str, tree: Mapping[str, object]) -> None:
        self.tree = tree
        self.values: dict[str, object] = {}
        self.problems: list[str] = []
        self.unused: list[str] = []
        self.t_ic: Array | None = None
        self._prefix = f"{path}: {name}: " if name else f"{path}: "

    def refuse(self, key: str, value: object, allowed: str) -> None:
        """Note a value that cannot be used."""
        state = "missing" if value is None else short_repr(value)
        self.problems.append(f"{self._prefix}{key} = {state}: {allowed}")

    def refuse_name(self, key: str, name: str) -> None:
        """Note an unknown key that resembles a known one."""
        self.problems.append(f"{self._prefix}{key}: unknown key; did you mean {name}?")

    def check_keys(self, keys: Mapping[str, str], extra: str = "") -> None:
        """Name the keys without an effect, and refuse those that resemble a key with one.

        :param keys: known keys, with the reason of those without an effect.
        :param extra: reason for keys of other names; empty: unknown.
        """
        for key in self.tree:
            if key not in keys and (name := nearest(key, keys, 0.8)) and name not in self.tree:
                self.refuse_name(key, name)
            elif key not in keys:
                self.unused.append(key if extra else f"{key} (unknown)")
            elif reason := keys[key]:
                self.unused.append(f"{key} ({reason})")

    def numbers(self, key: str, value: object, counts: Sequence[int]) -> list[float]:
        """Return finite numbers of a list or of ``data``; NaN, with a problem, for anything else.

        :param counts: allowed numbers of entries; empty: any.
        """
        content = value.get("data") if isinstance(value, Mapping) else value
        try:
            array = np.asarray(content, dtype=np.float64).ravel()
        except (TypeError, ValueError):
            array = np.full(1, np.nan)
        if (
            content is not None
            and np.isfinite(array).all()
            and (not counts or len(array) in counts)
        ):
            return [float(entry) for entry in array]
        count = " or ".join(map(str, counts))
        self.refuse(key, content, f"must be {count} finite numbers".replace("  ", " "))
        return [np.nan] * (counts[0] if counts else 0)

    def number(self, key: str, value: object) -> float:
        """Return a finite number; NaN, with a problem, for anything else."""
        return self.numbers(key, value, (1,))[0]

    def entries(self, key: str, names: Sequence[str]) -> list[float]:
        """Return the numbers of a mapping by name, such as VINS' ``projection_parameters``."""
        section = self.tree.get(key)
        section = section if isinstance(section, Mapping) else {}
        for name in section:
            if name not in names:
                self.problems.append(f"{self._prefix}{key}.{name}: {suggestion(name, names)}")
        return [self.number(f"{key}.{name}", section.get(name)) for name in names]

    def matrix(self, key: str, value: object) -> Array | None:
        """Return a rigid motion (4, 4) without the rounding of the file's digits."""
        numbers = self.numbers(key, value, (16, 12))
        if np.isnan(numbers).any():
            return None
        numbers += [0.0, 0.0, 0.0, 1.0] if len(numbers) == 12 else []
        pose = rigid_motion(np.reshape(numbers, (4, 4)))
        if pose is None:
            self.problems.append(
                f"{self._prefix}{key}: must be a rigid motion: a rotation, and 0 0 0 1 below"
            )
        return pose

    def set(self, name: str, value: object) -> None:
        """Set a parameter of the camera."""
        self.values[f"{_CAMERA}{name}"] = value

    def set_mount(self, t_ic: Array | None) -> None:
        """Set the pose of the camera on the body.

        :param t_ic: (4, 4); None: not given.
        """
        if t_ic is not None:
            self.t_ic = t_ic
            self.set("lever_arm", t_ic[:3, 3].tolist())
            self.set("mounting", np.ravel(t_ic[:3, :3]).tolist())

    def set_size(self, key: str, sides: Iterable[object]) -> None:
        """Set width and height [px], which must be whole numbers."""
        for name, side in zip(("width", "height"), sides, strict=True):
            if isinstance(side, float) and np.isnan(side):
                continue  # refused where it was read
            number = self.number(key, side)
            if np.isnan(number):
                continue
            if number == int(number) and 1 <= number <= _LARGEST:
                self.set(name, int(number))
            else:
                self.refuse(key, side, f"must be a whole number of pixels from 1 to {_LARGEST}")

    def model(self, key: str, value: object, names: Sequence[str]) -> str:
        """Return the projection model; a pinhole, with a problem, for an unknown one.

        :param names: allowed names, as the tool calls its models.
        """
        if value in names:
            return _MODELS[str(value)]
        self.refuse(key, value, f"this projection is none of the models here: {', '.join(names)}")
        return "pinhole"

    def set_lens(self, key: str, model: str, shape: Sequence[float], focal: list[float]) -> None:
        """Set projection and intrinsics.

        :param key: key of the intrinsics, for messages.
        :param model: pinhole, unified, double_sphere; ucm or eucm: converted to Mei's sphere.
        :param shape: the model's numbers beside the focal lengths: xi; xi, alpha; alpha, beta.
        :param focal: fx, fy, cx, cy [px].
        """
        if model in ("ucm", "eucm"):
            alpha, beta = (*shape, 1.0)[:2]
            if beta != 1.0 or not 0.0 <= alpha < 1.0:
                self.refuse(
                    key,
                    [*shape],
                    "the extended unified model is one here with beta 1 alone, "
                    "and alpha from 0 to below 1",
                )
                return
            xi = alpha / (1.0 - alpha)
            focal = [focal[0] * (1.0 + xi), focal[1] * (1.0 + xi), *focal[2:]]
            model, shape = "unified", (xi,)
        self.set("model", model)
        self.set("intrinsics", focal)
        for name, number in zip(("xi", "alpha"), shape, strict=False):
            self.set(name, number)

    def set_distortion(self, key: str, model: object, coefficients: list[float]) -> None:
        """Set the distortion; an unknown model is refused by its name.

        :param key: key of the coefficients, for messages.
        :param model: name, as the tool calls the model.
        """
        kind = _DISTORTIONS.get(str(model))
        if kind is None:
            names = ", ".join(sorted(_DISTORTIONS))
            self.problems.append(
                f"{self._prefix}distortion model {short_repr(model)}: not simulated; there are "
                f"{names}"
            )
            return
        if kind == "radtan8":
            if any(coefficients[5:]):
                self.refuse(
                    key,
                    coefficients,
                    "k4, k5, k6 of the rational model are not simulated: must be 0",
                )
                return
            kind, coefficients = "radtan", coefficients[:5]
        if not any(coefficients) and kind != "equidistant":
            kind, coefficients = "none", []
        elif kind == "radtan" and len(coefficients) == 5 and coefficients[4] == 0.0:
            coefficients = coefficients[:4]
        counts = {"none": (0,), "radtan": (4, 5), "equidistant": (4,)}[kind]
        if len(coefficients) not in counts:
            allowed = " or ".join(map(str, counts))
            self.refuse(key, coefficients, f"must be {allowed} numbers for {model}")
            return
        self.set("distortion_model", kind)
        self.set("distortion", coefficients)


class _RecordedCamera(_Camera):
    """The keys of a camera that has recorded images, on their way to its description."""

    def __init__(self, path: Path, name: str, tree: Mapping[str, object]) -> None:
        super().__init__(path, name, tree)
        self._distortion: tuple[str, str, list[float]] = ("", "none", [])

    def set_distortion(self, key: str, model: object, coefficients: list[float]) -> None:
        """Note the distortion; models that are not simulated are allowed."""
        self._distortion = key, str(model), coefficients

    def info(self) -> CameraInfo | None:
        """Return the model in the terms of sensor_msgs/CameraInfo; None, if there are problems."""
        values = {name.removeprefix(_CAMERA): value for name, value in self.values.items()}
        if self.problems:
            return None
        intrinsics = np.asarray(values["intrinsics"], dtype=np.float64).tolist()
        fx, fy, *_ = intrinsics
        if not (fx > 0.0 and fy > 0.0):
            self.refuse("intrinsics", self.tree["intrinsics"], "fx and fy must be above 0 px")
        key, stated, d = self._distortion
        kind = ROS_DISTORTIONS.get(_DISTORTIONS.get(stated, ""), stated)
        model = str(values["model"])
        if model != "pinhole":
            shape = [float(str(values[name])) for name in ("xi", "alpha") if name in values]
            kind, d = model, [*shape, *(d if stated != "none" else [])]
        size = int(str(values["height"])), int(str(values["width"]))
        info = CameraInfo.of_lens(size, intrinsics, kind, d)
        if problem := distortion_problem(info):
            self.refuse(key, self.tree.get(key), problem)
        return info


def _chain_camera(camera: _Camera, previous: Array | None) -> None:
    """Read a camera in a chain of kalibr or OpenVINS.

    :param previous: T_ic (4, 4) of the camera before in the chain; None: not known.
    """
    tree = camera.tree
    camera.check_keys(_CHAIN)
    model = camera.model(
        "camera_model", tree.get("camera_model"), ("pinhole", "omni", "ds", "eucm")
    )
    numbers = camera.numbers("intrinsics", tree.get("intrinsics"), (_NUMBERS[model],))
    camera.set_lens("intrinsics", model, numbers[:-4], numbers[-4:])
    coefficients = tree.get("distortion_coeffs") or []
    camera.set_distortion(
        "distortion_coeffs",
        tree.get("distortion_model", "none"),
        camera.numbers("distortion_coeffs", coefficients, ()),
    )
    camera.set_size("resolution", camera.numbers("resolution", tree.get("resolution"), (2,)))
    camera.set_mount(_chain_mount(camera, previous))
    if "timeshift_cam_imu" in tree:
        shift = camera.number("timeshift_cam_imu", tree["timeshift_cam_imu"])
        camera.set("time_offset", shift)
    if "line_delay" in tree:
        camera.set("row_time", camera.number("line_delay", tree["line_delay"]))


def _chain_mount(camera: _Camera, previous: Array | None) -> Array | None:
    """Return T_ic from the keys of a chain, which must not contradict each other."""
    poses: dict[str, Array] = {}
    for key in ("T_cam_imu", "T_imu_cam", "T_cn_cnm1"):
        matrix = camera.matrix(key, camera.tree[key]) if key in camera.tree else None
        if matrix is None:
            continue
        if key == "T_cn_cnm1":
            if previous is not None:
                poses[key] = previous @ inverse_pose(matrix)
            continue
        poses[key] = matrix if key == "T_imu_cam" else inverse_pose(matrix)
    names = list(poses)
    for name in names[1:]:
        if np.abs(poses[name] - poses[names[0]]).max() > _TOLERANCE:
            camera.refuse(name, camera.tree[name], f"contradicts {names[0]}: keep one of both")
    return poses[names[0]] if names else None


def _euroc_camera(camera: _Camera) -> None:
    """Read EuRoC's sensor.yaml, or Kimera-VIO's parameters of a camera."""
    tree = camera.tree
    camera.check_keys(_EUROC)
    names = ("pinhole", "unified", "double_sphere")
    model = camera.model("camera_model", tree.get("camera_model"), names)
    shape = {"unified": ("xi",), "double_sphere": ("xi", "alpha")}.get(model, ())
    numbers = [camera.number(name, tree.get(name)) for name in shape]
    focal = camera.numbers("intrinsics", tree.get("intrinsics"), (4,))
    camera.set_lens("intrinsics", model, numbers, focal)
    coefficients = tree.get("distortion_coefficients") or []
    camera.set_distortion(
        "distortion_coefficients",
        tree.get("distortion_model", "none"),
        camera.numbers("distortion_coefficients", coefficients, ()),
    )
    camera.set_size("resolution", camera.numbers("resolution", tree.get("resolution"), (2,)))
    camera.set_mount(camera.matrix("T_BS", tree["T_BS"]) if "T_BS" in tree else None)
    if "rate_hz" in tree:
        camera.set("rate", camera.number("rate_hz", tree["rate_hz"]))


def _info_camera(camera: _Camera) -> None:
    """Read a camera_info file of ROS' camera_calibration."""
    tree = camera.tree
    camera.check_keys(_CAMERA_INFO)
    k = camera.numbers("camera_matrix", tree.get("camera_matrix"), (9,))
    camera.set_lens("camera_matrix", "pinhole", (), [k[0], k[4], k[2], k[5]])
    if k[1]:
        camera.refuse("camera_matrix", k, "a skew is not simulated: must be 0")
    coefficients = tree.get("distortion_coefficients") or []
    camera.set_distortion(
        "distortion_coefficients",
        tree.get("distortion_model", "none"),
        camera.numbers("distortion_coefficients", coefficients, ()),
    )
    camera.set_size(
        "image_width, image_height", (tree.get("image_width"), tree.get("image_height"))
    )


def _ncamera(camera: _Camera) -> None:
    """Read a camera of maplab's ncamera.yaml."""
    tree = camera.tree
    camera.check_keys(_NCAMERA)
    model = camera.model("type", tree.get("type"), ("pinhole", "unified-projection"))
    numbers = camera.numbers("intrinsics", tree.get("intrinsics"), (_NUMBERS[model],))
    camera.set_lens("intrinsics", model, numbers[:-4], numbers[-4:])
    section = tree.get("distortion")
    section = section if isinstance(section, Mapping) else {"type": "none"}
    kind = section.get("type", "none")
    # aslam's "fisheye" is the field-of-view model.
    coefficients = camera.numbers("distortion.parameters", section.get("parameters") or [], ())
    kind = "fov" if kind == "fisheye" else kind
    camera.set_distortion("distortion.parameters", kind, coefficients)
    camera.set_size(
        "image_width, image_height", (tree.get("image_width"), tree.get("image_height"))
    )
    if "T_B_C" in tree:
        camera.set_mount(camera.matrix("T_B_C", tree["T_B_C"]))
    elif "T_C_B" in tree:
        t_ci = camera.matrix("T_C_B", tree["T_C_B"])
        camera.set_mount(None if t_ci is None else inverse_pose(t_ci))
    if "line-delay-nanoseconds" in tree:
        delay = camera.number("line-delay-nanoseconds", tree["line-delay-nanoseconds"])
        camera.set("row_time", delay * 1e-9)


def _basalt_camera(camera: _Camera) -> None:
    """Read a camera of Basalt's calibration: lens, resolution and mount at its number."""
    tree = camera.tree
    camera.check_keys(_BASALT, "of the IMU")
    lens = tree["intrinsics"] if isinstance(tree["intrinsics"], Mapping) else {}
    section = lens.get("intrinsics")
    numbers = section if isinstance(section, Mapping) else {}

    def entries(*names: str) -> list[float]:
        return [camera.number(f"intrinsics.{name}", numbers.get(name)) for name in names]

    allowed = ("pinhole", "pinhole-radtan8", "kb4", "ucm", "eucm", "ds")
    kind = camera.model("camera_type", lens.get("camera_type"), allowed)
    shape = {"double_sphere": ("xi", "alpha"), "ucm": ("alpha",), "eucm": ("alpha", "beta")}
    model = "pinhole" if kind in ("radtan8", "kannala_brandt") else kind
    camera.set_lens(
        "intrinsics", model, entries(*shape.get(kind, ())), entries("fx", "fy", "cx", "cy")
    )
    if kind == "radtan8":
        rational = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
        camera.set_distortion("intrinsics", "radtan8", entries(*rational))
    elif kind == "kannala_brandt":
        camera.set_distortion("intrinsics", "equidistant", entries("k1", "k2", "k3", "k4"))
    else:
        camera.set_distortion("intrinsics", "none", [])
    camera.set_size("resolution", camera.numbers("resolution", tree.get("resolution"), (2,)))
    pose = tree.get("T_imu_cam")
    if isinstance(pose, Mapping):
        names = ("px", "py", "pz", "qw", "qx", "qy", "qz")
        place = np.array([camera.number(f"T_imu_cam.{name}", pose.get(name)) for name in names])
        norm = float(np.linalg.norm(place[3:]))
        if abs(norm - 1.0) > _TOLERANCE:
            camera.refuse("T_imu_cam", dict(pose), "must hold a unit quaternion")
        elif np.isfinite(place).all():
            matrix = rotation.to_matrix(place[3:] / norm)
            camera.set_mount(rotation.pose_matrix(matrix, place[:3]))
    offset = camera.number("cam_time_offset_ns", tree.get("cam_time_offset_ns", 0))
    camera.set("time_offset", offset * 1e-9)
    if tree.get("vignette"):
        _set_vignetting(camera, tree["vignette"])


def _set_vignetting(camera: _Camera, spline: object) -> None:
    """Set the vignetting from Basalt's spline over the distance from the principal point.

    A remark names the largest difference from ``1 - v (r / corner)^2`` if it exceeds 1 %.
    """
    parts = spline if isinstance(spline, Mapping) else {}
    interval = camera.number("vignette.value1", parts.get("value1")) * 1e-9
    knots = np.array(camera.numbers("vignette.value2", parts.get("value2"), ()))
    size = [camera.values.get(f"{_CAMERA}{name}") for name in ("width", "height")]
    focal = camera.values.get(f"{_CAMERA}intrinsics")
    if camera.problems or not isinstance(focal, list):
        return
    cx, cy = focal[2:]
    width, height = (float(str(side)) for side in size)
    corner = float(np.hypot(max(cx, width - 1.0 - cx), max(cy, height - 1.0 - cy)))
    # A uniform cubic B-spline at its knots.
    shares = (knots[:-2] + 4.0 * knots[1:-1] + knots[2:]) / 6.0
    radii = interval * np.arange(len(shares))
    count = int((radii <= corner).sum())
    if count < 3 or not interval > 0.0:
        camera.refuse("vignette", parts, "must be a spline from the centre to the corners")
        return
    squares, loss = (radii[:count] / corner) ** 2, 1.0 - shares[:count]
    strength = float(np.clip(squares @ loss / (squares @ squares), 0.0, 1.0))
    camera.set("vignetting", round(strength, 9))
    error = float(np.abs(loss - strength * squares).max())
    if error > _VIGNETTE_ERROR:
        camera.unused.append(f"vignette beyond vignetting {strength:.2g} (up to {error:.2g} apart)")


def _vins_camera(camera: _Camera) -> None:
    """Read a camera of camodocal, with the extrinsics and the time shift of VINS."""
    tree = camera.tree
    camera.check_keys(_VINS, "estimator")
    names = ("PINHOLE", "KANNALA_BRANDT", "MEI")
    model = camera.model("model_type", tree.get("model_type"), names)
    key, distortion = "projection_parameters", "distortion_parameters"
    if model == "kannala_brandt":
        numbers = camera.entries(key, ("k2", "k3", "k4", "k5", "mu", "mv", "u0", "v0"))
        camera.set_lens(key, "pinhole", (), numbers[4:])
        camera.set_distortion(key, "equidistant", numbers[:4])
    else:
        shape = camera.entries("mirror_parameters", ("xi",)) if model == "unified" else []
        focal = ("gamma1", "gamma2", "u0", "v0") if model == "unified" else ("fx", "fy", "cx", "cy")
        camera.set_lens(key, model, shape, camera.entries(key, focal))
        coefficients = camera.entries(distortion, ("k1", "k2", "p1", "p2"))
        camera.set_distortion(distortion, "radtan", coefficients)
    camera.set_size(
        "image_width, image_height", (tree.get("image_width"), tree.get("image_height"))
    )
    if "body_T_cam" in tree:
        camera.set_mount(camera.matrix("body_T_cam", tree["body_T_cam"]))
    elif "extrinsicRotation" in tree:
        turn = camera.numbers("extrinsicRotation", tree["extrinsicRotation"], (9,))
        place = camera.numbers("extrinsicTranslation", tree.get("extrinsicTranslation"), (3,))
        matrix = np.column_stack([np.reshape(turn, (3, 3)), place])
        if np.isfinite(matrix).all():
            camera.set_mount(camera.matrix("extrinsicRotation", matrix.ravel()))
    if "td" in tree:
        camera.set("time_offset", camera.number("td", tree["td"]))
    if tree.get("rolling_shutter"):
        time = camera.number("rolling_shutter_tr", tree.get("rolling_shutter_tr"))
        camera.set("row_time", time / camera.number("image_height", tree.get("image_height")))


def _orb_camera(camera: _Camera, prefix: str) -> None:
    """Read a camera of ORB_SLAM3's settings.

    :param prefix: ``Camera1.`` or ``Camera2.``; ``Camera.`` in the older form.
    """
    tree = camera.tree
    unused = [key for key in tree if key not in _ORB and not _ORB_LENS.match(key)]
    for key in list(unused):
        if (name := nearest(key, _ORB, 0.85)) and name not in tree:
            camera.refuse_name(key, name)
            unused.remove(key)
    camera.unused += unused
    model = camera.model(
        "Camera.type",
        tree.get("Camera.type", "PinHole"),
        ("PinHole", "KannalaBrandt8", "Rectified"),
    )
    focal = [
        camera.number(f"{prefix}{name}", tree.get(f"{prefix}{name}"))
        for name in ("fx", "fy", "cx", "cy")
    ]
    camera.set_lens(f"{prefix}fx", "pinhole", (), focal)
    fisheye = model == "kannala_brandt"
    names = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")
    coefficients = [
        camera.number(f"{prefix}{name}", tree.get(f"{prefix}{name}", 0.0)) for name in names
    ]
    camera.set_distortion(f"{prefix}k1", "equidistant" if fisheye else "radtan", coefficients)
    camera.set_size(
        "Camera.width, Camera.height", (tree.get("Camera.width"), tree.get("Camera.height"))
    )
    if "Camera.fps" in tree:
        camera.set("rate", camera.number("Camera.fps", tree["Camera.fps"]))
    mount = next((key for key in ("IMU.T_b_c1", "Tbc") if key in tree), None)
    pose = camera.matrix(mount, tree[mount]) if mount else None
    if prefix == "Camera2." and pose is not None:
        key = "Stereo.T_c1_c2"
        second = camera.matrix(key, tree[key]) if key in tree else None
        pose = None if second is None else pose @ second
    camera.set_mount(pose)


_Reader = Callable[[_Camera], None]
"""Sets the parameters of a camera from its keys."""


def _cameras(
    tree: Mapping[str, object], path: Path
) -> dict[str, tuple[Mapping[str, object], _Reader]]:
    """Return keys and reader of each camera in a file of another tool, by name; empty: none is."""
    chain = {name: keys for name, keys in tree.items() if files.is_of_chain(keys)}
    if chain:
        cameras: dict[str, tuple[Mapping[str, object], _Reader]] = {}
        pose = None
        for name, keys in chain.items():
            cameras[name] = (keys, partial(_chain_camera, previous=pose))
            pose = _chain_mount(_Camera(path, name, keys), pose)
        return cameras
    for key, reader in (
        ("camera_model", _euroc_camera),
        ("camera_matrix", _info_camera),
        ("model_type", _vins_camera),
    ):
        if key in tree:
            return {"": (tree, reader)}
    numbers = [k for k in (0, 1) if f"cam{k}_calib" in tree]
    if numbers:
        return {f"cam{k}": (_fusion_keys(tree, path, k), _vins_camera) for k in numbers}
    entries = tree.get("cameras")
    if isinstance(entries, list) and entries and all(isinstance(e, Mapping) for e in entries):
        return {f"cam{k}": (_ncamera_keys(entry), _ncamera) for k, entry in enumerate(entries)}
    content = tree.get("value0")
    if isinstance(content, Mapping) and isinstance(content.get("intrinsics"), list):
        count = len(content["intrinsics"])
        return {f"cam{k}": (_basalt_keys(content, k), _basalt_camera) for k in range(count)}
    names = [f"Camera{k}" for k in ("", "1", "2") if f"Camera{k}.fx" in tree]
    return {name: (tree, partial(_orb_camera, prefix=f"{name}.")) for name in names}


def _fusion_keys(tree: Mapping[str, object], path: Path, number: int) -> dict[str, object]:
    """Return the keys of a camera of VINS-Fusion, with those of its file next to the settings."""
    keys = {
        key: value
        for key, value in tree.items()
        if not re.fullmatch(r"body_T_cam\d|cam\d_calib|image\d_topic", key)
    }
    if f"body_T_cam{number}" in tree:
        keys["body_T_cam"] = tree[f"body_T_cam{number}"]
    return keys | _tree(path.parent / str(tree[f"cam{number}_calib"]))


def _ncamera_keys(entry: Mapping[str, object]) -> dict[str, object]:
    """Return the keys of a camera in maplab's list, those of its mount among them."""
    camera = entry.get("camera")
    mount = {key: value for key, value in entry.items() if key != "camera"}
    return {**camera, **mount} if isinstance(camera, Mapping) else mount


def _basalt_keys(content: Mapping[str, object], number: int) -> dict[str, object]:
    """Return Basalt's keys with the entries of one camera in place of the lists of all."""
    keys = dict(content)
    for key in ("T_imu_cam", "intrinsics", "resolution", "vignette"):
        values = content.get(key)
        if isinstance(values, list) and number < len(values):
            keys[key] = values[number]
        else:
            keys.pop(key, None)
    return keys


def _tree(path: Path) -> dict[str, object]:
    """Return the content of a camera's file."""
    tree = files.read_tree(path, "a camera's file")
    return {str(key): value for key, value in tree.items()}


def description(path: Path, name: str = "") -> tuple[CameraInfo | None, Array | None]:
    """Return model and pose T_bc (4, 4) of a camera that has recorded images; None if unknown.

    :param path: EuRoC's sensor.yaml, or a chain of kalibr, whose body is the IMU.
    :param name: name of the camera in a chain; empty: EuRoC's.
    :raises InputError: with a line for each value that cannot be used.
    """
    try:
        tree = _tree(path)
        cameras = _cameras(tree, path) if name else {"": (tree, _euroc_camera)}
    except ConfigurationError as error:
        raise InputError(error.problems) from None
    keys, reader = cameras.get(name, ({}, _euroc_camera))
    camera, info = _RecordedCamera(path, name, keys), None
    if "intrinsics" in keys:
        reader(camera)
        info = camera.info()
    elif "T_BS" in keys:
        camera.set_mount(camera.matrix("T_BS", keys["T_BS"]))
    if camera.problems:
        raise InputError(camera.problems)
    return info, camera.t_ic


def load(name_or_file: str) -> dict[str, object]:
    """Return the parameters ``camera.*`` of a preset, a parameter file, or another tool's file.

    Keys without an effect and what a file leaves open are remarks.

    :param name_or_file: a name in config/cameras or a file; ``FILE#cam1`` is one of several.
    :raises ConfigurationError: with a line for each key and value that cannot be used, for several
        cameras of which none is named, and for one that is not in the file.
    """
    file, name = files.split_sensor_name(name_or_file)
    path = files.find("cameras", str(file))
    tree = _tree(path)
    cameras = {} if files.has_sections(tree) else _cameras(tree, path)
    if not cameras:
        return files.parameters_of(tree, path, "simulator")
    if len(cameras) > 1 and not name:
        raise ConfigurationError(
            f"{path}: has several cameras, name one of {', '.join(cameras)}: "
            f"{path}#{next(iter(cameras))}"
        )
    if name and name not in cameras:
        have = ", ".join(filter(None, cameras)) or "one without a name"
        raise ConfigurationError(f"{path}: has no camera {short_repr(name)}; it has {have}")
    name = name or next(iter(cameras))
    keys, reader = cameras[name]
    camera = _Camera(path, name, keys)
    reader(camera)
    if camera.problems:
        raise ConfigurationError(camera.problems)
    if camera.unused:
        warn(f"{path}: not used: {'; '.join(camera.unused)}", Remark)
    if camera.t_ic is None:
        line = "has no mount of the camera: it is that of camera.lever_arm and camera.mounting"
        warn(f"{path}: {line}", Remark)
    elif camera.t_ic[0, 2] < _FORWARD:
        view = ", ".join(f"{component:.2f}" for component in camera.t_ic[:3, 2])
        line = f"the body is the IMU, in which the camera looks along ({view})"
        warn(f"{path}: {line}; camera.rig_mounting turns it where x is forward", Remark)
    return camera.values
