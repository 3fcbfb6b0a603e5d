"""Conditions of any combination: what they choose is met where it changes, in time and where states pass borders."""

from __future__ import annotations

import math
import random

import pytest

import hybridsim as hs
from hybridsim.errors import UsageError
from hybridsim.model.checks.doubtful import jumps_of
from running.conditions_truth import END, Conditions

METHODS = ["exact", "taylor", "dop853"]


def model(*states: tuple[str, float, str], **more: object) -> hs.Model:
    return hs.Model("conditions", states=[hs.State(*state) for state in states], **more)


def end_of(built: hs.Model, span: float, integrator: str = "dop853") -> list[float]:
    sol = hs.simulate(built, (0.0, span), integrator=integrator)
    assert sol.success, sol.message
    assert sol.warnings == ()
    return sol(span).tolist()


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("integrator", METHODS)
def test_random_combinations(integrator: str, seed: int) -> None:
    """Against sums over the intervals between all thresholds: numbers, parameters and definitions, negated or not."""
    chance = random.Random(seed)
    made = Conditions(
        chance, chance.choice([{}, {"x": -1.5}, {"x": -1.5, "y": 0.25}]), negated=chance.random() < 0.5
    )
    rate = made.expression(chance.randint(1, 2))
    states = [("z", 0.0, rate), *((name, start, "1") for name, start in made.starts.items())]
    chance.shuffle(states)
    built = model(*states, parameters=made.parameters, definitions=made.definitions)
    z = end_of(built, END, integrator)[[name for name, _, _ in states].index("z")]
    assert z == pytest.approx(made.integral(rate), abs=1e-9)


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize(
    ("rate", "right"),
    [
        ("10000 if t > 20 and t < 20.1 else 0", 1000.0),
        ("10000 if t > 20 and t < 60 else 0", 400000.0),
        ("10000 if abs(t - 20) < 0.05 else 0", 1000.0),
        ("10000 if 0.05 > abs(t - c) else 0", 1000.0),
        ("0 if not 20 < t <= 20.1 else 10000", 1000.0),
        ("(1 if t > 20 else 0)*(10000 if t < w + 20 else 0)", 1000.0),
        ("10000 if min(t - 20, 20.1 - t) > 0 else 0", 1000.0),
        ("10000 if (t > 20 if t < 20.1 else t < 0) else 0", 1000.0),
        ("exp(1 if t > 20 and t < 21 else 0) - 1", math.e - 1),
        ("1 if sin(t) > 0.5 and cos(t) > 0 else 0", 16 * math.pi / 3),
    ],
)
def test_pulses_in_time(integrator: str, rate: str, right: float) -> None:
    span = 32 * math.pi if "sin" in rate else 100.0
    built = model(("x", 0.0, rate), parameters={"c": 20.0, "w": 0.1})
    assert end_of(built, span, integrator) == [pytest.approx(right, rel=1e-11)]


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize(
    ("rate", "right"),
    [
        ("exp(sign(x))", 5 / math.e + 5 * math.e),
        ("1/(2 + sign(x))", 5 + 5 / 3),
        ("sign(x)*sign(y)", 5 - 2 + 3),
        ("sign(x)*sign(x)", 10.0),
        ("max(sign(x), t/10)", 1.25 + 5),
        ("(3 if y > 0 else sign(x)) if x > 0 or t > 8 else sign(y)", -5 + 2 + 9),
        ("sign(abs(x) - 2)", 10 - 2 * 4),
        ("sign(max(x, y))", 2 * 5 - 10),
        ("abs(x) if x > 0 or not y > 1 else 0", 25.0),
        ("sqrt(2 + sign(x))", 5 + 5 * math.sqrt(3)),
    ],
)
def test_jumps_inside_of_what_is_not_linear(integrator: str, rate: str, right: float) -> None:
    """x passes zero at t = 5 and y at t = 7."""
    built = model(("z", 0.0, rate), ("x", -5.0, "1"), ("y", -7.0, "1"))
    assert end_of(built, 10.0, integrator)[0] == pytest.approx(right, abs=1e-9)


@pytest.mark.parametrize(
    "form", ["(1 if t > at else 0)", "(0 if at >= t else 1)", "u", "(1 if abs(t - 4) < 3 else 0)"]
)
@pytest.mark.parametrize("integrator", [*METHODS, "rodas5p", "scipy-radau", "cvode-bdf"])
def test_a_belt_that_is_switched_on(integrator: str, form: str) -> None:
    """The block does not take the new speed at once: it slips for two units of time."""
    contact = hs.Contact("f", f"v - {form}", 1, "coulomb", {"mu": 0.5})
    built = model(
        ("v", 0.0, "-f"), contacts=[contact], parameters={"at": 1}, definitions={"u": "1 if t > at else 0"}
    )
    sol = hs.simulate(built, (0.0, 5.0), integrator=integrator)
    assert [(e.target, e.t) for e in sol.events] == [
        ("slip-", pytest.approx(1.0, abs=1e-12)),
        ("stick", pytest.approx(3.0, abs=1e-6)),
    ]
    assert [sol(t)[0] for t in (0.5, 2.0, 5.0)] == pytest.approx([0.0, 0.5, 1.0], abs=1e-6)


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("where", ["load", "law", "definition"])
def test_friction_that_is_pressed_on(integrator: str, where: str) -> None:
    """v falls from 5 at the rate 2 from t = 0.4 on, and a state's border at x = 4 halves what is left."""
    step = {"load": "(20 if t >= tc else 0)", "law": "20", "definition": "load"}[where]
    mu = "0.1 if t >= tc else 0" if where == "law" else "0.1 if x < 4 or x > 4.5 else 0.05"
    contact = hs.Contact("f", "v", step, "coulomb", {"mu": mu})
    built = model(
        ("x", 0.0, "v"),
        ("v", 5.0, "-f"),
        contacts=[contact],
        parameters={"tc": 0.4},
        definitions={"load": "20 if t >= tc else 0"},
    )
    x = 2 + 25 / 4 if where == "law" else 2 + 25 / 4 + 0.25
    assert end_of(built, 6.0, integrator) == pytest.approx([x, 0.0], abs=1e-9)


@pytest.mark.parametrize("integrator", METHODS)
def test_a_monitor_that_jumps(integrator: str) -> None:
    """It is recorded where its condition changes, in time and where a state passes a border."""
    monitors = [
        hs.Monitor("late", "1 if t > 3 and t < 7 else -1"),
        hs.Monitor("right", "1 if x > 1 else -1", direction="up"),
    ]
    sol = hs.simulate(model(("x", -1.0, "1"), monitors=monitors), (0.0, 10.0), integrator=integrator)
    seen = [(e.component, e.t) for e in sol.events if e.component in ("late", "right")]
    assert seen == [("right", pytest.approx(2.0)), ("late", pytest.approx(3.0)), ("late", pytest.approx(7.0))]


def test_what_is_left_is_warned_of_and_the_named_remedy_works() -> None:
    """A condition on an input may hold for a stretch, and has no border that anything moves."""
    wave = hs.Input("u", "table", times=[0, 1, 3], values=[0, 0, 2])
    built = model(("x", 0.0, "1 if u > 0.5 else 0"), inputs=[wave])
    (caution,) = jumps_of(built)
    assert "'1 if u > 0.5 else 0' in state x is not treated as a switching surface" in caution.message
    sol = hs.simulate(built, (0.0, 4.0), integrator="dop853")
    assert sol.success and any("1 if u > 0.5 else 0" in warning for warning in sol.warnings)
    assert sol(4.0)[0] == pytest.approx(2.5, abs=1e-6)
    with pytest.raises(UsageError, match="use dop853") as refused:
        hs.simulate(built, (0.0, 4.0), integrator="exact")
    assert "taylor" not in refused.value.remedy


def test_a_condition_without_an_end_has_no_meaning() -> None:
    contact = hs.Contact("f", "v - (1 if a*t > 0 else 0)", 1, "coulomb", {"mu": 0.5})
    built = model(("v", 0.0, "-f"), contacts=[contact], parameters={"a": 0.0})
    with pytest.raises(hs.HybridsimError, match=r"'a\*t' is zero at all times"):
        hs.simulate(built, (0.0, 1.0))


@pytest.mark.parametrize("integrator", METHODS)
def test_a_floor_that_is_taken_away(integrator: str) -> None:
    """From t = 1 on it is one lower: the ball falls for sqrt(2/10), and a third of its way at t = 1.25."""
    gap = "h + (1 if t > at else 0)"
    built = model(
        ("h", 0.0, "w"),
        ("w", 0.0, "-10 + N"),
        impacts=[hs.Impact("N", gap, restitution=0)],
        parameters={"at": 1.0},
    )
    sol = hs.simulate(built, (0.0, 3.0), integrator=integrator)
    assert sol.success and not sol.warnings
    assert [e.t for e in sol.events] == pytest.approx([1.0, 1 + math.sqrt(0.2)], abs=1e-9)
    assert sol(1.25) == pytest.approx([-0.3125, -2.5], abs=1e-9)
    assert sol(3.0) == pytest.approx([-1.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("integrator", METHODS)
def test_a_switching_function_that_jumps(integrator: str) -> None:
    """The relay leads to 0, and from t = 1 on to 1, which is reached at t = 2."""
    surface = hs.SwitchingSurface("u", "x - (1 if t > 1 else 0)")
    sol = hs.simulate(model(("x", 0.0, "-u"), surfaces=[surface]), (0.0, 3.0), integrator=integrator)
    assert [sol(t)[0] for t in (0.9, 1.5, 3.0)] == pytest.approx([0.0, 0.5, 1.0], abs=1e-9)


def test_what_jumps_with_a_state_in_a_velocity_is_refused_and_the_remedy_works() -> None:
    """A block that is handed over from one belt to a slower one slips down to the speed of that."""
    contact = hs.Contact("f", "v - (1 if x < 2 else 0.2)", 10, "coulomb", {"mu": 0.1})
    states = (("x", 0.0, "v"), ("v", 1.0, "-f"))
    with pytest.raises(hs.HybridsimError, match=r"'1 if x < 2 else 0\.2' jumps in guard velocity") as refused:
        hs.simulate(model(*states, contacts=[contact]), (0.0, 4.0))
    assert "reset it by a monitor of 'x - 2'" in refused.value.remedy
    over = hs.Monitor("over", "x - 2", direction="up", action="reset", reset={"belt": 0.2})
    held = hs.Contact("f", "v - belt", 10, "coulomb", {"mu": 0.1})
    built = model(*states, contacts=[held], discrete=[hs.Discrete("belt", 1)], monitors=[over])
    sol = hs.simulate(built, (0.0, 4.0))
    assert sol(4.0) == pytest.approx([2 + 0.8 * 0.6 + 1.2 * 0.2, 0.2], abs=1e-9)


def test_a_periodic_condition_has_a_period() -> None:
    contact = hs.Contact("f", "v", "1 if sin(w*t) > 0 else 2", "coulomb", {"mu": 0.1})
    built = model(
        ("x", 0.0, "v"), ("v", 0.0, "-x - 0.2*v - f + sin(w*t)"), contacts=[contact], parameters={"w": 2.0}
    )
    assert hs.steady_state(built).period == pytest.approx(math.pi, rel=1e-12)


def test_a_condition_is_told_of_by_what_it_says() -> None:
    contact = hs.Contact("f", "v - (1 if t > at else 0)", 1, "coulomb", {"mu": 0.5})
    built = model(("v", 0.0, "-f"), contacts=[contact], parameters={"at": 1})
    sol = hs.simulate(built, (0.0, 5.0), integrator="taylor")
    assert "the condition on 't - at' jumps from 0 to 1" in str(sol.explain(0))
    change = hs.sensitivities(sol, ["at"]).at([2.0, 4.0])  # v = 0.5 (t - at) up to the speed 1 of the belt
    assert change.by_parameter.ravel() == pytest.approx([-0.5, 0.0], abs=1e-9)


@pytest.mark.parametrize("integrator", ["taylor", "exact", "dop853"])
@pytest.mark.parametrize(
    "force",
    [
        "(k*x if k*x > 0 else -k*x)",
        "(k*x if not x/k <= 0 else -x*k)",
        "(k*x - a if k*x > a else 0) + (a if k*x > a else k*x) + (0 if x > 0 else -2*k*x)",
        "(k*(x - a/k) if x > a/k else 0) + min(k*x, a) - (2*k*x if x < 0 else 0)",
    ],
)
def test_continuous_conditionals_are_corners(integrator: str, force: str) -> None:
    """x'' = -k |x|: cos(w t) down to zero, then -sinh at the rate of that."""
    built = model(("x", 1.0, "v"), ("v", 0.0, f"-({force})"), parameters={"k": 4.0, "a": 1.5})
    sol = hs.simulate(built, (0.0, 1.5), integrator=integrator, rtol=1e-11)
    assert sol.success and sol.warnings == () and sol.events == ()
    s = 2 * (1.5 - math.pi / 4)
    assert sol(1.5) == pytest.approx([-math.sinh(s), -2 * math.cosh(s)], rel=1e-8)


@pytest.mark.parametrize("integrator", ["taylor", "exact", "dop853"])
def test_a_corner_whose_border_is_a_function_of_time(integrator: str) -> None:
    built = model(("x", 0.0, "sin(w*t) if sin(w*t) > 0 else 0"), parameters={"w": 2.0})
    assert end_of(built, 2 * math.pi, integrator) == [pytest.approx(2.0, abs=1e-9)]


@pytest.mark.parametrize("flow", ["sign(h - g)*sqrt(abs(h - g))", "sign(h - g)*abs(h - g)**0.5"])
@pytest.mark.parametrize("integrator", ["dop853", "tsit5", "rodas5p", "scipy-radau", "cvode-bdf"])
def test_an_orifice(integrator: str, flow: str) -> None:
    """d = h - g falls as (1 - 3 t/4)**2: continuous at zero, and no surface."""
    built = model(("h", 1.0, f"-{flow}"), ("g", 0.0, f"0.5*{flow}"))
    sol = hs.simulate(built, (0.0, 1.0), integrator=integrator)
    assert sol.success and sol.warnings == () and sol.events == ()
    assert sol(1.0)[0] - sol(1.0)[1] == pytest.approx(1 / 16, abs=1e-6)
    assert jumps_of(built) == ()


@pytest.mark.parametrize("n", ["2", "n"])
@pytest.mark.parametrize("integrator", ["taylor", "dop853", "tsit5", "rodas5p", "scipy-radau", "cvode-bdf"])
def test_bouc_wen_from_rest(integrator: str, n: str) -> None:
    """Against 28 digits of independent code; the sign of a product is the product of the signs."""
    if integrator == "taylor" and n == "n":
        pytest.skip("a power whose exponent is a parameter has no series at zero")
    built = model(
        ("u", 0.0, "v"),
        ("v", 0.0, "3*sin(5*t) - 0.1*v - 2.5*u - 2.25*z"),
        ("z", 0.0, f"10*v*(1 - abs(z)**{n}*(0.5 + 0.5*sign(v*z)))"),
        parameters={"n": 2},
    )
    sol = hs.simulate(built, (0.0, 10.0), integrator=integrator, rtol=1e-9)
    assert sol.success and sol.warnings == ()
    assert sol(10.0)[2] == pytest.approx(-0.93532027, abs=2e-7)


@pytest.mark.parametrize("integrator", ["dop853", "rodas5p"])
def test_a_product_of_signs_beside_a_root_comes_to_rest_on_its_surface(integrator: str) -> None:
    """From 1 down to 0.2, where both sides lead back: sqrt(x) falls by t/2."""
    sol = hs.simulate(model(("x", 1.0, "-x**0.5*sign(x - 0.2)*sign(x)")), (0.0, 4.0), integrator=integrator)
    (event,) = sol.events
    assert event.t == pytest.approx(2 * (1 - math.sqrt(0.2)), abs=1e-6)
    assert event.target == "sliding" and sol(4.0)[0] == 0.2


@pytest.mark.parametrize("n", ["n", "1.5"])
@pytest.mark.parametrize("integrator", ["dop853", "tsit5", "rodas5p", "scipy-radau", "cvode-bdf"])
def test_bouc_wen_with_a_fractional_power_from_rest(integrator: str, n: str) -> None:
    """Against 28 digits of independent code; abs(z)**(n - 1) is zero at the start, and has no slope there."""
    built = model(
        ("u", 0.0, "v"),
        ("v", 0.0, "3*sin(5*t) - 0.1*v - 2.5*u - 2.25*z"),
        ("z", 0.0, f"10*(v - 0.5*abs(v)*abs(z)**({n} - 1)*z - 0.5*v*abs(z)**{n})"),
        parameters={"n": 1.5},
    )
    sol = hs.simulate(built, (0.0, 10.0), integrator=integrator, rtol=1e-9)
    assert sol.success and sol.warnings == ()
    assert sol(10.0)[2] == pytest.approx(-0.88821757, abs=2e-7)


@pytest.mark.parametrize("expr", ["max(x, y, 0.2)", "max(min(x, 1), -1)", "abs(abs(x) - 1)", "sign(x - 9)"])
@pytest.mark.parametrize("where", ["velocity", "load"])
def test_corners_that_are_differentiated(where: str, expr: str) -> None:
    """In a velocity, or a load whose rate a law asks for: the run goes on, or is refused by name."""
    velocity, load = (f"v - 0.1*({expr})", 1) if where == "velocity" else ("v", f"3 + ({expr})")
    law = ("coulomb", {"mu": 0.3}) if where == "velocity" else ("dahl", {"mu": 0.3, "sigma": 10})
    built = model(
        ("x", 0.3, "v"), ("y", 0.4, "1"), ("v", 1.0, "-f"), contacts=[hs.Contact("f", velocity, load, *law)]
    )
    try:
        assert hs.simulate(built, (0.0, 0.2), integrator="dop853").success
    except hs.HybridsimError as refused:
        assert expr in str(refused)


@pytest.mark.parametrize(
    "belt",
    [
        "abs(x) if not abs(x) > c else c",
        "c if not abs(x) <= c else abs(x)",
        "abs(x) if not not abs(x) < c else c",
        "abs(x) if (abs(x) < c if k > 0 else False) else c",
    ],
)
def test_a_smaller_of_two_however_its_condition_is_written(belt: str) -> None:
    """A body goes with a belt at the smaller of |x| and a discrete c, whose rate of one friction can follow."""
    built = hs.Model(
        "belt",
        parameters={"k": 1},
        states=[hs.State("x", -1, 1), hs.State("w", 0.5, "-f")],
        discrete=[hs.Discrete("c", 0.5)],
        contacts=[hs.Contact("f", velocity=f"w - ({belt})", normal=1, law="coulomb", arguments={"mu": 2})],
    )
    sol = hs.simulate(built, (0.0, 2.0), integrator="dop853")
    assert sol.success, sol.message
    assert [interval.mode for interval in sol.modes["f"]] == ["stick"]
    for t in (0.2, 0.6, 0.9, 1.2, 1.4, 1.8):
        assert sol(t)[1] == pytest.approx(min(abs(t - 1.0), 0.5), abs=1e-12)
