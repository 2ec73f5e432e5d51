# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Meshes that tests make, and an independent ray caster."""

import io

import numpy as np
import trimesh
from PIL import Image

_PAIRS = 20_000
"""Rays times triangles that are looked at together."""
UNIT = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def met(corners, origins, directions):
    """Return the least distance and the triangle (n,) of rays: Moeller and Trumbore, 1997.

    :param corners: (m, 3, 3).
    """
    best, number = np.full(len(origins), np.inf), np.full(len(origins), -1)
    rays, ways = np.arange(len(origins)), directions[:, None]
    size = max(1, _PAIRS // len(origins))
    for k in range(0, len(corners), size):
        a, b, c = corners[k : k + size].transpose(1, 0, 2)
        edge_b, second = b - a, c - a
        p = np.cross(ways, second)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1.0 / (p * edge_b).sum(axis=2)
            offset = origins[:, None] - a
            u = (offset * p).sum(axis=2) * inverse
            q = np.cross(offset, edge_b)
            v = (ways * q).sum(axis=2) * inverse
            t = (q * second).sum(axis=2) * inverse
        t[~((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-9))] = np.inf
        nearest = t.argmin(axis=1)
        t = t[rays, nearest]
        nearer = t < best
        best[nearer], number[nearer] = t[nearer], k + nearest[nearer]
    return best, number


def quads(*rectangles):
    """Return vertices, faces, u and v of rectangles (origin, across, up)."""
    vertices, faces, places = [], [], []
    for origin, across, up in np.asarray(rectangles, float):
        vertex = 4 * len(places)
        vertices += [origin, origin + across, origin + across + up, origin + up]
        faces += [[vertex, vertex + 1, vertex + 2], [vertex, vertex + 2, vertex + 3]]
        places.append(UNIT)
    return np.array(vertices), np.array(faces), np.concatenate(places)


def picture(pixels):
    """Return an image as files hold it."""
    content = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(content, "PNG")
    return Image.open(io.BytesIO(content.getvalue()))


def textured(vertices, faces, places, pixels):
    """Return a mesh with a texture."""
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=picture(pixels))
    visual = trimesh.visual.TextureVisuals(uv=places, material=material)
    return trimesh.Trimesh(vertices, faces, visual=visual, process=False)


def checkerboard(columns, rows, texels):
    """Return grey values (h, w, 3) of squares, black in the lower left."""
    row, column = np.indices((rows, columns))
    squares = np.where((row + column) % 2, 255, 0)[::-1]
    grey = squares.repeat(texels, axis=0).repeat(texels, axis=1)
    return np.repeat(grey[..., None], 3, axis=2)


def room(folder, name="room.ply", size=(14.0, 14.0, 6.0), divisions=2):
    """Write a box around the origin with colours of its own, and return its path."""
    box = trimesh.creation.box(size)
    for _ in range(divisions):
        box = box.subdivide()
    colours = (128 + 100 * np.sin(2.0 * box.vertices)).clip(0, 255).astype(np.uint8)
    mesh = trimesh.Trimesh(box.vertices, box.faces, vertex_colors=colours, process=False)
    mesh.export(folder / name)
    return folder / name
