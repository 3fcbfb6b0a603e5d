"""How Sphinx makes the site out of these pages: `sphinx-build -W docs site`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import hybridsim

sys.path.insert(0, str(Path(__file__).parent / "make"))
import figures
import picture_links
import search_words

project, author = "hybridsim", "The hybridsim developers"
project_copyright = "The hybridsim developers"
version = release = hybridsim.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "_templates", "examples", "studies/rivals", "**/.ipynb_checkpoints"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}

myst_enable_extensions = ["deflist", "colon_fence"]
myst_heading_anchors = 3

autosummary_generate = True  # writes a page for each name of reference/api.md into the folder reference/api
templates_path = ["_templates"]
default_role = "py:obj"  # names in single quotes of docstrings are links
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "image_scrapers": ("example_pictures.take",),  # in docs/make
    "reset_modules": (),
    "only_warn_on_example_error": False,
    "abort_on_example_error": True,
    "write_computation_times": False,
    "capture_repr": (),
    "within_subsection_order": "FileNameSortKey",
}

html_theme = "pydata_sphinx_theme"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_title = "hybridsim"
html_search_scorer = str(Path(__file__).parent / "make" / "search_scorer.js")
html_theme_options = {
    "navigation_with_keys": False,
    "show_prev_next": False,
    "secondary_sidebar_items": ["page-toc"],
    "header_links_before_dropdown": 7,
}


def setup(app: Any) -> None:
    """Add the search words and the foot of each page, which states the sources of its figures; make pictures links."""

    def add(app: Any, name: str, source: list[str]) -> None:
        source[0] = search_words.add(name, source[0]) + figures.footer(f"{name}.md")

    app.connect("source-read", add)
    app.connect("doctree-resolved", picture_links.add)
