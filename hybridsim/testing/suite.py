"""Holds an integrator against the scenes: `conformance_failures(integrator)` returns what it got wrong.

A scene is judged as its facts ask. Events are counted and their modes compared at every setting. The largest
errors of event times and of states fall with the tolerance, tenfold or more for each step of a thousand, where
an error below the tolerance asked for counts as that tolerance; at the end of the study they are within the
scene's own tolerance. A fixed-step method is judged in the same way over steps of its own.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from hybridsim.integrators.base import Integrator
from hybridsim.integrators.registry import registered
from hybridsim.testing.catalogue import SCENES
from hybridsim.testing.scene import Scene
from hybridsim.testing.study import (
    allowed_errors,
    carry_out,
    integrator,
    lacking,
    settings_for,
)


@dataclass(frozen=True)
class Outcome:
    """Verdict on one integrator in one scene: right, wrong (with reasons) or lacks (with the reason).

    Parameters
    ----------
    errors : setting, error of event times, error of states, for every setting that ran.
    """

    integrator: str
    scene: str
    verdict: str
    reasons: tuple[str, ...] = ()
    errors: tuple[tuple[str, float, float], ...] = ()


def outcome(method: str | type[Integrator], scene: Scene, **options: Any) -> Outcome:
    """Run one scene with one integrator (and its options) at all settings and judge it.

    Parameters
    ----------
    method : the name of a registered integrator, or an `Integrator` class of your own, registered or not.
    """
    with registered(method) as name:
        one = integrator(name)
        lacks = lacking(one)
        for capability in sorted(scene.needs | ({"located"} if "contacts" in scene.needs else set())):
            if capability in lacks:
                return Outcome(name, scene.name, "lacks", (f"{capability}: {lacks[capability]}",))
        study = carry_out(name, scene, settings_for(one, scene), allowed_errors(one, scene), lacks, **options)
    faults = study.faults()
    return Outcome(name, scene.name, "wrong" if faults else "right", tuple(faults), study.errors())


def conformance_failures(method: str | type[Integrator], scenes: Iterable[Scene] = SCENES) -> list[str]:
    """What an integrator got wrong, one sentence each; empty if nothing. What it lacks is no failure."""
    outcomes = [outcome(method, scene) for scene in scenes]
    return [f"{one.scene}: {reason}" for one in outcomes if one.verdict == "wrong" for reason in one.reasons]
