# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quality of service that a topic was offered with, as bags store it beside the messages."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from imu_sim_ros.inputs import parse_yaml

# rmw's infinite duration: the largest number of nanoseconds that an int64 holds.
_INFINITE: Final = {"sec": 9223372036, "nsec": 854775807}
# Older versions write rmw's numbers instead of names.
_NUMBERED: Final[dict[str, dict[object, str]]] = {
    "reliability": {1: "reliable", 2: "best_effort"},
    "durability": {1: "transient_local", 2: "volatile"},
    "history": {1: "keep_last", 2: "keep_all"},
}


class Qos(NamedTuple):
    """One profile, in the words of rosbag2's metadata."""

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "keep_last"
    depth: int = 10

    @classmethod
    def of(cls, profile: Any) -> "Qos":
        """Return a profile of rclpy in these words."""
        return cls(
            profile.reliability.name.lower(),
            profile.durability.name.lower(),
            profile.history.name.lower(),
            int(profile.depth),
        )


def qos_profiles(profiles: Sequence[Qos]) -> list[dict[str, Any]]:
    """Return quality-of-service profiles as rosbag2's metadata lists them."""
    return [
        {
            "history": qos.history,
            "depth": qos.depth,
            "reliability": qos.reliability,
            "durability": qos.durability,
            "deadline": dict(_INFINITE),
            "lifespan": dict(_INFINITE),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_INFINITE),
            "avoid_ros_namespace_conventions": False,
        }
        for qos in profiles
    ]


def qos_text(profiles: Sequence[Qos]) -> str:
    """Return profiles as the text that storage files hold."""
    import yaml

    return yaml.safe_dump(qos_profiles(profiles), sort_keys=False).strip() if profiles else ""


def parse_qos(profiles: object) -> tuple[Qos, ...]:
    """Return profiles of a bag, given as a list or as the text of one, of any version."""
    try:
        entries = parse_yaml(profiles) if isinstance(profiles, str) else profiles
    except ValueError:
        entries = None
    if not isinstance(entries, list):
        return (Qos(),)
    return tuple(
        Qos(**{name: _word(name, entry) for name in _NUMBERED}, depth=_depth(entry))
        for entry in entries
        if isinstance(entry, dict)
    )


def _depth(entry: dict[str, Any]) -> int:
    value = entry.get("depth")
    return value if isinstance(value, int) and 0 <= value < 2**31 else 10


def _word(name: str, entry: dict[str, Any]) -> str:
    value = entry.get(name)
    default = str(Qos._field_defaults[name])
    numbered = _NUMBERED[name].get(value, default) if isinstance(value, int) else default
    word = value if isinstance(value, str) else numbered
    return default if word in ("unknown", "system_default") else word
