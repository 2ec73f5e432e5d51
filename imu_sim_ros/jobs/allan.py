# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Allan analysis: noise parameters by triad and axis, with confidence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import numpy as np

from imu_sim_ros.calibration.noise import noise_files, truth
from imu_sim_ros.calibration.noise.analysis import MODELS, AllanResult, analyse
from imu_sim_ros.calibration.noise.estimate import Estimate
from imu_sim_ros.calibration.noise.terms import QUANTITIES
from imu_sim_ros.calibration.noise.truth import ParameterComparison
from imu_sim_ros.core import arguments
from imu_sim_ros.core.arguments import BAG_OR_FILE, name_of, suggest_keywords
from imu_sim_ros.core.bad_rows import tell_skipped
from imu_sim_ros.core.conventions import AXES, TRIADS
from imu_sim_ros.core.digits import interval_texts, upper_bound
from imu_sim_ros.core.errors import InputError, Problems
from imu_sim_ros.core.records import Readings
from imu_sim_ros.core.types import Array, JsonObject, Mask
from imu_sim_ros.jobs.flight import Flight, readings_of
from imu_sim_ros.jobs.selection import (
    AccelTopic,
    AccelUnit,
    Frame,
    GyroTopic,
    GyroUnit,
    check_choice,
    input_lines,
)
from imu_sim_ros.jobs.writing import SkipBadRows, save_output
from imu_sim_ros.recordings.findings.catalogue import reading_findings
from imu_sim_ros.recordings.findings.finding import Finding
from imu_sim_ros.recordings.findings.measures import ReadingMeasures
from imu_sim_ros.recordings.findings.policy import ALLAN
from imu_sim_ros.recordings.findings.survey import ReadingSurvey
from imu_sim_ros.terminal.progress import progress
from imu_sim_ros.terminal.text_tables import TextTable, html_of

if TYPE_CHECKING:
    from imu_sim_ros.formats.choice import Choice
    from imu_sim_ros.plots.style import Figure


@dataclass(frozen=True, repr=False)
class Estimated:
    """A parameter of three axes with its 95 % interval."""

    value: Array
    """(3,) x, y, z; NaN if the data cannot distinguish it from zero."""
    low: Array
    """(3,) lower ends of the intervals; 0 if there is no value."""
    high: Array
    """(3,) upper ends of the intervals; if there is no value, its upper bound; infinite for an
    axis that is not analysed."""
    unit: str

    def to_dict(self) -> dict[str, list[float | None]]:
        """Return value and interval of each axis; None if there is none."""
        finite = np.isfinite(self.high)
        return {
            "value": _or_none(self.value, np.isfinite(self.value)),
            "low": _or_none(self.low, finite),
            "high": _or_none(self.high, finite),
        }

    def __repr__(self) -> str:
        axes = [
            _interval_text(value, low, high)
            for value, low, high in zip(self.value, self.low, self.high, strict=True)
        ]
        columns = (f"{axis} {text}" for axis, text in zip(AXES, axes, strict=True))
        return f"<Estimated {', '.join(columns)} {self.unit}>"


def _or_none(values: Array, finite: Mask) -> list[float | None]:
    """Return values with None in place of those that are not finite."""
    return [float(v) if is_finite else None for v, is_finite in zip(values, finite, strict=True)]


def _interval_text(value: float, low: float, high: float) -> str:
    """Return a value with its interval as text, or an upper bound."""
    if np.isinf(high):
        return "not analysed"
    if np.isnan(value):
        return upper_bound(high)
    middle, bottom, top = interval_texts(value, low, high)
    return f"{middle} [{bottom}, {top}]"


@dataclass(frozen=True, repr=False)
class TriadNoise:
    """The noise of gyroscope or accelerometer."""

    noise_density: Estimated
    """White noise, continuous time."""
    random_walk: Estimated | None
    """Random walk of the bias, continuous time; None under the model gauss_markov."""
    bias_instability: Estimated | None
    """B; the flat Allan deviation is 0.664 B."""
    all: dict[str, Estimated]
    """Every parameter of the model by name."""
    deviation: Array
    """(m, 3) overlapping Allan deviation at the averaging times."""

    def __repr__(self) -> str:
        lines = [f"  {name}: {value!r}" for name, value in self.all.items()]
        return "\n".join(["<TriadNoise", *lines]) + ">"


@dataclass(frozen=True, repr=False)
class Noise:
    """Result of :func:`imu_sim_ros.allan`: the noise of both triads, no readings."""

    gyroscope: TriadNoise
    accelerometer: TriadNoise
    tau: Array
    """(m,) averaging times of the Allan deviations [s]."""
    rate: float
    """Samples per second [Hz]."""
    duration: float
    """Seconds at rest that were used."""
    warnings: tuple[str, ...]
    result: AllanResult
    name: str = ""
    """Name of the sensor or the files, for titles."""
    source: str = ""
    """Paths of the files, for comments."""
    notes: tuple[str, ...] = ()
    """Choices and conversions of reading, a line each."""

    def __repr__(self) -> str:
        density = np.nanmean(self.gyroscope.noise_density.value)
        force = np.nanmean(self.accelerometer.noise_density.value)
        return (
            f"<Noise of {self.duration:.6g} s at {self.rate:.4g} Hz: gyroscope {density:.3g} "
            f"rad/s/sqrt(Hz), accelerometer {force:.3g} m/s^2/sqrt(Hz)>"
        )

    def _repr_html_(self) -> str:
        """Return the text of the result as HTML, for notebooks."""
        return html_of(self.lines())

    def plot(self) -> Figure:
        """Return a matplotlib figure of the Allan deviations, their bands and the fitted terms."""
        from imu_sim_ros.plots import allan as pictures

        return pictures.figure(self.result, self.name)

    def to_dict(self) -> JsonObject:
        """Return rate, parameters, timing and warnings in plain types, as ``--json`` prints them.

        A value that the data cannot distinguish from zero is None, as is all of an axis that is not
        analysed.
        """
        timing = self.result.timing
        triads = zip(TRIADS, (self.gyroscope, self.accelerometer), strict=True)
        return {
            "rate_hz": self.rate,
            "duration_s": self.duration,
            **{
                name: {key: estimate.to_dict() for key, estimate in t.all.items()}
                for name, t in triads
            },
            "not_analysed": self.result.reasons,
            "model": self.result.model,
            "jitter_s": timing.jitter,
            "lost": timing.lost,
            "gaps": timing.gaps,
            "warnings": list(self.warnings),
            "notes": list(self.notes),
        }

    def lines(self, comparisons: Sequence[ParameterComparison] = ()) -> Iterator[str | TextTable]:
        """Yield the text of the analysis, as ``allan`` prints it.

        :param comparisons: with the truth, from :meth:`compare`.
        """
        yield from input_lines(self.notes)
        yield from _lines(self.result, comparisons)

    def compare(self, imu: str | Path) -> list[ParameterComparison]:
        """Return whether each interval contains the truth, for the sensor that was simulated.

        :param imu: a name in config/imus or a parameter file.
        :raises ConfigurationError: for a sensor that does not exist or does not fit.
        """
        path = arguments.path("imu", imu, "a name or the path of a file")
        return truth.compare(self.result, truth.load_truth(str(path)))

    def save(self, path: str | Path, topic: str = "/imu0", *, force: bool = False) -> Path:
        """Write these values to a file, or to a folder with all files; returns its path.

        :param path: ``.csv``: the Allan deviation; ``.png``: the picture of :meth:`plot`;
            ``.yaml``: kalibr's imu.yaml; a name without suffix: a folder with these, both forms of
            imu_utils, and the parameters of ``simulator``. Without a value for every axis, the
            folder has no configuration files.
        :param topic: topic of the readings in kalibr's file.
        :param force: replace what exists.
        :raises InputError: for a path that cannot be used or exists, and for kalibr's file if
            an axis is not analysed.
        """
        arguments.text("topic", topic, "the name of a topic")
        with save_output(path, force) as staged:
            if not staged.suffix:
                staged.mkdir()
                write_files(self, staged, topic)
            elif staged.suffix == ".csv":
                noise_files.write_csv(self.result, staged)
            elif staged.suffix == ".png":
                _draw(self, staged)
            else:
                noise_files.write_kalibr(self.result, staged, topic)
        return Path(path)

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the files that :meth:`save` writes into a folder."""
        without = _CONFIGURATIONS if self.result.reasons else ()
        return tuple(name for name in sorted(FILES) if name not in without)


_CONFIGURATIONS: Final = (
    "kalibr_imu.yaml",
    "imu_utils.yaml",
    "imu_utils_continuous.yaml",
    "imu.yaml",
)
FILES: Final = ("allan.csv", *_CONFIGURATIONS, "allan.png")
"""Names of the files that an analysis writes to a folder."""


def write_files(noise: Noise, folder: Path, topic: str) -> None:
    """Write all that an analysis gives, :attr:`Noise.files`, to a folder that exists.

    :param topic: topic of the readings in kalibr's file.
    """
    result = noise.result
    noise_files.write_csv(result, folder / "allan.csv")
    _draw(noise, folder / "allan.png")
    if result.reasons:
        return
    noise_files.write_kalibr(result, folder / "kalibr_imu.yaml", topic)
    for name, continuous in (("imu_utils.yaml", False), ("imu_utils_continuous.yaml", True)):
        noise_files.write_imu_utils(result, folder / name, continuous=continuous)
    noise_files.write_parameters(result, folder / "imu.yaml", noise.source or noise.name)


def _draw(noise: Noise, path: Path) -> None:
    """Draw the Allan deviation into a file."""
    from imu_sim_ros.plots import allan as pictures

    pictures.draw(noise.result, path, noise.name)


@suggest_keywords
def allan(
    source: Annotated[Flight | Readings | str | Path | Sequence[str | Path], "BAG"],
    *,
    topic: Annotated[str | None, "TOPIC"] = None,
    model: Annotated[str, MODELS] = "standard",
    force: Annotated[bool, "--skip-checks"] = False,
    frame: Frame = None,
    gyro_topic: GyroTopic = None,
    accel_topic: AccelTopic = None,
    gyro_unit: GyroUnit = None,
    accel_unit: AccelUnit = None,
    skip_bad_rows: SkipBadRows = False,
) -> Noise:
    """Return the noise parameters of an IMU at rest, with confidence.

    The source may also be a flight or :class:`Readings`.

    :param source: bag, EuRoC folder or CSV file of one IMU at rest; several bags are combined
    :param topic: sensor_msgs/Imu topic, if a bag has several
    :param model: standard: Q, N, B, K and R as far as the data resolve them; gauss_markov: white
        noise and a first-order Gauss-Markov process
    :param force: continue when a check of the data fails
    :param frame: frame of the readings, if a topic carries several IMUs
    :param gyro_topic: topic of the gyroscope, if the accelerometer has another one
    :param accel_topic: topic of the accelerometer, interpolated to the gyroscope's times
    :param gyro_unit: unit of the gyroscope in the file: rad/s, deg/s
    :param accel_unit: unit of the accelerometer in the file: m/s^2, g, mg
    :param skip_bad_rows: skip and count bad rows of text and bad messages of bags
    :returns: a :class:`Noise`: densities with intervals for each triad and axis.
    :raises ConfigurationError: for an invalid argument.
    :raises InputError: with a line for each check that fails.

    >>> import imu_sim_ros as ims
    >>> noise = ims.allan(ims.simulate(imu="lecture", trajectory="static", duration="10min"))
    >>> noise.gyroscope.noise_density.value.round(3)
    array([0.015, 0.015, 0.015])
    """
    arguments.choice("model", model, MODELS)
    arguments.boolean("force", force)
    arguments.boolean("skip_bad_rows", skip_bad_rows)
    if isinstance(source, str | PathLike | Sequence):
        # A checker takes a flight, whose attributes are those of its sensors, for a path as well.
        sources: Any = [source] if isinstance(source, str | PathLike) else source
        paths = [arguments.path("source", entry, BAG_OR_FILE) for entry in sources]
        if not paths:
            arguments.refuse("source", source, BAG_OR_FILE)
        units = gyro_unit, accel_unit
        choice = check_choice(topic, frame, gyro_topic, accel_topic, *units, of_a_file=True)
        analysis = _analyse_files(paths, choice, model, force, skip_bad_rows)
        name, origin = ", ".join(map(name_of, paths)), ", ".join(map(str, paths))
    else:
        selection = (frame, gyro_topic, accel_topic, gyro_unit, accel_unit)
        readings = readings_of("source", source, topic, selection=selection)
        is_simulated = isinstance(source, Flight)
        analysis = _analyse_readings(readings, model, force, check_units=not is_simulated)
        name, origin = readings.source, ""
    warnings = (*analysis.problems, *analysis.result.warnings)
    result = analysis.result._replace(warnings=warnings)
    return Noise(
        gyroscope=_triad(result, 0),
        accelerometer=_triad(result, 1),
        tau=result.deviation.tau,
        rate=result.timing.rate,
        duration=result.duration,
        warnings=result.warnings,
        result=result,
        name=name,
        source=origin,
        notes=tuple(dict.fromkeys(analysis.notes)),
    )


class _Analysis(NamedTuple):
    """Allan analysis of one source, with the findings about its readings."""

    result: AllanResult
    problems: Sequence[str]
    """A line for each fault of the readings that does not prevent the analysis, such as a unit."""
    notes: Sequence[str]
    """Choices and conversions of reading, a line each."""


def _analyse_files(
    paths: Sequence[Path],
    choice: Choice,
    model: str,
    force: bool,
    skip_bad_rows: bool,
) -> _Analysis:
    """Return the analysis of files, read block by block because records at rest are long.

    :param choice: selection of the readings in each file.
    """
    # Flights and records need no file.
    from imu_sim_ros.formats.door import reading_blocks
    from imu_sim_ros.formats.handling import Handling

    if len(paths) > 1:  # a file that cannot be read is told before hours of another are read
        file_problems = Problems()
        for path in paths:
            with file_problems.collect():
                next(reading_blocks(path, choice, Handling(lambda count: None)), None)
        file_problems.tell()
    blocks_of_files = (
        reading_blocks(path, choice, Handling(tell_skipped(path) if skip_bad_rows else None))
        for path in paths
    )
    problems: list[str] = []
    notes: list[str] = []
    checked_blocks = (_judge_units(blocks, problems, notes) for blocks in blocks_of_files)
    reading = progress("read", lambda: sum(_count(path, choice.topic) for path in paths))
    with _prepend_problems(problems), reading as advance:
        result = analyse(checked_blocks, model=model, force=force, advance=advance)
    return _Analysis(result, problems, notes)


def _analyse_readings(readings: Readings, model: str, force: bool, check_units: bool) -> _Analysis:
    """Return the analysis of readings in memory.

    :param check_units: look for units that are not SI, which simulated readings cannot have.
    """
    problems: list[str] = []
    if check_units:
        _judge(readings, problems)
    with _prepend_problems(problems):
        result = analyse([[readings]], model=model, force=force)
    return _Analysis(result, problems, readings.notes)


@contextmanager
def _prepend_problems(problems: Sequence[str]) -> Iterator[None]:
    """Put what was found before in front of the reasons for which an analysis is refused.

    :param problems: lines, which are complete when the analysis ends.
    """
    try:
        yield
    except InputError as error:
        raise type(error)([*problems, *error.problems]) from None


def _judge_units(
    blocks: Iterable[Readings], problems: list[str], notes: list[str]
) -> Iterator[Readings]:
    """Yield blocks of readings unchanged; units that are not SI become problems.

    :param problems: receives a line for each problem.
    :param notes: receives the notes of the readings.
    """
    survey = ReadingSurvey(_relevant_findings)
    for block in blocks:
        if not survey.readings:
            notes += block.notes
        ALLAN.judge(survey.add(block), problems.append)
        yield block
    ALLAN.judge(survey.finish(), problems.append)


def _judge(readings: Readings, problems: list[str]) -> None:
    """Refuse readings that cannot be analysed, or warn of their faults.

    :param problems: receives a line for each problem that is told.
    """
    ALLAN.judge(_relevant_findings(readings, ReadingMeasures(readings)), problems.append)


def _relevant_findings(readings: Readings, measures: ReadingMeasures) -> list[Finding]:
    """Return the findings about readings, without those that the analysis tells itself."""
    findings = reading_findings(readings, measures)
    return [finding for finding in findings if finding.kind not in ALLAN.corrects]


def _count(path: Path, topic: str | None) -> int:
    """Return how many messages will be read; 0 for text files."""
    from imu_sim_ros.bags.read import open_bag

    try:
        with open_bag(path) as bag:
            return sum(
                info.count
                for info in bag.topics
                if info.type == "sensor_msgs/msg/Imu" and topic in (None, info.name)
            )
    except InputError:  # not a bag: a dataset, or the reader will say what is wrong
        return 0


def _triad(result: AllanResult, triad: int) -> TriadNoise:
    """Return the noise of gyroscope (0) or accelerometer (1)."""
    columns = slice(3 * triad, 3 * triad + 3)
    estimates = {}
    for key in result.keys:
        axes = [result.estimate(axis, key) for axis in range(6)[columns]]
        value = np.array([np.nan if axis.value is None else axis.value for axis in axes])
        low, high = np.array([axis.low for axis in axes]), np.array([axis.high for axis in axes])
        estimates[key] = Estimated(value, low, high, QUANTITIES[TRIADS[triad], key].unit)
    return TriadNoise(
        estimates["noise_density"],
        estimates.get("random_walk"),
        estimates.get("bias_instability"),
        estimates,
        result.deviation.deviation[:, columns],
    )


_OPTIONAL: Final = ("quantisation", "rate_ramp")


def _lines(
    result: AllanResult, comparisons: Sequence[ParameterComparison]
) -> Iterator[str | TextTable]:
    """Yield the report: the record, its warnings, and a table of the noise."""
    timing = result.timing
    yield f"{result.record}, stamp jitter {timing.jitter * 1e3:.3g} ms, {timing.lost} samples lost"
    for warning in result.warnings:
        yield f"note: {warning}"
    comparison_by_axis = {(c.axis, c.key): c for c in comparisons}
    for triad in range(len(TRIADS)):
        yield from _triad_tables(result, triad, comparison_by_axis)
    if comparisons:
        covered = sum(c.covered for c in comparisons)
        yield f"{covered} of {len(comparisons)} intervals contain the truth"


def _triad_tables(
    result: AllanResult, triad: int, by_axis: Mapping[tuple[int, str], ParameterComparison]
) -> Iterator[TextTable]:
    """Yield the terms of one sensor, each axis with its interval, then in data sheets' units."""
    header = ["", "axis", "value", "95 % interval", *(["truth", "covered"] if by_axis else [])]
    rows, names, field_rows = [], [], []
    for key in result.keys:
        axes = range(3 * triad, 3 * triad + 3)
        estimates = [result.estimate(axis, key) for axis in axes]
        has_truth = any((axis, key) in by_axis for axis in axes)
        if (
            key in _OPTIONAL
            and all(estimate.value is None for estimate in estimates)
            and not has_truth
        ):
            continue
        q = QUANTITIES[TRIADS[triad], key]
        names.append(f"{q.symbol} {q.text}")
        for axis, estimate in zip(axes, estimates, strict=True):
            row = [f"{q.symbol} [{q.unit}]", "xyz"[axis % 3], *_value_and_interval(estimate)]
            if by_axis:
                row += _truth_columns(by_axis.get((axis, key)))
            rows.append(row)
        values = [_value_and_interval(estimate, q.field_factor)[0] for estimate in estimates]
        field_rows.append([f"{q.symbol} [{q.field_unit}]", *values])
    yield TextTable(header, rows, f"{TRIADS[triad].capitalize()}: {', '.join(names)}")
    yield TextTable(["in data sheets' units", "x", "y", "z"], field_rows)


def _value_and_interval(estimate: Estimate, factor: float = 1.0) -> list[str]:
    """Return the cells of an estimate, value and 95 % interval, in a unit of the table."""
    if np.isinf(estimate.high):
        return ["not analysed", ""]
    if estimate.value is None:
        return [upper_bound(estimate.high * factor), ""]
    value, low, high = interval_texts(
        estimate.value * factor, estimate.low * factor, estimate.high * factor
    )
    return [value, f"{low} .. {high}"]


def _truth_columns(comparison: ParameterComparison | None) -> list[str]:
    """Return the cells of the true value, and whether the interval covers it."""
    if comparison is None:
        return ["", ""]
    return [f"{comparison.truth:.4g}", "yes" if comparison.covered else "NO"]
