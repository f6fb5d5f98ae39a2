"""Texts of a page as HTML."""

from __future__ import annotations

from html import escape

from rigtwin.diagnosis.effect_fit import EffectFit
from rigtwin.looking.look import Look
from rigtwin.looking.prediction import Prediction
from rigtwin.looking.starting_point import StartingPoint
from rigtwin.watching import Suspect, Watch

STYLE = "margin:0 0.8em 0.5em;font-size:0.85em;line-height:1.35"
CALM, ALARMED = "#1b7f3b", "#b3261e"
CELL = "padding:0 0 0 1em;text-align:right;font-variant-numeric:tabular-nums"


def note(text: str) -> str:
    """Return a paragraph of text."""
    return f'<p class="note" style="{STYLE}">{escape(text)}</p>'


def describe_errors(look: Look, prediction: Prediction) -> str:
    """Return a table of every sensor's error, for this twin and the described one."""
    rows = "".join(
        f'<tr><td>{escape(sensor)}</td><td style="{CELL}" data-sensor="{escape(sensor)}">'
        f'{_percent(prediction.percent[sensor])}</td><td style="{CELL}">'
        f"{_percent(look.nominal.percent[sensor])}</td></tr>"
        for sensor in look.sensors
    )
    return (
        f'<div style="{STYLE}"><p style="margin:0.3em 0;font-size:1.5em">off by '
        f'<b id="overall">{_percent(prediction.overall)}</b></p>'
        f'<table style="border-collapse:collapse"><tr><td></td><td style="{CELL}">this twin</td>'
        f'<td style="{CELL}">as described</td></tr>{rows}</table>'
        "<p>rms of measured less predicted, in percent of the signal's standard deviation</p></div>"
    )


def describe_starting_point(start: StartingPoint) -> str:
    """Return the effects of a diagnosis or alarm, with their confidence."""
    lines = [start.sentence]
    lines += [
        f"{name}: {', '.join(f'{value:.4g}' for value in values)}; confidence "
        f"{100.0 * start.confidence[name]:.0f} %"
        for name, values in start.values.items()
    ]
    if start.without_slider:
        names = ", ".join(start.without_slider)
        lines.append(f"found too, but no slider moves it: {names}")
    return "".join(note(line) for line in lines)


def describe_fit(fitted: EffectFit, seconds: float) -> str:
    """Return fitted values with their intervals, and reasons to doubt them."""
    lines = [f"fitted in {seconds:.1f} s; 95 % intervals if no other effect acts:"]
    lines += [
        f"{p.name} = {p.value:.5g} {p.unit} ({p.low:.4g} to {p.high:.4g})"
        for p in fitted.parameters
    ]
    return "".join(note(line) for line in (*lines, *fitted.warnings))


def describe_watch(watch: Watch) -> str:
    """Return the state of a running test."""
    alarm = watch.alarm
    said, colour = ("no gap", CALM) if alarm is None else ("alarm", ALARMED)
    head = (
        f'<div style="{STYLE}"><p role="status" style="margin:0.3em 0;font-size:1.5em;'
        f'color:{colour}"><b id="watch">{said}</b></p>'
    )
    lines = [f"judged up to {watch.judged:.1f} s of the test"]
    if alarm is not None:
        lines.insert(0, str(alarm))
        lines += [_describe_suspect(watch, suspect) for suspect in alarm.suspects]
    if watch.note:
        lines.append(f"not judged: {watch.note}")
    rows = "".join(
        f'<tr><td>{escape(signal)}</td><td style="{CELL}" data-signal="{escape(signal)}">'
        f"{'not judged' if ratio == 0.0 else f'{ratio:.2f}'}</td></tr>"
        for signal, ratio in watch.ratios.items()
    )
    return (
        f"{head}</div>{''.join(note(line) for line in lines)}"
        f'<div style="{STYLE}"><table style="border-collapse:collapse"><tr><td></td>'
        f'<td style="{CELL}">gap</td></tr>{rows}</table><p>rms of measured less predicted in the '
        "last stretch, in units of what noise and tolerances explain; not judged: what stands "
        "still where dry friction holds it</p>"
        f'<p>alarm level: <b id="level">{100.0 * min(watch.level, 1.0):.0f} %</b></p></div>'
    )


def _describe_suspect(watch: Watch, suspect: Suspect) -> str:
    """Return a suspect with its values and probability."""
    machine = watch.machine
    quantities = {effect.name: effect.quantities() for effect in machine.effects()}[suspect.effect]
    values = ", ".join(
        f"{name} = {value:.4g} {machine.unit(suspect.component, quantities[name])}"
        for name, value in suspect.values.items()
    )
    return (
        f"{suspect.effect}, {100.0 * suspect.probability:.0f} %: {values}; explains "
        f"{100.0 * suspect.explained:.0f} % of the gap"
    )


def _percent(value: float) -> str:
    # A diverged twin is off by numbers that say nothing.
    return f"{value:.3g} %" if value < 999.5 else "over 999 %"
