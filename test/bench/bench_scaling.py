# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Throughput of generate over the number of cores, and over the duration of the recording.

``python test/bench/bench_scaling.py [--plot speed.png]``; whole processes, three runs each, min,
median and max. BENCH_FOLDER: where the bags go. HOURS: the longest recording (24).
"""

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from imu_sim_ros.terminal.text_tables import print_table

RATE = 200
HOURS = float(os.environ.get("HOURS", "24"))
FORMS = {
    "mcap none": ("x.mcap", "none"),
    "mcap lz4": ("x.mcap", "lz4"),
    "mcap zstd": ("x.mcap", "zstd"),
    "ROS 1 none": ("x.bag", "none"),
    "ROS 1 bz2": ("x.bag", "bz2"),
}
MINUTES = (1.0, 10.0, 60.0, 240.0, 60.0 * HOURS)
REPEATS = 3


def rates(form: str, minutes: float, cores: int, folder: Path) -> list[float]:
    """Return messages per second of some runs on so many cores, the lowest first."""
    name, compression = FORMS[form]
    allowed = sorted(os.sched_getaffinity(0))[:cores]
    command = [str(Path(sys.executable).with_name("generate")), "-o", str(folder / name)]
    command += ["--compression", compression, "--imu-only", "--trajectory", "static"]
    command += ["--imu", "lecture", "--rate", str(RATE), "--duration", f"{minutes}min", "--quiet"]
    throughputs = []
    for _ in range(REPEATS):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        started = time.perf_counter()
        subprocess.run(command, check=True, preexec_fn=lambda: os.sched_setaffinity(0, allowed))
        throughputs.append(RATE * 60.0 * minutes / (time.perf_counter() - started))
    return sorted(throughputs)


def _cells(throughputs: Sequence[float]) -> list[str]:
    return [
        f"{rate / 1e3:,.0f}"
        for rate in (throughputs[0], statistics.median(throughputs), throughputs[-1])
    ]


def plot(
    path: Path, by_cores: dict[str, dict[int, list[float]]], by_minutes: dict[float, list[float]]
) -> None:
    """Draw both curves."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, (cores_axes, duration_axes) = plt.subplots(
        1, 2, figsize=(9.0, 3.6), constrained_layout=True
    )
    for form, throughputs in by_cores.items():
        middle = [statistics.median(values) / 1e6 for values in throughputs.values()]
        cores_axes.plot(list(throughputs), middle, "o-", label=form)
    cores_axes.set(
        xlabel="cores", ylabel="million messages/s", xticks=list(next(iter(by_cores.values())))
    )
    cores_axes.set_ylim(bottom=0.0)
    cores_axes.legend(fontsize="small")
    middle = [statistics.median(values) / 1e6 for values in by_minutes.values()]
    duration_axes.plot(list(by_minutes), middle, "o-", label="mcap lz4")
    duration_axes.set(xlabel="recording [min]", xscale="log")
    duration_axes.set_ylim(bottom=0.0)
    duration_axes.legend(fontsize="small")
    figure.savefig(path, dpi=120)


def main(argv: Sequence[str] | None = None) -> None:
    """Print both tables, and draw them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plot", type=Path, metavar="FILE", help="also a picture")
    arguments = parser.parse_args(argv)
    available = len(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory(dir=os.environ.get("BENCH_FOLDER")) as top:
        folder = Path(top) / "out"
        by_cores = {
            form: {
                cores: rates(form, 20.0 if "bz2" in form else 120.0, cores, folder)
                for cores in range(1, min(available, 4) + 1)
            }
            for form in FORMS
        }
        by_minutes = {minutes: rates("mcap lz4", minutes, available, folder) for minutes in MINUTES}
    header = ["lowest k/s", "median", "highest"]
    rows = [
        [form, str(cores), *_cells(throughputs)]
        for form, throughputs_of_form in by_cores.items()
        for cores, throughputs in throughputs_of_form.items()
    ]
    print_table(["generate", "cores", *header], rows, "Throughput over cores")
    rows = [
        [f"{minutes:g} min", *_cells(throughputs)] for minutes, throughputs in by_minutes.items()
    ]
    print_table(["mcap lz4", *header], rows, f"Throughput over duration at {RATE} Hz")
    if arguments.plot:
        plot(arguments.plot, by_cores, by_minutes)


if __name__ == "__main__":
    main()
