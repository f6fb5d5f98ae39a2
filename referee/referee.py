"""The referee: draws rigs, records tests, commits itself to a key, and opens it on request.

The recordings contain no hint of the defects. The referee runs as a separate process,
`python -m referee.referee FOLDER CASES SEED`. On standard output it prints one line per case, then
`commitment SHA-256`. On standard input, `next NUMBER TEST` requests a further test on the rig of a
case, and `open` requests the salt and the key. It imports nothing of the twin, its effects or its
controllers.
"""

from __future__ import annotations

import hashlib
import json
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.writer import CompressionType, Writer

from referee.defect import MATERIAL, Defect, effect_size, summary
from referee.draw import draw_tolerated, draw_unnamed, named_defects
from referee.reference_rig import Law, run
from referee.reference_truth import Array, Truth
from referee.test_signals import PROPOSED, TESTS, draw_demands

SHARES = {"single": 0.45, "null": 0.30, "pair": 0.10, "outside": 0.15}
"""Share of every sort among the cases."""
COMMANDS = ("ground", "structure", "force", "voltage")
READ = ("ground_lvdt", "structure_lvdt", "suspension_lvdt", "load_cell")


def sorts(cases: int, random: np.random.Generator) -> list[str]:
    """Return the sorts of all cases in random order, in the shares of `SHARES`, rounded."""
    counts = {name: int(share * cases) for name, share in SHARES.items()}
    counts["single"] += cases - sum(counts.values())
    names = [name for name, count in counts.items() for _ in range(count)]
    random.shuffle(names)
    return names


def choose(groups: list[list[Any]], random: np.random.Generator) -> Defect:
    """Draw a defect: first its component, so that components with few kinds are not rare."""
    group = groups[int(random.integers(len(groups)))]
    return group[int(random.integers(len(group)))]()


class RigCase(NamedTuple):
    """A rig with its defects and its recordings.

    Attributes
    ----------
    entry : dict
        Entry of the key.
    recordings : list
        Recorded settings, commands and sensors; the second recording is held out.
    truth : Truth
        Rig with its defects.
    change : callable
        Function that returns the true settings of a controller on this rig.
    """

    entry: dict[str, Any]
    recordings: list[tuple[Law, Array, Array]]
    truth: Truth
    change: Callable[[Law], Law]


def draw_case(sort: str, random: np.random.Generator) -> RigCase:
    """Draw a case of a sort: `single`, `null`, `pair` or `outside`."""
    rig = draw_tolerated(random)
    test = str(random.choice(TESTS if sort != "pair" else TESTS[:3]))
    law, demands = draw_demands(test, random)
    nominal_commands, _ = run(rig, law, demands, np.random.default_rng(0))
    defects: list[Defect] = []
    sizes: list[float] = []
    while len(defects) < {"single": 1, "null": 0, "pair": 2, "outside": 1}[sort]:
        if sort == "outside":
            options = draw_unnamed(random)
            drawn = options[int(random.integers(len(options)))]()
        else:
            drawn = choose(named_defects(nominal_commands, random), random)
        size = effect_size(rig, law, drawn, nominal_commands)
        # Immaterial defects are kept as single ones of the library only: there they test that the
        # diagnosis names nothing wrong.
        accepted = sort == "single" or size >= MATERIAL
        if accepted and drawn.component not in [defect.component for defect in defects]:
            defects.append(drawn)
            sizes.append(size)
    truth, true_law = rig, law
    for defect in defects:
        truth, true_law = defect.change(truth, true_law)
    recordings = [(law, *run(truth, true_law, demands, random))]
    _, held_out_demands = draw_demands("imposed" if test == "tripped" else test, random)
    recordings.append((law, *run(truth, true_law, held_out_demands, random)))
    entry = {
        "sort": sort,
        "test": test,
        "seconds": len(recordings[0][1]) * 1e-3,
        "bristle": truth.bristle,
        "effects": [summary(defect, size) for defect, size in zip(defects, sizes, strict=True)],
    }

    def change(intended: Law) -> Law:
        changed = rig, intended
        for defect in defects:
            changed = defect.change(*changed)
        return changed[1]

    return RigCase(entry, recordings, truth, change)


def record_next(case: RigCase, test: str, random: np.random.Generator) -> tuple[Law, Array, Array]:
    """Record a further test on the rig of a case."""
    law, demands = draw_demands(test, random)
    return law, *run(case.truth, case.change(law), demands, random)


def operator(law: Law) -> dict[str, Any]:
    """Return the settings as a recording stores them."""
    return {
        "mode": "imposed" if law.imposed else "mil",
        "travel": "wheel",
        "structure": "point",
        "compensator": "none",
        "start": law.start,
        "sprung_mass": law.sprung_mass,
        "suspension_stiffness": law.stiffness,
        "suspension_damping": law.damping,
        "preload": law.preload,
        "gravity": law.gravity,
        "skyhook": "none",
        "skyhook_damping": 0,
        "damping_max": 500,
        "damping_min": 10,
        "filter_position": law.filter_position,
        "filter_velocity": law.filter_velocity,
        "filter_force": law.filter_force,
        "kff": law.kff,
        "kp": law.kp,
        "ki": law.ki,
        "voltage_limit": law.limit,
    }


def write(path: Path, law: Law, commands: Array, sensors: Array) -> None:
    """Write a recording in the project's format, with JSON messages."""
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start()
        config = json.dumps({"controller": operator(law)})
        # No seed, no truth: the metadata must not hint at the defects.
        about = {
            "format": "1",
            "machine": "suspension-rig",
            "experiment": "withheld",
            "period": "0.001",
            "config": config,
        }
        writer.add_metadata("rigtwin", about)
        channels = []
        for topic, names in (("/command", COMMANDS), ("/sensor", READ)):
            properties = {name: {"type": "number"} for name in names}
            schema = json.dumps({"type": "object", "properties": properties}).encode()
            number = writer.register_schema(topic[1:], "jsonschema", schema)
            channels.append((writer.register_channel(topic, "json", number), names))
        for tick in range(len(commands)):
            for (channel, names), row in zip(
                channels, (commands[tick], sensors[tick]), strict=True
            ):
                message = json.dumps(
                    # Nine digits: more would only store the rounding of the simulation.
                    dict(zip(names, (float(f"{value:.9g}") for value in row), strict=True))
                ).encode()
                writer.add_message(channel, tick * 1_000_000, message, tick * 1_000_000)
        writer.finish()


def main(arguments: list[str]) -> int:
    """Run the referee's protocol; arguments: folder, number of cases, seed."""
    folder, cases, seed = Path(arguments[0]), int(arguments[1]), int(arguments[2])
    folder.mkdir(parents=True, exist_ok=True)
    order = sorts(cases, np.random.default_rng([seed, 0]))
    cases_drawn: list[RigCase] = []
    for number, sort in enumerate(order):
        # Every case has a random stream of its own, so a further case does not change the others.
        case = draw_case(sort, np.random.default_rng([seed, 1, number]))
        for name, recording in zip(
            (f"{number:03d}.mcap", f"{number:03d}-held-out.mcap"), case.recordings, strict=True
        ):
            write(folder / name, *recording)
        cases_drawn.append(case)
        print(f"case {number}", flush=True)
    # The salt keeps the key from being guessed by hashing all possible keys.
    salt = hashlib.sha256(np.random.default_rng([seed, 2]).bytes(32)).hexdigest()
    opened = json.dumps([case.entry for case in cases_drawn])
    print("commitment", hashlib.sha256((salt + opened).encode()).hexdigest(), flush=True)
    for line in sys.stdin:
        word, *rest = line.split()
        if word != "next":
            break
        number, test = int(rest[0]), rest[1]
        random = np.random.default_rng([seed, 3, number, PROPOSED.index(test)])
        write(folder / f"{number:03d}-next.mcap", *record_next(cases_drawn[number], test, random))
        print("recorded", number, flush=True)
    print("salt", salt)
    print(opened, flush=True)
    return 0


if __name__ == "__main__":
    # Ctrl-C reaches the check and this process. The check blocked the signal while packages were
    # imported; from here on it ends this process without a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    sys.exit(main(sys.argv[1:]))
