"""What a declaration of a mechanical system refuses, and runs that end where they begin."""

from __future__ import annotations

import numpy as np
import pytest
from mechanics.stuck_systems import stuck_system

import hybridsim as hs


def contact(direction: object, **changes: object) -> hs.MechanicalContact:
    given: dict[str, object] = {"normal": 10, "law": "coulomb", "arguments": {"mu": 0.3}} | changes
    return hs.MechanicalContact("a", direction, **given)


def test_arguments_that_it_does_not_take_are_named() -> None:
    system = hs.MechanicalSystem([1.0], None, [1.0])
    with pytest.raises(hs.UsageError, match=r"simulate\(\) has no argument 'rtoll'") as caught:
        hs.simulate(system, (0, 1), rtoll=0)
    assert caught.match("did you mean 'rtol'")
    with pytest.raises(hs.UsageError, match="`step` is an option of moreau"):
        hs.simulate(system, (0, 1), step=0.1)
    with pytest.raises(hs.UsageError, match="does not support `params`"):
        hs.simulate(system, (0, 1), params={})


def test_a_direction_has_a_weight_for_each_coordinate() -> None:
    with pytest.raises(hs.UsageError, match="contact a: its direction has 2 weights for 3 coordinates"):
        hs.MechanicalSystem([1, 1, 1], None, [1, 1, 1], contacts=[contact([1, 0])])
    by_name = hs.MechanicalSystem([1, 1, 1], None, [1, 1, 1], contacts=[contact({0: 1.0})])
    assert by_name.with_(K=[2, 2, 2]).contacts == by_name.contacts


def test_a_forcing_has_an_entry_for_each_coordinate() -> None:
    with pytest.raises(hs.UsageError, match="`forcing` has 2 entries for 3 coordinates"):
        hs.MechanicalSystem([1, 1, 1], None, [1, 1, 1], forcing=[1, 2])


def test_a_run_that_cannot_begin_has_its_start() -> None:
    """Kinetic friction above static: neither stick nor slip is admissible."""
    weak = contact([1, 0], normal=45, law="static-kinetic", arguments={"mu_s": 0.3, "mu_k": 0.5})
    system = hs.MechanicalSystem([1, 1], None, [1, 1], forcing=[20, 0], contacts=[weak], q0=[0.0, 0.5])
    sol = hs.simulate(system, (0, 1))
    assert sol.status == "inconsistent"
    assert sol.t.tolist() == [0.0] * len(sol.t)
    assert np.array_equal(sol(0.0), [0.0, 0.5, 0.0, 0.0])


def test_a_limit_that_another_force_undoes() -> None:
    """Both contacts are at their limits when b breaks loose; its drop takes a off its limit (as in tied-limits)."""
    a = contact([1, 0], normal=20)
    b = hs.MechanicalContact("b", [-1, 1], 12, "static-kinetic", {"mu_s": 0.5, "mu_k": 0.35})
    forcing = [0, hs.Harmonic(omega=4, sin=15)]
    sol = hs.simulate(
        hs.MechanicalSystem([1, 2], None, [[60, -30], [-30, 60]], forcing=forcing, contacts=[a, b]), (0, 0.2)
    )
    assert [(e.component, e.target) for e in sol.events] == [("b", "slip+")]
    assert sol.events[0].t == pytest.approx(np.arcsin(0.4) / 4, rel=1e-12)


def test_whole_numbers_are_numbers() -> None:
    """q'' + 4 q = 2 sin(3 t) from rest, after a run of a system without harmonics: the kernels are the same."""
    hs.simulate(hs.MechanicalSystem([1.0], None, [4.0], forcing=[1.0]), (0, 1))
    sol = hs.simulate(hs.MechanicalSystem([1], None, [4], forcing=[hs.Harmonic(omega=3, sin=2)]), (0, 1))
    assert sol(1.0)[0] == pytest.approx(2 / (4 - 9) * (np.sin(3) - 1.5 * np.sin(2)), rel=1e-8)


def test_contacts_that_all_share_their_coordinates_need_the_arrays() -> None:
    """The ordinary model evaluates one state from each contact that sticks, one after the other: here there is none."""
    with pytest.raises(hs.ModelError, match="of f0, f1 depend on each other in a circle"):
        hs.simulate(stuck_system().to_model(), (0, 1))


@pytest.mark.parametrize(
    "ask",
    [
        lambda system: hs.steady_state(system, params={"normal": 7.0}),
        lambda system: hs.frequency_response(system, [1.0], params={"normal": 7.0}),
        lambda system: hs.sweep(system, {"omega": [1.0]}, "steady", params={"normal": 7.0}),
    ],
    ids=["steady_state", "frequency_response", "sweep"],
)
def test_a_name_for_all_contacts_is_refused_if_their_values_differ(ask) -> None:
    """The normal loads are 1.0 and 1.3, so that one load for both contacts would be another system."""
    system = hs.two_blocks_on_belt().with_(forcing={0: hs.Harmonic(0.3, 1.0)})
    with pytest.raises(
        hs.UsageError, match=r"(?s)different values of 'normal'.*set each contact: f1\.normal, f2\.normal"
    ):
        ask(system)
