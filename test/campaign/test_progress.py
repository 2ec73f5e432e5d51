# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Progress display of a running campaign."""

import contextlib
import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios

from imu_sim_ros.campaigns import campaign as driver
from imu_sim_ros.campaigns.plan import load_plan


def test_the_tally_counts_runs_and_failures(plan_file):
    plan = load_plan(plan_file(grid={"trajectory": ["lecture", "circle"]}, seeds=2))
    tally = driver.Tally(plan, 1)
    done, failed = ({"cell": "trajectory=circle", "status": s} for s in ("done", "failed: x"))
    assert tally.add([]) == "1 of 4 runs"
    assert tally.add([done]) == "2 of 4 runs; trajectory=circle"
    assert tally.add([done, failed]) == "4 of 4 runs, 1 failed; trajectory=circle"


def test_a_terminal_of_80_columns_shows_runs_failures_and_the_time_left(plan_file, tmp_path):
    """The counts come first, so that a long name of a plan or a cell cannot push them out."""
    program = "sh -c 'sleep 0.1; exit $(({seed} % 2))'"
    path = plan_file(
        name="a name that is longer than any terminal is wide, or so it seems to whoever reads it",
        grid={"trajectory": ["circle", "lecture"]},
        seeds=450,
        estimators={"own": {"command": program}},
    )
    # Speed and time left come after a second.
    progress_pattern = re.compile(
        r"\d+ of 900 runs, \d+ failed; traj\S* .*\d+% +[\d.]+/s +\d:\d\d:\d\d$"
    )
    campaign_arguments = [
        "imu_sim_ros.commands.campaign",
        path,
        "-o",
        tmp_path / "out",
        "--workers",
        "1",
    ]
    shown = on_terminal(
        [sys.executable, "-m", *campaign_arguments], columns=80, until=progress_pattern
    )
    lines = [line for line in shown if re.search(r"\d%", line)]
    assert lines
    assert max(map(len, lines)) <= 80
    assert any(re.match(r"0 of 900 runs +.*-:--:--$", line) for line in lines)
    assert any(progress_pattern.match(line) for line in lines), lines[-3:]


def on_terminal(command, columns, until):
    """Return the lines that a command shows on a terminal of so many columns, without its codes.

    It is ended when one of its lines matches a pattern.
    """
    main, child = pty.openpty()
    fcntl.ioctl(child, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    environment = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "LINES")}
    process = subprocess.Popen(
        list(map(str, command)),
        stdin=child,
        stdout=child,
        stderr=child,
        env={**environment, "TERM": "xterm"},
    )
    os.close(child)
    shown, lines = "", []
    with contextlib.suppress(OSError):  # the other end is closed
        while part := os.read(main, 1 << 16):
            shown += part.decode()
            lines = re.split(r"[\r\n]", re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", shown))
            if any(until.match(line) for line in lines):
                process.terminate()
    os.close(main)
    process.wait()
    return lines
