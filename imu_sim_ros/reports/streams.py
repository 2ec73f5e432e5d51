# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Streams of topics reduced to the few numbers that plots need, whatever their length."""

import base64
import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros.bags.messages import schemas
from imu_sim_ros.bags.messages.blocks import MessageBlock, TopicInfo, as_list
from imu_sim_ros.bags.messages.encode import VECTOR3_STAMPED
from imu_sim_ros.bags.messages.encode_cameras import COMPRESSED_IMAGE, IMAGE
from imu_sim_ros.bags.messages.schemas import Message
from imu_sim_ros.bags.read import open_bag, vector_blocks
from imu_sim_ros.bags.reader import Bag, errors_naming
from imu_sim_ros.calibration.noise.deviation import Deviation, DeviationAccumulator
from imu_sim_ros.core.blocks import ceil_divide
from imu_sim_ros.core.errors import ImuSimError, InputError
from imu_sim_ros.core.records import Readings
from imu_sim_ros.core.types import Array, Bytes, Mask, Times
from imu_sim_ros.recordings.findings.measures import ReadingMeasures
from imu_sim_ros.recordings.live_clock import LiveClock
from imu_sim_ros.recordings.stream import ClockStream, Stretch
from imu_sim_ros.reports.page import Item, table
from imu_sim_ros.sensors import sensors_of_imus
from imu_sim_ros.sensors.camera.images.files import decode_image, png

_IMAGES: Final = 6
"""Number of images of each camera."""
_WIDTH: Final = 180
"""Pixels of an image of the strip."""
_MAX_CAMERAS: Final = 4
"""Largest number of cameras whose images are shown."""
_IMAGE_TYPES: Final = (IMAGE, COMPRESSED_IMAGE)
_UNITS: Final = {"gyroscope": "rad/s", "accelerometer": "m/s^2"}


class _TopicStatistics:
    """Statistics of the messages of a topic so far."""

    def __init__(self, topic: TopicInfo) -> None:
        self.topic = topic
        self.count, self.size = 0, 0
        self.clock = LiveClock()
        self.ends: tuple[int, int] | None = None
        self.images: list[tuple[int, bytes]] = []
        has_images = topic.type in _IMAGE_TYPES and topic.count
        numbers = np.linspace(0, topic.count - 1, _IMAGES) if has_images else np.empty(0)
        self._drawn = sorted(set(numbers.round().astype(int).tolist()))

    def add(self, block: MessageBlock) -> None:
        """Add a block of messages."""
        payloads, count = block.payloads, len(block.t_ns)
        if not count:
            return
        listed = isinstance(payloads, list)
        self.size += sum(map(len, payloads)) if listed else int(payloads.size)  # type: ignore[union-attr]
        for number in [n for n in self._drawn if self.count <= n < self.count + count]:
            k = number - self.count
            self.images.append((int(block.t_ns[k]), as_list(payloads[k : k + 1])[0]))
        self.count += count
        start_ns = self.ends[0] if self.ends else int(block.t_ns[0])
        self.ends = (start_ns, int(block.t_ns[-1]))
        self.clock.add(block.t_ns)

    def row(self) -> list[object]:
        """Return the row of the topic in the table of topics."""
        duration = (self.ends[1] - self.ends[0]) * 1e-9 if self.ends else 0.0
        clock = self.clock
        rate = clock.rate or None
        mean = None if duration <= 0.0 else (self.count - 1) / duration
        mean_size = self.size / self.count if self.count else None
        message = [self.topic.name, self.topic.type.replace("/msg/", "/"), self.count, rate, mean]
        gaps = [None, None] if rate is None else [clock.gaps, clock.longest]
        return [*message, *gaps, mean_size, self.size * 1e-6]


def topic_items(path: Path, topics: Sequence[TopicInfo]) -> list[Item]:
    """Return the table of a bag's topics, and the strips of its cameras."""
    counters = {topic.name: _TopicStatistics(topic) for topic in topics}
    with open_bag(path) as bag:
        for group in bag.groups():
            for block in group:
                counters[block.topic.name].add(block)
        for counter in counters.values():
            counter.clock.finish()
        cameras = [counter for counter in counters.values() if counter.images][:_MAX_CAMERAS]
        strips = [_strip(bag, camera) for camera in cameras]
    header = ["topic", "type", "messages", "rate [Hz]", "mean [Hz]"]
    header += ["gaps", "longest [s]", "bytes", "MB"]
    rows = [counter.row() for counter in counters.values()]
    text = (
        "The rate is that of the clock behind the record times, the mean that over all; in a gap "
        "messages are missing. Bytes are those of a message, before compression."
    )
    explanation: Item = {"kind": "text", "text": text, "faint": True}
    return [table("topics", header, rows, search=False), explanation, *strips]


def _strip(bag: Bag, camera: _TopicStatistics) -> Item:
    """Return small images of a camera over time, or the reason why they cannot be decoded."""
    topic, (first_ns, _) = camera.topic, camera.images[0]
    decode = schemas.decoder([(topic.type, topic.schema)], bag.encoding)
    frames: list[Item] = []
    try:
        for t_ns, payload in camera.images:
            with errors_naming(bag.path, f" ({topic.name})"):
                message = decode(payload, topic.type)
            data = base64.b64encode(png(_small(topic, message))).decode()
            frames.append({"t_s": (t_ns - first_ns) * 1e-9, "png": data})
    except ImuSimError as error:
        return {"kind": "text", "text": f"{topic.name}: {error}"}
    return {"kind": "strip", "title": topic.name, "frames": frames}


def _small(topic: TopicInfo, message: Message) -> Bytes:
    """Return the image of a message, 8 bits deep, its pixels averaged to a small width."""
    from imu_sim_ros.datasets.recorded_bag import pixels

    raw = topic.type == IMAGE
    image = pixels(topic.name, message) if raw else decode_image(bytes(message.data))
    image = np.asarray(image[..., :3] if image.ndim == 3 else image)
    binning = max(1, ceil_divide(image.shape[1], _WIDTH))
    height, width = (size // binning * binning for size in image.shape[:2])
    if not height or not width:
        binning, (height, width) = 1, image.shape[:2]
    parts = image[:height, :width].astype(np.float32)
    parts = parts.reshape(height // binning, binning, width // binning, binning, *image.shape[2:])
    small = np.nan_to_num(parts.mean(axis=(1, 3)), posinf=0.0, neginf=0.0)
    if image.dtype != np.uint8:  # depths and deep grey values: their own range
        low, high = float(small.min()), float(small.max())
        small = (small - low) * (255.0 / max(high - low, 1e-9))
    return small.round().astype(np.uint8)


def bias_series(path: Path, topics: Sequence[TopicInfo]) -> list[tuple[str, str, list[Item]]]:
    """Return title, unit and lines of every bias that a bag has as Vector3Stamped."""
    biases = []
    for topic in topics:
        if topic.type != VECTOR3_STAMPED or "bias" not in topic.name or not topic.count:
            continue
        times, vectors = zip(*vector_blocks(path, topic.name, gated=False), strict=True)
        t_ns, values = np.concatenate(times), np.concatenate(vectors)
        t_s = (t_ns - t_ns[0]) * 1e-9
        series = []
        for k, axis in enumerate("xyz"):
            rows = extreme_rows(values[:, k])
            line = {"name": axis, "colour": axis, "x": t_s[rows], "y": values[rows, k]}
            series.append(line | {"thin": True})
        unit = next((unit for name, unit in _bias_units().items() if name in topic.name), "")
        biases.append((f"Bias: {topic.name}", unit, series))
    return biases


def _bias_units() -> dict[str, str]:
    """Return the units of biases by the names of their topics."""
    tables = [sensor.table for sensor in sensors_of_imus()]
    return _UNITS | {
        table.truths[1]: table.quantity.unit for table in tables if table and table.truths
    }


PARTS: Final = 500
"""Columns of a picture: a plot of half the page's width has about as many pixels."""
_SEGMENT: Final = 4096
"""Number of samples of a segment of the spectrum."""
_PER_DECADE: Final = 60
"""Number of points of a spectrum per decade of frequency."""
_MAX_GAPS: Final = 1000
"""Largest number of gaps that are drawn."""
_JUDGED: Final = 32768
"""Readings of a piece in which rest is told from motion."""
_AT_REST: Final = 0.95
"""Share of the seconds at rest from which on an IMU is taken to rest: a bump on the table is not
motion."""


class Gap(NamedTuple):
    """Two neighbouring readings between which some are missing, or the clock was reset."""

    at_s: float
    """Time since the first stamp [s]."""
    interval_s: float
    """Interval to the next stamp [s]."""


class StreamPlots(NamedTuple):
    """Data for the plots of a stream; axes are gyroscope x y z, accelerometer x y z."""

    samples: int
    first_ns: int
    duration_s: float
    interval_s: float
    """Time between two samples, by the clock behind the stamps."""
    gaps: list[Gap]
    gap_count: int
    t_s: Array
    """(m,) middles of the parts."""
    low: Array
    """(m, 6) smallest readings of each part."""
    high: Array
    """(m, 6) largest readings of each part."""
    shortest: Array
    """(m,) shortest interval of each part [s]."""
    longest: Array
    """(m,) longest interval of each part [s]."""
    frequency: Array
    """(k,) Hz."""
    density: Array
    """(k, 6) two-sided, unit/sqrt(Hz)."""
    deviation: Deviation
    at_rest: bool
    """True if the IMU rests nearly all the time, so that its deviation is that of its noise."""


def extreme_rows(values: Array, columns: int = PARTS) -> NDArray[np.intp]:
    """Return the rows that a picture needs: both ends, and each column's smallest and largest.

    :param values: (n,), or (n, k) with extremes of each of the k columns.
    :param columns: width of the picture in points.
    """
    table = values.reshape(len(values), -1)
    starts = np.unique(np.linspace(0, len(table), columns + 1).astype(np.intp))
    parts = [table[a:b] for a, b in itertools.pairwise(starts.tolist())]
    rows = [
        start + end(part, axis=0)
        for start, part in zip(starts.tolist(), parts, strict=False)
        for end in (np.argmin, np.argmax)
    ]
    return np.unique(np.concatenate([[0, len(table) - 1], *rows]))


def curve(name: str, colour: int, t_s: Array, values: Array) -> Item:
    """Return the curve of values (n,) over times (n,) [s], thinned to its extremes."""
    rows = extreme_rows(values)
    return {"name": name, "colour": colour, "x": t_s[rows], "y": values[rows]}


def track(name: str, colour: int | None, positions: Array, columns: int = PARTS) -> Item:
    """Return a path of positions (n, 3) [m], thinned to its extremes in each column."""
    x, y, z = positions[extreme_rows(positions, columns)].T
    return {"name": name, "colour": colour, "x": x, "y": y, "z": z}


def analyse(blocks: Iterable[Readings], count: int) -> StreamPlots | None:
    """Return the data for the plots of a stream; None with fewer than two readings.

    :param count: approximate number of the readings, which sets how many make a part.
    """
    clock = ClockStream()
    analysis: _Analysis | None = None
    try:
        for stretch in _stretches(blocks, clock):
            if analysis is None:
                assert clock.pattern is not None
                interval = clock.pattern.interval_ns * 1e-9
                analysis = _Analysis(
                    int(stretch.t_ns[0]), interval, max(1, ceil_divide(count, PARTS))
                )
            analysis.add(stretch)
    except _NoPlotsError:  # a finding tells it
        return None
    return None if analysis is None else analysis.result()


class _NoPlotsError(Exception):
    """Stamps that have no rate, or are no nanoseconds, or an absent triad."""


def _stretches(blocks: Iterable[Readings], clock: ClockStream) -> Iterator[Stretch]:
    """Yield the readings (n, 6) of blocks in the order of their stamps, without strays.

    :raises _NoPlotsError: for stamps without a rate, and readings of one triad; what cannot be read
        keeps its own error.
    """
    parts = ((block.t_ns, _axes(block), False) for block in blocks if len(block))
    end = (np.empty(0, np.int64), np.empty((0, 6)), True)
    for t_ns, values, at_end in itertools.chain(parts, [end]):
        try:
            stretches = list(clock.add(t_ns, values, at_end=at_end))
        except InputError as error:
            raise _NoPlotsError from error
        yield from stretches


def _axes(readings: Readings) -> Array:
    """Return the readings (n, 6) of gyroscope and accelerometer.

    :raises _NoPlotsError: if one of them is absent.
    """
    if readings.gyro is None or readings.accel is None:
        raise _NoPlotsError
    return np.column_stack([readings.gyro, readings.accel])


class _Analysis:
    """Reduction of a stream, block by block."""

    def __init__(self, start_ns: int, interval: float, part: int) -> None:
        self._start_ns, self._interval, self._part = start_ns, interval, part
        self._samples, self._end_ns = 0, start_ns
        self._rest_t, self._rest = np.empty(0), np.empty((0, 7))
        self._rows: list[tuple[Array, Array, Array]] = []
        self._gaps: list[Gap] = []
        self._gap_count = 0
        self._spectrum = _Spectrum(1.0 / interval)
        self._deviation = DeviationAccumulator(1.0 / interval, 6)
        self._rest_share = _RestShare()

    def add(self, stretch: Stretch) -> None:
        """Add a stretch of readings without gaps."""
        values = stretch.values
        self._rest_share.add(stretch.t_ns, values)
        previous_ns = self._end_ns if self._samples else int(stretch.t_ns[0])
        steps: Array = np.diff(stretch.t_ns, prepend=previous_ns) * 1e-9
        t_s = (stretch.t_ns - self._start_ns) * 1e-9
        torn = stretch.missing > 0
        torn[0] |= stretch.begins
        if not self._samples:
            torn[0] = False
            steps[0] = self._interval
        self._gap_count += int(torn.sum())
        for k in np.flatnonzero(torn)[: _MAX_GAPS - len(self._gaps)]:
            self._gaps.append(Gap(float(t_s[k]), float(steps[k])))
        self._pieces(values, torn)
        self._samples += len(values)
        self._end_ns = int(stretch.t_ns[-1])
        self._parts(np.asarray(t_s, dtype=np.float64), np.column_stack([values, steps]))

    def _pieces(self, values: Array, torn: Mask) -> None:
        """Pass the readings between gaps to the spectrum and the Allan deviation."""
        cuts = np.flatnonzero(torn).tolist()
        if len(cuts) > _MAX_GAPS:  # a stream that is nothing but gaps: no piece is worth it
            cuts = cuts[:_MAX_GAPS]
        for number, (start, stop) in enumerate(zip([0, *cuts], [*cuts, len(values)], strict=True)):
            if number:
                self._deviation.end_piece()
                self._spectrum.end_piece()
            piece = values[start:stop]
            if len(piece) and np.isfinite(piece).all():
                self._deviation.add(piece)
                self._spectrum.add(piece)

    def _parts(self, t_s: Array, table: Array) -> None:
        """Reduce as many whole parts of the readings as there are, and keep the remainder."""
        self._rest_t = np.concatenate([self._rest_t, t_s])
        self._rest = np.concatenate([self._rest, table])
        whole = len(self._rest) // self._part * self._part
        self._reduce(whole)

    def _reduce(self, whole: int) -> None:
        """Reduce readings to means and extremes, part by part."""
        if not whole:
            return
        times = self._rest_t[:whole].reshape(-1, min(self._part, whole))
        parts = self._rest[:whole].reshape(len(times), -1, 7)
        self._rows.append((times.mean(axis=1), parts.min(axis=1), parts.max(axis=1)))
        self._rest_t, self._rest = self._rest_t[whole:], self._rest[whole:]

    def result(self) -> StreamPlots:
        """Return the plots' values of all readings."""
        self._reduce_last()
        t_s, low, high = (np.concatenate(column) for column in zip(*self._rows, strict=True))
        self._deviation.end_piece()
        self._spectrum.end_piece()
        frequency, density = self._spectrum.result()
        return StreamPlots(
            self._samples,
            self._start_ns,
            (self._end_ns - self._start_ns) * 1e-9,
            self._interval,
            self._gaps,
            self._gap_count,
            t_s,
            low[:, :6],
            high[:, :6],
            low[:, 6],
            high[:, 6],
            frequency,
            density,
            self._deviation.result(),
            self._rest_share.is_at_rest(),
        )

    def _reduce_last(self) -> None:
        """Reduce the readings left over, fewer than a part."""
        if len(self._rest):
            self._part = len(self._rest)
            self._reduce(len(self._rest))


class _RestShare:
    """Counter of the seconds of a stream in which nothing moves, in pieces of constant size."""

    def __init__(self) -> None:
        self._t_ns, self._values = np.empty(0, np.int64), np.empty((0, 6))
        self._windows, self._resting = 0, 0

    def add(self, t_ns: Times, values: Array) -> None:
        """Add readings (n, 6): gyroscope x y z, accelerometer x y z."""
        self._t_ns = np.concatenate([self._t_ns, t_ns])
        self._values = np.concatenate([self._values, values])
        while len(self._t_ns) >= _JUDGED:
            self._judge(_JUDGED)

    def _judge(self, count: int) -> None:
        """Count windows, and those at rest, in the first readings, and drop these readings."""
        gyro, accel = self._values[:count, :3], self._values[:count, 3:]
        measures = ReadingMeasures(Readings(self._t_ns[:count], gyro, accel))
        self._windows += len(measures.rest)
        if measures.rest_force is not None:  # a steady turn is no rest
            self._resting += int(np.count_nonzero(measures.rest))
        self._t_ns, self._values = self._t_ns[count:], self._values[count:]

    def is_at_rest(self) -> bool:
        """Return True if the stream rests nearly all the time."""
        if len(self._t_ns):
            self._judge(len(self._t_ns))
        return self._windows > 0 and self._resting >= _AT_REST * self._windows


class _Spectrum:
    """Welch's estimate over pieces that need not be contiguous."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._window = np.hanning(_SEGMENT + 1)[:-1, None]
        self._rest = np.empty((0, 6))
        self._total = np.zeros((_SEGMENT // 2 + 1, 6))
        self._count = 0
        self._shorter: Array | None = None

    def add(self, values: Array) -> None:
        """Add readings (n, 6) to the averaged spectrum (Welch's method)."""
        self._rest = np.concatenate([self._rest, values])
        half = _SEGMENT // 2
        while len(self._rest) >= _SEGMENT:
            segment = self._rest[:_SEGMENT]
            self._total += (
                np.abs(np.fft.rfft(self._window * (segment - segment.mean(axis=0)), axis=0)) ** 2
            )
            self._count += 1
            self._rest = self._rest[half:]

    def end_piece(self) -> None:
        """End a piece: the next readings do not continue it."""
        if self._shorter is None or len(self._rest) > len(self._shorter):
            self._shorter = self._rest
        self._rest = np.empty((0, 6))

    def result(self) -> tuple[Array, Array]:
        """Return frequencies (k,) and densities (k, 6), averaged in steps of equal ratio."""
        total, window, count = self._total, self._window, self._count
        if not count:  # a record shorter than a segment: all of it is one
            values = np.empty((0, 6)) if self._shorter is None else self._shorter
            if len(values) < 16:
                return np.empty(0), np.empty((0, 6))
            window, count = np.hanning(len(values) + 1)[:-1, None], 1
            total = np.abs(np.fft.rfft(window * (values - values.mean(axis=0)), axis=0)) ** 2
        # Two-sided density of a periodogram: |X|^2 / (rate * sum of the squared window).
        power = total / (count * self._rate * float(np.sum(window**2)))
        frequency = np.fft.rfftfreq(len(window), 1.0 / self._rate)
        frequency, power = frequency[2:-1], power[2:-1]
        bins = np.unique(np.floor(np.log10(frequency) * _PER_DECADE), return_index=True)[1]
        size = np.diff(bins, append=len(frequency))
        middle = np.add.reduceat(frequency, bins) / size
        return middle, np.sqrt(np.add.reduceat(power, bins, axis=0) / size[:, None])
