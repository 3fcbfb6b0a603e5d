"""Test an integrator in all test cases: `conformance_failures(integrator)` returns its errors.

A scene is judged as its facts ask. Events are counted and their modes compared at every setting. The largest
errors of event times and of states fall with the tolerance, tenfold or more for each step of a thousand, where
an error below the tolerance asked for counts as that tolerance; at the end of the study they are within the
scene's own tolerance. A fixed-step method is judged in the same way over steps of its own.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from hybridsim.integrators.contract import Integrator
from hybridsim.integrators.registry import registered
from hybridsim.testing.catalogue import SCENES
from hybridsim.testing.scene import Scene
from hybridsim.testing.study import allowed_errors, carry_out, integrator, lacking, settings_for
from hybridsim.testing.verdict import LACKS, RIGHT, WRONG_ANSWER, verdict


@dataclass(frozen=True)
class Outcome:
    """The result of running one test case with one integrator: the verdict, its reasons, and the errors of the runs.

    Parameters
    ----------
    verdict : "right", "wrong answer", "wrong mode sequence", "hang (bounded)" or "refused", as in the atlas; or
        "lacks", if the scene needs a capability that the integrator states to lack.
    reasons : errors as sentences, starting with the reason of the verdict; or the missing capability.
    errors : setting, error of event times and error of states of every completed setting.
    """

    integrator: str
    scene: str
    verdict: str
    reasons: tuple[str, ...] = ()
    errors: tuple[tuple[str, float, float], ...] = ()

    @property
    def failed(self) -> bool:
        """Whether the verdict is a failure: the run is wrong, and no capability is missing."""
        return self.verdict not in (RIGHT, LACKS)


def outcome(method: str | type[Integrator], scene: Scene, **options: Any) -> Outcome:
    """Run one test case with one integrator at all settings, and return the verdict with its reason.

    Parameters
    ----------
    method : the name of a registered integrator, or an `Integrator` class.
    """
    with registered(method) as name:
        one = integrator(name)
        lacks = lacking(one)
        for capability in sorted(scene.needs | ({"located"} if "contacts" in scene.needs else set())):
            if capability in lacks:
                return Outcome(name, scene.name, LACKS, (f"{capability}: {lacks[capability]}",))
        study = carry_out(name, scene, settings_for(one, scene), allowed_errors(one, scene), lacks, **options)
    faults = study.faults()
    found = verdict(study)[0] if faults else RIGHT
    if faults and found == RIGHT:
        found = WRONG_ANSWER  # the errors are small enough, but do not decrease
    return Outcome(name, scene.name, found, tuple(faults), study.errors())


def conformance_failures(method: str | type[Integrator], scenes: Iterable[Scene] = SCENES) -> list[str]:
    """Return the failures of an integrator as sentences; stated limitations are not failures."""
    outcomes = [outcome(method, scene) for scene in scenes]
    return [f"{one.scene}: {reason}" for one in outcomes if one.failed for reason in one.reasons]
