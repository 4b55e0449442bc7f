"""Animations, looked at with tools of others: Pillow, ffprobe, a real browser."""

import base64
import dataclasses
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import synthetic_run
from PIL import Image
from scipy.stats import chi2

from gbt_ocp.experiments.result import Result
from gbt_ocp.reporting import animation
from gbt_ocp.reporting.animation import write_animation
from gbt_ocp.reporting.scene import Scene, outline
from gbt_ocp.simulation.calibration import region_radius


def save(folder, dimension=2, steps=30, change=None, **kind):
    history = synthetic_run.history(dimension, steps=steps, **kind)
    spread = np.eye(dimension) * np.array([0.04, 0.01, 0.0025])[:dimension]
    history = dataclasses.replace(history, forecast_cov=np.broadcast_to(spread, history.forecast_cov.shape))
    if change is not None:
        history = dataclasses.replace(history, **change(history))
    result = Result(synthetic_run.configuration(dimension), history, synthetic_run.summary(history))
    return result.save(folder, figures=False), history


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.long
def test_a_gif_has_a_frame_a_step_in_the_colours_of_what_it_shows(tmp_path, dimension):
    folder, history = save(tmp_path / "run", dimension)
    path = write_animation(folder, tmp_path / "run.gif")
    with Image.open(path) as film:
        assert film.n_frames == len(history.t)
        assert film.info["duration"] == 100  # ms, the sampling period: real time
        film.seek(20)
        late = np.asarray(film.convert("RGB")).reshape(-1, 3).astype(int)
        film.seek(2)
        early = np.asarray(film.convert("RGB")).reshape(-1, 3).astype(int)
    for colour in ((0, 114, 178), (213, 94, 0), (0, 158, 115), (0, 0, 0)):  # vehicle, forecast, plan, target
        assert (np.abs(late - colour).max(axis=1) < 12).sum() > 20, colour
    assert (early != late).any(axis=1).sum() > 500


def test_a_long_run_is_thinned_out(tmp_path, monkeypatch):
    monkeypatch.setattr(animation, "MOST_FRAMES", 8)
    folder, _ = save(tmp_path / "run")
    with Image.open(write_animation(folder, tmp_path / "run.gif")) as film:
        assert film.n_frames == 8  # every fourth of 31


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_an_mp4_is_one_that_players_take(tmp_path):
    folder, history = save(tmp_path / "run")
    path = write_animation(folder, tmp_path / "film.mp4")
    command = ["ffprobe", "-v", "error", "-count_frames", "-show_streams", "-of", "json", str(path)]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)["streams"][0]
    assert (found["codec_name"], found["pix_fmt"]) == ("h264", "yuv420p")
    assert int(found["nb_read_frames"]) == len(history.t)
    assert float(found["duration"]) == pytest.approx(len(history.t) * synthetic_run.PERIOD, abs=0.05)


def test_without_ffmpeg_an_mp4_is_refused_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    folder, _ = save(tmp_path / "run")
    with pytest.raises(ValueError, match=r"film\.mp4, which needs ffmpeg.*allowed: \.gif, \.html"):
        write_animation(folder, tmp_path / "film.mp4")
    assert not (tmp_path / "film.mp4").exists()


def test_a_fault_leaves_no_file_and_keeps_the_old_one(tmp_path, monkeypatch):
    folder, _ = save(tmp_path / "run")
    page = tmp_path / "page.html"
    page.write_text("before")

    def fails(scene):
        raise RuntimeError("no")

    monkeypatch.setattr(animation, "animation_page", fails)
    with pytest.raises(RuntimeError):
        write_animation(folder, page)
    assert page.read_text() == "before"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["page.html", "run"]


@pytest.mark.parametrize("name", ["film.avi", "film"])
def test_other_endings_are_refused(tmp_path, name):
    with pytest.raises(ValueError, match=r"allowed: a name that ends in \.gif, \.mp4, \.html"):
        write_animation(tmp_path, tmp_path / name)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_regions_hold_95_per_cent(dimension):
    assert region_radius(dimension) == pytest.approx(np.sqrt(chi2.ppf(0.95, dimension)))
    root = np.random.default_rng(1).normal(size=(dimension, dimension))
    covariance = root @ root.T
    points = outline(covariance, (0, dimension - 1))
    # The outline of a shadow touches, in every direction u, the plane at r sqrt(u' S u).
    for angle in np.linspace(0.0, np.pi, 7):
        u = np.zeros(dimension)
        u[[0, dimension - 1]] = np.cos(angle), np.sin(angle)
        assert (points @ u[[0, dimension - 1]]).max() == pytest.approx(
            region_radius(dimension) * np.sqrt(u @ covariance @ u), rel=0.003
        )


def test_every_kind_of_run_can_be_drawn(tmp_path):
    """Without a plan, without a covariance, with a missed bearing, of a single step."""

    def unknown(history):
        bearing = history.bearing.copy()
        bearing[3] = np.nan
        return {"forecast_cov": np.full_like(history.forecast_cov, np.nan), "bearing": bearing}

    for number, options in enumerate(({"planner": False, "change": unknown}, {"steps": 1, "planner": False})):
        folder, history = save(tmp_path / str(number), **options)
        with Image.open(write_animation(folder, tmp_path / f"{number}.gif")) as film:
            assert film.n_frames == len(history.t)
        assert write_animation(folder, tmp_path / f"{number}.html").stat().st_size > 10_000
        assert Scene.load(folder).close_up() > 0.0


# The page

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")

PROBE = (Path(__file__).parent / "animation_probe.js").read_text(encoding="utf-8")


UTM = (565_432.1, 7_034_567.8, -30.0)
"""Where maps have their origin: seven digits before the point."""


def moved(offset):
    """A change of a history that puts everything in it somewhere else."""

    def change(history):
        d = history.dimension
        shift = np.asarray(offset[:d])
        return {
            "target": history.target + shift,
            "vehicle_pose": history.vehicle_pose + np.append(shift, 0.0),
            "forecast_mean": history.forecast_mean + shift,
            "plan": history.plan + np.append(shift, 0.0),
        }

    return change


def test_the_page_holds_times_and_positions_in_full(tmp_path):
    folder, history = save(tmp_path / "run", change=moved(UTM))
    text = write_animation(folder, tmp_path / "page.html").read_text(encoding="utf-8")
    arrays = json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', text, re.DOTALL)[1])["arrays"]

    def held(name):
        bits, data = arrays[name]
        return np.frombuffer(base64.b64decode(data), f"<f{bits // 8}")

    np.testing.assert_array_equal(held("t"), history.t)
    np.testing.assert_array_equal(held("target"), history.target.ravel())
    np.testing.assert_array_equal(held("vehicle"), history.vehicle_pose[:, :2].ravel())
    np.testing.assert_array_equal(held("mean"), history.forecast_mean.ravel())
    np.testing.assert_array_equal(held("plan").reshape(31, 6, 2)[:, 1:], history.plan[:, :, :2])
    np.testing.assert_allclose(held("distance"), Scene.load(folder).distance, rtol=1e-6)


@browser
@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), UTM], ids=["origin", "utm"])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.long
def test_the_page_plays_scrubs_and_tells_in_a_browser(tmp_path, dimension, offset):
    folder, history = save(tmp_path / "run", dimension, change=moved(offset))
    page = write_animation(folder, tmp_path / "page.html")
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"(src|href)\s*=|https?://|@import|url\(", text)  # nothing from elsewhere
    probed = tmp_path / "probed.html"
    probed.write_text(
        text.replace("</body>", f"<pre id='probe'></pre><script>{PROBE}</script></body>"), encoding="utf-8"
    )
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--window-size=1000,700"]
    command += [f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=8000", "--dump-dom"]
    done = subprocess.run([*command, probed.as_uri()], check=True, capture_output=True, text=True, timeout=120)
    found = json.loads(re.search(r'<pre id="probe">(.*?)</pre>', done.stdout, re.DOTALL)[1].replace("&gt;", ">"))

    assert "fault" not in found
    assert found["requests"] == 0
    assert found["max"] == str(len(history.t) - 1)
    read = found["scrubbed"]
    assert read["time"] == f"{history.t[12]:.2f} s"
    assert float(read["error, mean of forecast"].removesuffix(" m")) == pytest.approx(history.mean_error[12], rel=0.01)
    distance = np.linalg.norm(history.target[12] - history.vehicle_pose[12, :dimension])
    assert float(read["range"].removesuffix(" m")) == pytest.approx(distance, rel=0.01)
    assert read["solver"] == "solved"
    assert min(found["ink"]) > 1000

    def numbers(kind):
        return [float(number) for number in re.search(r"\((.*)\) m", found["tips"][kind])[1].split(",")]

    assert f"t = {history.t[25]:.2f} s" in found["tips"]["target"]
    np.testing.assert_allclose(numbers("target"), history.target[25], atol=6e-4)
    np.testing.assert_allclose(numbers("vehicle"), history.vehicle_pose[25, :dimension], atol=6e-4)
    np.testing.assert_allclose(numbers("forecast"), history.forecast_mean[12, -1], atol=6e-4)
    np.testing.assert_allclose(numbers("plan"), history.plan[12, -1, :dimension], atol=6e-4)
    assert "σx 0.2" in found["tips"]["forecast"]

    assert found["dragged"] > 5.0
    assert found["reset"] == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(found["followed"], 0.0, atol=1e-6)
    assert found["playing"] == "pause"
    assert 12 < found["played"] < len(history.t) - 1
    assert found["paused"] == found["played"]
    assert found["forward"] == found["played"] + 1
