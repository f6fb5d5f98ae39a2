"""Regressors of an unknown input, written as formulas, with the physics that usually causes them.

An unknown input (`unknown_input`) is a sum of functions of a component's motion, force and time.
The function that contributes most says what the residual correlates with. A correlation is not a
proof, so the causes are hints.
"""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.diagnosis.words import enumerate_words

FORMULAS: dict[str, tuple[str, str]] = {
    "a constant": ("a constant", "a zero offset or a constant load"),
    "time": ("time", "a drift"),
    "time squared": ("time^2", "a drift"),
    "its value": ("the signal itself", "a wrong gain"),
    "its value squared": ("the square of the signal", "a nonlinear characteristic"),
    "its value cubed": ("the cube of the signal", "a nonlinear characteristic"),
    "its value growing with time": ("signal × time", "a gain that drifts"),
    "its rate": ("the signal's rate", "a delay or a lag"),
    "its rate of rate": ("the signal's second derivative", "an inertia or a second-order lag"),
    "its recent past": ("the recent past of the motion (memory)", "a lag, relaxation or creep"),
    "its load": ("the load", "a compliance"),
    "acceleration": ("acceleration", "a wrong mass or inertia"),
    "acceleration growing with time": ("acceleration × time", "a mass that changes"),
    "acceleration squared": ("acceleration·|acceleration|", "an inertia that depends on size"),
    "the carriage's acceleration": ("the carriage's acceleration", "a mass at the load cell"),
    "speed": ("speed", "viscous friction"),
    "speed squared": ("speed·|speed|", "drag"),
    "speed cubed": ("speed^3", "nonlinear damping"),
    "speed either way": ("|speed|", "viscous friction that depends on the direction"),
    "direction": ("the sign of the speed", "dry friction"),
    "slow motion's direction": ("the sign of a low speed", "Stribeck friction"),
    "direction growing with time": ("the sign of the speed × time", "dry friction that changes"),
    "place": ("position", "a spring or gravity"),
    "place cubed": ("position^3", "a spring that hardens, or cogging"),
    "place along the stroke": ("a periodic function of position", "cogging or an eccentricity"),
    "direction and place": (
        "the sign of the speed × a periodic function of position",
        "friction that varies along the stroke",
    ),
    "deflection": ("deflection", "a wrong stiffness"),
    "deflection squared": ("deflection^2", "a nonlinear spring"),
    "deflection cubed": ("deflection^3", "a spring that hardens"),
    "deflection growing with time": ("deflection × time", "a stiffness that changes"),
    "rate of deflection": ("the rate of deflection", "damping"),
    "rate and deflection": ("deflection × its rate", "damping that depends on the deflection"),
}
"""Name of a form in `models.basis` → its formula and its usual cause."""


def describe_correlation(forms: Sequence[str]) -> str:
    """Describe what a residual correlates with.

    Parameters
    ----------
    forms
        Names of forms (`models.basis`), the one that contributes most first.

    Returns
    -------
    str
        Clause such as "the residual correlates with position^3 (possibly a spring that hardens, or
        cogging)". A form without an entry is named as it is.
    """
    if not forms:
        return "the residual correlates with no simple function of motion, force or time"
    formulas = [FORMULAS.get(form, (form, ""))[0] for form in forms]
    # Only the strongest regressor suggests a cause; the weaker ones often make up for its shape.
    cause = FORMULAS.get(forms[0], ("", ""))[1]
    hint = f" (possibly {cause})" if cause else ""
    correlates = f"the residual correlates with {formulas[0]}{hint}"
    return correlates + (f", then with {enumerate_words(formulas[1:])}" if formulas[1:] else "")
