"""A question that only the owner of a log can answer."""

from __future__ import annotations

from collections.abc import Sequence

from rigtwin.errors import RigtwinError


class Question(RigtwinError):
    """Two readings of a log are possible, or something is missing that the log does not state.

    The message states what was found, what is asked, and the options that answer it.
    """


class UnitQuestion(Question):
    """The unit of the joints' positions is open, and other signals may tell it.

    Parameters
    ----------
    question
        Message with the options that answer it.
    units
        Units that are possible.
    likely
        Whether the last of them is taken where no other signal tells.
    """

    def __init__(self, question: Question, *units: str, likely: bool = False) -> None:
        super().__init__(str(question))
        self.units, self.likely = units, likely


def ask(problem: str, *answers: str) -> Question:
    """Return the question about a problem.

    Parameters
    ----------
    problem
        Problem and question, a sentence.
    *answers
        Options of the command line that answer it, one for each possible reading.
    """
    return Question(f"{problem}; say {' or '.join(answers)}")


def option(key: str, value: str) -> str:
    """Return the option of the command line that states a column.

    Parameters
    ----------
    key
        Such as "elbow.position".
    value
        Column, formula or number.
    """
    text = f"{key}={value}"
    return f'--column "{text}"' if set(text) & set(" []()*'&;") else f"--column {text}"


def enumerate_names(names: Sequence[str], limit: int = 6) -> str:
    """Return names as a list for a message, with a count of those beyond the limit.

    Parameters
    ----------
    names
        Such as columns.
    limit
        Largest number of names that are listed.
    """
    more = f" and {len(names) - limit} more" if len(names) > limit else ""
    return ", ".join(names[:limit]) + more
