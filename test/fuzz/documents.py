# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hostile documents of other programs: routes (GPX, KML, CSV), RINEX, and models of Gazebo."""

import random
import re
from pathlib import Path
from typing import Final

NAVIGATION: Final = ["--duration", "0.2s", "--rate", "50", "--quiet", "--trajectory", "lecture",
                     "--gnss", "zed_f9p", "--rinex"]  # fmt: skip
"""Arguments of the run that writes a sound RINEX file."""
_NUMBERS: Final = ["nan", "inf", "-1", "0", "1e300", "1e20", "-1e-300", "91", "181", "9" * 400, "",
                   "x", "1,5", "0x10", "{{ a }}", "1e-9", "D+99", "2.0D+31"]  # fmt: skip
_ENCODINGS: Final = ["utf-8", "latin-1", "utf-16", "nosuch-42", "", "idna", "rot13", "utf-7"]
_PLACES: Final = [(48.0, 11.0), (48.001, 11.0), (48.001, 11.002), (48.0, 11.003)]


def _wrong(dice: random.Random, text: str) -> str:
    """Return a text in which some numbers, tags or lines are others."""
    for _ in range(dice.choice([0, 1, 1, 2, 5])):
        choice = dice.randrange(6)
        numbers = list(re.finditer(r"-?\d+(\.\d+)?", text))
        lines = text.split("\n")
        k = dice.randrange(len(lines))
        if choice < 3 and numbers:
            number = dice.choice(numbers)
            text = text[: number.start()] + dice.choice(_NUMBERS) + text[number.end() :]
            continue
        if choice == 3:
            del lines[k]
        elif choice == 4:
            lines[k:k] = lines[k : k + 1] * dice.choice([1, 3, 40])
        else:
            lines[k] = lines[k][: dice.randrange(len(lines[k]) + 1)]
        text = "\n".join(lines)
    return text if dice.random() < 0.8 else text[: dice.randrange(len(text) + 1)]


def _write_damaged(dice: random.Random, path: Path, text: str) -> None:
    content = bytearray(_wrong(dice, text).encode(errors="replace"))
    for _ in range(dice.choice([0, 0, 0, 1, 8])):
        if content:
            content[dice.randrange(len(content))] = dice.randrange(dice.choice([127, 127, 256]))
    path.write_bytes(content)


def _xml(dice: random.Random, body: str) -> str:
    declared = dice.choice(_ENCODINGS) if dice.random() < 0.2 else "utf-8"
    head = f"<?xml version='1.0' encoding='{declared}'?>\n"
    types = [
        "",
        "",
        "",
        "",
        "",
        "",
        "",
        "",
        "<!DOCTYPE x [<!ENTITY a 'b'>]>\n",
        "<!-- -- -->\n",
        "<?php x ?>\n",
    ]
    deep = dice.choice([0, 0, 0, 0, 0, 0, 0, 0, 30, 5000])
    return head + dice.choice(types) + "<x>" * deep + body + "</x>" * deep


def route(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return generate along a route that nobody could drive, or that is none."""
    points = [
        f"<trkpt lat='{latitude}' lon='{longitude}'><ele>{k}</ele><time>2026-01-01T00:00:{k:02d}Z"
        "</time></trkpt>"
        for k, (latitude, longitude) in enumerate(_PLACES)
    ]
    track = "\n".join(["<trk><trkseg>", *points, "</trkseg></trk>"])
    line = "\n".join(f"{longitude},{latitude},5" for latitude, longitude in _PLACES)
    texts = {
        "r.gpx": _xml(dice, f"<gpx version='1.1'>\n{track}\n</gpx>"),
        "r.kml": _xml(dice, "<kml><Placemark><LineString><coordinates>\n"
                            f"{line}\n</coordinates></LineString></Placemark></kml>"),
        "r.csv": "x,y,speed,stop\n0,0,3,0\n30,0,3,1\n30,20,2,0\n60,20,3,0\n",
        "r.txt": "0 0\n30 0\n30 20\n",
    }  # fmt: skip
    path = place / dice.choice(list(texts))
    _write_damaged(dice, path, texts[path.name])
    limits = dice.choice([[], [], ["--set", f"trajectory.turning_radius={dice.choice(_NUMBERS)}"]])
    waypoint_options = dice.choice([
        ["--trajectory", str(path)],
        ["--set", "trajectory.type=drive", "--set", f"trajectory.file={path}"],
    ])  # fmt: skip
    return "generate", [
        "-o",
        "o.mcap",
        "--duration",
        "1s",
        "--rate",
        "50",
        *waypoint_options,
        *limits,
    ]


def rinex(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return generate under satellites whose file is damaged."""
    text = (sound / "navigation.nav").read_text()
    if dice.random() < 0.3:
        text = text.replace(
            "     3.0", f"     {dice.choice(['2.1', '2.0', '4.0', '1.0', 'x.x'])}", 1
        )
    path = place / "given.nav"
    _write_damaged(dice, path, text)
    return "generate", ["-o", "o.mcap", *NAVIGATION, "--set", f"gnss.ephemeris={path}"]


def sdf(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return generate, or add_errors, with an IMU of a model that nobody should write."""
    noise = "<noise type='gaussian'><mean>0.01</mean><stddev>0.02</stddev>\n<bias_mean>0.1"
    noise += "</bias_mean><dynamic_bias_stddev>0.01</dynamic_bias_stddev>\n"
    noise += "<dynamic_bias_correlation_time>300</dynamic_bias_correlation_time></noise>"
    axes = "\n".join(f"<{axis}>{noise}</{axis}>" for axis in "xyz")
    sensor = (
        "<sensor name='imu' type='imu'>\n<update_rate>100</update_rate>\n<imu>"
        f"<angular_velocity>\n{axes}\n</angular_velocity>\n<linear_acceleration>\n{axes}\n"
        "</linear_acceleration></imu></sensor>"
    )
    library = dice.choice(["libgazebo_imu_plugin.so", "librotors_gazebo_imu_plugin.so",
                           "libgazebo_ros_imu_sensor.so", "x.so", ""])  # fmt: skip
    plugin = (
        f"<plugin name='p' filename='{library}'>\n<gyroscopeNoiseDensity>1e-4"
        "</gyroscopeNoiseDensity>\n<accelerometerBiasCorrelationTime>300"
        "</accelerometerBiasCorrelationTime>\n<gaussianNoise>0.01</gaussianNoise>"
        "<updateRateHZ>100</updateRateHZ></plugin>"
    )
    parts = dice.choice([[sensor], [plugin], [sensor, plugin], [sensor, sensor], []])
    model = "<sdf version='1.9'><model name='m'><link name='l'>\n"
    text = _xml(dice, model + "\n".join(parts) + "\n</link></model></sdf>")
    path = place / dice.choice(["m.sdf", "m.urdf", "m.world"])
    _write_damaged(dice, path, text)
    imu_path = f"{path}{dice.choice(['', '', '#imu', '#p', '#', '#x#y'])}"
    return dice.choice([
        ("generate", ["-o", "o.mcap", "--duration", "1s", "--imu", imu_path]),
        ("add_errors", [str(sound / "none.mcap"), "-o", "o.mcap", "--imu", imu_path]),
    ])  # fmt: skip
