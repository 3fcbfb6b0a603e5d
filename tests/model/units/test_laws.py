"""The units in a friction law of one's own: its formulas, its parameters, and the values that contacts pass."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.model.units.faults import unit_faults, unit_rows

MODEL = """[parameters]
m = { value = 1, unit = "kg" }
k = { value = 50, unit = "N/m" }
w = { value = 0.1, unit = "m/s" }
slow = { value = 100, unit = "mm/s" }
load = { value = 10, unit = "N" }
[states]
x = { start = 0, unit = "m", der = "v" }
v = { start = 1, unit = "m/s", der = "(-k*x - f)/m" }
[contacts.f]
velocity = "v"
normal = "load"
law = { file = "pad.toml", v_s = "w", d = "x" }
"""
LAW = """[laws.pad]
parameters.mu_s = { value = 0.6, unit = "1" }
parameters.mu_k = { value = 0.4, unit = "1" }
parameters.v_s = { value = 0.05, unit = "m/s" }
parameters.c = { value = 2, unit = "N s/m" }
parameters.L = { value = 2, unit = "m" }
parameters.d = { unit = "m" }
slip = "N*(mu_k + (mu_s - mu_k)*exp(-v/v_s))*exp(-d/L) + c*v"
stick = "N*mu_s*exp(-d/L)"
"""
ARGUMENTS, SLIP, STICK = 13, 8, 9  # lines


def faults(folder: Path, model: str = MODEL, law: str = LAW) -> list[hs.model.checks.caution.Caution]:
    (folder / "pad.toml").write_text(law, encoding="utf-8")
    (folder / "car.toml").write_text(model, encoding="utf-8")
    return [*unit_faults(hs.load(folder / "car.toml"))]


def test_a_law_that_is_right_has_no_warning(tmp_path: Path) -> None:
    assert faults(tmp_path) == []
    rows = {what: (unit, known) for what, unit, known in unit_rows(hs.load(tmp_path / "car.toml"))}
    assert rows["f"] == ("N", "inferred")
    assert rows["contact f, law pad, c"] == ("N s/m", "declared")
    assert rows["contact f, law pad, v_s"] == ("m/s", "agrees")
    assert rows["contact f, law pad, slip"] == ("N", "agrees")


@pytest.mark.parametrize(
    ("old", "new", "line", "term", "message"),
    [
        ("+ c*v", "+ c", SLIP, "c", "'c' is in N s/m, but 'N*(mu_k + (mu_s - mu_k)*exp(-v/v_s))*exp(-d/L)' is in N"),
        ("-v/v_s", "-v*v_s", SLIP, "-v*v_s", "'-v*v_s' is in m^2/s^2, but the argument of exp is a pure number"),
        ("N*mu_s*exp", "mu_s*exp", STICK, "mu_s*exp(-d/L)", "'mu_s*exp(-d/L)' is a pure number, but f is in N"),
        ('0.05, unit = "m/s"', '0.05, unit = "mm/s"', SLIP, "-v/v_s", "'-v/v_s' is in 1000, but the argument of exp"),
        ('2, unit = "m"', '2, unit = "mm"', SLIP, "-d/L", "'-d/L' is in 1000, but the argument of exp"),
        ("mu_k + (", "mu_k + c + (", SLIP, "c", "'c' is in N s/m, but 'mu_k' is a pure number"),
        ("mu_s - mu_k", "mu_s - L", SLIP, "L", "'L' is in m, but 'mu_s' is a pure number"),
    ],
)  # fmt: skip
def test_a_fault_in_a_formula_has_its_line_and_term_in_the_law_file(
    tmp_path: Path, old: str, new: str, line: int, term: str, message: str
) -> None:
    assert old in LAW
    found = faults(tmp_path, law=LAW.replace(old, new, 1))
    caution = next(one for one in found if message in one.message)
    place = caution.place
    assert place is not None and place.file is not None and place.text is not None
    assert (Path(place.file).name, place.line) == ("pad.toml", line)
    assert place.column is not None and place.text[place.column :].startswith(term)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('v_s = "w"', 'v_s = "slow"', "v_s: 'slow' is in mm/s, but v_s of the law is in m/s"),
        ('v_s = "w"', 'v_s = "k"', "v_s: 'k' is in N/m, but v_s of the law is in m/s"),
        ('d = "x"', 'd = "x + w"', "d: 'w' is in m/s, but 'x' is in m"),
        ('d = "x"', 'd = "x", c = "load/slow"', "c: 'load/slow' is in N s/mm, but c of the law is in N s/m"),
    ],
)
def test_a_value_that_a_contact_passes_is_compared(tmp_path: Path, old: str, new: str, message: str) -> None:
    (caution,) = faults(tmp_path, MODEL.replace(old, new, 1))
    assert caution.message == f"contact f, law pad, {message}"
    assert caution.place is not None and caution.place.line == ARGUMENTS


def test_a_factor_that_converts_mends_a_scale(tmp_path: Path) -> None:
    model = MODEL.replace("[states]", 'q = { value = 1e-3, unit = "(m/s)/(mm/s)" }\n[states]')
    assert faults(tmp_path, model.replace('v_s = "w"', 'v_s = "q*slow"')) == []


def test_revolutions_per_minute_are_no_radians_per_second(tmp_path: Path) -> None:
    shaft = """[parameters]
J = { value = 1, unit = "kg m^2" }
n = { value = 60, unit = "rpm" }
[states]
w = { start = 1, unit = "rad/s", der = "-f/J" }
[contacts.f]
velocity = "w"
normal = 1
law = { file = "pad.toml", w_s = "n" }
"""
    law = """[laws.pad]
parameters.T = { value = 3, unit = "N m" }
parameters.w_s = { unit = "rad/s" }
slip = "T*(1 + exp(-v/w_s))"
stick = "2*T"
"""
    (caution,) = faults(tmp_path, shaft, law)
    assert caution.message.endswith("w_s: 'n' is in rpm, but w_s of the law is in rad/s")
    assert faults(tmp_path, shaft.replace('w_s = "n"', "w_s = 3"), law) == []
    found = faults(tmp_path, shaft.replace('w_s = "n"', "w_s = 3"), law.replace("T*(", "("))
    assert [
        "law pad, slip: '1 + exp(-v/w_s)' is a pure number, but f is in " in one.message for one in found
    ] == [True]


def test_a_value_for_an_undeclared_parameter_is_shown_with_the_formula(tmp_path: Path) -> None:
    law = LAW.replace('parameters.c = { value = 2, unit = "N s/m" }', "parameters.c = 2")
    (caution,) = faults(tmp_path, MODEL.replace('d = "x"', 'd = "x", c = "k"'), law)
    assert caution.message.startswith("contact f, law pad, slip: 'c*v' is in N/s, but 'N*(mu_k")
    assert caution.remedy.endswith("a value that the contact passes: c = k")
    assert caution.place is not None and (caution.place.line, caution.place.text) == (
        SLIP,
        LAW.split('"')[-4],
    )


def test_one_fault_of_a_law_in_two_contacts_is_one_warning(tmp_path: Path) -> None:
    second = MODEL[MODEL.index("[contacts.f]") :].replace("contacts.f", "contacts.g")
    (caution,) = faults(tmp_path, MODEL + second, LAW.replace("N*mu_s*exp", "mu_s*exp"))
    assert caution.message.startswith("contact f, law pad, stick: ")


def test_tables_and_states_of_a_law_have_units(tmp_path: Path) -> None:
    law = """[laws.pad]
parameters.k = { value = 3, unit = "N/m" }
states.z = { der = "v", unit = "m" }
tables.share = { at = [0, 1], values = [1, 2], unit = "1" }
force = "share*k*z"
"""
    model = MODEL.replace(', v_s = "w", d = "x"', "")
    assert faults(tmp_path, model, law) == []
    (caution,) = faults(tmp_path, model, law.replace('der = "v"', 'der = "k*v"'))
    assert "rate of z: 'k*v' is in N/s, but the rate of z is in m/s" in caution.message
    assert caution.place is not None and caution.place.line == 3
    assert faults(tmp_path, model, law.replace('unit = "m" }', 'unit = "mm" }'))
    assert faults(tmp_path, model, law.replace('[1, 2], unit = "1"', '[1, 2], unit = "N"'))


def test_units_come_back_from_the_text_of_a_model(tmp_path: Path) -> None:
    assert faults(tmp_path) == []
    model = hs.load(tmp_path / "car.toml")
    again = hs.Model.from_toml(model.to_toml())
    assert again == model and again.contacts[0].law.units["v_s"] == "m/s"
    listed = LAW.replace(LAW[LAW.index("parameters.mu_s") : LAW.index("slip")], "")
    listed = listed.replace(
        "slip =",
        'parameters = ["d", { v_s = { unit = "m/s" }, mu_s = 0.6, mu_k = 0.4 }, '
        '{ c = { value = 2, unit = "N s/m" }, L = 1 }]\nslip =',
        1,
    )
    faults(tmp_path, law=listed)
    law = hs.load_law(tmp_path / "pad.toml")
    assert law.units == {"v_s": "m/s", "c": "N s/m"} and law.parameters["v_s"] is law.parameters["d"] is None
    model = hs.load(tmp_path / "car.toml")
    assert hs.Model.from_toml(model.to_toml()) == model


def test_a_law_in_python_has_units() -> None:
    law = hs.FrictionLaw(
        "own", slip="mu*N + c", stick="mu*N", parameters={"mu": 0.3, "c": 2}, units={"mu": "1", "c": "N s/m"}
    )
    states = [hs.State("v", 1, "-f/m", unit="m/s")]
    model = hs.Model("m", states, {"m": 1, "F": 2}, contacts=[hs.Contact("f", "v", "F", law)])
    assert not [*unit_faults(model)]  # the unit of the load is not known
    parameters = [hs.Parameter("m", 1, unit="kg"), hs.Parameter("F", 1, unit="N")]
    (caution,) = unit_faults(hs.Model("m", states, parameters, contacts=[hs.Contact("f", "v", "F", law)]))
    assert caution.message == "contact f, law own, slip: 'c' is in N s/m, but 'mu*N' is in N"


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ({"nu": "1"}, "`units` contains 'nu'"),
        ({"mu": 1}, "`units` cannot be {'mu': 1}"),
        ("N", "`units` cannot be 'N'"),
    ],
)
def test_units_of_other_names_are_refused(units: object, message: str) -> None:
    with pytest.raises(hs.UsageError, match="FrictionLaw own") as caught:
        hs.FrictionLaw("own", slip="mu*N", stick="mu*N", parameters=["mu"], units=units)  # type: ignore[arg-type]
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("unit = \"N s/m\"", "units = \"N s/m\"", 5, "parameter c: unknown key 'units'"),
        ("value = 2, unit = \"N s/m\"", "value = [2]", 5, "[2] is not an expression"),
        ("{ value = 2, unit = \"N s/m\" }", "[2]", 5, "parameter c cannot be a list"),
        ("unit = \"N s/m\"", "unit = 3", 5, "'unit' cannot be a number (3)"),
    ],
)  # fmt: skip
def test_wrong_parameters_of_a_law_have_their_line(
    tmp_path: Path, old: str, new: str, line: int, message: str
) -> None:
    assert old in LAW
    with pytest.raises(hs.ModelError) as caught:
        faults(tmp_path, law=LAW.replace(old, new, 1))
    first = caught.value.errors[0]
    assert message in first.message
    assert first.place is not None and first.place.line == line
