"""The type of every numerical array."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
"""Real numbers, in practice float64; shape and unit are said where one is used."""
