"""This module defines the part of a solution that integrates over time: work of forces, and energy lost in contacts."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from hybridsim.arguments import as_times, two_numbers
from hybridsim.calls import refusing
from hybridsim.errors import UsageError
from hybridsim.expr.grammar import TIME
from hybridsim.model.parts.impact import OPEN
from hybridsim.solution.by_name import ByName
from hybridsim.solution.events_and_modes import EventsAndModes
from hybridsim.solution.integrals.impulsive import impact_behind, refuse_impulses
from hybridsim.solution.integrals.quadrature import integral


class Energies(EventsAndModes):
    """Integrals over a run, as a part of `Solution`."""

    @refusing
    def integral(self, *quantities: str, t_span: tuple[float, float] | None = None) -> float:
        """Integrate a quantity, or the product of several, over time: the work of a force, or an impulse.

        ::

            integral of q_1(t) q_2(t) ... dt

        The rule is an adaptive Gauss rule between the events; its error is about 1e-12 of the integral of the absolute
        value, on top of the error of the run.

        Parameters
        ----------
        *quantities : names of states and other quantities, such as a force and the velocity of its point; "t" is time.
        t_span : (a, b), a part of the run; by default all of it. It may be reversed, with a change of sign.

        Returns
        -------
        float
            The integral, in the product of the units of the quantities and of t.

        Raises
        ------
        UsageError
            Without a name, for an unknown name, a part outside the run, or a run that did not store its states. Also
            for a quantity with the force of an impact of a `Model`, because the integral would omit its impulses.

        Examples
        --------
        >>> import hybridsim as hs
        >>> sol = hs.simulate("free-decay", (0, 1))
        >>> bool(np.isclose(sol.integral("v"), sol["x"][-1] - sol["x"][0]))
        True
        """
        if not quantities:
            raise UsageError(
                "integral() got no quantity",
                remedy='use the names of one or several quantities: sol.integral("f", "v")',
            )
        for name in quantities:
            if name != TIME:
                self.output(name, self.t_start)
        refuse_impulses(self, quantities, "the integral")

        def product(times: np.ndarray) -> np.ndarray:
            factors = [
                times if name == TIME else self._trajectory.values(name, times, "+") for name in quantities
            ]
            return np.prod(factors, axis=0)[:, None]

        return float(self._integrated(product, *self._part(t_span), 1)[0])

    def _part(self, t_span: Any) -> tuple[float, float]:
        """Return the first and last time of a part of the run; None means the whole run."""
        whole = (self.t_start, self.t_end)
        first, last = whole if t_span is None else two_numbers(t_span, "t_span", "use two times, (a, b)")
        low, high = sorted(whole)
        if not (low <= min(first, last) and max(first, last) <= high):
            raise UsageError(
                f"`t_span` = ({first!r}, {last!r}) is outside the run",
                remedy=f"use times from t = {low!r} to {high!r}",
            )
        return first, last

    @cached_property
    def dissipated(self) -> dict[str, float]:
        """Energy that friction dissipates during the run, by contact.

        ::

            integral of f v_rel dt

        f is the friction force of the contact, positive for a positive relative velocity v_rel. The unit is that of the
        force times that of the velocity times that of t. A contact whose law has states of its own, such as LuGre,
        stores a part of it. The impulses of friction in impacts are not contained. The printed result says so if a
        contact has such impulses. A run that did not store its states raises `UsageError`.
        """
        contacts = [contact.name for contact in self.model.contacts]
        if not contacts:
            return ByName()
        found = self._integrated(self._trajectory.friction_powers, self.t_start, self.t_end, len(contacts))
        has_impulses = hasattr(self.model, "M") or impact_behind(self.model, contacts) is not None
        impacts = {impact.name for impact in self.model.impacts} if has_impulses else set()
        count = (
            len({e.t for e in self.events if e.component in impacts and e.source == OPEN}) if impacts else 0
        )
        remark = f"without the impulses of friction in {count} impact{'s' * (count > 1)}" if count else ""
        return ByName(zip(contacts, found.tolist(), strict=True), remark=remark)

    @property
    def work(self) -> dict[str, float]:
        """Energy that a `MechanicalSystem` receives during a run, by source.

        ::

            forcing   integral of v . F dt              damping   - integral of v . C v dt
            friction  - sum of integrals of f v_rel dt  bases     - sum of integrals of f base dt

        The sources are ``forcing``, ``damping``, ``friction``, ``impacts`` and the moving ``bases`` of its contacts.
        Those of damping, friction and impacts are not positive, up to rounding in a step. They add up to the gain of
        `stored_energy`; with ``moreau`` they do so for theta = 1/2. Runs of a `Model` do not have this attribute.
        """
        return self._measured("work", self._trajectory.work, "a MechanicalSystem")

    @refusing
    def stored_energy(self, t: Any = None) -> Any:
        """Return the kinetic and elastic energy of a `MechanicalSystem`, v . M v/2 + q . K q/2.

        Parameters
        ----------
        t : a number or an array of times; without it ``sol.t``.

        Returns
        -------
        float or array
            A number for a number, otherwise (k,), in the unit of K times that of q squared.

        Raises
        ------
        UsageError
            For a run of a `Model`, whose masses are not declared, or for times outside the run.
        """
        if not hasattr(self.model, "M"):
            raise UsageError(
                f"{self.model.name} does not declare masses, so its stored energy is unknown",
                remedy="declare the energy as an output, hs.Output('E', 'm*v**2/2 + k*x**2/2'), and "
                "read sol['E']",
            )
        requested = self.t if t is None else t
        times, side = self._within(as_times(requested), "+")
        q, v = np.split(self._trajectory.states(times, side), [self.model.n], axis=1)
        found = 0.5 * ((v * (self.model.M @ v.T).T).sum(axis=1) + (q * (self.model.K @ q.T).T).sum(axis=1))
        return float(found[0]) if np.ndim(requested) == 0 else found

    def _integrated(self, integrand: Any, first: float, last: float, width: int) -> np.ndarray:
        """Return integrals (width,) over a part of the run, with the events and steps of this part as edges."""
        self._within(np.array([first, last]), "+")
        (low, high), times = sorted((first, last)), self._trajectory.own_times
        edges = np.unique(np.concatenate([[low, high], times[(times > low) & (times < high)]]))
        found = integral(integrand, edges, width)
        return found if last >= first else -found

    def _measured(self, name: str, value: Any, kind_of_model: str) -> Any:
        if value is None:
            raise AttributeError(
                f"this Solution has no {name}: only a run of {kind_of_model} has this result", name=name
            )
        return value
