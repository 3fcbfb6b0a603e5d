"""The drawing of a model shows where the parts are, in the colours of the modes, and moves in real time."""

from __future__ import annotations

import base64
import io
import itertools
import json
import math
import os
import re
import stat
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgb
from matplotlib.patches import PathPatch
from PIL import Image

import hybridsim as hs
from hybridsim.plot import animate, mechanism
from hybridsim.plot.drawing import animation
from hybridsim.plot.drawing.canvas import Canvas
from hybridsim.plot.drawing.clip import Clip
from hybridsim.plot.drawing.frame import Frame
from hybridsim.plot.drawing.kinds import items_of
from hybridsim.plot.drawing.layout import ends_of
from hybridsim.plot.drawing.outlines import Label
from hybridsim.plot.drawing.poses import poses_at
from hybridsim.plot.drawing.theme import DARK, LIGHT, Theme
from hybridsim.plot.shared.smooth_parts import Window
from hybridsim.presentation.colours import INK, PALETTE

SLIDE = """
name = "slide"
[parameters]
l = 3
[states]
x = { start = 1, der = "v", unit = "m" }
v = { start = -0.5, der = "-f", unit = "m/s" }
[contacts.f]
velocity = "v"
normal = 1
law = { name = "coulomb", mu = 0.25 }
[drawing]
wall = { kind = "wall", at = ["-l", 0] }
block = { kind = "mass", at = ["x", 0], size = [1, 0.5], mode_of = "f" }
spring = { kind = "spring", ends = ["wall", "block"] }
damper = { kind = "damper", ends = ["wall", "block"], offset = 0.1 }
force = { kind = "arrow", at = ["x", 0], vector = ["2*f", "t"] }
"""


@pytest.fixture(scope="module")
def slide() -> hs.Solution:
    """A block that slides to the left from x = 1 with v = -1/2, and stops at t = 2, x = 1/2."""
    return hs.simulate(hs.Model.from_toml(SLIDE), (0, 4))


def test_shapes_are_where_their_expressions_say(slide: hs.Solution) -> None:
    times = np.array([0.0, 1.0, 3.0])
    x = [1.0, 1.0 - 0.5 + 0.125, 0.5]  # x = 1 - t/2 + t^2/8 until the block stops
    canvas = Canvas(slide, Window(0.0, 4.0), LIGHT)
    for t, place, poses in zip(times, x, poses_at(slide, times)):
        assert poses["block"].at == pytest.approx([place, 0.0])
        assert poses["force"].vector == pytest.approx([-0.5 if t < 2 else 0.0, t])
        start, end = ends_of(poses["spring"], poses, canvas.layout)
        assert start == pytest.approx([-3.0, 0.25])  # opposite to the middle of the block
        assert end == pytest.approx([place - 0.5, 0.25])  # at its left side
        start, end = ends_of(poses["damper"], poses, canvas.layout)
        assert start == pytest.approx([-3.0, 0.35])
        assert end == pytest.approx([place - 0.5, 0.35])


@pytest.mark.parametrize("angle", range(0, 360, 15))
def test_the_text_of_an_arrow_is_beside_it(angle: int) -> None:
    direction = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    vector = [f"({c!r})*(x + 1)" for c in direction]
    drawing = [
        hs.Shape("block", "mass", at=["x", 0], size=[1, 1]),
        hs.Shape("force", "arrow", at=[0, 0], vector=vector, text="N"),
    ]
    solution = hs.simulate(hs.Model("arrow", [hs.State("x", 0, "0*x")], drawing=drawing), (0, 1))
    canvas = Canvas(solution, Window(0.0, 1.0), LIGHT)
    (poses,) = poses_at(solution, np.array([0.0]))
    (label,) = (item for item in items_of(Frame(poses, canvas.layout, LIGHT, {})) if isinstance(item, Label))
    along = min(max(float(np.dot(label.point, direction)), 0.0), 1.0)
    assert np.hypot(*(label.point - along * np.array(direction))) > 0.2 * canvas.layout.unit


def test_a_contact_has_the_colour_of_its_mode(slide: hs.Solution) -> None:
    canvas = Canvas(slide, Window(0.0, 4.0), LIGHT)
    colours = [canvas._colours_at(t)["block"] for t in (1.0, 3.0)]
    assert colours == [canvas.colours["slip-"], INK] and colours[0] != INK
    for t, colour in zip((1.0, 3.0), colours):
        thick = [p for p in mechanism(slide, t).patches if isinstance(p, PathPatch) and p.get_linewidth() > 4]
        assert [to_hex(p.get_edgecolor()) for p in thick] == [colour.lower()]
        axes = mechanism(slide, t)
        assert axes.get_title(loc="left") == f"t = {t:g} s"
        mode = "stick" if colour == INK else "slip-"
        assert [text.get_text() for text in axes.get_legend().get_texts()] == [f"f: {mode}"]


def test_pictures_of_one_run_have_one_scale(slide: hs.Solution) -> None:
    first, last = mechanism(slide, 0.0), mechanism(slide)
    assert first.get_xlim() == last.get_xlim() and first.get_ylim() == last.get_ylim()
    assert first.get_aspect() == 1.0
    assert first.get_xlim()[0] < -3.0 and first.get_xlim()[1] > 1.5
    assert [text.get_text() for text in first.texts] == ["1 m"]  # the bar that shows the scale


@pytest.mark.parametrize("name", [info.name for info in hs.list_models() if hs.load(info.name).drawing])
def test_packaged_models_are_drawn(name: str) -> None:
    """Without a run over their whole duration: the first moments show every shape."""
    model = hs.load(name)
    solution = hs.simulate(model, (0, 1e-3 * (model.duration_value() or 1.0)), integrator="scipy-dop853")
    window = Window(solution.t_start, solution.t_end)
    canvas = Canvas(solution, window, DARK)
    assert np.isfinite([*canvas.low, *canvas.high]).all() and (canvas.high > canvas.low).all()
    assert 0.05 < canvas.aspect < 20
    assert list(canvas.artists(mechanism(solution), solution.t_end))
    for quantities in ([], [model.states[0].name]):
        assert len(list(Clip(solution, quantities, window, None, 0.1, LIGHT).pictures())) == 2


@pytest.mark.parametrize("speed", [0.9, -0.9])
def test_a_damper_stays_between_its_ends(speed: float) -> None:
    """A block that is moved from 1 to 1.9 or to 0.1 from the wall at x = 0."""
    states = [hs.State("x", 1, repr(speed))]
    shapes = [
        hs.Shape("wall", "wall", at=(0, 0)),
        hs.Shape("block", "mass", at=("x + 0.1", 0), size=(0.2, 0.2)),
        hs.Shape("damper", "damper", ends=("wall", "block"), size=0.1),
    ]
    moved = hs.simulate(hs.Model("moved", states, drawing=shapes), (0, 1))
    canvas = Canvas(moved, Window(0.0, 1.0), LIGHT)
    for t in (0.0, 0.5, 1.0):
        poses = poses_at(moved, np.array([t]))[0]
        drawn = items_of(Frame({"damper": poses["damper"], **poses}, canvas.layout, LIGHT, {}))
        x = np.concatenate([item.points[:, 0] for item in drawn if item.width < 4 and item.points.size > 0])
        assert x.min() >= -canvas.layout.hatch - 1e-12 and x.max() <= 1.0 + speed * t + 0.2 + 1e-12


CART = """
name = "cart"
[states]
x = { start = 0, der = 1 }
[drawing]
ground = { kind = "ground", at = [0, 0] }
cart = { kind = "mass", at = ["x", 0], size = [1, 0.5] }
moving = { kind = "pendulum", at = ["x", 0.25], length = 3, angle = 0 }
fixed = { kind = "pendulum", at = [0, 3], length = 1, angle = 0 }
"""


def test_a_ground_is_below_its_bodies_and_only_a_fixed_pivot_has_a_support() -> None:
    """The bob of the moving pendulum hangs 2.75 below the ground, and moves the mean of the bodies below it."""
    solution = hs.simulate(hs.Model.from_toml(CART), (0, 1))
    layout = Canvas(solution, Window(0.0, 1.0), LIGHT).layout
    strokes = {
        name: [item for item in items_of(Frame({name: pose}, layout, LIGHT, {})) if item.line == LIGHT.weak]
        for name, pose in poses_at(solution, np.array([0.5]))[0].items()
    }
    assert all(stroke.points[:, 1].max() <= 1e-12 for stroke in strokes["ground"])
    assert strokes["ground"] and strokes["fixed"] and not strokes["moving"]


def frames_of(path: Path) -> tuple[list[np.ndarray], list[int]]:
    """The pictures of a GIF and the time of each in milliseconds."""
    with Image.open(path) as image:
        pictures, durations = [], []
        for k in range(image.n_frames):
            image.seek(k)
            pictures.append(np.asarray(image.convert("RGB")))
            durations.append(image.info["duration"])
    return pictures, durations


def test_a_gif_moves_in_real_time(slide: hs.Solution, tmp_path: Path) -> None:
    seen: list[float] = []
    path = slide.animate(tmp_path / "a.gif", ["x"], speed=2.0, fps=6, progress=seen.append)
    pictures, durations = frames_of(path)
    assert len(seen) == 13 and seen[-1] == 1.0 and seen == sorted(seen)  # 4 s at twice the speed, both ends
    assert sum(durations) == pytest.approx(1000 * (2.0 + 1 / 6 + 1.0), abs=11)  # and a pause of a second
    assert len({picture.shape for picture in pictures}) == 1
    moving = [not np.array_equal(a, b) for a, b in itertools.pairwise(pictures)]
    assert all(moving[:6])
    white = (pictures[0] == 255).all(axis=2).mean()
    assert white > 0.6  # the paper is white, not nearly white


def test_a_page_holds_the_same_pictures(slide: hs.Solution, tmp_path: Path) -> None:
    settings = {"quantities": [], "fps": 2.0, "speed": 1.0}
    gif, page = slide.animate(tmp_path / "a.gif", **settings), slide.animate(tmp_path / "a.html", **settings)
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"(?:src|href) *= *[\"']?http|@import|url\(", text)
    still = re.search(r'still = "(.*?)"', text)
    parts = json.loads(re.search(r"parts = (\[.*?\]), fps", text).group(1))  # type: ignore[union-attr]  # it is there
    pictures, _ = frames_of(gif)
    assert still and len(parts) == 9
    for k in (0, 3, 8):
        whole = Image.open(io.BytesIO(base64.b64decode(still.group(1)))).convert("RGBA")
        part = Image.open(io.BytesIO(base64.b64decode(parts[k][2]))).convert("RGBA")
        whole.alpha_composite(part, (parts[k][0], parts[k][1]))
        if k < len(pictures) - 1:  # the GIF leaves out pictures that do not change
            assert np.array_equal(np.asarray(whole.convert("RGB")), pictures[k])


def test_the_speed_is_round_and_the_number_of_frames_is_bounded(slide: hs.Solution, tmp_path: Path) -> None:
    clip = Clip(slide, [], Window(0.0, 4.0), None, 20.0, LIGHT)
    assert clip.speed == 1.0  # 4 s in 8 s is near to real time
    assert len(clip.times) == 81 and clip.times[-1] == 4.0
    with pytest.raises(hs.UsageError, match=r"would have 4001 frames.*\nuse speed=0\.0801 or more"):
        animate(slide, tmp_path / "a.gif", speed=0.02)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"path": "a.avi"}, r"unsupported file type '\.avi'\nuse \.gif, \.html, \.mp4"),
        ({"fps": 51.0}, r"`fps` cannot be 51\.0\nuse a positive number up to 50"),
        ({"fps": math.nan}, "`fps` cannot be nan"),
        ({"speed": 0.0}, "`speed` cannot be 0"),
        ({"speed": "fast"}, "`speed` cannot be 'fast'"),
        ({"quantities": ["y"]}, "quantities: the run has no 'y'"),
        ({"t_span": (5, 6)}, "outside the run"),
        ({"t_span": (1, 1)}, "no curve from t = 1 to 1"),
    ],
)
def test_wrong_arguments_are_refused(
    slide: hs.Solution, settings: dict, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(hs.UsageError, match=message):
        slide.animate(**{"path": "a.gif", **settings})
    assert not list(tmp_path.iterdir())


def test_a_model_without_a_drawing_says_what_to_do(tmp_path: Path) -> None:
    bare = hs.simulate(hs.Model("bare", [hs.State("x", 1, "-x")]), (0, 1))
    for draw in (lambda: mechanism(bare, 0.5), lambda: bare.animate(tmp_path / "a.gif")):
        with pytest.raises(hs.UsageError, match=r"bare has no drawing\nadd \[drawing\] to the model file"):
            draw()


def test_after_an_error_the_former_file_is_there(slide: hs.Solution, tmp_path: Path) -> None:
    path = tmp_path / "a.gif"
    path.write_bytes(b"before")

    def stop(part: float) -> None:
        if part > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        slide.animate(path, [], fps=2, progress=stop)
    assert path.read_bytes() == b"before" and os.listdir(tmp_path) == ["a.gif"]


def test_an_mp4_needs_ffmpeg(slide: hs.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(animation.shutil, "which", lambda name: None)
    with pytest.raises(hs.UsageError, match=r"needs the program ffmpeg, which was not found\ninstall ffmpeg"):
        slide.animate(tmp_path / "a.mp4")


@pytest.mark.skipif(os.name == "nt", reason="the stand-in for ffmpeg is a shell script")
@pytest.mark.parametrize("fails", [False, True])
def test_an_mp4_is_encoded_from_all_pictures(
    slide: hs.Solution, fails: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A program in the place of ffmpeg stores what it reads, or fails."""
    program = tmp_path / "ffmpeg"
    last = "echo 'no such encoder' >&2; exit 1" if fails else 'for out; do :; done; cat > "$out"'
    program.write_text(f"#!/bin/sh\n{last}\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    path = tmp_path / "a.mp4"
    if fails:
        with pytest.raises(hs.UsageError, match="ffmpeg failed: no such encoder"):
            slide.animate(path, [], fps=2)
        assert not path.exists()
        return
    slide.animate(path, [], fps=2)
    clip = Clip(slide, [], Window(0.0, 4.0), None, 2.0, LIGHT)
    assert path.stat().st_size == len(clip.times) * next(clip.pictures()).size


def contrast(one: str, other: str) -> float:
    """Contrast of two colours by WCAG 2.2."""

    def light(colour: str) -> float:
        parts = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
        return float(np.dot(parts, [0.2126, 0.7152, 0.0722]))

    low, high = sorted((light(one), light(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_colours_can_be_told_from_the_background(theme: Theme) -> None:
    assert contrast(theme.ink, theme.paper) > 7 and contrast(theme.ink, theme.body) > 4.5
    assert contrast(theme.force, theme.paper) > 4.5
    assert all(contrast(theme.mode(colour), theme.paper) > 2 for colour in (INK, *PALETTE[:4]))
