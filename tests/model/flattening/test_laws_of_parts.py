"""Each use of one part can have its own friction law: motions in closed form, and errors with their lines."""

from __future__ import annotations

from math import exp
from pathlib import Path

import pytest

import hybridsim as hs

# A block of mass 1 that slides on a floor with the velocity 3 at first; the load is 2.
BLOCK = """
[parameters]
mu = 0.5
[states]
x = { start = 0, der = "v" }
v = { start = 3, der = "-brake" }
[contacts.brake]
velocity = "v"
normal = 2
law = { name = "coulomb", mu = "mu" }
"""
PAD = "[laws.pad]\nparameters = ['c']\nforce = 'c*N*v'\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "block.toml").write_text(BLOCK, encoding="utf-8")
    (tmp_path / "pair.toml").write_text("[use.left]\nmodel = 'block.toml'\n", encoding="utf-8")
    (tmp_path / "pad.toml").write_text(PAD, encoding="utf-8")
    return tmp_path


def loaded(folder: Path, text: str) -> hs.Model:
    (folder / "whole.toml").write_text(text, encoding="utf-8")
    return hs.load(folder / "whole.toml")


def refused(folder: Path, text: str) -> hs.ModelError:
    with pytest.raises(hs.ModelError) as caught:
        loaded(folder, text)
    return caught.value


def test_three_uses_of_a_part_slide_under_three_laws(folder: Path) -> None:
    """v = 3 - mu*N*t for Coulomb's law, and v = 3*exp(-c*N*t) for a force c*N*v."""
    model = loaded(
        folder,
        """
        [parameters]
        grip = 0.1
        [laws.oil]
        parameters = ["c"]
        force = "c*N*v"
        [use.plain]
        model = "block.toml"
        parameters.mu = 0.2
        [use.other]
        model = "block.toml"
        laws.brake = { name = "coulomb", mu = "3*grip" }
        [use.wet]
        model = "block.toml"
        laws.brake = { name = "oil", c = "grip/2" }
        [use.far]
        model = "block.toml"
        laws.brake = { file = "pad.toml", c = 0.25 }
        [use.own]
        model = "block.toml"
        laws.brake = { slip = "a*N", stick = "a*N", a = "own.mu/2" }
        """,
    )
    sol = hs.simulate(model, (0, 2), integrator="taylor")
    expected = {
        "plain.v": 3 - 0.4 * 2, "other.v": 3 - 0.6 * 2, "wet.v": 3 * exp(-0.1 * 2), "far.v": 3 * exp(-0.5 * 2),
        "own.v": 3 - 0.5 * 2,
    }  # fmt: skip
    for name, value in expected.items():
        assert sol.output(name, 2.0) == pytest.approx(value, abs=1e-10)
    again = hs.Model.from_toml(model.to_toml())
    assert again == model and again.structure() == model.structure()


def test_a_law_without_values_keeps_those_of_the_part(folder: Path) -> None:
    (folder / "half.toml").write_text(
        "[laws.half]\nparameters = ['mu']\nslip = 'mu*N/2'\nstick = 'mu*N'\n", encoding="utf-8"
    )
    text = "[use.a]\nmodel = 'block.toml'\nlaws.brake = { file = 'half.toml' }\nparameters.mu = 0.4\n"
    sol = hs.simulate(loaded(folder, text), (0, 1), integrator="exact")
    assert sol.output("a.v", 1.0) == pytest.approx(3 - 0.2 * 2, abs=1e-12)


def test_python_declares_the_same_model(folder: Path) -> None:
    text = """
        [parameters]
        grip = 0.1
        [use.a]
        model = "block.toml"
        laws.brake = "coulomb"
        [use.b]
        model = "block.toml"
        repeat = 2
        laws.brake = [{ name = "dahl", sigma = "1000*i*grip" }, "coulomb"]
        """
    block, pad = hs.load(folder / "block.toml"), hs.load_law("dahl")
    uses = [
        hs.Use("a", block, laws={"brake": "coulomb"}),
        hs.Use("b", block, repeat=2, laws={"brake": [(pad, {"sigma": "1000*i*grip"}), "coulomb"]}),
    ]
    model = hs.Model("whole", use=uses, parameters={"grip": 0.1}).validate()
    assert model == loaded(folder, text)
    assert [contact.law.name for contact in model.contacts] == ["coulomb", "dahl", "coulomb"]
    assert model.contacts[1].arguments["sigma"].text == "1000*1*grip"
    plain = hs.Model("whole", use=[hs.Use("a", block)], parameters={"grip": 0.1})
    single = hs.Model(
        "whole", use=[hs.Use("a", block, laws={"brake": (pad, {"sigma": 9})})], parameters={"grip": 0.1}
    )
    assert single == plain.with_law("a.brake", "dahl", sigma=9)


def test_an_inner_part_gets_a_law(folder: Path) -> None:
    text = "[use.a]\nmodel = 'pair.toml'\nlaws.left.brake = { name = 'coulomb', mu = 0.1 }\n"
    sol = hs.simulate(loaded(folder, text), (0, 2), integrator="exact")
    assert sol.output("a.left.v", 2.0) == pytest.approx(3 - 0.2 * 2, abs=1e-12)


def test_start_values_reach_the_states_of_the_new_law(folder: Path) -> None:
    (folder / "bristle.toml").write_text(BLOCK.replace('"coulomb"', '"dahl", sigma = 1'), encoding="utf-8")
    text = "[use.a]\nmodel = 'block.toml'\nlaws.brake = { name = 'dahl', sigma = 10 }\nstart.brake_z = 0.01\n"
    assert loaded(folder, text).start_values() == {"a.x": 0.0, "a.v": 3.0, "a.brake_z": 0.01}
    gone = "[use.a]\nmodel = 'bristle.toml'\nlaws.brake = 'coulomb'\nstart.brake_z = 0.01\n"
    fault = refused(folder, gone)
    assert "contact a.brake, start: the law has no state 'z'" in fault.message
    assert fault.place is not None and fault.place.line == 3


def test_laws_of_one_name_in_two_files_stay_apart(folder: Path) -> None:
    text = f"""
        {PAD.replace("force = 'c*N*v'", "force = '2*c*N*v'")}
        [use.a]
        model = "block.toml"
        laws.brake = {{ name = "pad", c = 0.1 }}
        [use.b]
        model = "block.toml"
        laws.brake = {{ file = "pad.toml", c = 0.1 }}
        """
    model = loaded(folder, text)
    assert hs.Model.from_toml(model.to_toml()).structure() == model.structure()
    sol = hs.simulate(model, (0, 1), integrator="taylor")
    assert sol.output("a.v", 1.0) == pytest.approx(3 * exp(-0.4), abs=1e-10)
    assert sol.output("b.v", 1.0) == pytest.approx(3 * exp(-0.2), abs=1e-10)


@pytest.mark.parametrize(
    ("lines", "message", "line"),
    [
        ("laws.brake = 'columb'", "unknown law 'columb'", 3),
        ("laws.brak = 'coulomb'", "laws: the model 'block' has no contact 'brak'", 3),
        ("laws.brak = { name = 'coulomb', mu = 1 }", "laws: the model 'block' has no contact 'brak'", 3),
        ("laws.brake = 3", "'name' cannot be a number (3)", 3),
        ("laws = 3", "'laws' cannot be a number (3)", 3),
        ("laws.brake = { name = 'coulomb', nu = 1 }", "the law 'coulomb' has no parameter 'nu'", 3),
        ("laws.brake = { name = 'stribeck', mu_s = 1 }", "the law 'stribeck' needs a value for 'mu_k', 'v_s'", 3),
        ("laws.brake = { name = 'coulomb', mu = '2*(' }", "laws.brake, mu: invalid expression", 3),
        ("laws.brake = { name = 'coulomb', mu = 'grip' }", "law argument mu: unknown name 'grip'", 3),
        ("laws.brake = { mu = 1 }", "'name' is missing", 3),
        ("laws.brake = { file = 'none.toml' }", "the file does not exist", 3),
        ("laws.brake = ['coulomb', 'coulomb']", "laws, brake: 2 values for one copy", 3),
        ("repeat = 3\nlaws.brake = ['coulomb', 'dahl']", "laws, brake: 2 values for 3 copies", 4),
        ("repeat = 2\nlaws.brake = ['coulomb', 'columb']", "unknown law 'columb'", 4),
        ("repeat = 2\nlaws.brake = { name = 'coulomb', mu = 'a[3].mu' }", "a[3] does not exist", 4),
        ("laws.brake = { slip = 'a*N', a = 1 }", "'stick' is missing", 3),
        ("laws.brake = { name = '__import__(1)', mu = '__import__(1)' }", "unknown function '__import__'", 3),
        ("start.brake_q = 1", "the model 'block' has no state 'brake_q'", 3),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_with_its_line(folder: Path, lines: str, message: str, line: int) -> None:
    fault = refused(folder, f"[use.a]\nmodel = 'block.toml'\n{lines}\n")
    assert message in "\n".join(error.message for error in fault.errors)
    place = next(error.place for error in fault.errors if message in error.message)
    assert place is not None and place.file == str(folder / "whole.toml")
    assert place.line == line
    assert all(error.remedy for error in fault.errors)


def test_wrong_arguments_of_a_use(folder: Path) -> None:
    block = hs.load(folder / "block.toml")
    for laws, message in (
        (3, "`laws` cannot be 3"),
        ({"brake": 3}, r"`laws\['brake'\]` cannot be 3"),
        ({"brake": ("coulomb", 3)}, "has 2 values for one copy"),
        ({"brake": ("coulomb", {"mu": None})}, r"laws\['brake'\], mu: None is not an expression"),
        ({"brake": "columb"}, "there is no law 'columb'"),
    ):
        with pytest.raises(hs.HybridsimError, match=message):
            hs.Use("a", block, laws=laws)  # type: ignore[arg-type]
    with pytest.raises(hs.ModelError, match="the model 'block' has no contact 'brak'"):
        hs.Model("whole", use=[hs.Use("a", block, laws={"brak": "coulomb"})])
    with pytest.raises(
        hs.ModelError, match=r"use a, laws: contact a\.brake: the law 'coulomb' has no parameter 'nu'"
    ):
        hs.Model("whole", use=[hs.Use("a", block, laws={"brake": ("coulomb", {"nu": 1})})])
