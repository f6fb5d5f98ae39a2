"""EMPS, a real machine: the diagnosis compared with a plain least-squares fit on the same data.

    python examples/emps.py emps.mcap pulses.mcap

Both are fitted to the first recording and validated on the second. The measure is the rms of the
measured drive force minus the force that the closed loop predicts from the demanded position.
docs/tutorial.md says where the data are and how to import them.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.signal import butter, sosfiltfilt

import rigtwin

BAND = 40.0
"""Cut-off frequency of the position before its differentiation, Hz."""
SLOWEST = 0.002
"""Lowest speed used, m/s. Below it the sign of the speed is uncertain."""


def least_squares(recording: rigtwin.Recording) -> dict[str, float]:
    """Return mass, viscous and Coulomb friction and a constant force by linear regression.

    F = m a + F_v v + F_c sign(v) + F_0, fitted to the measured motion and drive force.
    """
    band = butter(4, 2.0 * BAND * recording.period, output="sos")
    position = sosfiltfilt(band, recording["/sensor.position"])
    speed = np.gradient(position, recording.period)
    acceleration = np.gradient(speed, recording.period)
    # The force passes the same filter, so both sides have the same bandwidth.
    force = sosfiltfilt(band, recording["/command.force"])
    columns = np.stack([acceleration, speed, np.sign(speed), np.ones_like(speed)], axis=1)
    moving = np.abs(speed) > SLOWEST
    coefficients = np.linalg.lstsq(columns[moving], force[moving], rcond=None)[0]
    return dict(
        zip(("mass", "viscous", "coulomb", "offset"), map(float, coefficients), strict=True)
    )


def main() -> None:
    """Print the residual of the force after each correction."""
    fitted, held_out = (rigtwin.load(name) for name in sys.argv[1:3])
    plain = least_squares(fitted)
    print("least squares: " + ", ".join(f"{name} {value:.4g}" for name, value in plain.items()))
    settings = {"carriage": {"mass": plain.pop("mass")}, "guide": plain}
    judged = {
        "nominal": rigtwin.compare(held_out),
        "least squares, four parameters": rigtwin.compare(held_out, settings=settings),
    }
    for name, comparison in judged.items():
        print(f"{name:40s} {comparison.replays['force'].residual:8.3f} N")
    for step in rigtwin.diagnose(fitted, held_out=held_out).answer.steps[1:]:
        print(f"{'diagnosis, ' + step.added:40s} {step.residual['force']:8.3f} N")


if __name__ == "__main__":
    main()
