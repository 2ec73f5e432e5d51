# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Targets of a LiDAR's rays: surfaces, their reflectivity, and glass."""

from typing import TYPE_CHECKING

import numpy as np

from imu_sim_ros.core.types import Array, Mask
from imu_sim_ros.places.gloss import panes
from imu_sim_ros.places.materials import reflectance
from imu_sim_ros.places.rays import Traced

if TYPE_CHECKING:
    from imu_sim_ros.sensors.camera.scene import Scene


class Targets:
    """A scene with its moving bodies, for lidars."""

    def __init__(self, scene: "Scene", reflectivity: float) -> None:
        """Initialise with a scene.

        :param reflectivity: reflectivity of surfaces whose material is not known.
        """
        place = scene.painter.place if scene.painter is not None else None
        bodies = scene.crowd.bodies if scene.crowd is not None else ()
        self._surfaces = scene.surfaces
        self._panes = panes(place.faces, scene.surfaces.sides) if place is not None else []
        self._has_panes = np.zeros(len(scene.surfaces.origin) + 1, np.bool_)
        self._has_panes[[pane.face for pane in self._panes]] = True
        self._tracer = scene.tracer()
        all_surfaces = [scene.surfaces, *(body.surfaces() for body in bodies)]
        names = [name for where in all_surfaces for name in where.texture]
        values = np.array([reflectance(name) for name in names] + [np.nan])
        self._reflectivity = np.where(np.isnan(values), reflectivity, values)
        self._first = np.cumsum([0, *(len(where.origin) for where in all_surfaces)])
        self._mesh = scene.caster is not None

    def trace(self, t: Array, origins: Array, directions: Array) -> Traced:
        """Return the nearest intersections of rays; see :meth:`RayTracer.trace`."""
        return self._tracer.trace(t, origins, directions)

    def reflectivity(self, traced: Traced) -> Array:
        """Return the diffuse reflectivity (n,) of surfaces at 905 nm."""
        number = self._first[traced.body] + traced.surface
        # A mesh has no materials; its triangles are no rectangles.
        number[(traced.surface < 0) | (self._mesh & (traced.body == 0))] = -1
        return self._reflectivity[number]

    def on_glass(self, traced: Traced, origins: Array, directions: Array) -> Mask:
        """Return True for rays (n,) that hit glass."""
        result = np.zeros(len(origins), np.bool_)
        if not self._panes:
            return result
        rows = np.flatnonzero(self._has_panes[traced.surface] & (traced.body == 0))
        face = traced.surface[rows]
        offset = origins[rows] + traced.distance[rows, None] * directions[rows]
        offset -= self._surfaces.origin[face]
        across, up = self._surfaces.across[face], self._surfaces.up[face]
        s = (offset * across).sum(axis=1) / (across * across).sum(axis=1)
        r = (offset * up).sum(axis=1) / (up * up).sum(axis=1)
        for pane in self._panes:
            in_pane = (face == pane.face) & (s > pane.low[0]) & (s < pane.high[0])
            result[rows[in_pane & (r > pane.low[1]) & (r < pane.high[1])]] = True
        return result
