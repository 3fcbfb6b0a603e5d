"""Starts and resets that lie on a zero up to the roundoff of the model's numbers: 3*0.1 on a guard at 0.3."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

import hybridsim as hs
from hybridsim.expr import evaluate, parse, rounding_of

LOCATING = (
    "dop853", "tsit5", "rodas5p", "exact", "taylor", "scipy-dop853", "scipy-rk45", "scipy-radau", "scipy-lsoda",
    "cvode-adams", "cvode-bdf",
)  # fmt: skip
FEW = ("taylor", "exact", "dop853")
NUMBERS = "[parameters]\na = 0.1\nb = 0.3\n"
# a start, and a function that is zero there in exact arithmetic, not in doubles
ON_ZERO = [
    ("3*a", "0.3 - x", -1),
    ("3*a", "b - x", -1),
    ("a + 0.2", "0.3 - x", -1),
    ("b", "3*a - x", -1),
    ("-3*a", "x + 0.3", 1),
    ("1 - 0.9", "x - 0.1", 1),
    ("1.1 + 2.2", "3.3 - x", -1),
    ("0.1 + 0.7", "x - 0.8", 1),
    ("1.1*1.1", "1.21 - x", -1),
]


def model(text: str) -> hs.Model:
    return hs.Model.from_toml('schema = 1\nname = "scene"\n' + text)


def guarded(start: str, guard: str, rate: int, numbers: str = NUMBERS) -> hs.Model:
    """A ramp with a guard that counts when it fires."""
    return model(
        f'{numbers}[states]\nx = {{ start = "{start}", der = "{rate}" }}\n[discrete]\nn = 0\n'
        f'[components.g.modes.one]\ninitial = true\nguards.e = {{ expr = "{guard}", '
        'then = { to = "two", reset = { n = "+= 1" } } }\n[components.g.modes.two]\n'
    )


def belt(start: str, more: str = "") -> hs.Model:
    """A body on a belt of speed 0.3 under a load between kinetic and static friction."""
    return model(
        f'{NUMBERS}[states]\nv = {{ start = "{start}", der = "2.5 - f" }}\n{more}'
        '[contacts.f]\nvelocity = "v - 0.3"\nnormal = 10\n'
        'law = { name = "static-kinetic", mu_s = 0.3, mu_k = 0.2 }\n'
    )


@pytest.mark.parametrize("integrator", LOCATING)
@pytest.mark.parametrize("start", ["3*a", "a + 0.2", "b"])
def test_a_body_at_the_speed_of_its_belt_sticks_below_static_friction(start: str, integrator: str) -> None:
    sol = hs.simulate(belt(start), (0, 1), integrator=integrator)
    assert sol(1.0)[0] == pytest.approx(0.3, abs=1e-15)
    assert [span.mode for span in sol.modes["f"]] == ["stick"]


@pytest.mark.parametrize("integrator", FEW)
@pytest.mark.parametrize("start", ["0", "0.3"])
@pytest.mark.parametrize("value", ["3*a", "3*0.1", "0.1 + 0.2"])
def test_a_tick_that_sets_the_speed_of_the_belt_leaves_the_body_sticking(
    value: str, start: str, integrator: str
) -> None:
    tick = f'[schedules.s]\ntimes = [0.75]\nreset = {{ v = "{value}" }}\n'
    sol = hs.simulate(belt(start, tick), (0, 1), integrator=integrator)
    assert sol(1.0)[0] == pytest.approx(0.3, abs=1e-15)
    assert sol.modes["f"][-1].mode == "stick"


@pytest.mark.parametrize("integrator", FEW)
@pytest.mark.parametrize(("start", "guard", "rate"), ON_ZERO)
def test_a_guard_and_a_monitor_that_rise_from_zero_do_not_fire(
    start: str, guard: str, rate: int, integrator: str
) -> None:
    assert not hs.simulate(guarded(start, guard, rate), (0, 0.5), integrator=integrator).events
    watched = (
        f'{NUMBERS}[states]\nx = {{ start = "{start}", der = "{rate}" }}\n[discrete]\nn = 0\n'
        f'[monitors.m]\nexpr = "{guard}"\naction = "reset"\nreset = {{ n = "+= 1" }}\n'
    )
    assert hs.simulate(model(watched), (0, 0.5), integrator=integrator).output("n", 0.5) == 0.0


@pytest.mark.parametrize("integrator", FEW)
@pytest.mark.parametrize(("start", "guard", "rate"), ON_ZERO)
def test_a_guard_and_a_tick_that_puts_the_state_on_it(
    start: str, guard: str, rate: int, integrator: str
) -> None:
    text = (
        f'{NUMBERS}[states]\nx = {{ start = {-9 if rate < 0 else 9}, der = "go*({rate})" }}\n'
        "[discrete]\nn = 0\ngo = 0\n"
        f'[schedules.s]\ntimes = [0.5]\nreset = {{ x = "{start}", go = "1" }}\n'
        f'[components.g.modes.one]\ninitial = true\nguards.e = {{ expr = "{guard}", '
        'then = { to = "two", reset = { n = "+= 1" } } }\n[components.g.modes.two]\n'
    )
    assert hs.simulate(model(text), (0, 1), integrator=integrator).output("n", 1.0) == 0.0


@pytest.mark.parametrize("places", [2, 3, 8])
def test_a_start_beside_a_guard_by_some_last_places_is_beside_it(places: int) -> None:
    start = 0.3 + places * math.ulp(0.3)
    assert len(hs.simulate(guarded(repr(start), "0.3 - x", -1), (0, 0.5), integrator="taylor").events) == 1
    start = 0.5 + places * math.ulp(0.5)
    assert len(hs.simulate(guarded(repr(start), "0.5 - x", -1), (0, 0.5), integrator="taylor").events) == 1


@pytest.mark.parametrize("integrator", FEW)
@pytest.mark.parametrize(
    ("start", "floor"), [("1 - 0.9", "0.1"), ("0.1 + 0.7", "0.8"), ("3.3", "(1.1 + 2.2)"), ("3*a", "0.3")]
)
@pytest.mark.parametrize(("speed", "after"), [(0, 0.0), (1, 0.5), (-1, 0.0)])
def test_a_ball_on_its_floor_rests_leaves_and_strikes(
    start: str, floor: str, speed: int, after: float, integrator: str
) -> None:
    text = (
        f'{NUMBERS}[states]\nh = {{ start = "{start}", der = "w" }}\nw = {{ start = {speed}, der = "p - 10" }}\n'
        f'[impacts.p]\ngap = "h - {floor}"\nrestitution = 0.5\n'
    )
    sol = hs.simulate(model(text), (0, 0.05), integrator=integrator)
    assert sol.success
    assert sol(0.05)[1] == pytest.approx(after, abs=1e-12)  # w - g t, or half of the speed up, less g t


@pytest.mark.parametrize(("start", "value"), [("0.3", "0.3"), ("3*a", "0.3"), ("1.1 + 2.2", "3.3")])
def test_a_start_on_a_surface_that_repels_has_two_motions(start: str, value: str) -> None:
    text = f'{NUMBERS}[states]\nx = {{ start = "{start}", der = "q" }}\n[surfaces]\nq = "x - {value}"\n'
    assert hs.simulate(model(text), (0, 1), integrator="taylor").status == "nonunique"


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("3*a", Fraction(3, 10)),
        ("1 - 0.9", Fraction(1, 10)),
        ("1.1 + 2.2", Fraction(33, 10)),
        ("1.1*1.1", Fraction(121, 100)),
        ("0.7/7", Fraction(1, 10)),
        ("2*0.5 + 3", Fraction(4)),
    ],
)
def test_the_bound_of_an_expression_counts_the_roundoff_of_its_numbers(text: str, meant: Fraction) -> None:
    expr = parse(text)
    off = abs(float(Fraction(evaluate(expr, {"a": 0.1})) - meant))
    bound = rounding_of(expr, {"a": 0.1})
    assert off <= bound <= 2.0**-51 * float(meant) + 2.0**-54
    assert (bound == 0.0) == (text == "2*0.5 + 3")
