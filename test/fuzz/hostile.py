# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hostile inputs for every command: one case for each number, run in this process and judged.

``python test/fuzz/hostile.py COUNT [FIRST [SECONDS]]`` runs COUNT cases and reports them by kind.
"""

import contextlib
import hashlib
import io
import json
import os
import random
import re
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Final, NamedTuple

sys.path.insert(0, str(Path(__file__).parent))
import calls
import cases
import documents
import folders
import live
import processes

from imu_sim_ros.terminal import startup

HANG_S: Final = processes.HANG_S
"""[s of processor time] A case that takes longer hangs."""
MEMORY_BYTES: Final = 10**9
IN_PROCESS: Final = tuple(cases.MAKERS)
"""Kinds whose commands run in this process."""
CALLS: Final = ("python", "message") if processes.has_ros() else ("python",)
"""Kinds that call functions: of the package, and those behind the integrator's topics."""
OF_THEIR_OWN: Final = ("campaign", "control", "node", "imu_sim") if processes.has_ros() else ()
"""Kinds whose programs are processes."""
LIVE: Final = ("signal", "live") if processes.has_ros() else ("signal",)
"""Programs that a signal ends while they start; messages to a running integrator and recorder."""
KINDS: Final = (*IN_PROCESS, *OF_THEIR_OWN, *CALLS, *LIVE)
STATUSES: Final = (0, 1, 2)
GATE_FAILED: Final = 3
"""Exit status of ``campaign`` if a requirement is not met."""
LIBRARIES: Final = re.compile(
    r"site-packages|[A-Z]\w+Warning:|libpng|libjpeg|^Corrupt JPEG|^Premature end|TIFFFetch|"
    r"OpenCV[(:]|\[ *(WARN|ERROR)[:@]",
    re.MULTILINE,
)
"""Words of lines that come from a library."""
NOT_FINITE: Final = re.compile(r"\b(nan|NaN|inf|Infinity)\b")
MEASURES: Final = ("dead_reckon", "evaluate", "allan", "calibrate")
"""Programs that print numbers."""


class Outcome(NamedTuple):
    """Arguments, exit status and faults of one case."""

    kind: str
    arguments: list[str]
    status: int
    faults: tuple[str, ...]
    """traceback, hang, memory, changed, status, library, not finite, taken, no hint, lost."""
    error: str


class Hang(BaseException):
    """The processor time is used up."""


class Inputs:
    """Sound inputs, made once; their digests tell whether a program changed one of them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name, options in cases.BAGS.items():
            status, error, _ = called(
                "generate", ["-o", str(folder / name), "--force", *cases.SMALL, *options]
            )
            assert status == 0, error
        for program, arguments in (
            ("generate", ["-o", str(folder / "cameras"), *folders.CAMERAS]),
            ("campaign", [str(folder / "plan.yaml"), "-o", str(folder / "campaign"),
                          "--workers", "1", "--no-report", "--quiet"]),
        ):  # fmt: skip
            (folder / "plan.yaml").write_text(folders.PLAN)
            status, error, _ = called(program, arguments)
            assert status == 0, error
        arguments = ["-o", str(folder / "navigation.mcap"), *documents.NAVIGATION]
        status, error, _ = called("generate", arguments)
        assert status == 0, error
        cases.write_logs(folder)
        (folder / "poses.txt").write_text("\n".join(cases.POSES) + "\n")
        (folder / "file.yaml").write_text("/**:\n  ros__parameters: {rate: 100.0}\n")
        self.digests = self._digests()
        self._domain: processes.Domain | None = None
        self._simulator: processes.Simulator | None = None
        self._live: live.Live | None = None
        self._of_live = tempfile.TemporaryDirectory()

    def live(self) -> live.Live:
        """Return a running integrator and recorder."""
        self._live = self._live or live.Live(Path(self._of_live.name))
        return self._live

    def environment(self, kind: str) -> dict[str, str]:
        """Return the variables of a process: ``control`` has a simulator to act on."""
        if kind == "control":
            self._simulator = self._simulator or processes.Simulator()
            return self._simulator.domain.environment()
        self._domain = self._domain or processes.Domain()
        return self._domain.environment()

    def lost(self) -> bool:
        """Return whether the simulator did not survive what ``control`` was given."""
        return self._simulator is not None and not self._simulator.alive

    def close(self) -> None:
        """End the simulator, where there is one."""
        if self._simulator is not None:
            status = self._simulator.end()
            assert status == 0, f"the simulator ended with status {status}"
            self._simulator = None
        if self._live is not None:
            statuses = self._live.end()
            assert not any(statuses), f"integrator, recorder, bag: {statuses}"
            self._live = None

    def changed(self) -> bool:
        """Return whether anything is no longer as it was made; what is new next to it may be."""
        digests = self._digests()
        return any(digests.get(name) != digest for name, digest in self.digests.items())

    def _digests(self) -> dict[str, bytes]:
        return {
            str(file): hashlib.sha1(file.read_bytes()).digest()
            for file in sorted(self.folder.rglob("*"))
            if file.is_file()
        }


def called(program: str, arguments: list[str]) -> tuple[int, str, str]:
    """Run a command in this process; return its exit status, its errors and its output.

    What libraries write to standard error themselves is among the errors.
    """
    module = startup.load(f"imu_sim_ros.commands.{program}")
    out, error = io.StringIO(), io.StringIO()
    saved_stderr = os.dup(2)
    handlers = {number: signal.getsignal(number) for number in processes.SIGNALS}
    with (
        tempfile.TemporaryFile() as low,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(error),
    ):
        os.dup2(low.fileno(), 2)
        try:
            status = module.main(arguments)
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else 1
        except Hang:
            raise
        except BaseException:  # what escapes a program shows its traceback
            traceback.print_exc()
            status = -1
        finally:
            os.dup2(saved_stderr, 2)
            os.close(saved_stderr)
            for number, handler in handlers.items():  # a command that is over ignores signals
                signal.signal(number, handler)
        low.seek(0)
        error.write(low.read().decode("utf-8", "replace"))
    return int(status), error.getvalue(), out.getvalue()


def run(number: int, inputs: Inputs) -> Outcome:
    """Run the case of a number and judge it."""
    kind = KINDS[number % len(KINDS)]
    with tempfile.TemporaryDirectory() as name:
        run_case = _of_its_own if kind in OF_THEIR_OWN else _in_process
        if kind in CALLS:
            run_case = _call
        elif kind in LIVE:
            run_case = {"signal": _signalled, "live": _live}[kind]
        outcome = run_case(number, kind, inputs, Path(name))
    if inputs.changed():
        outcome = outcome._replace(faults=(*outcome.faults, "changed"))
    return outcome


def _in_process(number: int, kind: str, inputs: Inputs, place: Path) -> Outcome:
    working_folder = os.getcwd()
    program, arguments = cases.MAKERS[kind](random.Random(number), inputs.folder, place)
    os.chdir(place)
    faults = []
    signal.signal(signal.SIGPROF, _hang)
    signal.setitimer(signal.ITIMER_PROF, HANG_S)
    try:
        status, error, out = called(program, arguments)
    except Hang:
        status, error, out = -1, "", ""
        faults.append("hang")
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        os.chdir(working_folder)
    allowed = {*STATUSES, GATE_FAILED} if program == "campaign" else STATUSES
    judged = {
        "traceback": "Traceback" in error,
        "status": status not in allowed,
        "library": LIBRARIES.search(error) is not None,
        "not finite": status == 0 and program in MEASURES and NOT_FINITE.search(out) is not None,
        "taken": kind == "mistyped" and status != 2 and not faults,
        "no hint": kind == "mistyped"
        and not re.search("did you mean|must be|it has|is not of the form", error),
    }
    faults += [name for name, failed in judged.items() if failed]
    if _peak_bytes() > MEMORY_BYTES:
        faults.append("memory")
    return Outcome(kind, [program, *arguments], status, tuple(faults), error)


def _call(number: int, kind: str, inputs: Inputs, place: Path) -> Outcome:
    dice, working_folder = random.Random(number), os.getcwd()
    os.chdir(place)
    signal.signal(signal.SIGPROF, _hang)
    signal.setitimer(signal.ITIMER_PROF, HANG_S)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            case = calls.messages(dice) if kind == "message" else (
                calls.public(dice, inputs.folder, place)
            )  # fmt: skip
    except Hang:
        case = "", [], ["hang"]
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        os.chdir(working_folder)
    program, labels, faults = case
    return Outcome(kind, [program, *labels], 0, tuple(faults[:1]), "\n".join(faults[1:]))


def _peak_bytes() -> int:
    """Return the largest memory of this program; getrusage counts that of its parent as well."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return 1024 * int(re.search(r"VmHWM:\s*(\d+) kB", status)[1])


def _of_its_own(number: int, kind: str, inputs: Inputs, place: Path) -> Outcome:
    dice, vocabulary = random.Random(number), [*cases.WORDS, str(inputs.folder / "none.mcap")]
    if kind == "node":
        program, arguments = processes.node(dice, vocabulary, place)
    else:
        program = kind
        maker = {"control": processes.control, "campaign": processes.campaign}
        arguments = maker.get(kind, processes.by_one_name)(dice, vocabulary, place)
    environment = inputs.environment(kind)
    ended = processes.run(program, processes.fit(arguments), place, environment, number)
    allowed = set(STATUSES)
    if ended.signalled and program not in processes.NODES:
        allowed.add(128 + ended.signalled)  # the others, where it was just ending
    if program == "campaign":
        allowed.add(GATE_FAILED)
    judged = {
        "hang": ended.hung,
        # What a campaign's user runs may show one; its own would be the command's.
        "traceback": "Traceback" in ended.output and "--debug" not in arguments,
        "status": ended.status not in allowed,
        "memory": ended.peak_bytes > MEMORY_BYTES,
        "lost": inputs.lost(),
    }
    faults = tuple(name for name, failed in judged.items() if failed)
    return Outcome(kind, [program, *arguments], ended.status, faults, ended.output)


def _signalled(number: int, kind: str, inputs: Inputs, place: Path) -> Outcome:
    """Start a program, and end it by a signal to its group while it starts or works."""
    dice, folder = random.Random(number), inputs.folder
    program, arguments = dice.choice(processes.startable(folder))
    sent, delay = dice.choice(processes.SIGNALS), dice.choice([0.1, 0.2, 0.3, 0.5, 0.8, 1.2])
    status, output = processes.interrupted(
        program, arguments, place, inputs.environment(kind), sent, delay
    )
    ours, of_python = processes.told(output)
    judged = {
        "traceback": ours,
        # Before any code of ours runs a signal has the effect that the system gives it.
        "status": status not in {0, *STATUSES, 128 + sent, -sent},
        "library": not of_python and LIBRARIES.search(output) is not None,
    }
    command = [program, *arguments, f"{sent.name} after {delay} s"]
    return Outcome(
        kind, command, status, tuple(n for n, failed in judged.items() if failed), output
    )


def _live(number: int, kind: str, inputs: Inputs, place: Path) -> Outcome:
    faults, text = inputs.live().case(number)
    return Outcome(kind, ["integrator", "recorder"], 0, tuple(faults), text)


def _hang(number: int, frame: FrameType | None) -> None:
    raise Hang


def main(count: int, first_number: int = 0, seconds: float = 1e9) -> int:
    """Run cases, at most for some time, and report them by kind; returns 1 where one failed."""
    end = time.monotonic() + seconds
    counts: Counter[tuple[str, str]] = Counter()
    failed = 0
    with tempfile.TemporaryDirectory() as name:
        inputs = Inputs(Path(name))
        for number in range(first_number, first_number + count):
            if time.monotonic() > end:
                count = number - first_number
                break
            begin = time.process_time()
            outcome = run(number, inputs)
            spent = time.process_time() - begin
            counts[outcome.kind, f"status {outcome.status}"] += 1
            counts[outcome.kind, "unexpected"] += "unexpected:" in outcome.error
            for fault in outcome.faults:
                counts[outcome.kind, fault] += 1
            if outcome.faults or "unexpected:" in outcome.error or spent > HANG_S / 2:
                failed += bool(outcome.faults)
                argv = " ".join(repr(word[:60]) for word in outcome.arguments)
                print(
                    f"{number} {spent:.1f} s {outcome.faults} {argv}\n  {outcome.error[-400:]!r}",
                    flush=True,
                )
        inputs.close()
    for (kind, what), value in sorted(counts.items()):
        print(f"{kind:10} {what:12} {value}")
    print(f"{count} cases, {failed} failed, peak {_peak_bytes() / 1e6:.0f} MB")
    return 1 if failed else 0


def serve() -> None:
    """Run the cases whose numbers come in; answer each with its outcome in a line of JSON."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    with tempfile.TemporaryDirectory() as name:
        inputs = Inputs(Path(name))
        for line in sys.stdin:
            print(json.dumps(run(int(line), inputs)), file=answers, flush=True)
        inputs.close()


if __name__ == "__main__":
    if sys.argv[1:] == ["--serve"]:
        serve()
    else:
        sys.exit(main(*map(int, sys.argv[1:])))
