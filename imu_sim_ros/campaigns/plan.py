# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plan of a campaign, checked as a whole before anything starts."""

import hashlib
import json
import os
import re
import shlex
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import imu_sim_ros
from imu_sim_ros.campaigns.cells import (
    SHORT,
    Axis,
    Cell,
    Layer,
    cell_count,
    cells,
    expand_names,
    read_axes,
    value_text,
)
from imu_sim_ros.campaigns.gate import Requirement, parse
from imu_sim_ros.campaigns.metrics import (
    Better,
    Relative,
    Tolerance,
    calibration_names,
    metric_names,
    parse_custom,
    parse_relative,
    parse_tolerance,
)
from imu_sim_ros.campaigns.parameters import (
    CALIBRATIONS,
    PLACES,
    CalibrationEstimator,
    CampaignParameters,
    CommandEstimator,
    DeadReckonEstimator,
    TimedFault,
    TrajectoryEstimator,
    find_estimator,
    read_faults,
)
from imu_sim_ros.core.errors import ConfigurationError, InputError, Problems, name_source
from imu_sim_ros.core.names import short_repr, suggestion
from imu_sim_ros.inputs.rows import is_present
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import build, flatten
from imu_sim_ros.places.neighbours import files_of
from imu_sim_ros.simulation.parameters import (
    SimulationParameters,
    join_layers,
    load_simulation,
)

Estimator = DeadReckonEstimator | CommandEstimator | CalibrationEstimator

_KEYS: Final = (
    *("parameters", "grid", "seeds", "faults", "estimators"),
    *("rpe", "metrics", "require", "tolerance"),
)
_COLUMNS: Final = (
    *("cell", "seed", "estimator", "status", "align", "digest", "version", "success"),
    *("common_time", "findings", "scenario"),
)
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,63}")
_MAX_SEEDS: Final = 1_000_000
"""Largest number of seeds."""
_MAX_CHECKED: Final = 2000
"""Largest number of cells of which all are built before the start."""
_MAX_PROBLEMS: Final = 20
"""Number of different problems after which no further cells are checked."""
_FILES: Final = ("trajectory.file", "trajectory.height_map", "scene.file", "scene.mesh")
"""Parameters that name files on which results depend."""


@dataclass(frozen=True)
class Plan:
    """Everything that determines a campaign's results."""

    options: CampaignParameters
    parameters: Layer
    axes: list[Axis]
    seeds: tuple[int, ...]
    faults: tuple[TimedFault, ...]
    estimators: dict[str, Estimator]
    relative: tuple[Relative, ...]
    require: list[Requirement]
    environment: dict[str, dict[str, str]] = field(default_factory=dict)
    """Variables that are set for the commands, by estimator."""
    custom_metrics: dict[str, Better] = field(default_factory=dict)
    """Metrics that programs write, and which values are better."""
    tolerance: Tolerance = Tolerance(0.02, relative=True)
    """Differences that do not matter."""
    folder: Path = Path()
    """Absolute path of the folder with the plan and the programs next to it."""

    def title(self) -> str:
        """Return the name and the number of runs."""
        counts = {"cell": cell_count(self.axes), "seed": len(self.seeds)}
        counts["estimator"] = len(self.estimators)
        factors = " x ".join(f"{n} {name}{'s' * (n != 1)}" for name, n in counts.items())
        runs = f"{self.run_count:,} run{'s' * (self.run_count != 1)}"
        return f"{self.options.name}: {factors} = {runs}"

    @property
    def metrics(self) -> tuple[str, ...]:
        """The names of all metrics, in the order of the results' columns."""
        return (*_metrics(self.relative, self.estimators), *self.custom_metrics)

    def alignment(self, estimator: str) -> str | None:
        """Return how an estimator's trajectory is aligned; None for those without one."""
        settings = self.estimators[estimator]
        if isinstance(settings, CalibrationEstimator):
            return None
        chosen = self.options.align if settings.align == "plan" else settings.align
        if chosen != "auto":
            return chosen
        return (
            "yaw"
            if any(isinstance(e, CommandEstimator) for e in self.estimators.values())
            else "none"
        )

    @property
    def grid_names(self) -> tuple[str, ...]:
        """The names of the grid's parameters."""
        return tuple(name for axis in self.axes for name in axis.names)

    @property
    def run_count(self) -> int:
        """Cells times seeds times estimators."""
        return cell_count(self.axes) * len(self.seeds) * len(self.estimators)

    def cells(self) -> Iterator[Cell]:
        """Yield the cells of the grid."""
        return cells(self.axes)

    def simulation(self, cell: Cell) -> SimulationParameters:
        """Return the parameters of a cell, with the first seed.

        :raises ConfigurationError: with one line per problem, after the cell's name.
        """
        with _prefix_cell(cell):
            layer = join_layers(self.parameters, cell.layer())
            parameters = load_simulation(layer, {"seed": self.seeds[0]})
            if parameters.imus:
                raise ConfigurationError(
                    f"imus = {list(parameters.imus)}: must be empty, a campaign simulates one IMU"
                )
            return parameters

    def scenario_values(
        self, parameters: SimulationParameters, estimator: str
    ) -> dict[str, object]:
        """Return by name the motion, sensors and comparison that define a run.

        Two campaigns with the same values can be compared on the same seeds: the seed, the
        versions, and the estimator itself, which is what changes between them, are left out.
        """
        values: dict[str, object] = dict(flatten(parameters))
        values.pop("seed")
        for name, digest in file_digests(values).items():
            values[name] = f"a file with the digest {digest[:16]}"  # wherever it lies
        values["faults"] = [(timed.start, repr(timed.fault)) for timed in self.faults]
        values["align"] = self.alignment(estimator)
        values["diverged_above"] = self.options.diverged_above
        path = self.estimators[estimator]
        if isinstance(path, TrajectoryEstimator):
            values[f"estimators.{estimator}.coverage"] = path.coverage
            values[f"estimators.{estimator}.max_gap"] = path.max_gap
            allowance = path.initialisation_allowance
            values[f"estimators.{estimator}.initialisation_allowance"] = allowance
        return values

    def scenario(self, parameters: SimulationParameters, estimator: str) -> str:
        """Return a digest of :meth:`scenario_values`, as 16 hex digits."""
        return _digest(self.scenario_values(parameters, estimator))

    def digest(self, parameters: SimulationParameters, estimator: str) -> str:
        """Return a digest of everything but the seed that a run depends on, as 16 hex digits."""
        values = flatten(parameters)
        values.pop("seed")
        content = {
            "version": imu_sim_ros.__version__,
            "parameters": values,
            "files": file_digests(values),
            "faults": [(timed.start, repr(timed.fault)) for timed in self.faults],
            "estimator": flatten(self.estimators[estimator]),
            "align": self.alignment(estimator),
            "environment": self.environment.get(estimator, {}),
            "metrics": self.metrics,
            "diverged_above": self.options.diverged_above,
        }
        return _digest(content)


def _digest(content: Mapping[str, object]) -> str:
    """Return a digest of values by name, as 16 hex digits."""
    text = json.dumps(content, sort_keys=True, default=list)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _metrics(
    relative: tuple[Relative, ...], estimators: Mapping[str, Estimator]
) -> tuple[str, ...]:
    """Return the names of the metrics that the estimators can have."""
    kinds = {estimator.type for estimator in estimators.values()}
    poses = () if kinds and kinds <= set(CALIBRATIONS) else metric_names(relative)
    return (*poses, *calibration_names(kinds))


@contextmanager
def _prefix_cell(cell: Cell) -> Iterator[None]:
    """Prefix every problem with the cell's name."""
    try:
        yield
    except ConfigurationError as error:
        where = f"cell {cell.name}: " if cell.values else ""
        raise ConfigurationError([f"{where}{line}" for line in error.problems]) from None


def file_digests(values: Mapping[str, object]) -> dict[str, str]:
    """Return digests of the files of trajectory and scene, by parameter.

    The digest of a mesh includes its materials and textures.
    """
    digests = {}
    for name in _FILES:
        path = Path(str(values.get(name, "")))
        if str(values.get(name, "")) and path.is_file():
            paths = files_of(path) if name == "scene.mesh" else [path]
            digests[name] = ",".join(
                hashlib.sha256(part.read_bytes()).hexdigest() for part in paths
            )
    return digests


def load_plan(path: Path) -> Plan:
    """Read a plan; its cells are checked by :func:`check_plan`.

    :raises ConfigurationError: with a line for each problem.
    """
    with name_source(path, ConfigurationError):
        plan = read_plan(files.read_tree(path, "a plan (names such as grid, seeds and estimators)"))
    return replace(plan, folder=path.absolute().parent)


def check_plan(plan: Plan, path: Path) -> None:
    """Check the parameters of every cell, and that the programs of this machine exist.

    :raises ConfigurationError: with a line for each problem.
    """
    with name_source(path, ConfigurationError):
        check_cells(plan)
        problems = list_missing_files(plan)
        if problems:
            raise ConfigurationError(problems)


def list_missing_files(plan: Plan) -> list[str]:
    """Return a line for each program or file that a plan names and that is not on this machine."""
    problems = []
    for name, file in sorted(_named_files(plan)):
        try:
            if not file.is_dir() and not is_present(file):
                problems.append(f"{name} = {file}: does not exist")
        except InputError as error:
            problems += [f"{name} = {line}" for line in error.problems]
    for name, estimator in plan.estimators.items():
        if not isinstance(estimator, CommandEstimator):
            continue
        try:
            arguments = shlex.split(estimator.command)
        except ValueError as error:
            problems.append(f"estimators.{name}.command: {error}")
            continue
        path = plan.environment.get(name, {}).get("PATH")
        if (
            not estimator.shell
            and "{" not in arguments[0]
            and program(plan, arguments[0], path) is None
        ):
            problems.append(
                f"estimators.{name}.command: {arguments[0]}: no such program, neither in PATH "
                f"nor in {plan.folder}"
            )
        # The words of a shell may be anything; files next to the plan or in the package must exist.
        folders = {"{plan}": plan.folder, "{share}": files.config_folder().parent}
        for argument in arguments:
            root, _, rest = argument.partition("/")
            if root in folders and "{" not in rest and not (folders[root] / rest).exists():
                problems.append(
                    f"estimators.{name}.command: {folders[root] / rest}: does not exist"
                )
    return problems


def _named_files(plan: Plan) -> set[tuple[str, Path]]:
    """Return the files of trajectories and scenes that the cells use, with their parameters."""
    named_files = set()
    for cell in _vary_axes(plan.axes) if plan.axes else plan.cells():
        layer = {**plan.parameters, **cell.layer()}
        for name in _FILES:
            if layer.get(name):
                named_files.add((name, Path(str(layer[name]))))
    return named_files


def program(plan: Plan, argument: str, path: str | None) -> str | None:
    """Return the program that the first word of a command means; None: there is none.

    :param path: the variable PATH; None: that of this process.
    """
    in_folder = plan.folder / argument
    if os.access(in_folder, os.X_OK) and in_folder.is_file():
        return str(in_folder)
    return shutil.which(argument, path=path)


def find_plan(name_or_file: str) -> Path:
    """Return the plan of a name in config/campaigns, or the given file."""
    return files.find("campaigns", name_or_file)


def read_plan(tree: Mapping[str, object]) -> Plan:
    """Return the plan that a file's content describes.

    :raises ConfigurationError: with a line for each problem.
    """
    problems = Problems()

    def attempt(read_section: Callable[[], object], otherwise: object) -> Any:
        try:
            return read_section()
        except ConfigurationError as error:
            problems.extend(error.problems)
            return otherwise

    rest = {str(key): value for key, value in tree.items() if key not in _KEYS}
    options = attempt(lambda: build(CampaignParameters, rest), CampaignParameters())
    layer = attempt(lambda: _layer(tree.get("parameters")), {})
    axes = attempt(lambda: read_axes(tree.get("grid")), [])
    seeds = attempt(lambda: _seeds(tree.get("seeds", 1)), (0,))
    faults = attempt(lambda: read_faults(tree.get("faults")), ())
    estimators, environment = attempt(lambda: _estimators(tree.get("estimators")), ({}, {}))
    relative = attempt(lambda: parse_relative(tree.get("rpe")), ())
    names = [name for axis in axes for name in axis.names]
    built_in = _metrics(relative, estimators)
    custom_metrics = attempt(
        lambda: parse_custom(tree.get("metrics"), [*built_in, *_COLUMNS, *names]), {}
    )
    metrics = [*built_in, *custom_metrics]
    tolerance = attempt(lambda: parse_tolerance(tree.get("tolerance", "2 %")), None)
    require = attempt(lambda: parse(tree.get("require"), metrics, axes, list(estimators)), [])
    problems += [f"grid.{name}: is also in parameters" for name in names if name in (layer or {})]
    if "seed" in names or "seed" in layer:
        problems.append("seed: is given by seeds, not by parameters or grid")
    problems.tell()
    return Plan(
        options=options,
        parameters=layer,
        axes=axes,
        seeds=seeds,
        faults=faults,
        estimators=estimators,
        relative=relative,
        require=require,
        environment=environment,
        custom_metrics=custom_metrics,
        tolerance=tolerance,
    )


def check_cells(plan: Plan) -> None:
    """Build every cell's parameters; of a very large grid, those along each axis.

    :raises ConfigurationError: with one line per problem, however many cells have it, and the
        values of the grid that all of them have.
    """
    exhaustive = cell_count(plan.axes) <= _MAX_CHECKED
    cells, cells_by_problem = 0, dict[str, list[Cell]]()
    for cell in plan.cells() if exhaustive else _vary_axes(plan.axes):
        cells += 1
        try:
            _check_cell(plan, cell)
        except ConfigurationError as error:
            for line in error.problems:
                cells_by_problem.setdefault(line.removeprefix(f"cell {cell.name}: "), []).append(
                    cell
                )
        if len(cells_by_problem) >= _MAX_PROBLEMS:
            break
    if cells_by_problem:
        lines = [
            _grid_problem(line, affected, cells) for line, affected in cells_by_problem.items()
        ]
        note = ["further cells are not checked"] if len(cells_by_problem) >= _MAX_PROBLEMS else []
        raise ConfigurationError(lines + note)


def _grid_problem(line: str, affected: list[Cell], cells: int) -> str:
    """Return a problem together with the values of the grid that cause it.

    :param affected: the cells that have the problem.
    :param cells: the number of cells.
    """
    values = affected[0].values
    if any(line.startswith((f"{name} = ", f"{name}: ")) for name in values):
        return f"grid.{line}"
    if len(affected) == cells:
        return line
    common = [
        name for name in values if all(cell.values[name] == values[name] for cell in affected)
    ]
    if len(common) == 1:
        return f"grid.{common[0]} = {value_text(values[common[0]])}: {line}"
    labels = ", ".join(f"{name}={value_text(values[name])}" for name in common)
    return f"cell {labels}: {line}" if labels else f"{len(affected)} of {cells} cells: {line}"


def _check_cell(plan: Plan, cell: Cell) -> None:
    """Refuse estimators that need tracks where a cell has no camera."""
    if plan.simulation(cell).cameras:
        return
    for name, estimator in plan.estimators.items():
        if isinstance(estimator, CommandEstimator) and estimator.dataset == "tracks":
            raise ConfigurationError(
                f"estimators.{name}.dataset = tracks: needs a camera; parameters: "
                "{camera: euroc_cam0} is one"
            )


def _vary_axes(axes: list[Axis]) -> Iterator[Cell]:
    """Yield cells that vary one axis at a time, the others at their first value."""
    base = {
        name: value for axis in axes for name, value in zip(axis.names, axis.rows[0], strict=True)
    }
    for axis in axes:
        for row in axis.rows:
            yield Cell(-1, {**base, **dict(zip(axis.names, row, strict=True))})


def _layer(content: object) -> Layer:
    """Return the parameters of a plan; short names (imu, trajectory) are expanded."""
    if content is None:
        return {}
    layer = files.dotted_values(content, "parameters")
    short = {name: layer.pop(name) for name in list(layer) if name in SHORT}
    return join_layers(expand_names(short), layer)


def _seeds(content: object) -> tuple[int, ...]:
    """Return the seeds that a plan states: a count, or a list."""
    allowed = "must be a count (50: seeds 0 to 49) or a list of integers, each at least 0"
    problem = ConfigurationError(f"seeds = {short_repr(content)}: {allowed}")
    if isinstance(content, bool):
        raise problem
    if isinstance(content, int):
        if not 1 <= content <= _MAX_SEEDS:
            raise ConfigurationError(
                f"seeds = {content}: must be at least 1 and at most {_MAX_SEEDS}"
            )
        return tuple(range(content))
    if not isinstance(content, list) or not content:
        raise problem
    for seed in content:
        if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**63:
            raise problem
    if len(set(content)) != len(content):
        raise ConfigurationError(f"seeds = {short_repr(content)}: a seed is given twice")
    return tuple(content)


def _estimators(content: object) -> tuple[dict[str, Estimator], dict[str, dict[str, str]]]:
    """Return the estimators of a plan by name, and the environment variables of each."""
    if content is None:
        return {"dead_reckon": DeadReckonEstimator()}, {}
    if isinstance(content, list):
        content = {str(name): {} if name == "dead_reckon" else _template(name) for name in content}
    if not isinstance(content, Mapping) or not content:
        raise ConfigurationError(
            f"estimators = {short_repr(content)}: must hold a name and parameters for each"
        )
    estimators, environment, problems = {}, {}, Problems()
    for name, entry in content.items():
        if not _NAME.fullmatch(str(name)):
            problems.append(
                f"estimators: {short_repr(name)}: a name may contain letters, digits, _, ., + and "
                "- only, and at most 64 characters"
            )
            continue
        with problems.collect(prefix=f"estimators.{name}: "):
            estimators[str(name)], variables = _estimator(entry)
            if variables:
                environment[str(name)] = variables
    problems.tell()
    return estimators, environment


def _template(name: object) -> dict[str, object]:
    """Return the content of a file in config/estimators."""
    return dict(files.read_tree(files.find("estimators", str(name))))


def _estimator(entry: object) -> tuple[Estimator, dict[str, str]]:
    """Return one estimator, and the environment variables of its command."""
    if entry is None:
        entry = {}
    if not isinstance(entry, Mapping):
        raise ConfigurationError(f"{short_repr(entry)}: must hold names and values")
    content = dict(entry)
    template = content.pop("template", None)
    if template is not None:
        content = {**_template(template), **content}
    values = {str(key): value for key, value in content.items()}
    variables = values.pop("environment", {})
    if not isinstance(variables, Mapping) or any(
        not isinstance(key, str) or not key or "=" in key or "\0" in f"{key}{value}"
        for key, value in variables.items()
    ):
        raise ConfigurationError(
            f"environment = {short_repr(variables)}: must hold names and strings"
        )
    kind = str(values.get("type", "command" if "command" in values else "dead_reckon"))
    estimator: Estimator = build(find_estimator(kind), {**values, "type": kind})
    if isinstance(estimator, CommandEstimator):
        unknown = [p for p in re.findall(r"{(\w*)}", estimator.command) if p not in PLACES]
        if unknown:
            hint = suggestion(f"{{{unknown[0]}}}", (f"{{{name}}}" for name in PLACES))
            raise ConfigurationError(f"command: {{{unknown[0]}}}: {hint}")
    return estimator, {key: str(value) for key, value in variables.items()}
