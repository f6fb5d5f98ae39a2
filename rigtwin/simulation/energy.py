"""Energy error of a hybrid test: the energy that its loop adds to the emulated system.

The model commands a motion and receives a measured force. The rig makes another motion and carries
another force. At their interface, the works of the two sides differ, and the energy that the loop
adds excites the test like negative damping (Mosqueda, Stojadinovic and Mahin, J. Struct. Eng. 133
(2007) 1140):

    structure   E_s = ∫ F_filtered dz_commanded − ∫ F_load_cell dz_plate
    suspension  E_t = ∫ (F_load_cell − F_model(travel)) d travel
    damper      E_d = ∫ d·travel'² dt
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
from rigtwin.recording import RecordedTest
from rigtwin.signals.band import limit_band
from rigtwin.signals.noise import remove_mains

BAND = 40.0
"""Cut-off frequency of a measured travel, Hz. Above it, the rate of the travel is mostly noise of
the LVDT, which would count as energy of the damper."""
TRUE = ("structure", "suspension", "load_cell")
"""Names of plate, travel and force among a twin's true values."""
LEAST = 64
"""Ticks of the shortest test that is evaluated. The filters need that many samples."""
MATERIAL = 1e-6
"""Smallest energy of the damper to which an energy error is related, J."""


@dataclass(frozen=True)
class EnergyError:
    """Energy error of a model-in-the-loop test.

    Attributes
    ----------
    structure, suspension : float
        Energy added by the loops of structure and suspension, J; negative if they remove energy.
    damped : float
        Energy that the model's suspension damper dissipates at the actual travel, J.
    """

    structure: float
    suspension: float
    damped: float

    @property
    def total(self) -> float:
        """Energy added by both loops, J."""
        return self.structure + self.suspension

    @property
    def share(self) -> float:
        """`total` as a share of the damper's energy.

        It is 0 for a perfect rig and 1 where the loops cancel the damper. It is NaN where the
        damper dissipates next to nothing.
        """
        return self.total / self.damped if self.damped > MATERIAL else math.nan

    def __str__(self) -> str:
        does = "put in" if self.total >= 0.0 else "took out"
        size = f"the loop {does} {abs(self.total):.3g} J"
        if not math.isnan(self.share):
            size += f", {abs(100.0 * self.share):.3g} % of what the suspension's damper took up"
        parts = f"structure {self.structure:+.3g} J, suspension {self.suspension:+.3g} J"
        return f"{size} ({parts})"


def measure_energy(
    recording: RecordedTest, configuration: Configuration, foreign: bool = False
) -> EnergyError | None:
    """Compute the energy error of a recorded test.

    Parameters
    ----------
    recording
        Recording of the suspension rig. True values of a twin are used where it has them.
    configuration
        Settings of the test.
    foreign
        Whether a controller of the user contains the rig's models at these settings, and commands
        something else than they ask for. The models' motion is then recomputed from the sensors,
        as it is where the settings compensate the plate's delay.

    Returns
    -------
    EnergyError or None
        None if no model closes the loop, if its suspension's travel is not the rig's (single-mass
        tests), or if the controller is unknown.
    """
    settings = configuration.controller
    if settings.mode != Mode.MIL or settings.travel != Travel.WHEEL or recording.ticks < LEAST:
        return None
    if not foreign and (not recording.controller or OWN in recording.controller):
        return None
    if foreign or settings.plate_compensator != PlateCompensator.NONE:
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
        # Force and motion both contain the mains hum, so its product does not average out.
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
        body_rate=np.gradient(wanted, recording.period),
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
    body_rate: Array,
) -> tuple[float, float, float]:
    """Return the energies of structure, suspension and damper, J.

    `wanted` is the commanded motion of the plate, m, and `body_rate` its velocity, m/s. `felt` is
    the force that the controller reads, N, `force` the actual one. `rate` is that of the travel,
    m/s. All have shape (ticks,).
    """
    structure = suspension = damped = 0.0
    filtered = felt[0]
    model_before = rig_before = error_before = 0.0
    for tick in range(len(wanted)):
        # The model feels the force behind the controller's filter.
        filtered = low_pass(filtered, felt[tick], settings.filter_force, period)
        gas = 0.0
        if settings.gas_force > 0.0:
            gas = gas_force(
                settings.gas_force, settings.gas_length, settings.gas_exponent, -travel[tick]
            )
        model, rig = filtered + gas, force[tick] + gas
        modelled = suspension_force(settings, travel[tick], rate[tick])
        modelled -= skyhook_force(settings, body_rate[tick], rate[tick])
        error = force[tick] - modelled
        damping = settings.suspension_damping
        if settings.skyhook == Skyhook.SEMI_ACTIVE:
            damping += semi_active_damping(settings, body_rate[tick], rate[tick])
        # Work by the trapezoidal rule.
        if tick > 0:
            structure += 0.5 * (model_before + model) * (wanted[tick] - wanted[tick - 1])
            structure -= 0.5 * (rig_before + rig) * (plate[tick] - plate[tick - 1])
            suspension += 0.5 * (error_before + error) * (travel[tick] - travel[tick - 1])
            damped += damping * rate[tick] ** 2 * period
        model_before, rig_before, error_before = model, rig, error
    return structure, suspension, damped
