"""Compare the motion of random whole models, which combine many forms, with that of an independent judge.

    python docs/studies/combined_forms.py [structures] [draws] [journal]        (2000 and 10 make the page)
    python docs/studies/combined_forms.py shrink STRUCTURE DRAW INTEGRATOR      (a small model that shows the same)

The generator and the judge are in tests/reference/combined. The runs use two processes. A process that does not
return in time is ended and counts as a finding, and the next set of numbers follows. With a journal the same command
continues where it stopped. SEEDS="3 17" in the environment selects these structures instead.
"""

from __future__ import annotations

import json
import multiprocessing as mp
import os
import sys
import textwrap
import time
from collections import Counter
from itertools import combinations
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

PAGE = Path(__file__).parents[2] / "docs" / "studies" / "combined-forms.md"
BY_HAND = "## What it found"
PATIENCE = 600.0  # seconds without a result after which a run counts as one that hangs


def work(tasks: Any, results: Any, draws: int) -> None:
    """Run structures until there is none left; each result is sent when it is there."""
    from reference.combined.trial import trials

    while (task := tasks.recv()) is not None:
        seed, first = task
        try:
            for record in trials(seed, draws, first):
                results.send(record)
        except Exception as error:
            results.send(
                {"seed": seed, "draw": -1, "kind": "judge", "integrator": "", "detail": repr(error)[:300]}
            )
        results.send({"seed": seed, "done": True})


class Worker:
    """A process, what it is at, and when it was last heard of."""

    def __init__(self, context: Any, draws: int):
        ours, theirs = context.Pipe()
        self.pipe, back = context.Pipe(duplex=False)
        self.orders = ours
        self.process = context.Process(target=work, args=(theirs, back, draws), daemon=True)
        self.process.start()
        self.seed, self.draw, self.runs, self.heard = -1, 0, 0, time.perf_counter()

    def begin(self, seed: int, first: int = 0) -> None:
        self.seed, self.draw, self.runs, self.heard = seed, first, 0, time.perf_counter()
        self.orders.send((seed, first))

    def hears(self) -> dict[str, Any]:
        """What the process sends next."""
        record: dict[str, Any] = self.pipe.recv()
        self.heard, draw = time.perf_counter(), record.get("draw", self.draw)
        self.draw, self.runs = draw, self.runs + 1 if draw == self.draw else 1
        return record

    def end(self) -> None:
        self.process.kill()
        self.process.join()


def study(seeds: list[int], draws: int, journal: Path) -> list[dict[str, Any]]:
    """All structures, by two processes."""
    done: list[dict[str, Any]] = []
    if journal.exists():
        done = [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()]
    finished = {r["seed"] for r in done if r.get("done")}
    todo = [s for s in seeds if s not in finished]
    context = mp.get_context("spawn")
    workers = [Worker(context, draws) for _ in range(int(os.environ.get("WORKERS", "2")))]
    idle = list(workers)
    with journal.open("a", encoding="utf-8") as out:
        from reference.combined.trial import QUIET

        def keep(record: dict[str, Any]) -> None:
            done.append(record)
            out.write(json.dumps(record) + "\n")
            out.flush()
            if "kind" in record and record["kind"] not in QUIET:
                print(
                    *(record.get(k, "") for k in ("seed", "draw", "kind", "integrator", "status", "detail")),
                    flush=True,
                )

        while todo or len(idle) < len(workers):
            while todo and idle:
                idle.pop().begin(todo.pop(0))
            wait([worker.pipe for worker in workers if worker not in idle], timeout=5.0)
            for worker in list(workers):
                if worker in idle:
                    continue
                if worker.pipe.poll():
                    record = worker.hears()
                    keep(record)
                    if record.get("done"):
                        idle.append(worker)
                elif time.perf_counter() - worker.heard > PATIENCE or not worker.process.is_alive():
                    hung = worker.process.is_alive()
                    worker.end()
                    at = worker.draw + (worker.runs >= 2)
                    keep(
                        {
                            "seed": worker.seed,
                            "draw": at,
                            "kind": "hangs" if hung else "dies",
                            "integrator": "",
                            "detail": "no result in time" if hung else "the process ended",
                        }
                    )
                    workers[workers.index(worker)] = fresh = Worker(context, draws)
                    fresh.begin(worker.seed, at + 1)
    for worker in workers:
        worker.end()
    return done


def pairs(seeds: list[int]) -> tuple[Counter[str], Counter[tuple[str, str]]]:
    """In how many structures each form and each pair of forms is."""
    from reference.combined.chosen import forms

    single: Counter[str] = Counter()
    double: Counter[tuple[str, str]] = Counter()
    for seed in seeds:
        found = forms(seed)
        single.update(found)
        double.update(combinations(found, 2))
    return single, double


HEAD = """# Combined forms

Do runs of models with many combined features agree with an independent solver? Of {runs} runs, {agree} agree with
the independent solver and {differ} differ from it. The tables below list all runs that do not agree.

`python docs/studies/combined_forms.py` draws whole models at random. The script compares each run with an
independent solver, which shares no code with hybridsim. On this page this solver is called *the judge*. A *form* is
an element of a model, such as an impact, or a way to write an expression. The models combine these forms:

- Every number is a literal, a parameter, an expression of parameters, a definition, a discrete state or an input.
- Guards, loads, gaps, laws, rates, monitors and resets contain `max`, `min`, `abs` and conditionals. Each of these
  functions is written in one of several equivalent ways.
- Forces, loads and speeds of belts change at known times. The changes at known times are written as single
  conditions, Boolean combinations of conditions, tables or waves.
- Runs start on a guard, at rest or on a corner. Schedules, clocks, impacts, contacts, relays and monitors have
  events at the same instant.
- Parts of a model depend on states of other parts. Some expressions use a definition.
- Names, the order of declaration, the scale and sign of states, and the origin of time are also random. One run in
  ten is stopped in the middle and resumed.

A *structure* is a random model without its numbers. Each structure gets several random sets of numbers. Each set of
numbers runs with two integrators. The first integrator is the default or another one of hybridsim, and the second is
drawn at random. The first structures are selected so that no pair of forms is rare. Each selected structure is the
best of {pool} random structures. The best structure has the most pairs of forms that are still in fewer than
{enough} structures. The later structures are not selected. Parts of a model are drawn independently, so all pairs of
forms are possible.

*The judge* (`tests/reference/combined`) reads an abstract form of the model, and not the model file. The judge
computes the motion by Taylor series for each combination of modes. The judge finds zeros by dense sampling and
bisection. At an instant with an event the judge tries every combination of modes and of branches of `abs`, `min`,
`max` and conditionals. A combination is admissible if its conditions are true just after the instant. The judge also
finds impulses by trying all combinations. If a run disagrees, the judge computes the motion again in 40 digits. A
run is compared only as long as the motion is certain. The comparison ends if a guard comes closer to zero than 1e-6
and turns back. The comparison also ends if the rules permit several motions.

A run *agrees* if two conditions are met. First, at {points} times all states and discrete states differ from those of
the judge by at most {allowed:g} of the size of the motion. Second, all monitors fire as often as with the judge. Two
other kinds of runs are counted separately. Some runs stop with a named status before the motion of the judge ends.
Other runs are wrong, but warn that hybridsim integrated a jump without locating it.

"""


def page(done: list[dict[str, Any]], draws: int) -> str:
    """The page of the results."""
    from reference.combined.chosen import ENOUGH, POOL
    from reference.combined.compare import ALLOWED, POINTS

    runs = [r for r in done if r.get("kind") not in (None, "names refused", "no model", "unclear")]
    seeds = sorted({r["seed"] for r in runs})
    kinds = Counter(r["kind"] for r in runs)
    out = HEAD.format(
        allowed=ALLOWED,
        points=POINTS,
        pool=POOL,
        enough=ENOUGH,
        runs=len(runs),
        agree=kinds["agrees"],
        differ=kinds["differs"],
    )
    instants = sum(r.get("instants", 0) for r in runs)
    counts = f"There are {len(seeds)} structures with {draws} sets of numbers each. Each set runs with two "
    counts += "integrators. Some sets of numbers give no valid model, or no motion that is certain. "
    counts += f"The other sets give {len(runs)} runs, with {instants} instants of events."
    out += textwrap.fill(counts, 118) + "\n\n"
    out += "| result | runs |\n| --- | --- |\n"
    out += "".join(f"| {kind} | {count} |\n" for kind, count in kinds.most_common())
    statuses = Counter((r["kind"], r["status"]) for r in runs if r["kind"] in ("refused", "stopped", "chose"))
    out += "\n| result | status | runs |\n| --- | --- | --- |\n"
    out += "".join(f"| {kind} | `{status}` | {count} |\n" for (kind, status), count in statuses.most_common())
    out += "\n| integrator | runs | differ | stopped or refused |\n| --- | --- | --- | --- |\n"
    for name in sorted({r["integrator"] for r in runs if r["integrator"]}):
        of = Counter(r["kind"] for r in runs if r["integrator"] == name)
        out += f"| `{name}` | {sum(of.values())} | {of['differs']} | {of['stopped'] + of['refused']} |\n"
    single, double = pairs(seeds)
    least = sorted((double[pair], *pair) for pair in combinations(sorted(single), 2))
    out += f"\n## Forms\n\nThere are {len(single)} forms and {len(least)} pairs of forms. "
    out += f"{sum(count < 10 for count, *_ in least)} pairs occur in fewer than 10 structures.\n\n"
    out += "| form | structures | rarest partner | structures |\n| --- | --- | --- | --- |\n"
    for name in sorted(single):
        count, a, b = next(row for row in least if name in row[1:])
        out += f"| {name} | {single[name]} | {b if a == name else a} | {count} |\n"
    return out


def main() -> None:
    """Run the study or shrink a finding."""
    if sys.argv[1:2] == ["shrink"]:
        from reference.combined.small import small

        print(small(int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]))
        return
    structures = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    draws = int(sys.argv[2]) if len(sys.argv) > 2 else 10
    journal = Path(sys.argv[3]) if len(sys.argv) > 3 else Path("combined-forms.jsonl")
    from reference.combined.chosen import chosen_seeds

    seeds = [int(s) for s in os.environ.get("SEEDS", "").split()]
    done = study(seeds or chosen_seeds(structures), draws, journal)
    out = page(done, draws)
    print(out)
    if draws >= 10:
        _, found, by_hand = PAGE.read_text(encoding="utf-8").partition(BY_HAND)
        PAGE.write_text(f"{out}\n{found}{by_hand}" if found else out, encoding="utf-8")


if __name__ == "__main__":
    main()
