"""Files, functions and argument lists of the package are short; the exceptions are lists that only get shorter."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

import hybridsim

PACKAGE = Path(hybridsim.__file__).parent
SOURCES = sorted(PACKAGE.rglob("*.py"))

FILE, FUNCTION, KERNEL, PARAMETERS = 300, 80, 140, 9  # lines, lines without the docstring, the same, number

# Decorators of functions that numba compiles. To divide one of them costs time of compiling.
COMPILED = {"kernel", "inlined", "allocating_kernel", "polynomial_kernel", "merged"}

# The sizes above which none of these may grow.
FILES = {
    "analysis/continuation/continuation.py": 323,
    "analysis/steady/steady_state.py": 447,
    "analysis/variations/carried.py": 343,
    "analysis/variations/off_zero.py": 305,
    "arguments.py": 376,
    "engine/events/zeno/accumulation.py": 385,
    "engine/linear/motion.py": 341,
    "engine/lowering/emit.py": 358,
    "engine/lowering/lower.py": 373,
    "engine/roots/roots.py": 355,
    "engine/run/mode_loop.py": 566,
    "engine/run/segment_run.py": 473,
    "engine/series/bounded.py": 365,
    "engine/series/interpreter.py": 444,
    "engine/system/system.py": 500,
    "integrators/fixed_step/moreau_kernels.py": 401,
    "integrators/fixed_step/run.py": 417,
    "integrators/runge_kutta/segments.py": 362,
    "mechanics/declaration/system.py": 350,
    "mechanics/series_loop/steps.py": 331,
    "mechanics/time_stepping/kernels.py": 375,
    "model/parts/model.py": 525,
    "model/smoothing/rewriting.py": 418,
    "simulator/simulator.py": 352,
    "solution/explain/explanation.py": 351,
}
FUNCTIONS = {
    "analysis/advise/advise.py::advise": 93,
    "integrators/taylor/segments.py::taylor_segment": 143,
    "mechanics/simulate.py::simulate_mechanical": 81,
    "testing/catalogue/coincidences.py::scenes": 103,
    "testing/catalogue/events.py::monitored": 113,
}
ARGUMENTS = {
    "analysis/advise/advise.py::advise": 15,
    "analysis/compare/compare.py::compare": 13,
    "analysis/continuation/continuation.py::continuation": 10,
    "analysis/steady/steady_state.py::steady_state": 12,
    "analysis/sweep/bifurcation.py::bifurcation": 14,
    "analysis/sweep/sweep.py::sweep": 13,
    "analysis/variations/rounds.py::__init__": 12,
    "engine/events/zeno/accumulation.py::may_end": 10,
    "engine/linear/guards.py::modal_guards": 10,
    "engine/linear/motion_summary.py::_between": 10,
    "engine/linear/motion_summary.py::sum_up": 10,
    "engine/record/hermite.py::holds_between": 11,
    "engine/roots/defect_check.py::look_ahead": 11,
    "engine/roots/dense_guards.py::first_guard": 12,
    "engine/roots/earliest_exit.py::earliest_exit": 10,
    "engine/run/segment_run.py::__init__": 11,
    "engine/series/bounded.py::run_series": 11,
    "engine/series/interpreter.py::reach": 12,
    "engine/system/finite_differences.py::_series": 12,
    "engine/system/finite_differences.py::along": 10,
    "engine/system/finite_differences.py::run_differences": 12,
    "engine/series/tangent_panel.py::run_tangents": 10,
    "integrators/fixed_step/kernels.py::passed": 12,
    "integrators/fixed_step/moreau_kernels.py::moreau_step": 11,
    "integrators/fixed_step/moreau_kernels.py::moreau_steps": 16,
    "integrators/fixed_step/rk4_kernels.py::_halve_step": 14,
    "integrators/fixed_step/rk4_kernels.py::run_steps": 14,
    "integrators/rosenbrock/step.py::rosenbrock_attempt": 15,
    "integrators/runge_kutta/segments.py::land": 10,
    "integrators/runge_kutta/segments.py::series_of": 10,
    "integrators/runge_kutta/step.py::attempt": 11,
    "integrators/taylor/segments.py::series_at": 13,
    "mechanics/declaration/system.py::__init__": 12,
    "mechanics/series_loop/loop.py::_changes_outside": 10,
    "mechanics/series_loop/node_segments.py::quantities": 13,
    "mechanics/simulate.py::simulate_mechanical": 12,
    "preparation.py::prepared": 14,
    "reference/closed_forms/slip_phase.py::__init__": 10,
    "simulate.py::simulate": 16,
}


def name_of(path: Path) -> str:
    """Return the path of a module within the package."""
    return path.relative_to(PACKAGE).as_posix()


def is_compiled(function: ast.FunctionDef) -> bool:
    """Return whether numba compiles a function."""
    return any(
        getattr(one, "id", getattr(one, "attr", "")) in COMPILED
        for decorator in function.decorator_list
        for one in (decorator.func if isinstance(decorator, ast.Call) else decorator,)
    )


def lines_of(function: ast.FunctionDef) -> int:
    """Return the number of lines of a function without its docstring."""
    first = function.body[0]
    text = isinstance(first, ast.Expr) and isinstance(getattr(first.value, "value", None), str)
    docstring = (first.end_lineno or first.lineno) - first.lineno + 1 if text else 0
    return (function.end_lineno or function.lineno) - function.lineno + 1 - docstring


def count_of(function: ast.FunctionDef) -> int:
    """Return the number of arguments of a function, self and cls left out."""
    arguments = function.args
    named = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    others = [one for one in (arguments.vararg, arguments.kwarg) if one is not None]
    return len([one for one in named if one.arg not in ("self", "cls")]) + len(others)


@cache
def functions() -> tuple[tuple[str, ast.FunctionDef], ...]:
    """Return every function with its file and name."""
    return tuple(
        (f"{name_of(path)}::{node.name}", node)
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    )


@cache
def sizes() -> tuple[dict[str, int], dict[str, int], dict[str, int]]:
    """Return files, functions and argument lists above the limits with their sizes, the largest of one name."""
    files = {name_of(path): len(path.read_text(encoding="utf-8").splitlines()) for path in SOURCES}
    long: dict[str, int] = {}
    wide: dict[str, int] = {}
    for name, function in functions():
        lines, count = lines_of(function), count_of(function)
        if lines > (KERNEL if is_compiled(function) else FUNCTION):
            long[name] = max(lines, long.get(name, 0))
        if count > PARAMETERS:
            wide[name] = max(count, wide.get(name, 0))
    return {name: lines for name, lines in files.items() if lines > FILE}, long, wide


KINDS = {"files": FILES, "functions": FUNCTIONS, "arguments": ARGUMENTS}


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_grows_beyond_its_limit(kind: str) -> None:
    ceilings, here = KINDS[kind], sizes()[list(KINDS).index(kind)]
    grown = {name: size for name, size in here.items() if size > ceilings.get(name, 0)}
    assert not grown, f"divide these, or take out what is not needed: {grown}"


@pytest.mark.parametrize("kind", KINDS)
def test_what_became_small_leaves_its_list(kind: str) -> None:
    ceilings, here = KINDS[kind], sizes()[list(KINDS).index(kind)]
    assert not set(ceilings) - set(here), f"take these off the list: {set(ceilings) - set(here)}"


def test_sizes_are_counted() -> None:
    (function,) = ast.parse(
        'def f(self, a, *b, c=1, **d):\n    """One.\n\n    Two.\n    """\n    return a\n'
    ).body
    assert isinstance(function, ast.FunctionDef)
    assert lines_of(function) == 2 and count_of(function) == 4 and not is_compiled(function)
    (compiled,) = ast.parse("@kernel\ndef f(a):\n    return a\n").body
    assert isinstance(compiled, ast.FunctionDef) and is_compiled(compiled)
