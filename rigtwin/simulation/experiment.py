"""Experiments: named tests with a configuration and demands, and the experiments of a machine."""

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
"""Demands of a test. On the suspension rig: columns of `controllers.Demand` at every tick, ground
(m), structure (m) and force (N), shape (ticks, 3); the last two for imposed tests only. On another
machine: demanded channel → values, shape (ticks,)."""

EXCITE = "excite"
"""Name of the test that every machine of joints has."""
EXCITED = 10.0
"""Its duration, s."""


@dataclass(frozen=True)
class Experiment:
    """Test that can be run by name. It can be pickled if its demands are a module's function.

    Parameters
    ----------
    name, summary, source : str
        Name, one line about the test, and its origin.
    configuration : Configuration
        Settings of machine, controller and timing.
    demands : callable
        Function of a configuration and a seed that returns the demands.
    """

    name: str
    summary: str
    source: str
    configuration: Configuration
    demands: Callable[[Configuration, int], Any]


@dataclass(frozen=True)
class FormulaDemands:
    """Demands of a description.

    Attributes
    ----------
    formulas : mapping of str to str
        Channel → formula of `time`.
    """

    formulas: Mapping[str, str]

    def __call__(self, configuration: Configuration, seed: int) -> dict[str, Array]:
        time = np.arange(configuration.ticks) * configuration.timing.period
        demands = {}
        for name, text in self.formulas.items():
            compiled = formula(text, {})
            # A constant formula has no input, but still needs one to have a length.
            inputs = [time] * max(len(compiled.inputs), 1)
            values = compiled.replayed({}, inputs, configuration.timing.period)
            if not np.isfinite(values).all():
                at = time[np.argmin(np.isfinite(values))]
                raise RigtwinError(f"demand {name}: {text!r:.60} is not finite at {at:.3f} s")
            demands[name] = values
        return demands


@dataclass(frozen=True)
class MotionDemands:
    """Demands of the test `excite`: multisines of all joints within their ranges.

    Parameters
    ----------
    machine
        Machine that is to move.
    """

    machine: Machine

    @property
    def possible(self) -> bool:
        """Whether the description states how far every demand may go."""
        timing = self.machine.configuration.timing
        short = timing._replace(duration=2.0 * timing.period)
        configuration = self.machine.configuration._replace(timing=short)
        return self.machine.physics.demand_motions(self.machine, configuration, 0) is not None

    def __call__(self, configuration: Configuration, seed: int) -> Demands:
        """Return the demands of every tick: channel → array of shape (ticks,)."""
        demands = self.machine.physics.demand_motions(self.machine, configuration, seed)
        assert demands is not None
        return dict(demands)


def experiments_of(machine: Machine) -> dict[str, Experiment]:
    """Return the experiments of a machine.

    Parameters
    ----------
    machine
        Description of the machine.

    Returns
    -------
    dict
        Name → experiment, from the Python module that the description names, or from its tables.

    Raises
    ------
    RigtwinError
        If the Python module cannot be imported or has no `EXPERIMENTS`.
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
        # The module is written for the nominal rig: transfer its settings to this machine.
        base = machine.configuration
        return {
            name: replace(e, configuration=rebase(e.configuration, base))
            for name, e in known.items()
        }
    stated = {
        name: _from_table(machine, name, table) for name, table in machine.experiments.items()
    }
    return {**_excite(machine), **stated}


def _excite(machine: Machine) -> dict[str, Experiment]:
    """Return the test that every machine of joints has: all joints move richly and gently."""
    timing = machine.configuration.timing._replace(duration=EXCITED)
    configuration = machine.configuration._replace(timing=timing)
    demands = MotionDemands(machine)
    experiment = Experiment(
        name=EXCITE,
        summary="all joints to and fro at once, by multisines from the seed",
        source="for diagnosis",
        configuration=configuration,
        demands=demands,
    )
    return {EXCITE: experiment} if demands.possible else {}


def _from_table(machine: Machine, name: str, table: Mapping[str, Any]) -> Experiment:
    base = machine.configuration
    clocks = {key: float(table[key]) for key in ("duration", "period") if key in table}
    timing = base.timing._replace(**clocks)
    # Keep the timestep close to the description's, with a whole number of steps per tick.
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
    """Return an experiment by its name.

    Parameters
    ----------
    machine
        Description of the machine.
    name
        Name of the experiment.

    Returns
    -------
    Experiment
        Experiment of that name.

    Raises
    ------
    RigtwinError
        If the name is unknown; the message lists the experiments.
    """
    known = experiments_of(machine)
    if name not in known:
        available = f"there are {', '.join(known)}" if known else f"{machine.name} describes none"
        raise RigtwinError(f"unknown experiment {name!r}; {available}")
    return known[name]
