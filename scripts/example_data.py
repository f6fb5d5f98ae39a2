"""Write examples/damper.csv and damper-again.csv: a damper with friction and play, as logged."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from referee.benches import DamperTruth, damper_force, sample, wander

# Friction of 85 N behind a play of 2.4 mm; two recordings differ in motion and noise.
TRUTH = DamperTruth(slip=85.0, spring=5e4, play=2.4e-3, viscous=(640.0, 640.0))
PERIOD, FINE, SECONDS = 2e-3, 8, 10.0


def write_logger_file(path: Path, seed: int) -> None:
    """Write one logger file; seed: of motion and noise."""
    random = np.random.default_rng(seed)
    motion = wander(random, SECONDS, PERIOD / FINE, 0.03, 0.2, 2.5)
    force = damper_force(TRUTH, motion, np.gradient(motion, PERIOD / FINE))
    position, load = (
        sample(random, motion[::FINE], 4e-6, 1e-6),
        sample(random, force[::FINE], 1.2, 0.1),
    )
    # Head lines, German names, semicolons and decimal commas, as many loggers write them.
    lines = ["Logger 4711;;", "Prüfling: Dämpfer 3;;", "Zeit;Weg;Kraft", "s;mm;N"]
    for tick, (x, f) in enumerate(zip(position, load, strict=True)):
        lines.append(f"{tick * PERIOD:.3f};{1e3 * x:.3f};{f:.1f}".replace(".", ","))
    path.write_text("\n".join(lines) + "\n", encoding="latin-1")


if __name__ == "__main__":
    folder = Path(__file__).parent.parent / "examples"
    write_logger_file(folder / "damper.csv", 31)
    write_logger_file(folder / "damper-again.csv", 32)
