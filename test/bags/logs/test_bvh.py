# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""BVH files: kinematics, axes, units, frames, damage."""

import random
import sys
import warnings
from pathlib import Path

import mocap
import numpy as np
import pytest

import imu_sim_ros as ims
from imu_sim_ros.bags.logs import bvh
from imu_sim_ros.bags.read import open_bag
from imu_sim_ros.core import rotation
from imu_sim_ros.core.errors import InputError, MissingDependencyError, Remark
from imu_sim_ros.formats.door import read_states

sys.path.insert(0, str(Path(__file__).parents[3] / "examples"))
import walk

bvhio = pytest.importorskip("bvhio")
pytestmark = pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")
TO_WORLD = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
"""x, y, z of the package are z, x, y of a file with y up."""
ARM = """HIERARCHY
ROOT Base
{
\tOFFSET 0 0 0
\tCHANNELS 6 Xposition Yposition Zposition Yrotation Zrotation Xrotation
\tJOINT Slide
\t{
\t\tOFFSET 0 100 0
\t\tCHANNELS 4 Zposition Xrotation Yrotation Xposition
\t\tJOINT Tip
\t\t{
\t\t\tOFFSET 0 60 0
\t\t\tCHANNELS 1 Zrotation
\t\t\tEnd Site
\t\t\t{
\t\t\t\tOFFSET 0 10 0
\t\t\t}
\t\t}
\t}
}""".splitlines()
"""Joints whose channels have different orders, kinds and numbers."""


@pytest.fixture(scope="module")
def walking(tmp_path_factory):
    path = tmp_path_factory.mktemp("bvh") / "walk.bvh"
    walk.write(path, 2.0)
    return path


def turn(axis, degrees):
    """Return R (n, 3, 3) about one axis."""
    angle = np.deg2rad(degrees)
    matrix = np.tile(np.eye(3), (len(angle), 1, 1))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[:, i, i] = matrix[:, j, j] = np.cos(angle)
    matrix[:, j, i], matrix[:, i, j] = np.sin(angle), -np.sin(angle)
    return matrix


def remarks(function, *arguments):
    """Return the remarks that a call causes."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        function(*arguments)
    return [str(entry.message) for entry in caught if issubclass(entry.category, Remark)]


def test_kinematics_are_those_of_a_closed_form(tmp_path):
    """R = R_1 R_2 R_3 in the order of the channels; position channels stand for the offset's."""
    rng = np.random.default_rng(1)
    rows = rng.uniform(-150.0, 150.0, (40, 11))
    path = tmp_path / "arm.bvh"
    path.write_text(mocap.bvh(ARM, rows))
    rows = np.round(rows, 6)
    base = turn(1, rows[:, 3]) @ turn(2, rows[:, 4]) @ turn(0, rows[:, 5])
    slide = base @ turn(0, rows[:, 7]) @ turn(1, rows[:, 8])
    offset = np.column_stack([rows[:, 9], np.full(40, 100.0), rows[:, 6]])
    position = rows[:, :3] + np.einsum("nij,nj->ni", base, offset)
    tip = position + slide @ [0.0, 60.0, 0.0]
    tip_turn = slide @ turn(2, rows[:, 10])
    for topic, p, r in (
        ("Base", rows[:, :3], base),
        ("Slide", position, slide),
        ("Tip", tip, tip_turn),
    ):
        states = ims.read_states(path, topic)
        np.testing.assert_allclose(states.position, 0.01 * p @ TO_WORLD.T, atol=1e-9)
        expected = TO_WORLD @ r @ TO_WORLD.T
        np.testing.assert_allclose(rotation.to_matrix(states.q_wb), expected, atol=1e-9)
    np.testing.assert_array_equal(states.t_ns, np.arange(40) * 10_000_000)


def test_kinematics_are_those_of_bvhio(walking):
    """All segments of a skeleton, against the library's own hierarchy in single precision."""
    root = bvhio.readAsHierarchy(str(walking))
    frame = 37
    root.loadPose(frame)
    for joint, _, _ in root.layout():
        states = ims.read_states(walking, joint.Name)
        expected = TO_WORLD @ np.array(joint.PositionWorld) * 0.01
        np.testing.assert_allclose(states.position[frame], expected, atol=2e-6)


@pytest.mark.parametrize(
    ("text", "rate"),
    [("0.0166667", 60.0), ("0.008333", 120.0), ("0.04", 25.0), ("0.01234", 1 / 0.01234)],
)
def test_rounded_interval_is_a_whole_rate(tmp_path, text, rate):
    path = tmp_path / "arm.bvh"
    path.write_text(mocap.bvh(ARM, np.zeros((601, 11)), text))
    end = ims.read_states(path, "Base").t_ns[-1]
    assert abs(end - 600e9 / rate) <= 1.0


@pytest.mark.parametrize(
    ("factor", "name"), [(1.0, "cm"), (10.0, "mm"), (0.01, "m"), (1 / 2.54, "inches")]
)
@pytest.mark.parametrize("up", "yz")
def test_unit_and_axis_are_told(tmp_path, factor, name, up):
    """A skeleton of 1.7 m in any unit, with y or z up, is the same one in the world."""
    lines = []
    for line in ARM:
        if "OFFSET" in line:
            vector = factor * np.array(line.split()[1:], float)
            vector = vector if up == "y" else TO_WORLD @ vector
            line = "OFFSET " + " ".join(f"{value:.6f}" for value in vector)
        lines.append(line)
    path = tmp_path / "arm.bvh"
    path.write_text(mocap.bvh(lines, np.zeros((5, 11))))
    (line, *_) = remarks(ims.read_states, path, "Tip")
    assert f"read in {name}; {up} is up" in line
    assert "trajectory.scale" not in line
    np.testing.assert_allclose(ims.read_states(path, "Slide").q_wb[:, 0], 1.0)


def test_unknown_unit_says_its_assumption(tmp_path):
    path = tmp_path / "arm.bvh"
    path.write_text(
        mocap.bvh([line.replace("100", "10").replace("60", "6") for line in ARM], np.zeros((5, 11)))
    )
    (line, *_) = remarks(ims.read_states, path, "Tip")
    assert "read in cm" in line
    assert "the unit cannot be told" in line
    assert "trajectory.scale" in line


def test_scale_and_axis_correct_poses(tmp_path):
    """A file in inches with x up, read as centimetres with y up, moves as it should."""
    path = tmp_path / "arm.bvh"
    rows = np.zeros((61, 11))
    rows[:, :3] = np.outer(np.linspace(0.0, 1.0, 61), [10.0, 20.0, 30.0])
    path.write_text(mocap.bvh(ARM, rows))
    motion = {"type": "poses", "file": str(path), "topic": "Base", "scale": 2.54, "up": "y"}
    end = ims.simulate(trajectory=motion, rate=10).trajectory.sample(np.array([0.6])).position[0]
    # Read: x, y, z are the file's z, x, y. Their y up: x, y, z are their z, x, y.
    np.testing.assert_allclose(end, 0.0254 * np.array([20.0, 30.0, 10.0]), atol=1e-6)


@pytest.mark.parametrize(("interval", "frequency"), [("0.0166667", "12"), ("0.1", "5")])
def test_note_states_the_frequency_above_which_motion_is_missing(tmp_path, interval, frequency):
    """The note names the cut-off frequency, but at most half of the rate of the poses."""
    path = tmp_path / "arm.bvh"
    path.write_text(mocap.bvh(ARM, np.zeros((61, 11)), interval))
    motion = {"type": "poses", "file": str(path), "topic": "Base"}
    result = ims.generate(tmp_path / "arm.mcap", trajectory=motion, rate=50)
    assert any(
        f"motion above {frequency} Hz is not in the readings" in line for line in result.notes
    )


def test_segments_are_the_topics_of_all_programs(walking):
    with open_bag(walking) as bag:
        assert [topic.name for topic in bag.topics][:3] == ["/Hips", "/Spine", "/Head"]
    with pytest.raises(InputError, match="did you mean /LeftForeArm"):
        ims.read_states(walking, "LeftForArm")
    with pytest.raises(InputError, match="name one of /Hips, /Spine"):
        ims.read_states(walking)


def test_names_that_ros_has_not(tmp_path):
    text = (
        mocap.bvh(ARM, np.zeros((5, 11)))
        .replace("Slide", "mixamorig:Arm")
        .replace("Tip", "mixamorig-Arm")
    )
    path = tmp_path / "names.bvh"
    path.write_text(text)
    with open_bag(path) as bag:
        assert [topic.name for topic in bag.topics] == [
            "/Base",
            "/mixamorig_Arm",
            "/mixamorig_Arm_2",
        ]
    assert len(ims.read_states(path, "mixamorig:Arm")) == 5


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda text: text[:300], "ends before its frames"),
        (lambda text: text.replace("Frame Time: 0.01", "Frame Time: 0"), "must be more than 0 s"),
        (lambda text: text.replace("Zrotation", "Zrot"), "has a channel Zrot; known: Xposition"),
        (lambda text: text.replace("CHANNELS 4", "CHANNELS 3"), "Channel count mismatch"),
        (lambda text: text.replace("OFFSET 0 60", "OFFSET 0 nan"), "offset that is not finite"),
        (lambda text: text[: text.index("Frame Time")] + "Frame Time: 0.01\n", "no frames"),
        (lambda text: text.replace("0.000000", "0,000000"), "not a number"),
    ],
)
def test_damaged_file_is_one_line(tmp_path, change, line):
    path = tmp_path / "bad.bvh"
    path.write_text(change(mocap.bvh(ARM, np.zeros((5, 11)))))
    with pytest.raises(InputError, match=line) as error:
        read_states(path, "Base")
    assert len(error.value.problems) == 1
    assert str(path) in str(error.value)


def test_cut_file_is_read_up_to_the_cut(tmp_path):
    text = mocap.bvh(ARM, np.zeros((9, 11)))
    path = tmp_path / "cut.bvh"
    path.write_text(text[:-20])
    lines = remarks(read_states, path, "Base")
    assert any(
        "frame 9 of 9: 9 values, the skeleton has 11; read up to it" in line for line in lines
    )
    path.write_text(mocap.bvh(ARM, np.zeros((9, 11)), frames=20))
    assert any(
        "9 frames, though it states 20" in line for line in remarks(read_states, path, "Base")
    )


def test_without_the_library_a_line_names_it(walking, monkeypatch):
    monkeypatch.setitem(sys.modules, "bvhio", None)
    with pytest.raises(MissingDependencyError, match="pip install bvhio"):
        bvh.contents(walking)


def test_three_hundred_damaged_files(tmp_path):
    """Cut, changed, lengthened: poses, or one line that names the file."""
    content = mocap.bvh(ARM, np.zeros((20, 11))).encode()
    path = tmp_path / "fuzzed.bvh"
    lines = []
    for seed in range(300):
        chance = random.Random(seed)
        damaged = bytearray(content)
        place = chance.randrange(len(damaged))
        if seed % 3 == 0:
            damaged = damaged[:place]
        elif seed % 3 == 1:
            for _ in range(chance.randrange(1, 20)):
                damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        else:
            damaged[place : place + 40] = damaged[place : place + 40] * chance.randrange(3)
        path.write_bytes(damaged)
        try:
            read_states(path, "Base")
        except InputError as error:
            lines += error.problems
    assert len(lines) > 100
    assert all(str(path) in line and "\n" not in line for line in lines)
