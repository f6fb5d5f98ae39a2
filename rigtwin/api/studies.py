"""Studies on the twin: tuning, stability, reproduction of the thesis, checks of the diagnosis."""

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
"""Function called with the number of finished steps and with their total."""


def _ignore_progress(*_: object) -> None:
    """Discard a report of progress."""


def identifiability(
    machine: Machine | str | Path,
    *,
    seconds: float = math.inf,
    progress: Callable[[str], object] = _ignore_progress,
) -> Identifiability:
    """Find the effects that a machine's sensors can never show, before any data are recorded.

    The machine is simulated with synthetic motions within its joints' range, and the rank of the
    sensitivities of all sensors to all effects decides.

    Parameters
    ----------
    machine
        Machine, its name, or the path of its description.
    seconds
        Limit of the computing time, in s, none by default. Effects that it does not suffice for
        are `untried`.
    progress
        Function called with the name of the next step.

    Returns
    -------
    Identifiability
        `seen`, effects that can be told from all others; `unseen`, effects that change no recorded
        signal; `confounded`, effect → effects that together change the signals in the same way;
        `sums`, base parameters of rigid bodies; `untried`.

    Raises
    ------
    RigtwinError
        If the machine is unknown or its description has mistakes.

    Examples
    --------
    >>> result = rigtwin.identifiability("damper-bench")  # doctest: +SKIP
    >>> result.confounded  # doctest: +SKIP
    """
    return find_identifiable(resolve_machine(machine), seconds, progress)


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
    progress: Progress = _ignore_progress,
    stage: Callable[[str], object] = _ignore_progress,
) -> TuningResult:
    """Tune a controller on the twin, and judge it on roads that the tuning has not used.

    Parameters
    ----------
    study
        Name of a shipped study, or the path of a study's file (docs/tuning.md).
    machine
        Machine whose controller is tuned, or its name, or the path of its description. Defaults to
        the machine that the study names, or else to the suspension rig.
    settings
        Changes `group.name=value` of every run. They override the study's own.
    twin
        File of a calibrated twin, as `Diagnosis.save_twin` writes it. The scenarios are drawn
        from its uncertainty.
    out
        Folder of the results, `tuning/STUDY` by default. Runs that it contains are not repeated.
    seed
        Seed of the optimiser, at least 0. The same seed gives the same settings.
    evaluations
        Approximate number of candidates. Defaults to the study's.
    roads
        Number of scenarios in which every candidate is tried. Defaults to the study's.
    held_out
        Number of scenarios for the judgement. Defaults to the study's.
    workers, cluster
        Number of processes on this computer, one per core by default; or the address of a dask
        cluster.
    progress
        Function called with the number of finished runs and with the expected total.
    stage
        Function called with the name of each stage as it begins.

    Returns
    -------
    TuningResult
        `chosen`, the recommended candidate with its settings and scores; `front`, the Pareto front
        of two objectives; `comparisons` of the baseline and the tuned settings on held-out
        scenarios. The folder contains a page and `tuned.toml`, for `--config`.

    Raises
    ------
    RigtwinError
        For a mistake in the study, or if no candidate meets its constraints.

    Examples
    --------
    >>> result = rigtwin.tune("skyhook", out="tuning/skyhook", roads=4)  # doctest: +SKIP
    >>> result.chosen  # doctest: +SKIP
    """
    if seed < 0:
        raise RigtwinError(f"seed {seed}: expected 0 or more")
    loaded = find_study(
        study,
        settings,
        machine=None if machine is None else resolve_machine(machine),
        roads=roads,
        held_out=held_out,
        evaluations=evaluations,
    )
    base = loaded.machine.configuration
    posterior = None if twin is None else load_posterior(Path(twin), base)
    folder = Path(out) if out is not None else default_folder(loaded)
    if folder.exists() and not folder.is_dir():
        raise RigtwinError(f"cannot write into {folder}: it is a file")
    total, done = count_runs(loaded, posterior), 0

    def step(more: int) -> None:
        nonlocal done
        done += more
        progress(done, total)

    with open_workers(workers, cluster) as open_, Store(folder / RUNS) as store:
        result = tune_study(Bench(loaded, store, open_, step), seed, posterior, stage)
    tuned_on = loaded.configuration
    write(folder, result, tuned_on if posterior is None else posterior.at_best(tuned_on))
    return result


def stability(
    vehicle: str | QuarterCar = "quarter-car",
    *,
    changes: Mapping[str, float] | None = None,
    tau: float = 0.01,
    delay: bool = False,
) -> Stability:
    """Judge whether a vehicle is stable on the rig with lags, and which lags it tolerates.

    Parameters
    ----------
    vehicle
        Name, such as "truck", or a `QuarterCar`. Defaults to the vehicle of thesis Table 6.2.
    changes
        Changed parameters of the vehicle in SI units, such as {"suspension_damping": 500}.
    tau
        Time constant of the lag in every path, in s, 0.01 by default.
    delay
        Whether to compute the rightmost pole with pure delays of `tau` in place of lags.

    Returns
    -------
    Stability
        `models`, model → `ModelStability`: rightmost pole in 1/s, and critical lag and delay in s.

    Raises
    ------
    RigtwinError
        For an unknown vehicle or parameter, or values for which no pole can be computed.
    """
    car = _car(vehicle)
    for name, value in {**(changes or {}), "tau": tau}.items():
        # Python counts True as 1, which would pass for a parameter.
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RigtwinError(f"{name} = {value!r:.60}: expected a number")
    for name in changes or {}:
        if name not in QuarterCar._fields:
            known = ", ".join(QuarterCar._fields)
            raise RigtwinError(f"unknown parameter {name!r} of a vehicle; there are {known}")
    car = check_plausible(car._replace(**(changes or {})))
    return judge(car, check_time("tau", tau), delay)


def _car(vehicle: str | QuarterCar) -> QuarterCar:
    """Return a vehicle's parameters. Raises RigtwinError for an unknown vehicle."""
    car = find_vehicle(vehicle) if isinstance(vehicle, str) else vehicle
    if not isinstance(car, QuarterCar):
        raise RigtwinError(f"vehicle {car!r:.60}: expected a name, or a QuarterCar")
    return car


def rig_margin(
    vehicle: str | QuarterCar = "quarter-car", *, compensator: str = "kalman-inverse"
) -> RigMargin:
    """Judge the stability margin of a vehicle on the rig with its real sampled loop.

    Parameters
    ----------
    vehicle
        Name, such as "truck", or a `QuarterCar`.
    compensator
        Name of the plate's delay compensator, a value of the setting
        `controller.plate_compensator`.

    Returns
    -------
    RigMargin
        Real part of the slowest pole in 1/s, without and with compensation, and the additional
        delay in s at which the compensated loop becomes unstable.

    Raises
    ------
    RigtwinError
        For an unknown vehicle or compensator, or values for which no pole can be computed.
    """
    try:
        parsed = PlateCompensator.parse(compensator)
    except ValueError as error:
        raise RigtwinError(f"compensator {error}") from None
    return judge_margin(check_plausible(_car(vehicle)), parsed)


def reproduce(
    part: str | None = None,
    *,
    seeds: int = 32,
    folder: str | Path = "reproduction",
    workers: int | None = None,
    cluster: str | None = None,
    progress: Progress = _ignore_progress,
) -> Reproduction:
    """Reproduce the thesis: its tables, figures and statements beside the twin's.

    Parameters
    ----------
    part
        Chapter (3 to 7, A), study, table, figure or equation, such as "table-4.2". Defaults to
        everything.
    seeds
        Number of roads and noise sequences for the judgement.
    folder
        Folder of the results. Results that it contains are not computed again.
    workers, cluster
        Number of processes on this computer, one per core by default; or the address of a dask
        cluster.
    progress
        Function called with the number of finished jobs and with their total.

    Returns
    -------
    Reproduction
        Tables, figures and statements, each with the thesis' value and the twin's.

    Raises
    ------
    RigtwinError
        If the part does not exist, or the folder cannot be written.
    """
    with open_workers(workers, cluster) as open_:
        return reproduce_thesis(part, seeds, Path(folder), open_, progress)


def rths(
    case: int = 1,
    *,
    quake: str = "elcentro",
    compensator: str = "kalman-inverse",
    plants: int = 1,
    noise: Noise = NONE,
    seed: int = 1,
) -> list[HybridTest]:
    """Run the benchmark of real-time hybrid simulation: a building whose first column is real.

    Parameters
    ----------
    case
        Case of the building, 1 to 4.
    quake
        Earthquake: "elcentro", "kobe" or "morgan".
    compensator
        Name of the delay compensator. The message about an unknown one lists them.
    plants
        Number of plants (actuator and specimen), 1 to 1000. The first is the nominal one, the
        others are drawn.
    noise
        Noise of the position and force converters, in V rms. Defaults to none.
    seed
        Seed of the drawn plants and of the noise.

    Returns
    -------
    list of HybridTest
        Result of each plant: the criteria J1 (ms) and J2 to J9 (%), the largest force (N), motion
        (m) and speed (m/s), and the signals.

    Raises
    ------
    RigtwinError
        For an unknown case, earthquake or compensator, or a number of plants out of range.
    """
    building, law = find_case(case), find_compensator(compensator)
    whole = all(
        isinstance(number, int) and not isinstance(number, bool) for number in (plants, seed)
    )
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
    progress: Progress = _ignore_progress,
) -> check.Result:
    """Check the diagnosis on recordings of an independent rig with withheld defects.

    Parameters
    ----------
    cases
        Number of rigs, at least 1.
    seed
        Seed of the referee's draws.
    folder
        Folder of recordings and answers. Recordings with an answer are not diagnosed again.
    baselines
        Whether to score simpler methods as well.
    workers, cluster
        Number of processes on this computer, one per core by default; or the address of a dask
        cluster.
    progress
        Function called with the number of finished recordings and answers and with their total.

    Returns
    -------
    referee.check.Result
        Answers beside the withheld defects.

    Raises
    ------
    RigtwinError
        If the referee fails, or its key does not match the digest that it published beforehand.
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
    progress: Progress = _ignore_progress,
) -> wild.WildResult | arm.ArmResult:
    """Check the diagnosis on machines other than the rig, with withheld defects.

    Parameters
    ----------
    cases
        Number of machines, at least 1.
    draw
        Kind of the machines. "wild": their physics have forms that the library does not contain.
        "arm": their joints act on each other.
    seed
        Seed of the draws.
    folder
        Folder of the answers. Machines with an answer are not diagnosed again.
    workers, cluster
        Number of processes on this computer, one per core by default; or the address of a dask
        cluster.
    progress
        Function called with the number of finished machines and with their total.

    Returns
    -------
    WildResult or ArmResult
        Answers beside the withheld defects.

    Raises
    ------
    RigtwinError
        For an unknown draw, or if the folder cannot be written.
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
    """Return a function that adds up finished steps and reports them with their total."""
    done = 0

    def step(more: int) -> None:
        nonlocal done
        done += more
        progress(done, total)

    return step
