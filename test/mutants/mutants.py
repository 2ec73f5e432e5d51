# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A check that the tests notice wrong formulas: ``make mutants``.

Each mutant changes one line of a copy of the tree. The tests named with it pass before and must
fail after; if they pass, they let the wrong formula through. ``mutants.py WORD`` runs the mutants
whose file or line contains the word.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple, TypeVar

ROOT = Path(__file__).resolve().parents[2]
T = TypeVar("T")
WORKERS = 2
"""Number of trees in which tests run side by side."""
TESTS_FAILED = 1
"""The exit status of pytest where tests ran and some failed: not a syntax error, not no tests."""


class Mutant(NamedTuple):
    """A wrong line, and the tests that must notice it."""

    file: str
    """Path in ``imu_sim_ros/``."""
    line: str
    """Text of the line, which the file has once, without its indentation."""
    wrong: str
    tests: tuple[str, ...]
    """Arguments of pytest, in ``test/``."""


LENSES = ("camera/test_model.py", "-k", "opencv or papers or comes_back or derivative")
WHEELS = ("sensor/wheels/test_pose_covariance.py", "-k", "remaining_way")

MUTANTS = (
    # An oversampled IMU gives the first inner reading instead of the last.
    Mutant(
        "sensors/errors/triad.py",
        "return np.copy(values[self._ratio - 1 :: self._ratio])",
        "return np.copy(values[:: self._ratio])",
        ("sensor/test_sampling.py", "-k", "as_late_as"),
    ),
    # The steps of a random walk do not depend on the rate as they should.
    Mutant(
        "sensors/errors/terms.py",
        "self._sigma = self.strength * np.sqrt(self.dt)",
        "self._sigma = self.strength * self.dt",
        (
            "sensor/test_noise.py",
            "-k",
            "test_increments_of_the_walk_are_white_with_the_parameters_variance",
        ),
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
    # The Ackermann steering's error turns about the origin the wrong way.
    Mutant(
        "sensors/wheels/uncertainty.py",
        "about = np.stack([y * dt, -x * dt, dt], axis=1)",
        "about = np.stack([-y * dt, x * dt, dt], axis=1)",
        WHEELS,
    ),
    # The slope of the yaw rate over the steering angle lacks 1 + tan^2.
    Mutant(
        "sensors/wheels/uncertainty.py",
        "slope = twist[:, 0] * (1.0 + tangent**2) / self._parameters.wheelbase",
        "slope = twist[:, 0] * (1.0 + tangent) / self._parameters.wheelbase",
        WHEELS,
    ),
    Mutant(
        "sensors/wheels/uncertainty.py",
        "slope = (1.0 + np.tan(steered) ** 2) / p.wheelbase",
        "slope = (1.0 + np.tan(steered)) / p.wheelbase",
        WHEELS,
    ),
    # The angle at the Earth's centre has the wrong constant.
    Mutant(
        "sensors/gnss/observations.py",
        "psi = 0.0137 / (elevation + 0.11) - 0.022",
        "psi = 0.0137 / (elevation + 0.11) + 0.022",
        ("sensor/gnss/test_raw.py", "-k", "published"),
    ),
    # The height enters the troposphere ten times too strong.
    Mutant(
        "sensors/gnss/observations.py",
        "dry = 0.0022768 * pressure / (1.0 - 0.00266 * np.cos(2.0 * latitude) - 0.00028 * h / 1e3)",
        "dry = 0.0022768 * pressure / (1.0 - 0.00266 * np.cos(2.0 * latitude) - 0.00028 * h / 1e2)",
        ("sensor/gnss/test_raw.py", "-k", "mountain"),
    ),
    # The stated error of the climb is that of three dimensions.
    Mutant(
        "sensors/gnss/declaration.py",
        '"err_climb": _WITHIN[0] * np.sqrt(samples.velocity_variance[rows, 2]),',
        '"err_climb": _WITHIN[2] * np.sqrt(samples.velocity_variance[rows, 2]),',
        ("sensor/gnss/test_gnss.py", "-k", "extended_fixes"),
    ),
    # Camera: the slope of the second radial coefficient has the third one's factor.
    Mutant(
        "sensors/camera/model.py",
        "slope = 2.0 * (k1 + s * (2.0 * k2 + 3.0 * s * k3))  # d radial / d x = slope x",
        "slope = 2.0 * (k1 + s * (3.0 * k2 + 3.0 * s * k3))  # d radial / d x = slope x",
        LENSES,
    ),
    # The first tangential coefficient has a wrong factor.
    Mutant(
        "sensors/camera/model.py",
        "result[:, 0] = x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x)",
        "result[:, 0] = x * radial + 1.0 * p1 * x * y + p2 * (s + 2.0 * x * x)",
        LENSES,
    ),
    # A double sphere is blended with the depth before its first sphere.
    Mutant(
        "sensors/camera/model.py",
        "blended: Array = self.alpha * d2 + (1.0 - self.alpha) * z1",
        "blended: Array = self.alpha * d2 + (1.0 - self.alpha) * z",
        LENSES,
    ),
    # A unified sphere is left by the wrong root.
    Mutant(
        "sensors/camera/model.py",
        "result[:, 2] = factor * forward - self.xi",
        "result[:, 2] = factor * forward + self.xi",
        LENSES,
    ),
    # Fresnel's reflectance by Schlick has the fourth power.
    Mutant(
        "places/gloss.py",
        "return square * square * x * (_ONE - normal) + normal",
        "return square * square * (_ONE - normal) + normal",
        ("places/test_gloss.py", "-k", "fresnels"),
    ),
    # A lamp gives half of its light.
    Mutant(
        "places/light.py",
        "share = np.float32(area / (math.pi * _SAMPLES**2))",
        "share = np.float32(area / (2.0 * math.pi * _SAMPLES**2))",
        ("places/test_light.py", "-k", "form_factor"),
    ),
    # LiDAR: the range of detection goes with the power, not with its root.
    Mutant(
        "sensors/lidar/model.py",
        "return p.detection_range * np.sqrt(power / p.detection_reflectivity)",
        "return p.detection_range * (power / p.detection_reflectivity)",
        ("sensor/lidar/test_lidar.py", "-k", "dark_and_grazing"),
    ),
    # Timing noise goes with the range, not with its square.
    Mutant(
        "sensors/lidar/model.py",
        "distance_noise = p.range_noise_at_limit * np.minimum((range_ / limit) ** 2, 1.0)",
        "distance_noise = p.range_noise_at_limit * np.minimum((range_ / limit) ** 1, 1.0)",
        ("sensor/lidar/test_lidar.py", "-k", "grows_towards"),
    ),
    # Directions across a ray are not square to it.
    Mutant(
        "sensors/lidar/model.py",
        "result[:, 2] = up / over",
        "result[:, 2] = up * over",
        ("sensor/lidar/test_lidar.py", "-k", "jitter_and_by_ring"),
    ),
    # The intensity goes with the square of the power.
    Mutant(
        "sensors/lidar/model.py",
        "intensity = 100.0 * power",
        "intensity = 100.0 * power**2",
        ("sensor/lidar/test_lidar.py", "-k", "intensity_is"),
    ),
    # Firings of a spinning LiDAR are all at once.
    Mutant(
        "sensors/lidar/pattern.py",
        "time = (begin[:, None] + np.arange(channels) * p.channel_interval).reshape(-1)",
        "time = (begin[:, None] + 0.0 * np.arange(channels) * p.channel_interval).reshape(-1)",
        ("sensor/lidar/test_lidar.py", "-k", "are_their_own"),
    ),
    # Twin: proper rotations of a triad are taken for reflections.
    Mutant(
        "calibration/twin/alignment.py",
        "is_visible and bool(np.linalg.det(turn) < 0.0)",
        "is_visible and bool(np.linalg.det(turn) > 0.0)",
        ("calibration/test_twin.py", "-k", "inverted"),
    ),
    # The offset of a wandering clock is followed at twice its size.
    Mutant(
        "calibration/twin/alignment.py",
        "offset[k] = np.sum(x * y / power) / weight",
        "offset[k] = 2.0 * np.sum(x * y / power) / weight",
        ("calibration/test_twin.py", "-k", "wandering"),
    ),
    # Navigation: the second term of Bortz's equation has the wrong sign.
    Mutant(
        "navigation/increments.py",
        "b = cross(phi, a)",
        "b = cross(a, phi)",
        ("navigation/test_dead_reckoning.py", "-k", "order_4"),
    ),
    # Headings are aligned the wrong way.
    Mutant(
        "navigation/evaluation.py",
        "r = rotation.to_matrix(rotation.exp(np.array([0.0, 0.0, -heading_error])))",
        "r = rotation.to_matrix(rotation.exp(np.array([0.0, 0.0, heading_error])))",
        ("navigation/test_gauge.py",),
    ),
    # The band of the mean NEES is that of one run.
    Mutant(
        "navigation/evaluation.py",
        "low, high = 2.0 * gammaincinv(0.5 * freedom * runs, [tail, 1.0 - tail]) / runs",
        "low, high = 2.0 * gammaincinv(0.5 * freedom, [tail, 1.0 - tail])",
        ("navigation/test_consistency.py", "-k", "band"),
    ),
    # Runge-Kutta's derivative of a quaternion is not halved.
    Mutant(
        "navigation/increments.py",
        "k1 = (0.0 * x, 0.5 * x, 0.5 * y, 0.5 * z)",
        "k1 = (0.0 * x, 1.0 * x, 0.5 * y, 0.5 * z)",
        ("navigation/test_dead_reckoning.py", "-k", "order_4"),
    ),
    # The mid step of Runge-Kutta on SO(3) is a whole one.
    Mutant(
        "navigation/increments.py",
        "phi3 = scale(k2, half)",
        "phi3 = scale(k2, h)",
        ("navigation/test_dead_reckoning.py", "-k", "order_4"),
    ),
    # The last stage of Runge-Kutta takes the force of the middle.
    Mutant(
        "navigation/increments.py",
        "a2, a3, a4 = rotate(q2, middle), rotate(q3, middle), rotate(q4, force[1])",
        "a2, a3, a4 = rotate(q2, middle), rotate(q3, middle), rotate(q4, middle)",
        ("navigation/test_dead_reckoning.py", "-k", "order_4"),
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
    path, *options = tests
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"]
    return subprocess.run(
        [*command, f"test/{path}", *options],
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
    chosen = [mutant for mutant in MUTANTS if word in mutant.file or word in mutant.line]
    trees: SimpleQueue[Path] = SimpleQueue()
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(WORKERS) as pool:
        for k in range(WORKERS):
            trees.put(copied(Path(name) / str(k)))

        def in_a_tree(test: Callable[[Path], T]) -> T:
            tree = trees.get()
            try:
                return test(tree)
            finally:
                trees.put(tree)

        passing = {
            tests: pool.submit(in_a_tree, partial(tested, tests=tests))
            for tests in dict.fromkeys(mutant.tests for mutant in chosen)
        }
        surviving = [pool.submit(in_a_tree, partial(survives, mutant=m)) for m in chosen]
        failed = 0
        for mutant, future in zip(chosen, surviving, strict=True):
            reference = passing[mutant.tests].result()
            verdict = "SURVIVES" if future.result() else "dies"
            if reference.returncode:
                verdict = f"its tests fail without it:\n{reference.stdout[-2000:]}"
            failed += verdict != "dies"
            print(f"{verdict:8} {mutant.file}: {mutant.wrong}", flush=True)
    print(f"{len(chosen)} mutants, {failed} that the tests do not notice")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
