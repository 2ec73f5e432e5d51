# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables on terminals of any width: no number is cut."""

import contextlib
import io
import os
import pty
import re
import sys

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.campaigns.statistics import quantile
from imu_sim_ros.commands import allan, calibrate, control, dead_reckon, evaluate
from imu_sim_ros.jobs import campaign
from imu_sim_ros.terminal import progress, text_tables

HEADER = ["axis", "noise density [rad/s/sqrt(Hz)]", "random walk [rad/s^2/sqrt(Hz)]", "B [rad/s]"]
ROWS = [[f"gyroscope {axis}", "0.0150012 +- 0.0000123", "5.123e-05", "< 1.5e-6"] for axis in "xyz"]


@pytest.mark.parametrize("columns", [40, 50, 80, 100, 200])
@pytest.mark.parametrize("terminal", [True, False])
def test_every_number_is_whole(columns, terminal, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(sys.stdout, "isatty", lambda: terminal, raising=False)
    text_tables.print_table(HEADER, ROWS, "Noise")
    out = capsys.readouterr().out
    assert "\N{HORIZONTAL ELLIPSIS}" not in out
    for row in ROWS:
        assert all(out.count(cell) >= 1 for cell in row)
    if terminal and columns == 80:
        assert max(len(line) for line in out.splitlines()) <= 80
    if terminal:  # a block for each row, or one header
        assert out.count(HEADER[1]) == (3 if columns <= 50 else 1)


def test_columns_move_together_before_the_table_is_stacked(monkeypatch, capsys):
    header = ["error", "rmse", "mean", "median", "std", "min", "max"]
    rows = [["RPE 14.8 m [rad]", *["1.99e-06"] * 6], ["ATE position [m]", *["0.629"] * 6]]
    assert 16 + 6 * (8 + 2) <= 80 < 16 + 6 * 8 + 7 * 3
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    text_tables.print_table(header, rows, "Errors")
    title, names, _, first_row, second = capsys.readouterr().out.splitlines()
    assert title == "Errors"
    assert names.split() == header
    assert (first_row.split()[-6:], second.split()[-6:]) == (rows[0][1:], rows[1][1:])
    assert len(first_row) == len(second) == len(names) == 76


def test_leading_columns_become_headings_before_the_table_is_stacked(monkeypatch, capsys):
    header = ["sensor", "noise density", "estimator", "median", "95 % interval"]
    cells = ("euler", "0.0232", "0.0186 - 0.0267"), ("midpoint", "0.0130", "0.0060 - 0.0162")
    rows = [[sensor, "1e-4", *row] for sensor in ("tactical", "adis16448") for row in cells]
    monkeypatch.setenv("COLUMNS", "40")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    text_tables.print_table(header, rows)
    assert capsys.readouterr().out.splitlines() == [
        "  estimator  median    95 % interval",
        "  " + "  ".join("\N{BOX DRAWINGS LIGHT HORIZONTAL}" * n for n in (9, 6, 15)),
        "sensor: tactical, noise density: 1e-4",
        "  euler      0.0232  0.0186 - 0.0267",
        "  midpoint   0.0130  0.0060 - 0.0162",
        "sensor: adis16448, noise density: 1e-4",
        "  euler      0.0232  0.0186 - 0.0267",
        "  midpoint   0.0130  0.0060 - 0.0162",
    ]


def test_a_terminal_breaks_long_lines_between_words_and_a_pipe_does_not(monkeypatch, capsys):
    line = "note: 30 min without a gap: a random walk needs hours; expect an upper bound"
    monkeypatch.setenv("COLUMNS", "60")
    for terminal in (True, False):
        monkeypatch.setattr(sys.stdout, "isatty", lambda terminal=terminal: terminal, raising=False)
        text_tables.print_lines([line])
        printed = capsys.readouterr().out.splitlines()
        assert max(map(len, printed)) <= 60 or not terminal
        assert " ".join(part.strip() for part in printed) == line
        assert len(printed) == (2 if terminal else 1)


@pytest.mark.parametrize("columns", [80, 40])
def test_a_narrow_bar_cuts_its_text_and_never_its_numbers(monkeypatch, columns):
    master, slave = pty.openpty()
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", "xterm")
    with os.fdopen(slave, "w") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        name = "a campaign with a name of more than 40 letters"
        with progress.terminal_bar(name, 1000, done=500) as advance:
            advance(20)
    shown = b""
    with os.fdopen(master, "rb", buffering=0) as stream, contextlib.suppress(OSError):
        while part := stream.read(4096):  # a terminal whose other side is closed ends with an error
            shown += part
    lines = re.split(r"[\r\n]+", re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode()))
    last_line = [line for line in lines if line.strip()][-1]
    assert len(last_line) <= columns
    assert re.fullmatch(r"a campaign.* 52% +-:--:-- *", last_line), last_line


def seconds_left(text):
    hours, minutes, seconds = map(int, text.split(":"))
    return 3600 * hours + 60 * minutes + seconds


@pytest.mark.parametrize("start", [0.0, 3.0, 30.0])
@pytest.mark.parametrize("workers", [1, 2, 16])
def test_the_time_left_is_neither_misled_by_bursts_nor_by_the_start(start, workers):
    """Batches of 50 that each process delivers every 2 s, all processes at once.

    A window of time t contains t / 2 bursts, one more or one less: it is off by 2 / t.
    """
    pace, total, shown = progress.ProgressRate(), 50 * workers * 100, 0
    for burst in range(1, 101):
        for worker in range(workers):
            elapsed = start + 2.0 * burst + 0.01 * worker / workers
            done = 50 * (workers * (burst - 1) + worker + 1)
            speed, seconds = pace.after(done, total - done, elapsed)
            assert bool(speed) == (seconds != "-:--:--")
            if speed:
                shown += 1
                window = min(0.5 * elapsed, elapsed - 1.1 * (start + 2.0))
                true = 2.0 * (total - done) / (50.0 * workers)
                assert (
                    abs(seconds_left(seconds) - true) <= 1.0 + true * 2.2 / (window - 2.2)
                    or window < 4.5
                )
    assert shown > 0.6 * workers * 100


def test_a_time_left_that_is_not_known_is_not_shown():
    pace = progress.ProgressRate()
    assert pace.after(0, 1000, 3.0) == ("", "-:--:--")
    assert pace.after(50, 950, 10.0) == ("", "-:--:--")
    assert pace.after(100, 900, 10.1) == ("", "-:--:--")
    assert pace.after(200, 800, 30.0) == ("5.3/s", "0:02:32")  # 100 in 30 - 11 s
    assert pace.after(1000, 0, 60.0)[1] == "0:00:00"
    assert pace.after(1001, -1, 61.0)[1] == "0:00:00"


@pytest.mark.parametrize(
    ("speed", "text"), [(None, ""), (2.5, "2.5/s"), (656.4, "656/s"), (69e3, "69 k/s")]
)
def test_a_speed_has_few_digits(speed, text):
    assert progress.speed_text(speed) == text


def test_an_interval_that_no_few_seeds_have_says_how_many_it_needs():
    """The median of 6 lies between the extremes with 1 - 2 / 2^6 = 96.9 %, of 5 with 93.8 %."""
    for count, text in ((0, "no run has it"), (5, "needs 6 seeds"), (6, "1.0 - 6.0")):
        assert campaign._median_and_interval(quantile(np.arange(1.0, count + 1.0), 0.5))[1] == text


def screen(text):
    """Return the lines that a terminal shows after text with CPL (up) and ED (erase below)."""
    lines, row = [""], 0
    for part in re.findall(r"\x1b\[\d*[FJ]|\n|[^\x1b\n]+", text):
        if part.endswith("F") and part.startswith("\x1b"):
            row -= int(part[2:-1])
        elif part == "\x1b[J":
            del lines[row:]
            lines.append("")
        elif part == "\n":
            row += 1
            lines += [""] * (row + 1 - len(lines))
        else:
            lines[row] += part
    return lines[:-1]


@pytest.mark.parametrize("columns", [20, 80])
def test_a_watched_status_is_redrawn_in_place_and_faults_stay_above_it(monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    terminal = io.StringIO()
    view = control.StatusView(terminal)
    view.show(["running", "imu/data_raw 200.0 Hz"])
    view.show(["running", "imu/data_raw 199.5 Hz", "0 samples late"])
    view.log("fault: dropout")
    view.show(["paused"])
    assert screen(terminal.getvalue()) == ["fault: dropout", "paused"]
    view.show(["running", "imu/data_raw 199.5 Hz"])
    lines = screen(terminal.getvalue())
    assert lines == ["fault: dropout", "running", "imu/data_raw 199.5 Hz"[: columns - 1]]


PROGRAMS = (
    (dead_reckon, ["flight.mcap", "--all"]),
    (evaluate, ["flight.tum", "flight.mcap", "--align", "yaw"]),
    (allan, ["rest.mcap", "--truth", "lecture", "--no-files"]),
    (calibrate, ["six_position", "positions.mcap", "--truth", "mpu6000", "--no-files"]),
)


def test_tables_of_the_programs_fit_80_columns(tmp_path, monkeypatch, capsys):
    """Columns move together at most: no row becomes a block of lines."""
    monkeypatch.chdir(tmp_path)
    flight = ims.simulate(imu="mpu6000", trajectory="figure_eight", duration=6.0, seed=1)
    flight.save("flight.mcap")
    assert dead_reckon.main(["flight.mcap", "-o", "flight.tum", "--quiet"]) == 0
    ims.simulate(imu="lecture", trajectory="static", duration=120.0).save("rest.mcap")
    positions = ims.simulate(imu="mpu6000", trajectory="six_position", rate=50.0)
    positions.save("positions.mcap")
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    blocks = []
    monkeypatch.setattr(text_tables, "stacked_lines", lambda *table: blocks.append(table) or [])
    for program, arguments in PROGRAMS:
        assert program.main(arguments) == 0
        printed = capsys.readouterr().out
        assert not blocks, program.__name__
        rules = [
            line for line in printed.splitlines() if "\N{BOX DRAWINGS LIGHT HORIZONTAL}" in line
        ]
        assert 0 < max(map(len, rules)) <= 80
