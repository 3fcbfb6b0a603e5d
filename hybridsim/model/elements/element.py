"""This module defines elements of control loops, such as relays and delays, which are declared in one line."""

from __future__ import annotations

from dataclasses import dataclass

from hybridsim.errors import nearest
from hybridsim.expr import Expression
from hybridsim.model.parts.declared import Declared

# Required and optional fields of each kind of element.
KINDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "relay": (("input", "on", "off"), ("high", "low", "initial")),
    "saturation": (("input", "lower", "upper"), ()),
    "deadband": (("input", "lower", "upper"), ()),
    "backlash": (("input", "width"), ("start",)),
    "quantizer": (("input", "step"), ()),
    "delay": (("input",), ("time", "clock", "ticks", "start")),
}
_DEFAULTS: dict[str, dict[str, object]] = {
    "relay": {"high": 1, "low": 0, "initial": "off"},
    "backlash": {"start": 0},
    "delay": {"start": 0},
}
_MOST_TICKS = 1000  # each tick of a delay is a discrete state


@dataclass(frozen=True)
class Element(Declared):
    """A quantity that follows an input in a nonlinear way; its name can be used in expressions.

    relay
        The value is ``high`` from the time when the input rises through the level ``on``, and ``low`` from the time
        when it falls through the level ``off``, which is below ``on``. An input that stops exactly at a level does not
        pass it: for a signal of 0 and 1 use levels between them. ``initial`` is the mode at the start, "on" or "off".
    saturation
        The input, limited to values from ``lower`` to ``upper``. The limits may be equal.
    deadband
        Zero for an input from ``lower`` to ``upper``; beyond them the distance of the input from the nearer one. The
        limits may be equal.
    backlash
        The position of a part with play: it stays where it is until the input is half of ``width`` away from it, and
        is then moved by the input at that distance. ``start`` is its position at the start. The input is a
        continuous function of states and time.
    quantizer
        The multiple of ``step`` that is nearest to the input, with an event where it changes. Rates and outputs may
        use it; guards, resets and contacts must not use it.
    delay
        The value that the input had some ticks of a schedule or clock before: one of ``ticks`` values in a queue, each
        taken at a tick. If an input jumps at a tick, its value after the jump counts; a discrete state that another
        schedule sets at this time has its value before. All are ``start`` at first. With ``time`` instead of ``clock``
        and ``ticks`` it is the value of an input of kind "table" or "wave" that much earlier.

    A model writes its elements as definitions, components and discrete states; ``model.elements`` is then empty.

    Parameters
    ----------
    name : str
        Name of the element.
    kind : str
        "relay", "saturation", "deadband", "backlash", "quantizer" or "delay".
    input : str or float
        The input.
    on, off : str or float, optional
        Levels of a relay.
    high, low : str or float, optional
        Values of a relay, by default 1 and 0.
    initial : str, optional
        Initial mode of a relay, "on" or "off"; the latter by default.
    lower, upper : str or float, optional
        Limits of a saturation or of a dead band.
    width : str or float, optional
        Total play of a backlash.
    start : str or float, optional
        Initial position of a backlash, or initial value of a delay, by default 0.
    step : str or float, optional
        Distance of the values of a quantizer.
    time : str or float, optional
        Delay of a table or wave.
    clock : str, optional
        Name of the schedule or clock whose ticks delay the input.
    ticks : int, optional
        Number of ticks.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> heater = hs.Element("heat", "relay", input="-T", on=-19, off=-21, high=25)
    >>> room = hs.Model("room", states=[hs.State("T", 15, "(5 + heat - T)/2")], elements=[heater])
    >>> [event.target for event in hs.simulate(room, (0, 2)).events]
    ['on', 'off', 'on', 'off', 'on']
    """

    name: str
    kind: str
    input: Expression
    on: Expression | None = None
    off: Expression | None = None
    high: Expression | None = None
    low: Expression | None = None
    initial: str | None = None
    lower: Expression | None = None
    upper: Expression | None = None
    width: Expression | None = None
    start: Expression | None = None
    step: Expression | None = None
    time: Expression | None = None
    clock: str | None = None
    ticks: int | None = None

    def __post_init__(self) -> None:
        self._texts("name", "kind", "initial", "clock")
        for name, value in _DEFAULTS.get(self.kind, {}).items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        levels = ("on", "off", "high", "low", "lower", "upper")
        self._expressions("input", *levels, "width", "start", "step", "time")
        ticks: object = self.ticks
        if ticks is not None and (type(ticks) is not int or not 1 <= ticks <= _MOST_TICKS):
            raise self._fault(f"`ticks` cannot be {ticks!r}", f"use a whole number from 1 to {_MOST_TICKS}")

    def refuse_unless_complete(self) -> None:
        """Raise an error for an unknown kind, for missing fields, and for fields that the kind does not have."""
        element = f"element {self.name}"
        if self.kind not in KINDS:
            raise self.error(
                f"{element}: unknown kind '{self.kind}'", nearest(self.kind, KINDS, kind="kinds")
            )
        required, optional = KINDS[self.kind]
        for field in required:
            if getattr(self, field) is None:
                raise self.error(f"{element} of kind {self.kind} needs '{field}'", f"set '{field}'")
        known = {"name", "kind", "place", *required, *optional}
        for field in self.__dataclass_fields__:
            if field not in known and getattr(self, field) is not None:
                raise self.error(f"{element} of kind {self.kind} cannot have '{field}'", f"remove '{field}'")
        if self.initial not in (None, "on", "off"):
            raise self.error(f"{element}: unknown initial mode '{self.initial}'", "use 'on' or 'off'")
