"""Events and states of all packaged models by all integrators, in hexadecimal, to a file: two versions are held
against each other bit for bit.

    python docs/make/same_bits.py FILE              write FILE
    python docs/make/same_bits.py FILE OTHER        say where two files differ
"""

from __future__ import annotations

import hashlib
import json
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

import hybridsim as hs

LIMITS = {"steps": 60000, "events": 20000}  # a run without an end is compared with another up to here


def bits(values: Any) -> str:
    """Digest of an array's bytes."""
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()[:16]


def of_model(name: str) -> dict[str, Any]:
    """What each integrator makes of one model."""
    found: dict[str, Any] = {}
    model = hs.load(name)
    end = model.duration_value() or 1.0
    for integrator in hs.list_integrators():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                sol = hs.simulate(model, (0.0, end), integrator=integrator.name, limits=LIMITS)
            except hs.HybridsimError as refusal:
                found[integrator.name] = str(refusal)
                continue
        inside = np.linspace(sol.t_start, sol.t_end, 501)
        events = [[float(event.t).hex(), repr(event)] for event in sol.events]
        found[integrator.name] = {
            "status": [sol.status, sol.message, *sol.warnings],
            "events": events,
            "steps": [len(sol.t), bits(sol.t), bits(sol.y)],
            "between": bits(sol(inside)),
        }
    return found


def main() -> None:
    """Write a file, or compare two."""
    if len(sys.argv) == 3:
        one, other = (json.loads(Path(path).read_text()) for path in sys.argv[1:])
        runs = sorted({(name, way) for whole in (one, other) for name in whole for way in whole[name]})
        differ = [
            pair for pair in runs if one.get(pair[0], {}).get(pair[1]) != other.get(pair[0], {}).get(pair[1])
        ]
        refused = sum(isinstance(one[name].get(way), str) for name, way in runs)
        counted = sum(
            len(one[name][way]["events"]) for name, way in runs if not isinstance(one[name].get(way), str)
        )
        print(f"{len(runs)} runs ({refused} refused), {counted} events; {len(differ)} differ")
        print(*(f"  {name} by {way}" for name, way in differ), sep="\n")
        raise SystemExit(bool(differ))
    names = [model.name for model in hs.list_models()]
    with ProcessPoolExecutor(2) as pool:
        whole = dict(zip(names, pool.map(of_model, names)))
    Path(sys.argv[1]).write_text(json.dumps(whole, indent=1))


if __name__ == "__main__":
    main()
