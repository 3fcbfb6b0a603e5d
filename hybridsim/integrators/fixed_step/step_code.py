"""This module writes the step functions of the published methods for one model.

In the text, states x are followed by the values of the model's forcing at their time, such as sin(p[6]*t + p[9]): those
at the end of a step are those at the start of the next one.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import ENABLED
from hybridsim.engine.native.model_functions import compile_model_function, compile_series
from hybridsim.engine.system.modules import module_of
from hybridsim.expr.python_tree import python_tree

ZONE, SIGN = 0, 1  # rules that choose the modes of surface components
_USED = ("flow", "surfaces", "guards", "project")  # functions of the model that a step calls
_EXPORTED = ("choose", "step", "march")
_STRUCTURES = 64  # most recently used structures whose functions stay in memory


@dataclass(frozen=True)
class StepCode:
    """The properties of a model and the options on which the step functions depend.

    table: see `hybridsim.integrators.fixed_step.surface_table`. forcing: number of values of the forcing.
    """

    n: int
    components: int
    guards: int
    table: tuple[tuple[int, ...], ...]
    rule: int
    every_stage: bool
    zeroed: bool
    pin_at: int
    forcing: int = 0

    @property
    def width(self) -> int:
        """Return the number of states plus the number of forcing values."""
        return self.n + self.forcing

    @property
    def surfaces(self) -> int:
        """Return the number of components with a surface."""
        return len(self.table)

    def text(self) -> str:
        """Return the text of all step functions; functions before `choose` are internal."""
        prefix = "forced_" if self.forcing else ""
        parts = [("select", self._select()), ("classic", self._classic())]
        if self.rule == ZONE:
            parts.insert(0, ("release", self._release()))
        else:
            parts[:0] = [(f"{p}slope", self._slope(p)) for p in dict.fromkeys(("", prefix))]
        parts += [("choose", self._choose()), ("step", self._step()), ("march", self._march())]
        text = "".join(
            f"def {name}(t, x, p, z, out):\n" + "".join(f"    {line}\n" for line in body) + "    return 0\n"
            for name, body in parts
        )
        for name in (*_USED, "slope"):
            text = text.replace(f"FORCED_{name}", prefix + name)
        return text

    def _held(self, modes: str = "z") -> str:
        """Return the text of the condition that a surface component is in its holding mode."""
        return " or ".join(f"{modes}[{c}] == {hold}" for c, _, _, hold, *_ in self.table) or "0 > 1"

    def _release(self) -> Iterator[str]:
        """Yield code that releases held components beyond their limits."""
        yield f"values = doubles({max(self.guards, 1)})"
        yield "FORCED_guards(t, x, p, z, values)"
        yield "out[0] = 0.0"
        for c, above, below, hold, upper, lower in self.table:
            yield f"if z[{c}] == {hold}:"
            yield f"    if values[{upper}] < 0.0:"
            yield f"        z[{c}] = {above}"
            yield "        out[0] = 1.0"
            yield f"    elif values[{lower}] < 0.0:"
            yield f"        z[{c}] = {below}"
            yield "        out[0] = 1.0"

    def _select(self) -> Iterator[str]:
        """Yield code that chooses the modes from the surface values."""
        eps = f"out[{self.surfaces}]"
        yield "FORCED_surfaces(t, x, p, z, out)"
        for k, (c, above, below, hold, *_) in enumerate(self.table):
            yield f"if out[{k}] >= {eps} and out[{k}] > 0.0:"
            yield f"    z[{c}] = {above}"
            yield f"elif out[{k}] <= -{eps} and out[{k}] < 0.0:"
            yield f"    z[{c}] = {below}"
            yield "else:"
            yield f"    z[{c}] = {hold}"
        if self.rule == ZONE and self.table:
            yield "changed = doubles(1)"
            yield f"changed[0] = 1.0 if {self._held()} else 0.0"
            for _ in range(self.surfaces + 1):
                yield "if changed[0] > 0.0:"
                yield "    release(t, x, p, z, changed)"

    def _slope(self, prefix: str) -> Iterator[str]:
        """Yield code that computes the rates; at zero velocity, a rate is the mean for the two slip directions."""
        yield f"if {self._held()}:"
        yield f"    sides = integers({max(self.components, 1)})"
        yield f"    other = doubles({self.n})"
        for i in range(self.components):
            yield f"    sides[{i}] = z[{i}]"
        for side, target in ((1, "out"), (2, "other")):
            for row in self.table:
                yield f"    if z[{row[0]}] == {row[3]}:"
                yield f"        sides[{row[0]}] = {row[side]}"
            yield f"    {prefix}flow(t, x, p, sides, {target})"
        for i in range(self.n):
            yield f"    out[{i}] = 0.5*(out[{i}] + other[{i}])"
        yield "else:"
        yield f"    {prefix}flow(t, x, p, z, out)"

    def _classic(self) -> Iterator[str]:
        """Yield code of a classic Runge-Kutta step."""
        n, width, end = self.n, self.width, self.width + self.surfaces
        rates = "flow" if self.rule == ZONE else "slope"
        yield f"h = out[{end}]"
        for j in range(4):
            yield f"k{j} = doubles({n})"
        yield f"stage = doubles({width})"
        yield f"values = doubles({self.surfaces + 1})"
        yield f"values[{self.surfaces}] = out[{end + 1}]"
        yield f"modes = integers({max(self.components, 1)})"
        yield from (f"modes[{i}] = z[{i}]" for i in range(self.components))
        yield f"FORCED_{rates}(t, x, p, modes, k0)"
        # with fixed modes the compiler evaluates the forcing in the middle of a step once, or never if all is held
        middle = f"FORCED_{rates}" if self.every_stage else rates
        if self.forcing and self.every_stage:
            yield "force(t + 0.5*h, x, p, z, stage)"
        for j, c, name in ((1, "0.5*h", middle), (2, "0.5*h", middle), (3, "h", f"FORCED_{rates}")):
            if self.forcing and j == 3:
                yield "force(t + h, x, p, z, out)"
                yield from (f"stage[{i}] = out[{i}]" for i in range(n, width))
            yield from (f"stage[{i}] = x[{i}] + {c}*k{j - 1}[{i}]" for i in range(n))
            if self.every_stage:
                yield f"select(t + {c}, stage, p, modes, values)"
            yield f"{name}(t + {c}, stage, p, modes, k{j})"
        for i in range(n):
            yield f"out[{i}] = x[{i}] + h/6.0*(k0[{i}] + 2.0*k1[{i}] + 2.0*k2[{i}] + k3[{i}])"
        yield "FORCED_surfaces(t + h, out, p, z, values)"
        yield from (f"out[{width + k}] = values[{k}]" for k in range(self.surfaces))

    def _here(self) -> Iterator[str]:
        """Yield code that copies the states, and computes the forcing at the time of these states."""
        yield f"here = doubles({self.width})"
        yield from (f"here[{i}] = x[{i}]" for i in range(self.n))
        if self.forcing:
            yield "force(t, x, p, z, here)"

    def _choose(self) -> Iterator[str]:
        yield from self._here()
        yield "select(t, here, p, z, out)"

    def _step(self) -> Iterator[str]:
        n, width, count = self.n, self.width, self.surfaces
        yield from self._here()
        yield f"end = doubles({width + count + 2})"
        yield from (f"end[{width + count + k}] = out[{n + count + k}]" for k in range(2))
        yield "classic(t, here, p, z, end)"
        yield from (f"out[{i}] = end[{i}]" for i in range(n))
        yield from (f"out[{n + k}] = end[{width + k}]" for k in range(count))

    def _march(self) -> Iterator[str]:
        n, width, count, components = self.n, self.width, self.surfaces, self.components
        yield from self._here()
        yield f"modes = integers({max(components, 1)})"
        yield from (f"modes[{c}] = z[{c}]" for c in range(components))
        for name in ("before", "after"):
            yield f"{name} = doubles({count + 1})"
            yield from (f"{name}[{k}] = out[{k}]" for k in range(count + 1))
        yield f"end = doubles({width + count + 2})"
        yield f"end[{width + count}] = out[{count + 1}]"
        yield f"end[{width + count + 1}] = out[{count}]"
        yield "s = t"
        yield "taken = 0"
        yield f"limit = out[{count + 2}]"
        yield "while taken < limit:"
        yield "    classic(s, here, p, modes, end)"
        ordinary = [f"end[{i}] - end[{i}] == 0.0" for i in range(n)]
        if self.rule == ZONE:
            ordinary += [
                f"(modes[{row[0]}] == {row[3]} or before[{k}]*end[{width + k}] >= 0.0)"
                for k, row in enumerate(self.table)
            ]
        yield f"    if {' and '.join(ordinary) or '0 < 1'}:"  # without states and surfaces all is ordinary
        yield "        taken = taken + 1"
        yield f"        s = s + out[{count + 1}]"
        yield f"        out[{count + 2} + taken] = s"
        yield "        select(s, end, p, modes, after)"
        yield from (f"        here[{i}] = end[{i}]" for i in range(width))
        yield from (f"        before[{k}] = after[{k}]" for k in range(count))
        if self.zeroed:
            yield f"        if {self._held('modes')}:"
            yield "            FORCED_project(s, end, p, modes, here)"
            yield "            FORCED_surfaces(s, here, p, modes, before)"
        yield from (f"        x[{n}*taken + {i}] = here[{i}]" for i in range(n))
        yield from (f"        z[{components}*taken + {c}] = modes[{c}]" for c in range(components))
        yield "    else:"
        yield "        limit = taken"
        yield from (f"out[{k}] = before[{k}]" for k in range(count))
        yield f"out[{count + 2}] = taken"


@lru_cache(maxsize=_STRUCTURES)
def step_functions(module: ModuleType, code: StepCode) -> tuple[list[Any], Any]:
    """Return the compiled step functions of a model, and an object that keeps their code in memory.

    Each is called with (t, x, p, z, out). choose sets the modes z from the state: outside eps the mode of that side;
    inside it (ZONE, Eq. 4 of the paper) the holding mode while the unknown stays within its limits, else the side to
    which it pushes. SIGN: the side alone, and the holding mode to mark an exact zero. out: surface values, eps.

    step takes a classic Runge-Kutta step in the modes z, with modes fixed or chosen at every stage. out: the state and
    the surface values at the end, h, eps.

    march takes steps and chooses modes in rows of states x and modes z, and ends before a step that is not finite or
    has to be bisected. out: surface values, eps, h, number of steps.
    """
    text = code.text()
    if not ENABLED:
        made = module_of("steps", text)
        functions = {name: compile_model_function(module, name)[0] for name in _USED}
        vars(made).update(functions, doubles=np.zeros, integers=lambda size: np.zeros(size, dtype=np.int64))
        return [compile_model_function(made, name)[0] for name in _EXPORTED], made
    path, digest = getattr(module, "__file__", None), hashlib.sha256(text.encode()).hexdigest()[:8]
    stored = None if path is None else Path(path).with_suffix(f".step-{digest}")
    return compile_series(stored, _EXPORTED, lambda: _machine_text(module, code))


def _machine_text(module: Any, code: StepCode) -> str:
    from hybridsim.engine.native.llvm import definition_in, translated

    source = module.__loader__.get_source(module.__name__)
    texts = [definition_in(source, name) for name in _USED]
    pin = _Pin(code.pin_at, float(code.zeroed))
    texts = [ast.unparse(pin.visit(python_tree(text))) for text in texts]
    forcing = _Forcing(code.n)
    forced = [
        ast.unparse(forcing.visit(python_tree(text))).replace("def ", "def forced_", 1) for text in texts
    ]
    if forcing.values:
        lines = (f"    out[{code.n + k}] = {value}\n" for k, value in enumerate(forcing.values))
        texts += [*forced, "def force(t, x, p, z, out):\n" + "".join(lines) + "    return 0"]
    whole = "\n".join([*texts, replace(code, forcing=len(forcing.values)).text()])
    return translated(whole, _EXPORTED)


class _Pin(ast.NodeTransformer):
    """Replaces one run-time value by a number in generated code."""

    def __init__(self, pin_at: int, value: float) -> None:
        self.text, self.value = f"p[{pin_at}]", value

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        return ast.Constant(self.value) if ast.unparse(node) == self.text else node


class _Forcing(ast.NodeTransformer):
    """Replaces functions of time and parameters by precomputed forcing values."""

    def __init__(self, n: int) -> None:
        self.n = n
        self.values: list[str] = []

    def visit_Call(self, node: ast.Call) -> ast.AST:
        names = {inner.id for inner in ast.walk(node) if isinstance(inner, ast.Name)}
        calls = (inner for inner in ast.walk(node) if isinstance(inner, ast.Call))
        functions = {call.func.id for call in calls if isinstance(call.func, ast.Name)}
        if names - functions not in ({"t"}, {"t", "p"}):
            return self.generic_visit(node)
        value = ast.unparse(node)
        if value not in self.values:
            self.values.append(value)
        return python_tree(f"x[{self.n + self.values.index(value)}]", mode="eval").body
