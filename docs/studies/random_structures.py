"""Compare random models with friction, relays, stops and automata with a time stepping method.

    python docs/studies/random_structures.py [structures] [draws] [journal]    (200 and 50 make the page)

Each draw is run by two of `dop853`, `taylor` and `exact`. The first run is compared with a time stepping method that
shares no code with hybridsim (tests/reference/stepped_structures.py). It has three or more numbers of steps, each
about twice the one before. With a journal the results are stored there, structure by structure, and the same command
continues from it. The text of the page under its last heading is written by hand, and stays.
"""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from reference.random_structures import structure
from reference.structure_judge import Verdict, all_draws

PAGE = Path(__file__).parents[2] / "docs" / "studies" / "random-structures.md"
BY_HAND = "## What it found"  # from here on
SEED = 1


def study(structures: int, draws: int, journal: Path | None) -> list[dict[str, Any]]:
    """The results of all draws, with a record for each structure."""
    done: list[dict[str, Any]] = []
    if journal and journal.exists():
        done = [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()]
    accepted = sum(not record["refused"] for record in done)
    number = len(done)
    while accepted < structures:
        began = time.perf_counter()
        refused, verdicts = all_draws(structure(number, SEED), draws, SEED)
        record = {
            "number": number,
            "features": sorted(structure(number, SEED).features),
            "refused": refused,
            "verdicts": [verdict._asdict() for verdict in verdicts],
            "seconds": time.perf_counter() - began,
        }
        done.append(record)
        if journal:
            with journal.open("a", encoding="utf-8") as out:
                out.write(json.dumps(record) + "\n")
        tell(number, refused, verdicts, record["seconds"])
        number += 1
        accepted += not refused
    return done


def tell(number: int, refused: str, verdicts: list[Verdict], seconds: float) -> None:
    """One line on a structure, and all its open cases."""
    counts = Counter(verdict.kind for verdict in verdicts)
    print(f"{number}: {refused.splitlines()[0] if refused else dict(counts)} {seconds:.0f} s", flush=True)
    for v in verdicts:
        if v.kind in ("disagrees", "fault", "unresolved") or v.status not in ("finished", "terminated"):
            print(
                f"    {v.draw} {v.integrator} {v.kind} {v.status} {v.detail} | {v.message[:300]}", flush=True
            )


HEAD = """# Random structures with events

Do runs of random models with events agree with an independent method that does not locate events? Of {all} draws
{agree} agree. Of the other draws, {sensitive} are sensitive to the start, {unresolved} could not be resolved by the
other method, and {disagree} disagree.

`python docs/studies/random_structures.py` makes random models and compares each run with another method. The other
method shares no code with hybridsim. The form of a random model is called its structure. A structure has one to
four masses with springs, dampers and forces (constant, sines, square waves). A structure also has up to three of
these kinds of components:

- One to three friction contacts. These contacts act on the ground, on a belt or between bodies. The friction laws
  are Coulomb, static above kinetic, Stribeck, asymmetric and viscous. The normal loads may vary and become zero.
- Switching surfaces with random rates on each side.
- Unilateral contacts with restitution, with a wall, a moving wall or another body.
- Components with modes. These components are bilinear springs, hysteresis, kicks by a reset, saturations and a
  thermostat.
- Monitors.

The numbers of each structure are drawn {draws} times, and each set of numbers is called a draw. Each draw runs with
two of the integrators `dop853` (rtol 1e-9), `taylor` (rtol 1e-10) and, if possible, `exact`. The two runs are
compared.

The *other method* is time stepping without location of events (`tests/reference/stepped_structures.py`). The forces
of a step satisfy the laws at the end of the step. The method is of first order. The other method runs with 2003,
4327 and 8923 steps. If these runs are not accurate enough, this method uses up to 568 019 steps. All these numbers
of steps are prime. Therefore the steps of two runs have only the start and the end in common. The errors of the runs
are then independent.

The positions of the other method are compared with those of hybridsim at 100 times. The error of the other method
is estimated from the differences between its runs. The error of a method of first order is proportional to the
step. Each difference therefore gives an estimate of the error with the most steps. Let d be the largest of these
estimates. The verdicts are defined as follows:

- A run *agrees* if it differs from the other method by at most 3 d at all times. In addition d must be below 0.5 %
  of the motion, or below 2 % in runs with the most steps. The run by the second integrator must end with the same
  status. The two runs by hybridsim must not differ by more than the effect of a change of the start by 1e-6.
- A run is *sensitive* if a change of the start by 1e-5 changes the result of the other method by more than 3e-3.
  The causes of this sensitivity are grazing impacts, stops that barely happen, and chaos. A sensitive run must agree
  up to the time at which the change exceeds 3e-3.
- A run is *unresolved* if the other method has not converged at its smallest step.
- A run *disagrees* in all other cases.

"""


def page(done: list[dict[str, Any]], draws: int) -> str:
    """The page of the results."""
    accepted = [record for record in done if not record["refused"]]
    all_verdicts = [v for record in accepted for v in record["verdicts"]]
    kinds = Counter(v["kind"] for v in all_verdicts)
    statuses = Counter(v["status"] for v in all_verdicts)
    out = HEAD.format(
        draws=draws,
        all=len(all_verdicts),
        agree=kinds["agrees"],
        sensitive=kinds["sensitive"],
        unresolved=kinds["unresolved"],
        disagree=kinds["disagrees"],
    )
    events = sum(v["events"] for v in all_verdicts)
    out += f"The {len(accepted)} structures have {len(all_verdicts)} draws with {events} events.\n\n"
    out += "| verdict | draws |\n| --- | --- |\n"
    out += "".join(f"| {kind} | {kinds[kind]} |\n" for kind in sorted(kinds))
    out += "\n| status | draws | agree up to there | sensitive | unresolved | disagree |\n"
    out += "| --- | --- | --- | --- | --- | --- |\n"
    for status, count in statuses.most_common():
        of = Counter(v["kind"] for v in all_verdicts if v["status"] == status)
        cells = [of["agrees"], of["sensitive"], of["unresolved"], of["disagrees"]]
        out += f"| `{status}` | {count} | " + " | ".join(map(str, cells)) + " |\n"
    out += "\n| feature | structures | draws | agree | sensitive | stopped with a named status |\n"
    out += "| --- | --- | --- | --- | --- | --- |\n"
    for feature in sorted({f for record in accepted for f in record["features"]}):
        having = [record for record in accepted if feature in record["features"]]
        of_it = [v for record in having for v in record["verdicts"]]
        stopped = sum(v["status"] not in ("finished", "terminated") for v in of_it)
        of = Counter(v["kind"] for v in of_it)
        out += (
            f"| {feature} | {len(having)} | {len(of_it)} | {of['agrees']} | {of['sensitive']} | {stopped} |\n"
        )
    refused = Counter(record["refused"].splitlines()[0] for record in done if record["refused"])
    if refused:
        out += (
            "\nhybridsim refused the models of these structures:\n\n| structures | reason |\n| --- | --- |\n"
        )
        out += "".join(f"| {count} | {reason} |\n" for reason, count in refused.most_common())
    open_cases = [
        (r["number"], v) for r in accepted for v in r["verdicts"] if v["kind"] not in ("agrees", "sensitive")
    ]
    if open_cases:
        out += (
            '\nThe next table lists the draws that do not agree and are not sensitive. In the last column "off" is '
            'the largest difference from the other method, and "bound" is 3 d. "Growth" is the factor '
            "by which a change of the start grows:\n\n"
        )
        out += (
            "| structure/draw | integrator | verdict | status | details |\n| --- | --- | --- | --- | --- |\n"
        )
        for number, v in open_cases:
            cells = (
                f"{number}/{v['draw']}",
                f"`{v['integrator']}`",
                v["kind"],
                f"`{v['status']}`",
                v["detail"],
            )
            out += f"| {' | '.join(cells)} |\n"
    minutes = sum(record["seconds"] for record in done) / 60
    return (
        out
        + f"\nThe study took {minutes:.0f} minutes on one core, including the compilation of the models.\n"
    )


def main() -> None:
    """Run the study, print the page, and write it if it is complete."""
    structures = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    draws = int(sys.argv[2]) if len(sys.argv) > 2 else 50
    journal = Path(sys.argv[3]) if len(sys.argv) > 3 else None
    done = study(structures, draws, journal)
    out = page(done, draws)
    print(out)
    if draws >= 50:
        _, found, by_hand = PAGE.read_text(encoding="utf-8").partition(BY_HAND)
        PAGE.write_text(f"{out}\n{found}{by_hand}" if found else out, encoding="utf-8")


if __name__ == "__main__":
    main()
