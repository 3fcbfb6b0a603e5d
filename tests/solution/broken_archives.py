"""Uses saved solutions in which something was changed at random and that were sealed anew; prints what went wrong.

It runs in a process of its own, which a kernel that is misled would bring down.
"""

from __future__ import annotations

import io
import json
import random
import sys
import traceback
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import hybridsim as hs
from hybridsim.solution.files import archive

Header, Arrays = dict[str, Any], dict[str, np.ndarray]
WHOLE = (-1, -2, 0, 1, 2, 3, 5, 1000, 10**6, 2**31, 2**62, -(2**62))
REAL = (np.nan, np.inf, -np.inf, 1e308, -1.0, 0.0, 1e18, -5.5, 3.0)
ENTRIES = (
    None, -1, 0, 1, 1e308, float("nan"), float("inf"), "x", [], {}, [1], [[1]], True, 10**30, -1.0, 10**6,
)  # fmt: skip


def parts(path: Path) -> tuple[Header, Arrays]:
    """The header and the arrays of a file."""
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    text = bytes(arrays.pop("header")).decode()
    del arrays["digest"]
    return json.loads(text), arrays


def sealed(header: Header, arrays: Arrays) -> bytes:
    """A file of these, with a digest that is right."""
    text, file = json.dumps(header), io.BytesIO()
    seal = np.frombuffer(archive._digest(text, arrays).encode(), dtype=np.uint8)
    np.savez(file, **arrays, header=np.frombuffer(text.encode(), dtype=np.uint8), digest=seal)
    return file.getvalue()


def changed(draw: random.Random, header: Header, arrays: Arrays) -> tuple[str, Header, Arrays]:
    """One entry changed, or the shape, type or presence of one array; and what it was."""
    arrays, header = dict(arrays), json.loads(json.dumps(header))
    kind = draw.randrange(6)
    if kind <= 2:
        name = draw.choice([n for n, a in arrays.items() if a.size and a.dtype.kind in "ifbc"])
        array = np.atleast_1d(arrays[name].copy())
        place = draw.randrange(array.size)
        choices: dict[str, tuple[Any, ...]] = {"i": WHOLE, "b": (not array.flat[place],)}
        array.flat[place] = draw.choice(choices.get(array.dtype.kind, REAL))
        arrays[name] = array.reshape(arrays[name].shape)
        return f"{name}[{place}] = {array.flat[place]}", header, arrays
    name = draw.choice(list(arrays))
    if kind == 3:
        array = arrays[name]
        forms = [np.stack([array, array]), array.reshape(-1), array.astype("<U20")]
        if array.ndim:
            forms += [array[:-1], array[:0], np.concatenate([array, array])]
        if array.dtype.kind in "if":
            forms.append(array.astype(np.float32))
        arrays[name] = draw.choice(forms)
        return f"{name} of shape {arrays[name].shape} and type {arrays[name].dtype}", header, arrays
    if kind == 4:
        del arrays[name]
        return f"{name} is missing", header, arrays
    path = draw.choice([p for p in entries(header) if p[0] not in ("model", "arrays", "format", "version")])
    inner: Any = header
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = draw.choice(ENTRIES)
    return f"header {path} = {inner[path[-1]]!r}", header, arrays


def entries(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of all entries of a header."""
    if isinstance(value, dict | list):
        for key, one in value.items() if isinstance(value, dict) else enumerate(value):
            yield (*path, key)
            yield from entries(one, (*path, key))


def use(sol: hs.Solution) -> None:
    """Ask a solution for all that it holds, and go on with it."""
    t = sol.t
    for ask in (lambda: sol.y, lambda: sol.events, lambda: sol.modes, lambda: sol.stats, sol._repr_html_):
        ask()
    if len(t):
        sol(np.linspace(min(t[0], t[-1]), max(t[0], t[-1]), 50))
        sol(t, side="-")
    sol.table(20)
    if sol.events:
        sol.explain(0)
    if sol.status in ("finished", "limit"):
        further = sol.t_end + 1e-3 * abs(sol.t_end - sol.t_start) + 1e-6
        more = sol.resume(further if sol.status == "finished" else None, limits={"steps": 20_000})
        assert more.events is not None and more.modes is not None and len(more.t) >= 0


def trial(path: Path, number: int) -> str:
    """What went wrong with one change; empty where it was refused by name, or made no difference."""
    what, header, arrays = changed(random.Random(f"{path.name} {number}"), *parts(path))
    print(f"# {path.name} {number}: {what}", flush=True)  # the last line, if the process comes down
    try:
        use(archive.of_bytes(sealed(header, arrays)))
    except hs.HybridsimError:
        pass
    except Exception:
        return f"{path.name} {number}: {what}\n{traceback.format_exc()[-1500:]}"
    return ""


if __name__ == "__main__":
    warnings.simplefilter("ignore")  # of NumPy, for numbers that are none
    for name in sys.argv[2:]:
        use(hs.load_solution(name))
        for number in range(int(sys.argv[1])):
            if found := trial(Path(name), number):
                print(f"FAULT {found}", flush=True)
    print("done")
