"""What the controller is told to do. The fields and labels are those of `config.controller` in a recording."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from controllers.quantity import Choice, Quantity


class Mode(Choice):
    """`mil`: suspension and structure models close the loop; `imposed`: force and motions are demanded from outside."""

    MIL = 0
    IMPOSED = 1


class Travel(Choice):
    """What the suspension model's travel is measured from: the wheel, or the ground (single mass tests, thesis §3.6)."""

    WHEEL = 0
    GROUND = 1


class Structure(Choice):
    """The structure model: a point mass."""

    POINT = 0


class Compensator(Choice):
    """The friction compensator: none."""

    NONE = 0


class Skyhook(Choice):
    """The skyhook law (thesis §7.1)."""

    NONE = 0
    ACTIVE = 1
    SEMI_ACTIVE = 2


class Settings(NamedTuple):
    """Controller settings; nominal is the quarter car of thesis Table 6.2 and 7.1."""

    mode: Mode = Mode.MIL
    travel: Travel = Travel.WHEEL
    structure: Structure = Structure.POINT
    compensator: Compensator = Compensator.NONE
    start: Annotated[float, Quantity("m", -0.15, 0.15, "-preload / tyre stiffness, rig start position")] = -0.004
    sprung_mass: Annotated[float, Quantity("kg", 1.0, 1e5, "thesis Table 6.2")] = 25.0
    suspension_stiffness: Annotated[float, Quantity("N/m", 0.0, 2e7, "thesis Table 6.2")] = 1000.0
    suspension_damping: Annotated[float, Quantity("Ns/m", 0.0, 2e5, "thesis Table 6.2")] = 50.0
    preload: Annotated[float, Quantity("N", 0.0, 1e6, "thesis Table 6.2")] = 200.0
    gravity: Annotated[float, Quantity("m/s^2", 0.0, 30.0, "standard")] = 9.81
    skyhook: Skyhook = Skyhook.NONE
    skyhook_damping: Annotated[float, Quantity("Ns/m", 0.0, 1e4, "thesis Table 7.1: 200; 0 when off")] = 0.0
    damping_max: Annotated[float, Quantity("Ns/m", 0.0, 1e4, "thesis Table 7.1")] = 500.0
    damping_min: Annotated[float, Quantity("Ns/m", 0.0, 1e4, "thesis Table 7.1")] = 10.0
    filter_position: Annotated[float, Quantity("s", 0.0, 1.0, "thesis §6.2")] = 0.01
    filter_velocity: Annotated[float, Quantity("s", 0.0, 1.0, "thesis §6.2")] = 0.01
    filter_force: Annotated[float, Quantity("s", 0.0, 1.0, "thesis §6.1.2")] = 0.01
    kff: Annotated[float, Quantity("1", 0.0, 5.0, "assumed, the thesis does not give it")] = 1.0
    kp: Annotated[float, Quantity("1", 0.0, 20.0, "assumed, the thesis does not give it")] = 0.3
    ki: Annotated[float, Quantity("1/s", 0.0, 1e3, "assumed, the thesis does not give it")] = 10.0
    voltage_limit: Annotated[float, Quantity("V", 0.0, 10.0, "amplifier input ±10 V")] = 10.0
