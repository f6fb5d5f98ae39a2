"""The mechanics against closed forms: tyre, wheel hop, dry friction."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import StateSpace, dlsim

from controllers.closed_loop import state_space
from experiments import EXPERIMENTS
from rigtwin.components import Carriage, Motor, Rail, RigPlant, Tyre
from rigtwin.components.cylinder import closed_loop
from rigtwin.description.configuration import Configuration
from rigtwin.rig.component import replay_carriage
from rigtwin.simulation.mechanics import MECHANICS, SCENE, build
from tests.helpers.reference import coulomb_carriage

STEP = 2.5e-4
NOMINAL = RigPlant()
SMOOTH = NOMINAL._replace(rail=Rail(0.0), motor=NOMINAL.motor._replace(coulomb=0.0))


def simulation(
    plant: RigPlant = NOMINAL, step: float = STEP
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = build(plant, step)
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("path", [MECHANICS, SCENE])
def test_every_element_is_named(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    for kind, count in (
        ("body", model.nbody),
        ("joint", model.njnt),
        ("geom", model.ngeom),
        ("site", model.nsite),
        ("tendon", model.ntendon),
        ("actuator", model.nu),
        ("sensor", model.nsensor),
        ("camera", model.ncam),
        ("light", model.nlight),
    ):
        assert all(getattr(model, kind)(number).name for number in range(count)), kind
    assert model.pair_dim[model.pair("tyre").id] == 1


def test_lights_and_cameras_change_no_digit_of_the_motion():
    ends = []
    for path in (MECHANICS, SCENE):
        model = mujoco.MjModel.from_xml_path(str(path))
        data = mujoco.MjData(model)
        data.joint("carriage").qpos = -0.01
        data.ctrl[:] = 1.0
        mujoco.mj_step(model, data, 400)
        ends.append(np.concatenate([data.qpos, data.qvel, data.sensordata]))
    assert abs(ends[0][1] + 0.01) > 1e-4
    assert np.array_equal(*ends)


@pytest.mark.parametrize(
    "plant", [NOMINAL, NOMINAL._replace(carriage=Carriage(1140.0), tyre=Tyre(8.461e6))]
)
def test_tyre_is_a_spring_that_only_pushes(plant):
    model, data = simulation(plant._replace(rail=Rail(0.0), motor=Motor(coulomb=0.0)))
    carriage = model.joint("carriage").dofadr[0]
    for deflection in np.linspace(1e-4, 0.02, 9):
        data.qpos[model.joint("carriage").qposadr[0]] = -deflection
        mujoco.mj_forward(model, data)
        assert data.qfrc_constraint[carriage] == pytest.approx(
            plant.tyre.stiffness * deflection, rel=1e-3
        )
    data.qpos[model.joint("carriage").qposadr[0]] = 0.001
    mujoco.mj_forward(model, data)
    assert data.qfrc_constraint[carriage] == 0.0


def test_tyre_does_not_pull_a_wheel_that_leaves_the_ground():
    model, data = simulation(SMOOTH)
    data.joint("carriage").qpos = 0.0
    data.joint("carriage").qvel = 0.3
    for _ in range(400):
        mujoco.mj_step(model, data)
    assert data.joint("carriage").qvel[0] == pytest.approx(0.3, rel=1e-6)
    assert data.joint("carriage").qpos[0] == pytest.approx(0.03, rel=1e-2)


@pytest.mark.parametrize(("mass", "stiffness"), [(34.0, 50_000.0), (20.0, 120_000.0)])
def test_wheel_hop_frequency(mass, stiffness):
    plant = SMOOTH._replace(carriage=Carriage(mass), tyre=Tyre(stiffness))
    model, data = simulation(plant)
    preload, amplitude = 200.0, 0.5e-3
    data.joint("carriage").qpos = -preload / stiffness + amplitude
    data.qfrc_applied[model.joint("carriage").dofadr[0]] = -preload
    positions = np.empty(40_000)
    for number in range(len(positions)):
        positions[number] = data.joint("carriage").qpos[0]
        data.joint("ground").qpos = data.joint("ground").qvel = 0.0
        mujoco.mj_step(model, data)
    centred = positions + preload / stiffness
    rising = np.nonzero((centred[:-1] < 0) & (centred[1:] >= 0))[0]
    crossings = rising - centred[rising] / (centred[rising + 1] - centred[rising])
    frequency = (len(crossings) - 1) / ((crossings[-1] - crossings[0]) * STEP)
    assert frequency == pytest.approx(math.sqrt(stiffness / mass) / (2 * math.pi), rel=1e-3)


def creep(model: mujoco.MjModel, data: mujoco.MjData, joint: str, force: float) -> float:
    """Mean speed in the second half of a second under a steady force, m/s."""
    data.qfrc_applied[model.joint(joint).dofadr[0]] = force
    half = round(0.5 / model.opt.timestep)

    def run() -> None:
        for _ in range(half):
            data.joint("structure").qpos = data.joint("structure").qvel = 0.0
            mujoco.mj_step(model, data)

    run()
    before = float(data.joint(joint).qpos[0])
    run()
    return abs(float(data.joint(joint).qpos[0]) - before) / 0.5


@pytest.mark.parametrize("direction", [-1, 1])
@pytest.mark.parametrize(
    ("plant", "breakaway"),
    [
        (NOMINAL._replace(motor=Motor(coulomb=0.0)), NOMINAL.rail.coulomb),
        (NOMINAL._replace(rail=Rail(0.0)), NOMINAL.motor.coulomb),
    ],
    ids=["rail", "motor"],
)
def test_dry_friction_holds_below_breakaway_and_yields_above(plant, breakaway, direction):
    plant = plant._replace(tyre=Tyre(1e3))
    out_of_reach = 1.0
    for share, limit in ((0.9, 1e-6), (0.99, 1e-5)):
        model, data = simulation(plant)
        data.joint("ground").qpos = -out_of_reach
        assert creep(model, data, "carriage", direction * share * breakaway) < limit
    model, data = simulation(plant)
    data.joint("ground").qpos = -out_of_reach
    force = 1.01 * breakaway
    speed = creep(model, data, "carriage", direction * force)
    assert speed == pytest.approx(0.01 * breakaway / plant.carriage.mass * 0.75, rel=0.05)


def quarter_car_in_mujoco(
    sprung: float, stiffness: float, damping: float, preload: float, ground: np.ndarray
) -> np.ndarray:
    """The plate freed and hung on the travel tendon: a quarter car by MuJoCo alone. Returns
    (sprung, wheel) positions."""
    plant = SMOOTH
    model = mujoco.MjModel.from_xml_path(str(MECHANICS))
    model.body("structure_plate").mass = sprung
    tendon = model.tendon("suspension").id
    model.tendon_stiffness[tendon], model.tendon_damping[tendon] = stiffness, damping
    model.tendon_lengthspring[tendon] = 0.0
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    ours = build(plant, STEP)
    model.dof_frictionloss[:] = 0
    model.tendon_frictionloss[:] = 0
    model.pair_solref[:] = ours.pair_solref
    model.opt.timestep = STEP
    data.joint("carriage").qpos = data.joint("structure").qpos = (
        ground[0] - preload / plant.tyre.stiffness
    )
    weight = sprung * 9.81
    data.qfrc_applied[model.joint("structure").dofadr[0]] = preload - weight
    data.qfrc_applied[model.joint("carriage").dofadr[0]] = -preload
    out = np.empty((len(ground) - 1, 2))
    for number in range(len(ground) - 1):
        data.joint("ground").qpos = ground[number]
        data.joint("ground").qvel = (ground[number + 1] - ground[number]) / STEP
        out[number] = data.joint("structure").qpos[0], data.joint("carriage").qpos[0]
        mujoco.mj_step(model, data)
    return out


def test_quarter_car_agrees_with_solve_ivp():
    time = np.arange(0.0, 10.0, STEP)

    def road(t):
        return 0.002 * np.sin(2 * np.pi * 1.3 * t) * np.minimum(t, 1.0) + 0.0005 * np.sin(
            2 * np.pi * 7.0 * t
        ) * np.minimum(t, 1.0)

    k, b, m, mu, kt, preload = 1000.0, 50.0, 25.0, 34.0, 50_000.0, 200.0

    def slope(t, s):
        force = preload - k * (s[0] - s[2]) - b * (s[1] - s[3])
        tyre = max(kt * (road(t) - s[2]), 0.0)
        return [s[1], force / m - 9.81, s[3], (tyre - force) / mu]

    start = [-preload / kt, 0.0, -preload / kt, 0.0]
    exact = solve_ivp(
        slope, (0, time[-1]), start, t_eval=time[:-1], rtol=1e-9, atol=1e-11, method="DOP853"
    ).y
    ours = quarter_car_in_mujoco(m, k, b, preload, road(time))
    for mine, theirs in ((ours[:, 0], exact[0]), (ours[:, 1], exact[2])):
        assert np.sqrt(np.mean((mine - theirs) ** 2)) < 1e-3 * np.std(theirs)


def held(signal: np.ndarray, substeps: int) -> np.ndarray:
    """A signal at ticks, straight between them, at every substep."""
    ticks = np.arange(len(signal))
    return np.interp(np.arange(substeps * (len(signal) - 1) + 1) / substeps, ticks, signal)


def imposed_inputs(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Ground motion and suspension force of an imposed test: command through H(s) by scipy, and the
    force demanded."""
    experiment = EXPERIMENTS["imposed"]
    demands = experiment.demands(experiment.configuration, seed)
    a, b, c = state_space(closed_loop(NOMINAL.ground_cylinder))
    discrete = StateSpace(a, b[:, None], c[None, :], np.zeros((1, 1))).to_discrete(1e-3)
    ground = dlsim(discrete, demands[:, 0])[1]
    return ground[:, 0], demands[:, 2]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_carriage_with_dry_friction_agrees_with_an_exact_integration(seed):
    ground, force = imposed_inputs(seed)
    configuration = Configuration()
    ours = replay_carriage(configuration, ground, force, preload=200.0)
    fine = 100
    exact = coulomb_carriage(
        held(ground, fine), held(force, fine), 1e-3 / fine, 34.0, 50_000.0, 50.0, -0.004, fine
    )
    count = min(len(exact), len(ours))
    error = np.sqrt(np.mean((ours[:count] - exact[:count]) ** 2)) / np.std(exact)
    assert error < 1.5e-3
