"""Put faults of units into the packaged models at random, and count how many the check of units finds.

    python docs/studies/units.py

The faults are those of tests/model/units/mutations.py. The command writes docs/studies/units.md in about a minute.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import hybridsim as hs
from hybridsim.model.units.faults import UNKNOWN, unit_faults, unit_rows

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from model.units.mutations import MODELS, NAMES, Fault, faults  # noqa: E402  # after the path

PAGE = ROOT / "docs" / "studies" / "units.md"
FIRST, MANY = 100, 1000  # faults of the first seed that are listed, and faults of each seed
SEEDS = (1, 2, 3)
ENDS = ("found on the right line", "found on another line", "not found")
KINDS = {"unit": "another unit in a declaration", "factor": "a factor left out", "name": "a name exchanged"}


def end_of(fault: Fault, model: hs.Model) -> str:
    """The result of the check of units for a fault."""
    lines = {caution.place.line for caution in unit_faults(model) if caution.place}
    return ENDS[2] if not lines else ENDS[0] if lines & fault.lines else ENDS[1]


def cases(seed: int, count: int) -> Iterator[tuple[Fault, str]]:
    """So many faults of a seed with their ends; a model that other checks refuse does not count."""
    found = 0
    for fault in faults(seed):
        if found == count:
            return
        try:
            model = hs.Model.from_toml(fault.text, str(MODELS / f"{fault.model}.toml"))
        except hs.ModelError:
            continue
        found += 1
        yield fault, end_of(fault, model)


def table(done: list[tuple[Fault, str]]) -> str:
    """The number of faults of each kind by their ends."""
    counts = Counter((fault.kind, end) for fault, end in done)
    out = f"| fault | {' | '.join(ENDS)} |\n| --- | --- | --- | --- |\n"
    for kind, what in KINDS.items():
        out += f"| {what} | {' | '.join(str(counts[kind, end]) for end in ENDS)} |\n"
    total = [sum(end == one for _, one in done) for end in ENDS]
    return out + f"| all | {' | '.join(map(str, total))} |\n"


def page() -> str:
    """The page of the results."""
    models = [hs.load(MODELS / f"{name}.toml") for name in NAMES]
    alarms = sum(len([*unit_faults(model)]) for model in models)
    rows = [row for model in models for row in unit_rows(model)]
    unknown = sum(known.startswith(UNKNOWN) for *_, known in rows)
    first = [*islice(cases(SEEDS[0], FIRST), FIRST)]
    many = [case for seed in SEEDS for case in cases(seed, MANY)]
    share = 100 * sum(end == ENDS[0] for _, end in many) / len(many)
    lost = Counter((f"`{fault.model}`, `{fault.what}`", end) for fault, end in many if end != ENDS[0])
    out = (
        HEAD.format(share=share)
        + f"\n## Results\n\nFor the {len(models)} unchanged models the check gives {alarms} warnings. "
    )
    out += f"These models have {len(rows)} quantities and expressions, of which {unknown} have an unknown unit.\n\n"
    out += f"The first table has the first {FIRST} faults of seed {SEEDS[0]}.\n\n{table(first)}\n"
    seeds = ", ".join(map(str, SEEDS))
    out += f"The second table has {MANY} faults of each of the seeds {seeds}.\n\n{table(many)}\n"
    out += (
        "The third table lists the faults that were not found on the right line, the most frequent first.\n\n"
    )
    out += "| fault | end | times |\n| --- | --- | --- |\n"
    for (what, end), times in sorted(lost.items(), key=lambda item: (-item[1], item[0]))[:20]:
        out += f"| {what} | {end} | {times} |\n"
    return out + "\n" + REASONS


HEAD = """# Faults of units

How many faults of units does `hybridsim check` find? The command finds {share:.1f} % of random faults, and names the
right line.

`python docs/studies/units.py` puts faults of units into the packaged models that declare units, one fault at a time.
The script counts how many faults `hybridsim check` finds, and on which lines. See [Check the units of a
model](../how-to/check-units.md).

The faults are drawn at random. There are three kinds:

- *Another unit* means that a declaration gets a wrong unit. The wrong unit has another dimension, or the same
  dimension and another size.
- *A factor left out* means that `a*b` becomes `a` or `b`, and `a/b` becomes `a`.
- *A name exchanged* means that a name in an expression becomes another name of the model.

A fault counts only if it changes the unit of an expression. A factor that is left out must not be a pure number,
and exchanged names must have different units. The script has its own table of the units of all names, which shares
no code with the check. These changes do not count:

- The changed expression is a guard, monitor or surface that is a single product. An expression that is a single
  product may have any unit.
- After the change, the expression is only a number. A number may have any unit.
- Other checks refuse the changed model.

A fault is found on the right line if the warning is on the line of the changed expression. For a changed
declaration, a line of an expression with the declared name counts as right too. For a change in a friction law, the
line of the contact's load or of the law's arguments is right.
"""
REASONS = """The faults were not found for these reasons:

- The unit of an impact force is not declared. If `m` is left out of `-g + p/m`, `p` becomes an acceleration, and
  all units still agree. Only a contact force in the same model can determine the unit of `p`. The unit of t in
  `thermostat` is not declared either.
- A number in a product may be a constant with a unit, so any unit of the product is accepted. Examples are
  `0.6*sqrt(k/m)`, `0.1*A*omega` and `w**2/2`.
- If two expressions imply different units of a force, the warning may be on the line of the unchanged expression.
"""


def main() -> None:
    """Run the study and write the page."""
    os.chdir(ROOT)
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
