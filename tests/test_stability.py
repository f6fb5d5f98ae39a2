"""Poles, critical lags and delays against exact arithmetic, simulation and the argument
principle."""

from __future__ import annotations

import argparse
import json
from fractions import Fraction

import numba
import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.linalg import expm

from experiments.vehicles import VEHICLES
from rigtwin.cli.stability import add_arguments, execute
from rigtwin.errors import RigtwinError
from rigtwin.studies.stability.critical import critical_delay, critical_lag
from rigtwin.studies.stability.delayed import rightmost_delay_root
from rigtwin.studies.stability.locus import BODY, WHEEL, Locus, Setting, mode
from rigtwin.studies.stability.loop import (
    LOOPS,
    bound,
    delay_function,
    lag_polynomial,
    roots,
    single_mass,
)
from rigtwin.studies.stability.mapping import Axis, around, draw, stability_map
from rigtwin.studies.stability.models import (
    MODELS,
    Lags,
    ideal_quarter_car,
    ideal_single_mass,
    poles,
    rig,
    rightmost,
    single_mass_structure,
    single_mass_suspension,
)
from rigtwin.studies.stability.vehicle import QuarterCar, SingleMass

CHOSEN = QuarterCar(500.0, 0.0, 50.0, 500.0, 100.0, 50.0)
TABLE_6_2 = QuarterCar(50_000.0, 0.0, 34.0, 1000.0, 50.0, 25.0)
LAGS_OF_EACH = {
    "single-mass": (1, 0),
    "suspension": (1, 0),
    "structure": (0, 1),
    "combined": (1, 1),
    "rig": (2, 1),
}
"""Model → how many lags the force and the sprung mass's motion come through."""


def drawn(count, seed=0, spread=1.0, tyre_damping=True):
    random = np.random.default_rng(seed)
    middle = np.array([500.0, 10.0, 50.0, 500.0, 100.0, 50.0])
    cars = [
        QuarterCar(*map(float, np.exp(random.normal(0.0, spread, 6)) * middle))
        for _ in range(count)
    ]
    return cars if tyre_damping else [car._replace(tyre_damping=0.0) for car in cars]


class TestModels:
    def test_known_poles(self):
        computed = poles(MODELS["suspension"](CHOSEN, 0.2))
        assert sorted(computed.imag) == pytest.approx(
            [-5.1167, -1.9544, 0.0, 1.9544, 5.1167], abs=5e-5
        )
        assert computed.real == pytest.approx([-5.0, 0.0, 0.0, 0.0, 0.0], abs=1e-9)

    @pytest.mark.parametrize(
        ("name", "expected"),
        [("boeing-707", 18.90 + 109.5j), ("truck", 14.33 + 107.9j), ("motorcycle", 0.595 + 93.5j)],
    )
    def test_vehicles_of_table_6_1_on_the_rig(self, name, expected):
        pole = rightmost(
            rig(
                QuarterCar(tyre_damping=0.0, **VEHICLES[name]._asdict()),
                Lags(0.01, 0.01, 0.01, 0.01),
            )
        )
        assert pole.real == pytest.approx(expected.real, abs=0.006)
        assert pole.imag == pytest.approx(expected.imag, abs=0.06)

    def test_table_6_2_on_the_rig(self):
        assert rightmost(MODELS["rig"](TABLE_6_2, 0.01)).real == pytest.approx(-0.262, abs=5e-4)

    @pytest.mark.parametrize("model", MODELS)
    def test_eigenvalues_are_the_roots_of_the_loop(self, model):
        for car, lag in zip(drawn(20), np.logspace(-3, 0, 20), strict=True):
            expected = roots(lag_polynomial(LOOPS[model](car), lag).coef)
            computed = poles(MODELS[model](car, lag))
            if len(computed) > len(
                expected
            ):  # The two filters of position and velocity share a pole that no output sees.
                expected = np.append(expected, -1.0 / lag)
            assert len(computed) == len(expected)
            nearest = np.abs(computed[:, None] - expected[None, :])
            assert np.all(nearest.min(axis=1) < 1e-6 * np.abs(computed))
            assert np.all(nearest.min(axis=0) < 1e-6 * np.abs(expected))

    def test_ideal_models_are_the_limit_of_no_lag(self):
        for car in drawn(5):
            ideal = poles(ideal_quarter_car(car))
            near = poles(MODELS["combined"](car, 1e-7))
            assert np.abs(ideal[:, None] - near[None, :]).min(axis=1) == pytest.approx(
                0.0, abs=1e-3
            )
            assert np.sum(near.real < -1e5) == 3

    def test_different_lags_of_the_rig(self):
        lags = Lags(0.004, 0.02, 0.01, 0.0064)
        s = rightmost(rig(TABLE_6_2, lags))
        z = {name: 1.0 / (1.0 + s * lag) for name, lag in lags._asdict().items()}
        force = z["force"] * (
            TABLE_6_2.suspension_stiffness * z["travel"]
            + TABLE_6_2.suspension_damping * s * z["velocity"]
        )
        wheel = TABLE_6_2.unsprung_mass * s**2 + TABLE_6_2.tyre_stiffness
        sprung = TABLE_6_2.sprung_mass * s**2
        terms = (sprung * wheel, force * z["plate"] * wheel, force * sprung)
        assert abs(sum(terms)) < 1e-9 * max(map(abs, terms))

    def test_ground_moves_the_mass_as_equation_5_17(self):
        mass, lag, s = SingleMass(50.0, 500.0, 100.0), 0.1, 1j * np.array([0.3, 3.0, 30.0])
        expected = 1.0 / (
            mass.mass * lag * s**3 + mass.mass * s**2 + mass.damping * s + mass.stiffness
        )
        force, structure = single_mass_suspension(mass, lag), single_mass_structure(mass, lag)
        assert np.squeeze(force(s)) == pytest.approx(expected, rel=1e-9)
        assert structure(s, squeeze=False)[
            structure.output_labels.index("plate"), 0
        ] == pytest.approx(expected, rel=1e-9)

    def test_at_rest_all_moves_with_the_ground(self):
        force = 1.0 / CHOSEN.tyre_stiffness
        assert np.squeeze(ideal_quarter_car(CHOSEN)(0.0)).real == pytest.approx([force, force])
        for model in ("suspension", "structure", "combined", "rig"):
            assert np.squeeze(MODELS[model](CHOSEN, 0.01)(0.0)).real == pytest.approx(force)
        assert np.squeeze(ideal_single_mass(CHOSEN.sprung)(0.0)).real == pytest.approx(
            1.0 / CHOSEN.suspension_stiffness
        )


class TestCriticalLag:
    def test_single_mass_is_b_over_k(self):
        for car in drawn(30, spread=2.0):
            crossing = critical_lag(single_mass(car.sprung))
            assert crossing is not None
            assert crossing.time == pytest.approx(
                car.suspension_damping / car.suspension_stiffness, rel=1e-9
            )
            assert crossing.frequency == pytest.approx(car.sprung.natural_frequency, rel=1e-9)

    def test_suspension_is_b_over_k_without_tyre_damping_alone(self):
        for car in drawn(30, tyre_damping=False):
            crossing = critical_lag(LOOPS["suspension"](car))
            assert crossing is not None
            assert crossing.time == pytest.approx(
                car.suspension_damping / car.suspension_stiffness, rel=1e-6
            )
        damped = critical_lag(LOOPS["suspension"](CHOSEN._replace(tyre_damping=10.0)))
        assert damped is not None
        assert damped.time == pytest.approx(0.2170, abs=1e-4)

    def test_thesis_values(self):
        crossing = critical_lag(LOOPS["structure"](CHOSEN))
        assert crossing is not None
        assert crossing.time == pytest.approx(0.06895, abs=5e-6)
        # Two lags in series: Routh-Hurwitz gives k/b = (2 − τ b/m)/(4τ).
        crossing = critical_lag(single_mass(SingleMass(50.0, 49.995, 1.0), lags=2))
        assert crossing is not None
        assert crossing.time == pytest.approx(0.01, rel=1e-9)

    @pytest.mark.slow
    @pytest.mark.parametrize("model", LOOPS)
    def test_against_routh_and_hurwitz_in_exact_fractions(self, model):
        cars = [
            *drawn(10, seed=1),
            *drawn(10, seed=2, spread=3.0),
            *drawn(5, seed=3, tyre_damping=False),
        ]
        cars += [car._replace(suspension_damping=0.0) for car in drawn(3, seed=4)]
        cars += [CHOSEN._replace(suspension_damping=1e9), CHOSEN._replace(tyre_damping=1e9)]
        outcomes = set()
        for car in cars:
            crossing = critical_lag(LOOPS[model](car))
            if crossing is None:
                assert all(hurwitz(exact(model, car, lag)) for lag in np.logspace(-6, 5, 23))
            elif crossing.time == 0.0:
                assert not hurwitz(exact(model, car, 0.0))
            else:
                assert all(
                    hurwitz(exact(model, car, crossing.time * part))
                    for part in (1e-3, 0.1, 0.3, 0.5, 0.7, 0.9, 0.999)
                )
                assert not hurwitz(exact(model, car, crossing.time * 1.001))
            outcomes.add(crossing is None or crossing.time > 0.0)
        assert True in outcomes

    @pytest.mark.parametrize("model", LOOPS)
    def test_against_bisection_on_the_rightmost_pole(self, model):
        for car in drawn(8, seed=5):
            crossing = critical_lag(LOOPS[model](car))
            assert crossing is not None
            low, high = 0.0, crossing.time * 1.5
            assert rightmost(MODELS[model](car, high)).real > 0.0
            for _ in range(60):
                middle = 0.5 * (low + high)
                low, high = (
                    (low, middle)
                    if rightmost(MODELS[model](car, middle)).real > 0.0
                    else (middle, high)
                )
            assert high == pytest.approx(crossing.time, rel=1e-6)
            assert rightmost(MODELS[model](car, crossing.time)).imag == pytest.approx(
                crossing.frequency, rel=1e-6
            )

    def test_without_damping_there_is_no_time_to_lose(self):
        for model, loop in LOOPS.items():
            for critical in (critical_lag, critical_delay):
                crossing = critical(loop(CHOSEN._replace(suspension_damping=0.0)))
                assert crossing is not None, model
                assert crossing.time == 0.0

    def test_a_loop_of_low_gain_is_stable_with_every_lag(self):
        loop = {0: Polynomial([2.0, 2.0, 1.0]), 1: Polynomial([0.5]), 2: Polynomial([0.3])}
        assert critical_lag(loop) is None
        assert critical_delay(loop) is None


class TestCriticalDelay:
    def test_single_mass_in_closed_form(self):
        mass = SingleMass(50.0, 500.0, 100.0)
        # |m ω²| = |k + jωb|, and the delay turns k + jωb onto the real axis.
        m, k, b = mass
        square = (b**2 + np.sqrt(b**4 + 4.0 * m**2 * k**2)) / (2.0 * m**2)
        frequency = float(np.sqrt(square))
        crossing = critical_delay(single_mass(mass))
        assert crossing is not None
        assert crossing.frequency == pytest.approx(frequency, rel=1e-9)
        assert crossing.time == pytest.approx(np.arctan2(frequency * b, k) / frequency, rel=1e-9)

    @pytest.mark.slow
    @pytest.mark.parametrize("model", LOOPS)
    def test_against_a_simulation_of_the_delay_differential_equation(self, model):
        cars = [
            CHOSEN,
            TABLE_6_2,
            QuarterCar(tyre_damping=0.0, **VEHICLES["car"]._asdict()),
            *drawn(1, seed=6),
        ]
        for car in cars:
            critical = critical_delay(LOOPS[model](car))
            assert critical is not None
            below, above = (growth(model, car, part * critical.time) for part in (0.99, 1.01))
            assert below < 0.0 < above, (model, car)
            root = rightmost_delay_root(LOOPS[model](car), 1.01 * critical.time)
            assert above == pytest.approx(root.real, rel=0.05)

    @pytest.mark.slow
    @pytest.mark.parametrize("model", LOOPS)
    def test_rightmost_root_by_the_argument_principle(self, model):
        for car in (*drawn(2, seed=7), TABLE_6_2):
            loop = LOOPS[model](car)
            critical = critical_delay(loop)
            assert critical is not None
            for part in (0.3, 1.0, 5.0):
                delay = part * critical.time
                root = rightmost_delay_root(loop, delay)
                assert abs(delay_function(loop, delay, root)) < 1e-8 * abs(loop[0](root))
                margin = 1e-2 * abs(root)
                assert roots_right_of(loop, delay, root.real + margin) == 0
                assert roots_right_of(loop, delay, root.real - margin) >= 1
                assert (root.real > 1e-9 * abs(root)) == (part > 1.0)

    def test_a_lag_promises_more_than_a_delay_allows(self):
        truck = QuarterCar(tyre_damping=0.0, **VEHICLES["truck"]._asdict())
        lag, delay = (
            critical_lag(LOOPS["suspension"](truck)),
            critical_delay(LOOPS["suspension"](truck)),
        )
        assert lag is not None
        assert delay is not None
        assert lag.time > 8.0 * delay.time
        assert mode(truck, 1j * delay.frequency) == WHEEL


class TestLocus:
    def test_crossings_of_a_sweep_are_the_critical_lag(self):
        for model in ("structure", "combined"):
            locus = Locus(model, np.logspace(-3, 0, 60), lambda lag: Setting(CHOSEN, lag))
            critical = critical_lag(LOOPS[model](CHOSEN))
            assert critical is not None
            assert locus.crossings[0].value == pytest.approx(critical.time, rel=1e-6)
            assert locus.crossings[0].frequency == pytest.approx(critical.frequency, rel=1e-6)
            assert (locus.crossings[0].mode, locus.crossings[0].unstable) == (BODY, True)

    def test_both_modes_cross_together_with_suspension_mil(self):
        locus = Locus("suspension", np.logspace(-3, 0, 60), lambda lag: Setting(CHOSEN, lag))
        assert {crossing.mode for crossing in locus.crossings} == {BODY, WHEEL}
        assert [crossing.value for crossing in locus.crossings] == pytest.approx(
            [0.2, 0.2], rel=1e-6
        )
        assert locus.unstable_modes(0.1) == ()
        assert locus.unstable_modes(0.3) == (BODY, WHEEL)

    def test_modes_are_told_apart_by_eigenvectors(self):
        for car in drawn(10, seed=8, tyre_damping=False):
            car = car._replace(suspension_damping=0.0)
            system = ideal_quarter_car(car)
            values, vectors = np.linalg.eig(np.asarray(system.A))
            for value, vector in zip(values, vectors.T, strict=True):
                in_phase = (vector[0] / vector[1]).real > 0.0
                assert mode(car, value) == (BODY if in_phase else WHEEL)


class TestMapping:
    def test_boundary_is_the_critical_lag(self):
        damping = Axis("suspension_damping", np.linspace(50.0, 400.0, 8))
        lags = Axis("tau", np.logspace(-2, 0, 80))
        stability = stability_map("structure", CHOSEN, 0.01, lags, damping)
        assert stability.rightmost.shape == (8, 80)
        assert stability.critical is not None
        for row, critical in zip(stability.rightmost, stability.critical, strict=True):
            first = lags.values[np.argmax(row > 0.0)]
            assert critical <= first <= critical * 1.1

    def test_any_two_parameters_and_the_drawing(self, tmp_path):
        across, up = (
            around("suspension_stiffness", TABLE_6_2, 0.01, 12),
            around("tyre_damping", TABLE_6_2, 0.01, 10),
        )
        assert up.values[0] == 0.0
        stability = stability_map("rig", TABLE_6_2, 0.01, across, up)
        car = TABLE_6_2._replace(
            suspension_stiffness=float(across.values[3]), tyre_damping=float(up.values[4])
        )
        assert stability.rightmost[4, 3] == pytest.approx(rightmost(MODELS["rig"](car, 0.01)).real)
        draw(stability, tmp_path / "map.png")
        assert (tmp_path / "map.png").stat().st_size > 10_000

    def test_bad_input(self, tmp_path):
        axis = around("tau", CHOSEN, 0.01, 4)
        with pytest.raises(
            RigtwinError, match="unknown parameter 'mass'; expected one of tyre_stiffness"
        ):
            around("mass", CHOSEN, 0.01)
        with pytest.raises(RigtwinError, match="two different parameters"):
            stability_map("rig", CHOSEN, 0.01, axis, axis)
        with pytest.raises(RigtwinError, match="unknown model 'x'"):
            stability_map("x", CHOSEN, 0.01, axis, around("sprung_mass", CHOSEN, 0.01, 4))
        stability = stability_map("rig", CHOSEN, 0.01, axis, around("sprung_mass", CHOSEN, 0.01, 4))
        with pytest.raises(RigtwinError, match=r"cannot draw 'map\.txt'"):
            draw(stability, tmp_path / "map.txt")


class TestInput:
    @pytest.mark.parametrize(
        ("change", "line"),
        [
            ({"sprung_mass": 0.0}, "sprung_mass 0: expected 1e-09 to 1e\\+12"),
            ({"tyre_stiffness": -1.0}, "tyre_stiffness -1: expected 1e-09 to"),
            ({"tyre_damping": -1.0}, "tyre_damping -1: expected 0, or 1e-09 to"),
            ({"suspension_stiffness": float("nan")}, "suspension_stiffness nan: expected 1e-09 to"),
        ],
    )
    def test_vehicles(self, change, line):
        for build in (LOOPS["rig"], ideal_quarter_car):
            with pytest.raises(RigtwinError, match=line):
                build(CHOSEN._replace(**change))

    @pytest.mark.parametrize("lag", [0.0, -0.1, 1e-30, float("inf")])
    def test_times(self, lag):
        for model in MODELS.values():
            with pytest.raises(RigtwinError, match="expected 1e-09 to 1e\\+06 s"):
                model(CHOSEN, lag)
        with pytest.raises(RigtwinError, match="expected 1e-09 to 1e\\+06 s"):
            rightmost_delay_root(LOOPS["rig"](CHOSEN), lag)


class TestCommand:
    def run(self, *words):
        parser = argparse.ArgumentParser()
        add_arguments(parser)
        return execute(parser.parse_args(words))

    def test_prints_every_model(self, capsys, tmp_path):
        out = tmp_path / "s.json"
        assert self.run("--vehicle", "truck", "--json", str(out)) == 0
        printed = capsys.readouterr().out
        assert "truck" not in printed.splitlines()[1]
        assert "+14.33 ± 107.9j 1/s" in printed
        assert printed.splitlines()[-2].endswith("unstable")
        written = json.loads(out.read_text())
        assert set(written["models"]) == set(MODELS)
        assert written["models"]["suspension"]["critical_lag"] == pytest.approx(94_300 / 1_950_000)
        assert written["models"]["rig"]["stable"] is False

    @pytest.mark.slow
    def test_settings_delay_and_map(self, capsys, tmp_path):
        out = tmp_path / "map.png"
        words = ("--set", "suspension_damping=100", "--tau", "0.02")
        assert (
            self.run(
                *words,
                "--model",
                "suspension",
                "--map",
                "sprung_mass",
                "suspension_stiffness",
                "-o",
                str(out),
            )
            == 0
        )
        assert "drawn in" in capsys.readouterr().out
        assert self.run(*words, "--delay") == 0
        printed = capsys.readouterr().out
        assert "suspension damping 100," in printed
        assert "delays of 20 ms" in printed
        expected = rightmost_delay_root(
            LOOPS["suspension"](TABLE_6_2._replace(suspension_damping=100.0)), 0.02
        )
        assert f"{expected.real:+.4g} ± {expected.imag:.4g}j" in printed
        assert out.exists()

    @pytest.mark.parametrize(
        ("words", "line"),
        [
            (["--vehicle", "tram"], "unknown vehicle 'tram'; there are quarter-car, boeing-707"),
            (["--set", "mass=3"], "unknown parameter 'mass' of a vehicle"),
            (["--set", "sprung_mass=heavy"], "--set sprung_mass=heavy: expected a number"),
            (["--set", "sprung_mass=-3"], "sprung_mass -3: expected 0.001 to"),
            (["--tau", "0"], "tau 0: expected 1e-09 to"),
            (["-o", "x.png"], "expected --map X Y"),
            (["--model", "suspension"], "expected --map X Y"),
            (["--map", "tau", "sprung_mass", "-o", "x.doc"], "cannot draw 'x.doc'"),
            (["--map", "tau", "sprung_mass", "--delay"], "a map is of lags"),
            (["--map", "tau", "weight"], "unknown parameter 'weight'"),
            (["--map", "tau", "sprung_mass", "--model", "x"], "unknown model 'x'"),
            (["--json", "/nowhere/s.json"], "its folder does not exist"),
        ],
    )
    def test_bad_input_is_one_line(self, words, line, capsys):
        with pytest.raises(RigtwinError, match=line) as caught:
            self.run(*words)
        assert "\n" not in str(caught.value)
        assert capsys.readouterr().out == ""


def exact(model, car, lag):
    """The characteristic polynomial in fractions, ascending, written anew from the equations of
    motion."""
    kt, bt, mu, ks, bs, ms = map(Fraction, car)
    factor, sprung, suspension, wheel = (
        [Fraction(1), Fraction(float(lag))],
        [0, 0, ms],
        [ks, bs],
        [kt, bt, mu],
    )
    forces, structures = LAGS_OF_EACH[model]
    force = power(factor, forces)
    structure = power(factor, structures)
    if model == "single-mass":
        return total(product(sprung, force), suspension)
    characteristic = product(product(sprung, wheel), product(force, structure))
    return total(characteristic, product(suspension, total(wheel, product(sprung, structure))))


def product(first, second):
    coefficients = [Fraction(0)] * (len(first) + len(second) - 1)
    for i, a in enumerate(first):
        for j, b in enumerate(second):
            coefficients[i + j] += a * b
    return coefficients


def power(base, exponent):
    result = [Fraction(1)]
    for _ in range(exponent):
        result = product(result, base)
    return result


def total(first, second):
    length = max(len(first), len(second))
    return [sum(each[i] for each in (first, second) if i < len(each)) for i in range(length)]


def hurwitz(ascending):
    """Whether all roots have negative real parts: Routh's array, in exact fractions."""
    falling = list(ascending)[::-1]
    while falling[0] == 0:
        falling.pop(0)
    if any(coefficient <= 0 for coefficient in falling):
        return False
    above, below = falling[::2], falling[1::2]
    while below:
        if below[0] <= 0:
            return False
        padded = below + [Fraction(0)] * (len(above) - len(below))
        following = [
            above[i + 1] - above[0] / below[0] * padded[i + 1] for i in range(len(above) - 1)
        ]
        above, below = below, following
    return True


def roots_right_of(loop, delay, edge):
    """The change of argument around a half disc that holds every root to the right of the edge."""
    radius = 4.0 * bound(loop) * np.exp(max(0.0, -edge) * delay * max(loop)) + 4.0 * abs(edge)
    turn = np.linspace(-np.pi / 2, np.pi / 2, 4001)
    height = np.concatenate([np.logspace(0, -7, 8000), -np.logspace(-7, 0, 8000)])
    path = np.concatenate([edge + radius * np.exp(1j * turn), edge + 1j * radius * height])
    values = np.sum(
        [polynomial(path) * np.exp(-each * delay * path) for each, polynomial in loop.items()],
        axis=0,
    )
    return round(float(np.sum(np.angle(values[1:] / values[:-1]))) / (2.0 * np.pi))


def growth(model, car, delay, steps=40, cycles=700):
    """1/s, of the delay differential equation stepped in time: exact between samples for delayed
    forces that are straight lines over a step."""
    forces, structures = LAGS_OF_EACH[model]
    kt, bt, mu, ks, bs, ms = car
    # States: wheel, body, and their velocities. The force is a row of coefficients of past states.
    free = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-kt / mu, 0, -bt / mu, 0], [0, 0, 0, 0]], float)
    pulls = np.array([0.0, 0.0, 1.0 / mu, -1.0 / ms])
    of_body, of_wheel = np.array([0.0, ks, 0.0, bs]), -np.array([ks, 0.0, bs, 0.0])
    if model == "single-mass":  # The wheel is held still.
        free[2], of_wheel, pulls = 0.0, np.zeros(4), np.array([0.0, 0.0, 0.0, -1.0 / ms])
    rows = {forces + structures: of_body.copy()}
    rows[forces] = rows.get(forces, np.zeros(4)) + of_wheel
    dynamics = free + np.outer(pulls, rows.pop(0, np.zeros(4)))
    step = delay / steps
    block = np.zeros((6, 6))
    block[:4, :4], block[:4, 4], block[4, 5] = dynamics * step, pulls * step, 1.0
    whole = expm(block)
    past = max(rows) * steps
    states = np.zeros(
        (past + 1 + int(cycles * 2.0 * np.pi / (critical_frequency(model, car) * step)), 4)
    )
    states[: past + 1] = [0.0, 1.0, 0.0, 0.0]
    stepped(
        states,
        past,
        whole,
        np.array([each * steps for each in rows]),
        np.array(list(rows.values())),
    )
    tenth = len(states) // 10
    middle, late = (
        np.sqrt(np.mean(states[first : first + tenth, :2] ** 2))
        for first in (len(states) // 2, len(states) - tenth)
    )
    return float(np.log(late / middle) / (step * (len(states) - tenth - len(states) // 2)))


@numba.njit
def stepped(states, past, whole, offsets, rows):
    for at in range(past, len(states) - 1):
        now = next_ = 0.0
        for number in range(len(offsets)):
            for i in range(4):
                now += rows[number, i] * states[at - offsets[number], i]
                next_ += rows[number, i] * states[at + 1 - offsets[number], i]
        for i in range(4):
            following = whole[i, 4] * now + whole[i, 5] * (next_ - now)
            for j in range(4):
                following += whole[i, j] * states[at, j]
            states[at + 1, i] = following


def critical_frequency(model, car):
    crossing = critical_delay(LOOPS[model](car))
    assert crossing is not None
    return crossing.frequency


def test_the_polynomial_in_fractions_is_that_of_the_loop():
    for model, loop in LOOPS.items():
        ours = lag_polynomial(loop(TABLE_6_2), 0.01).coef
        assert ours == pytest.approx(
            [float(each) for each in exact(model, TABLE_6_2, 0.01)], rel=1e-12
        )
