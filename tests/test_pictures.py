"""What an engineer sees of an effect: measured and predicted beside each other, and the picture
that shows the effect alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigtwin.components.library import KINDS
from rigtwin.diagnosis.figure_parts import thin
from rigtwin.diagnosis.finding import Estimate, Finding, Name
from rigtwin.diagnosis.overlay import Overlay, overlay
from rigtwin.diagnosis.picture import Picture
from rigtwin.diagnosis.picture_forms import FORMS
from rigtwin.diagnosis.pictures import PICTURES, picture, without_effect
from rigtwin.diagnosis.units import find_unit, say
from tests.helpers.twin import RIG, evidence_of, recorded, rig_effect

GAIN = ("gain@load_cell=1.1",)


def finding_of(name: str, **values: float) -> Finding:
    """What a diagnosis would have said of an effect with these values."""
    effect = rig_effect(name)
    nominal, meanings = effect.nominal(RIG.plant), effect.quantities()
    parameters = {
        each: Estimate(value, value, value, nominal[each], meanings[each].unit)
        for each, value in values.items()
    }
    kind = effect.kind.name
    return Finding(Name(effect.component, kind), parameters, 1.0, (), 1.0)


def shown(name: str, **values: float) -> Picture:
    """The picture of an effect on a twin that has it."""
    effect = rig_effect(name)
    first, *others = values.items()
    stated = ",".join([f"{first[1]:g}", *(f"{key}={value:g}" for key, value in others)])
    evidence = evidence_of(recorded("imposed", (f"{name}={stated}",), 3.5))
    component = getattr(RIG.plant, effect.group)._replace(**values)
    corrected = RIG.plant._replace(**{effect.group: component})
    return picture(evidence, corrected, finding_of(name, **values))


def curve(of: Picture, role: str) -> tuple[np.ndarray, np.ndarray]:
    (found,) = [each for each in of.curves if each.role == role]
    return found.x, found.y


def test_every_kind_of_effect_has_a_picture_and_every_form_is_used():
    kinds = {kind.name for kind in KINDS} | {"setting"}
    assert set(PICTURES) == kinds
    assert set(PICTURES.values()) == set(FORMS)


def test_the_slope_against_velocity_is_the_viscous_coefficient():
    found = shown("viscous@motor", viscous=50.0)
    assert (found.form, found.sensor, found.x_unit, found.y_unit) == (
        "velocity",
        "load_cell",
        "m/s",
        "N",
    )
    speed, force = curve(found, "measured")
    _, law = curve(found, "after")
    assert abs(np.polyfit(speed, force, 1)[0]) == pytest.approx(50.0, rel=0.1)
    assert np.sqrt(np.mean((force - law) ** 2)) < 0.1 * np.std(law)
    assert not curve(found, "before")[1].any()


def test_a_delay_is_a_straight_line_of_phase():
    found = shown("delay@structure_cylinder", delay=0.01)
    assert found.form == "phase"
    frequency, phase = curve(found, "measured")
    assert len(frequency) > 5
    assert np.polyfit(frequency, phase, 1)[0] == pytest.approx(-2 * np.pi * 0.01, rel=0.05)


def test_a_gain_is_the_slope_of_measured_against_predicted():
    found = shown("gain@load_cell", gain=1.1)
    predicted, measured = curve(found, "measured")
    assert np.polyfit(predicted, measured, 1)[0] == pytest.approx(1.1, rel=0.02)


def test_cogging_is_one_wave_over_its_pitch():
    found = shown("cogging@motor", cogging=20.0, cogging_pitch=0.012, cogging_phase=0.4)
    assert found.form == "pitch"
    place, force = curve(found, "measured")
    assert 0.0 <= place.min() < place.max() <= 0.012
    wave = np.sin(2.0 * np.pi * place / 0.012 + 0.4)
    assert abs(np.corrcoef(wave, force)[0, 1]) > 0.95


# The pitch is that of an effect which has one, see above.
@pytest.mark.parametrize("form", sorted({*FORMS} - {"pitch"}))
def test_every_form_has_measured_data_a_caption_and_finite_numbers(form, monkeypatch):
    monkeypatch.setitem(PICTURES, "gain", form)
    found = shown("gain@load_cell", gain=1.1)
    assert found.form == form
    assert any(each.role == "measured" and len(each.x) > 3 for each in found.curves)
    assert all(np.isfinite(each.x).all() and np.isfinite(each.y).all() for each in found.curves)
    assert all(each.x.shape == each.y.shape for each in found.curves)
    assert found.caption.endswith(".")


def test_taking_an_effect_out_leaves_the_others():
    plant = RIG.plant._replace(
        rail=RIG.plant.rail._replace(coulomb=75.0), motor=RIG.plant.motor._replace(viscous=50.0)
    )
    less = without_effect(RIG.plant, plant, finding_of("viscous@motor", viscous=50.0))
    assert (less.rail.coulomb, less.motor.viscous) == (75.0, 0.0)


def test_an_overlay_says_how_far_off_each_sensor_is_before_and_after():
    recording = recorded("imposed", GAIN, 3.5)
    corrected = RIG.plant._replace(load_cell=RIG.plant.load_cell._replace(gain=1.1))
    found = overlay(evidence_of(recording), corrected)
    first = found[0]
    assert first.sensor == "load_cell"
    assert first.before > 5.0 * first.after
    assert first.after == pytest.approx(first.noise, rel=0.3)
    assert first.before_percent == pytest.approx(100.0 * first.before / first.swing)


def test_held_out_recordings_come_first_by_name():
    fitted = evidence_of(recorded("imposed", GAIN, 3.5))
    apart = evidence_of(recorded("imposed", GAIN, 3.0, 7))
    found = overlay(fitted, RIG.plant, apart)
    assert [each.held_out for each in found] == [True] * 4 + [False] * 4


def test_the_worst_second_is_where_the_corrected_prediction_is_furthest_off():
    time = np.arange(8000) * 1e-3
    off = np.where((time > 5.2) & (time < 5.9), 3.0, 0.1)
    flat = np.zeros(8000)
    of = Overlay("a", False, "s", "force", "N", time, off, flat, flat, np.ones(8000), 0.1)
    start, end = of.worst
    assert start <= 5.21
    assert end >= 5.89
    assert end - start == pytest.approx(1.0, abs=0.01)
    unseen = replace(of, counts=np.where(time > 5.0, 0.0, 1.0))
    assert unseen.worst[0] < 5.0


def test_a_thinned_line_keeps_its_peaks_and_its_order():
    time = np.arange(30000) * 1e-3
    values = np.sin(time)
    values[12345], values[777] = 9.0, -9.0
    shown_time, shown_values = thin(time, values, 2000)
    assert len(shown_time) <= 2000 + 1
    assert (np.diff(shown_time) > 0).all()
    assert (shown_values.max(), shown_values.min()) == (9.0, -9.0)


def test_sizes_are_written_in_engineers_units():
    assert find_unit("N", 25e3) == (1e-3, "kN")
    assert find_unit("m/s", 0.3) == (1e3, "mm/s")
    assert find_unit("N", 300.0) == (1.0, "N")
    assert find_unit("1", 0.3) == (1.0, "")
    factor, unit = find_unit("rad", 1.0)
    assert (round(factor, 3), unit) == (57.296, "°")
    assert say(0.00047, "m") == "0.47 mm"


def test_what_the_commands_alone_say_is_not_promised_to_move_a_line():
    told = Estimate(2.0, 2.0, 2.0, 1.0, "1")
    finding = Finding(Name("controller", "setting"), {"kp": told}, 1.0, (), 1.0)
    found = picture(evidence_of(recorded("imposed", GAIN, 3.5)), RIG.plant, finding)
    assert np.array_equal(curve(found, "before")[1], curve(found, "after")[1])
    assert "changes no line" in found.caption


def test_a_picture_says_how_much_of_the_effect_its_recording_asks_for():
    assert shown("gain@load_cell", gain=1.1).caption.endswith("the effect has the fitted size.")
    evidence = evidence_of(recorded("imposed", GAIN, 3.5))
    twice = RIG.plant._replace(load_cell=RIG.plant.load_cell._replace(gain=1.15))
    found = picture(evidence, twice, finding_of("gain@load_cell", gain=1.15))
    share = float(found.caption.rsplit(" has ", 1)[1].split(" times")[0])
    assert share == pytest.approx(0.667, abs=0.05)
