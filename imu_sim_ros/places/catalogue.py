# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All places by name, with their default sizes."""

import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.core.spelling import argument
from imu_sim_ros.core.types import AnyArray, Array
from imu_sim_ros.places.corridor import corridor
from imu_sim_ros.places.machine_hall import machine_hall
from imu_sim_ros.places.office import office
from imu_sim_ros.places.place import Build, Place, Site
from imu_sim_ros.places.street import street
from imu_sim_ros.places.warehouse import warehouse


class Kind(NamedTuple):
    """A kind of place, such as an office, with its usual and possible sizes."""

    build: Build
    """Returns the place on a site."""
    size: tuple[float, float, float]
    """Usual size along x, y and z, of a place that is not fitted to a path [m]."""
    margin: float
    """Distance of the walls from a path to which the place is fitted [m]."""
    headroom: float
    """Distance of the ceiling from the highest point of such a path [m]."""
    smallest: tuple[float, float, float]
    """Smallest size [m]."""
    largest: tuple[float, float, float]
    """Largest size, so that light and images do not take minutes [m]."""
    long: bool = False
    """True if it runs along the longer of x and y; its sizes are length, width and height."""
    fits: tuple[float, float, float] = (math.inf, math.inf, math.inf)
    """Largest size around a path: a larger place would not be of this kind [m]."""

    def sides(self, values: Sequence[object] | Array, extent: Sequence[float] | Array) -> AnyArray:
        """Return three values, such as sizes, in the order of the axes of an extent (3,) [m]."""
        turned = self.long and extent[1] > extent[0]
        return np.asarray(values)[[1, 0, 2] if turned else [0, 1, 2]]


KINDS: Final[dict[str, Kind]] = {
    "office": Kind(office, (13.0, 9.4, 2.8), 2.4, 1.0, (8.0, 6.0, 2.7), (26.0, 20.0, 8.0)),
    "corridor": Kind(
        corridor,
        (36.0, 2.4, 2.7),
        0.6,
        1.0,
        (12.0, 2.2, 2.5),
        (150.0, 150.0, 20.0),
        long=True,
        fits=(150.0, 4.0, 4.5),
    ),
    "warehouse": Kind(warehouse, (26.0, 15.0, 6.5), 5.0, 1.0, (16.0, 9.0, 5.0), (60.0, 40.0, 12.0)),
    "machine_hall": Kind(
        machine_hall, (20.0, 13.0, 6.5), 8.0, 4.0, (12.0, 9.0, 5.0), (60.0, 40.0, 20.0)
    ),
    "street": Kind(
        street, (60.0, 16.0, 12.0), 4.0, 1.0, (40.0, 12.0, 8.0), (150.0, 150.0, 60.0), long=True
    ),
}
_AXES: Final = ("along x", "along y", "high")
_BELOW: Final = 0.3
"""Distance of the floor from the lowest place of a path [m]."""


def around(name: str, path: Array, foot: float) -> tuple[Array, Array]:
    """Return the corners (3,) of a place of some kind that fits a path (n, 3) [m].

    :param foot: lowest place of the body, which the floor is not above [m].
    :raises ConfigurationError: for a path that is too large for it.
    """
    kind = KINDS[name]
    low = path.min(axis=0) - np.array([kind.margin, kind.margin, _BELOW])
    low[2] = min(low[2], foot)
    high = path.max(axis=0) + np.array([kind.margin, kind.margin, kind.headroom])
    extent = high - low
    missing = np.maximum(kind.sides(kind.smallest, extent) - extent, 0.0)
    low[:2] -= 0.5 * missing[:2]
    high[:2] += 0.5 * missing[:2]
    high[2] += missing[2]
    limits = kind.sides(np.minimum(kind.largest, kind.fits), extent)
    adjectives = kind.sides(["long", "wide", "high"], extent) if kind.long else _AXES
    too_large = [
        f"{length:.1f} m {word} (at most {limit:g} m)"
        for length, word, limit in zip(high - low, adjectives, limits, strict=True)
        if length > limit
    ]
    if too_large:
        raise ConfigurationError(
            f"scene.type = {name!r}: around the path it would be {', '.join(too_large)}: "
            f"{argument('trajectory', 'tour')} walks through it; else another scene, a shorter "
            "trajectory.length, "
            "or a shorter scene.horizon"
        )
    return low, high


def describe_stretch(name: str, low: Array, high: Array) -> str:
    """Return a sentence on the size of a place around a path, and on the usual one."""
    size = high - low
    usual_size = KINDS[name].sides(KINDS[name].size, size)
    factors = " x ".join(f"{factor:.2f}" for factor in size / usual_size)
    return (
        f"scene.type {name}: {_metres(size)} m around the path, {factors} of the usual "
        f"{_metres(usual_size)} m"
    )


def _metres(size: Array) -> str:
    """Return a size as text: 8.0 x 6.0 x 3.0."""
    return " x ".join(f"{length:.1f}" for length in size)


def size_problems(name: str, size: Sequence[float], parameter: str) -> Iterator[str]:
    """Yield a line for a size with only some of its sides, and for sides out of range.

    :param size: along x, y, z [m]; 0: as usual.
    """
    if any(size) and not all(size):
        yield f"{parameter} = {list(size)}: must be 0 or above 0 m on all axes"
    elif any(size):
        kind = KINDS[name]
        limits = zip("xyz", size, *(kind.sides(e, size) for e in (kind.smallest, kind.largest)),
                     strict=True)  # fmt: skip
        for axis, length, minimum, maximum in limits:
            if not minimum <= length <= maximum:
                yield (
                    f"{parameter} = {list(size)}: along {axis} must be {minimum:g} to {maximum:g} "
                    f"m for {name}"
                )


def usual(kind: str, size: Sequence[float]) -> tuple[Array, Array]:
    """Return the corners (3,) of a place of a size, or of its usual one, around x = y = 0 [m].

    Its floor is at z = 0.
    """
    whole = np.array(size if any(size) else KINDS[kind].size, np.float64)
    low = np.array([-0.5 * whole[0], -0.5 * whole[1], 0.0])
    return low, low + whole


def build(kind: str, site: Site) -> Place:
    """Return a place of a kind in ``KINDS``, built on a site."""
    return KINDS[kind].build(site)
