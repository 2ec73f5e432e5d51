# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images: the same bytes everywhere, where they should look, and what the sensor makes of them."""

import hashlib
import inspect
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from small_camera import SMALL_CAMERA

from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import ConfigurationError, MissingDependencyError
from imu_sim_ros.places import gloss, light
from imu_sim_ros.sensors.camera.images import loops
from imu_sim_ros.sensors.camera.images.exposure import expose
from imu_sim_ros.sensors.camera.images.files import png
from imu_sim_ros.sensors.camera.images.grey_values import grey_values
from imu_sim_ros.sensors.camera.images.imager import Imager
from imu_sim_ros.sensors.camera.images.libraries import numba_function
from imu_sim_ros.sensors.camera.images.loops import CELL, look_up, nearest_hit
from imu_sim_ros.sensors.camera.images.texture import atlas
from imu_sim_ros.sensors.camera.scene_parameters import CloudParameters
from imu_sim_ros.sensors.camera.view import Eyes

SMALL = {
    **SMALL_CAMERA,
    "scene__size": [5.0, 4.0, 2.6],
    "scene__center": [0.0, 0.0, 1.0],
    "scene__horizon": 10.0,
}
EVERYTHING = {
    "camera__supersampling": 2,
    "camera__row_time": 1e-4,
    "camera__exposure_time": 0.01,
    "camera__blur_samples": 3,
    "camera__gain_change": 0.3,
    "camera__vignetting": 0.4,
    "camera__read_noise": 1.5,
    "camera__shot_noise": 3.0,
    "camera__repeat_probability": 0.3,
}
POINTS = {"camera__antialiasing": False}
GOLDEN = {
    "plain": "c0b164d3cc1ff7bc",
    "everything": "009b72292d1a60e4",
    "fisheye": "15e25c362b4824d0",
    "trilinear": "d34a270f401e41d8",
    "colour": "0661d82c5fadc53a",
    "linear": "01b5839863d943fe",
}
OF_AREAS = {
    "plain": "8a52cd51cb6922af",
    "everything": "42486348a18ce25c",
    "fisheye": "968de0662e546ac7",
    "trilinear": "6fde9fe3210d0263",
    "colour": "a83ccecd0cd6850c",
    "linear": "85a1a9a917979aec",
}
TEXTURES = {}
"""Texture atlases by scene: the same parameters give the same textures."""
IMAGERS = {}
"""Imagers and their rigs by parameters: an image follows from its number alone."""
CASES = {
    "plain": {},
    "everything": EVERYTHING,
    "fisheye": {
        "camera__distortion_model": "equidistant",
        "camera__distortion": [0.0035, 0.0007, -0.002, 0.0002],
        "camera__intrinsics": [55.0, 55.0, 93.0, 60.0],
    },
    "trilinear": {"camera__mip_levels": "trilinear"},
    "colour": {
        **EVERYTHING,
        "camera__encoding": "rgb8",
        "camera__mip_levels": "trilinear",
        "camera__exposure_change": 0.5,
    },
    "linear": {**EVERYTHING, "camera__response": "linear", "camera__auto_exposure": 90.0},
}


def make_imager(make_rig, **values):
    key = repr(sorted(values.items()))
    if key not in IMAGERS:
        IMAGERS[key] = new_imager(make_rig, **values)
    return IMAGERS[key]


def new_imager(make_rig, **values):
    rig = make_rig("target", **{**SMALL, **values})
    colour = rig.views["cam0"].parameters.encoding == "rgb8"
    key = rig.parameters.scene, colour
    if key not in TEXTURES:
        TEXTURES[key] = atlas(rig.scene.surfaces, rig.parameters.scene, colour)
    textures = TEXTURES[key]
    return rig, Imager(rig.views["cam0"], rig.scene, textures, rig.trajectory)


def digest(imager, numbers=range(0, 120, 39)):
    total = hashlib.sha256()
    for number in numbers:
        total.update(imager.image(number).tobytes())
    return total.hexdigest()[:16]


@pytest.mark.parametrize("case", CASES)
def test_a_seed_gives_the_same_bytes_everywhere(make_rig, case):
    """OpenCV 4.6 and 5.0, NumPy 1.26 and 2.x: this file runs on both.

    Without antialiasing, the bytes are those from before there was any.
    """
    assert digest(make_imager(make_rig, **CASES[case], **POINTS)[1]) == GOLDEN[case]
    assert digest(make_imager(make_rig, **CASES[case])[1]) == OF_AREAS[case]


def test_the_bytes_do_not_depend_on_the_processor():
    """Another process, without the vector instructions that it may be told to leave alone."""
    off = "AVX AVX2 FMA3 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL"
    extensions = np.show_config(mode="dicts")["SIMD Extensions"]
    features = [name for name in off.split() if name in extensions.get("found", ())]
    environment = {
        **os.environ,
        "NPY_DISABLE_CPU_FEATURES": " ".join(features),
        "OPENCV_CPU_DISABLE": "AVX2,FP16,AVX512_SKX",
        "NUMBA_CPU_NAME": "generic",
    }
    folder, cases = Path(__file__).parent, ("fisheye", "colour", "linear")  # all that there is
    code = (
        f"import sys; sys.path.insert(0, {str(folder)!r}); import test_images as t, rigs\n"
        f"for case in {cases}: print(t.digest(t.make_imager(rigs.make_rig, **t.CASES[case])[1]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == [OF_AREAS[case] for case in cases]


def test_images_do_not_depend_on_whether_rays_are_kept(make_rig, monkeypatch):
    cached = make_imager(make_rig, **EVERYTHING)[1].image(3)
    monkeypatch.setattr("imu_sim_ros.sensors.camera.images.rays._KEPT", 0)
    assert np.array_equal(new_imager(make_rig, **EVERYTHING)[1].image(3), cached)


def test_images_do_not_depend_on_the_order_nor_on_threads(make_rig):
    from concurrent.futures import ThreadPoolExecutor

    _, imager = make_imager(make_rig, **EVERYTHING)
    numbers = [7, 3, 40, 8, 3]
    backwards = [imager.image(k) for k in reversed(numbers)][::-1]
    with ThreadPoolExecutor(3) as pool:
        together = list(pool.map(imager.image, numbers))
    for backward_image, second in zip(backwards, together, strict=True):
        assert np.array_equal(backward_image, second)


def plainly_looked_up(atlas, patch, place, doublings):
    """Return the rounded mean of looks, each of them the rounded mean of two levels."""
    count, total = 2**doublings, 0
    for j in range(count):
        step = np.float32((j + 0.5) / count - 0.5)
        looks = []
        for scale, offset in zip(patch["scale"], patch["offset"], strict=True):
            texel = place * scale + offset + step * (patch["along"] * scale)
            texel = np.clip(texel, offset, offset + scale)
            looks.append(plainly_bilinear(atlas, *np.rint(32.0 * texel).astype(int)))
        share = int(patch["share"])
        total = total + (((256 - share) * looks[0] + share * looks[1] + 128) >> 8)
    return (total + count // 2) // count


def plainly_bilinear(atlas, x, y):
    """Interpolate bilinearly in NumPy integers: (sum w a + 512) >> 10 with weights of 1/32."""
    (x, fx), (y, fy) = np.divmod(x, 32), np.divmod(y, 32)
    next_column, next_row = (
        np.minimum(x + 1, atlas.shape[1] - 1),
        np.minimum(y + 1, atlas.shape[0] - 1),
    )
    four = atlas[[y, y, next_row, next_row], [x, next_column, x, next_column]].astype(int)
    total = (
        (32 - fx) * (32 - fy) * four[0]
        + fx * (32 - fy) * four[1]
        + (32 - fx) * fy * four[2]
        + fx * fy * four[3]
    )
    return (total + 512) >> 10


@pytest.mark.parametrize("case", CASES)
def test_the_look_up_is_integer_arithmetic(make_rig, case):
    rig, imager = make_imager(make_rig, **CASES[case])
    times = imager._row_times(np.array([1.3]), imager._renderer.rows)
    visible = imager._renderer.visible(Eyes(rig.views["cam0"].poses(rig.trajectory, times)))
    atlas = imager.atlas.image.reshape(*imager.atlas.image.shape[:2], -1)
    stream, value = np.random.default_rng(4), np.zeros(atlas.shape[2], np.int64)
    patches = visible.patches
    assert len(np.unique(patches["doublings"])) > 1
    if CASES[case].get("camera__mip_levels"):
        assert patches["share"].max() > 128 > patches["share"].min()
    for number in stream.integers(0, len(patches), 300):
        patch, place = patches[number], stream.random(2, np.float32)
        for doublings in (0, 2, int(patch["doublings"])):
            look_up(value, atlas, patch, *place, doublings)
            assert (value == plainly_looked_up(atlas, patch, place, doublings)).all()


@pytest.mark.parametrize("scale", [3, 4, 5])
def test_the_image_does_not_depend_on_its_bands(make_rig, monkeypatch, scale):
    """A band has few rows of cells, or all: the values are the same, and so is every pixel."""
    monkeypatch.setattr("imu_sim_ros.sensors.camera.images.rays._BAND", 64_000)
    plain = {"camera__distortion_model": "none", "camera__distortion": []}
    many = new_imager(make_rig, camera__supersampling=scale, **plain)[1]
    assert len(many._renderer.bands) > 2
    expected = many.image(3)
    monkeypatch.setattr("imu_sim_ros.sensors.camera.images.rays._BAND", 10**9)
    single_band = new_imager(make_rig, camera__supersampling=scale, **plain)[1]
    assert len(single_band._renderer.bands) == 1
    assert np.array_equal(single_band.image(3), expected)


@pytest.mark.parametrize("shutter", [0.0, 2e-4])
def test_edges_and_grazing_textures_are_those_of_many_rays(make_rig, shutter):
    """The mean of 6 x 6 rays is the judge: of pixels at edges, and of all others.

    Eight places with one share each tell a straight edge's share to 1/16 on average, of a step of
    up to 255 grey values; a centre alone tells it to 1/4.
    """
    values = {"scene__boxes": 8, "camera__row_time": shutter}
    _, points = make_imager(make_rig, **values, **POINTS)
    _, areas = make_imager(make_rig, **values)
    _, many = make_imager(make_rig, **values, **POINTS, camera__supersampling=6)
    worse, better = [], []
    for number in (5, 40, 75):
        judge = many.image(number).astype(float)
        depth = areas.depth(number)
        edge = np.zeros(depth.shape, bool)
        for axis in (0, 1):
            second = np.abs(np.diff(1.0 / depth, n=2, axis=axis)) > 0.02
            inner = [slice(None)] * 2
            inner[axis] = slice(1, -1)
            edge[tuple(inner)] |= second
        for renderer, statistics in ((points, worse), (areas, better)):
            error = np.abs(renderer.image(number) - judge)
            statistics.append((error[edge].mean(), error[~edge].mean()))
    (edges, rest), (rough_edges, rest_before) = np.mean(better, axis=0), np.mean(worse, axis=0)
    assert edges < 0.5 * rough_edges
    assert rest < 0.8 * rest_before


def lk_errors(imagers, number, window=15):
    """Return errors (k, n) [px] of LK on points of the last camera's image, and where they are.

    :returns: whether a step in depth is next to each, and how far the flow in its window is from
        that of one plane [px].
    """
    import cv2

    flow, depth = imagers[0].flow(number), imagers[0].depth(number)
    step = np.zeros(depth.shape, np.uint8)
    for axis in (0, 1):
        previous_depth, next_depth = np.roll(1 / depth, 1, axis), np.roll(1 / depth, -1, axis)
        step |= (np.abs(previous_depth + next_depth - 2 / depth) * depth > 0.05).astype(np.uint8)
    images = [[images_of.image(number), images_of.image(number + 1)] for images_of in imagers]
    points = cv2.goodFeaturesToTrack(images[-1][0], 300, 0.01, 4)[:, 0]
    half, pixel = window // 2, np.rint(points).astype(int)
    in_image = ((pixel > half + 2) & (pixel < np.array(depth.shape)[::-1] - half - 3)).all(axis=1)
    points, pixel = points[in_image], pixel[in_image]
    columns, rows = pixel.T
    # What is at a corner next to a step may be that on either side.
    truth = np.stack([flow[rows + i, columns + j] for i in (-2, 0, 2) for j in (-2, 0, 2)])
    errors = []
    for current_image, next_image in images:
        tracked_uv, tracked, _ = cv2.calcOpticalFlowPyrLK(
            current_image, next_image, points[:, None], None, winSize=(window, window), maxLevel=2
        )
        error = np.linalg.norm(tracked_uv[:, 0] - points - truth, axis=2)
        errors.append(np.where(np.isfinite(error), error, np.inf).min(axis=0))
        errors[-1][tracked[:, 0] == 0] = np.inf
    place = np.indices((window, window)).reshape(2, -1).T
    plane = np.c_[np.ones(len(place)), place]
    spread = []
    for column, row in pixel:
        part = np.s_[row - half : row + half + 1, column - half : column + half + 1]
        window_flow = flow[part].reshape(-1, 2)
        fit = np.linalg.lstsq(plane, np.nan_to_num(window_flow), rcond=None)[0]
        spread.append(np.abs(window_flow - plane @ fit).max())
    return np.stack(errors), cv2.dilate(step, np.ones((5, 5)))[rows, columns] > 0, np.array(spread)


def test_edges_are_tracked_as_in_images_of_many_rays(make_rig):
    """LK on default images, against images of 6 x 6 rays: both have the errors of LK alone.

    Where a window has two motions, LK finds neither, in any image; where it has one, edges are
    tracked as surfaces are, within twice.
    """
    values = {"scene__boxes": 12, "scene__seed": 4}
    _, points = make_imager(make_rig, **values, **POINTS)
    _, areas = make_imager(make_rig, **values)
    _, many = make_imager(make_rig, **values, **POINTS, camera__supersampling=6)
    evaluations = [lk_errors([areas, points, many], number) for number in (25, 45, 65, 85, 105)]
    errors, edge, spread = (
        np.concatenate(parts, axis=-1) for parts in zip(*evaluations, strict=True)
    )
    (at_edges, stepped, judge), single_motion = errors[:, edge], edge & (spread < 0.1)
    assert edge.sum() > 100
    assert single_motion.sum() > 50
    for share in (50, 90):
        of_rays = np.percentile(judge, share)
        # The points are the same; only the images differ.
        assert np.percentile(at_edges, share) < 1.25 * of_rays + 0.01
        surfaces = np.percentile(errors[0, ~edge & (spread < 0.1)], share)
        assert np.percentile(errors[0, single_motion], share) < 2.0 * surfaces
    assert np.median(stepped) > 1.5 * np.median(at_edges)


def test_sixteen_rays_a_pixel_of_a_stereo_pair_fit_into_500_mb(make_rig):
    """The rays of the two cameras alone are 139 MB, numba and what it compiled 150.

    It is compiled and kept here before: the compiler at work takes more. Without a distortion,
    whose inverse is found for few pixels at once, the rays are as many and found sooner.
    """
    make_imager(make_rig, camera__supersampling=4)[1].image(1)
    code = (
        "from pathlib import Path\nfrom imu_sim_ros.camera import build_rig\n"
        "from imu_sim_ros.sensors.camera.images.imager import Imager, textures\n"
        "rig = build_rig({'cameras': ['cam0', 'cam1'], 'cam0.camera.preset': 'euroc_cam0',\n"
        "  'cam1.camera.preset': 'euroc_cam1', 'camera.body_axes': 'flu', 'duration': 1.0,\n"
        "  'camera.supersampling': 4, 'trajectory.type': 'figure_eight',\n"
        "  'camera.distortion_model': 'none', 'camera.distortion': [],\n"
        "  'scene.type': 'room'})\n"
        "look = textures(rig.scene, rig.parameters.scene, False)\n"
        "made = [Imager(v, rig.scene, look, rig.trajectory) for v in rig.views.values()]\n"
        "for each in made:\n"
        "  assert each.image(1).shape == (480, 752)\n"
        "print(Path('/proc/self/status').read_text().partition('VmHWM:')[2].split()[0])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(out.stdout) < 500_000  # kB


def test_two_mip_levels_are_those_next_to_the_step_of_a_pixel(make_rig):
    """The share of the coarser one grows with the step: none at 2^k texels, all at 2^(k + 1)."""
    rig, imager = make_imager(make_rig, camera__mip_levels="trilinear", **POINTS)
    view = Seen(rig, imager, 1.0)
    stream, checked = np.random.default_rng(5), 0
    pixels = np.column_stack([stream.integers(0, 187, 150), stream.integers(0, 119, 150)])
    hits, *shifted_hits = (traced(rig, 1.0, pixels + offset) for offset in ((0, 0), (1, 0), (0, 1)))
    for k, (u, v) in enumerate(pixels):
        m, place = hits[0][k], hits[1][k]
        if any(shifted[0][k] != m for shifted in shifted_hits):
            continue
        size = imager.atlas.size[m]
        step = max(np.hypot(*((shifted[1][k] - place) * size)) for shifted in shifted_hits)
        number, place_seen, patch = view(u, v)
        assert number == m
        assert place_seen == pytest.approx(place, abs=1e-4)
        level = levels_of(imager.atlas, m, patch)
        assert level[1] == level[0] + 1
        blended = level[0] + np.log2(1.0 + patch["share"] / 256.0)
        # The step is that of the middle of a cell of 8 x 8 pixels.
        assert abs(blended - np.log2(max(step, 1.0))) < 0.6
        checked += 1
    assert checked > 100


def test_colours_have_the_brightness_and_corners_of_grey_values(make_rig):
    """Same scene, same noise stream for each pixel's values; a target stays black and white."""
    _, grey = make_imager(make_rig)
    _, colour = make_imager(make_rig, camera__encoding="rgb8")
    mono, rgb = grey.image(10).astype(float), colour.image(10).astype(float)
    assert rgb.shape == (*mono.shape, 3)
    # Tints of +-40 in two octaves, evenly drawn: their mean over a picture vanishes.
    assert np.abs(rgb.mean(axis=(0, 1)) - mono.mean()).max() < 8.0
    assert min(np.corrcoef(rgb[..., k].ravel(), mono.ravel())[0, 1] for k in range(3)) > 0.6
    assert np.abs(rgb[..., 0] - rgb[..., 2]).mean() > 15.0
    target = {"scene__type": "checkerboard", "camera__encoding": "rgb8"}
    small = {key: value for key, value in SMALL.items() if not key.startswith("scene")}
    rig = make_rig("target", **{**small, **target})
    textures = atlas(rig.scene.surfaces, rig.parameters.scene, colour=True)
    board = Imager(rig.views["cam0"], rig.scene, textures, rig.trajectory).image(10)
    assert np.ptp(board, axis=2).max() == 0


def test_a_png_of_colours_has_them_in_order():
    """Read by a decoder of its own: zlib over the rows of the file."""
    import zlib

    picture = np.zeros((2, 3, 3), np.uint8)
    picture[0, 0], picture[1, 2] = (255, 1, 2), (3, 4, 250)
    data = png(picture)
    start = data.index(b"IDAT") + 4
    size = int.from_bytes(data[start - 8 : start - 4], "big")
    rows = np.frombuffer(zlib.decompress(data[start : start + size]), np.uint8).reshape(2, 10)
    assert data[25] == 2  # colour type: red, green, blue
    assert not rows[0, 0] or rows[0, 0] in (1, 2, 4)  # of the first row, its first pixel is plain
    assert rows[0, 1:4].tolist() == [255, 1, 2]


@pytest.mark.parametrize("scale", [1, 2])
def test_depth_is_that_of_the_pixels_centre(make_rig, scale):
    values = {"camera__supersampling": scale, "camera__repeat_probability": 0.5}
    rig, imager = make_imager(make_rig, **values)
    number = next(k for k in range(20, 100) if imager._content(k) == k - 1)
    assert np.array_equal(imager.depth(number), imager.depth(number - 1))
    depth, t = imager.depth(number - 1), (number - 1) / 20.0
    stream = np.random.default_rng(3)
    u, v = stream.integers(0, 188, 60), stream.integers(0, 120, 60)
    error = depth[v, u] / traced(rig, t, np.column_stack([u, v]))[2] - 1.0
    # One at an edge may be on the other side of it.
    assert np.count_nonzero(np.abs(error) < 1e-5) >= 58


def test_the_exposure_changes_blur_and_brightness(make_rig):
    values = {
        "camera__exposure_time": 0.02,
        "camera__exposure_change": 0.5,
        "camera__exposure_period": 2.0,
        "camera__blur_samples": 3,
    }
    _, changing = make_imager(make_rig, **values)
    _, fixed = make_imager(make_rig, **{**values, "camera__exposure_change": 0.0})
    assert changing.exposure(0) == fixed.exposure(0) == 0.02
    assert changing.exposure(10) == pytest.approx(0.03)  # a quarter of the period
    assert changing.exposure(30) == pytest.approx(0.01)
    longer = {**values, "camera__exposure_change": 0.0, "camera__exposure_time": 0.03}
    _, reference = make_imager(make_rig, **longer, camera__gain=1.5)
    assert np.abs(changing.image(10).astype(int) - reference.image(10)).max() <= 1
    with pytest.raises(ConfigurationError, match=r"exposure_time must be above 0 s"):
        make_rig(camera__exposure_change=0.5)
    with pytest.raises(ConfigurationError, match=r"exposure_change up to 0\.054 s"):
        make_rig(camera__exposure_change=0.8, camera__exposure_time=0.03)


def test_automatic_exposure_follows_the_mean_with_a_lag_and_a_limit(make_rig):
    values = {"camera__auto_exposure": 60.0, "camera__auto_exposure_lag": 0.0}
    _, plain = make_imager(make_rig, camera__read_noise=0.0)
    _, quick = make_imager(make_rig, camera__read_noise=0.0, **values)
    automatic = quick._automatic
    means = np.array([plain.image(k).mean() for k in range(0, 40, 2)])  # each 0.1 s
    metered = [automatic._mean(0.1 * k) for k in range(20)]
    # The meter's pixels are 4 x 4 larger and it looks at coarser levels.
    assert np.abs(metered - means).max() < 5.0
    for k in (4, 11):
        assert automatic.factor(0.1 * k) == pytest.approx(60.0 / metered[k - 1], rel=1e-5)
    assert quick.image(22).mean() == pytest.approx(60.0, abs=8.0)
    _, limited = make_imager(make_rig, **{**values, "camera__auto_exposure_limit": 1.2})
    assert limited._automatic.factor(1.0) == pytest.approx(1.0 / 1.2, rel=1e-5)
    _, slow = make_imager(make_rig, **{**values, "camera__auto_exposure_lag": 0.5})
    logarithms = np.log(60.0 / np.array([metered[max(k, 0)] for k in range(10 - 1, -16, -1)]))
    weights = np.exp(-0.2 * np.arange(25.0))
    expected = np.exp((logarithms[:25] * weights).sum() / weights.sum())
    assert slow._automatic.factor(1.0) == pytest.approx(expected, rel=1e-4)
    # Whatever was asked before, in whatever order.
    _, again = new_imager(make_rig, **{**values, "camera__auto_exposure_lag": 0.5})
    assert np.array_equal(again.image(31), slow.image(31))


def test_automatic_exposure_multiplies_noise_and_leaves_white_white(make_rig):
    bright = {"camera__auto_exposure": 250.0, "camera__auto_exposure_limit": 3.0}
    noise = {"camera__read_noise": 2.0, "camera__shot_noise": 4.0}
    _, noisy = make_imager(make_rig, **bright, **noise)
    _, clean = make_imager(make_rig, **bright, camera__read_noise=0.0)
    factor = noisy._automatic.factor(0.5)
    assert 1.5 < factor <= 3.0
    level = clean.image(10).astype(float)
    error = noisy.image(10) - level
    middle = (level > 40.0) & (level < 180.0)
    expected = (factor * 2.0) ** 2 + factor * 16.0 / 255.0 * level[middle] + 1.0 / 12.0 * 2.0
    n = int(middle.sum())
    # The variance of n squares of normal numbers is 2 / n of its square: five deviations.
    assert (error[middle] ** 2 / expected).mean() == pytest.approx(1.0, abs=5.0 * (2.0 / n) ** 0.5)
    # Saturated windows stay so in a darker image; what is below white gets the factor alone.
    assert expose(np.array([20.0, 200.0, 255.0], np.float32), 0.5).tolist() == [10.0, 100.0, 255.0]


def test_a_linear_response_is_in_proportion_to_light(make_rig):
    """Grey values are linear in the light of an sRGB image; a blurred pixel has the mean light."""
    linear = {"camera__response": "linear", "camera__read_noise": 0.0}
    _, photo = make_imager(make_rig, camera__read_noise=0.0)
    _, plain = make_imager(make_rig, **linear)
    exact = 255.0 * (photo.image(4) / 255.0) ** 2.2
    assert np.abs(plain.image(4) - exact).max() <= 0.5 + 1.0 / 64.0
    # A wall under 0.1 and 0.4 of the light, as far as its values of 8 bits are exact: c has an
    # error of 1/2, so that light has one of 2.2 / (2 c), and the ratio both together.
    dark, bright = (np.rint(200.0 * light.factors(np.float32(e))).astype(int) for e in (0.1, 0.4))
    grey = grey_values("linear").of(np.array([dark, bright], np.uint8))
    assert grey[1] / grey[0] == pytest.approx(4.0, rel=1.1 / dark + 1.1 / bright + 0.002)
    blur = {"camera__exposure_time": 0.02, "camera__blur_samples": 2}
    _, blurred = make_imager(make_rig, **linear, **blur)
    seconds = blurred._seconds(4)
    pictures = []
    for t in (seconds - 0.005, seconds + 0.005):
        eyes = blurred._eyes(np.array([t]))
        pictures.append(np.concatenate([p for _, p in blurred._renderer.pictures(eyes)]))
    mean = np.mean([255.0 * (p / 255.0) ** 2.2 for p in pictures], axis=0)
    assert np.abs(blurred.image(4) - mean).max() <= 0.5 + 1.0 / 64.0
    _, metered = make_imager(make_rig, **linear, camera__auto_exposure=40.0)
    assert metered._automatic._mean(0.2) == pytest.approx(plain.image(4).mean(), abs=5.0)


class Seen:
    """Surfaces, places and texture patches of the renderer at the centres of pixels."""

    def __init__(self, rig, imager, t):
        eyes = Eyes(rig.views["cam0"].poses(rig.trajectory, np.array([t])))
        renderer = imager._renderer
        _, self.numbers, _ = renderer._candidates(eyes)
        self.visible = renderer.visible(eyes)
        rays = renderer._rays
        self.rays = np.concatenate([rays.of_band(k) for k in range(len(rays.bands))], axis=1)

    def __call__(self, u, v):
        """Return the rectangle, s and r, and the record of how it is seen."""
        planes, pairs = self.visible.planes, self.visible.pairs
        cell = v // CELL * -(-self.rays.shape[2] // CELL) + u // CELL
        ray, (begin, end) = tuple(self.rays[:, v, u]), pairs.first[cell : cell + 2]
        _, hit, s, r = nearest_hit(*planes, pairs.which, pairs.fills, begin, end, 0, ray)
        return self.numbers[pairs.which[hit]], (s, r), self.visible.patches[hit]


def levels_of(atlas, m, patch):
    """Return which levels of a surface's texture a record names."""
    levels = []
    for scale, offset in zip(patch["scale"], patch["offset"], strict=True):
        if scale.any():
            level = round(float(np.log2(atlas.size[m, 0] / scale[0])))
            assert scale == pytest.approx(atlas.size[m] / 2.0**level)
            assert offset == pytest.approx(atlas.corner[m, level] - 0.5)
            levels.append(level)
    return levels


def traced(rig, t, pixels):
    """Trace rays of pixels (n, 2) against every rectangle: surface, s and r (n, 2), depth."""
    view, where = rig.views["cam0"], rig.scene.surfaces
    pose = view.poses(rig.trajectory, np.array([t]))
    rays = view.model.unproject(pixels).direction
    d, c = rotation.rotate(pose.q_wc.repeat(len(rays), axis=0), rays), pose.position[0]
    n = np.cross(where.across, where.up)
    slope, height = d @ n.T, (n * (where.origin - c)).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = c + (height / slope)[..., None] * d[:, None] - where.origin
        sides = [(offset * e).sum(axis=2) / (e * e).sum(axis=1) for e in (where.across, where.up)]
        place = np.stack(sides, axis=-1)
        front = (slope < 0.0) & (height < 0.0) & ((place >= 0.0) & (place <= 1.0)).all(axis=2)
        distance = np.where(front, height / slope, np.inf)
    ray_index, m = np.arange(len(rays)), distance.argmin(axis=1)
    return m, place[ray_index, m], distance[ray_index, m] * rays[:, 2]


def test_every_pixel_looks_at_the_nearest_surface(make_rig):
    rig, imager = make_imager(make_rig, scene__boxes=8, **POINTS)
    depth, view = imager.depth(20), Seen(rig, imager, 1.0)
    stream, checked, levels = np.random.default_rng(0), 0, set()
    pixels = np.column_stack([stream.integers(0, 188, 400), stream.integers(0, 120, 400)])
    hits, *shifted_hits = (traced(rig, 1.0, pixels + offset) for offset in ((0, 0), (1, 0), (0, 1)))
    for k, (u, v) in enumerate(pixels):
        m, place, expected = (component[k] for component in hits)
        if abs(depth[v, u] - expected) > 1e-4 * expected:
            continue  # an edge: counted below
        checked += 1
        number, place_seen, patch = view(u, v)
        assert number == m
        size = imager.atlas.size[m]
        assert np.abs((np.array(place_seen) - place) * size).max() < 5e-3
        level = levels_of(imager.atlas, m, patch)[0]
        levels.add(level)
        steps = [np.hypot(*((shifted[1][k] - place) * size)) for shifted in shifted_hits]
        if max(steps) < 100.0:  # the neighbours are on the same surface
            # One level holds for a cell of 8 x 8 pixels, within which the step changes.
            assert abs(np.log2(max(1.0, *steps)) - level) < 1.6
    assert checked > 390
    assert len(levels) > 1


def test_the_grey_values_follow_gain_vignetting_and_noise(make_rig):
    _, plain = make_imager(make_rig)
    _, half = make_imager(make_rig, camera__gain=0.5)
    reference = plain.image(10).astype(float)
    assert np.abs(half.image(10) - 0.5 * reference).max() <= 0.5
    _, dark = make_imager(make_rig, camera__vignetting=0.5)
    ratio = dark.image(10) / np.maximum(reference, 1.0)
    assert ratio[62, 92] == pytest.approx(1.0, abs=0.02)
    assert ratio[0, 187] == pytest.approx(0.5, abs=0.03)
    values = {"camera__read_noise": 2.0, "camera__shot_noise": 6.0, "scene__seed": 0}
    _, noisy = make_imager(make_rig, **values)
    error = np.concatenate([(noisy.image(10) - reference).ravel()])
    level = reference.ravel()
    unclipped = (level > 30.0) & (level < 225.0)  # no clipping at black or white
    for low, high in ((30, 90), (90, 150), (150, 225)):
        part = unclipped & (level >= low) & (level < high)
        # Variance of the sum, of rounding to whole grey values included.
        variance = 4.0 + 36.0 / 255.0 * level[part].mean() + 1.0 / 12.0
        n = int(part.sum())
        assert n > 1000
        assert error[part].var() == pytest.approx(variance, rel=5.0 * np.sqrt(2.0 / n))


def test_blur_is_the_mean_over_the_exposure(make_rig):
    exposure = {"camera__exposure_time": 0.04, "camera__blur_samples": 4}
    _, blurred = make_imager(make_rig, **exposure)
    pictures = []
    for k in range(4):
        phase = 0.5 + 0.04 * ((k + 0.5) / 4 - 0.5)
        _, sharp = make_imager(make_rig, camera__phase=phase)
        pictures.append(sharp.image(0).astype(float))
    difference = np.abs(blurred.image(10) - np.mean(pictures, axis=0))
    assert difference.max() <= 0.5 + 1e-9


def test_a_repeated_frame_shows_the_one_before(make_rig):
    _, imager = make_imager(make_rig, camera__repeat_probability=0.5, camera__read_noise=2.0)
    images = [imager.image(k) for k in range(120)]
    repeated = [np.array_equal(images[k], images[k + 1]) for k in range(119)]
    assert abs(np.mean(repeated) - 0.5) < 5.0 * np.sqrt(0.25 / 119)


@pytest.mark.parametrize("scale", [1, 2])
def test_aprilgrid_finds_all_tags_where_they_are(make_rig, scale):
    """PyPI's detector; its corners against the exact projection of the target's corners."""
    aprilgrid = pytest.importorskip("aprilgrid")
    rig = make_rig(
        "target",
        cam0__camera__preset="euroc_cam0",
        cam0__camera__body_axes="flu",
        scene__type="aprilgrid",
        camera__supersampling=scale,
        camera__read_noise=1.0,
        camera__max_features=0,
        camera__pixel_noise=0.0,
    )
    textures = atlas(rig.scene.surfaces, rig.parameters.scene)
    imager = Imager(rig.views["cam0"], rig.scene, textures, rig.trajectory)
    detector, errors = aprilgrid.Detector("t36h11"), []
    for number in range(60, 180, 24 if scale == 1 else 60):
        true = rig.tracker("cam0").tracks(number, 1)
        assert len(true.landmark) == 144
        detections = detector.detect(imager.image(number))
        assert sorted(tag.tag_id for tag in detections) == list(range(36))
        for tag in detections:
            corners = np.reshape(tag.corners, (4, 2))
            exact = true.uv_true[4 * tag.tag_id : 4 * tag.tag_id + 4]
            distance = np.linalg.norm(corners[:, None] - exact, axis=2)
            nearest = distance.argmin(axis=1)
            assert sorted(nearest) == [0, 1, 2, 3]
            errors.append(corners - exact[nearest])
    error = np.concatenate(errors)
    rms = np.sqrt((error**2).sum(axis=1).mean())
    assert rms < (0.15 if scale == 2 else 0.30)
    assert np.abs(error.mean(axis=0)).max() < 0.02


def test_what_is_missing_is_named(make_rig, monkeypatch):
    with pytest.raises(ConfigurationError, match="nothing to make images of"):
        atlas(make_rig(scene__type="cloud").scene.surfaces, CloudParameters())
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(MissingDependencyError, match=r"python3-numba.*pip install numba"):
        numba_function(len)
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(MissingDependencyError, match=r"python3-opencv.*opencv-python-headless"):
        new_imager(make_rig)


COMPILING = """
from imu_sim_ros.bags.threads import thread_pool
from imu_sim_ros.terminal.progress import Watcher, watch
from imu_sim_ros.sensors.camera.images import libraries, loops

def more(x):
    return x + 1

more.__module__ = loops.__name__
with watch(Watcher(note=print)), thread_pool(1) as pool:
    compiled = libraries.numba_function(more)
    print(pool.submit(compiled, 1).result(), compiled(1.0))
"""


def test_whoever_follows_a_job_is_told_before_anything_is_compiled(tmp_path):
    """Once, also from the threads of the job; not if it is on the disk from an earlier run."""
    script, notices = tmp_path / "compiling.py", []
    script.write_text(COMPILING)
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, script],
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": os.getcwd()},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        *messages, result = done.stdout.splitlines()
        assert result == "2 2.0"
        notices.append(messages)
    [notice] = notices[0]
    assert "is compiled first" in notice
    assert notices[1] == []


def test_compiled_loops_are_compiled_anew_when_a_formula_of_theirs_changes():
    """numba looks at the file of the loops alone, and would go on with the former formula."""
    sources = [
        inspect.getsource(function)
        for function in (gloss.reflectance, gloss.limit_highlight, numba_function)
    ]
    digest = hashlib.sha256("".join(sources).encode()).hexdigest()[:12]
    assert digest == loops.FORMULAS_DIGEST
    # Nothing else of the package is compiled there.
    home = inspect.getfile(loops)
    parts = {function.py_func for function in vars(loops).values() if hasattr(function, "py_func")}
    elsewhere = {function for function in parts if inspect.getfile(function) != home}
    assert elsewhere == {gloss.reflectance, gloss.limit_highlight}
