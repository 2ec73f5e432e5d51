# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The images of one camera: pictures over the exposure, optics, noise, grey values."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.camera.images.renderer import Renderer, look_up, opencv
from imu_sim_ros.camera.images.texture import Atlas
from imu_sim_ros.camera.scene import Scene
from imu_sim_ros.camera.view import View
from imu_sim_ros.trajectory import Trajectory

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]

_FULL: Final = 255.0


class Imager:
    """Images of one camera, each from its number alone; may be used by several threads."""

    def __init__(self, view: View, scene: Scene, atlas: Atlas, trajectory: Trajectory) -> None:
        """Set up the camera.

        :raises MissingDependencyError: where OpenCV is not installed.
        """
        opencv()
        self.view, self.atlas, self._trajectory = view, atlas, trajectory
        p = view.parameters
        self._renderer = Renderer(view.model, scene.surfaces, atlas, p.supersampling)
        self._vignette = _vignette(view)

    def image(self, number: int) -> Bytes:
        """Return frame ``number`` (h, w), grey values."""
        content = self._content(number)
        p = self.view.parameters
        total, count = self._light(content)
        noisy = p.read_noise > 0.0 or p.shot_noise > 0.0
        seconds = float(self.view.seconds(self.view.frames(content, 1).true_t_ns)[0])
        gain = p.gain * (1.0 + p.gain_change * np.sin(2.0 * np.pi * seconds / p.gain_period))
        if not noisy and gain == 1.0 and self._vignette is None:
            rounded: Bytes = ((total + count // 2) // count).astype(np.uint8)
            return rounded
        level = total * (gain / count)
        if self._vignette is not None:
            level *= self._vignette
        if noisy:
            variance = p.read_noise**2 + p.shot_noise**2 / _FULL * level
            noise = self.view.stream("image_noise", content)
            level += np.sqrt(variance) * noise.standard_normal(level.shape)
        grey: Bytes = np.clip(np.rint(level), 0.0, _FULL).astype(np.uint8)
        return grey

    def depth(self, number: int) -> NDArray[np.float32]:
        """Return the depth z (h, w) [m] at the middle of the exposure of a frame; 0: nothing."""
        t = self.view.seconds(self.view.frames(number, 1).true_t_ns)
        depth = self._renderer.depth(self.view.poses(self._trajectory, self._row_times(t)))
        scale = self._renderer.scale
        return depth[scale // 2 :: scale, scale // 2 :: scale]

    def _content(self, number: int) -> int:
        """Return which frame's content a frame shows: its own, or that of one before it."""
        p = self.view.parameters
        while number > 0 and p.repeat_probability > 0.0:
            if self.view.stream("repeat", number).random() >= p.repeat_probability:
                break
            number -= 1
        return number

    def _light(self, number: int) -> tuple[NDArray[np.uint32], int]:
        """Return the sum (h, w) of the grey values of all rays of a pixel, and their number."""
        p = self.view.parameters
        middle = self.view.seconds(self.view.frames(number, 1).true_t_ns)
        pictures = p.blur_samples if p.exposure_time > 0.0 else 1
        total = np.zeros((p.height, p.width), np.uint32)
        n = p.supersampling
        for k in range(pictures):
            t = middle + p.exposure_time * ((k + 0.5) / pictures - 0.5)
            poses = self.view.poses(self._trajectory, self._row_times(t))
            picture = look_up(self.atlas.image, self._renderer.maps(poses))
            for row in range(n):
                for column in range(n):
                    total += picture[row::n, column::n]
        return total, pictures * n * n

    def _row_times(self, t: Array) -> Array:
        """Return the time of each row of rays with a rolling shutter, else the one time."""
        p = self.view.parameters
        if p.row_time == 0.0:
            return t
        return t + p.row_time * (self._renderer.rows - 0.5 * (p.height - 1))


def _vignette(view: View) -> Array | None:
    """Return ``1 - v (r / r_corner)^2`` (h, w) with r from the principal point; None: all 1."""
    p, model = view.parameters, view.model
    if p.vignetting == 0.0:
        return None
    u, v = np.meshgrid(np.arange(p.width) - model.cx, np.arange(p.height) - model.cy)
    square = u * u + v * v
    result: Array = 1.0 - p.vignetting * square / square.max()
    return result
