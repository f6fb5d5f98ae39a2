"""Two pendulums that swing freely, coupled by a spring, against an integrator of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import rigtwin
from rigtwin.diagnosis.evidence import Evidence
from rigtwin.diagnosis.fitter import Fitter
from rigtwin.diagnosis.linearised import Linearised
from rigtwin.numerics.arrays import Array
from tests.helpers.logs import write_log

LENGTH, MASS, WIRE, GRAVITY = 0.3, 0.5, 0.4, 9.81
HEAVIER, VISCOUS, NOISE, PERIOD = 1.15, 0.004, 8e-4, 8e-3
WIRE_MJCF = f"""<tendon><fixed name="wire" stiffness="{WIRE}" springlength="0">
<joint joint="left" coef="1"/><joint joint="right" coef="-1"/></fixed></tendon>"""
MODEL = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
{bodies}</worldbody>{wire}</mujoco>"""
BODY = f"""<body name="{{name}}_bob"><joint name="{{name}}" axis="0 1 0"/>
<inertial pos="0 0 {-LENGTH}" mass="{MASS}" diaginertia="1e-6 1e-6 1e-6"/></body>"""


def model(wire: str) -> str:
    """Pendulums beside each other on a wire, or without a wire the right one at the left one."""
    left, right = (BODY.format(name=name) for name in ("left", "right"))
    bodies = left + right if wire else left.replace("</body>", f"{right}</body>")
    return MODEL.format(bodies=bodies, wire=wire)


def swing(seconds: float) -> dict[str, Array]:
    """Angles of two point masses that are let go, of which the left one is too heavy."""
    masses = np.array([HEAVIER, 1.0]) * MASS
    inertia = masses * LENGTH**2 + 1e-6 * np.array([HEAVIER, 1.0])
    damping = np.array([0.0, VISCOUS])

    def rate(_: float, state: Array) -> Array:
        angle, speed = state[:2], state[2:]
        spring = WIRE * (angle[0] - angle[1]) * np.array([1.0, -1.0])
        weight = masses * GRAVITY * LENGTH * np.sin(angle)
        return np.concatenate([speed, -(weight + spring + damping * speed) / inertia])

    time = np.arange(0.0, seconds, PERIOD)
    angles = solve_ivp(rate, (0.0, seconds), [0.7, -0.1, 0.0, 0.0], "DOP853", time, rtol=1e-9).y[:2]
    random = np.random.default_rng(3)
    left, right = angles + NOISE * random.standard_normal(angles.shape)
    return {"time": time, "left": left, "right": right}


def write(folder: Path, seconds: float, wire: str = WIRE_MJCF) -> tuple[Path, Path]:
    (folder / "pendulums.xml").write_text(model(wire))
    return folder / "pendulums.xml", write_log(folder / "log.csv", swing(seconds))


@pytest.mark.parametrize(
    ("wire", "masses"),
    [(WIRE_MJCF, {"mass@left_bob", "mass@right_bob"}), ("", {"mass@right_bob"})],
)
def test_a_known_spring_shows_every_mass_and_no_force_only_their_ratio(
    tmp_path: Path, wire: str, masses: set[str]
) -> None:
    described = rigtwin.describe(*write(tmp_path, 2.0, wire))
    names = {str(effect.name) for effect in described.machine.effects()}
    assert {name for name in names if name.startswith("mass@")} == masses


def test_a_linearised_misfit_is_that_of_the_refitted_values(tmp_path: Path) -> None:
    described = rigtwin.describe(*write(tmp_path, 3.0))
    machine, recording = described.machine, described.record()
    fitter = Fitter(Evidence(machine, [recording], [machine.configuration_of(recording)]).thin())
    named = {str(effect.name): effect for effect in machine.effects()}
    effects = named["mass@left_bob"], named["viscous@right"]
    fit = fitter.refine(effects, ((HEAVIER * MASS,), (VISCOUS,)))
    linearised = Linearised(fitter, fit)
    assert linearised.misfit == pytest.approx(fit.misfit, rel=0.01)
    assert linearised.leave_out_each()[0][0] > linearised.misfit


@pytest.mark.slow
def test_a_mass_and_a_friction_are_found_from_a_swing_that_is_let_go(tmp_path: Path) -> None:
    machine, log = write(tmp_path, 8.0)
    answer = rigtwin.diagnose(log, machine=machine)
    assert answer.verdict == "explained"
    values = {str(e.name): next(iter(e.parameters.values())).value for e in answer.effects}
    assert set(values) == {"mass@left_bob", "viscous@right"}
    assert values["mass@left_bob"] == pytest.approx(HEAVIER * MASS, rel=0.01)
    assert values["viscous@right"] == pytest.approx(VISCOUS, rel=0.05)
