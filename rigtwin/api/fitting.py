"""Values of effects that are named in advance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from rigtwin.api.diagnosis_data import DiagnosisData, Recorded, read_data
from rigtwin.api.twin import Settings, twin_of
from rigtwin.components import Effect
from rigtwin.description.configuration import Configuration
from rigtwin.description.machine import Machine
from rigtwin.diagnosis.copies import drop_copies, refuse_copies
from rigtwin.diagnosis.data_checks import require_fit
from rigtwin.diagnosis.effect_fit import EffectFit as EffectFit
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.known_effects import find_effects, fit_effects
from rigtwin.diagnosis.short_recordings import drop_short, least_ticks
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
        Recording, or several of one machine that are fitted jointly, or their paths. If `machine`
        is a model, these are logs of other programs.
    effects
        Name of an effect such as "coulomb@elbow", or several; `effects(machine)` lists them.
    machine
        Machine the recordings belong to, or its name, or the path of its description. Defaults to
        the one named in the first recording. A model (MJCF or URDF) is described from the first
        log, see `describe`.
    held_out
        Recordings of the same machine on which the values are judged. They are not fitted.
    settings
        Changes of the twin's plant and of `timing.timestep` before the fit.
    columns, test
        Statements about a log as `describe` takes them. They require a model as the machine.
    progress
        Function called with 1 after each fit.

    Returns
    -------
    EffectFit
        `fitted["coulomb@elbow"]` has the value, its 95 % interval and its unit; `covariance` has
        shape (parameters, parameters). `error_before` and `error_after` are each recording's
        residual as a share of the signals' swing, `warnings` state what is confounded, and
        `save_mjcf(path)` writes the model with the values.

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
    data = read_data(recordings, machine, held_out, columns, test)
    names = [effects] if isinstance(effects, str) else list(effects)
    if not all(isinstance(name, str) for name in names):
        raise RigtwinError(f"effects {effects!r:.60}: expected names such as 'coulomb@rail'")
    return _fit(data, find_effects(data.machine, names), twin_of(data.machine, settings), progress)


def _fit(
    data: DiagnosisData,
    effects: Sequence[Effect],
    base: Configuration,
    progress: Callable[[int], object],
) -> EffectFit:
    """Fit effects to recordings, without copies and recordings that are too short."""
    # Copies count twice in the fit, and held-out copies would be no test of it.
    recordings_kept, copies = drop_copies(data.recordings)
    refuse_copies(data.held_out, recordings_kept)
    fitted, short = drop_short(recordings_kept)
    judged, short_held_out = drop_short(data.held_out)

    def gather(tests: Sequence[reader.RecordedTest]) -> Evidence:
        configurations = [data.machine.configuration_of(test, base) for test in tests]
        for recording, configuration in zip(tests, configurations, strict=True):
            require_fit(data.machine, recording, configuration, least_ticks(tests))
        return Evidence(data.machine, tests, configurations)

    result = fit_effects(gather(fitted), effects, gather(judged) if judged else None, progress)
    return replace(result, warnings=(*copies, *short, *short_held_out, *result.warnings))
