"""This module saves pictures as small files with few colours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PIL import Image

from hybridsim.files import whole_file
from hybridsim.plot.shared.style import save

_COLOURS = 48


def save_small(picture: Any, path: Path, dpi: float = 100.0) -> Path:
    """Write a .png file with its own palette; the file has a third of the normal size."""
    with whole_file(path) as partly:
        save(picture, partly, dpi)
        with Image.open(partly) as image:
            reduced = image.convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE)
        reduced.save(partly, optimize=True)
    return path
