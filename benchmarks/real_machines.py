"""Real machines: what the diagnosis names of them, what that leaves of recordings that it was not
fitted to, and how long it takes: `python -m benchmarks.real_machines FOLDER [NAME ...]`.

The folder holds a folder a machine, with its data, its description and its map. The data do not
come with the project; docs/diagnosis.md says where they are from.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import rigtwin
from rigtwin.description.catalogue import SHIPPED
from rigtwin.description.changes import override
from rigtwin.diagnosis.evidence import Evidence

BAND = "Hz36lbtension{}amplitude"
DAMPER = ("0.25" + BAND.format(1.5), "0.5" + BAND.format(1))
DAMPER_HELD_OUT = tuple(
    f"{hertz}{BAND.format(inch)}" for hertz, inch in ((1, 1), (1, 1.5), (0.5, 0.5), (2, 0.5))
)
BENCH, BENCH_HELD_OUT = ("1", "3"), ("test1", "test2")
HELD = """
[machine]
name = "pendulum-servo"
title = "XL330 pendulum, held by its servo"
model = "pendulum.xml"
[components]
arm = { body = "arm", effects = [] }
gearbox = { joint = "shaft" }
servo = { actuator = "servo", command = "voltage", unit = "V" }
encoder = { sensor = "encoder", channel = "position" }
[controller]
output = "voltage"
formula = "limit(0.0212926 * kp * (goal - position), -7.4, 7.4)"
inputs = { position = "/sensor.position" }
settings = { kp = 200 }
[[replays]]
name = "held"
moved_by = "servo"
observe = ["encoder"]
"""
"""The pendulum's description in a closed loop: the recorded voltage is the formula's."""
SERVO = """
[machine]
name = "pendulum-servo"
title = "XL330 pendulum on its servo"
model = "servo.xml"
[components]
arm = { body = "arm", effects = [] }
gearbox = { joint = "shaft" }
servo = { actuator = "servo", type = "servo", command = "goal" }
encoder = { sensor = "encoder", channel = "position" }
[[replays]]
name = "held"
moved_by = "servo"
observe = ["encoder"]
"""
"""The same as a servo whose voltage nobody recorded, at the gain of 400."""
MOTOR = '<motor name="servo" joint="shaft" gear="0.06785"/>'
"""Of the pendulum's MJCF: Nm/V."""
HELD_MAP = """
machine = "pendulum-servo"
time = {{ column = "t" }}
controller = {{ kp = {} }}
[channels]
"/command.voltage" = {{ column = "load", wrap = 65536, scale = 0.0083615819 }}
"/command.goal" = {{ column = "goal" }}
"/sensor.position" = {{ column = "position" }}
"""
SERVO_MAP = """
machine = "pendulum-servo"
time = { column = "t" }
[channels]
"/command.goal" = { column = "goal" }
"/sensor.position" = { column = "position" }
"""


def position_actuator(gain: float) -> str:
    """What stands in the motor's place: torque by the angle's error, Nm/rad, up to 7.4 V."""
    return f'<position name="servo" joint="shaft" kp="{gain}" forcerange="-0.502 0.502"/>'


def write_descriptions(folder: Path) -> None:
    """Adds the pendulum's in a closed loop to its own."""
    (folder / "held.toml").write_text(HELD)
    (folder / "servo.toml").write_text(SERVO)
    (folder / "servo_400.toml").write_text(SERVO_MAP)
    model = (folder / "pendulum.xml").read_text()
    # As its firmware has it: 0.0212926 V for each rad and unit of its gain.
    (folder / "servo.xml").write_text(model.replace(MOTOR, position_actuator(0.578)))
    for kp in (100, 200, 400, 800):
        (folder / f"held_{kp}.toml").write_text(HELD_MAP.format(kp))


@dataclass(frozen=True)
class Case:
    """folder, description, map: in the data's folder; fitted, held_out: files without their ending;
    settings: other nominal values."""

    folder: str
    description: str
    map: str
    fitted: tuple[str, ...]
    held_out: tuple[str, ...]
    settings: dict[str, dict[str, float]] = field(default_factory=dict)


def damper(viscous: float) -> Case:
    """The friction damper from another nominal viscous friction, Ns/m."""
    settings = {"damper": {"viscous": viscous}}
    files = (DAMPER, DAMPER_HELD_OUT)
    return Case("friction_damper", "damper.toml", "map.toml", *files, settings)


def bench(part: str, description: str, map_name: str) -> Case:
    """A body of the quarter car on its bench."""
    fitted, held_out = ([f"{part}_{each}" for each in names] for names in (BENCH, BENCH_HELD_OUT))
    return Case("quarter_car_bench", description, map_name, tuple(fitted), tuple(held_out))


def pendulum(test: str, description: str, map_name: str) -> Case:
    """The pendulum on its servo, fitted at two gains and judged at two others."""
    fitted, held_out = ([f"{test}_{kp}" for kp in gains] for gains in ((200, 400), (100, 800)))
    return Case("pendulum_servo", description, map_name, tuple(fitted), tuple(held_out))


def servo(gain: float) -> Case:
    """The pendulum as a servo of that nominal gain, Nm/rad; each half judges the other."""
    settings = {"servo": {"position_gain": gain}}
    return Case("pendulum_servo", "servo.toml", "servo_{}.toml", ("sin_sin_400",), (), settings)


CASES = {
    "damper-0": damper(0.0),
    "damper-150": damper(150e3),
    "damper-277": damper(277e3),
    "body": bench("body", "quarter.toml", "map.toml"),
    "wheel": bench("wheel", "wheel.toml", "wheel_map.toml"),
    "bench": bench("body", "quarter-car-bench", "quarter_car_bench"),
    "swing": pendulum("lift_and_drop", "pendulum.toml", "map.toml"),
    "held": pendulum("sin_sin", "held.toml", "held_{}.toml"),
    "servo": servo(0.578),
    "servo-weaker": servo(0.4),
    "emps": Case("emps", "emps", "", ("DATA_EMPS",), ("DATA_EMPS_PULSES",)),
}


def imported(case: Case, name: str, folder: Path) -> rigtwin.Recording:
    """One of a case's files as a recording."""
    data = next(path for path in folder.iterdir() if path.stem == name)
    if case.description == "quarter-car-bench":
        mapping = SHIPPED / "maps" / f"{case.map}.toml"
    elif case.folder == "emps":
        mapping = SHIPPED / "maps" / f"{name.removeprefix('DATA_').lower()}.toml"
    else:
        mapping = folder / case.map.format(name.rpartition("_")[2])
    return rigtwin.import_data(data, mapping, folder / f"{name}.mcap")


def errors(
    machine: rigtwin.Machine,
    recordings: list[rigtwin.Recording],
    settings: rigtwin.Configuration,
    corrected: rigtwin.Configuration,
) -> str:
    """100 · rms(measured − predicted) / std(measured) of each recording, worst signal."""
    configurations = [machine.configuration_of(recording, settings) for recording in recordings]
    evidence = Evidence(machine, recordings, configurations)
    found = []
    for line, predicted in zip(evidence.lines, evidence.predict(corrected.plant), strict=True):
        rms = np.sqrt(np.mean((line.measured - predicted) ** 2, axis=1))
        found.append(f"{100.0 * np.max(rms / np.std(line.measured, axis=1)):.1f}")
    return ", ".join(found)


@dataclass(frozen=True)
class Told:
    """What came of a case. before, after: errors of the held-out records; seconds: it took."""

    answer: rigtwin.Diagnosis
    before: str
    after: str
    seconds: float


def judge(name: str, data: Path) -> Told:
    """Diagnoses a case whose data are in this folder."""
    case = CASES[name]
    with tempfile.TemporaryDirectory() as work:
        folder = Path(shutil.copytree(data / case.folder, Path(work) / case.folder))
        for path in (folder, *folder.iterdir()):
            path.chmod(0o755)
        if case.folder == "pendulum_servo":
            write_descriptions(folder)
        own = folder / case.description
        on = rigtwin.machine(own if own.is_file() else case.description)
        fitted = [imported(case, each, folder) for each in case.fitted]
        held_out = [imported(case, each, folder) for each in case.held_out]
        nominal = override(on.configuration, case.settings)
        began = time.perf_counter()
        answer = rigtwin.diagnose(fitted, machine=on, settings=case.settings, held_out=held_out)
        seconds = time.perf_counter() - began
        judged = held_out or fitted
        before = errors(on, judged, nominal, nominal)
        return Told(answer, before, errors(on, judged, nominal, answer.corrected), seconds)


def tell(name: str, told: Told) -> None:
    """Prints what came of a case."""
    print(f"{name}: {told.answer.verdict}, {told.before} -> {told.after} %, {told.seconds:.0f} s")
    for effect in told.answer.effects:
        values = ", ".join(f"{each.value:.4g} {each.unit}" for each in effect.parameters.values())
        alike = [str(each) for each in effect.alternatives if str(each) != str(effect.name)]
        other = f", or {', '.join(alike)}" if alike else ""
        print(f"    {effect.name} {values}{other}: {100 * effect.confidence:.0f} %")


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(CASES))
    parsed = parser.parse_args()
    for name in parsed.names:
        if name not in CASES:
            parser.error(f"unknown machine {name!r}; there are {', '.join(CASES)}")
    for name in parsed.names or CASES:
        if not (parsed.folder / CASES[name].folder).is_dir():
            parser.error(f"{parsed.folder} holds no folder {CASES[name].folder!r}")
        tell(name, judge(name, parsed.folder))


if __name__ == "__main__":
    main()
