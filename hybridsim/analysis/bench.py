"""One model over one span, ready to be run by any line of a comparison and held against its reference."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from hybridsim.analysis.comparison import Comparison
from hybridsim.analysis.provenance import provenance
from hybridsim.analysis.reference import Reference
from hybridsim.analysis.regularised import as_set_valued
from hybridsim.analysis.rows import STOPPED, Cost, Row
from hybridsim.analysis.series import Series
from hybridsim.analysis.trajectory import trajectory_of
from hybridsim.errors import HybridsimError, UsageError
from hybridsim.model import Model

if TYPE_CHECKING:
    from hybridsim.solution import Solution


class _OutOfTime(Exception):
    """A run has used up the time that it was given."""


@dataclass(frozen=True)
class Bench:
    """Runs of a model over a span.

    Parameters
    ----------
    model : the model, its parameters and initial values set.
    t_span, period : what is run; the period of the forcing or None.
    """

    model: Model
    t_span: tuple[float, float]
    period: float | None
    _forms: dict[tuple[str, float], Model] = field(default_factory=dict, repr=False, compare=False)

    def simulate(self, integrator: str, *, model: Model | None = None, **options: Any) -> Solution:
        """One run; of another form of the model, where one is given."""
        from hybridsim.simulate import simulate

        return simulate(model or self.model, self.t_span, integrator=integrator, **options)

    def call(self, line: Series, value: float) -> Callable[[], Solution]:
        """The run of a line at a value, ready to be timed."""
        model, options = self._form(line, value), line.options_at(value)
        return lambda: self.simulate(line.integrator, model=model, **options)

    def first_run(self, line: Series, value: float, reference: Reference, limit: float = math.inf) -> Row:
        """The run that warms up, and whose errors and counts are those of the row.

        Parameters
        ----------
        limit : seconds after which it is stopped; what it needs for compiling does not count.
        """
        options = line.options_at(value)
        row = Row(line.integrator, line.label, (line.varied, value), options, "failed", form=line.regularized)
        began: list[float] = []

        def watch(_: float) -> None:
            began.append(time.perf_counter()) if not began else None
            if time.perf_counter() - began[0] > limit:
                raise _OutOfTime

        try:
            watched: Mapping[str, Any] = {"progress": watch} if limit < math.inf else {}
            solution = self.simulate(line.integrator, model=self._form(line, value), **options, **watched)
            if not solution.success:
                return replace(row, status=solution.status, message=solution.message)
            found = trajectory_of(solution)
            if line.regularized:
                found = as_set_valued(found, {contact.name for contact in self.model.contacts})
            errors = reference.yardstick.measure(found)
        except _OutOfTime:
            return replace(row, status=STOPPED, message=f"not done after {limit:.2g} s")
        except HybridsimError as error:
            return replace(
                row, status="refused" if isinstance(error, UsageError) else "failed", message=error.message
            )
        except Exception as error:  # an integrator may be anybody's: it costs its own row only
            return replace(row, message=f"{type(error).__name__}: {error}")
        stats = solution.stats
        rhs, guards, steps = (int(stats[name]) for name in ("rhs_evaluations", "guard_evaluations", "steps"))
        cost = Cost((float(stats["wall_time"]),), rhs, guards, steps, float(stats["compile_time"]))
        return replace(row, status=solution.status, errors=errors, cost=cost)

    def comparison(self, reference: Reference, rows: Sequence[Row], repeat: int) -> Comparison:
        """The rows as a result."""
        return Comparison(
            title=f"{self.model.name}: {self.model.title}" if self.model.title else self.model.name,
            t_span=self.t_span,
            period=self.period,
            reference=reference.title,
            uncertainty=reference.uncertainty,
            rows=tuple(rows),
            repeat=repeat,
            provenance=provenance(self.model),
            warnings=reference.warnings,
            second_reference=reference.second,
            difference=reference.difference,
        )

    def _form(self, line: Series, value: float) -> Model | None:
        """The regularised form that a line runs in place of the model."""
        if not line.regularized:
            return None
        key = (line.regularized, value)
        if key not in self._forms:
            self._forms[key] = self.model.regularized(line.regularized, v0=value)
        return self._forms[key]
