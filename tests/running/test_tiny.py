"""Runs of no length, and guards that fade below what doubles hold."""

from __future__ import annotations

import pytest

import hybridsim as hs

METHODS = ("exact", "taylor", "dop853", "tsit5", "rodas5p")


@pytest.mark.parametrize("integrator", METHODS)
def test_a_run_of_no_length_again_and_again(integrator: str) -> None:
    """The second one is begun by what the first one has left, and holds its start all the same."""
    states = [hs.State("x", 1, der="v"), hs.State("v", 0, der="-k*x")]
    model = hs.Model("free", states=states, parameters={"k": 4})
    for at in (0.0, 2.0):
        for _ in range(3):
            sol = hs.simulate(model, (at, at), integrator=integrator)
            assert sol.success and sol.t.tolist() == [at] and sol.y.tolist() == [[1.0], [0.0]]
            assert sol(at).tolist() == [1.0, 0.0]


def switch(guard: str) -> hs.Component:
    """Two modes, one where a guard is positive and one where it is not."""
    up, down = hs.Mode("up", guards=[hs.Guard("g", guard, "down")]), hs.Mode("down", guards=[])
    return hs.Component("c", [up, down], initial="up")


@pytest.mark.parametrize("rate, end", [(1000.0, 1.0), (100.0, 30.0)])
def test_a_guard_that_fades_stays_positive(rate: float, end: float) -> None:
    """s' = -a s has no zero, though it has one in doubles; `taylor`, whose atol is far above, may see one."""
    states = [hs.State("s", 0.2, der="-a*s")]
    model = hs.Model("fading", states=states, parameters={"a": rate}, components=[switch("s")])
    sol = hs.simulate(model, (0, end), integrator="exact")
    assert sol.success and sol.events == () and sol.modes["c"][-1].mode == "up"
    sol = hs.simulate(model, (0, end), integrator="taylor")
    assert sol.success and abs(sol.y[0, -1]) < 1e-200


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_a_guard_of_next_to_no_size(integrator: str) -> None:
    """Its slope squared is no double."""
    tiny = "A/(1 + ((x - 8.49)/2.75)**2) - 0.999*A"
    up = hs.Mode("up", guards=[hs.Guard("g", f"{tiny}", "down")])
    down = hs.Mode("down", guards=[hs.Guard("g", f"-({tiny})", "up")])
    model = hs.Model(
        "tiny",
        states=[hs.State("x", 0, der="1")],
        parameters={"A": 1e-170},
        components=[hs.Component("c", [up, down], initial="down")],
    )
    sol = hs.simulate(model, (0, 10), integrator=integrator, rtol=1e-2)
    assert sol.success
