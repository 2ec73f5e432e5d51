# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All places by name, with their default sizes."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.errors import ConfigurationError
from imu_sim_ros.places.corridor import corridor
from imu_sim_ros.places.machine_hall import machine_hall
from imu_sim_ros.places.office import office
from imu_sim_ros.places.place import Build, Place, Site
from imu_sim_ros.places.street import street
from imu_sim_ros.places.warehouse import warehouse
from imu_sim_ros.types import Array


class Kind(NamedTuple):
    """A kind of place."""

    build: Build
    size: tuple[float, float, float]
    """Length along x, y and z of one that fits no path [m]."""
    margin: float
    """Distance of its walls from a path that it fits [m]."""
    above: float
    """Distance of its ceiling from the highest place of such a path [m]."""
    least: tuple[float, float, float]
    """Least size [m]."""
    most: tuple[float, float, float]
    """Largest size, so that light and images do not take minutes [m]."""


KINDS: Final[dict[str, Kind]] = {
    "office": Kind(office, (13.0, 9.4, 2.8), 2.4, 1.0, (8.0, 6.0, 2.7), (26.0, 20.0, 8.0)),
    "corridor": Kind(corridor, (36.0, 2.4, 2.7), 1.0, 1.0, (12.0, 2.2, 2.5), (150.0, 150.0, 20.0)),
    "warehouse": Kind(warehouse, (26.0, 15.0, 6.5), 5.0, 1.0, (16.0, 9.0, 5.0), (60.0, 40.0, 12.0)),
    "machine_hall": Kind(
        machine_hall, (20.0, 13.0, 6.5), 8.0, 4.0, (12.0, 9.0, 5.0), (60.0, 40.0, 20.0)
    ),
    "street": Kind(street, (60.0, 16.0, 12.0), 4.0, 1.0, (40.0, 12.0, 8.0), (150.0, 150.0, 60.0)),
}
_BELOW: Final = 0.3
"""Distance of the floor from the lowest place of a path [m]."""


def around(kind: str, path: Array) -> tuple[Array, Array]:
    """Return the corners (3,) of a place of some kind that fits a path (n, 3) [m].

    :raises ConfigurationError: for a path that is too large for it.
    """
    margin, above, least = KINDS[kind].margin, KINDS[kind].above, np.array(KINDS[kind].least)
    low = path.min(axis=0) - np.array([margin, margin, _BELOW])
    high = path.max(axis=0) + np.array([margin, margin, above])
    missing = np.maximum(least - (high - low), 0.0)
    low[:2] -= 0.5 * missing[:2]
    high[:2] += 0.5 * missing[:2]
    high[2] += missing[2]
    if (high - low > KINDS[kind].most).any():
        needed, most = (
            " x ".join(f"{length:.1f}" for length in size)
            for size in (high - low, KINDS[kind].most)
        )
        raise ConfigurationError(
            f"scene.type = {kind!r}: around the path it would have {needed} m; at most {most} m: "
            "another scene, a shorter trajectory.length, or a shorter scene.horizon"
        )
    return low, high


def size_problems(kind: str, size: Sequence[float], name: str) -> Iterator[str]:
    """Yield whether only some sides are given, or too little for the place.

    :param size: along x, y, z [m]; 0: as usual.
    """
    if any(size) and not all(size):
        yield f"{name} = {list(size)}: must be 0 or above 0 m on all axes"
    elif any(size):
        limits = zip("xyz", size, KINDS[kind].least, KINDS[kind].most, strict=True)
        for axis, length, least, most in limits:
            if not least <= length <= most:
                yield (
                    f"{name} = {list(size)}: along {axis} must be {least:g} to {most:g} m "
                    f"for {kind}"
                )


def usual(kind: str, size: Sequence[float]) -> tuple[Array, Array]:
    """Return the corners (3,) of a place of a size, or of its usual one, around x = y = 0 [m].

    Its floor is at z = 0.
    """
    whole = np.array(size if any(size) else KINDS[kind].size, np.float64)
    low = np.array([-0.5 * whole[0], -0.5 * whole[1], 0.0])
    return low, low + whole


def build(kind: str, site: Site) -> Place:
    """Return a place of some kind."""
    return KINDS[kind].build(site)
