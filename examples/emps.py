"""EMPS, a real machine: what the diagnosis finds beside what a plain least-squares fit finds, on
the same split.

    python examples/emps.py emps.mcap pulses.mcap

Both are fitted to the first recording and judged on the second by one measure: the rms of the
measured drive force less what the machine's closed loop predicts from the demanded position.
docs/tutorial.md says where the data are and how to import them.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.signal import butter, sosfiltfilt

import rigtwin

BAND = 40.0
"""Hz; of the position, before it is differentiated."""
SLOWEST = 0.002
"""m/s; below it the sign of the speed is not sure."""


def least_squares(recording: rigtwin.Recording) -> dict[str, float]:
    """Mass, viscous and Coulomb friction and a constant force, by linear regression of the drive
    force on the measured motion."""
    band = butter(4, 2.0 * BAND * recording.period, output="sos")
    position = sosfiltfilt(band, recording["/sensor.position"])
    speed = np.gradient(position, recording.period)
    acceleration = np.gradient(speed, recording.period)
    force = sosfiltfilt(band, recording["/command.force"])
    columns = np.stack([acceleration, speed, np.sign(speed), np.ones_like(speed)], axis=1)
    moving = np.abs(speed) > SLOWEST
    found = np.linalg.lstsq(columns[moving], force[moving], rcond=None)[0]
    return dict(zip(("mass", "viscous", "coulomb", "offset"), map(float, found), strict=True))


def main() -> None:
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
