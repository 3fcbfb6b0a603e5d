"""The pictures of the pages can be read: the size, the contrast and the place of their text, and their scales."""

from __future__ import annotations

import ast
import importlib
import re
import sys
from dataclasses import replace
from math import nan
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from plot.fake_comparison import comparison
from plot.fake_solution import ball, oscillator

from hybridsim.plot import friction_law, phase_portrait, save, time_history, work_precision
from hybridsim.plot.atlas import scene
from hybridsim.plot.shared import style
from hybridsim.testing.atlas.example import Example, Line

sys.path.append(str(Path(__file__).parents[2] / "docs" / "make"))
sys.path.append(str(Path(__file__).parents[2] / "docs" / "studies"))
from check_pictures import IMAGES, contrast, faults_of_figure, faults_of_file, faults_of_png

DOCS = IMAGES.parent


@pytest.mark.parametrize("script", sorted(DOCS.rglob("*.py")), ids=lambda path: path.name)
def test_scripts_of_the_pages_import_what_exists(script: Path) -> None:
    """They run rarely, so that a module that has moved would be missed."""
    for node in ast.walk(ast.parse(script.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("hybridsim"):
            continue
        module = importlib.import_module(str(node.module))
        for name in [alias.name for alias in node.names if not hasattr(module, alias.name)]:
            importlib.import_module(f"{node.module}.{name}")


@pytest.mark.parametrize("path", sorted(IMAGES.rglob("*.png")), ids=lambda path: path.name)
def test_a_picture_is_not_so_wide_that_its_text_is_too_small(path: Path) -> None:
    assert not faults_of_png(path)


def test_contrast_is_that_of_wcag() -> None:
    """Black on white has 21, and #767676 is the palest grey with 4.5."""
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
    assert contrast("#767676", "#ffffff") >= 4.5 > contrast("#777777", "#ffffff")


@pytest.mark.parametrize("path", sorted(IMAGES.rglob("*.svg")), ids=lambda path: path.name)
def test_the_text_of_a_picture_can_be_read(path: Path) -> None:
    assert not faults_of_file(path)


@pytest.mark.parametrize(
    "draw",
    [
        lambda: time_history(oscillator(3)),
        lambda: time_history(ball()),
        lambda: phase_portrait(oscillator(3)),
        lambda: friction_law("coulomb", {"mu": 0.5}, speed=1),
        lambda: work_precision(comparison()),
    ],
)
def test_labels_have_room(draw) -> None:
    assert not faults_of_figure(style.figure_of(draw()))


def test_a_picture_of_the_atlas_writes_numbers_of_events_and_draws_no_empty_strip() -> None:
    """Times of a thousandth have room, and small values have a power of ten on their axis."""
    t = np.linspace(0, 2.1e-3, 50)
    right, failing = (Line(name, t, 1e-6 * t, np.array([1e-3] * n)) for name, n in (("right", 2), ("dop", 1)))
    figure = style.figure_of(scene(Example("y", "", right, failing, ())))
    assert not faults_of_figure(figure)
    assert [text.get_text() for text in figure.axes[-1].texts] == ["2 events", "1 event"]
    assert figure.axes[0].get_ylabel() == "y [$10^{-9}$]"
    none = replace(right, events=np.array([]))
    assert len(style.figure_of(scene(Example("y", "", none, None, ()))).axes) == 1


def test_the_caption_of_the_guards_agrees_with_their_picture() -> None:
    """The page says that a comparison of signs is wrong in the third and in the fourth case."""
    svg = (IMAGES / "event-domain.svg").read_text(encoding="utf-8")
    assert re.findall(r"test of signs (\w+)", svg) == ["right", "right", "wrong", "wrong"]
    page = (DOCS / "explanation" / "events.md").read_text(encoding="utf-8")
    assert "is wrong in two of the four cases" in " ".join(page.split())


def test_pictures_become_links_except_thumbnails_of_examples() -> None:
    """A thumbnail lies below the link to its example, which a second link would displace."""
    links = pytest.importorskip(
        "picture_links", reason="the extra docs is not installed", exc_type=ImportError
    )
    nodes = links.nodes
    uris = ("images/one.png", "gallery/images/thumb/two.png")
    document = nodes.section("", *(nodes.image(uri=uri) for uri in uris))
    app = SimpleNamespace(
        builder=SimpleNamespace(get_target_uri=lambda page: f"{page}.html"),
        env=SimpleNamespace(images={uri: (set(), Path(uri).name) for uri in uris}),
    )
    links.add(app, document, "page")
    assert [type(node) for node in document.children] == [nodes.reference, nodes.image]
    assert document.children[0]["refuri"] == "_images/one.png"


def test_methods_with_undefined_errors_are_at_the_top_of_the_chart_of_speed(tmp_path: Path) -> None:
    chart = importlib.import_module("rivals.chart")
    lines = [
        SimpleNamespace(
            method=SimpleNamespace(label=name, family="rival", shown=True),
            errors=SimpleNamespace(times=error, states=1e-6, right=right),
            events=SimpleNamespace(middle=seconds),
            grid=SimpleNamespace(middle=seconds),
        )
        for name, seconds, error, right in (
            ("late", 1e-1, nan, False),
            ("early", 1e-2, nan, False),
            ("good", 1e-3, 1e-9, True),
            ("unknown", 1e-4, nan, None),
        )
    ]
    figures: list[Figure] = []
    with mock.patch.object(style, "save", lambda figure, path: figures.append(figure)):
        chart.charts({"P1": SimpleNamespace(title="P1")}, {"P1": lines}, tmp_path)
    panel = figures[0].axes[0]
    marks = {line.get_xdata()[0]: line.get_ydata()[0] for line in panel.lines}
    assert marks == {1e-3: 1e-9, 1e-2: panel.get_ylim()[1], 1e-1: panel.get_ylim()[1]}
    assert "at the top, from the left:\nearly\nlate" in [text.get_text() for text in panel.texts]


def written(tmp_path: Path, **settings) -> Path:
    figure = Figure(figsize=(4, 3))
    figure.text(0.5, 0.5, "a text", **settings)
    return save(figure, tmp_path / "picture.svg")


def test_faults_of_a_file_are_found(tmp_path: Path) -> None:
    assert not faults_of_file(written(tmp_path, fontsize=9))
    assert "too small" in faults_of_file(written(tmp_path, fontsize=6))[0]
    assert "too pale" in faults_of_file(written(tmp_path, color="#aaaaaa"))[0]


def drawn() -> tuple[Figure, Axes]:
    figure = style.figure(6, 4)
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1])
    return figure, axes


def test_faults_of_a_figure_are_found() -> None:
    assert not faults_of_figure(drawn()[0])
    figure, axes = drawn()
    axes.text(0.5, 0.5, "one")
    axes.text(0.5, 0.5, "two")
    assert faults_of_figure(figure) == ["'one' overlaps 'two'"]
    figure, axes = drawn()
    axes.set(xlabel="x [m]", ylabel="y [m]")
    assert faults_of_figure(figure) == ["both axes have the unit m, but unequal scales"]
    axes.set_aspect("equal")
    assert not faults_of_figure(figure)
    assert "leaves the picture" in faults_of_figure(_with_text_outside())[0]
    assert faults_of_figure(style.figure(12, 4)) == ["the picture is 1152 pixels wide"]


def _with_text_outside() -> Figure:
    figure = Figure(figsize=(4, 3))
    figure.text(0.99, 0.5, "a long text that does not fit")
    return figure
