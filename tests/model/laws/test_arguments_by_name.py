"""An argument of a friction law is set by the name of its contact: brake.mu."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.cli.entry import main

BLOCK = """[parameters]
grip = 0.3
[states]
x = { start = 0, der = "v" }
v = { start = 2, der = "-brake" }
[contacts.brake]
velocity = "v"
normal = 10
law = { name = "viscous", mu = 0.1, c = "grip" }
"""


def stop(mu: float) -> float:
    """The time in which a block of mass 1 with the speed 2 stops under the load 10, with c = 0."""
    return 2 / (10 * mu)


def test_an_argument_is_set_in_every_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("block.toml").write_text(BLOCK, encoding="utf-8")
    model = hs.load("block.toml")
    changed = model.with_(**{"brake.mu": 0.4, "brake.c": 0, "grip": 5})
    assert changed.contacts[0].values()["mu"].text == "0.4" and changed.parameter_values() == {"grip": 5}
    assert model.contacts[0].arguments["mu"].text == "0.1"
    params = {"brake.mu": 0.4, "brake.c": 0}
    assert hs.simulate(model, (0, 3), params=params).event_times("brake")[0] == pytest.approx(stop(0.4))
    assert (
        main(["run", "block.toml", "--t-end", "3", "-p", "brake.mu=grip+0.1", "-p", "brake.c=0", "--json"])
        == 0
    )
    events = json.loads(capsys.readouterr().out)["events"]
    assert events[0]["t"] == pytest.approx(stop(0.4))


def test_an_argument_of_a_part(tmp_path: Path) -> None:
    (tmp_path / "block.toml").write_text(BLOCK, encoding="utf-8")
    (tmp_path / "car.toml").write_text('[use]\nrear = { model = "block.toml" }\n', encoding="utf-8")
    changed = hs.load(tmp_path / "car.toml").with_(**{"rear.brake.mu": 0.4, "rear.grip": 0})
    assert changed.contacts[0].arguments["mu"].text == "0.4"
    assert changed.parameter_values() == {"rear.grip": 0}


@pytest.mark.parametrize(
    ("changes", "message", "remedy"),
    [
        ({"brake.nu": 1}, "no parameter 'brake.nu'", "did you mean 'brake.mu'"),
        ({"brak.mu": 1}, "no parameter 'brak.mu'", "did you mean 'brake.mu'"),
        ({"mu": 1}, "no parameter 'mu'", "with the value 0.1; write brake.mu"),
        ({"c": 1}, "no parameter 'c'", "contact brake has 'c = grip'; change 'grip'"),
        ({"brake.mu": "nu"}, "contact brake, law argument mu: unknown name 'nu'", "known names"),
        ({"brake.mu": [1]}, "argument brake.mu cannot be \\[1\\]", "use a number or an expression"),
    ],
)
def test_what_is_refused(changes: dict[str, object], message: str, remedy: str) -> None:
    with pytest.raises(hs.HybridsimError, match=message) as caught:
        hs.Model.from_toml(BLOCK).with_(**changes)  # type: ignore[arg-type]  # wrong on purpose
    assert remedy in str(caught.value.remedy)


def test_a_sweep_over_an_argument_names_the_way_round() -> None:
    with pytest.raises(hs.UsageError) as caught:
        hs.sweep(hs.Model.from_toml(BLOCK), {"brake.mu": [0.1, 0.2]}, "final.x", t_span=(0, 1))
    assert 'declare a parameter, mu = 0.1 under [parameters], and write law = { ..., mu = "mu" }' in str(
        caught.value.remedy
    )
