"""How far a hybrid test may be believed."""

from __future__ import annotations

from pathlib import Path

from rigtwin.api.machines import Settings, described_machine
from rigtwin.api.recordings import resolve_recording
from rigtwin.description.changes import with_changes
from rigtwin.description.machine import OWN, Machine
from rigtwin.recording import reader
from rigtwin.simulation.energy import EnergyError as EnergyError
from rigtwin.simulation.experiment import experiments_of


def energy_error(
    recording: reader.Recording | str | Path,
    *,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
) -> EnergyError | None:
    """The energy that the loop of a hybrid test puts into what it emulates: how far the test may be
    believed.

    Parameters
    ----------
    recording
        Of the suspension rig with its models in the loop.
    machine
        That it is of; by default the one that it names.
    settings
        Of a controller of your own that has the rig's models in it, such as one that compensates
        delay: changes of its experiment's, since the recording does not say them.

    Returns
    -------
    EnergyError or None
        In J, and as a share of what the suspension's damper took up; None for other tests and other
        machines, and for a controller of your own without its settings.

    Raises
    ------
    RigtwinError
        If a channel is missing, or the recording's settings are unknown.
    """
    recording = resolve_recording(recording)
    found = described_machine(recording, machine)
    own = OWN in recording.controller and bool(settings)
    known = experiments_of(found)
    start = known[recording.experiment].configuration if recording.experiment in known else None
    base = with_changes(start or found.configuration, settings)
    return found.physics.energy_error(recording, found.configuration_of(recording, base), own)
