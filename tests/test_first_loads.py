"""A result can be loaded and continued in a process that has not run anything."""

from __future__ import annotations

from pathlib import Path

import fresh
import pytest

import hybridsim as hs

ONE_OF_EACH_FAMILY = [
    "auto",
    "exact",
    "taylor",
    "tsit5",
    "rodas5p",
    "scipy-bdf",
    "cvode-bdf",
    "rk4-dichotomy",
    "moreau",
]


@pytest.mark.parametrize("integrator", ONE_OF_EACH_FAMILY)
def test_a_saved_run_goes_on_in_a_fresh_process(integrator: str, tmp_path: Path) -> None:
    """The block is thrown with speed 1 against friction of 1 in units of its weight, and stops at t = 1, x = 0.5."""
    model = hs.Model(
        "thrown",
        states=[hs.State("x", 0, "v"), hs.State("v", 1, "-f")],
        contacts=[hs.Contact("f", velocity="v", normal="1", law="coulomb", arguments={"mu": "1"})],
    )
    options = {"step": 2.0**-10} if integrator.startswith(("rk4", "moreau")) else {}
    hs.simulate(model, (0, 0.5), integrator=integrator, **options).save(tmp_path / "run.hsol")
    code = (
        "import hybridsim as hs\n"
        "sol = hs.load_solution('run.hsol').resume(2.0)\n"
        "print(sol.status, abs(sol(2.0)[0] - 0.5) < 2e-3)\n"
    )
    done = fresh.run(code, folder=tmp_path)
    assert done.stdout == "finished True\n", done.stderr
