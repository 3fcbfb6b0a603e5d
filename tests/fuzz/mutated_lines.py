"""Command lines with something wrong with them, over all commands."""

from __future__ import annotations

import random

from fuzz.nasty import CODE, HARD, NUMBERS, PLACES, UNICODE, long_expression, misspelt

RUN = "--t-end 0.01 --limit seconds=1 --limit steps=2000"
LINES = [
    line.split()
    for line in (
        f"run dfcs {RUN} -p F0=22 -p omega=0.64*sqrt(k/m)",
        f"run dfcs {RUN} --json --explain 0 --explain -1",
        f"run belt {RUN} --csv out.csv --points 9",
        f"run case.toml {RUN} --npz out.npz --save out.hsol",
        f"run bouncing-ball {RUN} --rtol 1e-6 --atol 1e-9 --x0 h=2 --max-step 0.1",
        f"run dfcs {RUN} --integrator rk4-dichotomy --option steps_per_period=600 --option stick_velocity=zero",
        f"run thermostat {RUN} --integrator dop853 --option order=3",
        "run dfcs --t-end 2T --limit events=3",
        "resume kept.hsol --t-end 0.02 --limit seconds=1 --csv out.csv",
        "resume kept.hsol --save out.hsol --json",
        "check dfcs --json",
        "check case.toml",
        "check clutches",
        "models",
        "models --laws --json",
        "integrators",
        "integrators taylor --json",
        "integrators rk4-dichotomy",
        "cache path",
        "cache path",
        "compare dfcs --t-end 0.005 --integrators dop853,tsit5 --rtol 1e-4,1e-6 --repeat 1 --budget 1 --out found",
        "compare dfcs --t-end 0.005 --regularized tanh --v0 1e-2 --budget 1 --repeat 1 --out found",
        "compare --suite --scenes P1 --budget 1 --repeat 1 --out found --integrators exact",
        "sweep dfcs F0=20:22:3 --measure final.x --t-end 0.005 --out found --workers 1",
        "sweep dfcs F0=20,21 omega=300:400:2:log --measure final --t-end 0.005 --over omega --out found --json",
        "sweep dfcs F0=20,30 omega=300,400 --list --measure final.v --t-end 0.005 --out found --warm-start",
        "sweep belt x=0,1 --measure final.x --t-end 0.5 --out found --rtol 1e-6 --integrator tsit5",
        "steady dfcs --tol 1e-6 --max-periods 8 --harmonics 3 --json",
        "steady bouncing-ball --max-periods 4",
        "advise dfcs --quantity final.x --tol 0.1 --t-end 0.005 --budget 1 --no-integrators --json",
        "advise dfcs --quantity amplitude.x --over F0=20,30 --budget 1 --rungs viscous --no-integrators",
        "study he2026 --quick --out found --json",
        "atlas --class events --quick --workers 1 --integrators exact --out found",
        "atlas FMI-ball --integrators dop853 --workers 1 --out found --json",
        "--version",
        "--help",
        "run --help",
        "sweep --help",
    )
]
# options that name where something is written
PATHS = (
    "--csv",
    "--npz",
    "--save",
    "--out",
    "--plot",
    "--images",
)
WORDS = sorted({word for line in LINES for word in line} | {"--plot", "--images", "--uncertain", "-h", "--"})


def mutated(pick: random.Random) -> list[str]:
    """One line after one to four changes."""
    line = list(pick.choice(LINES))
    for _ in range(pick.choice((1, 1, 2, 2, 3, 4))):
        line = changed(pick, line)
    # what nobody fuzzes: it deletes, or compiles anew, what all other cases stand on
    return [word for word in line if word not in ("clear", "warm")]


def changed(pick: random.Random, line: list[str]) -> list[str]:
    """One change."""
    k = pick.randrange(len(line)) if line else 0
    before, here, after = line[:k], line[k : k + 1], line[k + 1 :]
    word = here[0] if here else ""
    kind = pick.randrange(14)
    if kind == 0:
        return before + after
    if kind == 1:
        return before + here + here + after
    if kind == 2:
        return before + [misspelt(pick, word)] + after
    if kind == 3:
        return before + [pick.choice(WORDS)] + here + after
    if kind == 4:
        return before + [pick.choice(WORDS)] + after
    if kind == 5:
        shuffled = list(line)
        pick.shuffle(shuffled)
        return shuffled
    if kind == 6 and after:
        return before + [f"{word}={after[0]}"] + after[1:]
    if kind == 7:
        return before + here + [pick.choice(PATHS), pick.choice(PLACES)] + after
    if kind == 8:
        return before + here + [pick.choice(UNICODE)] + after
    return before + [value_changed(pick, word)] + after


def value_changed(pick: random.Random, word: str) -> str:
    """The value of a word, or a part of it, by another kind of value."""
    head, equals, tail = word.partition("=")
    parts = tail.split(":") if equals else []
    new = pick.choice(
        (
            pick.choice(NUMBERS),
            pick.choice(NUMBERS),
            pick.choice(HARD),
            pick.choice(CODE),
            pick.choice(PLACES),
            long_expression(pick, "F0") if pick.random() < 0.3 else "F0*2",
            "",
            "a,,b",
            "1:2:3:4:5",
        )
    )
    if len(parts) > 1 and pick.random() < 0.6:
        parts[pick.randrange(len(parts))] = new
        return f"{head}={':'.join(parts)}"
    return f"{head}={new}" if equals else new
