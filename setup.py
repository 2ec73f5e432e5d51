# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Build description of imu_sim_ros; the version and the texts come from package.xml."""

import re
import sys
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = "imu_sim_ros"
NODES = ("simulator", "integrator", "recorder", "error_model")
COMMANDS = (
    "generate",
    "dead_reckon",
    "allan",
    "calibrate",
    "twin",
    "convert_bag",
    "add_errors",
    "evaluate",
    "inspect",
    "campaign",
    "report",
    "view",
    "control",
)

# colcon and Debian's tools install into lib/imu_sim_ros (setup.cfg), where `ros2 run` finds
# programs under their own names. A wheel's scripts are on everybody's PATH: only `imu_sim` is one.
AMENT = bool({"install", "develop"} & set(sys.argv))
OPTIONAL = {
    "camera": ["numba>=0.58", "opencv-python-headless>=4.7"],
    "campaign": ["distributed", "pyarrow"],
    "complete": ["argcomplete"],
    "fast": ["orjson>=3.11.9"],
    "frames": ["pandas"],
    "logs": ["pymavlink>=2.4.40", "pyulog>=1.1.0"],
    "magnetic": ["pygeomag"],
    "mesh": ["trimesh>=4.0", "embreex>=4.4"],
    "mocap": ["bvhio>=1.5.4", "ezc3d>=1.5.19"],
    "view": ["rerun-sdk>=0.23"],
}
DEVELOPMENT = {
    "docs": ["docutils>=0.21", "furo", "myst-parser", "sphinx"],
    "test": [
        *("allantools", "evo", "hypothesis", "mcap-ros2-support", "orjson"),
        *("pytest", "pytest-timeout", "pytest-xdist"),
    ],
}

# colcon builds with links to the files that it installs; the README is not one of them.
README = Path(__file__).with_name("README.md")
manifest = ElementTree.parse(Path(__file__).with_name("package.xml")).getroot()


def long_description() -> str:
    """Return the README without what only a checkout has: its pictures, and links to its files."""
    if not README.exists():
        return ""
    text = re.sub(
        r"^(?:!\[[^\]]*\]\([^)]*\)|<picture>.*?</picture>)\n\n?",
        "",
        README.read_text(encoding="utf-8"),
        flags=re.M | re.S,
    )
    return re.sub(r"\[([^\]]*)\]\((?!https?://)[^)]*\)", r"\1", text)


def share(folder: str, pattern: str) -> tuple[str, list[str]]:
    """Install the files of one folder below share/imu_sim_ros."""
    return f"share/{PACKAGE}/{folder}", sorted(str(path) for path in Path(folder).glob(pattern))


setup(
    name=PACKAGE,
    version=manifest.findtext("version"),
    description=manifest.findtext("description"),
    long_description=long_description(),
    long_description_content_type="text/markdown",
    keywords=["imu", "simulation", "ros2", "visual-inertial", "allan-variance", "calibration"],
    classifiers=[
        "Development Status :: 5 - Production/Stable",
        "Environment :: Console",
        "Intended Audience :: Developers",
        "Intended Audience :: Education",
        "Intended Audience :: Science/Research",
        "License :: OSI Approved :: Apache Software License",
        "Operating System :: POSIX",
        "Programming Language :: Python :: 3",
        "Programming Language :: Python :: 3 :: Only",
        *(f"Programming Language :: Python :: 3.{minor}" for minor in range(10, 15)),
        "Topic :: Scientific/Engineering",
        "Topic :: Scientific/Engineering :: Physics",
        "Typing :: Typed",
    ],
    author="imu_sim_ros maintainers",
    maintainer=manifest.findtext("maintainer"),
    maintainer_email=manifest.find("maintainer").get("email"),
    license=manifest.findtext("license"),
    python_requires=">=3.10",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={
        PACKAGE: ["py.typed", "*.pyi"],
        f"{PACKAGE}.bags.messages.definitions": ["ros*/*/*.msg", "ros*/digests.txt"],
        f"{PACKAGE}.reports": ["assets/*"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        share("config", "*.*"),
        *(share(str(folder), "*.yaml") for folder in sorted(Path("config").glob("*/"))),
        share("examples", "*.py"),
        share("examples", "*.sdf"),
        share("examples", "*.ipynb"),
        share("launch", "*.launch.py"),
    ],
    install_requires=[
        "numpy>=1.26",
        "scipy>=1.11",
        "matplotlib>=3.6",
        "pillow>=10.2",
        "PyYAML>=6.0",
        "rich>=13.0",
        "rosbags>=0.10.9",
        "mcap>=1.1",
        "lz4>=4.0.2",
        "zstandard>=0.20",
    ],
    extras_require={
        **OPTIONAL,
        **DEVELOPMENT,
        "all": sorted(requirement for extra in OPTIONAL.values() for requirement in extra),
    },
    zip_safe=False,
    entry_points={
        "console_scripts": [
            f"imu_sim = {PACKAGE}.commands.start:imu_sim",
            *(f"{name} = {PACKAGE}.nodes.start:{name}" for name in NODES if AMENT),
            *(f"{name} = {PACKAGE}.commands.start:{name}" for name in COMMANDS if AMENT),
        ],
    },
)
