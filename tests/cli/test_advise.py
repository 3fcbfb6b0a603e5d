"""`hybridsim advise`: table, JSON, pictures, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

ASK = ("advise", "dfcs", "--quantity", "amplitude.x", "--rungs", "no-friction,viscous", "--no-integrators")


def test_a_table_and_a_picture(hybridsim: Callable, tmp_path: Path) -> None:
    code, out, err = hybridsim(*ASK, "-p", "F0=100", "--tol", "0.03", "--plot", "ladder.png")
    assert code == 0, err
    assert out.startswith("amplitude.x of dfcs within 0.03: no friction is enough")
    assert "by theory: inside the no-stop boundary" in out
    assert (tmp_path / "ladder.png").read_bytes().startswith(b"\x89PNG")


def test_a_map_as_json_and_picture(hybridsim: Callable, tmp_path: Path) -> None:
    over = ("--over", "F0=15:400:2", "omega=0.6*sqrt(k/m),sqrt(k/m)")
    code, out, err = hybridsim(*ASK, *over, "--json", "--plot", "map.png")
    assert code == 0, err
    found = json.loads(out)
    assert found["region"]["values"]["simplest"] == [["full model", "full model"], ["no-friction", "viscous"]]
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_ranges_are_expressions(hybridsim: Callable) -> None:
    code, out, err = hybridsim(*ASK, "-p", "F0=100", "--uncertain", "mu=0.8*mu:1.2*mu")
    assert code == 0, err
    assert "with mu in [0.4, 0.6]" in out


def test_what_is_refused(hybridsim: Callable) -> None:
    code, _, err = hybridsim("advise", "dfcs", "--quantity", "amplitud.x")
    assert code == 2 and "amplitude" in err
    code, _, err = hybridsim(*ASK, "--uncertain", "mu=0.3")
    assert code == 2 and "mu=LOW:HIGH" in err
