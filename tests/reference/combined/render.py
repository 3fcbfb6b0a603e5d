"""A model file of an abstract model, in one of many equal ways to write it."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from .forms import Abstract, Node, constant


def decimal(value: Fraction | float) -> str:
    """A number as a person writes it."""
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


@dataclass
class Style:
    """The choices of syntax of one rendering."""

    seed: int
    scales: dict[str, Fraction] = field(default_factory=dict)  # of states
    shift: Fraction = Fraction(0)  # of time
    signs: float = 0.4  # share of the relays that are written as signs in the rates
    named: float = 0.0  # share of the parts of expressions that are definitions
    plain: bool = False  # everything in its first form: for small reproductions


class Renderer:
    """Writes one abstract model; `names` says what each of its names is called in the file."""

    def __init__(self, model: Abstract, style: Style, names: dict[str, str] | None = None):
        self.m, self.style = model, style
        self.rng = random.Random(style.seed)
        self.names = names or {}
        self.parameters: dict[str, str] = {}
        self.definitions: dict[str, str] = {}
        self.discrete: dict[str, str] = {}
        self.inputs: dict[str, str] = {}
        self.signs = {r for r in model.relays if self.rng.random() < style.signs}  # relays written as signs
        self.of_number: dict[
            str, tuple[str, str]
        ] = {}  # text anywhere; text where parameters alone may stand

    # -- numbers ---------------------------------------------------------------------------------------------------

    def declare_numbers(self) -> None:
        for key, number in self.m.numbers.items():
            name, form = self.called(key), "parameter" if self.style.plain else number.written
            if number.value is not None and form not in ("input",):
                self.of_number[key] = (decimal(number.value),) * 2
                continue
            if form == "input":
                assert number.value is not None
                end = float(self.m.duration) + float(self.style.shift) + 1
                start = float(self.style.shift) - 1
                self.inputs[name] = (
                    f'kind = "table"\ntimes = [{start}, {end}]\nvalues = [{float(number.value)}, {float(number.value)}]'
                )
                self.of_number[key] = (name, decimal(number.value))
                continue
            self.parameters[name] = ""
            plain = name
            if form == "expression":
                plain = self.pick(f"({name} + 0)", f"(2*{name} - {name})", f"({name}*1.0)", f"(3*{name}/3)")
            text = plain
            if form == "definition":
                text = name + "_def"
                self.definitions[text] = self.pick(name, f"2*{name}/2", f"{name} + 0")
            elif form == "discrete":
                text = name + "_held"
                self.discrete[text] = name
            elif form == "derived":
                text = plain = name + "_par"
                self.parameters[text] = f'"2*{name}/2"'
            self.of_number[key] = (text, plain)

    def values(self, numbers: dict[str, Fraction]) -> dict[str, float]:
        """Parameter values of a set of numbers."""
        return {
            self.called(k): float(v) for k, v in numbers.items() if self.parameters.get(self.called(k)) == ""
        }

    def called(self, name: str) -> str:
        return self.names.get(name, name)

    def pick(self, *texts: str) -> str:
        return texts[0] if self.style.plain else self.rng.choice(texts)

    # -- expressions -----------------------------------------------------------------------------------------------

    def text(self, e: Node, plain: bool = False) -> str:
        """An expression, in brackets where it needs them, or the name of a definition of it."""
        text = self.spelled(e, plain)
        if plain or len(text) < 10 or self.rng.random() >= self.style.named:
            return text
        self.definitions[f"part{len(self.definitions)}"] = text
        return f"part{len(self.definitions) - 1}"

    def spelled(self, e: Node, plain: bool = False) -> str:
        op, a = e.op, e.args
        if op == "const":
            return decimal(a[0]) if a[0].denominator != 1 or a[0] < 0 else str(a[0])
        if op == "num":
            return self.of_number[a[0]][plain]
        if op == "var":
            name = self.called(a[0])
            if a[0] in self.signs:
                s = self.text(self.m.relays[a[0]])
                return self.pick(f"sign({s})", f"(1 if {s} > 0 else -1)", f"(-1 if {s} < 0 else 1)")
            scale = self.style.scales.get(a[0])
            return f"({decimal(scale)}*{name})" if scale else name
        if op == "t":
            return f"(t - {decimal(self.style.shift)})" if self.style.shift else "t"
        if op == "table":
            return self.called(a[0])
        if op == "window":
            test, swapped = self.test(a[0]), self.rng.random() < 0.3 and not self.style.plain
            one, two = self.text(a[1], plain), self.text(a[2], plain)
            return f"({two} if not ({test}) else {one})" if swapped else f"({one} if {test} else {two})"
        x = self.text(a[0], plain)
        if op == "neg":
            return f"(-{x})"
        if op == "abs":
            return self.pick(
                f"abs({x})",
                f"abs(-{x})",
                f"max({x}, -{x})",
                f"max(-{x}, {x})",
                f"(-min({x}, -{x}))",
                f"({x} if {x} > 0 else -{x})",
                f"(-{x} if {x} < 0 else {x})",
                f"(sign({x})*{x})",
            )
        if op in ("sin", "cos", "sqrt"):
            return f"{op}({x})"
        if op == "if":
            one, two = self.text(a[1], plain), self.text(a[2], plain)
            return self.pick(
                f"({one} if {x} > 0 else {two})",
                f"({two} if {x} <= 0 else {one})",
                f"({two} if not {x} > 0 else {one})",
                f"({one} if 0 < {x} else {two})",
                f"({two} if {x} < 0 else {one})",
            )
        y = self.text(a[1], plain)
        if op in ("max", "min"):
            other = "min" if op == "max" else "max"
            compare = ">" if op == "max" else "<"
            return self.pick(
                f"{op}({x}, {y})",
                f"{op}({y}, {x})",
                f"(-{other}(-{x}, -{y}))",
                f"({x} if {x} {compare} {y} else {y})",
                f"({y} if {y} {compare}= {x} else {x})",
                f"(0.5*({x} + {y} {'+' if op == 'max' else '-'} abs({x} - {y})))",
            )
        if op in ("add", "mul"):
            sign = "+" if op == "add" else "*"
            return self.pick(f"({x} {sign} {y})", f"({y} {sign} {x})")
        return f"({x} {'-' if op == 'sub' else '/'} {y})"

    def test(self, c: tuple[Any, ...]) -> str:
        """A condition on time."""
        kind = c[0]
        if kind in ("and", "or"):
            one, two = self.test(c[1]), self.test(c[2])
            if kind == "and" and c[1][0] == "after" and c[2][0] == "before" and self.rng.random() < 0.4:
                t = self.text(Node("t"))
                return f"{self.text(c[1][1])} <= {t} < {self.text(c[2][1])}"
            return self.pick(f"({one} {kind} {two})", f"({two} {kind} {one})")
        if kind == "not":
            return f"not ({self.test(c[1])})"
        t, at = self.text(Node("t")), self.text(c[1])
        if kind == "near":
            return f"abs({t} - {at}) < {self.text(c[2])}"
        if kind == "after":
            return self.pick(f"{t} >= {at}", f"{t} > {at}", f"{at} <= {t}", f"not {t} < {at}")
        return self.pick(f"{t} < {at}", f"{t} <= {at}", f"{at} > {t}")

    # -- the file --------------------------------------------------------------------------------------------------

    def scaled(self, name: str, e: Node, plain: bool = False) -> str:
        """The text of a value of a state, in its own scale."""
        scale = self.style.scales.get(name)
        text = self.text(e, plain)
        return f"{text}/{decimal(scale)}" if scale else text

    def resets(self, reset: dict[str, Node], adds: dict[str, Node]) -> str:
        """A table of resets, those that add among them."""
        entries = [f'{self.called(k)} = "{self.scaled(k, e)}"' for k, e in reset.items()]
        entries += [f'{self.called(k)} = "+= {self.scaled(k, e)}"' for k, e in adds.items()]
        self.shuffle(entries)
        return "{ " + ", ".join(entries) + " }"

    def shuffle(self, items: list[Any]) -> None:
        if not self.style.plain:
            self.rng.shuffle(items)

    def time(self, e: Node) -> str:
        text = self.text(e, True)
        return f'"{text} + {decimal(self.style.shift)}"' if self.style.shift else f'"{text}"'

    def toml(self, numbers: dict[str, Fraction]) -> str:
        """The whole file, with one set of numbers as the declared values."""
        self.declare_numbers()
        m, sections = self.m, []
        for name, (times, values) in m.tables.items():
            if name in m.waves:
                shape, period, size = m.waves[name]
                wave = (
                    f'kind = "wave"\nshape = "{shape}"\nperiod = {float(period)}\namplitude = {float(size)}'
                )
                self.inputs[self.called(name)] = wave + f"\nphase = {float(self.style.shift)}"
                continue
            knots = [float(constant(e, numbers)) + float(self.style.shift) for e in times]
            heights = [float(constant(e, numbers)) for e in values]
            self.inputs[self.called(name)] = f'kind = "table"\ntimes = {knots}\nvalues = {heights}'
        for name, (start, rate) in m.states.items():
            begin, der = self.scaled(name, start, True), self.scaled(name, rate)
            text = f'{self.called(name)} = {{ start = "{begin}", der = "{der}" }}'
            sections.append(("states", text))
        for name, start in m.discrete.items():
            sections.append(("discrete", f'{self.called(name)} = "{self.text(start, True)}"'))
        for f, c in m.contacts.items():
            law = f'{{ name = "coulomb", mu = "{self.text(c.mu_s)}" }}'
            if c.mu_k:
                law = f'{{ name = "static-kinetic", mu_s = "{self.text(c.mu_s)}", mu_k = "{self.text(c.mu_k)}" }}'
            text = f'velocity = "{self.text(c.velocity)}"\nnormal = "{self.text(c.normal)}"\nlaw = {law}'
            sections.append((f"contacts.{self.called(f)}", text + ("\nopens = true" if c.opens else "")))
        for p, i in m.impacts.items():
            sections.append(
                (
                    f"impacts.{self.called(p)}",
                    f'gap = "{self.text(i.gap)}"\nrestitution = "{self.text(i.restitution)}"',
                )
            )
        for r, e in m.relays.items():
            if r in self.signs:
                continue
            sections.append((f"surfaces.{self.called(r)}", f'expr = "{self.text(e)}"'))
        for a, automaton in m.automata.items():
            sections += self.automaton(self.called(a), automaton)
        for w, monitor in m.monitors.items():
            text = f'expr = "{self.text(monitor.expr)}"\ndirection = "{monitor.direction}"\naction = "{monitor.action}"'
            if monitor.reset:
                text += f"\nreset = {self.resets(monitor.reset, {})}"
            sections.append((f"monitors.{self.called(w)}", text))
        for s, schedule in m.schedules.items():
            resets = self.resets(schedule.reset, schedule.adds)
            if schedule.period is None:
                times = ", ".join(self.time(e) for e in schedule.times)
                sections.append((f"schedules.{self.called(s)}", f"times = [{times}]\nreset = {resets}"))
            else:
                offset = self.time(schedule.times[0])
                text = f'period = "{self.text(schedule.period, True)}"\noffset = {offset}\nset = {resets}'
                sections.append((f"clocks.{self.called(s)}", text))
        return self.laid_out(sections, numbers)

    def automaton(self, name: str, automaton: Any) -> list[tuple[str, str]]:
        out = [(f"components.{name}", f'initial = "{automaton.initial}"')]
        for mode_name, mode in automaton.modes.items():
            lines = []
            for g, guard in mode.guards.items():
                choices = []
                for choice in guard.choices:
                    parts = [f'to = "{choice.to}"']
                    if choice.when is not None:
                        parts.insert(0, f'when = "{self.text(choice.when)} > 0"')
                    if choice.reset or choice.adds:
                        parts.append(f"reset = {self.resets(choice.reset, choice.adds)}")
                    choices.append("{ " + ", ".join(parts) + " }")
                lines.append(
                    f'guards.{g} = {{ expr = "{self.text(guard.expr)}", then = [{", ".join(choices)}] }}'
                )
            if mode.rates:
                lines.append(
                    "der = { "
                    + ", ".join(f'{self.called(k)} = "{self.scaled(k, e)}"' for k, e in mode.rates.items())
                    + " }"
                )
            if mode.sets:
                lines.append(
                    "set = { "
                    + ", ".join(f'{self.called(k)} = "{self.text(e)}"' for k, e in mode.sets.items())
                    + " }"
                )
            out.append((f"components.{name}.modes.{mode_name}", "\n".join(lines)))
        return out

    def laid_out(self, sections: list[tuple[str, str]], numbers: dict[str, Fraction]) -> str:
        values = self.values(numbers)
        lists: dict[str, list[str]] = {
            "parameters": [f"{k} = {text or values[k]}" for k, text in self.parameters.items()],
            "definitions": [f'{k} = "{text}"' for k, text in self.definitions.items()],
            "discrete": [f'{k} = "{text}"' for k, text in self.discrete.items()],
        }
        whole = [(f"inputs.{k}", text) for k, text in self.inputs.items()]
        for header, text in sections:
            if header in ("states", "discrete"):
                lists.setdefault(header, []).append(text)
            else:
                whole.append((header, text))
        for header, lines in lists.items():
            self.shuffle(lines)
            if lines:
                whole.append((header, "\n".join(lines)))
        self.shuffle(whole)
        return 'schema = 1\nname = "combined"\n' + "".join(f"\n[{h}]\n{text}\n" for h, text in whole)
