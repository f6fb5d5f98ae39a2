"""Test settings for studies of the plate's delay compensation: exact knowledge, filters, delays."""

from __future__ import annotations

from rigtwin.components.cylinder import told_settings
from rigtwin.description.configuration import Configuration


def with_exact_plate(configuration: Configuration) -> Configuration:
    """Return the test with the true structure cylinder in the controller's settings."""
    plant, controller = configuration.plant, configuration.controller
    settings = told_settings(plant.structure_cylinder, plant.computer.delay)
    return configuration._replace(controller=controller._replace(**settings))


def with_filters(configuration: Configuration, time: float) -> Configuration:
    """Return the test with one time constant, in s, for all three filters of the controller."""
    controller = configuration.controller._replace(
        filter_position=time, filter_velocity=time, filter_force=time
    )
    return configuration._replace(controller=controller)


def with_cylinder_delay(configuration: Configuration, delay: float) -> Configuration:
    """Return the test on a rig whose structure cylinder has a pure delay, in s."""
    plant = configuration.plant
    late = plant.structure_cylinder._replace(delay=delay)
    return configuration._replace(plant=plant._replace(structure_cylinder=late))
