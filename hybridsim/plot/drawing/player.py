"""This module writes an animation as one HTML page with a player, which needs no other file and no network."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Sequence
from html import escape
from io import BytesIO

import numpy as np
from PIL import Image

from hybridsim.plot.drawing.theme import DARK, LIGHT

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>TITLE</title>
<style>
body { margin: 0; background: PAPER; color: INK; font: 15px/1.4 system-ui, sans-serif; }
main { max-width: 960px; margin: 0 auto; padding: 12px; }
canvas { width: 100%; display: block; }
.controls { display: flex; gap: 12px; align-items: center; flex-wrap: wrap; padding: 8px 0; }
input[type=range] { flex: 1 1 160px; }
button, select { font: inherit; color: inherit; background: transparent; padding: 4px 12px; }
button, select { border: 1px solid INK; border-radius: 4px; }
option { color: #222222; }
</style>
</head>
<body>
<main>
<canvas id="picture" width="WIDTH" height="HEIGHT" role="img" aria-label="TITLE"></canvas>
<div class="controls">
<button id="play" type="button">Pause</button>
<input id="place" type="range" min="0" max="LAST" value="0" aria-label="Frame">
<label>Speed <select id="speed">
<option value="0.25">1/4</option><option value="0.5">1/2</option>
<option value="1" selected>1</option><option value="2">2</option>
</select></label>
</div>
</main>
<script>
const still = "STILL", parts = PARTS, fps = FPS;
const canvas = document.getElementById("picture"), context = canvas.getContext("2d");
const play = document.getElementById("play"), place = document.getElementById("place");
const speed = document.getElementById("speed");
let plays = !matchMedia("(prefers-reduced-motion: reduce)").matches, at = 0, before = 0;
const load = data => new Promise(done => {
  const image = new Image();
  image.onload = () => done(image);
  image.src = "data:image/png;base64," + data;
});
Promise.all([load(still), ...parts.map(part => load(part[2]))]).then(([first, ...images]) => {
  const show = () => {
    const k = Math.floor(at);
    context.drawImage(first, 0, 0);
    context.drawImage(images[k], parts[k][0], parts[k][1]);
    place.value = k;
    play.textContent = plays ? "Pause" : "Play";
  };
  const step = now => {
    if (plays) at = (at + Math.min(now - before, 200) / 1000 * fps * speed.value) % parts.length;
    before = now;
    show();
    requestAnimationFrame(step);
  };
  play.onclick = () => { plays = !plays; };
  place.oninput = () => { at = Number(place.value); plays = false; };
  document.addEventListener("keydown", event => {
    const move = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.target !== document.body) return;
    if (event.key === " ") { plays = !plays; event.preventDefault(); }
    if (move) { at = (Math.floor(at) + move + parts.length) % parts.length; plays = false; }
  });
  requestAnimationFrame(step);
});
</script>
</body>
</html>
"""


def page(title: str, pictures: Sequence[Image.Image], fps: float, is_dark: bool) -> str:
    """Return a page that plays pictures. After the first picture, only the changed part of each picture is stored."""
    first, theme = pictures[0], DARK if is_dark else LIGHT
    still, clear = np.asarray(first), len(first.getpalette() or []) // 3
    parts: list[list[int | str]] = []
    for picture in pictures:
        changed = np.asarray(picture) != still
        rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
        top, bottom = (rows[0], rows[-1] + 1) if len(rows) else (0, 1)
        left, right = (columns[0], columns[-1] + 1) if len(columns) else (0, 1)
        part = Image.fromarray(np.where(changed, np.asarray(picture), clear)[top:bottom, left:right], "P")
        part.putpalette([*(first.getpalette() or []), 0, 0, 0])
        parts.append([int(left), int(top), _as_text(part, clear)])
    fields = {
        "TITLE": escape(title), "PAPER": theme.paper, "INK": theme.ink, "WIDTH": str(first.width),
        "HEIGHT": str(first.height), "LAST": str(len(pictures) - 1), "FPS": f"{fps:g}", "STILL": _as_text(first, None),
        "PARTS": json.dumps(parts),
    }  # fmt: skip
    text = _PAGE
    for name, value in fields.items():
        text = text.replace(name, value)
    return text


def _as_text(picture: Image.Image, clear: int | None) -> str:
    """Return a picture as a base64-encoded PNG, in which one colour may be transparent."""
    data = BytesIO()
    picture.save(data, "PNG", compress_level=9, **({} if clear is None else {"transparency": clear}))
    return b64encode(data.getvalue()).decode("ascii")
