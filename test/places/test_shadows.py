# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shadows of bodies against closed forms."""

import numpy as np
import pytest

from imu_sim_ros.places.geometry import surfaces
from imu_sim_ros.places.light import Lighting
from imu_sim_ros.places.shadows import Shadow, sunlight
from imu_sim_ros.sensors.camera.images.loops import light_share


def box(x, y, height):
    """Return two upright rectangles that span a box around the origin."""
    wide = np.array([-x, -y, 0.0]), np.array([2 * x, 0.0, 0]), np.array([0.0, 0, height])
    deep = np.array([x, -y, 0.0]), np.array([0.0, 2 * y, 0]), np.array([0.0, 0, height])
    return surfaces([wide, deep], hides=True)


def test_a_shadow_begins_at_the_foot_and_ends_below_the_sun():
    """The head's shadow is h / tan(height of the sun) from the foot, away from the sun."""
    shadow = Shadow.of(box(0.1, 0.25, 1.75))
    assert (shadow.below.start + shadow.below.end).tolist() == [0.0, 0.0]
    assert shadow.below.length == pytest.approx(2 * (0.25 - 0.1))
    thrown = shadow.shadow_line(np.array([0.48, 0.36, 0.8]), 0.7)
    assert thrown.start.tolist() == [0.0, 0.0]
    assert thrown.end == pytest.approx([-1.75 * 0.6, -1.75 * 0.45])
    floor = thrown.floor()
    for place, transmittance in ((thrown.start, 0.3), (thrown.end, 0.3), (2 * thrown.end, 1.0)):
        offset = np.append(place, 0.0) - floor.origin[0]
        coordinates = [offset @ side[0] / (side[0] @ side[0]) for side in (floor.across, floor.up)]
        line = (thrown.length, thrown.radius, thrown.depth)
        transmitted = light_share(*np.array([*coordinates, *line], np.float32))
        assert transmitted == pytest.approx(transmittance, abs=1e-5)


def test_the_sun_throws_shadows_under_the_open_sky_only():
    roof = surfaces([(np.array([0.0, 0, 3]), np.array([2.0, 0, 0]), np.array([0.0, 2, 0]))], True)
    lighting = Lighting((), (0.6, 0.0, 0.8), (2.0, 2.0, 2.0), (), (0.4, 0.4, 0.4))
    assert sunlight(roof, np.array([False]), lighting) is None
    dome = surfaces(
        [(np.array([-9.0, -9, 9]), np.array([18.0, 0, 0]), np.array([0.0, 18, 0]))], True
    )
    both = surfaces([tuple(part[0] for part in group[:3]) for group in (roof, dome)], True)
    sun = sunlight(both, np.array([False, True]), lighting)
    # The roof's shadow lies 3 * 0.6 / 0.8 = 2.25 m from below it.
    assert [sun.share(np.array([x, 1.0, 0])) for x in (-2.3, -2.2, -0.3, -0.2)] == [
        pytest.approx(0.8), 0.0, 0.0, pytest.approx(0.8)
    ]  # fmt: skip
