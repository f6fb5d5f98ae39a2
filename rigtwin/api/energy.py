"""Energy error of a hybrid test."""

from __future__ import annotations

from pathlib import Path

from rigtwin.api.machines import described_machine
from rigtwin.api.recordings import resolve_recording
from rigtwin.api.twin import Settings
from rigtwin.description.changes import with_changes
from rigtwin.description.machine import OWN, Machine
from rigtwin.recording import reader
from rigtwin.simulation.energy import EnergyError as EnergyError
from rigtwin.simulation.experiment import experiments_of


def energy_error(
    recording: reader.RecordedTest | str | Path,
    *,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
) -> EnergyError | None:
    """Return the energy that the loop of a hybrid test adds to the emulated vehicle.

    Delay and control errors of the loop act as negative damping: the larger the energy error, the
    less the test represents the vehicle (Mosqueda, Stojadinovic and Mahin, J. Struct. Eng. 133,
    2007).

    Parameters
    ----------
    recording
        Recording of the suspension rig with its models in the loop, or its path.
    machine
        Machine the recording belongs to, or its name, or the path of its description. Defaults to
        the one named in the recording.
    settings
        Changes of the experiment's settings. They are needed for a custom controller that contains
        the rig's models, whose settings the recording does not state.

    Returns
    -------
    EnergyError or None
        Energy in J, and as a share of the energy that the suspension's damper dissipated. None for
        other tests and other machines, and for a custom controller without settings.

    Raises
    ------
    RigtwinError
        If a channel is missing, or the recording's settings are unknown.
    """
    recording = resolve_recording(recording)
    described = described_machine(recording, machine)
    # With a user's controller the recording does not say what vehicle it emulates; only given
    # settings do.
    custom = OWN in recording.controller and bool(settings)
    known = experiments_of(described)
    start = known[recording.experiment].configuration if recording.experiment in known else None
    base = with_changes(start or described.configuration, settings)
    configuration = described.configuration_of(recording, base)
    return described.physics.energy_error(recording, configuration, custom)
