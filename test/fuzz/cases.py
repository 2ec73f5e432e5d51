# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hostile inputs of the commands: damaged bags, files and arguments, drawn from a case number."""

import contextlib
import json
import random
import shutil
import sqlite3
import struct
import sys
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "data"))
sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
import dataflash
import documents
import folders
import mocap
import processes
import ulog
import walk

import imu_sim_ros as ims

SMALL: Final = ["--duration", "1s", "--rate", "100", "--quiet", "--trajectory", "lecture"]
BAGS: Final = {
    "none.mcap": [],
    "lz4.mcap": ["--compression", "lz4"],
    "zstd.mcap": ["--compression", "zstd"],
    "none.bag": [],
    "bz2.bag": ["--compression", "bz2"],
    "lz4.bag": ["--compression", "lz4"],
    "folder": [],
    "sqlite": ["--storage", "sqlite3"],
    "euroc": ["--format", "euroc"],
}
LOGS: Final = ("log.ulg", "log.bin", "log.log", "walk.bvh", "body.c3d")
POSES: Final = [f"{k / 10:.1f} {k} 0 0 0 0 0 1" for k in range(50)]
WORDS: Final = [
    "--x=--", "9" * 400, "A" * 5000, "", " ", "-", "--", "\n", "é", "\udce9", "nan", "inf", "-1",
    "1e999", "-0", "0",
    "/dev/null", "/dev/full", "/dev/zero", ".", "..", "/", "[", "]", "{}", "a=b",
    "=", "1s", "0s", "1e-9s", "0.0000001s", "99999999999h", "1_0", "0x10", "%s%n", "../..", "~",
    "[.4,-.2]", "&a [*a]", "!!python/object/apply:os.system [ls]", "null", "true", "x" * 256,
]  # fmt: skip
_OPTIONS: Final = {
    "generate": ["-o", "--rate", "--duration", "--seed", "--imu", "--trajectory", "--set",
                 "--params-file", "--topics", "--topic", "--split-duration", "--split-size",
                 "--compression", "--storage", "--format"],
    "convert_bag": ["-o", "--topics", "--topic", "--split-duration", "--split-size", "--format",
                    "--compression", "--storage", "--recover"],
    "dead_reckon": ["-o", "--plot", "--skip", "--set", "--params-file", "--correction", "--method",
                    "--imu-topic", "--truth-topic", "--initial-state"],
    "evaluate": ["-o", "--plot", "--rpe", "--align", "--max-gap", "--truth-topic"],
    "allan": ["-o", "--topic", "--model", "--truth"],
    "calibrate": ["-o", "--gravity", "--rates", "--truth", "--accelerometer", "--topic"],
    "report": ["-o", "--title", "--metric", "--truth-topic", "--force"],
}  # fmt: skip
_NAMES: Final = [
    "rate", "seed", "duration", "imu", "imu.preset", "imu.gyroscope_noise_density", "trajectory",
    "trajectory.type", "trajectory.file", "gravity", "start_time", "imus", "cameras", "method",
]  # fmt: skip
_NUMBERS: Final = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63,
                   2**64 - 1)  # fmt: skip


def _bag(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return a command over a bag that is damaged in one of many ways."""
    source = sound / dice.choice(list(BAGS))
    path = place / source.name
    if source.is_dir():
        shutil.copytree(source, path)
        file = dice.choice(sorted(file for file in path.rglob("*") if file.is_file()))
    else:
        file = Path(shutil.copyfile(source, path))
    if file.suffix == ".db3" and dice.random() < 0.5:
        _damage_database(dice, file)
    else:
        file.write_bytes(_damaged(dice, file.read_bytes()))
    return _reading(dice, path)


def write_logs(folder: Path) -> None:
    """Write the sound logs of autopilots, and the sound motion captures."""
    flight = ims.simulate(imu="bmi088", trajectory="lecture", duration=2, rate=100, seed=1)
    readings = flight.readings
    ulog.write(folder / LOGS[0], ulog.flight_topics(flight))
    columns = {f"Gyr{axis}": readings.gyro[:, k] for k, axis in enumerate("XYZ")}
    columns |= {f"Acc{axis}": readings.accel[:, k] for k, axis in enumerate("XYZ")}
    tables = {"IMU": {"TimeUS": readings.t_ns // 1000, **columns}}
    dataflash.write(folder / LOGS[1], tables)
    dataflash.write_text(folder / LOGS[2], tables)
    walk.write(folder / LOGS[3], 1.0)
    position = mocap.markers(readings.t)
    mocap.c3d(folder / LOGS[4], 100.0, {f"A{k}": position[:, k] for k in range(4)})


def _log(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return a command over a log that is damaged in one of many ways."""
    name = dice.choice(LOGS)
    path = place / name
    path.write_bytes(_damaged(dice, (sound / name).read_bytes()))
    return _reading(dice, path)


def _reading(dice: random.Random, path: Path) -> tuple[str, list[str]]:
    output = dice.choice(["o.mcap", "o.bag", "o", "o.csv", "o.tum"])
    choices = {
        "convert_bag": [str(path), "-o", output],
        "dead_reckon": [str(path), "-o", "o.tum"],
        "evaluate": [str(path), str(path)],
        "allan": [str(path), "--no-files"],
        "calibrate": ["six_position", str(path), "--no-files"],
        "report": [str(path), "-o", "o.html"],
    }
    program = dice.choice(["convert_bag", *choices])
    recover = ["--recover"] if program == "convert_bag" and dice.random() < 0.5 else []
    return program, [*choices[program], *recover]


def _damaged(dice: random.Random, data: bytes) -> bytes:
    """Return bytes of a file with some of them wrong."""
    content = bytearray(data)
    for _ in range(dice.choice([1, 1, 2, 5, 40])):
        offset = (
            dice.randrange(len(content) + 1)
            if dice.random() < 0.6
            else _near_the_ends(dice, content)
        )
        choice = dice.randrange(8)
        if choice == 0:
            del content[offset:]
        elif choice == 1:
            content[offset : offset + 1] = bytes([dice.randrange(256)])
        elif choice == 2:
            content[offset : offset + 8] = struct.pack("<Q", dice.choice(_NUMBERS))
        elif choice == 3:
            content[offset : offset + 4] = struct.pack("<I", dice.choice(_NUMBERS) & 0xFFFFFFFF)
        elif choice == 4:
            content[offset : offset + dice.randrange(1, 300)] = b""
        elif choice == 5:
            content[offset:offset] = dice.randbytes(dice.randrange(1, 300))
        elif choice == 6:
            content[offset : offset + 200] = (
                content[offset : offset + 200].replace(b"e", b"\xff").replace(b"_", b"\0")
            )
        else:
            source_offset = dice.randrange(len(content) + 1)
            content[offset : offset + 100] = content[source_offset : source_offset + 100]
        if not content:
            return b""
    return bytes(content) if dice.random() < 0.95 else bytes(content[: dice.choice([5, 8, 13, 16])])


def _near_the_ends(dice: random.Random, content: bytearray) -> int:
    """Return a place where headers and indexes stand."""
    room = min(len(content), 3000)
    return (
        dice.randrange(room + 1) if dice.random() < 0.5 else len(content) - dice.randrange(room + 1)
    )


_DATABASE: Final = (
    "DROP TABLE messages",
    "DROP TABLE topics",
    "DROP TABLE message_definitions",
    "UPDATE messages SET timestamp = 'noon'",
    "UPDATE messages SET timestamp = x'00' WHERE id % 7 = 0",
    "UPDATE messages SET data = 'words'",
    "UPDATE messages SET data = x''",
    "UPDATE messages SET data = randomblob(1 + abs(random() % 400))",
    "UPDATE messages SET topic_id = 77",
    "UPDATE topics SET name = 3",
    "UPDATE topics SET name = x'ff'",
    "UPDATE topics SET name = CAST(x'fffe' AS TEXT)",
    "UPDATE topics SET type = 'sensor_msgs/msg/Image'",
    "UPDATE topics SET type = ''",
    "UPDATE topics SET offered_qos_profiles = '&a [*a, *a]'",
    "UPDATE message_definitions SET encoded_message_definition = 'uint8[99999999999] x'",
    "UPDATE message_definitions SET encoded_message_definition = CAST(x'ff' AS TEXT)",
    "DROP TABLE messages; CREATE VIEW messages AS WITH RECURSIVE n(id) AS "
    "(SELECT 1 UNION ALL SELECT id + 1 FROM n) SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS "
    "data FROM n",
    "ALTER TABLE messages RENAME COLUMN data TO content",
    "ALTER TABLE topics ADD COLUMN more GENERATED ALWAYS AS (randomblob(100000000))",
)


def _damage_database(dice: random.Random, file: Path) -> None:
    with contextlib.closing(sqlite3.connect(file)) as database, contextlib.suppress(sqlite3.Error):
        database.executescript(dice.choice(_DATABASE))


def _yaml(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return a command over a file of parameters that nobody should write."""
    lines = [f"    {dice.choice(_NAMES)}: {_value(dice)}" for _ in range(dice.randrange(1, 6))]
    text = "/**:\n  ros__parameters:\n" + "\n".join(lines) + "\n"
    choice = dice.randrange(6)
    if choice == 0:
        text = _damaged(dice, text.encode("utf-8", "surrogateescape")).decode("latin-1")
    elif choice == 1:
        text = dice.choice(
            ["[" * 3000, "{a: " * 3000, "- " * 3000, "&a [*a]", "\0", "", "ros__parameters: []"]
        )
    elif choice == 2:
        text = f"/**:\n  ros__parameters: {_value(dice)}\n"
    elif choice == 3:
        text = folders.slow_yaml(dice)
    (place / "given.yaml").write_text(text, encoding="utf-8", errors="surrogateescape")
    bag = str(sound / "none.mcap")
    return dice.choice([
        ("generate", ["-o", "o.mcap", "--params-file", "given.yaml", "--duration", "1s"]),
        ("generate", ["-o", "o.mcap", "--imu", "given.yaml", "--duration", "1s"]),
        ("dead_reckon", [bag, "--params-file", "given.yaml"]),
        ("dead_reckon", [bag, "--correction", "given.yaml"]),
        ("allan", [bag, "--no-files", "--truth", "given.yaml"]),
    ])  # fmt: skip


def _value(dice: random.Random) -> str:
    word = dice.choice([*WORDS, "5e-4", "lecture", "1.0", "[1, 2, 3]", "[[1], 2]", "{a: {b: 1}}"])
    return word if dice.random() < 0.8 else f"[{word}, {word}, {word}]"


def _arguments(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return a command whose arguments nobody should give."""
    program = dice.choice(list(_OPTIONS))
    recording = str(sound / dice.choice(["none.mcap", "sqlite", "poses.txt", "euroc"]))
    start = {
        "generate": ["--duration", "1s", "-o", "o.mcap"],
        "convert_bag": [recording, "-o", "o.mcap"],
        "evaluate": [recording, recording],
        "calibrate": ["six_position", recording],
        "report": [recording, "-o", "o.html"],
    }.get(program, [recording])
    for _ in range(dice.randrange(1, 4)):
        option = dice.choice(_OPTIONS[program])
        # Existing inputs as outputs, too: none of them may change.
        word = dice.choice([*WORDS, str(sound / dice.choice([*BAGS, "poses.txt"]))])
        if option == "--set" and dice.random() < 0.7:
            word = f"{dice.choice(_NAMES)}={word}"
        start += [f"{option}={word}"] if dice.random() < 0.5 else [option, word]
    return program, [word.replace("\0", "") for word in start]


def _poses(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return a command over a text file of poses with rows that are wrong."""
    rows = list(POSES)
    for _ in range(dice.randrange(1, 8)):
        k = dice.randrange(len(rows))
        fields = rows[k].split()
        if fields and dice.random() < 0.7:
            fields[dice.randrange(len(fields))] = dice.choice(WORDS)
            rows[k] = " ".join(fields)
        else:
            rows[k] = dice.choice(["", "#", "1 2", ",", "\t", rows[0], "x" * 70_000])
    separator = "," if dice.random() < 0.2 else " "
    data = "\n".join(row.replace(" ", separator) for row in rows).encode("utf-8", "replace")
    path = place / dice.choice(["given.txt", "given.tum", "given.csv"])
    path.write_bytes(_damaged(dice, data) if dice.random() < 0.4 else data)
    truth, skip = str(sound / "poses.txt"), ["--skip-bad-rows"] * dice.randrange(2)
    return dice.choice([
        ("evaluate", [str(path), truth, *skip]),
        ("convert_bag", [str(path), "-o", "o.mcap", *skip]),
        ("convert_bag", [str(path), "-o", "o.tum", *skip]),
        ("generate", ["-o", "o.mcap", "--trajectory", str(path), "--duration", "1s", *skip]),
        ("dead_reckon", [str(path)]),
        ("report", [str(sound / "none.mcap"), str(path), "-o", "o.html", *skip]),
    ])  # fmt: skip


def _camera_names() -> list[str]:
    """Return the names of all parameters of cameras and scenes."""
    from imu_sim_ros.parameters.sections import flatten
    from imu_sim_ros.sensors.camera.rig_parameters import load_rig

    names = flatten(load_rig({"cameras": ["cam0"]}))
    return [*names, *(n.removeprefix("cam0.") for n in names), "imus",
            *("scene.type", "scene.file", "scene.mesh")]  # fmt: skip


def _cameras(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return generate with cameras that nobody should have."""
    form = dice.choice(["tracks", "tracks", "vio_data_simulation", "euroc", "csv", "tum"])
    result = ["-o", "o", "--format", form, "--duration", "0.1s", "--rate", "100", "--jobs", "1"]
    names = _camera_names()
    camera = dice.choice(["euroc_cam0", "tum_vi_cam0", "vio_data_simulation"])
    result += ["--camera", camera if dice.random() < 0.9 else dice.choice(WORDS)]
    numbers = ["0", "1", "2", "0.5", "10", "100", "1e6", "100000", "-1", "1e-9", "1e300", "nan"]
    values = [*WORDS, "[1, 2, 3]", "[0.1, 0, 0, 0]", "[cam0, cam0]", "equidistant", "room"]
    for _ in range(dice.randrange(1, 4)):
        choice = dice.randrange(8)
        if choice < 6:
            word = dice.choice(numbers if dice.random() < 0.8 else values)
            result += ["--set", f"{dice.choice(names)}={word}"]
        elif choice == 6:
            poses = str(sound / "poses.txt")
            result += ["--scene", dice.choice(["house", "aprilgrid", poses, "x.ply", *WORDS])]
        else:
            result += [dice.choice(["--jobs", "--camera", "--format"]), dice.choice(values)]
    if dice.random() < 0.2:
        points = place / dice.choice(["points.csv", "points.ply"])
        head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nend_header\n"
        rows = "\n".join(dice.choice(["1,2,3", "0 0 5", "nan,1,1", *WORDS]) for _ in range(5))
        text = (head if dice.random() < 0.5 else "x,y,z\n") + rows
        points.write_text(text, encoding="utf-8", errors="surrogateescape")
        result += ["--scene", str(points)]
    return "generate", processes.fit(result)


def _mesh(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return generate in a mesh that is damaged, or names files that are none."""
    folder = place / "mesh"
    folder.mkdir()
    triangle = "v 0 0 0\nv 1 0 1\nv 1 1 1\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl m\nf 1/1 2/2 3/3\n"
    away = ["x.png", "../../sound/poses.txt", "/etc/passwd", "/dev/zero", "http://x.invalid/a.png"]
    uri = dice.choice([*away, *WORDS])
    view = {"bufferView": 0, "componentType": 5126, "count": dice.choice([3, 0, -1, 10**12]),
            "type": dice.choice(["VEC3", "SCALAR", "x"])}  # fmt: skip
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, **dice.choice([{}, {"children": [0]}, {"scale": [0, 0, 1]}])}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [view],
        "bufferViews": [{"buffer": 0, "byteLength": dice.choice([36, 1 << 40])}],
        "buffers": [{"uri": uri, "byteLength": 36}],
        "images": [{"uri": uri}],
    }
    for _ in range(dice.choice([0, 0, 1])):
        tree[dice.choice(list(tree))] = dice.choice([[], {}, None, -1, "x", [[[]]]])
    names = {
        "m.obj": f"mtllib {dice.choice(['m.mtl', uri])}\n{triangle}",
        "m.mtl": f"newmtl m\nmap_Kd {uri}\n",
        "m.gltf": json.dumps(tree),
        "m.ply": "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        "m.stl": "solid m\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
        "vertex 0 1 0\nendloop\nendfacet\nendsolid m\n",
    }
    for name, text in names.items():
        content = bytearray(text.encode(errors="replace"))
        for _ in range(dice.choice([0, 0, 1, 5])):
            content[dice.randrange(len(content))] = dice.randrange(256)
        if name == "m.gltf" and dice.random() < 0.5:  # as binary, in which lengths may lie
            lengths = [len(content), 12 + 8 + len(content)]
            lengths[dice.randrange(2)] += dice.choice([0, 0, -1, 1, 1 << 31])
            head = struct.pack("<4sIIII", b"glTF", 2, lengths[1] % 2**32, lengths[0] % 2**32,
                               0x4E4F534A)  # fmt: skip
            (folder / "m.glb").write_bytes(head + bytes(content))
        (folder / name).write_bytes(content[: dice.choice([None, None, dice.randrange(200)])])
    if dice.random() < 0.3:
        folders.obstacle(dice, folder / dice.choice(["x.png", "m.mtl", "m.obj", "m.ply"]))
    result = ["-o", "o", "--format", "tracks", "--duration", "0.1s", "--camera", "euroc_cam0"]
    mesh = folder / dice.choice(["m.obj", "m.gltf", "m.ply", "m.stl", "m.glb"])
    return "generate", [*result, "--set", "scene.type=mesh", "--set", f"scene.mesh={mesh}"]


MAKERS: Final = {
    "named": folders.named,
    "images": folders.images,
    "rows": folders.rows,
    "mistyped": folders.mistyped,
    "bag": _bag,
    "log": _log,
    "yaml": _yaml,
    "arguments": _arguments,
    "poses": _poses,
    "cameras": _cameras,
    "mesh": _mesh,
    "route": documents.route,
    "rinex": documents.rinex,
    "sdf": documents.sdf,
}
