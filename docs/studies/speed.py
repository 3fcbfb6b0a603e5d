"""How fast hybridsim is: its integrators, what else there is, and the closed form written by hand, side by side.

    python docs/studies/speed.py [--scenes P1,belt] [--methods exact,heyoka] [--turns 15] [--out DIR]

One run, one process; calls of all methods of a scene take turns. All give the same: once the events and the states at
them, once the states at 2000 times besides. Writes docs/studies/speed.md and its pictures (or DIR). Needs what the
tests need (pip install '.[test]'); rivals that are installed take part: pip install heyoka diffrax jax casadi pathsim.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from rivals.chart import charts
from rivals.every import methods
from rivals.page import page
from rivals.race import race
from rivals.scenes import NAMES, scene
from rivals.truth import truth

ROOT = Path(__file__).parents[2]


def main() -> None:
    """Run the study."""
    options = _options()
    os.chdir(tempfile.mkdtemp())  # a C compiler leaves files where it is called
    every, lacking = methods()
    if options.methods:
        wanted = options.methods.split(",")
        names = [method.name for method in every]
        every = [method for method in every if any(method.name.startswith(name) for name in wanted)]
        if not every:
            raise SystemExit(f"no method begins with {options.methods!r}; there are {', '.join(names)}")
    if lacking:
        print("not installed, left out:", ", ".join(lacking), f"(pip install {' '.join(lacking)})")
    began = time.perf_counter()
    scenes, truths, found = {}, {}, {}
    for name in options.scenes.split(","):
        here = scene(name)
        exact = truth(here, options.truth)
        print(
            f"{name}: {len(exact.t)} events, {exact.title} ({time.perf_counter() - began:.0f} s)", flush=True
        )
        lines = race(here, exact, every, options.turns, lambda text: print(text, flush=True))
        scenes[name], truths[name], found[name] = here, exact, lines
    text = (Path(__file__).parent / "rivals" / "page_text.txt").read_text()
    written = page(scenes, truths, found, lacking, text)
    (options.out / "studies").mkdir(parents=True, exist_ok=True)
    (options.out / "images").mkdir(exist_ok=True)
    (options.out / "studies" / "speed.md").write_text(written)
    charts(scenes, found, options.out / "images")
    print(f"done in {time.perf_counter() - began:.0f} s")


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", default=",".join(NAMES), help="which scenes")
    parser.add_argument("--methods", default="", help="which methods, by the beginning of their names")
    parser.add_argument("--turns", type=int, default=15, help="turns of each method")
    parser.add_argument("--out", type=Path, default=ROOT / "docs", help="where studies/ and images/ are")
    parser.add_argument("--truth", type=Path, default=None, help="folder where exact motions are kept")
    options = parser.parse_args()
    unknown = [name for name in options.scenes.split(",") if name not in NAMES]
    if unknown:
        parser.error(f"there is no scene {unknown[0]!r}; there are {', '.join(NAMES)}")
    if (options.methods or options.scenes != ",".join(NAMES)) and options.out == ROOT / "docs":
        parser.error("a part of the study does not replace the page of the whole: give a folder with --out")
    options.out = options.out.resolve()
    options.truth = options.truth and options.truth.resolve()
    return options


if __name__ == "__main__":
    main()
