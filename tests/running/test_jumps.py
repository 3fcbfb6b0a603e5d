"""Jumps written in a rate, as sign and conditionals: crossed, slid along and left as switching surfaces are."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim import plot
from hybridsim.model.smoothing.explicit_corners import smoothing_of
from hybridsim.model.smoothing.nonsmooth import JUMPS, UNCHANGED

METHODS = ["exact", "taylor", "dop853", "tsit5", "rodas5p", "scipy-radau", "cvode-bdf"]
SMOOTH = METHODS[1:]  # that take rates which are not linear


def model(*states: tuple[str, float, str], **more: object) -> hs.Model:
    return hs.Model("jumps", states=[hs.State(*state) for state in states], **more)


def run(integrator: str, built: hs.Model, end: float) -> hs.Solution:
    options = {} if integrator == "exact" else {"rtol": 1e-10, "atol": 1e-12}
    sol = hs.simulate(built, (0.0, end), integrator=integrator, **options)
    assert sol.success, sol.message
    assert sol.warnings == ()
    return sol


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize(
    "rate", ["-x - mu*sign(v)", "-x - (mu if v > 0 else -mu)", "-x + (mu if 0 >= 2*v else -mu)", "-x - f"]
)
def test_dry_friction(integrator: str, rate: str) -> None:
    """x'' = -x - mu sign(x'): each half swing loses 2 mu, and where the spring holds no more than mu all rests."""
    built = model(("x", 1.0, "v"), ("v", 0.0, rate), parameters={"mu": 0.15}, definitions={"f": "mu*sign(v)"})
    sol = run(integrator, built, 20.0)
    (name,) = sol.modes
    assert [e.t for e in sol.events] == pytest.approx([math.pi, 2 * math.pi, 3 * math.pi], abs=1e-7)
    assert [e.target for e in sol.events][-1] == "sliding"
    assert sol(20.0) == pytest.approx([-0.1, 0.0], abs=1e-7)
    assert sol(20.0)[1] == 0.0
    assert name.startswith("sign(")


@pytest.mark.parametrize("integrator", METHODS)
def test_whole_fields(integrator: str) -> None:
    """On x = 0 a third more of the upper field than of the lower: y grows by 1/3 there."""
    built = model(("x", 1.0, "-1 if x > 0 else 2"), ("y", 0.0, "x + 1 if x > 0 else x - 1"))
    assert run(integrator, built, 5.0)(5.0) == pytest.approx([0.0, 1.5 + 4 / 3], abs=1e-9)


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize(
    "rate",
    [
        "-(1 if x + v > d else -1 if x + v < -d else 0)",
        "-(1 if k*x + k*v > k*d else -1 if x + v < -d else 0)",
        "-(sign(x + v - d) + sign(v + d + x))/2",
    ],
)
def test_a_relay_with_a_dead_zone(integrator: str, rate: str) -> None:
    """Full thrust up to x + v = d, none up to -d, and along that x decays by exp(-t)."""
    built = model(("x", 1.0, "v"), ("v", 0.0, rate), parameters={"d": 0.1, "k": 0.7})
    sol = run(integrator, built, 6.0)
    first = math.sqrt(1 + 2 * 0.9) - 1
    second = first + 0.2 / first
    assert [e.t for e in sol.events] == pytest.approx([first, second], abs=1e-8)
    x = 1 - first**2 / 2 - 0.2
    assert sol(6.0)[0] == pytest.approx(-0.1 + (x + 0.1) * math.exp(second - 6.0), abs=1e-8)


# v falls from 4 at the rate 1 to v = 1, then at 3 where k v < -1, else at 2: over the border at -1/k, if it is below
@pytest.mark.parametrize(
    ("k", "end"),
    [(2.0, -0.5 - 3 * 2.25), (0.5, -2 - 3 * 1.5), (0.0, -5.0), (-0.5, -5.0), (-2.0, 0.5 - 17 / 3)],
)
@pytest.mark.parametrize(
    "rate", ["-(1 if v > d else (3 if k*v < -d else 2))", "-(1 if v > d else (3 if v*k + d < 0 else 2))"]
)
def test_parallel_borders_with_a_parameter_as_their_ratio(rate: str, k: float, end: float) -> None:
    built = model(("v", 4.0, rate), parameters={"d": 1.0, "k": k})
    sol = hs.simulate(built, (0.0, 6.0), integrator="taylor")
    assert sol.success and not sol.warnings
    assert sol(6.0)[0] == pytest.approx(end, abs=1e-12)


@pytest.mark.parametrize("d", [0.0, -0.1])
def test_a_dead_zone_of_no_width_or_less(d: float) -> None:
    """The first condition that holds counts: with d = -0.1 the relay switches at x + v = d alone."""
    rate = "-(1 if x + v > d else -1 if x + v < -d else 0)"
    sol = hs.simulate(model(("x", 1.0, "v"), ("v", 0.0, rate), parameters={"d": d}), (0.0, 20.0))
    assert sol.success and sol.integrator == "exact"
    assert sum(sol(20.0)) == pytest.approx(d, abs=1e-12)
    assert sol(20.0)[0] == pytest.approx(d, abs=1e-7)


@pytest.mark.parametrize("integrator", METHODS)
def test_jumps_in_time(integrator: str) -> None:
    """They are met to the last digits, and are no events of the model."""
    built = model(
        ("x", 1.0, "-x + (1 if t > 1.5 else 0)"),
        ("y", 0.0, "sign(sin(w*t))"),
        parameters={"w": math.pi},
    )
    sol = run(integrator, built, 4.5)
    assert sol(4.5) == pytest.approx([math.exp(-4.5) + 1 - math.exp(-3.0), 0.5], abs=1e-9)
    assert sol.events == () and not sol.modes
    assert [c.t for c in sol.corners if c.t > 0] == pytest.approx([1, 1.5, 2, 3, 4], abs=1e-12)


@pytest.mark.parametrize("integrator", SMOOTH)
def test_a_law_by_hand_and_as_a_contact(integrator: str) -> None:
    """Stribeck's friction written with sign and abs, against a contact of the same law."""
    parameters = {"mu": 0.4, "a": 0.5, "c": 3.0}
    by_hand = model(
        ("x", 1.0, "v"),
        ("v", 0.0, "-x + 0.5*cos(t) - mu*(1 + a*exp(-c*abs(v)))*sign(v)"),
        parameters=parameters,
    )
    slip = "mu*(1 + a*exp(-c*v))*N"
    law = hs.FrictionLaw("s", parameters=parameters, slip=slip, stick="mu*(1 + a)*N")
    contact = hs.Contact("f", "v", 1, law)
    declared = model(("x", 1.0, "v"), ("v", 0.0, "-x + 0.5*cos(t) - f"), contacts=[contact])
    one, other = (run(integrator, built, 20.0) for built in (by_hand, declared))
    assert len(one.events) == len(other.events) > 5
    assert [e.t for e in one.events] == pytest.approx([e.t for e in other.events], abs=1e-7)
    assert one(20.0) == pytest.approx(other(20.0), abs=1e-7)


@pytest.mark.parametrize("integrator", SMOOTH)
def test_a_sign_that_does_not_jump(integrator: str) -> None:
    """sign(v)*v**2 is a corner: no event, and as exact as the contact of that drag."""
    built = model(("x", 1.0, "v"), ("v", 0.0, "-x - c*sign(v)*v**2"), parameters={"c": 0.5})
    sol = run(integrator, built, 10.0)
    assert sol.events == ()
    energy = 0.5 * (sol(10.0) ** 2).sum()
    drag = model(
        ("x", 1.0, "v"), ("v", 0.0, "-x - 0.5*abs(v)*v"), ("lost", 0.0, "0.5*abs(v)**3")
    )  # its losses make up for what is left
    other = run(integrator, drag, 10.0)
    assert energy == pytest.approx(0.5 - other(10.0)[2], abs=1e-8)


@pytest.mark.parametrize("integrator", METHODS)
def test_a_body_between_two_belts(integrator: str) -> None:
    """Their friction cancels until the load has brought the body to the speed of one of them, where it stays."""
    contacts = [
        hs.Contact(n, f"v {way} 0.2", 1, "coulomb", {"mu": 0.3}) for n, way in (("f", "-"), ("g", "+"))
    ]
    built = model(("x", 0.0, "v"), ("v", 0.0, "0.1 - f - g"), contacts=contacts)
    sol = run(integrator, built, 4.0)
    assert [e.t for e in sol.events] == pytest.approx([2.0], abs=1e-9)
    assert sol(4.0) == pytest.approx([0.6, 0.2], abs=1e-9)


@pytest.mark.parametrize(
    ("rates", "text", "reason"),
    [
        (("-sign(x)*(1 + sqrt(abs(x)))", "0"), "sign(x)", "multiplied by a root"),
        (("-x", "sign(q)"), "sign(q)", "neither time nor a changing state"),
        (("-sign(x - u)", "1"), "sign(x - u)", "u, which a mode sets"),
        (("-sign(x) + sign(x + y)/5", "-sign(y)"), "sign(y)", "determine a third one"),
        (("-sign(x) + sign(x - sin(t))/5", "1"), "sign(x - sin(t))", "may coincide"),
    ],
)
def test_what_is_kept(rates: tuple[str, str], text: str, reason: str) -> None:
    """As it was written, with a reason that `check` gives; the model runs as ever."""
    relay = hs.Component(
        "c",
        [
            hs.Mode("a", guards=[hs.Guard("g", "5 - t", "b")], set={"u": 0.1}),
            hs.Mode("b", set={"u": 0.2}),
        ],
        initial="a",
    )
    built = model(("x", 1.0, rates[0]), ("y", 2.0, rates[1]), ("q", 0.0, "0"), components=[relay])
    found = {one.text: one for one in smoothing_of(built).primitives if one.became == UNCHANGED}
    assert found[text].remark.startswith(JUMPS)
    assert reason in found[text].remark
    assert hs.simulate(built, (0.0, 0.2), integrator="dop853").success


@pytest.mark.parametrize("q", [1.0, 0.0])
def test_a_sign_times_one_that_is_kept(q: float) -> None:
    """v' = -x - sign(v) sign(q), where nothing moves q: the sign of v is held where that of q is not zero."""
    built = model(("x", 1.3, "v"), ("v", 0.2, "-x - sign(v)*sign(q)"), ("q", q, "0"))
    sol = hs.simulate(built, (0.0, 1.0), integrator="dop853", rtol=1e-10)
    plain = hs.simulate(
        model(("x", 1.3, "v"), ("v", 0.2, "-x - k*sign(v)"), parameters={"k": q}), (0.0, 1.0), rtol=1e-10
    )
    assert sol(1.0)[:2] == pytest.approx(plain(1.0), abs=1e-8)


@pytest.mark.parametrize("form", ["set", "der", "definition", "other"])
def test_a_jump_in_a_mode_is_kept(form: str) -> None:
    """What a component sets or changes cannot be solved for: the model runs as it is written, up to the jump."""
    forms = {"set": {"u": "sign(v)"}, "definition": {"u": "s"}}
    rest = {"der": {"v": "-x - sign(v)"}, "other": {"v": "-x - 1"}}
    mode = hs.Mode("a", set=forms.get(form, {"u": 1}), der=rest.get(form, {}))
    rate = "-x - sign(v)" if form == "other" else "-x - u"
    built = model(
        ("x", 1.0, "v"),
        ("v", 1.0, rate),
        components=[hs.Component("c", [mode])],
        definitions={"s": "sign(v)"},
    )
    sol = hs.simulate(built, (0.0, 0.3), integrator="dop853")
    assert sol.success and sol(0.3)[0] == pytest.approx(2 * math.cos(0.3) + math.sin(0.3) - 1, abs=1e-5)
    assert not any(name.startswith("sign") for name in sol.modes)


def test_a_monitor_of_a_sign_is_no_jump_of_a_flow() -> None:
    built = model(("x", 1.0, "v"), ("v", 0.0, "-x"), monitors=[hs.Monitor("m", "sign(v) - 0.5")])
    assert hs.simulate(built, (0.0, 7.0)).warnings == ()


def test_an_impact_beside_a_jump() -> None:
    """What an impact holds no jump does: it is kept there, and elsewhere it slides."""
    built = model(
        ("x", 1.0, "v"),
        ("v", 0.0, "-1 - 0.1*sign(v) + floor"),
        ("y", 0.5, "-sign(y)"),
        impacts=[hs.Impact("floor", "x", restitution=0.5)],
    )
    became = {one.text: one.remark for one in smoothing_of(built).primitives}
    assert "a closed gap constrains v" in became["sign(v)"]
    assert became["sign(y)"] == "sign(y)"
    sol = hs.simulate(built, (0.0, 2.0), integrator="dop853")
    assert sol.success and sol(2.0)[2] == 0.0


def test_it_is_drawn() -> None:
    """Strips, orbits and the page of a notebook know the modes of a sign."""
    sol = run("exact", model(("x", 1.0, "v"), ("v", 0.0, "-x - 0.15*sign(v)")), 20.0)
    assert "sign(v)" in sol._repr_html_()
    assert plot.time_history(sol) is not None
    assert plot.phase_portrait(sol, "x", "v") is not None


@pytest.mark.parametrize("integrator", ["exact", "dop853"])
def test_what_accumulates_is_told(integrator: str) -> None:
    """x'' = -2 sign(x) - sign(v) comes to rest in a finite time after infinitely many crossings."""
    built = model(("x", 1.0, "v"), ("v", 0.0, "-2*sign(x) - sign(v)"))
    sol = hs.simulate(built, (0.0, 10.0), integrator=integrator)
    assert sol.success and sol(10.0) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert "events of sign(x), sign(v) follow each other ever faster" in sol.warnings[0]
    assert "events accumulate" in str(sol.explain(len(sol.events) - 1))


def test_it_is_told_in_words(tmp_path: Path) -> None:
    """No name of the program's own is shown; what is saved is read again and goes on."""
    built = model(("x", 1.0, "v"), ("v", 0.0, "-x - mu*sign(v)"), parameters={"mu": 0.15})
    sol = run("exact", built, 9.0)
    assert [interval.mode for interval in sol.modes["sign(v)"]] == ["below", "above", "below"]
    for number in range(len(sol.events)):
        text = str(sol.explain(number))
        assert "sign(v)" in text and "__" not in text
    sol.save(tmp_path / "run.hybridsim")
    on = hs.load_solution(tmp_path / "run.hybridsim").resume(t_end=20.0)
    assert on(20.0) == pytest.approx([-0.1, 0.0], abs=1e-12)


@pytest.mark.parametrize(("start", "fires"), [(0.9, 0.16), (-0.9, 0.04)])
def test_a_size_written_with_a_sign_may_stand_inside_of_another_size(start: float, fires: float) -> None:
    """sign(x)*x has a corner and no jump; taking it out of abs() must come to an end."""
    leaves = hs.Guard("g", "0.1 - abs(sign(x)*x - 0.96)", hs.Choice("off"))
    model = hs.Model(
        "size-of-a-size",
        states=[hs.State("x", start, 1)],
        components=[hs.Component("a", [hs.Mode("on", leaves), hs.Mode("off")], initial="on")],
    )
    sol = hs.simulate(model, (0.0, 1.0), integrator="taylor")
    assert [event.t for event in sol.events if event.component == "a"] == [pytest.approx(fires, abs=1e-12)]
