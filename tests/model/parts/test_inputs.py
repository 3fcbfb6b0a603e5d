"""Inputs: tables from CSV and in place, waves and chirps, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybridsim as hs

HEAD = '[states]\nx = { start = 0, der = "u" }\n[inputs.u]\n'


def load(tmp_path: Path, declaration: str, table: str | bytes | None = None) -> hs.Model:
    if table is not None:
        data = table if isinstance(table, bytes) else table.encode()
        (tmp_path / "road.csv").write_bytes(data)
    path = tmp_path / "scene.toml"
    path.write_text(HEAD + declaration, encoding="utf-8")
    return hs.load(path)


TABLE = 'kind = "table"\nfile = "road.csv"\n'


@pytest.mark.parametrize(
    ("more", "table"),
    [
        ("", "0,1\n1,2.5\n2,-3\n"),
        ("", "t,u\n0,1\n1,2.5\n2,-3\n"),
        ("", "# a road\n\nt;u\n0;1\n1;2.5\n\n2;-3\n"),
        ("", b"\xef\xbb\xbft\tu\r\n0\t1\r\n1\t2.5\r\n2\t-3\r\n"),
        ('columns = ["time", "height"]', "height, other, time\n1, 9, 0\n2.5, 9, 1\n-3, 9, 2\n"),
        ("columns = [2, 0]", "1,9,0\n2.5,9,1\n-3,9,2\n"),
        ('columns = ["t", 2]', "t,a,b\n0,x,1\n1,y,2.5\n2,z,-3\n"),
    ],
)
def test_a_table_from_a_file_is_the_table_in_place(more: str, table: str | bytes, tmp_path: Path) -> None:
    model = load(tmp_path, TABLE + more, table)
    in_place = load(tmp_path, 'kind = "table"\ntimes = [0, 1, 2]\nvalues = [1, 2.5, -3]\n')
    assert model.inputs == in_place.inputs
    assert model.inputs[0].interpolation == "linear"
    assert hs.Model.from_toml(model.to_toml()) == model


@pytest.mark.parametrize(
    ("more", "table"),
    [
        ("", "0,10,start\n1,2,x\n2,3,y\n"),
        ("", "0,10,\n1,2,\n2,3,\n"),
        ("", "0;10;\n1;2;\n2;3;\n"),
        ("columns = [0, 2]", "0,n/a,10\n1,5,2\n2,5,3\n"),
        ("columns = [1, 0]", "10,0,-\n2,1,-\n3,2,-\n"),
        ("", "t,u,\n0,10,\n1,2,\n2,3,\n"),
        ("", "0,10\n1,2,x\n2,3,\n"),
    ],
)
def test_the_first_row_is_data_whatever_stands_in_other_columns(
    more: str, table: str, tmp_path: Path
) -> None:
    """The integral of the table is (10 + 2)/2 + (2 + 3)/2 = 8.5."""
    model = load(tmp_path, TABLE + more, table)
    assert (model.inputs[0].times, model.inputs[0].values) == ((0.0, 1.0, 2.0), (10.0, 2.0, 3.0))
    driven = hs.Model("driven", states=[hs.State("x", 0, model.inputs[0].name)], inputs=model.inputs)
    assert hs.simulate(driven, (0, 2), integrator="taylor").y[0, -1] == pytest.approx(8.5, rel=1e-12)


@pytest.mark.parametrize(
    ("more", "table", "message"),
    [
        ("", "0,n/a\n1,2\n2,3\n", "road.csv:1: 'n/a' is not a number"),
        ("", "t0,10\n1,2\n2,3\n", "road.csv:1: 't0' is not a number"),
        ("", None, "does not exist"),
        ("", "", "no rows"),
        ("", "t,u\n", "no rows of numbers"),
        ("", "0,1\n", "1 points"),
        ("", "0,1\n1,x\n", "road.csv:2: 'x' is not a number"),
        ("", "0,1\n1\n", "road.csv:2: column 1 is empty"),
        ("", "0\n1\n", "column 1 does not exist"),
        ("", "0,1\n1,nan\n", "'values[1]' cannot be nan"),
        ("", "0,1\n2,1\n1,1\n", "the times decrease from 2.0 to 1.0"),
        ("", "0,1\n1,1\n1,2\n1,3\n", "occurs more than once"),
        ('interpolation = "cubic"', "0,1\n1,1\n1,2\n", "occurs more than once"),
        ('interpolation = "cubik"', "0,1\n1,1\n", "did you mean 'cubic'"),
        ('columns = ["t", "hight"]', "t,height\n0,1\n1,1\n", "did you mean 'height'"),
        ('columns = ["t", "u"]', "0,1\n1,1\n", "use indices"),
        ("columns = [0, 5]", "0,1\n1,1\n", "columns 0 to 1"),
        ("columns = [0]", "0,1\n1,1\n", "use two names or indices"),
        ("columns = 3", "0,1\n1,1\n", "use two names or indices"),
        ("times = [1, 2]", "0,1\n1,1\n", "'file' and 'times' cannot be combined"),
        ("", b"\x00\xff\xfe", "not a text file in UTF-8"),
        ("", b"0,1\n0,\x001\n", "is not a number"),
        ("periode = 1", "0,1\n1,1\n", "unknown key 'periode'"),
        ("period = 1", "0,1\n1,1\n", "unknown key 'period'"),
    ],
)
def test_bad_tables(more: str, table: str | bytes | None, message: str, tmp_path: Path) -> None:
    with pytest.raises(hs.ModelError) as caught:
        load(tmp_path, TABLE + more, table)
    assert message in str(caught.value)
    assert "scene.toml" in str(caught.value)
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("declaration", "message"),
    [
        ("", "'kind' is missing"),
        ('kind = "waves"', "did you mean 'wave'"),
        ('kind = "wave"\nperiod = 1', "'shape' is missing"),
        ('kind = "wave"\nshape = "square"', "'period' is missing"),
        ('kind = "wave"\nshape = "sinus"\nperiod = 1', "unknown shape 'sinus'"),
        ('kind = "wave"\nshape = "sine"\nperiod = 0', "'period' cannot be 0"),
        ('kind = "wave"\nshape = "sine"\nperiod = "1 - 2"', "'period' cannot be -1"),
        ('kind = "wave"\nshape = "sine"\nperiod = 1\nduty = 0.3', "cannot have 'duty'"),
        ('kind = "wave"\nshape = "square"\nperiod = 1\nduty = 1', "'duty' cannot be 1"),
        ('kind = "wave"\nshape = "sine"\nperiod = "x"', "the state 'x' cannot be used here"),
        ('kind = "wave"\nshape = "sine"\nperiod = "t"', "the time 't' cannot be used here"),
        ('kind = "table"\nfile = "."', "is not a regular file"),
        ('kind = "table"\nfile = 3', "'file' cannot be a number (3)"),
        ('kind = "chirp"\nf0 = 1\nf1 = 2', "'duration' is missing"),
        ('kind = "chirp"\nf0 = 1\nf1 = 2\nduration = -1', "'duration' cannot be -1"),
        ('kind = "table"\ntimes = [0, 1]\nvalues = [1]', "'times' has 2 numbers, but 'values' has 1"),
        ('kind = "table"\ntimes = [0, "1"]\nvalues = [1, 2]', "use a list of numbers"),
        ('kind = "table"\ntimes = [0, inf]\nvalues = [1, 2]', "'times[1]' cannot be inf"),
    ],
)
def test_bad_inputs(declaration: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(hs.ModelError) as caught:
        load(tmp_path, declaration)
    assert message in str(caught.value)
    assert all(error.remedy for error in caught.value.errors)


def test_defaults() -> None:
    wave = hs.Input("u", "wave", shape="square", period="P")
    assert {name: expr.text for name, expr in wave.expressions.items()} == {
        "amplitude": "1",
        "period": "P",
        "phase": "0",
        "offset": "0",
        "duty": "0.5",
    }
    assert hs.Input("u", "wave", shape="sine", period=1).duty is None


def test_a_field_of_another_kind_is_refused() -> None:
    with pytest.raises(hs.ModelError, match="of kind chirp cannot have 'period'"):
        hs.Model(
            "m",
            [hs.State("x", 0, "u")],
            inputs=[hs.Input("u", "chirp", f0=1, f1=2, duration=3, period=2)],
        ).validate()
