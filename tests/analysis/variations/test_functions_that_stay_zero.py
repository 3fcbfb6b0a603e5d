"""Derivatives of runs along which a guard, surface or corner stays zero, and whose two sides part later.

The one-sided derivatives are closed forms, and differences of runs agree with them.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import hybridsim as hs

NAN, END = math.nan, 1.2
STUCK = """states.v = { start = 0, der = "0.8*sin(2*t) - f" }
contacts.f = { velocity = "v", normal = 1, law = { name = "coulomb", mu = 0.3 } }
"""
SIGN = 'surfaces.s = "y"\n'
SWITCH = """[components.g.modes.on]
initial = true
set.u = "1"
guards.low = { expr = "y", then = { to = "off" } }
[components.g.modes.off]
set.u = "2"
"""
LATE = """[components.h.modes.on]
initial = true
set.k = "0"
guards.late = { expr = "DELAY - t", then = { to = "off" } }
[components.h.modes.off]
set.k = "1"
"""
MONITOR = 'action = "reset", reset = { w = "1" } }'

# The declarations, which contain q, the one-sided derivatives of y and w by q (or their sign, if infinite), and what
# `sensitivities` returns for y and w.
CASES = {
    "a surface parts at a release": (
        STUCK
        + 'states.y = { start = "q", der = "v - 0.1*(1 + s)*v" }\nstates.w = { start = 0, der = "0" }\n'
        + SIGN,
        ([0.8, 0.0], [1.0, 0.0]),
        [NAN, 0.0],
        "t = 0.192198387 s",
    ),
    "a surface parts from the start on": (
        'states.y = { start = "q", der = "t*(1 - 0.1*s)" }\nstates.w = { start = 0, der = "t*s" }\n' + SIGN,
        ([0.9 / 1.1, 2.0 / 1.1], [1.0, 0.0]),
        [NAN, NAN],
        "t = 0 s",
    ),
    "a corner along which y rests": (
        'states.y = { start = "q", der = "0" }\nstates.w = { start = 0, der = "t*abs(y)" }\n',
        ([1.0, -(END**2) / 2], [1.0, END**2 / 2]),
        [NAN, NAN],
        "t = 0 guard side of abs(y)",
    ),
    "a corner that a rate leaves": (
        'states.y = { start = 0, der = "q" }\nstates.w = { start = 0, der = "t*abs(y)" }\n',
        ([END, -(END**3) / 3], [END, END**3 / 3]),
        [NAN, NAN],
        "t = 0 guard side of abs(y)",
    ),
    "a surface that is passed twice": (
        'states.y = { start = 0, der = "t + q" }\nstates.w = { start = 0, der = "s" }\n' + SIGN,
        ([END, 4.0], [END, 0.0]),
        [NAN, NAN],
        "t = 0 s",
    ),
    "a guard that would fire": (
        'states.y = { start = 0, der = "q" }\nstates.w = { start = 0, der = "0" }\n'
        + SWITCH.replace('to = "off"', 'to = "off", reset = { w = "1" }'),
        ([END, -math.inf], [END, 0.0]),
        [NAN, NAN],
        "t = 0 guard low of g",
    ),
    "modes that another component makes different": (
        'states.y = { start = "q", der = "0" }\nstates.w = { start = 0, der = "u*k" }\n'
        + SWITCH
        + LATE.replace("DELAY", "0.5"),
        ([1.0, -math.inf], [1.0, 0.0]),
        [NAN, NAN],
        "guard low of g",
    ),
    "modes that another guard reads": (
        'states.y = { start = "q", der = "0" }\nstates.w = { start = 0, der = "k" }\n'
        + SWITCH
        + LATE.replace("DELAY", "0.5*u"),
        ([1.0, math.inf], [1.0, 0.0]),
        [NAN, NAN],
        "t = 0 guard low of g",
    ),
    "a monitor that the other side passes at a release": (
        STUCK
        + 'states.y = { start = "q", der = "v" }\nstates.w = { start = 0, der = "0" }\n'
        + 'monitors.m = { expr = "y", direction = "up", '
        + MONITOR,
        ([1.0, -math.inf], [1.0, 0.0]),
        [NAN, NAN],
        "t = 0.192198387 monitor m",
    ),
    "a monitor that reads the side": (
        'states.y = { start = "q", der = "0" }\nstates.w = { start = 0, der = "w - w" }\n'
        + SIGN
        + 'monitors.m = { expr = "0.7 + 0.3*s - t", direction = "down", '
        + MONITOR.replace('"1"', '"t"'),
        ([1.0, math.inf], [1.0, 0.0]),
        [NAN, NAN],
        "t = 0 s",
    ),
    "a reset that reads the side": (
        'states.y = { start = "q", der = "0" }\nstates.w = { start = 0, der = "0*s" }\n'
        + SIGN
        + 'schedules.k = { times = [0.5], reset.w = "s" }\n',
        ([1.0, math.inf], [1.0, 0.0]),
        [NAN, NAN],
        "t = 0.5 s",
    ),
    "a reset with a corner": (
        'states.y = { start = "q", der = "0" }\nstates.w = { start = 0, der = "0" }\n'
        + 'schedules.k = { times = [0.5], reset.w = "max(y, 0)" }\n',
        ([1.0, 0.0], [1.0, 1.0]),
        [NAN, NAN],
        "t = 0.5 a corner in a reset of k",
    ),
    "a reset that puts y on its zero": (
        'states.v = { start = 0, der = "1" }\nstates.y = { start = 5, der = "v*(1 - 0.1*s)" }\n'
        + 'states.w = { start = 0, der = "0" }\n'
        + SIGN
        + 'schedules.k = { times = [0.5], reset = { v = "0", y = "q" } }\n',
        ([0.9 / 1.1, 0.0], [1.0, 0.0]),
        [NAN, 0.0],
        "t = 0.5 s",
    ),
    "equal sides": (
        STUCK
        + 'states.y = { start = "q", der = "v*(1 + 0*s)" }\nstates.w = { start = 0, der = "y" }\n'
        + SIGN,
        ([1.0, END], [1.0, END]),
        [1.0, END],
        "",
    ),
    "sides that differ to second order": (
        'states.y = { start = "q", der = "t" }\nstates.w = { start = 0, der = "s*t**3" }\n' + SIGN,
        ([1.0, 0.0], [1.0, 0.0]),
        [1.0, 0.0],
        "",
    ),
    "a corner that is left from rest": (
        'states.w = { start = 0, der = "1 - 4*max(0, y)" }\nstates.y = { start = "q", der = "w" }\n',
        ([math.cos(2 * END), -2 * math.sin(2 * END)], [math.cos(2 * END), -2 * math.sin(2 * END)]),
        [math.cos(2 * END), -2 * math.sin(2 * END)],
        "",
    ),
    "a reset away from its corner": (
        'states.y = { start = "q - 1", der = "0" }\nstates.w = { start = 0, der = "0" }\n'
        + 'schedules.k = { times = [0.5], reset.w = "max(y, abs(y))" }\n',
        ([1.0, -1.0], [1.0, -1.0]),
        [1.0, -1.0],
        "",
    ),
}


def model(declared: str) -> hs.Model:
    return hs.Model.from_toml(f'schema = 1\nname = "staying"\nparameters.q = 0.0\n{declared}')


def ends(declared: hs.Model, integrator: str, q: float) -> np.ndarray:
    solution = hs.simulate(declared, (0, END), params={"q": q}, integrator=integrator, rtol=1e-11)
    return solution.y[_rows(solution), -1]


def _rows(solution: hs.Solution) -> list[int]:
    return [solution.names.index(name) for name in ("y", "w")]


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
@pytest.mark.parametrize("case", CASES)
def test_sides_that_part_later(case: str, integrator: str) -> None:
    declared, sides, expected, name = CASES[case]
    built = model(declared)
    h, base = 1e-8, ends(built, integrator, 0.0)
    for sign, one_sided in zip((-1.0, 1.0), sides, strict=True):
        step = (ends(built, integrator, sign * h) - base) / (sign * h)
        for found, known in zip(step, one_sided, strict=True):
            if math.isinf(known):
                assert found * math.copysign(1.0, known) > 1e4
            else:
                assert found == pytest.approx(known, abs=2e-3)  # to the order of the root of h
    solution = hs.simulate(built, (0, END), integrator=integrator, rtol=1e-11)
    found = hs.sensitivities(solution, ["q"])
    rows = _rows(solution)
    assert found.by_parameter[rows, 0] == pytest.approx(expected, rel=1e-8, abs=1e-9, nan_ok=True)
    warned = [text for text in found.warnings if " q " in text]
    assert bool(warned) == bool(name)
    assert all(name in text for text in warned[:1])


def test_before_the_sides_part_the_derivatives_are_known() -> None:
    declared, *_ = CASES["a surface parts at a release"]
    found = hs.sensitivities(hs.simulate(model(declared), (0, END)), ["q"])
    assert found.at(0.1, "y").by_parameter[0, 0] == 1.0
    assert math.isnan(found.at(1.0, "y").by_parameter[0, 0])


def test_a_motion_whose_sides_part_has_no_multipliers() -> None:
    """w is driven along the zero of y, on whose two sides its damping is 1 and 2."""
    built = hs.Model.from_toml(
        """schema = 1
name = "orbit"
states.w = { start = 0, der = "cos(t) - w - t_on*abs(y)*w" }
states.y = { start = 0, der = "-y" }
definitions.t_on = "sin(t)**2"
"""
    )
    found = hs.steady_state(built)
    with pytest.raises(hs.UsageError, match=r"no multipliers: .*abs\(y\) is exactly at its zero"):
        _ = found.multipliers


# An output, its one-sided derivatives by q (or their sign, if infinite), and what `at` returns.
OUTPUTS = {
    "s*y": ([-1.0, 1.0], NAN),
    "s": ([math.inf, 0.0], NAN),
    "abs(y) + s*y": ([-2.0, 2.0], NAN),
    "3*y + 0*s": ([3.0, 3.0], 3.0),
    "s*y**2 + q": ([1.0, 1.0], 1.0),
    "s*x": ([0.0, 0.0], 0.0),
}


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "scipy-rk45"])
@pytest.mark.parametrize("output", OUTPUTS)
def test_an_output_that_reads_the_side_of_a_zero(output: str, integrator: str) -> None:
    """The states have equal derivatives on both sides; x is zero on both."""
    sides, expected = OUTPUTS[output]
    declared = 'states.y = { start = "q", der = "0" }\nstates.x = { start = 0, der = "0" }\n'
    built = model(f'{declared}outputs.r = "{output}"\n{SIGN}')
    h, base = 1e-6, hs.simulate(built, (0, END), integrator=integrator).output("r", 0.5)
    for sign, known in zip((-1.0, 1.0), sides, strict=True):
        run = hs.simulate(built, (0, END), params={"q": sign * h}, integrator=integrator)
        step = (run.output("r", 0.5) - base) / (sign * h)
        assert (
            step * math.copysign(1.0, known) > 1e4
            if math.isinf(known)
            else step == pytest.approx(known, abs=1e-5)
        )
    found = hs.sensitivities(hs.simulate(built, (0, END), integrator=integrator), ["q"])
    assert found.by_parameter[0, 0] == 1.0
    for t in (0.5, [0.3, 1.0]):
        assert found.at(t, "r").by_parameter.ravel() == pytest.approx(
            np.full(np.size(t), expected), nan_ok=True
        )
    assert np.isnan(found.of("integral", "r").by_parameter[0]) == math.isnan(expected)
    assert found.at(0.5, "y").by_parameter[0, 0] == 1.0
    warned = [text for text in found.warnings if " q " in text]
    assert bool(warned) == math.isnan(expected)
    assert all("at t = 0 s is exactly at its zero" in text for text in warned)
