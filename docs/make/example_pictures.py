"""Gives the site the pictures that an example of `docs/examples` has saved beside itself."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from sphinx_gallery.scrapers import figure_rst


def take(block: Any, variables: dict[str, Any], gallery: dict[str, Any]) -> str:
    """Move what a block of an example saved to where the site expects it, and return the lines that show it."""
    shown = []
    for picture in sorted(
        Path(variables["src_file"]).parent.glob("*.png"), key=lambda path: path.stat().st_mtime
    ):
        shown.append(variables["image_path_iterator"].next())
        shutil.move(picture, shown[-1])
    return str(figure_rst(shown, gallery["src_dir"]))
