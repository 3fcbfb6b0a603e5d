"""A report is one safe page without connections, and its data are those of the run."""

from __future__ import annotations

import hashlib
import math
import re
from base64 import b64encode
from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs
import hybridsim.report.events
from report.parsed_page import ParsedPage, unpacked

FOLDER = Path(hybridsim.report.__file__).parent
HOSTILE = "</script><script>alert('x')</script><img src=x onerror=alert(1)>&\"'"


def page_of(sol: hs.Solution, folder: Path) -> ParsedPage:
    return ParsedPage(sol.report(folder / "run.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def rubbing() -> hs.Solution:
    return hs.simulate("dfcs", (0, 0.1))


@pytest.fixture(scope="module")
def page(rubbing: hs.Solution, tmp_path_factory: pytest.TempPathFactory) -> ParsedPage:
    return page_of(rubbing, tmp_path_factory.mktemp("report"))


def ball() -> hs.Solution:
    return hs.simulate("bouncing-ball", (0, 3))


def thermostat(periods: float) -> hs.Solution:
    """A heater that switches at 0 and 1: each of its two phases lasts one unit of time."""
    modes = [
        hs.Mode("on", guards=[hs.Guard("warm", "1 - x", "off")], set={"u": 1}),
        hs.Mode("off", guards=[hs.Guard("cold", "x", "on")], set={"u": -1}),
    ]
    model = hs.Model(
        "sawtooth", states=[hs.State("x", 0, "u")], components=[hs.Component("c", modes, initial="on")]
    )
    return hs.simulate(model, (0, 2 * periods))


# -- the page ---------------------------------------------------------------------------------------------------


def test_the_page_needs_no_other_file(page: ParsedPage) -> None:
    for tag, attributes, _ in page.elements:
        assert tag not in ("link", "iframe", "object", "embed", "base", "form")
        for name in ("src", "href", "action", "data", "xlink:href", "poster"):
            assert re.match(r"#|data:text/plain;|$", attributes.get(name) or ""), attributes
        assert not [name for name in attributes if name.startswith("on")]
    style = "".join(text for _, text in page.all("style"))
    assert "url(" not in style and "@import" not in style


def test_only_its_own_script_may_run(page: ParsedPage) -> None:
    (data, _), (attributes, script) = page.all("script")
    assert data == {"type": "application/json", "id": "data"} and attributes == {}
    policy = next(a["content"] for a, _ in page.all("meta") if a.get("http-equiv"))
    digest = b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert policy is not None and "default-src 'none'" in policy and f"script-src 'sha256-{digest}'" in policy
    assert script == (FOLDER / "report.js").read_text(encoding="utf-8")


def test_the_script_is_short_and_runs_no_text() -> None:
    script = (FOLDER / "report.js").read_text(encoding="utf-8")
    assert len(script.splitlines()) <= 400
    for risky in (
        "eval",
        "Function(",
        "innerHTML",
        "outerHTML",
        "insertAdjacent",
        "document.write",
        "fetch(",
        "http",
    ):
        assert risky not in script
    assert [path.name for path in FOLDER.glob("*.js")] == ["report.js"]


def test_every_control_has_a_name_and_a_place_in_the_order_of_tabs(page: ParsedPage) -> None:
    found = [attributes["id"] for _, attributes, _ in page.elements if attributes.get("id")]
    assert len(found) == len(set(found))
    for tag, attributes, texts in page.elements:
        for name in ("aria-labelledby", "aria-describedby"):
            assert set((attributes.get(name) or "").split()) <= set(found)
        if tag == "button":
            assert attributes.get("aria-label") or "".join(texts).strip()
        assert int(attributes.get("tabindex") or 0) == 0
    reachable = {
        attributes.get("id") for _, attributes, _ in page.elements if attributes.get("tabindex") == "0"
    }
    assert {"chart", "rows"} <= reachable


def test_the_style_has_dark_colours_and_no_fixed_widths_beyond_a_small_screen(page: ParsedPage) -> None:
    style = "".join(text for _, text in page.all("style"))
    assert style.count("prefers-color-scheme: dark") == 2
    assert not [w for w in re.findall(r"(?<![-\w])(?:min-)?width: (\d+)px", style) if int(w) > 300]


def test_the_page_shows_what_the_run_is(page: ParsedPage, rubbing: hs.Solution) -> None:
    text = "".join(page.elements[0][2])
    assert page.all("h1")[0][1] == rubbing.model.title
    for part in (rubbing.message, "27 transitions", "x' = v   from 0 m", f"hybridsim {hs.__version__}"):
        assert part in text
    svg = next(attributes for attributes, _ in page.all("svg"))
    assert svg["role"] == "img" and svg["aria-label"] == "The mechanism at t = 0.1 s"
    assert [a["data-name"] for _, a, _ in page.elements if a.get("class") == "curve"] == [
        "x",
        "v",
        "f",
        "v_rel(f)",
    ]
    labels = [text for _, text in page.all("b")]
    assert labels[:3] == ["x [µm]", "v [mm/s]", "f [N]"]


def test_the_page_shows_the_energy_of_each_contact(tmp_path: Path) -> None:
    """A block of 2 kg stops from 1.5 m/s: friction takes its kinetic energy."""
    states = [hs.State("x", 0, "v", unit="m"), hs.State("v", 1.5, "-f/2", unit="m/s")]
    contact = hs.Contact("f", velocity="v", normal="N", law="coulomb", arguments={"mu": 0.5})
    parameters = [hs.Parameter("N", 8, unit="N")]
    sol = hs.simulate(hs.Model("block", states, parameters, contacts=[contact]), (0, 3))
    page = page_of(sol, tmp_path)
    terms, facts = ([text for _, text in page.all(tag)] for tag in ("dt", "dd"))
    assert dict(zip(terms, facts, strict=True))["Energy dissipated by friction"] == "f 2.25 J"


def test_events_and_corners_add_up_to_the_events_of_the_cost(tmp_path: Path) -> None:
    """The rate |x| of x = cos(t) has a corner at each of six passages of zero."""
    states = [hs.State("x", 1, "v"), hs.State("v", 0, "-x"), hs.State("w", 0, "abs(x)")]
    sol = hs.simulate(hs.Model("corners", states), (0, 6 * math.pi))
    page = page_of(sol, tmp_path)
    terms, facts = ([text for _, text in page.all(tag)] for tag in ("dt", "dd"))
    assert dict(zip(terms, facts, strict=True))["Events"] == "6 corners"
    text = "".join(page.elements[0][2])
    assert re.search(r"events, with corners\s*6\b", text)


def test_text_of_a_model_stays_text(tmp_path: Path) -> None:
    model = hs.Model(
        "m", states=[hs.State("x", 0, "1", unit=HOSTILE)], title=HOSTILE, description=HOSTILE, source=HOSTILE,
        monitors=[hs.Monitor("half", "x - 0.5")],
    )  # fmt: skip
    page = page_of(hs.simulate(model, (0, 1)), tmp_path)
    assert page.all("h1")[0][1] == HOSTILE == page.all("title")[0][1]
    assert len(page.all("script")) == 2 and not page.all("img")
    assert not re.search("[<>&]", page.text_of("data"))
    assert page.data["curves"]["quantities"][0]["unit"].endswith(HOSTILE)
    assert hs.Model.from_toml(page.text_of("again-model")).title == HOSTILE


# -- the data ---------------------------------------------------------------------------------------------------


def test_the_curves_are_the_run_on_both_sides_of_each_event(tmp_path: Path) -> None:
    sol = ball()
    curves = page_of(sol, tmp_path).data["curves"]
    (part,) = curves["parts"]
    t, values = (
        unpacked(part["t"]),
        {q["name"]: unpacked(v) for q, v in zip(curves["quantities"], part["values"])},
    )
    assert curves["ranges"] is None and (t[0], t[-1]) == (0.0, 3.0) and (np.diff(t) >= 0).all()
    is_first = np.append(t[1:] == t[:-1], False)
    events = {event.t for event in sol.events}
    assert set(t[is_first]) == events
    for i, name in enumerate(sol.names):
        exact = np.where(is_first, sol(t, side="-")[i], sol(t)[i])
        assert np.array_equal(values[name], exact.astype("f4"))


def test_a_jump_of_an_input_is_upright(tmp_path: Path) -> None:
    """A table that holds each value jumps from 0 to 2 at t = 1, where nothing else happens."""
    table = hs.Input("u", "table", times=[0, 1], values=[0, 2], interpolation="previous")
    model = hs.Model("m", states=[hs.State("x", 0, "u")], inputs=[table], outputs={"y": "u"})
    curves = page_of(hs.simulate(model, (0, 2)), tmp_path).data["curves"]
    y = [quantity["name"] for quantity in curves["quantities"]].index("y")
    t, values = (unpacked(packed) for packed in (curves["parts"][0]["t"], curves["parts"][0]["values"][y]))
    assert values.tolist() == [0.0] * int((t < 1).sum() + 1) + [2.0] * int((t > 1).sum() + 1)


def test_lines_between_the_samples_are_the_curve(tmp_path: Path) -> None:
    model = hs.Model("wave", states=[hs.State("x", 0, "cos(t)")])
    (part,) = page_of(hs.simulate(model, (0, 40)), tmp_path).data["curves"]["parts"]
    t, times = unpacked(part["t"]), np.linspace(0, 40, 20_001)
    assert np.abs(np.interp(times, t, unpacked(part["values"][0])) - np.sin(times)).max() < 2e-3
    assert len(t) < 6000


def test_events_and_modes_are_those_of_the_run(page: ParsedPage, rubbing: hs.Solution) -> None:
    events, (strip,) = page.data["events"], page.data["modes"]
    assert unpacked(events["t"]).tolist() == [event.t for event in rubbing.events]
    texts = [events["texts"][k] for k in unpacked(events["change"])]
    assert texts == [f"f: {event.source} → {event.target}" for event in rubbing.events]
    assert events["reasons"]["0"] == f"{rubbing.explain(0).reason}." and len(events["reasons"]) == 27
    assert sum(events["counts"]) == events["count"] == 27 and events["omitted"] == 0
    x = events["states"][0]
    assert np.array_equal(unpacked(x["before"]), np.float32([event.x_minus[0] for event in rubbing.events]))
    assert x["after"] is None
    names = [strip["modes"][k] for k in unpacked(strip["mode"])]
    assert list(zip(names, unpacked(strip["starts"]))) == [(i.mode, i.t0) for i in rubbing.modes["f"]]
    assert strip["modes"][strip["held"]] == "stick"


def test_states_that_jump_are_stored_after_the_event_too(tmp_path: Path) -> None:
    sol = ball()
    states = page_of(sol, tmp_path).data["events"]["states"]
    w = list(sol.names).index("w")
    assert np.array_equal(unpacked(states[w]["after"]), np.float32([event.x_plus[w] for event in sol.events]))


def test_a_run_with_very_many_events_fits(tmp_path: Path) -> None:
    """The sawtooth between 0 and 1 takes the whole range in each short interval, and keeps all of its events."""
    sol = thermostat(50_001)
    path = sol.report(tmp_path / "long.html")
    assert path.stat().st_size < 5_000_000
    data = ParsedPage(path.read_text(encoding="utf-8")).data
    assert np.allclose(unpacked(data["events"]["t"]), np.arange(1, 100_003), rtol=1e-9)
    assert len(unpacked(data["modes"][0]["starts"])) >= 100_001
    low, high = (unpacked(data["curves"]["ranges"][side][0]) for side in ("low", "high"))
    assert len(low) >= 2048 and np.allclose(low, 0, atol=1e-6) and np.allclose(high, 1, atol=1e-6)
    first, last = (unpacked(part["t"]) for part in data["curves"]["parts"])
    assert first[0] == 0 and last[-1] == 100_002 and len(first) > 1000 < len(last)


def test_a_page_with_columns_of_modes_says_so(
    rubbing: hs.Solution, page: ParsedPage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Modes of more intervals than a page holds are shown in columns, which look like intervals when zoomed in."""
    monkeypatch.setattr(hybridsim.report.events, "MOST_INTERVALS", 3)
    short = page_of(rubbing, tmp_path)
    assert not short.data["modes"][0]["is_exact"] and page.data["modes"][0]["is_exact"]
    said = [any("4096 columns" in text for _, text in one.all("p")) for one in (short, page)]
    assert said == [True, False]


def test_states_beyond_single_precision_are_stored(tmp_path: Path) -> None:
    """x = 1e39 (1 + t) is doubled at t = 0.5, and y = 1e-60 is constant."""
    model = hs.Model(
        "large",
        states=[hs.State("x", 1e39, "1e39"), hs.State("y", 1e-60, "0")],
        schedules=[hs.Schedule("s", times=[0.5], reset={"x": "2*x"})],
    )
    data = page_of(hs.simulate(model, (0, 1)), tmp_path).data
    (part,) = data["curves"]["parts"]
    assert (
        unpacked(part["values"][0])[-1] == pytest.approx(3.5e39) and unpacked(part["values"][1])[0] == 1e-60
    )
    x = data["events"]["states"][0]
    assert (unpacked(x["before"])[0], unpacked(x["after"])[0]) == pytest.approx((1.5e39, 3e39))


# -- other runs -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("save", ["all", "events", "last-period", "nothing"])
def test_a_report_shows_what_the_run_stored(save: str, tmp_path: Path) -> None:
    page = page_of(hs.simulate("dfcs", (0, 0.1), keep=save), tmp_path)
    assert page.has("events") == (save != "nothing")
    assert (page.data["curves"] is not None) == (save in ("all", "last-period"))
    assert page.has("chart") == (save != "nothing")


def test_a_run_that_stopped_says_why(tmp_path: Path) -> None:
    model = hs.Model("blowup", states=[hs.State("x", 1, "x**2")])
    sol = hs.simulate(model, (0, 2))
    page = page_of(sol, tmp_path)
    assert not sol.success and sol.message in [text for _, text in page.all("li")]
    assert "✘" in "".join(page.elements[0][2])


def test_runs_without_parts_that_most_runs_have(tmp_path: Path) -> None:
    functions = hs.Model("f", states={"x": 1.0}, flow=lambda t, x, p: -x)
    backward = hs.simulate(hs.Model("back", states=[hs.State("x", 0, "cos(t)")]), (3, 0))
    for sol in (hs.simulate(functions, (0, 1)), backward):
        page = page_of(sol, tmp_path)
        assert page.has("chart") and not page.has("events") and not page.all("svg")
    (part,) = page.data["curves"]["parts"]
    t = unpacked(part["t"])
    assert (t[0], t[-1]) == (0, 3)
    assert np.allclose(unpacked(part["values"][0]), np.sin(t) - np.sin(3), atol=1e-6)


def test_what_cannot_be_reported_is_refused(rubbing: hs.Solution, tmp_path: Path) -> None:
    with pytest.raises(hs.UsageError, match=r"unsupported file type '\.pdf'"):
        rubbing.report(tmp_path / "run.pdf")
    with pytest.raises(hs.UsageError, match="cannot be drawn"):
        hs.simulate(hs.two_blocks_on_belt(), (0, 1)).report(tmp_path / "run.html")
    assert not list(tmp_path.iterdir())
