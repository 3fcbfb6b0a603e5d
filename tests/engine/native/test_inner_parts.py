"""A numba that lacks one of its undocumented parts makes runs slower, says so once, and changes no answer."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from hybridsim.engine.native import inner_parts
from hybridsim.engine.native.kernels import ENABLED

pytestmark = [
    pytest.mark.skipif(not ENABLED, reason="nothing is compiled"),
    pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork"),
]

# A numba in which one name is missing, for those who look it up; numba itself keeps it. Each part has its own process,
# forked from one that has loaded the libraries, and writes what it prints beside its cache.
SCRIPT = """
import importlib
import json
import os
import sys
import traceback
from types import SimpleNamespace

import llvmlite.binding
import numba
import sympy
from scipy.integrate import solve_ivp

found = importlib.import_module

class Poorer:
    def __init__(self, whole, name):
        self.whole, self.name = whole, name
    def __getattr__(self, attribute):
        if attribute == self.name:
            raise AttributeError(attribute)
        return getattr(self.whole, attribute)

def without(module, name):
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
                options=Poorer(target.options, name), target_context=target.target_context))
        return Poorer(whole, name) if wanted == module else whole
    importlib.import_module = import_module

def run(is_whole):
    import hybridsim as hs
    from hybridsim.engine.native import kernels
    decay = hs.Model("decay", states=[hs.State("x", 1.0, "-x")])
    if is_whole:
        end = hs.simulate(decay, (0.0, 1.0), integrator="scipy-rk45", rtol=1e-9).y[0, -1]
    else:
        end = solve_ivp(hs.to_ivp(decay).fun, (0.0, 1.0), [1.0], rtol=1e-9, atol=1e-12).y[0, -1]
    print(kernels.ENABLED, repr(float(end)))

def trial(part, cache, is_whole):
    for number, end in ((1, "out"), (2, "err")):
        os.dup2(os.open(f"{cache}.{end}", os.O_WRONLY | os.O_CREAT), number)
    os.environ["HYBRIDSIM_CACHE"] = cache
    without(*part)
    run(is_whole)

for part, cache, is_whole in json.loads(sys.argv[1]):
    child = os.fork()
    if not child:
        try:
            trial(part, cache, is_whole)
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(0)
    os.waitpid(child, 0)
"""
Part = tuple[str, str]
NOTHING = ("nothing", "missing")
NEEDED: list[Part] = [("llvmlite.binding", "ptr"), *inner_parts._NEEDED]
SLOWER: list[Part] = [
    ("numba.core", "event"),
    ("numba.core", "compiler_lock"),
    ("numba.core.ccallback", "CFunc"),
    ("numba.core.registry", "cpu_target"),
    ("numba.core.caching", "FunctionCache"),
    ("llvmlite.binding", "create_pass_builder"),
    ("option", "_nrt"),
]


def without(parts: list[Part], folder: Path, is_whole: bool = False) -> list[tuple[str, float, list[str]]]:
    """Whether the engine is compiled without each part, the state at t = 1, and what is told of numba.

    The state is that of SciPy's own method on the model's rates, which takes few kernels, or of a whole run.
    """
    trials = [(part, str(folder / str(number)), is_whole) for number, part in enumerate(parts)]
    # levels of optimisation change no rule, and the lowest compiles soonest
    more = {"NUMBA_OPT": "0", "PYTHONWARNINGS": "ignore"}
    more["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    subprocess.run([sys.executable, "-c", SCRIPT, json.dumps(trials)], env={**os.environ, **more}, check=True)
    found = []
    for part, cache, _ in trials:
        out, err = (Path(f"{cache}.{end}").read_text() for end in ("out", "err"))
        assert out, (part, err)
        told = [line for line in err.splitlines() if line.startswith("hybridsim: numba ")]
        found.append((out.split()[0], float(out.split()[1]), told))
    return found


def test_without_a_part_that_kernels_consist_of_nothing_is_compiled(tmp_path: Path) -> None:
    for part, (compiled, value, told) in zip(NEEDED, without(NEEDED, tmp_path), strict=True):
        assert compiled == "False" and value == pytest.approx(math.exp(-1.0), rel=1e-8), part
        assert len(told) == 1 and "the engine is not compiled, and runs are slow" in told[0], part
        assert ("opaque pointers" if part[1] == "ptr" else ".".join(part)) in told[0], part


def test_without_another_part_it_is_slower(tmp_path: Path) -> None:
    """And a numba that has all says nothing."""
    parts = [*SLOWER, NOTHING]
    for part, (compiled, value, told) in zip(parts, without(parts, tmp_path), strict=True):
        assert compiled == "True" and value == pytest.approx(math.exp(-1.0), rel=1e-8), part
        assert len(told) == (part != NOTHING) and all(part[1] in line for line in told), part


# the largest kernels, which a whole run takes, are callbacks for C
@pytest.mark.parametrize(
    "part",
    [part if part[1] == "CFunc" else pytest.param(part, marks=pytest.mark.slow) for part in SLOWER],
    ids="-".join,
)
def test_a_whole_run_without_it_is_right(part: Part, tmp_path: Path) -> None:
    ((compiled, value, told),) = without([part], tmp_path, is_whole=True)
    assert compiled == "True" and value == pytest.approx(math.exp(-1.0), rel=1e-8)
    assert len(told) == 1
