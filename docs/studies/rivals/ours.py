"""hybridsim's own integrators, called as a user calls them."""

from __future__ import annotations

from typing import Any

import hybridsim as hs
from rivals.method import BACKWARD, FORWARD, STICK, STRUCK, Method, Result, Runs, columns
from rivals.scenes import Scene

_AFTER = {"stick": STICK, "slip+": FORWARD, "slip-": BACKWARD, "free": STRUCK}


def method(
    integrator: str,
    rtol: float | None = None,
    label: str = "",
    shown: bool = True,
    objects: bool = False,
    **options: Any,
) -> Method:
    """An integrator at a tolerance; objects: with `sol.events`, an object for each event, with its states."""
    name = integrator if rtol is None else f"{integrator}@{rtol:.0e}"
    name += "+objects" if objects else ""
    text = label or (integrator if rtol is None else f"{integrator} {rtol:.0e}".replace("e-0", "e-"))

    def start(scene: Scene) -> Runs | None:
        keywords = {"integrator": integrator, **({} if rtol is None else {"rtol": rtol}), **options}
        span, grid = (0.0, scene.end), scene.grid
        model = scene.model
        components = [component.name for component in model.all_components()]

        def events() -> Any:
            sol = hs.simulate(model, span, keep="events", **keywords)
            return sol, sol.events if objects else happened(sol), None

        def on_grid() -> Any:
            sol = hs.simulate(model, span, t_eval=grid, **keywords)
            return sol, happened(sol), sol.y

        def happened(sol: hs.Solution) -> list[Any]:
            return [(sol.event_times(name), sol.event_states(name)) for name in components]

        try:
            events()
        except hs.UsageError:
            return None

        def read(outcome: Any) -> Result:
            sol, _, states = outcome
            assert sol.success, sol.message
            found = [e for e in sol.events if e.kind == "transition"]
            rows = [(e.t, components.index(e.component), _AFTER[e.target]) for e in found]
            arrays = columns(rows, [e.x_plus for e in found], len(sol.names))
            return Result(*arrays, None if states is None else states.T)

        return Runs(events, on_grid, read, lambda outcome: outcome[0].stats["kernel_time"])

    return Method(name, text, "ours", start, shown=shown)
