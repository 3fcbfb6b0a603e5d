"""What a rung is: a model made simpler on purpose, with what it drops in words, and where it does not apply."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from hybridsim.model import Model


class DoesNotApply(Exception):
    """A rung cannot stand for a model; the text says why."""


class NothingToDrop(DoesNotApply):
    """A model has not got what a rung would drop: it is on that rung already; the text says why."""


@dataclass(frozen=True)
class Scene:
    """The full model and what is known of its motion, from which a rung takes the numbers it needs.

    Parameters
    ----------
    model : the full model.
    speed : mean speed of each contact while it slides, of the full motion; empty where it is not known.
    peak : the largest speed of any contact in the full motion.
    v0 : width of a regularised force; a hundredth of ``peak`` unless given.
    progress : called from time to time by a rung that needs runs of its own; what it raises ends them.
    """

    model: Model
    speed: Mapping[str, float] = field(default_factory=dict)
    peak: float | None = None
    v0: float | None = None
    progress: Callable[[float], None] | None = None


class Rung(ABC):
    """A simpler model: a transformation Model -> Model, or a formula in place of one.

    name : one word for options and maps.
    title, drops : what it is, and what the full model has that it has not.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    drops: ClassVar[str]

    @abstractmethod
    def apply(self, scene: Scene) -> Model | Any:
        """The simpler model; of a formula a motion with the measures of a steady state.

        Raises
        ------
        DoesNotApply
            With the reason.
        """

    def __repr__(self) -> str:
        return f"<Rung {self.name}: {self.title}>"


def need_contacts(model: Model) -> None:
    """Rungs are about friction: without a contact there is nothing to drop."""
    if not model.contacts:
        raise DoesNotApply("the model has no contact")


def need_stick(model: Model) -> None:
    """Rungs that change a law's modes are about laws that have them."""
    need_contacts(model)
    if not all(contact.law.is_set_valued for contact in model.contacts):
        raise DoesNotApply("the law of a contact gives a force of its own, without stick")
