"""Units of what a model names, as they were declared; of a contact force from the load that presses it."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hybridsim.expr import Expression
    from hybridsim.model.contact import Contact
    from hybridsim.model.model import Model


_COUNT = 4  # numbers up to this, halves and quarters included, are taken to have no unit


def units_of(model: Model) -> dict[str, str]:
    """Names of states, outputs, contact forces, discrete states and inputs, in that order, with their units."""
    units = {state.name: state.unit for state in model.states} | {o.name: o.unit for o in model.outputs}
    rest = dict.fromkeys((contact.name for contact in model.contacts), "")
    if missing := [contact for contact in model.contacts if contact.name not in units]:
        rest |= _of_forces(model, missing)
    rest |= {d.name: d.unit for d in model.discrete} | {declared.name: "" for declared in model.inputs}
    return units | {name: unit for name, unit in rest.items() if name not in units}


def unit_of(model: Model, expression: Expression) -> str:
    """The unit of an expression of a model, where it is that of one of its parts; else empty."""
    units = units_of(model) | {q.name: q.unit for q in model.parameters}
    return _unit(expression.tree, units, {name: e.tree for name, e in model.definitions})


def rate_of(unit: str, time: str, order: int) -> str:
    """The unit of a derivative with respect to time."""
    if not unit or not time or order == 0:
        return unit
    known = re.fullmatch(rf"(.*)/{re.escape(time)}(?:\^(\d+))?", unit)
    base, power = (known.group(1), order + int(known.group(2) or 1)) if known else (unit, order)
    return f"{base}/{time}" if power == 1 else f"{base}/{time}^{power}"


def _of_forces(model: Model, contacts: list[Contact]) -> dict[str, str]:
    """Of each friction force that of its load, coefficients having none; where that is a number, of a coefficient."""
    known = {q.name: q.unit for q in model.states} | {q.name: q.unit for q in model.parameters}
    known |= {q.name: q.unit for q in model.discrete}
    definitions = {name: expression.tree for name, expression in model.definitions}
    found = {}
    for contact in contacts:
        unit = _unit(contact.normal.tree, known, definitions)
        if not contact.normal.names:
            coefficients = [e for name, e in contact.arguments.items() if name.startswith("mu")]
            unit = next((u for e in coefficients if (u := _unit(e.tree, known, definitions))), "")
        found[contact.name] = unit
    return found


def _unit(node: ast.expr, known: Mapping[str, str], definitions: Mapping[str, ast.expr]) -> str:
    """The unit of an expression where it is that of one of its parts; "" where units would have to be multiplied.

    A number that multiplies may have a unit of its own, which nothing tells: 9.81*m is no mass. Up to 4, halves and
    quarters included, it is taken for a share or a count: 0.5*N is a load.
    """

    def of(part: ast.expr) -> str:
        return _unit(part, known, definitions)

    match node:
        case ast.Name(id=name):
            unit = of(definitions[name]) if name in definitions else known.get(name, "")
            return "" if unit == "1" else unit
        case ast.UnaryOp(operand=operand):
            return of(operand)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            return of(left) or of(right)
        case ast.BinOp(op=ast.Mult() | ast.Div()) if _has_bare_number(node, definitions):
            return ""
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            first, second = of(left), of(right)
            return "" if first and second else first or second
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return "" if of(right) else of(left)
        case ast.IfExp(body=body):
            return of(body)
        case ast.Call(func=ast.Name(id="abs" | "max" | "min"), args=args):
            return next((unit for arg in args if (unit := of(arg))), "")
    return ""


def _has_bare_number(node: ast.expr, definitions: Mapping[str, ast.expr]) -> bool:
    """Whether a factor or a divisor of a product is a number that counts nothing, also by way of names."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return bool(abs(value) > _COUNT or (4 * value) % 1)
        case ast.Name(id=name) if name in definitions:
            return _has_bare_number(definitions[name], definitions)
        case ast.UnaryOp(operand=operand):
            return _has_bare_number(operand, definitions)
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div(), right=right):
            return _has_bare_number(left, definitions) or _has_bare_number(right, definitions)
    return False


def time_unit(model: Model) -> str:
    """Seconds, if any unit of the model speaks of them; else time has no unit."""
    units = [*units_of(model).values(), *(parameter.unit for parameter in model.parameters)]
    return "s" if any(re.search(r"(?<![A-Za-z])s(?![A-Za-z])", unit) for unit in units) else ""
