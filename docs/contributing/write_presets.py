# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The presets as Markdown: numbers, grades and sources of the files in config/.

``python docs/contributing/write_presets.py > docs/reference/presets.md``
"""

import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from imu_sim_ros.core.types import Array
from imu_sim_ros.parameters import files
from imu_sim_ros.sensors import catalogue, switchable_sensors
from imu_sim_ros.simulation.parameters import load_simulation

_INTRODUCTION = """\
# Presets

This page lists the names for `--imu`, `--trajectory`, `--camera`, `--scene` and the options of
other sensors (`--gnss`, ...), or for `imu.preset`, `trajectory.type`, `camera.preset`,
`scene.type`, `gnss.preset`, ... in a parameter file. Each is a file in `config/`, and a file of
your own works in the same way ([from a data sheet](../how_to/data_sheet.md)). `make reference`
writes this page.

## IMUs

Every number is in `config/imus/NAME.yaml` with its source and the computation from the source's
unit. A number without a source is left out, so a dash does not mean that the sensor has no such
error. SI units; three values are x, y, z. Noise densities are two-sided: the variance of a sample
is `density² rate`. White noise [rad/s/√Hz, m/s²/√Hz], random walk of the bias [rad/s²/√Hz,
m/s³/√Hz], bias instability B [rad/s, m/s²], standard deviation of the turn-on bias [rad/s, m/s²].
Bandwidth [Hz] of a fixed low-pass, which is simulated at more than twice that rate; in brackets,
the bandwidth for which the sheet states an RMS, a setting of the chip's driver that is not
simulated by default.
"""
_TERMS = {
    "white noise": "noise_density",
    "walk": "random_walk",
    "B": "bias_instability",
    "turn-on bias": "turn_on_bias_sigma",
}
_GRADES = ("perfect", "classroom", "consumer", "industrial", "tactical", "navigation")
_FOLDERS = {
    "trajectories": "Trajectories",
    "cameras": "Cameras",
    "scenes": "Scenes",
    "barometers": "Barometers",
    **{name: f"Sensor {name}" for name in switchable_sensors()},
}


class Imu(NamedTuple):
    """The header of a file in config/imus."""

    name: str
    grade: str
    text: str
    sources: list[str]


def imus() -> Iterator[Imu]:
    """Yield the headers of all IMUs: ``# Grade, price: maker and type.``, ``# [1] source``."""
    for name, text in catalogue.descriptions("imus").items():
        grade = text.partition(",")[0].lower()
        file = files.find("imus", name).read_text(encoding="utf-8")
        references = re.findall(r"^# (\[\d\] .+(?:\n#     .+)*)", file, re.MULTILINE)
        sources = [source.replace("\n#     ", " ") for source in references]
        yield Imu(name, grade, text, sources)


def reference() -> str:
    """Return the whole page."""
    return "\n".join(_lines())


def _lines() -> Iterator[str]:
    yield _INTRODUCTION
    entries = list(imus())
    for triad in ("gyroscope", "accelerometer"):
        yield f"### {triad.capitalize()}\n"
        yield f"| preset | grade | {' | '.join(_TERMS)} | bandwidth |"
        yield "|---|---|" + "---|" * (len(_TERMS) + 1)
        ordered = sorted(entries, key=lambda entry: _order(entry, triad))
        for entry in ordered:
            imu = load_simulation({"imu.preset": entry.name}).imu.triad(triad)
            cells = [_number(np.asarray(getattr(imu, term))) for term in _TERMS.values()]
            cells.append(_bandwidth(entry.name, triad))
            yield f"| `{entry.name}` | {entry.grade} | {' | '.join(cells)} |"
        yield ""
    yield "### Makers and sources\n"
    for entry in entries:
        yield f"**`{entry.name}`**: {entry.text}."
        yield from (f"\n- {source}" for source in entry.sources)
        yield ""
    for folder, heading in _FOLDERS.items():
        yield f"## {heading}\n"
        yield "| preset | what it is |"
        yield "|---|---|"
        for name, text in catalogue.descriptions(folder).items():
            yield f"| `{name}` | {text} |"
        yield ""


def _order(entry: Imu, triad: str) -> tuple[int, float]:
    """Return the place of a sensor: by grade, then from much white noise to little."""
    density = load_simulation({"imu.preset": entry.name}).imu.triad(triad).noise_density
    return _GRADES.index(entry.grade), -float(max(density))


def _bandwidth(preset: str, triad: str) -> str:
    """Return the low-pass of a preset, or that of its sheet's RMS in brackets."""
    fixed = np.asarray(load_simulation({"imu.preset": preset}).imu.triad(triad).bandwidth)
    text = files.find("imus", preset).read_text(encoding="utf-8")
    stated = re.search(rf"rms in (\d+) Hz = .*\n +{triad}_", text)
    return _number(fixed) if fixed.any() or not stated else f"({stated[1]})"


def _number(values: Array) -> str:
    if not values.any():
        return "–"
    numbers = [f"{value:.3g}" for value in values]
    return numbers[0] if len(set(numbers)) == 1 else "/".join(numbers)


if __name__ == "__main__":
    print(reference(), end="")
