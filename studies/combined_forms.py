"""Whether whole models that combine forms as people do move as an independent judge says.

    python studies/combined_forms.py [structures] [draws] [journal]        (2000 and 10 make the page)
    python studies/combined_forms.py shrink STRUCTURE DRAW INTEGRATOR      (a small model that shows the same)

The generator and the judge are in tests/reference/combined. The runs go to two processes; one that does not come back
within a minute is ended, and counts as a finding. With a journal the same call goes on where it stopped.
"""

from __future__ import annotations

import json
import multiprocessing as mp
import os
import sys
import time
from collections import Counter
from itertools import combinations
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

PAGE = Path(__file__).parents[1] / "docs" / "studies" / "combined-forms.md"
BY_HAND = "## What it found"
PATIENCE = 120.0  # seconds without a result after which a run counts as one that hangs
SHOWN = ("agrees", "names refused")


def work(tasks: Any, results: Any, draws: int) -> None:
    """Run structures until there is none left; each result is sent when it is there."""
    from reference.combined.trial import trials

    while (task := tasks.recv()) is not None:
        seed, first = task
        try:
            for record in trials(seed, draws, first):
                results.send(record)
        except Exception as error:
            results.send({"seed": seed, "draw": -1, "kind": "judge", "integrator": "", "detail": repr(error)[:300]})
        results.send({"seed": seed, "done": True})


class Worker:
    """A process, what it is at, and when it was last heard of."""

    def __init__(self, context: Any, draws: int):
        ours, theirs = context.Pipe()
        self.pipe, back = context.Pipe(duplex=False)
        self.orders = ours
        self.process = context.Process(target=work, args=(theirs, back, draws), daemon=True)
        self.process.start()
        self.seed, self.draw, self.heard = -1, 0, time.perf_counter()

    def begin(self, seed: int, first: int = 0) -> None:
        self.seed, self.draw, self.heard = seed, first, time.perf_counter()
        self.orders.send((seed, first))

    def end(self) -> None:
        self.process.kill()
        self.process.join()


def study(structures: int, draws: int, journal: Path, first: int = 0) -> list[dict[str, Any]]:
    """All structures, by two processes."""
    done: list[dict[str, Any]] = []
    if journal.exists():
        done = [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()]
    finished = {r["seed"] for r in done if r.get("done")}
    todo = [s for s in range(first, first + structures) if s not in finished]
    context = mp.get_context("spawn")
    workers = [Worker(context, draws) for _ in range(int(os.environ.get("WORKERS", "2")))]
    idle = list(workers)
    with journal.open("a", encoding="utf-8") as out:

        def keep(record: dict[str, Any]) -> None:
            done.append(record)
            out.write(json.dumps(record) + "\n")
            out.flush()
            if "kind" in record and record["kind"] not in SHOWN:
                print(*(record.get(k, "") for k in ("seed", "draw", "kind", "integrator", "status", "detail")), flush=True)

        while todo or len(idle) < len(workers):
            while todo and idle:
                idle.pop().begin(todo.pop(0))
            for worker in list(workers):
                if worker in idle:
                    continue
                if worker.pipe.poll(0.05):
                    record = worker.pipe.recv()
                    worker.heard = time.perf_counter()
                    worker.draw = record.get("draw", worker.draw)
                    keep(record)
                    if record.get("done"):
                        idle.append(worker)
                elif time.perf_counter() - worker.heard > PATIENCE or not worker.process.is_alive():
                    hung = worker.process.is_alive()
                    worker.end()
                    keep({"seed": worker.seed, "draw": worker.draw, "kind": "hangs" if hung else "dies", "integrator": "",
                          "detail": "no result in time" if hung else "the process ended"})
                    keep({"seed": worker.seed, "done": True})
                    workers[workers.index(worker)] = fresh = Worker(context, draws)
                    idle.append(fresh)
    for worker in workers:
        worker.end()
    return done


def pairs(seeds: list[int]) -> tuple[Counter[str], Counter[tuple[str, str]]]:
    """In how many structures each form and each pair of forms is."""
    from reference.combined.trial import features

    single: Counter[str] = Counter()
    double: Counter[tuple[str, str]] = Counter()
    for seed in seeds:
        found = sorted(f for f in features(seed) if not f.startswith("part: "))
        single.update(found)
        double.update(combinations(found, 2))
    return single, double


def main() -> None:
    """Run the study or shrink a finding."""
    if sys.argv[1:2] == ["shrink"]:
        from reference.combined.small import small

        print(small(int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]))
        return
    structures = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    draws = int(sys.argv[2]) if len(sys.argv) > 2 else 10
    journal = Path(sys.argv[3]) if len(sys.argv) > 3 else Path("combined-forms.jsonl")
    done = study(structures, draws, journal, int(os.environ.get("FIRST", "0")))
    print(Counter(r["kind"] for r in done if "kind" in r))
    single, double = pairs(sorted({r["seed"] for r in done}))
    rare = [(a, b) for a, b in combinations(sorted(single), 2) if double[a, b] < 10]
    print(len(single), "forms,", len(rare), "pairs in fewer than 10 structures:", rare[:20])


if __name__ == "__main__":
    main()
