"""This module finds fractional powers of a contact velocity, which have no derivative at zero."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from hybridsim.errors import Place
from hybridsim.expr import Expression, parse, substitute
from hybridsim.expr.grammar import WHOLE_POWERS, is_name
from hybridsim.expr.rebuild import with_names
from hybridsim.expr.write import write
from hybridsim.model.laws.law import SPEED
from hybridsim.model.meanings import Family, Meanings
from hybridsim.model.parts.component import Component
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.one_sided import names_of, number_of


@dataclass(frozen=True)
class VelocityPower:
    """A root or fractional power of a quantity that is zero while a contact sticks.

    The exponent is not a whole number, or it is a parameter whose whole value is not in `WHOLE_POWERS`.

    Parameters
    ----------
    text, where : source text, and the rate or force that contains it.
    contact : contact whose velocity it depends on.
    exponent : its exponent, if it is constant.
    is_force : whether it occurs in the slip force of the contact.
    is_signed : the base changes its sign with the velocity without a condition, so the power is undefined in one slip
        mode.
    remedy : the same power, smoothed over a small speed.
    """

    text: str
    where: str
    contact: str
    exponent: float | None
    is_force: bool
    is_signed: bool
    remedy: str
    place: Place | None


@dataclass(frozen=True)
class _Candidate:
    """A root or power in a flow, which may be a fractional power of a contact velocity."""

    node: ast.expr
    base: ast.expr
    exponent: ast.expr | None
    where: str
    place: Place | None
    families: Mapping[Family, str]
    is_conditional: bool
    is_force: bool


def velocity_powers(model: Model) -> tuple[VelocityPower, ...]:
    """Return the fractional velocity powers that can be recognised in the expressions of a model."""
    found = model.once("velocity powers", lambda: _candidates(model))
    if not found:
        return ()
    meanings, candidates = found
    powers = _judged(candidates, meanings, model.parameter_values())
    contacts = {contact.name: contact for contact in model.contacts}
    # both directions of slip have the same text in the law
    return tuple(dict.fromkeys(_as_written(power, contacts[power.contact], meanings) for power in powers))


def _as_written(power: VelocityPower, contact: Contact, meanings: Meanings) -> VelocityPower:
    """Return a power with the text and the place that it has in the friction law of its contact."""
    law, speeds = contact.law, (contact.velocity, substitute(parse(f"-{SPEED}"), {SPEED: contact.velocity}))
    values = {name: value.tree for name, value in contact.values().items()}
    parts = {"slip": law.slip, "slip_backward": law.slip_backward} | {
        f"definition {name}": expr for name, expr in law.definitions.items()
    }
    for title, expr in parts.items():
        if expr is None or not power.is_force:
            continue
        for node in ast.walk(expr.tree):
            if not isinstance(node, ast.Call | ast.BinOp):
                continue
            texts = {
                write(meanings.written_out(with_names(node, values | {SPEED: speed.tree})))
                for speed in speeds
            }
            if power.text in texts:
                base = node.args[0] if isinstance(node, ast.Call) else node.left
                return replace(
                    power,
                    text=write(node),
                    where=f"{title} of the law {law.name}",
                    remedy=_rounded(base, power.exponent, True),
                    place=expr.place or law.place or power.place,
                )
    return power


def _candidates(model: Model) -> tuple[Meanings, tuple[_Candidate, ...]] | None:
    contacts = {contact.name for contact in model.contacts}
    components = [c for c in model.all_components() if c.surface and c.name in contacts]
    if model.flow is not None or not components:
        return None
    meanings = Meanings(model)
    families = {meanings.family(c.surface.function.tree)[0]: c.name for c in components if c.surface}
    found = tuple(_of_model(model, components, families, meanings))
    return (meanings, found) if found else None


def _of_model(
    model: Model, components: list[Component], families: dict[Family, str], meanings: Meanings
) -> Iterator[_Candidate]:
    for state in model.states:
        yield from _of(
            state.der, f"the rate of {state.name}", state.der.place or state.place, families, meanings
        )
    for part in model.components:  # such a mode may be active only while the power is defined
        for mode in part.modes:
            for name, expr in (*mode.der.items(), *mode.set.items()):
                where = f"{name} of mode {mode.name}"
                yield from _of(expr, where, expr.place or mode.place, families, meanings, is_conditional=True)
    for component in components:
        own = {family: name for family, name in families.items() if name == component.name}
        for mode in component.modes:
            if component.surface and mode.name == component.surface.hold:
                continue
            for name, expr in mode.set.items():
                where = f"the force {name} of {mode.name}"
                yield from _of(expr, where, expr.place or component.place, own, meanings, is_force=True)


def _of(
    expr: Expression,
    where: str,
    place: Place | None,
    families: Mapping[Family, str],
    meanings: Meanings,
    is_force: bool = False,
    is_conditional: bool = False,
) -> Iterator[_Candidate]:
    if "**" not in expr.text and "sqrt" not in expr.text and not expr.names & meanings.definitions.keys():
        return
    open_ = [(meanings.written_out(expr.tree), is_conditional)]
    while open_:
        node, is_conditional = open_.pop()
        match node:
            case ast.Call(func=ast.Name(id="sqrt"), args=[base]):
                yield _Candidate(node, base, None, where, place, families, is_conditional, is_force)
            case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
                value = number_of(exponent, {}, meanings.lookup)
                if value is None or value != round(value):
                    yield _Candidate(node, base, exponent, where, place, families, is_conditional, is_force)
        below = is_conditional or isinstance(node, ast.IfExp)
        open_ += [(part, below) for part in ast.iter_child_nodes(node) if isinstance(part, ast.expr)]


def _judged(
    candidates: tuple[_Candidate, ...], meanings: Meanings, numbers: Mapping[str, float]
) -> Iterator[VelocityPower]:
    for one in candidates:
        power = 0.5 if one.exponent is None else number_of(one.exponent, numbers, meanings.lookup)
        is_whole = power is not None and power == round(power)
        if is_whole and power in WHOLE_POWERS:
            continue
        for family, contact in one.families.items():
            if _vanishes(one.base, family, numbers, meanings):
                is_signed = not (one.is_force or one.is_conditional or is_whole)
                is_signed = is_signed and meanings.family(one.base)[0] == family
                remedy = _rounded(one.base, power, one.is_force)
                text = write(one.node)
                yield VelocityPower(
                    text, one.where, contact, power, one.is_force, is_signed, remedy, one.place
                )
                break


def _vanishes(node: ast.expr, family: Family, numbers: Mapping[str, float], meanings: Meanings) -> bool:
    """Return whether the form of an expression shows that it is zero at zero velocity."""
    if not names_of(node).isdisjoint(meanings.moving) and meanings.family(node)[0] == family:
        return True

    def below(part: ast.expr) -> bool:
        return _vanishes(part, family, numbers, meanings)

    match node:
        case ast.UnaryOp(operand=operand) | ast.Call(func=ast.Name(id="abs" | "sqrt"), args=[operand]):
            return below(operand)
        case ast.BinOp(left=left, op=ast.Pow(), right=exponent):
            power = number_of(exponent, numbers, meanings.lookup)
            return power is not None and power > 0.0 and below(left)
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return below(left) or below(right)
        case ast.BinOp(left=left, op=ast.Div()):
            return below(left)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            parts = [left, right]
        case ast.Call(func=ast.Name(id="max" | "min"), args=parts):
            pass
        case _:
            return False
    return all(below(part) or number_of(part, numbers, meanings.lookup) == 0.0 for part in parts)


def _rounded(base: ast.expr, power: float | None, is_force: bool) -> str:
    """Return the remedy for a fractional power of a velocity: a whole exponent, or a smooth function."""
    if power is not None and power == round(power):
        return f"write the exponent as the number {power:g}"
    if is_force and isinstance(base, ast.Call) and write(base.func) == "abs":
        base = base.args[0]  # the square in the smooth function makes it superfluous
    name = write(base)
    if power is None or power < 0.0 or not is_name(name):
        return (
            "use a smooth function with a small speed b, such as (v**2 + b**2)**0.75 - b**1.5 for abs(v)**1.5"
        )
    if is_force:
        return f"replace the power by ({name}**2 + b**2)**{power / 2:g} - b**{power:g} with a small speed b"
    return f"replace the power by {name}*({name}**2 + b**2)**{(power - 1) / 2:g} with a small speed b"
