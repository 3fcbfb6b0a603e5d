"""The TOML form says all that Python can say, and comes back equal."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from model.samples import block, everything

import hybridsim as hs

MODELS = [info.name for info in hs.list_models()]


@pytest.mark.parametrize("name", MODELS)
def test_packaged_models_come_back_equal(name: str) -> None:
    model = hs.load(name)
    again = hs.Model.from_toml(model.to_toml())
    assert again == model
    assert again.structure() == model.structure()
    assert again.to_toml() == model.to_toml()


def test_every_kind_of_part_comes_back_equal() -> None:
    model = everything().validate()
    again = hs.Model.from_toml(model.to_toml())
    assert again == model
    assert [law.title for law in {c.law for c in again.contacts}] != ["", ""]
    assert again.structure() == model.structure()


names = st.from_regex(r"[a-z]{2,6}_[0-9]", fullmatch=True)
texts = st.text(st.characters(blacklist_categories=("Cs",)), max_size=20)
numbers = st.one_of(
    st.integers(-(2**53), 2**53),
    st.floats(allow_nan=False, allow_infinity=False),
    st.just("1 + 2*pi"),
    st.just("1e5"),
)


@given(
    parameters=st.dictionaries(names, st.tuples(numbers, texts, texts), max_size=5),
    states=st.lists(st.tuples(names, numbers, texts), min_size=1, max_size=4, unique_by=lambda item: item[0]),
    title=texts,
    times=st.lists(st.floats(-1e9, 1e9), min_size=2, max_size=6, unique=True),
)
def test_random_models_come_back_equal(parameters, states, title, times) -> None:
    known = [name for name in parameters if name not in {state[0] for state in states}]
    model = hs.Model(
        "random",
        states=[
            hs.State(name, value, " + ".join([*known[:2], f"sin({name})", "u"]), unit)
            for name, value, unit in states
        ],
        parameters=[hs.Parameter(name, *parameters[name]) for name in known],
        inputs=[hs.Input("u", "table", times=sorted(times), values=times)],
        title=title,
    ).validate()
    assert hs.Model.from_toml(model.to_toml()) == model


def test_short_forms_mean_the_long_ones() -> None:
    short = """
        [parameters]
        m = 2
        [states]
        x = { start = 0, der = "v" }
        v = { start = 0, der = "a - f" }
        [discrete]
        a = 1
        [contacts.f]
        velocity = "v"
        normal = "m"
        law = { slip = "N*mu", stick = "N*mu", mu = "0.1*m" }
        [monitors]
        peak = "v"
        [clocks.c]
        period = 2
        set = { a = "-a" }
        [outputs]
        f = "f"
        [modes.only.guards]
        g = { expr = "9 - x", then = "only" }
    """
    long = """
        [parameters]
        m = { value = 2 }
        [states.x]
        start = 0
        der = "v"
        [states.v]
        start = 0
        der = "a - f"
        [discrete]
        a = { start = 1 }
        [laws.f]
        parameters = ["mu"]
        slip = "N*mu"
        stick = "N*mu"
        [contacts.f]
        velocity = "v"
        normal = "m"
        law = { name = "f", mu = "0.1*m" }
        [monitors.peak]
        expr = "v"
        direction = "both"
        action = "record"
        [schedules.c]
        start = 0
        period = 2
        reset = { a = "-a" }
        [outputs]
        f = { expr = "f" }
        [components.mode]
        initial = "only"
        [components.mode.modes.only]
        guards = { g = { expr = "9 - x", then = [{ to = "only" }] } }
    """
    assert hs.Model.from_toml(short) == hs.Model.from_toml(long)


def test_the_name_of_a_model_is_that_of_its_file_unless_it_says_so(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text('[states]\nx = { start = 0, der = "1" }\n', encoding="utf-8")
    assert hs.load(path).name == "scene"
    assert hs.load(str(path)).path == str(path)
    path.write_text('name = "other"\n[states]\nx = { start = 0, der = "1" }\n', encoding="utf-8")
    assert hs.load(path).name == "other"


def test_a_law_declared_in_the_file_hides_one_of_the_package() -> None:
    text = block().to_toml()
    assert "[laws.coulomb]" in text
    changed = text.replace('slip = "mu*N"', 'slip = "mu*N/(1 + v)"')
    assert hs.Model.from_toml(changed).contacts[0].law.slip.text == "mu*N/(1 + v)"


def test_numbers_keep_all_their_digits() -> None:
    for value in (0.1 + 0.2, 1e-300, 5e-324, 1.7976931348623157e308, 2**53, -7, 1e22, -0.0):
        model = block(parameters={"m": value, "k": 1, "mu": 0, "N": 0})
        again = hs.Model.from_toml(model.to_toml())
        assert again.parameter_values()["m"].hex() == float(value).hex()
        assert again == model


def test_windows_line_ends_and_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_bytes(b"\xef\xbb\xbf" + block().to_toml().replace("\n", "\r\n").encode())
    assert hs.load(path) == block()


@pytest.mark.parametrize("name", MODELS)
def test_what_is_written_is_plain_toml(name: str) -> None:
    data = tomllib.loads(hs.load(name).to_toml())
    assert data["schema"] == 1 and data["name"] == name
