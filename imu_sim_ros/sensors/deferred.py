# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Values of samples that take long to make, or much room: they are made when they are asked for."""

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

if TYPE_CHECKING:
    from concurrent.futures import Executor

_T = TypeVar("_T")
_Made = TypeVar("_Made")


class Deferred(Mapping[str, object]):
    """Values by name, each made when it is first asked for."""

    def __init__(self, **makers: Callable[[], object]) -> None:
        self._makers, self.made = makers, dict[str, object]()
        """Values made so far, by name."""

    def __getitem__(self, name: str) -> Any:
        if name not in self.made:
            self.made[name] = self._makers[name]()
        return self.made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._makers)

    def __len__(self) -> int:
        return len(self._makers)


class ValuesOnDemand(Mapping[str, object]):
    """Values by name; missing ones are computed together when one of them is needed."""

    def __init__(
        self, computed: dict[str, object], names: Sequence[str], make: Callable[[], Iterable[Any]]
    ) -> None:
        """Initialise with the values that are already known; nothing is computed.

        :param computed: known values by name; they stay as they are.
        :param names: names of all values, in the order in which ``make`` returns them.
        :param make: returns all values, known ones too.
        """
        self._made, self._names, self._make = computed, names, make

    def __getitem__(self, name: str) -> Any:
        if name not in self._made and name in self._names:
            self._made = dict(zip(self._names, self._make(), strict=True)) | self._made
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


class Results(Sequence[_Made]):
    """Results of threads, in order; access to one waits for it."""

    def __init__(self, results: list[Callable[[], _Made]]) -> None:
        """Initialise with functions, each of which waits for a result and returns it."""
        self._results = results

    @overload
    def __getitem__(self, k: int) -> _Made: ...

    @overload
    def __getitem__(self, k: slice) -> "Results[_Made]": ...

    def __getitem__(self, k: int | slice) -> "_Made | Results[_Made]":
        if isinstance(k, slice):
            return Results(self._results[k])
        return self._results[k]()

    def __len__(self) -> int:
        return len(self._results)


class DeferredValues(Generic[_T]):
    """A large value of each of n samples, such as an image, for several threads."""

    def __init__(
        self,
        make: Callable[[int], _T],
        numbers: Sequence[int],
        threads: "Executor | None",
        cached: bool = False,
    ) -> None:
        """Initialise without computing a value.

        :param make: returns the value of a sample by its number; several threads call it at once.
        :param numbers: (n,) numbers of the samples.
        :param threads: compute values in the background; None: in the thread that asks.
        :param cached: True: compute a value once and keep it; False: compute it at each access.
        """
        self._make, self._numbers, self._threads = make, numbers, threads
        self._made: dict[int, _T] = {}
        self._locks = [threading.Lock() for _ in numbers] if cached else None

    def __getitem__(self, k: int) -> _T:
        """Return the value of row k."""
        if self._locks is None:
            return self._make(self._numbers[k])
        with self._locks[k]:
            if k not in self._made:
                self._made[k] = self._make(self._numbers[k])
            return self._made[k]

    def begin(self, rows: Iterable[int], use: Callable[[int, _T], _Made]) -> Results[_Made]:
        """Begin to use the values of some rows in the threads.

        :param use: takes a row and its value.
        """
        return Results([self._begin(use, k) for k in rows])

    def _begin(self, use: Callable[[int, _T], _Made], k: int) -> Callable[[], _Made]:
        """Begin to compute the result of item k; return the function that waits for it."""
        if self._threads is not None:
            return self._threads.submit(self._use, use, k).result
        computed = self._use(use, k)
        return lambda: computed

    def _use(self, use: Callable[[int, _T], _Made], k: int) -> _Made:
        """Return the result of item k."""
        return use(k, self[k])
