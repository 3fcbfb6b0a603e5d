"""This module determines the units of a model's quantities."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping

from hybridsim.expr import Expression
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.model import Model
from hybridsim.model.units.parse import read_unit, write_unit

_COUNT = 4  # multiples of 1/4 up to this count as dimensionless factors


def units_of(model: Model) -> dict[str, str]:
    """Return the labels of states, outputs, contact forces, discrete states and inputs, in this order."""
    units = {state.name: state.unit for state in model.states} | {o.name: o.unit for o in model.outputs}
    rest = dict.fromkeys((contact.name for contact in model.contacts), "")
    if missing := [contact for contact in model.contacts if contact.name not in units]:
        rest |= _of_forces(model, missing)
    rest |= {d.name: d.unit for d in model.discrete} | {
        signal.name: signal.unit or "" for signal in model.inputs
    }
    units |= {name: unit for name, unit in rest.items() if name not in units}
    return {name: label_of(unit) for name, unit in units.items()}


def label_of(unit: str) -> str:
    """Return a unit as a label; a pure number has no label."""
    return "" if unit == "1" else unit


def unit_of(model: Model, expression: Expression) -> str:
    """Return the unit of an expression if one of its terms has a known unit, otherwise ""."""
    units = units_of(model) | {q.name: q.unit for q in model.parameters}
    return _unit(expression.tree, units, {name: e.tree for name, e in model.definitions})


def unit_of_work(model: Model, contact: Contact) -> str:
    """Return the unit of the integral of force times relative velocity over time, or "" if it is unknown."""
    texts = units_of(model)[contact.name], unit_of(model, contact.velocity), time_unit(model)
    force, velocity, time = (read_unit(text) if text else None for text in texts)
    if force is None or velocity is None or time is None:
        return ""
    return write_unit((force * velocity * time).without_angles(), ("J", "mJ", "kJ"))


def rate_of(unit: str, time: str, order: int) -> str:
    """Return the unit of a time derivative of a quantity."""
    if not unit or not time or order == 0:
        return unit
    known = re.fullmatch(rf"(.*)/{re.escape(time)}(?:\^(\d+))?", unit)
    base, power = (known.group(1), order + int(known.group(2) or 1)) if known else (unit, order)
    return f"{base}/{time}" if power == 1 else f"{base}/{time}^{power}"


def _of_forces(model: Model, contacts: list[Contact]) -> dict[str, str]:
    """Return the unit of each friction force, from its load or from a coefficient."""
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
    """Return the unit of an expression, or "" if units would have to be multiplied.

    A numeric factor may have an unknown unit: 9.81*m is not a mass. Multiples of 1/4 up to 4 count as dimensionless:
    0.5*N is a load.
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
        case ast.Call(func=ast.Name(id="abs" | "max" | "min" | "mod"), args=args):
            return next((unit for arg in args if (unit := of(arg))), "")
    return ""


def _has_bare_number(node: ast.expr, definitions: Mapping[str, ast.expr]) -> bool:
    """Return whether a product contains a numeric factor that may have a unit."""
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
    """Return "s" if it occurs in the units of the model, else "min" or "h" if only one of the two occurs, else ""."""
    units = [*units_of(model).values(), *(parameter.unit for parameter in model.parameters)]
    symbols = {symbol for unit in units for symbol in re.findall(r"[A-Za-z]+", unit)}
    found = [time for time in ("s", "min", "h") if time in symbols]
    return found[0] if "s" in found or len(found) == 1 else ""
