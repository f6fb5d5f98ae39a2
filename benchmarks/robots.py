"""Robots that other people modelled: run as they are, and a hidden friction and payload found.

python -m benchmarks.robots MODEL.xml ... [--out TABLE.md]

Each model is run by its test `excite` with Coulomb friction at its middle joint, and with a payload
in its last link. The diagnosis sees the recording and the model. The models are not part of the
project: pip install robosuite dm-control, or `menagerie:NAME`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import rigtwin
from rigtwin.components import Body, Guide, measures

SHARE = 0.2
"""Hidden Coulomb friction, as a share of the rms force of its joint."""
LOAD = 0.5
"""Hidden payload, as a share of the mass of the link that holds it."""
REACH = 0.05
"""Distance of the payload from the origin of its link, m."""
RIGHT = 0.05
"""Largest relative error of a value that counts as found."""
HEAD = ("model", "joints", "Coulomb friction", "payload")


@dataclass(frozen=True)
class Trial:
    """Diagnosis of one hidden effect.

    Attributes
    ----------
    answer
        Short answer for the table.
    seconds
        Run time of the diagnosis, s.
    """

    answer: str
    seconds: float


def hidden_friction(machine: rigtwin.Machine, base: rigtwin.Recording) -> tuple[str, float]:
    """Return the middle guide, and 20 % of the rms force there, or of a typical one, N or Nm."""
    guides = [name for name in machine.components if _is(machine, name, Guide)]
    guide = guides[len(guides) // 2]
    joint = machine.components[guide].joint
    for name, component in machine.components.items():
        part = getattr(machine.plant, name)
        if component.joint == joint and measures(part) == "force" and component.channel:
            force = float(np.std(base.column(*component.channel)))
            return guide, float(f"{max(SHARE * force, 1e-3):.2g}")
    # A servo's force is not recorded: a tenth of a rad of its position gain stands for it.
    gains = [
        getattr(getattr(machine.plant, name), "position_gain", 0.0)
        for name, component in machine.components.items()
        if component.joint == joint
    ]
    return guide, float(f"{max(SHARE * 0.1 * max(gains), 1e-3):.2g}")


def hidden_payload(machine: rigtwin.Machine) -> tuple[str, float] | None:
    """Return the last link that may hold something, and half its mass, kg; None without one."""
    links = [
        name
        for name, component in machine.components.items()
        if _is(machine, name, Body) and "payload" in (component.kinds or ())
    ]
    if not links:
        return None
    mass = float(getattr(machine.plant, links[-1]).mass)
    return links[-1], float(f"{max(LOAD * mass, 0.01):.2g}")


def _is(machine: rigtwin.Machine, name: str, kind: type) -> bool:
    return isinstance(getattr(machine.plant, name), kind)


def diagnose_hidden(machine: rigtwin.Machine, effect: str, values: Mapping[str, float]) -> Trial:
    """Run a test with a hidden effect, and return what the diagnosis says of it."""
    first = next(iter(values))
    text = f"{effect}={values[first]}" + "".join(
        f",{name}={value}" for name, value in values.items() if name != first
    )
    recording = rigtwin.run(machine, "excite", seed=1, effects=[text])
    start = time.perf_counter()
    answer = rigtwin.diagnose(recording, machine=machine)
    seconds = time.perf_counter() - start
    found = {str(each.name): each for each in answer.effects}
    names = " + ".join(found) or answer.verdict
    if set(found) != {effect}:
        return Trial(f"no: {names}", seconds)
    value = found[effect].parameters[first].value
    hit = abs(value - values[first]) <= RIGHT * abs(values[first])
    return Trial(f"{'' if hit else 'no: '}{value:.3g} of {values[first]:.3g}", seconds)


def try_robot(name: str) -> list[str]:
    """Return the row of one model."""
    label = "/".join(Path(name).with_suffix("").parts[-2:])
    try:
        machine = rigtwin.machine(name)
        base = rigtwin.run(machine, "excite", seed=1)
        guide, friction = hidden_friction(machine, base)
        nominal = float(getattr(machine.plant, guide).coulomb)
        trials = [diagnose_hidden(machine, f"coulomb@{guide}", {"coulomb": nominal + friction})]
        link = hidden_payload(machine)
        if link is not None:
            load = {"payload": link[1], "payload_z": REACH}
            trials.append(diagnose_hidden(machine, f"payload@{link[0]}", load))
    except rigtwin.RigtwinError as error:
        return [label, "", str(error).rpartition(": ")[2], ""]
    label += ", servos" if machine.replays[0].free else ""
    payload = trials[1].answer if len(trials) > 1 else "no link"
    print(f"{label}: diagnoses of {', '.join(f'{trial.seconds:.0f} s' for trial in trials)}")
    joints = sum(_is(machine, component, Guide) for component in machine.components)
    return [label, str(joints), trials[0].answer, payload]


def table(rows: Iterator[list[str]]) -> Iterator[str]:
    """Yield the lines of a Markdown table."""
    yield "| " + " | ".join(HEAD) + " |"
    yield "|" + "---|" * len(HEAD)
    for row in rows:
        yield "| " + " | ".join(row) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("models", nargs="+", help="models, or names such as menagerie:franka_fr3")
    parser.add_argument("--out", type=Path, help="file of the table, Markdown")
    parsed = parser.parse_args()
    lines = []
    for line in table(try_robot(name) for name in parsed.models):
        print(line, flush=True)
        lines.append(line)
    if parsed.out is not None:
        parsed.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
