"""The compiled functions of a model stay in memory as long as a run with RK4 uses them."""

from __future__ import annotations

import fresh

LINES = """
import gc
import hybridsim as hs
from hybridsim.integrators.fixed_step.step_code import step_functions

cleared = []

def clear(share):
    step_functions.cache_clear()  # as other structures do, or another thread that compiles the same one
    gc.collect()
    cleared.append(share)

whole = hs.simulate("dfcs", (0, 3), integrator="rk4-dichotomy")
sol = hs.simulate("dfcs", (0, 3), integrator="rk4-dichotomy", progress=clear)
assert len(cleared) > 1, cleared
assert [e.t for e in sol.events] == [e.t for e in whole.events]
print("equal")
"""


def test_a_run_keeps_the_functions_that_it_calls() -> None:
    done = fresh.run(LINES)
    assert done.returncode == 0 and done.stdout.strip() == "equal", (done.returncode, done.stderr)
