# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What ``generate`` does with cameras: their arguments, and the datasets of what they see."""

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imu_sim_ros import program
from imu_sim_ros.bags.text import writer
from imu_sim_ros.bags.text.writer import Dataset
from imu_sim_ros.commands import bag_output
from imu_sim_ros.conventions import TRUTH_TOPIC
from imu_sim_ros.datasets.topics import BagTarget, DatasetTarget, body_of, imus_of
from imu_sim_ros.errors import ConfigurationError, InputError
from imu_sim_ros.machine import cores
from imu_sim_ros.navigation.association import poses_at
from imu_sim_ros.parameters import files
from imu_sim_ros.parameters.sections import flatten
from imu_sim_ros.poses import PoseSequence
from imu_sim_ros.sensors.block import ImuBlock
from imu_sim_ros.simulation.engine import Simulation
from imu_sim_ros.simulation.parameters import SimulationParameters
from imu_sim_ros.simulation.playback import (
    SimulatorParameters,
    has_cameras,
    load_simulator,
    of_the_node,
    simulations,
)

if TYPE_CHECKING:
    from imu_sim_ros.sensors.camera.rig import Rig
    from imu_sim_ros.sensors.camera.rig_parameters import RigParameters

HELP: Final = (
    "folder of generate --format tracks: report the reprojection error, in pixels, of its "
    "landmarks as seen from the estimate; poses further apart than 20 ms are not interpolated"
)
_LONGEST_GAP_NS: Final = 20_000_000
_SAME_NS: Final = 1_000


def reprojection(folder: Path, estimate: PoseSequence, truth: PoseSequence) -> list[dict[str, Any]]:
    """Return for each camera how far features lie from where the estimate, and the truth, see them.

    :param estimate: aligned with the world of the landmarks.
    :raises InputError: where no feature has a pose of the estimate.
    """
    from imu_sim_ros.camera import reprojection_errors  # most evaluations have no camera
    from imu_sim_ros.datasets.tracks import read_track_folder

    tracks = read_track_folder(folder)
    result = []
    for k, (name, camera) in enumerate(tracks.cameras.items()):
        rows = np.flatnonzero((tracks.camera == k) & ~tracks.wrong)
        row = tracks.uv[rows, 1] - 0.5 * (camera.height - 1)
        t_ns = tracks.true_t_ns[rows] + np.rint(camera.row_time * row * 1e9).astype(np.int64)
        known = _known(estimate.t_ns, t_ns) & _known(truth.t_ns, t_ns)
        rows, t_ns = rows[known], t_ns[known]
        if not len(rows):
            continue
        points, uv = tracks.landmarks[tracks.landmark[rows]], tracks.uv[rows]
        entry: dict[str, Any] = {"camera": name, "features": len(rows)}
        for what, poses in (("", estimate), ("_of_truth", truth)):
            at = poses_at(poses, t_ns)
            errors = reprojection_errors(camera, at.position, at.q_wb, points, uv)
            lengths = np.linalg.norm(errors[np.isfinite(errors[:, 0])], axis=1)
            entry["behind" + what] = len(errors) - len(lengths)
            entry["rms_px" + what] = _rms(lengths)
            entry["median_px" + what] = float(np.median(lengths)) if len(lengths) else None
        result.append(entry)
    if not result:
        raise InputError(
            f"{folder}: no frame has poses of estimate and truth at its time, or within 20 ms "
            "before and after it"
        )
    return result


def _rms(lengths: NDArray[np.float64]) -> float | None:
    """Return the deviation in u and in v: the root of half the mean square of the distances."""
    return float(np.sqrt(np.mean(lengths**2) / 2.0)) if len(lengths) else None


def _known(poses_ns: NDArray[np.int64], at_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return at which times there is a pose, or are two that are near enough to interpolate."""
    after = np.searchsorted(poses_ns, at_ns)
    before = poses_ns[np.clip(after - 1, 0, len(poses_ns) - 1)]
    following = poses_ns[np.clip(after, 0, len(poses_ns) - 1)]
    near = np.minimum(np.abs(at_ns - before), np.abs(at_ns - following)) <= _SAME_NS
    between = (before <= at_ns) & (at_ns <= following) & (following - before <= _LONGEST_GAP_NS)
    return np.asarray((near | between) & (at_ns >= poses_ns[0]) & (at_ns <= poses_ns[-1]))


def lines(result: list[dict[str, Any]]) -> list[str]:
    """Return what was found, a line for each camera."""
    return [
        f"reprojection, {entry['camera']}: {_shown(entry['rms_px'])} px in u and in v over "
        f"{entry['features']:,} features; from the true poses {_shown(entry['rms_px_of_truth'])} px"
        + (f"; {entry['behind']} landmarks would not be seen" if entry["behind"] else "")
        for entry in result
    ]


def _shown(value: float | None) -> str:
    return "no" if value is None else f"{value:.3g}"


CAMERA_FORMATS: Final = ("tracks", "tum_vi", "vio_data_simulation")
"""Datasets that need a camera."""
IMAGE_FORMATS: Final = ("euroc", "csv")
"""Datasets that take images."""
FORMATS: Final = (*writer.FORMATS, *CAMERA_FORMATS)
"""Datasets that generate writes."""


class Asked(NamedTuple):
    """What the arguments ask for."""

    simulator: SimulatorParameters
    rig: "RigParameters | None"
    """The cameras, where there are some."""

    def values(self) -> dict[str, Any]:
        """Return everything that decides the samples and frames, by dotted name."""
        simulated = flatten(simulations(self.simulator).get("", self.simulator))
        node = set(of_the_node(simulated))
        own = {name: value for name, value in simulated.items() if name not in node}
        return {**own, **(flatten(self.rig) if self.rig else {})}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that choose cameras and scene."""
    group = parser.add_argument_group("cameras")
    group.add_argument(
        "--camera",
        metavar="NAME|FILE",
        action="append",
        default=[],
        help="camera: a preset (see --list-cameras) or a file; repeatable, named cam0, cam1, "
        "... in order",
    )
    group.add_argument(
        "--jobs",
        metavar="N",
        type=int,
        default=cores(),
        help="number of threads that render images (default: one per processor)",
    )
    group.add_argument(
        "--scene",
        metavar="NAME|FILE",
        help="scene: a preset (see --list-scenes), a parameter file, or points (CSV, PLY)",
    )


def parameters(arguments: argparse.Namespace) -> Asked:
    """Return what the arguments ask for: the IMUs, and the cameras where there are some.

    :raises ConfigurationError: with one line per problem with either.
    """
    *below, last = program.simulation_layers(arguments)
    given: dict[str, object] = {}
    for values in below:
        given.update(values)
    _put_short(given, _short(arguments), len(arguments.camera))
    given.update(last)
    if not (arguments.quiet or arguments.json):
        for note in _notes(arguments, below[:-1], of_the_node(given)):
            print(f"generate: note: {note}", file=sys.stderr)
    if not has_cameras(given):
        return Asked(load_simulator(given), None)
    from imu_sim_ros.sensors.camera.rig_parameters import load_rig, rig_problems, split_rig
    from imu_sim_ros.simulation.cameras import fitted

    of_rig, others = split_rig(fitted(given))
    problems: list[str] = []
    loaded: list[Any] = []
    for load, values in ((load_simulator, others), (load_rig, of_rig)):
        try:
            loaded.append(load(values))
        except ConfigurationError as error:
            problems += error.problems
    if not problems:
        problems += rig_problems(loaded[1], loaded[0])
    if problems:
        raise ConfigurationError(problems)
    return Asked(*loaded)


def _notes(
    arguments: argparse.Namespace,
    in_files: Iterable[Mapping[str, object]],
    node: Iterable[str],
) -> Iterator[str]:
    """Yield what a user may not expect of parameters that are allowed.

    :param in_files: the parameters that stand in files.
    :param node: names of parameters that only a node has.
    """
    shown = dict.fromkeys(name.partition("./")[0] for name in node)  # one for all topics
    if shown:
        yield f"no effect in a file: {', '.join(shown)}"
    every = dict.fromkeys(name for values in in_files for name in values)
    above = [name for name in every if name.startswith("imu.") and name != "imu.preset"]
    if arguments.imu is not None and above:
        others = f" and {len(above) - 3} more" if len(above) > 3 else ""
        yield (
            f"--imu {arguments.imu} is what the parameter file starts from; "
            f"the file's own values count: {', '.join(above[:3])}{others}"
        )


def _put_short(given: dict[str, object], short: Mapping[str, object], cameras: int) -> None:
    """Put short arguments above the files', whose further cameras do not count beside ``--camera``.

    :param cameras: how many ``--camera`` there are.
    """
    named = given.get("cameras")
    if cameras and isinstance(named, list):
        gone = set(map(str, named)) - {f"cam{k}" for k in range(cameras)}
        for name in [name for name in given if name.partition(".")[0] in gone]:
            del given[name]
    given.update(short)


def _short(arguments: argparse.Namespace) -> dict[str, object]:
    result: dict[str, object] = {}
    if arguments.camera:
        result["cameras"] = [f"cam{k}" for k in range(len(arguments.camera))]
        for k, name in enumerate(arguments.camera):
            result[f"cam{k}.camera.preset"] = name
    if arguments.scene is not None:
        from imu_sim_ros.sensors.camera.rig_parameters import scene_layer

        result.update(scene_layer(arguments.scene))
    return result


def rig(parameters: "RigParameters | None", simulation: Simulation) -> "Rig | None":
    """Return the cameras of a simulation, with their scene."""
    if parameters is None or not parameters.cameras:
        return None
    from imu_sim_ros.sensors.camera.rig import Rig

    duration = simulation.parameters.duration or simulation.trajectory.duration
    seed = simulation.parameters.seed
    result = Rig(parameters, simulation.trajectory, simulation.t0_ns, duration, seed)
    _warn([f"{name}: {line}" for name in result.views for line in result.warnings(name)])
    return result


def check_form(form: str | None, path: Path, cameras: "Rig | None", imus: int) -> None:
    """Refuse cameras and IMUs where a form has no place for them, and a form that wants some.

    :param imus: how many there are.
    :raises InputError: with what to give.
    """
    if form in ("tum_vi", "vio_data_simulation") and imus > 1:
        raise InputError(f"format {form}: holds one IMU, not {imus}")
    forms = (*CAMERA_FORMATS, *IMAGE_FORMATS)
    if cameras is not None and form is not None and (form not in forms or path.suffix == ".csv"):
        raise InputError(f"cameras: need a bag, or a folder and --format {', '.join(forms)}")
    if cameras is None and form in CAMERA_FORMATS:
        raise InputError(f"format {form}: needs a camera; --camera names one")


def write_parameters(folder: Path, name: str, asked: Asked) -> None:
    """Write everything that makes an output into a parameter file.

    :param name: of the output.
    """
    files.write(
        asked.values(),
        folder / "simulation.yaml",
        comment=f"All parameters of {name}:\n"
        "generate --params-file simulation.yaml generates the same samples.",
    )


class CameraTarget(DatasetTarget):
    """A folder of readings, truth, and what cameras see: tracks or images."""

    block_size: Final = 512
    """Samples in a block at most: frames take far longer, and the progress bar should move."""

    def __init__(
        self, dataset: Dataset, seen: Any, imus: Sequence[str], further: Sequence[str] = ()
    ) -> None:
        super().__init__(dataset, imus, further)
        self.seen = seen
        self._body = body_of(imus)

    def described(self) -> str:
        """Return how much was written, of readings and of what each camera saw."""
        return f"{super().described()}, {self.seen.described()}"

    @property
    def counts(self) -> dict[str, int]:
        """Rows by table, images by camera."""
        return {**super().counts, **self.seen.counts}

    def write(self, blocks: Mapping[str, ImuBlock]) -> None:
        """Write the rows of a window, and those of the frames taken until the body's last."""
        super().write(blocks)
        if self._body in blocks:
            self.seen.until(int(blocks[self._body].true_t_ns[-1]) + 1)


@contextmanager
def opened(
    form: str,
    output: Path,
    cameras: "Rig",
    names: dict[str, str],
    simulated: Mapping[str, SimulationParameters],
    arguments: argparse.Namespace,
) -> Iterator[Any]:
    """Open a dataset with cameras; it is complete when the block ends without an error.

    :param names: of the topics that are written.
    :param simulated: the parameters of each IMU.
    """
    from imu_sim_ros.datasets.tracks import TrackFiles
    from imu_sim_ros.datasets.tum_vi import TumVi
    from imu_sim_ros.datasets.vio_data_simulation import VioDataSimulation

    imus = imus_of(simulated)
    if form == "tum_vi":
        _check_jobs(arguments)
        with TumVi(output, cameras, simulated[imus[0]].imu, arguments.jobs) as sequence:
            yield sequence
        return
    if form == "vio_data_simulation":
        with VioDataSimulation(output, cameras, cameras.trajectory) as target:
            yield target
        _warn(target.warnings())
        return
    with (
        Dataset(output, "csv", TRUTH_TOPIC in names, len(imus)) as dataset,
        TrackFiles(output, cameras) as tracks,
    ):
        combined = CameraTarget(dataset, tracks, imus)
        yield combined
    _warn(tracks.warnings())
    combined.files = dataset.files


def topics(arguments: argparse.Namespace, rig: "RigParameters | None") -> list[str]:
    """Return the topics that the cameras have in a bag; none in any other form."""
    if rig is None or not rig.cameras or bag_output.form(arguments) is not None:
        return []
    from imu_sim_ros.datasets.features import camera_topics

    return list(camera_topics(rig))


@contextmanager
def in_bag(
    bag: BagTarget, cameras: "Rig", names: Mapping[str, str], arguments: argparse.Namespace
) -> Iterator[Any]:
    """Open what cameras see beside the readings in a bag.

    :param names: of the cameras' topics.
    """
    _check_jobs(arguments)
    from imu_sim_ros.datasets.camera_bag import CameraBag

    with CameraBag(bag, cameras, names, arguments.jobs, bag.world_frame) as target:
        yield target


def _check_jobs(arguments: argparse.Namespace) -> None:
    if arguments.jobs < 1:
        raise InputError(f"--jobs {arguments.jobs}: must be at least 1")


@contextmanager
def images(
    form: str, output: Path, cameras: "Rig", arguments: argparse.Namespace, comment: str
) -> Iterator[Any]:
    """Open the images of a dataset's cameras; the folder exists."""
    _check_jobs(arguments)
    from imu_sim_ros.datasets.images import ImageFolders

    with ImageFolders(output, cameras, form, arguments.jobs, comment) as seen:
        yield seen


def _warn(lines: list[str]) -> None:
    for line in lines:
        print(f"generate: warning: {line}", file=sys.stderr)
