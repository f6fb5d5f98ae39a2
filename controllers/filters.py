"""First-order filters at the controller's period."""

from __future__ import annotations

from controllers.compiled import compilable


@compilable
def low_pass(output: float, sample: float, time_constant: float, period: float) -> float:
    """Next output of a backward-Euler first-order lag: y + T/(τ+T)·(x − y). τ and T in s; τ = 0
    passes the sample."""
    return output + period / (time_constant + period) * (sample - output)
