# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion captures with a closed form: a skeleton as BVH, and a tumbling body as C3D by ezc3d."""

import numpy as np

from imu_sim_ros.core import rotation

BODY = np.array([[40.0, 0.0, 0.0], [-30.0, 25.0, 10.0], [0.0, -35.0, 20.0], [10.0, 5.0, -45.0]])
"""(4, 3) markers on a body [mm]."""


def bvh(skeleton, rows, interval="0.01", frames=None):
    """Return the text of a BVH file.

    :param skeleton: lines of the hierarchy.
    :param rows: (n, m) values of the channels.
    """
    lines = [*skeleton, "MOTION", f"Frames: {len(rows) if frames is None else frames}"]
    lines += [f"Frame Time: {interval}", *(" ".join(f"{x:.6f}" for x in row) for row in rows)]
    return "\n".join(lines) + "\n"


def tumbling(t):
    """Return positions (n, 3) [mm] and attitudes q (n, 4) of a body that tumbles along a line."""
    position = np.column_stack(
        [500.0 * t, 200.0 * np.sin(2.0 * t), 1000.0 + 100.0 * np.cos(3.0 * t)]
    )
    return position, rotation.exp(np.column_stack([np.sin(t), 0.5 * t, 0.3 * np.cos(2.0 * t)]))


def markers(t, body=BODY):
    """Return the markers (n, m, 3) of the tumbling body [mm]."""
    position, q = tumbling(t)
    return position[:, None] + rotation.rotate(q[:, None], body[None])


def c3d(path, rate, points=None, rotations=None, units="mm", up="+Z", **parameters):
    """Write a C3D file.

    :param points: markers (n, 3) by label, NaN where they are not seen; None: none.
    :param rotations: poses (n, 4, 4) by label.
    :param parameters: further ones of POINT.
    """
    import ezc3d  # tests of BVH do not need it

    file = ezc3d.c3d()
    if not points:  # ezc3d writes no rotations without a marker
        points = {"origin": np.zeros((len(next(iter(rotations.values()))), 3))}
    file["parameters"]["POINT"]["RATE"]["value"] = [rate]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(points)
    columns = np.stack(list(points.values()))
    values = np.ones((4, *columns.shape[:2]))
    values[:3] = np.moveaxis(columns, 2, 0)
    file["data"]["points"] = values
    if units:
        file.add_parameter("POINT", "UNITS", [units])
    if up:
        file.add_parameter("POINT", "X_SCREEN", ["+X"])
        file.add_parameter("POINT", "Y_SCREEN", [up])
    for name, value in parameters.items():
        file.add_parameter("POINT", name, value)
    if rotations:
        file.add_parameter("ROTATION", "RATE", [float(rate)])
        file.add_parameter("ROTATION", "LABELS", list(rotations))
        file["data"]["rotations"] = np.moveaxis(np.stack(list(rotations.values())), (0, 1), (2, 3))
    file.write(str(path))
    return path
