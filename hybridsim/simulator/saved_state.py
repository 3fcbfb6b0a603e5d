"""This module defines the saved state of a simulator: the model as text and the state as numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from hybridsim.errors import UsageError
from hybridsim.integrators.automatic import successor_of
from hybridsim.model import Model
from hybridsim.preparation import Values, prepared
from hybridsim.simulate import KEYWORDS
from hybridsim.simulator.position import Position, stepped


@dataclass(frozen=True)
class SavedState:
    """A saved state of a `Simulator`, for `Simulator.restore`. It never changes and can be pickled.

    Parameters
    ----------
    position : object
        The state.
    about : str
        The settings of the simulator.

    Examples
    --------
    >>> import hybridsim as hs
    >>> sim = hs.Simulator("dfcs")
    >>> sim.start(0.0)
    ()
    >>> sim.save().t
    0.0
    """

    position: Position
    about: str

    @property
    def t(self) -> float:
        """The time of the state."""
        return self.position.t

    def __repr__(self) -> str:
        return f"<saved state of {self.position.run.model.name} at t = {self.t:.9g}>"

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the state without the prepared run, which is prepared again on reading."""
        position = self.position
        run, task = position.run, position.run.task
        method = run.method.name, vars(run.method), run.reason
        begin = task.t0, task.x0, task.z0, task.discrete, task.tolerances
        rest = (
            position.checkpoint,
            position.point.counters,
            position.warnings,
            position.events,
            position.ended,
        )
        return _unpickled, (source_of(run.model), method, begin, rest, self.about)


def require_fit(saved: SavedState, model: Model, about: str) -> None:
    """Raise an error if a saved state belongs to another model or to other settings."""
    own = saved.position.run.model
    fits = own.structure() == model.structure() and own.with_values_of(model) == model
    if not fits or about != saved.about:
        other_owner = f"other settings, {saved.about}" if fits else f"another model, {own.name}"
        raise UsageError(
            f"`saved` belongs to {other_owner}",
            remedy="restore the saved state in a simulator with the same model and settings",
        )


def source_of(model: Model) -> str | Model:
    """Return the text of a model; a model with Python functions is pickled instead."""
    return model.to_toml() if model.flow is None else model


def model_of(source: str | Model) -> Model:
    """Return the model from a result of `source_of`."""
    return Model.from_toml(source) if isinstance(source, str) else source


def _unpickled(
    source: Any, method: tuple[Any, ...], begin: tuple[Any, ...], rest: tuple[Any, ...], about: str
) -> SavedState:
    """Return a saved state from its pickled parts."""
    (name, options, reason), (t0, x0, z0, discrete, tolerances) = method, begin
    checkpoint, counters, warnings, events, ended = rest
    run, _ = prepared(
        model_of(source), (t0, t0), Values(), integrator=name, rtol=None, atol=None, max_step=float("inf"),
        first_step=None, t_eval=None, save="events", limits=None, options=options, keywords=KEYWORDS,
    )  # fmt: skip
    successor = successor_of(name, run.system) if reason else None
    task = replace(run.task, x0=x0, z0=z0, discrete=discrete, tolerances=tolerances, successor=successor)
    run = stepped(replace(run, task=task, reason=reason))
    return SavedState(Position.at(run, checkpoint, counters, warnings, events, ended), about)
