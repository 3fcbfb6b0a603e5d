"""This module defines the simplified model with equal static and kinetic friction, mu_s := mu_k."""

from __future__ import annotations

import random
from dataclasses import replace

from hybridsim.analysis.ladder.forces import (
    at_speed,
    inlined,
    law_at_speed,
    need_plain_tables,
    with_contacts,
    with_law,
)
from hybridsim.analysis.ladder.ladder_step import LadderStep, NothingToDrop, Scene, need_stick
from hybridsim.expr import evaluate
from hybridsim.model import Contact, Model

_TRIALS = 4  # points at which a jump at rest is looked for; more than one excludes coincidences


class OneCoefficient(LadderStep):
    """The simplified model with stick := slip(0), for contacts with mu_s > mu_k."""

    name = "mu_s=mu_k"
    title = "mu_s := mu_k"
    drops = "the excess of static over kinetic friction: a body breaks loose at the sliding force"

    def apply(self, scene: Scene) -> Model:
        """Return the model in which the stick limit equals the force of slow sliding."""
        model = scene.model
        need_stick(model)
        for contact in model.contacts:
            need_plain_tables(contact)
        jumps = [_jumps(model, contact) for contact in model.contacts]
        if not any(jumps):
            raise NothingToDrop(
                "the static friction of every contact already equals its kinetic friction at v = 0"
            )
        lowered = {c.name for c, jump in zip(model.contacts, jumps, strict=True) if jump}
        return with_contacts(model, lambda c: _lowered(c) if c.name in lowered else c, self.title)


def _lowered(contact: Contact) -> Contact:
    law, at_rest = contact.law, law_at_speed(contact.law, 0.0)
    backward = None if at_rest.slip_backward is None else at_speed(at_rest.slip_backward, "0")
    name = f"{law.name}, {OneCoefficient.title}"
    return with_law(
        contact, replace(law, name=name, stick=at_speed(at_rest.slip, "0"), stick_backward=backward)
    )


def _jumps(model: Model, contact: Contact) -> bool:
    surface = contact.component(model.constant_names()).surface
    assert surface is not None  # every contact has one
    values, draw = model.parameter_values(), random.Random(0)
    for jump in (inlined(model, surface.jump_above), inlined(model, surface.jump_below)):
        for _ in range(_TRIALS):
            others = {name: draw.uniform(0.5, 1.5) for name in sorted(jump.names - values.keys())}
            size = evaluate(jump, {**values, **others})
            if abs(size) > 1e-12 * max(abs(v) for v in (1.0, *values.values())):
                return True
    return False
