# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulation of IMUs and other sensors of a body, and recovery of parameters from readings.

>>> import imu_sim_ros as ims
>>> flight = ims.simulate(imu="tactical", trajectory="figure_eight", duration=60, rate=200, seed=1)
>>> track = ims.dead_reckon(flight, method="midpoint")
>>> ims.evaluate(track, flight.truth)
<Evaluation of 12000 poses, coverage 100 %, 145.9 m: position 11.71 m rms, attitude ...>

The names in ``__all__`` are public: they change only with a note in the changelog. Each is imported
when it is first used, from the module that ``__init__.pyi`` names. Everything else in
``imu_sim_ros.`` is internal and may change at any time.

Conventions
===========

Frames
    ``w``  world, east-north-up (ENU); gravity is ``g_w = (0, 0, -9.81)`` unless configured.
    ``b``  body, forward-left-up (FLU).
    ``i``  IMU, if it is offset from the body or rotated.

Rotations
    ``R_wb`` maps body to world: ``v_w = R_wb @ v_b``; neighbouring letters cancel.
    ``q_wb`` is the same rotation as a unit Hamilton quaternion ``(w, x, y, z)``, last axis.
    The order ``(x, y, z, w)`` of ROS exists only where messages are encoded or decoded.
    Euler angles are roll, pitch, yaw with ``R_wb = Rz(yaw) Ry(pitch) Rx(roll)``.
    ``omega_b`` is the body's angular rate relative to the world, resolved in the body.

Readings
    An accelerometer reads the specific force ``f_b = R_wb.T @ (a_w - g_w)``: +9.81 on z when level
    and at rest. A gyroscope reads ``omega_b``.

Units
    SI and radians everywhere; degrees only under names that end in ``_deg``.

Noise
    Continuous-time densities with the names and units of kalibr: ``gyroscope_noise_density``
    rad/s/sqrt(Hz), ``gyroscope_random_walk`` rad/s^2/sqrt(Hz), ``accelerometer_noise_density``
    m/s^2/sqrt(Hz), ``accelerometer_random_walk`` m/s^3/sqrt(Hz). A per-sample value ends in
    ``_discrete``: white noise ``sigma / sqrt(dt)``, one step of a walk ``sigma * sqrt(dt)``.

Time
    Stamps are int64 nanoseconds, ``t_ns``. Sample k is at ``t0_ns + round(k * 1e9 / rate)``, always
    computed from k. A float time is only ever a difference from a start, in seconds.

Shapes
    Time first: ``(n,)``, ``(n, 3)``, ``(n, 4)``, ``(n, 3, 3)``.
"""

from importlib import import_module
from pathlib import Path


def _read_homes() -> dict[str, str]:
    """Return the module of each public name, from the stub that type checkers read."""
    stub = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    imports = (line.split() for line in stub.splitlines() if line.startswith("from "))
    return {name: module for _, module, _, name, *_ in imports}


_HOMES = _read_homes()
__version__ = "2.0.0"
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> object:
    """Import a public name when it is first used (PEP 562)."""
    module = _HOMES.get(name)
    if module is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    public = (
        import_module(f"{module}.{name}")
        if module == __name__
        else getattr(import_module(module), name)
    )
    globals()[name] = public
    return public


def __dir__() -> list[str]:
    """Return the public names, also those that have not been imported yet."""
    return [*__all__, "__version__"]
