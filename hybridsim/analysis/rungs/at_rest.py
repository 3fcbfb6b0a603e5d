"""The simplest rung of all: nothing moves."""

from __future__ import annotations

from hybridsim.analysis.rungs.rung import DoesNotApply, Rung, Scene, need_contacts


class Rest:
    """A motion that is none, with the measures of a steady state; of a force it knows nothing.

    x : the value at which each state stays. period : of the forcing, nan without.
    """

    def __init__(self, x: dict[str, float], contacts: tuple[str, ...]) -> None:
        self.x = x
        self.maximum = self.minimum = self.mean = self.final = x
        self.peak = {name: abs(value) for name, value in x.items()}
        self.amplitude = dict.fromkeys(x, 0.0)
        self.dissipated = dict.fromkeys(contacts, 0.0)
        self.stick_fraction = dict.fromkeys(contacts, 1.0)
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
        return Rest(start, tuple(contact.name for contact in scene.model.contacts))
