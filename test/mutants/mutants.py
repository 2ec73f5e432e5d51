# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether the tests notice a wrong formula: ``make mutants``.

Each mutant changes one line of a copy of the tree. The tests named with it pass before and must
fail after; if they pass, they let the wrong formula through. ``mutants.py WORD`` runs the mutants
whose file or line contains the word.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
TESTS_FAILED = 1
"""The exit status of pytest where tests ran and some failed: not a syntax error, not no tests."""


class Mutant(NamedTuple):
    """A wrong line, and the tests that must notice it."""

    file: str
    """In ``imu_sim_ros/``."""
    line: str
    """As it stands in the file, once, without its indentation."""
    wrong: str
    tests: tuple[str, ...]
    """Arguments of pytest, in ``test/``."""


MUTANTS = (
    # An oversampled IMU gives the first inner reading instead of the last.
    Mutant(
        "sensors/errors/triad.py",
        "last = slice(self._ratio - 1, None, self._ratio)",
        "last = slice(0, None, self._ratio)",
        ("sensor/test_sampling.py", "-k", "as_late_as"),
    ),
    # The steps of a random walk do not depend on the rate as they should.
    Mutant(
        "sensors/errors/terms.py",
        "self._sigma = self.strength * np.sqrt(self.dt)",
        "self._sigma = self.strength * self.dt",
        ("sensor/test_noise.py", "-k", "test_random_walk"),
    ),
    # A driven Gauss-Markov bias is sqrt(2) too strong.
    Mutant(
        "sensors/imu/triads.py",
        "driven = self.gauss_markov_density * np.sqrt(np.multiply(0.5, self.correlation_time))",
        "driven = self.gauss_markov_density * np.sqrt(self.correlation_time)",
        ("sensor/test_noise.py", "-k", "gauss_markov"),
    ),
    # The lever arm's tangential acceleration has the wrong sign.
    Mutant(
        "sensors/imu/ideal.py",
        "force += cross(motion.angular_acceleration, arm)",
        "force -= cross(motion.angular_acceleration, arm)",
        ("sensor/ideal/test_ideal.py", "-k", "lever_arm"),
    ),
    # Coriolis' acceleration is half.
    Mutant(
        "sensors/imu/ideal.py",
        "coriolis *= 2.0",
        "coriolis *= 1.0",
        ("sensor/ideal/test_ideal.py", "-k", "coriolis"),
    ),
    # Driving north turns the local level the wrong way.
    Mutant(
        "sensors/gravity.py",
        "transport_rate=_vectors(-lat_1, lon_1 * cosine, lon_1 * sine),",
        "transport_rate=_vectors(lat_1, lon_1 * cosine, lon_1 * sine),",
        ("sensor/ideal/test_curved_earth.py", "-k", "newtons_law"),
    ),
    # The clock's drift is twice what it should be.
    Mutant(
        "sensors/timing.py",
        "error = self._skew + 0.5 * self._drift * (since_ns * 1e-9)",
        "error = self._skew + self._drift * (since_ns * 1e-9)",
        ("sensor/test_timing.py", "-k", "drift"),
    ),
    # The Earth's turn on a signal's way enters the range rate with the wrong sign.
    Mutant(
        "sensors/gnss/observations.py",
        "rate = (approach - antenna_rate) / (1.0 + approach / LIGHT - swing)",
        "rate = (approach - antenna_rate) / (1.0 + approach / LIGHT + swing)",
        ("sensor/gnss/test_raw.py", "-k", "range_rates"),
    ),
    # The mean of a wheel's speed takes the slopes at both ends the wrong way round.
    Mutant(
        "sensors/wheels/model.py",
        "return 0.5 * (previous + twist) + self._dt / 12.0 * (slopes - rate)",
        "return 0.5 * (previous + twist) + self._dt / 12.0 * (rate - slopes)",
        ("sensor/wheels/test_wheels.py", "-k", "means_are"),
    ),
    # The tangential distortion has one wrong sign.
    Mutant(
        "sensors/camera/model.py",
        "result[:, 1] = y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y",
        "result[:, 1] = y * radial + p1 * (s + 2.0 * y * y) - 2.0 * p2 * x * y",
        ("camera/test_model.py", "-k", "opencv"),
    ),
    # Midpoint: the tilt at a step's end has the wrong sign in F.
    Mutant(
        "navigation/preintegration.py",
        "tilt1 = -0.5 * r1 @ rotation.skew(force[:, 1])",
        "tilt1 = 0.5 * r1 @ rotation.skew(force[:, 1])",
        ("navigation/test_preintegration.py", "-k", "f_and_g"),
    ),
    # The term of Runge-Kutta that the position has in addition to the mean velocity's is reversed.
    Mutant(
        "navigation/increments.py",
        "s = h * h / 12.0",
        "s = -h * h / 12.0",
        ("navigation/test_dead_reckoning.py", "-k", "order_4"),
    ),
    # The covariance of dead reckoning carries half of the velocity into the position.
    Mutant(
        "navigation/covariance.py",
        "s = 0.5 * h",
        "s = 0.25 * h",
        ("navigation/test_covariance_steps.py", "-k", "fast_step"),
    ),
    # The fixed gauge turns positions the wrong way.
    Mutant(
        "navigation/evaluation.py",
        "n[:, 0, 3], n[:, 1, 3] = -y, x",
        "n[:, 0, 3], n[:, 1, 3] = y, -x",
        ("navigation/test_gauge.py",),
    ),
    # The band of a random walk is that of white noise.
    Mutant(
        "calibration/noise/deviation.py",
        "return np.maximum(np.minimum(white, walk), 1.0)",
        "return np.maximum(white, 1.0)",
        ("calibration/test_deviation.py", "-k", "band"),
    ),
    # The phases that are kept of a long record are off by one.
    Mutant(
        "calibration/noise/deviation.py",
        "skip = -(self._count + 1) % self._stride",
        "skip = -self._count % self._stride",
        ("calibration/test_deviation.py", "-k", "second_phase"),
    ),
    # The first coefficients see too much of 1/f noise.
    Mutant(
        "calibration/noise/terms.py",
        "edge = 2.0 / np.pi * (sici(np.pi * order)[0] - 2.0 * odd / (np.pi * order))",
        "edge = 2.0 / np.pi * (sici(np.pi * order)[0] + 2.0 * odd / (np.pi * order))",
        ("calibration/test_spectrum.py", "-k", "flicker"),
    ),
)


def missing() -> list[str]:
    """Return a line for each mutant whose source line is not in its file exactly once."""
    lines = []
    for mutant in MUTANTS:
        path = ROOT / "imu_sim_ros" / mutant.file
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        count = sum(line.strip() == mutant.line for line in text.splitlines())
        if count != 1:
            lines.append(
                f"imu_sim_ros/{mutant.file} has {count} times the line {mutant.line!r}: "
                "change this mutant in test/mutants/mutants.py with the formula"
            )
    return lines


def copied(folder: Path) -> Path:
    """Return a copy of the tree, with what is not committed."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    tree = folder / "tree"
    for name in filter(None, listed.stdout.split("\0")):
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tree / name)
    return tree


def tested(tree: Path, tests: tuple[str, ...]) -> subprocess.CompletedProcess[str]:
    """Return how the tests of a tree end, with its own package."""
    first, *others = tests
    words = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    return subprocess.run(
        [*words, f"test/{first}", *others],
        cwd=tree,
        # Byte code of the right line could pass for that of a wrong one as long, a second later.
        env={**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
    )


def survives(tree: Path, mutant: Mutant) -> bool:
    """Return whether the tests pass with a mutant."""
    path = tree / "imu_sim_ros" / mutant.file
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines(keepends=True)
    number = next(k for k, line in enumerate(lines) if line.strip() == mutant.line)
    lines[number] = lines[number].replace(mutant.line, mutant.wrong)
    path.write_text("".join(lines), encoding="utf-8")
    status = tested(tree, mutant.tests).returncode
    path.write_text(text, encoding="utf-8")
    return status != TESTS_FAILED


def main() -> int:
    """Run the mutants; returns 1 if one survives or its tests fail without it."""
    if lines := missing():
        print("\n".join(lines), file=sys.stderr)
        return 2
    word = sys.argv[1] if len(sys.argv) > 1 else ""
    chosen = [one for one in MUTANTS if word in one.file or word in one.line]
    failed = 0
    with tempfile.TemporaryDirectory() as name:
        tree = copied(Path(name))
        for mutant in chosen:
            begin = time.monotonic()
            before = tested(tree, mutant.tests)
            if before.returncode:
                verdict = f"its tests fail without it:\n{before.stdout[-2000:]}"
            else:
                verdict = "SURVIVES" if survives(tree, mutant) else "dies"
            failed += verdict != "dies"
            seconds = time.monotonic() - begin
            print(f"{verdict:8} {seconds:4.0f} s  {mutant.file}: {mutant.wrong}", flush=True)
    print(f"{len(chosen)} mutants, {failed} that the tests do not notice")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
