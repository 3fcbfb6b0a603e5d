"""This module defines a rung: a simplified model, with a statement of what it drops and when it does not apply."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from hybridsim.model import Model


class DoesNotApply(Exception):
    """A rung cannot replace a model; the text says why."""


class NothingToDrop(DoesNotApply):
    """A model lacks the feature that a rung would drop, so the rung changes nothing; the text says why."""


@dataclass(frozen=True)
class Scene:
    """The full model and the numbers of its motion that rungs need.

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
    """A simpler model: a transformation Model -> Model, or a closed form instead of a model.

    name : one word for options and maps.
    title, drops : its title, and the feature of the full model that it lacks.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    drops: ClassVar[str]

    @abstractmethod
    def apply(self, scene: Scene) -> Model | Any:
        """Return the simpler model. A step with a closed form returns its motion as a steady state.

        Raises
        ------
        DoesNotApply
            If the rung does not apply; the text says why.
        """

    def __repr__(self) -> str:
        return f"<LadderStep {self.name}: {self.title}>"


def need_contacts(model: Model) -> None:
    """Refuse a model without contacts, because rungs change friction only."""
    if not model.contacts:
        raise DoesNotApply("the model has no contact")


def need_stick(model: Model) -> None:
    """Refuse a model with a law without stick, for rungs that change the modes of a law."""
    need_contacts(model)
    if not all(contact.law.is_set_valued for contact in model.contacts):
        raise DoesNotApply("the law of a contact gives its force directly, without stick")
