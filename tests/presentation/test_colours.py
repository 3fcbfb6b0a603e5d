"""Modes have their colours by name: the same in every model, picture and notebook."""

from __future__ import annotations

import itertools

import pytest

import hybridsim as hs
from hybridsim.presentation.colours import INK, PALETTE, mode_colours

COMMON = {
    "stick": INK, "rest": INK, "slip+": PALETTE[0], "slip-": PALETTE[1], "open": PALETTE[2], "closed": PALETTE[6],
}  # fmt: skip


@pytest.mark.parametrize("name", [info.name for info in hs.list_models()])
def test_names_that_several_models_use_have_one_colour(name: str) -> None:
    components = hs.load(name).all_components()
    colours = mode_colours(components)
    assert {mode: COMMON[mode] for mode in colours if mode in COMMON} == {
        mode: colour for mode, colour in colours.items() if mode in COMMON
    }
    for component in components:  # within a component no two modes look alike
        modes = [mode.name for mode in component.modes]
        assert all(colours[a] != colours[b] for a, b in itertools.combinations(modes, 2)), modes


def test_a_law_with_modes_looks_like_a_law_with_a_surface() -> None:
    jenkins, coulomb = (mode_colours(hs.load(name).all_components()) for name in ("blade-damper", "dfcs"))
    assert jenkins == coulomb


def test_stick_and_closed_differ() -> None:
    colours = mode_colours(hs.load("thrown-block").all_components())
    assert len({colours[name] for name in ("stick", "closed", "open", "slip+", "slip-")}) == 5
