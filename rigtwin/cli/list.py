"""`rigtwin list`: the experiments, or the settings of one."""

from __future__ import annotations

import argparse

from machines import DEFAULT_MACHINE
from rigtwin.cli.options import add_machine
from rigtwin.console import table

SUMMARY = "list the experiments, or the settings"
MORE = """\
rigtwin list --settings drop prints every setting of an experiment with unit, bounds and source."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--settings", metavar="NAME", help="list the settings of this experiment instead"
    )
    add_machine(parser, "machine", DEFAULT_MACHINE)


def execute(parsed: argparse.Namespace) -> int:
    import rigtwin
    from rigtwin.components.quantity import Quantity
    from rigtwin.description.configuration import parameters
    from rigtwin.simulation.experiment import find_experiment

    machine = rigtwin.machine(parsed.machine)
    if parsed.settings is None:
        rows = [("experiment", "what", "source", "seconds")]
        for experiment in rigtwin.experiments(machine).values():
            duration = f"{experiment.configuration.timing.duration:g}"
            rows.append((experiment.name, experiment.summary, experiment.source, duration))
        print(table(rows))
        return 0
    rows = [("setting", "value", "unit", "allowed", "source")]
    for key, value, meaning in parameters(find_experiment(machine, parsed.settings).configuration):
        if isinstance(meaning, Quantity):
            allowed = f"{meaning.low:g} to {meaning.high:g}"
            rows.append((key, f"{value:g}", meaning.unit, allowed, meaning.source))
        else:
            # Choices have labels in place of a range.
            rows.append((key, value.label, "", " | ".join(meaning.labels()), ""))
    print(table(rows))
    return 0
