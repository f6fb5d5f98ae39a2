"""Findings that are read off a signal: properties of sensors, and settings of the controller."""

from __future__ import annotations

from rigtwin.components import find, title
from rigtwin.diagnosis.controller import Deviation
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import Estimate, Finding, Name
from rigtwin.diagnosis.sampling import SensorProperty
from rigtwin.diagnosis.text import format_distinct

READING_ERROR = 0.05
"""Half interval of a sensor property that is read off the signal, as a share of its value."""
SETTING_ERROR = 1e-3
"""Half interval of a controller setting that reproduces the commands, as a share of its value."""


def describe_sensor(measured: SensorProperty, evidence: Evidence, confidence: float) -> Finding:
    """Describe a property that is read off a sensor's own signal, such as its noise.

    Parameters
    ----------
    measured
        Property of the sensor, in the sensor's unit.
    evidence
        Recordings that were read.
    confidence
        Confidence of the finding.

    Returns
    -------
    Finding
        Finding with no rivals: no other effect changes a signal in this way.
    """
    effect = find(f"{measured.kind}@{measured.component}", evidence.plant)
    unit = evidence.machine.unit(effect.group, effect.quantities()[measured.parameter])
    spread = READING_ERROR * measured.value
    estimate = Estimate(
        measured.value, measured.value - spread, measured.value + spread, measured.nominal, unit
    )
    name = Name(measured.component, measured.kind)
    return Finding(
        name, {measured.parameter: estimate}, confidence, (name,), 1.0, effect.kind.title
    )


def describe_controller(deviation: Deviation, confidence: float) -> Finding:
    """Describe a setting that the controller did not use as configured.

    Parameters
    ----------
    deviation
        Setting, its configured value and the value that reproduces the recorded commands.
    confidence
        Confidence of the finding.

    Returns
    -------
    Finding
        Finding at the component "controller".
    """
    name = Name("controller", deviation.kind)
    spread = SETTING_ERROR * abs(deviation.used)
    estimate = Estimate(
        deviation.used,
        deviation.used - spread,
        deviation.used + spread,
        deviation.configured,
        deviation.unit,
    )
    return Finding(
        name, {deviation.name: estimate}, confidence, (name,), 1.0, title(deviation.kind)
    )


def describe_negligible(deviation: Deviation) -> str:
    """Describe a deviation of the controller that is too small to cause a gap, as a note."""
    share = f"{100 * deviation.consequence:.1g} %"
    if deviation.kind == "unknown":
        return (
            f"the controller's commands differ by {share} from those of its settings; "
            "this causes no gap"
        )
    used, configured = format_distinct(deviation.used, deviation.configured)
    unit = "" if deviation.unit == "1" else f" {deviation.unit}"
    return (
        f"the controller's {deviation.name} is {used}{unit} instead of {configured}{unit}, "
        f"which changes no command by more than {share}; this causes no gap"
    )
