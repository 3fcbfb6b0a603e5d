"""This module fits several friction laws of one contact to the same measurements, and ranks the laws."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hybridsim.analysis.compare.comparison_request import mapping
from hybridsim.analysis.fit.doubts import ROUNDING
from hybridsim.analysis.fit.fit import fit
from hybridsim.analysis.fit.record import Record, records_of
from hybridsim.analysis.fit.residuals import Residuals
from hybridsim.analysis.fit.result import Fit
from hybridsim.analysis.fit.unknown import Unknown
from hybridsim.analysis.laws.compare_laws import Entry, contact_of, models_under
from hybridsim.analysis.laws.labels import details_of, distinct_labels, refuse_equal
from hybridsim.analysis.laws.law_fits import LawFit, LawFits
from hybridsim.arguments import cannot_be, chosen_model, is_row
from hybridsim.calls import refusing
from hybridsim.errors import ModelError, SimulationError, UsageError
from hybridsim.model import Contact, Model, Parameter

_LAWS = "use a list of names, laws, and pairs (law, parameters), such as [('coulomb', {'mu': (0.1, 0.9)})]"


@refusing
def fit_laws(
    model: Model | str,
    records: Any,
    laws: Sequence[Entry],
    unknowns: Mapping[str, Any] | None = None,
    *,
    contact: str | None = None,
    held_out: Any = None,
    noise: Mapping[str, float] | None = None,
    **options: Any,
) -> LawFits:
    """Fit a model under several friction laws in one contact to the same records, and rank the laws.

    Each law is fitted by `fit`. The laws are ranked by the corrected information criterion of Akaike,

    ::

        AICc = -2 ln L + 2 K + 2 K (K + 1)/(n - K - 1)

    for n samples and K unknowns. -2 ln L is the sum of ((measured - simulated)/noise)^2 if the noise is given.
    Otherwise it is the sum of n_q ln(S_q/n_q) over the quantities q, with n_q samples and the sum of squares S_q. Each
    quantity then adds one unknown to K. Records that are held out are not fitted, and rank the laws by their residuals.
    Residuals below 1e-6 of a quantity's standard deviation are errors of the runs. They count as 1e-6 of it, so that
    of two laws that describe exact data, the one with fewer unknowns is first.

    Parameters
    ----------
    model : Model, str or path
        The model.
    records : Record, mapping, path, DataFrame, or a sequence of these
        The measurements, as for `fit`.
    laws : sequence of str, FrictionLaw or tuple
        Laws as in `compare_laws`, or pairs of a law and its parameters. A parameter with bounds, (low, high) or
        `Unknown`, is fitted. In the result it has the name of the contact and its own, such as ``f_mu``.
    unknowns : mapping of str to (float, float) or Unknown, optional
        Unknowns that all laws share.
    contact : str, optional
        Name of the contact, if the model has several.
    held_out : Record or sequence of Record, optional
        Measurements that judge the fitted laws.
    noise : mapping of str to float, optional
        Standard deviation of each quantity, as for `fit`.
    **options : Any
        Options of `fit`, such as ``starts``, and of `simulate`, but not ``loss``.

    Returns
    -------
    LawFits
        One row per law, the best one first.

    Raises
    ------
    UsageError
        For arguments that do not fit the model, and for too few samples to rank the laws.
    ModelError
        If a law is wrong at its first guess.
    SimulationError
        If a law cannot be fitted, because its runs stop early from every first guess.

    References
    ----------
    K. P. Burnham, D. R. Anderson, Model Selection and Multimodel Inference, 2nd ed., Springer 2002, section 2.4.

    Examples
    --------
    >>> import numpy as np, hybridsim as hs
    >>> t = np.linspace(0, 0.5, 40)
    >>> x = hs.simulate("free-decay", (0, 0.5), params={"mu": 0.3}).output("x", t)
    >>> laws = [("coulomb", {"mu": (0.05, 0.9)}), ("viscous", {"c": (0.01, 9.0)})]
    >>> hs.fit_laws("free-decay", {"t": t, "x": x}, laws).labels
    ('coulomb', 'viscous')
    """
    if "loss" in options:
        raise UsageError("fit_laws() has no option `loss`", remedy="remove `loss`: AICc needs least squares")
    model = chosen_model(model, None).validate()
    contact = contact_of(model, contact)
    if not is_row(laws):
        raise cannot_be("laws", laws, _LAWS)
    fitted, held = records_of(records), () if held_out is None else records_of(held_out)
    shared = mapping(unknowns, "unknowns")
    declared = [_declared(model, contact, entry) for entry in laws]
    names = [each.contact.law.name for each in declared]
    refuse_equal([(each.contact, each.unknowns) for each in declared], names)
    labels = distinct_labels(names, [each.details for each in declared])
    rows: list[LawFit] = []
    for label, (_, changed, own, _) in zip(labels, declared, strict=True):
        if not {**shared, **own}:
            raise UsageError(
                f"the law '{label}' has no unknown",
                remedy="give bounds for one of its parameters, such as ('coulomb', {'mu': (0.1, 0.9)})",
            )
        try:
            found = fit(changed, fitted, {**shared, **own}, noise=noise, **options)
        except SimulationError as error:
            raise SimulationError(
                f"the law '{label}' cannot be fitted: {error.message}",
                remedy="use other bounds, or a guess: hs.Unknown(low, high, guess=...)",
            ) from error
        rows.append(
            LawFit(label, found, criterion(found, noise is not None), _off(found, held) if held else None)
        )
    if not rows:
        raise cannot_be("laws", laws, _LAWS)
    if not held and len(rows) > 1 and all(math.isinf(row.aicc) for row in rows):
        raise UsageError(
            f"{rows[0].fit.samples} samples are too few to rank the laws",
            remedy="use more samples; AICc needs at least two more than the total number of unknowns and quantities",
        )
    rows.sort(key=_rank)
    return LawFits(model.title or model.name, contact, tuple(rows))


class _DeclaredLaw(NamedTuple):
    """The contact with a friction law, the model with this contact, the unknowns, and details for the label."""

    contact: Contact
    model: Model
    unknowns: dict[str, Unknown]
    details: tuple[str, ...]


def _declared(model: Model, contact: str, entry: Any) -> _DeclaredLaw:
    """Return the model with a friction law in a contact, and the unknowns of the law."""
    law, values = entry if isinstance(entry, tuple) and len(entry) == 2 else (entry, {})
    if not isinstance(values, Mapping):
        raise cannot_be("an entry of `laws`", entry, _LAWS)
    own, values_of_law, more = {}, {}, []
    for name, value in values.items():
        if not (isinstance(value, Unknown) or is_row(value)):
            values_of_law[name] = value
            continue
        if isinstance(value, Unknown):
            unknown = value
        elif len(value) == 2:
            unknown = Unknown(*value)
        else:
            raise cannot_be("an entry of `laws`", entry, _LAWS)
        if unknown.guess is None and not unknown.is_bounded:
            raise UsageError(f"{name} of {law} has no guess", remedy="use hs.Unknown(low, high, guess=...)")
        guess = (
            unknown.guess
            if unknown.guess is not None
            else unknown.value(0.5 * sum(unknown.coordinate_bounds))
        )
        values_of_law[name] = f"{contact.replace('.', '_')}_{name}"
        own[values_of_law[name]] = unknown
        more.append(Parameter(values_of_law[name], guess))  # type: ignore[arg-type]  # it is converted
    fixed = {name: value for name, value in values.items() if values_of_law[name] not in own}
    widened = replace(model, parameters=(*model.parameters, *more))
    try:
        (changed,) = models_under(widened, [(law, values_of_law)], contact).values()
    except ModelError as error:
        if not more:
            raise
        guesses = ", ".join(f"{each.name} = {each.value.text}" for each in more)
        raise ModelError(
            f"{error.message}, with the first guess {guesses}",
            remedy=f"{error.remedy}; hs.Unknown(low, high, guess=...) sets a guess",
        ) from error
    under = next(one for one in changed.contacts if one.name == contact)
    return _DeclaredLaw(under, changed, own, details_of(law, fixed))


def _rank(row: LawFit) -> tuple[float, float]:
    """Return a sort key for laws: the residual of held-out records comes first, then AICc."""
    return (0.0 if row.held_out is None else max(row.held_out, ROUNDING)), row.aicc


def criterion(found: Fit, is_stated: bool) -> float:
    """Return AICc of a fit, or infinity for too few samples; `is_stated` means that the noise was given."""
    n, count = found.samples, len(found.values)
    total = found.cost
    if not is_stated:
        count, total = count + len(found.noise), 0.0
        for name in found.noise:
            measured = _present([record.columns for record in found.records], name)
            off = _present(found.residuals, name)
            least = max(ROUNDING * float(np.std(measured)), ROUNDING**2 * float(np.abs(measured).max()))
            total += len(off) * math.log(max(float(np.mean(off**2)), least**2, np.finfo(float).tiny))
    if n <= count + 1:
        return math.inf
    return total + 2.0 * count + 2.0 * count * (count + 1) / (n - count - 1)


def _present(columns: Iterable[Mapping[str, np.ndarray]], name: str) -> np.ndarray:
    """Return the samples of a quantity from all records, and leave out missing samples."""
    values = np.concatenate([each[name] for each in columns if name in each])
    return values[np.isfinite(values)]


def _off(found: Fit, records: tuple[Record, ...]) -> float:
    """Return the root mean square of residuals, each divided by the standard deviation of its quantity."""
    residuals = Residuals(found.model, records, {}, found.settings)
    if not len(residuals.measured):
        raise UsageError("`held_out` contains no sample", remedy="use a record with measured values")
    off = residuals.measured - residuals.predicted(np.zeros(0))
    if not np.isfinite(off).all():  # a run stopped early
        return math.inf
    sizes = {
        name: float(np.std(residuals.measured[residuals.quantity == name])) or 1.0 for name in residuals.names
    }
    return float(np.sqrt(np.mean((off / [sizes[str(name)] for name in residuals.quantity]) ** 2)))
