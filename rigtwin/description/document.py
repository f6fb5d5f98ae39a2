"""Reads a machine's description, one TOML beside an MJCF, and explains every mistake in it in one
line."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from controllers.formula import Formula, formula
from rigtwin.components import Computer, Mains
from rigtwin.description.component_tables import MOVING, NAME, Components
from rigtwin.description.control import PYTHON, Channel, Control, FormulaControl
from rigtwin.description.implied import expand
from rigtwin.description.limits import read_limits
from rigtwin.description.machine import Machine
from rigtwin.description.mechanism import Mechanism
from rigtwin.description.mistakes import Mistakes, near
from rigtwin.description.prior import PRIORS
from rigtwin.description.replay_tables import Replays
from rigtwin.errors import RigtwinError
from rigtwin.files import parse_toml

TABLES = ("machine", "components", "controller", "replays", "mains", "experiments", "limits")


def load(path: Path) -> Machine:
    """The machine of a description. Raises RigtwinError with the first mistake in it."""
    machine, mistakes = examine(path)
    if mistakes or machine is None:
        more = (
            f" (and {len(mistakes) - 1} more; rigtwin machine check {path})"
            if len(mistakes) > 1
            else ""
        )
        raise RigtwinError(f"{path}: {mistakes[0]}{more}")
    return machine


def examine(path: Path) -> tuple[Machine | None, list[str]]:
    """The machine of a description, and all mistakes in it, one line each; no machine if there are
    any."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        return None, [f"cannot read it: {error.strerror}"]
    except ValueError as error:
        return None, [f"it is not valid TOML: {error}"]
    return examine_text(text, path)


def examine_text(text: str, path: Path) -> tuple[Machine | None, list[str]]:
    """Return the machine of a description in memory, and all mistakes in it, one line each.

    Parameters
    ----------
    text
        The description, TOML.
    path
        File that the description would be. Its model is looked for beside that file.
    """
    mistakes = Mistakes()
    try:
        document = parse_toml(text)
    except (ValueError, RecursionError) as error:
        return None, [f"it is not valid TOML: {error}"]
    reader = _Reader(path, document, mistakes)
    machine = reader.machine()
    return (None if mistakes else machine), list(mistakes)


class _Reader:
    def __init__(self, path: Path, document: Mapping[str, Any], mistakes: Mistakes) -> None:
        self._path, self._document, self._mistakes = path, document, mistakes

    def machine(self) -> Machine | None:
        note = self._mistakes.note
        for key in self._document:
            if key not in TABLES:
                note("", f"unknown table [{key}]; {near(key, TABLES)}")
        about = self._table(
            "machine", ("name", "title", "model", "nominal", "form"), required=("name", "model")
        )
        name = str(about.get("name", ""))
        if "name" in about and not isinstance(about["name"], str):
            note("[machine] name", f"{name}: expected a text, in quotes")
        elif "name" in about and not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name):
            note("[machine] name", f"{name!r}: expected letters, digits, - and _")
        nominal = about.get("nominal", "rough")
        if nominal not in PRIORS:
            note("[machine] nominal", f"{str(nominal)[:40]!r}: expected {' or '.join(PRIORS)}")
        form = (
            self._mistakes.number("[machine] form", about["form"], 1e-6, 0.5)
            if "form" in about
            else None
        )
        mechanism = self._mechanism(about)
        if mechanism is not None:
            self._document = expand(self._document, mechanism, self._mistakes)
        given = self._document.get("components")
        if not isinstance(given, Mapping) or not given:
            note(
                "",
                "it has no [components.NAME]; expected at least what moves it and what is observed",
            )
            given = {}
        if mechanism is None:
            return None
        components = Components(mechanism, self._mistakes)
        for each, table in given.items():
            components.add(each, table)
        control = self._control(components)
        reader = Replays(mechanism, components, control, self._mistakes)
        replays = reader.read(self._document.get("replays", []))
        physics = reader.physics(replays)
        hum = self._table("mains", ("frequency",)).get("frequency", 50.0)
        mains = self._mistakes.number("[mains] frequency", hum, 1.0, 400.0)
        experiments = self._experiments()
        limits = read_limits(self._document.get("limits", {}), components.found, self._mistakes)
        if self._document.get("limits") and not physics.declares_limits:
            note("[limits]", f"{physics.title} has its own, the settings of safety")
        if self._mistakes:
            return None
        reader.tolerate_timing(replays)
        values = {**components.values, "computer": Computer(), "mains": Mains(mains)}
        return Machine(
            name=name,
            title=str(about.get("title", name)),
            path=self._path,
            model=self._model_path(about),
            plant=physics.assemble(values),
            kind=physics.name,
            components=components.found,
            tolerances=tuple(components.tolerances),
            replays=replays,
            control=control,
            prior=PRIORS[nominal],
            form=form,
            sources=components.sources,
            told=components.told,
            experiments=experiments,
            limits=limits,
            next_tests=self._next_tests(),
            overlooked=physics.list_overlooked(mechanism, components.found, replays),
        )

    def _next_tests(self) -> tuple[str, ...]:
        given = self._document.get("experiments", {})
        return tuple(map(str, given.get("propose", ()))) if "python" in given else ()

    def _experiments(self) -> str | Mapping[str, Any]:
        given = self._document.get("experiments", {})
        if isinstance(given, Mapping) and isinstance(given.get("python"), str):
            return str(given["python"])
        if not isinstance(given, Mapping):
            self._mistakes.note("[experiments]", "expected tables, [experiments.NAME]")
            return {}
        for name, table in given.items():
            where = f"[experiments.{name}]"
            if not isinstance(table, Mapping):
                self._mistakes.note(where, "expected a table")
                continue
            self._mistakes.unknown(where, table, ("summary", "duration", "period", "demands"))
            for key, low, high in (("duration", 0.01, 86_400.0), ("period", 1e-4, 0.1)):
                if key in table:
                    self._mistakes.number(f"{where} {key}", table[key], low, high)
            demands = table.get("demands")
            if not isinstance(demands, Mapping):
                self._mistakes.note(
                    where, 'demands is missing; expected CHANNEL = "formula of time"'
                )
                continue
            for channel, text in demands.items():
                try:
                    inputs = formula(str(text), {}).inputs
                except ValueError as error:
                    self._mistakes.note(f"{where} demands.{channel}", str(error))
                    continue
                if set(inputs) - {"time"}:
                    self._mistakes.note(
                        f"{where} demands.{channel}", f"{text!r}: expected a formula of time alone"
                    )
        return given

    def _table(
        self, name: str, known: tuple[str, ...], required: tuple[str, ...] = ()
    ) -> Mapping[str, Any]:
        table = self._document.get(name, {})
        if not isinstance(table, Mapping):
            self._mistakes.note(f"[{name}]", "expected a table")
            return {}
        self._mistakes.unknown(f"[{name}]", table, known)
        for key in required:
            if key not in table:
                self._mistakes.note(f"[{name}]", f"{key} is missing")
        return table

    def _model_path(self, about: Mapping[str, Any]) -> Path:
        """Beside the description, or where the project keeps its models."""
        beside = self._path.parent / str(about.get("model", ""))
        shipped = Path(str(files("models"))) / "xml" / str(about.get("model", ""))
        return shipped if not beside.is_file() and shipped.is_file() else beside

    def _mechanism(self, about: Mapping[str, Any]) -> Mechanism | None:
        if not isinstance(about.get("model"), str):
            if "model" in about:
                self._mistakes.note("[machine] model", "expected the name of an MJCF file")
            return None
        try:
            return Mechanism(self._model_path(about))
        except RigtwinError as error:
            self._mistakes.note("[machine]", str(error))
            return None

    def _control(self, components: Components) -> Control | None:
        if "controller" not in self._document:
            return None
        if "python" in self._document["controller"]:
            return self._python_control()
        return self._formula_control(components)

    def _python_control(self) -> Control | None:
        name = self._table("controller", ("python",))["python"]
        if name not in PYTHON:
            self._mistakes.note("[controller] python", f"{name!r}; {near(name, PYTHON)}")
        return PYTHON.get(str(name))

    def _formula_control(self, components: Components) -> Control | None:
        table = self._table(
            "controller",
            ("output", "formula", "inputs", "settings", "exact"),
            required=("output", "formula"),
        )
        settings, inputs = table.get("settings", {}), table.get("inputs", {})
        if not isinstance(settings, Mapping):
            self._mistakes.note("[controller] settings", "expected a table of numbers")
            return None
        if not isinstance(inputs, Mapping):
            self._mistakes.note(
                "[controller] inputs", 'expected a table, such as { position = "/sensor.position" }'
            )
            return None
        for key in settings:
            if not NAME.fullmatch(key):
                self._mistakes.note(
                    "[controller] settings",
                    f"{key[:40]!r} cannot be a setting's name; expected letters, digits and _",
                )
                return None
        values = {
            key: self._mistakes.number(f"[controller] settings.{key}", v, -1e300, 1e300)
            for key, v in settings.items()
        }
        outputs = {
            c.channel[1]: n
            for n, c in components.found.items()
            if components.types[n] in MOVING and c.channel
        }
        output = str(table.get("output", ""))
        if "output" in table and output not in outputs:
            self._mistakes.note(
                "[controller] output",
                f"no actuator takes the command {output!r}; {near(output, outputs)}",
            )
        try:
            compiled: Formula = formula(str(table.get("formula", "0")), values)
        except ValueError as error:
            self._mistakes.note("[controller] formula", str(error))
            return None
        if not compiled.inputs:
            self._mistakes.note(
                "[controller] formula",
                f"{compiled.text!r:.60} reads nothing; expected a sensor or a demand in it",
            )
        unused = [key for key in settings if not re.search(rf"\b{re.escape(key)}\b", compiled.text)]
        if unused:
            self._mistakes.note("[controller] settings", f"{', '.join(unused)} not in the formula")
        channels: dict[str, Channel] = {}
        for name in compiled.inputs:
            known = components.found.get(name)
            wanted = inputs.get(name)
            if wanted is not None:
                topic, _, field = str(wanted).partition(".")
                if topic not in ("/command", "/sensor") or not field:
                    self._mistakes.note(
                        "[controller] inputs",
                        f"{name} = {wanted!r}: expected /command.NAME or /sensor.NAME",
                    )
                channels[name] = (topic, field)
            elif known is not None and known.channel is not None and known.element == "sensor":
                channels[name] = known.channel
            else:
                channels[name] = ("/command", name)
        exact = None
        if "exact" in table:
            exact = self._mistakes.number("[controller] exact", table["exact"], 1e-300, 1e9)
        return FormulaControl(output, compiled, channels, exact)
