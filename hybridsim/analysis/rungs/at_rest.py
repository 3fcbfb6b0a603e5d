"""The simplest rung of all: nothing moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybridsim.analysis.rungs.rung import DoesNotApply, Rung, Scene, need_contacts

if TYPE_CHECKING:
    from hybridsim.model import Contact


class Rest:
    """A motion that is none, with the measures of a steady state; of a force it knows nothing.

    x : the value at which each state stays. period : of the forcing, nan without.
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
        """The mean, and no wave."""
        return complex(self.x[name] if k == 0 else 0.0)


class AtRest(Rung):
    """Every state stays where it starts."""

    name = "at-rest"
    title = "nothing moves"
    drops = "all motion: contacts hold, every state stays where it starts"

    def apply(self, scene: Scene) -> Rest:
        """The motion that is none."""
        need_contacts(scene.model)
        start = scene.model.start_values()
        if scene.model.discrete:
            raise DoesNotApply("the model has discrete states, which change without motion")
        return Rest(start, scene.model.contacts)
