"""Plots and films: made offscreen from any recording, and showing what they should."""

from __future__ import annotations

import dataclasses

import av
import numpy as np
import pytest
from matplotlib.image import imread

from rigtwin.errors import RigtwinError
from rigtwin.render.plot import draw
from rigtwin.render.video import FRAMES_PER_SECOND, SCENE_HEIGHT, film
from tests.helpers.twin import RIG


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_plot(example, tmp_path, ending):
    out = tmp_path / f"p.{ending}"
    draw(example, out, 1.0, 3.0)
    assert out.stat().st_size > 10_000


def test_plot_leaves_out_what_is_not_there(example, tmp_path):
    only = dataclasses.replace(
        example, columns={"/sensor": {"load_cell": example.column("/sensor", "load_cell")}}
    )
    draw(only, tmp_path / "p.png")
    assert imread(tmp_path / "p.png").shape[0] < 400


def test_plot_refuses_what_it_cannot_do(example, tmp_path):
    with pytest.raises(RigtwinError, match="must end in"):
        draw(example, tmp_path / "p.txt")
    with pytest.raises(RigtwinError, match="nothing between 30 and 40 s"):
        draw(example, tmp_path / "p.png", 30.0, 40.0)
    with pytest.raises(RigtwinError, match="cannot write"):
        draw(example, tmp_path / "absent" / "p.png")


def frames(path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def test_film_shows_the_rig_moving(example, tmp_path):
    out = tmp_path / "f.mp4"
    counted: list[tuple[int, int]] = []
    film(
        example,
        out,
        RIG,
        until=0.9,
        start=0.5,
        magnify=3.0,
        progress=lambda done, total: counted.append((done, total)),
    )
    pictures = frames(out)
    count = round(0.4 * FRAMES_PER_SECOND)
    assert len(pictures) == count
    assert counted[-1] == (count, count)
    scene = [picture[:SCENE_HEIGHT].astype(float) for picture in pictures]
    assert np.std(scene[0]) > 20, "the scene is not blank"
    assert np.mean(np.abs(scene[-1] - scene[0])) > 0.3, "nothing moves"
    assert list(tmp_path.iterdir()) == [out]


def test_film_refuses_what_it_cannot_do(example, tmp_path):
    with pytest.raises(RigtwinError, match=r"must end in \.mp4"):
        film(example, tmp_path / "f.gif", RIG)
    with pytest.raises(RigtwinError, match="unknown camera 'top'; there are overview, side, wheel"):
        film(example, tmp_path / "f.mp4", RIG, camera="top")
    with pytest.raises(RigtwinError, match="--magnify"):
        film(example, tmp_path / "f.mp4", RIG, magnify=0.0)
    with pytest.raises(RigtwinError, match="suspension_lvdt is missing"):
        film(
            dataclasses.replace(example, columns={"/sensor": {"structure_lvdt": example.time}}),
            tmp_path / "f.mp4",
            RIG,
        )
    assert list(tmp_path.iterdir()) == []
