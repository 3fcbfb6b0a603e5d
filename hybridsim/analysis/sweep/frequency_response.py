"""This module computes frequency responses: amplitude, stick fraction and stops over the forcing frequency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

from hybridsim.analysis.compare.comparison_request import mapping
from hybridsim.analysis.structures.swept import model_to_sweep
from hybridsim.analysis.sweep.result import Sweep
from hybridsim.analysis.sweep.sweep import sweep
from hybridsim.arguments import cannot_be, text
from hybridsim.calls import refusing
from hybridsim.errors import UsageError, nearest
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.model import Model


@refusing
def frequency_response(
    model: Model | MechanicalSystem | str | PathLike[str],
    frequencies: Sequence[Any],
    levels: Mapping[str, Sequence[Any]] | None = None,
    *,
    frequency: str = "omega",
    quantity: str | None = None,
    params: Mapping[str, Any] | None = None,
    **options: Any,
) -> Sweep:
    """Measure amplitude, stick fraction and stops of the steady motion over the forcing frequency.

    Parameters
    ----------
    model : str, path, Model or MechanicalSystem
        As in `sweep`.
    frequencies : sequence of str or float
        Values of the parameter ``frequency``, numbers or expressions.
    levels : mapping of str to sequence, optional
        One other parameter and its values, such as ``{"N": [20, 30, 40]}``; each value is a line.
    frequency : str, optional
        The parameter that is the angular frequency of the forcing.
    quantity : str, optional
        State or output whose amplitude is measured; by default the first state.
    params : mapping of str to str or float, optional
        Parameter values that are the same at every point.
    **options : Any
        Options of `sweep` and `steady_state`.

    Returns
    -------
    Sweep
        Over levels and frequency; ``.plot(over=frequency)`` draws it.

    Examples
    --------
    >>> import hybridsim as hs
    >>> found = hs.frequency_response("dfcs", ["0.5*sqrt(k/m)", "0.9*sqrt(k/m)"], {"N": [30, 40]})
    >>> found.dimensions, list(found.values)
    (('N', 'omega'), ['amplitude.x', 'stick_fraction.f', 'stops_per_period.f'])
    """
    swept = model_to_sweep(model, params)
    others, frequency = mapping(levels, "levels"), text(frequency, "frequency")
    if len(others) > 1 or frequency in others:
        raise cannot_be("levels", levels, "use one parameter other than the frequency")
    known = [part.name for part in (*swept.parameters, *swept.states, *swept.discrete)]
    if frequency not in known:
        raise UsageError(
            f"model {swept.name} has no parameter {frequency!r} to sweep over as the frequency",
            remedy="pass `frequency`, the name of the parameter with the angular frequency of the forcing; "
            + nearest(frequency, [parameter.name for parameter in swept.parameters], kind="parameters"),
        )
    if not swept.states:
        raise UsageError(f"model {swept.name} has no states", remedy="use a model with at least one state")
    readings = [f"amplitude.{swept.states[0].name if quantity is None else text(quantity, 'quantity')}"]
    for contact in (c for c in swept.contacts if c.law.is_set_valued):  # other laws have no stick
        readings += [f"stick_fraction.{contact.name}", f"stops_per_period.{contact.name}"]
    # with warm starts the chain runs along the frequency, which is the first axis
    if options.get("warm_start"):
        return sweep(swept, {frequency: frequencies, **others}, readings, **options)
    return sweep(swept, {**others, frequency: frequencies}, readings, **options)
