"""One run of hybridsim held against the judge, and what became of it."""

from __future__ import annotations

import random
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import hybridsim as hs

from .forms import Abstract
from .judge import Judge
from .render import Renderer
from .values import Motion

POINTS = 23
LIMITS = {"steps": 1_000_000, "events": 5000}
ALLOWED = 1e-5  # error of a run at rtol 1e-9, relative to the motion, beyond which it is called different


@dataclass
class Verdict:
    """agrees, differs, refused, unclear, stopped, model or crash; with what was seen."""

    kind: str
    integrator: str
    status: str = ""
    detail: str = ""
    until: float = 0.0
    off: float = 1.0


Truth = tuple[Motion, list[float], float]


def judged(model: Abstract, numbers: dict[str, Fraction], maths: Any = None, nudge: float = 0.0) -> Truth:
    """The motion by the judge, times to compare at, and until when it is certain."""
    motion = Judge(model, numbers, maths, nudge).run()
    certain = motion.end
    for t, _ in motion.unclear + motion.touches:
        certain = min(certain, t)
    rng = random.Random(1)
    times = []
    for i in range(POINTS):
        t = motion.end * (i + rng.uniform(0.2, 0.8)) / POINTS
        if t < certain - 1e-3 and all(abs(t - j) > 1e-4 for j in motion.jumps):
            times.append(t)
    return motion, times, certain


def parted(model: Abstract, one: Truth, other: Truth) -> float:
    """The first time at which two motions of the judge differ."""
    names = list(model.states)
    for t in one[1]:
        if t >= other[0].end:
            return t
        a, b = one[0].at(t, names), other[0].at(t, names)
        if any(abs(a[k] - b[k]) > ALLOWED * 0.1 * max(1, abs(a[k])) for k in a):
            return t
    return one[0].end


def shortened(truth: Truth, end: float) -> Truth:
    """The same motion, taken for certain until an earlier time."""
    motion, times, certain = truth
    return motion, [t for t in times if t < end], min(certain, end)


def hold(
    model: Abstract,
    compiled: hs.Model,
    renderer: Renderer,
    integrator: str,
    truth: Truth,
    way: str = "plain",
) -> Verdict:
    """Run the rendered model and compare it with the judge's motion."""
    shift = float(renderer.style.shift)
    try:
        end = shift + model.duration * (0.5 if way == "resumed" else 1)
        sol = hs.simulate(
            compiled,
            (shift, end),
            integrator=integrator,
            limits=LIMITS,
        )
        if way == "resumed" and sol.status == "finished":
            sol = sol.resume(shift + model.duration)
    except hs.ModelError as error:
        return Verdict("model", integrator, type(error).__name__, str(error)[:300])
    except hs.UsageError as error:
        return Verdict("cannot", integrator, type(error).__name__, str(error)[:300])
    except hs.HybridsimError as error:
        return Verdict("refused", integrator, type(error).__name__, str(error)[:300])
    except Exception as error:
        return Verdict("crash", integrator, type(error).__name__, repr(error)[:300])
    v = compared(model, renderer, sol, truth, integrator)
    if v.kind == "differs" and any("is not treated as a switching surface" in text for text in sol.warnings):
        v.kind = "warned of"  # the run says that it is not to be trusted
    return v


def compared(model: Abstract, renderer: Renderer, sol: Any, truth: Truth, integrator: str) -> Verdict:
    """What a solution is worth beside the judge's motion."""
    motion, times, certain = truth
    shift = float(renderer.style.shift)
    reached = sol.t_end - shift
    seen = [t for t in times if t < reached - 1e-3]
    worst: tuple[float, str] = (0.0, "")
    names = list(model.states)
    size: dict[str, float] = {}
    for t in times:
        for k, v in motion.at(t, names).items():
            size[k] = max(size.get(k, 1.0), abs(v))
    right = [motion.at(t, names) for t in seen]
    found = values_of(sol, renderer, [*names, *model.discrete], [t + shift for t in seen])
    for i, t in enumerate(seen):
        for k, v in right[i].items():
            ours = float(found[k][i])
            off = abs(ours - v) / size[k]
            if not off <= ALLOWED:
                detail = f"{k}({t:.6g}) right {v:.10g} got {ours:.10g}"
                return Verdict("differs", integrator, sol.status, detail, certain, off)
            worst = max(worst, (off, k))
    for w in model.monitors:
        true_times = [t for t, owner, _ in motion.events if owner == w and t < certain - 1e-3]
        our_times = [t - shift for t in sol.event_times(renderer.called(w))]
        our_times = [t for t in our_times if t < certain - 1e-3]
        late = [t for t in true_times if t < reached - 1e-3]
        if len(late) > len(our_times) or len(our_times) > len(true_times):
            return Verdict(
                "differs", integrator, sol.status, f"monitor {w} right {true_times} got {our_times}", certain
            )
    if reached < certain - 1e-3:
        kind = "refused" if sol.status in ("nonunique", "inconsistent") else "stopped"
        return Verdict(
            kind, integrator, sol.status, f"at {reached:.6g} of {certain:.6g}: {sol.message[:300]}", certain
        )
    if motion.status in ("terminated",) and certain == motion.end and abs(reached - motion.end) > 1e-4:
        return Verdict(
            "differs", integrator, sol.status, f"ends at {motion.end} right, {reached} got", certain
        )
    if motion.status == "nonunique" and certain == motion.end and sol.status == "finished":
        return Verdict("chose", integrator, sol.status, f"at {motion.end:.6g}: {motion.message}", certain)
    if motion.status == "inconsistent" and certain == motion.end and sol.status == "finished":
        return Verdict("went on", integrator, sol.status, f"at {motion.end:.6g}: {motion.message}", certain)
    for event in sol.events:
        near = event.t - shift
        if event.kind != "near-grazing" or near > certain - 1e-3:
            continue
        if not any(abs(t - near) < 1e-3 for t in [*motion.near, *(t for t, _ in motion.touches)]):
            what = f"near-grazing of {event.component} at {near:.6g}, where nothing touches zero"
            return Verdict("differs", integrator, sol.status, what, certain)
    return Verdict("agrees", integrator, sol.status, f"{worst[0]:.1e}", certain, worst[0])


def values_of(sol: Any, renderer: Renderer, names: list[str], times: list[float]) -> dict[str, Any]:
    """States and discrete states of a run, in the scale of the abstract model."""
    states = dict(zip(sol.names, sol(times), strict=True)) if times else {}
    out = {}
    for name in names if times else []:
        called = renderer.called(name)
        values = states[called] if called in states else sol.output(called, times)
        out[name] = values * float(renderer.style.scales.get(name, 1))
    return out
