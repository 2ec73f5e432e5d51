# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Clouds of a bag on a page, against what was simulated."""

import base64
import json
import re

import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.bags.create import open_writer
from imu_sim_ros.bags.messages.encode_cameras import POINT_CLOUD2, PointCloud2Encoder
from imu_sim_ros.commands.report import main

cv2 = pytest.importorskip("cv2")

OWN = {
    "preset": "vlp16",
    "firing_period": 1e-3,
    "false_return_share": 0.05,
    "dropout_probability": 0.2,
}


@pytest.fixture(name="page", scope="module")
def make_page(tmp_path_factory):
    """Return a flight in a box of 12 by 8 by 6 m, and the items of its clouds' section."""
    folder = tmp_path_factory.mktemp("clouds")
    scene = {"type": "room", "size": [12.0, 8.0, 6.0], "center": [0.0, 0.0, 0.0], "boxes": 0}
    flight = ims.simulate(
        imu="perfect", trajectory="static", duration=2.0, rate=50, seed=3, sensors=["lidar"],
        lidar=OWN, scene=scene,
    )  # fmt: skip
    bag = flight.save(folder / "ranged.mcap")
    assert main([str(bag), "-o", str(folder / "page.html"), "--quiet"]) == 0
    text = (folder / "page.html").read_text(encoding="utf-8")
    content = json.loads(re.search('id="content">(.*?)</script>', text)[1])
    sections = {section["title"]: section["items"] for section in content["sections"]}
    assert "ranged.mcap: /ground_truth/points" not in sections
    return flight, sections["ranged.mcap: /points"]


def plots(items):
    (figures,) = (plot["items"] for plot in items if plot["kind"] == "plots")
    return {plot["title"].removeprefix("/points: "): plot for plot in figures}


def test_scans_points_and_errors_are_those_of_the_flight(page):
    flight, items = page
    scans = flight.lidar
    points = np.isfinite(scans.range)
    text = items[0]["text"]
    stamps = np.rint((scans.t_ns - flight.t0_ns) / 1e8).astype(int)
    missing = stamps[-1] - stamps[0] + 1 - len(stamps)
    assert 0 < missing < 10
    assert f"{len(scans)} scans, 10 Hz, {missing} missing between others" in text
    assert f"{points.sum(axis=1).mean():,.0f} points in a scan on average" in text
    series = plots(items)
    assert series["points in a scan"]["series"][0]["y"] == points.sum(axis=1).tolist()
    rain = series["points that are not of one surface at rest"]["series"]
    (rain,) = (line for line in rain if line["name"] == "of rain or dust")
    # The truth has scans that are lost, too: 20 of them.
    assert len(rain["y"]) == 20
    assert np.mean(rain["y"]) == pytest.approx((scans.outcome == 2).sum(axis=1).mean(), rel=0.2)
    error = series["RMS error of the ranges in each scan"]["series"][0]["y"]
    of_surface = np.where(scans.outcome == 0, scans.range_error, np.nan)
    assert np.mean(error) == pytest.approx(np.sqrt(np.nanmean(of_surface**2)), rel=0.05)


def test_the_histogram_is_that_of_all_ranges(page):
    flight, items = page
    histogram = plots(items)["ranges"]["series"][0]
    x, y = np.array(histogram["x"]), np.array(histogram["y"])
    assert (y[::2] * np.diff(x)[::2]).sum() == pytest.approx(1.0, abs=1e-4)
    ranges = flight.lidar.range[np.isfinite(flight.lidar.range)]
    edges = np.append(x[::2], x[-1])
    of_one = 1.0 / len(ranges) / np.diff(edges)
    # Ranges are multiples of 2 mm, of which some are on an edge, and a page has six digits.
    assert (np.abs(y[::2] - np.histogram(ranges, edges)[0] * of_one) < 20.5 * of_one).all()
    assert y.max() > 1000.0 * of_one.max()


def test_pictures_show_the_walls(page):
    """White marks at +-6 m and +-4 m; the width shown holds 90 % of the points."""
    _, items = page
    (strip,) = (entry for entry in items if entry["kind"] == "strip")
    assert len(strip["frames"]) == 3
    data = np.frombuffer(base64.b64decode(strip["frames"][0]["png"]), np.uint8)
    picture = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
    width = float(re.search("up, (.*) m wide", strip["title"])[1])
    rows, _ = np.nonzero(picture > 60)
    y = (0.5 - (rows + 0.5) / len(picture)) * width
    assert width > 8.0
    assert np.isclose(np.abs(y), 4.0, atol=2.5 * width / len(picture)).sum() > 50
    assert np.abs(y).max() < 4.2


def test_scans_without_a_point_and_clouds_that_are_none_are_told(tmp_path):
    with pytest.warns(UserWarning, match="has no surfaces"):
        flight = ims.simulate(
            duration=0.3, sensors=["lidar"], lidar={"firing_period": 0.01}, scene={"type": "house"}
        )
    flight.save(tmp_path / "empty.mcap")
    rows = np.zeros(3, [("x", "<f4"), ("y", "<f4"), ("power", "<f4")])
    payload = PointCloud2Encoder("radar", "cdr").encode(1, rows)
    with open_writer(tmp_path / "flat.mcap") as writer:
        writer.write(writer.add_topic("/radar", POINT_CLOUD2), np.array([1]), [payload])
    for name, says in (("empty", "3 scans, 10 Hz"), ("flat", "without x, y and z")):
        arguments = [
            str(tmp_path / f"{name}.mcap"),
            "-o",
            str(tmp_path / f"{name}.html"),
            "--quiet",
        ]
        assert main(arguments) == 0
        assert says in (tmp_path / f"{name}.html").read_text(encoding="utf-8")
