# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random streams: one for each source and axis, derived from the seed and the source's name.

Because a stream depends on nothing but the seed and its own name, switching one source on or off
changes no other source's numbers, and because the numbers are drawn in the order of the samples,
they do not depend on the size of the blocks either.
"""

import ctypes
import itertools
import math
import zlib
from functools import lru_cache
from typing import Any, Final, TypeAlias, cast

import numpy as np
from numpy.random import SFC64, Generator, SeedSequence
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import DTypeLike, NDArray

from imu_sim_ros.core.conventions import AXES
from imu_sim_ros.core.types import Array, Integers

Seed: TypeAlias = "int | Integers"
"""Seed of one unit; or (count,), the seeds of the units of a batch."""
Units: TypeAlias = Any
"""Units of a batch, as an index of their arrays; ``...`` for all of them, or for one unit."""
Words: TypeAlias = NDArray[np.integer[Any]]
"""Words of 32 or 64 bits, as uint64."""


def generator(seed: int, source: str) -> Generator:
    """Return the random stream of one source.

    :param seed: the simulation's seed, 0 to 2^63 - 1.
    :param source: a stable name such as ``gyroscope.white_noise.x``.
    """
    return _stream(seed, _key(source))


def seed_of_node(name: str) -> int:
    """Return the default seed of a node: 0 for ``/simulator``, another for other names.

    :param name: namespace and name of the node.
    """
    return zlib.crc32(name.encode()) ^ zlib.crc32(b"/simulator")


def generator_at(seed: int, source: str, index: int) -> Generator:
    """Return the random stream of one source for one element of a sequence, such as a frame.

    The stream of an element does not depend on those of others: they can be drawn in any order.

    :param index: number of the element, >= 0.
    """
    return _stream(seed, _key(source), index)


def _stream(seed: int, *key: int) -> Generator:
    """Return the random stream of a key, the numbers that set it apart from others of the seed."""
    return Generator(SFC64(SeedSequence(entropy=seed, spawn_key=key)))


def axis_generators(seed: int, source: str) -> list[Generator]:
    """Return the streams of the three axes of one source."""
    return _generators(seed, (source,))


def _generators(seed: int, sources: tuple[str, ...]) -> list[Generator]:
    """Return the streams of the three axes of each of some sources."""
    states = _seed_words(_seed_pool_of_unit(seed), _axis_hashes(sources))
    # The stub of NumPy names one class of seed sequences, SFC64 takes each.
    sequences = (cast("SeedSequence", _SeedWords(state)) for state in states)
    return [Generator(SFC64(sequence)) for sequence in sequences]


def _key(source: str) -> int:
    """Return the number of a source's name, 32 bits."""
    return zlib.crc32(source.encode())


# NumPy seeds one stream at a time, and a unit has fifty of them, a batch a hundred thousand. The
# following is SeedSequence(entropy=seed, spawn_key=(key,)) over arrays of seeds and keys: M. E.
# O'Neill, "Developing a seed_seq alternative", 2015, with the constants of
# numpy/random/bit_generator.pyx.
_WORD: Final = 0xFFFFFFFF
_XSHIFT: Final = 16
_INIT_A, _MULT_A = 0x43B0D7E5, 0x931E8875
_INIT_B, _MULT_B = 0x8B51F9DD, 0x58F38DED
_MIX_L, _MIX_R = 0xCA01F9DD, 0x4973F715
_POOL: Final = 4
"""Number of words in the pool of entropy."""


def _constants(start: int, factor: int, count: int) -> Words:
    """Return the constants (2, count) of successive hashes: addends and factors."""
    values = [start]
    for _ in range(count):
        values.append(values[-1] * factor & _WORD)
    return np.array([values[:-1], values[1:]], np.uint64)


_POOL_CONSTANTS, _KEY_CONSTANTS = np.split(
    _constants(_INIT_A, _MULT_A, _POOL * _POOL + _POOL), [_POOL * _POOL], axis=1
)
"""Constants of the hashes of a seed (2, 16), and of a key (2, 4)."""
_STATE_CONSTANTS: Final = _constants(_INIT_B, _MULT_B, 6)
_STATE_WORDS: Final = np.arange(6) % _POOL
"""Indices of the pool's words in a state."""


def _hash(word: Words, constants: Words) -> Words:
    """Return the hashes of words of 32 bits by constants (2,) or, for words (..., k), (2, k)."""
    addend, factor = constants
    word = (word ^ addend) * factor & _WORD
    return word ^ word >> _XSHIFT


def _mix(x: Words, y: Words) -> Words:
    """Return the mixtures of pairs of words of 32 bits."""
    word = (_MIX_L * x - _MIX_R * y) & _WORD
    return word ^ word >> _XSHIFT


def _seed_pool(seeds: Words) -> Words:
    """Return the pools of entropy (..., 4) of seeds (...)."""
    constants = iter(_POOL_CONSTANTS.T)
    zero = np.zeros_like(seeds)
    pool = [_hash(word, next(constants)) for word in (seeds & _WORD, seeds >> 32, zero, zero)]
    for source, target in itertools.permutations(range(_POOL), 2):
        pool[target] = _mix(pool[target], _hash(pool[source], next(constants)))
    return np.stack(pool, axis=-1)


@lru_cache(maxsize=8)
def _seed_pool_of_unit(seed: int) -> Words:
    """Return the pool of entropy (4,) of one seed, from which all streams of a unit begin."""
    return SeedSequence(seed).pool.astype(np.uint64)


@lru_cache(maxsize=256)
def _axis_hashes(sources: tuple[str, ...]) -> Words:
    """Return the hashes (3 m, 4) of the names of m sources' axes, which no seed is in."""
    keys = [_key(f"{source}.{axis}") for source in sources for axis in AXES]
    return _hash(np.array(keys, np.uint64)[:, None], _KEY_CONSTANTS)


def _seed_words(pool: Words, hashes: Words) -> Words:
    """Return the three words (..., 3) of 64 bits from which SFC64 starts.

    :param pool: (..., 4) of seeds.
    :param hashes: (..., 4) of names.
    """
    halves = _hash(_mix(pool, hashes).take(_STATE_WORDS, axis=-1), _STATE_CONSTANTS)
    return halves[..., ::2] | halves[..., 1::2] << 32


class _SeedWords(ISeedSequence):
    """The words from which one stream starts, as NumPy's generators take them."""

    def __init__(self, state: Words) -> None:
        self._state = state

    def generate_state(
        self, n_words: int, dtype: DTypeLike = np.uint64
    ) -> NDArray[np.uint32 | np.uint64]:
        """Return the words (3,) of 64 bits that SFC64 asks for."""
        assert n_words == len(self._state)
        return np.ascontiguousarray(self._state, dtype)


_ROUNDS: Final = 12
"""Rounds of SFC64 before its first number."""
_BYTES: Final = 32
"""Size of a state of SFC64: three words and a counter."""


def initial_states(seeds: Integers, *sources: str) -> Words:
    """Return the states (count, 3 m, 4) of :func:`axis_generators` of m sources for each seed.

    A state of SFC64 is three words, here from the seed, and a counter from 1; rounds of the
    generator mix them, as NumPy's SFC64 does when it is seeded.

    :param seeds: (count,) seeds of the units.
    """
    pool = _seed_pool(np.asarray(seeds, np.uint64))[..., None, :]
    a, b, c = np.moveaxis(_seed_words(pool, _axis_hashes(sources)), -1, 0)
    counter = np.ones(a.shape, np.uint64)
    for _ in range(_ROUNDS):
        value = a + b + counter
        counter = counter + np.uint64(1)
        a = b ^ (b >> np.uint64(11))
        b = c + (c << np.uint64(3))
        c = (c << np.uint64(24) | c >> np.uint64(40)) + value
    return np.stack([a, b, c, counter], axis=-1)


class Streams:
    """Random streams of sources: for each axis of one unit, or of each unit of a batch.

    The streams of one unit are NumPy's generators. A batch has a hundred thousand streams, for
    which generators of 1 kB are too large: each is kept as the 32 bytes of its state, and one
    generator takes the states in turn, through the address that NumPy publishes for ctypes.
    """

    def __init__(self, seed: Seed, *sources: str, numbers: str = "standard_normal") -> None:
        """Begin all streams.

        :param seed: referred to, not copied: a batch changes its array before units begin again.
        :param numbers: method of the generator: ``standard_normal``, or ``random``, from 0 to 1.
        """
        self._seed, self._sources, self._numbers = seed, sources, numbers
        self._generators: list[Generator] = []
        """Generators (3 m) of one unit; none for a batch."""
        if np.ndim(seed):
            shape = (*np.shape(seed), len(AXES) * len(sources))
            self._indices = np.arange(math.prod(shape)).reshape(shape)
            """Indices (*units, 3 m) of the streams in the list of states of a batch."""
            self._states = [b""] * self._indices.size
            self._prepare()
        self.begin(...)

    def _prepare(self) -> None:
        """Prepare to draw from the generators of one unit, or through the generator of a batch."""
        self._draws = [getattr(stream, self._numbers) for stream in self._generators]
        if not np.ndim(self._seed):
            return
        bits = SFC64(0)
        self._draw = getattr(Generator(bits), self._numbers)
        self._state = (ctypes.c_char * _BYTES).from_address(bits.ctypes.state_address)

    def __getstate__(self) -> dict[str, object]:
        """Return the attributes of a copy, which prepares to draw anew."""
        prepared = ("_draws", "_draw", "_state")
        return {name: value for name, value in vars(self).items() if name not in prepared}

    def __setstate__(self, state: dict[str, object]) -> None:
        """Restore a copy."""
        vars(self).update(state)
        self._prepare()

    def begin(self, units: Units) -> None:
        """Begin the streams of some units, from their present seeds."""
        if not np.ndim(self._seed):
            self._generators = _generators(int(self._seed), self._sources)
            self._prepare()
            return
        seeds = np.asarray(self._seed)[units]
        states = initial_states(seeds, *self._sources).tobytes()
        for k, index in enumerate(self._indices[units].ravel().tolist()):
            self._states[index] = states[k * _BYTES : (k + 1) * _BYTES]

    def next(self, count: int, units: Units = ..., axes: Any = slice(None)) -> Array:
        """Return the next numbers (count, *units, axes) of some units; axes: 3 m, by source."""
        if self._draws:
            draws = self._draws[axes] if isinstance(axes, slice) else [self._draws[k] for k in axes]
            numbers = np.empty((count, len(draws)), order="F")
            for draw, column in zip(draws, numbers.T, strict=True):
                draw(out=column)
            return numbers
        indices = self._indices[units][..., axes]
        numbers = np.empty((count, *indices.shape), order="F")
        rows = numbers.reshape(count, indices.size, order="F").T
        state, states, draw = self._state, self._states, self._draw
        for index, row in zip(indices.ravel("F").tolist(), rows, strict=True):
            state.raw = states[index]
            draw(out=row)
            states[index] = state.raw
        return numbers


def axes_first(numbers: Array) -> Array:
    """Return numbers (count, *units, axes) of streams as (*units, axes, count), without a copy."""
    return numbers.transpose(*range(1, numbers.ndim), 0)
