"""What is told of the scenes: each has its class, title, cause and paragraph, and nothing is told of others."""

from __future__ import annotations

import pytest

from hybridsim.testing import SCENES, TROUBLES, Scene
from hybridsim.testing.stories import read


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.name)
def test_every_scene_is_told_of(scene: Scene) -> None:
    assert scene.trouble in TROUBLES
    assert scene.title[0].isupper() or not scene.title[0].isalpha()
    assert not scene.title.endswith(".")
    assert len(scene.cause.split()) > 1
    assert scene.story.endswith(".")


def test_nothing_is_told_of_scenes_that_do_not_exist() -> None:
    assert set(read()) == {scene.name for scene in SCENES}


def test_there_are_many_scenes_of_every_class() -> None:
    assert len(SCENES) >= 60
    assert {scene.trouble for scene in SCENES} == set(TROUBLES)
    assert len({scene.title for scene in SCENES}) == len(SCENES)
