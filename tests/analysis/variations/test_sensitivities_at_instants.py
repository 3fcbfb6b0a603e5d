"""Derivatives through several things at one instant: ticks and jumps, and what they set off. All are closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import UsageError

INTEGRATORS = ["taylor", "dop853", "tsit5", "rodas5p"]


def model(states: str, rest: str = "", parameters: str = "") -> hs.Model:
    return hs.Model.from_toml(
        f'schema = 1\nname = "instants"\n[parameters]\n{parameters}\n[states]\n{states}\n{rest}\n'
    )


def ran(declared: hs.Model, end: float, integrator: str = "taylor") -> hs.Solution:
    return hs.simulate(declared, (0.0, end), integrator=integrator, rtol=1e-11)


RUBBING = '[contacts.f]\nvelocity = "v"\nnormal = {normal}\nlaw = {{ name = "coulomb", mu = "mu" }}\n'
JUMP = '[inputs.u]\nkind = "table"\ntimes = [0, {at}, {at}, 9]\nvalues = [{before}, {before}, {after}, {after}]\n'


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_push_that_jumps_sets_a_block_free(integrator: str) -> None:
    """From t = 1 on v' = (3 - 10 mu)/m: at 1.8 v = 0.8 v' and x = 0.32 v'."""
    states = 'x = { start = 0, der = "v" }\nv = { start = 0, der = "(u - f)/m" }'
    rest = JUMP.format(at=1, before=1, after=3) + RUBBING.format(normal=10)
    found = hs.sensitivities(ran(model(states, rest, "m = 1\nmu = 0.2"), 1.8, integrator), ["mu", "m"])
    assert found.by_parameter == pytest.approx(np.array([[-3.2, -0.32], [-8.0, -0.8]]), rel=1e-9)
    assert found.times.tolist() == [1.0]
    assert not found.times_by_parameter.any() and not found.times_by_start.any()


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_schedule_kicks_a_stuck_block(integrator: str) -> None:
    """It slides 1/(2 mu g) and stops after 1/(mu g)."""
    states = 'x = { start = 0, der = "v" }\nv = { start = 0, der = "-f" }'
    rest = '[schedules.k]\ntimes = [0.5]\nreset.v = "v + 1"\n' + RUBBING.format(normal=9.81)
    found = hs.sensitivities(ran(model(states, rest, "mu = 0.3"), 2.0, integrator), ["mu"])
    slope = -1.0 / (0.3**2 * 9.81)
    assert found.by_parameter[:, 0] == pytest.approx([0.5 * slope, 0.0], rel=1e-9, abs=1e-12)
    assert found.times_by_parameter[:, 0] == pytest.approx([0.0, slope], rel=1e-9)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_tick_and_the_transition_that_it_sets_off(integrator: str) -> None:
    """x(1) = (x0 exp(-T) + p q) exp(T - 1): the transition happens at the tick T, and so moves with T alone."""
    rest = """[discrete]
u = { start = 0 }
[clocks.c]
period = "T"
offset = "T"
set.u = "p"
[components.b]
initial = "low"
modes.low.guards.up = { expr = "1 - u", then = [{ to = "high", reset = { x = "x + u*q" } }] }
modes.high.guards.never = { expr = "9 - x", then = "low" }
"""
    p, q, T = 2.5, 0.7, 0.625
    declared = model('x = { start = 1, der = "-x" }', rest, f"p = {p}\nq = {q}\nT = {T}")
    found = hs.sensitivities(ran(declared, 1.0, integrator), ["p", "q", "T"])
    after = math.exp(T - 1.0)
    assert found.by_parameter[0] == pytest.approx([q * after, p * after, p * q * after], rel=1e-9)
    assert found.by_start[0, 0] == pytest.approx(math.exp(-1.0), rel=1e-9)
    assert found.times_by_parameter[0] == pytest.approx([0.0, 0.0, 1.0])
    assert found.times_by_start[0] == pytest.approx([0.0, 0.0])


def test_a_transition_at_an_inputs_jump_reads_the_input_behind_it() -> None:
    """x(1) = p u(1/2+) x0/e; before the jump u is 0, and nothing would be left."""
    rest = (
        JUMP.format(at=0.5, before=0, after=1)
        + """[components.b]
initial = "low"
modes.low.guards.up = { expr = "0.5 - u", then = [{ to = "high", reset = { x = "p*u*x" } }] }
modes.high.guards.never = { expr = "9 - x", then = "low" }
"""
    )
    found = hs.sensitivities(ran(model('x = { start = 1, der = "-x" }', rest, "p = 3"), 1.0), ["p"])
    assert found.by_start[0, 0] == pytest.approx(3.0 / math.e, rel=1e-10)
    assert found.by_parameter[0, 0] == pytest.approx(1.0 / math.e, rel=1e-10)
    assert not found.times_by_start.any()


def test_a_moving_limit_that_an_inputs_jump_passes() -> None:
    """The guard x - u falls before the jump already, and would be zero later: the jump sets the time."""
    rest = (
        JUMP.format(at=0.5, before=0, after=1)
        + """[components.b]
initial = "on"
modes.on.guards.low = { expr = "x - u", then = [{ to = "off", reset = { y = "y + x" } }] }
modes.off.der.y = "0"
"""
    )
    declared = model('x = { start = 1, der = "-x" }\ny = { start = 0, der = "x" }', rest)
    found = hs.sensitivities(ran(declared, 1.0))
    # y = (1 - exp(-1/2)) x0 + exp(-1/2) x0 = x0
    assert found.by_start == pytest.approx(np.array([[math.exp(-1.0), 0.0], [1.0, 1.0]]), rel=1e-10)


def test_resets_of_one_instant_read_the_state_before() -> None:
    """Two schedules exchange x and y."""
    rest = '[schedules.a]\ntimes = [0.5]\nreset.x = "y"\n[schedules.b]\ntimes = [0.5]\nreset.y = "x"'
    found = hs.sensitivities(
        ran(model('x = { start = 1, der = "-x" }\ny = { start = 2, der = "-2*y" }', rest), 1.0)
    )
    e = math.exp(-1.5)
    assert found.by_start == pytest.approx(np.array([[0.0, e], [e, 0.0]]), abs=1e-12)


def test_resets_of_one_instant_that_add_are_summed() -> None:
    """x+ = x + a x + b y."""
    rest = (
        '[schedules.a]\ntimes = [0.5]\nreset.x = "+= a*x"\n[schedules.b]\ntimes = [0.5]\nreset.x = "+= b*y"'
    )
    states = 'x = { start = 1, der = "-x" }\ny = { start = 2, der = "-2*y" }'
    found = hs.sensitivities(ran(model(states, rest, "a = 0.5\nb = 3"), 1.0), ["a", "b"])
    assert found.by_start[0] == pytest.approx([1.5 * math.exp(-1.0), 3.0 * math.exp(-1.5)], rel=1e-10)
    assert found.by_parameter[0] == pytest.approx([math.exp(-1.0), 2.0 * math.exp(-1.5)], rel=1e-10)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_reset_that_sets_off_another(integrator: str) -> None:
    """x reaches 1 at 1 - x0; there y becomes 2, and at once w grows by y x: w(2) = w0 exp(-2) + 2 exp(-1 - x0)."""
    rest = """[components.a]
initial = "before"
modes.before.guards.up = { expr = "1 - x", then = [{ to = "after", reset = { y = "2" } }] }
modes.after.guards.never = { expr = "9 - x", then = "before" }
[components.b]
initial = "low"
modes.low.guards.up = { expr = "1.5 - y", then = [{ to = "high", reset = { w = "w + y*x" } }] }
modes.high.guards.never = { expr = "9 - x", then = "low" }
"""
    states = 'x = { start = 0, der = "1" }\ny = { start = 1, der = "-y" }\nw = { start = 3, der = "-w" }'
    found = hs.sensitivities(ran(model(states, rest), 2.0, integrator))
    expected = [[1.0, 0.0, 0.0], [-2.0 / math.e, 0.0, 0.0], [-2.0 / math.e, 0.0, math.exp(-2.0)]]
    assert found.by_start == pytest.approx(np.array(expected), rel=1e-9, abs=1e-10)
    assert found.times_by_start[0] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-12)


def test_what_coincides_with_a_jump_and_moves_is_refused() -> None:
    rest = (
        JUMP.format(at=1, before=0, after=1)
        + RUBBING.format(normal=1)
        + """[components.b]
initial = "low"
modes.low.guards.up = { expr = "a - y", then = [{ to = "high", reset = { y = "0" } }] }
modes.high.guards.never = { expr = "9 - y", then = "low" }
"""
    )
    states = 'v = { start = 0, der = "u - f" }\ny = { start = 0, der = "1" }'
    with pytest.raises(UsageError, match="separate after a small change"):
        hs.sensitivities(ran(model(states, rest, "mu = 0.3\na = 1"), 2.0), ["a"])


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_mass_that_cancels_has_no_effect(integrator: str) -> None:
    """v' = a sin(3 t) - mu g, whatever the mass is; only rounding is left of its derivative."""
    states = 'x = { start = 0, der = "v" }\nv = { start = 5, der = "(m*a*sin(3*t) - f)/m" }'
    declared = model(states, RUBBING.format(normal='"m*9.81"'), "m = 0.7\na = 1.3\nmu = 0.1")
    found = hs.sensitivities(ran(declared, 3.0, integrator), ["m", "mu"])
    assert found.by_parameter[:, 0] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert found.by_parameter[:, 1] == pytest.approx([-9.81 * 4.5, -9.81 * 3.0], rel=1e-9)


def test_multipliers_where_a_jump_of_an_input_resets() -> None:
    """Once a period x -> 2 x + 1, where a square wave rises: the multipliers are 2/e and exp(-1/2)."""
    rest = """[inputs.u]
kind = "wave"
shape = "square"
amplitude = 1
period = 1
[components.c]
initial = "low"
modes.low.guards.up = { expr = "-u", then = [{ to = "high", reset = { x = "2*x + 1" } }] }
modes.high.guards.down = { expr = "u", then = "low" }
"""
    found = hs.steady_state(model('x = { start = 1, der = "-x" }\ny = { start = 0, der = "x - y/2" }', rest))
    assert found.multipliers == pytest.approx([2.0 / math.e, math.exp(-0.5)], rel=1e-9)
    assert [event.source for event in found.solution.events].count("low") == 1
