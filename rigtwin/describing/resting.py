"""Joints of a model whose position no column of a log holds."""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.describing.heading import read_words, split_words
from rigtwin.describing.log import Log
from rigtwin.describing.match import UNNAMED
from rigtwin.describing.quantity import JointQuantity
from rigtwin.describing.question import ask, enumerate_names, option
from rigtwin.description.implied import INVERSE
from rigtwin.description.joint_elements import movable_joints


def note_resting(log: Log, joints: Sequence[str], test: str) -> None:
    """Note the joints whose position no column holds, or ask where a column may be that."""
    absent = [joint for joint in movable_joints(log.mechanism) if joint not in joints]
    # Inverse dynamics of several joints leave equalities out.
    leads = joints if len(joints) == 1 or test != INVERSE else ()
    followed = {tie.joint: tie.to for tie in log.mechanism.ties_of(leads)[0]}
    log.notes += [f"{j}: it follows {followed[j]} by an equality" for j in absent if j in followed]
    resting = [joint for joint in absent if joint not in followed]
    undecided = [j for j in resting if log.slots.stated(j, JointQuantity.POSITION) is None]
    unnamed = [name for name, why in log.unused.items() if why == UNNAMED and _is_position(name)]
    if undecided and unnamed:
        key = f"{undecided[0]}.position"
        question = ask(
            f"no column is named as the position of {enumerate_names(undecided)}, and "
            f"{enumerate_names(unnamed)} {'fits' if len(unnamed) == 1 else 'fit'} no joint",
            option(key, unnamed[0]),
            option(key, "none") + " if it rests",
        )
        log.questions.append(str(question))
    elif resting:
        log.notes.append(
            f"{enumerate_names(resting)}: no column is the position, so it stays where the model "
            "has it"
        )


def _is_position(column: str) -> bool:
    """Whether the words of a column's name say that it is a measured position."""
    meaning = read_words(split_words(column), "")
    return meaning.quantity is JointQuantity.POSITION and not meaning.commanded
