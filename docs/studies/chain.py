"""Cost of an event in a chain of blocks on a belt, against the number of blocks: docs/studies/chain.md, its picture.

    python docs/studies/chain.py [OUT_DIR]

hybridsim is compared with heyoka, if it is installed (it is in the extra `rivals`), and with a simple fixed-step RK4
in numba with bisection.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from rivals import chain_rk4
from rivals.page import machine

import hybridsim as hs
from hybridsim.plot.shared import style

SIZES = (10, 30, 100, 300, 1000)
SPAN = {10: 200.0, 30: 100.0, 100: 40.0, 300: 15.0, 1000: 6.0}
TURNS = {10: 20, 30: 10, 100: 5, 300: 3, 1000: 3}  # the least time of so many
JUDGED = 5.0  # units of time after which states are compared: later, what is close parts by the motion itself
STEP, DELTA, BELT, COUPLING, LEAF = 0.01, 3.0, 0.2, 1.0, 1.0
CHAIN = (COUPLING, LEAF, DELTA, BELT)
LINES = {  # of the picture: colour, marker
    "hybridsim, rtol 1e-9": (style.PALETTE[0], "o-"),
    "hybridsim, rtol 1e-6": (style.PALETTE[5], "s--"),
    "heyoka, 1e-9": (style.PALETTE[2], "D-."),
    f"RK4, h = {STEP:g}": (style.PALETTE[1], "^:"),
}
HAS_HEYOKA = importlib.util.find_spec("heyoka") is not None
Run = Callable[[float], tuple[float, int, np.ndarray]]  # seconds, events and states of a run to an end


def ours(chain: hs.MechanicalSystem, rtol: float) -> Run:
    """A run of the package, in its compiled loop."""

    def run(end: float) -> tuple[float, int, np.ndarray]:
        sol = hs.simulate(chain, (0, end), rtol=rtol, keep="nothing")
        assert sol.success, sol.message
        return sol.stats["kernel_time"], int(sol.stats["events"]), sol.x_end

    return run


def runs_of(n: int) -> dict[str, Run]:
    """All that run a chain of n blocks."""
    chain = hs.chain_on_belt(n, coupling=COUPLING, leaf=LEAF, delta=DELTA, belt=BELT)
    found: dict[str, Run] = {f"hybridsim, rtol 1e-{p}": ours(chain, 10.0**-p) for p in (9, 6)}
    if HAS_HEYOKA:
        from rivals.chain_heyoka import prepared

        found["heyoka, 1e-9"] = prepared(chain.q0, *CHAIN, 1e-9)
    found[f"RK4, h = {STEP:g}"] = lambda end: chain_rk4.run(chain.q0, CHAIN, end, STEP)
    return found


def measured(n: int) -> dict[str, tuple[float, float, float]]:
    """Of each, ms per unit of time, events per unit of time, and the error after JUDGED."""
    runs = runs_of(n)
    chain = hs.chain_on_belt(n, coupling=COUPLING, leaf=LEAF, delta=DELTA, belt=BELT)
    truth = hs.simulate(chain, (0, JUDGED), rtol=1e-13, keep="nothing").x_end
    errors = {name: float(abs(run(JUDGED)[2] - truth).max()) for name, run in runs.items()}
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    events = {}
    for _ in range(TURNS[n]):
        for name, run in runs.items():
            took, events[name], _ = run(SPAN[n])
            seconds[name].append(took)
    return {
        name: (1e3 * min(took) / SPAN[n], events[name] / SPAN[n], errors[name])
        for name, took in seconds.items()
    }


def picture(rows: dict[int, dict[str, tuple[float, float, float]]], path: Path) -> None:
    """Time per event over the number of blocks."""
    figure = style.figure(7.0, 4.2)
    axes = figure.subplots()
    for name in rows[SIZES[0]]:
        colour, marks = LINES[name]
        per_event = [1e3 * rows[n][name][0] / rows[n][name][1] for n in SIZES]
        axes.loglog(SIZES, per_event, marks, color=colour, label=name)
    axes.set(xlabel="number of blocks n", ylabel="time per event [µs]")
    style.dress(axes)
    axes.legend(fontsize=8)
    style.save(figure, path)


def main() -> None:
    """Measure, draw, write the page."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "docs"
    rows, load = {}, os.getloadavg()[0]
    for n in SIZES:
        rows[n] = measured(n)
        print(n, rows[n], flush=True)
    picture(rows, out / "images" / "chain.png")
    (out / "studies" / "chain.md").write_text(page(rows, load), encoding="utf-8")


def page(rows: dict[int, dict[str, tuple[float, float, float]]], load: float) -> str:
    """The page, with its figures."""
    names, fine = list(rows[SIZES[0]]), "hybridsim, rtol 1e-9"
    per_event = [1e3 * rows[n][fine][0] / rows[n][fine][1] for n in SIZES]
    exponent = np.polyfit(np.log(SIZES), np.log(per_event), 1)[0]
    table = "\n".join(
        f"| {n} | {rows[n][fine][1]:.3g} | {us:.3g} | "
        + " | ".join(f"{rows[n][name][0]:.3g} ({rows[n][name][2]:.0e})" for name in names)
        + " |"
        for n, us in zip(SIZES, per_event)
    )
    is_ahead = {n: HAS_HEYOKA and rows[n][fine][0] < rows[n]["heyoka, 1e-9"][0] for n in SIZES}
    ahead, behind = (", ".join(str(n) for n in SIZES if is_ahead[n] is side) for side in (True, False))
    but = f", and slower for n = {behind}" if behind else ""
    verdict = ""
    if HAS_HEYOKA:
        verdict = f"""
hybridsim is faster than heyoka for n = {ahead or "none"}{but}. The program heyoka expands the series of the whole
chain at every event. The code of heyoka is compiled for this chain. The table does not include the time of this
compilation. The event callbacks of heyoka are Python functions. The kernels of hybridsim are compiled once for all
systems.
"""
    heads = " | ".join(names)
    return f"""# A chain of blocks: what an event costs

How does the cost of an event grow with the number of blocks n? In hybridsim the time per event grows as
n^{exponent:.2f}. The time per event is the time of a run divided by its number of events. Therefore the time per
event includes the steps between the events.

`hs.chain_on_belt(n)` is a chain of blocks of mass 1 on a belt of speed {BELT}. A leaf spring holds each block,
and a coupling spring joins neighbouring blocks. The leaf springs have a stiffness of {LEAF}, and the coupling springs
of {COUPLING}. The friction force at the slip velocity v is 1/(1 + {DELTA:g}|v|), and the initial positions are
random. The script `python docs/studies/chain.py` runs the methods in turn several times. The table contains the
shortest time of each method. Every run finished. {machine()}

When the study began, other programs used {load:.1f} of {os.cpu_count()} processors. Programs that ran at the same
time made all times longer. Ratios of times are uncertain by a factor of two.

The table gives milliseconds per unit of simulated time. The number in brackets is the largest error of a state after
{JUDGED:g} units of time. The reference is a run of hybridsim at rtol 1e-13.

| n | events per unit of time | us per event, hybridsim 1e-9 | {heads} |
| --- | --- | --- | {" | ".join(["---"] * len(names))} |
{table}

![Time per event against the number of blocks](../images/chain.png)

After an event hybridsim restarts only the few neighbouring blocks whose series changes by more than a tenth of the
tolerance. At the end of a step hybridsim expands the series of all blocks, once for all events of the step. The other
methods restart all blocks at each event. For the other methods the cost of an event is therefore proportional to n.
{verdict} hybridsim and heyoka control their error. RK4 with h = {STEP:g} has no error control. When RK4 releases a
block, it changes the speed of the block by 1e-14. Otherwise the block would stop again immediately. The program
siconos was not run, because PyPI has no wheel of siconos (`pip download siconos` finds no version).
"""


if __name__ == "__main__":
    main()
