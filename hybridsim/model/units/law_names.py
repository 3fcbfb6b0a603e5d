"""This module determines the units of the names of a friction law in one contact, and lists the law's expressions.

A parameter has the unit that the law declares. Without a declaration it has the unit of the value that the contact
passes, and a value that is only a number is inserted into the expressions.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping

from hybridsim.errors import Place
from hybridsim.expr import Expression, parse, substitute
from hybridsim.expr.evaluate import dependency_order
from hybridsim.expr.rebuild import rebuilt, with_names
from hybridsim.expr.write import write
from hybridsim.model.laws.law import FORCE, INDEX, LOAD_RATE, NORMAL, SPEED
from hybridsim.model.library import is_packaged
from hybridsim.model.parts.component import Mode
from hybridsim.model.parts.contact import Contact
from hybridsim.model.smoothing.one_sided import names_of
from hybridsim.model.units.infer import Inference
from hybridsim.model.units.parse import read_unit
from hybridsim.model.units.quantities import Quantities
from hybridsim.model.units.unit import Unit

Formula = tuple[str, Expression, Unit | None, str]
"""The name of an expression of a law, the expression, the required unit, and the place that requires it."""

_SLIP, _STICK = ("slip", "slip_backward"), ("stick", "stick_backward")


class LawNames:
    """The units of the names in the expressions of the friction law of one contact."""

    def __init__(self, known: Quantities, contact: Contact) -> None:
        self.known, self.contact, law = known, contact, contact.law
        self.is_packaged = is_packaged(law)
        self.values = contact.values()
        self.numbers: dict[str, Expression] = {}  # values that are inserted
        self.units: dict[str, Unit] = {}
        self.parameters: set[str] = set()
        self.passed: set[str] = set()  # names whose units follow from values that the contact passes
        if law.copies is not None:
            self.numbers[INDEX] = parse(1)
        self._add(SPEED, contact.velocity)
        self._add(NORMAL, contact.normal)
        if NORMAL in self.units and known.time is not None:
            self.units[LOAD_RATE] = self.units[NORMAL] / known.time
        for name in law.parameters:
            if name in law.units:
                self._set(name, read_unit(law.units[name]))
                self.parameters.add(name)
            elif self.values[name].is_number:
                self.numbers[name] = self.values[name]
            else:
                self._add(name, self.values[name])
                self.passed.add(name)
        for table in law.tables:
            self._set(table.name, known.units.get(contact.variable(table.name)))
        for state in law.states:
            self._set(state.name, known.units.get(self.state(state.name)))
        for name in dependency_order(dict(law.definitions), f"definitions of the law '{law.name}'"):
            self._define(name, law.definitions[name])

    def _set(self, name: str, unit: Unit | None) -> None:
        if unit is not None:
            self.units[name] = unit

    def _add(self, name: str, expr: Expression) -> None:
        """Add a name of the law with the unit of an expression of the model."""
        inference = self.known.inference()
        self._set(name, inference.unit(expr.tree))
        if inference.has_parameter(expr.tree):
            self.parameters.add(name)

    def _define(self, name: str, expr: Expression) -> None:
        number = substitute(expr, self.numbers)
        if number.is_number:
            self.numbers[name] = number
            return
        inference = self.inference()
        self._set(name, inference.unit(self.tree(expr)))
        if inference.has_parameter(expr.tree):
            self.parameters.add(name)
        if expr.names & self.passed:
            self.passed.add(name)

    def inference(self) -> Inference:
        """Return a new inference of units for expressions of the law."""
        return Inference(self.units, self.parameters)

    def unit(self, node: ast.expr) -> Unit | None:
        """Return the unit of a part of an expression of the law, or None."""
        return self.inference().unit(node)

    def state(self, name: str) -> str:
        """Return the name that a state of the law, or its first copy, has in the model."""
        return self.contact.variable(name) + ("1" if self.contact.law.copies else "")

    def tree(self, expr: Expression) -> ast.expr:
        """Return the tree of an expression with its numbers inserted; all parts keep their columns."""
        return _with_numbers(expr.tree, self.numbers)

    def forces(self) -> Iterator[tuple[str, Expression]]:
        """Yield the name and expression of each force of the law."""
        law = self.contact.law
        for name in (*_SLIP, *_STICK, FORCE):
            if (expr := getattr(law, name)) is not None:
                yield name.replace("_", " "), expr
        for mode in law.modes:
            if FORCE in mode.set:
                yield f"{FORCE} in {mode.name}", mode.set[FORCE]

    def formulas(self) -> Iterator[Formula]:
        """Yield all expressions of the law, each with the required unit."""
        law, force = self.contact.law, self.known.units.get(self.contact.name)
        for name, value in law.parameters.items():
            if value is not None and name not in self.contact.arguments:
                yield f"default of {name}", value, self.units.get(name), name
        yield from ((f"definition {name}", expr, None, "") for name, expr in law.definitions.items())
        for table in law.tables:
            for field, argument in (("over", table.over), ("across", table.across)):
                if argument is not None:
                    yield f"table {table.name}, {field}", argument, None, ""
            for value in table.expressions():
                yield f"table {table.name}, values", value, self.units.get(table.name), table.name
        yield from ((name, expr, force, self.contact.name) for name, expr in self.forces())
        for state in law.states:
            yield f"start of {state.name}", state.start, self.units.get(state.name), state.name
            yield self._rate(f"rate of {state.name}", state.der, state.name)
        for mode in law.modes:
            yield from self._of_mode(mode)

    def _rate(self, what: str, expr: Expression, state: str) -> Formula:
        return what, expr, self.known.rate(self.state(state)), f"the rate of {state}"

    def _of_mode(self, mode: Mode) -> Iterator[Formula]:
        for name, expr in mode.der.items():
            yield self._rate(f"rate of {name} in {mode.name}", expr, name)
        for guard in mode.guards:
            yield f"guard {guard.name} of {mode.name}", guard.expr, None, ""
            for choice in guard.then:
                if choice.when is not None:
                    yield f"guard {guard.name} of {mode.name}, when", choice.when, None, ""
                for name, expr in choice.reset.items():
                    yield f"reset of {name} in {mode.name}", expr, self.units.get(name), name

    def text(self, node: ast.expr, expr: Expression) -> str:
        """Return the text of a part of an expression.

        A law of the package is shown with the values of the contact, any other law as it is written.
        """
        if self.is_packaged:
            return write(with_names(node, self._trees))
        column, end = getattr(node, "col_offset", None), getattr(node, "end_col_offset", None)
        return write(node) if column is None or end is None else expr.text[column:end]

    @property
    def _trees(self) -> Mapping[str, ast.expr]:
        states = {state.name: parse(self.state(state.name)) for state in self.contact.law.states}
        values = {SPEED: self.contact.velocity, **self.values, **states}
        return {name: value.tree for name, value in values.items()}

    def place(self, expr: Expression, term: ast.expr, required: Unit) -> Place | None:
        """Return the place of a part of an expression whose unit differs from the required one.

        If the unit of a whole force is the unit of the load, it is the place of the load. For a law of the package it
        is the place of a value that the contact passes.
        """
        contact = self.contact
        if write(term) == write(self.tree(expr)) and self._is_of_load(term, required):
            return contact.normal.error("", node=contact.normal.tree).place
        if not self.is_packaged:
            return expr.error("", node=term).place
        tree = with_names(self.tree(expr), self._trees)
        text, part = write(tree), self.text(term, expr)
        used = [contact.arguments[name] for name in sorted(names_of(term)) if name in contact.arguments]
        candidates = [value.place for value in (*used, *contact.arguments.values()) if value.place]
        where = candidates[0] if candidates else contact.place or Place()
        return where.at(text, text.find(part) if part in text else None)

    def _is_of_load(self, node: ast.expr, required: Unit) -> bool:
        """Return whether a force is a pure number times a load whose unit differs from the required one."""
        load, unit = self.units.get(NORMAL), self.unit(node)
        return (
            load is not None and unit is not None and bool(load.differs(required)) and not unit.differs(load)
        )

    def passed_values(self, nodes: Iterator[ast.expr]) -> list[str]:
        """Return the values in some parts of expressions whose units come from the contact, such as "c = k"."""
        names = sorted(set().union(*(names_of(node) for node in nodes)) & self.passed)
        return [f"{name} = {self.values[name].text}" for name in names if name in self.values]


def _with_numbers(node: ast.expr, numbers: Mapping[str, Expression]) -> ast.expr:
    """Return a tree in which names are replaced by numbers; all other parts keep their columns."""
    if isinstance(node, ast.Name):
        return numbers[node.id].tree if node.id in numbers else node
    return ast.copy_location(rebuilt(node, lambda part: _with_numbers(part, numbers)), node)
