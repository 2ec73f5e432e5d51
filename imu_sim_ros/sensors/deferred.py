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


class Completed(Mapping[str, object]):
    """Values by name; missing ones are computed together when one of them is needed."""

    def __init__(
        self, made: dict[str, object], names: Sequence[str], make: Callable[[], Iterable[Any]]
    ) -> None:
        """Take what is there.

        :param names: of all values, in their order.
        :param make: returns all values.
        """
        self._made, self._names, self._make = made, names, make

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
        """Take what waits for each."""
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


class Each(Generic[_T]):
    """A large value of each of n samples, such as an image, for several threads."""

    def __init__(
        self,
        make: Callable[[int], _T],
        numbers: Sequence[int],
        threads: "Executor | None",
        kept: bool = False,
    ) -> None:
        """Compute nothing yet.

        :param make: returns the value of a sample by its number; for several threads at once.
        :param numbers: (n,) of the samples.
        :param threads: compute values in the background; None: compute them at once.
        :param kept: compute a value once, for several users; otherwise each time.
        """
        self._make, self._numbers, self._threads = make, numbers, threads
        self._made: dict[int, _T] = {}
        self._locks = [threading.Lock() for _ in numbers] if kept else None

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
        return Results([self._begun(use, k) for k in rows])

    def _begun(self, use: Callable[[int, _T], _Made], k: int) -> Callable[[], _Made]:
        """Begin to compute the result of item k; return the function that waits for it."""
        if self._threads is not None:
            return self._threads.submit(self._used, use, k).result
        computed = self._used(use, k)
        return lambda: computed

    def _used(self, use: Callable[[int, _T], _Made], k: int) -> _Made:
        """Return the result of item k."""
        return use(k, self[k])
