# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Run benchmarks below this folder, one after another, each in a process of its own.

make bench                                    speeds, the live nodes, how cost grows: ten minutes;
                                              manual.py writes its output into the manual
make bench BASE=1.0.0                          the same, speeds next to those of a revision
.venv/bin/python test/bench/run.py bags allan  others by name; statistics take up to hours
"""

import argparse
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

FOLDER = Path(__file__).parent
USUAL = ("speeds", "error_node", "recorder", "growth")
"""Benchmarks that are run if none is named."""


def main() -> int:
    """Run the named benchmarks, or the usual ones; return the number that failed."""
    bench_files = sorted(FOLDER.rglob("bench_*.py"))
    scripts = {path.stem.removeprefix("bench_"): path for path in bench_files}
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"out of {', '.join(scripts)}")
    parser.add_argument("--base", metavar="REVISION", help="measure speeds next to its")
    arguments = parser.parse_args()
    names = arguments.names or list(USUAL)
    unknown = [name for name in names if name not in scripts]
    if unknown:
        parser.error(f"no benchmark {', '.join(unknown)}; there are {', '.join(scripts)}")
    date = time.strftime("%-d %B %Y")
    print(f"Python {platform.python_version()}, {os.cpu_count()} cores, {date}", flush=True)
    root = FOLDER.parents[1]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    failed = 0
    for name in names:
        print(f"\n=== {name}", flush=True)
        command = [sys.executable, str(scripts[name])]
        if name == "speeds" and arguments.base:
            command += ["--base", arguments.base]
        failed += bool(subprocess.run(command, cwd=root, env=environment, check=False).returncode)
    return failed


if __name__ == "__main__":
    sys.exit(main())
