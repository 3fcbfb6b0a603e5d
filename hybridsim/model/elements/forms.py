"""This module writes the elements of a model as definitions, components, discrete states and inputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from hybridsim.errors import nearest
from hybridsim.expr import Expression, parse, parse_reset, substitute
from hybridsim.expr.walk import stairs_in
from hybridsim.expr.write import write
from hybridsim.model.elements.element import Element
from hybridsim.model.elements.guard_direction import without_directions
from hybridsim.model.elements.quantizer_readers import refuse_readers
from hybridsim.model.elements.requirement import requirements_of
from hybridsim.model.parts.component import Choice, Component, Guard, Mode
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.inputs import HeldInput
from hybridsim.model.parts.quantities import Discrete
from hybridsim.model.rate import inlined, rate_along

_FORMULAS = {
    "saturation": "min(max(input, lower), upper)",
    "deadband": "max(input - upper, 0) + min(input - lower, 0)",
}
_CONTINUOUS = (
    "use a continuous input whose rate has the same formula in all modes, or write the backlash as "
    "a component with modes"
)
# Numbers of steps that a quantizer takes at once where its input jumps, or has another value at the start than 0.
_STRIDES = tuple(2**k for k in range(13, 0, -1))


def written_out(model: Any) -> dict[str, Any]:
    """Return the declarations of a model after elements and guards with a direction have been converted."""
    forms = _Forms(model)
    for element in model.elements:
        element.refuse_unless_complete()
        forms.add(element)
    parts = {"definitions": forms.definitions, "components": forms.components, "schedules": forms.schedules}
    refuse_readers(model, parts, {one.name: one for one in model.elements if one.kind == "quantizer"})
    discrete = sorted(forms.discrete, key=lambda part: isinstance(part, HeldInput))  # as in a file
    return {
        **without_directions(forms.components, forms.definitions),
        "discrete": tuple(discrete),
        "schedules": tuple(forms.schedules),
        "inputs": tuple(forms.inputs),
        "elements": (),
        "requirements": (*model.requirements, *requirements_of(model.elements)),
    }


def _form(element: Element, template: str, **names: str) -> Expression:
    """Fill a template with the expressions of an element, and with names."""
    fields = {name: getattr(element, name) for name in element.__dataclass_fields__ if name not in names}
    parts = {name: value for name, value in fields.items() if isinstance(value, Expression)}
    return parse(substitute(parse(template, element.place), {**parts, **names}).text, element.place)


class _Forms:
    """The declarations of a model, to which the declarations of its elements are added."""

    def __init__(self, model: Any) -> None:
        self.model = model
        self.definitions, self.components = [*model.definitions], [*model.components]
        self.discrete, self.schedules, self.inputs = [*model.discrete], [*model.schedules], [*model.inputs]

    def add(self, element: Element) -> None:
        if element.kind in _FORMULAS:
            self.definitions.append((element.name, _form(element, _FORMULAS[element.kind])))
        elif element.kind == "delay":
            self._delay(element)
        else:
            makers = {"relay": self._relay, "backlash": self._backlash, "quantizer": self._quantizer}
            self.components.append(makers[element.kind](element))

    def _relay(self, element: Element) -> Component:
        down = Guard(
            "off", _form(element, "input - off"), (Choice("off", place=element.place),), place=element.place
        )
        up = Guard(
            "on", _form(element, "on - input"), (Choice("on", place=element.place),), place=element.place
        )
        modes = tuple(
            Mode(mode, (guard,), set={element.name: _form(element, value)}, place=element.place)
            for mode, guard, value in (("on", down, "high"), ("off", up, "low"))
        )
        return Component(element.name, modes, element.initial, place=element.place)

    def _backlash(self, element: Element) -> Component:
        rate = self._rate(element)
        place, held = (
            element.place,
            self._new_discrete(element, f"{element.name}_held", _form(element, "start")),
        )
        modes = [
            Mode(
                "free",
                (
                    Guard(
                        "upper",
                        _form(element, "held + width/2 - input", held=held),
                        (Choice("up", place=place),),
                    ),
                    Guard(
                        "lower",
                        _form(element, "input - held + width/2", held=held),
                        (Choice("down", place=place),),
                    ),
                ),
                set={element.name: parse(held)},
                place=place,
            )
        ]
        for mode, value, turns in (("up", "input - width/2", "rate"), ("down", "input + width/2", "-rate")):
            moved = _form(element, value)
            turning = parse(substitute(parse(turns, place), {"rate": rate}).text, place)
            guard = Guard("turns", turning, (Choice("free", None, {held: moved}, place=place),), place=place)
            modes.append(Mode(mode, (guard,), set={element.name: moved}, place=place))
        return Component(element.name, tuple(modes), "free", place=place)

    def _quantizer(self, element: Element) -> Component:
        place, whole = element.place, self._new_discrete(element, f"{element.name}_whole", parse(0))
        guards = [
            Guard(
                name,
                _form(element, expr, whole=whole),
                tuple(self._strides(element, whole, sign)),
                place=place,
            )
            for name, expr, sign in (
                ("up", "(whole + 0.5)*step - input", "+"),
                ("down", "input - (whole - 0.5)*step", "-"),
            )
        ]
        mode = Mode(
            "on", tuple(guards), set={element.name: _form(element, "whole*step", whole=whole)}, place=place
        )
        return Component(element.name, (mode,), place=place)

    def _strides(self, element: Element, whole: str, sign: str) -> Iterator[Choice]:
        """Yield the choices of a quantizer, beginning with the largest change."""
        for stride in _STRIDES:
            when = f"{sign}(input - whole*step) >= {stride - 0.5}*step"
            yield Choice("on", _form(element, when, whole=whole), {whole: parse_reset(f"+= {sign}{stride}")})
        yield Choice("on", None, {whole: parse_reset(f"+= {sign}1")}, place=element.place)

    def _new_discrete(self, element: Element, name: str, start: Expression) -> str:
        self.discrete.append(Discrete(name, start, place=element.place))
        return name

    def _rate(self, element: Element) -> Expression:
        """Return the rate of a backlash's input; raise an error if the input or its rate jumps."""
        title = f"element {element.name}: the input"
        jumping, whole = _jumping(self.model), inlined(element.input, dict(self.definitions))
        for call in stairs_in(whole.tree):
            raise element.error(f"{title} of a backlash contains '{write(call)}', which jumps", _CONTINUOUS)
        for name in sorted(whole.names):
            if name in jumping:
                raise element.error(
                    f"{title} of a backlash depends on '{name}', {jumping[name]}",
                    _CONTINUOUS,
                )
        constants: tuple[Declared, ...] = (*self.model.parameters, *self.model.discrete)
        return rate_along(element.input, title, self.model.states, self.definitions, constants)

    def _delay(self, element: Element) -> None:
        if element.clock is not None and element.ticks is not None and element.time is None:
            self._queue(element, element.clock, element.ticks)
        elif element.time is not None and element.clock is None and element.ticks is None:
            self._shifted_input(element, element.time)
        else:
            remedy = "set `clock` and `ticks`, or `time` alone for an input of kind 'table' or 'wave'"
            raise element.error(
                f"element {element.name}: the delay needs either `time`, or `clock` and `ticks`", remedy
            )

    def _queue(self, element: Element, clock: str, ticks: int) -> None:
        """Add discrete states that store the last samples; each tick of the clock shifts the samples by one place."""
        schedules = {schedule.name: k for k, schedule in enumerate(self.schedules)}
        if clock not in schedules:
            message = f"element {element.name}: unknown clock '{clock}'"
            raise element.error(message, nearest(clock, schedules, kind="clocks and schedules"))
        stages = [f"{element.name}_{k}" for k in range(1, ticks)] + [element.name]
        values = [element.input, *(parse(stage) for stage in stages[:-1])]
        for stage in stages:
            self._new_discrete(element, stage, _form(element, "start"))
        known = self.schedules[schedules[clock]]
        moved = dict(zip(stages, values, strict=True))
        self.schedules[schedules[clock]] = replace(known, reset={**known.reset, **moved})

    def _shifted_input(self, element: Element, time: Expression) -> None:
        """Add a copy of a table or wave, delayed by a given time."""
        title = f"element {element.name}"
        signal = next((one for one in self.inputs if one.name == element.input.text), None)
        if signal is None or signal.kind not in ("table", "wave"):
            raise element.error(
                f"{title}: '{element.input.text}' cannot be delayed by a fixed time, because a model does not store "
                "past states",
                "set `clock` and `ticks` to delay a sampled value, or approximate the delay by further states; `time` "
                "delays inputs of kind 'table' and 'wave'",
            )
        varying = sorted(time.names - {parameter.name for parameter in self.model.parameters})
        if varying:
            raise element.error(
                f"{title}: the delay '{time.text}' depends on '{varying[0]}', which is not a parameter",
                "use a number or an expression of parameters: a delay cannot change during a run",
            )
        later = time
        if signal.phase is not None:
            later = substitute(parse("phase + time", element.place), {"phase": signal.phase, "time": time})
        self.inputs.append(replace(signal, name=element.name, phase=later, place=element.place))


def _jumping(model: Any) -> dict[str, str]:
    """Return the quantities that jump, or whose rate depends on a mode, each with the reason."""
    choices = [choice for part in model.components for m in part.modes for g in m.guards for choice in g.then]
    choices += [part.limit for part in model.components if part.limit]
    resets: tuple[Any, ...] = (*choices, *model.monitors, *model.schedules)
    found = {name: "which a reset changes" for part in resets for name in part.reset}
    found |= {part.name: "which jumps" for part in model.discrete}
    found |= {n: "whose rate depends on a mode" for c in model.components for m in c.modes for n in m.der}
    struck = {impact.name for impact in model.impacts}
    definitions = dict(model.definitions)
    for state in model.states:
        if struck and not struck.isdisjoint(inlined(state.der, definitions).names):
            found[state.name] = "which jumps in impacts"
    return found
