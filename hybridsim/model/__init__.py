"""Model declarations: models and their parts, read from TOML or built in Python, without numerics."""

from hybridsim.model.component import Choice, Component, Guard, Mode, Surface
from hybridsim.model.contact import Contact
from hybridsim.model.frozen_map import FrozenMap
from hybridsim.model.impact import Impact
from hybridsim.model.inputs import Input
from hybridsim.model.law import FrictionLaw
from hybridsim.model.law_table import LawTable
from hybridsim.model.library import ModelInfo, list_laws, list_models, load, load_law
from hybridsim.model.model import Model
from hybridsim.model.monitor import Monitor
from hybridsim.model.quantities import Discrete, Output, Parameter, State
from hybridsim.model.schedule import Schedule
from hybridsim.model.switching import SwitchingSurface

__all__ = [
    "Choice",
    "Component",
    "Contact",
    "Discrete",
    "FrictionLaw",
    "FrozenMap",
    "Guard",
    "Impact",
    "Input",
    "LawTable",
    "Mode",
    "Model",
    "ModelInfo",
    "Monitor",
    "Output",
    "Parameter",
    "Schedule",
    "State",
    "Surface",
    "SwitchingSurface",
    "list_laws",
    "list_models",
    "load",
    "load_law",
]
