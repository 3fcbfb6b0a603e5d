"""Runs every scene with every integrator and writes the table of what came out.

    python -m conformance.table [integrator ...]        (in tests/; ten minutes on two processors)

With no name, all integrators are run and docs/reference/conformance.md is written; with names, the tables of
these go to stdout.
"""

from __future__ import annotations

import multiprocessing
import sys
import warnings
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import hybridsim as hs
from conformance.native import MECHANISMS, mechanism
from hybridsim.testing.catalogue import SCENES
from hybridsim.testing.facts import CASES
from hybridsim.testing.suite import Outcome, outcome

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "conformance.md"
INTRODUCTION = """# What each integrator gets right

Every integrator runs scenes of `hybridsim.testing` with known answers. An answer is a closed form, or a computation
with 30 digits or more that shares no code with the package. [The atlas](../atlas/index.md) describes each scene.
`python -m conformance.table` in `tests/` writes this page.

A scene is *right* under these conditions:

- Every event is found, in the right mode and order, and there are no additional events.
- Held quantities are exact bit for bit.
- The errors decrease with the tolerance (1e-6, 1e-9, 1e-12), or with the step of a fixed-step method. A study ends
  early if runs get long.

The two numbers are errors at the last setting of the study. The first is the largest error of an event time, in units
of the scene's own time. The second is the largest error of a state, relative to its largest value. A method may
*lack* a capability that a scene needs. It then refuses such a model, if the model shows the need. The reasons are
listed below.
"""


def cell(result: Outcome) -> str:
    """One field of the table."""
    if result.verdict == "lacks":
        return f"lacks {result.reasons[0].split(':')[0]}"
    if result.failed:
        return "**wrong**"
    _, time_error, state_error = result.errors[-1]
    return f"{time_error:.0e}, {state_error:.0e}"


NATIVE = """
## SciPy's own event finding

The same solvers run with `events="native"`. Each smooth stretch is one call of `solve_ivp` with terminal events and
directions. A tenth of the forcing's period, if there is one, limits the steps. The mode after an event is decided as
for all others. Scenes that all of them get right are left out.
"""


def result_of(name: str, number: int, events: str) -> Outcome:
    """An integrator in the scene of that number; in a process of its own."""
    warnings.simplefilter("ignore")  # the table is of results; the tests hold warnings to be errors
    return outcome(name, SCENES[number], **({"events": events} if events else {}))


def outcomes(names: Sequence[str], events: str = "") -> dict[tuple[str, str], Outcome]:
    """What came out, by integrator and scene; run on all processors."""
    found = {}
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        jobs = {
            (name, scene.name): pool.submit(result_of, name, k, events)
            for k, scene in enumerate(SCENES)
            for name in names
        }
        for number, (key, job) in enumerate(jobs.items(), 1):
            found[key] = job.result()
            print(f"\r{number} of {len(jobs)}: {' in '.join(key)}\033[K", end="", file=sys.stderr)
    print(file=sys.stderr)
    return found


def native(names: Sequence[str]) -> list[str]:
    """The part of the page on `solve_ivp`'s own event finding: every failure with its mechanism."""
    solvers = [name for name in names if name.startswith("scipy-")]
    found, lines = outcomes(solvers, "native"), []
    for scene in SCENES:
        results = [found[name, scene.name] for name in solvers]
        if any(result.failed for result in results):
            lines.append((scene.name, *map(native_cell, results)))
    table = rows(("scene", *solvers), lines)
    return [NATIVE, table, "", rows(("mechanism", "what happens"), MECHANISMS.items())] if solvers else []


def native_cell(result: Outcome) -> str:
    """One field of the table: right, lacking, or the mechanism of the failure."""
    if result.failed:
        return f"**wrong**: {mechanism(result.integrator, result.scene) or 'not understood'}"
    return cell(result)


def rows(header: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    written = [header, ["---"] * len(header), *lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in written)


def page(names: Sequence[str]) -> str:
    """The whole page for some integrators."""
    results = outcomes(names)
    table = rows(
        ("scene", *names),
        ((scene.name, *(cell(results[name, scene.name]) for name in names)) for scene in SCENES),
    )
    lacking = rows(
        ("integrator", "lacks", "because"),
        (
            (one.name, capability, reason)
            for one in hs.list_integrators()
            if one.name in names
            for capability, reason in one.lacks.items()
        ),
    )
    parts = [INTRODUCTION, "## Scenes\n", table, "\n## Missing capabilities\n", lacking]
    faults = [
        (r.integrator, r.scene, " ".join(r.reasons[0].split()).replace("|", "/"))
        for r in results.values()
        if r.failed
    ]
    if faults:
        parts += ["\n## Wrong results\n", rows(("integrator", "scene", "what"), faults)]
    parts += native(names)
    sources = ((case, fact["name"], fact["source"]) for case, fact in CASES.items())
    parts += ["\n## Sources of the scenes\n", rows(("case", "what it is", "source"), sources)]
    return "\n".join(parts) + "\n"


def main(names: Sequence[str]) -> None:
    warnings.simplefilter("ignore")  # the table is of results; the tests hold warnings to be errors
    if names:
        print(page(names))
    else:
        PAGE.write_text(page([one.name for one in hs.list_integrators()]))


if __name__ == "__main__":
    main(sys.argv[1:])
