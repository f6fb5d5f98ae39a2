"""Linear systems with a small positive definite matrix, by Cholesky's factor. Compiled.

Written out, because `np.linalg.cholesky` would allocate its result in every integration step.
"""

from __future__ import annotations

import math

from rigtwin.numerics.arrays import Array
from rigtwin.numerics.compiling import kernel


@kernel
def factor(matrix: Array, size: int) -> None:
    """Replace a positive definite matrix by its Cholesky factor, below the diagonal."""
    for i in range(size):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            # Rounding can make the pivot of a nearly massless coordinate negative.
            matrix[i, j] = math.sqrt(max(value, 1e-300)) if i == j else value / matrix[j, j]


@kernel
def solve(factored: Array, size: int, right: Array) -> None:
    """Solve L·Lᵀ·x = right with a Cholesky factor L; x overwrites `right`, shape (size,)."""
    # Forward substitution with L, then backward substitution with Lᵀ.
    for i in range(size):
        for k in range(i):
            right[i] -= factored[i, k] * right[k]
        right[i] /= factored[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= factored[k, i] * right[k]
        right[i] /= factored[i, i]
