# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hostile folders: files that a form names, images, rows of a campaign; and mistyped names."""

import os
import random
import shutil
import struct
import zlib
from pathlib import Path
from typing import Final

import numpy as np

CAMERAS: Final = [
    *("--format", "euroc", "--duration", "0.3s", "--rate", "100", "--quiet", "--jobs", "1"),
    *("--camera", "euroc_cam0", "--camera", "euroc_cam1", "--topics"),
    *("imu/data_raw,ground_truth/odom,imu/mag", "--set", "camera.width=32"),
    *("--set", "camera.height=24", "--set", "camera.intrinsics=[20,20,15.5,11.5]"),
]
PLAN: Final = (
    "name: plan\nparameters: {rate: 50.0, duration: 1.0, imu: perfect, trajectory: lecture}\n"
    "seeds: 2\n"
)
_NAMED: Final = [
    "imu0/data.csv", "mag0/data.csv", "cam0/data.csv", "cam1/data.csv", "cam0/sensor.yaml",
    "imu0/sensor.yaml", "state_groundtruth_estimate0/data.csv", "cam0", "cam0/data", "imu0",
    "cam1", "state_groundtruth_estimate0", "body.yaml",
]  # fmt: skip
_VALUES: Final = ["1e300", "nan", "inf", "-1e308", "null", "[]", "{}", '"x"', "true", "1" * 400,
                  "[" * 2000, '"\\ud800"', "1e160", "-0"]  # fmt: skip


def obstacle(dice: random.Random, path: Path) -> None:
    """Put what is no file of this kind in a file's or folder's place."""
    if not path.parent.is_dir():
        return
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    choice = dice.randrange(6)
    if choice == 0:
        path.symlink_to("nowhere")
    elif choice == 1:
        path.symlink_to(path.name)
    elif choice == 2:
        os.mkfifo(path)
    elif choice == 3:
        path.mkdir()
    elif choice == 4:
        path.symlink_to("/dev/zero")
    else:
        path.write_bytes(dice.choice([b"", b"\0" * 100, b"%YAML:1.0\n", b"a: &a [*a]", b"\xff"]))


def named(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return a command over a folder of which some named files are no files."""
    folder = Path(shutil.copytree(sound / "cameras", place / "set"))
    for _ in range(dice.choice([1, 1, 2])):
        obstacle(dice, folder / dice.choice(_NAMED))
    return _over(dice, folder)


def images(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return a command over a folder of which some images are hostile."""
    folder = Path(shutil.copytree(sound / "cameras", place / "set"))
    image_paths = sorted(folder.glob("cam*/data/*"))
    for _ in range(dice.choice([1, 1, 3])):
        path = dice.choice(image_paths)
        path.write_bytes(_image(dice, path.read_bytes()))
    return _over(dice, folder)


def _image(dice: random.Random, content: bytes) -> bytes:
    content = content or bytes(9)  # emptied before
    width, height = dice.choice([(0, 0), (32, 24), (60_000, 60_000), (20_000, 20_000), (31, 24)])
    choice = dice.randrange(9)
    if choice == 0:
        return _png(width, height, b"")
    if choice == 8:
        import cv2

        grey = np.random.default_rng(1).integers(0, 256, (24, 32), dtype=np.uint8)
        content = cv2.imencode(".jpg", grey)[1].tobytes()
        offset = dice.randrange(300, len(content) - 2)
        return content[:offset] + dice.choice([b"", bytes(30), b"\xff\xd3" * 9]) + content[-2:]
    if choice == 1:
        return _png(width, height, bytes((width % 1000 + 1) * (height % 1000)))
    if choice == 2:
        offset = dice.randrange(len(content))
        return content[:offset] + bytes([dice.randrange(256)]) + content[offset + 1 :]
    if choice == 3:
        return content[: dice.randrange(len(content))]
    if choice == 4:
        head = struct.pack("<2sIIIIiiHHIIiiII", b"BM", 54, 0, 54, 40, width, -height, 1, 24,
                           0, 0, 0, 0, 0, 0)  # fmt: skip
        return head + bytes(dice.choice([0, 3 * 32 * 24]))
    if choice == 5:
        return f"P5\n# x\n{width} {height}\n255\n".encode() + bytes(dice.choice([0, 32 * 24]))
    if choice == 6:
        tags = [(256, width), (257, height), (258, 8), (273, 8), (277, 1), (279, 32 * 24)]
        rows = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
        return b"II*\0" + struct.pack("<IH", 8, len(tags)) + rows + bytes(dice.choice([4, 800]))
    return dice.choice([b"", b"GIF89a", b"RIFF\0\0\0\0WEBPVP8 ", b"\xff\xd8\xff", bytes(5000)])


def _png(width: int, height: int, pixels: bytes) -> bytes:
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    bodies = [(b"IHDR", header), (b"iCCP", b"x\0\0x"), (b"IDAT", zlib.compress(pixels))]
    chunks = [
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in [*bodies, (b"IEND", b"")]
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def _over(dice: random.Random, folder: Path) -> tuple[str, list[str]]:
    output = dice.choice(["o.mcap", "o.bag", "o", "o.tum"])
    form = ["--format", "euroc"] if output == "o" and dice.random() < 0.5 else []
    input_path = str(folder)
    return dice.choice([
        ("convert_bag", [input_path, "-o", output, *form]),
        ("convert_bag", [input_path, "-o", output, *form]),
        ("dead_reckon", [input_path]),
        ("evaluate", [input_path, input_path]),
        ("report", [input_path, "-o", "o.html"]),
        ("allan", [input_path, "--no-files", "--skip-checks"]),
    ])  # fmt: skip


def rows(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return a command over a campaign's folder whose rows and files nobody should write."""
    folder = Path(shutil.copytree(sound / "campaign", place / "results"))
    choice = dice.randrange(4)
    if choice == 0:
        obstacle(dice, folder / dice.choice(["runs.jsonl", "versions.json", "plan.yaml", ".lock"]))
    elif choice == 1:
        path = folder / dice.choice(["runs.jsonl", "results.csv", "versions.json"])
        text = path.read_text() if path.exists() else '{"cell": "all"}\n'
        cells = text.split(dice.choice([",", ":", "\n"]))
        cells[dice.randrange(len(cells))] = dice.choice(_VALUES)
        path.write_text(",".join(cells), errors="surrogateescape")
    elif choice == 2:
        row = f'{{"cell": "all", "seed": 1, "estimator": "x", "status": {dice.choice(_VALUES)}}}'
        (folder / "runs.jsonl").open("a").write(row + "\n" + dice.choice(_VALUES) + "\n")
    else:
        program = (
            f"#!/bin/sh\nprintf '1.0 {dice.choice(_VALUES[:4])} 0 0 0 0 0 1\\n' > estimate.tum\n"
        )
        (place / "own").write_text(program)
        (place / "own").chmod(0o755)
        estimators = "estimators: {own: {type: command, command: '{plan}/own'}}\n"
        (place / "plan.yaml").write_text(PLAN + estimators)
        return "campaign", ["plan.yaml", "-o", "new", "--workers", "1", "--no-report"]
    (place / "plan.yaml").write_text(PLAN)
    return dice.choice([
        ("campaign", ["plan.yaml", "-o", "results", "--workers", "1", "--resume", "--no-report"]),
        ("report", ["results", "-o", "o.html"]),
    ])  # fmt: skip


_TYPED: Final = [
    ("generate", ["--duration", "0.1s", "-o", "o.mcap"], "--imu", "adis16448"),
    ("generate", ["--duration", "0.1s", "-o", "o.mcap"], "--trajectory", "figure_eight"),
    ("generate", ["--duration", "0.1s", "-o", "o.mcap"], "--topics", "imu/data_raw"),
    ("generate", ["--duration", "0.1s", "-o", "o.mcap"], "--compression", "zstd"),
    ("generate", ["--duration", "0.1s", "-o", "o", "--format", "tracks"], "--camera", "euroc_cam0"),
    ("campaign", ["-o", "o"], "", "which_imu"),
    ("generate", ["--duration", "0.1s", "-o", "o.mcap"], "--force", ""),
    ("generate", ["--duration", "0.1s", "-o", "o.mcap"], "--quiet", ""),
    ("dead_reckon", ["BAG"], "--method", "midpoint"),
    ("dead_reckon", ["BAG"], "--imu-topic", "imu/data_raw"),
    ("convert_bag", ["BAG", "-o", "o.bag"], "--skip-bad-rows", ""),
    ("evaluate", ["BAG", "BAG"], "--truth-topic", "ground_truth/odom"),
    ("allan", ["BAG", "--no-files"], "--model", "standard"),
]


def mistyped(dice: random.Random, sound: Path, place: Path) -> tuple[str, list[str]]:
    """Return a command with an option that is cut off, or a name with a letter too few or other."""
    program, start, option, value = dice.choice(_TYPED)
    arguments = [str(sound / "none.mcap") if word == "BAG" else word for word in start]
    if option and (not value or dice.random() < 0.5):
        option = option[: -dice.randrange(1, 3)]
    else:
        offset = dice.randrange(1, len(value) - 1)
        value = value[:offset] + dice.choice(["", "q"]) + value[offset + 1 :]
    return program, [*arguments, *filter(None, (option, value))]


def slow_yaml(dice: random.Random) -> str:
    """Return YAML that takes long to read for whoever does not bound it."""
    many = 10 ** dice.randrange(3, 7)
    return dice.choice([
        f"/**:\n  ros__parameters: {{rate: {'1' * min(many, 200_000)}}}\n",
        f"/**:\n  ros__parameters: {{rate: {'1_' * min(many, 100_000)}}}\n",
        f"/**:\n  ros__parameters: {{rate: {'1:' * min(many, 100_000)}1}}\n",
        "# x\n" * many + "/**:\n  ros__parameters: {rate: 100.0}\n",
        "\n".join(f"k{k}: 1" for k in range(min(many, 300_000))),
        "a: &a [x]\n" + "\n".join(f"b{k}: &b{k} [*a, *a]" for k in range(min(many, 30_000))),
        "[" * min(many, 100_000),
    ])  # fmt: skip


def moving(dice: random.Random) -> object:
    """Return what somebody may give as a trajectory in Python: objects, functions, arrays."""
    level = np.array([1.0, 0.0, 0.0, 0.0])
    number = dice.choice([0.0, 1.0, np.nan, np.inf, 1e300, -1e160])

    def poses(t: np.ndarray) -> object:
        choice = int(number == 1.0) or dice.randrange(5)
        if choice == 4:
            raise dice.choice([ValueError, KeyError, OSError, AssertionError, RecursionError])("x")
        q_wb = np.tile(level * dice.choice([1.0, 1.0, number]), (len(t), 1))
        position = np.full((len(t), dice.choice([3, 3, 2])), number)
        return [None, (position, q_wb), (q_wb, position), position][choice]

    class Own:
        duration = dice.choice([1.0, 2.0, number, None, "x"])

        def sample(self, t: np.ndarray) -> object:
            return poses(t)

    table = np.zeros((dice.choice([0, 1, 3, 50]), dice.choice([6, 7, 8])))
    table[:, 0] = np.arange(len(table)) * dice.choice([0.1, 0.0, -1.0, 1e300])
    return dice.choice([poses, poses, Own(), Own, table, len, iter([1]), {"type": poses}])
