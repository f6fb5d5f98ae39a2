"""The same log seen otherwise: force commands as measured forces, or the reverse.

A motion that forces drive cannot be predicted where small errors grow: cogging catches a carriage
in another valley, and a joint that only a controller holds drifts away. Along the measured motion,
inverse dynamics predict the forces at every moment, whatever happened before.

A column "tau" may hold the measured force or the commanded one. Along the motion a commanded force
that the actuator never gave is no force of any law, but it predicts the motion once the actuator's
limit is known.
"""

from __future__ import annotations

from dataclasses import replace

from rigtwin.describing.described import Described, describe_log
from rigtwin.describing.log import STATED
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.signal import LogSignal
from rigtwin.describing.units import actuator_constant
from rigtwin.describing.writer import channel_of
from rigtwin.description.coupling import are_coupled
from rigtwin.description.implied import FORCES, INVERSE
from rigtwin.description.joint_elements import actuator_on
from rigtwin.description.mechanism import Mechanism
from rigtwin.errors import RigtwinError
from rigtwin.recording import RecordedTest

OTHER = {FORCES: INVERSE, INVERSE: FORCES}
"""Kind of a test → the kind that the same log may be judged as."""
REASONS = {
    INVERSE: "judged by the forces along the measured motion, as the motion predicted from the "
    "forces departs from the measured one",
    FORCES: "the logged forces are taken as commands, as no model explains them as forces along "
    "the measured motion; --test inverse-dynamics takes them as measured",
}
"""Kind of a test → why a log is judged as such a test instead."""


def judge_otherwise(described: Described) -> Described | None:
    """Describe a test of force commands as one of inverse dynamics, or the reverse.

    Parameters
    ----------
    described
        Machine described from its model and a log.

    Returns
    -------
    Described or None
        None where the owner of the log stated what the log is, or where there is no other view.
    """
    reading = described.reading
    other = OTHER.get(reading.kind.test)
    if described.test or other is None or reading.velocities or reading.idle:
        return None
    if other == FORCES and not _may_be_commands(described):
        return None
    try:
        return describe_log(described.machine.model, described.log, described.stated, other)
    except RigtwinError:
        # Some joint has no actuator, so that nothing measures or commands its force.
        return None


def _may_be_commands(described: Described) -> bool:
    """Return whether the forces of a log may be commands that predict the motion.

    Coupled joints that measured forces push drift away within seconds, and show nothing.
    """
    mechanism = Mechanism(described.machine.model)
    joints, forces = list(described.reading.joints), _forces(described).values()
    are_assumed = all(signal.why != STATED for signal in forces)
    are_driven = all(actuator_on(mechanism, joint) is not None for joint in joints)
    return are_assumed and are_driven and not are_coupled(mechanism, joints)


def with_channels(described: Described, other: Described, recording: RecordedTest) -> RecordedTest:
    """Return a recording with the channels of forces or commands that another view needs.

    Parameters
    ----------
    described
        Machine of the recording.
    other
        The same machine in the other view.
    recording
        Recording of the former.
    """
    mechanism = Mechanism(described.machine.model)
    columns = {topic: dict(values) for topic, values in recording.columns.items()}
    sources = _forces(described)
    for joint, signal in _forces(other).items():
        topic, name = channel_of(mechanism, sources[joint]).rsplit(".", 1)
        constant = actuator_constant(mechanism, actuator_on(mechanism, joint) or "")
        # The force is the command times the constant.
        factor = 1.0 / constant if signal.commands else constant
        target, channel = channel_of(mechanism, signal).rsplit(".", 1)
        sign = signal.sign * sources[joint].sign
        columns.setdefault(target, {})[channel] = sign * factor * columns[topic][name]
    return replace(recording, columns=columns, notes=other.assumptions)


def _forces(described: Described) -> dict[str, LogSignal]:
    """Return the force or the command of each joint."""
    return {
        signal.joint: signal
        for signal in described.reading.signals
        if signal.commands or signal.quantity is JointQuantity.FORCE
    }
