"""From a declared model to a program: angles in local time, held states, unknowns of holding modes solved for."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from hybridsim.engine.layout import SIGNAL_SLOTS, Layout
from hybridsim.engine.program import Assign, Item, Switch, ordered
from hybridsim.errors import ModelError, Place
from hybridsim.expr.symbolic import to_sympy

if TYPE_CHECKING:
    from hybridsim.expr.parse import Expression
    from hybridsim.model.model import Model


def user(name: str) -> str:
    """Name of a declared quantity inside the generated program; no internal name starts so."""
    return "v_" + name


@dataclass
class Program:
    """The lowered model: items in order, and the names under which results are found in it."""

    model: Model
    components: tuple[Any, ...]
    items: list[Item]
    derivatives: list[str]
    surfaces: list[tuple[int, str]]  # (component, name of s)
    pins: dict[int, int]  # component -> index of the state that its holding mode evaluates
    rates: list[Any]  # SymPy, parameters only
    clusters: list[list[int]]  # surface components whose unknowns act on each other's surface
    jumps: list[tuple[int, Any, Any]]  # (component, jump above, jump below)
    linear: dict[str, tuple[bool, ...]]  # component -> which of its modes have a flow linear in the states
    conditions: dict[tuple[int, int, int], tuple[Any, ...]] = field(default_factory=dict)
    layout: Layout = field(init=False)

    def __post_init__(self) -> None:
        model = self.model
        self.layout = Layout(len(model.parameters), len(model.discrete), len(self.rates), len(model.inputs))


class Lowering:
    """The steps from a `Model` to a `Program`; holds the symbol table while they run."""

    def __init__(self, model: Model) -> None:
        import sympy as sp

        self.sp = sp
        self.model = model
        self.components: tuple[Any, ...] = tuple(model.all_components())
        names = [p.name for p in model.parameters] + [s.name for s in model.states]
        names += [d.name for d in model.discrete] + [i.name for i in model.inputs]
        names += [n for n, _ in model.definitions] + ["t"]
        names += sorted({n for c in self.components for m in c.modes for n in m.set})
        names += [c.surface.unknown for c in self.components if c.surface]
        self.symbols = {n: sp.Symbol(user(n), real=True) for n in names}
        self.s = sp.Symbol("s", real=True)
        self.t = self.symbols["t"]
        self.parameters = {self.symbols[p.name] for p in model.parameters}
        self.states = [self.symbols[s.name] for s in model.states]
        self.rates: list[Any] = []
        self.effects: list[Any] = []  # of each unknown on the rate of its own surface
        self.angles = self._defined_angles()

    def _defined_angles(self) -> dict[Any, Any]:
        """Definitions that grow linearly in time, such as theta = omega*t, written out for their sine and cosine."""
        waiting = {self.symbols[n]: to_sympy(e, self.symbols) for n, e in self.model.definitions}
        found: dict[Any, Any] = {}
        while True:
            written_out = {name: e.subs(found) for name, e in waiting.items() if name not in found}
            grow = {name: e for name, e in written_out.items() if self._rate(e) is not None}
            if not grow:
                return found
            found |= grow

    def _rate(self, e: Any) -> Any:
        """de/dt where it is a parameter's worth and not zero, else None."""
        if self.t not in e.free_symbols:
            return None
        rate = self.sp.diff(e, self.t)
        return None if rate == 0 or rate.free_symbols - self.parameters else rate

    def convert(self, expression: Expression) -> Any:
        """A declared expression in SymPy, angles that grow in time written in local time."""
        sp = self.sp
        value = to_sympy(expression, self.symbols)
        if value.has(sp.I, sp.nan, sp.zoo, sp.oo):
            simplified = re.sub(rf"\b{user('')}", "", str(value))
            raise expression.error(
                f"'{expression.text}' is no finite real number: it simplifies to {simplified}",
                remedy="look for a root or a logarithm of something negative, or a division by zero.",
            )
        return self._local_angles(value)

    def _local_angles(self, e: Any) -> Any:
        sp = self.sp
        if not e.free_symbols & {self.t, *self.angles}:
            return e

        def rewrite(argument: Any, kind: Any) -> Any:
            argument = self._local_angles(argument) if argument.has(sp.sin, sp.cos, sp.tan) else argument
            written_out = argument.subs(self.angles)
            rate = self._rate(written_out)
            if rate is None:
                return kind(argument)
            argument = written_out
            if rate not in self.rates:
                self.rates.append(rate)
            phase = sp.Symbol(f"phase_{self.rates.index(rate)}", real=True)
            return kind(phase + rate * self.s + argument.subs(self.t, 0))

        for kind in (sp.sin, sp.cos, sp.tan):
            e = e.replace(kind, lambda a, k=kind: rewrite(a, k))
        return e

    def signal(self, index: int) -> Any:
        """The current piece of an input as an expression of local time."""
        sp = self.sp
        kind = self.model.inputs[index].kind
        c = [sp.Symbol(f"signal_{index}_{j}", real=True) for j in range(SIGNAL_SLOTS)]
        d = self.s - c[4]
        if kind == "table" or (kind == "wave" and self.model.inputs[index].shape != "sine"):
            return c[0] + d * (c[1] + d * (c[2] + d * c[3]))
        return c[5] + c[3] * sp.sin(c[0] + d * (c[1] + d * c[2]))

    def lower(self) -> Program:
        """Run all the steps."""
        model, sp = self.model, self.sp
        definitions = {self.symbols[n]: self.convert(e) for n, e in model.definitions}
        signals = {self.symbols[i.name]: self.signal(k) for k, i in enumerate(model.inputs)}
        der = [self.convert(s.der) for s in model.states]
        items: list[Item] = [Assign(user("t"), sp.Symbol("origin", real=True) + self.s)]
        items += [Assign(k.name, e) for k, e in (signals | definitions).items()]
        surfaces = {
            c: self._inline(self.convert(comp.surface.function), definitions | signals)
            for c, comp in enumerate(self.components)
            if comp.surface
        }
        self._check_surfaces(surfaces)
        pins = self._choose_pins(surfaces, der)
        items += self._held_states(surfaces, pins)
        items += self._mode_variables()
        unknown_items, clusters = self._unknowns(surfaces, der, definitions)
        items += unknown_items
        derivative_items, derivatives = self._derivatives(der, pins)
        items += derivative_items
        items += [Assign(f"surface_{c}", s) for c, s in surfaces.items()]
        guard_items, conditions = self._guards()
        items += guard_items
        program = Program(
            model,
            self.components,
            ordered(items),
            derivatives,
            [(c, f"surface_{c}") for c in surfaces],
            pins,
            self.rates,
            clusters,
            [self._jump(c) for c in surfaces],
            self._linear(der, definitions),
            conditions,
        )
        return program

    def _inline(self, e: Any, definitions: dict[Any, Any]) -> Any:
        while e.free_symbols & definitions.keys():
            e = e.subs(definitions)
        return e

    def _check_surfaces(self, surfaces: dict[int, Any]) -> None:
        allowed = self.parameters | set(self.states) | {self.t, self.s}
        allowed |= {self.symbols[d.name] for d in self.model.discrete}
        for c, s in surfaces.items():
            wrong = [n for n in s.free_symbols - allowed if n.name.startswith("v_")]
            if wrong:
                names = ", ".join(sorted(n.name.removeprefix("v_") for n in wrong))
                raise ModelError(
                    f"{self.components[c].name}: its relative velocity '{self._velocity(c)}' uses {names}, which "
                    "depends on a mode",
                    place=self._place(c),
                    remedy="write it over states, inputs, parameters and t",
                )

    def _velocity(self, c: int) -> str:
        """A surface's function as it was written."""
        return " ".join(str(self.components[c].surface.function.text).split())

    def _place(self, c: int) -> Place | None:
        """Where a surface's function was written."""
        component = self.components[c]
        return component.surface.function.place or component.place

    def _choose_pins(self, surfaces: dict[int, Any], der: list[Any]) -> dict[int, int]:
        """One state for each surface, with a constant coefficient in it, no two alike, no circle."""
        sp = self.sp
        fixed = set(self.states)
        choices: dict[int, list[int]] = {}
        for c, s in surfaces.items():
            found = []
            for i, x in enumerate(self.states):
                slope = sp.diff(s, x)
                if slope != 0 and not slope.free_symbols & fixed:
                    found.append((0 if abs(slope) == 1 else 1, i))
            if not found:
                raise ModelError(
                    f"{self.components[c].name}: its relative velocity '{self._velocity(c)}' is linear in no state",
                    place=self._place(c),
                    remedy="introduce the relative velocity as a state of its own",
                )
            choices[c] = [i for _, i in sorted(found)]
        chosen = self._match(list(surfaces), choices, surfaces, {})
        if chosen is None:
            raise ModelError(
                "the relative velocities of "
                + ", ".join(self.components[c].name for c in surfaces)
                + " are not independent: holding all of them at zero leaves no state for each",
                place=self._place(next(iter(surfaces))),
                remedy="merge contacts that share one relative velocity",
            )
        return chosen

    def _match(
        self, open_: list[int], choices: dict[int, list[int]], surfaces: dict[int, Any], taken: dict[int, int]
    ) -> dict[int, int] | None:
        if not open_:
            return taken if self._acyclic(taken, surfaces) else None
        for i in choices[open_[0]]:
            if i not in taken.values():
                result = self._match(open_[1:], choices, surfaces, taken | {open_[0]: i})
                if result is not None:
                    return result
        return None

    def _acyclic(self, pins: dict[int, int], surfaces: dict[int, Any]) -> bool:
        remaining = dict(pins)
        while remaining:
            free = [
                c
                for c, i in remaining.items()
                if not surfaces[c].free_symbols & {self.states[j] for d, j in remaining.items() if d != c}
            ]
            if not free:
                return False
            for c in free:
                del remaining[c]
        return True

    def _held_states(self, surfaces: dict[int, Any], pins: dict[int, int]) -> list[Item]:
        """Effective states: a held one from its constraint, every other as integrated."""
        sp = self.sp
        items: list[Item] = []
        by_state = {i: c for c, i in pins.items()}
        for i, x in enumerate(self.states):
            raw = sp.Symbol(f"raw_{i}", real=True)
            if i not in by_state:
                items.append(Assign(x.name, raw))
                continue
            c = by_state[i]
            rest = sp.expand(surfaces[c]).coeff(x, 0)
            value = sp.simplify(-rest / sp.diff(surfaces[c], x))
            held = sp.Piecewise((value, sp.Symbol("pin", real=True) > 0), (raw, True))
            component = self.components[c]
            branches = tuple(
                (Assign(x.name, held if m.name == component.surface.hold else raw),) for m in component.modes
            )
            items.append(Switch(c, branches))
        return items

    def _mode_variables(self) -> list[Item]:
        items: list[Item] = []
        for c, component in enumerate(self.components):
            unknown = component.surface.unknown if component.surface else None
            for name in sorted({n for m in component.modes for n in m.set} - {unknown}):
                branches = tuple((Assign(user(name), self.convert(m.set[name])),) for m in component.modes)
                items.append(Switch(c, branches))
        return items

    def _unknowns(
        self, surfaces: dict[int, Any], der: list[Any], definitions: dict[Any, Any]
    ) -> tuple[list[Item], list[list[int]]]:
        """Mode values of the unknowns; in a holding mode the one that keeps ds/dt = 0, solved jointly."""
        sp = self.sp
        order = list(surfaces)
        unknown = {c: self.symbols[self.components[c].surface.unknown] for c in order}
        all_unknown = set(unknown.values())
        rate: dict[int, Any] = {}
        effect: dict[tuple[int, int], Any] = {}
        for c in order:
            s = surfaces[c]
            total = sp.diff(s, self.s) + sp.diff(s, self.t)
            for x, d in zip(self.states, der, strict=True):
                slope = sp.diff(s, x)
                if slope != 0:
                    total += slope * self._inline_unknown(d, definitions, all_unknown)
            for d in order:
                effect[c, d] = sp.simplify(sp.diff(total, unknown[d]))
                if effect[c, d].free_symbols & all_unknown:
                    raise ModelError(
                        f"{unknown[d].name.removeprefix('v_')} enters the motion of "
                        f"{self.components[c].name} nonlinearly: it cannot be solved for",
                        place=self._place(c),
                        remedy="let the force enter the derivative of the velocity linearly",
                    )
            rate[c] = total.subs(dict.fromkeys(all_unknown, 0))
            self.effects.append(effect[c, c])
            if effect[c, c] == 0:
                raise ModelError(
                    f"{unknown[c].name.removeprefix('v_')} does not act on its own relative velocity "
                    f"'{self._velocity(c)}' ({self.components[c].name}): it can never hold it",
                    place=self._place(c),
                    remedy=f"use {unknown[c].name.removeprefix('v_')} in the derivative of the velocity state",
                )
        clusters = self._clusters(order, effect)
        items: list[Item] = []
        for cluster in clusters:
            items += self._solve(cluster, unknown, rate, effect)
        return items, clusters

    def _inline_unknown(self, e: Any, definitions: dict[Any, Any], unknown: set[Any]) -> Any:
        inner = {k: d for k, d in definitions.items() if self._inline(d, definitions).free_symbols & unknown}
        return self._inline(e, inner)

    def _clusters(self, order: list[int], effect: dict[tuple[int, int], Any]) -> list[list[int]]:
        clusters: list[list[int]] = []
        for c in order:
            linked = [g for g in clusters if any(effect[c, d] != 0 or effect[d, c] != 0 for d in g)]
            clusters = [g for g in clusters if g not in linked] + [
                sorted([c, *(d for g in linked for d in g)])
            ]
        return clusters

    def _solve(
        self,
        cluster: list[int],
        unknown: dict[int, Any],
        rate: dict[int, Any],
        effect: dict[tuple[int, int], Any],
    ) -> list[Item]:
        sp = self.sp
        items: list[Item] = []

        def branches(c: int, name: str, in_hold: Any, otherwise: Any) -> Switch:
            surface = self.components[c].surface
            return Switch(
                c,
                tuple(
                    (Assign(name, in_hold if m.name == surface.hold else otherwise(m)),)
                    for m in self.components[c].modes
                ),
            )

        def declared(c: int) -> Any:
            return lambda m: self.convert(m.set[self.components[c].surface.unknown])

        if len(cluster) == 1:
            c = cluster[0]
            value = -rate[c] / effect[c, c]
            if value.count_ops() < 200:
                value = sp.expand(sp.cancel(sp.together(value)))
            return [branches(c, unknown[c].name, value, declared(c))]
        # joint solve: rows of components that do not hold read "unknown = its declared value"
        matrix: dict[tuple[int, int], Any] = {}
        right: dict[int, Any] = {}
        for c in cluster:
            for d in cluster:
                if effect[c, d] == 0 and c != d:
                    continue
                name = f"effect_{c}_{d}"
                off = sp.Integer(1 if c == d else 0)
                items.append(branches(c, name, effect[c, d], lambda m, v=off: v))
                matrix[c, d] = sp.Symbol(name, real=True)
            items.append(branches(c, f"right_{c}", -rate[c], declared(c)))
            right[c] = sp.Symbol(f"right_{c}", real=True)
        items += self._eliminate(cluster, unknown, matrix, right)
        return items

    def _eliminate(
        self,
        cluster: list[int],
        unknown: dict[int, Any],
        matrix: dict[tuple[int, int], Any],
        right: dict[int, Any],
    ) -> list[Item]:
        """Gaussian elimination without exchanges (the effect of forces on accelerations is definite)."""
        sp = self.sp
        items: list[Item] = []

        def fresh(name: str, value: Any) -> Any:
            items.append(Assign(name, value))
            return sp.Symbol(name, real=True)

        for a, c in enumerate(cluster):
            for d in cluster[a + 1 :]:
                if (d, c) not in matrix:
                    continue
                factor = fresh(f"factor_{d}_{c}", matrix.pop((d, c)) / matrix[c, c])
                for e in cluster[a + 1 :]:
                    if (c, e) in matrix:
                        value = matrix.get((d, e), sp.Integer(0)) - factor * matrix[c, e]
                        matrix[d, e] = fresh(f"pivot_{a}_{d}_{e}", value)
                right[d] = fresh(f"right_{a}_{d}", right[d] - factor * right[c])
        for a in reversed(range(len(cluster))):
            c = cluster[a]
            value = right[c]
            for d in cluster[a + 1 :]:
                if (c, d) in matrix:
                    value -= matrix[c, d] * unknown[d]
            items.append(Assign(unknown[c].name, value / matrix[c, c]))
        return items

    def _derivatives(self, der: list[Any], pins: dict[int, int]) -> tuple[list[Item], list[str]]:
        items: list[Item] = []
        names = [f"d_{i}" for i in range(len(der))]
        by_state = {i: c for c, i in pins.items()}
        for i, (name, e) in enumerate(zip(names, der, strict=True)):
            state = self.model.states[i].name
            overriding = [
                c for c, comp in enumerate(self.components) if any(state in m.der for m in comp.modes)
            ]
            if i in by_state:
                overriding.append(by_state[i])
            if not overriding:
                items.append(Assign(name, e))
                continue
            if len(overriding) > 1:
                raise ModelError(
                    f"the derivative of {state} is changed by modes of both "
                    f"{' and '.join(self.components[c].name for c in overriding)}",
                    place=self.components[overriding[-1]].place,
                    remedy="let one component change it",
                )
            component = self.components[overriding[0]]
            hold = component.surface.hold if i in by_state and component.surface else None
            free = self.sp.Piecewise((0, self.sp.Symbol("pin", real=True) > 0), (e, True))
            branches = []
            for m in component.modes:
                value = self.convert(m.der[state]) if state in m.der else e
                branches.append((Assign(name, free if m.name == hold else value),))
            items.append(Switch(overriding[0], tuple(branches)))
        return items, names

    def _guards(self) -> tuple[list[Item], dict[tuple[int, int, int], tuple[Any, ...]]]:
        items: list[Item] = []
        conditions: dict[tuple[int, int, int], tuple[Any, ...]] = {}
        for c, component in enumerate(self.components):
            widest = max(len(m.guards) for m in component.modes)
            for g in range(widest):
                branches = []
                for m, mode in enumerate(component.modes):
                    if g < len(mode.guards):
                        guard = mode.guards[g]
                        value = self.convert(guard.expr)
                        conditions[c, m, g] = tuple(
                            None if choice.when is None else self.convert(choice.when)
                            for choice in guard.then
                        )
                    else:
                        value = self.sp.Integer(1)
                    branches.append((Assign(f"guard_{c}_{g}", value),))
                items.append(Switch(c, tuple(branches)))
        items += [Assign(f"monitor_{k}", self.convert(m.expr)) for k, m in enumerate(self.model.monitors)]
        return items, conditions

    def _jump(self, c: int) -> tuple[int, Any, Any]:
        """Jumps of the unknown on release, simplified so that equal limits give an exact zero."""
        sp = self.sp
        surface = self.components[c].surface

        def reduced(e: Any) -> Any:
            exact = sp.nsimplify(self.convert(e), rational=True)
            return sp.factor(sp.simplify(exact))

        return c, reduced(surface.jump_above), reduced(surface.jump_below)

    def _linear(self, der: list[Any], definitions: dict[Any, Any]) -> dict[str, tuple[bool, ...]]:
        """Which modes keep the flow linear in the states (unknowns that are solved for included)."""
        free = set(self.states) | {self.symbols[n] for c in self.components for m in c.modes for n in m.set}
        free |= {self.symbols[c.surface.unknown] for c in self.components if c.surface}

        def affine(e: Any) -> bool:
            inner = sorted(e.free_symbols & free, key=str)
            return all(not self.sp.diff(e, a).free_symbols & free for a in inner)

        base = all(affine(self._inline(d, definitions)) for d in der)
        return {
            component.name: tuple(
                base
                and all(
                    affine(self._inline(self.convert(e), definitions))
                    for e in [*m.set.values(), *m.der.values()]
                )
                for m in component.modes
            )
            for component in self.components
        } | {"": (base,)}
