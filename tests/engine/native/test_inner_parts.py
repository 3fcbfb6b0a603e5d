"""A numba that lacks one of its undocumented parts makes runs slower, says so once, and changes no answer."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from hybridsim.engine.native import inner_parts
from hybridsim.engine.native.kernels import ENABLED

pytestmark = pytest.mark.skipif(not ENABLED, reason="nothing is compiled")

# A numba in which one name is missing, for those who look it up; numba itself keeps it.
SCRIPT = """
import importlib
import sys
from types import SimpleNamespace
import numba

module, name, *whole_run = sys.argv[1:]
found = importlib.import_module

class Poorer:
    def __init__(self, whole):
        self.whole = whole
    def __getattr__(self, attribute):
        if attribute == name:
            raise AttributeError(attribute)
        return getattr(self.whole, attribute)

def import_module(wanted, package=None):
    whole = found(wanted, package)
    if module == wanted == "llvmlite.binding" and name == "ptr":
        import llvmlite.binding as binding
        def parse(text):
            raise RuntimeError("LLVM IR parsing error: expected type")
        return SimpleNamespace(create_mcjit_compiler=binding.create_mcjit_compiler, parse_assembly=parse)
    if module == "option" and wanted == "numba.core.registry":
        target = whole.cpu_target
        return SimpleNamespace(cpu_target=SimpleNamespace(
            options=Poorer(target.options), target_context=target.target_context))
    return Poorer(whole) if wanted == module else whole

importlib.import_module = import_module
import hybridsim as hs
from hybridsim.engine.native import kernels
from scipy.integrate import solve_ivp
decay = hs.Model("decay", states=[hs.State("x", 1.0, "-x")])
if whole_run:
    end = hs.simulate(decay, (0.0, 1.0), integrator="scipy-rk45", rtol=1e-9).y[0, -1]
else:
    end = solve_ivp(hs.to_ivp(decay).fun, (0.0, 1.0), [1.0], rtol=1e-9, atol=1e-12).y[0, -1]
print(kernels.ENABLED, repr(float(end)))
"""
NEEDED = [("llvmlite.binding", "ptr"), *inner_parts._NEEDED]
SLOWER = [
    ("numba.core", "event"),
    ("numba.core", "compiler_lock"),
    ("numba.core.ccallback", "CFunc"),
    ("numba.core.registry", "cpu_target"),
    ("numba.core.caching", "FunctionCache"),
    ("llvmlite.binding", "create_pass_builder"),
    ("option", "_nrt"),
]


def run(part: tuple[str, str], cache: Path, *whole: str) -> tuple[str, float, list[str]]:
    """Whether the engine is compiled, the state at t = 1, and what is told of numba.

    The state is that of SciPy's own method on the model's rates, which takes few kernels, or of a whole run.
    """
    # levels of optimisation change no rule, and the lowest compiles soonest
    more = {"HYBRIDSIM_CACHE": str(cache), "NUMBA_OPT": "0", "PYTHONWARNINGS": "ignore"}
    more["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *part, *whole],
        env={**os.environ, **more},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    compiled, value = done.stdout.split()
    told = [line for line in done.stderr.splitlines() if line.startswith("hybridsim: numba ")]
    return compiled, float(value), told


@pytest.mark.parametrize("part", NEEDED, ids="-".join)
def test_without_a_part_that_kernels_consist_of_nothing_is_compiled(
    part: tuple[str, str], tmp_path: Path
) -> None:
    compiled, value, told = run(part, tmp_path)
    assert compiled == "False" and value == pytest.approx(math.exp(-1.0), rel=1e-8)
    assert len(told) == 1 and "the engine is not compiled, and runs are slow" in told[0]
    assert ("opaque pointers" if part[1] == "ptr" else ".".join(part)) in told[0]


@pytest.mark.parametrize("part", SLOWER, ids="-".join)
def test_without_another_part_it_is_slower(part: tuple[str, str], tmp_path: Path) -> None:
    compiled, value, told = run(part, tmp_path)
    assert compiled == "True" and value == pytest.approx(math.exp(-1.0), rel=1e-8)
    assert len(told) == 1 and part[1] in told[0]


# the largest kernels, which a whole run takes, are callbacks for C
@pytest.mark.parametrize(
    "part",
    [part if part[1] == "CFunc" else pytest.param(part, marks=pytest.mark.slow) for part in SLOWER],
    ids="-".join,
)
def test_a_whole_run_without_it_is_right(part: tuple[str, str], tmp_path: Path) -> None:
    compiled, value, told = run(part, tmp_path, "whole")
    assert compiled == "True" and value == pytest.approx(math.exp(-1.0), rel=1e-8)
    assert len(told) == 1


def test_this_numba_has_all(tmp_path: Path) -> None:
    assert run(("nothing", "missing"), tmp_path)[::2] == ("True", [])
