# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An estimator that is a program: its process, its limits, its trajectory."""

import contextlib
import ctypes
import functools
import json
import os
import re
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from imu_sim_ros.campaigns.comparison import (
    RunOutcome,
    check,
    coverage_metrics,
    estimate_metrics,
)
from imu_sim_ros.campaigns.estimate_findings import estimate_findings
from imu_sim_ros.campaigns.metrics import Metrics
from imu_sim_ros.campaigns.parameters import CommandEstimator
from imu_sim_ros.campaigns.plan import program
from imu_sim_ros.campaigns.results import run_folder_path
from imu_sim_ros.campaigns.run_files import write_config, write_dataset
from imu_sim_ros.campaigns.simulated import SimulatedCell
from imu_sim_ros.core.errors import ImuSimError, InputError
from imu_sim_ros.core.names import short_repr
from imu_sim_ros.formats.door import read_states
from imu_sim_ros.inputs.rows import open_regular
from imu_sim_ros.parameters import files
from imu_sim_ros.recordings.findings.pose_order import sort_poses
from imu_sim_ros.sensors.samples import Samples

METRICS: Final = "metrics.json"
"""File for the plan's own metrics, written by the program."""
_LARGEST_METRICS: Final = 1_000_000
"""Largest size of a file of metrics [bytes]."""
OUTPUT: Final = "output.txt"
"""File with the output of the program."""
_POLL: Final = 0.2
"""Period of checking the folder's size [s]; the program's end is noticed at once."""
_PR_SET_PDEATHSIG: Final = 1
"""Operation of prctl(2): a signal to this process when its parent ends."""
_PR_SET_CHILD_SUBREAPER: Final = 36
"""Operation of prctl(2): orphaned descendants become children of this process."""
_PROGRAM_LOCK: Final = threading.Lock()
"""Held while a program runs: its orphans cannot be told from those of a second program."""
ESTIMATES: Final = {"tum": "estimate.txt", "euroc": "estimate.csv", "bag": "estimate"}
"""File or folder of the estimated trajectory by format."""


class ProgramEnd(NamedTuple):
    """Exit of a program, with its time and memory."""

    status: int | None
    """Exit status, negative for a signal; None: the program was killed for ``reason``."""
    reason: str
    """Limit for which it was ended; empty: it ended by itself."""
    wall_s: float
    """Time from its start to its end [s]."""
    peak_memory_mb: float
    """Largest memory of its processes [MB]."""


def run_command(
    cell: SimulatedCell,
    estimator: CommandEstimator,
    name: str,
    seed: int,
    block: Samples,
    folder: Path,
    outcome: RunOutcome,
) -> None:
    """Write the dataset, run the program, and compare its trajectory with the truth.

    :param folder: folder of the campaign; the run's own folder is made in it.
    :param outcome: receives the measured values, even if the run fails.
    :raises InputError: if there is no usable trajectory, with the reason.
    """
    # Absolute: the program works in its own folder, where a relative name would lead elsewhere.
    run_folder = run_folder_path(folder.absolute(), cell.cell.number, seed, name)
    shutil.rmtree(run_folder, ignore_errors=True)
    keep = cell.plan.options.keep
    failed, metrics = True, outcome.metrics
    try:
        run_folder.mkdir(parents=True)
        command = _command(cell, estimator, seed, run_folder)
        if not estimator.shell:
            variables = cell.plan.environment.get(name, {})
            command[0] = program(cell.plan, command[0], variables.get("PATH")) or command[0]
        end = _run(command, estimator, cell.plan.environment.get(name, {}), run_folder)
        metrics["wall_s"] = end.wall_s
        metrics["peak_memory_mb"] = end.peak_memory_mb
        if end.reason or end.status != 0:
            metrics.update(_partial_coverage(estimator, block, run_folder))
            raise InputError(end.reason or f"{_status_text(end.status)}{_last_line(run_folder)}")
        _compare(cell, estimator, str(cell.plan.alignment(name)), block, run_folder, outcome)
        metrics.update(_custom_metrics(cell.plan.custom_metrics, run_folder / METRICS))
        metrics["real_time_factor"] = _duration(block) / max(end.wall_s, 1e-9)
        check(metrics, cell.plan.options.diverged_above, estimator)
        failed = False
    except OSError as error:
        raise InputError(f"{error.strerror or error}") from None
    finally:
        if keep == "none" or (keep == "failed" and not failed):
            shutil.rmtree(run_folder, ignore_errors=True)
            with contextlib.suppress(OSError):
                run_folder.parent.rmdir()


def _duration(block: Samples) -> float:
    """Return the length of a run [s]."""
    return float(block.true_t_ns[-1] - block.true_t_ns[0]) * 1e-9


def _command(
    cell: SimulatedCell, estimator: CommandEstimator, seed: int, run_folder: Path
) -> list[str]:
    """Write the files that the command refers to; return its arguments, placeholders filled."""

    placeholders = set(re.findall(r"{(\w+)}", estimator.command))
    values = {
        "folder": str(run_folder),
        "seed": str(seed),
        "python": sys.executable,
        "share": str(files.config_folder().parent),
        "plan": str(cell.plan.folder),
        "estimate": str(run_folder / ESTIMATES[estimator.estimate]),
        "dataset": "",
        "config": "",
    }
    if "dataset" in placeholders:
        values["dataset"] = str(write_dataset(cell, estimator.dataset, seed, run_folder))
    if "config" in placeholders:
        values["config"] = str(write_config(cell, seed, run_folder))

    def fill(template: str, quote: bool) -> str:
        return re.sub(
            r"{(\w+)}",
            lambda match: shlex.quote(values[match[1]]) if quote else values[match[1]],
            template,
        )

    if estimator.shell:
        return ["/bin/sh", "-c", fill(estimator.command, quote=True)]
    return [fill(template, quote=False) for template in shlex.split(estimator.command)]


def _run(
    command: Sequence[str], estimator: CommandEstimator, variables: dict[str, str], run_folder: Path
) -> ProgramEnd:
    """Run a program to its end and remove everything that it leaves running."""
    with _PROGRAM_LOCK:
        return _run_locked(command, estimator, variables, run_folder)


def _run_locked(
    command: Sequence[str], estimator: CommandEstimator, variables: dict[str, str], run_folder: Path
) -> ProgramEnd:
    """Run a program in its folder to its end, and end all processes that it leaves."""
    earlier_children, worker = _children(), os.getpid()
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    started, memory = time.monotonic(), _PeakMemory()
    with (run_folder / OUTPUT).open("wb") as output:
        try:
            process = subprocess.Popen(
                command,
                cwd=run_folder,
                env=_environment(variables, command),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=lambda: _begin_program(estimator, worker),
            )
        except (OSError, ValueError, subprocess.SubprocessError) as error:
            raise InputError(
                f"{command[0] if command else ''}: cannot be started: {error}"
            ) from None
    try:
        status, reason, peak = _wait(process, estimator, run_folder, started, memory)
    finally:
        _kill_all(process.pid, earlier_children)
    return ProgramEnd(status, reason, time.monotonic() - started, peak)


def _environment(variables: dict[str, str], command: Sequence[str]) -> dict[str, str]:
    """Return the environment of a program: without the variables of this Python for other ones."""
    if command[:1] == [sys.executable]:
        return {**os.environ, **variables}
    python_variables = ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "PYTHONPATH", "PYTHONHOME")
    environment = {
        name: value for name, value in os.environ.items() if name not in python_variables
    }
    if "_ROS_WHEELS_BOOTSTRAP_COMPLETE" in os.environ:
        environment.pop("LD_LIBRARY_PATH", None)
    return {**environment, **variables}


def _begin_program(estimator: CommandEstimator, worker: int) -> None:
    """Set the limits of the program, in its process before it begins."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != worker:  # the worker died before this call
        os._exit(1)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    largest = int(estimator.disk_limit)
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if estimator.memory_limit:
        memory = int(estimator.memory_limit)
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))


def _wait(
    process: "subprocess.Popen[bytes]",
    estimator: CommandEstimator,
    run_folder: Path,
    started: float,
    memory: "_PeakMemory",
) -> tuple[int | None, str, float]:
    """Wait for the program's end; return status, why it was ended, and its peak memory [MB]."""
    deadline = started + estimator.timeout
    pause, next_check = 0.001, started + _POLL
    while True:
        memory.update(process.pid)
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            # The limit of a single file's size ends a program before the folder is checked.
            full = process.returncode == -signal.SIGXFSZ or (
                process.returncode != 0 and _size(run_folder) >= estimator.disk_limit
            )
            reason = _disk_problem(estimator) if full else ""
            return process.returncode, reason, memory.final(usage)
        time_s = time.monotonic()
        if time_s >= deadline:
            return None, f"did not finish within {estimator.timeout:g} s", _kill(process, memory)
        if time_s >= next_check:
            next_check = time_s + _POLL
            if _size(run_folder) > estimator.disk_limit:
                return None, _disk_problem(estimator), _kill(process, memory)
        time.sleep(min(pause, max(deadline - time_s, 0.0)))
        pause = min(pause * 1.5, 0.05)


def _kill(process: "subprocess.Popen[bytes]", memory: "_PeakMemory") -> float:
    """Kill a program; return its peak memory [MB]."""
    # process.kill() would take the status of one that has ended.
    os.kill(process.pid, signal.SIGKILL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return memory.final(usage)


class _PeakMemory:
    """Largest resident memory [MiB] of a program, or of one that it started.

    ``ru_maxrss`` of a program also counts what this process held when it forked: ``execve`` keeps
    the mark (Linux, ``setmax_mm_hiwater_rss`` in ``fs/exec.c``). Above that mark it is exact;
    below it, the largest ``VmHWM`` observed while the program ran is taken.
    """

    def __init__(self) -> None:
        self._inherited = _status_mib("self", "VmRSS")
        self._peak = 0.0

    def update(self, pid: int) -> None:
        """Update the peak from a running program and its descendants."""
        self._peak = max(self._peak, _status_mib(pid, "VmHWM"))
        for child in _children(pid):
            self.update(child)

    def final(self, usage: resource.struct_rusage) -> float:
        """Return the peak of a program that has ended [MiB]."""
        # In KiB on Linux, in bytes on macOS (getrusage(2)).
        peak = float(usage.ru_maxrss) / (1024.0**2 if sys.platform == "darwin" else 1024.0)
        return self._peak if self._peak and peak <= self._inherited else peak


def _status_mib(pid: int | str, name: str) -> float:
    """Return a quantity of /proc/PID/status [MiB]; 0 if the system or the process has none."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith(f"{name}:"):
                return float(line.split()[1]) / 1024.0
    return 0.0


def _disk_problem(estimator: CommandEstimator) -> str:
    return f"more than {estimator.disk_limit:g} bytes written"


def _size(folder: Path) -> int:
    """Return the size of all files in a folder [bytes]."""
    total = 0
    for path, _, names in os.walk(folder):
        for name in names:
            with contextlib.suppress(OSError):
                total += os.lstat(os.path.join(path, name)).st_size
    return total


@functools.cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None)


def _prctl(option: int, value: int) -> None:
    """Set an attribute of this process on Linux; other systems do without.

    Elsewhere the process group of a program is killed with it, but not orphans that left the group.
    """
    with contextlib.suppress(AttributeError):
        _libc().prctl(option, value, 0, 0, 0)


def end_programs() -> None:
    """Kill all processes of this worker before it ends."""
    for pid in _children():
        with contextlib.suppress(OSError):
            os.killpg(pid, signal.SIGKILL)
    _kill_children(set())


def _kill_all(group: int, earlier_children: set[int]) -> None:
    """Kill a process group and its orphans, and take their exit statuses.

    :param earlier_children: children of this process before the group was started.
    """
    with contextlib.suppress(OSError):
        os.killpg(group, signal.SIGKILL)
    _kill_children(earlier_children)


def _kill_children(earlier_children: set[int]) -> None:
    """Kill all children but the earlier ones until there are none; take their exit statuses."""
    for _ in range(1000):
        children = _children() - earlier_children
        if not children:
            return
        for pid in children:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        for pid in children:
            with contextlib.suppress(OSError):
                os.waitpid(pid, 0)


def _children(pid: int | str = "self") -> set[int]:
    """Return the child processes of a process; none if the system does not list them."""
    tasks, children = Path(f"/proc/{pid}/task"), set[int]()
    with contextlib.suppress(OSError):  # it may end at any moment, and each of its threads
        for task in os.listdir(tasks):
            with contextlib.suppress(OSError):
                children.update(map(int, (tasks / task / "children").read_text().split()))
    return children


def _status_text(status: int | None) -> str:
    """Return the end of a program as text: its exit status, or the signal."""
    if status is not None and status < 0:
        with contextlib.suppress(ValueError):
            return f"ended by {signal.Signals(-status).name}"
    return f"exit status {status}"


def _last_line(run_folder: Path) -> str:
    """Return the last line that the program printed."""
    try:
        with (run_folder / OUTPUT).open("rb") as file:
            file.seek(max(file.seek(0, os.SEEK_END) - 4096, 0))
            lines = file.read().decode("utf-8", "replace").split("\n")
    except OSError:
        return ""
    printed_lines = [line.strip() for line in lines if line.strip()]
    printable = (
        "".join(c if c.isprintable() else "?" for c in printed_lines[-1]) if printed_lines else ""
    )
    return f": {printable[:160]}" if printable else ""


def _custom_metrics(names: Collection[str], path: Path) -> Metrics:
    """Return the plan's own metrics that the program wrote."""
    if not names or not os.path.lexists(path):
        return {}
    with open_regular(path) as file:
        text = file.read(_LARGEST_METRICS)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        raise InputError(f"{METRICS}: must hold a JSON object of names and numbers") from None
    metrics: Metrics = {}
    for name in names:
        value = content.get(name) if isinstance(content, dict) else None
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if value is not None and not (number and abs(value) <= sys.float_info.max):
            raise InputError(f"{METRICS}: {name} = {short_repr(value)}: must be a finite number")
        metrics[name] = None if value is None else float(value)
    return metrics


def _estimate_path(estimator: CommandEstimator, run_folder: Path) -> Path | None:
    """Return the trajectory that the program wrote; None: there is none."""
    path = run_folder / ESTIMATES[estimator.estimate]
    if estimator.estimate == "bag":
        bags = [
            p for p in run_folder.glob("estimate*") if p.is_dir() or p.suffix in (".mcap", ".bag")
        ]
        path = bags[0] if bags else path
    return path if os.path.lexists(path) else None


def _partial_coverage(estimator: CommandEstimator, block: Samples, run_folder: Path) -> Metrics:
    """Return the coverage of the trajectory that a failed program left behind."""
    with contextlib.suppress(ImuSimError, OSError):
        path = _estimate_path(estimator, run_folder)
        if path is not None:
            topic = estimator.estimate_topic or None
            poses = read_states(path, topic, skip_bad_rows=True, recover=True)
            return coverage_metrics(poses.t_ns, block.true_t_ns, estimator)
    return {}


def _compare(
    cell: SimulatedCell,
    estimator: CommandEstimator,
    alignment: str,
    block: Samples,
    run_folder: Path,
    outcome: RunOutcome,
) -> None:
    """Fill in the metrics, the track and the findings of the program's trajectory."""
    path = _estimate_path(estimator, run_folder)
    if path is None:
        raise InputError("no estimate was written")
    try:
        topic, lines = estimator.estimate_topic or None, list[str]()
        arrived = read_states(path, topic, covariance=True, is_trajectory=True, ordered=False)
        estimate = sort_poses(arrived, tell=lines.append)
        outcome.findings += [
            line.replace(f"{run_folder}/", "").replace("; ", ", ") for line in lines
        ]
        outcome.track = estimate
        outcome.metrics.update(coverage_metrics(estimate.t_ns, block.true_t_ns, estimator))
        truth = cell.truth(block)
        outcome.findings += estimate_findings(estimate, truth, alignment)
        options = (alignment, cell.plan.relative, estimator, cell.plan.options.diverged_above)
        outcome.metrics.update(estimate_metrics(estimate, truth, *options))
    except ImuSimError as error:
        # Without the run's own folder, so that the same failure of many runs reads the same.
        message = error.problems[0].removeprefix(f"{path}: ").replace(f"{run_folder}/", "")
        raise InputError(f"estimate: {message}") from None
