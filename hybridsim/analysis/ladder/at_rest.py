"""This module defines the simplest simplified model, in which nothing moves."""

from __future__ import annotations

from hybridsim.analysis.ladder.ladder_step import DoesNotApply, LadderStep, Scene, need_contacts
from hybridsim.model import Contact


class Rest:
    """The steady state in which every state is constant, with the measures of a steady state.

    x : the constant value of each state. period : of the forcing, nan without forcing.
    """

    def __init__(self, x: dict[str, float], contacts: tuple[Contact, ...]) -> None:
        self.x = x
        self.maximum = self.minimum = self.mean = self.final = x
        self.peak = {name: abs(value) for name, value in x.items()}
        self.amplitude = dict.fromkeys(x, 0.0)
        self.dissipated = {contact.name: 0.0 for contact in contacts}
        self.stick_fraction = {contact.name: 1.0 for contact in contacts if contact.law.is_set_valued}
        self.energy = {name: 0.0 for name, value in x.items() if value == 0.0}

    def harmonic(self, name: str, k: int) -> complex:
        """Return the k-th harmonic of a constant: the constant itself for k = 0, and zero for all other k."""
        return complex(self.x[name] if k == 0 else 0.0)


class AtRest(LadderStep):
    """The simplified model in which every state keeps its initial value."""

    name = "at-rest"
    title = "nothing moves"
    drops = "all motion: contacts hold, every state stays where it starts"

    def apply(self, scene: Scene) -> Rest:
        """Return the motion in which nothing moves."""
        need_contacts(scene.model)
        start = scene.model.start_values()
        if scene.model.discrete:
            raise DoesNotApply("the model has discrete states, which can change even if nothing moves")
        return Rest(start, scene.model.contacts)
