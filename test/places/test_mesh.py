# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Meshes: what files say, the rays that meet triangles, and what is wrong with a file."""

import json
import struct
import subprocess
import sys

import numpy as np
import pytest

from imu_sim_ros.core.errors import InputError, MissingDependencyError
from imu_sim_ros.places import mesh_file, mesh_textures
from imu_sim_ros.places.mesh import (
    UPS,
    MeshCaster,
    box,
    fibonacci_directions,
    open_edges,
    place_mesh,
    scatter_points,
    up_axis_rotation,
)
from imu_sim_ros.places.mesh_file import Mesh, areas, is_mesh, read_mesh

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("embreex")
Image = pytest.importorskip("PIL.Image")

from meshes import checkerboard, met, picture, quads, textured  # noqa: E402 - after trimesh

FAR = np.array([1000.0, -500.0, 20.0])
BOX = trimesh.creation.box((2.0, 4.0, 6.0))


def plain(vertices, faces):
    """Return a mesh of triangles alone."""
    count = len(faces)
    return Mesh(
        np.asarray(vertices, float),
        np.asarray(faces, np.int32),
        np.zeros((count, 3, 2), np.float32),
        np.full(count, -1, np.int32),
        (),
        np.full((count, 3, 3), 255, np.uint8),
        False,
    )


def soup(count, seed=1):
    """Return triangles anywhere, large and small."""
    stream = np.random.default_rng(seed)
    places = stream.uniform(-10, 10, (count, 1, 3))
    corners = places + stream.normal(0, 1, (count, 3, 3)) * stream.uniform(0.1, 3, (count, 1, 1))
    return plain(corners.reshape(-1, 3) + FAR, np.arange(3 * count).reshape(-1, 3))


def test_rays_meet_what_an_independent_caster_says():
    """Far from the origin, too: single precision counts from the mesh's middle.

    At an edge the two may take different triangles; one ray in a thousand is allowed for it.
    """
    mesh, stream = soup(300), np.random.default_rng(2)
    origins = stream.uniform(-12, 12, (4000, 3)) + FAR
    ways = stream.normal(size=(4000, 3)) * stream.uniform(0.1, 5.0, (4000, 1))
    expected, number = met(mesh.corners, origins, ways)
    hits = MeshCaster(mesh).cast(origins, ways, nearest=0.0)
    agreeing = hits.surface == number
    assert agreeing.mean() > 0.999
    assert 0.3 < np.isfinite(expected).mean() < 0.95
    hit = agreeing & (number >= 0)
    assert np.abs(hits.distance[hit] / expected[hit] - 1.0).max() < 1e-6
    assert np.median(np.abs(hits.distance[hit] - expected[hit])) < 1e-9
    assert not np.isfinite(hits.distance[number < 0]).any()
    blocked = MeshCaster(mesh).is_blocked(origins, ways, 1.0)
    assert (blocked == (expected < 1.0)).mean() > 0.999


def test_a_sphere_is_met_where_its_triangles_are_and_none_is_missed():
    """Every ray from inside a closed body hits it: no ray slips between two triangles."""
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=3.0)
    mesh = plain(sphere.vertices, sphere.faces)
    caster, ways = MeshCaster(mesh), fibonacci_directions(200_000)
    hits = caster.cast(np.zeros((len(ways), 3)), ways)
    assert np.isfinite(hits.distance).all()
    some = ways[::4001]
    expected, _ = met(mesh.corners, np.zeros((len(some), 3)), some)
    assert np.abs(hits.distance[::4001] - expected).max() < 1e-9
    assert open_edges(mesh) == 0
    assert open_edges(mesh._replace(faces=mesh.faces[1:])) == 3


def test_points_on_a_mesh_are_seen_unless_something_is_before_them():
    mesh = soup(60, seed=4)
    points = scatter_points(mesh, np.cumsum(areas(mesh)), 3000, np.random.default_rng(5))
    eye = np.broadcast_to(FAR, points.shape)
    expected, _ = met(mesh.corners, eye, points - eye)
    assert np.abs(expected[expected > 0.9999] - 1.0).max() < 1e-6
    hidden = MeshCaster(mesh).is_hidden(eye, points)
    assert (hidden == (expected < 0.9999)).mean() > 0.999
    assert 0.1 < hidden.mean() < 0.9


def test_scattered_points_are_even():
    """The shares of the faces of a box of 2 x 4 x 6 are those of their areas: binomial, 4 sigma."""
    mesh = plain(BOX.vertices, BOX.faces)
    sums = np.cumsum(areas(mesh))
    assert sums[-1] == pytest.approx(88.0)
    points = scatter_points(mesh, sums, 20_000, np.random.default_rng(1))
    for axis, area in ((0, 24.0), (1, 12.0), (2, 8.0)):
        share = (np.abs(np.abs(points[:, axis]) - (1.0, 2.0, 3.0)[axis]) < 1e-9).mean()
        p = area / 44.0
        assert abs(share - p) < 4.0 * (p * (1.0 - p) / 20_000) ** 0.5


@pytest.mark.parametrize("up", UPS)
def test_an_axis_points_up(up):
    turn = up_axis_rotation(up, ".glb")
    axis = {"file": "y"}.get(up, up)
    vector = np.eye(3)["xyz".index(axis[-1])] * (-1 if axis[0] == "-" else 1)
    assert (turn @ vector).tolist() == [0.0, 0.0, 1.0]
    assert np.linalg.det(turn) == 1.0
    assert np.array_equal(up_axis_rotation("file", ".obj"), np.eye(3))


@pytest.mark.parametrize("kind", ["glb", "obj", "ply", "stl"])
def test_each_kind_of_file_gives_the_same_triangles(tmp_path, kind):
    BOX.export(tmp_path / f"box.{kind}")
    mesh = read_mesh(tmp_path / f"box.{kind}")
    assert len(mesh.faces) == 12
    assert box(mesh)[1] == pytest.approx([1.0, 2.0, 3.0], abs=1e-6)
    corners = np.sort(mesh.corners.reshape(12, 9).round(5), axis=0)
    assert np.allclose(corners, np.sort(BOX.triangles.reshape(12, 9), axis=0), atol=1e-5)
    assert is_mesh(tmp_path / f"box.{kind}")
    moved = place_mesh(mesh, 2.0 * up_axis_rotation("y", ""), np.array([10.0, 0, 0]))
    assert box(moved)[1] == pytest.approx([12.0, 6.0, 4.0], abs=1e-5)
    centered = place_mesh(mesh, np.eye(3), np.array([0.0, 0, 1]), np.array([5.0, 5, 5]))
    assert sum(box(centered)) / 2 == pytest.approx([5.0, 5, 6], abs=1e-5)


def test_parts_stand_where_the_file_places_them(tmp_path):
    """Once as it is, once moved, once mirrored; a mirror turns no front to the back."""
    scene = trimesh.Scene()
    scene.add_geometry(BOX, geom_name="box")
    move, mirror = np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0])
    move[:3, 3], mirror[:3, 3] = [10, 0, 0], [0, 20, 0]
    for name, place in (("moved", move), ("mirrored", mirror)):
        scene.graph.update(frame_to=name, matrix=place, geometry="box")
    scene.export(tmp_path / "three.glb")
    mesh = read_mesh(tmp_path / "three.glb")
    assert len(mesh.faces) == 36
    assert np.allclose(box(mesh), [[-1, -2, -3], [11, 22, 3]], atol=1e-6)
    corners = mesh.corners
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    assert volume.sum() == pytest.approx(3 * 48.0, rel=1e-6)


def test_colours_and_textures_are_those_of_the_file(tmp_path):
    vertices, faces, places = quads([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    board = checkerboard(3, 2, 8)
    textured(vertices, faces, places, board).export(tmp_path / "board.glb")
    mesh = read_mesh(tmp_path / "board.glb")
    assert np.array_equal(mesh.textures[0], board)
    assert mesh.texture.tolist() == [0, 0]
    assert mesh.painted
    corner = np.argmin(np.abs(mesh.corners[0]).sum(axis=1))
    assert mesh.places[0, corner].tolist() == [0.0, 0.0]  # v = 0 is the texture's last row
    colours = np.arange(12, dtype=np.uint8).reshape(4, 3) * 20
    trimesh.Trimesh(vertices, faces, vertex_colors=colours, process=False).export(
        tmp_path / "colours.ply"
    )
    mesh = read_mesh(tmp_path / "colours.ply")
    assert np.array_equal(mesh.colours, colours[faces])
    (tmp_path / "m.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (tmp_path / "red.obj").write_text(
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n"
    )
    mesh = read_mesh(tmp_path / "red.obj")
    assert mesh.colours.reshape(-1, 3).tolist() == [[255, 0, 0]] * 3
    assert not mesh.painted
    # glTF's factors are linear: 0.214 of the light is the value 0.5 of sRGB.
    half = trimesh.visual.material.PBRMaterial(baseColorFactor=[0.2140, 1.0, 0.0, 1.0])
    visual = trimesh.visual.TextureVisuals(uv=places, material=half)
    trimesh.Trimesh(vertices, faces, visual=visual, process=False).export(tmp_path / "half.glb")
    red, green, blue = read_mesh(tmp_path / "half.glb").colours[0, 0].tolist()
    assert abs(red - 128) <= 1
    assert (green, blue) == (255, 0)


TRIANGLE = "v 0 0 0\nv 1 0 1\nv 1 1 1\nvt 0 0\nvt 1 0\nvt 1 1\n"
PLY = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(
    f"property float {axis}\n" for axis in "xyz"
)
FACE = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"


def gltf(**tree):
    """Return a GLB file without triangles."""
    text = json.dumps({"asset": {"version": "2.0"}, **tree}).encode()
    text += b" " * (-len(text) % 4)
    head = b"glTF" + struct.pack("<II", 2, 20 + len(text))
    return head + struct.pack("<I", len(text)) + b"JSON" + text


BAD = {
    "x.fbx": (b"abc", "must be one of glb, gltf, obj, ply, stl"),
    "x.ply": (b"", "is empty"),
    "text.ply": (b"hello", r"cannot be read as PLY: damaged or cut off"),
    "text.glb": (b"hello", "cannot be read as GLB: damaged or cut off"),
    "text.obj": (b"hello", "has no faces"),
    "cut.ply": (BOX.export(file_type="ply")[:-30], "cannot be read as PLY: damaged or cut off"),
    "cut.glb": (BOX.export(file_type="glb")[:-30], "cannot be read as GLB: damaged or cut off"),
    "cut.stl": (BOX.export(file_type="stl")[:-30], "cut off$"),
    "points.ply": (
        f"{PLY}end_header\n0 0 0\n1 0 0\n0 1 0\n".encode(),
        "has no faces; of points alone scene.type file makes landmarks",
    ),
    "nan.ply": (
        f"{PLY}{FACE}0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n".encode(),
        r"vertex 2 is at \(1, nan, 0\), not a finite place",
    ),
    "far.obj": (b"v 0 0 1e300\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", r"vertex 1 is at \(0, 0, 1e\+300\)"),
    "index.ply": (
        f"{PLY}{FACE}0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n".encode(),
        "a face refers to a vertex that is not there",
    ),
    "flat.obj": (b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no face has an area"),
    "lost.obj": (
        f"mtllib gone.mtl\n{TRIANGLE}usemtl m\nf 1/1 2/2 3/3\n".encode(),
        "needs gone.mtl, which is not there",
    ),
    "draco.glb": (
        gltf(extensionsRequired=["KHR_draco_mesh_compression"]),
        "is compressed by KHR_draco_mesh_compression: export it without compression",
    ),
    "none.glb": (gltf(scenes=[{"nodes": []}], scene=0), "has no faces|cannot be read as GLB"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_gets_one_line(tmp_path, capfd, name):
    content, message = BAD[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        read_mesh(tmp_path / name)
    (line,) = caught.value.problems
    assert line.startswith(str(tmp_path / name))
    assert "\n" not in line
    assert capfd.readouterr() == ("", "")


def test_textures_that_cannot_be_had_get_a_line(tmp_path, capfd):
    """None of them is left out, which would show a grey place."""
    material, faces = "newmtl m\nmap_Kd {}\n", f"mtllib m.mtl\n{TRIANGLE}usemtl m\nf 1/1 2/2 3/3\n"
    (tmp_path / "x.obj").write_text(faces)
    (tmp_path / "m.mtl").write_text(material.format("gone.png"))
    with pytest.raises(InputError, match=r"x.obj: needs gone.png, which is not there$"):
        read_mesh(tmp_path / "x.obj")
    (tmp_path / "m.mtl").write_text(material.format("text.png"))
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(InputError, match=r"x.obj: the texture text.png is no picture$"):
        read_mesh(tmp_path / "x.obj")
    stream = np.random.default_rng(1)
    board = textured(
        *quads([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), stream.integers(0, 255, (64, 64, 3))
    )
    content = board.export(file_type="glb")
    signature = content.find(b"\x89PNG")
    (tmp_path / "a.glb").write_bytes(content[:signature] + b"XXXX" + content[signature + 4 :])
    (tmp_path / "b.glb").write_bytes(
        content[: signature + 99] + bytes(4000) + content[signature + 4099 :]
    )
    for name in ("a", "b"):
        with pytest.raises(
            InputError, match=rf"{name}.glb: a texture (is no picture|cannot be read)"
        ):
            read_mesh(tmp_path / f"{name}.glb")
    (tmp_path / "m.mtl").write_text(material.format(r"sub\a%20b.png"))
    (tmp_path / "sub").mkdir()
    picture = content[signature : content.find(b"IEND") + 8]
    (tmp_path / "sub/a b.png").write_bytes(picture)
    assert len(read_mesh(tmp_path / "x.obj").textures) == 1
    assert capfd.readouterr() == ("", "")


def test_what_is_too_large_is_refused(tmp_path, monkeypatch):
    BOX.export(tmp_path / "box.ply")
    monkeypatch.setattr(mesh_file, "MOST_TRIANGLES", 11)
    with pytest.raises(
        InputError, match=r"box.ply: has 12 triangles; at most 11: simplify .decimate."
    ):
        read_mesh(tmp_path / "box.ply")
    with (tmp_path / "huge.ply").open("wb") as file:
        file.truncate(mesh_file.LARGEST + 1)
    with pytest.raises(InputError, match=r"huge.ply: is larger than 100 MB: simplify"):
        read_mesh(tmp_path / "huge.ply")


@pytest.mark.parametrize("name", ["../{}", "{folder}/{}", "sub/../../{}", "file://{folder}/{}"])
def test_nothing_outside_of_the_folder_is_read(tmp_path, name):
    """Neither a texture, nor a material, nor a buffer; a file of that name next to it is taken."""
    mesh = tmp_path / "mesh"
    mesh.mkdir()
    red, green = (picture(np.full((4, 4, 3), c)) for c in ([255, 0, 0], [0, 255, 0]))
    red.save(tmp_path / "t.png")
    (tmp_path / "b.bin").write_bytes(bytes(36))
    texture, buffer = (name.format(reference, folder=tmp_path) for reference in ("t.png", "b.bin"))
    (mesh / "m.mtl").write_text(f"newmtl m\nmap_Kd {texture}\n")
    (mesh / "x.obj").write_text(f"mtllib m.mtl\n{TRIANGLE}usemtl m\nf 1/1 2/2 3/3\n")
    (mesh / "x.gltf").write_text(
        json.dumps({"asset": {"version": "2.0"}, "buffers": [{"uri": buffer, "byteLength": 36}]})
    )
    for kind in ("obj", "gltf"):
        with pytest.raises(InputError, match="is outside of its folder: put it next to the mesh$"):
            read_mesh(mesh / f"x.{kind}")
    green.save(mesh / "t.png")
    assert read_mesh(mesh / "x.obj").textures[0][0, 0].tolist() == [0, 255, 0]


def test_large_textures_are_halved_and_held_once(tmp_path, monkeypatch):
    """Three bodies share a picture of 64 x 32 texels; a third of that is allowed, half a side."""
    stream = np.random.default_rng(3)
    pixels = stream.integers(0, 255, (32, 64, 3), np.uint8)
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=picture(pixels))
    scene = trimesh.Scene()
    for k in range(3):
        body = trimesh.creation.box((1, 1, 1)).apply_translation((3 * k, 0, 0))
        body.visual = trimesh.visual.TextureVisuals(uv=body.vertices[:, :2], material=material)
        scene.add_geometry(body)
    scene.export(tmp_path / "x.glb")
    (texture,) = read_mesh(tmp_path / "x.glb").textures
    assert np.array_equal(texture, pixels)
    monkeypatch.setattr(mesh_textures, "MOST_TEXELS", 32 * 36 + 700)
    (texture,) = read_mesh(tmp_path / "x.glb").textures
    means = pixels.reshape(16, 2, 32, 2, 3).mean(axis=(1, 3))
    assert np.abs(texture - means).max() <= 0.5
    monkeypatch.setattr(mesh_textures, "LARGEST", 2000)
    with pytest.raises(InputError, match=r"a texture is too large: 64 x 32 texels; at most"):
        read_mesh(tmp_path / "x.glb")


def test_a_file_that_promises_too_much_is_not_believed(tmp_path):
    """Before the loader makes room for it."""
    tree = {"accessors": [{"componentType": 5126, "count": 10**12, "type": "VEC3"}]}
    (tmp_path / "x.glb").write_bytes(gltf(**tree))
    (tmp_path / "x.ply").write_text(PLY + FACE.replace("face 1", "face 99999999") + "0 0 0\n")
    (tmp_path / "x.stl").write_bytes(bytes(80) + b"\xff\xff\xff\xff" + bytes(50))
    for kind in ("glb", "ply", "stl"):
        with pytest.raises(InputError, match=r"has [\d,]+ triangles; at most 800,000: simplify"):
            read_mesh(tmp_path / f"x.{kind}")
    with (tmp_path / "x.obj").open("wb") as file:
        file.truncate((50 << 20) + 1)
    with pytest.raises(InputError, match="is larger than 50 MB, as text: write it as a binary"):
        read_mesh(tmp_path / "x.obj")


MEMORY = """
import sys
import numba, PIL.JpegImagePlugin, scipy.spatial, trimesh
from imu_sim_ros.places.mesh_file import read_mesh
from imu_sim_ros.sensors.camera.images import loops
from imu_sim_ros.sensors.camera.images.mesh_look import Look

def kilobytes(name):
    return int(next(line for line in open("/proc/self/status") if name in line).split()[1])

libraries = kilobytes("VmRSS")
mesh = read_mesh(sys.argv[1])
look = Look(mesh, mesh.vertices.mean(axis=0), colour=True, sun=False)
print(kilobytes("VmHWM") - libraries)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux counts the peak")
def test_the_largest_texture_fits_into_the_memory(tmp_path):
    """8192 x 8192 in colour take 4 bytes each in Pillow and 3 for each fourth in the mesh: 304 MiB.

    A second copy of the whole in three bytes would be 192 MiB more. Libraries do not count: how
    much of their files is in memory depends on the machine.
    """
    image = Image.new("RGB", (8192, 8192), (200, 100, 50))
    image.save(tmp_path / "t.jpg")
    (tmp_path / "m.mtl").write_text("newmtl m\nmap_Kd t.jpg\n")
    (tmp_path / "x.obj").write_text(f"mtllib m.mtl\n{TRIANGLE}usemtl m\nf 1/1 2/2 3/3\n")
    command = [sys.executable, "-c", MEMORY, str(tmp_path / "x.obj")]
    kilobytes = int(subprocess.run(command, check=True, capture_output=True).stdout)
    assert 300e3 < kilobytes < 400e3


@pytest.mark.parametrize("library", ["trimesh", "PIL", "embreex.rtcore_scene"])
def test_a_library_that_is_missing_is_named(tmp_path, monkeypatch, library):
    BOX.export(tmp_path / "box.ply")
    mesh = read_mesh(tmp_path / "box.ply")
    for name in [n for n in sys.modules if n == library or n.startswith(f"{library}.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MissingDependencyError, match="pip install trimesh pillow embreex"):
        MeshCaster(mesh) if "embreex" in library else read_mesh(tmp_path / "box.ply")
