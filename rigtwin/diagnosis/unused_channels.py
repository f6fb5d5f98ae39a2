"""Recorded channels that the description does not use, but with which a force changes.

The residual of a signal is regressed on channel × direction, channel × speed and the channel, all
of them free of their parts in direction, speed and a constant, which other effects have. The share
of the residual's power that they explain shows a force that follows the channel.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rigtwin.components.plant import Plant
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.unit_checks import channels
from rigtwin.numerics.arrays import Array

EXPLAINED = 0.1
"""Share of a residual's power from which a channel is worth a note."""
SENSORS = "/sensor."
"""Start of the names of measured signals. A command is no cause that a description missed."""


def describe_unused(evidence: Evidence, plant: Plant) -> Iterator[str]:
    """Describe each unused channel with which the residual of a signal changes.

    Parameters
    ----------
    evidence
        Recordings that were fitted.
    plant
        Corrected plant.

    Yields
    ------
    str
        One sentence for each channel that explains at least `EXPLAINED` of a residual.
    """
    used = {*channels(evidence.machine)}
    used |= {c.channel for c in evidence.machine.components.values() if c.channel is not None}
    # A channel that one recording lacks cannot be fitted over all of them.
    common = set.intersection(*({*recording.channels} for recording in evidence.recordings))
    common -= {".".join(channel) for channel in used}
    unused = sorted(channel for channel in common if channel.startswith(SENSORS))
    if not unused:
        return
    predicted = evidence.predict(plant)
    for channel in unused:
        shares = [
            _explained_share(evidence, plant, predicted, row, channel)
            for row in range(len(evidence.machine.rows))
        ]
        best = int(np.argmax(shares))
        if shares[best] >= EXPLAINED:
            yield (
                f"the residual of {evidence.machine.rows[best].name} changes with the recorded "
                f"channel {channel}, which the description does not use; it explains "
                f"{100 * shares[best]:.0f} % of the residual's power. A component of type "
                "schedule lets the diagnosis fit forces that follow it"
            )


def _explained_share(
    evidence: Evidence, plant: Plant, predicted: list[Array], row: int, channel: str
) -> float:
    """Return the share of a signal's residual power that a channel explains, 0 to 1."""
    residuals, known, new = [], [], []
    name = evidence.machine.rows[row].name
    for recording, model, lines, signals in zip(
        evidence.recordings, evidence.models, evidence.lines, predicted, strict=True
    ):
        residual = lines.measured[row] - signals[row]
        speed = model.motion(name, plant).speed[: len(residual)]
        # Interactions with direction and speed are what a friction that follows the channel has:
        # its dry and its viscous part.
        level = recording[channel][:: model.every][: len(residual)]
        sign = np.sign(speed)
        residuals.append(residual)
        known.append(np.stack([np.ones_like(speed), speed, sign], axis=1))
        new.append(np.stack([level, level * speed, level * sign], axis=1))
    target, known_regressors = np.concatenate(residuals), np.concatenate(known)
    columns = np.concatenate(new)
    # A constant channel is collinear with the known regressors, and nothing but rounding would
    # remain of it.
    if np.ptp(columns[:, 0]) == 0.0:
        return 0.0
    # What direction, speed and a constant explain is no sign of the channel.
    stack = np.column_stack([target, columns])
    # By the theorem of Frisch, Waugh and Lovell, regressing what remains of both sides gives the
    # partial effect of the new regressors.
    free = stack - known_regressors @ np.linalg.lstsq(known_regressors, stack, rcond=None)[0]
    residual, shapes = free[:, 0], free[:, 1:]
    fitted = shapes @ np.linalg.lstsq(shapes, residual, rcond=None)[0]
    return float(fitted @ fitted / max(float(residual @ residual), 1e-300))
