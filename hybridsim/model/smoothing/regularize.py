"""This module replaces the friction of a model by regularised, single-valued friction forces."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from hybridsim.errors import ModelError, UsageError, nearest
from hybridsim.expr import Expression, evaluate, parse, substitute
from hybridsim.model.free_name import free_name, names_of_model
from hybridsim.model.laws.law import SPEED
from hybridsim.model.parts.component import Choice, Component, Guard, Mode
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.quantities import Parameter
from hybridsim.model.rate import inlined, rate_along

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model

KINDS = ("tanh", "arctan", "karnopp")
_SMOOTH = {"tanh": "slip*tanh(velocity/v0)", "arctan": "slip*2/pi*atan(velocity/v0)"}
_TRIALS = 8  # random points that test a law for a jump at rest; one point could hit a zero by chance


def regularized(model: Model, kind: str, v0: Expression | str | float) -> Model:
    """Return the model with regularised contacts (see `Model.regularized`)."""
    if not isinstance(kind, str) or kind not in KINDS:
        raise UsageError(
            f"Unknown regularisation {kind!r}", remedy=nearest(str(kind), KINDS, kind="regularisations")
        )
    if not any(contact.law.is_set_valued for contact in model.contacts):
        raise UsageError(f"Model '{model.name}' has no contact with a set-valued law to regularise")
    taken = names_of_model(model)
    name = free_name(taken, "v0")
    width = Parameter(name, v0)  # type: ignore[arg-type]  # a text or a number becomes an expression
    changed = replace(model, parameters=(*model.parameters, width))
    value = changed.parameter_values()[name]
    if not value > 0.0:
        raise UsageError(f"`v0` cannot be {value!r}", remedy="use a velocity above zero")
    build: Callable[[Model, Contact, str], Component]
    build = _karnopp if kind == "karnopp" else lambda m, contact, w: _smooth(m, contact, w, kind)
    components = tuple(
        build(changed, contact, name) if contact.law.is_set_valued and part.name == contact.name else part
        for contact in model.contacts
        for part in model.components_of(contact)
    )
    gone = {contact.name for contact in model.contacts}
    outputs = tuple(
        replace(
            output,
            modes={place: e for place, e in output.modes.items() if place.rpartition(".")[0] not in gone},
        )
        for output in model.outputs
    )
    definitions = model.definitions
    if kind == "karnopp":
        definitions += tuple(
            (_holding(model, c.name), _holding_force(model, c)) for c in model.contacts if c.law.is_set_valued
        )
    return replace(
        changed,
        contacts=(),
        components=(*components, *model.components),
        outputs=outputs,
        definitions=definitions,
        title=f"{model.title or model.name}, regularised by {kind}",
    )


def _smooth(model: Model, contact: Contact, v0: str, kind: str) -> Component:
    """Return a component with the smooth force f = slip(|v|) g(v/v0), where g rises from -1 to 1."""
    _refuse_static(model, contact, kind)
    if contact.law.slip_backward is not None:
        raise UsageError(
            f"contact {contact.name}: the law '{contact.law.name}' depends on the direction of slip, which '{kind}' "
            "does not support",
            remedy="use 'karnopp'",
        )
    slip = contact.law.slip
    speed = (
        _form("abs(velocity)", velocity=contact.velocity)
        if slip is not None and SPEED in slip.names
        else parse(0)
    )
    force = _form(_SMOOTH[kind], slip=contact.slip_force(speed), velocity=contact.velocity, v0=parse(v0))
    values = {contact.name: force}
    if contact.table_speed is not None:
        values[contact.table_speed] = _form("abs(velocity)", velocity=contact.velocity)
    return Component(
        contact.name, (Mode("smooth", _loaded(model, contact), set=values),), place=contact.place
    )


def _refuse_static(model: Model, contact: Contact, kind: str) -> None:
    """Reject static friction above slip(0), which a smooth force cannot represent."""
    surface = contact.component(model.constant_names()).surface
    assert surface is not None  # every contact has one
    jump = surface.jump_above
    values, draw = model.parameter_values(), random.Random(0)
    for _ in range(_TRIALS):
        others = {name: draw.uniform(0.5, 1.5) for name in sorted(jump.names - values.keys())}
        size = evaluate(jump, {**values, **others})
        if abs(size) > 1e-12 * max(abs(value) for value in (1.0, *values.values(), *others.values())):
            raise UsageError(
                f"contact {contact.name}: the static friction of the law '{contact.law.name}' exceeds its slip force "
                f"at v = 0, which '{kind}' cannot represent",
                remedy="use 'karnopp', or a law that decreases continuously from its static value, such as stribeck",
            )


def _karnopp(model: Model, contact: Contact, v0: str) -> Component:
    """Return the automaton of Karnopp's dead band |v| < v0, in which the body is stopped.

    D. Karnopp, J. Dyn. Syst. Meas. Control 107 (1985) 100, doi:10.1115/1.3140698. In this variant the velocity is set
    to zero on entering the band. After release the body slides at the limit force until it leaves the band.
    """
    name, velocity, loaded = contact.name, contact.velocity, _loaded(model, contact)
    held, limit, width = parse(_holding(model, name)), contact.limit_force(), parse(v0)
    backward = _form("-velocity", velocity=velocity)
    parts = {"velocity": velocity, "v0": width, "held": held, "limit": limit}
    backward_limit = contact.limit_force(backward=True)
    backward_parts = {**parts, "limit": backward_limit}
    up, down = _form("held > limit", **parts), _form("-held > limit", **backward_parts)
    stop = _stopping(model, contact)
    into_band = (Choice("break+", up, stop), Choice("break-", down, stop), Choice("stick", None, stop))
    out_up = Guard("fast", _form("v0 - velocity", **parts), (Choice("slip+"),))
    out_down = Guard("fast-backward", _form("v0 + velocity", **parts), (Choice("slip-"),))
    forward_force = contact.slip_force(velocity)
    speed = contact.table_speed  # in the band tables are evaluated at zero speed

    def at(value: Expression) -> dict[str, Expression]:
        return {} if speed is None else {speed: value}

    backward_force = _form("-f", f=contact.slip_force(backward, backward=True))
    modes = (
        Mode(
            "slip+",
            (Guard("slow", _form("velocity - v0", **parts), into_band), *loaded),
            set={name: forward_force, **at(velocity)},
        ),
        Mode(
            "slip-",
            (Guard("slow", _form("-velocity - v0", **parts), into_band), *loaded),
            set={name: backward_force, **at(_form("-velocity", velocity=velocity))},
        ),
        Mode(
            "stick",
            (
                Guard("upper", _form("limit - held", **parts), (Choice("break+"),)),
                Guard("lower", _form("limit + held", **backward_parts), (Choice("break-"),)),
                out_up,
                out_down,
                *loaded,
            ),
            set={name: held, **at(parse(0))},
        ),
        Mode(
            "break+",
            (Guard("held", _form("held - limit", **parts), (Choice("stick"),)), out_up, out_down, *loaded),
            set={name: limit, **at(parse(0))},
        ),
        Mode(
            "break-",
            (
                Guard("held", _form("-held - limit", **backward_parts), (Choice("stick"),)),
                out_up,
                out_down,
                *loaded,
            ),
            set={name: _form("-limit", **backward_parts), **at(parse(0))},
        ),
    )
    return Component(name, modes, initial="stick", place=contact.place)


def _holding(model: Model, contact: str) -> str:
    return free_name(names_of_model(model), f"{contact}_held")


def _holding_force(model: Model, contact: Contact) -> Expression:
    """Return the force that keeps the relative velocity constant: -(its rate without f)/(d rate/df).

    Raises
    ------
    UsageError
        If the relative velocity depends on an input, or if the force of another contact acts on it.
    """
    from hybridsim.expr.slope import slope

    velocity = inlined(contact.velocity, dict(model.definitions))
    inputs = velocity.names & {i.name for i in model.inputs}
    if inputs:
        raise UsageError(
            f"contact {contact.name}: the velocity depends on the input {', '.join(sorted(inputs))}, which 'karnopp' "
            "does not support",
            remedy="use 'tanh' or 'arctan'",
        )
    what, constants = f"the velocity of contact {contact.name}", (*model.parameters, *model.discrete)
    rate = rate_along(velocity, what, model.states, model.definitions, constants)
    others = rate.names & {c.name for c in model.contacts if c is not contact}
    if others:
        raise UsageError(
            f"contact {contact.name}: the force {', '.join(sorted(others))} also acts on the velocity of this "
            "contact, but 'karnopp' supports only independent contacts",
            remedy="use 'tanh' or 'arctan'",
        )
    effect = slope(rate, contact.name)
    if contact.name in effect.names or effect.text == "0":
        raise ModelError(
            f"contact {contact.name}: the rate of the velocity does not depend linearly on the force {contact.name}",
            place=contact.place,
            remedy=f"add a term such as '- {contact.name}/m' to the rate",
        )
    free = substitute(rate, {contact.name: parse(0)})
    return _form("-free/effect", free=free, effect=effect)


def _stopping(model: Model, contact: Contact) -> dict[str, Expression]:
    """Return the reset of one state that makes the relative velocity zero."""
    from hybridsim.expr.slope import slope

    for state in model.states:
        part = slope(contact.velocity, state.name)
        if part.text != "0" and not part.names & {s.name for s in model.states}:
            after = _form("x - velocity/part", x=parse(state.name), velocity=contact.velocity, part=part)
            return {state.name: after}
    raise ModelError(
        f"contact {contact.name}: the relative velocity is not linear in any state",
        place=contact.velocity.place or contact.place,
        remedy="declare the relative velocity as a state",
    )


def _loaded(model: Model, contact: Contact) -> tuple[Guard, ...]:
    """Return the guard that ends the run at a negative normal load, if the contact has one."""
    guards = contact.component(model.constant_names()).modes[0].guards
    return tuple(guard for guard in guards if guard.fatal)


def _form(template: str, **parts: Expression) -> Expression:
    return substitute(parse(template), parts)
