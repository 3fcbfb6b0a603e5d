"""Compare each run after a thousand other runs with the same run in a fresh process.

    python docs/studies/history.py [models] [runs] [journal]     (100 and 1000 make docs/studies/history.md)

For each model a process makes runs with other numbers, in random order. Between them, after them, and on other
threads at the same time, it makes the run of each integrator. Other processes make only one run each. They have an
empty cache of compiled models, or the cache that the first process left. With a journal the same command continues
where it stopped. ONLY="belt combined-58" in the environment selects these models instead. PAGE=1 writes the page of
the models that are in the journal.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import hybridsim as hs

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))

PAGE = ROOT / "docs" / "studies" / "history.md"
OURS = ("exact", "taylor", "dop853", "tsit5", "rodas5p", "rk4-dichotomy", "rk4-sign", "moreau")
FIXED = ("rk4-dichotomy", "rk4-sign", "moreau")  # they take a step instead of tolerances
STEPS = 2000  # number of fixed steps of a run
PERIODS = 10  # forcing periods of a run, if the model declares no duration
SECONDS = 0.1  # a run that takes longer is made over a shorter time
POINTS = 300  # times at which the dense output is compared
AFTER = (1, 30)  # the runs are also compared after this many runs
MANY = 27  # with more vectors of modes, modes are added to the tables when a run meets them
ROOMY = (93, 95, 101, 120, 155, 157, 161, 163, 193, 227)  # generated models that have more
MECHANICAL = {
    "chain-3": lambda: hs.chain_on_belt(3),
    "chain-5": lambda: hs.chain_on_belt(5),
    "two-blocks": hs.two_blocks_on_belt,
}
PIECES = ("status", "events", "states", "dense")  # parts of a result that are compared


# -- models and runs -----------------------------------------------------------------------------------------------


def generated(seed: int) -> tuple[hs.Model, float]:
    """The generated model of this number, and its duration."""
    from reference.combined.parts import structure
    from reference.combined.trial import rendered

    abstract = structure(seed).m
    renderer, model, _ = rendered(abstract, seed)
    start = float(renderer.style.shift)
    return model, start + float(abstract.duration)


def names_of(count: int) -> list[str]:
    """The models of the study: packaged ones, chains, and generated ones, some of which have many modes."""
    names = [one.name for one in hs.list_models()] + list(MECHANICAL)
    seeds = dict.fromkeys([*ROOMY, *range(count)])
    names = (names + [f"combined-{seed}" for seed in seeds])[:count]
    random.Random(1).shuffle(names)
    return names


class Case:
    """A model and its time span."""

    def __init__(self, name: str) -> None:
        self.name, self.start = name, 0.0
        if name in MECHANICAL:
            self.model, self.end = MECHANICAL[name]().to_model(), 20.0
        elif name.startswith("combined-"):
            self.model, self.end = generated(int(name.split("-")[1]))
            self.start = self.end - 5.0
        else:
            self.model = hs.load(name)
            omega = self.model.parameter_values().get("omega", 1.0)
            self.end = self.model.duration_value() or PERIODS * 2.0 * math.pi / float(omega)

    def run(self, integrator: str, share: float, **changes: Any) -> hs.Solution:
        """A run over a share of the span; an integrator with a fixed step has always the same step."""
        length = self.end - self.start
        span = changes.pop("span", (self.start, self.start + share * length))
        if integrator in FIXED:
            changes["step"] = length * share / STEPS
        return hs.simulate(changes.pop("model", self.model), span, integrator=integrator, **changes)


def digest(case: Case, make: Any) -> dict[str, str]:
    """All results of a run, to the last bit, as short texts."""
    try:
        sol = make()
    except hs.HybridsimError as error:
        return dict.fromkeys(PIECES, f"{type(error).__name__}: {error}")
    rng = np.random.default_rng(1)
    events = [(e.t.hex(), e.component, e.guard, e.source, e.target) for e in sol.events]
    sides = [np.concatenate([e.x_minus, e.x_plus]) for e in sol.events]
    dense: Any = "no states"
    if len(sol.t):
        first, last = float(sol.t[0]), float(sol.t[-1])
        dense = sol(first + (last - first) * rng.random(POINTS))
    return {
        "status": short(sol.status, sol.message, *sol.warnings),
        "events": f"{len(events)} " + short(events, *sides),
        "states": f"{len(sol.t)} " + short(sol.t, sol.y),
        "dense": short(dense),
    }


def short(*parts: Any) -> str:
    """A short text that differs if one bit of the parts differs."""
    found = hashlib.sha256()
    for part in parts:
        found.update(
            np.ascontiguousarray(part).tobytes() if isinstance(part, np.ndarray) else repr(part).encode()
        )
    return found.hexdigest()[:16]


# -- runs with other numbers ---------------------------------------------------------------------------------------


class Others:
    """Runs with other numbers, which are all different."""

    def __init__(self, case: Case, shares: dict[str, float], seed: int) -> None:
        self.case, self.shares, self.rng = case, shares, random.Random(seed)
        self.guest = Case("belt")  # another model
        self.counts: Counter[str] = Counter()

    def change(self) -> dict[str, Any]:
        """Other values of some parameters and another start."""
        rng, model = self.rng, self.case.model
        values = {k: v for k, v in model.parameter_values().items() if isinstance(v, float) and v}
        changed = {k: v * rng.uniform(0.7, 1.3) for k, v in values.items() if rng.random() < 0.5}
        out: dict[str, Any] = {"params": changed} if changed else {}
        if rng.random() < 0.5:
            out["x0"] = {
                name: x * rng.uniform(0.5, 1.5) + rng.choice([0.0, rng.uniform(-1.0, 1.0)])
                for name, x in model.start_values().items()
                if rng.random() < 0.7
            }
        return out

    def one(self) -> None:
        """One run; a refusal counts as one, too."""
        rng, case = self.rng, self.case
        integrator = rng.choice(list(self.shares))
        share = self.shares[integrator] * rng.choice([0.003, 0.01, 0.03, 0.1, 0.3])
        kind = rng.choice(
            [
                "plain",
                "plain",
                "numbers",
                "numbers",
                "numbers",
                "numbers",
                "stopped",
                "raised",
                "guest",
                "new",
            ]
        )
        changes = {} if kind in ("plain", "guest") else self.change()
        if integrator not in FIXED:
            changes["rtol"] = 10.0 ** -rng.randint(3, 12)
            changes |= {"max_step": share * (case.end - case.start) / 7.0} if rng.random() < 0.1 else {}
        changes["keep"] = rng.choice(["all", "events", "nothing"])
        if kind == "new":  # an equal model that is another object
            changes["model"] = Case(case.name).model
        if rng.random() < 0.05 and kind == "plain":
            changes["span"] = (case.start + share * (case.end - case.start), case.start)
        try:
            self.made(kind, integrator, share, changes)
            self.counts[kind] += 1
        except (hs.HybridsimError, Stopped) as error:
            self.counts["raised" if isinstance(error, Stopped) else "refused"] += 1

    def made(self, kind: str, integrator: str, share: float, changes: dict[str, Any]) -> None:
        """Make a run of this kind, and read some of it."""
        if kind == "guest":
            self.guest.run(integrator, 0.001, **changes)
            return
        if kind == "stopped":  # by a limit, and resumed half of the time
            sol = self.case.run(integrator, share, **changes, limits={"events": self.rng.choice([1, 3, 10])})
            if sol.status == "limit" and self.rng.random() < 0.5:
                sol.resume()
            return
        if kind == "raised":  # by an error from outside
            changes["progress"] = stopping(self.rng.randint(1, 3))
        sol = self.case.run(integrator, share, **changes)
        if self.rng.random() < 0.3 and len(sol.t) > 1:
            sol(0.5 * (sol.t[0] + sol.t[-1]))


class Stopped(Exception):
    """An error that is no error of hybridsim."""


def stopping(count: int) -> Any:
    """A report of progress that raises an error when it is called this often."""
    left = [count]

    def progress(_: float) -> None:
        left[0] -= 1
        if left[0] <= 0:
            raise Stopped

    return progress


# -- the processes -------------------------------------------------------------------------------------------------


def shares_of(case: Case) -> dict[str, float]:
    """For each integrator that can run the model the share of the span that it runs in a short time."""
    shares: dict[str, float] = {}
    for integrator in OURS:
        for share in (0.001, 0.002, 0.01, 0.1, 1.0):
            began = time.process_time()
            try:
                case.run(integrator, share, limits={"seconds": 3 * SECONDS})
            except hs.UsageError:
                break
            except hs.HybridsimError:
                pass
            seconds = time.process_time() - began
            if share > 0.002 and seconds > SECONDS:
                break
            shares[integrator] = share
            if share > 0.001 and 5.0 * seconds > SECONDS:  # the first run compiles
                break
    return shares


def after(name: str, runs: int, folder: Path) -> Iterator[dict[str, Any]]:
    """Runs of a model after others; the first answer has the spans."""
    use(folder / "history")
    case = Case(name)
    shares = shares_of(case)
    yield {"name": name, "shares": shares}
    others = Others(case, shares, sum(name.encode()))

    def found(when: str) -> Iterator[dict[str, Any]]:
        order = list(shares)
        others.rng.shuffle(order)
        for integrator in order:
            run = digest(case, lambda chosen=integrator: case.run(chosen, shares[chosen]))
            yield {"name": name, "integrator": integrator, "when": when, "run": run}

    yield from found("after the search for spans")
    for number in range(runs):
        others.one()
        if number + 1 in AFTER:
            yield from found(f"after {number + 1}")
    yield from found(f"after {runs}")
    yield from found("again")
    case.model = Case(name).model
    yield from found("equal model")
    yield from found_beside(case, shares)
    yield {"name": name, "others": dict(others.counts)}


def found_beside(case: Case, shares: dict[str, float]) -> list[dict[str, Any]]:
    """Runs on separate threads, all at once, while two further threads make other runs."""
    out: list[dict[str, Any]] = []
    is_over = threading.Event()

    def disturb(seed: int) -> None:
        others = Others(case, shares, seed)
        while not is_over.is_set():
            others.one()

    def judge(integrator: str) -> None:
        run = digest(case, lambda: case.run(integrator, shares[integrator]))
        out.append({"name": case.name, "integrator": integrator, "when": "on a thread", "run": run})

    beside = [threading.Thread(target=disturb, args=(seed,)) for seed in (1, 2)]
    threads = [threading.Thread(target=judge, args=(one,)) for one in shares]
    for thread in beside + threads:
        thread.start()
    for thread in threads:
        thread.join()
    is_over.set()
    for thread in beside:
        thread.join()
    return out


def fresh(name: str, shares: dict[str, float], folder: Path) -> list[dict[str, Any]]:
    """The run of each integrator in a process of its own, which has loaded the package and made no other run."""
    tasks = [(name, integrator, share, folder / integrator) for integrator, share in shares.items()]
    with get_context("fork").Pool(1, maxtasksperchild=1) as pool:
        return pool.starmap(alone, tasks, chunksize=1)


def alone(name: str, integrator: str, share: float, cache: Path, when: str = "fresh") -> dict[str, Any]:
    """The only run of a process."""
    use(cache)
    case = Case(name)
    run = digest(case, lambda: case.run(integrator, share))
    return {"name": name, "integrator": integrator, "when": when, "run": run}


def use(cache: Path) -> None:
    """Store compiled models in this folder from now on, beside links to the compiled engine."""
    from hybridsim.engine.native.cache import kernel_folder

    engine = kernel_folder()
    assert engine is not None, "the study needs a cache"
    hs.list_integrators()
    if not cache.exists():
        cache.mkdir(mode=0o700)
        (cache / engine.name).mkdir(mode=0o700)
        for part in engine.iterdir():
            if not part.name.startswith("models-"):
                (cache / engine.name / part.name).symlink_to(part)
    os.environ["HYBRIDSIM_CACHE"] = str(cache)


def process(*arguments: Any) -> list[dict[str, Any]]:
    """What a new process answers."""
    command = [sys.executable, __file__, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return [{"name": arguments[1], "failed": f"{arguments}: {done.stderr[-2000:]}"}]
    return [json.loads(line) for line in done.stdout.splitlines()]


def study(names: list[str], runs: int, journal: Path) -> list[dict[str, Any]]:
    """All models, one after the other."""
    done: list[dict[str, Any]] = []
    if journal.exists():
        done = [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()]
    over = {r["name"] for r in done if r.get("over")}
    done = [r for r in done if r["name"] in over]
    names = [name for name in names if name in over] if os.environ.get("PAGE") else names
    with journal.open("w", encoding="utf-8") as out:
        out.writelines(json.dumps(r) + "\n" for r in done)
        for name in names:
            if name in over:
                continue
            began = time.perf_counter()
            with tempfile.TemporaryDirectory() as folder:
                found = process("after", name, runs, folder)
                shares = found[0].get("shares", {})
                found += process("fresh", name, json.dumps(shares), folder)
                one = list(shares)[len(done) % len(shares)] if shares else OURS[0]
                found += process("alone", name, one, shares.get(one, 1.0), folder)
            found.append({"name": name, "over": True, "seconds": time.perf_counter() - began})
            out.writelines(json.dumps(r) + "\n" for r in found)
            out.flush()
            done += found
            print(name, f"{found[-1]['seconds']:.0f} s", *differing(found), flush=True)
    return done


# -- the page ------------------------------------------------------------------------------------------------------


def differing(found: list[dict[str, Any]]) -> list[str]:
    """The differences from the run of a fresh process, and the failures."""
    out = [r["failed"] for r in found if "failed" in r]
    truth = {(r["name"], r["integrator"]): r["run"] for r in found if r.get("when") == "fresh" and "run" in r}
    for r in found:
        if "run" in r and r["run"] != truth.get((r["name"], r["integrator"])):
            right = truth.get((r["name"], r["integrator"]), {})
            pieces = [piece for piece in PIECES if r["run"][piece] != right.get(piece)]
            out.append(f"{r['name']}, `{r['integrator']}`, {r['when']}: {', '.join(pieces)}")
    return out


HEAD = """# Does a run depend on earlier runs?

Does the result of a run depend on earlier runs in the same process? {compared} runs were made after other runs, and
{differ} of them differ from the same run in a new process.

`python docs/studies/history.py` tests up to 100 models. The models are those of the package, three chains of blocks,
and random models ([combined forms](combined-forms.md)). This page shows the results for {models} models, of which
{many} has more than {limit} combinations of modes. For a model with more combinations than this, the process keeps a
table of the combinations that its runs have reached. Earlier runs therefore change this table.

For each model one process makes {runs} other runs, in random order and by random integrators:

- The other runs have different parameters, starts, tolerances, spans and longest steps.
- A limit stops some runs. Some of the stopped runs are resumed.
- An exception in the `progress` function ends some runs.
- Some runs go backward in time.
- Some runs use another model, or a second `Model` object with the same content.

The *compared run* is a run of the model with its declared numbers. The same process makes the compared run with each
integrator. First this process searches for spans over which the runs are short. The columns of the table name the
times at which the process makes the compared runs:

- *After the search for spans* means that no other run has been made.
- *After 1*, *after 30* and *after 1000* mean that this number of other runs has been made.
- *Again* means that the compared runs are made a second time after the 1000 runs.
- *Equal model* means that the compared runs use a second `Model` object with the same content.
- *On a thread* means that all integrators run at the same time on one thread each. Two further threads make other
  runs.

The reference is the same run in a new process. The new process makes no other run. The cache of compiled models is
empty when the new process starts. The last column of the table is for a new process that uses the cache of the
process with
{runs} runs. All results are compared bit for bit. The comparison includes the status, the message, the warnings, all
steps, and the dense output at {points} times. The comparison also includes the events, with the states before and
after them.

"""


def page(done: list[dict[str, Any]], runs: int) -> str:
    """The page of the results."""
    names = sorted({r["name"] for r in done if r.get("over")})
    many = 0
    for name in names:
        many += math.prod(len(one.modes) for one in Case(name).model.all_components()) > MANY
    faults = differing(done)
    compared = sum("run" in r and r["when"] != "fresh" for r in done)
    out = HEAD.format(
        models=len(names),
        many=many,
        limit=MANY,
        runs=runs,
        points=POINTS,
        compared=compared,
        differ=len(faults),
    )
    whens = list(dict.fromkeys(r["when"] for r in done if "run" in r and r["when"] != "fresh"))
    truth = {(r["name"], r["integrator"]): r["run"] for r in done if r.get("when") == "fresh" and "run" in r}
    out += f"| integrator | models | events | {' | '.join(whens)} |\n" + "| --- " * (3 + len(whens)) + "|\n"
    for integrator in OURS:
        mine = {key[0]: run for key, run in truth.items() if key[1] == integrator}
        events = [run["events"].split()[0] for run in mine.values()]
        cells = [str(len(mine)), str(sum(int(count) for count in events if count.isdigit()))]
        for when in whens:
            there = [r for r in done if r.get("when") == when and r.get("integrator") == integrator]
            off = sum(r.get("run") != mine.get(r["name"]) for r in there)
            cells.append(f"{off} of {len(there)} differ")
        out += f"| `{integrator}` | {' | '.join(cells)} |\n"
    kinds: Counter[str] = Counter()
    for r in done:
        kinds.update(r.get("others", {}))
    out += f"\nThere were {sum(kinds.values())} other runs:\n\n| other runs | number |\n| --- | --- |\n"
    out += "".join(f"| {MEANING[kind]} | {count} |\n" for kind, count in kinds.most_common())
    return out + ("\n## Differences\n\n" + "".join(f"- {one}\n" for one in faults) if faults else "")


MEANING = {
    "plain": "with the same numbers and another tolerance or span",
    "numbers": "with other numbers",
    "stopped": "stopped by a limit",
    "raised": "ended by an error from outside",
    "guest": "of another model",
    "new": "of an equal model",
    "refused": "refused",
}


def main() -> None:
    """Make the study, or one of its processes."""
    kind = sys.argv[1] if len(sys.argv) > 1 else ""
    if kind in ("after", "fresh", "alone"):
        name, argument, *rest = sys.argv[2:]
        folder = Path(rest[-1])
        if kind == "after":
            answers = after(name, int(argument), folder)
        elif kind == "fresh":
            answers = iter(fresh(name, json.loads(argument), folder))
        else:
            when = "alone, models compiled"
            answers = iter([alone(name, argument, float(rest[0]), folder / "history", when)])
        for answer in answers:
            print(json.dumps(answer), flush=True)
        return
    count, runs = (int(x) for x in (sys.argv[1:3] + ["100", "1000"][len(sys.argv[1:3]) :]))
    journal = Path(sys.argv[3]) if len(sys.argv) > 3 else Path("history.jsonl")
    names = os.environ.get("ONLY", "").split() or names_of(count)
    out = page(study(names, runs, journal), runs)
    print(out)
    if runs >= 1000 and (count >= 100 or os.environ.get("PAGE")) and "ONLY" not in os.environ:
        PAGE.write_text(out, encoding="utf-8")


if __name__ == "__main__":
    main()
