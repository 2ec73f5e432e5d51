# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random streams: one for each source and axis, derived from the seed and the source's name.

Because a stream depends on nothing but the seed and its own name, switching one source on or off
changes no other source's numbers, and because the numbers are drawn in the order of the samples,
they do not depend on the size of the blocks either.
"""

import ctypes
import math
import zlib
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.random import SFC64, Generator, SeedSequence
from numpy.typing import NDArray

from imu_sim_ros.conventions import AXES
from imu_sim_ros.types import Array, Integers

Seed: TypeAlias = "int | Integers"
"""Of one unit; or (count,), those of the units of a batch."""
Units: TypeAlias = Any
"""Which units of a batch, as an index of their arrays; ``...`` for all of them, or for one unit."""
Words: TypeAlias = NDArray[np.uint64]
_Words32: TypeAlias = NDArray[np.uint32]

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


_XSHIFT: Final = 16
_INIT_A, _MULT_A = 0x43B0D7E5, 0x931E8875
_INIT_B, _MULT_B = 0x8B51F9DD, 0x58F38DED
_MIX_L, _MIX_R = 0xCA01F9DD, 0x4973F715
_POOL: Final = 4
_ROUNDS: Final = 12
_BYTES: Final = 32
"""Of a state of SFC64: three words and a counter."""


def initial_states(seeds: Integers, *sources: str) -> Words:
    """Return the states (count, 3 m, 4) of :func:`axis_generators` of m sources for each seed.

    SeedSequence (M. E. O'Neill, "Developing a seed_seq alternative", 2015, as NumPy has it) and the
    start of SFC64, for many seeds at once: a fiftieth of the time of a generator each, and a batch
    begins in a tenth of the time. For one seed, generators take a tenth of the time of this.
    """
    seeds = np.asarray(seeds, np.int64)[..., None]
    low, high = (seeds & _WORD).astype(np.uint32), (seeds >> 32).astype(np.uint32)
    names = [f"{source}.{axis}".encode() for source in sources for axis in AXES]
    keys = np.array([zlib.crc32(name) for name in names], np.uint32)
    shape = np.broadcast_shapes(seeds.shape, keys.shape)
    words = [np.broadcast_to(word, shape) for word in (low, high, np.uint32(0), np.uint32(0), keys)]
    constant = _INIT_A

    def hashed(value: _Words32) -> _Words32:
        nonlocal constant
        value = value ^ np.uint32(constant)
        constant = constant * _MULT_A & _WORD
        value = value * np.uint32(constant)
        return value ^ (value >> np.uint32(_XSHIFT))

    def mixed(x: _Words32, y: _Words32) -> _Words32:
        result = np.uint32(_MIX_L) * x - np.uint32(_MIX_R) * y
        return result ^ (result >> np.uint32(_XSHIFT))

    # SeedSequence.mix_entropy: a pool of four words from those of the entropy.
    pool = [hashed(word) for word in words[:_POOL]]
    for source in range(_POOL):
        for target in range(_POOL):
            if source != target:
                pool[target] = mixed(pool[target], hashed(pool[source]))
    for word in words[_POOL:]:
        for target in range(_POOL):
            pool[target] = mixed(pool[target], hashed(word))
    made, constant = [], _INIT_B
    for k in range(6):  # SeedSequence.generate_state: three words of 64 bits
        value = pool[k % _POOL] ^ np.uint32(constant)
        constant = constant * _MULT_B & _WORD
        value = value * np.uint32(constant)
        made.append((value ^ (value >> np.uint32(_XSHIFT))).astype(np.uint64))
    a, b, c = (made[2 * k] | made[2 * k + 1] << np.uint64(32) for k in range(3))
    counter = np.ones(shape, np.uint64)
    for _ in range(_ROUNDS):
        value = a + b + counter
        counter = counter + np.uint64(1)
        a = b ^ (b >> np.uint64(11))
        b = c + (c << np.uint64(3))
        c = (c << np.uint64(24) | c >> np.uint64(40)) + value
    return np.stack([a, b, c, counter], axis=-1)


class Streams:
    """Numbers of sources: a random stream for each axis of one unit, or of each unit of a batch.

    For a batch one generator draws for all: a stream is its state, 80 bytes as an object, where a
    generator would take 1 kB, and a batch has a hundred thousand streams. Of all ways to put a
    state into the generator and to get it back, ctypes' bytes take the least time.
    """

    def __init__(self, seed: Seed, *sources: str, numbers: str = "standard_normal") -> None:
        """Begin all streams.

        :param seed: kept as it is: a batch changes its array and lets units begin again.
        :param numbers: ``standard_normal``, or ``random``, from 0 to 1.
        """
        self._seed, self._sources, self._numbers = seed, sources, numbers
        shape = (*np.shape(seed), len(AXES) * len(sources))
        self._indices = np.arange(math.prod(shape)).reshape(shape)
        """(*units, 3 m) of the streams in the list of states."""
        self._states = [b""] * self._indices.size if np.ndim(seed) else []
        self._generators: list[Generator] = []
        """Those of one unit, by stream."""
        if np.ndim(seed):
            self._make_generator()
        self.begin(...)

    def _make_generator(self) -> None:
        """Make the generator that draws for all streams, and the place of its state."""
        bits = SFC64(0)
        self._draw = getattr(Generator(bits), self._numbers)
        self._state = (ctypes.c_char * _BYTES).from_address(bits.ctypes.state_address)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy needs; it draws by a generator of its own."""
        return {name: one for name, one in vars(self).items() if name not in ("_draw", "_state")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Become a copy."""
        vars(self).update(state)
        if not self._generators:
            self._make_generator()

    def begin(self, units: Units) -> None:
        """Let the streams of some units begin, or begin again, from their present seeds."""
        if not np.ndim(self._seed):
            every = (axis_generators(int(self._seed), source) for source in self._sources)
            self._generators = [stream for streams in every for stream in streams]
            return
        seeds = np.asarray(self._seed)[units]
        states = initial_states(seeds, *self._sources).tobytes()
        for k, index in enumerate(self._indices[units].ravel().tolist()):
            self._states[index] = states[k * _BYTES : (k + 1) * _BYTES]

    def next(self, count: int, units: Units = ..., axes: Any = slice(None)) -> Array:
        """Return the next numbers (count, *units, axes) of some units and axes, by source."""
        indices = self._indices[units][..., axes]
        numbers = np.empty((count, *indices.shape), order="F")
        rows = numbers.reshape(count, indices.size, order="F").T
        pairs = zip(indices.ravel("F").tolist(), rows, strict=True)
        if self._generators:
            for index, row in pairs:
                getattr(self._generators[index], self._numbers)(out=row)
            return numbers
        generator, states, draw = self._state, self._states, self._draw
        for index, row in pairs:
            generator.raw = states[index]
            draw(out=row)
            states[index] = generator.raw
        return numbers
