"""Generated functions as machine code do to the last bit what their text says in Python."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from hybridsim.engine.native import kernels, model_functions
from hybridsim.engine.native.kernels import ENABLED

pytestmark = pytest.mark.skipif(not ENABLED, reason="the compiler is switched off")

EXPRESSIONS = (
    "x[0]*x[1] - x[0]/x[1] + -x[1]",
    "x[0]**2 + x[1]**3 + x[0]**5 + x[1]**9",
    "1.0/x[1]**2",
    "sin(x[0]) + cos(x[1]) + tan(x[0]) + atan2(x[0], x[1])",
    "exp(x[0]) + log(abs(x[1])) + sqrt(abs(x[0]))",
    "asin(x[0]/9.0) + acos(x[0]/9.0) + atan(x[1])",
    "sinh(x[0]) + cosh(x[1]) + tanh(x[0])",
    "pow(abs(x[0]), x[1])",
    "min(x[0], x[1]) - max(x[0], x[1])",
    "(0.0 if (x[0]) == 0.0 else copysign(1.0, x[0]))",
    "((x[0]) if x[0] < x[1] else ((x[1]) if x[1] >= 2.0 else (pi)))",
    "(1.0 if x[0] > 0.0 and x[1] > 0.0 or not (x[0] != x[1]) else 2.0)",
    "(1.0 if -1.0 < x[0] <= x[1] else t)",
    "(p[0] if z[0] == 0 else p[1]) + t",
)
POINTS = ((0.5, -1.5), (-2.0, 3.0), (1.0, 1.0), (3.25, 0.125), (-0.0, 2.0))


def module(text: str, folder: Path, name: str) -> object:
    """A module as the engine generates them."""
    path = folder / f"{name}.py"
    path.write_text(f"from math import *\n\n{text}\n", encoding="utf-8")
    source = type("Loader", (), {"get_source": staticmethod(lambda _: path.read_text(encoding="utf-8"))})
    made = type("Module", (), {"__file__": str(path), "__name__": name, "__loader__": source})()
    scope: dict[str, object] = {}
    exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), scope)  # noqa: S102  # what the text says
    made.f = scope["f"]
    return made


def called(
    address: int, t: float, x: tuple[float, ...], p: tuple[float, ...], z: int, width: int
) -> np.ndarray:
    out = np.full(width, np.nan)
    assert (
        kernels.kernel(_through)(address, t, np.array(x), np.array(p), np.array([z], dtype=np.int64), out)
        == 0
    )
    return out


def _through(address: int, t: float, x: np.ndarray, p: np.ndarray, z: np.ndarray, out: np.ndarray) -> int:
    return kernels.call(address, t, x, p, z, out)


def test_every_operation_to_the_last_bit(tmp_path: Path) -> None:
    lines = [f"    out[{i}] = {e}" for i, e in enumerate(EXPRESSIONS)]
    made = module("\n".join(["def f(t, x, p, z, out):", *lines, "    return 0"]), tmp_path, "every")
    address, _alive = model_functions.compile_model_function(made, "f")
    for x in POINTS:
        for z in (0, 1):
            expected = [0.0] * len(EXPRESSIONS)
            made.f(0.75, x, (10.0, 20.0), [z], expected)
            got = called(address, 0.75, x, (10.0, 20.0), z, len(EXPRESSIONS))
            exact = [i for i, e in enumerate(EXPRESSIONS) if "**" not in e]
            assert got[exact].tolist() == np.array(expected)[exact].tolist()
            # Python takes whole powers from the C library, the machine code multiplies
            assert np.allclose(got, expected, rtol=4e-16, atol=0.0)


def test_branches_on_modes(tmp_path: Path) -> None:
    text = """def f(t, x, p, z, out):
    if z[0] == 0:
        a = x[0]
        b = 2.0*a
    elif z[0] == 1:
        a = -x[0]
        b = a
    else:
        a = 0.0
        b = 1.0
    out[0] = a + b
    return 0"""
    address, _alive = model_functions.compile_model_function(module(text, tmp_path, "branches"), "f")
    assert [called(address, 0.0, (3.0,), (), z, 1)[0] for z in (0, 1, 2)] == [9.0, -6.0, 1.0]


def test_what_has_no_value_is_nan_or_infinite(tmp_path: Path) -> None:
    text = "def f(t, x, p, z, out):\n    out[0] = 1.0/x[0]\n    out[1] = log(-1.0 - x[0])\n    return 0"
    address, _alive = model_functions.compile_model_function(module(text, tmp_path, "none"), "f")
    got = called(address, 0.0, (0.0,), (), 0, 2)
    assert got[0] == math.inf and math.isnan(got[1])


def test_a_damaged_file_is_compiled_anew(tmp_path: Path) -> None:
    made = module("def f(t, x, p, z, out):\n    out[0] = x[0] + 1.0\n    return 0", tmp_path, "damaged")
    model_functions.compile_model_function(made, "f")
    (kept,) = tmp_path.glob("damaged.f.*.o")
    kept.write_bytes(kept.read_bytes()[:100])
    address, _alive = model_functions.compile_model_function(made, "f")
    assert called(address, 0.0, (1.0,), (), 0, 1)[0] == 2.0
