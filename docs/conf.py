# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The manual's configuration, in the layout that rosdoc2 builds (rosdoc2.yaml)."""

import re
import sys
from html import unescape
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

from docutils import nodes
from docutils.utils.math import latex2mathml
from sphinx.application import Sphinx
from sphinx.util.math import get_node_equation_number
from sphinx.writers.html5 import HTML5Translator

ROOT = Path(__file__).resolve().parents[1]

project = "imu_sim_ros"
author = "imu_sim_ros maintainers"
copyright = "2026, imu_sim_ros maintainers"
# rosdoc2 runs a copy of this file elsewhere, gives the version, and documents what is installed.
if (ROOT / "package.xml").is_file():
    sys.path.insert(0, str(ROOT))
    release = version = ElementTree.parse(ROOT / "package.xml").getroot().findtext("version")

extensions = ["myst_parser", "sphinx.ext.autodoc"]
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


MATHML = "http://www.w3.org/1998/Math/MathML"
ElementTree.register_namespace("", MATHML)


def _mathml(node: nodes.math | nodes.math_block, as_block: bool) -> str:
    """Return a formula as MathML, which browsers draw by themselves, with its TeX as its text."""
    tex = node.astext().strip()
    text = latex2mathml.tex2mathml(tex, as_block=as_block)
    text = re.sub(r"&(?!amp;|lt;|gt;)\w+;", lambda entity: unescape(entity[0]), text)
    drawn = ElementTree.fromstring(text)
    drawn.set("alttext", tex)
    # docutils sets the index of a letter with a dot or a tilde below it instead of to its right.
    for script in drawn.iter(f"{{{MATHML}}}munderover"):
        letter, index, accent = script
        if letter.tag == f"{{{MATHML}}}mi":
            accented = ElementTree.Element(f"{{{MATHML}}}mover", accent="true")
            accented.extend([letter, accent])
            script.tag = f"{{{MATHML}}}msub"
            script[:] = [accented, index]
    return ElementTree.tostring(drawn, encoding="unicode")


def _inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(_mathml(node, as_block=False))
    raise nodes.SkipNode


def _block(self: HTML5Translator, node: nodes.math_block) -> None:
    self.body.append(self.starttag(node, "div", CLASS="math"))
    if node.get("number"):
        number = get_node_equation_number(self, node)
        self.body.append(f'<span class="eqno">({number})</span>')
    self.body.append(_mathml(node, as_block=True) + "</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Draw formulas without a script and without a network."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))


# Before version 0.21, Ubuntu 24.04's, docutils does not turn all of our formulas into MathML.
if hasattr(latex2mathml, "tex2mathml"):
    html_math_renderer = "mathml"
else:
    extensions.append("sphinx.ext.mathjax")
