"""EMPS, a real machine: what the diagnosis finds beside what a plain least-squares fit finds, on the same split.

    python examples/emps.py emps.mcap pulses.mcap

Both are fitted to the first recording and judged on the second by one measure: the rms of the measured drive force less
what the
machine's closed loop predicts from the demanded position. docs/tutorial.md says where the data are and how to import them.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from rigtwin.description.setting import nominal
from scipy.signal import butter, sosfiltfilt

from rigtwin.description.catalogue import find
from rigtwin.diagnosis.diagnose import diagnose
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.leftover import remaining_rms
from rigtwin.recording import Recording, load

BAND = 40.0
"""Hz; of the position, before it is differentiated."""
SLOWEST = 0.002
"""m/s; below it the sign of the speed is not sure."""


def least_squares(recording: Recording) -> dict[str, float]:
    """Mass, viscous and Coulomb friction and a constant force, by linear regression of the drive force on the measured
    motion."""
    band = butter(4, 2.0 * BAND * recording.period, output="sos")
    position = sosfiltfilt(band, recording.column("/sensor", "position"))
    speed = np.gradient(position, recording.period)
    acceleration = np.gradient(speed, recording.period)
    force = sosfiltfilt(band, recording.column("/command", "force"))
    columns = np.stack([acceleration, speed, np.sign(speed), np.ones_like(speed)], axis=1)
    moving = np.abs(speed) > SLOWEST
    found = np.linalg.lstsq(columns[moving], force[moving], rcond=None)[0]
    return dict(zip(("mass", "viscous", "coulomb", "offset"), map(float, found), strict=True))


def main() -> None:
    fitted, held_out = (load(Path(name)) for name in sys.argv[1:3])
    machine = find("emps")
    setup = nominal(machine)
    plain = least_squares(fitted)
    guide = machine.plant.guide._replace(viscous=plain["viscous"], coulomb=plain["coulomb"], offset=plain["offset"])
    plant = machine.plant._replace(carriage=machine.plant.carriage._replace(mass=plain["mass"]), guide=guide)
    judged = Evidence(machine, [held_out], [setup])
    print("least squares: " + ", ".join(f"{name} {value:.4g}" for name, value in plain.items()))
    print(f"{'nominal':40s} {remaining_rms(judged, machine.plant)['force']:8.3f} N")
    print(f"{'least squares, four parameters':40s} {remaining_rms(judged, plant)['force']:8.3f} N")
    for step in diagnose(machine, [fitted], setup, [held_out]).diagnosis.steps[1:]:
        print(f"{'diagnosis, ' + step.added:40s} {step.left['force']:8.3f} N")


if __name__ == "__main__":
    main()
