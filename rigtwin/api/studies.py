"""Studies on the twin: tuning, stability, the thesis again, the diagnosis held to its word."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Literal

from controllers import PlateCompensator
from experiments.rths.actuator import draw_plants
from experiments.rths.building import find_case
from experiments.rths.compensators import find_compensator
from experiments.rths.ground_motion import ground_motion
from experiments.rths.hybrid_test import NONE, Noise, run_test
from experiments.rths.hybrid_test import HybridTest as HybridTest
from experiments.rths.tuning import TunedCompensator as TunedCompensator
from experiments.rths.tuning import tune_compensator as tune_compensator
from experiments.thesis.result import Reproduction
from experiments.thesis.result import reproduce as reproduce_thesis
from experiments.tuning import find_study
from experiments.vehicles import find_vehicle
from referee import arm, check, wild
from rigtwin.api.machines import resolve_machine
from rigtwin.description.machine import Machine
from rigtwin.description.posterior import load_posterior
from rigtwin.errors import RigtwinError
from rigtwin.studies.identifiability import Identifiability as Identifiability
from rigtwin.studies.identifiability import find_identifiable
from rigtwin.studies.stability.judgement import ModelStability as ModelStability
from rigtwin.studies.stability.judgement import Stability, judge
from rigtwin.studies.stability.tested import RigMargin as RigMargin
from rigtwin.studies.stability.tested import judge_margin
from rigtwin.studies.stability.vehicle import QuarterCar, check_plausible, check_time
from rigtwin.studies.sweep import Store, open_workers
from rigtwin.studies.tuning.bench import Bench
from rigtwin.studies.tuning.folder import RUNS, default_folder, write
from rigtwin.studies.tuning.result import TuningResult, count_runs
from rigtwin.studies.tuning.result import tune as tune_study

MOST_PLANTS = 1000
Draw = Literal["wild", "arm"]
Progress = Callable[[int, int], object]
"""Called with what is done and with how much there is in all."""


def _nothing(*_: object) -> None:
    """Tells nobody."""


def identifiability(
    of: Machine | str | Path,
    *,
    seconds: float = math.inf,
    progress: Callable[[str], object] = _nothing,
) -> Identifiability:
    """What a machine's sensors can never show, whatever it does: before there are any data.

    Parameters
    ----------
    of
        The machine, see `machine`.
    seconds
        Time that the work may take, s; effects that it does not suffice for are `untried`.
    progress
        Called with the name of what is worked out next.

    Returns
    -------
    Identifiability
        Effects that leave a trace of their own, those that leave none, and those whose trace others
        can leave as well.
    """
    return find_identifiable(resolve_machine(of), seconds, progress)


def tune(
    study: str,
    *,
    machine: Machine | str | Path | None = None,
    settings: Sequence[str] = (),
    twin: str | Path | None = None,
    out: str | Path | None = None,
    seed: int = 1,
    evaluations: int | None = None,
    roads: int | None = None,
    held_out: int | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    progress: Progress = _nothing,
    stage: Callable[[str], object] = _nothing,
) -> TuningResult:
    """Tunes a controller on the twin, and judges it on roads that the tuning has not seen.

    Parameters
    ----------
    study
        By name, or the path of its file, docs/tuning.md.
    machine
        Whose controller is tuned, see `machine`; by default that which the study names, or else
        the suspension rig.
    settings
        `group.name=value` for every run, over the study's own.
    twin
        A calibrated twin, as a diagnosis writes it: to be tuned on, within its uncertainty.
    out
        The folder of the results, `tuning/STUDY` by default. What is there already is not run
        again.
    seed
        Of the optimiser; the same seed gives the same settings.
    evaluations, roads, held_out
        About how many candidates, scenarios that each is tried in, and scenarios to judge on; by
        default the study's.
    workers, cluster
        Processes on this computer, one a core by default; or the address of a dask cluster.
    progress
        Called with the runs done and with about how many there will be.
    stage
        Called with what begins.

    Raises
    ------
    RigtwinError
        For a mistake in the study, or if no candidate meets its constraints.
    """
    if seed < 0:
        raise RigtwinError(f"seed {seed}: expected 0 or more")
    of = None if machine is None else resolve_machine(machine)
    found = find_study(
        study, settings, machine=of, roads=roads, held_out=held_out, evaluations=evaluations
    )
    base = found.machine.configuration
    posterior = None if twin is None else load_posterior(Path(twin), base)
    folder = Path(out) if out is not None else default_folder(found)
    if folder.exists() and not folder.is_dir():
        raise RigtwinError(f"cannot write into {folder}: it is a file")
    total, done = count_runs(found, posterior), 0

    def step(more: int) -> None:
        nonlocal done
        done += more
        progress(done, total)

    with open_workers(workers, cluster) as open_, Store(folder / RUNS) as store:
        result = tune_study(Bench(found, store, open_, step), seed, posterior, stage)
    on = found.configuration if posterior is None else posterior.at_best(found.configuration)
    write(folder, result, on)
    return result


def stability(
    vehicle: str | QuarterCar = "quarter-car",
    *,
    changes: Mapping[str, float] | None = None,
    tau: float = 0.01,
    delay: bool = False,
) -> Stability:
    """Whether a vehicle is stable on the rig with its lags, and how much of them it bears.

    Parameters
    ----------
    vehicle
        By name, such as "truck", or its figures.
    changes
        Other values of it: {"suspension_damping": 500}.
    tau
        s, the lag of every path.
    delay
        Whether the rightmost pole is with pure delays of tau instead.

    Raises
    ------
    RigtwinError
        For an unknown name, or a figure that no pole can be worked out for.
    """
    car = _car(vehicle)
    for name, value in {**(changes or {}), "tau": tau}.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RigtwinError(f"{name} = {value!r:.60}: expected a number")
    for name in changes or {}:
        if name not in QuarterCar._fields:
            known = ", ".join(QuarterCar._fields)
            raise RigtwinError(f"unknown parameter {name!r} of a vehicle; there are {known}")
    car = check_plausible(car._replace(**(changes or {})))
    return judge(car, check_time("tau", tau), delay)


def _car(vehicle: str | QuarterCar) -> QuarterCar:
    car = find_vehicle(vehicle) if isinstance(vehicle, str) else vehicle
    if not isinstance(car, QuarterCar):
        raise RigtwinError(f"vehicle {car!r:.60}: expected a name, or a QuarterCar")
    return car


def rig_margin(
    vehicle: str | QuarterCar = "quarter-car", *, compensator: str = "kalman-inverse"
) -> RigMargin:
    """How stable a vehicle is on the rig as it runs, plain and with its plate's delay compensated.

    Parameters
    ----------
    vehicle
        By name, such as "truck", or its figures.
    compensator
        Of the plate's delay, as `controller.plate_compensator` takes it.

    Raises
    ------
    RigtwinError
        For an unknown name, or a figure that no pole can be worked out for.
    """
    try:
        by = PlateCompensator.parse(compensator)
    except ValueError as error:
        raise RigtwinError(f"compensator {error}") from None
    return judge_margin(check_plausible(_car(vehicle)), by)


def reproduce(
    what: str | None = None,
    *,
    seeds: int = 32,
    folder: str | Path = "reproduction",
    workers: int | None = None,
    cluster: str | None = None,
    progress: Progress = _nothing,
) -> Reproduction:
    """Reproduces the thesis: its tables, figures and statements beside ours.

    Parameters
    ----------
    what
        A chapter (3 to 7, A), study, table, figure or equation; everything by default.
    seeds
        Roads and noise to judge over.
    folder
        Of the results; what is there already is not computed again.
    workers, cluster
        Processes on this computer, one a core by default; or the address of a dask cluster.
    progress
        Called with the jobs done and with how many there are.

    Raises
    ------
    RigtwinError
        If nothing is called that, or the folder cannot be written.
    """
    with open_workers(workers, cluster) as open_:
        return reproduce_thesis(what, seeds, Path(folder), open_, progress)


def rths(
    case: int = 1,
    *,
    quake: str = "elcentro",
    compensator: str = "kalman-inverse",
    plants: int = 1,
    noise: Noise = NONE,
    seed: int = 1,
) -> list[HybridTest]:
    """Runs the benchmark of real-time hybrid simulation: a building whose first column is real.

    Parameters
    ----------
    case
        Of the building, 1 to 4.
    quake
        elcentro, kobe or morgan.
    compensator
        By name; an unknown one is answered with what there is.
    plants
        How many actuators and specimens: the nominal one first, the others drawn.
    noise
        Of the converters, V rms.
    seed
        Of the plants and of the noise.

    Returns
    -------
    list
        Of each plant: the criteria J1 to J9, the largest force, motion and speed, and the signals.

    Raises
    ------
    RigtwinError
        For an unknown case, earthquake or compensator, or a number of plants that makes no sense.
    """
    building, law = find_case(case), find_compensator(compensator)
    whole = all(isinstance(each, int) and not isinstance(each, bool) for each in (plants, seed))
    if not isinstance(noise, Noise):
        raise RigtwinError(f"noise {noise!r:.60}: expected a Noise of position and force, V")
    if not whole or not 1 <= plants <= MOST_PLANTS or seed < 0:
        raise RigtwinError(f"plants {plants}, seed {seed}: expected 1 to {MOST_PLANTS}, 0 or more")
    ground = ground_motion(quake)
    return [
        run_test(building, ground, law, plant, noise, seed) for plant in draw_plants(plants, seed)
    ]


def blindcheck(
    cases: int = 200,
    *,
    seed: int = 2026,
    folder: str | Path = "blindcheck",
    baselines: bool = False,
    workers: int | None = None,
    cluster: str | None = None,
    progress: Progress = _nothing,
) -> check.Result:
    """Holds the diagnosis to recordings of another rig, whose defects are withheld from it.

    Parameters
    ----------
    cases
        How many rigs.
    seed
        Of the referee's draws.
    folder
        Of recordings and answers; what is there already is not diagnosed again.
    baselines
        Whether cruder methods are asked too.
    workers, cluster
        Processes on this computer, one a core by default; or the address of a dask cluster.
    progress
        Called with the recordings and answers done and with how many there are.

    Raises
    ------
    RigtwinError
        If the referee fails, or its key is not the one that it committed itself to.
    """
    _check_draw(cases, seed)
    with open_workers(workers, cluster) as open_:
        step = _counting(progress, 2 * cases)
        return check.check(Path(folder), cases, seed, baselines, open_, step)


def blindcheck_machines(
    cases: int = 200,
    *,
    draw: Draw = "wild",
    seed: int = 2026,
    folder: str | Path = "blindcheck",
    workers: int | None = None,
    cluster: str | None = None,
    progress: Progress = _nothing,
) -> wild.WildResult | arm.ArmResult:
    """Holds the diagnosis to other machines than the rig, whose defects are withheld from it.

    Parameters
    ----------
    cases
        How many machines.
    draw
        "wild": machines whose physics have forms that the library does not have. "arm": joints that
        act on each other.
    seed
        Of the draws.
    folder
        Of the answers; what is there already is not diagnosed again.
    workers, cluster
        Processes on this computer, one a core by default; or the address of a dask cluster.
    progress
        Called with the machines done and with how many there are.

    Raises
    ------
    RigtwinError
        For another draw, or if the folder cannot be written.
    """
    _check_draw(cases, seed)
    checks = {"wild": wild.check_wild, "arm": arm.check_arms}
    if draw not in checks:
        raise RigtwinError(f"draw {draw!r:.40}: expected one of {', '.join(checks)}")
    with open_workers(workers, cluster) as open_:
        return checks[draw](Path(folder), cases, seed, open_, _counting(progress, cases))


def _check_draw(cases: int, seed: int) -> None:
    if cases < 1 or seed < 0:
        raise RigtwinError("cases: expected 1 or more; seed: 0 or more")


def _counting(progress: Progress, total: int) -> Callable[[int], None]:
    done = 0

    def step(more: int) -> None:
        nonlocal done
        done += more
        progress(done, total)

    return step
