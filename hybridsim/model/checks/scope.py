"""This module stores the names of a model by kind, and the errors that the checks find."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property

from hybridsim.errors import ExpressionError, ModelError, Place, nearest
from hybridsim.expr import Expression, FunctionExpression, require_names
from hybridsim.expr.grammar import TIME
from hybridsim.model.parts.component import Component
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.inputs import HeldInput
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.quantities import Output


class Findings:
    """The errors that checks of one model find."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.errors: list[ModelError] = []

    def fail(self, part: Declared, message: str, remedy: str) -> None:
        self.errors.append(part.error(message, remedy))


class Scope(Findings):
    """The names of one model by kind, and the list of errors found by the checks."""

    def __init__(self, model: Model) -> None:
        super().__init__(model)
        # the automata of each contact; empty for a contact that could not be built
        self.made = [self._made(contact) for contact in model.contacts]
        self.components = tuple(self._expanded())

    def _made(self, contact: Contact) -> tuple[Component, ...]:
        try:
            return self.model.components_of(contact)
        except ExpressionError as fault:  # in the force, with the arguments in their places
            message = f"contact {contact.name}, law {contact.law.name}: {fault.message}"
            arguments = ", ".join(f"{name} = {value.text}" for name, value in contact.arguments.items())
            remedy = (
                f"{fault.remedy}; the arguments of the law are {arguments}" if arguments else fault.remedy
            )
            self.errors.append(ExpressionError(message, place=fault.place, remedy=remedy))
            return ()
        except ModelError as fault:
            self.errors.append(fault)
            return ()

    def _expanded(self) -> Iterator[Component]:
        """Yield all components that can be built; errors in the other components have been reported."""
        for parts in self.made:
            yield from parts
        yield from (surface.component() for surface in self.model.surfaces)
        yield from (impact.component() for impact in self.model.impacts)
        yield from self.model.components

    def unknown(self, part: Declared, what: str, name: str, known: Iterable[str], kind: str) -> None:
        """Report an unknown name, with similar known names."""
        self.fail(part, f"{what} '{name}'", nearest(name, known, kind=kind))

    @cached_property
    def kinds(self) -> dict[str, str]:
        """The kind of every quantity, for messages: ``{"k": "parameter", ...}``."""
        return {name: kind for kind, name, _ in self.declarations()}

    def declarations(self) -> Iterator[tuple[str, str, Declared]]:
        """Yield kind, name and part of all declarations that expressions can use."""
        model = self.model
        yield from (("parameter", part.name, part) for part in model.parameters)
        yield from (("state", part.name, part) for part in model.states)
        for part in model.discrete:
            yield "held input" if isinstance(part, HeldInput) else "discrete state", part.name, part
        yield from (("input", part.name, part) for part in model.inputs)
        for name, expr in model.definitions:
            yield "definition", name, Declared(place=expr.place)
        for contact in model.contacts:
            yield "contact force", contact.name, contact
        for contact, parts in zip(model.contacts, self.made, strict=True):
            for component in parts:
                for name in component.variables:
                    if name != contact.name:
                        yield f"variable of contact {contact.name}", name, component
        for surface in model.surfaces:
            yield "switching surface", surface.name, surface
            for name in surface.above:
                yield f"variable of surface {surface.name}", name, surface
        for impact in model.impacts:
            yield "normal force", impact.name, impact
        for component in model.components:
            for name in component.variables:
                yield f"variable of component {component.name}", name, component

    def is_switched(self, name: str) -> bool:
        """Return whether the value of a name depends on modes."""
        kind = self.kinds.get(name, "")
        return kind.startswith("variable") or kind in ("contact force", "switching surface", "normal force")

    @cached_property
    def changed_by_reset(self) -> tuple[str, ...]:
        changed = [part for part in self.model.discrete if not isinstance(part, HeldInput)]
        return (*(part.name for part in self.model.states), *(part.name for part in changed))

    @cached_property
    def all_names(self) -> frozenset[str]:
        return frozenset({*self.kinds, TIME})

    @cached_property
    def parameters(self) -> frozenset[str]:
        return frozenset(parameter.name for parameter in self.model.parameters)

    def need(self, expr: Expression, what: str, known: Iterable[str], *, boolean: bool = False) -> None:
        """Report unknown names, and an expression of the wrong kind (a number or a condition)."""
        allowed = frozenset(known)
        if expr.names <= allowed and (expr.is_boolean == boolean or isinstance(expr, FunctionExpression)):
            return  # the value of a function is checked when it is called
        # an output with the name of a quantity refers to that quantity, not to itself
        outputs = {output.name: output for output in self.model.outputs if output.expr.text != output.name}
        misplaced = sorted((expr.names - allowed) & (self.all_names | outputs.keys()))
        try:
            if misplaced:
                name = misplaced[0]
                if allowed >= self.all_names:
                    raise expr.error(
                        f"'{name}' is an output, which expressions cannot use", remedy=_instead(outputs[name])
                    )
                kind = "the time" if name == TIME else f"the {self.kinds.get(name, 'output')}"
                remedy = f"allowed here: {', '.join(sorted(allowed)) or 'numbers'}"
                raise expr.error(f"{kind} '{name}' cannot be used in this expression", remedy=remedy)
            self._require(expr, allowed)
            if boolean and not expr.is_boolean:
                raise expr.error(
                    f"'{expr.text}' is a number, but a condition is needed",
                    remedy="write a condition, such as 'x > 0'",
                )
            if expr.is_boolean and not boolean:
                raise expr.error(
                    f"'{expr.text}' is a condition, but a number is needed",
                    remedy="write an expression with a numeric value",
                )
        except ExpressionError as fault:
            place = fault.place or Place(text=expr.text)
            self.errors.append(ExpressionError(f"{what}: {fault.message}", place=place, remedy=fault.remedy))

    def _require(self, expr: Expression, allowed: frozenset[str]) -> None:
        """Check that every name is known; models without contacts get a hint on friction forces."""
        try:
            require_names(expr, allowed)
        except ExpressionError as fault:
            if self.model.contacts or "did you mean" in (fault.remedy or ""):
                raise
            hint = "for a friction force declare a contact of this name: hs.Contact, or [contacts.NAME] in a file"
            raise ExpressionError(
                fault.message, place=fault.place, remedy=f"{fault.remedy}; {hint}"
            ) from None

    def reached(self, expr: Expression) -> frozenset[str]:
        """Return the names that an expression depends on, including the names in its definitions."""
        definitions = dict(self.model.definitions)
        found: set[str] = set()
        open_names = set(expr.names)
        while open_names:
            name = open_names.pop()
            if name not in found:
                found.add(name)
                open_names |= definitions[name].names if name in definitions else frozenset()
        return frozenset(found)


def _instead(output: Output) -> str:
    """Return the remedy for an expression that uses the name of an output."""
    if output.modes:
        return f"write '{output.expr.text}' instead, since the output depends on the mode"
    return f"declare '{output.name}' under [definitions] (definitions=) instead; sol.output returns definitions too"
