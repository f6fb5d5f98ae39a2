"""`python -m benchmarks`: every promised run time beside its reference, in alternating rounds."""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mujoco
import numpy as np

from controllers import Compensator, Structure
from controllers.beam import AT_REST, Modes, Six, beam, centre, modes
from experiments import EXPERIMENTS
from rigtwin.description.catalogue import find
from rigtwin.description.effects import apply_effects
from rigtwin.description.settings import Safety, Timing
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.numerics.compiling import kernel, step
from rigtwin.rig.simulated import simulate_recording
from rigtwin.simulation.compiled_loop import run_compiled
from rigtwin.simulation.loop import BLOCK
from rigtwin.simulation.plant import Simulation
from rigtwin.simulation.runner import record
from rigtwin.simulation.twin import Twin

DROP = EXPERIMENTS["drop"]
CONFIGURATION = DROP.configuration
DEMANDS = DROP.demands(CONFIGURATION, 0)


@kernel
def _steps(model: int, data: int, count: int) -> None:
    """Run `mj_step` many times; model and data are addresses."""
    for _ in range(count):
        step(model, data)


def _bare() -> None:
    """Run as many bare `mj_step` of the model as a drop test takes, with the plates at rest."""
    settings = CONFIGURATION.controller
    simulation = Simulation(
        CONFIGURATION.plant, CONFIGURATION.timing.timestep, 4, 0.0, settings.start, settings.preload
    )
    _steps(
        simulation.model._address, simulation.data._address, len(DEMANDS) * CONFIGURATION.substeps
    )


def _closed_loop(block: int = BLOCK) -> None:
    """Run a drop test on the twin; block: ticks per compiled call."""
    for _ in run_compiled(Twin(CONFIGURATION, 0.0, 0), CONFIGURATION, DEMANDS, block):
        pass


def _sixteen_rigs(threads: int) -> None:
    """Run sixteen rigs on some threads."""
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(_closed_loop, [len(DEMANDS)] * 16):
            pass


def _long_test(recorded: bool) -> None:
    """Run a test of 45 s, recorded or not."""
    experiment = EXPERIMENTS["single-mass"]
    configuration = experiment.configuration
    demands = experiment.demands(configuration, 0)
    if not recorded:
        for _ in run_compiled(Twin(configuration, 0.0, 0), configuration, demands):
            pass
        return
    with tempfile.TemporaryDirectory() as folder:
        record(Path(folder) / "r.mcap", "single-mass", configuration, demands, 0)


@kernel
def _beam_ticks(model: Modes, start: Six, ticks: int) -> float:
    displacements, rates = start, start
    for tick in range(ticks):
        displacements, rates = beam(model, displacements, rates, float(tick % 7))
    # The result uses all modes; the compiler would remove unused ones.
    return centre(model, displacements)


def _beams() -> None:
    """Print the run time of one compiled tick of the beam model."""
    model, ticks = modes(CONFIGURATION.controller, 1e-3), 200_000
    _beam_ticks(model, AT_REST, 10)
    took = (
        statistics.median(_seconds(lambda: _beam_ticks(model, AT_REST, ticks)) for _ in range(5))
        / ticks
    )
    print(f"one tick of the cross of beams {1e6 * took:.3f} us; goal < 5 us", flush=True)


def _loaded_loop() -> None:
    """Run the closed loop with every optional part of the controller."""
    settings = CONFIGURATION.controller._replace(
        structure=Structure.BEAM, compensator=Compensator.TWO_STEP, beam_sag=1.0
    )
    configuration = CONFIGURATION._replace(controller=settings, safety=Safety(1e9, 1e9, 1e9))
    for _ in run_compiled(Twin(configuration, 0.0, 0), configuration, DEMANDS):
        pass


def _help() -> None:
    """Run `rigtwin --help` in a new process."""
    subprocess.run(
        [sys.executable, "-m", "rigtwin", "--help"], check=True, stdout=subprocess.DEVNULL
    )


def _python() -> None:
    """Start and end a bare Python."""
    subprocess.run([sys.executable, "-c", "pass"], check=True)


def _seconds(work: Callable[[], object]) -> float:
    """Return the run time of a function, s."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def _side_by_side(
    title: str,
    goal: str,
    ours: Callable[[], object],
    against: Callable[[], object],
    rounds: int = 7,
) -> None:
    """Print the medians of alternating rounds, and the spread of their ratio."""
    ours()
    against()
    pairs = [(_seconds(ours), _seconds(against)) for _ in range(rounds)]
    mine, theirs = (statistics.median(column) for column in zip(*pairs, strict=True))
    ratios = sorted(first / second for first, second in pairs)
    spread = f"{ratios[0]:.2f} to {ratios[-1]:.2f}"
    print(
        f"{title:58s} {mine:7.3f} s / {theirs:7.3f} s = {statistics.median(ratios):5.2f} "
        f"({spread}); goal {goal}",
        flush=True,
    )


def _diagnosed(seconds: float) -> Callable[[], object]:
    """Return a function that diagnoses an imposed test with one effect; seconds: its length."""
    imposed = EXPERIMENTS["imposed"]
    configuration = imposed.configuration._replace(timing=Timing(duration=seconds))
    rig, demands = find("suspension-rig"), imposed.demands(configuration, 0)
    configuration = apply_effects(configuration, ["coulomb@motor=20"])
    recording = simulate_recording(rig.name, "imposed", configuration, demands, 1)
    return lambda: diagnose(rig, [recording])


def _twenty_runs() -> None:
    """Run the twin twenty times for 30 s."""
    imposed = EXPERIMENTS["imposed"]
    configuration = imposed.configuration._replace(timing=Timing(duration=30.0))
    demands = imposed.demands(configuration, 0)
    for _ in range(20):
        for _ in run_compiled(Twin(configuration, 0.0, 0), configuration, demands):
            pass


def _diagnosis() -> None:
    """Print the run time of a diagnosis of 30 s beside a thousand runs of the twin.

    Twenty runs are timed and scaled up.
    """
    once, _ = _diagnosed(30.0), _diagnosed(30.0)()
    pairs = [(_seconds(once), _seconds(_twenty_runs)) for _ in range(3)]
    mine, theirs = (statistics.median(column) for column in zip(*pairs, strict=True))
    print(
        f"diagnosis of 30 s {mine:.1f} s / 1000 runs of the twin {50 * theirs:.0f} s = "
        f"{mine / (50 * theirs):.3f}; goal <= 15 s"
    )
    short = statistics.median(_seconds(_diagnosed(15.0)) for _ in range(3))
    print(
        f"diagnosis of 30 s / of 15 s {mine:.1f} s / {short:.1f} s = {mine / short:.2f}; "
        "goal <= 2, linear"
    )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"most memory of all this {peak:.0f} MiB; goal <= 1024 MiB", flush=True)


def main() -> None:
    """Print all comparisons."""
    print(f"mujoco {mujoco.__version__}, numpy {np.__version__}, alternating rounds")
    _side_by_side("closed loop with all controllers / bare mj_step", "<= 1.5", _closed_loop, _bare)
    _side_by_side(
        "closed loop with beams and compensator / without", "<= 1.2", _loaded_loop, _closed_loop
    )
    _beams()
    _side_by_side(
        "16 rigs, one thread / two threads",
        ">= 1.7",
        lambda: _sixteen_rigs(1),
        lambda: _sixteen_rigs(2),
        3,
    )
    _side_by_side(
        "45 s test recorded / not recorded",
        "<= 1.2",
        lambda: _long_test(True),
        lambda: _long_test(False),
    )
    _side_by_side("rigtwin --help / starting Python", "< 0.5 s", _help, _python)
    _diagnosis()


if __name__ == "__main__":
    main()
