# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A walk made by a formula, as a motion capture would record it: ``python walk.py walk.bvh``.

Every joint swings with the stride, one stride a second, so that all angles are known at any time.
The skeleton stands with hanging arms, y up, z forward, in centimetres.
"""

import sys

import numpy as np

STRIDE = 1.0
"""Strides per second [Hz]."""
SPEED = 130.0  # cm/s
FRAMES_PER_SECOND = 60
SKELETON = {
    "Hips": (None, (0.0, 0.0, 0.0)),
    "Spine": ("Hips", (0.0, 12.0, 0.0)),
    "Head": ("Spine", (0.0, 45.0, 0.0)),
    "LeftArm": ("Spine", (18.0, 38.0, 0.0)),
    "LeftForeArm": ("LeftArm", (0.0, -30.0, 0.0)),
    "LeftHand": ("LeftForeArm", (0.0, -26.0, 0.0)),
    "RightArm": ("Spine", (-18.0, 38.0, 0.0)),
    "RightForeArm": ("RightArm", (0.0, -30.0, 0.0)),
    "RightHand": ("RightForeArm", (0.0, -26.0, 0.0)),
    "LeftUpLeg": ("Hips", (9.0, -4.0, 0.0)),
    "LeftLeg": ("LeftUpLeg", (0.0, -43.0, 0.0)),
    "LeftFoot": ("LeftLeg", (0.0, -42.0, 0.0)),
    "RightUpLeg": ("Hips", (-9.0, -4.0, 0.0)),
    "RightLeg": ("RightUpLeg", (0.0, -43.0, 0.0)),
    "RightFoot": ("RightLeg", (0.0, -42.0, 0.0)),
}
"""Parent and offset [cm] of each segment."""
ENDS = {
    "Head": (0.0, 25.0, 0.0),
    "LeftHand": (0.0, -18.0, 0.0),
    "RightHand": (0.0, -18.0, 0.0),
    "LeftFoot": (0.0, -4.0, 14.0),
    "RightFoot": (0.0, -4.0, 14.0),
}
"""Ends of the last segments [cm]."""


def angles(segment, t):
    """Return the rotations z, x, y (n, 3) of a segment against its parent [deg] at times t (n,).

    Bending an elbow is a negative rotation about x, the axis to the left, bending a knee a
    positive one.
    """
    phase = 2.0 * np.pi * STRIDE * np.asarray(t, float)
    if segment.startswith("Right"):
        phase = phase + np.pi
    swing, twice = np.cos(phase), np.cos(2.0 * phase - 0.8)
    zeros = np.zeros_like(phase)
    about_z, about_x, about_y = {
        "Hips": (2.0 * np.sin(phase), 3.0 + twice, 4.0 * swing),
        "Spine": (-1.5 * np.sin(phase), 1.5 * twice, -7.0 * swing),
        "Head": (zeros, -2.0 * twice, 3.0 * swing),
        "Arm": (4.0 + zeros, 18.0 * swing - 3.0, 5.0 * swing),
        "ForeArm": (zeros, -22.0 + 12.0 * swing, zeros),
        "Hand": (3.0 * swing, 5.0 * twice, zeros),
        "UpLeg": (zeros, -8.0 - 24.0 * swing, 2.0 * swing),
        "Leg": (zeros, 24.0 + 20.0 * np.sin(phase - 0.4) - 12.0 * twice, zeros),
        "Foot": (zeros, -4.0 + 12.0 * np.sin(phase + 1.0), zeros),
    }[segment.removeprefix("Left").removeprefix("Right")]
    return np.column_stack([about_z, about_x, about_y])


def hips(t):
    """Return the positions x, y, z (n, 3) of the hips [cm] at times t (n,)."""
    phase = 2.0 * np.pi * STRIDE * np.asarray(t, float)
    return np.column_stack([2.0 * np.sin(phase), 95.0 + 2.0 * np.cos(2.0 * phase), SPEED * t])


def joint(segment, depth=0):
    """Yield the lines of a segment and of those that hang on it."""
    tab = "\t" * depth
    parent, offset = SKELETON[segment]
    positions = "" if parent else "Xposition Yposition Zposition "
    yield f"{tab}{'JOINT' if parent else 'ROOT'} {segment}"
    yield tab + "{"
    yield f"{tab}\tOFFSET {offset[0]:g} {offset[1]:g} {offset[2]:g}"
    yield f"{tab}\tCHANNELS {3 if parent else 6} {positions}Zrotation Xrotation Yrotation"
    for child in SKELETON:
        if SKELETON[child][0] == segment:
            yield from joint(child, depth + 1)
    if segment in ENDS:
        end = " ".join(f"{value:g}" for value in ENDS[segment])
        yield from (f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\tOFFSET {end}", f"{tab}\t}}")
    yield tab + "}"


def write(path, seconds=20.0):
    """Write a walk of some seconds."""
    t = np.arange(round(seconds * FRAMES_PER_SECOND) + 1) / FRAMES_PER_SECOND
    order = [line.split()[1] for line in joint("Hips") if "ROOT" in line or "JOINT" in line]
    rows = np.column_stack([hips(t), *(angles(segment, t) for segment in order)])
    with open(path, "w", encoding="ascii") as file:
        file.write("HIERARCHY\n" + "\n".join(joint("Hips")) + "\nMOTION\n")
        file.write(f"Frames: {len(t)}\nFrame Time: {1.0 / FRAMES_PER_SECOND:.7f}\n")
        np.savetxt(file, rows, "%.6f")


if __name__ == "__main__":
    write(sys.argv[1] if len(sys.argv) > 1 else "walk.bvh")
