"""`rigtwin machines`: the machines that come along."""

from __future__ import annotations

import argparse

from rigtwin.console import table

SUMMARY = "list the machines that come along"
MORE = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    pass


def execute(_parsed: argparse.Namespace) -> int:
    import rigtwin

    machines = [rigtwin.machine(name) for name in rigtwin.machines()]
    print(table([("machine", "title"), *((each.name, each.title) for each in machines)]))
    for each in machines:
        observed = ", ".join(row.name for row in each.rows)
        print(
            f"\n{each.name}\n  components  {', '.join(each.components)}\n  observed    {observed}"
        )
    return 0
