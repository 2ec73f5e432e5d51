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
from typing import Any, Final, TypeAlias, TypeVar, cast

import numpy as np
from numpy.random import SFC64, Generator, SeedSequence
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import NDArray

from imu_sim_ros.core.conventions import AXES
from imu_sim_ros.core.types import Array, Integers

Seed: TypeAlias = "int | Integers"
"""Of one unit; or (count,), those of the units of a batch."""
Units: TypeAlias = Any
"""Which units of a batch, as an index of their arrays; ``...`` for all of them, or for one unit."""
Words: TypeAlias = NDArray[np.uint64]

_Numbers: TypeAlias = NDArray[np.integer[Any]]
_Word = TypeVar("_Word", int, _Numbers)
_PoolWords: TypeAlias = tuple[_Word, _Word, _Word, _Word]


class _SeedWords(ISeedSequence):
    """The words from which one SFC64 starts, already computed."""

    def __init__(self, words: Words) -> None:
        self._words = words

    def generate_state(self, n_words: int, dtype: Any = np.uint32) -> Words:
        """Return the three words of 64 bits that SFC64 asks for."""
        return self._words


def generator(seed: int, source: str) -> Generator:
    """Return the random stream of one source.

    :param seed: the simulation's seed, 0 to 2^63 - 1.
    :param source: a stable name such as ``gyroscope.white_noise.x``.
    """
    key, words = _key(source), _words_of_seed(seed)
    if key not in words:
        words[key] = np.array(_seed_words(_pool_of_seed(seed), key), np.uint64)
        if len(_keys) < _MOST_KEYS:
            _keys[key] = None
    sequence = cast(SeedSequence, _SeedWords(words[key]))  # stubs know no other ISeedSequence
    return Generator(SFC64(sequence))


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
    key = (_key(source), index)
    return Generator(SFC64(SeedSequence(entropy=seed, spawn_key=key)))


def axis_generators(seed: int, source: str) -> list[Generator]:
    """Return the streams of the three axes of one source."""
    return [generator(seed, f"{source}.{axis}") for axis in AXES]


# SeedSequence with entropy=seed and spawn_key=(key,), as NumPy has it (M. E. O'Neill, "Developing a
# seed_seq alternative", 2015), over integers and over arrays of uint64: NumPy's repeats for each of
# the fifty streams of a run what depends on the seed alone.
_WORD: Final = 0xFFFFFFFF
_XSHIFT: Final = 16
_INIT_A, _MULT_A = 0x43B0D7E5, 0x931E8875
_INIT_B, _MULT_B = 0x8B51F9DD, 0x58F38DED
_MIX_L, _MIX_R = 0xCA01F9DD, 0x4973F715
_POOL: Final = 4
_KEYED: Final = _POOL * (_POOL + 1)
"""Hashes of entropy: of each word of the pool, of each word for each other word, of the key."""


def _constants(first: int, factor: int, count: int) -> list[tuple[int, int]]:
    """Return the constant that each of successive hashes adds, and that by which it multiplies."""
    values = [first]
    for _ in range(count):
        values.append(values[-1] * factor & _WORD)
    return list(itertools.pairwise(values))


_OF_ENTROPY: Final = _constants(_INIT_A, _MULT_A, _KEYED)
_OF_KEY: Final = _OF_ENTROPY[-_POOL:]
_OF_STATE: Final = _constants(_INIT_B, _MULT_B, 6)


def _hash(word: _Word, constants: tuple[int, int]) -> _Word:
    """Return the hash of a word of 32 bits."""
    added, factor = constants
    word = (word ^ added) * factor & _WORD
    return word ^ word >> _XSHIFT


def _mix(x: _Word, y: _Word) -> _Word:
    """Return the mixture of two words of 32 bits."""
    word = (_MIX_L * x - _MIX_R * y) & _WORD
    return word ^ word >> _XSHIFT


def _pool(low: _Word, high: _Word) -> _PoolWords[_Word]:
    """Return the pool of entropy after both words of a seed (``SeedSequence.mix_entropy``)."""
    constants = iter(_OF_ENTROPY)
    zero = low ^ low
    pool = [_hash(word, next(constants)) for word in (low, high, zero, zero)]
    for source in range(_POOL):
        for target in range(_POOL):
            if source != target:
                pool[target] = _mix(pool[target], _hash(pool[source], next(constants)))
    a, b, c, d = pool
    return a, b, c, d


@lru_cache(maxsize=8)
def _pool_of_seed(seed: int) -> _PoolWords[int]:
    """Return the pool of entropy after a seed."""
    return _pool(seed & _WORD, seed >> 32)


_keys: dict[int, None] = {}
"""Numbers of the sources that streams had so far: the next run of a study has the same."""
_MOST_KEYS: Final = 256


@lru_cache(maxsize=8)
def _words_of_seed(seed: int) -> dict[int, Words]:
    """Return the words of SFC64 (3,) by source, those of a run made in one go."""
    if not _keys:
        return {}
    low, high = (np.array([word], np.uint64) for word in (seed & _WORD, seed >> 32))
    keys = np.array(list(_keys), np.uint64)
    table = np.stack(_seed_words(_pool(low, high), keys), axis=-1)
    return dict(zip(keys.tolist(), table, strict=True))


def _seed_words(pool: _PoolWords[_Word], key: _Word) -> tuple[_Word, _Word, _Word]:
    """Return the three words of 64 bits from which SFC64 starts.

    :param pool: of the seed.
    :param key: of the source.
    """
    a, b, c, d = [
        _mix(word, _hash(key, constants)) for word, constants in zip(pool, _OF_KEY, strict=True)
    ]
    u, v, w, x, y, z = map(_hash, (a, b, c, d, a, b), _OF_STATE)
    return u | v << 32, w | x << 32, y | z << 32


def _key(source: str) -> int:
    """Return the number of a source's name."""
    return zlib.crc32(source.encode())


_ROUNDS: Final = 12
_BYTES: Final = 32
"""Of a state of SFC64: three words and a counter."""


def initial_states(seeds: Integers, *sources: str) -> Words:
    """Return the states (count, 3 m, 4) of :func:`axis_generators` of m sources for each seed."""
    words: _Numbers = np.asarray(seeds, np.uint64)[..., None]
    keys: _Numbers = np.array(
        [_key(f"{source}.{axis}") for source in sources for axis in AXES], np.uint64
    )
    a, b, c = _seed_words(_pool(words & _WORD, words >> 32), keys)
    counter = np.ones(a.shape, np.uint64)
    for _ in range(_ROUNDS):  # the start of SFC64
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
        self._prepare()
        self.begin(...)

    def _prepare(self) -> None:
        """Prepare to draw: from the streams of one unit, or by one generator for those of all."""
        self._draws = [getattr(stream, self._numbers) for stream in self._generators]
        if not np.ndim(self._seed):
            return
        bits = SFC64(0)
        self._draw = getattr(Generator(bits), self._numbers)
        self._state = (ctypes.c_char * _BYTES).from_address(bits.ctypes.state_address)

    def __getstate__(self) -> dict[str, object]:
        """Return what a copy needs; it draws by a generator of its own."""
        left = ("_draws", "_draw", "_state")
        return {name: value for name, value in vars(self).items() if name not in left}

    def __setstate__(self, state: dict[str, object]) -> None:
        """Become a copy."""
        vars(self).update(state)
        self._prepare()

    def begin(self, units: Units) -> None:
        """Let the streams of some units begin, or begin again, from their present seeds."""
        if not np.ndim(self._seed):
            every = (axis_generators(int(self._seed), source) for source in self._sources)
            self._generators = [stream for streams in every for stream in streams]
            self._prepare()
            return
        seeds = np.asarray(self._seed)[units]
        states = initial_states(seeds, *self._sources).tobytes()
        for k, index in enumerate(self._indices[units].ravel().tolist()):
            self._states[index] = states[k * _BYTES : (k + 1) * _BYTES]

    def next(self, count: int, units: Units = ..., axes: Any = slice(None)) -> Array:
        """Return the next numbers (count, *units, axes) of some units and axes, by source."""
        if self._draws:
            draws = self._draws[axes] if isinstance(axes, slice) else [self._draws[k] for k in axes]
            numbers = np.empty((count, len(draws)), order="F")
            for draw, column in zip(draws, numbers.T, strict=True):
                draw(out=column)
            return numbers
        indices = self._indices[units][..., axes]
        numbers = np.empty((count, *indices.shape), order="F")
        rows = numbers.reshape(count, indices.size, order="F").T
        pairs = zip(indices.ravel("F").tolist(), rows, strict=True)
        generator, states, draw = self._state, self._states, self._draw
        for index, row in pairs:
            generator.raw = states[index]
            draw(out=row)
            states[index] = generator.raw
        return numbers


def by_axis(numbers: Array) -> Array:
    """Return numbers (count, *units, axes) of streams as (*units, axes, count), without a copy."""
    return numbers.transpose(*range(1, numbers.ndim), 0)
