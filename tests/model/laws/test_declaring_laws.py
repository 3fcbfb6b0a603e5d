"""Laws in TOML: what is wrong is said with its line and a remedy; what is right comes back the same."""

from __future__ import annotations

import pytest

import hybridsim as hs
from hybridsim.model import list_laws

MODEL = """schema = 1
[states]
x = { start = 0, der = "v" }
v = { start = 1, der = "-100*x - f" }
[contacts.f]
velocity = "v"
normal = "10 + x"
law = { name = "own", mu = 0.5, sigma = 1e4, n = 2 }
nominal = { z = 1e-4 }
[laws.own]
parameters = ["mu", "sigma", "n"]
copies = "n"
states.z = { der = "v - sigma/(mu*N)*abs(v)*z", unit = "m" }
definitions.stiffness = "sigma*i/n"
tables.worn = { at = [0, 1], values = [1, 0.9] }
force = "stiffness*z*worn + 0*dN"
[laws.own.modes.only]
guards.top = { expr = "1 - z", then = { to = "only", reset = { z = "0" } } }
"""

WRONG = {
    "no form": ('force = "stiffness*z*worn + 0*dN"', 'title = "x"', "'slip' is missing", 10),
    "both forms": (
        'copies = "n"',
        'copies = "n"\nslip = "mu*N"',
        "has `force` together with `slip` or `stick`",
        10,
    ),
    "foreign name": ("stiffness*z*worn", "stiffness*z*x", "unknown name 'x'", 16),
    "unknown key": ("copies", "copied", "did you mean 'copies'", 12),
    "no such copy count": ("n = 2", "n = 2.5", "whole number from 1 to 64", 5),
    "too many copies": ("n = 2", "n = 65", "whole number from 1 to 64", 5),
    "copies by a name": ('copies = "n"', 'copies = "m"', "'copies' is 'm', which is not a parameter", 10),
    "unknown state": ("nominal = { z", "nominal = { q", "the law has no state 'q'", 5),
    "start of none": ("nominal = { z = 1e-4 }", "start = { q = 1 }", "the law has no state 'q'", 5),
    "nominal no number": ("{ z = 1e-4 }", '{ z = "a" }', "use a number", 9),
    "unused": ('"mu", "sigma", "n"', '"mu", "sigma", "n", "k"', "needs a value for 'k'", 5),
    "a name twice": ("definitions.stiffness", "definitions.z", "'z' is both a definition and a state", 10),
    "a name taken": (
        "definitions.stiffness",
        "definitions.dN",
        "has the name of the rate of the normal load",
        10,
    ),
    "reset of another": ("reset = { z", "reset = { q", "the law has no state 'q'", 10),
    "mode sets another": ("guards.top", 'set = { g = "1" }\nguards.top', "sets 'g'", 10),
    "no such mode": ('to = "only"', 'to = "other"', "unknown mode 'other'", 18),
    "unequal table": ("values = [1, 0.9]", "values = [1]", "`at` has 2 numbers, but `values` has 1", 15),
    "table falls": ("at = [0, 1]", "at = [1, 0]", "use ascending numbers in `at`", 15),
    "table of texts": ("values = [1, 0.9]", 'values = [1, "a"]', "cubic interpolation needs numbers", 15),
    "rate unknown": ('normal = "10 + x"', 'normal = "10 + f"', "cannot be used in this expression", 7),
}


def test_the_model_is_one_and_comes_back() -> None:
    model = hs.Model.from_toml(MODEL)
    assert [state.name for state in model.states] == ["x", "v", "f_z1", "f_z2"]
    assert [part.name for part in model.all_components()] == ["f_1", "f_2", "f", "f_worn"]
    assert hs.Model.from_toml(model.to_toml()) == model
    started = model.with_start(f_z2=3e-5)
    assert started.start_values() == {"x": 0, "v": 1, "f_z1": 0, "f_z2": 3e-5}
    assert hs.Model.from_toml(started.to_toml()) == started
    assert started.with_start(f_z2=0, x=2).with_().start_values()["f_z2"] == 0


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_said_with_its_line(case: str) -> None:
    old, new, message, line = WRONG[case]
    assert MODEL.count(old) >= 1
    with pytest.raises(hs.ModelError) as caught:
        hs.Model.from_toml(MODEL.replace(old, new, 1))
    assert message in str(caught.value)
    faults = caught.value.errors or (caught.value,)
    assert line in [fault.place.line for fault in faults if fault.place], [str(f) for f in faults]
    assert all(fault.remedy for fault in faults)


def test_a_load_whose_rate_is_not_known_is_refused_where_the_law_asks_for_it() -> None:
    contact = hs.Contact("f", "v", "10 + u", "jenkins", {"mu": 0.5, "k": 1e3})
    states = [hs.State("v", 1, "-f")]
    wave = hs.Input("u", "wave", shape="sine", period=1)
    with pytest.raises(hs.ModelError, match="depends on u, whose time derivative is unknown"):
        hs.Model("m", states, contacts=[contact], inputs=[wave]).validate()


def test_a_set_valued_law_has_no_states() -> None:
    law = hs.FrictionLaw("s", "mu*N", "mu*N", ["mu"], states=[hs.State("z", 0, "v")])
    model = hs.Model("m", [hs.State("v", 1, "-f")], contacts=[hs.Contact("f", "v", 1, law, {"mu": 1})])
    with pytest.raises(hs.ModelError, match="a law with 'slip' and 'stick' cannot have 'states'"):
        model.validate()


def test_every_packaged_law_is_listed_in_the_reference() -> None:
    from pathlib import Path

    page = (Path(__file__).parents[3] / "docs" / "reference" / "laws.md").read_text(encoding="utf-8")
    assert [name for name in list_laws() if f"| `{name}` |" not in page] == []
    for name in list_laws():
        assert f"images/laws/{name}.svg" in page
