# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""C3D files that ezc3d writes: rotation data, clusters of markers, gaps, units, damage."""

import random
import sys
import warnings

import numpy as np
import pytest

pytest.importorskip("ezc3d")

import mocap

import imu_sim_ros as ims
from imu_sim_ros.bags.logs import c3d
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError, MissingDependencyError, Remark

pytestmark = pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")
RATE = 100.0
T = np.arange(151) / RATE
FLOAT32 = 2.0**-24
"""Relative rounding of the numbers in a file."""
LARGEST = 1500.0  # mm
Y_UP = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])


def labelled(position, names):
    return {name: position[:, k] for k, name in enumerate(names)}


def poses():
    """Return the poses (n, 4, 4) of the tumbling body [mm]."""
    position, q = mocap.tumbling(T)
    matrices = np.tile(np.eye(4), (len(T), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = rotation.to_matrix(q), position
    return matrices


def remarks(path, topic):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        states = ims.read_states(path, topic)
    return states, [str(entry.message) for entry in caught if issubclass(entry.category, Remark)]


def assert_same_motion(states, start=0, rows=slice(None), body=mocap.BODY):
    """Compare with the closed form; the axes of the segment are those of the world at ``start``."""
    position, q = mocap.tumbling(T)
    at_start = rotation.conjugate(q[start])
    expected = rotation.multiply(q, at_start)
    centroid = position + rotation.rotate(q, body.mean(axis=0))
    angle = rotation.log(rotation.multiply(rotation.conjugate(expected[rows]), states.q_wb))
    # Markers about 50 mm from the centroid, each rounded in single precision at 1.5 m.
    assert np.abs(angle).max() < 10.0 * LARGEST * FLOAT32 / 30.0
    np.testing.assert_allclose(
        states.position, 1e-3 * centroid[rows], atol=5e-3 * LARGEST * FLOAT32
    )


def test_rotation_matrices_of_segments_become_poses_in_metres(tmp_path):
    path = mocap.c3d(
        tmp_path / "theia.c3d", RATE, rotations={"l_uarm_4X4": poses(), "pelvis_4X4": poses()}
    )
    with open_bag(path) as bag:
        assert [topic.name for topic in bag.topics] == ["/l_uarm", "/pelvis"]
    states = ims.read_states(path, "pelvis_4X4")
    position, q = mocap.tumbling(T)
    np.testing.assert_allclose(states.position, 1e-3 * position, atol=1e-6)
    np.testing.assert_allclose(rotation.to_matrix(states.q_wb), rotation.to_matrix(q), atol=1e-6)
    np.testing.assert_array_equal(states.t_ns, np.arange(len(T)) * 10_000_000)


def test_rotation_data_without_a_pose_are_gaps(tmp_path):
    matrices = poses()
    matrices[40:50] = np.nan
    matrices[60] = 0.0
    path = mocap.c3d(tmp_path / "theia.c3d", RATE, rotations={"head_4X4": matrices})
    states, lines = remarks(path, "head")
    assert len(states) == len(T) - 11
    assert any(
        "head: 11 of 151 frames do not show a pose" in line and "0.11 s" in line for line in lines
    )


def test_markers_of_a_segment_give_its_poses_where_three_are_visible(tmp_path):
    """Labels with one beginning are a segment; a frame with three of four markers has a pose."""
    position = mocap.markers(T)
    position[20:30, 1] = np.nan
    position[30, 2] = 0.0  # as some systems write what they do not see
    position[0, 0] = np.nan
    position[100:105, 1:3] = np.nan
    path = mocap.c3d(
        tmp_path / "walk.c3d", RATE, labelled(position, [f"S1:LFA{k}" for k in range(1, 5)])
    )
    states, lines = remarks(path, "LFA")
    rows = np.delete(np.arange(len(T)), np.arange(100, 105))
    assert_same_motion(states, start=1, rows=rows)
    assert any("axes and centroid of the frame at 0.010 s" in line for line in lines)
    assert any(
        "5 of 151 frames do not show 3 markers" in line and "0.06 s" in line for line in lines
    )


def test_stated_list_of_markers(tmp_path):
    names = ["LELB", "LWRA", "LWRB", "CLAV"]
    path = mocap.c3d(tmp_path / "plug_in.c3d", RATE, labelled(mocap.markers(T), names))
    states = ims.read_states(path, "LELB,LWRA,LWRB")
    assert_same_motion(states, body=mocap.BODY[:3])
    with pytest.raises(InputError, match="no marker LWRX; it has LELB, LWRA"):
        ims.read_states(path, "LELB,LWRA,LWRX")


def test_results_of_models_are_no_markers(tmp_path):
    names = ["LFA1", "LFA2", "LFA3", "LFA4"]
    angles = {f"Angle{k}": np.full((len(T), 3), 90.0 + k) for k in range(1, 4)}
    points = labelled(mocap.markers(T), names) | angles
    path = mocap.c3d(tmp_path / "model.c3d", RATE, points, ANGLES=list(angles))
    with open_bag(path) as bag:
        assert [topic.name for topic in bag.topics] == ["/LFA"]


@pytest.mark.parametrize(
    ("units", "factor", "up"),
    [("mm", 1.0, "+Y"), ("m", 1e-3, "+Z"), ("cm", 0.1, ""), ("", 1.0, "+Z")],
)
def test_unit_and_axis_of_the_file(tmp_path, units, factor, up):
    position = mocap.markers(T) * factor
    if up == "+Y":
        position = position @ Y_UP  # the same motion in a laboratory with y up
    path = mocap.c3d(
        tmp_path / "lab.c3d", RATE, labelled(position, ["A1", "A2", "A3", "A4"]), units=units, up=up
    )
    states, lines = remarks(path, "A")
    assert_same_motion(states)
    assumed = [line for line in lines if "trajectory.scale and trajectory.up correct" in line]
    assert bool(assumed) == (not units or not up)


@pytest.mark.parametrize(
    ("points", "line"),
    [
        ({"A1": [0.0, 0, 1], "A2": [0, 0, 2], "A3": [0, 0, 3]}, "markers are on a line"),
        (
            {"A1": [np.nan] * 3, "A2": [0, 0, 2], "A3": [0, 3, 3]},
            "no frame has all of its 3 markers",
        ),
        ({"A1": [0.0, 0, 1]}, "with 1 markers; a segment needs 3"),
    ],
)
def test_markers_that_tell_no_pose(tmp_path, points, line):
    columns = {name: np.tile(np.array(value), (5, 1)) for name, value in points.items()}
    path = mocap.c3d(tmp_path / "few.c3d", RATE, columns)
    with pytest.raises(InputError, match=line):
        ims.read_states(path, ",".join(points))


def test_without_the_library_a_line_names_it(tmp_path, monkeypatch):
    path = mocap.c3d(tmp_path / "a.c3d", RATE, labelled(mocap.markers(T), ["A1", "A2", "A3", "A4"]))
    monkeypatch.setitem(sys.modules, "ezc3d", None)
    with pytest.raises(MissingDependencyError, match="pip install ezc3d"):
        c3d.contents(path)


def test_damaged_files_are_refused_with_lines_that_name_the_file(tmp_path):
    """Some of these end the process of ezc3d itself, none of them this one."""
    path = mocap.c3d(tmp_path / "a.c3d", RATE, labelled(mocap.markers(T), ["A1", "A2", "A3", "A4"]))
    content = path.read_bytes()
    lines = []
    for seed in range(16):
        chance = random.Random(seed)
        damaged = bytearray(content)
        if seed % 2:
            damaged = damaged[: chance.randrange(512, len(damaged))]
        else:
            for _ in range(4):
                damaged[chance.randrange(2, 1536)] = chance.randrange(256)
        path.write_bytes(damaged)
        try:
            ims.read_states(path, "A")
        except InputError as error:
            lines += error.problems
    assert sum("damaged" in line for line in lines) >= 4
    assert all(str(path) in line and "\n" not in line for line in lines)
