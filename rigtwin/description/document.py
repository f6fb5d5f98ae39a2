"""Reader of a machine's description, a TOML file beside an MJCF. Every mistake becomes one line."""

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
from rigtwin.description.mistakes import Mistakes, suggest
from rigtwin.description.prior import PRIORS
from rigtwin.description.replay_tables import Replays
from rigtwin.errors import RigtwinError
from rigtwin.files import parse_toml

TABLES = ("machine", "components", "controller", "replays", "mains", "experiments", "limits")
"""Tables of a description."""
LONGEST_PATH = 1000
"""Largest number of characters of the model's path."""


def load(path: Path) -> Machine:
    """Return the machine of a description. Raises RigtwinError with the first mistake in it."""
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
    """Return the machine of a description, and all mistakes in it, one line per mistake.

    Parameters
    ----------
    path
        Path of the TOML file.

    Returns
    -------
    tuple
        Machine, or None if there are mistakes; and the mistakes.
    """
    try:
        # Editors on Windows write a byte order mark, which utf-8-sig removes.
        # A device such as /dev/zero never ends.
        if path.is_char_device():
            raise RigtwinError(f"{path} is a device; expected a file")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        return None, [f"cannot read it: {error.strerror}"]
    except ValueError as error:
        return None, [f"it is not valid TOML: {error}"]
    return examine_text(text, path)


def examine_text(text: str, path: Path) -> tuple[Machine | None, list[str]]:
    """Return the machine of a description in memory, and all mistakes in it, one line per mistake.

    Parameters
    ----------
    text
        Description, TOML.
    path
        Path at which the description would be saved. Its model is searched for in that folder.
    """
    mistakes = Mistakes()
    try:
        document = parse_toml(text)
    except (ValueError, RecursionError) as error:
        return None, [f"it is not valid TOML: {error}"]
    reader = _Reader(path, document, mistakes)
    machine = reader.machine()
    # A machine with a mistake in its tables is complete, but not what its author meant.
    return (None if mistakes else machine), list(mistakes)


class _Reader:
    """Reader of one parsed description. Reading goes on after a mistake, so that all are noted."""

    def __init__(self, path: Path, document: Mapping[str, Any], mistakes: Mistakes) -> None:
        self._path, self._document, self._mistakes = path, document, mistakes

    def machine(self) -> Machine | None:
        """Return the machine, or None if the description has mistakes."""
        note = self._mistakes.note
        about = self._machine_table()
        mechanism = self._mechanism(about)
        # Implied components need the mechanism: their joints and sensors are elements of the MJCF.
        if mechanism is not None:
            self._document = expand(self._document, mechanism, self._mistakes)
        tables = self._component_tables()
        if mechanism is None:
            return None
        # The order follows the references: replays name components, and the physics depends on
        # both.
        components = Components(mechanism, self._mistakes)
        for name, table in tables.items():
            components.add(name, table)
        control = self._control(components)
        reader = Replays(mechanism, components, control, self._mistakes)
        replays = reader.read(self._document.get("replays", []))
        physics = reader.physics(replays)
        hum = self._table("mains", ("frequency",)).get("frequency", 50.0)
        mains = self._mistakes.number("[mains] frequency", hum, 1.0, 400.0)
        experiments = self._experiments()
        limits = read_limits(self._document.get("limits", {}), components.by_name, self._mistakes)
        if self._document.get("limits") and not physics.declares_limits:
            note("[limits]", f"{physics.title} has its own, the settings of safety")
        if self._mistakes:
            return None
        # Timing tolerances of the description have priority, so these come last.
        reader.tolerate_timing(replays)
        reader.tolerate_softness(replays)
        values = {**components.values, "computer": Computer(), "mains": Mains(mains)}
        return Machine(
            name=str(about["name"]),
            title=str(about.get("title", about["name"])),
            path=self._path,
            model=self._model_path(about),
            plant=physics.assemble(values),
            kind=physics.name,
            components=components.by_name,
            tolerances=tuple(components.tolerances),
            replays=replays,
            control=control,
            prior=PRIORS[about.get("nominal", "rough")],
            form=float(about["form"]) if "form" in about else None,
            sources=components.sources,
            parameter_settings=components.parameter_settings,
            experiments=experiments,
            limits=limits,
            next_tests=self._next_tests(),
            overlooked=physics.list_overlooked(mechanism, components.by_name, replays),
        )

    def _machine_table(self) -> Mapping[str, Any]:
        """Return the table [machine]; note unknown tables and wrong values in it."""
        note = self._mistakes.note
        for key in self._document:
            if key not in TABLES:
                note("", f"unknown table [{key}]; {suggest(key, TABLES)}")
        about = self._table(
            "machine", ("name", "title", "model", "nominal", "form"), required=("name", "model")
        )
        name = str(about.get("name", ""))
        if "name" in about and not isinstance(about["name"], str):
            note("[machine] name", f"{name}: expected a text, in quotes")
        # The name becomes part of file names and of topics in recordings.
        elif "name" in about and not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name):
            note("[machine] name", f"{name!r}: expected letters, digits, - and _")
        if not isinstance(about.get("title", ""), str):
            note("[machine] title", f"{str(about['title'])[:40]}: expected a text, in quotes")
        nominal = about.get("nominal", "rough")
        if nominal not in PRIORS:
            note("[machine] nominal", f"{str(nominal)[:40]!r}: expected {' or '.join(PRIORS)}")
        if "form" in about:
            # A share of the signal above a half would explain anything.
            self._mistakes.number("[machine] form", about["form"], 1e-6, 0.5)
        return about

    def _component_tables(self) -> Mapping[str, Any]:
        """Return the tables of the components, written down and implied."""
        tables = self._document.get("components")
        if isinstance(tables, Mapping) and tables:
            return tables
        self._mistakes.note(
            "", "it has no [components.NAME]; expected at least what moves it and what is observed"
        )
        return {}

    def _next_tests(self) -> tuple[str, ...]:
        """Return the names of the tests that a diagnosis may propose."""
        tables = self._document.get("experiments", {})
        return tuple(map(str, tables.get("propose", ()))) if "python" in tables else ()

    def _experiments(self) -> str | Mapping[str, Any]:
        """Return the experiments: the Python module that defines them, or their tables."""
        tables = self._document.get("experiments", {})
        if isinstance(tables, Mapping) and isinstance(tables.get("python"), str):
            return str(tables["python"])
        if not isinstance(tables, Mapping):
            self._mistakes.note("[experiments]", "expected tables, [experiments.NAME]")
            return {}
        for name, table in tables.items():
            where = f"[experiments.{name}]"
            if not isinstance(table, Mapping):
                self._mistakes.note(where, "expected a table")
                continue
            self._mistakes.unknown(where, table, ("summary", "duration", "period", "demands"))
            # From a hundredth of a second to a day, and from 10 Hz to 10 kHz.
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
                # Demands are known before the test, so no signal of the test can be in them.
                if set(inputs) - {"time"}:
                    self._mistakes.note(
                        f"{where} demands.{channel}", f"{text!r}: expected a formula of time alone"
                    )
        return tables

    def _table(
        self, name: str, known: tuple[str, ...], required: tuple[str, ...] = ()
    ) -> Mapping[str, Any]:
        """Return a table of the description; note unknown and missing keys."""
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
        """Return the path of the model: beside the description, or else a shipped one."""
        beside = self._path.parent / str(about.get("model", ""))
        shipped = Path(str(files("models"))) / "xml" / str(about.get("model", ""))
        # A copied description finds the shipped model; a model beside it has priority.
        return shipped if not beside.is_file() and shipped.is_file() else beside

    def _mechanism(self, about: Mapping[str, Any]) -> Mechanism | None:
        """Return the compiled model, or None if it cannot be compiled, which is noted."""
        if not isinstance(about.get("model"), str):
            if "model" in about:
                self._mistakes.note("[machine] model", "expected the name of an MJCF file")
            return None
        if len(about["model"]) > LONGEST_PATH:
            self._mistakes.note(
                "[machine] model", f"{about['model'][:40]}…: expected the name of an MJCF file"
            )
            return None
        try:
            return Mechanism(self._model_path(about))
        except RigtwinError as error:
            self._mistakes.note("[machine]", str(error))
            return None

    def _control(self, components: Components) -> Control | None:
        """Return the controller of the description; None without one or with a mistake."""
        if "controller" not in self._document:
            return None
        if "python" in self._document["controller"]:
            return self._python_control()
        return self._formula_control(components)

    def _python_control(self) -> Control | None:
        """Return the controller written in Python that the description names."""
        name = self._table("controller", ("python",))["python"]
        if name not in PYTHON:
            self._mistakes.note("[controller] python", f"{name!r}; {suggest(name, PYTHON)}")
        return PYTHON.get(str(name))

    def _formula_control(self, components: Components) -> Control | None:
        """Return the controller that the description writes as a formula."""
        table = self._table(
            "controller",
            ("output", "formula", "inputs", "settings", "exact"),
            required=("output", "formula"),
        )
        values = self._controller_settings(table.get("settings", {}))
        if values is None:
            return None
        inputs = table.get("inputs", {})
        if not isinstance(inputs, Mapping):
            self._mistakes.note(
                "[controller] inputs", 'expected a table, such as { position = "/sensor.position" }'
            )
            return None
        outputs = {
            c.channel[1]: n
            for n, c in components.by_name.items()
            if components.types[n] in MOVING and c.channel
        }
        output = str(table.get("output", ""))
        if "output" in table and output not in outputs:
            self._mistakes.note(
                "[controller] output",
                f"no actuator takes the command {output!r}; {suggest(output, outputs)}",
            )
        try:
            # A missing formula is noted above; 0 lets the reading go on.
            compiled: Formula = formula(str(table.get("formula", "0")), values)
        except ValueError as error:
            self._mistakes.note("[controller] formula", str(error))
            return None
        # A constant command needs no controller, and its replay would judge nothing.
        if not compiled.inputs:
            self._mistakes.note(
                "[controller] formula",
                f"{compiled.text!r:.60} reads nothing; expected a sensor or a demand in it",
            )
        # A setting that nothing reads is a spelling mistake in one of the two places.
        unused = [key for key in values if not re.search(rf"\b{re.escape(key)}\b", compiled.text)]
        if unused:
            self._mistakes.note("[controller] settings", f"{', '.join(unused)} not in the formula")
        channels = self._input_channels(compiled, inputs, components)
        exact = None
        if "exact" in table:
            exact = self._mistakes.number("[controller] exact", table["exact"], 1e-300, 1e9)
        return FormulaControl(output, compiled, channels, exact)

    def _controller_settings(self, settings: object) -> dict[str, float] | None:
        """Return the controller's settings by name; None if they are not a table or have a name
        that a formula cannot contain."""
        if not isinstance(settings, Mapping):
            self._mistakes.note("[controller] settings", "expected a table of numbers")
            return None
        for key in settings:
            if not NAME.fullmatch(key):
                self._mistakes.note(
                    "[controller] settings",
                    f"{key[:40]!r} cannot be a setting's name; expected letters, digits and _",
                )
                return None
        return {
            key: self._mistakes.number(f"[controller] settings.{key}", value, -1e300, 1e300)
            for key, value in settings.items()
        }

    def _input_channels(
        self, compiled: Formula, inputs: Mapping[str, Any], components: Components
    ) -> dict[str, Channel]:
        """Return the channel of every name in the formula.

        The table `inputs` has priority, then a sensor of that name. Any further name is a demand,
        which recordings store in the topic of the commands.
        """
        channels: dict[str, Channel] = {}
        for name in compiled.inputs:
            known = components.by_name.get(name)
            wanted = inputs.get(name)
            if wanted is not None:
                topic, _, field = str(wanted).partition(".")
                if topic not in ("/command", "/sensor") or not field:
                    self._mistakes.note(
                        "[controller] inputs",
                        f"{name} = {wanted!r}: expected /command.NAME or /sensor.NAME",
                    )
                channels[name] = (topic, field)
            # An actuator of that name is no input: its command would be its own cause.
            elif known is not None and known.channel is not None and known.element == "sensor":
                channels[name] = known.channel
            else:
                channels[name] = ("/command", name)
        return channels
