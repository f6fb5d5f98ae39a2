"""A recording beside its twin while effects are moved."""

from __future__ import annotations

import numpy as np
import pytest

import rigtwin
from rigtwin.looking import Look
from tests.helpers.described import NOISY, described

TRUE = 6.0
COUNTED = 0.39
"""s, from which a test of 4 s counts."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> rigtwin.Recording:
    machine = described(tmp_path_factory.mktemp("look"), "slide", NOISY)
    return rigtwin.run(machine, "shake", seed=1, effects={"coulomb@guide": TRUE})


@pytest.fixture(scope="module")
def machine(tmp_path_factory) -> rigtwin.Machine:
    return described(tmp_path_factory.mktemp("look"), "slide", NOISY)


@pytest.fixture(scope="module")
def look(machine, recording) -> Look:
    return rigtwin.look(recording, machine=machine)


def test_the_error_is_least_at_the_true_value(look):
    errors = {
        value: look.predict({"coulomb@guide": (value,)}).overall
        for value in (0.0, 0.5 * TRUE, TRUE, 1.5 * TRUE)
    }
    assert min(errors, key=lambda value: errors[value]) == TRUE
    assert errors[0.0] == pytest.approx(look.nominal.overall)
    assert errors[TRUE] < 0.05 * errors[0.0]


def test_the_error_is_the_rms_in_percent_of_the_swing(look):
    counts = look.time - look.time[0] > COUNTED
    residual = (look.measured - look.nominal.signals)[0][counts]
    percent = 100.0 * np.sqrt(np.mean(residual**2)) / np.std(look.measured[0][counts])
    assert look.nominal.percent["encoder"] == pytest.approx(percent, rel=0.01)


def test_every_candidate_has_a_slider_a_parameter(look):
    assert set(look.sliders) == set(look.effects)
    for name, sliders in look.sliders.items():
        assert [slider.parameter for slider in sliders] == list(look.effects[name].kind.parameters)
        for slider in sliders:
            assert slider.low < slider.high, slider
            assert slider.low <= slider.start <= slider.high, slider


def test_every_slider_can_be_moved_to_its_ends(look):
    for name, sliders in look.sliders.items():
        start = [slider.start for slider in sliders]
        for number, slider in enumerate(sliders):
            for end in (slider.low, slider.high):
                moved = (*start[:number], end, *start[number + 1 :])
                assert np.all(np.isfinite(look.predict({name: moved}).signals)), slider


@pytest.mark.slow
def test_a_fit_is_the_diagnosis_and_is_saved_as_a_twin(look, machine, recording, tmp_path):
    fitted = look.fit(["coulomb@guide"])
    values = dict(zip(("coulomb@guide",), fitted.values, strict=True))
    (finding,) = rigtwin.diagnose(recording, machine=machine).effects
    interval = finding.parameters["coulomb"]
    assert interval.low <= values["coulomb@guide"][0] <= interval.high
    path = look.save(tmp_path / "twin.toml", values)
    again = rigtwin.look(recording, machine=machine, settings=path)
    assert again.plant({}) == look.plant(values)
    # Each is predicted in the longest steps that change its own nominal by half a percent at most.
    assert again.nominal.overall == pytest.approx(look.predict(values).overall, rel=0.1, abs=0.01)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda look: look.predict({"coulomb@wing": (1.0,)}), "unknown effect 'coulomb@wing'"),
        (lambda look: look.predict({"coulomb@guide": ()}), "expected 1 values (coulomb), got 0"),
        (lambda look: look.predict({"coulomb@guide": (-1.0,)}), "coulomb = -1; expected 0 to"),
        (lambda look: look.predict({"coulomb@guide": (float("nan"),)}), "coulomb = nan"),
        (lambda look: look.fit([]), "no effect to fit; expected some of"),
        (lambda look: look.fit(["coulomb@guide"] * 2), "changes a parameter that another effect"),
        (lambda look: look.save("/nowhere/twin.toml", {}), "cannot write /nowhere/twin.toml"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(look, call, said):
    with pytest.raises(rigtwin.RigtwinError) as error:
        call(look)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_recording_of_few_spectral_lines_can_be_looked_at():
    short = rigtwin.run(
        rigtwin.machine("double-pendulum"),
        "swing",
        seed=1,
        settings={"timing": {"duration": 4.0}},
    )
    assert rigtwin.look(short).nominal.overall < 5.0


def test_what_is_measured_between_joints_says_where_the_last_one_is():
    bench = rigtwin.machine("quarter-car-bench")
    look = rigtwin.look(rigtwin.run(bench, "bumps", seed=1, settings={"timing": {"duration": 2.0}}))
    measured, nominal = look.positions(), look.positions(look.nominal)
    assert set(measured) == {"road", "wheel", "body"}
    travel = look.measured[look.sensors.index("travel")]
    assert measured["body"] - measured["wheel"] == pytest.approx(travel, abs=1e-3)
    assert nominal["body"] == pytest.approx(measured["body"], abs=1e-3)
    assert np.std(nominal["body"] - measured["body"]) > 0.0
