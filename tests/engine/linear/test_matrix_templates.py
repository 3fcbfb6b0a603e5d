"""Linear modes at many values of the parameters: read once, and right for each, zeros and conditions included."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.linear.matrix_template import templates_of
from hybridsim.engine.linear.modes import what_is_not_linear
from hybridsim.engine.linear.tables import linear_tables
from hybridsim.engine.native.simd.products import rows_of
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

MODEL = hs.Model(
    "values",
    [
        hs.State("x", 0, "v"),
        hs.State("v", 0, "(a*sin(w*t) + b*cos(u*t) - c*v - k*x + d*exp(-g*t) - (x*x if q > 0 else 0.5*x))/m"),
        hs.State("y", 0, "(x if s > 0 else y)*s + a*b*t"),
    ],
    parameters=dict.fromkeys(("a", "b", "c", "d", "g", "k", "m", "s", "u", "w"), 1) | {"q": 0},
)
NAMES = [p.name for p in MODEL.parameters]


def rates(system: System, s: float, x: np.ndarray) -> np.ndarray:
    """By the tables, from states and functions of time."""
    values = system.values
    p = system.vector(Instant(0.0), np.zeros(0))
    tables = linear_tables(system, np.zeros((1, len(system.automata)), dtype=np.int64), p, 1.0).tables
    atoms = []
    for a, kind in enumerate(tables.kinds):
        terms = range(tables.term_start[a], tables.term_start[a + 1])
        angle = tables.offsets[a] + sum(tables.weights[i] * p[tables.sources[i]] for i in terms)
        moved = angle + tables.rates[a] * s
        atoms.append({0: (s,), 1: (angle,), 2: (np.sin(moved), np.cos(moved)), 3: (np.exp(moved),)}[kind])
    one = 2 * len(atoms)
    functions = [np.prod([atoms[f // 2][f % 2] for f in row if f != one]) for row in tables.factors]
    assert values["q"] == 0.0
    y = rows_of(np.concatenate([x, functions]), (len(x), len(functions)))
    (panel,) = tables.slopes[0]
    return (y @ panel)[: len(x)]


def expected(values: dict[str, float], t: float, x: np.ndarray) -> list[float]:
    a, b, c, d, g, k, m, s, u, w = (values[n] for n in NAMES[:10])
    force = a * np.sin(w * t) + b * np.cos(u * t) - c * x[1] - (k + 0.5) * x[0] + d * np.exp(-g * t)
    return [x[1], force / m, (x[0] if s > 0 else x[2]) * s + a * b * t]


def test_every_pattern_of_zeros() -> None:
    """Terms vanish, frequencies coincide, a condition turns: each time the matrices are those of the formula."""
    draw = np.random.default_rng(0)
    for zeros in itertools.product([False, True], repeat=4):
        for same, sign in itertools.product([False, True], [-1.0, 1.0]):
            values = {n: float(draw.uniform(0.5, 2.0)) for n in NAMES} | {"q": 0.0}
            values |= {n: 0.0 for n, zero in zip("abdk", zeros, strict=True) if zero}
            values["s"] *= sign
            if same:
                values["u"] = values["w"]
            system = System(MODEL.with_(**values))
            x, t = draw.normal(size=3), float(draw.uniform(0, 3))
            want = np.array(expected(values, t, x))
            scale = np.abs(x).sum() + sum(abs(v) for v in values.values())
            assert np.abs(rates(system, t, x) - want).max() <= 1e-14 * scale**2


def test_the_order_of_values_does_not_matter() -> None:
    """Plans are kept and found again: the tables are the same to the bit, whatever was made before."""
    sets = [{"a": 0.0}, {"a": 1.5}, {"w": 1.0, "u": 1.0}, {"s": -1.0}, {"a": 0.0, "b": 0.0}, {"k": 0.0}]
    modes = np.zeros((1, 0), dtype=np.int64)

    def tables(values: dict[str, float]) -> list[object]:
        system = System(MODEL.with_(**values))
        made = linear_tables(system, modes, system.vector(Instant(0.0), np.zeros(0)), 1.0).tables
        return [getattr(made, name).tolist() for name in ("slopes", "rates", "weights", "values", "inverse")]

    forward = [tables(values) for values in sets]
    templates_of(System(MODEL)).clear()
    backward = [tables(values) for values in reversed(sets)]
    assert forward == backward[::-1]


def test_linear_at_some_values_only() -> None:
    for q, is_linear in ((0, True), (0.5, False), (0, True), (1, False)):
        system = System(MODEL.with_(q=q))
        assert (what_is_not_linear(system) is None) == is_linear
        if not is_linear:
            with pytest.raises(hs.UsageError, match="the rate of v has a product of states"):
                hs.simulate(MODEL.with_(q=q), (0, 0.1), integrator="exact")


def test_a_quotient_by_zero_is_said() -> None:
    model = hs.Model("free", [hs.State("x", 1, "v"), hs.State("v", 0, "-k*x/m")], parameters={"k": 4, "m": 1})
    assert hs.simulate(model, (0, 1), integrator="exact").success
    broken = hs.simulate(model.with_(m=0), (0, 1), integrator="exact")
    assert broken.status == "step-failure"
    assert "the rate of v has a division by zero" in broken.message


def test_a_neighbour_without_numbers_is_left_out() -> None:
    """A contact and a relay that cannot both be held make a mode with infinite guards, in which nothing ever is."""
    model = hs.Model(
        "neighbours",
        [
            hs.State("x", 0.3, "v"),
            hs.State("v", 0.0, "-4*x + 4*sin(t) - f - 0.4*u", nominal=1.0),
        ],
        contacts=[hs.Contact("f", velocity="v - 0.2", normal=0.5, law="coulomb", arguments={"mu": 0.7})],
        surfaces=[hs.SwitchingSurface("u", "x + 0.5*v")],
    )
    system = System(model)
    hold = np.array([[a.hold for a in system.automata], [a.above for a in system.automata]])
    p = system.vector(Instant(0.0), np.zeros(0))
    assert linear_tables(system, hold[:1], p, 10.0) is None
    both = linear_tables(system, hold, p, 10.0)
    assert both is not None
    for name in ("inverse", "slopes"):  # a motion there is neither gone on with nor taken for rest
        assert np.isnan(getattr(both.tables, name)[0]).all()
        assert np.isfinite(getattr(both.tables, name)[1]).all()
    exact, taylor = (hs.simulate(model, (0, 30), integrator=name, rtol=1e-12) for name in ("exact", "taylor"))
    assert exact.stats["kernel_time"] > 0.0
    assert len(exact.events) == len(taylor.events) > 10
    np.testing.assert_allclose([e.t for e in exact.events], [e.t for e in taylor.events], atol=1e-9)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_a_mode_without_numbers_is_not_gone_on_in(integrator: str) -> None:
    """No guard is left to notice: the run says that the rate is no number."""
    modes = [
        hs.Mode("on", der={"x": "-1"}, guards=[hs.Guard("low", "x - 0.5", "off")]),
        hs.Mode("off", der={"x": "1/(a - 1)"}),
    ]
    model = hs.Model(
        "off",
        [hs.State("x", 1.0, "0")],
        parameters={"a": 1.0},
        components=[hs.Component("s", modes, initial="on")],
    )
    sol = hs.simulate(model, (0, 2), integrator=integrator)
    assert (sol.status, len(sol.events)) == ("step-failure", 1)
    assert "not" in sol.message
    assert "finite" in sol.message
    assert hs.simulate(model.with_(a=2.0), (0, 2), integrator=integrator)(2.0)[0] == pytest.approx(
        2.0, abs=1e-8
    )
