"""This module defines the base class of simplified models, which leave out one feature of a model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from hybridsim.model import Model


class DoesNotApply(Exception):
    """Raised if a simplified model cannot replace a model; the text gives the reason."""


class NothingToDrop(DoesNotApply):
    """Raised if the model lacks the feature that the simplified model would leave out; the text names the feature."""


@dataclass(frozen=True)
class Scene:
    """The full model, and the sliding speeds of its motion.

    Parameters
    ----------
    model : the full model.
    speed : mean sliding speed of each contact in the full motion; empty if unknown.
    peak : the largest speed of any contact in the full motion.
    v0 : width of a regularised force; by default a hundredth of ``peak``.
    progress : called from time to time by a rung that makes runs; an exception from it ends them.
    """

    model: Model
    speed: Mapping[str, float] = field(default_factory=dict)
    peak: float | None = None
    v0: float | None = None
    progress: Callable[[float], None] | None = None


class LadderStep(ABC):
    """A simplification of a model: a function Model -> Model, or a closed form of the motion.

    name : one word for options and maps.
    title, drops : its title, and the feature of the full model that it lacks.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    drops: ClassVar[str]

    @abstractmethod
    def apply(self, scene: Scene) -> Model | Any:
        """Return the simplified model, or a closed-form motion that provides the measures of a steady state.

        Raises
        ------
        DoesNotApply
            If the rung does not apply; the text says why.
        """

    def __repr__(self) -> str:
        return f"<LadderStep {self.name}: {self.title}>"


def need_contacts(model: Model) -> None:
    """Reject a model without contacts, because the simplification changes friction only."""
    if not model.contacts:
        raise DoesNotApply("the model has no contact")


def need_stick(model: Model) -> None:
    """Reject a model with a friction law without stick, because the simplification changes stick."""
    need_contacts(model)
    if not all(contact.law.is_set_valued for contact in model.contacts):
        raise DoesNotApply("the friction law of a contact gives the force directly, without a stick mode")
