"""A model with another law in a contact: what the contact keeps, what is refused, and motions in closed form."""

from __future__ import annotations

from math import exp

import pytest

import hybridsim as hs

G, V = 9.81, 2.0


def block(law: str | hs.FrictionLaw = "coulomb", **arguments: float | str) -> hs.Model:
    """A block of mass m that slides on a floor with the velocity V at first."""
    contact = hs.Contact("f", "v", "m*g", law, arguments)
    states = [hs.State("x", 0, "v", nominal=1), hs.State("v", V, "-f/m", nominal=1)]
    return hs.Model("block", states, {"m": 2, "g": G, "grip": 0.3}, contacts=[contact])


@pytest.mark.parametrize("name", ["dfcs", "dfcs-stribeck", "lugre-presliding", "clutches"])
def test_the_law_that_a_contact_has_gives_the_same_model_and_the_same_bits(name: str) -> None:
    model = hs.load(name)
    contact = model.contacts[-1]
    same = model.with_law(contact.name, contact.law)
    assert same == model and same.structure() == model.structure()
    first, second = (hs.simulate(m, (0, 0.1)) for m in (model, same))
    assert first.names == second.names
    assert first.t.tobytes() == second.t.tobytes() and first.y.tobytes() == second.y.tobytes()


def test_a_block_under_two_laws() -> None:
    """Coulomb's law takes mu*g from the velocity in each unit of time; viscous friction c*N takes it exponentially."""
    model = block(mu="grip")
    assert hs.simulate(model, (0, 0.4))(0.4)[1] == pytest.approx(V - 0.3 * G * 0.4, rel=1e-9)
    slower = model.with_law("f", "coulomb", mu="grip/2")
    assert hs.simulate(slower, (0, 0.4))(0.4)[1] == pytest.approx(V - 0.15 * G * 0.4, rel=1e-9)
    thick = hs.FrictionLaw("thick", parameters=["mu"], force="mu*N*v")
    drag = model.with_law("f", thick)
    assert drag.contacts[0].arguments["mu"].text == "grip"
    assert hs.simulate(drag, (0, 0.4))(0.4)[1] == pytest.approx(V * exp(-0.3 * G * 0.4), rel=1e-7)
    assert hs.simulate(drag.with_(grip=0.6), (0, 0.4))(0.4)[1] == pytest.approx(
        V * exp(-0.6 * G * 0.4), rel=1e-7
    )


def test_values_come_from_the_call_then_the_contact_then_the_defaults() -> None:
    first = hs.FrictionLaw("first", "mu*a*N", "mu*a*N", {"mu": None, "a": "2*mu"})
    other = hs.FrictionLaw("other", "mu*a*b*N", "mu*a*b*N", {"mu": 5, "a": None, "b": 3})
    model = block(first, mu=0.5)
    found = model.with_law("f", other).contacts[0]
    assert {name: value.text for name, value in found.arguments.items()} == {"mu": "0.5", "a": "2*0.5"}
    assert found.values()["b"].text == "3"
    called = model.with_law("f", other, b=4, mu="grip").contacts[0]
    assert {name: value.text for name, value in called.arguments.items()} == {
        "mu": "grip",
        "a": "2*0.5",
        "b": "4",
    }


def test_states_of_a_law_come_and_go() -> None:
    model = block(mu=0.3)
    dahl = model.with_law("f", "dahl", sigma=1e3).with_start(f_z=1e-4)
    assert [state.name for state in dahl.states] == ["x", "v", "f_z"]
    again = dahl.with_law("f", "dahl", sigma=2e3)
    assert again.start_values()["f_z"] == 1e-4
    assert dahl.with_law("f", "coulomb") == model
    iwan = dahl.with_law("f", "iwan", n=3, k=9)
    assert [state.name for state in iwan.states] == ["x", "v", "f_F1", "f_F2", "f_F3"]
    assert hs.Model.from_toml(iwan.to_toml()) == iwan


def test_a_contact_of_a_part() -> None:
    model = hs.Model("pair", use=[hs.Use("a", block(mu=0.3)), hs.Use("b", block(mu=0.3))])
    changed = model.with_law("b.f", "coulomb", mu=0.1)
    run = hs.simulate(changed, (0, 0.4))
    end = dict(zip(run.names, run(0.4), strict=True))
    assert end["a.v"] == pytest.approx(V - 0.3 * G * 0.4, rel=1e-9)
    assert end["b.v"] == pytest.approx(V - 0.1 * G * 0.4, rel=1e-9)


@pytest.mark.parametrize(
    ("contact", "law", "values", "message", "remedy"),
    [
        ("g", "coulomb", {}, "the model 'block' has no contact 'g'", "known contacts: f"),
        ("f", "columb", {}, "there is no law 'columb'", "did you mean 'coulomb'"),
        ("f", 3, {}, "`law` cannot be 3", "name of a law"),
        (
            "f",
            "stribeck",
            {"q": 1},
            "'stribeck' has no parameter 'q'",
            "parameters of the law: mu_k, mu_s, v_s",
        ),
        ("f", "stribeck", {"mu_s": 1}, "needs a value for 'mu_k', 'v_s'", "'coulomb' with mu = 0.3"),
        ("f", "coulomb", {"mu": "w"}, "contact f, law argument mu: unknown name 'w'", "known names"),
        ("f", "coulomb", {"mu": "2*("}, "mu: invalid expression", ""),
        ("f", "coulomb", {"mu": None}, "mu: None is not an expression", "write a number"),
        ("f", "nowhere.toml", {}, "the file does not exist", ""),
    ],
)
def test_what_is_refused(
    contact: str, law: object, values: dict[str, object], message: str, remedy: str
) -> None:
    with pytest.raises(hs.HybridsimError) as caught:
        block(mu=0.3).with_law(contact, law, **values)  # type: ignore[arg-type]  # wrong on purpose
    assert message in str(caught.value) and remedy in (caught.value.remedy or "")
