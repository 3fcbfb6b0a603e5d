"""This module defines the result of `fit_laws`: one fit per law, ranked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from hybridsim.analysis.fit.result import Fit
from hybridsim.presentation.readable import Readable, aligned


@dataclass(frozen=True)
class LawFit:
    """The fit of one law: its label, the fit, AICc, and the residual of the records that were held out, or None."""

    label: str
    fit: Fit
    aicc: float
    held_out: float | None


@dataclass(frozen=True)
class LawFits(Readable):
    """The fits of several friction laws to the same records, the best law first.

    Parameters
    ----------
    title : str
        The title of the model.
    contact : str
        The contact that has the laws.
    rows : tuple of LawFit
        One row per law with its ``label``, ``fit``, ``aicc`` and ``held_out``: the root mean square of the residuals of
        the records that were held out, relative to the standard deviation of each quantity.

    Examples
    --------
    >>> import numpy as np, hybridsim as hs
    >>> t = np.linspace(0, 0.5, 40)
    >>> x = hs.simulate("free-decay", (0, 0.5), params={"mu": 0.3}).output("x", t)
    >>> found = hs.fit_laws("free-decay", {"t": t, "x": x}, [("coulomb", {"mu": (0.05, 0.9)})])
    >>> round(found.rows[0].fit.values["f_mu"], 6)
    0.3
    """

    title: str
    contact: str
    rows: tuple[LawFit, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """The names of the laws, the best one first."""
        return tuple(row.label for row in self.rows)

    @property
    def weights(self) -> dict[str, float]:
        """Akaike weight of each law: exp(-d/2), divided by the sum over all laws; d is AICc minus the least AICc."""
        least = min(row.aicc for row in self.rows)
        found = {
            row.label: math.exp(-0.5 * (row.aicc - least)) if row.aicc > least else 1.0 for row in self.rows
        }
        total = sum(found.values())
        return {label: each / total for label, each in found.items()}

    def records(self) -> list[dict[str, Any]]:
        """Return the rows as plain Python values."""
        return [
            {"label": row.label, "aicc": row.aicc, "held_out": row.held_out, **row.fit.to_dict()}
            for row in self.rows
        ]

    def report(self) -> str:
        """Return the table of the laws, followed by each fit with its unknowns and warnings, as text."""
        return "\n\n".join([repr(self), *(f"{row.label}: {row.fit!r}" for row in self.rows)])

    def plot(self) -> Any:
        """Draw the measured and the fitted values of the first record under each law, with the residuals below.

        It returns the figure; ``hybridsim.plot.save`` writes it to a file.
        """
        # The plot package is a layer above this one, so it is imported only on demand.
        return import_module("hybridsim.plot").law_fits(self)

    def __repr__(self) -> str:
        least, weights = min(row.aicc for row in self.rows), self.weights
        head = ("law", "unknowns", "AICc - least", "weight", "held out")
        cells = [
            (
                row.label,
                str(len(row.fit.values)),
                "0" if row.aicc == least else f"{row.aicc - least:.4g}",
                f"{weights[row.label]:.3g}",
                "-" if row.held_out is None else f"{row.held_out:.4g}",
            )
            for row in self.rows
        ]
        first = f"{self.title}: laws of contact {self.contact}, {self.rows[0].fit.samples} samples"
        return "\n".join([first, *aligned([head, *cells], "  ")])
