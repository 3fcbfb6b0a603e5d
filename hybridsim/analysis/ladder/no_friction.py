"""This module defines the simplified model without friction: every contact force is zero."""

from __future__ import annotations

from hybridsim.analysis.ladder.forces import with_forces
from hybridsim.analysis.ladder.ladder_step import LadderStep, Scene, need_contacts
from hybridsim.expr import parse
from hybridsim.model import Model


class NoFriction(LadderStep):
    """The simplified model with f = 0 in every contact."""

    name = "no-friction"
    title = "no friction"
    drops = "friction altogether: its force, its damping, and stick"

    def apply(self, scene: Scene) -> Model:
        """Return the model with all contact forces zero."""
        need_contacts(scene.model)
        zero = {contact.name: parse(0) for contact in scene.model.contacts}
        return with_forces(scene.model, zero, "free", "without friction")
