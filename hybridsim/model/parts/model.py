"""This module defines the class Model, with states, parameters, automata, contacts and events."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from os import PathLike
from typing import Any, ClassVar

from hybridsim.errors import ModelError, UsageError
from hybridsim.expr import Expression, evaluate, parse, resolve
from hybridsim.expr.evaluate import dependency_order
from hybridsim.files import path_text
from hybridsim.model.elements.element import Element
from hybridsim.model.elements.forms import written_out
from hybridsim.model.elements.requirement import Requirement
from hybridsim.model.flattening.flatten import flattened
from hybridsim.model.laws.law import FrictionLaw
from hybridsim.model.laws.law_with_states import ContactState
from hybridsim.model.parts import changes as changing
from hybridsim.model.parts.component import Component, Corner
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.impact import Impact
from hybridsim.model.parts.inputs import Input, held_as_discrete
from hybridsim.model.parts.monitor import Monitor
from hybridsim.model.parts.quantities import Discrete, Output, Parameter, State
from hybridsim.model.parts.remedies import remedy_for_state
from hybridsim.model.parts.schedule import Schedule
from hybridsim.model.parts.shape import Shape
from hybridsim.model.parts.switching import SwitchingSurface
from hybridsim.model.parts.use import Use
from hybridsim.model.rate import rate_along

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
    "drawing": Shape,
    "use": Use,
    "elements": Element,
    "requirements": Requirement,
}

# methods that other parts of the package call; completion does not offer them
_INTERNAL = {
    "changed_numbers", "components_of", "connected_units", "error", "is_known_to_be_sound", "once",
    "once_per_expressions", "place", "structure", "with_values_of",
}  # fmt: skip


@dataclass(frozen=True)
class Model(Declared):
    """A piecewise-smooth (hybrid) dynamical system.

    Parameters
    ----------
    name : str
        Name of the model.
    states : sequence of State, or mapping of str to float, optional
        Continuous states with their rates.
    parameters : sequence of Parameter, or mapping of str to str or float, optional
        `Parameter` objects, or a dict of names and numbers or expressions.
    discrete : sequence of Discrete, optional
        States that change only by resets.
    components, contacts : sequence of Component, sequence of Contact, optional
        The automata; their modes together are the discrete state z.
    inputs, monitors, schedules : sequence, optional
        `Input` objects (known signals), `Monitor` objects (events that change no mode) and `Schedule` objects
        (events at known times).
    outputs : sequence of Output, or mapping of str to str or float, optional
        `Output` objects, or a dict of names and expressions.
    definitions : mapping of str to str or float, or sequence of pairs, optional
        Named intermediate expressions, as a dict or as pairs. They may use each other and the variables of components.
    title, source, description, look : str, optional
        Title, reference, longer description, and a hint what to look at.
    duration : str or float, optional
        Default length of runs of the command line, in the unit of t; an expression of parameters.
    path : str, optional
        Path of the file that the model was read from.
    flow : callable, optional
        A Python function (t, x, p) that returns the n rates (a tuple or an array), instead of expressions. The
        parameters are ``p.g`` or ``p[0]``. The states are then a dict of names and start values, or have der 0.
        ``flow`` of a `Mode` replaces it in that mode. Guards, monitors, outputs, conditions and resets are functions
        (t, x, p) that return a number, or constants. Contacts, inputs and discrete states need expressions.
    surfaces, impacts : sequence, optional
        `SwitchingSurface` objects, along which the motion may slide, and `Impact` objects (unilateral contacts).
    drawing, use : sequence, optional
        `Shape` objects, which show the mechanism, and `Use` objects: other models as parts, with names like ``left.x``.
    elements, requirements : sequence, optional
        `Element` objects, which become definitions, components and other parts, and inequalities that these add.
    place : Place, optional
        Place of the declaration, for error messages.

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
    states: tuple[State, ...] = ()
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
    drawing: tuple[Shape, ...] = ()
    use: tuple[Use, ...] = ()
    elements: tuple[Element, ...] = ()
    requirements: tuple[Requirement, ...] = ()

    _part_files: ClassVar[tuple[str, ...]] = ()  # files of its parts, if it was read from a file
    connected_units: ClassVar[dict[str, str]] = {}  # units of the inputs of its parts that are connected
    # parameters that may have other numbers than the model with which `_unnumbered` began
    _renumbered: ClassVar[frozenset[str]] = frozenset()

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
            remedy = "use a dict of names and expressions, or a list of pairs"
            raise self._fault(f"`definitions` cannot be {self.definitions!r}", remedy) from None
        object.__setattr__(self, "definitions", definitions)
        self._put(held_as_discrete(self.inputs, self.discrete))
        if self.use:
            self._put({**flattened(self), "use": ()})
        self._put(written_out(self))
        self._put({"states": tuple(self._with_those_of_laws())})

    def _put(self, fields: Mapping[str, Any]) -> None:
        """Replace declared parts by the parts that the engine computes."""
        for field, parts in fields.items():
            object.__setattr__(self, field, parts)

    def _with_those_of_laws(self) -> Iterable[State]:
        """Yield the states with their current values, including the states that laws of contacts add."""
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
        what, constants = f"the normal load of contact {contact.name}", (*self.parameters, *self.discrete)
        return rate_along(contact.normal, what, self.states, self.definitions, constants)

    def _state(self, name: str, start: Any) -> State:
        if self.flow is None:
            remedy = (
                "use hs.State(name, start, der) in `states`, or define all rates by a function flow(t, x, p)"
            )
            raise self._fault(f"the state '{name}' has no rate", remedy)
        return State(name, start, parse(0))

    def _named(self, field: str, kind: Callable[[str, Any], Any]) -> None:
        entries = getattr(self, field)
        if isinstance(entries, Mapping):
            object.__setattr__(self, field, tuple(kind(name, value) for name, value in entries.items()))

    def __eq__(self, other: object) -> bool:
        """Compare all declared parts; the place and the path of the file are ignored."""
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
        """Return a copy with changed parameter values: ``model.with_(N=40, omega="0.7*sqrt(k/m)")``.

        Parameters
        ----------
        **changes : str or float
            New values of parameters, numbers or expressions of other parameters. ``"brake.mu"`` is the argument mu of
            the law of contact brake, an expression of any names of the model.

        Returns
        -------
        Model
            The copy.

        Raises
        ------
        UsageError
            For an unknown parameter.
        ExpressionError
            For a value that is not a valid expression.
        """
        model, others = changing.with_arguments(self, changes)
        if model is not self:
            return model.with_(**others)
        parameters, are_numbers = changing.changed_parameters(self, changes)
        if not are_numbers:
            return self._valued(parameters=parameters)
        known = {"_unnumbered": self._unnumbered, "_renumbered": self._renumbered.union(changes)}
        return self._valued(parameters=parameters, **known)

    def with_start(self, /, **changes: Expression | str | float) -> Model:
        """Return a copy with changed initial values of (discrete) states: ``model.with_start(x=0.1)``."""
        names = [*(part.name for part in self.states), *(part.name for part in self.discrete)]
        changing.require_known(changes, names, "state", self.name, partial(remedy_for_state, self))
        contacts = tuple(changing.started(contact, changes, self._brought_by) for contact in self.contacts)
        states, discrete = (
            changing.with_starts(self.states, changes),
            changing.with_starts(self.discrete, changes),
        )
        return self._valued(states=states, discrete=discrete, contacts=contacts)

    def with_law(self, contact: str, law: FrictionLaw | str | PathLike[str], /, **parameters: Any) -> Model:
        """Return a checked copy with another law in a contact: ``model.with_law("f", "stribeck", v_s=0.1)``.

        A parameter that is not passed keeps the value that the contact gives it now. Otherwise it has its default.

        Parameters
        ----------
        contact : str
            Name of the contact.
        law : FrictionLaw, str or path
            A `FrictionLaw`, the name of a packaged law, or the path of a file with a law.
        **parameters : str or float
            Values of parameters of the law, numbers or expressions of the model's names.
        """
        changed: Model = changing.with_law(self, contact, law, parameters, self._brought_by)
        return changed

    def with_values_of(self, other: Model) -> Model:
        """Return a copy with the values of another model with the same parameters and states."""
        states = tuple(replace(s, start=o.start) for s, o in zip(self.states, other.states, strict=True))
        hidden = self.discrete[len(other.discrete) :]  # whole numbers of floor, mod and round
        discrete, values = (*other.discrete, *hidden), other._values
        return self._valued(states=states, parameters=other.parameters, discrete=discrete, _values=values)

    def _valued(self, **parts: Any) -> Model:
        """Return a copy that differs only in values and shares all other results with the model."""
        copy, _ = object.__new__(type(self)), self._common  # which both models share
        known = vars(self).copy()
        for name in ("_values", "_renumbered", "_unnumbered"):
            known.pop(name, None)
        known.update(parts)
        object.__setattr__(copy, "__dict__", known)
        return copy

    @cached_property
    def _unnumbered(self) -> dict[Hashable, Any]:
        """The results that depend on the structure and the expressions of parameters, but not on numbers."""
        return {}

    @cached_property
    def _common(self) -> dict[str, Any]:
        return {}

    def once(self, name: str, make: Callable[[], Any]) -> Any:
        """Return a result that depends only on the structure, computed once for all copies of the model."""
        if name not in self._common:
            self._common[name] = make()
        return self._common[name]

    def once_per_expressions(self, name: Hashable, make: Callable[[], Any]) -> Any:
        """Return a result that depends only on the structure and on parameter expressions; copies share the result."""
        if name not in self._unnumbered:
            self._unnumbered[name] = make()
        return self._unnumbered[name]

    def _brought_by(self, contact: Contact) -> tuple[State, ...]:
        return contact.states(self._never_negative_names(), partial(self._load_rate, contact))

    def regularized(self, kind: str, *, v0: Expression | str | float) -> Model:
        """Return a copy in which every friction force is single-valued, to compare regularised laws.

        ::

            tanh     f = slip(|v|) tanh(v/v0)
            arctan   f = slip(|v|) (2/pi) atan(v/v0)
            karnopp  in the band |v| < v0 the body is stopped and f is the holding force, up to the stick limit

        With tanh and arctan there is no stick: a loaded body creeps at a speed of the order of v0. There are no
        modes, and the problem becomes stiff for small v0. The error decreases with v0: at first order, up to
        logarithms, with tanh; as v0**(2/3) with arctan, whose tails delay each release; with karnopp at first
        order or better if mu_s = mu_k, and as v0**(1/2) if mu_s > mu_k (the time to leave the band).

        Parameters
        ----------
        kind : str
            "tanh", "arctan" or "karnopp".
        v0 : str or float
            Width, a positive velocity in the unit of the relative velocity. It becomes a parameter ``v0`` of the copy.

        Returns
        -------
        Model
            The copy.

        Raises
        ------
        UsageError
            For an unknown kind, for a model without contacts, for static friction above slip(0) with tanh or arctan,
            and for contacts that act on each other with karnopp.

        References
        ----------
        D. Karnopp, J. Dyn. Syst. Meas. Control 107 (1985) 100, doi:10.1115/1.3140698.
        """
        from hybridsim.model.smoothing.regularize import regularized

        return regularized(self, kind, v0)

    def parameter_values(self) -> dict[str, float]:
        """Return the values of all parameters; cyclic definitions and infinite values raise an error."""
        return dict(self._values)

    @cached_property
    def _values(self) -> dict[str, float]:
        changed = self.changed_numbers
        if changed is None:
            return resolve({parameter.name: parameter.value for parameter in self.parameters})
        values, positions = dict(self._unnumbered["sound"][0]), self._positions()
        for name in changed:
            values[name] = evaluate(self.parameters[positions[name]].value, values)
        for name, value in self.once_per_expressions(
            ("affected", changed), partial(self._affected_by, changed)
        ):
            values[name] = evaluate(value, values)
        return values

    def _positions(self) -> dict[str, int]:
        """Return the position of each parameter by name."""
        positions: dict[str, int] = self.once(
            "positions", lambda: {p.name: k for k, p in enumerate(self.parameters)}
        )
        return positions

    def _affected_by(self, names: Iterable[str]) -> list[tuple[str, Expression]]:
        """Return the parameters that depend on the given parameters, with their expressions, in order of evaluation."""
        found, reached = [], set(names)
        values = {parameter.name: parameter.value for parameter in self.parameters}
        for name in dependency_order(values, "parameters"):
            if not reached.isdisjoint(values[name].names):
                found.append((name, values[name]))
                reached.add(name)
        return found

    def start_values(self) -> dict[str, float]:
        """Return the initial values of the states for the current parameters."""
        return {state.name: evaluate(state.start, self._values) for state in self.states}

    def discrete_values(self) -> dict[str, float]:
        """Return the initial values of the discrete states for the current parameters."""
        return {part.name: evaluate(part.start, self._values) for part in self.discrete}

    def duration_value(self) -> float | None:
        """Return the declared duration for the current parameters, or None."""
        return None if self.duration is None else evaluate(self.duration, self._values)

    def all_components(self) -> tuple[Component, ...]:
        """Return all automata in the order contacts, surfaces, impacts, components, corners."""
        components: tuple[Component, ...] = self.once("components", self._components)
        return components

    def _components(self) -> tuple[Component, ...]:
        parts = [part for contact in self.contacts for part in self.components_of(contact)]
        parts += [surface.component() for surface in self.surfaces]
        parts += [impact.component() for impact in self.impacts]
        parts += self.components
        return tuple(sorted(parts, key=lambda part: isinstance(part, Corner)))

    def components_of(self, contact: Contact) -> tuple[Component, ...]:
        """Return the automata of one contact."""
        return contact.components(self._never_negative_names(), partial(self._load_rate, contact))

    def constant_names(self) -> frozenset[str]:
        """Return the names that are constant during a run: parameters and definitions of parameters."""
        names: frozenset[str] = self.once("constants", self._constant_names)
        return names

    def _never_negative_names(self) -> frozenset[str]:
        """Return the names whose signs need no check during a run: constants, and the normal forces of impacts."""
        return self.constant_names() | {impact.name for impact in self.impacts}

    def _constant_names(self) -> frozenset[str]:
        constants = {parameter.name for parameter in self.parameters}
        for _ in self.definitions:
            constants |= {name for name, expr in self.definitions if expr.names <= constants}
        return frozenset(constants)

    def variables(self) -> dict[str, Component]:
        """Return each variable that a component sets, with the component. Contact forces are included."""
        return {name: component for component in self.all_components() for name in component.variables}

    def structure(self) -> str:
        """Return the text of all declarations on which generated code depends.

        It excludes parameter values, initial values, units, titles and the numbers of tables, so that models that
        differ only in these share their code.
        """
        from hybridsim.model.smoothing.structure import structure

        text: str = self.once("structure", lambda: structure(self))
        return text

    @property
    def is_known_to_be_sound(self) -> bool:
        """Whether this model, or a copy with other values, has passed all checks of its structure."""
        return "is sound" in self._common

    @property
    def changed_numbers(self) -> frozenset[str] | None:
        """The parameters whose numbers may differ from those of a checked model, or None if there is no such model."""
        sound = self._unnumbered.get("sound")
        return None if sound is None else sound[1] | self._renumbered

    def validate(self) -> Model:
        """Check the declaration and return the model itself.

        Returns
        -------
        Model
            The model itself.

        Raises
        ------
        ModelError
            With all errors in ``errors``.
        """
        from hybridsim.model.checks.validate import find_errors

        errors = find_errors(self)
        if errors:
            raise ModelError.collect(errors, f"model {self.name}", self.path)
        self._unnumbered.setdefault("sound", (self._values, self._renumbered))
        return self

    def to_toml(self) -> str:
        """Return the model as TOML text, which includes its laws and tables.

        Returns
        -------
        str
            The text.

        Raises
        ------
        UsageError
            For a model with Python functions, which cannot be written as text.
        """
        from hybridsim.model.toml.write import write_model

        if self.flow is not None:
            raise UsageError(
                f"model '{self.name}' contains Python functions, which cannot be written to TOML",
                remedy="write its rates, guards and resets as expressions, or keep the model as a Python file",
            )
        return write_model(self)

    @classmethod
    def from_toml(cls, text: str, path: str | None = None) -> Model:
        """Read and validate a model from TOML text; table files are searched in the folder of ``path``."""
        from hybridsim.model.toml.read import read_model

        if not isinstance(text, str):
            raise UsageError(
                f"The text of the model cannot be {text!r}",
                remedy="pass TOML text, or use hs.load for a file",
            )
        if path is not None:
            path = path_text(path)
        return read_model(text, path)


def _content(model: Model) -> tuple[object, ...]:
    texts = ("name", "definitions", "title", "source", "description", "look", "duration", "flow")
    fields = [field for field in (*_PARTS, *texts) if field != "requirements"]  # a file does not hold them
    return tuple(getattr(model, field) for field in fields)
