"""This module writes the parts of a model into the model: one flat list of declarations with dotted names."""

from __future__ import annotations

import keyword
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

from hybridsim.errors import ModelError, UsageError, nearest
from hybridsim.expr import Expression, parse
from hybridsim.expr.grammar import RESERVED
from hybridsim.model.flattening.copies import Copies
from hybridsim.model.flattening.indexed import INDEX, IndexedExpression
from hybridsim.model.laws.law_with_states import ContactState
from hybridsim.model.parts.changes import under_law
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.inputs import HeldInput
from hybridsim.model.parts.quantities import Output
from hybridsim.model.parts.use import Use

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model

Value = TypeVar("Value")

# Largest number of declarations that parts may add. Checking so many takes about half a minute.
MAX_DECLARATIONS = 20_000
KINDS = (
    "parameters", "states", "discrete", "inputs", "contacts", "surfaces", "impacts", "components", "monitors",
    "schedules", "outputs", "drawing", "requirements",
)  # fmt: skip


def flattened(model: Model) -> dict[str, Any]:
    """Return the declarations of a model and of all its parts, by the attribute of `Model` that contains them.

    Raises
    ------
    ModelError
        For errors in a part, with the place in the part, and for wrong names, numbers and connections of parts.
    """
    errors = [*_errors_of_numbers(model)] or [*_errors_of_parts(model.use), *_errors_of_names(model)]
    if not errors:
        flat = _Flat(model)
        errors = flat.errors
        if not errors:
            flat.parts["discrete"].sort(key=lambda part: isinstance(part, HeldInput))  # as in a file
            found: dict[str, Any] = {kind: tuple(parts) for kind, parts in flat.parts.items()}
            return found | {"connected_units": flat.connected_units}
    raise ModelError.collect(errors, f"model {model.name}")


def _errors_of_parts(uses: Iterable[Use]) -> Iterator[ModelError]:
    """Check each part once on its own, and yield its errors as seen from the whole model."""
    seen: set[int] = set()
    for use in uses:
        if id(use.model) not in seen:
            seen.add(id(use.model))
            if use.model.flow is not None:
                yield use.error(
                    f"use {use.name}: the rates of model '{use.model.name}' are Python functions",
                    "write the rates of a part as expressions",
                )
                continue
            try:
                use.model.validate()
            except ModelError as fault:
                yield from fault.inside(f"use.{use.name}")


def _errors_of_numbers(model: Model) -> Iterator[ModelError]:
    """Yield errors about invalid names of parts, and about too many parts."""
    taken: set[str] = set()
    for use in model.use:
        if not (use.name.isascii() and use.name.isidentifier()) or keyword.iskeyword(use.name):
            yield use.error(f"use '{use.name}': not a valid name", "use ASCII letters, digits and _")
        elif use.name in RESERVED or use.name.startswith("__"):
            yield use.error(f"use '{use.name}': the name is reserved", "rename the part")
        names = {use.name if number is None else f"{use.name}{number}" for number in use.numbers()}
        for name in sorted(taken & names):
            yield use.error(
                f"use {use.name}: there are two parts with the name '{name}'", "rename one of them"
            )
        taken |= names
    total = sum(_size(use.model) * (use.repeat or 1) for use in model.use)
    if total > MAX_DECLARATIONS:
        message = f"the parts have {total} declarations together, but at most {MAX_DECLARATIONS} are allowed"
        yield model.use[0].error(message, "repeat the parts less often, or use hs.MechanicalSystem")


def _errors_of_names(model: Model) -> Iterator[ModelError]:
    """Yield errors about names that parts do not have, and about inputs that are not connected."""
    repeated = [use for use in model.use if use.repeat]
    own = {part.name for kind in KINDS for part in getattr(model, kind)} | dict(model.definitions).keys()
    if repeated and INDEX in own:
        message = f"'{INDEX}' is the index of the repeated part '{repeated[0].name}', and a name of the model"
        yield repeated[0].error(message, f"rename the quantity '{INDEX}' of the model")
    for use in model.use:
        part, what = use.model, f"use {use.name}"
        inputs = [signal.name for signal in part.inputs if signal.kind == "connected"]
        starts = [*(state.name for state in part.states), *(state.name for state in part.discrete)]
        known = {
            "parameters": ([parameter.name for parameter in part.parameters], "parameters"),
            "start": (starts, "states"),
            "connect": (inputs, "connected inputs"),
            "laws": ([contact.name for contact in part.contacts], "contacts"),
        }
        for field, (names, kind) in known.items():
            for name, values in getattr(use, field).items():
                # the states of a law that replaces another one are known later
                if name not in names and not (field == "start" and _of_contact(name, part, use.laws)):
                    yield ModelError(
                        f"{what}, {field}: the model '{part.name}' has no {kind.removesuffix('s')} '{name}'",
                        place=values[0].place or use.place,
                        remedy=nearest(name, names, kind=kind),
                    )
        for name in inputs:
            if name not in use.connect:
                yield use.error(
                    f"{what}: the input '{name}' of model '{part.name}' is not connected",
                    f'write connect = {{ {name} = "EXPRESSION" }}',
                )


def _size(part: Model) -> int:
    return sum(len(getattr(part, kind)) for kind in KINDS) + len(part.definitions)


class _Flat:
    """The declarations of a model and its parts, collected by kind, and the errors that were found."""

    def __init__(self, model: Model) -> None:
        self.errors: list[ModelError] = []
        self._wrong: set[int] = set()
        self.connected_units: dict[str, str] = {}
        self.parts: dict[str, list[Any]] = {kind: list(getattr(model, kind)) for kind in KINDS}
        self.parts["definitions"] = list(model.definitions)
        self._repeats = {use.name: use.repeat for use in model.use if use.repeat}
        own = [part for kind in KINDS for part in self.parts[kind]]
        self._used: set[str] = set().union(*(e.names for part in own for e in _expressions(part)))
        self._used |= set().union(*(expr.names for _, expr in model.definitions))
        for use in model.use:
            for number in use.numbers():
                self._add(use, number)
        if not self.errors:
            self._define_outputs()

    def _add(self, use: Use, number: int | None) -> None:
        """Add one copy of a part."""
        name = use.name if number is None else f"{use.name}{number}"
        copies = Copies(f"{name}.", f"use.{use.name}" if number is None else f"use.{use.name}[{number}]")
        part = use.model
        parameters, start, connect = (
            {name: self._at(use, values, number) for name, values in changes.items()}
            for changes in (use.parameters, use.start, use.connect)
        )
        contacts = {
            contact.name: self._contact(use, contact, number, copies, start) for contact in part.contacts
        }
        for kind in KINDS:
            for declared in getattr(part, kind):
                if isinstance(declared, ContactState) or (declared.name in connect and kind == "inputs"):
                    continue
                made = contacts[declared.name] if kind == "contacts" else copies.of(declared)
                if kind == "parameters" and declared.name in parameters:
                    made = replace(made, value=parameters[declared.name])
                elif kind in ("states", "discrete") and declared.name in start:
                    made = replace(made, start=start[declared.name])
                self.parts[kind].append(made)
        units = {signal.name: signal.unit for signal in part.inputs if signal.name in connect and signal.unit}
        self.connected_units |= {
            copies.prefix + name: unit for name, unit in (part.connected_units | units).items()
        }
        definitions = self.parts["definitions"]
        definitions += [(copies.prefix + name, expr) for name, expr in connect.items()]
        definitions += [(copies.prefix + name, copies.expr(expr)) for name, expr in part.definitions]

    def _contact(
        self, use: Use, contact: Contact, number: int | None, copies: Copies, start: Mapping[str, Expression]
    ) -> Contact:
        """Return the copy of a contact, with another law if the use of the part sets one."""
        made = copies.of(contact)
        if contact.name in use.laws:
            law = _of_copy(use.laws[contact.name], number)
            arguments = {name: self._at(use, (value,), number) for name, value in law.arguments.items()}
            try:
                made = replace(under_law(made, law.law, arguments), place=law.place)
            except UsageError as fault:
                message = f"use {use.name}, laws: {fault.message}"
                self._report(law, ModelError(message, place=law.place, remedy=fault.remedy))
        states = [state.name for state in use.model.states if isinstance(state, ContactState)]
        own = {
            name.removeprefix(contact.variable("")): value
            for name, value in start.items()
            if _of_contact(name, use.model, [contact.name]) and (name in states or contact.name in use.laws)
        }
        return replace(made, start={**made.start, **own})

    def _at(self, use: Use, values: tuple[IndexedExpression, ...], number: int | None) -> Expression:
        """Return the value for one copy; an error in the value is reported."""
        value = _of_copy(values, number)
        try:
            expr = value.at(number, self._repeats)
        except ModelError as fault:
            message = f"use {use.name}: {fault.message}"
            self._report(value, type(fault)(message, place=fault.place, remedy=fault.remedy))
            return parse(0)
        self._used |= expr.names
        return expr

    def _report(self, value: object, fault: ModelError) -> None:
        """Store the error of a value once for all copies of a part."""
        if id(value) not in self._wrong:
            self.errors.append(fault)
        self._wrong.add(id(value))

    def _define_outputs(self) -> None:
        """Add a definition for each output of a part that is used outside the part."""
        outputs: list[Output] = self.parts["outputs"]
        for k, output in enumerate(outputs):
            if "." not in output.name or output.name not in self._used or output.expr.text == output.name:
                continue
            if output.modes:
                message = f"the output '{output.name}' depends on the mode, so other parts cannot use it"
                self.errors.append(
                    output.error(message, "write the quantity as a variable that the modes set")
                )
                continue
            self.parts["definitions"].append((output.name, output.expr))
            outputs[k] = replace(output, expr=parse(output.name, output.place))


def _of_copy(values: tuple[Value, ...], number: int | None) -> Value:
    """Return the value for one copy, from one value for all copies or one for each copy."""
    return values[0] if len(values) == 1 else values[(number or 1) - 1]


def _of_contact(name: str, part: Model, contacts: Collection[str]) -> bool:
    """Return whether a name can be a state of the friction law of one of the given contacts."""
    own = [state.name for state in part.states if not isinstance(state, ContactState)]
    if name in own or name in [state.name for state in part.discrete]:
        return False
    owners = [contact for contact in part.contacts if name.startswith(contact.variable(""))]
    return bool(owners) and max(owners, key=lambda contact: len(contact.name)).name in contacts


def _expressions(value: Any) -> Iterator[Expression]:
    """Yield the expressions in a declaration, except the expressions of a friction law, which has its own names."""
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, Mapping):
        for item in value.values():
            yield from _expressions(item)
    elif isinstance(value, tuple):
        for item in value:
            yield from _expressions(item)
    elif isinstance(value, Declared) and not hasattr(value, "slip"):
        for field in fields(value):
            yield from _expressions(getattr(value, field.name))
