"""This module defines the remedies for names that are not parameters or states of a model."""

from __future__ import annotations

from typing import Any

from hybridsim.errors import nearest
from hybridsim.model.parts.inputs import HeldInput


def remedy_for_value(model: Any, name: str) -> str:
    """Return the remedy for a changed value whose name is neither a parameter nor an argument of a law."""
    arguments = [f"{contact.name}.{own}" for contact in model.contacts for own in contact.law.parameters]
    remedy = nearest(name, arguments)
    return (
        remedy
        if "." in name and "did you mean" in remedy
        else remedy_for_parameter(model, name, is_value=True)
    )


def remedy_for_parameter(
    model: Any, name: str, others: tuple[str, ...] = (), *, is_value: bool = False
) -> str:
    """Return the remedy for a name that is neither a parameter nor one of the allowed `others`.

    The remedy is the way in which the quantity of that name can be set, the argument of a law to change, or similar
    names. With `is_value` an argument of a law may be set as well.
    """
    names = [parameter.name for parameter in model.parameters]
    for contact in model.contacts:
        own = name.removeprefix(f"{contact.name}.")
        if own not in contact.law.parameters:
            continue
        argument = contact.arguments.get(own, contact.law.parameters[own])
        if argument is not None and argument.text in names:
            return f"contact {contact.name} has '{own} = {argument.text}'; change '{argument.text}'"
        text = "its default" if argument is None else argument.text
        subject = f"'{own}' is an argument of the law of contact {contact.name} with the value {text}"
        if is_value:
            return f"{subject}; write {contact.name}.{own}"
        return (
            f"{subject}; declare a parameter, {own} = {text} under [parameters], and write "
            f'law = {{ ..., {own} = "{own}" }}'
        )
    for part in (*model.states, *model.discrete):
        if name == part.name:
            kind = "a held input" if isinstance(part, HeldInput) else "a state"
            return (
                f"'{name}' is {kind}; set its initial value, with --x0 {name}=VALUE on the command line and "
                f"with x0={{'{name}': value}} in Python"
            )
    for signal in model.inputs:
        if name == signal.name:
            return f"'{name}' is an input of kind '{signal.kind}'; change it in the model"
        if signal.kind == "table" and name.startswith(f"{signal.name}["):
            return (
                f"change the input '{signal.name}' in the model; hs.sensitivities accepts its values "
                f"{signal.name}[0] to {signal.name}[{len(signal.values) - 1}]"
            )
    return nearest(name, [*names, *others], kind="parameters and states" if others else "parameters")


def remedy_for_state(model: Any, name: str) -> str:
    """Return the remedy for a name that is not a state: a way to set a parameter, similar names, or all names."""
    if name in [parameter.name for parameter in model.parameters]:
        return (
            f"'{name}' is a parameter; set it with -p {name}=VALUE on the command line and with "
            f"params={{'{name}': value}} in Python"
        )
    states = [state.name for state in model.states]
    discrete = {d.name: "held input" if isinstance(d, HeldInput) else "discrete" for d in model.discrete}
    remedy = nearest(name, [*states, *discrete], kind="states")
    if "did you mean" in remedy or not states or len(states) > 12:
        return remedy
    listed = "".join(f"; {d} ({kind})" for d, kind in discrete.items())
    return f"known states, in this order: {', '.join(states)}{listed}"
