# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The manual's configuration, in the layout that rosdoc2 builds (rosdoc2.yaml)."""

import sys
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[1]

project = "imu_sim_ros"
author = "imu_sim_ros maintainers"
copyright = "2026, imu_sim_ros maintainers"
# rosdoc2 runs a copy of this file elsewhere, gives the version, and documents what is installed.
if (ROOT / "package.xml").is_file():
    sys.path.insert(0, str(ROOT))
    release = version = ElementTree.parse(ROOT / "package.xml").getroot().findtext("version")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax"]
source_suffix = {".md": "markdown"}
# All but the first are copies of the repository's files that rosdoc2 puts next to the pages.
exclude_patterns = ["_build", "__*.rst", "README.md", "CONTRIBUTING.md", "QUALITY_DECLARATION.md"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 4
# Types and arguments are written in the docstrings, once.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
default_role = "code"

# `make docs` installs furo, and rosdoc2 uses it if it is installed. The build farm has no rosdep
# key for it, but always the Read-the-Docs theme; both have page contents, previous and next, and
# fit a phone.
html_theme = next(name for name in ("furo", "sphinx_rtd_theme", "alabaster") if find_spec(name))
html_theme_options: dict[str, object] = {}  # rosdoc2 sets those of its own theme before
rosdoc2_settings = {"override_theme": False}
html_title = "imu_sim_ros"
html_static_path = ["_static"]
html_css_files = ["custom.css"]
smartquotes = False  # --option stays --option
highlight_language = "none"  # command lines are no Python
