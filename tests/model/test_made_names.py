"""Names that the package makes for a model never meet those that the model declares, or each other."""

from __future__ import annotations

from dataclasses import replace

import pytest

import hybridsim as hs
from hybridsim.analysis.advise.question import with_contact_outputs
from hybridsim.errors import HybridsimError, ModelError
from hybridsim.mechanics.declaration.as_model import as_model
from hybridsim.model.free_name import names_of_model


def lifted(**parts) -> hs.Model:
    """A contact f that lifts off: it makes the automaton and the variable f_N."""
    given = {
        "states": [hs.State("x", 0, der="v"), hs.State("v", 1, der="-f - g")],
        "parameters": {"one": 1},
        "contacts": [hs.Contact("f", "v", "1 - x", "coulomb", {"mu": 0.5}, opens=True)],
        "definitions": {"g": "0"},
    }
    return hs.Model("lifted", **(given | parts))


def idle(name: str) -> hs.Component:
    return hs.Component(name, [hs.Mode("only")])


MEETING = {
    "contact": {
        "contacts": [
            hs.Contact("f", "v", "1 - x", "coulomb", {"mu": 0.5}, opens=True),
            hs.Contact("f_N", "v - 1", "one", "coulomb", {"mu": 0.1}),
        ],
        "states": [hs.State("x", 0, der="v"), hs.State("v", 1, der="-f - f_N")],
    },
    "component": {"components": [idle("f_N")]},
    "state": {"states": [hs.State("x", 0, der="v"), hs.State("v", 1, der="-f"), hs.State("f_N", 0, der="0")]},
    "parameter": {"parameters": {"one": 1, "f_N": 2}},
    "definition": {"definitions": {"g": "0", "f_N": "x"}},
    "monitor": {"monitors": [hs.Monitor("f_N", "x - 5")]},
    "impact": {"impacts": [hs.Impact("f_N", gap="x + 2", restitution=0.5)]},
    "surface": {"surfaces": [hs.SwitchingSurface("f_N", "x - 3")]},
    "schedule": {"schedules": [hs.Schedule("f_N", times=[1.0], reset={"v": "1"})]},
    "input": {"inputs": [hs.Input("f_N", "table", times=[0, 1], values=[0, 1])]},
}


@pytest.mark.parametrize("kind", MEETING)
def test_the_name_of_a_lift_off_meets_none_that_is_declared(kind: str) -> None:
    with pytest.raises(ModelError, match="f_N"):
        lifted(**MEETING[kind]).validate()
    lifted().validate()


def test_a_copy_of_a_law_meets_no_contact() -> None:
    contacts = [
        hs.Contact("f", "v", "1", "iwan", {"n": 2, "mu": 0.5, "k": 10}),
        hs.Contact("f_1", "v", "1", "coulomb", {"mu": 0.5}),
    ]
    states = [hs.State("x", 0, der="v"), hs.State("v", 1, der="-f - f_1")]
    with pytest.raises(ModelError, match="f_1"):
        hs.Model("copies", states=states, contacts=contacts).validate()


@pytest.mark.parametrize("taken", ["f_held", "v0"])
def test_a_regularised_model_takes_names_that_are_free(taken: str) -> None:
    model = hs.Model(
        "slider",
        states=[hs.State("v", 1, der="-f + pull")],
        parameters={taken: 0.25},
        definitions={"pull": f"{taken}*0"},
        contacts=[hs.Contact("f", "v", "1", "coulomb", {"mu": 0.5})],
    )
    for kind in ("karnopp", "tanh"):
        regular = model.regularized(kind, v0=1e-3)
        regular.validate()
        assert regular.parameter_values()[taken] == 0.25
        solution = hs.simulate(regular, (0, 1), integrator="dop853")
        assert solution(1.0)[0] == pytest.approx(0.5, abs=1e-6)


def test_frequencies_of_a_mechanical_system_meet_no_coordinate() -> None:
    system = hs.MechanicalSystem(
        [[1.0]], [[0.0]], [[4.0]], forcing={0: hs.Harmonic(omega=3.0, sin=1.0)}, names=["omega_1"]
    )
    model = as_model(system)
    assert {"omega_1", "omega_1_"} <= names_of_model(model)
    model.validate()


def test_what_is_compared_has_names_that_no_output_has() -> None:
    model = hs.load("belt")
    taken = hs.Output(f"speed_of_{model.contacts[0].name}", "1")
    with pytest.raises(HybridsimError, match="rename the output"):
        with_contact_outputs(replace(model, outputs=(*model.outputs, taken)))
