# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A LiDAR against closed forms: points on surfaces, distortion, each error, layouts, bad input."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import imu_sim_ros as ims
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.campaigns.plan import load_plan
from imu_sim_ros.campaigns.run_files import write_dataset
from imu_sim_ros.campaigns.simulated import SimulatedCell
from imu_sim_ros.commands import generate
from imu_sim_ros.core import rotation
from imu_sim_ros.jobs.flight import Flight
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors.lidar.layouts import LAYOUTS, custom_points
from imu_sim_ros.sensors.lidar.model import (
    FALSE,
    GLASS,
    LOST,
    MIXED,
    NOTHING,
    OUT_OF_RANGE,
    SURFACE,
)
from imu_sim_ros.sensors.lidar.parameters import LidarParameters
from imu_sim_ros.sensors.lidar.pattern import build_pattern
from imu_sim_ros.simulation.engine import Body
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.trajectory.parameters import TourParameters
from imu_sim_ros.trajectory.tour import tour

TENTH_OF_A_MM = 1e-4
MOUNT = {"lever_arm": [0.1, -0.2, 0.3], "mounting": [0.0, -1, 0, 1, 0, 0, 0, 0, 1]}


def flown(scene, duration=0.5, trajectory="figure_eight", **lidar):
    return ims.simulate(
        imu="perfect",
        trajectory=trajectory,
        duration=duration,
        seed=5,
        sensors=["lidar"],
        lidar={"preset": "perfect", **lidar},
        scene=scene if isinstance(scene, dict) else {"type": scene},
    )


def poses(flight, lidar):
    """Return times, positions and attitudes at each ray's time, from the trajectory itself."""
    scans = flight.lidar
    t = (scans.true_t_ns - flight.t0_ns)[:, None] * 1e-9 + scans.time
    motion = flight.trajectory.sample(t.reshape(-1))
    place = motion.position + rotation.rotate(motion.q_wb, np.array(lidar.lever_arm)[None])
    q_bs = rotation.from_matrix(np.reshape(lidar.mounting, (3, 3)))
    return t, place, rotation.multiply(motion.q_wb, q_bs[None])


def in_world(flight):
    """Return the points (k, 3) of a flight in the world, each with the pose of its own time."""
    _, place, q_ws = poses(flight, flight.parameters.lidar)
    points = place + rotation.rotate(q_ws, flight.lidar.points.reshape(-1, 3))
    return points[np.isfinite(points).all(axis=1)]


def test_points_are_on_the_ground():
    """The ground is z = -1.5; in single precision a point 150 m away has steps of 0.015 mm."""
    flight = flown("ground", maximum_range=150.0, **MOUNT)
    points = in_world(flight)
    assert len(points) > 30_000
    assert np.abs(points[:, 2] + 1.5).max() < TENTH_OF_A_MM


def test_points_are_on_the_walls_of_a_box():
    room = {"type": "room", "size": [12.0, 9.0, 6.0], "boxes": 0}
    flight = flown(room, trajectory="tumble", duration=1, **MOUNT)
    points = in_world(flight)
    assert len(points) == flight.lidar.range.size
    away = np.abs(np.abs(points) - np.array([6.0, 4.5, 3.0]))
    assert away.min(axis=1).max() < TENTH_OF_A_MM
    assert (np.abs(points) < np.array([6.0, 4.5, 3.0]) + TENTH_OF_A_MM).all()
    # With one pose for a scan they are not: that is the distortion.
    scans = flight.lidar
    start_poses = flight.trajectory.sample((scans.true_t_ns - flight.t0_ns) * 1e-9)
    rigid = start_poses.position[:, None] + rotation.rotate(start_poses.q_wb[:, None], scans.points)
    assert np.abs(np.abs(rigid) - np.array([6.0, 4.5, 3.0])).min(axis=2).max() > 0.1


def test_the_truth_is_without_distortion():
    """The truth of a ray is its hit point from the sensor's pose at the start of the scan."""
    flight = flown("office", **MOUNT)
    scans, lidar = flight.lidar, flight.parameters.lidar
    _, place, q_ws = poses(flight, lidar)
    shape = scans.true_point.shape
    hit_points = place + rotation.rotate(q_ws, scans.points.reshape(-1, 3))
    starts = (a.reshape(*shape[:2], -1)[:, :1] for a in (place, q_ws))
    start_position, q_first = starts
    expected = rotation.rotate_inverse(q_first, hit_points.reshape(shape) - start_position)
    assert np.nanmax(np.abs(expected - scans.true_point)) < TENTH_OF_A_MM
    assert np.abs(scans.range_error).max() == 0.0


def test_points_of_people_are_on_them_at_their_own_times():
    scene = {"type": "office", "bodies.people": 2, "bodies.carts": 1, "seed": 3}
    values = {
        "imu.preset": "perfect",
        "trajectory.type": "static",
        "duration": 1.0,
        "sensors": ["lidar"],
        "lidar.preset": "perfect",
        **{f"scene.{name}": value for name, value in scene.items()},
    }
    body = Body(load_simulation(values), sensors={"imu", "lidar", "pose"})
    flight = Flight(body, list(body.windows()), "")
    scans, crowd = flight.lidar, body.world.scene.crowd
    t, place, q_ws = poses(flight, flight.parameters.lidar)
    points = place + rotation.rotate(q_ws, scans.points.reshape(-1, 3))
    bodies_hit = np.unique(scans.body[scans.body > 0])
    assert len(bodies_hit) >= 2
    for number in bodies_hit:
        mine = np.flatnonzero(scans.body.reshape(-1) == number)
        moving_body = crowd.bodies[number - 1]
        within_body = moving_body.to_body(t.reshape(-1)[mine], points[mine])
        where = crowd.surfaces[number - 1]
        face = scans.surface.reshape(-1)[mine]
        offset = ((within_body - where.origin[face]) * where.normal[face]).sum(axis=1)
        assert np.abs(offset).max() < TENTH_OF_A_MM


def static(scene, duration=1, **lidar):
    settings = {"range_noise": 0.0, **lidar}
    return flown(scene, duration, {"type": "static"}, **settings).lidar


BOX = {"type": "room", "size": [20.0, 20.0, 6.0], "boxes": 0}


def test_noise_of_ranges_and_steps():
    """Standard deviations of N normals: within 5 / sqrt(2 N); a step adds q^2 / 12."""
    scans = static(BOX, range_noise=0.02, range_resolution=0.012, range_bias=0.3)
    error, count = scans.range_error, scans.range_error.size
    sigma = np.sqrt(0.02**2 + 0.012**2 / 12.0)
    assert abs(error.std() / sigma - 1.0) < 5.0 / np.sqrt(2.0 * count)
    assert abs(error.mean() - 0.3) < 5.0 * sigma / np.sqrt(count)
    steps = scans.range.astype(float) / 0.012
    assert np.abs(steps - np.rint(steps)).max() < 1e-3


def test_noise_grows_towards_the_limit_of_detection():
    """s^2 + (s_limit (d / R)^2)^2 with R of each surface, normalised: a standard normal."""
    settings = {"range_noise": 0.01, "range_noise_at_limit": 0.1, "detection_range": 30.0}
    scans = static(BOX, reflectivity=0.4, detection_reflectivity=0.2, **settings)
    returned = np.isfinite(scans.range)
    limit = 30.0 * np.sqrt(0.4 * np.cos(scans.incidence[returned].astype(float)) / 0.2)
    sigma = np.hypot(0.01, 0.1 * (scans.true_range[returned] / limit) ** 2)
    normal = scans.range_error[returned] / sigma
    # Rays near the limit are kept if their noise is negative: they are left out.
    inner = scans.true_range[returned] < 0.7 * limit
    count = int(inner.sum())
    assert count > 100_000
    assert abs(normal[inner].std() - 1.0) < 5.0 / np.sqrt(2.0 * count)
    assert sigma[inner].max() > 2.0 * sigma[inner].min()


def test_dark_and_grazing_surfaces_are_lost():
    """Up to R = R_0 sqrt(reflectivity cos / reflectivity_0), and no farther."""
    scans = static(
        "ground", 0.2, reflectivity=0.3, detection_range=15.0, detection_reflectivity=0.1
    )
    hit = np.isfinite(scans.true_range)
    limit = 15.0 * np.sqrt(np.maximum(0.3 * np.cos(scans.incidence.astype(float)) / 0.1, 0.0))
    expected = hit & (scans.true_range < limit)
    assert np.array_equal(np.isfinite(scans.range), expected)
    assert 0.05 < expected.mean() < 0.5
    assert (scans.outcome[hit & ~expected] == OUT_OF_RANGE).all()
    assert (scans.outcome[~hit] == NOTHING).all()
    # On level ground cos = h / d, so that d = (R_0^2 rho h / rho_0)^(1/3).
    farthest = (15.0**2 * 0.3 * 1.5 / 0.1) ** (1.0 / 3.0)
    assert scans.true_range[expected].max() <= farthest
    assert scans.true_range[hit & ~expected].min() >= farthest - 1e-4


def test_directions_differ_by_jitter_and_by_ring():
    """The true directions at rest, as components upwards and sideways of the nominal ones."""
    errors = np.linspace(-0.4, 0.4, 32).tolist()
    settings = {"angular_noise_deg": 0.2, "ring_elevation_error_deg": errors}
    scans = static(BOX, **settings)
    true = scans.true_point / scans.true_range[..., None]
    x, y, z = np.moveaxis(scans.direction.astype(float), -1, 0)
    flat = np.hypot(x, y)
    up = (true * np.stack([-x * z / flat, -y * z / flat, flat], axis=-1)).sum(axis=-1)
    side = (true * np.stack([-y / flat, x / flat, 0.0 * x], axis=-1)).sum(axis=-1)
    sigma, count = np.radians(0.2), x.size
    assert abs(side.std() / sigma - 1.0) < 5.0 / np.sqrt(2.0 * count)
    assert abs(side.mean()) < 5.0 * sigma / np.sqrt(count)
    for ring, error in enumerate(errors):
        mine = up[scans.ring == ring]
        assert abs(mine.mean() - np.radians(error)) < 5.0 * sigma / np.sqrt(mine.size)


def test_constant_errors_are_drawn_for_each_ring_and_kept_in_the_truth():
    flight = flown(BOX, 1, {"type": "static"}, ring_bias_sigma=0.05)
    scans = flight.lidar
    drawn = [scans.range_error[scans.ring == ring].astype(float) for ring in range(32)]
    assert max(np.ptp(errors) for errors in drawn) < 2e-6  # single precision of 10 m
    means = np.array([errors.mean() for errors in drawn])
    # 32 normals: the standard deviation is within a factor of 1.6 with 99.9 %.
    assert 0.05 / 1.6 < means.std() < 0.05 * 1.6
    again = flown(BOX, 1, {"type": "static"}, ring_bias=means.tolist())
    assert np.abs(again.lidar.range - scans.range).max() < 4e-6


EDGE = [2.9, -4, 0, 2.9, 0, 0, 2.9, -4, 4], [3.2, -9, -9, 3.2, 9, -9, 3.2, -9, 9]
"""A plate with an edge at y = 0, 0.3 m before a wall."""


@pytest.mark.parametrize("pulse", [0.5, 0.1])
def test_beams_on_an_edge(pulse):
    """Between both surfaces within a pulse's length; else on one of them."""
    scene = {"type": "planes", "corners": [float(x) for plane in EDGE for x in plane]}
    scans = static(scene, 1, beam_divergence_deg=1.0, pulse_length=pulse)
    ahead, side, up = np.moveaxis(scans.direction, -1, 0)
    mixed = (scans.outcome == MIXED) & (ahead > 0.9) & (np.abs(side) < 0.05) & (up > 0.05)
    far_distance, near_distance = 3.2 / ahead, 2.9 / ahead
    # A beam of 1 deg is 5 cm wide there, and its footprint on one plane is less than 3 cm deep.
    between = mixed & (scans.range > near_distance + 0.03) & (scans.range < far_distance - 0.03)
    assert mixed.sum() > 20
    assert (between.sum() > 20) == (pulse == 0.5)
    assert not between.any() or pulse == 0.5
    assert np.nanmax(scans.range[mixed] - far_distance[mixed]) < 0.03
    assert np.nanmin(scans.range[mixed] - near_distance[mixed]) > -0.03


def share(rows):
    return rows.mean(), 5.0 * np.sqrt(rows.mean() / rows.size)


def test_shares_of_lost_and_false_returns():
    """Binomial: within five standard deviations; drops are exponential, cut at the surface."""
    settings = {"dropout_share": 0.1, "false_return_share": 0.2, "false_return_range": 2.0}
    scans = static(BOX, **settings)
    lost, spread = share(scans.outcome == LOST)
    assert abs(lost - 0.1) < spread
    false, spread = share(scans.outcome == FALSE)
    nearer = 1.0 - np.exp(-scans.true_range.astype(float) / 2.0)
    assert abs(false - 0.9 * 0.2 * nearer.mean()) < spread
    assert (scans.range[scans.outcome == FALSE] < scans.true_range[scans.outcome == FALSE]).all()


def test_glass_of_a_place_lets_rays_through():
    """An office by day: all rays on its windows are gone, and none elsewhere."""
    plain = flown("office", 0.2, {"type": "static"}).lidar
    glass = flown("office", 0.2, {"type": "static"}, glass_transmission=1.0).lidar
    gone = glass.outcome == GLASS
    assert 0.002 < gone.mean() < 0.3
    assert np.array_equal(np.isfinite(plain.range) & ~gone, np.isfinite(glass.range))
    half = flown("office", 0.2, {"type": "static"}, glass_transmission=0.5).lidar
    through = (half.outcome == GLASS)[gone]
    assert abs(through.mean() - 0.5) < 5.0 * 0.5 / np.sqrt(through.size)


def test_intensity_is_that_of_material_angle_and_range():
    scans = static("ground", 0.2, reflectivity=0.6, intensity_range=4.0)
    hit = np.isfinite(scans.range)
    away = scans.true_range[hit].astype(float)
    expected = 100.0 * 0.6 * 1.5 / away * np.minimum(1.0, 4.0 / away) ** 2
    assert np.abs(scans.intensity[hit] / expected - 1.0).max() < 1e-4
    office = flown("office", 0.2, {"type": "static"}).lidar
    assert len(np.unique(office.reflectivity)) > 5


def test_deskewing_with_its_times_leaves_the_noise():
    """Planes fitted to walls: from centimetres to the noise of ranges."""
    room = {"type": "room", "size": [12.0, 9.0, 6.0], "boxes": 0}
    sigma = 0.01
    flight = flown(room, 1, "tumble", range_noise=sigma)
    scans, lidar = flight.lidar, flight.parameters.lidar
    _, place, q_ws = poses(flight, lidar)
    deskewed = (place + rotation.rotate(q_ws, scans.points.reshape(-1, 3))).reshape(
        scans.points.shape
    )
    residuals = {"raw": [], "deskewed": []}
    for k in range(len(scans)):
        for wall in range(6):
            mine = scans.surface[k] == wall
            if mine.sum() < 500:
                continue
            for name, points in (("raw", scans.points[k]), ("deskewed", deskewed[k])):
                centered = points[mine] - points[mine].mean(axis=0)
                normal = np.linalg.svd(centered.astype(float), full_matrices=False)[2][2]
                residuals[name].append((centered @ normal).std())
    # The noise is along the rays, which meet walls at up to 80 deg: its part across is below it.
    assert max(residuals["raw"]) > 4.0 * sigma
    assert max(residuals["deskewed"]) < sigma
    assert np.median(residuals["deskewed"]) > 0.3 * sigma


def test_a_fault_moves_all_ranges():
    values = {"sensors": ["lidar"], "lidar.preset": "perfect", "scene.type": "ground"}
    run = Body(load_simulation({**values, "duration": 1.0}), sensors={"lidar"})
    run.inject(ims_fault("bias_jump", 0.5))
    moved = np.concatenate([samples["lidar"].range_error for samples in run.windows()])
    assert np.nanmax(np.abs(moved[:4] - 0.5)) < 1e-4
    assert np.nanmax(np.abs(moved[-3:])) == 0.0


def ims_fault(kind, size):
    from imu_sim_ros.sensors.faults import Fault

    return Fault(kind, 0.5, size, "lidar")


@pytest.mark.parametrize("preset", sorted(files.names("lidar")))
def test_presets_make_the_rays_that_their_sheets_state(preset):
    stated = {"vlp16": 3e5, "hdl32e": 6.95e5, "os1_64": 655_360, "os0_128": 1_310_720}
    stated |= {"xt32": 6.4e5, "mid360": 2e5, "avia": 2.4e5, "perfect": 327_680}
    values = load_simulation({"sensors": ["lidar"], "lidar.preset": preset}).lidar
    pattern = build_pattern(values)
    # VLP-16: "approximately 300,000"; 16 channels each 55.296 us are 289,352.
    assert len(pattern.time) * values.rate == pytest.approx(stated[preset], rel=0.04)
    assert (np.diff(pattern.time) >= 0.0).all()
    assert pattern.time[-1] < values.span
    for start in (0.0, 7.3):
        norms = np.linalg.norm(pattern.directions(start), axis=1)
        assert np.abs(norms - 1.0).max() < 1e-12
    assert (pattern.ring.max() + 1) == values.rings


def test_a_rosette_does_not_repeat_and_stays_in_its_field():
    values = load_simulation({"sensors": ["lidar"], "lidar.preset": "avia"}).lidar
    pattern = build_pattern(values)
    directions = np.concatenate([pattern.directions(0.1 * k) for k in range(10)])
    azimuth = np.degrees(np.arctan2(directions[:, 1], directions[:, 0]))
    elevation = np.degrees(np.arcsin(directions[:, 2]))
    assert 34.5 < azimuth.max() <= 35.21  # 70.4 deg
    assert 38.0 < elevation.max() <= 38.61  # 77.2 deg
    cells = [
        len(np.unique(np.floor(np.stack([azimuth, elevation])[:, : 24_000 * n]), axis=1).T)
        for n in (1, 2, 10)
    ]
    assert cells[0] < cells[1] < cells[2]


def test_a_table_of_ones_own(tmp_path):
    table = tmp_path / "rays.csv"
    table.write_text("time,azimuth,elevation,ring\n0,0,0,3\n0.05,90,0,1\n0.05,0,-45,0\n")
    scans = static(BOX, 0.3, pattern="table", table=str(table))
    assert np.allclose(scans.range, [10.0, 10.0, 3.0 * np.sqrt(2.0)], atol=1e-5)
    assert np.array_equal(scans.ring[0], [3, 1, 0])
    assert np.array_equal(scans.time[0], [0.0, 0.05, 0.05])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "contains no rays"),
        ("0,1\n", "line 1: 2 columns"),
        ("0,1,2\n0,1\n", "line 2: 2 columns"),
        ("0,1,2\n0,x,2\n", "line 2: '0,x,2' is not numeric"),
        ("0,nan,2\n", "line 1: a value that is not finite"),
        ("0.2,1,2\n", "line 1: time 0.2 s: must not decrease"),
        ("0.05,1,2\n0.01,1,2\n", "line 2: time 0.01 s: must not decrease"),
        ("0,1,91\n", "line 1: elevation 91 deg"),
        ("0,1,2,1.5\n", "line 1: ring 1.5: must be an integer from 0 to 65535"),
        ("0,1,2,nan\n", "line 1: a value that is not finite"),
        ("-0.01,1,2\n", "line 1: time -0.01 s: must not decrease, from 0"),
    ],
)
def test_bad_tables_get_a_line(tmp_path, capsys, text, says):
    table = tmp_path / "rays.csv"
    table.write_text(text)
    argv = ["--set", "lidar.pattern=table", "--set", f"lidar.table={table}", "--lidar", "perfect"]
    status = generate.main(["-o", str(tmp_path / "a.mcap"), "--duration", "1s", *argv])
    assert status == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert says in line
    assert not (tmp_path / "a.mcap").exists()


def test_huge_tables_are_refused_at_once(tmp_path):
    table = tmp_path / "rays.csv"
    lidar = LidarParameters(pattern="table", table=str(table))
    table.write_text("# rays\n" + "0,1,2\n" * 2_000_002)
    with pytest.raises(ims.InputError, match="2,000,002 lines of rays; at most 2,000,000"):
        build_pattern(lidar)
    os.truncate(table, (200 << 20) + 1)
    with pytest.raises(ims.InputError, match="larger than 200 MiB"):
        build_pattern(lidar)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"preset": "vlp17"}, "unknown lidar 'vlp17'; did you mean vlp16"),
        ({"layout": "velodine"}, "lidar.layout = 'velodine': must be one of velodyne"),
        ({"elevations_deg": []}, "must hold the elevation of one channel at least"),
        ({"elevations_deg": [91.0]}, "lidar.elevations_deg"),
        ({"azimuth_offsets_deg": [1.0]}, "azimuth_offsets_deg: has 1 numbers; must be empty or"),
        ({"channel_interval": 0.01}, "do not fit into lidar.firing_period"),
        ({"firing_period": 0.2}, "lidar.firing_period = 0.2: must be at most 0.1 s"),
        ({"firing_period": 1e-7}, "a scan has"),
        ({"minimum_range": 300.0}, "must be below lidar.maximum_range"),
        ({"ring_bias": [0.1]}, "lidar.ring_bias: has 1 numbers; must be empty or have 32"),
        ({"range_noise": -1.0}, "lidar.range_noise = -1"),
        ({"range_noise": float("nan")}, "lidar.range_noise = nan"),
        ({"pattern": "rosette", "prism_rates": [1.0]}, "lidar.prism_rates: has 1 numbers"),
        ({"pattern": "nodding", "elevation_limits_deg": [5.0, -5.0]}, "two numbers in order"),
        ({"pattern": "table"}, "lidar.table = '': must name a file"),
        ({"pattern": "table", "table": "no.csv"}, "no.csv"),
        ({"range_nose": 1.0}, "did you mean lidar.range_noise"),
        (
            {"layout": "ouster", "elevations_deg": [0.1] * 257},
            "lidar.layout = 'ouster': has at most 256 rings, of 257",
        ),
        (
            {"pattern": "rosette", "point_rate": 1e9},
            "lidar.point_rate = 1000000000.0: must be a finite number at least 1 and at most",
        ),
    ],
)
def test_bad_parameters_get_a_line(settings, says):
    with pytest.raises((ims.ConfigurationError, ims.InputError), match=re.escape(says)) as refused:
        flown("ground", 0.2, **settings)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "layout"),
    [*(("a.mcap", layout) for layout in sorted(LAYOUTS)), ("a.bag", "hesai"), ("folder", "ouster")],
)
def test_bags_have_the_fields_of_drivers(tmp_path, layout, name):
    """Read by rosbags: fields at their offsets, dense, times from 0 to below the scan's length."""
    flight = flown("office", 0.3, layout=layout, range_noise=0.01)
    path = flight.save(tmp_path / name, topics=["points", "livox/lidar", "ground_truth/points"])
    scans = flight.lidar
    store = get_typestore(Stores.ROS1_NOETIC if name == "a.bag" else Stores.ROS2_JAZZY)
    fields = []
    with AnyReader([path], default_typestore=store) as reader:
        chosen = [c for c in reader.connections if c.topic == "/points"]
        for connection, _, content in reader.messages(chosen):
            fields.append(reader.deserialize(content, connection.msgtype))
    assert len(fields) == len(scans) == 3
    kinds = {"u1": 2, "u2": 4, "u4": 6, "f4": 7, "f8": 8}
    for k, message in enumerate(fields):
        expected = [(n, offset, kinds[kind[1:]]) for n, kind, offset in LAYOUTS[layout].fields]
        assert [(f.name, f.offset, f.datatype) for f in message.fields] == expected
        assert message.is_dense
        assert message.header.frame_id == "lidar"
        rows = message.data.view(LAYOUTS[layout].dtype)
        cloud = scans.cloud(k)
        assert np.array_equal(rows["x"], cloud.xyz[:, 0])
        t_ns = int(scans.t_ns[k])
        times = {
            "velodyne": lambda r: r["time"].astype(float),
            "ouster": lambda r: r["t"] * 1e-9,
            "hesai": lambda r, t=t_ns: r["timestamp"] - t * 1e-9,
            "livox": lambda r, t=t_ns: (r["timestamp"] - t) * 1e-9,
        }[layout](rows)
        # A float32 of 0.1 s has steps of 7 ns, a double of 1e9 s 120 ns.
        assert np.abs(times - cloud.time).max() < 5e-7
        assert 0.0 <= times[0] < times[-1] < 0.1


def test_read_points_returns_what_was_simulated(tmp_path):
    flight = flown("office", 0.3, range_noise=0.01)
    path = flight.save(tmp_path / "a.mcap")
    scans = flight.lidar
    clouds = list(ims.read_points(path))
    truth = list(ims.read_points(path, "ground_truth/points"))
    assert [t_ns for t_ns, _ in clouds] == scans.t_ns.tolist()
    for k, ((_, points), (_, true)) in enumerate(zip(clouds, truth, strict=True)):
        assert np.array_equal(points["time"], scans.cloud(k).time.astype(np.float32))
        returned = np.isfinite(scans.range[k])
        assert np.array_equal(true["range"], scans.true_range[k][returned])
        assert np.array_equal(true["outcome"], np.full(returned.sum(), SURFACE))
        assert np.array_equal(true["z"], scans.true_point[k][returned][:, 2])
    with pytest.raises(ims.InputError, match="no clouds on nothing; has /points"):
        ims.read_points(path, "nothing")


def test_two_lidars_have_their_own_names_mounts_and_noise(tmp_path):
    argv = ["--lidar", "vlp16", "--lidar", "mid360", "--set", "lidar1.lever_arm=[0,0,1]"]
    path = tmp_path / "two.mcap"
    status = generate.main(["-o", str(path), "--duration", "0.3s", "--quiet", *argv])
    assert status == 0
    counts = {
        topic: sum(1 for _ in ims.read_points(path, topic))
        for topic in ("points", "lidar1/points", "lidar1/ground_truth/points")
    }
    assert set(counts.values()) == {3}
    with pytest.raises(ims.InputError, match=r"topic= names one"):
        ims.read_points(path)
    assert (tmp_path / "two_truth_lidar1.yaml").exists()


def test_frames_of_several_lidars_agree(tmp_path):
    """Clouds, /tf_static, truth and configurations had lidar, lidar1_link and lidar again."""
    argv = ["--lidar", "vlp16", "--lidar", "vlp16", "--set", "lidar1.lever_arm=[0,0,1]"]
    argv += ["--scene", "ground", "--duration", "0.2s", "--quiet", "--with-configs"]
    argv += ["--set", "lidar.firing_period=0.01", "--set", "lidar1.firing_period=0.01"]
    path = tmp_path / "two.mcap"
    assert generate.main(["-o", str(path), *argv]) == 0
    frames: dict[str, set[str]] = {}
    with AnyReader([path]) as reader:
        for connection, _, payload in reader.messages():
            message = reader.deserialize(payload, connection.msgtype)
            if connection.topic == "/tf_static":
                mounts = {transform.child_frame_id for transform in message.transforms}
            else:
                frames.setdefault(connection.topic, set()).add(message.header.frame_id)
    assert {"lidar", "lidar1"} <= mounts
    configs = tmp_path / "two.mcap_configs"
    for name, space, end in (("lidar", "", ""), ("lidar1", "lidar1/", "_lidar1")):
        assert frames[f"/{space}points"] == frames[f"/{space}ground_truth/points"] == {name}
        assert files.load(tmp_path / f"two_truth_{name}.yaml")[f"{name}.frame"] == name
        assert f'lidarFrame: "{name}"' in (configs / f"lio_sam{end}.yaml").read_text()


@pytest.mark.parametrize("name", ["a.mcap", "a.bag", "a"])
def test_the_record_time_of_a_cloud_is_its_end(tmp_path, name):
    """A player must not send a cloud before its last point was measured."""
    argv = ["--lidar", "vlp16", "--scene", "ground", "--duration", "0.3s", "--quiet"]
    argv += ["--set", "lidar.firing_period=0.01", "--set", "lidar.stamp_offset=0.02"]
    assert generate.main(["-o", str(tmp_path / name), *argv]) == 0
    recorded: dict[str, list[int]] = {}
    with AnyReader([tmp_path / name]) as reader:
        for connection, t_ns, payload in reader.messages():
            if connection.topic == "/tf_static":
                continue
            stamp = reader.deserialize(payload, connection.msgtype).header.stamp
            after_ns = t_ns - stamp.sec * 10**9 - stamp.nanosec
            recorded.setdefault(connection.topic, []).append(after_ns)
    assert recorded["/points"] == recorded["/ground_truth/points"] == [10**8] * 3
    assert set(recorded["/imu/data_raw"]) == {0}


def test_a_folder_with_a_file_for_each_scan(tmp_path):
    """KITTI's floats, PLY as trimesh reads it, PCD by its header; stamps, and --force."""
    trimesh = pytest.importorskip("trimesh")
    settings = {"range_noise": 0.02, "preset": "vlp16"}
    scans = ims.simulate(
        duration=0.3, seed=2, sensors=["lidar"], lidar=settings, scene={"type": "ground"}
    ).lidar
    argv = [
        "--duration",
        "0.3s",
        "--seed",
        "2",
        "--quiet",
        "--lidar",
        "vlp16",
        "--scene",
        "ground",
    ]
    argv += ["--set", "lidar.range_noise=0.02", "-o", str(tmp_path / "a.mcap"), "--force"]
    folder = tmp_path / "a_scans"
    clouds = [scans.cloud(k) for k in range(3)]
    for form, suffix in (("kitti", "bin"), ("ply", "ply"), ("pcd", "pcd")):
        assert generate.main([*argv, "--set", f"lidar.files={form}"]) == 0
        names = sorted(path.name for path in folder.iterdir())
        assert names == [*(f"{k:06d}.{suffix}" for k in range(3)), "times.txt"]
        stamps = (folder / "times.txt").read_text().split()
        assert stamps == [f"{t_ns / 1e9:.9f}" for t_ns in scans.t_ns]
        for k, cloud in enumerate(clouds):
            path = folder / f"{k:06d}.{suffix}"
            if form == "kitti":
                rows = np.fromfile(path, "<f4").reshape(-1, 4)
                assert np.array_equal(rows[:, :3], cloud.xyz)
                assert np.allclose(rows[:, 3], 0.01 * cloud.intensity)
            elif form == "ply":
                assert np.array_equal(trimesh.load(path).vertices, cloud.xyz)
            else:
                head, _, body = path.read_bytes().partition(b"DATA binary\n")
                fields = dict(line.split(maxsplit=1) for line in head.decode().splitlines())
                kinds = {"F4": "<f4", "U2": "<u2"}
                names, types, sizes = (fields[key].split() for key in ("FIELDS", "TYPE", "SIZE"))
                row = [(n, kinds[t + s]) for n, t, s in zip(names, types, sizes, strict=True)]
                rows = np.frombuffer(body, row)
                assert len(rows) == int(fields["POINTS"]) == len(cloud.xyz)
                assert np.array_equal(rows["z"], cloud.xyz[:, 2])
                assert np.array_equal(rows["time"], cloud.time.astype("f4"))


def test_a_text_dataset_has_scans_as_files_alone(tmp_path, capsys):
    argv = ["--duration", "0.2s", "--quiet", "--lidar", "vlp16", "--scene", "ground"]
    argv += ["--format", "euroc", "-o", str(tmp_path / "a")]
    assert generate.main(argv) == 2
    assert "topic points: does not exist in euroc" in capsys.readouterr().err
    assert generate.main([*argv, "--set", "lidar.files=ply"]) == 0
    assert len(list((tmp_path / "a_scans").glob("*.ply"))) == 2


@pytest.mark.parametrize("layout", ["ouster", "livox"])
def test_rings_beyond_a_byte_are_refused_where_they_would_wrap(tmp_path, layout):
    """A number of 256 would be written as 0."""
    table = tmp_path / "rays.csv"
    table.write_text("0,0,0,255\n0,0,1,256\n")
    settings = {"pattern": "table", "table": str(table)}
    with pytest.raises(ims.InputError, match=f"line 2: ring 256: .* 0 to 255 for {layout}"):
        flown("ground", 0.2, layout=layout, **settings)
    cloud = static(BOX, 0.3, layout="velodyne", **settings).cloud(0)
    assert LAYOUTS["velodyne"].rows(cloud)["ring"].tolist() == [255, 256]
    with pytest.raises(ims.ConfigurationError, match="counts lines in a byte"):
        custom_points(cloud)


def test_a_tour_goes_through_the_place_that_a_lidar_sees(tmp_path):
    """Python and a bag have the corridor's own tour, in a corridor of its usual size."""
    expected = tour(TourParameters(place="corridor", place_seed=3)).sample(np.arange(4) * 0.05)
    scene = {"type": "corridor", "seed": 3}
    flight = ims.simulate(
        trajectory="tour", duration=0.2, rate=20, sensors=["lidar"], scene=scene,
        lidar={"firing_period": 0.01},
    )  # fmt: skip
    assert np.allclose(flight.truth.position, expected.position, atol=1e-12)
    assert flight.parameters.rig.scene.size == (36.0, 2.4, 2.7)
    argv = ["--trajectory", "tour", "--scene", "corridor", "--set", "scene.seed=3", "--quiet"]
    argv += ["--duration", "0.2s", "--rate", "20", "--set", "sensors=[lidar]"]
    argv += ["--set", "lidar.firing_period=0.01"]
    assert generate.main(["-o", str(tmp_path / "a.mcap"), *argv]) == 0
    truth = ims.read_odometry(tmp_path / "a.mcap")
    assert np.allclose(truth.position, expected.position, atol=1e-12)


@pytest.mark.parametrize("height", [0.0, 1.5])
def test_a_car_stands_on_the_street_below_its_lidar(height):
    """The ground is 0.3 m below what sees, or below the body, which is at z = 0."""
    flight = flown(
        "street", 0.1, trajectory="yard", lever_arm=[0.0, 0.0, height], firing_period=1e-3
    )
    z = in_world(flight)[:, 2]
    ground = 0.0 if height else -0.3
    assert (np.abs(z - ground) < TENTH_OF_A_MM).mean() > 0.2
    assert z.min() > ground - 0.02 - TENTH_OF_A_MM  # grass lies 2 cm below asphalt


def test_a_bag_says_where_a_lidar_is(tmp_path):
    """Without being asked for: LIO and viewers need the mount."""
    argv = ["--lidar", "perfect", "--scene", "ground", "--duration", "0.2s", "--quiet"]
    argv += ["--set", "lidar.lever_arm=[0.1, -0.2, 0.3]", "--set", "lidar.firing_period=0.01"]
    assert generate.main(["-o", str(tmp_path / "a.mcap"), *argv]) == 0
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        (static_connection,) = (c for c in reader.connections if c.topic == "/tf_static")
        ((_, _, payload),) = reader.messages([static_connection])
        transforms = reader.deserialize(payload, static_connection.msgtype).transforms
    (mount,) = (t for t in transforms if t.child_frame_id == "lidar")
    arm = mount.transform.translation
    assert (mount.header.frame_id, arm.x, arm.y, arm.z) == ("base_link", 0.1, -0.2, 0.3)


def test_a_run_of_a_campaign_has_what_programs_read(tmp_path):
    """Clouds and the mount, not the truth of every point, which is larger than both."""
    path = tmp_path / "plan.yaml"
    text = "name: a\nparameters: {rate: 50.0, duration: 0.2, scene: ground, lidar: perfect, "
    path.write_text(
        f"{text}lidar.firing_period: 0.01}}\nseeds: 1\nestimators: {{a: {{type: dead_reckon}}}}\n"
    )
    plan = load_plan(path)
    cell = SimulatedCell(plan, next(iter(plan.cells())))
    with open_bag(write_dataset(cell, "mcap", 0, tmp_path)) as bag:
        counts = {topic.name: topic.count for topic in bag.topics}
    assert counts == {"/imu/data_raw": 10, "/ground_truth/odom": 10, "/points": 2, "/tf_static": 1}


READINGS_OF_A_RUN = """
import sys
from pathlib import Path
from imu_sim_ros.campaigns.plan import load_plan
from imu_sim_ros.campaigns.simulated import SimulatedCell

plan = load_plan(Path(sys.argv[1]))
cell = SimulatedCell(plan, next(iter(plan.cells())))
assert len(cell.block(0).t_ns) == 10
print("imu_sim_ros.sensors.lidar.model" in sys.modules)
cell.simulation(0)
print("imu_sim_ros.sensors.lidar.model" in sys.modules)
"""


def test_the_truth_of_a_run_needs_no_scans(tmp_path):
    """An estimate is compared, and a page drawn, without casting rays once more."""
    path = tmp_path / "plan.yaml"
    path.write_text(
        "name: a\nparameters: {rate: 50.0, duration: 0.2, scene: warehouse, lidar: vlp16}\n"
        "seeds: 1\nestimators: {a: {type: dead_reckon}}\n"
    )
    command = [sys.executable, "-c", READINGS_OF_A_RUN, path]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


def test_a_scene_without_surfaces_is_told():
    with pytest.warns(
        UserWarning, match="nothing in sight of scene.type = 'house', which has no surfaces"
    ):
        scans = flown("house", 0.2).lidar
    assert (scans.outcome == NOTHING).all()


def test_points_are_on_a_mesh(tmp_path):
    """A box of triangles from a file, against its walls."""
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("embreex")
    trimesh.creation.box((12.0, 9.0, 6.0)).export(tmp_path / "box.ply")
    scene = {"type": "mesh", "mesh": str(tmp_path / "box.ply"), "landmarks": 10}
    flight = flown(scene, trajectory="tumble", reflectivity=0.25, **MOUNT)
    points = in_world(flight)
    assert len(points) == flight.lidar.range.size
    away = np.abs(np.abs(points) - np.array([6.0, 4.5, 3.0]))
    assert away.min(axis=1).max() < TENTH_OF_A_MM
    assert (flight.lidar.reflectivity == 0.25).all()


def test_the_rays_of_lidars_are_their_own():
    """A firing of channels one after the other, in the order and at the times that are given."""
    lidar = LidarParameters(
        elevations_deg=(-10.0, 10.0, 0.0), firing_period=0.01, channel_interval=0.001, rate=5.0
    )
    pattern = build_pattern(lidar)
    assert np.array_equal(pattern.ring[:6], [0, 2, 1, 0, 2, 1])
    assert np.allclose(pattern.time[:4], [0.0, 0.001, 0.002, 0.01])
    x, y, z = pattern.directions(0.0).T
    assert np.allclose(np.degrees(np.arcsin(z[:3])), [-10, 10, 0])
    # Clockwise from behind: 5 turns a second are 1.8 deg a millisecond.
    azimuth = np.degrees(np.unwrap(np.arctan2(y, x)))
    assert np.allclose(np.diff(azimuth[:3]), -1.8)
    assert azimuth[0] == pytest.approx(180.0)


def test_who_knows_of_lidars():
    """One word in the list of sensors, files for others' stacks, an example."""
    package = Path(ims.__file__).parent
    mentions = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        if "lidar" in path.read_text(encoding="utf-8").lower()
    }
    outside_room = {name for name in mentions if not name.startswith("sensors/lidar/")}
    assert {name for name in outside_room if not name.startswith("datasets/consumers/")} == {
        "bags/messages/encode_cameras.py",
        "jobs/recorded.py",
        "sensors/__init__.py",
    }
    source = (package / "sensors/__init__.py").read_text(encoding="utf-8")
    assert source.lower().count("lidar") == 1
