# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Materials repeat without a seam, at their size, in their colour; prints are what they are."""

import numpy as np
import pytest
from scipy import ndimage

from imu_sim_ros.places.light import Lighting
from imu_sim_ros.places.materials import _KINDS, WEAR_PERIODS, colour_of, stains, tile, wear
from imu_sim_ros.places.paint import Painter
from imu_sim_ros.places.place import Place, PlaceBuilder, Site
from imu_sim_ros.places.prints import PRINTS, picture
from imu_sim_ros.places.sheet import Print


@pytest.mark.parametrize("kind", sorted(_KINDS))
def test_a_tile_has_its_colour_and_no_seam(kind):
    period = _KINDS[kind][2]
    values = tile(kind, period / 200.0, 3, 1.0).astype(float)
    assert values.shape == (200, 200, 3)
    # Joints and pores are darker: the mean is within 24 grey values of the colour, clouds aside.
    if kind != "sky":
        assert np.abs(values.mean(axis=(0, 1)) - colour_of(kind)).max() < 24.0
    grey = values.mean(axis=2)
    for axis in (0, 1):
        interior_step = np.abs(np.diff(grey, axis=axis)).mean()
        seam = np.abs(np.take(grey, 0, axis) - np.take(grey, -1, axis)).mean()
        rows = np.abs(np.diff(grey, axis=axis)).mean(axis=1 - axis)
        assert seam <= max(1.5 * rows.max(), interior_step + 1.0)


def test_bricks_have_their_size():
    """Rows of 83.3 mm: 24 in 2 m, so the mortar's frequency is 24 in the tile."""
    values = tile("brick", 0.004, 1, 1.0).astype(float).mean(axis=2)
    spectrum = np.abs(np.fft.rfft(values.mean(axis=1) - values.mean()))
    assert int(np.argmax(spectrum)) == 24


def test_seed_colour_and_contrast_decide():
    reference = tile("concrete", 0.02, 1, 1.0)
    assert np.array_equal(reference, tile("concrete", 0.02, 1, 1.0))
    assert not np.array_equal(reference, tile("concrete", 0.02, 2, 1.0))
    blank = tile("concrete", 0.02, 1, 0.25)
    assert blank.std() < 0.4 * reference.std()
    red = tile("paint:c02020", 0.02, 1, 1.0).mean(axis=(0, 1))
    assert red[0] > 180.0 > 50.0 > red[1]


DRAWN = {
    *("poster", "notices", "whiteboard", "books", "screen", "window", "night", "label", "paper"),
    *("door", "exit", "cartons", "panel", "number", "glass", "shop", "bumper", "wheel"),
    *("bolts", "book", "cables", "places", "plan"),
}
"""Prints that differ from one to the next; the others are all alike."""


@pytest.mark.parametrize("kind", sorted(PRINTS))
def test_a_print_fills_its_size_and_follows_its_number(kind):
    what = Print(kind, 0.0, 0.0, 1.2, 0.8, 1)
    image = picture(what, (0.01, 0.01), 5)
    assert image.shape == (80, 120, 3)
    assert picture(what, (0.01, 0.02), 5).shape == (80, 60, 3)
    assert np.array_equal(image, picture(what, (0.01, 0.01), 5))
    variants = [picture(what._replace(number=k), (0.01, 0.01), 5) for k in range(2, 5)]
    assert all(np.array_equal(image, variant) for variant in variants) == (kind not in DRAWN)
    if kind in ("grid", "door", "doors", "window", "books"):
        assert np.ptp(image.astype(int)) > 80


@pytest.mark.parametrize("period", WEAR_PERIODS)
def test_wear_has_no_seam_and_no_mean(period):
    layer = wear("concrete", stains(period, 0.01, 3), 1.0).astype(float)
    # About 20,000 knots of at most 8 grey values each: the mean's deviation is below 0.1.
    assert abs(layer.mean()) < 0.4 < layer.std()
    for axis in (0, 1):
        seam = np.abs(np.take(layer, 0, axis) - np.take(layer, -1, axis)).mean()
        assert seam <= 1.5 * np.abs(np.diff(layer, axis=axis)).mean(axis=1 - axis).max()


def test_a_surface_does_not_repeat():
    """After a period of the tile only the tile is the same, after one of wear only that layer."""
    low, high, texel = np.zeros(3), np.array([13.0, 9.0, 3.0]), 0.02
    site = Site(low, high, np.empty((0, 3)), texture="rich")
    builder = PlaceBuilder(site)
    builder.face((0, 0, 0), (13, 0, 0), (0, 9, 0), "flecked")
    place = Place(tuple(builder.faces), Lighting(sky=(1.0, 1.0, 1.0)), low, high, site.path)
    texture = Painter(place, site).texture(0, 450, 650, texel, colour=False).astype(float)
    texture -= ndimage.uniform_filter(texture, 25)  # without the light
    for period in (_KINDS["flecked"][2], *WEAR_PERIODS):
        n = round(period / texel)
        alike = np.corrcoef(texture[:, n:].ravel(), texture[:, :-n].ravel())[0, 1]
        assert alike < 0.85, period
