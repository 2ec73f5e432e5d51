# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gloss against closed forms."""

import numpy as np
import pytest

from imu_sim_ros.places.gloss import normal_reflectance, reflectance
from imu_sim_ros.places.light import Lamp, Lighting
from imu_sim_ros.places.paint import Painter
from imu_sim_ros.places.place import Place, PlaceBuilder, Site
from imu_sim_ros.places.sheet import Print
from imu_sim_ros.sensors.camera.images.loops import light_at, shine

SITE = Site(np.zeros(3), np.array([4.0, 4.0, 3.0]), np.zeros((0, 3)))


def wall(material, prints=(), lamps=()):
    """Return the polish of a wall at x = 4 that is seen from the left, and its place."""
    builder = PlaceBuilder(SITE)
    builder.face((4.0, 4.0, 0.0), (0, -4.0, 0), (0, 0, 3.0), material, prints)
    lighting = Lighting(lamps, sky=(0.2, 0.2, 0.2))
    place = Place(tuple(builder.faces), lighting, SITE.low, SITE.high, np.zeros((0, 3)))
    return Painter(place, SITE).polish(colour=False)


def fresnel(cosine, index):
    """Return the reflectance for light that is not polarised."""
    sine = np.sqrt(1.0 - cosine**2) / index
    refracted_cosine = np.sqrt(1.0 - sine**2)
    parallel = (index * cosine - refracted_cosine) / (index * cosine + refracted_cosine)
    across = (cosine - index * refracted_cosine) / (cosine + index * refracted_cosine)
    return 0.5 * (parallel**2 + across**2)


@pytest.mark.parametrize("index", [1.33, 1.5, 1.52])
def test_the_reflectance_is_that_of_fresnels_equations(index):
    cosine = np.linspace(0.01, 1.0, 200, dtype=np.float32)
    schlick = reflectance(cosine, normal_reflectance(index))
    assert schlick[-1] == pytest.approx(((index - 1.0) / (index + 1.0)) ** 2, rel=1e-6)
    error = np.abs(schlick - fresnel(cosine, index))  # of Schlick's approximation
    assert error[cosine > 0.8].max() < 0.005
    assert error.max() < 0.06


def added(polish, eye, place, lit=(False,)):
    """Return what gloss keeps of a square at s and r of the wall, and adds to it."""
    foot = np.array([(4.0 - eye[1]) / 4.0, eye[2] / 3.0], np.float32)
    height, result = np.float32(4.0 - eye[0]), np.zeros(1, np.float32)
    coordinates = tuple(np.array(place, np.float32))
    keep = shine(result, polish.sheen, 0, np.array(lit), coordinates, tuple(foot), height)
    return keep, float(result[0])


def test_glass_seen_square_on_mirrors_what_fresnel_says_of_its_surroundings():
    polish = wall("plaster", [Print("glass", 1.0, 0.5, 2.0, 2.0)])
    keep, gloss = added(polish, (2.0, 2.0, 1.5), (0.5, 0.5))
    share = (0.52 / 2.52) ** 2
    assert keep == pytest.approx(1.0 - share, rel=1e-6)
    surroundings = gloss / share  # the wall itself, plaster of e6e4de
    level = 228.0**2 * 0.55 ** (2.0 / 2.2)  # in the light that half of it exceeds
    assert surroundings == pytest.approx(level, rel=0.1)


def test_only_what_is_glossy_is_polished():
    assert wall("plaster") is None
    assert wall("concrete", [Print("poster", 1.0, 0.5, 1.0, 1.0)]) is None
    panes = wall("brick", [Print("glass", 1.0, 0.5, 2.0, 2.0)])
    (bounds,) = panes.sheen.regions["bounds"]  # within a frame of 6 or 7 cm
    assert bounds == pytest.approx([1.07 / 4.0, 0.56 / 3.0, 2.93 / 4.0, 2.43 / 3.0])


def test_the_lobe_of_a_lamp_keeps_its_power_at_any_angle():
    """The radiance in the mirrored direction is F x / (1 + x) with x = (n + 2) / 2 E / cos."""
    lamp = Lamp(
        (np.array([0.01, 2.9, 1.4]), np.array([0, 0.2, 0]), np.array([0, 0, 0.2])), (300.0,) * 3
    )
    polish = wall("tiles", (), [lamp])
    for y in (1.0, 0.2):  # the mirrored lamp is as far behind the wall as the camera is before it
        eye = np.array([0.01, y, 1.5])
        middle = 0.5 * (3.0 + y)
        place = (4.0 - middle) / 4.0, 0.5
        lit, dark = (
            added(polish, eye, place, (switched_on, False))[1] for switched_on in (True, False)
        )
        cosine = 3.99 / np.hypot(3.99, middle - y)
        coordinates = np.array(place, np.float32)
        light = light_at(polish.sheen.light, polish.sheen.faces[0], 0, *coordinates)
        power = 1025.0 * light / cosine
        expected = reflectance(np.float32(cosine), 0.04) * power / (1.0 + power)
        assert light > 0.0
        lobe = (lit - dark) / polish.sheen.sources["colour"][0, 0]
        assert lobe == pytest.approx(expected, rel=1e-3)
