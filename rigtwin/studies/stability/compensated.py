"""What a controller that compensates the plate's delay is told of the rig, and rigs and filters
that try it."""

from __future__ import annotations

from rigtwin.components.cylinder import told_settings
from rigtwin.description.configuration import Configuration


def tell_plate(configuration: Configuration) -> Configuration:
    """The test whose controller knows the structure cylinder as it is."""
    plant, controller = configuration.plant, configuration.controller
    told = told_settings(plant.structure_cylinder, plant.computer.delay)
    return configuration._replace(controller=controller._replace(**told))


def with_filters(configuration: Configuration, time: float) -> Configuration:
    """The test with all three filters of the controller at that time constant, s."""
    controller = configuration.controller._replace(
        filter_position=time, filter_velocity=time, filter_force=time
    )
    return configuration._replace(controller=controller)


def with_cylinder_delay(configuration: Configuration, delay: float) -> Configuration:
    """The test on a rig whose structure cylinder has that pure delay, s."""
    plant = configuration.plant
    late = plant.structure_cylinder._replace(delay=delay)
    return configuration._replace(plant=plant._replace(structure_cylinder=late))
