"""Settings of the controller.

Fields and labels are those of `config.controller` in a recording.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from controllers import closed_loop as loop
from controllers.quantity import Choice, Quantity

_CHOSEN = "the thesis does not give it; docs/friction.md"
_COMPENSATION = "docs/compensation.md"
_BEAM = "thesis Table 7.4"


class Mode(Choice):
    """Mode of a test.

    In `mil` the models of suspension and structure close the loop. In `imposed` force and motions
    follow given signals.
    """

    MIL = 0
    IMPOSED = 1


class Travel(Choice):
    """Travel of the suspension model.

    `wheel` is plate minus wheel. `ground` is plate minus ground, for single-mass tests (thesis
    §3.6). `model` is structure model minus demanded ground, without any sensor (thesis Fig. 4.1).
    """

    WHEEL = 0
    GROUND = 1
    MODEL = 2


class Structure(Choice):
    """Structure model: a point mass, or the cross of elastic beams (thesis §7.2)."""

    POINT = 0
    BEAM = 1


class Compensator(Choice):
    """Friction compensator of the motor.

    The thesis has one or two steps (§4.5, §4.6), and two partial forms for comparison (Table 4.1).
    `observer` estimates the friction force.
    """

    NONE = 0
    ONE_STEP = 1
    TWO_STEP = 2
    FORCE_PROFILE = 3
    FORCE_THRESHOLD = 4
    OBSERVER = 5


class PlateCompensator(Choice):
    """Delay compensator between the structure model and its cylinder (docs/compensation.md).

    It is designed from the cylinder model in the settings plate_b2 to plate_delay. Imposed tests
    run without it.
    """

    NONE = 0
    FORWARD_PREDICTION = 1
    LAG = 2
    KALMAN_INVERSE = 3


class Skyhook(Choice):
    """Skyhook law (thesis §7.1)."""

    NONE = 0
    ACTIVE = 1
    SEMI_ACTIVE = 2


class Settings(NamedTuple):
    """Settings of the controller, with unit, bounds and source in the types.

    The defaults are the quarter car of thesis Tables 6.2 and 7.1.
    """

    mode: Mode = Mode.MIL
    travel: Travel = Travel.WHEEL
    structure: Structure = Structure.POINT
    compensator: Compensator = Compensator.NONE
    start: Annotated[
        float, Quantity("m", -0.15, 0.15, "-preload / tyre stiffness, rig start position")
    ] = -0.004
    sprung_mass: Annotated[float, Quantity("kg", 1.0, 1e5, "thesis Table 6.2")] = 25.0
    suspension_stiffness: Annotated[float, Quantity("N/m", 0.0, 2e7, "thesis Table 6.2")] = 1000.0
    suspension_damping: Annotated[float, Quantity("Ns/m", 0.0, 2e5, "thesis Table 6.2")] = 50.0
    preload: Annotated[float, Quantity("N", 0.0, 1e6, "thesis Table 6.2")] = 200.0
    gravity: Annotated[float, Quantity("m/s^2", 0.0, 30.0, "standard")] = 9.81
    skyhook: Skyhook = Skyhook.NONE
    skyhook_damping: Annotated[
        float, Quantity("Ns/m", 0.0, 1e4, "thesis Table 7.1: 200; 0 when off")
    ] = 0.0
    damping_max: Annotated[float, Quantity("Ns/m", 0.0, 1e4, "thesis Table 7.1")] = 500.0
    damping_min: Annotated[float, Quantity("Ns/m", 0.0, 1e4, "thesis Table 7.1")] = 10.0
    filter_position: Annotated[float, Quantity("s", 0.0, 1.0, "thesis §6.2")] = 0.01
    filter_velocity: Annotated[float, Quantity("s", 0.0, 1.0, "thesis §6.2")] = 0.01
    filter_force: Annotated[float, Quantity("s", 0.0, 1.0, "thesis §6.1.2")] = 0.01
    kff: Annotated[float, Quantity("1", 0.0, 5.0, "assumed, the thesis does not give it")] = 1.0
    kp: Annotated[float, Quantity("1", 0.0, 20.0, "assumed, the thesis does not give it")] = 0.3
    ki: Annotated[float, Quantity("1/s", 0.0, 1e3, "assumed, the thesis does not give it")] = 10.0
    voltage_limit: Annotated[float, Quantity("V", 0.0, 10.0, "amplifier input ±10 V")] = 10.0
    friction_step: Annotated[
        float, Quantity("N", 0.0, 1e3, "the jump 2·F_c, 0.15 V; thesis §4.4")
    ] = 27.9
    spike_threshold: Annotated[float, Quantity("N", 0.0, 1e3, "thesis Fig. 4.7")] = 4.0
    spike_gradient: Annotated[float, Quantity("N/s", 0.0, 1e6, "0.2 N a sample, thesis §4.5.2")] = (
        200.0
    )
    spike_samples: Annotated[float, Quantity("1", 1.0, 5.0, "five gradients, thesis §4.5.2")] = 5.0
    crossing_time: Annotated[float, Quantity("s", 0.0, 1.0, "thesis §4.5.1")] = 0.03
    crossing_prediction: Annotated[float, Quantity("s", 0.0, 0.1, _CHOSEN)] = 0.005
    crossing_extension: Annotated[float, Quantity("s", 0.0, 0.5, _CHOSEN)] = 0.01
    filter_acceleration: Annotated[float, Quantity("s", 0.0, 1.0, _CHOSEN)] = 0.02
    compensation_buffer: Annotated[float, Quantity("s", 0.0, 1.0, "thesis §4.6")] = 0.04
    observer_lag: Annotated[float, Quantity("s", 0.0, 1.0, _CHOSEN)] = 0.01
    observer_gate: Annotated[float, Quantity("N", 0.0, 1e3, _CHOSEN)] = 6.0
    observer_notch: Annotated[float, Quantity("Hz", 0.0, 100.0, _CHOSEN)] = 0.5
    beam_modulus: Annotated[float, Quantity("N/m^2", 1.0, 1e13, _BEAM)] = 1.2e6
    beam_inertia: Annotated[float, Quantity("m^4", 1e-12, 1e3, _BEAM)] = 0.01
    beam_length: Annotated[float, Quantity("m", 0.01, 100.0, _BEAM)] = 2.0
    beam_area: Annotated[float, Quantity("m^2", 1e-9, 10.0, _BEAM)] = 3.828e-4
    beam_density: Annotated[float, Quantity("kg/m^3", 1.0, 1e5, _BEAM)] = 2721.0
    beam_damping: Annotated[
        float, Quantity("s", 0.0, 10.0, "times the stiffness; thesis Table 7.4")
    ] = 0.01
    beam_sag: Annotated[
        float, Quantity("1", 0.0, 1.0, "0: starts straight; 1: bent as the preload bends it")
    ] = 0.0
    gas_force: Annotated[
        float, Quantity("N", 0.0, 1e7, "of a real gas spring beside the motor, extended; 0: none")
    ] = 0.0
    gas_length: Annotated[float, Quantity("m", 0.01, 10.0, "of its gas column, thesis Eq. 3.3")] = (
        0.217
    )
    gas_exponent: Annotated[float, Quantity("1", 1.0, 1.7, "of its gas, thesis Eq. 3.3")] = 1.4
    plate_compensator: PlateCompensator = PlateCompensator.NONE
    plate_b2: loop.B2 = loop.NOMINAL.b2
    plate_b1: loop.B1 = loop.NOMINAL.b1
    plate_b0: loop.B0 = loop.NOMINAL.b0
    plate_a3: loop.A3 = loop.NOMINAL.a3
    plate_a2: loop.A2 = loop.NOMINAL.a2
    plate_a1: loop.A1 = loop.NOMINAL.a1
    plate_a0: loop.A0 = loop.NOMINAL.a0
    plate_gain: loop.Gain = loop.NOMINAL.gain
    plate_lag: loop.Lag = loop.NOMINAL.lag
    plate_delay: loop.Delay = loop.NOMINAL.delay
    plate_effort: Annotated[
        float, Quantity("1", 1e-8, 1.0, f"of the command's deviation; {_COMPENSATION}")
    ] = 1e-3
    plate_roughness: Annotated[
        float, Quantity("s^3", 1e-15, 1.0, f"noise of what is desired; {_COMPENSATION}")
    ] = 1e-4
    plate_noise: Annotated[
        float, Quantity("m", 1e-9, 0.1, f"of the plate's sensor; {_COMPENSATION}")
    ] = 1e-3
