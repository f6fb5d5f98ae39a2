"""What an experiment is: a configuration, and what it demands of the machine; and those that a
machine has."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np

from controllers.formula import formula
from rigtwin.components.rig import RigPlant
from rigtwin.description.changes import rebase
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array

Demands = Array | Mapping[str, Array]
"""Of the suspension rig, the columns of `controllers.Demand` at every tick, shape (ticks, 3):
ground m, structure m, force N, the last two for imposed tests only. Of another machine, each
demanded channel's values by its name, shape (ticks,)."""


@dataclass(frozen=True)
class Experiment:
    """A test that can be run by name; picklable, if its demands are a function of a module.

    Parameters
    ----------
    name, summary, source : str
        What it is called, what it does, where it comes from.
    configuration : Configuration
        The machine, its controller and the clocks.
    demands : callable
        Of a configuration and a seed, what it demands.
    """

    name: str
    summary: str
    source: str
    configuration: Configuration
    demands: Callable[[Configuration, int], Any]


@dataclass(frozen=True)
class FormulaDemands:
    """Demands as a description writes them: channel → a formula of `time`."""

    formulas: Mapping[str, str]

    def __call__(self, configuration: Configuration, seed: int) -> dict[str, Array]:
        time = np.arange(configuration.ticks) * configuration.timing.period
        found = {}
        for name, text in self.formulas.items():
            compiled = formula(text, {})
            inputs = [time] * max(len(compiled.inputs), 1)
            values = compiled.replayed({}, inputs, configuration.timing.period)
            if not np.isfinite(values).all():
                at = time[np.argmin(np.isfinite(values))]
                raise RigtwinError(f"demand {name}: {text!r:.60} is not finite at {at:.3f} s")
            found[name] = values
        return found


def experiments_of(machine: Machine) -> dict[str, Experiment]:
    """The experiments of a machine.

    Parameters
    ----------
    machine
        Its description.

    Returns
    -------
    dict
        Name → experiment: those of the Python module that the description names, or its own tables.
    """
    if isinstance(machine.experiments, str):
        try:
            known: Mapping[str, Experiment] = import_module(machine.experiments).EXPERIMENTS
        except (ImportError, AttributeError) as error:
            raise RigtwinError(
                f"{machine.path}: [experiments] python = {machine.experiments!r}: {error}; "
                "expected a module with EXPERIMENTS, name to Experiment"
            ) from None
        if machine.plant == RigPlant():
            return dict(known)
        base = machine.configuration
        return {
            name: replace(e, configuration=rebase(e.configuration, base))
            for name, e in known.items()
        }
    return {name: _from_table(machine, name, table) for name, table in machine.experiments.items()}


def _from_table(machine: Machine, name: str, table: Mapping[str, Any]) -> Experiment:
    base = machine.configuration
    clocks = {key: float(table[key]) for key in ("duration", "period") if key in table}
    timing = base.timing._replace(**clocks)
    timing = timing._replace(
        timestep=timing.period / max(1, round(timing.period / base.timing.timestep))
    )
    demands = {key: str(text) for key, text in table["demands"].items()}
    return Experiment(
        name=name,
        summary=str(table.get("summary", "")),
        source=machine.path.name,
        configuration=base._replace(timing=timing),
        demands=FormulaDemands(demands),
    )


def find_experiment(machine: Machine, name: str) -> Experiment:
    """The experiment of a name.

    Parameters
    ----------
    machine
        Its description.
    name
        Of the experiment.

    Returns
    -------
    Experiment
        As described.

    Raises
    ------
    RigtwinError
        Listing what there is, for an unknown name.
    """
    known = experiments_of(machine)
    if name not in known:
        there = f"there are {', '.join(known)}" if known else f"{machine.name} describes none"
        raise RigtwinError(f"unknown experiment {name!r}; {there}")
    return known[name]
