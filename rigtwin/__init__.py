"""Digital twin of test rigs, and the tool that says why the twin and the machine disagree.

    import rigtwin

    rig = rigtwin.machine("suspension-rig")
    recording = rigtwin.run(rig, "imposed", seed=1, effects={"viscous@motor": 50})
    answer = rigtwin.diagnose(recording)
    answer.report("why.html")

Names are loaded on first use, so that `import rigtwin` takes no time.
"""

from __future__ import annotations

from importlib import import_module

__version__ = "0.1.0"
TYPE_CHECKING = False
"""As in `typing`, which takes a while to import."""

if TYPE_CHECKING:
    from rigtwin.api.answers import (
        Changes,
        Diagnosis,
        FirstLook,
        calibrate,
        diagnose,
        what_changed,
    )
    from rigtwin.api.card import ServedCard, release_card, serve_card
    from rigtwin.api.card_check import TableCheck, check_card, write_table
    from rigtwin.api.comparing import Comparison, compare, compare_recordings
    from rigtwin.api.describing import Described, describe
    from rigtwin.api.dry_run import DryRun, dry_run
    from rigtwin.api.each import Answered, diagnose_each
    from rigtwin.api.energy import EnergyError, energy_error
    from rigtwin.api.faults import Campaign, faults
    from rigtwin.api.fitting import EffectFit, fit
    from rigtwin.api.importing import import_data, import_episodes
    from rigtwin.api.look import look, show_live, show_look
    from rigtwin.api.machines import (
        Effect,
        Experiment,
        Machine,
        RigtwinError,
        effects,
        experiments,
        machine,
        machines,
    )
    from rigtwin.api.planning import plan_test
    from rigtwin.api.recordings import Recording, load
    from rigtwin.api.running import run
    from rigtwin.api.session import run_session
    from rigtwin.api.stability import ModelStability, RigMargin, Stability, rig_margin, stability
    from rigtwin.api.studies import (
        HybridTest,
        Identifiability,
        Reproduction,
        TunedCompensator,
        blindcheck,
        blindcheck_machines,
        identifiability,
        reproduce,
        rths,
        tune_compensator,
    )
    from rigtwin.api.supervised import SessionResult, run_on_card, run_on_twin
    from rigtwin.api.tuning import TuningResult, tune
    from rigtwin.api.twin import Configuration
    from rigtwin.api.watching import Alarm, Suspect, Watch, watch

__all__ = [
    "Alarm",
    "Answered",
    "Campaign",
    "Changes",
    "Comparison",
    "Configuration",
    "Described",
    "Diagnosis",
    "DryRun",
    "Effect",
    "EffectFit",
    "EnergyError",
    "Experiment",
    "FirstLook",
    "HybridTest",
    "Identifiability",
    "Machine",
    "ModelStability",
    "Recording",
    "Reproduction",
    "RigMargin",
    "RigtwinError",
    "ServedCard",
    "SessionResult",
    "Stability",
    "Suspect",
    "TableCheck",
    "TunedCompensator",
    "TuningResult",
    "Watch",
    "blindcheck",
    "blindcheck_machines",
    "calibrate",
    "check_card",
    "compare",
    "compare_recordings",
    "describe",
    "diagnose",
    "diagnose_each",
    "dry_run",
    "effects",
    "energy_error",
    "experiments",
    "faults",
    "fit",
    "identifiability",
    "import_data",
    "import_episodes",
    "load",
    "look",
    "machine",
    "machines",
    "plan_test",
    "release_card",
    "reproduce",
    "rig_margin",
    "rths",
    "run",
    "run_on_card",
    "run_on_twin",
    "run_session",
    "serve_card",
    "show_live",
    "show_look",
    "stability",
    "tune",
    "tune_compensator",
    "watch",
    "what_changed",
    "write_table",
]
_MODULES = {
    "machines": (
        "Effect",
        "Experiment",
        "Machine",
        "RigtwinError",
        "effects",
        "experiments",
        "machine",
        "machines",
    ),
    "twin": ("Configuration",),
    "recordings": ("Recording", "load"),
    "importing": ("import_data", "import_episodes"),
    "running": ("run",),
    "answers": (
        "Changes",
        "Diagnosis",
        "FirstLook",
        "calibrate",
        "diagnose",
        "what_changed",
    ),
    "comparing": ("Comparison", "compare", "compare_recordings"),
    "describing": ("Described", "describe"),
    "each": ("Answered", "diagnose_each"),
    "card": ("ServedCard", "release_card", "serve_card"),
    "card_check": ("TableCheck", "check_card", "write_table"),
    "dry_run": ("DryRun", "dry_run"),
    "energy": ("EnergyError", "energy_error"),
    "faults": ("Campaign", "faults"),
    "fitting": ("EffectFit", "fit"),
    "look": ("look", "show_live", "show_look"),
    "planning": ("plan_test",),
    "supervised": ("SessionResult", "run_on_card", "run_on_twin"),
    "session": ("run_session",),
    "tuning": ("TuningResult", "tune"),
    "stability": (
        "ModelStability",
        "RigMargin",
        "Stability",
        "rig_margin",
        "stability",
    ),
    "studies": (
        "HybridTest",
        "Identifiability",
        "Reproduction",
        "TunedCompensator",
        "blindcheck",
        "blindcheck_machines",
        "identifiability",
        "reproduce",
        "rths",
        "tune_compensator",
    ),
    "watching": ("Alarm", "Suspect", "Watch", "watch"),
}
_WHERE = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> object:
    if name in _WHERE:
        value = getattr(import_module(f"rigtwin.api.{_WHERE[name]}"), name)
        if isinstance(value, type(__getattr__)):
            value = import_module("rigtwin.api.arguments").check_arguments(value)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'rigtwin' has no attribute {name!r}; it has {', '.join(__all__)}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
