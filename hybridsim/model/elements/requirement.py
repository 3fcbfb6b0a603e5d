"""This module defines a requirement: an inequality that the parameters of an element have to fulfil."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hybridsim.expr import Expression, parse
from hybridsim.model.elements.element import Element
from hybridsim.model.parts.declared import Declared

# Fields of which the first must not be above the second; None is zero.
_ORDERS = {
    "relay": ("off", "on"),
    "saturation": ("lower", "upper"),
    "deadband": ("lower", "upper"),
    "backlash": (None, "width"),
    "quantizer": (None, "step"),
}
_MAY_BE_EQUAL = ("saturation", "deadband")  # a band without width has a meaning
_FOR_LOW_VALUES = "; for a relay that is on at low values, change the sign of the input and of both levels"


@dataclass(frozen=True)
class Requirement(Declared):
    """The requirement that a value `low` is below a value `high`, or at most equal, for the parameters of every run.

    name : the element. fields : what the two values are in it, None for zero.
    """

    name: str
    low: Expression
    high: Expression
    fields: tuple[str | None, str]
    kind: str

    def is_met(self, low: float, high: float) -> bool:
        """Return whether two values have the right order."""
        return low < high or (low == high and self.kind in _MAY_BE_EQUAL)

    def fault(self, low: float, high: float) -> tuple[str, str]:
        """Return the message and the remedy for values in the wrong order."""
        lower, upper = self.fields
        if lower is None:
            return f"element {self.name}: `{upper}` is {high:.6g}", f"use a value of `{upper}` above zero"
        remedy = f"use a value of `{lower}` {'not above' if self.kind in _MAY_BE_EQUAL else 'below'} that of `{upper}`"
        message = f"element {self.name}: `{lower}` is {low + 0.0:.6g} and `{upper}` is {high:.6g}"
        return message, remedy + (_FOR_LOW_VALUES if self.kind == "relay" else "")


def requirements_of(elements: tuple[Element, ...]) -> Iterator[Requirement]:
    """Yield the requirements of elements; requirements that depend on states or time are left out."""
    for element in elements:
        if element.kind in _ORDERS:
            lower, upper = _ORDERS[element.kind]
            low = parse(0) if lower is None else getattr(element, lower)
            yield Requirement(
                element.name, low, getattr(element, upper), (lower, upper), element.kind, place=element.place
            )
