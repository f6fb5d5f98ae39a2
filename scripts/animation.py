"""Make docs/images/ghost.gif: a machine and its twin's ghost, before and after a correction.

The cart-pole gets friction that its twin does not know. The first half shows the nominal twin as a
ghost, the second half the twin with the values that `rigtwin.fit` finds.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import av
from PIL import Image, ImageDraw, ImageFont

import rigtwin

HIDDEN = {"viscous@pivot": 0.03, "coulomb@rail": 1.5}
"""Effects of the machine that the nominal twin lacks."""
SECONDS, RATE, WIDTH = 5.0, 10, 480
"""Length of each half, s; frames per second; width in pixels."""
SCENE = 0.6
"""Share of a film's height that shows the scene; curves are below."""


def main(out: Path) -> None:
    """Record, fit, film twice, and write the animation."""
    recording = rigtwin.run("cart-pole", "pushes", seed=1, effects=HIDDEN)
    fitted = rigtwin.fit(recording, list(HIDDEN))
    corrected: dict[str, dict[str, float]] = {}
    for parameter in fitted.parameters:
        kind, _, component = parameter.name.partition("@")
        corrected.setdefault(component, {})[kind] = parameter.value
    values = ", ".join(f"{p.name} {p.value:.3g} {p.unit}" for p in fitted.parameters)
    frames: list[Image.Image] = []
    with TemporaryDirectory() as folder:
        for name, settings, text in (
            ("before", {}, "twin (ghost) as described: they disagree"),
            ("after", corrected, f"found: {values}"),
        ):
            film = Path(folder) / f"{name}.mp4"
            recording.video(film, ghost=1.0, settings=settings, until=SECONDS)
            frames += [_caption(frame, text) for frame in _read(film)]
    colours = frames[len(frames) // 2].quantize(64)
    images = [frame.quantize(64, palette=colours, dither=Image.Dither.NONE) for frame in frames]
    images[0].save(
        out, save_all=True, append_images=images[1:], duration=1000 // RATE, loop=0, optimize=True
    )


def _read(film: Path) -> Iterator[Image.Image]:
    """Yield the scenes of a film at the animation's rate and size."""
    with av.open(str(film)) as container:
        stream = container.streams.video[0]
        every = round(float(stream.average_rate or 30) / RATE)
        for number, frame in enumerate(container.decode(stream)):
            if number % every == 0:
                image = frame.to_image()
                image = image.crop((0, 0, image.width, round(SCENE * image.height)))
                yield image.resize((WIDTH, round(WIDTH * image.height / image.width)))


def _caption(image: Image.Image, text: str) -> Image.Image:
    draw = ImageDraw.Draw(image)
    draw.rectangle((0, image.height - 22, image.width, image.height), fill=(20, 24, 32))
    draw.text((8, image.height - 18), text, fill=(240, 240, 240), font=ImageFont.load_default(13))
    return image


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images/ghost.gif"))
