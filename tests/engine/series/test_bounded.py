"""Taylor coefficients along a flow, and their error bounds, against mpmath on the doubles as given."""

from __future__ import annotations

import ast
import math
import random
import statistics
from dataclasses import replace

import mpmath
import numpy as np
import pytest
import sympy
from engine.multiple_precision import coefficients
from engine.random_expressions import random_expression
from engine.tapes import NAMES, ORDER, STATES, UNIT, Point, series
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import hybridsim as hs
from hybridsim.engine.system.instant import Instant, multiple
from hybridsim.engine.system.system import System
from hybridsim.expr import parse
from hybridsim.expr.symbolic import to_sympy
from hybridsim.model import Model, Monitor, Parameter, State

# mpmath differentiates numerically; with 70 digits what it gets is good to some thirty of the largest coefficient
TRUTH = 1e-30


def check(text: str, at: Point) -> None:
    """Every coefficient is within its own bound."""
    found, bounds = series(text, at)
    true = coefficients(text, at.motion)
    size = max(abs(c) for c in true)
    for k in range(ORDER + 1):
        with mpmath.workdps(50):
            error = abs(mpmath.mpf(found[k]) - true[k])
        assert error <= bounds[k] + TRUTH * size, f"order {k} of {text}: {found[k]} for {float(true[k])}"
        assert bounds[k] <= 1e3 * UNIT * max(1.0, float(size)), f"order {k} of {text}: bound {bounds[k]}"


# -- every function, where it is tame and where it is not -------------------------------------------------------

PLAIN = [
    "x", "t", "3", "a", "-x", "x + y*u", "x - y - -u", "x*y*u*v", "x/(2 + y)", "x/(y/u)", "(x/y)/u", "1/(1/x)",
    "sin(x)", "cos(x*y)", "tan(u)", "asin(u)", "acos(y)", "atan(3*v)", "sinh(x)", "cosh(v)", "tanh(2*x)",
    "exp(x*y)", "log(x)", "log(2 + v)", "sqrt(x)", "sqrt(1 + y*y)", "abs(v)", "abs(x)*abs(v)", "sign(v)*x", "min(x, y)",
    "max(x, y, v)", "min(max(x, v), u)", "atan2(u, v)", "atan2(v, u)", "atan2(-y, -x)", "atan2(x, 0*x)",
    "x if u > v else y", "x if u < v else y", "x if not (u <= v) else y", "x if u >= v and x < y else v",
    "x if u < 0 or 0 < x < 1 else y", "x if (y if a > 0 else b) > 0 else v", "(x if y != 1 else y)*u",
    "x**2", "x**3", "x**7", "(-x)**2", "-x**2", "v**3", "v**5", "v**-3", "x**64", "v**63*v**62", "(x + y)**-2",
    "x**0.5", "x**-0.5", "x**1.5", "x**-2.5", "(1 + y)**3.5", "x**a", "(2 + v)**b", "abs(v)**a", "2**x", "x**(a*t + y)",
    "exp(1)*x", "sin(1)*y", "pi*x", "tan(x + pi/2)", "tan(pi/2 - u)", "exp(x)**2.5", "(x*x)**0.5", "sin(acos(u))",
    "atan2(0, v)", "atan2(x, x)", "sin(t)*cos(3*t)", "t**2*exp(-t)",
    "abs(log(x))", "abs(sqrt(x)*v)", "abs(exp(sin(log(2 + sin(v)))))", "sin(a*t + cos(b*t))", "x*t**2",
]  # fmt: skip


@pytest.mark.parametrize("text", PLAIN)
def test_every_function_at_a_plain_point(text: str) -> None:
    check(text, Point(t=0.375))


@pytest.mark.parametrize(
    ("text", "at"),
    [
        ("tan(x)", Point(x=1.57)),
        ("tan(x)", Point(x=1e6)),
        ("sin(x)", Point(x=-1e8, c=3.0)),
        ("cos(x)", Point(x=math.pi / 2)),
        ("sin(x)", Point(x=math.pi)),
        ("tanh(x)", Point(x=30.0)),
        ("tanh(x)", Point(x=1e-9)),
        ("sinh(x)", Point(x=-1e-12)),
        ("asin(x)", Point(x=0.99999)),
        ("acos(x)", Point(x=-0.9999999)),
        ("log(x)", Point(x=1.0 + 2**-40)),
        ("log(x)", Point(x=1e-5)),
        ("sqrt(x)", Point(x=1e-6)),
        ("exp(x)", Point(x=-200.0)),
        ("exp(-1e5*x)", Point(x=1e-3)),
        ("atan2(y, x)", Point(x=-1.0, y=1e-9)),
        ("atan2(y, x)", Point(x=-1.0, y=-1e-9)),
        ("atan2(y, x)", Point(x=0.0, y=2.0)),
        ("x**0.5 - y**0.5", Point(x=1.0, y=1.0 + 2**-50)),
        ("u*u + v*v - 1", Point(u=0.6, v=0.8)),
        ("x - x*(1 + t)", Point(t=2**-30)),
        ("v**64", Point(v=-1.5)),
        ("u/(v + 0.5)", Point(v=-0.5 + 2**-20)),
    ],
)
def test_awkward_points(text: str, at: Point) -> None:
    """Cancellation, steep places, the far branch of the angle: the bound may be large but it must hold."""
    found, bounds = series(text, at)
    true = coefficients(text, at.motion)
    size = max(abs(c) for c in true)
    for k in range(ORDER + 1):
        with mpmath.workdps(50):
            assert abs(mpmath.mpf(found[k]) - true[k]) <= bounds[k] + TRUTH * size
    assert np.isfinite(bounds).all()


# -- random expressions -----------------------------------------------------------------------------------------


def random_case(seed: int, depth: int = 4) -> tuple[str, Point]:
    pick = random.Random(seed)
    return random_expression(pick, depth), Point(*(pick.uniform(-1, 1) for _ in NAMES))


def folds_exactly(text: str) -> bool:
    """Whether SymPy rounded no constant: what it folds is not the tape's to bound.

    A function of decimals alone is folded to fifteen digits, also where these look round: tanh(24.5) becomes 1.
    """
    calls = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call))
    inside = [[n for argument in call.args for n in ast.walk(argument)] for call in calls]
    of_decimals = any(
        any(isinstance(n, ast.Constant) and isinstance(n.value, float) for n in nodes)
        and not any(isinstance(n, ast.Name) and n.id in NAMES for n in nodes)
        for nodes in inside
    )
    expression = to_sympy(parse(text), {n: sympy.Symbol(n, real=True) for n in NAMES})
    return not of_decimals and all((float(f) * 2**20).is_integer() for f in expression.atoms(sympy.Float))


def ratios(text: str, at: Point) -> list[float]:
    """Bound over error, for each order at which there is an error."""
    found, bounds = series(text, at)
    true = coefficients(text, at.motion)
    size = max(abs(c) for c in true)
    result = []
    for k in range(ORDER + 1):
        with mpmath.workdps(50):
            error = abs(mpmath.mpf(found[k]) - true[k])
        assert error <= bounds[k] + TRUTH * size, f"order {k} of {text} at {at}"
        if error > TRUTH * size:
            result.append(float(bounds[k] / error))
    return result


def test_a_constant_that_is_no_double_has_a_bound() -> None:
    at = Point(x=0.1, y=0.2, u=0.3, v=0.4, t=0.5, a=0.6, b=0.7, c=0.8)
    for text in ("cos(atan(2))", "sqrt(2)", "1/3"):
        ratios(text, at)


@given(st.integers(0, 2**32))
@settings(max_examples=150)
def test_the_bound_holds_for_random_expressions(seed: int) -> None:
    text, at = random_case(seed)
    assume(folds_exactly(text))
    ratios(text, at)


def test_the_bound_is_not_absurdly_large() -> None:
    """Half of the bounds are within a factor of 100 of the error, nine tenths within 10**4."""
    cases = [random_case(seed) for seed in range(250)]
    found = sorted(r for text, at in cases if folds_exactly(text) for r in ratios(text, at))
    assert len(found) > 400
    assert statistics.median(found) < 100
    assert found[len(found) * 9 // 10] < 1e4


@given(st.integers(0, 2**32), st.floats(-1, 1), st.floats(-1, 1))
@settings(max_examples=100)
def test_errors_of_states_and_time_are_carried_along(seed: int, shift: float, late: float) -> None:
    """The true state may be anywhere within x_error of the given one, the true time within s_error."""
    text, at = random_case(seed, depth=3)
    assume(folds_exactly(text))
    error = 1e-11
    found, bounds = series(text, at, x_error=error, s_error=error)
    moved = replace(at, **{n: getattr(at, n) * (1 + shift * error) for n in STATES}, t=at.t + late * error)
    with mpmath.workdps(60):
        apart = {n: abs(mpmath.mpf(getattr(moved, n)) / mpmath.mpf(getattr(at, n)) - 1) for n in STATES}
        assume(
            all(r <= error for r in apart.values()) and abs(mpmath.mpf(moved.t) - mpmath.mpf(at.t)) <= error
        )
    true = coefficients(text, moved.motion)
    for k in range(ORDER + 1):
        with mpmath.workdps(50):
            gap = abs(mpmath.mpf(found[k]) - true[k])
        # the bounds are of first order: what is left is of the size error**2 times a few thousand
        assert gap <= bounds[k] + 1e6 * error**2


# -- corners, where they are ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "at", "expected"),
    [
        ("abs(x)", Point(x=0.0, c=2.0), [0, 2, 0, 0]),
        ("abs(x)", Point(x=0.0, c=-2.0), [0, 2, 0, 0]),
        ("abs(u)", Point(u=0.0, v=-1.0), [0, 1, 0, -1 / 6]),
        ("abs(t)", Point(t=0.0), [0, 1, 0, 0]),
        ("min(x, 1)", Point(x=1.0, c=1.0), [1, 0, 0, 0]),
        ("min(x, 1)", Point(x=1.0, c=-1.0), [1, -1, 0, 0]),
        ("max(x, 1)", Point(x=1.0, c=1.0), [1, 1, 0, 0]),
        ("max(x, 1)", Point(x=1.0, c=-1.0), [1, 0, 0, 0]),
        ("max(u, x)", Point(u=0.0, v=1.0, x=0.0, c=1.0), [0, 1, 0, 0]),
        ("min(u, x)", Point(u=0.0, v=1.0, x=0.0, c=1.0), [0, 1, 0, -1 / 6]),
        ("sqrt(x*x)", Point(x=0.0, c=-3.0), [0, 3, 0, 0]),
    ],
)
def test_a_corner_takes_the_side_that_the_flow_goes_to(text: str, at: Point, expected: list[float]) -> None:
    found, _ = series(text, at)
    assert found == pytest.approx(expected, abs=1e-16)


@pytest.mark.parametrize("text", ["log(x)", "sqrt(x)", "asin(x - 1)", "acos(x - 1)", "x**0.25", "x**y"])
def test_outside_its_domain_a_function_is_not_a_number(text: str) -> None:
    found, _ = series(text, Point(x=-0.5))
    assert math.isnan(found[0])


@pytest.mark.parametrize(
    ("text", "value"), [("x**1.5", 0.0), ("x**0.5", 0.0), ("x**3*y", 0.0), ("u*x**2.5", 0.0)]
)
def test_powers_have_a_value_at_zero(text: str, value: float) -> None:
    assert series(text, Point(x=0.0))[0][0] == value


def test_dividing_by_zero_is_no_finite_number_and_no_crash() -> None:
    for text in ("1/x", "y/(x*x)", "x**-2", "log(x)", "atan2(x, x*y)"):
        assert not np.isfinite(series(text, Point(x=0.0))[0]).all()


# -- through a whole model --------------------------------------------------------------------------------------


@pytest.mark.parametrize("periods", [0, 3, 10**6])
def test_guards_of_the_oscillator_far_out(periods: int) -> None:
    """The stick guards of `dfcs` along the stick, after a million periods: phase, bound and all."""
    system = System(hs.load("dfcs"))
    values = system.model.parameter_values()
    period = 2 * math.pi / values["omega"]
    origin = multiple(0.0, periods, period).plus(0.123 * period)
    s, s_error = 0.04 * period, 2.0 * math.ulp(0.04 * period)
    x = np.array([3.3e-5, 0.0])
    hold = np.array([system.automata[0].hold])
    found = system.series(s, x, system.vector(origin, np.zeros(0)), hold, np.zeros(2), s_error)
    guards = system.automata[0].guards[hold[0]]

    def force(h: mpmath.mpf) -> mpmath.mpf:
        t = mpmath.mpf(origin.high) + mpmath.mpf(origin.low) + mpmath.mpf(s) + h
        return values["F0"] * mpmath.sin(mpmath.mpf(values["omega"]) * t) - mpmath.mpf(
            values["k"]
        ) * mpmath.mpf(x[0])

    with mpmath.workdps(70):
        upper = mpmath.taylor(lambda h: mpmath.mpf(values["mu"]) * values["N"] - force(h), 0, 3)
        lower = mpmath.taylor(lambda h: mpmath.mpf(values["mu"]) * values["N"] + force(h), 0, 3)
        for g, true in zip(guards, (upper, lower), strict=True):
            for k in range(4):
                error = abs(mpmath.mpf(found.guards[g, k]) - true[k])
                assert error <= found.guard_bounds[g, k]
                # the phase is known to an ulp of pi, and nothing else is large
                assert found.guard_bounds[g, k] <= 64 * UNIT * values["F0"] * values["omega"] ** k * 8


def test_states_and_monitors_along_a_nonlinear_flow() -> None:
    """x' = x**2 has the solution x0/(1 - x0 h): every coefficient of x is a power of x0."""
    model = Model(
        "blow-up",
        states=(State("x", 0.7, "x**2"), State("w", 0.2, "p*sin(x)")),
        parameters=(Parameter("p", 1.3),),
        monitors=(Monitor("m", "w*x", direction="both", action="record"),),
    )
    system = System(model)
    x = np.array([0.7, 0.2])
    found = system.series(
        0.0, x, system.vector(Instant(0.0), np.zeros(0)), np.zeros(0, dtype=np.int64), 0 * x, 0.0
    )
    with mpmath.workdps(60):
        x0, p = mpmath.mpf(0.7), mpmath.mpf(1.3)
        powers = [x0 ** (k + 1) for k in range(4)]
        # w' = p sin(x), w'' = p cos(x) x**2, w''' = p (2 x**3 cos(x) - x**4 sin(x))
        third = p * (2 * x0**3 * mpmath.cos(x0) - x0**4 * mpmath.sin(x0))
        w = [mpmath.mpf(0.2), p * mpmath.sin(x0), p * mpmath.cos(x0) * x0**2 / 2, third / 6]
        product = [sum(w[i] * powers[k - i] for i in range(k + 1)) for k in range(4)]
        for row, true in ((found.states[0], powers), (found.states[1], w), (found.monitors[0], product)):
            for k in range(4):
                assert abs(mpmath.mpf(row[k]) - true[k]) <= 8 * UNIT
        for k in range(4):
            assert (
                abs(mpmath.mpf(found.monitors[0, k]) - product[k]) <= found.monitor_bounds[0, k] <= 30 * UNIT
            )
