# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hostile calls: every public function of the package, and messages to the integrator's own parts.

Each returns what was called and what is wrong with how it went.
"""

import math
import random
import struct
import traceback
from pathlib import Path
from typing import Any, Final

import folders
import numpy as np

NUMBERS: Final = (0.0, -0.0, 1.0, -1.0, 1e-300, 1e160, -1e160, 1e308, 1e300, math.nan, math.inf,
                  -math.inf, 9.81, 0.5)  # fmt: skip
STAMPS: Final = ((0, 0), (1, 0), (2**31 - 1, 2**32 - 1), (-1, 0), (-(2**31), 2**32 - 1), (5, 10**9))
_MESSAGES: Final = 60


def public(dice: random.Random, inputs: Path, place: Path) -> tuple[str, list[str], list[str]]:
    """Call a public function with arguments that nobody should give."""
    import inspect

    import imu_sim_ros as ims

    names = [name for name in ims.__all__ if inspect.isfunction(getattr(ims, name))]
    name = dice.choice(names)
    function = getattr(ims, name)
    parameters = [
        parameter
        for parameter in inspect.signature(function).parameters.values()
        if parameter.kind is not parameter.VAR_POSITIONAL
    ]
    values = _values(dice, inputs, place)
    settings = {
        parameter.name: dice.choice(values)
        for parameter in parameters
        if parameter.kind is not parameter.VAR_KEYWORD
        and (parameter.default is parameter.empty or dice.random() < 0.2)
    }
    if name in ("simulate", "blocks") and dice.random() < 0.5:
        settings["trajectory"] = folders.moving(dice)
    if name in ("simulate", "blocks", "camera") and "duration" not in settings:
        settings["duration"] = dice.choice([1.0, 0.5])
    labels = [f"{key}={str(value)[:60]!r}" for key, value in settings.items()]
    try:
        result = function(**settings)
        if inspect.isgenerator(result):
            next(result, None)
    except ims.ImuSimError:
        return name, labels, []
    except (TypeError, ValueError) as error:
        frames = traceback.extract_tb(error.__traceback__)
        if any(key in str(error) for key in settings) or len(frames) == 1:
            return name, labels, []
        return name, labels, ["undocumented", traceback.format_exc()]
    except Exception:
        return name, labels, ["undocumented", traceback.format_exc()]
    return name, labels, []


def _values(dice: random.Random, inputs: Path, place: Path) -> list[Any]:
    """Return values of every kind: some of the right type, most of them not."""
    n = dice.choice([0, 1, 3, 50])
    rows = np.tile([1.0, 2.0, 3.0], (n, 1))
    rows[: n // 2] = dice.choice(NUMBERS)
    return [
        *NUMBERS, None, True, "", "lecture", "perfect", "x" * 5000, "\0", [], {}, (), [1, 2, 3],
        {"a": 1}, object(), len, b"bytes", 10**400, -1, 0, 1e12, rows, rows.astype(int), rows[:, 0],
        np.array(["a"]), np.array([None]), np.zeros((0, 4)), np.full((5, 4), math.nan),
        np.arange(n) * 5_000_000, inputs, inputs / "none.mcap", str(inputs / "poses.txt"),
        place / "new.mcap", Path("/dev/zero"), Path("nowhere"),
    ]  # fmt: skip


def messages(dice: random.Random) -> tuple[str, list[str], list[str]]:
    """Give hostile readings and truths to what stands behind the integrator's topics."""
    from imu_sim_ros.core.errors import ImuSimError
    from imu_sim_ros.navigation.parameters import load_integrator
    from imu_sim_ros.nodes import messages as decode
    from imu_sim_ros.nodes.integrator.diagnostics import TruthComparison
    from imu_sim_ros.nodes.integrator.odometer import LiveIntegrator

    settings = {
        "initial_state": dice.choice(["truth", "parameters", "level"]),
        "method": dice.choice(["euler", "midpoint", "rk4"]),
        "covariance": dice.random() < 0.5,
    }
    parameters = load_integrator(settings)
    odometer = LiveIntegrator(parameters, lambda _: None, lambda: dice.random() < 0.1)
    comparison = TruthComparison()
    labels = [f"{name}={value}" for name, value in settings.items()]
    try:
        for k in range(_MESSAGES):
            is_truth = dice.random() < 0.4
            payload = _payload(dice, is_truth, k)
            rows, errors = [], []
            try:
                if is_truth:
                    truth = decode.truth(payload)
                    rows = odometer.add_truth(truth)
                    errors = list(comparison.add_truth(truth))
                else:
                    rows = odometer.add_reading(decode.imu_reading(payload))
            except ImuSimError:
                continue
            for row in rows:
                errors += comparison.add_estimate(row)
            for row in [*rows, *errors]:
                parts = [np.ravel(part) for part in row if part is not None]
                values = [part for part in parts if part.dtype.kind != "U"]  # not the frames
                if not np.isfinite(np.concatenate(values)).all():
                    return "integrator", labels, ["not finite", str(row)]
    except Exception:
        return "integrator", labels, ["traceback", traceback.format_exc()]
    return "integrator", labels, []


def _payload(dice: random.Random, is_truth: bool, k: int) -> bytes:
    """Return a message of which a part is hostile."""
    from imu_sim_ros.bags.messages.encode import ImuEncoder, OdometryEncoder

    t_ns, still = np.array([10**9 + 5_000_000 * k]), np.zeros((1, 3))
    if is_truth:
        encoder = OdometryEncoder("world", "base_link")
        rows = encoder.encode(t_ns, still, np.array([[1.0, 0, 0, 0]]), still, still)
    else:
        rows = ImuEncoder("imu_link").encode(t_ns, still, np.array([[0.0, 0.0, 9.81]]))
    content = bytearray(rows[0].tobytes())
    if dice.random() < 0.5:
        return bytes(content)
    choice = dice.randrange(5)
    if choice == 0:
        content[4:12] = struct.pack("<iI", *dice.choice(STAMPS))
    elif choice == 1:
        del content[dice.randrange(len(content)) :]
    elif choice == 2:
        content[dice.randrange(len(content))] = dice.randrange(256)
    else:
        start = 36 if is_truth else 28
        for _ in range(dice.randrange(1, 4)):
            offset = start + 8 * dice.randrange((len(content) - start) // 8)
            content[offset : offset + 8] = struct.pack("<d", dice.choice(NUMBERS))
    return bytes(content)
