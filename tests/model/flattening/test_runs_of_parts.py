"""Runs of models with parts: the motions of the same models written out, and the forms in which results are kept."""

from __future__ import annotations

import csv
import inspect
import json
import math
import re
import runpy
from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.cli import main

EXAMPLES = Path(__file__).parents[3] / "docs" / "examples" / "parts"


def twenty_blocks() -> hs.Model:
    belt = hs.Contact("f", velocity="v - belt", normal=1, law="hyperbolic", arguments={"mu": 1, "delta": 3})
    block = hs.Model(
        "block",
        states=[hs.State("x", 0, "v"), hs.State("v", 0, "left + right - 3*x - f")],
        parameters={"belt": 0.2},
        inputs=[hs.Input("left", "connected"), hs.Input("right", "connected")],
        contacts=[belt],
    )
    left = "block[i-1].x if i > 1 else block[i].x"
    right = "block[i+1].x if i < 20 else block[i].x"
    blocks = hs.Use(
        "block", block, repeat=20, start={"x": "0.5*sin(7*i)"}, connect={"left": left, "right": right}
    )
    return hs.Model("chain", use=[blocks])


def test_twenty_blocks_take_fifteen_lines_of_python() -> None:
    assert twenty_blocks() == hs.load(EXAMPLES / "chain.toml")
    assert len(inspect.getsource(twenty_blocks).rstrip().splitlines()) - 1 <= 15


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_blocks_move_as_the_chain_that_is_built_from_matrices(integrator: str) -> None:
    """Same modes in the same order, event times and states to 1e-12, for another set of equations."""
    start = {f"q{i}": 0.5 * math.sin(7 * i) for i in range(1, 21)}
    chain = hs.chain_on_belt(20).to_model().with_start(**start)
    one, other = (
        hs.simulate(model, (0, 4), integrator=integrator, rtol=1e-13) for model in (twenty_blocks(), chain)
    )
    assert len(one.events) == len(other.events) > 20
    for event, reference in zip(one.events, other.events, strict=True):
        assert event.component == f"block{reference.component.removeprefix('f')}.f"
        assert (event.source, event.target) == (reference.source, reference.target)
        assert event.t == pytest.approx(reference.t, abs=1e-12)
    order = [one.names.index(f"block{i}.{name}") for i in range(1, 21) for name in "xv"]
    t = np.linspace(0, 4, 101)
    assert np.abs(one(t)[order] - other(t)).max() < 1e-12


def test_the_flat_text_runs_to_the_same_bits() -> None:
    parts = hs.load(EXAMPLES / "chain.toml")
    one, other = (
        hs.simulate(model, (0, 4), integrator="taylor")
        for model in (parts, hs.Model.from_toml(parts.to_toml()))
    )
    assert one.t.tobytes() == other.t.tobytes() and one.y.tobytes() == other.y.tobytes()
    assert [event.t for event in one.events] == [event.t for event in other.events] != []


WHEEL = """
[parameters]
k = 9
[inputs]
base.kind = "connected"
[states]
x = { start = 0, der = "v" }
v = { start = 0, der = "k*(base - x)" }
"""
AXLE = """
[inputs]
body.kind = "connected"
[use.left]
model = "wheel.toml"
connect.base = "body"
[use.right]
model = "wheel.toml"
parameters.k = 4
connect.base = "body"
[outputs]
lift = "left.x + right.x"
"""
CAR = """
[states]
y = { start = 0, der = "front.lift + rear.lift" }
[use.front]
model = "axle.toml"
connect.body = "1"
[use.rear]
model = "axle.toml"
start = { left.x = 1, right.v = 6 }
connect.body = "0"
[monitors.full]
expr = "front.left.x - 1"
"""


def test_four_wheels_of_one_part_in_two_axles_move_as_their_closed_forms(tmp_path: Path) -> None:
    for name, text in {"wheel": WHEEL, "axle": AXLE, "car": CAR}.items():
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    sol = hs.simulate(hs.load(tmp_path / "car.toml"), (0, 2), integrator="exact")
    t = 2.0
    expected = {
        "front.left.x": 1 - math.cos(3 * t),
        "front.right.x": 1 - math.cos(2 * t),
        "rear.left.x": math.cos(3 * t),
        "rear.right.x": 3 * math.sin(2 * t),
        "y": 2 * t - math.sin(2 * t) / 2 + 1.5 * (1 - math.cos(2 * t)),
        "front.lift": 2 - math.cos(3 * t) - math.cos(2 * t),
        "rear.left.base": 0.0,
    }
    for name, value in expected.items():
        assert sol.output(name, t) == pytest.approx(value, abs=1e-12)
    assert sol.event_times("full") == pytest.approx(np.pi / 6 * np.array([1, 3]), abs=1e-12)


def friction_in_a_part() -> hs.Model:
    """A block that slides to rest, as a part: v = 1 - t until t = 1."""
    block = hs.Model(
        "block",
        states=[hs.State("x", 0, "v"), hs.State("v", 1, "push - f")],
        inputs=[hs.Input("push", "connected")],
        contacts=[hs.Contact("f", "v", 1, "coulomb", {"mu": 1})],
    )
    return hs.Model("whole", use=[hs.Use("a", block, connect={"push": 0})]).validate()


def test_names_with_dots_stand_all_forms_of_results(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    model = friction_in_a_part()
    sol = hs.simulate(model, (0, 2), integrator="exact")
    assert sol.event_times("a.f").tolist() == pytest.approx([1.0], abs=1e-15)
    assert [piece.mode for piece in sol.modes["a.f"]] == ["slip+", "stick"]
    assert sol.output("a.f", 1.5) == 0.0
    assert "a.f" in str(sol.explain(0))
    sol.save(tmp_path / "run.npz")
    again = hs.load_solution(tmp_path / "run.npz")
    assert again.names == sol.names == ("a.x", "a.v")
    assert np.array_equal(again.y, sol.y)
    (tmp_path / "whole.toml").write_text(model.to_toml(), encoding="utf-8")
    file, table = str(tmp_path / "whole.toml"), tmp_path / "run.csv"
    assert main(["run", file, "--t-end", "2", "--csv", str(table), "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["final"]["a.x"] == pytest.approx(0.5, abs=1e-9)
    with table.open(encoding="utf-8") as rows:
        assert next(csv.reader(rows))[:3] == ["t", "a.x", "a.v"]


def test_values_of_parts_are_named_in_measures_and_questions() -> None:
    part = hs.Model(
        "oscillator",
        states=[hs.State("x", 0, "v"), hs.State("v", 0, "F*sin(2*t) - 0.4*v - x")],
        parameters={"F": 1},
    )
    whole = hs.Model("whole", use=[hs.Use("a", part)]).validate()
    gain = 1 / math.hypot(1 - 4, 0.8)
    table = hs.sweep(whole, {"a.F": [1, 2]}, measure=["amplitude.a.x", "harmonic.a.x.1"])
    assert table["amplitude.a.x"] == pytest.approx([gain, 2 * gain], rel=1e-6)
    assert np.abs(table["harmonic.a.x.1"]) == pytest.approx([gain, 2 * gain], rel=1e-6)
    for quantity, message in (
        ("amplitude.a.y", "did you mean 'a.x'"),
        ("amplitude.a.x.2", "write only amplitude.a.x"),
        ("event_time.a.x.0", "event_time"),
    ):
        with pytest.raises(hs.UsageError) as caught:
            hs.advise(whole, quantity, t_span=(0, 1))
        assert message in f"{caught.value}"


def test_a_part_runs_without_compiled_code_to_the_same_end(monkeypatch: pytest.MonkeyPatch) -> None:
    flat = hs.Model.from_toml(friction_in_a_part().to_toml())
    plain = hs.Model(
        "plain",
        states=[hs.State("x", 0, "v"), hs.State("v", 1, "0 - f")],
        contacts=[hs.Contact("f", "v", 1, "coulomb", {"mu": 1})],
    )
    for integrator in ("taylor", "dop853", "scipy-radau"):
        one, other = (hs.simulate(model, (0, 2), integrator=integrator) for model in (flat, plain))
        assert np.array_equal(one.y, other.y)
        assert [event.t for event in one.events] == [event.t for event in other.events]


def test_signs_corners_and_jumps_are_replaced_in_parts_as_elsewhere() -> None:
    """A relay, a saturation and a contact whose regularised form is asked for, inside a part."""
    part = hs.Model(
        "relay",
        states=[hs.State("x", 1, "-sign(x) + min(max(u, -1), 1)/2"), hs.State("w", 1, "-f - abs(w)")],
        inputs=[hs.Input("u", "connected")],
        contacts=[hs.Contact("f", "w", 1, "coulomb", {"mu": 1})],
    )
    whole = hs.Model("whole", use=[hs.Use("a", part, connect={"u": "2*t"})]).validate()
    sol = hs.simulate(whole, (0, 3), integrator="taylor")
    # x falls at 1 - t until the input is saturated at t = 1/2, then at 1/2, and slides along x = 0
    reached = 0.5 + 2 * (1 - 0.5 + 0.125)
    assert sol.output("a.x", 0.25) == pytest.approx(1 - 0.25 + 0.5 * 0.0625, abs=1e-12)
    assert sol.output("a.x", reached - 0.25) == pytest.approx(0.125, abs=1e-12)
    assert sol.output("a.x", 2.5) == 0.0
    assert sol.output("a.w", 0.5) == pytest.approx(2 * math.exp(-0.5) - 1, abs=1e-12)
    smooth = hs.simulate(whole.regularized("tanh", v0=1e-4), (0, 0.5), integrator="dop853")
    assert smooth.output("a.w", 0.5) == pytest.approx(2 * math.exp(-0.5) - 1, abs=1e-6)


def test_the_page_on_parts_prints_what_it_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    page = EXAMPLES.parents[1] / "how-to" / "parts.md"
    code = "\n".join(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))
    shown = re.findall(r"^print\(.*\)  # (.+)$", code, re.MULTILINE)
    monkeypatch.chdir(EXAMPLES)  # the page assumes that its files lie next to the script
    (tmp_path / "shown.py").write_text(code, encoding="utf-8")
    runpy.run_path(str(tmp_path / "shown.py"))
    assert capsys.readouterr().out.splitlines() == shown
    assert len(shown) == 7
