"""Inputs: tables from CSV and in place, waves and chirps, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.model.checks.doubtful import warnings_of

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


def test_columns_of_whole_numbers_need_names(tmp_path: Path) -> None:
    """Without names the four columns are refused, since they may be two columns with decimal commas."""
    model = load(tmp_path, TABLE + 'columns = ["t", "u"]', "t,u,n,m\n0,0,1,5\n1,3,2,5\n")
    assert (model.inputs[0].times, model.inputs[0].values) == ((0.0, 1.0), (0.0, 3.0))


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
        ("", "0,0;1,5\n0,5;2,5\n", "road.csv:1: '0,0' is not a number"),
        ("columns = [0, 2]\n", "0,0;1,5\n0,5;2,5\n", "column 2 does not exist"),
        ("", "t\ta\n0,0\t1,5\n", "write a decimal point: 0.0"),
        (
            "",
            "t,a\n0,0,1,5\n0,5,2,5\n",
            "road.csv:2: the row has 4 cells, but the first line of the table has 2",
        ),
        ("", "0,1\n# a comment\n0,5,2\n", "road.csv:3: the row has 3 cells"),
        (
            "",
            "0,0,1,5\n1,0,-2,5\n",
            "road.csv:1: the row '0,0,1,5' has 4 whole numbers, or 2 with decimal commas",
        ),
        ("", "0\n1\n", "column 1 does not exist"),
        (
            "",
            "time,temp,force\n0,20,0\n1,20,5\n",
            "road.csv:2: the table has 3 columns of numbers: time, temp, force",
        ),
        ("", "# a comment\n0;20;0.5\n1;20;5\n", "road.csv:2: the table has 3 columns of numbers: 0, 1, 2"),
        ("", "0,1\n1,nan\n", "road.csv:2: 'nan' is not a finite number"),
        ("", "0,1\n# a comment\n1e400,1\n", "road.csv:3: '1e400' is not a finite number"),
        ("", "0,1\n1_0,1\n", "road.csv:2: '1_0' is not a number"),
        ("", "0,5;1,5\n1;2\n2;3\n", "road.csv:1: '0,5' is not a number"),
        ("", "1_0;2_0\n11;2\n12;3\n", "road.csv:1: '1_0' is not a number"),
        ("", "0,0,1,25E-3\n0,5,1,50E-3\n", "road.csv:1: the table has 4 columns of numbers"),
        ("", "0,1\n\n2,1\n1,1\n", "road.csv:4: the times decrease from 2.0 to 1.0"),
        ("", "0,1\n1,1\n1,2\n1,3\n", "occurs more than once"),
        ('interpolation = "cubic"', "0,1\n1,1\n1,2\n", "occurs more than once"),
        ('interpolation = "cubik"', "0,1\n1,1\n", "did you mean 'cubic'"),
        ('columns = ["t", "hight"]', "t,height\n0,1\n1,1\n", "did you mean 'height'"),
        ('columns = ["t", "u"]', "0,1\n1,1\n", "use indices"),
        ("columns = [0, 5]", "0,1\n1,1\n", "columns 0 to 1"),
        ('columns = ["t", "w"]', "# a\n# b\n\nt,u\n0,1\n1,1\n", "road.csv:4: column 'w' does not exist"),
        ("columns = [0, 5]", "# a\n0,1\n1,1\n", "road.csv:2: column 5 does not exist"),
        ("", "t u\n0 1\n1 2\n", "road.csv:3: spaces separate the columns of the row '1 2'"),
        ("", "0 1\n1  2\n", "separate columns by commas, semicolons or tabs"),
        ('columns = ["t", "u"]', "# a\nt u\n0 1\n1 2\n", "road.csv:4: spaces separate the columns"),
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
        ('kind = "table"\ntimes = [0, 1]\nvalues = [0, 1]\ntime_unit = ""', "'time_unit' cannot be ''"),
        ('kind = "wave"\nshape = "square"', "'period' is missing"),
        ('kind = "wave"\nshape = "sinus"\nperiod = 1', "unknown shape 'sinus'"),
        ('kind = "wave"\nshape = "sine"\nperiod = 0', "'period' cannot be 0"),
        ('kind = "wave"\nshape = "sine"\nperiod = "1 - 2"', "'period' cannot be -1"),
        ('kind = "wave"\nshape = "sine"\nperiod = 1\nduty = 0.3', "cannot have 'duty'"),
        ('kind = "wave"\nshape = "square"\nperiod = 1\nduty = 1', "'duty' cannot be 1"),
        ('kind = "wave"\nshape = "sine"\nperiod = "x"', "the state 'x' cannot be used in this expression"),
        ('kind = "wave"\nshape = "sine"\nperiod = "t"', "the time 't' cannot be used in this expression"),
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


def test_an_input_in_python_reads_a_file_as_one_in_a_model_file(tmp_path: Path) -> None:
    (tmp_path / "road.csv").write_text("height,t\n1,0\n3,2\n2,4\n", encoding="utf-8")
    declared = hs.Input("u", "table", file=tmp_path / "road.csv", columns=("t", "height"))
    assert declared == hs.Input("u", "table", times=[0, 2, 4], values=[1, 3, 2])
    model = hs.Model("m", states=[hs.State("x", 0, "u")], inputs=[declared]).validate()
    assert model == hs.Model.from_toml(model.to_toml())
    # the integral of 1 + t up to t = 2, and of 3 - (t - 2)/2 after it
    sol = hs.simulate(model, (0, 4), integrator="taylor")
    assert sol.output("x", 2.0) == pytest.approx(4.0, abs=1e-12)
    assert sol.output("x", 4.0) == pytest.approx(9.0, abs=1e-12)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"kind": "wave", "shape": "sine", "file": "road.csv"},
            "`file` and the kind 'wave' cannot be combined",
        ),
        ({"kind": "table", "times": [0, 1], "file": "road.csv"}, "`file` and `times` cannot be combined"),
        ({"kind": "table", "columns": (0, 1)}, "`columns` is set without `file`"),
        ({"kind": "table", "file": "road.csv", "columns": 3}, "`columns` cannot be 3"),
        ({"kind": "table", "file": "road.csv", "columns": (0, True)}, "`columns` cannot be (0, True)"),
        ({"kind": "table", "file": 3}, "A path cannot be 3"),
        ({"kind": "table", "file": "none.csv"}, "the file none.csv does not exist"),
        ({"kind": "table", "file": "road.csv", "columns": ("t", "w")}, "column 'w' does not exist"),
        ({"kind": "table", "file": "road.csv", "columns": ("t", "note")}, "'dry' is not a number"),
    ],
)
def test_a_wrong_file_of_an_input_in_python_is_refused(
    fields: dict, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "road.csv").write_text("t,u,note\n0,1,dry\n2,3,dry\n", encoding="utf-8")
    with pytest.raises(hs.HybridsimError) as caught:
        hs.Input("u", **fields)
    assert message in caught.value.message


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "scipy-radau", "cvode-bdf"])
def test_a_table_may_hold_its_values(integrator: str) -> None:
    """u = 2 until t = 1, then -1 until t = 3, then 4; x' = u - x has a closed form on each piece."""
    held = hs.Input("u", "table", times=[0, 1, 3], values=[2, -1, 4], interpolation="previous")
    model = hs.Model("m", states=[hs.State("x", 0, "u - x")], inputs=[held]).validate()
    assert hs.Model.from_toml(model.to_toml()) == model
    sol = hs.simulate(model, (0, 4), integrator=integrator, rtol=1e-10)
    assert (sol.output("u", 1.0, side="-"), sol.output("u", 1.0), sol.output("u", 2.9)) == (2.0, -1.0, -1.0)
    x1 = 2 * (1 - math.exp(-1))
    x3 = -1 + (x1 + 1) * math.exp(-2)
    assert sol.output("x", 3.0) == pytest.approx(x3, abs=1e-8)
    assert sol.output("x", 4.0) == pytest.approx(4 + (x3 - 4) * math.exp(-1), abs=1e-8)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ([0, 1, 1], "the time 1.0 occurs more than once"),
        ([0, 2, 1], "the times decrease from 2.0 to 1.0 at point 2"),
    ],
)
def test_a_table_that_holds_its_values_needs_increasing_times(times: list, message: str) -> None:
    held = hs.Input("u", "table", times=times, values=[2, -1, 4], interpolation="previous")
    with pytest.raises(hs.ModelError, match=message):
        hs.Model("m", states=[hs.State("x", 0, "u - x")], inputs=[held]).validate()


def test_times_of_a_table_in_milliseconds(tmp_path: Path) -> None:
    """The integral over 2 s of a table that rises from 0 to 6 is 6; with the times as seconds it would be 6e-3."""
    model = load(tmp_path, TABLE + 'time_unit = "ms"', "0,0\n999,2.997\n2000,6\n")
    signal = model.inputs[0]
    assert (signal.times, signal.time_unit) == ((0.0, 0.999, 2.0), "s")
    assert hs.Model.from_toml(model.to_toml()) == model
    assert hs.simulate(model, (0, 2), integrator="taylor").y[0, -1] == pytest.approx(6, rel=1e-12)
    same = hs.Input("u", "table", file=tmp_path / "road.csv", time_unit="ms")
    assert same == signal
    steps = hs.Input("u", "table", times=[0, 1], values=[1, 2], interpolation="previous", time_unit="min")
    assert steps.times == (0.0, 60.0, 60.0)


@pytest.mark.parametrize(
    ("declaration", "message"),
    [
        ('kind = "table"\ntimes = [0, 1]\nvalues = [0, 1]\ntime_unit = "mm"', "'time_unit' cannot be 'mm'"),
        (
            'kind = "table"\ntimes = [0, 1]\nvalues = [0, 1]\ntime_unit = 3',
            "'time_unit' cannot be a number (3)",
        ),
        ('kind = "wave"\nshape = "sine"\nperiod = 1\ntime_unit = "ms"', "unknown key 'time_unit'"),
    ],
)
def test_wrong_units_of_times(declaration: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(hs.ModelError) as caught:
        load(tmp_path, declaration)
    assert message in str(caught.value)
    assert caught.value.place is not None and caught.value.place.line is not None


def test_wrong_units_of_times_in_python() -> None:
    with pytest.raises(hs.UsageError, match="`time_unit` cannot be 'mm'"):
        hs.Input("u", "table", times=[0, 1], values=[0, 1], time_unit="mm")
    wave = hs.Input("u", "wave", shape="sine", period=1, time_unit="ms")
    with pytest.raises(hs.ModelError, match="input u of kind wave cannot have 'time_unit'"):
        hs.Model("m", states=[hs.State("x", 0, "u")], inputs=[wave]).validate()


def test_a_model_in_another_unit_of_time_is_warned_of(tmp_path: Path) -> None:
    table = 'kind = "table"\ntimes = [0, 60]\nvalues = [0, 1]\nunit = "m/h"\ntime_unit = "min"\n'
    for unit, count in (("h", 1), ("s", 0)):
        text = HEAD.replace("start = 0", 'start = 0, unit = "m"') + table.replace("m/h", f"m/{unit}")
        found = warnings_of(hs.Model.from_toml(text))
        assert [("its times are in s, but t is in h" in caution.message) for caution in found] == [
            True
        ] * count
