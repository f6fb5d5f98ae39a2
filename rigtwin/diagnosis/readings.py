"""Deviations that are read off signals, without a model of the mechanics."""

from __future__ import annotations

from dataclasses import dataclass

from rigtwin.components.plant import Plant
from rigtwin.description.machine import OWN
from rigtwin.diagnosis.controller import ControllerReplay, Deviation
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.finding import (
    Finding,
)
from rigtwin.diagnosis.sampling import SensorProperty, find_outstanding
from rigtwin.diagnosis.signal_findings import (
    describe_controller,
    describe_sensor,
)
from rigtwin.diagnosis.thresholds import Thresholds


@dataclass(frozen=True)
class SignalReadings:
    """Deviations that are read off signals, without a model of the mechanics.

    Attributes
    ----------
    sampled
        Properties of sensors that differ from the description.
    deviations
        Deviations of the controller from its settings.
    negligible
        Deviations of the controller that are too small to cause a gap.
    """

    sampled: tuple[SensorProperty, ...]
    deviations: tuple[Deviation, ...]
    negligible: tuple[Deviation, ...]

    @property
    def has_unknown_controller(self) -> bool:
        """Whether no setting reproduces the controller's commands."""
        return any(deviation.kind == "unknown" for deviation in self.deviations)


def read_signals(evidence: Evidence, plant: Plant, thresholds: Thresholds) -> SignalReadings:
    """Compare controller and sensors with their settings.

    Parameters
    ----------
    evidence
        Recordings that were fitted.
    plant
        Corrected plant, whose residual shows the sensors' noise.
    thresholds
        Thresholds of the diagnosis.

    Returns
    -------
    SignalReadings
        Deviations of sensors and controller.
    """
    deviations = _controller_deviations(evidence)
    negligible = tuple(
        deviation
        for deviation in deviations
        if deviation.kind in ("setting", "unknown")
        and deviation.consequence < thresholds.controller_consequence
    )
    # The nominal properties are those of the described plant, of which the search changes none.
    sampled = find_outstanding(
        evidence.machine, evidence.recordings, evidence.predict(plant), evidence.plant
    )
    return SignalReadings(
        tuple(sampled),
        tuple(deviation for deviation in deviations if deviation not in negligible),
        negligible,
    )


def describe_readings(
    readings: SignalReadings, evidence: Evidence, thresholds: Thresholds
) -> list[Finding]:
    """Describe the deviations of sensors and controller that are findings.

    Parameters
    ----------
    readings
        Deviations that were read off signals.
    evidence
        Recordings that were read.
    thresholds
        Thresholds of the diagnosis.

    Returns
    -------
    list of Finding
        Sensors first, then settings of the controller.
    """
    return [
        *(
            describe_sensor(sensor, evidence, thresholds.highest_confidence)
            for sensor in readings.sampled
        ),
        *(
            describe_controller(deviation, thresholds.highest_confidence)
            for deviation in readings.deviations
            if deviation.kind != "unknown"
        ),
    ]


def _controller_deviations(evidence: Evidence) -> list[Deviation]:
    """Deviations of the controller from its settings, once for all recordings."""
    deviations: dict[tuple[str, str], Deviation] = {}
    control = evidence.machine.control
    for recording, configuration in zip(evidence.recordings, evidence.configurations, strict=True):
        is_configured = recording.controller or (control is not None and control.exact is not None)
        if control is None or not is_configured or OWN in recording.controller:
            # The recording holds no settings to compare with, or another controller ran.
            continue
        deviation = ControllerReplay(control, recording, configuration.controller).deviation()
        if deviation is not None:
            deviations[deviation.kind, deviation.name] = deviation
    return list(deviations.values())
