"""The pages are true of the program: links, commands, TOML, and the blocks that can run.

Blocks marked `sh` and `python` are run, unless `NOT_RUN` says why they cannot be. Indented commands
stand for files of the reader, so they are only parsed by the program's own parser.
"""

from __future__ import annotations

import re
import shlex
import shutil
import tomllib
from collections.abc import Callable, Collection, Iterable
from pathlib import Path

import pytest

import rigtwin
from rigtwin import components
from rigtwin.cli import COMMANDS, _parser, main
from tests.helpers.pages import (
    DOCS,
    PAGES,
    ROOT,
    Block,
    anchors,
    blocks,
    indented_lines,
    links,
    name_of,
    without_blocks,
)

MACHINES = ROOT / "docs" / "machines.md"
WORDS = 15_700
"""Most words of README and docs together, as `wc -w` counts them."""
README_LINES = 120
NOT_RUN = {
    "cubic_stiffness: Annotated": "a field of a class in rigtwin/components/guide.py",
    "stretch = position - rest": "lines of a function in rigtwin/components/guide_force.py",
    '(\n    Kind(\n        "cubic_stiffness"': "an entry of KINDS in guide_effects.py",
    "from rigtwin.description import physics": "tests/helpers/shaft.py is the whole file, which "
    "tests/test_physics.py runs",
    "from controllers.substructure import Substructured": "needs a client of OpenSees; "
    "tests/test_substructure.py runs the same with a client of its own",
}
"""Beginning of a Python block that cannot run by itself, and why."""
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\w])")
CLOSE = 0.02
"""Relative difference of printed numbers between computers."""


def hidden_friction(folder: Path) -> None:
    """Write the log and the model of a planar arm with friction in its elbow."""
    recording = str(folder / "hidden.mcap")
    effect = ["--effect", "coulomb@elbow=0.6"]
    assert main(["run", "swing", "--machine", "planar-arm", *effect, "--out", recording]) == 0
    assert main(["export", recording, "-o", str(folder / "log.csv")]) == 0
    for name in ("arm.xml", "my_arm.xml"):
        shutil.copy(ROOT / "models" / "xml" / "planar_arm.xml", folder / name)


def imposed_test(folder: Path) -> None:
    """Write a recording of the suspension rig's twin."""
    duration = ["--set", "timing.duration=6"]
    assert main(["run", "imposed", *duration, "--out", str(folder / "rig.mcap")]) == 0


def nothing(folder: Path) -> None:
    """Write no file."""


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_and_anchors_resolve(page: Path) -> None:
    for target in links(page):
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        assert path.exists(), target
        assert not anchor or anchor in anchors(path), target


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_toml_is_well_formed(page: Path) -> None:
    for block in blocks(page):
        if block.language == "toml":
            tomllib.loads(block.text)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_are_those_of_the_program(page: Path, capsys: pytest.CaptureFixture) -> None:
    scripts = [
        line for block in blocks(page) if block.language == "sh" for line in block.text.splitlines()
    ]
    for line in [*indented_lines(page), *scripts]:
        if line.startswith("rigtwin "):
            try:
                _parser().parse_args(shlex.split(line, comments=True)[1:])
            except SystemExit:
                pytest.fail(f"{line}: {capsys.readouterr().err}")


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_in_sentences_have_these_options(
    page: Path, capsys: pytest.CaptureFixture
) -> None:
    helps: dict[str, str] = {}
    for text in re.findall(r"`rigtwin ([a-z][^`]*)`", without_blocks(page)):
        command, *rest = text.split()
        assert command in COMMANDS, text
        if command not in helps:
            # `card` has commands of its own, each with its options.
            for deed in ("check", "serve", "release") if command == "card" else ("",):
                with pytest.raises(SystemExit):
                    _parser().parse_args([command, *filter(None, [deed]), "--help"])
            helps[command] = capsys.readouterr().out
        for option in rest:
            if option.startswith("-"):
                assert re.search(rf"(?<![\w-]){option}(?![\w-])", helps[command]), text


DRIVE = """<mujoco model="drive"><worldbody><body name="carriage">
<joint name="carriage" type="slide" axis="1 0 0"/>
<geom type="box" size="0.1 0.1 0.1" mass="10"/></body></worldbody>
<actuator><motor name="motor" joint="carriage"/></actuator>
<sensor><jointpos name="position" joint="carriage"/></sensor></mujoco>"""


def test_the_description_that_opens_the_page_of_machines_is_one(tmp_path: Path) -> None:
    first = next(block for block in blocks(MACHINES) if block.language == "toml")
    (tmp_path / "drive.xml").write_text(DRIVE, encoding="utf-8")
    (tmp_path / "drive.toml").write_text(first.text, encoding="utf-8")
    machine = rigtwin.machine(tmp_path / "drive.toml")
    assert {"guide", "encoder", "motor", "load"} <= set(machine.components)


def test_parameters_of_machines_are_those_of_the_components() -> None:
    text = MACHINES.read_text(encoding="utf-8")
    start = text.index("Parameters by element")
    entries = re.split(r"^- ", text[start : text.index("Other keys:", start)], flags=re.M)[1:]
    fields = [getattr(one, "_fields", ()) for one in vars(components).values()]
    known = {name for names in fields if isinstance(names, tuple) for name in names}
    known |= {"joint", "tendon", "body", "actuator", "sensor", "channel", "unit"}
    for entry in entries:
        for name in re.findall(r"`([a-z_0-9]+)`", entry):
            assert name in known, name


def test_the_pages_stay_short() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(readme.splitlines()) <= README_LINES
    pages = [readme, *(page.read_text(encoding="utf-8") for page in DOCS)]
    assert sum(len(text.split()) for text in pages) <= WORDS


def test_blocks_that_are_not_run_are_there() -> None:
    python = [block.text for page in PAGES for block in blocks(page) if block.language == "python"]
    for beginning in NOT_RUN:
        assert any(text.startswith(beginning) for text in python), beginning


def test_every_block_of_a_shell_or_of_python_has_a_test() -> None:
    for language, tested in (("sh", SCRIPTS), ("python", PROGRAMS)):
        for page in PAGES:
            found = [block for block in blocks(page) if block.language == language]
            can_run = [block for block in found if not _is_excused(block)]
            assert not can_run or name_of(page) in tested, (name_of(page), language)


def _is_excused(block: Block) -> bool:
    return any(block.text.startswith(beginning) for beginning in NOT_RUN)


def quick_and_slow(pages: Iterable[str], slow: Collection[str]) -> list[object]:
    """Return pages as parameters of a test, the slow ones marked."""
    return [pytest.param(name, marks=pytest.mark.slow) if name in slow else name for name in pages]


SLOW_PROGRAMS = {"README.md", "CONTRIBUTING.md", "docs/look.md"}
SLOW_SCRIPTS = {"docs/robot_arm.md", "docs/tutorial.md", "docs/your_robot.md"}
"""Pages whose Python blocks, or whose commands, take longer than some seconds."""
PROGRAMS: dict[str, Callable[[Path], None]] = {
    "README.md": nothing,
    "CONTRIBUTING.md": nothing,
    "docs/importing.md": nothing,
    "docs/look.md": imposed_test,
    "docs/similitude.md": nothing,
    "docs/your_robot.md": hidden_friction,
}
"""Page → what writes the files that its Python blocks read."""


@pytest.mark.parametrize("name", quick_and_slow(PROGRAMS, SLOW_PROGRAMS))
def test_python_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    PROGRAMS[name](tmp_path)
    monkeypatch.chdir(tmp_path)
    scope: dict[str, object] = {"__name__": "page"}
    exec("import rigtwin", scope)
    for block in blocks(ROOT / name):
        if block.language == "python" and not _is_excused(block):
            exec(compile(block.text, name, "exec"), scope)


SCRIPTS: dict[str, Callable[[Path], None]] = {
    "README.md": hidden_friction,
    "docs/robot_arm.md": nothing,
    "docs/tutorial.md": nothing,
    "docs/twin.md": nothing,
    "docs/your_robot.md": nothing,
}
"""Page → what writes the files that its commands read."""


@pytest.mark.parametrize("name", quick_and_slow(SCRIPTS, SLOW_SCRIPTS))
def test_commands_print_what_the_page_shows(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    for folder in ("examples", "machines", "models"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    SCRIPTS[name](tmp_path)
    monkeypatch.chdir(tmp_path)
    printed = ""
    for block in blocks(ROOT / name):
        if block.language in ("toml", "xml") and block.file is not None:
            Path(block.file).write_text(block.text, encoding="utf-8")
        elif block.language == "sh":
            capsys.readouterr()
            for line in block.text.splitlines():
                run_line(line, monkeypatch)
            printed = "".join(capsys.readouterr())
        elif block.language == "" and printed:
            for passage in re.split(r"^ *\.\.\.$", block.text, flags=re.MULTILINE):
                assert is_printed(passage, printed), (passage, printed)


def run_line(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run one line of a script: a command of the program, or of the few of a shell."""
    words = shlex.split(line, comments=True)
    match words:
        case ["rigtwin", *arguments]:
            assert main(arguments) == 0, line
        case ["source", _]:
            pass
        case ["mkdir", "-p", folder]:
            Path(folder).mkdir(parents=True)
        case ["cd", folder]:
            monkeypatch.chdir(folder)
        case ["cp", source, target]:
            shutil.copy(source, target)
        case _:
            pytest.fail(f"not a command of these pages: {line}")


def is_printed(passage: str, printed: str) -> bool:
    """Return whether a passage was printed, but for its spaces and small differences of numbers."""
    passage, printed = " ".join(passage.split()), " ".join(printed.split())
    expected = [float(number) for number in NUMBER.findall(passage)]
    pattern = NUMBER.pattern.join(f"{re.escape(text)}" for text in NUMBER.split(passage))
    for match in re.finditer(pattern, printed):
        numbers = [float(number) for number in NUMBER.findall(match[0])]
        if numbers == pytest.approx(expected, rel=CLOSE):
            return True
    return False


def test_passages_are_compared_but_for_small_differences_of_numbers() -> None:
    assert is_printed("a friction of  0.6001 Nm", "it has a friction of 0.6003 Nm.")
    assert not is_printed("a friction of 0.6001 Nm", "it has a friction of 0.7 Nm.")
    assert not is_printed("a friction of 0.6001 Nm", "it has a stiffness of 0.6001 Nm.")
