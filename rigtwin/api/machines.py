"""Machines by name or file, their experiments and effects."""

from __future__ import annotations

from pathlib import Path

from rigtwin.components import Effect
from rigtwin.description import catalogue
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.recording import reader
from rigtwin.simulation.experiment import Experiment, experiments_of


def machine(name: str | Path) -> Machine:
    """Return a machine.

    Parameters
    ----------
    name
        Name of a shipped machine (`machines()` lists them), or the path of a description, a TOML
        file (docs/machines.md).

    Returns
    -------
    Machine
        The machine, with its components, its plant (nominal parameters in SI units), its
        experiments and its controller.

    Raises
    ------
    RigtwinError
        If no machine has this name (the message lists the shipped ones), or if the description
        has mistakes (the message states the first; `rigtwin machine check` prints all).

    Examples
    --------
    >>> import rigtwin
    >>> rigtwin.machine("emps").name
    'emps'
    >>> rig = rigtwin.machine("my_machine.toml")  # doctest: +SKIP
    """
    return catalogue.find(str(name))


def resolve_machine(machine: Machine | str | Path) -> Machine:
    """Return the machine that an argument names.

    Parameters
    ----------
    machine
        Machine, or its name, or the path of its description.

    Raises
    ------
    RigtwinError
        If the argument has another type, or as for `machine`.
    """
    if isinstance(machine, Machine):
        return machine
    if isinstance(machine, str | Path):
        return catalogue.find(str(machine))
    raise RigtwinError(f"{machine!r:.60}: expected a machine, its name, or its description's path")


def machines() -> dict[str, Path]:
    """Return the shipped machines.

    Returns
    -------
    dict
        Name → path of the description.
    """
    return catalogue.shipped()


def machine_of(recording: reader.RecordedTest) -> Machine:
    """Return the machine of a recording.

    In this order: the machine with which the recording was loaded, the description that the
    recording refers to, the shipped machine that the recording names.

    Raises
    ------
    RigtwinError
        If none of these exists, so that the machine has to be stated.
    """
    # Only `rigtwin.Recording` carries a machine; `RecordedTest` of the layer below does not.
    described = getattr(recording, "described", None)
    if described is not None:
        return described
    description = recording.description
    if description is not None and description.is_file():
        resolved = catalogue.find(str(description))
        # A description that was overwritten by another machine's must not be used silently.
        if resolved.name == recording.machine:
            return resolved
        why = f"but its description {description} describes {resolved.name!r}"
    elif recording.machine in catalogue.shipped():
        return catalogue.find(recording.machine)
    elif description is not None:
        why = f"but its description {description} does not exist any more"
    else:
        why = f"which is not shipped with rigtwin; shipped are {', '.join(catalogue.shipped())}"
    raise RigtwinError(
        f"{recording.path}: it is of machine {recording.machine!r}, {why}; "
        'give its description, machine="F.toml" or --machine F.toml'
    )


def described_machine(
    recording: reader.RecordedTest, machine: Machine | str | Path | None
) -> Machine:
    """Return the stated machine, or the recording's own one if `machine` is None."""
    return machine_of(recording) if machine is None else resolve_machine(machine)


def experiments(machine: Machine | str | Path) -> dict[str, Experiment]:
    """Return the experiments that a machine's description defines.

    Parameters
    ----------
    machine
        Machine, its name, or the path of its description.

    Returns
    -------
    dict
        Name → experiment: a summary, a configuration and the demands of every tick. `run` takes
        either the name or the experiment.

    Raises
    ------
    RigtwinError
        If the machine is unknown or its description has mistakes.

    Examples
    --------
    >>> import rigtwin
    >>> "drop" in rigtwin.experiments("suspension-rig")
    True
    """
    return experiments_of(resolve_machine(machine))


def effects(machine: Machine | str | Path) -> list[Effect]:
    """Return all effects that a machine can have.

    Parameters
    ----------
    machine
        Machine, its name, or the path of its description.

    Returns
    -------
    list of Effect
        Effects in the order of the components. `name` is the text that `run`, `fit` and
        `diagnose` use, such as "coulomb@rail"; `quantities()` states unit and bounds of every
        parameter.

    Raises
    ------
    RigtwinError
        If the machine is unknown or its description has mistakes.

    Examples
    --------
    >>> import rigtwin
    >>> "coulomb@rail" in [effect.name for effect in rigtwin.effects("suspension-rig")]
    True
    """
    return list(resolve_machine(machine).effects())
