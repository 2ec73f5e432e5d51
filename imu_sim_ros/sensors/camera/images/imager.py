# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The images of one camera: pictures over the exposure, optics, noise, grey values."""

import math
from collections.abc import Callable, Iterator
from functools import cache, cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.types import Array, Bytes, Single
from imu_sim_ros.sensors.camera.images.exposure import AutoExposure, expose, meter_model
from imu_sim_ros.sensors.camera.images.flow import flow
from imu_sim_ros.sensors.camera.images.grey_values import grey_values
from imu_sim_ros.sensors.camera.images.libraries import opencv
from imu_sim_ros.sensors.camera.images.mesh_look import Look
from imu_sim_ros.sensors.camera.images.mesh_renderer import MeshRenderer
from imu_sim_ros.sensors.camera.images.renderer import PictureMaker, Renderer
from imu_sim_ros.sensors.camera.images.texture import Atlas, atlas
from imu_sim_ros.sensors.camera.images.vignetting import shares
from imu_sim_ros.sensors.camera.model import CameraModel
from imu_sim_ros.sensors.camera.scene import Scene
from imu_sim_ros.sensors.camera.scene_parameters import MeshParameters, SceneParameters
from imu_sim_ros.sensors.camera.view import CameraPoses, Eyes, View
from imu_sim_ros.trajectory.motion import Trajectory

_FULL: Final = 255.0
"""Grey value at full scale."""
_FAR: Final = np.float32(1e9)
"""Value far beyond any grey value that OpenCV can still round to an integer."""


class Imager:
    """Images of one camera, each a function of its number; several threads may use it at once."""

    def __init__(
        self, view: View, scene: Scene, atlas: Atlas | Look, trajectory: Trajectory
    ) -> None:
        """Initialise without an image.

        :raises MissingDependencyError: if OpenCV or numba is not installed.
        """
        opencv()
        self.view, self.atlas, self._trajectory = view, atlas, trajectory
        self._scene = scene
        p = view.parameters
        trilinear = p.mip_levels == "trilinear"
        self._renderer = self._renderer_of(p.supersampling, trilinear, areas=p.antialiasing)
        self._colours = atlas.image.shape[2:]
        self._grey_values = grey_values(p.response)
        self._vignette = shares(view.parameters, len(self._colours))

    def _renderer_of(
        self,
        scale: int,
        trilinear: bool = False,
        model: CameraModel | None = None,
        areas: bool = False,
    ) -> PictureMaker:
        """Return a renderer at a scale, of the camera or of another model."""
        model, scene = model or self.view.model, self._scene
        if isinstance(self.atlas, Look):
            assert scene.caster is not None
            return MeshRenderer(model, scene.caster, self.atlas, scale, trilinear, areas)
        return Renderer(model, scene.surfaces, self.atlas, scale, trilinear, scene.crowd, areas)

    def image(self, number: int) -> Bytes:
        """Return frame ``number``: grey values (h, w), or red, green and blue (h, w, 3)."""
        content = self._content(number)
        p = self.view.parameters
        total, count = self._light(content)
        noisy = p.read_noise > 0.0 or p.shot_noise > 0.0
        seconds = self._seconds(content)
        gain = p.gain * _wave(p.gain_change, p.gain_period, seconds)
        gain *= _wave(p.exposure_change, p.exposure_period, seconds)
        automatic = self._automatic.factor(seconds) if p.auto_exposure > 0.0 else 1.0
        plain = gain == 1.0 and automatic == 1.0 and self._vignette is None
        if plain and not noisy:
            rounded: Bytes = ((total + count // 2) // count).astype(np.uint8)
            return rounded
        level = total.astype(np.float32)
        if not plain or count > 1:
            level *= np.float32(gain / count)
        if automatic != 1.0:
            level = expose(level, automatic)
        if self._vignette is not None:
            level *= self._vignette
        cv2 = opencv()
        # The sum in float32, then the nearest of 0 to 255; of two the even one.
        noise = self._noise(content, level, automatic) if noisy else np.zeros_like(level)
        grey: Bytes = cv2.add(level, noise, dtype=cv2.CV_8U)
        return grey

    def _noise(self, number: int, level: Single, factor: float) -> Single:
        """Return the errors of grey values (h, w), or of each colour (h, w, 3).

        Read noise has one deviation; that of shot noise goes with the root of the value.

        :param factor: factor of the automatic exposure, which multiplies the noise as well.
        """
        p = self.view.parameters
        stream = self.view.stream("image_noise", number)
        drawn = stream.integers(0, 1 << 16, level.shape, dtype=np.uint16)
        if p.shot_noise == 0.0 and factor == 1.0:
            return self._read_noise.take(drawn)
        noise = normal_quantiles().take(drawn)
        variance = level * np.float32(factor * p.shot_noise**2 / _FULL)
        variance += np.float32((factor * p.read_noise) ** 2)
        noise *= np.sqrt(variance, out=variance)
        np.clip(noise, -_FAR, _FAR, out=noise)
        return noise

    @cached_property
    def _automatic(self) -> AutoExposure:
        """Return the automatic exposure, metered in a small image."""
        small = meter_model(self.view.parameters)
        meter = self._renderer_of(1, model=small)

        def seen(t: Array) -> Iterator[Bytes]:
            return (picture for _, picture in meter.pictures(self._eyes(t)))

        return AutoExposure(self.view, seen)

    @cached_property
    def _read_noise(self) -> Single:
        """Quantiles of the read noise, which pixels draw from."""
        noise: Single = normal_quantiles() * np.float32(self.view.parameters.read_noise)
        return noise

    def depth(self, number: int) -> Single:
        """Return the depth z (h, w) [m] at each pixel's centre in the middle of the exposure.

        0 if nothing is seen. A frame that repeats another has its depth, too.
        """
        return self._centres.depth(self._exposure_poses(number))

    @property
    def has_moving_bodies(self) -> bool:
        """True if something moves in the scene."""
        return self._scene.crowd is not None

    def depth_and_mask(self, number: int) -> tuple[Single, Bytes | None]:
        """Return :meth:`depth`, and the number of the moving body (h, w): 1, 2, ...; 0: none.

        No mask if nothing moves in the scene.
        """
        if not self.has_moving_bodies:
            return self.depth(number), None
        return self._centres.depth_and_mask(self._exposure_poses(number))

    def flow(self, number: int) -> Single:
        """Return the optical flow (h, w, 2) of each pixel to the next image [px].

        It is from the pixel's centre in the middle of the exposure to the next delivered frame.
        NaN for pixels without a surface, for points outside the next image or hidden there, and
        everywhere without a next image.
        """
        p = self.view.parameters
        following = self._next_delivered_frame(number)
        if following is None:
            return np.full((p.height, p.width, 2), np.nan, np.float32)
        numbers = number, following
        seconds = [np.array([self._seconds(self._content(index))]) for index in numbers]

        def eyes(which: int) -> Callable[[Array], Eyes]:
            return lambda rows: self._eyes(self._row_times(seconds[which], rows))

        image, next_image = (self.depth_and_mask(index) for index in numbers)
        return flow(self.view.model, image, next_image, eyes)

    def _next_delivered_frame(self, number: int) -> int | None:
        """Return the number of the next delivered frame; None: there is none."""
        total = self.view.total
        while total is None or number + 1 < total:
            number += 1
            if self.view.frames(number, 1).delivered[0]:
                return number
        return None

    def _exposure_poses(self, number: int) -> Eyes:
        """Return the poses of the camera in the middle of the exposure, for each row of pixels."""
        t = np.array([self._seconds(self._content(number))])
        return self._eyes(self._row_times(t, self._centres.rows))

    def _eyes(self, t: Array) -> Eyes:
        """Return the camera's poses in the world and in the bodies' axes at times t (n,) [s]."""
        poses = self.view.poses(self._trajectory, t)
        crowd = self._scene.crowd
        bodies = crowd.bodies if crowd else ()
        return Eyes(poses, [CameraPoses(*body.sees(t, *poses)) for body in bodies])

    def exposure(self, number: int) -> float:
        """Return the exposure time of a frame [s]."""
        p = self.view.parameters
        seconds = self._seconds(self._content(number))
        return p.exposure_time * _wave(p.exposure_change, p.exposure_period, seconds)

    @cached_property
    def _centres(self) -> PictureMaker:
        """Renderer with one ray for each pixel."""
        return self._renderer_of(1)

    def _seconds(self, number: int) -> float:
        """Return the middle of a frame's exposure after the start [s]."""
        return float(self.view.seconds(self.view.frames(number, 1).true_t_ns)[0])

    def _content(self, number: int) -> int:
        """Return the number of the frame whose content a frame shows: itself, or an earlier one."""
        p = self.view.parameters
        while number > 0 and p.repeat_probability > 0.0:
            if self.view.stream("repeat", number).random() >= p.repeat_probability:
                break
            number -= 1
        return number

    def _light(self, number: int) -> tuple[NDArray[np.uint32] | Bytes, int]:
        """Return the sum (h, w) of all rays of a pixel, and the weight of one ray.

        That is their number times the steps of a grey value.
        """
        p = self.view.parameters
        middle = np.array([self._seconds(number)])
        exposure = p.exposure_time * _wave(p.exposure_change, p.exposure_period, float(middle[0]))
        pictures = p.blur_samples if p.exposure_time > 0.0 else 1
        n, count = p.supersampling, pictures * p.supersampling**2 * self._grey_values.steps
        kind = np.uint32 if count > 1 else np.uint8
        total = np.zeros((p.height, p.width, *self._colours), kind)
        for k in range(pictures):
            t = middle + exposure * ((k + 0.5) / pictures - 0.5)
            eyes = self._eyes(self._row_times(t, self._renderer.rows))
            for rows, rendered in self._renderer.pictures(eyes):
                picture = self._grey_values.of(rendered)
                for row, column in np.ndindex(n, n):
                    total[rows] += picture[row::n, column::n]
        return total, count

    def _row_times(self, t: Array, rows: Array) -> Array:
        """Return the time of each row of rays with a rolling shutter; else the single time."""
        p = self.view.parameters
        if p.row_time == 0.0:
            return t
        return t + p.row_time * (rows - 0.5 * (p.height - 1))


def textures(scene: Scene, parameters: SceneParameters, colour: bool) -> Atlas | Look:
    """Return the appearance of a scene, in colour or in grey values.

    :raises ConfigurationError: for a scene without surfaces.
    """
    if scene.mesh is None or scene.caster is None or not isinstance(parameters, MeshParameters):
        return atlas(scene.surfaces, parameters, colour, scene.painter, scene.crowd)
    sun = parameters.light == "sun" or (parameters.light == "auto" and not scene.mesh.painted)
    return Look(scene.mesh, scene.caster.middle, colour, sun)


def _wave(amplitude: float, period: float, seconds: float) -> float:
    """Return the factor ``1 + a sin(2 pi t / T)`` of a slow change."""
    return 1.0 + amplitude * math.sin(2.0 * math.pi * seconds / period)


@cache
def normal_quantiles() -> Single:
    """Return the 65536 quantiles of the normal distribution at ``(k + 1/2) / 65536``.

    One of them, drawn evenly, is a normal number in steps that are far below those of a grey value:
    its deviation is 1 to 1e-5, the largest is 4.3. Rounded to 2^-16, so that the last bits of a
    logarithm decide nothing.
    """
    from statistics import NormalDist

    inverse = NormalDist().inv_cdf
    upper = np.array([inverse((k + 0.5) / 65536.0) for k in range(32768, 65536)])
    upper = np.round(upper * 65536.0) / 65536.0
    return np.concatenate([-upper[::-1], upper]).astype(np.float32)
