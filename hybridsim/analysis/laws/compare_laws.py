"""This module runs one model under several friction laws in one contact."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from typing import Any

from hybridsim.analysis.compare.comparison_request import mapping, run_span
from hybridsim.analysis.keyword_options import refuse_unknown
from hybridsim.analysis.laws.labels import details_of, distinct_labels, refuse_equal
from hybridsim.analysis.laws.law_comparison import LawComparison, LawRow
from hybridsim.analysis.laws.law_readings import law_readings
from hybridsim.analysis.sweep.run_readings import remedy_for_definition
from hybridsim.arguments import cannot_be, chosen_model, is_row, known_name
from hybridsim.calls import refusing
from hybridsim.engine.system.period import forcing_period
from hybridsim.errors import UsageError
from hybridsim.model import FrictionLaw, Model
from hybridsim.simulate import simulate

_LAW = str | PathLike | FrictionLaw
Entry = str | PathLike[str] | FrictionLaw | tuple[str | PathLike[str] | FrictionLaw, Mapping[str, Any]]
_LAWS = "use a list of names, laws, and pairs (law, parameters), such as ['coulomb', ('viscous', {'c': 2})]"


@refusing
def compare_laws(
    model: Model | str | PathLike[str],
    laws: Sequence[Entry],
    t_span: tuple[float, float] | None = None,
    *,
    contact: str | None = None,
    quantity: str | None = None,
    measure: str | Sequence[str] | None = None,
    params: Mapping[str, Any] | None = None,
    x0: Mapping[str, Any] | None = None,
    **options: Any,
) -> LawComparison:
    """Run a model under several friction laws in one contact, and measure each run.

    A model with periodic forcing is measured over the last period of the run, any other model over the whole run.
    ``keep="all"`` measures the whole run of any model.

    Parameters
    ----------
    model : str, path or Model
        A `Model`, the name of a packaged one, or the path of a ``.toml`` file.
    laws : sequence of str, FrictionLaw or tuple
        Laws as in `Model.with_law`, or pairs of a law and its parameters. A parameter that is not given keeps the
        value that the contact gives it.
    t_span : tuple of float, optional
        (t0, t1), t1 > t0; by default as in `compare`.
    contact : str, optional
        Name of the contact, if the model has several.
    quantity : str, optional
        State or output whose amplitude is measured; by default the first state.
    measure : str or sequence of str, optional
        Names of readings as in `sweep`, in place of amplitude, stops and energy loss: ``"rms.v"``,
        ``["maximum.x", "stick_fraction.f"]``. If the whole run is measured, also ``"final.x"`` and
        ``"first_passage.x>0.1"``; over a period, also ``"harmonic.x.1"``.
    params, x0 : mapping of str to float, optional
        Parameter values and initial values by name, instead of the declared values.
    **options : object
        Options of `simulate`, such as ``integrator`` and ``rtol``, but not ``t_eval``. ``keep`` is the measured part of
        the run: "all", or "last-period" of the forcing, the default for a model with periodic forcing.

    Returns
    -------
    LawComparison
        One row per law, with its run.

    Examples
    --------
    >>> import hybridsim as hs
    >>> stribeck = ("stribeck", {"mu_s": 0.6, "mu_k": "mu", "v_s": 0.05})
    >>> found = hs.compare_laws("dfcs", ["coulomb", stribeck])
    >>> [row.stops for row in found.rows]
    [2, 2]
    """
    refuse_unknown([simulate], options)
    for name in ("save", "t_eval"):
        if name in options:
            raise UsageError(f"compare_laws() has no option `{name}`", remedy=f"remove `{name}`")
    model = chosen_model(model, params).with_start(**mapping(x0, "x0")).validate()
    contact = contact_of(model, contact)
    quantities = [*(state.name for state in model.states), *(output.name for output in model.outputs)]
    if quantity is None:
        quantity = quantities[0]
    if remedy := remedy_for_definition(model, str(quantity)):
        raise UsageError(f"`quantity` cannot be {quantity!r}", remedy=remedy)
    known_name(quantity, quantities, f"model {model.name} has no quantity", "quantities")
    models = models_under(model, laws, contact)
    period = forcing_period(model)
    t0, t1 = run_span(t_span, model.duration_value(), period)
    measured = measured_period(options.pop("keep", None), period, t1 - t0)
    if measured is not None:
        options |= {"keep": measured}
    readings = law_readings(measure, models.values(), measured)
    rows = []
    for label, changed in models.items():
        run = simulate(changed, (t0, t1), **options)
        rows.append(LawRow(label, changed, run, contact, quantity, measured is not None, readings.of(run)))
    interval = (t0 if measured is None else t1 - measured, t1)
    title = model.title or model.name
    return LawComparison(title, contact, quantity, interval, tuple(rows), readings.names)


def measured_period(keep: Any, period: float | None, length: float) -> float | None:
    """Return the period that is measured at the end of a run of some length, or None for the whole run."""
    if keep is not None and (not isinstance(keep, str) or keep not in ("all", "last-period")):
        raise cannot_be("keep", keep, "use 'all' or 'last-period', the part of the run that is measured")
    if keep == "all":
        return None
    if keep == "last-period" and (period is None or not length > period):
        found = "the model has no period" if period is None else f"the period is {period:g}"
        remedy = f"use keep='all', since {found}" + ("" if period is None else ", or a longer t_span")
        raise cannot_be("keep", keep, remedy)
    return period if period is not None and length > period else None


def contact_of(model: Model, contact: Any) -> str:
    """Return the name of a contact of a model; None selects the only contact."""
    names = [declared.name for declared in model.contacts]
    if contact is None:
        if len(names) != 1:
            remedy = f"pass `contact`, one of {', '.join(names)}" if names else "use a model with a contact"
            raise UsageError(f"model {model.name} has {len(names)} contacts", remedy=remedy)
        return names[0]
    return known_name(contact, names, f"model {model.name} has no contact", "contacts")


def models_under(model: Model, laws: Iterable[Entry], contact: str) -> dict[str, Model]:
    """Return the model with each of the laws, by a unique label for each law."""
    if not is_row(laws):
        raise cannot_be("laws", laws, _LAWS)
    found: list[Model] = []
    details = []
    for entry in laws:
        pair = entry if isinstance(entry, tuple) else (entry, {})
        if len(pair) != 2 or not isinstance(pair[0], _LAW) or not isinstance(pair[1], Mapping):
            raise cannot_be("an entry of `laws`", entry, _LAWS)
        law, values = pair
        found.append(model.with_law(contact, law, **values))
        details.append(details_of(law, values))
    if not found:
        raise cannot_be("laws", laws, _LAWS)
    contacts = [next(one for one in changed.contacts if one.name == contact) for changed in found]
    names = [one.law.name for one in contacts]
    refuse_equal(contacts, names)
    return dict(zip(distinct_labels(names, details), found, strict=True))
