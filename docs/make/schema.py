"""Writes the JSON Schema of model files, by which editors complete and check them, into the package.

python docs/make/schema.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hybridsim.model.elements.element import KINDS as ELEMENTS
from hybridsim.model.parts.shape import KINDS

FILE = Path(__file__).parents[2] / "hybridsim" / "model" / "toml" / "model.schema.json"

Schema = dict[str, Any]


def said(text: str, schema: Schema) -> Schema:
    """A schema with what an editor shows."""
    return {"description": text, **schema}


def table(keys: Schema, needed: tuple[str, ...] = ()) -> Schema:
    """A table of these keys alone."""
    found: Schema = {"type": "object", "properties": keys, "additionalProperties": False}
    return found | ({"required": list(needed)} if needed else {})


def named(entry: Schema, text: str) -> Schema:
    """A table of entries under names of the author's choice."""
    word = "[A-Za-z_][A-Za-z_0-9]*"  # words with dots between them are names in parts
    names = {"pattern": f"^{word}(\\.{word})*$"}
    return said(text, {"type": "object", "propertyNames": names, "additionalProperties": entry})


def short(value: Schema, whole: Schema) -> Schema:
    """A value that stands for a table with it alone."""
    return {"anyOf": [value, whole]}


TEXT, NUMBER, FLAG = {"type": "string"}, {"type": "number"}, {"type": "boolean"}
EXPRESSION = {"type": ["number", "string"]}
EXPRESSIONS = {"type": "object", "additionalProperties": EXPRESSION}
DIRECTION = {"enum": ["up", "down", "both"]}
NUMBERS = {"type": "array", "items": NUMBER}
UNIT = said("the unit, for labels and for the check of units", TEXT)
START = said("the initial value", EXPRESSION)
NOMINAL = said("the usual size; the absolute tolerance follows it", NUMBER)

STATE = table(
    {"start": START, "der": said("its rate", EXPRESSION), "unit": UNIT, "nominal": NOMINAL, "title": TEXT},
    ("start", "der"),
)
STATE_OF_LAW = table(
    {"start": START, "der": said("its rate", EXPRESSION), "unit": UNIT, "nominal": NOMINAL}, ("der",)
)
CHOICE = table(
    {
        "to": said("the mode that follows", TEXT),
        "when": said("the condition under which this choice is taken", EXPRESSION),
        "reset": said('states and discrete states that jump, and to what; "+= amount" adds', EXPRESSIONS),
    },
    ("to",),
)
CHOICES = {"type": "array", "items": {"anyOf": [TEXT, CHOICE]}}
GUARD = table(
    {
        "expr": said("what stays at or above zero while the mode lasts", EXPRESSION),
        "then": said("choices; the first whose condition holds is taken", {"anyOf": [TEXT, CHOICE, CHOICES]}),
        "fatal": said("stop the run with this message", TEXT),
        "direction": said("fire only where it crosses zero in this direction", DIRECTION),
    },
    ("expr",),
)  # fmt: skip
MODE = table(
    {
        "guards": named(short(EXPRESSION, GUARD), "what ends the mode"),
        "der": said("rates that hold in this mode in place of those of [states]", EXPRESSIONS),
        "set": said("variables of the component, in every mode the same names", EXPRESSIONS),
        "initial": said("whether the component starts here", FLAG),
    }
)
MODES = {"type": "object", "additionalProperties": MODE, "description": "the modes of an automaton, by name"}
INITIAL = said("the mode in which the automaton starts", TEXT)
SURFACE_OF_COMPONENT = table(
    {
        "function": said("zero on the surface", EXPRESSION),
        "unknown": said("the variable that holding solves for", TEXT),
        "above": TEXT, "below": TEXT, "hold": TEXT,
        "jump_above": EXPRESSION, "jump_below": EXPRESSION,
        "unique": said("whether holding has no priority, as on a switching surface", FLAG),
        "restitution": said("of impacts, where there is no mode below", EXPRESSION),
    },
    ("function", "unknown", "above", "hold", "jump_above", "jump_below"),
)  # fmt: skip
LIMIT = said(
    "where to go, after which reset, where its transitions accumulate",
    {"anyOf": [TEXT, table({"to": TEXT, "reset": EXPRESSIONS}, ("to",))]},
)
COMPONENT = table(
    {"modes": MODES, "initial": INITIAL, "surface": SURFACE_OF_COMPONENT, "limit": LIMIT}, ("modes",)
)
CSV = said("a CSV beside the model", TEXT)
POINTS = table(
    {
        "at": NUMBERS, "file": CSV, "columns": {"type": "array"},
        "values": said("one value, or with `across` one row, for each number in `at`", {"type": "array"}),
        "over": said("the argument; the speed v if not given", TEXT),
        "interpolation": {"enum": ["cubic", "linear"]},
        "across": said("the second argument of a table of two", TEXT), "across_at": NUMBERS, "unit": UNIT,
    }
) | {"anyOf": [{"required": ["at", "values"]}, {"required": ["file"]}]}  # fmt: skip
PARAMETER_OF_LAW = short(EXPRESSION, table({"value": said("its default", EXPRESSION), "unit": UNIT}))
DEFAULTS = {"type": "object", "additionalProperties": PARAMETER_OF_LAW}
NAMES = {"type": "array", "items": {"anyOf": [TEXT, DEFAULTS]}}
LAW = table(
    {
        "title": TEXT, "source": TEXT,
        "parameters": said("names, or names with defaults and units", {"anyOf": [NAMES, DEFAULTS]}),
        "slip": said("magnitude of the force at the speed v >= 0 under the load N", EXPRESSION),
        "stick": said("largest force at rest", EXPRESSION),
        "slip_backward": said("slip, where the other direction differs", EXPRESSION),
        "stick_backward": said("stick, where the other direction differs", EXPRESSION),
        "force": said("a single force with its sign, in place of slip and stick", EXPRESSION),
        "states": named(short(EXPRESSION, STATE_OF_LAW), "states of the law itself"),
        "definitions": EXPRESSIONS,
        "modes": MODES, "initial": INITIAL,
        "copies": said("the parameter that says how many copies act in parallel", TEXT),
        "tables": named(POINTS, "functions given by points"),
    }
)  # fmt: skip
NAMED_LAW = {
    "type": "object", "properties": {"name": TEXT}, "required": ["name"], "additionalProperties": EXPRESSION,
}  # fmt: skip
LAW_OF_FILE = {
    "type": "object", "properties": {"file": said("a file with one law", TEXT)}, "required": ["file"],
    "additionalProperties": EXPRESSION,
}  # fmt: skip
ANY_LAW = {"anyOf": [TEXT, NAMED_LAW, LAW_OF_FILE]}
CONTACT = table(
    {
        "velocity": said("the relative velocity", EXPRESSION),
        "normal": said("the normal load", EXPRESSION),
        "law": said("the law's name or file, with its arguments", ANY_LAW),
        "opens": said("whether it lifts off where the load would be negative", FLAG),
        "start": said("initial values of the law's states", EXPRESSIONS),
        "nominal": said("usual sizes of the law's states", {"type": "object", "additionalProperties": NUMBER}),
    },
    ("velocity", "normal", "law"),
)  # fmt: skip
SWITCHING = table(
    {
        "expr": said("positive on one side, negative on the other", EXPRESSION),
        "above": said("values of variables where it is positive", EXPRESSIONS),
        "below": said("values of the same variables where it is negative", EXPRESSIONS),
    },
    ("expr",),
)
IMPACT = table(
    {
        "gap": said("what cannot become negative, over positions", EXPRESSION),
        "restitution": said("from 0 to 1; it may use the speed of approach, `speed`", EXPRESSION),
    },
    ("gap", "restitution"),
)
MONITOR = table(
    {
        "expr": said("the scalar to watch", EXPRESSION),
        "direction": DIRECTION,
        "action": {"enum": ["record", "terminate", "reset"]},
        "reset": EXPRESSIONS,
    },
    ("expr",),
)
TIMES = {"anyOf": [EXPRESSION, {"type": "array", "items": EXPRESSION}]}
SCHEDULE = table(
    {
        "times": TIMES, "start": EXPRESSION, "period": EXPRESSION, "count": {"type": "integer"},
        "reset": EXPRESSIONS, "terminate": FLAG,
    }
)  # fmt: skip
CLOCK = table(
    {
        "period": said("between ticks", EXPRESSION),
        "offset": said("of the first tick", EXPRESSION),
        "set": EXPRESSIONS,
    },
    ("period",),
)
WAVE = {
    "kind": {"const": "wave"}, "shape": {"enum": ["square", "triangle", "sawtooth", "sine"]}, "period": EXPRESSION,
    "amplitude": EXPRESSION, "phase": EXPRESSION, "offset": EXPRESSION, "duty": EXPRESSION, "unit": UNIT,
}  # fmt: skip
CHIRP = {
    "kind": {"const": "chirp"}, "f0": EXPRESSION, "f1": EXPRESSION, "duration": EXPRESSION, "amplitude": EXPRESSION,
    "phase": EXPRESSION, "unit": UNIT,
}  # fmt: skip
CONNECTED = {"kind": {"const": "connected"}, "unit": UNIT}
HELD = {"kind": {"const": "held"}, "value": said("until it is set from outside", EXPRESSION), "unit": UNIT}
POINTS_IN_TIME = {
    "kind": {"const": "table"}, "times": NUMBERS, "values": NUMBERS, "file": CSV,
    "columns": {"type": "array"}, "interpolation": {"enum": ["linear", "cubic", "previous"]}, "unit": UNIT,
    "time_unit": said("unit of the times, which are converted to seconds", TEXT),
    "phase": said("a delay", EXPRESSION),
}  # fmt: skip
INPUT = {"oneOf": [table(keys, ("kind",)) for keys in (WAVE, CHIRP, POINTS_IN_TIME, HELD, CONNECTED)]}
OF_ELEMENT = {
    "input": said("what it follows", EXPRESSION), "on": said("level at which the relay switches on", EXPRESSION),
    "off": said("level at which it switches off, below on", EXPRESSION), "high": said("value while on", EXPRESSION),
    "low": said("value while off", EXPRESSION), "initial": {"enum": ["on", "off"]}, "lower": EXPRESSION,
    "upper": EXPRESSION, "width": said("total play", EXPRESSION), "start": START,
    "step": said("distance of its values", EXPRESSION), "time": said("delay of a table or wave", EXPRESSION),
    "clock": said("the clock or schedule whose ticks delay the input", TEXT), "ticks": {"type": "integer"},
}  # fmt: skip


def element(kind: str) -> Schema:
    """An element of one kind."""
    required, optional = ELEMENTS[kind]
    return table(
        {"kind": {"const": kind}, **{key: OF_ELEMENT[key] for key in (*required, *optional)}},
        ("kind", *required),
    )


OUTPUT = table(
    {
        "expr": EXPRESSION,
        "unit": UNIT,
        "modes": said('"component.mode" = the expression there', EXPRESSIONS),
        "title": TEXT,
    },
    ("expr",),
)
PARAMETER = table({"value": EXPRESSION, "unit": UNIT, "title": TEXT}, ("value",))
POINT = {"type": "array", "items": EXPRESSION, "minItems": 2, "maxItems": 2}
OF_SHAPE = {
    "at": said("the point where it is", POINT),
    "ends": said("points, or names of other shapes", {"type": "array", "items": {"anyOf": [TEXT, POINT]}}),
    "points": said("corners", {"type": "array", "items": POINT}),
    "vector": said("extent in x and y", POINT),
    "size": said("diameter or width, or width and height", {"anyOf": [EXPRESSION, POINT]}),
    "length": EXPRESSION, "angle": said("in radians, counter-clockwise", EXPRESSION),
    "twist": said("angle of the second end against the first", EXPRESSION),
    "travel": said("distance that the belt has moved to the right", EXPRESSION),
    "level": said("height of the water", EXPRESSION),
    "offset": said("sideways, to draw two next to each other", EXPRESSION),
    "mode_of": said("the contact or component whose mode gives the colour", TEXT), "text": TEXT,
}  # fmt: skip


def shape(kind: str) -> Schema:
    """A shape of one kind."""
    required, optional = KINDS[kind]
    return table(
        {"kind": {"const": kind}, **{key: OF_SHAPE[key] for key in (*required, *optional)}},
        ("kind", *required),
    )


DISCRETE = table({"start": START, "unit": UNIT, "title": TEXT}, ("start",))

# a value for all copies of a part, one for each copy, or a table of the names of an inner part
VALUES = {
    "type": "object",
    "additionalProperties": {
        "anyOf": [EXPRESSION, {"type": "array", "items": EXPRESSION}, {"type": "object"}]
    },
}
# a law for all copies of a part, one for each copy, or a table of the names of an inner part
LAWS_OF_USE = {
    "type": "object",
    "additionalProperties": {"anyOf": [ANY_LAW, {"type": "array", "items": ANY_LAW}, {"type": "object"}]},
}
USE = table(
    {
        "model": said("the file of the part, or the name of a packaged model", TEXT),
        "parameters": said("new values of parameters of the part", VALUES),
        "start": said("new initial values of states of the part", VALUES),
        "connect": said("what each connected input of the part receives", VALUES),
        "laws": said("new laws of contacts of the part", LAWS_OF_USE),
        "repeat": said("how many copies, NAME1, NAME2, ...; i is the number of a copy", {"type": "integer"}),
    },
    ("model",),
)

MODEL = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "hybridsim model",
    **table(
        {
            "schema": said("the version of this form", {"const": 1}),
            "name": TEXT, "title": TEXT, "source": TEXT, "description": TEXT,
            "look": said("what to look at when it runs", TEXT),
            "duration": said("how long to look", EXPRESSION),
            "use": named(USE, "other models as parts; their names become NAME.x"),
            "parameters": named(short(EXPRESSION, PARAMETER), "numbers, or expressions of other parameters"),
            "states": named(STATE, "what the equations integrate"),
            "discrete": named(short(EXPRESSION, DISCRETE), "what only resets and ticks change"),
            "definitions": said("named parts of expressions", EXPRESSIONS),
            "inputs": named(INPUT, "known signals of time"),
            "elements": named(
                {"oneOf": [element(kind) for kind in ELEMENTS]}, "relays, limits, play, steps and delays"
            ),
            "laws": said("friction laws", {"type": "object", "additionalProperties": LAW}),
            "contacts": named(CONTACT, "friction contacts; the name is the force"),
            "surfaces": named(short(EXPRESSION, SWITCHING), "switching surfaces; the name is the sign"),
            "impacts": named(IMPACT, "unilateral contacts; the name is the normal force"),
            "initial": INITIAL, "limit": LIMIT, "modes": MODES,
            "components": named(COMPONENT, "automata"),
            "monitors": named(short(EXPRESSION, MONITOR), "scalars watched for zeros"),
            "schedules": named(short(TIMES, SCHEDULE), "events at known times"),
            "clocks": named(CLOCK, "events at equal distances"),
            "outputs": named(short(EXPRESSION, OUTPUT), "what to look at"),
            "drawing": said(
                "shapes that show the mechanism, by name",
                {"type": "object", "additionalProperties": {"oneOf": [shape(kind) for kind in KINDS]}},
            ),
        }
    ),
}  # fmt: skip


def text() -> str:
    """The file."""
    return json.dumps(MODEL, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
    print(FILE)
