"""Whether random models with friction, relays, stops and automata end as they should, and agree with time stepping.

    python docs/studies/random_structures.py [structures] [draws] [journal]    (200 and 50 make the page)

Each draw is run by two of `dop853`, `taylor` and `exact`, and the first is held against a time stepping that shares
no code with hybridsim (tests/reference/stepped_structures.py), at three numbers of steps and more, each about twice the
one before. With a journal what is done is written there, structure by structure, and the same call goes on from it.
What the page says under its last heading is written by hand, and stays.
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
    """What became of all draws; a record for each structure."""
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
    """One line on a structure, and all that is to be looked at."""
    counts = Counter(verdict.kind for verdict in verdicts)
    print(f"{number}: {refused.splitlines()[0] if refused else dict(counts)} {seconds:.0f} s", flush=True)
    for v in verdicts:
        if v.kind in ("disagrees", "fault", "unresolved") or v.status not in ("finished", "terminated"):
            print(
                f"    {v.draw} {v.integrator} {v.kind} {v.status} {v.detail} | {v.message[:300]}", flush=True
            )


HEAD = """# Random structures with events

`python docs/studies/random_structures.py` makes random models and holds each run against a method that
shares no code and no
decision with hybridsim. A structure has one to four masses with springs, dampers and forces (constant, sines, square
waves), and up to three of the following kinds of components: friction contacts (one to three; Coulomb, static above
kinetic, Stribeck, asymmetric, viscous; on the ground, on a belt, between bodies; with loads that vary and that vanish),
switching surfaces with a random field on either side, unilateral contacts with restitution (walls, moving walls, bodies
that strike each other), automata (bilinear springs, hysteresis, kicks by a reset, saturations, a thermostat), monitors.
Its numbers are drawn {draws} times; each time `dop853` (rtol 1e-9), `taylor` (1e-10) or, where it can, `exact` is
judged, in turns, and held against the next of them, too.

*The other method* steps through time without locating anything (`tests/reference/stepped_structures.py`): the forces of
a step are those that fit the laws at its end. It is of first order, and is run with 2003, 4327 and 8923 steps, and
with up to 568 019 where that does not decide. All these numbers are prime: no instant but the start and the end is met
by two of the runs, so that their errors are not alike. Positions are compared at 100 times. With d the largest of the
differences of successive runs, each taken to fall with the step, which is its error if the order is one,

- a run *agrees* where it is off by at most 3 d at all times, d is below 0.5 % of the motion, or with the most steps
  below 2 %, and the other integrator differs from it by no more than a change of the start by 1e-6 does, and ends
  likewise. That two of ours agree proves nothing; that they differ proves one of them wrong;
- *sensitive*: where, and as far as, a change of the start by 1e-5 makes the other method itself change by more than
  300 times that (a grazing impact, a stop that barely happens, chaos). Up to there the run has to agree;
- *unresolved*: the other method has not converged by its smallest step;
- *disagrees*: everything else.

"""


def page(done: list[dict[str, Any]], draws: int) -> str:
    """The page of the results."""
    accepted = [record for record in done if not record["refused"]]
    all_verdicts = [v for record in accepted for v in record["verdicts"]]
    kinds = Counter(v["kind"] for v in all_verdicts)
    statuses = Counter(v["status"] for v in all_verdicts)
    out = HEAD.format(draws=draws)
    events = sum(v["events"] for v in all_verdicts)
    out += f"{len(accepted)} structures, {len(all_verdicts)} draws, {events} events.\n\n"
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
        out += "\nRefused as models, with their reasons:\n\n"
        out += "".join(f"- {count}: {reason}\n" for reason, count in refused.most_common())
    open_cases = [
        (r["number"], v) for r in accepted for v in r["verdicts"] if v["kind"] not in ("agrees", "sensitive")
    ]
    if open_cases:
        out += "\nNeither agree nor are sensitive (structure/draw):\n\n"
        for number, v in open_cases:
            out += (
                f"- {number}/{v['draw']}, `{v['integrator']}`, {v['kind']}, `{v['status']}`: {v['detail']}\n"
            )
    minutes = sum(record["seconds"] for record in done) / 60
    return out + f"\n{minutes:.0f} minutes on one core, compilation of the models included.\n"


def main() -> None:
    """Run the study, print the page, write it where it is whole."""
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
