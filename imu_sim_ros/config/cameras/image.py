# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a camera's images: exposure, optics and noise."""

from collections.abc import Iterator
from dataclasses import dataclass

from imu_sim_ros.config.imu import LONGEST
from imu_sim_ros.config.parameter import choice, flag, integer, number, text

IMAGES = ("raw", "compressed", "both", "none")
ENCODINGS = ("mono8", "rgb8")
MIP_LEVELS = ("nearest", "trilinear")


@dataclass(frozen=True)
class ImageParameters:
    """How an image comes about; grey values are 0 to 255."""

    images: str = choice(
        "raw",
        IMAGES,
        "messages on topics and in bags: raw: NAME/image_raw; compressed: "
        "NAME/image_raw/compressed, PNG; both; none: only tracks, for scenes without surfaces",
    )
    encoding: str = choice("mono8", ENCODINGS, "of the pixels: grey values, or colours")
    depth: bool = flag(
        False,
        "depth along the view without any error, too: NAME/depth/image_raw, 32FC1 in m; in EuRoC "
        "folders NAME/depth, PNG of 16 bits in mm; 0 where nothing is seen",
    )
    frame: str = text("", "frame of the messages; empty: NAME_optical_frame")
    supersampling: int = integer(
        1,
        "rays along each side of a pixel; 2 to 4 give realistically sharp edges",
        minimum=1,
        maximum=8,
    )
    mip_levels: str = choice(
        "nearest",
        MIP_LEVELS,
        "which levels of a texture a pixel looks at: the one that fits best, or both next to it",
    )
    exposure_time: float = number(
        0.0,
        "motion blur: how long the shutter is open; 0: an instant",
        unit="s",
        minimum=0.0,
        maximum=LONGEST,
    )
    blur_samples: int = integer(
        8, "instants combined into one blurred image", minimum=2, maximum=64
    )
    exposure_change: float = number(
        0.0,
        "amplitude of a slow variation of exposure_time, relative to it, as from automatic "
        "exposure; the grey values follow",
        unit="1",
        minimum=0.0,
        maximum=0.95,
    )
    exposure_period: float = number(
        10.0, "of that change", unit="s", minimum=0.0, above_minimum=True, maximum=LONGEST
    )
    gain: float = number(
        1.0, "factor applied to all grey values", minimum=0.0, above_minimum=True, maximum=1e6
    )
    gain_change: float = number(
        0.0,
        "amplitude of a slow variation of the gain, as from automatic exposure",
        minimum=0.0,
        maximum=0.95,
    )
    gain_period: float = number(
        10.0, "of that change", unit="s", minimum=0.0, above_minimum=True, maximum=LONGEST
    )
    vignetting: float = number(
        0.0,
        "darkening at the farthest corner; grows with the square of the distance",
        unit="1",
        minimum=0.0,
        maximum=1.0,
    )
    shot_noise: float = number(
        0.0,
        "standard deviation at grey value 255; proportional to the square root of the value",
        unit="grey value",
        minimum=0.0,
        maximum=1e6,
    )
    read_noise: float = number(
        1.0, "standard deviation at every grey value", unit="grey value", minimum=0.0, maximum=1e6
    )
    repeat_probability: float = number(
        0.0,
        "probability that a frame repeats the one before it",
        unit="1",
        minimum=0.0,
        maximum=1.0,
    )

    def problems(self, prefix: str) -> Iterator[str]:
        """Yield a line for each contradiction between parameters."""
        if self.exposure_change > 0.0 and self.exposure_time == 0.0:
            yield (
                f"{prefix}exposure_change = {self.exposure_change:g}: {prefix}exposure_time must "
                "be above 0 s for it"
            )
