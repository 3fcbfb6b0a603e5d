"""What notebooks show of a run: well-formed, without scripts, of bounded size, and true."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from html.parser import HTMLParser
from itertools import pairwise

import pytest

import hybridsim as hs
from hybridsim.presentation.colours import INK, mode_colours
from hybridsim.presentation.notebook import run_html
from hybridsim.solution.event import ModeInterval

VOID = {"br", "hr", "img"}
HOSTILE = '<script>alert("x")</script><b>&\''


class Page(HTMLParser):
    """Elements in order as (tag, attributes, text); fails on a tag that is not closed."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[tuple[str, dict[str, str | None], list[str]]] = []
        self.elements: list[tuple[str, dict[str, str | None], list[str]]] = []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = (tag, dict(attrs), [])
        self.elements.append(element)
        if tag not in VOID:
            self.open.append(element)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop()[0] == tag

    def handle_data(self, data: str) -> None:
        for _, _, texts in self.open:
            texts.append(data)

    def all(self, tag: str) -> list[tuple[dict[str, str | None], str]]:
        return [(attributes, "".join(texts)) for name, attributes, texts in self.elements if name == tag]

    def text(self) -> str:
        return "".join(self.elements[0][2])


@pytest.fixture(scope="module")
def rubbing() -> hs.Solution:
    return hs.simulate("dfcs", (0, 0.1))


def test_a_strip_is_the_modes(rubbing: hs.Solution) -> None:
    page = Page(rubbing._repr_html_())
    colours = {
        name: "currentColor" if c == INK else c for name, c in mode_colours(rubbing.components).items()
    }
    rectangles = page.all("rect")
    assert len(rectangles) == len(rubbing.modes["f"]) == len(page.all("title"))
    for (attributes, title), interval in zip(rectangles, rubbing.modes["f"], strict=True):
        assert attributes["fill"] == colours[interval.mode]
        mode, start, end = re.fullmatch(r"(\S+): (\S+) to (\S+)", title).groups()
        assert mode == interval.mode
        assert (float(start), float(end)) == pytest.approx((interval.t0, interval.t1), rel=1e-8)
        assert float(attributes["x"]) == pytest.approx(1e4 * interval.t0, abs=0.01)  # 1000 units for 0.1 s
        assert float(attributes["width"]) == pytest.approx(1e4 * (interval.t1 - interval.t0), abs=0.35)
    (svg,) = page.all("svg")
    assert svg[0]["width"] == "100%" and svg[0]["viewbox"].startswith("0 0 1000 ")


def test_short_modes_can_be_seen() -> None:
    """Slips of 2 ms among sticks of seconds are drawn last, as lines of a visible width."""
    ends = [0.0, 10.0, 10.002, 20.0, 20.002, 30.0]
    modes = [ModeInterval(m, a, b) for m, a, b in zip(["stick", "slip+"] * 3, ends, ends[1:])]
    dfcs = hs.load("dfcs").all_components()
    page = Page(run_html(dfcs, {"run": "by hand"}, True, (0.0, 30.0), {"f": modes}, [], []))
    rectangles = page.all("rect")
    assert [title.split(":")[0] for _, title in rectangles] == ["stick"] * 3 + ["slip+"] * 2
    for (attributes, _), middle in zip(rectangles[3:], (10.001, 20.001)):
        width = float(attributes["width"] or 0)
        assert 1.5 <= width < 2
        assert float(attributes["x"] or 0) + width / 2 == pytest.approx(1000 * middle / 30, abs=0.2)


def test_the_events_are_listed(rubbing: hs.Solution) -> None:
    page = Page(rubbing._repr_html_())
    assert f"{len(rubbing.events)} events" in page.text()
    cells = [text for _, text in page.all("td")]
    assert page.all("details") and [text for _, text in page.all("th")] == [
        "t",
        "component",
        "from",
        "to",
        "kind",
    ]
    shown = [*rubbing.events[:20], *rubbing.events[-5:]]
    assert len(rubbing.events) > 25
    for event in shown:
        at = cells.index(f"{event.t:.9g}")
        assert cells[at : at + 5] == [f"{event.t:.9g}", "f", event.source, event.target, "transition"]
    assert f"{rubbing.events[20].t:.9g}" not in cells
    assert f"{len(rubbing.events) - 25} more" in page.text()


def test_how_it_went(rubbing: hs.Solution) -> None:
    page = Page(rubbing._repr_html_())
    for word in ("✔", "finished", rubbing.model.title, "by exact", f"{rubbing.stats['steps']} steps"):
        assert word in page.text()
    failed = hs.simulate(hs.Model("broken", states=(hs.State("x", 1, "x**2"),)), (0, 2))
    page = Page(failed._repr_html_())
    assert not failed.success
    for word in ("✘", failed.status, failed.message, "broken"):
        assert word in page.text()
    assert not page.all("svg") and not page.all("details")


def test_nothing_of_a_page_is_assumed(rubbing: hs.Solution) -> None:
    """No script, no style sheet, no address, no fixed background but that of the legend's squares."""
    text = rubbing._repr_html_()
    page = Page(text)
    tags = {tag for tag, _, _ in page.elements}
    assert not tags & {"script", "style", "link", "img", "iframe"}
    assert "http" not in text and "javascript" not in text
    grounds = set(re.findall(r"background:([^;\"]+)", text))
    assert grounds == {"none", "currentColor", "#0072B2", "#D55E00"}
    for match in re.findall(r'style="[^"]*"', text):
        assert not re.search(r"(?<![-\w])color:(?!#009E73|#D55E00)", match)


@dataclass(frozen=True)
class Spell:
    mode: str
    t0: float
    t1: float


@dataclass(frozen=True)
class Happening:
    t: float
    component: str
    source: str
    target: str
    kind: str = "transition"


def switch(*modes: str) -> tuple[hs.Component, ...]:
    declared = [hs.Mode(name, set={"u": k}) for k, name in enumerate(modes)]
    return (hs.Component("c", declared, initial=modes[0]),)


def test_all_text_is_escaped() -> None:
    text = run_html(
        switch(HOSTILE),
        {HOSTILE: HOSTILE, HOSTILE + "2": HOSTILE},
        False,
        (0.0, 1.0),
        {HOSTILE: [Spell(HOSTILE, 0.0, 1.0)]},
        [Happening(0.5, HOSTILE, HOSTILE, HOSTILE, HOSTILE)],
        [HOSTILE],
    )
    page = Page(text)
    assert not page.all("script") and len(page.all("b")) == 1
    # head, strip, legend, title, event, warning
    assert page.text().count(HOSTILE) == 3 + 1 + 1 + 1 + 4 + 1 + 1


def test_a_hostile_title_of_a_model() -> None:
    model = hs.Model("m", states=(hs.State("x", 1, "-x"),), title=HOSTILE)
    page = Page(hs.simulate(model, (0, 1))._repr_html_())
    assert HOSTILE in page.text() and not page.all("script")


def test_a_hundred_thousand_events_stay_small() -> None:
    """In columns of shares: slow for the first half, fast for the second, each mode with the share it has."""
    count = 100_000
    names = ("a", "b", "c")
    edges = [0.5 * k / (count // 10) for k in range(count // 10)]
    edges += [0.5 + 0.5 * k / (9 * count // 10) for k in range(9 * count // 10 + 1)]
    spells = [Spell(names[k % 3], t0, t1) for k, (t0, t1) in enumerate(pairwise(edges))]
    events = [Happening(s.t0, "c", "a", "b") for s in spells]
    warnings = [f"warning {k}" for k in range(1000)]
    text = run_html(switch(*names), {"finished": "m"}, True, (0.0, 1.0), {"c": spells}, events, warnings)
    assert len(text) < 250_000
    page = Page(text)
    rectangles = page.all("rect")
    assert 300 < len(rectangles) <= 1000
    assert "990 more warnings" in page.text() and "fraction of time in each mode" in page.text()
    areas = dict.fromkeys(("#0072B2", "#D55E00", "#009E73"), 0.0)
    for attributes, title in rectangles:
        areas[str(attributes["fill"])] += float(attributes["width"]) * float(attributes["height"])
        shares = [float(share) for share in re.findall(r"(\S+) %", title)]
        assert math.isclose(sum(shares), 100, abs_tol=0.5)
    for area in areas.values():
        assert area / sum(areas.values()) == pytest.approx(1 / 3, abs=2e-3)


def test_many_components_stay_small() -> None:
    modes = {f"c{k}": [Spell("a", 0.1 * i, 0.1 * i + 0.1) for i in range(500)] for k in range(300)}
    text = run_html(switch("a", "b"), {"finished": "m"}, True, (0.0, 50.0), modes, [], [])
    assert len(text) < 250_000
    page = Page(text)
    assert len(page.all("svg")) == 20 and len(page.all("rect")) <= 1000
    assert "280 more components" in page.text()


def test_backward_and_without_extent() -> None:
    model = hs.Model("m", states=(hs.State("x", 1, "-x"),), monitors=(hs.Monitor("half", "x - 0.5"),))
    assert "1 event<" in hs.simulate(model, (1, 0), x0=[0.4])._repr_html_()
    backward = [Spell("b", 2.0, 1.0), Spell("a", 1.0, 0.0)]
    page = Page(run_html(switch("a", "b"), {"finished": ""}, True, (2.0, 0.0), {"c": backward}, [], []))
    assert [float(str(a["x"])) for a, _ in page.all("rect")] == [500.0, 0.0]
    assert "svg" not in hs.simulate("dfcs", (0, 0))._repr_html_()
