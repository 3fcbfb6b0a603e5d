"""What the multiple-precision run does at events, with inputs and functions, and what it refuses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import SimulationError, UsageError
from hybridsim.reference.multiple_precision import multiple_precision_trajectory
from hybridsim.reference.multiple_precision.functions import Functions
from hybridsim.reference.multiple_precision.nodes import ExternalSeries, in_order
from hybridsim.reference.trajectory import Trajectory

MP = mpmath.mp.clone()
MP.dps = 60
RISING = '[states]\nx = { start = 0, der = "1" }\n'


def run(text: str, end: float, **options: Any) -> Trajectory:
    model = hs.Model.from_toml(f'schema = 1\nname = "scene"\n{text}')
    return multiple_precision_trajectory(model, (0, end), **options)


def seen(trajectory: Trajectory) -> list[tuple[str, float]]:
    return [(event.component, event.t) for event in trajectory.events]


@pytest.mark.parametrize(
    "name",
    ["sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt"],
)
def test_functions_have_the_series_that_differentiation_gives(name: str) -> None:
    inner = [MP.mpf(c) for c in ("0.3", "0.5", "-0.2", "0.1", "0.07", "-0.3", "0.02")]
    u = ExternalSeries(MP)
    u.c = list(inner)
    node = Functions(MP).build(name, u)
    for part in in_order([node]):
        if part.constant:
            part.extend(0)
    for n in range(len(inner)):
        for part in in_order([node]):
            if not part.constant:
                part.extend(n)
    outer = mpmath.mp.clone()
    outer.dps = 120  # numerical differentiation loses half of them
    function = getattr(outer, name)
    polynomial = [outer.mpf(c) for c in reversed(inner)]
    expected = outer.taylor(lambda t: function(outer.polyval(polynomial, t)), 0, len(inner) - 1)
    for ours, theirs in zip(node.c, expected, strict=True):
        assert abs(ours - theirs) < 1e-40


@pytest.mark.parametrize(
    ("rate", "solution"),
    [
        ("x**3", lambda t: 1 / MP.sqrt(1 - 2 * t)),
        ("-x**2.5", lambda t: (1 + 3 * t / 2) ** (-MP.mpf(2) / 3)),
        ("1/x", lambda t: MP.sqrt(1 + 2 * t)),
        ("x**-2", lambda t: MP.cbrt(1 + 3 * t)),
        ("2*t*x", lambda t: MP.exp(t**2)),
        ("x*cos(t)", lambda t: MP.exp(MP.sin(t))),
        ("x**p*sqrt(x)", lambda t: 1 / MP.sqrt(1 - 2 * t)),
        ("x**((t + 1)/(1 + t) + 2)", lambda t: 1 / MP.sqrt(1 - 2 * t)),
    ],
)
def test_separable_equations(rate: str, solution: Callable[[Any], Any]) -> None:
    """x' = rate from x = 1, against the solution by hand."""
    end = 0.25
    trajectory = run(f'[parameters]\np = 2.5\n[states]\nx = {{ start = 1, der = "{rate}" }}\n', end)
    assert abs(trajectory.states.state(end)[0] - solution(MP.mpf(end))) < 1e-30


def test_monitors_fire_where_they_change_their_side() -> None:
    """A zero at t0, a touch and the wrong direction do not fire; a pair within one step does."""
    text = """
        [monitors.from-zero]
        expr = "x"
        [monitors.touch]
        expr = "(x - 1)**2"
        [monitors.cube]
        expr = "(x - 1.5)**3"
        [monitors.pair]
        expr = "(x - 2)*(x - 2.0000001)"
        [monitors.up]
        expr = "(x - 1)*(x - 2)"
        direction = "up"
        [monitors.down]
        expr = "(x - 1)*(x - 2)"
        direction = "down"
    """
    found = seen(run(RISING + text, 3.0))
    assert [name for name, _ in found] == ["down", "cube", "pair", "up", "pair"]
    assert [t for _, t in found] == pytest.approx([1, 1.5, 2, 2, 2.0000001], abs=1e-12)


def test_a_monitor_ends_the_run_and_another_resets_it() -> None:
    text = """
        [monitors.back]
        expr = "x - 1"
        action = "reset"
        reset = { x = "x - 2" }
        [monitors.end]
        expr = "t - 5"
        action = "terminate"
    """
    trajectory = run(RISING + text, 9.0)
    assert seen(trajectory) == [("back", 1.0), ("back", 3.0), ("back", 5.0), ("end", 5.0)]
    assert trajectory.t_span == (0, 5.0)
    assert trajectory.states(np.array([1.0, 1.0, 2.0]), "+")[0].tolist() == [-1.0, -1.0, 0.0]
    assert trajectory.states(np.array([1.0]), "-")[0].tolist() == [1.0]


def test_choices_are_taken_in_order_and_resets_see_the_state_before() -> None:
    text = """
        [states]
        x = { start = 0, der = "1" }
        n = { start = 0, der = "0" }
        [modes.up]
        initial = true
        guards.top = { expr = "1 - x", then = [
          { when = "n < 2", to = "up", reset = { x = "n/4", n = "n + x" } }, { to = "off" } ] }
        [modes.off]
    """
    trajectory = run(text, 5.0)
    assert [(event.t, event.target) for event in trajectory.events] == [(1, "up"), (2, "up"), (2.75, "off")]


def test_a_clock_ticks_at_its_start_and_at_its_multiples() -> None:
    """0.1*k in doubles and the declared 0.3 are one instant."""
    text = """
        [states]
        x = { start = 0, der = "u" }
        [discrete]
        u = 0
        [clocks.tick]
        period = 0.1
        set = { u = "u + 1" }
        [schedules.halt]
        times = 0.3
        reset = { x = "0" }
    """
    trajectory = run(text, 0.5)
    assert [t for name, t in seen(trajectory) if name == "tick"] == pytest.approx(
        [0, 0.1, 0.2, 0.3, 0.4, 0.5], abs=1e-15
    )
    assert float(trajectory.states.state(0.5)[0]) == pytest.approx(0.4 + 0.5, abs=1e-14)


@pytest.mark.parametrize(
    ("declared", "integral"),
    [
        (
            'kind = "wave"\nshape = "square"\nperiod = 0.5\namplitude = 2\nduty = 0.25',
            2 * 4 * (0.125 - 0.375),
        ),
        ('kind = "wave"\nshape = "sawtooth"\nperiod = 0.5\noffset = 1', 2.25 - 0.125),
        ('kind = "wave"\nshape = "triangle"\nperiod = 1', 0.25 / 2),
        ('kind = "table"\ntimes = [0, 1, 1, 2]\nvalues = [0, 2, 5, 5]', 1 + 6.25),
    ],
)
def test_inputs_have_the_integrals_of_their_shapes(declared: str, integral: float) -> None:
    text = f'[inputs.u]\n{declared}\n[states]\nx = {{ start = 0, der = "u" }}\n'
    assert float(run(text, 2.25).states.state(2.25)[0]) == pytest.approx(integral, abs=1e-14)


def test_a_natural_spline_is_the_one_of_scipy() -> None:
    from scipy.interpolate import CubicSpline

    times, values = [0.0, 0.5, 1.25, 2.0, 3.5], [0.0, 1.0, -0.5, 0.25, 2.0]
    text = f"""
        [inputs.u]
        kind = "table"
        times = {times}
        values = {values}
        interpolation = "cubic"
        [states]
        x = {{ start = 0, der = "u" }}
    """
    trajectory = run(text, 4.0)
    spline = CubicSpline(times, values, bc_type="natural")
    for t in (0.3, 1.0, 2.0, 3.5):
        assert float(trajectory.states.state(t)[0]) == pytest.approx(spline.integrate(0, t), abs=1e-14)
    assert float(trajectory.states.state(4.0)[0]) == pytest.approx(spline.integrate(0, 3.5) + 1.0, abs=1e-14)


def test_a_chirp_and_a_sine_have_their_angles() -> None:
    text = """
        [inputs.c]
        kind = "chirp"
        f0 = 0.5
        f1 = 2
        duration = 2
        amplitude = 3
        phase = 0.25
        [inputs.s]
        kind = "wave"
        shape = "sine"
        period = 0.75
        amplitude = 2
        phase = 0.125
        offset = 1
        [states]
        x = { start = 0, der = "c" }
        y = { start = 0, der = "s" }
    """
    x, y = run(text, 3.0).states.state(3)

    def chirp(t: Any) -> Any:
        turns = t / 2 + 3 * t**2 / 8 if t < 2 else MP.mpf(5) / 2 + 2 * (t - 2)
        return 3 * MP.sin(MP.mpf(1) / 4 + 2 * MP.pi * turns)

    assert abs(x - MP.quad(chirp, [0, 0.5, 1, 1.5, 2, 2.5, 3])) < 1e-30
    angle = [2 * MP.pi * (t - MP.mpf(1) / 8) / MP.mpf("0.75") for t in (0, 3)]
    assert abs(y - (3 + 2 * MP.mpf("0.75") / (2 * MP.pi) * (MP.cos(angle[0]) - MP.cos(angle[1])))) < 1e-30


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            '[states]\nx = { start = 0, der = "1 if x < 1 else 2" }\n',
            r"rates of model \w+ jump \(sign\(x - 1\)\)",
        ),
        ('[states]\nx = { start = 0, der = "1 if x < 1 and t > 0 else 2" }\n', r"rates of model \w+ jump"),
        ('[states]\nx = { start = 0, der = "1 if x == 1 else 2" }\n', "is not smooth"),
        ('[states]\nx = { start = 0, der = "1 + x**0.5" }\n', r"power 0\.5"),
        (
            '[states]\nx = { start = 1, der = "r" }\n[modes.a]\ninitial = true\nset = { r = "-1" }\n'
            'guards.g = { expr = "x", then = "b" }\n[modes.b]\nset = { r = "1" }\n'
            'guards.g = { expr = "-x", then = "a" }\n',
            "sliding|surface of a general automaton",
        ),
        (
            '[states]\nh = { start = 1, der = "w" }\nw = { start = 0, der = "-1" }\n[modes.fly]\ninitial = true\n'
            'guards.g = { expr = "h", then = { to = "fly", reset = { h = "0", w = "-0.5*w" } } }\n',
            "accumulate",
        ),
    ],
)
def test_what_is_not_supported_is_refused_by_name(text: str, reason: str) -> None:
    with pytest.raises(UsageError, match=reason):
        run(text, 9.0)


def test_a_load_that_vanishes_ends_the_run() -> None:
    text = (
        '[states]\nv = { start = 0, der = "2 - f" }\n[contacts.f]\nvelocity = "v"\nnormal = "1 - t"\n'
        'law = { name = "coulomb", mu = 1 }\n'
    )
    with pytest.raises(SimulationError, match="normal load of contact f"):
        run(text, 3.0)


@pytest.mark.parametrize(("end", "digits"), [(0.0, 32), (-1.0, 32), (1.0, 5)])
def test_spans_and_digits_are_checked(end: float, digits: int) -> None:
    with pytest.raises(UsageError, match=r"t_span|digits"):
        run(RISING, end, digits=digits)


def test_progress_rises_to_one() -> None:
    fractions: list[float] = []
    run('[states]\nx = { start = 1, der = "-x*sin(9*t)" }\n', 2.0, progress=fractions.append)
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


def test_a_release_leaves_the_other_contact_as_it_is() -> None:
    """Block 1 on the ground, block 2 on block 1, pushed by t/2: the ground gives way at t = 2 and carries 1 from then.

    Block 2 weighs as much as block 1 and needs (t/2 - 1)/2 of the contact between them, which holds up to 0.6; that it
    could also drop to its 0.4 in motion is no reason to.
    """
    text = """
        [states]
        v1 = { start = 0, der = "t/2 - f - g" }
        v2 = { start = 0, der = "g" }
        [contacts.f]
        velocity = "v1"
        normal = "1"
        law = { name = "coulomb", mu = 1 }
        [contacts.g]
        velocity = "v1 - v2"
        normal = "1"
        law = { name = "static-kinetic", mu_s = 0.6, mu_k = 0.4 }
    """
    trajectory = run(text, 5.0)
    changes = [(event.component, event.source, event.target) for event in trajectory.events]
    assert changes == [("f", "stick", "slip+"), ("g", "stick", "slip+")]
    assert [event.t for event in trajectory.events] == pytest.approx([2.0, 4.4], abs=1e-15)


def test_at_the_start_a_clock_comes_before_a_guard() -> None:
    """x is zero and falls: the guard fires at once, after the tick has set d."""
    text = """
        [states]
        x = { start = 0, der = "-1" }
        [discrete]
        d = 1
        [clocks.c]
        period = 9
        set = { d = "10*d" }
        [modes.a]
        initial = true
        guards.g = { expr = "x", then = { to = "b", reset = { d = "d + 1", x = "d" } } }
        [modes.b]
    """
    trajectory = run(text, 1.0)
    assert trajectory.initial_modes == {"mode": "b"}
    assert trajectory.states(np.array([0.0]), "+")[0, 0] == 10.0
