"""Studies on the twin: identifiability, reproduction of the thesis, checks of the diagnosis."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from experiments.rths.actuator import draw_plants
from experiments.rths.building import find_case
from experiments.rths.compensators import find_compensator
from experiments.rths.ground_motion import ground_motion
from experiments.rths.hybrid_test import HybridTest as HybridTest
from experiments.rths.hybrid_test import run_test
from experiments.rths.noise import NONE, Noise
from experiments.rths.tuning import TunedCompensator as TunedCompensator
from experiments.rths.tuning import tune_compensator as tune_compensator
from experiments.thesis.result import Reproduction
from experiments.thesis.result import reproduce as reproduce_thesis
from referee import arm, check, servo, wild
from rigtwin.api.machines import resolve_machine
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.studies.identifiability import Identifiability as Identifiability
from rigtwin.studies.identifiability import find_identifiable
from rigtwin.studies.sweep import open_workers

MOST_PLANTS = 1000
Draw = Literal["wild", "arm", "servo"]
Progress = Callable[[int, int], object]
"""Function called with the number of finished steps and with their total."""


def ignore_progress(*_: object) -> None:
    """Discard a report of progress."""


def identifiability(
    machine: Machine | str | Path,
    *,
    seconds: float = math.inf,
    progress: Callable[[str], object] = ignore_progress,
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


def reproduce(
    part: str | None = None,
    *,
    seeds: int = 32,
    folder: str | Path = "reproduction",
    workers: int | None = None,
    cluster: str | None = None,
    progress: Progress = ignore_progress,
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
    progress: Progress = ignore_progress,
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
        step = count_steps(progress, 2 * cases)
        return check.check(Path(folder), cases, seed, baselines, open_, step)


def blindcheck_machines(
    cases: int = 200,
    *,
    draw: Draw = "wild",
    seed: int = 2026,
    folder: str | Path = "blindcheck",
    workers: int | None = None,
    cluster: str | None = None,
    progress: Progress = ignore_progress,
) -> wild.WildResult | arm.ArmResult | servo.ServoResult:
    """Check the diagnosis on machines other than the rig, with withheld defects.

    Parameters
    ----------
    cases
        Number of machines, at least 1.
    draw
        Kind of the machines. "wild": their physics have forms that the library does not contain.
        "arm": their joints act on each other. "servo": links on servos, known by command and angle
        alone.
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
    WildResult, ArmResult or ServoResult
        Answers beside the withheld defects.

    Raises
    ------
    RigtwinError
        For an unknown draw, or if the folder cannot be written.
    """
    _check_draw(cases, seed)
    checks = {"wild": wild.check_wild, "arm": arm.check_arms, "servo": servo.check_servos}
    if draw not in checks:
        raise RigtwinError(f"draw {draw!r:.40}: expected one of {', '.join(checks)}")
    with open_workers(workers, cluster) as open_:
        return checks[draw](Path(folder), cases, seed, open_, count_steps(progress, cases))


def _check_draw(cases: int, seed: int) -> None:
    if cases < 1 or seed < 0:
        raise RigtwinError("cases: expected 1 or more; seed: 0 or more")


def count_steps(progress: Progress, total: int) -> Callable[[int], None]:
    """Return a function that adds up finished steps and reports them with their total."""
    done = 0

    def step(more: int) -> None:
        nonlocal done
        done += more
        progress(done, total)

    return step
