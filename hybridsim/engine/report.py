"""What the engine makes of a model: clusters, held states, linear modes, and what compiling it costs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.driving import refuse_driving
from hybridsim.engine.modules import compiled, is_cached
from hybridsim.engine.system import System
from hybridsim.model.smoothing import smoothed

if TYPE_CHECKING:
    from hybridsim.model.model import Model

# Seconds to compile a model's functions: a fixed part and a part for each operation in them, fitted to the packaged
# models and to chains of up to 20 contacts (1.0 s); good to a factor of three.
_SECONDS, _SECONDS_PER_OPERATION = 0.06, 0.0009


@dataclass(frozen=True)
class Report:
    """The engine's view of a model.

    Parameters
    ----------
    clusters : names of the surface components that are decided together.
    held : component to the state, or states, that its holding mode evaluates from the constraint.
    projected : component to the states that its holding mode keeps on the surface by projection.
    linear : component to its modes whose flow is linear in the states; "" stands for the states' own equations.
    rates : number of angles that grow in time and are kept modulo 2 pi.
    operations : operations in the generated code, all modes counted.
    compile_seconds : rough estimate for a first run; 0 where the model is known already.
    """

    clusters: tuple[tuple[str, ...], ...]
    held: dict[str, str]
    projected: dict[str, tuple[str, ...]]
    linear: dict[str, tuple[str, ...]]
    rates: int
    operations: int
    compile_seconds: float


def describe(model: Model) -> Report:
    """Lower a model (nothing is compiled) and say what came of it; what no run would start with is refused."""
    model = smoothed(model)
    known = is_cached(model)
    system = System(model, as_written=True)
    discrete = np.array(list(model.discrete_values().values()), dtype=float)
    modes = np.array([automaton.initial for automaton in system.automata], dtype=np.int64)
    refuse_driving(system, 0.0, system.start_state({}), discrete, modes)
    data = compiled(model).data
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
        0.0 if known else _SECONDS + _SECONDS_PER_OPERATION * operations,
    )
