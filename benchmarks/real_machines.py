"""Diagnosis of real machines: named effects, errors on held-out recordings, and run time.

python -m benchmarks.real_machines FOLDER [NAME ...]

FOLDER holds one folder per machine with its data, description and map. The data are not part of the
project; docs/diagnosis.md names their sources.
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
"""Description of the pendulum in a closed loop, whose formula gives the recorded voltage."""
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
"""Description of the pendulum as a servo with a gain of 400 and an unrecorded voltage."""
MOTOR = '<motor name="servo" joint="shaft" gear="0.06785"/>'
"""Motor in the pendulum's MJCF, Nm/V."""
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
    """Return the MJCF of a position actuator in place of the motor; gain: Nm/rad, up to 7.4 V."""
    return f'<position name="servo" joint="shaft" kp="{gain}" forcerange="-0.502 0.502"/>'


def write_descriptions(folder: Path) -> None:
    """Write the descriptions of the pendulum in a closed loop beside its own one."""
    (folder / "held.toml").write_text(HELD)
    (folder / "servo.toml").write_text(SERVO)
    (folder / "servo_400.toml").write_text(SERVO_MAP)
    model = (folder / "pendulum.xml").read_text()
    # The firmware gives 0.0212926 V per rad and unit of gain.
    (folder / "servo.xml").write_text(model.replace(MOTOR, position_actuator(0.578)))
    for kp in (100, 200, 400, 800):
        (folder / f"held_{kp}.toml").write_text(HELD_MAP.format(kp))


@dataclass(frozen=True)
class MachineCase:
    """Data and description of one machine.

    Attributes
    ----------
    folder, description, map : str
        Folder of the machine, and description and map within it.
    fitted, held_out : tuple of str
        Files for the fit and for its validation, without suffix.
    settings : dict
        Nominal values that differ from the description.
    """

    folder: str
    description: str
    map: str
    fitted: tuple[str, ...]
    held_out: tuple[str, ...]
    settings: dict[str, dict[str, float]] = field(default_factory=dict)


def damper(viscous: float) -> MachineCase:
    """Return the friction damper with another nominal viscous friction, Ns/m."""
    settings = {"damper": {"viscous": viscous}}
    files = (DAMPER, DAMPER_HELD_OUT)
    return MachineCase("friction_damper", "damper.toml", "map.toml", *files, settings)


def bench(part: str, description: str, map_name: str) -> MachineCase:
    """Return one body of the quarter car on its bench."""
    fitted, held_out = ([f"{part}_{name}" for name in names] for names in (BENCH, BENCH_HELD_OUT))
    return MachineCase("quarter_car_bench", description, map_name, tuple(fitted), tuple(held_out))


def pendulum(test: str, description: str, map_name: str) -> MachineCase:
    """Return the pendulum on its servo, fitted at two gains and validated at two others."""
    fitted, held_out = ([f"{test}_{kp}" for kp in gains] for gains in ((200, 400), (100, 800)))
    return MachineCase("pendulum_servo", description, map_name, tuple(fitted), tuple(held_out))


def servo(gain: float) -> MachineCase:
    """Return the pendulum as a servo of a nominal gain, Nm/rad, with cross-validated halves."""
    settings = {"servo": {"position_gain": gain}}
    return MachineCase(
        "pendulum_servo", "servo.toml", "servo_{}.toml", ("sin_sin_400",), (), settings
    )


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
    "emps": MachineCase("emps", "emps", "", ("DATA_EMPS",), ("DATA_EMPS_PULSES",)),
}


def import_file(case: MachineCase, name: str, folder: Path) -> rigtwin.Recording:
    """Import one file of a case as a recording."""
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
    """Return 100 · rms(measured − predicted) / std(measured) of every recording, worst signal."""
    configurations = [machine.configuration_of(recording, settings) for recording in recordings]
    evidence = Evidence(machine, recordings, configurations)
    worst = []
    for line, predicted in zip(evidence.lines, evidence.predict(corrected.plant), strict=True):
        rms = np.sqrt(np.mean((line.measured - predicted) ** 2, axis=1))
        worst.append(f"{100.0 * np.max(rms / np.std(line.measured, axis=1)):.1f}")
    return ", ".join(worst)


@dataclass(frozen=True)
class CaseResult:
    """Result of a case.

    Attributes
    ----------
    answer : Diagnosis
        Diagnosis.
    before, after : str
        Errors of the held-out recordings before and after the correction, %.
    seconds : float
        Run time, s.
    """

    answer: rigtwin.Diagnosis
    before: str
    after: str
    seconds: float


def judge(name: str, data: Path) -> CaseResult:
    """Diagnose a case; data: folder of all machines."""
    case = CASES[name]
    with tempfile.TemporaryDirectory() as work:
        folder = Path(shutil.copytree(data / case.folder, Path(work) / case.folder))
        # The data may be read-only; the copy must be writable for the import.
        for path in (folder, *folder.iterdir()):
            path.chmod(0o755)
        if case.folder == "pendulum_servo":
            write_descriptions(folder)
        description = folder / case.description
        machine = rigtwin.machine(description if description.is_file() else case.description)
        fitted = [import_file(case, stem, folder) for stem in case.fitted]
        held_out = [import_file(case, stem, folder) for stem in case.held_out]
        nominal = override(machine.configuration, case.settings)
        start = time.perf_counter()
        answer = rigtwin.diagnose(
            fitted, machine=machine, settings=case.settings, held_out=held_out
        )
        seconds = time.perf_counter() - start
        judged = held_out or fitted
        before = errors(machine, judged, nominal, nominal)
        return CaseResult(
            answer, before, errors(machine, judged, nominal, answer.corrected), seconds
        )


def print_result(name: str, result: CaseResult) -> None:
    """Print the result of a case."""
    print(
        f"{name}: {result.answer.verdict}, {result.before} -> {result.after} %, "
        f"{result.seconds:.0f} s"
    )
    for effect in result.answer.effects:
        values = ", ".join(f"{p.value:.4g} {p.unit}" for p in effect.parameters.values())
        look_alikes = [str(name) for name in effect.alternatives if str(name) != str(effect.name)]
        alternatives = f", or {', '.join(look_alikes)}" if look_alikes else ""
        print(f"    {effect.name} {values}{alternatives}: {100 * effect.confidence:.0f} %")


def main() -> None:
    """Print one result per machine."""
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
        print_result(name, judge(name, parsed.folder))


if __name__ == "__main__":
    main()
