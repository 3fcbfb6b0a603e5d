"""Run a sweep of 10^5 steady states on threads and on a cluster, and record its memory and its failed points.

    python docs/studies/sweeps.py [points]            (10^5 by default; they make docs/studies/sweeps.md)

The points (F0, omega, c) of the reference model are random. Three of them cannot succeed, with a mass of zero, a
damping that adds energy, and a spring of negative stiffness. One sweep runs on threads, and the memory of the
process is read meanwhile. The other one runs on a dask cluster of two processes on the same machine. Results are
compared bit for bit.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from distributed import Client, LocalCluster
from rivals.page import machine

import hybridsim as hs
from hybridsim.engine.record.limits import resident_megabytes

PAGE = Path(__file__).parents[2] / "docs" / "studies" / "sweeps.md"
MEASURES = ["amplitude.x", "energy.x", "stick_fraction.f", "kind"]
SEED = 2026
NAMES = ("F0", "omega", "c", "m", "k")
WARM, LOOKS = 1000, 5  # points before the memory counts; how often it is shown
# what cannot succeed: values of F0, omega, c, m, k
BAD = {
    "a mass of zero": (30.0, 424.0, 5.65, 0.0, 1e5),
    "damping that feeds the motion": (30.0, 424.0, -200.0, 0.2, 1e5),
    "a spring that pushes away": (30.0, 424.0, 5.65, 0.2, -1e5),
}


def drawn(count: int) -> dict[str, list[float]]:
    """Values of the parameters by name, the bad points in the middle."""
    rng = np.random.default_rng(SEED)
    natural = np.sqrt(1e5 / 0.2)
    table = np.column_stack(
        [
            40.0 * rng.uniform(0.5, 1.5, count),
            natural * rng.uniform(0.05, 2.0, count),
            rng.uniform(2.0, 20.0, count),
            np.full(count, 0.2),
            np.full(count, 1e5),
        ]
    )
    for k, values in enumerate(BAD.values()):
        table[count // 2 + k] = values
    return {name: column.tolist() for name, column in zip(NAMES, table.T, strict=True)}


def on_threads(values: dict[str, list[float]], say: bool) -> tuple[hs.Sweep, list[tuple[int, float]]]:
    """The sweep, and (points done, megabytes) at some of them."""
    count = len(values["F0"])
    marks = [min(WARM, count // LOOKS), *(count * k // LOOKS for k in range(1, LOOKS + 1))]
    seen: list[tuple[int, float]] = []

    def look(done: int, total: int, _: str) -> None:
        while len(seen) < len(marks) and done >= marks[len(seen)]:
            seen.append((done, resident_megabytes()))
            if say:
                print(f"{done} of {total} points, {seen[-1][1]:.0f} MB", flush=True)

    return hs.sweep("dfcs", values, MEASURES, mode="list", progress=look), seen


def on_a_cluster(values: dict[str, list[float]]) -> hs.Sweep:
    """The same by dask."""
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
        client.get_executor() as executor,
    ):
        return hs.sweep("dfcs", values, MEASURES, mode="list", executor=executor)


def page(
    here: hs.Sweep, there: hs.Sweep, seen: list[tuple[int, float]], differing: list[str], count: int
) -> str:
    """The page."""
    bad = [f"| {what} | {here.status[count // 2 + k]} |" for k, what in enumerate(BAD)]
    others = Counter(
        str(s).partition(":")[0]
        for k, s in enumerate(here.status)
        if not count // 2 <= k < count // 2 + len(BAD)
    )
    statuses = [f"| {number} | {status} |" for status, number in others.most_common()]
    kinds = ", ".join(
        f"{kind} ({number})" for kind, number in Counter(map(str, here["kind"][~here.failed])).most_common()
    )
    rates = [
        f"| {sweep.executor} | {sweep.wall_time:.0f} | {count / sweep.wall_time:.0f} |"
        for sweep in (here, there)
    ]
    memory = [f"| {done} | {megabytes:.0f} |" for done, megabytes in seen]
    same = "the same to the last bit" if not differing else "not the same in " + ", ".join(differing)
    return "\n".join(
        [
            "# A sweep of 10^5 steady states",
            "",
            "Is a large sweep complete, and is it the same on a cluster? "
            f"On threads and on a cluster the results of {count} points are {same}.",
            "",
            f"`python docs/studies/sweeps.py` runs `hs.sweep` at {count} random points of the model `dfcs`.",
            f"The measures of the sweep are {', '.join(f'`{name}`' for name in MEASURES[:-1])} and `{MEASURES[-1]}`.",
            "F0/N is from 0.5 to 1.5, omega from 0.05 to 2 times the natural frequency, and c from 2 to 20 "
            "N s/m.",
            f"{machine()}",
            "",
            "| executor | seconds | points per second |",
            "| --- | --- | --- |",
            *rates,
            "",
            "Every measure and every status is compared.",
            "",
            "## Memory",
            "",
            "The table gives the memory of the process during the sweep on threads. Each point has four numbers as its "
            "result.",
            "",
            "| points done | MB |",
            "| --- | --- |",
            *memory,
            "",
            "## Points that cannot succeed",
            "",
            "At three further points the model has no steady state. For each of these points the sweep "
            "reports a status, and NaN as the result.",
            "",
            "| fault | status |",
            "| --- | --- |",
            *bad,
            "",
            "## Other points",
            "",
            f"The motions at the other points are of these kinds: {kinds}.",
            "",
            "| points | status |",
            "| --- | --- |",
            *statuses,
            "",
        ]
    )


def main() -> None:
    """Run the study."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10**5
    values = drawn(count)
    began = time.perf_counter()
    here, seen = on_threads(values, say=True)
    print(f"threads: {time.perf_counter() - began:.0f} s", flush=True)
    there = on_a_cluster(values)
    print(f"dask: {there.wall_time:.0f} s", flush=True)
    differing = [
        name
        for name, one, other in [
            *((name, here[name], there[name]) for name in MEASURES),
            ("status", here.status, there.status),
        ]
        if not np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    ]
    text = page(here, there, seen, differing, count)
    if len(sys.argv) > 1:
        print(text)
    else:
        PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
