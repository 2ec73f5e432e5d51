# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Signals end every command with the status that a shell expects, from the first moment on."""

import importlib
import io
import os
import random
import re
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from imu_sim_ros.bags import outputs
from imu_sim_ros.commands import generate, program
from imu_sim_ros.terminal import signals

COMMANDS = ("allan", "calibrate", "convert_bag", "dead_reckon", "evaluate", "generate")
STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGHUP: 129}
START = (
    "import sys; from imu_sim_ros.commands import start; print(flush=True); sys.exit(start.{}())"
)


def started(program: str, *arguments: str) -> subprocess.Popen:
    """Start a program and wait until the first line of its own code has run."""
    process = subprocess.Popen(
        [sys.executable, "-c", START.format(program), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    process.stdout.readline()
    return process


def await_handler(process: subprocess.Popen, number: int) -> None:
    """Wait until a process catches a signal."""
    status = Path(f"/proc/{process.pid}/status")
    while process.poll() is None:
        (caught,) = re.findall(r"SigCgt:\s*(\w+)", status.read_text(encoding="ascii"))
        if int(caught, 16) >> (number - 1) & 1:
            return
        time.sleep(0.001)


@pytest.mark.parametrize("program", COMMANDS)
@pytest.mark.parametrize("number", STATUS, ids=lambda number: number.name)
def test_a_signal_while_the_libraries_are_loaded_ends_it(tmp_path, program, number):
    # A named pipe that nobody writes to: a command that missed the signal would wait.
    pipe = tmp_path / "in.mcap"
    os.mkfifo(pipe)
    arguments = ["-o", str(pipe), "--duration", "40h"] if program == "generate" else [str(pipe)]
    process = started(program, *arguments)
    # SIGINT is handled before SIGTERM is; Python itself catches it from the first moment on.
    await_handler(process, signal.SIGTERM if number == signal.SIGINT else number)
    process.send_signal(number)
    error = process.communicate(timeout=300)[1]
    assert process.returncode == STATUS[number], error
    assert error == f"{program}: interrupted by {number.name}; nothing was written\n"


@pytest.mark.parametrize("number", STATUS, ids=lambda number: number.name)
def test_a_signal_during_the_work_runs_what_cleans_up(number):
    program = textwrap.dedent("""
        import time
        from imu_sim_ros.commands import program

        def work():
            try:
                print("begun", flush=True)
                time.sleep(60)
            finally:
                print("cleaned up")

        raise SystemExit(program.run("work", work))
    """)
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    process.send_signal(number)
    output, error = process.communicate(timeout=300)
    assert process.returncode == STATUS[number]
    assert output == "cleaned up\n"
    assert error == "work: interrupted; nothing was written\n"


@pytest.mark.parametrize("number", STATUS, ids=lambda number: number.name)
def test_a_step_that_must_not_be_broken_off_keeps_the_signal(number):
    def work() -> None:
        with signals.delay_signals():
            os.kill(os.getpid(), number)
            done.append(number)
        pytest.fail("the signal is lost")

    done: list[int] = []
    handlers = [signal.getsignal(signal_number) for signal_number in signals.SIGNALS]
    assert program.run("work", work) == STATUS[number]
    assert done == [number]
    assert [signal.getsignal(signal_number) for signal_number in signals.SIGNALS] == handlers


def test_a_signal_after_the_output_has_its_name_does_not_deny_it(tmp_path, monkeypatch, capsys):
    def interrupted(*_: object) -> None:
        os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(program, "show", interrupted)
    monkeypatch.chdir(tmp_path)
    assert generate.main(["-o", "x.mcap", "--duration", "1s", "--imu-only"]) == 143
    assert capsys.readouterr().err == "generate: interrupted; x.mcap is complete\n"
    assert (tmp_path / "x.mcap").is_file()


@pytest.mark.parametrize(
    ("staged", "names", "message"),
    [
        (False, ["x.partial.mcap", "x.partial_truth.yaml"], "x.partial.mcap: 200 messages "),
        (True, ["x.mcap", "x_truth.yaml"], "x.mcap is complete\n"),
    ],
    ids=["in the staging folder", "out of it"],
)
def test_a_signal_while_an_output_gets_its_name_ends_the_program_after_it(
    tmp_path, monkeypatch, capsys, staged, names, message
):
    rename = Path.rename

    def interrupted(path: Path, name: Path) -> Path:
        if staged == (len(Path(name).parts) == 1):
            os.kill(os.getpid(), signal.SIGTERM)
        return rename(path, name)

    monkeypatch.chdir(tmp_path)
    arguments = ["-o", "x.mcap", "--duration", "1s", "--imu-only"]
    monkeypatch.setattr(Path, "rename", interrupted)
    assert generate.main(arguments) == 143
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    assert capsys.readouterr().err.startswith(f"generate: interrupted; {message}")


@pytest.mark.parametrize(
    "arguments",
    [["x.mcap"], ["x.bag"], ["x.csv"], ["x", "--format", "euroc"]],
    ids=["mcap", "ROS 1", "csv", "euroc"],
)
def test_a_signal_while_a_file_is_closed_leaves_none_without_its_end(
    tmp_path, monkeypatch, arguments
):
    def interrupted(path: Path) -> None:
        if any(part.endswith(".active") for part in path.parts):
            os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(outputs, "_refuse_newcomer", interrupted)
    monkeypatch.chdir(tmp_path)
    assert generate.main(["-o", *arguments, "--duration", "2s"]) == 143
    names = [str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*")]
    assert any(name.startswith("x.partial") for name in names)
    assert not [name for name in names if "active" in name]


def test_what_is_printed_is_not_lost_to_a_signal_at_the_end(monkeypatch):
    """Standard output is flushed while signals still interrupt, not end the process at once."""
    received = []
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    monkeypatch.setattr(
        sys.stdout,
        "flush",
        lambda: received.append(signal.getsignal(signal.SIGTERM)),
        raising=False,
    )
    handlers = signal.getsignal(signal.SIGTERM)
    assert program.run("work", lambda: print("result")) == 0
    assert received
    assert handlers not in received


def test_a_signal_when_the_work_is_over_changes_nothing():
    script = textwrap.dedent("""
        import os, signal, sys
        from imu_sim_ros.commands import program
        from imu_sim_ros.terminal import signals

        def told(*_):
            os.kill(os.getpid(), signal.SIGHUP)
            return told_before(*_)

        told_before = program._report_interruption
        program._report_interruption = told
        signals.end_at_once("work")
        sys.exit(program.run("work", lambda: os.kill(os.getpid(), signal.SIGTERM)))
    """)
    command = [sys.executable, "-c", script]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert (result.returncode, result.stderr) == (143, "work: interrupted; nothing was written\n")


def test_what_fails_since_a_signal_is_due_to_it(capsys):
    """Ctrl-C reaches all processes: a worker may end before this one is at a good moment."""

    class Workers:
        def __enter__(self) -> None:
            os.kill(os.getpid(), signal.SIGINT)
            raise RuntimeError("a worker failed to start")

        def __exit__(self, *_: object) -> None:
            pytest.fail("they have not begun")

    def work() -> None:
        with Workers():
            pytest.fail("they have not begun")

    assert program.run("work", work) == 130
    assert capsys.readouterr().err == "work: interrupted; nothing was written\n"


def test_a_second_signal_does_not_break_off_what_the_first_one_cleans_up(capsys):
    def work() -> None:
        try:
            os.kill(os.getpid(), signal.SIGINT)
            pytest.fail("the signal is lost")
        finally:
            os.kill(os.getpid(), signal.SIGTERM)
            print("cleaned up")

    assert program.run("work", work) == 130
    assert capsys.readouterr() == ("cleaned up\n", "work: interrupted; nothing was written\n")


def test_a_second_signal_ends_what_does_not_come_to_an_end(monkeypatch, capsys):
    monkeypatch.setattr(signals, "_LONGEST_END", 0.01)

    def work() -> None:
        try:
            os.kill(os.getpid(), signal.SIGINT)
        finally:
            os.kill(os.getpid(), signal.SIGINT)
            threading.Event().wait(300)
            pytest.fail("the signal is lost")

    assert program.run("work", work) == 130
    assert capsys.readouterr().err == "work: interrupted; nothing was written\n"


def test_nohup_is_respected():
    program = (
        "import os, signal; from imu_sim_ros.commands import program\n"
        "raise SystemExit(program.run('work', lambda: os.kill(os.getpid(), signal.SIGHUP)))"
    )
    command = ["nohup", sys.executable, "-c", program]
    assert subprocess.run(command, capture_output=True, timeout=300).returncode == 0


def test_every_executable_begins_where_signals_are_looked_after():
    text = Path(__file__).parents[2].joinpath("setup.py").read_text(encoding="utf-8")
    programs = re.findall(r'"(\w+)"', text.split("COMMANDS = (")[1].split(")")[0])
    start = importlib.import_module("imu_sim_ros.commands.start")
    assert "control" in programs
    assert all(callable(getattr(start, name)) for name in programs)
    assert "commands.start:{name}" in text
    assert "nodes.start:{name}" in text


def _interrupted_at_any_moment(work: Callable[[], object]) -> None:
    """Run work until a signal ends it; it comes after a time that nobody chose."""

    @signals.raise_signals()
    def repeated() -> None:
        # Processor time: on a busy machine too the work has begun.
        signal.setitimer(signal.ITIMER_PROF, random.uniform(1e-4, 2e-3))
        deadline = time.monotonic() + 300
        while time.monotonic() < deadline:
            work()

    with pytest.raises(signals.Interrupted):
        repeated()


@pytest.fixture
def _profiling_timer(monkeypatch):
    monkeypatch.setattr(signals, "SIGNALS", (signal.SIGPROF,))


@pytest.mark.usefixtures("_profiling_timer")
def test_an_interruption_leaves_no_lock_taken():
    # An exception in the first instruction of Condition.__exit__ would leave it taken for ever.
    random.seed(1)
    condition = threading.Condition(threading.Lock())

    def work() -> None:
        with condition:
            pass

    for _ in range(20):
        _interrupted_at_any_moment(work)
        assert condition.acquire(blocking=False)
        condition.release()


@pytest.mark.usefixtures("_profiling_timer")
def test_an_interruption_that_python_swallows_comes_again():
    class Finalised:
        def __del__(self) -> None:
            slow()

    def slow() -> None:  # exceptions in here are "ignored"
        for _ in range(2000):
            pass

    def work() -> None:
        Finalised()
        slow()

    random.seed(2)
    for _ in range(20):
        _interrupted_at_any_moment(work)


def test_a_thread_that_waits_is_interrupted():
    program = (
        "import threading\nfrom imu_sim_ros.commands import program\n"
        "def work():\n    print('begun', flush=True)\n    threading.Event().wait(300)\n"
        "raise SystemExit(program.run('work', work))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    process.stdout.readline()
    process.send_signal(signal.SIGTERM)
    assert process.communicate(timeout=300)[1] == "work: interrupted; nothing was written\n"
    assert process.returncode == 143


def test_a_signal_while_an_extension_is_initialised_is_an_interruption(capsys):
    """Pybind11 makes an ImportError of it, which must not become status 1 and "unexpected"."""

    def command() -> None:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(10.0)
        except KeyboardInterrupt as error:
            raise ImportError("initialization failed") from error

    assert program.run("allan", command) == 143
    assert capsys.readouterr().err == "allan: interrupted; nothing was written\n"
