# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Textures of a mesh: their sizes are checked before they are decoded; equal ones are held once."""

import io
import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from imu_sim_ros.core.errors import InputError
from imu_sim_ros.core.types import Bytes

if TYPE_CHECKING:
    from PIL.Image import Image

LARGEST: Final = 1 << 26
"""Texels of a texture in a file, 8192 x 8192; while it is decoded each takes four bytes."""
_AT_MOST: Final = f"at most {LARGEST:,} texels, as of 8192 x 8192: make it smaller"
MOST_TEXELS: Final = 36_000_000
"""Largest number of texels of all textures in memory, for a mesh of few triangles."""
_OF_A_TRIANGLE: Final = 32
"""Texels that need as much memory as a triangle."""
_LONGEST: Final = 8000
"""Side of a texture [texels] that is not halved."""


def examine(content: bytes, what: str) -> None:
    """Check the header of a picture, since trimesh leaves out pictures that Pillow refuses.

    :param what: first words of the error.
    :raises InputError: for what is no picture, or too large a one.
    """
    import PIL.Image

    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            with PIL.Image.open(io.BytesIO(content)) as image:
                size = image.size
    except PIL.Image.DecompressionBombError as error:
        raise InputError(f"{what} is too large: {error}; {_AT_MOST}") from None
    except MemoryError:
        raise
    except Exception:  # damaged pictures raise errors of many classes in Pillow's readers
        raise InputError(f"{what} is no picture") from None
    _check_size(size, what)


def _check_size(size: tuple[int, int], what: str) -> None:
    """Refuse a texture with too many texels."""
    if size[0] * size[1] > LARGEST:
        raise InputError(f"{what} is too large: {size[0]} x {size[1]} texels; {_AT_MOST}")


class Textures:
    """The distinct textures of a mesh's parts."""

    def __init__(self, path: Path, images: "Sequence[Image]", triangles: int) -> None:
        """Check the sizes of Pillow's images, some of which may be the same object.

        :raises InputError: for one that is too large.
        """
        self._path = path
        self._images = list({id(image): image for image in images}.values())
        self._numbers = {id(image): n for n, image in enumerate(self._images)}
        sizes = [image.size for image in self._images]
        for size in sizes:
            _check_size(size, f"{path}: a texture")
        self._steps = _steps(sizes, max(0, MOST_TEXELS - _OF_A_TRIANGLE * triangles))

    def number(self, image: "Image") -> int:
        """Return the index of an image among those of :meth:`decode_all`."""
        return self._numbers[id(image)]

    def decode_all(self) -> tuple[Bytes, ...]:
        """Return all textures in red, green and blue (h, w, 3), reduced to the limit; frees images.

        :raises InputError: for one that is damaged.
        """
        return tuple(map(self._decode, self._images, self._steps))

    def _decode(self, image: "Image", step: int) -> Bytes:
        """Return a texture as means of ``step`` x ``step`` texels, computed band by band."""
        width, height = image.size[0] // step, image.size[1] // step
        result = np.empty((height, width, 3), np.uint8)
        rows = max(1, (1 << 20) // (width * step * step))
        try:
            for top in range(0, height, rows):
                bottom = min(height, top + rows)
                band = image.crop((0, top * step, width * step, bottom * step)).convert("RGB")
                result[top:bottom] = _means(np.asarray(band, np.uint8), step)
            image.close()
        except MemoryError:
            raise
        except Exception as error:  # whatever a file makes Pillow stumble over
            raise InputError(f"{self._path}: a texture cannot be read ({error})") from None
        return result


def _steps(sizes: Sequence[tuple[int, int]], limit: int) -> list[int]:
    """Return the power of two by which each texture is reduced to stay within a limit [texels]."""
    area = sum(width * height for width, height in sizes)
    halvings = math.ceil(0.5 * math.log2(area / max(limit, 1))) if area else 0
    steps = []
    for size in sizes:
        minimum = math.ceil(math.log2(max(size) / _LONGEST))
        steps.append(2 ** min(max(minimum, halvings, 0), int(math.log2(min(size)))))
    return steps


def _means(band: Bytes, step: int) -> Bytes:
    """Return the rounded means of squares of ``step`` x ``step`` texels of a band (h, w, 3)."""
    if step == 1:
        return band
    shape = band.shape[0] // step, band.shape[1] // step, 3
    total = np.full(shape, step * step // 2, np.uint32)
    for i, j in np.ndindex(step, step):
        total += band[i::step, j::step]
    return (total // (step * step)).astype(np.uint8)
