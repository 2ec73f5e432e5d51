# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Camera models: round trips over the whole image, derivatives, and other people's formulas."""

import cv2
import numpy as np
import pytest

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import build
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.parameters import CameraModelParameters, fold
from imu_sim_ros.sensors.camera.rig_parameters import load_rig

RADTAN5 = {"distortion_model": "radtan", "distortion": (-0.3, 0.12, 1e-3, -2e-3, -0.02)}
MODELS = {
    "pinhole": {"width": 640, "height": 480},
    "radtan5": {"width": 640, "height": 480, **RADTAN5},
    "unified": {"model": "unified", "xi": 0.9, "intrinsics": (500.0, 505.0, 330.0, 240.0)},
    "unified_radtan": {
        "model": "unified",
        "xi": 1.3,
        "intrinsics": (700.0, 705.0, 330.0, 240.0),
        "distortion_model": "radtan",
        "distortion": (-0.1, 0.02, 1e-3, -1e-3),
    },
    "double_sphere": {
        "model": "double_sphere",
        "xi": -0.2,
        "alpha": 0.6,
        "intrinsics": (150.0, 151.0, 330.0, 240.0),
    },
}


def models():
    for name in files.names("cameras"):
        yield name, load_rig({"cameras": ["a"], "camera.preset": name}).camera("a")
    for name, values in MODELS.items():
        yield name, build(CameraModelParameters, values)


ALL = dict(models())
PINHOLES = [name for name, p in ALL.items() if p.model == "pinhole"]
PLAIN_SPHERES = ["unified", "double_sphere"]


@pytest.fixture(params=list(ALL))
def model(request):
    return CameraModel(ALL[request.param])


def all_pixels(model):
    u = np.append(np.arange(-0.5, model.width - 1.0), model.width - 0.5)
    v = np.append(np.arange(-0.5, model.height - 1.0), model.height - 0.5)
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)


def directions(model, count=500):
    pixels = np.random.default_rng(1).random((count, 2)) * (model.width, model.height) - 0.5
    rays = model.unproject(pixels)
    depth = np.random.default_rng(2).uniform(0.5, 20.0, (count, 1))
    return rays.direction[rays.valid] * depth[rays.valid]


def test_every_pixel_of_the_image_comes_back(model):
    pixels = all_pixels(model)
    rays = model.unproject(pixels)
    again = model.project(rays.direction * 7.0)
    if model.parameters.model == "double_sphere":
        assert rays.valid.mean() > 0.9  # the corners lie outside the model's disk
    else:
        assert rays.valid.all()
    in_domain = rays.valid & again.valid
    assert in_domain.sum() >= rays.valid.sum() - 100  # rounding on the very edge of the disk
    assert np.abs(again.uv - pixels)[in_domain].max() < 1e-9
    np.testing.assert_allclose(np.linalg.norm(rays.direction, axis=1), 1.0, rtol=0, atol=1e-14)


def test_the_derivative_by_the_point_is_the_finite_difference(model):
    points, h = directions(model), 1e-6
    numeric = np.stack(
        [
            (model.project(points + h * e).uv - model.project(points - h * e).uv) / (2.0 * h)
            for e in np.eye(3)
        ],
        axis=2,
    )
    scale = np.linalg.norm(points, axis=1)[:, None, None]
    np.testing.assert_allclose(model.by_point(points) * scale, numeric * scale, rtol=0, atol=2e-5)


def test_the_derivative_by_the_parameters_is_the_finite_difference(model):
    p, points, h = model.parameters, directions(model), 1e-6
    shape = {"pinhole": (), "unified": ("xi",), "double_sphere": ("xi", "alpha")}[p.model]
    columns = []

    def moved(name, value):
        values = {f: getattr(p, f) for f in CameraModelParameters.__dataclass_fields__}
        return CameraModel(CameraModelParameters(**{**values, name: value})).project(points).uv

    for name in ("intrinsics", *shape, "distortion"):
        value = getattr(p, name)
        if isinstance(value, float):
            columns.append((moved(name, value + h) - moved(name, value - h)) / (2.0 * h))
            continue
        for k in range(len(value)):
            step = h * np.eye(len(value))[k]
            up, down = tuple(np.add(value, step)), tuple(np.subtract(value, step))
            columns.append((moved(name, up) - moved(name, down)) / (2.0 * h))
    numeric = np.stack(columns, axis=2)
    scale = np.maximum(1.0, np.abs(numeric).max(axis=0))
    assert model.by_parameters(points).shape == numeric.shape
    np.testing.assert_allclose(model.by_parameters(points) / scale, numeric / scale, atol=1e-6)


@pytest.mark.parametrize("name", PINHOLES)
def test_opencv_projects_to_the_same_pixels(name):
    model = CameraModel(ALL[name])
    p, points = model.parameters, directions(model)
    k = np.array([[model.fx, 0, model.cx], [0, model.fy, model.cy], [0, 0, 1.0]])
    zero = np.zeros(3)
    if p.distortion_model == "equidistant":
        points = points[points[:, 2] > 0.05 * np.linalg.norm(points, axis=1)]
        projected, _ = cv2.fisheye.projectPoints(
            points[:, None], zero, zero, k, np.array(p.distortion)
        )
    else:
        projected, _ = cv2.projectPoints(
            points, zero, zero, k, np.array(p.distortion or (0.0,) * 4)
        )
    assert np.abs(projected[:, 0] - model.project(points).uv).max() < 1e-9


@pytest.mark.parametrize("name", PLAIN_SPHERES)
def test_the_spheres_follow_their_papers(name):
    """Mei and Rives 2007, section II; Usenko 2018, eq. 40: written out for one point at a time."""
    model = CameraModel(ALL[name])
    p = model.parameters
    for x, y, z in directions(model, 50):
        norm = (x * x + y * y + z * z) ** 0.5
        if p.model == "unified":
            denominator = z / norm + p.xi
            mx, my = x / norm / denominator, y / norm / denominator
        else:
            d2 = (x * x + y * y + (p.xi * norm + z) ** 2) ** 0.5
            denominator = p.alpha * d2 + (1 - p.alpha) * (p.xi * norm + z)
            mx, my = x / denominator, y / denominator
        u, v = model.project([[x, y, z]]).uv[0]
        assert u == pytest.approx(model.fx * mx + model.cx, abs=1e-10)
        assert v == pytest.approx(model.fy * my + model.cy, abs=1e-10)


def test_points_behind_and_beyond_the_fold_have_no_pixel():
    euroc = CameraModel(load_rig({"cameras": ["a"], "camera.preset": "euroc_cam0"}).camera("a"))
    assert not euroc.project([[0.1, 0.2, -1.0], [0.0, 0.0, -1.0]]).valid.any()
    folded = CameraModelParameters(
        width=100,
        height=100,
        intrinsics=(400.0, 400.0, 50.0, 50.0),
        distortion_model="radtan",
        distortion=(-0.5, 0.0, 0.0, 0.0),
    )
    radius, image = fold("radtan", folded.distortion)
    assert radius == pytest.approx((1.0 / 1.5) ** 0.5)  # 1 + 3 k1 r^2 = 0
    assert image == pytest.approx(radius * (1.0 - 0.5 * radius * radius))
    # Far beyond the fold the polynomial comes back to the centre: no such ghost is seen.
    ghost = CameraModel(folded).project([[2.0**0.5, 0.0, 1.0], [radius - 1e-6, 0.0, 1.0]])
    assert ghost.valid.tolist() == [False, True]


def test_a_distortion_that_folds_in_the_image_is_refused_with_the_radius():
    parameters = {
        "cameras": ["a"],
        "a.camera.intrinsics": [400.0, 400.0, 320.0, 240.0],
        "a.camera.distortion_model": "radtan",
        "a.camera.distortion": [-0.5, 0.0, 0.0, 0.0],
    }
    with pytest.raises(
        ConfigurationError, match=r"a\.camera\.distortion.*folds.*radius of 0\.8165"
    ):
        load_rig(parameters)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("intrinsics", [400.0, 400.0, 900.0, 240.0], "cx = 900: must be inside the image"),
        ("intrinsics", [-1.0, 400.0, 300.0, 240.0], "fx = -1: must be above 0 px"),
        ("intrinsics", [400.0], "four numbers"),
        ("intrinsics", [float("nan")] * 4, "finite"),
        ("distortion", [0.1], "must have 0 entries"),
        ("mounting", [1, 0, 0, 0, 1, 0, 0, 0, 2], "rotation matrix"),
        ("mounting", [1, 0, 0, 0, 1, 0, 0, 0, -1], "is a reflection"),
        ("width", 0, "at least 1"),
        ("pixel_noise", -1.0, "at least 0"),
        ("row_time", 9e-4, "640 rows must be read in less than the interval"),
        ("max_depth", 0.01, "must be above"),
    ],
)
def test_bad_values_are_named(key, value, message):
    with pytest.raises(ConfigurationError, match=message):
        load_rig({"cameras": ["cam0"], f"cam0.camera.{key}": value})
