# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Receivers and wheels of a bag on a page."""

import json
import re

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.commands.report import main

DRIVE = {
    "imu": "perfect",
    "rate": 100,
    "duration": 35,
    "seed": 4,
    "trajectory": "drive",
    "sensors": ["gnss", "wheels"],
    "latitude_deg": 48.0,
    "longitude_deg": 11.0,
    "gnss": {"preset": "ublox_m8", "white_share": 1.0, "covariance_factor": 0.25},
    "wheels": {"preset": "husky_a200", "true_base": [1.07025, 0.5], "turn_slip": 0.0},
}


@pytest.fixture(name="drive", scope="module")
def make_drive(tmp_path_factory):
    """Return a flight, and its page's sections by title."""
    folder = tmp_path_factory.mktemp("aided")
    flight = ims.simulate(**DRIVE)
    bag = flight.save(folder / "drive.mcap")
    return flight, sections(bag, folder)


def sections(bag, folder, *arguments):
    assert main([str(bag), "-o", str(folder / "page.html"), "--quiet", *arguments]) == 0
    page = (folder / "page.html").read_text(encoding="utf-8")
    (text,) = re.findall(r'<script type="application/json" id="content">(.*?)</script>', page)
    return {section["title"]: section["items"] for section in json.loads(text)["sections"]}


def joined_texts(items):
    return " ".join(item["text"] for item in items if item["kind"] == "text")


def plots(items):
    inner = [plot for item in items if item["kind"] == "plots" for plot in item["items"]]
    return {plot["title"]: plot for plot in inner}


def test_errors_of_fixes_are_those_of_the_simulation_and_so_are_shares(drive):
    """A stated covariance of a quarter: 38.3 % within one stated deviation, a half of the true."""
    flight, page_sections = drive
    items = page_sections["drive.mcap: /gps/fix"]
    text = joined_texts(items)
    sizes = np.sqrt(np.mean(flight.gnss.error**2, axis=0))
    for size, axis in zip(sizes, ("east", "north", "up"), strict=True):
        # Three digits are printed; east and north of the antenna turn by 1e-5 rad in 60 m.
        (printed,) = re.findall(rf"([0-9.e+-]+) {axis}", text.partition("/gps/velocity")[0])[-1:]
        assert float(printed) == pytest.approx(size, rel=6e-3)
    ratio = np.abs(flight.gnss.error) / np.sqrt(flight.gnss.variance)
    assert f"{np.mean(ratio <= 1.0):.1%} within 1 sigma (68.3%)" in text
    # 350 fixes, three axes: 0.383 +- 0.015; five of these.
    assert np.mean(ratio <= 1.0) == pytest.approx(0.383, abs=0.075)
    assert [
        line["name"] for item in items if item["kind"] == "path" for line in item["series"]
    ] == [
        *("/ground_truth/gps_fix", "/gps/fix"),
    ]
    drawn = plots(items)
    assert {f"/gps/{k}: error {axis}" for k in ("fix", "velocity") for axis in ("east", "up")} < {
        *drawn
    }
    assert [line["name"] for line in drawn["/gps/fix: error up"]["series"]] == [
        *("3 sigma, as stated", "error"),
    ]


def test_wheels_are_compared_in_their_own_frame(drive):
    flight, page_sections = drive
    items = page_sections["drive.mcap: errors of /wheel/odom"]
    wheels = flight.wheels
    error = np.linalg.norm(wheels.true_pose[:, :2] - wheels.pose[:, :2], axis=1)
    assert f"{np.sqrt(np.mean(error**2)):.4g} m root mean square" in joined_texts(items)
    assert "NEES of the position" in joined_texts(items)
    assert "(2 expected)" in joined_texts(items)
    assert "(1 expected)" in joined_texts(items)
    # What wheels do not measure has no plot; and in the world's frame they are no estimate.
    assert "/wheel/odom: position error x" in plots(items)
    assert "/wheel/odom: position error z" not in plots(items)
    assert not any("wheel" in title for title in plots(page_sections["drive.mcap: motion"]))


def test_every_sensor_with_a_truth_is_drawn_with_it(drive):
    """Speeds of the wheels and angles of the joints, whose message only rosbags knows."""
    flight, page_sections = drive
    wheels = flight.wheels
    items = page_sections["drive.mcap: /wheel/odom (twist)"]
    error = wheels.twist[:, 0] - wheels.true_twist[:, 0]
    (printed,) = re.findall(
        r"linear: RMS error \(measured - true\).*?: ([0-9.e+-]+) x", joined_texts(items)
    )
    assert float(printed) == pytest.approx(np.sqrt(np.mean(error**2)), rel=6e-3)
    drawn = plots(items)["/wheel/odom: linear: readings and truth"]["series"]
    assert [line["name"] for line in drawn] == ["x", "y", "truth", "truth"]
    assert [line["colour"] for line in drawn] == ["x", "y", None, None]
    # Forward alone: up, and what is not measured, have no plot.
    assert "/wheel/odom: angular: error x" not in plots(items)
    joints = page_sections["drive.mcap: /joint_states"]
    error = wheels.angle - wheels.ideal_angle
    (printed,) = re.findall(
        r"position: RMS error \(measured - true\).*?: ([0-9.e+-]+) \w+left\w*", joined_texts(joints)
    )
    assert float(printed) == pytest.approx(np.sqrt(np.mean(error[:, 0] ** 2)), rel=6e-3)


def test_without_a_truth_the_stated_deviation_is_drawn(tmp_path):
    flight = ims.simulate(**{**DRIVE, "duration": 5})
    bag = flight.save(tmp_path / "drive.mcap", topics=["imu/data_raw", "gps/fix"])
    items = sections(bag, tmp_path)["drive.mcap: /gps/fix"]
    assert list(plots(items)) == ["/gps/fix: stated deviation"]


def test_odometry_without_a_truth_of_its_own_begins_at_the_body(tmp_path):
    """The drive begins away from the world's origin, heading north."""
    route = {"type": "drive", "positions": [30.0, -20.0, 30.0, 40.0, -10.0, 40.0]}
    settings = {**DRIVE, "sensors": ["wheels"], "trajectory": route, "duration": 20}
    flight = ims.simulate(**{key: value for key, value in settings.items() if key != "gnss"})
    bag = flight.save(tmp_path / "drive.mcap", topics=["ground_truth/odom", "wheel/odom"])
    page_sections = sections(bag, tmp_path)
    items, detail = (
        page_sections[f"drive.mcap: {k}"] for k in ("estimates", "errors of /wheel/odom")
    )
    assert "/wheel/odom: in a frame of its own" in joined_texts(items)
    wheels = flight.wheels
    error = np.linalg.norm(wheels.true_pose[:, :2] - wheels.pose[:, :2], axis=1)
    assert error.max() > 0.1
    assert f"{np.sqrt(np.mean(error**2)):.3g}" in joined_texts(detail)
    (lines,) = [item["series"] for item in items if item["kind"] == "path"]
    assert [(line["x"][0], line["y"][0]) for line in lines] == [(30.0, -20.0)] * 2
    # The axes of the stated errors turn with it: going north, x is across the way.
    band = plots(detail)["/wheel/odom: position error x"]["series"][0]
    assert band["name"] == "3 sigma, as stated"
