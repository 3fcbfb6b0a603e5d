"""This module writes the animation of a run as a GIF, an HTML page or an MP4 film."""

from __future__ import annotations

import math
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from os import PathLike
from pathlib import Path
from typing import cast

import numpy as np
from PIL import Image, ImageColor

from hybridsim.arguments import callback, cannot_be, flag, is_row, known_name, number, two_numbers
from hybridsim.errors import UsageError
from hybridsim.files import path_text, whole_file, write_text
from hybridsim.model.checks.units import units_of
from hybridsim.model.parts.model import Model
from hybridsim.plot.drawing.clip import Clip, Picture
from hybridsim.plot.drawing.player import page
from hybridsim.plot.drawing.poses import refuse_without_drawing
from hybridsim.plot.drawing.theme import DARK, LIGHT
from hybridsim.plot.shared.smooth_parts import refuse_arrays, window_of
from hybridsim.solution import Solution

SUFFIXES = (".gif", ".html", ".mp4")
_CURVES = 2  # the default number of quantities
_COLOURS = 32  # of a GIF or of a page, in one palette for all pictures
_PAUSE = 1.0  # seconds at the end of a GIF before it begins again
_SAME = 10  # largest difference of two shades, of 255, that count as one
_MOST_FPS = 50.0  # browsers show GIFs no faster
_SAMPLES = 9  # pictures from which the palette is taken


def animate(
    solution: Solution,
    path: str | PathLike[str],
    quantities: Sequence[str] | None = None,
    *,
    t_span: tuple[float, float] | None = None,
    speed: float | None = None,
    fps: float = 20.0,
    dark: bool = False,
    progress: Callable[[float], None] | bool | None = None,
) -> Path:
    """Write the moving mechanism of a run, next to its curves and modes, to a file.

    The arguments are those of `Solution.animate`.
    """
    refuse_arrays(solution)
    path = Path(path_text(path))
    check_animation(solution.model, path)
    fps = _positive("fps", fps, _MOST_FPS)
    speed = None if speed is None else _positive("speed", speed, math.inf)
    if t_span is not None:
        t_span = two_numbers(t_span, "t_span", "use two times (t0, t1)")
    on_progress = callback(progress)
    theme = DARK if flag(dark, "dark") else LIGHT
    clip = Clip(solution, _names(solution, quantities), window_of(solution, t_span), speed, fps, theme)
    pictures = _counted(clip, on_progress)
    suffix = path.suffix.lower()
    if suffix == ".mp4":
        _write_film(path, pictures, clip)
    elif suffix == ".gif":
        _write_gif(path, pictures, clip)
    else:
        title = solution.model.title or solution.model.name
        write_text(path, page(title, list(_with_one_palette(pictures, clip)), fps, dark))
    return path


def _names(solution: Solution, quantities: object) -> list[str]:
    """Return the names of the quantities to draw."""
    if quantities is None:
        return list(units_of(solution.model))[:_CURVES]
    if not is_row(quantities):
        raise cannot_be("quantities", quantities, "use a list of names")
    known = (*solution.names, *solution.quantities)
    names = list(cast("Sequence[object]", quantities))
    return [known_name(name, known, "quantities: the run has no", "quantities") for name in names]


def _positive(name: str, value: object, most: float) -> float:
    limit = "" if most == math.inf else f" up to {most:g}"
    found = number(value, name, f"use a positive number{limit}")
    if not 0 < found < math.inf or found > most:
        raise cannot_be(name, value, f"use a positive number{limit}")
    return found


def check_animation(model: Model, path: Path) -> None:
    """Raise an error if a model has no drawing, or if a file of this type cannot be written."""
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(
            f"path {path}: unsupported file type {path.suffix!r}", remedy=f"use {', '.join(SUFFIXES)}"
        )
    refuse_without_drawing(model)
    if path.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise UsageError(
            f"{path}: an MP4 needs the program ffmpeg, which was not found",
            remedy="install ffmpeg (apt install ffmpeg, brew install ffmpeg), or write a .gif or .html file",
        )


def _counted(clip: Clip, progress: Callable[[float], None] | None) -> Iterator[Picture]:
    """Yield the pictures of a clip, and report the finished fraction."""
    for k, picture in enumerate(clip.pictures(), start=1):
        yield picture
        if progress is not None:
            progress(k / len(clip.times))


def _with_one_palette(pictures: Iterator[Picture], clip: Clip) -> Iterator[Image.Image]:
    """Yield pictures with a common palette: the colours of the theme, and the most common other colours."""
    every = [Image.fromarray(picture) for picture in pictures]
    chosen = every[:: max(1, len(every) // _SAMPLES)]
    mosaic = Image.new("RGB", (every[0].width, every[0].height * len(chosen)))
    for k, picture in enumerate(chosen):
        mosaic.paste(picture, (0, k * picture.height))
    reduced = mosaic.quantize(_COLOURS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    found = np.array(reduced.getpalette()).reshape(-1, 3)
    own = np.array([ImageColor.getrgb(colour) for colour in dict.fromkeys(clip.palette)])
    is_other = np.abs(found[:, None] - own[None]).max(axis=2).min(axis=1) > _SAME
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.concatenate([own, found[is_other]])[:_COLOURS].ravel().tolist())
    for picture in every:
        yield picture.quantize(palette=palette, dither=Image.Dither.NONE)


def _write_gif(path: Path, pictures: Iterator[Picture], clip: Clip) -> None:
    first, *rest = _with_one_palette(pictures, clip)
    # the format counts in hundredths of a second
    ends = [round(100 * k / clip.fps) for k in range(1, len(rest) + 2)]
    durations = [10 * (b - a) for a, b in zip([0, *ends], ends)]
    durations[-1] += round(1000 * _PAUSE)
    with whole_file(path) as partly:
        first.save(
            partly,
            "GIF",
            save_all=True,
            append_images=rest,
            duration=durations,
            loop=0,
            disposal=1,
            optimize=True,
        )


def _write_film(path: Path, pictures: Iterator[Picture], clip: Clip) -> None:
    """Encode the pictures with ffmpeg, which reads them from its standard input."""
    first = next(pictures)
    height, width = first.shape[:2]
    with whole_file(path) as partly:
        command = [
            "ffmpeg", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
            "-r", f"{clip.fps:g}", "-i", "-", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p",
            "-f", "mp4", "-y", partly,
        ]  # fmt: skip
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            assert process.stdin is not None and process.stderr is not None
            try:
                process.stdin.write(first.tobytes())
                for picture in pictures:
                    process.stdin.write(picture.tobytes())
                process.stdin.close()
            except BrokenPipeError:
                pass  # ffmpeg has ended, and its message says why
            message = process.stderr.read().decode(errors="replace").strip()
        if process.returncode:
            raise UsageError(f"{path}: ffmpeg failed: {message}", remedy="write a .gif or .html file instead")
