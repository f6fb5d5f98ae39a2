"""`rigtwin blindcheck`: the check with withheld effects, and whether tuning on a diagnosis pays."""

from __future__ import annotations

import sys
from argparse import Namespace

from tqdm import tqdm

from rigtwin.console import writable, write_json
from rigtwin.errors import RigtwinError
from rigtwin.studies.sweep import Store, Workers, open_workers

RIGS = 8
"""Of a check of tuning, unless said."""
CASES = 200


def blindcheck(parsed: Namespace) -> int:
    """Runs the check that was asked for and prints its score."""
    if (parsed.cases is not None and parsed.cases < 1) or parsed.seed < 0:
        raise RigtwinError("--cases must be at least 1, --seed at least 0")
    if parsed.json is not None:
        writable(parsed.json)
    with open_workers(parsed.workers, parsed.cluster) as workers:
        return _diagnoses(parsed, workers) if parsed.tune is None else _tuning(parsed, workers)


def _diagnoses(parsed: Namespace, workers: Workers) -> int:
    from referee.check import check
    from referee.score import document, table

    cases = CASES if parsed.cases is None else parsed.cases
    shown = {"unit": "case", "desc": "withheld effects", "leave": False}
    with tqdm(total=2 * cases, disable=None, **shown) as bar:
        result = check(parsed.folder, cases, parsed.seed, parsed.baselines, workers, bar.update)
    print(table(result))
    if parsed.json is not None:
        write_json(parsed.json, document(result))
    return 0


def _tuning(parsed: Namespace, workers: Workers) -> int:
    from experiments.tuning import find_study
    from referee.tuning import Case, check, document, text
    from rigtwin.studies.tuning.bench import Bench

    study = find_study(parsed.tune)
    minimise, budget = study.goals.minimise, study.budget
    if len(minimise) != 1 or minimise[0].more:
        expected = "expected a study with one objective that is of the test itself"
        raise RigtwinError(f"--tune {parsed.tune}: {expected}")
    cases = RIGS if parsed.cases is None else parsed.cases
    searches = (cases + 1) * (budget.evaluations + 1) * budget.roads
    total = searches + cases * (1 + 3 * budget.held_out)
    with (
        Store(parsed.folder / f"tuning-{study.name}.sqlite") as store,
        tqdm(total=total, disable=None, unit="run", leave=False, file=sys.stderr) as bar,
    ):

        def show(case: Case) -> None:
            told = f"withheld {case.defect}; diagnosed: {case.found}"
            bar.write(f"rig {case.number + 1}: {told}", file=sys.stdout)

        bench = Bench(study, store, workers, bar.update)
        found = check(bench, cases, parsed.seed, stage=bar.set_description, show=show)
    print(text(study, found))
    if parsed.json is not None:
        write_json(parsed.json, document(study, found))
    return 0
