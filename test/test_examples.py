# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every example and notebook runs as it stands, and prints what its text promises."""

import json
import re
import runpy
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
ARGUMENTS = {
    "gymnasium_imu": ["8"],
    "legged_imus": ["64"],
    "monte_carlo": ["{folder}", "8"],
    "places": ["{folder}", "corridor"],
    "mujoco_imu": ["{folder}", "12"],
}


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Return a function that runs a script here, in a folder of its own; it returns the output.

    A process of its own would import NumPy, SciPy and matplotlib for each again.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(EXAMPLES))

    def start(script):
        arguments = [a.format(folder=tmp_path) for a in ARGUMENTS.get(script.stem, ["{folder}"])]
        monkeypatch.setattr(sys, "argv", [str(script), *arguments])
        runpy.run_path(str(script), run_name="__main__")
        return capsys.readouterr().out

    with mpl.rc_context():
        yield start
    plt.close("all")


def numbers(text):
    return [float(word) for word in re.findall(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?", text)]


def test_there_are_at_least_five_scripts_and_two_notebooks():
    assert len(list(EXAMPLES.glob("*.py"))) >= 5
    assert len(list(EXAMPLES.glob("*.ipynb"))) == 2


def test_lecture_has_the_errors_of_euler_and_midpoint(run, tmp_path):
    """Euler ends 0.906 m off and midpoint 1.29 mm: the lecture's trajectory without noise."""
    euler, midpoint, noisy, *_ = run(EXAMPLES / "lecture.py").splitlines()
    assert numbers(euler)[0] == pytest.approx(0.906, abs=0.001)
    assert numbers(midpoint)[0] == pytest.approx(1.29e-3, abs=1e-5)
    assert numbers(noisy)[0] > 0.01
    assert {path.name for path in tmp_path.iterdir()} == {"lecture_path.png", "lecture_allan.png"}


def test_vio_residuals_vanish_between_true_states(tmp_path):
    """True states have no residual but the midpoint rule's; derivatives equal differences.

    In a process of its own, as a user starts it.
    """
    command = [sys.executable, str(EXAMPLES / "vio_residuals.py")]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    between_true, off = done.stdout.splitlines()
    assert numbers(between_true)[-1] < 1e-6
    assert numbers(off)[-1] < 1e-8


def test_integrals_are_of_a_higher_order_than_the_midpoint_rule(run):
    """Midpoint is of order 2, integrals with coning and sculling corrected of order 3."""
    _, *rows = run(EXAMPLES / "integrals.py").splitlines()
    table = np.array([numbers(row) for row in rows])
    orders = -np.diff(np.log2(table[:, 1:]), axis=0)
    assert np.abs(orders - [2.0, 3.0]).max() < 0.05


def test_vio_dataset_writes_three_flights_of_readings_and_noise(run, tmp_path):
    out = run(EXAMPLES / "vio_dataset.py")
    assert out.count("6000 at 200 Hz") == 3
    assert (tmp_path / "mav0/imu0/data.csv").is_file()
    assert "gyroscope_noise_density" in (tmp_path / "imu.yaml").read_text()


def test_places_draws_a_corridor_in_colour(run, tmp_path):
    """A corridor: bright walls and ceiling above a darker floor, in colour."""
    from imu_sim_ros.sensors.camera.images.files import decode_image

    run(EXAMPLES / "places.py")
    image = decode_image((tmp_path / "place_corridor.png").read_bytes())
    assert image.shape == (480, 752, 3)
    assert image[:240].mean() > image[400:].mean()


@pytest.mark.slow
def test_front_page_draws_four_panels_light_and_dark(run, tmp_path):
    """Both strips have the four panels of the README; the machine hall's image is in colour."""
    run(EXAMPLES / "front_page.py")
    light, dark = (plt.imread(tmp_path / f"front_page_{page}.png") for page in ("light", "dark"))
    assert light.shape == dark.shape == (434, 1820, 4)
    camera = light[60:400, 20:420, :3]
    assert 0.2 < camera.mean() < 0.8
    assert np.ptp(camera, axis=2).max() > 0.3
    for panel in (light[60:400, 480:880], light[60:400, 1050:1330], light[60:400, 1480:1800]):
        assert 0.01 < np.mean(panel[..., 3] > 0) < 0.9  # ink on a transparent page


def test_town_drive_follows_slopes_with_outages(run, tmp_path):
    """On a slope of 3 percent, 1.72 degrees, at up to 50 km/h; 20 s of 133 s are without a fix."""
    way, lean, wheels = run(EXAMPLES / "town_drive.py").splitlines()
    assert numbers(way) == [133.0, pytest.approx(708.0, abs=3.0), 50.0]
    assert all(1.7 < angle < 3.0 for angle in numbers(lean))
    assert numbers(wheels)[1] == pytest.approx(10 * (133.3 - 20.0), abs=2)
    assert {path.name for path in tmp_path.iterdir()} >= {"town.mcap", "town_drive.png"}


def test_digital_twin_has_the_noise_of_its_original(run):
    """The white noise of 20 min at 200 Hz is known to 1 / sqrt(2 * 240,000) = 0.14 %, twice."""
    lines = run(EXAMPLES / "digital_twin.py").splitlines()
    for line in lines[-2:]:
        for ratio in numbers(line.partition("original:")[2]):
            assert ratio == pytest.approx(1.0, abs=0.01)


def test_mujoco_imu_draws_readings_of_each_step(run, tmp_path):
    """An ADIS16470 for 12 s at 1 kHz, a sample at each of MuJoCo's steps."""
    pytest.importorskip("mujoco")
    readings, evaluation, bias = run(EXAMPLES / "mujoco_imu.py").splitlines()
    assert readings == "<Readings adis16470 on a pendulum: 12000 at 1000 Hz, 11.999 s>"
    assert "12000 poses" in evaluation
    assert len(numbers(bias)) == 3
    assert (tmp_path / "mujoco_imu.png").is_file()


def test_gymnasium_imu_balances_pendulums_that_biases_tilt(run):
    """The policy balances all pendulums; biases of the IMUs tilt them."""
    pytest.importorskip("mujoco")
    pytest.importorskip("gymnasium")
    lines = run(EXAMPLES / "gymnasium_imu.py").splitlines()
    (ideal, ideal_falls, _), (real, falls, _) = (numbers(line)[-3:] for line in lines)
    assert ideal_falls == falls == 0.0
    assert 0.0 < 2.0 * ideal < real < 0.3


def test_legged_imus_have_the_turn_on_biases_of_the_data_sheet(run):
    """Turn-on bias of the data sheet, 0.01745 rad/s, over 192 axes known to 1 / sqrt(384) = 5 %."""
    gyro, accel, cost = run(EXAMPLES / "legged_imus.py").splitlines()
    assert numbers(gyro)[0] == pytest.approx(0.01745, rel=0.2)
    # 0.19613 m/s^2 of the sheet and 0.1 of the spread.
    assert numbers(accel)[0] == pytest.approx(0.2202, rel=0.2)
    assert numbers(cost)[0] > 0.0


def test_preintegration():
    """40 runs, 21 intervals, 3 axes: 2520 squares give a deviation to 1 / sqrt(5040) = 1.4 %.

    Neighbouring intervals share nothing but the walk. Five such deviations are 7 %. The lines are
    those of an exercise, which ``test_tutorials.py`` runs and compares to the last digit.
    """
    page = (EXAMPLES.parent / "docs/tutorials/exercises.md").read_text(encoding="utf-8")
    _, output = page.split("python examples/preintegration.py 40\n```\n```text\n")
    lines = output.partition("```")[0].splitlines()
    assert [line.partition(":")[0] for line in lines] == ["alpha", "beta"]
    for line in lines:
        assert numbers(line)[0] == pytest.approx(1.0, abs=0.07)


def test_monte_carlo_ranks_tactical_below_navigation_grade(run):
    tactical, navigation = run(EXAMPLES / "monte_carlo.py").splitlines()
    assert numbers(tactical)[0] > 3.0 * numbers(navigation)[0]


@pytest.mark.parametrize("notebook", sorted(EXAMPLES.glob("*.ipynb")), ids=lambda path: path.stem)
def test_notebooks_run_from_top_to_bottom(notebook, tmp_path, monkeypatch):
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    monkeypatch.chdir(tmp_path)
    exec(compile(code, notebook.name, "exec"), {"__name__": "__main__"})


@pytest.mark.parametrize("notebook", sorted(EXAMPLES.glob("*.ipynb")), ids=lambda path: path.stem)
def test_notebooks_are_kept_without_outputs(notebook):
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    assert all(not cell["outputs"] for cell in cells if cell["cell_type"] == "code")


@pytest.mark.ros  # the numbers are those of one NumPy release
def test_the_script_of_the_readme_prints_what_stands_below_it(run, tmp_path):
    readme = (EXAMPLES.parent / "README.md").read_text(encoding="utf-8")
    code, printed = re.findall(r"```python\n(.*?)```\n```\n(.*?)```", readme, re.DOTALL)[0]
    (tmp_path / "five_lines.py").write_text(code)
    assert run(tmp_path / "five_lines.py") == printed
