"""The documentation site: ``python -m sphinx -W docs site``."""

import re
from importlib import metadata
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

project = "icub-jump"
author = "The icub-jump developers"
copyright = "The icub-jump developers; pictures of the robot: CC BY-SA 4.0"
version = release = metadata.version("icub-jump")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
exclude_patterns = ["update.py"]

html_theme = "furo"
html_title = "icub-jump"
html_show_sourcelink = False
html_math_renderer = "mathml"

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
nb_execution_mode = "off"  # tests execute them

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings have shapes and units
napoleon_use_ivar = True

_whole: dict[str, list[str]] = {}
"""Docstrings of constants, which Napoleon would split at their first colon."""


def inline(page: HTML5Translator, node: nodes.math) -> None:
    """An equation in a line, as MathML: browsers show it without a script from elsewhere."""
    page.body.append(convert(node.astext()))
    raise nodes.SkipNode


def block(page: HTML5Translator, node: nodes.math_block) -> None:
    """An equation on a line of its own."""
    page.body.append(f'<div class="equation">{convert(node.astext(), display="block")}</div>')
    raise nodes.SkipNode


def before_napoleon(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Keep what is no Google docstring, and turn the headings of Gymnasium's kind into rubrics."""
    if what in ("attribute", "data", "property"):
        _whole[name] = lines[:]
        lines.clear()
    headings = "\n".join(lines)
    lines[:] = re.sub(r"^#+ (.*)$", r".. rubric:: \1\n", headings, flags=re.MULTILINE).split("\n")


def after_napoleon(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Put back what was kept."""
    lines.extend(_whole.pop(name, []))


def drop_sourceless(app: Sphinx) -> list[Any]:
    """Modules without a source have no page, but Sphinx would link to one."""
    modules = app.env._viewcode_modules
    for name in [name for name, entry in modules.items() if not entry]:
        del modules[name]
    return []  # no page of our own


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", before_napoleon, priority=400)
    app.connect("autodoc-process-docstring", after_napoleon, priority=600)
    app.connect("html-collect-pages", drop_sourceless, priority=400)
    app.add_html_math_renderer(
        "mathml", inline_renderers=(inline, None), block_renderers=(block, None)
    )
