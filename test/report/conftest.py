# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A campaign and a bag to make pages of, and a real browser to look at them with."""

import shutil

import numpy as np
import pytest
import yaml

from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode import IMU, ODOMETRY, ImuEncoder, OdometryEncoder
from imu_sim_ros.campaigns import campaign
from imu_sim_ros.campaigns.engine import work
from imu_sim_ros.campaigns.plan import find_plan, load_plan
from imu_sim_ros.campaigns.results import Store

HOSTILE = '</script><script>document.title = "owned"</script><img src=x onerror=alert(1)>'
PLAN = {
    "name": HOSTILE,
    "parameters": {"rate": 50.0, "duration": 1.0},
    "grid": {
        "imu": ["mpu6000", "adis16448", "bmi088"],
        "imu.gyroscope_bias": [0.001, 0.01, 0.1],
    },
    "seeds": 6,
    "estimators": {
        "midpoint": {"type": "dead_reckon"},
        "euler": {"type": "dead_reckon", "method": "euler"},
    },
    "diverged_above": 10.0,
    "require": ["ate_rmse_m.median < 0.001 @ imu=mpu6000", "success >= 0.9"],
}


def here(plan, todo, folder):
    """Make all runs in this process: an engine."""
    for task in todo:
        yield work(plan, task, folder)


def made(folder, content):
    """Return the folder of a campaign that has been run."""
    folder.mkdir()
    path = folder / "plan.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    with Store(folder, resume=False) as store:
        campaign.run(load_plan(path), store, here)
    return folder


@pytest.fixture(scope="session")
def all_sensors(tmp_path_factory):
    """Return the folder of a short campaign of every preset on three motions: ``which_imu``."""
    plan = yaml.safe_load(find_plan("which_imu").read_text(encoding="utf-8"))
    plan |= {"parameters": {"rate": 50.0, "duration": 1.0}, "seeds": 2, "rpe": ["0.5s"]}
    return made(tmp_path_factory.mktemp("campaign") / "all_sensors", plan)


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """Return the folder of a campaign with names that are hostile to a page."""
    folder = made(tmp_path_factory.mktemp("campaign") / "results", PLAN)
    # What a program printed is part of its status.
    log = folder / "results.csv"
    rows = log.read_text(encoding="utf-8").splitlines()
    rows[1] = rows[1].replace(",done,", f',"failed: {HOSTILE.replace(chr(34), chr(34) * 2)}",')
    log.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return folder


RATE, SAMPLES, GAP_AT = 100.0, 6000, 3000
START = 1_600_000_000_000_000_000


@pytest.fixture(scope="session")
def bag(tmp_path_factory):
    """Return a minute of white noise with a gap of 1 s, a truth, and an estimate off by 0.1 m."""
    path = tmp_path_factory.mktemp("bag") / "walk.mcap"
    rng = np.random.default_rng(1)
    steps = np.full(SAMPLES, 10_000_000)
    steps[GAP_AT] = 1_000_000_000
    t_ns = START + np.cumsum(steps)
    t = (t_ns - t_ns[0]) * 1e-9
    position = np.column_stack([3 * np.cos(t / 3), 2 * np.sin(t / 3), 0.1 * t])
    q_wb = np.tile([1.0, 0.0, 0.0, 0.0], (SAMPLES, 1))
    still = np.zeros((SAMPLES, 3))
    covariance = np.diag([0.01] * 3 + [1e-4] * 3)
    with open_writer(path) as writer:
        gyro, accel = rng.normal(0.0, 0.02, (SAMPLES, 3)), rng.normal(0.0, 0.5, (SAMPLES, 3))
        imu = ImuEncoder("imu").encode(t_ns, gyro, accel)
        writer.write(writer.add_topic("/imu/data_raw", IMU), t_ns, imu)
        odometry = OdometryEncoder("world", "base_link")
        truth = odometry.encode(t_ns, position, q_wb, still, still)
        writer.write(writer.add_topic("/ground_truth/odom", ODOMETRY), t_ns, truth)
        moved = position + 0.1 * rng.standard_normal((SAMPLES, 3))
        estimate = odometry.encode(t_ns, moved, q_wb, still, still, covariance, covariance)
        writer.write(writer.add_topic("/filter/odom", ODOMETRY), t_ns, estimate)
    return path


@pytest.fixture(scope="module")
def browser():
    """Return headless Chromium, as Debian's packages chromium and chromium-driver bring it."""
    selenium = pytest.importorskip("selenium", reason="no browser: selenium is not installed")
    names = ("chromium", "chromium-browser", "google-chrome")
    programs = [next(filter(None, map(shutil.which, names)), None), shutil.which("chromedriver")]
    if None in programs:
        pytest.skip("no browser: apt install chromium chromium-driver")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    assert selenium.__version__
    options = webdriver.ChromeOptions()
    options.binary_location = programs[0]
    flags = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage")
    for flag in (*flags, "--host-resolver-rules=MAP * ~NOTFOUND"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(programs[1]))
    yield driver
    driver.quit()
