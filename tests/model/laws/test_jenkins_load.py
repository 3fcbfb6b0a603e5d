"""Jenkins elements under a load that varies: no false transition where slipping ends, whatever the integrator."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs

INTEGRATORS = ("taylor", "dop853", "tsit5", "scipy-dop853", "cvode-bdf")
MOTION = 'x = { start = 0, der = "v" }\nv = { start = 2, der = "-2.6*sin(1.3*t)" }\n'


def element(law: str) -> hs.Model:
    return hs.Model.from_toml(
        'schema = 1\nname = "scene"\n[states]\n' + MOTION + '[contacts.f]\nvelocity = "v"\n'
        f'normal = "1 + 0.6*sin(2.1*t)"\nlaw = {{ {law} }}\n'
    )


def mapped_force(stiffness: float, limit: float, end: float, steps: int = 400_000) -> float:
    """The force of one element by return mapping: stretch the spring, then cut at the limit."""
    t = np.linspace(0.0, end, steps + 1)
    x, limits = 2.0 / 1.3 * np.sin(1.3 * t), limit * (1.0 + 0.6 * np.sin(2.1 * t))
    force = 0.0
    for stretch, most in zip((stiffness * np.diff(x)).tolist(), limits[1:].tolist(), strict=True):
        force = min(max(force + stretch, -most), most)
    return force


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_jenkins_element_changes_its_mode_where_it_has_to(integrator: str) -> None:
    sol = hs.simulate(element('name = "jenkins", mu = 0.5, k = 20'), (0, 20), integrator=integrator)
    modes = [event.target for event in sol.events]
    assert sol.status == "finished" and not sol.warnings
    # the motion turns eight times: each turn sticks, and the element gives way on the other side then
    assert modes == ["slip+", "stick", "slip-", "stick"] * 4 + ["slip+"]
    assert sol.output("f", 20.0) == pytest.approx(mapped_force(20.0, 0.5, 20.0), abs=2e-4)


@pytest.mark.parametrize("integrator", INTEGRATORS[:3])
def test_elements_in_parallel_do_likewise(integrator: str) -> None:
    sol = hs.simulate(element('name = "iwan", n = 3, mu = 0.5, k = 20'), (0, 7), integrator=integrator)
    assert sol.status == "finished" and not sol.warnings
    total = sum(mapped_force(20.0 / 3, 0.5 * part / 9, 7.0, 100_000) for part in (1, 3, 5))
    assert sol.output("f", 7.0) == pytest.approx(total, abs=5e-4)
    for name in {event.component for event in sol.events}:
        targets = [event.target for event in sol.events if event.component == name]
        assert targets == (["slip+", "stick", "slip-", "stick"] * 4)[: len(targets)]
