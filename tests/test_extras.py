"""Packages that only some commands need: without one, a line says how to install it."""

from __future__ import annotations

import subprocess
import sys

import pytest

USES = {
    "av": (
        "recording = rigtwin.load('examples/nominal-imposed.mcap'); recording.video('film.mp4')",
        "videos need av: pip install 'rigtwin[video]'",
    ),
    "dm_env": (
        "from experiments.environment import environment",
        "environments need dm-env: pip install 'rigtwin[learning]'",
    ),
    "viser": (
        "rigtwin.show_look(rigtwin.look(rigtwin.run('planar-arm', 'swing', seed=1)))",
        "the page needs viser; pip install 'rigtwin[look]'",
    ),
}
"""Package → a statement that needs it, and what is said without it."""


@pytest.mark.parametrize(
    "package",
    [pytest.param(name, marks=pytest.mark.slow if name == "viser" else ()) for name in USES],
)
def test_a_missing_package_is_named_in_one_line(package):
    statement, line = USES[package]
    program = f"import sys; sys.modules[{package!r}] = None\nimport rigtwin\n{statement}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.strip().endswith(f"RigtwinError: {line}")


@pytest.mark.slow
def test_a_diagnosis_needs_none_of_them():
    program = (
        "import sys\n"
        "for name in ('av', 'dm_env', 'dm_control', 'viser', 'pandas', 'pyarrow', 'h5py'):\n"
        "    sys.modules[name] = None\n"
        "import rigtwin\n"
        "arm = rigtwin.machine('planar-arm')\n"
        "recording = rigtwin.run(arm, 'swing', seed=1, effects={'coulomb@elbow': 0.6})\n"
        "print(rigtwin.fit(recording, ['coulomb@elbow'])['coulomb@elbow'].value)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) == pytest.approx(0.6, rel=0.01)
