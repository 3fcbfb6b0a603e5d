"""The atlas: results of every integrator in every test case, with the reasons of failures."""

from hybridsim.testing.atlas.cell import Cell, Row
from hybridsim.testing.atlas.configurations import Configuration, configurations
from hybridsim.testing.atlas.example import Example, example
from hybridsim.testing.atlas.matrix import Atlas, atlas, described, listing, scenes_named
from hybridsim.testing.atlas.pages import pages
from hybridsim.testing.verdict import VERDICTS

__all__ = [
    "VERDICTS",
    "Atlas",
    "Cell",
    "Configuration",
    "Example",
    "Row",
    "atlas",
    "configurations",
    "described",
    "example",
    "listing",
    "pages",
    "scenes_named",
]
