"""Motions that only look as if they repeated, events that look like one: each was once taken for what it is not."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import HybridsimError, UsageError


def model(states: str, parameters: str = "", rest: str = "") -> hs.Model:
    return hs.Model.from_toml(
        f'schema = 1\nname = "trap"\n[parameters]\n{parameters}\n[states]\n{states}\n{rest}\n'
    )


OSCILLATOR = 'x = {{ start = {x0}, der = "v" }}\nv = {{ start = 0, der = "{der}" }}'
SHAKEN = """[contacts.f]
velocity = "v - 0.13*t"
normal = "9.81"
law = { name = "coulomb", mu = "mu" }"""


def by_differences(changed: object, run: object, value: float, h: float = 1e-5) -> np.ndarray:
    ends = [run(changed(value + k * h)).y[:, -1] for k in (2, 1, -1, -2)]
    return (8.0 * (ends[1] - ends[2]) - (ends[0] - ends[3])) / (12.0 * h)


def test_a_held_state_moves_with_its_base() -> None:
    """At the breakaway from an accelerating base the rate just before is that of the base, not zero."""
    declared = model(OSCILLATOR.format(x0=0, der="-k*x - f"), "k = 4\nmu = 0.3", SHAKEN)

    def run(changed: hs.Model) -> hs.Solution:
        return hs.simulate(changed, (0.0, 4.0), rtol=1e-12)

    found = hs.sensitivities(run(declared), ["mu"]).by_parameter[:, 0]
    assert found == pytest.approx(by_differences(lambda mu: declared.with_(mu=mu), run, 0.3), rel=1e-7)


def test_a_tick_that_ends_a_segment_but_for_the_last_bit() -> None:
    clock = (
        '[discrete]\nu = { start = "3*p" }\n[clocks.s]\nperiod = "T"\noffset = 0.15\nset.u = "x/2 + p*u*T"'
    )
    declared = model('x = { start = "p", der = "u - x" }', "p = 2\nT = 0.3", clock)

    def run(changed: hs.Model) -> hs.Solution:
        return hs.simulate(changed, (0.0, 1.0), rtol=1e-12)

    found = hs.sensitivities(run(declared), ["p", "T"])
    assert found.times == pytest.approx([0.15, 0.45, 0.75])
    for j, (name, value) in enumerate((("p", 2.0), ("T", 0.3))):
        expected = by_differences(lambda v, name=name: declared.with_(**{name: v}), run, value)
        assert found.by_parameter[0, j] == pytest.approx(expected[0], rel=1e-7)


def test_what_happens_at_the_start() -> None:
    """x is tripled at once, then decays: d(end)/d(start) = d(end)/dp = 3/e."""
    declared = model(
        'x = { start = "p", der = "-x" }', "p = 2", '[schedules.s]\ntimes = [0]\nreset.x = "3*x"'
    )
    found = hs.sensitivities(hs.simulate(declared, (0.0, 1.0)), ["p"])
    assert found.by_start[0, 0] == pytest.approx(3.0 / math.e, rel=1e-12)
    assert found.by_parameter[0, 0] == pytest.approx(3.0 / math.e, rel=1e-12)


def test_two_events_that_part_have_no_derivative() -> None:
    rest = """[schedules.s]
times = ["a"]
reset.y = "y + 2"
[monitors.k]
expr = "x - c/3"
direction = "up"
action = "reset"
reset.x = "x + 1\""""
    declared = model('x = { start = 0, der = "1" }\ny = { start = 0, der = "x" }', "a = 1\nc = 3", rest)
    with pytest.raises(UsageError, match="separate after a small change"):
        hs.sensitivities(hs.simulate(declared, (0.0, 1.5)), ["a"])


@pytest.mark.parametrize(
    ("states", "rest", "said"),
    [
        (
            'x = { start = 0, der = "-x + exp(-0.01*t)*sin(t)" }',
            "",
            "state x, der contains t outside of sines",
        ),
        ('x = { start = 0, der = "-x + 0.1*t" }', "", "state x, der contains t outside of sines"),
        (
            'x = { start = 0, der = "-x + sin(t)" }',
            '[schedules.s]\ntimes = [1.0]\nreset.x = "x + 1"',
            "ends, but a steady state needs schedules without an end",
        ),
    ],
)
def test_what_ends_or_grows_is_refused(states: str, rest: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        hs.steady_state(model(states, "", rest))


@pytest.mark.parametrize("ramp", ["0.01*t", "min(t/2, 1)*t", "exp(-t)"])
def test_a_ramp_does_not_repeat_with_a_period_that_is_passed(ramp: str) -> None:
    """The search sets the time back after each period, and would find a periodic motion that does not exist."""
    oscillator = model(
        f'x = {{ start = 0, der = "v" }}\nv = {{ start = 0, der = "sin(t) - v - x + {ramp}" }}'
    )
    with pytest.raises(UsageError, match=r"state v, der does not repeat after the period 6\.28319"):
        hs.steady_state(oscillator, period=2.0 * math.pi)
    defined = model('x = { start = 0, der = "push - x" }', "", f"[definitions]\npush = '{ramp}'")
    with pytest.raises(UsageError, match="definition push does not repeat"):
        hs.steady_state(defined, period=2.0 * math.pi)


def test_a_phase_that_only_a_sine_reads_repeats() -> None:
    """x' = -x + cos(2 t + 1) for t > 0, in a form in which the sine is not known to be periodic."""
    driven = model(
        'x = { start = 0, der = "-x + cos(sqrt((phase + 1)**2))" }', "", '[definitions]\nphase = "2*t"'
    )
    assert hs.steady_state(driven, period=math.pi).amplitude["x"] == pytest.approx(5.0**-0.5, rel=1e-9)
    with pytest.raises(UsageError, match="definition phase does not repeat after the period 1:"):
        hs.steady_state(driven, period=1.0)


def test_a_discrete_state_that_stores_a_time_is_refused() -> None:
    """The kicks at 1 + k pi have the mean 0.01/pi, but t is set back, and no kick follows the stored time."""
    kicks = """[discrete]
next = 1.0
[components.g.modes.a]
initial = true
guards.e = { expr = "next - t", then = { to = "a", reset = { x = "x + 0.01", next = "next + pi" } } }"""
    kicked = model('x = { start = 0, der = "-x + sin(2*t)" }', "", kicks)
    with pytest.raises(UsageError, match="guard e of g depends on t and on the discrete state next"):
        hs.steady_state(kicked, period=math.pi)


@pytest.mark.parametrize("force", ["sin(t**2)", "cos(0.3*t*t)", "sin(exp(t))"])
def test_a_sine_of_a_time_that_is_not_linear_does_not_repeat(force: str) -> None:
    chirp = hs.Model("chirp", states=[hs.State("x", 0, f"{force} - x", nominal=1)])
    with pytest.raises(UsageError, match="state x, der does not repeat after the period 1:"):
        hs.steady_state(chirp, period=1.0)


def test_a_sine_of_linear_time_is_periodic_in_any_form() -> None:
    """x' = -x + sin(2 pi t + 1) has the amplitude 1/sqrt(1 + 4 pi^2)."""
    driven = hs.Model("driven", states=[hs.State("x", 0, "sin(-(2*pi*(-t - 1/(2*pi)))) - x", nominal=1)])
    found = hs.steady_state(driven, period=1.0)
    assert found.amplitude["x"] == pytest.approx((1.0 + 4.0 * math.pi**2) ** -0.5, rel=1e-9)


def test_a_period_that_is_not_the_forcings_is_refused() -> None:
    with pytest.raises(UsageError, match=r"0\.0148"):
        hs.steady_state("dfcs", period=0.01)


@pytest.mark.parametrize("w0", [1.0 / 2.0, 1.0 / 3.0])
def test_one_period_is_not_two_or_three(w0: float) -> None:
    """The transient turns by a half or a third a period: it looks nearer after two or three."""
    found = hs.steady_state(
        model(OSCILLATOR.format(x0=0, der="-2*z*w0*v - w0**2*x + sin(t)"), f"z = 0.002\nw0 = {w0!r}")
    )
    assert found.multiple == 1
    exact = 1.0 / math.hypot(w0 * w0 - 1.0, 2.0 * 0.002 * w0)
    assert found.amplitude["x"] == pytest.approx(exact, rel=1e-10)


def test_a_long_transient_is_no_scale() -> None:
    found = hs.steady_state(model(OSCILLATOR.format(x0="1e8", der="-0.2*v - x + sin(2*t)")))
    assert found.amplitude["x"] == pytest.approx(1.0 / math.hypot(3.0, 0.4), rel=1e-10)


def test_periods_with_a_common_multiple() -> None:
    found = hs.steady_state(model('x = { start = 0, der = "-x + sin(2*t) + sin(3*t)" }'))
    assert found.period == pytest.approx(2.0 * math.pi, rel=1e-14)


@pytest.mark.parametrize("der", ["sin(t)", "-x + sin(t)"])
def test_growth_is_not_chaos(der: str) -> None:
    found = hs.steady_state(model(OSCILLATOR.format(x0=0, der=der)), max_periods=128)
    assert found.kind == "not settled"


def test_a_slow_drift_is_not_periodic() -> None:
    declared = model('x = { start = 1e6, der = "1e-7 + v" }\nv = { start = 0, der = "-v + sin(t)" }')
    assert hs.steady_state(declared, max_periods=128).kind == "not settled"


def test_a_clock_needs_no_parameters() -> None:
    clock = '[discrete]\nu = { start = 0 }\n[clocks.c]\nperiod = 1\nset.u = "-0.5*x"'
    found = hs.steady_state(model('x = { start = 1, der = "-x + u" }', "", clock))
    assert found.success


def test_a_limit_cycle_is_followed_both_ways() -> None:
    branch = hs.continuation(
        model(OSCILLATOR.format(x0=2, der="a*(1 - x**2)*v - x"), "a = 1"), "a", (0.5, 1.5)
    )
    assert (branch.parameter.min(), branch.parameter.max()) == (0.5, 1.5)
    assert branch.special == ()
    assert (np.diff(branch.parameter) > 0.0).all()


def test_rest_between_ticks_is_no_equilibrium() -> None:
    clock = '[discrete]\nu = { start = 1 }\n[clocks.c]\nperiod = 1\nset.u = "-x"'
    with pytest.raises(UsageError, match="there is no equilibrium"):
        hs.equilibria(model('x = { start = 1, der = "u - x" }', "", clock))


@pytest.mark.parametrize(
    "pull", ["-2500*(x - 0.0045) - 0.5*v", "-2500*x - 0.5*v", "-2500*(x - 0.0045) - 0.5*v - 0.1*v**3"]
)
def test_a_motion_that_dies_out_rests(pull: str) -> None:
    """What is left of it is rounding, which goes round about the point of rest and may repeat."""
    model = hs.Model(
        "decay", states=[hs.State("x", 0.1, "v", nominal=1e-2), hs.State("v", 0, pull, nominal=0.3)]
    )
    found = hs.steady_state(model)
    assert found.kind == "equilibrium"
    assert found.mean["x"] == pytest.approx(0.0 if "*x" in pull else 0.0045, rel=1e-12, abs=1e-12)
    assert found.amplitude["x"] < 1e-12


def test_a_small_cycle_is_not_taken_for_rest_because_its_start_was_far_away() -> None:
    """r' = r (1 - r**2) comes from far away, by both states, to a circle of radius 1, with a period of 2 pi."""
    states = [hs.State("x", 1e10, "x - y - x*(x**2 + y**2)"), hs.State("y", 1e10, "x + y - y*(x**2 + y**2)")]
    found = hs.steady_state(hs.Model("circle", states=states))
    assert found.kind == "periodic"
    assert (found.period, found.amplitude["x"]) == pytest.approx((2.0 * math.pi, 1.0), rel=1e-10)


@pytest.mark.parametrize("mu", [0.5, 0.76])
def test_below_the_onset_of_mode_coupling_all_comes_to_rest(mu: float) -> None:
    """Sliding on; just below the onset, at 0.765, the decay takes hundreds of periods."""
    found = hs.steady_state("mode-coupling", params={"mu": mu})
    rest = hs.linearize("mode-coupling", "slip-", params={"mu": mu})
    assert found.kind == "equilibrium" and rest.is_equilibrium
    assert [found.mean[name] for name in ("x", "u", "y", "w")] == pytest.approx(rest.x.tolist(), abs=1e-12)


def test_a_mapping_of_measures_is_a_mapping() -> None:
    found = hs.steady_state("dfcs")
    assert "q" not in found.amplitude
    assert found.amplitude.get("q", 0.0) == 0.0
    for wrong in ("a", 1.5, -1):
        with pytest.raises(HybridsimError):
            found.harmonic("x", wrong)


FORCED_TWICE = "0.2*sin(t) + 0.2*sin(sqrt(2)*t)"
TWO_CLOCKS = """[discrete]
u = { start = 0 }
w = { start = 0 }
[clocks.c]
period = 1
set.u = "-0.5*x"
[clocks.d]
period = "sqrt(2)"
set.w = "1 - 0.2*x\""""
HELD = '[contacts.f]\nvelocity = "v"\nnormal = "1"\nlaw = { name = "coulomb", mu = 0.5 }'


@pytest.mark.parametrize(
    ("states", "rest", "kind", "said"),
    [
        (
            f'x = {{ start = 1, der = "-x + {FORCED_TWICE}" }}',
            "",
            "quasi-periodic",
            "an initial change is",
        ),
        (
            'x = { start = 1, der = "-x + u + w" }',
            TWO_CLOCKS,
            "quasi-periodic",
            "forcing and clocks have no common",
        ),
        # the undamped vibration of the start stays: there is a third frequency
        (
            OSCILLATOR.format(x0=1, der="-9*x + " + FORCED_TWICE),
            "",
            "not settled",
            "an initial change is 1",
        ),
        (OSCILLATOR.format(x0=0, der=f"-x - f + {FORCED_TWICE}"), HELD, "equilibrium", "nothing moves"),
    ],
)
def test_forcing_without_a_common_period_is_followed(states: str, rest: str, kind: str, said: str) -> None:
    found = hs.steady_state(model(states, "", rest), max_periods=64)
    assert found.kind == kind and said in found.message


def test_a_quantity_that_is_rounding_alone_takes_no_pieces_for_ever() -> None:
    """A balance of energy is zero to rounding: no piece of it is ever smooth, however short."""
    forced = 'x = {start = 0, der = "v"}\nv = {start = 0, der = "-x - 0.1*v + cos(2*t)"}'
    balance = 'w = {start = 0, der = "v*(-x - 0.1*v + cos(2*t))"}'
    outputs = '[outputs]\nbalance = "v**2/2 - w"\none = "sin(x)**2 + cos(x)**2 - 1"\nfast = "sin(300*x)"'
    found = hs.steady_state(model(f"{forced}\n{balance}", "", outputs))
    assert len(found._orbit.starts) < 5000
    assert found.amplitude["balance"] < 1e-12
    assert found.amplitude["one"] <= 2.0**-52
    assert found.amplitude["fast"] == pytest.approx(1.0, abs=1e-12)
    # (-4 + 1 + 0.2 i) X = -F: speed 2 |X|
    assert found.amplitude["v"] == pytest.approx(2.0 / abs(-3.0 + 0.2j), rel=1e-10)


def test_a_quantity_that_jumps_is_never_beyond_its_values() -> None:
    forced = 'x = {start = 0, der = "v"}\nv = {start = 0, der = "-x - 0.1*v + cos(2*t)"}'
    found = hs.steady_state(
        model(forced, "", '[outputs]\nside = "sign(x)"\nstair = "sign(v - 0.1) + 2*sign(v + 0.2)"')
    )
    assert (found.minimum["side"], found.maximum["side"]) == pytest.approx((-1.0, 1.0), abs=1e-12)
    assert (found.minimum["stair"], found.maximum["stair"]) == pytest.approx((-3.0, 3.0), abs=1e-12)


def test_a_state_that_only_adds_up_is_named() -> None:
    forced = 'x = {start = 0, der = "v"}\nv = {start = 0, der = "-x - 0.1*v + cos(2*t)"}'
    found = hs.steady_state(model(f'{forced}\nspent = {{start = 0, der = "0.1*v**2"}}'), max_periods=256)
    assert found.kind == "not settled"
    assert "spent never returns" in found.message


# -- a state that only adds up ------------------------------------------------------------------------------------


def servo(functions: bool, with_angle: bool) -> hs.Model:
    """A motor switched on and off by its speed, which goes to and fro between two limits; the angle only adds up."""
    # functions are called from Python, some two thousand times a second: slower by ten, with as many fewer events
    parameters = {"U": 300.0, "tau": 0.5 if functions else 0.05, "low": 175.0, "high": 185.0}
    if not functions:
        states = [hs.State("phi", 0, "w")] if with_angle else []
        on = hs.Mode("on", hs.Guard("fast", "high - w", "off"), set={"u": "U"})
        off = hs.Mode("off", hs.Guard("slow", "w - low", "on"), set={"u": 0})
        states += [hs.State("w", 0, "(u - w)/tau")]
        return hs.Model("servo", states, parameters, components=[hs.Component("relay", [on, off], "on")])

    def driven(t: float, x: np.ndarray, p: Any) -> Any:
        return x[1], (p.U - x[1]) / p.tau

    def free(t: float, x: np.ndarray, p: Any) -> Any:
        return x[1], -x[1] / p.tau

    on = hs.Mode("on", hs.Guard("fast", lambda t, x, p: p.high - x[1], "off"), flow=driven)
    off = hs.Mode("off", hs.Guard("slow", lambda t, x, p: x[1] - p.low, "on"), flow=free)
    states = {"phi": 0.0, "w": 0.0}
    relay = hs.Component("relay", [on, off], "on")
    return hs.Model("servo", states, parameters, flow=driven, components=[relay])


def test_an_angle_that_only_adds_up_is_named_soon() -> None:
    """The speed repeats after tau log(high/low) + tau log((U - low)/(U - high)), and the angle never does."""
    closed = 0.05 * (math.log(185.0 / 175.0) + math.log(125.0 / 115.0))
    assert hs.steady_state(servo(False, False)).period == pytest.approx(closed, rel=1e-10)
    for functions in (False, True):
        found = hs.steady_state(servo(functions, True), max_periods=64)
        assert found.kind == "not settled" and "phi never returns" in found.message
        assert ("Python functions" in found.message) == functions
        assert math.isnan(found.lyapunov) == functions
