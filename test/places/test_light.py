# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Light against closed forms."""

import math

import numpy as np
import pytest

from imu_sim_ros.places.geometry import surfaces
from imu_sim_ros.places.light import Lamp, Lighting, bake, factors

FLOOR = (np.array([-2.0, -2, 0]), np.array([4.0, 0, 0]), np.array([0.0, 4, 0]))


def baked(rectangles, albedo, lighting):
    where = surfaces(rectangles, hides=True)
    shares = np.full((len(rectangles), 3), albedo)
    return bake(where, shares, np.zeros(len(rectangles), np.bool_), lighting).total


def form_factor(a, b, h):
    """Return the form factor of a rectangle a x b at height h, a corner above (Howell, B-3)."""
    x, y = a / h, b / h
    u, v = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    return (x / u * math.atan(y / u) + y / v * math.atan(x / v)) / (2 * math.pi)


def test_a_lamp_lights_a_point_below_it_as_its_form_factor_says():
    """A square of 0.6 m, 2.5 m above: four points stand for it with an error below 1 %."""
    lamp = (np.array([-0.3, 0.3, 2.5]), np.array([0.6, 0, 0]), np.array([0.0, -0.6, 0]))
    [light] = baked([FLOOR], 0.0, Lighting([Lamp(lamp, (2.0, 1.0, 0.0))]))
    rows, columns = light.shape[:2]
    middle = light[rows // 2 - 1 : rows // 2 + 1, columns // 2 - 1 : columns // 2 + 1].mean((0, 1))
    expected = 4.0 * form_factor(0.3, 0.3, 2.5)
    assert middle[1] == pytest.approx(expected, rel=0.01)
    assert middle[0] == pytest.approx(2.0 * middle[1], rel=1e-5)
    assert middle[2] == 0.0
    corner = light[0, 0, 1] / middle[1]  # cos^4 of the angle, for a small lamp
    assert corner == pytest.approx((2.5**2 / (2.5**2 + 2 * 1.95**2)) ** 2, rel=0.03)


def test_gloss_has_the_light_of_lamps_at_any_distance():
    """A lobe multiplies it by 1025: cut off at 1e-3, highlights of a corridor ended at once.

    To a small lamp at a height h over a floor ``E = A h^2 / (pi r^4)``, to 0.5 % beyond 8 m.
    """
    floor = (np.array([0.0, -1.0, 0.0]), np.array([40.0, 0, 0]), np.array([0.0, 2.0, 0]))
    lamp = (np.array([-0.1, 0.1, 2.5]), np.array([0.2, 0, 0]), np.array([0.0, -0.2, 0]))
    where, mirror_mask = surfaces([floor], hides=True), np.zeros(1, np.bool_)
    lighting = Lighting([Lamp(lamp, (1.0, 1.0, 1.0))])
    for mirrors in (~mirror_mask, mirror_mask):
        light = bake(where, np.zeros((1, 3)), mirror_mask, lighting, mirrors=mirrors).sources[0][0]
        rows, columns = light.shape
        x = (np.arange(columns) + 0.5) * 40.0 / columns
        y = (np.arange(rows) + 0.5) * 2.0 / rows - 1.0
        square = x**2 + y[:, None] ** 2 + 2.5**2
        distant = np.broadcast_to(x > 8.0, light.shape)
        if mirrors[0]:
            expected = 0.04 * 2.5**2 / (np.pi * square**2)
            assert np.abs(light / expected - 1.0)[distant].max() < 0.005
        else:
            assert not light[distant & (square > 250.0)].any()


def test_a_lamp_gives_no_light_backwards_nor_through_a_board():
    lamp = (np.array([-0.3, -0.3, 2.5]), np.array([0.6, 0, 0]), np.array([0.0, 0.6, 0]))
    [irradiance] = baked([FLOOR], 0.5, Lighting([Lamp(lamp, (1.0, 1.0, 1.0))]))
    assert not irradiance.any()
    board = (np.array([0.0, -2, 1.0]), np.array([2.0, 0, 0]), np.array([0.0, 4, 0]))
    down = (lamp[0] + lamp[2], lamp[1], -lamp[2])
    [floor, _] = baked([FLOOR, board], 0.0, Lighting([Lamp(down, (1.0, 1.0, 1.0))]))
    columns = floor.shape[1]
    assert not floor[:, 3 * columns // 4 :].any()
    assert floor[:, : columns // 4].min() > 0.0
    edge = floor[floor.shape[0] // 2, :, 1]
    assert len(np.unique(edge[columns // 3 : 2 * columns // 3])) > 3  # soft, not a step


def test_the_sun_lights_with_the_cosine_and_only_through_windows():
    to_sun = (0.6, 0.0, 0.8)
    [open_air] = baked([FLOOR], 0.0, Lighting((), to_sun, (1.0, 1.0, 1.0)))
    assert open_air == pytest.approx(0.8, abs=1e-6)
    window = (np.array([2.0, -0.5, 1.0]), np.array([0.0, 1.0, 0]), np.array([0.0, 0, 1.0]))
    [indoors] = baked([FLOOR], 0.0, Lighting((), to_sun, (1.0, 1.0, 1.0), [window]))
    rows, columns = indoors.shape[:2]
    x = (np.arange(columns) + 0.5) / columns * 4.0 - 2.0
    y = (np.arange(rows) + 0.5) / rows * 4.0 - 2.0
    # A ray from (x, y, 0) passes x = 2 at the height (2 - x) 0.8 / 0.6.
    height = (2.0 - x) * 0.8 / 0.6
    expected = ((np.abs(y) < 0.5)[:, None] & (height > 1.0) & (height < 2.0)) * 0.8
    off_edge = (np.abs(np.abs(y) - 0.5)[:, None] > 0.05) & (
        np.abs(np.abs(height - 1.5) - 0.5) > 0.05
    )
    assert np.abs(indoors[..., 0] - expected)[off_edge].max() < 1e-6
    assert expected.any()


def test_a_closed_box_multiplies_light_by_the_sum_of_its_bounces():
    """Every wall gets the same from a sky that all see: 1 + rho + ... + rho^k of the first."""
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    o, x, y, z = (np.array(c, float) for c in corners)
    walls = [(o, x, y), (o + z, y, x), (o, y, z), (o + x, z, y), (o, z, x), (o + y, x, z)]
    lamp = (o + z - [0, 0, 1e-3], y, x)
    result = baked(walls, 0.5, Lighting([Lamp(lamp, (1.0, 1.0, 1.0))]))
    # Power: what six walls of albedo 1/2 receive is what the lamp gives, over 1 - 1/2, but for the
    # bounces after the fourth (2^-5) and the part of the lamp's own light that four points miss.
    direct = baked(walls, 0.0, Lighting([Lamp(lamp, (1.0, 1.0, 1.0))]))
    total, direct_mean = (
        sum(float(w[..., 0].mean()) for w in factors_of) for factors_of in (result, direct)
    )
    assert total == pytest.approx(direct_mean * (2.0 - 2.0**-4), rel=0.03)


def test_corners_are_darker_than_the_middle_of_a_wall_under_the_sky():
    wall = (np.array([2.0, -2, 0]), np.array([0.0, 4, 0]), np.array([0.0, 0, 3]))
    lighting = Lighting(sky=(1.0, 1.0, 1.0))
    [alone] = baked([FLOOR], 0.0, lighting)
    assert alone == pytest.approx(1.0, abs=1e-6)
    [floor, _] = baked([FLOOR, wall], 0.0, lighting)
    middle = floor[len(floor) // 2, :, 0]
    assert middle[-1] < 0.62  # half the sky, and a little for the grid's width
    assert middle[0] > 0.9


def test_the_film_is_linear_in_the_dark_and_tends_to_white():
    light = np.linspace(0.0, 8.0, 500, dtype=np.float32)
    film = factors(light)
    dark = (light > 0.01) & (light < 0.5)
    # The table's steps are 1/1024: half of one at 0.01 is 5 %, 2 % after the root.
    assert np.abs(film[dark] / light[dark] ** (1 / 2.2) - 1.0).max() < 0.025
    assert (np.diff(film) >= 0.0).all()
    assert film[-1] == pytest.approx(1.08 ** (1 / 2.2), abs=1e-3)
