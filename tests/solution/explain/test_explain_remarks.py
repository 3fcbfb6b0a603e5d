"""Explanations name the corners, the loads at zero and the other events of an instant, in exact sentences."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.cli import main


def guarded(guard: str, start: float, rate: str = "1", **parts: object) -> hs.Model:
    """A state, and a guard on it that leads from a to b."""
    modes = (hs.Mode("a", (hs.Guard("g", guard, ("b",)),)), hs.Mode("b"))
    component = hs.Component("c", modes, initial="a")
    return hs.Model("guarded", states=[hs.State("x", start, der=rate)], components=[component], **parts)


def rubbing(load: str, rate: str = "1", *, opens: bool = False) -> hs.Model:
    """A sliding body under a load that h decides, which begins at -1; the monitor is on h = 0."""
    return hs.Model(
        "rubbing",
        states=[hs.State("h", -1, der=rate), hs.State("v", 5, der="-f")],
        contacts=[hs.Contact("f", "v", load, "coulomb", {"mu": 0.1}, opens=opens)],
        monitors=[hs.Monitor("touch", "h")],
    )


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
@pytest.mark.parametrize(
    ("guard", "start", "t", "remarks"),
    [
        ("abs(x) - 1", -3.0, 2.0, ("abs(x) is -x here, since x < 0",)),
        ("0.5 - max(x, -2)", -1.0, 1.5, ("max(x, -2) is x here, since x + 2 > 0",)),
        (
            "abs(abs(x) - 2) - 0.5",
            0.0,
            1.5,
            (
                "abs(x) is x here, since x > 0",
                "abs(abs(x) - 2) is -(x - 2) here, since x - 2 < 0",
            ),
        ),
        (
            "min(-x, -2*x)",
            -1.0,
            1.0,
            (
                "min(-x, -2*x) changes its side here: -x - (-2*x) becomes positive, "
                "and min(-x, -2*x) is -2*x from here on",
            ),
        ),
        (
            "3 - (2*x if x > 0 else x)",
            -1.0,
            2.5,
            ("'2*x if x > 0 else x' is 2*x here, since x > 0",),
        ),
    ],
)  # fmt: skip
def test_a_guard_with_a_corner_names_the_side_it_is_on(
    guard: str, start: float, t: float, remarks: tuple[str, ...], integrator: str
) -> None:
    sol = hs.simulate(guarded(guard, start), (0, 4), integrator=integrator)
    (event,) = sol.events
    assert event.t == pytest.approx(t, abs=1e-12)
    why = sol.explain(event)
    assert why.remarks == remarks
    assert all(f"\n  note: {remark}\n" in str(why) for remark in remarks)


def test_a_corner_that_a_schedule_moves_is_named_at_the_schedule() -> None:
    kick = hs.Schedule("kick", times=["1"], reset={"x": "-1"})
    sol = hs.simulate(guarded("abs(x) - 0.2", 1.0, "0.1", schedules=[kick]), (0, 10), integrator="taylor")
    assert sol.explain(0).remarks == (
        "abs(x) changes its side here: x becomes negative, and abs(x) is -x from here on",
    )
    assert sol.explain(1).remarks == ("abs(x) is -x here, since x < 0",)


def test_one_corner_for_two_expressions_has_its_side_alone() -> None:
    model = guarded("abs(x) - 1", -3.0)
    model = hs.Model(
        "shared", states=[*model.states, hs.State("y", 0, der="max(x, 0)")], components=model.components
    )
    sol = hs.simulate(model, (0, 2.5), integrator="taylor")
    assert sol.explain(0).remarks == ("max(x, 0) is on its side x < 0 here",)


def test_a_sign_in_a_rate_is_called_a_jump() -> None:
    sol = hs.simulate(
        hs.Model("j", states=[hs.State("x", 1, der="-1 - 0.5*sign(x)")]), (0, 2), integrator="taylor"
    )
    assert sol.explain(0).remarks == ("sign(x) makes the rates jump at x = 0, and switches like a component",)


def test_pieces_of_a_table_are_numbered() -> None:
    law = hs.FrictionLaw(
        "worn", slip="N*mu", stick="0.5*N", tables=[hs.LawTable("mu", [0, 1, 2], [0.5, 0.3, 0.2])]
    )
    model = hs.Model(
        "table",
        states=[hs.State("v", 3, der="-f")],
        contacts=[hs.Contact("f", "v", "1", law)],
        monitors=[hs.Monitor("slow", "v - 1")],
    )
    sol = hs.simulate(model, (0, 12), integrator="taylor")
    slow, stop = sol.explain(0), sol.explain(1)
    assert slow.remarks == ("table f_mu goes from piece 2 to piece 1 here",)
    assert stop.remarks == ("table f_mu is on piece 1 here",)


def test_a_corner_without_an_event_can_be_explained() -> None:
    sol = hs.simulate(rubbing("2*max(h, 0)"), (0, 3), integrator="taylor")
    (corner,) = sol.corners
    assert sol.explain(corner).reason == (
        "max(h, 0) changes its side here: h becomes positive, and max(h, 0) is h from here on; "
        "both sides agree at this instant, so nothing jumps and no mode changes"
    )
    assert sol.explain(corner).remarks == (
        "the normal load of contact f (2*max(h, 0)) leaves zero here, and friction begins again",
    )
    timed = hs.Model("timed", states=[hs.State("x", 0, der="1 if t > 1 else 2")])
    sol = hs.simulate(timed, (0, 2), integrator="taylor")
    assert sol.explain(sol.corners[0]).reason == (
        "sign(t - 1) changes its side here: t - 1 becomes positive; "
        "it depends on time alone, so the rates may jump, but no mode changes"
    )


@pytest.mark.parametrize(
    ("load", "opens", "sentence"),
    [
        ("2*max(-h, 0)", False, "reaches zero here, and friction ends until the load is positive again"),
        ("abs(h) - h", False, "reaches zero here, and friction ends until the load is positive again"),
        ("-h", True, "reaches zero here, and friction ends until the load is positive again"),
        ("2*max(h, 0)", False, "leaves zero here, and friction begins again"),
        ("h", True, "leaves zero here, and friction begins again"),
        ("3*abs(h)", False, "touches zero here"),
    ],
)
def test_a_load_at_zero_is_named(load: str, opens: bool, sentence: str) -> None:
    sol = hs.simulate(rubbing(load, opens=opens), (0, 3), integrator="taylor")
    for event in (
        event for event in sol.events if event.t > 0.0
    ):  # the load opens at the start where it is negative
        assert event.t == pytest.approx(1.0, abs=1e-12)
        assert f"the normal load of contact f ({load}) {sentence}" in sol.explain(event).remarks
    away = hs.simulate(rubbing(f"{load} + 1"), (0, 3), integrator="taylor")
    assert not any("normal load" in remark for event in away.events for remark in away.explain(event).remarks)


def test_a_reaction_that_ends_unloads_the_friction() -> None:
    model = hs.Model(
        "lifted",
        states=[hs.State("h", 0, der="w"), hs.State("w", 0, der="-1 + 2*t + p"), hs.State("u", 2, der="-f")],
        contacts=[hs.Contact("f", "u", "p", "coulomb", {"mu": 0.1})],
        impacts=[hs.Impact("p", gap="h", restitution=0)],
    )
    sol = hs.simulate(model, (0, 1), integrator="taylor")
    assert sol.explain(0).remarks == (
        "the normal load of contact f (p) reaches zero here, and friction ends until the load is positive again",
    )


@pytest.mark.parametrize("integrator", ["exact", "taylor", "scipy-dop853"])
def test_events_of_one_instant_are_listed_in_their_order(integrator: str) -> None:
    tick = hs.Schedule("tick", times=["1"], reset={"n": "n + 1"})
    model = guarded(
        "x", 1.0, "-1", discrete=[hs.Discrete("n", 0)], monitors=[hs.Monitor("m", "x")], schedules=[tick]
    )
    sol = hs.simulate(model, (0, 2), integrator=integrator)
    names = [f"{e.kind} {e.component}" + (" a -> b" if e.component == "c" else "") for e in sol.events]
    assert sorted(names) == ["monitor m", "scheduled tick", "transition c a -> b"]
    for k in range(3):
        listed = [f"{name} (this one)" if i == k else name for i, name in enumerate(names)]
        assert sol.explain(k).remarks == (
            f"3 events happen at this instant, in this order: {'; '.join(listed)}",
        )


def test_an_event_alone_has_no_remarks_and_little_is_explained_of_a_run_that_kept_little() -> None:
    sol = hs.simulate(guarded("x", 1.0, "-1", monitors=[hs.Monitor("m", "x - 0.5")]), (0, 2), keep="events")
    assert sol.explain(0).remarks == ()
    assert hs.simulate(guarded("x", 1.0, "-1"), (0, 2)).explain(0).remarks == ()


def test_the_command_line_prints_remarks(tmp_path: object, capsys: pytest.CaptureFixture[str]) -> None:
    path = f"{tmp_path}/guarded.toml"
    Path(path).write_text(guarded("abs(x) - 1", -3.0).to_toml())
    assert main(["run", path, "--t-end", "4", "--explain", "0"]) == 0
    assert "\n  note: abs(x) is -x here, since x < 0\n  so: guard g leads to b\n" in capsys.readouterr().out
