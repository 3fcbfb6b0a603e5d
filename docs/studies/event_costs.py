"""Measure what monitors, clocks, tables and impacts add to the time of a run.

    python docs/studies/event_costs.py [--turns 15] [--out DIR]

The runs with and without the part take turns in one process. Writes docs/studies/event-costs.md (or DIR).
"""

from __future__ import annotations

import argparse
import gc
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parent))

from rivals.page import machine, seconds

import hybridsim as hs

PERIOD = 2.0 * math.pi / (0.6 * math.sqrt(1e5 / 0.2))  # of the force in dfcs
LARGEST = 3.9554e-4  # size of x in its steady motion
INTEGRATORS = ("exact", "taylor", "dop853")
PARABOLA = """
schema = 1
name = "falling"
[states]
h = { start = 1, der = "w" }
w = { start = 0, der = "%s" }
"""


@dataclass(frozen=True)
class Case:
    """A model with the part, the same one without it, the span of both, and what counts as an event of the part."""

    title: str
    model: hs.Model
    without: hs.Model
    span: tuple[float, float]
    count: Callable[[hs.Solution], int]
    aim: str


def monitored(*monitors: hs.Monitor) -> tuple[hs.Model, hs.Model, tuple[float, float]]:
    """The system of the paper with monitors, and without."""
    model = hs.load("dfcs")
    return replace(model, monitors=monitors), model, (0.0, 100.0 * PERIOD)


def fired(solution: hs.Solution) -> int:
    """The number of recorded monitors."""
    return sum(event.kind == "monitor" for event in solution.events)


def cases() -> list[Case]:
    """All parts."""
    level = 1.01 * LARGEST  # the monitors come as close as 1 % of their size to zero
    far = [hs.Monitor(f"far{k}", f"x - {level * (1 + k)!r}") for k in range(8)]
    square = hs.Monitor("square", f"x*x - {1.01 * LARGEST**2!r}")
    swing = hs.Model.from_toml(
        'schema = 1\nname = "swing"\n[states]\nx = { start = 1, der = "y" }\ny = { start = 0, der = "-x - 0.1*y" }\n'
    )
    clock = '[discrete]\nheld = 0\n[clocks.tick]\nperiod = 0.01\nset = { held = "x" }\n'
    times = [0.05 * k for k in range(201)]
    values = [math.sin(0.7 * k) for k in range(201)]
    driven = '[inputs.u]\nkind = "table"\ntimes = %r\nvalues = %r\n'
    text = swing.to_toml()
    knots = text.replace("-x - 0.1*y", "-x - 0.1*y + u") + driven % (times, values)
    one_piece = text.replace("-x - 0.1*y", "-x - 0.1*y + u") + driven % ([0.0, 10.0], [0.0, 1.0])
    falling = PARABOLA % "-9.81"
    struck = PARABOLA % "p - 9.81" + '[impacts.p]\ngap = "h"\nrestitution = 1\n'
    reset = falling + '[modes.fly]\nguards.g = {expr="h", then={to="fly", reset={h="0", w="-w"}}}\n'
    long = (0.0, 90.0)
    return [
        Case("a linear monitor that never fires", *monitored(far[0]), fired, "1.3 times the run"),
        Case("eight that never fire", *monitored(*far), fired, "3 times the run"),
        Case("a quadratic monitor that never fires", *monitored(square), fired, "2 times the run"),
        Case("a quadratic monitor that records", *monitored(hs.Monitor("half", "x*x - 4e-8")), fired, "5 us an event"),
        Case("a monitor that records", *monitored(hs.Monitor("half", "x - 1.3e-4")), fired, "5 us an event"),
        Case("a monitor of the sliding speed", *monitored(hs.Monitor("speed", "v")), fired, "5 us an event"),
        Case("a clock", hs.Model.from_toml(text + clock), swing, (0.0, 10.0), lambda _: 1000, "5 us a tick"),
        Case("knots of an input", hs.Model.from_toml(knots), hs.Model.from_toml(one_piece), (0.0, 10.0),
             lambda _: 199, "5 us a knot"),
        Case("an impact", hs.Model.from_toml(struck), hs.Model.from_toml(falling), long,
             lambda solution: len(solution.events), "20 us an impact"),
        Case("a guard with a reset", hs.Model.from_toml(reset), hs.Model.from_toml(falling), long,
             lambda solution: len(solution.events), ""),
    ]  # fmt: skip


def measured(case: Case, integrator: str, turns: int) -> tuple[float, float, int]:
    """The median processor time in seconds with and without the part, and the number of its events."""

    def run(model: hs.Model) -> hs.Solution:
        solution = hs.simulate(model, case.span, integrator=integrator, keep="events", rtol=1e-9)
        assert solution.status == "finished", (case.title, integrator, solution.message)
        return solution

    for model in (case.model, case.without):  # until the machine code of all modes is made
        began = time.process_time()
        for _ in range(30):
            run(model)
            if time.process_time() - began > 5.0:
                break
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(turns):
        for model, spent in zip((case.model, case.without), times, strict=True):
            gc.collect()
            began = time.process_time()
            run(model)
            spent.append(time.process_time() - began)
    events = case.count(run(case.model))
    assert ("never" in case.title) == (events == 0), (case.title, integrator, events)
    return median(times[0]), median(times[1]), events


def row(case: Case, integrator: str, found: tuple[float, float, int]) -> str:
    """The line of a case in the table of the page."""
    whole, without, events = found
    added = seconds(max(whole - without, 0.0) / events) if events else "none"
    return (
        f"| {case.title} | {integrator} | {seconds(without)} | {seconds(whole)} | {whole / without:.2f} | "
        f"{events or 'none'} | {added} | {case.aim} |"
    )


def page(rows: list[str], never: list[float]) -> str:
    """The page."""
    head = "| part | integrator | without | with | ratio | events | added by an event | aim |"
    table = "\n".join([head, "| --- | --- | --- | --- | --- | --- | --- | --- |", *rows])
    return f"""# Cost of events

How much do monitors, clocks, tables and impacts add to the time of a run? With a linear monitor that never fires, a
run takes at most {max(never):.2f} times as long as without the monitor.

`exact`, `taylor` and `dop853` run from event to event in compiled code. In compiled code an ordinary event takes a
few microseconds. Other events take about a millisecond, because Python code handles them. An example is an event at
which the modes of several components are selected together. With `exact`, Python code also handles monitors that are
not polynomials of the states. A monitor of the sliding speed costs little, because the mode of the contact gives the
sign of this speed.

An impact at a single contact is an ordinary event. Python code handles an impact that strikes several contacts or
loads friction.

`python docs/studies/event_costs.py` writes this page. The table gives medians of processor time in one process.
Runs with the part in the first column alternate with runs without this part. The monitors belong to a run of the
oscillator of He et al. over 100 periods. The clock and the knots of an input belong to a damped oscillator. In the
rows "an impact" and "a guard with a reset" a falling body bounces without loss. {machine()}

{table}
"""


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--turns", type=int, default=15, help="turns of all runs")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="where the page is written")
    options = parser.parse_args()
    rows, never = [], []
    for case in cases():
        for integrator in INTEGRATORS:
            found = measured(case, integrator, options.turns)
            rows.append(row(case, integrator, found))
            print(rows[-1], flush=True)
            if case.title == "a linear monitor that never fires":
                never.append(found[0] / found[1])
    (options.out / "event-costs.md").write_text(page(rows, never), encoding="utf-8")


if __name__ == "__main__":
    main()
