"""This module proves without a run that a model stays at rest, is linear, or never sticks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hybridsim.analysis.ladder import DoesNotApply, Scene
from hybridsim.analysis.ladder.at_rest import AtRest
from hybridsim.analysis.ladder.forces import inlined
from hybridsim.analysis.ladder.no_stop import NoStop, held
from hybridsim.expr import evaluate, parse, substitute
from hybridsim.model import Model
from hybridsim.reference.closed_forms.affine import Affine, NotAffine, affine

_UNIT_BOUND = 1.0  # upper bound of a unit wave, whatever its shape


@dataclass(frozen=True)
class Certificate:
    """A property of a model that follows from theory, without a run.

    rung : the rung that it makes exact; "" if it concerns the full model. motion : the closed form, if there is one.
    steady_only : whether it concerns the steady motion only.
    """

    text: str
    rung: str = ""
    motion: Any = None
    steady_only: bool = False


def certificates(model: Model) -> tuple[Certificate, ...]:
    """Return all properties of a model that follow from theory; stronger properties come first."""
    found = []
    if bound := _nothing_moves(model):
        load, limit = (f"{value:.6g}" for value in bound)
        text = f"the model stays at rest: the load is at most {load}, and the stick limit is {limit}"
        found.append(Certificate(text, AtRest.name, AtRest().apply(Scene(model))))
    elif _is_linear(model):
        found.append(Certificate("the model is linear and has no modes: there is nothing to simplify"))
    else:
        found += _never_stops(model)
    return tuple(found)


def _never_stops(model: Model) -> list[Certificate]:
    try:
        form = held(model)
        motion = NoStop().apply(Scene(model))
    except DoesNotApply:
        return []
    if not form.unique:
        return []
    s = form.found.system
    text = (
        f"inside the no-stop boundary (mu N/F0 = {s.slip_force / s.force:.4g}): Den Hartog's formula gives "
        "the only steady motion"
    )
    return [Certificate(text, NoStop.name, motion, steady_only=True)]


def _is_linear(model: Model) -> bool:
    if (
        model.contacts
        or model.surfaces
        or model.impacts
        or model.components
        or model.discrete
        or model.schedules
        or model.flow is not None
    ):
        return False
    if any(monitor.action != "record" for monitor in model.monitors):
        return False
    unknowns = {s.name for s in model.states} | {i.name for i in model.inputs}
    values, definitions = model.parameter_values(), dict(model.definitions)
    try:
        for state in model.states:
            affine(state.der, unknowns, values, definitions)
    except NotAffine:
        return False
    return True


def _nothing_moves(model: Model) -> tuple[float, float] | None:
    """Return (largest load, stick limit) if a single contact holds the whole model at rest for all time."""
    plain = not (
        model.surfaces or model.impacts or model.components or model.discrete or model.schedules or model.flow
    )
    if not plain or len(model.contacts) != 1 or any(i.kind != "wave" for i in model.inputs):
        return None
    if any(monitor.action != "record" for monitor in model.monitors):
        return None
    if not model.contacts[0].law.is_set_valued or model.contacts[0].opens:
        return None
    contact, values, start = model.contacts[0], model.parameter_values(), model.start_values()
    if contact.law.stick_backward is not None:
        return None
    at_start = {name: parse(repr(value)) for name, value in start.items()}
    definitions = dict(model.definitions)
    unknowns = {contact.name, *(i.name for i in model.inputs)}
    try:
        slide = affine(contact.velocity, unknowns | start.keys(), values, definitions)
        # If nothing moves, the states keep their start values, so that products of states are constants.
        rates = {
            s.name: affine(substitute(inlined(model, s.der), at_start), unknowns, values, {})
            for s in model.states
        }
        limit = affine(substitute(inlined(model, contact.limit_force()), at_start), unknowns, values, {})
    except NotAffine:
        return None
    if not limit.is_constant or slide.waves or not slide.linear.keys() <= start.keys() or _at(slide, start):
        return None
    pull = Affine()
    for name, weight in slide.linear.items():
        pull = pull.plus(rates[name], weight)
    effect = pull.linear.get(contact.name, 0.0)
    if effect >= 0.0:
        return None
    # In stick the force makes the rate of the relative velocity zero. Then every state must have a zero rate.
    for rate in rates.values():
        left = rate.plus(pull, -rate.linear.get(contact.name, 0.0) / effect)
        if _largest(model, left, contact.name, values) != 0.0:
            return None
    load = _largest(model, Affine().plus(pull, -1.0 / effect), contact.name, values)
    return (load, limit.constant) if load <= limit.constant else None


def _at(form: Affine, start: Mapping[str, float]) -> float:
    return form.constant + sum(value * start.get(name, 0.0) for name, value in form.linear.items())


def _largest(model: Model, form: Affine, force: str, values: Mapping[str, float]) -> float:
    """Return an upper bound of the absolute value of a linear form at all times; the contact's force is left out."""
    steady, swing = form.constant, sum(abs(phasor) for phasor in form.waves.values())
    inputs = {i.name: i for i in model.inputs}
    for name, value in form.linear.items():
        if name in inputs:
            number = {field: float(evaluate(e, values)) for field, e in inputs[name].expressions.items()}
            steady += value * number["offset"]
            swing += abs(value * number["amplitude"]) * _UNIT_BOUND
        elif name != force and value != 0.0:
            return float("inf")
    return abs(steady) + swing
