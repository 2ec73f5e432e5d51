# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random streams: one for each source and axis, derived from the seed and the source's name.

Because a stream depends on nothing but the seed and its own name, switching one source on or off
changes no other source's numbers, and because the numbers are drawn in the order of the samples,
they do not depend on the size of the blocks either.
"""

import zlib
from typing import Final

import numpy as np
from numpy.random import SFC64, Generator, SeedSequence

from imu_sim_ros.conventions import AXES

_WORD: Final = 0xFFFFFFFF


def generator(seed: int, source: str) -> Generator:
    """Return the random stream of one source.

    :param seed: the simulation's seed, 0 to 2^63 - 1.
    :param source: a stable name such as ``gyroscope.white_noise.x``.
    """
    key = zlib.crc32(source.encode())
    # The same as SeedSequence with entropy=seed and spawn_key=(key,): a run has some fifty streams.
    words = np.array([seed & _WORD, seed >> 32, 0, 0, key], np.uint32)
    return Generator(SFC64(SeedSequence(words)))


def seed_of_node(name: str) -> int:
    """Return the seed of a node that is given none: 0 for ``/simulator``, another for others.

    :param name: its namespace and name.
    """
    return zlib.crc32(name.encode()) ^ zlib.crc32(b"/simulator")


def generator_at(seed: int, source: str, index: int) -> Generator:
    """Return the random stream of one source for one item, a frame for instance.

    What an item draws depends on nothing drawn before, so items can be generated in any order.

    :param index: of the item, >= 0.
    """
    key = (zlib.crc32(source.encode()), index)
    return Generator(SFC64(SeedSequence(entropy=seed, spawn_key=key)))


def axis_generators(seed: int, source: str) -> list[Generator]:
    """Return the streams of the three axes of one source."""
    return [generator(seed, f"{source}.{axis}") for axis in AXES]
