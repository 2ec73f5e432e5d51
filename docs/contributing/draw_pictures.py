# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draw the manual's pictures: ``python docs/contributing/draw_pictures.py [NAME ...]``.

Names are those of the files in docs/images, without their ending; without a name all are drawn,
except those of a real flight, which need ``--euroc FOLDER``, a recording in EuRoC's form. The
pictures of the tutorials are drawn by their test (``make pictures``).
"""

import argparse
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
IMAGES = ROOT / "docs/images"
BIN = Path(sys.executable).parent

COMMANDS = {
    "allan": """
        imu_sim generate -o rest.mcap --imu lecture --trajectory static --duration 4h --imu-only
        imu_sim allan rest.mcap -o allan --truth lecture
    """,
    "dead_reckoning": """
        imu_sim generate --imu perfect --trajectory lecture --duration 20.005s -o flight
        imu_sim dead_reckon flight --all --plot dead_reckoning.png
    """,
    "evaluation": """
        imu_sim generate --imu adis16448 --trajectory lecture --duration 20s -o noisy
        imu_sim dead_reckon noisy -o noisy.txt --quiet
        imu_sim evaluate noisy.txt noisy --align yaw --plot evaluation.png
    """,
    "six_position": """
        imu_sim generate --imu mpu6000 --trajectory six_position -o six.bag
        imu_sim calibrate six_position six.bag -o six
    """,
    "turntable": """
        imu_sim generate --imu mpu6000 --trajectory turntable -o table.bag
        imu_sim calibrate turntable table.bag --rates 0.5,1,2 -o table
    """,
    "demo": "python -m imu_sim_ros.commands.demo --output demo",
    "sensors_allan": f"python {ROOT}/docs/contributing/draw_presets.py sensors_allan.png",
    "splines": f"python {ROOT}/examples/splines.py splines.png",
    "rooms": f"python {ROOT}/docs/contributing/draw_rooms.py rooms.png",
}
"""Commands by the name of a picture; the picture is NAME.png or one that SOURCES has."""
SOURCES = {
    "allan": "allan/allan.png",
    "six_position": "six/six_position.png",
    "turntable": "table/turntable.png",
    "demo": "demo/trajectory.png",
    "twin": "twin/twin.png",
}
EXAMPLES = {
    "digital_twin": ("digital_twin",),
    "front_page": ("front_page_light", "front_page_dark"),
    "gnss_filter": ("gnss_filter",),
    "joint_angles": ("joint_angles",),
    "lecture": ("lecture_path", "lecture_allan"),
    "mujoco_imu": ("mujoco_imu",),
    "places": tuple(
        f"place_{name}" for name in ("corridor", "machine_hall", "office", "street", "warehouse")
    ),
    "town_drive": ("town_drive",),
    "vio_dataset": ("vio_dataset",),
}
"""Pictures that a script in examples/ writes into the folder that it is told."""
EUROC = {
    "twin": "imu_sim twin V1_02_medium.csv --truth groundtruth.csv --fit 20s -o twin",
}

PLAN = """
name: Which IMU, which integration
parameters: {rate: 200.0, duration: 60.0}
grid:
  imu: [adis16470, bmi055, mpu6000]
  trajectory: [circle, figure_eight]
seeds: 30
estimators:
  midpoint: {type: dead_reckon}
  euler: {type: dead_reckon, method: euler}
diverged_above: 10000.0
require: [ate_rmse_m.median < 3000, success >= 0.9]
"""
NOT_MET = 3
"""Exit status of a campaign whose requirements are not met."""
PAGES = {
    "campaign": "imu_sim campaign plan.yaml -o campaign",
    "bag": """
        imu_sim generate -o flight.mcap --imu tactical --trajectory figure_eight --duration 1min
        imu_sim dead_reckon flight.mcap -o midpoint.csv
        imu_sim dead_reckon flight.mcap --method euler -o euler.csv
        imu_sim report flight.mcap midpoint.csv euler.csv -o bag/report.html
    """,
}
"""Commands that write NAME/report.html."""
SCREENS = {
    "report_campaign": ("campaign", 1280, 1040, False),
    "report_phone": ("campaign", 390, 844, True),
    "report_bag": ("bag", 900, 1640, False),
}
"""Page, width and height [px], and True for the dark theme."""


def run(commands: str, folder: Path) -> None:
    """Run lines of commands in a folder, with the programs of this environment."""
    for line in commands.strip().splitlines():
        program, *arguments = shlex.split(line)
        done = subprocess.run([BIN / program, *arguments], cwd=folder, stdout=sys.stderr)
        if done.returncode not in (0, NOT_MET):
            sys.exit(f"{line}: status {done.returncode}")


def draw(name: str, folder: Path, euroc: Path | None) -> None:
    """Draw the picture of a command."""
    commands = COMMANDS.get(name)
    if commands is None:
        assert euroc is not None
        commands = EUROC[name]
        (folder / "V1_02_medium.csv").symlink_to(euroc.resolve() / "imu0/data.csv")
        truth = euroc.resolve() / "state_groundtruth_estimate0/data.csv"
        (folder / "groundtruth.csv").symlink_to(truth)
    run(commands, folder)
    shutil.copyfile(folder / SOURCES.get(name, f"{name}.png"), IMAGES / f"{name}.png")


def draw_example(script: str, folder: Path) -> None:
    """Run an example and take its pictures."""
    run(f"python {ROOT}/examples/{script}.py {folder}", folder)
    for picture in EXAMPLES[script]:
        shutil.copyfile(folder / f"{picture}.png", IMAGES / f"{picture}.png")


def draw_pages(names: list[str], folder: Path) -> None:
    """Write the pages and take their pictures in Chromium."""
    (folder / "plan.yaml").write_text(PLAN, encoding="utf-8")
    for page in dict.fromkeys(SCREENS[name][0] for name in names):
        run(PAGES[page], folder)
    driver = chromium()
    try:
        for name in names:
            photograph(driver, name, folder)
    finally:
        driver.quit()


def chromium() -> Any:
    """Return a driver of headless Chromium."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"):
        options.add_argument(flag)
    return webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))


def photograph(driver: Any, name: str, folder: Path) -> None:
    """Write the picture of a page's beginning."""
    page, width, height, dark = SCREENS[name]
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
    driver.get((folder / page / "report.html").as_uri())
    assert driver.save_screenshot(str(IMAGES / f"{name}.png"))


def main() -> None:
    """Draw what the arguments name."""
    scripts = {picture: script for script, pictures in EXAMPLES.items() for picture in pictures}
    drawable = [*COMMANDS, *scripts, *SCREENS, *EUROC]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", nargs="*", metavar="NAME")
    parser.add_argument("--euroc", type=Path, help="folder mav0 of V1_02_medium")
    arguments = parser.parse_args()
    if unknown := set(arguments.name) - set(drawable):
        parser.error(f"{', '.join(sorted(unknown))}: must be one of {', '.join(drawable)}")
    names = arguments.name or [name for name in drawable if arguments.euroc or name not in EUROC]
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name in names:
            if name in COMMANDS or name in EUROC:
                draw(name, folder, arguments.euroc)
        for script in dict.fromkeys(scripts[name] for name in names if name in scripts):
            draw_example(script, folder)
        if screens := [name for name in names if name in SCREENS]:
            draw_pages(screens, folder)


if __name__ == "__main__":
    main()
