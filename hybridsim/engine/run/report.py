"""Report the structure of a model: clusters, held states, linear modes, and the cost of compiling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybridsim.engine.events.dissipation_check import require_dissipation
from hybridsim.engine.system.modules import Compiled, compiled
from hybridsim.engine.system.system import System
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.explicit_corners import smoothed

# CPU seconds to compile a function: a fixed part, and a part per character of its source. Fitted to the packaged models
# (0.1 s each) and to two colliding discs (5.0 s, 570 000 characters); accurate to a factor of two.
_SECONDS, _SECONDS_PER_CHARACTER = 0.006, 9e-6


@dataclass(frozen=True)
class Report:
    """The structure of a model as the engine uses it.

    Parameters
    ----------
    clusters : names of the surface components that are decided jointly.
    held : for each component, the state or states that its holding mode evaluates from the constraint.
    projected : for each component, the states that its holding mode keeps on the surface by projection.
    linear : for each component, its modes with a flow linear in the states; "" is the base equations of the states.
    rates : number of angles that grow in time and are kept modulo 2 pi.
    operations : number of operations in the generated code of all modes.
    lowering_seconds : measured time to derive and write these operations; 0 if they were on disk.
    compile_seconds : estimate for the functions not compiled yet, of which a run uses some; 0 if all are compiled.
    """

    clusters: tuple[tuple[str, ...], ...]
    held: dict[str, str]
    projected: dict[str, tuple[str, ...]]
    linear: dict[str, tuple[str, ...]]
    rates: int
    operations: int
    lowering_seconds: float
    compile_seconds: float


def describe(model: Model) -> Report:
    """Report the structure of a model without compiling it; raise an error if no run of the model could start."""
    model = smoothed(model)
    system = System(model, as_written=True)
    discrete = np.array(list(model.discrete_values().values()), dtype=float)
    modes = np.array([automaton.initial for automaton in system.automata], dtype=np.int64)
    require_dissipation(system, 0.0, system.start_state({}), discrete, modes)
    code = compiled(model)
    assert isinstance(code, Compiled)  # models of Python functions are not described here
    data = code.data
    components = model.all_components()
    names = [c.name for c in components]
    operations = sum(len(branch) for _, branches in data["tape"]["parts"] for branch in branches)
    linear = {
        c.name: tuple(m.name for m, yes in zip(c.modes, data["linear"][c.name], strict=True) if yes)
        for c in components
    } | {"": ("",) if data["linear"][""][0] else ()}
    return Report(
        tuple(tuple(names[c] for c in cluster) for cluster in data["clusters"]),
        {names[c]: " and ".join(model.states[i].name for i in held) for c, held in data["pins"].items()},
        {names[c]: tuple(model.states[i].name for i in held) for c, held in data["projected"].items()},
        linear,
        data["rates"],
        operations,
        code.seconds,
        sum(_SECONDS + _SECONDS_PER_CHARACTER * length for length in code.lengths_to_compile()),
    )
