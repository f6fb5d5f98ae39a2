"""What `import rigtwin` offers: machines, runs on their twins, recordings, comparisons and
diagnoses.

The commands of the command line call these functions and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rigtwin.components import Effect
from rigtwin.description import catalogue
from rigtwin.description.configuration import (
    Changes,
    Configuration,
    apply_effects,
    parameters,
    with_changes,
)
from rigtwin.description.configuration import without_effect as take_out
from rigtwin.description.machine import Machine, Structure
from rigtwin.diagnosis.compare import Comparison, differences
from rigtwin.diagnosis.compare import compare as compare_with_twin
from rigtwin.diagnosis.compare import compare_recordings as find_differences
from rigtwin.diagnosis.data_checks import require_fit
from rigtwin.diagnosis.diagnose import diagnose as find_reasons
from rigtwin.diagnosis.residual import Residual
from rigtwin.diagnosis.result import Diagnosis
from rigtwin.errors import RigtwinError
from rigtwin.importing.convert import convert
from rigtwin.models.machine_twin import run_machine
from rigtwin.recording import export, reader
from rigtwin.render.plot import draw
from rigtwin.render.video import film
from rigtwin.simulation.experiment import Demands, Experiment, experiments_of, find_experiment
from rigtwin.simulation.loop import TickController
from rigtwin.simulation.runner import record
from rigtwin.studies.friction_spikes import Calibration, find_compensator

Settings = Changes | Sequence[Changes]
"""Group → name → value, {"rail": {"coulomb": 60}, "timing": {"duration": 5}}; or the path of a TOML
file that holds them; or several of these, one over the other."""
Effects = Mapping[str, float | Mapping[str, float]] | Sequence[str]
"""Effect → magnitude, or → parameter → value: {"coulomb@rail": 80}; or texts as `--effect`
takes."""
Demanding = Callable[[Configuration, int], Demands]
"""An experiment of one's own: what is demanded of the machine for (settings, seed)."""


@dataclass(frozen=True)
class Recording(reader.Recording):
    """A test as it was recorded.

    `recording["/sensor.load_cell"]` is a channel, shape (ticks,), `recording.time` its time in s,
    `recording.channels` names them all, `recording.units` says their units.
    """

    described: Machine | None = field(default=None, repr=False)
    """The machine that it is of, where it was said."""
    report: tuple[str, ...] = field(default=(), repr=False)
    """What was found in the data that it was made of, where it was imported."""

    @property
    def tripped(self) -> bool:
        """Whether a limit ended the test."""
        return self.end.startswith("trip")

    def plot(self, out: str | Path, start: float = 0.0, until: float | None = None) -> Path:
        """Draws it.

        Parameters
        ----------
        out
            A png, svg or pdf file.
        start, until
            s, the stretch that is drawn; until the end by default.

        Raises
        ------
        RigtwinError
            For another ending or an empty stretch.
        """
        draw(self, Path(out), start, until)
        return Path(out)

    def video(self, out: str | Path, **options: Any) -> Path:
        """Films it.

        Parameters
        ----------
        out
            An mp4 file.
        **options
            camera, start and until in s, magnify, progress; see `rigtwin.render.video.film`.

        Raises
        ------
        RigtwinError
            If this computer cannot draw, or the file cannot be written.
        """
        film(self, Path(out), machine_of(self), **options)
        return Path(out)

    def export(self, out: str | Path) -> Path:
        """Writes it as csv or mat, by the name's ending. Raises RigtwinError for any other."""
        export.export(self, Path(out))
        return Path(out)

    @property
    def units(self) -> dict[str, str]:
        """Channel → unit, of those that the machine's description knows."""
        known = machine_of(self).units
        return {name: known[name] for name in self.channels if name in known}


def load(path: str | Path, of: Machine | str | Path | None = None) -> Recording:
    """Reads a recording.

    Parameters
    ----------
    path
        Of an MCAP file, whoever wrote it.
    of
        The machine, or its name or description; by default the one that the recording names.

    Raises
    ------
    RigtwinError
        If it is no recording, is empty, or is of a format that this version does not read.
    """
    return _faced(reader.load(Path(path)), machine(of) if isinstance(of, str | Path) else of)


def _faced(plain: reader.Recording, described: Machine | None) -> Recording:
    return Recording(
        **{each.name: getattr(plain, each.name) for each in fields(plain)}, described=described
    )


def machine(name: str | Path) -> Machine:
    """A machine.

    Parameters
    ----------
    name
        Of a shipped one, see `machines`, or the path of a description, a TOML file.

    Raises
    ------
    RigtwinError
        With the first mistake in the description, or with what there is.
    """
    return catalogue.find(str(name))


def machines() -> dict[str, Path]:
    """The machines that come along: name → description."""
    return catalogue.shipped()


def machine_of(recording: reader.Recording) -> Machine:
    """The machine that a recording is of. Raises RigtwinError if it has to be said."""
    described = getattr(recording, "described", None)
    if described is not None:
        return described
    if recording.machine not in catalogue.shipped():
        known = ", ".join(catalogue.shipped())
        raise RigtwinError(
            f"{recording.path}: it is of machine {recording.machine!r}; give its description, "
            f'machine="F.toml" or --machine F.toml (shipped ones: {known})'
        )
    return catalogue.find(recording.machine)


def experiments(of: Machine) -> dict[str, Experiment]:
    """The experiments that a machine's description names: name → experiment."""
    return experiments_of(of)


def effects(of: Machine) -> list[Effect]:
    """All effects that a machine can have."""
    return list(of.effects())


def effect_texts(given: Effects) -> list[str]:
    """Effects as `--effect` takes them: `coulomb@rail=80`."""
    if not isinstance(given, Mapping):
        return list(given)
    return [f"{name}={_values(value)}" for name, value in given.items()]


def _values(value: float | Mapping[str, float]) -> str:
    if not isinstance(value, Mapping):
        return repr(float(value))
    first, *more = value.items()
    return ",".join([repr(float(first[1])), *(f"{name}={each!r}" for name, each in more)])


def run(
    on: Machine,
    experiment: str | Experiment | Demanding,
    *,
    seed: int = 0,
    effects: Effects = (),
    settings: Settings = (),
    controller: TickController | Callable[..., Any] | None = None,
    path: str | Path | None = None,
    progress: Callable[[int], object] = lambda _ticks: None,
) -> Recording:
    """Runs a test on a machine's twin.

    Parameters
    ----------
    on
        The machine, see `machine`; also a corrected one, `Diagnosis.machine`.
    experiment
        Its name among `experiments`, an `Experiment`, or a function that gives the demands.
    seed
        Of the excitation and of the sensors' noise; the same seed gives the same recording.
    effects
        What the twin has and its operator does not know of.
    settings
        Changes of what the operator knows.
    controller
        One of your own instead of the machine's: an object with `tick(measured, demand)`, or a
        function, compiled or not; it returns `controllers.Commands` on the suspension rig, the
        actuator's command on any other machine, for measurements and demands by name.
    path
        Where to record; by default nowhere but in memory.
    progress
        Called with the ticks done since its last call.

    Raises
    ------
    RigtwinError
        If anything asked for is not known or not allowed, before the test starts.
    """
    if seed < 0:
        raise RigtwinError(f"seed {seed}: expected 0 or more")
    test = _experiment(on, experiment)
    configuration = with_changes(test.configuration, settings)
    if path is not None:
        _record(
            Path(path), on, test, configuration, seed, effect_texts(effects), controller, progress
        )
        return _faced(reader.load(Path(path)), on)
    with TemporaryDirectory(prefix="rigtwin-") as folder:
        kept = Path(folder) / f"{test.name}-{seed}.mcap"
        _record(kept, on, test, configuration, seed, effect_texts(effects), controller, progress)
        return replace(_faced(reader.load(kept), on), path=Path(kept.name))


def _experiment(of: Machine, experiment: str | Experiment | Demanding) -> Experiment:
    if isinstance(experiment, str):
        return find_experiment(of, experiment)
    if isinstance(experiment, Experiment):
        return experiment
    name = getattr(experiment, "__name__", "own")
    return Experiment(name, "", "", of.configuration, experiment)


def _record(
    path: Path,
    on: Machine,
    test: Experiment,
    configuration: Configuration,
    seed: int,
    effects: Sequence[str],
    controller: TickController | Callable[..., Any] | None,
    progress: Callable[[int], object],
) -> None:
    tick: Any = getattr(controller, "tick", controller)
    demands = test.demands(configuration, seed)
    if on.structure is Structure.QUARTER_CAR:
        record(
            path,
            test.name,
            configuration,
            demands,
            seed,
            progress,
            effects,
            machine=on.name,
            controller=tick,
        )
    else:
        run_machine(
            path, on, test.name, configuration, demands, seed, effects=effects, controller=tick
        )


def diagnose(
    recordings: reader.Recording | Sequence[reader.Recording],
    *,
    machine: Machine | str | Path | None = None,
    held_out: reader.Recording | Sequence[reader.Recording] = (),
    settings: Settings = (),
    without: Sequence[str] = (),
    progress: Callable[[str, int], object] = lambda _stage, _steps: None,
) -> Diagnosis:
    """Says why recordings of one machine and its twin disagree.

    Parameters
    ----------
    recordings
        One, or several that are explained together.
    machine
        That they are of; by default the one that they name.
    held_out
        Recordings of the same machine that the correction is judged on and not fitted to.
    settings
        Changes of the twin that they are compared with: of its plant and `timing.timestep`.
    without
        Effects that are taken out of the twin first, such as "coulomb@rail".
    progress
        Called with a stage's name and the steps done in it.

    Returns
    -------
    The verdict, the effects with confidence, where the gap lies, and how far it shrinks. In a
    notebook it shows its report.

    Raises
    ------
    RigtwinError
        If the recordings' settings are unknown, or held-out data are not fit to be compared.
    """
    several = list(_several(recordings))
    apart = list(_several(held_out))
    paths = [each.path.resolve() for each in (*several, *apart) if each.path.exists()]
    if len(set(paths)) < len(paths) or not several:
        raise RigtwinError(
            "a recording is named twice; each counts once, and what is held out must not be fitted"
            if several
            else "no recording to diagnose"
        )
    found = _described(several[0], machine)
    base = twin_of(found, settings, without)
    tests = [find_experiment(found, name) for name in found.next_tests]
    return find_reasons(found, several, base, apart, tests, progress)


def compare(
    recording: reader.Recording,
    *,
    machine: Machine | str | Path | None = None,
    settings: Settings = (),
    effects: Effects = (),
    progress: Callable[[str], object] = lambda _replay: None,
) -> Comparison:
    """What a recording and a twin differ by: replay by replay of the suspension rig's components,
    signal by signal of another machine.

    Parameters
    ----------
    recording
        The data.
    machine
        That it is compared with; by default the one that it names.
    settings
        Changes of the twin: of its plant and `timing.timestep`.
    effects
        That the twin is given.
    progress
        Called with each replay's name.

    Raises
    ------
    RigtwinError
        Naming every fault of the data that makes a comparison meaningless.
    """
    found = _described(recording, machine)
    base = twin_of(found, settings, (), effect_texts(effects))
    return compare_with_twin(found, recording, found.configuration_of(recording, base), progress)


def compare_recordings(
    first: reader.Recording, second: reader.Recording
) -> tuple[dict[str, Residual], tuple[str, ...]]:
    """Two recordings of one test, sensor by sensor.

    Parameters
    ----------
    first, second
        Of one machine.

    Returns
    -------
    What they differ by, by sensor; and what was not the same in the tests, a line each.

    Raises
    ------
    RigtwinError
        If their periods differ or they share no sensor.
    """
    return find_differences(machine_of(first), first, second), differences(first, second)


def calibrate(recording: reader.Recording) -> Calibration:
    """The friction compensator's settings that a recording of the suspension rig asks for.

    Parameters
    ----------
    recording
        Made without compensation, that reverses often, such as `friction-road`.

    Raises
    ------
    RigtwinError
        If the data are unfit, or a compensator found from them would do harm.
    """
    of = machine_of(recording)
    if of.structure is not Structure.QUARTER_CAR:
        raise RigtwinError(
            f"{recording.path}: it is of machine {of.name!r}; "
            f"expected {Structure.QUARTER_CAR.value}"
        )
    configuration = of.configuration_of(recording)
    require_fit(of, recording, configuration)
    found = find_compensator(recording, configuration.controller)
    if found.detected < 0.8 * found.reversals or found.false > 0.1 * found.reversals:
        raise RigtwinError(
            f"{recording.path}: a compensator found from it would do harm; record a test that "
            "reverses often, such as friction-road, without compensation"
        )
    return found


def _several(given: reader.Recording | Sequence[reader.Recording]) -> Iterator[reader.Recording]:
    if isinstance(given, reader.Recording):
        yield given
    else:
        yield from given


def _described(recording: reader.Recording, given: Machine | str | Path | None) -> Machine:
    if given is None:
        return machine_of(recording)
    return given if isinstance(given, Machine) else catalogue.find(str(given))


def twin_of(
    of: Machine,
    settings: Settings = (),
    taken_out: Sequence[str] = (),
    effects: Sequence[str] = (),
) -> Configuration:
    """The twin that recordings are compared with.

    Parameters
    ----------
    of
        The machine.
    settings
        Changes of its plant or of `timing.timestep`; all other settings are a recording's own.
    taken_out
        Effects that the nominal machine has and the twin is not to have.
    effects
        That the twin is given.

    Raises
    ------
    RigtwinError
        For any other setting, or an effect that is not there.
    """
    base = with_changes(of.configuration, settings)
    for (key, value, _), (_, described, _) in zip(
        parameters(base), parameters(of.configuration), strict=True
    ):
        group, _, name = key.partition(".")
        own = group in of.plant._fields or (
            group == "controller" and of.structure is Structure.JOINTS
        )
        if value != described and not own and (group, name) != ("timing", "timestep"):
            raise RigtwinError(
                f"{key}: a comparison changes the plant and timing.timestep only; "
                "all other settings are the recording's own"
            )
    for name in taken_out:
        base = take_out(base, name)
    return apply_effects(base, effects)


def import_data(data: str | Path, mapping: str | Path, out: str | Path) -> Recording:
    """Makes a recording of another program's data.

    Parameters
    ----------
    data
        A csv, mat or parquet file.
    mapping
        A TOML file that says which column is which channel, docs/tutorial.md.
    out
        The recording, an MCAP file.

    Raises
    ------
    RigtwinError
        Naming the column, unit or line that is at fault.
    """
    report = convert(Path(data), Path(mapping), Path(out))
    return replace(load(out), report=tuple(report))
