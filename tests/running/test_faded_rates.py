"""A part of a rate or guard that is below rounding at both ends of a step and not between is not stepped over."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable

import mpmath
import pytest
from scipy.integrate import quad

import hybridsim as hs

METHODS = ("taylor", "dop853", "tsit5", "rodas5p", "scipy-dop853")


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("centre, width", [(0.5, 0.07), (0.4, 0.03), (0.5, 0.02)])
def test_a_pulse_in_time(centre: float, width: float, integrator: str) -> None:
    """y' = 1 + exp(-((t - c)/w)**2): y(1) = 1 + w sqrt(pi)/2 (erf((1 - c)/w) + erf(c/w))."""
    rate = f"1 + exp(-((t - {centre})/{width})**2)"
    model = hs.Model("pulse", [hs.State("y", 0, rate), hs.State("u", 1, "sin(3*t) - u")])
    area = width * math.sqrt(math.pi) / 2 * (math.erf((1 - centre) / width) + math.erf(centre / width))
    for rtol in (1e-6, 1e-9):
        sol = hs.simulate(model, (0, 1), integrator=integrator, rtol=rtol)
        assert sol.y[0, -1] == pytest.approx(1 + area, abs=10 * rtol)


# none of the stages of tsit5 meets it after long steps of an even rate, and its error estimate is zero
@pytest.mark.parametrize("integrator", [name for name in METHODS if name != "tsit5"])
def test_a_force_that_is_there_near_rest_alone(integrator: str) -> None:
    """v' = 1 + exp(-(v/w)**2) from v = -1: v = 1 at the integral of dv/v', by quadrature in 30 digits."""
    width = 0.05
    model = hs.Model("slow", [hs.State("x", 0, "v"), hs.State("v", -1, f"1 + exp(-(v/{width})**2)")])
    with mpmath.workdps(30):
        needed = mpmath.quad(
            lambda v: 1 / (1 + mpmath.exp(-((v / mpmath.mpf(width)) ** 2))),
            [-1, -0.2, -0.05, 0, 0.05, 0.2, 1],
        )
    sol = hs.simulate(model, (0, float(needed)), integrator=integrator, rtol=1e-9)
    assert sol.y[1, -1] == pytest.approx(1.0, abs=1e-7)


@pytest.mark.parametrize("way", ["compiled", "stepped"])
@pytest.mark.parametrize(
    "rate, area",
    [
        # the integrals of all but cos(t) over the real line, of pulses that are over before the run ends
        ("exp(-((t - 0.45)/0.003)**2)", 0.003 * math.sqrt(math.pi)),
        ("exp(-((t - 0.2)/0.01)**2) + exp(-((t - 0.6)/0.01)**2)", 0.02 * math.sqrt(math.pi)),
        ("exp(-((t - 0.3)/0.01)**2) - exp(-((t - 0.8)/0.004)**2)", 0.006 * math.sqrt(math.pi)),
        ("1 - tanh((t - 0.37)/0.002)**2", 0.004),
        ("exp((t - 0.37)/0.002)/(1 + exp((t - 0.37)/0.002))**2", 0.002),
        ("1/(1 + exp((t - 0.55)/0.004)) - 1/(1 + exp((t - 0.5)/0.004))", 0.05),
    ],
)
def test_narrow_pulses(rate: str, area: float, way: str) -> None:
    """y' = cos(t) + pulses, along whose rises and falls no step begins or ends: y(1) = sin(1) + their areas."""
    model = hs.Model(
        "pulses",
        [hs.State("y", 0, f"cos(t) + {rate}")],
        monitors=[hs.Monitor("high", "y - 1000")] if way == "stepped" else [],
    )
    for rtol in (1e-4, 1e-7, 1e-12):
        sol = hs.simulate(model, (0, 1), integrator="taylor", rtol=rtol)
        assert sol.y[0, -1] == pytest.approx(math.sin(1) + area, abs=30 * rtol)


@pytest.mark.parametrize("way", ["compiled", "stepped"])
@pytest.mark.parametrize("width", [0.1, 0.03, 0.01, 0.003, 1e-3, 1e-4])
def test_a_velocity_that_goes_away_and_turns_round(width: float, way: str) -> None:
    """A force near rest alone, of a body that leaves rest, turns, passes rest and turns again: v = sin(1.7 t) - 0.2.

    x' = exp(-(v/w)**2): by quadrature, split about where v passes rest.
    """
    model = hs.Model(
        "turns",
        [hs.State("v", -0.2, "1.7*cos(1.7*t)"), hs.State("x", 0, f"exp(-(v/{width})**2)")],
        monitors=[hs.Monitor("high", "x - 1000")] if way == "stepped" else [],
    )
    phases = [math.asin(0.2) + 2 * k * math.pi for k in range(4)]
    rest = [phase / 1.7 for first in phases for phase in (first, first + math.pi - 2 * math.asin(0.2))]
    area = integral(lambda t: math.exp(-(((math.sin(1.7 * t) - 0.2) / width) ** 2)), 10, rest, width / 2)
    for rtol in (1e-6, 1e-9, 1e-12):
        sol = hs.simulate(model, (0, 10), integrator="taylor", rtol=rtol)
        assert sol.y[1, -1] == pytest.approx(area, abs=10 * rtol)


@pytest.mark.parametrize("way", ["compiled", "stepped"])
@pytest.mark.parametrize("width", [1e-3, 1e-5, 1e-7])
@pytest.mark.parametrize("law", ["tanh(u/{w})", "u/sqrt(u**2 + {w}**2)", "1 - 2/(1 + exp(2*u/{w}))"])
def test_a_load_that_changes_its_sign_for_a_moment(law: str, width: float, way: str) -> None:
    """u = sin(t) - 0.99, and the law of its sign: the integral to 4, where u > 0 between arcsin(0.99) and its mirror.

    The smooth law differs from the sign by an odd function of u/w: the integral of that by quadrature.
    """
    if "exp" in law and width < 1e-2:
        width *= 1e3  # exp(u/w) within doubles
    model = hs.Model(
        "moment",
        [hs.State("y", 0, law.format(w=width))],
        monitors=[hs.Monitor("high", "y - 1000")] if way == "stepped" else [],
        definitions={"u": "sin(t) - 0.99"},
    )

    def smooth(t: float) -> float:
        u = math.sin(t) - 0.99
        return u / math.sqrt(u**2 + width**2) if "sqrt" in law else math.tanh(u / width)

    there = math.asin(0.99)
    expected = integral(smooth, 4, [there, math.pi - there], 10 * width)
    for rtol in (1e-5, 1e-8, 1e-11):
        sol = hs.simulate(model, (0, 4), integrator="taylor", rtol=rtol)
        assert sol.y[0, -1] == pytest.approx(expected, abs=30 * rtol)


@pytest.mark.parametrize("way", ["compiled", "stepped"])
def test_a_guard_that_falls_for_a_moment(way: str) -> None:
    """1/2 - exp(-((t - c)/w)**2) crosses zero at c - w sqrt(log(2)), which no step begins or ends beside."""
    monitor = '[monitors.high]\nexpr = "y - 1000"\n' if way == "stepped" else ""
    model = hs.Model.from_toml(
        """
schema = 1
name = "moment"
[states]
y = { start = 0, der = "cos(t)" }
z = { start = 0, der = "exp(-y)*tanh(y + 0.3)" }
[components.a]
initial = "low"
[components.a.modes.low]
guards.up = { expr = "0.5 - exp(-((t - 0.45)/0.003)**2)", then = "high" }
[components.a.modes.high]
"""
        + monitor
    )
    for rtol in (1e-4, 1e-9):
        sol = hs.simulate(model, (0, 1), integrator="taylor", rtol=rtol)
        # an error of rtol in the guard, which falls by some 280 a unit of time there
        error = pytest.approx([0.45 - 0.003 * math.sqrt(math.log(2))], abs=max(1e-12, rtol / 280.0))
        assert sol.event_times("a") == error


A, B = "((t - 0.45)/0.003)", "((t - 0.47)/0.01)"


@pytest.mark.parametrize("way", ["compiled", "stepped"])
@pytest.mark.parametrize(
    "rate",
    [
        "1e3*exp(-((t - 0.47)/0.001)**2)",
        "exp(cos(40*t)*60 - 61)",  # whose argument turns many times in a step of the rest
        "exp(-100*sin(20*t)**2)",
        f"(1 + {B}**2)**(-10.3)",  # whose argument is a logarithm
        "1e-12*exp((0.7 - 16*(t - 0.47)**2)/0.0259)",  # a diode, large where its argument is
        f"1e22*exp(-50 - {B}**2)",
        "1e22*exp(-1e4/(200 - 700*(t - 0.47)**2))",
        f"1/cosh({A})**2",
        f"1/cosh({A})**16",  # powers fade as much sooner
        f"1/cosh({B})**24",
        f"(1 - tanh({A})**2)**8",
        f"exp(-{A}**2)**8",
        f"1/(1 + sinh({B})**2)",
        f"tanh({A})**2*(1 - tanh({A})**2)",  # zero where the argument is
        f"{A}**2*exp(-{A}**2)",
        f"exp(-400*(tanh({A}) - 0.5)**2)",  # beside where the inner argument is zero
        f"exp(-100*(exp(-{A}**2) - 0.5)**2)",
        f"exp(-exp({B}**2/9))",
        "exp(-1/(t - 0.5)**2)",
        "1000*exp(-((t - 0.66)/0.001)**4)",  # about whose middle rounding is all that its argument's series shows
        "10000*exp(-((t - 0.33)/0.0001)**8)",
        "1e6/((t - 0.25)**2*1e12 + 1)**0.5 - 1/((t - 0.25)**2 + 1e-12)**0.5",
        "sin(3.3*t)**64 - cos(t) + 1",
        "(5*t*(0.9 - t))**40 - cos(t) + 1",
    ],
)
def test_pulses_of_many_kinds(rate: str, way: str) -> None:
    """y' = cos(t) + a pulse: y(0.9) by quadrature, split about the pulses."""

    def integrand(t: float) -> float:
        known = vars(math) | {"t": t}
        try:
            return float(eval(f"cos(t) + {rate}", known))  # noqa: S307  # the texts above
        except ArithmeticError:  # exp(-exp(u)), exp(-1/u**2), 1/(1 + sinh(u)**2): nothing is left there
            return math.cos(t)

    about = {0.45, 0.47, 0.5, *(k * math.pi / 20 for k in range(6))}
    expected = integral(integrand, 0.9, about, 0.005)
    monitors = [hs.Monitor("high", "y - 1000")] if way == "stepped" else []
    model = hs.Model("pulse", [hs.State("y", 0, f"cos(t) + {rate}")], monitors=monitors)
    for rtol in (1e-4, 1e-6, 1e-9, 1e-12):
        sol = hs.simulate(model, (0, 0.9), integrator="taylor", rtol=rtol)
        assert sol.y[0, -1] == pytest.approx(expected, abs=10 * rtol * max(1, expected))


def integral(f: Callable[[float], float], end: float, places: Iterable[float], width: float) -> float:
    """From 0 to an end, with narrow pieces about some places."""
    edges = {p + q * width for p in places for q in (-40, -10, -4, -1, 0, 1, 4, 10, 40)}
    pieces = sorted({0.0, end, *(edge for edge in edges if 0 < edge < end)})
    return sum(quad(f, a, b, epsabs=1e-14, epsrel=1e-12, limit=400)[0] for a, b in itertools.pairwise(pieces))


def test_a_stribeck_contact_that_comes_near_rest_under_way() -> None:
    """Two methods agree where the body comes near rest under way in one long step, and friction rises there."""
    model = hs.Model.from_toml("""
schema = 1
name = "near-rest"
[states]
x = { start = -0.3, der = "v" }
v = { start = 2.0, der = "4*sin(1.7*t) - 3*x - 0.1*v - f" }
[contacts.f]
velocity = "v + 1.2"
normal = "1"
law = { name = "stribeck", mu_s = "0.3", mu_k = "0.2", v_s = "0.1" }
""")
    for end in (4.0, 8.0):
        fine = hs.simulate(model, (0, end), integrator="dop853", rtol=1e-11)
        assert hs.simulate(model, (0, end), integrator="taylor", rtol=1e-10).y[:, -1] == pytest.approx(
            fine.y[:, -1], abs=1e-7
        )


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("end", [5.0, 10.0, 40.0, 1000.0])
def test_a_field_that_a_ball_passes_twice_early_in_a_long_step(end: float, rtol: float) -> None:
    """A fall is a polynomial, which bounds no step; energy tells whether the way down was felt as the way up."""
    w = 0.01
    rate = f"-9.81 + 2*exp(-((x - 1)/{w})**2)"
    sol = hs.simulate(
        hs.Model("ball", [hs.State("x", 0, "v"), hs.State("v", 5.2, rate)]),
        (0, end),
        integrator="taylor",
        rtol=rtol,
    )
    x, v = sol.y[:, -1]
    # the field's potential from far below to far above; the ball ends far below again
    gained = v * v / 2 + 9.81 * x - w * math.sqrt(math.pi) * (math.erf((x - 1) / w) - math.erf(-1 / w))
    assert gained == pytest.approx(5.2**2 / 2, abs=200.0 * rtol + 1e-13 * v * v)


@pytest.mark.parametrize("end", [10.0, 40.0, 1000.0])
def test_a_guard_that_is_met_four_times_early_in_a_long_step(end: float) -> None:
    model = hs.Model(
        "ball",
        [hs.State("x", 0, "v"), hs.State("v", 5.2, "-9.81")],
        monitors=[hs.Monitor("g", "exp(-((x - 1)/0.01)**2) - 0.5")],
    )
    heights = [1.0 + sign * 0.01 * math.sqrt(math.log(2.0)) for sign in (-1, 1)]
    falls = [math.sqrt(5.2**2 - 2 * 9.81 * height) for height in heights]
    wanted = sorted((5.2 + sign * fall) / 9.81 for fall in falls for sign in (-1, 1))
    found = hs.simulate(model, (0, end), integrator="taylor").event_times("g")
    assert found.tolist() == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize(
    ("u", "slopes"), [("(t - 4)**3 - (t - 4)", (1.0, 2.0, 2.0)), ("(t - 4)**2 - 1", (2.0, 2.0))]
)
def test_a_pulse_at_each_of_several_zeros(u: str, slopes: tuple[float, ...], rtol: float) -> None:
    """exp(-(u/w)**2): of each simple zero w sqrt(pi)/|u'| and a little, which goes with w**3."""
    w = 0.002
    sol = hs.simulate(
        hs.Model("one", [hs.State("x", 0, f"exp(-({u})**2/{w}**2)")]), (0, 20), integrator="taylor", rtol=rtol
    )
    assert sol.y[0, -1] == pytest.approx(sum(w * math.sqrt(math.pi) / s for s in slopes), rel=2e-5)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("power", [8, 24])
def test_a_power_in_a_guard_and_of_a_state(power: int, rtol: float) -> None:
    """1/cosh((x - c)/w)**n - 1/2 has its zeros at c - w acosh(2**(1/n)) and beyond; x' = 1."""
    centre, width = 5.3, 0.01
    guard = f"1/cosh((x - {centre})/{width})**{power} - 0.5"
    modes = [
        hs.Mode("low", guards=[hs.Guard("up", f"-({guard})", "high")]),
        hs.Mode("high", guards=[hs.Guard("down", guard, "low")]),
    ]
    model = hs.Model("pair", [hs.State("x", 0, "1")], components=[hs.Component("c", modes, initial="low")])
    half = width * math.acosh(2.0 ** (1.0 / power))
    sol = hs.simulate(model, (0, 10), integrator="taylor", rtol=rtol)
    assert sol.event_times("c") == pytest.approx([centre - half, centre + half], abs=10 * rtol)
    # v' = 1 + 3/cosh(v/w)**n from v = -1: v = 1 after the integral of dv/v'
    rate = hs.Model("slow", [hs.State("v", -1, f"1 + 3/cosh(v/{width})**{power}")])
    needed = integral(lambda v: 1 / (1 + 3 / math.cosh(min(abs(v) / width, 20)) ** power), 1, [0], width)
    sol = hs.simulate(rate, (0, 2 * needed), integrator="taylor", rtol=rtol)
    assert sol.y[0, -1] == pytest.approx(1.0, abs=100 * rtol)
