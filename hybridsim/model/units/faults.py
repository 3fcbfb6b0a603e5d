"""This module finds the expressions whose units disagree, writes the warnings, and lists the known units."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hybridsim.expr import parse
from hybridsim.expr.grammar import TIME
from hybridsim.model.checks.caution import Caution
from hybridsim.model.parts.model import Model
from hybridsim.model.units.infer import Disagreement
from hybridsim.model.units.parse import read_unit, write_unit
from hybridsim.model.units.quantities import Quantities
from hybridsim.model.units.seconds import SECOND
from hybridsim.model.units.statements import Statement, statements_of
from hybridsim.model.units.unit import Unit
from hybridsim.model.units.votes import quantities_of

_NUMBER = parse(0)
HEADER = ("what", "unit", "how it is known")
DECLARED, INFERRED, UNKNOWN, AGREES, DISAGREES = "declared", "inferred", "unknown", "agrees", "disagrees"

_COPY = re.compile(r"(?<=\w)\d+(?=\.[A-Za-z_])")  # the number of a copy in a name such as block12.x


@dataclass(frozen=True)
class UnitOfExpression:
    """The unit of one expression, the reasons if the unit is unknown, and the warnings of this expression."""

    statement: Statement
    unit: Unit | None
    unknown: tuple[str, ...]
    cautions: tuple[Caution, ...]
    agrees: bool


def unit_faults(model: Model) -> Iterator[Caution]:
    """Yield a warning for each expression of a model in which two known units disagree."""
    known = quantities_of(model)
    if known is not None:
        yield from _times_of_inputs(model, known)
        for expression in units_of_expressions(model, known):
            yield from expression.cautions


def _times_of_inputs(model: Model, known: Quantities) -> Iterator[Caution]:
    """Yield a warning for each input whose times were converted to seconds, if t has another unit."""
    if known.time is not None and known.time.differs(SECOND):
        for signal in model.inputs:
            if signal.time_unit is not None:
                message = f"{signal.subject}: its times are in s, but t is in {write_unit(known.time, known.labels)}"
                yield Caution(
                    message, signal.place, "remove 'time_unit', and write the times in the unit of t"
                )


def units_of_expressions(model: Model, known: Quantities) -> Iterator[UnitOfExpression]:
    """Yield the unit of each expression of a model.

    A warning is given once for each line, and for the first copy of a repeated part. A warning that follows from a
    value that a contact passes to its friction law is given for the first expression of the law.
    """
    reported: set[tuple[str, str]] = set()
    for statement in statements_of(model, known):
        law, tree = statement.law, statement.tree
        inference = known.inference(statement.counts) if law is None else law.inference()
        unit = inference.unit(tree)
        found = list(inference.disagreements)
        if unit is not None and statement.required is not None and unit.differs(statement.required):
            found.append(Disagreement(tree, unit, statement.required, statement.because))
        cautions = []
        for one in found:
            passed = [] if law is None else law.passed_values(_terms(one))
            caution = _caution(statement, one, known, passed)
            text = (
                _COPY.sub("", caution.message.partition(": ")[2]) if law is None else statement.text(one.term)
            )
            is_passed = law is not None and (law.is_packaged or bool(passed))
            where = "" if is_passed else _line_of(caution) or statement.what
            if (where, text) not in reported:
                cautions.append(caution)
            reported |= {(where, text), ("", text)}
        yield UnitOfExpression(statement, unit, tuple(inference.unknown), tuple(cautions), not found)


def _terms(found: Disagreement) -> Iterator[ast.expr]:
    yield found.term
    if isinstance(found.because, ast.expr):
        yield found.because


def _caution(statement: Statement, found: Disagreement, known: Quantities, passed: Sequence[str]) -> Caution:
    """Return the warning about a disagreement; `passed` lists values of a contact that it depends on."""
    own, required = (write_unit(unit, known.labels) for unit in (found.unit, found.required))
    because = found.because if isinstance(found.because, str) else f"'{statement.text(found.because)}'"
    message = (
        f"{statement.what}: '{statement.text(found.term)}' {_is_in(own)}, but {because} {_is_in(required)}"
    )
    if statement.law is None:
        place = statement.expr.error(message, node=found.term).place
    else:
        place = statement.law.place(statement.expr, found.term, found.required)
    remedy = "correct the expression or a unit; a constant with a unit is declared in [parameters]"
    if passed:
        remedy = f"correct the expression, a unit, or a value that the contact passes: {', '.join(passed)}"
    if found.unit.differs(found.required) != "dimension":
        ratio = "/".join(f"({text})" if "/" in text or " " in text else text for text in (required, own))
        factor = found.unit.factor(found.required)
        remedy = (
            "units are not converted: use one unit, or multiply by a parameter that converts, "
            f'{{ value = {factor:.9g}, unit = "{ratio}" }}'
        )
    return Caution(message, place, remedy)


def _line_of(caution: Caution) -> str:
    """Return the file and line of a warning, or an empty string for a model in Python."""
    place = caution.place
    return f"{place.file}:{place.line}" if place and place.line is not None else ""


def _is_in(unit: str) -> str:
    return "is a pure number" if unit == "1" else f"is in {unit}"


def unit_rows(model: Model) -> Iterator[tuple[str, str, str]]:
    """Yield the title, the unit and the source of the unit of each quantity, then of each expression.

    Expressions that are only numbers are left out.
    """
    known = quantities_of(model)
    if known is None:
        return
    yield from _quantities(model, known)
    for expression in units_of_expressions(model, known):
        what, expr = expression.statement.what, expression.statement.expr
        if expr.is_constant:
            continue
        if expression.unit is None and expression.agrees:
            yield what, "", f"{UNKNOWN}: {'; '.join(dict.fromkeys(expression.unknown))}"
        else:
            unit = "" if expression.unit is None else write_unit(expression.unit, known.labels)
            yield what, unit, AGREES if expression.agrees else DISAGREES


def _quantities(model: Model, known: Quantities) -> Iterator[tuple[str, str, str]]:
    names = [
        part.name for kind in (model.parameters, model.states, model.discrete, model.inputs) for part in kind
    ]
    for name in dict.fromkeys((TIME, *names, *dict(model.definitions), *model.variables())):
        text = known.texts.get(name, "")
        if name not in known.units:
            yield name, text, f"{UNKNOWN}: this text is not a known unit" if text else UNKNOWN
        elif text and name not in known.inferred:
            yield name, text, DECLARED
        else:
            yield name, write_unit(known.units[name], known.labels), INFERRED
    for contact in model.contacts:
        for name, text in contact.law.units.items():
            if contact.arguments.get(name, _NUMBER).is_constant and name in contact.law.parameters:
                known_text = DECLARED if read_unit(text) else f"{UNKNOWN}: this text is not a known unit"
                yield f"contact {contact.name}, law {contact.law.name}, {name}", text, known_text
