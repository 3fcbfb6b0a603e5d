"""A mode that is left and entered again with a guard that has drifted below zero: the run says what to declare."""

from __future__ import annotations

import math

import pytest

import hybridsim as hs


def limited(reset: str, drift: float = 0.0) -> hs.Model:
    """An integrator of 3 cos(2 t), held at a limit that moves for as long as its input would carry it further."""
    return hs.Model.from_toml(f"""
        schema = 1
        name = "limited"
        [states]
        y = {{ start = 0, nominal = 1, der = "u" }}
        u = {{ start = 0, nominal = 1, der = "3*cos(2*t)" }}
        [modes.free]
        initial = true
        guards.up = {{ expr = "1 + 0.3*sin(3*t) - y", then = "high" }}
        [modes.high]
        der = {{ y = "0.9*cos(3*t) + {drift!r}" }}
        guards.back = {{ expr = "u - 0.9*cos(3*t)", then = [{{ to = "free"{reset} }}] }}
    """)


@pytest.mark.parametrize("integrator", ["cvode-bdf", "taylor", "dop853"])
def test_a_guard_that_has_drifted_is_named_with_its_value_and_a_remedy(integrator: str) -> None:
    solution = hs.simulate(limited("", drift=1e-6), (0, 3), integrator=integrator)
    assert solution.status == "cascade"
    value = float(solution.message.split("Guard up is ")[1].split()[0])
    assert value == pytest.approx(-1e-6 * 0.57955, rel=0.1)  # the time for which the limit held
    assert "leads to free" in solution.message
    assert "let a reset of that transition set the states on which the guard depends" in solution.message


@pytest.mark.parametrize("integrator", ["cvode-bdf", "cvode-adams", "taylor", "dop853"])
def test_the_remedy_works(integrator: str) -> None:
    model = limited(', reset = { y = "1 + 0.3*sin(3*t)" }')
    solution = hs.simulate(model, (0, 3), integrator=integrator)
    assert solution.success, solution.message
    back = math.pi / 2  # 1.5 sin(2 t) = 0.9 cos(3 t) = 0
    assert [event.target for event in solution.events if event.kind == "transition"] == ["high", "free"]
    assert solution.events[1].t == pytest.approx(back, abs=1e-7)
    # from there on y = y(back) - 3/4 (cos 2t + 1)
    expected = 1 + 0.3 * math.sin(3 * back) - 0.75 * (math.cos(6.0) + 1)
    assert solution(3.0)[0] == pytest.approx(expected, abs=1e-6)
