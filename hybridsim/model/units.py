"""Units of what a model names, as they were declared."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hybridsim.model.model import Model


def units_of(model: Model) -> dict[str, str]:
    """Names of states, outputs, contact forces, discrete states and inputs, in that order, with their units."""
    units = {state.name: state.unit for state in model.states} | {o.name: o.unit for o in model.outputs}
    rest = {contact.name: "" for contact in model.contacts} | {d.name: d.unit for d in model.discrete}
    rest |= {declared.name: "" for declared in model.inputs}
    return units | {name: unit for name, unit in rest.items() if name not in units}


def time_unit(model: Model) -> str:
    """Seconds, if any unit of the model speaks of them; else time has no unit."""
    units = [*units_of(model).values(), *(parameter.unit for parameter in model.parameters)]
    return "s" if any(re.search(r"(?<![A-Za-z])s(?![A-Za-z])", unit) for unit in units) else ""
