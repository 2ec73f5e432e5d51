# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimators that are programs: good ones, and all that a program can do wrong."""

import contextlib
import os
import shlex
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from programs import until

import imu_sim_ros as ims
from imu_sim_ros.campaigns import command_estimator as command
from imu_sim_ros.campaigns.plan import load_plan
from imu_sim_ros.campaigns.runs import CellRuns
from imu_sim_ros.commands.campaign import main

# Reads the truth of the EuRoC folder and writes it as its estimate, moved and turned in yaw.
HONEST = """
import csv, sys, math
dataset, estimate = sys.argv[1:]
rows = list(csv.reader(open(dataset + "/mav0/state_groundtruth_estimate0/data.csv")))[1:]
assert len(list(open(dataset + "/mav0/imu0/data.csv"))) == len(rows) + 1
with open(estimate, "w") as file:
    for row in rows[::5]:
        x, y, z = map(float, row[1:4])
        w, i, j, k = map(float, row[4:8])
        c, s = math.cos(0.25), math.sin(0.25)  # half the yaw of 0.5 rad
        q = (c * w - s * k, c * i - s * j, c * j + s * i, c * k + s * w)
        px, py = math.cos(0.5) * x - math.sin(0.5) * y, math.sin(0.5) * x + math.cos(0.5) * y
        print(int(row[0]) * 1e-9, px + 3, py - 2, z + 1, q[1], q[2], q[3], q[0], file=file)
"""


@pytest.fixture
def run(tmp_path, plan_file):
    """Return a function that runs one program as an estimator: its row of results."""

    def one(program, arguments="", keep="none", **options):
        script = tmp_path / 'the program\'s "script".py'
        script.write_text(program, encoding="utf-8")
        options = {
            "command": f"{{python}} {shlex.quote(str(script))} {arguments}",
            "timeout": 30.0,
            **options,
        }
        plan = load_plan(plan_file(estimators={"program": options}, keep=keep))
        (row,) = CellRuns(plan, next(plan.cells())).rows([1], ["program"], tmp_path / "out")
        return row

    return one


def test_an_honest_program_is_measured_after_alignment(run):
    row = run(HONEST, "{dataset} {estimate}")
    assert row["status"] == "done"
    assert row["ate_rmse_m"] < 1e-6
    assert row["ate_rmse_rad"] < 1e-6
    assert abs(row["scale_error"]) < 1e-6
    assert row["initialisation_s"] == pytest.approx(0.0, abs=1e-9)
    assert row["peak_memory_mb"] > 1.0
    assert row["real_time_factor"] > 0.0
    assert row["nees_position"] is None


def test_places_are_found_from_the_runs_own_folder(plan_file, tmp_path, monkeypatch):
    """The folder of the results may be relative, as in ``campaign plan.yaml -o results``."""
    script = tmp_path / "program.py"
    script.write_text(HONEST, encoding="utf-8")
    command = f"{{python}} {script} {{dataset}} {{estimate}}"
    plan = load_plan(plan_file(estimators={"a": {"command": command}}))
    monkeypatch.chdir(tmp_path)
    (row,) = CellRuns(plan, next(plan.cells())).rows([1], ["a"], Path("results"))
    assert row["status"] == "done"


def test_without_alignment_the_offset_is_an_error(run):
    row = run(HONEST, "{dataset} {estimate}", align="none")
    assert row["ate_rmse_m"] > 1.0


def test_covariances_of_an_estimate_give_its_nees(run):
    """OpenVINS' columns: an error of 0.3 m along x at a sigma of 0.1 m is a NEES of 9."""
    program = """
import csv, sys
rows = list(csv.reader(open(sys.argv[1] + "/mav0/state_groundtruth_estimate0/data.csv")))[1:]
with open(sys.argv[2], "w") as file:
    for row in rows:
        x, y, z = map(float, row[1:4])
        w, i, j, k = row[4:8]
        sigmas = "1e-4 0 0 1e-4 0 1e-4 0.01 0 0 0.01 0 0.01"
        print(f"{int(row[0]) * 1e-9:.9f} {x + 0.3} {y} {z} {i} {j} {k} {w} {sigmas}", file=file)
"""
    row = run(program, "{dataset} {estimate}", align="none")
    assert row["status"] == "done"
    assert row["nees_position"] == pytest.approx(9.0, rel=1e-6)
    assert row["nees_attitude"] == pytest.approx(0.0, abs=1e-6)
    assert run(program, "{dataset} {estimate}", align="yaw")["nees_position"] is None


def test_odometry_of_a_bag_gives_velocity_and_its_nees(run):
    """Off by 0.2 m along x and 0.6 m/s along the body's y, at sigmas of 0.1 and 0.3: 4 and 4."""
    program = """
import sys
import numpy as np
from imu_sim_ros.bags.read import read_odometry
from imu_sim_ros.bags.messages.encode import ODOMETRY, OdometryEncoder
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.core.rotation import rotate_inverse
truth = read_odometry(sys.argv[1], "/ground_truth/odom")
position = truth.position + [0.2, 0, 0]
velocity = rotate_inverse(truth.q_wb, truth.velocity) + [0, 0.6, 0]
pose, twist = np.diag([0.01] * 3 + [1e-4] * 3), np.diag([0.09] * 3 + [1e-4] * 3)
encoder = OdometryEncoder("world", "base_link")
with open_writer(sys.argv[2] + ".mcap") as writer:
    payloads = encoder.encode(truth.t_ns, position, truth.q_wb, velocity,
                              truth.angular_velocity, pose, twist)
    writer.write(writer.add_topic("/filter/odom", ODOMETRY), truth.t_ns, payloads)
"""
    row = run(program, "{dataset} {estimate}", dataset="mcap", estimate="bag", align="none")
    assert row["status"] == "done"
    assert row["final_velocity_error_m_s"] == pytest.approx(0.6, rel=1e-6)
    assert row["nees_position"] == pytest.approx(4.0, rel=1e-6)
    assert row["nees_velocity"] == pytest.approx(4.0, rel=1e-6)
    assert row["nees_attitude"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("form", ["rosbag2", "ros1", "mcap"])
def test_datasets_of_every_form_are_read_by_rosbags(run, form):
    program = """
import shlex
import sys
from pathlib import Path
from rosbags.highlevel import AnyReader
with AnyReader([Path(sys.argv[1])]) as reader:
    counts = {c.topic: c.msgcount for c in reader.connections}
assert counts == {"/imu/data_raw": 200, "/ground_truth/odom": 200}, counts
open(sys.argv[2], "w").write("1 0 0 0 0 0 0 1\\n2 0 0 0 0 0 0 1\\n")
"""
    options = {"dataset": form, "align": "none", "coverage": 0.0}
    assert run(program, "{dataset} {estimate}", **options)["status"] == "done"


@pytest.mark.parametrize(
    ("program", "status"),
    [
        ("raise SystemExit(7)", "failed: exit status 7"),
        ("import sys; print('no map'); sys.exit(1)", "failed: exit status 1: no map"),
        ("import os; os.abort()", "failed: ended by SIGABRT"),
        ("pass", "failed: no estimate was written"),
        ("open('estimate.txt', 'w')", "failed: estimate: "),
        ("open('estimate.txt', 'w').write('1 2 3')", "failed: estimate: "),
        (
            "open('estimate.txt', 'w').write('1 nan 0 0 0 0 0 1\\n2 0 0 0 0 0 0 1\\n')",
            "failed: estimate: ",
        ),
        (
            "open('estimate.txt', 'w').write('1 1e300 0 0 0 0 0 1\\n2 1e300 0 0 0 0 0 1\\n')",
            "failed: estimate: line 1: position [1e+300, 0, 0]: at most 1e+10 m is possible",
        ),
        (
            "open('estimate.txt', 'w').write('1 0 0 0 0 0 0 0\\n2 0 0 0 0 0 0 1\\n')",
            "failed: estimate: line 1: a quaternion of length 0 instead of 1",
        ),
        ("import os; os.mkfifo('estimate.txt')", "failed: estimate: is a device or a pipe"),
        ("open('estimate.txt', 'w').write('1 ' * 10**6)", "failed: estimate: not a text file"),
        (
            "open('estimate.txt', 'w').write('91 0 0 0 0 0 0 1\\n92 0 0 0 0 0 0 1\\n')",
            "failed: estimate: estimate and truth do not overlap",
        ),
        ("import os, shutil; shutil.rmtree(os.getcwd())", "failed: no estimate was written"),
        ("import shutil, sys; shutil.rmtree(sys.argv[1])", "failed: no estimate was written"),
        ("print('<script>alert(1)</script>\\x1b[2J'); exit(2)", "failed: exit status 2: <script>"),
    ],
)
def test_what_goes_wrong_is_a_result(run, program, status):
    assert run(program, "{dataset}")["status"].startswith(status)


def test_an_error_that_nobody_foresaw_is_the_status_of_its_own_run(
    plan_file, tmp_path, monkeypatch
):
    def broken(*_):
        raise np.linalg.LinAlgError("SVD did not converge")

    plan = load_plan(plan_file(estimators={"a": {"command": "true"}, "dead_reckon": {}}))
    monkeypatch.setattr("imu_sim_ros.campaigns.command_estimator.run_command", broken)
    failed_row, other_row = CellRuns(plan, next(plan.cells())).rows([1], plan.estimators, tmp_path)
    assert failed_row["status"] == "failed: unexpected: LinAlgError: SVD did not converge"
    assert other_row["status"] == "done"


def test_a_program_that_cannot_be_started(run, plan_file, tmp_path):
    plan = load_plan(plan_file(estimators={"a": {"command": "/no/such/program"}}))
    (row,) = CellRuns(plan, next(plan.cells())).rows([1], ["a"], tmp_path / "out")
    assert row["status"].startswith("failed: /no/such/program: cannot be started: ")


@pytest.mark.parametrize(
    ("ending", "status", "timeout", "least_s"),
    [
        ("raise SystemExit(3)", "failed: exit status 3", 60.0, 0.3),
        ("time.sleep(60)", "failed: did not finish within 4 s", 4.0, 4.0),
        ("", "failed: no estimate was written", 60.0, 0.3),
    ],
    ids=["crash", "too slow", "nothing written"],
)
def test_a_failed_run_keeps_its_time_and_memory(run, ending, status, timeout, least_s):
    """The program holds 300 MB and sleeps for 0.3 s before it fails."""
    program = f"import time\nx = bytearray(300_000_000)\ntime.sleep(0.3)\n{ending}"
    row = run(program, timeout=timeout)
    assert row["status"] == status
    assert row["wall_s"] >= least_s
    assert 286.0 < row["peak_memory_mb"] < 500.0  # MiB, with the interpreter's own
    assert row["ate_rmse_m"] is None
    assert row["real_time_factor"] is None


def test_memory_is_the_programs_own_and_not_that_of_the_process_that_starts_it(run):
    """Forking hands the mark of the parent on; here 300 MB that no program ever touched."""
    large_array = np.ones(37_500_000)
    row = run("import time\nx = bytearray(100_000_000)\ntime.sleep(0.5)")
    assert large_array.nbytes == 300_000_000
    assert 95.0 < row["peak_memory_mb"] < 250.0


def test_memory_of_a_program_that_a_script_starts(run):
    """The script holds 10 MB, what it starts 100 MB."""
    large_array = np.ones(37_500_000)
    inner = "import time; x = bytearray(100_000_000); time.sleep(0.5)"
    row = run(f"import subprocess, sys\nsubprocess.run([sys.executable, '-c', {inner!r}])")
    assert large_array.nbytes == 300_000_000
    assert 95.0 < row["peak_memory_mb"] < 250.0


def test_programs_that_end_while_their_memory_is_looked_at_are_no_error():
    """A folder of /proc may vanish between two system calls, once in some thousand polls."""
    script = ["bash", "-c", "for i in {1..500}; do /bin/true; done"]
    with subprocess.Popen(script) as process:
        memory = command._PeakMemory()
        while process.poll() is None:
            memory.update(process.pid)
    assert process.returncode == 0


def test_a_program_that_ignores_sigterm_ends_at_its_timeout(run):
    program = """
import signal, time
for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
    signal.signal(number, signal.SIG_IGN)
while True:
    time.sleep(0.1)
"""
    assert run(program, timeout=1.0)["status"] == "failed: did not finish within 1 s"


def test_what_a_program_leaves_running_is_ended(run, tmp_path):
    """A child in a session of its own, whose parent is gone: the group alone would miss it."""
    marker = tmp_path / "child"
    program = f"""
import os, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        open({str(marker)!r} + ".part", "w").write(str(os.getpid()))
        os.rename({str(marker)!r} + ".part", {str(marker)!r})
        time.sleep(600)
    os._exit(0)
os.wait()
while not os.path.exists({str(marker)!r}):
    time.sleep(0.01)
"""
    children_before = command._children()
    assert run(program)["status"] == "failed: no estimate was written"
    assert not Path(f"/proc/{marker.read_text()}").exists()
    assert command._children() == children_before


SLEEPER = """
import os, sys, time
if os.fork() == 0:
    os.setsid()
open(sys.argv[1] + f"/pid_{os.getpid()}.part", "w").close()
os.rename(sys.argv[1] + f"/pid_{os.getpid()}.part", sys.argv[1] + f"/pid_{os.getpid()}")
time.sleep(600)
"""


def runs(pid):
    """Return True if the process runs and is not a zombie."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_program_does_not_outlive_its_campaign(plan_file, start, campaign, tmp_path, number):
    """Told to end, the campaign ends the program and what it forked; killed, the kernel does."""
    script, pids = tmp_path / "sleeper.py", tmp_path / "pids"
    script.write_text(SLEEPER, encoding="utf-8")
    pids.mkdir()
    command = f"{{python}} {script} {pids}"
    path = plan_file(seeds=1, estimators={"a": {"command": command}})
    process = start(path, "-o", tmp_path / "out", "--workers", 1, start_new_session=True)
    until(lambda: len(list(pids.glob("pid_??*[0-9]"))) == 2)
    parent, child = sorted(int(name.name[4:]) for name in pids.iterdir())
    os.killpg(process.pid, number)
    _, stderr = process.communicate()
    until(lambda: not runs(parent))
    if number == signal.SIGINT:
        until(lambda: not runs(child))
        assert stderr.endswith("continue with --resume\n")
    elif runs(child):
        os.kill(child, signal.SIGKILL)
    resumes(plan_file, campaign, tmp_path / "out")


def test_a_hang_up_of_the_terminal_is_one_line_and_leaves_no_process(plan_file, start, tmp_path):
    """The signal reaches all processes of the group: workers and their resource tracker."""
    script, pids = tmp_path / "sleeper.py", tmp_path / "pids"
    script.write_text(SLEEPER, encoding="utf-8")
    pids.mkdir()
    folder = tmp_path / "out"
    path = plan_file(seeds=2, estimators={"a": {"command": f"{{python}} {script} {pids}"}})
    process = start(
        *(path, "-o", folder, "--workers", 2, "--batch", 1),
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )
    until(lambda: len(list(pids.glob("pid_??*[0-9]"))) == 4)
    programs = [int(name.name[4:]) for name in pids.iterdir()]
    os.kill(process.pid, signal.SIGSTOP)  # the others hear of it first
    for child in command._children(process.pid):
        os.kill(child, signal.SIGHUP)
    until(lambda: not any(map(runs, programs)))
    os.kill(process.pid, signal.SIGHUP)
    os.kill(process.pid, signal.SIGCONT)
    _, stderr = process.communicate()
    assert process.returncode == 129
    assert stderr == (
        f"campaign: interrupted; {folder} has the runs made so far; continue with --resume\n"
    )


def resumes(plan_file, campaign, folder):
    """Check that a campaign ended within its first program is refused without ``--resume``.

    Nothing but the plan and the folder of the run that was cut off are there. The estimator has no
    program now: such a run needs no worker.
    """
    path = plan_file(seeds=1, estimators={"a": {"type": "dead_reckon"}})
    status, _, (line,) = campaign(path, "-o", folder)
    assert status == 2
    assert "continue with --resume, start over with --force" in line
    assert campaign(path, "-o", folder, "--resume")[1]["done"] == 1


@pytest.mark.parametrize("busy", [True, False], ids=["programs", "built in"])
def test_a_campaign_that_is_killed_leaves_no_process(plan_file, start, tmp_path, busy):
    """``kill -9`` of the main process alone: its workers end, and what their programs forked."""
    script, pids = tmp_path / "sleeper.py", tmp_path / "pids"
    script.write_text(SLEEPER, encoding="utf-8")
    pids.mkdir()
    if busy:
        estimators = {"a": {"command": f"{{python}} {script} {pids}"}}
        path = plan_file(seeds=2, estimators=estimators)
    else:
        path = plan_file(seeds=2, parameters={"rate": 1000.0, "duration": 600.0})
    process = start(path, "-o", tmp_path / "out", "--workers", 2, "--batch", 1)
    if busy:
        until(lambda: len(list(pids.glob("pid_??*[0-9]"))) == 4)
    else:
        until(lambda: len(command._children(process.pid)) == 3)  # one tracks the resources
    next_ids, process_ids = [process.pid], []
    while next_ids:
        next_ids = [child for pid in next_ids for child in command._children(pid)]
        process_ids += next_ids
    assert len(process_ids) == (7 if busy else 3)
    process.kill()
    process.communicate()
    try:
        until(lambda: not any(map(runs, process_ids)))
    finally:
        for pid in filter(runs, process_ids):
            os.kill(pid, signal.SIGKILL)


def test_a_campaign_told_to_end_within_its_first_program_resumes(
    plan_file, start, campaign, tmp_path
):
    """SIGTERM reaches the main process alone, not its group as Ctrl-C does."""
    begun, folder = tmp_path / "begun", tmp_path / "out"
    command = f"sh -c 'touch \"{begun}\"; sleep 600'"
    path = plan_file(seeds=1, estimators={"a": {"command": command}})
    process = start(path, "-o", folder, "--workers", 1, "--no-report")
    until(begun.exists)
    process.terminate()
    assert process.communicate()[1].endswith("continue with --resume\n")
    resumes(plan_file, campaign, folder)


def test_threads_of_one_worker_do_not_end_each_others_programs(plan_file, tmp_path):
    """A Dask worker runs several programs at once, one in each thread."""
    program = "import time; time.sleep(0.3); print(7); raise SystemExit(3)"
    plan = load_plan(plan_file(estimators={"a": {"command": f"{{python}} -c '{program}'"}}))
    cell = CellRuns(plan, next(plan.cells()))

    def one(seed):
        return next(iter(cell.rows([seed], ["a"], tmp_path / "out")))["status"]

    with ThreadPoolExecutor(3) as pool:
        assert set(pool.map(one, range(3))) == {"failed: exit status 3: 7"}


@pytest.mark.parametrize(
    "program",
    [
        "while True: print('x' * 1000000)",
        "import time\nfor k in range(10**6): open(f'f{k}', 'wb').write(bytes(500000))",
        "f = open('one', 'wb')\nwhile True: f.write(bytes(1000000))",
    ],
    ids=["endless output", "many files", "one file"],
)
def test_a_program_that_fills_the_disk_is_ended(run, tmp_path, program):
    row = run(program, disk_limit=2e7)
    assert row["status"] == "failed: more than 2e+07 bytes written"
    assert not (tmp_path / "out" / "runs").exists() or not list(
        (tmp_path / "out" / "runs").rglob("one")
    )


def test_a_program_that_ends_just_before_it_is_killed_has_ended():
    """Nobody may take its status meanwhile: "No child processes" was what the run failed with."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    until(lambda: "\nState:\tZ" in Path(f"/proc/{process.pid}/status").read_text())
    assert command._kill(process, command._PeakMemory()) > 0.0
    assert process.returncode == 0


def test_a_file_without_content_counts_with_its_size(plan_file, tmp_path):
    plan = load_plan(plan_file(estimators={"a": {"command": "truncate -s 100G one"}}))
    (row,) = CellRuns(plan, next(plan.cells())).rows([1], ["a"], tmp_path / "out")
    assert row["status"] == "failed: more than 2e+09 bytes written"


def test_a_program_gets_no_more_memory_than_it_may(run):
    row = run("x = bytearray(3_000_000_000)\nprint('got it')", memory_limit=1e9)
    assert row["status"] == "failed: exit status 1: MemoryError"


def test_no_shell_unless_it_is_asked_for(run, plan_file, tmp_path):
    target = tmp_path / "touched"
    for shell in (False, True):
        options = {"command": f"echo x; touch {target}", "shell": shell}
        plan = load_plan(plan_file(estimators={"a": options}))
        list(CellRuns(plan, next(plan.cells())).rows([1], ["a"], tmp_path / "out"))
        assert target.exists() == shell


def test_a_command_gets_its_environment_seed_and_folder(run, plan_file, tmp_path):
    script = "import os, sys; print(os.environ['GREETING'], *sys.argv[1:]); sys.exit(1)"
    options = {
        "command": f'{{python}} -c "{script}" {{seed}} {{folder}}',
        "environment": {"GREETING": "hello; rm -rf x"},
    }
    plan = load_plan(plan_file(estimators={"a": options}))
    (row,) = CellRuns(plan, next(plan.cells())).rows([4], ["a"], tmp_path / "out")
    assert row["status"].startswith("failed: exit status 1: hello; rm -rf x 4 ")
    assert row["status"].endswith("/000000/4/a")


@pytest.mark.parametrize(
    ("keep", "expected_folders"), [("none", []), ("failed", ["1"]), ("all", ["0", "1"])]
)
def test_run_folders_are_kept_as_asked(plan_file, tmp_path, keep, expected_folders):
    program = tmp_path / "program.py"
    ending = "\nsys.exit(os.getcwd().split('/')[-2] == '1')\n"
    program.write_text("import os\n" + HONEST + ending, encoding="utf-8")
    options = {"command": f"{sys.executable} {program} {{dataset}} {{estimate}}"}
    plan = load_plan(plan_file(estimators={"a": options}, keep=keep))
    rows = list(CellRuns(plan, next(plan.cells())).rows([0, 1], ["a"], tmp_path / "out"))
    assert [row["status"] for row in rows] == ["done", "failed: exit status 1"]
    run_folders = sorted(
        path.name
        for path in (tmp_path / "out" / "runs").rglob("*")
        if path.is_dir() and path.name in ("0", "1")
    )
    assert run_folders == expected_folders
    if keep == "all":
        folder = tmp_path / "out" / "runs" / "000000" / "0" / "a"
        assert (folder / "estimate.txt").is_file()
        assert (folder / "output.txt").is_file()


def test_the_configuration_names_the_simulated_parameters(run):
    program = """
import sys, yaml
tree = yaml.safe_load(open(sys.argv[1] + "/simulation.yaml"))["/**"]["ros__parameters"]
assert tree["imu"]["preset"] == "adis16448", tree
open("estimate.txt", "w").write("1 0 0 0 0 0 0 1\\n2 0 0 0 0 0 0 1\\n")
"""
    assert run(program, "{config}", align="none", coverage=0.0)["status"] == "done"


def test_a_program_gets_the_files_of_every_stack(run):
    """The folder that generate --with-configs writes, for the sensor and the seed of the run."""
    program = """
import os, sys, yaml
from pathlib import Path
folder = Path(sys.argv[1])
names = {path.name for path in folder.iterdir()}
assert names >= {"imu.yaml", "vins_fusion.yaml", "kalibr_imu_chain.yaml", "orb_slam3.yaml",
                 "basalt_calibration.json", "simulation.yaml"}, names
tree = yaml.safe_load((folder / "simulation.yaml").read_text())["/**"]["ros__parameters"]
assert tree["seed"] == 1, tree["seed"]
density = yaml.safe_load((folder / "imu.yaml").read_text())["gyroscope_noise_density"]
assert density == tree["imu"]["gyroscope_noise_density"][0], density
open("estimate.txt", "w").write("1 0 0 0 0 0 0 1\\n2 0 0 0 0 0 0 1\\n")
"""
    assert run(program, "{config}", align="none", coverage=0.0)["status"] == "done"


def test_programs_are_looked_up_before_the_first_run(plan_file, campaign, tmp_path):
    path = plan_file(
        seeds=1,
        align="none",
        estimators={
            "a": {"command": "nosuchprog {dataset}", "coverage": 0.0},
            "b": {"command": "./estimator.sh {estimate}", "coverage": 0.0},
            "c": {"command": "{python} {plan}/script.py {estimate}", "coverage": 0.0},
        },
    )
    status, _, lines = campaign(path, "-o", tmp_path / "out", "--check")
    assert status == 2
    assert [line.removeprefix(f"campaign: {path}: estimators.") for line in lines] == [
        f"a.command: nosuchprog: no such program, neither in PATH nor in {tmp_path}",
        f"b.command: ./estimator.sh: no such program, neither in PATH nor in {tmp_path}",
        f"c.command: {tmp_path}/script.py: does not exist",
    ]
    assert not (tmp_path / "out").exists()
    written = "1 0 0 0 0 0 0 1\\n2 1 0 0 0 0 0 1\\n"
    for name in ("nosuchprog", "estimator.sh"):
        (tmp_path / name).write_text(f"#!/bin/sh\nprintf '{written}' > estimate.txt\n")
        (tmp_path / name).chmod(0o755)
    (tmp_path / "script.py").write_text(f"import sys\nopen(sys.argv[1], 'w').write('{written}')")
    status, result, lines = campaign(path, "-o", tmp_path / "out", "--workers", 1)
    assert (status, result["done"], lines) == (0, 3, [])


@pytest.mark.parametrize(
    ("text", "expected_value"),
    [
        ('{"inliers": 12, "other": 1}', 12.0),
        ('{"inliers": null}', None),
        ("", None),
        ("{", "failed: metrics.json: must hold a JSON object of names and numbers"),
        ("[" * 100_000, "failed: metrics.json: must hold a JSON object of names and numbers"),
        ('{"inliers": NaN}', "failed: metrics.json: inliers = nan: must be a finite number"),
        ('{"inliers": "12"}', "failed: metrics.json: inliers = '12': must be a finite number"),
        ('{"inliers": 1e999}', "failed: metrics.json: inliers = inf: must be a finite number"),
    ],
)
def test_a_programs_own_metrics_are_read_from_its_folder(plan_file, tmp_path, text, expected_value):
    script = tmp_path / "program.py"
    script.write_text(
        "open('estimate.txt', 'w').write('1 0 0 0 0 0 0 1\\n2 1 0 0 0 0 0 1\\n')\n"
        f"if {text!r}: open('metrics.json', 'w').write({text!r})\n"
    )
    plan = load_plan(
        plan_file(
            align="none",
            metrics={"inliers": "higher"},
            require=["inliers.min >= 1"],
            estimators={"a": {"command": f"{{python}} {script}", "coverage": 0.0}},
        )
    )
    (row,) = CellRuns(plan, next(plan.cells())).rows([1], ["a"], tmp_path / "out")
    assert (row["status"] if isinstance(expected_value, str) else row["inliers"]) == expected_value


def test_the_same_algorithm_has_the_same_errors_inside_and_as_a_program(plan_file, tmp_path):
    """Aligned alike: the integrated readings, by the command that users call."""
    command = "{python} -m imu_sim_ros.commands.dead_reckon {dataset} -o {estimate} --quiet"
    plan = load_plan(
        plan_file(estimators={"inside": {}, "program": {"command": command, "dataset": "mcap"}})
    )
    assert [plan.alignment(name) for name in plan.estimators] == ["yaw", "yaw"]
    a, b = CellRuns(plan, next(plan.cells())).rows([1], plan.estimators, tmp_path / "out")
    assert a["align"] == b["align"] == "yaw"
    for name in ("ate_rmse_m", "ate_rmse_rad", "final_position_error_m"):
        assert a[name] == pytest.approx(b[name], rel=1e-6), name
    alone = load_plan(plan_file(estimators=["dead_reckon"]))
    (row,) = CellRuns(alone, next(alone.cells())).rows([1], ["dead_reckon"], tmp_path / "out")
    assert row["align"] == "none"
    assert row["ate_rmse_m"] > 1.05 * a["ate_rmse_m"]


AIDED = {"rate": 100.0, "duration": 3.0, "trajectory": "drive", "gnss": "zed_f9p"}


@pytest.mark.parametrize("dataset", ["mcap", "rosbag2", "ros1"])
def test_a_program_sees_fixes_and_odometry_in_a_bag(run_aided, dataset):
    """The wheels come from the grid, the receiver from the plan's parameters."""
    row = run_aided(
        """
import sys
from imu_sim_ros.bags.read import open_bag, read_odometry
with open_bag(sys.argv[1]) as bag:
    counts = {topic.name: topic.count for topic in bag.topics}
assert counts["/gps/fix"] == counts["/ground_truth/gps_fix"] == 30, counts
assert counts["/wheel/odom"] == counts["/joint_states"] == 150, counts
truth = read_odometry(sys.argv[1], "/ground_truth/odom")
with open(sys.argv[2], "w") as file:
    for t, p, q in zip(truth.t_ns, truth.position, truth.q_wb):
        print(f"{t * 1e-9:.9f}", *p, *q[1:], q[0], file=file)
""",
        dataset,
    )
    assert row["status"] == "done"
    assert row["ate_rmse_m"] < 1e-6


def test_a_program_sees_fixes_and_odometry_in_a_folder(run_aided):
    row = run_aided(
        HONEST
        + """
for name, count in (("gps0", 30), ("wheels0", 150)):
    lines = open(f"{dataset}/mav0/{name}/data.csv").read().splitlines()
    assert len(lines) == 1 + count, (name, len(lines))
    assert lines[0].startswith("#timestamp"), lines[0]
""",
        "euroc",
    )
    assert row["status"] == "done"


@pytest.fixture
def run_aided(tmp_path, plan_file):
    """Return a function that runs one program on a flight with a receiver and wheels."""

    def one(program, dataset):
        script = tmp_path / "aided.py"
        script.write_text(program, encoding="utf-8")
        command = f"{{python}} {script} {{dataset}} {{estimate}}"
        plan = load_plan(
            plan_file(
                parameters=AIDED,
                grid={"wheels": ["husky_a200"]},
                estimators={"aided": {"command": command, "dataset": dataset}},
            )
        )
        (row,) = CellRuns(plan, next(plan.cells())).rows([1], ["aided"], tmp_path / "out")
        return row

    return one


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"batch": 0}, "batch = 0: must be at least 1"),
        ({"worker_timeout": 0.0}, "worker_timeout = 0.0: must be above 0 s"),
        ({"metric": "ate_rms_m"}, "metric = 'ate_rms_m': did you mean ate_rmse_m?"),
        ({"report": 1}, "report = 1: must be True or False"),
        ({"dask": True, "scheduler": "tcp://a:1"}, "dask=... and scheduler=...: choose one"),
        ({"resume": True, "force": True}, "resume=... and force=...: choose one"),
        ({"non_inferiority": "5%"}, "non_inferiority = 5 %: needs baseline=..."),
    ],
)
def test_python_takes_and_checks_what_the_program_takes(plan_file, tmp_path, arguments, message):
    folder = tmp_path / "out"
    with pytest.raises(ims.ImuSimError) as caught:
        ims.campaign(plan_file(), folder, **arguments)
    assert message in str(caught.value)
    assert not folder.exists()


def test_the_problem_of_an_option_has_its_name(plan_file, tmp_path, capsys):
    folder = tmp_path / "out"
    assert main([str(plan_file()), "-o", str(folder), "--workers", "0"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "campaign: --workers 0: must be a number of processes, from 1 to 10000"
    assert not folder.exists()
