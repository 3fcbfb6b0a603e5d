"""What lowering refuses is told with file and line, in the model's own words."""

from __future__ import annotations

import pytest

import hybridsim as hs
from hybridsim.engine.lowering.lower import Lowering
from hybridsim.errors import ModelError

STATES = """schema = 1
name = "m"
[states]
x = {{ start = 0, der = "v" }}
v = {{ start = 0, der = "{force}" }}
"""
CONTACT = '[contacts.{name}]\nvelocity = "{velocity}"\nnormal = "1"\nlaw = {{ name = "coulomb", mu = 0.5 }}\n'


@pytest.mark.parametrize(
    ("force", "velocity", "says"),
    [
        ("-x", "v", "the force f does not act on the relative velocity 'v'"),
        ("-x - f**2", "v", "f enters the motion of f nonlinearly"),
        ("-x - f", "v*x", r"f: the relative velocity 'v\*x' is not linear in any state"),
    ],
)
def test_a_contact_that_cannot_hold(force: str, velocity: str, says: str) -> None:
    text = STATES.format(force=force) + CONTACT.format(name="f", velocity=velocity)
    with pytest.raises(ModelError, match=says) as caught:
        Lowering(hs.Model.from_toml(text, path="m.toml")).lower()
    assert str(caught.value).startswith("m.toml:7: ")
    assert caught.value.remedy and "v_v" not in str(caught.value)


def test_two_contacts_on_one_velocity() -> None:
    text = STATES.format(force="-x - f - g")
    text += CONTACT.format(name="f", velocity="v") + CONTACT.format(name="g", velocity="v")
    with pytest.raises(ModelError, match="relative velocities of f, g are not independent") as caught:
        Lowering(hs.Model.from_toml(text, path="m.toml")).lower()
    assert str(caught.value).startswith("m.toml:7: ")


def test_a_force_that_drives_its_contact() -> None:
    text = STATES.format(force="f - x") + CONTACT.format(name="f", velocity="v")
    with pytest.raises(ModelError, match="acts along the relative velocity") as caught:
        hs.simulate(hs.Model.from_toml(text, path="m.toml"), (0, 1))
    assert str(caught.value).startswith("m.toml:6: ")
