"""The energy that a hybrid test's own loop puts into what it emulates.

A model commands a motion and is told a force; the rig makes another motion and carries another
force. Where both meet, the works of the two sides differ, and what the loop adds excites the test
as negative damping would (Mosqueda, Stojadinovic and Mahin, J. Struct. Eng. 133 (2007) 1140). At
the structure: the filtered force that the model feels over the commanded motion, less the load
cell's over the plate's. At the suspension: the load cell's force less the suspension model's at the
travel there really is, over that travel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from controllers import Mode, PlateCompensator, Settings, Skyhook, Travel
from controllers.filters import low_pass
from controllers.gas_spring import gas_force
from controllers.skyhook import semi_active_damping, skyhook_force
from controllers.suspension import suspension_force
from rigtwin.description.configuration import Configuration
from rigtwin.description.control import RigControl
from rigtwin.description.machine import OWN
from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel
from rigtwin.recording import Recording
from rigtwin.signals.band import limit_band
from rigtwin.signals.noise import remove_mains

BAND = 40.0
"""Hz, up to which a sensed travel counts: of the rate above it most is an LVDT's noise, which would
pass for motion that the damper takes up."""
TRUE = ("structure", "suspension", "load_cell")
"""What a twin knows of plate, travel and force."""
LEAST = 64
"""Ticks of the shortest test that is looked at: a filter needs room."""
MATERIAL = 1e-6
"""J; a damper that took up less says nothing."""


@dataclass(frozen=True)
class EnergyError:
    """Of a model-in-the-loop test, J: what the structure's and the suspension's loops put in, below
    0 what they took out; and what the suspension model's damper took up at the travel there was."""

    structure: float
    suspension: float
    damped: float

    @property
    def total(self) -> float:
        """What both loops put in, J."""
        return self.structure + self.suspension

    @property
    def share(self) -> float:
        """`total` over what the damper took up: 0 where the rig is perfect, 1 where the loops undo
        the damper; NaN where there is no damping to speak of."""
        return self.total / self.damped if self.damped > MATERIAL else math.nan

    def __str__(self) -> str:
        does = "put in" if self.total >= 0.0 else "took out"
        size = f"the loop {does} {abs(self.total):.3g} J"
        if not math.isnan(self.share):
            size += f", {abs(100.0 * self.share):.3g} % of what the suspension's damper took up"
        parts = f"structure {self.structure:+.3g} J, suspension {self.suspension:+.3g} J"
        return f"{size} ({parts})"


def measure_energy(
    recording: Recording, configuration: Configuration, own: bool = False
) -> EnergyError | None:
    """The energy error of a recorded test.

    Parameters
    ----------
    recording
        Of the suspension rig. What was sensed is without noise where a twin knows it.
    configuration
        The settings of the test.
    own
        Whether a controller of one's own has the rig's models in it, at these settings, and
        commands other than what they say. Where the models' plate should be is worked out from
        what was sensed then, as it is where the settings compensate the plate's delay.

    Returns
    -------
    EnergyError or None
        None where no model closes the loop, the travel of its suspension is not the rig's own
        (single mass tests), or the controller was another and nothing is known of it.
    """
    settings = configuration.controller
    if settings.mode != Mode.MIL or settings.travel != Travel.WHEEL or recording.ticks < LEAST:
        return None
    if not own and (not recording.controller or OWN in recording.controller):
        return None
    if own or settings.plate_compensator != PlateCompensator.NONE:
        plain = settings._replace(plate_compensator=PlateCompensator.NONE)
        control = RigControl()
        inputs = [recording.column(*channel) for channel in control.channels]
        wanted = control.replay(plain, inputs, recording.period)[1]
    else:
        wanted = recording.column("/command", "structure")
    truth = recording.columns.get("/truth", {})
    if all(name in truth for name in TRUE):
        plate, travel, force = (truth[name] for name in TRUE)
    else:
        # The mains' line is in force and motion alike, so that their product does not average out.
        mains = configuration.plant.mains.frequency
        plate, travel, force = (
            remove_mains(recording.column("/sensor", name), recording.period, mains)
            for name in ("structure_lvdt", "suspension_lvdt", "load_cell")
        )
        travel = limit_band(travel, BAND, recording.period)
    works = _work(
        settings=settings,
        period=recording.period,
        wanted=wanted,
        plate=plate,
        travel=travel,
        force=force,
        felt=recording.column("/sensor", "load_cell"),
        rate=np.gradient(travel, recording.period),
        body=np.gradient(wanted, recording.period),
    )
    return EnergyError(*works)


@kernel
def _work(
    settings: Settings,
    period: float,
    wanted: Array,
    plate: Array,
    travel: Array,
    force: Array,
    felt: Array,
    rate: Array,
    body: Array,
) -> tuple[float, float, float]:
    """wanted: the plate's commanded motion; felt: the force as the controller gets it; rate: of
    the travel; body: of the commanded motion."""
    structure = suspension = damped = 0.0
    filtered = felt[0]
    model_before = rig_before = error_before = 0.0
    for tick in range(len(wanted)):
        filtered = low_pass(filtered, felt[tick], settings.filter_force, period)
        beside = 0.0
        if settings.gas_force > 0.0:
            beside = gas_force(
                settings.gas_force, settings.gas_length, settings.gas_exponent, -travel[tick]
            )
        model, rig = filtered + beside, force[tick] + beside
        should = suspension_force(settings, travel[tick], rate[tick])
        should -= skyhook_force(settings, body[tick], rate[tick])
        error = force[tick] - should
        damping = settings.suspension_damping
        if settings.skyhook == Skyhook.SEMI_ACTIVE:
            damping += semi_active_damping(settings, body[tick], rate[tick])
        if tick > 0:
            structure += 0.5 * (model_before + model) * (wanted[tick] - wanted[tick - 1])
            structure -= 0.5 * (rig_before + rig) * (plate[tick] - plate[tick - 1])
            suspension += 0.5 * (error_before + error) * (travel[tick] - travel[tick - 1])
            damped += damping * rate[tick] ** 2 * period
        model_before, rig_before, error_before = model, rig, error
    return structure, suspension, damped
