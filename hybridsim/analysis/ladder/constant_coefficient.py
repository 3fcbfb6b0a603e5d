"""This module defines simplified models with a friction coefficient that does not depend on the speed."""

from __future__ import annotations

from dataclasses import replace

from hybridsim.analysis.ladder.forces import (
    at_speed,
    law_at_speed,
    need_plain_tables,
    with_contacts,
    with_law,
    with_parameters,
)
from hybridsim.analysis.ladder.ladder_step import DoesNotApply, LadderStep, NothingToDrop, Scene, need_stick
from hybridsim.expr import parse
from hybridsim.model import Contact, FrictionLaw, Model
from hybridsim.model.laws.law import SPEED

_MEAN = "mean_speed"


def _need_velocity_law(model: Model) -> None:
    need_stick(model)
    for contact in model.contacts:
        if contact.law.slip_backward is not None:
            raise DoesNotApply(
                f"the friction of contact {contact.name} differs between the two sliding directions"
            )
        need_plain_tables(contact)
    if not any(_depends_on_speed(contact.law) for contact in model.contacts):
        raise NothingToDrop("no friction force depends on the speed, so mu is already constant")


def _depends_on_speed(law: FrictionLaw) -> bool:
    of_speed = {table.name for table in law.tables if table.over.text == SPEED}
    return bool(law.slip.names & {SPEED, *of_speed})


class ConstantAtRest(LadderStep):
    """The simplified model in which the slip force and the stick limit both equal slip(0)."""

    name = "constant-mu-at-rest"
    title = "constant mu from the friction force at rest"
    drops = "how friction changes with speed: the law's force at v = 0 is used"

    def apply(self, scene: Scene) -> Model:
        """Return the model with Coulomb friction whose force equals the force of slow sliding."""
        model = scene.model
        _need_velocity_law(model)
        return with_contacts(model, lambda c: _constant(c, 0.0, "0"), "constant mu (at rest)")


class ConstantAtMeanSpeed(LadderStep):
    """The simplified model in which slip force and stick limit equal the slip force at the mean sliding speed."""

    name = "constant-mu-mean"
    title = "constant mu from the friction force at the mean sliding speed"
    drops = "how friction changes with speed: the law's force at the mean sliding speed is used"

    def apply(self, scene: Scene) -> Model:
        """Return the model with Coulomb friction that has the force at each contact's mean sliding speed."""
        model = scene.model
        _need_velocity_law(model)
        if any(not scene.speed.get(contact.name) for contact in model.contacts):
            raise DoesNotApply(
                "no contact slips in the motion of the full model, so there is no mean sliding speed"
            )
        wishes = {f"{_MEAN}_{c.name}": scene.speed[c.name] for c in model.contacts}
        changed, names = with_parameters(model, wishes)
        return with_contacts(
            changed,
            lambda c: _constant(c, scene.speed[c.name], _MEAN, names[f"{_MEAN}_{c.name}"]),
            "constant mu (mean)",
        )


def _constant(contact: Contact, speed: float, name: str, parameter: str | None = None) -> Contact:
    """Return a contact with its force at one speed: `name` is the speed in formulas, a number or a parameter."""
    law = law_at_speed(contact.law, speed)
    force = at_speed(law.slip, name)
    parameters = dict(law.parameters) | ({name: None} if parameter else {})
    arguments = dict(contact.arguments) | ({name: parse(parameter)} if parameter else {})
    fixed = replace(
        law, name=f"{law.name}, constant", slip=force, stick=force, stick_backward=None, parameters=parameters
    )
    return with_law(replace(contact, arguments=arguments), fixed)
