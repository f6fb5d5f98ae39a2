"""A test that is planned for supervision: its settings, demands and channel table."""

from __future__ import annotations

from pathlib import Path

from machines import DEFAULT_MACHINE
from rigtwin.api.machines import resolve_machine
from rigtwin.api.twin import Effects, Settings, effect_texts
from rigtwin.description.changes import with_changes
from rigtwin.description.configuration import Configuration
from rigtwin.description.limits import require_order
from rigtwin.description.machine import Machine
from rigtwin.errors import RigtwinError
from rigtwin.hardware.daq.table import ChannelTable
from rigtwin.hardware.daq.table_file import load_table
from rigtwin.hardware.session.custom_controller import ControllerFactory, custom_controller
from rigtwin.hardware.session.test import AnyTest
from rigtwin.simulation.experiment import find_experiment


def plan_test(
    experiment: str,
    *,
    machine: Machine | str | Path = DEFAULT_MACHINE,
    card: str | Path | None = None,
    settings: Settings = (),
    seed: int = 0,
    effects: Effects = (),
    controller: ControllerFactory | None = None,
) -> AnyTest:
    """Return a test that is ready for supervision.

    Parameters
    ----------
    experiment
        Name of an experiment of the machine.
    machine
        Machine, its name, or the path of its description. Machines other than the suspension rig
        may have force actuators and servos only.
    card
        Channel table of the card, TOML. Defaults to the shipped one of the suspension rig; other
        machines need their own.
    settings
        Changes of the configuration, such as {"safety": {"force": 1200}}, or the path of a TOML
        file, or a sequence of both.
    seed
        Seed of the twin's noise and of the road, at least 0.
    effects
        Effects added to the twin. They do not apply to the machine itself.
    controller
        Function of the test's configuration that returns a custom controller, see `run`. It is
        called once for each session.

    Returns
    -------
    AnyTest
        The planned test.

    Raises
    ------
    RigtwinError
        For a mistake in any argument, or a controller that the machine cannot run.
    """
    if not isinstance(seed, int) or seed < 0:
        raise RigtwinError(f"seed {seed!r:.60}: expected a whole number from 0")
    described = resolve_machine(machine)
    test = find_experiment(described, experiment)
    configuration = check_settings(described, test.configuration, settings)
    return described.physics.plan(
        described,
        test,
        configuration,
        seed,
        _load_table_of(described, card),
        tuple(effect_texts(effects)),
        None if controller is None else custom_controller(controller),
    )


def _load_table_of(machine: Machine, card: str | Path | None) -> ChannelTable:
    """Return the channel table of a machine's card. Raise RigtwinError if none is known."""
    path = machine.physics.card if card is None else Path(card)
    if path is None:
        raise RigtwinError(
            f"{machine.name}: no channel table; expected the table of the card it is wired to"
        )
    return load_table(path, machine.physics.signals(machine))


def check_settings(machine: Machine, base: Configuration, changes: Settings) -> Configuration:
    """Return changed settings. Raises RigtwinError if no test can be run with them."""
    configuration = with_changes(base, changes)
    require_order(machine, configuration)
    # Both properties raise where period and timestep do not divide the duration.
    _ = configuration.ticks, configuration.substeps
    return configuration
