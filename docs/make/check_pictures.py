"""Checks pictures for text that is too small or too pale, labels that overlap, and circles that are not round.

python docs/make/check_pictures.py        (all files of docs/images, and the figures of their scripts)
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any
from unittest import mock

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from PIL import Image

from hybridsim.plot.shared import style

IMAGES = Path(__file__).parents[2] / "docs" / "images"
COLUMN = 850  # pixels: the width of the text of a page on a wide screen
LEAST_SIZE, LEAST_INDEX = 9.0, 8.0  # pixels of letters, and of indices and exponents
LEAST_FONT = 8.0  # points: of the texts in PNG files, of which only the width is known
LEAST_CONTRAST = 4.5  # of text, by WCAG 2.1
PIXELS = 96 / 72  # of a page, for a point
TOUCH = 1.0  # points by which the boxes of two texts may overlap


def contrast(first: str, second: str) -> float:
    """The contrast of two colours by WCAG 2.1, from 1 to 21."""

    def luminance(colour: str) -> float:
        parts = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
        return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]

    dark, light = sorted((luminance(first), luminance(second)))
    return (light + 0.05) / (dark + 0.05)


def faults_of_file(path: Path) -> list[str]:
    """Faults of an SVG file: size and contrast of its text, and a background that is not white."""
    svg = path.read_text(encoding="utf-8")
    found = re.search(r'<svg [^>]*width="([\d.]+)pt"', svg)
    if found is None:
        return ["the width is unknown"]
    scale = PIXELS * min(1.0, COLUMN / (float(found[1]) * PIXELS))
    faults = [] if "fill: #ffffff" in svg else ["no white background: unreadable on a dark page"]
    for tag, text in re.findall(r"(<text [^>]*>)(.*?)</text>", svg, flags=re.DOTALL):
        label = re.sub(r"<[^>]*>", "", text).strip()
        colour = re.search(r"fill: (#\w+)", tag)
        if colour and contrast(colour[1], "#ffffff") < LEAST_CONTRAST:
            faults.append(f"{label!r} is too pale: {contrast(colour[1], '#ffffff'):.1f}")
        for size in re.findall(r"font-size: ([\d.]+)px", tag + text):
            least = LEAST_SIZE if "<tspan" not in text else LEAST_INDEX
            if float(size) * scale < least:
                faults.append(f"{label!r} is too small: {float(size) * scale:.1f} pixels")
    return faults


def faults_of_png(path: Path) -> list[str]:
    """The fault of a PNG file that is so wide that a page shows its letters too small."""
    with Image.open(path) as picture:
        width = picture.width / round(picture.info.get("dpi", (96.0, 96.0))[0]) * 96
    size = LEAST_FONT * PIXELS * min(1.0, COLUMN / width)
    return [f"letters of {LEAST_FONT:g} points have {size:.1f} pixels"] if size < LEAST_SIZE else []


def faults_of_figure(figure: Figure) -> list[str]:
    """Faults of a figure: labels that overlap or leave the picture, too wide, unequal scales of one unit."""
    boxes = list(_drawn_texts(figure))
    page = figure.bbox
    width = figure.get_figwidth() * 96
    faults = [f"the picture is {width:.0f} pixels wide"] if width > COLUMN else []
    for text, box in boxes:
        if (
            box.x0 < page.x0 - TOUCH
            or box.x1 > page.x1 + TOUCH
            or box.y0 < page.y0 - TOUCH
            or box.y1 > page.y1 + TOUCH
        ):
            faults.append(f"{text!r} leaves the picture")
    for (first, one), (second, two) in combinations(boxes, 2):
        wide, high = min(one.x1, two.x1) - max(one.x0, two.x0), min(one.y1, two.y1) - max(one.y0, two.y0)
        if wide > TOUCH and high > TOUCH:
            faults.append(f"{first!r} overlaps {second!r}")
    for axes in figure.axes:
        units = [re.search(r"\[(.*)\]$", label) for label in (axes.get_xlabel(), axes.get_ylabel())]
        extents = axes.dataLim.width, axes.dataLim.height
        is_square = min(extents) > 0 and 0.25 < extents[0] / extents[1] < 4
        if all(units) and units[0][1] == units[1][1] and is_square and axes.get_aspect() != 1.0:  # type: ignore[index]
            faults.append(f"both axes have the unit {units[0][1]}, but unequal scales")  # type: ignore[index]
    return faults


def _drawn_texts(figure: Figure) -> Iterator[tuple[str, Bbox]]:
    """The texts that are drawn, with their boxes in pixels."""
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()  # the layout
    found: list[tuple[str, Bbox]] = []
    draw = Text.draw

    def record(text: Text, renderer: Any, *rest: Any, **more: Any) -> None:
        if text.get_visible() and text.get_text().strip():
            found.append((text.get_text(), Text.get_window_extent(text, renderer)))
        draw(text, renderer, *rest, **more)

    with mock.patch.object(Text, "draw", record):
        canvas.draw()
    yield from found


def main() -> int:
    """Check all pictures, print the faults, and return their number."""
    import draw_laws
    import event_pictures
    import gallery
    import landing_picture

    faults = {path.name: faults_of_file(path) for path in sorted(IMAGES.rglob("*.svg"))}
    faults |= {path.name: faults_of_png(path) for path in sorted(IMAGES.rglob("*.png"))}

    def check(picture: Any, path: Path, **settings: Any) -> None:
        faults.setdefault(path.name, []).extend(faults_of_figure(style.figure_of(picture)))

    with mock.patch.object(style, "save", check):
        for module in (draw_laws, landing_picture):
            with mock.patch.object(module, "save", check):
                module.main([]) if module is draw_laws else module.main()
        for draw in (
            event_pictures.draw_domains, event_pictures.draw_releases,
            event_pictures.draw_accumulation, event_pictures.draw_pasts,
        ):  # fmt: skip
            draw()
        for info in gallery.hs.list_models():
            check(gallery.picture_of(info.name), Path(f"{info.name}.svg"))
    for name, found in faults.items():
        for fault in found:
            print(f"{name}: {fault}")
    return sum(map(len, faults.values()))


if __name__ == "__main__":
    sys.exit(min(main(), 1))
