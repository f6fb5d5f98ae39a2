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
    print(table([("machine", "title"), *((machine.name, machine.title) for machine in machines)]))
    for machine in machines:
        observed = ", ".join(row.name for row in machine.rows)
        print(
            f"\n{machine.name}\n  components  {', '.join(machine.components)}\n"
            f"  observed    {observed}"
        )
    return 0
