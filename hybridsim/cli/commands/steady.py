"""`hybridsim steady MODEL`: find the steady motion of a model and measure one period of it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import hybridsim
from hybridsim.cli import options, values
from hybridsim.cli.output import complain, print_json, say
from hybridsim.cli.progress import Progress
from hybridsim.cli.session import Session
from hybridsim.errors import SimulationError
from hybridsim.presentation.readable import aligned

if TYPE_CHECKING:
    from hybridsim.analysis import SteadyState

_NEUTRAL = 1e-6  # 1 minus the size of a multiplier: a smaller decay per period counts as none
_EXAMPLES = """\
examples:
  hybridsim steady dfcs
  hybridsim steady dfcs -p F0=22 -p 'omega=0.64*sqrt(k/m)' --harmonics 9 --plot orbit.png
  hybridsim steady belt --json
"""


def add_to(commands: Any) -> None:
    """Add the command `steady` to the parser."""
    parser = commands.add_parser(
        "steady",
        help="find the steady motion of a model and measure it",
        description="Find the steady motion of a model (forced vibration, limit cycle or rest) and print its period, "
        "amplitudes, energies, stick fractions and Floquet multipliers.",
        epilog=_EXAMPLES,
    )
    options.add_model_arguments(parser)
    options.add_integrator(parser)
    options.add(
        parser,
        "--tol",
        "TOL",
        "largest difference after one period, relative to the size of each state (default: 1e-10)",
        values.positive,
        default=1e-10,
    )
    options.add(
        parser,
        "--period",
        "TIME",
        "forcing period, if it cannot be determined from the model",
        values.positive,
    )
    options.add(
        parser,
        "--max-periods",
        "N",
        "give up after N periods and classify the motion (default: 4096)",
        values.count,
        default=4096,
    )
    options.add(
        parser, "--harmonics", "N", "number of harmonics to print (default: 5)", values.count, default=5
    )
    options.add_plot(parser, "one period")
    options.add_json(parser, "the result")
    parser.set_defaults(execute=execute, lighter="a looser --tol or fewer --max-periods")


def execute(args: argparse.Namespace, session: Session) -> int:
    """Find the steady motion and print it; the exit code is 1 if no steady motion was found."""
    options.check_plot(args)
    model = values.changed_model(args)

    with Progress(session) as progress:
        found = hybridsim.steady_state(
            model,
            integrator=args.integrator,
            tol=args.tol,
            period=args.period,
            max_periods=args.max_periods,
            progress=progress,
        )
    record = found.to_dict(args.harmonics)
    try:  # write files first: printing fails if the reader of the pipe has gone
        if args.plot and found.kind == "equilibrium":
            complain(f"an equilibrium does not vary over time, so {args.plot} is not written")
        elif args.plot:
            from hybridsim.plot import save, time_history

            save(time_history(found.solution), args.plot)
            session.wrote(args.plot)
    finally:
        if args.json:
            print_json(record)
        else:
            say("\n".join(_summary(found, record)))
    if not found.success:
        complain(found.message)
        return SimulationError.exit_code
    return 0


def _summary(found: SteadyState, record: dict[str, Any]) -> list[str]:
    from hybridsim.model.checks.units import time_unit, unit_of_work

    model = found.model
    lines = [f"{model.name}: {model.title}" if model.title else model.name, f"  {found.message}"]
    if not found.success:
        return lines
    if found.kind == "periodic":
        repeats = f" (x {found.multiple})" if found.multiple > 1 else ""
        lines.append(f"  period       {found.period:.12g} {time_unit(model)}".rstrip() + repeats)
    lines.append(f"  modes        {' '.join(found.word)}")
    rubbing = {contact.name: contact for contact in model.contacts}
    for name, share in record["stick_fraction"].items():
        work = ""
        if name in rubbing:
            work = f", work {record['dissipated'][name]:.6g} {unit_of_work(model, rubbing[name])}".rstrip()
        lines.append(
            f"  {name:<12} {100.0 * share:.4g} % of the period in {found.held_mode(name)}, "
            f"{record['stops_per_period'][name]:g} stops per period{work}"
        )
    if record["multipliers"] is None:
        lines.append(f"  stable       unknown: {record['no_multipliers']}")
    else:
        sizes = ", ".join(f"{abs(m):.4g}" for m in found.multipliers)
        is_neutral = found.stable and any(abs(m) > 1.0 - _NEUTRAL for m in found.multipliers)
        stable = "neutrally: some disturbances neither grow nor decay" if is_neutral else "yes"
        lines.append(f"  stable       {stable if found.stable else 'no'}")
        lines.append(
            f"  multipliers  |{sizes}|" if sizes else "  multipliers  only the trivial one along the motion"
        )
    if found.grazing is not None:
        near = found.grazing
        lines.append(f"  near grazing {near.guard}: minimum is {near.relative:.3g} of its maximum")
    return [*lines, *_tables(found, record)]


def _tables(found: SteadyState, record: dict[str, Any]) -> list[str]:
    """Return the tables of measures and harmonics, without the variables of tables of friction laws."""
    from hybridsim.model.checks.units import time_unit, units_of

    model = found.model
    units, time = units_of(model), time_unit(model)
    made = {name for c in model.contacts for name in (*c.table_variables, c.table_speed)}
    made -= {output.name for output in model.outputs}
    labels = {
        name: f"{name} [{units[name]}]" if units.get(name) else name
        for name in record["amplitude"]
        if name not in made
    }
    header: tuple[str, ...] = ("quantity", "amplitude", "min", "max", "mean", "energy")
    rows = [
        (
            label,
            *(f"{record[key][name]:.6g}" for key in ("amplitude", "minimum", "maximum", "mean")),
            f"{record['energy'][name]:.6g} {_unit_of_energy(units.get(name, ''), time)}".rstrip(),
        )
        for name, label in labels.items()
    ]
    lines = ["", *aligned([header, *rows], indent="  ")]
    lines += [f"  {name}: varies too fast to be measured" for name in record["too_fast"]]
    count = len(next(iter(record["harmonics"].values()), [])) - 1
    if count > 0 and found.kind == "periodic":
        header = ("harmonic", *(str(k) for k in range(1, count + 1)))
        rows = [
            (label, *(f"{h['amplitude']:.4g}" for h in record["harmonics"][name][1:]))
            for name, label in labels.items()
        ]
        lines += ["", *aligned([header, *rows], indent="  ")]
    return lines


def _unit_of_energy(unit: str, time: str) -> str:
    """Return the unit of the integral of a square over time, or an empty text if it is unknown."""
    if not unit or not time:
        return ""
    return f"{unit}^2*{time}" if unit.isalpha() else f"({unit})^2*{time}"
