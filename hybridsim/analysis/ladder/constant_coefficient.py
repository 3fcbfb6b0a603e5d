"""This module defines simplified models with a friction coefficient that does not depend on the speed."""

from __future__ import annotations

from dataclasses import replace

from hybridsim.analysis.ladder.forces import at_speed, with_contacts, with_law, with_parameters
from hybridsim.analysis.ladder.ladder_step import DoesNotApply, LadderStep, NothingToDrop, Scene, need_stick
from hybridsim.expr import parse
from hybridsim.model import Contact, Model
from hybridsim.model.laws.law import SPEED

_MEAN = "mean_speed"


def _need_velocity_law(model: Model) -> None:
    need_stick(model)
    if any(contact.law.tables or contact.law.slip_backward is not None for contact in model.contacts):
        raise DoesNotApply(
            "the friction law of a contact is a table, or differs between the two sliding directions"
        )
    if not any(SPEED in contact.law.slip.names for contact in model.contacts):
        raise NothingToDrop("no friction force depends on the speed, so mu is already constant")


class ConstantAtRest(LadderStep):
    """The simplified model in which the slip force and the stick limit both equal slip(0)."""

    name = "constant-mu-at-rest"
    title = "constant mu from the friction force at rest"
    drops = "how friction changes with speed: the law's force at v = 0 is used"

    def apply(self, scene: Scene) -> Model:
        """Return the model with Coulomb friction whose force equals the force of slow sliding."""
        model = scene.model
        _need_velocity_law(model)
        return with_contacts(model, lambda c: _constant(c, "0"), "constant mu (at rest)")


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
            changed, lambda c: _constant(c, _MEAN, names[f"{_MEAN}_{c.name}"]), "constant mu (mean)"
        )


def _constant(contact: Contact, speed: str, parameter: str | None = None) -> Contact:
    law = contact.law
    force = at_speed(law.slip, speed)
    parameters = dict(law.parameters) | ({speed: None} if parameter else {})
    arguments = dict(contact.arguments) | ({speed: parse(parameter)} if parameter else {})
    fixed = replace(
        law, name=f"{law.name}, constant", slip=force, stick=force, stick_backward=None, parameters=parameters
    )
    return with_law(replace(contact, arguments=arguments), fixed)
