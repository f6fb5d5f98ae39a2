"""The same log judged by forces: its motion is prescribed, and its force commands are predicted.

A motion that forces drive cannot be predicted where small errors grow: cogging catches a carriage
in another valley, and a joint that only a controller holds drifts away. Along the measured motion,
inverse dynamics predict the forces at every moment, whatever happened before.
"""

from __future__ import annotations

from dataclasses import replace

from rigtwin.describing.described import Described, describe_log
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.units import actuator_constant
from rigtwin.describing.writer import channel_of
from rigtwin.description.implied import FORCES, INVERSE
from rigtwin.description.joint_elements import actuator_on
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError
from rigtwin.recording import RecordedTest


def judge_by_forces(described: Described) -> Described | None:
    """Describe a test of force commands as one of inverse dynamics.

    Parameters
    ----------
    described
        Machine described from its model and a log.

    Returns
    -------
    Described or None
        None where the owner of the log stated the kind of the test, or the force at a joint is
        unknown.
    """
    reading = described.reading
    if described.test or reading.kind.test != FORCES or reading.velocities or reading.idle:
        return None
    try:
        return describe_log(described.machine.model, described.log, described.stated, INVERSE)
    except RigtwinError:
        # Some joint has no actuator, so that nothing measures its force.
        return None


def with_forces(
    described: Described, by_forces: Described, recording: RecordedTest
) -> RecordedTest:
    """Return a recording with the channels of the forces that its commands stand for.

    Parameters
    ----------
    described
        Machine of the recording.
    by_forces
        The same machine, with the motion prescribed.
    recording
        Recording of the former.
    """
    mechanism = Mechanism(described.machine.model)
    columns = {topic: dict(values) for topic, values in recording.columns.items()}
    commands = {
        signal.joint: channel_of(mechanism, signal)
        for signal in described.reading.signals
        if signal.commands
    }
    for signal in by_forces.reading.signals:
        if signal.quantity is JointQuantity.FORCE:
            topic, name = commands[signal.joint].rsplit(".", 1)
            constant = actuator_constant(mechanism, actuator_on(mechanism, signal.joint) or "")
            sensor, force = channel_of(mechanism, signal).rsplit(".", 1)
            columns.setdefault(sensor, {})[force] = constant * columns[topic][name]
    return replace(recording, columns=columns, notes=by_forces.assumptions)
