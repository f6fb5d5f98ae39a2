"""The score of a withheld-effect check: every measure with its goal and confidence interval."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from referee.check import Result
from referee.score_row import ScoreRow, share_of, wilson

CONFIDENT = 0.9
"""Confidence from which names must nearly always be right."""
WORSE = -0.05
"""Shrinkage on held-out data below which a correction made the gap larger."""
VISIBLE = 1.1
"""Smallest gap, in noise floors, for which a shrinkage is evaluated."""


def names(answer: dict[str, Any]) -> list[str]:
    """Return the effects that an answer names, written as in the key."""
    effects = []
    for effect in answer["effects"]:
        kind = effect["kind"]
        if kind == "setting":
            # The key names which setting differs.
            kind = f"setting:{next(iter(effect['parameters']))}"
        effects.append(f"{kind}@{effect['component']}")
    return effects


def truths(entry: dict[str, Any]) -> list[str]:
    """Return the true effects of an entry of the key."""
    return [f"{effect['kind']}@{effect['component']}" for effect in entry["effects"]]


def _class_of(effect: dict[str, Any]) -> set[str]:
    """Return the look-alike class of a named effect, itself included."""
    return {f"{each['kind']}@{each['component']}" for each in effect["class"]} | set(
        names({"effects": [effect]})
    )


def _error(entry: dict[str, Any], answer: dict[str, Any]) -> float:
    """Return the error of a correctly named magnitude, relative to its deviation from nominal."""
    truth = entry["effects"][0]
    value = next(iter(answer["effects"][0]["parameters"].values()))["value"]
    # Limits have no nominal value (infinite), and are compared with zero.
    nominal = truth["nominal"] or 0.0
    # Relative to the defect itself: 1 % of the total stiffness may be all of a defect.
    return abs(value - truth["value"]) / max(abs(truth["value"] - nominal), 1e-12)


Pair = tuple[dict[str, Any], dict[str, Any]]
"""Entry of the key, and the answer to it."""


def rows(result: Result) -> list[ScoreRow]:
    """Return every measure of the score, in the order of the goals."""
    pairs = list(zip(result.key, result.answers, strict=True))
    # A defect below the noise of its test is a trace: naming it is neither expected nor wrong.
    single = [(k, a) for k, a in pairs if k["sort"] == "single" and k["effects"][0]["material"]]
    traces = [(k, a) for k, a in pairs if k["sort"] == "single" and not k["effects"][0]["material"]]
    null = [a for k, a in pairs if k["sort"] == "null"]
    seconds = [a["seconds"] for _, a in pairs]
    right = [bool(names(a)) and names(a)[0] == truths(k)[0] for k, a in single]
    # Magnitudes of wrong names mean something else, so they do not count.
    errors = [_error(k, a) for (k, a), hit in zip(single, right, strict=True) if hit]
    return [
        *_single_rows(single, right),
        share_of("false alarms on nulls", [a["verdict"] != "no gap" for a in null], "<= 2 in 60"),
        *_outside_rows([(k, a) for k, a in pairs if k["sort"] == "outside"]),
        *_pair_rows([(k, a) for k, a in pairs if k["sort"] == "pair"]),
        ScoreRow(
            "magnitude error, median / 90th percentile", _percentiles(errors), "<= 2 % / <= 12 %"
        ),
        *_shrinkage_rows([a for _, a in pairs]),
        share_of(f"right when confidence >= {CONFIDENT}", _confident_hits(pairs), ">= 97 %"),
        share_of(
            "immaterial single effects: no wrong name",
            [not set(names(a)) - set(truths(k)) for k, a in traces],
            "none set",
        ),
        share_of(
            "proposed next test: the right name alone, and sure",
            [_is_settled(result.key[n], a) for n, a in result.settled.items()],
            "none set",
        ),
        ScoreRow(
            "seconds a record in the check, median / largest",
            _span(seconds),
            "<= 15 s for 30 s alone",
        ),
        *_baselines(result, single),
    ]


def _single_rows(single: Sequence[Pair], right: Sequence[bool]) -> list[ScoreRow]:
    """Return the measures of material single effects; right: whether the first name is true."""
    named = [a["effects"][0] for _, a in single if a["effects"]]
    inside = [bool(a["effects"]) and truths(k)[0] in _class_of(a["effects"][0]) for k, a in single]
    sizes = [len(_class_of(effect)) for effect in named]
    # The component counts as right if the first named effect or the first place is there.
    component = [
        bool(a["where"] or a["effects"])
        and k["effects"][0]["component"]
        in {e["component"] for e in a["effects"][:1]} | {w["component"] for w in a["where"][:1]}
        for k, a in single
    ]
    return [
        share_of("top-1 right, material single effects", right, ">= 95 %"),
        share_of("truth inside the reported class", inside, ">= 97 %"),
        ScoreRow("mean class size", f"{np.mean(sizes):.2f}" if sizes else "no case", "<= 1.3"),
        share_of("component right", component, ">= 97 %"),
    ]


def _outside_rows(outside: Sequence[Pair]) -> list[ScoreRow]:
    """Return the measures of effects that the library does not have."""
    flagged = [a["verdict"] in ("unknown", "partly explained") for _, a in outside]
    placed = [
        bool(a["where"]) and a["where"][0]["component"] == k["effects"][0]["component"]
        for k, a in outside
    ]
    return [
        share_of("effect not in the library: flagged", flagged, ">= 90 %"),
        share_of("effect not in the library: component right", placed, ">= 90 %"),
    ]


def _pair_rows(double: Sequence[Pair]) -> list[ScoreRow]:
    """Return the measures of two simultaneous effects."""
    complete = [set(truths(k)) <= set(names(a)) for k, a in double]
    wrong = [bool(set(names(a)) - set(truths(k))) for k, a in double]
    return [
        share_of("both of two effects", complete, ">= 80 %"),
        share_of("a wrong name among them", wrong, "<= 5 %"),
    ]


def _shrinkage_rows(answers: Sequence[dict[str, Any]]) -> list[ScoreRow]:
    """Return the measures of predicted and achieved shrinkage of the gap."""
    # Close to the noise floor a share of the gap is a ratio of two noises.
    gaps = [a["gap"] for a in answers if a["gap"] and a["effects"] and a["gap"]["before"] > VISIBLE]
    deviations = [abs(g["shrinkage_predicted"] - g["shrinkage_held_out"]["value"]) for g in gaps]
    worse = sum(g["shrinkage_held_out"]["value"] < WORSE for g in gaps)
    return [
        ScoreRow(
            "predicted - achieved shrinkage, median / 90th percentile",
            _plain(deviations),
            "<= 0.03 / <= 0.10",
        ),
        ScoreRow("corrections that worsen held-out data by > 5 %", f"{worse} of {len(gaps)}", "0"),
    ]


def _confident_hits(pairs: Sequence[Pair]) -> list[bool]:
    """Return for every confident name whether it is true."""
    return [
        name in truths(k)
        for k, a in pairs
        for name, effect in zip(names(a), a["effects"], strict=True)
        if effect["confidence"] >= CONFIDENT
    ]


def _is_settled(entry: dict[str, Any], answer: dict[str, Any]) -> bool:
    """Return whether the truth alone is named, confidently and without look-alikes."""
    alone = all(len(_class_of(effect)) == 1 for effect in answer["effects"])
    sure = all(effect["confidence"] >= CONFIDENT for effect in answer["effects"])
    return alone and sure and set(names(answer)) == set(truths(entry))


def _baselines(result: Result, single: list[Pair]) -> list[ScoreRow]:
    """Return the scores of two baselines: always the same name, and the black box."""
    rows_of_baselines = []
    # Whoever always guesses the commonest defect sets the lowest bar.
    counts = Counter(truths(k)[0] for k, _ in single)
    if counts:
        name, hits = counts.most_common(1)[0]
        low, high = wilson(hits, len(single))
        value = f"{hits} of {len(single)} ({100 * hits / len(single):.1f} %)"
        rows_of_baselines.append(
            ScoreRow(f"baseline, always {name}: top-1 right", value, "", low, high)
        )
    if result.crude:
        tried = [(result.key[number], name) for number, name in result.crude.items()]
        hits = [
            name == truths(k)[0]
            for k, name in tried
            if k["sort"] == "single" and k["effects"][0]["material"]
        ]
        alarms = [name != "none" for k, name in tried if k["sort"] == "null"]
        rows_of_baselines.append(share_of("baseline, black box: top-1 right", hits, ""))
        rows_of_baselines.append(share_of("baseline, black box: false alarms on nulls", alarms, ""))
    return rows_of_baselines


def _percentiles(values: Sequence[float]) -> str:
    """Format the median and the 90th percentile as percentages."""
    return (
        f"{100 * np.median(values):.1f} % / {100 * np.quantile(values, 0.9):.1f} %"
        if len(values)
        else "no case"
    )


def _plain(values: Sequence[float]) -> str:
    """Format the median and the 90th percentile."""
    return f"{np.median(values):.3f} / {np.quantile(values, 0.9):.3f}" if len(values) else "no case"


def _span(values: Sequence[float]) -> str:
    """Format the median and the largest value."""
    return f"{np.median(values):.1f} / {max(values):.1f}" if len(values) else "no case"


def misses(result: Result) -> list[str]:
    """Return one line for every wrong answer: the true effects, the named ones, and the verdict."""
    lines = []
    for number, (entry, answer) in enumerate(zip(result.key, result.answers, strict=True)):
        truth, named = truths(entry), names(answer)
        if entry["sort"] == "outside":
            placed = (
                bool(answer["where"])
                and answer["where"][0]["component"] == entry["effects"][0]["component"]
            )
            right = answer["verdict"] in ("unknown", "partly explained") and placed
        else:
            # The verdict counts too: the right name with a doubt is not the right answer.
            right = set(truth) == set(named) and answer["verdict"] in ("explained", "no gap")
        if not right:
            sizes = ", ".join(
                "any" if e["size"] is None else f"{e['size']:.2f}" for e in entry["effects"]
            )
            place = answer["where"][0]["component"] if answer["where"] else "-"
            named_text = " + ".join(named) or answer["verdict"]
            lines.append(
                f"{number:03d} {entry['sort']}, {entry['test']}: "
                f"{' + '.join(truth) or 'nothing'} (size {sizes or '-'}) -> "
                f"{named_text} [{answer['verdict']}, at {place}]"
            )
    return lines


def table(result: Result) -> str:
    """Return the score as text."""
    lines = [f"seed {result.seed}, {len(result.key)} cases, commitment {result.commitment}", ""]
    for row in rows(result):
        interval = (
            f"[{100 * row.low:.0f} to {100 * row.high:.0f} %]"
            if row.low is not None and row.high is not None
            else ""
        )
        lines.append(f"{row.measure:58s} {row.value:24s} {interval:16s} {row.goal}".rstrip())
    lines += ["", "not answered right:", *misses(result)]
    return "\n".join(lines)


def document(result: Result) -> dict[str, Any]:
    """Return the score as a JSON document."""
    return {
        "seed": result.seed,
        "cases": len(result.key),
        "commitment": result.commitment,
        "rows": [asdict(row) for row in rows(result)],
        "misses": misses(result),
    }
