"""This module warns about valid models: guards that cannot fire, jumps in a flow, missing units."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from hybridsim.errors import Place
from hybridsim.expr import Expression
from hybridsim.expr.grammar import NAME, TIME
from hybridsim.model.checks.caution import Caution
from hybridsim.model.checks.pulses import pulse_in
from hybridsim.model.laws.force_signs import wrong_reactions, wrong_signs
from hybridsim.model.laws.velocity_powers import velocity_powers
from hybridsim.model.meanings import Meanings
from hybridsim.model.parts.component import Component, Mode
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.explicit_corners import smoothing_of
from hybridsim.model.smoothing.nonsmooth import JUMPS, UNCHANGED, uses_primitives
from hybridsim.model.smoothing.one_sided import Lookup, never_negative, number_of, reached_names
from hybridsim.model.units.faults import unit_faults


def warnings_of(model: Model) -> tuple[Caution, ...]:
    """Return the warnings about a valid model; warnings about guards come first.

    Warnings concern guards and monitors that are of one sign, constant in their mode, or without units if all other
    states have units; units that disagree; pulses in t; jumps that are not treated as switching surfaces; fractional
    powers of a contact's velocity; and loads, friction forces or reactions of the wrong sign. They are based on the
    form of the expressions and their values at the start. Guards of contacts and surfaces, which the program creates,
    are not checked.
    """
    functions = tuple(_event_functions(model))
    return (
        *_of_signs(functions),
        *_of_units(model, functions),
        *unit_faults(model),
        *_of_pulses(model),
        *jumps_of(model),
        *touches_of(model),
        *_of_powers(model),
        *forces_of(model),
        *(Caution(message, contact.place, remedy) for contact, message, remedy in wrong_reactions(model)),
    )


def forces_of(model: Model) -> tuple[Caution, ...]:
    """Return warnings about loads and friction forces with the wrong sign."""
    return tuple(Caution(message, contact.place, remedy) for contact, message, remedy in wrong_signs(model))


def _of_powers(model: Model) -> Iterator[Caution]:
    for power in velocity_powers(model):
        message = (
            f"'{power.text}' in {power.where} has no Taylor series at zero velocity of contact {power.contact}; only "
            "integrators that do not locate events support it"
        )
        yield Caution(message, power.place, f"{power.remedy}, or use integrator='moreau'")


def jumps_of(model: Model) -> tuple[Caution, ...]:
    """Return warnings about jumps that are not treated as switching surfaces; runs report them too."""
    found: tuple[Caution, ...] = model.once("jumps", lambda: tuple(_of_jumps(model)))
    return found


def touches_of(model: Model) -> tuple[Caution, ...]:
    """Return warnings about monitors of functions that collisions keep from changing sign; runs report them too."""
    found: tuple[Caution, ...] = model.once("touches", lambda: tuple(_of_touches(model)))
    return found


def _of_touches(model: Model) -> Iterator[Caution]:
    if not model.monitors or model.flow is not None:
        return
    meanings = Meanings(model)
    touched = {meanings.family(one.gap.tree)[0]: one.name for one in model.impacts}
    for component in model.components:
        for mode in component.modes:
            for guard in mode.guards:  # a guard that fires and leads back to its mode is positive afterwards
                if guard.then and all(choice.to == mode.name for choice in guard.then):
                    touched.setdefault(meanings.family(guard.expr.tree)[0], component.name)
    for monitor in model.monitors:
        name = touched.get(meanings.family(monitor.expr.tree)[0])
        if name is not None:
            yield Caution(
                f"monitor {monitor.name}: '{monitor.expr.text}' only touches zero at the events of {name} and keeps "
                "its sign, so it fires only if it remains at zero",
                monitor.expr.place or monitor.place,
                f"read the times of these events, sol.event_times('{name}'), or monitor the velocity, which changes "
                "its sign",
            )


class _Flow:
    """The rates of the states of a model, with the facts that all its modes have in common."""

    def __init__(self, model: Model) -> None:
        self.model, self.components = model, model.all_components()
        self.numbers = model.parameter_values()
        self.trees = {name: expr.tree for name, expr in model.definitions}
        # for each state, the rates that modes declare, each with its component
        self.rates: dict[str, list[tuple[Component, Expression]]] = {}
        for component in self.components:
            for mode in component.modes:
                for name, rate in mode.der.items():
                    self.rates.setdefault(name, []).append((component, rate))
        self._known: dict[Expression, tuple[bool, set[str]]] = {}

    def moves(self, rate: Expression, variables: Mapping[str, Expression], lookup: Lookup) -> bool:
        """Return whether a rate is not zero in a mode with these variables."""
        known = self._known.get(rate)
        if known is None:
            is_moving = number_of(rate.tree, self.numbers, self.trees.get) != 0
            known = self._known[rate] = is_moving, reached_names(rate.tree, self.trees.get)
        if known[1].isdisjoint(variables):
            return known[0]
        return number_of(rate.tree, self.numbers, lookup) != 0

    def changing_outside(self, own: Component | None) -> set[str]:
        """Return the names that can change without a motion of the states, while a mode of a component is active."""
        found = {TIME, *(signal.name for signal in self.model.inputs)}
        found |= {name for other in self.components if other is not own for name in other.variables}
        return found | _reset_names(self.model, own)


class _Reading:
    """The definitions and variables in one mode of a component, and the quantities that vary."""

    def __init__(
        self, flow: _Flow, outside: set[str], component: Component | None, mode: Mode | None
    ) -> None:
        self.numbers, variables = flow.numbers, dict(mode.set) if mode else {}
        self._trees = flow.trees | {name: expr.tree for name, expr in variables.items()}
        self._moving = set(outside)
        for state in flow.model.states:
            own = mode.der.get(state.name, state.der) if mode else state.der
            others = (rate for owner, rate in flow.rates.get(state.name, ()) if owner is not component)
            if any(flow.moves(rate, variables, self.lookup) for rate in (own, *others)):
                self._moving.add(state.name)

    def lookup(self, name: str) -> ast.expr | None:
        """Return the tree of a definition or variable with a given name, or None."""
        return self._trees.get(name)

    def changes(self, expr: Expression) -> bool:
        """Return whether the value of an expression can change while a mode is active."""
        return not self._moving.isdisjoint(reached_names(expr.tree, self.lookup))

    def one_sided(self, expr: Expression) -> tuple[str, str] | None:
        """Return the sign that an expression cannot have ("negative" or "positive"), and the reason."""
        reason = never_negative(expr.tree, self.numbers, self.lookup)
        if reason:
            return "negative", reason
        if isinstance(expr.tree, ast.UnaryOp) and isinstance(expr.tree.op, ast.USub):
            reason = never_negative(expr.tree.operand, self.numbers, self.lookup)
        return ("positive", f"minus {reason}") if reason else None


def _reset_names(model: Model, own: Component | None) -> set[str]:
    """Return the states that resets change; resets that end the component's own mode do not count."""
    resets = [*(monitor.reset for monitor in model.monitors), *(one.reset for one in model.schedules)]
    for component in model.components:
        if component is not own:
            resets += [c.reset for mode in component.modes for guard in mode.guards for c in guard.then]
            resets += [component.limit.reset] if component.limit else []
    return {name for reset in resets for name in reset}


@dataclass(frozen=True)
class _EventFunction:
    """A guard or a monitor: its description, expression and place, and the meaning of its names."""

    what: str
    expr: Expression
    place: Place | None
    reading: _Reading
    is_guard: bool


def _event_functions(model: Model) -> Iterator[_EventFunction]:
    flow = _Flow(model)
    for component in model.components:
        outside = flow.changing_outside(component)
        for mode in component.modes:
            reading = _Reading(flow, outside, component, mode)
            for guard in mode.guards:
                what = (
                    f"guard {guard.name} of mode {mode.name}, component {component.name}: '{guard.expr.text}'"
                )
                yield _EventFunction(what, guard.expr, guard.expr.place or guard.place, reading, True)
    reading = _Reading(flow, flow.changing_outside(None), None, None)
    for monitor in model.monitors:
        what = f"monitor {monitor.name}: '{monitor.expr.text}'"
        yield _EventFunction(what, monitor.expr, monitor.expr.place or monitor.place, reading, False)


def _of_signs(functions: Sequence[_EventFunction]) -> Iterator[Caution]:
    """Yield warnings about guards and monitors that are constant or have only one sign."""
    for item in functions:
        meant = "at the end of the mode" if item.is_guard else "at the event"
        remedy = f"write an expression that changes its sign {meant}"
        if not item.reading.changes(item.expr):
            where = "in this mode, so it fires immediately or never" if item.is_guard else "and never fires"
            yield Caution(f"{item.what} is constant {where}", item.place, remedy)
        elif found := item.reading.one_sided(item.expr):
            sign, reason = found
            fires = "never fires" if item.is_guard else "fires only if it remains at zero"
            fires = "fires as soon as it is not zero" if item.is_guard and sign == "positive" else fires
            yield Caution(f"{item.what} is {reason}, never {sign}, so it {fires}", item.place, remedy)


def _of_units(model: Model, functions: Sequence[_EventFunction]) -> Iterator[Caution]:
    """Yield warnings about guards and monitors without units in a model whose other states have units.

    Discrete states are left out: they count, as often as not.
    """
    units = {state.name: state.unit for state in model.states}
    units |= {parameter.name: parameter.unit for parameter in model.parameters}
    units |= {part.name: part.unit or "1" for part in model.discrete}
    read = [(item, units.keys() & reached_names(item.expr.tree, item.reading.lookup)) for item in functions]
    bare = [(item, names) for item, names in read if names and not any(units[name] for name in names)]
    measured = [item for item, names in read if any(units[name] for name in names)]
    named = {name for _, names in bare for name in names}
    others = [state for state in model.states if state.name not in named]
    if not (measured or len(bare) == 1) or not others or not all(state.unit for state in others):
        return
    for item, names in bare:
        listed = ", ".join(sorted(names))
        yield Caution(
            f"{item.what} depends on quantities without units ({listed}), but all other states have units",
            item.place,
            f'declare a unit for {listed} (unit = "1" for pure numbers), or correct the names',
        )


def _of_pulses(model: Model) -> Iterator[Caution]:
    lookup = {name: expr.tree for name, expr in model.definitions}.get
    found: set[str] = set()
    for what, expr in _followed(model):
        pulse = pulse_in(expr.tree, lookup)
        if pulse is None or (text := ast.unparse(pulse)) in found:
            continue
        found.add(text)
        yield Caution(
            f"{what}: '{text}' is a pulse or step in t, which an integration step may miss",
            expr.place,
            "declare it as an input (table or wave), whose knots are hit exactly, or set max_step to its width",
        )


def _followed(model: Model) -> Iterator[tuple[str, Expression]]:
    """Yield every expression that is integrated or monitored, with its place."""
    for state in model.states:
        yield f"state {state.name}", state.der
    for contact in model.contacts:
        yield f"contact {contact.name}", contact.velocity
        yield f"contact {contact.name}", contact.normal
    for surface in model.surfaces:
        values = (surface.expr, *surface.above.values(), *surface.below.values())
        yield from ((f"surface {surface.name}", expr) for expr in values)
    yield from ((f"impact {impact.name}", impact.gap) for impact in model.impacts)
    for component in model.components:
        for mode in component.modes:
            where = f"mode {mode.name} of component {component.name}"
            yield from ((where, expr) for expr in (*mode.der.values(), *mode.set.values()))
            yield from ((f"guard {guard.name} of {where}", guard.expr) for guard in mode.guards)
    for monitor in model.monitors:
        yield f"monitor {monitor.name}", monitor.expr


def _of_jumps(model: Model) -> Iterator[Caution]:
    if not uses_primitives(model):
        return
    meanings, states = Meanings(model), {state.name for state in model.states}
    known = {TIME, *(signal.name for signal in model.inputs)}
    for one in smoothing_of(model).primitives:
        if one.became != UNCHANGED or not one.remark.startswith(JUMPS):
            continue
        reason = one.remark.removeprefix(f"{JUMPS}: ")
        what = f"'{one.text}' in {', '.join(one.where)}"
        names = meanings.depended_on(NAME.findall(one.text))
        in_events_only = all(where.startswith(("monitor ", "guard ")) for where in one.where)
        if names & states and not in_events_only:
            yield Caution(
                f"{what} is not treated as a switching surface ({reason}), so a run that slides along the jump "
                "becomes extremely slow",
                one.place,
                "write the rate as a sum of terms with one sign() each, or declare a switching surface "
                "([surfaces.NAME]) or, for dry friction, a contact ([contacts.NAME])",
            )
        elif names & (states | known):
            yield Caution(
                f"{what} is not treated as a switching surface ({reason}), so an integration step may miss the jump",
                one.place,
                "declare the switching quantity as an input (table or wave), use modes with guards, or set max_step "
                "to the width of the jump",
            )
