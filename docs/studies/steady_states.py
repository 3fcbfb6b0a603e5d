"""Compare `hs.steady_state`, `hs.sweep` and `hs.frequency_response` with plain runs, at random points of many models.

    python docs/studies/steady_states.py [points] [seed] [journal]      (500 and 1 make docs/studies/steady-states.md)

steady_points.py draws the models. steady_brute.py finds their motions by plain runs and, for oscillators of one mass,
by a program that uses only SciPy. Each result is written to the journal, and the same command continues from there.
The text of the page under its last heading is written by hand, and stays.
"""

from __future__ import annotations

import json
import math
import sys
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import steady_brute as brute
from steady_points import Point, point

import hybridsim as hs
from hybridsim.errors import HybridsimError

PAGE = Path(__file__).parents[2] / "docs" / "studies" / "steady-states.md"
BY_HAND = "## Disagreements"  # from here on
MOST = 1024  # periods of `hs.steady_state`
EQUAL = 1e-6  # relative difference of two amplitudes or periods that agree
EQUAL_MULTIPLIERS = 1e-3  # the same of the coefficients of the characteristic polynomial
SCIPY_PERIODS = 300
REGULAR = "periodic", "equilibrium"
IRREGULAR = "chaotic", "quasi-periodic", "not settled"


# -- both sides --------------------------------------------------------------------------------------------------


def searched(drawn: Point) -> dict[str, Any]:
    """The result of `hs.steady_state`, as plain values."""
    try:
        found = hs.steady_state(drawn.model, max_periods=MOST)
    except HybridsimError as refusal:
        return {"kind": "refused", "message": refusal.message}
    record: dict[str, Any] = {"kind": found.kind, "message": found.message, "periods": found.periods}
    if found.success:
        names = [name for name in found.amplitude if name in states_of(drawn)]
        record |= {
            "period": found.period,
            "multiple": found.multiple,
            "amplitude": {name: float(found.amplitude[name]) for name in names},
            "stick": {name: float(value) for name, value in found.stick_fraction.items()},
        }
        try:
            record["multipliers"] = [[float(m.real), float(m.imag)] for m in found.multipliers]
        except HybridsimError as refusal:
            record["no_multipliers"] = refusal.message
    return record


def states_of(drawn: Point) -> list[str]:
    """The names of the states and discrete states."""
    return [part.name for part in (*drawn.plain.states, *drawn.plain.discrete)]


def swept(drawn: Point) -> dict[str, float]:
    """The amplitude of the first state by `hs.sweep`, and by `hs.frequency_response` if there is a frequency."""
    name = states_of(drawn)[0]
    if isinstance(drawn.model, hs.MechanicalSystem):
        value = 2.0 * math.pi / (drawn.period or 1.0)
    else:
        value = drawn.model.parameter_values()[drawn.swept]
    point_of = {drawn.swept: [value]}
    found = {"sweep": hs.sweep(drawn.model, point_of, [f"amplitude.{name}"], max_periods=MOST)}
    if drawn.frequency:
        found["frequency_response"] = hs.frequency_response(
            drawn.model, [value], frequency=drawn.swept, max_periods=MOST
        )
    return {what: float(sweep[f"amplitude.{name}"].ravel()[0]) for what, sweep in found.items()}


# -- the verdict -------------------------------------------------------------------------------------------------


def judge(drawn: Point, plain: brute.Motion, found: dict[str, Any]) -> tuple[str, list[str]]:
    """The verdict on a point, and the differences."""
    kind = found["kind"]
    if kind == "refused" or plain.kind.startswith("ended"):
        return "refused", []
    if plain.kind == "irregular":
        if kind in REGULAR:
            return "differs", [f"{kind} and irregular"]
        is_chaotic = plain.growth >= brute.GROWN
        if (kind == "chaotic" and plain.growth < 10.0) or (kind == "quasi-periodic" and is_chaotic):
            return "differs", [f"{kind}, growth {plain.growth:.1e}"]
        return "irregular", []
    if plain.kind == "slow" and not plain.multiple and kind in ("equilibrium", "not settled"):
        return "slow", []
    if kind in IRREGULAR:
        return ("slow" if plain.kind == "slow" else "differs"), [f"{kind} and {plain.kind}"]
    expected = "equilibrium" if plain.kind == "rest" else "periodic"
    if kind != expected:
        return "differs", [f"{kind} and {plain.kind}"]
    if kind == "equilibrium":
        return "agrees", []
    differences = list(compared(drawn, plain, found))
    if not differences:
        return "agrees", []
    return ("slow" if plain.kind == "slow" and plain.error > 1e-4 else "differs"), differences


def compared(drawn: Point, plain: brute.Motion, found: dict[str, Any]) -> list[str]:
    """The differences of two periodic motions."""
    allowed = EQUAL + 10.0 * plain.error
    said = []
    if abs(found["period"] - plain.period) > allowed * plain.period:
        said.append(f"period {found['period']:.9g} and {plain.period:.9g}")
    if drawn.period is not None and found["multiple"] != plain.multiple:
        said.append(f"multiple {found['multiple']} and {plain.multiple}")
    size = max(plain.amplitude.values())
    for name, value in plain.amplitude.items():
        if (
            name in found["amplitude"]
            and abs(found["amplitude"][name] - value) > allowed * value + 1e-9 * size
        ):
            said.append(f"amplitude of {name} {found['amplitude'][name]:.9g} and {value:.9g}")
    for name, value in plain.stick.items():
        if name in found["stick"] and abs(found["stick"][name] - value) > 1e-4 + 100.0 * allowed:
            said.append(f"stick of {name} {found['stick'][name]:.6f} and {value:.6f}")
    if plain.matrix is not None and "multipliers" in found and plain.kind == "periodic":
        said += multipliers_differ(np.array(plain.matrix), found, drawn.period is None)
    return said


def multipliers_differ(matrix: np.ndarray, found: dict[str, Any], is_free: bool) -> list[str]:
    """The difference of the multipliers, by the coefficients of the characteristic polynomial."""
    theirs = [complex(*pair) for pair in found["multipliers"]] + ([1.0] if is_free else [])
    ours = np.linalg.eigvals(matrix)
    singular = np.linalg.svd(matrix, compute_uv=False)
    allowed = EQUAL_MULTIPLIERS * float(np.prod(1.0 + singular))
    if len(theirs) == len(ours) and np.abs(np.poly(theirs) - np.poly(ours)).max() <= allowed:
        return []
    return [f"multipliers {np.round(theirs, 5).tolist()} and {np.round(ours, 5).tolist()}"]


# -- one point ---------------------------------------------------------------------------------------------------


def measured(number: int, seed: int) -> dict[str, Any]:
    """The record of a point."""
    drawn = point(number, seed)
    began = time.perf_counter()
    found = searched(drawn)
    between = time.perf_counter()
    plain = brute.followed(drawn)
    record: dict[str, Any] = {"number": number, "seed": seed, "kind": drawn.kind}
    verdict, differences = judge(drawn, plain, found)
    record |= {"verdict": verdict, "differences": differences, "found": found, "plain": vars(plain)}
    record["seconds"] = [between - began, time.perf_counter() - between]
    if verdict == "agrees" and drawn.swept and between - began < 10.0 and found["kind"] == "periodic":
        record["swept"] = swept(drawn)
        name = states_of(drawn)[0]
        for what, value in record["swept"].items():
            # a NaN differs
            if not abs(value - plain.amplitude[name]) <= (EQUAL + 10.0 * plain.error) * plain.amplitude[name]:
                record["differences"].append(f"{what}: {value:.9g} and {plain.amplitude[name]:.9g}")
                record["verdict"] = "differs"
    if drawn.friction is not None and found["kind"] == "periodic" and number % 3 == 0:
        record["scipy"] = without_hybridsim(drawn, found)
        if record["scipy"]["error"] > 0.0:
            record["differences"].append(f"SciPy: {record['scipy']}")
            record["verdict"] = "differs"
    return record


def without_hybridsim(drawn: Point, found: dict[str, Any]) -> dict[str, float]:
    """The same motion by SciPy alone: its distance from repeating, and the amplitude; error: beyond what is allowed."""
    assert drawn.friction is not None
    start = next(iter(drawn.plain.start_values().values()))
    strobes, amplitude, stuck = brute.by_scipy(drawn.friction, start, SCIPY_PERIODS)
    m = found["multiple"]
    repeats = float(np.abs(strobes[-m:] - strobes[-2 * m : -m]).max() / np.abs(strobes[-24:]).max())
    off = abs(amplitude / found["amplitude"]["x"] - 1.0)
    # samples miss an extreme value by a few 1e-6; a motion that is on its way differs by as much as it may still change
    allowed = 1e-5 + 1e3 * repeats
    error = max(off - allowed, 0.0) + max(abs(stuck - found["stick"]["f"]) - 1e-3 - 1e3 * repeats, 0.0)
    return {"repeats": repeats, "off": off, "stick": stuck, "error": error}


def study(count: int, seed: int, journal: Path) -> list[dict[str, Any]]:
    """The records of all points."""
    done = {}
    if journal.exists():
        records = [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()]
        done = {record["number"]: record for record in records if record["seed"] == seed}
    for number in range(count):
        if number in done:
            continue
        done[number] = record = measured(number, seed)
        with journal.open("a", encoding="utf-8") as out:
            out.write(json.dumps(record) + "\n")
        seconds = " + ".join(f"{s:.1f}" for s in record["seconds"])
        print(
            f"{number} {record['kind']}: {record['verdict']}, {record['found']['kind']} and {record['plain']['kind']}"
            f" {'; '.join(record['differences'])} ({seconds} s)",
            flush=True,
        )
    return [done[number] for number in range(count)]


# -- the page ----------------------------------------------------------------------------------------------------

HEAD = """# Steady states against plain runs

Does `hs.steady_state` find the motion that a long run reaches? At {agree} of {all} random points `hs.steady_state`
agrees with a plain run. At {irregular} further points both methods find a motion that does not repeat. {slow} points
had not settled at the end of the plain run. At {refused} points both methods find no steady state. The results
differ at {differ} of the points.

`python docs/studies/steady_states.py` draws the numbers of {kinds} kinds of models at random. For each point the
script compares two results. One result is that of `hs.steady_state` with at most {most} periods. The other result is
that of plain runs (`docs/studies/steady_brute.py`), which use `hs.simulate` and nothing of `hybridsim.analysis`. The
plain runs use `dop853` with the tolerance {rtol:g}.

- A plain run has {short}, then {middle}, then {long} periods of the forcing, and ends earlier if the motion repeats.
  The states at one phase of each period are compared. The period of the motion is the shortest time after which no
  state changes by more than {repeats:g} of its range. This period is at most {longest} periods of the forcing.
  Without forcing, the states at upward passages of a level are compared.
- The amplitudes are computed from {samples} samples per period, with a search between the samples.
- The multipliers of a plain run are computed by differences. For these differences, each state at the beginning of
  the period is changed by {step:g} of its range, upward and downward. If the two changes give different results, the
  motion has no multipliers.
- If a motion does not repeat, its state is changed by {perturbed:g}. This change is followed over {followed}
  periods. The motion is chaotic if the change grows by more than a factor of {grown:g}.

The amplitudes and periods agree if their relative difference is at most {equal:g}. The multipliers are compared by
the coefficients of their characteristic polynomials. These coefficients may differ by at most {equal_multipliers:g}
times the product of 1 + s, over the singular values s of the matrix. The fractions of time in stick are compared
too. At
{swept} points with a periodic motion `hs.sweep` returned the amplitude of the plain run. At {responses} points
`hs.frequency_response` returned this amplitude too. At {scipy} points a program that uses only SciPy (`solve_ivp`
with events) found the same amplitude and the same fraction of stick. A mechanical system is compared with its
ordinary model. The multipliers of
{multipliers} points are compared.

| kind of model | points | agree | do not repeat | had not settled | no steady state | differ |
| --- | --- | --- | --- | --- | --- | --- |
"""
KINDS_OF_MOTION = """
The table counts the motions by their kinds.

| by `hs.steady_state` | by plain runs | points |
| --- | --- | --- |
"""


def page(done: list[dict[str, Any]]) -> str:
    """The page of the results, without the text that is written by hand."""
    counts = Counter(record["verdict"] for record in done)
    kinds = list(dict.fromkeys(record["kind"] for record in done))
    out = HEAD.format(
        all=len(done), agree=counts["agrees"], irregular=counts["irregular"], slow=counts["slow"],
        refused=counts["refused"], differ=counts["differs"], kinds=len(kinds), most=MOST, rtol=brute.RTOL,
        short=brute.PERIODS[0], middle=brute.PERIODS[1], long=brute.PERIODS[2], longest=brute.LONGEST,
        repeats=brute.REPEATS, samples=brute.SAMPLES, step=brute.STEP, perturbed=brute.PERTURBED,
        followed=brute.FOLLOWED, grown=brute.GROWN, equal=EQUAL, equal_multipliers=EQUAL_MULTIPLIERS,
        swept=sum("swept" in record for record in done),
        responses=sum("frequency_response" in record.get("swept", {}) for record in done),
        scipy=sum("scipy" in record for record in done),
        multipliers=sum(
            record["plain"]["matrix"] is not None and "multipliers" in record["found"] for record in done
        ),
    )  # fmt: skip
    for kind in kinds:
        of = Counter(record["verdict"] for record in done if record["kind"] == kind)
        cells = [of[verdict] for verdict in ("agrees", "irregular", "slow", "refused", "differs")]
        out += f"| {kind} | {sum(cells)} | " + " | ".join(map(str, cells)) + " |\n"
    out += KINDS_OF_MOTION
    pairs = Counter((record["found"]["kind"], record["plain"]["kind"]) for record in done)
    out += "".join(f"| {ours} | {theirs} | {n} |\n" for (ours, theirs), n in pairs.most_common())
    minutes = sum(sum(record["seconds"]) for record in done) / 60.0
    return out + (
        "\nRun `python docs/studies/steady_states.py [points] [seed] [journal]` to repeat the study. The "
        f"study takes about {minutes:.0f} minutes on one core.\n"
    )


def main() -> None:
    """Run the study, print its table, and write the page."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    journal = Path(sys.argv[3]) if len(sys.argv) > 3 else Path("steady-states.journal")
    warnings.simplefilter("ignore", RuntimeWarning)  # a motion may grow without bound
    done = study(count, seed, journal)
    text = page(done)
    print(text)
    if seed == 1:
        old = PAGE.read_text(encoding="utf-8") if PAGE.exists() else BY_HAND
        PAGE.write_text(text + "\n" + old[old.index(BY_HAND) :], encoding="utf-8")


if __name__ == "__main__":
    main()
