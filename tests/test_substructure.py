"""Structures whose model is elsewhere: in Python, compiled, or behind a socket."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numba
import numpy as np
import pytest

import rigtwin
from controllers.settings import Settings
from controllers.structure import point_mass
from controllers.substructure import Substructured
from experiments import find
from rigtwin.errors import RigtwinError
from rigtwin.hardware.generic_client import GenericClientServer
from rigtwin.simulation.slow_model import LateModel, SlowModel

PERIOD, STEP, SECONDS = 1e-3, 10, 1.2
SHORT = {"timing": {"duration": SECONDS}}
NOMINAL = find("drop").configuration.controller


class PointMass:
    """The rig's own structure, in Python."""

    def __init__(self, settings: Settings) -> None:
        self.settings, self.place, self.speed = settings, settings.start, 0.0

    def advance(self, force: float, period: float) -> float:
        self.place, self.speed = point_mass(self.settings, self.place, self.speed, force, period)
        return self.place


def drop(model: Any) -> rigtwin.Recording:
    controller = Substructured(NOMINAL, PERIOD, model)
    return rigtwin.run("suspension-rig", "drop", seed=1, settings=SHORT, controller=controller)


@pytest.fixture(scope="module")
def own() -> rigtwin.Recording:
    """The rig's own structure model."""
    return rigtwin.run("suspension-rig", "drop", seed=1, settings=SHORT)


def test_an_object_in_python_is_the_structure(own: rigtwin.Recording) -> None:
    made = drop(PointMass(NOMINAL))
    assert made["/command.structure"] == pytest.approx(own["/command.structure"], abs=1e-12)


def test_a_compiled_function_is_the_structure(own: rigtwin.Recording) -> None:
    state = np.array([NOMINAL.start, 0.0])
    mass, gravity = NOMINAL.sprung_mass, NOMINAL.gravity

    @numba.njit
    def step(state: np.ndarray, force: float, period: float) -> float:
        state[1] += (force / mass - gravity) * period
        state[0] += state[1] * period
        return state[0]

    made = drop(lambda force, period: step(state, force, period))
    assert made["/command.structure"] == pytest.approx(own["/command.structure"], abs=1e-9)


class Client(threading.Thread):
    """As OpenSees' element: a point mass, integrated explicitly in steps of 10 ms."""

    def __init__(
        self, port: int, steps: int, pause: Callable[[int], float] = lambda _: 0.0
    ) -> None:
        super().__init__(daemon=True)
        self.port, self.steps, self.pause = port, steps, pause
        self.places: list[float] = []
        self.start()

    def run(self) -> None:
        mass, gravity, dt = NOMINAL.sprung_mass, NOMINAL.gravity, STEP * PERIOD
        with socket.create_connection(("127.0.0.1", self.port)) as link:
            link.sendall(np.array([1, 1, 1, 0, 1, 0, 0, 0, 1, 0, 256], np.int32).tobytes())
            place, speed = 0.0, 0.0
            message = np.zeros(256)
            try:
                for number in range(self.steps):
                    time.sleep(self.pause(number))
                    message[:5] = 3.0, place, speed, 0.0, number * dt
                    link.sendall(message.tobytes())
                    message[0] = 10.0
                    link.sendall(message.tobytes())
                    reply = b""
                    while len(reply) < 2048:
                        part = link.recv(2048 - len(reply))
                        if not part:
                            return
                        reply += part
                    self.places.append(place)
                    resisting = np.frombuffer(reply)[0]
                    speed += (-resisting / mass - gravity) * dt
                    place += speed * dt
                message[0] = 99.0
                link.sendall(message.tobytes())
            except OSError:
                return


@contextmanager
def served(**options: object) -> Iterator[tuple[SlowModel, GenericClientServer]]:
    model = SlowModel(NOMINAL.start, STEP, **options)  # type: ignore[arg-type]
    server = GenericClientServer(model, NOMINAL.start, port=0)
    try:
        yield model, server
    finally:
        server.close()


@pytest.mark.slow
def test_a_body_in_another_program_drops_as_it_should(own: rigtwin.Recording) -> None:
    """In lock step, as on a twin: nothing is late."""
    with served(waits=True, latest=5.0) as (model, server):
        client = Client(server.port, steps=round(SECONDS / PERIOD / STEP) + 5)
        server.wait(5.0)
        made = drop(model)
    assert made.end == "completed"
    assert model.late == 0
    assert len(client.places) > 115
    # The plate is at each target when its force is taken.
    there = made["/command.structure"][STEP - 1 :: STEP][: len(client.places)] - NOMINAL.start
    assert there == pytest.approx(client.places[: len(there)], abs=1e-9)
    # It falls and comes up as with the rig's own model, a step of 10 ms later.
    ours, theirs = own["/command.structure"], made["/command.structure"]
    assert np.std(theirs - ours) < 0.4 * np.std(ours)
    # No jumps between targets.
    assert np.max(np.abs(np.diff(theirs))) < 3.0 * np.max(np.abs(np.diff(ours)))


def test_what_is_late_is_counted_and_held() -> None:
    model, places = SlowModel(0.0, STEP, latest=0.1), []

    def ticks(count: int) -> None:
        places.extend(model.advance(0.0, PERIOD) for _ in range(count))

    for target in (0.0, 1e-3, 2e-3):
        assert model.give(target)
        ticks(STEP)
    assert places[-1] == pytest.approx(2e-3)
    ticks(STEP)  # Predicted: it goes on as it went.
    assert places[-1] == pytest.approx(3e-3)
    ticks(30)
    assert model.late == 30
    assert places[-1] == places[-30]
    model.give(3e-3)
    ticks(STEP // 4)
    assert places[-1] == pytest.approx(3e-3)
    assert np.max(np.abs(np.diff(places))) < 4e-4
    ticks(STEP)
    with pytest.raises(LateModel, match=r"no target for 0\.1 s; the plate is held"):
        ticks(101)


def test_a_prediction_is_corrected_without_a_jump() -> None:
    model = SlowModel(0.0, STEP)
    for target in (0.0, 1e-3, 2e-3):
        model.give(target)
        for _ in range(STEP):
            model.advance(0.0, PERIOD)
    places = [model.advance(0.0, PERIOD) for _ in range(6)]
    model.give(2.2e-3)
    places += [model.advance(0.0, PERIOD) for _ in range(4)]
    assert places[5] == pytest.approx(2.6e-3)
    assert places[-1] == pytest.approx(2.2e-3)
    assert np.max(np.abs(np.diff(places))) < 2e-4
    assert model.late == 0


def test_a_model_that_stops_ends_the_test_and_the_recording_can_be_read(tmp_path) -> None:
    out = tmp_path / "late.mcap"
    with served(latest=0.2) as (model, server):
        # Three targets, each less than 0.2 s late, come within the test however slow this computer
        # is; the fourth never comes.
        Client(server.port, steps=1000, pause=lambda number: 30.0 if number == 3 else 0.0)
        server.wait(5.0)
        controller = Substructured(NOMINAL, PERIOD, model)
        with pytest.raises(LateModel, match="the plate is held"):
            rigtwin.run(
                "suspension-rig", "drop", seed=1, settings=SHORT, controller=controller, path=out
            )
    kept = rigtwin.load(out)
    assert kept.ticks >= 200
    assert "LateModel" in kept.end


@pytest.mark.parametrize(
    ("sizes", "message", "said"),
    [
        ([2, 2, 2, 0, 1, 0, 0, 0, 2, 0, 256], None, "2 displacements in messages of 256 numbers"),
        ([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1], None, "in messages of 1 numbers"),
        ([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2], [3.0, np.nan], "is not a number"),
        ([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2], [42.0, 0.0], "a client asked for 42"),
        ([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2], [np.inf, 0.0], "a client asked for 0"),
        ([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2], None, "closed the connection without an end"),
    ],
)
def test_what_a_client_must_not_do_is_said(sizes: list[int], message: object, said: str) -> None:
    with served() as (_, server):
        with socket.create_connection(("127.0.0.1", server.port)) as link:
            link.sendall(np.array(sizes, np.int32).tobytes())
            if message is not None:
                link.sendall(np.array(message).tobytes())
                time.sleep(0.2)
        with pytest.raises(RigtwinError, match="no client at port"):
            server.wait(0.5)
        assert said in server.fault


def test_a_displacement_that_is_given_again_before_its_force_is_no_new_target() -> None:
    """The requests of two steps of OpenSees 3.7.1: it gives each displacement before and after the
    commit. Twenty ticks then pass between the forces of two steps, instead of ten."""
    with (
        served(waits=True, latest=5.0) as (model, server),
        socket.create_connection(("127.0.0.1", server.port)) as link,
    ):
        link.sendall(np.array([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2], np.int32).tobytes())
        forces = []
        requests = [(3, 0.0), (3, 0.0), (10, 0.0)]
        for place in (1e-3, 1e-3, 2e-3):
            requests += [(3, place), (5, place), (3, place), (10, place)]

        def ask() -> None:
            for request in requests:
                link.sendall(np.array(request).tobytes())
                if request[0] == 10:
                    forces.append(np.frombuffer(link.recv(16))[0])

        client = threading.Thread(target=ask)
        client.start()
        # The force of a tick is its number.
        for tick in range(4 * STEP):
            model.advance(float(tick), PERIOD)
        client.join(5.0)
        assert not client.is_alive()
    assert np.diff(np.abs(forces)).tolist() == pytest.approx([STEP] * 3, abs=1.0)


STRUCTURE = """
import json, sys
import openseespylinux.opensees as ops
ops.model("basic", "-ndm", 2, "-ndf", 2)
ops.node(1, 0.0, 0.0)
ops.fix(1, 1, 0)
ops.node(2, 0.0, 0.0)
ops.fix(2, 1, 1)
ops.mass(1, 100.0, 100.0)
ops.uniaxialMaterial("Elastic", 1, 4000.0)
ops.element("zeroLength", 1, 2, 1, "-mat", 1, "-dir", 2)
ops.element("genericClient", 2, "-node", 1, "-dof", 2, "-server", int(sys.argv[1]), "127.0.0.1")
ops.timeSeries("Constant", 1)
ops.pattern("Plain", 1, 1)
ops.load(1, 0.0, -50.0)
ops.constraints("Plain")
ops.numberer("Plain")
ops.system("FullGeneral")
ops.algorithm("Linear")
ops.integrator("CentralDifference")
ops.analysis("Transient")
places = []
for _ in range(100):
    assert ops.analyze(1, 0.01) == 0
    places.append(ops.nodeDisp(1, 2))
print(json.dumps(places))
"""
"""A mass of 100 kg on a spring of 4000 N/m under 50 N, and the rig beside it."""


@pytest.mark.slow
@pytest.mark.parametrize("gone", ["nobody", "client", "server"])
def test_opensees_itself_moves_a_spring_in_the_rig_s_place(tmp_path, gone) -> None:
    probe = [sys.executable, "-c", "import openseespylinux.opensees"]
    if subprocess.run(probe, capture_output=True).returncode:
        pytest.skip("needs openseespy, and its libraries libblas3 and liblapack3")
    script = tmp_path / "structure.py"
    script.write_text(STRUCTURE)
    stiffness, ticks, place = 6000.0, 0, NOMINAL.start
    with served(waits=True, latest=2.0) as (model, server):
        command = [sys.executable, str(script), str(server.port)]
        client = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
        )
        try:
            server.wait(30.0)
            while client.poll() is None and ticks < 2000 and model.late == 0:
                if ticks == 300 and gone == "client":
                    client.kill()
                if ticks == 300 and gone == "server":
                    server.close()
                    break
                place = model.advance(-stiffness * (place - NOMINAL.start), PERIOD)
                ticks += 1
        except LateModel:
            assert gone == "client"
        finally:
            if gone != "nobody":
                client.kill()
            told, _ = client.communicate(timeout=30.0)
    if gone != "nobody":
        assert 300 <= ticks < 400
        return
    # A step of 10 ms takes ten ticks.
    assert ticks == pytest.approx(100 * STEP, abs=3 * STEP)
    moved = np.array(json.loads(told.splitlines()[-1]))
    time_of = 0.01 * np.arange(1, 101)
    exact = -50.0 / (4000.0 + stiffness) * (1.0 - np.cos(10.0 * time_of))
    # Central differences with steps of 10 ms at 10 rad/s, begun without the first acceleration.
    assert np.max(np.abs(moved - exact)) < 0.05 * np.max(np.abs(exact))


def test_a_port_that_is_taken_is_said() -> None:
    with served() as (model, server), pytest.raises(RigtwinError, match="cannot listen at 127"):
        GenericClientServer(model, 0.0, port=server.port)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"ticks": 1.5}, "a target every 1.5 ticks"),
        ({"ticks": float("nan")}, "a target every nan ticks"),
        ({"latest": float("nan")}, "latest = nan: expected a finite number from 0"),
        ({"latest": -1.0}, "latest = -1.0: expected a finite number from 0"),
        ({"start": "x"}, "start = 'x': expected a finite number"),
    ],
)
def test_a_slow_model_of_odd_numbers_is_refused(given, said):
    with pytest.raises(RigtwinError, match=said):
        SlowModel(**{"start": 0.0, "ticks": 10, **given})
