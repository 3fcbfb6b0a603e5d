"""This module finds the expressions whose units disagree, writes the warnings, and lists the known units."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from hybridsim.expr.grammar import TIME
from hybridsim.expr.write import write
from hybridsim.model.checks.caution import Caution
from hybridsim.model.parts.model import Model
from hybridsim.model.units.infer import Disagreement
from hybridsim.model.units.parse import write_unit
from hybridsim.model.units.quantities import Quantities
from hybridsim.model.units.seconds import SECOND
from hybridsim.model.units.statements import Statement, statements_of
from hybridsim.model.units.unit import Unit
from hybridsim.model.units.votes import quantities_of

HEADER = ("what", "unit", "how it is known")
DECLARED, INFERRED, UNKNOWN, AGREES, DISAGREES = "declared", "inferred", "unknown", "agrees", "disagrees"

_COPY = re.compile(r"(?<=\w)\d+(?=\.[A-Za-z_])")  # the number of a copy in a name such as block12.x


@dataclass(frozen=True)
class UnitOfExpression:
    """The unit of one expression, with the reasons if it is unknown, and the disagreements in it."""

    statement: Statement
    unit: Unit | None
    unknown: tuple[str, ...]
    cautions: tuple[Caution, ...]


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

    A warning is given once for each line, and for the first copy of a repeated part. In the expressions of a friction
    law it is left out if an argument of the law or another expression of the law has it.
    """
    reported: set[tuple[str, str]] = set()
    for statement in statements_of(model, known):
        inference = known.inference(statement.counts)
        unit = inference.unit(statement.expr.tree)
        found = list(inference.disagreements)
        if unit is not None and statement.required is not None and unit.differs(statement.required):
            found.append(Disagreement(statement.expr.tree, unit, statement.required, statement.because))
        cautions = []
        for caution in (_caution(statement, one, known) for one in found):
            text = _COPY.sub("", caution.message.partition(": ")[2])
            where = "" if statement.is_of_law else _line_of(caution) or statement.what
            if (where, text) not in reported:
                cautions.append(caution)
            reported |= {(where, text), ("", text)}
        yield UnitOfExpression(statement, unit, tuple(inference.unknown), tuple(cautions))


def _caution(statement: Statement, found: Disagreement, known: Quantities) -> Caution:
    own, required = (write_unit(unit, known.labels) for unit in (found.unit, found.required))
    message = f"{statement.what}: '{write(found.term)}' {_is_in(own)}, but {found.because} {_is_in(required)}"
    node = None if statement.is_of_law else found.term
    remedy = "correct the expression or a unit; a constant with a unit is declared in [parameters]"
    if found.unit.differs(found.required) != "dimension":
        ratio = "/".join(f"({text})" if "/" in text or " " in text else text for text in (required, own))
        factor = found.unit.factor(found.required)
        remedy = (
            "units are not converted: use one unit, or multiply by a parameter that converts, "
            f'{{ value = {factor:.9g}, unit = "{ratio}" }}'
        )
    return Caution(message, statement.expr.error(message, node=node).place, remedy)


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
        if expression.unit is None and not expression.cautions:
            yield what, "", f"{UNKNOWN}: {'; '.join(dict.fromkeys(expression.unknown))}"
        else:
            unit = "" if expression.unit is None else write_unit(expression.unit, known.labels)
            yield what, unit, DISAGREES if expression.cautions else AGREES


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
