# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Build description of imu_sim_ros; the version and the texts come from package.xml."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "imu_sim_ros"
NODES = ("simulator", "integrator", "recorder")
COMMANDS = (
    "generate",
    "dead_reckon",
    "allan",
    "calibrate",
    "twin",
    "convert_bag",
    "evaluate",
    "campaign",
    "report",
    "control",
)

manifest = ElementTree.parse(Path(__file__).with_name("package.xml")).getroot()


def share(folder: str, pattern: str) -> tuple[str, list[str]]:
    """Install the files of one folder below share/imu_sim_ros."""
    return f"share/{PACKAGE}/{folder}", sorted(str(path) for path in Path(folder).glob(pattern))


setup(
    name=PACKAGE,
    version=manifest.findtext("version"),
    description=manifest.findtext("description"),
    author="imu_sim_ros maintainers",
    maintainer=manifest.findtext("maintainer"),
    maintainer_email=manifest.find("maintainer").get("email"),
    license=manifest.findtext("license"),
    python_requires=">=3.10",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed"], f"{PACKAGE}.reports": ["assets/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        share("config", "*.*"),
        share("config/imus", "*.yaml"),
        share("config/barometers", "*.yaml"),
        share("config/trajectories", "*.yaml"),
        share("config/cameras", "*.yaml"),
        share("config/scenes", "*.yaml"),
        share("config/campaigns", "*.yaml"),
        share("config/estimators", "*.yaml"),
        share("examples", "*.py"),
        share("launch", "*.launch.py"),
    ],
    install_requires=[
        "setuptools",
        "numpy>=1.26",
        "scipy>=1.11",
        "matplotlib>=3.6",
        "PyYAML",
        "rich",
        "rosbags>=0.10",
        "mcap",
        "orjson>=3.9",
        "lz4",
        "zstandard",
    ],
    extras_require={
        "complete": ["argcomplete"],
        "docs": ["furo", "myst-parser", "sphinx"],
        "frames": ["pandas"],
        "magnetic": ["pygeomag"],
        "camera": ["opencv-python-headless>=4.6"],
        "campaign": ["distributed", "pyarrow"],
        "test": ["pytest", "allantools", "evo", "mcap-ros2-support"],
    },
    zip_safe=False,
    entry_points={
        "console_scripts": [f"{name} = {PACKAGE}.nodes.start:{name}" for name in NODES]
        + [f"{name} = {PACKAGE}.commands.start:{name}" for name in (*COMMANDS, "imu_sim")],
    },
)
