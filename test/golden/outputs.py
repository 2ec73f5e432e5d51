# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Digests of the outputs that users get, one a case: ``outputs.py FILE`` writes them as JSON.

Only names that users rely on are called (``imu_sim_ros.__all__``, the programs, parameters), so
that the same file runs against any revision; ``compare.py`` runs it against two. Bags are read by
mcap and rosbags, a message counts by its topic, type, times and bytes, a parameter by its name and
value.
"""

import contextlib
import hashlib
import importlib
import inspect
import io
import json
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import imu_sim_ros as ims

ROOT = Path(ims.__file__).parents[1]
TOPICS = (
    *("imu/data_raw", "ground_truth/odom", "ground_truth/imu", "ground_truth/gyroscope_bias"),
    *("ground_truth/accelerometer_bias", "imu/temperature", "imu/mag", "ground_truth/mag"),
    *("ground_truth/magnetometer_bias", "imu/data", "imu/pressure", "ground_truth/pressure"),
    "ground_truth/barometer_bias",
)
INCREMENTS = (
    *("imu/delta_angle", "imu/delta_velocity"),
    *("ground_truth/delta_angle", "ground_truth/delta_velocity"),
)
SENSORS = ("magnetic_field", "orientation", "pressure")
# One value of each kind of term; every other parameter of a triad is covered by the presets.
TRIAD_TERMS: dict[str, object] = {
    "noise_density": 0.01,
    "random_walk": 1e-3,
    "gauss_markov_sigma": 0.01,
    "bias_instability": 1e-3,
    "rate_ramp": 1e-5,
    "bias": [0.01, -0.02, 0.03],
    "turn_on_bias_sigma": 0.01,
    "turn_on_scale_sigma": 0.01,
    "scale_error_percent": [1.0, -1.0, 0.5],
    "misalignment_percent": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
    "quadratic": 1e-3,
    "temperature_bias": [1e-3, 2e-3, 3e-3, 1e-5, 2e-5, 3e-5],
    "temperature_scale": [1e-4, 2e-4, 3e-4],
    "bandwidth": [60.0, 40.0, 20.0],
    "range": 3.0,
    "resolution": 1e-3,
}
OTHER_TERMS: dict[str, dict[str, object]] = {
    "g_sensitivity": {"imu.gyroscope_g_sensitivity": [1e-4, 0, 0, 0, 2e-4, 0, 0, 1e-5, 3e-4]},
    "lever_arm": {"imu.lever_arm": [0.1, 0.2, -0.3]},
    "mounting": {"imu.mounting": [0, -1, 0, 1, 0, 0, 0, 0, 1]},
    "size_effect": {"imu.accelerometer_positions": [0.01, 0, 0, 0, 0.02, 0, 0, 0, -0.01]},
    "clock": {
        "imu.stamp_offset": 0.01,
        "imu.clock_skew_ppm": 50.0,
        "imu.clock_drift_ppm_per_hour": 5.0,
        "imu.jitter": 5e-4,
    },
    "transport": {
        "imu.latency": 2e-3,
        "imu.latency_jitter": 4e-3,
        "imu.dropout_probability": 0.02,
        "imu.dropout_burst_rate": 0.5,
        "imu.dropout_burst_duration": 0.1,
        "imu.duplicate_probability": 0.05,
    },
    "temperature": {
        "temperature.profile": [0.0, 20.0, 5.0, 40.0, 15.0, 30.0],
        "temperature.time_constant": 3.0,
    },
    "earth": {"earth_rotation": True, "gravity_model": "wgs84", "latitude_deg": 48.0},
    "curved_earth": {
        "curved_earth": True,
        "earth_rotation": True,
        "gravity_model": "wgs84",
        "latitude_deg": 48.0,
    },
    "oversampled": {
        "imu.sampling": "oversampled",
        "imu.gyroscope_bandwidth": 40.0,
        "imu.accelerometer_bandwidth": 40.0,
    },
    "vibration": {"trajectory.vibration.noise_rms": 1.0},
    "lead_in": {"trajectory.lead_in.rest": 1.0},
}
TRAJECTORIES = (
    *("static", "lecture", "circle", "figure_eight", "line", "square", "spin", "coning"),
    *("sculling", "rotating_disc", "free_fall", "six_position", "turntable", "tumble"),
    *("excitation", "waypoints", "temperature_ramp", "temperature_soak", "target"),
)
GENERATED: dict[str, list[str]] = {
    "lz4.mcap": ["--compression", "lz4"],
    "zstd.mcap": ["--compression", "zstd"],
    "none.bag": [],
    "lz4.bag": ["--compression", "lz4"],
    "bz2.bag": ["--compression", "bz2"],
    "folder": [],
    "sqlite3": ["--storage", "sqlite3"],
    "split": ["--split-duration", "1s"],
    "table.csv": [],
    "truth.tum": [],
    "euroc": ["--format", "euroc"],
    "csv": ["--format", "csv"],
    "configured.mcap": ["--with-configs"],
    "tracks": ["--format", "tracks", "--camera", "euroc_cam0", "--camera", "euroc_cam1"],
    "vio_data_simulation": ["--format", "vio_data_simulation", "--camera", "vio_data_simulation"],
    "euroc_images": ["--format", "euroc", "--camera", "euroc_cam0", "--scene", "room"],
    "tum_vi_images": ["--format", "tum_vi", "--camera", "tum_vi_cam0", "--scene", "room"],
    "camera.mcap": ["--camera", "realsense_d435i_cam0", "--scene", "aprilgrid"],
}
MEASURED_S = ("wall_s", "bytes", "output", "real_time_factor", "cpu_s")


def simulations() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield a name and the arguments of ``ims.simulate`` for each simulation."""
    presets = sorted(path.stem for path in (ROOT / "config/imus").glob("*.yaml"))
    for preset in presets:
        for trajectory in ("static", "lecture", "figure_eight"):
            yield f"preset {preset} {trajectory}", {"imu": preset, "trajectory": trajectory}
    for trajectory in TRAJECTORIES:
        for sampling in ("instantaneous", "averaged"):
            for rate in (200.0, 190.0):
                imu = {"preset": "mpu6000", "sampling": sampling}
                name = f"trajectory {trajectory} {sampling} {rate:g} Hz"
                yield name, {"imu": imu, "trajectory": trajectory, "rate": rate}
    for triad in ("gyroscope", "accelerometer"):
        for term, value in TRIAD_TERMS.items():
            imu: dict[str, object] = {"preset": "perfect", f"{triad}_correlation_time": 10.0}
            imu[f"{triad}_{term}"] = value
            yield f"term {triad}_{term}", {"imu": imu, "trajectory": "lecture"}
    for term, values in OTHER_TERMS.items():
        arguments = {"imu": "adis16448", "trajectory": "figure_eight", **values}
        yield f"term {term}", arguments


def digest_of_bag(path: Path) -> tuple[str, int]:
    """Return a digest over the messages of a bag, by topic, and their number."""
    from rosbags.highlevel import AnyReader

    digests: dict[str, Any] = {}
    count = 0
    with AnyReader([path]) as reader:
        for connection, t_ns, content in reader.messages():
            name = f"{connection.topic} {connection.msgtype}"
            digest = digests.setdefault(name, hashlib.sha256())
            digest.update(t_ns.to_bytes(8, "little", signed=True) + bytes(content))
            count += 1
    lines = [f"{name} {digest.hexdigest()}" for name, digest in sorted(digests.items())]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest(), count


def digests_of_files(folder: Path) -> dict[str, str]:
    """Return a digest for each file of a folder, and one for each bag by its messages."""
    digests = {}
    bags = {path.parent for path in folder.rglob("metadata.yaml")}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path in bags or path.suffix in (".mcap", ".bag"):
            if path.parent not in bags:
                digests[name] = digest_of_bag(path)[0]
        elif path.is_file() and not any(bag in path.parents for bag in bags):
            digests[name] = hashlib.sha256(content_of(path)).hexdigest()
    return digests


def content_of(path: Path) -> bytes:
    """Return what counts of a file: of parameters names, values and comments, in any order."""
    content = path.read_bytes()
    if path.suffix != ".yaml" or b"ros__parameters" not in content:
        return content
    values = json.dumps(yaml.safe_load(content), sort_keys=True)
    comments = [line for line in content.decode().splitlines() if line.startswith("#")]
    return "\n".join([*comments, values]).encode()


def samples() -> Iterator[tuple[str, str]]:
    """Yield a digest for each simulation: all of its topics in a bag."""
    with tempfile.TemporaryDirectory() as folder:
        for name, arguments in simulations():
            settings = {"duration": 2, "seed": 7, "sensors": SENSORS, **arguments}
            imu = settings["imu"]
            averaged = isinstance(imu, dict) and imu.get("sampling") == "averaged"
            path = Path(folder) / "run.mcap"
            topics = [*TOPICS, *(INCREMENTS if averaged else ())]
            try:
                ims.simulate(**settings).save(path, topics=topics, force=True)
            except ims.ConfigurationError as error:
                yield f"samples: {name}", f"refused: {error}"
                continue
            yield f"samples: {name}", digest_of_bag(path)[0]


def program(name: str, *arguments: object) -> str:
    """Run a program in this process; returns what it prints, and its status."""
    module = importlib.import_module(f"imu_sim_ros.commands.{name}")
    printed, errors = io.StringIO(), io.StringIO()
    saved_argv = sys.argv
    sys.argv = [name, *map(str, arguments)]
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(errors):
            status = module.main()
    except SystemExit as end:
        status = end.code
    finally:
        sys.argv = saved_argv
    return f"{status}\n{printed.getvalue()}{errors.getvalue()}"


def result(name: str, *arguments: object) -> str:
    """Return a digest of a program's JSON, without what differs from run to run."""
    status, text = program(name, *arguments, "--json", "--quiet").split("\n", 1)

    def steady(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: steady(v) for k, v in value.items() if k not in MEASURED_S}
        if isinstance(value, str) and value.startswith("/"):
            return Path(value).name
        return [steady(v) for v in value] if isinstance(value, list) else value

    if status == "0":
        json_text, _, warnings = text.partition("\n")
        text = json.dumps(steady(json.loads(json_text)), sort_keys=True) + warnings
    return hashlib.sha256(f"{status} {text}".encode()).hexdigest()


def files_and_results() -> Iterator[tuple[str, str]]:
    """Yield a digest for each written form and each analysis."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for form, options in GENERATED.items():
            place = folder / "generated" / form.replace(".", "_") / form
            common = ["--imu", "bmi088", "--trajectory", "figure_eight", "--duration", "2s"]
            yield f"generate {form}: result", result("generate", "-o", place, *common, *options)
            for file, digest in digests_of_files(place.parent).items():
                yield f"generate {form}: {file}", digest
        source = folder / "generated" / "lz4_mcap" / "lz4.mcap"
        for form in ("a.bag", "a.csv", "a.tum", "folder"):
            place = folder / "converted" / form.replace(".", "_") / form
            yield f"convert {form}: result", result("convert_bag", source, "-o", place)
            for file, digest in digests_of_files(place.parent).items():
                yield f"convert {form}: {file}", digest
        yield "dead_reckon", result("dead_reckon", source, "--all")
        rest = folder / "rest.mcap"
        program("generate", "-o", rest, "--imu", "adis16448", "--trajectory", "static",
                "--duration", "10min", "--quiet")  # fmt: skip
        yield "allan", result("allan", rest, "-o", folder / "allan")
        six = folder / "six.mcap"
        program(
            "generate", "-o", six, "--imu", "mpu6000", "--trajectory", "six_position", "--quiet"
        )
        yield "calibrate", result("calibrate", "six_position", six, "-o", folder / "six")
        track = folder / "track.tum"
        program("dead_reckon", source, "-o", track, "--quiet")
        yield "evaluate", result("evaluate", track, source)


def surface() -> Iterator[tuple[str, str]]:
    """Yield the public names with their arguments, and every parameter of the reference."""
    for name in sorted(ims.__all__):
        value = getattr(ims, name)
        if inspect.isclass(value):
            description = " ".join(sorted(n for n in dir(value) if not n.startswith("_")))
        elif callable(value):
            description = ", ".join(
                f"{p.name}={p.default}" if p.default is not p.empty else p.name
                for p in inspect.signature(value).parameters.values()
            )
        else:
            description = type(value).__name__
        yield f"public {name}", description
    reference = program("parameter_reference")
    for line in reference.splitlines():
        if line.startswith("| `"):
            name, default, unit = (cell.strip() for cell in line.split("|")[1:4])
            yield f"parameter {name}", f"{default} {unit}"


def main() -> int:
    """Write all digests to the file that the first argument names."""
    digests: dict[str, str] = {}
    with np.errstate(all="ignore"):
        for part in (surface, samples, files_and_results):
            for name, digest in part():
                digests[name] = digest
    Path(sys.argv[1]).write_text(json.dumps(digests, indent=1, sort_keys=True), encoding="utf-8")
    print(f"{len(digests)} cases")
    return 0


if __name__ == "__main__":
    sys.exit(main())
