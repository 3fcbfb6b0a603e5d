"""This module defines the shapes of a drawing of the mechanism, and their coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hybridsim.expr import Expression
from hybridsim.model.parts.declared import Declared, as_tuple

Point = tuple[Expression, Expression]

_PLACED = ("at",)
# Required and optional fields of each kind of shape.
KINDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "mass": (_PLACED, ("size", "angle", "mode_of", "text")),
    "ball": (_PLACED, ("size", "angle", "mode_of", "text")),
    "rotor": (_PLACED, ("size", "angle", "mode_of", "text")),
    "wheel": (_PLACED, ("size", "angle", "mode_of", "text")),
    "pendulum": ((*_PLACED, "length", "angle"), ("size", "mode_of", "text")),
    "ground": (_PLACED, ("length", "angle", "mode_of")),
    "wall": (_PLACED, ("length", "angle", "mode_of")),
    "belt": ((*_PLACED, "travel"), ("length", "size", "angle", "mode_of")),
    "tank": ((*_PLACED, "level"), ("size", "mode_of", "text")),
    "spring": (("ends",), ("size", "offset")),
    "damper": (("ends",), ("size", "offset")),
    "rod": (("ends",), ("offset",)),
    "shaft": (("ends",), ("size", "angle", "twist")),
    "arrow": ((*_PLACED, "vector"), ("text",)),
    "line": (("points",), ("mode_of",)),
    "body": (("points",), ("mode_of", "text")),
}
# Kinds that the ends of a spring, damper or rod can name.
HOLDS = ("mass", "ball", "rotor", "wheel", "pendulum", "ground", "wall", "belt")


@dataclass(frozen=True)
class Shape(Declared):
    """A part of a drawing, placed by expressions of states, parameters and time.

    `hybridsim.plot.mechanism` and `Solution.animate` draw the shapes of a model. They have no effect on runs. Lengths
    and places are in one unit of the author's choice; x points to the right and y upwards. Angles are in radians,
    counter-clockwise. A size or length that is not declared follows the extent of the drawing.

    Parameters
    ----------
    name : str
        Name of the shape.
    kind : str
        "mass", "ball", "rotor", "wheel", "pendulum", "ground", "wall", "belt", "tank", "spring", "damper", "rod",
        "shaft", "arrow", "line" or "body".
    at : pair of str or float, optional
        The middle of the lower edge of a mass or tank; the lowest point of a ball; the centre of a rotor or wheel; the
        pivot of a pendulum; a point on the surface of a ground or wall; the middle of the upper side of a belt; the
        start of an arrow.
    ends : pair of str or pair, optional
        Both ends of a spring, damper, rod or shaft: points, or names of other shapes.
    points : sequence of pairs, optional
        Corners of a line or of a body, which is closed and filled.
    vector : pair of str or float, optional
        Extent of an arrow in both directions.
    size : str or float, or pair, optional
        Diameter, width of a belt, spring, damper or shaft, or width and height of a mass or tank.
    length : str or float, optional
        Length of a pendulum, of a ground or wall, or of the upper side of a belt.
    angle : str or float, optional
        Angle of rotation; 0 is a pendulum that hangs down. For a shaft the angle of the first end.
    twist : str or float, optional
        Angle of the second end of a shaft minus that of the first.
    travel : str or float, optional
        Distance that a belt has moved to the right.
    level : str or float, optional
        Height of the water in a tank.
    offset : str or float, optional
        Sideways shift of a spring, damper or rod, to draw two of them next to each other.
    mode_of : str, optional
        Name of the contact or component whose mode colours the shape.
    text : str, optional
        Text on the shape.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> block = hs.Shape("block", "mass", at=("x", 0), mode_of="f")
    >>> spring = hs.Shape("spring", "spring", ends=(("-l", 0), "block"))
    >>> [expr.text for _, expr in spring.expressions()]
    ['-l', '0']
    """

    name: str
    kind: str
    at: Point | None = None
    ends: tuple[Point | str, ...] = ()
    points: tuple[Point, ...] = ()
    vector: Point | None = None
    size: tuple[Expression, ...] = ()
    length: Expression | None = None
    angle: Expression | None = None
    twist: Expression | None = None
    travel: Expression | None = None
    level: Expression | None = None
    offset: Expression | None = None
    mode_of: str = ""
    text: str = ""

    def __post_init__(self) -> None:
        self._texts("name", "kind", "mode_of", "text")
        self._expressions("length", "angle", "twist", "travel", "level", "offset")
        for field in ("at", "vector"):
            if getattr(self, field) is not None:
                object.__setattr__(self, field, self._point(field, getattr(self, field)))
        for field, counts in (("ends", (0, 2)), ("size", (0, 1, 2))):
            if len(as_tuple(getattr(self, field))) not in counts:
                raise self._fault(
                    f"`{field}` cannot be {getattr(self, field)!r}", f"use two entries in `{field}`"
                )
        ends = [end if isinstance(end, str) else self._point("ends", end) for end in as_tuple(self.ends)]
        object.__setattr__(self, "ends", tuple(ends))
        object.__setattr__(self, "points", tuple(self._point("points", p) for p in as_tuple(self.points)))
        size = (self._parsed(value, "size", False) for value in as_tuple(self.size))
        object.__setattr__(self, "size", tuple(size))

    def _point(self, field: str, value: Any) -> Point:
        pair = as_tuple(value)
        if len(pair) != 2:
            raise self._fault(f"`{field}` cannot be {value!r}", "use points (x, y) of numbers or expressions")
        return self._parsed(pair[0], field, False), self._parsed(pair[1], field, False)

    def fields(self) -> tuple[str, ...]:
        """Return the names of the declared fields, except `name` and `kind`."""
        rest = [name for name in self.__dataclass_fields__ if name not in ("name", "kind", "place")]
        return tuple(name for name in rest if getattr(self, name) not in (None, (), ""))

    def expressions(self) -> Iterator[tuple[str, Expression]]:
        """Yield all expressions with their place in the shape, such as ``at[0]``."""
        for field in self.fields():
            yield from _expressions(field, getattr(self, field))


def _expressions(where: str, value: Any) -> Iterator[tuple[str, Expression]]:
    if isinstance(value, Expression):
        yield where, value
    elif isinstance(value, tuple):
        for index, item in enumerate(value):
            yield from _expressions(f"{where}[{index}]" if len(value) > 1 else where, item)
