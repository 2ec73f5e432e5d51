# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of cameras and sensors that are named by preset or file alone, and of two sources."""

from collections.abc import Mapping, Sequence

from imu_sim_ros.parameters.sections import listed


def layer(kind: str, presets: Sequence[object]) -> dict[str, object]:
    """Return the parameters, by dotted name, of sensors of a kind: KIND, KIND1, KIND2, ...

    :param kind: a name in ``sensors``, or ``camera``: cam0, cam1, ... in ``cameras``.
    :param presets: of each; True: that of the kind's parameters.
    """
    if kind == "camera":
        names, group, own = [f"cam{k}" for k in range(len(presets))], "cameras", "camera.preset"
    else:
        names, group, own = [f"{kind}{k or ''}" for k in range(len(presets))], "sensors", "preset"
    result: dict[str, object] = {group: names} if names else {}
    if group == "sensors":
        result |= {f"{name}.type": kind for name in names[1:]}
    pairs = zip(names, presets, strict=True)
    return result | {f"{name}.{own}": preset for name, preset in pairs if preset is not True}


def joined(below: Mapping[str, object], above: Mapping[str, object]) -> dict[str, object]:
    """Return parameters by dotted name with others above them.

    The sensors are those of both. Cameras that are named above are all there are: what those below
    have of their own is left out with them.
    """
    gone = set(listed("cameras", below)) if listed("cameras", above) else set()
    gone -= {*listed("cameras", above)}
    kept = {name: one for name, one in below.items() if name.partition(".")[0] not in gone}
    sensors = listed("sensors", below)
    sensors += [name for name in listed("sensors", above) if name not in sensors]
    return {**kept, **above, **({"sensors": sensors} if sensors else {})}
