"""This module converts a declared model to a program with held states and solved unknowns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from hybridsim.engine.lowering.affine_modes import affine_modes
from hybridsim.engine.lowering.clusters import clusters_of, normal_loads
from hybridsim.engine.lowering.elimination import eliminated
from hybridsim.engine.lowering.held_states import HeldStates
from hybridsim.engine.lowering.lowering_state import LoweringState
from hybridsim.engine.lowering.nonlinear import refuse_powers
from hybridsim.engine.lowering.products import Products
from hybridsim.engine.lowering.program import Assign, Item, Switch, changed, ordered
from hybridsim.engine.lowering.program_names import declared_name, user
from hybridsim.engine.lowering.second_order import attraction, partners
from hybridsim.engine.lowering.shared_rates import refuse_changed_rates, shared_rates
from hybridsim.engine.lowering.stop_coupling import StopCoupling, coupling_help, stop_couplings, without_share
from hybridsim.engine.series.layout import Layout
from hybridsim.errors import ModelError
from hybridsim.expr.simplify import factor_between, is_short, simplified, written_out
from hybridsim.expr.symbolic import without_distributions
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.switching import ATTRACTION


@dataclass
class Program:
    """The lowered model: program items in order, and the names of the results."""

    model: Model
    components: tuple[Any, ...]
    items: list[Item]
    derivatives: list[str]
    surfaces: list[tuple[int, str]]  # (component, name of s)
    pins: dict[int, tuple[int, ...]]  # component -> indices of the states that its holding mode evaluates
    projected: dict[int, tuple[int, ...]]  # component -> indices of the states that its holding mode projects
    rates: list[Any]  # SymPy, parameters only
    periods: dict[int, Any]  # rate -> period of the wave to which it belongs, SymPy
    clusters: list[list[int]]  # surface components whose unknowns act on each other's surface
    stop_couplings: list[StopCoupling]  # gaps with friction contacts along them
    jumps: list[tuple[int, Any, Any]]  # (component, jump above, jump below)
    linear: dict[str, tuple[bool, ...]]  # component -> whether the flow is linear in the states, by mode
    monitored: tuple[tuple[int, float] | None, ...]  # surface of each monitor, and the factor between both
    conditions: dict[tuple[int, int, int], tuple[Any, ...]] = field(default_factory=dict)
    layout: Layout = field(init=False)

    def __post_init__(self) -> None:
        model = self.model
        self.layout = Layout(len(model.parameters), len(model.discrete), len(self.rates), len(model.inputs))


class Lowering(LoweringState):
    """The steps that convert a `Model` to a `Program`."""

    def lower(self) -> Program:
        """Convert the model to a program by all steps of the lowering."""
        model, sp = self.model, self.sp
        self.definitions = definitions = {self.symbols[n]: self.convert(e) for n, e in model.definitions}
        # substituting a cycle of definitions would not end
        ordered([Assign(k.name, e) for k, e in definitions.items()])
        signals = {self.symbols[i.name]: self.signal(k) for k, i in enumerate(model.inputs)}
        der = [self.convert(s.der) for s in model.states]
        items: list[Item] = [Assign(user("t"), sp.Symbol("origin", real=True) + self.s)]
        items += [Assign(k.name, e) for k, e in (signals | definitions).items()]
        surfaces = {
            c: self.inline(self.convert(comp.surface.function), definitions | signals)
            for c, comp in enumerate(self.components)
            if comp.surface
        }
        self._check_surfaces(surfaces)
        gap_rates = self._gap_rates(surfaces, der, definitions | signals)
        self.stop_couplings = stop_couplings(self, surfaces, gap_rates)
        unknown_items, clusters = self._unknowns(surfaces | gap_rates, der, definitions)
        constraints = {(c, 0): s for c, s in surfaces.items() if c not in self.never_held}
        held = HeldStates(self, constraints | {(c, 1): rate for c, rate in gap_rates.items()})
        items += held.items()
        items += self._mode_variables()
        items += unknown_items
        derivative_items, derivatives = self._derivatives(der, held)
        turning_items, derivatives = held.turned(derivatives)
        items += derivative_items + turning_items
        items += [Assign(f"surface_{c}", s) for c, s in surfaces.items()]
        guard_items, conditions = self._guards()
        items += guard_items
        self._count_phases()
        program = Program(
            model,
            self.components,
            [changed(item, without_distributions) for item in ordered(items)],
            derivatives,
            [(c, f"surface_{c}") for c in surfaces],
            held.by_component(held.pins),
            held.by_component(held.projected),
            self.rates,
            self.periods,
            clusters,
            self.stop_couplings,
            [self._jump(c) for c in surfaces],
            affine_modes(self, der, definitions, surfaces),
            tuple(
                multiple_of(self.inline(self.convert(m.expr), definitions | signals), surfaces)
                for m in model.monitors
            ),
            conditions,
        )
        return program

    def _gap_rates(
        self, surfaces: dict[int, Any], der: list[Any], definitions: dict[Any, Any]
    ) -> dict[int, Any]:
        """Return the rates of the gaps of unilateral contacts, by component, as functions of the states."""
        found: dict[int, Any] = {}
        for c, s in surfaces.items():
            if not self.components[c].surface.is_unilateral:
                continue
            slopes = self.gradient(s).items()
            rate = self._rate_in_time(s) + sum(a * self.inline(der[i], definitions) for i, a in slopes)
            wrong = sorted(map(declared_name, self._foreign(rate)))
            if wrong or rate == 0:
                fault = f"uses {', '.join(wrong)}, which depends on a mode" if wrong else "is zero"
                raise ModelError(
                    f"impact {self.components[c].name}: the rate of its gap '{self.written(c)}' {fault}",
                    place=self.place(c),
                    remedy="write the gap with positions, whose rates do not depend on forces",
                )
            found[c] = rate
        return found

    def _rate_in_time(self, s: Any) -> Any:
        """Return the rate of an expression in time at constant states."""
        return self.sp.diff(s, self.s) + self.sp.diff(s, self.t)

    def _check_surfaces(self, surfaces: dict[int, Any]) -> None:
        for c, s in surfaces.items():
            if wrong := self._foreign(s):
                names = ", ".join(sorted(map(declared_name, wrong)))
                raise ModelError(
                    f"{self.components[c].name}: the {self.title(c)} '{self.written(c)}' uses {names}, which "
                    "depends on a mode",
                    place=self.place(c),
                    remedy="use only states, inputs, parameters and t in this function",
                )

    def _foreign(self, e: Any) -> list[Any]:
        """Return those names in an expression that have different values in different modes."""
        allowed = self.parameters | set(self.states) | {self.t, self.s}
        allowed |= {self.symbols[d.name] for d in self.model.discrete}
        return [n for n in e.free_symbols - allowed if n.name.startswith("v_")]

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
        """Return the values of the unknown forces in each mode; holding modes keep their surfaces at zero."""
        sp = self.sp
        order = list(surfaces)
        unknown = {c: self.symbols[self.components[c].surface.unknown] for c in order}
        self.held_rates, self.unknown = surfaces, unknown
        refuse_changed_rates(self, surfaces)
        all_unknown = set(unknown.values())
        blends = self._blends()
        rate: dict[int, Any] = {}
        effect: dict[tuple[int, int], Any] = {}
        self.effect = effect
        self.products = products = Products(self, unknown)
        totals: dict[int, Any] = {}
        acting = self._acting(definitions | blends, all_unknown)
        for c in order:
            totals[c] = self._rate_in_time(surfaces[c])
            for i, slope in self.gradient(surfaces[c]).items():
                totals[c] += slope * self.inline(der[i], acting)
        for c in order:
            acts, row = totals[c].free_symbols, dict.fromkeys(order, sp.Integer(0))
            row |= {d: simplified(sp.diff(totals[c], u)) for d, u in unknown.items() if u in acts}
            row, rate[c] = products.linear(c, totals, row)
            effect |= {(c, d): slope for d, slope in row.items()}
            self.effects.append(effect[c, c])
            if effect[c, c] == 0:
                if not self.components[c].surface.unique:
                    raise ModelError(
                        f"the force {declared_name(unknown[c])} does not act on the {self.title(c)} "
                        f"'{self.written(c)}' ({self.components[c].name}), and so cannot keep it at zero",
                        place=self.place(c),
                        remedy=f"write {declared_name(unknown[c])} with opposite signs in the rates of both velocities",
                    )
                self.never_held.add(c)
        self.partners = partners(self, surfaces, rate, effect)
        self.never_held -= self.partners.keys()
        self.open_rates = [self.inline(d, acting) for d in der]
        switching = {c: u for c, u in unknown.items() if self.components[c].surface.unique}
        if switching:
            refuse_powers(self, switching, self.open_rates)
        loads = normal_loads(self, unknown, definitions)
        clusters = clusters_of(order, effect, {*loads, *products.known})
        items: list[Item] = products.items()
        for cluster in clusters:
            items += self._solve(cluster, unknown, rate, effect, loads)
        for c in order:
            if c in self.partners:
                items.append(attraction(self, c, self.partners[c], effect))
            elif self.components[c].surface.unique:
                pull = sp.Integer(-1) if c in self.never_held else products.not_together(c, -effect[c, c])
                items.append(Assign(user(ATTRACTION + self.components[c].surface.unknown), pull))
        return items, clusters

    def _blends(self) -> dict[Any, Any]:
        """Return formulas, valid in all modes, of the variables that surfaces set."""
        found: dict[Any, Any] = {}
        for component in self.components:
            if component.surface and component.surface.unique:
                hold = component.mode(component.surface.hold)
                found |= {self.symbols[n]: self.convert(e) for n, e in hold.set.items()}
        return found

    def _acting(self, definitions: dict[Any, Any], unknown: set[Any]) -> dict[Any, Any]:
        """Return the definitions that depend on unknown forces."""
        return {k: d for k, d in definitions.items() if self.inline(d, definitions).free_symbols & unknown}

    def _solve(
        self,
        cluster: list[int],
        unknown: dict[int, Any],
        rate: dict[int, Any],
        effect: dict[tuple[int, int], Any],
        loads: dict[tuple[int, int], dict[str, Any]],
    ) -> list[Item]:
        sp = self.sp
        items: list[Item] = []

        branches = self.in_modes
        if len(cluster) == 1:
            c = cluster[0]
            if c in self.never_held:
                return [branches(c, unknown[c].name, sp.Integer(0))]
            value = -rate[c] / effect[c, c]
            if value.count_ops() < 200 and is_short(value):
                value = written_out(value)
            value = value.xreplace(
                {sp.zoo: sp.nan}
            )  # a sign in the effect is zero: the surface cannot be held
            return [branches(c, unknown[c].name, value)]
        # joint solve: rows of components that do not hold read "unknown = its declared value", less the part from
        # normal forces among the unknowns. The row of a component that can never hold sets its unknown to 0.
        matrix: dict[tuple[int, int], Any] = {}
        right: dict[int, Any] = {}
        for c in cluster:
            zero_unknowns = {unknown[d]: 0 for d in cluster if (c, d) in loads}
            partner = self.partners.get(c)
            for d in cluster:
                by_mode = loads.get((c, d), {})
                entry = partner.share(c, d, sp) if partner else effect[c, d]
                entry = self.products.diagonal(c, entry) if c == d and not partner else entry
                if entry == 0 and c != d and not by_mode:
                    continue
                name = f"effect_{c}_{d}"
                off = {m.name: -by_mode.get(m.name, sp.Integer(0)) for m in self.components[c].modes}
                off = dict.fromkeys(off, sp.Integer(1)) if c == d else off
                held = off[self.components[c].surface.hold] if c in self.never_held else entry
                more, held = without_share(
                    self, self.stop_couplings, c, d, held, sp.Integer(1 if c == d else 0)
                )
                items += more
                items.append(branches(c, name, held, off))
                matrix[c, d] = sp.Symbol(name, real=True)
            hold = sp.Integer(0) if c in self.never_held or partner else -rate[c]
            more, hold = without_share(self, self.stop_couplings, c, -1, hold, sp.Integer(0))
            items += more
            items.append(branches(c, f"right_{c}", hold, without=zero_unknowns))
            right[c] = sp.Symbol(f"right_{c}", real=True)
        return items + eliminated(cluster, unknown, matrix, right)

    def _derivatives(self, der: list[Any], held: HeldStates) -> tuple[list[Item], list[str]]:
        items: list[Item] = []
        names = [f"d_{i}" for i in range(len(der))]
        for i, (name, e) in enumerate(zip(names, der, strict=True)):
            state = self.model.states[i].name
            for c, rate in shared_rates(self, i, der, held):
                component, replacement = self.components[c], self.sp.Symbol(f"kinematic_rate_{c}", real=True)
                branches = [rate if m.name == component.surface.hold else e for m in component.modes]
                items.append(Switch(c, tuple((Assign(replacement.name, value),) for value in branches)))
                e = replacement
            overriding = [
                c for c, comp in enumerate(self.components) if any(state in m.der for m in comp.modes)
            ]
            holding = held.holding(i)
            overriding += holding[:1]
            if not overriding:
                items.append(Assign(name, e))
                continue
            if len(overriding) > 1:
                raise ModelError(
                    f"modes of {' and '.join(self.components[c].name for c in overriding)} both change the "
                    f"derivative of {state}",
                    place=self.components[overriding[-1]].place,
                    remedy=f"change the derivative of {state} in the modes of one component only",
                )
            free = self.sp.Piecewise((0, self.sp.Symbol("pin", real=True) > 0), (e, True))
            for c in holding or overriding:  # components that hold the same state never do so together
                component = self.components[c]
                hold = component.surface.hold if holding else None
                target = name if c == (holding or overriding)[-1] else f"{name}_{c}"
                branches = []
                for m in component.modes:
                    value = self.convert(m.der[state]) if state in m.der else e
                    branches.append((Assign(target, free if m.name == hold else value),))
                items.append(Switch(c, tuple(branches)))
                e = self.sp.Symbol(target, real=True)
        return items, names

    def _guards(self) -> tuple[list[Item], dict[tuple[int, int, int], tuple[Any, ...]]]:
        items: list[Item] = []
        conditions: dict[tuple[int, int, int], tuple[Any, ...]] = {}
        for c, component in enumerate(self.components):
            widest = max(len(m.guards) for m in component.modes)
            helping, most = coupling_help(self, self.stop_couplings, c, self.effect)
            items += helping
            for g in range(widest):
                branches = []
                for m, mode in enumerate(component.modes):
                    if g < len(mode.guards):
                        guard = mode.guards[g]
                        value = self.convert(guard.expr)
                        if helping and mode.name == component.surface.hold:
                            value += most
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

    def _count_phases(self) -> None:
        """Convert all resets and outputs, because the frequencies in them must be known before phases are numbered."""
        choices = [c for k in self.components for m in k.modes for g in m.guards for c in g.then]
        choices += [k.limit for k in self.components if k.limit]
        for part in (*choices, *self.model.monitors, *self.model.schedules):
            for e in part.reset.values():
                self.convert(e)
        for output in self.model.outputs:
            for e in (output.expr, *output.modes.values()):
                self.convert(e)

    def _jump(self, c: int) -> tuple[int, Any, Any]:
        """Return the jumps of an unknown on release, simplified so that equal limits give exactly zero."""
        sp = self.sp
        surface = self.components[c].surface

        def reduced(e: Any) -> Any:
            return simplified(sp.nsimplify(self.convert(e), rational=True))

        return c, reduced(surface.jump_above), reduced(surface.jump_below)


def multiple_of(e: Any, surfaces: dict[int, Any]) -> tuple[int, float] | None:
    """Return the component whose surface function times a number is an expression, with this number, or None."""
    for c, surface in surfaces.items():
        if (factor := factor_between(e, surface)) is not None:
            return c, factor
    return None
