"""What `import rigtwin` offers: the same lines for every machine."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import av
import numba
import numpy as np
import pytest

import rigtwin
from controllers import Commands, Demand, Measurements
from rigtwin.cli import COMMANDS
from tests.helpers.described import NOISY, described

EXAMPLES = Path(__file__).parents[1] / "examples"
SHORT = {"timing": {"duration": 3.0}}


def wrong(value: object) -> Any:
    """Of a type that no checker lets pass."""
    return value


def folder_machine(folder: Path) -> rigtwin.Machine:
    described(folder, "slide", NOISY)
    return rigtwin.machine(folder / "bench.toml")


@pytest.mark.parametrize(
    ("sort", "experiment", "effect", "magnitude", "channel"),
    [
        pytest.param(
            "suspension-rig",
            "imposed",
            "viscous@motor",
            50.0,
            "/sensor.load_cell",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "folder", "shake", "coulomb@guide", 6.0, "/sensor.position", marks=pytest.mark.slow
        ),
    ],
)
def test_the_same_lines_for_every_machine(tmp_path, sort, experiment, effect, magnitude, channel):
    machine = folder_machine(tmp_path) if sort == "folder" else rigtwin.machine(sort)
    settings = {"timing": {"duration": 4.0 if sort == "folder" else 6.0}}
    recording = rigtwin.run(
        machine, experiment, seed=1, effects={effect: magnitude}, settings=settings
    )
    assert recording[channel].shape == recording.time.shape
    assert recording.units[channel] in ("N", "m")
    again = rigtwin.run(
        machine, experiment, seed=2, effects=[f"{effect}={magnitude}"], settings=settings
    )
    answer = rigtwin.diagnose(recording, held_out=again)
    assert answer.verdict == "explained"
    assert [str(each.name) for each in answer.effects] == [effect]
    found = next(iter(answer.effects[0].parameters.values()))
    assert found.value == pytest.approx(magnitude, rel=0.03)
    page = answer.report(tmp_path / "why.html").read_text()
    assert effect.partition("@")[2] in page
    assert answer._repr_html_() == page
    before, after = rigtwin.compare(recording), rigtwin.compare(recording, machine=answer.machine)
    assert after.gap - 1.0 < 0.1 * (before.gap - 1.0)
    # The corrected machine survives its file.
    twin = answer.save_twin(tmp_path / "twin.toml")
    assert rigtwin.compare(recording, settings=twin).gap == after.gap
    better = rigtwin.run(answer.machine, experiment, settings=SHORT)
    assert better.video(tmp_path / "better.mp4", until=0.3).stat().st_size > 1000


@pytest.mark.slow
def test_a_film_shows_where_the_twin_is(tmp_path):
    recording = rigtwin.run(
        "suspension-rig", "imposed", effects={"coulomb@rail": 70}, settings=SHORT
    )

    def last_picture(name: str, **options: Any) -> np.ndarray:
        out = recording.video(tmp_path / name, start=1.6, until=1.7, **options)
        with av.open(str(out)) as film:
            return [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)][-1]

    alone = last_picture("alone.mp4").astype(int)
    beside = last_picture("beside.mp4", ghost=100.0).astype(int)
    known = last_picture("known.mp4", ghost=100.0, settings={"rail": {"coulomb": 70.0}}).astype(int)
    changed = np.abs(beside - alone).sum(axis=2) > 60
    assert changed[:432].mean() > 0.02
    assert changed[440:].mean() < 0.001
    assert (np.abs(beside - known).sum(axis=2) > 60)[:432].mean() > 0.005


@pytest.mark.parametrize("gap", [-1.0, np.inf])
def test_a_ghost_has_a_finite_gap(tmp_path, gap):
    recording = rigtwin.run("suspension-rig", "drop", settings=SHORT)
    with pytest.raises(rigtwin.RigtwinError, match="times as large; expected 0 or more"):
        recording.video(tmp_path / "a.mp4", ghost=gap)


def test_a_twin_that_moves_as_measured_has_no_ghost(tmp_path):
    recording = rigtwin.run("tx40", "swing", settings={"timing": {"duration": 3.0}})
    with pytest.raises(rigtwin.RigtwinError, match="moves as measured and has no ghost"):
        recording.video(tmp_path / "a.mp4", ghost=1.0)


def test_a_run_is_the_same_with_and_without_a_file(tmp_path):
    rig = rigtwin.machine("suspension-rig")
    kept = rigtwin.run(rig, "road10", seed=3, settings=SHORT, path=tmp_path / "a.mcap")
    rigtwin.run(rig, "road10", seed=3, settings=SHORT, path=tmp_path / "b.mcap")
    memory = rigtwin.run(rig, "road10", seed=3, settings=SHORT)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
    for channel in kept.channels:
        np.testing.assert_array_equal(kept[channel], memory[channel])
    table = memory.to_pandas()
    assert list(table.columns) == list(memory.channels)
    assert len(table) == memory.ticks


class Spring:
    def tick(self, measured: Measurements, demand: Demand) -> Commands:
        force = 200.0 - 1000.0 * measured.suspension_lvdt
        return Commands(demand.ground, -0.004, force, force / 186.0)


@numba.njit
def compiled_spring(measured, demand):
    force = 200.0 - 1000.0 * measured.suspension_lvdt
    return (demand.ground, -0.004, force, force / 186.0)


def still(configuration: rigtwin.Configuration, seed: int) -> np.ndarray:
    return np.zeros((configuration.ticks, 3))


@pytest.mark.slow
def test_a_controller_of_ones_own_runs_the_rig_and_is_not_called_a_fault():
    rig = rigtwin.machine("suspension-rig")
    own = rigtwin.run(rig, "drop", controller=Spring(), settings=SHORT)
    again = rigtwin.run(rig, "drop", controller=compiled_spring, settings=SHORT)
    np.testing.assert_array_equal(own["/command.voltage"], again["/command.voltage"])
    travel = own["/sensor.suspension_lvdt"]
    np.testing.assert_allclose(own["/command.force"], 200.0 - 1000.0 * travel, atol=1e-9)
    comparison = rigtwin.compare(own)
    assert comparison.replays["carriage"].ratio < 1.2
    assert "controller" in comparison.left_out


@pytest.mark.parametrize("given", [(1.0, 2.0), None, (0.0, 0.0, float("nan"), 0.0)])
def test_a_controller_that_gives_no_commands_is_said_in_one_line(given):
    rig = rigtwin.machine("suspension-rig")
    with pytest.raises(rigtwin.RigtwinError, match="the controller gave .*expected finite ground"):
        rigtwin.run(rig, still, controller=lambda _measured, _demand: given, settings=SHORT)


def test_experiments_and_controllers_of_ones_own_run_a_described_machine(tmp_path):
    machine = folder_machine(tmp_path)

    def steps(configuration: rigtwin.Configuration, seed: int) -> dict[str, np.ndarray]:
        time = np.arange(configuration.ticks) * configuration.timing.period
        return {"goal": 0.02 * np.sign(np.sin(5.0 * time))}

    def spring(sensed: dict[str, float], demanded: dict[str, float]) -> float:
        return 500.0 * (demanded["goal"] - sensed["encoder"])

    recording = rigtwin.run(machine, steps, controller=spring, settings=SHORT)
    asked = 500.0 * (recording["/command.goal"] - recording["/sensor.position"])
    np.testing.assert_allclose(recording["/command.force"], asked, atol=1e-9)
    with pytest.raises(
        rigtwin.RigtwinError, match="no demand for /command.force; this test needs force"
    ):
        rigtwin.run(machine, lambda _configuration, _seed: {}, settings=SHORT)
    with pytest.raises(rigtwin.RigtwinError, match="unknown demand 'torque'"):
        rigtwin.run(machine, lambda c, _: {"torque": np.zeros(c.ticks), "force": np.zeros(c.ticks)})


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda rig: rigtwin.run(rig, "nope"), "unknown experiment 'nope'; there are drop"),
        (lambda rig: rigtwin.run(rig, "drop", seed=-1), "seed -1: expected a whole number from 0"),
        (lambda rig: rigtwin.run(rig, "drop", effects={"coulomb@wing": 1}), "unknown effect"),
        (
            lambda rig: rigtwin.run(rig, "drop", settings={"rail": {"coulomb": -1}}),
            "rail.coulomb = -1",
        ),
        (lambda rig: rigtwin.machine("lathe"), "unknown machine 'lathe'; there are"),
        (lambda rig: rigtwin.load("nowhere.mcap"), "cannot read nowhere.mcap"),
        (lambda rig: rigtwin.diagnose([]), "no recording to diagnose"),
        (
            lambda rig: rigtwin.diagnose(wrong(None)),
            "None: expected a recording, or the path of one",
        ),
        (lambda rig: rigtwin.compare(wrong(3)), "3: expected a recording, or the path of one"),
        (lambda rig: rigtwin.load(wrong(5)), "path 5: expected text or a path"),
        (lambda rig: rigtwin.run(wrong(5), "drop"), "5: expected a machine, its name"),
        (lambda rig: rigtwin.run(rig, wrong(5)), "experiment 5: expected a name, or a function"),
        (
            lambda rig: rigtwin.run(rig, "drop", seed=wrong("x")),
            "seed 'x': expected a whole number",
        ),
        (
            lambda rig: rigtwin.run(rig, "drop", effects=wrong(5)),
            "effects 5: expected {'coulomb@rail'",
        ),
        (
            lambda rig: rigtwin.run(rig, "drop", controller=wrong(5)),
            "controller 5: expected a function",
        ),
        (lambda rig: rigtwin.run(rig, "drop", effects_from=1.0), "requires `effects`"),
        (
            lambda rig: rigtwin.run(rig, "drop", effects=["coulomb@rail=60"], effects_from=1e9),
            "the test is over at",
        ),
        (lambda rig: rigtwin.stability("car", tau=wrong("x")), "tau 'x': expected a number"),
        (lambda rig: rigtwin.stability(wrong(5)), "vehicle 5: expected a name"),
        (lambda rig: rigtwin.rths(1, noise=wrong(-1)), "noise -1: expected a Noise"),
        (
            lambda rig: rigtwin.watch("no.mcap", patience=math.nan),
            "patience nan s: expected more than 0 s",
        ),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(call, said):
    with pytest.raises(rigtwin.RigtwinError) as error:
        call(rigtwin.machine("suspension-rig"))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_importing_costs_nothing_and_every_name_is_there():
    heavy = (
        "import sys, rigtwin; print([m for m in ('numpy', 'mujoco', 'scipy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", heavy], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    for name in rigtwin.__all__:
        assert (getattr(rigtwin, name).__doc__ or "").strip(), name
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        rigtwin.nonsense  # noqa: B018


@pytest.mark.slow
def test_the_notebook_runs(tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    notebook = nbformat.read(EXAMPLES / "quickstart.ipynb", as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    assert (tmp_path / "why.html").stat().st_size > 10_000
    assert (tmp_path / "drop.mp4").stat().st_size > 10_000
    shown = [
        o
        for cell in notebook.cells
        for o in cell.get("outputs", [])
        if "text/html" in o.get("data", {})
    ]
    assert any("viscous" in "".join(o["data"]["text/html"]) for o in shown)


FUNCTIONS = {
    "list": ("machines", "experiments"),
    "run": ("run", "run_on_twin", "dry_run", "run_on_card"),
    "session": ("run_session",),
    "card": ("check_card", "serve_card", "release_card"),
    "faults": ("faults",),
    "effects": ("effects",),
    "info": ("load", "Recording", "energy_error"),
    "plot": ("Recording.plot",),
    "video": ("Recording.video",),
    "watch": ("watch",),
    "export": ("Recording.export",),
    "import": ("import_data",),
    "describe": ("describe",),
    "calibrate": ("calibrate",),
    "compare": ("compare", "compare_recordings"),
    "diagnose": ("diagnose", "Diagnosis.report"),
    "fit": ("fit", "EffectFit.save_mjcf"),
    "look": ("look", "show_look"),
    "machines": ("machines",),
    "machine": ("machine",),
    "blindcheck": ("blindcheck", "blindcheck_machines"),
    "reproduce": ("reproduce",),
    "tune": ("tune",),
    "stability": ("stability",),
    "rths": ("rths",),
}
"""What does a command's work."""


def test_what_a_command_can_do_a_function_can():
    assert set(COMMANDS) == set(FUNCTIONS)
    for names in FUNCTIONS.values():
        for name in names:
            first, _, rest = name.partition(".")
            assert first in rigtwin.__all__
            found = getattr(rigtwin, first)
            assert callable(getattr(found, rest) if rest else found)
            assert found.__doc__


def test_stability_is_what_the_poles_say():
    plain = rigtwin.stability("quarter-car").models["rig"]
    assert plain.critical_lag is not None
    below, above = (
        rigtwin.stability("quarter-car", tau=share * plain.critical_lag).models["rig"]
        for share in (0.99, 1.01)
    )
    assert below.stable
    assert below.real < 0.0 < above.real
    stiffer = rigtwin.stability("quarter-car", changes={"suspension_damping": 500.0})
    assert stiffer.models["rig"].real != plain.real
    with pytest.raises(rigtwin.RigtwinError, match="unknown vehicle 'tank'"):
        rigtwin.stability("tank")
    with pytest.raises(rigtwin.RigtwinError, match="unknown parameter 'damping'"):
        rigtwin.stability(changes={"damping": 1.0})


def test_a_table_of_the_thesis_beside_ours(tmp_path):
    told = list[tuple[int, int]]()
    found = rigtwin.reproduce(
        "table-3.2",
        folder=tmp_path,
        workers=1,
        progress=lambda done, total: told.append((done, total)),
    )
    assert told[-1][0] == told[-1][1]
    assert "Table 3.2" in found.text()
    assert found.page(tmp_path / "t.html").read_text().startswith("<!")
    with pytest.raises(rigtwin.RigtwinError, match="nothing to reproduce"):
        rigtwin.reproduce("table-99", folder=tmp_path)


def test_mistakes_of_a_check_are_said_before_it_starts(tmp_path):
    for check in (rigtwin.blindcheck, rigtwin.blindcheck_machines):
        with pytest.raises(rigtwin.RigtwinError, match="expected 1 or more"):
            check(0, folder=tmp_path)
    with pytest.raises(rigtwin.RigtwinError, match="0 to 1000"):
        rigtwin.faults(per_kind=2000)
    with pytest.raises(rigtwin.RigtwinError, match="unknown study"):
        rigtwin.tune("nonsense", out=tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_setting_that_a_comparison_does_not_use_is_refused_at_its_default_too(tmp_path):
    """It would be the recording's own, whatever is said; a file may hold all that there are."""
    own = rigtwin.machine("suspension-rig").configuration.controller.preload
    settings = {"timing": {"duration": 4.0}, "controller": {"preload": 1.2 * own}}
    at = tmp_path / "r.mcap"
    recording = rigtwin.run("suspension-rig", "imposed", path=at, settings=settings)
    for several in (rigtwin.compare, rigtwin.diagnose):
        with pytest.raises(rigtwin.RigtwinError, match=r"controller.preload: .* states"):
            several(recording, settings={"controller": {"preload": own}})
    file = tmp_path / "all.toml"
    file.write_text(f"[controller]\npreload = {own}\n[rail]\ncoulomb = 50.0\n")
    rigtwin.compare(recording, settings=file)
    kept = rigtwin.diagnose_each([recording.path], tmp_path / "each", settings=file, workers=1)
    assert not kept[0].error
