"""Every scene with every registered integrator."""

from __future__ import annotations

from typing import Any

import pytest

import hybridsim as hs
from conformance.native import mechanism
from hybridsim.errors import HybridsimError
from hybridsim.testing import measuring
from hybridsim.testing.catalogue import SCENES
from hybridsim.testing.scene import VOCABULARY, Scene
from hybridsim.testing.study import integrator
from hybridsim.testing.suite import outcome

INTEGRATORS = [one.name for one in hs.list_integrators()]
# What a model visibly needs: a run is refused for it. The others show only in how a run goes.
REFUSED = {"contacts", "transitions", "monitors", "scheduled", "backward", "corners", "nonlinear"}


# These step from Python, and those of a library share all that hybridsim adds to them: each scene has its turn with one
# method of SUNDIALS and one of SciPy. The rest takes some minutes and is run as slow tests. What is compiled runs every
# scene.
NATIVE = [name for name in INTEGRATORS if name.startswith("scipy-")]
QUICK = "scipy-dop853"
TURNS = [name for name in NATIVE if name != QUICK]
MULTISTEP = [name for name in INTEGRATORS if name.startswith("cvode-")]
MANY_PERIODS = 60  # units of time; the events repeat, and each of the other methods takes ten seconds or more


def has_its_turn(name: str, number: int) -> bool:
    """Whether the scene of that number is for this method.

    `QUICK` has every second scene and those of many periods. The other methods of the libraries have the rest.
    """
    if name in (*NATIVE, *MULTISTEP) and MANY_PERIODS < length(SCENES[number]) < ENDLESS:
        return name == QUICK
    if name in MULTISTEP:
        return number // 2 % len(MULTISTEP) == MULTISTEP.index(name)
    if name in TURNS:
        return (number + 2 * TURNS.index(name)) % (2 * len(TURNS)) == 0
    return name != QUICK or number % 2 == 1


LONGEST = 400  # units of time
ENDLESS = 1e6  # units of time; an event ends a run with a longer horizon


def length(scene: Scene) -> float:
    """Return the length of a scene in units of time."""
    return abs(scene.span[1] - scene.span[0]) / scene.unit


def is_long(scene: Scene) -> bool:
    """Whether a scene is for compiled methods alone."""
    return LONGEST < length(scene) < ENDLESS


def runs() -> list[Any]:
    """Every scene with every integrator."""
    found = []
    for number, scene in enumerate(SCENES):
        for name in INTEGRATORS:
            if is_long(scene) and not integrator(name).has_compiled_loop:
                continue  # it steps from Python: hours
            marks = [] if has_its_turn(name, number) else [pytest.mark.slow]
            found.append(pytest.param(scene, name, id=f"{scene.name}-{name}", marks=marks))
    return found


@pytest.mark.parametrize(("scene", "name"), runs())
def test_scene(scene: Scene, name: str) -> None:
    """Right, or lacking a capability that the integrator declares."""
    result = outcome(name, scene)
    assert result.verdict in ("right", "lacks"), "\n".join(result.reasons)
    if result.verdict == "lacks":
        missing = sorted(scene.needs & set(integrator(name).lacks) & REFUSED)
        if missing:
            reasons = integrator(name).lacks
            with pytest.raises(HybridsimError) as refusal:
                measuring.run(scene, name)
            assert any(reasons[capability] in str(refusal.value) for capability in missing)


def native_runs() -> list[Any]:
    """Every scene with SciPy's own event finding; `QUICK` where it has no turn above, or is known to be wrong."""
    found = []
    for number, scene in enumerate(SCENES):
        for name in NATIVE if not is_long(scene) else ():
            is_run = name == QUICK and (not has_its_turn(name, number) or mechanism(name, scene.name))
            marks = [] if is_run else [pytest.mark.slow]
            found.append(pytest.param(scene, name, id=f"{scene.name}-{name}", marks=marks))
    return found


@pytest.mark.parametrize(("scene", "name"), native_runs())
def test_events_found_by_scipy(scene: Scene, name: str) -> None:
    """Right, or wrong for a reason that is known; what is called wrong is."""
    result = outcome(name, scene, events="native")
    assert result.failed == bool(mechanism(name, scene.name)), "\n".join(result.reasons)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_what_is_lacking_has_a_name_and_a_reason(name: str) -> None:
    for capability, reason in integrator(name).lacks.items():
        assert capability in VOCABULARY
        assert len(reason.split()) > 3
