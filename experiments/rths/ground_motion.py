"""The three earthquakes of the benchmark, which come along with their licence.

From github.com/FermandoisLab/maRTHS-bmk-RoDeAC (MIT, `earthquakes/LICENSE`): time s, acceleration
m/s², not scaled; the benchmark takes 40 %.
"""

from __future__ import annotations

from importlib.resources import as_file, files

import numpy as np
from scipy.io import loadmat

from experiments.rths.building import PERIOD
from rigtwin.errors import RigtwinError
from rigtwin.numerics.arrays import Array

QUAKES = {"elcentro": "ElCentroAccel", "kobe": "KobeAccel", "morgan": "MorganAccel"}
SHARE = 0.4


def ground_motion(quake: str) -> Array:
    """Acceleration at every tick, m/s², straight lines between the recorded ones.

    Raises RigtwinError with what there is.
    """
    if quake not in QUAKES:
        raise RigtwinError(f"quake {quake}: expected {', '.join(QUAKES)}")
    name = QUAKES[quake]
    with as_file(files("experiments.rths") / "earthquakes" / f"{name}NoScaling.mat") as path:
        time, acceleration = loadmat(path)[name]
    ticks = np.arange(0.0, time[-1], PERIOD)
    return SHARE * np.interp(ticks, time, acceleration)
