"""What a system is: states, parameters, automata, contacts, inputs, events and outputs, all frozen."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from numbers import Real
from typing import Any

from hybridsim.errors import ExpressionError, ModelError, Place, UsageError, nearest
from hybridsim.expr import Expression, evaluate, parse, resolve
from hybridsim.files import path_text
from hybridsim.model.component import Component, Corner
from hybridsim.model.contact import Contact
from hybridsim.model.declared import Declared, as_tuple
from hybridsim.model.impact import Impact
from hybridsim.model.inputs import Input
from hybridsim.model.law_with_states import ContactState
from hybridsim.model.monitor import Monitor
from hybridsim.model.quantities import Discrete, Output, Parameter, State
from hybridsim.model.schedule import Schedule
from hybridsim.model.switching import SwitchingSurface

_PARTS: dict[str, type[Declared]] = {
    "states": State,
    "parameters": Parameter,
    "discrete": Discrete,
    "components": Component,
    "contacts": Contact,
    "inputs": Input,
    "monitors": Monitor,
    "schedules": Schedule,
    "outputs": Output,
    "surfaces": SwitchingSurface,
    "impacts": Impact,
}

# methods that other parts of the package call; completion does not offer them
_INTERNAL = {
    "components_of",
    "error",
    "is_known_to_be_sound",
    "once",
    "place",
    "remedy_for_parameter",
    "structure",
    "with_values_of",
}


@dataclass(frozen=True)
class Model(Declared):
    """A piecewise-smooth system.

    Parameters
    ----------
    name : str
        What the model is called.
    states : sequence of State, or mapping of str to float
        Continuous states with their rates.
    parameters : sequence of Parameter, or mapping of str to str or float, optional
        `Parameter` objects, or a dict of name to number or expression.
    discrete : sequence of Discrete, optional
        States changed by resets and ticks only.
    components, contacts : sequence of Component, sequence of Contact, optional
        The automata; their modes together are the discrete state z.
    inputs, monitors, schedules : sequence, optional
        Of `Input`, known signals; of `Monitor`, events that change no mode; of `Schedule`, events at known
        times.
    outputs : sequence of Output, or mapping of str to str or float, optional
        `Output` objects, or a dict of name to expression.
    definitions : mapping of str to str or float, or sequence of pairs, optional
        Named intermediate expressions, a dict or pairs; they may use one another and what components set.
    title, source, description, look : str, optional
        What it is, where it comes from, more, and what to look at.
    duration : str or float, optional
        How long a run shows what there is to see, in the unit of t: an expression of parameters, the default
        of ``hybridsim run`` and of comparisons. None leaves it to them.
    path : str, optional
        The file it was read from.
    flow : callable, optional
        A Python function (t, x, p) -> the n rates (a tuple or an array), instead of rates by expressions. p
        has the parameters as ``p.g`` and ``p[0]``. The states are then a dict of name to start value, or have
        der 0; ``flow`` of a `Mode` replaces it there; guards, monitors, outputs, conditions and resets are
        functions (t, x, p) -> a number, or a constant. Contacts, inputs, definitions and discrete states need
        expressions.
    surfaces : sequence of SwitchingSurface, optional
        Switching surfaces, along which the motion may slide; automata as well.
    impacts : sequence of Impact, optional
        Unilateral contacts, whose gaps cannot become negative; automata as well.
    place : Place, optional
        Where it is written, for the messages of errors.

    Examples
    --------
    >>> free = Model("free", states=[State("x", 1, der="v"), State("v", 0, der="-k*x")], parameters={"k": 4})
    >>> free.with_(k=9).parameter_values()
    {'k': 9.0}
    >>> fall = Model("fall", states={"h": 1, "w": 0}, parameters={"g": 9.81}, flow=lambda t, x, p: (x[1], -p.g))
    >>> fall.validate() is fall
    True
    """

    name: str
    states: tuple[State, ...]
    parameters: tuple[Parameter, ...] = ()
    discrete: tuple[Discrete, ...] = ()
    components: tuple[Component, ...] = ()
    contacts: tuple[Contact, ...] = ()
    inputs: tuple[Input, ...] = ()
    monitors: tuple[Monitor, ...] = ()
    schedules: tuple[Schedule, ...] = ()
    outputs: tuple[Output, ...] = ()
    definitions: tuple[tuple[str, Expression], ...] = ()
    title: str = ""
    source: str = ""
    description: str = ""
    look: str = ""
    duration: Expression | None = None
    path: str | None = None
    flow: Callable[..., Any] | None = None
    surfaces: tuple[SwitchingSurface, ...] = ()
    impacts: tuple[Impact, ...] = ()

    def __post_init__(self) -> None:
        self._functions("flow")
        self._named("states", self._state)
        self._named("parameters", Parameter)
        self._named("discrete", Discrete)
        self._named("outputs", Output)
        self._texts("name", "title", "source", "description", "look")
        self._expressions("duration")
        for field, kind in _PARTS.items():
            self._parts(field, kind)
        pairs = self.definitions.items() if isinstance(self.definitions, Mapping) else self.definitions
        try:
            definitions = tuple((name, parse(text)) for name, text in pairs)
        except (TypeError, ValueError):
            remedy = "give a mapping from names to expressions, or pairs of the two"
            raise self._fault(f"definitions is {self.definitions!r}", remedy) from None
        object.__setattr__(self, "definitions", definitions)
        object.__setattr__(self, "states", tuple(self._with_those_of_laws()))

    def _with_those_of_laws(self) -> Iterable[State]:
        """The states, those that laws of contacts bring among them, as the contacts have them now."""
        brought: dict[str, State] = {}
        for contact in self.contacts:
            try:
                states = self._brought_by(contact)
            except ModelError:
                continue  # `validate` reports it
            brought |= {state.name: state for state in states}
        for state in self.states:
            yield brought.pop(state.name, state) if isinstance(state, ContactState) else state
        yield from brought.values()

    def _load_rate(self, contact: Contact) -> Expression:
        from hybridsim.model.rate import rate_along

        return rate_along(self, contact.normal, f"the normal load of contact {contact.name}")

    def _state(self, name: str, start: Any) -> State:
        if self.flow is None:
            remedy = (
                "give hs.State(name, start, der) objects, or the rates of all as a function flow(t, x, p)"
            )
            raise self._fault(f"states gives {name} no rate", remedy)
        return State(name, start, parse(0))

    def _named(self, field: str, kind: Callable[[str, Any], Any]) -> None:
        given = getattr(self, field)
        if isinstance(given, Mapping):
            object.__setattr__(self, field, tuple(kind(name, value) for name, value in given.items()))

    def __eq__(self, other: object) -> bool:
        """Equal when everything declared is; where it was read from does not count."""
        if not isinstance(other, Model):
            return NotImplemented
        return _content(self) == _content(other)

    def __hash__(self) -> int:
        return hash(_content(self))

    def __dir__(self) -> list[str]:
        return sorted(set(super().__dir__()) - _INTERNAL)

    def __repr__(self) -> str:
        automata = [contact.name for contact in self.contacts]
        automata += [surface.name for surface in self.surfaces] + [impact.name for impact in self.impacts]
        automata += [part.name for part in self.components]
        names = ", ".join(state.name for state in self.states)
        return f"<Model {self.name}: states {names or 'none'}; components {', '.join(automata) or 'none'}>"

    def with_(self, /, **changes: Expression | str | float) -> Model:
        """A copy with parameter values changed: ``model.with_(N=40, omega="0.7*sqrt(k/m)")``.

        Parameters
        ----------
        **changes : str or float
            Parameter to number or expression of other parameters.

        Returns
        -------
        Model
            The copy.

        Raises
        ------
        UsageError
            For a name that is no parameter.
        ExpressionError
            For a value that is no expression.
        """
        names = [parameter.name for parameter in self.parameters]
        _known(changes, names, "parameter", self.name, self.remedy_for_parameter)
        changed = (
            replace(p, value=_given(changes, p.name)) if p.name in changes else p for p in self.parameters
        )
        return self._valued(parameters=tuple(changed))

    def remedy_for_parameter(self, name: str, others: tuple[str, ...] = ()) -> str:
        """What to do where a name is no parameter: near names, or how an argument of a law becomes a parameter."""
        names = [parameter.name for parameter in self.parameters]
        for contact in self.contacts:
            if name not in contact.law.parameters:
                continue
            given = contact.arguments.get(name, contact.law.parameters[name])
            if given is not None and given.text in names:
                return f"contact {contact.name} has {name} = {given.text}: change {given.text}."
            text = "its own default" if given is None else given.text
            return (
                f"{name} is an argument of the law of contact {contact.name}, written there as {text}: name a "
                f'parameter, {name} = {text} under [parameters], and write law = {{ ..., {name} = "{name}" }}.'
            )
        return nearest(name, [*names, *others], kind="parameters and states" if others else "parameters")

    def with_start(self, /, **changes: Expression | str | float) -> Model:
        """A copy with initial values of states and discrete states changed: ``model.with_start(x=0.1)``."""
        names = [*(part.name for part in self.states), *(part.name for part in self.discrete)]
        _known(changes, names, "state", self.name)
        contacts = tuple(self._started(contact, changes) for contact in self.contacts)

        def changed(parts: Iterable[Any]) -> tuple[Any, ...]:
            return tuple(
                replace(part, start=_given(changes, part.name)) if part.name in changes else part
                for part in parts
            )

        return self._valued(states=changed(self.states), discrete=changed(self.discrete), contacts=contacts)

    def with_values_of(self, other: Model) -> Model:
        """A copy with the values of a model that has the same parameters, states and discrete states."""
        states = tuple(replace(s, start=o.start) for s, o in zip(self.states, other.states, strict=True))
        return self._valued(states=states, parameters=other.parameters, discrete=other.discrete)

    def _valued(self, **parts: Any) -> Model:
        """A copy that differs in values alone: it shares what does not depend on them, and is not taken apart again."""
        copy: Model = object.__new__(type(self))
        vars(copy).update(vars(self), **parts, _common=self._common)
        vars(copy).pop("_values", None)
        return copy

    @cached_property
    def _common(self) -> dict[str, Any]:
        return {}

    def once(self, name: str, make: Callable[[], Any]) -> Any:
        """What follows from the declaration whatever its values are, made once for all copies with other values."""
        if name not in self._common:
            self._common[name] = make()
        return self._common[name]

    def _started(self, contact: Contact, changes: Mapping[str, Any]) -> Contact:
        """The contact with new initial values of states that its law brings."""
        own = {name for name in changes if name.startswith(contact.variable(""))}
        if not (own and contact.law.states):
            return contact
        own &= {state.name for state in self._brought_by(contact)}
        start = {name.removeprefix(contact.variable("")): parse(changes[name]) for name in sorted(own)}
        return replace(contact, start={**contact.start, **start})

    def _brought_by(self, contact: Contact) -> tuple[State, ...]:
        return contact.states(self._never_negative_names(), partial(self._load_rate, contact))

    def regularized(self, kind: str, *, v0: Expression | str | float) -> Model:
        """A copy in which every contact has a single-valued force, for a look at what that costs.

        ::

            tanh     f = slip(|v|) tanh(v/v0)
            arctan   f = slip(|v|) (2/pi) atan(v/v0)
            karnopp  in the band |v| < v0 the body is stopped and f is what holds it, up to the limit of stick

        With tanh and arctan there is no stick: a loaded body creeps at a speed of the order of v0, the modes are
        gone and the problem gets stiff as v0 falls. The error falls with v0 too: at first order, but for
        logarithms, with tanh; with v0**(2/3) with arctan, whose tails blunt each release; with karnopp at first
        order or better where mu_s = mu_k, with v0**(1/2) where mu_s > mu_k (the time to leave the band).

        Parameters
        ----------
        kind : str
            "tanh", "arctan" or "karnopp".
        v0 : str or float
            Width, a velocity above zero in the unit of the relative velocity; a parameter ``v0`` of the copy.

        Returns
        -------
        Model
            The copy.

        Raises
        ------
        UsageError
            For a kind that does not exist, a model without contacts, and what a kind cannot stand for: static
            friction above slip(0) with tanh and arctan, contacts that act on each other with karnopp.

        References
        ----------
        D. Karnopp, J. Dyn. Syst. Meas. Control 107 (1985) 100, doi:10.1115/1.3140698.
        """
        from hybridsim.model.regularize import regularized

        return regularized(self, kind, v0)

    def parameter_values(self) -> dict[str, float]:
        """Numbers of all parameters; a circle among them, or a value that is not finite, is an error."""
        return dict(self._values)

    @cached_property
    def _values(self) -> dict[str, float]:
        return resolve({parameter.name: parameter.value for parameter in self.parameters})

    def start_values(self) -> dict[str, float]:
        """Initial values of the states at the parameters' values."""
        return {state.name: evaluate(state.start, self._values) for state in self.states}

    def discrete_values(self) -> dict[str, float]:
        """Initial values of the discrete states at the parameters' values."""
        return {part.name: evaluate(part.start, self._values) for part in self.discrete}

    def duration_value(self) -> float | None:
        """The model's own duration at the parameters' values; None where it declares none."""
        return None if self.duration is None else evaluate(self.duration, self._values)

    def all_components(self) -> tuple[Component, ...]:
        """All automata: the contacts expanded, surfaces, impacts, components, in order of declaration; corners last."""
        components: tuple[Component, ...] = self.once("components", self._components)
        return components

    def _components(self) -> tuple[Component, ...]:
        parts = [part for contact in self.contacts for part in self.components_of(contact)]
        parts += [surface.component() for surface in self.surfaces]
        parts += [impact.component() for impact in self.impacts]
        parts += self.components
        return tuple(sorted(parts, key=lambda part: isinstance(part, Corner)))

    def components_of(self, contact: Contact) -> tuple[Component, ...]:
        """The automata that one of its contacts becomes."""
        return contact.components(self._never_negative_names(), partial(self._load_rate, contact))

    def constant_names(self) -> frozenset[str]:
        """Names that cannot change during a run: parameters, and definitions over these alone."""
        names: frozenset[str] = self.once("constants", self._constant_names)
        return names

    def _never_negative_names(self) -> frozenset[str]:
        """Names that are constant, or normal forces that impacts see to: a load of these needs no guard."""
        return self.constant_names() | {impact.name for impact in self.impacts}

    def _constant_names(self) -> frozenset[str]:
        constants = {parameter.name for parameter in self.parameters}
        for _ in self.definitions:
            constants |= {name for name, expr in self.definitions if expr.names <= constants}
        return frozenset(constants)

    def variables(self) -> dict[str, Component]:
        """Variables that components set (contact forces among them), each with its component."""
        return {name: component for component in self.all_components() for name in component.variables}

    def structure(self) -> str:
        """Canonical text of all that generated code depends on.

        Parameter values, initial values, units, titles and the numbers of tables are not in it, so models
        that differ only in these share their code.
        """
        from hybridsim.model.structure import structure

        text: str = self.once("structure", lambda: structure(self))
        return text

    @property
    def is_known_to_be_sound(self) -> bool:
        """Whether a check of this model, or of a copy with other values, found no fault but in values."""
        return "is sound" in self._common

    def validate(self) -> Model:
        """See to it that the declaration holds together; returns the model itself.

        Returns
        -------
        Model
            The model itself.

        Raises
        ------
        ModelError
            With all faults in ``errors``.
        """
        from hybridsim.model.validate import find_errors

        errors = find_errors(self)
        if errors:
            raise ModelError.collect(errors, f"model {self.name}")
        return self

    def to_toml(self) -> str:
        """The model as a TOML text that stands on its own: laws and tables are written into it.

        Returns
        -------
        str
            The text.

        Raises
        ------
        UsageError
            For a model of Python functions: a text cannot hold them.
        """
        from hybridsim.model.toml_write import write_model

        if self.flow is not None:
            raise UsageError(
                f"model {self.name} is made of Python functions, which cannot be written to TOML",
                remedy="write its rates, guards and resets as expressions, or keep it as a Python file",
            )
        return write_model(self)

    @classmethod
    def from_toml(cls, text: str, path: str | None = None) -> Model:
        """Read and validate a model from TOML text; ``path`` names the file and finds its tables."""
        from hybridsim.model.toml_read import read_model

        if not isinstance(text, str):
            raise UsageError(f"the model's text is {text!r}", remedy="give TOML, or load a file by its path")
        if path is not None:
            path = path_text(path)
        return read_model(text, path)


def _content(model: Model) -> tuple[object, ...]:
    parts = (
        model.states, model.parameters, model.discrete, model.components, model.contacts, model.surfaces, model.inputs,
        model.monitors, model.schedules, model.outputs, model.definitions, model.impacts,
    )  # fmt: skip
    words = (model.title, model.source, model.description, model.look, model.duration)
    return (model.name, *parts, *words, model.flow)


def _given(changes: Mapping[str, Any], name: str) -> Expression:
    """A changed value; where it is no expression, that is said of its name."""
    try:
        return parse(changes[name])
    except ExpressionError as error:
        where = error.place or Place()
        place = replace(where, file=where.file or name)
        raise ExpressionError(error.message, place=place, remedy=error.remedy) from None


def _known(
    changes: Mapping[str, Any],
    names: Iterable[str],
    kind: str,
    model: str,
    remedy: Callable[[str], str] | None = None,
) -> None:
    allowed = as_tuple(names)
    for name, value in changes.items():
        if not isinstance(value, Expression | str | Real):
            raise UsageError(f"{kind} {name} is {value!r}", remedy="give a number or an expression")
        if name not in allowed:
            raise UsageError(
                f"the model '{model}' has no {kind} '{name}'",
                remedy=remedy(name) if remedy else nearest(name, allowed, kind=f"{kind}s"),
            )
