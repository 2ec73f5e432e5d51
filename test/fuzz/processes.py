# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hostile cases that need a process of their own: nodes, ``control``, ``campaign``, ``imu_sim``.

A case is a forked child of the fuzzer, which has imported ROS but not initialised it: it runs what
the executable runs (``commands.start``, ``nodes.start``) with real rclpy and Fast DDS, and its
limits and its end are its own. Every eighth one is the executable itself. What would run on for
ever (a simulator without an end) is ended by a signal once it is up.
"""

import contextlib
import ctypes
import importlib.util
import io
import os
import random
import re
import resource
import signal
import socket
import subprocess
import sys
import time
import traceback
from pathlib import Path
from typing import Any, Final, NamedTuple

HANG_S: Final = 10.0
"""[s of processor time] A process that takes longer hangs."""
LONGEST_S: Final = 120.0
"""[s] A process that does not end by then, signal or not, hangs."""
SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
NODES: Final = ("simulator", "integrator", "recorder")
EXECUTED: Final = 8
_POLL_S: Final = 0.02
_LIBC: Final = ctypes.CDLL(None)
_PARENT_DEATH_SIGNAL: Final = 1  # PR_SET_PDEATHSIG of linux/prctl.h
_IDLE_S: Final = 0.3
"""[s] What is up has that long to refuse what it was given."""


class Ended(NamedTuple):
    """Exit status, output and cost of a process."""

    status: int
    output: str
    cpu_s: float
    peak_bytes: int
    signalled: int
    """The signal that it was sent; 0: none."""
    hung: bool


class Domain:
    """A ROS domain that nobody else on this machine uses; a bound port is the lock."""

    def __init__(self) -> None:
        for number in random.SystemRandom().sample(range(1, 61), 60):
            self._lock = socket.socket()
            try:
                self._lock.bind(("127.0.0.1", 26000 + number))
            except OSError:
                self._lock.close()
                continue
            self.number = number
            return
        raise RuntimeError("no free ROS domain")

    def environment(self) -> dict[str, str]:
        """Return the variables that keep a process in this domain and on this machine."""
        return {
            "ROS_DOMAIN_ID": str(self.number),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_PYTHON_CHECK_FIELDS": "1",
        }


def has_ros() -> bool:
    """Return whether nodes can be run here."""
    return importlib.util.find_spec("rclpy") is not None


def run(
    program: str, arguments: list[str], place: Path, environment: dict[str, str], number: int
) -> Ended:
    """Run a program to its end, in a folder; end it by a signal where it would run on."""
    log = place / ".output"
    executed = number % EXECUTED == 0 and "\0" not in "".join(arguments)
    if executed:
        pid = _executed(program, arguments, place, log, environment)
    else:
        pid = _forked(program, arguments, place, log, environment)
    sent, hung = 0, False
    begin = time.monotonic()
    up_since = None
    while True:
        done, code, usage = os.wait4(pid, os.WNOHANG)
        if done:
            break
        clock = time.monotonic()
        if up_since is None and _is_up(pid, program, clock - begin):
            up_since = clock
        if up_since is not None and not sent and clock - up_since > _IDLE_S:
            sent = int(random.Random(number).choice(SIGNALS))
            os.kill(pid, sent)
        if clock - begin > LONGEST_S:
            hung = True
            os.killpg(pid, signal.SIGKILL)
        time.sleep(_POLL_S)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)  # what it left behind, workers for instance
    status = os.waitstatus_to_exitcode(code)
    hung |= status in (-signal.SIGXCPU, -signal.SIGKILL)
    text = log.read_text(errors="replace") if log.exists() else ""
    cpu = usage.ru_utime + usage.ru_stime
    return Ended(status, text, cpu, usage.ru_maxrss * 1024, sent, hung)


def _is_up(pid: int, program: str, age: float) -> bool:
    """Return whether a node has joined its domain, or another program has worked for a while."""
    if program not in NODES:
        return age > HANG_S
    try:
        threads = list(Path(f"/proc/{pid}/task").iterdir())
        return any("dds" in (thread / "comm").read_text() for thread in threads)
    except OSError:
        return False


def bound() -> None:
    """Let this process, just forked, be killed when the fuzzer ends."""
    _LIBC.prctl(_PARENT_DEATH_SIGNAL, signal.SIGKILL)


def _limit() -> None:
    bound()
    resource.setrlimit(resource.RLIMIT_CPU, (int(HANG_S), int(HANG_S) + 2))
    os.setsid()
    for number in SIGNALS:  # whatever the fuzzer itself was started with, by nohup for instance
        signal.signal(number, signal.SIG_DFL)


def _start_of(program: str) -> list[str]:
    """Return what starts a program: its executable, installed next to Python."""
    executable = Path(sys.executable).with_name(program)
    module = f"imu_sim_ros.{'nodes' if program in NODES else 'commands'}.start"
    code = f"import sys; from {module} import {program}; sys.exit({program}())"
    return [str(executable)] if executable.exists() else [sys.executable, "-c", code]


def _executed(
    program: str, arguments: list[str], place: Path, log: Path, environment: dict[str, str]
) -> int:
    start = _start_of(program)
    with log.open("wb") as output:
        process = subprocess.Popen(
            [*start, *arguments],
            cwd=place,
            env={**os.environ, **environment},
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            preexec_fn=_limit,
        )
    process.returncode = 0  # it is waited for by its id
    return process.pid


def _forked(
    program: str, arguments: list[str], place: Path, log: Path, environment: dict[str, str]
) -> int:
    room = "nodes" if program in NODES else "commands"
    start = importlib.import_module(f"imu_sim_ros.{room}.start")
    if program in NODES:
        importlib.import_module(f"imu_sim_ros.nodes.{program}.node")
    pid = os.fork()
    if pid:
        return pid
    status = 70
    try:
        _limit()
        os.chdir(place)
        os.environ.update(environment)
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        null = os.open(os.devnull, os.O_RDONLY)
        output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        for source, target in ((null, 0), (output, 1), (output, 2)):
            os.dup2(source, target)
        sys.stdin, sys.stdout, sys.stderr = (
            io.TextIOWrapper(io.FileIO(number, mode, closefd=False), errors="backslashreplace",
                             line_buffering=True)
            for number, mode in ((0, "r"), (1, "w"), (2, "w"))
        )  # fmt: skip
        sys.argv = [program, *arguments]
        try:
            status = int(getattr(start, program)() or 0)
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else 1 if ended.code else 0
        except BaseException:
            traceback.print_exc()
        sys.stdout.flush()
    finally:
        os._exit(status)


def startable(folder: Path) -> list[tuple[str, list[str]]]:
    """Return programs and arguments with which they work for a while, or start."""
    bag = str(folder / "none.mcap")
    return [
        ("generate", ["--duration", "10min", "-o", "o.mcap"]),
        ("convert_bag", [bag, "-o", "o.bag"]),
        ("convert_bag", [str(folder / "cameras"), "-o", "o.mcap"]),
        ("dead_reckon", [bag]),
        ("evaluate", [bag, bag]),
        ("allan", [bag, "--no-files"]),
        ("report", [bag, "-o", "o.html"]),
        ("campaign", [str(folder / "plan.yaml"), "-o", "o", "--workers", "2"]),
        *((name, []) for name in (NODES if has_ros() else ())),
    ]


def interrupted(
    program: str,
    arguments: list[str],
    place: Path,
    environment: dict[str, str],
    number: int,
    delay: float,
) -> tuple[int, str]:
    """Run a program, send a signal to its group after a delay; return status and output."""
    with (place / ".output").open("w+b") as output:
        process = subprocess.Popen(
            [*_start_of(program), *arguments],
            cwd=place,
            env={**os.environ, **environment},
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            preexec_fn=_limit,
        )
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(delay)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        try:
            status = process.wait(LONGEST_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            status = process.wait()
        output.seek(0)
        return status, output.read().decode("utf-8", "replace")


def told(output: str) -> tuple[bool, bool]:
    """Return whether an output has a traceback of ours, or one of the interpreter's own start.

    Before a line of the program runs (``site`` imports what installed packages ask for, ROS from
    wheels among them), the interpreter alone handles a signal.
    """
    traceback_shown = "Traceback" in output or "Exception ignored" in output
    ours = traceback_shown and re.search(r"imu_sim_ros/[\w/]+\.py", output) is not None
    return ours, traceback_shown and not ours


class Simulator:
    """A running simulator for ``control`` to act on; it has to survive all of it."""

    def __init__(self) -> None:
        self.domain = Domain()
        self._process = subprocess.Popen(
            [*_start_of("simulator"), "--rate", "50"],
            env={**os.environ, **self.domain.environment()},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            preexec_fn=bound,
        )

    @property
    def alive(self) -> bool:
        """Return True while the process runs."""
        return self._process.poll() is None

    def end(self) -> int:
        """End it; returns its exit status."""
        self._process.terminate()
        return self._process.wait(60)


# ------------------------------------------------------------------------------------- the cases
_PLAN: Final = {
    "name": "plan",
    "parameters": "{rate: 50.0, duration: 1.0, imu: perfect, trajectory: lecture}",
    "grid": "{imu.gyroscope_noise_density: [1.0e-4, 1.0e-3]}",
    "seeds": "2",
}
_PLAN_KEYS: Final = [
    *_PLAN, "estimators", "faults", "rpe", "require", "retries", "keep", "diverged_above", "grud",
    "cells", "environment",
]  # fmt: skip
_PLAN_VALUES: Final = [
    "[1s, 10s]", "{a: {type: dead_reckon, method: euler}}",
    "{a: {type: command, command: 'false'}}",
    "{a: {type: command, command: ''}}", "{a: {type: command, command: '{nothing} {dataset}'}}",
    "{imu: [lecture, nothing]}", "{imu: []}", "{rate: [0, -1]}", "{x: {log_range: [0, 1, 5]}}",
    "{imu.gyroscope_bias: {range: [0, 1, 1e9]}}", "['ate_rmse_m < 1']", "['ate_rmse_m < nan']",
    "[{at: 0.5, kind: stuck, triad: gyroscope}]", "[{at: nan, kind: none}]", "all", "2.5", "1e9",
    "{imu: [lecture, lecture]}", "[[1, 2], [3]]", "{a: {b: {c: {d: 1}}}}",
]  # fmt: skip
_RUN: Final = ["--workers", "--baseline", "--metric", "--scheduler", "--retry-failed", "--resume",
               "--check", "--yes", "--json", "--quiet", "-o", "--output"]  # fmt: skip
_ACTIONS: Final = ["pause", "resume", "reset", "step", "inject", "watch", "explode", "", "-1"]
_FAULTS: Final = ["bias_jump", "saturation", "stuck", "dropout", "latency", "none", "x"]
_CONTROL: Final = ["--value", "--duration", "--delay", "--triad", "--imu", "--node", "--json"]
_NODE_NAMES: Final = {
    "simulator": ["rate", "seed", "duration", "imus", "imu", "trajectory", "start_time", "gravity",
                  "publish.tf_rate", "publish.clock_rate", "real_time_factor", "block_duration",
                  "inject.kind", "inject.value", "imu.latency", "imu.preset", "trajectory.type",
                  "trajectory.file", "use_sim_time", "step_samples", "left.rate", "world_frame",
                  "wait_for_subscribers", "autostart"],
    "integrator": ["method", "initial_state", "imu.preset", "gravity", "calibration", "max_gap",
                   "path_rate", "path_length", "gyroscope_bias", "initial_orientation",
                   "level_time", "covariance", "world_frame", "use_sim_time"],
    "recorder": ["output", "topics", "exclude", "storage", "compression", "duration", "max_size",
                 "split_size", "split_duration", "buffer_size", "record_time", "max_gap"],
}  # fmt: skip
_NODE_VALUES: Final = ["[left, right]", "bias_jump", "[1e308,0,0]", "level", "euler", "5", "0.5",
                       "[/a, /b]", "zstd", "sqlite3", "ros1", "x.bag", "x.mcap", "folder/x",
                       "adis16448", "circle", "poses", "[1.0, 2]", "[]", "1e308"]  # fmt: skip


def campaign(dice: random.Random, vocabulary: list[str], place: Path) -> list[str]:
    """Return the arguments of a campaign whose plan or arguments nobody should write."""
    plan = dict(_PLAN)
    for _ in range(dice.randrange(3)):
        plan[dice.choice(_PLAN_KEYS)] = dice.choice([*_PLAN_VALUES, *vocabulary])
    lines = [f"{name}: {value}" for name, value in plan.items()]
    if dice.random() < 0.1:
        lines.insert(dice.randrange(len(lines)), dice.choice(lines))
    text = "\n".join(lines)
    if dice.random() < 0.1:
        offset = dice.randrange(len(text))
        text = text[:offset] + dice.choice(vocabulary) + text[offset:]
    path = place / "plan.yaml"
    path.write_text(text, encoding="utf-8", errors="surrogateescape")
    result = ["plan.yaml", "-o", "results", "--workers", "1"]
    for _ in range(dice.choice([0, 0, 1, 2])):
        option = dice.choice(_RUN)
        result += (
            [option] if option in _RUN[4:10] else [option, dice.choice([*vocabulary, "0", "1"])]
        )
    if dice.random() < 0.2:
        (place / "results").mkdir()
        (
            place / "results" / dice.choice(["runs.jsonl", "results.csv", "mine.txt", ".lock"])
        ).write_text(dice.choice([*vocabulary, '{"cell": 1}\n', "\n"]), errors="surrogateescape")
    return result


def control(dice: random.Random, vocabulary: list[str], place: Path) -> list[str]:
    """Return arguments of control that nobody should give."""
    action = dice.choice(_ACTIONS)
    result = [action]
    if action == "inject":
        result.append(dice.choice(_FAULTS))
    if action == "step" and dice.random() < 0.7:
        result.append(dice.choice(["1", "3", "0", "1e3", *vocabulary]))
    if action == "watch":
        result += ["--duration", dice.choice(["1s", "0s", *vocabulary])]
    for _ in range(dice.randrange(3)):
        option = dice.choice(_CONTROL)
        result += (
            [option]
            if option == "--json"
            else [option, dice.choice(["[1,0,0]", "1s", *vocabulary])]
        )
    return [*result, "--timeout", dice.choice(["2s", "2s", "0s", *vocabulary])]


def node(dice: random.Random, vocabulary: list[str], place: Path) -> tuple[str, list[str]]:
    """Return a node, and parameters, files and arguments that nobody should give."""
    program = dice.choice(NODES)
    names = _NODE_NAMES[program]
    values = [*vocabulary, *_NODE_VALUES]
    sound = [*_NODE_VALUES, "1", "100", "true", "[0.1, 0, 0]", "perfect", "lecture", "10"]
    node_parameters = [
        (dice.choice(names), dice.choice(sound if dice.random() < 0.6 else values))
        for _ in range(dice.randrange(1, 4))
    ]
    form = dice.choice([0, 0, 1, 1, 2, 2, 3])
    if form == 0:
        result = [word for name, value in node_parameters for word in (f"--{name}", value)]
    elif form == 1:
        result = [
            "--ros-args",
            *(w for name, value in node_parameters for w in ("-p", f"{name}:={value}")),
        ]
    elif form == 2:
        body = "\n".join(f"    {name}: {value}" for name, value in node_parameters)
        text = f"/**:\n  ros__parameters:\n{body}\n"
        if dice.random() < 0.2:
            offset = dice.randrange(len(text))
            text = text[:offset] + dice.choice(vocabulary) + text[offset:]
        (place / "given.yaml").write_text(text, encoding="utf-8", errors="surrogateescape")
        result = ["--ros-args", "--params-file", "given.yaml"]
    else:
        result = [dice.choice([*vocabulary, "--ros-args", "-r", "--remap", "x:=y", "-p", "--help",
                               "--params-file", "--log-level", "debug", "__ns:=/a", "__node:=b c"])
                  for _ in range(dice.randrange(1, 5))]  # fmt: skip
    if program == "recorder" and dice.random() < 0.5:
        result = ["-o", dice.choice(["x", "x.mcap", "x.bag"]), *result]
    return program, result


def by_one_name(dice: random.Random, vocabulary: list[str], place: Path) -> list[str]:
    """Return the arguments of ``imu_sim``."""
    programs = ["generate", "allan", "evaluate", "dead_reckon", "control", "campaign", "--version",
                "--help", "-h", "nothing"]  # fmt: skip
    result = [dice.choice([*programs, *vocabulary])]
    return result + [
        dice.choice([*vocabulary, "--help", "-o", "x.mcap"]) for _ in range(dice.randrange(3))
    ]


def fit(arguments: list[Any]) -> list[str]:
    """Return arguments that a process can be given."""
    return [word.replace("\0", "") for word in arguments]
