# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers as decimal text, whole tables at a time.

The text has the fewest digits that read back as the same float64, in orjson's notation. orjson is
used if it is installed; without it, Python's ``repr`` takes longer and gives the same bytes.
"""

import re
from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.core.types import Times

Column = NDArray[np.generic]

_FRACTION = 9  # digits of a nanosecond


def lines(columns: Iterable[Column | list[bytes]], separator: str = ",") -> bytes:
    """Return the lines of a table as text.

    :param columns: each integers or floats (n,) or (n, m), byte strings (n,), or n cells that are
        text already.
    """
    cells = [column if isinstance(column, list) else rows(column) for column in columns]
    if not cells or not cells[0]:
        return b""
    table = cells[0] if len(cells) == 1 else list(map(b",".join, zip(*cells, strict=True)))
    text = b"\n".join(table) + b"\n"
    return text if separator == "," else text.replace(b",", separator.encode())


def rows(values: Column) -> list[bytes]:
    """Return numbers (n,) or (n, m) as n cells, commas between the numbers of a row."""
    if not len(values) or values.dtype.kind == "S":
        return list(values.tolist())
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        return _rows_by_repr(values)  # JSON has no infinity
    try:
        import orjson  # only a dataset of text uses it
    except ImportError:
        return _rows_by_repr(values)
    text = orjson.dumps(np.ascontiguousarray(values), option=orjson.OPT_SERIALIZE_NUMPY)
    return text[1:-1].split(b",") if values.ndim == 1 else text[2:-2].split(b"],[")


def _rows_by_repr(values: Column) -> list[bytes]:
    """Return the cells of :func:`rows` without orjson, in its notation."""
    table: list[list[object]] = values.reshape(len(values), -1).tolist()
    cells = [",".join(map(repr, row)) for row in table]
    if values.dtype.kind == "f":
        cells = [_SMALL.sub(_small, row) if "e-0" in row else row for row in cells]
    return [row.encode() for row in cells]


_SMALL: Final = re.compile(r"(\d)(?:\.(\d+))?e-0(\d)")
"""Numbers below 1e-4 in the notation of ``repr``: digits before and after the point, exponent."""


def _small(number: re.Match[str]) -> str:
    """Return a number below 1e-4 in orjson's notation: 0.000015 and 1.5e-6."""
    whole, fraction, exponent = number.groups()
    if exponent == "5":
        return f"0.0000{whole}{fraction or ''}"
    return f"{whole}.{fraction}e-{exponent}" if fraction else f"{whole}e-{exponent}"


def seconds(t_ns: Times) -> list[bytes]:
    """Return times (n,) [ns], not negative, as exact seconds with nine decimals."""
    digits = (word.rjust(_FRACTION + 1, b"0") for word in rows(t_ns))
    return [b"%b.%b" % (word[:-_FRACTION], word[-_FRACTION:]) for word in digits]


def decimal(value: float) -> str:
    """Return a number as YAML 1.1 takes it for one: 5e-05 is a string there, 5.0e-05 is not."""
    text = f"{value:.12g}"
    mantissa, e, exponent = text.partition("e")
    return text if "." in mantissa or not e else f"{mantissa}.0e{exponent}"
