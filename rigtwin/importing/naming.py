"""Names of columns: a unit behind a name, and the parts of a column of lists."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence

from rigtwin.importing.units import is_unit


def split_unit(name: str, unit: str) -> tuple[str, str]:
    """A name and its unit, which may stand in brackets behind it."""
    match = re.fullmatch(r"(.*?)\s*[\[(]([^\])]*)[\])]\s*", name)
    if re.fullmatch(r".*\S[\[(]\d+[\])]", name):
        return name, unit  # An index, q[1] or q(1); the unit one has a blank: "strain [1]".
    if match and not unit and match.group(1) and is_unit(match.group(2)):
        return match.group(1).strip(), match.group(2)
    return name.strip(), re.sub(r"^[\[(]|[\])]$", "", unit)


def name_items(name: str, count: int, labels: Sequence[str] = ()) -> list[str]:
    """Return the names of a list column's items.

    Parameters
    ----------
    name
        Name of the column.
    count
        Number of items in each row.
    labels
        Label of each item. Used only if there is one for each.

    Returns
    -------
    list of str
        `name[label]`, or `name[0]`, `name[1]`, … without labels.
    """
    # Labels that do not fit the list are wrong; numbers are at least unambiguous.
    if len(labels) != count or len(set(labels)) < count:
        labels = [str(place) for place in range(count)]
    return [f"{name}[{label}]" for label in labels]


def repeated_names(names: Iterable[str]) -> dict[str, str]:
    """Return the names that stand for several columns, and why such a column cannot be read."""
    return {
        name: f"{count} columns are named {name!r}"
        for name, count in Counter(names).items()
        if count > 1
    }
