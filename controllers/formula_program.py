"""Program of a formula: operations on registers, and how they are carried out."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.compiled import compilable

# Codes of the operations: those without a memory, which `operate` tells apart, then the blocks.
ADD, SUBTRACT, MULTIPLY, DIVIDE, NEGATE = range(5)
ABSOLUTE, SIGN, SINE, COSINE, ROOT, SMALLER, LARGER, CLIP = range(5, 13)
DERIVATIVE, INTEGRAL, LOW_PASS, MEAN, DELAY = range(13, 18)


class Program(NamedTuple):
    """Compiled formula.

    Registers hold the inputs, then the settings, the numbers, and the result of every operation.

    Attributes
    ----------
    operations : ndarray
        Code, three argument registers and start of the memory, shape (operations, 5).
    registers : ndarray
        Initial values of the registers, shape (registers,).
    inputs : int
        Number of inputs.
    memory : int
        Size of the memory of all blocks.
    """

    operations: NDArray[np.int64]
    registers: NDArray[np.float64]
    inputs: int
    memory: int


@compilable
def operate(code: int, x: float, y: float, z: float) -> float:
    """Return the result of an operation without a memory.

    code: one of those below `DERIVATIVE`; x, y, z: arguments, of which it uses the first ones.
    """
    value = x
    if code == ADD:
        value = x + y
    elif code == SUBTRACT:
        value = x - y
    elif code == MULTIPLY:
        value = x * y
    elif code == DIVIDE:
        # A formula must not stop the loop: x/0 is 0.
        value = x / y if y != 0.0 else 0.0
    elif code == NEGATE:
        value = -x
    elif code == ABSOLUTE:
        value = abs(x)
    elif code == SIGN:
        value = 0.0 if x == 0.0 else math.copysign(1.0, x)
    elif code == SINE:
        value = math.sin(x)
    elif code == COSINE:
        value = math.cos(x)
    elif code == ROOT:
        value = math.sqrt(max(x, 0.0))
    elif code == SMALLER:
        value = min(x, y)
    elif code == LARGER:
        value = max(x, y)
    elif code == CLIP:
        value = min(max(x, y), z)
    return value


@compilable
def run(operations: Any, registers: Any, memory: Any, period: float) -> float:
    """Return the value of a formula at one tick; registers and memory are changed.

    operations: of the program; registers: of the program, with the inputs in the first places;
    memory: of the blocks; a mean or a delay stores the position in its ring, then the ring.
    """
    count = len(operations)
    first = len(registers) - count
    value = 0.0
    for number in range(count):
        code = operations[number, 0]
        x = registers[operations[number, 1]]
        y = registers[operations[number, 2]]
        slot = operations[number, 4]
        if code < DERIVATIVE:
            value = operate(code, x, y, registers[operations[number, 3]])
        elif code == DERIVATIVE:
            value = 0.0 if math.isnan(memory[slot]) else (x - memory[slot]) / period
            memory[slot] = x
        elif code == INTEGRAL:
            previous = 0.0 if math.isnan(memory[slot]) else memory[slot]
            value = previous + x * period
            memory[slot] = value
        elif code == LOW_PASS:
            previous = x if math.isnan(memory[slot]) else memory[slot]
            value = previous + period / (y + period) * (x - previous)
            memory[slot] = value
        else:
            # Delay and mean: a ring of samples, one longer than the memory. It stays inline:
            # passing the arrays to a function costs as much as the rest of a tick.
            length, ring = int(y), slot + 1
            if math.isnan(memory[slot]):
                memory[slot] = 0.0
                for index in range(length + 1):
                    memory[ring + index] = x
            index = int(memory[slot])
            memory[ring + index] = x
            memory[slot] = index + 1 if index < length else 0
            if code == DELAY:
                value = memory[ring + (index + 1 if index < length else 0)]
            else:
                value = 0.0
                for back in range(length):
                    value += memory[ring + index - back + (0 if index >= back else length + 1)]
                value /= length
        registers[first + number] = value
    return value
