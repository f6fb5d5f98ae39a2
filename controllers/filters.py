"""First-order filters at the controller's period."""

from __future__ import annotations

from controllers.compiled import compilable


@compilable
def low_pass(output: float, sample: float, time_constant: float, period: float) -> float:
    """Return the next output of a first-order lag by backward Euler: y + T/(τ + T)·(x − y).

    τ = `time_constant` and T = `period` are in s. With τ = 0 the sample passes.
    """
    return output + period / (time_constant + period) * (sample - output)
