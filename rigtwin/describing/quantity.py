"""Quantities that a column of a log can hold, and the words by which columns name them."""

from __future__ import annotations

from enum import Enum


class JointQuantity(Enum):
    """Quantity of one joint, as a column can hold it."""

    POSITION = "position"
    VELOCITY = "velocity"
    FORCE = "force"
    CURRENT = "current"
    COMMAND = "command"
    """Command of the joint's actuator: a position, or a force, as the actuator takes it."""
    FORCE_COMMAND = "force command"
    """Command that says itself that it is a force or a torque."""
    VELOCITY_COMMAND = "velocity command"
    """Command that says itself that it is a velocity."""
    CURRENT_COMMAND = "current command"
    """Command that says itself that it is a current."""
    VOLTAGE = "voltage"
    """Voltage of the joint's motor."""
    OTHER = "other"
    """Quantity that no test needs, such as an acceleration or a temperature."""


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


WORDS: dict[JointQuantity, frozenset[str]] = {
    JointQuantity.POSITION: _words(
        "pos position positions angle angles ang q qpos theta phi alpha beta psi encoder enc disp "
        "displacement travel coordinate jointpos rotation location place qm winkel weg "
        "angulo posicion"
    ),
    JointQuantity.VELOCITY: _words(
        "vel velocity velocities speed dq qd qvel qdot omega rate dtheta thetadot dphi rpm "
        "jointvel geschwindigkeit drehzahl vitesse velocidad"
    ),
    JointQuantity.FORCE: _words(
        "tau torque torques force forces effort efforts trq tq frc moment loadcell "
        "fx fy fz mx my mz kraft drehmoment couple par fuerza"
    ),
    JointQuantity.CURRENT: _words(
        "current currents cur curr amps amperage iq im strom courant corriente"
    ),
    JointQuantity.VOLTAGE: _words("voltage volt volts vm"),
    JointQuantity.OTHER: _words(
        "acc accel acceleration ddq qdd qacc temp temperature error err status mode flag index "
        "episode frame task imu gyro quat id seq count"
    ),
}
"""Quantity → words that name it."""
COMMANDED = _words(
    "cmd command commands commanded target targets goal goals desired des ref reference setpoint "
    "set qref qdes qcmd action actions demand demanded ctrl control u sp input joy joystick "
    "soll sollwert consigne consigna"
)
"""Words that say that a column was commanded and not measured."""
REFERENCES = _words(
    "target targets goal goals desired des ref reference setpoint set qref qdes sp soll sollwert "
    "consigne consigna"
)
"""Those of them that name the setpoint of a controller, and not what an actuator is given."""
MEASURED = _words(
    "measured meas actual act present read reading feedback fb observation obs state real data "
    "raw value states joint joints motor actuator servo drive axis link j m sensor of the "
    "controller ist istwert"
)
"""Words that say nothing more."""
UNIT_WORDS = {
    "deg": "deg",
    "degs": "deg",
    "degree": "deg",
    "degrees": "deg",
    "grados": "deg",
    "rad": "rad",
    "rads": "rad",
    "radians": "rad",
    "mrad": "mrad",
    "rev": "rev",
    "revs": "rev",
    "turns": "rev",
    "gon": "gon",
    "percent": "%",
    "pct": "%",
    "mm": "mm",
    "cm": "cm",
    "meters": "m",
    "metres": "m",
    "nm": "Nm",
    "mnm": "mNm",
    "knm": "kNm",
    "ncm": "Ncm",
    "newton": "N",
    "millinewton": "mN",
    "kilonewton": "kN",
    "amp": "A",
    "amps": "A",
    "ma": "mA",
    "rpm": "rpm",
    "dps": "deg/s",
    "rps": "rev/s",
    "radps": "rad/s",
    "mmps": "mm/s",
}
"""Word in a column's name → unit that it states."""
RATES = {"deg": "deg/s", "rad": "rad/s", "rev": "rev/s", "mm": "mm/s", "cm": "cm/s", "m": "m/s"}
"""Word before a last word "s" → unit of a velocity that both state."""
COUNTS = _words("counts ticks pulses")
"""Words that say that a position is in counts of an encoder."""
AXIAL = _words("fx fy fz mx my mz")
"""Forces and moments along an axis. Without the name of a joint they may be those of another
sensor, as mx is of a magnetometer."""
COORDINATES = _words("x y z xc")
"""Names of a position along a line."""
ANGULAR = _words("theta phi alpha beta psi angle angles ang omega rpm")
"""Words for quantities of a hinge."""
TESTS = _words("episode ep run trial rollout traj trajectory repetition rep experiment")
"""Words that name the number of a test."""
COUNTING = _words("index idx id number nr no num")
"""Words that may stand beside them."""
TIME = _words(
    "t time timespan timestamp timestamps stamp clock elapsed seconds secs sec zeit tiempo"
)
"""Words that name the time."""
TIME_UNITS = {
    "s": "s",
    "sec": "s",
    "secs": "s",
    "seconds": "s",
    "ms": "ms",
    "msec": "ms",
    "millis": "ms",
    "us": "us",
    "usec": "us",
    "micros": "us",
    "ns": "ns",
    "nsec": "ns",
    "nanos": "ns",
}
"""Word in the time column's name → unit that it states."""
SI = {
    JointQuantity.POSITION: ("m", "rad"),
    JointQuantity.VELOCITY: ("m/s", "rad/s"),
    JointQuantity.FORCE: ("N", "Nm"),
    JointQuantity.FORCE_COMMAND: ("N", "Nm"),
    JointQuantity.VELOCITY_COMMAND: ("m/s", "rad/s"),
    JointQuantity.CURRENT: ("A", "A"),
    JointQuantity.CURRENT_COMMAND: ("A", "A"),
}
"""Quantity → SI unit where the joint slides, and where it turns."""


def quantity_of_unit(unit: str) -> JointQuantity | None:
    """Return the quantity that an SI unit belongs to; None if it is no joint's.

    Parameters
    ----------
    unit
        SI unit, such as "rad".
    """
    for quantity in (
        JointQuantity.POSITION,
        JointQuantity.VELOCITY,
        JointQuantity.FORCE,
        JointQuantity.CURRENT,
    ):
        if unit in SI[quantity]:
            return quantity
    return None
