# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of the visible surfaces of an image, which the compiled loops read."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.types import Array, Integers, Mask, Single
from imu_sim_ros.places.geometry import Floats
from imu_sim_ros.places.mesh_file import Numbers
from imu_sim_ros.sensors.camera.images.finish import Glossy, Shades
from imu_sim_ros.sensors.camera.images.planes import Pairs, Planes


class Visible(NamedTuple):
    """Rectangles that may be visible in an image, with their cells, textures, shadows and gloss."""

    planes: Planes
    pairs: Pairs
    """Pairs of cells and rectangles, by their numbers in ``planes``."""
    patches: NDArray[np.void]
    """Texture mapping of each pair."""
    shades: Shades
    gloss: Glossy
    """Glossy regions of the pairs."""


class Triangles(NamedTuple):
    """Appearance of m triangles."""

    texture: Numbers
    """(m,) number of each triangle's texture in the atlas."""
    uv: Single
    """(8, m) coefficients of u and v; (0, 0): nothing has a texture."""
    density: Single
    """(m,) square of the texels along a metre where they are densest."""
    tints: Single
    """(4 c, m) coefficients of the colours, 0 to 255; (0, 0): textures are all that there is."""
    shades: Single
    """(2, m) factors of the colours seen from the front, and from behind; or (0, 0)."""


class MeshHits(NamedTuple):
    """Nearest intersections of n rays with a mesh, and their geometry."""

    number: Integers
    """(n,) number of the triangle; 0 for nothing."""
    nothing: Mask
    """(n,) True for rays that hit nothing."""
    distance: Floats
    """(n,) distances; infinite: nothing."""
    along: Array
    """(n,) triangle's normal times the ray's direction."""
    point: Single
    """(3, n) intersections, from the mesh's middle [m]."""
    way: Single
    """(n, 3) unit vectors along the rays in the world."""

    def some(self, which: Integers) -> "MeshHits":
        """Return the intersections of some of the rays."""
        return MeshHits(
            number=self.number.take(which),
            nothing=self.nothing.take(which),
            distance=self.distance.take(which),
            along=self.along.take(which),
            point=self.point.take(which, axis=1),
            way=self.way.take(which, axis=0),
        )
