"""The three earthquakes of the benchmark.

The records are from github.com/FermandoisLab/maRTHS-bmk-RoDeAC (MIT licence, in
`earthquakes/LICENSE`): time, s, and unscaled acceleration, m/s². The benchmark uses 40 % of them.
"""

from __future__ import annotations

from importlib.resources import as_file, files

import numpy as np
from scipy.io import loadmat

from experiments.rths.building import PERIOD
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array

QUAKES = {"elcentro": "ElCentroAccel", "kobe": "KobeAccel", "morgan": "MorganAccel"}
SHARE = 0.4  # of the recorded acceleration, as the benchmark prescribes


def ground_motion(quake: str) -> Array:
    """Return the ground acceleration at every tick, m/s², shape (n,), linearly interpolated.

    Raises RigtwinError, listing the earthquakes, for an unknown one.
    """
    if quake not in QUAKES:
        raise RigtwinError(f"quake {quake}: expected {', '.join(QUAKES)}")
    name = QUAKES[quake]
    # The package may be installed as an archive, from which the file is unpacked for as long as
    # needed.
    with as_file(files("experiments.rths") / "earthquakes" / f"{name}NoScaling.mat") as path:
        time, acceleration = loadmat(path)[name]
    # The records have 50 to 200 samples a second, the benchmark 4096.
    ticks = np.arange(0.0, time[-1], PERIOD)
    return SHARE * np.interp(ticks, time, acceleration)
