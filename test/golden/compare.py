# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Comparison of outputs with a revision: ``compare.py REVISION`` (``make same BASE=REVISION``).

Runs outputs.py, as it is now, against a revision and against the working tree, with the same
libraries, and names every case that differs. Digests of samples depend on the machine's mathematics
library, so none are kept in the repository.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MOST_SHOWN = 40


def outputs(tree: Path, folder: Path) -> dict[str, str]:
    """Return the digests of one tree."""
    file = folder / f"{tree.name}.json"
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    program = [sys.executable, str(Path(__file__).with_name("outputs.py")), str(file)]
    subprocess.run(program, check=True, env=environment, cwd=folder)
    digests: dict[str, str] = json.loads(file.read_text(encoding="utf-8"))
    return digests


def differences(baseline: dict[str, str], current: dict[str, str]) -> list[str]:
    """Return a line for each case that is gone or differs; new ones are no difference."""
    gone = [f"gone: {name}" for name in baseline if name not in current]
    differing = [name for name, value in baseline.items() if current.get(name, value) != value]
    return gone + [f"differs: {name}" for name in differing]


def main() -> int:
    """Compare; returns 1 where something differs."""
    if len(sys.argv) != 2:
        print("usage: compare.py REVISION", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as name:
        base = Path(name) / "base"
        base.mkdir()
        archive = subprocess.run(
            ["git", "archive", sys.argv[1]], cwd=ROOT, check=True, capture_output=True
        )
        subprocess.run(["tar", "-x", "-C", str(base)], input=archive.stdout, check=True)
        baseline, current = outputs(base, Path(name)), outputs(ROOT, Path(name))
    differing_cases = differences(baseline, current)
    print("\n".join(differing_cases[:MOST_SHOWN]))
    print(f"{len(baseline)} cases of {sys.argv[1]}, {len(differing_cases)} gone or different")
    return int(bool(differing_cases))


if __name__ == "__main__":
    sys.exit(main())
