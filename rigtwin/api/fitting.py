"""Values of effects that are already suspected."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from rigtwin.api.answers import Recorded, read_inputs
from rigtwin.api.machines import Settings, twin_of
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.data_checks import require_fit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.known_effects import EffectFit as EffectFit
from rigtwin.diagnosis.known_effects import find_effects, fit_effects
from rigtwin.errors import RigtwinError
from rigtwin.recording import reader


def fit(
    recordings: Recorded | Sequence[Recorded],
    effects: str | Sequence[str],
    *,
    machine: Machine | str | Path | None = None,
    held_out: Recorded | Sequence[Recorded] = (),
    settings: Settings = (),
    columns: Mapping[str, str] | None = None,
    test: str = "",
    progress: Callable[[int], object] = lambda _fits: None,
) -> EffectFit:
    """Fit the values of named effects to recordings.

    Unlike `diagnose` it searches for nothing: it returns the values that explain the recordings
    best if these effects and no others act.

    Parameters
    ----------
    recordings
        One recording, or several that are explained together, or their paths. Logs of other
        programs where `machine` is a model.
    effects
        Names such as "coulomb@elbow"; `effects(machine)` lists them.
    machine
        Machine the recordings belong to. Defaults to the one that the first recording names.
    held_out
        Recordings that the values are judged on and not fitted to.
    settings
        Changes of the twin's plant and of `timing.timestep` before the fit.
    columns, test
        What a log does not state, see `describe`; for a machine that is a model.
    progress
        Called with 1 after each fit.

    Returns
    -------
    EffectFit
        Values with intervals, covariance, errors before and after, and warnings.

    Raises
    ------
    RigtwinError
        For an unknown effect, effects that set one parameter, or data that cannot be judged.

    Examples
    --------
    >>> fitted = rigtwin.fit("log.csv", ["coulomb@elbow"], machine="arm.xml")  # doctest: +SKIP
    >>> fitted["coulomb@elbow"].value  # doctest: +SKIP
    0.6001
    """
    given = read_inputs(recordings, machine, held_out, columns, test)
    names = [effects] if isinstance(effects, str) else list(effects)
    if not all(isinstance(name, str) for name in names):
        raise RigtwinError(f"effects {effects!r:.60}: expected names such as 'coulomb@rail'")
    chosen = find_effects(given.machine, names)
    base = twin_of(given.machine, settings)

    def gather(several: Sequence[reader.Recording]) -> Evidence | None:
        configurations = [given.machine.configuration_of(each, base) for each in several]
        for recording, configuration in zip(several, configurations, strict=True):
            require_fit(given.machine, recording, configuration)
        return Evidence(given.machine, several, configurations) if several else None

    evidence = gather(given.recordings)
    assert evidence is not None
    return fit_effects(evidence, chosen, gather(given.held_out), progress)
